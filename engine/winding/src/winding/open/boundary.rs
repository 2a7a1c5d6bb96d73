//! The boundary of a soup: the directed edges that no reverse cancels, with multiplicity.

use super::super::balance::for_edges;
use crate::error::Result;
use crate::lattice::{RootCube, Triangle, Units};
use crate::progress::Progress;
use crate::soup::{Facets, runs};
use rayon::prelude::*;
use std::ops::Range;
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};

/// A directed edge of a facet.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct OpenEdge {
    /// Start.
    pub from: Units,
    /// End.
    pub to: Units,
    /// A facet that has it, from 0 through all sources.
    pub facet: u64,
}

/// The open edges of a soup, sorted; one that is open several times is repeated. At each vertex as many end
/// as start.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Boundary {
    /// All of them.
    pub edges: Vec<OpenEdge>,
}

/// One directed edge, its ends in order: (lower, upper, whether it runs downwards, facet).
type Entry = (Units, Units, bool, u64);

/// Edges matched at a time: 400 MB.
const EDGES_AT_ONCE: u64 = 10_000_000;

/// log₂ of the number of buckets, at least and at most. With one for each facet, edges are rarely in a bucket with an
/// open one that is not theirs, and 16 MB of sums still are nothing beside the facets.
const BUCKET_BITS: (u32, u32) = (12, 20);

/// Signed hash sum and number of edges by bucket; sums of integers, in any order.
struct Buckets {
    buckets: Vec<(AtomicU64, AtomicU64)>,
    bits: u32,
}

impl Buckets {
    fn new(facets: u64) -> Buckets {
        let bits = facets.max(1).ilog2().clamp(BUCKET_BITS.0, BUCKET_BITS.1);
        Buckets { buckets: (0..1 << bits).map(|_| Default::default()).collect(), bits }
    }

    fn of(&self, hash: u64) -> usize {
        (hash >> (64 - self.bits)) as usize
    }

    fn add(&self, t: &Triangle) {
        for_edges(t, |_, _, hash, signed| {
            let (sum, size) = &self.buckets[self.of(hash)];
            sum.fetch_add(signed, Relaxed);
            size.fetch_add(1, Relaxed);
        });
    }

    /// The buckets that hold open edges, in groups of at most `budget` edges, or of one bucket.
    fn groups(&self, budget: u64) -> Vec<Vec<usize>> {
        let mut groups: Vec<Vec<usize>> = Vec::new();
        let mut held = u64::MAX;
        for (bucket, (sum, size)) in self.buckets.iter().enumerate() {
            if sum.load(Relaxed) == 0 {
                continue;
            }
            let size = size.load(Relaxed);
            held = held.saturating_add(size);
            if held > budget {
                groups.push(Vec::new());
                held = size;
            }
            groups.last_mut().expect("one was made").push(bucket);
        }
        groups
    }
}

impl Boundary {
    /// The boundary of all sources as one soup. Hash sums by bucket tell which buckets hold open edges (wrong
    /// with probability 2^-64 each); only their edges are matched.
    ///
    /// # Errors
    /// If the user interrupts.
    pub fn of(sources: &[&dyn Facets], root: RootCube, progress: &dyn Progress) -> Result<Boundary> {
        Boundary::within(u64::MAX, sources, root, progress)
    }

    /// As [`Boundary::of`], with edges of at most `memory` bytes at a time, or of one bucket.
    pub(super) fn within(
        memory: u64,
        sources: &[&dyn Facets],
        root: RootCube,
        progress: &dyn Progress,
    ) -> Result<Boundary> {
        let edges = (memory / size_of::<Entry>() as u64).clamp(1, EDGES_AT_ONCE);
        Boundary::found(edges, sources, root, progress)
    }

    fn found(
        budget: u64,
        sources: &[&dyn Facets],
        root: RootCube,
        progress: &dyn Progress,
    ) -> Result<Boundary> {
        let snapper = root.snapper();
        let all = runs(sources);
        // Facets are numbered through all sources.
        let mut firsts = vec![0u64];
        sources.iter().for_each(|s| firsts.push(firsts[firsts.len() - 1] + s.facets()));
        let snapped = |(source, range): &(usize, Range<u64>)| {
            let mut world = Vec::new();
            if !progress.cancelled() {
                sources[*source].read(range.clone(), &mut world);
            }
            (firsts[*source] + range.start, world.iter().map(|t| t.map(snapper)).collect::<Vec<Triangle>>())
        };
        let buckets = Buckets::new(firsts[sources.len()]);
        all.par_iter().for_each(|run| snapped(run).1.iter().for_each(|t| buckets.add(t)));
        progress.check()?;
        let mut edges = Vec::new();
        for group in buckets.groups(budget) {
            let mut wanted = vec![false; buckets.buckets.len()];
            group.iter().for_each(|&b| wanted[b] = true);
            let mut entries: Vec<Entry> = all
                .par_iter()
                .fold(Vec::new, |mut entries: Vec<Entry>, run| {
                    let (first, triangles) = snapped(run);
                    for (facet, t) in (first..).zip(&triangles) {
                        for_edges(t, |a, b, hash, _| {
                            if wanted[buckets.of(hash)] {
                                entries.push((a.min(b), a.max(b), a > b, facet));
                            }
                        });
                    }
                    entries
                })
                .reduce(Vec::new, |mut a, mut b| {
                    a.append(&mut b);
                    a
                });
            progress.check()?;
            entries.par_sort_unstable();
            keep_surplus(&entries, &mut edges);
        }
        edges.par_sort_unstable();
        Ok(Boundary { edges })
    }

    /// The open edge whose facet comes first.
    pub fn first(&self) -> Option<OpenEdge> {
        self.edges.iter().copied().min_by_key(|e| (e.facet, e.from, e.to))
    }

    /// See [`super::OpenSummary::flipped_patches`].
    pub(super) fn flipped_patches(&self) -> u64 {
        let repeated = self.edges.chunk_by(|a, b| (a.from, a.to) == (b.from, b.to)).filter(|c| c.len() > 1);
        let seams: Vec<(Units, Units)> = repeated.map(|c| (c[0].from, c[0].to)).collect();
        let mut vertices: Vec<Units> = seams.iter().flat_map(|&(a, b)| [a, b]).collect();
        vertices.sort_unstable();
        vertices.dedup();
        let number = |p: Units| vertices.binary_search(&p).expect("listed above");
        let mut parents: Vec<usize> = (0..vertices.len()).collect();
        let mut components = vertices.len() as u64;
        for &(a, b) in &seams {
            let (a, b) = (root_of(&mut parents, number(a)), root_of(&mut parents, number(b)));
            components -= u64::from(a != b);
            parents[a.max(b)] = a.min(b);
        }
        components
    }
}

/// The representative of a vertex's component, halving the path to it.
fn root_of(parents: &mut [usize], mut v: usize) -> usize {
    while parents[v] != v {
        parents[v] = parents[parents[v]];
        v = parents[v];
    }
    v
}

/// Keeps of each undirected edge what is left after cancelling; entries are sorted.
fn keep_surplus(entries: &[Entry], out: &mut Vec<OpenEdge>) {
    for same in entries.chunk_by(|p, q| (p.0, p.1) == (q.0, q.1)) {
        let (up, down) = same.split_at(same.partition_point(|e| !e.2));
        let (surplus, count) =
            if up.len() > down.len() { (up, up.len() - down.len()) } else { (down, down.len() - up.len()) };
        out.extend(surplus[..count].iter().map(|&(low, high, reversed, facet)| {
            let (from, to) = if reversed { (high, low) } else { (low, high) };
            OpenEdge { from, to, facet }
        }));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lattice::ROOT_BITS;
    use crate::progress::Silent;
    use crate::soup::Facet;
    use proptest::prelude::*;

    fn tetrahedron(at: i32) -> Vec<Facet> {
        let p = [[0, 0, 0], [8, 0, 0], [0, 8, 0], [0, 0, 8]].map(|v: Units| v.map(|c| f64::from(c + at)));
        [[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]].map(|t| t.map(|i: usize| p[i])).to_vec()
    }

    fn find(soup: &Vec<Facet>, budget: u64) -> Boundary {
        let root = RootCube { origin: [0.0; 3], edge: f64::from(1u32 << ROOT_BITS) };
        Boundary::found(budget, &[soup], root, &Silent).unwrap()
    }

    #[test]
    fn closed_flipped_and_degenerate_facets() {
        let mut soup = tetrahedron(0);
        soup.extend(tetrahedron(2));
        soup.push([[2.0; 3], [2.0; 3], [6.0; 3]]);
        assert_eq!(find(&soup, 100), Boundary::default());
        soup[1].swap(0, 1);
        let open = find(&soup, 100);
        assert_eq!(open.edges.len(), 6);
        assert_eq!(open.first().unwrap().facet, 0);
        assert_eq!(open.flipped_patches(), 1);
        soup[5].swap(0, 1);
        assert_eq!(find(&soup, 100).flipped_patches(), 2);
    }

    proptest! {
        #[test]
        fn deleted_facets_leave_their_boundary(
            keep in prop::collection::vec(any::<bool>(), 40),
            budget in 1u64..50,
        ) {
            let soup: Vec<Facet> = (0..10).flat_map(|i| tetrahedron(20 * i)).collect();
            let kept: Vec<Facet> = soup.iter().zip(&keep).filter(|(_, k)| **k).map(|(t, _)| *t).collect();
            let expected: usize = keep.chunks(4).map(|c| match c.iter().filter(|k| **k).count() {
                1 | 3 => 3, 2 => 4, _ => 0,
            }).sum();
            let found = find(&kept, budget);
            prop_assert_eq!(found.edges.len(), expected);
            prop_assert_eq!(&found, &find(&kept, 1_000_000));
        }
    }
}
