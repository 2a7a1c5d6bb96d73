//! From crossings to Hermite edges: on each sign-changing lattice edge, the point where the running count
//! passes 0.5 and the normal of the facet there.

use super::evaluate::{Hit, Triangles};
use crate::brick::{HermiteEdge, OctNormal, Samples, SignChanges};
use crate::error::{Error, Result};
use crate::lattice::{Axis, BRICK_POINTS, normal};

const ROWS: usize = BRICK_POINTS * BRICK_POINTS;

/// Working memory for one axis after the other, kept from brick to brick.
#[derive(Default)]
pub(super) struct Resolver {
    /// Per row: the sign-changing edges.
    changes: Vec<u64>,
    /// Per row: how many sign-changing edges the rows before hold.
    ranks: Vec<u32>,
    /// Per sign-changing edge: its first crossing, [`NONE`] before that.
    first: Vec<u32>,
    /// Crossings on edges that hold several.
    shared: Vec<Candidate>,
}

/// No crossing yet.
const NONE: u32 = u32::MAX;
/// Several crossings: all are in `shared`.
const SEVERAL: u32 = u32::MAX - 1;

/// A crossing on an edge that holds several.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
struct Candidate {
    slot: u32,
    offset: u16,
    normal: OctNormal,
    jump: i32,
    lower: u16,
}

impl Resolver {
    /// Finds the sign-changing edges along `axis`.
    pub fn index(&mut self, axis: Axis, signs: &SignChanges) {
        self.changes.clear();
        self.ranks.clear();
        let mut count = 0;
        for row in 0..ROWS {
            let word = signs.edges(axis, row % BRICK_POINTS, row / BRICK_POINTS);
            self.changes.push(word);
            self.ranks.push(count);
            count += word.count_ones();
        }
        self.first.clear();
        self.first.resize(count as usize, NONE);
    }

    /// Per row of samples, which edges change sign.
    pub fn changes(&self) -> &[u64] {
        &self.changes
    }

    /// One Hermite edge per sign-changing edge, from the crossings on those edges.
    pub fn resolve(
        &mut self,
        samples: &Samples,
        hits: &[Hit],
        list: Triangles<'_>,
    ) -> Result<Vec<HermiteEdge>> {
        self.shared.clear();
        let candidate = |slot: u32, hit: &Hit| {
            let normal = OctNormal::from_integer(normal(list.get((hit.facet >> 1) as usize)));
            Candidate { slot, offset: hit.offset, normal, jump: hit.jump(), lower: hit.lower }
        };
        for (number, hit) in hits.iter().enumerate() {
            let slot = self.slot(hit.lower);
            let first = &mut self.first[slot];
            match *first {
                NONE => *first = number as u32,
                SEVERAL => self.shared.push(candidate(slot as u32, hit)),
                earlier => {
                    self.shared.push(candidate(slot as u32, &hits[earlier as usize]));
                    self.shared.push(candidate(slot as u32, hit));
                    *first = SEVERAL;
                }
            }
        }
        let mut last = (NONE, OctNormal(0));
        let mut edges = Vec::with_capacity(self.first.len());
        for &first in &self.first {
            let Some(hit) = hits.get(first as usize) else {
                if first == NONE {
                    return Err(Error::setting(
                        "internal error: a sign change without a crossing",
                        "report this with the input",
                    ));
                }
                edges.push(HermiteEdge { offset: 0, normal: OctNormal(0) });
                continue;
            };
            if last.0 != hit.facet >> 1 {
                let position = hit.facet >> 1;
                last = (position, OctNormal::from_integer(normal(list.get(position as usize))));
            }
            edges.push(HermiteEdge { offset: hit.offset, normal: last.1 });
        }
        self.settle_shared(samples, &mut edges);
        Ok(edges)
    }

    /// The number of a sign-changing edge among them all, given its lower sample.
    #[inline]
    fn slot(&self, lower: u16) -> usize {
        let (row, i) = (usize::from(lower) / BRICK_POINTS, usize::from(lower) % BRICK_POINTS);
        let before = self.changes[row] & ((1 << i) - 1);
        self.ranks[row] as usize + before.count_ones() as usize
    }

    /// Decides the edges that hold several crossings. Sorting makes the choice independent of the order of
    /// the triangles; crossings at one offset count as one step.
    fn settle_shared(&mut self, samples: &Samples, edges: &mut [HermiteEdge]) {
        self.shared.sort_unstable();
        for edge in self.shared.chunk_by(|a, b| a.slot == b.slot) {
            let start = i32::from(samples.0[usize::from(edge[0].lower)]);
            edges[edge[0].slot as usize] = first_passage(start, edge);
        }
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
