//! Volumes of all voids or solids together, with what they may be off by.

use super::labelling::Labelling;
use super::measure::Sums;
use crate::analysis::spread;
use crate::lattice::RootCube;

/// A volume, or a share of one, and a bound on its error.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Total {
    /// In the cube of the tree's unit.
    pub value: f64,
    /// Bound on its error.
    pub error: f64,
}

impl Total {
    /// The mean over the chords of some sums along three axes: the spread of these, and twice their mean's distance from the
    /// number of samples.
    pub(super) fn of(sums: &Sums, root: RootCube) -> Total {
        let volumes = sums.volumes(root);
        let value = volumes.iter().sum::<f64>() / 3.0;
        Total { value, error: spread(volumes) + 2.0 * (sums.counted(root) - value).abs() }
    }

    /// With an error that is no smaller than what another measure of the same shows it to be off by.
    #[must_use]
    pub fn not_nearer_than(self, other: Total) -> Total {
        Total { error: self.error.max((self.value - other.value).abs() + other.error), ..self }
    }

    /// This volume over that of itself and `solid`: of voids, the porosity.
    pub fn share_beside(self, solid: Total) -> Total {
        let whole = self.value + solid.value;
        if whole <= 0.0 {
            return Total::default();
        }
        // What the boundary between both is off by, one gains and the other loses, so errors may add up.
        let error = (solid.value * self.error + self.value * solid.error) / (whole * whole);
        Total { value: self.value / whole, error: error.min(1.0) }
    }
}

impl Labelling {
    /// The volume of all voids, or of all solids, by chords.
    ///
    /// Sums are added up before they are compared, as a void may be too large and the next one too small: such errors cancel,
    /// and those that all voids share stay. The bounds of single voids would add up to as much as the voids themselves.
    pub fn total(&self, root: RootCube, solid: bool) -> Total {
        let mut sums = Sums::default();
        self.components.iter().filter(|c| c.solid == solid).for_each(|c| sums.add(&c.sums));
        Total::of(&sums, root)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shares_are_off_by_what_both_volumes_are() {
        let void = Total { value: 1.0, error: 0.1 };
        let share = void.share_beside(Total { value: 9.0, error: 0.3 });
        assert!((share.value - 0.1).abs() < 1e-12 && (share.error - 0.012).abs() < 1e-12, "{share:?}");
        // The worst of all corners is hardly more.
        let worst = (1.1 / (1.1 + 8.7) - 0.1f64).abs();
        assert!(worst < share.error * 1.1, "{worst}");
        assert_eq!(Total::default().share_beside(Total::default()), Total::default());
        let other = Total { value: 1.3, error: 0.05 };
        assert!((void.not_nearer_than(other).error - 0.35).abs() < 1e-12);
    }
}
