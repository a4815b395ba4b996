//! What the user should know of signals and topics: odd values, topics that end early, names that are not there.

use std::collections::{BTreeMap, BTreeSet, HashSet};

use recording::text::counted;

use super::natural::natural;
use super::pass::{Entry, Pass, field};
use crate::field::{ACCEL, GYRO};
use crate::inputs::Window;
use crate::quality::Quality;
use crate::roles::{Role, RolesFile, SOUND, is_carrier, matches, meant, of_topic, stands_beside};

/// A topic that begins so late or ends so early is worth a word: this share of the window, and this long (s).
const LEAST_ABSENT: f64 = 0.02;
const LEAST_ABSENT_S: f64 = 1.0;
/// No attitude that is wrapped goes beyond half a turn (rad); a little more for what rounds.
const LARGEST_ANGLE_RAD: f64 = 3.15;
/// A load that rolls farther than this, so often, does not hang on shoulders: cosine and share.
const UPSIDE_DOWN_COS: f64 = -0.5;
const MOSTLY: f64 = 0.9;
/// What stands beside an orientation where a place is meant.
const PLACES: [&str; 2] = ["position", "translation"];

/// The path with a name in the place of the last number in brackets.
fn with_name(path: &str) -> String {
    let numbered = path.rsplit_once('[').and_then(|(before, after)| {
        let (_, after) = after.split_once(']')?;
        Some(format!("{before}[NAME]{after}"))
    });
    numbered.unwrap_or_else(|| path.to_owned())
}

impl Pass<'_> {
    /// Remarks on single values: what is no rotation, and what is too large or too small to be squared.
    pub(super) fn odd_values(&self) -> Vec<Quality> {
        let info = self.recording.info();
        let start_ns = i128::from(info.start_ns);
        let mut out = Vec::new();
        for (path, (channel, count, first_ns)) in &self.quaternions.odd {
            let topic = &info.channels[*channel].topic;
            let Some(roll) = self.by_path.get(&format!("{path}.roll")) else {
                continue;
            };
            let roll = &self.entries[*roll];
            // One that never is a rotation and plays no role is not meant to be one.
            let plays = |e: &Entry| e.role.is_some() && e.path.starts_with(&format!("{path}."));
            if roll.stream.count() == 0 && !self.entries.iter().any(plays) {
                continue;
            }
            let t_s = (i128::from(*first_ns) - start_ns) as f64 / 1e9;
            let field = field(topic, path);
            out.push(Quality {
                count: *count,
                t_s: Some(t_s),
                ..Quality::remark(topic, "no_rotation", format!(
                    "{} of {field} far from unit length, first at {t_s:.3} s: no rotation, so left without angles",
                    counted(*count, "quaternion", "quaternions")
                ))
            });
        }
        let attitude = [Role::Roll, Role::Pitch, Role::Yaw].into_iter();
        for entry in attitude.flat_map(|role| self.players(role)) {
            let most = (entry.kept.iter().map(|(_, x)| x.abs())).fold(0.0, f64::max);
            let told = !entry.unit.is_empty() || self.in_degrees(entry);
            if most > LARGEST_ANGLE_RAD && !told {
                let (topic, field) = self.names(entry);
                out.push(Quality::remark(topic, "large_angle", format!(
                    "{field} reaches {most:.1}, taken as radians: where these are degrees, write angle_unit = \"deg\" in a roles file"
                )));
            }
        }
        for entry in self.players(Role::Roll) {
            let unit_rad = match self.in_degrees(entry) {
                true => 1f64.to_radians(),
                false => 1.0,
            };
            let upside = |x: f64| (unit_rad * x).cos() < UPSIDE_DOWN_COS;
            let down = entry.kept.iter().filter(|(_, x)| upside(*x)).count();
            if down as f64 > MOSTLY * entry.kept.len() as f64 {
                let (topic, field) = self.names(entry);
                out.push(Quality::remark(topic, "upside_down", format!(
                    "{field} is beyond 120 deg nearly all the time: z points down there, or the quaternion stands in the order w, x, y, z; roll, and what rests on it, is of a load on its back"
                )));
            }
        }
        for entry in self.entries.iter().filter(|e| e.listed) {
            if let Some((low, high)) = entry.stream.beyond_squares() {
                let (topic, field) = self.names(entry);
                out.push(Quality::remark(topic, "out_of_range", format!(
                    "values of {field} from {low:e} to {high:e} cannot be squared with the digits of a float: no spread and no spectrum is told of them"
                )));
            }
        }
        out
    }

    /// Where nothing tells how anybody moves, remarks on topics that might, though their type does not say so, with what to write.
    ///
    /// `mixed` are topics with lists whose places hold now this, now that.
    pub(super) fn unknown_movers(&self, mixed: &BTreeSet<&str>) -> Vec<Quality> {
        let movers = [Role::Height, Role::Roll, Role::Imu, Role::Carriers];
        if movers.iter().any(|r| !self.roles.patterns(*r).is_empty()) {
            return Vec::new();
        }
        let paths: HashSet<&str> = self.entries.iter().map(|e| &*e.path).collect();
        let topics = self.recording.info().channels.iter();
        let topics: BTreeSet<&str> = topics.map(|c| c.topic.as_str()).collect();
        let senses = |topic: &str| {
            let mut fields = GYRO.iter().chain(&ACCEL);
            fields.all(|f| paths.contains(&*format!("{topic}.{f}")))
        };
        let carriers = topics.iter().filter(|t| is_carrier(t) && senses(t));
        let carriers: Vec<String> = carriers.map(|t| format!("\"{t}\"")).collect();
        let poses = self.poses(&paths);
        let mut out = Vec::new();
        for topic in topics.into_iter().filter(|t| !stands_beside(t)) {
            if is_carrier(topic) && senses(topic) {
                let text = format!(
                    "holds what an inertial sensor tells, but its type does not say so: if a carrier wears it, write carriers = [{}] into a file for --roles",
                    carriers.join(", ")
                );
                out.push(Quality::remark(topic, "unknown_type", text));
                continue;
            }
            let poses = poses.get(topic).map_or(&[][..], Vec::as_slice);
            let (what, which, lines) = if senses(topic) {
                let what = "holds what an inertial sensor tells";
                (what, "it is", format!("imu = \"{topic}\""))
            } else if let [(place, turn), further @ ..] = poses {
                let (mut place, mut turn) = (place.clone(), turn.clone());
                let (what, which) = if mixed.contains(topic) {
                    // No place of the list is one body's.
                    (place, turn) = (with_name(&place), with_name(&turn));
                    let which = "NAME, as --by-name lists it, is";
                    ("holds poses of several, in places that change", which)
                } else if further.is_empty() {
                    ("holds a pose", "it is")
                } else {
                    ("holds several poses", "the first is")
                };
                let lines = format!("height = \"{place}.z\" and roll = \"{turn}.roll\"");
                (what, which, lines)
            } else {
                continue;
            };
            let text = format!(
                "{what}, but its type does not say whose: if {which} the load's, write {lines} into a file for --roles"
            );
            out.push(Quality::remark(topic, "unknown_type", text));
        }
        out
    }

    /// By topic: the places and orientations that its messages hold beside each other.
    fn poses(&self, paths: &HashSet<&str>) -> BTreeMap<&str, Vec<(String, String)>> {
        let mut poses: BTreeMap<&str, Vec<(String, String)>> = BTreeMap::new();
        for (path, entry) in &self.by_path {
            let turn = path.strip_suffix(".roll").unwrap_or_default();
            let around = turn.rsplit_once('.').map_or("", |(around, _)| around);
            let mut places = PLACES.iter().map(|place| format!("{around}.{place}"));
            if let Some(place) = places.find(|place| paths.contains(&*format!("{place}.z"))) {
                let channel = self.entries[*entry].channel;
                let topic = &self.recording.info().channels[channel].topic;
                let of_topic = poses.entry(topic).or_default();
                of_topic.push((place, turn.to_owned()));
            }
        }
        for of_topic in poses.values_mut() {
            of_topic.sort_by(|a, b| natural(&a.1, &b.1));
        }
        poses
    }

    /// Remarks on topics that metrics rest on and that cover clearly less of the window than there is of the recording.
    pub(super) fn coverage(
        &self,
        window: Window,
        own_s: &BTreeMap<String, (f64, f64)>,
    ) -> Vec<Quality> {
        let info = self.recording.info();
        let start_ns = i128::from(info.start_ns);
        let since = |t: i64| (i128::from(t) - start_ns) as f64 / 1e9;
        let axes = self.axes.values().filter_map(|axis| axis.own_s);
        let lasts_s = own_s.values().copied().chain(axes).map(|e| e.1);
        let lasts_s = lasts_s.fold(since(info.end_ns), f64::max);
        let from_s = window.start_s.max(0.0);
        let to_s = window.end_s.min(lasts_s);
        let sensors = [Role::Imu, Role::Carriers].map(|role| self.roles.patterns(role));
        let players = self.entries.iter().filter(|e| !e.kept.is_empty());
        let fed: HashSet<usize> = players.map(|e| self.first[e.channel]).collect();
        let sensor = |topic: &String| sensors.iter().any(|topics| topics.contains(topic));
        let feeds = |k: usize| fed.contains(&k) || sensor(&info.channels[k].topic);
        let mut out = Vec::new();
        for k in (0..info.channels.len()).filter(|k| self.first[*k] == *k && feeds(*k)) {
            let of_topic = || (0..info.channels.len()).filter(|j| self.first[*j] == k);
            let ends = of_topic().filter_map(|j| self.times[j].ends_ns());
            let ends = ends.reduce(|a, b| (a.0.min(b.0), a.1.max(b.1)));
            let told = ends.map(|(a, b)| (since(a), since(b)));
            let of_sensor = own_s.get(&info.channels[k].topic).copied();
            let own_s = of_sensor.or_else(|| self.axes.get(&k)?.own_s);
            let Some((first_s, last_s)) = own_s.or(told) else {
                continue;
            };
            let messages: u64 = of_topic().map(|j| self.times[j].count()).sum();
            let step_s = (last_s - first_s) / messages.max(2) as f64;
            let much_s = LEAST_ABSENT_S
                .max(LEAST_ABSENT * (to_s - from_s))
                .max(5.0 * step_s);
            let mut say = |kind, t_s: f64, text: String| {
                let remark = Quality::remark(&info.channels[k].topic, kind, text);
                out.push(Quality {
                    t_s: Some(t_s),
                    ..remark
                });
            };
            if first_s - from_s > much_s {
                let late_s = first_s - from_s;
                say(
                    "begins_late",
                    first_s,
                    format!(
                        "the first message is of {first_s:.3} s, {late_s:.3} s after the window begins: what rests on it does not speak of the time before"
                    ),
                );
            }
            if to_s - last_s > much_s {
                let early_s = to_s - last_s;
                say(
                    "ends_early",
                    last_s,
                    format!(
                        "the last message is of {last_s:.3} s, {early_s:.3} s before the window ends: what rests on it does not speak of the time after"
                    ),
                );
            }
        }
        out
    }

    /// What a roles file names and the recording does not have, or has too much of.
    pub(super) fn misnamed(&self, said: &RolesFile) -> Vec<String> {
        let mut out = Vec::new();
        let channels = &self.recording.info().channels;
        for role in Role::ALL {
            let (patterns, word) = (said.patterns(role), role.name());
            let names: Vec<&str> = match role.is_topic() {
                true => channels.iter().map(|c| c.topic.as_str()).collect(),
                false => self.entries.iter().map(|e| e.path.as_str()).collect(),
            };
            for pattern in &patterns {
                if names.iter().any(|name| matches(pattern, name)) {
                    out.extend(self.plays_none(role, pattern));
                    continue;
                }
                let hint = self.of_another_kind(role, pattern);
                let hint = hint.unwrap_or_else(|| meant(pattern, names.iter().copied()));
                out.push(format!(
                    "the roles file's {word}, {pattern}, is not in the recording{hint}"
                ));
            }
            let found = self.players(role).count();
            if role.is_single() && !patterns.is_empty() && found > 0 && self.player(role).is_none()
            {
                out.push(format!(
                    "the roles file's {word} fits {found} signals, where one is expected: none is taken"
                ));
            }
        }
        out
    }

    /// What is meant where a topic stands for a signal, or a signal for a topic.
    fn of_another_kind(&self, role: Role, pattern: &str) -> Option<String> {
        let channels = self.recording.info().channels.iter();
        let mut topics = channels.map(|c| c.topic.as_str());
        if role.is_topic() {
            let topic = topics.find(|topic| of_topic(topic, pattern))?;
            return Some(format!(" as a topic: is {topic} meant?"));
        }
        let topic = topics.find(|topic| *topic == pattern)?;
        let last = match role {
            Role::Height => ".z",
            Role::Forces => "force.z",
            _ => role.name(),
        };
        let paths = self.entries.iter().map(|e| e.path.as_str());
        let fits = |path: &&str| of_topic(topic, path) && path.ends_with(last);
        let like = paths.filter(fits).min_by(|a, b| natural(a, b));
        let like = like.map(|path| format!(", such as {path}"));
        let like = like.unwrap_or_default();
        Some(format!(
            " as a signal: it is a topic, and one of its fields is wanted{like}"
        ))
    }

    /// Why the topics that a pattern of a roles file names do not play the role, where they are there.
    fn plays_none(&self, role: Role, pattern: &str) -> Option<String> {
        let channels = self.recording.info().channels.iter();
        let mut named = channels.filter(|c| matches(pattern, &c.topic));
        let load = self.roles.patterns(Role::Imu);
        let (found, why) = match role {
            Role::Beats => (
                named.find(|c| c.schema == SOUND),
                "is a sound: its beats are heard without a role, and its messages are none",
            ),
            Role::Carriers if !pattern.contains('*') => (
                named.find(|c| load.contains(&c.topic)),
                "is named as the load's imu too: it is taken for that, and not for a carrier's",
            ),
            _ => return None,
        };
        let topic = &found?.topic;
        Some(format!("the roles file's {}, {topic}, {why}", role.name()))
    }
}
