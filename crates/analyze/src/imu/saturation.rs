//! Where a sensor came to the end of its range: what moved beyond it was read as the end itself, and nothing brings it back.

use super::track::{Instrument, Track};

/// No sensor has a smaller range: ±125 °/s and ±2 g, less a tenth for scale and offset.
const fn least_end(of: Instrument) -> f64 {
    match of {
        Instrument::Gyroscope => 0.9 * 2.18,
        Instrument::Accelerometer => 0.9 * 19.6,
    }
}
/// So many samples at the end, three of them in a row, and so many times as many as at one of the values below it: the crest of a sine has four times as many.
const LEAST_SAMPLES: usize = 8;
const PILED_UP: f64 = 8.0;
/// How many of the values below it.
const BELOW: usize = 8;

/// What stayed at the end of its range.
#[derive(Clone, Debug, PartialEq)]
pub struct Saturated {
    /// What did.
    pub instrument: Instrument,
    /// The largest reading, in its unit.
    pub end: f64,
    /// Which samples, ascending.
    pub samples: Vec<usize>,
}

impl Saturated {
    /// One line for people.
    pub fn told(&self, all: usize) -> String {
        format!(
            "the {} came to its end at {:.3} {} in {} of {all} samples: what went beyond is lost, and no interval knows of it",
            self.instrument.name(),
            self.end,
            self.instrument.unit(),
            self.samples.len()
        )
    }
}

/// What of a track is the end of a range: its gyroscope, its accelerometer.
pub fn saturated(track: &Track) -> Vec<Saturated> {
    let each = Instrument::BOTH.into_iter();
    each.filter_map(|instrument| {
        let readings = track.readings(instrument);
        let mut found = Saturated {
            instrument,
            end: 0.0,
            samples: Vec::new(),
        };
        for axis in 0..3 {
            for sign in [1.0, -1.0] {
                let x: Vec<f64> = readings.iter().map(|v| sign * v[axis]).collect();
                if let Some((end, samples)) = piled_up(&x, least_end(instrument)) {
                    found.end = found.end.max(end);
                    found.samples.extend(samples);
                }
            }
        }
        found.samples.sort_unstable();
        found.samples.dedup();
        (!found.samples.is_empty()).then_some(found)
    })
    .collect()
}

/// The largest value and which samples have it, where they pile up there.
fn piled_up(x: &[f64], least: f64) -> Option<(f64, Vec<usize>)> {
    let end = x.iter().copied().fold(f64::MIN, f64::max);
    if end < least {
        return None;
    }
    let samples: Vec<usize> = (0..x.len()).filter(|k| x[*k] == end).collect();
    let in_a_row = samples.windows(3).any(|w| w[2] - w[0] == 2);
    if samples.len() < LEAST_SAMPLES || !in_a_row {
        return None;
    }
    let mut others: Vec<f64> = x.iter().copied().filter(|x| *x < end).collect();
    others.sort_unstable_by(|a, b| b.total_cmp(a));
    let below = others.chunk_by(|a, b| a == b).take(BELOW);
    let counted: usize = below.map(<[f64]>::len).sum();
    (samples.len() as f64 * BELOW as f64 >= PILED_UP * counted as f64).then_some((end, samples))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A turn to and fro of 4 rad/s, read to so many digits and up to an end.
    fn turning(quantum: f64, end: f64) -> Track {
        let mut track = Track::default();
        for k in 0..4000 {
            let t = 0.01 * f64::from(k);
            let x = 4.0 * (std::f64::consts::TAU * 0.91 * t).sin();
            let read = (x.clamp(-end, end) / quantum).round() * quantum;
            track.t_s.push(t);
            track.gyro_rad_per_s.push([0.0, read, 0.0]);
            track.accel_m_per_s2.push([0.0, 0.0, 9.8]);
        }
        track
    }

    #[test]
    fn a_range_that_ends_below_the_motion_is_seen_whatever_the_digits() {
        for quantum in [1e-9, 0.001, 0.05] {
            let found = saturated(&turning(quantum, 2.5));
            assert_eq!(found.len(), 1, "{quantum}");
            assert!(
                found[0].instrument == Instrument::Gyroscope
                    && (found[0].end - 2.5).abs() < quantum
            );
            // |sin| > 2.5 / 4 of the time.
            let share = found[0].samples.len() as f64 / 4000.0;
            let truth = 1.0 - (2.5f64 / 4.0).asin() / std::f64::consts::FRAC_PI_2;
            assert!(
                (share - truth).abs() < 0.02,
                "{quantum}: {share} of {truth}"
            );
        }
    }

    #[test]
    fn a_crest_is_no_end() {
        for quantum in [1e-9, 0.001, 0.05, 0.2, 0.5] {
            assert_eq!(saturated(&turning(quantum, 100.0)), [], "{quantum}");
        }
    }

    /// A value that comes back, but never three times in a row, is none that anything stayed at.
    #[test]
    fn what_only_touches_a_value_does_not_stay_at_it() {
        let mut track = turning(1e-9, 100.0);
        for k in (50..4000).step_by(97) {
            track.gyro_rad_per_s[k][1] = 4.5;
        }
        assert_eq!(saturated(&track), []);
        for k in 1000..1003 {
            track.gyro_rad_per_s[k][1] = 4.5;
        }
        let found = saturated(&track);
        assert!(found.len() == 1 && found[0].end == 4.5, "{found:?}");
    }
}
