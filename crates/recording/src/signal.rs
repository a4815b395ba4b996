//! A named, timed column of numbers: what readers give and what analyzers take.

use std::sync::Arc;

/// One numeric field of one topic over time.
#[derive(Clone, Debug, PartialEq)]
pub struct Signal {
    /// The topic; it may have dots of its own, so it is never cut out of the path.
    pub topic: String,
    /// `TOPIC.field.path`, sequence items as `[i]`: `/imu/rath.angular_velocity.x`; `TOPIC:field.path` where a field of another topic is called so.
    pub path: String,
    /// The unit where the field's name or the message's convention gives one (`m/s^2`), otherwise empty.
    pub unit: String,
    /// Log time of each value, nanoseconds, ascending; shared by the signals of one topic.
    pub times_ns: Arc<[i64]>,
    /// The values, one per time, in the message's own unit.
    pub values: Vec<f64>,
}

impl Signal {
    /// Times in seconds since `start_ns`.
    ///
    /// The difference is taken in integers, so a time on a whole nanosecond is good to the last bit of the quotient.
    pub fn times_s(&self, start_ns: i64) -> Vec<f64> {
        seconds_since(&self.times_ns, start_ns)
    }
}

/// Seconds since `start_ns` of times in nanoseconds: t_s = (t_ns − start_ns) / 1e9.
pub fn seconds_since(times_ns: &[i64], start_ns: i64) -> Vec<f64> {
    times_ns
        .iter()
        .map(|&t_ns| (i128::from(t_ns) - i128::from(start_ns)) as f64 / 1e9)
        .collect()
}

/// The field that a signal's path names, where it is one of `topic`. A topic may have dots of its own, so it is never cut out of a path.
pub fn field_of<'a>(path: &'a str, topic: &str) -> Option<&'a str> {
    path.strip_prefix(topic)?.strip_prefix('.')
}

/// The unit that a field's path implies: from a suffix of our own names (`_m_per_s`), or from the ROS convention of the message type.
/// Empty where neither says.
pub fn unit_of(schema: &str, field: &str) -> &'static str {
    // Longer suffixes first: `_m_per_s2` ends in nothing shorter by accident.
    const SUFFIXES: &[(&str, &str)] = &[
        ("_rad_per_s", "rad/s"),
        ("_m_per_s2", "m/s^2"),
        ("_m_per_s", "m/s"),
        ("_n_per_m", "N/m"),
        ("_n_s_per_m", "N.s/m"),
        ("_kg_m2", "kg.m^2"),
        ("_deg", "deg"),
        ("_rad", "rad"),
        ("_hz", "Hz"),
        ("_ns", "ns"),
        ("_kg", "kg"),
        ("_n", "N"),
        ("_mm", "mm"),
        ("_cm", "cm"),
        ("_m", "m"),
        ("_s", "s"),
        ("_j", "J"),
    ];
    // Field prefixes by ROS message type (with and without `/msg/`), units of the message definitions.
    const ROS: &[(&str, &str, &str)] = &[
        ("sensor_msgs/Imu", "linear_acceleration.", "m/s^2"),
        ("sensor_msgs/Imu", "angular_velocity.", "rad/s"),
        ("sensor_msgs/MagneticField", "magnetic_field.", "T"),
        ("geometry_msgs/WrenchStamped", "wrench.force.", "N"),
        ("geometry_msgs/WrenchStamped", "wrench.torque.", "N.m"),
        ("geometry_msgs/Wrench", "force.", "N"),
        ("geometry_msgs/PoseStamped", "pose.position.", "m"),
        ("geometry_msgs/Pose", "position.", "m"),
        ("geometry_msgs/TwistStamped", "twist.linear.", "m/s"),
        ("geometry_msgs/TwistStamped", "twist.angular.", "rad/s"),
        ("geometry_msgs/Twist", "linear.", "m/s"),
        ("geometry_msgs/Twist", "angular.", "rad/s"),
        ("nav_msgs/Odometry", "pose.pose.position.", "m"),
        ("nav_msgs/Odometry", "twist.twist.linear.", "m/s"),
        ("nav_msgs/Odometry", "twist.twist.angular.", "rad/s"),
        ("sensor_msgs/FluidPressure", "fluid_pressure", "Pa"),
        ("sensor_msgs/Temperature", "temperature", "degC"),
        ("sensor_msgs/BatteryState", "voltage", "V"),
    ];
    let schema = schema.replacen("/msg/", "/", 1);
    for (name, prefix, unit) in ROS {
        if schema == *name && field.starts_with(prefix) {
            return unit;
        }
    }
    if schema == "tf2_msgs/TFMessage" && field.contains(".transform.translation.") {
        return "m";
    }
    // A part of the path may carry the suffix: `velocity_m_per_s.x`, `normal_n[0]`.
    for part in field.rsplit('.') {
        let part = part.split('[').next().unwrap_or(part);
        // What is per second is no time: `drift_per_s`, `noise_rad_per_sqrt_s`.
        let per = part.rsplit_once("_per_").map_or("", |(_, of)| of);
        let per = per.strip_prefix("sqrt_").unwrap_or(per);
        for (suffix, unit) in SUFFIXES {
            if part.ends_with(suffix) && (suffix.contains("_per_") || suffix[1..] != *per) {
                return unit;
            }
        }
    }
    ""
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn units_come_from_names_and_from_ros() {
        for (schema, field, unit) in [
            ("rath.State", "velocity_m_per_s.x", "m/s"),
            ("rath.HandleForces", "normal_n[1]", "N"),
            ("rath.State", "orientation.x", ""),
            ("rath.State", "roll_rad", "rad"),
            ("sensor_msgs/msg/Imu", "linear_acceleration.z", "m/s^2"),
            ("sensor_msgs/Imu", "angular_velocity.z", "rad/s"),
            ("sensor_msgs/Imu", "orientation.w", ""),
            ("x/Y", "spring.stiffness_n_per_m", "N/m"),
            ("x/Y", "damping_n_s_per_m[1]", "N.s/m"),
            ("x/Y", "bristle_stiffness_per_m", ""),
            ("x/Y", "phase_rad_per_sqrt_s", ""),
            ("x/Y", "drift_per_s", ""),
            ("x/Y", "load_per_handle_n", "N"),
        ] {
            assert_eq!(unit_of(schema, field), unit, "{schema} {field}");
        }
    }

    #[test]
    fn a_field_is_one_of_its_topic_alone() {
        assert_eq!(field_of("/a.b.c", "/a"), Some("b.c"));
        assert_eq!(field_of("/a.b.c", "/a.b"), Some("c"));
        for other in ["/ab.c", "/b.c", "/a"] {
            assert_eq!(field_of(other, "/a"), None);
        }
    }

    #[test]
    fn seconds_are_exact_on_the_archive_grid() {
        let times_ns: Vec<i64> = (0..1819).map(|i| i * 33_000_000).collect();
        for (i, t_s) in seconds_since(&times_ns, 0).iter().enumerate() {
            assert_eq!(*t_s, (33 * i) as f64 / 1e3);
        }
    }
}
