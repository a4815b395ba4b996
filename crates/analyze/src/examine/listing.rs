//! What is listed and drawn: a line per signal, outlines, spectra.

use std::collections::HashSet;

use rayon::prelude::*;

use super::analysis::Trace;
use super::natural::natural;
use super::pass::{Entry, Pass};
use crate::inputs::{Inputs, Window};
use crate::peaks::SpectrumSummary;
use crate::roles::Role;
use crate::summary::Summary;

/// At most so many panels of traces are kept.
const MOST_TRACES: usize = 24;
/// At most so many signals are drawn in one panel: as there are colours.
pub(crate) const MOST_SERIES: usize = 7;

impl Pass<'_> {
    /// Leaves a name to the field that has it, where angles were taken under it before the first message with that field came.
    pub(super) fn fields_before_angles(&mut self) {
        let fields = self.by_column.iter().flatten();
        let fields: HashSet<&str> = fields.map(|k| &*self.entries[*k].path).collect();
        let doubled = |path: &String, _: &mut usize| fields.contains(path.as_str());
        let doubled: Vec<usize> = (self.by_path.extract_if(doubled)).map(|(_, k)| k).collect();
        for entry in doubled {
            let entry = &mut self.entries[entry];
            (entry.listed, entry.role, entry.outline) = (false, None, None);
        }
    }

    /// A line for every listed signal. Spectra of those that were asked for by name are added to `spectra`, which are named after f.
    pub(super) fn signals(
        &self,
        f_hz: Option<f64>,
        spectra: &mut Vec<(String, SpectrumSummary)>,
    ) -> Vec<(String, Summary)> {
        let known: HashSet<&str> = spectra.iter().map(|(path, _)| path.as_str()).collect();
        let told = |e: &Entry| !self.request.signals.is_empty() && !known.contains(&*e.path);
        // Each signal by itself, so on all processors.
        let found: Vec<(Summary, Option<SpectrumSummary>)> = self
            .entries
            .par_iter()
            .filter(|e| e.listed)
            .map(|e| {
                let times = self.times_of(e);
                let (summary, spectrum) = e.stream.finish(times, e.unit, told(e));
                let spectrum = spectrum.map(|s| SpectrumSummary::new(s, f_hz, e.unit));
                (summary, spectrum)
            })
            .collect();
        let mut signals = Vec::with_capacity(found.len());
        let paths = self.entries.iter().filter(|e| e.listed).map(|e| &e.path);
        for (path, (summary, told)) in paths.zip(found) {
            spectra.extend(told.map(|told| (path.clone(), told)));
            // Angles of a quaternion that never held a rotation say nothing.
            if summary.count > 0 || !self.by_path.contains_key(path) {
                signals.push((path.clone(), summary));
            }
        }
        signals.sort_by(|a, b| natural(&a.0, &b.0));
        signals
    }

    /// Outlines of moving signals without a role, those of one vector together, and how many find no place.
    pub(super) fn traces(&self) -> (Vec<Trace>, u64) {
        // Topics that play a role are drawn as that; transforms, scenes and joints repeat them, where there are some.
        let none = self.entries.iter().all(|e| e.role.is_none())
            && (self.roles.topic(Role::Imu).is_none()
                && self.roles.topic(Role::Carriers).is_none());
        let known = |channel: usize| {
            let info = &self.recording.info().channels[channel];
            let repeats = [
                "TFMessage",
                "SceneUpdate",
                "FrameTransform",
                "FrameTransforms",
            ]
            .iter()
            .any(|s| info.schema.ends_with(s));
            (repeats && !none)
                || info.topic == recording::topics::MOTION
                || self
                    .entries
                    .iter()
                    .any(|e| e.channel == channel && e.role.is_some())
        };
        let mut drawn: Vec<&Entry> = self
            .entries
            .iter()
            .filter(|e| e.outline.is_some() && !known(e.channel))
            .collect();
        drawn.sort_by(|a, b| natural(&a.path, &b.path));
        let mut traces: Vec<Trace> = Vec::new();
        let mut undrawn = 0;
        for entry in drawn {
            let Some(outline) = &entry.outline else {
                continue;
            };
            let (t_s, x) = outline.points();
            let moves = x.iter().any(|v| *v != x[0]);
            if !moves {
                continue;
            }
            let (shared, last) = entry.path.rsplit_once('.').unwrap_or(("", &entry.path));
            let fits = |t: &Trace| {
                let seen = &t.series[0].2;
                let alike = !entry.unit.is_empty() || are_alike_large(seen, &x);
                t.topic == shared && t.unit == entry.unit && alike && t.series.len() < MOST_SERIES
            };
            match traces.iter().position(fits) {
                Some(k) => traces[k].series.push((last.to_owned(), t_s, x)),
                None if traces.len() < MOST_TRACES => {
                    traces.push(Trace {
                        topic: shared.to_owned(),
                        unit: entry.unit.to_owned(),
                        series: vec![(last.to_owned(), t_s, x)],
                    });
                }
                None => undrawn += 1,
            }
        }
        (traces, undrawn)
    }
}

/// Spectra of the roles' columns.
pub(super) fn spectra(
    pass: &Pass,
    inputs: &Inputs,
    window: Window,
    f_hz: Option<f64>,
) -> Vec<(String, SpectrumSummary)> {
    let name = |role: Role, k: usize| {
        let mut paths: Vec<&str> = pass.players(role).map(|e| e.path.as_str()).collect();
        paths.sort_by(|a, b| natural(a, b));
        paths
            .get(k)
            .map_or_else(|| role.name().to_owned(), |p| (*p).to_owned())
    };
    let mut out = Vec::new();
    let (height_t_s, height_m) = inputs.height();
    for (role, t_s, x, unit) in [
        (Role::Height, height_t_s, height_m, "m"),
        (Role::Roll, &inputs.t_s, &inputs.roll_rad, "rad"),
        (Role::Pitch, &inputs.t_s, &inputs.pitch_rad, "rad"),
    ] {
        let found = SpectrumSummary::of(t_s, x, window, f_hz, unit);
        out.extend(found.map(|s| (name(role, 0), s)));
    }
    for (k, force) in inputs.normal_n.iter().enumerate() {
        out.extend(
            SpectrumSummary::of(inputs.force_times(), force, window, f_hz, "N")
                .map(|s| (name(Role::Forces, k), s)),
        );
    }
    out
}

/// Whether one scale shows both: the larger's greatest size is at most ten times the smaller's.
fn are_alike_large(x: &[f64], y: &[f64]) -> bool {
    let [x, y] = [x, y].map(|v| v.iter().fold(0.0, |most: f64, v| most.max(v.abs())));
    x.max(y) <= 10.0 * x.min(y)
}
