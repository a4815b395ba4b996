//! `analyze FILE...`

use std::io::Write;
use std::path::{Path, PathBuf};
use std::time::Duration;

use analyze::examine::{Analysis, examine};
use analyze::quality::Quality;
use analyze::report;
use analyze::request::{DeviceClocks, Request};
use analyze::roles::{RolesFile, matches, meant};
use anyhow::{Context, bail};
use indicatif::{ProgressBar, ProgressFinish, ProgressStyle};
use recording::Kind;
use recording::read::{ReadOptions, Recording, STDIN};
use recording::whole::{self, Output, Usage};

use super::{AnalyzeArgs, Done, Format, annotate, complain, print};

pub(super) fn run(args: &AnalyzeArgs) -> anyhow::Result<Done> {
    let request = request(args)?;
    let single: [(_, _, &[&str]); 3] = [
        ("--out", &args.out, &["csv", "parquet"]),
        ("--annotate", &args.annotate, &["mcap"]),
        ("--report", &args.report, &["html", "htm"]),
    ];
    let named = |(option, path, endings)| {
        let path: &Option<PathBuf> = path;
        path.as_deref().map(|path| Output {
            option,
            path,
            endings,
        })
    };
    let outputs: Vec<Output<'_>> = single.into_iter().filter_map(named).collect();
    for Output { option, path, .. } in &outputs {
        if *path == Path::new("-") {
            return Err(Usage(format!(
                "{option}: standard output holds the result; name a file"
            ))
            .into());
        }
        if args.files.len() > 1 {
            return Err(Usage(format!(
                "{option} takes one recording, but {} were given: run it once for each",
                args.files.len()
            ))
            .into());
        }
    }
    let inputs = args.files.iter().chain(&args.roles).map(AsRef::as_ref);
    whole::may_write(&outputs, inputs)?;
    let mut analyses = Vec::new();
    let mut failed = false;
    for file in &args.files {
        match one(file, args, &request) {
            Ok(analysis) => analyses.push(analysis),
            Err(error) if args.files.len() > 1 => {
                complain(&error);
                failed = true;
            }
            Err(error) => return Err(error),
        }
    }
    #[cfg(feature = "figures")]
    if let Some(folder) = &args.figures {
        draw(&analyses, folder)?;
    }
    let text = match args.format {
        Format::Json => report::json(&analyses, args.files.len()),
        Format::Csv => report::csv(&analyses),
        Format::Table if analyses.len() == 1 => {
            report::table(&analyses[0], !request.signals.is_empty())
        }
        Format::Table => report::ensemble(&analyses),
    };
    print(&text)?;
    let mut whole = true;
    for damage in analyses.iter().filter_map(Analysis::damage) {
        whole = false;
        recording::note!("analyze: {damage}");
    }
    Ok(match (failed, whole) {
        (true, _) => Done::Partly,
        (false, false) => Done::WithLoss,
        (false, true) => Done::Well,
    })
}

fn request(args: &AnalyzeArgs) -> anyhow::Result<Request> {
    let roles = match &args.roles {
        None => None,
        Some(path) => Some(RolesFile::read(path).map_err(anyhow::Error::msg)?),
    };
    let window = args.window.unwrap_or((None, None));
    Ok(Request {
        window,
        signals: args.signal.clone(),
        topics: args.topic.clone(),
        roles,
        truth: args.truth,
        clocks: match args.one_clock {
            true => DeviceClocks::One,
            false => DeviceClocks::PutRight,
        },
        traces: args.draws(),
    })
}

/// Opens a recording, or what comes through standard input.
fn open(path: &Path, args: &AnalyzeArgs, request: &Request) -> anyhow::Result<Recording> {
    let limits = &args.limits;
    let options = ReadOptions {
        by_name: args.by_name || request.names_items(),
        max_chunk_bytes: limits.max_chunk_bytes,
        max_message_bytes: limits.max_message_bytes,
        max_items: limits.max_items,
        limits_are_options: true,
        ..ReadOptions::default()
    };
    if path.as_os_str() == "-" {
        let mut input = std::io::stdin().lock();
        return Ok(Recording::from_stream(&mut input, STDIN, &options)?);
    }
    let opened = Recording::open(path, &options);
    if opened.is_err()
        && !path.exists()
        && path
            .to_str()
            .is_some_and(|p| strsim::damerau_levenshtein(p, "ingest") <= 2)
    {
        bail!(
            "{}: there is no such file; did you mean `analyze ingest`?",
            path.display()
        );
    }
    Ok(opened?)
}

/// Files from this size on take longer than a second, bytes.
const LARGE: u64 = 64 << 20;

/// A sign of life on a terminal while a large file is analysed: how far that is nobody knows, for most of the work comes after reading.
fn alive(path: &Path) -> anyhow::Result<ProgressBar> {
    let bytes = std::fs::metadata(path).map_or(0, |file| file.len());
    if bytes < LARGE {
        return Ok(ProgressBar::hidden());
    }
    let style = ProgressStyle::with_template("{spinner} {msg}: {total_bytes}, {elapsed}")?;
    let bar = ProgressBar::new_spinner()
        .with_style(style)
        .with_message(path.display().to_string())
        .with_finish(ProgressFinish::AndClear);
    bar.set_length(bytes);
    bar.enable_steady_tick(Duration::from_millis(500));
    Ok(bar)
}

fn one(path: &Path, args: &AnalyzeArgs, request: &Request) -> anyhow::Result<Analysis> {
    let mut recording = open(path, args, request)?;
    let name = if path.as_os_str() == "-" {
        STDIN.to_owned()
    } else {
        path.display().to_string()
    };
    let alive = alive(path)?;
    let mut analysis = examine(&name, &recording, request)?;
    if recording.contradicts_its_summary() {
        recording = recording.searched();
        analysis = examine(&name, &recording, request)?;
    }
    drop(alive);
    if let Some(outside) = &analysis.outside {
        bail!("{name}: {outside}");
    }
    // Where all was read and there are no numbers, the topics are the answer.
    let asked = !request.signals.is_empty() || !request.topics.is_empty();
    let lost = analysis.quality.iter().any(|q| q.loss);
    if analysis.is_empty() && (asked || lost || analysis.messages == 0) {
        bail!("{}", nothing(&analysis, request));
    }
    for pattern in &request.topics {
        let names = || analysis.topics.iter().map(|t| t.name.as_str());
        if !names().any(|topic| matches(pattern, topic)) {
            let hint = meant(pattern, names());
            recording::note!("analyze: {name}: no topic fits {pattern}{hint}");
        }
    }
    for pattern in &request.signals {
        if !(analysis.signals.iter()).any(|(path, _)| matches(pattern, path)) {
            recording::note!("analyze: {name}: no numeric signal fits {pattern}");
        }
    }
    if let Some(out) = &args.out {
        let findings = analyze::table::write(&recording, request, args.downsample, out)?;
        let out = out.display();
        let limits = findings.iter().filter(|f| {
            matches!(
                f.kind,
                Kind::LongSequence | Kind::OddSchema | Kind::MixedItems
            )
        });
        for limit in limits.take(20) {
            recording::note!("analyze: {out}: {limit}");
        }
    }
    if let Some(out) = &args.report {
        // The figures' folder may be its place.
        #[cfg(feature = "figures")]
        if let Some(folder) = &args.figures {
            std::fs::create_dir_all(folder)
                .with_context(|| format!("{}: cannot be made", folder.display()))?;
        }
        let page = report::html(&analysis, &command_line());
        whole::write_whole(out, |file| file.write_all(page.as_bytes())).with_context(|| {
            format!(
                "{}: cannot be written; no file of that name was made or changed",
                out.display()
            )
        })?;
    }
    if let Some(out) = &args.annotate {
        annotate::write(&recording, &analysis, out)?;
    }
    Ok(analysis)
}

/// The figures of one recording into the folder; of several into a folder each, and those of all together beside them.
#[cfg(feature = "figures")]
fn draw(analyses: &[Analysis], folder: &Path) -> anyhow::Result<()> {
    use report::figures::figures;
    let mut written = 0;
    if let [one] = analyses {
        written += figures(&report::plots::plots(one), folder)?.len();
    } else {
        written += figures(&report::ensemble_plots(analyses), folder)?.len();
        for (k, a) in analyses.iter().enumerate() {
            let stem = Path::new(&a.file)
                .file_stem()
                .and_then(|s| s.to_str())
                .unwrap_or("recording");
            // Numbered: files of one name may come from several folders.
            written += figures(
                &report::plots::plots(a),
                &folder.join(format!("{:03}-{stem}", k + 1)),
            )?
            .len();
        }
    }
    recording::note!("analyze: {written} files written to {}", folder.display());
    Ok(())
}

/// The command line as it could be typed again.
fn command_line() -> String {
    let quoted = |arg: String| {
        let plain = !arg.is_empty()
            && arg
                .chars()
                .all(|c| c.is_alphanumeric() || "-_./=:,+@%".contains(c));
        if plain {
            arg
        } else {
            format!("'{}'", arg.replace('\'', "'\\''"))
        }
    };
    // A name that is no Unicode is shown as near as can be.
    let args = std::env::args_os()
        .skip(1)
        .map(|arg| quoted(arg.to_string_lossy().into_owned()));
    std::iter::once("analyze".to_owned())
        .chain(args)
        .collect::<Vec<_>>()
        .join(" ")
}

/// Why there is nothing to analyse.
fn nothing(a: &Analysis, request: &Request) -> String {
    let why: Vec<String> = (a.quality.iter())
        .filter(|q| q.loss || ["no_decoder", "long_sequence"].contains(&q.kind))
        .take(20)
        .map(Quality::told)
        .collect();
    let why = if why.is_empty() {
        String::new()
    } else {
        format!("; {}", why.join("; "))
    };
    if !request.signals.is_empty() || !request.topics.is_empty() {
        let asked: Vec<&str> = request
            .signals
            .iter()
            .chain(&request.topics)
            .map(String::as_str)
            .collect();
        let topics: Vec<&str> = a.topics.iter().map(|t| t.name.as_str()).take(20).collect();
        let found = match topics.is_empty() {
            true => "it has no topics that can be read".to_owned(),
            false => format!("its topics are {}", topics.join(", ")),
        };
        return format!(
            "{}: no numeric signal fits {}; {found}{why}",
            a.file,
            asked.join(", ")
        );
    }
    if a.messages == 0 {
        return format!("{}: holds no messages{why}", a.file);
    }
    if a.topics.is_empty() {
        return format!("{}: none of its messages can be read{why}", a.file);
    }
    let found: Vec<String> = a
        .topics
        .iter()
        .take(20)
        .map(|t| {
            let schema = match t.schema.as_str() {
                "" => "no schema",
                schema => schema,
            };
            format!("{} ({schema}, {})", t.name, t.encoding)
        })
        .collect();
    format!(
        "{}: holds no numeric signal that can be used; found {}{why}",
        a.file,
        found.join(", ")
    )
}
