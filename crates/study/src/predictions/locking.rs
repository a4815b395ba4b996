//! Prediction 1: the gait locks to the beat within Adler's range, and then the rath jumps higher and floats longer.

use super::{Finding, Lab, Verdict, columns, mean, measure, number, row, scene, template};
use crate::draw::{Figure, Layer, WHITE, even_edges};
use crate::sweep::summary::Spread;
use sim::run::Sample;
use sim::scene::Template;
use std::f64::consts::{PI, TAU};

/// Mean gait frequency of the paper's scenes, Hz.
const GAIT_HZ: f64 = 2.0;
const BEAT: &str = "effects.music.beat_hz";
const PULL: &str = "effects.music.strength_rad_per_s";

/// Music from the start on, at full strength.
fn at_once(more: &[&str]) -> Result<Template, String> {
    let mut settings = vec!["effects.music.onset_s=0.0", "effects.music.build_up_s=0.0"];
    settings.extend(more);
    template("music", &settings)
}

/// Nothing random, both carriers alike, and time to see slow slips: what Adler's theorem is about, in the whole model.
pub fn quiet() -> Result<Template, String> {
    at_once(&[
        "effects.noise=false",
        "effects.frequency_spread=false",
        "carriers.initial_phase_sd_rad=0.0",
        "duration_s=200.0",
        "log_rate_hz=10.0",
    ])
}

/// Whether the first carrier keeps to the beat: its phase against the beat's moves by less than half a turn after the first minute.
fn locks(quiet: &Template, pull: f64, detuning: f64) -> Result<bool, String> {
    let scene = scene(quiet, &[(PULL, pull), (BEAT, GAIT_HZ + detuning / TAU)], 1)?;
    let i = columns(&scene, &mut |_: &Sample| true)?;
    let from = i.t_s.partition_point(|t| *t < 60.0);
    let lag = |k: usize| i.phase_rad[0][k] - i.beat_phase_rad[k];
    Ok((lag(i.t_s.len() - 1) - lag(from)).abs() < PI)
}

/// The detuning at which locking ends, by bisection between half and one and a half times the pull: sign +1 or −1.
pub fn edge(quiet: &Template, pull: f64, sign: f64) -> Result<f64, String> {
    let (mut low, mut high) = (0.5 * pull, 1.5 * pull);
    if !locks(quiet, pull, sign * low)? || locks(quiet, pull, sign * high)? {
        return Err(format!("no edge between {low} and {high} rad/s"));
    }
    for _ in 0..9 {
        let middle = 0.5 * (low + high);
        if locks(quiet, pull, sign * middle)? {
            low = middle;
        } else {
            high = middle;
        }
    }
    Ok(0.5 * (low + high))
}

/// How far an edge lies from |Δω| = K_m, relative.
fn miss(edge: f64, pull: f64) -> f64 {
    (edge / pull - 1.0).abs()
}

/// Detunings nearer to the edge than this are on no side of it, rad/s: twice the spread of frequencies.
const APART: f64 = 0.7;

/// Whether a beat is slower or faster than the gait, and outside its range or inside.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Side {
    SlowOut,
    SlowIn,
    FastIn,
    FastOut,
}

impl Side {
    fn of(detuning: f64, pull: f64) -> Option<Self> {
        let off = detuning.abs();
        match detuning < 0.0 {
            slower if off > pull + APART => {
                Some(if slower { Self::SlowOut } else { Self::FastOut })
            }
            slower if (0.5..pull - APART).contains(&off) => {
                Some(if slower { Self::SlowIn } else { Self::FastIn })
            }
            _ => None,
        }
    }
}

/// Does it.
pub fn run(lab: &Lab) -> Result<Finding, String> {
    let full = at_once(&[])?;
    // The map: the paper's own scene, its noise and its spread of frequencies.
    let (nx, ny) = (33, 16);
    let (x_range, y_range) = ((-4.0, 4.0), (0.0, 4.0));
    let cells: Vec<(f64, f64)> = (0..nx * ny)
        .map(|k| {
            let x = x_range.0 + 8.0 * ((k % nx) as f64 + 0.5) / nx as f64;
            (x, y_range.1 * ((k / nx) as f64 + 0.5) / ny as f64)
        })
        .collect();
    let map = lab.map(&cells, |(detuning, pull)| {
        let both = (1001..1003).map(|seed| {
            let s = scene(
                &full,
                &[(PULL, *pull), (BEAT, GAIT_HZ + detuning / TAU)],
                seed,
            )?;
            Ok(measure(&s, ["beat_synchrony"])?[0])
        });
        Ok(mean(both.collect::<Result<Vec<f64>, String>>()?))
    })?;

    let quiet = quiet()?;
    let pulls = [0.5, 1.0, 1.5, 2.0, 2.7, 3.3, 3.9];
    let sides: Vec<(f64, f64)> = pulls.iter().flat_map(|p| [(*p, -1.0), (*p, 1.0)]).collect();
    let edges = lab.map(&sides, |(pull, sign)| edge(&quiet, *pull, *sign))?;
    let worst = sides
        .iter()
        .zip(&edges)
        .map(|((pull, _), edge)| miss(*edge, *pull));
    let worst = worst.fold(0.0, f64::max);

    // Along one line, the paper's pull: what locking does to the height.
    let pull = 2.7;
    let detunings = row(-4.5, 4.5, 19);
    let runs = lab.with_seeds(&detunings);
    let found = lab.map(&runs, |(d, seed)| {
        let s = scene(&full, &[(PULL, pull), (BEAT, GAIT_HZ + d / TAU)], *seed)?;
        measure(&s, ["beat_synchrony", "dz_pp_m", "t_float"])
    })?;
    let seeds = lab.seeds as usize;
    let of = |metric: usize| -> Vec<Spread> {
        found
            .chunks(seeds)
            .filter_map(|runs| Spread::of(&runs.iter().map(|r| r[metric]).collect::<Vec<_>>()))
            .collect()
    };
    let (lock, height, float) = (of(0), of(1), of(2));
    let groups = |spreads: &[Spread]| {
        [Side::SlowOut, Side::SlowIn, Side::FastIn, Side::FastOut].map(|side| {
            let of = detunings.iter().zip(spreads);
            mean(
                of.filter(|(d, _)| Side::of(**d, pull) == Some(side))
                    .map(|(_, s)| s.mean),
            )
        })
    };
    let [h_so, h_si, h_fi, h_fo] = groups(&height);
    let [f_so, f_si, f_fi, f_fo] = groups(&float);
    // Without music, everything else the same.
    let silent = lab.map(&lab.with_seeds(&[0.0]), |(pull, seed)| {
        measure(
            &scene(&full, &[(PULL, *pull)], *seed)?,
            ["dz_pp_m", "t_float"],
        )
    })?;
    let [h_no, f_no] = [0, 1].map(|k| mean(silent.iter().map(|r| r[k])));
    let rises = [h_si > h_no, h_fi > h_no, f_si > f_no, f_fi > f_no];
    let verdict = match (worst < 0.03, rises) {
        (true, [true, true, true, true]) => Verdict::Supported,
        (true, rises) if rises.contains(&true) => Verdict::Depends,
        _ => Verdict::NotSupported,
    };
    let band = |s: &[Spread], name: &str, colour: usize, scale: f64| {
        vec![
            Layer::Band {
                points: detunings
                    .iter()
                    .zip(s)
                    .map(|(d, s)| (*d, scale * s.quantiles[0], scale * s.quantiles[2]))
                    .collect(),
                colour,
            },
            Layer::line(
                name,
                detunings
                    .iter()
                    .zip(s)
                    .map(|(d, s)| (*d, scale * s.mean))
                    .collect(),
                colour,
            ),
        ]
    };
    let mut along = band(&lock, "locking", 0, 1.0);
    along.extend(band(&height, "Δz_pp, dm", 1, 10.0));
    along.extend(band(&float, "T_float", 2, 1.0));
    // Three decimetres, or more where a band goes on.
    let highest = height.iter().map(|s| 10.0 * s.quantiles[2].max(s.mean));
    let top = highest.fold(3.0, f64::max);
    for side in [-pull, pull] {
        along.push(Layer::dashed("", vec![(side, 0.0), (side, top)], 6));
    }
    let points = sides
        .iter()
        .zip(&edges)
        .map(|((pull, sign), e)| (sign * e, *pull))
        .collect();
    Ok(Finding {
        title: "1. Beat locking",
        claim: "When ritual music is present, carrier stepping frequency and palanquin vertical motion should lock to the dominant beat frequency (within the Adler capture range). This locking should manifest as an increase in the peak-to-peak vertical amplitude Δz_pp and in the unloading fraction T_float […].",
        experiment: format!(
            "Detuning Δω = 2π(beat − {GAIT_HZ} Hz) against the pull K_m of the music in the paper's music scene, music from the start on. The map is the scene with its noise and \
             its spread of frequencies (0.35 rad/s), two seeds a cell; the edges are bisected without both, over 200 s. Then K_m = {pull} rad/s alone, {seeds} seeds at each detuning. \
             'Locked' is 0.5 ≤ |Δω| < K_m − {APART}, 'outside' |Δω| > K_m + {APART}, on each side by itself, because a slower beat lifts with less acceleration; 'no music' is K_m = 0."
        ),
        verdict: Some(verdict),
        because: format!(
            "The gait locks within |Δω| = K_m to {:.1} %. Against the same carriers without music, a locked beat below the gait's own frequency changes Δz_pp by {:+.0} % and T_float by {:+.3}, one above it by {:+.0} % and {:+.3}{}",
            100.0 * worst,
            100.0 * (h_si / h_no - 1.0),
            f_si - f_no,
            100.0 * (h_fi / h_no - 1.0),
            f_fi - f_no,
            match verdict {
                Verdict::Supported => ".",
                _ => ": a slow beat locks just as well, but slower feet throw less, and Δz_pp counts the extremes of drifting gaits too.",
            }
        ),
        numbers: vec![
            number("worst_edge", "largest miss of the simulated edge from |Δω| = K_m, relative", worst, "", 4),
            number("edges", "edges bisected", edges.len() as f64, "", 0),
            number("dz_silent", "Δz_pp, no music", h_no, "m", 4),
            number("float_silent", "T_float, no music", f_no, "", 4),
            number("dz_slow_out", "Δz_pp, beat slower, outside", h_so, "m", 4),
            number("dz_slow_in", "Δz_pp, beat slower, locked", h_si, "m", 4),
            number("dz_fast_in", "Δz_pp, beat faster, locked", h_fi, "m", 4),
            number("dz_fast_out", "Δz_pp, beat faster, outside", h_fo, "m", 4),
            number("float_slow_out", "T_float, beat slower, outside", f_so, "", 4),
            number("float_slow_in", "T_float, beat slower, locked", f_si, "", 4),
            number("float_fast_in", "T_float, beat faster, locked", f_fi, "", 4),
            number("float_fast_out", "T_float, beat faster, outside", f_fo, "", 4),
        ],
        pictures: vec![
            (
                "locking-tongue",
                "Adler's tongue: locking to the beat (colour) in the paper's music scene, the theorem's edge |Δω| = K_m (white), and the edges found without noise (vermilion points).".into(),
                Figure {
                    title: "Locking to the beat".into(),
                    x_label: "detuning Δω, rad/s".into(),
                    y_label: "pull K_m, rad/s".into(),
                    layers: vec![
                        Layer::Map {
                            label: "locking".into(),
                            values: map.chunks(nx).map(<[f64]>::to_vec).collect(),
                            x: even_edges(x_range, nx),
                            y: even_edges(y_range, map.len() / nx),
                        },
                        Layer::line("", vec![(-4.0, 4.0), (0.0, 0.0), (4.0, 4.0)], WHITE),
                        Layer::points("", points, 1),
                    ],
                    x_range: Some(x_range),
                    y_range: Some(y_range),
                    ..Figure::default()
                },
            ),
            (
                "locking-height",
                format!("Locking, height and floating across the capture range at K_m = {pull} rad/s: mean and the band of 90 % of {seeds} seeds; broken: |Δω| = K_m."),
                Figure {
                    title: "What locking does to the height".into(),
                    x_label: "detuning Δω, rad/s".into(),
                    y_label: "locking; Δz_pp, dm; T_float".into(),
                    layers: along,
                    y_range: Some((0.0, top)),
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
    fn a_detuning_is_on_a_side_of_the_edge_or_on_none() {
        let of = |detunings: [f64; 9]| detunings.map(|d| Side::of(d, 2.7));
        let sides = of([-3.5, -3.0, -1.5, -0.25, 0.0, 1.5, 2.0, 2.5, 3.5]);
        let (slow, fast) = (Some(Side::SlowIn), Some(Side::FastIn));
        let [slow_out, fast_out] = [Some(Side::SlowOut), Some(Side::FastOut)];
        assert_eq!(
            sides,
            [slow_out, None, slow, None, None, fast, None, None, fast_out]
        );
        // Both sides hold the same detunings.
        let row = of([0.5, 1.0, 1.5, 2.0, 2.5, 3.0, 3.5, 4.0, 4.5]);
        let mirrored = of([-0.5, -1.0, -1.5, -2.0, -2.5, -3.0, -3.5, -4.0, -4.5]);
        for (fast, slow) in row.into_iter().zip(mirrored) {
            let turned = fast.map(|side| match side {
                Side::FastIn => Side::SlowIn,
                _ => Side::SlowOut,
            });
            assert_eq!(slow, turned);
        }
        assert!((miss(2.97, 2.7) - 0.1).abs() < 1e-12 && (miss(0.9, 1.0) - 0.1).abs() < 1e-12);
    }
}
