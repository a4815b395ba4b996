//! Events and the reader's remarks as lines of text on the timeline.

use std::collections::BTreeSet;

use analyze::events::Event;
use re_sdk_types::archetypes::TextLog;
use recording::load::Load;

use crate::blueprint::View;
use crate::palette;
use crate::store::Store;
use crate::take::Take;

/// Characters of a line: the log does not wrap, and its panel is narrow beside two drawings below the scene.
const NARROW: usize = 46;
/// The same elsewhere.
const WIDE: usize = 64;

/// The beginning of a line that is longer than `most`, cut after a word; the summary has it in full.
fn shortened(line: &str, most: usize) -> String {
    if line.chars().count() <= most {
        return line.to_owned();
    }
    let head: String = line.chars().take(most - 2).collect();
    let end = head.rfind(' ').unwrap_or(head.len());
    format!("{} …", head[..end].trim_end_matches([' ', ',', ':', '(']))
}

/// A sentence that says its topic once: what was said of a topic may begin with it already.
pub fn once(text: &str) -> &str {
    match text.split_once(": ") {
        Some((topic, rest)) if rest.starts_with(&format!("{topic}: ")) => rest,
        _ => text,
    }
}

/// A line of the log, in full.
struct Line {
    at_ns: i64,
    text: String,
    level: &'static str,
    color: u32,
}

/// Of more handles than have colours, those that let go or press again within so long share a line, s.
const TOGETHER_S: f64 = 0.5;

/// The last moment up to which nothing can be added to a line, s.
pub fn whole_s(until_s: f64) -> f64 {
    (until_s / TOGETHER_S).floor() * TOGETHER_S
}

/// Of a crowd, one event for all handles that let go or press again in the same interval; else the events as they are.
fn counted(take: &Take) -> Vec<Event> {
    if take.inputs.normal_n.len() <= palette::CARRIERS {
        return take.events.clone();
    }
    let of_contact = |e: &&Event| e.kind.starts_with("contact_");
    let (contact, others): (Vec<&Event>, Vec<&Event>) = take.events.iter().partition(of_contact);
    let mut out: Vec<Event> = others.into_iter().cloned().collect();
    for group in contact.chunk_by(|a, b| whole_s(a.t_s) == whole_s(b.t_s)) {
        if group.len() < 3 {
            out.extend(group.iter().map(|e| (*e).clone()));
            continue;
        }
        // One that chatters is one handle.
        let handles = |kind: &str| {
            let of_kind = group.iter().filter(|e| e.kind == kind);
            let named = of_kind.map(|e| e.what.split(' ').nth(1));
            named.collect::<BTreeSet<Option<&str>>>().len()
        };
        let lost = handles("contact_lost");
        let what = match (lost, handles("contact_regained")) {
            (0, back) => format!("{back} handles press again"),
            (lost, 0) => format!("{lost} handles go slack"),
            (lost, back) => format!("{lost} handles go slack, {back} press again"),
        };
        out.push(Event {
            t_s: group[0].t_s,
            kind: match lost {
                0 => "contact_regained",
                _ => "contact_lost",
            },
            what,
        });
    }
    out
}

/// Events and remarks in order of time.
fn lines(take: &Take) -> Vec<Line> {
    let mut lines: Vec<Line> = Vec::new();
    // OK because event times lie inside the recording, whose length fits.
    let at = |t_s: f64| take.start_ns.saturating_add((t_s * 1e9).round() as i64);
    for event in counted(take) {
        // What names only its topic, or says but a word, is said with its kind.
        let kind = event.kind.replace('_', " ");
        let what = match event.what.as_str() {
            what if what.starts_with('/') => format!("{kind}: {}", once(what)),
            what if !what.contains(' ') => format!("{kind} {what}"),
            what => what.to_owned(),
        };
        let (level, color) = match event.kind {
            "onset" => ("CRITICAL", palette::WHITE),
            // As in the scene: a handle without load, and a body nearly without support.
            "contact_lost" => ("WARN", palette::load(Load::Slack)),
            "jump" => ("WARN", palette::load(Load::NearlyUnloaded)),
            _ => ("INFO", palette::BLUE),
        };
        lines.push(Line {
            at_ns: at(event.t_s),
            text: format!("{:.2} s  {what}", event.t_s),
            level,
            color,
        });
    }
    for (t_s, text) in &take.remarks {
        let when = t_s.map(|t_s| format!("{t_s:.2} s  ")).unwrap_or_default();
        lines.push(Line {
            at_ns: at(t_s.unwrap_or(0.0)),
            text: format!("{when}{}", once(text)),
            level: "WARN",
            color: palette::ORANGE,
        });
    }
    lines.sort_by_key(|line| line.at_ns);
    lines
}

/// Characters that a line of the log has room for.
fn room(take: &Take) -> usize {
    // The circle of phases stands beside it then.
    if take.pose.is_some() && !take.inputs.phase_rad.is_empty() {
        NARROW
    } else {
        WIDE
    }
}

/// The lines that the log cuts, in full.
pub fn cut(take: &Take) -> Vec<String> {
    let long = |text: &String| text.chars().count() > room(take);
    let texts = lines(take).into_iter().map(|line| line.text);
    texts.filter(long).collect()
}

/// Sends the log where there is anything to say.
pub fn draw(store: &mut Store<'_>, take: &Take) -> anyhow::Result<Option<View>> {
    let lines = lines(take);
    if lines.is_empty() {
        return Ok(None);
    }
    let times: Vec<i64> = lines.iter().map(|line| line.at_ns).collect();
    let columns = TextLog::update_fields()
        .with_many_text(lines.iter().map(|line| shortened(&line.text, room(take))))
        .with_many_level(lines.iter().map(|line| line.level))
        .with_many_color(lines.iter().map(|line| line.color))
        .columns_of_unit_batches()?;
    store.rows("/events", &times, columns)?;
    Ok(Some(View::log("Events", "/events")))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn long_lines_end_after_a_word() {
        let short = "30.40 s  handle 1 goes slack";
        assert_eq!(shortened(short, NARROW), short);
        let long = "/imu/rath: orientation is declared as not given (covariance -1)";
        assert_eq!(
            shortened(long, NARROW),
            "/imu/rath: orientation is declared as not …"
        );
        assert_eq!(shortened(long, WIDE + 1), long);
        assert!(shortened(&"ü".repeat(100), WIDE).chars().count() <= WIDE);
    }

    #[test]
    fn of_a_crowd_handles_that_let_go_together_share_a_line() {
        let event = |t_s: f64, kind, what: &str| Event {
            t_s,
            kind,
            what: what.into(),
        };
        let mut take = Take::default();
        for k in 0..20 {
            let t_s = 1.0 + 0.01 * f64::from(k);
            // The first two of them twice.
            let what = format!("handle {} goes slack", k % 18);
            take.events.push(event(t_s, "contact_lost", &what));
        }
        take.events.push(event(1.1, "beat_end", "the beat ends"));
        take.events
            .push(event(1.45, "contact_regained", "handle 3 presses with 4 N"));
        take.events
            .push(event(1.55, "contact_regained", "handle 4 presses with 4 N"));
        take.inputs.normal_n = vec![Vec::new(); 8];
        assert_eq!(lines(&take).len(), 23);
        take.inputs.normal_n = vec![Vec::new(); 40];
        let told: Vec<String> = lines(&take).into_iter().map(|line| line.text).collect();
        assert_eq!(
            told,
            [
                "1.00 s  18 handles go slack, 1 press again",
                "1.10 s  the beat ends",
                "1.55 s  handle 4 presses with 4 N",
            ]
        );
    }

    #[test]
    fn a_topic_is_said_once() {
        let said = "/imu/data: /imu/data: 5.0 s without a hole";
        assert_eq!(once(said), "/imu/data: 5.0 s without a hole");
        assert_eq!(once("/imu/data: a hole"), "/imu/data: a hole");
        assert_eq!(once("the beat ends"), "the beat ends");
    }

    #[test]
    fn slack_has_the_colour_that_it_has_in_the_scene() {
        let take = Take {
            events: vec![Event {
                t_s: 1.0,
                kind: "contact_lost",
                what: "handle 1 goes slack".into(),
            }],
            ..Take::default()
        };
        let color = palette::load(Load::Slack);
        assert_eq!(lines(&take)[0].color, color);
    }

    #[test]
    fn a_word_alone_is_said_with_its_kind() {
        let take = Take {
            events: vec![Event {
                t_s: 1.0,
                kind: "beat",
                what: "heard".into(),
            }],
            ..Take::default()
        };
        assert_eq!(lines(&take)[0].text, "1.00 s  beat heard");
    }
}
