//! What the carriers do: beat, pull, frequencies, amplitudes.

use super::squares::{Block, bootstrapped};
use super::{BLOCK_S, Estimate, Field, Outcome, budgeted, estimate};
use analyze::beat::adler::Adler;
use analyze::imu::budget::Budget;
use analyze::inputs::{Inputs, Window, interpolate, mean_step_s};
use analyze::phase::unwrap;
use nalgebra::{DMatrix, DVector};
use std::f64::consts::TAU;

/// Beat, pull and the carriers' own frequencies.
pub(super) fn gait(field: &Field) -> Result<Vec<Outcome>, String> {
    let i = &field.inputs;
    let t_s = i.phase_times();
    if i.phase_rad.is_empty() {
        return Err("no gait phases".into());
    }
    let from = t_s.partition_point(|t| *t < field.onset_s);
    if t_s.len() < from + 100 {
        return Err("too few phases after the onset of the music".into());
    }
    if i.phases_are_measured {
        return gait_from_steps(i, from);
    }
    let heard: Vec<f64> = i.beat_phase_rad.iter().skip(from).copied().collect();
    let phases: Vec<Vec<f64>> = i.phase_rad.iter().map(|p| unwrap(&p[from..])).collect();
    if phases.iter().flatten().any(|p| !p.is_finite()) {
        return Err("phases have gaps".into());
    }
    let t_s = &t_s[from..];
    let grown = t_s.iter().map(|t| match field.build_up_s {
        0.0 => 1.0,
        tau => 1.0 - (-(t - field.onset_s) / tau).exp(),
    });
    let problem = Increments {
        t_s: t_s.to_vec(),
        phases,
        grown: grown.collect(),
    };
    let solved = |problem: &Increments, heard: &[f64]| match known(heard) {
        true => problem.under_a_beat(heard),
        false => problem.under_a_hidden_beat(),
    };
    let found = solved(&problem, &heard)?;
    let every_other: Vec<f64> = heard.iter().step_by(2).copied().collect();
    let coarse = (known(&every_other) == known(&heard))
        .then(|| solved(&problem.every_other(), &every_other).ok())
        .flatten();
    problem.told(found, coarse.map(|c| c.answer))
}

/// Whether the beat was recorded for long enough.
fn known(heard: &[f64]) -> bool {
    heard.iter().filter(|psi| psi.is_finite()).count() >= 100
}

/// Phases of the carriers after the onset of the music, and how far its pull has grown.
struct Increments {
    t_s: Vec<f64>,
    phases: Vec<Vec<f64>>,
    grown: Vec<f64>,
}

/// The pull, as parts that go with the sine and the cosine of the beat, rad/s; the own frequencies, rad/s.
#[derive(Clone)]
struct Drive {
    a: f64,
    b: f64,
    own: Vec<f64>,
}

/// What came out; pull and own frequencies (rad/s) with their variances.
struct Answer {
    beat: Outcome,
    /// Of the beat, rad/s.
    rate: f64,
    pull: (f64, f64),
    own: Vec<(f64, f64)>,
}

/// An answer, the problem about it, and how many unknowns it had.
struct Solved {
    answer: Answer,
    normal: Normal,
    unknowns: usize,
}

/// A linear problem about a drive. Unknowns: A, B, Ω, ω_1 …
struct Normal {
    gram: DMatrix<f64>,
    right: DVector<f64>,
    /// Sum of squares of what is missed, times dt.
    squares: f64,
    /// Share of the noise's power that the pull leaves within an increment, summed.
    kept: f64,
    /// Σ e_k e_{k+1} of what is missed, a carrier's increment by the next.
    with_next: f64,
    rows: usize,
}

impl Normal {
    /// Variance of the phase noise, rad²/s.
    fn variance(&self, unknowns: usize) -> f64 {
        self.squares / (self.rows - unknowns) as f64
    }

    /// Whether what is missed looks like noise: the one increment says nothing of the next. What is missed next to nothing of need not.
    fn is_white(&self, pull: f64, dt: f64) -> bool {
        let likeness = self.with_next / self.squares;
        let missed = (self.squares / (self.rows as f64 * dt)).sqrt();
        likeness.abs() < ALIKE || missed < 0.01 * pull
    }
}

/// Likeness of neighbouring residuals that white noise does not show.
const ALIKE: f64 = 0.2;
/// A pull that is not so many standard errors is none: the best of many frequencies has some by chance.
const SURE: f64 = 6.0;

impl Increments {
    /// The same at half the rate: what comes out differently is what the sampling does.
    fn every_other(&self) -> Self {
        let thin = |x: &Vec<f64>| x.iter().step_by(2).copied().collect();
        Self {
            t_s: thin(&self.t_s),
            phases: self.phases.iter().map(thin).collect(),
            grown: thin(&self.grown),
        }
    }

    fn unknowns(&self) -> usize {
        3 + self.phases.len()
    }

    /// Rates of all increments, linear in the unknowns about `drive`, under a beat whose phase at sample k is `psi(k)` and whose phase turns with
    /// Ω by `turn_s(k)`.
    fn normal(
        &self,
        psi: impl Fn(usize) -> f64,
        turn_s: impl Fn(usize) -> f64,
        drive: &Drive,
    ) -> Normal {
        let size = self.unknowns();
        let mut out = Normal {
            gram: DMatrix::zeros(size, size),
            right: DVector::zeros(size),
            squares: 0.0,
            kept: 0.0,
            with_next: 0.0,
            rows: 0,
        };
        let (a, b) = (drive.a, drive.b);
        let mut row = DVector::<f64>::zeros(size);
        for (c, phase) in self.phases.iter().enumerate() {
            let mut before = 0.0;
            for k in 1..self.t_s.len() {
                let dt = self.t_s[k] - self.t_s[k - 1];
                let rate = (phase[k] - phase[k - 1]) / dt;
                if !(psi(k - 1) + psi(k)).is_finite() {
                    before = 0.0;
                    continue;
                }
                let (mut s, mut co, mut turn, mut back) = (0.0, 0.0, 0.0, 0.0);
                // At the end of the increment the phase that is to be expected from its beginning. The one that was observed holds the
                // increment's own noise, which on both sides took half of a pull of 2.7 rad/s away at 0.3 rad/√s.
                let mut off = 0.0;
                for j in [k - 1, k] {
                    let (sin, cos) = (psi(j) - phase[j] + off).sin_cos();
                    let m = self.grown[j];
                    s += 0.5 * m * sin;
                    co += 0.5 * m * cos;
                    let held = 0.5 * m * (a * cos - b * sin);
                    turn += held * turn_s(j);
                    back += held;
                    off = (rate - drive.own[c] - m * (a * sin + b * cos)) * dt;
                }
                row.fill(0.0);
                (row[0], row[1], row[2], row[3 + c]) = (s, co, turn, 1.0);
                let miss = rate - drive.own[c] - a * s - b * co;
                // Increments over dt have variance σ²/dt: weight dt, the same for an even clock.
                out.gram.ger(dt, &row, &row, 1.0);
                out.right.axpy(dt * miss, &row, 1.0);
                out.squares += dt * miss * miss;
                out.with_next += before * dt.sqrt() * miss;
                before = dt.sqrt() * miss;
                // Less what the pull takes back of the noise within dt.
                out.kept += (1.0 - back * dt).max(0.1);
                out.rows += 1;
            }
        }
        out
    }

    /// Where the beat was recorded: everything but its tempo is linear.
    fn under_a_beat(&self, heard: &[f64]) -> Result<Solved, String> {
        let (t_s, psi) = longest_heard(&self.t_s, heard).ok_or("no beat")?;
        let (omega, omega_half) = tempo(&t_s, &unwrap(&psi));
        let carriers = self.phases.len();
        // Of the unknowns A and the own frequencies.
        let keep: Vec<usize> = std::iter::once(0).chain(3..3 + carriers).collect();
        let psi = |k: usize| heard[k];
        let mut drive = Drive {
            a: 0.0,
            b: 0.0,
            own: vec![omega; carriers],
        };
        let no_tempo = |_: usize| 0.0;
        for _ in 0..50 {
            let found = self.normal(psi, no_tempo, &drive);
            let gram = found.gram.select_rows(&keep).select_columns(&keep);
            let step = gram
                .lu()
                .solve(&found.right.select_rows(&keep))
                .ok_or(APART)?;
            drive.a += step[0];
            drive
                .own
                .iter_mut()
                .enumerate()
                .for_each(|(c, w)| *w += step[1 + c]);
            if step.norm() < 1e-10 {
                break;
            }
        }
        let found = self.normal(psi, no_tempo, &drive);
        let variance = found.variance(keep.len());
        let gram = found.gram.select_rows(&keep).select_columns(&keep);
        let cover = gram.try_inverse().ok_or(APART)? * variance;
        let own = drive.own.into_iter().enumerate();
        let answer = Answer {
            beat: estimate("beat", "Hz", omega / TAU, omega_half / TAU),
            rate: omega,
            pull: (drive.a, cover[(0, 0)]),
            own: own.map(|(c, w)| (w, cover[(1 + c, 1 + c)])).collect(),
        };
        Ok(Solved {
            answer,
            normal: found,
            unknowns: keep.len(),
        })
    }

    /// Where nobody recorded the beat: its tempo and phase are looked for.
    fn under_a_hidden_beat(&self) -> Result<Solved, String> {
        let (t_s, phases) = (&self.t_s, &self.phases);
        let (n, carriers, size) = (t_s.len(), phases.len(), self.unknowns());
        let middle = 0.5 * (t_s[0] + t_s[n - 1]);
        let from_middle = |k: usize| t_s[k] - middle;
        let normal =
            |omega: f64, drive: &Drive| self.normal(|k| omega * from_middle(k), from_middle, drive);
        // In the last third the carriers follow the beat if they ever do: where the search begins.
        let third = 2 * n / 3;
        let span = t_s[n - 1] - t_s[third];
        let mean = phases
            .iter()
            .map(|p| (p[n - 1] - p[third]) / span)
            .sum::<f64>()
            / carriers as f64;
        // Where in its turn the beat is, and how strong: a coarse look before the descent.
        let alone = Drive {
            a: 0.0,
            b: 0.0,
            own: vec![mean; carriers],
        };
        let mut best = (f64::INFINITY, mean, alone.clone());
        for step in -20..=20 {
            let omega: f64 = mean + f64::from(step) * 0.25 / span;
            let found = normal(omega, &alone);
            // Without Ω the problem is linear.
            let keep: Vec<usize> = (0..size).filter(|k| *k != 2).collect();
            let small = found.gram.select_rows(&keep).select_columns(&keep);
            let Some(x) = small.lu().solve(&found.right.select_rows(&keep)) else {
                continue;
            };
            let drive = Drive {
                a: x[0],
                b: x[1],
                own: (0..carriers).map(|c| mean + x[2 + c]).collect(),
            };
            let squares = normal(omega, &drive).squares;
            if squares < best.0 {
                best = (squares, omega, drive);
            }
        }
        let (mut squares, mut omega, mut drive) = best;
        for _ in 0..50 {
            let found = normal(omega, &drive);
            let step = found.gram.lu().solve(&found.right).ok_or(APART)?;
            // Half steps until it is better: far from the answer the beat's frequency overshoots.
            let mut part = 1.0;
            loop {
                let own = drive.own.iter().enumerate();
                let new = Drive {
                    a: drive.a + part * step[0],
                    b: drive.b + part * step[1],
                    own: own.map(|(c, w)| w + part * step[3 + c]).collect(),
                };
                let new_omega = omega + part * step[2];
                let found = normal(new_omega, &new).squares;
                if found <= squares || part < 1e-3 {
                    (omega, drive, squares) = (new_omega, new, found);
                    break;
                }
                part *= 0.5;
            }
            if step.norm() < 1e-10 {
                break;
            }
        }
        let found = normal(omega, &drive);
        let cover = found.gram.clone().try_inverse().ok_or(APART)? * found.variance(size);
        let pull = drive.a.hypot(drive.b);
        let (ca, cb) = (drive.a / pull, drive.b / pull);
        let pull_variance =
            ca * ca * cover[(0, 0)] + 2.0 * ca * cb * cover[(0, 1)] + cb * cb * cover[(1, 1)];
        let own = drive.own.into_iter().enumerate();
        let answer = Answer {
            beat: estimate("beat", "Hz", omega / TAU, half(cover[(2, 2)]) / TAU),
            rate: omega,
            pull: (pull, pull_variance),
            own: own.map(|(c, w)| (w, cover[(3 + c, 3 + c)])).collect(),
        };
        Ok(Solved {
            answer,
            normal: found,
            unknowns: size,
        })
    }

    /// Everything that was found, or why it is nothing. `coarse` came of every other sample.
    fn told(&self, found: Solved, coarse: Option<Answer>) -> Result<Vec<Outcome>, String> {
        let Solved {
            answer,
            normal: found,
            unknowns,
        } = found;
        let step_s = (self.t_s[self.t_s.len() - 1] - self.t_s[0]) / (self.t_s.len() - 1) as f64;
        let (pull, pull_variance) = answer.pull;
        // What the mean of both ends of an increment is off, where a carrier runs at another rate than the beat.
        let off = |w: f64| pull * ((w - answer.rate) * step_s).powi(2) / 12.0;
        let rough = answer.own.iter().map(|(w, _)| off(*w)).fold(0.0, f64::max);
        // A mean of both ends errs with the square of the step: every other sample by four times as much, so half of what that changes
        // is one and a half times the error.
        let sampling = |of: &dyn Fn(&Answer) -> f64| {
            coarse
                .as_ref()
                .map_or(0.0, |c| 0.5 * (of(c) - of(&answer)).abs())
        };
        let pull_sampling = sampling(&|a| a.pull.0);
        let own_sampling: Vec<f64> = (0..answer.own.len())
            .map(|c| sampling(&|a| a.own[c].0))
            .collect();
        let by_chance = half(pull_variance).hypot(rough);
        let pull_half = by_chance + pull_sampling;
        if !found.is_white(pull.abs(), step_s) {
            return Err(format!(
                "the phases do not follow one beat: what it leaves of one increment is like the next (by {:.2})",
                found.with_next / found.squares
            ));
        }
        if !(pull > SURE / 1.96 * by_chance) {
            return Err(format!(
                "no pull shows in the phases (at most {:.2} rad/s)",
                pull.max(0.0) + pull_half
            ));
        }
        let mut out = vec![answer.beat, estimate("pull", "rad/s", pull, pull_half)];
        for (c, (w, variance)) in answer.own.into_iter().enumerate() {
            let name = format!("gait {}", c + 1);
            let half = half(variance) + own_sampling[c];
            out.push(estimate(name, "Hz", w / TAU, half / TAU));
        }
        // The noise: its variance has itself a known spread.
        let rows = found.rows as f64;
        let sigma = (found.variance(unknowns) * rows / found.kept).sqrt();
        let count = rows - unknowns as f64;
        let spread = 1.96 * sigma / (2.0 * count).sqrt();
        out.push(estimate("phase noise", "rad/√s", sigma, spread));
        Ok(out)
    }
}

/// Why beat and gait give no answer.
const APART: &str = "beat and gait cannot be told apart";

/// Half of a 95 % interval.
fn half(variance: f64) -> f64 {
    1.96 * variance.max(0.0).sqrt()
}

/// The same where steps tell the phases and a recorder or a topic the beats: Adler's test, which knows what a step detector does. What is walked
/// before the music is in it.
fn gait_from_steps(i: &Inputs, from: usize) -> Result<Vec<Outcome>, String> {
    // Before the first beat that was heard, in pauses and after the last, nobody knows its phase, nor how many beats a pause holds: the tempo is
    // that of the longest stretch without one.
    let heard = longest_heard(
        &i.phase_times()[from..],
        i.beat_phase_rad.get(from..).unwrap_or_default(),
    );
    let (t_s, psi) = heard
        .filter(|(t_s, _)| t_s.len() >= 100)
        .ok_or("too few beats after the onset of the music")?;
    let (omega, half) = tempo(&t_s, &unwrap(&psi));
    let mut out = vec![estimate("beat", "Hz", omega / TAU, half / TAU)];
    match Adler::of(i) {
        Ok(found) => {
            let interval = found.pull_ci95_rad_per_s;
            out.push(match interval[1].is_finite() {
                true => Ok(Estimate {
                    name: "pull".into(),
                    unit: "rad/s",
                    value: found.pull_rad_per_s,
                    interval,
                }),
                false => Err((
                    "pull".into(),
                    format!(
                        "at least {:.2} rad/s: a stronger one would show the same steps",
                        interval[0]
                    ),
                )),
            });
            let halves = found.detuning_half_rad_per_s.iter();
            for (c, (off, half)) in found.detuning_rad_per_s.iter().zip(halves).enumerate() {
                let name = format!("gait {}", c + 1);
                out.push(match half.is_finite() {
                    true => estimate(name, "Hz", (found.beat_rad_per_s + off) / TAU, half / TAU),
                    false => Err((
                        name,
                        "who is with the beat all the time does not show it".into(),
                    )),
                });
            }
        }
        Err(why) => out.extend(["pull", "gait"].map(|name| Err((name.into(), why.into())))),
    }
    let why = "steps err by as much as carriers wander";
    out.push(Err(("phase noise".into(), why.into())));
    Ok(out)
}

/// Times (s) and phases (rad) of the longest stretch in which a beat was heard.
fn longest_heard(t_s: &[f64], beat_rad: &[f64]) -> Option<(Vec<f64>, Vec<f64>)> {
    let known: Vec<(f64, f64)> = t_s.iter().copied().zip(beat_rad.iter().copied()).collect();
    let stretches = known.chunk_by(|a, b| a.1.is_finite() == b.1.is_finite());
    let heard = stretches.filter(|stretch| stretch[0].1.is_finite());
    let longest = heard.max_by_key(|stretch| stretch.len())?;
    Some(longest.iter().copied().unzip())
}

/// Frequency of a beat that was heard, rad/s, and half of its 95 % interval: a straight line through its phase, every beat one
/// observation, and never surer than a clock's ppm.
fn tempo(t_s: &[f64], psi: &[f64]) -> (f64, f64) {
    let n = t_s.len() as f64;
    let (mt, mp) = (t_s.iter().sum::<f64>() / n, psi.iter().sum::<f64>() / n);
    let (mut tt, mut tp) = (0.0, 0.0);
    for (t, p) in t_s.iter().zip(psi) {
        tt += (t - mt) * (t - mt);
        tp += (t - mt) * (p - mp);
    }
    let omega = tp / tt;
    let miss = |(t, p): (&f64, &f64)| (p - mp - omega * (t - mt)).powi(2);
    let variance = t_s.iter().zip(psi).map(miss).sum::<f64>() / n;
    let beats = ((psi[psi.len() - 1] - psi[0]).abs() / TAU).max(1.0);
    let half = 1.96 * (variance / (tt / n) / beats).sqrt();
    (omega, half.max(1e-6 * omega.abs()))
}

/// How far the shoulders go up and down in step with the phases.
pub(super) fn amplitudes(field: &Field, window: Window) -> Result<Vec<Outcome>, String> {
    let i = &field.inputs;
    if i.heave_m.is_empty() || i.heave_m.len() != i.phase_rad.len() {
        return Err("the shoulders' heave is not recorded".into());
    }
    let range = window.range(&i.t_s);
    let t_s = &i.t_s[range.clone()];
    let step_s = mean_step_s(t_s).ok_or("no samples in the window")?;
    let per_block = (BLOCK_S / step_s).round().max(1.0) as usize;
    let phase_t = i.phase_times();
    let known = match (phase_t.first(), phase_t.last()) {
        (Some(a), Some(b)) => *a..=*b,
        _ => return Err("no gait phases".into()),
    };
    let each = i.heave_m.iter().zip(&i.phase_rad).enumerate();
    each.map(|(c, (heave, phase))| {
        let phase = interpolate(phase_t, &unwrap(phase), t_s);
        let mut blocks: Vec<Block<3>> = Vec::new();
        for (k, (z, phi)) in heave[range.clone()].iter().zip(&phase).enumerate() {
            if k.is_multiple_of(per_block) {
                blocks.push(Block::empty());
            }
            let told = z.is_finite() && phi.is_finite() && known.contains(&t_s[k]);
            if let (true, Some(block)) = (told, blocks.last_mut()) {
                block.add([phi.sin(), phi.cos(), 1.0], *z);
            }
        }
        let name = format!("amplitude {}", c + 1);
        let found = bootstrapped(&blocks, |p| [p[0].hypot(p[1])]);
        Ok(match found {
            Some(([value], [interval])) => Ok(Estimate {
                name,
                unit: "m",
                value,
                interval: budgeted(value, interval, Budget::default().height_scale),
            }),
            None => Err((name, "the shoulder does not move with the phase".to_owned())),
        })
    })
    .collect()
}
