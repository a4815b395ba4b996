//! Virtual IMUs on the body and on the carriers; the instrument itself is [`crate::sensors::imu`].
//!
//! Sensors watch: the motion is bit for bit the same without them.

use crate::model::Model;
use crate::scene::Scene;
use crate::scene::problem::{Checker, MOST_SAMPLES, Problem, check_clock, larger, problem, shown};
use crate::sensors::imu::{Draws, Seat, Triad};
use nalgebra::UnitQuaternion;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// `[effects.imu]`: one kind of instrument, at any number of places. The noise figures are those of the ADIS16448 in
/// the EuRoC MAV data set (Burri et al., IJRR 2016; `imu0/sensor.yaml`), range and resolution those of its data sheet.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Imu {
    /// Samples per second, by the sensor's own clock, Hz.
    pub rate_hz: f64,
    /// A faultless instrument: no noise, no bias, no range, no digits. The figures below then mean nothing.
    pub ideal: bool,
    /// Probability that a sample is lost, 0 to 1.
    pub dropout: f64,
    /// Samples that are lost at a time, as a radio loses packets; rows that meet are longer ones.
    pub dropout_row: u32,
    /// Gyroscope white noise, rad/s/√Hz.
    pub gyro_noise_rad_per_s_per_sqrt_hz: f64,
    /// Gyroscope bias walk, rad/s²/√Hz.
    pub gyro_bias_walk_rad_per_s2_per_sqrt_hz: f64,
    /// Standard deviation of the gyroscope's bias at the start, rad/s.
    pub gyro_bias_sd_rad_per_s: f64,
    /// Greatest rate it shows, rad/s.
    pub gyro_range_rad_per_s: f64,
    /// Step of its digits, rad/s; 0 for none.
    pub gyro_resolution_rad_per_s: f64,
    /// Accelerometer white noise, m/s²/√Hz.
    pub accel_noise_m_per_s2_per_sqrt_hz: f64,
    /// Accelerometer bias walk, m/s³/√Hz.
    pub accel_bias_walk_m_per_s3_per_sqrt_hz: f64,
    /// Standard deviation of the accelerometer's bias at the start, m/s².
    pub accel_bias_sd_m_per_s2: f64,
    /// Greatest specific force it shows, m/s².
    pub accel_range_m_per_s2: f64,
    /// Step of its digits, m/s²; 0 for none.
    pub accel_resolution_m_per_s2: f64,
    /// Standard deviation of each axis' scale error, 1; both triads.
    pub scale_error_sd: f64,
    /// Standard deviation of each angle between the axes, degrees; both triads.
    pub misalignment_sd_deg: f64,
    /// Where the sensors sit.
    pub sensors: Vec<Sensor>,
}

/// One sensor.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Sensor {
    /// `rath`, or `carrier_1`, `carrier_2` …
    pub on: String,
    /// Last part of its topic, `/imu/NAME`; where absent, what it sits on (and a number for a second one there).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub name: Option<String>,
    /// Its place from the centre of mass, body axes, m. A carrier's sensor is always at the shoulder.
    pub place_m: [f64; 3],
    /// How its axes stand to those of the body: roll, pitch, yaw (R = R_z R_y R_x), degrees.
    pub mounting_roll_pitch_yaw_deg: [f64; 3],
    /// What its clock shows at t = 0, s.
    pub clock_offset_s: f64,
    /// How much faster its clock runs, parts per million.
    pub clock_drift_ppm: f64,
}

const GRAVITY: f64 = 9.80665;
/// Samples lost at a time: each one asks for all that may have begun before it.
const LONGEST_ROW: u32 = 1000;

impl Default for Imu {
    fn default() -> Self {
        Self {
            rate_hz: 200.0,
            ideal: false,
            dropout: 0.0,
            dropout_row: 1,
            gyro_noise_rad_per_s_per_sqrt_hz: 1.6968e-4,
            gyro_bias_walk_rad_per_s2_per_sqrt_hz: 1.9393e-5,
            gyro_bias_sd_rad_per_s: 0.0,
            gyro_range_rad_per_s: 1000.0_f64.to_radians(),
            gyro_resolution_rad_per_s: 0.04_f64.to_radians(),
            accel_noise_m_per_s2_per_sqrt_hz: 2.0e-3,
            accel_bias_walk_m_per_s3_per_sqrt_hz: 3.0e-3,
            accel_bias_sd_m_per_s2: 0.0,
            accel_range_m_per_s2: 18.0 * GRAVITY,
            accel_resolution_m_per_s2: GRAVITY / 1200.0,
            scale_error_sd: 0.0,
            misalignment_sd_deg: 0.0,
            sensors: vec![Sensor::default()],
        }
    }
}

impl Default for Sensor {
    fn default() -> Self {
        Self {
            on: "rath".into(),
            name: None,
            place_m: [0.0; 3],
            mounting_roll_pitch_yaw_deg: [0.0; 3],
            clock_offset_s: 0.0,
            clock_drift_ppm: 0.0,
        }
    }
}

impl Imu {
    pub(super) fn check(&self, scene: &Scene) -> Result<(), Problem> {
        let key = |name: &str| format!("effects.imu.{name}");
        Checker::positive(&key("rate_hz"), self.rate_hz)?;
        if self.rate_hz * scene.duration_s * self.sensors.len().max(1) as f64 > MOST_SAMPLES {
            let times = self.rate_hz / Self::default().rate_hz;
            return Err(problem(
                larger(scene.duration_s, &key("rate_hz"), times),
                format!(
                    "{} Hz for {} s are more than {MOST_SAMPLES:e} samples",
                    shown(self.rate_hz),
                    shown(scene.duration_s)
                ),
            ));
        }
        Checker::within(&key("dropout"), self.dropout, 0.0..=1.0)?;
        let row = f64::from(self.dropout_row);
        Checker::within(&key("dropout_row"), row, 1.0..=f64::from(LONGEST_ROW))?;
        for (name, x) in [
            (
                "gyro_noise_rad_per_s_per_sqrt_hz",
                self.gyro_noise_rad_per_s_per_sqrt_hz,
            ),
            (
                "gyro_bias_walk_rad_per_s2_per_sqrt_hz",
                self.gyro_bias_walk_rad_per_s2_per_sqrt_hz,
            ),
            ("gyro_bias_sd_rad_per_s", self.gyro_bias_sd_rad_per_s),
            (
                "accel_noise_m_per_s2_per_sqrt_hz",
                self.accel_noise_m_per_s2_per_sqrt_hz,
            ),
            (
                "accel_bias_walk_m_per_s3_per_sqrt_hz",
                self.accel_bias_walk_m_per_s3_per_sqrt_hz,
            ),
            ("accel_bias_sd_m_per_s2", self.accel_bias_sd_m_per_s2),
            ("scale_error_sd", self.scale_error_sd),
            ("misalignment_sd_deg", self.misalignment_sd_deg),
        ] {
            Checker::not_negative(&key(name), x)?;
        }
        for (range, most, resolution, x) in [
            (
                "gyro_range_rad_per_s",
                self.gyro_range_rad_per_s,
                "gyro_resolution_rad_per_s",
                self.gyro_resolution_rad_per_s,
            ),
            (
                "accel_range_m_per_s2",
                self.accel_range_m_per_s2,
                "accel_resolution_m_per_s2",
                self.accel_resolution_m_per_s2,
            ),
        ] {
            Checker::positive(&key(range), most)?;
            Checker::not_negative(&key(resolution), x)?;
            if x > most {
                return Err(problem(
                    &key(resolution),
                    format!("found {}, more than {range}, {}", shown(x), shown(most)),
                ));
            }
        }
        if self.sensors.is_empty() {
            return Err(problem(
                &key("sensors"),
                "the list is empty; leave the effect out instead",
            ));
        }
        let names = self.names();
        for (i, sensor) in self.sensors.iter().enumerate() {
            let key = |name: &str| format!("effects.imu.sensors.{i}.{name}");
            seat(sensor, scene.carriers.count()).map_err(|m| problem(&key("on"), m))?;
            Checker::all_finite(&key("place_m"), &sensor.place_m)?;
            Checker::all_finite(
                &key("mounting_roll_pitch_yaw_deg"),
                &sensor.mounting_roll_pitch_yaw_deg,
            )?;
            check_clock(scene, &key, sensor.clock_offset_s, sensor.clock_drift_ppm)?;
            if let Some(name) = &sensor.name {
                let fits = |c: char| c.is_ascii_alphanumeric() || c == '_';
                if name.is_empty() || !name.chars().all(fits) {
                    return Err(problem(
                        &key("name"),
                        format!("found {name:?}, expected letters, digits and underscores"),
                    ));
                }
            }
            if names[..i].contains(&names[i]) {
                return Err(problem(
                    &key("name"),
                    format!("two sensors are called `{}`", names[i]),
                ));
            }
        }
        Ok(())
    }

    /// Last parts of the topics.
    fn names(&self) -> Vec<String> {
        let mut names: Vec<String> = Vec::new();
        for (i, sensor) in self.sensors.iter().enumerate() {
            let before = self.sensors[..i]
                .iter()
                .filter(|s| s.on == sensor.on && s.name.is_none())
                .count();
            names.push(match (&sensor.name, before) {
                (Some(name), _) => name.clone(),
                (None, 0) => sensor.on.clone(),
                (None, more) => format!("{}_{}", sensor.on, (b'a' + (more % 26) as u8) as char),
            });
        }
        names
    }

    fn triads(&self) -> [Triad; 2] {
        if self.ideal {
            return [Triad::IDEAL; 2];
        }
        let misalignment_sd = self.misalignment_sd_deg.to_radians();
        [
            Triad {
                noise_density: self.gyro_noise_rad_per_s_per_sqrt_hz,
                bias_walk: self.gyro_bias_walk_rad_per_s2_per_sqrt_hz,
                bias_sd: self.gyro_bias_sd_rad_per_s,
                scale_sd: self.scale_error_sd,
                misalignment_sd,
                range: self.gyro_range_rad_per_s,
                resolution: self.gyro_resolution_rad_per_s,
            },
            Triad {
                noise_density: self.accel_noise_m_per_s2_per_sqrt_hz,
                bias_walk: self.accel_bias_walk_m_per_s3_per_sqrt_hz,
                bias_sd: self.accel_bias_sd_m_per_s2,
                scale_sd: self.scale_error_sd,
                misalignment_sd,
                range: self.accel_range_m_per_s2,
                resolution: self.accel_resolution_m_per_s2,
            },
        ]
    }

    pub(super) fn build(&self, scene: &Scene, model: &mut Model) {
        let [gyroscope, accelerometer] = self.triads();
        for (i, (sensor, name)) in self.sensors.iter().zip(self.names()).enumerate() {
            let [roll, pitch, yaw] = sensor.mounting_roll_pitch_yaw_deg.map(f64::to_radians);
            // A clock that runs fast by d ticks (1 + d) times as often in true time.
            let true_rate_hz = self.rate_hz * (1.0 + sensor.clock_drift_ppm * 1e-6);
            let clock = model.sensor_clock(true_rate_hz);
            model.add_imu(crate::sensors::Imu {
                topic: format!("/imu/{name}"),
                frame: format!("imu_{name}"),
                seat: seat(sensor, scene.carriers.count())
                    .expect("a checked scene names places that exist"),
                mounting: UnitQuaternion::from_euler_angles(roll, pitch, yaw),
                rate_hz: self.rate_hz,
                clock_offset_s: sensor.clock_offset_s,
                clock,
                dropout: self.dropout,
                dropout_row: self.dropout_row,
                gyroscope,
                accelerometer,
                // OK because the number of sensors is far below 2^27.
                draws: Draws {
                    seed: scene.seed,
                    instrument: i as u32,
                },
            });
        }
    }
}

fn seat(sensor: &Sensor, carriers: usize) -> Result<Seat, String> {
    if sensor.on == "rath" {
        return Ok(Seat::Body(sensor.place_m));
    }
    let number: Option<usize> = sensor
        .on
        .strip_prefix("carrier_")
        .and_then(|n| n.parse().ok())
        // `+1` and `01` are numbers, too.
        .filter(|i| sensor.on == format!("carrier_{i}"));
    match number {
        Some(i) if (1..=carriers).contains(&i) => {
            if sensor.place_m == [0.0; 3] {
                Ok(Seat::Carrier(i - 1))
            } else {
                Err(format!(
                    "a sensor on `{}` sits at the shoulder; leave its place_m out",
                    sensor.on
                ))
            }
        }
        _ => Err(format!(
            "found `{}`, expected `rath` or `carrier_1` to `carrier_{carriers}`",
            sensor.on
        )),
    }
}
