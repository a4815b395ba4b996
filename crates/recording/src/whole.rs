//! Files that appear whole or not at all.

use std::{
    fs,
    io::{self, BufWriter, Write},
    path::{Path, PathBuf},
    sync::Mutex,
};

/// Fills a temporary file in the folder of `path` and gives it that name when it is complete; a failure leaves what was there as it was.
/// A link keeps pointing at what is replaced, and a device is written to.
///
/// # Errors
/// What the system says, or what `fill` returns.
pub fn write_whole<E: From<io::Error>>(
    path: &Path,
    fill: impl FnOnce(&mut Sink) -> Result<(), E>,
) -> Result<(), E> {
    let mut sink = Sink::beside(path)?;
    fill(&mut sink)?;
    Ok(sink.commit()?)
}

/// Temporary files that are being written, for [`remove_unfinished_files`].
static UNFINISHED: Mutex<Vec<PathBuf>> = Mutex::new(Vec::new());

/// Removes all temporary files that are being written: what a program does when it is interrupted, before it exits.
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

/// So much of a name stands in the temporary one, which is longer: systems take 255 bytes, some 143.
const MOST_NAME_BYTES: usize = 100;

/// Where the bytes go.
pub enum Sink {
    /// A file that is not complete.
    File {
        /// Its bytes.
        file: BufWriter<fs::File>,
        /// Its name until then: apart from the file, so that no error of writing says it.
        temporary: tempfile::TempPath,
        /// The name that it gets.
        path: PathBuf,
    },
    /// Anything else.
    Stream(BufWriter<Box<dyn Write + Send>>),
}

/// Where links lead, whether or not something is there: they keep pointing at the file that is written.
fn end_of_links(path: &Path) -> io::Result<PathBuf> {
    let mut path = path.to_owned();
    // As many as Linux follows.
    for _ in 0..40 {
        match fs::read_link(&path) {
            Ok(next) => path = path.parent().unwrap_or(Path::new("")).join(next),
            Err(_) => return Ok(path),
        }
    }
    Err(io::Error::other("its links lead in a circle"))
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
            // Found out now, not when all is written.
            Err(error) if error.kind() == io::ErrorKind::InvalidFilename => return Err(error),
            Ok(found) if found.permissions().readonly() => {
                return Err(io::Error::new(
                    io::ErrorKind::PermissionDenied,
                    "the file that is there is read-only",
                ));
            }
            _ => {}
        }
        let path = end_of_links(path)?;
        let folder = match path.parent() {
            Some(parent) if !parent.as_os_str().is_empty() => parent,
            _ => Path::new("."),
        };
        let name = path.file_name().ok_or(io::ErrorKind::InvalidInput)?;
        let name = name.to_string_lossy();
        let prefix = format!(".{}.", &name[..name.floor_char_boundary(MOST_NAME_BYTES)]);
        let mut builder = tempfile::Builder::new();
        builder.prefix(&prefix).suffix(".part");
        #[cfg(unix)]
        {
            use std::os::unix::fs::PermissionsExt as _;
            // As the file that is replaced, or as any new one: the system takes away what the umask forbids.
            let mode =
                fs::metadata(&path).map_or(0o666, |there| there.permissions().mode() & 0o777);
            builder.permissions(fs::Permissions::from_mode(mode));
        }
        let (file, temporary) = (builder.tempfile_in(folder))
            .map_err(|error| match error.kind() {
                kind @ io::ErrorKind::NotFound => {
                    io::Error::new(kind, "there is no such folder; make it first")
                }
                // Without the temporary name, which is nobody's.
                kind => {
                    let said = error.to_string();
                    io::Error::new(kind, said.split(" at path ").next().unwrap_or(&said))
                }
            })?
            .into_parts();
        if let Ok(mut paths) = UNFINISHED.lock() {
            paths.push(temporary.to_path_buf());
        }
        Ok(Sink::File {
            file: BufWriter::with_capacity(1 << 18, file),
            temporary,
            path,
        })
    }

    /// Writes what is left and gives a file its name.
    pub fn commit(mut self) -> io::Result<()> {
        self.flush()?;
        if let Sink::File {
            temporary, path, ..
        } = &self
        {
            fs::rename(temporary, path)?;
            forget(temporary);
        }
        Ok(())
    }
}

impl Drop for Sink {
    fn drop(&mut self) {
        if let Sink::File { temporary, .. } = self {
            // It removes itself after this; what was renamed is no longer under that name.
            forget(temporary);
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

/// A file that a program is told to write.
#[derive(Clone, Copy, Debug)]
pub struct Output<'a> {
    /// The option that names it.
    pub option: &'a str,
    /// Its name; `-` is standard output.
    pub path: &'a Path,
    /// What the name of such a file may end in.
    pub endings: &'a [&'a str],
}

/// What the names of files end in that hold something else each.
const KINDS: [&str; 20] = [
    "mcap", "bag", "db3", "rrd", "csv", "tsv", "parquet", "npz", "zip", "wav", "json", "toml",
    "yaml", "yml", "html", "htm", "md", "txt", "svg", "png",
];

/// What was asked for cannot be, whatever is in the files: wrong usage of a program.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("{0}")]
pub struct Usage(pub String);

/// That every output is none of the inputs, nor another output, and is not named as what it will not hold: a pattern or a slip that names a file
/// would lose it. What is there already is written over only where its name ends in what is written.
///
/// # Errors
/// A sentence with the path that must not be written.
pub fn may_write<'a>(
    outputs: &[Output<'a>],
    inputs: impl IntoIterator<Item = &'a Path>,
) -> Result<(), Usage> {
    apart(outputs.iter().map(|output| output.path), inputs)?;
    outputs.iter().try_for_each(named)
}

fn named(output: &Output<'_>) -> Result<(), Usage> {
    let ending = output.path.extension().unwrap_or_default();
    let is = |known: &&str| ending.eq_ignore_ascii_case(known);
    let new = !output.path.exists() && !KINDS.iter().any(is);
    if new || output.endings.iter().any(is) || keeps_nothing(output.path) {
        return Ok(());
    }
    Err(Usage(format!(
        "{} {}: expected a name that ends in .{}, so that no file of another kind is written over",
        output.option,
        output.path.display(),
        output.endings.join(" or .")
    )))
}

/// Standard output, a device, a pipe.
fn keeps_nothing(path: &Path) -> bool {
    path.as_os_str() == "-"
        || fs::metadata(path).is_ok_and(|found| !found.is_file() && !found.is_dir())
}

/// That an output is none of the inputs, nor another output: whoever names one twice would lose it.
fn apart<'a>(
    outputs: impl IntoIterator<Item = &'a Path>,
    inputs: impl IntoIterator<Item = &'a Path>,
) -> Result<(), Usage> {
    // What is not there yet may lie in a folder that is, and a link may lead to it.
    let whereabouts = |path: &Path| {
        let path = end_of_links(path).ok()?;
        let folder = path.parent().filter(|p| !p.as_os_str().is_empty());
        let folder = folder.unwrap_or(Path::new(".")).canonicalize();
        path.canonicalize()
            .ok()
            .or_else(|| Some(folder.ok()?.join(path.file_name()?)))
    };
    let inputs = inputs.into_iter();
    let mut seen: Vec<_> = inputs.filter_map(|path| path.canonicalize().ok()).collect();
    for path in outputs {
        let Some(place) = whereabouts(path) else {
            continue;
        };
        if seen.contains(&place) {
            return Err(Usage(format!(
                "{}: is named twice, and what is read or written there would be lost; give the output another name",
                path.display()
            )));
        }
        if !keeps_nothing(&place) {
            seen.push(place);
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::Error;

    #[test]
    fn nothing_is_read_and_written_at_once() {
        let folder = tempfile::tempdir().unwrap();
        let [x, y] = ["x", "y"].map(|name| folder.path().join(name));
        fs::write(&x, "1").unwrap();
        let round_about = folder
            .path()
            .join("..")
            .join(folder.path().file_name().unwrap());
        assert!(apart([&*y], [&*x]).is_ok());
        assert!(
            apart([&*round_about.join("x")], [&*x])
                .unwrap_err()
                .0
                .contains("twice")
        );
        assert!(apart([&*y, &*round_about.join("y")], [&*x]).is_err());
        assert!(apart([Path::new("/dev/null"), Path::new("/dev/null")], []).is_ok());
    }

    #[test]
    fn nothing_is_written_under_the_name_of_another_kind() {
        let folder = tempfile::tempdir().unwrap();
        let names = [
            "a.mcap",
            "b.mcap",
            "a.html",
            "B.HTM",
            "walk.2026-11-27",
            "new",
        ];
        let [a, b, html, htm, odd, new] = names.map(|name| folder.path().join(name));
        fs::write(&a, "1").unwrap();
        fs::write(&odd, "1").unwrap();
        let report = |path| Output {
            option: "--report",
            path,
            endings: &["html", "htm"],
        };
        for path in [&*html, &htm, &new, Path::new("-"), Path::new("/dev/null")] {
            assert_eq!(may_write(&[report(path)], [&*b]), Ok(()), "{path:?}");
        }
        for path in [&a, &odd, &b] {
            let Usage(said) = may_write(&[report(path)], []).unwrap_err();
            let expected = "expected a name that ends in .html or .htm";
            assert!(
                said.starts_with("--report ") && said.contains(expected),
                "{said}"
            );
        }
        let Usage(twice) = may_write(&[report(&a)], [&*a]).unwrap_err();
        assert!(twice.contains("twice"), "{twice}");
    }

    #[test]
    fn a_folder_that_is_not_there_is_said_without_the_temporary_name() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("none").join("x");
        let error = write_whole::<Error>(&path, |_| Ok(())).unwrap_err();
        assert_eq!(error.to_string(), "there is no such folder; make it first");
    }

    #[cfg(unix)]
    #[test]
    fn no_error_says_the_temporary_name() {
        let folder = tempfile::tempdir().unwrap();
        let long = "x".repeat(256);
        let error = write_whole::<Error>(&folder.path().join(&long), |_| Ok(())).unwrap_err();
        assert!(!error.to_string().contains(&long), "{error}");
        assert!(error.to_string().contains("too long"), "{error}");
        // A file that refuses what is written, as a full disk does.
        let path = folder.path().join("x");
        let mut sink = Sink::beside(&path).unwrap();
        if let Sink::File { file, .. } = &mut sink {
            *file = BufWriter::new(
                fs::OpenOptions::new()
                    .write(true)
                    .open("/dev/full")
                    .unwrap(),
            );
        }
        let error = (sink.write_all(b"x").and_then(|()| sink.commit())).unwrap_err();
        assert_eq!(error.kind(), io::ErrorKind::StorageFull);
        assert!(!error.to_string().contains("path"), "{error}");
        assert!(!path.exists());
    }

    #[cfg(unix)]
    #[test]
    fn a_link_stays_a_link_and_a_device_a_device() {
        let folder = tempfile::tempdir().unwrap();
        let [there, link] = ["there", "link"].map(|name| folder.path().join(name));
        fs::write(&there, "old").unwrap();
        std::os::unix::fs::symlink(&there, &link).unwrap();
        write_whole::<Error>(&link, |f| f.write_all(b"new")).unwrap();
        assert!(link.is_symlink());
        assert_eq!(fs::read(&there).unwrap(), b"new");
        // One that points at nothing yet, by a name in its own folder.
        fs::remove_file(&there).unwrap();
        fs::remove_file(&link).unwrap();
        std::os::unix::fs::symlink("there", &link).unwrap();
        assert!(apart([&*link, &*there], []).is_err());
        write_whole::<Error>(&link, |f| f.write_all(b"first")).unwrap();
        assert!(link.is_symlink());
        assert_eq!(fs::read(&there).unwrap(), b"first");
        fs::remove_file(&there).unwrap();
        std::os::unix::fs::symlink(&link, &there).unwrap();
        let circle = write_whole::<Error>(&link, |f| f.write_all(b"x")).unwrap_err();
        assert_eq!(circle.to_string(), "its links lead in a circle");
        assert!(link.is_symlink() && there.is_symlink());
        let null = Path::new("/dev/null");
        write_whole::<Error>(null, |f| f.write_all(b"new")).unwrap();
        assert!(!null.is_file());
    }

    #[test]
    fn a_failure_leaves_nothing_behind_and_the_old_file_alone() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("x.txt");
        write_whole::<Error>(&path, |f| f.write_all(b"old")).unwrap();
        let failed = write_whole::<Error>(&path, |f| {
            f.write_all(b"new")?;
            Err(Error::other("no more"))
        });
        assert!(failed.is_err());
        assert_eq!(fs::read(&path).unwrap(), b"old");
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1);
        assert!(write_whole::<Error>(&folder.path().join("no/such/x"), |_| Ok(())).is_err());
    }
}
