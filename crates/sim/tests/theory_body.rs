//! The carried body against closed forms, conservation laws, and Floquet theory computed here from scratch.

mod common;

use common::{samples, scene};
use nalgebra::{Complex, Matrix3, Matrix4, Quaternion, UnitQuaternion, Vector3, Vector4};
use std::f64::consts::{PI, TAU};

/// Free tumbling, any axis: kinetic energy and the angular momentum in the world stay, to 1e-9 over 60 s.
#[test]
fn free_tumbling_keeps_energy_and_momentum() {
    let scene = scene(
        r#"
        name = "tumble"
        [body]
        mass_kg = 60.0
        inertia_kg_m2 = { xx = 1.6, yy = 11.0, zz = 12.0, xz = 0.3 }
        [start]
        height_m = 1000.0
        velocity_m_per_s = [1.0, 0.0, 300.0]
        angular_velocity_rad_per_s = [0.3, 4.0, -0.5]
        [solver]
        tolerance = 1e-12
        "#,
    );
    let inertia = Matrix3::new(1.6, 0.0, 0.3, 0.0, 11.0, 0.0, 0.3, 0.0, 12.0);
    let all = samples(&scene);
    let of = |s: &sim::run::Sample| {
        let [x, y, z, w] = s.pose.orientation;
        let turn = UnitQuaternion::new_unchecked(Quaternion::new(w, x, y, z));
        let spin = Vector3::from(s.pose.spin_rad_per_s);
        let v = Vector3::from(s.pose.velocity_m_per_s);
        let fall = 60.0 * (0.5 * v.norm_squared() + 9.81 * s.pose.position_m[2]);
        (
            turn * (inertia * spin),
            0.5 * spin.dot(&(inertia * spin)),
            fall,
        )
    };
    let (momentum, energy, fall) = of(&all[0]);
    for s in &all {
        let (m, e, f) = of(s);
        let off = (m - momentum).norm() / momentum.norm();
        assert!(off < 1e-9, "t = {}: momentum off by {off:.1e}", s.t_s);
        assert!(
            (e / energy - 1.0).abs() < 1e-9,
            "t = {}: energy off by {:.1e}",
            s.t_s,
            e / energy - 1.0
        );
        assert!(
            (f / fall - 1.0).abs() < 1e-9,
            "t = {}: {:.1e}",
            s.t_s,
            f / fall - 1.0
        );
        let q = s.pose.orientation.iter().map(|x| x * x).sum::<f64>().sqrt();
        assert!((q - 1.0).abs() < 1e-12);
        assert!(s.energy.unwrap().unexplained_j.abs() < 1e-9 * (energy + fall));
    }
}

/// A contact that is slack half of the time gives the half-wave series of the paper's appendix: 1/π, ½, −2/(3π), −2/(15π) …
///
/// The body is far too heavy to move; the shoulder alone goes up and down about the handle: N = kA max(0, sin Ωt).
#[test]
fn val_half_wave_series_of_a_slack_contact() {
    let scene = scene(
        r#"
        name = "half wave"
        duration_s = 2.0
        log_rate_hz = 4000.0
        [body]
        mass_kg = 1e12
        gravity_m_per_s2 = [0.0, 0.0, 0.0]
        inertia_kg_m2 = { xx = 1e12, yy = 1e12, zz = 1e12 }
        [start]
        height_m = 0.9
        [effects.gait]
        amplitude_m = 0.05
        [effects.contact]
        damping_n_s_per_m = 0.0
        "#,
    );
    let all = samples(&scene);
    let period = 2000.0; // samples
    let whole = &all[..8000];
    let part = |n: f64, f: fn(f64) -> f64| {
        let sum: f64 = whole
            .iter()
            .enumerate()
            .map(|(i, s)| s.normal_n[0] * f(TAU * n * i as f64 / period))
            .sum();
        2.0 * sum / (whole.len() as f64 * 3000.0 * 0.05)
    };
    // Samples see the kink within one part in 2000 of a turn: the sums miss the integrals by (π/2000)²/6 of the kink.
    let close = |found: f64, expected: f64| {
        assert!((found - expected).abs() < 1e-6, "{found} for {expected}")
    };
    close(part(0.0, f64::cos) / 2.0, 1.0 / PI);
    close(part(1.0, f64::sin), 0.5);
    close(part(1.0, f64::cos), 0.0);
    for n in 2..9 {
        let n = f64::from(n);
        let expected = if n % 2.0 == 0.0 {
            -2.0 / (PI * (n * n - 1.0))
        } else {
            0.0
        };
        close(part(n, f64::cos), expected);
        close(part(n, f64::sin), 0.0);
    }
}

/// |Θ(Ω)| = τ₀/√((K − IΩ²)² + (CΩ)²) for small motion in bilateral contact; paper, eq. (theta_lin).
///
/// Handles abreast (±½ m) in antiphase: a true roll. K = 2kl², C = 2cl², τ₀ = 2l A √(k² + c²Ω²).
#[test]
fn val_forced_roll_amplitude() {
    let (k, c, l, inertia, amplitude) = (3000.0, 40.0, 0.5, 6.0, 1e-5);
    let (stiffness, damping): (f64, f64) = (2.0 * k * l * l, 2.0 * c * l * l);
    for hz in [0.5_f64, 1.5, 2.4, 2.5, 2.6, 4.0] {
        let scene = scene(&format!(
            r#"
            name = "forced"
            duration_s = 20.0
            log_rate_hz = {:?}
            [body]
            inertia_kg_m2 = {{ xx = {inertia:?}, yy = 11.0, zz = 11.0 }}
            [carriers]
            handles_m = [[0.0, {l:?}, 0.0], [0.0, -{l:?}, 0.0]]
            frequency_hz = {hz:?}
            initial_phase_rad = [0.0, 3.141592653589793]
            [solver]
            tolerance = 1e-13
            [effects.contact]
            stiffness_n_per_m = {k:?}
            damping_n_s_per_m = {c:?}
            bilateral = true
            [effects.gait]
            amplitude_m = {amplitude:?}
            "#,
            hz * 32.0
        ));
        let all = samples(&scene);
        // The last two turns; the free swing has died by e^{-C t/2I} = e^{-33}.
        let late = &all[all.len() - 65..all.len() - 1];
        let (mut s, mut co) = (0.0, 0.0);
        for x in late {
            let a = TAU * hz * x.t_s;
            s += x.pose.roll_pitch_yaw_rad()[0] * a.sin() / 32.0;
            co += x.pose.roll_pitch_yaw_rad()[0] * a.cos() / 32.0;
        }
        let w = TAU * hz;
        let drive = 2.0 * l * amplitude * f64::hypot(k, c * w);
        let expected = drive / f64::hypot(stiffness - inertia * w * w, damping * w);
        let found = f64::hypot(s, co);
        assert!(
            (found / expected - 1.0).abs() < 1e-6,
            "{hz} Hz: {found:.6e}, expected {expected:.6e}"
        );
    }
}

/// The rath of the Mathieu tests: handles above the centre of mass, both carriers in step, bilateral contact.
struct Hanging {
    base_m: f64,
}

const HZ: f64 = 1.75;
const MASS: f64 = 60.0;
const ABOVE: f64 = 0.1;
const INERTIA: f64 = 1.4855;
const K: f64 = 3000.0;
const C: f64 = 400.0;
const HOLD: (f64, f64) = (6000.0, 120.0);
const RUB: (f64, f64) = (0.002, 0.6);

impl Hanging {
    /// Roll at every second period of the base, from the simulator.
    fn simulated(&self) -> Vec<f64> {
        let scene = scene(&format!(
            r#"
            name = "mathieu"
            duration_s = {:?}
            log_rate_hz = {:?}
            [body]
            mass_kg = {MASS:?}
            inertia_kg_m2 = {{ xx = {INERTIA:?}, yy = 11.0, zz = 11.0 }}
            [carriers]
            handles_m = [[2.45, 0.0, {ABOVE:?}], [-2.45, 0.0, {ABOVE:?}]]
            frequency_hz = {HZ:?}
            [start]
            roll_pitch_yaw_deg = [0.002, 0.0, 0.0]
            [solver]
            tolerance = 1e-13
            [effects.contact]
            stiffness_n_per_m = {K:?}
            damping_n_s_per_m = {C:?}
            bilateral = true
            [effects.hold]
            stiffness_n_per_m = {:?}
            damping_n_s_per_m = {:?}
            [effects.pole_friction]
            arm_m = {:?}
            regularising_rate_rad_per_s = {:?}
            [effects.gait]
            amplitude_m = {:?}
            "#,
            80.0 / HZ,
            HZ / 2.0,
            HOLD.0,
            HOLD.1,
            RUB.0,
            RUB.1,
            self.base_m
        ));
        samples(&scene)
            .iter()
            .map(|s| s.pose.roll_pitch_yaw_rad()[0])
            .collect()
    }

    /// Growth of roll over two periods once the strongest mode is alone.
    fn simulated_growth(&self) -> f64 {
        let roll = self.simulated();
        let n = roll.len();
        roll[n - 1] / roll[n - 2]
    }

    /// The greatest Floquet multiplier of two periods, by magnitude.
    ///
    /// Linear in (y, θ): M ÿ = T, I θ̈ = −h N θ − h T − ρ N θ̇/ω_s, T = −2k_t(y − hθ) − 2c_t(ẏ − hθ̇), where
    /// N(t) = M(g + z̈), z = A Re[H e^{i(Ωt − π/2)}], H = (2k + 2icΩ)/(2k − MΩ² + 2icΩ).
    fn floquet(&self) -> f64 {
        let w = TAU * HZ;
        let part = Complex::new(2.0 * K, 2.0 * C * w);
        let lift = part / (part - Complex::new(MASS * w * w, 0.0)) * self.base_m;
        let load =
            |t: f64| MASS * (9.81 - w * w * (lift * Complex::new(0.0, w * t - 0.5 * PI).exp()).re);
        let rate = |t: f64, x: Vector4<f64>| {
            let n = load(t);
            let side = -2.0 * (HOLD.0 * (x[0] - ABOVE * x[1]) + HOLD.1 * (x[2] - ABOVE * x[3]));
            let roll = (-ABOVE * n * x[1] - ABOVE * side - RUB.0 * n * x[3] / RUB.1) / INERTIA;
            Vector4::new(x[2], x[3], side / MASS, roll)
        };
        // RK4 with 4000 steps a period: its error is near 1e-11.
        let (steps, h) = (8000, 2.0 / HZ / 8000.0);
        let mut columns = Matrix4::identity();
        for mut column in columns.column_iter_mut() {
            let mut x: Vector4<f64> = column.clone_owned();
            for i in 0..steps {
                let t = f64::from(i) * h;
                let k1 = rate(t, x);
                let k2 = rate(t + 0.5 * h, x + 0.5 * h * k1);
                let k3 = rate(t + 0.5 * h, x + 0.5 * h * k2);
                let k4 = rate(t + h, x + h * k3);
                x += h / 6.0 * (k1 + 2.0 * (k2 + k3) + k4);
            }
            column.copy_from(&x);
        }
        columns
            .complex_eigenvalues()
            .iter()
            .map(|z| z.norm())
            .fold(0.0, f64::max)
    }
}

/// The smallest base amplitude at which roll grows is where the greatest Floquet multiplier is one.
#[test]
fn val_mathieu_threshold_is_that_of_floquet() {
    let (mut low, mut high) = (0.001, 0.05);
    assert!(Hanging { base_m: low }.floquet() < 1.0 && Hanging { base_m: high }.floquet() > 1.0);
    for _ in 0..40 {
        let middle = 0.5 * (low + high);
        if (Hanging { base_m: middle }).floquet() < 1.0 {
            low = middle
        } else {
            high = middle
        }
    }
    let threshold = 0.5 * (low + high);
    let (below, above) = (
        Hanging {
            base_m: 0.98 * threshold,
        },
        Hanging {
            base_m: 1.02 * threshold,
        },
    );
    let (down, up) = (below.simulated_growth(), above.simulated_growth());
    assert!(
        down < 1.0 && up > 1.0,
        "threshold {threshold:.5} m: {down} below, {up} above"
    );
    for (found, expected) in [(down, below.floquet()), (up, above.floquet())] {
        assert!(
            (found / expected - 1.0).abs() < 1e-5,
            "growth over two periods {found:.8}, Floquet {expected:.8}"
        );
    }
    let crossing = 0.98 + 0.04 * (1.0 - down) / (up - down);
    assert!(
        (crossing - 1.0).abs() < 1e-3,
        "simulated threshold at {crossing:.5} of Floquet's {threshold:.5} m"
    );
}
