//! The machine-readable form: docs/contract in types.

use serde::ser::{Serialize, SerializeMap, Serializer};

use crate::examine::{Analysis, Topic};

/// One object where one recording was asked for, an array where several were, however many could be read; ends with a line break.
pub fn json(analyses: &[Analysis], asked: usize) -> String {
    // OK because the types below have string keys only and numbers are finite or null.
    let text = match analyses {
        [one] if asked == 1 => serde_json::to_string_pretty(one),
        many => serde_json::to_string_pretty(many),
    };
    text.expect("plain data") + "\n"
}

/// A map in the order of its entries.
struct Ordered<'a, K, V>(&'a [(K, V)]);

impl<K: Serialize, V: Serialize> Serialize for Ordered<'_, K, V> {
    fn serialize<S: Serializer>(&self, s: S) -> Result<S::Ok, S::Error> {
        s.collect_map(self.0.iter().map(|(k, v)| (k, v)))
    }
}

#[derive(serde::Serialize)]
struct Recording<'a> {
    profile: &'a str,
    library: &'a str,
    messages: u64,
    topics: &'a [Topic],
    salvaged: bool,
    skipped_messages: u64,
    warnings: &'a [String],
}

impl Serialize for Analysis {
    fn serialize<S: Serializer>(&self, s: S) -> Result<S::Ok, S::Error> {
        let mut map = s.serialize_map(None)?;
        map.serialize_entry("file", &self.file)?;
        map.serialize_entry("duration_s", &self.duration_s)?;
        map.serialize_entry("samples", &self.samples)?;
        map.serialize_entry("window_s", &[self.window.start_s, self.window.end_s])?;
        map.serialize_entry(
            "recording",
            &Recording {
                profile: &self.profile,
                library: &self.library,
                messages: self.messages,
                topics: &self.topics,
                salvaged: self.salvaged,
                skipped_messages: self.skipped_messages,
                warnings: &self.warnings,
            },
        )?;
        map.serialize_entry("metadata", &Ordered(&self.metadata))?;
        map.serialize_entry("roles", &Ordered(&self.roles))?;
        map.serialize_entry("signals", &Ordered(&self.signals))?;
        map.serialize_entry("quality", &self.quality)?;
        map.serialize_entry("metrics", &self.metrics)?;
        map.serialize_entry("spectra", &Ordered(&self.spectra))?;
        map.serialize_entry("events", &self.events)?;
        map.end()
    }
}
