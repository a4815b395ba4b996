//! Logs of the published archive become recordings with every number in its place.

use std::path::PathBuf;

use recording::{
    import::npz,
    read::{ReadOptions, Recording},
    write::{RecordingWriter, WriterOptions},
};

///     RATH_ARCHIVE=FOLDER cargo test --release -p recording archive -- --ignored
#[test]
#[ignore = "needs the paper's archive, which is not shipped: RATH_ARCHIVE names its folder"]
fn an_archive_log_keeps_its_numbers() {
    let archive = std::env::var_os("RATH_ARCHIVE")
        .map(PathBuf::from)
        .expect("RATH_ARCHIVE names the folder of the archive, by an absolute path");
    let log = archive.join("music/seed_1001/logs.npz");
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("out.mcap");
    let mut writer = RecordingWriter::create(&path, &WriterOptions::default()).expect("begins");
    assert_eq!(npz::ingest(&log, &mut writer).expect("ingests"), 4 * 1819);
    writer.finish().expect("finishes");

    let recording = Recording::open(&path, &ReadOptions::default()).expect("opens");
    let info = recording.info();
    assert_eq!(
        (info.messages, info.salvaged, info.profile.as_str()),
        (7276, false, "")
    );
    assert_eq!(info.metadata["rath"]["seed"], "1001");
    assert_eq!(info.metadata["rath"]["scene"], "music");
    let (signals, findings) = recording.signals(&|_| true).expect("reads");
    assert_eq!(findings, []);
    let signal = |path: &str| {
        signals
            .iter()
            .find(|signal| signal.path == path)
            .unwrap_or_else(|| panic!("{path}"))
    };

    let z = signal("/rath/state.position_m.z");
    let t_s = z.times_s(info.start_ns);
    let steady: Vec<f64> = z
        .values
        .iter()
        .zip(&t_s)
        .filter(|(_, t)| **t >= 15.0)
        .map(|(z, _)| *z)
        .collect();
    assert_eq!(steady.len(), 1364);
    // stats.json: y_mean_m.
    let mean = steady.iter().sum::<f64>() / steady.len() as f64;
    assert!((mean - 0.8072736512516299).abs() < 1e-12, "{mean}");
    // stats.json: rms_roll_deg and rms_pitch_deg, whose 'pitch' is our yaw.
    for (path, expected) in [
        ("/rath/state.roll_rad", 19.368460680515074),
        ("/rath/state.yaw_rad", 0.539024333817163),
    ] {
        let squares: Vec<f64> = signal(path)
            .values
            .iter()
            .zip(&t_s)
            .filter(|(_, t)| **t >= 15.0)
            .map(|(angle, _)| angle * angle)
            .collect();
        let rms_deg = (squares.iter().sum::<f64>() / squares.len() as f64)
            .sqrt()
            .to_degrees();
        assert!(
            (rms_deg / expected - 1.0).abs() < 1e-12,
            "{path}: {rms_deg}"
        );
    }
    // Times are those of the archive, 33 ms apart, to the nanosecond.
    assert!(
        z.times_ns
            .iter()
            .enumerate()
            .all(|(i, t_ns)| *t_ns == 33_000_000 * i as i64)
    );
    assert_eq!(signal("/handles/forces.normal_n[1]").unit, "N");
    assert_eq!(
        signal("/tf.transforms[2].transform.translation.z")
            .values
            .len(),
        1819
    );
}
