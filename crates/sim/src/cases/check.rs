//! How what must hold is held against what was found.

use super::Run;
use super::closed_forms::Carried;
use crate::run::Sample;
use crate::solve::EventKind;
use nalgebra::{Quaternion, UnitQuaternion, Vector3};

/// The checks of one run: how much of their bounds they used, and the first that broke.
#[derive(Default)]
pub struct Checks {
    pub used: f64,
    pub broken: Option<String>,
}

/// World from body, as logged.
pub fn attitude(s: &Sample) -> UnitQuaternion<f64> {
    let [x, y, z, w] = s.pose.orientation;
    UnitQuaternion::new_unchecked(Quaternion::new(w, x, y, z))
}

/// Kinetic energy, and potential energy in gravity, of a body that nobody walks with, J.
pub fn body_j(run: &Run, s: &Sample) -> [f64; 2] {
    let (body, pose) = (&run.scene.body, &s.pose);
    let (i, [x, y, z]) = (&body.inertia_kg_m2, pose.spin_rad_per_s);
    let products = i.xy * x * y + i.xz * x * z + i.yz * y * z;
    let turning = i.xx * x * x + i.yy * y * y + i.zz * z * z + 2.0 * products;
    let moving = pose.velocity_m_per_s.iter().map(|v| v * v).sum::<f64>();
    let fall = pose.position_m.iter().zip(body.gravity_m_per_s2);
    [
        0.5 * (body.mass_kg * moving + turning),
        -body.mass_kg * fall.map(|(r, g)| r * g).sum::<f64>(),
    ]
}

impl Checks {
    /// Says that something did not hold.
    pub fn fail(&mut self, what: String) {
        self.used = f64::INFINITY;
        self.broken.get_or_insert(what);
    }

    /// |found − expected| ≤ within.
    pub fn near(&mut self, what: &str, found: f64, expected: f64, within: f64) {
        let off = (found - expected).abs();
        if !(off <= within) {
            self.fail(format!(
                "{what}: found {found:e}, expected {expected:e} within {within:e}"
            ));
        } else if within > 0.0 {
            self.used = self.used.max(off / within);
        }
    }

    /// `found` is at most `most`.
    pub fn at_most(&mut self, what: &str, found: f64, most: f64) {
        if !(found <= most) {
            self.fail(format!(
                "{what}: found {found:e}, expected at most {most:e}"
            ));
        } else if most > 0.0 {
            self.used = self.used.max(found.max(0.0) / most);
        }
    }

    /// A quantity of every sample, taken at its worst.
    pub fn every(
        &mut self,
        what: &str,
        samples: &[Sample],
        within: f64,
        pair: impl Fn(&Sample) -> (f64, f64),
    ) {
        let off = |s: &Sample| {
            let (found, expected) = pair(s);
            let off = (found - expected).abs();
            if off.is_nan() { f64::INFINITY } else { off }
        };
        if let Some(worst) = samples.iter().max_by(|a, b| off(a).total_cmp(&off(b))) {
            let (found, expected) = pair(worst);
            self.near(
                &format!("{what} at t = {} s", worst.t_s),
                found,
                expected,
                within,
            );
        }
    }

    /// What holds for every run: it reached its end, its numbers are finite, its quaternions have length one, handles and gaps are where the pose has
    /// them, no contact pulls.
    pub fn sound(&mut self, run: &Run) {
        for s in &run.samples {
            let energy = s.energy.map(|e| e.unexplained_j);
            let angles = s.pose.roll_pitch_yaw_rad();
            let numbers = s.pose.position_m.iter().chain(&s.pose.velocity_m_per_s);
            let numbers = numbers
                .chain(&s.pose.spin_rad_per_s)
                .chain(&s.pose.orientation);
            let numbers = numbers.chain(&s.normal_n).chain(&angles);
            let numbers = numbers.chain(&s.phase_rad).chain(&energy);
            if !numbers
                .chain(s.tangential_n.iter().flatten())
                .all(|x| x.is_finite())
            {
                return self.fail(format!("a number at t = {} s is not finite", s.t_s));
            }
            let length: f64 = s.pose.orientation.iter().map(|x| x * x).sum();
            if (length - 1.0).abs() > 1e-12 {
                return self.fail(format!("|q|² = {length} at t = {} s", s.t_s));
            }
            let ties = run
                .scene
                .effects
                .contact
                .as_ref()
                .is_some_and(|c| c.bilateral);
            let turn = attitude(s);
            let centre = Vector3::from(s.pose.position_m);
            for (i, handle) in run.scene.carriers.handles_m.iter().enumerate() {
                let place = centre + turn * Vector3::from(*handle);
                let off = (place - Vector3::from(s.handle_m[i])).norm();
                let gap = s.shoulder_m[i][2] - s.handle_m[i][2] - s.compression_m[i];
                if !(off.max(gap.abs()) <= 1e-12 * (1.0 + place.norm() + s.shoulder_m[i][2].abs()))
                {
                    return self.fail(format!("handle {i} is {off:e} m and its gap {gap:e} m from where the pose has them at t = {} s", s.t_s));
                }
            }
            if !ties && s.normal_n.iter().any(|&n| n < 0.0) {
                return self.fail(format!("a contact pulls at t = {} s", s.t_s));
            }
        }
        let expected = (run.scene.duration_s * run.scene.log_rate_hz * (1.0 + 1e-12)).floor() + 1.0;
        if run.stopped.is_none() && run.samples.len() as f64 != expected {
            self.fail(format!(
                "{} samples, expected {expected}",
                run.samples.len()
            ));
        }
    }

    /// The run reached its end.
    pub fn ended(&mut self, run: &Run) {
        if let Some(cause) = &run.stopped {
            self.fail(format!("stopped: {cause}"));
        }
    }

    /// The energy ledger closes to `part` of what moved or is there.
    pub fn ledger(&mut self, run: &Run, part: f64) {
        self.ended(run);
        let (mut rest, mut scale) = (0.0f64, 0.0f64);
        let mut began_j = None;
        for (s, e) in run.samples.iter().filter_map(|s| Some((s, s.energy?))) {
            // The balance is struck here anew, from what the pose says.
            let [kinetic_j, potential_j] = body_j(run, s);
            let held_j = kinetic_j + potential_j + e.elastic_j;
            let began_j = *began_j.get_or_insert(held_j);
            let rest_j = held_j - began_j - e.work_in_j + e.dissipated_j;
            rest = rest.max(rest_j.abs()).max(e.unexplained_j.abs());
            let moved = e.work_in_j.abs() + e.dissipated_j.abs();
            scale = scale.max(moved + e.kinetic_j + e.elastic_j.abs());
        }
        self.at_most("unexplained energy, J", rest, part * scale.max(1e-9));
    }

    /// The motion of a load that is carried in step, from its height and velocity at the start, contact changes included where the method tells of
    /// them. A run may err by ten times its tolerance, times what the motion makes of a hair at its start; velocities and forces by as
    /// much of their own size.
    pub fn carried(&mut self, run: &Run, load: &Carried, start: [f64; 2]) {
        self.ended(run);
        let times: Vec<f64> = run.samples.iter().map(|s| s.t_s).collect();
        let pieces = load.course(start, run.scene.duration_s);
        let most = |of: fn(&Sample) -> f64| run.samples.iter().map(of).fold(1.0, f64::max);
        let size_m = most(|s| s.pose.position_m[2].abs());
        let within_m =
            10.0 * run.scene.solver.tolerance * size_m * load.growth(&pieces, start, &times);
        let rate = load.natural();
        let within_n = (load.k + load.c * rate) * within_m;
        let law = |s: &Sample| load.at(&pieces, s.t_s);
        self.every("height, m", &run.samples, within_m, |s| {
            (s.pose.position_m[2], law(s)[0])
        });
        self.every("velocity, m/s", &run.samples, within_m * rate, |s| {
            (s.pose.velocity_m_per_s[2], law(s)[1])
        });
        self.every("force, N", &run.samples, within_n, |s| {
            (s.normal_n.iter().sum(), law(s)[2])
        });
        if !run.method.locates {
            return;
        }
        for handle in 0..run.scene.carriers.count() {
            let told = run.events.iter().filter(|e| e.handle == handle);
            let (told, changes) = (told.collect::<Vec<_>>(), &pieces[1..]);
            if told.len() != changes.len() {
                return self.fail(format!(
                    "{} contact changes of handle {handle}, expected {}",
                    told.len(),
                    changes.len()
                ));
            }
            for (event, piece) in told.iter().zip(changes) {
                if (event.kind == EventKind::ContactClosed) != piece.closed {
                    return self.fail(format!("{:?} at t = {} s", event.kind, event.t_s));
                }
                let within_s = 1e-12 + within_n / load.passes_n_per_s(piece);
                self.near(
                    "moment of a contact change, s",
                    event.t_s,
                    piece.t_s,
                    within_s,
                );
            }
        }
    }

    /// Two runs are the same motion: height, roll, forces relative to `force_n`.
    pub fn same(&mut self, a: &[Sample], b: &[Sample], within: f64, force_n: f64) {
        if a.len() != b.len() {
            return self.fail(format!("{} samples beside {}", a.len(), b.len()));
        }
        let mut worst = [0.0f64; 3];
        for (x, y) in a.iter().zip(b) {
            let off = [
                x.pose.position_m[2] - y.pose.position_m[2],
                x.pose.roll_pitch_yaw_rad()[0] - y.pose.roll_pitch_yaw_rad()[0],
                (x.normal_n.iter().sum::<f64>() - y.normal_n.iter().sum::<f64>()) / force_n,
            ];
            for (w, o) in worst.iter_mut().zip(off) {
                *w = w.max(o.abs());
            }
        }
        for (what, off) in ["height, m", "roll, rad", "summed force, 1"]
            .iter()
            .zip(worst)
        {
            self.at_most(&format!("difference in {what}"), off, within);
        }
    }
}
