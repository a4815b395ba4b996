//! An inertial sensor: thinned curves, spectra and an estimate of its attitude, from samples that stream by.

use analyze::imu::orientation;
use analyze::spectrum::stream::WelchStream;
use analyze::spectrum::{DEFAULT_SEGMENT_S, Options, Spectrum};
use recording::read::Batch;

use super::stream::push;
use crate::take::{Curve, Sensor};
use crate::thin::Thin;

/// A sensor while it streams by.
pub struct Stream {
    gyro: [Thin; 3],
    accel: [Thin; 3],
    gyro_spectra: [Option<WelchStream>; 3],
    accel_spectra: [Option<WelchStream>; 3],
    filter: Option<orientation::Causal>,
    attitude: [Thin; 2],
    last_ns: Option<i64>,
    period_s: f64,
}

impl Stream {
    /// For a sensor of this rate; `thin` begins a curve of this name.
    pub fn new(rate_hz: f64, mut thin: impl FnMut(&str) -> Thin) -> Self {
        let welch =
            || WelchStream::new(rate_hz, &Options::seconds(DEFAULT_SEGMENT_S, rate_hz)).ok();
        let axes = ["x", "y", "z"];
        Stream {
            gyro: axes.map(&mut thin),
            accel: axes.map(&mut thin),
            gyro_spectra: axes.map(|_| welch()),
            accel_spectra: axes.map(|_| welch()),
            filter: None,
            attitude: ["roll", "pitch"].map(&mut thin),
            last_ns: None,
            period_s: 1.0 / rate_hz,
        }
    }

    /// Takes the next samples.
    pub fn push(&mut self, batch: &Batch<'_>) {
        let mut columns: [Option<&[f64]>; 6] = [None; 6];
        for column in batch.columns {
            let of = |field: &str, base: usize| {
                let axis = column
                    .path
                    .strip_prefix(batch.topic)?
                    .strip_prefix('.')?
                    .strip_prefix(field)?;
                Some(base + ["x", "y", "z"].iter().position(|a| *a == axis)?)
            };
            let Some(k) = of("angular_velocity.", 0).or_else(|| of("linear_acceleration.", 3))
            else {
                continue;
            };
            let (thin, welch) = match k {
                0..3 => (&mut self.gyro[k], &mut self.gyro_spectra[k]),
                _ => (&mut self.accel[k - 3], &mut self.accel_spectra[k - 3]),
            };
            push(thin, batch.times_ns, column.rows, column.values);
            match welch {
                Some(welch) if column.values.iter().all(|x| x.is_finite()) => {
                    welch.push(column.values)
                }
                // A hole in the samples would be a jump in the phase of every line: no spectrum rather than a wrong one.
                welch => *welch = None,
            }
            if column.rows.is_none() {
                columns[k] = Some(column.values);
            }
        }
        if let [Some(gx), Some(gy), Some(gz), Some(ax), Some(ay), Some(az)] = columns {
            self.turn(batch.times_ns, [gx, gy, gz], [ax, ay, az]);
        }
    }

    /// Runs the causal orientation filter over a batch.
    fn turn(&mut self, times_ns: &[i64], gyro: [&[f64]; 3], accel: [&[f64]; 3]) {
        let period_s = self.period_s;
        let filter = self.filter.get_or_insert_with(|| {
            orientation::Causal::new(period_s, orientation::Options::default())
        });
        let mut times = Vec::with_capacity(times_ns.len());
        let mut angles = [
            Vec::with_capacity(times_ns.len()),
            Vec::with_capacity(times_ns.len()),
        ];
        for (k, t) in times_ns.iter().enumerate() {
            let (w, a) = (gyro.map(|g| g[k]), accel.map(|a| a[k]));
            let dt_s = self
                .last_ns
                .map_or(period_s, |last| t.saturating_sub(last) as f64 / 1e9);
            let whole = w.iter().chain(&a).all(|x| x.is_finite());
            if dt_s <= 0.0 || !whole {
                continue;
            }
            self.last_ns = Some(*t);
            let (roll, pitch, _) = filter.update(dt_s, w, a).euler_angles();
            times.push(*t);
            angles[0].push(roll.to_degrees());
            angles[1].push(pitch.to_degrees());
        }
        for (thin, angles) in self.attitude.iter_mut().zip(&angles) {
            thin.push(&times, angles);
        }
    }

    /// What is drawn of it.
    pub fn finish(self, topic: &str) -> Sensor {
        let curves = |thin: [Thin; 3]| -> Vec<Curve> {
            let curves: Vec<Curve> = thin.into_iter().map(Thin::finish).collect();
            // A field that the sensor does not have stands in its messages as zeros.
            let any = |c: &Curve| c.values.iter().any(|x| x.is_finite() && *x != 0.0);
            if curves.iter().any(any) {
                curves
            } else {
                Vec::new()
            }
        };
        let spectra = |welch: [Option<WelchStream>; 3]| -> Vec<Spectrum> {
            let all: Option<Vec<Spectrum>> = welch.into_iter().map(|w| w?.finish().ok()).collect();
            all.unwrap_or_default()
        };
        let attitude: Vec<Curve> = self.attitude.into_iter().map(Thin::finish).collect();
        let (gyro, accel) = (curves(self.gyro), curves(self.accel));
        // Without a gyroscope there is an average inclination at best: nothing to call a roll.
        let none = gyro.is_empty() || attitude[0].values.is_empty();
        Sensor {
            topic: topic.to_owned(),
            gyro,
            accel,
            attitude: if none { Vec::new() } else { attitude },
            gyro_spectra: spectra(self.gyro_spectra),
            accel_spectra: spectra(self.accel_spectra),
        }
    }
}

impl Sensor {
    /// Whether anything was measured.
    pub fn has_any(&self) -> bool {
        !self.gyro.is_empty() || !self.accel.is_empty()
    }
}
