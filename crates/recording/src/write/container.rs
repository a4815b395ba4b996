//! The container of a recording, with chunks that close by the recording's own clock.

use mcap::{Compression, McapResult, WriteOptions, records::MessageHeader, write::NoSeek};

use super::options::WriterOptions;
use crate::whole::Sink;

/// MCAP, chunked and compressed.
pub struct Container {
    pub writer: mcap::Writer<NoSeek<Sink>>,
    /// Log time of the first message of the chunk; `None` where a new one begins.
    pub chunk_start_ns: Option<i64>,
    chunk_ns: i64,
}

impl Container {
    /// Begins it.
    pub fn begin(sink: Sink, options: &WriterOptions) -> McapResult<Self> {
        let writer = WriteOptions::new()
            .compression(Some(Compression::Zstd))
            .compression_level(options.zstd_level)
            .compression_threads(0)
            .chunk_size(Some(options.chunk_bytes))
            .disable_seeking(true)
            .profile(&options.profile)
            .library(concat!("rath ", env!("CARGO_PKG_VERSION")))
            .create(NoSeek::new(sink))?;
        Ok(Self {
            writer,
            chunk_start_ns: None,
            chunk_ns: options.chunk_ns,
        })
    }

    /// Writes a message.
    pub fn message(&mut self, header: &MessageHeader, data: &[u8]) -> McapResult<()> {
        let t_ns = header.log_time.cast_signed();
        let start_ns = *self.chunk_start_ns.get_or_insert(t_ns);
        self.writer.write_to_known_channel(header, data)?;
        if t_ns.saturating_sub(start_ns) >= self.chunk_ns {
            self.chunk_start_ns = None;
            self.writer.flush()?;
        }
        Ok(())
    }
}
