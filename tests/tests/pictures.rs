//! What the Rerun viewer makes of `view --save`: entities, timelines and rows by its own tools, views by a picture without a screen.
//!
//! A picture is taken by a program of the machine, so these tests are run when asked for, with its name and with `rerun` on PATH:
//!
//!     RERUN_PICTURE=PROGRAM cargo test --release -p tests --test pictures -- --ignored
//!
//! `PROGRAM FILE PICTURE.png --at SECONDS --timeout SECONDS` has to open FILE in the viewer and to print `views drawn: TITLE | TITLE …; time: …`,
//! with `BLANK` beside a view of one colour; it ends with 1 where the machine cannot draw.

use std::path::{Path, PathBuf};
use std::process::Command;

use recording::read::{ReadOptions, Recording};
use recording::topics::MessageKind;
use recording::write::{RecordingWriter, WriterOptions};
use tests::{good, on_path, run_in};

/// What is expected of one recording.
struct Case {
    scene: &'static str,
    /// Only the inertial sensors' topics of it.
    sensors_only: bool,
    /// Beginnings of the titles of the views that are seen first, in order.
    views: &'static [&'static str],
    /// Entities and their rows.
    rows: &'static [(&'static str, usize)],
}

const SCENE: &[&str] = &[
    "Scene: 0.5 m of arrow",
    "Phases",
    "Spectra of height (blue), roll (vermilion)",
    "Events",
    "Height of the centre of mass [m]",
    "Roll (vermilion) and tilt (blue) [deg]",
    "Support/Mg",
    "Order parameter r",
];

/// A minute at 30 Hz has 1801 samples.
const CASES: &[Case] = &[
    Case {
        scene: "music",
        sensors_only: false,
        views: SCENE,
        rows: &[
            ("/world/rath", 1801),
            ("/world/forces", 1801),
            ("/world/carrier_2", 1801),
            ("/phases/carriers", 1801),
            ("/plots/height/z", 1801),
            ("/plots/angles/roll", 1801),
            ("/plots/forces/handle_2", 1801),
            ("/plots/forces/unloaded", 2),
            ("/plots/synchrony/r", 1801),
            ("/plots/ledger/work_in", 1801),
        ],
    },
    Case {
        scene: "baseline",
        sensors_only: false,
        views: SCENE,
        rows: &[("/world/rath", 1801), ("/plots/synchrony/chance", 2)],
    },
    Case {
        scene: "eight-carriers",
        sensors_only: false,
        views: SCENE,
        rows: &[
            ("/world/carrier_8", 1801),
            ("/plots/forces/handle_8", 1801),
            ("/plots/synchrony/band_low", 2),
        ],
    },
    Case {
        scene: "field-imu",
        sensors_only: true,
        views: &[
            "/imu/rath angular velocity [rad/s]",
            "Specific force [m/s²]",
            "Height about its mean [m], estimated",
            "Roll (vermilion) and tilt (blue) about their means [deg], estimated",
            "N_tot/Mg",
            "Order parameter r",
            "Scene: turned as inertial sensors say, on the spot",
            "Phases",
            "Spectra of height (blue), roll (vermilion)",
            "Events",
        ],
        // 60 s at 200 Hz.
        rows: &[
            ("/topics/imu/rath/gyro/x", 12001),
            ("/topics/imu/rath/accel/z", 12001),
            ("/topics/imu/carrier_2/attitude/roll", 12001),
            ("/plots/angles/roll", 12001),
        ],
    },
];

/// The messages of inertial sensors alone, as a logger on the road would have them.
fn sensors_of(from: &Path, to: &Path) {
    let recording = Recording::open(from, &ReadOptions::default()).expect("a recording");
    let mut writer = RecordingWriter::create(to, &WriterOptions::default()).expect("a file");
    let mut channels = std::collections::BTreeMap::new();
    for (k, channel) in recording.info().channels.iter().enumerate() {
        if channel.schema == "sensor_msgs/msg/Imu" {
            let made = writer.channel(&channel.topic, MessageKind::Imu);
            channels.insert(k, made.expect("a channel"));
        }
    }
    recording
        .messages(&|_| true, &mut |message| {
            if let Some(channel) = channels.get(&message.channel) {
                writer
                    .message(*channel, message.log_time_ns, message.data)
                    .expect("written");
            }
        })
        .expect("read");
    writer.finish().expect("written");
}

/// What takes the pictures.
fn camera() -> PathBuf {
    std::env::var_os("RERUN_PICTURE")
        .map(PathBuf::from)
        .expect("RERUN_PICTURE names a program that takes a picture of the viewer")
}

/// Titles of the views in a picture of `file` at the moment `at`; `None` where no picture can be taken here. A view of one colour
/// is an error.
fn views_drawn(tool: &Path, folder: &Path, file: &str, at: &str) -> Option<Vec<String>> {
    let picture = Command::new(tool)
        .current_dir(folder)
        .args([file, "picture.png", "--at", at, "--timeout", "300"])
        .output();
    let said = match picture {
        Ok(output) if output.status.success() => {
            String::from_utf8_lossy(&output.stdout).into_owned()
        }
        // 3 and 4 are verdicts on the picture; 1 is about the machine.
        Ok(output) if output.status.code() == Some(1) => {
            let why = String::from_utf8_lossy(&output.stderr);
            eprintln!("skipped: no picture could be taken: {why}");
            return None;
        }
        other => panic!("{file}: {other:?}"),
    };
    let (_, drawn) = said.split_once("views drawn: ").expect("the views' names");
    assert!(!drawn.contains("BLANK"), "{file}: {drawn}");
    let titles = drawn.split("; time: ").next().unwrap_or(drawn);
    Some(titles.split(" | ").map(str::to_owned).collect())
}

/// A recording that is opened without the bridge: the URDF on the frames of `/tf`, and plots of the motion.
#[test]
#[ignore = "needs a program that takes a picture of the viewer: see the head of the file"]
fn a_bare_recording_shows_bodies_and_plots() {
    let tool = camera();
    let folder = tempfile::tempdir().expect("a folder");
    good(run_in(
        folder.path(),
        "sim",
        &["record", "music", "--out", "music.mcap"],
    ));
    let Some(titles) = views_drawn(&tool, folder.path(), "music.mcap", "30.3") else {
        return;
    };
    for expected in [
        "/",
        "…/motion/position",
        "…/motion/velocity",
        "…/motion/effort",
    ] {
        assert!(
            titles.iter().any(|t| t == expected),
            "{expected}: {titles:?}"
        );
    }
    let Some(rerun) = on_path(&["rerun"]) else {
        eprintln!("skipped: there is no `rerun` on PATH");
        return;
    };
    let says = |args: &[&str]| {
        let mut command = Command::new(&rerun);
        let output = command.current_dir(folder.path()).args(args).output();
        let output = good(output.expect("the viewer starts"));
        String::from_utf8_lossy(&output.stdout).into_owned()
    };
    says(&["mcap", "convert", "music.mcap", "-o", "bare.rrd"]);
    says(&["rrd", "verify", "bare.rrd"]);
    let printed = says(&["rrd", "print", "bare.rrd"]);
    // An entity may come in several chunks.
    let rows = |entity: &str, column: &str| -> usize {
        let rows_of = |line: &str| -> Option<usize> {
            let (head, rest) = line.split_once(&format!(" - {entity} - "))?;
            rest.contains(column).then_some(())?;
            let (_, count) = head.split_once(" with ")?;
            count.split(' ').next()?.parse().ok()
        };
        printed.lines().filter_map(rows_of).sum()
    };
    // The body and two carriers; a minute at 30 Hz has 1801 samples.
    assert_eq!(rows("/tf", "Transform3D:translation"), 3 * 1801);
    for list in ["position", "velocity", "effort"] {
        assert_eq!(
            rows(&format!("/rath/motion/{list}"), "Scalars:scalars"),
            1801
        );
    }
    for body in ["rath", "carrier_1", "carrier_2"] {
        let entity = format!("/visual_geometries/{body}/visual_0");
        assert!(printed.contains(&entity), "{entity}");
    }
}

#[test]
#[ignore = "needs a program that takes a picture of the viewer: see the head of the file"]
fn the_viewer_shows_what_is_meant() {
    let tool = camera();
    let folder = tempfile::tempdir().expect("a folder");
    for case in CASES {
        let (mut mcap, rrd) = (
            format!("{}.mcap", case.scene),
            format!("{}.rrd", case.scene),
        );
        let command = |name: &str, args: &[&str]| good(run_in(folder.path(), name, args));
        command("sim", &["record", case.scene, "--out", &mcap]);
        if case.sensors_only {
            let sensors = "sensors.mcap".to_owned();
            sensors_of(&folder.path().join(&mcap), &folder.path().join(&sensors));
            mcap = sensors;
        }
        command("view", &[&mcap, "--save", &rrd]);

        let Some(titles) = views_drawn(&tool, folder.path(), &rrd, "time=30.3") else {
            return;
        };
        assert_eq!(titles.len(), case.views.len(), "{}: {titles:?}", case.scene);
        for (title, expected) in titles.iter().zip(case.views) {
            assert!(
                title.starts_with(expected),
                "{}: {title}, expected {expected}",
                case.scene
            );
        }

        let Some(rerun) = on_path(&["rerun"]) else {
            eprintln!("skipped: there is no `rerun` on PATH");
            return;
        };
        let says = |verb: &str| {
            let mut command = Command::new(&rerun);
            command.current_dir(folder.path()).args(["rrd", verb, &rrd]);
            let output = good(command.output().expect("the viewer starts"));
            String::from_utf8_lossy(&output.stdout).into_owned()
        };
        says("verify");
        let stats = says("stats");
        let printed = says("print");
        assert!(stats.contains("time"), "{stats}");
        assert!(!stats.contains("utc"), "a simulated run has no wall clock");
        for (entity, rows) in case.rows {
            let line = format!(" - {entity} - ");
            let rows = format!("with {rows} rows");
            assert!(
                printed
                    .lines()
                    .any(|l| l.contains(&line) && l.contains(&rows)),
                "{}: {entity} {rows}",
                case.scene
            );
        }
    }
}
