//! Events and the reader's remarks as lines of text on the timeline.

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

/// Events and remarks in order of time.
fn lines(take: &Take) -> Vec<Line> {
    let mut lines: Vec<Line> = Vec::new();
    // OK because event times lie inside the recording, whose length fits.
    let at = |t_s: f64| take.start_ns.saturating_add((t_s * 1e9).round() as i64);
    for event in &take.events {
        // What names only its topic is said with its kind.
        let what = match event.what.starts_with('/') {
            true => format!("{}: {}", event.kind.replace('_', " "), once(&event.what)),
            false => event.what.clone(),
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
    use analyze::events::Event;

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
}
