//! From crossings to Hermite edges: on each sign-changing lattice edge, the point where the running count
//! passes 0.5 and the normal of the facet there.

use super::crossings::{Crossings, Hit};
use super::evaluate::Triangles;
use crate::brick::{HermiteEdge, OctNormal, Samples};
use crate::lattice::normal;

/// Working memory, kept from brick to brick.
#[derive(Default)]
pub(super) struct Resolver {
    /// Per triangle of the brick: its normal, once needed.
    normals: Vec<Option<OctNormal>>,
    /// Crossings of one edge that holds several.
    shared: Vec<Candidate>,
}

/// A crossing on an edge that holds several; in the order in which they are passed. Crossings with the same
/// offset count as one step, and the rest of the order makes the choice among them independent of the
/// order of the triangles.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
struct Candidate {
    offset: u16,
    normal: OctNormal,
    jump: i32,
}

impl Resolver {
    /// Begins a brick with this many triangles.
    pub fn begin(&mut self, triangles: usize) {
        self.normals.clear();
        self.normals.resize(triangles, None);
    }

    /// The Hermite edge of a sign-changing lattice edge, given the number of its last crossing.
    #[inline]
    pub fn resolve(
        &mut self,
        last: u32,
        crossings: &Crossings,
        samples: &Samples,
        list: Triangles<'_>,
    ) -> HermiteEdge {
        let hit = crossings.get(last);
        if hit.is_first() {
            HermiteEdge { offset: hit.offset, normal: self.normal(hit, list) }
        } else {
            self.resolve_shared(last, crossings, i32::from(samples.0[usize::from(hit.lower)]), list)
        }
    }

    #[inline]
    fn normal(&mut self, hit: Hit, list: Triangles<'_>) -> OctNormal {
        *self.normals[hit.position()]
            .get_or_insert_with(|| OctNormal::from_integer(normal(list.get(hit.position()))))
    }

    /// Decides an edge that holds several crossings, from the winding number at its lower sample.
    fn resolve_shared(
        &mut self,
        last: u32,
        crossings: &Crossings,
        start: i32,
        list: Triangles<'_>,
    ) -> HermiteEdge {
        let mut shared = std::mem::take(&mut self.shared);
        shared.clear();
        shared.extend(crossings.chain(last).map(|hit| Candidate {
            offset: hit.offset,
            normal: self.normal(hit, list),
            jump: hit.jump(),
        }));
        shared.sort_unstable();
        let edge = first_passage(start, &shared);
        self.shared = shared;
        edge
    }
}

/// The first step at which the running count passes 0.5, from crossings in order of their offset.
fn first_passage(start: i32, crossings: &[Candidate]) -> HermiteEdge {
    let mut w = start;
    for step in crossings.chunk_by(|a, b| a.offset == b.offset) {
        let before = w;
        w += step.iter().map(|c| c.jump).sum::<i32>();
        if (before >= 1) != (w >= 1) {
            let direction = if w > before { 1 } else { -1 };
            // Of facets that coincide here, the one with the smallest code.
            let normal = step.iter().find(|c| c.jump == direction).expect("the count moved this way").normal;
            return HermiteEdge { offset: step[0].offset, normal };
        }
    }
    unreachable!("the edge changes sign, so its crossings pass 0.5")
}
