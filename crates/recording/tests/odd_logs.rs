//! Logs with what goes wrong between a sensor and a file: packets, rates that change, marks, quotes and digits that are lost.

#[path = "common/logs.rs"]
mod logs;

use std::{fmt::Write as _, fs, path::Path};

use logs::{Imported, file, folder, ingest, zipped};

/// A layout of a table `t,x,y,z,note`, t in ms.
const LAYOUT: &str = "[time]\ncolumn = \"t\"\nunit = \"ms\"\n[acceleration]\ncolumns = [\"x\", \"y\", \"z\"]\nunit = \"m/s^2\"\n";

fn laid_out(folder: &Path, text: &str) -> Result<Imported, String> {
    let layout = file(folder, "layout.toml", LAYOUT);
    let path = file(folder, "log.csv", text);
    ingest(folder, &[path], layout.to_str()).map_err(|error| error.to_string())
}

/// What is said of a table that is refused.
fn refused(folder: &Path, text: &str) -> String {
    laid_out(folder, text).err().expect("refused")
}

fn note<'a>(got: &'a Imported, what: &str) -> Option<&'a str> {
    let mut notes = got.ingested.notes.iter().map(String::as_str);
    notes.find(|note| note.contains(what))
}

/// A folder of a MetaBase device: both sensors at their times (ms); the angular velocity is 1 deg/s for each ms of its time.
fn metabase(folder: &Path, force_ms: &[i64], rate_ms: &[(i64, f64)]) -> Imported {
    let device = folder.join("device");
    let mut force = "epoc (ms),elapsed (s),x-axis (g),y-axis (g),z-axis (g)\n".to_owned();
    for t in force_ms {
        writeln!(force, "{},0,0,0,1", 1_538_587_435_000 + t).expect("writes");
    }
    let mut rate =
        "epoc (ms),elapsed (s),x-axis (deg/s),y-axis (deg/s),z-axis (deg/s)\n".to_owned();
    for (t, x) in rate_ms {
        writeln!(rate, "{},0,{x},0,0", 1_538_587_435_000 + t).expect("writes");
    }
    file(&device, "accelerometer.csv", &force);
    file(&device, "gyroscope.csv", &rate);
    ingest(folder, &[device], None).expect("ingests")
}

/// Three samples to a packet, stamped at its end: the rates are those of when they were taken.
#[test]
fn packets_are_paired_by_when_their_samples_were_taken() {
    let folder = folder();
    let stamp = |k: i64| 30 * (k / 3) + 20;
    let force: Vec<i64> = (0..300).map(stamp).collect();
    let rate: Vec<(i64, f64)> = (0..300).map(|k| (stamp(k) + 7, (10 * k) as f64)).collect();
    let got = metabase(folder.path(), &force, &rate);
    let found = got.values("/imu/device.angular_velocity.x");
    // The first is before all rates.
    assert_eq!(found.len(), 300);
    for (k, x) in found.iter().enumerate().skip(1) {
        let known = 10.0 * k as f64 - 7.0;
        assert!((x.to_degrees() - known).abs() < 1e-9, "{k}: {x}");
    }
    assert_eq!(note(&got, "have no angular velocity"), None);
}

#[test]
fn a_rate_that_changes_is_no_hole_and_a_hole_is_told() {
    let folder = folder();
    // 100 Hz for 30 s, then 20 Hz for 30 s, but for two seconds of the angular velocity.
    let fast = (0..3000).map(|k| 10 * k);
    let force: Vec<i64> = fast.chain((0..600).map(|k| 30_000 + 50 * k)).collect();
    let rate = force.iter().map(|t| (t + 3, (t + 3) as f64));
    let whole: Vec<(i64, f64)> = rate.collect();
    let got = metabase(folder.path(), &force, &whole);
    let found = got.values("/imu/device.angular_velocity.x");
    let late = found.iter().zip(&force).skip(1);
    assert!(late.clone().count() > 3500);
    for (x, t) in late {
        assert!((x.to_degrees() - *t as f64).abs() < 1e-6, "{t}: {x}");
    }
    assert_eq!(note(&got, "have no angular velocity"), None);
    let holed: Vec<(i64, f64)> = (whole.iter().copied())
        .filter(|(t, _)| !(10_000..12_000).contains(t))
        .collect();
    let got = metabase(folder.path(), &force, &holed);
    let told = note(&got, "have no angular velocity").expect("a note");
    assert!(
        told.contains("202 of 3600 of the acceleration's samples"),
        "{told}"
    );
    let kept = &got.recording.info().metadata["rath"]["notes./imu/device"];
    assert!(
        told.ends_with("ended earlier") && kept.ends_with("ended earlier"),
        "{kept}"
    );
    // And one of which there is less acceleration than angular velocity.
    let got = metabase(folder.path(), &force[..1500], &whole);
    let told = note(&got, "where no acceleration is").expect("a note");
    assert!(
        told.contains("of 3600 of the angular velocity's samples"),
        "{told}"
    );
}

#[test]
fn a_byte_order_mark_changes_no_unit() {
    let folder = folder();
    let text = "// Update Rate: 100.0Hz\nPacketCounter,SampleTimeFine,Acc_X,Acc_Y,Acc_Z,Gyr_X,Gyr_Y,Gyr_Z\n1,0,0,0,9.8,0.5,0,0\n2,100,0,0,9.8,0.5,0,0\n";
    for mark in ["", "\u{feff}"] {
        let path = file(folder.path(), "mti.csv", &format!("{mark}{text}"));
        let got = ingest(folder.path(), &[path], None).expect("ingests");
        assert_eq!(got.values("/imu/mti.angular_velocity.x"), [0.5; 2]);
    }
}

/// Marks without end are no text of any kind, and no reason to fall over.
#[test]
fn a_file_of_marks_is_refused() {
    let folder = folder();
    let path = file(folder.path(), "marks.csv", &"\u{feff}".repeat(1_000_000));
    let error = ingest(folder.path(), &[path], None).err().expect("refused");
    assert!(error.to_string().contains("is no log of"), "{error}");
}

#[test]
fn a_count_that_wraps_with_a_sample_late_wraps_once() {
    let folder = folder();
    let head = "PacketCounter,SampleTimeFine,Acc_X,Acc_Y,Acc_Z\n";
    let counts = [4_294_957_296_i64, 5_000, 4_294_962_296, 15_000];
    let rows = counts.map(|count| format!("1,{count},0,0,9.8\n")).concat();
    let path = file(folder.path(), "dot.csv", &format!("{head}{rows}"));
    let got = ingest(folder.path(), &[path], None).expect("ingests");
    let times: Vec<i64> = (-2..2)
        .map(|k| (4_294_967_296 + 5_000 * k) * 1000)
        .collect();
    let known = [times[0], times[1], times[3], times[3] + 10_000_000];
    assert_eq!(got.times("/imu/dot"), known);
    assert!(note(&got, "wrapped 1 time").is_some());
}

#[test]
fn a_quotation_mark_too_many_is_an_error_where_it_stands() {
    let folder = folder();
    let row = |k: u32| {
        format!(
            "{},0,0,9.8,{}\n",
            10 * k,
            if k == 50 { "\"5 steps" } else { "" }
        )
    };
    let text = (0..100).map(row).collect::<String>();
    let error = refused(folder.path(), &format!("t,x,y,z,note\n{text}"));
    assert!(
        error.ends_with("log.csv: line 52 begins a quotation that takes in 49 lines behind it; expected each row on one line: is there a quotation mark too many?"),
        "{error}"
    );
}

/// Commas in names and numbers are as many as semicolons; a semicolon in a name is none between cells.
#[test]
fn the_first_rows_tell_what_separates_cells() {
    let folder = folder();
    let layout = |text: &str| {
        let mut names = text.split('|');
        let mut next = || names.next().expect("a name");
        format!(
            "[time]\ncolumn = '{}'\nunit = 'ms'\n[acceleration]\ncolumns = ['{}', '{}', '{}']\nunit = 'm/s^2'\n",
            next(),
            next(),
            next(),
            next()
        )
    };
    for (names, separator, row) in [
        ("t|x, m/s2|y, m/s2|z, m/s2", ";", "0;0,5;0,25;9,5"),
        ("t, ms|x, m/s2|y, m/s2|z, m/s2", ";", "0;0.5;0.25;9.5"),
        ("t;ms|x;1|y;2|z", ",", "0,0.5,0.25,9.5"),
    ] {
        let laid = file(folder.path(), "layout.toml", &layout(names));
        let header = names.replace('|', separator);
        let text = format!("{header}\n{row}\n{row}\n");
        let path = file(folder.path(), "log.csv", &text);
        let got = ingest(folder.path(), &[path], laid.to_str());
        let got = got.unwrap_or_else(|error| panic!("{header}: {error}"));
        assert_eq!(got.values("/imu/log.linear_acceleration.y"), [0.25; 2]);
    }
}

#[test]
fn a_header_without_end_is_refused() {
    let folder = folder();
    let text = format!("t,x,y,z{}\n0,0,0,9.8\n", ",0".repeat(1 << 20));
    let error = refused(folder.path(), &text);
    assert!(
        error.ends_with("log.csv: line 1, the header, has 2097159 bytes; expected names of columns in at most 1048576: are line ends missing?"),
        "{error}"
    );
}

#[test]
fn a_layout_that_names_a_column_twice_is_refused() {
    let folder = folder();
    let layout = LAYOUT.replace("\"y\"", "\"X \"");
    let layout = file(folder.path(), "twice.toml", &layout);
    let log = file(folder.path(), "log.csv", "t,x,y,z\n0,0,0,9.8\n");
    let error = ingest(folder.path(), &[log], layout.to_str()).err();
    let said = error.expect("refused").to_string();
    let wanted = "twice.toml: is no layout: it names the column \"X \" twice; expected another for each number";
    assert!(said.ends_with(wanted), "{said}");
}

#[test]
fn a_log_cut_within_its_last_number_loses_that_row_alone() {
    let folder = folder();
    let rows = (0..50).map(|k| format!("{},0,0,9.812\n", 10 * k));
    let whole = format!("t,x,y,z\n{}", rows.collect::<String>());
    for (cut, left) in [(0, 50), (1, 50), (2, 49), (4, 49), (5, 49)] {
        let got = laid_out(folder.path(), &whole[..whole.len() - cut]).expect("ingests");
        assert_eq!(got.ingested.topics[0].1, left, "{cut}");
        assert_eq!(got.ingested.notes.len(), usize::from(left == 49), "{cut}");
    }
    let half = format!("{}500,0,0,9.81E-", whole);
    let error = refused(folder.path(), &half);
    assert!(
        error.contains("line 52, column \"z\": found \"9.81E-\""),
        "{error}"
    );
}

#[test]
fn times_that_lost_their_digits_are_refused() {
    let folder = folder();
    let rows = "1.53859E+12,0,0,9.8\n".repeat(300);
    let error = refused(folder.path(), &format!("t,x,y,z\n{rows}"));
    assert!(
        error.contains("has 300 samples with hardly any times between them"),
        "{error}"
    );
}

#[test]
fn what_is_beside_logs_and_no_log_is_named() {
    let folder = folder();
    let device = folder.path().join("walk");
    file(
        &device,
        "a.csv",
        "PacketCounter,SampleTimeFine,Acc_X,Acc_Y,Acc_Z\n1,5,0,0,9.8\n",
    );
    for name in ["b.zip", "c.tsv", ".hidden", "sub/d.csv", "sub.csv/d.csv"] {
        file(&device, name, "");
    }
    #[cfg(unix)]
    {
        let pipe = device.join("pipe.csv");
        std::os::unix::net::UnixListener::bind(pipe).expect("makes one");
        std::os::unix::fs::symlink("a.csv", device.join("linked.csv")).expect("links");
    }
    let got = ingest(folder.path(), &[device], None).expect("ingests");
    let told = note(&got, "no files of CSV or text").expect("a note");
    let others: Vec<&str> = told
        .rsplit(": ")
        .next()
        .expect("names")
        .split(", ")
        .collect();
    if cfg!(unix) {
        assert_eq!(others, ["b.zip", "c.tsv", "pipe.csv", "sub", "sub.csv"]);
        assert_eq!(got.ingested.topics.len(), 2);
    } else {
        assert_eq!(others, ["b.zip", "c.tsv", "sub", "sub.csv"]);
    }
}

#[test]
fn a_log_is_given_twice_by_whatever_path() {
    let folder = folder();
    let text = "PacketCounter,SampleTimeFine,Acc_X,Acc_Y,Acc_Z\n1,5,0,0,9.8\n";
    let path = file(folder.path(), "dot.csv", text);
    let again = folder.path().join(".").join("dot.csv");
    let error = ingest(folder.path(), &[path, again], None).err();
    assert!(
        error
            .expect("refused")
            .to_string()
            .contains("is given twice")
    );
}

/// A line that tells a spreadsheet the separator, and a zip packed on another system.
#[test]
fn phyphox_behind_a_line_and_in_a_zip_of_another_system() {
    let folder = folder();
    let table = "sep=,\n\"Time (s)\",\"Acceleration x (m/s^2)\",\"Acceleration y (m/s^2)\",\"Acceleration z (m/s^2)\"\n0.0,0,0,9.8\n0.1,0,0,9.8\n";
    let time = "\"event\",\"experiment time\",\"system time\"\n\"START\",0.0,1700000000.0\n";
    let files = [
        ("Accelerometer.csv", table.to_owned()),
        ("meta\\time.csv", time.to_owned()),
    ];
    let path = zipped(folder.path(), "walk.zip", &files);
    let got = ingest(folder.path(), &[path], None).expect("ingests");
    let start_ns = 1_700_000_000_000_000_000;
    assert_eq!(got.times("/imu/walk"), [start_ns, start_ns + 100_000_000]);
}

/// The name until it is whole is longer.
#[test]
fn a_name_may_be_as_long_as_the_system_takes() {
    let folder = folder();
    let out = folder.path().join(format!("{}ड.mcap", "a".repeat(247)));
    recording::whole::write_whole(&out, |_| Ok::<_, std::io::Error>(())).expect("writes");
    let out = folder.path().join(format!("{}.mcap", "ड".repeat(83)));
    recording::whole::write_whole(&out, |_| Ok::<_, std::io::Error>(())).expect("writes");
    assert_eq!(fs::read_dir(folder.path()).expect("reads").count(), 2);
}

/// A file that replaces another is as open to others as that was.
#[cfg(unix)]
#[test]
fn what_replaces_a_private_file_is_private() {
    use std::os::unix::fs::PermissionsExt as _;
    let folder = folder();
    let out = file(folder.path(), "out.mcap", "");
    fs::set_permissions(&out, fs::Permissions::from_mode(0o600)).expect("sets");
    laid_out(folder.path(), "t,x,y,z\n0,0,0,9.8\n10,0,0,9.8\n").expect("ingests");
    let mode = fs::metadata(&out).expect("is there").permissions().mode();
    assert_eq!(mode & 0o777, 0o600);
}
