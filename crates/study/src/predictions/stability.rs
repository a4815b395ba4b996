//! The map behind the predictions: where carriers in step make roll grow.

use super::floquet::Hanging;
use super::{Finding, Lab, columns, number, row, scene, slope, template};
use crate::draw::{Figure, Layer, WHITE, even_edges};
use crate::ensemble::observe;
use sim::run::Sample;
use sim::scene::Template;

/// Roll at the start, degrees: small enough to stay linear for seven doublings.
const START_DEG: f64 = 0.01;
/// Roll between which growth is read off, rad: above the solver's tolerance, below what bends sin θ.
const LINEAR_RAD: (f64, f64) = (1e-8, 0.02);
/// How long a run lasts, in periods of the drive; a window is two of them.
const PERIODS: f64 = 60.0;
const SAMPLES: usize = 16;

/// Carriers in step, nothing random, no dry friction, and a breath of roll: what Floquet's theory is about.
pub fn drive() -> Result<Template, String> {
    template(
        "music",
        &[
            "effects.music=false",
            "effects.noise=false",
            "effects.frequency_spread=false",
            "effects.lift=false",
            "effects.pole_friction=false",
            "effects.gait.sway_m=0.0",
            "carriers.handles_m=[[2.45, 0.0, 0.1], [-2.45, 0.0, 0.1]]",
            "carriers.initial_phase_rad=0.0",
            "carriers.initial_phase_sd_rad=0.0",
            "start.height_m=false",
            &format!("start.roll_pitch_yaw_deg=[{START_DEG}, 0.0, 0.0]"),
            "analysis_start_s=0.0",
            "solver.tolerance=1e-10",
        ],
    )
}

/// Growth rate of the roll in the simulator, 1/s, infinite where it is large within three windows, and whether both handles kept contact after the first ten periods.
pub fn simulated(
    drive: &Template,
    theory: &Hanging,
    hz: f64,
    depth: f64,
) -> Result<(f64, bool), String> {
    let scene = scene(
        drive,
        &[
            ("carriers.frequency_hz", hz),
            ("effects.gait.amplitude_m", theory.amplitude_m(hz, depth)),
            ("duration_s", PERIODS / hz),
            ("log_rate_hz", SAMPLES as f64 * hz),
        ],
        1,
    )?;
    // Once the roll is large there is nothing more to learn.
    let mut large = false;
    let (columns, _, outcome) = observe(&scene, None, &mut |s: &Sample| {
        large = s.pose.roll_pitch_yaw_rad()[0].abs() > 10.0 * LINEAR_RAD.1;
        !large
    });
    if let (Err(e), false) = (outcome, large) {
        return Err(e.to_string());
    }
    let window = 2 * SAMPLES;
    let inputs = columns.inputs;
    let largest: Vec<(f64, f64)> = inputs
        .roll_rad
        .chunks_exact(window)
        .enumerate()
        .map(|(k, x)| {
            let most = x.iter().fold(0.0, |m: f64, x| m.max(x.abs()));
            (2.0 * k as f64 / hz, most)
        })
        .take_while(|(_, x)| (LINEAR_RAD.0..LINEAR_RAD.1).contains(x))
        .collect();
    // The slow modes alone: what dies first has a third of the time for it.
    let late: Vec<(f64, f64)> = largest[largest.len() / 3..]
        .iter()
        .map(|(t, x)| (*t, x.ln()))
        .collect();
    let growth = match late.len() {
        // Too fast for a line through three windows.
        0..3 if large => f64::INFINITY,
        0..3 => f64::NAN,
        _ => slope(&late).0,
    };
    let after = (10 * SAMPLES).min(inputs.t_s.len());
    let kept = inputs
        .normal_n
        .iter()
        .all(|n| n[after..].iter().all(|x| *x > 0.0));
    Ok((growth, kept))
}

/// The least depth at which the simulated roll grows, from a coarse search and bisection that know nothing of the theory's answer.
pub fn simulated_threshold(
    drive: &Template,
    theory: &Hanging,
    hz: f64,
) -> Result<Option<f64>, String> {
    let grows = |depth: f64| simulated(drive, theory, hz, depth).map(|(g, _)| g > 0.0);
    let (mut low, mut high) = (0.0, 0.0);
    loop {
        high += 0.09;
        if high > 0.95 {
            return Ok(None);
        }
        if grows(high)? {
            break;
        }
        low = high;
    }
    for _ in 0..7 {
        let middle = 0.5 * (low + high);
        if grows(middle)? {
            high = middle;
        } else {
            low = middle;
        }
    }
    Ok(Some(0.5 * (low + high)))
}

/// Draws the map and compares edges.
pub fn run(lab: &Lab) -> Result<Finding, String> {
    let drive = drive()?;
    let theory = Hanging::of(&scene(&drive, &[], 1)?)?;
    let [sway, roll] = theory.natural_hz();

    let (nx, ny) = (50, 30);
    let (x_range, y_range) = ((0.9, 2.65), (0.0, 1.65));
    let center = |k: usize, n: usize, (a, b): (f64, f64)| a + (b - a) * (k as f64 + 0.5) / n as f64;
    let cells: Vec<(f64, f64)> = (0..nx * ny)
        .map(|k| (center(k % nx, nx, x_range), center(k / nx, ny, y_range)))
        .collect();
    let growth = lab.map(&cells, |(x, y)| {
        simulated(&drive, &theory, x * roll, *y).map(|(g, _)| g)
    })?;
    let values: Vec<Vec<f64>> = growth
        .chunks(nx)
        .map(|r| r.iter().map(|g| g.clamp(-1.0, 1.0)).collect())
        .collect();

    let fine = row(x_range.0, x_range.1, 321);
    let edge = lab.map(&fine, |x| Ok(theory.threshold(x * roll, y_range.1)))?;
    let edge: Vec<(f64, f64)> = fine
        .iter()
        .zip(edge)
        .filter_map(|(x, m)| Some((*x, m?)))
        .collect();

    let tried = row(1.76, 2.3, 10);
    let found = lab.map(&tried, |x| simulated_threshold(&drive, &theory, x * roll))?;
    let mut worst: f64 = 0.0;
    let mut compared = Vec::new();
    for (x, m) in tried.iter().zip(found) {
        if let (Some(here), Some(there)) = (m, theory.threshold(x * roll, 0.95)) {
            worst = worst.max((here / there - 1.0).abs());
            compared.push((*x, here));
        }
    }
    let paper = scene(&template("music", &[])?, &[], 1)?;
    let (depth, beat) = theory.depth_of(&paper);
    let here = (beat / roll, depth);
    let least = edge.iter().map(|e| e.1).fold(f64::INFINITY, f64::min);
    let figure = Figure {
        title: "Growth of roll under carriers in step".into(),
        x_label: format!("drive frequency / natural frequency of roll ({roll:.3} Hz)"),
        y_label: "load modulation depth m, in g".into(),
        layers: vec![
            Layer::Map {
                label: "growth in 1/s, shown within ±1".into(),
                x: even_edges(x_range, values[0].len()),
                y: even_edges(y_range, values.len()),
                values,
            },
            Layer::dashed("", vec![(x_range.0, 1.0), (x_range.1, 1.0)], WHITE),
            Layer::line("", edge, WHITE),
            Layer::points("", compared.clone(), 1),
            Layer::points("", vec![here], 0),
        ],
        x_range: Some(x_range),
        y_range: Some(y_range),
        ..Figure::default()
    };
    let kept = columns(
        &scene(&drive, &[("duration_s", 1.0)], 1)?,
        &mut |_: &Sample| true,
    )?;
    Ok(Finding {
        title: "The map behind them: where roll is unstable",
        claim: "",
        experiment: format!(
            "Carriers in step lift and drop the load by the depth m = amplitude of the support's acceleration over g; above m = 1 contact is lost. \
             Colour is the growth rate of a breath of roll ({START_DEG}°) in the simulator, with the paper's slings and unilateral contact ({} handles). \
             The white curve is Floquet's boundary, computed from the linear equations alone (no code shared with the simulator).",
            kept.normal_n.len()
        ),
        verdict: None,
        because: format!(
            "In full contact the simulator grows where Floquet says, to {:.1} % of the depth. Roll at half the drive's frequency is the widest \
             tongue, from m = {least:.2} on; others stand where twice the sideways swing ({sway:.3} Hz), or swing and roll together, meet the drive. \
             The paper's beat lies beside the tongue's middle: at {:.2} times the natural frequency it needs m = {:.2}, which is beyond contact loss, and has m = {:.2}.",
            100.0 * worst,
            here.0,
            theory.threshold(beat, 3.0).unwrap_or(f64::NAN),
            here.1
        ),
        numbers: vec![
            number("roll_hz", "natural frequency of roll", roll, "Hz", 4),
            number("sway_hz", "natural frequency of the sideways swing", sway, "Hz", 4),
            number("least_depth", "least depth that makes roll grow", least, "", 3),
            number("compared", "edges compared", compared.len() as f64, "", 0),
            number("worst_miss", "largest miss of the simulated edge, relative", worst, "", 4),
            number("paper_depth", "depth of the paper's music condition", here.1, "", 3),
            number(
                "paper_threshold",
                "depth that its beat needs in the linear, bilateral theory",
                theory.threshold(beat, 3.0).unwrap_or(f64::NAN),
                "",
                3,
            ),
        ],
        pictures: vec![(
            "stability",
            "Growth rate of roll in the simulator (colour), Floquet's boundary (white), simulated edges (vermilion points), the depth at which contact is lost (broken), and the paper's music condition (blue point).".into(),
            figure,
        )],
    })
}
