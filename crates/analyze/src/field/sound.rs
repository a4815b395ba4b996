//! Sound in a recording: `foxglove.RawAudio` messages, 16-bit PCM, joined to one channel in the order of time.
//!
//! A message's timestamp is when its sound begins; a recorder logs it when its sound is complete. So timestamps date messages where they are on the log's clock,
//! and log times otherwise. Samples are counted by a clock of their own, which is held against these dates:
//! ```text
//! t = t_0 + s + d(s)        d the straight line through what is least late in the first and in the last third
//! ```
//! s the sound before a message (s), t its date; as [`dates`](super::dates), from where the method is.

use std::collections::VecDeque;
use std::ops::Range;

use prost::Message;
use recording::read::{ReadError, Recording};
use recording::schema::foxglove::RawAudio;
use recording::text::counted;

use super::dates::Edge;
use crate::beat::{BeatError, Beats, beats_among, onsets};
use crate::median::median;
use crate::roles::SOUND;

/// Sound is thinned to no less than this, Hz: enough for what a drum begins.
const RATE_HZ: u32 = 16_000;
/// Longest sound that is listened to, s.
const LONGEST_S: f64 = 3600.0;
/// A hole is what messages come later than the sound before them ends, by half a message and more; of long messages by so much, of the shortest by
/// so much, s.
const HOLE_S: [f64; 2] = [0.002, 0.1];
/// Some messages come late by themselves: behind a hole all do for so long, s, in which quartz drifts by less than a millisecond.
const LATE_FOR_S: f64 = 5.0;

/// Behind its timestamp a message comes by so many of its lengths and so long at most, s, and before it by no more than clocks are rounded: else the
/// timestamps are not on the log's clock.
const LATE: (f64, f64) = (1.5, 0.1);
const EARLY_S: f64 = 0.002;
/// No sound is counted by a clock that is farther off, ppm.
const MOST_PPM: f64 = 1000.0;
/// Less is not put right, s: rounding.
const LEAST_OFF_S: f64 = 1e-4;

/// What is heard in a recording; times on the clock of its messages, s since the recording's first one.
pub struct Heard {
    /// Topic of the sound.
    pub topic: String,
    /// Everything that begins.
    pub onset_s: Vec<f64>,
    /// The beats among it.
    pub beats: Result<Beats, BeatError>,
    /// What is odd about it, a sentence each.
    pub remarks: Vec<String>,
}

/// A message with sound.
#[derive(Clone, Copy)]
struct Block {
    /// Its date: of its log, or of its timestamp.
    t_ns: i64,
    /// Its number among them in the file.
    number: usize,
    frames: usize,
}

/// Samples of each channel in a message that can be listened to, with its rate.
fn frames_of(audio: &RawAudio) -> Option<(u32, usize)> {
    let usable = audio.format == "pcm-s16" && audio.sample_rate > 0;
    let channels = audio.number_of_channels.max(1) as usize;
    usable.then(|| (audio.sample_rate, audio.data.len() / (2 * channels)))
}

/// When a message says that its sound begins, ns since 1970.
fn stamp_ns(audio: &RawAudio) -> Option<i64> {
    let stamp = audio.timestamp.as_ref()?;
    stamp
        .seconds
        .checked_mul(1_000_000_000)?
        .checked_add(stamp.nanos.into())
}

/// Where messages belong, in samples as recorded.
#[derive(Default)]
struct Plan {
    first_ns: i64,
    /// Where each begins, by its number; `None` for what is not listened to.
    start: Vec<Option<usize>>,
    holes: Vec<Range<usize>>,
    frames: usize,
    cut: bool,
    /// Sound before each message that is listened to, and how late this is by its date, s.
    late_s: Vec<(f64, f64)>,
}

impl Plan {
    /// Of messages in the order of the file.
    fn of(mut blocks: Vec<Block>, rate_hz: f64) -> Self {
        let count = blocks.len();
        blocks.sort_by_key(|b| b.t_ns);
        // One wrong time does not part the sound.
        let near = |a: &Block, b: &Block| seconds(a.t_ns, b.t_ns) <= LONGEST_S;
        let sound = |part: &&[Block]| part.iter().map(|b| b.frames).sum::<usize>();
        let Some(blocks) = blocks.chunk_by(near).max_by_key(sound) else {
            return Self::default();
        };
        let mut plan = Self {
            first_ns: blocks[0].t_ns,
            start: vec![None; count],
            cut: blocks.len() < count,
            ..Self::default()
        };
        let longest = (LONGEST_S * rate_hz) as usize;
        let window = (LATE_FOR_S * rate_hz) as usize;
        // Least lateness of the messages within the window before: where it ended, and what is later and less late.
        let mut before: VecDeque<(usize, f64)> = VecDeque::new();
        for (k, block) in blocks.iter().enumerate() {
            let late_s =
                |at: usize, b: &Block| seconds(plan.first_ns, b.t_ns) - at as f64 / rate_hz;
            let [least, most] = HOLE_S;
            let message_s = blocks[k.saturating_sub(1)].frames as f64 / rate_hz;
            // Of a hole behind a message that itself came late, a part is found before that, and the rest behind.
            let after = |hole: &Range<usize>| hole.end + window > plan.frames;
            let share = if plan.holes.last().is_some_and(after) {
                0.1
            } else {
                0.5
            };
            let usual_s = before.front().map_or(0.0, |b| b.1);
            let bound_s = usual_s + (share * message_s).clamp(least, most);
            let (mut at, mut hole_s) = (plan.frames, f64::INFINITY);
            // By the log's clock too: of sound that is nearly all holes, each would be looked at to the end.
            let within = |next: &&Block| seconds(block.t_ns, next.t_ns) <= LATE_FOR_S;
            for next in blocks[k..].iter().take_while(within) {
                hole_s = hole_s.min(late_s(at, next) - usual_s);
                at += next.frames;
                if usual_s + hole_s < bound_s || at > plan.frames + window {
                    break;
                }
            }
            if k > 0 && usual_s + hole_s >= bound_s {
                let end = plan.frames + (hole_s * rate_hz).round() as usize;
                plan.holes.push(plan.frames..end.min(longest));
                plan.frames = end;
            }
            if plan.frames >= longest {
                (plan.frames, plan.cut) = (longest, true);
                break;
            }
            let late_s = late_s(plan.frames, block);
            plan.start[block.number] = Some(plan.frames);
            plan.late_s.push((plan.frames as f64 / rate_hz, late_s));
            plan.frames += block.frames;
            while before.back().is_some_and(|b| b.1 >= late_s) {
                before.pop_back();
            }
            before.push_back((plan.frames, late_s));
            while before.front().is_some_and(|b| b.0 + window < plan.frames) {
                before.pop_front();
            }
        }
        plan
    }
}

/// How a sound's samples stand to its messages' dates, of the sound before each message and how late that is, s.
fn pace(late_s: &[(f64, f64)]) -> Option<Edge> {
    let (n, third) = (late_s.len(), late_s.len().div_ceil(3));
    let parts = [&late_s[..third], &late_s[n - third..]];
    let mut edge = Edge::of(parts.map(|part| part.iter().copied()))?;
    if edge.late_s.abs().max(edge.grows_s.abs()) <= LEAST_OFF_S {
        return None;
    }
    if (1e6 * edge.slope).abs() > MOST_PPM {
        edge.slope = 0.0;
    }
    Some(edge)
}

/// Dates messages by their timestamps (ns, `None` where one has none), if these are on the log's clock.
fn by_stamps(blocks: &mut [Block], stamps_ns: &[Option<i64>], rate_hz: f64) {
    let stamps: Option<Vec<i64>> = stamps_ns.iter().copied().collect();
    let Some(stamps) = stamps.filter(|s| s.windows(2).any(|w| w[0] != w[1])) else {
        return;
    };
    let each = || blocks.iter().zip(&stamps);
    let mut late_s: Vec<f64> = each().map(|(b, s)| seconds(*s, b.t_ns)).collect();
    let mut long_s: Vec<f64> = blocks.iter().map(|b| b.frames as f64 / rate_hz).collect();
    let near = late_s.iter().all(|late_s| late_s.abs() <= LONGEST_S);
    let (Some(late_s), Some(long_s)) = (median(&mut late_s), median(&mut long_s)) else {
        return;
    };
    if near && (-EARLY_S..=LATE.0 * long_s + LATE.1).contains(&late_s) {
        for (block, stamp) in blocks.iter_mut().zip(stamps) {
            block.t_ns = stamp;
        }
    }
}

fn seconds(from_ns: i64, to_ns: i64) -> f64 {
    to_ns.saturating_sub(from_ns) as f64 / 1e9
}

/// Listens to the first topic with sound. `None` where there is no sound.
///
/// Messages are joined in the order of their dates, channels are averaged, sound of more than 32 kHz is thinned; what is lost between messages is
/// not a number. Messages that are not `pcm-s16` of one rate or cannot be decoded are counted and passed over.
///
/// # Errors
/// Where the file cannot be read.
pub fn listen(recording: &Recording) -> Result<Option<Heard>, ReadError> {
    let info = recording.info();
    let Some(channel) = info
        .channels
        .iter()
        .find(|c| c.schema == SOUND && c.encoding == "protobuf")
    else {
        return Ok(None);
    };
    let each = |sink: &mut dyn FnMut(i64, Option<RawAudio>)| {
        recording.messages(&|topic| topic == channel.topic, &mut |message| {
            sink(message.log_time_ns, RawAudio::decode(message.data).ok());
        })
    };
    let (mut rate, mut refused, mut blocks) = (0, 0, Vec::new());
    let mut stamps_ns = Vec::new();
    each(
        &mut |t_ns, audio| match audio.as_ref().and_then(frames_of) {
            Some((its, frames)) if rate == 0 || rate == its => {
                rate = its;
                let number = blocks.len();
                stamps_ns.push(audio.as_ref().and_then(stamp_ns));
                blocks.push(Block {
                    t_ns,
                    number,
                    frames,
                });
            }
            _ => refused += 1,
        },
    )?;
    let some = !blocks.is_empty();
    by_stamps(&mut blocks, &stamps_ns, f64::from(rate));
    let plan = Plan::of(blocks, f64::from(rate));
    let pace = pace(&plan.late_s);
    let dated = |s: f64| pace.map_or(s, |edge| edge.moved(s));
    let factor = (rate / RATE_HZ).max(1) as usize;
    let rate_hz = f64::from(rate) / factor as f64;
    let mut sound = vec![0f32; plan.frames / factor];
    let mut starts = plan.start.iter();
    each(&mut |_, audio| {
        let Some(audio) = audio.filter(|a| frames_of(a).is_some_and(|f| f.0 == rate)) else {
            return;
        };
        let Some(Some(start)) = starts.next() else {
            return;
        };
        let channels = audio.number_of_channels.max(1) as usize;
        for (k, frame) in audio.data.chunks_exact(2 * channels).enumerate() {
            let sum: i32 = frame
                .chunks_exact(2)
                .map(|b| i32::from(i16::from_le_bytes([b[0], b[1]])))
                .sum();
            if let Some(sample) = sound.get_mut((start + k) / factor) {
                *sample += sum as f32 / (channels * factor) as f32;
            }
        }
    })?;
    for hole in &plan.holes {
        let end = hole.end.div_ceil(factor).min(sound.len());
        sound[(hole.start / factor).min(end)..end].fill(f32::NAN);
    }
    let mut remarks = Vec::new();
    if refused > 0 {
        remarks.push(format!(
            "{} no 16-bit PCM of one rate and passed over",
            counted(refused, "message is", "messages are")
        ));
    }
    let missing: usize = plan.holes.iter().map(Range::len).sum();
    if missing > 0 {
        remarks.push(format!(
            "{:.2} s of sound are missing between messages; what begins there is not known",
            missing as f64 / f64::from(rate)
        ));
    }
    if let Some(edge) = pace.filter(|edge| edge.slope != 0.0) {
        remarks.push(format!(
            "the clock that counts its samples runs {:+.0} ppm fast beside its messages' dates, which is put right",
            -1e6 * edge.slope
        ));
    }
    if plan.cut {
        remarks.push(format!("only {LONGEST_S} s in one are listened to"));
    }
    let (mut onset_s, mut beats) = (Vec::new(), Err(BeatError::TooShort { found_s: 0.0 }));
    if some {
        let start_s = (i128::from(plan.first_ns) - i128::from(info.start_ns)) as f64 / 1e9;
        let begins = onsets(&sound, rate_hz);
        if let Ok(begins) = &begins {
            onset_s = begins.times_s();
            onset_s.iter_mut().for_each(|t| *t = start_s + dated(*t));
        }
        beats = begins.and_then(|begins| beats_among(&begins)).map(|mut b| {
            b.beat_s.iter_mut().for_each(|t| *t = start_s + dated(*t));
            b
        });
    }
    Ok(Some(Heard {
        topic: channel.topic.clone(),
        onset_s,
        beats,
        remarks,
    }))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::beat::synth::{Drums, drums};
    use crate::steps::agreement;
    use recording::read::ReadOptions;
    use recording::topics::MessageKind;
    use recording::write::{RecordingWriter, WriterOptions};

    const BLOCK: usize = 2205;

    /// What is heard of messages out of a file.
    fn out_of_a_file(messages: impl Iterator<Item = (i64, RawAudio)>) -> Heard {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("sound.mcap");
        let mut writer = RecordingWriter::create(&path, &WriterOptions::default()).unwrap();
        let channel = writer
            .channel("/audio/drum", MessageKind::RawAudio)
            .unwrap();
        for (t_ns, message) in messages {
            writer.message(channel, t_ns, &message).unwrap();
        }
        writer.finish().unwrap();
        let recording = Recording::open(&path, &ReadOptions::default()).unwrap();
        listen(&recording).unwrap().unwrap()
    }

    /// Blocks of a tenth of a second, in an order and as late as said.
    fn heard(sound: &[f32], order: &[usize], late_s: impl Fn(usize) -> f64) -> Heard {
        out_of_a_file(order.iter().map(|&k| {
            let block = sound[k * BLOCK..].iter().take(BLOCK);
            let data = block.flat_map(|s| ((8000.0 * s) as i16).to_le_bytes());
            let t_ns = 1_000_000_000 + (1e9 * (0.1 * k as f64 + late_s(k))) as i64;
            (t_ns, RawAudio::pcm_s16(t_ns, data.collect(), 22_050, 1))
        }))
    }

    /// Twice as fast, on two channels of other loudness: the same sound, and what is no such sound is counted.
    #[test]
    fn channels_are_averaged_and_fast_sound_is_thinned() {
        let (sound, _) = drums(&Drums::default());
        let plain = heard(&sound, &(0..400).collect::<Vec<_>>(), |_| 0.0);
        let blocks = sound.chunks_exact(BLOCK).take(400).enumerate();
        let found = out_of_a_file(blocks.flat_map(|(k, block)| {
            let frame = |s: &f32| [1.5f32, 0.5].map(|gain| (8000.0 * gain * s) as i16);
            let data = block.iter().flat_map(|s| [frame(s), frame(s)].concat());
            let data: Vec<u8> = data.flat_map(i16::to_le_bytes).collect();
            let t_ns = 1_000_000_000 + 100_000_000 * k as i64;
            let fast = RawAudio::pcm_s16(t_ns, data, 44_100, 2);
            let slow = RawAudio {
                sample_rate: 8000,
                ..fast.clone()
            };
            let packed = RawAudio {
                format: "opus".into(),
                ..fast.clone()
            };
            let other = (k == 100).then_some([slow, packed]);
            let all = [fast].into_iter().chain(other.into_iter().flatten());
            all.map(move |message| (t_ns, message))
        }));
        assert!(found.remarks[0].starts_with("2 messages are no 16-bit PCM"));
        assert_eq!(found.remarks.len(), 1);
        assert_eq!(found.onset_s.len(), plain.onset_s.len());
        for (a, b) in found.onset_s.iter().zip(&plain.onset_s) {
            assert!((a - b).abs() < 1e-3, "{a} {b}");
        }
    }

    #[test]
    fn blocks_are_joined_in_the_order_of_time() {
        let (sound, truth) = drums(&Drums::default());
        let even: Vec<usize> = (0..400).collect();
        let mut mixed: Vec<usize> = even.clone();
        mixed.chunks_mut(7).for_each(<[usize]>::reverse);
        let [even, mixed] = [even, mixed].map(|order| heard(&sound, &order, |_| 0.0));
        assert_eq!(even.onset_s, mixed.onset_s);
        assert!(mixed.remarks.is_empty(), "{:?}", mixed.remarks);
        let f1 = agreement(&mixed.beats.unwrap().beat_s, &truth, 0.07).f1;
        assert!(f1 > 0.98, "{f1}");
    }

    /// What was lost moves no beat behind it, and what only came late is no hole.
    #[test]
    fn lost_blocks_leave_the_beats_where_they_are() {
        let (sound, truth) = drums(&Drums::default());
        let all: Vec<usize> = (0..400).collect();
        let lost = [31, 80, 81, 150, 157, 220, 301, 302, 303, 350];
        let left: Vec<usize> = all.iter().copied().filter(|k| !lost.contains(k)).collect();
        let late = |k: usize| 0.07 * ((k * 37) % 11) as f64 / 11.0;
        for late_s in [&(|_| 0.0) as &dyn Fn(usize) -> f64, &late] {
            let whole = heard(&sound, &all, late_s);
            assert!(whole.remarks.is_empty(), "{:?}", whole.remarks);
            let found = heard(&sound, &left, late_s);
            let said = found.remarks[0].split(' ').next().unwrap();
            let missing_s: f64 = said.parse().unwrap();
            assert!((missing_s - 1.0).abs() < 0.1, "{:?}", found.remarks);
            let [whole, found] = [whole, found].map(|heard| heard.beats.unwrap().beat_s);
            let f1 = agreement(&whole, &truth, 0.07).f1;
            assert!(f1 > 0.98, "{f1}");
            let off = |beat: &f64| {
                let each = whole.iter().map(|other| (other - beat).abs());
                each.fold(f64::MAX, f64::min)
            };
            let worst = found.iter().map(off).fold(0.0, f64::max);
            println!("{} of {} beats, {worst} s off", found.len(), whole.len());
            assert!(worst < 0.012 && whole.len() - found.len() <= 10, "{worst}");
        }
    }

    /// A recorder logs a message when its sound is complete, and its samples are counted 100 ppm too slowly: the timestamps know.
    #[test]
    fn sound_is_where_its_timestamps_say() {
        let (sound, _) = drums(&Drums::default());
        let of = |by_ppm: f64, logged_late_s: f64| {
            let messages = sound.chunks_exact(BLOCK).take(400).enumerate();
            out_of_a_file(messages.map(|(k, block)| {
                let data = block
                    .iter()
                    .flat_map(|s| ((8000.0 * s) as i16).to_le_bytes());
                let begins_s = 0.1 * k as f64 * (1.0 + 1e-6 * by_ppm);
                let t_ns = 1_000_000_000 + (1e9 * begins_s) as i64;
                let message = RawAudio::pcm_s16(t_ns, data.collect(), 22_050, 1);
                (t_ns + (1e9 * logged_late_s) as i64, message)
            }))
        };
        let (plain, found) = (of(0.0, 0.0), of(100.0, 0.1));
        assert_eq!(found.onset_s.len(), plain.onset_s.len());
        for (a, b) in plain.onset_s.iter().zip(&found.onset_s) {
            // The recording begins with its first log time.
            let there = a * (1.0 + 1e-4) - 0.1;
            assert!((b - there).abs() < 2e-5, "{b} {there}");
        }
        assert!(
            found.remarks[0].contains("-100 ppm fast"),
            "{:?}",
            found.remarks
        );
        assert!(plain.remarks.is_empty());
    }

    /// Each a sample long and 3 ms behind the one before: a hole before every one of them.
    #[test]
    fn sound_that_is_nearly_all_holes_is_planned() {
        let block = |number| Block {
            t_ns: 3_000_000 * number as i64,
            number,
            frames: 1,
        };
        let plan = Plan::of((0..300_000).map(block).collect(), 16_000.0);
        let start = |k: usize| plan.start[k].unwrap();
        assert_eq!(plan.holes.len(), 299_999);
        assert!((0..299_999).all(|k| start(k + 1).abs_diff(start(k)) == 48));
    }

    #[test]
    fn one_wrong_time_does_not_part_the_sound() {
        let block = |number| Block {
            t_ns: match number {
                5 => 0,
                _ => 1_700_000_000_000_000_000 + 100_000_000 * number as i64,
            },
            number,
            frames: 1600,
        };
        let plan = Plan::of((0..20).map(block).collect(), 16_000.0);
        let start = |k: usize| (k != 5).then_some(1600 * k);
        assert_eq!(plan.start, (0..20).map(start).collect::<Vec<_>>());
        assert_eq!(plan.holes, vec![8000..9600]);
        assert!(plan.cut);
    }
}
