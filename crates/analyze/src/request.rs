//! What is asked of a recording.

use crate::inputs::Window;
use crate::roles::{RolesFile, matches, of_topic};

/// What is done about the clocks of sensors that differ.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum DeviceClocks {
    /// They are put right, and it is said how.
    #[default]
    PutRight,
    /// They are left as they are, and it is said how they differ.
    Told,
    /// Nothing: all sensors were stamped by one clock, and what looks like an offset between carriers is theirs.
    One,
}

/// What is asked of a recording.
#[derive(Clone, Debug, Default)]
pub struct Request {
    /// First and last moment of the window (s); what is `None` is decided by the recording.
    pub window: (Option<f64>, Option<f64>),
    /// Signals to list, with wildcards; empty means all.
    pub signals: Vec<String>,
    /// Topics to list, with wildcards; empty means all.
    pub topics: Vec<String>,
    /// Who plays which role, where the user says so.
    pub roles: Option<RolesFile>,
    /// Judge estimates by the recorded truth.
    pub truth: bool,
    /// What is done about the clocks of sensors.
    pub clocks: DeviceClocks,
    /// Keep the outlines of signals for drawing.
    pub traces: bool,
}

impl Request {
    /// Whether a signal of a topic is to be listed.
    pub fn lists(&self, topic: &str, path: &str) -> bool {
        (self.topics.is_empty() || self.topics.iter().any(|p| matches(p, topic)))
            && (self.signals.is_empty() || self.signals.iter().any(|p| matches(p, path)))
    }

    /// Whether an item of a list is named by the name it carries, not by its place.
    pub fn names_items(&self) -> bool {
        let named = |path: &String| {
            let places = path.split('[').skip(1);
            let mut places = places.filter_map(|rest| rest.split_once(']'));
            places.any(|(place, _)| {
                !place.is_empty() && !place.chars().all(|c| c.is_ascii_digit() || c == '*')
            })
        };
        let of_roles = self.roles.iter().flat_map(RolesFile::signals);
        self.signals
            .iter()
            .cloned()
            .chain(of_roles)
            .any(|p| named(&p))
    }

    /// Whether a field may have to be read for that, before it is known where in the path the topic ends, and whether the signal will be called
    /// `TOPIC:field` because another topic has a field of its name.
    pub(crate) fn may_list(&self, path: &str) -> bool {
        let named = |p: &String| matches(p, path) || matches(&p.replace(':', "."), path);
        (self.topics.is_empty() || self.topics.iter().any(|t| of_topic(t, path)))
            && (self.signals.is_empty() || self.signals.iter().any(named))
    }

    /// How long the window may be that was asked for, s.
    pub(crate) fn longest_s(&self) -> f64 {
        let (from, to) = self.window;
        let span_s = to.map(|to| to - from.unwrap_or(0.0));
        span_s.map_or(f64::INFINITY, |s| s.max(0.0))
    }

    /// Whether a moment is in the window that was asked for, s.
    pub(crate) fn holds(&self, t_s: f64) -> bool {
        self.asked().contains(t_s)
    }

    /// The window that was asked for.
    pub(crate) fn asked(&self) -> Window {
        Window {
            start_s: self.window.0.unwrap_or(f64::NEG_INFINITY),
            end_s: self.window.1.unwrap_or(f64::INFINITY),
        }
    }
}
