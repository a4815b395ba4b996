//! Held readings of an instrument that was polled faster than it measures: a stair would pass for its course.

use recording::held::new_readings;

use super::track::{Instrument, Track};
use crate::inputs::drawn_within;

/// A track without held readings, and what is to be said of them; `None` where there are none. It stays where the accelerometer read anew; the gyroscope's course is
/// drawn there between its own new readings.
pub fn without_held(track: &Track) -> Option<(Track, String)> {
    let new = |of: Instrument| new_readings(track.readings(of));
    let (turned, felt) = (new(Instrument::Gyroscope), new(Instrument::Accelerometer));
    let told = [
        (&turned, Instrument::Gyroscope),
        (&felt, Instrument::Accelerometer),
    ];
    let told = told.into_iter().filter_map(|(new, of)| {
        let new = new.as_ref()?.len();
        Some(format!(
            "the {} reads anew in {new} of {} samples and repeats itself in the others",
            of.name(),
            track.len()
        ))
    });
    let told: Vec<String> = told.collect();
    if told.is_empty() {
        return None;
    }
    let mut kept = match felt {
        Some(felt) => track.only(&felt),
        None => track.clone(),
    };
    if let Some(turned) = turned {
        let own = track.only(&turned);
        let axes: [Vec<f64>; 3] = std::array::from_fn(|axis| {
            let x: Vec<f64> = own.gyro_rad_per_s.iter().map(|w| w[axis]).collect();
            drawn_within(&own.t_s, &x, &kept.t_s)
        });
        for (k, w) in kept.gyro_rad_per_s.iter_mut().enumerate() {
            *w = axes.each_ref().map(|x| x[k]);
        }
        let known = |k: &usize| kept.gyro_rad_per_s[*k].iter().all(|x| x.is_finite());
        let known: Vec<usize> = (0..kept.len()).filter(known).collect();
        kept = kept.only(&known);
    }
    Some((kept, told.join("; ")))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn gyro(t: f64) -> [f64; 3] {
        [2.0 * (6.8 * t).sin(), 0.3 * (13.6 * t).cos(), 0.1]
    }

    fn accel(t: f64) -> [f64; 3] {
        [0.0, (6.8 * t).cos(), 9.81 + 3.0 * (13.6 * t).sin()]
    }

    /// Polled at 200 Hz, of instruments that read anew every so many times.
    fn polled(of_gyro: u32, of_accel: u32) -> Track {
        let mut track = Track::default();
        let at = |k: u32, every: u32| f64::from(k / every * every) / 200.0;
        for k in 0..4000 {
            track.t_s.push(at(k, 1));
            track.gyro_rad_per_s.push(gyro(at(k, of_gyro)));
            track.accel_m_per_s2.push(accel(at(k, of_accel)));
        }
        track
    }

    #[test]
    fn a_course_is_drawn_between_new_readings() {
        assert!(without_held(&polled(1, 1)).is_none());
        for (of_gyro, of_accel, left) in [(2, 1, 3999), (1, 2, 2000), (2, 2, 2000), (3, 2, 2000)] {
            let (track, told) = without_held(&polled(of_gyro, of_accel)).unwrap();
            assert_eq!(told.contains("the gyroscope"), of_gyro > 1);
            assert_eq!(told.contains("the accelerometer"), of_accel > 1);
            assert_eq!(track.len(), left);
            for (k, t) in track.t_s.iter().enumerate() {
                let off = (0..3).map(|a| (track.gyro_rad_per_s[k][a] - gyro(*t)[a]).abs());
                assert!(off.fold(0.0, f64::max) < 1e-3, "{of_gyro} {of_accel}: {t}");
                assert_eq!(track.accel_m_per_s2[k], accel(*t));
            }
        }
    }
}
