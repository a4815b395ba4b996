//! The energy ledger: what went in, what was dissipated, what is stored, and what is unexplained.
//!
//! ```text
//! unexplained = (K + P + S) − (K + P + S)_{t=0} − ∫ work + ∫ dissipation        [J]
//! ```
//! K kinetic (in the frame that walks along), P potential in gravity, S stored in springs. Work and dissipation of every
//! effect are states of their own, integrated by the same method as the motion, so the rest measures that method: it is
//! zero but for integration error. Nothing is renormalised or clipped to make it small.

use crate::model::{Model, Workspace};

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
    /// The balance at an evaluated state; `at_start_j` keeps K + P + S of the first call. `None` without a ledger.
    pub(crate) fn of(
        model: &Model,
        y: &[f64],
        w: &Workspace,
        at_start_j: &mut Option<f64>,
    ) -> Option<Self> {
        if !model.scene.solver.energy {
            return None;
        }
        let [kinetic_j, potential_j] = model.freedoms().energy_j(y);
        let elastic_j = model.stored_j(w);
        let held_j = kinetic_j + potential_j + elastic_j;
        let began_j = *at_start_j.get_or_insert(held_j);
        let (mut work_in_j, mut dissipated_j) = (0.0, 0.0);
        for page in y[model.layout().ledger_range()].chunks_exact(2) {
            work_in_j += page[0];
            dissipated_j += page[1];
        }
        let unexplained_j = held_j - began_j - work_in_j + dissipated_j;
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
