//! Other people's logs turned into recordings: NumPy archives, phone apps, inertial sensors, any CSV.

pub mod npz;

use std::io;

use crate::write::WriteError;

/// Why a log could not be turned into a recording. Nothing is left half-written.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ImportError {
    /// The log cannot be read.
    #[error("{name}: cannot be read: {source}")]
    Io {
        /// The file.
        name: String,
        /// What the system said.
        source: io::Error,
    },
    /// The log is not what it should be; the text says what was found and what was expected.
    #[error("{name}: {problem}")]
    Content {
        /// The file.
        name: String,
        /// What was found and expected.
        problem: String,
    },
    /// The recording cannot be written.
    #[error(transparent)]
    Write(#[from] WriteError),
}
