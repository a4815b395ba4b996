//! Where the level body rests on the shoulders: the height at which springs, and poles that bend, bear its weight.

/// A pole that bends.
#[derive(Debug)]
pub(crate) struct Bend {
    /// Where its deflection q is among the effects' own states; its rate follows.
    pub state: usize,
    /// Force over deflection, N/m.
    pub stiffness_n_per_m: f64,
    /// Share of q by which each handle moves, 1.
    pub shape: Vec<f64>,
}

/// Springs N = k δ^p under a weight.
pub(super) struct Springs<'a> {
    /// Height of the body at which each handle would touch its shoulder, m.
    pub level_m: Vec<f64>,
    /// k, N/m^p; empty where nothing bears.
    pub stiffness: &'a [f64],
    /// p, 1.
    pub exponent: f64,
    /// Whether they can pull.
    pub pull: bool,
    /// Along −z, N.
    pub weight_n: f64,
    /// Its poles, where they bend.
    pub bends: &'a [Bend],
}

impl Springs<'_> {
    /// Height of the body (m), and q of each pole (m). With no springs, handles at shoulder height and straight poles.
    pub fn rest(&self) -> (f64, Vec<f64>) {
        let n = self.level_m.len();
        let stiffness: f64 = self.stiffness.iter().sum();
        if !(stiffness > 0.0) {
            let mean = self.level_m.iter().sum::<f64>() / n as f64;
            return (mean, vec![0.0; self.bends.len()]);
        }
        if self.exponent == 1.0 && self.bends.is_empty() {
            let springs = self.stiffness.iter().zip(&self.level_m);
            let level = springs.map(|(k, z)| k * z).sum::<f64>() / stiffness;
            let height_m = level - self.weight_n / stiffness;
            // A shoulder that hangs clear bears nothing, where springs cannot pull.
            if self.pull || self.level_m.iter().all(|level| *level >= height_m) {
                return (height_m, Vec::new());
            }
        }
        // What bears falls as the body rises: halve the interval where it meets the weight.
        let high = self
            .level_m
            .iter()
            .copied()
            .fold(f64::NEG_INFINITY, f64::max);
        let mut low = high - 1.0;
        // Poles too soft to bear it are refused before (`effects.flexure`); springs that are give no finite height, which ends the run.
        while self.push_n(low) < self.weight_n && low.is_finite() {
            low -= high - low;
        }
        let height_m = root(low, high, |z| self.weight_n - self.push_n(z));
        (
            height_m,
            self.bends
                .iter()
                .map(|b| self.bent_m(b, height_m))
                .collect(),
        )
    }

    /// N of handle `i` that is compressed by `gap_m`.
    fn load_n(&self, i: usize, gap_m: f64) -> f64 {
        let size = self.stiffness[i] * gap_m.abs().powf(self.exponent);
        match gap_m > 0.0 {
            true => size,
            false if self.pull => -size,
            false => 0.0,
        }
    }

    /// q of a pole under a body at `z`, m.
    fn bent_m(&self, bend: &Bend, z: f64) -> f64 {
        let pressed_n = |q: f64| -> f64 {
            let each = bend.shape.iter().enumerate().filter(|(_, s)| **s != 0.0);
            each.map(|(i, s)| s * self.load_n(i, self.level_m[i] - z - s * q))
                .sum()
        };
        let most = pressed_n(0.0).abs() / bend.stiffness_n_per_m;
        root(-most, most, |q| bend.stiffness_n_per_m * q - pressed_n(q))
    }

    fn push_n(&self, z: f64) -> f64 {
        let mut gaps: Vec<f64> = self.level_m.iter().map(|level| level - z).collect();
        for bend in self.bends {
            let q = self.bent_m(bend, z);
            gaps.iter_mut()
                .zip(&bend.shape)
                .for_each(|(gap, s)| *gap -= s * q);
        }
        gaps.iter()
            .enumerate()
            .map(|(i, gap)| self.load_n(i, *gap))
            .sum()
    }
}

/// Where a function that rises passes zero, to rounding.
fn root(mut low: f64, mut high: f64, f: impl Fn(f64) -> f64) -> f64 {
    loop {
        let middle = 0.5 * (low + high);
        if !(low < middle && middle < high) {
            return middle;
        }
        if f(middle) < 0.0 {
            low = middle;
        } else {
            high = middle;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn two_poles_of_different_stiffness_share_a_weight_as_springs_in_series_do() {
        // Handles at the ends: each pole is its two springs in series with its bending, 1/(1/(k₁ + k₂) + 1/K); the poles side by side.
        let bend = |state, stiffness_n_per_m, shape: [f64; 4]| Bend {
            state,
            stiffness_n_per_m,
            shape: shape.to_vec(),
        };
        let bends = [
            bend(0, 8000.0, [1.0, 1.0, 0.0, 0.0]),
            bend(2, 2000.0, [0.0, 0.0, 1.0, 1.0]),
        ];
        let springs = Springs {
            level_m: vec![1.0; 4],
            stiffness: &[3000.0, 3000.0, 1000.0, 1000.0],
            exponent: 1.0,
            pull: false,
            weight_n: 600.0,
            bends: &bends,
        };
        let (z, q) = springs.rest();
        let series = |k: f64, bending: f64| 1.0 / (1.0 / k + 1.0 / bending);
        let (a, b) = (series(6000.0, 8000.0), series(2000.0, 2000.0));
        assert!((z - (1.0 - 600.0 / (a + b))).abs() < 1e-14, "{z}");
        let sunk = 1.0 - z;
        assert!(
            (q[0] - a * sunk / 8000.0).abs() < 1e-14 && (q[1] - b * sunk / 2000.0).abs() < 1e-14,
            "{q:?}"
        );
    }

    #[test]
    fn a_shoulder_that_hangs_clear_bears_nothing() {
        let springs = |pull, exponent| Springs {
            level_m: vec![0.9, 0.6, 0.9],
            stiffness: &[3000.0; 3],
            exponent,
            pull,
            weight_n: 588.6,
            bends: &[],
        };
        let height_m = |pull, exponent| springs(pull, exponent).rest().0;
        // The outer two bear alone; where the middle one pulls, it does so with its share; a hair beside p = 1 is a hair beside.
        assert!((height_m(false, 1.0) - (0.9 - 588.6 / 6000.0)).abs() < 1e-14);
        assert!((height_m(true, 1.0) - (0.8 - 588.6 / 9000.0)).abs() < 1e-14);
        assert!((height_m(false, 1.0 + 1e-9) - height_m(false, 1.0)).abs() < 1e-9);
    }

    #[test]
    fn soft_springs_let_the_load_sink_far_and_bilateral_ones_pull_by_their_own_law() {
        let springs = |level_m, stiffness, exponent, pull| Springs {
            level_m,
            stiffness,
            exponent,
            pull,
            weight_n: 600.0,
            bends: &[],
        };
        // k d^p = W: 60 m, and 30^(2/3) m.
        let deep = springs(vec![1.0], &[10.0], 1.0 + 1e-12, false).rest().0;
        assert!((deep - (1.0 - 60.0)).abs() < 1e-6, "{deep}");
        let deep = springs(vec![1.0], &[20.0], 1.5, false).rest().0;
        assert!(
            (deep - (1.0 - 30f64.powf(2.0 / 3.0))).abs() < 1e-9,
            "{deep}"
        );
        // Two press by d^2, one 1 m lower pulls by (1 − d)^2: 2 k d² − k (1 − d)² = W.
        let (k, w) = (1000.0, 600.0_f64);
        let d = -1.0 + f64::sqrt(2.0 + w / k);
        let held = springs(vec![1.0, 1.0, 0.0], &[k; 3], 2.0, true).rest().0;
        assert!((held - (1.0 - d)).abs() < 1e-9, "{held}");
    }

    #[test]
    fn one_shape_of_bending_under_many_handles_is_a_linear_system() {
        // K q = Σ s k (d − s q), Σ k (d − s q) = W, d the body's sinking.
        let shape = vec![1.0, 0.4, 0.4, 1.0];
        let (k, stiffness, weight_n) = (3000.0, 5000.0, 588.0);
        let (s1, s2) = (2.8, 2.0 * (1.0 + 0.16));
        let per_sinking = k * s1 / (stiffness + k * s2);
        let sunk = weight_n / (k * (4.0 - s1 * per_sinking));
        let bends = [Bend {
            state: 0,
            stiffness_n_per_m: stiffness,
            shape,
        }];
        for pull in [false, true] {
            let springs = Springs {
                level_m: vec![1.2; 4],
                stiffness: &[k; 4],
                exponent: 1.0,
                pull,
                weight_n,
                bends: &bends,
            };
            let (z, q) = springs.rest();
            assert!(
                (z - (1.2 - sunk)).abs() < 1e-14 && (q[0] - per_sinking * sunk).abs() < 1e-14,
                "{z} {q:?}"
            );
        }
    }
}
