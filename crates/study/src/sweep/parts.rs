//! The folder of a study: parts that appear whole, and the table that they make together.
//!
//! ```text
//! DIR/study.toml, DIR/scene.toml     the study and its base scene, complete: `study DIR/study.toml` repeats it anywhere
//! DIR/parts/000000000-000000016.parquet …   runs 0 … 15 …, written by whoever computed them
//! DIR/runs.parquet                   all of them, by `merge`
//! ```
//! The blocks follow from the study alone, so the parts are the same files for any number of threads and any sharding.

use super::Plan;
use super::shard::Shard;
use super::summary::{Found, Summary};
use super::table::{Cell, Notes, Reader, Writer};
use crate::pool::{in_order, threads};
use parquet::errors::ParquetError;
use recording::read::ends_whole;
use recording::text::word;
use recording::whole::Sink;
use sim::record::VERSION;
use std::cell::Cell as Flag;
use std::io::{BufWriter, Write};
use std::ops::Range;
use std::panic::{AssertUnwindSafe, catch_unwind, set_hook, take_hook};
use std::path::{Path, PathBuf};
use std::sync::Once;
use std::sync::atomic::AtomicBool;
use std::time::Duration;

/// Rows of a row group of the merged table.
const GROUP_ROWS: usize = 16_384;
/// An unfinished file that has not grown for so long is nobody's any more. A younger one may be of another process at the same study.
const LEFT: Duration = Duration::from_secs(3600);

/// A study's folder.
pub struct Store<'p> {
    plan: &'p Plan,
    folder: PathBuf,
}

/// What there is of a study.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Progress {
    /// Blocks without a part.
    pub missing: Vec<u64>,
    /// Runs in parts.
    pub runs: u64,
    /// Of these, runs without a result.
    pub failed: u64,
    /// What is wrong with the parts of missing blocks that are there but damaged, a sentence each.
    pub damaged: Vec<String>,
}

/// What writing a block's parts came to.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Written {
    /// Parts.
    pub parts: u64,
    /// Runs in them.
    pub runs: u64,
    /// Of these, runs without a result.
    pub failed: u64,
}

type Outcome<T> = Result<T, String>;

/// The lock of a study's folder.
const LOCK: &str = ".lock";
/// So often a folder is claimed while others write their study into it.
const CLAIMS: u32 = 20;

/// A folder that is a study's as long as this is held.
#[derive(Debug)]
pub struct Claim(#[expect(dead_code, reason = "held for its lock")] Option<std::fs::File>);

impl<'p> Store<'p> {
    /// The folder of `plan`; nothing is made yet.
    pub fn new(plan: &'p Plan, folder: &Path) -> Self {
        Self {
            plan,
            folder: folder.into(),
        }
    }

    /// The merged table.
    pub fn table(&self) -> PathBuf {
        self.folder.join("runs.parquet")
    }

    /// Whether the merged table is there, and of this very study.
    pub fn is_merged(&self) -> bool {
        let ours = |reader: Reader| {
            let is = |(name, text): &(String, String)| reader.note(name) == Some(text);
            reader.rows == self.plan.runs() && self.notes().iter().all(is)
        };
        unharmed(|| Reader::open(&self.table())).is_ok_and(ours)
    }

    fn part(&self, block: u64) -> PathBuf {
        let range = self.plan.block(block);
        let name = format!("{:09}-{:09}.parquet", range.start, range.end);
        self.folder.join("parts").join(name)
    }

    fn notes(&self) -> Notes {
        vec![
            ("study".into(), self.plan.text()),
            ("scene".into(), self.plan.scene_text().into()),
            ("version".into(), VERSION.into()),
        ]
    }

    /// Makes the folder and writes the study into it. As long as what is returned is held, no other study takes the folder.
    ///
    /// # Errors
    /// What the system says; that the folder holds parts of another study, or files of these names that are no study's; that another study is
    /// being computed there.
    pub fn create(&self) -> Outcome<Claim> {
        let parts = self.folder.join("parts");
        self.may_be_ours()?;
        std::fs::create_dir_all(&parts)
            .map_err(|e| format!("{}: cannot be made: {e}", parts.display()))?;
        let lock = std::fs::File::create(self.folder.join(LOCK)).ok();
        for _ in 0..CLAIMS {
            // Who writes a study is alone, who computes one is not: shards are of one study. Where the disk knows no locks there are none.
            let alone = lock.as_ref().map(std::fs::File::try_lock);
            if !matches!(alone, Some(Err(std::fs::TryLockError::WouldBlock))) {
                self.write_study()?;
            }
            if let Some(lock) = &lock {
                let _ = lock.unlock();
                let _ = lock.lock_shared();
            }
            if self.is_written() {
                return Ok(Claim(lock));
            }
            if let Some(lock) = &lock {
                let _ = lock.unlock();
            }
        }
        Err(format!(
            "{}: another study is being computed there; choose another --out",
            self.folder.display()
        ))
    }

    fn files(&self) -> [(&'static str, String); 2] {
        [
            ("study.toml", self.plan.text()),
            ("scene.toml", self.plan.scene_text().to_owned()),
        ]
    }

    /// Whether the study in the folder is this one.
    fn is_written(&self) -> bool {
        let is = |(name, text): &(&str, String)| {
            std::fs::read(self.folder.join(name)).is_ok_and(|found| found == text.as_bytes())
        };
        self.files().iter().all(is)
    }

    /// Whether nothing of anybody else's stands where the study goes.
    fn may_be_ours(&self) -> Outcome<()> {
        let parts = self.folder.join("parts");
        let ours = parts.is_dir();
        let held = std::fs::read_dir(&parts).is_ok_and(|mut entries| entries.next().is_some());
        for (name, text) in &self.files() {
            let path = self.folder.join(name);
            let there = std::fs::read(&path).unwrap_or_else(|_| text.clone().into());
            if there != text.as_bytes() && (held || !ours) {
                let what = match held {
                    true => format!(
                        "is of another study, whose parts are there: {}; choose another --out, or delete the folder",
                        first_differences(&String::from_utf8_lossy(&there), text)
                    ),
                    false => {
                        "is there already, and this study would write its own there; choose another --out".into()
                    }
                };
                return Err(format!("{}: {what}", path.display()));
            }
        }
        Ok(())
    }

    fn write_study(&self) -> Outcome<()> {
        self.may_be_ours()?;
        for (name, text) in &self.files() {
            let path = self.folder.join(name);
            write_whole(&path, |file| Ok(file.write_all(text.as_bytes())?))?;
        }
        if self.plan.spec.recordings {
            let kept = self.recordings();
            std::fs::create_dir_all(&kept)
                .map_err(|e| format!("{}: cannot be made: {e}", kept.display()))?;
        }
        Ok(())
    }

    /// Which blocks of a shard are there, with their recordings where the study keeps them.
    ///
    /// # Errors
    /// A part that cannot be read, or that another study or another version of the program wrote.
    pub fn progress(&self, shard: Shard) -> Outcome<Progress> {
        self.parts(shard, self.plan.spec.recordings)
            .map_err(elsewhere)
    }

    /// As [`Store::progress`], asking for recordings or not.
    pub(super) fn parts(&self, shard: Shard, with_recordings: bool) -> Result<Progress, Foreign> {
        let mut found = Progress::default();
        for block in shard.of(self.plan.blocks()) {
            let rows = match self.part_rows(block) {
                Ok(Some(rows)) => rows,
                Ok(None) => {
                    found.missing.push(block);
                    continue;
                }
                Err(NoPart::Damaged(why)) => {
                    found.missing.push(block);
                    found.damaged.push(why);
                    continue;
                }
                Err(NoPart::Foreign(why)) => return Err(why),
            };
            if with_recordings && !self.recorded(&rows) {
                found.missing.push(block);
                continue;
            }
            found.runs += rows.len() as u64;
            found.failed += failed(&rows);
        }
        Ok(found)
    }

    /// The rows of a block's part; none where there is none.
    ///
    /// # Errors
    /// Why the part is not taken.
    pub(super) fn part_rows(&self, block: u64) -> Result<Option<Vec<Vec<Cell>>>, NoPart> {
        let path = self.part(block);
        if !path.exists() {
            return Ok(None);
        }
        let damaged =
            |why: ParquetError| NoPart::Damaged(format!("{}: is damaged: {why}", path.display()));
        let part = unharmed(|| Reader::open(&path)).map_err(damaged)?;
        for (name, expected) in &self.notes() {
            let there = part.note(name).unwrap_or_default();
            if there != expected {
                let differs = first_differences(there, expected);
                let path = path.display();
                let foreign = match name.as_str() {
                    "version" => Foreign::Version(format!(
                        "{path}: was written by another version of this program, {there}"
                    )),
                    "scene" => Foreign::Study(format!(
                        "{path}: is of the same study of another scene: {differs}"
                    )),
                    _ => Foreign::Study(format!("{path}: is of another study: {differs}")),
                };
                return Err(NoPart::Foreign(foreign));
            }
        }
        unharmed(|| self.rows(block, &part))
            .map(Some)
            .map_err(damaged)
    }

    fn recordings(&self) -> PathBuf {
        self.folder.join("recordings")
    }

    /// The rows of a part, if they are those of its runs.
    fn rows(&self, block: u64, part: &Reader) -> Result<Vec<Vec<Cell>>, ParquetError> {
        if part.columns != self.plan.columns() {
            return Err(ParquetError::General(
                "its columns are not those of the study".into(),
            ));
        }
        let rows = part.checked()?;
        // OK because runs are far below 2^63.
        let runs = self.plan.block(block).map(|run| Cell::Whole(run as i64));
        if !rows.iter().map(|row| row[0].clone()).eq(runs) {
            return Err(ParquetError::General(
                "its runs are others than its name says".into(),
            ));
        }
        Ok(rows)
    }

    /// Whether every run of a part that has a result has its recording too, up to the last byte.
    fn recorded(&self, rows: &[Vec<Cell>]) -> bool {
        rows.iter().all(|row| {
            let Cell::Whole(run) = row[0] else {
                return true;
            };
            let path = self.recordings().join(recording_name(run as u64));
            !has_result(row) || ends_whole(&path).unwrap_or(false)
        })
    }

    /// Takes away what a kill left unfinished.
    fn sweep_up(&self) {
        let parts = self.folder.join("parts");
        for folder in [&self.folder, &self.recordings(), &parts] {
            let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
            for entry in entries {
                let name = entry.file_name();
                let name = name.to_string_lossy();
                let its = [".runs.parquet.", ".summary.csv.", ".run-"];
                let ours = folder == &parts || its.iter().any(|own| name.starts_with(own));
                let unfinished = name.starts_with('.') && name.ends_with(".part");
                let since = || entry.metadata().and_then(|m| m.modified()).ok();
                let age = || since().and_then(|then| then.elapsed().ok());
                if ours && unfinished && age().is_some_and(|age| age > LEFT) {
                    // Best effort: it is in nobody's way.
                    let _ = std::fs::remove_file(entry.path());
                }
            }
        }
    }

    /// Computes the rows of some runs, and writes their recordings where the study keeps them.
    ///
    /// # Errors
    /// A recording that cannot be written.
    pub fn run(&self, runs: Range<u64>) -> Outcome<Vec<Vec<Cell>>> {
        let recordings = self.recordings();
        let recordings = self.plan.spec.recordings.then_some(&*recordings);
        self.plan.run(runs, recordings)
    }

    /// Fills the blocks named with the rows that `run` gives of their runs ([`Store::run`]); `done` is called after every run. When `stop` is set,
    /// whole parts stay and the rest is dropped.
    ///
    /// # Errors
    /// A part that cannot be written, and those of `run`.
    pub fn fill(
        &self,
        blocks: &[u64],
        jobs: usize,
        stop: &AtomicBool,
        run: impl Fn(Range<u64>) -> Outcome<Vec<Vec<Cell>>> + Sync,
        mut done: impl FnMut(),
    ) -> Outcome<Written> {
        self.sweep_up();
        let runs: u64 = blocks
            .iter()
            .map(|b| self.plan.block(*b))
            .map(|r| r.end - r.start)
            .sum();
        let shares = self.plan.shares(runs, threads(jobs));
        let mut written = Written::default();
        let (mut rows, mut due) = (Vec::new(), blocks.iter());
        let mut block = due.next();
        in_order(
            shares.count(),
            jobs,
            stop,
            |k| {
                let pieces = self.pieces(blocks, shares.get(k)).into_iter();
                let rows: Outcome<Vec<_>> = pieces.map(&run).collect();
                rows.map(|rows| rows.concat())
            },
            |_, batch| {
                for row in batch? {
                    rows.push(row);
                    done();
                    let Some(&of) = block else { continue };
                    let range = self.plan.block(of);
                    if rows.len() as u64 == range.end - range.start {
                        written.failed += self.write_part(of, &rows)?;
                        written.parts += 1;
                        written.runs += rows.len() as u64;
                        rows.clear();
                        block = due.next();
                    }
                }
                Ok::<(), String>(())
            },
        )?;
        Ok(written)
    }

    /// The runs at some places in the row of all runs of `blocks`, where all blocks but the very last are of one size.
    fn pieces(&self, blocks: &[u64], places: Range<u64>) -> Vec<Range<u64>> {
        let size = self.plan.block_runs();
        let mut pieces: Vec<Range<u64>> = Vec::new();
        let mut place = places.start;
        while place < places.end {
            let block = self.plan.block(blocks[(place / size) as usize]);
            let first = block.start + place % size;
            let last = block.end.min(first + (places.end - place));
            match pieces.last_mut() {
                Some(before) if before.end == first => before.end = last,
                _ => pieces.push(first..last),
            }
            place += last - first;
        }
        pieces
    }

    fn write_part(&self, block: u64, rows: &[Vec<Cell>]) -> Outcome<u64> {
        write_whole(&self.part(block), |file| {
            let mut writer = Writer::new(file, self.plan.columns(), &self.notes())?;
            writer.group(rows)?;
            writer.close()
        })?;
        Ok(failed(rows))
    }

    /// Puts all parts together, in order, and summarises them on the way.
    ///
    /// # Errors
    /// Missing or unreadable parts; a table that cannot be written.
    pub fn merge(&self) -> Outcome<Found> {
        let mut found = Err("nothing was merged".to_owned());
        let mut said = None;
        let written = write_whole(&self.folder.join("summary.csv"), |csv| {
            let mut summary = Summary::new(self.plan, BufWriter::new(csv))?;
            write_whole(&self.table(), |file| {
                self.merge_into(file, &mut summary, &mut said)
            })
            .map_err(|why| ParquetError::General(said.get_or_insert(why).clone()))?;
            found = Ok(summary.finish()?);
            Ok(())
        });
        match said {
            Some(why) => Err(why),
            None => written.and(found),
        }
    }

    /// Why the parts cannot be put together.
    fn what_lacks(&self) -> String {
        let progress = match self.parts(Shard::WHOLE, false) {
            Ok(progress) => progress,
            Err(why) => return elsewhere(why),
        };
        let again = format!(
            "`study {} --resume` computes",
            word(self.folder.join("study.toml"))
        );
        if let Some(damaged) = progress.damaged.first() {
            let further = match progress.damaged.len() - 1 {
                0 => String::new(),
                n => format!(", and so are {n} others"),
            };
            return format!("{damaged}{further}; {again} it again");
        }
        let folder = self.folder.display();
        let Some(first) = progress.missing.first() else {
            return format!("{folder}: a part was not whole a moment ago; merge again");
        };
        let runs = self.plan.block(*first);
        format!(
            "{folder}: {} of {} parts are missing, the first is that of runs {} to {}; {again} them",
            progress.missing.len(),
            self.plan.blocks(),
            runs.start,
            runs.end - 1,
        )
    }

    fn merge_into<W: Write>(
        &self,
        file: &mut Sink,
        summary: &mut Summary<W>,
        lacks: &mut Option<String>,
    ) -> Result<(), ParquetError> {
        let mut writer = Writer::new(file, self.plan.columns(), &self.notes())?;
        let mut rows: Vec<Vec<Cell>> = Vec::new();
        for block in 0..self.plan.blocks() {
            let Ok(Some(part)) = self.part_rows(block) else {
                let why = lacks.insert(self.what_lacks());
                return Err(ParquetError::General(why.clone()));
            };
            for row in part {
                summary.row(&row)?;
                rows.push(row);
                if rows.len() == GROUP_ROWS {
                    writer.group(&rows)?;
                    rows.clear();
                }
            }
        }
        if !rows.is_empty() {
            writer.group(&rows)?;
        }
        writer.close()
    }
}

/// Why a part is not taken: a sentence.
pub(super) enum NoPart {
    /// It is not as it was written.
    Damaged(String),
    /// Somebody else wrote it.
    Foreign(Foreign),
}

/// Who wrote a part that is not this study's, in a sentence.
pub(super) enum Foreign {
    /// Another study, or this one of another scene.
    Study(String),
    /// Another version of this program.
    Version(String),
}

/// What to do about a part that is not this study's.
fn elsewhere(foreign: Foreign) -> String {
    match foreign {
        Foreign::Study(why) => format!(
            "{why}; choose another --out, where `--reuse` takes over the runs that both have, or delete it"
        ),
        Foreign::Version(why) => format!("{why}; choose another --out, or delete it"),
    }
}

/// What two texts do not have in common: the first lines of each that the other has not.
fn first_differences(there: &str, here: &str) -> String {
    let alone = |of: &str, other: &str| -> String {
        let lines = of.lines().filter(|line| !other.lines().any(|o| o == *line));
        let lines: Vec<String> = lines.take(3).map(|line| format!("`{line}`")).collect();
        match lines.is_empty() {
            true => "nothing else".into(),
            false => lines.join(", "),
        }
    };
    let [its, ours] = [alone(there, here), alone(here, there)];
    format!("it has {its} where this one has {ours}")
}

/// Whether a run of the table has a result.
fn has_result(row: &[Cell]) -> bool {
    row[row.len() - 2] == Cell::Empty
}

/// How many runs have none.
fn failed(rows: &[Vec<Cell>]) -> u64 {
    rows.iter().filter(|row| !has_result(row)).count() as u64
}

/// Name of a run's recording.
pub fn recording_name(run: u64) -> String {
    format!("run-{run:09}.mcap")
}

/// [`recording::whole::write_whole`] with its errors as sentences.
///
/// # Errors
/// What the system or the table's library says.
pub fn write_whole(
    path: &Path,
    fill: impl FnOnce(&mut Sink) -> Result<(), ParquetError>,
) -> Outcome<()> {
    recording::whole::write_whole(path, fill).map_err(|error: ParquetError| {
        let why = match &error {
            ParquetError::External(cause) => cause.to_string(),
            _ => error.to_string(),
        };
        format!("{}: cannot be written: {why}", path.display())
    })
}

thread_local! {
    /// Whether a panic of this thread is expected, and told by whom it concerns.
    static EXPECTED: Flag<bool> = const { Flag::new(false) };
}

/// What `read` gives. A flipped bit may make the library that reads pages break off, which is damage like any other; what it says itself is not printed.
fn unharmed<T>(read: impl FnOnce() -> Result<T, ParquetError>) -> Result<T, ParquetError> {
    // The hook is everybody's, so it is set once and asks which thread it is.
    static QUIET: Once = Once::new();
    QUIET.call_once(|| {
        let usual = take_hook();
        set_hook(Box::new(move |panic| {
            if !EXPECTED.get() {
                usual(panic);
            }
        }));
    });
    EXPECTED.set(true);
    let found = catch_unwind(AssertUnwindSafe(read));
    EXPECTED.set(false);
    found.unwrap_or_else(|_| Err(ParquetError::General("its pages make no sense".into())))
}

#[test]
fn a_library_that_breaks_off_over_a_part_leaves_it_damaged_and_says_nothing() {
    const AGAIN: &str = "STUDY_TEST_BREAKS_OFF";
    if std::env::var_os(AGAIN).is_none() {
        // What a panic prints, only another process can hear.
        let name = "a_library_that_breaks_off_over_a_part_leaves_it_damaged_and_says_nothing";
        let again = std::process::Command::new(std::env::current_exe().unwrap())
            .args([name, "--nocapture"])
            .env(AGAIN, "")
            .output()
            .unwrap();
        let said = String::from_utf8_lossy(&again.stderr);
        assert!(again.status.success(), "{said}");
        assert!(
            !said.contains("no decoder") && said.contains("another panic"),
            "{said}"
        );
        return;
    }
    let error = unharmed::<()>(|| panic!("no decoder")).unwrap_err();
    assert!(error.to_string().contains("no sense"), "{error}");
    assert_eq!(unharmed(|| Ok(1)).unwrap(), 1);
    // Others are heard as ever.
    assert!(catch_unwind(|| panic!("another panic")).is_err());
}
