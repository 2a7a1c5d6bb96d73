//! What voids are taken for.

/// What a void is taken for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Class {
    /// A cavity of the part.
    Pocket,
    /// A cell of sparse infill.
    Infill,
    /// Neither: a gap between beads.
    Flaw,
}

impl Class {
    /// Its name in tables.
    pub fn name(self) -> &'static str {
        match self {
            Class::Pocket => "pocket",
            Class::Infill => "infill",
            Class::Flaw => "flaw",
        }
    }
}
