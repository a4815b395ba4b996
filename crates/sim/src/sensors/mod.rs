//! What instruments on the body and on the carriers would show: each samples the motion at moments of its own.
//!
//! Sensors watch and never touch: they add no state and no term, and a run without them takes the same steps.

pub mod drum;
pub mod imu;

pub use imu::{Imu, Reading};

use crate::model::{Model, Workspace};

/// Moments at which sensors sample: t_k = k/rate, k = 0, 1, … in true time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Clock {
    /// Ticks per second of true time, Hz.
    pub rate_hz: f64,
}

/// The instruments of one run, with what they remember from one sample to the next.
pub struct Sensors<'m> {
    model: &'m Model,
    memories: Vec<imu::Memory>,
    /// Scratch: rates of the state, the state at a neighbouring moment, accelerations of the shoulders.
    dy: Vec<f64>,
    near: Vec<f64>,
    shoulders: Vec<[f64; 3]>,
}

impl<'m> Sensors<'m> {
    /// Switches every instrument of `model` on.
    pub fn new(model: &'m Model) -> Self {
        let size = if model.imus().is_empty() {
            0
        } else {
            model.layout().size()
        };
        Self {
            model,
            memories: model.imus().iter().map(Imu::switch_on).collect(),
            dy: vec![0.0; size],
            near: vec![0.0; size],
            shoulders: vec![[0.0; 3]; if size > 0 { model.carriers() } else { 0 }],
        }
    }

    /// Takes the readings of every instrument on `clock` at its tick number `tick`, at time `t_s` and state `y`.
    pub fn read(
        &mut self,
        clock: usize,
        tick: u64,
        t_s: f64,
        y: &[f64],
        w: &mut Workspace,
        mut sink: impl FnMut(&Reading<'_>),
    ) {
        let model = self.model;
        model.rhs(t_s, y, &mut self.dy, w);
        let pose = model.freedoms().pose(y);
        let [linear, angular] = model.freedoms().acceleration(y, &self.dy);
        let on_body = imu::BodyMotion {
            pose,
            linear_m_per_s2: linear,
            angular_rad_per_s2: angular,
        };
        let here = |imu: &Imu| imu.clock == clock && imu.is_on_a_carrier();
        let on_carriers = model.imus().iter().any(here);
        if on_carriers {
            let (near, out) = (&mut self.near, &mut self.shoulders);
            imu::shoulder_accelerations(model, t_s, y, &self.dy, w, near, out);
        }
        let party = on_carriers.then(|| imu::PartyMotion {
            shoulders_m_per_s2: &self.shoulders,
            heading: model.heading(t_s),
        });
        for (imu, memory) in model
            .imus()
            .iter()
            .zip(&mut self.memories)
            .filter(|(imu, _)| imu.clock == clock)
        {
            let truth = imu.truth(&on_body, party, model.body.gravity_m_per_s2.into());
            if let Some(reading) = imu.measure(tick, t_s, truth, memory) {
                sink(&reading);
            }
        }
    }
}
