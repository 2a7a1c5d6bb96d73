//! Is the soup closed? Every directed edge must be cancelled by its reverse.
//!
//! Σ over directed edges of ±hash(edge) mod 2^64, the sign by direction, is zero for closed input and
//! streams at memory speed. Where it is not zero, the edges themselves are matched, bucket by bucket.

use crate::error::Result;
use crate::ingest::{Facets, runs};
use crate::lattice::{RootCube, Triangle, Units};
use crate::progress::Progress;

/// log₂ of the number of buckets by which open edges are found.
const BUCKET_BITS: u32 = 12;

/// Running sum of signed edge hashes; sums of parts add up to the sum of the whole.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct EdgeBalance(u64);

impl EdgeBalance {
    /// Adds one triangle's three directed edges.
    #[inline]
    pub fn add(&mut self, t: &Triangle) {
        let h = t.map(vertex_hash);
        for i in 0..3 {
            self.0 = self.0.wrapping_add(edge_hash(h[i], h[(i + 1) % 3]));
        }
    }

    /// Adds another part's sum.
    pub fn merge(&mut self, other: EdgeBalance) {
        self.0 = self.0.wrapping_add(other.0);
    }

    /// True if every directed edge is cancelled; wrong with probability 2^-64.
    pub fn is_closed(self) -> bool {
        self.0 == 0
    }
}

/// The directed edges of a soup that no reverse cancels.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct OpenEdges {
    /// How many, with multiplicity.
    pub count: u64,
    /// The one whose facet comes first: facet index (from 0), start and end.
    pub first: Option<(u64, Units, Units)>,
}

/// Finds the open edges. `scan` must call its argument with every facet's index and snapped triangle, each
/// time it is called; it runs once to find the buckets that hold open edges and once per group of buckets
/// whose edges fit `budget_edges` entries of 40 bytes.
fn open_edges(
    budget_edges: usize,
    mut scan: impl FnMut(&mut dyn FnMut(u64, &Triangle)) -> Result<()>,
) -> Result<OpenEdges> {
    let buckets = 1usize << BUCKET_BITS;
    let mut sums = vec![0u64; buckets];
    let mut sizes = vec![0usize; buckets];
    scan(&mut |_, t| {
        for_edges(t, |a, b, bucket| {
            sums[bucket] = sums[bucket].wrapping_add(edge_hash(vertex_hash(a), vertex_hash(b)));
            sizes[bucket] += 1;
        });
    })?;
    let open: Vec<usize> = (0..buckets).filter(|&b| sums[b] != 0).collect();
    let mut out = OpenEdges::default();
    let mut start = 0;
    while start < open.len() {
        let mut end = start + 1;
        let mut held = sizes[open[start]];
        while end < open.len() && held + sizes[open[end]] <= budget_edges {
            held += sizes[open[end]];
            end += 1;
        }
        let mut wanted = vec![false; buckets];
        open[start..end].iter().for_each(|&b| wanted[b] = true);
        let mut edges: Vec<(Units, Units, bool, u64)> = Vec::with_capacity(held);
        scan(&mut |facet, t| {
            for_edges(t, |a, b, bucket| {
                if wanted[bucket] {
                    edges.push((a.min(b), a.max(b), a > b, facet));
                }
            });
        })?;
        edges.sort_unstable();
        for same in edges.chunk_by(|p, q| (p.0, p.1) == (q.0, q.1)) {
            count_open(same, &mut out);
        }
        start = end;
    }
    Ok(out)
}

/// Edges matched at a time in [`open_edges_of`]: 400 MB at most.
const EDGES_AT_ONCE: usize = 10_000_000;

/// The open edges of several sources as one soup; facets count through all sources.
///
/// # Errors
/// If the user interrupts.
pub fn open_edges_of(sources: &[&dyn Facets], root: RootCube, progress: &dyn Progress) -> Result<OpenEdges> {
    let snapper = root.snapper();
    let mut world = Vec::new();
    open_edges(EDGES_AT_ONCE, |each| {
        let mut facet = 0;
        for (source, range) in runs(sources) {
            progress.check()?;
            sources[source].read(range, &mut world);
            for t in &world {
                each(facet, &t.map(snapper));
                facet += 1;
            }
        }
        Ok(())
    })
}

/// Counts what is left of one undirected edge after cancelling; `same` has forward edges first.
fn count_open(same: &[(Units, Units, bool, u64)], out: &mut OpenEdges) {
    let backward = same.iter().filter(|e| e.2).count();
    let forward = same.len() - backward;
    if forward == backward {
        return;
    }
    out.count += forward.abs_diff(backward) as u64;
    let surplus = if forward > backward { &same[..forward] } else { &same[forward..] };
    let (a, b, reversed, facet) = surplus[0];
    let (start, end) = if reversed { (b, a) } else { (a, b) };
    if out.first.is_none_or(|f| (facet, start, end) < f) {
        out.first = Some((facet, start, end));
    }
}

fn for_edges(t: &Triangle, mut edge: impl FnMut(Units, Units, usize)) {
    for i in 0..3 {
        let (a, b) = (t[i], t[(i + 1) % 3]);
        if a != b {
            // The same bucket for both directions.
            let bucket = vertex_hash(a).wrapping_add(vertex_hash(b)) >> (64 - BUCKET_BITS);
            edge(a, b, bucket as usize);
        }
    }
}

/// Multiplies to 128 bits and folds (as wyhash does): every input bit reaches every output bit.
#[inline]
fn fold(a: u64, b: u64) -> u64 {
    let wide = u128::from(a) * u128::from(b);
    (wide as u64) ^ (wide >> 64) as u64
}

#[inline]
fn vertex_hash(p: Units) -> u64 {
    let low = p[0] as u32 as u64 | (p[1] as u32 as u64) << 32;
    fold(low ^ 0xa076_1d64_78bd_642f, (p[2] as u32 as u64) ^ 0xe703_7ed1_a0b4_28db)
}

/// Antisymmetric: the reverse edge has the negated hash, and an edge without length has 0.
#[inline]
fn edge_hash(a: u64, b: u64) -> u64 {
    let (low, high) = if a < b { (a, b) } else { (b, a) };
    let h = fold(low ^ 0x8ebc_6af0_9c88_c6e3, high ^ 0x5899_65cc_7537_4cc3);
    if a < b {
        h
    } else if a > b {
        h.wrapping_neg()
    } else {
        0
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn tetrahedron(at: i32) -> Vec<Triangle> {
        let p = [[0, 0, 0], [8, 0, 0], [0, 8, 0], [0, 0, 8]].map(|v: Units| v.map(|c| c + at));
        [[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]].map(|t| t.map(|i: usize| p[i])).to_vec()
    }

    fn find(soup: &[Triangle], budget: usize) -> OpenEdges {
        open_edges(budget, |each| {
            soup.iter().enumerate().for_each(|(i, t)| each(i as u64, t));
            Ok(())
        })
        .unwrap()
    }

    fn balanced(soup: &[Triangle]) -> bool {
        let mut balance = EdgeBalance::default();
        soup.iter().for_each(|t| balance.add(t));
        balance.is_closed()
    }

    #[test]
    fn closed_flipped_and_degenerate_facets() {
        let mut soup = tetrahedron(0);
        soup.extend(tetrahedron(2));
        soup.push([[2, 2, 2], [2, 2, 2], [6, 6, 6]]);
        assert!(balanced(&soup));
        assert_eq!(find(&soup, 100), OpenEdges::default());
        soup[1].swap(0, 1);
        assert!(!balanced(&soup));
        let open = find(&soup, 100);
        assert_eq!(open.count, 6);
        assert_eq!(open.first.unwrap().0, 0);
    }

    proptest! {
        #[test]
        fn deleted_facets_leave_their_boundary(keep in prop::collection::vec(any::<bool>(), 40), budget in 1usize..50) {
            let soup: Vec<Triangle> = (0..10).flat_map(|i| tetrahedron(20 * i)).collect();
            let kept: Vec<Triangle> = soup.iter().zip(&keep).filter(|(_, k)| **k).map(|(t, _)| *t).collect();
            let expected: u64 = keep.chunks(4).map(|c| match c.iter().filter(|k| **k).count() {
                1 | 3 => 3, 2 => 4, _ => 0u64,
            }).sum();
            prop_assert_eq!(find(&kept, budget).count, expected);
            prop_assert_eq!(balanced(&kept), expected == 0);
        }
    }
}
