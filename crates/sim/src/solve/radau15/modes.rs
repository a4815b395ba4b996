//! The motions that contacts damp and drive fastest: what the sweeps cannot leave to iteration.

use crate::lanes::LANES;
use crate::model::{Model, Workspace};

/// Most velocities that a body has.
pub const WATCHED: usize = 6;
/// A mode slower than this leaves the sweeps as they are, 1/s.
const SLOWEST: f64 = 1.0;
/// The time in which a mode's spring is weighed against its damper, s.
const WEIGH_S: f64 = 0.01;
/// Handles more than a few turn against each other in rounds.
const MOST_ROUNDS: usize = 8;

/// What springs and dampers do along a direction: damping, stiffness, and what straps add to both per newton of load.
type Springs = [f64; 4];

/// A direction in which the springs and dampers under the handles act alone: u̇ = −d u − κ ∫u.
#[derive(Clone, Copy, Debug)]
pub struct Mode {
    /// d (1/s), κ (1/s²); by the load on all handles together.
    springs: Springs,
    /// From residuals of the velocities to the mode.
    pub from: [f64; WATCHED],
    /// And back.
    pub to: [f64; WATCHED],
}

impl Mode {
    /// d (1/s) and κ (1/s²) under a load on all handles together, N.
    #[inline(always)]
    pub fn at(&self, load_n: f64) -> [f64; 2] {
        at(&self.springs, load_n)
    }
}

#[inline(always)]
fn at(&[d, k, by_load_d, by_load_k]: &Springs, load_n: f64) -> [f64; 2] {
    [d + by_load_d * load_n, k + by_load_k * load_n]
}

/// Springs and dampers at a handle: M^{-1/2} g, with their damping (N·s/m) and stiffness (N/m).
#[derive(Clone, Copy, Debug)]
pub struct Row {
    along: [f64; WATCHED],
    springs: Springs,
}

/// Adds the modes that the springs of all handles along some of the world's `axes` have at a state. `rows` is room to work in.
///
/// With M the masses and moments of the velocities and g the row that takes these to the rate of a handle along an axis, they are the
/// eigenvectors of M^{-1/2} Σ (τ k + c) g gᵀ M^{-1/2} over the springs that act; products of inertia are left out, since a mode only has to be
/// near. The rows √(τ k + c) M^{-1/2} g are turned two by two until they are at right angles (one-sided Jacobi: Golub & Van Loan, Matrix
/// Computations, 8.6.3), which for two rows is one turn.
pub fn modes(
    model: &Model,
    y: &[f64],
    w: &Workspace,
    axes: std::ops::Range<usize>,
    rows: &mut Vec<Row>,
    all: &mut Vec<Mode>,
) {
    rows.clear();
    let already = all.len();
    let freedoms = model.freedoms();
    let scale = freedoms.inverse_masses(y).map(f64::sqrt);
    let weight_n = model.body.mass_kg * model.body.gravity_m_per_s2.norm();
    let share = 1.0 / model.carriers() as f64;
    for axis in axes {
        for (i, h) in model.scene.carriers.handles_m.iter().enumerate() {
            let mut springs = model.springs(i, axis);
            // Who rests bears a fair share.
            let rests = w.pair[i / LANES].contact_gain.as_array()[i % LANES] != 0.0;
            let borne = if rests { share } else { 0.0 };
            springs[2..].iter_mut().for_each(|x| *x *= borne);
            let [damping, stiffness] = at(&springs, weight_n);
            let size = (damping + WEIGH_S * stiffness).sqrt();
            if size == 0.0 || (axis == 2 && !rests) {
                continue;
            }
            let levers = freedoms.levers(y, *h, axis);
            let along = std::array::from_fn(|a| scale[a] * levers[a]);
            rows.push(Row { along, springs });
            all.push(Mode {
                springs: [0.0; 4],
                from: along.map(|x| x * size),
                to: [0.0; WATCHED],
            });
        }
    }
    turn_apart(&mut all[already..]);
    let mut kept = already;
    for k in already..all.len() {
        let size = dot(&all[k].from, &all[k].from);
        if size <= SLOWEST {
            continue;
        }
        let v = all[k].from.map(|x| x / size.sqrt());
        let mut springs = [0.0; 4];
        for row in &*rows {
            let part = dot(&row.along, &v).powi(2);
            for (sum, x) in springs.iter_mut().zip(row.springs) {
                *sum += x * part;
            }
        }
        all[kept] = Mode {
            springs,
            // A velocity that is held, or that there is not, has no part in it.
            from: std::array::from_fn(|a| if scale[a] > 0.0 { v[a] / scale[a] } else { 0.0 }),
            to: std::array::from_fn(|a| v[a] * scale[a]),
        };
        kept += 1;
    }
    all.truncate(kept);
}

/// Turns vectors two by two until all are at right angles.
fn turn_apart(modes: &mut [Mode]) {
    for _ in 0..MOST_ROUNDS {
        let mut turned = false;
        for q in 1..modes.len() {
            for p in 0..q {
                let (a, b) = (modes[p].from, modes[q].from);
                let (aa, bb, ab) = (dot(&a, &a), dot(&b, &b), dot(&a, &b));
                if ab * ab <= 1e-12 * aa * bb {
                    continue;
                }
                turned = true;
                let theta = (bb - aa) / (2.0 * ab);
                let t = theta.signum() / (theta.abs() + (theta * theta + 1.0).sqrt());
                let c = 1.0 / (t * t + 1.0).sqrt();
                let s = t * c;
                modes[p].from = std::array::from_fn(|k| c * a[k] - s * b[k]);
                modes[q].from = std::array::from_fn(|k| s * a[k] + c * b[k]);
            }
        }
        if !turned || modes.len() <= 2 {
            break;
        }
    }
}

fn dot(a: &[f64; WATCHED], b: &[f64; WATCHED]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}
