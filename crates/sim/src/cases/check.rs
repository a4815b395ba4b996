//! How what must hold is held against what was found.

use super::Run;
use crate::run::Sample;

/// The checks of one run: how much of their bounds they used, and the first that broke.
#[derive(Default)]
pub struct Checks {
    pub used: f64,
    pub broken: Option<String>,
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

    /// What holds for every run: it reached its end, its numbers are finite, its quaternions have length one, no contact pulls.
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
        for e in run.samples.iter().filter_map(|s| s.energy) {
            rest = rest.max(e.unexplained_j.abs());
            let moved = e.work_in_j.abs() + e.dissipated_j.abs();
            scale = scale.max(moved + e.kinetic_j + e.elastic_j.abs());
        }
        self.at_most("unexplained energy, J", rest, part * scale.max(1e-9));
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
