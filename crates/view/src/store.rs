//! What is told to Rerun, as messages: whole columns at once, with numbered ids, so that the same recording always gives the same bytes.
//!
//! Rerun's own recording stream numbers rows by the clock and batches on a thread; a file made that way differs from run to run.
//! Here a chunk is made from columns where they are, its id is a counter, and a [`Sink`] takes the message at once.

use std::collections::HashMap;

use re_chunk::{Chunk, ChunkComponents, ChunkId, TimeColumn};
use re_log_types::external::re_tuid::Tuid;
use re_log_types::{EntityPath, LogMsg, StoreId, StoreKind};
use re_sdk_types::archetypes::RecordingInfo;
use re_sdk_types::{AsComponents, SerializedComponentBatch, SerializedComponentColumn};
use recording::read::TAKEN_BEFORE_NS;

/// Name under which the viewer files recordings and remembers how the user arranged the views.
pub const APPLICATION: &str = "rath";

/// Seconds since the first message of the recording: the timeline that is shown.
pub const TIME: &str = "time";

/// Wall-clock time of the messages, where the recording has it.
pub const UTC: &str = "utc";

/// Stamps below this (2001-09-09) are not taken for wall-clock time: simulated recordings start at 0.
const FIRST_WALL_CLOCK_NS: i64 = 1_000_000_000_000_000_000;

/// Where messages go.
pub trait Sink {
    /// Takes one message.
    fn send(&mut self, message: LogMsg) -> anyhow::Result<()>;
}

/// A file under construction, in memory or on disk.
pub struct Encoded<W: std::io::Write>(re_log_encoding::Encoder<W>);

impl<W: std::io::Write> Encoded<W> {
    /// Begins an .rrd.
    pub fn new(write: W) -> anyhow::Result<Self> {
        let (version, options) = (
            re_log_encoding::CrateVersion::LOCAL,
            re_log_encoding::EncodingOptions::PROTOBUF_COMPRESSED,
        );
        Ok(Encoded(re_log_encoding::Encoder::new_eager(
            version, options, write,
        )?))
    }

    /// Begins a stream for a reader that takes messages as they come: it needs no footer.
    ///
    /// Its bytes depend on what is sent alone. (The footer of a file, which the encoder makes from hash maps, is in no fixed order;
    /// all bytes before it are the same for the same recording.)
    pub fn stream(write: W) -> anyhow::Result<Self> {
        let mut encoded = Encoded::new(write)?;
        encoded.0.do_not_emit_footer();
        Ok(encoded)
    }

    /// Ends it with the footer that `rerun rrd verify` asks for.
    pub fn finish(mut self) -> anyhow::Result<W> {
        self.0.finish()?;
        Ok(self.0.into_inner()?)
    }
}

impl<W: std::io::Write> Sink for Encoded<W> {
    fn send(&mut self, message: LogMsg) -> anyhow::Result<()> {
        self.0.append(&message)?;
        Ok(())
    }
}

/// A viewer or server at the other end of a connection.
impl Sink for re_grpc_client::write::Client {
    fn send(&mut self, message: LogMsg) -> anyhow::Result<()> {
        self.send_blocking(message);
        Ok(())
    }
}

/// How far a recording has been sent, so that more of it can follow.
#[derive(Default)]
pub struct Progress {
    /// First time of the recording when it was begun, ns: rows are placed relative to it. It stays when earlier messages follow, or when those are no
    /// longer taken for its beginning.
    start_ns: i64,
    /// What the scene in space is drawn about, x and y in the world, m; once it is known.
    origin_m: Option<[f64; 2]>,
    next: u64,
    /// Latest time that was sent of each entity, ns.
    last_ns: HashMap<String, i64>,
    /// Where topics and their parts have been placed.
    places: HashMap<(String, String), String>,
    /// What was said to hold for all of time.
    fixed: HashMap<String, Vec<SerializedComponentBatch>>,
}

/// One store of Rerun: a recording or a blueprint.
pub struct Store<'s> {
    id: StoreId,
    sink: &'s mut dyn Sink,
    progress: Progress,
    blueprint: bool,
}

impl<'s> Store<'s> {
    /// Begins the recording `id`, called `name`, whose first message is at `start_ns`; or goes on with it after `progress`, on the same time axis.
    pub fn recording(
        sink: &'s mut dyn Sink,
        id: &str,
        name: &str,
        start_ns: i64,
        progress: Option<Progress>,
    ) -> anyhow::Result<Self> {
        let id = StoreId::recording(APPLICATION, id);
        if let Some(progress) = progress {
            return Ok(Store {
                id,
                sink,
                progress,
                blueprint: false,
            });
        }
        let mut store = Self::begin(sink, id, start_ns, 1, false)?;
        let mut info = RecordingInfo::update_fields().with_name(name);
        if start_ns >= FIRST_WALL_CLOCK_NS {
            info = info.with_start_time(start_ns);
        }
        store.fixed("/__properties", &info)?;
        Ok(store)
    }

    /// Begins a blueprint.
    pub fn blueprint(sink: &'s mut dyn Sink, id: &str) -> anyhow::Result<Self> {
        let id = StoreId::new(StoreKind::Blueprint, APPLICATION, id);
        // Ids are compared within one store only; another start keeps them apart all the same.
        Self::begin(sink, id, 0, 1 << 62, true)
    }

    fn begin(
        sink: &'s mut dyn Sink,
        id: StoreId,
        start_ns: i64,
        first: u64,
        blueprint: bool,
    ) -> anyhow::Result<Self> {
        let source = concat!("rath view ", env!("CARGO_PKG_VERSION")).to_owned();
        let info =
            re_log_types::StoreInfo::new(id.clone(), re_log_types::StoreSource::Other(source));
        let row_id = Tuid::from_nanos_and_inc(0, first);
        sink.send(LogMsg::SetStoreInfo(re_log_types::SetStoreInfo {
            row_id,
            info,
        }))?;
        let progress = Progress {
            start_ns,
            next: first + 1,
            ..Progress::default()
        };
        Ok(Store {
            id,
            sink,
            progress,
            blueprint,
        })
    }

    /// How far this has been sent.
    pub fn into_progress(self) -> Progress {
        self.progress
    }

    /// What the scene in space is drawn about, x and y in the world, m: what was `found` first, however the recording grows.
    pub fn about_m(&mut self, found: Option<[f64; 2]>) -> [f64; 2] {
        let known = &mut self.progress.origin_m;
        *known = known.or(found);
        known.unwrap_or_default()
    }

    /// The place of a part of a topic: the one that is wanted, or one beside it where another has that. Who has been placed stays there.
    pub fn place(&mut self, (topic, part): (&str, &str), wanted: String) -> String {
        let places = &mut self.progress.places;
        let key = (topic.to_owned(), part.to_owned());
        if let Some(known) = places.get(&key) {
            return known.clone();
        }
        let mut path = wanted.clone();
        let mut next = 2;
        while places.values().any(|taken| *taken == path) {
            path = format!("{wanted}-{next}");
            next += 1;
        }
        places.insert(key, path.clone());
        path
    }

    /// Something that holds for all of time. What was said before in the same words is not said again.
    pub fn fixed(&mut self, path: &str, what: &dyn AsComponents) -> anyhow::Result<()> {
        let batches = what.as_serialized_batches();
        if self.progress.fixed.get(path) == Some(&batches) {
            return Ok(());
        }
        let mut components: Vec<SerializedComponentColumn> = Vec::new();
        for batch in &batches {
            components.push(batch.clone().partitioned([batch.array.len()])?);
        }
        if !self.blueprint {
            self.progress.fixed.insert(path.to_owned(), batches);
        }
        // A blueprint's properties live on a timeline of their own.
        let times = self
            .blueprint
            .then(|| TimeColumn::new_sequence("blueprint", [0i64]));
        self.chunk(path, times, components.into_iter().collect())
    }

    /// One row at each of `times_ns` (log time, ascending); those that were sent before are left out.
    pub fn rows(
        &mut self,
        path: &str,
        times_ns: &[i64],
        columns: impl IntoIterator<Item = SerializedComponentColumn>,
    ) -> anyhow::Result<()> {
        self.rows_of(path, "", times_ns, columns)
    }

    /// Rows of nothing at the times at which what [`Store::rows`] says of an entity is there no more: the viewer keeps the latest.
    pub fn gone(
        &mut self,
        path: &str,
        times_ns: &[i64],
        empty: impl IntoIterator<Item = SerializedComponentColumn>,
    ) -> anyhow::Result<()> {
        self.rows_of(path, " is gone", times_ns, empty)
    }

    /// Rows of an entity that were counted as `kind` so far.
    fn rows_of(
        &mut self,
        path: &str,
        kind: &str,
        times_ns: &[i64],
        columns: impl IntoIterator<Item = SerializedComponentColumn>,
    ) -> anyhow::Result<()> {
        let key = format!("{path}{kind}");
        let sent = self.progress.last_ns.get(&key).copied();
        let from = sent.map_or(0, |sent| times_ns.partition_point(|t| *t <= sent));
        let new = &times_ns[from..];
        let Some(last) = new.last() else {
            return Ok(());
        };
        self.progress.last_ns.insert(key, *last);
        let start_ns = self.progress.start_ns;
        // The few that are dated long before all others would make the axis as long.
        let early_ns = start_ns.saturating_sub(TAKEN_BEFORE_NS);
        let dated = new.iter().map(|&t| match t < early_ns {
            true => start_ns,
            false => t,
        });
        let since = dated.clone().map(|t| t.saturating_sub(start_ns));
        let mut times = vec![TimeColumn::new_duration_nanos(TIME, since)];
        if start_ns >= FIRST_WALL_CLOCK_NS {
            times.push(TimeColumn::new_timestamp_nanos_since_epoch(UTC, dated));
        }
        let columns = columns.into_iter().map(|column| SerializedComponentColumn {
            list_array: column.list_array.slice(from, new.len()),
            descriptor: column.descriptor,
        });
        self.chunk(path, times, columns.collect())
    }

    fn chunk(
        &mut self,
        path: &str,
        times: impl IntoIterator<Item = TimeColumn>,
        components: ChunkComponents,
    ) -> anyhow::Result<()> {
        let id = Tuid::from_nanos_and_inc(0, self.progress.next);
        let timelines = times
            .into_iter()
            .map(|t| (*t.timeline().name(), t))
            .collect();
        let path = EntityPath::parse_forgiving(path);
        let chunk = Chunk::from_auto_row_ids(ChunkId::from_tuid(id), path, timelines, components)?;
        // Rows are numbered from the chunk's id on.
        self.progress.next += 1 + chunk.num_rows() as u64;
        self.sink
            .send(LogMsg::ArrowMsg(self.id.clone(), chunk.to_arrow_msg()?))
    }

    /// Ends a blueprint: from now on it is the one in use.
    pub fn activate(self) -> anyhow::Result<()> {
        let command = re_log_types::BlueprintActivationCommand {
            blueprint_id: self.id,
            make_active: true,
            make_default: true,
        };
        self.sink.send(LogMsg::BlueprintActivationCommand(command))
    }
}
