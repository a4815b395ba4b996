//! Standard errors that no draw shows: what the window holds of the motion and the estimate does not.

use super::{ENOUGH_HZ, rate_hz, variance};
use crate::imu::rath::Motion;
use crate::imu::track::period_s;
use crate::imu::unloading::unloadings;
use crate::inputs::{Inputs, Window, finite};
use crate::line::{Shares, rival_hz};
use crate::metrics::metrics_of;
use std::cell::OnceCell;
use std::ops::Range;

/// How far an edge of the support is moved by what smooths it, samples: 0.14 on twelve twins at 100 Hz, 0.28 in the worked example of
/// docs/field.md; below [`ENOUGH_HZ`] 0.2 to 0.65 on twenty at 50 Hz, to 0.78 on seventy at 25 to 40 Hz, and 0.7 in an hour of means over 20 ms.
const EDGE_SAMPLES: [f64; 2] = [0.3, 0.4];

/// So much of its SD has a wandering of [`WANDER_S`] between 0.2 and 0.4 Hz, as [`Beyond::slow_course_m`] sees it: ∫ of its spectrum times the difference
/// of the two gains 1/(1 + (f₀/f)⁴), squared.
const ABOVE_CORNER: f64 = 0.185;
/// Largest minus smallest of a course of SD 1 that is alike for [`WANDER_S`], in a minute: of 20 to 25 normal numbers (Tippett, Biometrika 17 (1925)).
const RANGE_OF_WANDER: f64 = 3.8;

/// A motion within a window, of which an estimate does not see all.
pub struct Beyond<'a> {
    motion: &'a Motion,
    window: Window,
    range: Range<usize>,
    period_s: f64,
    /// The height where it is known: times (s) and values (m).
    seen: (Vec<f64>, Vec<f64>),
    /// Samples of the window without a height.
    lost: usize,
    heave_hz: OnceCell<Option<f64>>,
    lost_course_m: OnceCell<f64>,
}

impl<'a> Beyond<'a> {
    /// `None` where nothing tells the sampling rate.
    pub fn of(motion: &'a Motion, window: Window) -> Option<Self> {
        let inputs = &motion.inputs;
        let range = window.range(&inputs.t_s);
        let seen = finite(&inputs.t_s[range.clone()], &inputs.height_m[range.clone()]);
        Some(Beyond {
            motion,
            window,
            period_s: period_s(&inputs.t_s)?,
            lost: range.len() - seen.0.len(),
            range,
            seen,
            heave_hz: OnceCell::new(),
            lost_course_m: OnceCell::new(),
        })
    }

    /// Standard error of a metric that no draw shows, in its own unit.
    pub fn sd(&self, name: &str) -> f64 {
        match name {
            "peak_hz" => self.peak_hz(),
            "roll_peak_hz" => self.roll_peak_hz(),
            "subharmonic_ratio" => self.subharmonic_ratio(),
            // What is slower than the corner is missing or too much.
            "dz_pp_m" => self.lost_course_m(),
            "t_float" => self.t_float(),
            "h2_ratio" => self.h2_ratio(),
            "growth_ratio" => self.growth_ratio(),
            "rms_z_m" => self.rms_z_m(),
            _ => 0.0,
        }
    }

    fn roll(&self) -> (Vec<f64>, Vec<f64>) {
        let inputs = &self.motion.inputs;
        let range = self.range.clone();
        finite(&inputs.t_s[range.clone()], &inputs.roll_rad[range])
    }

    /// Of the height's strongest line, Hz.
    fn heave_hz(&self) -> Option<f64> {
        let find = || heave_hz(&self.motion.inputs, self.window);
        *self.heave_hz.get_or_init(find)
    }

    fn peak_hz(&self) -> f64 {
        let (t_s, x) = &self.seen;
        self.line_hz(t_s, x)
    }

    fn roll_peak_hz(&self) -> f64 {
        let (t_s, x) = self.roll();
        self.line_hz(&t_s, &x)
    }

    /// Lines sit on bins of 1/T, and the estimate's T is shorter than the window's: up to half a bin each, evenly spread.
    fn line_hz(&self, t_s: &[f64], x: &[f64]) -> f64 {
        let known = self.seen.1.len();
        if known == 0 {
            return 0.0;
        }
        let bin = 0.5 / (known as f64 * self.period_s) / 3f64.sqrt() * 2f64.sqrt();
        bin.hypot(rival_hz(t_s, x) / 1.96)
    }

    /// So may the line be by which the roll's shares are told, a bin in all, or its rival: it counts where power lies at a band's edge.
    fn subharmonic_ratio(&self) -> f64 {
        let (seen_s, seen) = &self.seen;
        let bin_hz = 1.0 / (seen.len() as f64 * self.period_s);
        let off_hz = [bin_hz, bin_hz.hypot(rival_hz(seen_s, seen))];
        let (t_s, roll) = self.roll();
        let ratio = |hz: f64| {
            let shares = Shares::of(&t_s, &roll, hz)?;
            Some(shares.at_half / shares.at_f).filter(|x| x.is_finite())
        };
        let off = |hz: f64| {
            let whole = ratio(hz)?;
            let others = off_hz.into_iter().flat_map(|off| [hz - off, hz + off]);
            let others = others.filter_map(ratio);
            Some(others.map(|x| (x - whole).abs()).fold(0.0, f64::max))
        };
        self.heave_hz().and_then(off).unwrap_or(0.0) / 1.96
    }

    /// The weights 1, 2, 1 move a touch-down by a part of a sample, all of them to the same side (docs/field.md: twins at 100 and 200 Hz).
    fn t_float(&self) -> f64 {
        let inputs = &self.motion.inputs;
        if self.motion.settings.lever_m == [0.0; 3] {
            return 0.0;
        }
        let range = self.range.clone();
        let (t_s, ratio) = (&inputs.t_s[range.clone()], &inputs.support_ratio[range]);
        let length_s = t_s.len().max(1) as f64 * self.period_s;
        let edges = 2 * unloadings(t_s, ratio).len();
        let samples = EDGE_SAMPLES[usize::from(1.0 / self.period_s < ENOUGH_HZ)];
        samples * edges as f64 * self.period_s / length_s
    }

    /// The transform has no taper: each line is as high as it falls on a bin of 1/T, and the estimate's T is not the window's. While an end
    /// moves through a period, both fall everywhere. And of what is missing lines may be higher or lower.
    fn h2_ratio(&self) -> f64 {
        let bins = |hz: f64| (1..=8).map(move |k| [0.0, f64::from(k) / (8.0 * hz)]);
        let ends = without_ends(self.lost as f64 * self.period_s);
        self.heave_hz().map_or(0.0, |hz| {
            self.farthest("h2_ratio", bins(hz).chain(ends)) / 1.96
        })
    }

    /// Thirds of a window without its ends are other thirds: as far off as if as much were missing once, twice, thrice more, or as what is
    /// missing swings more or less than the rest. And thirds are whole samples. The course that is missing may be all in one of them.
    fn growth_ratio(&self) -> f64 {
        let cuts = without_ends((self.lost as f64 * self.period_s).max(super::COUNTED_S));
        let ends = self.farthest("growth_ratio", cuts) / 1.96;
        let about = centred(&self.seen.1);
        let third = about.len() / 3;
        let [first, last] = [&about[..third], &about[about.len() - third..]].map(power);
        let least = first.min(last);
        if least <= 0.0 {
            return 0.0;
        }
        let missing =
            self.lost as f64 / third as f64 * spread_of_parts(&about, self.lost) / (2.0 * least);
        let course = self.lost_course_m() / least.sqrt();
        let growth = (last / first).sqrt();
        ends.hypot(growth * missing)
            .hypot(growth * (1f64.hypot(course) - 1.0))
    }

    /// The ends have no height. Stretches of their length swing so much more or less than the whole. And a slow course is missing from it.
    fn rms_z_m(&self) -> f64 {
        let about = centred(&self.seen.1);
        let whole = power(&about);
        if whole <= 0.0 {
            return 0.0;
        }
        let spread = spread_of_parts(&about, self.lost);
        let ends = self.lost as f64 / self.range.len() as f64 * spread / (2.0 * whole.sqrt());
        ends.hypot((whole + self.lost_course_m().powi(2)).sqrt() - whole.sqrt())
    }

    /// Largest minus smallest of a course below the corner f₀ that is as large as what is found between it and 2f₀ beyond the budget's own wandering, m.
    ///
    /// Samples too slow for touch-downs fold a gait's overtones: n f comes out at |n f − f_s|, and weighs in a height as 1/f² does. So all that is
    /// slower than a quarter of a step counts then.
    fn lost_course_m(&self) -> f64 {
        *self.lost_course_m.get_or_init(|| {
            let (inputs, settings) = (&self.motion.inputs, &self.motion.settings);
            let of_budget = ABOVE_CORNER * settings.budget.height_wander_m;
            let step_hz = || heave_hz(inputs, Window::ALL);
            let quarter_hz = (rate_hz(inputs) < ENOUGH_HZ)
                .then(step_hz)
                .flatten()
                .map_or(0.0, |hz| 0.25 * hz);
            let to_hz = quarter_hz.max(2.0 * settings.height_corner_hz);
            let excess = self.slow_course_m(to_hz).powi(2) - of_budget.powi(2);
            RANGE_OF_WANDER * excess.max(0.0).sqrt()
        })
    }

    /// SD of the height between its corner and `to_hz`, m: of what the window knows of it.
    fn slow_course_m(&self, to_hz: f64) -> f64 {
        let (range, faster) = (self.range.clone(), self.motion.height_m(to_hz));
        let both = self.motion.inputs.height_m[range.clone()]
            .iter()
            .zip(&faster[range]);
        let course: Vec<f64> = both
            .filter(|(z, _)| z.is_finite())
            .map(|(z, faster)| z - faster)
            .collect();
        if course.len() < 2 {
            return 0.0;
        }
        variance(&course).sqrt()
    }

    /// How far a metric of the height goes when so much (s) is cut off the beginning and the end of what is known of it.
    fn farthest(&self, name: &str, cuts_s: impl Iterator<Item = [f64; 2]>) -> f64 {
        let (Some(first_s), Some(last_s)) = (self.seen.0.first(), self.seen.0.last()) else {
            return 0.0;
        };
        let of = |[head_s, tail_s]: [f64; 2]| {
            let window = Window {
                start_s: first_s + head_s,
                end_s: last_s - tail_s,
            };
            metrics_of(&self.motion.inputs, window, |n| n == name).number(name)
        };
        let Some(whole) = of([0.0; 2]) else {
            return 0.0;
        };
        cuts_s
            .filter_map(of)
            .map(|x| (x - whole).abs())
            .fold(0.0, f64::max)
    }
}

/// A sample less its mean.
fn centred(x: &[f64]) -> Vec<f64> {
    let mean = x.iter().sum::<f64>() / x.len().max(1) as f64;
    x.iter().map(|x| x - mean).collect()
}

/// Of the height's strongest line, Hz.
fn heave_hz(inputs: &Inputs, window: Window) -> Option<f64> {
    metrics_of(inputs, window, |n| n == "peak_hz").number("peak_hz")
}

/// Mean square.
fn power(x: &[f64]) -> f64 {
    x.iter().map(|x| x * x).sum::<f64>() / x.len().max(1) as f64
}

/// By how much the mean square of parts of so many samples differs from that of the whole, RMS; none lost differs by nothing.
pub fn spread_of_parts(x: &[f64], lost: usize) -> f64 {
    if lost == 0 || x.len() < 2 {
        return 0.0;
    }
    let whole = power(x);
    let parts = x.chunks_exact(lost.clamp(2, x.len()));
    let count = parts.len().max(1) as f64;
    let squares: f64 = parts.map(|part| (power(part) - whole).powi(2)).sum();
    (squares / count).sqrt()
}

/// What is cut off at the ends where so much is missing: as much again, twice and thrice, at either.
fn without_ends(lost_s: f64) -> impl Iterator<Item = [f64; 2]> {
    let cuts = [1.0, 2.0, 3.0].map(|k| k * lost_s);
    cuts.into_iter()
        .flat_map(|cut_s| [[cut_s, 0.0], [0.0, cut_s]])
}
