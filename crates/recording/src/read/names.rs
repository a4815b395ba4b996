//! What items of lists are called, and which places of lists hold now this one, now that one: `[0]` is then nobody's signal.

use std::collections::{BTreeSet, HashMap};

use super::types::{Struct, Type};

/// The text field that says what an item of a list is: a frame of `tf2_msgs/TFMessage` and `foxglove.FrameTransforms`, a joint of
/// `foxglove.JointStates`.
const OF_ITEMS: [&str; 2] = ["child_frame_id", "name"];

/// The list of texts that says what the lists of numbers behind it in the same message are of: `sensor_msgs/JointState` and
/// `trajectory_msgs/JointTrajectory`.
const OF_LISTS: [&str; 2] = ["name", "joint_names"];

/// So many names of one place are told, and so many bytes of each.
const MOST_TOLD: usize = 4;
const MOST_BYTES: usize = 64;
/// Of more lists nothing is kept.
const MOST_LISTS: usize = 1 << 16;

/// The field whose text names an item, out of its text fields.
pub(super) fn of_item<'a>(texts: impl Iterator<Item = &'a str> + Clone) -> Option<&'a str> {
    let named = |name: &&str| texts.clone().find(|text| text == name);
    OF_ITEMS.iter().find_map(named)
}

/// Whether a key or field may be a name or a list of names.
pub(super) fn is_name(field: &str) -> bool {
    OF_ITEMS.contains(&field) || is_list(field)
}

/// Whether it may be a list of names.
pub(super) fn is_list(field: &str) -> bool {
    OF_LISTS.contains(&field)
}

/// The place among its fields of the list that names the items of the lists behind it.
pub(super) fn list_of(message: &Struct) -> Option<usize> {
    let is_text = |kind: &Type| matches!(kind, Type::Sequence(item) if **item == Type::Text);
    let is_names = |(field, kind): &(String, Type)| is_list(field) && is_text(kind);
    message.fields.iter().position(is_names)
}

/// The smallest names of one place of a list, one more than are told: which they are does not depend on the order in which threads see them.
#[derive(Debug, Default)]
pub(super) struct Called(BTreeSet<String>);

impl Called {
    /// Adds a name, unless it is known or not among the smallest.
    pub fn add(&mut self, name: &str) -> bool {
        let beyond = self.0.len() > MOST_TOLD && self.0.last().is_some_and(|last| **last < *name);
        if beyond || !self.0.insert(name.to_owned()) {
            return false;
        }
        if self.0.len() > MOST_TOLD + 1 {
            self.0.pop_last();
        }
        true
    }

    fn knows(&self, name: &str) -> bool {
        self.0.contains(name)
    }

    /// The names, where there are several, as a sentence has them.
    pub fn several(&self) -> Option<String> {
        let told: Vec<&str> = self.0.iter().take(MOST_TOLD).map(String::as_str).collect();
        match self.0.len() {
            0 | 1 => None,
            2..=MOST_TOLD => Some(told.join(", ")),
            _ => Some(format!("{} and others", told.join(", "))),
        }
    }
}

/// A place of a list and what it was called: list, place, name.
pub(super) type Sight = (String, usize, String);

/// What the places of the lists of one channel were called, as one thread saw it.
#[derive(Debug, Default)]
pub(super) struct Names {
    /// By list: its name, and what each of its places was called.
    lists: Vec<(String, Vec<Called>)>,
    /// Places among the lists.
    by_field: HashMap<String, usize>,
    /// Of the message in hand: list, place, name.
    seen: Vec<(usize, usize, String)>,
    /// Not yet given away.
    new: Vec<Sight>,
}

impl Names {
    /// The number under which a list goes here.
    pub fn list(&mut self, field: &str) -> usize {
        if let Some(known) = self.by_field.get(field) {
            return *known;
        }
        // Messages may never stop inventing lists.
        let list = self.lists.len();
        if list < MOST_LISTS {
            self.lists.push((field.to_owned(), Vec::new()));
            self.by_field.insert(field.to_owned(), list);
        }
        list
    }

    /// The message in hand calls a place of a list so.
    pub fn see(&mut self, list: usize, place: usize, name: &[u8]) {
        let name = String::from_utf8_lossy(&name[..name.len().min(MOST_BYTES)]);
        let Some((_, places)) = self.lists.get(list).filter(|_| !name.is_empty()) else {
            return;
        };
        if !places.get(place).is_some_and(|called| called.knows(&name)) {
            self.seen.push((list, place, name.into_owned()));
        }
    }

    /// Forgets what the message in hand said.
    pub fn take_back(&mut self) {
        self.seen.clear();
    }

    /// Keeps what it said.
    pub fn keep(&mut self) {
        for (list, place, name) in self.seen.drain(..) {
            let (field, places) = &mut self.lists[list];
            if places.len() <= place {
                places.resize_with(place + 1, Called::default);
            }
            if places[place].add(&name) {
                self.new.push((field.clone(), place, name));
            }
        }
    }

    /// What was not given away before.
    pub fn take_new(&mut self) -> Vec<Sight> {
        std::mem::take(&mut self.new)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_a_place_was_called_does_not_depend_on_the_order() {
        let names = ["g", "b", "f", "a", "e", "c", "d"];
        let mut orders = vec![names.to_vec(), names.iter().rev().copied().collect()];
        orders.push([&names[3..], &names[..3]].concat());
        for order in orders {
            let mut called = Called::default();
            order.iter().for_each(|name| {
                called.add(name);
            });
            assert_eq!(called.several().as_deref(), Some("a, b, c, d and others"));
        }
        let mut called = Called::default();
        assert!(called.add("b") && !called.add("b"));
        assert_eq!(called.several(), None);
        assert!(called.add("a"));
        assert_eq!(called.several().as_deref(), Some("a, b"));
    }

    #[test]
    fn a_broken_message_calls_nothing() {
        let mut names = Names::default();
        let list = names.list("transforms");
        names.see(list, 0, b"camera");
        names.take_back();
        names.keep();
        assert!(names.take_new().is_empty());
        names.see(list, 1, b"lidar");
        names.keep();
        assert_eq!(
            names.take_new(),
            [("transforms".to_owned(), 1, "lidar".to_owned())]
        );
        names.see(list, 1, b"lidar");
        names.keep();
        assert!(names.take_new().is_empty());
    }
}
