//! Small texts: scenes, studies, roles, layouts.

use std::fs::File;
use std::io::{Error, ErrorKind, Read, Result};
use std::path::Path;

/// A line on standard error, for people. It need not be heard: where nothing can be written it is left out.
#[macro_export]
macro_rules! note {
    ($($part:tt)*) => {{
        use std::io::Write as _;
        let _ = writeln!(std::io::stderr(), $($part)*);
    }};
}

/// None is longer; what is may have no end.
const MOST_BYTES: u64 = 64 << 20;

/// Reads a text.
///
/// # Errors
/// What the system says; [`ErrorKind::InvalidData`] where it is no UTF-8, or longer than 64 MiB.
pub fn read_text(path: &Path) -> Result<String> {
    let mut bytes = Vec::new();
    File::open(path)?
        .take(MOST_BYTES + 1)
        .read_to_end(&mut bytes)?;
    let unfit = |what: &str| Error::new(ErrorKind::InvalidData, what);
    if bytes.len() as u64 > MOST_BYTES {
        return Err(unfit("it is longer than 64 MiB; expected a text"));
    }
    String::from_utf8(bytes).map_err(|_| unfit("it is no text (UTF-8)"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_no_text_is_refused() {
        let file = tempfile::NamedTempFile::new().unwrap();
        std::fs::write(&file, "φ = 1").unwrap();
        assert_eq!(read_text(file.path()).unwrap(), "φ = 1");
        std::fs::write(&file, [0xff, 0xfe]).unwrap();
        assert_eq!(
            read_text(file.path()).unwrap_err().kind(),
            ErrorKind::InvalidData
        );
        file.as_file().set_len(MOST_BYTES + 1).unwrap();
        assert!(
            read_text(file.path())
                .unwrap_err()
                .to_string()
                .contains("64 MiB")
        );
    }
}
