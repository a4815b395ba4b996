//! Message definitions (`ros2msg`) of the types that we write: the fields of the official interface packages, without their prose.

/// Type and definition; the types that a definition names are in this table too.
const DEFINITIONS: &[(&str, &str)] = &[
    ("builtin_interfaces/Time", "int32 sec\nuint32 nanosec\n"),
    (
        "std_msgs/Header",
        "builtin_interfaces/Time stamp\nstring frame_id\n",
    ),
    ("std_msgs/String", "string data\n"),
    ("std_msgs/Float64", "float64 data\n"),
    ("geometry_msgs/Vector3", "float64 x\nfloat64 y\nfloat64 z\n"),
    ("geometry_msgs/Point", "float64 x\nfloat64 y\nfloat64 z\n"),
    (
        "geometry_msgs/Quaternion",
        "float64 x 0\nfloat64 y 0\nfloat64 z 0\nfloat64 w 1\n",
    ),
    (
        "geometry_msgs/Pose",
        "geometry_msgs/Point position\ngeometry_msgs/Quaternion orientation\n",
    ),
    (
        "geometry_msgs/PoseStamped",
        "std_msgs/Header header\ngeometry_msgs/Pose pose\n",
    ),
    (
        "geometry_msgs/Transform",
        "geometry_msgs/Vector3 translation\ngeometry_msgs/Quaternion rotation\n",
    ),
    (
        "geometry_msgs/TransformStamped",
        "std_msgs/Header header\nstring child_frame_id\ngeometry_msgs/Transform transform\n",
    ),
    (
        "tf2_msgs/TFMessage",
        "geometry_msgs/TransformStamped[] transforms\n",
    ),
    (
        "sensor_msgs/Imu",
        "std_msgs/Header header\n\
         geometry_msgs/Quaternion orientation\nfloat64[9] orientation_covariance\n\
         geometry_msgs/Vector3 angular_velocity\nfloat64[9] angular_velocity_covariance\n\
         geometry_msgs/Vector3 linear_acceleration\nfloat64[9] linear_acceleration_covariance\n",
    ),
    (
        "sensor_msgs/JointState",
        "std_msgs/Header header\nstring[] name\nfloat64[] position\nfloat64[] velocity\nfloat64[] effort\n",
    ),
    (
        "sensor_msgs/MagneticField",
        "std_msgs/Header header\ngeometry_msgs/Vector3 magnetic_field\nfloat64[9] magnetic_field_covariance\n",
    ),
    (
        "rcl_interfaces/Log",
        "byte DEBUG=10\nbyte INFO=20\nbyte WARN=30\nbyte ERROR=40\nbyte FATAL=50\n\
         builtin_interfaces/Time stamp\nuint8 level\nstring name\nstring msg\nstring file\nstring function\nuint32 line\n",
    ),
];

/// The definition of a type by its name without `/msg/`.
fn own(name: &str) -> Option<&'static str> {
    DEFINITIONS
        .iter()
        .find(|(known, _)| *known == name)
        .map(|(_, text)| *text)
}

/// The complete `ros2msg` text of a type: its own definition, then each type that it needs, set apart as the format asks.
///
/// Empty for a type that is not in the table.
pub fn complete(name: &str) -> String {
    let name = name.replacen("/msg/", "/", 1);
    let Some(text) = own(&name) else {
        return String::new();
    };
    let mut all = text.to_owned();
    let mut needed = Vec::new();
    collect(text, &mut needed);
    for dependency in needed {
        all.push_str(&"=".repeat(80));
        all.push_str("\nMSG: ");
        all.push_str(dependency);
        all.push('\n');
        all.push_str(own(dependency).unwrap_or_default());
    }
    all
}

/// Appends the types that a definition names, each once, depth first.
fn collect(text: &'static str, needed: &mut Vec<&'static str>) {
    for line in text.lines() {
        let kind = line.split([' ', '[']).next().unwrap_or_default();
        if let Some((known, inner)) = DEFINITIONS.iter().find(|(known, _)| *known == kind)
            && !needed.contains(known)
        {
            needed.push(known);
            collect(inner, needed);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_definition_is_complete() {
        let text = complete("tf2_msgs/msg/TFMessage");
        for name in [
            "geometry_msgs/TransformStamped",
            "std_msgs/Header",
            "builtin_interfaces/Time",
            "geometry_msgs/Quaternion",
        ] {
            assert_eq!(text.matches(&format!("MSG: {name}\n")).count(), 1, "{name}");
        }
    }
}
