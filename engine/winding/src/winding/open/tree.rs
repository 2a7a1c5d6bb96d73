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
    pub reach: Reach,
    pub expansion: Expansion,
    /// Its elements.
    first: u32,
    count: u32,
    /// Number of its second half among the clusters; the first half is the next cluster. 0 if undivided.
    second: u32,
    /// Fills the last eight bytes.
    unused: u32,
}

impl Cluster {
    /// Its halves, if it is divided; it has the number `own`.
    pub fn halves(&self, own: u32) -> Option<[u32; 2]> {
        (self.second != 0).then_some([own + 1, self.second])
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
        if !elements.is_empty() {
            divide(&mut elements, leaf, 0, (&mut clusters, &mut high), 0);
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
        let undivided = self.clusters.iter().filter(|c| c.second == 0);
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
        let axis = longest_axis(elements);
        let key = |e: &E| e.position();
        elements.select_nth_unstable_by(half, |a, b| {
            let (a, b) = (key(a), key(b));
            let from = |i: usize| a[(axis + i) % 3].total_cmp(&b[(axis + i) % 3]);
            from(0).then(from(1)).then(from(2))
        });
    }
    let (own, below) = clusters.split_first_mut().expect("one for each part");
    let is_fine = !high.is_empty();
    *own = summarise(elements, is_fine);
    (own.first, own.count, own.second) = (first, count as u32, second);
    let (own_high, high) = high.split_at_mut(usize::from(is_fine));
    if second == 0 {
        own_high.iter_mut().for_each(|high| *high = HighMoments::of(elements, own.center));
        return;
    }
    let in_left = (second - number - 1) as usize;
    let (left_clusters, right_clusters) = below.split_at_mut(in_left);
    let (left_high, right_high) = high.split_at_mut(if is_fine { in_left } else { 0 });
    let (lower, upper) = elements.split_at_mut(half);
    let mut left = || divide(lower, leaf, first, (&mut *left_clusters, &mut *left_high), number + 1);
    let mut right =
        || divide(upper, leaf, first + half as u32, (&mut *right_clusters, &mut *right_high), second);
    // Below that, handing over costs more than it gains.
    if count > 4096 {
        rayon::join(left, right);
    } else {
        left();
        right();
    }
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
