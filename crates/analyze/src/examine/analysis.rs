//! What is found in a recording.

use crate::events::Event;
use crate::inputs::{Inputs, Window};
use crate::metrics::Metrics;
use crate::peaks::SpectrumSummary;
use crate::quality::Quality;
use crate::summary::Summary;

/// What a topic holds.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct Topic {
    /// Name.
    pub name: String,
    /// Schema.
    pub schema: String,
    /// Encoding.
    pub encoding: String,
    /// Messages.
    pub messages: u64,
    /// Mean rate (Hz).
    pub hz: Option<f64>,
}

/// What is found in a recording.
#[derive(Clone, Debug)]
pub struct Analysis {
    /// Name of the file.
    pub file: String,
    /// Last minus first log time (s).
    pub duration_s: f64,
    /// Samples of the motion, or messages of the busiest topic where there is none.
    pub samples: u64,
    /// The window (s).
    pub window: Window,
    /// Where it lies outside the recording, so that there is nothing to analyse: a sentence.
    pub outside: Option<String>,
    /// Profile of the file.
    pub profile: String,
    /// Software that wrote it.
    pub library: String,
    /// Messages in all.
    pub messages: u64,
    /// Its topics, by name.
    pub topics: Vec<Topic>,
    /// The summary was missing or wrong.
    pub salvaged: bool,
    /// Messages lost.
    pub skipped_messages: u64,
    /// What the user should know of file and analysis.
    pub warnings: Vec<String>,
    /// Metadata record `rath`.
    pub metadata: Vec<(String, String)>,
    /// Role and the signals or topics that play it.
    pub roles: Vec<(&'static str, Vec<String>)>,
    /// Signals by path.
    pub signals: Vec<(String, Summary)>,
    /// Remarks.
    pub quality: Vec<Quality>,
    /// Metrics.
    pub metrics: Metrics,
    /// Spectra by signal.
    pub spectra: Vec<(String, SpectrumSummary)>,
    /// Events by time.
    pub events: Vec<Event>,
    /// The columns behind metrics, spectra and events, for figures.
    pub inputs: Inputs,
    /// Outlines of signals that play no role, where they were asked for.
    pub traces: Vec<Trace>,
    /// How many signals have no place in `traces`.
    pub undrawn: u64,
}

/// Signals of one topic and unit, or without one and alike large, drawn together, no more than there are colours: name, times (s) and values of each.
#[derive(Clone, Debug, Default)]
pub struct Trace {
    /// Topic and the part of the path that the signals share.
    pub topic: String,
    /// Their unit, where it is known.
    pub unit: String,
    /// Name, times and values.
    pub series: Vec<(String, Vec<f64>, Vec<f64>)>,
}

impl Analysis {
    /// What is lost, where something is: one sentence; the exit code is 3 then.
    pub fn damage(&self) -> Option<String> {
        self.lost().map(|lost| format!("{}: {lost}", self.file))
    }

    /// The same without the file's name.
    pub(crate) fn lost(&self) -> Option<String> {
        let losses = self.quality.iter().filter(|q| q.loss);
        let told: Vec<String> = losses.map(Quality::told).collect();
        (self.skipped_messages > 0 || !told.is_empty()).then(|| {
            let lost = match self.skipped_messages {
                0 if self.quality.iter().any(|q| q.kind == "truncated") => {
                    "its end is missing".to_owned()
                }
                0 => "no whole message is known to be lost".to_owned(),
                1 => "1 message is lost".to_owned(),
                n => format!("{n} messages are lost"),
            };
            format!(
                "the file is damaged; {lost}, the rest was used: {}",
                told.join("; ")
            )
        })
    }

    /// Whether there is a signal that could be used.
    pub fn is_empty(&self) -> bool {
        self.signals.is_empty()
    }
}
