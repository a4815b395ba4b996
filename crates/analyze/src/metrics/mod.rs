//! Every metric, in one table. Each output format reads this table and nothing else: to add a metric, write a function
//! in a family's file and add its line to [`METRICS`].

mod angles;
mod beat;
mod contact;
mod context;
mod drive;
mod height;
mod lines;
mod onset;
mod together;

pub use contact::FLOAT_SHARE;
pub use context::{Context, Need};
pub use drive::evidence as mechanism_evidence;
pub use onset::{ONSET_ROLL_DEG, ONSET_STRETCH_S, onset_s, stretch_samples};

use serde::ser::{Serialize, SerializeMap, Serializer};

use crate::inputs::{Inputs, Window};

/// What a metric came out as.
#[derive(Clone, Debug, PartialEq)]
pub enum Datum {
    /// A finite number.
    Number(f64),
    /// Yes or no.
    Bool(bool),
    /// One of a few words.
    Word(&'static str),
    /// Nothing; [`Value::reason`] says why.
    Missing,
}

/// One metric's result.
#[derive(Clone, Debug, PartialEq)]
pub struct Value {
    /// The result itself.
    pub datum: Datum,
    /// Unit, `1` for pure numbers, `bool`, or `-` for words.
    pub unit: &'static str,
    /// Which measurement it rests on: `state`, `forces`, `phases`, `imu`, ...
    pub source: String,
    /// Per handle or carrier, or the ends of a band, as the definition says.
    pub per: Vec<f64>,
    /// Ends of a 95 % interval of an estimated value.
    pub ci95: Option<[f64; 2]>,
    /// Why there is no value, or the evidence behind a word.
    pub reason: Option<String>,
}

impl Value {
    /// A number; one that is not finite becomes a missing value with that as its reason.
    pub fn number(x: f64) -> Self {
        if !x.is_finite() {
            return Value::missing(
                "the result is not a finite number: the data hold nothing to divide by",
            );
        }
        Value {
            datum: Datum::Number(x),
            ..Value::missing("")
        }
        .without_reason()
    }

    /// Yes or no.
    pub fn bool(x: bool) -> Self {
        Value {
            datum: Datum::Bool(x),
            ..Value::missing("")
        }
        .without_reason()
    }

    /// A word and its evidence.
    pub fn word(word: &'static str, evidence: String) -> Self {
        Value {
            datum: Datum::Word(word),
            ..Value::missing(evidence)
        }
    }

    /// No value, and why.
    pub fn missing(reason: impl Into<String>) -> Self {
        Value {
            datum: Datum::Missing,
            unit: "",
            source: String::new(),
            per: Vec::new(),
            ci95: None,
            reason: Some(reason.into()),
        }
    }

    /// With numbers beside it; if one is not finite, none is kept.
    pub fn per(mut self, per: Vec<f64>) -> Self {
        if per.iter().all(|x| x.is_finite()) {
            self.per = per;
        }
        self
    }

    /// With a remark, where it has a value: else what it says already is why not.
    pub fn remark(mut self, remark: Option<String>) -> Self {
        if self.datum != Datum::Missing {
            self.reason = remark;
        }
        self
    }

    /// With another source than its column's.
    pub fn source(mut self, source: impl Into<String>) -> Self {
        self.source = source.into();
        self
    }

    /// Takes the result back and says why; unit and source stay.
    pub fn withhold(&mut self, reason: impl Into<String>) {
        let kept = std::mem::take(&mut self.source);
        *self = Value {
            unit: self.unit,
            ..Value::missing(reason).source(kept)
        };
    }

    /// With a 95 % interval.
    pub fn ci95(mut self, low: f64, high: f64) -> Self {
        self.ci95 = (low.is_finite() && high.is_finite()).then_some([low, high]);
        self
    }

    fn without_reason(mut self) -> Self {
        self.reason = None;
        self
    }

    /// The number, if it is one.
    pub fn as_f64(&self) -> Option<f64> {
        match self.datum {
            Datum::Number(x) => Some(x),
            _ => None,
        }
    }

    /// The yes or no, if it is one.
    pub fn as_bool(&self) -> Option<bool> {
        match self.datum {
            Datum::Bool(x) => Some(x),
            _ => None,
        }
    }

    /// The word, if it is one.
    pub fn as_word(&self) -> Option<&'static str> {
        match self.datum {
            Datum::Word(x) => Some(x),
            _ => None,
        }
    }
}

impl Serialize for Value {
    fn serialize<S: Serializer>(&self, s: S) -> Result<S::Ok, S::Error> {
        let mut map = s.serialize_map(None)?;
        match &self.datum {
            Datum::Number(x) => map.serialize_entry("value", x)?,
            Datum::Bool(x) => map.serialize_entry("value", x)?,
            Datum::Word(x) => map.serialize_entry("value", x)?,
            Datum::Missing => map.serialize_entry("value", &())?,
        }
        map.serialize_entry("unit", self.unit)?;
        map.serialize_entry("source", &self.source)?;
        if !self.per.is_empty() {
            map.serialize_entry("per", &self.per)?;
        }
        if let Some(ci95) = &self.ci95 {
            map.serialize_entry("ci95", ci95)?;
        }
        if let Some(reason) = &self.reason {
            map.serialize_entry("reason", reason)?;
        }
        map.end()
    }
}

/// A line of the table.
pub struct Metric {
    /// Its name in every output.
    pub name: &'static str,
    /// Its unit.
    pub unit: &'static str,
    /// What it is called in tables for people.
    pub label: &'static str,
    /// Its definition in one or two sentences; W is the analysis window.
    pub definition: &'static str,
    /// Where the definition comes from.
    pub origin: &'static str,
    /// The columns it cannot do without.
    pub needs: &'static [Need],
    /// The function.
    pub compute: fn(&Context) -> Value,
}

const PAPER: &str = "paper, section Metrics";
const ARCHIVE: &str = "archive, stats.json";

/// Every metric, in the order in which it is shown.
pub const METRICS: &[Metric] = &[
    Metric {
        name: "rms_roll_deg",
        unit: "deg",
        label: "RMS roll",
        needs: &[Need::Roll],
        compute: angles::rms_roll_deg,
        origin: PAPER,
        definition: "Root mean square about zero of the roll over W.",
    },
    Metric {
        name: "rms_pitch_deg",
        unit: "deg",
        label: "RMS pitch (tilt of the pole)",
        needs: &[Need::Pitch],
        compute: angles::rms_pitch_deg,
        origin: "as RMS roll",
        definition: "Root mean square about zero of the pitch, the tilt of the pole, over W.",
    },
    Metric {
        name: "rms_yaw_deg",
        unit: "deg",
        label: "RMS yaw",
        needs: &[Need::Yaw],
        compute: angles::rms_yaw_deg,
        origin: "archive, stats.json (its rms_pitch_deg)",
        definition: "Root mean square about zero of the yaw over W.",
    },
    Metric {
        name: "contact_loss",
        unit: "1",
        label: "contact loss, any handle",
        needs: &[Need::Forces],
        compute: contact::contact_loss,
        origin: PAPER,
        definition: "Fraction of samples in W with at least one normal force N_i ≤ 0.",
    },
    Metric {
        name: "contact_loss_mean",
        unit: "1",
        label: "contact loss, mean of handles",
        needs: &[Need::Forces],
        compute: contact::contact_loss_mean,
        origin: "paper, Table 1; archive, stats.json",
        definition: "Mean over handles of the fraction of samples in W with N_i ≤ 0; `per` lists the handles.",
    },
    Metric {
        name: "step_rate_hz",
        unit: "Hz",
        label: "step rate",
        needs: &[Need::Steps],
        compute: together::step_rate_hz,
        origin: "docs/field.md",
        definition: "Steps per second: one over the mean interval between steps, pauses left out, over W; the mean of the carriers who take three steps in it, `per` lists them.",
    },
    Metric {
        name: "synchrony",
        unit: "1",
        label: "synchrony",
        needs: &[Need::Phases],
        compute: together::synchrony,
        origin: "Acebrón et al. 2005",
        definition: "Mean over W of Kuramoto's order parameter r(t) = |(1/N) Σ exp(iφ_j)| of N ≥ 2 carriers.",
    },
    Metric {
        name: "synchrony_chance",
        unit: "1",
        label: "synchrony by chance",
        needs: &[Need::Phases],
        compute: together::synchrony_chance,
        origin: "Kluyver 1906; docs/metrics.md",
        definition: "Mean r of N independent, uniform phases (2/π for two); `per` is the interval that holds 95 % of r at a moment. For measured phases: mean and 95 % interval of time-shifted surrogates, and the p-value of the synchrony among them.",
    },
    Metric {
        name: "plv",
        unit: "1",
        label: "phase locking of pairs",
        needs: &[Need::Phases],
        compute: together::plv,
        origin: "Lachaux et al. 1999",
        definition: "Mean over pairs of carriers of |⟨exp(i(φ_j − φ_k))⟩| over W; `per` lists the pairs (1,2), (1,3), ...",
    },
    Metric {
        name: "beat_synchrony",
        unit: "1",
        label: "locking to the beat",
        needs: &[Need::Phases, Need::Beat, Need::PhasesInBeat],
        compute: together::beat_synchrony,
        origin: "Lachaux et al. 1999",
        definition: "Mean over carriers of |⟨exp(i(φ_j − ψ))⟩| over the part of W in which a beat sounds; `per` lists the carriers.",
    },
    Metric {
        name: "beat_hz",
        unit: "Hz",
        label: "beat",
        needs: &[Need::Beat],
        compute: together::beat_hz,
        origin: "docs/metrics.md",
        definition: "Advance of the beat's phase over 2π and the time, over the part of W in which a beat sounds: pauses and lost messages are neither in the one nor in the other. From beats as such: along their slow course, without each beat's own error; a beat that is missing among others is counted.",
    },
    Metric {
        name: "beat_lead_deg",
        unit: "deg",
        label: "lead over the beat",
        needs: &[Need::Phases, Need::Beat, Need::PhasesInBeat],
        compute: beat::beat_lead_deg,
        origin: "Mardia & Jupp 2000",
        definition: "Circular mean, over the carriers who follow the beat (|⟨exp(i(φ_j − ψ))⟩| ≥ 0.5), of each one's circular mean of φ_j − ψ over the part of W in which a beat sounds, positive ahead of the beat; `per` lists all carriers. Phases that steps tell are counted as a model's: 0 on the way up, a step at −90°.",
    },
    Metric {
        name: "detuning_rad_per_s",
        unit: "rad/s",
        label: "detuning from the beat",
        needs: &[Need::Phases, Need::Beat, Need::PhasesInBeat],
        compute: beat::detuning_rad_per_s,
        origin: "Adler 1946",
        definition: "Δω = ω_j − Ω, what a carrier would do alone less the mean beat: the mean of the carriers, `per` lists them, the reason their 95 % intervals. From all phases about the first beat (60 s before to 90 s after it), whatever W: the most likely ones under Adler's equation with a growing pull.",
    },
    Metric {
        name: "pull_rad_per_s",
        unit: "rad/s",
        label: "pull of the beat",
        needs: &[Need::Phases, Need::Beat, Need::PhasesInBeat],
        compute: beat::pull_rad_per_s,
        origin: "Adler 1946",
        definition: "K of Adler's equation φ̇_j = ω_j + K m(t) sin(ψ + Δ_j − φ_j) + noise, m(t) = 1 − exp(−(t − t₀)/τ) from the first beat t₀ on: as implied by how carriers come to the beat or slip past it, from the same phases as the detuning, with what carriers do to each other beside it. No value where any stronger pull explains them too; the reason gives the bound.",
    },
    Metric {
        name: "coupling_rad_per_s",
        unit: "rad/s",
        label: "coupling of carriers",
        needs: &[Need::Phases, Need::Beat, Need::PhasesInBeat],
        compute: beat::coupling_rad_per_s,
        origin: "Kuramoto 1975",
        definition: "K_c of φ̇_j = … + (K_c/N) Σ_k sin(φ_k − φ_j): how strongly carriers mind each other, everybody everybody alike, found together with the pull. No value where its 95 % interval reaches farther than 1 rad/s to either side; the reason gives it.",
    },
    Metric {
        name: "captured",
        unit: "bool",
        label: "captured by the beat",
        needs: &[Need::Phases, Need::Beat, Need::PhasesInBeat],
        compute: beat::captured,
        origin: "Adler 1946",
        definition: "Whether every carrier stays with the beat over the part of W in which it sounds: |⟨exp(i(φ_j − ψ))⟩| ≥ 0.9, no turn of φ_j − ψ, and, where detuning and pull are known, inside the capture range, |Δω| ≤ K.",
    },
    Metric {
        name: "roll_lock",
        unit: "-",
        label: "roll to beat",
        needs: &[Need::Roll, Need::Beat, Need::RollLine],
        compute: beat::roll_lock,
        origin: "Tass et al. 1998",
        definition: "The ratio q:p of 1:1, 1:2, 2:1, 2:3, 3:2 cycles of roll to cycles of the beat that holds most firmly over W, by |⟨exp(i(pφ − qψ))⟩| with φ from the analytic signal of the roll, 2 s left out at both ends; `none` below 0.9, no value below 8 s. The reason gives all of them.",
    },
    Metric {
        name: "onset_time_s",
        unit: "s",
        label: "onset of instability",
        needs: &[Need::Roll],
        compute: onset::onset_time_s,
        origin: ARCHIVE,
        definition: "End of the first 2 s stretch (60 samples at 30 Hz) inside W whose RMS roll exceeds 10°.",
    },
    Metric {
        name: "unstable",
        unit: "bool",
        label: "unstable",
        needs: &[Need::Roll],
        compute: onset::unstable,
        origin: PAPER,
        definition: "Whether there is an onset.",
    },
    Metric {
        name: "roll_excess_s",
        unit: "s",
        label: "time beyond 15° roll",
        needs: &[Need::Roll],
        compute: angles::roll_excess_s,
        origin: ARCHIVE,
        definition: "Samples in W with |roll| > 15°, times the mean sampling step.",
    },
    Metric {
        name: "dz_pp_m",
        unit: "m",
        label: "height, peak to peak",
        needs: &[Need::Height],
        compute: height::dz_pp_m,
        origin: "paper, eq. (dzpp)",
        definition: "Largest minus smallest height in W.",
    },
    Metric {
        name: "rms_z_m",
        unit: "m",
        label: "height, SD",
        needs: &[Need::Height],
        compute: height::rms_z_m,
        origin: ARCHIVE,
        definition: "Population standard deviation of the height over W.",
    },
    Metric {
        name: "z_mean_m",
        unit: "m",
        label: "height, mean",
        needs: &[Need::Height],
        compute: height::z_mean_m,
        origin: ARCHIVE,
        definition: "Mean height over W.",
    },
    Metric {
        name: "t_float",
        unit: "1",
        label: "unloaded time",
        needs: &[Need::Support],
        compute: contact::t_float,
        origin: "paper, eq. (tfloat), ε = 0.05",
        definition: "Fraction of samples in W with N_tot ≤ 0.05·M·g.",
    },
    Metric {
        name: "peak_hz",
        unit: "Hz",
        label: "height, strongest line",
        needs: &[Need::HeightLine],
        compute: lines::peak_hz,
        origin: ARCHIVE,
        definition: "Frequency of the largest magnitude of the unwindowed real Fourier transform of the height about its mean over W; none, and nothing that rests on it, where a beat sounds at more than half the height's sampling rate.",
    },
    Metric {
        name: "h2_ratio",
        unit: "1",
        label: "height, second harmonic",
        needs: &[Need::HeightLine],
        compute: lines::h2_ratio,
        origin: ARCHIVE,
        definition: "Largest magnitude within 0.45 Hz of 2·peak_hz over the magnitude at the peak; none where the peak itself lies within 0.45 Hz of that.",
    },
    Metric {
        name: "roll_peak_hz",
        unit: "Hz",
        label: "roll, strongest line",
        needs: &[Need::RollLine],
        compute: lines::roll_peak_hz,
        origin: "as peak_hz",
        definition: "Frequency of the largest magnitude of the unwindowed real Fourier transform of the roll about its mean over W; none, and nothing that rests on it, where a beat sounds at more than half the roll's sampling rate.",
    },
    Metric {
        name: "subharmonic_ratio",
        unit: "1",
        label: "roll power, f/2 over f",
        needs: &[Need::Roll, Need::HeightLine, Need::RollLine],
        compute: lines::subharmonic_ratio,
        origin: "docs/metrics.md",
        definition: "Roll power within 0.1·f of f/2 over roll power within 0.1·f of f, f = peak_hz; from a Hann-tapered periodogram of W, which has to hold 20 periods of f.",
    },
    Metric {
        name: "growth_ratio",
        unit: "1",
        label: "height, growth",
        needs: &[Need::HeightLine],
        compute: height::growth_ratio,
        origin: ARCHIVE,
        definition: "RMS about W's mean of the height in the last ⌊n/3⌋ samples over that in the first ⌊n/3⌋.",
    },
    Metric {
        name: "force_mean_n",
        unit: "N",
        label: "normal force, mean",
        needs: &[Need::Forces],
        compute: contact::force_mean_n,
        origin: ARCHIVE,
        definition: "Mean normal force over W: the mean of the handles, `per` lists them.",
    },
    Metric {
        name: "force_sd_n",
        unit: "N",
        label: "normal force, SD",
        needs: &[Need::Forces],
        compute: contact::force_sd_n,
        origin: ARCHIVE,
        definition: "Population standard deviation of the normal force over W: the mean of the handles, `per` lists them.",
    },
    Metric {
        name: "force_correlation",
        unit: "1",
        label: "correlation of handle forces",
        needs: &[Need::Forces],
        compute: contact::force_correlation,
        origin: "docs/metrics.md",
        definition: "Pearson correlation over W of two handles' normal forces: the mean over pairs, `per` lists them.",
    },
    Metric {
        name: "mechanism",
        unit: "-",
        label: "what drives the roll",
        needs: &[Need::Roll],
        compute: drive::mechanism,
        origin: "docs/metrics.md",
        definition: "quiet, parametric, direct or mixed; the reason gives the evidence.",
    },
];

/// The line of the table with this name.
pub fn find(name: &str) -> Option<&'static Metric> {
    METRICS.iter().find(|m| m.name == name)
}

/// What stands beside an axis or a number: a name, and its unit where it has one.
pub fn with_unit(name: &str, unit: &str) -> String {
    match unit {
        "" | "1" => name.to_owned(),
        unit => format!("{name}, {unit}"),
    }
}

/// Metrics that are directions (deg): their means and spreads are circular.
const DIRECTIONS: &[&str] = &["beat_lead_deg"];

/// The turn after which a metric's values are the same again, in its unit; `None` for all but directions.
pub fn turn_of(name: &str) -> Option<f64> {
    DIRECTIONS.contains(&name).then_some(360.0)
}

/// Results in the table's order.
#[derive(Clone, Debug, PartialEq, Default)]
pub struct Metrics(pub Vec<(&'static str, Value)>);

impl Metrics {
    /// The result with this name.
    pub fn get(&self, name: &str) -> Option<&Value> {
        self.0.iter().find(|(n, _)| *n == name).map(|(_, v)| v)
    }

    /// The number with this name; `None` where it is missing or no number.
    pub fn number(&self, name: &str) -> Option<f64> {
        self.get(name)?.as_f64()
    }

    /// Names and results, in order.
    pub fn iter(&self) -> impl Iterator<Item = (&'static str, &Value)> {
        self.0.iter().map(|(n, v)| (*n, v))
    }
}

impl Serialize for Metrics {
    fn serialize<S: Serializer>(&self, s: S) -> Result<S::Ok, S::Error> {
        s.collect_map(self.iter())
    }
}

/// Every metric of the table over `window`.
pub fn metrics(inputs: &Inputs, window: Window) -> Metrics {
    metrics_of(inputs, window, |_| true)
}

/// The metrics that `wanted` names: only what they need is computed.
pub fn metrics_of(inputs: &Inputs, window: Window, wanted: impl Fn(&str) -> bool) -> Metrics {
    let context = Context::new(inputs, window);
    Metrics(
        METRICS
            .iter()
            .filter(|m| wanted(m.name))
            .map(|m| (m.name, evaluate(m, &context)))
            .collect(),
    )
}

/// One metric: its function where all its columns are there, else the reason why not.
pub fn evaluate(metric: &Metric, context: &Context) -> Value {
    let missing = metric.needs.iter().find_map(|need| context.missing(*need));
    let mut value = match missing {
        Some(reason) => Value::missing(reason),
        None => (metric.compute)(context),
    };
    value.unit = metric.unit;
    if value.source.is_empty() {
        value.source = metric
            .needs
            .first()
            .map(|n| context.source(*n))
            .unwrap_or_default();
    }
    value
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_unique_and_nothing_gives_reasons() {
        let all = metrics(&Inputs::default(), Window::ALL);
        assert_eq!(all.0.len(), METRICS.len());
        for (k, (name, value)) in all.iter().enumerate() {
            assert_eq!(
                METRICS.iter().position(|m| m.name == name),
                Some(k),
                "{name} stands twice"
            );
            assert_eq!(value.datum, Datum::Missing, "{name}");
            assert_eq!(value.source, "", "{name}");
            assert!(
                value.reason.as_ref().is_some_and(|r| !r.is_empty()),
                "{name}"
            );
        }
    }

    #[test]
    fn what_rounding_leaves_of_standing_still_is_no_motion() {
        // A height of 0.8019 m whose last bit flickers.
        let still = |k: usize| 0.8019 + if k % 7 < 3 { 1.2e-16 } else { 0.0 };
        let inputs = Inputs {
            t_s: (0..1801).map(|k| k as f64 / 30.0).collect(),
            height_m: (0..1801).map(still).collect(),
            ..Inputs::default()
        };
        let found = metrics(&inputs, Window::ALL);
        for name in ["rms_z_m", "dz_pp_m"] {
            assert_eq!(found.number(name), Some(0.0), "{name}");
        }
        for name in ["growth_ratio", "peak_hz"] {
            assert_eq!(found.number(name), None, "{name}");
        }
        let (t_s, z) = (&inputs.t_s, &inputs.height_m);
        let s = crate::peaks::SpectrumSummary::of(t_s, z, Window::ALL, None, "m");
        assert!(s.is_some_and(|s| s.peaks.is_empty() && s.peak_hz.is_none()));
    }

    #[test]
    fn one_sample_or_nan_never_makes_a_nan() {
        for n in [1usize, 2, 3, 59, 61] {
            for bad in [0.0, f64::NAN, f64::INFINITY] {
                let column = vec![bad; n];
                let inputs = Inputs {
                    t_s: (0..n).map(|k| k as f64 / 30.0).collect(),
                    height_m: column.clone(),
                    roll_rad: column.clone(),
                    pitch_rad: column.clone(),
                    yaw_rad: column.clone(),
                    normal_n: vec![column.clone(), column.clone()],
                    phase_rad: vec![column.clone(), column.clone()],
                    beat_phase_rad: column,
                    mass_kg: Some(60.0),
                    ..Inputs::default()
                };
                for (name, value) in metrics(&inputs, Window::ALL).iter() {
                    let finite = value.as_f64().is_none_or(f64::is_finite)
                        && value.per.iter().all(|x| x.is_finite());
                    assert!(finite, "{name} for {n} times {bad}: {value:?}");
                    assert!(
                        value.datum != Datum::Missing || value.reason.is_some(),
                        "{name}"
                    );
                }
            }
        }
    }
}
