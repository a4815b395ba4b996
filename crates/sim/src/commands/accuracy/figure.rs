//! The work-precision figure: time against error, both in logarithms, better to the right and down.

use kuva::backend::svg::SvgBackend;
use kuva::plot::annotations::ShadedRegion;
use kuva::plot::legend::LegendPosition;
use kuva::plot::scatter::MarkerShape;
use kuva::plot::{LinePlot, ScatterPlot};
use kuva::render::layout::{Layout, TickFormat};
use kuva::render::plots::Plot;
use kuva::render::render::render_multiple;
use sim::accuracy::{Rung, Study};
use std::sync::Arc;

/// Okabe and Ito's colours, which the colour-blind can tell apart, a brown and a violet; one for each family of methods.
const COLOURS: [&str; 9] = [
    "#000000", "#0072B2", "#D55E00", "#009E73", "#E69F00", "#CC79A7", "#56B4E9", "#8C564B",
    "#5D3A9B",
];
/// A method whose name ends so is its family's without located events.
const BLIND: &str = "-blind";

/// Draws the study as SVG; `set` is what was changed of the scene.
pub fn draw(study: &Study, set: &[String]) -> String {
    // The axis is that of digits, −log10(error): more of them lie to the right.
    let digits = |r: &Rung| -study.error(r).max(1e-16).log10();
    let good = |r: &&Rung| r.failed.is_none();
    let ran: Vec<&Rung> = study.runs.iter().filter(good).collect();
    let most = ran.iter().map(|r| digits(r)).fold(0.0, f64::max).ceil() + 0.3;
    let least = ran.iter().map(|r| digits(r)).fold(0.0, f64::min).floor() - 1.0;
    let ms = |r: &Rung| r.cpu_s * 1e3;
    let times = || study.runs.iter().map(ms);
    let low = 10f64.powf(times().fold(f64::MAX, f64::min).log10().floor());
    let high = 10f64.powf(
        times()
            .fold(low, f64::max)
            .log10()
            .ceil()
            .max(low.log10() + 1.0),
    );

    let mut plots: Vec<Plot> = Vec::new();
    let front: Vec<(f64, f64)> = study
        .front
        .iter()
        .map(|&i| (digits(&study.runs[i]), ms(&study.runs[i])))
        .collect();
    plots.push(
        LinePlot::new()
            .with_data(front)
            .with_color("#dddddd")
            .with_stroke_width(9.0)
            .with_legend("nothing is better (Pareto)")
            .into(),
    );
    let mut methods: Vec<&str> = study.runs.iter().map(|r| r.method).collect();
    methods.dedup();
    let mut families: Vec<&str> = methods.iter().map(|m| m.trim_end_matches(BLIND)).collect();
    families.dedup();
    let mut failed_before = false;
    for method in methods {
        let of = || study.runs.iter().filter(|r| r.method == method);
        let family = method.trim_end_matches(BLIND);
        let place = families.iter().position(|f| *f == family).unwrap_or(0);
        let colour = COLOURS[place % COLOURS.len()];
        let points: Vec<(f64, f64)> = of().filter(good).map(|r| (digits(r), ms(r))).collect();
        let (mut line, shape) = (LinePlot::new().with_stroke_width(1.4), MarkerShape::Circle);
        let mut shape = shape;
        if method != family {
            line = line.with_dashed();
            shape = MarkerShape::Diamond;
        }
        plots.push(
            line.with_data(points.clone())
                .with_color(colour)
                .with_legend(method)
                .into(),
        );
        let marks = ScatterPlot::new().with_data(points).with_color(colour);
        plots.push(marks.with_marker(shape).with_size(3.5).into());

        let failures: Vec<(f64, f64)> = of()
            .filter(|r| r.failed.is_some())
            .map(|r| (least + 0.4, ms(r)))
            .collect();
        if !failures.is_empty() {
            let marks = ScatterPlot::new().with_data(failures).with_color(colour);
            let mut marks = marks.with_marker(MarkerShape::Cross).with_size(5.0);
            if !failed_before {
                marks = marks.with_legend("failed, at the left edge");
            }
            failed_before = true;
            plots.push(marks.into());
        }
    }
    if let Some(r) = study.archive().filter(good) {
        let mark = ScatterPlot::new()
            .with_data(vec![(digits(r), ms(r))])
            .with_color("#cc0000");
        let mark = mark.with_marker(MarkerShape::Star).with_size(9.0);
        plots.push(mark.with_legend("the archive's method").into());
    }
    let (what, unit) = study.judge.name();
    let changed = |s: &String| format!(", {}", s.strip_prefix("effects.").unwrap_or(s));
    let changed: String = set.iter().map(changed).collect();
    let title = format!("{}{changed}: what accuracy costs", study.scene);
    let mut layout = Layout::new((least, most), (low, high))
        .with_title(title.clone())
        .with_x_label(format!("largest error of {what}, {unit}"))
        .with_y_label("time of a run on the processor, ms")
        .with_x_tick_format(TickFormat::Custom(Arc::new(|d| {
            if d == 0.0 {
                "1".into()
            } else {
                format!("1e{:.0}", -d)
            }
        })))
        .with_x_tick_step(if most - least > 12.0 { 2.0 } else { 1.0 })
        .with_log_y()
        .with_x_axis_min(least)
        .with_x_axis_max(most)
        .with_y_axis_min(low)
        .with_y_axis_max(high)
        .with_width(980.0)
        .with_legend_width(200.0)
        .with_height(560.0)
        .with_title_size(16)
        .with_label_size(13)
        .with_tick_size(11)
        .with_legend_position(LegendPosition::OutsideRightTop);
    layout.show_legend = true;
    // Where the references themselves no longer agree, no point can be told from another.
    let known = -study.estimated_error().max(1e-16).log10();
    if known < most {
        layout = layout.with_shaded_region(
            ShadedRegion::vertical(known.max(least), most)
                .with_color("#7F7F7F")
                .with_opacity(0.12),
        );
    }
    let svg = SvgBackend::new().render_scene(&render_multiple(plots, layout));
    // For those who hear a figure.
    let escaped = title.replace('&', "&amp;").replace('<', "&lt;");
    svg.replacen('>', &format!("><title>{escaped}</title>"), 1)
}
