//! Prediction 5: onset times broaden near critical parameters.

use super::{Finding, Lab, Verdict, measure, number, row, scene, spearman, template};
use crate::draw::{Figure, Layer};
use crate::sweep::summary::{Spread, quantile};

/// How much more seeds than other ensembles: a spread needs them.
const MORE: u64 = 4;
const DURATION_S: f64 = 120.0;

/// Between the quartiles of sorted times; NaN of three and fewer.
fn width(times: &[f64]) -> f64 {
    match times.len() {
        0..=3 => f64::NAN,
        _ => quantile(times, 0.75) - quantile(times, 0.25),
    }
}

/// The amplitude at which half of the runs rock, of amplitudes with the shares that do: straight between neighbours.
fn critical(shares: &[(f64, f64)]) -> f64 {
    let mut pairs = shares.windows(2);
    let crossed = pairs.find(|w| w[0].1 < 0.5 && w[1].1 >= 0.5);
    crossed.map_or(f64::NAN, |w| {
        let part = (0.5 - w[0].1) / (w[1].1 - w[0].1);
        w[0].0 + part * (w[1].0 - w[0].0)
    })
}

/// Does it.
pub fn run(lab: &Lab) -> Result<Finding, String> {
    let settings = [
        "effects.music.onset_s=0.0",
        "effects.music.build_up_s=0.0",
        "effects.lift=false",
        "analysis_start_s=0.0",
    ];
    let duration = format!("duration_s={DURATION_S:?}");
    let noisy = template("music", &[&settings[..], &[&duration]].concat())?;
    let calm = template(
        "music",
        &[
            &settings[..],
            &[
                &duration,
                "effects.noise=false",
                "effects.frequency_spread=false",
                "carriers.initial_phase_sd_rad=0.0",
            ],
        ]
        .concat(),
    )?;
    let lab = Lab {
        seeds: MORE * lab.seeds,
        ..*lab
    };
    let seeds = lab.seeds as usize;
    let amplitudes = row(0.056, 0.092, 19);
    let runs = lab.with_seeds(&amplitudes);
    let names = ["onset_time_s"];
    let key = "effects.gait.amplitude_m";
    let found = lab.map(&runs, |(a, seed)| {
        measure(&scene(&noisy, &[(key, *a)], *seed)?, names)
    })?;
    let alone = lab.map(&amplitudes, |a| {
        measure(&scene(&calm, &[(key, *a)], 1001)?, names)
    })?;
    struct Step {
        amplitude_mm: f64,
        share: f64,
        spread: Option<Spread>,
        iqr: f64,
    }
    let steps: Vec<Step> = found
        .chunks(seeds)
        .zip(&amplitudes)
        .map(|(runs, a)| {
            let mut times: Vec<f64> = runs
                .iter()
                .map(|r| r[0])
                .filter(|t| t.is_finite())
                .collect();
            times.sort_by(f64::total_cmp);
            Step {
                amplitude_mm: 1e3 * a,
                share: times.len() as f64 / seeds as f64,
                iqr: width(&times),
                spread: Spread::of(&times),
            }
        })
        .collect();
    let shares: Vec<(f64, f64)> = steps.iter().map(|s| (s.amplitude_mm, s.share)).collect();
    let critical = critical(&shares);
    // Only where nearly all have rocked is the spread that of onsets, not of the end of the run.
    let whole: Vec<&Step> = steps.iter().filter(|s| s.share > 0.95).collect();
    let (x, iqr): (Vec<f64>, Vec<f64>) = whole.iter().map(|s| (s.amplitude_mm, s.iqr)).unzip();
    let middle: Vec<f64> = whole
        .iter()
        .filter_map(|s| s.spread.map(|s| s.quantiles[1]))
        .collect();
    let relative: Vec<f64> = iqr.iter().zip(&middle).map(|(i, m)| i / m).collect();
    let (rank, rank_relative) = (spearman(&x, &iqr), spearman(&x, &relative));
    let near = iqr.first().copied().unwrap_or(f64::NAN);
    let far = iqr.last().copied().unwrap_or(f64::NAN);
    let verdict = match (rank < -0.5, near > 2.0 * far) {
        (true, true) => Verdict::Supported,
        (true, false) => Verdict::Depends,
        _ => Verdict::NotSupported,
    };
    let curve = |of: &dyn Fn(&Spread) -> f64| -> Vec<(f64, f64)> {
        steps
            .iter()
            .filter_map(|s| Some((s.amplitude_mm, of(s.spread.as_ref()?))))
            .collect()
    };
    let band: Vec<(f64, f64, f64)> = steps
        .iter()
        .filter_map(|s| {
            s.spread
                .map(|q| (s.amplitude_mm, q.quantiles[0], q.quantiles[2]))
        })
        .collect();
    let calm_curve: Vec<(f64, f64)> = amplitudes
        .iter()
        .zip(&alone)
        .filter(|(_, t)| t[0].is_finite())
        .map(|(a, t)| (1e3 * a, t[0]))
        .collect();
    let latest_s = band.iter().map(|b| b.2).fold(0.0, f64::max);
    Ok(Finding {
        title: "5. Onset statistics",
        claim: "The distribution of onset times should broaden near critical parameter values, consistent with noise-induced switching in a nonlinear system.",
        experiment: format!(
            "The music scene with music from the start on, amplitude of the shoulders in {} steps through the threshold of rocking, {seeds} seeds at each, {DURATION_S} s a run; and once at each \
             amplitude with nothing random at all. Critical is the amplitude at which half of the runs rock within that time. Spreads are compared where more than 95 % of the runs rocked.",
            amplitudes.len()
        ),
        verdict: Some(verdict),
        because: format!(
            "The quartiles of the onset lie {near:.1} s apart nearest the threshold and {far:.1} s far from it (rank correlation of that width with amplitude {rank:.2}); as a share of the median onset the width has rank correlation {rank_relative:.2}."
        ),
        numbers: vec![
            number("critical_mm", "critical amplitude", critical, "mm", 1),
            number(
                "steps",
                "amplitudes at which more than 95 % rock",
                whole.len() as f64,
                "",
                0,
            ),
            number(
                "iqr_near",
                "width between quartiles, nearest the threshold",
                near,
                "s",
                2,
            ),
            number("iqr_far", "width between quartiles, farthest", far, "s", 2),
            number(
                "median_near",
                "median onset, nearest",
                middle.first().copied().unwrap_or(f64::NAN),
                "s",
                1,
            ),
            number(
                "median_far",
                "median onset, farthest",
                middle.last().copied().unwrap_or(f64::NAN),
                "s",
                1,
            ),
            number(
                "rank",
                "rank correlation of width and amplitude",
                rank,
                "",
                2,
            ),
            number(
                "rank_relative",
                "rank correlation of width over median and amplitude",
                rank_relative,
                "",
                2,
            ),
        ],
        pictures: vec![
            (
                "onsets",
                format!(
                    "Onset times of those of {seeds} seeds that rock within two minutes (how many: the next picture): median and the band of 90 % of them; vermilion: the same scene with nothing random; broken: the critical amplitude."
                ),
                Figure {
                    title: "Onset times through the threshold".into(),
                    x_label: "amplitude of the shoulders, mm".into(),
                    y_label: "onset, s".into(),
                    layers: vec![
                        Layer::Band {
                            points: band,
                            colour: 0,
                        },
                        Layer::line("median", curve(&|s| s.quantiles[1]), 0),
                        Layer::line("not random", calm_curve, 1),
                        Layer::dashed("", vec![(critical, 0.0), (critical, DURATION_S)], 6),
                    ],
                    x_range: Some((1e3 * amplitudes[0], 1e3 * amplitudes[amplitudes.len() - 1])),
                    y_range: Some((0.0, 1.05 * latest_s)),
                    ..Figure::default()
                },
            ),
            (
                "onsets-share",
                "Share of runs that rock within two minutes.".into(),
                Figure {
                    title: "How many rock".into(),
                    x_label: "amplitude of the shoulders, mm".into(),
                    y_label: "share of runs".into(),
                    layers: vec![Layer::line("", shares, 0)],
                    y_range: Some((0.0, 1.02)),
                    ..Figure::default()
                },
            ),
        ],
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn half_of_the_runs_and_half_of_the_onsets() {
        let shares = [(56.0, 0.0), (58.0, 0.1), (60.0, 0.9), (62.0, 1.0)];
        assert!((critical(&shares) - 59.0).abs() < 1e-12);
        assert!((critical(&[(1.0, 0.2), (2.0, 0.6)]) - 1.75).abs() < 1e-12);
        assert!(critical(&shares[2..]).is_nan());
        // scipy.stats.iqr([1, 2, 4, 7, 11, 30]) of SciPy 1.17.1
        assert_eq!(width(&[1.0, 2.0, 4.0, 7.0, 11.0, 30.0]), 7.5);
        assert!(width(&[1.0, 2.0, 4.0]).is_nan());
    }
}
