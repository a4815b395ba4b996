//! Where a sensor came to the end of its range: what moved beyond it was read as the end itself, and nothing brings it back.

use super::track::{Instrument, Track};

/// No sensor has a smaller range: ±50 °/s and ±1.5 g, less a tenth for scale and offset.
const fn least_end(of: Instrument) -> f64 {
    match of {
        Instrument::Gyroscope => 0.9 * 0.873,
        Instrument::Accelerometer => 0.9 * 14.7,
    }
}
/// So many samples at the end, three of them in a row, and so many times as many as at one of the values below it: the crest of a sine has four times as many.
const LEAST_SAMPLES: usize = 8;
const PILED_UP: f64 = 8.0;
/// The same in a band: a crest as flat as 1 − t⁴ has eleven times as many as a band below, one as 1 − t⁶ eighteen times.
const PILED_UP_SPREAD: f64 = 32.0;
/// How many of the values below it, or of bands as wide.
const BELOW: usize = 8;
/// What counts as the end: that value alone, or all within such a part of it, where values lie that close: a bias that was taken off, axes that were
/// turned or made square, spread it.
const WIDTHS: [f64; 5] = [0.0, 1e-3, 1e-4, 1e-5, 1e-6];

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

/// The largest value and which samples are there, where they pile up.
fn piled_up(x: &[f64], least: f64) -> Option<(f64, Vec<usize>)> {
    let end = x.iter().copied().fold(f64::MIN, f64::max);
    if end < least {
        return None;
    }
    let mut descending = x.to_vec();
    descending.sort_unstable_by(|a, b| b.total_cmp(a));
    WIDTHS.iter().find_map(|width| {
        let width = width * end;
        let samples: Vec<usize> = (0..x.len()).filter(|k| end - x[*k] <= width).collect();
        let in_a_row = samples.windows(3).any(|w| w[2] - w[0] == 2);
        if samples.len() < LEAST_SAMPLES || !in_a_row {
            return None;
        }
        let others = &descending[samples.len()..];
        let (below, times) = if width > 0.0 {
            let all = descending.partition_point(|x| end - x <= (BELOW + 1) as f64 * width);
            if descending[..all].chunk_by(|a, b| a == b).count() <= BELOW {
                return None;
            }
            (all - samples.len(), PILED_UP_SPREAD)
        } else {
            let values = others.chunk_by(|a, b| a == b).take(BELOW);
            (values.map(<[f64]>::len).sum(), PILED_UP)
        };
        let piled = samples.len() as f64 * BELOW as f64 >= times * below as f64;
        piled.then_some((end, samples))
    })
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
        // The smallest that there are: ±50 °/s and ±1.5 g.
        let mut least = turning(0.001, 0.873);
        for (force, turn) in least.accel_m_per_s2.iter_mut().zip(&least.gyro_rad_per_s) {
            force[2] = (9.8 + 6.0 * turn[1]).min(14.7);
        }
        let ends: Vec<f64> = saturated(&least).iter().map(|found| found.end).collect();
        assert_eq!(ends, [0.873, 14.7]);
    }

    /// Neither noise behind the converter, a bias that was taken off, axes made square, nor a turned case hide an end.
    #[test]
    fn an_end_that_is_spread_is_seen() {
        let mut random = crate::random::Random(5);
        let clipped = turning(1e-9, 2.5);
        let mut spread = [1e-6, 1e-5, 1e-4].map(|sd| {
            let mut track = clipped.clone();
            for x in track.gyro_rad_per_s.iter_mut().flatten() {
                *x += sd * random.normal();
            }
            track
        });
        let mut ramp = clipped.clone();
        for (k, x) in ramp.gyro_rad_per_s.iter_mut().enumerate() {
            x[1] += 1e-5 * 0.01 * k as f64;
        }
        let mut turned = clipped.clone();
        let turn = nalgebra::Rotation3::from_euler_angles(0.0, 0.0, 0.35);
        for x in &mut turned.gyro_rad_per_s {
            *x = (turn * nalgebra::Vector3::from(*x)).into();
        }
        let share = saturated(&clipped)[0].samples.len();
        for track in spread.iter_mut().chain([&mut ramp, &mut turned]) {
            let found = saturated(track);
            let gyro: Vec<&Saturated> = found
                .iter()
                .filter(|f| f.instrument == Instrument::Gyroscope)
                .collect();
            assert_eq!(gyro.len(), 1);
            assert!(gyro[0].samples.len().abs_diff(share) < share / 20);
            // A motion that only bends there is none.
            for x in track.gyro_rad_per_s.iter_mut().flatten() {
                *x += 0.01 * random.normal();
            }
            assert_eq!(saturated(track), []);
        }
    }

    #[test]
    fn a_crest_is_no_end() {
        for quantum in [1e-9, 0.001, 0.05, 0.2, 0.5] {
            assert_eq!(saturated(&turning(quantum, 100.0)), [], "{quantum}");
        }
    }

    /// Nor one that is flat for a tenth of a second, through noise and a converter's steps.
    #[test]
    fn a_flat_crest_is_no_end() {
        let mut random = crate::random::Random(6);
        for power in [2, 4, 6] {
            let mut track = turning(1e-9, 100.0);
            for (k, x) in track.gyro_rad_per_s.iter_mut().enumerate() {
                let t = (k as f64 - 2000.0) / 60.0;
                let crest = 4.3 * (1.0 - t.powi(power)).max(0.0);
                x[1] = ((x[1].min(3.9).max(crest) + 1e-3 * random.normal()) / 7e-4).round() * 7e-4;
                x[1] -= if crest < 4.0 {
                    0.1 * random.uniform()
                } else {
                    0.0
                };
            }
            assert_eq!(saturated(&track), [], "{power}");
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
