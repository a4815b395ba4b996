//! Every topic that the project writes, in one table: name, message, units, frame.

use crate::{cdr, schema};

/// The messages that a channel of ours may carry.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum MessageKind {
    /// `rath.State`.
    RathState,
    /// `rath.Phases`.
    Phases,
    /// `rath.HandleForces`.
    HandleForces,
    /// `rath.Energy`.
    Energy,
    /// `rath.Beat`.
    Beat,
    /// `foxglove.SceneUpdate`.
    SceneUpdate,
    /// `foxglove.RawAudio`.
    RawAudio,
    /// `sensor_msgs/msg/Imu`.
    Imu,
    /// `sensor_msgs/msg/JointState`.
    JointState,
    /// `sensor_msgs/msg/MagneticField`.
    MagneticField,
    /// `tf2_msgs/msg/TFMessage`.
    Tf,
    /// `std_msgs/msg/String` with a URDF.
    RobotDescription,
    /// `geometry_msgs/msg/PoseStamped`.
    PoseStamped,
    /// `std_msgs/msg/Header`: an instant with a name.
    Header,
    /// `std_msgs/msg/Float64`.
    Float64,
    /// `rcl_interfaces/msg/Log`: a line of text that Rerun and Foxglove show.
    Log,
}

impl MessageKind {
    /// The schema's name in the file.
    pub fn schema(self) -> &'static str {
        match self {
            MessageKind::RathState => "rath.State",
            MessageKind::Phases => "rath.Phases",
            MessageKind::HandleForces => "rath.HandleForces",
            MessageKind::Energy => "rath.Energy",
            MessageKind::Beat => "rath.Beat",
            MessageKind::SceneUpdate => "foxglove.SceneUpdate",
            MessageKind::RawAudio => "foxglove.RawAudio",
            MessageKind::Imu => "sensor_msgs/msg/Imu",
            MessageKind::JointState => "sensor_msgs/msg/JointState",
            MessageKind::MagneticField => "sensor_msgs/msg/MagneticField",
            MessageKind::Tf => "tf2_msgs/msg/TFMessage",
            MessageKind::RobotDescription => "std_msgs/msg/String",
            MessageKind::PoseStamped => "geometry_msgs/msg/PoseStamped",
            MessageKind::Header => "std_msgs/msg/Header",
            MessageKind::Float64 => "std_msgs/msg/Float64",
            MessageKind::Log => "rcl_interfaces/msg/Log",
        }
    }

    /// The encoding of its messages: `protobuf` or `cdr`.
    pub fn encoding(self) -> &'static str {
        if schema::descriptor_set(self.schema()).is_some() {
            "protobuf"
        } else {
            "cdr"
        }
    }

    /// The encoding of its schema: `protobuf` or `ros2msg`.
    pub fn schema_encoding(self) -> &'static str {
        match self.encoding() {
            "protobuf" => "protobuf",
            _ => "ros2msg",
        }
    }

    /// The schema's bytes: a descriptor set, or the complete message definition with all that it names.
    pub fn schema_data(self) -> Vec<u8> {
        match schema::descriptor_set(self.schema()) {
            Some(bytes) => bytes.to_vec(),
            None => cdr::definition::complete(self.schema()).into_bytes(),
        }
    }
}

/// One line of the table of topics.
#[derive(Clone, Copy, Debug)]
pub struct Topic {
    /// Name; `*` stands for a number that counts from 1.
    pub name: &'static str,
    /// What its messages are.
    pub kind: MessageKind,
    /// What it holds, with units.
    pub content: &'static str,
    /// The frame of its vectors.
    pub frame: &'static str,
}

/// Motion of the carried body.
pub const STATE: &str = "/rath/state";
/// Height, roll and tilt of the carried body once more, in the message that viewers plot by themselves.
pub const MOTION: &str = "/rath/motion";
/// Gait phases and beat phase.
pub const PHASES: &str = "/carriers/phases";
/// Handle forces.
pub const FORCES: &str = "/handles/forces";
/// The energy ledger.
pub const ENERGY: &str = "/energy";
/// Poses of body and carriers.
pub const TF: &str = "/tf";
/// URDF of body, pole and carriers.
pub const ROBOT_DESCRIPTION: &str = "/robot_description";
/// Force arrows and contact marks.
pub const SCENE: &str = "/scene";
/// The body's IMU.
pub const IMU_RATH: &str = "/imu/rath";
/// What a microphone beside the drum hears.
pub const AUDIO_DRUM: &str = "/audio/drum";
/// One message on every beat.
pub const BEAT: &str = "/beat";

/// All topics.
pub const TOPICS: &[Topic] = &[
    Topic {
        name: STATE,
        kind: MessageKind::RathState,
        content: "position m, orientation, velocity m/s, angular velocity rad/s (body), roll/pitch/yaw rad",
        frame: "world",
    },
    Topic {
        name: MOTION,
        kind: MessageKind::JointState,
        content: "height m, roll and tilt rad; their rates (body axes); vertical force N and moments N m of the handles (body axes)",
        frame: "",
    },
    Topic {
        name: PHASES,
        kind: MessageKind::Phases,
        content: "phases rad unwrapped, natural frequencies rad/s, beat phase rad, order parameter 1",
        frame: "",
    },
    Topic {
        name: FORCES,
        kind: MessageKind::HandleForces,
        content: "normal and tangential forces N, compression m, contact",
        frame: "world",
    },
    Topic {
        name: ENERGY,
        kind: MessageKind::Energy,
        content: "kinetic, potential, elastic, work in, dissipated, unexplained J",
        frame: "",
    },
    Topic {
        name: TF,
        kind: MessageKind::Tf,
        content: "translations m and rotations: world to rath, world to carrier_i",
        frame: "world",
    },
    Topic {
        name: ROBOT_DESCRIPTION,
        kind: MessageKind::RobotDescription,
        content: "URDF of body, pole and carriers, once",
        frame: "",
    },
    Topic {
        name: SCENE,
        kind: MessageKind::SceneUpdate,
        content: "force arrows and contact marks",
        frame: "world",
    },
    Topic {
        name: IMU_RATH,
        kind: MessageKind::Imu,
        content: "specific force m/s^2, angular velocity rad/s (REP-145)",
        frame: "rath",
    },
    Topic {
        name: "/imu/carrier_*",
        kind: MessageKind::Imu,
        content: "specific force m/s^2, angular velocity rad/s (REP-145)",
        frame: "carrier_*",
    },
    Topic {
        name: AUDIO_DRUM,
        kind: MessageKind::RawAudio,
        content: "sound, 16-bit PCM, one channel",
        frame: "",
    },
    Topic {
        name: BEAT,
        kind: MessageKind::Beat,
        content: "beat number, time s, tempo Hz",
        frame: "",
    },
];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_topic_stands_in_the_documentation() {
        let page = concat!(env!("CARGO_MANIFEST_DIR"), "/../../docs/recording.md");
        let text = std::fs::read_to_string(page).unwrap();
        for topic in TOPICS {
            let row = format!(
                "| `{}` | `{}` | {} |",
                topic.name,
                topic.kind.schema(),
                topic.content
            );
            assert!(text.lines().any(|line| line == row), "{row}");
        }
    }
}
