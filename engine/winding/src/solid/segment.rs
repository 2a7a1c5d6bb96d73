//! One segment of a bead.

use crate::lattice::Units;

/// One segment of a bead. Its ends lie on the bead's centre line, half the height below the path of the tool.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Segment {
    /// One end, in lattice units.
    pub a: Units,
    /// The other end.
    pub b: Units,
    /// Number of its profile in [`super::Solids`].
    pub profile: u32,
    /// Number of its pass, or of its bead where beads are counted, through all toolpaths.
    pub pass: u32,
}

impl Segment {
    /// Length of the centre line, in units.
    #[inline]
    pub fn length(&self) -> f64 {
        let along = [0, 1, 2].map(|i| f64::from(self.b[i] - self.a[i]));
        (along[0] * along[0] + along[1] * along[1] + along[2] * along[2]).sqrt()
    }
}
