//! A recording that is still being written: it is shown as far as it has come.
//!
//! What has come through the pipe is read again as a whole, with pauses that grow with the time a reading takes, and what is new is
//! sent. A recording in the making is an MCAP without its end, which the reader knows how to use.

use std::io::Read;
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::time::{Duration, Instant};

use analyze::request::Request;
use recording::Finding;
use recording::read::{ReadError, Recording, STDIN};

use crate::blueprint::{self, Play};
use crate::draw::events::whole_s;
use crate::load::{Detail, load, options};
use crate::store::{Progress, Sink};
use crate::take::Take;

/// Bytes read at a time.
const PIECE_BYTES: usize = 1 << 16;
/// The shortest pause between readings.
const PAUSE: Duration = Duration::from_millis(100);
/// A reading may take one part in so many of the time.
const EFFORT: u32 = 4;
/// How long an event may take to be recognised, and an estimate to settle, s: younger ones wait while there is more to come.
const SETTLE_S: f64 = 10.0;

/// Shows what comes through `input` until it ends. Returns what the reader found odd in the end.
///
/// # Errors
/// Where the input is no recording, cannot be read, or the sink takes no more.
pub fn follow(
    input: impl Read + Send + 'static,
    sink: &mut dyn Sink,
    asked: &Request,
) -> anyhow::Result<(Take, Vec<Finding>)> {
    let (sender, receiver) = channel::<std::io::Result<Vec<u8>>>();
    std::thread::spawn(move || read_pieces(input, &sender));
    let mut shown = Shown::default();
    let mut bytes: Vec<u8> = Vec::new();
    let mut next = Instant::now() + PAUSE;
    loop {
        match receiver.recv_timeout(next.saturating_duration_since(Instant::now())) {
            Ok(piece) => {
                bytes.extend(piece?);
                if Instant::now() < next {
                    continue;
                }
            }
            Err(RecvTimeoutError::Timeout) => {}
            Err(RecvTimeoutError::Disconnected) => return shown.last(bytes, sink, asked),
        }
        let began = Instant::now();
        if bytes.len() > shown.bytes {
            shown.more(&bytes, sink, asked)?;
        }
        next = Instant::now() + PAUSE.max(EFFORT * began.elapsed());
    }
}

fn read_pieces(mut input: impl Read, sender: &std::sync::mpsc::Sender<std::io::Result<Vec<u8>>>) {
    loop {
        let mut piece = vec![0; PIECE_BYTES];
        let sent = match input.read(&mut piece) {
            Ok(0) => return,
            Ok(count) => {
                piece.truncate(count);
                sender.send(Ok(piece))
            }
            Err(error) if error.kind() == std::io::ErrorKind::Interrupted => continue,
            Err(error) => {
                // Nobody listens any more if this fails too.
                let _ = sender.send(Err(error));
                return;
            }
        };
        if sent.is_err() {
            return;
        }
    }
}

/// What has been shown so far.
#[derive(Default)]
struct Shown {
    bytes: usize,
    id: Option<String>,
    progress: Option<Progress>,
    titles: Vec<String>,
    layouts: usize,
}

impl Shown {
    /// Shows what is new while there is more to come. A beginning too short to be read is left for later.
    fn more(&mut self, bytes: &[u8], sink: &mut dyn Sink, asked: &Request) -> anyhow::Result<()> {
        self.bytes = bytes.len();
        let recording = match Recording::from_bytes(bytes.to_vec(), &options(asked)) {
            Ok(recording) => recording,
            Err(ReadError::Empty { .. }) => return Ok(()),
            // The magic number is 8 bytes long.
            Err(ReadError::NotMcap { .. }) if bytes.len() < 8 => return Ok(()),
            Err(error) => return Err(error.into()),
        };
        if recording.info().messages == 0 {
            return Ok(());
        }
        let (mut take, _) = load(STDIN, &recording, Detail::Whole, asked)?;
        let settled_s = whole_s(take.duration_s() - SETTLE_S);
        take.events.retain(|event| event.t_s < settled_s);
        take.keep_settled(take.start_ns.saturating_add((settled_s * 1e9) as i64));
        // What looks like damage is only what has not come yet.
        take.remarks.clear();
        self.show(&recording, &take, sink)
    }

    fn last(
        mut self,
        bytes: Vec<u8>,
        sink: &mut dyn Sink,
        asked: &Request,
    ) -> anyhow::Result<(Take, Vec<Finding>)> {
        let recording = Recording::from_bytes(bytes, &options(asked))?;
        let (take, findings) = load(STDIN, &recording, Detail::Whole, asked)?;
        self.show(&recording, &take, sink)?;
        Ok((take, findings))
    }

    fn show(
        &mut self,
        recording: &Recording,
        take: &Take,
        sink: &mut dyn Sink,
    ) -> anyhow::Result<()> {
        let id = self
            .id
            .get_or_insert_with(|| crate::recording_id(&take.name, recording))
            .clone();
        let sent = crate::send_part(sink, &id, take, self.progress.take())?;
        self.progress = Some(sent.progress);
        let titles: Vec<String> = blueprint::titles(&sent.layout)
            .into_iter()
            .map(str::to_owned)
            .collect();
        if titles != self.titles {
            self.layouts += 1;
            let blueprint = format!("{id}-views-{}", self.layouts);
            blueprint::send(sink, &blueprint, &sent.layout, Play::Following)?;
            self.titles = titles;
        }
        Ok(())
    }
}
