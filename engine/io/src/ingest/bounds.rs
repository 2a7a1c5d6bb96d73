//! The box around all facets, and the search for the first facet that is not finite.

use crate::error::Result;
use crate::progress::Progress;
use rayon::prelude::*;
use std::ops::Range;

/// Facets per task: 3 MB of binary STL, enough to hide the cost of a task and small enough to share out.
const CHUNK: u64 = 1 << 16;

/// The box around some facets, and the first of them that has none.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct FacetBounds {
    low: [f64; 3],
    high: [f64; 3],
    /// First facet with a NaN or infinite coordinate; the box means nothing then.
    bad: Option<u64>,
}

impl FacetBounds {
    /// Of no facets.
    pub(super) const EMPTY: FacetBounds =
        FacetBounds { low: [f64::INFINITY; 3], high: [f64::NEG_INFINITY; 3], bad: None };

    /// Of facets of which `facet` is the first that is not finite.
    pub(super) fn bad(facet: u64) -> FacetBounds {
        FacetBounds { bad: Some(facet), ..FacetBounds::EMPTY }
    }

    /// Extent of `facets`, numbered from 0.
    pub(super) fn of<T: Copy + Into<f64>>(facets: impl Iterator<Item = [[T; 3]; 3]>) -> FacetBounds {
        let mut extent = FacetBounds::EMPTY;
        for (number, facet) in facets.enumerate() {
            let facet = facet.map(|corner| corner.map(Into::into));
            if !facet.as_flattened().iter().all(|c| c.is_finite()) {
                return FacetBounds::bad(number as u64);
            }
            facet.into_iter().for_each(|corner| extent.include(corner));
        }
        extent
    }

    /// The same of facets of which `first` come before.
    pub(super) fn counted_from(self, first: u64) -> FacetBounds {
        FacetBounds { bad: self.bad.map(|facet| first + facet), ..self }
    }

    /// Lower and upper corner of the box, or the number of the first facet that is not finite.
    pub(super) fn corners(self) -> std::result::Result<([f64; 3], [f64; 3]), u64> {
        match self.bad {
            Some(facet) => Err(facet),
            // Adding zero turns −0 into +0: which of the two came first must not show.
            None => Ok((self.low.map(|c| c + 0.0), self.high.map(|c| c + 0.0))),
        }
    }

    /// Grows the box to `point`.
    #[inline]
    pub(super) fn include(&mut self, point: [f64; 3]) {
        for (axis, &c) in point.iter().enumerate() {
            self.low[axis] = if c < self.low[axis] { c } else { self.low[axis] };
            self.high[axis] = if c > self.high[axis] { c } else { self.high[axis] };
        }
    }

    /// Of the facets of both.
    pub(super) fn union(mut self, other: FacetBounds) -> FacetBounds {
        for a in 0..3 {
            self.low[a] = self.low[a].min(other.low[a]);
            self.high[a] = self.high[a].max(other.high[a]);
        }
        self.bad = match (self.bad, other.bad) {
            (Some(a), Some(b)) => Some(a.min(b)),
            (a, b) => a.or(b),
        };
        self
    }
}

/// Extent of `facets` facets. `extent_of` measures a range of them, numbering them from 0 within the range. Runs
/// on all threads; the result does not depend on their number.
///
/// # Errors
/// If the user interrupts.
pub(super) fn of_all(
    facets: u64,
    progress: &dyn Progress,
    extent_of: impl Fn(Range<u64>) -> FacetBounds + Sync,
) -> Result<FacetBounds> {
    progress.phase("measuring", Some(facets), "triangles");
    // Handed out in order, so that all threads together read the file from front to back.
    (0..facets.div_ceil(CHUNK))
        .par_bridge()
        .map(|chunk| {
            progress.check()?;
            let range = chunk * CHUNK..facets.min((chunk + 1) * CHUNK);
            let extent = extent_of(range.clone()).counted_from(range.start);
            progress.advance(range.end - range.start);
            Ok(extent)
        })
        .try_reduce(|| FacetBounds::EMPTY, |a, b| Ok(a.union(b)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_facets_add_nothing_from_either_side() {
        let some = FacetBounds::of([[[1.0, 2.0, 3.0], [4.0, -5.0, 6.0], [0.0; 3]]].into_iter());
        assert_eq!(some.union(FacetBounds::EMPTY), some);
        assert_eq!(FacetBounds::EMPTY.union(some), some);
    }
}
