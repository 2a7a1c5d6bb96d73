//! What samples of beads count.

use serde::{Deserialize, Serialize};
use std::fmt;

/// What the samples of beads as solids count.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Count {
    /// Passes: stretches of a bead that do not come back onto themselves.
    #[default]
    Passes,
    /// Beads as a whole.
    Beads,
}

impl fmt::Display for Count {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Count::Passes => "passes",
            Count::Beads => "beads",
        })
    }
}
