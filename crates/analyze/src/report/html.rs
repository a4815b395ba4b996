//! `--report`: one page that needs nothing else: numbers with their definitions, plots to look into, and how it was made.

use std::fmt::Write;

use serde_json::{Value, json};

use super::plots::{COLOURS, Image, Panel, Plot, Series, plots};
use super::table::{figures, thousands};
use crate::envelope::outline_of;
use crate::examine::Analysis;
use crate::metrics::{self, Datum};
use recording::text::{counted, plain};

/// Metrics shown large at the top, with what is said beside them: of those that have a value the first eight.
const TILES: [(&str, &str); 9] = [
    ("mechanism", "what drives the roll"),
    ("rms_roll_deg", "RMS roll, deg"),
    ("contact_loss_mean", "contact loss, mean"),
    ("synchrony", "synchrony"),
    ("onset_time_s", "onset, s"),
    ("dz_pp_m", "height, peak to peak, m"),
    ("t_float", "unloaded time, T_float"),
    ("peak_hz", "strongest line, Hz"),
    ("step_rate_hz", "steps per second"),
];

/// [`COLOURS`] for dark paper: the same hues, each light enough to be seen on it and on what is shaded there.
const DARK: [&str; COLOURS.len()] = [
    "#3A9AE8", "#F07F2E", "#22BD8C", "#DD8FBA", "#F0B429", "#A6DAFA", "#A6A6A6",
];

/// Cividis, sampled: rises evenly in lightness, the same to every kind of colour vision (Nuñez et al. 2018).
const MAP: [[u8; 3]; 9] = [
    [0, 34, 78],
    [18, 53, 112],
    [59, 73, 108],
    [87, 93, 109],
    [112, 113, 115],
    [138, 134, 120],
    [165, 156, 116],
    [200, 185, 100],
    [254, 232, 56],
];

/// Events listed; more are counted.
const MOST_EVENTS: usize = 400;
/// Topics listed.
const MOST_TOPICS: usize = 500;
/// Signals listed.
const MOST_SIGNALS: usize = 2000;
/// Points of all curves over time together, of some 18 bytes each: a page stays below 3 MB however long the recording is.
const MOST_POINTS: usize = 100_000;

/// The page for one recording. `command` is the command line that makes it again.
pub fn html(a: &Analysis, command: &str) -> String {
    let mut plots = plots(a);
    share(&mut plots);
    let mut out = String::with_capacity(1 << 20);
    let title = std::path::Path::new(&a.file)
        .file_name()
        .and_then(|n| n.to_str())
        .unwrap_or(&a.file);
    let _ = write!(
        out,
        "<!doctype html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n<meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n\
         <title>{}</title>\n<link rel=\"icon\" href=\"data:,\">\n<style>\n{}{}</style>\n</head>\n<body>\n",
        escaped(title),
        colours(),
        include_str!("page.css")
    );
    head(&mut out, a, title);
    tiles(&mut out, a);
    figures_section(&mut out, &plots);
    metrics_section(&mut out, a);
    lines_section(&mut out, a);
    events_section(&mut out, a);
    quality_section(&mut out, a);
    recording_section(&mut out, a);
    signals_section(&mut out, a);
    let _ = write!(
        out,
        "<h2 id=\"made\">How this page was made</h2>\n<pre>{}</pre>\n<p class=\"faint\">analyze {}. The page is complete in itself: it loads nothing from elsewhere.</p>\n",
        escaped(command),
        env!("CARGO_PKG_VERSION")
    );
    let _ = write!(
        out,
        "<script type=\"application/json\" id=\"data\">{}</script>\n<script>\n{}</script>\n</body>\n</html>\n",
        // `</script>` inside a string would end the element.
        data(&plots).to_string().replace('<', "\\u003c"),
        include_str!("page.js")
    );
    out
}

/// The colours of curves as the style sheet's variables `--c0` …; paper that is printed is white.
fn colours() -> String {
    let all = |colours: &[&str]| {
        let each = colours.iter().enumerate();
        each.map(|(k, c)| format!("--c{k}:{c};"))
            .collect::<String>()
    };
    format!(
        ":root{{{}}}\n@media screen and (prefers-color-scheme:dark){{:root{{{}}}}}\n",
        all(&COLOURS),
        all(&DARK)
    )
}

fn head(out: &mut String, a: &Analysis, title: &str) {
    let _ = write!(
        out,
        "<header>\n<h1>{}</h1>\n<p class=\"faint\">",
        escaped(title)
    );
    let _ = write!(
        out,
        "{:.3} s, {}; analysed from {:.3} to {:.3} s",
        a.duration_s,
        several(a.samples, "sample"),
        a.window.start_s,
        a.window.end_s
    );
    for key in ["scene", "seed", "source", "method"] {
        if let Some((_, value)) = a.metadata.iter().find(|(k, _)| k == key) {
            let _ = write!(out, " · {key} {}", escaped(value));
        }
    }
    out.push_str("</p>\n");
    let lost = a.lost();
    let told = |text: &str| lost.as_ref().is_some_and(|lost| lost.contains(text));
    let warnings = a.warnings.iter().filter(|w| !told(w));
    for warning in lost.iter().chain(warnings) {
        let _ = writeln!(
            out,
            "<p class=\"warn\">{}.</p>",
            escaped(&sentence(warning))
        );
    }
    out.push_str("</header>\n");
}

/// So many of something.
fn several(count: u64, what: &str) -> String {
    let s = if count == 1 { "" } else { "s" };
    format!("{} {what}{s}", thousands(count))
}

/// That a list is not whole, where it is not.
fn first(count: usize, most: usize) -> String {
    match count > most {
        true => format!(
            "<p class=\"faint\">The first {most} are listed; <code>--format json</code> has all.</p>\n"
        ),
        false => String::new(),
    }
}

/// With a capital.
fn sentence(text: &str) -> String {
    let mut letters = text.chars();
    let first = letters.next().into_iter().flat_map(char::to_uppercase);
    first.chain(letters).collect()
}

fn shown(datum: &Datum) -> String {
    match datum {
        Datum::Number(x) => figures(*x),
        Datum::Bool(x) => (if *x { "yes" } else { "no" }).into(),
        Datum::Word(x) => (*x).into(),
        Datum::Missing => "–".into(),
    }
}

/// Three digits: what a glance takes in; the table of metrics has more.
fn coarse(x: f64) -> String {
    let size = x.abs().log10().floor();
    match x {
        0.0 => "0".into(),
        // OK because the logarithm of a double is below 400.
        _ if (-4.0..6.0).contains(&size) => format!("{x:.*}", (2.0 - size).max(0.0) as usize),
        _ => format!("{x:.2e}"),
    }
}

fn tiles(out: &mut String, a: &Analysis) {
    let known: Vec<_> = TILES
        .iter()
        .filter_map(|(name, label)| Some((*name, label, a.metrics.get(name)?)))
        .filter(|(_, _, v)| v.datum != Datum::Missing)
        .take(8)
        .collect();
    if known.is_empty() {
        return;
    }
    out.push_str("<div class=\"tiles\">\n");
    for (name, label, value) in known {
        let chance = (name == "synchrony")
            .then(|| a.metrics.number("synchrony_chance"))
            .flatten();
        let mut beside = String::new();
        if let Some([low, high]) = value.ci95 {
            let _ = write!(beside, " ({} … {})", coarse(low), coarse(high));
        }
        if let Some(chance) = chance {
            let _ = write!(beside, ", {} by chance", coarse(chance));
        }
        let large = match value.datum {
            Datum::Number(x) => coarse(x),
            ref other => shown(other),
        };
        let _ = writeln!(
            out,
            "<div class=\"tile\"><b>{large}</b><span>{}{beside}</span></div>",
            label.replace(", ", ",\u{a0}")
        );
    }
    out.push_str("</div>\n");
}

fn figures_section(out: &mut String, plots: &[Plot]) {
    if plots.is_empty() {
        out.push_str("<p class=\"faint\">Nothing is drawn: no signal changes.</p>\n");
        return;
    }
    out.push_str(
        "<h2 id=\"plots\">Plots</h2>\n<p class=\"faint hint\">Drag to zoom (time axes move together), double-click to see all, \
         shift + wheel or + and − to zoom, point to read values. <button id=\"reset\" type=\"button\">Show all</button></p>\n<div class=\"plots\">\n",
    );
    for (k, plot) in plots.iter().enumerate() {
        let (title, note, wide) = match plot {
            Plot::Panel(p) => (&p.title, &p.note, p.time),
            Plot::Image(i) => (&i.title, &i.note, true),
        };
        let _ = writeln!(
            out,
            "<figure data-plot=\"{k}\"{}><h3>{t}</h3><svg role=\"img\" tabindex=\"0\" aria-label=\"{t}\"></svg><div class=\"legend\"></div><figcaption>{}</figcaption></figure>",
            if wide { " class=\"wide\"" } else { "" },
            escaped(note),
            t = escaped(title)
        );
    }
    out.push_str("</div>\n");
}

fn metrics_section(out: &mut String, a: &Analysis) {
    out.push_str("<h2 id=\"metrics\">Metrics</h2>\n");
    let rows = |missing: bool| -> Vec<_> {
        let all = a.metrics.iter();
        all.filter(move |(_, value)| (value.datum == Datum::Missing) == missing)
            .map(|(name, value)| {
                // What is held against a truth that the file brings has a name alone.
                let metric = metrics::find(name);
                let label = metric.map_or(name, |metric| metric.label);
                let said = metric.map_or_else(String::new, |metric| definition(name, metric));
                (label, value, said)
            })
            .collect()
    };
    let [known, missing] = [false, true].map(rows);
    if !known.is_empty() {
        let _ = writeln!(
            out,
            "<p class=\"faint\">Each opens to its definition, where W is the stretch that is analysed, from {:.3} to {:.3} s.</p>",
            a.window.start_s, a.window.end_s
        );
        out.push_str("<div class=\"scroll\"><table class=\"metrics\"><thead><tr><th>metric</th><th class=\"n\">value</th><th>unit</th><th>from</th></tr></thead><tbody>\n");
        for (label, value, mut more) in known {
            let unit = if matches!(value.unit, "1" | "bool" | "-") {
                ""
            } else {
                value.unit
            };
            if let Some(reason) = &value.reason {
                let _ = write!(more, "<p>{}</p>", escaped(reason));
            }
            if !value.per.is_empty() {
                let per: Vec<String> = value.per.iter().take(64).map(|x| figures(*x)).collect();
                let _ = write!(
                    more,
                    "<p class=\"faint\"><code>per</code>: {}</p>",
                    per.join(", ")
                );
            }
            if let Some([low, high]) = value.ci95 {
                let _ = write!(
                    more,
                    "<p class=\"faint\">95 % interval: {} … {}</p>",
                    figures(low),
                    figures(high)
                );
            }
            let _ = writeln!(
                out,
                "<tr><td><details><summary>{}</summary>{more}</details></td><td class=\"n\">{}</td><td>{unit}</td><td>{}</td></tr>",
                escaped(label),
                shown(&value.datum),
                escaped(&value.source)
            );
        }
        out.push_str("</tbody></table></div>\n");
    }
    if missing.is_empty() {
        return;
    }
    let _ = write!(
        out,
        "<details id=\"missing\"><summary>{}, and why</summary>\n<div class=\"scroll\"><table><tbody>\n",
        counted(
            missing.len() as u64,
            "metric has no value here",
            "metrics have no value here"
        )
    );
    for (label, value, said) in missing {
        let _ = writeln!(
            out,
            "<tr><td><details><summary>{}</summary>{said}</details></td><td>{}</td></tr>",
            escaped(label),
            escaped(value.reason.as_deref().unwrap_or(""))
        );
    }
    out.push_str("</tbody></table></div></details>\n");
}

/// What a metric is and whose.
fn definition(name: &str, metric: &metrics::Metric) -> String {
    format!(
        "<p>{}</p><p class=\"faint\">Definition from: {}. Name: <code>{name}</code>.</p>",
        with_code(metric.definition),
        escaped(metric.origin)
    )
}

fn lines_section(out: &mut String, a: &Analysis) {
    if a.spectra.is_empty() {
        return;
    }
    out.push_str("<h2 id=\"lines\">Spectral lines</h2>\n<div class=\"scroll\"><table><thead><tr><th>signal</th><th>lines, strongest first</th></tr></thead><tbody>\n");
    for (path, s) in &a.spectra {
        let lines: Vec<String> = s
            .peaks
            .iter()
            .map(|p| match p.kind {
                "other" => format!("{:.3} Hz", p.hz),
                kind => format!("{:.3} Hz = {kind}", p.hz),
            })
            .collect();
        let lines = if lines.is_empty() {
            "none stands out".to_owned()
        } else {
            lines.join(", ")
        };
        let _ = writeln!(
            out,
            "<tr><td><code>{}</code></td><td>{lines}</td></tr>",
            escaped(path)
        );
    }
    out.push_str("</tbody></table></div>\n");
}

fn events_section(out: &mut String, a: &Analysis) {
    if a.events.is_empty() {
        return;
    }
    // Kinds by their first time.
    let mut kinds: Vec<(&str, u64)> = Vec::new();
    for e in &a.events {
        match kinds.iter_mut().find(|(kind, _)| *kind == e.kind) {
            Some((_, n)) => *n += 1,
            None => kinds.push((e.kind, 1)),
        }
    }
    let kinds: Vec<String> = kinds
        .iter()
        .map(|(kind, n)| format!("{} × {}", thousands(*n), kind.replace('_', " ")))
        .collect();
    let _ = write!(
        out,
        "<h2 id=\"events\">Events</h2>\n<details{}><summary>{}: {}</summary>\n",
        if a.events.len() <= 20 { " open" } else { "" },
        several(a.events.len() as u64, "event"),
        kinds.join(", ")
    );
    out.push_str(&first(a.events.len(), MOST_EVENTS));
    out.push_str("<div class=\"scroll\"><table><thead><tr><th class=\"n\">time, s</th><th>kind</th><th>what</th></tr></thead><tbody>\n");
    for e in a.events.iter().take(MOST_EVENTS) {
        let _ = writeln!(
            out,
            "<tr><td class=\"n\">{:.3}</td><td>{}</td><td>{}</td></tr>",
            e.t_s,
            e.kind.replace('_', " "),
            escaped(&e.what)
        );
    }
    out.push_str("</tbody></table></div></details>\n");
}

fn quality_section(out: &mut String, a: &Analysis) {
    if a.quality.is_empty() {
        return;
    }
    out.push_str("<h2 id=\"quality\">Quality of the data</h2>\n<div class=\"scroll\"><table><thead><tr><th>topic</th><th>kind</th><th class=\"n\">count</th><th>what</th></tr></thead><tbody>\n");
    for q in &a.quality {
        let _ = writeln!(
            out,
            "<tr{}><td><code>{}</code></td><td>{}</td><td class=\"n\">{}</td><td>{}</td></tr>",
            if q.loss { " class=\"warn\"" } else { "" },
            escaped(&q.topic),
            q.kind.replace('_', " "),
            thousands(q.count),
            escaped(&q.text)
        );
    }
    out.push_str("</tbody></table></div>\n");
}

fn recording_section(out: &mut String, a: &Analysis) {
    // A header may leave both out.
    let said = |what: &str, text: &str| match text {
        "" => String::new(),
        text => format!(", {what} “{}”", escaped(text)),
    };
    let _ = write!(
        out,
        "<h2 id=\"recording\">Recording</h2>\n<p><code>{}</code>: {}{}{}{}.</p>\n",
        escaped(&a.file),
        several(a.messages, "message"),
        said("profile", &a.profile),
        said("written by", &a.library),
        if a.salvaged {
            "; its summary is missing or wrong, it was searched from end to end"
        } else {
            ""
        }
    );
    out.push_str("<div class=\"scroll\"><table class=\"topics\"><thead><tr><th>topic</th><th>schema</th><th>encoding</th><th class=\"n\">messages</th><th class=\"n\">Hz</th></tr></thead><tbody>\n");
    for t in a.topics.iter().take(MOST_TOPICS) {
        let _ = writeln!(
            out,
            "<tr><td><code>{}</code></td><td>{}</td><td>{}</td><td class=\"n\">{}</td><td class=\"n\">{}</td></tr>",
            escaped(&t.name),
            escaped(&t.schema),
            escaped(&t.encoding),
            thousands(t.messages),
            t.hz.map_or("–".into(), figures)
        );
    }
    out.push_str("</tbody></table></div>\n");
    out.push_str(&first(a.topics.len(), MOST_TOPICS));
    if !a.roles.is_empty() {
        out.push_str("<p>Who plays which role:</p>\n<div class=\"scroll\"><table><tbody>\n");
        for (role, players) in &a.roles {
            let _ = writeln!(
                out,
                "<tr><td>{}</td><td><code>{}</code></td></tr>",
                role.replace('_', " "),
                escaped(&players.join(", "))
            );
        }
        out.push_str("</tbody></table></div>\n");
    }
    if !a.metadata.is_empty() {
        out.push_str("<details><summary>Metadata</summary><div class=\"scroll\"><table><tbody>\n");
        for (key, value) in &a.metadata {
            let _ = writeln!(
                out,
                "<tr><td>{}</td><td>{}</td></tr>",
                escaped(key),
                escaped(value)
            );
        }
        out.push_str("</tbody></table></div></details>\n");
    }
}

fn signals_section(out: &mut String, a: &Analysis) {
    if a.signals.is_empty() {
        return;
    }
    let _ = write!(
        out,
        "<h2 id=\"signals\">Signals</h2>\n<details><summary>{}</summary>{}<div class=\"scroll\"><table><thead><tr><th>signal</th><th>unit</th><th class=\"n\">count</th><th class=\"n\">Hz</th><th class=\"n\">min</th><th class=\"n\">mean</th><th class=\"n\">max</th><th class=\"n\">SD</th><th class=\"n\">peak, Hz</th></tr></thead><tbody>\n",
        several(a.signals.len() as u64, "numeric signal"),
        first(a.signals.len(), MOST_SIGNALS)
    );
    for (path, s) in a.signals.iter().take(MOST_SIGNALS) {
        let cell =
            |x: Option<f64>| format!("<td class=\"n\">{}</td>", x.map_or("–".into(), figures));
        let _ = writeln!(
            out,
            "<tr><td><code>{}</code></td><td>{}</td><td class=\"n\">{}</td>{}{}{}{}{}{}</tr>",
            escaped(path),
            escaped(&s.unit),
            thousands(s.count),
            cell(s.hz),
            cell(s.min),
            cell(s.mean),
            cell(s.max),
            cell(s.sd),
            cell(s.peak_hz)
        );
    }
    out.push_str("</tbody></table></div></details>\n");
}

/// Curves over time that together have more points than the page may hold become coarser, the finest first: each keeps its extremes.
fn share(plots: &mut [Plot]) {
    let panels = plots.iter_mut().filter_map(|plot| match plot {
        Plot::Panel(p) if p.time => Some(p),
        _ => None,
    });
    let mut curves: Vec<&mut Series> = panels.flat_map(|p| &mut p.series).collect();
    curves.sort_by_key(|s| s.x.len());
    let (mut left, mut to_go) = (MOST_POINTS, curves.len());
    for curve in curves {
        let most = left / to_go;
        if curve.x.len() > most {
            let per = (2 * curve.x.len()).div_ceil(most.max(1));
            let (x, y) = (std::mem::take(&mut curve.x), std::mem::take(&mut curve.y));
            let mut from = 0;
            for part in y.split_inclusive(|y| y.is_nan()) {
                let to = from + part.len();
                let (t_s, values) = outline_of(&x[from..to], part, per);
                curve.x.extend(t_s);
                curve.y.extend(values);
                // The break is kept; it is no value of the outline.
                if part.last().is_some_and(|y| y.is_nan()) {
                    curve.x.push(x[to - 1]);
                    curve.y.push(f64::NAN);
                }
                from = to;
            }
        }
        left = left.saturating_sub(curve.x.len());
        to_go -= 1;
    }
}

/// What the script draws.
fn data(plots: &[Plot]) -> Value {
    let all: Vec<Value> = plots
        .iter()
        .map(|plot| match plot {
            Plot::Panel(p) => panel(p),
            Plot::Image(i) => image(i),
        })
        .collect();
    json!({ "colours": COLOURS.len(), "map": MAP, "plots": all })
}

fn panel(p: &Panel) -> Value {
    let series: Vec<Value> = p
        .series
        .iter()
        .map(|s| json!({ "name": s.name, "x": rounded(&s.x, 6), "y": rounded(&s.y, digits(&s.y)), "colour": s.colour }))
        .collect();
    json!({
        "id": p.id, "x_label": p.x_label, "y_label": p.y_label, "series": series, "levels": p.levels, "marks": p.marks,
        "band": p.band, "window": p.window, "log_y": p.log_y, "x_range": p.x_range, "points": p.points, "time": p.time,
    })
}

fn image(i: &Image) -> Value {
    let all = i.values.iter().flatten().copied();
    let high = all.fold(f64::NEG_INFINITY, f64::max);
    let values: Vec<Value> = i.values.iter().map(|row| rounded(row, 3)).collect();
    json!({
        "id": i.id, "x_label": "time, s", "y_label": i.y_label, "series": [], "levels": [], "marks": [], "band": null, "window": null,
        "log_y": false, "x_range": i.x_range, "full": i.x_range, "y_range": i.y_range, "points": false, "time": true, "image": values,
        "value_range": [high - 60.0, high], "value_label": i.value_label,
    })
}

/// Significant digits that show a ten-thousandth of what a curve spans, wherever it lies: a height above the sea, a pressure.
fn digits(y: &[f64]) -> usize {
    let finite = || y.iter().copied().filter(|y| y.is_finite());
    let (low, high) = finite().fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), y| {
        (a.min(y), b.max(y))
    });
    let beside = low.abs().max(high.abs()) / (high - low);
    // OK because the logarithm of a double is below 400.
    match beside.is_finite() {
        true => 5 + beside.log10().ceil().clamp(0.0, 12.0) as usize,
        false => 5,
    }
}

/// Numbers with so many significant digits: what a screen can show, in a third of the bytes.
fn rounded(x: &[f64], digits: usize) -> Value {
    let round = |x: &f64| {
        let text = format!("{x:.*e}", digits - 1);
        text.parse::<f64>()
            .ok()
            .filter(|x| x.is_finite())
            .map_or(Value::Null, |x| {
                if x == x.trunc() && x.abs() < 1e15 {
                    json!(x as i64)
                } else {
                    json!(x)
                }
            })
    };
    Value::Array(x.iter().map(round).collect())
}

/// Text that is safe between tags and in attributes.
pub(super) fn escaped(text: &str) -> String {
    plain(text)
        .replace('&', "&amp;")
        .replace('<', "&lt;")
        .replace('>', "&gt;")
        .replace('"', "&quot;")
}

/// The same, with what stands between backticks as code.
fn with_code(text: &str) -> String {
    let mut out = String::new();
    for (k, part) in text.split('`').enumerate() {
        let part = escaped(part);
        match k % 2 {
            0 => out += &part,
            _ => out += &format!("<code>{part}</code>"),
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tiles_show_three_digits() {
        for (x, shown) in [
            (19.195, "19.2"),
            (0.25, "0.250"),
            (19.0, "19.0"),
            (-0.00098765, "-0.000988"),
            (3.3307e-16, "3.33e-16"),
            (1819.4, "1819"),
            (0.0, "0"),
        ] {
            assert_eq!(coarse(x), shown);
        }
    }

    /// Forty long curves, one of them with a hole and a spike, and a short one.
    #[test]
    fn curves_share_the_page() {
        let curve = |points: u32| Series {
            x: (0..points).map(|k| f64::from(k) / 1.7).collect(),
            y: (0..points).map(|k| f64::from(k).sin()).collect(),
            ..Series::default()
        };
        let mut series = vec![curve(8000); 40];
        (series[7].y[4000], series[7].y[5001]) = (f64::NAN, 9.0);
        series.push(curve(50));
        let mut p = Panel::new("signals", "", "", "");
        (p.series, p.time) = (series, true);
        let mut plots = vec![Plot::Panel(p)];
        share(&mut plots);
        let length = data(&plots).to_string().len();
        assert!(length < 2_200_000, "{length}");
        let [Plot::Panel(p)] = &plots[..] else {
            unreachable!()
        };
        let points: usize = p.series.iter().map(|s| s.x.len()).sum();
        assert!((90_000..=MOST_POINTS).contains(&points), "{points}");
        assert_eq!(p.series[40].x.len(), 50);
        let broken = &p.series[7];
        assert!(broken.y.contains(&9.0) && broken.x.is_sorted());
        assert_eq!(broken.y.iter().filter(|y| y.is_nan()).count(), 1);
    }

    #[test]
    fn backticks_become_code() {
        assert_eq!(with_code("`per` <i>"), "<code>per</code> &lt;i&gt;");
    }

    #[test]
    fn names_cannot_become_markup() {
        assert_eq!(escaped("<script>\"&"), "&lt;script&gt;&quot;&amp;");
        assert_eq!(escaped("/a\u{1}\u{1b}[2J"), "/a\u{fffd}\u{fffd}[2J");
        assert!(!data(&[]).to_string().contains('<'));
    }

    #[test]
    fn numbers_are_rounded_to_what_is_shown() {
        assert_eq!(
            rounded(&[0.123456789, 15.015, 3.0, f64::NAN], 5).to_string(),
            "[0.12346,15.015,3,null]"
        );
    }
}
