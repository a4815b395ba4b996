//! Protobuf messages of our recordings, compiled from `schemas/*.proto`, and the descriptor sets that make a file self-describing.

/// The project's own messages.
#[allow(clippy::doc_markdown, clippy::doc_lazy_continuation)]
pub mod rath {
    include!(concat!(env!("OUT_DIR"), "/rath.rs"));
}

/// Foxglove's messages (MIT): what `SceneUpdate` and `RawAudio` need.
#[allow(missing_docs, clippy::doc_markdown, clippy::doc_lazy_continuation)]
pub mod foxglove {
    include!(concat!(env!("OUT_DIR"), "/foxglove.rs"));
}

impl foxglove::RawAudio {
    /// A block of 16-bit PCM, little endian, channels interleaved.
    pub fn pcm_s16(t_ns: i64, data: Vec<u8>, sample_rate: u32, number_of_channels: u32) -> Self {
        Self {
            timestamp: Some(timestamp(t_ns)),
            data,
            format: "pcm-s16".into(),
            sample_rate,
            number_of_channels,
        }
    }
}

/// A moment, ns since 1970, as Protobuf has it.
pub fn timestamp(t_ns: i64) -> prost_types::Timestamp {
    prost_types::Timestamp {
        seconds: t_ns.div_euclid(1_000_000_000),
        // OK because the rest is below 1e9.
        nanos: t_ns.rem_euclid(1_000_000_000) as i32,
    }
}

macro_rules! descriptor_sets {
    ($($name:literal),* $(,)?) => {
        /// The serialized `FileDescriptorSet` (with imports) of a message that a channel may carry, by its full name.
        pub fn descriptor_set(name: &str) -> Option<&'static [u8]> {
            match name {
                $($name => Some(include_bytes!(concat!(env!("OUT_DIR"), "/", $name, ".bin"))),)*
                _ => None,
            }
        }
    };
}

descriptor_sets!(
    "rath.State",
    "rath.Phases",
    "rath.HandleForces",
    "rath.Energy",
    "rath.Beat",
    "foxglove.SceneUpdate",
    "foxglove.RawAudio",
);
