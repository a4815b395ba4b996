//! A recording becomes what a fit is made from.

use super::{Clocks, Field};
use analyze::Window;
use analyze::examine::{examine, natural};
use analyze::inputs;
use analyze::quality::Quality;
use analyze::request::{DeviceClocks, Request};
use analyze::roles::RolesFile;
use anyhow::{Result, anyhow};
use recording::import::{ImportOptions, ingest};
use recording::read::{ReadOptions, Recording};
use recording::write::{RecordingWriter, WriterOptions};
use sim::scene::Scene;
use std::collections::HashMap;
use std::path::Path;

/// What a recording says beside its columns.
pub struct Told {
    /// Its window of analysis.
    pub window: Window,
    /// The scene that it was made from, where one is attached, or why that cannot be read.
    pub scene: Option<Result<Scene, String>>,
    /// Where its scene's time 0 lies after its first message, s.
    pub zero_s: f64,
    /// What is lost, where it is damaged: one sentence.
    pub damage: Option<String>,
    /// How the clocks of sensors differ, where that is not put right but by motion, or not known.
    pub clocks_apart: Vec<String>,
}

const COMPRESSION: &str = "/handles/forces.compression_m";
/// Times of the scene, of which the first that is there counts.
const OWN_TIMES: [&str; 2] = ["/rath/state.time_s", "/rath/phases.time_s"];

const LEFT: &str =
    "clocks differ and were left as they are, which no interval knows of: --put-clocks-right";
const BY_MOTION: &str = "the carriers' clocks were put right by motion alone, to 20 ms, and a millisecond moves the stiffness by some 70 N/m: tap the sensors together";
const ADRIFT: &str =
    "nothing tells when the sound began beside the steps: tap the sensors near the microphone";

impl Field {
    /// The columns of a recording, or of a log of the paper's archive (.npz), and what else it says; `roles` says what it does not. With
    /// `put_clocks_right` the carriers' clocks are put on the rath's first.
    ///
    /// # Errors
    /// One sentence where it cannot be read, or nothing in it moves.
    pub fn read(
        file: &Path,
        roles: Option<&RolesFile>,
        put_clocks_right: bool,
    ) -> Result<(Self, Told)> {
        let name = file.display().to_string();
        // To put clocks right by the carriers' own lags would take away what the pull is seen by.
        let request = Request {
            clocks: match put_clocks_right {
                true => DeviceClocks::PutRight,
                false => DeviceClocks::Told,
            },
            roles: roles.cloned(),
            ..Request::default()
        };
        let options = ReadOptions {
            by_name: request.names_items(),
            ..ReadOptions::default()
        };
        let log = file
            .extension()
            .is_some_and(|e| e.eq_ignore_ascii_case("npz"));
        let recording = if log {
            // The archive's logs become recordings first, as everybody's do.
            let folder = tempfile::tempdir()?;
            let path = folder.path().join("log.mcap");
            let mut writer = RecordingWriter::create(&path, &WriterOptions::default())?;
            ingest(&[file.to_owned()], &ImportOptions::default(), &mut writer)?;
            writer.finish()?;
            Recording::from_bytes(std::fs::read(&path)?, &options)?
        } else {
            Recording::open(file, &options)?
        };
        let analysis = examine(&name, &recording, &request)?;
        let wanted = |path: &str| path.starts_with(COMPRESSION) || OWN_TIMES.contains(&path);
        let (signals, _) = recording.signals(&wanted)?;
        let (mut signals, own_times): (Vec<_>, Vec<_>) = signals
            .into_iter()
            .partition(|signal| signal.path.starts_with(COMPRESSION));
        signals.sort_by(|a, b| natural(&a.path, &b.path));
        let start_ns = recording.info().start_ns;
        let forces_s = analysis.inputs.force_times();
        let compression_m: Vec<Vec<f64>> = (signals.iter())
            .filter_map(|s| at_times(&s.times_s(start_ns), &s.values, forces_s))
            .collect();
        if analysis.inputs.t_s.is_empty() {
            return Err(anyhow!(
                "{name}: nothing in it moves: no state and no inertial sensor was found"
            ));
        }
        // Whoever writes states and phases says when they were, in the time of their scene.
        let zero_s = (OWN_TIMES.iter())
            .filter_map(|path| own_times.iter().find(|signal| signal.path == *path))
            .filter_map(|s| Some(s.times_s(start_ns).first()? - s.values.first()?))
            .find(|zero_s| zero_s.is_finite());
        let scene = recording.attachment("scene.toml").map(|bytes| {
            let text = String::from_utf8(bytes).map_err(|_| "it is no text".to_owned())?;
            sim::scene::parse("scene.toml", &text, &[]).map_err(|e| e.to_string())
        });
        let (inputs, quality) = (&analysis.inputs, &analysis.quality);
        let of_kind = |kind: &'static str| {
            let of = quality.iter().filter(move |q| q.kind == kind);
            of.filter(|q| !q.topic.is_empty()).map(Quality::told)
        };
        // A sound's, beside the sensors'.
        let adrift: Vec<String> = of_kind("clocks_apart").collect();
        // Only sensors have clocks of their own.
        let (lifted, walked) = (!inputs.heave_m.is_empty(), inputs.phases_are_measured);
        let (no_contact, no_pull) = match inputs.clocks {
            inputs::Clocks::LeftApart => (Some(LEFT), Some(LEFT)),
            inputs::Clocks::SetByMotion => (Some(BY_MOTION), None),
            inputs::Clocks::Agree => (None, None),
        };
        let clocks = Clocks {
            no_contact: no_contact.filter(|_| lifted),
            no_pull: no_pull
                .or((!adrift.is_empty()).then_some(ADRIFT))
                .filter(|_| walked),
        };
        let clocks_apart = match lifted || walked {
            true if no_contact.is_some() => of_kind("clock_offset").chain(adrift).collect(),
            true => adrift,
            false => Vec::new(),
        };
        let heard_hz = (analysis.metrics.get("beat_hz"))
            .and_then(|beat| Some((beat.as_f64()?, beat.ci95?)))
            .map(|(hz, [low, high])| (hz, 0.5 * (high - low)));
        let told = Told {
            window: analysis.window,
            scene,
            zero_s: zero_s.unwrap_or(0.0),
            damage: analysis.damage(),
            clocks_apart,
        };
        let field = Field {
            inputs: analysis.inputs,
            compression_m,
            clocks,
            heard_hz,
            ..Field::default()
        };
        Ok((field, told))
    }
}

/// What stands at each of `wanted_s`, the first of those at one time; `None` where one of them has nothing. A repeated message is one of the forces once.
fn at_times(t_s: &[f64], x: &[f64], wanted_s: &[f64]) -> Option<Vec<f64>> {
    if t_s == wanted_s {
        return Some(x.to_vec());
    }
    let mut at = HashMap::with_capacity(x.len());
    for (t, x) in t_s.iter().zip(x) {
        at.entry(t.to_bits()).or_insert(*x);
    }
    let found = wanted_s.iter().map(|t| at.get(&t.to_bits()).copied());
    found.collect()
}

#[test]
fn a_message_that_is_there_twice_counts_once() {
    let found = at_times(
        &[0.0, 0.1, 0.1, 0.2],
        &[1.0, 2.0, 2.5, 3.0],
        &[0.0, 0.1, 0.2],
    );
    assert_eq!(found, Some(vec![1.0, 2.0, 3.0]));
    assert_eq!(at_times(&[0.0, 0.2], &[1.0, 3.0], &[0.0, 0.1, 0.2]), None);
}
