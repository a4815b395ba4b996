//! Logs of phones and inertial sensors become REP-145 messages: right units, signs, gravity and times, or a sentence that says why not.

#[path = "common/logs.rs"]
mod logs;

use std::{
    fs,
    path::{Path, PathBuf},
};

use logs::{Imported, file, folder, ingest, zipped};
use prost::Message as _;
use recording::{
    import::{self, ImportError, ImportOptions},
    read::{ReadOptions, Recording},
    schema::foxglove::RawAudio,
    write::{RecordingWriter, WriterOptions},
};

#[test]
fn phyphox_in_its_five_forms() {
    // As the app writes them: quoted names, numbers like 1.234567890E-2.
    let form = |text: &str, separator: &str, comma: bool| {
        let text = text.replace(';', separator);
        if comma { text.replace('.', ",") } else { text }
    };
    let accelerometer = "\"Time (s)\";\"Acceleration x (m/s^2)\";\"Acceleration y (m/s^2)\";\"Acceleration z (m/s^2)\"\n\
        1.000000000E-2;1.0E-1;-2.0E-1;9.810000000E0\n2.000000000E-2;2.0E-1;-2.5E-1;9.820000000E0\n\
        5.010000000E0;3.0E-1;-3.0E-1;9.830000000E0\n";
    let gyroscope = "\"Time (s)\";\"Gyroscope x (rad/s)\";\"Gyroscope y (rad/s)\";\"Gyroscope z (rad/s)\"\n\
        0.000000000E0;0.0E0;1.0E0;2.0E0\n2.000000000E-2;2.0E-1;1.0E0;2.0E0\n4.000000000E-2;4.0E-1;1.0E0;2.0E0\n";
    let time = "\"event\";\"experiment time\";\"system time\";\"system time text\"\n\
        \"START\";0.000000000E0;1700000000.500;\"2023-11-14 22:13:20.500 UTC\"\n\
        \"PAUSE\";1.000000000E0;1700000001.500;\"x\"\n\"START\";5.000000000E0;1700000100.000;\"y\"\n";
    for (separator, comma) in [
        (",", false),
        ("\t", false),
        (";", false),
        ("\t", true),
        (";", true),
    ] {
        let folder = folder();
        let path = zipped(
            folder.path(),
            "run 1.zip",
            &[
                ("Accelerometer.csv", form(accelerometer, separator, comma)),
                ("Gyroscope.csv", form(gyroscope, separator, comma)),
                ("meta/time.csv", form(time, separator, comma)),
                (
                    "meta/device.csv",
                    form(
                        "\"property\";\"value\"\n\"version\";\"1.1.0\"\n",
                        separator,
                        comma,
                    ),
                ),
            ],
        );
        let got = ingest(folder.path(), &[path], None).expect("ingests");
        assert_eq!(got.ingested.topics, [("/imu/run_1".to_owned(), 3)]);
        assert_eq!(
            got.values("/imu/run_1.linear_acceleration.z"),
            [9.81, 9.82, 9.83]
        );
        assert_eq!(
            got.values("/imu/run_1.linear_acceleration.y"),
            [-0.2, -0.25, -0.3]
        );
        // Between the gyroscope's samples, on one, and far from any.
        assert_eq!(got.values("/imu/run_1.angular_velocity.x"), [0.1, 0.2, 0.0]);
        assert_eq!(
            got.values("/imu/run_1.angular_velocity_covariance[0]"),
            [0.0, 0.0, -1.0]
        );
        assert_eq!(
            got.values("/imu/run_1.orientation_covariance[0]"),
            [-1.0; 3]
        );
        // Each sample counts from the START before it.
        let times = [
            1_700_000_000_510_000_000,
            1_700_000_000_520_000_000,
            1_700_000_100_010_000_000,
        ];
        assert!(
            got.times("/imu/run_1")
                .iter()
                .zip(times)
                .all(|(found, wanted)| (found - wanted).abs() < 1000),
            "{separator:?}"
        );
        assert!(
            got.ingested.notes[0].contains("interpolated linearly"),
            "{:?}",
            got.ingested.notes
        );
    }
}

#[test]
fn sensor_logger_signs_and_gravity() {
    let head = "time,seconds_elapsed,z,y,x\n";
    let rows = |z: f64| {
        format!("{head}1700000000000000001,0.1,{z},0.2,0.1\n1700000000010000001,0.11,{z},0.2,0.1\n")
    };
    let metadata = |platform: &str, standard: &str| {
        format!("version,device name,platform,standardisation\n3,phone,{platform},{standard}\n")
    };
    for (platform, standard, sign) in [
        ("android", "false", 1.0),
        ("ios", "false", -1.0),
        ("ios", "true", 1.0),
    ] {
        let folder = folder();
        let path = folder.path().join("walk");
        file(&path, "Accelerometer.csv", &rows(0.5));
        file(&path, "Gravity.csv", &rows(9.0));
        file(&path, "Gyroscope.csv", &rows(0.3));
        file(&path, "Metadata.csv", &metadata(platform, standard));
        let got = ingest(folder.path(), &[path], None).expect("ingests");
        assert_eq!(
            got.values("/imu/walk.linear_acceleration.z"),
            [9.5 * sign; 2],
            "{platform} {standard}"
        );
        assert_eq!(got.values("/imu/walk.angular_velocity.z"), [0.3; 2]);
        // All digits of the nanoseconds are kept.
        assert_eq!(got.times("/imu/walk")[0], 1_700_000_000_000_000_001);
    }
    let folder = folder();
    let files = [
        ("AccelerometerUncalibrated.csv", rows(-1.0)),
        ("Metadata.csv", metadata("ios", "false")),
    ];
    let got = ingest(
        folder.path(),
        &[zipped(folder.path(), "g.zip", &files)],
        None,
    )
    .expect("ingests");
    assert!((got.values("/imu/g.linear_acceleration.z")[0] - 9.80665).abs() < 1e-12);
}

#[test]
fn sensor_logger_rows_out_of_order_and_cut() {
    let head = "time,seconds_elapsed,z,y,x\n";
    let row = |k: u64| {
        format!(
            "{},{},{k},0,0\n",
            1_700_000_000_000_000_000 + k * 10_000_000,
            k
        )
    };
    let rows = |order: &[u64]| head.to_owned() + &order.iter().map(|k| row(*k)).collect::<String>();
    let order: Vec<u64> = (0..40).collect();
    let mixed: Vec<u64> = (0..10).chain(20..30).chain(10..20).chain(30..40).collect();
    let folder = folder();
    let path = folder.path().join("walk");
    file(&path, "TotalAcceleration.csv", &rows(&order));
    // The last row ends inside its time.
    file(&path, "Gyroscope.csv", &(rows(&mixed) + "17000000"));
    let got = ingest(folder.path(), &[path], None).expect("ingests");
    let expected: Vec<f64> = (0..40).map(f64::from).collect();
    assert_eq!(got.values("/imu/walk.angular_velocity.z"), expected);
    assert_eq!(got.times("/imu/walk")[0], 1_700_000_000_000_000_000);
    let notes = got.ingested.notes.join("; ");
    assert!(
        notes.contains("steps back once") && notes.contains("cut off"),
        "{notes}"
    );
}

#[test]
fn sensor_logger_times_that_are_none() {
    let head = "time,seconds_elapsed,z,y,x\n";
    let rows = |unit: u64, without: u64| {
        let row = |k: u64| {
            let time = match k == without {
                true => String::new(),
                false => ((1_700_000_000_000 + 10 * k) * unit).to_string(),
            };
            format!("{time},{},{k},0,0\n", 0.01 * k as f64)
        };
        head.to_owned() + &(0..40).map(row).collect::<String>()
    };
    let folder = folder();
    let path = folder.path().join("walk");
    file(&path, "TotalAcceleration.csv", &rows(1_000_000, 7));
    let got = ingest(folder.path(), std::slice::from_ref(&path), None).expect("ingests");
    let z = got.values("/imu/walk.linear_acceleration.z");
    assert_eq!(z.len(), 39);
    assert_eq!(got.times("/imu/walk")[0], 1_700_000_000_000_000_000);
    let notes = got.ingested.notes.join("; ");
    assert!(
        notes.contains("1 row has no time and is left out"),
        "{notes}"
    );
    // Milliseconds and microseconds.
    for unit in [1, 1000] {
        file(&path, "TotalAcceleration.csv", &rows(unit, 99));
        let why = ingest(folder.path(), std::slice::from_ref(&path), None)
            .err()
            .expect("refuses");
        assert!(why.to_string().contains("not in nanoseconds"), "{why}");
    }
}

#[test]
fn movella_dot_wraps_and_turns_free_acceleration() {
    let folder = folder();
    // Upside down: a half turn about x; in free fall minus gravity, at rest, and moving up with 1 m/s².
    let text = "DeviceTag:,left\nFirmwareVersion:,2.0.0\n\nPacketCounter,SampleTimeFine,Quat_W,Quat_X,Quat_Y,Quat_Z,FreeAcc_X,FreeAcc_Y,FreeAcc_Z,Gyr_X,Gyr_Y,Gyr_Z\n\
        1,4294950629,0,1,0,0,0,0,0,180,0,0\n2,0,0,1,0,0,0,0,1,90,0,0\n3,16667,0.7071067811865476,0,0.7071067811865476,0,0,0,0,0,0,0\n";
    let got = ingest(
        folder.path(),
        &[file(folder.path(), "left.csv", text)],
        None,
    )
    .expect("ingests");
    assert_eq!(
        got.times("/imu/left"),
        [4_294_950_629_000, 4_294_967_296_000, 4_294_983_963_000]
    );
    let z = got.values("/imu/left.linear_acceleration.z");
    assert!(
        (z[0] + 9.80665).abs() < 1e-12 && (z[1] + 10.80665).abs() < 1e-12 && z[2].abs() < 1e-12,
        "{z:?}"
    );
    // A quarter turn about y takes the sensor's x down: up is −x.
    assert!((got.values("/imu/left.linear_acceleration.x")[2] + 9.80665).abs() < 1e-12);
    assert!((got.values("/imu/left.angular_velocity.x")[0] - std::f64::consts::PI).abs() < 1e-15);
    assert_eq!(got.values("/imu/left.orientation.x"), [1.0, 1.0, 0.0]);
    assert_eq!(
        got.ingested
            .notes
            .iter()
            .map(|note| note.rsplit(": ").next().unwrap_or_default())
            .collect::<Vec<_>>(),
        [
            "angular velocities were in deg/s",
            "the specific force was computed from FreeAcc and the orientation",
            "SampleTimeFine wrapped 1 time"
        ]
    );
}

#[test]
fn the_rate_that_is_told_tells_what_sample_time_fine_counts() {
    let folder = folder();
    let log = |rate: &str, step: u32| {
        let rows = (0..5).map(|i| format!("{i},{},0,0,9.8,1,0,0\n", 100 + i * step));
        let text = format!(
            "// General information:\n//  MT Manager version: 2022.0\n{rate}PacketCounter,SampleTimeFine,Acc_X,Acc_Y,Acc_Z,Gyr_X,Gyr_Y,Gyr_Z\n{}",
            rows.collect::<String>()
        );
        let path = file(folder.path(), "mti.csv", &text);
        ingest(folder.path(), &[path], None)
    };
    let rate = "// Update Rate: 100.0Hz\n";
    for (rate, step, tick_ns, noted) in [
        (rate, 100, 100_000, true),
        (rate, 10_000, 1_000, false),
        ("", 100, 1_000, false),
    ] {
        let got = log(rate, step).expect("ingests");
        let times = got.times("/imu/mti");
        assert_eq!(times[0], 100 * tick_ns);
        assert_eq!(times[4] - times[0], 4 * i64::from(step) * tick_ns);
        assert_eq!(got.values("/imu/mti.angular_velocity.x"), [1.0; 5]);
        let note =
            "SampleTimeFine counts 1/10,000 s: its usual step is 100 at an update rate of 100 Hz";
        let notes = &got.ingested.notes;
        assert_eq!(notes.iter().any(|n| n.ends_with(note)), noted, "{notes:?}");
    }
    let error = log(rate, 130).err().expect("refused").to_string();
    assert!(
        error.ends_with("mti.csv: has a usual step of SampleTimeFine of 130 at an update rate of 100 Hz; expected about 100 (1/10,000 s) or 10000 (microseconds)"),
        "{error}"
    );
}

#[test]
fn a_last_row_that_was_cut_off_is_left_out_and_told() {
    let folder = folder();
    let dot =
        "PacketCounter,SampleTimeFine,Acc_X,Acc_Y,Acc_Z\n1,5,0,0,9.8\n\n2,10005,0,0,9.8\n3,200";
    let layout = "[time]\ncolumn = \"t\"\nunit = \"s\"\n[acceleration]\ncolumns = [\"x\", \"y\", \"z\"]\nunit = \"g\"\n";
    let layout = file(folder.path(), "layout.toml", layout);
    // The last name is of no column: all rows are as short.
    let plain = "t,x,y,z,\n1,0,0,1\n2,0,0,1\n3,0,0\n";
    for (name, text, layout, note) in [
        (
            "dot",
            dot,
            None,
            "line 5, the last, has 2 of 5 cells: it was cut off and is left out",
        ),
        (
            "plain",
            plain,
            layout.to_str(),
            "line 4, the last, has 3 of 4 cells: it was cut off and is left out",
        ),
        ("whole", &plain[..24], layout.to_str(), ""),
    ] {
        let path = file(folder.path(), &format!("{name}.csv"), text);
        let got = ingest(folder.path(), std::slice::from_ref(&path), layout).expect("ingests");
        assert_eq!(got.ingested.topics, [(format!("/imu/{name}"), 2)]);
        let told = format!("{}: {note}", path.display());
        let expected = if note.is_empty() { vec![] } else { vec![told] };
        assert_eq!(got.ingested.notes, expected);
    }
    let head = "time,seconds_elapsed,z,y,x\n1700000000000000001,0.1,9.8,0,0\n";
    let files = [(
        "TotalAcceleration.csv",
        format!("{head}1700000000010000001,0.11,9."),
    )];
    let path = zipped(folder.path(), "walk.zip", &files);
    let got = ingest(folder.path(), &[path], None).expect("ingests");
    assert_eq!(got.ingested.topics, [("/imu/walk".to_owned(), 1)]);
    let note =
        "TotalAcceleration.csv: line 3, the last, has 3 of 5 cells: it was cut off and is left out";
    assert!(got.ingested.notes.iter().any(|n| n.ends_with(note)));
}

/// Two motions are not put between each other.
#[test]
fn a_log_that_begins_anew_is_refused() {
    let folder = folder();
    let layout = "[time]\ncolumn = \"t\"\nunit = \"s\"\n[acceleration]\ncolumns = [\"x\", \"y\", \"z\"]\nunit = \"g\"\n";
    let layout = file(folder.path(), "layout.toml", layout);
    let rows = |from: &str| -> String {
        let again = (0..200).map(|k| format!("{},0,0,1\n", f64::from(k) / 100.0));
        let late = "1.5,0,0,1\n1.49,0,0,1\n".to_owned();
        let rows: String = again.collect();
        match from {
            "late" => format!("t,x,y,z\n{rows}2.0,0,0,1\n{late}2.01,0,0,1\n"),
            _ => format!("t,x,y,z\n{rows}{rows}"),
        }
    };
    let path = file(folder.path(), "late.csv", &rows("late"));
    let got = ingest(folder.path(), &[path], layout.to_str()).expect("ingests");
    assert_eq!(got.ingested.topics, [("/imu/late".to_owned(), 204)]);
    let path = file(folder.path(), "twice.csv", &rows("twice"));
    let refused = ingest(folder.path(), &[path], layout.to_str());
    let said = refused.err().expect("is refused").to_string();
    assert!(
        said.contains("step back by 1.990 s, 1.990 s behind the first"),
        "{said}"
    );
}

#[test]
fn a_device_without_a_date_beside_one_with_is_told() {
    let folder = folder();
    let dot =
        "PacketCounter,SampleTimeFine,Acc_X,Acc_Y,Acc_Z,Gyr_X,Gyr_Y,Gyr_Z\n1,5,0,0,9.8,0,0,0\n";
    let dot = file(folder.path(), "dot.csv", dot);
    let acceleration = "Time (s),Acceleration x (m/s^2),Acceleration y (m/s^2),Acceleration z (m/s^2)\n0.5,0,0,9.8\n";
    let start = "event,experiment time,system time\nSTART,0.0,1700000000.5\n";
    let phone = zipped(
        folder.path(),
        "phone.zip",
        &[
            ("Accelerometer.csv", acceleration.to_owned()),
            ("meta/time.csv", start.to_owned()),
        ],
    );
    let told = |paths: &[PathBuf]| {
        let got = ingest(folder.path(), paths, None).expect("ingests");
        let notes = got.ingested.notes.into_iter();
        notes
            .filter(|note| note.contains("1970"))
            .collect::<Vec<_>>()
    };
    assert_eq!(
        told(&[dot.clone(), phone]),
        [
            "dot: its times count from the device's start, not from 1970 as those of others here: the clocks are not on each other"
        ]
    );
    assert!(told(&[dot]).is_empty());
}

#[test]
fn several_devices_by_layout() {
    let folder = folder();
    let text = "Time (s),Gyroscope X (deg/s),Gyroscope Y (deg/s),Gyroscope Z (deg/s),Accelerometer X (g),Accelerometer Y (g),Accelerometer Z (g)\n\
        0.5,90,0,0,0,0,1\n1.0,0,0,0,0,0,1\n";
    let paths = [
        file(folder.path(), "a/imu.csv", text),
        file(folder.path(), "b/imu.csv", text),
    ];
    let got = ingest(folder.path(), &paths, Some("x-io")).expect("ingests");
    assert_eq!(got.values("/imu/imu.linear_acceleration.z"), [9.80665; 2]);
    assert!(
        (got.values("/imu/imu_2.angular_velocity.x")[0] - std::f64::consts::FRAC_PI_2).abs()
            < 1e-15
    );
    assert_eq!(got.recording.info().metadata["rath"]["source"], "field");

    let layout = "device = \"belt\"\n[time]\ncolumn = \"t\"\nunit = \"us\"\nstart_s = 100\n\
        [acceleration]\ncolumns = [\"ax\", \"ay\", \"az\"]\nunit = \"m/s^2\"\nsign = -1\n";
    let layout = file(folder.path(), "layout.toml", layout);
    let log = file(folder.path(), "log.csv", "t;ax;ay;az\n1000;1,5;2;-9,81\n");
    let got = ingest(folder.path(), &[log], layout.to_str()).expect("ingests");
    assert_eq!(got.times("/imu/belt"), [100_001_000_000]);
    assert_eq!(got.values("/imu/belt.linear_acceleration.z"), [9.81]);
}

#[test]
fn units_of_a_layout_are_read_as_people_spell_them() {
    let folder = folder();
    let log = file(
        folder.path(),
        "log.csv",
        "t,ax,ay,az,gx,gy,gz\n1,0,0,9.81,180,0,0\n",
    );
    let read = |force: &str, rate: &str| {
        let text = format!(
            "[time]\ncolumn = \"t\"\nunit = \"s\"\n\
            [acceleration]\ncolumns = [\"ax\", \"ay\", \"az\"]\nunit = \"{force}\"\n\
            [angular_velocity]\ncolumns = [\"gx\", \"gy\", \"gz\"]\nunit = \"{rate}\"\n"
        );
        let layout = file(folder.path(), "layout.toml", &text);
        ingest(folder.path(), std::slice::from_ref(&log), layout.to_str())
    };
    for force in ["m/s^2", "m/s²", "m/s2"] {
        for rate in ["deg/s", "°/s", "dps"] {
            let got = read(force, rate).unwrap_or_else(|e| panic!("{force} {rate}: {e}"));
            assert_eq!(got.values("/imu/log.linear_acceleration.z"), [9.81]);
            assert_eq!(
                got.values("/imu/log.angular_velocity.x"),
                [std::f64::consts::PI]
            );
        }
    }
    let error = read("m/s^2", "rpm").err().expect("refused").to_string();
    assert!(
        error.ends_with("the layout has the unit \"rpm\"; expected rad/s or deg/s"),
        "{error}"
    );
}

/// As the app writes it where a comma is the decimal sign: an empty line first, the minus of typography, the last value held between samples.
#[test]
fn physics_toolbox_holds_each_sensor_between_its_samples() {
    let folder = folder();
    let mut text = "\ntime;gFx;gFy;gFz;wx;wy;wz;Gain\n".to_owned();
    // A row each 4 ms; a new acceleration each second row, a new angular velocity each fourth.
    for row in 0..80 {
        let (force, rate) = (row / 2 * 2, row / 4 * 4);
        text += &format!(
            "0,{:03};0,{:03};\u{2212}0,5;0,8;0;\u{2212}0,{:03};0;\u{2212}\u{221e}\n",
            4 * row,
            force,
            rate
        );
    }
    let path = file(folder.path(), "ptb.csv", &text);
    let got = ingest(folder.path(), &[path], None).expect("ingests");
    let times: Vec<i64> = (0..40).map(|k| k * 8_000_000).collect();
    assert_eq!(got.times("/imu/ptb"), times);
    let close = |a: f64, b: f64| (a - b).abs() < 1e-12;
    for (k, x) in got
        .values("/imu/ptb.linear_acceleration.x")
        .iter()
        .enumerate()
    {
        assert!(close(*x, 9.80665 * 2e-3 * k as f64), "{k}: {x}");
    }
    assert!(
        got.values("/imu/ptb.linear_acceleration.y")
            .iter()
            .all(|y| close(*y, -9.80665 * 0.5))
    );
    // A ramp of the angular velocity comes back as one, not as stairs; after its last sample it is not known.
    let rates = got.values("/imu/ptb.angular_velocity.y");
    for (k, x) in rates[..39].iter().enumerate() {
        assert!(close(*x, -2e-3 * k as f64), "{k}: {x}");
    }
    let covariance = got.values("/imu/ptb.angular_velocity_covariance[0]");
    assert_eq!((covariance[38], covariance[39]), (0.0, -1.0));
    let held = |what| got.ingested.notes.iter().any(|note| note.contains(what));
    assert!(
        held("40 of 80 rows repeat the acceleration")
            && held("60 of 80 rows repeat the angular velocity")
    );
}

/// A sensor of few digits that hardly moves repeats itself too, now short, now long.
#[test]
fn a_coarse_sensor_at_rest_keeps_its_samples() {
    let folder = folder();
    let mut text = "time,gFx,gFy,gFz\n".to_owned();
    for row in 0..400 {
        let drift = (f64::from(row) / 60.0).sin();
        text += &format!("{:.2},{:.1},0.0,1.0\n", f64::from(row) * 0.01, drift);
    }
    let got = ingest(
        folder.path(),
        &[file(folder.path(), "old.csv", &text)],
        None,
    )
    .expect("ingests");
    assert_eq!(got.times("/imu/old").len(), 400);
}

#[test]
fn times_may_be_dates_or_clocks_and_text_of_another_encoding() {
    let folder = folder();
    let dated = "time,gFx,gFy,gFz,gFTotal\n2018-10-03 17:23:55.4640,0,0,1,1\n2018-10-03 17:23:55.4650,0,0,2,2\n";
    let path = file(folder.path(), "sensor.csv", dated);
    let got = ingest(folder.path(), std::slice::from_ref(&path), None).expect("ingests");
    let first = 1_538_587_435_464_000_000;
    assert_eq!(got.times("/imu/sensor"), [first, first + 1_000_000]);
    assert_eq!(
        got.values("/imu/sensor.linear_acceleration.z"),
        [9.80665, 2.0 * 9.80665]
    );
    // What a spreadsheet calls Unicode text.
    let wide: Vec<u8> = [0xfeff]
        .into_iter()
        .chain(dated.replace(',', "\t").encode_utf16())
        .flat_map(u16::to_le_bytes)
        .collect();
    fs::write(&path, wide).expect("writes");
    let got = ingest(folder.path(), &[path], None).expect("ingests");
    assert_eq!(got.times("/imu/sensor"), [first, first + 1_000_000]);
    // Latin-1.
    let layout = "[time]\ncolumn = \"Uhr\"\nunit = \"s\"\n[acceleration]\ncolumns = [\"x (m/s²)\", \"y (m/s²)\", \"z (m/s²)\"]\nunit = \"m/s^2\"\n";
    let layout = file(folder.path(), "layout.toml", layout);
    let path = folder.path().join("uhr.csv");
    let text =
        b"Uhr;x (m/s\xb2);y (m/s\xb2);z (m/s\xb2)\n23:59:59:500;1;2;9,8\n0:00:00:500;3;4;9,7\n";
    fs::write(&path, text).expect("writes");
    let got = ingest(folder.path(), &[path], layout.to_str()).expect("ingests");
    let midnight = 86_400_000_000_000;
    assert_eq!(
        got.times("/imu/uhr"),
        [midnight - 500_000_000, midnight + 500_000_000]
    );
    assert_eq!(got.values("/imu/uhr.linear_acceleration.z"), [9.8, 9.7]);
}

#[test]
fn phone_apps_and_sensors_by_their_columns() {
    let folder = folder();
    let read = |paths: &[PathBuf]| ingest(folder.path(), paths, None).expect("ingests");
    // Apple's sign; the time of day of a zone.
    for rate in ["gyroRotation", "motionRotationRate"] {
        let text = format!(
            "loggingTime(txt),loggingSample(N),accelerometerAccelerationX(G),accelerometerAccelerationY(G),accelerometerAccelerationZ(G),\
             {rate}X(rad/s),{rate}Y(rad/s),{rate}Z(rad/s)\n2018-10-03 19:23:55.464 +0200,1,0,0,-1,0.5,0,0\n"
        );
        let got = read(&[file(folder.path(), "watch.csv", &text)]);
        assert_eq!(got.times("/imu/watch"), [1_538_587_435_464_000_000]);
        assert_eq!(got.values("/imu/watch.linear_acceleration.z"), [9.80665]);
        assert_eq!(got.values("/imu/watch.angular_velocity.x"), [0.5]);
    }
    let text = b"LIGHT (lux);ACCELEROMETER X (m/s\xb2);ACCELEROMETER Y (m/s\xb2);ACCELEROMETER Z (m/s\xb2);Time since start in ms ;YYYY-MO-DD HH-MI-SS_SSS\n\
        3;0.5;0;9.8;20;2018-10-03 17:23:55:464\n";
    let path = folder.path().join("phone.csv");
    fs::write(&path, text).expect("writes");
    let got = read(&[path]);
    assert_eq!(got.times("/imu/phone"), [20_000_000]);
    assert_eq!(got.values("/imu/phone.linear_acceleration.x"), [0.5]);
    // Two tables of one device; those of two are refused.
    let table = |unit: &str, x: f64| {
        format!(
            "epoc (ms),timestamp (+0100),elapsed (s),x-axis ({unit}),y-axis ({unit}),z-axis ({unit})\n1538587435464,2018-10-03T18:23:55.464,0,{x},0,0\n"
        )
    };
    let [force, rate] = [
        ("Accelerometer.csv", table("g", 2.0)),
        ("Gyroscope.csv", table("deg/s", 90.0)),
    ];
    let device = zipped(folder.path(), "left.zip", &[force.clone(), rate.clone()]);
    let got = read(&[device]);
    assert_eq!(got.times("/imu/left"), [1_538_587_435_464_000_000]);
    assert_eq!(
        got.values("/imu/left.linear_acceleration.x"),
        [2.0 * 9.80665]
    );
    assert_eq!(
        got.values("/imu/left.angular_velocity.x"),
        [std::f64::consts::FRAC_PI_2]
    );
    let two = zipped(
        folder.path(),
        "two.zip",
        &[force.clone(), rate, ("Right.csv", force.1)],
    );
    let refused = ingest(folder.path(), &[two], None)
        .err()
        .expect("refused")
        .to_string();
    assert!(
        refused.contains("two files with x-axis (g), Accelerometer.csv and Right.csv"),
        "{refused}"
    );
}

#[test]
fn shimmer_units_clocks_and_the_accelerometer_that_is_not_at_its_end() {
    let folder = folder();
    let text = |low_noise: f64| {
        format!(
            "\"sep=,\"\nbelt_Timestamp_Unix_CAL,belt_TimestampSync_Unix_CAL,belt_Accel_LN_X_CAL,belt_Accel_LN_Y_CAL,belt_Accel_LN_Z_CAL,\
             belt_Accel_WR_X_CAL,belt_Accel_WR_Y_CAL,belt_Accel_WR_Z_CAL,belt_Gyro_X_CAL,belt_Gyro_Y_CAL,belt_Gyro_Z_CAL,\n\
             ms,ms,m/(s^2),m/(s^2),m/(s^2),m/(s^2),m/(s^2),m/(s^2),deg/s,deg/s,deg/s,\n\
             5,1700000000000.5,0,0,9.8,0,0,9.5,90,0,0,\n\
             15,1700000000010.5,0,0,{low_noise},0,0,9.6,0,0,0,\n"
        )
    };
    let z = |low_noise| {
        let path = file(folder.path(), "belt.csv", &text(low_noise));
        let got = ingest(folder.path(), &[path], None).expect("ingests");
        let start = 1_700_000_000_000_500_000;
        for (t_ns, expected) in got
            .times("/imu/belt")
            .iter()
            .zip([start, start + 10_000_000])
        {
            // Milliseconds since 1970 have no more digits.
            assert!((t_ns - expected).abs() < 300, "{t_ns}");
        }
        let turn = got.values("/imu/belt.angular_velocity.x")[0];
        assert!((turn - std::f64::consts::FRAC_PI_2).abs() < 1e-15);
        (
            got.values("/imu/belt.linear_acceleration.z").to_vec(),
            got.ingested.notes.join(" "),
        )
    };
    assert_eq!(z(9.9), (vec![9.8, 9.9], String::new()));
    let (wide, notes) = z(19.6);
    assert_eq!(wide, [9.5, 9.6]);
    assert!(notes.contains("came to its end at 2 g"), "{notes}");
}

#[test]
fn what_is_missing_or_odd_is_named() {
    let folder = folder();
    let error = |name: &str, text: &str, layout: Option<&str>| {
        let path = file(folder.path(), name, text);
        let error = ingest(folder.path(), &[path], layout)
            .err()
            .expect("refused")
            .to_string();
        assert!(
            !folder.path().join("out.mcap").exists(),
            "nothing is left half-written"
        );
        error.replace(&format!("{}/", folder.path().display()), "")
    };
    assert_eq!(
        error("a.csv", "foo,bar\n1,2\n", None),
        "a.csv: is no log of Sensor Logger, phyphox, Movella DOT / Xsens, Shimmer, MetaBase, x-io, x-imu3, physics-toolbox, sensorlog, sensorlog-motion, androsensor, Axivity, and no layout is given; found \"foo,bar\""
    );
    assert_eq!(
        error("b.csv", "Time (s),gyro\n1,2\n", Some("x-io")),
        "b.csv: lacks the columns Accelerometer X (g), Accelerometer Y (g), Accelerometer Z (g); found Time (s), gyro"
    );
    assert_eq!(
        error(
            "c.csv",
            "PacketCounter,SampleTimeFine,Acc_X,Acc_Y,Acc_Z\n1,0,0,x,9.8\n",
            None
        ),
        "c.csv: line 2, column \"Acc_Y\": found \"x\", expected a number"
    );
    assert_eq!(
        error(
            "c.csv",
            "PacketCounter,SampleTimeFine,Acc_X,Acc_Y,Acc_Z\n1,-5,0,0,9.8\n",
            None
        ),
        "c.csv: line 2 has SampleTimeFine -5; expected a count below 2^32"
    );
    // What people take for a log.
    assert_eq!(
        error("run.bag", "#ROSBAG V2.0\n", None),
        "run.bag: is a ROS 1 bag; `mcap convert` makes a recording of it"
    );
    let mut writer =
        RecordingWriter::create(&folder.path().join("a.mcap"), &WriterOptions::default()).unwrap();
    writer
        .channel("/a", recording::topics::MessageKind::Float64)
        .unwrap();
    writer.finish().unwrap();
    let already = ingest(folder.path(), &[folder.path().join("a.mcap")], None);
    let already = already.err().expect("refused").to_string();
    assert!(
        already.ends_with("a.mcap: is a recording (MCAP) already; `analyze` reads it as it is"),
        "{already}"
    );
    let book = zipped(
        folder.path(),
        "book.xlsx",
        &[("xl/workbook.xml", String::new())],
    );
    let book = ingest(folder.path(), &[book], None)
        .err()
        .expect("refused")
        .to_string();
    assert!(
        book.ends_with("book.xlsx: is a table of Excel; export CSV instead"),
        "{book}"
    );
    // A stray quote takes the lines after it into the header's last name.
    let quoted = format!("SampleTimeFine,\"Acc_X\n{}", "1,2\n".repeat(99));
    let said = error("q.csv", &quoted, None);
    assert!(said.lines().count() == 1 && said.len() < 200, "{said}");
    assert_eq!(error("d.csv", "", None), "d.csv: is empty; expected a log");
    let twice = vec![folder.path().join("d.csv"); 2];
    let twice = ingest(folder.path(), &twice, None).err().expect("refused");
    assert!(
        twice
            .to_string()
            .ends_with("d.csv: is given twice; expected each log once")
    );
    assert_eq!(
        error("e.csv", "a\n1\n", Some("nothing")),
        "nothing: is neither a file nor a built-in layout; built in are x-io, x-imu3, physics-toolbox, sensorlog, sensorlog-motion, androsensor"
    );
    assert_eq!(
        error(
            "f.csv",
            "PacketCounter,SampleTimeFine,Acc_X,Acc_Y,Acc_Z\n",
            None
        ),
        "f.csv: has a header but no rows; expected at least one sample"
    );
    assert!(
        error("g.npz", "PK\u{3}\u{4}nonsense", None)
            .starts_with("g.npz: is not a NumPy archive (.npz): ")
    );
}

/// A WAV file of `format` (1 whole numbers, 3 floating point).
fn wav(format: u16, channels: u16, rate: u32, bits: u16, data: &[u8]) -> Vec<u8> {
    let frame = channels * bits.div_ceil(8);
    [
        &b"RIFF"[..],
        &(36 + data.len() as u32).to_le_bytes(),
        b"WAVEfmt ",
        &16u32.to_le_bytes(),
        &format.to_le_bytes(),
        &channels.to_le_bytes(),
        &rate.to_le_bytes(),
        &(rate * u32::from(frame)).to_le_bytes(),
        &frame.to_le_bytes(),
        &bits.to_le_bytes(),
        b"data",
        &(data.len() as u32).to_le_bytes(),
        data,
    ]
    .concat()
}

/// Log time, rate, channels and samples of each message of sound.
fn sound(recording: &Recording) -> Vec<(i64, u32, u32, Vec<i16>)> {
    let mut out = Vec::new();
    recording
        .messages(&|topic| topic.starts_with("/audio/"), &mut |message| {
            let audio = RawAudio::decode(message.data).expect("decodes");
            assert_eq!(audio.format, "pcm-s16");
            let samples = audio.data.chunks_exact(2);
            out.push((
                message.log_time_ns,
                audio.sample_rate,
                audio.number_of_channels,
                samples.map(|b| i16::from_le_bytes([b[0], b[1]])).collect(),
            ));
        })
        .expect("reads");
    out
}

#[test]
fn sound_of_every_width_becomes_the_same_samples() {
    let samples: Vec<i16> = (0..1000).map(|k| (k * 37 % 2000 - 1000) * 32).collect();
    let bytes =
        |of: &dyn Fn(i16) -> Vec<u8>| samples.iter().flat_map(|s| of(*s)).collect::<Vec<u8>>();
    let made = [
        wav(1, 2, 4000, 16, &bytes(&|s| s.to_le_bytes().to_vec())),
        wav(
            1,
            2,
            4000,
            24,
            &bytes(&|s| [vec![0], s.to_le_bytes().to_vec()].concat()),
        ),
        wav(
            1,
            2,
            4000,
            32,
            &bytes(&|s| (i32::from(s) << 16).to_le_bytes().to_vec()),
        ),
        wav(
            3,
            2,
            4000,
            32,
            &bytes(&|s| (f32::from(s) / 32767.0).to_le_bytes().to_vec()),
        ),
    ];
    // 24 bits with an extension of no bytes, as many recorders write them.
    let extended = [
        &made[1][..16],
        &[18],
        &made[1][17..36],
        &[0; 2],
        &made[1][36..],
    ]
    .concat();
    // Two heads, of which the second counts, with the 40 bytes of an extensible format.
    let extensible = [
        &b"fmt \x28\0\0\0\xfe\xff"[..],
        &made[0][22..36],
        b"\x16\0\x10\0\0\0\0\0\x01\0\0\0\0\0\x10\0\x80\0\0\xaa\0\x38\x9b\x71",
    ]
    .concat();
    let twice = [&made[0][..12], &extensible, &extensible, &made[0][36..]].concat();
    // 24 of 32 bits are said to be meant: the highest.
    let mut highest = [&made[2][..12], &extensible, &made[2][36..]].concat();
    highest[22..36].copy_from_slice(&made[2][22..36]);
    highest[38] = 24;
    for bytes in made.into_iter().chain([extended, twice, highest]) {
        let folder = folder();
        let path = folder.path().join("drum 1.wav");
        fs::write(&path, &bytes).expect("writes");
        let got = ingest(folder.path(), &[path], None).expect("ingests");
        let found = sound(&got.recording);
        assert_eq!(got.ingested.topics, [("/audio/drum_1".to_owned(), 2)]);
        // 400 frames of two channels in a tenth of a second.
        assert_eq!(found[0].3.len(), 800);
        assert_eq!((found[1].0, found[1].1, found[1].2), (100_000_000, 4000, 2));
        assert_eq!([&found[0].3[..], &found[1].3].concat(), samples);
    }
}

#[test]
fn sound_stands_where_it_is_said_to_begin_and_its_loss_is_said() {
    let folder = folder();
    let text = "device = \"belt\"\n[time]\ncolumn = \"t\"\nunit = \"s\"\nstart_s = 100\n\
        [acceleration]\ncolumns = [\"x\", \"y\", \"z\"]\nunit = \"m/s^2\"\n";
    let layout = file(folder.path(), "layout.toml", text);
    let log = file(folder.path(), "log.csv", "t,x,y,z\n0,0,0,9.8\n1,0,0,9.8\n");
    // A recorder that lost its power: the head says four seconds, one is there.
    let mut bytes = wav(1, 1, 8000, 16, &[1; 64_000]);
    bytes.truncate(44 + 16_000);
    let path = folder.path().join("drum.wav");
    fs::write(&path, &bytes).expect("writes");
    let out = folder.path().join("walk.mcap");
    let mut writer = RecordingWriter::create(&out, &WriterOptions::default()).expect("begins");
    let options = ImportOptions {
        layout: layout.to_str(),
        sound_start_s: 0.25,
    };
    let ingested = import::ingest(&[log, path], &options, &mut writer).expect("ingests");
    writer.finish().expect("finishes");
    let recording = Recording::open(&out, &ReadOptions::default()).expect("opens");
    let found = sound(&recording);
    assert_eq!(found.len(), 10);
    assert_eq!(found[0].0, 100_250_000_000);
    assert!(
        ingested.notes.iter().any(|n| n.contains("0.25 s after")),
        "{:?}",
        ingested.notes
    );
    assert_eq!(
        ingested.losses,
        ["drum: its head promises 4.0 s of sound, 1.0 s are there"]
    );

    let error = |name: &str, bytes: &[u8]| {
        let path = folder.path().join(name);
        fs::write(&path, bytes).expect("writes");
        let error = ingest(folder.path(), &[path], None).err().expect("refused");
        error
            .to_string()
            .replace(&format!("{}/", folder.path().display()), "")
    };
    assert_eq!(
        error("a.m4a", b"...."),
        "a.m4a: is m4a; sound is read from WAV: make one with `ffmpeg -i a.m4a -ac 1 a.wav`"
    );
    for bytes in [&b"RIFF...."[..], b"RF64....WAVE", b"RIFF....WAVE", b""] {
        assert!(error("a.wav", bytes).starts_with("a.wav: is no WAV file: "));
    }
    // A head that is at odds with itself.
    let mut odd = wav(1, 1, 8000, 16, &[1; 8]);
    odd[32] = 4;
    for (bytes, found) in [
        (
            wav(1, 0, 8000, 16, &[1; 8]),
            "0 channels, frames of 0 bytes, 8000 Hz, 0 bytes a second",
        ),
        (
            odd,
            "1 channels, frames of 4 bytes, 8000 Hz, 16000 bytes a second",
        ),
    ] {
        let said = error("b.wav", &bytes);
        assert!(
            said.starts_with("b.wav: holds 16-bit sound of format 0x0001: Ill-formed WAVE file: "),
            "{said}"
        );
        let found = format!("; found {found}, which do not agree");
        assert!(said.ends_with(&found), "{said}");
    }
    for (bytes, found) in [
        (wav(7, 1, 8000, 8, &[1; 8]), "8-bit sound of format 0x0007"),
        (
            wav(3, 1, 8000, 64, &[1; 8]),
            "64-bit sound of format 0x0003",
        ),
    ] {
        let said = error("b.wav", &bytes);
        assert!(
            said.starts_with(&format!("b.wav: holds {found}: ")),
            "{said}"
        );
        let expected = "; expected PCM (0x0001) of 8 to 32 bits or floating point (0x0003) of 32";
        assert!(said.ends_with(expected), "{said}");
    }
    let said = error("b.wav", &wav(1, 1, 0, 16, &[1; 8]));
    assert!(said.starts_with("b.wav: has 1 channels at 0 Hz"), "{said}");
    // Empty, and with a chunk behind.
    let listed = [wav(1, 1, 8000, 16, &[]), b"LIST\x04\0\0\0INFO".to_vec()].concat();
    for bytes in [&listed[..44], &listed] {
        assert_eq!(
            error("b.wav", bytes),
            "b.wav: has a head but no sound; expected at least one sample"
        );
    }
}

/// Recorders write the length of the sound when they end, if they do.
#[test]
fn sound_whose_head_does_not_tell_its_length_is_all_that_follows() {
    let folder = folder();
    let samples: Vec<u8> = (0..8000i16).flat_map(i16::to_le_bytes).collect();
    let whole = wav(1, 1, 8000, 16, &samples);
    let read = |told: u32, behind: &[u8]| {
        let mut bytes = whole.clone();
        bytes[40..44].copy_from_slice(&told.to_le_bytes());
        bytes.extend(behind);
        let path = folder.path().join("drum.wav");
        fs::write(&path, bytes).expect("writes");
        let got = ingest(folder.path(), &[path], None).expect("ingests");
        let found: Vec<i16> = sound(&got.recording)
            .into_iter()
            .flat_map(|m| m.3)
            .collect();
        assert!(found.iter().copied().eq(0..found.len() as i16), "{told:#x}");
        let told = |of: &[String]| {
            of.join("; ")
                .replace(&format!("{}/", folder.path().display()), "")
        };
        (
            found.len(),
            told(&got.ingested.notes),
            told(&got.ingested.losses),
        )
    };
    let none = String::new;
    for told in [0, 0x7fff_f000, 0xffff_ff00, u32::MAX] {
        let note =
            "drum.wav: its head does not tell how long the sound is: the 1.0 s behind it are taken";
        assert_eq!(read(told, &[]), (8000, note.to_owned(), none()));
    }
    let list = b"LIST\x05\0\0\0INFO.\0id3 \x02\0\0\0ab";
    for behind in [&b""[..], list, b"LIST\x01\0\0\0aid3 \x01\0\0\0b", &[0; 64]] {
        assert_eq!(read(16_000, behind), (8000, none(), none()));
    }
    // Half of the sound is accounted for, with a chunk after it or without.
    let loss = |bytes: u32| {
        format!(
            "drum: its head promises 0.5 s of sound; {bytes} bytes behind it belong to no chunk and are left out"
        )
    };
    assert_eq!(read(8_000, &[]), (4000, none(), loss(8_000)));
    assert_eq!(read(8_000, list), (4000, none(), loss(8_024)));
}

#[test]
fn what_is_missing_is_missing_however_it_is_written() {
    let folder = folder();
    let log = folder.path().join("belt.csv");
    let head = "Time (s),Acceleration x (m/s^2),Acceleration y (m/s^2),Acceleration z (m/s^2)";
    fs::write(
        &log,
        format!("{head}\n0,1,2,9.8\n\n0.01,null,NaN,NA\n0.02,n/a,,None\n0.03,1,2,9.8\n"),
    )
    .unwrap();
    let got = ingest(folder.path(), std::slice::from_ref(&log), None).unwrap();
    for axis in ["x", "y", "z"] {
        let path = format!("/imu/belt.linear_acceleration.{axis}");
        let signal = got.signals.iter().find(|s| s.path == path).unwrap();
        let none: Vec<bool> = signal.values.iter().map(|v| v.is_nan()).collect();
        assert_eq!(none, [false, true, true, false], "{axis}");
    }
    // The line is that of the file: empty ones count.
    fs::write(&log, format!("{head}\n0,1,2,9.8\n\n\n0.01,1,high,3\n")).unwrap();
    let error = ingest(folder.path(), std::slice::from_ref(&log), None).err();
    let error = error.unwrap().to_string();
    assert!(error.contains("line 5, column \"Acceleration y"), "{error}");
    fs::write(&log, format!("{head}\n")).unwrap();
    let error = ingest(folder.path(), &[log], None).err().unwrap();
    let error = error.to_string();
    assert!(error.contains("has a header but no rows"), "{error}");
}

#[test]
fn halves_of_a_device_are_told() {
    let folder = folder();
    let paths = ["Acceleration", "Gyroscope"].map(|sensor| {
        let unit = if sensor == "Gyroscope" {
            "rad/s"
        } else {
            "m/s^2"
        };
        let head = ["x", "y", "z"].map(|axis| format!("{sensor} {axis} ({unit})"));
        let path = folder.path().join(format!("{sensor}.csv"));
        let text = format!("Time (s),{}\n0,1,2,3\n0.01,1,2,3\n", head.join(","));
        fs::write(&path, text).unwrap();
        path
    });
    let told = |paths: &[PathBuf]| {
        let got = ingest(folder.path(), paths, None).unwrap();
        let mut notes = got.ingested.notes.into_iter();
        notes.find(|note| note.contains("zip or the folder"))
    };
    let note = told(&paths).expect("a note");
    assert!(
        note.starts_with("Gyroscope has no acceleration and Acceleration no angular"),
        "{note}"
    );
    // One phone that only counts steps beside a whole one is no half.
    assert_eq!(told(&paths[..1]), None);
    assert_eq!(told(&[folder.path().to_owned()]), None);
}

/// An AX6 and an AX3 write no header; what is dated like them and is not in g is none of theirs.
#[test]
fn exports_of_axivity_have_no_header() {
    let folder = folder();
    let row = |k: usize, rest: &str| {
        format!(
            "2025-11-24 16:00:{:02}.{:03},{rest}\n",
            k / 100,
            k % 100 * 10
        )
    };
    let rows = |rest: &str| (0..300).map(|k| row(k, rest)).collect::<String>();
    let ax6 = file(
        folder.path(),
        "carrier_1.csv",
        &rows("0.1,-0.2,0.97,90.0,-45.0,0.5"),
    );
    let found = ingest(folder.path(), &[ax6], None).unwrap();
    assert_eq!(found.ingested.topics, [("/imu/carrier_1".to_owned(), 300)]);
    let first = |field: &str| found.values(&format!("/imu/carrier_1.{field}"))[0];
    assert!((first("linear_acceleration.z") - 0.97 * 9.80665).abs() < 1e-12);
    assert!((first("angular_velocity.x") - std::f64::consts::FRAC_PI_2).abs() < 1e-12);
    // `date -u -d "2025-11-24 16:00:00" +%s`
    assert_eq!(first("header.stamp.sec"), 1_764_000_000.0);
    let ax3 = file(folder.path(), "ax3.csv", &rows("0.1,-0.2,0.97"));
    let found = ingest(folder.path(), &[ax3], None).unwrap();
    assert_eq!(
        found.values("/imu/ax3.angular_velocity_covariance[0]")[0],
        -1.0
    );
    let si = file(folder.path(), "si.csv", &rows("0.1,-0.2,9.7"));
    let said = ingest(folder.path(), &[si], None)
        .err()
        .unwrap()
        .to_string();
    assert!(said.ends_with("as a rule; expected 1 g"), "{said}");
    let bad = rows("0.1,-0.2,0.97")
        .replacen(",-0.2", ",x", 3)
        .replacen(",x", ",-0.2", 2);
    let bad = file(folder.path(), "bad.csv", &bad);
    let said = ingest(folder.path(), &[bad], None)
        .err()
        .unwrap()
        .to_string();
    assert!(said.contains("line 3, column \"ay\""), "{said}");
}

/// Newer versions of AndroSensor name the gyroscope's columns after turns of the phone that say nothing of its axes.
#[test]
fn columns_whose_axes_nobody_knows_are_told_of() {
    let folder = folder();
    let head = "ACCELEROMETER X (m/s²);ACCELEROMETER Y (m/s²);ACCELEROMETER Z (m/s²);GYROSCOPE Yaw (rad/s);GYROSCOPE Pitch (rad/s);GYROSCOPE Roll (rad/s);Time since start in ms ";
    let rows: String = (0..100)
        .map(|k| format!("0.{k};0;9.8;0.1;0.2;0.3;{}\n", 10 * k))
        .collect();
    let log = file(folder.path(), "rath.csv", &format!("{head}\n{rows}"));
    let found = ingest(folder.path(), &[log], None).unwrap();
    let told = &found.ingested.notes[0];
    assert!(
        told.contains("it has no GYROSCOPE X (rad/s), ") && told.contains("GYROSCOPE Yaw (rad/s), GYROSCOPE Pitch (rad/s), GYROSCOPE Roll (rad/s) are left out"),
        "{told}"
    );
}

#[test]
fn an_x_imu3_counts_microseconds() {
    let folder = folder();
    let head = "Timestamp (us),Gyroscope X (deg/s),Gyroscope Y (deg/s),Gyroscope Z (deg/s),Accelerometer X (g),Accelerometer Y (g),Accelerometer Z (g)";
    let rows: String = (0..100)
        .map(|k| format!("{},180.0,0.0,{k}.0,0.0,0.0,1.0\n", 2500 * k))
        .collect();
    let log = file(folder.path(), "Inertial.csv", &format!("{head}\n{rows}"));
    let found = ingest(folder.path(), &[log], None).unwrap();
    let values = |field: &str| found.values(&format!("/imu/Inertial.{field}"))[99];
    assert!((values("angular_velocity.x") - std::f64::consts::PI).abs() < 1e-12);
    assert!((values("linear_acceleration.z") - 9.80665).abs() < 1e-12);
    assert_eq!(values("header.stamp.nanosec"), 247_500_000.0);
}

/// Nothing in a folder or zip is dropped without a word: a topic each, or a sentence.
#[test]
fn a_folder_of_several_devices_gives_each_a_topic() {
    let folder = folder();
    let read = |paths: &[PathBuf], layout: Option<&str>| ingest(folder.path(), paths, layout);
    let dot = |k: usize| {
        format!(
            "PacketCounter,SampleTimeFine,Acc_X,Acc_Y,Acc_Z,Gyr_X,Gyr_Y,Gyr_Z\n1,5,0,0,{k},180,0,0\n"
        )
    };
    let x_io = "Time (s),Gyroscope X (deg/s),Gyroscope Y (deg/s),Gyroscope Z (deg/s),Accelerometer X (g),Accelerometer Y (g),Accelerometer Z (g)\n0.5,90,0,0,0,0,1\n";
    let axivity = "2025-11-24 16:00:00.000,0.1,-0.2,0.97\n";
    let shimmer =
        "a_Timestamp_Unix_CAL,a_Accel_LN_X_CAL,a_Accel_LN_Y_CAL,a_Accel_LN_Z_CAL\n5,0,0,9.8\n";
    let dots = zipped(
        folder.path(),
        "dots.zip",
        &[
            ("__MACOSX/._D1.csv", "\0\x05\x16\x07".to_owned()),
            ("D1.csv", dot(1)),
            ("drum.wav", String::new()),
            ("notes.txt", "a windy day\n".to_owned()),
            ("right/D2.csv", dot(2)),
        ],
    );
    let got = read(&[dots], None).expect("ingests");
    let topics = |of: &[&str]| -> Vec<_> { of.iter().map(|t| (format!("/imu/{t}"), 1)).collect() };
    assert_eq!(got.ingested.topics, topics(&["D1", "D2"]));
    assert_eq!(got.values("/imu/D2.linear_acceleration.z"), [2.0]);
    let notes = got.ingested.notes.iter();
    let notes: Vec<_> = notes
        .map(|n| n.rsplit("dots.zip: ").next().unwrap())
        .collect();
    assert_eq!(
        notes,
        [
            "D1.csv: angular velocities were in deg/s",
            "of no kind that is known, and left out: notes.txt",
            "right/D2.csv: angular velocities were in deg/s",
            "drum.wav is left out: sound is given as a file of its own",
        ]
    );
    // Of several kinds.
    let mixed = folder.path().join("mixed");
    for (name, text) in [
        ("a.csv", x_io),
        ("b.csv", axivity),
        ("c.csv", shimmer),
        ("d.csv", &dot(1)),
    ] {
        file(&mixed, name, text);
    }
    let got = read(std::slice::from_ref(&mixed), None).expect("ingests");
    assert_eq!(got.ingested.topics, topics(&["a", "b", "c", "d"]));
    // A phone beside them is called as the folder.
    let phone = "Time (s),Acceleration x (m/s^2),Acceleration y (m/s^2),Acceleration z (m/s^2)\n0.5,0,0,9.8\n";
    file(&mixed, "Accelerometer.csv", phone);
    let got = read(&[mixed], None).expect("ingests");
    assert_eq!(got.ingested.topics, topics(&["mixed", "a", "b", "c", "d"]));
    // What the phone's app writes beside its tables is its own, what others write is not.
    let beside = [
        ("Accelerometer.csv", phone.to_owned()),
        ("meta/device.csv", "property,value\n".to_owned()),
        ("d.csv", dot(1)),
        ("other/e.csv", "t,ax,ay,az\n1,2,3,4\n".to_owned()),
    ];
    let got = read(&[zipped(folder.path(), "mix.zip", &beside)], None).expect("ingests");
    assert_eq!(got.ingested.topics, topics(&["mix", "d"]));
    let told = |got: &Imported, what: &str| got.ingested.notes.iter().any(|n| n.ends_with(what));
    assert!(
        told(&got, "known, and left out: other/e.csv"),
        "{:?}",
        got.ingested.notes
    );
    // One that has no rows is no reason to refuse the others.
    let empty = dot(1).lines().take(1).collect();
    let head = shimmer.lines().take(1).collect();
    let files = [("a.csv", empty), ("b.csv", dot(1)), ("c.csv", head)];
    let got = read(&[zipped(folder.path(), "one.zip", &files)], None).expect("ingests");
    assert_eq!(got.ingested.topics, topics(&["b"]));
    for empty in ["a.csv", "c.csv"] {
        let note = format!("{empty}: has a header but no rows, and is left out");
        assert!(told(&got, &note), "{:?}", got.ingested.notes);
    }
    // A file that cannot be read is named with the zip that it is in.
    let files = [("a/d.csv", dot(1).replace(",5,", ",x,")), ("b.csv", dot(1))];
    let refused = read(&[zipped(folder.path(), "bad.zip", &files)], None);
    let refused = refused.err().expect("refused").to_string();
    assert!(
        refused.contains("bad.zip: a/d.csv: line 2, column"),
        "{refused}"
    );

    let laid = folder.path().join("laid");
    file(&laid, "a.csv", x_io);
    file(&laid, "b.csv", x_io);
    let got = read(std::slice::from_ref(&laid), Some("x-io")).expect("ingests");
    assert_eq!(got.ingested.topics, topics(&["a", "b"]));
    // What the layout does not fit, by whole names, is left out beside what it fits, and else says what it lacks.
    let means = x_io.replace("(g)", "(g) mean");
    file(&laid, "c.csv", &means);
    let got = read(std::slice::from_ref(&laid), Some("x-io")).expect("ingests");
    assert_eq!(got.ingested.topics, topics(&["a", "b"]));
    let told = got
        .ingested
        .notes
        .iter()
        .any(|n| n.ends_with("left out: c.csv"));
    assert!(told, "{:?}", got.ingested.notes);
    for fits in ["a.csv", "b.csv"] {
        fs::remove_file(laid.join(fits)).expect("removes");
    }
    let refused = read(std::slice::from_ref(&laid), Some("x-io"))
        .err()
        .expect("refused");
    assert!(
        refused.to_string().contains("lacks the columns"),
        "{refused}"
    );
    fs::remove_dir_all(&laid).expect("removes");
    fs::create_dir(&laid).expect("makes");
    for layout in [None, Some("x-io")] {
        let refused = read(std::slice::from_ref(&laid), layout)
            .err()
            .expect("refused");
        assert!(
            refused
                .to_string()
                .ends_with("laid: has no CSV in it; expected a log"),
            "{refused}"
        );
    }
    // Where a device has several files, nothing tells which belong together.
    let logger = "time,seconds_elapsed,z,y,x\n1700000000000000001,0.1,9.8,0.2,0.1\n";
    for (one, other, text, what, advice) in [
        (
            "a/TotalAcceleration.csv",
            "b/TotalAcceleration.csv",
            logger,
            "the name TotalAcceleration.csv",
            "give each folder by itself",
        ),
        (
            "a.csv",
            "b.csv",
            phone,
            "Acceleration x (m/s^2)",
            "give each device a folder of its own",
        ),
    ] {
        let two = [(one, text.to_owned()), (other, text.to_owned())];
        let two = zipped(folder.path(), "two.zip", &two);
        let refused = read(&[two], None).err().expect("refused").to_string();
        let wanted = format!(
            "two.zip: has two files with {what}, {one} and {other}; expected those of one device: {advice}"
        );
        assert!(refused.ends_with(&wanted), "{refused}");
    }
}

/// Only a file's name has an ending.
#[test]
fn a_dot_in_a_folders_name_or_a_layouts_is_kept() {
    let folder = folder();
    let log = "t,ax,ay,az\n1,0,0,9.8\n";
    let layout = |device: &str| {
        let text = format!(
            "{device}\n[time]\ncolumn = \"t\"\nunit = \"s\"\n[acceleration]\ncolumns = [\"ax\", \"ay\", \"az\"]\nunit = \"m/s^2\"\n"
        );
        file(folder.path(), "layout.toml", &text)
    };
    for (device, given, topic) in [
        ("", "carrier.2/log.csv", "/imu/log"),
        ("", "carrier.2", "/imu/carrier_2"),
        ("device = \"belt.3\"", "carrier.2", "/imu/belt_3"),
    ] {
        file(folder.path(), "carrier.2/log.csv", log);
        let layout = layout(device);
        let given = [folder.path().join(given)];
        let got = ingest(folder.path(), &given, layout.to_str()).expect("ingests");
        assert_eq!(got.ingested.topics, [(topic.to_owned(), 1)]);
    }
}

/// Each note stands under the topic that it is of, and tells the file.
#[test]
fn notes_of_devices_with_one_name_stand_apart() {
    let folder = folder();
    let head = "PacketCounter,SampleTimeFine,Acc_X,Acc_Y,Acc_Z\n1,5,0,0,9.8\n";
    let files = [
        ("a/imu.csv", format!("{head}2,")),
        ("b/imu.csv", format!("{head}2,6,0,0,9.8\n3,")),
        ("c/imu_2.csv", format!("{head}2,6,0")),
    ];
    let imu = zipped(folder.path(), "imu.zip", &files);
    let sound = folder.path().join("imu.wav");
    fs::write(&sound, wav(1, 1, 4000, 8, &[128; 4000])).expect("writes");
    let got = ingest(folder.path(), &[imu, sound], None).expect("ingests");
    let metadata = &got.recording.info().metadata["rath"];
    let cut = |file: &str, line: u32, cells: u32| {
        format!(
            "{file}: line {line}, the last, has {cells} of 5 cells: it was cut off and is left out"
        )
    };
    assert_eq!(metadata["notes./imu/imu"], cut("a/imu.csv", 3, 2));
    assert_eq!(metadata["notes./imu/imu_2"], cut("b/imu.csv", 4, 2));
    assert_eq!(metadata["notes./imu/imu_2_2"], cut("c/imu_2.csv", 3, 3));
    assert_eq!(metadata["notes./audio/imu"], "8-bit sound became 16-bit");
}

/// Zips as no writer should make them: two files of one name, of which the library keeps one, and none at all.
#[test]
fn zips_that_hold_a_name_twice_or_nothing() {
    let out = folder();
    let out = out.path();
    let table = |rows: usize| {
        let header = "\"Time (s)\",\"Acceleration x (m/s^2)\",\"Acceleration y (m/s^2)\",\"Acceleration z (m/s^2)\"\n";
        let rows = (0..rows).map(|k| format!("{}.0E-2,0.0E0,0.0E0,9.8E0\n", k));
        [header.to_owned()]
            .into_iter()
            .chain(rows)
            .collect::<String>()
    };
    let files = [
        ("Accelerometer.csv", table(50)),
        ("Accelerometer.csw", table(30)),
    ];
    let path = zipped(out, "twice.zip", &files);
    let text = fs::read(&path).expect("reads");
    let mut twice = text.clone();
    for k in 0..text.len() - 4 {
        if text[k..].starts_with(b".csw") {
            twice[k + 3] = b'v';
        }
    }
    fs::write(&path, twice).expect("writes");
    let none = zipped(out, "none.zip", &[]);
    for (path, expected) in [
        (path, "several files of one name"),
        (none, "has no CSV in it"),
    ] {
        let said = ingest(out, &[path], None).err().expect("refused");
        let said = said.to_string();
        assert!(said.contains(expected), "{said}");
    }
}

/// One sensor of several that logged nothing is not lost without a word.
#[test]
fn a_table_without_rows_beside_others_is_told() {
    let out = folder();
    let phyphox = |sensor: &str, unit: &str, rows: usize| {
        let axes = ["x", "y", "z"].map(|axis| format!("{sensor} {axis} ({unit})"));
        let rows = (0..rows).map(|k| format!("{k}.0E-2,0.0E0,0.0E0,9.8E0\n"));
        format!("Time (s),{}\n{}", axes.join(","), rows.collect::<String>())
    };
    let logger = |rows: i64| {
        let row = |k| {
            format!(
                "{},{k}.0,0.1,0.2,9.8\n",
                1_700_000_000_000_000_000 + k * 10_000_000
            )
        };
        let rows: String = (0..rows).map(row).collect();
        format!("time,seconds_elapsed,x,y,z\n{rows}")
    };
    for (files, empty) in [
        (
            [
                ("Accelerometer.csv", phyphox("Acceleration", "m/s^2", 50)),
                ("Gyroscope.csv", phyphox("Gyroscope", "rad/s", 0)),
            ],
            "Gyroscope.csv",
        ),
        (
            [
                ("TotalAcceleration.csv", logger(50)),
                ("Gyroscope.csv", logger(0)),
            ],
            "Gyroscope.csv",
        ),
    ] {
        let path = zipped(out.path(), "walk.zip", &files);
        let found = ingest(out.path(), &[path], None).expect("ingests");
        let expected = format!("{empty}: has a header but no rows, and is left out");
        let notes = &found.ingested.notes;
        let told = notes.iter().filter(|note| note.ends_with(&expected));
        assert_eq!(told.count(), 1, "{notes:?}");
    }
}

/// A file whose name only ends like one that phyphox writes is another.
#[test]
fn another_folder_than_meta_tells_no_time() {
    let out = folder();
    let rows = (0..50).map(|k| format!("{k}.0E-2,0.0E0,0.0E0,9.8E0\n"));
    let table = format!(
        "\"Time (s)\",\"Acceleration x (m/s^2)\",\"Acceleration y (m/s^2)\",\"Acceleration z (m/s^2)\"\n{}",
        rows.collect::<String>()
    );
    let files = [
        ("Accelerometer.csv", table),
        ("mymeta/time.csv", "hour,minute\n1,2\n".to_owned()),
    ];
    let path = zipped(out.path(), "walk.zip", &files);
    let found = ingest(out.path(), &[path], None).expect("ingests");
    let notes = found.ingested.notes.join("\n");
    assert!(notes.contains("there is no meta/time.csv"), "{notes}");
    assert!(notes.contains("left out: mymeta/time.csv"), "{notes}");
}

/// Whatever the folder is called that the log is in.
#[test]
fn phyphox_in_a_folder_called_meta() {
    let folder = folder();
    let head = "Time (s),Acceleration x (m/s^2),Acceleration y (m/s^2),Acceleration z (m/s^2)";
    let start = "event,experiment time,system time\nSTART,0.0,1700000000.5\n";
    let log = |time: &str| {
        let run = folder.path().join("meta/run");
        let rows = format!("{head}\n0.5,1,0,9.8\n{time},2,0,9.8\n");
        file(&run, "Accelerometer.csv", &rows);
        file(&run, "meta/time.csv", start);
        ingest(folder.path(), &[run], None)
    };
    let got = log("0.6").expect("ingests");
    assert_eq!(got.times("/imu/run")[0], 1_700_000_001_000_000_000);
    // Times that no clock tells.
    for time in ["-inf", "inf", "-1e12", "1e12"] {
        let said = log(time).err().expect("refused").to_string();
        assert!(
            said.contains("run: Accelerometer.csv: line 3 has the time "),
            "{said}"
        );
    }
}

#[test]
fn rows_whose_time_is_said_to_be_none_are_left_out() {
    let folder = folder();
    let path = folder.path().join("walk");
    let row = |k: u64, none: &str| match k {
        3 => format!("{none},0.03,9.8,0,{k}\n"),
        _ => format!(
            "{},0.0{k},9.8,0,{k}\n",
            1_700_000_000_000_000_000 + k * 10_000_000
        ),
    };
    for none in ["null", "NaN", "NA", "n/a", ""] {
        let rows: String = (0..6).map(|k| row(k, none)).collect();
        file(
            &path,
            "TotalAcceleration.csv",
            &format!("time,seconds_elapsed,z,y,x\n{rows}"),
        );
        let got = ingest(folder.path(), std::slice::from_ref(&path), None).expect("ingests");
        assert_eq!(
            got.values("/imu/walk.linear_acceleration.x"),
            [0.0, 1.0, 2.0, 4.0, 5.0]
        );
        assert_eq!(got.times("/imu/walk")[0], 1_700_000_000_000_000_000);
        let notes = got.ingested.notes.join("; ");
        assert!(
            notes.contains("1 row has no time and is left out"),
            "{notes}"
        );

        let rows = format!("0.01,1,0,9.8\n{none},2,0,9.8\n0.03,3,0,9.8\n");
        let rows = format!(
            "Time (s),Acceleration x (m/s^2),Acceleration y (m/s^2),Acceleration z (m/s^2)\n{rows}"
        );
        let start = "event,experiment time,system time\nSTART,0.0,1700000000.5\n".to_owned();
        let files = [("Accelerometer.csv", rows), ("meta/time.csv", start)];
        let phone = zipped(folder.path(), "phone.zip", &files);
        let got = ingest(folder.path(), &[phone], None).expect("ingests");
        assert_eq!(
            got.times("/imu/phone"),
            [1_700_000_000_510_000_000, 1_700_000_000_530_000_000]
        );
        assert_eq!(got.values("/imu/phone.linear_acceleration.x"), [1.0, 3.0]);
        let notes = got.ingested.notes.join("; ");
        assert!(
            notes.contains("Accelerometer.csv: 1 row has no time and is left out"),
            "{notes}"
        );
    }
}

#[test]
fn a_log_of_the_archive_stands_alone() {
    let folder = folder();
    let logs = ["a.npz", "b.NPZ"].map(|name| file(folder.path(), name, "PK\x03\x04"));
    let said = |paths: &[PathBuf], options: ImportOptions<'_>| {
        let out = folder.path().join("out.mcap");
        let mut writer = RecordingWriter::create(&out, &WriterOptions::default()).expect("begins");
        let error = import::ingest(paths, &options, &mut writer)
            .expect_err("refused")
            .to_string();
        error.replace(&format!("{}/", folder.path().display()), "")
    };
    let plain = ImportOptions::default();
    let layout = ImportOptions {
        layout: Some("nosuch"),
        ..plain
    };
    let late = ImportOptions {
        sound_start_s: 1.0,
        ..plain
    };
    let text = file(folder.path(), "c.csv", "a\n1\n");
    for (paths, options, beside) in [
        (&logs[..], plain, "another log"),
        (&[text, logs[0].clone()], plain, "another log"),
        (&logs[..1], layout, "a layout"),
        (&logs[..1], late, "a start of the sound"),
    ] {
        assert_eq!(
            said(paths, options),
            format!("a.npz: is a log of the archive, which stands alone; found {beside} beside it")
        );
    }
}

#[test]
fn a_log_of_the_archive_whose_times_step_back_is_refused() {
    let folder = folder();
    let path = folder.path().join("logs.npz");
    let mut zip = zip::ZipWriter::new(fs::File::create(&path).expect("creates"));
    zip.start_file("t.npy", zip::write::SimpleFileOptions::default())
        .expect("starts");
    let head = "{'descr': '<f8', 'fortran_order': False, 'shape': (3,), }\n";
    let mut array = b"\x93NUMPY\x01\x00".to_vec();
    array.extend((head.len() as u16).to_le_bytes());
    array.extend(head.bytes());
    array.extend([0.0, 0.5, 0.25].map(f64::to_le_bytes).concat());
    std::io::Write::write_all(&mut zip, &array).expect("writes");
    zip.finish().expect("finishes");
    let error = ingest(folder.path(), &[path], None).err().expect("refused");
    let said = error.to_string();
    let wanted = "logs.npz: t[2] is 0.25 after 0.5; expected times that go on";
    assert!(said.ends_with(wanted), "{said}");
}

#[test]
fn a_row_without_a_time_costs_no_other_in_any_format() {
    let folder = folder();
    let shimmer = "Shimmer_A_Timestamp_Unix_CAL,Shimmer_A_Accel_LN_X_CAL,Shimmer_A_Accel_LN_Y_CAL,Shimmer_A_Accel_LN_Z_CAL\nms,m/(s^2),m/(s^2),m/(s^2)\n";
    // Head; what follows a time; times, of which the third is missing; g in the file's unit, as m/s² of the results.
    let dates = ["00.00", "00.01", "", "00.03"].map(|s| match s {
        "" => String::new(),
        s => format!("2025-11-24 16:00:{s}"),
    });
    let epochs = ["1700000000000", "1700000000010", "NaN", "1700000000030"].map(str::to_owned);
    let counts = ["0", "10000", "-nan", "30000"].map(str::to_owned);
    let (g, times) = (9.80665, [0, 10_000_000, 30_000_000]);
    for (name, head, after, cells, z) in [
        ("ax.csv", "", ",0,0,1", &dates, g),
        (
            "meta.csv",
            "epoc (ms),x-axis (g),y-axis (g),z-axis (g)\n",
            ",0,0,1",
            &epochs,
            g,
        ),
        ("shimmer.csv", shimmer, ",0,0,9.8", &epochs, 9.8),
        (
            "dot.csv",
            "SampleTimeFine,Acc_X,Acc_Y,Acc_Z\n",
            ",0,0,9.8",
            &counts,
            9.8,
        ),
        (
            "toolbox.csv",
            "time,ax,ay,az\n",
            ",0,0,9.8",
            &["0", "0.01", "null", "0.03"].map(str::to_owned),
            9.8,
        ),
    ] {
        let rows: String = cells.iter().map(|t| format!("{t}{after}\n")).collect();
        let path = file(folder.path(), name, &(head.to_owned() + &rows));
        let layout = (name == "toolbox.csv").then(|| {
            let text = "[time]\ncolumn = \"time\"\nunit = \"s\"\n[acceleration]\ncolumns = [\"ax\", \"ay\", \"az\"]\nunit = \"m/s^2\"\n";
            file(folder.path(), "layout.toml", text)
        });
        let got = ingest(
            folder.path(),
            &[path],
            layout.as_deref().and_then(Path::to_str),
        );
        let got = got.unwrap_or_else(|why| panic!("{name}: {why}"));
        let topic = format!("/imu/{}", name.trim_end_matches(".csv"));
        let found = got.times(&topic);
        assert_eq!(
            found.iter().map(|t| t - found[0]).collect::<Vec<_>>(),
            times,
            "{name}"
        );
        let values = got.values(&format!("{topic}.linear_acceleration.z"));
        assert!(
            values.iter().all(|found| (found - z).abs() < 1e-12),
            "{name}: {values:?}"
        );
        let notes = got.ingested.notes.join("; ");
        let told = notes.contains("1 row has no time and is left out");
        assert!(told, "{name}: {notes}");
    }
}

#[test]
fn a_row_with_a_comma_too_many_is_told() {
    let folder = folder();
    let layout = "[time]\ncolumn = \"t\"\nunit = \"s\"\n[acceleration]\ncolumns = [\"x\", \"y\", \"z\"]\nunit = \"m/s^2\"\n";
    let layout = file(folder.path(), "layout.toml", layout);
    let log = |head: &str, odd: &str, every: u64| {
        let row = |k: u64| match k % every {
            3 => format!("{}.5,{odd}\n", k),
            _ => format!("{}.5,0,0,9.8,\n", k),
        };
        let rows: String = (0..40).map(row).collect();
        let path = file(folder.path(), "a.csv", &format!("{head}\n{rows}"));
        ingest(folder.path(), &[path], layout.to_str())
    };
    let got = log("t,x,y,z", "0,0,9,8", 40).expect("ingests");
    assert_eq!(got.values("/imu/a.linear_acceleration.z"), [9.8; 39]);
    let notes = got.ingested.notes.join("; ");
    let told = "1 row has more cells than the header and is left out, the first in line 5";
    assert!(notes.contains(told), "{notes}");
    let said = |got: Result<Imported, ImportError>| got.err().expect("refused").to_string();
    let why = said(log("t,x,y,z", "0,0,9,8", 4));
    assert!(
        why.contains("a.csv: line 5 and 9 more have more cells than the header, which has 4"),
        "{why}"
    );
    let why = said(log("t,x,z,y,z", "0,0,9,8", 40));
    assert!(why.contains("a.csv: has the column z 2 times"), "{why}");
}

/// What was measured before and after a clock was set back lies mixed: it would be two moments at once.
#[test]
fn a_clock_that_was_set_back_is_refused_in_every_format() {
    let folder = folder();
    let shimmer = "Shimmer_A_Timestamp_Unix_CAL,Shimmer_A_Accel_LN_X_CAL,Shimmer_A_Accel_LN_Y_CAL,Shimmer_A_Accel_LN_Z_CAL\nms,m/(s^2),m/(s^2),m/(s^2)\n";
    let phyphox = "Time (s),Acceleration x (m/s^2),Acceleration y (m/s^2),Acceleration z (m/s^2)\n";
    // Tenths of a second: late by a little, then set back by two seconds.
    let tenths = |back: u64| (0..60).map(move |k| if k < 40 { k ^ 1 } else { k - back });
    let ms = |k: u64| (1_700_000_000_000 + 100 * k).to_string();
    let date = |k: u64| format!("2025-11-24 16:00:0{}.{}00", k / 10, k % 10);
    type Time<'a> = &'a dyn Fn(u64) -> String;
    let formats: [(&str, &str, &str, Time<'_>); 5] = [
        ("ax.csv", "", ",0,0,1", &date),
        (
            "meta.csv",
            "epoc (ms),x-axis (g),y-axis (g),z-axis (g)\n",
            ",0,0,1",
            &ms,
        ),
        ("shimmer.csv", shimmer, ",0,0,9.8", &ms),
        (
            "dot.csv",
            "SampleTimeFine,Acc_X,Acc_Y,Acc_Z\n",
            ",0,0,9.8",
            &|k| (100_000 * k).to_string(),
        ),
        ("phy.csv", phyphox, ",0,0,9.8", &|k| {
            format!("{}.{}", k / 10, k % 10)
        }),
    ];
    for (name, head, after, time) in formats {
        let log = |back: u64| {
            let rows: String = tenths(back).map(|k| time(k) + after + "\n").collect();
            let path = file(folder.path(), name, &(head.to_owned() + &rows));
            ingest(folder.path(), &[path], None)
        };
        assert!(log(0).is_ok(), "{name}");
        let why = log(20).err().expect(name).to_string();
        let told = "its times step back by 1.900 s, 3.800 s behind the first";
        assert!(why.contains(told), "{name}: {why}");
    }
}
