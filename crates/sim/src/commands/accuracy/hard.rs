//! `sim accuracy --hard`: every hard case, by every method that claims it.

use super::{PROGRESS, patient_bar, print};
use anyhow::{Result, bail};
use serde_json::{Value, json};
use sim::cases::{CASES, Verdict, run_all};
use sim::solve::METHODS;
use std::fmt::Write as _;

/// Runs and prints the table; an error when a case does not hold.
pub fn run(as_json: bool) -> Result<()> {
    let bar = patient_bar(CASES.len() as u64, PROGRESS);
    let rows = run_all(|case| {
        bar.inc(1);
        bar.set_message(case.name);
    });
    bar.finish_and_clear();
    let text = if as_json {
        serde_json::to_string_pretty(&to_json(&rows))? + "\n"
    } else {
        table(&rows)
    };
    print(&text)?;
    let verdicts = rows.iter().flatten().flatten();
    match verdicts.filter(|v| v.broken.is_some()).count() {
        0 => Ok(()),
        n => bail!("{n} of the hard cases' runs did not hold; the table says which and why"),
    }
}

fn cell(verdict: &Option<Verdict>) -> String {
    match verdict {
        None => "-".into(),
        Some(v) if v.broken.is_some() => "BROKEN".into(),
        Some(v) if v.used < 1e-3 => "< 0.1 %".into(),
        Some(v) => format!("{:.1} %", 100.0 * v.used),
    }
}

fn table(rows: &[Vec<Option<Verdict>>]) -> String {
    let mut out = format!("  {:<18}", "case");
    for m in METHODS {
        let _ = write!(out, " {:>width$}", m.name, width = m.name.len().max(7));
    }
    out.push('\n');
    for (case, row) in CASES.iter().zip(rows) {
        let _ = write!(out, "  {:<18}", case.name);
        for (m, verdict) in METHODS.iter().zip(row) {
            let _ = write!(
                out,
                " {:>width$}",
                cell(verdict),
                width = m.name.len().max(7)
            );
        }
        out.push('\n');
    }
    out.push_str("\nHow much of its bound the worst check used; - where a method claims nothing. What must hold:\n\n");
    for (case, row) in CASES.iter().zip(rows) {
        let _ = writeln!(out, "  {:<18} {}: {}", case.name, case.about, case.holds);
        for (m, verdict) in METHODS.iter().zip(row) {
            if let Some(why) = verdict.as_ref().and_then(|v| v.broken.as_ref()) {
                let _ = writeln!(out, "  {:<18} BROKEN by {}: {why}", "", m.name);
            }
        }
    }
    out
}

fn to_json(rows: &[Vec<Option<Verdict>>]) -> Value {
    let cases = CASES.iter().zip(rows).map(|(case, row)| {
        let results = METHODS.iter().zip(row).filter_map(|(m, verdict)| {
            verdict.as_ref().map(|v| {
                let used = v.used.is_finite().then_some(v.used);
                json!({
                    "method": m.name, "holds": v.broken.is_none(), "used": used, "broken": v.broken,
                    "evaluations": v.stats.evaluations, "steps": v.stats.steps, "events": v.stats.events,
                })
            })
        });
        json!({
            "case": case.name, "about": case.about, "must_hold": case.holds,
            "results": results.collect::<Vec<_>>(),
        })
    });
    json!({ "cases": cases.collect::<Vec<_>>() })
}
