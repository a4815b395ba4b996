//! The phase equations against what is known in closed form.

mod common;

use common::{samples, scene};
use sim::scene::PerCarrier;
use std::f64::consts::{FRAC_PI_2, PI, TAU};

/// One person, one drum, no load: only the phase is left to move.
fn one_carrier_on_a_beat(
    strength: f64,
    detuning_rad_per_s: f64,
    log_rate_hz: f64,
    duration_s: f64,
) -> Vec<f64> {
    let beat_hz = 2.0 + detuning_rad_per_s / TAU;
    let scene = scene(&format!(
        r#"
        name = "adler"
        duration_s = {duration_s:?}
        log_rate_hz = {log_rate_hz:?}
        [carriers]
        handles_m = [[0.0, 0.0, 0.0]]
        frequency_hz = 2.0
        initial_phase_rad = 0.4
        [solver]
        tolerance = 1e-10
        [effects.music]
        beat_hz = {beat_hz:?}
        strength_rad_per_s = {strength:?}
        onset_s = 0.0
        build_up_s = 0.0
        "#
    ));
    samples(&scene)
        .iter()
        .map(|s| s.beat_phase_rad.unwrap() - s.phase_rad[0])
        .collect()
}

/// sin Φ* = Δω/K with cos Φ* > 0: Adler (1946); paper, theorem 1.
#[test]
fn val_adler_lock() {
    for detuning in [-2.5, -0.7, 0.0, 1.3, 2.6] {
        let phi = *one_carrier_on_a_beat(2.7, detuning, 1.0, 60.0)
            .last()
            .unwrap();
        assert!(
            (phi.sin() - detuning / 2.7).abs() < 1e-9,
            "{detuning}: {}",
            phi.sin() - detuning / 2.7
        );
        assert!(phi.cos() > 0.0);
    }
}

/// Outside the range Φ turns once in 2π/√(Δω² − K²), exactly.
#[test]
fn val_adler_drift_frequency() {
    for (strength, detuning) in [(1.0, 1.05_f64), (1.0, PI), (2.7, -4.0)] {
        let rate = (detuning * detuning - strength * strength).sqrt();
        let phi = one_carrier_on_a_beat(strength, detuning, rate / TAU, 20.0 * TAU / rate);
        assert_eq!(phi.len(), 21);
        for (turns, p) in phi.iter().enumerate() {
            let expected = phi[0] + detuning.signum() * TAU * turns as f64;
            assert!(
                (p - expected).abs() < 1e-7,
                "K {strength}, detuning {detuning}, turn {turns}: {:.2e}",
                p - expected
            );
        }
    }
}

/// Two coupled carriers lock at sin δ* = Δω/K_c and keep the mean of their frequencies.
#[test]
fn val_two_kuramoto_oscillators_lock() {
    let (coupling, difference) = (0.8, 0.5);
    let scene = scene(&format!(
        r#"
        name = "pair"
        log_rate_hz = 1.0
        [carriers]
        frequency_hz = [2.0, {:?}]
        initial_phase_rad = [0.0, 2.0]
        [solver]
        tolerance = 1e-10
        [effects.coupling]
        strength_rad_per_s = {coupling:?}
        "#,
        2.0 + difference / TAU
    ));
    let all = samples(&scene);
    let apart = all[0].order_parameter().unwrap();
    assert!((apart - 1f64.cos()).abs() < 1e-15, "|1 + e^2i|/2: {apart}");
    let last = all.last().unwrap();
    let lag = last.phase_rad[1] - last.phase_rad[0];
    assert!(
        (lag.sin() - difference / coupling).abs() < 1e-9,
        "{}",
        lag.sin() - difference / coupling
    );
    let turned = last.phase_rad.iter().sum::<f64>() - 2.0;
    assert!((turned - (2.0 * TAU * 2.0 + difference) * last.t_s).abs() < 1e-7);
}

/// The inverse of the standard normal distribution, by bisection on the error function's series: slow and plain.
fn normal_quantile(p: f64) -> f64 {
    let below = |x: f64| {
        // Φ(x) = ½ + φ(x) Σ x^(2k+1)/(1·3·…·(2k+1)), Marsaglia (2004).
        let (mut term, mut sum, mut k) = (x, x, 1.0);
        while term.abs() > 1e-17 * sum.abs() {
            term *= x * x / (2.0 * k + 1.0);
            sum += term;
            k += 1.0;
        }
        0.5 + sum * (-0.5 * x * x).exp() / TAU.sqrt()
    };
    let (mut low, mut high) = (-6.0, 6.0);
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if below(middle) < p {
            low = middle
        } else {
            high = middle
        }
    }
    0.5 * (low + high)
}

/// r of the infinite population: 1 = K ∫ cos²θ g(K r sin θ) dθ over ±π/2, zero below K_c = 2/(π g(0)). Kuramoto (1975).
fn order_of_many(coupling: f64) -> f64 {
    let g = |w: f64| (-0.5 * w * w).exp() / TAU.sqrt();
    let held = |r: f64| {
        let n = 2000;
        let h = PI / f64::from(n);
        (0..n)
            .map(|i| -FRAC_PI_2 + (f64::from(i) + 0.5) * h)
            .map(|a| h * coupling * a.cos().powi(2) * g(coupling * r * a.sin()))
            .sum::<f64>()
    };
    if held(0.0) < 1.0 {
        return 0.0;
    }
    let (mut low, mut high) = (0.0, 1.0);
    for _ in 0..50 {
        let middle = 0.5 * (low + high);
        if held(middle) > 1.0 {
            low = middle
        } else {
            high = middle
        }
    }
    0.5 * (low + high)
}

/// Long-time mean of r for 1000 oscillators whose frequencies are the quantiles of the normal distribution (s = 1 rad/s).
fn order_of_a_thousand(coupling: f64) -> f64 {
    let n = 1000;
    let mut scene = scene(&format!(
        r#"
        name = "population"
        duration_s = 120.0
        log_rate_hz = 10.0
        [solver]
        tolerance = 1e-6
        [effects.coupling]
        strength_rad_per_s = {coupling:?}
        "#
    ));
    scene.carriers.handles_m = vec![[0.0; 3]; n];
    scene.carriers.frequency_hz = PerCarrier::Each(
        (0..n)
            .map(|i| normal_quantile((i as f64 + 0.5) / n as f64) / TAU)
            .collect(),
    );
    // Phases that have nothing to do with the frequencies: multiples of the golden angle.
    scene.carriers.initial_phase_rad = PerCarrier::Each(
        (0..n)
            .map(|i| (i as f64 * 2.399_963_229_728_653) % TAU)
            .collect(),
    );
    let late: Vec<f64> = samples(&scene)
        .iter()
        .filter(|s| s.t_s > 60.0)
        .map(|s| s.order_parameter().unwrap())
        .collect();
    late.iter().sum::<f64>() / late.len() as f64
}

/// The onset of synchrony is at K_c = 2/(π g(0)) = 2√(2/π) s, and r grows from there as the self-consistency equation says.
#[test]
fn val_kuramoto_onset_of_a_large_population() {
    let critical = 2.0 / (PI / TAU.sqrt());
    assert!(order_of_many(0.999 * critical) == 0.0 && order_of_many(1.001 * critical) > 0.0);
    for part in [0.5, 0.8] {
        let r = order_of_a_thousand(part * critical);
        // Incoherence of 1000: r of the order of 1/√1000 = 0.03, swollen near the onset by 1/√(1 − K/K_c).
        assert!(r < 3.0 * 0.0316 / (1.0_f64 - part).sqrt(), "{part}: {r}");
    }
    // r² is straight in K just above the onset: two points give back K_c.
    let (a, b) = (1.15, 1.3);
    let (ra, rb) = (
        order_of_a_thousand(a * critical),
        order_of_a_thousand(b * critical),
    );
    for (part, r) in [(a, ra), (b, rb), (2.0, order_of_a_thousand(2.0 * critical))] {
        let expected = order_of_many(part * critical);
        assert!(
            (r - expected).abs() < 0.03,
            "K = {part} K_c: r {r}, expected {expected}"
        );
    }
    let (ea, eb) = (order_of_many(a * critical), order_of_many(b * critical));
    let crossing = |ra: f64, rb: f64| a - ra * ra * (b - a) / (rb * rb - ra * ra);
    // The same chord of the infinite population bends a little: it is what the thousand are held against.
    let off = crossing(ra, rb) - crossing(ea, eb);
    assert!(
        off.abs() < 0.05,
        "onset at {:.3} K_c, infinite population's chord {:.3}",
        crossing(ra, rb),
        crossing(ea, eb)
    );
}

/// Phase noise alone is a Brownian path: variance σ² t, whatever the grid.
#[test]
fn phase_noise_spreads_like_a_brownian_path() {
    let mut scene = scene(
        r#"
        name = "wander"
        duration_s = 4.0
        log_rate_hz = 1.0
        [effects.noise]
        phase_rad_per_sqrt_s = 0.01
        grid_hz = 7.0
        "#,
    );
    scene.carriers.handles_m = vec![[0.0; 3]; 4000];
    let all = samples(&scene);
    let (first, last) = (&all[0], all.last().unwrap());
    let off: Vec<f64> = first
        .phase_rad
        .iter()
        .zip(&last.phase_rad)
        .map(|(a, b)| b - a - TAU * 2.0 * last.t_s)
        .collect();
    let variance = off.iter().map(|x| x * x).sum::<f64>() / off.len() as f64;
    let expected = 0.01_f64.powi(2) * last.t_s;
    // Four standard errors of a variance from 4000 draws.
    assert!(
        (variance / expected - 1.0).abs() < 4.0 * (2.0_f64 / 4000.0).sqrt(),
        "{}",
        variance / expected
    );
}
