//! Numbers that carriers may share or have each.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// One number for all carriers, or one for each.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged)]
pub enum PerCarrier {
    /// The same for all.
    Same(f64),
    /// One for each, in the order of the handles.
    Each(Vec<f64>),
}

impl PerCarrier {
    /// The number of carrier `i`.
    pub fn get(&self, i: usize) -> f64 {
        match self {
            Self::Same(x) => *x,
            Self::Each(list) => list[i],
        }
    }

    /// Every number given.
    pub fn values(&self) -> &[f64] {
        match self {
            Self::Same(x) => std::slice::from_ref(x),
            Self::Each(list) => list,
        }
    }
}

impl From<f64> for PerCarrier {
    fn from(x: f64) -> Self {
        Self::Same(x)
    }
}
