//! Logs as files, and what ingesting them gives.

use std::{
    fs,
    io::Write as _,
    path::{Path, PathBuf},
};

use recording::{
    Signal,
    import::{self, ImportError, ImportOptions, Ingested},
    read::{ReadOptions, Recording},
    write::{RecordingWriter, WriterOptions},
};

/// What came of logs.
pub struct Imported {
    pub ingested: Ingested,
    pub recording: Recording,
    pub signals: Vec<Signal>,
}

impl Imported {
    pub fn values(&self, path: &str) -> &[f64] {
        &self
            .signals
            .iter()
            .find(|signal| signal.path == path)
            .unwrap_or_else(|| panic!("{path}"))
            .values
    }

    pub fn times(&self, topic: &str) -> &[i64] {
        let start = format!("{topic}.linear");
        &self
            .signals
            .iter()
            .find(|signal| signal.path.starts_with(&start))
            .expect("a signal")
            .times_ns
    }
}

pub fn ingest(
    folder: &Path,
    paths: &[PathBuf],
    layout: Option<&str>,
) -> Result<Imported, ImportError> {
    let out = folder.join("out.mcap");
    let mut writer = RecordingWriter::create(&out, &WriterOptions::default())?;
    let ingested = import::ingest(
        paths,
        &ImportOptions {
            layout,
            ..ImportOptions::default()
        },
        &mut writer,
    )?;
    writer.finish()?;
    let recording = Recording::open(&out, &ReadOptions::default()).expect("opens");
    let (signals, _) = recording.signals(&|_| true).expect("reads");
    Ok(Imported {
        ingested,
        recording,
        signals,
    })
}

pub fn folder() -> tempfile::TempDir {
    tempfile::tempdir().expect("a folder")
}

pub fn file(folder: &Path, name: &str, text: &str) -> PathBuf {
    let path = folder.join(name);
    fs::create_dir_all(path.parent().expect("a parent")).expect("makes a folder");
    fs::write(&path, text).expect("writes");
    path
}

pub fn zipped(folder: &Path, name: &str, files: &[(&str, String)]) -> PathBuf {
    let path = folder.join(name);
    let mut zip = zip::ZipWriter::new(fs::File::create(&path).expect("creates"));
    for (name, text) in files {
        zip.start_file(*name, zip::write::SimpleFileOptions::default())
            .expect("starts");
        zip.write_all(text.as_bytes()).expect("writes");
    }
    zip.finish().expect("finishes");
    path
}
