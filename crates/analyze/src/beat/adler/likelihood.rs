//! How likely phases are under Adler's equation, and what makes them most likely.

use super::dual;
use super::information::Information;
use super::unknowns::{
    BEGUN, BUILD_UP, COUPLING, ERROR, LEAST, MOST, N, NOISE, OFFSET, OWN, PULL, SHARED, place,
};
use super::walk::{Field, WINDOW, Walk};
use crate::phase::wrap;
use nalgebra::DVector;

type Dual = dual::Dual<N>;

/// Log-likelihood (priors within), its gradient, and Fisher's information.
pub struct Score {
    pub value: f64,
    pub gradient: DVector<f64>,
    pub information: Information,
}

/// What one carrier adds to them. Whole rows, though the matrix is symmetric: rows of one length are added quicker than half as many numbers.
#[derive(Default)]
struct Sums {
    value: f64,
    gradient: [f64; N],
    information: [[f64; N]; N],
}

/// The distribution of a carrier's phase, rad and rad².
#[derive(Clone, Copy)]
struct State {
    mean: Dual,
    variance: Dual,
}

impl State {
    #[inline(always)]
    fn after(self, rate: State, h: f64) -> State {
        State {
            mean: self.mean + rate.mean * h,
            variance: self.variance + rate.variance * h,
        }
    }
}

/// A measured phase, as it builds up over a window. A step detector's band shows a slow course as it is, but of noise only the mean: expected
/// is the expected phase in the middle, its variance and covariance with the phase are those of the mean (here still times its length, s).
#[derive(Clone, Copy)]
struct Window {
    middle: Dual,
    variance: Dual,
    with_phase: Dual,
}

/// No step tells so short a build-up from none, s.
const AT_ONCE_S: f64 = 0.01;

/// A climb's damping is no less, so that it is soon large where a step leads down.
const LEAST_DAMPING: f64 = 1e-3;
/// Share of a variance that a climb takes off at once at most.
const FURTHEST_OFF: f64 = 0.875;
/// A climb that is so near a summit ends on it: in ln K, ln τ, rad/s and rad, and in log-likelihood.
const BESIDE: f64 = 0.05;
const BESIDE_HIGH: f64 = 2.0;

/// Weights of a cubic through the four ends of [`WINDOW`] steps, in the middle.
const MIDDLE: [f64; WINDOW + 1] = [-0.0625, 0.5625, 0.5625, -0.0625];

impl Window {
    fn from(state: State) -> Window {
        Window {
            middle: state.mean * MIDDLE[0],
            variance: Dual::ZERO,
            with_phase: Dual::ZERO,
        }
    }

    /// With its step number `j`, of h seconds, from one state to the next, over which ∂φ/∂φ is `kept`; by the trapezoid.
    #[inline(always)]
    fn over(self, j: usize, from: State, to: State, kept: Dual, h: f64) -> Window {
        let shared = kept * from.variance;
        let both = from.variance + shared * 2.0 + to.variance;
        Window {
            middle: self.middle + to.mean * MIDDLE[j + 1],
            variance: self.variance
                + (self.with_phase + kept * self.with_phase) * h
                + both * (0.25 * h * h),
            with_phase: kept * self.with_phase + (shared + to.variance) * (0.5 * h),
        }
    }
}

/// What drives one carrier.
struct Drive {
    own: Dual,
    offset: Dual,
    noise: Dual,
    coupling: Dual,
}

impl Drive {
    /// μ̇ and Ṗ under the pull K m and the beat's phase ψ, and −∂μ̇/∂μ. Slopes are one sum each, by the chain rule: nearly all the time goes here.
    #[inline(always)]
    fn rate(&self, at: &State, pull: &Dual, psi: f64) -> (State, Dual) {
        let (p, offset) = (at.variance.value, &self.offset);
        let (sin, cos) = (offset.value - at.mean.value + psi).sin_cos();
        let share = (-0.5 * p).exp();
        let (forward, back) = (pull.value * share * sin, pull.value * share * cos);
        let by = |of_pull: f64, of_variance: f64, of_offset: f64| {
            [
                (of_pull * share, pull),
                (of_variance, &at.variance),
                (of_offset, offset),
                (-of_offset, &at.mean),
            ]
        };
        let rate = State {
            mean: self.own.with(forward, by(sin, -0.5 * forward, back)),
            variance: self.noise.with(
                -2.0 * back * p,
                by(-2.0 * p * cos, (p - 2.0) * back, 2.0 * p * forward),
            ),
        };
        let back = Dual::ZERO.with(back, by(cos, -0.5 * back, -forward));
        (rate, back)
    }

    /// What K_c times the field of everybody else adds to them.
    #[inline(always)]
    fn add_company(&self, (rate, back): &mut (State, Dual), at: &State, field: [f64; 2]) {
        let p = at.variance.value;
        let (sin, cos) = at.mean.value.sin_cos();
        let share = (-0.5 * p).exp();
        let across = share * (field[1] * cos - field[0] * sin);
        let along = share * (field[0] * cos + field[1] * sin);
        let (strength, coupling) = (self.coupling.value, &self.coupling);
        let (forward, backward) = (strength * across, strength * along);
        let by = |of_coupling: f64, of_variance: f64, of_mean: f64| {
            [
                (of_coupling, coupling),
                (of_variance, &at.variance),
                (of_mean, &at.mean),
            ]
        };
        rate.mean = rate
            .mean
            .with(forward, by(across, -0.5 * forward, -backward));
        rate.variance = rate.variance.with(
            -2.0 * backward * p,
            by(-2.0 * p * along, (p - 2.0) * backward, -2.0 * p * forward),
        );
        *back = back.with(backward, by(along, -0.5 * backward, forward));
    }

    /// One step of h seconds (Runge and Kutta), the pull and the field at its beginning, middle and end; and −∂μ̇/∂μ in its middle.
    #[inline(always)]
    fn step(
        &self,
        at: State,
        pull: &[Dual; 3],
        psi: [f64; 2],
        field: Option<&Field>,
        h: f64,
    ) -> (State, Dual) {
        let psi = [psi[0], 0.5 * (psi[0] + psi[1]), psi[1]];
        let rate = |at: State, m: usize| {
            let mut found = self.rate(&at, &pull[m], psi[m]);
            if let Some(field) = field {
                self.add_company(&mut found, &at, field[m]);
            }
            found
        };
        let (a, _) = rate(at, 0);
        let (b, back) = rate(at.after(a, 0.5 * h), 1);
        let (c, _) = rate(at.after(b, 0.5 * h), 1);
        let (d, _) = rate(at.after(c, h), 2);
        let end = at
            .after(a, h / 6.0)
            .after(b, h / 3.0)
            .after(c, h / 3.0)
            .after(d, h / 6.0);
        (end, back)
    }
}

impl Walk {
    /// Likelihood of the observations under the unknowns `x`.
    pub fn score(&self, x: &DVector<f64>) -> Score {
        let mut out = Score {
            value: 0.0,
            gradient: DVector::zeros(x.len()),
            information: Information::zero(self.phase.len()),
        };
        let shared = |k: usize| Dual::unknown(x[k], k);
        let pull = shared(PULL).exp();
        let per_s = (shared(BUILD_UP) * -1.0).exp();
        let noise = shared(NOISE).exp() + self.least_noise;
        let error = shared(ERROR).exp() + self.least_error;
        let to_come = match self.fresh {
            true => {
                let unheard_s = self.unheard_s;
                let early_s = shared(BEGUN) * (unheard_s / 12.0f64.sqrt()) + 0.5 * unheard_s;
                pull * (per_s * early_s * -1.0).exp()
            }
            false => pull * shared(BEGUN).logistic(),
        };
        // K m at the beginning, middle and end of every step: the same for all carriers. That at the beginning makes Simpson's rule, by which a step
        // weighs them, the mean over the step: a pull that is soon all there grows within one.
        let left = |t_s: f64| to_come * (per_s * -t_s.max(0.0)).exp();
        let mut at_end = left(self.t_s[0]);
        let mut grown: Vec<[Dual; 3]> = Vec::with_capacity(self.t_s.len());
        for t in self.t_s.windows(2) {
            let mean = at_end * (per_s * (t[1] - t[0])).mean_of_decay();
            let middle = left(0.5 * (t[0] + t[1]));
            at_end = left(t[1]);
            let at = [mean * 6.0 - middle * 4.0 - at_end, middle, at_end];
            grown.push(at.map(|left| pull - left));
        }
        for (c, phase) in self.phase.iter().enumerate() {
            let own = |k: usize| Dual::unknown(x[place(k, c)], k);
            let drive = Drive {
                own: own(OWN),
                offset: own(OFFSET),
                noise,
                coupling: shared(COUPLING),
            };
            let company = self.company.get(c);
            let Some(first) = phase.iter().position(|y| y.is_finite()) else {
                continue;
            };
            let behind_s = self.behind_s();
            let mut state = State {
                mean: drive.own * behind_s + phase[first],
                variance: error + noise * behind_s,
            };
            let mut window = Window::from(state);
            let mut sums = Sums::default();
            for k in first..phase.len() - 1 {
                let h = self.t_s[k + 1] - self.t_s[k];
                let psi = [self.beat[k], self.beat[k + 1]];
                let from = state;
                let mut kept = Dual::constant(1.0);
                let field = company.map(|fields| &fields[k]);
                match (self.sounds[k], field) {
                    (Some(sounds), field) if sounds || field.is_some() => {
                        let (pull, psi) = match sounds {
                            true => (&grown[k], psi),
                            false => (&[Dual::ZERO; 3], [0.0; 2]),
                        };
                        let back;
                        (state, back) = drive.step(state, pull, psi, field, h);
                        if self.measured {
                            kept = (back * -h).exp();
                        }
                        state.variance.value = state.variance.value.max(1e-12);
                    }
                    (sounds, _) => {
                        state.mean = state.mean + drive.own * h;
                        state.variance = state.variance + noise * h;
                        if sounds.is_none() {
                            state.variance = state.variance + 1.0;
                        }
                    }
                }
                let seen = phase[k + 1];
                let mut expected = (state.mean, state.variance, state.variance);
                if self.measured {
                    window = window.over(k % WINDOW, from, state, kept, h);
                    if !(k + 1).is_multiple_of(WINDOW) {
                        continue;
                    }
                    let per_s = 1.0 / (self.t_s[k + 1] - self.t_s[k + 1 - WINDOW]);
                    expected = (
                        window.middle,
                        window.variance * (per_s * per_s),
                        window.with_phase * per_s,
                    );
                }
                if seen.is_finite() {
                    state = sums.observe(state, expected, seen, error);
                }
                window = Window::from(state);
            }
            out.value += sums.value;
            for (i, row) in sums.information.iter().enumerate() {
                out.gradient[place(i, c)] += sums.gradient[i];
                out.information.add(c, i, |j| row[j]);
            }
        }
        self.add_priors(x, &mut out);
        out
    }

    /// Middle and SD of the normal priors: τ 5 s within a factor 20, σ 0.05 rad/√s and ε 0.03 rad within 50, K_c
    /// within 6 rad/s of none, a carrier's own frequency within 1.6 Hz of the beat; Δ anything. None on K.
    fn add_priors(&self, x: &DVector<f64>, out: &mut Score) {
        for k in BUILD_UP..x.len() {
            let (middle, sd) = match k {
                BUILD_UP => (1.6, 1.5),
                NOISE => (-6.0, 4.0),
                ERROR => (-7.0, 4.0),
                BEGUN if self.fresh => (0.0, 1.0),
                BEGUN => (-1.0, 2.0),
                COUPLING => (0.0, 3.0),
                _ if (k - SHARED).is_multiple_of(2) => (self.omega_rad_per_s, 5.0),
                _ => (0.0, 10.0),
            };
            // What builds up within [`AT_ONCE_S`] is there at once, and none of it less likely.
            let (at, slope) = match k {
                BUILD_UP => {
                    let build_up_s = x[k].exp();
                    let all_s = build_up_s + AT_ONCE_S;
                    (all_s.ln(), build_up_s / all_s)
                }
                _ => (x[k], 1.0),
            };
            let off = (at - middle) / sd;
            out.value -= 0.5 * off * off;
            out.gradient[k] -= off * slope / sd;
            *out.information.diagonal(k) += (slope / sd).powi(2);
        }
    }

    /// Climbs to the most likely unknowns (Fisher's scoring, damped as by Levenberg and Marquardt); K stays where it is if `held`. Ends beside a
    /// `summit` that is known.
    pub fn climb(
        &self,
        mut x: DVector<f64>,
        held: bool,
        summit: Option<&(DVector<f64>, Score)>,
    ) -> (DVector<f64>, Score) {
        let mut here = self.score(&x);
        // Along the profile of K the fall is wanted to a hundredth only.
        let enough = if held { 0.02 } else { 1e-4 };
        let mut damping = LEAST_DAMPING;
        for _ in 0..60 {
            let mut normal = here.information.clone();
            for k in 0..x.len() {
                *normal.diagonal(k) *= 1.0 + damping;
            }
            *normal.diagonal(PULL) += if held { 1e18 } else { 1e-9 };
            let Some(mut step) = normal.solve(&here.gradient) else {
                break;
            };
            let straight = step.dot(&here.gradient);
            // Scoring takes 1 − s/σ² off ln σ² where the misses say s, never more than 1 however small they are: from far, what they say.
            let falls = [NOISE, ERROR].map(|k| (k, step[k].max(-FURTHEST_OFF)));
            for (k, by) in falls.into_iter().filter(|(_, by)| *by < -0.5) {
                step[k] = (1.0 + by).ln();
            }
            // No variance falls by more than a factor of eight, nothing else moves by more than one of two or 40° at once.
            let most = |k: usize, by: f64| match k == NOISE || k == ERROR {
                true if by < 0.0 => -(1.0 - FURTHEST_OFF).ln(),
                _ => 0.7,
            };
            let far = step
                .iter()
                .enumerate()
                .map(|(k, by)| by.abs() / most(k, *by));
            let furthest = far.fold(1.0, f64::max);
            let step = step.unscale(furthest);
            let promised = straight / furthest;
            let mut there = &x + step;
            there[PULL] = there[PULL].clamp(LEAST.ln(), MOST.ln());
            let new = self.score(&there);
            let higher = new.value > here.value;
            if higher {
                (x, here) = (there, new);
                damping = (damping * 0.2).max(LEAST_DAMPING);
            } else {
                damping *= 10.0;
            }
            // Beside the summit information and curvature differ: what a step promises it need not keep.
            let enough = if higher { enough } else { 10.0 * enough };
            let known = summit.is_some_and(|summit| here.is_beside(&x, summit));
            if !(promised > enough) || damping > 1e6 || known {
                break;
            }
        }
        (x, here)
    }

    /// σ, rad/√s.
    pub fn noise(&self, x: &DVector<f64>) -> f64 {
        (x[NOISE].exp() + self.least_noise).sqrt()
    }
}

impl Score {
    /// Whether it is that of unknowns `x` beside a summit.
    fn is_beside(&self, x: &DVector<f64>, (summit, top): &(DVector<f64>, Score)) -> bool {
        let of_motion = (0..x.len()).filter(|k| ![NOISE, ERROR, BEGUN].contains(k));
        (top.value - self.value).abs() < BESIDE_HIGH
            && of_motion.fold(0.0, |far: f64, k| far.max((x[k] - summit[k]).abs())) < BESIDE
    }
}

impl Sums {
    /// Takes an observation (rad) of what is `expected`: its mean, its variance but for the error, and its covariance with the state. Gives the
    /// state after it.
    #[inline(always)]
    fn observe(
        &mut self,
        state: State,
        (mean, variance, with_phase): (Dual, Dual, Dual),
        seen: f64,
        error: Dual,
    ) -> State {
        let miss = wrap(seen - mean.value);
        let spread = variance + error;
        let inverse = spread.inverse();
        let weight = inverse.value;
        self.value -= 0.5 * (spread.value.ln() + miss * miss * weight);
        let surprise = 0.5 * (miss * miss * weight - 1.0) * weight;
        for i in 0..N {
            let (a, b) = (
                mean.slope[i] * weight,
                0.5 * spread.slope[i] * weight * weight,
            );
            self.gradient[i] += a * miss + spread.slope[i] * surprise;
            for j in 0..N {
                self.information[i][j] += a * mean.slope[j] + b * spread.slope[j];
            }
        }
        let gain = with_phase * inverse;
        let mut missed = mean * -1.0;
        missed.value = miss;
        State {
            mean: state.mean + gain * missed,
            variance: state.variance - gain * with_phase,
        }
    }
}
