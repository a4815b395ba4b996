//! The form for people: at most 110 columns wide, what matters first.

use std::fmt::Write;

use recording::text::counted;

use crate::examine::Analysis;
use crate::metrics::{self, Datum, Value};
use crate::peaks::SpectrumSummary;

/// Signals shown before the rest is only counted, unless the user named signals.
const MOST_SIGNALS: usize = 40;
/// Topics shown before the rest is only counted.
const MOST_TOPICS: usize = 16;
/// Events of one kind told one by one; more are counted.
const MOST_EVENTS: usize = 3;
/// Width of text.
const WIDTH: usize = 100;

/// One recording as text. `all_signals` lists every signal, however many there are.
pub fn table(a: &Analysis, all_signals: bool) -> String {
    let mut out = String::new();
    head(&mut out, a);
    metrics_section(&mut out, a);
    spectra_section(&mut out, a);
    events_section(&mut out, a);
    topics_section(&mut out, a);
    signals_section(&mut out, a, all_signals);
    quality_section(&mut out, a);
    out
}

/// Writing into a string cannot fail.
macro_rules! line {
    ($out:expr $(, $($arg:tt)*)?) => {{ let _ = writeln!($out $(, $($arg)*)?); }};
}

fn head(out: &mut String, a: &Analysis) {
    line!(out, "{}", a.file);
    line!(
        out,
        "  {} s, {} samples; analysed from {} to {} s",
        plain(a.duration_s, 3),
        thousands(a.samples),
        plain(a.window.start_s, 3),
        plain(a.window.end_s, 3)
    );
    let library = if a.library.is_empty() {
        "unnamed software".to_owned()
    } else {
        a.library.clone()
    };
    line!(
        out,
        "  {} {} on {}, written by {library}",
        thousands(a.messages),
        if a.messages == 1 {
            "message"
        } else {
            "messages"
        },
        counted(a.topics.len() as u64, "topic", "topics")
    );
    let told: Vec<String> = ["scene", "seed", "method", "source"]
        .iter()
        .filter_map(|key| a.metadata.iter().find(|(k, _)| k == key))
        .map(|(k, v)| format!("{k} {v}"))
        .collect();
    if !told.is_empty() {
        line!(out, "  {}", told.join(", "));
    }
    for (role, players) in &a.roles {
        let shown = match players.len() {
            0..=2 => players.join(", "),
            n => format!("{}, … {} ({n})", players[0], players[n - 1]),
        };
        line!(out, "  {role:<11} {shown}");
    }
    for warning in &a.warnings {
        wrapped(out, "  ! ", warning);
    }
    if a.salvaged {
        line!(
            out,
            "  ! its summary is missing or wrong: the file was searched from end to end"
        );
    }
    if a.skipped_messages > 0 {
        line!(
            out,
            "  ! {} lost",
            match a.skipped_messages {
                1 => "1 message is".to_owned(),
                n => format!("{} messages are", thousands(n)),
            }
        );
    }
}

fn topics_section(out: &mut String, a: &Analysis) {
    if a.topics.is_empty() {
        return;
    }
    line!(
        out,
        "\n{:<35} {:>9} {:>8}  schema, encoding",
        "Topics",
        "messages",
        "Hz"
    );
    for t in a.topics.iter().take(MOST_TOPICS) {
        let schema = match t.schema.as_str() {
            "" => "–",
            schema => schema,
        };
        let kind = format!("{}, {}", shortened(schema, 31), t.encoding);
        line!(
            out,
            "  {:<33} {:>9} {:>8}  {}",
            shortened(&t.name, 33),
            thousands(t.messages),
            t.hz.map_or("–".into(), short),
            shortened(&kind, WIDTH - 56)
        );
    }
    if a.topics.len() > MOST_TOPICS {
        let more = a.topics.len() - MOST_TOPICS;
        line!(out, "  … and {more} more: --format json lists all");
    }
}

fn metrics_section(out: &mut String, a: &Analysis) {
    let known: Vec<(&str, &Value)> = a
        .metrics
        .iter()
        .filter(|(_, v)| v.datum != Datum::Missing)
        .collect();
    // What is said of several is said once, behind them all.
    let missing = a.metrics.iter().filter(|(_, v)| v.datum == Datum::Missing);
    let missing = by_reason(missing.map(|(name, v)| (name, v.reason.as_deref().unwrap_or(""))));
    let said = known
        .iter()
        .filter_map(|(name, v)| Some((*name, v.reason.as_deref()?)));
    let mut shared = by_reason(said);
    shared.retain(|(_, names)| names.len() > 1);
    if !known.is_empty() {
        line!(out, "\nMetrics");
        let unit_of = |value: &Value| match value.unit {
            "1" | "bool" | "-" => "",
            unit => unit,
        };
        let units = known.iter().map(|(_, v)| unit_of(v).chars().count());
        let width = units.max().unwrap_or(0);
        for (name, value) in known {
            let label = metrics::find(name).map_or(name, |m| m.label);
            let unit = unit_of(value);
            let shown = match &value.datum {
                Datum::Number(x) => figures(*x),
                Datum::Bool(x) => (if *x { "yes" } else { "no" }).to_owned(),
                Datum::Word(x) => (*x).to_owned(),
                Datum::Missing => String::new(),
            };
            let mut note = value.source.clone();
            if let Some([low, high]) = value.ci95 {
                let _ = write!(note, "  95 %: {} … {}", figures(low), figures(high));
            }
            if !value.per.is_empty() {
                let most = 4;
                let per: Vec<String> = value.per.iter().take(most).map(|x| figures(*x)).collect();
                let rest = if value.per.len() > most { ", …" } else { "" };
                let _ = write!(note, "  [{}{rest}]", per.join(", "));
            }
            line!(
                out,
                "  {label:<30} {shown:>10} {unit:<width$} {name:<18} {note}"
            );
            if let Some(reason) = &value.reason
                && !shared.iter().any(|(r, _)| r == reason)
            {
                wrapped(out, "      ", reason);
            }
        }
    }
    for (reason, names) in shared {
        wrapped(out, "  – ", &format!("{}: {reason}", names.join(", ")));
    }
    for (reason, names) in missing {
        wrapped(out, "  – ", &format!("{reason}: no {}", names.join(", ")));
    }
}

/// Names by what is said of them, in the order of first sight.
fn by_reason<'a>(said: impl Iterator<Item = (&'a str, &'a str)>) -> Vec<(&'a str, Vec<&'a str>)> {
    let mut out: Vec<(&str, Vec<&str>)> = Vec::new();
    for (name, reason) in said {
        match out.iter_mut().find(|(r, _)| *r == reason) {
            Some((_, names)) => names.push(name),
            None => out.push((reason, vec![name])),
        }
    }
    out
}

fn spectra_section(out: &mut String, a: &Analysis) {
    let head = |s: &SpectrumSummary| {
        let f = s.f_hz.map(|f| format!(", f = {} Hz", figures(f)));
        format!(
            "Spectra (Welch, {} × {} s, {} Hz apart, noise bandwidth {} Hz, 95 %: × {} … {}{})",
            s.segments,
            plain(s.segment_s, 1),
            figures(s.resolution_hz),
            figures(s.enbw_hz),
            plain(s.confidence_95[0], 2),
            plain(s.confidence_95[1], 2),
            f.unwrap_or_default()
        )
    };
    let mut told_head = String::new();
    for (path, s) in &a.spectra {
        // Signals of other lengths and rates have others.
        let head = head(s);
        if head != told_head {
            line!(out, "\n{head}");
            told_head = head;
        }
        let told: Vec<String> = s
            .peaks
            .iter()
            .take(4)
            .map(|p| match p.kind {
                "other" => format!("{} Hz", plain(p.hz, 3)),
                kind => format!("{} Hz = {kind}", plain(p.hz, 3)),
            })
            .collect();
        let told = if told.is_empty() {
            "no line stands out".to_owned()
        } else {
            told.join(", ")
        };
        line!(out, "  {:<32} {told}", shortened(path, 32));
    }
}

fn events_section(out: &mut String, a: &Analysis) {
    if a.events.is_empty() {
        return;
    }
    line!(out, "\nEvents");
    let mut kinds: Vec<&str> = Vec::new();
    for e in &a.events {
        if !kinds.contains(&e.kind) {
            kinds.push(e.kind);
        }
    }
    for kind in kinds {
        let of_kind: Vec<_> = a.events.iter().filter(|e| e.kind == kind).collect();
        let told = if of_kind.len() > MOST_EVENTS {
            1
        } else {
            of_kind.len()
        };
        for e in &of_kind[..told] {
            wrapped(
                out,
                &format!("  {:>9} s  {:<17} ", plain(e.t_s, 3), e.kind),
                &e.what,
            );
        }
        if told < of_kind.len() {
            let last = of_kind[of_kind.len() - 1];
            line!(
                out,
                "  {:>11}  {kind:<17} … {} in all, the last at {} s",
                "",
                thousands(of_kind.len() as u64),
                plain(last.t_s, 3)
            );
        }
    }
}

fn signals_section(out: &mut String, a: &Analysis, all: bool) {
    if a.signals.is_empty() {
        return;
    }
    // What never changes, and stamps, are no news unless they were asked for.
    let news = |(path, s): &&(String, crate::summary::Summary)| {
        all || (s.min != s.max && !path.contains(".stamp."))
    };
    let listed: Vec<&(String, crate::summary::Summary)> = a.signals.iter().filter(news).collect();
    let shown = if all {
        listed.len()
    } else {
        listed.len().min(MOST_SIGNALS)
    };
    line!(
        out,
        "\n{:<38} {:>9} {:>7} {:>8} {:>8} {:>8} {:>8} {:>8} {:>7}",
        "Signals",
        "count",
        "Hz",
        "jitter s",
        "min",
        "mean",
        "max",
        "SD",
        "peak Hz"
    );
    let cell = |x: Option<f64>| x.map_or("–".to_owned(), short);
    for (path, s) in &listed[..shown] {
        let name = if s.unit.is_empty() {
            path.clone()
        } else {
            format!("{path} [{}]", s.unit)
        };
        line!(
            out,
            "  {:<36} {:>9} {:>7} {:>8} {:>8} {:>8} {:>8} {:>8} {:>7}",
            shortened(&name, 36),
            thousands(s.count),
            cell(s.hz),
            cell(s.jitter_s),
            cell(s.min),
            cell(s.mean),
            cell(s.max),
            cell(s.sd),
            cell(s.peak_hz)
        );
    }
    let still = a.signals.len() - listed.len();
    let more = match (listed.len() - shown, still) {
        (0, 0) => return,
        (0, still) => format!("{still} that never change, or are stamps"),
        (more, 0) => format!("{more} more"),
        (more, still) => format!("{more} more, and {still} that never change, or are stamps"),
    };
    line!(
        out,
        "  … and {more}: --signal '*' lists all, --signal PATH some of them"
    );
}

fn quality_section(out: &mut String, a: &Analysis) {
    if a.quality.is_empty() {
        return;
    }
    line!(out, "\nQuality");
    for q in &a.quality {
        // Many texts say where and when themselves.
        let at = q
            .t_s
            .filter(|_| !q.text.contains("first at"))
            .map(|t| format!(" (first at {} s)", plain(t, 3)))
            .unwrap_or_default();
        wrapped(
            out,
            if q.loss { "  ! " } else { "  – " },
            &format!("{}{at}", q.told()),
        );
    }
}

/// Text after a first indent, broken at blanks before [`WIDTH`]; the following lines are indented as deep.
fn wrapped(out: &mut String, indent: &str, text: &str) {
    let depth = indent.chars().count();
    let mut line = indent.to_owned();
    let mut width = depth;
    for word in text.split_whitespace() {
        let n = word.chars().count();
        if width + n > WIDTH && width > depth {
            line!(out, "{}", line.trim_end());
            line = " ".repeat(depth);
            width = depth;
        }
        line.push_str(word);
        line.push(' ');
        width += n + 1;
    }
    line!(out, "{}", line.trim_end());
}

/// A number with so many decimals, without trailing zeros.
fn plain(x: f64, decimals: usize) -> String {
    let text = format!("{x:.decimals$}");
    match text.contains('.') {
        true => text.trim_end_matches('0').trim_end_matches('.').to_owned(),
        false => text,
    }
}

/// Five significant figures for a metric, in at most ten characters.
pub(super) fn figures(x: f64) -> String {
    if x == 0.0 {
        return "0".into();
    }
    let size = x.abs().log10().floor() as i32;
    match size {
        -3..=5 => plain(x, (4 - size).max(0) as usize),
        _ => format!("{x:.4e}"),
    }
}

/// At most eight characters for a cell of the signals.
fn short(x: f64) -> String {
    if x == 0.0 {
        return "0".into();
    }
    let size = x.abs().log10().floor() as i32;
    match size {
        -3..=5 => plain(x, (3 - size).clamp(0, 5) as usize),
        _ => format!("{x:.1e}"),
    }
}

pub(super) fn thousands(n: u64) -> String {
    let digits = n.to_string();
    let mut out = String::new();
    for (k, c) in digits.chars().enumerate() {
        if k > 0 && (digits.len() - k).is_multiple_of(3) {
            out.push(',');
        }
        out.push(c);
    }
    out
}

/// The end of a path says what it is, and its beginning whose: the middle is left out.
pub(super) fn shortened(path: &str, width: usize) -> String {
    let n = path.chars().count();
    if n <= width {
        return path.to_owned();
    }
    let head = width / 2;
    let [begins, ends] = [(0, head), (n + head + 1 - width, n)]
        .map(|(from, to)| path.chars().skip(from).take(to - from).collect::<String>());
    format!("{begins}…{ends}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_short_and_true() {
        assert_eq!(figures(19.368460680515074), "19.368");
        assert_eq!(figures(0.0315551), "0.031555");
        assert_eq!(figures(294.9194), "294.92");
        assert_eq!(figures(-0.00503214), "-0.0050321");
        assert_eq!(figures(0.00027039), "2.7039e-4");
        assert_eq!(
            [figures(1e-20), figures(1e308)],
            ["1.0000e-20", "1.0000e308"]
        );
        assert_eq!(short(-0.000123), "-1.2e-4");
        assert_eq!(short(1234567.0), "1.2e6");
        assert_eq!(plain(15.0, 3), "15");
        assert_eq!(thousands(1840000), "1,840,000");
        assert_eq!(shortened("/imu/rath.angular_velocity.x", 10), "/imu/…ty.x");
        assert_eq!(shortened("/imu/rath.x", 11), "/imu/rath.x");
    }
}
