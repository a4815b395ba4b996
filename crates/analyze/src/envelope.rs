//! A signal's outline in bounded memory: smallest and largest value of each stretch, nothing hidden by thinning.

/// Stretches kept at most; twice as many are merged to this.
const MOST: usize = 2000;

/// Minimum and maximum per stretch of equally many samples, built as samples arrive.
#[derive(Clone, Debug, Default)]
pub struct Envelope {
    stretches: Vec<Stretch>,
    /// Samples in a full stretch.
    per: usize,
    last: Stretch,
}

#[derive(Clone, Copy, Debug)]
struct Stretch {
    count: usize,
    /// Time and value of the smallest and of the largest sample.
    low: (f64, f64),
    high: (f64, f64),
}

impl Default for Stretch {
    fn default() -> Self {
        Stretch {
            count: 0,
            low: (0.0, f64::INFINITY),
            high: (0.0, f64::NEG_INFINITY),
        }
    }
}

impl Stretch {
    fn join(&mut self, other: &Stretch) {
        self.count += other.count;
        if other.low.1 < self.low.1 {
            self.low = other.low;
        }
        if other.high.1 > self.high.1 {
            self.high = other.high;
        }
    }
}

impl Envelope {
    /// The next sample; one that is not finite is left out.
    pub fn push(&mut self, t_s: f64, x: f64) {
        if !x.is_finite() {
            return;
        }
        self.per = self.per.max(1);
        self.last.join(&Stretch {
            count: 1,
            low: (t_s, x),
            high: (t_s, x),
        });
        if self.last.count >= self.per {
            self.stretches.push(std::mem::take(&mut self.last));
            if self.stretches.len() >= 2 * MOST {
                self.halve();
            }
        }
    }

    fn halve(&mut self) {
        let pairs = self.stretches.chunks(2).map(|pair| {
            let mut joined = pair[0];
            pair[1..].iter().for_each(|s| joined.join(s));
            joined
        });
        self.stretches = pairs.collect();
        self.per *= 2;
    }

    /// Times and values, ascending in time: every sample while there are few, then two per stretch, its extremes.
    pub fn points(&self) -> (Vec<f64>, Vec<f64>) {
        let (mut t_s, mut x) = (Vec::new(), Vec::new());
        for s in self
            .stretches
            .iter()
            .chain((self.last.count > 0).then_some(&self.last))
        {
            let mut ends = [s.low, s.high];
            ends.sort_by(|a, b| a.0.total_cmp(&b.0));
            for (k, (t, value)) in ends.into_iter().enumerate() {
                if k == 0 || t > ends[0].0 {
                    t_s.push(t);
                    x.push(value);
                }
            }
        }
        (t_s, x)
    }

    /// Samples that one stretch stands for; 1 while nothing is thinned.
    pub fn per(&self) -> usize {
        self.per.max(1)
    }
}

/// The outline of a whole column.
pub fn outline(t_s: &[f64], x: &[f64]) -> (Vec<f64>, Vec<f64>) {
    outline_of(t_s, x, 1)
}

/// The outline of a column in stretches of so many samples or more.
pub fn outline_of(t_s: &[f64], x: &[f64], per: usize) -> (Vec<f64>, Vec<f64>) {
    let mut envelope = Envelope {
        per,
        ..Envelope::default()
    };
    t_s.iter().zip(x).for_each(|(t, x)| envelope.push(*t, *x));
    envelope.points()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn few_samples_are_kept_as_they_are() {
        let t: Vec<f64> = (0..1819).map(f64::from).collect();
        let x: Vec<f64> = t.iter().map(|t| t.sin()).collect();
        assert_eq!(outline(&t, &x), (t, x));
    }

    #[test]
    fn extremes_survive_any_thinning() {
        let mut envelope = Envelope::default();
        for k in 0..1_000_000 {
            envelope.push(
                f64::from(k),
                if k == 654_321 {
                    9.0
                } else if k == 123_456 {
                    -7.0
                } else {
                    f64::from(k % 2)
                },
            );
        }
        let (t, x) = envelope.points();
        assert!(
            t.len() <= 4 * MOST + 2 && t.windows(2).all(|w| w[0] < w[1]),
            "{}",
            t.len()
        );
        assert!(x.contains(&9.0) && x.contains(&-7.0));
        assert_eq!(t[x.iter().position(|x| *x == 9.0).unwrap()], 654_321.0);
    }
}
