//! A window as people write it: `A..B` in seconds.

/// `15..60`, `15..`, `..60`, `..`: first and last moment, each optional.
///
/// # Errors
/// What is no such text, or ends before it begins.
pub fn parse(text: &str) -> Result<(Option<f64>, Option<f64>), String> {
    let (a, b) = text
        .split_once("..")
        .ok_or("expected A..B in seconds, such as 15..60, 15.. or ..60")?;
    let number = |s: &str| -> Result<Option<f64>, String> {
        match s.trim() {
            "" => Ok(None),
            s => match s.parse::<f64>() {
                // Longer than a lifetime of 64 bits of nanoseconds is no recording.
                Ok(x) if x.abs() <= 1e10 => Ok(Some(x)),
                _ => Err(format!("\"{s}\" is not a number of seconds, or above 1e10")),
            },
        }
    };
    let (start_s, end_s) = (number(a)?, number(b)?);
    if let (Some(start_s), Some(end_s)) = (start_s, end_s)
        && start_s >= end_s
    {
        return Err(format!(
            "the window ends at {end_s} s, not after it begins at {start_s} s"
        ));
    }
    Ok((start_s, end_s))
}

#[cfg(test)]
mod tests {
    use super::parse;

    #[test]
    fn windows() {
        assert_eq!(parse("15..60"), Ok((Some(15.0), Some(60.0))));
        assert_eq!(parse("1.5.."), Ok((Some(1.5), None)));
        assert_eq!(parse("..60"), Ok((None, Some(60.0))));
        for bad in ["15", "60..15", "a..b", "15..nan", "1e999..", "0..1e300"] {
            assert!(parse(bad).is_err(), "{bad}");
        }
    }
}
