//! What lands on disk: the same bytes for the same recording, whole or not at all, and good to Rerun's own tools.

mod common;

use std::process::Command;

use analyze::request::Request;
use recording::read::Recording;
use recording::write::{RecordingWriter, WriterOptions};
use view::load::{Detail, load, options};
use view::store::Encoded;

use common::{ROWS, Taken, imus, json_channel, rerun, run, taken, view};

#[test]
fn the_same_recording_gives_the_same_bytes() {
    let folder = tempfile::tempdir().unwrap();
    let mcap = folder.path().join("run.mcap");
    run(&mcap, 2);
    let bytes = || {
        let recording = Recording::open(&mcap, &options(&Request::default())).unwrap();
        let (take, _) = load("run", &recording, Detail::Thinned, &Request::default()).unwrap();
        let mut encoded = Encoded::stream(Vec::new()).unwrap();
        view::send(&mut encoded, "id", &take).unwrap();
        encoded.finish().unwrap()
    };
    assert!(bytes() == bytes());
    // So are the bytes of a file before its footer: those of the stream without the mark at its end.
    let files = ["a.rrd", "b.rrd"].map(|name| {
        let out = folder.path().join(name);
        let output = view(&[mcap.to_str().unwrap(), "--save", out.to_str().unwrap()]);
        assert!(output.status.success());
        std::fs::read(out).unwrap()
    });
    let same = files[0].iter().zip(&files[1]).take_while(|(a, b)| a == b);
    assert!(same.count() > bytes().len() - 100);
}

/// What `analyze` would say with an option of its own has none here.
#[test]
fn no_option_is_named_that_view_does_not_have() {
    let folder = tempfile::tempdir().unwrap();
    let mcap = folder.path().join("long.mcap");
    let mut writer = RecordingWriter::create(&mcap, &WriterOptions::default()).unwrap();
    let big = json_channel(&mut writer, "/big", "");
    for t_ns in [0, 1] {
        let list = format!("{{\"a\":{:?}}}", vec![1.5; 5000]);
        writer.message(big, t_ns, list.as_bytes()).unwrap();
    }
    writer.finish().unwrap();
    let rrd = folder.path().join("long.rrd");
    let output = view(&[mcap.to_str().unwrap(), "--save", rrd.to_str().unwrap()]);
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(
        said.contains("a has more than 4097 items (the limit) in 2 messages"),
        "{said}"
    );
}

#[test]
fn nothing_is_left_where_it_cannot_be_done() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    std::fs::write(path("not.mcap"), b"this is no recording").unwrap();
    std::fs::write(path("empty.mcap"), b"").unwrap();
    run(path("run.mcap").as_ref(), 2);
    let before: usize = std::fs::read_dir(folder.path()).unwrap().count();
    // Takes connections, and says nothing.
    let silent = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
    let silent = format!("rerun+http://{}/proxy", silent.local_addr().unwrap());
    // Closes each connection at once, unread.
    let closing = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
    let closed = format!("rerun+http://{}/proxy", closing.local_addr().unwrap());
    std::thread::spawn(move || closing.incoming().for_each(drop));
    for (arguments, words) in [
        (
            vec![path("none.mcap"), "--save".into(), path("out.rrd")],
            "none.mcap: cannot be read",
        ),
        (
            vec![path("not.mcap"), "--save".into(), path("out.rrd")],
            "not.mcap: is not an MCAP recording",
        ),
        (
            vec![path("empty.mcap"), "--save".into(), path("out.rrd")],
            "empty.mcap: is empty",
        ),
        (
            vec![path("run.mcap"), "--save".into(), path("no/folder.rrd")],
            "cannot be written",
        ),
        (
            vec![path("run.mcap"), "--save".into(), path("not.mcap")],
            "not.mcap: expected a name that ends in .rrd",
        ),
        (
            vec![path("run.mcap"), "--connect".into(), "nonsense".into()],
            "is no address of Rerun",
        ),
        (
            vec![
                path("run.mcap"),
                "--connect".into(),
                // A port that only the system's own services may use, and none does.
                "rerun+http://127.0.0.1:1/proxy".into(),
            ],
            "nobody answers there",
        ),
        (
            vec![path("run.mcap"), "--connect".into(), silent],
            "says nothing",
        ),
        // Which of the two ends of it is seen first is the system's choice.
        (
            vec![path("run.mcap"), "--connect".into(), closed],
            "nobody answers there",
        ),
    ] {
        let output = view(&arguments.iter().map(String::as_str).collect::<Vec<_>>());
        let said = String::from_utf8_lossy(&output.stderr).into_owned();
        let code = if words.contains("a name that ends") {
            2
        } else {
            1
        };
        assert_eq!(output.status.code(), Some(code), "{arguments:?}: {said}");
        assert!(said.contains(words), "{arguments:?}: {said}");
        assert_eq!(said.trim_end().lines().count(), 1, "{said}");
    }
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), before);
    assert_eq!(view(&[]).status.code(), Some(2));
    assert_eq!(view(&["x", "--web", "--save", "y"]).status.code(), Some(2));
}

#[test]
fn without_a_viewer_the_install_command_is_given() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.mcap");
    run(&path, 2);
    let output = Command::new(env!("CARGO_BIN_EXE_view"))
        .arg(&path)
        .env("PATH", folder.path())
        .output()
        .unwrap();
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(1));
    assert!(said.contains(view::viewer::INSTALL), "{said}");
    assert_eq!(said.trim_end().lines().count(), 1, "{said}");
    // What is wrong with the recording is said first.
    std::fs::write(&path, b"this is no recording").unwrap();
    for more in [&[][..], &["--connect", "rerun+http://127.0.0.1:1/proxy"]] {
        let output = Command::new(env!("CARGO_BIN_EXE_view"))
            .arg(&path)
            .args(more)
            .env("PATH", folder.path())
            .output()
            .unwrap();
        let said = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(said.contains("is not an MCAP recording"), "{said}");
    }
}

#[test]
fn a_damaged_recording_is_shown_as_far_as_it_goes() {
    let folder = tempfile::tempdir().unwrap();
    let (whole, cut, out) = (
        folder.path().join("run.mcap"),
        folder.path().join("cut.mcap"),
        folder.path().join("cut.rrd"),
    );
    run(&whole, 2);
    let bytes = std::fs::read(&whole).unwrap();
    std::fs::write(&cut, &bytes[..bytes.len() * 2 / 3]).unwrap();
    let output = view(&[cut.to_str().unwrap(), "--save", out.to_str().unwrap()]);
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(3), "{said}");
    assert!(!said.is_empty());
    assert!(out.is_file());
    let rows = taken(&cut).0.rows();
    assert!(rows["/plots/height/z"] > 10 && rows["/plots/height/z"] < ROWS);
}

/// A pipe that gives a few bytes at a time, slowly.
struct Slow(std::io::Cursor<Vec<u8>>);

impl std::io::Read for Slow {
    fn read(&mut self, buffer: &mut [u8]) -> std::io::Result<usize> {
        std::thread::sleep(std::time::Duration::from_millis(20));
        let most = buffer.len().min(9000);
        self.0.read(&mut buffer[..most])
    }
}

#[test]
fn what_comes_in_pieces_is_shown_once_and_whole() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.mcap");
    run(&path, 2);
    let (whole, _) = taken(&path);
    let mut live = Taken::default();
    let bytes = std::fs::read(&path).unwrap();
    view::live::follow(
        Slow(std::io::Cursor::new(bytes)),
        &mut live,
        &Request::default(),
    )
    .unwrap();
    let (mut a, mut b) = (live.rows(), whole.rows());
    // A level is drawn from the first to the last moment known, so it grows by a row with every piece.
    for rows in [&mut a, &mut b] {
        rows.retain(|entity, _| {
            !["unloaded", "chance"]
                .iter()
                .any(|level| entity.ends_with(level))
        });
    }
    assert_eq!(a, b);
    assert_eq!(
        live.scalars("/plots/angles/roll"),
        whole.scalars("/plots/angles/roll")
    );
    assert!(live.0.len() > whole.0.len(), "it came in one piece");
}

/// What is still to come changes an estimate at the end of what has come.
#[test]
fn estimates_of_what_grows_are_sent_when_they_are_settled() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("imu.mcap");
    imus(&path, 1, 60, 100);
    let (whole, _) = taken(&path);
    let mut live = Taken::default();
    let bytes = std::fs::read(&path).unwrap();
    view::live::follow(
        Slow(std::io::Cursor::new(bytes)),
        &mut live,
        &Request::default(),
    )
    .unwrap();
    assert!(live.0.len() > whole.0.len(), "it came in one piece");
    for (curve, off) in [("/plots/height/z", 1e-3), ("/plots/angles/roll", 0.02)] {
        let (live, whole) = (live.scalars(curve), whole.scalars(curve));
        assert_eq!(live.len(), whole.len(), "{curve}");
        for (a, b) in live.iter().zip(&whole) {
            assert_eq!((a.0, a.1.is_finite()), (b.0, b.1.is_finite()), "{curve}");
            assert!(!(a.1 - b.1).abs().gt(&off), "{curve}: {a:?}, {b:?}");
        }
    }
}

#[test]
fn what_was_measured_beside_an_estimate_is_sent_at_once() {
    let mut take = view::take::Take {
        state_ns: vec![0, 1, 2],
        height_ns: vec![0, 1, 2],
        force_ns: vec![0, 1, 2, 3],
        ..Default::default()
    };
    take.inputs.sources.attitude = "imu".into();
    take.inputs.roll_rad = vec![0.1; 3];
    take.inputs.normal_n = vec![vec![1.0; 4]];
    take.keep_settled(1);
    assert_eq!(take.state_ns, [0]);
    assert_eq!(take.height_ns, [0]);
    assert_eq!(take.inputs.roll_rad.len(), 1);
    assert_eq!(take.force_ns.len(), take.inputs.normal_n[0].len());
}

/// A scene with other settings is another recording.
#[test]
fn what_differs_has_another_id() {
    let folder = tempfile::tempdir().unwrap();
    let id = |name: &str, beat_hz: f64| {
        let path = folder.path().join(name);
        let mut writer = RecordingWriter::create(&path, &WriterOptions::default()).unwrap();
        let scene = format!("beat_hz = {beat_hz}");
        writer
            .attachment("scene.toml", "application/toml", scene.as_bytes())
            .unwrap();
        writer.finish().unwrap();
        view::recording_id(
            "music, seed 1",
            &Recording::open(&path, &options(&Request::default())).unwrap(),
        )
    };
    assert_eq!(id("a.mcap", 2.15), id("b.mcap", 2.15));
    assert_ne!(id("a.mcap", 2.15), id("b.mcap", 2.6));
}

#[test]
fn reruns_own_tools_agree() {
    let Some(rerun) = rerun() else { return };
    let folder = tempfile::tempdir().unwrap();
    for (kind, entity) in [
        ("run", "/plots/angles/roll"),
        ("imu", "/topics/imu/s0/gyro/x"),
    ] {
        let (mcap, rrd) = (
            folder.path().join(format!("{kind}.mcap")),
            folder.path().join(format!("{kind}.rrd")),
        );
        match kind {
            "run" => run(&mcap, 8),
            _ => imus(&mcap, 2, 10, 100),
        }
        let output = view(&[mcap.to_str().unwrap(), "--save", rrd.to_str().unwrap()]);
        assert!(
            output.status.success(),
            "{}",
            String::from_utf8_lossy(&output.stderr)
        );
        let tool = |arguments: &[&str]| {
            let output = Command::new(&rerun)
                .arg("rrd")
                .args(arguments)
                .arg(&rrd)
                .output()
                .unwrap();
            let said = format!(
                "{}{}",
                String::from_utf8_lossy(&output.stdout),
                String::from_utf8_lossy(&output.stderr)
            );
            assert!(output.status.success(), "{arguments:?}: {said}");
            said
        };
        tool(&["verify"]);
        let stats = tool(&["stats"]);
        assert!(stats.contains("time"), "{stats}");
        let printed = tool(&["print"]);
        let line = printed.lines().find(|line| {
            line.contains(&format!(" - {entity} - ")) && !line.contains("with 1 rows")
        });
        let rows = if kind == "run" { ROWS } else { 1000 };
        assert!(
            line.is_some_and(|line| line.contains(&format!("with {rows} rows"))),
            "{entity}: {line:?}"
        );
        for part in ["/viewport", "/time_panel", "/ViewContents"] {
            assert!(printed.contains(part), "{part}");
        }
    }
}

/// A log of somebody's own, in which nothing tells what is a roll.
#[test]
fn a_roles_file_and_a_window_hold_for_the_pictures() {
    let folder = tempfile::tempdir().unwrap();
    let [mcap, toml, rrd] = ["own.mcap", "roles.toml", "own.rrd"].map(|n| folder.path().join(n));
    let mut writer = RecordingWriter::create(&mcap, &WriterOptions::default()).unwrap();
    let own = json_channel(&mut writer, "/load", "");
    for k in 0..600_u32 {
        let angle = 0.2 * (0.3 * f64::from(k)).sin();
        let text = format!("{{\"items\":[{{\"name\":\"lean\",\"value\":{angle}}}]}}");
        let t_ns = 33_000_000 * i64::from(k);
        writer.message(own, t_ns, text.as_bytes()).unwrap();
    }
    writer.finish().unwrap();
    std::fs::write(
        &toml,
        "roll = \"/load.items[lean].value\"\nangle_unit = \"rad\"\n",
    )
    .unwrap();

    let asked = Request {
        roles: Some(analyze::roles::RolesFile::read(&toml).unwrap()),
        window: (Some(5.0), Some(15.0)),
        ..Request::default()
    };
    let recording = Recording::open(&mcap, &options(&asked)).unwrap();
    let (take, _) = load("own", &recording, Detail::Thinned, &asked).unwrap();
    assert_eq!(take.inputs.roll_rad.len(), 600);
    assert_eq!((take.window.start_s, take.window.end_s), (5.0, 15.0));
    let (bare, _) = load("own", &recording, Detail::Thinned, &Request::default()).unwrap();
    assert!(bare.inputs.roll_rad.is_empty());

    let [mcap, toml, rrd] = [&mcap, &toml, &rrd].map(|p| p.to_str().unwrap());
    let arguments = [mcap, "--roles", toml, "--window", "5..15", "--save", rrd];
    assert!(view(&arguments).status.success());
    std::fs::write(toml, "rol = \"/load.x\"\n").unwrap();
    let said = String::from_utf8(view(&arguments).stderr).unwrap();
    assert!(
        said.contains("roles.toml:1:1: is not a roles file: unknown field `rol`"),
        "{said}"
    );
    assert!(said.contains("Did you mean `roll`?"), "{said}");
}
