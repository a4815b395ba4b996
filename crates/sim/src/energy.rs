//! The energy ledger: what went in, what was dissipated, what is stored, and what is unexplained.
//!
//! ```text
//! unexplained = (K + P + S) − (K + P + S)_{t=0} − ∫ work + ∫ dissipation        [J]
//! ```
//! K kinetic and P potential in gravity, both in the frame that walks along (on a slope, what the walk itself climbs is in neither), S stored in springs. Work and dissipation of every
//! effect are states of their own, integrated by the same method as the motion, so the rest measures that method: it is
//! zero but for integration error. Nothing is renormalised or clipped to make it small.

use crate::lanes::sum;
use crate::model::{Model, Workspace};
use crate::scene::Scene;
use crate::solve::{Method, Settings};

/// What held at the start: K + P + S by the books, and what each account had lent ([`crate::model::Account::lent_j`]), J.
#[derive(Debug)]
pub(crate) struct Start {
    held_j: f64,
    lent_j: Vec<f64>,
}

/// The balance at one moment, J.
#[derive(Clone, Copy, Debug, PartialEq)]
#[allow(missing_docs)]
pub struct Energy {
    pub kinetic_j: f64,
    pub potential_j: f64,
    pub elastic_j: f64,
    pub work_in_j: f64,
    pub dissipated_j: f64,
    pub unexplained_j: f64,
}

impl Energy {
    /// The balance at an evaluated state, and in `shares_j` every account's work and dissipation; `at_start` keeps what held at the first
    /// call. `None` without a ledger.
    pub(crate) fn of(
        model: &Model,
        y: &[f64],
        w: &Workspace,
        shares_j: &mut [[f64; 2]],
        at_start: &mut Option<Start>,
    ) -> Option<Self> {
        if !model.scene.solver.energy {
            return None;
        }
        let [kinetic_j, potential_j] = model.freedoms().energy_j(y);
        let stored_j = model.stored_j(w);
        let held_j = kinetic_j + potential_j + stored_j;
        let start = at_start.get_or_insert_with(|| Start {
            held_j,
            lent_j: model.lent_j(w).collect(),
        });
        let (mut work_in_j, mut dissipated_j) = (0.0, 0.0);
        // By the books, lent energy is stored and none of it dissipated.
        let (mut all_lent_j, mut booked_j) = (0.0, 0.0);
        let pages = y[model.layout().ledger_range()].chunks_exact(2);
        let lent = model.lent_j(w).zip(&start.lent_j);
        for ((share, page), (lent_j, at_start_j)) in shares_j.iter_mut().zip(pages).zip(lent) {
            *share = [page[0], page[1] + lent_j - at_start_j];
            work_in_j += share[0];
            dissipated_j += share[1];
            all_lent_j += lent_j;
            booked_j += page[1];
        }
        let elastic_j = stored_j - all_lent_j;
        let unexplained_j = held_j - start.held_j - work_in_j + booked_j;
        Some(Self {
            kinetic_j,
            potential_j,
            elastic_j,
            work_in_j,
            dissipated_j,
            unexplained_j,
        })
    }
}

/// Whether a run can be believed, as it goes on.
///
/// A step that is too large makes energy out of nothing and often loses it in the dampers again, so neither the motion nor the
/// throughput tells. What can be in a motion is what it began with, what gravity gave, and what the shoulders did:
///
/// ```text
/// supplied = K₀ + S₀ + max(0, P₀ − P) + |∫ work|        [J]
/// ```
/// A run whose unexplained rest exceeds that is an artefact of its method, and stops; one whose method promises a tolerance stops at a
/// hundred times that part of it, and a thousandth at least. The floor is rounding, and what the tolerance allows in units of the body's `ledger_unit_j`.
///
/// A law may give back what it has taken, and one that is used beyond its range (straps that swing wider than they are long) may
/// give more, for ever. What springs hold and laws have taken is never less than nothing but for what springs held at first: a run in which
///
/// ```text
/// S + ∫ dissipation < S₀ − supplied
/// ```
/// stops too. Once over is far more than any law within its range lends: the built-in scenes stay within 1e-4 of it.
#[derive(Debug)]
pub(crate) struct Belief {
    part: f64,
    floor_j: f64,
    unit_j: f64,
    start: Option<Energy>,
    /// What straps may give back though no account calls it stored, J.
    lent_j: f64,
    most_work_j: f64,
    /// K + P at the start, J, where nobody keeps the account.
    begun_j: Option<f64>,
}

/// What is wrong with a run.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Doubt {
    /// The ledger does not explain so much.
    Unexplained { nowhere_j: f64, supplied_j: f64 },
    /// Laws gave so much more than they took.
    Given { given_j: f64, supplied_j: f64 },
}

/// Below this part of all energies a rest is rounding, or a matter of taste.
const FLOOR: f64 = 1e-6;

impl Belief {
    pub(crate) fn new(scene: &Scene, method: &Method, settings: &Settings) -> Self {
        let (part, allowed) = if method.locates {
            let part = 100.0 * settings.tolerance;
            (part.clamp(1e-3, 1.0), 10.0 * settings.tolerance)
        } else {
            (1.0, 0.0)
        };
        let unit_j = scene.body.ledger_unit_j();
        Self {
            part,
            floor_j: allowed * unit_j,
            unit_j,
            start: None,
            lent_j: 0.0,
            most_work_j: 0.0,
            begun_j: None,
        }
    }

    /// Whether laws might be found to give too much, were the account kept, from K and P alone. What is given goes into the motion,
    ///
    /// ```text
    /// S₀ − S − ∫ dissipation = (K + P) − (K + P)₀ − ∫ work − unexplained,        −∫ work < supplied
    /// ```
    /// so that nobody has given too much while K + P has not risen by the unit; half of it, because of what the ledger would not explain.
    pub(crate) fn might_doubt(&mut self, [kinetic_j, potential_j]: [f64; 2]) -> bool {
        let held_j = kinetic_j + potential_j;
        held_j - *self.begun_j.get_or_insert(held_j) > 0.5 * self.unit_j
    }

    /// What speaks against the run so far, if anything does.
    pub(crate) fn doubt(&mut self, e: &Energy, w: &Workspace) -> Option<Doubt> {
        let start = *self.start.get_or_insert_with(|| {
            self.lent_j = stretched_j(w);
            *e
        });
        self.most_work_j = self.most_work_j.max(e.work_in_j.abs());
        let fallen = (start.potential_j - e.potential_j).max(0.0);
        let supplied_j = start.kinetic_j + start.elastic_j.abs() + fallen + self.most_work_j;
        let all = supplied_j + e.kinetic_j + e.potential_j.abs() + start.potential_j.abs();
        let floor = FLOOR * all + self.floor_j;
        let nowhere_j = e.unexplained_j.abs();
        if nowhere_j > self.part * supplied_j + floor {
            return Some(Doubt::Unexplained {
                nowhere_j,
                supplied_j,
            });
        }
        let given_j = start.elastic_j - e.elastic_j - e.dissipated_j;
        (given_j > supplied_j + self.lent_j + self.unit_j).then_some(Doubt::Given {
            given_j,
            supplied_j,
        })
    }
}

/// ½ Σ |T_i·d_i| sideways, J.
fn stretched_j(w: &Workspace) -> f64 {
    let pairs = w.pair.iter();
    let twice = pairs.map(|p| sum(p.tangential[0] * p.gap[0] + p.tangential[1] * p.gap[1]).abs());
    0.5 * twice.sum::<f64>()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::load;
    use crate::solve::method;

    const UNIT_J: f64 = 60.0 * (1.0 + 9.81);

    fn balance(kinetic_j: f64, potential_j: f64, work_in_j: f64, unexplained_j: f64) -> Energy {
        Energy {
            kinetic_j,
            potential_j,
            elastic_j: 0.0,
            work_in_j,
            dissipated_j: 0.0,
            unexplained_j,
        }
    }

    /// Whether the last of some balances is doubted, and none before it.
    fn doubted(method_name: &str, tolerance: f64, all: &[Energy]) -> Option<Doubt> {
        let scene = load("music", &[]).unwrap();
        let (model, settings) = (
            Model::new(&scene),
            Settings {
                tolerance,
                step_s: 1e-3,
                most_evaluations: 1,
            },
        );
        let mut belief = Belief::new(&scene, method(method_name).unwrap(), &settings);
        let w = model.workspace();
        let (last, before) = all.split_last().unwrap();
        for e in before {
            assert_eq!(belief.doubt(e, &w), None);
        }
        belief.doubt(last, &w)
    }

    #[test]
    fn what_was_supplied_is_what_a_rest_is_held_against() {
        // 100 J at the start, 60 J fallen, 40 J of work at most, some of it taken back: 200 J.
        let story = |rest_j: f64| {
            [
                balance(100.0, 50.0, 0.0, 0.0),
                balance(120.0, 20.0, -40.0, 0.0),
                balance(90.0, -10.0, 5.0, rest_j),
            ]
        };
        for (name, tolerance, part) in [
            ("semi-implicit-euler", 1e-6, 1.0),
            ("dop853", 1e-6, 1e-3),
            ("dop853", 1e-4, 1e-2),
        ] {
            // Beside it a millionth of 200 + 90 + 10 + 50 J, and ten tolerances of 60 kg at 1.4 m/s and 1 m up.
            let allowed = if name == "dop853" {
                10.0 * tolerance
            } else {
                0.0
            };
            let most_j = part * 200.0 + 350e-6 + allowed * UNIT_J;
            for sign in [1.0, -1.0] {
                let doubt = |rest_j: f64| doubted(name, tolerance, &story(sign * rest_j));
                assert_eq!(doubt(0.9999 * most_j), None, "{name} {tolerance}");
                let supplied_j = 200.0;
                let nowhere_j = 1.0001 * most_j;
                assert_eq!(
                    doubt(nowhere_j),
                    Some(Doubt::Unexplained {
                        nowhere_j,
                        supplied_j
                    })
                );
            }
        }
    }

    /// The least that is doubted: nothing supplied but by shoulders that took it back, and all that laws gave in the motion.
    #[test]
    fn what_is_doubted_has_risen() {
        for (work_in_j, risen_j) in [(0.0, 1.001 * UNIT_J), (-500.0, 1.001 * UNIT_J)] {
            let start = balance(0.0, 50.0, 0.0, 0.0);
            let given_j = risen_j - work_in_j;
            let now = Energy {
                dissipated_j: -given_j,
                ..balance(risen_j - 20.0, 70.0, work_in_j, 0.0)
            };
            assert!(doubted("dop853", 1e-6, &[start, now]).is_some());
            let scene = load("music", &[]).unwrap();
            let method = method("dop853").unwrap();
            let mut belief = Belief::new(&scene, method, &crate::run::settings(&scene));
            let mut might = |e: &Energy| belief.might_doubt([e.kinetic_j, e.potential_j]);
            assert!(!might(&start) && might(&now));
        }
    }

    #[test]
    fn laws_that_give_more_than_was_supplied_are_doubted() {
        let given = |elastic_j: f64, dissipated_j: f64| {
            let start = Energy {
                elastic_j: 30.0,
                ..balance(100.0, 0.0, 0.0, 0.0)
            };
            let now = Energy {
                elastic_j,
                dissipated_j,
                ..balance(100.0, 0.0, 0.0, 0.0)
            };
            matches!(
                doubted("dop853", 1e-6, &[start, now]),
                Some(Doubt::Given {
                    supplied_j: 130.0,
                    ..
                })
            )
        };
        // As much as was supplied, 130 J, and the unit of the body's energy may be given, and what springs gave counts.
        let most_j = 130.0 + UNIT_J;
        assert!(!given(0.0, 30.0 - 0.999 * most_j) && given(0.0, 30.0 - 1.001 * most_j));
        assert!(!given(30.0 - 0.999 * most_j, 0.0) && given(30.0 - 1.001 * most_j, 0.0));
    }
}
