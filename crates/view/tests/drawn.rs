//! What is drawn of which recording: entities, timelines, rows, views.

mod common;

use analyze::request::Request;
use common::{ROWS, Taken, imus, imus_logged, json_channel, run, run_logged, taken};
use recording::cdr::{Header, Imu, TfMessage, Transform, TransformStamped};
use recording::read::Recording;
use recording::topics::MessageKind;
use recording::write::{RecordingWriter, WriterOptions};
use view::blueprint::{self, Play};
use view::load::{Detail, load, options};
use view::take::{Curve, Pose, Take, Topic};

#[test]
fn a_run_of_two_shows_everything() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.mcap");
    run(&path, 2);
    let (sent, titles) = taken(&path);
    let rows = sent.rows();
    for entity in [
        "/world/rath",
        "/world/follow",
        "/world/forces",
        "/world/handles",
        "/world/legs",
        "/world/carrier_1",
        "/world/carrier_2",
        "/phases/carriers",
        "/phases/order",
        "/plots/height/z",
        "/plots/angles/roll",
        "/plots/angles/tilt",
        "/plots/forces/all",
        "/plots/forces/handle_1",
        "/plots/forces/handle_2",
        "/plots/synchrony/r",
        "/plots/energy/kinetic",
        "/plots/energy/potential",
        "/plots/ledger/work_in",
    ] {
        assert_eq!(rows.get(entity), Some(&ROWS), "{entity}");
    }
    assert_eq!(rows["/world/trail"], ROWS - 1);
    // The beat sounds from 5 s on.
    assert_eq!(rows["/phases/beat"], ROWS - 150);
    assert_eq!(rows["/plots/forces/unloaded"], 2);
    assert_eq!(rows["/plots/synchrony/chance"], 2);
    assert!(rows["/events"] > 20, "{}", rows["/events"]);
    for entity in [
        "/spectra/rath/height",
        "/spectra/rath/roll",
        "/spectra/rath/lines",
        "/world/ground/plane",
        "/summary",
    ] {
        assert!(sent.entities().contains(entity), "{entity}");
    }
    // A simulated run has no wall-clock time.
    assert_eq!(sent.timelines().into_iter().collect::<Vec<_>>(), ["time"]);
    for word in [
        "Scene",
        "Phases, beat",
        "Spectra",
        "Height",
        "Roll",
        "N_tot",
        "Order parameter",
        "Energy",
        "Events",
        "Summary",
    ] {
        assert!(
            titles.iter().any(|title| title.contains(word)),
            "{word}: {titles:?}"
        );
    }
    let roll = sent.scalars("/plots/angles/roll");
    for (t_ns, deg) in roll {
        let expected = (0.3 * (std::f64::consts::TAU * t_ns as f64 / 1e9).sin()).to_degrees();
        assert!((deg - expected).abs() < 1e-9, "{t_ns}: {deg} {expected}");
    }
}

#[test]
fn there_may_be_any_number_of_carriers() {
    let folder = tempfile::tempdir().unwrap();
    // Of more than there are colours, and of more than the reader takes of others' lists.
    for carriers in [1, 3, 8, 17, 70] {
        let path = folder.path().join("run.mcap");
        run(&path, carriers);
        let (sent, _) = taken(&path);
        let rows = sent.rows();
        let has = |entity: &str| match rows.get(entity) {
            None => false,
            Some(&count) => count == ROWS,
        };
        let crowd = carriers > 8;
        for i in 1..=carriers {
            assert_eq!(has(&format!("/plots/forces/handle_{i}")), !crowd);
            assert_eq!(has(&format!("/world/carrier_{i}")), !crowd);
        }
        for entity in ["plots/forces/median", "world/torsos", "world/heads"] {
            assert_eq!(has(&format!("/{entity}")), crowd, "{carriers}: {entity}");
        }
        assert!(has("/world/legs"), "{carriers}");
        // One is in step with nobody, but may be with the beat.
        assert_eq!(has("/plots/synchrony/r"), carriers > 1, "{carriers}");
        assert!(has("/phases/order"), "{carriers}");
        assert!(!rows.contains_key(&format!("/world/carrier_{}", carriers + 1)));
    }
}

#[test]
fn sensors_alone_show_sensors_alone() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("imu.mcap");
    imus(&path, 2, 30, 100);
    let (sent, titles) = taken(&path);
    let rows = sent.rows();
    for sensor in ["s0", "s1"] {
        for axis in ["x", "y", "z"] {
            assert_eq!(
                rows.get(&format!("/topics/imu/{sensor}/gyro/{axis}")),
                Some(&3000)
            );
            assert_eq!(
                rows.get(&format!("/topics/imu/{sensor}/accel/{axis}")),
                Some(&3000)
            );
        }
    }
    // The first sensor is taken for that of the load, whose motion is estimated better elsewhere.
    assert_eq!(rows.get("/topics/imu/s1/attitude/roll"), Some(&3000));
    assert!(rows["/plots/angles/roll"] > 1000);
    let entities = sent.entities();
    assert!(entities.contains("/topics/imu/s0/accel_spectra/z"));
    // The body turns as the first sensor says; nobody and no force is made up beside it.
    assert!(rows["/world/rath"] > 1000);
    let known = [
        "/world/follow",
        "/world/ground",
        "/world/rath",
        "/world/trail",
    ];
    let made_up = entities.iter().filter(|e| e.starts_with("/world/"));
    let made_up: Vec<_> = made_up
        .filter(|e| !known.iter().any(|k| e.starts_with(k)))
        .collect();
    assert!(
        made_up.is_empty() && !entities.contains("/world/rath/poles"),
        "{made_up:?}"
    );
    let scene = "Scene: turned as inertial sensors say, on the spot";
    assert!(titles.iter().any(|t| t == scene), "{titles:?}");
    assert!(
        !titles.iter().any(|t| t.starts_with("Phases, beat")),
        "{titles:?}"
    );
    assert_eq!(
        sent.timelines().into_iter().collect::<Vec<_>>(),
        ["time", "utc"]
    );
}

/// A sensor without a rate has no attitude, no spectra, and no curve over a time that does not pass: that is said.
#[test]
fn a_sensor_of_one_moment_is_no_sensor() {
    let folder = tempfile::tempdir().unwrap();
    for messages in [1, 300] {
        let path = folder.path().join("imu.mcap");
        let mut writer = RecordingWriter::create(&path, &WriterOptions::default()).unwrap();
        let channel = writer.channel("/imu/s0", MessageKind::Imu).unwrap();
        for k in 0..messages {
            let imu = Imu::raw(7, "imu", [0.01 * f64::from(k), 0.0, 0.0], [0.0, 0.0, 9.81]);
            writer.message(channel, 7, &imu).unwrap();
        }
        writer.finish().unwrap();
        let (sent, _) = taken(&path);
        let entities = sent.entities();
        assert!(
            !entities.iter().any(|e| e.contains("attitude")),
            "{entities:?}"
        );
        let drawn = sent.rows();
        let curve = drawn.iter().find(|(e, _)| e.starts_with("/topics/imu/s0/"));
        assert_eq!(curve, None, "{drawn:?}");
        let recording = Recording::open(&path, &options(&Request::default())).unwrap();
        let (take, _) = load("imu", &recording, Detail::Thinned, &Request::default()).unwrap();
        let said = |note: &String| note.contains("/imu/s0: all 300 messages are of one moment");
        assert_eq!(
            take.notes.iter().any(said),
            messages > 1,
            "{:?}",
            take.notes
        );
    }
}

#[test]
fn what_is_estimated_from_the_sensor_on_the_load_is_drawn() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("imu.mcap");
    imus(&path, 1, 60, 100);
    let (sent, titles) = taken(&path);
    let rows = sent.rows();
    for entity in ["/plots/height/z", "/plots/angles/roll", "/plots/forces/all"] {
        assert!(
            rows.get(entity).is_some_and(|n| *n > 1000),
            "{entity}: {rows:?}"
        );
    }
    // One estimate of the roll is enough.
    assert!(!rows.contains_key("/topics/imu/s0/attitude/roll"));
    let spectra = titles.iter().find(|t| t.starts_with("Spectr")).unwrap();
    assert!(spectra.contains("height"), "{titles:?}");
}

#[test]
fn many_samples_are_thinned_to_their_extremes() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("imu.mcap");
    // 40 sensors of 12000 samples: more curves than can have all their points.
    imus(&path, 40, 24, 500);
    let (sent, _) = taken(&path);
    let z = sent.scalars("/topics/imu/s7/accel/z");
    assert!(z.len() < 4100 && z.len() > 3000, "{}", z.len());
    let (low, high) = z.iter().fold((f64::MAX, f64::MIN), |(l, h), (_, x)| {
        (l.min(*x), h.max(*x))
    });
    // The true extremes of the samples, 9.81 ± 1 up to the nearest sample of a period of 250: half a sample away.
    let near = (std::f64::consts::TAU / 500.0).cos() - 1e-12;
    assert!(low <= 9.81 - near && high >= 9.81 + near, "{low} {high}");
}

/// The logger writes what has come every 0.3 s.
fn in_bursts(t_ns: i64) -> i64 {
    const EVERY_NS: i64 = 300_000_000;
    (t_ns + EVERY_NS - 1) / EVERY_NS * EVERY_NS
}

#[test]
fn what_is_logged_in_bursts_is_drawn_when_it_was_taken() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.mcap");
    run_logged(&path, 2, in_bursts);
    let (sent, _) = taken(&path);
    for entity in [
        "/world/rath",
        "/world/carrier_2",
        "/world/forces",
        "/phases/carriers",
        "/plots/angles/roll",
        "/plots/energy/kinetic",
    ] {
        let times = sent.times_ns(entity);
        assert_eq!(times.len(), ROWS, "{entity}");
        for (k, t_ns) in times.iter().enumerate() {
            let taken_ns = k as i64 * 1_000_000_000 / 30;
            assert!((t_ns - taken_ns).abs() < 2_000, "{entity} {k}: {t_ns}");
        }
    }
    imus_logged(&path, 2, 30, 100, in_bursts);
    let (sent, _) = taken(&path);
    for entity in ["/topics/imu/s0/gyro/x", "/topics/imu/s1/attitude/roll"] {
        let times = sent.times_ns(entity);
        assert_eq!(times.len(), 3000, "{entity}");
        let uneven = times.windows(2).map(|w| (w[1] - w[0] - 10_000_000).abs());
        assert!(uneven.max().unwrap() < 2_000, "{entity}");
    }
    // The sine of 2 Hz that was measured, from the moment of a zero on.
    let rate = sent.scalars("/topics/imu/s1/gyro/x");
    let zero_ns = rate[0].0;
    for (t_ns, x) in rate {
        let t_s = (t_ns - zero_ns) as f64 / 1e9;
        let expected = 0.2 * (std::f64::consts::TAU * 2.0 * t_s).sin();
        assert!((x - expected).abs() < 1e-4, "{t_s}: {x} {expected}");
    }
}

#[test]
fn a_sensor_without_a_rate_is_named_too() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("imu.mcap");
    let mut writer = RecordingWriter::create(&path, &WriterOptions::default()).unwrap();
    let channel = writer.channel("/imu/s0", MessageKind::Imu).unwrap();
    for k in 0..300 {
        let t_ns = k * 10_000_000;
        let imu = Imu::raw(t_ns, "imu", [0.0; 3], [0.0, 0.0, 9.81 + 0.01 * k as f64]);
        writer.message(channel, t_ns, &imu).unwrap();
    }
    writer.finish().unwrap();
    let (_, titles) = taken(&path);
    let named = |title: &String| title.starts_with("/imu/s0 specific force");
    assert!(titles.iter().any(named), "{titles:?}");
}

#[test]
fn values_that_are_none_are_counted() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("arm.mcap");
    let mut writer = RecordingWriter::create(&path, &WriterOptions::default()).unwrap();
    let channel = json_channel(&mut writer, "/arm", "");
    for k in 0..1000 {
        let x = if (300..340).contains(&k) {
            "NaN"
        } else {
            "1.5"
        };
        let message = format!("{{\"x\": {x}}}");
        writer
            .message(channel, k * 10_000_000, message.as_bytes())
            .unwrap();
    }
    writer.finish().unwrap();
    let recording = Recording::open(&path, &options(&Request::default())).unwrap();
    let (take, _) = load("arm", &recording, Detail::Thinned, &Request::default()).unwrap();
    let expected = (
        Some(3.0),
        "/arm: 40 values of x are NaN or infinite, first at 3.000 s".to_owned(),
    );
    assert_eq!(take.remarks, [expected]);
}

/// A robot's transforms alone, which our own recordings repeat and others do not.
#[test]
fn transforms_without_a_state_are_curves() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("tf.mcap");
    let mut writer = RecordingWriter::create(&path, &WriterOptions::default()).unwrap();
    let channel = json_channel(&mut writer, "/tf", "foxglove.FrameTransform");
    for k in 0..100 {
        let message = format!("{{\"translation\":{{\"z\":{}}}}}", k % 7);
        writer
            .message(channel, k * 10_000_000, message.as_bytes())
            .unwrap();
    }
    writer.finish().unwrap();
    let (sent, _) = taken(&path);
    let curves = sent.rows().into_keys();
    assert!(curves.into_iter().any(|entity| entity.contains("/tf")));
}

/// Names that the viewer's tree cannot tell apart, and one that is called as another's second plot.
#[test]
fn topics_of_like_names_are_all_drawn() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("names.mcap");
    let mut writer = RecordingWriter::create(&path, &WriterOptions::default()).unwrap();
    let topics = [
        "/motor", "/motor/2", "a_b", "/a_b", "/a.b", "a.b", "/a//b", "a/b",
    ];
    for (i, topic) in topics.into_iter().enumerate() {
        let channel = json_channel(&mut writer, topic, "");
        for k in 0..20 {
            let message = format!("{{\"x\":{},\"y\":{k}}}", 1000 * (i + 1));
            writer
                .message(channel, k * 10_000_000, message.as_bytes())
                .unwrap();
        }
    }
    writer.finish().unwrap();
    let (sent, _) = taken(&path);
    let places: Vec<String> = (sent.rows().into_keys())
        .filter(|entity| entity.starts_with("/topics/"))
        .collect();
    for i in 0..topics.len() {
        let is = |entity: &&String| sent.scalars(entity)[0].1 as usize / 1000 == i + 1;
        let found: Vec<_> = places.iter().filter(is).collect();
        assert_eq!(found.len(), 1, "{}: {places:?}", topics[i]);
        assert_eq!(sent.scalars(found[0]).len(), 20);
    }
    assert!(
        places.contains(&"/topics/motor/f0".to_owned()),
        "{places:?}"
    );
}

/// Every other pair of messages is written in the wrong order, in bursts; the sine of 2 Hz that was measured is drawn.
#[test]
fn messages_that_overtake_each_other_are_drawn_when_they_were_taken() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("imu.mcap");
    let mut writer = RecordingWriter::create(&path, &WriterOptions::default()).unwrap();
    let channel = writer.channel("/imu/s0", MessageKind::Imu).unwrap();
    let sine = |t_ns: i64| 0.2 * (std::f64::consts::TAU * 2.0 * t_ns as f64 / 1e9).sin();
    for k in 0..3000 {
        let taken_ns = (if k % 4 < 2 { k ^ 1 } else { k }) * 10_000_000;
        let imu = Imu::raw(
            taken_ns,
            "imu",
            [sine(taken_ns), 0.0, 0.0],
            [0.0, 0.0, 9.81],
        );
        writer
            .message(channel, in_bursts(k * 10_000_000), &imu)
            .unwrap();
    }
    writer.finish().unwrap();
    let (sent, _) = taken(&path);
    let rate = sent.scalars("/topics/imu/s0/gyro/x");
    assert_eq!(rate.len(), 3000);
    for (k, (t_ns, x)) in rate.iter().enumerate() {
        assert!(
            (t_ns - rate[0].0 - k as i64 * 10_000_000).abs() < 2_000,
            "{k}"
        );
        assert!((x - sine(k as i64 * 10_000_000)).abs() < 1e-12, "{k}: {x}");
    }
}

#[test]
fn the_plots_of_a_sensor_show_no_other_topic() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("imu.mcap");
    let mut writer = RecordingWriter::create(&path, &WriterOptions::default()).unwrap();
    let imu = writer.channel("/imu", MessageKind::Imu).unwrap();
    let other = json_channel(&mut writer, "/imu/gyro", "");
    for k in 0..300 {
        let (t_ns, x) = (k * 10_000_000, (0.1 * k as f64).sin());
        let message = Imu::raw(t_ns, "imu", [x, 0.0, 0.0], [0.0, 0.0, 9.81]);
        writer.message(imu, t_ns, &message).unwrap();
        let text = format!("{{\"v_m\":{x}}}");
        writer.message(other, t_ns, text.as_bytes()).unwrap();
    }
    writer.finish().unwrap();
    let recording = Recording::open(&path, &options(&Request::default())).unwrap();
    let (take, _) = load("imu", &recording, Detail::Thinned, &Request::default()).unwrap();
    let mut sink = Taken::default();
    let sent = view::send_part(&mut sink, "id", &take, None).unwrap();
    blueprint::send(&mut sink, "views", &sent.layout, Play::Playing).unwrap();
    assert!(sink.entities().contains("/topics/imu/gyro/m/f0"));
    let gyro = ["x", "y", "z"].map(|axis| format!("/topics/imu/gyro/{axis}"));
    let queries = sink.queries();
    assert!(queries.iter().any(|query| *query == gyro), "{queries:?}");
}

/// An earlier message comes late, then it is no longer taken for the beginning.
#[test]
fn the_time_axis_stays_while_a_recording_grows() {
    let mut sink = Taken::default();
    let mut progress = None;
    for (k, start_ns) in [1000, 400, 2000].into_iter().enumerate() {
        let count = 2 * (k as i64 + 1);
        let curve = Curve {
            name: "x".into(),
            times_ns: (0..count).map(|k| 3000 + k).collect(),
            values: (0..count).map(|k| k as f64).collect(),
        };
        let take = Take {
            start_ns,
            end_ns: 4000,
            growing: true,
            topics: vec![Topic {
                name: "/x".into(),
                plots: vec![(String::new(), vec![curve])],
            }],
            ..Take::default()
        };
        let sent = view::send_part(&mut sink, "id", &take, progress).unwrap();
        progress = Some(sent.progress);
    }
    let times: Vec<i64> = sink
        .scalars("/topics/x/f0")
        .iter()
        .map(|(t, _)| *t)
        .collect();
    assert_eq!(times, [2000, 2001, 2002, 2003, 2004, 2005]);
}

/// Coordinates of a map, in which the viewer's numbers step by half a metre.
#[test]
fn what_is_far_away_is_drawn_about_where_it_began() {
    let mut sink = Taken::default();
    let mut progress = None;
    let place = |k: i64| {
        [
            500_000.25 + 0.02 * k as f64,
            5_400_000.6 + 0.01 * k as f64,
            1.0,
        ]
    };
    // In the second reading its first place is another.
    for (from, until) in [(0, 50), (40, 100)] {
        let take = Take {
            end_ns: 100,
            growing: true,
            pose: Some(Pose {
                times_ns: (from..until).collect(),
                position_m: (from..until).map(place).collect(),
                orientation: vec![[0.0, 0.0, 0.0, 1.0]; (until - from) as usize],
            }),
            ..Take::default()
        };
        let sent = view::send_part(&mut sink, "id", &take, progress).unwrap();
        progress = Some(sent.progress);
    }
    let drawn = sink.translations("/world/rath");
    assert_eq!(drawn.len(), 100);
    for (k, at) in drawn.iter().enumerate() {
        let [x, y] = [0.25 + 0.02 * k as f32, -0.4 + 0.01 * k as f32];
        assert!(
            (at[0] - x).abs() < 1e-5 && (at[1] - y).abs() < 1e-5,
            "{k}: {at:?}"
        );
    }
}

/// The first chunk holds three samples 100 ms apart, of a sensor that has 100 Hz.
#[test]
fn an_attitude_does_not_depend_on_how_a_file_is_cut() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("imu.mcap");
    let mut writer = RecordingWriter::create(&path, &WriterOptions::default()).unwrap();
    let channel = writer.channel("/imu/carrier_1", MessageKind::Imu).unwrap();
    let turn = std::f64::consts::TAU * 0.7;
    let roll_rad = |t_s: f64| 0.3 * (turn * t_s).sin();
    for k in 0..4000 {
        let t_ns = 10_000_000 * (10 * k.min(2) + (k - 2).max(0));
        let t_s = t_ns as f64 / 1e9;
        let (sin, cos) = roll_rad(t_s).sin_cos();
        let rate = [0.3 * turn * (turn * t_s).cos(), 0.0, 0.0];
        let imu = Imu::raw(t_ns, "imu", rate, [0.0, 9.81 * sin, 9.81 * cos]);
        writer.message(channel, t_ns, &imu).unwrap();
        if k == 2 {
            // A chunk ends before what is attached.
            writer
                .attachment("notes.txt", "text/plain", b"cut")
                .unwrap();
        }
    }
    writer.finish().unwrap();
    let (sent, _) = taken(&path);
    let roll = sent.scalars("/topics/imu/carrier_1/attitude/roll");
    let settled = roll.iter().filter(|(t_ns, _)| *t_ns > 10_000_000_000);
    assert!(settled.clone().count() > 2500);
    for (t_ns, deg) in settled {
        let off = deg - roll_rad(*t_ns as f64 / 1e9).to_degrees();
        assert!(off.abs() < 2.0, "{t_ns}: {deg}, off by {off}");
    }
}

/// A robot's frames are not.
#[test]
fn only_our_own_frames_are_people() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("robot.mcap");
    let mut writer = RecordingWriter::create(&path, &WriterOptions::default()).unwrap();
    let tf = writer.channel("/tf", MessageKind::Tf).unwrap();
    for k in 0..100 {
        let t_ns = k * 10_000_000;
        let frame = |parent: &str, child: &str| TransformStamped {
            header: Header {
                frame_id: parent.into(),
                ..Header::default()
            },
            child_frame_id: child.into(),
            transform: Transform {
                translation: [0.01 * k as f64, 0.0, 0.9].into(),
                ..Transform::default()
            },
        };
        let message = TfMessage {
            transforms: vec![
                frame("odom", "base_link"),
                frame("base_link", "lidar"),
                frame("base_link", "camera"),
            ],
        };
        writer.message(tf, t_ns, &message).unwrap();
    }
    writer.finish().unwrap();
    let read = |by_name: bool| {
        let options = recording::read::ReadOptions {
            by_name,
            ..options(&Request::default())
        };
        let recording = Recording::open(&path, &options).unwrap();
        load("tf", &recording, Detail::Thinned, &Request::default())
            .unwrap()
            .0
    };
    for by_name in [false, true] {
        let take = read(by_name);
        assert!(take.carriers.is_none());
        assert_eq!(take.topics[0].name, "/tf");
    }
    // Ours are people however their lists are read.
    run(&path, 3);
    for by_name in [false, true] {
        let carriers = read(by_name).carriers.unwrap();
        assert_eq!(carriers.points_m.len(), 3);
        assert_eq!(carriers.points_m[0][0], [-1.0, 0.4, 1.05]);
    }
}

#[test]
fn a_place_in_millimetres_is_drawn_in_metres() {
    let folder = tempfile::tempdir().unwrap();
    let [mcap, toml] = ["mm.mcap", "roles.toml"].map(|name| folder.path().join(name));
    let mut writer = RecordingWriter::create(&mcap, &WriterOptions::default()).unwrap();
    let channel = json_channel(&mut writer, "/m", "");
    for k in 0..300 {
        let lean = 0.1 * (0.1 * k as f64).sin();
        let text = format!(
            "{{\"position_mm\":{{\"x\":1500,\"y\":-2000,\"z\":1250}},\"roll_rad\":{lean},\"pitch_rad\":0.05}}"
        );
        writer
            .message(channel, k * 10_000_000, text.as_bytes())
            .unwrap();
    }
    writer.finish().unwrap();
    let roles = "height = \"/m.position_mm.z\"\nroll = \"/m.roll_rad\"\n";
    std::fs::write(&toml, roles).unwrap();
    let asked = Request {
        roles: Some(analyze::roles::RolesFile::read(&toml).unwrap()),
        ..Request::default()
    };
    let recording = Recording::open(&mcap, &options(&asked)).unwrap();
    let (take, _) = load("mm", &recording, Detail::Thinned, &asked).unwrap();
    assert_eq!(take.pose.unwrap().position_m[7], [1.5, -2.0, 1.25]);
}
