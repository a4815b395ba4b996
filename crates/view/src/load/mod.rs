//! From a recording to a [`Take`]: which signal is drawn as what.
//!
//! What metrics are made of comes from `analyze`, whole; the pose, the carriers and the ledger are collected; everything else streams
//! through once and is thinned on the way, so that an hour of ten sensors fits into memory.

mod dates;
mod scene;
mod sensor;
mod stream;

use std::collections::BTreeMap;

use analyze::examine::examine;
use analyze::request::Request;
use recording::read::{Info, ReadError, ReadOptions, Recording};
use recording::signal::{Signal, field_of};
use recording::{Finding, Kind, topics};

use crate::take::{Take, every};

/// More messages than this are streamed only: metrics need whole columns in memory.
const MAX_EXAMINED: u64 = 10_000_000;

/// Transforms that a message of `/tf` may have: the body's, and one for each of as many people as the project's own lists may hold.
const MOST_TRANSFORMS: usize = 1 + 4096;

/// How recordings are opened of which `asked` is asked.
pub fn options(asked: &Request) -> ReadOptions {
    ReadOptions {
        by_name: asked.names_items(),
        max_items: MOST_TRANSFORMS,
        ..ReadOptions::default()
    }
}

/// Whether curves may be made coarser.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Detail {
    /// Curves with very many samples keep the extremes of short intervals.
    Thinned,
    /// Everything, for recordings that are still growing.
    Whole,
}

/// Reads what there is to draw; of `asked`, roles and window count. Returns what the reader found odd beside it.
pub fn load(
    name: &str,
    recording: &Recording,
    detail: Detail,
    asked: &Request,
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
    let mut plan = Plan::new(info, whole);
    let mut findings = Vec::new();
    let mut dates = dates::Dates::default();
    if whole {
        plan.place = examined(&mut take, recording, asked)?;
    } else {
        dates = dates::rates(recording, &plan)?;
        take.notes.push(format!(
            "{} messages: curves and spectra only, at the times of the log; `analyze` computes the metrics.",
            info.messages
        ));
    }
    if whole {
        let (signals, dated, found) = dates::collect(recording, &plan)?;
        (dates, findings) = (dated, found);
        let signals: BTreeMap<&str, &Signal> =
            signals.iter().map(|s| (s.path.as_str(), s)).collect();
        let place = plan.place.as_deref();
        take.pose = scene::pose(&signals).or_else(|| scene::found(&signals, &take, place));
        if plan.is_own {
            take.carriers = scene::carriers(&signals);
        }
        take.energy = scene::energy(&signals);
        take.tangential_n = scene::tangentials(&signals, &take);
        take.compression_m = scene::compressions(&signals, &take);
        take.shape = scene::shape(recording, &take);
        let people = take.shape.handles_m.len();
        let told = every(take.force_ns.len(), people);
        if told > 1 && detail == Detail::Thinned {
            take.notes.push(format!(
                "{people} carriers: figures, arrows and phases are drawn at one of {told} moments."
            ));
        }
    }
    take.notes.append(&mut dates.notes);
    stream::others(
        &mut take,
        recording,
        &plan,
        detail,
        &mut dates,
        &mut findings,
    )?;
    // What `analyze` did not look at has its oddities too; holes are seen in the curves.
    for found in findings.iter().filter(|f| f.kind != Kind::Gap) {
        let remark = (found.t_s, remark(&found.topic, &found.text));
        if !take.remarks.contains(&remark) {
            take.remarks.push(remark);
        }
    }
    Ok((take, findings))
}

/// Times in ns of seconds since `start_ns`. OK because the seconds came from nanoseconds of the recording.
fn at_ns(start_ns: i64, t_s: &[f64]) -> Vec<i64> {
    let at = |t: &f64| start_ns.saturating_add((t * 1e9).round() as i64);
    t_s.iter().map(at).collect()
}

/// Metrics, events, remarks and the columns behind them, as `analyze` finds them. Returns the path whose `.z` is the height, if there is one.
fn examined(
    take: &mut Take,
    recording: &Recording,
    asked: &Request,
) -> Result<Option<String>, ReadError> {
    // No list of signals is asked for: no topic has the empty name. (To name no signal would switch the estimates off.)
    let request = Request {
        topics: vec![String::new()],
        ..asked.clone()
    };
    let analysis = examine(&take.name, recording, &request)?;
    let start_ns = take.start_ns;
    let at = |t_s: &[f64]| at_ns(start_ns, t_s);
    take.state_ns = at(&analysis.inputs.t_s);
    take.height_ns = at(analysis.inputs.height().0);
    take.force_ns = at(analysis.inputs.force_times());
    take.phase_ns = at(analysis.inputs.phase_times());
    take.window = analysis.window;
    take.metrics = analysis.metrics;
    let plays = |wanted: &str| {
        let role = analysis.roles.iter().find(|(role, _)| *role == wanted);
        role.and_then(|(_, played)| played.first().cloned())
    };
    take.main_imu = plays("imu");
    let place = plays("height").and_then(|path| Some(path.strip_suffix(".z")?.to_owned()));
    take.events = analysis.events;
    take.remarks = analysis
        .quality
        .iter()
        .filter(|q| q.kind != "gap")
        .map(|q| (q.t_s, remark(&q.topic, &q.text)))
        .collect();
    take.notes.extend(analysis.outside);
    take.notes.extend(analysis.warnings);
    take.inputs = analysis.inputs;
    Ok(place)
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
    /// All topics, longer names first.
    topics: Vec<&'a str>,
    /// Recorded by `sim` or imported as that: there are messages of the state, and the frames of `/tf` are the body's and the carriers'.
    is_own: bool,
    /// Topics of our own schemas, which have drawings of their own.
    ours: Vec<&'a str>,
    imus: Vec<&'a str>,
    /// What has the body's place, whose `.z` is the height.
    place: Option<String>,
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
            // Sound has no curve but the one that nobody sees at this scale.
            "foxglove.RawAudio",
        ];
        let mut ours = of(&schemas);
        // The state says the same; without one transforms are curves like any other numbers.
        let is_own = !of(&["rath.State"]).is_empty();
        if is_own {
            ours.extend(of(&[
                "tf2_msgs/TFMessage",
                "foxglove.FrameTransform",
                "foxglove.FrameTransforms",
            ]));
        }
        let joints = of(&["sensor_msgs/JointState"]).into_iter();
        ours.extend(joints.filter(|topic| *topic == topics::MOTION));
        let mut topics: Vec<&str> = info.channels.iter().map(|c| c.topic.as_str()).collect();
        topics.sort_by_key(|topic| std::cmp::Reverse(topic.len()));
        Plan {
            topics,
            is_own,
            ours: if whole { ours } else { Vec::new() },
            imus: of(&["sensor_msgs/Imu"]),
            place: None,
        }
    }

    fn is_ours(&self, topic: &str) -> bool {
        self.ours.contains(&topic)
    }

    fn is_sensor(&self, topic: &str) -> bool {
        self.imus.contains(&topic)
    }

    /// The field that a path names. Topics may have dots of their own, and a path is of the longest that fits.
    fn field<'p>(&self, path: &'p str) -> &'p str {
        let of = |topic: &&str| path.strip_prefix(*topic)?.strip_prefix(['.', ':']);
        self.topics.iter().find_map(of).unwrap_or_default()
    }

    /// Collected whole: the pose, the carriers' frames, the handles' sideways forces and compressions, and the ledger.
    fn is_whole(&self, path: &str) -> bool {
        let pose = ["position_m", "orientation"]
            .iter()
            .any(|f| within(path, topics::STATE, f));
        let place = |place: &String| {
            let part = path.strip_prefix(place.as_str());
            part.is_some_and(|part| [".x", ".y"].contains(&part))
        };
        pose || self.place.as_ref().is_some_and(place)
            || within(path, topics::ENERGY, "")
            || within(path, topics::FORCES, "compression_m")
            || (within(path, topics::FORCES, "tangential_n") && !path.ends_with(".z"))
            || (self.is_own
                && within(path, topics::TF, "")
                && path.contains(".transform.translation."))
    }

    /// Streamed and thinned: sensors and everything that is not ours.
    fn is_streamed(&self, path: &str) -> bool {
        !self.ours.iter().any(|topic| within(path, topic, "")) && is_measurement(self.field(path))
    }
}

/// Whether a path is `TOPIC.FIELD…`.
fn within(path: &str, topic: &str, field: &str) -> bool {
    field_of(path, topic).is_some_and(|rest| rest.starts_with(field))
}

/// Stamps, covariances and status fields are no curves that anybody wants to see.
fn is_measurement(field: &str) -> bool {
    let words = [
        "stamp",
        "header",
        "timestamp",
        "seq",
        "sec",
        "nsec",
        "nanosec",
    ];
    !field.contains("covariance") && !field.split('.').any(|part| words.contains(&part))
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stamps_are_no_measurements_and_fields_that_sound_like_them_are() {
        let channel = |topic: &str, schema: &str| recording::read::ChannelInfo {
            topic: topic.into(),
            schema: schema.into(),
            messages: 1,
            ..Default::default()
        };
        let mut info = Info {
            channels: vec![
                channel("/imu", "sensor_msgs/msg/Imu"),
                channel("/imu.header", ""),
                channel("/gps.sec", ""),
                channel("/track/covariance_test", ""),
                channel(topics::MOTION, "geometry_msgs/msg/Twist"),
            ],
            ..Info::default()
        };
        let plan = Plan::new(&info, true);
        for path in [
            "/imu.stamp.sec",
            "/imu.seq",
            "/imu.orientation_covariance[3]",
            "/imu.header.timestamp.nanos",
        ] {
            assert!(!plan.is_streamed(path), "{path}");
        }
        for path in [
            "/imu.section_force_n",
            "/imu.sequence",
            "/imu.angular_velocity.x",
            // The names of topics are nothing but names.
            "/imu.header.x",
            "/imu.header:x",
            "/gps.sec.north",
            "/track/covariance_test.x",
            "/rath/motion.linear.x",
        ] {
            assert!(plan.is_streamed(path), "{path}");
        }
        info.channels[4].schema = "sensor_msgs/msg/JointState".into();
        assert!(!Plan::new(&info, true).is_streamed("/rath/motion.position[0]"));
    }
}
