//! The dynamics of things that people carry together: a [`scene::Scene`] becomes a [`model::Model`], which a
//! [`solve::Method`] integrates into samples.

pub mod accuracy;
pub mod beat;
pub mod body;
pub mod cases;
pub mod effects;
pub mod energy;
pub mod freedoms;
pub mod lanes;
pub mod model;
pub mod random;
pub mod record;
pub mod remarks;
pub mod replay;
pub mod run;
pub mod scene;
pub mod sensors;
pub mod solve;
pub mod spline;
