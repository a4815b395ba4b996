//! Model + method → samples, in the units and frames of a recording.

use crate::energy::{Belief, Doubt, Energy, Start};
use crate::freedoms::Pose;
use crate::model::{Model, Workspace};
use crate::scene::Scene;
use crate::sensors::{Reading, Sensors};
use crate::solve::{
    Event, METHODS, Method, Observer, Settings, Stats, Stopped, abreast, method, resolve,
};

/// Everything that is logged at one moment. Carriers and handles in the order of the scene; from `normal_n` to `handle_m` empty for a listener
/// that does not look at forces.
#[derive(Clone, Debug)]
pub struct Sample {
    /// s
    pub t_s: f64,
    /// Pose in the world, the walk of the party included.
    pub pose: Pose,
    /// φ_i, rad, unwrapped; empty when nobody has a gait.
    pub phase_rad: Vec<f64>,
    /// ψ, rad, once the music has begun.
    pub beat_phase_rad: Option<f64>,
    /// N_i, N
    pub normal_n: Vec<f64>,
    /// T_i in x and y, N
    pub tangential_n: Vec<[f64; 2]>,
    /// δ_i, shoulder minus handle along z, m
    pub compression_m: Vec<f64>,
    /// Shoulders b_i in the world, m
    pub shoulder_m: Vec<[f64; 3]>,
    /// Handles s_i in the world, m
    pub handle_m: Vec<[f64; 3]>,
    /// The energy account, where it is kept.
    pub energy: Option<Energy>,
    /// Of every account of it ([`Model::accounts`]), work since the start and energy dissipated, J.
    pub shares_j: Vec<[f64; 2]>,
    /// Whether the account, had it been kept, might have ended the run here: the same run with it tells.
    pub doubtful: bool,
}

impl Sample {
    /// Order parameter r = |Σ e^{iφ}|/N, 1; `None` without phases.
    pub fn order_parameter(&self) -> Option<f64> {
        if self.phase_rad.is_empty() {
            return None;
        }
        let (s, c) = self
            .phase_rad
            .iter()
            .fold((0.0, 0.0), |(s, c), p| (s + p.sin(), c + p.cos()));
        Some(f64::hypot(s, c) / self.phase_rad.len() as f64)
    }
}

/// Who receives samples and events.
pub trait Listener {
    /// Whether samples must tell of handles and the forces there, which cost an evaluation each. Asked once, at the start.
    fn looks_at_forces(&self) -> bool {
        true
    }
    /// Called at every log time. Returning `false` stops the run.
    fn sample(&mut self, sample: &Sample) -> bool;
    /// Called with every sample of every virtual sensor.
    fn reading(&mut self, _reading: &Reading<'_>) {}
    /// Called when a contact changes.
    fn event(&mut self, _event: &Event) {}
    /// Called by [`run_abreast`] when this run has ended, which may be long before all have: what it kept can be let go.
    fn ended(&mut self, _stats: &Stats, _outcome: &Result<(), Stopped>) {}
}

impl<F: FnMut(&Sample) -> bool> Listener for F {
    fn sample(&mut self, sample: &Sample) -> bool {
        self(sample)
    }
}

/// Most evaluations that a run may take before it is given up.
const MOST_EVALUATIONS: u64 = 20_000_000_000;

/// The settings that a scene asks for.
pub fn settings(scene: &Scene) -> Settings {
    Settings {
        tolerance: scene.solver.tolerance,
        step_s: scene.solver.step_s,
        most_evaluations: MOST_EVALUATIONS,
    }
}

/// The method that a checked scene names.
///
/// # Panics
/// When the scene has not been checked and names none.
pub fn method_of(scene: &Scene) -> &'static Method {
    method(&scene.solver.method).expect("a checked scene names a method")
}

/// The method's name for people and records: with what `auto` begins with at the scene's tolerance.
pub fn method_name(scene: &Scene) -> String {
    let (named, begun) = (
        method_of(scene),
        resolve(method_of(scene), &Model::new(scene), &settings(scene)),
    );
    if named.name == begun.name {
        named.name.into()
    } else {
        format!("{} ({})", named.name, begun.name)
    }
}

/// Runs a checked scene with its method.
///
/// # Errors
/// [`Stopped`]; the samples before that moment have been handed over.
pub fn run(scene: &Scene, listener: &mut dyn Listener) -> Result<Stats, Stopped> {
    let model = Model::new(scene);
    let (stats, outcome) = run_model(&model, method_of(scene), &settings(scene), listener);
    outcome.map(|()| stats)
}

/// Runs a model with any method and settings; the work done comes back in either case.
pub fn run_model(
    model: &Model,
    method: &Method,
    settings: &Settings,
    listener: &mut dyn Listener,
) -> (Stats, Result<(), Stopped>) {
    let mut bridge = Bridge::new(model, method, settings, listener);
    let (stats, outcome) = (method.run)(model, settings, &mut bridge);
    let method = method.name;
    let outcome = match (outcome, bridge.doubt) {
        (Err(Stopped::ByObserver { t_s }), Some(doubt)) => Err(match doubt {
            Doubt::Unexplained {
                nowhere_j,
                supplied_j,
            } => Stopped::FromNowhere {
                method,
                t_s,
                nowhere_j,
                supplied_j,
            },
            Doubt::Given {
                given_j,
                supplied_j,
            } => Stopped::FedByEffect {
                effect: bridge.giver(),
                t_s,
                given_j,
                supplied_j,
            },
        }),
        (outcome, _) => outcome,
    };
    (stats, outcome)
}

/// Runs models of one scene that differ in their seeds alone side by side, at least as accurately as [`run_model`] with `auto` and, if there
/// are several, in less time. What a run gives does not depend on which others there are.
///
/// # Panics
/// When [`abreast::suits`] says no of one of them, when their scenes differ in more than the seed, or when there are not as many listeners.
pub fn run_abreast<L: Listener>(
    models: &[Model],
    settings: &Settings,
    listeners: &mut [L],
) -> Vec<(Stats, Result<(), Stopped>)> {
    let bridges = models.iter().zip(listeners.iter_mut());
    let mut bridges: Vec<Bridge<'_>> = bridges
        .map(|(model, listener)| Bridge::new(model, &METHODS[0], settings, listener))
        .collect();
    let mut observers: Vec<&mut dyn Observer> = Vec::new();
    observers.extend(bridges.iter_mut().map(|b| b as &mut dyn Observer));
    abreast::run(models, settings, &mut observers)
}

struct Bridge<'a> {
    model: &'a Model,
    listener: &'a mut dyn Listener,
    sample: Sample,
    looks_at_forces: bool,
    at_start: Option<Start>,
    belief: Belief,
    doubt: Option<Doubt>,
    sensors: Sensors<'a>,
}

impl<'a> Bridge<'a> {
    fn new(
        model: &'a Model,
        method: &Method,
        settings: &Settings,
        listener: &'a mut dyn Listener,
    ) -> Self {
        let looks_at_forces = listener.looks_at_forces();
        Self {
            model,
            listener,
            sample: blank(model, looks_at_forces),
            looks_at_forces,
            at_start: None,
            belief: Belief::new(&model.scene, method, settings),
            doubt: None,
            sensors: Sensors::new(model),
        }
    }

    /// The effect that has taken least.
    fn giver(&self) -> &'static str {
        let taken = self.model.accounts().zip(&self.sample.shares_j);
        let least = taken.min_by(|(_, a), (_, b)| a[1].total_cmp(&b[1]));
        least.map_or("", |(name, _)| name)
    }
}

fn blank(model: &Model, forces: bool) -> Sample {
    let n = if forces { model.carriers() } else { 0 };
    Sample {
        t_s: 0.0,
        pose: Pose {
            position_m: [0.0; 3],
            orientation: [0.0, 0.0, 0.0, 1.0],
            velocity_m_per_s: [0.0; 3],
            spin_rad_per_s: [0.0; 3],
        },
        phase_rad: vec![0.0; model.layout().phases],
        beat_phase_rad: None,
        normal_n: vec![0.0; n],
        tangential_n: vec![[0.0; 2]; n],
        compression_m: vec![0.0; n],
        shoulder_m: vec![[0.0; 3]; n],
        handle_m: vec![[0.0; 3]; n],
        energy: None,
        shares_j: vec![[0.0; 2]; model.accounts().count()],
        doubtful: false,
    }
}

impl Observer for Bridge<'_> {
    fn looks_at_forces(&self) -> bool {
        self.looks_at_forces || self.model.scene.solver.energy
    }

    fn sample(&mut self, t_s: f64, y: &[f64], w: &Workspace) -> bool {
        let (model, s) = (self.model, &mut self.sample);
        let walk = model.scene.carriers.walk_m_per_s;
        s.t_s = t_s;
        s.pose = model.freedoms().pose(y);
        s.phase_rad
            .copy_from_slice(&y[model.layout().phase_range()]);
        s.beat_phase_rad = model
            .beat()
            .filter(|b| b.sounds(t_s))
            .map(|b| b.phase_at(t_s));
        let walked = walk.map(|v| v * t_s);
        for i in 0..s.normal_n.len() {
            s.normal_n[i] = w.of(i, |p| p.normal);
            s.tangential_n[i] = [0, 1].map(|a| w.of(i, |p| p.tangential[a]));
            s.compression_m[i] = w.of(i, |p| p.gap[2]);
            for a in 0..3 {
                s.shoulder_m[i][a] = w.of(i, |p| p.base[a]) + walked[a];
                s.handle_m[i][a] = s.pose.position_m[a] + w.of(i, |p| p.arm[a]) + walked[a];
            }
        }
        s.energy = Energy::of(model, y, w, &mut s.shares_j, &mut self.at_start);
        match &s.energy {
            Some(energy) => self.doubt = self.belief.doubt(energy, w),
            None => s.doubtful = self.belief.might_doubt(model.freedoms().energy_j(y)),
        }
        if self.doubt.is_some() {
            return false;
        }
        for a in 0..3 {
            s.pose.position_m[a] += walked[a];
            s.pose.velocity_m_per_s[a] += walk[a];
        }
        self.listener.sample(s)
    }

    fn tick(&mut self, clock: usize, tick: u64, t_s: f64, y: &[f64], w: &mut Workspace) {
        let listener = &mut self.listener;
        self.sensors
            .read(clock, tick, t_s, y, w, |reading| listener.reading(reading));
    }

    fn event(&mut self, event: &Event) {
        self.listener.event(event);
    }

    fn ended(&mut self, stats: &Stats, outcome: &Result<(), Stopped>) {
        self.listener.ended(stats, outcome);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::load;

    /// Poses alone, or with forces.
    struct Seen(bool, Vec<Sample>);

    impl Listener for Seen {
        fn looks_at_forces(&self) -> bool {
            self.0
        }
        fn sample(&mut self, sample: &Sample) -> bool {
            self.1.push(sample.clone());
            true
        }
    }

    #[test]
    fn who_does_not_look_at_forces_sees_the_same_motion_for_less() {
        let brief = ["duration_s=7.0", "solver.energy=false"].map(str::to_owned);
        let scene = load("music", &brief).unwrap_or_else(|e| panic!("{e}"));
        let model = Model::new(&scene);
        for method in METHODS {
            let run = |looks: bool| {
                let mut seen = Seen(looks, Vec::new());
                let (stats, outcome) = run_model(&model, method, &settings(&scene), &mut seen);
                assert_eq!(outcome, Ok(()), "{}", method.name);
                (seen.1, stats.evaluations)
            };
            let ((with, more), (without, less)) = (run(true), run(false));
            assert_eq!(with.len(), without.len());
            for (a, b) in with.iter().zip(&without) {
                assert_eq!((a.pose, &a.phase_rad), (b.pose, &b.phase_rad));
                assert!(!a.normal_n.is_empty() && b.normal_n.is_empty() && b.handle_m.is_empty());
            }
            assert!(less <= more, "{}: {less} {more}", method.name);
            assert!(!method.locates || less < more, "{}", method.name);
        }
    }
}
