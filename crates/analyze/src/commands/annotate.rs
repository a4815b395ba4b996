//! `--annotate OUT.mcap`: the recording again, with what was found as topics beside it.

use std::path::Path;

use analyze::examine::Analysis;
use analyze::inputs::{Inputs, stretches};
use analyze::metrics::{Datum, stretch_samples};
use analyze::phase;
use nalgebra::UnitQuaternion;
use recording::cdr::{Float64, Log, Time};
use recording::read::Recording;
use recording::schema::rath;
use recording::topics::MessageKind;
use recording::write::{RawChannel, RecordingWriter, WriterOptions};

/// What was found in an earlier round makes room for what is found now.
fn is_found(topic: &str) -> bool {
    topic.starts_with("/findings/")
}

/// Copies every message, attachment and metadata record as it is and adds `/findings/...`; the file appears whole or not at all.
pub(super) fn write(recording: &Recording, analysis: &Analysis, out: &Path) -> anyhow::Result<()> {
    let info = recording.info();
    let mut own = own(analysis, info.start_ns);
    own.sort_by_key(|m| m.t_ns);
    let mut kinds: Vec<(&'static str, MessageKind)> = Vec::new();
    for message in &own {
        if kinds.iter().all(|(t, _)| *t != message.topic) {
            let kind = match message.content {
                Content::Text(..) => MessageKind::Log,
                Content::Number(_) => MessageKind::Float64,
                Content::State(_) => MessageKind::RathState,
                Content::Phases(_) => MessageKind::Phases,
            };
            kinds.push((message.topic, kind));
        }
    }
    let options = WriterOptions {
        profile: profile(&info.profile, kinds.iter().map(|(_, kind)| *kind)),
        ..WriterOptions::default()
    };
    let mut writer = RecordingWriter::create(out, &options)?;
    for (name, values) in recording.metadata_records() {
        if name != "findings" {
            writer.metadata(name, values)?;
        }
    }
    writer.metadata("findings", &findings(analysis))?;
    for attachment in recording.attachments() {
        writer.copy_attachment(&attachment)?;
    }
    let mut channels = Vec::new();
    for c in &info.channels {
        channels.push(match is_found(&c.topic) {
            true => None,
            false => Some(writer.raw_channel(&RawChannel::from(c))?),
        });
    }
    let mut topics: Vec<(&'static str, _)> = Vec::new();
    for (topic, kind) in kinds {
        topics.push((topic, writer.channel(topic, kind)?));
    }
    let mut own = own.into_iter().peekable();
    let mut result = Ok(());
    recording.messages(&|_| true, &mut |raw| {
        let mut both = || -> anyhow::Result<()> {
            while let Some(message) = own.next_if(|m| m.t_ns <= raw.log_time_ns) {
                put(&mut writer, &topics, &message)?;
            }
            if let Some(channel) = channels[raw.channel] {
                writer.copy(channel, raw)?;
            }
            Ok(())
        };
        if result.is_ok() {
            result = both();
        }
    })?;
    result?;
    for message in own {
        put(&mut writer, &topics, &message)?;
    }
    Ok(writer.finish()?)
}

/// The recording's profile, but for one that allows encodings which what is added does not have.
fn profile(profile: &str, mut added: impl Iterator<Item = MessageKind>) -> String {
    let holds = match profile {
        "ros1" => added.next().is_none(),
        "ros2" => added.all(|kind| kind.encoding() == "cdr"),
        _ => true,
    };
    if holds { profile } else { "" }.to_owned()
}

struct Message {
    t_ns: i64,
    topic: &'static str,
    content: Content,
}

enum Content {
    Number(f64),
    Text(&'static str, String),
    State(rath::State),
    Phases(rath::Phases),
}

fn put(
    writer: &mut RecordingWriter,
    topics: &[(&'static str, recording::write::ChannelId)],
    message: &Message,
) -> anyhow::Result<()> {
    let Some((_, channel)) = topics.iter().find(|(t, _)| *t == message.topic) else {
        return Ok(());
    };
    match &message.content {
        Content::Number(data) => {
            writer.message(*channel, message.t_ns, &Float64 { data: *data })?
        }
        Content::State(state) => writer.message(*channel, message.t_ns, state)?,
        Content::Phases(phases) => writer.message(*channel, message.t_ns, phases)?,
        Content::Text(kind, what) => {
            let log = Log {
                stamp: Time::from_ns(message.t_ns),
                // 20 is what the message type calls information.
                level: 20,
                name: (*kind).to_owned(),
                msg: what.clone(),
            };
            writer.message(*channel, message.t_ns, &log)?;
        }
    }
    Ok(())
}

/// The metrics by name, as text.
fn findings(a: &Analysis) -> std::collections::BTreeMap<String, String> {
    let text = |d: &Datum| match d {
        Datum::Number(x) => Some(x.to_string()),
        Datum::Bool(x) => Some(x.to_string()),
        Datum::Word(x) => Some((*x).to_owned()),
        Datum::Missing => None,
    };
    let mut out: std::collections::BTreeMap<String, String> = a
        .metrics
        .iter()
        .filter_map(|(name, v)| Some((name.to_owned(), text(&v.datum)?)))
        .collect();
    out.insert("version".into(), env!("CARGO_PKG_VERSION").into());
    out.insert(
        "window_s".into(),
        format!("{} {}", a.window.start_s, a.window.end_s),
    );
    out
}

/// Everything that is added.
fn own(a: &Analysis, start_ns: i64) -> Vec<Message> {
    let at = |t_s: f64| start_ns.saturating_add((t_s * 1e9).round() as i64).max(0);
    let mut out: Vec<Message> = a
        .events
        .iter()
        .map(|e| Message {
            t_ns: at(e.t_s),
            topic: "/findings/events",
            content: Content::Text(e.kind, e.what.clone()),
        })
        .collect();
    let i = &a.inputs;
    let mut series = |topic: &'static str, t_s: &[f64], x: &[f64]| {
        let finite = t_s.iter().zip(x).filter(|(_, x)| x.is_finite());
        out.extend(finite.map(|(t, x)| Message {
            t_ns: at(*t),
            topic,
            content: Content::Number(*x),
        }));
    };
    let phases: Vec<&[f64]> = i.phase_rad.iter().map(|p| &p[..]).collect();
    // Who walks alone is in step with nobody.
    if phases.len() > 1 {
        series(
            "/findings/order_parameter",
            i.phase_times(),
            &phase::order_parameter(&phases),
        );
    }
    if let Some(mass_kg) = i.mass_kg {
        let ratio: Vec<f64> = i
            .total_force_n()
            .iter()
            .map(|n| n / (mass_kg * i.gravity_m_per_s2))
            .collect();
        series("/findings/support_ratio", i.force_times(), &ratio);
    }
    // The onset's stretches of 2 s, of which none spans a hole.
    let m = stretch_samples(&i.t_s).unwrap_or(usize::MAX);
    for stretch in stretches(&i.t_s, 0.0) {
        let roll_rad = i.roll_rad.get(stretch.clone()).unwrap_or_default();
        if roll_rad.len() < m || !roll_rad.iter().all(|r| r.is_finite()) {
            continue;
        }
        let rms = |w: &[f64]| {
            (w.iter().map(|r| r * r).sum::<f64>() / m as f64)
                .sqrt()
                .to_degrees()
        };
        let rms: Vec<f64> = roll_rad.windows(m).map(rms).collect();
        series("/findings/rms_roll_2s_deg", &i.t_s[stretch][m - 1..], &rms);
    }
    out.extend(
        states(i)
            .into_iter()
            .chain(gait(i))
            .map(|(t_s, topic, content)| Message {
                t_ns: at(t_s),
                topic,
                content,
            }),
    );
    out
}

/// The body's motion where only an inertial sensor saw it: roll and pitch, and the height about its slow course. Nobody saw the heading.
fn states(i: &Inputs) -> Vec<(f64, &'static str, Content)> {
    if i.sources.attitude != "imu" {
        return Vec::new();
    }
    let state = |(k, t_s): (usize, &f64)| {
        let (roll_rad, pitch_rad) = (*i.roll_rad.get(k)?, *i.pitch_rad.get(k)?);
        let seen = roll_rad.is_finite() && pitch_rad.is_finite();
        let q = UnitQuaternion::from_euler_angles(roll_rad, pitch_rad, 0.0);
        let height = i.height_m.get(k).copied().filter(|z| z.is_finite());
        seen.then(|| {
            let state = rath::State {
                time_s: *t_s,
                position_m: height.map(|z| rath::Vector3 { x: 0.0, y: 0.0, z }),
                orientation: Some(rath::Quaternion {
                    x: q.i,
                    y: q.j,
                    z: q.k,
                    w: q.w,
                }),
                roll_rad,
                pitch_rad,
                ..rath::State::default()
            };
            (*t_s, "/findings/state", Content::State(state))
        })
    };
    i.t_s.iter().enumerate().filter_map(state).collect()
}

/// Phases that steps tell.
fn gait(i: &Inputs) -> Vec<(f64, &'static str, Content)> {
    if i.sources.phases != "imu" {
        return Vec::new();
    }
    let message = |(k, t_s): (usize, &f64)| {
        let phase_rad: Vec<f64> = i.phase_rad.iter().map(|p| p[k]).collect();
        let beat = i.beat_phase_rad.get(k).copied().filter(|b| b.is_finite());
        phase_rad.iter().all(|p| p.is_finite()).then(|| {
            let each: Vec<&[f64]> = phase_rad.chunks(1).collect();
            let phases = rath::Phases {
                time_s: *t_s,
                order_parameter: phase::order_parameter(&each)[0],
                beat_present: beat.is_some(),
                beat_phase_rad: beat,
                natural_frequency_rad_per_s: Vec::new(),
                phase_rad,
            };
            (*t_s, "/findings/phases", Content::Phases(phases))
        })
    };
    i.phase_times()
        .iter()
        .enumerate()
        .filter_map(message)
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A profile holds of the copy where what is added keeps its encoding.
    #[test]
    fn a_profile_is_kept_while_it_holds() {
        let (cdr, protobuf) = (MessageKind::Log, MessageKind::RathState);
        for (name, added, kept) in [
            ("ros2", vec![cdr, MessageKind::Float64], "ros2"),
            ("ros2", vec![cdr, protobuf], ""),
            ("ros1", vec![cdr], ""),
            ("ros1", vec![], "ros1"),
            ("x-own", vec![protobuf], "x-own"),
        ] {
            assert_eq!(profile(name, added.into_iter()), kept);
        }
    }
}
