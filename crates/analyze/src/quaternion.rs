//! Quaternions as roll, pitch and yaw.

use std::collections::{BTreeMap, HashMap, HashSet};

use recording::read::Batch;

/// The last parts of the paths that a quaternion gives.
pub const ANGLES: [&str; 3] = ["roll", "pitch", "yaw"];

/// Roll, pitch and yaw of a rotation, R = R_z(yaw) R_y(pitch) R_x(roll) (REP-103).
///
/// ```text
/// roll  = atan2(2(wx + yz), 1 − 2(x² + y²))
/// pitch = asin(2(wy − zx))
/// yaw   = atan2(2(wz + xy), 1 − 2(y² + z²))
/// ```
/// (x, y, z, w) any multiple of a unit quaternion (1); angles (rad), pitch within ±π/2. At pitch = ±π/2 roll and yaw are only known together:
/// their difference or sum stays right. A quaternion whose norm² lies outside 0.5 … 2 is none: NaN. Source: REP-103; Diebel (2006).
pub fn angles(x: f64, y: f64, z: f64, w: f64) -> [f64; 3] {
    let n = x * x + y * y + z * z + w * w;
    if !(0.5..=2.0).contains(&n) {
        return [f64::NAN; 3];
    }
    let roll = (2.0 * (w * x + y * z)).atan2(n - 2.0 * (x * x + y * y));
    let pitch = (2.0 * (w * y - z * x) / n).clamp(-1.0, 1.0).asin();
    let yaw = (2.0 * (w * z + x * y)).atan2(n - 2.0 * (y * y + z * z));
    [roll, pitch, yaw]
}

/// Finds the quaternions among a batch's columns.
#[derive(Default)]
pub(crate) struct Quaternions {
    /// By channel: the columns of a batch, and what was found among them. Another batch of the channel may have others, or the same in another
    /// order.
    known: HashMap<usize, (Vec<usize>, Vec<Found>)>,
    /// Fields that are called as an angle would be: their own values are told under that name.
    own: HashSet<String>,
    rows: Vec<u32>,
    values: [Vec<f64>; 3],
    /// Quaternions that are no rotation, by their path without the last part: channel, how many, log time of the first (ns).
    pub odd: BTreeMap<String, (usize, u64, i64)>,
}

struct Found {
    paths: [String; 3],
    columns: [usize; 4],
}

impl Quaternions {
    /// Gives path, rows and values of every angle of every quaternion in the batch: in exactly those messages that have all of it, and unless the
    /// messages have a field of that name.
    pub fn each(&mut self, batch: &Batch<'_>, mut sink: impl FnMut(&str, Option<&[u32]>, &[f64])) {
        let entry = self.known.entry(batch.channel).or_default();
        let columns = || batch.columns.iter().map(|c| c.id);
        if !entry.0.iter().copied().eq(columns()) {
            *entry = (columns().collect(), find(batch));
            let angle = |path: &&str| {
                let last = path.rsplit_once('.').map(|(_, last)| last);
                last.is_some_and(|last| ANGLES.contains(&last))
            };
            let own = batch.columns.iter().map(|c| c.path).filter(angle);
            self.own.extend(own.map(str::to_owned));
        }
        for found in &entry.1 {
            self.rows.clear();
            self.values.iter_mut().for_each(Vec::clear);
            let columns = found.columns.map(|c| &batch.columns[c]);
            let mut next = [0; 4];
            let (mut odd, mut first_ns) = (0, 0);
            // OK because rows are counted in u32.
            for (row, time_ns) in (0u32..).zip(batch.times_ns) {
                let mut part = |i: usize| {
                    let at: usize = next[i];
                    let here = (columns[i].rows).is_none_or(|rows| rows.get(at) == Some(&row));
                    next[i] += usize::from(here);
                    here.then(|| columns[i].values[at])
                };
                let [Some(x), Some(y), Some(z), Some(w)] = [part(0), part(1), part(2), part(3)]
                else {
                    continue;
                };
                let found = angles(x, y, z, w);
                if found[0].is_nan() && [x, y, z, w].iter().all(|part| part.is_finite()) {
                    if odd == 0 {
                        first_ns = *time_ns;
                    }
                    odd += 1;
                }
                self.rows.push(row);
                for (column, angle) in self.values.iter_mut().zip(found) {
                    column.push(angle);
                }
            }
            if odd > 0 {
                let roll = &found.paths[0];
                let path = roll.strip_suffix(".roll").unwrap_or(roll).to_owned();
                let known = self.odd.entry(path).or_insert((batch.channel, 0, first_ns));
                known.1 += odd;
            }
            if self.rows.is_empty() {
                continue;
            }
            let rows = (self.rows.len() < batch.times_ns.len()).then_some(&*self.rows);
            for (path, values) in found.paths.iter().zip(&self.values) {
                if !self.own.contains(path) {
                    sink(path, rows, values);
                }
            }
        }
    }
}

/// Columns that end in .x, .y, .z and .w after the same path.
fn find(batch: &Batch<'_>) -> Vec<Found> {
    let place: HashMap<&str, usize> = batch
        .columns
        .iter()
        .enumerate()
        .map(|(k, c)| (c.path, k))
        .collect();
    let mut found = Vec::new();
    for column in batch.columns {
        let Some(prefix) = column.path.strip_suffix(".w") else {
            continue;
        };
        let at = |last: &str| place.get(format!("{prefix}.{last}").as_str()).copied();
        if let (Some(x), Some(y), Some(z), Some(w)) = (at("x"), at("y"), at("z"), at("w")) {
            found.push(Found {
                paths: ANGLES.map(|a| format!("{prefix}.{a}")),
                columns: [x, y, z, w],
            });
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    type Columns = [(usize, Option<&'static [u32]>)];

    /// The angles of `/a.q` in a batch of two messages: which, and in which of the messages; columns are given by number, with their rows.
    fn found(quaternions: &mut Quaternions, columns: &Columns) -> Vec<(String, Vec<u32>)> {
        let named = [
            ("/a.q.x", 0.1),
            ("/a.q.y", 0.2),
            ("/a.q.z", 0.3),
            ("/a.q.w", 0.9),
            ("/a.p.w", 1.0),
            ("/a.q.yaw", 7.0),
        ];
        let values = named.map(|(_, x)| [x; 2]);
        let column = |(id, rows): &(usize, Option<&'static [u32]>)| recording::read::Column {
            id: *id,
            path: named[*id].0,
            rows: *rows,
            values: &values[*id][..rows.map_or(2, <[u32]>::len)],
            finite: true,
        };
        let columns: Vec<_> = columns.iter().map(column).collect();
        let batch = Batch {
            channel: 0,
            topic: "/a",
            schema: "",
            times_ns: &[0, 1],
            stamps_ns: None,
            columns: &columns,
        };
        let mut out = Vec::new();
        quaternions.each(&batch, |path, rows, values| {
            let rows = rows.map_or_else(|| vec![0, 1], <[u32]>::to_vec);
            let expected = angles(0.1, 0.2, 0.3, 0.9);
            let angle = ANGLES.iter().position(|last| path.ends_with(last)).unwrap();
            assert_eq!(values, vec![expected[angle]; rows.len()]);
            out.push((path.to_owned(), rows));
        });
        out
    }

    #[test]
    fn what_a_batch_lacks_or_has_elsewhere_is_looked_for_again() {
        let mut quaternions = Quaternions::default();
        let mut count = |columns: &Columns| found(&mut quaternions, columns).len();
        let rows = |rows| move |id| (id, rows);
        let mut first = [0, 1, 2, 4, 3].map(rows(Some(&[0][..])));
        first[1].1 = Some(&[1]);
        assert_eq!(count(&first), 0, "y is in other messages than x");
        let late = [0, 1, 2, 4, 3].map(rows(Some(&[0][..])));
        assert_eq!(count(&late), 3, "all of it is in some messages");
        assert_eq!(count(&[0, 1, 2, 4, 3].map(rows(None))), 3);
        assert_eq!(count(&[4, 3, 2, 1, 0].map(rows(None))), 3);
        assert_eq!(count(&[0, 1, 2, 4].map(rows(None))), 0);
    }

    #[test]
    fn angles_are_where_all_four_parts_are() {
        let mut quaternions = Quaternions::default();
        let columns = [(0, None), (1, None), (2, Some(&[1][..])), (3, None)];
        let expected = ANGLES.map(|angle| (format!("/a.q.{angle}"), vec![1]));
        assert_eq!(found(&mut quaternions, &columns), expected);
    }

    #[test]
    fn a_field_of_the_message_is_not_told_as_an_angle() {
        let mut quaternions = Quaternions::default();
        let names = |found: Vec<(String, Vec<u32>)>| -> Vec<String> {
            found.into_iter().map(|(path, _)| path).collect()
        };
        for columns in [&[0, 1, 2, 3, 5][..], &[0, 1, 2, 3]] {
            let columns: Vec<_> = columns.iter().map(|id| (*id, None)).collect();
            let found = names(found(&mut quaternions, &columns));
            assert_eq!(found, ["/a.q.roll", "/a.q.pitch"]);
        }
    }

    #[test]
    fn angles_come_back_from_the_quaternion_they_made() {
        for (roll, pitch, yaw) in [
            (0.1, 0.2, 0.3),
            (-2.0, 1.2, 3.0),
            (3.0, -1.5, -0.1),
            (0.0, 0.0, 0.0),
        ] {
            let half = |a: f64| (a / 2.0).sin_cos();
            let ((sr, cr), (sp, cp), (sy, cy)) = (half(roll), half(pitch), half(yaw));
            let w = cr * cp * cy + sr * sp * sy;
            let x = sr * cp * cy - cr * sp * sy;
            let y = cr * sp * cy + sr * cp * sy;
            let z = cr * cp * sy - sr * sp * cy;
            // Any multiple stands for the same rotation.
            let k = 1.1;
            for (a, b) in angles(k * x, k * y, k * z, k * w)
                .iter()
                .zip([roll, pitch, yaw])
            {
                assert!((a - b).abs() < 1e-12, "{a} {b}");
            }
        }
        assert!(angles(0.0, 0.0, 0.0, 0.0)[0].is_nan());
        let upright = angles(0.0, 0.5f64.sqrt(), 0.0, 0.5f64.sqrt());
        assert!((upright[1] - std::f64::consts::FRAC_PI_2).abs() < 1e-7);
    }
}
