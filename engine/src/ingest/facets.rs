//! The view of an input that the passes over it share.

use super::{Facet, Input};
use std::ops::Range;

/// Anything that yields the triangles of a soup by number.
pub trait Facets: Sync {
    /// Number of triangles.
    fn facets(&self) -> u64;
    /// Replaces `out` by the triangles of `range`, in world coordinates.
    fn read(&self, range: Range<u64>, out: &mut Vec<Facet>);
}

impl Facets for Input {
    fn facets(&self) -> u64 {
        Input::facets(self)
    }

    fn read(&self, range: Range<u64>, out: &mut Vec<Facet>) {
        Input::read(self, range, out);
    }
}

impl Facets for Vec<Facet> {
    fn facets(&self) -> u64 {
        self.len() as u64
    }

    fn read(&self, range: Range<u64>, out: &mut Vec<Facet>) {
        out.clear();
        out.extend_from_slice(&self[range.start as usize..range.end as usize]);
    }
}

/// Triangles decoded at a time: as f64 and snapped they take 1.7 MB, about an L2 cache.
const RUN_FACETS: u64 = 1 << 14;

/// All triangles of several sources in runs: (number of the source, range of its triangles).
pub fn runs(sources: &[&dyn Facets]) -> Vec<(usize, Range<u64>)> {
    let of_source = |(number, source): (usize, &&dyn Facets)| {
        let facets = source.facets();
        let starts = (0..facets).step_by(RUN_FACETS as usize);
        starts.map(move |s| (number, s..facets.min(s + RUN_FACETS))).collect::<Vec<_>>()
    };
    sources.iter().enumerate().flat_map(of_source).collect()
}
