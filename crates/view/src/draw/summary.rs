//! A page with the metrics, from the same table as every other output of them.

use std::fmt::Write;

use analyze::metrics::{Datum, METRICS, Metric, Value};
use re_sdk_types::archetypes::TextDocument;

use super::events;
use crate::blueprint::View;
use crate::store::Store;
use crate::take::Take;

/// Sends the page.
pub fn draw(store: &mut Store<'_>, take: &Take) -> anyhow::Result<View> {
    let page = page(take, store.about_m(None));
    store.fixed("/summary", &TextDocument::from_markdown(page))?;
    Ok(View::text("Summary", "/summary"))
}

/// The page; the scene is drawn about `origin_m`, x and y in the world.
fn page(take: &Take, origin_m: [f64; 2]) -> String {
    let mut text = format!("## {}\n\n{:.3} s", take.name, take.duration_s());
    let rows: Vec<(&Metric, &Value)> = METRICS
        .iter()
        .filter_map(|metric| Some((metric, take.metrics.get(metric.name)?)))
        .filter(|(_, value)| value.datum != Datum::Missing)
        .collect();
    if !rows.is_empty() {
        if take.window.start_s > 0.0 {
            let _ = write!(text, ", metrics from {} s on", take.window.start_s);
        }
        text += "\n\n| | |\n|---|---|\n";
        for (metric, value) in rows {
            let shown = match &value.datum {
                Datum::Number(x) => number(*x, metric.unit),
                Datum::Bool(x) => {
                    if *x {
                        "yes".to_owned()
                    } else {
                        "no".to_owned()
                    }
                }
                Datum::Word(word) => (*word).to_owned(),
                Datum::Missing => continue,
            };
            let _ = writeln!(text, "| {} | {shown} |", metric.label.replace('|', "/"));
        }
    }
    for line in words(take) {
        let _ = write!(text, "\n\n{line}");
    }
    if origin_m != [0.0; 2] {
        let [x_m, y_m] = origin_m;
        let _ = write!(
            text,
            "\n\nThe scene is far from its origin: x is drawn less {x_m} m, y less {y_m} m."
        );
    }
    text
}

/// Notes, the reader's remarks and what the log of events cuts short, each once.
fn words(take: &Take) -> Vec<String> {
    let mut out = take.notes.clone();
    let remarks = take.remarks.iter().map(|(t_s, remark)| {
        let when = t_s.map(|t_s| format!("{t_s:.2} s  ")).unwrap_or_default();
        format!("{when}{}", events::once(remark))
    });
    for line in remarks.chain(events::cut(take)) {
        // Notes say the reader's remarks too, some with their topic and some without.
        if !out
            .iter()
            .any(|said| said.ends_with(&line) || line.ends_with(said.as_str()))
        {
            out.push(line);
        }
    }
    out
}

/// Four significant digits and the unit.
fn number(x: f64, unit: &str) -> String {
    let digits = if x == 0.0 {
        3
    } else {
        (3 - x.abs().log10().floor() as i32).clamp(0, 6) as usize
    };
    let unit = match unit {
        "1" | "-" | "bool" => String::new(),
        unit => format!(" {unit}"),
    };
    format!("{x:.digits$}{unit}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_have_four_digits() {
        for (x, unit, shown) in [
            (18.3871, "deg", "18.39 deg"),
            (0.14812, "deg", "0.1481 deg"),
            (0.0, "1", "0.000"),
            (1234.56, "N", "1235 N"),
            (0.990_12, "1", "0.9901"),
        ] {
            assert_eq!(number(x, unit), shown);
        }
    }

    #[test]
    fn where_a_scene_far_away_is_drawn_is_said() {
        let said = |origin_m| page(&Take::default(), origin_m).contains("y less 5400000 m");
        assert!(said([500_000.0, 5_400_000.0]) && !said([0.0; 2]));
    }

    #[test]
    fn what_the_log_cuts_stands_here_in_full_and_once() {
        let gap =
            "/imu/data: 3 gaps in the log times (usual interval 0.010 s), the longest 5.010 s";
        let ends = "the file ends inside a chunk";
        let take = Take {
            events: vec![
                analyze::events::Event {
                    t_s: 30.0,
                    kind: "gap",
                    what: gap.into(),
                },
                analyze::events::Event {
                    t_s: 31.0,
                    kind: "beat_end",
                    what: "the beat ends".into(),
                },
            ],
            notes: vec![ends.into()],
            remarks: vec![(None, ends.into()), (None, "/a: /a: odd".into())],
            ..Take::default()
        };
        let gap = format!("30.00 s  gap: {gap}");
        assert_eq!(words(&take), [ends, "/a: odd", gap.as_str()]);
    }
}
