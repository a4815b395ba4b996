//! Phases on the unit circle: every carrier a point, the order parameter an arrow from the centre, the beat a mark outside.

use std::f32::consts::TAU;

use analyze::phase;
use re_sdk_types::archetypes::{Arrows2D, LineStrips2D, Points2D};
use re_sdk_types::components::Radius;

use crate::blueprint::View;
use crate::palette;
use crate::store::Store;
use crate::take::{Take, every};

/// Radius at which the beat runs.
const BEAT_RADIUS: f64 = 1.13;
/// Radius at which the carriers' numbers run.
const NUMBER_RADIUS: f64 = 1.36;
/// Angle between two numbers that do not cover each other, rad.
const APART_RAD: f64 = 0.3;
/// The viewer writes below the place: so far above it the place has to be.
const ABOVE: f32 = 0.15;

/// Draws the circle where there are phases that have another, or the beat, to compare with.
pub fn draw(store: &mut Store<'_>, take: &Take) -> anyhow::Result<Option<View>> {
    let phases = &take.inputs.phase_rad;
    let (rows, carriers) = (take.phase_ns.len(), phases.len());
    let beat = &take.inputs.beat_phase_rad;
    let heard = beat.len() == rows && beat.iter().any(|psi| psi.is_finite());
    let compared = carriers > 1 || (carriers == 1 && heard);
    if rows == 0 || !compared || phases.iter().any(|p| p.len() != rows) {
        return Ok(None);
    }
    let ring: Vec<[f32; 2]> = (0..=128)
        .map(|k| {
            let (sin, cos) = (k as f32 / 128.0 * TAU).sin_cos();
            [cos, sin]
        })
        .collect();
    let cross = vec![vec![[-1.0, 0.0], [1.0, 0.0]], vec![[0.0, -1.0], [0.0, 1.0]]];
    let lines = LineStrips2D::new(std::iter::once(ring).chain(cross))
        .with_radii([0.008f32, 0.003, 0.003])
        .with_colors([palette::AXIS, palette::GRID, palette::GRID]);
    store.fixed("/phases/circle", &lines)?;

    let told = every(rows, carriers);
    let mut points: Vec<[f32; 2]> = Vec::new();
    let mut resultants: Vec<[f32; 2]> = Vec::with_capacity(rows);
    for k in 0..rows {
        let mut sum = [0.0f64; 2];
        for phase in phases {
            let place = on_circle(phase[k], 1.0);
            sum = [sum[0] + f64::from(place[0]), sum[1] + f64::from(place[1])];
            if k % told == 0 {
                points.push(place);
            }
        }
        resultants.push(sum.map(|x| (x / carriers as f64) as f32));
    }
    let arrows = Arrows2D::from_vectors(resultants).columns_of_unit_batches()?;
    store.rows("/phases/order", &take.phase_ns, arrows)?;
    let arrow = Arrows2D::update_fields()
        .with_origins([[0.0f32, 0.0]])
        .with_radii([0.03f32])
        .with_colors([palette::WHITE]);
    store.fixed("/phases/order", &arrow)?;

    let ends = take.ends(&take.phase_ns);
    let none = || std::iter::repeat_n(0, ends.len());
    let nowhere: [[f32; 2]; 0] = [];
    let empty = Arrows2D::from_vectors(nowhere).columns(none())?;
    store.gone("/phases/order", &ends, empty)?;

    let times: Vec<i64> = take.phase_ns.iter().copied().step_by(told).collect();
    let columns = Points2D::new(points).columns(std::iter::repeat_n(carriers, times.len()))?;
    store.rows("/phases/carriers", &times, columns)?;
    let empty = || Points2D::new(nowhere).columns(none());
    store.gone("/phases/carriers", &ends, empty()?)?;
    let style = Points2D::update_fields()
        .with_radii([0.075f32])
        .with_colors((0..carriers).map(|i| palette::carrier(i).0));
    store.fixed("/phases/carriers", &style)?;
    // Of more that walk together the numbers would lie on each other; the colours are those of the figures.
    if let [first, second] = &phases[..] {
        let places = (0..rows).flat_map(|k| numbers(first[k], second[k]));
        let columns = Points2D::new(places).columns(std::iter::repeat_n(2, rows))?;
        store.rows("/phases/numbers", &take.phase_ns, columns)?;
        store.gone("/phases/numbers", &ends, empty()?)?;
        let style = Points2D::update_fields()
            .with_radii([Radius::new_ui_points(0.0)])
            .with_colors([palette::carrier(0).0, palette::carrier(1).0])
            .with_labels(["1", "2"])
            .with_show_labels(true);
        store.fixed("/phases/numbers", &style)?;
    }

    if heard {
        // Where the beat falls silent an empty row takes its mark away: the viewer keeps the latest.
        let sounds = |k: usize| beat[k].is_finite();
        let told: Vec<usize> = (0..rows)
            .filter(|k| sounds(*k) || (*k > 0 && sounds(k - 1)))
            .collect();
        let times: Vec<i64> = told.iter().map(|k| take.phase_ns[*k]).collect();
        let sounding = told.iter().filter(|k| sounds(**k));
        let places = sounding.map(|k| on_circle(beat[*k], BEAT_RADIUS));
        let lengths = told.iter().map(|k| usize::from(sounds(*k)));
        store.rows(
            "/phases/beat",
            &times,
            Points2D::new(places).columns(lengths)?,
        )?;
        store.gone("/phases/beat", &ends, empty()?)?;
        let style = Points2D::update_fields()
            .with_radii([0.055f32])
            .with_colors([palette::WHITE]);
        store.fixed("/phases/beat", &style)?;
    }
    let title = if heard {
        "Phases, beat (white)"
    } else {
        "Phases"
    };
    let reach = [-1.5, 1.5];
    Ok(Some(View::plane(title, "/phases", reach, reach)))
}

/// Where two carriers' numbers stand: outside, where neither the arrow nor the other number covers them.
fn numbers(first_rad: f64, second_rad: f64) -> [[f32; 2]; 2] {
    let ahead_rad = phase::wrap(second_rad - first_rad);
    let side = if ahead_rad < 0.0 { -0.5 } else { 0.5 };
    let more_rad = side * (APART_RAD - ahead_rad.abs()).max(0.0);
    [first_rad - more_rad, second_rad + more_rad].map(|angle_rad| {
        let [x, y] = on_circle(angle_rad, NUMBER_RADIUS);
        [x, y - ABOVE]
    })
}

/// Where a phase stands; y points down in a drawing, and phases turn counter-clockwise.
fn on_circle(phase_rad: f64, radius: f64) -> [f32; 2] {
    let (sin, cos) = phase_rad.sin_cos();
    [(radius * cos) as f32, (-radius * sin) as f32]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::draw::sent;

    #[test]
    fn the_beat_has_no_mark_while_it_is_silent() {
        let mut take = Take {
            phase_ns: (0..6).map(|k| k * 100_000_000).collect(),
            ..Take::default()
        };
        take.inputs.phase_rad = vec![vec![0.0; 6]; 2];
        take.inputs.beat_phase_rad = vec![f64::NAN, 0.1, 0.2, f64::NAN, f64::NAN, 0.3];
        let sent = sent::by(|store| {
            draw(store, &take).unwrap();
        });
        let marks = sent.lengths("/phases/beat", "Points2D:positions");
        assert_eq!(marks, [1, 1, 0, 1]);
    }

    #[test]
    fn no_phase_stands_in_a_hole() {
        let times = (0..20).chain(50..70).map(|k: i64| k * 100_000_000);
        let mut take = Take {
            phase_ns: times.collect(),
            end_ns: 20_000_000_000,
            ..Take::default()
        };
        take.inputs.phase_rad = vec![vec![0.0; 40]; 2];
        take.inputs.beat_phase_rad = vec![0.5; 40];
        let sent = sent::by(|store| {
            draw(store, &take).unwrap();
        });
        for (entity, component) in [
            ("/phases/order", "Arrows2D:vectors"),
            ("/phases/carriers", "Points2D:positions"),
            ("/phases/numbers", "Points2D:positions"),
            ("/phases/beat", "Points2D:positions"),
        ] {
            let rows = sent.lengths(entity, component);
            assert_eq!(
                rows.iter().filter(|count| **count == 0).count(),
                2,
                "{entity}"
            );
            assert_eq!(rows.len(), 42, "{entity}");
        }
    }

    #[test]
    fn one_phase_without_a_beat_is_compared_with_nothing() {
        let mut take = Take {
            phase_ns: vec![0, 1],
            ..Take::default()
        };
        take.inputs.phase_rad = vec![vec![0.0; 2]];
        for (beat, drawn) in [(vec![], false), (vec![0.1, 0.2], true)] {
            take.inputs.beat_phase_rad = beat;
            sent::by(|store| {
                assert_eq!(draw(store, &take).unwrap().is_some(), drawn);
            });
        }
    }

    #[test]
    fn numbers_of_carriers_in_step_stand_side_by_side() {
        let distance = |[a, b]: [[f32; 2]; 2]| (a[0] - b[0]).hypot(a[1] - b[1]);
        for (first, second) in [(0.4, 0.4), (0.4, 0.45), (3.1, -3.1), (0.3, 0.2)] {
            let places = numbers(first, second);
            assert!(distance(places) > 0.35, "{first} {second}: {places:?}");
            // Counter-clockwise, which is upwards on the right, in the order of the phases.
            let turn =
                places[0][0] * (places[1][1] + ABOVE) - places[1][0] * (places[0][1] + ABOVE);
            let ahead = phase::wrap(second - first) >= 0.0;
            assert_eq!(turn < 0.0, ahead, "{first} {second}: {places:?}");
        }
        let [first, _] = numbers(0.0, 2.0);
        assert!((first[0] - 1.36).abs() < 1e-6 && (first[1] + ABOVE).abs() < 1e-6);
    }
}
