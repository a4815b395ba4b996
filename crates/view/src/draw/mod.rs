//! Drawings, one file each. A drawing sends its entities and gives its view, or gives nothing where the recording has nothing for it.

mod circle;
mod course;
pub mod events;
mod people;
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
    let plots = series::draw(store, take, series::MOTION)?;
    let energies = series::draw(store, take, series::ENERGIES)?;
    let log = events::draw(store, take)?;
    let page = summary::draw(store, take)?;
    let sensors = sensors::draw(store, take)?;
    Ok(layout(
        Scene {
            is_measured: take.inputs.sources.attitude != "imu",
            space,
            circle,
            spectra,
            plots,
            energies,
        },
        log,
        page,
        sensors,
    ))
}

/// What is known of the thing carried.
struct Scene {
    /// How it turns was measured as such, and not estimated from inertial sensors.
    is_measured: bool,
    space: Option<View>,
    circle: Option<View>,
    spectra: Option<View>,
    plots: Vec<View>,
    energies: Vec<View>,
}

impl Scene {
    /// Whether there is anything.
    fn has_any(&self) -> bool {
        let drawings = self.space.is_some() || self.circle.is_some() || self.spectra.is_some();
        drawings || !self.plots.is_empty() || !self.energies.is_empty()
    }
}

/// The overview first, then a tab for every sensor and for topics of other kinds. Without anything to overview, the first of those
/// tabs has the words beside it.
fn layout(scene: Scene, log: Option<View>, page: View, mut panels: Vec<Panel>) -> Node {
    let words = match log {
        Some(log) => Node::Tabs("Words".into(), vec![log.into(), page.into()]),
        None => page.into(),
    };
    let mut tabs: Vec<Node> = Vec::new();
    if scene.space.is_some() && scene.is_measured {
        tabs.extend(around(scene, words));
    } else if scene.has_any() {
        // What was measured stands before what was estimated from it.
        let measured = panels.first().filter(|panel| panel.is_sensor);
        let mut plots: Vec<View> = measured.map_or(Vec::new(), |panel| panel.plots.clone());
        plots.extend(scene.plots.into_iter().chain(scene.energies));
        let small = scene.space.into_iter().chain(scene.circle);
        let small = small.chain(scene.spectra).collect();
        tabs.push(side_by_side(plots, small, words));
    } else if panels.is_empty() {
        return words;
    } else {
        tabs.push(panels.remove(0).node(Some(words)));
    }
    tabs.extend(panels.into_iter().map(|panel| panel.node(None)));
    match tabs.len() {
        1 => tabs.remove(0),
        _ => Node::Tabs("Recording".into(), tabs),
    }
}

/// The scene in space with drawings and words below it and plots to its right; the energies, which are of other sizes, a tab for
/// themselves: of more plots in a column the axes could not be read.
fn around(scene: Scene, words: Node) -> Vec<Node> {
    let mut small: Vec<(f32, Node)> = Vec::new();
    small.extend(scene.circle.map(|view| (1.0, view.into())));
    // A spectrum is wider than the circle.
    small.extend(scene.spectra.map(|view| (1.45, view.into())));
    small.push((1.3, words));
    let mut left: Vec<(f32, Node)> = Vec::new();
    left.extend(scene.space.map(|view| (3.0, view.into())));
    left.push((2.0, Node::Row(small)));
    let mut columns = vec![(5.0, Node::Column(left))];
    if !scene.plots.is_empty() {
        columns.push((4.0, Node::Column(even(scene.plots))));
    }
    let mut tabs = vec![named("Overview", Node::Row(columns))];
    if !scene.energies.is_empty() {
        tabs.push(named("Energy", Node::Column(even(scene.energies))));
    }
    tabs
}

/// Plots in columns of three, then drawings and words.
fn side_by_side(plots: Vec<View>, small: Vec<View>, words: Node) -> Node {
    let columns = plots.chunks(3);
    let mut row: Vec<(f32, Node)> = columns
        .map(|views| (1.2, Node::Column(even(views.to_vec()))))
        .collect();
    let mut right = even(small);
    right.push((1.0, words));
    row.push((1.0, Node::Column(right)));
    named("Overview", Node::Row(row))
}

fn named(name: &str, node: Node) -> Node {
    Node::Named(name.into(), Box::new(node))
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

/// What is sent, for tests.
#[cfg(test)]
pub mod sent {
    use re_chunk::Chunk;
    use re_log_types::{EntityPath, LogMsg};

    use crate::store::{Sink, Store};

    /// Keeps what it takes.
    #[derive(Default)]
    pub struct Kept(Vec<LogMsg>);

    impl Sink for Kept {
        fn send(&mut self, message: LogMsg) -> anyhow::Result<()> {
            self.0.push(message);
            Ok(())
        }
    }

    impl Kept {
        /// Of every row of a component of an entity, how many instances it has.
        pub fn lengths(&self, entity: &str, component: &'static str) -> Vec<i32> {
            let entity = EntityPath::parse_forgiving(entity);
            let chunks = self.0.iter().filter_map(|message| match message {
                LogMsg::ArrowMsg(_, message) => Some(Chunk::from_arrow_msg(message).unwrap()),
                _ => None,
            });
            chunks
                .filter(|chunk| *chunk.entity_path() == entity)
                .flat_map(|chunk| {
                    let column = chunk.components().get(component.into()).cloned();
                    let lengths = |k| column.as_ref().map(|c| c.list_array.value_length(k));
                    (0..chunk.num_rows())
                        .filter_map(lengths)
                        .collect::<Vec<i32>>()
                })
                .collect()
        }
    }

    /// What is sent of a recording that begins at 0.
    pub fn by(draw: impl FnOnce(&mut Store<'_>)) -> Kept {
        let mut kept = Kept::default();
        draw(&mut Store::recording(&mut kept, "id", "name", 0, None).unwrap());
        kept
    }
}
