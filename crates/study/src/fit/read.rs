//! A recording becomes what a fit is made from.

use super::Field;
use analyze::Window;
use analyze::examine::{Request, examine};
use anyhow::{Result, anyhow};
use recording::import::{ImportOptions, ingest};
use recording::read::{ReadOptions, Recording};
use recording::write::{RecordingWriter, WriterOptions};
use std::path::Path;

impl Field {
    /// The columns of a recording, or of a log of the paper's archive (.npz), and its window of analysis.
    ///
    /// # Errors
    /// One sentence where it cannot be read, or nothing in it moves.
    pub fn read(file: &Path) -> Result<(Self, Window)> {
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
            one_clock: true,
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
        let field = Field {
            inputs: analysis.inputs,
            compression_m,
            ..Field::default()
        };
        Ok((field, analysis.window))
    }
}
