//! What can be chosen of how a recording is written.

/// How a recording is written.
#[derive(Clone, Debug)]
pub struct WriterOptions {
    /// The profile that the header names: conventions that all of the recording keeps, such as `ros2`; empty where it keeps none.
    pub profile: String,
    /// A chunk is closed when it holds this many bytes before compression.
    pub chunk_bytes: u64,
    /// A chunk is closed when it spans this much log time, ns, so that a program that is killed loses little.
    pub chunk_ns: i64,
    /// zstd level, 1 (fast) to 22 (small).
    pub zstd_level: u32,
    /// Whether messages are compressed and written by a thread of its own, while the caller goes on. What went wrong then comes to light with
    /// a later message, or at [`RecordingWriter::finish`](super::RecordingWriter::finish).
    pub own_thread: bool,
}

impl WriterOptions {
    /// As usual, by a thread of its own.
    pub fn beside() -> Self {
        WriterOptions {
            own_thread: true,
            ..WriterOptions::default()
        }
    }
}

impl Default for WriterOptions {
    fn default() -> Self {
        WriterOptions {
            profile: String::new(),
            chunk_bytes: 512 << 10,
            chunk_ns: 10_000_000_000,
            zstd_level: 1,
            own_thread: false,
        }
    }
}
