//! What a study file may ask for, and what its table, summary and folder say.

use std::io::Write;
use std::path::Path;
use std::sync::atomic::AtomicBool;
use study::statistics::about_their_mean;
use study::sweep::known::Known;
use study::sweep::parts::{Store, write_whole};
use study::sweep::shard::Shard;
use study::sweep::summary::{Found, Summary};
use study::sweep::table::Cell;
use study::sweep::{Plan, spec};

fn plan(text: &str) -> Result<Plan, String> {
    let spec = spec::parse("test", &format!("scene = \"music\"\n{text}"))?;
    Plan::new(spec, Path::new(""))
}

fn refused(text: &str) -> String {
    plan(text)
        .err()
        .unwrap_or_else(|| panic!("accepted: {text}"))
}

#[test]
fn what_cannot_count_is_refused() {
    let strength = "axes = [{ key = \"effects.music.strength_rad_per_s\", values = [1.0, 2.0] }]";
    for (set, fine) in [
        ("set.effects.music = false", false),
        ("set.effects.music.strength_rad_per_s = 3.0", true),
        ("set.effects.music = {}", true),
        ("set.effects.music.onset_s = 3.0", true),
    ] {
        let text = format!("{set}\n{strength}");
        match fine {
            true => drop(plan(&text).unwrap()),
            false => assert!(refused(&text).contains("of [set]"), "{set}"),
        }
    }
    for (axis, why) in [
        (
            "carriers.handles_m.0.0\", values = [1.0, 2.0, 1]",
            "hold 1 twice",
        ),
        (
            "effects.gait.harmonics.0.order\", from = 2, to = 4, count = 5",
            "rounded to whole numbers",
        ),
    ] {
        let harmonics =
            "set.effects.gait.harmonics = [{ order = 2, amplitude_m = [0.01, 0.0, 0.0] }]";
        let text = format!("{harmonics}\naxes = [{{ key = \"{axis} }}]");
        assert!(refused(&text).contains(why), "{}", refused(&text));
    }
    assert!(refused("first_seed = 72057594037927935\nseeds = 2").contains("first_seed"));
    plan("first_seed = 72057594037927935\nseeds = 1").unwrap();
}

/// Without the first every point is the same; the second overflows on the way, and the scene was blamed for a NaN that nobody wrote.
#[test]
fn a_range_has_an_extent_that_a_number_can_say() {
    let axis = |ends: &str| format!("axes = [{{ key = \"body.mass_kg\", {ends} }}]");
    let design = "design = { kind = \"sobol\", points = 4 }";
    let same = refused(&format!("{design}\n{}", axis("from = 60, to = 60")));
    assert!(
        same.contains("axes.0 (`body.mass_kg`)") && same.contains("both 60"),
        "{same}"
    );
    let wide = refused(&axis("from = -1e308, to = 1e308, count = 3"));
    assert!(
        wide.contains("`from` -1e308 and `to` 1e308 are further apart"),
        "{wide}"
    );
    plan(&axis("from = 60, to = 60, count = 1")).unwrap();
}

/// Listed values have their factors to keep as a range has, and the summary's columns their names.
#[test]
fn equal_factors_need_numbers_above_zero_and_columns_names_of_their_own() {
    let axis = |more: &str| {
        format!(
            "metrics = [\"t_float\"]\naxes = [{{ key = \"effects.music.strength_rad_per_s\", {more} }}]"
        )
    };
    let refused = |more: &str| refused(&axis(more));
    let zero = refused("values = [0, 1, 2], spacing = \"log\"");
    assert!(zero.contains("above zero in `values`"), "{zero}");
    for name in ["runs", "remarked", "t_float.mean", "t_float.n"] {
        let taken = refused(&format!("values = [1, 2], name = \"{name}\""));
        assert!(taken.contains("there is a column"), "{taken}");
    }
    let fine = "values = [1, 2], spacing = \"log\", name = \"rms_roll_deg.mean\"";
    plan(&axis(fine)).unwrap();
}

#[test]
fn a_named_value_that_can_never_be_is_a_slip_and_a_range_that_reaches_out_is_none() {
    let axis = |key: &str, values: &str| format!("{{ key = \"{key}\", {values} }}");
    let axes = |all: &[String]| format!("axes = [{}]", all.join(", "));
    let mass = |values: &str| axis("body.mass_kg", values);
    for values in [
        "values = [-1, -2]",
        "values = [-1, 60, -2]",
        "values = [60, \"heavy\"]",
    ] {
        assert!(
            refused(&axes(&[mass(values)])).contains("mass_kg"),
            "{values}"
        );
    }
    let reaches_out = axes(&[mass("from = -1, to = 60, count = 3")]);
    assert_eq!(plan(&reaches_out).unwrap().points(), 3);
    // 2.0 is a whole number.
    let poles = "scene = \"eight-carriers\"\naxes = [{ key = \"carriers.along_poles.count\", values = [4.0, 6] }]";
    let spec = spec::parse("test", poles).unwrap();
    assert_eq!(Plan::new(spec, Path::new("")).unwrap().points(), 2);
    // What goes only beside a value of another axis goes.
    let law = axis(
        "effects.friction.law",
        "values = [\"regularised\", \"bristle\"]",
    );
    assert!(refused(&axes(std::slice::from_ref(&law))).contains("effects.friction.law"));
    let sling = axis("effects.sling", "values = [true, false]");
    assert_eq!(plan(&axes(&[law, sling])).unwrap().points(), 4);
}

/// `true` is an effect as the scene has it, `{}` one with its defaults.
#[test]
fn an_effect_is_on_as_the_scene_has_it() {
    let gain = |values: &str, point: u64| {
        let study = plan(&format!(
            "axes = [{{ key = \"effects.lift\", values = {values} }}]"
        ));
        let scene = study.unwrap().scene(point).unwrap();
        scene.effects.lift.map(|lift| lift.gain)
    };
    assert_eq!(gain("[true, false]", 0), Some(1.25));
    assert_eq!(gain("[true, false]", 1), None);
    assert_eq!(gain("[{}, false]", 0), Some(1.2));
}

#[test]
fn an_axis_has_the_unit_of_its_key() {
    for (key, values, unit) in [
        ("effects.contact.stiffness_n_per_m", "[1e3, 2e3]", "N/m"),
        ("effects.noise.phase_rad_per_sqrt_s", "[0.01, 0.02]", ""),
        ("effects.music.beat_hz", "[2.0, 2.1]", "Hz"),
        ("effects.friction.law", r#"["regularised", "bristle"]"#, ""),
    ] {
        let text = format!(
            "set.effects.sling = false\naxes = [{{ key = \"{key}\", name = \"it\", values = {values} }}]"
        );
        let plan = plan(&text).unwrap();
        let column = plan.columns().iter().find(|c| c.name == "it").unwrap();
        assert_eq!(column.unit, unit, "{key}");
    }
}

#[test]
fn a_run_without_a_window_says_so() {
    let study = plan(
        "metrics = [\"dz_pp_m\", \"rms_roll_deg\"]\n[set]\nduration_s = 1.0\nanalysis_start_s = 15.0",
    );
    let rows = study.unwrap().run(0..1, None).unwrap();
    let Cell::Text(why) = &rows[0][rows[0].len() - 2] else {
        panic!("{rows:?}");
    };
    assert!(why.contains("begins at 15 s"), "{why}");
}

/// Straps on stiff springs feed some of these runs, which fly hundreds of metres high: `sim record` refuses them, and so does a study, though it keeps
/// no account of energy; alone and abreast.
#[test]
fn what_no_strap_could_do_is_no_result() {
    let stiff = "metrics = [\"rms_z_m\"]\nset.effects.contact.stiffness_n_per_m = 30000.0\nset.solver.tolerance = 1e-6\n";
    for (seeds, given_up) in [
        ("first_seed = 1006\nseeds = 1", 1),
        ("first_seed = 1001\nseeds = 8", 4),
    ] {
        let study = plan(&format!("{seeds}\n{stiff}")).unwrap();
        let count = if seeds.ends_with('8') { 8 } else { 1 };
        let rows = study.run(0..count, None).unwrap();
        let said = |row: &&Vec<Cell>| {
            let why = |c: &Cell| matches!(c, Cell::Text(t) if t.contains("effects.sling gave"));
            row.iter().any(why)
        };
        assert_eq!(rows.iter().filter(said).count(), given_up, "{rows:?}");
        let too_high = |row: &Vec<Cell>| row.iter().any(|c| matches!(c, Cell::Real(z) if *z > 1.0));
        assert!(!rows.iter().any(too_high), "{rows:?}");
    }
}

/// `sim record` refuses these too: steps that are too long, by the account that a study therefore keeps, and straps that swing far sideways and hardly roll.
#[test]
fn a_run_is_as_good_as_its_recording() {
    for (settings, why) in [
        (
            "solver.method = \"rk4\"\nsolver.step_s = 0.02",
            "came from nowhere",
        ),
        (
            "effects.sling.length_m = 0.3\neffects.sling.damping_s = 0.02",
            "effects.sling gave",
        ),
    ] {
        for more in ["", "recordings = true\n"] {
            let text = format!(
                "seeds = 1\nfirst_seed = 1002\nmetrics = [\"rms_roll_deg\"]\n{more}[set]\nduration_s = 20.0\n{settings}"
            );
            let rows = plan(&text).unwrap().run(0..1, None).unwrap();
            let failed = &rows[0][rows[0].len() - 2];
            assert!(
                matches!(failed, Cell::Text(t) if t.contains(why)),
                "{more}{settings}: {rows:?}"
            );
        }
    }
}

/// What a summary makes of one point's values of a metric, of five runs.
fn summary_of(metric: &str, values: &[Option<f64>]) -> (Found, String) {
    let text = format!("seeds = {}\nmetrics = [\"{metric}\"]", values.len());
    let plan = plan(&text).unwrap();
    let mut csv = Vec::new();
    let mut summary = Summary::new(&plan, &mut csv).unwrap();
    for value in values {
        let mut row = vec![Cell::Empty; plan.columns().len()];
        row[3] = value.map_or(Cell::Empty, Cell::Real);
        summary.row(&row).unwrap();
    }
    let found = summary.finish().unwrap();
    (found, String::from_utf8(csv).unwrap())
}

/// One run shows no spread: its SD and the interval of its mean are blank, between its mean and its quantiles.
#[test]
fn one_run_has_no_spread() {
    let (_, csv) = summary_of("rms_roll_deg", &[Some(2.5)]);
    assert!(csv.contains(",2.5,,,2.5,2.5,2.5,1\n"), "{csv}");
}

#[test]
fn angles_are_taken_about_their_circular_mean() {
    // Mean by scipy.stats.circmean, SD by hand, about 180: -2, 0.4, -1, 3.
    let (found, csv) = summary_of(
        "beat_lead_deg",
        &[Some(178.0), Some(-179.6), Some(179.0), Some(-177.0)],
    );
    let (low, _) = found.ranges[0].lowest.clone().unwrap();
    assert!((low + 179.9001755225448).abs() < 1e-9, "{low}");
    let last: Vec<&str> = csv.lines().nth(1).unwrap().split(',').collect();
    let sd: f64 = last[5].parse().unwrap();
    assert!((sd - (14.12f64 / 3.0).sqrt()).abs() < 1e-9, "{csv}");
    let (_, about) = about_their_mean(&[170.0, -170.0, -160.0], 360.0);
    assert!((about[1] - about[0] - 20.0).abs() < 1e-9 && (about[2] - about[1] - 10.0).abs() < 1e-9);
    // Axes, which are the same after half a turn.
    let (_, about) = about_their_mean(&[89.0, -89.0, -85.0], 180.0);
    assert!((about[1] - about[0] - 2.0).abs() < 1e-9 && (about[2] - about[1] - 4.0).abs() < 1e-9);
}

#[test]
fn who_has_a_metric_is_said_and_few_do_not_speak_for_all() {
    let (found, _) = summary_of("onset_time_s", &[Some(34.4), None, None, None, None]);
    assert_eq!((found.ranges[0].runs, found.ranges[0].points), (1, 0));
    assert!(
        found.table().contains("in 1 of 5 runs"),
        "{}",
        found.table()
    );
    let (found, _) = summary_of(
        "onset_time_s",
        &[Some(20.0), Some(30.0), Some(40.0), None, None],
    );
    assert_eq!(found.ranges[0].lowest.as_ref().unwrap().0, 30.0);
    assert!(
        found.table().contains("in 3 of 5 runs"),
        "{}",
        found.table()
    );
}

#[test]
fn a_recording_that_is_lost_is_made_again_and_another_study_s_table_is_none_of_ours() {
    let text = |metric: &str| {
        format!(
            "seeds = 2\nrecordings = true\nmetrics = [\"{metric}\"]\n[set]\nduration_s = 0.5\nanalysis_start_s = 0.0"
        )
    };
    let ours = plan(&text("dz_pp_m")).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let store = Store::new(&ours, folder.path());
    store.create().unwrap();
    let missing = || store.progress(Shard::WHOLE).unwrap().missing;
    let compute = || {
        store
            .fill(
                &missing(),
                1,
                &AtomicBool::new(false),
                |runs| store.run(runs),
                || (),
            )
            .unwrap()
    };
    assert_eq!(compute().runs, 2);
    assert!(missing().is_empty());
    let kept = folder.path().join("recordings");
    let first = kept.join("run-000000000.mcap");
    let whole = std::fs::read(&first).unwrap();
    std::fs::write(&first, &whole[..whole.len() / 2]).unwrap();
    assert_eq!(missing(), [0]);
    compute();
    assert!(std::fs::read(&first).unwrap() == whole);
    std::fs::remove_file(kept.join("run-000000001.mcap")).unwrap();
    assert_eq!(missing(), [0]);
    // The table needs no recordings.
    store.merge().unwrap();
    assert!(store.is_merged());
    let other = plan(&text("rms_roll_deg")).unwrap();
    assert!(!Store::new(&other, folder.path()).is_merged());
}

/// What a kill left goes when the study goes on; what another process may be writing stays, and so does what is no study's.
#[test]
fn what_a_kill_left_is_taken_away() {
    let ours = plan("seeds = 1\nset = { duration_s = 1.0, analysis_start_s = 0.0 }").unwrap();
    let folder = tempfile::tempdir().unwrap();
    let store = Store::new(&ours, folder.path());
    store.create().unwrap();
    std::fs::create_dir(folder.path().join("recordings")).unwrap();
    let hours_old = std::time::SystemTime::now() - std::time::Duration::from_secs(7200);
    let unfinished = |name: &str, old: bool| {
        let path = folder.path().join(name);
        let file = std::fs::File::create(&path).unwrap();
        if old {
            file.set_modified(hours_old).unwrap();
        }
        path
    };
    let left = [
        "parts/.000000000-000000001.parquet.abc.part",
        "recordings/.run-000000000.mcap.abc.part",
        ".runs.parquet.abc.part",
    ];
    let left = left.map(|name| unfinished(name, true));
    let kept = [
        unfinished("parts/.000000000-000000001.parquet.def.part", false),
        unfinished("recordings/.run-000000000.mcap.def.part", false),
        unfinished(".film.part", true),
        unfinished("parts/notes.part", true),
    ];
    store
        .fill(
            &[0],
            1,
            &AtomicBool::new(false),
            |runs| store.run(runs),
            || (),
        )
        .unwrap();
    assert!(!left.iter().any(|path| path.exists()), "{left:?}");
    assert!(kept.iter().all(|path| path.exists()), "{kept:?}");
}

/// That a disk is full says nothing of a run. A row of it would stay so for ever: `--resume` leaves what is there.
#[test]
fn a_recording_that_cannot_be_written_is_no_result() {
    let text = "seeds = 2\nrecordings = true\n[set]\nduration_s = 0.5\nanalysis_start_s = 0.0";
    let ours = plan(text).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let store = Store::new(&ours, folder.path());
    store.create().unwrap();
    let stop = AtomicBool::new(false);
    let in_the_way = folder.path().join("recordings/run-000000001.mcap");
    std::fs::create_dir(&in_the_way).unwrap();
    let why = store
        .fill(&[0], 1, &stop, |runs| store.run(runs), || ())
        .unwrap_err();
    assert!(
        why.contains("run-000000001.mcap: cannot be written"),
        "{why}"
    );
    assert_eq!(store.progress(Shard::WHOLE).unwrap().missing, [0]);
    std::fs::remove_dir(&in_the_way).unwrap();
    assert_eq!(
        store
            .fill(&[0], 1, &stop, |runs| store.run(runs), || ())
            .unwrap()
            .failed,
        0
    );
}

/// The file that cannot be written is named, once and by its own name, with what the system says of it.
#[test]
fn what_cannot_be_written_is_named_as_it_is() {
    let folder = tempfile::tempdir().unwrap();
    let ours = plan("seeds = 1\nset = { duration_s = 1.0, analysis_start_s = 0.0 }").unwrap();
    let store = Store::new(&ours, folder.path());
    store.create().unwrap();
    let stop = AtomicBool::new(false);
    store
        .fill(&[0], 1, &stop, |runs| store.run(runs), || ())
        .unwrap();
    let table = store.table();
    std::fs::create_dir(&table).unwrap();
    assert_eq!(
        store.merge().unwrap_err(),
        format!("{}: cannot be written: it is a folder", table.display())
    );
    assert!(!folder.path().join("summary.csv").exists());
    if cfg!(target_os = "linux") {
        let full = Path::new("/dev/full");
        let said = write_whole(full, |file| Ok(file.write_all(&[0; 1 << 20])?)).unwrap_err();
        assert_eq!(
            said,
            "/dev/full: cannot be written: No space left on device (os error 28)"
        );
    }
}

/// Of a study that grows only what is new is computed, and its table is, byte for byte, the one of computing it all.
#[test]
fn a_study_that_grows_keeps_what_it_has() {
    let short = "set = { duration_s = 2.0, analysis_start_s = 0.0, solver.tolerance = 1e-6 }";
    let study = |name: &str, rest: &str| plan(&format!("name = \"{name}\"\n{rest}\n{short}"));
    let pull = |values: &str| {
        format!("{{ key = \"effects.music.strength_rad_per_s\", values = {values} }}")
    };
    let never = AtomicBool::new(false);
    let folder = tempfile::tempdir().unwrap();
    let place = |name: &str| folder.path().join(name);
    let table = |plan: &Plan, name: &str, known: Option<&Known>| {
        let path = place(name);
        let store = Store::new(plan, &path);
        let run = |runs| match known {
            Some(known) => known.complete(plan, runs, |runs| store.run(runs)),
            None => store.run(runs),
        };
        let _claim = store.create().unwrap();
        let blocks: Vec<u64> = (0..plan.blocks()).collect();
        store.fill(&blocks, 2, &never, run, || ()).unwrap();
        store.merge().unwrap();
        std::fs::read(store.table()).unwrap()
    };
    let pilot = study(
        "pilot",
        &format!(
            "seeds = 10\nmetrics = [\"rms_z_m\", \"rms_roll_deg\", \"dz_pp_m\"]\naxes = [{}]",
            pull("[1.0, 2.0]")
        ),
    );
    table(&pilot.unwrap(), "pilot", None);
    // More seeds from another first one, a point more, in another order, an axis more, a metric less.
    let bilateral = "{ key = \"effects.contact.bilateral\", values = [true, false] }";
    let larger = format!(
        "seeds = 12\nfirst_seed = 1004\nmetrics = [\"dz_pp_m\", \"rms_z_m\"]\naxes = [{}, {bilateral}]",
        pull("[2.0, 3.0, 1.0]")
    );
    let larger = study("larger", &larger).unwrap();
    let anew = table(&larger, "anew", None);
    let known = Known::load(&place("pilot"), &larger).unwrap();
    assert!(table(&larger, "grown", Some(&known)) == anew);
    // Two points, seeds 1004 to 1010.
    assert_eq!(known.taken(), 14);

    // What is lost is computed again: runs 16 to 19 are seeds 1007 to 1010 of the second point.
    let part = place("pilot/parts/000000016-000000020.parquet");
    let whole = std::fs::read(&part).unwrap();
    std::fs::write(&part, &whole[..whole.len() - 9]).unwrap();
    let known = Known::load(&place("pilot"), &larger).unwrap();
    assert_eq!(known.progress.damaged.len(), 1, "{:?}", known.progress);
    assert!(table(&larger, "again", Some(&known)) == anew);
    assert_eq!(known.taken(), 10);

    // Fewer than eight seeds are computed one by one, whose rows are others in the last bits.
    let few = study(
        "few",
        &format!(
            "seeds = 2\nmetrics = [\"rms_z_m\"]\naxes = [{}]",
            pull("[1.0, 2.0]")
        ),
    );
    let few = few.unwrap();
    let known = Known::load(&place("pilot"), &few).unwrap();
    table(&few, "few", Some(&known));
    assert_eq!(known.taken(), 0);
    assert!(
        known
            .says(4)
            .contains("none was taken over: of the 16 runs")
    );

    for (rest, why) in [
        ("metrics = [\"t_float\", \"rms_z_m\"]", "have no t_float"),
        (
            "metrics = [\"rms_z_m\"]\nrecordings = true",
            "no recordings",
        ),
    ] {
        let other = study("other", rest).unwrap();
        let said = Known::load(&place("pilot"), &other).err().unwrap();
        assert!(said.contains(why), "{said}");
    }
}

#[test]
fn a_command_that_is_suggested_can_be_copied() {
    let plan = plan("metrics = [\"dz_pp_m\"]").unwrap();
    let folder = tempfile::tempdir().unwrap();
    let store = Store::new(&plan, &folder.path().join("my study"));
    let _claim = store.create().unwrap();
    let told = store.merge().unwrap_err();
    assert!(told.contains("my study/study.toml' --resume"), "{told}");
}
