//! A recording in one pass: a line per signal, the roles' columns, what is odd; then metrics, spectra and events.

mod analysis;
mod columns;
mod listing;
mod natural;
mod pass;
mod remarks;

pub use analysis::{Analysis, Topic, Trace};
pub(crate) use listing::MOST_SERIES;
pub use natural::natural;
pub(crate) use pass::with_angles;

use std::collections::BTreeSet;

use recording::read::{ReadError, Recording};

use crate::events::{Event, events};
use crate::field::Field;
use crate::inputs::Window;
use crate::metrics::metrics;
use crate::quality::Quality;
use crate::request::Request;
use crate::roles::{Role, Roles, RolesFile};
use columns::number;
use listing::spectra;
use pass::{Pass, wanted};

/// Reads `recording` once and finds everything.
///
/// # Errors
/// Where the file cannot be read at all; damage inside it is part of the answer.
pub fn examine(
    file: &str,
    recording: &Recording,
    request: &Request,
) -> Result<Analysis, ReadError> {
    let info = recording.info();
    let channels = info
        .channels
        .iter()
        .map(|c| (c.topic.as_str(), c.schema.as_str()));
    let roles = Roles::infer(channels, request.roles.as_ref());
    let mut pass = Pass::new(recording, request, &roles);
    let select = |path: &str| wanted(path, request, &roles);
    let findings = recording.stream(&select, &mut |batch| pass.take(batch))?;
    pass.fields_before_angles();
    let skipped_messages = recording.skipped_messages().max(info.skipped_messages);
    let mut quality: Vec<Quality> = findings.into_iter().map(Quality::from).collect();
    quality.sort_by(|a, b| (&a.topic, a.kind).cmp(&(&b.topic, b.kind)));

    let mut warnings = info.warnings.clone();
    let metadata: Vec<(String, String)> = info
        .metadata
        .get("rath")
        .map(|m| m.iter().map(|(k, v)| (k.clone(), v.clone())).collect())
        .unwrap_or_default();
    let duration_s = ((i128::from(info.end_ns) - i128::from(info.start_ns)) as f64 / 1e9).max(0.0);
    let said = request.roles.as_ref();
    warnings.extend(said.iter().flat_map(|said| pass.misnamed(said)));
    let mut remarks = pass.put_in_order()?;
    remarks.extend(pass.odd_values());
    remarks.extend(pass.date());
    let chosen = roles.chosen.iter();
    remarks
        .extend(chosen.map(|(topic, text)| Quality::remark(topic, "one_of_several", text.clone())));
    let mut inputs = pass.inputs(&metadata, said);
    // What was written at once lasts longer than its log.
    let own = pass.axes.values().filter_map(|axis| axis.own_s);
    let lasts_s = own.map(|e| e.1).fold(duration_s, f64::max);
    let until = |last_s: f64, warnings: &mut Vec<String>| {
        window(request, &metadata, said, lasts_s.max(last_s), warnings)
    };
    let mut field = match estimates(recording, &roles, request) {
        Ok(()) => Field::read(
            recording,
            &roles,
            inputs.gravity_m_per_s2,
            request,
            !inputs.beat_phase_rad.is_empty(),
            |last_s| until(last_s, &mut Vec::new()),
        )?,
        Err(why) => {
            warnings.extend(why);
            Field::default()
        }
    };
    if request.truth && !field.has_truth() {
        warnings.push("no truth is known in the recording: estimates are judged by the pose of a topic whose name holds \"truth\", or of truth = \"TOPIC\" in a file for --roles".into());
    }
    let window = until(field.last_s(), &mut warnings);
    let outside = outside(window, lasts_s.max(field.last_s()));
    warnings.extend(field.warnings());
    field.fill(&mut inputs);
    field.hold_against_pose(&inputs, &roles, window);
    quality.extend(remarks);
    quality.extend(pass.coverage(window, &field.own_s));
    let mixed = quality.iter().filter(|q| q.kind == "mixed_items");
    let mixed: BTreeSet<&str> = mixed.map(|q| q.topic.as_str()).collect();
    let movers = pass.unknown_movers(&mixed);
    quality.extend(movers);
    quality.extend(field.quality());
    let mut metrics = metrics(&inputs, window);
    field.finish(&inputs, &mut metrics, window);
    let f_hz = metrics
        .number("beat_hz")
        .or_else(|| metrics.number("peak_hz"));
    let mut spectra = spectra(&pass, &inputs, window, f_hz);
    let signals = pass.signals(f_hz, &mut spectra);
    let mut events = events(&inputs, window);
    events.extend(quality.iter().filter(|q| q.kind == "gap").filter_map(|q| {
        Some(Event {
            t_s: q.t_s?,
            kind: "gap",
            what: format!("{}: {}", q.topic, q.text),
        })
    }));
    events.extend(field.events());
    events.sort_by(|a, b| a.t_s.total_cmp(&b.t_s));
    let (traces, undrawn) = pass.traces();
    let topics = pass.topics();
    let samples = match inputs.t_s.len() {
        0 => topics.iter().map(|t| t.messages).max().unwrap_or(0),
        n => n as u64,
    };
    Ok(Analysis {
        file: file.to_owned(),
        duration_s,
        samples,
        window,
        outside,
        profile: info.profile.clone(),
        library: info.library.clone(),
        messages: info.messages,
        topics,
        salvaged: info.salvaged,
        skipped_messages,
        warnings,
        metadata,
        roles: pass.roles_played(),
        signals,
        quality,
        metrics,
        spectra,
        events,
        inputs,
        traces,
        undrawn,
    })
}

/// Whether motion is estimated from inertial sensors; where there are some and it is not, the reason.
fn estimates(
    recording: &Recording,
    roles: &Roles,
    request: &Request,
) -> Result<(), Option<String>> {
    let mut sensors = roles
        .patterns(Role::Imu)
        .iter()
        .chain(roles.patterns(Role::Carriers));
    let channels = &recording.info().channels;
    let any = sensors.any(|t| channels.iter().any(|c| c.topic == *t && c.messages > 0));
    if any && !request.truth && !request.signals.is_empty() {
        return Err(Some(
            "motion is not estimated from the inertial sensors where --signal narrows what is read"
                .into(),
        ));
    }
    Ok(())
}

/// The window: what the user says, else from the recording's own start of analysis to its end.
fn window(
    request: &Request,
    metadata: &[(String, String)],
    said: Option<&RolesFile>,
    duration_s: f64,
    warnings: &mut Vec<String>,
) -> Window {
    let end_s = request.window.1.unwrap_or(duration_s);
    let own = said
        .and_then(|s| s.analysis_start_s)
        .or_else(|| number(metadata, "analysis_start_s"))
        .unwrap_or(0.0);
    let start_s = match request.window.0 {
        Some(start_s) => start_s,
        None if own < end_s || own == 0.0 => own,
        None => {
            let what = match request.window.1 {
                Some(_) => "window",
                None => "recording",
            };
            warnings.push(format!("the {what} ends at {end_s:.3} s, before the recording's own analysis would start at {own} s: all of it from 0 s on is analysed"));
            0.0
        }
    };
    Window { start_s, end_s }
}

/// Said of a window that holds nothing of the recording.
fn outside(Window { start_s, end_s }: Window, duration_s: f64) -> Option<String> {
    (start_s > duration_s || end_s < 0.0).then(|| {
        format!("the window from {start_s} to {end_s} s is outside the recording, which lasts {duration_s:.3} s: nothing of it can be analysed")
    })
}
