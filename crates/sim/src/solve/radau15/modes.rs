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

/// A direction in which the springs and dampers under the handles act alone: u̇ = −d u − κ ∫u.
#[derive(Clone, Copy, Debug)]
pub struct Mode {
    /// d, 1/s
    pub damping_per_s: f64,
    /// κ, 1/s²
    pub stiffness_per_s2: f64,
    /// From residuals of the velocities to the mode.
    pub from: [f64; WATCHED],
    /// And back.
    pub to: [f64; WATCHED],
}

/// A spring and damper at a handle: M^{-1/2} g, with its damping (N·s/m) and stiffness (N/m).
#[derive(Clone, Copy, Debug)]
pub struct Row {
    along: [f64; WATCHED],
    damping: f64,
    stiffness: f64,
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
    for axis in axes {
        for (i, h) in model.scene.carriers.handles_m.iter().enumerate() {
            let [damping, stiffness] = model.springs(i, axis);
            let acts = axis < 2 || w.pair[i / LANES].contact_gain.as_array()[i % LANES] != 0.0;
            let size = (damping + WEIGH_S * stiffness).sqrt();
            if !acts || size == 0.0 {
                continue;
            }
            let levers = freedoms.levers(y, *h, axis);
            let along = std::array::from_fn(|a| scale[a] * levers[a]);
            rows.push(Row {
                along,
                damping,
                stiffness,
            });
            all.push(Mode {
                damping_per_s: 0.0,
                stiffness_per_s2: 0.0,
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
        let weighed = |of: fn(&Row) -> f64| -> f64 {
            let each = rows.iter().map(|row| of(row) * dot(&row.along, &v).powi(2));
            each.sum()
        };
        all[kept] = Mode {
            damping_per_s: weighed(|row| row.damping),
            stiffness_per_s2: weighed(|row| row.stiffness),
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
