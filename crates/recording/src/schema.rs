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
