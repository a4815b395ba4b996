//! How views are arranged, as a tree of values; [`send`] turns it into Rerun's blueprint.
//!
//! The SDK's own builder has no axes, eye or visible range, and numbers views at random.

use std::collections::BTreeMap;
use std::hash::{DefaultHasher, Hash, Hasher};

use re_log_types::EntityPath;
use re_sdk_types::blueprint::{archetypes as a, components as c, datatypes as d};
use re_sdk_types::components::{Color, Name, Position3D, Range1D, Vector3D, Visible};
use re_sdk_types::datatypes::{Float64, TimeInt, TimeRange, TimeRangeBoundary, VisibleTimeRange};
use re_sdk_types::external::uuid::Uuid;
use re_sdk_types::{AsComponents, SerializedComponentBatch};

use crate::palette;
use crate::store::{Sink, Store, TIME};

/// A node of the layout.
pub enum Node {
    /// Side by side, with the share of the width that each takes.
    Row(Vec<(f32, Node)>),
    /// One above the other, with the share of the height that each takes.
    Column(Vec<(f32, Node)>),
    /// One at a time, the first in front.
    Tabs(String, Vec<Node>),
    /// A row or column with a name, as a tab shows it.
    Named(String, Box<Node>),
    /// A view.
    View(View),
}

/// One view: its class, title, the entities in it and its properties.
#[derive(Clone)]
pub struct View {
    class: &'static str,
    title: String,
    origin: String,
    contents: Vec<String>,
    properties: Vec<(&'static str, Vec<SerializedComponentBatch>)>,
    /// Entities that show the last so many seconds instead of the latest moment.
    trails: Vec<(String, f64)>,
}

impl View {
    fn new(class: &'static str, title: impl Into<String>, origin: impl Into<String>) -> Self {
        View {
            class,
            title: title.into(),
            origin: origin.into(),
            contents: vec!["$origin/**".to_owned()],
            properties: Vec::new(),
            trails: Vec::new(),
        }
    }

    fn with(mut self, name: &'static str, property: &dyn AsComponents) -> Self {
        self.properties
            .push((name, property.as_serialized_batches()));
        self
    }

    /// Title of the view.
    pub fn title(&self) -> &str {
        &self.title
    }

    /// Curves over time. The title names the curves and their colours: a legend would cover them.
    pub fn plot(title: impl Into<String>, origin: impl Into<String>) -> Self {
        View::new("TimeSeries", title, origin)
            .with(
                "PlotLegend",
                &a::PlotLegend::new().with_visible(Visible::from(false)),
            )
            .with(
                "TimeAxis",
                &a::TimeAxis::new().with_link(c::LinkAxis::LinkToGlobal),
            )
    }

    /// With a legend, where the title cannot name all curves.
    pub fn legend(mut self) -> Self {
        self.properties.retain(|(name, _)| *name != "PlotLegend");
        self.with(
            "PlotLegend",
            &a::PlotLegend::new().with_visible(Visible::from(true)),
        )
    }

    /// Only so many seconds before and after the cursor, whatever the other plots show.
    pub fn near(mut self, seconds: f64) -> Self {
        let boundary = |s: f64| TimeRangeBoundary::CursorRelative(TimeInt((s * 1e9) as i64));
        let range = TimeRange {
            start: boundary(-seconds),
            end: boundary(seconds),
        };
        self.properties.retain(|(name, _)| *name != "TimeAxis");
        self.with(
            "TimeAxis",
            &a::TimeAxis::new()
                .with_link(c::LinkAxis::Independent)
                .with_view_range(c::TimeRange(range)),
        )
    }

    /// With a range of values to begin with.
    pub fn range(self, low: f64, high: f64) -> Self {
        self.with(
            "ScalarAxis",
            &a::ScalarAxis::new().with_range(Range1D::new(low, high)),
        )
    }

    /// Only these entities instead of all below the origin.
    pub fn contents(mut self, paths: impl IntoIterator<Item = String>) -> Self {
        self.contents = paths.into_iter().collect();
        self
    }

    /// A scene in space, seen from `eye_m` towards `target_m` in the frame of the origin, which the camera thereby follows.
    pub fn space(
        title: impl Into<String>,
        origin: impl Into<String>,
        eye_m: [f32; 3],
        target_m: [f32; 3],
    ) -> Self {
        let eye = a::EyeControls3D::new()
            .with_position(Position3D::from(eye_m))
            .with_look_target(Position3D::from(target_m))
            .with_eye_up(Vector3D::from([0.0f32, 0.0, 1.0]));
        let ground = a::LineGrid3D::new().with_visible(Visible::from(false));
        let background = a::Background::new(c::BackgroundKind::SolidColor)
            .with_color(Color::from_u32(palette::BACKGROUND));
        View::new("3D", title, origin)
            .with("EyeControls3D", &eye)
            .with("LineGrid3D", &ground)
            .with("Background", &background)
    }

    /// A drawing in the plane; `x` and `y` are what has to be seen, y downwards.
    pub fn plane(
        title: impl Into<String>,
        origin: impl Into<String>,
        x: [f64; 2],
        y: [f64; 2],
    ) -> Self {
        let bounds = re_sdk_types::datatypes::Range2D {
            x_range: x.into(),
            y_range: y.into(),
        };
        let background = a::Background::new(c::BackgroundKind::SolidColor)
            .with_color(Color::from_u32(palette::BACKGROUND));
        View::new("2D", title, origin)
            .with("VisualBounds2D", &a::VisualBounds2D::new(bounds))
            .with("Background", &background)
    }

    /// Lines of text with their time.
    pub fn log(title: impl Into<String>, origin: impl Into<String>) -> Self {
        let column = |kind| d::TextLogColumn {
            visible: true.into(),
            kind,
        };
        // The lines say their time themselves: the viewer's column is too narrow for it.
        let time = d::TimelineColumn {
            visible: false.into(),
            timeline: TIME.into(),
        };
        let columns = a::TextLogColumns::new()
            .with_timeline_columns([time])
            .with_text_log_columns([column(d::TextLogColumnKind::Body)]);
        View::new("TextLog", title, origin).with("TextLogColumns", &columns)
    }

    /// A page of text.
    pub fn text(title: impl Into<String>, origin: impl Into<String>) -> Self {
        View::new("TextDocument", title, origin)
    }

    /// `entity` shows everything of the last `seconds`.
    pub fn trail(mut self, entity: impl Into<String>, seconds: f64) -> Self {
        self.trails.push((entity.into(), seconds));
        self
    }
}

impl From<View> for Node {
    fn from(view: View) -> Self {
        Node::View(view)
    }
}

/// Titles of all views in a layout, in order.
pub fn titles(node: &Node) -> Vec<&str> {
    match node {
        Node::Row(children) | Node::Column(children) => children
            .iter()
            .flat_map(|(_, child)| titles(child))
            .collect(),
        Node::Tabs(_, children) => children.iter().flat_map(titles).collect(),
        Node::Named(_, node) => titles(node),
        Node::View(view) => vec![view.title()],
    }
}

/// How the viewer starts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Play {
    /// From the beginning.
    Playing,
    /// At the newest moment, for a recording that is still growing.
    Following,
}

/// Under this id the viewer keeps the time axis of all plots that are linked (its `GLOBAL_VIEW_ID`).
const LINKED: Uuid = Uuid::from_u128(0x5C0D_CA6A_E63F_9CF7_F657_2602_5904_74CC);

/// Sends the layout as the blueprint `id`.
pub fn send(sink: &mut dyn Sink, id: &str, root: &Node, play: Play) -> anyhow::Result<()> {
    let mut out = Writer {
        store: Store::blueprint(sink, id)?,
        nodes: BTreeMap::new(),
    };
    let collapsed = a::PanelBlueprint::new().with_state(c::PanelState::Collapsed);
    let root = match root {
        // The root has to be a container.
        Node::View(_) => out.container(c::ContainerKind::Tabs, None, &[(1.0, root)])?,
        _ => out.node(root, None)?,
    };
    let uuid = re_sdk_types::datatypes::Uuid::from(root.1);
    let viewport = a::ViewportBlueprint::new()
        .with_root_container(c::RootContainer(uuid))
        .with_auto_layout(c::AutoLayout(false.into()))
        .with_auto_views(c::AutoViews(false.into()));
    out.store.fixed("viewport", &viewport)?;
    out.store.fixed("blueprint_panel", &collapsed)?;
    out.store.fixed("selection_panel", &collapsed)?;
    let state = match play {
        Play::Playing => c::PlayState::Playing,
        Play::Following => c::PlayState::Following,
    };
    let time = a::TimePanelBlueprint::new()
        .with_state(c::PanelState::Collapsed)
        .with_timeline(c::TimelineName(TIME.into()))
        .with_playback_speed(c::PlaybackSpeed(Float64(1.0)))
        .with_play_state(state);
    out.store.fixed("time_panel", &time)?;
    // Left to itself the viewer shows half a minute before and after the cursor of what is longer than a minute.
    let whole = a::TimeAxis::new().with_view_range(c::TimeRange(TimeRange::EVERYTHING));
    out.store
        .fixed(&format!("view/{LINKED}/TimeAxis"), &whole)?;
    out.store.activate()
}

struct Writer<'s> {
    store: Store<'s>,
    /// How many nodes there are so far of every kind.
    nodes: BTreeMap<u64, u64>,
}

/// Where a node is in the blueprint, and its id.
type Place = (String, Uuid);

impl Writer<'_> {
    /// The id of the next node of a kind. The viewer keeps what it knows of a view under its id, also when another layout follows: there the same id has to be
    /// of a view of the same class, and where its origin is the same, the user's zoom stays.
    fn id(&mut self, kind: &[&str]) -> Uuid {
        let mut hasher = DefaultHasher::new();
        kind.hash(&mut hasher);
        let hash = hasher.finish();
        let nodes = self.nodes.entry(hash).or_default();
        *nodes += 1;
        // The version bits of UUID are left as they are.
        Uuid::from_u64_pair(hash, *nodes)
    }

    fn node(&mut self, node: &Node, name: Option<&str>) -> anyhow::Result<Place> {
        match node {
            Node::Row(children) => {
                let children: Vec<_> = children.iter().map(|(s, n)| (*s, n)).collect();
                self.container(c::ContainerKind::Horizontal, name, &children)
            }
            Node::Column(children) => {
                let children: Vec<_> = children.iter().map(|(s, n)| (*s, n)).collect();
                self.container(c::ContainerKind::Vertical, name, &children)
            }
            Node::Tabs(name, children) => {
                let children: Vec<_> = children.iter().map(|n| (1.0, n)).collect();
                self.container(c::ContainerKind::Tabs, Some(name), &children)
            }
            Node::Named(name, node) => self.node(node, Some(name)),
            Node::View(view) => self.view(view),
        }
    }

    fn container(
        &mut self,
        kind: c::ContainerKind,
        name: Option<&str>,
        children: &[(f32, &Node)],
    ) -> anyhow::Result<Place> {
        let id = self.id(&["container", &format!("{kind:?}")]);
        let mut contents = Vec::new();
        for (_, child) in children {
            contents.push(c::IncludedContent(self.node(child, None)?.0.into()));
        }
        let shares = || children.iter().map(|(share, _)| *share);
        let mut container = a::ContainerBlueprint::new(kind);
        if kind == c::ContainerKind::Tabs {
            if let Some(first) = contents.first() {
                container = container.with_active_tab(c::ActiveTab(first.0.clone()));
            }
        }
        container = container.with_contents(contents);
        if let Some(name) = name {
            container = container.with_display_name(Name::from(name));
        }
        container = match kind {
            c::ContainerKind::Horizontal => {
                container.with_col_shares(shares().map(|s| c::ColumnShare(s.into())))
            }
            c::ContainerKind::Vertical => {
                container.with_row_shares(shares().map(|s| c::RowShare(s.into())))
            }
            _ => container,
        };
        let path = format!("container/{id}");
        self.store.fixed(&path, &container)?;
        Ok((path, id))
    }

    fn view(&mut self, view: &View) -> anyhow::Result<Place> {
        let id = self.id(&["view", view.class, &view.origin]);
        let path = format!("view/{id}");
        let contents = a::ViewContents::new(
            view.contents
                .iter()
                .map(|query| c::QueryExpression(query.as_str().into())),
        );
        self.store
            .fixed(&format!("{path}/ViewContents"), &contents)?;
        let blueprint = a::ViewBlueprint::new(c::ViewClass(view.class.into()))
            .with_display_name(Name::from(view.title.as_str()))
            .with_space_origin(c::ViewOrigin(view.origin.as_str().into()));
        self.store.fixed(&path, &blueprint)?;
        for (name, batches) in &view.properties {
            self.store.fixed(&format!("{path}/{name}"), batches)?;
        }
        for (entity, seconds) in &view.trails {
            let range = VisibleTimeRange {
                timeline: TIME.into(),
                range: TimeRange {
                    start: TimeRangeBoundary::CursorRelative(TimeInt((-seconds * 1e9) as i64)),
                    end: TimeRangeBoundary::AT_CURSOR,
                },
            };
            let entity = EntityPath::parse_forgiving(entity);
            let place = a::ViewContents::blueprint_base_visualizer_path_for_entity(id, &entity);
            self.store
                .fixed(&place.to_string(), &a::VisibleTimeRanges::new([range]))?;
        }
        Ok((path, id))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::draw::sent::Kept;

    #[test]
    fn linked_plots_show_the_whole_recording() {
        let mut kept = Kept::default();
        let root = Node::View(View::plot("Height", "/plots/height"));
        send(&mut kept, "id", &root, Play::Playing).unwrap();
        let shared = "view/5c0dca6a-e63f-9cf7-f657-2602590474cc/TimeAxis";
        assert_eq!(kept.lengths(shared, "TimeAxis:view_range"), [1]);
    }

    #[test]
    fn an_id_is_of_one_class_and_origin_in_every_layout() {
        let [mut one, mut other] = [Kept::default(), Kept::default()];
        let writer = |kept| Writer {
            store: Store::blueprint(kept, "id").unwrap(),
            nodes: BTreeMap::new(),
        };
        let (mut first, mut next) = (writer(&mut one), writer(&mut other));
        let [text, plot, twin] = [
            ("TextDocument", "/a"),
            ("TimeSeries", "/a"),
            ("TimeSeries", "/a"),
        ]
        .map(|(class, origin)| first.id(&["view", class, origin]));
        assert!(text != plot && plot != twin);
        assert_eq!(next.id(&["view", "TimeSeries", "/a"]), plot);
        assert_ne!(next.id(&["view", "TimeSeries", "/b"]), text);
    }
}
