//! What a recording is: an MCAP file of named, timed messages. This crate writes the project's own recordings, reads anybody's,
//! and turns other people's logs into recordings. It knows no physics and no statistics, and it alone knows the word MCAP.
//!
//! * [`mod@write`] makes a recording: [`write::RecordingWriter`], the topics in [`topics`], the messages in [`schema`] and [`cdr`].
//! * [`read`] opens any MCAP: [`read::Recording`] gives what is in it, its numbers as [`Signal`]s, and every oddity as a [`Finding`].
//! * [`mod@import`] turns logs of other formats into recordings, [`merge`] several recordings into one.

pub mod cdr;
pub mod finding;
mod foreign;
pub mod held;
pub mod import;
pub mod load;
pub mod merge;
pub mod read;
pub mod schema;
pub mod signal;
pub mod text;
pub mod topics;
pub mod whole;
pub mod write;

pub use finding::{Finding, Kind};
pub use signal::Signal;
