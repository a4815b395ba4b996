//! `--report`: one page that needs nothing else: numbers with their definitions, plots to look into, and how it was made.

use std::fmt::Write;

use serde_json::{Value, json};

use super::plots::{COLOURS, Image, Panel, Plot, plots};
use super::table::{figures, thousands};
use crate::examine::Analysis;
use crate::metrics::{self, Datum};

/// Metrics shown large at the top, with what is said beside them.
const TILES: [(&str, &str); 8] = [
    ("mechanism", "what drives the roll"),
    ("rms_roll_deg", "RMS roll, deg"),
    ("contact_loss_mean", "contact loss, mean"),
    ("synchrony", "synchrony"),
    ("onset_time_s", "onset, s"),
    ("dz_pp_m", "height, peak to peak, m"),
    ("t_float", "unloaded time, T_float"),
    ("peak_hz", "strongest line, Hz"),
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

/// The page for one recording. `command` is the command line that makes it again.
pub fn html(a: &Analysis, command: &str) -> String {
    let plots = plots(a);
    let mut out = String::with_capacity(1 << 20);
    let title = std::path::Path::new(&a.file)
        .file_name()
        .and_then(|n| n.to_str())
        .unwrap_or(&a.file);
    let _ = write!(
        out,
        "<!doctype html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n<meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n\
         <title>{}</title>\n<link rel=\"icon\" href=\"data:,\">\n<style>\n{}</style>\n</head>\n<body>\n",
        escaped(title),
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

fn head(out: &mut String, a: &Analysis, title: &str) {
    let _ = write!(
        out,
        "<header>\n<h1>{}</h1>\n<p class=\"faint\">",
        escaped(title)
    );
    let _ = write!(
        out,
        "{:.3} s, {} samples; analysed from {:.3} to {:.3} s",
        a.duration_s,
        thousands(a.samples),
        a.window.start_s,
        a.window.end_s
    );
    for key in ["scene", "seed", "source", "method"] {
        if let Some((_, value)) = a.metadata.iter().find(|(k, _)| k == key) {
            let _ = write!(out, " · {key} {}", escaped(value));
        }
    }
    out.push_str("</p>\n");
    for warning in &a.warnings {
        let _ = writeln!(out, "<p class=\"warn\">{}</p>", escaped(warning));
    }
    if a.skipped_messages > 0 {
        let _ = writeln!(
            out,
            "<p class=\"warn\">{} messages are lost.</p>",
            thousands(a.skipped_messages)
        );
    }
    out.push_str("</header>\n");
}

fn shown(datum: &Datum) -> String {
    match datum {
        Datum::Number(x) => figures(*x),
        Datum::Bool(x) => (if *x { "yes" } else { "no" }).into(),
        Datum::Word(x) => (*x).into(),
        Datum::Missing => "–".into(),
    }
}

fn tiles(out: &mut String, a: &Analysis) {
    let known: Vec<_> = TILES
        .iter()
        .filter_map(|(name, label)| Some((*name, label, a.metrics.get(name)?)))
        .filter(|(_, _, v)| v.datum != Datum::Missing)
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
            let _ = write!(beside, " ({} … {})", figures(low), figures(high));
        }
        if let Some(chance) = chance {
            let _ = write!(beside, ", {} by chance", figures(chance));
        }
        let _ = writeln!(
            out,
            "<div class=\"tile\"><b>{}</b><span>{label}{beside}</span></div>",
            shown(&value.datum)
        );
    }
    out.push_str("</div>\n");
}

fn figures_section(out: &mut String, plots: &[Plot]) {
    if plots.is_empty() {
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
    out.push_str("<h2 id=\"metrics\">Metrics</h2>\n<div class=\"scroll\"><table class=\"metrics\"><thead><tr><th>metric</th><th class=\"n\">value</th><th>unit</th><th>from</th></tr></thead><tbody>\n");
    for (name, value) in a.metrics.iter() {
        let Some(metric) = metrics::find(name) else {
            continue;
        };
        let unit = if matches!(value.unit, "1" | "bool" | "-") {
            ""
        } else {
            value.unit
        };
        let mut more = format!(
            "<p>{}</p><p class=\"faint\">Definition from: {}. Name: <code>{name}</code>.</p>",
            with_code(metric.definition),
            escaped(metric.origin)
        );
        if let Some(reason) = &value.reason {
            let _ = write!(more, "<p>{}</p>", escaped(reason));
        }
        if !value.per.is_empty() {
            let per: Vec<String> = value.per.iter().take(64).map(|x| figures(*x)).collect();
            let _ = write!(more, "<p class=\"faint\">In detail: {}</p>", per.join(", "));
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
            escaped(metric.label),
            shown(&value.datum),
            escaped(&value.source)
        );
    }
    out.push_str("</tbody></table></div>\n");
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
    let _ = write!(
        out,
        "<h2 id=\"events\">Events</h2>\n<details{}><summary>{} events</summary>\n<div class=\"scroll\"><table><thead><tr><th class=\"n\">time, s</th><th>kind</th><th>what</th></tr></thead><tbody>\n",
        if a.events.len() <= 20 { " open" } else { "" },
        thousands(a.events.len() as u64)
    );
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
    if a.events.len() > MOST_EVENTS {
        let _ = writeln!(
            out,
            "<p class=\"faint\">The first {MOST_EVENTS} are listed.</p>"
        );
    }
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
    let _ = write!(
        out,
        "<h2 id=\"recording\">Recording</h2>\n<p><code>{}</code>: {} messages, profile “{}”, written by “{}”{}.</p>\n",
        escaped(&a.file),
        thousands(a.messages),
        escaped(&a.profile),
        escaped(&a.library),
        if a.salvaged {
            "; its summary is missing or wrong, it was searched from end to end"
        } else {
            ""
        }
    );
    out.push_str("<div class=\"scroll\"><table class=\"topics\"><thead><tr><th>topic</th><th>schema</th><th>encoding</th><th class=\"n\">messages</th><th class=\"n\">Hz</th></tr></thead><tbody>\n");
    for t in a.topics.iter().take(500) {
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
        "<h2 id=\"signals\">Signals</h2>\n<details><summary>{} numeric signals</summary><div class=\"scroll\"><table><thead><tr><th>signal</th><th>unit</th><th class=\"n\">count</th><th class=\"n\">Hz</th><th class=\"n\">min</th><th class=\"n\">mean</th><th class=\"n\">max</th><th class=\"n\">SD</th><th class=\"n\">peak, Hz</th></tr></thead><tbody>\n",
        a.signals.len()
    );
    for (path, s) in a.signals.iter().take(2000) {
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

/// What the script draws.
fn data(plots: &[Plot]) -> Value {
    let all: Vec<Value> = plots
        .iter()
        .map(|plot| match plot {
            Plot::Panel(p) => panel(p),
            Plot::Image(i) => image(i),
        })
        .collect();
    json!({ "colours": COLOURS, "map": MAP, "plots": all })
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
fn escaped(text: &str) -> String {
    text.replace('&', "&amp;")
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
    fn backticks_become_code() {
        assert_eq!(with_code("`per` <i>"), "<code>per</code> &lt;i&gt;");
    }

    #[test]
    fn names_cannot_become_markup() {
        assert_eq!(escaped("<script>\"&"), "&lt;script&gt;&quot;&amp;");
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
