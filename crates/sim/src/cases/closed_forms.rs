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
