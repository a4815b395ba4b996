//! Drawings, one file each. A drawing sends its entities and gives its view, or gives nothing where the recording has nothing for it.

mod circle;
mod events;
mod sensors;
mod series;
mod space;
mod spectra;
mod summary;

use crate::blueprint::{Node, View};
use crate::store::Store;
use crate::take::Take;

/// Draws all there is and gives the layout of the views.
pub fn all(store: &mut Store<'_>, take: &Take) -> anyhow::Result<Node> {
    let space = space::draw(store, take)?;
    let circle = circle::draw(store, take)?;
    let spectra = spectra::draw(store, take)?;
    let plots = series::draw(store, take)?;
    let log = events::draw(store, take)?;
    let page = summary::draw(store, take)?;
    let sensors = sensors::draw(store, take)?;
    Ok(layout(
        Scene {
            space,
            small: [circle, spectra].into_iter().flatten().collect(),
            plots,
        },
        log,
        page,
        sensors,
    ))
}

/// What is known of the thing carried.
struct Scene {
    space: Option<View>,
    small: Vec<View>,
    plots: Vec<View>,
}

/// Columns of plots beside the scene; a tab for every sensor and for topics of other kinds. Where there is no scene, a single
/// sensor is shown together with what was estimated from it.
fn layout(scene: Scene, log: Option<View>, page: View, mut panels: Vec<Panel>) -> Node {
    let words = match log {
        Some(log) => Node::Tabs("Words".into(), vec![log.into(), page.into()]),
        None => page.into(),
    };
    let known = scene.space.is_some() || !scene.small.is_empty() || !scene.plots.is_empty();
    let sensors = panels.iter().filter(|panel| panel.is_sensor).count();
    let tabs = |first: Node, panels: Vec<Panel>| match panels.is_empty() {
        true => first,
        false => {
            let mut tabs = vec![first];
            tabs.extend(panels.into_iter().map(|panel| panel.node(None)));
            Node::Tabs("Recording".into(), tabs)
        }
    };
    if scene.space.is_none() && sensors == 1 {
        // Sensors stand first.
        let mut panel = panels.remove(0);
        panel.plots.extend(scene.plots);
        panel.small.extend(scene.small);
        return tabs(panel.node(Some(words)), panels);
    }
    if !known {
        let nodes: Vec<Node> = panels.into_iter().map(|panel| panel.node(None)).collect();
        return match nodes.is_empty() {
            true => words,
            false => Node::Row(vec![
                (3.4, Node::Tabs("Topics".into(), nodes)),
                (1.0, words),
            ]),
        };
    }
    let mut small: Vec<(f32, Node)> = Vec::new();
    for view in scene.small {
        // A spectrum is wider than the circle.
        let share = if view.title().starts_with("Phases") {
            1.0
        } else {
            1.45
        };
        small.push((share, view.into()));
    }
    small.push((1.25, words));
    let mut left: Vec<(f32, Node)> = Vec::new();
    left.extend(scene.space.map(|view| (3.0, view.into())));
    left.push((2.0, Node::Row(small)));
    let mut columns = vec![(5.0, Node::Column(left))];
    if !scene.plots.is_empty() {
        // What is stored and what went in and out are of different size: one behind the other.
        let (energy, plots): (Vec<View>, Vec<View>) = scene
            .plots
            .into_iter()
            .partition(|v| v.title().contains("nergy"));
        let mut rows = even(plots);
        match energy.len() {
            0 => {}
            1 => rows.extend(even(energy)),
            _ => rows.push((
                1.0,
                Node::Tabs(
                    "Energy".into(),
                    energy.into_iter().map(Node::from).collect(),
                ),
            )),
        }
        columns.push((4.0, Node::Column(rows)));
    }
    tabs(
        Node::Named("Overview".into(), Box::new(Node::Row(columns))),
        panels,
    )
}

fn even(views: Vec<View>) -> Vec<(f32, Node)> {
    views.into_iter().map(|view| (1.0, view.into())).collect()
}

/// The views of one topic: curves over time, and drawings beside them.
pub struct Panel {
    name: String,
    is_sensor: bool,
    plots: Vec<View>,
    small: Vec<View>,
}

impl Panel {
    /// Curves to the left, drawings and words to the right.
    fn node(self, words: Option<Node>) -> Node {
        // More than two drawings would be too small to read: all but the last stand behind each other.
        let mut small = self.small;
        let last = small.split_off(small.len().saturating_sub(1));
        let mut right = match small.len() {
            0 | 1 => even(small),
            _ => vec![(
                1.0,
                Node::Tabs(
                    "Spectra".into(),
                    small.into_iter().map(Node::from).collect(),
                ),
            )],
        };
        right.extend(even(last));
        right.extend(words.map(|words| (1.0, words)));
        let node = match (self.plots.is_empty(), right.is_empty()) {
            (_, true) => Node::Column(even(self.plots)),
            (true, false) => Node::Column(right),
            (false, false) => Node::Row(vec![
                (2.0, Node::Column(even(self.plots))),
                (1.0, Node::Column(right)),
            ]),
        };
        Node::Named(self.name, Box::new(node))
    }
}
