//! Plots of many recordings together: how metrics are distributed, and the mean spectrum with its spread, by condition.

use super::plots::{COLOURS, Panel, Plot, Series};
use crate::examine::Analysis;
use crate::metrics;

/// Metrics whose distributions are drawn: those of the paper's ensemble figure, and Δz_pp and T_float.
const DISTRIBUTIONS: [(&str, &str); 6] = [
    ("rms_roll_deg", "distribution_rms_roll"),
    ("contact_loss_mean", "distribution_contact_loss"),
    ("synchrony", "distribution_synchrony"),
    ("onset_time_s", "distribution_onset"),
    ("dz_pp_m", "distribution_dz_pp"),
    ("t_float", "distribution_t_float"),
];

/// The condition a recording belongs to: its scene, else its folder.
fn condition(a: &Analysis) -> String {
    let scene = a
        .metadata
        .iter()
        .find(|(k, _)| k == "scene")
        .or_else(|| a.metadata.iter().find(|(k, _)| k == "condition"));
    let folder = || {
        std::path::Path::new(&a.file)
            .parent()
            .and_then(|p| p.file_name())
            .and_then(|n| n.to_str())
            .unwrap_or("all")
            .to_owned()
    };
    scene.map_or_else(folder, |(_, v)| v.clone())
}

/// Recordings by condition, in the order of first sight.
fn groups(analyses: &[Analysis]) -> Vec<(String, Vec<&Analysis>)> {
    let mut groups: Vec<(String, Vec<&Analysis>)> = Vec::new();
    for a in analyses {
        let name = condition(a);
        match groups.iter_mut().find(|(n, _)| *n == name) {
            Some((_, members)) => members.push(a),
            None => groups.push((name, vec![a])),
        }
    }
    groups
}

/// Everything that can be drawn of several recordings.
pub fn ensemble_plots(analyses: &[Analysis]) -> Vec<Plot> {
    let groups = groups(analyses);
    let mut out: Vec<Plot> = Vec::new();
    for (name, id) in DISTRIBUTIONS {
        out.extend(distribution(&groups, name, id).map(Plot::Panel));
    }
    for (role, id, title) in [
        ("roll", "mean_psd_roll", "Mean spectrum of the roll"),
        ("height", "mean_psd_height", "Mean spectrum of the height"),
    ] {
        out.extend(mean_psd(&groups, role, id, title).map(Plot::Panel));
    }
    out
}

/// Shares of runs up to each value, one staircase per condition.
fn distribution(
    groups: &[(String, Vec<&Analysis>)],
    name: &str,
    id: &'static str,
) -> Option<Panel> {
    let metric = metrics::find(name)?;
    let label = metrics::with_unit(metric.label, metric.unit);
    let mut p = Panel::new(
        id,
        &format!("Distribution: {}", metric.label),
        &label,
        "share of runs up to the value",
    );
    let mut without = Vec::new();
    for (k, (group, members)) in groups.iter().enumerate() {
        let mut values: Vec<f64> = members
            .iter()
            .filter_map(|a| a.metrics.number(name))
            .collect();
        if values.is_empty() {
            without.push(group.as_str());
            continue;
        }
        values.sort_by(f64::total_cmp);
        let n = values.len() as f64;
        let (mut x, mut y) = (vec![values[0]], vec![0.0]);
        for (i, v) in values.iter().enumerate() {
            x.extend([*v, *v]);
            y.extend([i as f64 / n, (i + 1) as f64 / n]);
        }
        p.series.push(Series {
            name: format!("{group} ({})", values.len()),
            x,
            y,
            colour: k % COLOURS.len(),
            ..Series::default()
        });
    }
    let drawn: Vec<&str> = p.series.iter().map(|s| s.name.as_str()).collect();
    p.title += &partly(&drawn, &without);
    p.note = "Each step is one run.".into();
    let all = p.series.iter().flat_map(|s| s.x.iter().copied());
    let (low, high) = all.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), x| {
        (l.min(x), h.max(x))
    });
    let room = 0.05 * (high - low);
    p.x_range = (room > 0.0).then_some((low - room, high + room));
    (!p.series.is_empty()).then_some(p)
}

/// Who is drawn and who has nothing to draw, behind a title; nothing where all are drawn.
fn partly(drawn: &[&str], without: &[&str]) -> String {
    match without {
        [] => String::new(),
        without => format!(", {}; none in {}", drawn.join(", "), without.join(", ")),
    }
}

/// Mean of the runs' densities and their standard deviation, both in decibels: densities differ by factors.
fn mean_psd(
    groups: &[(String, Vec<&Analysis>)],
    role: &str,
    id: &'static str,
    title: &str,
) -> Option<Panel> {
    let mut p: Option<Panel> = None;
    for (k, (group, members)) in groups.iter().enumerate() {
        let spectra: Vec<_> = members
            .iter()
            .filter_map(|a| super::plots::role_spectrum(a, role))
            .map(|(_, s)| s)
            .collect();
        let Some(first) = spectra.first() else {
            continue;
        };
        let same: Vec<_> = spectra
            .iter()
            .filter(|s| s.spectrum.hz == first.spectrum.hz)
            .collect();
        let n = same.len() as f64;
        let (label, scale) = super::plots::density(first);
        let panel = p.get_or_insert_with(|| {
            let mut panel = Panel::new(id, title, "frequency, Hz", &label);
            panel.log_y = true;
            panel.note = "Mean in decibels over the runs of each condition; shaded: one standard deviation above and below.".into();
            let nyquist = first.spectrum.hz.last().copied().unwrap_or(1.0);
            panel.x_range = Some((0.0, first.f_hz.map_or(nyquist, |f| (4.0 * f).min(nyquist))));
            panel
        });
        let reach = panel.x_range.map_or(f64::INFINITY, |r| r.1);
        let bins = (1..first.spectrum.hz.len()).filter(|b| first.spectrum.hz[*b] <= reach);
        let rows: Vec<(f64, f64, f64)> = bins
            .map(|b| {
                let db = same
                    .iter()
                    .map(|s| 10.0 * (scale * s.spectrum.power[b]).log10());
                let mean = db.clone().sum::<f64>() / n;
                let variance = db.map(|x| (x - mean).powi(2)).sum::<f64>() / (n - 1.0).max(1.0);
                (first.spectrum.hz[b], mean, variance.sqrt())
            })
            .collect();
        let mut line = Series {
            name: format!("{group} ({})", same.len()),
            colour: k % COLOURS.len(),
            ..Series::default()
        };
        let density = |db: f64| 10f64.powf(0.1 * db);
        for (hz, mean, sd) in rows.into_iter().filter(|(_, mean, _)| mean.is_finite()) {
            line.x.push(hz);
            line.y.push(density(mean));
            if same.len() > 1 {
                line.spread.push((density(mean - sd), density(mean + sd)));
            }
        }
        panel.series.push(line);
    }
    p
}

#[cfg(test)]
mod tests {
    #[test]
    fn a_condition_without_values_is_named() {
        assert_eq!(super::partly(&["baseline (4)", "music (4)"], &[]), "");
        assert_eq!(
            super::partly(&["music (4)"], &["baseline"]),
            ", music (4); none in baseline"
        );
    }
}
