//! What a signal most likely did in the holes of its record: zeros there would tear its lines apart.
//!
//! ```text
//! Σ_{k=0…p} a_k x_{t−k} = e_t,   a₀ = 1,   e white      lost x: their mean, given the others      a: by Burg's recursion from what x is so far
//! ```
//! Three rounds, from zeros on. A signal of lines goes on through a hole as it went before and behind it; noise falls to the mean, as fast as it forgets.
//! Sources: Janssen, Veldhuis & Vries, IEEE Trans. ASSP 34 (1986) 317 (with the ends' exact covariance in the place of least squares);
//! Kay, Modern Spectral Estimation (1988), ch. 7.

use std::ops::Range;

/// No more than one in so many of the samples are coefficients.
const SAMPLES_PER_COEFFICIENT: usize = 8;
/// So many products at most to solve for what is lost: of very long records the prediction looks less far back.
const WORK: f64 = 2e9;
const ROUNDS: usize = 3;
/// What is told by fewer samples is told badly.
const FEWEST: usize = 32;
/// Of the diagonal, added to it: lines without noise leave nothing else there.
const RIDGE: f64 = 1e-12;

/// How many samples tell what goes on through a hole, where those of so many seconds do; at most `most`.
pub fn memory(memory_s: f64, step_s: f64, most: usize) -> usize {
    ((memory_s / step_s).ceil() as usize).clamp(FEWEST, most)
}

/// Fills the `lost` parts, which ascend, of an even signal about its mean, by a prediction from so many samples; what is there stays as it is. Zeros
/// stay where the signal is too short to tell or stands still.
pub fn fill(x: &mut [f64], lost: &[Range<usize>], samples: usize) {
    let lost: Vec<usize> = lost.iter().cloned().flatten().collect();
    if lost.is_empty() {
        return;
    }
    lost.iter().for_each(|&t| x[t] = 0.0);
    let order = order(samples, x.len(), lost.len());
    for _ in 0..ROUNDS {
        let Some(filled) = prediction(x, order).and_then(|a| expected(x, &lost, &a)) else {
            return;
        };
        lost.iter().zip(filled).for_each(|(&t, value)| x[t] = value);
    }
}

/// How far back a prediction of `lost` of `n` samples looks that may look back by `samples`.
fn order(samples: usize, n: usize, lost: usize) -> usize {
    let affordable = (WORK / lost as f64).sqrt() as usize;
    samples.min(n / SAMPLES_PER_COEFFICIENT).min(affordable)
}

/// a₀ … a_p of the prediction error of a signal by Burg's recursion; `None` for one that is not finite or does not move.
fn prediction(x: &[f64], order: usize) -> Option<Vec<f64>> {
    let (mut ahead, mut back) = (x.to_vec(), x.to_vec());
    let mut a = vec![1.0];
    for k in 1..=order {
        // What is predicted from k samples: ahead_t from those before it, back_{t−1} from those behind it.
        let (mut product, mut power) = (0.0, 0.0);
        for (f, b) in ahead[k..].iter().zip(&back[k - 1..]) {
            product += f * b;
            power += f * f + b * b;
        }
        if !(power > 0.0 && power.is_finite()) {
            return None;
        }
        let reflection = -2.0 * product / power;
        for t in (k..x.len()).rev() {
            let (f, b) = (ahead[t], back[t - 1]);
            ahead[t] = f + reflection * b;
            back[t] = b + reflection * f;
        }
        a.push(0.0);
        let turned: Vec<f64> = a.iter().rev().copied().collect();
        a.iter_mut()
            .zip(turned)
            .for_each(|(a, b)| *a += reflection * b);
    }
    Some(a)
}

/// The conditional mean of what is lost; `None` where rounding does not let it be told.
///
/// Q x = 0 in the rows of what is lost, Q the inverse of the covariance of n samples (Gohberg & Semencul; σ = 1, samples from 0):
///
/// ```text
/// Q_ij = Σ_t a_{i−t} a_{j−t} − Σ_t a_{n−i+t} a_{n−j+t},   t ≥ 0,   a_k = 0 but for 0 ≤ k ≤ p
/// ```
/// The second sum belongs to the last p samples. Two that are more than p apart do not meet, so a Cholesky factor keeps within each row's first neighbour.
fn expected(x: &[f64], lost: &[usize], a: &[f64]) -> Option<Vec<f64>> {
    let (n, order) = (x.len(), a.len() - 1);
    let mut known = x.to_vec();
    lost.iter().for_each(|&t| known[t] = 0.0);
    // Σ_i a_{i−t} x_i and Σ_i a_{n−i+t} x_i.
    let ahead = |t: usize| -> f64 { a.iter().zip(&known[t..]).map(|(a, x)| a * x).sum() };
    let ends: Vec<f64> = (0..order)
        .map(|t| (t + 1..=order).map(|k| a[k] * known[n + t - k]).sum())
        .collect();
    // Only where a lost sample takes part.
    let mut errors = vec![f64::NAN; n];
    for &i in lost {
        for t in i.saturating_sub(order)..=i {
            if errors[t].is_nan() {
                errors[t] = ahead(t);
            }
        }
    }
    // So many of the last sums meet a sample.
    let met_at_end = |i: usize| (i + order + 1).saturating_sub(n);
    let right = |i: usize| -> f64 {
        let before: f64 = (i.saturating_sub(order)..=i)
            .map(|t| a[i - t] * errors[t])
            .sum();
        let end = (0..met_at_end(i)).map(|t| a[n - i + t] * ends[t]);
        end.sum::<f64>() - before
    };
    // Σ_k a_k a_{k+d}, where no end of the signal is near.
    let far: Vec<f64> = (0..=order)
        .map(|d| a.iter().zip(&a[d..]).map(|(a, b)| a * b).sum())
        .collect();
    let meeting = |i: usize, j: usize| -> f64 {
        if i >= order && met_at_end(j) == 0 {
            return far[i - j];
        }
        let before: f64 = (i.saturating_sub(order)..=j)
            .map(|t| a[i - t] * a[j - t])
            .sum();
        let end = (0..met_at_end(j)).map(|t| a[n - i + t] * a[n - j + t]);
        before - end.sum::<f64>()
    };
    // Rows of the factor from their first neighbour to the diagonal.
    let mut rows: Vec<(usize, Vec<f64>)> = Vec::with_capacity(lost.len());
    let mut filled: Vec<f64> = Vec::with_capacity(lost.len());
    let mut first = 0;
    for (r, &i) in lost.iter().enumerate() {
        while lost[first] + order < i {
            first += 1;
        }
        let mut row: Vec<f64> = lost[first..=r].iter().map(|&j| meeting(i, j)).collect();
        let mut right = right(i);
        for c in first..r {
            let (begins, other) = &rows[c];
            let both = first.max(*begins);
            let met: f64 = row[both - first..c - first]
                .iter()
                .zip(&other[both - begins..])
                .map(|(a, b)| a * b)
                .sum();
            let value = (row[c - first] - met) / other[c - begins];
            row[c - first] = value;
            right -= value * filled[c];
        }
        let own = r - first;
        let squares: f64 = row[..own].iter().map(|v| v * v).sum();
        let left = row[own] * (1.0 + RIDGE) - squares;
        if !(left > 0.0 && left.is_finite()) {
            return None;
        }
        row[own] = left.sqrt();
        filled.push(right / row[own]);
        rows.push((first, row));
    }
    for r in (0..lost.len()).rev() {
        let (first, row) = &rows[r];
        let own = r - first;
        filled[r] /= row[own];
        let value = filled[r];
        let before = filled[*first..r].iter_mut().zip(&row[..own]);
        before.for_each(|(y, l)| *y -= l * value);
    }
    filled.iter().all(|x| x.is_finite()).then_some(filled)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::TAU;

    /// Two lines and a slow one, at 30 Hz for 45 s.
    fn lines() -> Vec<f64> {
        (0..1350)
            .map(|k| {
                let t = f64::from(k) / 30.0;
                (TAU * 1.07 * t).sin()
                    + 0.3 * (TAU * 2.14 * t + 1.0).cos()
                    + 0.1 * (TAU * 0.3 * t).sin()
            })
            .collect()
    }

    #[test]
    fn lines_go_on_through_holes() {
        let truth = lines();
        // At both ends too, one sample alone, and two holes that see each other.
        let lost = [0..3, 100..120, 130..133, 500..501, 900..990, 1347..1350];
        let mut x = truth.clone();
        for part in &lost {
            x[part.clone()].fill(9.0);
        }
        fill(&mut x, &lost, 32);
        let off = x.iter().zip(&truth).map(|(a, b)| (a - b).abs());
        let worst = off.fold(0.0, f64::max);
        assert!(worst < 1e-3, "{worst:.1e}");
    }

    /// With a known prediction, a sample of x_t = φ x_{t−1} + e_t between two others is φ (x_{t−1} + x_{t+1})/(1 + φ²), the last one φ x_{n−2}.
    #[test]
    fn one_sample_is_its_conditional_mean() {
        let x = [0.3, -1.0, 0.0, 2.0, 0.5, 7.0, 0.0];
        let phi = 0.8;
        let filled = expected(&x, &[2, 6], &[1.0, -phi]).unwrap();
        let between = phi * (x[1] + x[3]) / (1.0 + phi * phi);
        assert!((filled[0] - between).abs() < 1e-10 && (filled[1] - phi * x[5]).abs() < 1e-10);
    }

    /// The same numbers as from the whole, dense covariance Σ_k h_k h_{k+d}, h what one e leaves behind, for lost samples at the ends, in rows and beside
    /// each other.
    #[test]
    fn only_neighbours_matter() {
        use nalgebra::{DMatrix, DVector};
        let x: Vec<f64> = (0..60u32)
            .map(|k| f64::from(k * k % 17) - 8.0 + f64::from(k % 5))
            .collect();
        let a = [1.0, -0.9, 0.5, -0.2, 0.1];
        let lost = [0, 1, 7, 9, 10, 11, 12, 30, 33, 57, 59];
        let kept: Vec<usize> = (0..x.len()).filter(|t| !lost.contains(t)).collect();
        let mut h = vec![1.0];
        for t in 1..500 {
            h.push(
                -(1..a.len().min(t + 1))
                    .map(|k| a[k] * h[t - k])
                    .sum::<f64>(),
            );
        }
        let covariance =
            |i: usize, j: usize| h.iter().zip(&h[i.abs_diff(j)..]).map(|(a, b)| a * b).sum();
        let among = DMatrix::from_fn(kept.len(), kept.len(), |r, c| covariance(kept[r], kept[c]));
        let across = DMatrix::from_fn(lost.len(), kept.len(), |r, c| covariance(lost[r], kept[c]));
        let known = DVector::from_fn(kept.len(), |r, _| x[kept[r]]);
        let dense = across * among.cholesky().unwrap().solve(&known);
        let found = expected(&x, &lost, &a).unwrap();
        for (a, b) in found.iter().zip(dense.iter()) {
            assert!((a - b).abs() < 1e-9, "{a} {b}");
        }
    }

    #[test]
    fn a_prediction_looks_back_as_far_as_the_record_and_the_work_allow() {
        assert_eq!(memory(0.4, 0.005, 128), 80);
        assert_eq!(memory(0.4, 0.05, 128), FEWEST);
        assert_eq!(memory(0.4, 0.0005, 128), 128);
        assert_eq!(order(256, 100_000, 10), 256);
        assert_eq!(order(256, 800, 10), 100);
        // 200,000 · 100² products.
        assert_eq!(order(256, 2_000_000, 200_000), 100);
    }

    /// Burg's coefficients of a sampled x_t = 1.5 x_{t−1} − 0.9 x_{t−2} + e_t.
    #[test]
    fn a_prediction_is_found() {
        let mut x = vec![0.0, 0.0];
        let mut seed = 1u64;
        for t in 2..20_000 {
            seed = seed.wrapping_mul(6364136223846793005).wrapping_add(1);
            let noise = (seed >> 11) as f64 / (1u64 << 53) as f64 - 0.5;
            x.push(1.5 * x[t - 1] - 0.9 * x[t - 2] + noise);
        }
        let a = prediction(&x, 2).unwrap();
        // Its deviation is √((1 − a₂²)/n) = 0.003.
        assert!(
            (a[1] + 1.5).abs() < 0.01 && (a[2] - 0.9).abs() < 0.01,
            "{a:?}"
        );
    }

    #[test]
    fn what_tells_nothing_stays_zero() {
        for mut x in [vec![1.0; 6], vec![0.0; 400], vec![f64::INFINITY; 400]] {
            let lost = 2..4;
            fill(&mut x, std::slice::from_ref(&lost), 32);
            assert_eq!(x[lost], [0.0, 0.0]);
        }
    }
}
