//! Random scenes far outside of anything physical, and what may come of them. The seed is the number of the scene.

use sim::model::Model;
use sim::run::{Sample, run_model, settings};
use sim::scene::{Scene, parse};
use sim::solve::{METHODS, Method, Settings};
use std::panic::{AssertUnwindSafe, catch_unwind};

#[path = "dice.rs"]
mod dice;

use dice::Dice;

impl Dice {
    /// What is usual, or in one of three cases a power of ten between the two exponents.
    fn wild(&mut self, usual: f64, low: f64, high: f64) -> f64 {
        if self.chance(1.0 / 3.0) {
            10f64.powf(self.from(low, high))
        } else {
            usual * self.from(0.5, 2.0)
        }
    }
    fn signed(&mut self, usual: f64, low: f64, high: f64) -> f64 {
        self.wild(usual, low, high) * if self.chance(0.5) { 1.0 } else { -1.0 }
    }
}

/// A scene of 60 kg and usual effects, of whose numbers every third is out by many powers of ten.
pub fn wild(seed: u64) -> String {
    let mut d = Dice(seed ^ 0x5CE7E);
    let n = 1 + d.below(6);
    let mass = d.wild(60.0, -6.0, 9.0);
    let size = d.wild(0.2, -4.0, 2.0);
    let [a, b, c] = [0; 3].map(|_| size * d.wild(1.0, -3.0, 3.0));
    let mut t = format!(
        "name = \"wild {seed}\"\nduration_s = {:?}\nlog_rate_hz = {:?}\nseed = {seed}\n\
         [body]\nmass_kg = {mass:?}\ninertia_kg_m2 = {{ xx = {:?}, yy = {:?}, zz = {:?} }}\ngravity_m_per_s2 = [{:?}, 0.0, {:?}]\n",
        d.wild(1.0, -3.0, 1.0),
        d.wild(60.0, -1.0, 3.0),
        mass * (b + c),
        mass * (a + c),
        mass * (a + b),
        if d.chance(0.2) {
            d.signed(1.0, -3.0, 3.0)
        } else {
            0.0
        },
        -d.wild(9.81, -4.0, 4.0),
    );
    t += &format!(
        "[carriers]\nfrequency_hz = {:?}\ninitial_phase_sd_rad = {:?}\nshoulder_height_m = {:?}\n\
         [carriers.along_poles]\ncount = {n}\npoles = 1\nlength_m = {:?}\nheight_m = {:?}\n",
        d.wild(2.0, -3.0, 3.0),
        d.wild(1.0, -3.0, 2.0),
        d.signed(1.0, -2.0, 3.0),
        d.wild(4.9, -3.0, 3.0),
        d.signed(0.1, -4.0, 2.0),
    );
    t += "[start]\n";
    if d.chance(0.7) {
        t += &format!("height_m = {:?}\n", d.signed(1.0, -3.0, 4.0));
    }
    if d.chance(0.5) {
        t += &format!(
            "roll_pitch_yaw_deg = [{:?}, {:?}, {:?}]\nvelocity_m_per_s = [{:?}, {:?}, {:?}]\nangular_velocity_rad_per_s = [{:?}, {:?}, {:?}]\n",
            d.from(-180.0, 180.0),
            d.from(-90.0, 90.0),
            d.from(-180.0, 180.0),
            d.signed(0.5, -3.0, 3.0),
            d.signed(0.5, -3.0, 3.0),
            d.signed(0.5, -3.0, 3.0),
            d.signed(1.0, -3.0, 3.0),
            d.signed(1.0, -3.0, 3.0),
            d.signed(1.0, -3.0, 3.0)
        );
    }
    t += &format!(
        "[solver]\ntolerance = {:?}\nstep_s = {:?}\n",
        10f64.powf(d.from(-12.5, -1.0)),
        d.wild(1e-3, -5.0, 0.0)
    );
    if d.chance(0.9) {
        t += &format!(
            "[effects.contact]\nstiffness_n_per_m = {:?}\ndamping_n_s_per_m = {:?}\n",
            d.wild(3000.0, -3.0, 12.0),
            d.wild(400.0, -3.0, 9.0)
        );
        match d.below(5) {
            0 => t += "bilateral = true\n",
            1 => {
                t += &format!(
                    "law = \"hunt-crossley\"\nexponent = {:?}\n",
                    d.from(1.0, 2.0)
                )
            }
            _ => {}
        }
    }
    let held = d.chance(0.6);
    if held {
        t += &format!(
            "[effects.hold]\nstiffness_n_per_m = {:?}\ndamping_n_s_per_m = {:?}\n",
            d.wild(3000.0, -3.0, 9.0),
            d.wild(150.0, -3.0, 6.0)
        );
    }
    if d.chance(0.4) {
        let law = if held || d.chance(0.5) {
            "regularised"
        } else {
            "bristle"
        };
        t += &format!(
            "[effects.friction]\nlaw = \"{law}\"\ncoefficient = {:?}\nregularising_velocity_m_per_s = {:?}\n",
            d.wild(0.5, -9.0, 6.0),
            d.wild(0.1, -6.0, 3.0)
        );
    }
    if d.chance(0.3) {
        t += &format!(
            "[effects.pole_friction]\narm_m = {:?}\n",
            d.wild(0.002, -6.0, 1.0)
        );
    }
    if d.chance(0.8) {
        t += &format!(
            "[effects.gait]\namplitude_m = {:?}\nsway_m = {:?}\n",
            d.wild(0.06, -6.0, 2.0),
            d.wild(0.01, -6.0, 1.0)
        );
    }
    if d.chance(0.4) {
        let noise = d.wild(0.01, -4.0, 3.0);
        t += &format!("[effects.noise]\nphase_rad_per_sqrt_s = {noise:?}\n");
    }
    if d.chance(0.4) {
        let k = d.wild(1.0, -6.0, 6.0);
        t += &format!("[effects.coupling]\nstrength_rad_per_s = {k:?}\n");
    }
    if d.chance(0.3) {
        let k = d.wild(0.3, -3.0, 4.0);
        t += &format!("[effects.feedback]\nstrength_rad_per_s = {k:?}\n");
    }
    if d.chance(0.5) {
        t += &format!(
            "[effects.music]\nbeat_hz = {:?}\nstrength_rad_per_s = {:?}\nonset_s = {:?}\nbuild_up_s = {:?}\n",
            d.wild(2.15, -3.0, 3.0),
            d.wild(2.7, -3.0, 6.0),
            d.from(0.0, 1.0),
            if d.chance(0.5) {
                0.0
            } else {
                d.wild(1.0, -6.0, 2.0)
            }
        );
    }
    if d.chance(0.2) {
        let f = d.wild(6.0, -2.0, 4.0);
        t += &format!("[effects.flexure]\nfrequency_hz = {f:?}\n");
    }
    t
}

/// What came of a scene. The last four may not happen.
#[derive(Clone, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Outcome {
    /// It reached its end, and the ledger closes.
    Right,
    /// It reached its end by a method that controls no error or locates no contact: the ledger shows how wrong it may be.
    Uncontrolled,
    /// It was refused, with a sentence.
    Refused,
    /// It stopped, with the time and the cause.
    Stopped,
    /// It reached its end with energy from nowhere.
    Wrong(String),
    /// A number was none.
    NotFinite(String),
    /// It panicked.
    Panicked,
    /// It went on beyond its allowance of work.
    Hung(String),
}

impl Outcome {
    /// Whether it may happen.
    pub fn allowed(&self) -> bool {
        matches!(
            self,
            Self::Right | Self::Uncontrolled | Self::Refused | Self::Stopped
        )
    }
}

/// Evaluations that a run may take; one that needs more is told so, and stops.
const ALLOWANCE: u64 = 200_000;
/// An energy from nowhere of this part of all that moved is wrong, at tolerances below a hundredth of it, where the tolerance promises as much.
const WRONG: f64 = 1e-3;

/// The method of a scene: three times in four the default.
pub fn method_of(seed: u64) -> &'static Method {
    let all = METHODS.len() as u64;
    let i = Dice(seed ^ 0x3E7).below(4 * all);
    &METHODS[if i < all { i as usize } else { 0 }]
}

/// Runs scene `seed`.
pub fn outcome(seed: u64) -> Outcome {
    let text = wild(seed);
    let run = AssertUnwindSafe(|| match parse("wild.toml", &text, &[]) {
        Ok(scene) => run(&scene, method_of(seed)),
        Err(_) => Outcome::Refused,
    });
    catch_unwind(run).unwrap_or(Outcome::Panicked)
}

fn run(scene: &Scene, method: &'static Method) -> Outcome {
    let settings = Settings {
        most_evaluations: ALLOWANCE,
        ..settings(scene)
    };
    let (mut finite, mut rest, mut moved, mut at_start) = (true, 0.0f64, 0.0f64, None);
    let watch = &mut |s: &Sample| {
        let e = s.energy.expect("a ledger is kept");
        let numbers = s.pose.position_m.iter().chain(&s.pose.velocity_m_per_s);
        let numbers = numbers
            .chain(&s.pose.orientation)
            .chain(&s.pose.spin_rad_per_s);
        let angles = s.pose.roll_pitch_yaw_rad();
        let numbers = numbers.chain(&angles).chain(&s.normal_n);
        let numbers = numbers
            .chain(&s.phase_rad)
            .chain(s.tangential_n.iter().flatten());
        let energies = [
            e.kinetic_j,
            e.potential_j,
            e.elastic_j,
            e.work_in_j,
            e.dissipated_j,
            e.unexplained_j,
        ];
        finite &= numbers.chain(&energies).all(|x| x.is_finite());
        let p0 = *at_start.get_or_insert(e.potential_j);
        rest = rest.max(e.unexplained_j.abs());
        let held = e.kinetic_j + e.elastic_j.abs() + (e.potential_j - p0).abs();
        moved = moved.max(held + e.work_in_j.abs() + e.dissipated_j.abs());
        true
    };
    let (stats, outcome) = run_model(&Model::new(scene), method, &settings, watch);
    if !finite {
        return Outcome::NotFinite(method.name.into());
    }
    // The allowance is looked at once in a step, and a sample costs an evaluation as well.
    let logged = (scene.duration_s * scene.log_rate_hz) as u64;
    if stats.evaluations > 3 * (ALLOWANCE + logged) {
        return Outcome::Hung(method.name.into());
    }
    let controls = method.locates;
    // What a velocity that errs by the tolerance, in its unit of 1 m/s, makes of an energy: M v δv, with v as fast as what moved allows. A motion
    // of a few micrometres is not resolved to a thousandth where only a tenth of a micrometre was asked for.
    let promised = (2.0 * scene.body.mass_kg * moved).sqrt() * scene.solver.tolerance;
    match outcome {
        Err(_) => Outcome::Stopped,
        Ok(()) if !controls || scene.solver.tolerance > 0.01 * WRONG => Outcome::Uncontrolled,
        Ok(()) if rest > WRONG * moved + promised => Outcome::Wrong(format!(
            "{} by {}",
            format_args!("{rest:.1e} J of {moved:.1e} J"),
            method.name
        )),
        Ok(()) => Outcome::Right,
    }
}
