//! From crossings to Hermite edges: on each sign-changing lattice edge, the point where the running count
//! passes 0.5 and the normal of the facet there.

use super::evaluate::{Hit, Triangles};
use crate::brick::{Hermite, HermiteEdge, OctNormal, Samples, SignChanges};
use crate::error::{Error, Result};
use crate::lattice::{Axis, BRICK_POINTS, normal};

const ROWS: usize = BRICK_POINTS * BRICK_POINTS;

/// Working memory, kept from brick to brick.
#[derive(Default)]
pub(super) struct Scratch {
    /// Per row: the sign-changing edges and how many the rows before hold.
    rows: Vec<(u64, u32)>,
    /// Per sign-changing edge: whether a crossing was seen.
    seen: Vec<bool>,
    /// Crossings on edges that hold several.
    shared: Vec<Candidate>,
}

/// A crossing on an edge that holds several.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
struct Candidate {
    slot: u32,
    offset: u16,
    normal: OctNormal,
    jump: i32,
    lower: u16,
}

impl Scratch {
    /// Resolves all three axes.
    pub fn resolve(
        &mut self,
        samples: &Samples,
        signs: &SignChanges,
        hits: &[Vec<Hit>; 3],
        list: Triangles<'_>,
    ) -> Result<Hermite> {
        let mut out = Hermite::default();
        for axis in Axis::ALL {
            out.edges[axis.index()] = self.resolve_axis(axis, samples, signs, &hits[axis.index()], list)?;
        }
        Ok(out)
    }

    fn resolve_axis(
        &mut self,
        axis: Axis,
        samples: &Samples,
        signs: &SignChanges,
        hits: &[Hit],
        list: Triangles<'_>,
    ) -> Result<Vec<HermiteEdge>> {
        let count = self.index_rows(axis, signs);
        let mut edges = vec![HermiteEdge { offset: 0, normal: OctNormal(0) }; count];
        self.seen.clear();
        self.seen.resize(count, false);
        self.shared.clear();
        let mut last = (u32::MAX, OctNormal(0));
        for hit in hits {
            let (row, i) = (usize::from(hit.lower) / BRICK_POINTS, usize::from(hit.lower) % BRICK_POINTS);
            let (word, before) = self.rows[row];
            if word >> i & 1 == 0 {
                continue;
            }
            let slot = before as usize + (word & ((1 << i) - 1)).count_ones() as usize;
            if last.0 != hit.facet >> 1 {
                let position = hit.facet >> 1;
                last = (position, OctNormal::from_integer(normal(list.get(position as usize))));
            }
            if std::mem::replace(&mut self.seen[slot], true) {
                self.shared.push(Candidate {
                    slot: slot as u32,
                    offset: hit.offset,
                    normal: last.1,
                    jump: hit.jump(),
                    lower: hit.lower,
                });
            } else {
                edges[slot] = HermiteEdge { offset: hit.offset, normal: last.1 };
            }
        }
        if self.seen.contains(&false) {
            return Err(Error::setting(
                "internal error: a sign change without a crossing",
                "report this with the input",
            ));
        }
        self.settle_shared(samples, hits, list, &mut edges);
        Ok(edges)
    }

    /// Fills `rows`; returns the number of sign-changing edges.
    fn index_rows(&mut self, axis: Axis, signs: &SignChanges) -> usize {
        self.rows.clear();
        let mut count = 0;
        for row in 0..ROWS {
            let word = signs.edges(axis, row % BRICK_POINTS, row / BRICK_POINTS);
            self.rows.push((word, count));
            count += word.count_ones();
        }
        count as usize
    }

    /// Decides the edges that hold several crossings. Sorting makes the choice independent of the order of
    /// the triangles; crossings at one offset count as one step.
    fn settle_shared(
        &mut self,
        samples: &Samples,
        hits: &[Hit],
        list: Triangles<'_>,
        edges: &mut [HermiteEdge],
    ) {
        if self.shared.is_empty() {
            return;
        }
        // The first crossing of each such edge was taken for the only one: bring it in as well.
        let mut lowers: Vec<(u16, u32)> = self.shared.iter().map(|c| (c.lower, c.slot)).collect();
        lowers.sort_unstable();
        lowers.dedup();
        self.shared.clear();
        for hit in hits {
            if let Ok(found) = lowers.binary_search_by_key(&hit.lower, |l| l.0) {
                let normal = OctNormal::from_integer(normal(list.get((hit.facet >> 1) as usize)));
                let (lower, slot) = lowers[found];
                self.shared.push(Candidate { slot, offset: hit.offset, normal, jump: hit.jump(), lower });
            }
        }
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
