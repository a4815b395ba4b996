//! Samples that nothing carried could have felt: a bit that fell over on a wire, a message that was filled with zeros, a register that was read half old and
//! half new. One of them turns the attitude and throws the height for seconds, so they count as lost.

use super::frozen::runs;
use super::track::{Instrument, Track};
use nalgebra::Vector3;
use std::ops::Range;

/// So far from both neighbours, in the instrument's unit, on the same side. A fall onto stone is felt by what is carried as up to some 50 m/s² (re-contact after a
/// float passes 4 g), through a sensor's own low-pass filter, and so over more than one sample: it rises and falls by less than this between them. Nobody turns a
/// load of two people by 17 rad/s (1000 °/s), let alone up to that and down again within two samples.
const fn beyond(of: Instrument) -> f64 {
    match of {
        Instrument::Gyroscope => 17.0,
        Instrument::Accelerometer => 100.0,
    }
}
/// The neighbours agree with each other to so much of it: what jumps from one state to another is no stray.
const AGREE: f64 = 0.25;
/// Of a message filled with zeros: what its neighbours feel at least, m/s². In free flight a coarse sensor may read zero.
const FELT_M_PER_S2: f64 = 5.0;
/// Of a rate of nothing: what its neighbours turn by at least, rad/s, about one axis to the same side. A coarse sensor that swings through nought may read zero.
const TURNED_RAD_PER_S: f64 = 0.2;
/// Neighbours are no further apart than this, in steps: one more may be lost on either side of one, or three may be filled with zeros.
const BESIDE: f64 = 4.5;
/// With longer steps, s, a whole blow fits between two neighbours.
const LONGEST_STEP_S: f64 = 0.05;

/// One line for people.
pub fn told(count: usize, all: usize) -> String {
    format!(
        "{count} of {all} samples lie beyond what anything carried feels (more than {:.0} {} or {:.0} {} from both neighbours, or nothing at all between others) and count as lost",
        beyond(Instrument::Accelerometer),
        Instrument::Accelerometer.unit(),
        beyond(Instrument::Gyroscope),
        Instrument::Gyroscope.unit(),
    )
}

/// Which samples are, ascending. No leap beside another: what leaps twice in a row may be a blow.
pub fn strays(track: &Track) -> Vec<usize> {
    let usual_s = track.period_s().unwrap_or(f64::INFINITY);
    // A clock errs.
    if usual_s > 1.01 * LONGEST_STEP_S {
        return Vec::new();
    }
    let beside = |a: usize, b: usize| track.t_s[b] - track.t_s[a] < BESIDE * usual_s;
    let is = |k: usize| {
        let leaps = |of: &Instrument| leaps(track.readings(*of), *of, k);
        beside(k - 1, k + 1) && Instrument::BOTH.iter().any(leaps)
    };
    let inner = 1..track.len().saturating_sub(1);
    let mut found: Vec<usize> = inner.clone().filter(|k| is(*k)).collect();
    let all = found.clone();
    found.retain(|k| ![k - 1, k + 1].iter().any(|k| all.binary_search(k).is_ok()));
    for of in Instrument::BOTH {
        let within = |run: &Range<usize>| run.start >= inner.start && run.end <= inner.end;
        let empty = runs(track.readings(of))
            .filter(|run| within(run) && beside(run.start - 1, run.end))
            .filter(|run| is_empty(track, of, run));
        found.extend(empty.flatten());
    }
    found.sort_unstable();
    found.dedup();
    found
}

/// Readings of nothing at all between others of something. An accelerometer may float; a message that was filled with zeros lacks the rate too.
fn is_empty(track: &Track, of: Instrument, run: &Range<usize>) -> bool {
    let [before, behind] = [run.start - 1, run.end];
    let read = |of, k: usize| Vector3::from(track.readings(of)[k]);
    let nothing = |of| run.clone().all(|k| read(of, k) == Vector3::zeros());
    let [a, b] = [before, behind].map(|k| read(Instrument::Gyroscope, k));
    if !nothing(of) {
        return false;
    }
    match of {
        Instrument::Gyroscope => {
            let (a_turns, b_turns) = (a.norm(), b.norm());
            a_turns.min(b_turns) > TURNED_RAD_PER_S && a.dot(&b) > 0.5 * a_turns * b_turns
        }
        Instrument::Accelerometer => {
            let feels = |k| read(of, k).norm() > FELT_M_PER_S2;
            let turns = a != Vector3::zeros() && b != Vector3::zeros();
            feels(before)
                && feels(behind)
                && (run.len() == 1 || (turns && nothing(Instrument::Gyroscope)))
        }
    }
}

fn leaps(x: &[[f64; 3]], of: Instrument, k: usize) -> bool {
    let beyond = beyond(of);
    (0..3).any(|axis| {
        let [a, here, b] = [k - 1, k, k + 1].map(|k| x[k][axis]);
        let [up, down] = [here - a, here - b];
        up.abs().min(down.abs()) > beyond && up * down > 0.0 && (a - b).abs() < AGREE * beyond
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A sway at so many samples a second.
    fn swaying(rate_hz: f64) -> Track {
        let mut track = Track::default();
        for k in 0..1000 {
            let t = f64::from(k) / rate_hz;
            let swing = (6.9 * t).sin();
            track.t_s.push(t);
            track.gyro_rad_per_s.push([2.0 * swing, 0.0, 0.1]);
            track.accel_m_per_s2.push([3.0 * swing, 0.0, 9.8]);
        }
        track
    }

    #[test]
    fn a_sample_that_nothing_carried_could_feel_is_found() {
        let mut track = swaying(100.0);
        assert!(strays(&track).is_empty());
        track.accel_m_per_s2[100] = [2000.0, -1500.0, 700.0];
        track.accel_m_per_s2[200] = [0.0, 0.0, -156.9];
        track.accel_m_per_s2[300] = [0.0; 3];
        track.gyro_rad_per_s[400] = [0.0, 34.9, 0.0];
        track.gyro_rad_per_s[404] = [-34.9, 34.9, 0.0];
        assert_eq!(strays(&track), [100, 200, 300, 400, 404]);
    }

    /// A rate of nothing while it turns, of which there are none where it swings through nought; and one beside a sample that was lost.
    #[test]
    fn a_rate_of_nothing_and_one_beside_a_lost_sample_are_found() {
        let mut track = swaying(100.0);
        let turns = |track: &Track, k: usize| track.gyro_rad_per_s[k][0].abs();
        let fast = (500..600).find(|k| turns(&track, *k) > 1.9).unwrap();
        let turning = (600..700).find(|k| turns(&track, *k) < 0.02).unwrap();
        track.gyro_rad_per_s[fast] = [0.0; 3];
        track.gyro_rad_per_s[turning] = [0.0; 3];
        track.accel_m_per_s2[100] = [0.0, 0.0, -156.9];
        let beside = track.without(&[99]);
        assert_eq!(strays(&beside), [99, fast - 1]);
    }

    /// A dropout of the gyroscope, and messages filled with zeros, two and three in a row; not four, nor where it swings through nought.
    #[test]
    fn zeros_in_a_row_are_found() {
        let whole = swaying(100.0);
        let turns = |k: usize| whole.gyro_rad_per_s[k][0].abs();
        let fast = |from: usize| (from..1000).find(|k| turns(*k) > 1.8).unwrap();
        let slow = |from: usize| (from..1000).find(|k| turns(*k) < 0.05).unwrap();
        let (two, three, four) = (fast(100), fast(200), fast(300));
        let (filled, through) = (slow(400), slow(500));
        let mut track = whole.clone();
        for (from, count) in [
            (two, 2),
            (three, 3),
            (four, 4),
            (through - 1, 3),
            (filled, 2),
        ] {
            track.gyro_rad_per_s[from..from + count].fill([0.0; 3]);
        }
        track.accel_m_per_s2[filled..filled + 2].fill([0.0; 3]);
        let found = [two..two + 2, three..three + 3, filled..filled + 2];
        assert_eq!(
            strays(&track),
            found.into_iter().flatten().collect::<Vec<_>>()
        );
    }

    /// Blows of one sample and of two, one that leaves the sensor elsewhere, a buzz, free flight, and all that at 10 Hz.
    #[test]
    fn a_blow_is_none() {
        let mut track = swaying(100.0);
        let up = |track: &mut Track, k: usize, z: f64| track.accel_m_per_s2[k][2] = z;
        up(&mut track, 100, 100.0);
        for k in [200, 201] {
            up(&mut track, k, 150.0);
        }
        for (k, z) in [(300, 60.0), (301, 155.0), (302, 20.0)] {
            up(&mut track, k, z);
        }
        for k in 400..420 {
            up(&mut track, k, 9.8 + if k % 2 == 0 { 60.0 } else { -60.0 });
        }
        track.accel_m_per_s2[500..503].fill([0.0; 3]);
        track.accel_m_per_s2[600] = [0.0, 0.0, 1e-3];
        track.gyro_rad_per_s[700][0] += 15.0;
        assert!(strays(&track).is_empty(), "{:?}", strays(&track));
        let mut slow = swaying(10.0);
        slow.accel_m_per_s2[100] = [0.0, 0.0, 150.0];
        assert!(strays(&slow).is_empty());
    }

    #[test]
    fn nothing_is_found_in_nothing() {
        for n in 0..3 {
            assert!(strays(&swaying(100.0).part(0..n)).is_empty());
        }
    }
}
