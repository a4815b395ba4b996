//! Samples → a recording: every topic of the contract, from one sample at a time.

use crate::beat::Stroke;
use crate::model::Model;
use crate::run::{Listener, Sample};
use crate::scene::{Scene, to_toml};
use crate::sensors::Reading;
use recording::cdr::{
    Header, Imu, JointState, Quaternion, StringMessage, TfMessage, Time, Transform,
    TransformStamped, Vector3,
};
use recording::load::Load;
use recording::schema::{foxglove, rath, timestamp};
use recording::topics::{self, MessageKind};
use recording::write::{ChannelId, RecordingWriter, WriteError};
use std::collections::BTreeMap;

/// Version of the program, as written into recordings.
pub const VERSION: &str = env!("CARGO_PKG_VERSION");

/// Writes samples as messages.
pub struct Recorder<'m> {
    model: &'m Model,
    writer: RecordingWriter,
    epoch_ns: i64,
    state: ChannelId,
    motion: ChannelId,
    phases: Option<ChannelId>,
    forces: ChannelId,
    energy: Option<ChannelId>,
    tf: ChannelId,
    scene: ChannelId,
    beat: Option<ChannelId>,
    audio: Option<ChannelId>,
    next_block: u64,
    /// One for each virtual sensor, by topic.
    imus: BTreeMap<String, ChannelId>,
    strokes: Vec<Stroke>,
    next_beat: usize,
    frames: Vec<String>,
    weight_n: f64,
    failed: Option<WriteError>,
}

impl<'m> Recorder<'m> {
    /// Begins a recording of `model`: metadata, the attached scene, channels, and the description of the bodies.
    ///
    /// # Errors
    /// What the writer says.
    pub fn new(model: &'m Model, writer: RecordingWriter) -> Result<Self, WriteError> {
        // OK because a checked scene keeps stamps below 2038.
        let epoch_ns = (model.scene.epoch_s * 1e9).round() as i64;
        Self::at(model, writer, epoch_ns)
    }

    /// The same with the stamp of t = 0 to the nanosecond, ns since 1970.
    ///
    /// # Errors
    /// What the writer says.
    pub fn at(
        model: &'m Model,
        mut writer: RecordingWriter,
        epoch_ns: i64,
    ) -> Result<Self, WriteError> {
        let scene = &model.scene;
        writer.metadata("rath", &metadata(scene))?;
        writer.attachment("scene.toml", "application/toml", to_toml(scene).as_bytes())?;
        let has = |there: bool, writer: &mut RecordingWriter, topic, kind| {
            there.then(|| writer.channel(topic, kind)).transpose()
        };
        let state = writer.channel(topics::STATE, MessageKind::RathState)?;
        let motion = writer.channel(topics::MOTION, MessageKind::JointState)?;
        let phases = has(
            model.layout().phases > 0,
            &mut writer,
            topics::PHASES,
            MessageKind::Phases,
        )?;
        let forces = writer.channel(topics::FORCES, MessageKind::HandleForces)?;
        let energy = has(
            scene.solver.energy,
            &mut writer,
            topics::ENERGY,
            MessageKind::Energy,
        )?;
        let tf = writer.channel(topics::TF, MessageKind::Tf)?;
        let arrows = writer.channel(topics::SCENE, MessageKind::SceneUpdate)?;
        let beat = has(
            model.beat().is_some(),
            &mut writer,
            topics::BEAT,
            MessageKind::Beat,
        )?;
        let audio = has(
            model.track().is_some(),
            &mut writer,
            topics::AUDIO_DRUM,
            MessageKind::RawAudio,
        )?;
        let imus = model
            .imus()
            .iter()
            .map(|imu| {
                Ok((
                    imu.topic.clone(),
                    writer.channel(&imu.topic, MessageKind::Imu)?,
                ))
            })
            .collect::<Result<_, WriteError>>()?;
        let description =
            writer.channel(topics::ROBOT_DESCRIPTION, MessageKind::RobotDescription)?;
        writer.message(description, epoch_ns, &StringMessage { data: urdf(scene) })?;
        Ok(Self {
            model,
            writer,
            epoch_ns,
            state,
            motion,
            phases,
            forces,
            energy,
            tf,
            scene: arrows,
            beat,
            audio,
            next_block: 0,
            imus,
            strokes: model
                .beat()
                .map_or_else(Vec::new, |b| b.strokes(scene.duration_s)),
            next_beat: 0,
            frames: (1..=model.carriers())
                .map(|i| format!("carrier_{i}"))
                .collect(),
            weight_n: model.body.mass_kg * model.body.gravity_m_per_s2.norm(),
            failed: None,
        })
    }

    /// The writer, for what else belongs into the recording.
    pub fn writer(&mut self) -> &mut RecordingWriter {
        &mut self.writer
    }

    /// Why it took no more samples, where it did not: to be asked before the writer is given anything else.
    pub fn failure(&mut self) -> Option<WriteError> {
        self.failed.take()
    }

    /// Completes the recording and gives it its name.
    ///
    /// # Errors
    /// What the writer says, now or at an earlier sample.
    pub fn finish(mut self) -> Result<(), WriteError> {
        if let Some(error) = self.failed {
            return Err(error);
        }
        // The last sample may be long ago.
        self.write_beats(self.model.scene.duration_s)?;
        self.writer.finish()
    }

    fn stamp_ns(&self, t_s: f64) -> i64 {
        // OK because a checked scene keeps stamps below 2038.
        self.epoch_ns + (t_s * 1e9).round() as i64
    }

    fn write(&mut self, s: &Sample) -> Result<(), WriteError> {
        self.write_beats(s.t_s)?;
        self.write_sound(s.t_s)?;
        let t_ns = self.stamp_ns(s.t_s);
        let [roll_rad, pitch_rad, yaw_rad] = s.pose.roll_pitch_yaw_rad();
        let [x, y, z, w] = s.pose.orientation;
        self.writer.message(
            self.state,
            t_ns,
            &rath::State {
                time_s: s.t_s,
                position_m: Some(vector(s.pose.position_m)),
                orientation: Some(rath::Quaternion { x, y, z, w }),
                velocity_m_per_s: Some(vector(s.pose.velocity_m_per_s)),
                angular_velocity_rad_per_s: Some(vector(s.pose.spin_rad_per_s)),
                roll_rad,
                pitch_rad,
                yaw_rad,
            },
        )?;
        self.writer.message(self.motion, t_ns, &motion(s, t_ns))?;
        if let Some(channel) = self.phases {
            let message = rath::Phases {
                time_s: s.t_s,
                phase_rad: s.phase_rad.clone(),
                natural_frequency_rad_per_s: self.model.natural_rad_per_s().to_vec(),
                beat_phase_rad: s.beat_phase_rad,
                beat_present: s.beat_phase_rad.is_some(),
                order_parameter: s.order_parameter().unwrap_or(0.0),
            };
            self.writer.message(channel, t_ns, &message)?;
        }
        // What is tied is in contact though it pulls.
        let tied = self.model.contact_pulls();
        let message = rath::HandleForces {
            time_s: s.t_s,
            normal_n: s.normal_n.clone(),
            tangential_n: s
                .tangential_n
                .iter()
                .map(|t| vector([t[0], t[1], 0.0]))
                .collect(),
            compression_m: s.compression_m.clone(),
            in_contact: s.normal_n.iter().map(|n| tied || *n > 0.0).collect(),
        };
        self.writer.message(self.forces, t_ns, &message)?;
        if let (Some(channel), Some(e)) = (self.energy, s.energy) {
            let message = rath::Energy {
                time_s: s.t_s,
                kinetic_j: e.kinetic_j,
                potential_j: e.potential_j,
                elastic_j: e.elastic_j,
                work_in_j: e.work_in_j,
                dissipated_j: e.dissipated_j,
                unexplained_j: e.unexplained_j,
                shares: self
                    .model
                    .accounts()
                    .zip(&s.shares_j)
                    .map(|(effect, [work_j, dissipated_j])| rath::energy::Share {
                        effect: effect.into(),
                        work_j: *work_j,
                        dissipated_j: *dissipated_j,
                    })
                    .collect(),
            };
            self.writer.message(channel, t_ns, &message)?;
        }
        self.writer
            .message(self.tf, t_ns, &self.transforms(s, t_ns))?;
        let arrows = self.arrows(s, t_ns);
        self.writer.message(self.scene, t_ns, &arrows)
    }

    /// Every beat up to and including `until_s`, at its own time.
    fn write_beats(&mut self, until_s: f64) -> Result<(), WriteError> {
        let Some(channel) = self.beat else {
            return Ok(());
        };
        while let Some(stroke) = self
            .strokes
            .get(self.next_beat)
            .filter(|s| s.t_s <= until_s)
        {
            let message = rath::Beat {
                number: self.next_beat as u64,
                time_s: stroke.t_s,
                tempo_hz: stroke.tempo_hz,
            };
            self.writer.message(
                channel,
                self.epoch_ns + (stroke.t_s * 1e9).round() as i64,
                &message,
            )?;
            self.next_beat += 1;
        }
        Ok(())
    }

    /// Every block of the drum track that has ended by `until_s`; the last one at the end of the run.
    fn write_sound(&mut self, until_s: f64) -> Result<(), WriteError> {
        let (Some(channel), Some(track)) = (self.audio, self.model.track()) else {
            return Ok(());
        };
        let at_the_end = until_s * self.model.scene.log_rate_hz + 1.0
            > self.model.scene.duration_s * self.model.scene.log_rate_hz;
        while let Some(block) = track.block(self.next_block) {
            if block.end_s > until_s && !at_the_end {
                break;
            }
            let t_ns = self.epoch_ns + (block.stamp_s * 1e9).round() as i64;
            let data = block.sound.iter().flat_map(|s| s.to_le_bytes()).collect();
            let message = foxglove::RawAudio::pcm_s16(t_ns, data, track.rate_hz, 1);
            self.writer.message(channel, t_ns, &message)?;
            self.next_block += 1;
        }
        Ok(())
    }

    /// A sensor's sample, stamped by the sensor's own clock.
    fn write_reading(&mut self, r: &Reading<'_>) -> Result<(), WriteError> {
        let t_ns = self.stamp_ns(r.stamp_s);
        let mut message = Imu::raw(
            t_ns,
            r.frame,
            r.angular_velocity_rad_per_s,
            r.specific_force_m_per_s2,
        );
        for axis in [0, 4, 8] {
            message.angular_velocity_covariance[axis] = r.angular_velocity_variance;
            message.linear_acceleration_covariance[axis] = r.specific_force_variance;
        }
        self.writer.message(self.imus[r.topic], t_ns, &message)
    }

    fn transforms(&self, s: &Sample, t_ns: i64) -> TfMessage {
        let [x, y, z, w] = s.pose.orientation;
        let mut transforms = Vec::with_capacity(1 + self.frames.len());
        transforms.push(transform(
            t_ns,
            "rath",
            s.pose.position_m,
            Quaternion { x, y, z, w },
        ));
        let [heading, _] = self.model.heading(s.t_s);
        let (z, w) = (0.5 * heading).sin_cos();
        let upright = Quaternion {
            x: 0.0,
            y: 0.0,
            z,
            w,
        };
        for (frame, shoulder) in self.frames.iter().zip(&s.shoulder_m) {
            transforms.push(transform(t_ns, frame, *shoulder, upright));
        }
        TfMessage { transforms }
    }

    /// Force arrows (half a metre is a fair share of the body's weight) and contact marks.
    fn arrows(&self, s: &Sample, t_ns: i64) -> foxglove::SceneUpdate {
        let handles = s.normal_n.len();
        let metres_per_newton = match self.weight_n > 0.0 {
            true => 0.5 * handles as f64 / self.weight_n,
            false => 0.0,
        };
        let mut arrows = Vec::with_capacity(handles);
        let mut spheres = Vec::with_capacity(handles);
        for ((&normal_n, tangential_n), handle_m) in
            s.normal_n.iter().zip(&s.tangential_n).zip(&s.handle_m)
        {
            let load = Load::of(normal_n, self.weight_n, handles);
            let color = Some(contact_color(load));
            let force_n = [tangential_n[0], tangential_n[1], normal_n];
            let [x, y, z] = force_n.map(|n| metres_per_newton * n);
            let length = (x * x + y * y + z * z).sqrt();
            if length > 1e-6 {
                let orientation = Some(turn_from_x([x / length, y / length, z / length]));
                arrows.push(foxglove::ArrowPrimitive {
                    pose: Some(foxglove::Pose {
                        position: Some(point(*handle_m)),
                        orientation,
                    }),
                    shaft_length: 0.8 * length,
                    shaft_diameter: 0.03,
                    head_length: 0.2 * length,
                    head_diameter: 0.06,
                    color,
                });
            }
            spheres.push(foxglove::SpherePrimitive {
                pose: Some(foxglove::Pose {
                    position: Some(point(*handle_m)),
                    orientation: Some(foxglove::Quaternion {
                        x: 0.0,
                        y: 0.0,
                        z: 0.0,
                        w: 1.0,
                    }),
                }),
                size: Some(point([if load == Load::Slack { 0.16 } else { 0.1 }; 3])),
                color,
            });
        }
        foxglove::SceneUpdate {
            deletions: Vec::new(),
            entities: vec![foxglove::SceneEntity {
                timestamp: Some(timestamp(t_ns)),
                frame_id: "world".into(),
                id: "handle_forces".into(),
                arrows,
                spheres,
                ..foxglove::SceneEntity::default()
            }],
        }
    }
}

impl Listener for Recorder<'_> {
    fn sample(&mut self, sample: &Sample) -> bool {
        if self.failed.is_some() {
            return false;
        }
        if let Err(error) = self.write(sample) {
            self.failed = Some(error);
            return false;
        }
        true
    }

    fn reading(&mut self, reading: &Reading<'_>) {
        if self.failed.is_none()
            && let Err(error) = self.write_reading(reading)
        {
            self.failed = Some(error);
        }
    }
}

/// The metadata record `rath`: what an analyzer may need without opening the scene.
pub fn metadata(scene: &Scene) -> BTreeMap<String, String> {
    let [gx, gy, gz] = scene.body.gravity_m_per_s2;
    let gravity = (gx * gx + gy * gy + gz * gz).sqrt();
    [
        ("source", "sim".to_owned()),
        ("version", VERSION.to_owned()),
        ("scene", scene.name.clone()),
        ("seed", scene.seed.to_string()),
        ("method", crate::run::method_name(scene)),
        ("tolerance", format!("{:e}", scene.solver.tolerance)),
        ("step_s", scene.solver.step_s.to_string()),
        ("analysis_start_s", scene.analysis_start_s.to_string()),
        ("mass_kg", scene.body.mass_kg.to_string()),
        ("gravity_m_per_s2", gravity.to_string()),
    ]
    .map(|(key, value)| (key.to_owned(), value))
    .into()
}

/// How a handle is loaded, in colours that colour-blind people tell apart.
fn contact_color(load: Load) -> foxglove::Color {
    let [r, g, b] = match load {
        Load::Slack => [0.84, 0.37, 0.0],
        Load::NearlyUnloaded => [0.94, 0.89, 0.26],
        Load::Loaded => [0.0, 0.45, 0.70],
        Load::Pulled => [0.80, 0.47, 0.65],
    };
    foxglove::Color { r, g, b, a: 1.0 }
}

/// The shortest rotation that takes +x to the unit vector `d`.
fn turn_from_x(d: [f64; 3]) -> foxglove::Quaternion {
    let w = 1.0 + d[0];
    if w < 1e-12 {
        return foxglove::Quaternion {
            x: 0.0,
            y: 0.0,
            z: 1.0,
            w: 0.0,
        };
    }
    let n = (w * w + d[1] * d[1] + d[2] * d[2]).sqrt();
    foxglove::Quaternion {
        x: 0.0,
        y: -d[2] / n,
        z: d[1] / n,
        w: w / n,
    }
}

/// Height, roll and tilt as joints: of all messages Rerun plots this one by itself. Efforts are what the handles exert: ΣN_i, and the
/// moments of N_i and T_i about the body's x and y through its centre of mass.
fn motion(s: &Sample, t_ns: i64) -> JointState {
    use nalgebra::{Quaternion, UnitQuaternion, Vector3};
    let centre = Vector3::from(s.pose.position_m);
    let mut force = Vector3::zeros();
    let mut moment = Vector3::zeros();
    for ((handle_m, normal_n), [tx, ty]) in s.handle_m.iter().zip(&s.normal_n).zip(&s.tangential_n)
    {
        let on_handle = Vector3::new(*tx, *ty, *normal_n);
        force += on_handle;
        moment += (Vector3::from(*handle_m) - centre).cross(&on_handle);
    }
    let [x, y, z, w] = s.pose.orientation;
    let world_from_body = UnitQuaternion::new_normalize(Quaternion::new(w, x, y, z));
    let moment = world_from_body.inverse_transform_vector(&moment);
    let [roll_rad, tilt_rad, _] = s.pose.roll_pitch_yaw_rad();
    let [spin_x, spin_y, _] = s.pose.spin_rad_per_s;
    JointState {
        header: Header {
            stamp: Time::from_ns(t_ns),
            frame_id: String::new(),
        },
        name: ["height", "roll", "tilt"].map(str::to_owned).into(),
        position: vec![s.pose.position_m[2], roll_rad, tilt_rad],
        velocity: vec![s.pose.velocity_m_per_s[2], spin_x, spin_y],
        effort: vec![force.z, moment.x, moment.y],
    }
}

fn vector([x, y, z]: [f64; 3]) -> rath::Vector3 {
    rath::Vector3 { x, y, z }
}

fn point([x, y, z]: [f64; 3]) -> foxglove::Vector3 {
    foxglove::Vector3 { x, y, z }
}

fn transform(
    t_ns: i64,
    child: &str,
    [x, y, z]: [f64; 3],
    rotation: Quaternion,
) -> TransformStamped {
    TransformStamped {
        header: Header {
            stamp: Time::from_ns(t_ns),
            frame_id: "world".into(),
        },
        child_frame_id: child.into(),
        transform: Transform {
            translation: Vector3 { x, y, z },
            rotation,
        },
    }
}

/// Body, poles and carriers as URDF: boxes and cylinders on the frames of `/tf`. The shapes are for the eye alone.
fn urdf(scene: &Scene) -> String {
    use std::fmt::Write;
    let handles = &scene.carriers.handles_m;
    let mut text =
        String::from("<?xml version=\"1.0\"?>\n<robot name=\"rath\">\n  <link name=\"world\"/>\n");
    text += "  <joint name=\"world_to_rath\" type=\"floating\"><parent link=\"world\"/><child link=\"rath\"/></joint>\n";
    text += "  <link name=\"rath\">\n";
    text += "    <visual><geometry><box size=\"0.7 0.5 0.6\"/></geometry>\
             <material name=\"body\"><color rgba=\"0.80 0.47 0.65 1\"/></material></visual>\n";
    // One pole for every distinct (y, z) of the handles.
    let mut poles: Vec<[f64; 4]> = Vec::new();
    for &[x, y, z] in handles {
        match poles
            .iter_mut()
            .find(|p| (p[0] - y).abs() < 1e-6 && (p[1] - z).abs() < 1e-6)
        {
            Some(pole) => (pole[2], pole[3]) = (pole[2].min(x), pole[3].max(x)),
            None => poles.push([y, z, x, x]),
        }
    }
    for [y, z, from, to] in poles {
        // Whole micrometres: people read this text too.
        let whole = |x: f64| (x * 1e6).round() / 1e6;
        let (middle, length) = (whole(0.5 * (from + to)), whole((to - from).max(0.2) + 0.4));
        let _ = writeln!(
            text,
            "    <visual><origin xyz=\"{middle} {y} {z}\" rpy=\"0 1.5707963267948966 0\"/><geometry><cylinder radius=\"0.04\" \
             length=\"{length}\"/></geometry><material name=\"pole\"><color rgba=\"0.35 0.25 0.15 1\"/></material></visual>"
        );
    }
    text += "  </link>\n";
    for i in 1..=handles.len() {
        let height = scene.carriers.shoulder_height_m.get(i - 1).abs().max(0.2);
        let _ = writeln!(
            text,
            "  <joint name=\"world_to_carrier_{i}\" type=\"floating\"><parent link=\"world\"/><child link=\"carrier_{i}\"/></joint>\n  \
             <link name=\"carrier_{i}\"><visual><origin xyz=\"0 0 {}\"/><geometry><cylinder radius=\"0.15\" length=\"{height}\"/></geometry>\
             <material name=\"carrier\"><color rgba=\"0.34 0.71 0.91 1\"/></material></visual></link>",
            -0.5 * height
        );
    }
    text + "</robot>\n"
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn arrows_point_where_the_force_does() {
        for d in [
            [1.0, 0.0, 0.0],
            [0.0, 0.0, 1.0],
            [0.0, -0.6, 0.8],
            [-0.6, 0.0, 0.8],
        ] {
            let q = turn_from_x(d);
            let q = nalgebra::UnitQuaternion::new_normalize(nalgebra::Quaternion::new(
                q.w, q.x, q.y, q.z,
            ));
            let got = q * nalgebra::Vector3::x();
            assert!(
                (got - nalgebra::Vector3::from(d)).norm() < 1e-12,
                "{d:?}: {got}"
            );
        }
    }
}
