//! The people: figures whose shoulders move as the carriers' points do and whose feet step once per gait cycle.

use re_sdk_types::archetypes::{Capsules3D, Ellipsoids3D, LineStrips3D, Points3D, Transform3D};
use re_sdk_types::components::FillMode;
use re_sdk_types::datatypes::Quaternion;

use crate::palette;
use crate::store::Store;
use crate::take::{Carriers, Pose, Stay, Take, every};

/// Lift of a foot in its swing, m, and half the stride, m: for the eye alone.
const FOOT_LIFT_M: f64 = 0.10;
const HALF_STRIDE_M: f64 = 0.27;
/// The pole lies on one shoulder: the figure stands so far beside it, m.
const BESIDE_M: f64 = 0.17;
/// So far from every handle a shoulder carries nothing, m: no figures are drawn then.
pub const APART_M: f64 = 2.0;
/// Shoulder to hip, m.
const TORSO_M: f64 = 0.52;

/// Figures whose shoulders move as the carriers' points do and whose feet step once per gait cycle.
pub fn draw(
    store: &mut Store<'_>,
    take: &Take,
    pose: &Pose,
    ways: &[f64],
    carriers: &Carriers,
) -> anyhow::Result<()> {
    let (rows, count) = (carriers.times_ns.len(), carriers.points_m.len());
    if rows == 0 || count == 0 || carriers.points_m.iter().any(|p| p.len() != rows) {
        return Ok(());
    }
    // Where a log gives another point of the carriers than the shoulder, the figures are moved by a constant up or down so that their
    // shoulders are at the handles on average.
    let mean = |x: &mut dyn Iterator<Item = f64>| {
        let (sum, n) = x
            .filter(|x| x.is_finite())
            .fold((0.0, 0usize), |(s, n), x| (s + x, n + 1));
        sum / n.max(1) as f64
    };
    let handle_m = mean(&mut pose.position_m.iter().map(|p| p[2]))
        + mean(&mut take.shape.handles_m.iter().map(|h| h[2]));
    let shoulder_m = mean(&mut carriers.points_m.iter().flatten().map(|p| p[2]));
    let shift_m = match handle_m - shoulder_m {
        apart_m if (0.25..APART_M).contains(&apart_m.abs()) => apart_m,
        _ => 0.0,
    };
    let hip_m = (handle_m - TORSO_M).max(0.3);

    // Who has no phase stands.
    let phase_at: Vec<Vec<f64>> = (0..count)
        .map(|i| match take.inputs.phase_rad.get(i) {
            Some(phase) if take.phase_ns == carriers.times_ns => analyze::phase::continuous(phase),
            Some(phase) if !take.phase_ns.is_empty() && phase.len() == take.phase_ns.len() => {
                let s = |t: &[i64]| recording::signal::seconds_since(t, take.start_ns);
                let unwrapped = analyze::phase::continuous(phase);
                analyze::inputs::interpolate(&s(&take.phase_ns), &unwrapped, &s(&carriers.times_ns))
            }
            _ => vec![f64::NAN; rows],
        })
        .collect();
    let told: Vec<usize> = (0..rows).step_by(every(rows, count)).collect();
    let figures: Vec<Figures> = told
        .iter()
        .map(|&k| {
            let at = pose.moment(carriers.times_ns[k]);
            let handles = pose.places_in_world(at, &take.shape.handles_m);
            let shoulders: Vec<[f64; 3]> = carriers
                .points_m
                .iter()
                .map(|points| {
                    let [x, y, z] = points[k];
                    [x, y, z + shift_m]
                })
                .collect();
            let can = |(i, shoulder): (usize, &[f64; 3])| {
                // His own handle is looked at first.
                let own = handles.get(i).into_iter();
                own.chain(&handles).any(|handle| is_near(shoulder, handle))
            };
            Figures {
                shown: handles.is_empty() || shoulders.iter().enumerate().all(can),
                shoulders,
                way_rad: ways[at],
            }
        })
        .collect();
    let times: Vec<i64> = told.iter().map(|k| carriers.times_ns[*k]).collect();
    let lengths = || figures.iter().map(|f| if f.shown { count } else { 0 });
    let shown = || told.iter().zip(&figures).filter(|(_, f)| f.shown);
    let colors: Vec<u32> = (0..count).map(|i| palette::carrier(i).0).collect();
    let legs = shown().flat_map(|(&k, f)| {
        let each = f.shoulders.iter().zip(&phase_at);
        each.map(move |(shoulder, phase)| legs_at(*shoulder, f.way_rad, phase[k]))
    });
    let columns = LineStrips3D::new(legs).columns(lengths())?;
    store.rows("/world/legs", &times, columns)?;
    let ends = take.ends(&times);
    let none = || std::iter::repeat_n(0, ends.len());
    let no_strips: [[[f32; 3]; 2]; 0] = [];
    let empty = || LineStrips3D::new(no_strips).columns(none());
    store.gone("/world/legs", &ends, empty()?)?;
    let style = LineStrips3D::update_fields()
        .with_radii([0.055f32])
        .with_colors(colors.iter().copied());
    store.fixed("/world/legs", &style)?;
    let length_m = (handle_m - hip_m - 0.12).max(0.1);
    if count <= WHOLE_FIGURES {
        return bodies(store, &times, &take.stays(&times), &figures, length_m);
    }
    // A stroke and a dot for each, all in two entities.
    let parts = |z: f64| {
        shown().flat_map(move |(_, f)| {
            let beside = move |shoulder: &[f64; 3]| beside(*shoulder, f.way_rad, 0.0, BESIDE_M, z);
            f.shoulders.iter().map(beside)
        })
    };
    let torsos = parts(0.02 - TORSO_M)
        .zip(parts(0.02 - TORSO_M + length_m))
        .map(|(low, high)| [low, high]);
    let columns = LineStrips3D::new(torsos).columns(lengths())?;
    store.rows("/world/torsos", &times, columns)?;
    store.gone("/world/torsos", &ends, empty()?)?;
    let style = LineStrips3D::update_fields()
        .with_radii([0.13f32])
        .with_colors(colors.iter().copied());
    store.fixed("/world/torsos", &style)?;
    let columns = Points3D::new(parts(0.2)).columns(lengths())?;
    store.rows("/world/heads", &times, columns)?;
    let nowhere: [[f32; 3]; 0] = [];
    let empty = Points3D::new(nowhere).columns(none())?;
    store.gone("/world/heads", &ends, empty)?;
    let style = Points3D::update_fields()
        .with_radii([0.11f32])
        .with_colors(colors);
    store.fixed("/world/heads", &style)
}

/// Up to so many figures have bodies and heads of their own shape.
const WHOLE_FIGURES: usize = 16;

/// All figures at one moment.
struct Figures {
    /// Whether they stand where they can carry.
    shown: bool,
    shoulders: Vec<[f64; 3]>,
    way_rad: f64,
}

/// Torsos and heads, an entity each, that move with their shoulders.
fn bodies(
    store: &mut Store<'_>,
    times: &[i64],
    stays: &[Stay],
    figures: &[Figures],
    length_m: f64,
) -> anyhow::Result<()> {
    // They stay as they are: they are said again only where they come or go.
    let comes = |k: usize| stays.binary_search_by_key(&times[k], |s| s.from_ns).is_ok();
    let turns = (0..figures.len())
        .filter(|&k| figures[k].shown != (k > 0 && figures[k - 1].shown) || comes(k))
        .map(|k| (times[k], figures[k].shown));
    let gone = stays
        .iter()
        .filter_map(|stay| Some((stay.until_ns?, false)));
    let mut turns: Vec<(i64, bool)> = turns.chain(gone).collect();
    turns.sort_by_key(|(t_ns, _)| *t_ns);
    let turn_times: Vec<i64> = turns.iter().map(|(t_ns, _)| *t_ns).collect();
    let lengths = || turns.iter().map(|(_, shown)| usize::from(*shown));
    let each: usize = lengths().sum();
    for i in 0..figures.first().map_or(0, |f| f.shoulders.len()) {
        let path = format!("/world/carrier_{}", i + 1);
        let columns = Transform3D::update_fields()
            .with_many_translation(figures.iter().map(|f| f32s(&f.shoulders[i])))
            .with_many_quaternion(figures.iter().map(|f| about_z(&f.way_rad)))
            .columns_of_unit_batches()?;
        store.rows(&path, times, columns)?;
        let color = palette::carrier(i).0;
        let torso =
            Capsules3D::from_lengths_and_radii(vec![length_m as f32; each], vec![0.13f32; each])
                .with_translations(vec![[0.0f32, BESIDE_M as f32, 0.02 - TORSO_M as f32]; each]);
        let style = Capsules3D::update_fields()
            .with_colors([color])
            .with_fill_mode(FillMode::Solid);
        let path_of = |part: &str| format!("{path}/{part}");
        store.rows(&path_of("torso"), &turn_times, torso.columns(lengths())?)?;
        store.fixed(&path_of("torso"), &style)?;
        let head = Ellipsoids3D::from_centers_and_half_sizes(
            vec![[0.0f32, BESIDE_M as f32, 0.2]; each],
            vec![[0.1f32, 0.09, 0.13]; each],
        );
        let style = Ellipsoids3D::update_fields()
            .with_colors([color])
            .with_fill_mode(FillMode::Solid);
        store.rows(&path_of("head"), &turn_times, head.columns(lengths())?)?;
        store.fixed(&path_of("head"), &style)?;
    }
    Ok(())
}

/// Whether a shoulder is near a handle.
fn is_near(shoulder: &[f64; 3], handle: &[f64; 3]) -> bool {
    let squares = (0..3).map(|i| (shoulder[i] - handle[i]).powi(2));
    // What is no number is nowhere in particular.
    !(squares.sum::<f64>() > APART_M * APART_M)
}

/// A place beside a shoulder of a figure that faces `way_rad`, m ahead, to the left and above it.
fn beside(shoulder: [f64; 3], way_rad: f64, ahead: f64, left: f64, above: f64) -> [f32; 3] {
    let (sin, cos) = way_rad.sin_cos();
    let [x, y, z] = shoulder;
    f32s(&[
        x + ahead * cos - left * sin,
        y + ahead * sin + left * cos,
        z + above,
    ])
}

/// Foot, hip and foot of a figure that walks towards `way_rad` beside its shoulder's point; without a phase it stands.
fn legs_at(shoulder: [f64; 3], way_rad: f64, phase_rad: f64) -> Vec<[f32; 3]> {
    // A gait cycle of the model is one step; the same foot swings every other.
    let (stride, swing) = match phase_rad.is_finite() {
        true => (0.5 * phase_rad).sin_cos(),
        false => (0.0, 0.0),
    };
    let at =
        |ahead: f64, left: f64, z: f64| beside(shoulder, way_rad, ahead, left, z - shoulder[2]);
    let foot = |side: f64| {
        at(
            side * HALF_STRIDE_M * stride,
            BESIDE_M + side * 0.1,
            0.04 + FOOT_LIFT_M * (side * swing).max(0.0),
        )
    };
    let hip = at(0.0, BESIDE_M, (shoulder[2] - TORSO_M).max(0.2));
    vec![foot(1.0), hip, foot(-1.0)]
}

/// As the viewer takes it.
pub fn f32s(v: &[f64; 3]) -> [f32; 3] {
    v.map(|x| x as f32)
}

/// A turn about the vertical.
pub fn about_z(angle_rad: &f64) -> Quaternion {
    let (sin, cos) = (0.5 * angle_rad).sin_cos();
    Quaternion::from_xyzw([0.0, 0.0, sin as f32, cos as f32])
}

#[cfg(test)]
mod tests {
    use std::f64::consts::PI;

    use super::*;

    #[test]
    fn legs_step_where_the_figure_walks() {
        // The middle of a step: the feet are far apart, one ahead and one behind.
        let [left, hip, right] = legs_at([3.0, 5.0, 1.3], 0.5 * PI, PI)[..] else {
            panic!("two feet and a hip");
        };
        let close = |got: [f32; 3], x: f64, y: f64| {
            assert!((f64::from(got[0]) - x).abs() < 1e-6, "{got:?}");
            assert!((f64::from(got[1]) - y).abs() < 1e-6, "{got:?}");
        };
        // Towards y: left is towards −x.
        close(hip, 3.0 - BESIDE_M, 5.0);
        close(left, 3.0 - BESIDE_M - 0.1, 5.0 + HALF_STRIDE_M);
        close(right, 3.0 - BESIDE_M + 0.1, 5.0 - HALF_STRIDE_M);
    }

    #[test]
    fn who_has_no_phase_stands_on_both_feet() {
        let [left, _, right] = legs_at([0.0, 0.0, 1.0], 0.0, f64::NAN)[..] else {
            panic!("two feet and a hip");
        };
        assert_eq!([left[0], right[0]], [0.0, 0.0]);
        assert_eq!([left[2], right[2]], [0.04, 0.04]);
    }
}
