//! Metrics as CSV: one line per file and metric.

use crate::examine::Analysis;
use crate::metrics::Datum;

/// `file,metric,value,unit,source,per,ci95,reason`; `per` and the ends of the 95 % interval are separated by spaces.
pub fn csv(analyses: &[Analysis]) -> String {
    let mut out = String::from("file,metric,value,unit,source,per,ci95,reason\n");
    for analysis in analyses {
        for (name, value) in analysis.metrics.iter() {
            let number = match &value.datum {
                Datum::Number(x) => exact(*x),
                Datum::Bool(x) => x.to_string(),
                Datum::Word(x) => (*x).to_owned(),
                Datum::Missing => String::new(),
            };
            let spaced = |x: &[f64]| x.iter().map(|x| exact(*x)).collect::<Vec<_>>().join(" ");
            let ci95 = value.ci95.map_or(String::new(), |ends| spaced(&ends));
            let reason = value.reason.as_deref().unwrap_or("");
            let cells = [
                &analysis.file,
                name,
                &number,
                value.unit,
                &value.source,
                &spaced(&value.per),
                &ci95,
                reason,
            ]
            .map(quoted);
            out.push_str(&cells.join(","));
            out.push('\n');
        }
    }
    out
}

/// A number with all its digits and no more of its zeros: `1e-20`.
pub fn exact(x: f64) -> String {
    let text = format!("{x:?}");
    match text.strip_suffix(".0") {
        Some(whole) => whole.to_owned(),
        None => text,
    }
}

/// A cell by RFC 4180; one that a spreadsheet would run as a formula gets a leading apostrophe, unless it is of numbers.
pub fn quoted(cell: &str) -> String {
    let numbers = cell.split(' ').all(|part| part.parse::<f64>().is_ok());
    let formula = cell.starts_with(['=', '+', '-', '@']) && !numbers && cell.len() > 1;
    let cell = if formula {
        format!("'{cell}")
    } else {
        cell.to_owned()
    };
    match cell.contains([',', '"', '\n', '\r']) {
        true => format!("\"{}\"", cell.replace('"', "\"\"")),
        false => cell,
    }
}

#[cfg(test)]
mod tests {
    use super::{exact, quoted};

    #[test]
    fn numbers_are_whole_and_short() {
        for (x, expected) in [
            (1.0, "1"),
            (-0.1, "-0.1"),
            (0.00027039, "0.00027039"),
            (1e-20, "1e-20"),
            (1e308, "1e308"),
            (f64::NAN, "NaN"),
        ] {
            assert_eq!(exact(x), expected);
        }
    }

    #[test]
    fn cells_are_quoted_where_they_have_to_be() {
        for (cell, expected) in [
            ("a", "a"),
            ("-34.4 -20.6", "-34.4 -20.6"),
            ("-1 x", "'-1 x"),
            ("a,b", "\"a,b\""),
            ("say \"x\"", "\"say \"\"x\"\"\""),
            ("=cmd()", "'=cmd()"),
            ("-1.5", "-1.5"),
            ("-", "-"),
        ] {
            assert_eq!(quoted(cell), expected);
        }
    }
}
