//! The rath in its slings under carriers in step, linear in roll: stability by Floquet's theory, computed from the equations alone.
//!
//! ```text
//! M ÿ = T        I θ̈ = −h N θ − h T        T = −(N⁺/L)(u + τ u̇),   u = y − hθ
//! N = M (g + z̈)      z = A Re[H e^{i(Ωt − π/2)}]      H = (K + iCΩ)/(K − MΩ² + iCΩ)
//! ```
//! y sideways (m), θ roll (rad), small; T, N sum of the handles' forces (N), N⁺ = max(N, 0); h handles above the centre of mass
//! (m); L, τ of the slings (m, s); K, C sum of the contacts (N/m, N·s/m); A amplitude of the shoulders (m), Ω = 2πf.
//! depth m = A|H|Ω²/g: by how much the load is modulated; contact is kept for m < 1. The greatest multiplier of the 4 × 4 monodromy
//! matrix over one period says whether roll grows. Holds in bilateral contact at any m, in unilateral contact for m < 1.
//! Source: Floquet (1883); Nayfeh & Mook, Nonlinear Oscillations (1979), ch. 5. docs/reproduction.md has the slings.

use nalgebra::{Complex, Matrix4, Vector4};
use sim::scene::Scene;
use std::f64::consts::{FRAC_PI_2, TAU};

/// The linear model.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hanging {
    /// M, kg.
    pub mass_kg: f64,
    /// I about the pole, kg·m².
    pub inertia_kg_m2: f64,
    /// h, m.
    pub above_m: f64,
    /// L, m.
    pub length_m: f64,
    /// τ, s.
    pub damping_s: f64,
    /// K, N/m.
    pub stiffness_n_per_m: f64,
    /// C, N·s/m.
    pub damping_n_s_per_m: f64,
    /// g, m/s².
    pub gravity_m_per_s2: f64,
}

/// Steps of a period: the fourth-order method's error is far below all that is read off (halving them moves multipliers by 1e-9).
const STEPS: u32 = 800;

/// Growth below this is rounding, 1/s.
const GROWS_PER_S: f64 = 1e-6;

impl Hanging {
    /// The linear model of a scene with slings and contact.
    ///
    /// # Errors
    /// When it has not both.
    pub fn of(scene: &Scene) -> Result<Self, String> {
        let (Some(sling), Some(contact)) = (&scene.effects.sling, &scene.effects.contact) else {
            return Err(format!(
                "the scene `{}` has no sling or no contact",
                scene.name
            ));
        };
        let n = scene.carriers.count();
        let sum = |of: &sim::scene::PerCarrier| (0..n).map(|i| of.get(i)).sum();
        Ok(Self {
            mass_kg: scene.body.mass_kg,
            inertia_kg_m2: scene.body.inertia_kg_m2.xx,
            above_m: scene.carriers.handles_m[0][2],
            length_m: sling.length_m,
            damping_s: sling.damping_s,
            stiffness_n_per_m: sum(&contact.stiffness_n_per_m),
            damping_n_s_per_m: sum(&contact.damping_n_s_per_m),
            gravity_m_per_s2: -scene.body.gravity_m_per_s2[2],
        })
    }

    /// H of the vertical motion.
    fn transfer(&self, hz: f64) -> Complex<f64> {
        let w = TAU * hz;
        let part = Complex::new(self.stiffness_n_per_m, self.damping_n_s_per_m * w);
        part / (part - Complex::new(self.mass_kg * w * w, 0.0))
    }

    /// A that gives the depth m at a drive frequency.
    pub fn amplitude_m(&self, hz: f64, depth: f64) -> f64 {
        depth * self.gravity_m_per_s2 / (self.transfer(hz).norm() * (TAU * hz).powi(2))
    }

    /// The depth that an amplitude gives.
    pub fn depth(&self, hz: f64, amplitude_m: f64) -> f64 {
        amplitude_m / self.amplitude_m(hz, 1.0)
    }

    /// The depth that a scene's gait gives in step, lifted as its music has it, and the beat (Hz) at which it does.
    pub fn depth_of(&self, scene: &Scene) -> (f64, f64) {
        let e = &scene.effects;
        let beat = e.music.as_ref().map_or(f64::NAN, |m| m.beat_hz);
        let lift = e.lift.as_ref().map_or(1.0, |l| l.gain);
        let gait = e.gait.as_ref().map_or(f64::NAN, |g| g.amplitude_m.get(0));
        (self.depth(beat, lift * gait), beat)
    }

    fn rate(&self, load_n: f64, x: &Vector4<f64>) -> Vector4<f64> {
        let (u, u_rate) = (x[0] - self.above_m * x[1], x[2] - self.above_m * x[3]);
        let side = -load_n.max(0.0) / self.length_m * (u + self.damping_s * u_rate);
        Vector4::new(
            x[2],
            x[3],
            side / self.mass_kg,
            -self.above_m * (load_n * x[1] + side) / self.inertia_kg_m2,
        )
    }

    /// The two natural frequencies under a steady load and without damping, Hz, the lower first: a sideways swing and the roll.
    pub fn natural_hz(&self) -> [f64; 2] {
        let (h, l) = (self.above_m, self.length_m);
        let load = self.mass_kg * self.gravity_m_per_s2;
        let (m, i) = (self.mass_kg, self.inertia_kg_m2);
        let (a, b) = (1.0 / (m * l), -h / (m * l));
        let (c, d) = (-h / (i * l), h / i + h * h / (i * l));
        let root = ((a - d).powi(2) + 4.0 * b * c).sqrt();
        [-1.0, 1.0].map(|sign| (load * 0.5 * (a + d + sign * root)).sqrt() / TAU)
    }

    /// Growth rate of the fastest motion, 1/s: the logarithm of the greatest multiplier over the period.
    pub fn growth_per_s(&self, hz: f64, depth: f64) -> f64 {
        let w = TAU * hz;
        let lift = self.transfer(hz) * self.amplitude_m(hz, depth);
        let load = |t: f64| {
            let z = (lift * Complex::new(0.0, w * t - FRAC_PI_2).exp()).re;
            self.mass_kg * (self.gravity_m_per_s2 - w * w * z)
        };
        let h = 1.0 / hz / f64::from(STEPS);
        let mut columns = Matrix4::identity();
        for mut column in columns.column_iter_mut() {
            let mut x: Vector4<f64> = column.clone_owned();
            for i in 0..STEPS {
                let t = f64::from(i) * h;
                let middle = load(t + 0.5 * h);
                let k1 = self.rate(load(t), &x);
                let k2 = self.rate(middle, &(x + 0.5 * h * k1));
                let k3 = self.rate(middle, &(x + 0.5 * h * k2));
                let k4 = self.rate(load(t + h), &(x + h * k3));
                x += h / 6.0 * (k1 + 2.0 * (k2 + k3) + k4);
            }
            column.copy_from(&x);
        }
        let greatest = columns
            .complex_eigenvalues()
            .iter()
            .map(|z| z.norm())
            .fold(0.0, f64::max);
        greatest.ln() * hz
    }

    /// The least depth up to `most` at which something grows; `None` where nothing does.
    pub fn threshold(&self, hz: f64, most: f64) -> Option<f64> {
        // Coarsely first: tongues are wider than this where they are met from below.
        let steps = 50;
        let at = |k: i32| most * f64::from(k) / f64::from(steps);
        let first = (1..=steps).find(|k| self.growth_per_s(hz, at(*k)) > GROWS_PER_S)?;
        let (mut low, mut high) = (at(first - 1), at(first));
        for _ in 0..30 {
            let middle = 0.5 * (low + high);
            if self.growth_per_s(hz, middle) > GROWS_PER_S {
                high = middle;
            } else {
                low = middle;
            }
        }
        Some(0.5 * (low + high))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn music() -> Hanging {
        Hanging::of(&sim::scene::load("music", &[]).unwrap()).unwrap()
    }

    /// In music the shoulders go up and down by 64.2 mm, lifted to 5/4, at 2.1507 Hz, under 60 kg on two handles of 3000 N/m and 400 N·s/m each: m = A|H|Ω²/g
    /// with |H|² = (K² + C²Ω²)/((K − MΩ²)² + C²Ω²), worked out by hand. Where Ω² = K/M, |H|² is 1 + K²/(CΩ)².
    #[test]
    fn the_depth_of_a_lift_is_that_of_a_spring_and_a_damper() {
        let model = music();
        let (depth, beat) = model.depth_of(&sim::scene::load("music", &[]).unwrap());
        let (k, c, m, g) = (6000.0_f64, 800.0, 60.0, 9.81);
        let w = TAU * 2.1507;
        let gain = (k * k + (c * w).powi(2)) / ((k - m * w * w).powi(2) + (c * w).powi(2));
        let expected = 0.0642 * 1.25 * gain.sqrt() * w * w / g;
        assert_eq!(beat, 2.1507);
        assert!((depth / expected - 1.0).abs() < 1e-12, "{depth} {expected}");
        let w = (k / m).sqrt();
        let gain = (1.0 + (k / (c * w)).powi(2)).sqrt();
        let found = model.amplitude_m(w / TAU, 0.5) * gain * w * w / g;
        assert!((found - 0.5).abs() < 1e-12, "{found}");
    }

    /// A sling that is long beside the handles' height leaves a pendulum under the pole, and a swing of the whole.
    #[test]
    fn natural_frequencies_are_those_of_two_pendulums() {
        let model = Hanging {
            length_m: 1e6,
            ..music()
        };
        let g = model.gravity_m_per_s2;
        let swing = (g / model.length_m).sqrt() / TAU;
        let roll = (model.mass_kg * g * model.above_m / model.inertia_kg_m2).sqrt() / TAU;
        for (found, known) in model.natural_hz().into_iter().zip([swing, roll]) {
            assert!((found / known - 1.0).abs() < 1e-5, "{found} {known}");
        }
        // Of two coupled ones the squares' product is det(M⁻¹K) = (g/L)(Mgh/I), and their sum its trace, g/L + (Mgh/I)(1 + h/L).
        let model = music();
        let [low, high] = model.natural_hz().map(|hz| (TAU * hz).powi(2));
        let (h, l) = (model.above_m, model.length_m);
        let (swing, roll) = (g / l, model.mass_kg * g * h / model.inertia_kg_m2);
        assert!((low * high / (swing * roll) - 1.0).abs() < 1e-12);
        assert!(((low + high) / (swing + roll * (1.0 + h / l)) - 1.0).abs() < 1e-12);
    }

    /// Without modulation the growth is that of the damped modes, whose characteristic polynomial is solved here.
    #[test]
    fn at_rest_it_decays_as_its_modes_do() {
        let model = music();
        let load = model.mass_kg * model.gravity_m_per_s2;
        let mut matrix = Matrix4::zeros();
        for k in 0..4 {
            let mut x = Vector4::zeros();
            x[k] = 1.0;
            matrix.set_column(k, &model.rate(load, &x));
        }
        let slowest = matrix
            .complex_eigenvalues()
            .iter()
            .map(|z| z.re)
            .fold(f64::NEG_INFINITY, f64::max);
        assert!(
            (model.growth_per_s(1.7, 0.0) - slowest).abs() < 1e-8,
            "{slowest}"
        );
        let [_, roll] = model.natural_hz();
        let seen = matrix
            .complex_eigenvalues()
            .iter()
            .map(|z| z.im / TAU)
            .fold(0.0, f64::max);
        assert!((seen / roll - 1.0).abs() < 0.02, "{seen} {roll}");
    }

    /// A long, stiff sling leaves a pendulum with I + Mh² and no damping: Mathieu's equation, whose first tongue begins at m = 2|1 − (f/2f₀)²|.
    #[test]
    fn val_mathieu_first_tongue() {
        // y̅ held: an enormous mass would fall with gravity, so h is made small against L instead and I carries all.
        let model = Hanging {
            length_m: 1e9,
            damping_s: 0.0,
            ..music()
        };
        let [_, roll] = model.natural_hz();
        for detune in [0.99, 1.01, 1.02] {
            let hz = 2.0 * roll * detune;
            let expected = 2.0 * (1.0 - detune * detune).abs();
            let found = model.threshold(hz, 0.2).unwrap();
            // The next order of the boundary is m²/32 of it.
            assert!(
                (found - expected).abs() < 0.04 * expected,
                "{detune}: {found}, expected {expected}"
            );
        }
    }
}
