//! An [`Analysis`](crate::examine::Analysis) as people and programs read it. Every output takes its metrics from the one table
//! in [`mod@crate::metrics`].

mod csv;
mod ensemble;
mod ensemble_plots;
#[cfg(feature = "figures")]
pub mod figures;
mod html;
mod json;
pub mod plots;
mod table;

pub use csv::{csv, exact, quoted};
pub use ensemble::ensemble;
pub use ensemble_plots::ensemble_plots;
pub use html::html;
pub use json::json;
pub use table::table;
