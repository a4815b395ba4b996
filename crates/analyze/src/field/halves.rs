//! Two topics of one device, the gyroscope's and the accelerometer's, as drivers of depth cameras publish them: each message fills its half and leaves zeros
//! in the other.

use std::sync::Arc;

use recording::signal::{Signal, field_of};

use super::columns::{ACCEL, ACCEL_MARK, Columns, GYRO, GYRO_MARK};
use crate::inputs::drawn_within;

/// Gives `topic` what only its other half measures: all is put where the acceleration was measured, the angular velocity drawn between its own samples and NaN
/// in their holes. An acceleration that is drawn between few samples would look like one of many, and lacks how hard it lands. What was done, or why nothing, in a
/// sentence.
pub(super) fn join(
    columns: &mut Columns,
    topic: &str,
    other: &str,
    stamped: &[&str],
) -> Option<String> {
    let lacks = |topic: &str| {
        [(GYRO, GYRO_MARK), (ACCEL, ACCEL_MARK)]
            .map(|(fields, mark)| nothing(columns, topic, fields, mark))
    };
    let (turns, feels, what) = match (lacks(topic), lacks(other)) {
        ([false, true], [true, false]) => (topic, other, "acceleration"),
        ([true, false], [false, true]) => (other, topic, "angular velocity"),
        _ => {
            return Some(format!(
                "by its name {other} is the other half of this device, but the two are not an accelerometer and a gyroscope alone: it is left aside"
            ));
        }
    };
    let at_s = columns.dates(feels, ACCEL[0], stamped)?.t_s;
    let taken_s = columns.dates(turns, GYRO[0], stamped)?.t_s;
    let axis = columns.get(feels, ACCEL[0])?.times_ns.clone();
    let rates = columns
        .values(turns, GYRO)?
        .map(|x| put(&taken_s, x, &at_s));
    let signal = |field: &str, times_ns: &Arc<[i64]>, values: Vec<f64>| Signal {
        topic: topic.to_owned(),
        path: format!("{topic}.{field}"),
        unit: String::new(),
        times_ns: times_ns.clone(),
        values,
    };
    let without = |field: &&str| !GYRO.contains(field) && *field != GYRO_MARK;
    let of_feeling = columns.signals.iter().filter_map(|s| {
        let field = field_of(&s.path, feels).filter(without)?;
        Some(signal(field, &s.times_ns, s.values.clone()))
    });
    let rates = GYRO.iter().zip(rates);
    let rates = rates.map(|(field, values)| signal(field, &axis, values));
    let joined: Vec<Signal> = of_feeling.chain(rates).collect();
    let others = |s: &Signal| field_of(&s.path, topic).is_none();
    columns.signals.retain(others);
    columns.signals.extend(joined);
    Some(format!(
        "its {what} is that of {other}, and the angular velocity is drawn between its samples to where the acceleration was measured: by their names they are halves of one device"
    ))
}

/// Whether a topic has no such columns, or only zeros in them, or says that it has none.
fn nothing(columns: &Columns, topic: &str, fields: [&str; 3], mark: &str) -> bool {
    let empty = |x: &&[f64]| x.iter().all(|x| *x == 0.0 || x.is_nan());
    let mark = columns.get(topic, mark).map(|s| &s.values[..]);
    let says = mark.is_some_and(|mark| mark.iter().all(|m| *m == -1.0));
    says || columns
        .values(topic, fields)
        .is_none_or(|values| values.iter().all(empty))
}

/// `x` of times in any order at other times in any order.
fn put(t_s: &[f64], x: &[f64], at_s: &[f64]) -> Vec<f64> {
    let known = t_s.iter().copied().zip(x.iter().copied());
    let mut known: Vec<(f64, f64)> = known
        .filter(|(t, x)| t.is_finite() && x.is_finite())
        .collect();
    known.sort_by(|a, b| a.0.total_cmp(&b.0));
    known.dedup_by(|b, a| b.0 <= a.0);
    let (t_s, x): (Vec<f64>, Vec<f64>) = known.into_iter().unzip();
    let mut order: Vec<usize> = (0..at_s.len()).collect();
    order.sort_by(|a, b| at_s[*a].total_cmp(&at_s[*b]));
    let sorted: Vec<f64> = order.iter().map(|k| at_s[*k]).collect();
    let mut out = vec![f64::NAN; at_s.len()];
    for (k, y) in order.into_iter().zip(drawn_within(&t_s, &x, &sorted)) {
        out[k] = y;
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    const ROLL: f64 = 0.1;
    const W: f64 = 12.0;

    /// A topic of ROS's six columns at such times; what it does not measure is 0.
    fn topic(name: &str, times_ns: &[i64], six: impl Fn(f64) -> [f64; 6]) -> Vec<Signal> {
        let rows: Vec<[f64; 6]> = times_ns.iter().map(|t| six(*t as f64 / 1e9)).collect();
        let fields = GYRO.iter().chain(&ACCEL).enumerate();
        let signals = fields.map(|(k, field)| Signal {
            topic: name.to_owned(),
            path: format!("{name}.{field}"),
            unit: String::new(),
            times_ns: times_ns.into(),
            values: rows.iter().map(|row| row[k]).collect(),
        });
        signals.collect()
    }

    fn gyro(t: f64) -> [f64; 6] {
        [ROLL * W * (W * t).cos(), 0.0, 0.0, 0.0, 0.0, 0.0]
    }

    fn accel(t: f64) -> [f64; 6] {
        let roll = ROLL * (W * t).sin();
        [0.0, 0.0, 0.0, 0.0, 9.81 * roll.sin(), 9.81 * roll.cos()]
    }

    /// 400 Hz from 0.1 s on; 62.5 Hz between other times, without 1 s.
    fn times_ns() -> [Vec<i64>; 2] {
        let fast = (0..1200).map(|k| 100_000_000 + 2_500_000 * k);
        let slow = (0..200).map(|k| 300_000 + 16_000_000 * k);
        let there = |t: &i64| !(1_000_000_000..2_000_000_000).contains(t);
        [fast.collect(), slow.filter(there).collect()]
    }

    #[test]
    fn the_half_that_a_topic_lacks_is_put_where_the_acceleration_was_measured() {
        let [fast, slow] = times_ns();
        for (of_gyro, of_accel, keeps_gyro) in [
            (&fast, &slow, true),
            (&fast, &slow, false),
            (&slow, &fast, true),
            (&slow, &fast, false),
        ] {
            let signals = [
                topic("/gyro", of_gyro, gyro),
                topic("/accel", of_accel, accel),
            ];
            let mut columns = Columns::new(signals.concat(), 0);
            let (keeps, gives) = match keeps_gyro {
                true => ("/gyro", "/accel"),
                false => ("/accel", "/gyro"),
            };
            let told = join(&mut columns, keeps, gives, &["/gyro", "/accel"]).unwrap();
            assert!(told.contains(gives), "{told}");
            let felt = columns.values(keeps, ACCEL).unwrap();
            let [x, ..] = columns.values(keeps, GYRO).unwrap();
            assert_eq!(*columns.get(keeps, GYRO[0]).unwrap().times_ns, **of_accel);
            let mut there = 0;
            for (k, t_ns) in of_accel.iter().enumerate() {
                let t = *t_ns as f64 / 1e9;
                assert_eq!(felt.map(|x| x[k]), accel(t)[3..]);
                // Within the gyroscope's times, but for its hole.
                let measured = match of_gyro == &fast {
                    true => (0.1..=0.1 + 1199.0 * 0.0025).contains(&t),
                    false => !(0.9924..2.0003).contains(&t),
                };
                match measured {
                    true => assert!((x[k] - gyro(t)[0]).abs() < 1e-4, "{t}: {}", x[k]),
                    false => assert!(x[k].is_nan(), "{t}: {}", x[k]),
                }
                there += usize::from(measured);
            }
            assert!(there > 100, "{there}");
        }
    }

    #[test]
    fn two_whole_sensors_are_no_halves() {
        let [fast, slow] = times_ns();
        let whole = |t: f64| {
            let mut six = accel(t);
            six[0] = gyro(t)[0];
            six
        };
        for (g, told) in [
            (whole as fn(f64) -> [f64; 6], "left aside"),
            (gyro, "is that of"),
        ] {
            let signals = [topic("/gyro", &fast, g), topic("/accel", &slow, accel)];
            let mut columns = Columns::new(signals.concat(), 0);
            let text = join(&mut columns, "/gyro", "/accel", &["/gyro", "/accel"]).unwrap();
            assert!(text.contains(told), "{text}");
            assert_eq!(columns.signals.len(), 12);
        }
    }

    /// Those who say that they lack it are believed, and the word is taken from what has it now.
    #[test]
    fn marks_tell_halves_too() {
        let [fast, slow] = times_ns();
        let mark = |name: &str, mark: &str, times_ns: &[i64]| Signal {
            topic: name.to_owned(),
            path: format!("{name}.{mark}"),
            unit: String::new(),
            times_ns: times_ns.into(),
            values: vec![-1.0; times_ns.len()],
        };
        let rest = |six: [f64; 6]| six.map(|x| if x == 0.0 { 0.5 } else { x });
        let mut signals = topic("/gyro", &fast, |t| rest(gyro(t)));
        signals.extend(topic("/accel", &slow, |t| rest(accel(t))));
        signals.push(mark("/gyro", ACCEL_MARK, &fast));
        signals.push(mark("/accel", GYRO_MARK, &slow));
        let mut columns = Columns::new(signals, 0);
        join(&mut columns, "/gyro", "/accel", &["/gyro", "/accel"]).unwrap();
        assert!(columns.get("/gyro", ACCEL_MARK).is_none());
        assert!(columns.get("/gyro", GYRO_MARK).is_none());
        assert!(columns.get("/accel", GYRO_MARK).is_some());
        let [_, _, z] = columns.values("/gyro", ACCEL).unwrap();
        assert_eq!(z[0], accel(3e-4)[5]);
    }
}
