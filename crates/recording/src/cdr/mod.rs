//! The ROS 2 messages that we write: types, CDR encoding (little endian, XCDR1) and the message definitions that go into the file.

pub mod definition;
mod messages;

pub use messages::{
    Float64, Header, Imu, JointState, Log, MagneticField, PoseStamped, Quaternion, StringMessage,
    TfMessage, Time, Transform, TransformStamped, Vector3,
};

/// Appends values in CDR: primitives aligned to their own size, counted from after the four header bytes.
pub struct Encoder<'a> {
    out: &'a mut Vec<u8>,
    origin: usize,
}

impl<'a> Encoder<'a> {
    /// Begins a message: writes the header of little-endian XCDR1.
    pub fn new(out: &'a mut Vec<u8>) -> Self {
        out.extend_from_slice(&[0, 1, 0, 0]);
        let origin = out.len();
        Encoder { out, origin }
    }

    fn align(&mut self, size: usize) {
        while !(self.out.len() - self.origin).is_multiple_of(size) {
            self.out.push(0);
        }
    }

    /// Appends one byte.
    pub fn u8(&mut self, value: u8) {
        self.out.push(value);
    }

    /// Appends a 32-bit integer.
    pub fn u32(&mut self, value: u32) {
        self.align(4);
        self.out.extend_from_slice(&value.to_le_bytes());
    }

    /// Appends a signed 32-bit integer.
    pub fn i32(&mut self, value: i32) {
        self.align(4);
        self.out.extend_from_slice(&value.to_le_bytes());
    }

    /// Appends a double.
    pub fn f64(&mut self, value: f64) {
        self.align(8);
        self.out.extend_from_slice(&value.to_le_bytes());
    }

    /// Appends a string: its length with the closing zero byte, its bytes, the zero byte.
    pub fn string(&mut self, value: &str) {
        // OK because a string of 4 GiB is refused by the writer's limit on messages long before.
        self.u32(value.len() as u32 + 1);
        self.out.extend_from_slice(value.as_bytes());
        self.out.push(0);
    }
}

/// A message that can be appended as CDR.
pub trait Cdr {
    /// Appends the fields in the order of the definition.
    fn cdr(&self, out: &mut Encoder<'_>);
}
