//! Figures of studies: maps with curves over them, curves with bands, as PNG in one look.

use crate::sweep::parts::write_whole;
use analyze::report::plots::COLOURS;
use kuva::backend::raster::RasterBackend;
use kuva::plot::legend::LegendPosition;
use kuva::plot::{BandPlot, ColorMap, Heatmap, LinePlot, ScatterPlot};
use kuva::render::layout::{Layout, TickFormat};
use kuva::render::plots::Plot;
use kuva::render::render::render_multiple;
use kuva::render::render_utils::generate_ticks;
use std::io::Write;
use std::path::Path;
use std::sync::Arc;

/// A figure.
#[derive(Clone, Debug, Default)]
pub struct Figure {
    /// Title.
    pub title: String,
    /// Horizontal axis with its unit.
    pub x_label: String,
    /// Vertical axis with its unit.
    pub y_label: String,
    /// What is drawn, the first at the bottom.
    pub layers: Vec<Layer>,
    /// Range of the abscissa, where not that of the data.
    pub x_range: Option<(f64, f64)>,
    /// Whether equal factors of the abscissa are equally far apart.
    pub x_log: bool,
    /// The same of the ordinate.
    pub y_log: bool,
    /// Range of the ordinate, where not that of the data.
    pub y_range: Option<(f64, f64)>,
}

/// Something in a figure. Colours are indices into [`COLOURS`].
#[derive(Clone, Debug)]
pub enum Layer {
    /// A map: `values[row][column]`, rows from the bottom.
    Map {
        /// What the colour means, with its unit.
        label: String,
        /// The cells.
        values: Vec<Vec<f64>>,
        /// Edges of the columns, rising: one more than there are columns.
        x: Vec<f64>,
        /// Edges of the rows.
        y: Vec<f64>,
    },
    /// A curve.
    Line {
        /// Name in the legend; empty for none.
        name: String,
        /// Its points.
        points: Vec<(f64, f64)>,
        /// Its colour, or [`WHITE`].
        colour: usize,
        /// Whether it is broken.
        dashed: bool,
    },
    /// Single points.
    Points {
        /// Name in the legend; empty for none.
        name: String,
        /// The points.
        points: Vec<(f64, f64)>,
        /// Their colour, or [`WHITE`].
        colour: usize,
    },
    /// What lies between two curves.
    Band {
        /// Abscissa, lower and upper end.
        points: Vec<(f64, f64, f64)>,
        /// Its colour.
        colour: usize,
    },
}

/// The colour of curves over maps.
pub const WHITE: usize = usize::MAX;

/// Most characters of a line of a title: more would be cut off beside a legend.
const TITLE_WIDTH: usize = 90;

fn colour(index: usize) -> &'static str {
    match index {
        WHITE => "#FFFFFF",
        k => COLOURS[k % COLOURS.len()],
    }
}

impl Layer {
    /// A whole curve.
    pub fn line(name: &str, points: Vec<(f64, f64)>, colour: usize) -> Self {
        Self::Line {
            name: name.into(),
            points,
            colour,
            dashed: false,
        }
    }

    /// A broken curve.
    pub fn dashed(name: &str, points: Vec<(f64, f64)>, colour: usize) -> Self {
        Self::Line {
            name: name.into(),
            points,
            colour,
            dashed: true,
        }
    }

    /// Single points.
    pub fn points(name: &str, points: Vec<(f64, f64)>, colour: usize) -> Self {
        Self::Points {
            name: name.into(),
            points,
            colour,
        }
    }

    fn corners(&self) -> Vec<(f64, f64)> {
        match self {
            Self::Map { x, y, .. } => {
                let ((x0, x1), (y0, y1)) = (ends(x), ends(y));
                vec![(x0, y0), (x1, y1)]
            }
            Self::Line { points, .. } | Self::Points { points, .. } => points.clone(),
            Self::Band { points, .. } => points
                .iter()
                .flat_map(|(x, low, high)| [(*x, *low), (*x, *high)])
                .collect(),
        }
    }

    fn name(&self) -> &str {
        match self {
            Self::Line { name, .. } | Self::Points { name, .. } => name,
            _ => "",
        }
    }
}

impl Figure {
    fn range(&self) -> ((f64, f64), (f64, f64)) {
        let corners = self.layers.iter().flat_map(Layer::corners);
        let inside = |x: f64| self.x_range.is_none_or(|(a, b)| (a..=b).contains(&x));
        let start = (f64::INFINITY, f64::NEG_INFINITY);
        let (x, y) = corners
            .filter(|c| inside(c.0))
            .fold((start, start), |(x, y), c| {
                ((x.0.min(c.0), x.1.max(c.0)), (y.0.min(c.1), y.1.max(c.1)))
            });
        let wide = |(a, b): (f64, f64)| if b > a { (a, b) } else { (a - 1.0, a + 1.0) };
        let (mut x, mut y) = (wide(x), wide(y));
        if self
            .layers
            .iter()
            .any(|l| matches!(l, Layer::Points { .. }))
        {
            // A point on the frame would be cut in half.
            let room = 0.02 * (x.1 - x.0);
            x = (x.0 - room, x.1 + room);
        }
        if !self.layers.iter().any(|l| matches!(l, Layer::Map { .. })) {
            let room = 0.05 * (y.1 - y.0);
            y = (y.0 - room, y.1 + room);
        }
        (self.x_range.unwrap_or(x), self.y_range.unwrap_or(y))
    }

    /// Lowest and highest value of the map.
    fn colours(&self) -> (f64, f64) {
        let values = self.layers.iter().flat_map(|layer| match layer {
            Layer::Map { values, .. } => &values[..],
            _ => &[],
        });
        least_and_most(values.flatten())
    }

    /// The title, and what the colours of a map mean.
    fn whole_title(&self) -> String {
        let mut title = self.title.clone();
        for layer in &self.layers {
            if let Layer::Map { label, values, .. } = layer {
                if !self.title.starts_with(label.as_str()) {
                    title += &format!("; colour: {label}");
                }
                if values.iter().flatten().any(|v| v.is_nan()) {
                    title += "; white: none";
                }
            }
        }
        title
    }

    fn scene(&self) -> kuva::render::render::Scene {
        let (x, y) = self.range();
        let marks: Vec<Plot> = self.layers.iter().flat_map(|l| marks(l, x, y)).collect();
        let named = self.layers.iter().filter(|l| !l.name().is_empty()).count();
        let is_map = self.layers.iter().any(|l| matches!(l, Layer::Map { .. }));
        let layout = match is_map {
            true => Layout::auto_from_plots(&marks),
            false => Layout::new(x, y),
        };
        let mut layout = layout
            .with_title(self.whole_title())
            .with_x_label(self.x_label.clone())
            .with_y_label(self.y_label.clone())
            .with_width(900.0)
            .with_height(460.0)
            .with_title_size(16)
            .with_title_wrap(TITLE_WIDTH)
            .with_label_size(13)
            .with_tick_size(11)
            .with_x_axis_min(x.0)
            .with_x_axis_max(x.1)
            .with_y_axis_min(y.0)
            .with_y_axis_max(y.1)
            .with_x_tick_format(tick_format(x))
            .with_y_tick_format(tick_format(y))
            .with_colorbar_tick_format(tick_format(self.colours()));
        layout.log_x = self.x_log;
        layout.log_y = self.y_log;
        layout.show_legend = named > 0 && !is_map;
        if layout.show_legend {
            layout = layout.with_legend_position(LegendPosition::OutsideRightTop);
        }
        render_multiple(marks, layout)
    }

    /// Writes `FOLDER/STEM.png`, whole or not at all.
    ///
    /// # Errors
    /// What the library or the system says.
    pub fn write(&self, folder: &Path, stem: &str) -> Result<(), String> {
        let scene = self.scene();
        let png = RasterBackend::new()
            .with_scale(1.5)
            .render_scene(&scene)
            .map_err(|e| format!("{stem}: cannot be drawn: {e}"))?;
        write_whole(&folder.join(format!("{stem}.png")), |f| {
            Ok(f.write_all(&png)?)
        })
    }
}

/// The points inside the frame.
fn inside(points: &[(f64, f64)], x: (f64, f64), y: (f64, f64)) -> Vec<(f64, f64)> {
    let inside = |p: &&(f64, f64)| (x.0..=x.1).contains(&p.0) && (y.0..=y.1).contains(&p.1);
    points.iter().filter(inside).copied().collect()
}

/// The pieces of a curve inside the frame: what leaves it is cut off there (Liang and Barsky 1984, ACM Trans. Graph. 3: 1).
fn clipped(points: &[(f64, f64)], x: (f64, f64), y: (f64, f64)) -> Vec<Vec<(f64, f64)>> {
    let mut pieces: Vec<Vec<(f64, f64)>> = Vec::new();
    for pair in points.windows(2) {
        let (a, b) = (pair[0], pair[1]);
        let (dx, dy) = (b.0 - a.0, b.1 - a.1);
        // The share of the segment from a on at which it is inside each edge.
        let (mut from, mut to) = (0.0_f64, 1.0_f64);
        for (toward, room) in [
            (-dx, a.0 - x.0),
            (dx, x.1 - a.0),
            (-dy, a.1 - y.0),
            (dy, y.1 - a.1),
        ] {
            let meets = room / toward;
            match toward {
                d if d < 0.0 => from = from.max(meets),
                d if d > 0.0 => to = to.min(meets),
                _ if room < 0.0 => to = -1.0,
                _ => {}
            }
        }
        if from > to || !(dx + dy).is_finite() {
            continue;
        }
        let at = |share: f64| (a.0 + share * dx, a.1 + share * dy);
        let (begin, end) = (at(from), if to == 1.0 { b } else { at(to) });
        match pieces.last_mut() {
            Some(piece) if piece.last() == Some(&begin) => piece.push(end),
            _ => pieces.push(vec![begin, end]),
        }
    }
    pieces
}

fn least_and_most<'a>(values: impl Iterator<Item = &'a f64>) -> (f64, f64) {
    values.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), x| {
        (a.min(*x), b.max(*x))
    })
}

/// The library's own labels where they tell ticks of this range apart, else as many digits as that takes: its three make 0.5137 and 0.5139 both 0.514.
fn tick_format((from, to): (f64, f64)) -> TickFormat {
    // As many as the library asks for along a bar of colours and along an axis.
    let ticks: Vec<f64> = [5, 10]
        .into_iter()
        .flat_map(|n| generate_ticks(from, to, n))
        .collect();
    let says = |format: &TickFormat| {
        let off = |x: &f64| (format.format(*x).parse().unwrap_or(f64::NAN) - x).abs();
        // A hundredth of the distance of ten ticks.
        ticks.iter().all(|x| off(x) <= 1e-3 * (to - from))
    };
    let formats = [TickFormat::Auto].into_iter();
    let mut formats = formats.chain((4..=15).map(TickFormat::Fixed));
    formats.find(says).unwrap_or(TickFormat::Sci)
}

/// The colours of a map; a cell without a value stays white.
fn map_colours() -> ColorMap {
    ColorMap::Custom(Arc::new(|share: f64| match share.is_nan() {
        true => colour(WHITE).into(),
        false => ColorMap::Cividis.map(share),
    }))
}

/// The edges of `count` cells of one width.
pub fn even_edges((from, to): (f64, f64), count: usize) -> Vec<f64> {
    let edge = |k: usize| from + (to - from) * k as f64 / count as f64;
    (0..=count).map(edge).collect()
}

fn ends(edges: &[f64]) -> (f64, f64) {
    (edges[0], edges[edges.len() - 1])
}

fn is_even(edges: &[f64]) -> bool {
    let even = even_edges(ends(edges), edges.len() - 1);
    let room = 1e-9 * (edges[edges.len() - 1] - edges[0]);
    edges.iter().zip(even).all(|(a, b)| (a - b).abs() <= room)
}

/// A map's cells. The library draws even ones only: each of others is a map of its own, under one of no size that gives the bar of colours.
fn cells(values: &[Vec<f64>], x: &[f64], y: &[f64]) -> Vec<Plot> {
    let map = |values: Vec<Vec<f64>>, x: (f64, f64), y: (f64, f64)| {
        Heatmap::new()
            .with_data(values)
            .with_color_map(map_colours())
            .with_x_range(x.0, x.1)
            .with_y_range(y.0, y.1)
            .with_cell_size(1.0)
    };
    let whole = map(values.to_vec(), ends(x), ends(y));
    if is_even(x) && is_even(y) {
        return vec![whole.into()];
    }
    let (least, most) = least_and_most(values.iter().flatten());
    // `with_cell_size` gives no less than a half.
    let bar = Heatmap {
        cell_size: 0.0,
        ..whole
    };
    let mut plots = vec![bar.into()];
    for (row, y) in values.iter().zip(y.windows(2)) {
        for (value, x) in row.iter().zip(x.windows(2)) {
            let fill = map_colours().map((value - least) / (most - least + f64::EPSILON));
            let own = ColorMap::Custom(Arc::new(move |_| fill.clone()));
            let cell = map(vec![vec![*value]], (x[0], x[1]), (y[0], y[1]));
            plots.push(cell.with_color_map(own).into());
        }
    }
    plots
}

fn marks(layer: &Layer, x: (f64, f64), y: (f64, f64)) -> Vec<Plot> {
    let mark = match layer {
        Layer::Map { values, x, y, .. } => return cells(values, x, y),
        Layer::Line {
            name,
            points,
            colour: c,
            dashed,
        } => {
            let pieces = clipped(points, x, y).into_iter().enumerate();
            let line = |(k, piece): (usize, Vec<(f64, f64)>)| {
                let mut line = LinePlot::new()
                    .with_data(piece)
                    .with_color(colour(*c))
                    .with_stroke_width(if *c == WHITE { 2.0 } else { 1.5 });
                if *dashed {
                    line = line.with_dashed();
                }
                if k == 0 && !name.is_empty() {
                    line = line.with_legend(name.clone());
                }
                line.into()
            };
            return pieces.map(line).collect();
        }
        Layer::Points {
            name,
            points,
            colour: c,
        } => {
            let mut cloud = ScatterPlot::new()
                .with_data(inside(points, x, y))
                .with_color(colour(*c))
                .with_size(3.0);
            if !name.is_empty() {
                cloud = cloud.with_legend(name.clone());
            }
            cloud.into()
        }
        Layer::Band { points, colour: c } => BandPlot::new(
            points.iter().map(|p| p.0),
            points.iter().map(|p| p.1),
            points.iter().map(|p| p.2),
        )
        .with_color(colour(*c))
        .with_opacity(0.2)
        .into(),
    };
    vec![mark]
}

#[cfg(test)]
mod tests {
    use super::*;
    use kuva::render::render::Primitive;

    #[test]
    fn a_curve_is_cut_off_where_it_leaves_the_frame() {
        let frame = |points: &[(f64, f64)]| clipped(points, (0.0, 4.0), (-1.0, 1.0));
        // A mark from below to above, a tooth that leaves twice, a curve outside, a whole one.
        assert_eq!(
            frame(&[(2.0, -6.0), (2.0, 4.0)]),
            [[(2.0, -1.0), (2.0, 1.0)]]
        );
        assert_eq!(
            frame(&[(0.0, 0.0), (2.0, 2.0), (4.0, 0.0)]),
            [[(0.0, 0.0), (1.0, 1.0)], [(3.0, 1.0), (4.0, 0.0)]]
        );
        assert!(frame(&[(0.0, 2.0), (4.0, 2.0)]).is_empty());
        assert!(frame(&[(-2.0, 0.0), (0.0, 3.0)]).is_empty());
        let whole = [(0.0, 0.0), (1.0, 0.5), (4.0, 0.3)];
        assert_eq!(frame(&whole), [whole]);
        assert!(frame(&[(0.0, f64::NAN), (1.0, 0.0)]).is_empty());
    }

    /// Each was labelled with three digits, so that neighbours were called the same or by what they are not.
    #[test]
    fn neighbouring_ticks_have_labels_of_their_own() {
        for range in [
            (0.51362, 0.51401),
            (0.334, 0.347),
            (0.999, 1.003),
            (60.0, 60.002),
            (-2e-7, 3e-7),
            (1e5, 1e5 + 0.1),
        ] {
            let ticks = generate_ticks(range.0, range.1, 5);
            let labels: Vec<String> = ticks
                .iter()
                .map(|x| tick_format(range).format(*x))
                .collect();
            assert!(ticks.len() > 1, "{range:?}");
            for (tick, label) in ticks.iter().zip(&labels) {
                let off = label.parse::<f64>().unwrap() - tick;
                assert!(off.abs() < 0.01 * (ticks[1] - ticks[0]), "{labels:?}");
            }
        }
        assert_eq!(tick_format((0.0, 1.0)).format(0.5), "0.5");
    }

    #[test]
    fn a_long_title_goes_on_in_a_second_line() {
        let figure = Figure {
            title: "contact loss, mean of handles: mean, median and the band of 90 % of the runs; where at least half of the runs have it".into(),
            layers: vec![Layer::line("mean", vec![(0.0, 0.0), (1.0, 1.0)], 0)],
            ..Figure::default()
        };
        let lines = figure.scene().elements.into_iter().filter_map(|e| match e {
            Primitive::Text {
                content, size: 16, ..
            } => Some(content),
            _ => None,
        });
        let lines: Vec<String> = lines.collect();
        assert!(
            lines.len() == 2 && lines.iter().all(|l| l.len() <= TITLE_WIDTH),
            "{lines:?}"
        );
    }

    #[test]
    fn a_cell_without_a_value_has_none_of_the_colours() {
        let ColorMap::Custom(map) = map_colours() else {
            panic!("a map of our own")
        };
        assert_eq!(map(f64::NAN), "#FFFFFF");
        assert!((0..=100).all(|k| map(f64::from(k) / 100.0) != "#FFFFFF"));
    }

    #[test]
    fn uneven_cells_lie_where_their_edges_are() {
        let heat = |plot: &Plot| match plot {
            Plot::Heatmap(map) => map.clone(),
            _ => panic!("a map"),
        };
        let values = [vec![0.0, 1.0, f64::NAN], vec![0.25, 0.5, 0.75]];
        let even = cells(&values, &even_edges((0.0, 3.0), 3), &[0.0, 1.0, 2.0]);
        assert_eq!(even.len(), 1);
        let plots = cells(&values, &[0.5, 1.5, 3.0, 5.0], &[-1.0, 0.0, 4.0]);
        assert_eq!(plots.len(), 1 + 6);
        let (all, cell) = (heat(&plots[0]), heat(&plots[5]));
        assert_eq!(
            (all.x_range, all.y_range),
            (Some((0.5, 5.0)), Some((-1.0, 4.0)))
        );
        assert_eq!(
            (cell.x_range, cell.y_range),
            (Some((1.5, 3.0)), Some((0.0, 4.0)))
        );
        // As the bar has it, whatever a map of one cell would be.
        assert_eq!(cell.color_map.map(0.0), ColorMap::Cividis.map(0.5));
        assert_eq!(heat(&plots[3]).color_map.map(0.0), "#FFFFFF");
    }
}
