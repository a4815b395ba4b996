//! What a recording says about carriers, beat and body.

use super::misfit::{Course, unwrapped};
use recording::Signal;
use recording::read::{ReadError, Recording};
use recording::signal::field_of;
use recording::topics::{BEAT, FORCES, PHASES, STATE, TF};
use std::collections::BTreeMap;
use std::f64::consts::TAU;

/// What `analyze --annotate` adds where only sensors saw it.
const FOUND_STATE: &str = "/findings/state";
pub(super) const FOUND_PHASES: &str = "/findings/phases";
/// A pause between two samples longer than this, and than three usual ones, is a gap, s: half a step.
pub(super) const GAP_S: f64 = 0.25;

/// Numbers over one time axis.
#[derive(Clone, Debug, Default)]
pub(super) struct Columns {
    pub topic: String,
    pub t_s: Vec<f64>,
    pub x: Vec<Vec<f64>>,
}

/// What was measured; times in s after the recording's first message.
#[derive(Debug, Default)]
pub struct Take {
    pub(super) start_ns: i64,
    /// When the time of the scene that was recorded is 0: a sensor whose clock is behind may have the first message.
    pub(super) zero_s: f64,
    pub(super) phases: Option<Columns>,
    pub(super) shoulders: Option<Columns>,
    pub(super) beats_s: Vec<f64>,
    pub(super) heard_s: Option<f64>,
    pub(super) state_topic: Option<&'static str>,
    /// Fields of the state by name, and the handles' summed force.
    pub(super) motion: BTreeMap<&'static str, Course>,
    pub(super) duration_s: f64,
    /// What of the file could not be used.
    pub losses: Vec<String>,
}

const STATE_FIELDS: [&str; 12] = [
    "roll_rad",
    "pitch_rad",
    "yaw_rad",
    "position_m.x",
    "position_m.y",
    "position_m.z",
    "velocity_m_per_s.x",
    "velocity_m_per_s.y",
    "velocity_m_per_s.z",
    "angular_velocity_rad_per_s.x",
    "angular_velocity_rad_per_s.y",
    "angular_velocity_rad_per_s.z",
];

pub(super) const ANGLES: [&str; 3] = ["roll_rad", "pitch_rad", "yaw_rad"];

impl Take {
    /// Finds phases, shoulders, beats and the body's motion; what is not there stays empty.
    ///
    /// # Errors
    /// Where the file cannot be read at all.
    pub fn read(recording: &Recording) -> Result<Self, ReadError> {
        let info = recording.info();
        let has = |topic: &str| info.channels.iter().any(|c| c.topic == topic);
        let state_topic = [STATE, FOUND_STATE].into_iter().find(|t| has(t));
        let phase_topic = [PHASES, FOUND_PHASES].into_iter().find(|t| has(t));
        let topics: Vec<&str> = [state_topic, phase_topic, Some(BEAT), Some(FORCES), Some(TF)]
            .into_iter()
            .flatten()
            .collect();
        let of_one = |path: &str| topics.iter().any(|topic| field_of(path, topic).is_some());
        let (signals, findings) = recording.signals(&of_one)?;
        let get = |topic: &str, field: &str| {
            signals
                .iter()
                .find(|s| field_of(&s.path, topic) == Some(field))
        };
        let course = |s: &Signal| {
            let (t_s, x) = s
                .times_s(info.start_ns)
                .into_iter()
                .zip(s.values.iter().copied())
                .filter(|(_, x)| x.is_finite())
                .unzip();
            Course { t_s, x }
        };
        let list = |topic: &str, field: &dyn Fn(usize) -> String, from: usize| {
            let found: Vec<&Signal> = (from..).map_while(|i| get(topic, &field(i))).collect();
            together(topic, &found, info.start_ns)
        };
        let mut motion = BTreeMap::new();
        if let Some(topic) = state_topic {
            for field in STATE_FIELDS {
                if let Some(s) = get(topic, field) {
                    let mut c = course(s);
                    if ANGLES.contains(&field) {
                        c.x = unwrapped(&c.x, TAU);
                    }
                    motion.insert(field, c);
                }
            }
        }
        if let Some(forces) = list(FORCES, &|i| format!("normal_n[{i}]"), 0) {
            let total = (0..forces.t_s.len()).map(|k| forces.x.iter().map(|n| n[k]).sum());
            motion.insert(
                "force_n",
                Course {
                    x: total.collect(),
                    t_s: forces.t_s,
                },
            );
        }
        let phases = phase_topic.and_then(|t| list(t, &|i| format!("phase_rad[{i}]"), 0));
        // Three columns each; `transforms[0]` is the body.
        let axis = |i: usize| {
            format!(
                "transforms[{}].transform.translation.{}",
                1 + i / 3,
                ["x", "y", "z"][i % 3]
            )
        };
        let shoulders = list(TF, &axis, 0).filter(|c| c.x.len().is_multiple_of(3));
        let first_of = |s: &Signal| s.times_s(info.start_ns).first().copied();
        let zero_of = |s: &Signal| Some(first_of(s)? - s.values.first()?);
        let zero_s = state_topic
            .and_then(|t| get(t, "time_s"))
            .and_then(zero_of)
            .or_else(|| shoulders.as_ref()?.t_s.first().copied());
        Ok(Self {
            start_ns: info.start_ns,
            zero_s: zero_s.filter(|t| t.is_finite()).unwrap_or(0.0),
            phases,
            shoulders,
            beats_s: get(BEAT, "number")
                .map(|s| s.times_s(info.start_ns))
                .unwrap_or_default(),
            heard_s: phase_topic
                .and_then(|t| get(t, "beat_phase_rad"))
                .and_then(first_of),
            state_topic,
            motion,
            duration_s: (i128::from(info.end_ns) - i128::from(info.start_ns)) as f64 / 1e9,
            losses: findings
                .iter()
                .filter(|f| f.kind.is_loss())
                .map(ToString::to_string)
                .collect(),
        })
    }

    /// The topic of the body's measured motion.
    pub fn state_topic(&self) -> Option<&'static str> {
        self.state_topic
    }

    /// Whether the measured height has a mean: that from an inertial sensor has none.
    pub fn height_has_mean(&self) -> bool {
        self.state_topic == Some(STATE)
    }

    /// A measured column of the body, with time counted from `from_s`: a field of `rath.State`, angles without jumps of a turn, or `force_n`.
    pub fn course(&self, field: &str, from_s: f64) -> Option<Course> {
        let c = self.motion.get(field)?;
        Some(Course {
            t_s: c.t_s.iter().map(|t| t - from_s).collect(),
            x: c.x.clone(),
        })
    }
}

impl Columns {
    /// What lies from `from_s` to `to_s`, and one sample on either side, with time counted from `from_s`.
    pub fn part(&self, from_s: f64, to_s: f64) -> Self {
        let first = self.t_s.partition_point(|t| *t <= from_s).saturating_sub(1);
        let last = self
            .t_s
            .partition_point(|t| *t < to_s)
            .min(self.t_s.len() - 1);
        Self {
            topic: self.topic.clone(),
            t_s: self.t_s[first..=last].iter().map(|t| t - from_s).collect(),
            x: self.x.iter().map(|x| x[first..=last].to_vec()).collect(),
        }
    }

    /// The first gap.
    pub fn gap(&self) -> Option<[f64; 2]> {
        let mut steps: Vec<f64> = self.t_s.windows(2).map(|w| w[1] - w[0]).collect();
        steps.sort_by(f64::total_cmp);
        let most = GAP_S.max(3.0 * steps.get(steps.len() / 2)?);
        self.t_s
            .windows(2)
            .find(|w| w[1] - w[0] > most)
            .map(|w| [w[0], w[1]])
    }
}

/// Signals of one topic on their common times, where all of them are numbers.
fn together(topic: &str, signals: &[&Signal], start_ns: i64) -> Option<Columns> {
    if signals.is_empty() {
        return None;
    }
    let mut rows: BTreeMap<i64, Vec<f64>> = BTreeMap::new();
    for (k, s) in signals.iter().enumerate() {
        for (t, x) in s.times_ns.iter().zip(&s.values) {
            // Of several messages with one stamp the first counts.
            let row = rows.entry(*t).or_default();
            if row.len() == k && x.is_finite() {
                row.push(*x);
            }
        }
    }
    rows.retain(|_, row| row.len() == signals.len());
    let times: Vec<i64> = rows.keys().copied().collect();
    Some(Columns {
        topic: topic.to_owned(),
        t_s: recording::signal::seconds_since(&times, start_ns),
        x: (0..signals.len())
            .map(|k| rows.values().map(|row| row[k]).collect())
            .collect(),
    })
}
