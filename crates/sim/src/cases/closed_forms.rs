//! What physics knows without a computer.

use nalgebra::Complex;
use std::f64::consts::TAU;

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

/// The difference of two angles, rad, in −π…π.
pub fn turned(a: f64, b: f64) -> f64 {
    let d = a - b;
    d - TAU * (d / TAU).round()
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
        (late - (0.25 * TAU - 2e-6)).abs() < 1e-9,
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
    let omega = 2.0 * TAU;
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
        omega: 2.0 * TAU,
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
