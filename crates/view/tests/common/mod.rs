//! Small recordings made here, and what was sent for them, taken apart.
#![allow(dead_code)]

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::process::Command;

use analyze::request::Request;
use re_chunk::Chunk;
use re_log_types::LogMsg;
use re_sdk_types::archetypes::Transform3D;
use re_sdk_types::blueprint::archetypes::ViewContents;
use recording::cdr::{Header, Imu, Quaternion, TfMessage, Time, Transform, TransformStamped};
use recording::read::Recording;
use recording::schema::rath;
use recording::topics::{self, MessageKind};
use recording::write::{ChannelId, RawChannel, RecordingWriter, WriterOptions};
use view::load::{Detail, load, options};
use view::store::Sink;

/// Samples of a made run: 20 s at 30 Hz.
pub const ROWS: usize = 601;

/// A made run of `carriers` around a body that bobs at 2 Hz, rolls at 1 Hz and loses contact in every cycle.
pub fn run(path: &Path, carriers: usize) {
    run_logged(path, carriers, |t_ns| t_ns);
}

/// The same by a logger that gives a message of `t_ns` the time `logged(t_ns)`.
pub fn run_logged(path: &Path, carriers: usize, logged: fn(i64) -> i64) {
    let mut writer = RecordingWriter::create(path, &WriterOptions::default()).unwrap();
    let meta = [
        ("scene", "made"),
        ("seed", "7"),
        ("mass_kg", "60"),
        ("gravity_m_per_s2", "9.81"),
        ("analysis_start_s", "5"),
    ];
    let meta = meta.map(|(k, v)| (k.to_owned(), v.to_owned())).into();
    writer.metadata("rath", &meta).unwrap();
    let handles: Vec<[f64; 3]> = (0..carriers)
        .map(|i| {
            [
                (i / 2) as f64 - 1.0,
                if i % 2 == 0 { 0.4 } else { -0.4 },
                0.1,
            ]
        })
        .collect();
    let list: Vec<String> = handles
        .iter()
        .map(|[x, y, z]| format!("[{x:.1}, {y:.1}, {z:.1}]"))
        .collect();
    let scene = format!(
        "name = \"made\"\n[carriers]\nhandles_m = [{}]\n",
        list.join(", ")
    );
    writer
        .attachment("scene.toml", "application/toml", scene.as_bytes())
        .unwrap();
    let state = writer
        .channel(topics::STATE, MessageKind::RathState)
        .unwrap();
    let phases = writer.channel(topics::PHASES, MessageKind::Phases).unwrap();
    let forces = writer
        .channel(topics::FORCES, MessageKind::HandleForces)
        .unwrap();
    let energy = writer.channel(topics::ENERGY, MessageKind::Energy).unwrap();
    let tf = writer.channel(topics::TF, MessageKind::Tf).unwrap();
    let turn = std::f64::consts::TAU;
    for k in 0..ROWS {
        let t_ns = k as i64 * 1_000_000_000 / 30;
        let t = t_ns as f64 / 1e9;
        let (roll, z) = (0.3 * (turn * t).sin(), 0.9 + 0.05 * (turn * 2.0 * t).sin());
        let place = rath::Vector3 {
            x: 0.8 * t,
            y: 0.0,
            z,
        };
        let orientation = rath::Quaternion {
            x: (roll / 2.0).sin(),
            y: 0.0,
            z: 0.0,
            w: (roll / 2.0).cos(),
        };
        let message = rath::State {
            time_s: t,
            position_m: Some(place),
            orientation: Some(orientation),
            roll_rad: roll,
            pitch_rad: 0.01,
            ..rath::State::default()
        };
        writer.message(state, logged(t_ns), &message).unwrap();
        let phase_rad: Vec<f64> = (0..carriers)
            .map(|i| turn * 2.0 * t + 0.1 * i as f64)
            .collect();
        let beat_present = t >= 5.0;
        let message = rath::Phases {
            time_s: t,
            phase_rad,
            beat_phase_rad: beat_present.then_some(turn * 2.0 * t),
            beat_present,
            order_parameter: 1.0,
            ..rath::Phases::default()
        };
        writer.message(phases, logged(t_ns), &message).unwrap();
        let n = (60.0 * 9.81 / carriers as f64 * (1.0 + 1.3 * (turn * 2.0 * t).sin())).max(0.0);
        let message = rath::HandleForces {
            time_s: t,
            normal_n: vec![n; carriers],
            ..rath::HandleForces::default()
        };
        writer.message(forces, logged(t_ns), &message).unwrap();
        let message = rath::Energy {
            time_s: t,
            kinetic_j: 10.0,
            potential_j: 500.0 + z,
            ..rath::Energy::default()
        };
        writer.message(energy, logged(t_ns), &message).unwrap();
        let frame = |child: &str, [x, y, z]: [f64; 3]| TransformStamped {
            header: Header {
                stamp: Time::from_ns(t_ns),
                frame_id: "world".into(),
            },
            child_frame_id: child.into(),
            transform: Transform {
                translation: [x, y, z].into(),
                rotation: Quaternion::default(),
            },
        };
        let mut transforms = vec![frame("rath", [0.8 * t, 0.0, z])];
        for (i, h) in handles.iter().enumerate() {
            transforms.push(frame(
                &format!("carrier_{}", i + 1),
                [0.8 * t + h[0], h[1], 1.05],
            ));
        }
        let message = TfMessage { transforms };
        writer.message(tf, logged(t_ns), &message).unwrap();
    }
    writer.finish().unwrap();
}

/// A log of `sensors` inertial sensors: `seconds` at `hz`, with real time stamps.
pub fn imus(path: &Path, sensors: usize, seconds: usize, hz: usize) {
    imus_logged(path, sensors, seconds, hz, |t_ns| t_ns);
}

/// The same by a logger that gives a message of `t_ns` the time `logged(t_ns)`.
pub fn imus_logged(path: &Path, sensors: usize, seconds: usize, hz: usize, logged: fn(i64) -> i64) {
    let mut writer = RecordingWriter::create(path, &WriterOptions::default()).unwrap();
    let channels: Vec<_> = (0..sensors)
        .map(|i| {
            writer
                .channel(&format!("/imu/s{i}"), MessageKind::Imu)
                .unwrap()
        })
        .collect();
    for k in 0..seconds * hz {
        let t_ns = 1_700_000_000_000_000_000 + (k * 1_000_000_000 / hz) as i64;
        let (sin, cos) = (std::f64::consts::TAU * 2.0 * k as f64 / hz as f64).sin_cos();
        for channel in &channels {
            let imu = Imu::raw(
                t_ns,
                "imu",
                [0.2 * sin, 0.0, 0.0],
                [0.0, 0.5 * cos, 9.81 + sin],
            );
            writer.message(*channel, logged(t_ns), &imu).unwrap();
        }
    }
    writer.finish().unwrap();
}

/// What was sent.
#[derive(Default)]
pub struct Taken(pub Vec<LogMsg>);

impl Sink for Taken {
    fn send(&mut self, message: LogMsg) -> anyhow::Result<()> {
        self.0.push(message);
        Ok(())
    }
}

impl Taken {
    /// Of a blueprint's views what each queries.
    pub fn queries(&self) -> Vec<Vec<String>> {
        let of = |chunk: Chunk| {
            let component = ViewContents::descriptor_query().component;
            let mut rows = chunk.iter_slices::<String>(component);
            let row = rows.next()?;
            Some(row.iter().map(|query| query.to_string()).collect())
        };
        self.chunks(true).filter_map(of).collect()
    }

    /// Translations of an entity, in the order in which they were sent.
    pub fn translations(&self, entity: &str) -> Vec<[f32; 3]> {
        let component = Transform3D::descriptor_translation().component;
        let chunks = self.chunks(false);
        let of = chunks.filter(|c| c.entity_path().to_string() == entity);
        let places = |c: Chunk| {
            let rows = c.iter_slices::<[f32; 3]>(component);
            rows.flat_map(<[[f32; 3]]>::to_vec).collect::<Vec<_>>()
        };
        of.flat_map(places).collect()
    }

    fn chunks(&self, blueprint: bool) -> impl Iterator<Item = Chunk> {
        self.0.iter().filter_map(move |message| match message {
            LogMsg::ArrowMsg(id, arrow) if id.is_blueprint() == blueprint => {
                Some(Chunk::from_arrow_msg(arrow).unwrap())
            }
            _ => None,
        })
    }

    /// Rows on timelines by entity.
    pub fn rows(&self) -> BTreeMap<String, usize> {
        let mut rows = BTreeMap::new();
        for chunk in self.chunks(false).filter(|chunk| !chunk.is_static()) {
            *rows.entry(chunk.entity_path().to_string()).or_default() += chunk.num_rows();
        }
        rows
    }

    /// Every entity.
    pub fn entities(&self) -> BTreeSet<String> {
        self.chunks(false)
            .map(|chunk| chunk.entity_path().to_string())
            .collect()
    }

    /// Names of all timelines.
    pub fn timelines(&self) -> BTreeSet<String> {
        self.chunks(false)
            .flat_map(|chunk| {
                chunk
                    .timelines()
                    .keys()
                    .map(|t| t.to_string())
                    .collect::<Vec<_>>()
            })
            .collect()
    }

    /// Times of an entity's rows, in order.
    pub fn times_ns(&self, entity: &str) -> Vec<i64> {
        let chunks = self.chunks(false);
        let of = chunks.filter(|c| c.entity_path().to_string() == entity && !c.is_static());
        let times = |c: Chunk| {
            c.timelines()[&view::store::TIME.into()]
                .times_raw()
                .to_vec()
        };
        let mut out: Vec<i64> = of.flat_map(times).collect();
        out.sort_unstable();
        out
    }

    /// Times and values of an entity's scalars, in order of time.
    pub fn scalars(&self, entity: &str) -> Vec<(i64, f64)> {
        let component = re_sdk_types::archetypes::Scalars::descriptor_scalars().component;
        let mut out: Vec<(i64, f64)> = Vec::new();
        for chunk in self
            .chunks(false)
            .filter(|c| c.entity_path().to_string() == entity && !c.is_static())
        {
            let times = chunk.timelines()[&view::store::TIME.into()]
                .times_raw()
                .to_vec();
            let values = chunk
                .iter_slices::<f64>(component)
                .flat_map(<[f64]>::to_vec);
            out.extend(times.into_iter().zip(values));
        }
        out.sort_by_key(|(t, _)| *t);
        out
    }
}

/// Sends the file as `view` does; gives the titles of the views too.
pub fn taken(path: &Path) -> (Taken, Vec<String>) {
    let recording = Recording::open(path, &options(&Request::default())).unwrap();
    let (take, _) = load("file", &recording, Detail::Thinned, &Request::default()).unwrap();
    let mut sink = Taken::default();
    let sent = view::send_part(&mut sink, "id", &take, None).unwrap();
    let titles = view::blueprint::titles(&sent.layout)
        .into_iter()
        .map(str::to_owned)
        .collect();
    (sink, titles)
}

/// Runs the command.
pub fn view(arguments: &[&str]) -> std::process::Output {
    Command::new(env!("CARGO_BIN_EXE_view"))
        .args(arguments)
        .output()
        .unwrap()
}

/// The viewer's own command line, where there is one on PATH of the right version.
pub fn rerun() -> Option<PathBuf> {
    match view::viewer::find() {
        Ok(found) => Some(found),
        Err(error) => {
            eprintln!("skipped: {error}");
            None
        }
    }
}

/// A channel of JSON messages without a schema, or with an empty one of this name.
pub fn json_channel(writer: &mut RecordingWriter, topic: &str, schema_name: &str) -> ChannelId {
    let schema: (&str, &[u8]) = match schema_name {
        "" => ("", b""),
        _ => ("jsonschema", b"{\"type\":\"object\"}"),
    };
    let channel = RawChannel {
        topic,
        message_encoding: "json",
        schema_name,
        schema_encoding: schema.0,
        schema_data: schema.1,
        metadata: &Default::default(),
    };
    writer.raw_channel(&channel).unwrap()
}
