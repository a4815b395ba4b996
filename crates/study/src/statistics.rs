//! Mean, spread and interval of an ensemble.

use analyze::phase::circular;
use std::f64::consts::TAU;

/// Summary of one number over the runs that have it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Summary {
    /// How many runs have it.
    pub runs: usize,
    /// Arithmetic mean.
    pub mean: f64,
    /// Sample standard deviation (n − 1); `None` for one run, which shows no spread.
    pub sd: Option<f64>,
    /// Half-width of the 95 % interval of the mean by Student's t, t·SD/√n; `None` for one run.
    pub ci95: Option<f64>,
}

/// Summarises finite values in their order, so that the result does not depend on who computed them when; `None` where there are none.
pub fn summarise(values: impl Iterator<Item = f64>) -> Option<Summary> {
    let values: Vec<f64> = values.collect();
    let n = values.len();
    if n == 0 {
        return None;
    }
    let mean = values.iter().sum::<f64>() / n as f64;
    let squares = || values.iter().map(|x| (x - mean) * (x - mean)).sum::<f64>();
    let sd = (n > 1).then(|| (squares() / (n - 1) as f64).sqrt());
    Some(Summary {
        runs: n,
        mean,
        sd,
        ci95: sd.map(|sd| student_975(n - 1) * sd / (n as f64).sqrt()),
    })
}

/// Of numbers that are the same after a `turn` (degrees: 360) the circular mean, and each as the one nearest to it: what a spread and an order
/// can be taken of.
pub fn about_their_mean(values: &[f64], turn: f64) -> (f64, Vec<f64>) {
    let angles = values.iter().map(|x| x / turn * TAU);
    let mean = circular(angles).map_or(0.0, |c| c.mean_rad / TAU * turn);
    let about = values.iter().map(|x| nearest(*x, mean, turn));
    (mean, about.collect())
}

/// Which of the numbers that are `x` but for whole turns is nearest to `to`.
pub fn nearest(x: f64, to: f64, turn: f64) -> f64 {
    x - turn * ((x - to) / turn).round()
}

/// Student's t that 97.5 % of its distribution lie below, for `freedoms` degrees of freedom: tables to 1e-9 up to 10, then Cornish and Fisher's
/// expansion, good to 1e-4 there (Abramowitz & Stegun, 26.7.5). Infinite for none.
pub fn student_975(freedoms: usize) -> f64 {
    const FIRST: [f64; 11] = [
        f64::INFINITY,
        12.706_204_736,
        4.302_652_730,
        3.182_446_305,
        2.776_445_105,
        2.570_581_836,
        2.446_911_851,
        2.364_624_252,
        2.306_004_135,
        2.262_157_163,
        2.228_138_852,
    ];
    if let Some(t) = FIRST.get(freedoms) {
        return *t;
    }
    let (z, nu) = (1.959_963_985_f64, freedoms as f64);
    let [z3, z5, z7, z9] = [3, 5, 7, 9].map(|n| z.powi(n));
    z + (z3 + z) / 4.0 / nu
        + (5.0 * z5 + 16.0 * z3 + 3.0 * z) / 96.0 / nu.powi(2)
        + (3.0 * z7 + 19.0 * z5 + 17.0 * z3 - 15.0 * z) / 384.0 / nu.powi(3)
        + (79.0 * z9 + 776.0 * z7 + 1482.0 * z5 - 1920.0 * z3 - 945.0 * z) / 92160.0 / nu.powi(4)
}

/// Pearson's correlation of two equally long columns; `None` where one of them does not vary.
pub fn correlation(x: &[f64], y: &[f64]) -> Option<f64> {
    let n = x.len().min(y.len()) as f64;
    let (mx, my) = (x.iter().sum::<f64>() / n, y.iter().sum::<f64>() / n);
    let (mut xy, mut xx, mut yy) = (0.0, 0.0, 0.0);
    for (a, b) in x.iter().zip(y) {
        let (a, b) = (a - mx, b - my);
        xy += a * b;
        xx += a * a;
        yy += b * b;
    }
    let r = xy / (xx * yy).sqrt();
    r.is_finite().then_some(r)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn textbook_numbers() {
        let s = summarise([2.0, 4.0, 4.0, 4.0, 5.0, 5.0, 7.0, 9.0].into_iter()).unwrap();
        assert_eq!((s.runs, s.mean), (8, 5.0));
        assert!((s.sd.unwrap() - (32.0_f64 / 7.0).sqrt()).abs() < 1e-15);
        assert!(summarise(std::iter::empty()).is_none());
        let one = summarise([3.0].into_iter()).unwrap();
        assert_eq!((one.sd, one.ci95), (None, None));
        // scipy.stats.t.interval(0.95, 2, 2, scale=1/sqrt(3)): 2 ± 2.484
        let three = summarise([1.0, 2.0, 3.0].into_iter()).unwrap();
        assert!((three.ci95.unwrap() - 2.4841).abs() < 1e-3);
        assert!((correlation(&[1.0, 2.0, 3.0], &[6.0, 4.0, 2.0]).unwrap() + 1.0).abs() < 1e-15);
        assert!(correlation(&[1.0, 1.0], &[1.0, 2.0]).is_none());
        // scipy.stats.pearsonr([1, 2, 4, 7, 8], [2, 1, 5, 6, 11]).statistic
        let r = correlation(&[1.0, 2.0, 4.0, 7.0, 8.0], &[2.0, 1.0, 5.0, 6.0, 11.0]);
        assert!((r.unwrap() - 0.916_189_608_780_249_2).abs() < 1e-14);
        // scipy.stats.t.ppf(0.975, n)
        for (n, t, off) in [
            (1, 12.706_204_736, 1e-9),
            (4, 2.776_445_105, 1e-9),
            (10, 2.228_138_852, 1e-9),
            (11, 2.2010, 1e-4),
            (30, 2.0423, 1e-4),
            (1000, 1.9623, 1e-4),
        ] {
            assert!((student_975(n) - t).abs() < off, "{n}");
        }
    }
}
