//! Adler's test: what carriers would do without the beat, how strongly it pulls them, and whether that captures them.
//!
//! ```text
//! dφ_i = (ω_i + K m(t) sin(ψ + Δ_i − φ_i) + (K_c/N) Σ_j sin(φ_j − φ_i)) dt + σ dW_i
//! y_i = φ_i + e,  e normal with SD ε       Δω_i = ω_i − Ω
//! m    = 1 − a e^{−(t − t₀)/τ} while a beat sounds, else 0   a = e^{−s/τ}, s = 0 … a beat, where the beginning t₀ was heard; s = 0 if recorded; else 0 < a < 1
//! ```
//! φ_i gait phase, ψ the beat's, y_i the phase as observed (rad); t₀ the first beat, τ how long the pull grows (s); ω_i own frequency, Ω the
//! mean beat [rad/s]; K the pull once grown, the same for all [rad/s]; Δ_i where a carrier without detuning would settle (rad; a step
//! detector's offset is in it); σ phase noise [rad/√s]. For |Δω| ≤ K a carrier is captured; outside it slips.
//!
//! Between observations a carrier's phase is followed as a normal distribution of mean μ and variance P (Gaussian closure),
//! ```text
//! μ̇ = ω + K m e^{−P/2} sin(ψ + Δ − μ)       Ṗ = σ² − 2 K m e^{−P/2} cos(ψ + Δ − μ) P
//! ```
//! and put right at each as by Kalman. K, τ, σ, ε, a, ω_i, Δ_i maximise the likelihood of the innovations times wide priors, which only
//! keep within reason what the phases do not tell. A regression of increments on phases would take noise that stands on both sides for
//! a pull, or a pull for noise; this does not. What is walked before the first beat says ω_i; how carriers come to the beat, slip past it,
//! or wander about it says K. Who has settled before anybody looked says |Δω| ≤ K, and by wandering √(K² − Δω²) at most: the interval is open upwards then.
//! What carriers do to each other is K_c [rad/s], from everybody to everybody alike, with the others' phases as they were observed. It is
//! always looked for: left out, a pull of 2.7 beside a coupling of 0.5 came out as 3.5. Carriers whom a coupling holds together before the
//! music (K_c beyond their detunings' difference) do not show both apart. Measured phases of steady walkers err by more than these wander, and
//! a coupling of 1 or more is then found too weak, and the detunings with it; where all have settled unseen, such phases err by more than √(K² − Δω²) lets
//! them wander, and tell neither K nor K_c. Whether one K and one K_c say all that recorded phases do is tested:
//! σ, which takes up what they leave, must be the σ that second differences over a tenth of a second show.
//! Source: R. Adler, Proc. IRE 34 (1946) 351; Pikovsky, Rosenblum & Kurths, Synchronization (2001), ch. 7 and 9;
//! Särkkä, Bayesian Filtering and Smoothing (2013), ch. 9 and 12.

mod company;
mod dual;
mod information;
mod likelihood;
#[cfg(test)]
mod tests;
pub(crate) mod turns;
mod unknowns;
mod walk;

use crate::inputs::Inputs;
use crate::phase::wrap;
use crate::spectrum::chi_square_quantile;
use likelihood::Score;
use nalgebra::DVector;
use rayon::prelude::*;
use unknowns::{BUILD_UP, COUPLING, LEAST, MOST, OFFSET, OWN, PULL, place};
use walk::{Shown, Walk};

/// What phases and a beat say of the pull.
#[derive(Clone, Debug, PartialEq)]
pub struct Adler {
    /// K, rad/s; of no meaning where its interval is open.
    pub pull_rad_per_s: f64,
    /// Ends of its 95 % interval, rad/s: the lower is 0 where no pull is seen, the upper infinite where any stronger one explains the
    /// phases as well.
    pub pull_ci95_rad_per_s: [f64; 2],
    /// τ, s.
    pub build_up_s: f64,
    /// σ, rad/√s.
    pub noise_rad_per_sqrt_s: f64,
    /// Δω of each carrier, positive where alone it would be faster than the beat, rad/s.
    pub detuning_rad_per_s: Vec<f64>,
    /// Half the 95 % interval of each, rad/s; infinite where nobody saw how a carrier came to the beat.
    pub detuning_half_rad_per_s: Vec<f64>,
    /// Δ of each carrier, −π … π, rad.
    pub offset_rad: Vec<f64>,
    /// K_c with half its 95 % interval, rad/s; `None` of one carrier.
    pub coupling_rad_per_s: Option<[f64; 2]>,
    /// Ω, from which the detunings are counted, rad/s.
    pub beat_rad_per_s: f64,
    /// σ as recorded phases show it within a tenth of a second, where it can be told apart from what draws them, rad/√s.
    pub shown: Option<Shown>,
}

/// A fit that leaves more than the noise that the phases show by so many of its standard errors leaves more than noise.
const MORE_THAN_NOISE: f64 = 3.0;
/// What the closure, the grid and the least σ leave of any phases, rad/√s.
const LEFT_RAD_PER_SQRT_S: f64 = 6e-4;
/// Pulls that draw a phase by more than this share of its distance within the lag are not told from noise.
const DRAWN: f64 = 0.3;

impl Adler {
    /// [`adler`] on a recording's columns.
    ///
    /// # Errors
    /// As there.
    pub fn of(inputs: &Inputs) -> Result<Self, &'static str> {
        let phases: Vec<&[f64]> = inputs.phase_rad.iter().map(|p| &p[..]).collect();
        let beat = &inputs.beat_phase_rad;
        adler(
            inputs.phase_times(),
            &phases,
            beat,
            inputs.phases_are_measured,
        )
    }

    /// What does not go with Adler's equation, in a sentence: carriers whom the beat pulls unequally, who mind some more than others, or do anything
    /// else that one K and one K_c for all cannot say. Numbers are then those of the nearest that can, and their intervals hold nothing.
    pub fn strained(&self) -> Option<String> {
        let (left, shown) = (self.noise_rad_per_sqrt_s, self.shown?);
        let most = shown.noise * (1.0 + MORE_THAN_NOISE * shown.error);
        let most = most.hypot(LEFT_RAD_PER_SQRT_S);
        (left > most).then(|| format!(
            "carriers do more than follow one beat with one pull and mind all others alike, which leaves {left:.4} rad/√s where the phases wander by {:.4} within a tenth of a second",
            shown.noise
        ))
    }

    /// Whether every |Δω| ≤ K; `None` where K is not known.
    pub fn inside(&self) -> Option<bool> {
        let within = |d: &f64| d.abs() <= self.pull_rad_per_s;
        let known = self.pull_ci95_rad_per_s[1].is_finite();
        known.then(|| self.detuning_rad_per_s.iter().all(within))
    }
}

/// Fall of the log-likelihood at the ends of a 95 % interval: half of χ² with one degree of freedom.
const FALL: f64 = 1.9207;
/// Intervals of ln K narrower than this are those of a normal distribution (standard error).
const NARROW: f64 = 0.1;
/// An own frequency or a coupling that is known no better is not known, rad/s: own paces scatter by a third of it.
pub const VAGUE_RAD_PER_S: f64 = 1.0;
/// Log-likelihoods that differ by less are one summit, climbed from two sides.
const SAME: f64 = 0.1;
/// What a step detector bends the phase by within the stretch before the first beat, SD by twins, rad.
const BENT_RAD: f64 = 0.01;
/// What its band takes from a coupling or adds to it, SD by twenty twins of 0.5 rad/s, rad/s.
const COUPLING_LOST_RAD_PER_S: f64 = 0.03;

/// Adler's test on gait phases and a beat's phase (rad, wrapped or not; NaN where there is none) at ascending times (s).
///
/// `measured`: phases were found from steps, which a band has smoothed, and not recorded as such. From a minute before the first
/// beat to one and a half after it, whatever comes later.
///
/// # Errors
/// As a sentence: no beat, too little walked about its beginning, or steps of carriers who had all settled before.
pub fn adler(
    t_s: &[f64],
    phase_rad: &[&[f64]],
    beat_rad: &[f64],
    measured: bool,
) -> Result<Adler, &'static str> {
    let mut walk = Walk::new(t_s, phase_rad, beat_rad, measured)?;
    let unseen = walk.came_unseen();
    if measured && !unseen.contains(&false) {
        return Err(walk::UNSEEN);
    }
    let settled = unseen.contains(&true);
    walk.company = company::company(&walk);
    let (x, best) = walk.highest()?;
    let cover = best.information.variances().ok_or(walk::TOO_LITTLE)?;
    let carriers = walk.phase.len();
    let bent = match walk.before_s > 0.0 && measured {
        true => BENT_RAD / walk.before_s,
        false => 0.0,
    };
    let lost = match walk.measured {
        true => COUPLING_LOST_RAD_PER_S,
        false => 0.0,
    };
    let own: Vec<usize> = (0..carriers).map(|c| place(OWN, c)).collect();
    let sd = cover[PULL].max(0.0).sqrt();
    let mut ends = [false, true].map(|up| walk.end(&x, best.value, sd, up));
    // At its limit the search tells no pull from a stronger one.
    if settled || ends[1] >= MOST {
        ends[1] = f64::INFINITY;
    }
    let half = |variance: f64| {
        if settled {
            f64::INFINITY
        } else {
            half_of(variance).hypot(1.96 * bent)
        }
    };
    let found = Adler {
        pull_rad_per_s: x[PULL].exp(),
        pull_ci95_rad_per_s: ends,
        build_up_s: x[BUILD_UP].exp(),
        noise_rad_per_sqrt_s: walk.noise(&x),
        detuning_rad_per_s: own.iter().map(|k| x[*k] - walk.omega_rad_per_s).collect(),
        detuning_half_rad_per_s: own.iter().map(|k| half(cover[*k])).collect(),
        coupling_rad_per_s: (carriers > 1)
            .then(|| [x[COUPLING], half_of(cover[COUPLING]).hypot(1.96 * lost)]),
        offset_rad: (0..carriers).map(|c| wrap(x[place(OFFSET, c)])).collect(),
        beat_rad_per_s: walk.omega_rad_per_s,
        shown: walk
            .shown
            .filter(|shown| shown.lag_s * (x[PULL].exp() + x[COUPLING].abs()) < DRAWN),
    };
    let finite = best.value.is_finite() && cover.iter().all(|c| c.is_finite());
    finite.then_some(found).ok_or(walk::TOO_LITTLE)
}

/// Half a 95 % interval.
fn half_of(variance: f64) -> f64 {
    1.96 * variance.max(0.0).sqrt()
}

impl Walk {
    /// The highest summit that is climbed to.
    fn highest(&self) -> Result<(DVector<f64>, Score), &'static str> {
        let [first, others @ ..] = self.starts()?;
        let first = self.climb(first, false, None);
        let others: Vec<_> = (others.into_par_iter())
            .map(|start| self.climb(start, false, Some(&first)))
            .collect();
        let higher =
            |highest: (DVector<f64>, Score), other: (DVector<f64>, Score)| match other.1.value
                > highest.1.value + SAME
                || !highest.1.value.is_finite()
            {
                true => other,
                false => highest,
            };
        Ok(others.into_iter().fold(first, higher))
    }

    /// An end of the interval of K: where the likelihood, at its best over all else, has fallen by [`FALL`].
    fn end(&self, best: &DVector<f64>, top: f64, sd: f64, up: bool) -> f64 {
        let sign = if up { 1.0 } else { -1.0 };
        if sd < NARROW {
            return (best[PULL] + sign * 1.96 * sd).exp();
        }
        let fallen = |x: DVector<f64>| {
            let (x, found) = self.climb(x, true, None);
            (x, (top - found.value).max(0.0))
        };
        if !up {
            let mut none = best.clone();
            none[PULL] = LEAST.ln();
            // Without a pull there are no offsets either, one for each carrier: as many degrees of freedom more.
            if 2.0 * fallen(none).1 < chi_square_quantile(0.95, 1.0 + self.phase.len() as f64) {
                return 0.0;
            }
        }
        let stride = sign * sd.min(0.3);
        let (mut x, mut before) = (best.clone(), 0.0);
        loop {
            x[PULL] += stride;
            if x[PULL] > MOST.ln() {
                return f64::INFINITY;
            }
            if x[PULL] < LEAST.ln() {
                return 0.0;
            }
            let (next, fall) = fallen(x);
            x = next;
            if fall > FALL {
                // √fall is straight in ln K where the likelihood is normal.
                let share = (fall.sqrt() - FALL.sqrt()) / (fall.sqrt() - f64::sqrt(before));
                return (x[PULL] - share * stride).exp();
            }
            before = fall;
        }
    }
}
