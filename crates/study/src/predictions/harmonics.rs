//! Prediction 4: contact loss shows in harmonics.

use super::{Finding, Lab, Verdict, columns, mean, number, row, scene, spearman, template};
use crate::draw::{Figure, Layer};
use sim::run::Sample;
use sim::scene::Scene;
use std::f64::consts::TAU;

/// Names of what is measured in a run.
const LINES: [&str; 6] = [
    "contact loss",
    "force, 2f over f",
    "height, 2f over f",
    "roll, 2f over f",
    "roll, f/2 over f",
    "roll, 3f/2 over f/2",
];

/// Magnitude of a signal's line at `hz`: a Hann taper keeps neighbours out. Twice the mean of taper × signal × e^{−iωt} over that of the taper.
fn line(t_s: &[f64], x: &[f64], hz: f64) -> f64 {
    let middle = mean(x.iter().copied());
    let n = x.len() as f64;
    let (mut re, mut im, mut sum) = (0.0, 0.0, 0.0);
    for (k, (t, x)) in t_s.iter().zip(x).enumerate() {
        let taper = 0.5 - 0.5 * (TAU * (k as f64 + 0.5) / n).cos();
        let (s, c) = (TAU * hz * t).sin_cos();
        re += taper * (x - middle) * c;
        im += taper * (x - middle) * s;
        sum += taper;
    }
    2.0 * re.hypot(im) / sum
}

/// The lines of a run, in the order of [`LINES`].
fn signature(scene: &Scene, hz: f64) -> Result<[f64; 6], String> {
    let i = columns(scene, &mut |_: &Sample| true)?;
    let from = i.t_s.partition_point(|t| *t < scene.analysis_start_s);
    let (t, z, roll) = (&i.t_s[from..], &i.height_m[from..], &i.roll_rad[from..]);
    let total = &i.total_force_n()[from..];
    let slack = mean(
        i.normal_n
            .iter()
            .map(|n| mean(n[from..].iter().map(|x| f64::from(*x <= 0.0)))),
    );
    let at = |x: &[f64], part: f64| line(t, x, part * hz);
    Ok([
        slack,
        at(total, 2.0) / at(total, 1.0),
        at(z, 2.0) / at(z, 1.0),
        at(roll, 2.0) / at(roll, 1.0),
        at(roll, 0.5) / at(roll, 1.0),
        at(roll, 1.5) / at(roll, 0.5),
    ])
}

/// Does it.
pub fn run(lab: &Lab) -> Result<Finding, String> {
    let settings = [
        "effects.music.onset_s=0.0",
        "effects.music.build_up_s=0.0",
        "effects.lift=false",
        "analysis_start_s=30.0",
    ];
    let free = template("music", &settings)?;
    let tied = template(
        "music",
        &[&settings[..], &["effects.contact.bilateral=true"]].concat(),
    )?;
    let beat = scene(&free, &[], 1)?
        .effects
        .music
        .map_or(f64::NAN, |m| m.beat_hz);
    let amplitudes = row(0.02, 0.095, 16);
    let cases: Vec<(bool, f64)> = [false, true]
        .iter()
        .flat_map(|t| amplitudes.iter().map(move |a| (*t, *a)))
        .collect();
    let runs = lab.with_seeds(&cases);
    let found = lab.map(&runs, |((is_tied, amplitude), seed)| {
        let template = if *is_tied { &tied } else { &free };
        signature(
            &scene(template, &[("effects.gait.amplitude_m", *amplitude)], *seed)?,
            beat,
        )
    })?;
    let (uni, bi) = found.split_at(found.len() / 2);
    let rank = |k: usize| {
        let (x, y): (Vec<f64>, Vec<f64>) = uni.iter().map(|r| (r[0], r[k])).unzip();
        spearman(&x, &y)
    };
    let group = |runs: &[[f64; 6]], k: usize, lost: bool| {
        mean(runs.iter().filter(|r| (r[0] > 0.01) == lost).map(|r| r[k]))
    };
    let seeds = lab.seeds as usize;
    let curve = |runs: &[[f64; 6]], k: usize| -> Vec<(f64, f64)> {
        runs.chunks(seeds)
            .zip(&amplitudes)
            .map(|(runs, a)| (1e3 * a, mean(runs.iter().map(|r| r[k].log10()))))
            .collect()
    };
    let loss_begins = uni
        .chunks(seeds)
        .zip(&amplitudes)
        .find(|(runs, _)| mean(runs.iter().map(|r| r[0])) > 0.01)
        .map_or(f64::NAN, |(_, a)| 1e3 * a);
    // What losing contact adds: free over tied at the same amplitude, where contact is lost (geometric mean).
    let added = |k: usize| {
        let pairs = uni.iter().zip(bi).filter(|(u, _)| u[0] > 0.01);
        10f64.powf(mean(pairs.map(|(u, b)| (u[k] / b[k]).log10())))
    };
    let rocking =
        |runs: &[[f64; 6]]| runs.iter().filter(|r| r[4] > 1.0).count() as f64 / runs.len() as f64;
    let verdict = match (added(1) > 2.0 && added(2) > 2.0, added(3) > 2.0) {
        (true, true) => Verdict::Supported,
        (true, false) => Verdict::Depends,
        _ => Verdict::NotSupported,
    };
    let because = format!(
        "Contact loss multiplies the second harmonic of the force by {:.1} and that of the height by {:.1}; that of the roll it multiplies by {:.2}, which is nothing to go by. What stands out in roll is \
         f/2, which parametric pumping makes here (as shoulders that sway at f/2 would, and none of these do), whether contact is lost ({:.0} % of all runs) or handles are tied ({:.0} %): the paper did not name it.",
        added(1),
        added(2),
        added(3),
        100.0 * rocking(uni),
        100.0 * rocking(bi),
    );
    let mut numbers: Vec<_> = (1..6)
        .zip([
            "rank_force",
            "rank_height",
            "rank_roll",
            "rank_half",
            "rank_three_halves",
        ])
        .map(|(k, name)| {
            number(
                name,
                format!("rank correlation with contact loss: {}", LINES[k]),
                rank(k),
                "",
                2,
            )
        })
        .collect();
    for (k, kept, lost) in [
        (1, "force_kept", "force_lost"),
        (2, "height_kept", "height_lost"),
        (3, "roll_kept", "roll_lost"),
        (4, "half_kept", "half_lost"),
    ] {
        numbers.push(number(
            kept,
            format!("{}, contact kept", LINES[k]),
            group(uni, k, false),
            "",
            3,
        ));
        numbers.push(number(
            lost,
            format!("{}, contact lost", LINES[k]),
            group(uni, k, true),
            "",
            3,
        ));
    }
    for (k, name) in [
        (1, "added_force"),
        (2, "added_height"),
        (3, "added_roll"),
        (4, "added_half"),
    ] {
        numbers.push(number(
            name,
            format!("factor by which lost contact multiplies (geometric mean of free over tied, same amplitude and seed): {}", LINES[k]),
            added(k),
            "",
            2,
        ));
    }
    Ok(Finding {
        title: "4. Harmonic signatures",
        claim: "Contact loss and impacts should increase harmonic content (especially a second harmonic) in roll spectra.",
        experiment: format!(
            "Coherent carriers at the paper's beat f = {beat} Hz, amplitude of the shoulders from 20 to 95 mm, {seeds} seeds each, handles free to lift off and tied. Lines are read off at exact \
             multiples of f over the last 30 s with a Hann taper: of the summed force, the height and the roll. 'Lost' is a contact loss above 1 %."
        ),
        verdict: Some(verdict),
        because,
        numbers,
        pictures: vec![(
            "harmonics",
            format!(
                "Ratios of lines against the amplitude of the shoulders (geometric means over the seeds); contact is lost from {loss_begins:.0} mm on (grey). Broken: handles tied."
            ),
            Figure {
                title: "Harmonics and contact loss".into(),
                x_label: "amplitude of the shoulders, mm".into(),
                y_label: "log10 of the ratio".into(),
                layers: vec![
                    Layer::line("force 2f/f", curve(uni, 1), 0),
                    Layer::dashed("tied", curve(bi, 1), 0),
                    Layer::line("height 2f/f", curve(uni, 2), 2),
                    Layer::dashed("tied", curve(bi, 2), 2),
                    Layer::line("roll 2f/f", curve(uni, 3), 4),
                    Layer::line("roll (f/2)/f", curve(uni, 4), 1),
                    Layer::dashed("tied", curve(bi, 4), 1),
                    Layer::dashed("", vec![(loss_begins, -6.0), (loss_begins, 4.0)], 6),
                ],
                y_range: Some((-5.0, 3.5)),
                ..Figure::default()
            },
        )],
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::predictions::measure;

    /// 3 sin 2π2t + 0.5 cos 2π4t about 7, for a minute: whole turns, which a Hann taper keeps apart.
    #[test]
    fn lines_are_as_high_as_the_sines_they_are_of() {
        let t_s: Vec<f64> = (0..1800).map(|k| f64::from(k) / 30.0).collect();
        let wave = |t: &f64| 7.0 + 3.0 * (TAU * 2.0 * t).sin() + 0.5 * (TAU * 4.0 * t).cos();
        let x: Vec<f64> = t_s.iter().map(wave).collect();
        for (hz, height) in [(2.0, 3.0), (4.0, 0.5), (1.0, 0.0), (3.0, 0.0)] {
            let found = line(&t_s, &x, hz);
            assert!((found - height).abs() < 1e-10, "{hz} Hz: {found}");
        }
        assert!(line(&t_s, &vec![7.0; 1800], 2.008) < 1e-12);
        // A line that is no whole number of turns leaks by the sidelobes of Hann's taper, not by 1/n: Harris, Proc. IEEE 66 (1978) 51.
        let x: Vec<f64> = t_s.iter().map(|t| (TAU * 2.008 * t).sin()).collect();
        assert!(line(&t_s, &x, 1.0) < 1e-5, "{}", line(&t_s, &x, 1.0));
    }

    /// What is driven by a sine and linear answers with that sine alone; a load that lifts off does not. Roll that is swung by its load goes at half of
    /// the load's frequency: Nayfeh & Mook, Nonlinear Oscillations (1979), ch. 5. Contact loss is that of the metric.
    #[test]
    fn a_signature_is_read_off_the_right_lines() {
        let settings = [
            "effects.music.onset_s=0.0",
            "effects.music.build_up_s=0.0",
            "effects.noise=false",
            "carriers.frequency_hz=2.1507",
            "effects.frequency_spread=false",
            "analysis_start_s=30.0",
        ];
        let template = template("music", &settings).unwrap();
        let key = "effects.gait.amplitude_m";
        let gentle = scene(&template, &[(key, 0.01)], 1).unwrap();
        let [slack, force, height, ..] = signature(&gentle, 2.1507).unwrap();
        assert!(
            slack == 0.0 && force < 1e-3 && height < 1e-3,
            "{slack} {force} {height}"
        );
        let thrown = scene(&template, &[], 1).unwrap();
        let [slack, force, _, _, half, three_halves] = signature(&thrown, 2.1507).unwrap();
        let [loss] = measure(&thrown, ["contact_loss_mean"]).unwrap();
        assert!(
            slack > 0.1 && (slack - loss).abs() < 1e-12,
            "{slack} {loss}"
        );
        assert!(
            force > 0.05 && half > 10.0 && three_halves < 0.3,
            "{force} {half} {three_halves}"
        );
    }
}
