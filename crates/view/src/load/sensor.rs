//! An inertial sensor: thinned curves, spectra and an estimate of its attitude, from samples that stream by.

use analyze::imu::orientation;
use analyze::spectrum::{DEFAULT_SEGMENT_S, Spectrum};
use analyze::summary::{self, Times};
use recording::read::Batch;
use recording::signal::field_of;

use crate::take::{Curve, Sensor};
use crate::thin::Thin;

/// A sensor while it streams by.
pub struct Stream {
    gyro: [Thin; 3],
    accel: [Thin; 3],
    gyro_spectra: [summary::Stream; 3],
    accel_spectra: [summary::Stream; 3],
    /// Times of the values of those columns that not every message has.
    own: [Option<Times>; 6],
    filter: Option<orientation::Causal>,
    /// Samples since it began.
    turned: u64,
    options: orientation::Options,
    attitude: [Thin; 2],
    /// Mean step between samples, s.
    period_s: f64,
    /// Time of the last sample, ns.
    last_ns: Option<i64>,
}

impl Stream {
    /// For a sensor of this rate between gaps and so many messages; `thin` begins a curve of this name.
    pub fn new(rate_hz: f64, messages: u64, mut thin: impl FnMut(&str) -> Thin) -> Self {
        let wanted = (rate_hz * DEFAULT_SEGMENT_S).clamp(16.0, 1e6) as u64;
        let spectrum = || summary::Stream::new(rate_hz, wanted.min(messages.max(2)) as usize);
        let axes = ["x", "y", "z"];
        Stream {
            gyro: axes.map(&mut thin),
            accel: axes.map(&mut thin),
            gyro_spectra: axes.map(|_| spectrum()),
            accel_spectra: axes.map(|_| spectrum()),
            own: Default::default(),
            filter: None,
            turned: 0,
            options: orientation::Options::default(),
            attitude: ["roll", "pitch"].map(&mut thin),
            period_s: 1.0 / rate_hz,
            last_ns: None,
        }
    }

    /// Takes the next samples, whose times `times` took last.
    pub fn push(&mut self, batch: &Batch<'_>, times: &Times) {
        let mut columns: [Option<&[f64]>; 6] = [None; 6];
        for column in batch.columns {
            let of = |field: &str, base: usize| {
                let axis = field_of(column.path, batch.topic)?.strip_prefix(field)?;
                Some(base + ["x", "y", "z"].iter().position(|a| *a == axis)?)
            };
            let Some(k) = of("angular_velocity.", 0).or_else(|| of("linear_acceleration.", 3))
            else {
                continue;
            };
            let (thin, spectrum) = match k {
                0..3 => (&mut self.gyro[k], &mut self.gyro_spectra[k]),
                _ => (&mut self.accel[k - 3], &mut self.accel_spectra[k - 3]),
            };
            thin.push_between_gaps(batch.times_ns, column.rows, column.values, times);
            if column.rows.is_some() {
                self.own[k].get_or_insert_default();
            }
            let gaps = match (&mut self.own[k], column.rows) {
                (None, _) => times.gaps(),
                (Some(own), rows) => {
                    match rows {
                        None => own.push(batch.times_ns),
                        Some(rows) => {
                            let at = rows.iter().map(|row| batch.times_ns[*row as usize]);
                            own.push(&at.collect::<Vec<i64>>());
                        }
                    }
                    own.gaps()
                }
            };
            spectrum.push(column.values, column.finite, gaps);
            if column.rows.is_none() {
                columns[k] = Some(column.values);
            }
        }
        if let [Some(gx), Some(gy), Some(gz), Some(ax), Some(ay), Some(az)] = columns {
            self.turn(batch.times_ns, times, [gx, gy, gz], [ax, ay, az]);
        }
    }

    /// Runs the causal orientation filter over a batch. It begins anew after lost samples, and is believed when it has heard as much as it
    /// averages over: one sample of a gait says nothing of where down is.
    fn turn(&mut self, times_ns: &[i64], times: &Times, gyro: [&[f64]; 3], accel: [&[f64]; 3]) {
        let mut gaps = times.gaps().iter().map(|gap| gap.before).peekable();
        let unsettled = (self.options.tau_s / self.period_s) as u64;
        let mut angles = [(); 2].map(|()| Vec::with_capacity(times_ns.len()));
        let steps_s = self.steps_s(times_ns);
        for (k, step_s) in steps_s.into_iter().enumerate() {
            if gaps.next_if_eq(&k).is_some() {
                (self.filter, self.turned) = (None, 0);
            }
            let (w, a) = (gyro.map(|g| g[k]), accel.map(|a| a[k]));
            let mut shown = [f64::NAN; 2];
            if w.iter().chain(&a).all(|x| x.is_finite()) {
                // What came before the first one is not known.
                let step_s = self.filter.as_ref().map_or(self.period_s, |_| step_s);
                let filter = self
                    .filter
                    .get_or_insert_with(|| orientation::Causal::new(self.period_s, self.options));
                let (roll, pitch, _) = filter.update(step_s, w, a).euler_angles();
                self.turned += 1;
                if self.turned > unsettled {
                    shown = [roll.to_degrees(), pitch.to_degrees()];
                }
            }
            for (angles, shown) in angles.iter_mut().zip(shown) {
                angles.push(shown);
            }
        }
        for (thin, angles) in self.attitude.iter_mut().zip(&angles) {
            thin.push(times_ns, angles);
        }
    }

    /// Time from the sample before to each, s: the rate of a sensor need not stay. Those that share a time share the step to it.
    fn steps_s(&mut self, times_ns: &[i64]) -> Vec<f64> {
        let mut steps_s = Vec::with_capacity(times_ns.len());
        for together in times_ns.chunk_by(|a, b| a == b) {
            let since_ns = self
                .last_ns
                .map_or(0, |last| together[0].saturating_sub(last));
            let step_s = since_ns.max(0) as f64 / 1e9 / together.len() as f64;
            steps_s.extend(together.iter().map(|_| step_s));
            self.last_ns = together.last().copied();
        }
        steps_s
    }

    /// What is drawn of it.
    pub fn finish(self, topic: &str, times: &Times) -> Sensor {
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
        let spectra = |axes: [summary::Stream; 3], own: &[Option<Times>]| -> Vec<Spectrum> {
            let spectrum = |(axis, own): (summary::Stream, &Option<Times>)| {
                axis.finish(own.as_ref().unwrap_or(times), "", true).1
            };
            let all: Option<Vec<Spectrum>> = axes.into_iter().zip(own).map(spectrum).collect();
            all.unwrap_or_default()
        };
        let attitude: Vec<Curve> = self.attitude.into_iter().map(Thin::finish).collect();
        let (gyro, accel) = (curves(self.gyro), curves(self.accel));
        // Without a gyroscope there is an average inclination at best: nothing to call a roll.
        let none = gyro.is_empty() || !attitude[0].values.iter().any(|x| x.is_finite());
        Sensor {
            topic: topic.to_owned(),
            gyro,
            accel,
            attitude: if none { Vec::new() } else { attitude },
            gyro_spectra: spectra(self.gyro_spectra, &self.own[..3]),
            accel_spectra: spectra(self.accel_spectra, &self.own[3..]),
        }
    }
}

impl Sensor {
    /// Whether anything was measured more than once.
    pub fn has_any(&self) -> bool {
        self.gyro.iter().chain(&self.accel).any(Curve::has_two)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use recording::read::Column;
    use std::f64::consts::TAU;

    /// A sensor that turns to and fro about x by 1.3 Hz, and nods up and down with it, in batches; without the samples that `lost` names.
    fn drawn(lost: impl Fn(f64) -> bool) -> Sensor {
        let t_s: Vec<f64> = (0..6000).map(|k| f64::from(k) / 100.0).collect();
        let t_s: Vec<f64> = t_s.into_iter().filter(|t| !lost(*t)).collect();
        let times_ns: Vec<i64> = t_s.iter().map(|t| (t * 1e9).round() as i64).collect();
        let still = vec![0.0; t_s.len()];
        let of = |f: fn(f64) -> f64| t_s.iter().map(|t| f(*t)).collect::<Vec<f64>>();
        let (rate, up) = (
            of(|t| 0.1 * (TAU * 1.3 * t).cos()),
            of(|t| 9.81 + (TAU * 1.3 * t).sin()),
        );
        let paths = ["angular_velocity", "linear_acceleration"]
            .map(|field| ["x", "y", "z"].map(|axis| format!("/imu.{field}.{axis}")));
        let values = [[&rate, &still, &still], [&still, &still, &up]];
        let mut all = Times::default();
        all.push(&times_ns);
        let thin = |name: &str| Thin::new(name, 0, 60_000_000_000, 0, 1);
        let mut sensor = Stream::new(all.hz_between_gaps().unwrap(), 6000, thin);
        let mut times = Times::default();
        for from in (0..t_s.len()).step_by(700) {
            let part = from..(from + 700).min(t_s.len());
            let columns: Vec<Column<'_>> = (0..6)
                .map(|k| Column {
                    id: k,
                    path: &paths[k / 3][k % 3],
                    rows: None,
                    values: &values[k / 3][k % 3][part.clone()],
                    finite: true,
                })
                .collect();
            let batch = Batch {
                channel: 0,
                topic: "/imu",
                schema: "sensor_msgs/Imu",
                times_ns: &times_ns[part],
                stamps_ns: None,
                columns: &columns,
            };
            times.push(batch.times_ns);
            sensor.push(&batch, &times);
        }
        sensor.finish("/imu", &times)
    }

    #[test]
    fn lost_samples_break_curves_and_leave_lines_and_attitude_right() {
        let lost: [fn(f64) -> bool; 4] = [
            |_| false,
            |t| (30.0..35.2).contains(&t),
            |t| t % 5.0 >= 4.6,
            |t| t < 40.0,
        ];
        for (case, lost) in lost.into_iter().enumerate() {
            let sensor = drawn(lost);
            for spectrum in [&sensor.gyro_spectra[0], &sensor.accel_spectra[2]] {
                let peak_hz = spectrum.peak_hz().unwrap();
                assert!((peak_hz - 1.3).abs() < 0.01, "{case}: {peak_hz}");
            }
            let holes = |c: &Curve| c.values.iter().filter(|x| x.is_nan()).count();
            assert_eq!(holes(&sensor.gyro[0]), [0, 1, 11, 0][case], "{case}");
            // It turns by 0.7 degrees to either side.
            let most = (sensor.attitude[0].values.iter())
                .filter(|x| x.is_finite())
                .fold(0.0, |m: f64, x| m.max(x.abs()));
            assert!((0.3..1.2).contains(&most), "{case}: {most}");
        }
    }

    #[test]
    fn a_field_that_every_other_message_has_keeps_its_line() {
        // Messages come at 100 Hz, the angular velocity in every other of them.
        let times_ns: Vec<i64> = (0..6000).map(|k| k * 10_000_000).collect();
        let rows: Vec<u32> = (0..3000).map(|k| 2 * k).collect();
        let still = vec![0.0; 3000];
        let rate: Vec<f64> = (0..3000)
            .map(|k| 0.1 * (TAU * 1.3 * f64::from(k) / 50.0).cos())
            .collect();
        let paths = ["x", "y", "z"].map(|axis| format!("/imu.angular_velocity.{axis}"));
        let columns: Vec<Column<'_>> = (0..3)
            .map(|k| Column {
                id: k,
                path: &paths[k],
                rows: Some(&rows),
                values: if k == 0 { &rate } else { &still },
                finite: true,
            })
            .collect();
        let batch = Batch {
            channel: 0,
            topic: "/imu",
            schema: "sensor_msgs/Imu",
            times_ns: &times_ns,
            stamps_ns: None,
            columns: &columns,
        };
        let mut times = Times::default();
        times.push(&times_ns);
        let thin = |name: &str| Thin::new(name, 0, 60_000_000_000, 0, 1);
        let mut sensor = Stream::new(100.0, 6000, thin);
        sensor.push(&batch, &times);
        let peak_hz = sensor.finish("/imu", &times).gyro_spectra[0].peak_hz();
        assert!((peak_hz.unwrap() - 1.3).abs() < 0.01, "{peak_hz:?}");
    }
}
