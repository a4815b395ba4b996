//! Phases and beat about the first beat, on the grid of Adler's equation.

use super::turns::{COUNTED_S, FOLDED, Turns};
use super::unknowns::{BUILD_UP, ERROR, NOISE, OFFSET, OWN, PULL, SHARED, place};
use crate::beat::smooth::smooth;
use crate::imu::track::period_s;
use crate::inputs::placed;
use crate::median::median;
use nalgebra::{DVector, Matrix3, Vector3};
use std::f64::consts::TAU;
use std::ops::Range;

/// Step of the equation, s: short for any pull that is looked for.
const STEP_S: f64 = 0.2;
/// Who slips past the beat does not slip further in a step, rad, where phases come as often.
const SLIP_RAD: f64 = 0.25;
/// A measured phase is of so many steps: a mean over 0.6 s passes half of what modulates it at 1 Hz, and so does the band of a step detector,
/// which reaches from 0.6 to 1.5 of a cadence about 2 Hz.
pub const WINDOW: usize = 3;
/// What is looked at before and after the first beat, s.
const BEFORE_S: f64 = 60.0;
const AFTER_S: f64 = 90.0;
/// A beat that lasts no longer is a tap or a trial, of which nobody knows how it pulled, s.
const SHORTEST_S: f64 = 4.0;
/// So long, and as long as a beat, it is silent before the first beat where carriers were seen alone, s.
const SILENT_S: f64 = 1.0;
/// Who is first seen so long after the first beat may have come to it unseen, s.
const LATE_S: f64 = 5.0;
/// A measured phase is that of an analytic signal, wrong so near its ends, s.
const ENDS_S: f64 = 2.0;
/// Least σ [rad/√s] and ε (rad) believed: of any phases, and of measured ones, which a band has smoothed. Nobody walks more steadily than
/// the archive's carriers, and a twin's detector errs by about as much.
const LEAST: [f64; 2] = [5e-4, 5e-4];
const LEAST_MEASURED: [f64; 2] = [0.01, 0.01];
/// A pull that overshoots nothing, rad/s.
const MODERATE: f64 = 2.0;
/// A step so many times as long as usual is of messages that were lost.
const LOST: f64 = 1.5;
/// Times so near to each other are the same, in steps.
const ROUNDING: f64 = 1e-6;
/// Fewer phases say nothing.
const FEWEST: usize = 20;

pub const TOO_LITTLE: &str = "too little is walked about the first beat";
pub const UNSEEN: &str = "nobody saw how the carriers came to the beat, and steps do not show how closely they follow it";

/// What a carrier sees of the others, (1/N) Σ_{j≠i} e^{iφ_j}, real and imaginary, at the beginning, in the middle and at the end of a step. Who is
/// not seen is not in it.
pub type Field = [[f64; 2]; 3];

/// Phases and beat on the grid.
pub struct Walk {
    /// Since the first beat, s.
    pub t_s: Vec<f64>,
    /// ψ, unwrapped, NaN where no beat sounds, rad.
    pub beat: Vec<f64>,
    /// y of each carrier, NaN where it is not looked at, rad; a measured one is that in the middle of the window that ends there.
    pub phase: Vec<Vec<f64>>,
    /// Whether a beat sounds over each step; `None` where nobody knows how much it pulled: it begins or ends there, or is a tap or a trial.
    pub sounds: Vec<Option<bool>>,
    /// What each carrier sees of the others, step by step; empty where that does not count.
    pub company: Vec<Vec<Field>>,
    /// Whether phases were measured.
    pub measured: bool,
    /// Whether the beginning of the beat is in the recording.
    pub begins: bool,
    /// Whether the pull begins there too: nothing had sounded before.
    pub fresh: bool,
    /// So long before the first beat the pull may have begun unheard, s: a beat where beats are heard, a sample where their phase is recorded.
    pub unheard_s: f64,
    /// How long carriers are observed before it, s.
    pub before_s: f64,
    /// Ω, rad/s.
    pub omega_rad_per_s: f64,
    /// σ as recorded phases show it within a tenth of a second, whatever draws them slowly.
    pub shown: Option<Shown>,
    /// Least σ², rad²/s.
    pub least_noise: f64,
    /// Least ε², rad².
    pub least_error: f64,
}

/// Lags that differ by less than this share of a step are of one length.
const EVEN: f64 = 0.01;
/// The median of a normal distribution's magnitude, in its SD.
const MEDIAN: f64 = 0.6745;

/// The longer of two lags, s: slow enough for noise that has a memory of its own, fast enough for most pulls.
const LAG_S: f64 = 0.1;

/// Farther from nought, in SDs, is no noise: a beat's beginning, a slip. What a normal distribution has within is this share of its variance.
const TRIM: [f64; 2] = [3.0, 0.9733];
/// Variances over a longer lag that grow by so much more than noise without a memory are of noise with one, or of no noise.
const REMEMBERS: f64 = 1.2;

/// σ within a tenth of a second.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Shown {
    /// rad/√s.
    pub noise: f64,
    /// Its relative standard error, about.
    pub error: f64,
    /// The longer lag that it is seen over, s.
    pub lag_s: f64,
}

/// σ by the second differences of phases at two lags; `None` where noise has a memory longer than the shorter.
///
/// ```text
/// var(y(t + h) − 2 y(t) + y(t − h)) = 2σ²(h − T/2) + 6ε²
/// ```
/// of a Wiener process that is interpolated between steps T ≤ h and observed with an error ε: its slope in h is 2σ², whatever T and ε. A smooth
/// course adds one of order h⁴. Variances are those within three SDs of nought, of each carrier; σ² is their mean.
fn shown_noise(t_s: &[f64], phases: &[Vec<f64>], step_s: f64) -> Option<Shown> {
    let long = (LAG_S / step_s).round().max(2.0) as usize;
    let hops = [long / 2, long];
    let lag_s = hops[1] as f64 * step_s;
    let mut count = 0;
    let mut variance = |y: &[f64], hop: usize| {
        let span_s = 2.0 * hop as f64 * step_s;
        let even = |k: &usize| (t_s[k + 2 * hop] - t_s[*k] - span_s).abs() < EVEN * step_s;
        let places = (0..t_s.len().saturating_sub(2 * hop)).filter(even);
        let bends = places.map(|k| (y[k + 2 * hop] - 2.0 * y[k + hop] + y[k]).abs());
        let mut bends: Vec<f64> = bends.filter(|x| x.is_finite()).collect();
        count += bends.len();
        let usual = median(&mut bends)? / MEDIAN;
        let near = || bends.iter().filter(|x| **x < TRIM[0] * usual);
        let n = near().count();
        let squares: f64 = near().map(|x| x * x).sum();
        (n >= FEWEST).then_some(squares / (TRIM[1] * n as f64))
    };
    let grows = hops[1] as f64 / hops[0] as f64;
    let mut sum = 0.0;
    for y in phases {
        let [short, long] = [variance(y, hops[0])?, variance(y, hops[1])?];
        if long > REMEMBERS * (2.0 * grows - 1.0) * short {
            return None;
        }
        sum += (long - short).max(0.0) / (2.0 * (hops[1] - hops[0]) as f64 * step_s);
    }
    // Differences that overlap tell less than as many that do not.
    let apart = 0.5 * count as f64 / hops[1] as f64;
    Some(Shown {
        noise: (sum / phases.len() as f64).sqrt(),
        error: (0.75 / apart).sqrt(),
        lag_s,
    })
}

impl Walk {
    /// Onto the grid; errors as [`super::adler`].
    pub fn new(
        t_s: &[f64],
        phase_rad: &[&[f64]],
        beat_rad: &[f64],
        measured: bool,
    ) -> Result<Self, &'static str> {
        let n = t_s.len();
        if beat_rad.len() != n || phase_rad.iter().any(|p| p.len() != n) {
            return Err("no beat");
        }
        let onset = onset(t_s, beat_rad, |_| false)?;
        let from = t_s.partition_point(|t| *t < t_s[onset] - BEFORE_S);
        let to = t_s.partition_point(|t| *t <= t_s[onset] + AFTER_S);
        let first_heard = !beat_rad[..onset].iter().any(|b| b.is_finite());
        let t_s = &t_s[from..to];
        let cut = |x: &[f64]| -> Result<(Vec<f64>, Turns), &'static str> {
            let turns = Turns::of(t_s, &x[from..to]);
            match turns.folded() {
                true => Err(FOLDED),
                false => Ok((turns.straightened(t_s, &x[from..to]), turns)),
            }
        };
        let (beat, turns) = cut(beat_rad)?;
        let phases: Result<Vec<Vec<f64>>, _> = phase_rad.iter().map(|p| Ok(cut(p)?.0)).collect();
        let phases = phases?;
        let step_s = period_s(t_s).ok_or(TOO_LITTLE)?;
        let shown = (!measured).then(|| shown_noise(t_s, &phases, step_s));
        let seen = |walk| Walk {
            shown: shown.flatten(),
            ..walk
        };
        let parts = (step_s / STEP_S).round().max(1.0);
        // Whoever recorded phases saw the beat as seldom: it may have begun anywhere in the sample before.
        let unheard = match measured && parts == 1.0 {
            true => 0,
            false => parts as usize,
        };
        if parts == 1.0 && t_s.windows(2).all(|t| t[1] - t[0] <= LOST * step_s) {
            let played = Played {
                beat,
                lost: vec![false; t_s.len()],
            };
            return Walk::on(t_s, &phases, played, measured, first_heard, unheard).map(seen);
        }
        if (t_s[t_s.len() - 1] - t_s[0]) / step_s + 1.0 > 2.0 * t_s.len() as f64 {
            return Err(TOO_LITTLE);
        }
        // Nor does anybody know where in messages that were lost.
        let before_s = t_s[onset - from] - t_s[(onset - from).saturating_sub(1)];
        let unheard = match before_s > LOST * step_s {
            true => (before_s / step_s * parts).ceil() as usize,
            false => unheard,
        };
        let longest_s = LOST * step_s;
        let step_s = step_s / parts;
        let phases: Vec<Vec<f64>> = phases
            .iter()
            .map(|p| placed(t_s, p, step_s, f64::NAN))
            .collect();
        let places = phases.first().map_or(0, Vec::len);
        let even: Vec<f64> = (0..places).map(|k| t_s[0] + k as f64 * step_s).collect();
        let played = Played::on(t_s, &beat, &turns, longest_s, &even);
        Walk::on(&even, &phases, played, measured, first_heard, unheard).map(seen)
    }

    /// On an even axis; phases straightened; over so many of its steps before the first beat nobody knows whether it sounds.
    fn on(
        t_s: &[f64],
        phase_rad: &[Vec<f64>],
        played: Played,
        measured: bool,
        first_heard: bool,
        unheard: usize,
    ) -> Result<Self, &'static str> {
        let beat_rad = &played.beat;
        let onset = onset(t_s, beat_rad, |k| played.lost[k])?;
        let step_s = period_s(t_s).ok_or(TOO_LITTLE)?;
        let longest_s = match measured {
            true => STEP_S,
            false => STEP_S.min(SLIP_RAD / fastest_slip_rad_per_s(t_s, phase_rad, beat_rad)),
        };
        let hop = (longest_s / step_s).round().max(1.0) as usize;
        let first = onset % hop;
        let pick = |x: &[f64]| -> Vec<f64> { x.iter().step_by(hop).copied().collect() };
        let t: Vec<f64> = pick(&t_s[first..]).iter().map(|t| t - t_s[onset]).collect();
        let mut beat = pick(&beat_rad[first..]);
        beat[..(onset - first) / hop].fill(f64::NAN);
        let sounds: Vec<Option<bool>> = (first..t_s.len().saturating_sub(hop))
            .step_by(hop)
            .map(|k| match k < onset {
                true => played
                    .sounding(k..onset.min(k + hop + 1))
                    .filter(|sounds| !sounds && onset - k >= hop + unheard),
                false => played.sounding(k..k + hop + 1),
            })
            .collect();
        let silent_to_s = -(unheard as f64 - 0.5) * step_s;
        let tried_s: f64 = (t.windows(2).zip(&sounds))
            .filter(|(t, sounds)| t[1] < silent_to_s && sounds.is_none())
            .map(|(t, _)| t[1] - t[0])
            .sum();
        let observed = |p: &Vec<f64>| match measured {
            true => in_windows(&t_s[first..], &p[first..], hop),
            false => pick(&p[first..]),
        };
        let mut phase: Vec<Vec<f64>> = phase_rad.iter().map(observed).collect();
        if !measured {
            dated_by_the_beat(&t, &mut beat, &mut phase);
        }
        let omega_rad_per_s = mean_rate(&t, &beat);
        let latest = phase
            .iter()
            .map(|p| p.iter().position(|y| y.is_finite()).map_or(0.0, |k| t[k]))
            .fold(f64::MIN, f64::max);
        let [noise, error] = if measured { LEAST_MEASURED } else { LEAST };
        let begins = t[0] + tried_s <= -SILENT_S.max(TAU / omega_rad_per_s);
        Ok(Walk {
            begins,
            fresh: begins && first_heard,
            unheard_s: match measured {
                true => (TAU / omega_rad_per_s).max(unheard as f64 * step_s),
                false => unheard as f64 * step_s,
            },
            before_s: -latest.min(0.0),
            omega_rad_per_s,
            least_noise: noise * noise,
            least_error: error * error,
            measured,
            company: Vec::new(),
            shown: None,
            t_s: t,
            beat,
            sounds,
            phase,
        })
    }

    /// How long ago an observed phase was, s.
    pub fn behind_s(&self) -> f64 {
        if self.measured {
            0.5 * WINDOW as f64 * STEP_S
        } else {
            0.0
        }
    }

    /// Of each carrier, whether it is with the beat, never a turn past it, and nobody saw how that came: without the music's beginning, or first seen
    /// long after it. Any own frequency then goes with any pull that makes up for it, and a pull that still grows looks like one that is weak.
    pub fn came_unseen(&self) -> Vec<bool> {
        let unseen = |phase: &Vec<f64>| {
            let mut seen = phase.iter().zip(&self.t_s).filter(|(y, _)| y.is_finite());
            let late = seen.next().is_some_and(|(_, t)| *t > LATE_S);
            let behind = phase.iter().zip(&self.beat).map(|(y, b)| y - b);
            let (low, high) = behind
                .filter(|d| d.is_finite())
                .fold((f64::MAX, f64::MIN), |(a, b), d| (a.min(d), b.max(d)));
            (late || !self.begins) && high - low < TAU
        };
        self.phase.iter().map(unseen).collect()
    }

    /// Where the climb begins. Once near what the increments say; where a pull is soon all there, or carriers come from far behind, these lead to a summit
    /// beside the highest, so once more without offsets and with so much noise that the phases may be anywhere; and where even these overshoot, from a
    /// moderate pull that is soon all there, or late.
    pub fn starts(&self) -> Result<[DVector<f64>; 4], &'static str> {
        let near = self.start(&[2.0, 10.0])?;
        let mut anywhere = self.start(&[1.0])?;
        anywhere[NOISE] = 0.0;
        anywhere[ERROR] = 2.0 * 0.2f64.ln();
        (0..self.phase.len()).for_each(|c| anywhere[place(OFFSET, c)] = 0.0);
        let [soon, late] = [0.1f64, 10.0].map(|build_up_s| {
            let mut x = near.clone();
            x[PULL] = MODERATE.ln();
            x[BUILD_UP] = build_up_s.ln();
            (0..self.phase.len()).for_each(|c| x[place(OFFSET, c)] = 0.0);
            x
        });
        Ok([near, anywhere, soon, late])
    }

    /// Increments of each phase on the sines at their beginning, by least squares, for the build-up of these that fits best.
    fn start(&self, built_up_s: &[f64]) -> Result<DVector<f64>, &'static str> {
        // How far the beat goes from the middle of a window to its end.
        let late = self.behind_s() * self.omega_rad_per_s;
        let mut best: Option<(f64, DVector<f64>)> = None;
        for &build_up_s in built_up_s {
            let mut x = DVector::zeros(SHARED + 2 * self.phase.len());
            let (mut squares, mut pull) = (0.0, 0.0);
            for (c, phase) in self.phase.iter().enumerate() {
                let seen: Vec<usize> = (0..phase.len()).filter(|k| phase[*k].is_finite()).collect();
                let told = |k: &&[usize]| self.sounds[k[0]..k[1]].iter().all(Option::is_some);
                let rows: Vec<(Vector3<f64>, f64, f64)> = seen
                    .windows(2)
                    .filter(told)
                    .map(|k| {
                        let (a, b) = (k[0], k[1]);
                        let m = -(-self.t_s[a].max(0.0) / build_up_s).exp_m1();
                        let (sin, cos) = match self.beat[a] - phase[a] - late {
                            behind if behind.is_finite() => behind.sin_cos(),
                            _ => (0.0, 0.0),
                        };
                        let row = Vector3::new(1.0, m * sin, m * cos);
                        (row, phase[b] - phase[a], self.t_s[b] - self.t_s[a])
                    })
                    .collect();
                if rows.len() < FEWEST {
                    return Err(TOO_LITTLE);
                }
                let mut normal = Matrix3::identity() * 1e-3;
                let mut right = Vector3::zeros();
                for (row, turn, dt) in &rows {
                    normal += row * row.transpose() * *dt;
                    right += row * *turn;
                }
                let w = normal.try_inverse().ok_or(TOO_LITTLE)? * right;
                let miss = |(row, turn, dt): &(Vector3<f64>, f64, f64)| {
                    (turn - w.dot(row) * dt).powi(2) / dt
                };
                squares += rows.iter().map(miss).sum::<f64>();
                pull += w[1].hypot(w[2]) / self.phase.len() as f64;
                x[place(OWN, c)] = w[0];
                x[place(OFFSET, c)] = w[2].atan2(w[1]);
            }
            x[PULL] = pull.clamp(0.2, 4.0).ln();
            x[BUILD_UP] = f64::ln(build_up_s);
            x[NOISE] = 2.0 * 0.05f64.ln();
            x[ERROR] = 2.0 * 0.03f64.ln();
            if best.as_ref().is_none_or(|b| squares < b.0) {
                best = Some((squares, x));
            }
        }
        best.map(|b| b.1)
            .filter(|x| x.iter().all(|x| x.is_finite()))
            .ok_or(TOO_LITTLE)
    }
}

/// Where a beat begins that lasts, as far as anybody knows who did not hear it where it is `lost`.
fn onset(
    t_s: &[f64],
    beat_rad: &[f64],
    lost: impl Fn(usize) -> bool,
) -> Result<usize, &'static str> {
    let mut begun: Option<usize> = None;
    for (k, psi) in beat_rad.iter().enumerate().filter(|(k, _)| !lost(*k)) {
        match (begun, psi.is_finite()) {
            (_, false) => begun = None,
            (None, true) => begun = Some(k),
            (Some(first), true) if t_s[k] - t_s[first] >= SHORTEST_S => return Ok(first),
            _ => {}
        }
    }
    Err("no beat that lasts for 4 s")
}

/// How fast a carrier slips past the beat on average, whoever does it fastest, rad/s.
fn fastest_slip_rad_per_s(t_s: &[f64], phase_rad: &[Vec<f64>], beat_rad: &[f64]) -> f64 {
    let of = |phase: &Vec<f64>| {
        let behind: Vec<f64> = phase.iter().zip(beat_rad).map(|(y, b)| b - y).collect();
        mean_rate(t_s, &behind).abs()
    };
    // What is never seen has no rate, and is not the fastest.
    phase_rad.iter().map(of).fold(0.0, f64::max)
}

/// Mean rate of a phase over the steps at both ends of which it is known, rad/s; NaN without one.
fn mean_rate(t_s: &[f64], phase_rad: &[f64]) -> f64 {
    let (mut seen_s, mut turned) = (0.0, 0.0);
    for (t, phase) in t_s.windows(2).zip(phase_rad.windows(2)) {
        if phase[0].is_finite() && phase[1].is_finite() {
            seen_s += t[1] - t[0];
            turned += phase[1] - phase[0];
        }
    }
    turned / seen_s
}

/// Recorded phases and the beat's share a message, and what it comes late by: the beat's phase off its slow course tells that.
fn dated_by_the_beat(t_s: &[f64], beat: &mut [f64], phase: &mut [Vec<f64>]) {
    let mut start = 0;
    for end in 1..=beat.len() {
        if end < beat.len() && beat[end].is_finite() == beat[start].is_finite() {
            continue;
        }
        if beat[start].is_finite() {
            let (course, _) = smooth(&t_s[start..end], &beat[start..end]);
            for (k, psi) in (start..end).zip(course) {
                phase.iter_mut().for_each(|y| y[k] += psi - beat[k]);
                beat[k] = psi;
            }
        }
        start = end;
    }
}

/// The beat on an even axis.
struct Played {
    /// Its phase, rad; NaN where none sounds, and in holes longer than [`COUNTED_S`].
    beat: Vec<f64>,
    /// Where messages were lost that would have told whether one sounds.
    lost: Vec<bool>,
}

impl Played {
    /// Through messages that were lost between two of a beat it goes on at its usual rate, to the nearest turn, where it comes wrapped. Steps longer
    /// than `longest_s` lost some: what is so long that turns are not counted, or between a beat and none, may have been either.
    fn on(t_s: &[f64], beat_rad: &[f64], turns: &Turns, longest_s: f64, even: &[f64]) -> Self {
        let mut beat = vec![f64::NAN; even.len()];
        let mut lost = vec![false; even.len()];
        let mut k = 0;
        for (t, b) in t_s.windows(2).zip(beat_rad.windows(2)) {
            let width = t[1] - t[0];
            let turned = turns.over(width, b[1] - b[0]);
            let goes_on = b[0].is_finite() == b[1].is_finite() && width <= COUNTED_S;
            while k < even.len() && even[k] <= t[1] {
                let share = (even[k] - t[0]) / width;
                // At a sample it is that sample, also where there is none beside it.
                if share < ROUNDING {
                    beat[k] = b[0];
                } else if share > 1.0 - ROUNDING {
                    beat[k] = b[1];
                } else if goes_on {
                    beat[k] = b[0] + share * turned;
                } else {
                    lost[k] = width > longest_s;
                }
                k += 1;
            }
        }
        Played { beat, lost }
    }

    /// Whether a beat sounds at all of some samples or at none; `None` if only at some, or if nobody knows.
    fn sounding(&self, samples: Range<usize>) -> Option<bool> {
        let (beat, lost) = (&self.beat[samples.clone()], &self.lost[samples]);
        let sounds = beat.first().is_some_and(|psi| psi.is_finite());
        let alike = beat.iter().all(|psi| psi.is_finite() == sounds);
        (alike && !lost.contains(&true)).then_some(sounds)
    }
}

/// A measured phase in the middle of each window, at the step on which the window ends; NaN between them and near the phase's ends.
fn in_windows(t_s: &[f64], phase: &[f64], hop: usize) -> Vec<f64> {
    let mut out = vec![f64::NAN; phase.len().div_ceil(hop)];
    let seen = |k: &usize| phase[*k].is_finite();
    let ends = (0..phase.len())
        .find(seen)
        .zip((0..phase.len()).rfind(seen));
    let Some((first, last)) = ends else {
        return out;
    };
    let inner = t_s[first] + ENDS_S..=t_s[last] - ENDS_S;
    for end in (WINDOW..out.len()).step_by(WINDOW) {
        let middle = end * hop - WINDOW * hop / 2;
        if inner.contains(&t_s[middle]) {
            out[end] = phase[middle];
        }
    }
    out
}
