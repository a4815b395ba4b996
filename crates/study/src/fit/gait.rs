//! What the carriers do: beat, pull, frequencies, amplitudes.

use super::squares::{Block, bootstrapped, unexplained};
use super::{BLOCK_S, Estimate, Field, Outcome, budgeted, estimate};
use analyze::beat::adler::{Adler, VAGUE_RAD_PER_S};
use analyze::imu::budget::Budget;
use analyze::inputs::{Window, between, longest_step_s, mean_step_in, mean_step_s, stretches};
use analyze::phase::continuous;
use nalgebra::{DMatrix, DVector};
use std::f64::consts::{PI, TAU};
use std::ops::Range;

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
        return gait_from_steps(field, from);
    }
    let phases: Vec<Vec<f64>> = i.phase_rad.iter().map(|p| continuous(&p[from..])).collect();
    if phases.iter().flatten().any(|p| !p.is_finite()) {
        return Err("phases have gaps".into());
    }
    let t_s = &t_s[from..];
    let mut heard: Vec<f64> = i.beat_phase_rad.iter().skip(from).copied().collect();
    heard.resize(t_s.len(), f64::NAN);
    let grown = t_s.iter().map(|t| match field.build_up_s {
        0.0 => 1.0,
        tau => 1.0 - (-(t - field.onset_s) / tau).exp(),
    });
    let whole = Increments {
        t_s: t_s.to_vec(),
        phases,
        heard,
        grown: grown.collect(),
        parts: stretches(t_s, 0.0),
        pairs: field.pairs.clone(),
    };
    // Noise that was drawn for a coarser clock than the recorder's goes on from one increment to the next: thinned until it does not.
    let step_s = whole.step_s().ok_or("no phases follow each other")?;
    let coarsest = ((COARSEST_S / step_s) as usize).max(1);
    let mut last = Err(APART.to_owned());
    for skip in 1..=coarsest {
        let problem = whole.thinned(skip);
        if skip > 1 && problem.t_s.len() < 100 {
            break;
        }
        let found = problem.solved()?;
        let white = found.is_white(step_s * skip as f64);
        last = problem.told(found);
        if white {
            break;
        }
    }
    last
}

/// Phases are thinned to steps of at most this, s: a coarser clock of noise would show in the gait itself.
const COARSEST_S: f64 = 0.1;

/// Whether the beat was recorded for long enough.
fn known(heard: &[f64]) -> bool {
    heard.iter().filter(|psi| psi.is_finite()).count() >= 100
}

/// Phases of the carriers after the onset of the music, the beat's, and how far its pull has grown.
struct Increments {
    t_s: Vec<f64>,
    phases: Vec<Vec<f64>>,
    /// NaN where nobody recorded it.
    heard: Vec<f64>,
    grown: Vec<f64>,
    /// The parts between holes: no increment spans one.
    parts: Vec<Range<usize>>,
    /// Who minds whom; `None` where everybody minds everybody.
    pairs: Option<Vec<[usize; 2]>>,
}

/// The pull, as parts that go with the sine and the cosine of the beat, rad/s; the own frequencies, rad/s; how the carriers pull each
/// other, rad/s.
#[derive(Clone)]
struct Drive {
    a: f64,
    b: f64,
    own: Vec<f64>,
    coupling: f64,
}

impl Drive {
    fn alone(rate: f64, carriers: usize) -> Self {
        Self {
            a: 0.0,
            b: 0.0,
            own: vec![rate; carriers],
            coupling: 0.0,
        }
    }

    /// After a step in all unknowns.
    fn after(&self, step: &DVector<f64>, part: f64) -> Self {
        let own = self.own.iter().enumerate();
        Self {
            a: self.a + part * step[0],
            b: self.b + part * step[1],
            own: own.map(|(c, w)| w + part * step[FIRST_OWN + c]).collect(),
            coupling: self.coupling + part * step[FIRST_OWN + self.own.len()],
        }
    }
}

/// What came out; pull, own frequencies and coupling (rad/s) with their variances.
struct Answer {
    beat: Outcome,
    /// Of the beat, rad/s.
    rate: f64,
    pull: (f64, f64),
    own: Vec<(f64, f64)>,
    coupling: (f64, f64),
}

/// An answer, the problem about it, and how many unknowns it had.
struct Solved {
    answer: Answer,
    normal: Normal,
    unknowns: usize,
}

impl Solved {
    /// Whether what is missed looks like noise: the one increment says nothing of the next. What is missed next to nothing of need not.
    fn is_white(&self, dt: f64) -> bool {
        let n = &self.normal;
        n.likeness().abs() < ALIKE || n.misses_nothing(dt, self.answer.pull.0)
    }
}

/// A linear problem about a drive. Unknowns: A, B, Ω, ω_1 … ω_N, K_c.
struct Normal {
    gram: DMatrix<f64>,
    right: DVector<f64>,
    /// Sum of squares of what is missed, times dt.
    squares: f64,
    /// Share of the noise's power that the pull leaves within an increment, summed: of white noise, and of noise that is even within it.
    kept_white: f64,
    kept_even: f64,
    /// Σ e_k e_{k+1} of what is missed, a carrier's increment by the next.
    with_next: f64,
    /// Σ (Σ e_k)² / n over a carrier's increments of [`RUN_S`], n of them; and how many such runs there are.
    run: f64,
    runs: usize,
    /// Sums for each carrier's √dt·e_k over what comes back with his steps: cos φ, sin φ, cos 2φ, sin 2φ.
    with_steps: Vec<Block<4>>,
    rows: usize,
}

/// Place of ω_1 among the unknowns.
const FIRST_OWN: usize = 3;

impl Normal {
    /// How alike neighbouring increments of what is missed are, −1 … 1.
    fn likeness(&self) -> f64 {
        self.with_next / self.squares
    }

    /// Whether what is missed is next to nothing beside the pull (rad/s), in increments of `dt` (s).
    fn misses_nothing(&self, dt: f64, pull: f64) -> bool {
        (self.squares / (self.rows as f64 * dt)).sqrt() < 0.01 * pull.abs()
    }

    /// How strong what is missed is over [`RUN_S`] beside white noise that misses as much over an increment: more where it goes on, less where it
    /// comes back. `None` where that may be chance, or the recorder's clock against the noise's.
    fn is_no_noise(&self) -> Option<f64> {
        let runs = self.runs as f64;
        let times = self.run / runs / (self.squares / self.rows as f64);
        // The spread of Σ χ²/n.
        let spread = (2.0 / runs).sqrt();
        let goes_on = times > self.shared() + 0.5 && times > 1.0 + 5.0 * spread;
        (goes_on || times < 1.0 - 3.0 * spread).then_some(times)
    }

    /// Share of what one carrier's increments miss that comes back with his steps, where that is no chance: white noise gives n of them
    /// n times that share as χ² of four degrees of freedom.
    fn comes_back_with_steps(&self) -> Option<f64> {
        let rows = (self.rows / self.with_steps.len().max(1)) as f64;
        let told = |block: &Block<4>| Some(1.0 - unexplained(std::slice::from_ref(block))?);
        let most = self.with_steps.iter().filter_map(told).fold(0.0, f64::max);
        (most * rows > BY_CHANCE && most > OF_STEPS).then_some(most)
    }

    /// By how much what neighbours share makes noise over a long time stronger than over one increment: where the recorder's clock is not the noise's,
    /// a step of the one lies in two of the other. 1 where they share no more than chance has it.
    fn shared(&self) -> f64 {
        let likeness = self.likeness();
        match likeness > 3.0 / (self.rows as f64).sqrt() {
            true => 1.0 + 2.0 * likeness.min(ALIKE),
            false => 1.0,
        }
    }

    /// Variance of the phase noise, rad²/s.
    fn variance(&self, unknowns: usize) -> f64 {
        self.shared() * self.squares / (self.rows - unknowns) as f64
    }

    /// Gauss and Newton's step in the unknowns at `keep`, 0 in the others.
    fn step(&self, keep: &[usize]) -> Option<DVector<f64>> {
        let gram = self.gram.select_rows(keep).select_columns(keep);
        let found = gram.lu().solve(&self.right.select_rows(keep))?;
        let mut step = DVector::zeros(self.right.len());
        keep.iter().zip(&found).for_each(|(k, x)| step[*k] = *x);
        Some(step)
    }

    /// Covariance of the unknowns at `keep`, 0 elsewhere.
    fn cover(&self, keep: &[usize]) -> Option<DMatrix<f64>> {
        let gram = self.gram.select_rows(keep).select_columns(keep);
        let found = gram.try_inverse()? * self.variance(keep.len());
        let size = self.right.len();
        let mut cover = DMatrix::zeros(size, size);
        for (i, row) in keep.iter().enumerate() {
            for (j, column) in keep.iter().enumerate() {
                cover[(*row, *column)] = found[(i, j)];
            }
        }
        Some(cover)
    }
}

/// What is missed over so long shows whether anything but noise is, s.
const RUN_S: f64 = 1.0;
/// Share of the noise that may come back with the steps: no more than moves its strength by a twentieth.
const OF_STEPS: f64 = 0.1;
/// A χ² of four degrees of freedom that chance reaches once in 10⁹.
const BY_CHANCE: f64 = 48.0;
/// Likeness of neighbouring residuals that white noise does not show.
const ALIKE: f64 = 0.2;
/// A pull or a coupling that is not so many standard errors is none: the best of many frequencies has some by chance.
const SURE: f64 = 6.0;

impl Increments {
    /// Every `skip`-th sample of each part.
    fn thinned(&self, skip: usize) -> Self {
        let (mut kept, mut parts) = (Vec::new(), Vec::new());
        for part in &self.parts {
            let start = kept.len();
            kept.extend(part.clone().step_by(skip));
            parts.push(start..kept.len());
        }
        let thin = |x: &Vec<f64>| kept.iter().map(|k| x[*k]).collect();
        Self {
            t_s: thin(&self.t_s),
            phases: self.phases.iter().map(thin).collect(),
            heard: thin(&self.heard),
            grown: thin(&self.grown),
            parts,
            pairs: self.pairs.clone(),
        }
    }

    /// Mean step within the parts, s.
    fn step_s(&self) -> Option<f64> {
        mean_step_in(&self.t_s, &self.parts)
    }

    /// What the others do to each carrier, for a coupling of 1: (1/N) Σ_j sin(φ_j − φ_c), or 1/(d + 1) times the sum over his d neighbours.
    fn others(&self, phases: &[f64]) -> Vec<f64> {
        let n = phases.len();
        let Some(pairs) = &self.pairs else {
            let (s, c) = phases
                .iter()
                .fold((0.0, 0.0), |(s, c), p| (s + p.sin(), c + p.cos()));
            let of = |p: &f64| (s * p.cos() - c * p.sin()) / n as f64;
            return phases.iter().map(of).collect();
        };
        let mut sums = vec![(0.0, 1.0); n];
        for &[a, b] in pairs.iter().filter(|pair| pair.iter().all(|c| *c < n)) {
            let toward = (phases[b] - phases[a]).sin();
            sums[a] = (sums[a].0 + toward, sums[a].1 + 1.0);
            sums[b] = (sums[b].0 - toward, sums[b].1 + 1.0);
        }
        sums.into_iter().map(|(sum, count)| sum / count).collect()
    }

    /// How soon each carrier's deviation is taken back by the others, for a coupling of 1: −∂/∂φ_c of [`Self::others`], (1/N) Σ_j cos(φ_j − φ_c) over
    /// the others j.
    fn held_by_others(&self, phases: &[f64]) -> Vec<f64> {
        let n = phases.len();
        let Some(pairs) = &self.pairs else {
            let (s, c) = phases
                .iter()
                .fold((0.0, 0.0), |(s, c), p| (s + p.sin(), c + p.cos()));
            // Without himself.
            let of = |p: &f64| (s * p.sin() + c * p.cos() - 1.0) / n as f64;
            return phases.iter().map(of).collect();
        };
        let mut sums = vec![(0.0, 1.0); n];
        for &[a, b] in pairs.iter().filter(|pair| pair.iter().all(|c| *c < n)) {
            let along = (phases[b] - phases[a]).cos();
            for c in [a, b] {
                sums[c] = (sums[c].0 + along, sums[c].1 + 1.0);
            }
        }
        sums.into_iter().map(|(sum, count)| sum / count).collect()
    }

    /// The later end of every increment.
    fn ends(&self) -> Vec<usize> {
        let ends = |part: &Range<usize>| part.clone().skip(1);
        self.parts.iter().flat_map(ends).collect()
    }

    fn unknowns(&self) -> usize {
        FIRST_OWN + self.phases.len() + 1
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
            kept_white: 0.0,
            kept_even: 0.0,
            run: 0.0,
            runs: 0,
            with_steps: vec![Block::empty(); self.phases.len()],
            with_next: 0.0,
            rows: 0,
        };
        let (a, b) = (drive.a, drive.b);
        let carriers = self.phases.len();
        let mut row = DVector::<f64>::zeros(size);
        for part in &self.parts {
            let mut before = vec![0.0; carriers];
            // Sum, number and end of each carrier's run of increments.
            let mut runs = vec![(0.0, 0.0); carriers];
            let mut run_ends_s = f64::NEG_INFINITY;
            for k in part.clone().skip(1) {
                if !(psi(k - 1) + psi(k)).is_finite() {
                    before.fill(0.0);
                    continue;
                }
                if self.t_s[k] > run_ends_s {
                    for (sum, count) in runs.iter_mut().filter(|r| r.1 > 0.0) {
                        out.run += *sum * *sum / *count;
                        out.runs += 1;
                        (*sum, *count) = (0.0, 0.0);
                    }
                    run_ends_s = self.t_s[k] + RUN_S;
                }
                let dt = self.t_s[k] - self.t_s[k - 1];
                // At the end of the increment the phases that are to be expected from its beginning. Those that were observed hold the
                // increment's own noise, which on both sides took half of a pull of 2.7 rad/s away at 0.3 rad/√s.
                let begun: Vec<f64> = self.phases.iter().map(|p| p[k - 1]).collect();
                let beside = self.others(&begun);
                let expected = (0..carriers).map(|c| {
                    let (sin, cos) = (psi(k - 1) - begun[c]).sin_cos();
                    let pull = self.grown[k - 1] * (a * sin + b * cos);
                    begun[c] + (drive.own[c] + pull + drive.coupling * beside[c]) * dt
                });
                let expected: Vec<f64> = expected.collect();
                let beside_then = self.others(&expected);
                let ends = begun.iter().zip(&expected);
                let middle: Vec<f64> = ends.map(|(a, b)| 0.5 * (a + b)).collect();
                let by_others = self.held_by_others(&middle);
                for c in 0..carriers {
                    let rate = (self.phases[c][k] - begun[c]) / dt;
                    let (mut s, mut co, mut turn, mut back) = (0.0, 0.0, 0.0, 0.0);
                    for (j, phase) in [(k - 1, begun[c]), (k, expected[c])] {
                        let (sin, cos) = (psi(j) - phase).sin_cos();
                        let m = self.grown[j];
                        s += 0.5 * m * sin;
                        co += 0.5 * m * cos;
                        let held = 0.5 * m * (a * cos - b * sin);
                        turn += held * turn_s(j);
                        back += held;
                    }
                    let mutual = 0.5 * (beside[c] + beside_then[c]);
                    row.fill(0.0);
                    (row[0], row[1], row[2]) = (s, co, turn);
                    (row[FIRST_OWN + c], row[size - 1]) = (1.0, mutual);
                    let miss = rate - drive.own[c] - a * s - b * co - drive.coupling * mutual;
                    // Increments over dt have variance σ²/dt: weight dt, the same for an even clock.
                    out.gram.ger(dt, &row, &row, 1.0);
                    out.right.axpy(dt * miss, &row, 1.0);
                    out.squares += dt * miss * miss;
                    out.with_next += before[c] * dt.sqrt() * miss;
                    before[c] = dt.sqrt() * miss;
                    runs[c] = (runs[c].0 + before[c], runs[c].1 + 1.0);
                    let ((s1, c1), (s2, c2)) = (middle[c].sin_cos(), (2.0 * middle[c]).sin_cos());
                    out.with_steps[c].add([c1, s1, c2, s2], before[c]);
                    let taken = taken_back((back + drive.coupling * by_others[c]) * dt);
                    out.kept_white += taken[0];
                    out.kept_even += taken[1];
                    out.rows += 1;
                }
            }
        }
        out
    }

    /// The answer, under a recorded beat or one that is looked for, with a coupling where there is one.
    fn solved(&self) -> Result<Solved, String> {
        let alone = self.solved_with(false)?;
        if self.phases.len() < 2 {
            return Ok(alone);
        }
        Ok(match self.solved_with(true) {
            Ok(coupled) if coupled.answer.is_coupled() => coupled,
            _ => alone,
        })
    }

    fn solved_with(&self, coupled: bool) -> Result<Solved, String> {
        match known(&self.heard) {
            true => self.under_a_beat(coupled),
            false => self.under_a_hidden_beat(coupled),
        }
    }

    /// The unknowns that are looked for.
    fn wanted(&self, coupled: bool, of_beat: &[usize]) -> Vec<usize> {
        let last = self.unknowns() - 1;
        let rest = (FIRST_OWN..last).chain(coupled.then_some(last));
        of_beat.iter().copied().chain(rest).collect()
    }

    /// Where the beat was recorded: everything but its tempo is linear.
    fn under_a_beat(&self, coupled: bool) -> Result<Solved, String> {
        let (t_s, psi) = longest_heard(&self.t_s, &self.heard).ok_or("no beat")?;
        let tempo = Tempo::of(&t_s, &continuous(&psi));
        let keep = self.wanted(coupled, &[0]);
        let psi = |k: usize| self.heard[k];
        let no_tempo = |_: usize| 0.0;
        let mut drive = Drive::alone(tempo.rate, self.phases.len());
        for _ in 0..50 {
            let step = self.normal(psi, no_tempo, &drive).step(&keep);
            let step = step.ok_or(APART)?;
            drive = drive.after(&step, 1.0);
            if step.norm() < 1e-10 {
                break;
            }
        }
        let found = self.normal(psi, no_tempo, &drive);
        let cover = found.cover(&keep).ok_or(APART)?;
        let answer = Answer {
            beat: tempo.told(),
            rate: tempo.rate,
            pull: (drive.a, cover[(0, 0)]),
            own: own_of(&drive, &cover),
            coupling: coupling_of(&drive, &cover),
        };
        Ok(Solved {
            answer,
            normal: found,
            unknowns: keep.len(),
        })
    }

    /// Where nobody recorded the beat: its tempo and phase are looked for.
    fn under_a_hidden_beat(&self, coupled: bool) -> Result<Solved, String> {
        let (t_s, phases) = (&self.t_s, &self.phases);
        let (n, carriers) = (t_s.len(), phases.len());
        let middle = 0.5 * (t_s[0] + t_s[n - 1]);
        let from_middle = |k: usize| t_s[k] - middle;
        let normal =
            |omega: f64, drive: &Drive| self.normal(|k| omega * from_middle(k), from_middle, drive);
        // In the last third the carriers follow the beat if they ever do: where the search begins.
        let ends = self.ends();
        let late = &ends[2 * ends.len() / 3..];
        let over = |x: &[f64]| late.iter().map(|k| x[*k] - x[k - 1]).sum::<f64>();
        let mean = phases.iter().map(|p| over(p)).sum::<f64>() / over(t_s) / carriers as f64;
        let span = t_s[n - 1] - t_s[*late.first().ok_or(APART)?];
        // Where in its turn the beat is, and how strong: a coarse look before the descent.
        let alone = Drive::alone(mean, carriers);
        let mut best = (f64::INFINITY, mean, alone.clone());
        // Without Ω the problem is linear.
        let keep = self.wanted(coupled, &[0, 1]);
        for step in -20..=20 {
            let omega: f64 = mean + f64::from(step) * 0.25 / span;
            let Some(step) = normal(omega, &alone).step(&keep) else {
                continue;
            };
            let drive = alone.after(&step, 1.0);
            let squares = normal(omega, &drive).squares;
            if squares < best.0 {
                best = (squares, omega, drive);
            }
        }
        let (mut squares, mut omega, mut drive) = best;
        let keep = self.wanted(coupled, &[0, 1, 2]);
        for _ in 0..50 {
            let step = normal(omega, &drive).step(&keep).ok_or(APART)?;
            // Half steps until it is better: far from the answer the beat's frequency overshoots.
            let mut part = 1.0;
            loop {
                let new = drive.after(&step, part);
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
        let cover = found.cover(&keep).ok_or(APART)?;
        let pull = drive.a.hypot(drive.b);
        let (ca, cb) = (drive.a / pull, drive.b / pull);
        let pull_variance =
            ca * ca * cover[(0, 0)] + 2.0 * ca * cb * cover[(0, 1)] + cb * cb * cover[(1, 1)];
        let answer = Answer {
            beat: estimate("beat", "Hz", omega / TAU, half(cover[(2, 2)]) / TAU),
            rate: omega,
            pull: (pull, pull_variance),
            own: own_of(&drive, &cover),
            coupling: coupling_of(&drive, &cover),
        };
        Ok(Solved {
            answer,
            normal: found,
            unknowns: keep.len(),
        })
    }

    /// Everything that was found, or why it is nothing.
    fn told(&self, found: Solved) -> Result<Vec<Outcome>, String> {
        let step_s = self.step_s().ok_or(APART)?;
        let white = found.is_white(step_s);
        let Solved {
            answer,
            normal: found,
            unknowns,
        } = found;
        let (pull, pull_variance) = answer.pull;
        if !white {
            return Err(format!(
                "the phases do not follow one beat: what it leaves of one increment is like the next (by {:.2})",
                found.likeness()
            ));
        }
        let no_noise = found.is_no_noise();
        if let Some(times) = no_noise.filter(|_| !found.misses_nothing(step_s, pull)) {
            return Err(format!(
                "carriers do more than follow a beat and mind each other: what that leaves is {times:.1} times what noise would be over a second"
            ));
        }
        let with_steps = found.comes_back_with_steps();
        if let Some(share) = with_steps.filter(|_| !found.misses_nothing(step_s, pull)) {
            return Err(format!(
                "carriers do more than follow a beat and mind each other: {:.0} % of what that leaves comes back with their steps",
                100.0 * share
            ));
        }
        // What the mean of both ends of an increment is off, where a carrier runs at another rate than the beat.
        let off = |w: f64| pull * ((w - answer.rate) * step_s).powi(2) / 12.0;
        let rough = answer.own.iter().map(|(w, _)| off(*w)).fold(0.0, f64::max);
        // The same in other ways. A mean of both ends errs with the square of the step: every other sample by four times as much, so half
        // of what that changes is one and a half times the error. A coupling too weak to show is in what allowing for one changes.
        let coupled = answer.coupling.1 > 0.0;
        let sparse = self.thinned(2);
        let coarse = (known(&sparse.heard) == known(&self.heard))
            .then(|| sparse.solved_with(coupled).ok())
            .flatten();
        let allowed = (!coupled && self.phases.len() > 1)
            .then(|| self.solved_with(true).ok())
            .flatten();
        let other_ways = |of: &dyn Fn(&Answer) -> f64| {
            let by = |other: &Option<Solved>| {
                let other = other.as_ref();
                other.map_or(0.0, |s| (of(&s.answer) - of(&answer)).abs())
            };
            0.5 * by(&coarse) + by(&allowed)
        };
        let by_chance = half(pull_variance).hypot(rough);
        let pull_half = by_chance + other_ways(&|a| a.pull.0);
        if !(pull > SURE / 1.96 * by_chance) {
            return Err(format!(
                "no pull shows in the phases (at most {:.2} rad/s)",
                pull.max(0.0) + pull_half
            ));
        }
        let own_half: Vec<f64> = (0..answer.own.len())
            .map(|c| half(answer.own[c].1) + other_ways(&|a| a.own[c].0))
            .collect();
        let coupling_half = half(answer.coupling.1) + other_ways(&|a| a.coupling.0);
        let mut out = vec![answer.beat, estimate("pull", "rad/s", pull, pull_half)];
        for (c, ((w, _), half)) in answer.own.into_iter().zip(own_half).enumerate() {
            let name = format!("gait {}", c + 1);
            out.push(estimate(name, "Hz", w / TAU, half / TAU));
        }
        if coupled {
            let name = "coupling";
            out.push(estimate(name, "rad/s", answer.coupling.0, coupling_half));
        }
        // The noise: its variance has itself a known spread; what neighbours share has twice that of its own.
        let rows = found.rows as f64;
        let noise = |of: &Normal, kept: f64| (of.variance(unknowns) * of.rows as f64 / kept).sqrt();
        let sigma = noise(&found, found.kept_white);
        let even = (noise(&found, found.kept_even) - sigma).abs();
        let sparse = coarse.map_or(0.0, |s| {
            (noise(&s.normal, s.normal.kept_white) - sigma).abs()
        });
        // What a coupling that does not show would have taken back.
        let mutual = allowed.map_or(0.0, |s| {
            (noise(&s.normal, s.normal.kept_white) - sigma).abs()
        });
        let count = (rows - unknowns as f64) / if found.shared() > 1.0 { 3.0 } else { 1.0 };
        let half = (1.96 * sigma / (2.0 * count).sqrt()).max(0.5 * sparse) + even + mutual;
        out.push(match half < sigma {
            true => estimate("phase noise", "rad/√s", sigma, half),
            // Most of it would have been left.
            false if found.misses_nothing(step_s, pull) && found.kept_white > 0.5 * rows => Err((
                "phase noise".into(),
                format!("next to none (at most {:.0e} rad/√s): what is missed is as small as the error of the increments themselves", sigma + half),
            )),
            false => Err((
                "phase noise".into(),
                format!("samples {step_s:.2} s apart are too few for a pull that takes noise back so soon"),
            )),
        });
        Ok(out)
    }
}

impl Answer {
    fn is_coupled(&self) -> bool {
        let (coupling, variance) = self.coupling;
        coupling.abs() > SURE * variance.sqrt()
    }
}

/// Own frequencies with their variances.
fn own_of(drive: &Drive, cover: &DMatrix<f64>) -> Vec<(f64, f64)> {
    let own = drive.own.iter().enumerate();
    let variance = |c: usize| cover[(FIRST_OWN + c, FIRST_OWN + c)];
    own.map(|(c, w)| (*w, variance(c))).collect()
}

/// The coupling with its variance, 0 where none was looked for.
fn coupling_of(drive: &Drive, cover: &DMatrix<f64>) -> (f64, f64) {
    let last = cover.nrows() - 1;
    (drive.coupling, cover[(last, last)])
}

/// Shares that pull and coupling leave of the noise's power within an increment, by `x`, the rate of its relaxation times the increment: of white
/// noise, ∫e^(−2xu)du, and of noise that is even within it, (∫e^(−xu)du)², u from 0 to 1. Who is driven apart is so for less than an increment. What
/// comes back by way of others is of second order: 0.3 % of the noise of eight carriers in step with K_cΔt = 0.27.
fn taken_back(x: f64) -> [f64; 2] {
    let mean = |x: f64| if x == 0.0 { 1.0 } else { -(-x).exp_m1() / x };
    let x = x.max(-1.0);
    [mean(2.0 * x), mean(x).powi(2)]
}

/// Why beat and gait give no answer.
const APART: &str = "beat and gait cannot be told apart";

/// Half of a 95 % interval.
fn half(variance: f64) -> f64 {
    1.96 * variance.max(0.0).sqrt()
}

/// The same where steps tell the phases and a recorder or a topic the beats: Adler's test, which knows what a step detector does. What is walked
/// before the music is in it.
fn gait_from_steps(field: &Field, from: usize) -> Result<Vec<Outcome>, String> {
    let i = &field.inputs;
    // Before the first beat that was heard, in pauses and after the last, nobody knows its phase, nor how many beats a pause holds: the tempo is
    // that of the longest stretch without one.
    let heard = longest_heard(
        &i.phase_times()[from..],
        i.beat_phase_rad.get(from..).unwrap_or_default(),
    );
    let (t_s, psi) = heard
        .filter(|(t_s, _)| t_s.len() >= 100)
        .ok_or("too few beats after the onset of the music")?;
    let mut beat = Tempo::of(&t_s, &continuous(&psi)).told();
    // A course through many beats errs less than they do, and slower: what it leaves of them tells no interval.
    if let (Ok(found), Some((hz, half))) = (&mut beat, field.heard_hz) {
        let half = half.max(LEAST_SURE * hz);
        (found.value, found.interval) = (hz, [hz - half, hz + half]);
    }
    let mut out = vec![beat];
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
            if let Some([strength, half]) = found.coupling_rad_per_s {
                let [low, high] = [strength - half, strength + half];
                out.push(match half <= VAGUE_RAD_PER_S {
                    true => estimate("coupling", "rad/s", strength, half),
                    false => Err((
                        "coupling".into(),
                        format!("anything from {low:.1} to {high:.1} rad/s goes with the steps"),
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

/// Times (s) and phases (rad) of the longest stretch without a hole in which a beat was heard.
fn longest_heard(t_s: &[f64], beat_rad: &[f64]) -> Option<(Vec<f64>, Vec<f64>)> {
    let known: Vec<(f64, f64)> = t_s.iter().copied().zip(beat_rad.iter().copied()).collect();
    let longest_s = longest_step_s(t_s);
    let goes_on = |a: &(f64, f64), b: &(f64, f64)| {
        a.1.is_finite() == b.1.is_finite() && b.0 - a.0 <= longest_s
    };
    let stretches = known.chunk_by(goes_on);
    let heard = stretches.filter(|stretch| stretch[0].1.is_finite());
    let longest = heard.max_by_key(|stretch| stretch.len())?;
    Some(longest.iter().copied().unzip())
}

/// No clock is surer, a part of itself.
const LEAST_SURE: f64 = 1e-6;

/// A beat that was heard: a straight line through its phase, every beat one observation, and never surer than a clock's ppm.
struct Tempo {
    /// rad/s.
    rate: f64,
    /// Half of its 95 % interval, rad/s.
    half: f64,
    /// How far the phase leaves the line, rad.
    strays: f64,
    /// Slowest and fastest over ten beats, rad/s.
    range: [f64; 2],
}

impl Tempo {
    fn of(t_s: &[f64], psi: &[f64]) -> Self {
        let n = t_s.len() as f64;
        let (mt, mp) = (t_s.iter().sum::<f64>() / n, psi.iter().sum::<f64>() / n);
        let (mut tt, mut tp) = (0.0, 0.0);
        for (t, p) in t_s.iter().zip(psi) {
            tt += (t - mt) * (t - mt);
            tp += (t - mt) * (p - mp);
        }
        let rate = tp / tt;
        let misses = || {
            t_s.iter()
                .zip(psi)
                .map(|(t, p)| (p - mp - rate * (t - mt)).abs())
        };
        let variance = misses().map(|m| m * m).sum::<f64>() / n;
        let beats = ((psi[psi.len() - 1] - psi[0]).abs() / TAU).max(1.0);
        let half = 1.96 * (variance / (tt / n) / beats).sqrt();
        let ten = ((10.0 * n / beats) as usize).clamp(1, t_s.len() - 1);
        let over_ten = (ten..t_s.len()).map(|k| (psi[k] - psi[k - ten]) / (t_s[k] - t_s[k - ten]));
        let range = over_ten.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], r| {
            [low.min(r), high.max(r)]
        });
        Self {
            rate,
            half: half.max(LEAST_SURE * rate.abs()),
            strays: misses().fold(0.0, f64::max),
            range,
        }
    }

    /// The tempo, where there is one: who keeps it is never half a turn off.
    fn told(&self) -> Outcome {
        if self.strays > PI {
            let [low, high] = self.range.map(|r| r / TAU);
            return Err((
                "beat".into(),
                format!(
                    "the beat changes its tempo, {low:.2} to {high:.2} Hz over ten beats: no single one is within half a turn of it"
                ),
            ));
        }
        estimate("beat", "Hz", self.rate / TAU, self.half / TAU)
    }
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
    let each = i.heave_m.iter().zip(&i.phase_rad).enumerate();
    each.map(|(c, (heave, phase))| {
        let phase = between(phase_t, &continuous(phase), t_s);
        let mut blocks: Vec<Block<3>> = Vec::new();
        for (k, (z, phi)) in heave[range.clone()].iter().zip(&phase).enumerate() {
            if k.is_multiple_of(per_block) {
                blocks.push(Block::empty());
            }
            let told = z.is_finite() && phi.is_finite();
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

#[cfg(test)]
mod tests {
    use super::*;

    /// A minute of a beat of 2.15 Hz at 100 Hz, its phase off the line by 0.2 rad for half of the time, to either side in turn: each beat counts once.
    #[test]
    fn a_tempo_is_as_sure_as_its_beats() {
        let (hz, off) = (2.15, 0.2);
        let t_s: Vec<f64> = (0..6000).map(|k| 7.0 + 0.01 * f64::from(k)).collect();
        let psi = |off: f64| -> Vec<f64> {
            let side = |k: usize| if k.is_multiple_of(2) { off } else { -off };
            let each = t_s.iter().enumerate();
            each.map(|(k, t)| TAU * hz * t + side(k)).collect()
        };
        let loose = Tempo::of(&t_s, &psi(off));
        // A line through 129 beats over a minute, each 0.2 rad off: σ √12 / (T √n).
        let sd = off * 12f64.sqrt() / (60.0 * (60.0 * hz).sqrt());
        assert!(
            (loose.rate / (TAU * hz) - 1.0).abs() < 1e-6,
            "{}",
            loose.rate
        );
        assert!(
            (loose.half / (1.96 * sd) - 1.0).abs() < 0.01,
            "{}",
            loose.half
        );
        assert!((loose.strays - off).abs() < 1e-3);
        let e = loose.told().unwrap();
        assert!((e.value - hz).abs() < 1e-5);
        assert!(((e.interval[1] - e.interval[0]) / (2.0 * 1.96 * sd / TAU) - 1.0).abs() < 0.01);
        // Never surer than a clock's ppm; who is half a turn off the line keeps no tempo.
        let steady = Tempo::of(&t_s, &psi(0.0));
        assert!((steady.half / (1e-6 * TAU * hz) - 1.0).abs() < 1e-6);
        let faster: Vec<f64> = t_s
            .iter()
            .map(|t| TAU * (2.0 * t + 0.005 * (t - 7.0).powi(2)))
            .collect();
        let (name, why) = Tempo::of(&t_s, &faster).told().unwrap_err();
        // 2 Hz to 2.6 Hz; means over ten beats begin and end a few seconds within.
        assert!(
            name == "beat" && why.contains("2.02 to 2.58 Hz over ten beats"),
            "{why}"
        );
    }

    #[test]
    fn the_longest_stretch_that_was_heard_is_taken() {
        let t_s: Vec<f64> = (0..100)
            .map(|k| 0.1 * f64::from(k) + if k < 60 { 0.0 } else { 5.0 })
            .collect();
        let heard = |k: usize| (5..25).contains(&k) || k > 40;
        let beat: Vec<f64> = (0..100)
            .map(|k| if heard(k) { k as f64 } else { f64::NAN })
            .collect();
        // From 41 to 59, to a hole in the record, and from 60 on.
        let (t, psi) = longest_heard(&t_s, &beat).unwrap();
        assert_eq!((t[0], psi[0], psi[39]), (t_s[60], 60.0, 99.0));
        assert_eq!(longest_heard(&t_s, &[f64::NAN; 100]), None);
    }
}
