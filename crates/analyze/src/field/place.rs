//! Where sensors sit: as the user says, or from the scene that a simulated recording carries.

use std::collections::HashMap;
use std::f64::consts::SQRT_2;

use nalgebra::UnitQuaternion;
use recording::read::Recording;

use crate::imu::budget::Budget;
use crate::imu::rath::{Mounting, Settings};
use crate::roles::Sensors;

/// A sensor's place on the body.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Place {
    /// From the centre of mass, in the body's axes, m; 0 where nobody says.
    pub lever_m: [f64; 3],
    /// Whether anybody says.
    pub is_known: bool,
    /// Body from sensor, where somebody says.
    pub body_from_sensor: Option<UnitQuaternion<f64>>,
    /// Standard deviation of its accelerometer's bias, m/s², where somebody says.
    pub accel_bias_m_per_s2: Option<f64>,
    /// Standard deviation of its gyroscope's scale error, relative, where somebody says.
    pub gyro_scale_error: Option<f64>,
    /// Standard deviation of how far its axes stand otherwise, rad, where somebody says.
    pub mounting_error_rad: Option<f64>,
}

impl Place {
    /// Settings for this place; what the user says stands over it. Without a word on the mounting the sensor is levelled.
    pub fn or_as_said(self, said: &Sensors) -> Settings {
        let turned = said
            .mounting_roll_pitch_yaw_deg
            .map(|a| a.map(f64::to_radians))
            .map(|[roll, pitch, yaw]| UnitQuaternion::from_euler_angles(roll, pitch, yaw));
        Settings {
            lever_m: said.place_m.unwrap_or(self.lever_m),
            lever_is_known: self.is_known || said.place_m.is_some(),
            mounting: turned
                .or(self.body_from_sensor)
                .map_or(Mounting::Levelled, Mounting::Known),
            budget: Budget {
                accel_bias_m_per_s2: said.accel_bias_m_per_s2.or(self.accel_bias_m_per_s2),
                gyro_scale_error: said.gyro_scale_error.or(self.gyro_scale_error),
                mounting_error_rad: (said.mounting_error_deg.map(f64::to_radians))
                    .or(self.mounting_error_rad),
                ..Budget::default()
            },
            ..Settings::default()
        }
    }
}

/// Whether the recording's own record says that it was simulated: its samples are true at their stamps.
pub fn is_simulated(recording: &Recording) -> bool {
    let rath = recording.info().metadata.get("rath");
    rath.and_then(|m| m.get("source"))
        .is_some_and(|s| s == "sim")
}

/// Whether the recording was put together from devices' own files: a sound's does not know when it began.
pub fn is_put_together(recording: &Recording) -> bool {
    let rath = recording.info().metadata.get("rath");
    rath.and_then(|m| m.get("source"))
        .is_some_and(|s| s == "field")
}

/// Places by topic, from the attachment `scene.toml` (`effects.imu.sensors`: `on`, `name`, `place_m`, `mounting_roll_pitch_yaw_deg`; of all of them
/// `accel_bias_sd_m_per_s2`, `scale_error_sd`, `misalignment_sd_deg`).
///
/// Empty where there is no such attachment or it cannot be read; sensors then count as levelled and at the centre of mass.
pub fn places(recording: &Recording) -> HashMap<String, Place> {
    let scene = recording
        .attachment("scene.toml")
        .and_then(|bytes| String::from_utf8(bytes).ok());
    scene.map(|text| from_scene(&text)).unwrap_or_default()
}

fn from_scene(text: &str) -> HashMap<String, Place> {
    let mut out = HashMap::new();
    let Ok(scene) = text.parse::<toml::Table>() else {
        return out;
    };
    let number = |v: &toml::Value| v.as_float().or_else(|| v.as_integer().map(|i| i as f64));
    let imu = scene.get("effects").and_then(|e| e.get("imu"));
    let of_all = |key: &str| imu.and_then(|i| i.get(key)).and_then(number).unwrap_or(0.0);
    let accel_bias_m_per_s2 = of_all("accel_bias_sd_m_per_s2");
    let gyro_scale_error = of_all("scale_error_sd");
    // Both triads are askew, each on its own.
    let mounting_error_rad = SQRT_2 * of_all("misalignment_sd_deg").to_radians();
    let sensors = imu
        .and_then(|i| i.get("sensors"))
        .and_then(|s| s.as_array());
    for sensor in sensors.into_iter().flatten() {
        let word = |key: &str| sensor.get(key).and_then(|v| v.as_str());
        let Some(name) = word("name").or_else(|| word("on")).or(Some("rath")) else {
            continue;
        };
        let triple = |key: &str| -> Option<[f64; 3]> {
            let values: Vec<f64> = sensor
                .get(key)?
                .as_array()?
                .iter()
                .filter_map(number)
                .collect();
            values.try_into().ok()
        };
        let [roll, pitch, yaw] = triple("mounting_roll_pitch_yaw_deg")
            .unwrap_or_default()
            .map(f64::to_radians);
        let place = Place {
            lever_m: triple("place_m").unwrap_or_default(),
            is_known: true,
            body_from_sensor: Some(UnitQuaternion::from_euler_angles(roll, pitch, yaw)),
            accel_bias_m_per_s2: Some(accel_bias_m_per_s2),
            gyro_scale_error: Some(gyro_scale_error),
            mounting_error_rad: Some(mounting_error_rad),
        };
        out.entry(format!("/imu/{name}")).or_insert(place);
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_scene_says_where_its_sensors_are() {
        let found = from_scene(
            "[effects.imu]\nrate_hz = 200.0\n[[effects.imu.sensors]]\non = \"rath\"\nplace_m = [0.5, 0, 0.3]\n[[effects.imu.sensors]]\non = \"carrier_1\"\n",
        );
        assert_eq!(found["/imu/rath"].lever_m, [0.5, 0.0, 0.3]);
        assert_eq!(found["/imu/carrier_1"].lever_m, [0.0; 3]);
        let settings = |place: Place, said: &Sensors| place.or_as_said(said).lever_is_known;
        let nothing = Sensors::default();
        assert!(settings(found["/imu/rath"], &nothing) && !settings(Place::default(), &nothing));
        let errors = |text: &str, said: Option<f64>| {
            let said = Sensors {
                accel_bias_m_per_s2: said,
                gyro_scale_error: said,
                mounting_error_deg: said.map(f64::to_degrees),
                ..nothing
            };
            let place = from_scene(text).get("/imu/rath").copied();
            let budget = place.unwrap_or_default().or_as_said(&said).budget;
            [
                budget.accel_bias_m_per_s2,
                budget.gyro_scale_error,
                budget.mounting_error_rad,
            ]
        };
        let scene = "[effects.imu]\naccel_bias_sd_m_per_s2 = 0.02\nscale_error_sd = 0.01\n[[effects.imu.sensors]]\n";
        assert_eq!(errors(scene, None), [Some(0.02), Some(0.01), Some(0.0)]);
        assert_eq!(errors(scene, Some(0.125)), [Some(0.125); 3]);
        assert_eq!(errors("", None), [None; 3]);
        assert!(from_scene("no toml [").is_empty());
    }
}
