//! The table of hard cases.

use super::check::{Checks, attitude, body_j};
use super::closed_forms::{
    Carried, G, Tumbling, adler, follows, grazing_amplitude_m, sinking, turned,
};
use super::{Case, Run};
use crate::random::{Stream, normal};
use crate::run::Sample;
use crate::solve::Method;
use nalgebra::{Complex, UnitQuaternion, Vector3};
use std::f64::consts::{PI, TAU};

// Who claims a case.
fn every(_: &Method) -> bool {
    true
}
fn adaptive(m: &Method) -> bool {
    m.adaptive
}
/// Beside the adaptive ones the fixed steps that are small and of high order.
pub(super) fn precise(m: &Method) -> bool {
    m.order > 3
}
/// Those that locate contact events: only they keep the books of a contact that opens and closes to 1e-8. Their blind twins are
/// there to show what that buys.
fn located(m: &Method) -> bool {
    m.locates
}
/// Dense Jacobians of a thousand states are no use to anybody.
fn explicit(m: &Method) -> bool {
    located(m) && !m.name.starts_with("radau")
}
fn fixed(m: &Method) -> bool {
    !m.adaptive
}

/// The samples behind the first few; none of a run that stopped before.
fn behind(run: &Run, first: usize) -> &[Sample] {
    run.samples.get(first..).unwrap_or_default()
}

// Pieces of scenes. The default body weighs 60 kg and hangs 0.1 m below two handles on shoulders at 1 m.
const FLOATING: &str = "[body]\ngravity_m_per_s2 = [0.0, 0.0, 0.0]\n";
const FREE: &str = "[body]\ngravity_m_per_s2 = [0.0, 0.0, 0.0]\ninertia_kg_m2 = { xx = 1.0, yy = 2.0, zz = 3.0 }\n[start]\nheight_m = 0.0\n";
const CARRIED: &str = "[effects.contact]\ndamping_n_s_per_m = 400.0\n[effects.hold]\n[effects.gait]\namplitude_m = 0.075\n";
/// Where the handles of the default body touch the shoulders, m.
const TOUCH_M: f64 = 0.9;
const MASS_KG: f64 = 60.0;
/// Of both default handles together, N/m and N·s/m.
const SPRING: f64 = 6000.0;
const DAMPER: f64 = 900.0;
/// Of the default gait, rad/s.
const GAIT: f64 = 2.0 * TAU;

fn height(s: &Sample) -> f64 {
    s.pose.position_m[2]
}

/// Kinetic energy and the angular momentum of a free body stay to `part`.
fn conserved(run: &Run, c: &mut Checks, part: f64) {
    c.ended(run);
    let i = run.scene.body.inertia_kg_m2;
    let spin = |s: &Sample| {
        let w = s.pose.spin_rad_per_s;
        [i.xx * w[0], i.yy * w[1], i.zz * w[2]]
    };
    let momentum = |s: &Sample| spin(s).iter().map(|x| x * x).sum::<f64>().sqrt();
    let kinetic = |s: &Sample| body_j(run, s)[0];
    let (e0, l0) = (kinetic(&run.samples[0]), momentum(&run.samples[0]));
    c.every("kinetic energy", &run.samples, part, |s| {
        (kinetic(s) / e0, 1.0)
    });
    c.every("angular momentum", &run.samples, part, |s| {
        (momentum(s) / l0, 1.0)
    });
    // Its direction in the world stays too: R·L of the body.
    let world = |s: &Sample| attitude(s) * Vector3::from(spin(s));
    let start = world(&run.samples[0]);
    for a in 0..3 {
        c.every("angular momentum in the world", &run.samples, part, |s| {
            (world(s)[a] / l0, start[a] / l0)
        });
    }
}

/// Stands where it stood, to a nanometre, its weight on both handles.
fn rests(run: &Run, c: &mut Checks) {
    for (a, stood_m) in [0.0, 0.0, TOUCH_M - MASS_KG * G / SPRING]
        .into_iter()
        .enumerate()
    {
        c.every("position, m", &run.samples, 1e-9, |s| {
            (s.pose.position_m[a], stood_m)
        });
    }
    for handle in 0..2 {
        c.every("force, N", &run.samples, SPRING * 1e-9, |s| {
            (s.normal_n[handle], 0.5 * MASS_KG * G)
        });
    }
}

/// By what angle a sample's orientation is off, rad.
fn turned_off(s: &Sample, truth: UnitQuaternion<f64>) -> f64 {
    // Twice the vector part, since the scalar part hides an angle in its square.
    2.0 * (truth.inverse() * attitude(s)).imag().norm()
}

/// A pair of phases obeys Adler's equation: every sample's `of` against d(t) from d₀ = 0.
fn locks(run: &Run, c: &mut Checks, within: f64, law: impl Fn(f64) -> f64, of: fn(&Sample) -> f64) {
    c.ended(run);
    c.every("phase difference, rad", &run.samples, within, |s| {
        (turned(of(s), law(s.t_s)), 0.0)
    });
}

/// ψ − φ of the first carrier under a steady beat of 2.5 Hz.
fn lag(s: &Sample) -> f64 {
    5.0 * PI * s.t_s - s.phase_rad[0]
}
fn between(s: &Sample) -> f64 {
    s.phase_rad[1] - s.phase_rad[0]
}

/// What two of 2.0 and 2.1 Hz do to each other leaves their mean alone. Ten tolerances.
fn keeps_the_mean(run: &Run, c: &mut Checks) {
    c.every("mean phase, rad", &run.samples, 1e-7, |s| {
        (0.5 * (s.phase_rad[0] + s.phase_rad[1]), 2.05 * TAU * s.t_s)
    });
}

/// A method that cannot do it must say when and why it gave up.
fn stops(run: &Run, c: &mut Checks) {
    match &run.stopped {
        Some(cause) if cause.contains("gave up at t = ") => {}
        found => c.fail(format!(
            "expected to be told when and why it gave up, found {found:?}"
        )),
    }
}

/// A gait of 2 Hz under a beat of 2.5 Hz: Δ = π.
fn edge(strength: f64) -> String {
    format!(
        "duration_s = 200.0\nlog_rate_hz = 1.0\n{FLOATING}[effects.gait]\n[effects.music]\nbeat_hz = 2.5\nstrength_rad_per_s = {strength:?}\nonset_s = 0.0\nbuild_up_s = 0.0\n"
    )
}

// By the end these are 2e-7 rad from the edge, 1e-9·K·t/3: told apart within ten tolerances.
const JUST_INSIDE: f64 = PI * (1.0 + 1e-9);
const JUST_OUTSIDE: f64 = PI * (1.0 - 1e-9);

/// Two carriers whom a beat draws into step, so that the load lifts off and rolls: all of it `slow` times as slow. What has seconds in its
/// unit is scaled, lengths, masses and angles are not, so the motion is the same.
fn slowed(slow: f64) -> String {
    format!(
        "duration_s = {duration:?}\nlog_rate_hz = {log:?}\n\
         [body]\ngravity_m_per_s2 = [0.0, 0.0, {gravity:?}]\n\
         [carriers]\nfrequency_hz = {gait:?}\ninitial_phase_rad = [0.0, 2.0]\n\
         [start]\nroll_pitch_yaw_deg = [2.0, 0.0, 0.0]\n\
         [effects.contact]\nstiffness_n_per_m = {spring:?}\ndamping_n_s_per_m = {damper:?}\n\
         [effects.hold]\nstiffness_n_per_m = {spring:?}\ndamping_n_s_per_m = {damper:?}\n\
         [effects.gait]\namplitude_m = 0.08\nsway_m = 0.02\n\
         [effects.noise]\nphase_rad_per_sqrt_s = {noise:?}\ngrid_hz = {grid:?}\n\
         [effects.music]\nbeat_hz = {beat:?}\nstrength_rad_per_s = {pull:?}\nonset_s = {onset:?}\nbuild_up_s = {onset:?}\n\
         [solver]\nstep_s = {step:?}\ntolerance = 1e-9\n",
        duration = 12.0 * slow,
        log = 30.0 / slow,
        gravity = -9.81 / (slow * slow),
        gait = 2.0 / slow,
        spring = 3000.0 / (slow * slow),
        damper = 400.0 / slow,
        noise = 0.125 / slow.sqrt(),
        grid = 25.0 / slow,
        beat = 2.125 / slow,
        pull = 2.5 / slow,
        onset = 2.0 * slow,
        step = slow / 1024.0,
    )
}

/// Gravity leans by 30° along the poles.
const SLOPE: &str = "[body]\ngravity_m_per_s2 = [4.905, 0.0, -8.495709211125343]\n";

fn thousand() -> String {
    let at = |i: usize| format!("[{:?}, 0.0, 0.1]", (i as f64 - 499.5) * 0.005);
    let handles: Vec<String> = (0..1000).map(at).collect();
    format!(
        "duration_s = 2.0\n[carriers]\nhandles_m = [{}]\n[effects.contact]\nstiffness_n_per_m = 6.0\ndamping_n_s_per_m = 0.9\n[effects.gait]\n[solver]\ntolerance = 1e-6\n",
        handles.join(",")
    )
}

/// The default body on default shoulders that go up and down in step by `amplitude_m`, with `damping` at each handle.
fn load(damping: f64, amplitude_m: f64) -> Carried {
    Carried {
        mass_kg: MASS_KG,
        k: SPRING,
        c: 2.0 * damping,
        touch_m: TOUCH_M,
        amplitude_m,
        omega: GAIT,
    }
}

macro_rules! case {
    ($name:literal, $claim:ident, $about:literal, $holds:literal, $toml:expr, $check:expr) => {
        Case {
            name: $name,
            about: $about,
            holds: $holds,
            claim: $claim,
            toml: || $toml.into(),
            check: $check,
        }
    };
}

/// Every hard case.
#[rustfmt::skip]
pub const CASES: &[Case] = &[
    case!("stiff", adaptive, "contact of 1e9 N/m, dropped on from 0.1 m",
        "falls and swings piece by piece in closed form; comes to rest M g/(2k) deep",
        "duration_s = 2.0\nlog_rate_hz = 1000.0\n[start]\nheight_m = 1.0\n[effects.contact]\nstiffness_n_per_m = 1e9\ndamping_n_s_per_m = 1e5\n",
        |r, c| {
            c.ended(r);
            c.near("depth at the end, m", TOUCH_M - height(r.last()), MASS_KG * G / 2e9, 1e-9);
            c.carried(r, &Carried { k: 2e9, ..load(1e5, 0.0) }, [1.0, 0.0]);
        }),
    case!("undamped", located, "no damping: bounces for ever",
        "kinetic, potential and elastic energy together stay; both handles feel the same; the closed form, bounce by bounce",
        "duration_s = 20.0\n[start]\nheight_m = 1.0\n[effects.contact]\ndamping_n_s_per_m = 0.0\n",
        |r, c| {
            c.ledger(r, 1e-8);
            let held = |s: &Sample| s.energy.map_or(0.0, |e| e.kinetic_j + e.potential_j + e.elastic_j);
            let at_start = held(&r.samples[0]);
            c.every("energy held, J", &r.samples, 1e-6 * MASS_KG * G * 0.1, |s| (held(s), at_start));
            c.every("force on the handles, N", &r.samples, 1e-9, |s| (s.normal_n[0], s.normal_n[1]));
            c.carried(r, &load(0.0, 0.0), [1.0, 0.0]);
        }),
    case!("damper-only", every, "damping without a spring",
        "sinks at M g/(2c), as 1 − e^(−2ct/M)",
        "duration_s = 5.0\n[start]\nheight_m = 0.9\n[effects.contact]\nstiffness_n_per_m = 0.0\ndamping_n_s_per_m = 400.0\n",
        |r, c| {
            c.ended(r);
            let within = r.bound(1e-7, 1e-2);
            c.every("velocity, m/s", &r.samples, within, |s| {
                (s.pose.velocity_m_per_s[2], -MASS_KG * G / 800.0 * (1.0 - (-800.0 * s.t_s / MASS_KG).exp()))
            });
        }),
    case!("gram", adaptive, "a body of 1 g on springs for 60 kg: decays in a microsecond",
        "rides on the shoulders: N = m (g + a)/2 on each, millinewtons",
        "duration_s = 0.5\nlog_rate_hz = 100.0\n[body]\nmass_kg = 0.001\ninertia_kg_m2 = { xx = 1e-6, yy = 2e-3, zz = 2e-3 }\n[effects.contact]\n[effects.gait]\namplitude_m = 0.05\n",
        |r, c| {
            c.ended(r);
            // The spring's slow relaxation, k/c = 6.7 1/s, adds 1e-5 of a to it.
            c.every("N, N", behind(r, 10), 1e-6, |s| {
                let a = -0.05 * GAIT * GAIT * s.phase_rad[0].sin();
                (s.normal_n[0], 0.5e-3 * (G + a))
            });
        }),
    case!("megaton", every, "a body of 1e6 kg that crushes its carriers",
        "the damped oscillator's closed form",
        "duration_s = 5.0\n[body]\nmass_kg = 1e6\ninertia_kg_m2 = { xx = 1e5, yy = 1e6, zz = 1e6 }\n[start]\nheight_m = 0.9\n[effects.contact]\n",
        |r, c| {
            c.ended(r);
            c.every("height, m", &r.samples, r.bound(1e-6, 0.1), |s| (height(s), sinking(1e6, SPRING, DAMPER, TOUCH_M, s.t_s)));
        }),
    case!("needle", precise, "inertias 1 : 1e6",
        "the free symmetric top's closed form, attitude included; energy and momentum stay",
        "duration_s = 20.0\n[body]\ngravity_m_per_s2 = [0.0, 0.0, 0.0]\ninertia_kg_m2 = { xx = 1e-6, yy = 1.0, zz = 1.0 }\n[start]\nheight_m = 0.0\nangular_velocity_rad_per_s = [5.0, 1.0, 0.0]\n",
        |r, c| {
            conserved(r, c, 1e-7);
            c.every("ω_y, rad/s", &r.samples, 1e-6, |s| (s.pose.spin_rad_per_s[1], (5.0 * (1.0 - 1e-6) * s.t_s).cos()));
            // It turns about its axis, and with its axis about the angular momentum.
            c.every("attitude, rad", &r.samples, 1e-6, |s| {
                let precession = UnitQuaternion::from_scaled_axis(Vector3::new(5e-6, 1.0, 0.0) * s.t_s);
                let spin = UnitQuaternion::from_scaled_axis(Vector3::x() * (5.0 * (1.0 - 1e-6) * s.t_s));
                (turned_off(s, precession * spin), 0.0)
            });
        }),
    case!("tumbling", precise, "three different inertias, turning about all three axes",
        "Poinsot's motion: the spin in elliptic functions, the attitude with the turn about the angular momentum by the integral of the third kind",
        format!("duration_s = 60.0\n{FREE}roll_pitch_yaw_deg = [20.0, -35.0, 70.0]\nangular_velocity_rad_per_s = [1.0, 2.0, 2.0]\n"),
        |r, c| {
            c.ended(r);
            let body = Tumbling::new([1.0, 2.0, 3.0], [1.0, 2.0, 2.0]);
            let [roll, pitch, yaw] = [20.0f64, -35.0, 70.0].map(f64::to_radians);
            let start = UnitQuaternion::from_euler_angles(roll, pitch, yaw);
            // Ten tolerances.
            c.every("attitude, rad", &r.samples, 1e-7, |s| (turned_off(s, start * body.at(s.t_s).1), 0.0));
            for a in 0..3 {
                c.every("spin, rad/s", &r.samples, 1e-7, |s| (s.pose.spin_rad_per_s[a], body.at(s.t_s).0[a]));
            }
        }),
    case!("hour-of-tumbling", precise, "about the middle axis for an hour: hundreds of flips",
        "energy and angular momentum, its direction in the world included, stay to 1e-6",
        format!("duration_s = 3600.0\nlog_rate_hz = 1.0\n{FREE}angular_velocity_rad_per_s = [1e-3, 5.0, 1e-3]\n"),
        |r, c| conserved(r, c, 1e-6)),
    case!("rolling-over", every, "roll through 90° and 180°, turn after turn",
        "the angle is ω t",
        format!("duration_s = 10.0\n{FREE}angular_velocity_rad_per_s = [3.0, 0.0, 0.0]\n"),
        |r, c| {
            c.ended(r);
            c.every("roll, rad", &r.samples, r.bound(1e-7, 1e-4), |s| (turned(s.pose.roll_pitch_yaw_rad()[0], 3.0 * s.t_s), 0.0));
        }),
    case!("gimbal", every, "pitch through ±90°, a sample at exactly 90°",
        "the quaternion is that of the turn; roll, pitch, yaw make the same rotation",
        format!("duration_s = 12.0\n{FREE}angular_velocity_rad_per_s = [0.0, 1.5707963267948966, 0.0]\n"),
        |r, c| {
            c.ended(r);
            c.every("attitude, rad", &r.samples, 1e-7, |s| {
                let turn = Vector3::y() * (0.5 * PI * s.t_s);
                (turned_off(s, UnitQuaternion::from_scaled_axis(turn)), 0.0)
            });
            // So near the pole that roll and yaw are still told apart, they carry ε/1e-9 of rounding.
            c.every("attitude of roll, pitch, yaw, rad", &r.samples, 1e-6, |s| {
                let [a, b, g] = s.pose.roll_pitch_yaw_rad();
                (turned_off(s, UnitQuaternion::from_euler_angles(a, b, g)), 0.0)
            });
        }),
    case!("drop", located, "falls from 10 m, lands, bounces, stands",
        "falls and swings piece by piece in closed form; the ledger closes; at last M g/(2k) deep",
        "duration_s = 40.0\n[start]\nheight_m = 10.0\n[effects.contact]\ndamping_n_s_per_m = 40.0\n",
        |r, c| {
            c.ledger(r, 1e-8);
            c.carried(r, &load(40.0, 0.0), [10.0, 0.0]);
            c.near("height at the end, m", height(r.last()), TOUCH_M - MASS_KG * G / SPRING, 1e-7);
        }),
    case!("hour-of-rest", every, "stands for an hour",
        "does not drift by a nanometre nor turn by a nanoradian; half its weight on each handle",
        "duration_s = 3600.0\nlog_rate_hz = 1.0\n[effects.contact]\n[effects.hold]\n",
        |r, c| {
            c.ended(r);
            rests(r, c);
            for a in 0..3 {
                c.every("angle, rad", &r.samples, 1e-9, |s| (s.pose.roll_pitch_yaw_rad()[a], 0.0));
            }
        }),
    case!("bouncing-to-rest", located, "weak damping: ever smaller bounces",
        "the ledger closes; falls and swings piece by piece in closed form, each contact change at its moment; at last M g/(2k) deep",
        "duration_s = 40.0\n[start]\nheight_m = 1.0\n[effects.contact]\ndamping_n_s_per_m = 50.0\n",
        |r, c| {
            c.ledger(r, 1e-8);
            c.near("height at the end, m", height(r.last()), TOUCH_M - MASS_KG * G / SPRING, 1e-8);
            c.carried(r, &load(50.0, 0.0), [1.0, 0.0]);
        }),
    case!("grazing", located, "N just reaches zero: the shoulders' amplitude is exactly that of lift-off",
        "in the steady state N = M g (1 − sin(ω t + α)); the ledger closes",
        format!("duration_s = 12.0\nlog_rate_hz = 400.0\n[effects.contact]\n[effects.gait]\namplitude_m = {:?}\n",
            grazing_amplitude_m(MASS_KG, SPRING, DAMPER, GAIT)),
        |r, c| {
            c.ended(r);
            c.ledger(r, 1e-8);
            let swing = follows(MASS_KG, SPRING, DAMPER, GAIT).arg();
            c.every("force, N", behind(r, 3200), 1e-5 * MASS_KG * G, |s| {
                (s.normal_n.iter().sum(), MASS_KG * G * (1.0 - (GAIT * s.t_s + swing).sin()))
            });
        }),
    case!("thrown", every, "both handles slack for four seconds",
        "a parabola to the landing",
        "duration_s = 4.0\n[start]\nheight_m = 2.0\nvelocity_m_per_s = [0.0, 0.0, 20.0]\n[effects.contact]\ndamping_n_s_per_m = 100.0\n",
        |r, c| {
            c.ended(r);
            c.every("height, m", &r.samples, r.bound(1e-8, 3e-2), |s| (height(s), 2.0 + 20.0 * s.t_s - 0.5 * G * s.t_s * s.t_s));
            c.every("force, N", &r.samples, 0.0, |s| (s.normal_n[0] + s.normal_n[1], 0.0));
        }),
    case!("one-handle", every, "a single carrier",
        "the forced oscillator's closed form in its steady state",
        "duration_s = 20.0\n[carriers]\nhandles_m = [[0.0, 0.0, 0.1]]\n[effects.contact]\n[effects.gait]\n",
        |r, c| {
            c.ended(r);
            let h = follows(MASS_KG, 0.5 * SPRING, 0.5 * DAMPER, GAIT);
            c.every("height, m", behind(r, 450), r.bound(1e-7, 1e-3), |s| {
                let swing = (h * Complex::from_polar(0.06, GAIT * s.t_s)).im;
                (height(s), TOUCH_M - 2.0 * MASS_KG * G / SPRING + swing)
            });
        }),
    case!("thousand-handles", explicit, "1000 carriers in step under one pole",
        "the motion of two carriers with 500 times the spring each, and theirs in closed form; the ledger closes",
        thousand(),
        |r, c| {
            c.ledger(r, 1e-6); // the tolerance
            match r.other("name = \"two\"\nduration_s = 2.0\n[effects.contact]\n[effects.gait]\n") {
                Ok(two) => {
                    c.same(&r.samples, &two.samples, 1e-7, MASS_KG * G);
                    c.carried(&two, &load(450.0, 0.06), [TOUCH_M - MASS_KG * G / SPRING, 0.0]);
                }
                Err(cause) => c.fail(cause),
            }
        }),
    case!("adler-edge", precise, "K_m exactly at the edge of locking",
        "Adler's closed form: the lag creeps to 90° as 2/(K t)",
        edge(PI), |r, c| locks(r, c, 1e-7, |t| adler(PI, PI, 0.0, t), lag)),
    case!("adler-inside", precise, "K_m 1e-9 above the edge",
        "Adler's closed form",
        edge(JUST_INSIDE), |r, c| locks(r, c, 1e-7, |t| adler(PI, JUST_INSIDE, 0.0, t), lag)),
    case!("adler-outside", precise, "K_m 1e-9 below the edge",
        "Adler's closed form",
        edge(JUST_OUTSIDE), |r, c| locks(r, c, 1e-7, |t| adler(PI, JUST_OUTSIDE, 0.0, t), lag)),
    case!("coupling-edge", precise, "K_c exactly at the onset of locking of two carriers",
        "Adler's closed form for φ₂ − φ₁; their mean goes on at the mean frequency",
        format!("duration_s = 100.0\nlog_rate_hz = 1.0\n{FLOATING}[carriers]\nfrequency_hz = [2.0, 2.1]\n[effects.gait]\n[effects.coupling]\nstrength_rad_per_s = {:?}\n", 0.2 * PI),
        |r, c| {
            locks(r, c, 1e-6, |t| adler(2.1 * TAU - 2.0 * TAU, 0.2 * PI, 0.0, t), between);
            keeps_the_mean(r, c);
        }),
    case!("fast-beat", located, "a beat a hundred times the gait",
        "Adler's closed form for every carrier; the ledger closes",
        format!("duration_s = 10.0\n{CARRIED}[effects.music]\nbeat_hz = 200.0\nonset_s = 0.0\nbuild_up_s = 0.0\n"),
        |r, c| {
            for of in [|s: &Sample| 200.0 * TAU * s.t_s - s.phase_rad[0], |s: &Sample| 200.0 * TAU * s.t_s - s.phase_rad[1]] {
                locks(r, c, 1e-6, |t| adler(198.0 * TAU, 2.7, 0.0, t), of);
            }
            c.ledger(r, 1e-8);
        }),
    case!("rigid-coupling", adaptive, "coupling of 1e6 rad/s: phases decay in a microsecond",
        "φ₂ − φ₁ = asin(Δω/K); their mean goes on at the mean frequency",
        format!("duration_s = 0.1\nlog_rate_hz = 100.0\n{FLOATING}[carriers]\nfrequency_hz = [2.0, 2.1]\n[effects.gait]\n[effects.coupling]\nstrength_rad_per_s = 1e6\n"),
        |r, c| {
            c.ended(r);
            c.near("φ₂ − φ₁, rad", between(r.last()), 0.2 * PI / 1e6, 1e-8);
            keeps_the_mean(r, c);
        }),
    case!("loud-noise", located, "phase noise a thousand times the measured",
        "the phases are ω t + σ√h times the sum of the draws; the ledger closes",
        format!("duration_s = 10.0\n{CARRIED}[effects.noise]\nphase_rad_per_sqrt_s = 10.0\n"),
        |r, c| {
            c.ledger(r, 1e-8);
            // At the grid, which the log shares: a sum of draws. Ten tolerances.
            for carrier in 0..2 {
                let mut path = 0.0;
                for (k, s) in r.samples.iter().enumerate() {
                    c.near("noise, rad", s.phase_rad[carrier] - GAIT * s.t_s, path, 1e-7 * (1.0 + GAIT * s.t_s));
                    path += 10.0 / 30f64.sqrt() * normal(r.scene.seed, Stream::PhaseNoise, carrier, k as u64);
                }
            }
        }),
    case!("late-music", located, "the music begins with a jump in the phase rates, between samples",
        "φ = ω t before, Adler's closed form after; the ledger closes",
        format!("duration_s = 10.0\n{CARRIED}[effects.music]\nbeat_hz = 2.5\nonset_s = 3.217\nbuild_up_s = 0.0\n"),
        |r, c| {
            let before = |t: f64| PI * t;
            locks(r, c, 1e-6, |t| if t < 3.217 { before(t) } else { adler(PI, 2.7, before(3.217), t - 3.217) }, lag);
            c.ledger(r, 1e-8);
        }),
    case!("tempo-jump", precise, "the tempo jumps from one that locks to one that does not",
        "Adler's closed form on both sides, the beat's phase without a jump",
        format!("duration_s = 20.0\n{FLOATING}[effects.gait]\n[effects.music]\nbeat_hz = 2.2\nonset_s = 0.0\nbuild_up_s = 0.0\ntempo_changes = [{{ at_s = 5.05, beat_hz = 2.7 }}]\n"),
        |r, c| {
            let beat = |t: f64| TAU * (2.2 * t.min(5.05) + 2.7 * (t - 5.05).max(0.0));
            c.every("beat phase, rad", &r.samples, 1e-9, |s| (s.beat_phase_rad.unwrap_or(f64::NAN), beat(s.t_s)));
            c.ended(r);
            c.every("lag, rad", &r.samples, 1e-6, |s| {
                let first = adler(0.2 * TAU, 2.7, 0.0, s.t_s.min(5.05));
                let law = if s.t_s > 5.05 { adler(0.7 * TAU, 2.7, first, s.t_s - 5.05) } else { first };
                (turned(beat(s.t_s) - s.phase_rad[0], law), 0.0)
            });
        }),
    case!("frictionless", precise, "μ → 0 on a slope of 30°",
        "slides at g sin 30°",
        format!("duration_s = 5.0\n{SLOPE}[effects.contact]\n[effects.friction]\ncoefficient = 1e-12\n"),
        |r, c| {
            c.ended(r);
            c.every("v_x, m/s", &r.samples, 1e-6, |s| (s.pose.velocity_m_per_s[0], 4.905 * s.t_s));
        }),
    case!("sliding", adaptive, "dry friction, regularised at 0.1 mm/s, on level ground",
        "slows by μ g, more by what lifts it: v_x = v₀ − μ (g t + v_z)",
        "duration_s = 1.0\n[start]\nvelocity_m_per_s = [5.0, 0.0, 0.0]\n[effects.contact]\n[effects.friction]\ncoefficient = 0.3\nregularising_velocity_m_per_s = 1e-4\n",
        |r, c| {
            c.ledger(r, 1e-8);
            // It pitches, so N is not the weight; but its impulse is the weight's and what lifts the load. Ten tolerances of 5 m/s; v_s
            // takes less than (v_s/v)²/2 = 1e-9 from it.
            c.every("v_x, m/s", &r.samples, 5e-7, |s| {
                let [v_x, _, v_z] = s.pose.velocity_m_per_s;
                (v_x, 5.0 - 0.3 * (G * s.t_s + v_z))
            });
        }),
    case!("stuck", adaptive, "μ → ∞ on a slope of 30°: bristles that never slip",
        "hangs on its bristles, tan 30°/σ₀ below where it started",
        format!("duration_s = 10.0\n{SLOPE}[effects.contact]\n[effects.friction]\nlaw = \"bristle\"\ncoefficient = 1e9\n"),
        |r, c| {
            c.ledger(r, 1e-8);
            // Σ N_i σ₀ z_i = M g sin 30°: each bristle counts by what presses on it, as the load's lean has it. Ten tolerances; bristles
            // creep by 1e-10 m at this μ.
            let (first, last) = (&r.samples[0], r.last());
            let slips = (0..2).map(|i| last.normal_n[i] * (last.handle_m[i][0] - first.handle_m[i][0]));
            let mean = slips.sum::<f64>() / last.normal_n.iter().sum::<f64>();
            c.near("slip, m", mean, (PI / 6.0).tan() / 10.0, 1e-8);
        }),
    case!("stick-and-slip", located, "shoulders sway under a load that sticks and slips",
        "friction is μN along the sliding, less as v_s has it, and never more; the ledger closes",
        "duration_s = 10.0\n[effects.contact]\n[effects.friction]\ncoefficient = 0.2\nregularising_velocity_m_per_s = 1e-3\n[effects.gait]\namplitude_m = 0.02\nsway_m = 0.05\n",
        |r, c| {
            c.ledger(r, 1e-8);
            for s in &r.samples {
                let turn = attitude(s);
                let (v, spin) = (Vector3::from(s.pose.velocity_m_per_s), turn * Vector3::from(s.pose.spin_rad_per_s));
                for (i, (t, n)) in s.tangential_n.iter().zip(&s.normal_n).enumerate() {
                    c.at_most("friction above μN, N", t[0].hypot(t[1]) - 0.2 * n, 1e-12);
                    let arm = Vector3::from(s.handle_m[i]) - Vector3::from(s.pose.position_m);
                    let slide = Vector3::y() * (0.05 * GAIT * s.phase_rad[i].cos()) - v - spin.cross(&arm);
                    let speed = slide.x.hypot(slide.y).hypot(1e-3);
                    // Rounding of velocities over v_s, times μN.
                    c.near("friction along the sliding, x, N", t[0], 0.2 * n * slide.x / speed, 1e-9);
                    c.near("friction along the sliding, y, N", t[1], 0.2 * n * slide.y / speed, 1e-9);
                }
            }
        }),
    case!("giant-steps", located, "shoulders that move by 10 m",
        "falls and swings piece by piece in closed form; the ledger closes",
        format!("duration_s = 10.0\n{}", CARRIED.replace("0.075", "10.0")),
        |r, c| {
            c.ledger(r, 1e-8);
            c.carried(r, &load(400.0, 10.0), [TOUCH_M - MASS_KG * G / SPRING, 0.0]);
        }),
    case!("day-long", adaptive, "1e5 s of standing, a sample every 100 s",
        "does not drift by a nanometre",
        "duration_s = 1e5\nlog_rate_hz = 0.01\n[effects.contact]\n[effects.hold]\n",
        |r, c| {
            c.ended(r);
            rests(r, c);
        }),
    case!("dense-log", located, "logged at 10 kHz, a hundred samples in a step",
        "the samples' slope is their velocity; impulse and work are the integrals of the logged forces; the motion's closed form; the ledger closes",
        format!("duration_s = 2.0\nlog_rate_hz = 10000.0\n{CARRIED}"),
        |r, c| {
            c.ledger(r, 1e-8);
            let worst = r.samples.windows(3).map(|w| {
                ((height(&w[2]) - height(&w[0])) / 2e-4 - w[1].pose.velocity_m_per_s[2]).abs()
            }).fold(0.0, f64::max);
            c.at_most("slope beside velocity, m/s", worst, 1e-5);
            // Impulse and work are what the log's forces make of them, by trapezoids: h²/12 of what the slopes change by, 1e6 N/s in all.
            let sum = |of: fn(&Sample) -> f64| -> f64 {
                r.samples.windows(2).map(|w| 0.5e-4 * (of(&w[0]) + of(&w[1]))).sum()
            };
            let force = |s: &Sample| s.normal_n.iter().sum::<f64>();
            let speed = r.last().pose.velocity_m_per_s[2] - r.samples[0].pose.velocity_m_per_s[2];
            c.near("impulse, N s", sum(force), MASS_KG * (G * 2.0 + speed), 1e-3);
            let power = |s: &Sample| 0.075 * GAIT * (0..2).map(|i| s.normal_n[i] * s.phase_rad[i].cos()).sum::<f64>();
            let work_j = r.last().energy.map_or(f64::NAN, |e| e.work_in_j);
            c.near("work of the shoulders, J", work_j, sum(power), 1e-3);
            c.carried(r, &load(400.0, 0.075), [TOUCH_M - MASS_KG * G / SPRING, 0.0]);
        }),
    case!("sparse-log", located, "a sample in ten seconds, dozens of contact changes between two",
        "the same as every 300th of a log at 30 Hz; the motion's closed form, each contact change at its moment; the ledger closes",
        format!("duration_s = 30.0\nlog_rate_hz = 0.1\n{CARRIED}"),
        |r, c| {
            c.ledger(r, 1e-8);
            c.carried(r, &load(400.0, 0.075), [TOUCH_M - MASS_KG * G / SPRING, 0.0]);
            match r.other(&format!("name = \"dense\"\nduration_s = 30.0\n{CARRIED}")) {
                Ok(dense) => {
                    let dense: Vec<Sample> = dense.samples.into_iter().step_by(300).collect();
                    c.same(&r.samples, &dense, 1e-6, MASS_KG * G);
                }
                Err(cause) => c.fail(cause),
            }
        }),
    case!("slow-motion", located, "a thousand times as slow, to 12,288 s, where a double cannot tell 1e-12 s apart",
        "the motion of the same in 12 s; the ledger closes",
        slowed(1024.0),
        |r, c| {
            c.ledger(r, 1e-8);
            match r.other(&format!("name = \"fast\"\n{}", slowed(1.0))) {
                Ok(fast) => {
                    let mut slow = r.samples.clone();
                    for s in &mut slow {
                        s.normal_n.iter_mut().for_each(|n| *n *= 1024.0 * 1024.0);
                    }
                    c.same(&slow, &fast.samples, 1e-6, MASS_KG * G);
                }
                Err(cause) => c.fail(cause),
            }
        }),
    case!("late-epoch", every, "stamps of 1e9 s",
        "bit for bit the run that begins at 0: time inside is the run's own",
        format!("duration_s = 5.0\nepoch_s = 1e9\n{CARRIED}"),
        |r, c| {
            c.ended(r);
            match r.other(&format!("name = \"early\"\nduration_s = 5.0\n{CARRIED}")) {
                Ok(early) => {
                    c.same(&r.samples, &early.samples, 0.0, 1.0);
                    let differs = |(a, b): (&Sample, &Sample)| (a.t_s, a.pose) != (b.t_s, b.pose) || a.phase_rad != b.phase_rad;
                    if r.samples.iter().zip(&early.samples).any(differs) {
                        c.fail("a pose, a phase or its time differs".into());
                    }
                }
                Err(cause) => c.fail(cause),
            }
        }),
    case!("touching-at-start", precise, "an event at t = 0: handles exactly on the shoulders, at rest",
        "the damped oscillator's closed form",
        "duration_s = 5.0\n[start]\nheight_m = 0.9\n[effects.contact]\n",
        |r, c| {
            c.ended(r);
            c.every("height, m", &r.samples, 1e-7, |s| (height(s), sinking(MASS_KG, SPRING, DAMPER, TOUCH_M, s.t_s)));
        }),
    case!("resting-on-edge", precise, "a minute without gravity: handles exactly on the shoulders, and nothing that moves them",
        "nothing moves, nothing pushes",
        "duration_s = 60.0\n[body]\ngravity_m_per_s2 = [0.0, 0.0, 0.0]\n[start]\nheight_m = 0.9\n[effects.contact]\n",
        |r, c| {
            c.ended(r);
            c.every("height, m", &r.samples, 1e-12, |s| (height(s), TOUCH_M));
            c.every("force, N", &r.samples, 1e-9, |s| (s.normal_n.iter().sum(), 0.0));
        }),
    case!("step-too-large", fixed, "a step of 0.1 s where handles tied to the shoulders swing in 0.03 s",
        "stops with the time and the cause, before any number is lost",
        format!("duration_s = 60.0\n{}[solver]\nstep_s = 0.1\n", CARRIED.replace("damping", "stiffness_n_per_m = 1e6\nbilateral = true\ndamping")),
        stops),
    case!("step-far-too-large", fixed, "the same with handles that lift off",
        "stops with the time and the cause, before any number is lost",
        format!("duration_s = 60.0\n{}[solver]\nstep_s = 0.1\n", CARRIED.replace("damping", "stiffness_n_per_m = 1e6\ndamping")),
        stops),
];
