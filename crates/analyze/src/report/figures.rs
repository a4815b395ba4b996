//! `--figures DIR`: every plot as SVG and PNG, in one look, for papers and talks.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use kuva::backend::raster::RasterBackend;
use kuva::backend::svg::SvgBackend;
use kuva::plot::annotations::{ReferenceLine, ShadedRegion, TextAnnotation};
use kuva::plot::legend::LegendPosition;
use kuva::plot::{ColorMap, Heatmap, LinePlot, ScatterPlot};
use kuva::render::layout::{Layout, TickFormat};
use kuva::render::plots::Plot as Mark;
use kuva::render::render::{Scene, render_multiple};
use recording::text::plain;

use super::html::escaped;
use super::plots::{COLOURS, Image, Panel, Plot};

/// Width of a figure, in the units of its SVG.
const WIDTH: f64 = 900.0;
/// Height of a figure.
const HEIGHT: f64 = 420.0;
/// Pixels of the PNG per unit of the SVG.
const SCALE: f32 = 2.0;
/// Grey of marks and their names.
const GREY: &str = "#666666";

/// Why a figure could not be written.
#[derive(Debug, thiserror::Error)]
pub enum FigureError {
    /// The folder or a file cannot be written.
    #[error("{name}: cannot be written: {source}")]
    Io {
        /// The file or folder.
        name: String,
        /// What the system said.
        source: std::io::Error,
    },
    /// The plotting library refused.
    #[error("{name}: cannot be drawn: {problem}")]
    Draw {
        /// The figure.
        name: String,
        /// What the library said.
        problem: String,
    },
}

/// Draws `plots` into `folder` as `01-roll.svg`, `01-roll.png`, ...; gives the names of the files. Each file appears whole or not at all.
///
/// # Errors
/// [`FigureError`], where a figure cannot be drawn or written.
pub fn figures(plots: &[Plot], folder: &Path) -> Result<Vec<PathBuf>, FigureError> {
    let io = |path: &Path| {
        let name = path.display().to_string();
        move |source| FigureError::Io { name, source }
    };
    std::fs::create_dir_all(folder).map_err(io(folder))?;
    let mut written = Vec::new();
    for (k, plot) in plots.iter().enumerate() {
        let (id, title, scene) = match plot {
            Plot::Panel(p) => (p.id, &p.title, panel(p)),
            Plot::Image(i) => (i.id, &i.title, image(i)),
        };
        let stem = format!("{:02}-{id}", k + 1);
        let png = RasterBackend::new()
            .with_scale(SCALE)
            .render_scene(&scene)
            .map_err(|problem| FigureError::Draw {
                name: stem.clone(),
                problem,
            })?;
        // Who cannot see it hears at least what it is.
        let named = format!(" role=\"img\"><title>{}</title>", escaped(title));
        let svg = SvgBackend::default().render_scene(&scene);
        let svg = svg.replacen('>', &named, 1);
        // Names out of files stand in legends, labels and titles.
        let svg = plain(&svg);
        for (extension, bytes) in [("svg", svg.as_bytes()), ("png", &png[..])] {
            let path = folder.join(format!("{stem}.{extension}"));
            recording::whole::write_whole(&path, |file| std::io::Write::write_all(file, bytes))
                .map_err(io(&path))?;
            written.push(path);
        }
    }
    Ok(written)
}

/// The panel as it stands still: of quick curves what lies in the middle of the window, densities in decibels (the library's logarithmic axis ends at
/// 1e-10, where densities do not).
fn still(p: &Panel) -> Panel {
    let mut p = p.clone();
    if let Some(shown_s) = p.shown_s {
        // A field log ends at rest, and starts so.
        let ends = p.series.iter().flat_map(|s| &s.x).fold(NOTHING, reach);
        let (start_s, end_s) = p.window.unwrap_or(ends);
        let middle_s = 0.5 * (start_s.max(ends.0) + end_s.min(ends.1));
        let [from_s, to_s] = [-0.5, 0.5].map(|half| middle_s + half * shown_s);
        if ends.1 - ends.0 > shown_s {
            for s in &mut p.series {
                let inside =
                    s.x.partition_point(|x| *x < from_s)..s.x.partition_point(|x| *x <= to_s);
                s.x = s.x[inside.clone()].to_vec();
                s.y = s.y[inside].to_vec();
            }
            p.title += &format!(", {shown_s} s in the middle");
        }
    }
    if p.log_y {
        let db = |x: f64| 10.0 * x.max(f64::MIN_POSITIVE).log10();
        for s in &mut p.series {
            s.y.iter_mut().for_each(|y| *y = db(*y));
            s.spread
                .iter_mut()
                .for_each(|(low, high)| (*low, *high) = (db(*low), db(*high)));
        }
        p.y_label = p.y_label.replacen(", ", ", dB re 1 ", 1);
        p.log_y = false;
    }
    p
}

fn panel(p: &Panel) -> Scene {
    let p = &still(p);
    let ((mut x0, mut x1), (mut y0, mut y1)) = (NOTHING, NOTHING);
    for s in &p.series {
        (x0, x1) = s.x.iter().fold((x0, x1), reach);
        (y0, y1) = s.y.iter().fold((y0, y1), reach);
        for (low, high) in &s.spread {
            (y0, y1) = reach(reach((y0, y1), low), high);
        }
    }
    let others = p
        .levels
        .iter()
        .map(|(y, _)| *y)
        .chain(p.band.iter().flat_map(|(a, b, _)| [*a, *b]));
    for y in others {
        (y0, y1) = reach((y0, y1), &y);
    }
    if let Some((a, b)) = p.x_range {
        (x0, x1) = (a, b);
    }
    ((x0, x1), (y0, y1)) = (wide((x0, x1)), wide((y0, y1)));
    let several = p.series.len() > 1;
    let names = names(&p.marks, (x0, x1), several);
    // The names of marks stand above all curves.
    let rows = names.iter().map(|(.., row)| row + 1).max().unwrap_or(0);
    let room = 0.06 * (y1 - y0);
    let range = (
        y0 - room,
        y1 + room.max(ROW * rows as f64 / (1.0 - ROW * rows as f64) * (y1 - y0 + room)),
    );
    let marks: Vec<Mark> = p
        .series
        .iter()
        .flat_map(|s| {
            let points: Vec<(f64, f64)> = s.x.iter().copied().zip(s.y.iter().copied()).collect();
            let parts = points.split(|(_, y)| !p.points && y.is_nan());
            let whole = parts.filter(|part| !part.is_empty()).enumerate();
            whole
                .map(|(k, part)| (s, part.to_vec(), several && k == 0))
                .collect::<Vec<_>>()
        })
        .map(|(s, points, named)| {
            let colour = COLOURS[s.colour % COLOURS.len()];
            if p.points {
                let mut cloud = ScatterPlot::new()
                    .with_data(points)
                    .with_color(colour)
                    .with_size(2.0)
                    .with_marker_opacity(0.5);
                if named {
                    cloud = cloud.with_legend(s.name.clone());
                }
                cloud.into()
            } else {
                let mut line = LinePlot::new()
                    .with_data(points)
                    .with_color(colour)
                    .with_stroke_width(1.2);
                if named {
                    line = line.with_legend(s.name.clone());
                }
                if !s.spread.is_empty() {
                    let (below, above): (Vec<f64>, Vec<f64>) = s.spread.iter().copied().unzip();
                    line = line.with_band(below, above);
                }
                line.into()
            }
        })
        .collect();
    let mut layout = look(
        Layout::new((x0, x1), range)
            .with_title(p.title.clone())
            .with_x_label(p.x_label.clone())
            .with_y_label(p.y_label.clone()),
    )
    .with_x_axis_min(x0)
    .with_x_axis_max(x1)
    .with_y_axis_min(range.0)
    .with_y_axis_max(range.1);
    // The library writes three decimals, and all digits of what is whole.
    let span = range.1 - range.0;
    let largest = y0.abs().max(y1.abs());
    if !(1e-3..1e7).contains(&largest) {
        let digits = (1.0 + (largest / span).log10()).clamp(1.0, 15.0) as usize;
        layout.y_tick_format = TickFormat::Custom(Arc::new(move |y| format!("{y:.digits$e}")));
    } else if span < 0.02 && largest >= 0.01 {
        layout.y_tick_format = TickFormat::Fixed((1.0 - span.log10()).ceil() as usize);
    }
    if several {
        layout.show_legend = true;
        layout = layout.with_legend_position(LegendPosition::OutsideRightTop);
    }
    if let Some((a, b)) = p.window {
        layout = layout.with_shaded_region(
            ShadedRegion::vertical(a.max(x0), b.min(x1))
                .with_color(COLOURS[0])
                .with_opacity(0.07),
        );
    }
    if let Some((a, b, name)) = &p.band {
        layout = layout.with_shaded_region(
            ShadedRegion::horizontal(*a, *b)
                .with_color("#7F7F7F")
                .with_opacity(0.2),
        );
        layout = layout.with_annotation(note(
            name,
            x1 - 0.07 * (x1 - x0),
            a + 0.02 * (range.1 - range.0),
        ));
    }
    for (y, name) in &p.levels {
        layout = layout.with_reference_line(
            ReferenceLine::horizontal(*y)
                .with_color(GREY)
                .with_label(name.clone()),
        );
    }
    for (name, x, at, row) in names {
        layout = layout.with_reference_line(
            ReferenceLine::vertical(x)
                .with_color(GREY)
                .with_dasharray("2 3"),
        );
        let y = range.1 - (row as f64 + 0.8) * ROW * (range.1 - range.0);
        layout = layout.with_annotation(note(name, at, y));
    }
    render_multiple(marks, layout)
}

/// Height of a line of names, as a share of the drawing's.
const ROW: f64 = 0.055;
/// Width of a character of a name, in the units of the SVG.
const CHARACTER: f64 = 6.2;
/// Width of the drawing, without and with a legend beside it.
const DRAWING: [f64; 2] = [830.0, 710.0];

/// Marks inside the range: name, place, middle of the name and its line from the top, so that no name touches the one before.
fn names(
    marks: &[(f64, String)],
    (x0, x1): (f64, f64),
    legend: bool,
) -> Vec<(&str, f64, f64, usize)> {
    let unit = (x1 - x0) / DRAWING[usize::from(legend)];
    let mut ends: Vec<f64> = Vec::new();
    let mut out = Vec::new();
    for (x, name) in marks.iter().filter(|(x, _)| (x0..=x1).contains(x)) {
        let width = CHARACTER * name.chars().count() as f64 * unit;
        // To the right of its line; to the left where that would leave the drawing.
        let right = x + 5.0 * unit + width <= x1;
        let from = if right {
            x + 5.0 * unit
        } else {
            x - 5.0 * unit - width
        };
        let row = (ends.iter().position(|end| *end < from)).unwrap_or(ends.len());
        if row == ends.len() {
            ends.push(0.0);
        }
        ends[row] = from + width;
        out.push((name.as_str(), *x, from + 0.5 * width, row));
    }
    out
}

/// The range of no values.
const NOTHING: (f64, f64) = (f64::INFINITY, f64::NEG_INFINITY);

/// A range made to hold one more value.
fn reach((low, high): (f64, f64), x: &f64) -> (f64, f64) {
    (low.min(*x), high.max(*x))
}

/// A range that shows something: what rounding leaves of a constant is none.
fn wide((low, high): (f64, f64)) -> (f64, f64) {
    let size = low.abs().max(high.abs());
    if high - low > 1e-9 * size {
        return (low, high);
    }
    let middle = match size.is_finite() {
        true => 0.5 * (low + high),
        false => 0.0,
    };
    (middle - 1.0, middle + 1.0)
}

fn note(text: &str, x: f64, y: f64) -> TextAnnotation {
    TextAnnotation::new(text, x, y)
        .with_color(GREY)
        .with_font_size(11)
}

fn image(i: &Image) -> Scene {
    let high = i
        .values
        .iter()
        .flatten()
        .copied()
        .fold(f64::NEG_INFINITY, f64::max);
    let bins = i.values.first().map_or(0, Vec::len);
    // Rows from the bottom, where the range says what they are.
    let rows: Vec<Vec<f64>> = (0..bins)
        .map(|b| {
            i.values
                .iter()
                // Not `max`, which takes the number where one is none.
                .map(|column| match column[b] < high - 60.0 {
                    true => high - 60.0,
                    false => column[b],
                })
                .collect()
        })
        .collect();
    let map = Heatmap::new()
        .with_data(rows)
        .with_color_map(ColorMap::Custom(Arc::new(|level| match level.is_nan() {
            true => "none".into(),
            false => ColorMap::Cividis.map(level),
        })))
        .with_x_range(i.x_range.0, i.x_range.1)
        .with_y_range(i.y_range.0, i.y_range.1)
        .with_cell_size(1.0);
    let marks: Vec<Mark> = vec![map.into()];
    let layout = look(
        Layout::auto_from_plots(&marks)
            // The library's scale of colours has no name of its own.
            .with_title(format!("{}, {}", i.title, i.value_label))
            .with_x_label("time, s")
            .with_y_label(i.y_label.clone()),
    )
    .with_x_axis_min(i.x_range.0)
    .with_x_axis_max(i.x_range.1)
    .with_y_axis_min(i.y_range.0)
    .with_y_axis_max(i.y_range.1);
    render_multiple(marks, layout)
}

/// What all figures share.
fn look(layout: Layout) -> Layout {
    layout
        .with_width(WIDTH)
        .with_height(HEIGHT)
        .with_title_size(16)
        .with_label_size(13)
        .with_tick_size(11)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::plots::Series;

    #[test]
    fn a_quick_curve_is_shown_in_the_middle_of_the_window() {
        let curve = |seconds: usize| Panel {
            series: vec![Series {
                x: (0..=seconds).map(|k| k as f64).collect(),
                y: vec![0.0; seconds + 1],
                ..Series::default()
            }],
            window: Some((15.0, f64::INFINITY)),
            shown_s: Some(10.0),
            ..Panel::new("forces", "Forces", "time, s", "force, N")
        };
        let drawn = still(&curve(65));
        assert_eq!(drawn.title, "Forces, 10 s in the middle");
        let (first, last) = (drawn.series[0].x[0], drawn.series[0].x.last());
        assert_eq!(
            (first, last, drawn.series[0].y.len()),
            (35.0, Some(&45.0), 11)
        );
        let whole = still(&curve(9));
        assert_eq!(
            (whole.title.as_str(), whole.series[0].x.len()),
            ("Forces", 10)
        );
    }

    #[test]
    fn ticks_of_a_constant_differ() {
        let (low, high) = wide((0.8019, 0.801_900_000_000_000_3));
        assert!((high - low - 2.0).abs() < 1e-12, "{low} to {high}");
        assert_eq!(wide((0.8019, 0.802)), (0.8019, 0.802));
        assert_eq!(wide(NOTHING), (-1.0, 1.0));
    }

    /// Forty metres of latitude, in degrees.
    #[test]
    fn ticks_of_a_narrow_range_differ() {
        let mut p = Panel::new("signals", "Latitude", "time, s", "deg");
        p.series.push(Series {
            x: vec![0.0, 1.0],
            y: vec![31.1001, 31.1005],
            ..Series::default()
        });
        let svg = SvgBackend::default().render_scene(&panel(&p));
        for tick in ["31.10020", "31.10030", "31.10040"] {
            assert!(svg.contains(tick), "{tick} in {svg}");
        }
    }

    #[test]
    fn ticks_of_very_large_and_small_values_are_short() {
        for (high, tick) in [(1e300, ">2.0e299<"), (1e-20, ">2.0e-21<")] {
            let mut p = Panel::new("signals", "", "time, s", "1");
            p.series.push(Series {
                x: vec![0.0, 1.0],
                y: vec![0.0, high],
                ..Series::default()
            });
            let svg = SvgBackend::default().render_scene(&panel(&p));
            assert!(svg.contains(tick), "{svg}");
        }
    }

    #[test]
    fn figures_have_names_for_who_cannot_see_them() {
        let folder = tempfile::tempdir().expect("a folder");
        let mut p = Panel::new("roll", "Roll < tilt", "time, s", "a\u{1}ngle\u{1b}, deg");
        p.series.push(Series {
            x: vec![0.0, 1.0],
            y: vec![0.0, 1.0],
            ..Series::default()
        });
        let written = figures(&[Plot::Panel(p)], folder.path()).expect("drawn");
        let svg = std::fs::read_to_string(&written[0]).expect("read");
        assert!(
            svg.contains(" role=\"img\"><title>Roll &lt; tilt</title>"),
            "{}",
            &svg[..300]
        );
        // XML holds no others.
        assert!(!svg.contains(|c: char| c.is_control() && !matches!(c, '\n' | '\t')));
    }
}
