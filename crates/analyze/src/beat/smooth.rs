//! A course that changes slowly, from points that err each by itself: the cubic smoothing spline that makes them most likely.
//!
//! ```text
//! d²x/du² = √q w,  w white noise        y_k = x(u_k) + e_k,  e_k normal with variance r
//! ```
//! u counted in mean steps. Its mean given all points is the spline; q/r maximises the likelihood of the innovations of a Kalman filter. Where
//! the points do not err it runs through them.
//! Source: G. Wahba, J. R. Stat. Soc. B 40 (1978) 364; Kohn & Ansley, Biometrika 74 (1987) 33.

use nalgebra::{Matrix2, Vector2};

/// Fewer points show no error.
const FEWEST: usize = 6;
/// Variance of a state of which nothing is known, in those of a point's error.
const UNKNOWN: f64 = 1e9;
/// q/r looked at: so many to a factor of ten between the ends.
const RATIOS: (i32, i32, f64) = (-16, 4, 2.0);
/// Errors below this share of the points' range are none.
const NONE: f64 = 1e-15;

/// What a filter knows at one point.
struct Known {
    ahead: (Vector2<f64>, Matrix2<f64>),
    after: (Vector2<f64>, Matrix2<f64>),
    /// From this point to the next.
    step: Matrix2<f64>,
}

/// `x` at the ascending places `u` without the points' own errors, and their SD; as it is where there are too few to tell them from a course,
/// which is then taken as straight from each to the next but one.
pub fn smooth(u: &[f64], x: &[f64]) -> (Vec<f64>, f64) {
    let n = u.len();
    let bends = x
        .windows(3)
        .map(|x| (x[0] - 2.0 * x[1] + x[2]).powi(2) / 6.0);
    let bent = (bends.sum::<f64>() / (n as f64 - 2.0).max(1.0)).sqrt();
    if n < FEWEST || n != x.len() {
        return (x.to_vec(), bent);
    }
    let (first, span) = (u[0], u[n - 1] - u[0]);
    let (rise, places) = ((x[n - 1] - x[0]) / span, (n - 1) as f64 / span);
    let line = |u: f64| x[0] + rise * (u - first);
    let at: Vec<f64> = u.iter().map(|u| (u - first) * places).collect();
    let off: Vec<f64> = u.iter().zip(x).map(|(u, x)| x - line(*u)).collect();
    let least = (NONE * (x[n - 1] - x[0])).powi(2).max(f64::MIN_POSITIVE);
    let (from, to, each) = RATIOS;
    let best = (from..=to)
        .map(|k| filter(&at, &off, 10f64.powf(f64::from(k) / each), least))
        .max_by(|a, b| a.1.total_cmp(&b.1));
    let Some((known, _, error)) = best else {
        return (x.to_vec(), bent);
    };
    let mut out = vec![0.0; n];
    let mut later = known[n - 1].after.0;
    out[n - 1] = later[0];
    for k in (0..n - 1).rev() {
        let (here, next) = (&known[k], &known[k + 1]);
        let (mean, cover) = here.after;
        if let Some(inverse) = next.ahead.1.try_inverse() {
            later = mean + cover * here.step.transpose() * inverse * (later - next.ahead.0);
        }
        out[k] = later[0];
    }
    let out: Vec<f64> = out.iter().zip(u).map(|(y, u)| y + line(*u)).collect();
    match out.iter().all(|x| x.is_finite()) {
        true => (out, error.sqrt()),
        false => (x.to_vec(), bent),
    }
}

/// Kalman's filter at one q/r, the log-likelihood with r at its best, and that r.
fn filter(at: &[f64], x: &[f64], ratio: f64, least: f64) -> (Vec<Known>, f64, f64) {
    let mut ahead = (Vector2::zeros(), Matrix2::identity() * UNKNOWN);
    let (mut known, mut squares, mut spreads) = (Vec::with_capacity(at.len()), 0.0, 0.0);
    for k in 0..at.len() {
        let (mean, cover) = ahead;
        let spread = cover[(0, 0)] + 1.0;
        let miss = x[k] - mean[0];
        // The first two only say where and how fast it begins.
        if k >= 2 {
            squares += miss * miss / spread;
            spreads += spread.ln();
        }
        let gain = cover.column(0) / spread;
        let after = (mean + gain * miss, cover - gain * cover.row(0));
        let h = at.get(k + 1).map_or(0.0, |next| next - at[k]);
        let step = Matrix2::new(1.0, h, 0.0, 1.0);
        let kicks = Matrix2::new(h * h * h / 3.0, h * h / 2.0, h * h / 2.0, h) * ratio;
        known.push(Known { ahead, after, step });
        ahead = (step * after.0, step * after.1 * step.transpose() + kicks);
    }
    let free = (at.len() - 2) as f64;
    let error = (squares / free).max(least);
    (known, -0.5 * (free * error.ln() + spreads), error)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Random;

    /// RMS of what is left of an error of 1 on a course.
    fn left(course: impl Fn(f64) -> f64, error: f64) -> f64 {
        let mut random = Random(5);
        let u: Vec<f64> = (0..200).filter(|k| k % 7 != 3).map(f64::from).collect();
        let x: Vec<f64> = u
            .iter()
            .map(|u| course(*u) + error * random.normal())
            .collect();
        let off = smooth(&u, &x)
            .0
            .into_iter()
            .zip(&u)
            .map(|(y, u)| (y - course(*u)).powi(2));
        (off.sum::<f64>() / u.len() as f64).sqrt()
    }

    #[test]
    fn errors_go_and_the_course_stays() {
        let straight = |u: f64| 7.0 + 0.46 * u;
        let bent = |u: f64| straight(u) + 0.3 * (u / 20.0).sin();
        assert!(left(straight, 0.0) < 1e-9, "{}", left(straight, 0.0));
        assert!(left(bent, 0.0) < 1e-4, "{}", left(bent, 0.0));
        assert!(left(straight, 0.01) < 0.002, "{}", left(straight, 0.01));
        assert!(left(bent, 0.01) < 0.005, "{}", left(bent, 0.01));
        assert_eq!(smooth(&[0.0, 1.0], &[3.0, 4.0]), (vec![3.0, 4.0], 0.0));
    }
}
