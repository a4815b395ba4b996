//! A recording becomes what a fit is made from.

use super::Field;
use analyze::Window;
use analyze::examine::{Request, examine};
use analyze::field::DeviceClocks;
use analyze::quality::Quality;
use analyze::roles::RolesFile;
use anyhow::{Result, anyhow};
use recording::import::{ImportOptions, ingest};
use recording::read::{ReadOptions, Recording};
use recording::write::{RecordingWriter, WriterOptions};
use sim::scene::Scene;
use std::path::Path;

/// What a recording says beside its columns.
pub struct Told {
    /// Its window of analysis.
    pub window: Window,
    /// The scene that it was made from, where one is attached.
    pub scene: Option<Scene>,
    /// What is lost, where it is damaged: one sentence.
    pub damage: Option<String>,
    /// How the clocks of sensors differ, where it was not asked to put them right.
    pub clocks_apart: Vec<String>,
}

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
            Recording::from_bytes(std::fs::read(&path)?, &ReadOptions::default())?
        } else {
            Recording::open(file, &ReadOptions::default())?
        };
        // To put clocks right by the carriers' own lags would take away what the pull is seen by.
        let request = Request {
            clocks: match put_clocks_right {
                true => DeviceClocks::PutRight,
                false => DeviceClocks::Told,
            },
            roles: roles.cloned(),
            ..Request::default()
        };
        let analysis = examine(&name, &recording, &request)?;
        let (mut signals, _) =
            recording.signals(&|path| path.starts_with("/handles/forces.compression_m"))?;
        signals.sort_by(|a, b| a.path.cmp(&b.path));
        let forces = analysis.inputs.force_times().len();
        let compression_m: Vec<Vec<f64>> = signals
            .into_iter()
            .map(|s| s.values)
            .filter(|v| v.len() == forces)
            .collect();
        if analysis.inputs.t_s.is_empty() {
            return Err(anyhow!(
                "{name}: nothing in it moves: no state and no inertial sensor was found"
            ));
        }
        let scene = recording
            .attachment("scene.toml")
            .and_then(|text| String::from_utf8(text).ok())
            .and_then(|text| sim::scene::parse("scene.toml", &text, &[]).ok());
        // Only sensors have clocks of their own.
        let clocks_apart = match put_clocks_right || analysis.inputs.heave_m.is_empty() {
            true => Vec::new(),
            false => {
                let clocks = analysis.quality.iter().filter(|q| q.kind == "clock_offset");
                clocks.map(Quality::told).collect()
            }
        };
        let told = Told {
            window: analysis.window,
            scene,
            damage: analysis.damage(),
            clocks_apart,
        };
        let field = Field {
            inputs: analysis.inputs,
            compression_m,
            ..Field::default()
        };
        Ok((field, told))
    }
}
