//! From crossings to Hermite edges: on each sign-changing lattice edge, the point where the running count
//! passes 0.5 and the normal of the facet there.

use super::evaluate::{Hit, Triangles};
use crate::brick::{HermiteEdge, OctNormal, Samples, SignChanges};
use crate::error::{Error, Result};
use crate::lattice::{Axis, BRICK_POINTS, normal};

/// Working memory for one axis after the other, kept from brick to brick.
#[derive(Default)]
pub(super) struct Resolver {
    /// Per row: the sign-changing edges.
    changes: Vec<u64>,
    /// Per row: how many sign-changing edges the rows before hold.
    ranks: Vec<u32>,
    /// Per sign-changing edge: the number of its last crossing, [`NONE`] before that.
    last: Vec<u32>,
    /// Per crossing: the number of the one before it on the same edge, or [`NONE`].
    before: Vec<u32>,
    /// Per triangle of the brick: its normal, once needed.
    normals: Vec<Option<OctNormal>>,
    /// Crossings of one edge that holds several.
    shared: Vec<Candidate>,
}

/// No crossing.
const NONE: u32 = u32::MAX;

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

    /// Finds the sign-changing edges along `axis`.
    pub fn index(&mut self, axis: Axis, signs: &SignChanges) {
        self.changes.clear();
        self.ranks.clear();
        let mut count = 0;
        for k in 0..BRICK_POINTS {
            for j in 0..BRICK_POINTS {
                let word = signs.edges(axis, j, k);
                self.changes.push(word);
                self.ranks.push(count);
                count += word.count_ones();
            }
        }
        self.last.clear();
        self.last.resize(count as usize, NONE);
    }

    /// Whether the edge changes sign whose lower sample is the `i`-th of `row`.
    #[inline]
    pub fn changes(&self, row: usize, i: usize) -> bool {
        self.changes[row] >> i & 1 != 0
    }

    /// One Hermite edge per sign-changing edge, from the crossings on those edges.
    pub fn resolve(
        &mut self,
        samples: &Samples,
        hits: &[Hit],
        list: Triangles<'_>,
    ) -> Result<Vec<HermiteEdge>> {
        self.before.clear();
        for (number, hit) in hits.iter().enumerate() {
            let slot = self.slot(hit.lower);
            self.before.push(std::mem::replace(&mut self.last[slot], number as u32));
        }
        let mut edges = Vec::with_capacity(self.last.len());
        for slot in 0..self.last.len() {
            let number = self.last[slot] as usize;
            let Some(hit) = hits.get(number) else {
                return Err(Error::setting(
                    "internal error: a sign change without a crossing",
                    "report this with the input",
                ));
            };
            edges.push(if self.before[number] == NONE {
                HermiteEdge { offset: hit.offset, normal: self.normal(*hit, list) }
            } else {
                self.settle_shared(number as u32, samples, hits, list)
            });
        }
        Ok(edges)
    }

    /// The number of a sign-changing edge among them all, given its lower sample.
    #[inline]
    fn slot(&self, lower: u16) -> usize {
        let (row, i) = (usize::from(lower) / BRICK_POINTS, usize::from(lower) % BRICK_POINTS);
        let before = self.changes[row] & ((1 << i) - 1);
        self.ranks[row] as usize + before.count_ones() as usize
    }

    #[inline]
    fn normal(&mut self, hit: Hit, list: Triangles<'_>) -> OctNormal {
        *self.normals[hit.position()]
            .get_or_insert_with(|| OctNormal::from_integer(normal(list.get(hit.position()))))
    }

    /// Decides an edge that holds several crossings, given the number of the last one.
    fn settle_shared(
        &mut self,
        last: u32,
        samples: &Samples,
        hits: &[Hit],
        list: Triangles<'_>,
    ) -> HermiteEdge {
        let mut shared = std::mem::take(&mut self.shared);
        shared.clear();
        let mut number = last;
        while number != NONE {
            let hit = hits[number as usize];
            shared.push(Candidate { offset: hit.offset, normal: self.normal(hit, list), jump: hit.jump() });
            number = self.before[number as usize];
        }
        shared.sort_unstable();
        let start = i32::from(samples.0[usize::from(hits[last as usize].lower)]);
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
