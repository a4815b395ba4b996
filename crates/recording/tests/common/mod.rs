//! What several of these tests need.

use std::io::{self, Write};
use std::sync::{Arc, Mutex};

/// A stream whose bytes can be looked at afterwards.
#[derive(Clone, Default)]
pub struct Shared(Arc<Mutex<Vec<u8>>>);

impl Shared {
    /// What was written since the last look.
    pub fn take(&self) -> Vec<u8> {
        std::mem::take(&mut self.0.lock().expect("unpoisoned"))
    }
}

impl Write for Shared {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.0.lock().expect("unpoisoned").extend_from_slice(bytes);
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}
