//! Simulated twins of field recordings: what the sensors alone say, beside what the simulation knows.
//!
//! A twin is a recording of the scene `field-imu`, written and read in memory as any other recording. `analyze` estimates every metric from
//! the inertial sensors and the sound, and from the recorded state the same metric; their difference is the estimate's error.

use crate::pool::in_order;
use crate::statistics::summarise;
use analyze::examine::examine;
use analyze::request::Request;
use recording::read::{ReadOptions, Recording};
use recording::write::{RecordingWriter, WriterOptions};
use serde_json::{Value, json};
use sim::model::Model;
use sim::record::Recorder;
use sim::run::{method_of, run_model, settings};
use sim::scene::{Scene, load};
use std::io::Write;
use std::sync::atomic::AtomicBool;
use std::sync::{Arc, Mutex};

/// First seed of the twins.
pub const FIRST_SEED: u64 = 1001;

/// What is simulated: `field-imu` with some settings.
pub struct Condition {
    /// For people.
    pub name: &'static str,
    settings: &'static [&'static str],
    /// The clocks of the carriers' sensors are off; only what rests on those clocks is judged then.
    pub clocks_off: bool,
}

/// Carriers' clocks 200 ms and 50 ppm off, one fast and one slow; stamps may not lie before 1970.
const CLOCKS: [&str; 5] = [
    "epoch_s=1000.0",
    "effects.imu.sensors.1.clock_offset_s=0.2",
    "effects.imu.sensors.1.clock_drift_ppm=50.0",
    "effects.imu.sensors.2.clock_offset_s=-0.2",
    "effects.imu.sensors.2.clock_drift_ppm=-50.0",
];
/// Radios that lose three samples of a hundred, ten at a time.
const LOST: [&str; 2] = ["effects.imu.dropout=0.03", "effects.imu.dropout_row=10"];
/// Gyroscopes that nobody has calibrated: 3°/s off on every axis, one standard deviation.
const BIAS: &str = "effects.imu.gyro_bias_sd_rad_per_s=0.05";
/// What makes the scene `baseline` of it.
const BASELINE: [&str; 4] = [
    "effects.drum=false",
    "effects.music=false",
    "effects.lift=false",
    "effects.gait.sway_m=0.005",
];

/// The conditions, in the order of the table.
pub const CONDITIONS: &[Condition] = &[
    Condition {
        name: "music",
        settings: &[],
        clocks_off: false,
    },
    Condition {
        name: "baseline",
        settings: &BASELINE,
        clocks_off: false,
    },
    Condition {
        name: "music, samples lost",
        settings: &LOST,
        clocks_off: false,
    },
    Condition {
        name: "baseline, samples lost",
        settings: &[
            BASELINE[0],
            BASELINE[1],
            BASELINE[2],
            BASELINE[3],
            LOST[0],
            LOST[1],
        ],
        clocks_off: false,
    },
    Condition {
        name: "music, clocks off",
        settings: &CLOCKS,
        clocks_off: true,
    },
    Condition {
        name: "baseline, clocks off",
        settings: &[
            BASELINE[0],
            BASELINE[1],
            BASELINE[2],
            BASELINE[3],
            CLOCKS[0],
            CLOCKS[1],
            CLOCKS[2],
            CLOCKS[3],
            CLOCKS[4],
        ],
        clocks_off: true,
    },
    Condition {
        name: "music, gyroscopes off",
        settings: &[BIAS],
        clocks_off: false,
    },
    Condition {
        name: "baseline, gyroscopes off",
        settings: &[BASELINE[0], BASELINE[1], BASELINE[2], BASELINE[3], BIAS],
        clocks_off: false,
    },
];

/// How far an estimate may be off.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Bound {
    /// By so much, or by such a part of the truth, whichever is more.
    Within(f64, f64),
    /// Not at all: words, yes or no.
    Same,
    /// Nobody asked; shown all the same.
    Free,
}

/// A line of the table.
pub struct Row {
    /// Name of the metric.
    pub name: &'static str,
    /// For people, with the unit.
    pub label: &'static str,
    /// Digits after the point.
    pub digits: usize,
    /// How far it may be off.
    pub bound: Bound,
    /// How far it may be off while the carriers' clocks are.
    pub clocks_off: Option<Bound>,
}

const fn row(name: &'static str, label: &'static str, digits: usize, bound: Bound) -> Row {
    Row {
        name,
        label,
        digits,
        bound,
        clocks_off: None,
    }
}

/// What is compared.
pub const ROWS: &[Row] = &[
    row("rms_roll_deg", "RMS roll, deg", 2, Bound::Within(0.3, 0.03)),
    row("rms_pitch_deg", "RMS pitch, deg", 2, Bound::Free),
    row("t_float", "T_float", 4, Bound::Within(0.01, 0.0)),
    row("dz_pp_m", "Δz_pp, m", 4, Bound::Within(0.0, 0.1)),
    row("rms_z_m", "RMS height, m", 4, Bound::Free),
    Row {
        clocks_off: Some(Bound::Within(0.03, 0.0)),
        ..row("synchrony", "synchrony", 4, Bound::Within(0.02, 0.0))
    },
    Row {
        clocks_off: Some(Bound::Free),
        ..row("plv", "phase locking", 4, Bound::Free)
    },
    row("beat_hz", "beat, Hz", 5, Bound::Within(0.0, 0.002)),
    row("pull_rad_per_s", "pull, rad/s", 3, Bound::Free),
    row("beat_lead_deg", "lead over the beat, deg", 1, Bound::Free),
    row("peak_hz", "heave peak, Hz", 4, Bound::Free),
    row("h2_ratio", "second harmonic", 4, Bound::Free),
    row("growth_ratio", "growth", 4, Bound::Free),
    row("roll_peak_hz", "roll peak, Hz", 4, Bound::Free),
    row("onset_time_s", "onset, s", 2, Bound::Within(0.5, 0.0)),
    row("roll_excess_s", "beyond 15°, s", 2, Bound::Free),
    row("unstable", "unstable", 0, Bound::Same),
    row("mechanism", "mechanism", 0, Bound::Same),
];

/// One metric of one twin.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Seen {
    /// What the simulation knows; `None` for words and where it has none.
    pub truth: Option<f64>,
    /// Estimate minus truth; for words 0 (same) or 1. `None` where one of the two is missing.
    pub error: Option<f64>,
    /// The stated 95 % interval, less the truth: it should hold 0.
    pub interval: Option<[f64; 2]>,
    /// Neither has a value: nothing is to be judged.
    pub neither: bool,
    /// What both said, where they are words.
    pub said: Option<String>,
}

impl Seen {
    /// Whether it keeps a bound; `None` where there is nothing to judge.
    pub fn keeps(&self, bound: Bound) -> Option<bool> {
        if self.neither || bound == Bound::Free {
            return None;
        }
        let Some(error) = self.error else {
            return Some(false);
        };
        Some(match bound {
            Bound::Same => error == 0.0,
            Bound::Within(absolute, share) => {
                error.abs() <= absolute.max(share * self.truth.unwrap_or(0.0).abs())
            }
            Bound::Free => true,
        })
    }

    /// Whether its interval holds the truth; `None` without one.
    pub fn covered(&self) -> Option<bool> {
        self.interval.map(|[low, high]| low <= 0.0 && 0.0 <= high)
    }
}

/// One twin.
#[derive(Clone, Debug)]
pub struct Twin {
    /// Its seed.
    pub seed: u64,
    /// In the order of [`ROWS`].
    pub seen: Vec<Seen>,
}

/// The twins of one condition.
pub struct Found {
    /// Which.
    pub condition: &'static Condition,
    /// By seed.
    pub twins: Vec<Twin>,
}

/// What a recording is written to.
#[derive(Clone, Default)]
struct Bytes(Arc<Mutex<Vec<u8>>>);

impl Write for Bytes {
    fn write(&mut self, data: &[u8]) -> std::io::Result<usize> {
        self.0
            .lock()
            .unwrap_or_else(|e| e.into_inner())
            .extend_from_slice(data);
        Ok(data.len())
    }

    fn flush(&mut self) -> std::io::Result<()> {
        Ok(())
    }
}

/// The recording of a scene, in memory.
///
/// # Errors
/// When the run or the recording does not come to its end, as a sentence.
pub fn record(scene: &Scene) -> Result<Vec<u8>, String> {
    let model = Model::new(scene);
    let bytes = Bytes::default();
    let writer = RecordingWriter::to_stream(bytes.clone(), &WriterOptions::default())
        .map_err(|e| e.to_string())?;
    let mut recorder = Recorder::new(&model, writer).map_err(|e| e.to_string())?;
    let (_, outcome) = run_model(&model, method_of(scene), &settings(scene), &mut recorder);
    outcome.map_err(|e| e.to_string())?;
    recorder.finish().map_err(|e| e.to_string())?;
    let mut held = bytes.0.lock().unwrap_or_else(|e| e.into_inner());
    Ok(std::mem::take(&mut held))
}

/// Simulates a twin and judges what its sensors say.
///
/// # Errors
/// As a sentence: a scene that cannot be made, a run that stops.
pub fn twin(condition: &Condition, seed: u64) -> Result<Twin, String> {
    let mut given: Vec<String> = condition.settings.iter().map(|s| (*s).to_owned()).collect();
    // Nobody reads an energy account here.
    given.extend([format!("seed={seed}"), "solver.energy=false".into()]);
    let scene = load("field-imu", &given).map_err(|e| e.to_string())?;
    let recording = Recording::from_bytes(record(&scene)?, &ReadOptions::default())
        .map_err(|e| e.to_string())?;
    let request = Request {
        truth: true,
        // Lines and spectra of single signals are not asked for.
        signals: vec!["/rath/state.time_s".into()],
        ..Request::default()
    };
    let found = examine("twin", &recording, &request).map_err(|e| e.to_string())?;
    let seen = ROWS
        .iter()
        .map(|row| {
            let truth = found.metrics.get(row.name);
            let error = found.metrics.get(&format!("{}_error", row.name));
            let number = error.and_then(analyze::metrics::Value::as_f64);
            let said = truth
                .and_then(analyze::metrics::Value::as_word)
                .and(error)
                .and_then(|e| e.reason.clone());
            Seen {
                truth: truth.and_then(|v| v.as_f64().or_else(|| v.as_bool().map(f64::from))),
                error: number,
                interval: error.and_then(|e| e.ci95),
                neither: truth.is_none_or(|v| {
                    v.as_f64().is_none() && v.as_word().is_none() && v.as_bool().is_none()
                }) && number.is_none_or(|x| x == 0.0),
                said,
            }
        })
        .collect();
    Ok(Twin { seed, seen })
}

/// Simulates `seeds` twins of every condition from seed `first` on, on `jobs` threads (0: one per core); `done` is called after each.
///
/// # Errors
/// The first run that fails, or when `stop` was set, as a sentence.
pub fn twins(
    first: u64,
    seeds: u64,
    jobs: usize,
    stop: &AtomicBool,
    mut done: impl FnMut(),
) -> Result<Vec<Found>, String> {
    let mut found: Vec<Found> = CONDITIONS
        .iter()
        .map(|condition| Found {
            condition,
            twins: Vec::new(),
        })
        .collect();
    let count = seeds * CONDITIONS.len() as u64;
    let work = |k: u64| {
        let condition = &CONDITIONS[(k / seeds) as usize];
        twin(condition, first + k % seeds)
            .map_err(|e| format!("{} seed {}: {e}", condition.name, first + k % seeds))
    };
    in_order(count, jobs, stop, work, |k, twin| {
        found[(k / seeds) as usize].twins.push(twin?);
        done();
        Ok::<(), String>(())
    })?;
    if found.iter().any(|f| (f.twins.len() as u64) < seeds) {
        return Err("interrupted; nothing was written".into());
    }
    Ok(found)
}

/// Sums over the twins of one condition and metric.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Tally {
    /// Twins that can be judged, and those that keep the bound.
    pub kept: [usize; 2],
    /// Twins with an interval, and those whose interval holds the truth.
    pub covered: [usize; 2],
}

/// Counts kept bounds and intervals that hold the truth.
pub fn tally(found: &Found, row: usize, bound: Bound) -> Tally {
    let mut out = Tally::default();
    for seen in found.twins.iter().map(|t| &t.seen[row]) {
        let count = |pair: &mut [usize; 2], yes: Option<bool>| {
            if let Some(yes) = yes {
                pair[0] += 1;
                pair[1] += usize::from(yes);
            }
        };
        count(&mut out.kept, seen.keeps(bound));
        count(&mut out.covered, seen.covered());
    }
    out
}

/// The bound that a row has under a condition; `None` where it is not shown.
pub fn bound(row: &Row, condition: &Condition) -> Option<Bound> {
    if condition.clocks_off {
        row.clocks_off
    } else {
        Some(row.bound)
    }
}

/// Every metric whose interval is counted: kept and covered, all conditions with clocks together.
pub fn coverage(found: &[Found]) -> [usize; 2] {
    let mut sum = [0; 2];
    for f in found {
        for (k, row) in ROWS.iter().enumerate() {
            if bound(row, f.condition).is_some() {
                let [all, held] = tally(f, k, Bound::Free).covered;
                (sum[0], sum[1]) = (sum[0] + all, sum[1] + held);
            }
        }
    }
    sum
}

/// The table, as Markdown.
pub fn table(found: &[Found]) -> String {
    let seeds = || found.iter().flat_map(|f| &f.twins).map(|t| t.seed);
    let mut out = format!(
        "Twins of `field-imu`, seeds {} to {}: sensors alone minus truth\n\n\
         | | metric | truth, mean | error, mean ± SD | largest | bound | kept | in its 95 % interval |\n\
         |---|---|---|---|---|---|---|---|\n",
        seeds().min().unwrap_or(FIRST_SEED),
        seeds().max().unwrap_or(FIRST_SEED)
    );
    for f in found {
        for (k, row) in ROWS.iter().enumerate() {
            let Some(bound) = bound(row, f.condition) else {
                continue;
            };
            if f.twins.iter().all(|t| t.seen[k].neither) {
                continue;
            }
            out += &line(f, k, row, bound);
        }
    }
    let [all, held] = coverage(found);
    out += &format!(
        "\n{held} of {all} stated intervals hold the truth: {:.1} %.\n",
        100.0 * held as f64 / all.max(1) as f64
    );
    out
}

fn line(f: &Found, k: usize, row: &Row, bound: Bound) -> String {
    let sums = tally(f, k, bound);
    let of = |[all, some]: [usize; 2]| match all {
        0 => "–".to_owned(),
        _ => format!("{some} of {all}"),
    };
    let seen = || f.twins.iter().map(|t| &t.seen[k]);
    let d = row.digits;
    let word = bound == Bound::Same;
    let truth = summarise(seen().filter_map(|s| s.truth)).filter(|_| !word);
    let error = summarise(seen().filter_map(|s| s.error)).filter(|_| !word);
    let largest = seen()
        .filter_map(|s| s.error)
        .max_by(|a, b| a.abs().total_cmp(&b.abs()))
        .filter(|_| !word);
    let show = |x: Option<String>| x.unwrap_or_else(|| "–".into());
    let spread = |sd: Option<f64>| show(sd.map(|sd| format!("{sd:.d$}")));
    // What rounds to nothing has no sign.
    let unit = 10f64.powi(d as i32);
    let signed = |x: f64| format!("{:+.d$}", (x * unit).round() / unit + 0.0);
    let limit = match bound {
        Bound::Free => "–".into(),
        Bound::Same => "the same".into(),
        Bound::Within(a, 0.0) => format!("{a}"),
        Bound::Within(0.0, r) => format!("{} %", 100.0 * r),
        Bound::Within(a, r) => format!("{a} or {} %", 100.0 * r),
    };
    format!(
        "| {} | {} | {} | {} | {} | {limit} | {} | {} |\n",
        f.condition.name,
        row.label,
        show(truth.map(|s| format!("{:.d$}", s.mean))),
        show(error.map(|s| format!("{} ± {}", signed(s.mean), spread(s.sd)))),
        show(largest.map(signed)),
        of(sums.kept),
        of(sums.covered),
    )
}

/// Everything, for programs.
pub fn to_json(found: &[Found]) -> Value {
    let conditions: serde_json::Map<String, Value> = found
        .iter()
        .map(|f| {
            let metrics: serde_json::Map<String, Value> = ROWS
                .iter()
                .enumerate()
                .filter_map(|(k, row)| {
                    let sums = tally(f, k, bound(row, f.condition)?);
                    let runs: Vec<Value> = f
                        .twins
                        .iter()
                        .map(|t| {
                            let s = &t.seen[k];
                            json!({"seed": t.seed, "truth": s.truth, "error": s.error, "interval": s.interval, "said": s.said})
                        })
                        .collect();
                    Some((
                        row.name.to_owned(),
                        json!({"judged": sums.kept[0], "kept": sums.kept[1], "intervals": sums.covered[0], "covered": sums.covered[1], "runs": runs}),
                    ))
                })
                .collect();
            (f.condition.name.to_owned(), Value::Object(metrics))
        })
        .collect();
    let [all, held] = coverage(found);
    json!({"conditions": conditions, "intervals": all, "covered": held})
}

#[cfg(test)]
mod tests {
    use super::*;

    fn seen(settings: &'static [&'static str], seed: u64, name: &str) -> Seen {
        let condition = Condition {
            name: "test",
            settings,
            clocks_off: false,
        };
        let row = ROWS.iter().position(|row| row.name == name).unwrap();
        twin(&condition, seed).unwrap().seen[row].clone()
    }

    #[test]
    fn one_clock_seconds_off_does_not_make_a_wrong_synchrony() {
        const ONE: &[&str] = &["epoch_s=1000.0", "effects.imu.sensors.1.clock_offset_s=1.0"];
        const THREE: &[&str] = &["epoch_s=1000.0", "effects.imu.sensors.1.clock_offset_s=3.0"];
        for settings in [ONE, THREE] {
            let found = seen(settings, 1001, "synchrony");
            assert_eq!(found.covered(), Some(true), "{found:?}");
            assert_eq!(found.keeps(Bound::Within(0.02, 0.0)), Some(true));
            // Against the beat nothing tells where a step of them lies.
            assert_eq!(seen(settings, 1001, "beat_lead_deg").error, None);
        }
    }

    #[test]
    fn one_carrier_with_a_sensor_tells_the_pull_but_nothing_of_all() {
        const ONE: &[&str] =
            &[r#"effects.imu.sensors=[{on="rath", place_m=[0.5, 0.0, 0.3]}, {on="carrier_2"}]"#];
        for seed in [1001, 1002] {
            let found = seen(ONE, seed, "pull_rad_per_s");
            assert_eq!(found.covered(), Some(true), "{found:?}");
            for name in ["synchrony", "beat_lead_deg"] {
                assert_eq!(seen(ONE, seed, name).error, None, "{name}");
            }
        }
    }

    #[test]
    fn carriers_who_slip_past_the_beat_are_seen_as_they_are() {
        for settings in [
            &["effects.music.beat_hz=2.8"] as &[&str],
            &["effects.music.beat_hz=1.7"],
        ] {
            for name in ["synchrony", "pull_rad_per_s"] {
                let found = seen(settings, 2, name);
                assert_eq!(found.covered(), Some(true), "{name}: {found:?}");
            }
        }
    }
}
