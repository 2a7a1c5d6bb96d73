//! From crossings to Hermite edges: on each sign-changing lattice edge, the point where the running count
//! passes 0.5 and the normal of the facet there.

use super::crossings::{Cause, Crossings};
use super::evaluate::Triangles;
use super::passages::{Passage, Passages};
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
            let start = samples.0[usize::from(hit.lower)];
            self.resolve_shared(start, crossings.chain(last).map(|hit| (hit.offset, hit.cause)), list)
        }
    }

    /// The Hermite edge of a sign-changing lattice edge that begins at sample `lower`, given one of its crossings.
    #[inline(always)]
    pub fn resolve_passage(
        &mut self,
        lower: usize,
        first: Passage,
        passages: &Passages,
        samples: &Samples,
        list: Triangles<'_>,
    ) -> HermiteEdge {
        if first.is_only() {
            return HermiteEdge { offset: first.offset, normal: self.normal(first.cause, list) };
        }
        let start = samples.0[lower];
        match passages.second_of_two(first).filter(|second| second.offset != first.offset) {
            Some(second) => {
                self.resolve_two(start, [first, second].map(|passage| (passage.offset, passage.cause)), list)
            }
            None => self.resolve_shared(
                start,
                passages.chain(first).map(|passage| (passage.offset, passage.cause)),
                list,
            ),
        }
    }

    /// [`Resolver::resolve_shared`] for two crossings with different offsets, which most such edges have.
    #[inline]
    fn resolve_two(&mut self, start: i16, crossings: [(u16, Cause); 2], list: Triangles<'_>) -> HermiteEdge {
        let [a, b] = crossings;
        let (near, far) = if a.0 < b.0 { (a, b) } else { (b, a) };
        let before = i32::from(start);
        let passes = (before >= 1) != (before + near.1.jump() >= 1);
        let (offset, cause) = if passes { near } else { far };
        HermiteEdge { offset, normal: self.normal(cause, list) }
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
        start: i16,
        crossings: impl Iterator<Item = (u16, Cause)>,
        list: Triangles<'_>,
    ) -> HermiteEdge {
        let mut shared = std::mem::take(&mut self.shared);
        shared.clear();
        shared.extend(crossings.map(|(offset, cause)| u64::from(offset) << 32 | u64::from(cause.0)));
        shared.sort_unstable();
        let mut w = i32::from(start);
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
