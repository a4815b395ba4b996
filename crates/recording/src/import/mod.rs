//! Other people's logs turned into recordings: NumPy archives, phone apps, inertial sensors, any CSV, sound.
//!
//! [`ingest`] finds out what each file is. Inertial logs become `sensor_msgs/msg/Imu` in the convention of REP-145, WAV files
//! `foxglove.RawAudio`, several devices in one recording, in the order of time.

mod axivity;
mod date;
mod imu;
pub mod layout;
mod metabase;
pub mod npz;
mod phyphox;
mod sensor_logger;
mod shimmer;
mod table;
mod wav;
mod wrapping;
mod xsens;

use std::{
    collections::{BTreeMap, HashMap, HashSet},
    fs, io,
    io::Read,
    path::{Path, PathBuf},
};

use crate::{
    foreign,
    topics::MessageKind,
    write::{RecordingWriter, WriteError},
};

/// Why a log could not be turned into a recording. Nothing is left half-written.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ImportError {
    /// The log cannot be read.
    #[error("{name}: cannot be read: {cause}")]
    Io {
        /// The file.
        name: String,
        /// What the system said.
        cause: io::Error,
    },
    /// The log is not what it should be; the text says what was found and what was expected.
    #[error("{name}: {problem}")]
    Content {
        /// The file.
        name: String,
        /// What was found and expected.
        problem: String,
    },
    /// The recording cannot be written.
    #[error(transparent)]
    Write(#[from] WriteError),
}

impl ImportError {
    /// The same of a file in a folder or zip, named too.
    fn within(self, files: &str) -> Self {
        match self {
            Self::Content { name, problem } if name != files => Self::Content {
                name: format!("{files}: {name}"),
                problem,
            },
            other => other,
        }
    }
}

/// Whether a file is called so, in whatever folder.
fn is_called(file: &str, name: &str) -> bool {
    let file = file.replace('\\', "/");
    let folder = file.strip_suffix(name);
    folder.is_some_and(|folder| folder.is_empty() || folder.ends_with('/'))
}

/// What came of an ingestion.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Ingested {
    /// Topics and how many messages each got.
    pub topics: Vec<(String, u64)>,
    /// What was decided on the way (units, signs, gravity, clocks), one line each, with the file's name.
    pub notes: Vec<String>,
    /// What the files promise and do not hold, one line each.
    pub losses: Vec<String>,
}

/// What files do not tell of themselves.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ImportOptions<'a> {
    /// A built-in [`layout`] or a TOML file, for every CSV; without it the format is found out.
    pub layout: Option<&'a str>,
    /// When sound begins after the first inertial sample, s.
    pub sound_start_s: f64,
}

/// A log that takes more memory than this is refused: some fifteen hours of a device at 100 Hz.
const MAX_BYTES: u64 = 3 << 30;
/// What a row takes besides its cells, here and as a sample: 240 to 360 were measured.
const ROW_BYTES: u64 = 350;
/// What a cell takes besides its text.
const CELL_BYTES: u64 = 8;
/// Every text is held once as it is and once in cells.
const COPIES: u64 = 2;

/// About what a text takes with the rows that are made of it; a small zip may hold many short ones.
fn bytes_taken(text: &str) -> u64 {
    let count = |is: fn(u8) -> bool| text.bytes().filter(|byte| is(*byte)).count() as u64;
    let returns = text.matches("\r\n").count() as u64;
    let rows = count(|byte| matches!(byte, b'\n' | b'\r')) - returns;
    let cells = count(|byte| matches!(byte, b',' | b';' | b'\t'));
    COPIES * text.len() as u64 + CELL_BYTES * cells + ROW_BYTES * rows
}

/// The files of a log: one, or those of a folder or zip.
struct Files {
    name: String,
    texts: Vec<(String, String)>,
    /// Names of sounds beside them, which are not read here.
    sounds: Vec<String>,
    /// Names of what else is beside them, which is not read at all.
    others: Vec<String>,
}

impl Files {
    fn texts(&self) -> impl Iterator<Item = (&str, &str)> {
        self.texts
            .iter()
            .map(|(name, text)| (name.as_str(), text.as_str()))
    }

    /// The one text that `is` holds for; an error where there are two of `what`, for nothing tells which belongs to the others.
    fn only(
        &self,
        what: &str,
        is: impl Fn(&str, &str) -> bool,
    ) -> Result<Option<(&str, &str)>, ImportError> {
        let mut found = self.texts().filter(|(name, text)| is(name, text));
        let first = found.next();
        match (first, found.next()) {
            (Some((one, _)), Some((other, _))) => Err(self.two(what, one, other)),
            _ => Ok(first),
        }
    }

    /// Two files of what one device has once.
    fn two(&self, what: &str, one: &str, other: &str) -> ImportError {
        let folder = |path: &str| path.len() - file_name(path).len();
        let advice = match one[..folder(one)] == other[..folder(other)] {
            true => "give each device a folder of its own",
            false => "give each folder by itself",
        };
        ImportError::Content {
            name: self.name.clone(),
            problem: format!(
                "has two files with {what}, {one} and {other}; expected those of one device: {advice}"
            ),
        }
    }
}

/// The last part of a path in whatever system's writing.
fn file_name(path: &str) -> &str {
    path.rsplit(['/', '\\']).next().unwrap_or_default()
}

/// Whether a line near the text's beginning is such a header.
fn has_header(text: &str, is_header: impl Fn(&str) -> bool) -> bool {
    text.lines().take(HEADER_LINES).any(is_header)
}

/// Turns logs into one recording; `writer` has had no message yet, and the caller finishes it.
///
/// A `.npz` is a log of the published archive and stands alone.
///
/// # Errors
/// Says in one sentence which file, what was found and what was expected.
pub fn ingest(
    paths: &[PathBuf],
    options: &ImportOptions<'_>,
    writer: &mut RecordingWriter,
) -> Result<Ingested, ImportError> {
    let is_npz = |path: &&PathBuf| {
        let extension = path.extension().unwrap_or_default();
        extension.eq_ignore_ascii_case("npz")
    };
    if let Some(path) = paths.iter().find(is_npz) {
        let beside = [
            (paths.len() > 1, "another log"),
            (options.layout.is_some(), "a layout"),
            (options.sound_start_s != 0.0, "a start of the sound"),
        ];
        if let Some((_, beside)) = beside.into_iter().find(|(there, _)| *there) {
            return Err(ImportError::Content {
                name: path.display().to_string(),
                problem: format!(
                    "is a log of the archive, which stands alone; found {beside} beside it"
                ),
            });
        }
        let messages = npz::ingest(path, writer)?;
        let topics = [
            crate::topics::STATE,
            crate::topics::PHASES,
            crate::topics::FORCES,
            crate::topics::TF,
        ];
        return Ok(Ingested {
            topics: topics.map(|topic| (topic.to_owned(), messages / 4)).into(),
            notes: vec!["the archive's axes were turned: (x, y, z) became (x, -z, y); its pitch is yaw here".to_owned()],
            losses: Vec::new(),
        });
    }
    let mut seen = HashSet::new();
    for path in paths {
        if !seen.insert(fs::canonicalize(path).unwrap_or_else(|_| path.clone())) {
            return Err(ImportError::Content {
                name: path.display().to_string(),
                problem: "is given twice; expected each log once".to_owned(),
            });
        }
    }
    let layout = options.layout.map(layout::find).transpose()?;
    let (mut logs, mut sounds) = (Vec::new(), Vec::new());
    let (mut notes, mut beside) = (Vec::new(), Vec::new());
    let mut metadata: BTreeMap<String, String> = [
        ("version".to_owned(), env!("CARGO_PKG_VERSION").to_owned()),
        ("source".to_owned(), "field".to_owned()),
    ]
    .into();
    let mut note = |path: &Path, topic: &str, said: &[String]| {
        notes.extend(said.iter().map(|n| format!("{}: {n}", path.display())));
        if !said.is_empty() {
            metadata.insert(format!("notes.{topic}"), said.join("; "));
        }
    };
    let (mut devices, mut recorders) = (HashMap::new(), HashMap::new());
    for path in paths {
        if wav::is_wav(path)? {
            let mut sound = wav::Sound::open(path)?;
            sound.name = unique(&mut recorders, sound.name);
            note(path, &sound.topic(), &sound.notes);
            sounds.push(sound);
            continue;
        }
        wav::refuse(path)?;
        let files = open(path, MAX_BYTES)?;
        let read = read(&files, layout.as_ref()).map_err(|error| error.within(&files.name))?;
        for mut log in read {
            log.name = unique(&mut devices, log.name);
            note(path, &log.topic(), &log.notes);
            logs.push(log);
        }
        beside.extend(files.sounds.iter().map(|sound| {
            format!(
                "{}: {sound} is left out: sound is given as a file of its own",
                path.display()
            )
        }));
        if !files.others.is_empty() {
            const MOST: usize = 8;
            let more = files.others.len().saturating_sub(MOST);
            let named = files.others.iter().take(MOST).cloned();
            let more = (more > 0).then(|| format!("{more} more"));
            let others = Vec::from_iter(named.chain(more)).join(", ");
            beside.push(format!(
                "{}: left out, for they are no files of CSV or text: {others}",
                path.display()
            ));
        }
    }
    notes.extend(beside);
    notes.extend(undated(&logs));
    notes.extend(halves(&logs));
    let first_ns = logs
        .iter()
        .flat_map(|log| log.samples.iter().map(|s| s.t_ns))
        .min();
    let start_ns = first_ns
        .unwrap_or(0)
        .saturating_add((options.sound_start_s * 1e9).round() as i64);
    for sound in &mut sounds {
        sound.start_ns = start_ns;
        if first_ns.is_some() {
            notes.push(format!(
                "{}: a WAV file does not know when it began: it is put {} s after the first inertial sample",
                sound.name, options.sound_start_s
            ));
        }
    }
    writer.metadata("rath", &metadata)?;
    let topics = write(&logs, &mut sounds, writer)?;
    let losses = sounds
        .iter()
        .filter_map(|s| Some(format!("{}: {}", s.name, s.loss()?)))
        .collect();
    Ok(Ingested {
        topics,
        notes,
        losses,
    })
}

/// Two devices of one name stay two: the name, or the first of `name_2`, `name_3`, … that is not taken. `taken` holds names with the next number.
fn unique(taken: &mut HashMap<String, u64>, name: String) -> String {
    let mut found = name.clone();
    while taken.contains_key(&found) {
        let number = taken.entry(name.clone()).or_insert(2);
        found = format!("{name}_{number}");
        *number += 1;
    }
    taken.insert(found.clone(), 2);
    found
}

/// Writes logs and sounds as one recording, in the order of time. Returns topics and how many messages each got.
fn write(
    logs: &[imu::Log],
    sounds: &mut [wav::Sound],
    writer: &mut RecordingWriter,
) -> Result<Vec<(String, u64)>, ImportError> {
    let mut topics: Vec<(String, u64)> = Vec::new();
    let mut channels = Vec::new();
    let of_logs = logs.iter().map(|log| (log.topic(), MessageKind::Imu));
    let of_sounds = sounds.iter().map(|s| (s.topic(), MessageKind::RawAudio));
    for (topic, kind) in of_logs.chain(of_sounds) {
        channels.push(writer.channel(&topic, kind)?);
        topics.push((topic, 0));
    }
    // Time, device, sample; sounds are devices behind the logs.
    let mut order: Vec<(i64, usize, usize)> = Vec::new();
    for (device, log) in logs.iter().enumerate() {
        let samples = log.samples.iter().enumerate();
        order.extend(samples.map(|(row, sample)| (sample.t_ns, device, row)));
    }
    for (number, sound) in sounds.iter().enumerate() {
        let blocks = sound.block_times().enumerate();
        order.extend(blocks.map(|(block, t_ns)| (t_ns, logs.len() + number, block)));
    }
    order.sort_unstable();
    for (t_ns, device, row) in order {
        match logs.get(device) {
            Some(log) => {
                writer.message(channels[device], t_ns, &log.samples[row].message(&log.name))?;
            }
            None => match sounds[device - logs.len()].block(t_ns) {
                Some(block) => writer.message(channels[device], t_ns, &block)?,
                None => continue,
            },
        }
        topics[device].1 += 1;
    }
    Ok(topics)
}

/// A kind of log, known by its header.
struct Format {
    name: &'static str,
    is_header: fn(&str) -> bool,
    /// How the names of its own files end that have another header.
    beside: &'static [&'static str],
    device: Device,
}

/// What holds a device.
#[derive(Clone, Copy)]
enum Device {
    /// All files of a folder or zip.
    Folder(fn(&Files) -> Result<imu::Log, ImportError>),
    /// Each file, by name and text.
    File(fn(&str, &str) -> Result<imu::Log, ImportError>),
}

/// The kinds of log that are known without a layout; a file that fits two is of the first.
const FORMATS: &[Format] = &[
    Format {
        name: "Sensor Logger",
        is_header: sensor_logger::is_header,
        beside: &["Metadata.csv"],
        device: Device::Folder(sensor_logger::read),
    },
    Format {
        name: "phyphox",
        is_header: phyphox::is_header,
        beside: &["meta/time.csv", "meta/device.csv"],
        device: Device::Folder(phyphox::read),
    },
    Format {
        name: "Movella DOT / Xsens",
        is_header: xsens::is_header,
        beside: &[],
        device: Device::File(xsens::read),
    },
    Format {
        name: "Shimmer",
        is_header: shimmer::is_header,
        beside: &[],
        device: Device::File(shimmer::read),
    },
    Format {
        name: "MetaBase",
        is_header: metabase::is_header,
        beside: &[],
        device: Device::Folder(metabase::read),
    },
];

/// A header stands among so many first lines.
const HEADER_LINES: usize = 50;

/// The devices of a file, folder or zip, none of them empty.
fn read(files: &Files, layout: Option<&layout::Layout>) -> Result<Vec<imu::Log>, ImportError> {
    let folders: Vec<_> = FORMATS
        .iter()
        .filter_map(|format| match format.device {
            Device::Folder(read) if layout.is_none() => Some((format, read)),
            _ => None,
        })
        .filter(|(format, _)| {
            files
                .texts()
                .any(|(_, text)| has_header(text, format.is_header))
        })
        .collect();
    let (mut devices, mut others) = (Vec::new(), Vec::new());
    for &(_, read) in &folders {
        let read: Reader = Box::new(move |_, _| read(files));
        devices.push((files.name.as_str(), "", read));
    }
    let fits = |text: &str| layout.is_some_and(|layout| layout::fits(layout, text));
    let any_fits = files.texts().any(|(_, text)| fits(text));
    for (name, text) in files.texts() {
        if folders
            .iter()
            .any(|(format, _)| has_header(text, format.is_header))
        {
            continue;
        }
        let of_app = || {
            let mut beside = folders.iter().flat_map(|(format, _)| format.beside);
            beside.any(|beside| is_called(name, beside))
        };
        match layout {
            Some(_) if any_fits && !fits(text) => others.push(name),
            // Where none fits, the first says what it lacks.
            Some(layout) => {
                let read: Reader = Box::new(|name, text| layout::read(layout, name, text));
                devices.push((name, text, read));
            }
            None => match reader(text) {
                Some(read) => devices.push((name, text, read)),
                None if of_app() => {}
                None => others.push(name),
            },
        }
    }
    if devices.is_empty() {
        return Err(unknown(files));
    }
    let is_alone = devices.len() == 1;
    let (mut logs, mut empty) = (Vec::new(), Vec::new());
    for (name, text, read) in devices {
        // What is alone is called as the folder or zip that it is in.
        let name = if is_alone { &files.name } else { name };
        let mut log = read(name, text)?;
        if log.samples.is_empty() {
            empty.push(name);
            continue;
        }
        if name != files.name {
            for note in &mut log.notes {
                *note = format!("{name}: {note}");
            }
        }
        logs.push(log);
    }
    if let Some(log) = logs.iter().find(|log| has_lost_its_times(log)) {
        let problem = format!(
            "has {} samples with hardly any times between them (the first is {:.3} s); expected a time for each: have they lost their digits, as in 1.53859E+12?",
            log.samples.len(),
            log.samples[0].t_ns as f64 / 1e9
        );
        return Err(ImportError::Content {
            name: files.name.clone(),
            problem,
        });
    }
    let Some(first) = logs.first_mut() else {
        return Err(ImportError::Content {
            name: empty[0].to_owned(),
            problem: "has a header but no rows; expected at least one sample".to_owned(),
        });
    };
    first.notes.extend(empty.into_iter().map(without_rows));
    if !others.is_empty() {
        first.notes.push(format!(
            "of no kind that is known, and left out: {}",
            others.join(", ")
        ));
    }
    Ok(logs)
}

/// A clock of whole seconds gives no more samples one time.
const MOST_OF_ONE_TIME: usize = 2000;
/// And so many have more than two.
const SEVERAL: usize = 100;

/// Whether next to none of many samples has a time of its own.
fn has_lost_its_times(log: &imu::Log) -> bool {
    let times = log.samples.chunk_by(|a, b| a.t_ns == b.t_ns).count();
    let all = log.samples.len();
    all > times * MOST_OF_ONE_TIME || times <= 2 && all > SEVERAL
}

/// The note for a file in which nothing was logged, beside others.
fn without_rows(name: &str) -> String {
    format!("{name}: has a header but no rows, and is left out")
}

/// Reads a device's file, by name and text.
type Reader<'a> = Box<dyn Fn(&str, &str) -> Result<imu::Log, ImportError> + 'a>;

/// Who reads a file that is a device of its own.
fn reader(text: &str) -> Option<Reader<'static>> {
    let of_format = |format: &Format| match format.device {
        Device::File(read) if has_header(text, format.is_header) => Some(Box::new(read) as Reader),
        _ => None,
    };
    if let Some(read) = FORMATS.iter().find_map(of_format) {
        return Some(read);
    }
    if let Some(layout) = layout::fitting(text) {
        return Some(Box::new(move |name, text| {
            layout::read(&layout, name, text)
        }));
    }
    // Without a header to know it by, it comes last.
    axivity::is_export(text).then(|| Box::new(axivity::read) as Reader)
}

/// Says that no file is of a kind that is known.
fn unknown(files: &Files) -> ImportError {
    let content = |problem| ImportError::Content {
        name: files.name.clone(),
        problem,
    };
    if files.texts.is_empty() {
        return content("has no CSV in it; expected a log".to_owned());
    }
    let head = |(_, text): (&str, &str)| {
        let line = text.lines().next().unwrap_or_default();
        format!("{:?}", line.chars().take(120).collect::<String>())
    };
    let heads: Vec<String> = files.texts().take(8).map(head).collect();
    let layouts = layout::BUILT_IN.iter().map(|(name, _)| *name);
    let known: Vec<&str> = FORMATS
        .iter()
        .map(|f| f.name)
        .chain(layouts)
        .chain([axivity::NAME])
        .collect();
    content(format!(
        "is no log of {}, and no layout is given; found {}",
        known.join(", "),
        heads.join(", ")
    ))
}

/// Reads the texts of a file, folder or zip, which may take so many bytes of memory in all.
fn open(path: &Path, most_bytes: u64) -> Result<Files, ImportError> {
    let name = path.display().to_string();
    let io = |cause| ImportError::Io {
        name: name.clone(),
        cause,
    };
    let content = |problem: String| ImportError::Content {
        name: name.clone(),
        problem,
    };
    let mut left = most_bytes;
    let mut text = |from: &mut dyn Read, what: &str| -> Result<String, ImportError> {
        let mut bytes = Vec::new();
        from.take(left / COPIES + 1)
            .read_to_end(&mut bytes)
            .map_err(|error| content(format!("{what} cannot be read: {error}")))?;
        let text = decoded(bytes);
        left = left.checked_sub(bytes_taken(&text)).ok_or_else(|| {
            let most = most_bytes as f64 / f64::from(1 << 30);
            content(format!(
                "its rows take more than {most:.1} GiB of memory, the limit; give the files in it one by one, or split it (`analyze merge` puts recordings together)"
            ))
        })?;
        Ok(text)
    };
    let (mut texts, mut sounds, mut others) = (Vec::new(), Vec::new(), Vec::new());
    let mut is_log = |name: &str, is_file: bool| {
        // Hidden files are a system's own: macOS puts one beside each file of a zip.
        if file_name(name).starts_with('.') {
            return false;
        }
        let is_log = is_file && is_text(name);
        if is_file && wav::is_named(name) {
            sounds.push(file_name(name).to_owned());
        } else if !is_log {
            others.push(name.to_owned());
        }
        is_log
    };
    if path.is_dir() {
        // Apps put at most one level of folders (`meta`) beside their tables.
        for inside in ["", "meta/"] {
            let folder = path.join(inside);
            if !folder.is_dir() {
                continue;
            }
            let mut entries = fs::read_dir(&folder)
                .map_err(io)?
                .collect::<Result<Vec<_>, _>>()
                .map_err(io)?;
            entries.sort_by_key(fs::DirEntry::file_name);
            for entry in entries {
                let what = format!("{inside}{}", entry.file_name().to_string_lossy());
                // A pipe may never end; links are followed.
                let is_file = entry.path().is_file();
                if what == "meta" || !is_log(&what, is_file) {
                    continue;
                }
                let mut file = fs::File::open(entry.path()).map_err(io)?;
                let read = text(&mut file, &what)?;
                texts.push((what, read));
            }
        }
        return Ok(Files {
            name,
            texts,
            sounds,
            others,
        });
    }
    let mut file = fs::File::open(path).map_err(io)?;
    let mut head = Vec::new();
    (&file).take(8).read_to_end(&mut head).map_err(io)?;
    io::Seek::rewind(&mut file).map_err(io)?;
    if let Some(kind) = foreign::kind(&head) {
        return Err(content(format!("is {kind}")));
    }
    // One without entries begins with its end.
    if head.starts_with(b"PK\x03\x04") || head.starts_with(b"PK\x05\x06") {
        let entries = entries_of(&mut file).map_err(io)?;
        let mut zip = zip::ZipArchive::new(io::BufReader::new(file))
            .map_err(|error| content(format!("is no zip: {error}")))?;
        // The library keeps the last of several entries with one name.
        if entries.is_some_and(|entries| entries > zip.len()) {
            return Err(content(
                "holds several files of one name, of which all but one would be lost; unpack it and give each a folder of its own".to_owned(),
            ));
        }
        for position in 0..zip.len() {
            let mut entry = zip
                .by_index(position)
                .map_err(|error| content(format!("cannot be unpacked: {error}")))?;
            let entry_name = entry.name().to_owned();
            if entry_name == "xl/workbook.xml" {
                return Err(content(format!("is {}", foreign::EXCEL)));
            }
            if entry.is_dir() || !is_log(&entry_name, true) {
                continue;
            }
            let read = text(&mut entry, &entry_name)?;
            texts.push((entry_name, read));
        }
        return Ok(Files {
            name,
            texts,
            sounds,
            others,
        });
    }
    let read = text(&mut file, "it")?;
    if read.trim().is_empty() {
        return Err(content("is empty; expected a log".to_owned()));
    }
    texts.push((name.clone(), read));
    Ok(Files {
        name,
        texts,
        sounds,
        others,
    })
}

/// How many entries a zip says that it has, up to the 65,534 that this place has room for. The file is left at its beginning.
fn entries_of(file: &mut fs::File) -> io::Result<Option<usize>> {
    // The record at the end has 22 bytes, of which 10 and 11 count, and up to 64 KiB of comment behind them.
    let length = file.metadata()?.len();
    io::Seek::seek(
        file,
        io::SeekFrom::Start(length.saturating_sub(22 + 65_535)),
    )?;
    let mut end = Vec::new();
    file.read_to_end(&mut end)?;
    io::Seek::rewind(file)?;
    let record = end.windows(12).rev().find(|w| w.starts_with(b"PK\x05\x06"));
    let count = record.map(|w| u16::from_le_bytes([w[10], w[11]]));
    Ok(count.filter(|count| *count != u16::MAX).map(usize::from))
}

/// UTF-8, without its byte order mark; UTF-16 by that, as spreadsheets write it; or else Latin-1.
fn decoded(mut bytes: Vec<u8>) -> String {
    let utf_16 = |unit: fn([u8; 2]) -> u16| {
        let units: Vec<u16> = bytes[2..].as_chunks().0.iter().map(|b| unit(*b)).collect();
        String::from_utf16_lossy(&units)
    };
    match bytes[..] {
        [0xff, 0xfe, ..] => return utf_16(u16::from_le_bytes),
        [0xfe, 0xff, ..] => return utf_16(u16::from_be_bytes),
        [0xef, 0xbb, 0xbf, ..] => drop(bytes.drain(..3)),
        _ => {}
    }
    String::from_utf8(bytes)
        .unwrap_or_else(|error| error.as_bytes().iter().map(|b| char::from(*b)).collect())
}

fn is_text(name: &str) -> bool {
    let name = name.to_lowercase();
    name.ends_with(".csv") || name.ends_with(".txt")
}

/// Devices that count from their own start cannot be put beside those that know the date: a note for each, where both are there.
fn undated(logs: &[imu::Log]) -> Vec<String> {
    // Nobody dates a log of this kind before 2001.
    let dated = |log: &&imu::Log| {
        let first = log.samples.first();
        first.is_some_and(|sample| sample.t_ns >= 1_000_000_000_000_000_000)
    };
    if !logs.iter().any(|log| dated(&log)) {
        return Vec::new();
    }
    let undated = logs.iter().filter(|log| !dated(log));
    undated
        .map(|log| {
            format!(
                "{}: its times count from the device's start, not from 1970 as those of others here: the clocks are not on each other",
                log.name
            )
        })
        .collect()
}

/// Files of single sensors are devices of their own, and neither half of a device tells how it moves: a note where both are there.
fn halves(logs: &[imu::Log]) -> Option<String> {
    let without = |what: fn(&imu::Sample) -> bool| {
        let half = |log: &&imu::Log| !log.samples.iter().any(what);
        logs.iter().find(half).map(|log| log.name.as_str())
    };
    let (rate, force) = (
        without(|s| s.force.is_some())?,
        without(|s| s.rate.is_some())?,
    );
    Some(format!(
        "{rate} has no acceleration and {force} no angular velocity: if they are of one device, give the zip or the folder that they come from instead"
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_rows_take_is_counted_before_it_is_taken() {
        assert_eq!(bytes_taken("a;b\r\n1,2\n"), 18 + 16 + 700);
        assert_eq!(bytes_taken("1\r2\r"), 8 + 700);
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("short.zip");
        let mut zip = zip::ZipWriter::new(fs::File::create(&path).expect("creates"));
        zip.start_file("a.csv", zip::write::SimpleFileOptions::default())
            .expect("starts");
        io::Write::write_all(&mut zip, "1,2\n".repeat(10_000).as_bytes()).expect("writes");
        zip.finish().expect("finishes");
        let said = open(&path, 3_000_000).err().expect("refused").to_string();
        assert!(
            said.ends_with("short.zip: its rows take more than 0.0 GiB of memory, the limit; give the files in it one by one, or split it (`analyze merge` puts recordings together)"),
            "{said}"
        );
        assert!(open(&path, 4_000_000).is_ok());
    }
}
