//! The scene: the body on its poles, the carriers walking under it, contact forces as arrows, the ground they walk over.
//!
//! The view's origin is an entity that walks along, so that the camera does and the ground passes by.

use re_sdk_types::archetypes::{
    Arrows3D, Boxes3D, LineStrips3D, Points3D, Transform3D, ViewCoordinates,
};
use re_sdk_types::components::FillMode;
use re_sdk_types::datatypes::Quaternion;
use recording::load::Load;

use super::course;
use super::people::{self, APART_M, about_z, f32s};
use crate::blueprint::View;
use crate::palette;
use crate::store::Store;
use crate::take::{Carriers, Pose, Stay, Take, every};

/// How long the trail of the centre of mass is, s.
const TRAIL_S: f64 = 5.0;
/// Length of the arrow of a handle that carries its fair share M·g/N, m, seen from [`NEAR_M`].
const FAIR_SHARE_M: f64 = 0.5;
/// More fair shares than these would leave the picture: the arrow ends there, white.
const MOST_SHARES: f64 = 5.0;
/// From much farther away arrows are twice as long, m.
const NEAR_M: f64 = 5.0;
/// Reach of the ground beyond the path, m.
const MARGIN_M: f32 = 7.0;
/// Half the width of the ground, m.
const HALF_WIDTH_M: f32 = 14.0;

/// Draws the scene where there is a pose.
pub fn draw(store: &mut Store<'_>, take: &Take) -> anyhow::Result<Option<View>> {
    let Some(pose) = take.pose.as_ref().filter(|pose| !pose.times_ns.is_empty()) else {
        return Ok(None);
    };
    let origin_m = store.about_m(pose.begins_m());
    if origin_m == [0.0; 2] {
        return scene(store, take, pose, take.carriers.as_ref());
    }
    let carriers = take.carriers.as_ref().map(|c| c.about(origin_m));
    scene(store, take, &pose.about(origin_m), carriers.as_ref())
}

/// Draws the scene of body and carriers.
fn scene(
    store: &mut Store<'_>,
    take: &Take,
    pose: &Pose,
    carriers: Option<&Carriers>,
) -> anyhow::Result<Option<View>> {
    for entity in ["/world", "/world/follow"] {
        store.fixed(entity, &ViewCoordinates::FLU())?;
    }
    ground(store, take, pose)?;
    let bent = bent(take, pose);
    body(store, take, pose, bent.as_deref())?;
    trail(store, pose)?;
    let headings = course::headings(pose);
    if let Some(carriers) = carriers {
        people::draw(store, take, pose, &course::ways(pose, &headings), carriers)?;
    }
    let look_m = follow(store, pose, &headings)?;
    let mut eye = eye(&take.shape.handles_m, f64::from(look_m));
    // What falls turns as it likes: its pole has to fit in upright too.
    if course::level_m(pose).is_none() {
        eye = eye.map(|x| 1.6 * x);
    }
    let far = eye.iter().map(|x| x * x).sum::<f64>().sqrt() / NEAR_M;
    let share_m = FAIR_SHARE_M * far.sqrt().round().clamp(1.0, 2.0);
    let forces = forces(store, take, pose, bent.as_deref(), share_m)?;
    let target = [0.0, 0.0, look_m];
    let eye = [0, 1, 2].map(|i| eye[i] as f32 + target[i]);
    let title = match forces {
        Some((unit, any_beyond)) => format!(
            "Scene: {share_m} m of arrow = {unit}/{}; blue loaded, yellow nearly unloaded, vermilion slack{}{}",
            take.inputs.normal_n.len(),
            match take.inputs.pulled_n() {
                Some(_) => ", purple pulled down",
                None => "",
            },
            match any_beyond {
                true => format!(", white > {} m", MOST_SHARES * share_m),
                false => String::new(),
            }
        ),
        None => match take.inputs.sources.attitude == "imu" {
            true => "Scene: turned as inertial sensors say, on the spot".to_owned(),
            false => "Scene".to_owned(),
        },
    };
    let view = View::space(title, "/world/follow", eye, target)
        .contents(["/world/**".to_owned()])
        .trail("/world/trail", TRAIL_S);
    Ok(Some(view))
}

/// Tangents of half the angles that the camera sees, sideways and upwards: the viewer's 55 degrees of height, in a view about twice as
/// wide as high, less a margin.
const SEEN: [f64; 2] = [0.87, 0.45];
/// What stands above a handle has to be seen so far, m: a head, an arrow.
const ABOVE_M: f64 = 0.6;
/// And so far below it, m: feet.
const BELOW_M: f64 = 1.0;

/// From where all handles and those under them are seen, a little from above and ahead, relative to the place looked at, `look_m` above
/// the frame's origin.
fn eye(handles_m: &[[f64; 3]], look_m: f64) -> [f64; 3] {
    let reach_m = handles_m
        .iter()
        .map(|h| h[0].abs().max(1.4 * h[1].abs()))
        .fold(1.2, f64::max);
    // Of many, those in front would hide the others.
    let up = 0.22 * reach_m + 0.4 + 0.4 * (reach_m - 4.0).max(0.0);
    let eye = [0.5 * reach_m, -1.2 * reach_m - 0.6, up];
    let length = eye.iter().map(|x| x * x).sum::<f64>().sqrt();
    let back = eye.map(|x| x / length);
    let level = back[0].hypot(back[1]);
    let right = [-back[1] / level, back[0] / level, 0.0];
    let upward = [-back[2] * right[1], back[2] * right[0], level];
    let dot = |a: &[f64; 3], b: &[f64; 3]| (0..3).map(|i| a[i] * b[i]).sum::<f64>();
    let ends = handles_m.iter().flat_map(|&[x, y, z]| {
        let x = x + 0.3f64.copysign(x);
        [z + ABOVE_M, z - BELOW_M].map(|z| [x, y, z - look_m])
    });
    let far_m = ends
        .map(|p| {
            let across = [&right, &upward].map(|axis| dot(&p, axis).abs());
            dot(&p, &back) + (across[0] / SEEN[0]).max(across[1] / SEEN[1])
        })
        .fold(length, f64::max);
    back.map(|x| far_m * x)
}

/// The frame that walks along and turns as the path does, at the mean height or, where the body climbs or falls, at its own; gives
/// where to look in it, m above its origin.
fn follow(store: &mut Store<'_>, pose: &Pose, headings: &[f64]) -> anyhow::Result<f32> {
    let places = pose
        .position_m
        .iter()
        .zip(course::levels_m(pose))
        .map(|(p, level_m)| f32s(&[p[0], p[1], level_m]));
    let columns = Transform3D::update_fields()
        .with_many_translation(places)
        .with_many_quaternion(headings.iter().map(about_z))
        .columns_of_unit_batches()?;
    store.rows("/world/follow", &pose.times_ns, columns)?;
    // Figures that stand on the ground are seen best from about their hips; where none can carry, the body is looked at.
    let level_m = course::level_m(pose).filter(|level_m| level_m.abs() < APART_M);
    Ok(level_m.map_or(0.0, |level_m| 0.78 - level_m as f32))
}

/// A strip of ground under the whole path, with a line at every metre.
fn ground(store: &mut Store<'_>, take: &Take, pose: &Pose) -> anyhow::Result<()> {
    let (mut low, mut high) = ([f32::INFINITY; 2], [f32::NEG_INFINITY; 2]);
    for p in pose
        .position_m
        .iter()
        .filter(|p| p.iter().all(|x| x.is_finite()))
    {
        for axis in 0..2 {
            low[axis] = low[axis].min(p[axis] as f32);
            high[axis] = high[axis].max(p[axis] as f32);
        }
    }
    if low[0] > high[0] {
        return Ok(());
    }
    let reach = take
        .shape
        .handles_m
        .iter()
        .map(|h| h[0].abs())
        .fold(0.0, f64::max) as f32;
    let (x0, x1) = (
        (low[0] - reach - MARGIN_M).floor(),
        (high[0] + reach + MARGIN_M).ceil(),
    );
    let (y0, y1) = (
        (low[1] - HALF_WIDTH_M).floor(),
        (high[1] + HALF_WIDTH_M).ceil(),
    );
    let plane = Boxes3D::from_centers_and_half_sizes(
        [[0.5 * (x0 + x1), 0.5 * (y0 + y1), -0.03]],
        [[0.5 * (x1 - x0), 0.5 * (y1 - y0), 0.02]],
    )
    .with_colors([palette::GROUND])
    .with_fill_mode(FillMode::Solid);
    store.fixed("/world/ground/plane", &plane)?;
    // At most some hundred lines, on whole metres, tens or hundreds.
    let step = |from: f32, to: f32| {
        let mut step = 1.0f32;
        while (to - from) / step > 400.0 {
            step *= 10.0;
        }
        (0..=((to - from) / step) as usize).map(move |k| from + k as f32 * step)
    };
    let mut strips: Vec<Vec<[f32; 3]>> = step(x0, x1)
        .map(|x| vec![[x, y0, 0.0], [x, y1, 0.0]])
        .collect();
    strips.extend(step(y0, y1).map(|y| vec![[x0, y, 0.0], [x1, y, 0.0]]));
    let lines = LineStrips3D::new(strips)
        .with_radii([0.008f32])
        .with_colors([palette::GRID]);
    store.fixed("/world/ground/metres", &lines)
}

/// The body with its poles, moving as the state says.
fn body(
    store: &mut Store<'_>,
    take: &Take,
    pose: &Pose,
    bent: Option<&[Vec<[f64; 3]>]>,
) -> anyhow::Result<()> {
    let turns = pose
        .orientation
        .iter()
        .map(|q| Quaternion::from_xyzw(q.map(|x| x as f32)));
    let columns = Transform3D::update_fields()
        .with_many_translation(pose.position_m.iter().map(f32s))
        .with_many_quaternion(turns)
        .columns_of_unit_batches()?;
    store.rows("/world/rath", &pose.times_ns, columns)?;
    let half = take.shape.box_m.map(|x| 0.5 * x as f32);
    let (turns, there) = comings(&take.stays(&pose.times_ns));
    let each: usize = there.iter().sum();
    let boxes = || Boxes3D::from_half_sizes(vec![half; each]).columns(there.iter().copied());
    store.rows("/world/rath/body", &turns, boxes()?)?;
    let body = Boxes3D::update_fields()
        .with_colors([palette::BODY])
        .with_fill_mode(FillMode::Solid);
    store.fixed("/world/rath/body", &body)?;
    store.rows("/world/rath/edges", &turns, boxes()?)?;
    let edges = Boxes3D::update_fields()
        .with_colors([palette::POLE])
        .with_radii([0.008f32]);
    store.fixed("/world/rath/edges", &edges)?;
    let poles = poles(&take.shape.handles_m);
    if poles.is_empty() {
        return Ok(());
    }
    let style = LineStrips3D::update_fields()
        .with_radii([0.04f32])
        .with_colors([palette::POLE]);
    if let Some(bent) = bent {
        let count = poles.len();
        let strips = bent.iter().zip(&take.force_ns).flat_map(|(places, t)| {
            let at = pose.moment(*t);
            let middles = poles.iter().map(move |ends| {
                let [x, y, z] = [0, 1, 2].map(|i| f64::from(0.5 * (ends[0][i] + ends[1][i])));
                pose.places_in_world(at, &[[x, y, z]])[0]
            });
            let handles = &take.shape.handles_m;
            middles
                .zip(&poles)
                .map(|(middle, ends)| strip(handles, places, ends, middle))
                .collect::<Vec<_>>()
        });
        let columns = LineStrips3D::new(strips).columns(std::iter::repeat_n(count, bent.len()))?;
        store.rows("/world/poles", &take.force_ns, columns)?;
        let ends = take.ends(&take.force_ns);
        let empty = LineStrips3D::new(NO_STRIPS).columns(std::iter::repeat_n(0, ends.len()))?;
        store.gone("/world/poles", &ends, empty)?;
        return store.fixed("/world/poles", &style);
    }
    let count = poles.len();
    let strips = vec![poles; each].concat();
    let columns = LineStrips3D::new(strips).columns(there.iter().map(|there| there * count))?;
    store.rows("/world/rath/poles", &turns, columns)?;
    store.fixed("/world/rath/poles", &style)
}

/// When something that keeps its shape comes and goes, and how many there are of it from then on.
fn comings(stays: &[Stay]) -> (Vec<i64>, Vec<usize>) {
    let turns = stays.iter().flat_map(|stay| {
        let gone = stay.until_ns.map(|t_ns| (t_ns, 0));
        std::iter::once((stay.from_ns, 1)).chain(gone)
    });
    turns.unzip()
}

const NO_STRIPS: [[[f32; 3]; 2]; 0] = [];

/// A pole that bends by less is drawn straight, m.
const STRAIGHT_M: f64 = 0.01;

/// Where the handles of poles that bend are at every time of the forces: below the shoulders, by as much as they press into them.
/// `None` where that is not known, or where the poles are straight.
fn bent(take: &Take, pose: &Pose) -> Option<Vec<Vec<[f64; 3]>>> {
    let carriers = take.carriers.as_ref()?;
    let (handles, rows) = (&take.shape.handles_m, take.force_ns.len());
    let fits = carriers.times_ns == take.force_ns
        && carriers.points_m.len() == handles.len()
        && take.compression_m.len() == handles.len()
        && take.compression_m.iter().all(|x| x.len() == rows);
    if !fits {
        return None;
    }
    let mut most_m = 0.0f64;
    let places = (0..rows).map(|k| {
        let mut places = pose.places_in_world(pose.moment(take.force_ns[k]), handles);
        for (i, place) in places.iter_mut().enumerate() {
            let z = carriers.points_m[i][k][2] - take.compression_m[i][k];
            if z.is_finite() {
                most_m = most_m.max((z - place[2]).abs());
                place[2] = z;
            }
        }
        places
    });
    let places: Vec<Vec<[f64; 3]>> = places.collect();
    (STRAIGHT_M..APART_M).contains(&most_m).then_some(places)
}

/// Places along a pole that lie no farther apart are one: no direction can be told from them, m.
const SAME_M: f64 = 0.01;

/// A pole through its middle, where the body holds it, and through the places of its handles, a little longer than they need.
fn strip(
    handles_m: &[[f64; 3]],
    places: &[[f64; 3]],
    ends: &[[f32; 3]; 2],
    middle: [f64; 3],
) -> Vec<[f32; 3]> {
    let (low, high) = (f64::from(ends[0][0]), f64::from(ends[1][0]));
    let mut points: Vec<(f64, [f64; 3])> = handles_m
        .iter()
        .zip(places)
        .filter(|(h, _)| {
            [1, 2]
                .iter()
                .all(|&i| (h[i] - f64::from(ends[0][i])).abs() < 0.01)
        })
        .map(|(h, place)| (h[0], *place))
        .collect();
    let x = 0.5 * (low + high);
    // A handle at the middle is where the body holds the pole.
    points.retain(|(handle_x, _)| (handle_x - x).abs() > SAME_M);
    points.push((x, middle));
    points.sort_by(|a, b| a.0.total_cmp(&b.0));
    let beyond = |(x0, p0): (f64, [f64; 3]), (x1, p1): (f64, [f64; 3]), x: f64| {
        let share = (x - x0) / (x1 - x0);
        f32s(&[0, 1, 2].map(|i| p0[i] + share * (p1[i] - p0[i])))
    };
    points.dedup_by(|a, b| (a.0 - b.0).abs() <= SAME_M);
    let n = points.len();
    if n < 2 {
        return points.iter().map(|(_, p)| f32s(p)).collect();
    }
    let first = beyond(points[0], points[1], low);
    let last = beyond(points[n - 2], points[n - 1], high);
    std::iter::once(first)
        .chain(points.iter().map(|(_, p)| f32s(p)))
        .chain([last])
        .collect()
}

/// One pole along x for every (y, z) at which there are handles, a little longer than they need; one with a single handle reaches to the middle of the body.
fn poles(handles_m: &[[f64; 3]]) -> Vec<[[f32; 3]; 2]> {
    let mut poles: Vec<[f64; 4]> = Vec::new();
    for &[x, y, z] in handles_m {
        match poles
            .iter_mut()
            .find(|p| (p[0] - y).abs() < 0.01 && (p[1] - z).abs() < 0.01)
        {
            Some(pole) => (pole[2], pole[3]) = (pole[2].min(x), pole[3].max(x)),
            None => poles.push([y, z, x, x]),
        }
    }
    let end = |x: f64, y: f64, z: f64| f32s(&[x, y, z]);
    let alone = |from: f64, to: f64| to - from <= SAME_M;
    let reaching = poles.iter().map(|&[y, z, from, to]| match alone(from, to) {
        true => [y, z, from.min(0.0), to.max(0.0)],
        false => [y, z, from, to],
    });
    reaching
        .map(|[y, z, from, to]| [end(from - 0.3, y, z), end(to + 0.3, y, z)])
        .collect()
}

fn trail(store: &mut Store<'_>, pose: &Pose) -> anyhow::Result<()> {
    // Pieces of line, each from the last moment to this one, but across holes: the view shows those of the last seconds.
    let t_s = recording::signal::seconds_since(&pose.times_ns, pose.times_ns[0]);
    let parts = analyze::inputs::stretches(&t_s, 0.0).into_iter();
    let pairs: Vec<usize> = parts.flat_map(|part| part.start + 1..part.end).collect();
    let times: Vec<i64> = pairs.iter().map(|k| pose.times_ns[*k]).collect();
    let strips = pairs
        .iter()
        .map(|k| vec![f32s(&pose.position_m[k - 1]), f32s(&pose.position_m[*k])]);
    let columns = LineStrips3D::new(strips).columns_of_unit_batches()?;
    store.rows("/world/trail", &times, columns)?;
    let style = LineStrips3D::update_fields()
        .with_radii([0.012f32])
        .with_colors([palette::PURPLE]);
    store.fixed("/world/trail", &style)
}

/// Arrows and handle marks; gives the name of what they are scaled by, and whether any ends before its force does.
fn forces(
    store: &mut Store<'_>,
    take: &Take,
    pose: &Pose,
    bent: Option<&[Vec<[f64; 3]>]>,
    share_m: f64,
) -> anyhow::Result<Option<(&'static str, bool)>> {
    let handles = take.shape.handles_m.len();
    let normal_n = &take.inputs.normal_n;
    let Some((scale_n, unit)) = take.force_scale() else {
        return Ok(None);
    };
    if handles == 0 || normal_n.len() != handles || take.force_ns.is_empty() {
        return Ok(None);
    }
    let all = take.force_ns.len();
    let told: Vec<usize> = (0..all).step_by(every(all, handles)).collect();
    let (rows, times) = (told.len(), told.iter().map(|k| take.force_ns[*k]));
    let times: Vec<i64> = times.collect();
    let lengths = || std::iter::repeat_n(handles, rows);
    let shares_per_newton = handles as f64 / scale_n;
    let mut any_beyond = false;
    let thick = (share_m / FAIR_SHARE_M) as f32;
    let mut colors = Vec::with_capacity(rows * handles);
    let mut radii = Vec::with_capacity(rows * handles);
    let mut vectors = Vec::with_capacity(rows * handles);
    let mut origins = Vec::with_capacity(rows * handles);
    for k in told {
        let straight =
            || pose.places_in_world(pose.moment(take.force_ns[k]), &take.shape.handles_m);
        let places = bent.map_or_else(straight, |bent| bent[k].clone());
        for (i, (place, force)) in places.iter().zip(normal_n).enumerate() {
            let load = Load::of(force[k], scale_n, handles);
            let radius = match load {
                Load::Loaded | Load::Pulled => 0.06f32,
                Load::NearlyUnloaded => 0.085,
                Load::Slack => 0.12,
            };
            radii.push(thick * radius);
            let sideways = take.tangential_n.get(i).map_or([0.0; 2], |n| n[k]);
            let force_n = [sideways[0], sideways[1], force[k]];
            let shares = match force_n.iter().all(|n| n.is_finite()) {
                true => force_n.map(|n| n * shares_per_newton),
                false => [0.0; 3],
            };
            let length = shares.iter().map(|x| x * x).sum::<f64>().sqrt();
            let beyond = length > MOST_SHARES;
            any_beyond |= beyond;
            colors.push(match beyond {
                true => palette::WHITE,
                false => palette::load(load),
            });
            let fits = share_m * (MOST_SHARES / length).min(1.0);
            vectors.push(f32s(&shares.map(|x| fits * x)));
            origins.push(f32s(place));
        }
    }
    let marks = Points3D::new(origins.iter().copied())
        .with_colors(colors.iter().copied())
        .with_radii(radii)
        .columns(lengths())?;
    store.rows("/world/handles", &times, marks)?;
    let arrows = Arrows3D::from_vectors(vectors)
        .with_origins(origins)
        .with_colors(colors)
        .columns(lengths())?;
    store.rows("/world/forces", &times, arrows)?;
    let ends = take.ends(&times);
    let none = || std::iter::repeat_n(0, ends.len());
    let nowhere: [[f32; 3]; 0] = [];
    let empty = Points3D::new(nowhere).columns(none())?;
    store.gone("/world/handles", &ends, empty)?;
    let empty = Arrows3D::from_vectors(nowhere).columns(none())?;
    store.gone("/world/forces", &ends, empty)?;
    store.fixed(
        "/world/forces",
        &Arrows3D::update_fields().with_radii([0.03 * thick]),
    )?;
    Ok(Some((unit, any_beyond)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::draw::sent;

    #[test]
    fn an_arrow_ends_within_the_picture_and_the_title_says_so() {
        let title = |normal_n: f64| {
            let mut take = Take {
                force_ns: vec![0],
                ..Take::default()
            };
            take.pose = Some(Pose {
                times_ns: vec![0],
                position_m: vec![[0.0, 0.0, 0.8]],
                orientation: vec![[0.0, 0.0, 0.0, 1.0]],
            });
            take.shape.handles_m = vec![[2.45, 0.0, 0.1], [-2.45, 0.0, 0.1]];
            take.inputs.mass_kg = Some(2.0);
            take.inputs.gravity_m_per_s2 = 10.0;
            take.inputs.normal_n = vec![vec![normal_n], vec![1.0]];
            let mut title = String::new();
            sent::by(|store| {
                title = draw(store, &take).unwrap().unwrap().title().to_owned();
            });
            title
        };
        assert!(title(51.0).ends_with("vermilion slack, white > 2.5 m"));
        assert!(title(49.0).ends_with("vermilion slack"));
    }

    #[test]
    fn a_body_far_below_the_ground_is_looked_at() {
        let looked_at = |height_m: f64| {
            let pose = Pose {
                times_ns: vec![0],
                position_m: vec![[0.0, 0.0, height_m]],
                orientation: vec![[0.0, 0.0, 0.0, 1.0]],
            };
            let mut look_m = f32::NAN;
            sent::by(|store| look_m = follow(store, &pose, &[0.0]).unwrap());
            look_m
        };
        assert_eq!(looked_at(-1634.0), 0.0);
        assert!((looked_at(0.8) + 0.02).abs() < 1e-6);
    }

    /// Handles at equal distances along parallel poles 0.9 m apart.
    fn along(poles: usize, each: usize, length_m: f64) -> Vec<[f64; 3]> {
        let at = |k: usize, n: usize| k as f64 / (n - 1) as f64 - 0.5;
        let pole = |i: usize| {
            let y = 0.9 * (i as f64 - 0.5 * (poles - 1) as f64);
            (0..each).map(move |k| [length_m * at(k, each), y, 0.1])
        };
        (0..poles).flat_map(pole).collect()
    }

    #[test]
    fn every_handle_is_in_the_picture() {
        for (poles, each, length_m) in [(1, 2, 4.9), (2, 4, 4.9), (4, 16, 10.5), (10, 100, 69.3)] {
            let handles = along(poles, each, length_m);
            let from = eye(&handles, 0.0);
            let unit = |v: [f64; 3]| {
                let length = v.iter().map(|x| x * x).sum::<f64>().sqrt();
                v.map(|x| x / length)
            };
            let dot = |a: &[f64; 3], b: &[f64; 3]| (0..3).map(|i| a[i] * b[i]).sum::<f64>();
            let ahead = unit(from.map(|x| -x));
            let right = unit([ahead[1], -ahead[0], 0.0]);
            let up = [
                right[1] * ahead[2],
                -right[0] * ahead[2],
                right[0] * ahead[1] - right[1] * ahead[0],
            ];
            // The ends of the poles, the heads, and some room.
            for h in handles
                .iter()
                .flat_map(|&[x, y, z]| [-0.3, 0.3].map(|end| [x + end, y, z + 0.4]))
            {
                let to = [0, 1, 2].map(|i| h[i] - from[i]);
                let [right, up, deep] = [right, up, ahead].map(|axis| dot(&to, &axis));
                assert!(deep > 0.0, "{poles} {each}: {h:?}");
                // The viewer's 55 degrees, twice as wide as high.
                let half = 27.5f64.to_radians().tan();
                assert!(
                    right.abs() < 0.95 * 1.9 * half * deep,
                    "{poles} {each}: {h:?}"
                );
                assert!(up.abs() < 0.95 * half * deep, "{poles} {each}: {h:?}");
            }
        }
    }

    #[test]
    fn a_crowd_is_drawn_with_all_its_heads() {
        let count = 1000;
        let handles = along(10, 100, 69.3);
        let rows = 900;
        let mut take = Take {
            pose: Some(Pose {
                times_ns: (0..rows).collect(),
                position_m: vec![[0.0, 0.0, 0.9]; rows as usize],
                orientation: vec![[0.0, 0.0, 0.0, 1.0]; rows as usize],
            }),
            carriers: Some(Carriers {
                times_ns: (0..rows).collect(),
                points_m: handles
                    .iter()
                    .map(|[x, y, _]| vec![[*x, *y, 1.0]; rows as usize])
                    .collect(),
            }),
            ..Take::default()
        };
        take.shape.handles_m = handles;
        let sent = sent::by(|store| {
            draw(store, &take).unwrap();
        });
        for (entity, component) in [
            ("/world/legs", "LineStrips3D:strips"),
            ("/world/torsos", "LineStrips3D:strips"),
            ("/world/heads", "Points3D:positions"),
        ] {
            // Every other moment, all of them.
            let lengths = sent.lengths(entity, component);
            assert_eq!(lengths, vec![count; 450], "{entity}");
        }
        assert!(
            sent.lengths("/world/carrier_1/head", "Ellipsoids3D:half_sizes")
                .is_empty()
        );
    }

    #[test]
    fn figures_stand_only_where_they_can_carry() {
        let pose = Pose {
            times_ns: vec![0, 1, 2],
            position_m: vec![[0.0, 0.0, 0.8], [0.0, 0.0, 0.5], [0.0, 0.0, 9.0]],
            orientation: vec![[0.0, 0.0, 0.0, 1.0]; 3],
        };
        let points_m = [2.45, -2.45].map(|x| vec![[x, 0.0, 0.9]; 3]).to_vec();
        let mut take = Take {
            carriers: Some(Carriers {
                times_ns: vec![0, 1, 2],
                points_m,
            }),
            pose: Some(pose),
            ..Take::default()
        };
        take.shape.handles_m = vec![[2.45, 0.0, 0.1], [-2.45, 0.0, 0.1]];
        let sent = sent::by(|store| {
            draw(store, &take).unwrap();
        });
        let legs = sent.lengths("/world/legs", "LineStrips3D:strips");
        assert_eq!(legs, [2, 2, 0]);
        let head = sent.lengths("/world/carrier_1/head", "Ellipsoids3D:half_sizes");
        assert_eq!(head, [1, 0]);
    }

    #[test]
    fn nothing_stands_in_a_hole() {
        // 10 Hz with three seconds lost, and the recording goes on for long after the end.
        let times: Vec<i64> = (0..20).chain(50..70).map(|k| k * 100_000_000).collect();
        let n = times.len();
        let pose = Pose {
            times_ns: times.clone(),
            position_m: vec![[0.0, 0.0, 0.8]; n],
            orientation: vec![[0.0, 0.0, 0.0, 1.0]; n],
        };
        let points_m = [2.45, -2.45].map(|x| vec![[x, 0.0, 0.9]; n]).to_vec();
        let mut take = Take {
            end_ns: 20_000_000_000,
            force_ns: times.clone(),
            carriers: Some(Carriers {
                times_ns: times,
                points_m,
            }),
            pose: Some(pose),
            ..Take::default()
        };
        take.shape.handles_m = vec![[2.45, 0.0, 0.1], [-2.45, 0.0, 0.1]];
        take.inputs.mass_kg = Some(60.0);
        take.inputs.gravity_m_per_s2 = 9.81;
        take.inputs.normal_n = vec![vec![300.0; n]; 2];
        let sent = sent::by(|store| {
            draw(store, &take).unwrap();
        });
        // What keeps its shape comes and goes twice.
        for (entity, component, each) in [
            ("/world/rath/body", "Boxes3D:half_sizes", 1),
            ("/world/rath/edges", "Boxes3D:half_sizes", 1),
            ("/world/rath/poles", "LineStrips3D:strips", 1),
            ("/world/carrier_1/torso", "Capsules3D:lengths", 1),
            ("/world/carrier_2/head", "Ellipsoids3D:half_sizes", 1),
        ] {
            assert_eq!(
                sent.lengths(entity, component),
                [each, 0, each, 0],
                "{entity}"
            );
        }
        // What moves has a row of nothing for each hole.
        for (entity, component) in [
            ("/world/handles", "Points3D:positions"),
            ("/world/forces", "Arrows3D:vectors"),
            ("/world/legs", "LineStrips3D:strips"),
        ] {
            let rows = sent.lengths(entity, component);
            assert_eq!(
                rows.iter().filter(|count| **count == 0).count(),
                2,
                "{entity}"
            );
            assert_eq!(
                rows.iter().filter(|count| **count == 2).count(),
                n,
                "{entity}"
            );
        }
    }

    #[test]
    fn the_trail_has_a_hole_where_the_recording_has_one() {
        let mut pose = Pose::default();
        for k in (0..100i64).chain(130..200) {
            pose.times_ns.push(k * 33_000_000);
            pose.position_m.push([0.03 * k as f64, 0.0, 0.8]);
        }
        let sent = sent::by(|store| trail(store, &pose).unwrap());
        let pieces = sent.lengths("/world/trail", "LineStrips3D:strips");
        assert_eq!(pieces.len(), 99 + 69);
    }

    #[test]
    fn a_pole_bends_where_the_handles_are() {
        let pose = Pose {
            times_ns: vec![0],
            position_m: vec![[0.0, 0.0, 0.7]],
            orientation: vec![[0.0, 0.0, 0.0, 1.0]],
        };
        let mut take = Take {
            force_ns: vec![0],
            carriers: Some(Carriers {
                times_ns: vec![0],
                points_m: [4.0, -4.0].map(|x| vec![[x, 0.0, 1.02]]).to_vec(),
            }),
            compression_m: vec![vec![0.1]; 2],
            ..Take::default()
        };
        take.shape.handles_m = vec![[4.0, 0.0, 0.1], [-4.0, 0.0, 0.1]];
        let places = bent(&take, &pose).unwrap();
        assert!(places[0].iter().all(|p| (p[2] - 0.92).abs() < 1e-12));
        let ends = poles(&take.shape.handles_m)[0];
        let strip = strip(&take.shape.handles_m, &places[0], &ends, [0.0, 0.0, 0.8]);
        let heights: Vec<f32> = strip.iter().map(|p| p[2]).collect();
        for (got, expected) in heights.iter().zip([0.929, 0.92, 0.8, 0.92, 0.929]) {
            assert!((got - expected).abs() < 1e-5, "{heights:?}");
        }
        // A pole with one handle, at its middle but for rounding, has no direction, and one beside it goes there.
        let one = |x: f64| {
            let handle = [[x, 0.3, 0.1]];
            let ends = [[x as f32 - 0.3, 0.3, 0.1], [x as f32 + 0.3, 0.3, 0.1]];
            super::strip(&handle, &[[2.4, 0.3, 0.7]], &ends, [2.4, 0.3, 0.8])
        };
        assert_eq!(one(2.4), [[2.4, 0.3, 0.8]]);
        // As far below the shoulder as the body holds it: a straight pole.
        take.compression_m = vec![vec![0.22]; 2];
        assert_eq!(bent(&take, &pose), None);
    }

    #[test]
    fn handles_on_one_line_share_a_pole() {
        let two = poles(&[[2.45, 0.0, 0.1], [-2.45, 0.0, 0.1]]);
        assert_eq!(two, [[[-2.75, 0.0, 0.1], [2.75, 0.0, 0.1]]]);
        let eight: Vec<[f64; 3]> = (0..8)
            .map(|i| {
                [
                    f64::from(i / 2) - 1.5,
                    if i % 2 == 0 { 0.4 } else { -0.4 },
                    0.1,
                ]
            })
            .collect();
        assert_eq!(poles(&eight).len(), 2);
        // One alone is held by the body.
        assert_eq!(
            poles(&[[2.4, 0.3, 0.1]]),
            [[[-0.3, 0.3, 0.1], [2.7, 0.3, 0.1]]]
        );
        assert!(poles(&[]).is_empty());
    }
}
