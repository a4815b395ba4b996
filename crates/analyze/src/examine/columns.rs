//! Who plays which role, and the columns that metrics are computed from.

use std::collections::BTreeMap;
use std::f64::consts::{PI, TAU};

use super::natural::natural;
use super::pass::{Entry, Pass};
use crate::beat::adler::turns::{COUNTED_S, Turns};
use crate::inputs::{Inputs, between, nearest, stretches};
use crate::phase::{continuous, wrap};
use crate::quality::Quality;
use crate::roles::{AngleUnit, Role, RolesFile};

impl Pass<'_> {
    pub(super) fn roles_played(&self) -> Vec<(&'static str, Vec<String>)> {
        let topics: Vec<&str> = self
            .recording
            .info()
            .channels
            .iter()
            .map(|c| c.topic.as_str())
            .collect();
        let mut out = Vec::new();
        for (role, patterns) in self.roles.iter() {
            let mut players: Vec<String> = match role.is_topic() {
                true => patterns
                    .iter()
                    .filter(|p| topics.contains(&p.as_str()))
                    .cloned()
                    .collect(),
                false => self.players(role).map(|e| e.path.clone()).collect(),
            };
            if !role.is_topic() {
                players.sort_by(|a, b| natural(a, b));
            }
            if !players.is_empty() {
                out.push((role.name(), players));
            }
        }
        out
    }

    pub(super) fn players(&self, role: Role) -> impl Iterator<Item = &Entry> {
        self.entries
            .iter()
            .filter(move |e| e.role == Some(role) && !e.kept.is_empty())
    }

    /// The one that plays a role; where several would, none does.
    pub(super) fn player(&self, role: Role) -> Option<&Entry> {
        let mut players = self.players(role);
        let first = players.next()?;
        players.all(|p| p.path == first.path).then_some(first)
    }

    /// Whether two signals are of one topic.
    pub(super) fn together(&self, a: &Entry, b: &Entry) -> bool {
        self.first[a.channel] == self.first[b.channel]
    }

    /// Finds when the messages that feed metrics were taken; remarks on topics where that is not what the log says.
    pub(super) fn date(&mut self) -> Vec<Quality> {
        let mut by_topic: BTreeMap<usize, Vec<&Entry>> = BTreeMap::new();
        for entry in self.entries.iter().filter(|e| !e.kept.is_empty()) {
            let topic = self.first[entry.channel];
            by_topic.entry(topic).or_default().push(entry);
        }
        let info = self.recording.info();
        let mut remarks = Vec::new();
        for (topic, entries) in by_topic {
            let arrivals = &self.arrivals[topic];
            let columns: Vec<_> =
                (entries.iter().map(|e| by_row(&e.kept, arrivals.len()))).collect();
            let bits = |x: Option<f64>| x.map(f64::to_bits);
            let axis = arrivals.dated(info.start_ns, |a, b| {
                columns.iter().all(|x| bits(x[a]) == bits(x[b]))
            });
            let name = &info.channels[topic].topic;
            let told =
                |(kind, text): &(&'static str, String)| Quality::remark(name, kind, text.clone());
            remarks.extend(axis.remarks.iter().map(told));
            self.axes.insert(topic, axis);
        }
        remarks
    }

    /// Whether an angle that plays a role is in degrees: by its field's name, else by the roles file.
    pub(super) fn in_degrees(&self, entry: &Entry) -> bool {
        let said = self.request.roles.as_ref().and_then(|r| r.angle_unit);
        let told = !entry.unit.is_empty();
        let degrees = if told {
            entry.unit == "deg"
        } else {
            said == Some(AngleUnit::Deg)
        };
        degrees && entry.role.is_some_and(Role::is_angle)
    }

    /// What a value of 1 is in the unit that its role asks for.
    fn unit(&self, entry: &Entry) -> f64 {
        match (entry.role, entry.unit) {
            (Some(Role::Height), "mm") => 1e-3,
            (Some(Role::Height), "cm") => 1e-2,
            _ if self.in_degrees(entry) => 1f64.to_radians(),
            _ => 1.0,
        }
    }

    /// A role's column, ascending in time, at most one value per time; angles in radians.
    fn column(&self, entry: &Entry) -> (Vec<f64>, Vec<f64>) {
        let topic = self.first[entry.channel];
        let Some(axis) = self.axes.get(&topic) else {
            return Default::default();
        };
        let mut x = by_row(&entry.kept, self.arrivals[topic].len());
        let unit = self.unit(entry);
        x.iter_mut().flatten().for_each(|x| *x *= unit);
        // Some tell a lean to the other side from 180 to 360°. What goes on beyond a turn, or is no angle in this unit, stays as it is.
        let mut known = x.iter().flatten().filter(|x| x.is_finite());
        let is_lean = matches!(entry.role, Some(Role::Roll | Role::Pitch | Role::Yaw));
        if is_lean && known.all(|x| (0.0..=TAU).contains(x)) {
            let beyond = x.iter_mut().flatten().filter(|x| **x > PI);
            beyond.for_each(|x| *x -= TAU);
        }
        let each = axis.t_s.iter().zip(&axis.rows);
        each.filter_map(|(t, row)| Some((*t, x[*row]?))).unzip()
    }

    pub(super) fn inputs(&self, metadata: &[(String, String)], said: Option<&RolesFile>) -> Inputs {
        let mut inputs = Inputs {
            mass_kg: said
                .and_then(|s| s.mass_kg)
                .or_else(|| number(metadata, "mass_kg"))
                .filter(|m| *m > 0.0),
            ..Inputs::default()
        };
        if let Some(g) = said
            .and_then(|s| s.gravity_m_per_s2)
            .or_else(|| number(metadata, "gravity_m_per_s2"))
            .filter(|g| *g > 0.0)
        {
            inputs.gravity_m_per_s2 = g;
        }
        // Motion: the time axis of the roll, else of whatever is there.
        for role in [Role::Roll, Role::Height, Role::Pitch, Role::Yaw] {
            let Some(entry) = self.player(role) else {
                continue;
            };
            let (t_s, x) = self.column(entry);
            if inputs.t_s.is_empty() {
                inputs.t_s.clone_from(&t_s);
            }
            let (x, own) = match (t_s == inputs.t_s, role) {
                (true, _) => (x, None),
                (false, Role::Height) => (between(&t_s, &x, &inputs.t_s), Some((t_s, x))),
                (false, _) => (wrapped(&t_s, &x, &inputs.t_s), None),
            };
            match role {
                Role::Roll => inputs.roll_rad = x,
                Role::Height => {
                    inputs.height_alone = own;
                    inputs.height_m = x;
                }
                Role::Pitch => inputs.pitch_rad = x,
                _ => inputs.yaw_rad = x,
            }
        }
        (inputs.force_t_s, inputs.normal_n, _) = self.columns(Role::Forces);
        let beside;
        (inputs.phase_t_s, inputs.phase_rad, beside) = self.columns(Role::Phases);
        if let Some(entry) = self.player(Role::BeatPhase) {
            let (t_s, psi) = self.column(entry);
            if inputs.phase_t_s.is_empty() {
                inputs.phase_t_s.clone_from(&t_s);
            }
            inputs.beat_phase_rad = match beside.is_none_or(|p| self.together(p, entry)) {
                true => at_times(&t_s, &psi, &inputs.phase_t_s),
                // Whether lost messages were of a pause nobody knows: for so long a beat goes on.
                false => turning(&t_s, &psi, &inputs.phase_t_s, COUNTED_S),
            };
        }
        let ours = self
            .players(Role::Roll)
            .chain(self.players(Role::Height))
            .next();
        if let Some(entry) = ours {
            let schema = &self.recording.info().channels[entry.channel].schema;
            if schema != "rath.State" {
                inputs.sources.attitude = "pose".into();
                inputs.sources.height = "pose".into();
            }
        }
        inputs
    }

    /// All columns of a role on the time axis of the one that has most samples, and which that is; NaN where a column has no value at a time.
    fn columns(&self, role: Role) -> (Vec<f64>, Vec<Vec<f64>>, Option<&Entry>) {
        let mut players: Vec<&Entry> = self.players(role).collect();
        players.sort_by(|a, b| natural(&a.path, &b.path));
        let found: Vec<_> = players.iter().map(|entry| self.column(entry)).collect();
        let lengths = found.iter().map(|(t_s, _)| t_s.len());
        let Some((first, _)) = lengths.enumerate().rev().max_by_key(|(_, n)| *n) else {
            return Default::default();
        };
        let axis = found[first].0.clone();
        // All of them are left out.
        if axis.is_empty() {
            return Default::default();
        }
        let on_axis = |(entry, (t_s, x)): (&&Entry, (Vec<f64>, Vec<f64>))| match (
            t_s == axis,
            self.together(entry, players[first]),
        ) {
            (true, _) => x,
            (false, true) => at_times(&t_s, &x, &axis),
            (false, false) if role == Role::Phases => turning(&t_s, &x, &axis, 0.0),
            (false, false) => nearest(&t_s, &x, &axis),
        };
        let columns = players.iter().zip(found).map(on_axis).collect();
        (axis, columns, Some(players[first]))
    }
}

/// Values by message; `None` where a message has none.
fn by_row(kept: &[(usize, f64)], messages: usize) -> Vec<Option<f64>> {
    let mut x = vec![None; messages];
    kept.iter().for_each(|(row, value)| x[*row] = Some(*value));
    x
}

/// A phase (rad) at other times: unwrapped if it comes so, else turning at about its usual rate between samples. NaN beyond the ends, in holes longer
/// than `filled_s`, beside samples that are none, and everywhere where it comes too seldom to tell how it turns.
fn turning(t_s: &[f64], x: &[f64], axis: &[f64], filled_s: f64) -> Vec<f64> {
    let turns = Turns::of(t_s, x);
    let mut out = vec![f64::NAN; axis.len()];
    if turns.folded() {
        return out;
    }
    for part in stretches(t_s, filled_s) {
        let (t_s, x) = (&t_s[part.clone()], &x[part]);
        let until_s = t_s[t_s.len() - 1];
        let places = axis.partition_point(|t| *t < t_s[0])..axis.partition_point(|t| *t <= until_s);
        for (y, at) in out[places.clone()].iter_mut().zip(&axis[places]) {
            let next = t_s.partition_point(|t| t < at);
            *y = x[next];
            if t_s[next] > *at {
                let width_s = t_s[next] - t_s[next - 1];
                let turned = turns.over(width_s, x[next] - x[next - 1]);
                *y = x[next - 1] + (at - t_s[next - 1]) / width_s * turned;
            }
        }
    }
    match turns.unwrapped {
        true => out,
        false => out.into_iter().map(wrap).collect(),
    }
}

/// An angle (rad), wrapped or not, at other times, by the shorter way between samples; −π … π, NaN beyond the ends and in holes.
fn wrapped(t_s: &[f64], x: &[f64], axis: &[f64]) -> Vec<f64> {
    let known = t_s.iter().zip(x).filter(|(_, x)| x.is_finite());
    let (t_s, x): (Vec<f64>, Vec<f64>) = known.unzip();
    let straight = between(&t_s, &continuous(&x), axis);
    straight.into_iter().map(wrap).collect()
}

/// The values at exactly the times of `axis`; NaN where there is none.
fn at_times(t_s: &[f64], x: &[f64], axis: &[f64]) -> Vec<f64> {
    let mut k = 0;
    axis.iter()
        .map(|at| {
            while k < t_s.len() && t_s[k] < *at {
                k += 1;
            }
            if k < t_s.len() && t_s[k] == *at {
                x[k]
            } else {
                f64::NAN
            }
        })
        .collect()
}

/// A finite number out of a metadata record.
pub(super) fn number(metadata: &[(String, String)], key: &str) -> Option<f64> {
    let (_, value) = metadata.iter().find(|(k, _)| k == key)?;
    value.trim().parse().ok().filter(|x: &f64| x.is_finite())
}
