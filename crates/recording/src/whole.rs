//! Files that appear whole or not at all.

use std::io::{Error, Write};
use std::path::Path;

/// Fills a temporary file in the folder of `path` and gives it that name when it is complete; a failure leaves what was there as it was.
///
/// # Errors
/// What the system says, or what `fill` returns.
pub fn write_whole<E: From<Error>>(
    path: &Path,
    fill: impl FnOnce(&mut std::fs::File) -> Result<(), E>,
) -> Result<(), E> {
    let folder = path
        .parent()
        .filter(|p| !p.as_os_str().is_empty())
        .unwrap_or(Path::new("."));
    let mut builder = tempfile::Builder::new();
    builder.prefix(".whole-").suffix(".part");
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt;
        // As any other new file: the user's mask takes its part away.
        builder.permissions(std::fs::Permissions::from_mode(0o666));
    }
    let mut file = builder.tempfile_in(folder)?;
    fill(file.as_file_mut())?;
    file.as_file_mut().flush()?;
    file.persist(path).map_err(|e| e.error)?;
    Ok(())
}

/// That an output is none of the inputs, nor another output: whoever names one twice would lose it.
///
/// # Errors
/// A sentence with the path that was named twice.
pub fn apart<'a>(
    outputs: impl IntoIterator<Item = &'a Path>,
    inputs: impl IntoIterator<Item = &'a Path>,
) -> Result<(), String> {
    // What is not there yet may lie in a folder that is.
    let whereabouts = |path: &Path| {
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
            return Err(format!(
                "{}: is named twice, and what is read or written there would be lost; give the output another name",
                path.display()
            ));
        }
        // A device keeps nothing.
        if place.is_file() || !place.exists() {
            seen.push(place);
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nothing_is_read_and_written_at_once() {
        let folder = tempfile::tempdir().unwrap();
        let [x, y] = ["x", "y"].map(|name| folder.path().join(name));
        std::fs::write(&x, "1").unwrap();
        let round_about = folder
            .path()
            .join("..")
            .join(folder.path().file_name().unwrap());
        assert!(apart([&*y], [&*x]).is_ok());
        assert!(
            apart([&*round_about.join("x")], [&*x])
                .unwrap_err()
                .contains("twice")
        );
        assert!(apart([&*y, &*round_about.join("y")], [&*x]).is_err());
        assert!(apart([Path::new("/dev/null"), Path::new("/dev/null")], []).is_ok());
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
        assert_eq!(std::fs::read(&path).unwrap(), b"old");
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
        assert!(write_whole::<Error>(&folder.path().join("no/such/x"), |_| Ok(())).is_err());
    }
}
