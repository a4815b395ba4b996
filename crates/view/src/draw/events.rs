//! Events and the reader's remarks as lines of text on the timeline.

use re_sdk_types::archetypes::TextLog;

use crate::blueprint::View;
use crate::palette;
use crate::store::Store;
use crate::take::Take;

/// Characters of a line: the log does not wrap, and its panel is narrow beside drawings of the scene.
const NARROW: usize = 46;
/// The same where there is no scene.
const WIDE: usize = 62;

/// The beginning of a line that is longer than `most`, cut after a word; the summary has the reader's remarks in full.
fn shortened(line: &str, most: usize) -> String {
    if line.chars().count() <= most {
        return line.to_owned();
    }
    let head: String = line.chars().take(most - 2).collect();
    let end = head.rfind(' ').unwrap_or(head.len());
    format!("{} …", head[..end].trim_end_matches([' ', ',', ':', '(']))
}

/// Sends the log where there is anything to say.
pub fn draw(store: &mut Store<'_>, take: &Take) -> anyhow::Result<Option<View>> {
    let most = if take.pose.is_some() { NARROW } else { WIDE };
    let mut lines: Vec<(i64, String, &'static str, u32)> = Vec::new();
    // OK because event times lie inside the recording, whose length fits.
    let at = |t_s: f64| take.start_ns.saturating_add((t_s * 1e9).round() as i64);
    for event in &take.events {
        // What names only its topic is said with its kind.
        let what = match event.what.starts_with('/') {
            true => format!("{}: {}", event.kind.replace('_', " "), event.what),
            false => event.what.clone(),
        };
        let (level, color) = match event.kind {
            "onset" => ("CRITICAL", palette::VERMILION),
            "contact_lost" | "jump" => ("WARN", palette::YELLOW),
            _ => ("INFO", palette::BLUE),
        };
        lines.push((
            at(event.t_s),
            shortened(&format!("{:.2} s  {}", event.t_s, what), most),
            level,
            color,
        ));
    }
    for (t_s, text) in &take.remarks {
        let when = t_s.map(|t_s| format!("{t_s:.2} s  ")).unwrap_or_default();
        lines.push((
            at(t_s.unwrap_or(0.0)),
            shortened(&format!("{when}{text}"), most),
            "WARN",
            palette::ORANGE,
        ));
    }
    if lines.is_empty() {
        return Ok(None);
    }
    lines.sort_by_key(|line| line.0);
    let times: Vec<i64> = lines.iter().map(|line| line.0).collect();
    let columns = TextLog::update_fields()
        .with_many_text(lines.iter().map(|line| line.1.as_str()))
        .with_many_level(lines.iter().map(|line| line.2))
        .with_many_color(lines.iter().map(|line| line.3))
        .columns_of_unit_batches()?;
    store.rows("/events", &times, columns)?;
    Ok(Some(View::log("Events", "/events")))
}

#[cfg(test)]
mod tests {
    use super::{NARROW, WIDE, shortened};

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
}
