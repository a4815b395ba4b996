//! What physics knows without a computer.

use crate::freedoms::nearest_turn;
use nalgebra::{Complex, UnitQuaternion, Vector3};
use std::f64::consts::{FRAC_PI_2, PI};

/// g of the default body, m/s².
pub const G: f64 = 9.81;

/// Adler's equation d′ = Δ − K sin d from d₀, for any Δ ≠ 0 and K ≥ 0: d(t), rad, modulo a turn.
///
/// With u = tan(d/2) and v = u − K/Δ it is v′ = ½Δ(v² + 1 − K²/Δ²): a tangent outside the edge K = |Δ|, a hyperbola on it,
/// a hyperbolic cotangent or tangent inside. Source: Adler, Proc. IRE 34 (1946), 351.
pub fn adler(delta: f64, strength: f64, d0: f64, t_s: f64) -> f64 {
    let ratio = strength / delta;
    let v0 = (0.5 * d0).tan() - ratio;
    let half = 0.5 * delta * t_s;
    // 1 − (K/Δ)² without cancellation.
    let outside = (1.0 - ratio) * (1.0 + ratio);
    let v = if outside > 0.0 {
        let p = outside.sqrt();
        p * (half * p + (v0 / p).atan()).tan()
    } else if outside < 0.0 {
        let q = (-outside).sqrt();
        // The addition theorem of the hyperbolic tangent serves both branches.
        let th = (half * q).tanh();
        q * (v0 - q * th) / (q - v0 * th)
    } else {
        v0 / (1.0 - half * v0)
    };
    2.0 * (v + ratio).atan()
}

/// m z″ = −m g − k (z − z₀) − c z′ from rest at z₀, where the spring is slack: z(t), m. For c² < 4 k m.
pub fn sinking(mass_kg: f64, k: f64, c: f64, z0_m: f64, t_s: f64) -> f64 {
    let static_m = mass_kg * G / k;
    let gamma = 0.5 * c / mass_kg;
    let omega = (k / mass_kg - gamma * gamma).sqrt();
    let swing = (omega * t_s).cos() + gamma / omega * (omega * t_s).sin();
    z0_m - static_m * (1.0 - (-gamma * t_s).exp() * swing)
}

/// (k + icω)/(k − mω² + icω): how a mass on a spring and damper follows a moving foot.
pub fn follows(mass_kg: f64, k: f64, c: f64, omega: f64) -> Complex<f64> {
    let push = Complex::new(k, c * omega);
    push / (push - mass_kg * omega * omega)
}

/// The amplitude of a foot on which a mass just does not lift off, m: the swing of the force m ω² A |H| equals the weight m g.
pub fn grazing_amplitude_m(mass_kg: f64, k: f64, c: f64, omega: f64) -> f64 {
    G / (omega * omega * follows(mass_kg, k, c, omega).norm())
}

/// A load on shoulders that go up and down in step, with a spring and damper that push and never pull: m z″ = −m g + max(0, N*),
/// N* = k (b − z) + c (b′ − z′), b = b₀ + A sin ωt. Parabolas and swings, each in closed form; moments of change by bisection. For c² < 4 k m.
pub struct Carried {
    pub mass_kg: f64,
    /// Of all handles together, N/m and N·s/m.
    pub k: f64,
    pub c: f64,
    /// b₀, the height of the load whose handles touch shoulders at rest, m.
    pub touch_m: f64,
    pub amplitude_m: f64,
    pub omega: f64,
}

/// From a moment on: the load's height (m) and velocity (m/s) there, and whether it is in contact.
#[derive(Clone, Copy, Debug)]
pub struct Piece {
    pub t_s: f64,
    from: [f64; 2],
    pub closed: bool,
}

impl Carried {
    /// √(k/m), rad/s.
    pub fn natural(&self) -> f64 {
        (self.k / self.mass_kg).sqrt()
    }

    /// Height and velocity of a steady swing on shoulders that it never leaves.
    fn steady(&self, t_s: f64) -> [f64; 2] {
        let swing = follows(self.mass_kg, self.k, self.c, self.omega)
            * Complex::from_polar(self.amplitude_m, self.omega * t_s);
        [
            self.touch_m - self.mass_kg * G / self.k + swing.im,
            self.omega * swing.re,
        ]
    }

    /// Height and velocity.
    fn motion(&self, piece: &Piece, t_s: f64) -> [f64; 2] {
        let (t, [z, v]) = (t_s - piece.t_s, piece.from);
        if !piece.closed {
            return [z + (v - 0.5 * G * t) * t, v - G * t];
        }
        let gamma = 0.5 * self.c / self.mass_kg;
        let omega = (self.natural().powi(2) - gamma * gamma).sqrt();
        let ([z_then, v_then], [z_now, v_now]) = (self.steady(piece.t_s), self.steady(t_s));
        let (x, u) = (z - z_then, v - v_then);
        let (sin, cos) = (omega * t).sin_cos();
        let (decay, y) = ((-gamma * t).exp(), (u + gamma * x) / omega);
        [
            z_now + decay * (x * cos + y * sin),
            v_now + decay * (u * cos - (omega * x + gamma * y) * sin),
        ]
    }

    /// N*, N.
    fn free_n(&self, piece: &Piece, t_s: f64) -> f64 {
        let (sin, cos) = (self.omega * t_s).sin_cos();
        let [z, v] = self.motion(piece, t_s);
        self.k * (self.touch_m + self.amplitude_m * sin - z)
            + self.c * (self.amplitude_m * self.omega * cos - v)
    }

    /// The pieces of the motion from a height and a velocity at t = 0.
    pub fn course(&self, start: [f64; 2], until_s: f64) -> Vec<Piece> {
        let step_s = 0.02 / self.natural().max(self.omega);
        let mut piece = Piece {
            t_s: 0.0,
            from: start,
            closed: true,
        };
        piece.closed = self.free_n(&piece, 1e-3 * step_s) > 0.0;
        let mut pieces = vec![piece];
        loop {
            let margin = |t: f64| {
                let free = self.free_n(&piece, t);
                if piece.closed { free } else { -free }
            };
            let mut seen = [f64::INFINITY; 2];
            let mut t = piece.t_s;
            let beyond = loop {
                t += step_s;
                if t > until_s + 2.0 * step_s {
                    return pieces;
                }
                let now = margin(t);
                if now < 0.0 {
                    break t;
                }
                // Between looks it may go below zero and come back.
                if seen[0].is_finite() && seen[1] < seen[0] && seen[1] <= now {
                    let (mut a, mut b) = (t - 2.0 * step_s, t);
                    for _ in 0..60 {
                        let (l, r) = (a + (b - a) / 3.0, b - (b - a) / 3.0);
                        if margin(l) < margin(r) { b = r } else { a = l }
                    }
                    if margin(a) < 0.0 {
                        break a;
                    }
                }
                seen = [seen[1], now];
            };
            // The margin is positive just behind the event before.
            let (mut a, mut b) = ((beyond - 2.0 * step_s).max(piece.t_s), beyond);
            for _ in 0..100 {
                let middle = 0.5 * (a + b);
                if margin(middle) < 0.0 {
                    b = middle
                } else {
                    a = middle
                }
            }
            if b > until_s {
                return pieces;
            }
            piece = Piece {
                t_s: b,
                from: self.motion(&piece, b),
                closed: !piece.closed,
            };
            pieces.push(piece);
        }
    }

    /// Height (m), velocity (m/s) and N (N) at a moment of a course.
    pub fn at(&self, pieces: &[Piece], t_s: f64) -> [f64; 3] {
        let piece = &pieces[pieces.partition_point(|p| p.t_s <= t_s).max(1) - 1];
        let [z, v] = self.motion(piece, t_s);
        let n = if piece.closed {
            self.free_n(piece, t_s)
        } else {
            0.0
        };
        [z, v, n]
    }

    /// By how much a hair at the start of a course has grown at most, at `times_s`.
    pub fn growth(&self, pieces: &[Piece], start: [f64; 2], times_s: &[f64]) -> f64 {
        const HAIR_M: f64 = 1e-9;
        let until_s = times_s.last().copied().unwrap_or(0.0);
        let beside = self.course([start[0] + HAIR_M, start[1]], until_s);
        let apart = |&t: &f64| (self.at(pieces, t)[0] - self.at(&beside, t)[0]).abs() / HAIR_M;
        times_s.iter().map(apart).fold(1.0, f64::max)
    }

    /// How fast N* passes its zero where a piece begins, N/s.
    pub fn passes_n_per_s(&self, piece: &Piece) -> f64 {
        let h = 1e-4 / self.natural().max(self.omega);
        (self.free_n(piece, piece.t_s + h) - self.free_n(piece, piece.t_s - h)).abs() / (2.0 * h)
    }
}

/// Carlson's R_F(x, y, z) = ½ ∫₀^∞ ds/√((s+x)(s+y)(s+z)) by duplication: thirty of them leave the three apart by 4⁻³⁰.
/// Source: Carlson, Numer. Algorithms 10 (1995), 13.
fn carlson_f(mut v: [f64; 3]) -> f64 {
    for _ in 0..30 {
        let [x, y, z] = v.map(f64::sqrt);
        v = v.map(|s| 0.25 * (s + x * y + y * z + z * x));
    }
    1.0 / v[0].sqrt()
}

/// Carlson's R_J(x, y, z, p) = 3/2 ∫₀^∞ ds/((s+p)√((s+x)(s+y)(s+z))), as [`carlson_f`].
fn carlson_j(mut v: [f64; 3], mut p: f64) -> f64 {
    let delta: f64 = v.iter().map(|s| p - s).product();
    let (mut sum, mut part) = (0.0, 1.0);
    for _ in 0..30 {
        let ([x, y, z], root) = (v.map(f64::sqrt), p.sqrt());
        let d = (root + x) * (root + y) * (root + z);
        let e = 1.0 + part * part * part * delta / (d * d);
        sum += 6.0 * part / d * carlson_f([1.0, e, e]);
        let shift = x * y + y * z + z * x;
        (v, p) = (v.map(|s| 0.25 * (s + shift)), 0.25 * (p + shift));
        part *= 0.25;
    }
    sum
}

/// Legendre's integrals of the first and the third kind for any φ: ∫₀^φ dθ/√(1 − m sin²θ), and the same over 1 + n sin²θ.
fn legendre(phi: f64, m: f64, n: f64) -> [f64; 2] {
    let within = |phi: f64| {
        let (sin, cos) = phi.sin_cos();
        let (square, v) = (sin * sin, [cos * cos, 1.0 - m * sin * sin, 1.0]);
        let first = sin * carlson_f(v);
        let third = first - n / 3.0 * sin * square * carlson_j(v, 1.0 + n * square);
        [first, third]
    };
    let halves = (phi / PI).round();
    let (whole, rest) = (within(FRAC_PI_2), within(phi - halves * PI));
    [0, 1].map(|k| 2.0 * halves * whole[k] + rest[k])
}

/// Jacobi's amplitude am(u | m), the inverse of the integral of the first kind. Source: Abramowitz and Stegun, 16.4.
fn amplitude(u: f64, m: f64) -> f64 {
    let (mut a, mut b) = (1.0, (1.0 - m).sqrt());
    let ratios = [(); 8].map(|()| {
        let half = 0.5 * (a - b);
        (a, b) = (0.5 * (a + b), (a * b).sqrt());
        half / a
    });
    ratios.iter().rev().fold(256.0 * a * u, |phi, ratio| {
        0.5 * (phi + (ratio * phi.sin()).asin())
    })
}

/// A rigid body that nothing turns: its spin in Jacobi's elliptic functions, and how it turns about its angular momentum by the
/// integral of the third kind. For principal inertias I₁ ≤ I₂ < I₃, ω₃ > 0, and L² > 2E·I₂: it circles the third axis.
/// Source: Landau and Lifshitz, Mechanics (1976), §37.
pub struct Tumbling {
    inertia: [f64; 3],
    /// ω₁ = A₁ cn τ, ω₂ = A₂ sn τ, ω₃ = A₃ dn τ, rad/s.
    most: [f64; 3],
    momentum: f64,
    /// τ = τ₀ + rate·t, 1/s, and the parameter of the functions.
    rate: f64,
    parameter: f64,
    began: f64,
}

impl Tumbling {
    /// From principal inertias, kg·m², and the spin in their axes at t = 0, rad/s.
    pub fn new(inertia: [f64; 3], spin: [f64; 3]) -> Self {
        let [i1, i2, i3] = inertia;
        let sum = |power: i32| -> f64 {
            let each = inertia.iter().zip(spin);
            each.map(|(i, w)| i.powi(power) * w * w).sum()
        };
        let (twice_j, square) = (sum(1), sum(2));
        let (below, above) = (twice_j * i3 - square, square - twice_j * i1);
        let most = [
            (below / (i1 * (i3 - i1))).sqrt(),
            (below / (i2 * (i3 - i2))).sqrt(),
            (above / (i3 * (i3 - i1))).sqrt(),
        ];
        let parameter = (i2 - i1) * below / ((i3 - i2) * above);
        let phi = (spin[1] / most[1]).atan2(spin[0] / most[0]);
        Self {
            inertia,
            most,
            momentum: square.sqrt(),
            rate: ((i3 - i2) * above / (i1 * i2 * i3)).sqrt(),
            parameter,
            began: legendre(phi, parameter, 0.0)[0],
        }
    }

    /// The spin in the body, rad/s, and the turn since t = 0: from the body's axes as they are to those that it had.
    pub fn at(&self, t_s: f64) -> (Vector3<f64>, UnitQuaternion<f64>) {
        let ([i1, i2, i3], m) = (self.inertia, self.parameter);
        let n = i3 * (i2 - i1) / (i1 * (i3 - i2));
        let phi = |t_s: f64| amplitude(self.began + self.rate * t_s, m);
        let spin = |phi: f64| {
            let (sin, cos) = phi.sin_cos();
            let shape = Vector3::new(cos, sin, (1.0 - m * sin * sin).sqrt());
            shape.component_mul(&Vector3::from(self.most))
        };
        // Euler's angles about L, without the precession.
        let leant = |spin: Vector3<f64>| {
            let l = spin.component_mul(&Vector3::from(self.inertia));
            UnitQuaternion::from_scaled_axis(Vector3::x() * l.x.hypot(l.y).atan2(l.z))
                * UnitQuaternion::from_scaled_axis(Vector3::z() * l.x.atan2(l.y))
        };
        let (first, now) = (phi(0.0), phi(t_s));
        let third = legendre(now, m, n)[1] - legendre(first, m, n)[1];
        let slow = self.momentum / i3;
        let precession = slow * t_s + (self.momentum / i1 - slow) / self.rate * third;
        let turn = leant(spin(first)).inverse()
            * UnitQuaternion::from_scaled_axis(Vector3::z() * precession)
            * leant(spin(now));
        (spin(now), turn)
    }
}

/// The difference of two angles, rad, in −π…π.
pub fn turned(a: f64, b: f64) -> f64 {
    nearest_turn(a - b, 0.0)
}

#[test]
fn adler_agrees_with_its_equation_on_every_branch() {
    for (delta, strength) in [
        (2.0, 0.5),
        (2.0, 2.0),
        (2.0, 3.0),
        (1.0, 1.0 + 1e-9),
        (-2.0, 1.0),
    ] {
        for d0 in [0.0, 1.0, -2.0] {
            let (t, h) = (0.37, 1e-5);
            let at = |t| adler(delta, strength, d0, t);
            let slope = turned(at(t + h), at(t - h)) / (2.0 * h);
            let law = delta - strength * at(t).sin();
            assert!(
                (slope - law).abs() < 1e-8,
                "{delta} {strength} {d0}: {slope} {law}"
            );
            assert!(turned(at(0.0), d0).abs() < 1e-14);
        }
    }
    let late = adler(1.0, 1.0, 0.0, 1e6);
    assert!(
        (late - (FRAC_PI_2 - 2e-6)).abs() < 1e-9,
        "the edge is reached as 2/(K t)"
    );
}

#[test]
fn sinking_and_grazing_agree_with_their_equations() {
    let (m, k, c, h, t) = (60.0, 6000.0, 900.0, 1e-4, 0.2);
    let at = |t| sinking(m, k, c, 0.9, t);
    let (v, a) = (
        (at(t + h) - at(t - h)) / (2.0 * h),
        (at(t + h) - 2.0 * at(t) + at(t - h)) / (h * h),
    );
    assert!((m * a + m * G + k * (at(t) - 0.9) + c * v).abs() < 1e-3);
    let omega = 4.0 * PI;
    let amplitude = grazing_amplitude_m(m, k, c, omega);
    let acceleration = omega * omega * amplitude * follows(m, k, c, omega).norm();
    assert!((acceleration - G).abs() < 1e-12);
}

#[test]
fn a_carried_load_obeys_its_equation_and_never_jumps() {
    let load = Carried {
        mass_kg: 60.0,
        k: 6000.0,
        c: 800.0,
        touch_m: 0.9,
        amplitude_m: 0.075,
        omega: 4.0 * PI,
    };
    let pieces = load.course([0.85, 0.3], 10.0);
    assert!(pieces.len() > 20, "{}", pieces.len());
    let h = 1e-5;
    for pair in pieces.windows(2) {
        let (a, b) = (&pair[0], &pair[1]);
        assert!(a.closed != b.closed && load.free_n(a, b.t_s).abs() < 1e-9);
        let t = 0.5 * (a.t_s + b.t_s);
        let [z, v, n] = load.at(&pieces, t);
        let [after, before] = [t + h, t - h].map(|t| load.at(&pieces, t));
        let slopes = [0, 1].map(|k| (after[k] - before[k]) / (2.0 * h));
        assert!((slopes[0] - v).abs() < 1e-6, "{slopes:?} {v}");
        assert!((slopes[1] - (n / 60.0 - G)).abs() < 1e-5, "{slopes:?} {n}");
        let [b_m, b_rate] = [
            0.9 + 0.075 * (load.omega * t).sin(),
            0.075 * load.omega * (load.omega * t).cos(),
        ];
        let law = 6000.0 * (b_m - z) + 800.0 * (b_rate - v);
        assert!((law.max(0.0) - n).abs() < 1e-9 && (law > 0.0) == a.closed);
    }
}

/// Spin and turn (x, y, z, w) of inertias 1, 2, 3 from a spin: Euler's equations by a Taylor series of 30 digits (mpmath 1.3.0, `odefun`).
#[test]
fn val_mpmath_tumbling() {
    let digits = [
        (
            [1.0, 2.0, 2.0],
            0.5,
            [-1.0912349172634723, 1.9517188207692682, 2.0158367695703123],
            [
                -0.0096898361471872332,
                0.44971860184235152,
                0.48751872536239122,
                0.74832130709570908,
            ],
        ),
        (
            [1.0, 2.0, 2.0],
            17.0,
            [1.4757417555097469, -1.6799363889876933, 2.0958541400389317],
            [
                0.26709095820635686,
                -0.0095402042616294879,
                -0.68604587101206593,
                -0.67669229891757474,
            ],
        ),
        (
            [-1.0, 2.0, 2.0],
            3.0,
            [-1.0741855099780291, 1.961154121978495, 2.0127820307430839],
            [
                0.11251258267958972,
                -0.41779570075433541,
                -0.62881187969917512,
                -0.64605208081017154,
            ],
        ),
    ];
    for (start, t_s, spin, [x, y, z, w]) in digits {
        let body = Tumbling::new([1.0, 2.0, 3.0], start);
        assert!(body.at(0.0).1.angle() < 1e-14);
        let (found, turn) = body.at(t_s);
        let off = (found - Vector3::from(spin)).norm();
        let expected = UnitQuaternion::new_normalize(nalgebra::Quaternion::new(w, x, y, z));
        let askew = turn.angle_to(&expected);
        assert!(
            off < 1e-13 && askew < 1e-13,
            "{t_s} s: {off:e} rad/s, {askew:e} rad"
        );
    }
}

/// Of a symmetric top the turning is elementary.
#[test]
fn a_symmetric_top_turns_about_its_axis_and_with_it_about_its_momentum() {
    let (spin, momentum) = (Vector3::new(-1.0, 2.0, 1.5), Vector3::new(-2.0, 4.0, 4.5));
    let body = Tumbling::new([2.0, 2.0, 3.0], spin.into());
    for t_s in [0.3, 4.0, 60.0] {
        let expected = UnitQuaternion::from_scaled_axis(momentum * (0.5 * t_s))
            * UnitQuaternion::from_scaled_axis(Vector3::z() * ((1.5 - 0.5 * 4.5) * t_s));
        assert!(body.at(t_s).1.angle_to(&expected) < 1e-12, "{t_s}");
    }
}
