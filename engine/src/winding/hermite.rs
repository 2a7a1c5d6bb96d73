//! From crossings to Hermite edges: on each sign-changing lattice edge, the point where the running count
//! passes 0.5 and the normal of the facet there.

use super::crossings::{Cause, Crossings};
use super::evaluate::Triangles;
use super::passages::{Passage, Passing, first_passage};
use crate::brick::{HermiteEdge, OctNormal, Samples};
use crate::lattice::normal;

/// Working memory, kept from brick to brick.
#[derive(Default)]
pub(super) struct Resolver {
    /// Per triangle of the brick: its normal, once needed.
    normals: Vec<Option<OctNormal>>,
    /// Crossings of one edge that holds several.
    shared: Vec<Passage>,
}

impl Resolver {
    /// Begins a brick with this many triangles.
    pub fn begin(&mut self, triangles: usize) {
        self.normals.clear();
        self.normals.resize(triangles, None);
    }

    /// The Hermite edge of a sign-changing lattice edge, given the number of its last crossing.
    #[inline(always)]
    pub fn resolve(
        &mut self,
        last: u32,
        crossings: &Crossings,
        samples: &Samples,
        list: Triangles<'_>,
    ) -> HermiteEdge {
        let hit = crossings.get(last);
        if hit.is_first() {
            return HermiteEdge { offset: hit.offset, normal: self.normal_of(hit.cause, list) };
        }
        self.resolve_shared(samples.0[usize::from(hit.lower)], last, crossings, list)
    }

    /// The normal of the triangle at a position of the brick's list, given twice its area vector.
    #[inline]
    pub fn normal(&mut self, position: usize, area: impl FnOnce() -> [i64; 3]) -> OctNormal {
        *self.normals[position].get_or_insert_with(|| OctNormal::from_integer(area()))
    }

    #[inline]
    fn normal_of(&mut self, cause: Cause, list: Triangles<'_>) -> OctNormal {
        self.normal(cause.position(), || normal(list.get(cause.position())))
    }

    /// Decides an edge that holds several crossings, from the winding number at its lower sample.
    #[inline(never)]
    fn resolve_shared(
        &mut self,
        start: i16,
        last: u32,
        crossings: &Crossings,
        list: Triangles<'_>,
    ) -> HermiteEdge {
        let mut shared = std::mem::take(&mut self.shared);
        shared.clear();
        shared.extend(crossings.chain(last).map(|hit| {
            let normal = self.normal_of(hit.cause, list);
            Passage { place: 0, offset: hit.offset, passing: Passing::new(hit.cause.jump(), normal) }
        }));
        shared.sort_unstable_by_key(|passage| passage.offset);
        let edge = first_passage(start, &shared);
        self.shared = shared;
        edge.expect("the edge changes sign, so its crossings pass 0.5")
    }
}
