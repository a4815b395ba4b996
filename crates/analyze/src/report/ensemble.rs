//! Several recordings side by side: a line per file, then mean and spread of every metric.

use std::f64::consts::TAU;
use std::fmt::Write;

use super::table::figures;
use crate::examine::Analysis;
use crate::metrics::{METRICS, turn_of, with_unit};
use crate::phase::circular;

/// The columns of the line per file.
const COLUMNS: [(&str, &str); 7] = [
    ("rms_roll_deg", "RMS roll"),
    ("contact_loss_mean", "loss"),
    ("synchrony", "synchr."),
    ("onset_time_s", "onset s"),
    ("dz_pp_m", "dz_pp m"),
    ("t_float", "T_float"),
    ("peak_hz", "peak Hz"),
];

/// Several recordings as text.
pub fn ensemble(analyses: &[Analysis]) -> String {
    let mut out = String::new();
    let _ = write!(out, "{:<34}", "file");
    for (_, label) in COLUMNS {
        let _ = write!(out, " {label:>8}");
    }
    out.push_str("  mechanism\n");
    for a in analyses {
        let _ = write!(out, "{:<34}", super::table::shortened(&a.file, 34));
        for (name, _) in COLUMNS {
            let cell = a.metrics.number(name).map_or("–".to_owned(), eight);
            let _ = write!(out, " {cell:>8}");
        }
        let word = a
            .metrics
            .get("mechanism")
            .and_then(|v| v.as_word())
            .unwrap_or("–");
        let _ = writeln!(out, "  {word}");
    }
    let _ = writeln!(
        out,
        "\n{:<32} {:>10} {:>10} {:>10} {:>10} {:>5}  name",
        "metric", "mean", "SD", "min", "max", "n"
    );
    for metric in METRICS {
        let mut x: Vec<f64> = analyses
            .iter()
            .filter_map(|a| a.metrics.number(metric.name))
            .collect();
        if x.is_empty() {
            let yes: Vec<bool> = analyses
                .iter()
                .filter_map(|a| a.metrics.get(metric.name)?.as_bool())
                .collect();
            if !yes.is_empty() {
                let count = yes.iter().filter(|y| **y).count();
                let share = format!("{count} of {}", yes.len());
                let _ = writeln!(
                    out,
                    "{:<32} {share:>10} {:>10} {:>10} {:>10} {:>5}  {}",
                    metric.label,
                    "",
                    "",
                    "",
                    yes.len(),
                    metric.name
                );
            }
            continue;
        }
        // A direction is taken on that turn on which it is nearest to their mean.
        if let Some(turn) = turn_of(metric.name) {
            let middle = circular(x.iter().map(|x| x / turn * TAU));
            let middle = middle.map_or(0.0, |c| c.mean_rad / TAU * turn);
            x.iter_mut()
                .for_each(|x| *x -= turn * ((*x - middle) / turn).round());
        }
        x.sort_by(f64::total_cmp);
        let n = x.len() as f64;
        let mean = x.iter().sum::<f64>() / n;
        // The sample's standard deviation: these files stand for others like them.
        let sd = if x.len() > 1 {
            let squares = x.iter().map(|x| (x - mean).powi(2)).sum::<f64>();
            figures((squares / (n - 1.0)).sqrt())
        } else {
            "–".into()
        };
        let label = with_unit(metric.label, metric.unit);
        let _ = writeln!(
            out,
            "{label:<32} {:>10} {:>10} {:>10} {:>10} {:>5}  {}",
            figures(mean),
            sd,
            figures(x[0]),
            figures(x[x.len() - 1]),
            x.len(),
            metric.name
        );
    }
    out
}

fn eight(x: f64) -> String {
    let text = figures(x);
    let scientific = format!("{x:.2e}");
    match text.contains('e') {
        true if scientific.len() <= 8 => scientific,
        true => format!("{x:.1e}"),
        false if text.len() <= 7 => text,
        false => {
            let whole = text.find('.').unwrap_or(text.len());
            format!("{x:.*}", 6usize.saturating_sub(whole))
        }
    }
}
