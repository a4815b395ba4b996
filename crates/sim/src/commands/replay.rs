//! `sim replay`: a recording drives a scene.

use super::{Changes, Format, patient_bar, print, seconds};
use anyhow::{Context, Result, anyhow, bail};
use indicatif::ProgressBar;
use recording::read::{ReadOptions, Recording};
use recording::topics::{BEAT, FORCES, PHASES, STATE};
use recording::whole::Usage;
use recording::write::{ChannelId, RawChannel, RecordingWriter, WriteError, WriterOptions};
use sim::model::Model;
use sim::record::Recorder;
use sim::replay::{Course, Drive, Misfit, Options, Replay, Take, misfit};
use sim::run::{Listener, Sample, method_of, run_model, settings};
use sim::scene::{Scene, load, parse};
use sim::sensors::Reading;
use sim::solve::Stopped;
use std::collections::{BTreeMap, VecDeque};
use std::path::{Path, PathBuf};

/// Arguments of `sim replay`.
#[derive(clap::Args)]
#[command(after_help = HELP)]
pub struct Args {
    /// The recording (.mcap).
    file: PathBuf,
    /// The scene that is driven: a built-in one (see `sim scenes`) or the path of a TOML file, with as many carriers as the recording. Default:
    /// the scene attached to the recording; without one `music`.
    #[arg(long, value_name = "SCENE")]
    scene: Option<String>,
    /// What takes the oscillators' place.
    #[arg(long, value_enum, default_value_t = What::Phases)]
    drive: What,
    /// From, s after the recording's start. Default: where what drives begins.
    #[arg(long, value_name = "S", value_parser = seconds, allow_hyphen_values = true)]
    from: Option<f64>,
    /// To, s after the recording's start. Default: where what drives ends.
    #[arg(long, value_name = "S", value_parser = seconds, allow_hyphen_values = true)]
    to: Option<f64>,
    /// Left out of the misfit at the beginning, s. Default: 0 where the body, and poles and bristles with it, start as in the recording, else 3.
    #[arg(long, value_name = "S", value_parser = seconds, allow_hyphen_values = true)]
    settle: Option<f64>,
    #[command(flatten)]
    changes: Changes,
    /// Where to write. Default: FILE-replay.mcap here.
    #[arg(long, short, value_name = "FILE.mcap")]
    out: Option<PathBuf>,
    /// How the misfit is printed.
    #[arg(long, value_enum, default_value_t = Format::Table)]
    format: Format,
}

#[derive(Clone, Copy, clap::ValueEnum)]
enum What {
    /// The carriers' phases, through the scene's gait and lift.
    Phases,
    /// The carriers' shoulders themselves, from `/tf` as `sim record` writes it.
    Shoulders,
    /// The beat alone, from `/beat`: the scene's oscillators follow it.
    Beat,
}

const HELP: &str = "What drives is read from /carriers/phases, /tf and /beat. A field recording, in which the carriers wore inertial \
sensors, gets its phases and the body's measured motion from `analyze`, which writes them as /findings/phases and \
/findings/state; they are used where the other topics are missing:

  analyze field.mcap --one-clock --annotate found.mcap
  sim replay found.mcap --scene rath.toml

(without --one-clock where every device stamps by its own clock).

OUT holds the model's motion on the usual topics and the measured one on /measured/rath/state, /measured/carriers/phases, \
/measured/handles/forces and /measured/beat, all with the recording's stamps. Times that the scene itself names (onsets, \
turns) count from where the replay begins. The scene's frequency_spread, coupling, noise and feedback are off \
where phases or shoulders drive; the attached scene.toml is complete, and `sim record` runs it again.

Share is the SD of the difference over that of the measured motion: 0 is the same motion, 1 a model that does not move.

Examples:
  sim record music --out m.mcap && sim replay m.mcap
  sim replay m.mcap --set effects.contact.stiffness_n_per_m=4000
  sim replay found.mcap --scene rath.toml --from 20 --to 80 --format json
  sim replay m.mcap --drive beat --out beat.mcap";

/// The scene that is driven where nothing says which.
const USUAL: &str = "music";

/// Left out at the beginning where the body's start was not measured, s.
const SETTLE_S: f64 = 3.0;

/// How the recording was found.
pub enum Input {
    Whole,
    /// Damaged; what was left was used.
    Damaged,
}

/// Replays, records, compares.
pub fn run(args: &Args) -> Result<Input> {
    if args.file == Path::new("-") {
        let said = "-: a replay does not read standard input; expected the path of a recording";
        return Err(Usage(said.into()).into());
    }
    // What is given is read first, so that a slip in it does not wait for the recording.
    if let Some(scene) = &args.scene {
        load(scene, &args.changes.set)?;
    }
    let recording = Recording::open(&args.file, &ReadOptions::default())?;
    let name = args.file.display().to_string();
    let source = Source::of(args, &recording);
    let scene = source.scene(&args.changes.set)?;
    let take = Take::read(&recording)?;
    let made_by = match source {
        Source::Attached { .. } => source.scene(&[]).ok(),
        Source::Given(_) | Source::Usual => None,
    };
    let options = Options {
        drive: match args.drive {
            What::Phases => Drive::Phases,
            What::Shoulders => Drive::Shoulders,
            What::Beat => Drive::Beat,
        },
        made_by: made_by.as_ref(),
        from_s: args.from,
        to_s: args.to,
    };
    let replay = take
        .scene(&scene, &options)
        .map_err(|why| anyhow!("{name}: {why}"))?;
    tell_idle_settings(&args.changes.set, &scene, &replay, |set| {
        let without = source.scene(set).ok()?;
        let replayed = take.scene(&without, &options).ok()?.scene;
        Some((without, replayed))
    });
    let settle_s = match args.settle {
        Some(settle_s) => settle_s,
        None if replay.starts_as_measured => 0.0,
        None => SETTLE_S,
    };
    if settle_s >= replay.scene.duration_s {
        bail!(
            "--settle leaves {settle_s} s out, but the replay lasts {} s only",
            replay.scene.duration_s
        );
    }
    let window_s = [settle_s, replay.scene.duration_s];
    let out = args.out.clone().unwrap_or_else(|| {
        let stem = args.file.file_stem().unwrap_or_default().to_string_lossy();
        PathBuf::from(format!("{stem}-replay.mcap"))
    });
    super::is_file(&out)?;
    let scene = args.scene.as_ref().map(Path::new);
    let inputs: Vec<&Path> = [Some(&*args.file), scene].into_iter().flatten().collect();
    super::may_write(&out, "mcap", &inputs)?;
    let model = Model::new(&replay.scene);
    let mut both = play(&out, &model, &recording, &take, &replay, &name)?;
    let found: Vec<Misfit> = COMPARED
        .iter()
        .filter_map(|c| {
            let measured = c.of(&take, &replay)?;
            let mean = c.field != "position_m.z" || take.height_has_mean();
            let course = both.courses.get(c.signal)?;
            misfit(c.signal, &measured, course, window_s, mean, c.turn)
        })
        .collect();
    both.measured.write(i64::MAX, both.recorder.writer())?;
    (both.recorder.writer()).metadata("replay", &record(&name, &replay, &found))?;
    both.recorder.finish()?;
    recording::note!(
        "{}: {} s of {name} from {:.3} s on, driven by {} samples of {}",
        out.display(),
        replay.scene.duration_s,
        replay.stretch_s[0],
        replay.samples,
        replay.topic
    );
    if matches!(source, Source::Usual) {
        recording::note!(
            "sim: {name}: no scene is attached to it, so the scene `{USUAL}` was driven; --scene gives another"
        );
    }
    print(&match args.format {
        Format::Json => json(&name, &out.display().to_string(), &replay, window_s, &found)?,
        Format::Table => table(&take, &replay.scene.name, window_s, &found),
    })?;
    for loss in &take.losses {
        recording::note!("sim: {name}: {loss}");
    }
    Ok(if take.losses.is_empty() {
        Input::Whole
    } else {
        Input::Damaged
    })
}

/// Where the scene that is driven comes from.
enum Source<'a> {
    Given(&'a str),
    Attached { file: &'a Path, text: Vec<u8> },
    Usual,
}

impl<'a> Source<'a> {
    fn of(args: &'a Args, recording: &Recording) -> Self {
        match (&args.scene, recording.attachment("scene.toml")) {
            (Some(scene), _) => Self::Given(scene),
            (None, Some(text)) => Self::Attached {
                file: &args.file,
                text,
            },
            (None, None) => Self::Usual,
        }
    }

    /// The scene with these settings.
    fn scene(&self, set: &[String]) -> Result<Scene> {
        Ok(match self {
            Self::Given(scene) => load(scene, set)?,
            Self::Attached { file, text } => {
                let text = String::from_utf8_lossy(text);
                parse("scene.toml", &text, set).with_context(|| {
                    let file = file.display();
                    format!("{file}: the scene attached to it; give one with --scene")
                })?
            }
            Self::Usual => load(USUAL, set)?,
        })
    }
}

/// Says which settings change the scene but not its replay; `without` gives both with fewer settings, nothing where they cannot be.
fn tell_idle_settings(
    set: &[String],
    scene: &Scene,
    replay: &Replay,
    without: impl Fn(&[String]) -> Option<(Scene, Scene)>,
) {
    for k in 0..set.len() {
        let mut others = set.to_vec();
        let setting = others.remove(k);
        // A setting may ask for others, and then it does something.
        if let Some((other, replayed)) = without(&others)
            && other != *scene
            && replayed == replay.scene
        {
            recording::note!(
                "sim: --set {setting} changes nothing: in a replay the recording decides it"
            );
        }
    }
}

/// Runs the model to its end, and records it beside what was measured.
fn play<'m>(
    out: &Path,
    model: &'m Model,
    recording: &Recording,
    take: &Take,
    replay: &Replay,
    name: &str,
) -> Result<Both<'m>> {
    let writer = RecordingWriter::create(out, &WriterOptions::beside())?;
    let mut recorder = Recorder::at(model, writer, replay.epoch_ns)?;
    let measured = Measured::of(recording, take, replay, recorder.writer())?;
    let mut both = Both {
        recorder,
        measured,
        courses: COMPARED
            .iter()
            .map(|c| (c.signal, Course::default()))
            .collect(),
        epoch_ns: replay.epoch_ns,
        failed: None,
        progress: patient_bar(
            (replay.scene.duration_s * 1e3) as u64,
            "{wide_bar} {percent}% of the replay, {eta} left",
        ),
    };
    let (_, outcome) = run_model(
        model,
        method_of(&replay.scene),
        &settings(&replay.scene),
        &mut both,
    );
    both.progress.finish_and_clear();
    // The first that failed knows the cause.
    if let Some(error) = both.recorder.failure().or(both.failed.take()) {
        return Err(error.into());
    }
    match outcome {
        Ok(()) | Err(Stopped::ByObserver { .. }) => Ok(both),
        Err(error) => Err(error).with_context(|| {
            format!("the replay of {name} did not run to its end; no file was made")
        }),
    }
}

/// One line of what is compared.
struct Compared {
    signal: &'static str,
    field: &'static str,
    factor: f64,
    /// A whole turn, where it is an angle.
    turn: Option<f64>,
    modelled: fn(&Sample) -> f64,
}

/// Radians to degrees.
const DEG: f64 = 180.0 / std::f64::consts::PI;

const COMPARED: &[Compared] = &[
    Compared {
        signal: "height_m",
        field: "position_m.z",
        factor: 1.0,
        turn: None,
        modelled: |s| s.pose.position_m[2],
    },
    Compared {
        signal: "roll_deg",
        field: "roll_rad",
        factor: DEG,
        turn: Some(360.0),
        modelled: |s| s.pose.roll_pitch_yaw_rad()[0] * DEG,
    },
    Compared {
        signal: "pitch_deg",
        field: "pitch_rad",
        factor: DEG,
        turn: Some(360.0),
        modelled: |s| s.pose.roll_pitch_yaw_rad()[1] * DEG,
    },
    Compared {
        signal: "yaw_deg",
        field: "yaw_rad",
        factor: DEG,
        turn: Some(360.0),
        modelled: |s| s.pose.roll_pitch_yaw_rad()[2] * DEG,
    },
    Compared {
        signal: "force_n",
        field: "force_n",
        factor: 1.0,
        turn: None,
        modelled: |s| s.normal_n.iter().sum(),
    },
];

impl Compared {
    /// The measured course, in the unit of the comparison.
    fn of(&self, take: &Take, replay: &Replay) -> Option<Course> {
        let mut course = take.course(self.field, replay.stretch_s[0])?;
        // Exactly 0 throughout is a field that nobody filled in, or a coordinate that was held.
        if course.x.iter().all(|x| *x == 0.0) {
            return None;
        }
        course.x.iter_mut().for_each(|x| *x *= self.factor);
        Some(course)
    }
}

/// The recording's own messages that go along, and their channels.
struct Measured(VecDeque<(i64, ChannelId, Vec<u8>)>);

impl Measured {
    /// Those of the body, the carriers, the handles and the beat within the stretch, in order of time.
    fn of(
        recording: &Recording,
        take: &Take,
        replay: &Replay,
        writer: &mut RecordingWriter,
    ) -> Result<Self> {
        let mut channels: BTreeMap<usize, ChannelId> = BTreeMap::new();
        let phases = if replay.topic.ends_with("/phases") {
            &replay.topic
        } else {
            PHASES
        };
        for (from, to) in [
            (take.state_topic().unwrap_or(STATE), STATE),
            (phases, PHASES),
            (FORCES, FORCES),
            (BEAT, BEAT),
        ] {
            let all = recording.info().channels.iter().enumerate();
            for (k, c) in all.filter(|(_, c)| c.topic == from) {
                let channel = writer.raw_channel(&RawChannel {
                    topic: &format!("/measured{to}"),
                    ..RawChannel::from(c)
                })?;
                channels.insert(k, channel);
            }
        }
        // A nanosecond may have been rounded away.
        let end_ns = replay
            .epoch_ns
            .saturating_add((replay.scene.duration_s * 1e9).ceil() as i64);
        let mut out = Vec::new();
        let topics: Vec<&str> = channels
            .keys()
            .map(|k| recording.info().channels[*k].topic.as_str())
            .collect();
        recording.messages(&|topic| topics.contains(&topic), &mut |raw| {
            if let Some(channel) = channels.get(&raw.channel)
                && (replay.epoch_ns..=end_ns).contains(&raw.log_time_ns)
            {
                out.push((raw.log_time_ns, *channel, raw.data.to_vec()));
            }
        })?;
        out.sort_by_key(|(t, _, _)| *t);
        Ok(Self(out.into()))
    }

    /// Writes what was measured up to and including `until_ns`.
    fn write(&mut self, until_ns: i64, writer: &mut RecordingWriter) -> Result<(), WriteError> {
        while let Some((t_ns, channel, data)) = self.0.pop_front_if(|(t, _, _)| *t <= until_ns) {
            writer.message(channel, t_ns, &data[..])?;
        }
        Ok(())
    }
}

/// Records what the model does beside what was measured, and keeps what is compared.
struct Both<'m> {
    recorder: Recorder<'m>,
    measured: Measured,
    courses: BTreeMap<&'static str, Course>,
    epoch_ns: i64,
    failed: Option<WriteError>,
    progress: ProgressBar,
}

impl Listener for Both<'_> {
    fn sample(&mut self, s: &Sample) -> bool {
        self.progress.set_position((s.t_s * 1e3) as u64);
        let until_ns = self.epoch_ns + (s.t_s * 1e9).round() as i64;
        if let Err(error) = self.measured.write(until_ns, self.recorder.writer()) {
            self.failed = Some(error);
            return false;
        }
        for c in COMPARED {
            let course = self.courses.entry(c.signal).or_default();
            course.t_s.push(s.t_s);
            course.x.push((c.modelled)(s));
        }
        self.recorder.sample(s)
    }

    fn reading(&mut self, reading: &Reading<'_>) {
        self.recorder.reading(reading);
    }
}

/// The metadata record `replay`.
fn record(name: &str, replay: &Replay, found: &[Misfit]) -> BTreeMap<String, String> {
    let mut out: BTreeMap<String, String> = [
        ("file", name.to_owned()),
        ("topic", replay.topic.clone()),
        ("from_s", replay.stretch_s[0].to_string()),
        ("to_s", replay.stretch_s[1].to_string()),
    ]
    .map(|(k, v)| (k.to_owned(), v))
    .into();
    for m in found {
        out.insert(format!("misfit.{}", m.signal), m.rms.to_string());
    }
    out
}

fn json(
    name: &str,
    out: &str,
    replay: &Replay,
    window_s: [f64; 2],
    found: &[Misfit],
) -> Result<String> {
    let signals: serde_json::Map<String, serde_json::Value> = found
        .iter()
        .map(|m| {
            let mut value = serde_json::to_value(m)?;
            if let Some(map) = value.as_object_mut() {
                map.remove("signal");
            }
            Ok((m.signal.to_owned(), value))
        })
        .collect::<Result<_>>()?;
    let whole = serde_json::json!({
        "file": name,
        "out": out,
        "scene": replay.scene.name,
        "drive": {"topic": replay.topic, "samples": replay.samples, "stretch_s": replay.stretch_s},
        "starts_as_measured": replay.starts_as_measured,
        "window_s": window_s,
        "misfit": signals,
    });
    Ok(format!("{whole:#}\n"))
}

fn table(take: &Take, scene: &str, window_s: [f64; 2], found: &[Misfit]) -> String {
    use std::fmt::Write;
    if found.is_empty() {
        let why = match take.state_topic() {
            None => "the body's motion was not measured",
            Some(_) => "no measured motion of the body lies in this stretch",
        };
        return format!("nothing to compare: {why}\n");
    }
    let mut text = format!(
        "the scene `{scene}` against measurement, {:.2} to {:.2} s of the replay\n{:<10}{:>9}{:>13}{:>13}{:>13}{:>13}{:>9}{:>13}\n",
        window_s[0],
        window_s[1],
        "",
        "samples",
        "SD measured",
        "SD modelled",
        "RMS apart",
        "offset",
        "share",
        "correlation"
    );
    let some = |x: Option<f64>, digits: usize| {
        x.map_or_else(|| "–".to_owned(), |x| format!("{x:.digits$}"))
    };
    for m in found {
        let _ = writeln!(
            text,
            "{:<10}{:>9}{:>13.5}{:>13.5}{:>13.5}{:>13}{:>9}{:>13}",
            m.signal,
            m.samples,
            m.measured_sd,
            m.modelled_sd,
            m.rms,
            some(m.offset, 5),
            some(m.share, 4),
            some(m.correlation, 4)
        );
    }
    let against = |m: &&Misfit| m.signal == "roll_deg" && m.correlation.is_some_and(|r| r < -0.5);
    if found.iter().any(|m| against(&m)) {
        text.push_str(
            "the model rolls against the measured body: at half the beat roll has two phases, half a turn apart, and how it starts decides; \
             start elsewhere with --from, where the body rolls already\n",
        );
    }
    text
}
