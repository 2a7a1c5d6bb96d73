//! The normals of a brick's facets as Hermite edges hold them.

use super::scan::ScanFacet;
use crate::brick::OctNormal;

/// Per facet of a brick: its normal, once needed. Kept from brick to brick.
#[derive(Default)]
pub(super) struct FacetNormals(Vec<Option<OctNormal>>);

impl FacetNormals {
    /// Begins a brick with this many facets.
    pub fn begin(&mut self, facets: usize) {
        self.0.clear();
        self.0.resize(facets, None);
    }

    /// The normal of a facet, of which this is the number.
    #[inline]
    pub fn of(&mut self, number: usize, facet: &ScanFacet) -> OctNormal {
        *self.0[number].get_or_insert_with(|| OctNormal::from_integer(facet.normal))
    }
}
