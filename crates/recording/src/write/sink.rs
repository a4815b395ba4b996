//! Where the bytes of a recording go: to a temporary file that gets its name at the end, or straight to a stream.

use std::{
    fs,
    io::{self, BufWriter, Write},
    path::{Path, PathBuf},
    sync::Mutex,
};

/// Temporary files that are being written, for [`remove_unfinished_files`].
static UNFINISHED: Mutex<Vec<PathBuf>> = Mutex::new(Vec::new());

/// Removes the temporary files of all recordings that are being written: what a program does when it is interrupted, before it exits.
pub fn remove_unfinished_files() {
    let mut paths = match UNFINISHED.lock() {
        Ok(paths) => paths,
        Err(poisoned) => poisoned.into_inner(),
    };
    for path in paths.drain(..) {
        // Best effort: there is nobody left to tell.
        let _ = fs::remove_file(path);
    }
}

fn forget(path: &Path) {
    if let Ok(mut paths) = UNFINISHED.lock() {
        paths.retain(|known| known != path);
    }
}

/// Where the bytes go.
pub enum Sink {
    /// A temporary file and the name that it gets.
    File {
        file: BufWriter<tempfile::NamedTempFile>,
        path: PathBuf,
    },
    /// Anything else.
    Stream(BufWriter<Box<dyn Write + Send>>),
}

impl Sink {
    /// A file that gets its name at the end, or straight to what is no regular file.
    pub fn beside(path: &Path) -> io::Result<Self> {
        match fs::metadata(path) {
            Ok(found) if found.is_dir() => {
                return Err(io::Error::new(
                    io::ErrorKind::IsADirectory,
                    "it is a folder",
                ));
            }
            Ok(found) if !found.is_file() => {
                let device = fs::OpenOptions::new().write(true).open(path)?;
                return Ok(Sink::Stream(BufWriter::with_capacity(
                    1 << 16,
                    Box::new(device),
                )));
            }
            Ok(found) if found.permissions().readonly() => {
                return Err(io::Error::new(
                    io::ErrorKind::PermissionDenied,
                    "the file that is there is read-only",
                ));
            }
            _ => {}
        }
        // A link keeps pointing at the file that is replaced.
        let path = fs::canonicalize(path).unwrap_or_else(|_| path.to_owned());
        let folder = match path.parent() {
            Some(parent) if !parent.as_os_str().is_empty() => parent,
            _ => Path::new("."),
        };
        let mut prefix = std::ffi::OsString::from(".");
        prefix.push(path.file_name().ok_or(io::ErrorKind::InvalidInput)?);
        prefix.push(".");
        let mut builder = tempfile::Builder::new();
        builder.prefix(&prefix).suffix(".part");
        #[cfg(unix)]
        {
            use std::os::unix::fs::PermissionsExt as _;
            // As any new file: the system takes away what the umask forbids.
            builder.permissions(fs::Permissions::from_mode(0o666));
        }
        let file = builder.tempfile_in(folder)?;
        if let Ok(mut paths) = UNFINISHED.lock() {
            paths.push(file.path().to_owned());
        }
        Ok(Sink::File {
            file: BufWriter::with_capacity(1 << 18, file),
            path,
        })
    }

    /// Writes what is left and gives a file its name.
    pub fn commit(mut self) -> io::Result<()> {
        self.flush()?;
        if let Sink::File { file, path } = &mut self {
            let temporary = file.get_ref().path().to_owned();
            fs::rename(&temporary, path)?;
            forget(&temporary);
        }
        Ok(())
    }
}

impl Drop for Sink {
    fn drop(&mut self) {
        if let Sink::File { file, .. } = self {
            // The temporary file removes itself after this; what was renamed is no longer under that name.
            forget(file.get_ref().path());
        }
    }
}

impl Write for Sink {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        match self {
            Sink::File { file, .. } => file.write(bytes),
            Sink::Stream(stream) => stream.write(bytes),
        }
    }

    fn flush(&mut self) -> io::Result<()> {
        match self {
            Sink::File { file, .. } => file.flush(),
            Sink::Stream(stream) => stream.flush(),
        }
    }
}
