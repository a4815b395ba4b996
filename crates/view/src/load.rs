//! From a recording to a [`Take`]: which signal is drawn as what.
//!
//! What metrics are made of comes from `analyze`, whole; the pose, the carriers and the ledger are collected; everything else streams
//! through once and is thinned on the way, so that an hour of ten sensors fits into memory.

use std::collections::BTreeMap;

use analyze::examine::{Request, examine};
use analyze::imu::orientation;
use analyze::spectrum::stream::WelchStream;
use analyze::spectrum::{DEFAULT_SEGMENT_S, Options, Spectrum};
use recording::read::{Batch, Info, ReadError, Recording};
use recording::signal::{Signal, unit_of};
use recording::{Finding, topics};

use crate::take::{Carriers, Curve, Ledger, Pose, Sensor, Shape, Take, Topic};
use crate::thin::Thin;

/// Points that all thinned curves together may have: what a viewer draws with ease.
const POINTS: u64 = 1_200_000;
/// Points that a curve has at least, however many there are.
const MIN_POINTS: u64 = 4_000;
/// Curves of one topic that are drawn; more would be no picture.
const MAX_CURVES: usize = 24;
/// Topics that are neither ours nor sensors and get a view of their own.
const MAX_TOPICS: usize = 12;
/// Height of the handles above the centre of mass where the recording does not say, m (the archive's rath).
const HANDLE_HEIGHT_M: f64 = 0.1;
/// The box that stands for the body, m, as in the recording's own URDF.
const BOX_M: [f64; 3] = [0.7, 0.5, 0.6];

/// Whether curves may be made coarser.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Detail {
    /// Curves with very many samples keep the extremes of short intervals.
    Thinned,
    /// Everything, for recordings that are still growing.
    Whole,
}

/// More messages than this are streamed only: metrics need whole columns in memory.
const MAX_EXAMINED: u64 = 3_000_000;

/// Reads what there is to draw. Returns what the reader found odd beside it.
pub fn load(
    name: &str,
    recording: &Recording,
    detail: Detail,
) -> Result<(Take, Vec<Finding>), ReadError> {
    let info = recording.info();
    let mut take = Take {
        name: name.to_owned(),
        start_ns: info.start_ns,
        end_ns: info.end_ns,
        growing: detail == Detail::Whole,
        ..Take::default()
    };
    name_of_scene(&mut take, info);
    let whole = info.messages <= MAX_EXAMINED;
    let plan = Plan::new(info, whole);
    let mut findings = Vec::new();
    if whole {
        examined(&mut take, recording)?;
    } else {
        take.notes.push(format!(
            "{} messages: curves and spectra only, no metrics.",
            info.messages
        ));
    }
    if !plan.ours.is_empty() {
        let (signals, found) = recording.signals(&|path| plan.is_whole(path))?;
        findings = found;
        let signals: BTreeMap<&str, &Signal> =
            signals.iter().map(|s| (s.path.as_str(), s)).collect();
        pose(&mut take, &signals);
        take.carriers = carriers(&signals);
        take.energy = energy(&signals);
        take.shape = shape(recording, &take);
    }
    others(&mut take, recording, &plan, detail, &mut findings)?;
    Ok((take, findings))
}

/// Metrics, events, remarks and the columns behind them, as `analyze` finds them.
fn examined(take: &mut Take, recording: &Recording) -> Result<(), ReadError> {
    // No list of signals is asked for: no topic has the empty name. (To name no signal would switch the estimates off.)
    let request = Request {
        topics: vec![String::new()],
        ..Request::default()
    };
    let analysis = examine(&take.name, recording, &request)?;
    // OK because the seconds came from nanoseconds of this recording.
    let at = |t_s: &[f64]| {
        t_s.iter()
            .map(|t| take.start_ns.saturating_add((t * 1e9).round() as i64))
            .collect::<Vec<i64>>()
    };
    take.state_ns = at(&analysis.inputs.t_s);
    take.force_ns = at(analysis.inputs.force_times());
    take.phase_ns = at(analysis.inputs.phase_times());
    take.window = analysis.window;
    take.metrics = analysis.metrics;
    let imu = analysis.roles.into_iter().find(|(role, _)| *role == "imu");
    take.main_imu = imu.and_then(|(_, topics)| topics.into_iter().next());
    take.events = analysis.events;
    take.remarks = analysis
        .quality
        .iter()
        .filter(|q| q.kind != "gap")
        .map(|q| (q.t_s, remark(&q.topic, &q.text)))
        .collect();
    take.notes.extend(analysis.warnings);
    take.inputs = analysis.inputs;
    Ok(())
}

fn remark(topic: &str, text: &str) -> String {
    if topic.is_empty() {
        text.to_owned()
    } else {
        format!("{topic}: {text}")
    }
}

/// Which topics are read how.
struct Plan<'a> {
    /// Topics of our own schemas, which have drawings of their own.
    ours: Vec<&'a str>,
    imus: Vec<&'a str>,
}

impl<'a> Plan<'a> {
    fn new(info: &'a Info, whole: bool) -> Self {
        let of = |schemas: &[&str]| -> Vec<&'a str> {
            let fits = |schema: &str| schemas.contains(&schema.replacen("/msg/", "/", 1).as_str());
            let mut topics: Vec<&str> = info
                .channels
                .iter()
                .filter(|c| c.messages > 0 && fits(&c.schema))
                .map(|c| c.topic.as_str())
                .collect();
            topics.sort_unstable();
            topics.dedup();
            topics
        };
        let schemas = [
            "rath.State",
            "rath.Phases",
            "rath.HandleForces",
            "rath.Energy",
            "rath.Beat",
            "foxglove.SceneUpdate",
            "tf2_msgs/TFMessage",
            "foxglove.FrameTransform",
            "foxglove.FrameTransforms",
        ];
        Plan {
            ours: if whole { of(&schemas) } else { Vec::new() },
            imus: of(&["sensor_msgs/Imu"]),
        }
    }

    fn is_ours(&self, topic: &str) -> bool {
        self.ours.contains(&topic)
    }

    /// Collected whole: the pose, the carriers' frames and the ledger.
    fn is_whole(&self, path: &str) -> bool {
        let pose = ["position_m", "orientation"]
            .iter()
            .any(|f| within(path, topics::STATE, f));
        pose || within(path, topics::ENERGY, "")
            || (within(path, topics::TF, "") && path.contains(".transform.translation."))
    }

    /// Streamed and thinned: sensors and everything that is not ours.
    fn is_streamed(&self, path: &str) -> bool {
        !self.ours.iter().any(|topic| within(path, topic, "")) && is_measurement(path)
    }
}

/// Whether a path is `TOPIC.FIELD…`. A topic may have dots of its own, so it is never cut out of a path.
fn within(path: &str, topic: &str, field: &str) -> bool {
    path.strip_prefix(topic)
        .and_then(|rest| rest.strip_prefix('.'))
        .is_some_and(|rest| rest.starts_with(field))
}

/// Stamps, covariances and status fields are no curves that anybody wants to see.
fn is_measurement(path: &str) -> bool {
    ![
        "covariance",
        ".stamp.",
        ".header.",
        ".seq",
        ".sec",
        ".nanosec",
    ]
    .iter()
    .any(|word| path.contains(word))
}

/// The scene's name and seed, where the recording says them.
fn name_of_scene(take: &mut Take, info: &Info) {
    let Some(meta) = info.metadata.get("rath") else {
        return;
    };
    if let Some(scene) = meta.get("scene") {
        let seed = meta
            .get("seed")
            .map(|seed| format!(", seed {seed}"))
            .unwrap_or_default();
        take.name = format!("{scene}{seed}");
    }
}

/// Signals in a row, `NAME[0]`, `NAME[1]`, … as far as they have the times of the first.
fn numbered<'s>(signals: &BTreeMap<&str, &'s Signal>, pattern: &str) -> Vec<&'s Signal> {
    let mut out: Vec<&Signal> = Vec::new();
    while let Some(signal) = signals.get(
        pattern
            .replacen("[*]", &format!("[{}]", out.len()), 1)
            .as_str(),
    ) {
        if out
            .first()
            .is_some_and(|first| first.times_ns != signal.times_ns)
        {
            break;
        }
        out.push(signal);
    }
    out
}

/// Where the body is, on the times of the state.
fn pose(take: &mut Take, signals: &BTreeMap<&str, &Signal>) {
    let parts = |field: &str, names: &[&str]| -> Option<Vec<&Signal>> {
        let path = |name: &&str| format!("{}.{field}.{name}", topics::STATE);
        names
            .iter()
            .map(|n| signals.get(path(n).as_str()).copied())
            .collect()
    };
    let Some(p) = parts("position_m", &["x", "y", "z"]) else {
        return;
    };
    let Some(q) = parts("orientation", &["x", "y", "z", "w"]) else {
        return;
    };
    let times = &p[0].times_ns;
    if p.iter().chain(&q).any(|s| s.times_ns != *times) {
        return;
    }
    take.pose = Some(Pose {
        times_ns: times.to_vec(),
        position_m: (0..times.len())
            .map(|k| [0, 1, 2].map(|i| p[i].values[k]))
            .collect(),
        orientation: (0..times.len())
            .map(|k| [0, 1, 2, 3].map(|i| q[i].values[k]))
            .collect(),
    });
}

/// The carriers' frames in `/tf`: the first transform is the body's, the others are theirs.
fn carriers(signals: &BTreeMap<&str, &Signal>) -> Option<Carriers> {
    let axis = |name: &str| {
        numbered(
            signals,
            &format!("{}.transforms[*].transform.translation.{name}", topics::TF),
        )
    };
    let axes = ["x", "y", "z"].map(axis);
    let count = axes.iter().map(Vec::len).min()?;
    if count < 2 {
        return None;
    }
    let times_ns = axes[0][0].times_ns.to_vec();
    let points_m = (1..count)
        .map(|i| {
            (0..times_ns.len())
                .map(|k| [0, 1, 2].map(|a| axes[a][i].values[k]))
                .collect()
        })
        .collect();
    Some(Carriers { times_ns, points_m })
}

/// Handles as the attached scene gives them; otherwise where the carriers are beside the body, at the middle of what they do.
fn shape(recording: &Recording, take: &Take) -> Shape {
    let from_scene = || -> Option<Vec<[f64; 3]>> {
        let text = String::from_utf8(recording.attachment("scene.toml")?).ok()?;
        let scene: toml::Table = text.parse().ok()?;
        let handles = scene.get("carriers")?.get("handles_m")?.as_array()?;
        let number = |v: &toml::Value| v.as_float().or_else(|| v.as_integer().map(|i| i as f64));
        handles
            .iter()
            .map(|h| {
                let h = h.as_array()?;
                (h.len() == 3).then_some(())?;
                Some([number(&h[0])?, number(&h[1])?, number(&h[2])?])
            })
            .collect()
    };
    let beside = || -> Option<Vec<[f64; 3]>> {
        let (carriers, pose) = (take.carriers.as_ref()?, take.pose.as_ref()?);
        if carriers.times_ns != pose.times_ns {
            return None;
        }
        let middle = |mut x: Vec<f64>| -> f64 {
            x.retain(|x| x.is_finite());
            x.sort_by(f64::total_cmp);
            x.get(x.len() / 2).copied().unwrap_or(0.0)
        };
        let offset = |points: &Vec<[f64; 3]>, axis: usize| {
            middle(
                points
                    .iter()
                    .zip(&pose.position_m)
                    .map(|(c, p)| c[axis] - p[axis])
                    .collect(),
            )
        };
        let round = |x: f64| (x * 100.0).round() / 100.0;
        Some(
            carriers
                .points_m
                .iter()
                .map(|c| [round(offset(c, 0)), round(offset(c, 1)), HANDLE_HEIGHT_M])
                .collect(),
        )
    };
    Shape {
        handles_m: from_scene().or_else(beside).unwrap_or_default(),
        box_m: BOX_M,
    }
}

/// The ledger; the potential, whose zero is arbitrary, is counted from its mean.
fn energy(signals: &BTreeMap<&str, &Signal>) -> Option<Ledger> {
    const COLUMNS: [(&str, &str); 6] = [
        ("kinetic", "kinetic_j"),
        ("potential about its mean", "potential_j"),
        ("elastic", "elastic_j"),
        ("work in", "work_in_j"),
        ("dissipated", "dissipated_j"),
        ("unexplained", "unexplained_j"),
    ];
    let mut ledger = Ledger::default();
    for (name, field) in COLUMNS {
        let Some(signal) = signals.get(format!("{}.{field}", topics::ENERGY).as_str()) else {
            continue;
        };
        if ledger.times_ns.is_empty() {
            ledger.times_ns = signal.times_ns.to_vec();
        }
        if signal.times_ns[..] == ledger.times_ns[..] {
            let mean = || signal.values.iter().sum::<f64>() / signal.values.len().max(1) as f64;
            let from = if field == "potential_j" { mean() } else { 0.0 };
            ledger
                .columns
                .push((name, signal.values.iter().map(|j| j - from).collect()));
        }
    }
    (!ledger.columns.is_empty()).then_some(ledger)
}

/// A sensor while it streams by.
struct SensorStream {
    gyro: [Thin; 3],
    accel: [Thin; 3],
    gyro_spectra: [Option<WelchStream>; 3],
    accel_spectra: [Option<WelchStream>; 3],
    filter: Option<orientation::Causal>,
    attitude: [Thin; 2],
    last_ns: Option<i64>,
    period_s: f64,
}

/// Sensors and all topics that are not ours, in one pass.
fn others(
    take: &mut Take,
    recording: &Recording,
    plan: &Plan<'_>,
    detail: Detail,
    findings: &mut Vec<Finding>,
) -> Result<(), ReadError> {
    let info = recording.info();
    let messages: BTreeMap<&str, u64> = info
        .channels
        .iter()
        .map(|c| (c.topic.as_str(), c.messages))
        .collect();
    let curves = 8 * plan.imus.len() as u64
        + info
            .channels
            .iter()
            .filter(|c| !plan.is_ours(&c.topic) && !plan.imus.contains(&c.topic.as_str()))
            .count() as u64
            * 6;
    if curves == 0 {
        return Ok(());
    }
    let points = match detail {
        Detail::Thinned => (POINTS / curves).max(MIN_POINTS),
        Detail::Whole => u64::MAX,
    };
    let (start_ns, end_ns) = (info.start_ns, info.end_ns);
    let span_s = take.duration_s();
    let mut coarsest_ns = 0;
    let mut thin = |name: &str, topic: &str| {
        let thin = Thin::new(
            name,
            start_ns,
            end_ns,
            messages.get(topic).copied().unwrap_or(0),
            points,
        );
        coarsest_ns = coarsest_ns.max(thin.interval_ns());
        thin
    };
    let mut sensors: BTreeMap<&str, SensorStream> = BTreeMap::new();
    for topic in &plan.imus {
        let count = messages.get(topic).copied().unwrap_or(0);
        if count < 2 || span_s <= 0.0 {
            continue;
        }
        let rate_hz = (count - 1) as f64 / span_s;
        let welch =
            || WelchStream::new(rate_hz, &Options::seconds(DEFAULT_SEGMENT_S, rate_hz)).ok();
        let axes = ["x", "y", "z"];
        sensors.insert(
            topic,
            SensorStream {
                gyro: axes.map(|a| thin(a, topic)),
                accel: axes.map(|a| thin(a, topic)),
                gyro_spectra: axes.map(|_| welch()),
                accel_spectra: axes.map(|_| welch()),
                filter: None,
                attitude: ["roll", "pitch"].map(|a| thin(a, topic)),
                last_ns: None,
                period_s: 1.0 / rate_hz,
            },
        );
    }
    let mut plain: BTreeMap<String, Vec<(String, String, Thin)>> = BTreeMap::new();
    // The second pass looks at other fields of the same file: what is odd about it was said in the first.
    let more = recording.stream(&|path| plan.is_streamed(path), &mut |batch: &Batch<'_>| {
        if let Some(sensor) = sensors.get_mut(batch.topic) {
            sensor.push(batch);
            return;
        }
        let known = plain.len();
        let Some(topic) = (match plain.contains_key(batch.topic) {
            true => plain.get_mut(batch.topic),
            false if known < MAX_TOPICS => Some(plain.entry(batch.topic.to_owned()).or_default()),
            false => None,
        }) else {
            return;
        };
        for column in batch.columns {
            let field = column
                .path
                .strip_prefix(batch.topic)
                .unwrap_or(column.path)
                .trim_start_matches('.');
            let at = match topic.iter().position(|(name, ..)| name == field) {
                Some(at) => at,
                None if topic.len() < MAX_CURVES => {
                    let unit = unit_of(batch.schema, field).to_owned();
                    topic.push((field.to_owned(), unit, thin(field, batch.topic)));
                    topic.len() - 1
                }
                None => continue,
            };
            push(&mut topic[at].2, batch.times_ns, column.rows, column.values);
        }
    })?;
    for finding in more {
        if !findings.contains(&finding) {
            findings.push(finding);
        }
    }
    take.imus = sensors
        .into_iter()
        .map(|(topic, sensor)| sensor.finish(topic))
        .filter(Sensor::has_any)
        .collect();
    // The load's own sensor comes first.
    take.imus
        .sort_by_key(|sensor| Some(&sensor.topic) != take.main_imu.as_ref());
    take.topics = plain
        .into_iter()
        .map(|(name, curves)| topic(name, curves))
        .filter(|t| !t.plots.is_empty())
        .collect();
    if coarsest_ns > 0 {
        take.notes.push(format!(
            "Curves with many samples show the smallest and the largest value of every {:.3} s at their own times.",
            coarsest_ns as f64 / 1e9
        ));
    }
    Ok(())
}

fn push(thin: &mut Thin, times_ns: &[i64], rows: Option<&[u32]>, values: &[f64]) {
    match rows {
        None => thin.push(times_ns, values),
        Some(rows) => {
            let times: Vec<i64> = rows.iter().map(|row| times_ns[*row as usize]).collect();
            thin.push(&times, values);
        }
    }
}

impl SensorStream {
    fn push(&mut self, batch: &Batch<'_>) {
        let mut columns: [Option<&[f64]>; 6] = [None; 6];
        for column in batch.columns {
            let of = |field: &str, base: usize| {
                let axis = column
                    .path
                    .strip_prefix(batch.topic)?
                    .strip_prefix('.')?
                    .strip_prefix(field)?;
                Some(base + ["x", "y", "z"].iter().position(|a| *a == axis)?)
            };
            let Some(k) = of("angular_velocity.", 0).or_else(|| of("linear_acceleration.", 3))
            else {
                continue;
            };
            let (thin, welch) = match k {
                0..3 => (&mut self.gyro[k], &mut self.gyro_spectra[k]),
                _ => (&mut self.accel[k - 3], &mut self.accel_spectra[k - 3]),
            };
            push(thin, batch.times_ns, column.rows, column.values);
            match welch {
                Some(welch) if column.values.iter().all(|x| x.is_finite()) => {
                    welch.push(column.values)
                }
                // A hole in the samples would be a jump in the phase of every line: no spectrum rather than a wrong one.
                welch => *welch = None,
            }
            if column.rows.is_none() {
                columns[k] = Some(column.values);
            }
        }
        if let [Some(gx), Some(gy), Some(gz), Some(ax), Some(ay), Some(az)] = columns {
            self.turn(batch.times_ns, [gx, gy, gz], [ax, ay, az]);
        }
    }

    /// Runs the causal orientation filter over a batch.
    fn turn(&mut self, times_ns: &[i64], gyro: [&[f64]; 3], accel: [&[f64]; 3]) {
        let period_s = self.period_s;
        let filter = self.filter.get_or_insert_with(|| {
            orientation::Causal::new(period_s, orientation::Options::default())
        });
        let mut times = Vec::with_capacity(times_ns.len());
        let mut angles = [
            Vec::with_capacity(times_ns.len()),
            Vec::with_capacity(times_ns.len()),
        ];
        for (k, t) in times_ns.iter().enumerate() {
            let (w, a) = (gyro.map(|g| g[k]), accel.map(|a| a[k]));
            let dt_s = self
                .last_ns
                .map_or(period_s, |last| t.saturating_sub(last) as f64 / 1e9);
            let whole = w.iter().chain(&a).all(|x| x.is_finite());
            if dt_s <= 0.0 || !whole {
                continue;
            }
            self.last_ns = Some(*t);
            let (roll, pitch, _) = filter.update(dt_s, w, a).euler_angles();
            times.push(*t);
            angles[0].push(roll.to_degrees());
            angles[1].push(pitch.to_degrees());
        }
        for (thin, angles) in self.attitude.iter_mut().zip(&angles) {
            thin.push(&times, angles);
        }
    }

    fn finish(self, topic: &str) -> Sensor {
        let curves = |thin: [Thin; 3]| -> Vec<Curve> {
            let curves: Vec<Curve> = thin.into_iter().map(Thin::finish).collect();
            // A field that the sensor does not have stands in its messages as zeros.
            let any = |c: &Curve| c.values.iter().any(|x| x.is_finite() && *x != 0.0);
            if curves.iter().any(any) {
                curves
            } else {
                Vec::new()
            }
        };
        let spectra = |welch: [Option<WelchStream>; 3]| -> Vec<Spectrum> {
            let all: Option<Vec<Spectrum>> = welch.into_iter().map(|w| w?.finish().ok()).collect();
            all.unwrap_or_default()
        };
        let attitude: Vec<Curve> = self.attitude.into_iter().map(Thin::finish).collect();
        let (gyro, accel) = (curves(self.gyro), curves(self.accel));
        // Without a gyroscope there is an average inclination at best: nothing to call a roll.
        let none = gyro.is_empty() || attitude[0].values.is_empty();
        Sensor {
            topic: topic.to_owned(),
            gyro,
            accel,
            attitude: if none { Vec::new() } else { attitude },
            gyro_spectra: spectra(self.gyro_spectra),
            accel_spectra: spectra(self.accel_spectra),
        }
    }
}

impl Sensor {
    fn has_any(&self) -> bool {
        !self.gyro.is_empty() || !self.accel.is_empty()
    }
}

/// A plain topic: curves of one unit share a plot.
fn topic(name: String, curves: Vec<(String, String, Thin)>) -> Topic {
    let mut plots: Vec<(String, Vec<Curve>)> = Vec::new();
    for (_, unit, thin) in curves {
        let curve = thin.finish();
        if !curve.values.iter().any(|x| x.is_finite()) {
            continue;
        }
        match plots.iter_mut().find(|(u, _)| *u == unit) {
            Some((_, curves)) => curves.push(curve),
            None => plots.push((unit, vec![curve])),
        }
    }
    Topic { name, plots }
}
