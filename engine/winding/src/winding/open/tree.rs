//! The hierarchy of clusters.

use super::cell::ExpansionCache;
use super::high_moments::{HighMoments, fifth_root};
use super::moments::{Expansion, Moments, Reach, SurfaceElement, error_bound};
use crate::error::Result;
use crate::large_array::{ArrayRoom, LargeArray};
use crate::lattice::Units;
use bytemuck::{Pod, Zeroable};
use std::f64::consts::PI;
use std::ops::Range;

/// A cluster of neighbouring elements.
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
#[repr(C)]
pub(in crate::winding) struct Cluster {
    pub center: [f64; 3],
    /// Its elements.
    first: u32,
    count: u32,
    /// Numbers of its halves among the clusters; 0 if undivided.
    halves: [u32; 2],
    pub reach: Reach,
    pub expansion: Expansion,
}

impl Cluster {
    /// Numbers of its halves, if it is divided.
    pub fn halves(&self) -> Option<[u32; 2]> {
        (self.halves != [0; 2]).then_some(self.halves)
    }

    /// Numbers of its elements.
    pub fn elements(&self) -> Range<u32> {
        self.first..self.first + self.count
    }

    /// A bound on the absolute value of what its elements add at this distance from its centre: from all of its area, or
    /// from its moments and the error of their expansion, in which elements that face each other cancel.
    pub fn magnitude(&self, distance: f64) -> f64 {
        let beyond = distance - self.reach.farthest;
        if beyond <= 0.0 {
            return f64::INFINITY;
        }
        let by_area = self.reach.area / (4.0 * PI * beyond * beyond);
        by_area.min(self.expansion.magnitude(distance) + error_bound(self.reach, distance))
    }

    fn seen_from(&self, p: [f64; 3]) -> f64 {
        self.expansion.at(std::array::from_fn(|a| self.center[a] - p[a]))
    }
}

/// Most elements that have high moments, in clusters of one: beyond, clusters would take more than 156 MiB.
const FINE_ELEMENTS: usize = 1 << 17;
/// Elements of a small cluster. Large ones, which all cells ask for, stand first, and a small one together with all below it takes
/// about a page: of arrays in files few pages are in use then.
const SMALL_ELEMENTS: usize = 64;

/// What clusters over so many elements take, which have high moments if they are few.
pub(super) fn cluster_bytes<E: SurfaceElement>(elements: u64) -> u64 {
    let count = elements as usize;
    let of_one = if is_fine::<E>(count) {
        size_of::<Cluster>() + size_of::<HighMoments>()
    } else {
        size_of::<Cluster>()
    };
    (clusters_of(count, leaf_of::<E>(count)) * of_one) as u64
}

fn is_fine<E: SurfaceElement>(elements: usize) -> bool {
    E::HAS_HIGH_MOMENTS && elements <= FINE_ELEMENTS
}

/// Elements of a cluster that is not divided, where there are so many.
fn leaf_of<E: SurfaceElement>(elements: usize) -> usize {
    if is_fine::<E>(elements) { 1 } else { E::LEAF_ELEMENTS }
}

/// Elements of surface in clusters, halved again and again.
#[derive(Debug)]
pub struct ClusterTree<E> {
    elements: LargeArray<E>,
    clusters: LargeArray<Cluster>,
    /// By cluster, if elements have them.
    high: LargeArray<HighMoments>,
    made: ExpansionCache,
}

impl<E: SurfaceElement> ClusterTree<E> {
    /// Of any elements; the order matters to nothing but which of two equal ones comes first.
    pub fn new(elements: Vec<E>) -> ClusterTree<E> {
        ClusterTree::of(elements.into()).expect("memory has room")
    }

    /// Of any elements, with clusters where these have room.
    ///
    /// # Errors
    /// If the temporary file for them cannot be written.
    pub fn of(mut elements: LargeArray<E>) -> Result<ClusterTree<E>> {
        let leaf = leaf_of::<E>(elements.len());
        let count = clusters_of(elements.len(), leaf);
        let mut clusters = LargeArray::zeroed(count, elements.room())?;
        let high = if is_fine::<E>(elements.len()) { count } else { 0 };
        let mut high = LargeArray::zeroed(high, elements.room())?;
        match elements.len() {
            0 => {}
            n if high.is_empty() => {
                let large = large_of(n);
                let parts = clusters.split_at_mut(large);
                divide_large(&mut elements, leaf, 0, parts, (0, large as u32));
            }
            _ => divide(&mut elements, leaf, 0, (&mut clusters, &mut high), 0),
        }
        Ok(ClusterTree { elements, clusters, high, made: ExpansionCache::default() })
    }

    /// The elements in the tree's order.
    pub fn elements(&self) -> &[E] {
        &self.elements
    }

    /// The room that its arrays have.
    pub(in crate::winding) fn room(&self) -> &ArrayRoom {
        self.elements.room()
    }

    /// The sum over all elements one by one.
    pub fn exact_at(&self, p: Units) -> f64 {
        self.elements.iter().map(|e| e.share_at(p)).sum()
    }

    /// Cells over the elements that were made already.
    pub(super) fn made(&self) -> &ExpansionCache {
        &self.made
    }

    /// All clusters; the first holds everything.
    pub(in crate::winding) fn clusters(&self) -> &[Cluster] {
        &self.clusters
    }

    /// The high moments of all clusters, or none.
    pub(super) fn high_moments(&self) -> &[HighMoments] {
        &self.high
    }

    /// The sum over all elements at a position 64 and more of the root's edges away, where four elements
    /// span less than a 36th of the distance, so that their expansion is off by less than 1e-9.
    pub fn far_at(&self, p: [f64; 3]) -> f64 {
        let undivided = self.clusters.iter().filter(|c| c.halves().is_none());
        undivided.map(|c| c.seen_from(p)).sum()
    }
}

/// Number of clusters over this many elements, of which an undivided one holds at most `leaf`.
fn clusters_of(elements: usize, leaf: usize) -> usize {
    match elements {
        0 => 0,
        n if n <= leaf => 1,
        n => 1 + clusters_of(n / 2, leaf) + clusters_of(n - n / 2, leaf),
    }
}

/// How many of the clusters over so many elements are large.
fn large_of(elements: usize) -> usize {
    match elements {
        n if n <= SMALL_ELEMENTS => 0,
        n => 1 + large_of(n / 2) + large_of(n - n / 2),
    }
}

/// Fills in the clusters over `elements`, the first of which has the number `first` of all: large ones, and small ones with all that
/// are below these. The first of each have these numbers.
fn divide_large<E: SurfaceElement>(
    elements: &mut [E],
    leaf: usize,
    first: u32,
    (large, small): (&mut [Cluster], &mut [Cluster]),
    numbers: (u32, u32),
) {
    let count = elements.len();
    if count <= SMALL_ELEMENTS {
        return divide(elements, leaf, first, (small, &mut []), numbers.1);
    }
    let half = count / 2;
    halve(elements, half);
    let in_left = large_of(half);
    let small_in_left = clusters_of(half, leaf) - in_left;
    let left = (numbers.0 + 1, numbers.1);
    let right = (left.0 + in_left as u32, left.1 + small_in_left as u32);
    let number = |count: usize, of: (u32, u32)| if count <= SMALL_ELEMENTS { of.1 } else { of.0 };
    let halves = [number(half, left), number(count - half, right)];
    let (own, below) = large.split_first_mut().expect("one for each large part");
    *own = Cluster { first, count: count as u32, halves, ..summarise(elements, false) };
    let (lower, upper) = elements.split_at_mut(half);
    let (left_large, right_large) = below.split_at_mut(in_left);
    let (left_small, right_small) = small.split_at_mut(small_in_left);
    let left = || divide_large(lower, leaf, first, (left_large, left_small), left);
    let right = || divide_large(upper, leaf, first + half as u32, (right_large, right_small), right);
    join(count, left, right);
}

/// Puts the `half` elements that are lowest along the longest axis before all others.
fn halve<E: SurfaceElement>(elements: &mut [E], half: usize) {
    let axis = longest_axis(elements);
    elements.select_nth_unstable_by(half, |a, b| {
        let (a, b) = (a.position(), b.position());
        let from = |i: usize| a[(axis + i) % 3].total_cmp(&b[(axis + i) % 3]);
        from(0).then(from(1)).then(from(2))
    });
}

/// Does both, at the same time where there are many elements: below that, handing over costs more than it gains.
fn join(elements: usize, left: impl FnOnce() + Send, right: impl FnOnce() + Send) {
    if elements > 4096 {
        rayon::join(left, right);
    } else {
        left();
        right();
    }
}

/// Fills in the clusters over `elements`, the first of which has the number `first` of all; the first of
/// `clusters` has the number `number`. High moments are those of as many clusters, or none.
fn divide<E: SurfaceElement>(
    elements: &mut [E],
    leaf: usize,
    first: u32,
    (clusters, high): (&mut [Cluster], &mut [HighMoments]),
    number: u32,
) {
    let count = elements.len();
    let half = count / 2;
    let second = if count > leaf { number + 1 + clusters_of(half, leaf) as u32 } else { 0 };
    if second != 0 {
        halve(elements, half);
    }
    let (own, below) = clusters.split_first_mut().expect("one for each part");
    let is_fine = !high.is_empty();
    *own = summarise(elements, is_fine);
    (own.first, own.count) = (first, count as u32);
    let (own_high, high) = high.split_at_mut(usize::from(is_fine));
    if second == 0 {
        own_high.iter_mut().for_each(|high| *high = HighMoments::of(elements, own.center));
        return;
    }
    own.halves = [number + 1, second];
    let in_left = (second - number - 1) as usize;
    let (left_clusters, right_clusters) = below.split_at_mut(in_left);
    let (left_high, right_high) = high.split_at_mut(if is_fine { in_left } else { 0 });
    let (lower, upper) = elements.split_at_mut(half);
    let left = || divide(lower, leaf, first, (&mut *left_clusters, &mut *left_high), number + 1);
    let right = || divide(upper, leaf, first + half as u32, (&mut *right_clusters, &mut *right_high), second);
    join(count, left, right);
    for sum in own_high {
        let way = |cluster: &Cluster| std::array::from_fn(|a| cluster.center[a] - own.center[a]);
        let halves = [(&left_high[0], way(&left_clusters[0])), (&right_high[0], way(&right_clusters[0]))];
        *sum = HighMoments::of_both(halves);
    }
}

/// Centre, reach and expansion of some elements, of a cluster with high moments or without.
fn summarise<E: SurfaceElement>(elements: &[E], is_fine: bool) -> Cluster {
    let mut area = 0.0;
    let mut center = [0.0; 3];
    for e in elements {
        let (own, at) = (e.area(), e.position());
        area += own;
        (0..3).for_each(|a| center[a] += own * at[a]);
    }
    let center = center.map(|c| c / area);
    let mut reach = Reach { area, ..Reach::default() };
    let mut squared = 0.0;
    let mut moments = Moments::default();
    for e in elements {
        let own = e.reach(center);
        reach.farthest = reach.farthest.max(own.farthest);
        reach.powers.iter_mut().zip(own.powers).for_each(|(sum, own)| *sum += own);
        squared += own.area * own.spread * own.spread;
        e.add_to(center, &mut moments);
    }
    reach.spread =
        if is_fine { fifth_root(reach.powers[2] / area, reach.farthest) } else { (squared / area).sqrt() };
    Cluster { center, reach, expansion: Expansion::from(&moments), ..Cluster::default() }
}

/// Centre, reach and expansion of all elements as one cluster.
#[cfg(test)]
pub(super) fn summary_of<E: SurfaceElement>(elements: &[E]) -> ([f64; 3], Reach, Expansion) {
    let Cluster { center, reach, expansion, .. } = summarise(elements, true);
    (center, reach, expansion)
}

fn longest_axis<E: SurfaceElement>(elements: &[E]) -> usize {
    let mut low = [f64::INFINITY; 3];
    let mut high = [f64::NEG_INFINITY; 3];
    for e in elements {
        let at = e.position();
        for a in 0..3 {
            low[a] = low[a].min(at[a]);
            high[a] = high[a].max(at[a]);
        }
    }
    let extent = |a: usize| high[a] - low[a];
    (0..3).fold(0, |best, a| if extent(a) > extent(best) { a } else { best })
}
