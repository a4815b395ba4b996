//! Readings that only repeat: who polls a sensor faster than it measures, or writes several into one table, holds each one's last value between its samples.

/// Which readings are new, ascending, where others only repeat the one before; `None` where they do not.
///
/// Held is what repeats the row before to the last digit in at least a quarter of the rows, about as often each time: of a sensor with few digits that hardly
/// moves, values last now short, now long. What lasts for longer is no less a sample: a device lies still, or its driver has stopped.
pub fn new_readings(readings: &[[f64; 3]]) -> Option<Vec<usize>> {
    let bits = |reading: &[f64; 3]| reading.map(f64::to_bits);
    let lasts = || readings.chunk_by(|a, b| bits(a) == bits(b)).map(<[_]>::len);
    let mut sorted: Vec<usize> = lasts().collect();
    sorted.sort_unstable();
    let most = sorted.get(sorted.len() / 2)? * 3 / 2 + 1;
    let even = sorted.partition_point(|count| *count <= most);
    let rows: usize = sorted[..even].iter().sum();
    let is_held = even >= 8 && even * 4 <= rows * 3 && even * 20 >= sorted.len() * 19;
    if !is_held {
        return None;
    }
    let mut new = Vec::with_capacity(readings.len());
    let mut first = 0;
    for count in lasts() {
        let alone = if count > most { count } else { 1 };
        new.extend(first..first + alone);
        first += count;
    }
    Some(new)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn swaying(k: usize) -> [f64; 3] {
        let x = (0.1 * k as f64).sin();
        [x, 0.5 * x, 9.8]
    }

    #[test]
    fn what_repeats_evenly_is_held() {
        // Twice or three times by turns, as a clock of its own has it.
        let held: Vec<[f64; 3]> = (0..1000).map(|k| swaying(2 * k / 5)).collect();
        let new = new_readings(&held).unwrap();
        assert_eq!(new.len(), 400);
        assert!(new.iter().all(|k| *k == 0 || held[*k] != held[k - 1]));
        assert_eq!(new_readings(&held[..15]), None);
        let all: Vec<[f64; 3]> = (0..1000).map(swaying).collect();
        assert_eq!(new_readings(&all), None);
        assert_eq!(new_readings(&[]), None);
    }

    /// A device that lies still for two fifths of the time to the last digit, and one of few digits.
    #[test]
    fn what_stands_still_is_not() {
        let rests = |every: usize| -> Vec<[f64; 3]> {
            let at = |k: usize| swaying(k.max(400) / every);
            (0..1000).map(at).collect()
        };
        assert_eq!(new_readings(&rests(1)), None);
        let new = new_readings(&rests(2)).unwrap();
        assert_eq!(new.len(), 402 + 299);
        let coarse: Vec<[f64; 3]> = (0..1000)
            .map(|k| swaying(k).map(|x| (20.0 * x).round() / 20.0))
            .collect();
        assert_eq!(new_readings(&coarse), None);
    }
}
