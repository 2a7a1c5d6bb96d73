//! From crossings to Hermite edges: on each sign-changing lattice edge, the point where the running count
//! passes 0.5 and the normal of the facet there.

use super::crossings::{Cause, Crossings};
use super::evaluate::Triangles;
use crate::brick::{HermiteEdge, OctNormal, Samples};
use crate::lattice::normal;

/// Working memory, kept from brick to brick.
#[derive(Default)]
pub(super) struct Resolver {
    /// Per triangle of the brick: its normal, once needed.
    normals: Vec<Option<OctNormal>>,
    /// Crossings of one edge that holds several: the offset and, below it, the [`Cause`].
    shared: Vec<u64>,
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
            HermiteEdge { offset: hit.offset, normal: self.normal(hit.cause, list) }
        } else {
            self.resolve_shared(last, crossings, i32::from(samples.0[usize::from(hit.lower)]), list)
        }
    }

    #[inline]
    fn normal(&mut self, cause: Cause, list: Triangles<'_>) -> OctNormal {
        *self.normals[cause.position()]
            .get_or_insert_with(|| OctNormal::from_integer(normal(list.get(cause.position()))))
    }

    /// Decides an edge that holds several crossings, from the winding number at its lower sample: the first
    /// step at which the running count passes 0.5.
    #[inline(never)]
    fn resolve_shared(
        &mut self,
        last: u32,
        crossings: &Crossings,
        start: i32,
        list: Triangles<'_>,
    ) -> HermiteEdge {
        let mut shared = std::mem::take(&mut self.shared);
        shared.clear();
        shared.extend(crossings.chain(last).map(|hit| u64::from(hit.offset) << 32 | u64::from(hit.cause.0)));
        shared.sort_unstable();
        let mut w = start;
        // Crossings with the same offset count as one step.
        let mut steps = shared.chunk_by(|a, b| a >> 32 == b >> 32);
        let edge = steps.find_map(|step| {
            let causes = || step.iter().map(|&crossing| Cause(crossing as u32));
            let before = w;
            w += causes().map(Cause::jump).sum::<i32>();
            let direction = if w > before { 1 } else { -1 };
            // Of facets that coincide here, the one with the smallest normal, whatever their order.
            let normals =
                causes().filter(|cause| cause.jump() == direction).map(|cause| self.normal(cause, list));
            let passes = (before >= 1) != (w >= 1);
            passes.then(|| HermiteEdge {
                offset: (step[0] >> 32) as u16,
                normal: normals.min().expect("the count moved this way"),
            })
        });
        self.shared = shared;
        edge.expect("the edge changes sign, so its crossings pass 0.5")
    }
}
