//! The Jacobian of the right-hand side, by forward automatic differentiation eight columns at a time.

use super::term::Staged;
use super::{Model, OnEight, Pair, Stage, Workspace};
use crate::lanes::{LANES, MOMENTS, Number, Slope, Slopes, Two};
use nalgebra::DMatrix;

/// Derivatives of a model's rates by its states.
///
/// They are those of the branch that a state is on: contacts as the segment has them, at a kink those of one side
/// ([`crate::lanes::Slope`]).
#[derive(Clone)]
pub(crate) struct Differentiator<'m> {
    model: &'m Model,
    terms: Staged<&'m dyn OnEight>,
    w: Workspace<Slopes>,
    y: Vec<Slope>,
    dy: Vec<Slope>,
}

impl<'m> Differentiator<'m> {
    /// For a model in the state of a workspace.
    pub fn new(model: &'m Model, w: &Workspace) -> Self {
        let mut own = Workspace::blank();
        w.spread(&mut own);
        let blank = vec![Slope::splat(0.0); model.layout.ledger_range().start];
        Self {
            model,
            terms: model.terms.map(|t| t.on_eight()),
            w: own,
            y: blank.clone(),
            dy: blank,
        }
    }

    /// How many times all terms are gone through for one Jacobian.
    pub fn sweeps(&self) -> usize {
        self.y.len().div_ceil(MOMENTS)
    }

    /// ∂f_j/∂y_d of all states but the ledger's, on which nothing depends, into row j, column d.
    pub fn jacobian(&mut self, t_s: f64, y: &[f64], w: &Workspace, to: &mut DMatrix<f64>) {
        w.refresh(&mut self.w);
        for first in (0..self.y.len()).step_by(MOMENTS) {
            for (d, (slope, y)) in self.y.iter_mut().zip(y).enumerate() {
                *slope = Slope::splat(*y);
                if let Some(direction) = d.checked_sub(first).filter(|k| *k < MOMENTS) {
                    slope.along[direction] = 1.0;
                }
            }
            self.evaluate(Slope::splat(t_s));
            let columns = MOMENTS.min(self.y.len() - first);
            for (j, rate) in self.dy.iter().enumerate() {
                for k in 0..columns {
                    to[(j, first + k)] = rate.along[k];
                }
            }
        }
    }

    /// As [`Model::rhs_of_motion`].
    fn evaluate(&mut self, t_s: Slope) {
        let (layout, freedoms) = (&self.model.layout, self.model.freedoms());
        let (phases, extra) = (layout.phase_range(), layout.extra_range());
        let w = &mut self.w;
        w.extra.copy_from_slice(&self.y[extra.clone()]);
        w.pair.iter_mut().for_each(Pair::stand);
        let apply = |stage: Stage, w: &mut Workspace<Slopes>| {
            let terms = self.terms.of(stage).iter();
            terms.for_each(|term| term.slopes(t_s, w));
        };
        if self.model.has_phases {
            for (p, phase) in w.pair.iter_mut().zip(self.y[phases.clone()].chunks(LANES)) {
                let second = phase.get(1).copied().unwrap_or(Slope::splat(0.0));
                (p.sin, p.cos) = Two([phase[0], second]).sin_cos();
                p.rate = p.constant_rate;
            }
            apply(Stage::Clock, w);
            apply(Stage::Phases, w);
            apply(Stage::Shoulders, w);
        }
        w.body_torque = [Slope::splat(0.0); 3];
        apply(Stage::Party, w);
        freedoms.gaps_slopes(&self.y, w);
        if self.model.looks_at_body {
            freedoms.orient_slopes(&self.y, w);
            w.t_s = t_s;
            w.free_fall = <[f64; 3]>::from(self.model.body.gravity_m_per_s2).map(Slope::splat);
            apply(Stage::Bends, w);
        }
        apply(Stage::Handles, w);
        apply(Stage::Body, w);
        freedoms.rates_slopes(&self.y, w, &mut self.dy);
        for (p, rate) in w.pair.iter().zip(self.dy[phases].chunks_mut(LANES)) {
            rate.copy_from_slice(&p.rate.0[..rate.len()]);
        }
        self.dy[extra].copy_from_slice(&w.extra_rate);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::{BUILTIN, parse};

    /// Every effect that has a say in the motion, but for what was measured, which has the last word.
    const EVERYTHING: &str = include_str!("../../tests/everything.toml");

    /// The largest difference between the Jacobian and central differences with one step of extrapolation, in parts of the largest number of
    /// each column.
    fn apart(model: &Model) -> f64 {
        let (t_s, mut y, mut w) = (7.01, model.initial_state(), model.workspace());
        for (k, y) in y.iter_mut().enumerate() {
            *y += 0.01 * (1.0 + k as f64).sin();
        }
        model.freedoms().project(&mut y);
        model.begin_segment(7.0, &mut w);
        let mut differentiator = Differentiator::new(model, &w);
        let watched = model.layout().ledger_range().start;
        let mut jacobian = DMatrix::from_element(watched, watched, f64::NAN);
        differentiator.jacobian(t_s, &y, &w, &mut jacobian);
        let mut rates = |y: &[f64]| {
            let mut dy = vec![0.0; y.len()];
            model.rhs_of_motion(t_s, y, &mut dy, &mut w);
            dy
        };
        let here = rates(&y);
        for (slope, rate) in differentiator.dy.iter().zip(&here) {
            assert!((slope.here - rate).abs() < 1e-12 * (1.0 + rate.abs()));
        }
        let mut worst: f64 = 0.0;
        for d in 0..watched {
            let mut central = |h: f64| -> Vec<f64> {
                let (mut plus, mut minus) = (y.clone(), y.clone());
                (plus[d], minus[d]) = (y[d] + h, y[d] - h);
                let (plus, minus) = (rates(&plus), rates(&minus));
                plus.iter()
                    .zip(minus)
                    .map(|(a, b)| (a - b) / (2.0 * h))
                    .collect()
            };
            let (whole, half) = (central(2e-4), central(1e-4));
            let column = jacobian.column(d);
            for j in 0..watched {
                let by_differences = (4.0 * half[j] - whole[j]) / 3.0;
                worst = worst.max((column[j] - by_differences).abs() / (1.0 + column.amax()));
            }
        }
        worst
    }

    #[test]
    fn derivatives_are_those_of_small_differences() {
        let model = |name: &str, text: &str, settings: &[&str]| {
            let settings: Vec<String> = settings.iter().map(|s| (*s).to_owned()).collect();
            Model::new(&parse(name, text, &settings).unwrap_or_else(|e| panic!("{name}: {e}")))
        };
        for (name, text) in BUILTIN {
            let apart = apart(&model(name, text, &[]));
            assert!(apart < 1e-7, "{name}: {apart:e}");
        }
        let measured = "effects.measured={t_s=[0,20,40,60],phase_rad=[[0,251,502,753],[1,250,503,754],[2,252,500,750]],\
            shoulder_m=[[[2.4,0.3,1.4],[2.4,0.3,1.41],[2.5,0.3,1.39],[2.4,0.2,1.4]],\
            [[2.3,-0.3,1.4],[2.4,-0.3,1.41],[2.5,-0.3,1.39],[2.4,-0.2,1.4]],\
            [[-2.4,0.3,1.4],[-2.4,0.3,1.41],[-2.5,0.3,1.39],[-2.4,0.2,1.4]]]}";
        for settings in [
            &[
                "effects.path.turn_deg=0",
                "freedom=['height','roll']",
                "start.angular_velocity_rad_per_s=[0.3,0,0]",
            ][..],
            &[
                "effects.path.turn_deg=0",
                "freedom=['height','roll','tilt']",
                "start.angular_velocity_rad_per_s=[0.3,0.2,-0.0105]",
            ],
            &[
                "effects.path.turn_deg=0",
                "freedom=['y','height','roll','tilt','yaw']",
            ],
            &[
                "effects.path.turn_deg=0",
                "freedom=['tilt']",
                "start.angular_velocity_rad_per_s=[0,0.2,-0.0105]",
            ],
            &[
                "effects.contact.law='hunt-crossley'",
                "effects.contact.exponent=1.5",
            ],
            &[
                "effects.contact.bilateral=true",
                "effects.coupling.graph='all'",
            ],
            &["effects.path.turn_deg=0", measured],
        ] {
            let apart = apart(&model("everything", EVERYTHING, settings));
            assert!(apart < 1e-7, "{settings:?}: {apart:e}");
        }
        let alone = EVERYTHING
            .replace("[effects.hold]", "")
            .replace("[effects.sling]", "");
        let apart = apart(&model(
            "bristles",
            &alone,
            &["effects.friction.law='bristle'"],
        ));
        assert!(apart < 1e-7, "bristles: {apart:e}");
    }
}
