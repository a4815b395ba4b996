//! Quaternions as roll, pitch and yaw.

use std::collections::{BTreeMap, HashMap};

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
    values: [Vec<f64>; 3],
    /// Quaternions that are no rotation, by their path without the last part: channel, how many, log time of the first (ns).
    pub odd: BTreeMap<String, (usize, u64, i64)>,
}

struct Found {
    paths: [String; 3],
    columns: [usize; 4],
}

impl Quaternions {
    /// Gives path, rows and values of every angle of every quaternion in the batch: in the messages that have all of it.
    pub fn each(&mut self, batch: &Batch<'_>, mut sink: impl FnMut(&str, Option<&[u32]>, &[f64])) {
        let entry = self.known.entry(batch.channel).or_default();
        let columns = || batch.columns.iter().map(|c| c.id);
        if !entry.0.iter().copied().eq(columns()) {
            *entry = (columns().collect(), find(batch));
        }
        for found in &entry.1 {
            let rows = batch.columns[found.columns[0]].rows;
            // Where its parts are in other messages each, it is in none.
            if found.columns.iter().any(|c| batch.columns[*c].rows != rows) {
                continue;
            }
            let [x, y, z, w] = found.columns.map(|c| batch.columns[c].values);
            self.values.iter_mut().for_each(Vec::clear);
            for (((x, y), z), w) in x.iter().zip(y).zip(z).zip(w) {
                for (column, angle) in self.values.iter_mut().zip(angles(*x, *y, *z, *w)) {
                    column.push(angle);
                }
            }
            let finite = |k: usize| [x, y, z, w].iter().all(|part| part[k].is_finite());
            let odd = |k: &usize| self.values[0][*k].is_nan() && finite(*k);
            let mut odd = (0..x.len()).filter(odd);
            if let Some(k) = odd.next() {
                let roll = &found.paths[0];
                let path = roll.strip_suffix(".roll").unwrap_or(roll).to_owned();
                let first_ns = batch.times_ns[rows.map_or(k, |rows| rows[k] as usize)];
                let known = self.odd.entry(path).or_insert((batch.channel, 0, first_ns));
                known.1 += 1 + odd.count() as u64;
            }
            for (path, values) in found.paths.iter().zip(&self.values) {
                sink(path, rows, values);
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

    #[test]
    fn what_a_batch_lacks_or_has_elsewhere_is_looked_for_again() {
        let one = [1.0];
        let column = |id: usize, rows| recording::read::Column {
            id,
            path: ["/a.q.x", "/a.q.y", "/a.q.z", "/a.q.w", "/a.p.w"][id],
            rows,
            values: &one,
            finite: true,
        };
        let mut quaternions = Quaternions::default();
        let mut found = |columns: &[recording::read::Column<'_>]| {
            let batch = Batch {
                channel: 0,
                topic: "/a",
                schema: "",
                times_ns: &[0],
                stamps_ns: None,
                columns,
            };
            let mut count = 0;
            quaternions.each(&batch, |path, _, _| {
                count += usize::from(path.starts_with("/a.q."))
            });
            count
        };
        let rows = [0];
        let first = [0, 1, 2, 4, 3].map(|id| column(id, (id == 1).then_some(&rows[..])));
        assert_eq!(found(&first), 0, "y is in other messages than x");
        let late = [0, 1, 2, 4, 3].map(|id| column(id, Some(&rows[..])));
        assert_eq!(found(&late), 3, "all of it is in some messages");
        assert_eq!(found(&[0, 1, 2, 4, 3].map(|id| column(id, None))), 3);
        assert_eq!(found(&[4, 3, 2, 1, 0].map(|id| column(id, None))), 3);
        assert_eq!(found(&[0, 1, 2, 4].map(|id| column(id, None))), 0);
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
