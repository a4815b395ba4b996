//! The message types, field by field as in their definitions.

use super::{Cdr, Encoder};

/// `builtin_interfaces/msg/Time`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Time {
    /// Seconds.
    pub sec: i32,
    /// Nanoseconds after `sec`, below 1e9.
    pub nanosec: u32,
}

impl Time {
    /// The stamp of a time in nanoseconds; seconds saturate outside 32 bits (the years 1901 to 2038).
    pub fn from_ns(t_ns: i64) -> Self {
        let sec = t_ns.div_euclid(1_000_000_000);
        Time {
            sec: sec.clamp(i64::from(i32::MIN), i64::from(i32::MAX)) as i32,
            // OK because a remainder by 1e9 fits in 30 bits.
            nanosec: t_ns.rem_euclid(1_000_000_000) as u32,
        }
    }

    /// The time in nanoseconds.
    pub fn to_ns(self) -> i64 {
        i64::from(self.sec) * 1_000_000_000 + i64::from(self.nanosec)
    }
}

impl Cdr for Time {
    fn cdr(&self, out: &mut Encoder<'_>) {
        out.i32(self.sec);
        out.u32(self.nanosec);
    }
}

/// `std_msgs/msg/Header`.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Header {
    /// When the data were taken.
    pub stamp: Time,
    /// The frame of the data.
    pub frame_id: String,
}

impl Cdr for Header {
    fn cdr(&self, out: &mut Encoder<'_>) {
        self.stamp.cdr(out);
        out.string(&self.frame_id);
    }
}

/// `geometry_msgs/msg/Vector3` (and `Point`, which has the same fields).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Vector3 {
    /// Component along x.
    pub x: f64,
    /// Component along y.
    pub y: f64,
    /// Component along z.
    pub z: f64,
}

impl From<[f64; 3]> for Vector3 {
    fn from([x, y, z]: [f64; 3]) -> Self {
        Vector3 { x, y, z }
    }
}

impl Cdr for Vector3 {
    fn cdr(&self, out: &mut Encoder<'_>) {
        for value in [self.x, self.y, self.z] {
            out.f64(value);
        }
    }
}

/// `geometry_msgs/msg/Quaternion`; no rotation by default.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Quaternion {
    /// Vector part along x.
    pub x: f64,
    /// Vector part along y.
    pub y: f64,
    /// Vector part along z.
    pub z: f64,
    /// Scalar part.
    pub w: f64,
}

impl Default for Quaternion {
    fn default() -> Self {
        Quaternion {
            x: 0.0,
            y: 0.0,
            z: 0.0,
            w: 1.0,
        }
    }
}

impl From<[f64; 4]> for Quaternion {
    fn from([x, y, z, w]: [f64; 4]) -> Self {
        Quaternion { x, y, z, w }
    }
}

impl Cdr for Quaternion {
    fn cdr(&self, out: &mut Encoder<'_>) {
        for value in [self.x, self.y, self.z, self.w] {
            out.f64(value);
        }
    }
}

/// `sensor_msgs/msg/Imu` in the convention of REP-145: specific force, m/s² (+g on the axis that points up at rest), and rad/s.
///
/// Covariances are row-major; all zero means unknown, a first element of −1 means that the field is not given.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Imu {
    /// Stamp and the sensor's frame.
    pub header: Header,
    /// Sensor in the world.
    pub orientation: Quaternion,
    /// Covariance of the orientation, rad².
    pub orientation_covariance: [f64; 9],
    /// Angular velocity in the sensor's frame, rad/s.
    pub angular_velocity: Vector3,
    /// Its covariance, rad²/s².
    pub angular_velocity_covariance: [f64; 9],
    /// Specific force in the sensor's frame, m/s².
    pub linear_acceleration: Vector3,
    /// Its covariance, m²/s⁴.
    pub linear_acceleration_covariance: [f64; 9],
}

/// The covariance that says 'this field is not given'.
pub const NOT_GIVEN: [f64; 9] = [-1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0];

impl Imu {
    /// A message without orientation, the usual content of a raw inertial sensor.
    pub fn raw(
        t_ns: i64,
        frame_id: &str,
        angular_velocity: [f64; 3],
        linear_acceleration: [f64; 3],
    ) -> Self {
        Imu {
            header: Header {
                stamp: Time::from_ns(t_ns),
                frame_id: frame_id.to_owned(),
            },
            orientation_covariance: NOT_GIVEN,
            angular_velocity: angular_velocity.into(),
            linear_acceleration: linear_acceleration.into(),
            ..Imu::default()
        }
    }

    /// Marks the angular velocity as not given.
    pub fn without_angular_velocity(mut self) -> Self {
        self.angular_velocity_covariance = NOT_GIVEN;
        self
    }

    /// Marks the linear acceleration as not given.
    pub fn without_linear_acceleration(mut self) -> Self {
        self.linear_acceleration_covariance = NOT_GIVEN;
        self
    }

    /// Gives the orientation; its covariance becomes zero: unknown.
    pub fn with_orientation(mut self, orientation: Quaternion) -> Self {
        self.orientation = orientation;
        self.orientation_covariance = [0.0; 9];
        self
    }
}

fn covariance(values: &[f64; 9], out: &mut Encoder<'_>) {
    for &value in values {
        out.f64(value);
    }
}

impl Cdr for Imu {
    fn cdr(&self, out: &mut Encoder<'_>) {
        self.header.cdr(out);
        self.orientation.cdr(out);
        covariance(&self.orientation_covariance, out);
        self.angular_velocity.cdr(out);
        covariance(&self.angular_velocity_covariance, out);
        self.linear_acceleration.cdr(out);
        covariance(&self.linear_acceleration_covariance, out);
    }
}

/// `sensor_msgs/msg/MagneticField`.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct MagneticField {
    /// Stamp and the sensor's frame.
    pub header: Header,
    /// Magnetic field in the sensor's frame, T.
    pub magnetic_field: Vector3,
    /// Its covariance, T².
    pub magnetic_field_covariance: [f64; 9],
}

impl Cdr for MagneticField {
    fn cdr(&self, out: &mut Encoder<'_>) {
        self.header.cdr(out);
        self.magnetic_field.cdr(out);
        covariance(&self.magnetic_field_covariance, out);
    }
}

/// `sensor_msgs/msg/JointState`: one value of each list for every joint; m and N where it slides, rad and N·m where it turns.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct JointState {
    /// Stamp.
    pub header: Header,
    /// Names of the joints.
    pub name: Vec<String>,
    /// Positions, m or rad.
    pub position: Vec<f64>,
    /// Velocities, m/s or rad/s.
    pub velocity: Vec<f64>,
    /// Forces or moments, N or N·m.
    pub effort: Vec<f64>,
}

impl Cdr for JointState {
    fn cdr(&self, out: &mut Encoder<'_>) {
        self.header.cdr(out);
        // OK because sequences of 4 billion are refused by the writer's limit on messages.
        out.u32(self.name.len() as u32);
        for name in &self.name {
            out.string(name);
        }
        for list in [&self.position, &self.velocity, &self.effort] {
            out.u32(list.len() as u32);
            for &value in list {
                out.f64(value);
            }
        }
    }
}

/// `geometry_msgs/msg/PoseStamped`.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PoseStamped {
    /// Stamp and the frame that the pose is given in.
    pub header: Header,
    /// Position, m.
    pub position: Vector3,
    /// Orientation: turns the body's coordinates into those of the frame.
    pub orientation: Quaternion,
}

impl Cdr for PoseStamped {
    fn cdr(&self, out: &mut Encoder<'_>) {
        self.header.cdr(out);
        self.position.cdr(out);
        self.orientation.cdr(out);
    }
}

/// `geometry_msgs/msg/Transform`.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Transform {
    /// Translation, m.
    pub translation: Vector3,
    /// Rotation.
    pub rotation: Quaternion,
}

/// `geometry_msgs/msg/TransformStamped`: the child frame seen from the header's frame.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TransformStamped {
    /// Stamp and parent frame.
    pub header: Header,
    /// The frame that is placed.
    pub child_frame_id: String,
    /// Where it is.
    pub transform: Transform,
}

impl Cdr for TransformStamped {
    fn cdr(&self, out: &mut Encoder<'_>) {
        self.header.cdr(out);
        out.string(&self.child_frame_id);
        self.transform.translation.cdr(out);
        self.transform.rotation.cdr(out);
    }
}

/// `tf2_msgs/msg/TFMessage`.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TfMessage {
    /// The transforms of one instant.
    pub transforms: Vec<TransformStamped>,
}

impl Cdr for TfMessage {
    fn cdr(&self, out: &mut Encoder<'_>) {
        // OK because a sequence of 4 billion transforms is refused by the writer's limit on messages.
        out.u32(self.transforms.len() as u32);
        for transform in &self.transforms {
            transform.cdr(out);
        }
    }
}

/// `std_msgs/msg/String`.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct StringMessage {
    /// The text.
    pub data: String,
}

impl Cdr for StringMessage {
    fn cdr(&self, out: &mut Encoder<'_>) {
        out.string(&self.data);
    }
}

/// `std_msgs/msg/Float64`.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Float64 {
    /// The value.
    pub data: f64,
}

impl Cdr for Float64 {
    fn cdr(&self, out: &mut Encoder<'_>) {
        out.f64(self.data);
    }
}

/// `rcl_interfaces/msg/Log`: one line of text with a level.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Log {
    /// When.
    pub stamp: Time,
    /// 10 debug, 20 info, 30 warn, 40 error, 50 fatal.
    pub level: u8,
    /// Who says it.
    pub name: String,
    /// What is said.
    pub msg: String,
}

impl Cdr for Log {
    fn cdr(&self, out: &mut Encoder<'_>) {
        self.stamp.cdr(out);
        out.u8(self.level);
        out.string(&self.name);
        out.string(&self.msg);
        out.string(""); // file
        out.string(""); // function
        out.u32(0); // line
    }
}
