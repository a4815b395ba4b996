//! TOML documents: scenes, studies, roles, layouts. What is wrong with one is told in one sentence, with its place.

use super::meant::did_you_mean;
use serde::de::DeserializeOwned;
use std::ops::Range;

/// What is wrong with a document.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Wrong {
    /// Line and column, from 1, where a place can be blamed.
    pub at: Option<(usize, usize)>,
    /// What was found and expected there.
    pub message: String,
}

impl Wrong {
    /// Where in the document `name` it is: `name:line:column`.
    pub fn place(&self, name: impl std::fmt::Display) -> String {
        match self.at {
            Some((line, column)) => format!("{name}:{line}:{column}"),
            None => name.to_string(),
        }
    }
}

/// Reads a document.
///
/// # Errors
/// What is no TOML, or not what `T` looks like.
pub fn from_toml<T: DeserializeOwned>(text: &str) -> Result<T, Wrong> {
    toml::from_str(text).map_err(|why| Wrong {
        at: why.span().map(|span| line_and_column(text, &span)),
        message: readable(why.message()),
    })
}

/// Where a span begins, line and column from 1.
pub fn line_and_column(text: &str, span: &Range<usize>) -> (usize, usize) {
    let before = &text[..text.floor_char_boundary(span.start)];
    let line = before.matches('\n').count() + 1;
    let column = before.chars().rev().take_while(|&c| c != '\n').count() + 1;
    (line, column)
}

/// What the reader of TOML says, in our words, in one line, with the nearest name after a slip.
pub fn readable(message: &str) -> String {
    let mut message = message.trim().replace('\n', " ");
    for (theirs, ours) in [
        ("invalid type: ", "found "),
        ("invalid value: ", "found "),
        ("expected f64", "expected a number"),
        ("expected u64", "expected a whole number, zero to 2^56 - 1"),
        ("expected u32", "expected a whole number, zero or more"),
        ("expected usize", "expected a whole number, zero or more"),
        ("expected a sequence", "expected a list"),
    ] {
        message = message.replace(theirs, ours);
    }
    let mut ticks = message.split('`').skip(1).step_by(2);
    if (message.starts_with("unknown field") || message.starts_with("unknown variant"))
        && let Some(word) = ticks.next()
    {
        let question = did_you_mean(word, ticks);
        if !question.is_empty() {
            return format!("{message}.{question}");
        }
    }
    message
}

#[cfg(test)]
mod tests {
    use super::*;

    #[derive(Debug, serde::Deserialize)]
    #[serde(deny_unknown_fields)]
    struct Drum {
        beat_hz: f64,
        strokes: Option<Vec<f64>>,
    }

    #[test]
    fn an_error_is_one_sentence_with_its_place() {
        let drum: Drum = from_toml("beat_hz = 2.15\nstrokes = [1.0]").unwrap();
        assert_eq!((drum.beat_hz, drum.strokes), (2.15, Some(vec![1.0])));
        for (text, expected) in [
            (
                "beat_hz = \"two\"",
                "d.toml:1:11: found string \"two\", expected a number",
            ),
            (
                "# तबला\n  beat_h = 2.0",
                "d.toml:2:3: unknown field `beat_h`, expected `beat_hz` or `strokes`. Did you mean `beat_hz`?",
            ),
            (
                "beat_hz = 2\nstrokes = 3.0",
                "d.toml:2:11: found floating point `3.0`, expected a list",
            ),
            (
                "beat_hz = ",
                "d.toml:1:11: string values must be quoted, expected literal string",
            ),
        ] {
            let wrong = from_toml::<Drum>(text).unwrap_err();
            let said = format!("{}: {}", wrong.place("d.toml"), wrong.message);
            assert_eq!(said, expected);
        }
    }
}
