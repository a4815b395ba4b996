//! The same equations written by hand, for the peers: state r, q (x, y, z, w), v, ω, φ₁, φ₂.

use std::f64::consts::TAU;

/// The peers' vector.
pub type State = ode_solvers::SVector<f64, 15>;

/// One case.
#[derive(Clone, Copy)]
pub struct Problem {
    stiffness: f64,
    damping: f64,
    /// kg·m²
    pub inertia: [f64; 3],
    carried: bool,
}

const MASS: f64 = 60.0;
const HALF: f64 = 2.45;
const ABOVE: f64 = 0.1;

impl Problem {
    /// A, B or C.
    pub fn case(name: &str) -> Self {
        let (stiffness, damping) = if name == "B" {
            (3e6, 4e3)
        } else {
            (3e3, 400.0)
        };
        let carried = name != "C";
        let inertia = if carried {
            [1.6, 45.0, 45.0]
        } else {
            [1.0, 2.0, 3.0]
        };
        Self {
            stiffness,
            damping,
            inertia,
            carried,
        }
    }

    /// At t = 0.
    pub fn start(&self) -> [f64; 15] {
        let mut y = [0.0; 15];
        if self.carried {
            y[2] = -MASS * 9.81 / (2.0 * self.stiffness);
            (y[3], y[6]) = (0.001f64.sin(), 0.001f64.cos());
        } else {
            y[6] = 1.0;
            y[10..13].copy_from_slice(&[1e-3, 5.0, 1e-3]);
        }
        y[13..].copy_from_slice(&[5.9, 3.1]);
        y
    }
}

/// N* of both handles, N.
pub fn unclamped(p: &Problem, t: f64, y: &[f64]) -> [f64; 2] {
    contacts(p, t, y).map(|c| c.free)
}

struct Contact {
    free: f64,
    /// Force along x and y.
    hold: [f64; 2],
    arm: [f64; 3],
}

fn rotation(y: &[f64]) -> [[f64; 3]; 3] {
    let [x, yy, z, w] = [y[3], y[4], y[5], y[6]];
    let s = 2.0 / (x * x + yy * yy + z * z + w * w);
    [
        [
            1.0 - s * (yy * yy + z * z),
            s * (x * yy - w * z),
            s * (x * z + w * yy),
        ],
        [
            s * (x * yy + w * z),
            1.0 - s * (x * x + z * z),
            s * (yy * z - w * x),
        ],
        [
            s * (x * z - w * yy),
            s * (yy * z + w * x),
            1.0 - s * (x * x + yy * yy),
        ],
    ]
}

fn pull(t: f64, phase: f64, own_hz: f64) -> f64 {
    TAU * own_hz + 2.3 * (TAU * 2.15 * t - phase).sin()
}

const OWN_HZ: [f64; 2] = [2.0, 2.05];

fn contacts(p: &Problem, t: f64, y: &[f64]) -> [Contact; 2] {
    let r = rotation(y);
    let spin = [y[10], y[11], y[12]];
    let world = [0, 1, 2].map(|a| r[a][0] * spin[0] + r[a][1] * spin[1] + r[a][2] * spin[2]);
    [0, 1].map(|i| {
        let along = if i == 0 { HALF } else { -HALF };
        let phase = y[13 + i];
        let (sin, cos) = phase.sin_cos();
        let base = [along, 0.0, ABOVE + 0.075 * sin];
        let lift = 0.075 * cos * pull(t, phase, OWN_HZ[i]);
        let arm = [0, 1, 2].map(|a| r[a][0] * along + r[a][2] * ABOVE);
        let rate = [
            y[7] + world[1] * arm[2] - world[2] * arm[1],
            y[8] + world[2] * arm[0] - world[0] * arm[2],
            y[9] + world[0] * arm[1] - world[1] * arm[0],
        ];
        let gap = [0, 1, 2].map(|a| base[a] - y[a] - arm[a]);
        Contact {
            free: p.stiffness * gap[2] + p.damping * (lift - rate[2]),
            hold: [0, 1].map(|a| 3000.0 * gap[a] - 150.0 * rate[a]),
            arm,
        }
    })
}

/// dy = f(t, y)
pub fn rhs(p: &Problem, t: f64, y: &[f64], dy: &mut [f64]) {
    let (mut force, mut torque) = ([0.0; 3], [0.0; 3]);
    if p.carried {
        for c in contacts(p, t, y) {
            let f = [c.hold[0], c.hold[1], c.free.max(0.0)];
            for a in 0..3 {
                force[a] += f[a];
                torque[a] +=
                    c.arm[(a + 1) % 3] * f[(a + 2) % 3] - c.arm[(a + 2) % 3] * f[(a + 1) % 3];
            }
        }
        force[2] -= MASS * 9.81;
        for i in 0..2 {
            dy[13 + i] = pull(t, y[13 + i], OWN_HZ[i]);
        }
    } else {
        (dy[13], dy[14]) = (0.0, 0.0);
    }
    let r = rotation(y);
    let in_body =
        [0, 1, 2].map(|a| r[0][a] * torque[0] + r[1][a] * torque[1] + r[2][a] * torque[2]);
    let (w, i) = ([y[10], y[11], y[12]], p.inertia);
    for a in 0..3 {
        dy[a] = y[7 + a];
        dy[7 + a] = force[a] / MASS;
    }
    dy[10] = (in_body[0] - (i[2] - i[1]) * w[1] * w[2]) / i[0];
    dy[11] = (in_body[1] - (i[0] - i[2]) * w[2] * w[0]) / i[1];
    dy[12] = (in_body[2] - (i[1] - i[0]) * w[0] * w[1]) / i[2];
    let [qx, qy, qz, qw] = [y[3], y[4], y[5], y[6]].map(|q| 0.5 * q);
    dy[3] = qw * w[0] + qy * w[2] - qz * w[1];
    dy[4] = qw * w[1] + qz * w[0] - qx * w[2];
    dy[5] = qw * w[2] + qx * w[1] - qy * w[0];
    dy[6] = -(qx * w[0] + qy * w[1] + qz * w[2]);
}
