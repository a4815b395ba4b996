//! Small texts: scenes, studies, roles, layouts.

pub mod document;
pub mod meant;

use std::fs::File;
use std::io::{Error, ErrorKind, Read, Result, Write};
use std::path::Path;

/// A line on standard error, for people. It need not be heard: where nothing can be written it is left out.
#[macro_export]
macro_rules! note {
    ($($part:tt)*) => {{
        use std::io::Write as _;
        let _ = writeln!(std::io::stderr(), "{}", $crate::text::plain(&format!($($part)*)));
    }};
}

/// A text for a terminal or a page: what a name in somebody's file could command it with (escape sequences, bells), or XML cannot hold, stands as
/// U+FFFD.
pub fn plain(text: &str) -> std::borrow::Cow<'_, str> {
    let commands = |c: char| {
        c.is_control() && !matches!(c, '\n' | '\t') || matches!(c, '\u{fffe}' | '\u{ffff}')
    };
    match text.contains(commands) {
        true => text.replace(commands, "\u{fffd}").into(),
        false => text.into(),
    }
}

/// A result on standard output, [`plain`]; a reader that went away early (`… | head -1`) is no error.
///
/// # Errors
/// What standard output says where it takes no more.
pub fn print(text: &str) -> Result<()> {
    let mut out = std::io::stdout().lock();
    match (out.write_all(plain(text).as_bytes())).and_then(|()| out.flush()) {
        Err(e) if e.kind() != ErrorKind::BrokenPipe => Err(Error::new(
            e.kind(),
            format!("standard output takes no more: {e}"),
        )),
        _ => Ok(()),
    }
}

/// A path as a word of a command that somebody may copy into a shell, in quotes where it takes them.
pub fn word(path: impl AsRef<Path>) -> String {
    let path = path.as_ref().display().to_string();
    match shlex::try_quote(&path) {
        Ok(quoted) => quoted.into_owned(),
        // No system's paths have a NUL.
        Err(_) => path,
    }
}

/// A count with its noun: `1 gap`, `2 gaps`.
pub fn counted(count: u64, one: &str, several: &str) -> String {
    let what = if count == 1 { one } else { several };
    format!("{count} {what}")
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
    fn a_name_cannot_command_the_terminal() {
        assert_eq!(plain("φ\t1\n"), "φ\t1\n");
        assert_eq!(
            plain("a\u{1b}[2J\u{7}\u{9b}\u{ffff}"),
            "a\u{fffd}[2J\u{fffd}\u{fffd}\u{fffd}"
        );
    }

    #[test]
    fn a_command_takes_a_path_with_a_space_as_one() {
        for path in ["my studies/it's", "$HOME", ""] {
            let back = shlex::split(&format!("study merge {}", word(path)));
            assert_eq!(back.unwrap(), ["study", "merge", path]);
        }
        assert_eq!(word("/tmp/run-1.mcap"), "/tmp/run-1.mcap");
    }

    #[test]
    fn one_is_not_several() {
        assert_eq!(counted(1, "gap", "gaps"), "1 gap");
        assert_eq!(counted(0, "gap", "gaps"), "0 gaps");
    }

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
