//! What the tests share: a scene from text, its samples, and a linear fit.
#![allow(dead_code)]

use sim::model::Model;
use sim::run::{Listener, Sample, run};
use sim::scene::{Scene, parse};
use sim::sensors::Reading;

/// A checked scene.
pub fn scene(text: &str) -> Scene {
    parse("test", text, &[]).unwrap_or_else(|e| panic!("{e}"))
}

/// Every sample of a run.
pub fn samples(scene: &Scene) -> Vec<Sample> {
    let mut all = Vec::new();
    run(scene, &mut |s: &Sample| {
        all.push(s.clone());
        true
    })
    .unwrap_or_else(|e| panic!("{e}"));
    all
}

/// A reading that outlives its instrument: topic, time, stamp, ω, f.
#[derive(Clone, Debug, PartialEq)]
pub struct Shown {
    pub topic: String,
    pub t_s: f64,
    pub stamp_s: f64,
    pub spin: [f64; 3],
    pub force: [f64; 3],
}

struct Readings(Vec<Shown>, Vec<Sample>);

impl Listener for Readings {
    fn sample(&mut self, sample: &Sample) -> bool {
        self.1.push(sample.clone());
        true
    }
    fn reading(&mut self, r: &Reading<'_>) {
        self.0.push(Shown {
            topic: r.topic.into(),
            t_s: r.t_s,
            stamp_s: r.stamp_s,
            spin: r.angular_velocity_rad_per_s,
            force: r.specific_force_m_per_s2,
        });
    }
}

/// Every reading and every sample of a run.
pub fn readings(scene: &Scene) -> (Vec<Shown>, Vec<Sample>) {
    let mut all = Readings(Vec::new(), Vec::new());
    run(scene, &mut all).unwrap_or_else(|e| panic!("{e}"));
    (all.0, all.1)
}

/// The derivative at the scene's start and the names of the states.
pub fn rates_at_start(scene: &Scene) -> (Vec<String>, Vec<f64>) {
    let model = Model::new(scene);
    let (y, mut w) = (model.initial_state(), model.workspace());
    model.begin_segment(0.0, &mut w);
    let mut dy = vec![0.0; y.len()];
    model.rhs(0.0, &y, &mut dy, &mut w);
    (model.state_names(), dy)
}
