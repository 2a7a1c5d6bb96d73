//! The hierarchy of clusters.

use super::cell::ExpansionCache;
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

/// What one takes.
pub(super) const CLUSTER_BYTES: usize = size_of::<Cluster>();

/// Elements of surface in clusters, halved again and again.
#[derive(Debug)]
pub struct ClusterTree<E> {
    elements: LargeArray<E>,
    clusters: LargeArray<Cluster>,
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
        let mut clusters = LargeArray::zeroed(clusters_of::<E>(elements.len()), elements.room())?;
        if !elements.is_empty() {
            divide(&mut elements, 0, &mut clusters, 0);
        }
        Ok(ClusterTree { elements, clusters, made: ExpansionCache::default() })
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

    /// The sum over all elements at a position 64 and more of the root's edges away, where four elements
    /// span less than a 36th of the distance, so that their expansion is off by less than 1e-9.
    pub fn far_at(&self, p: [f64; 3]) -> f64 {
        let undivided = self.clusters.iter().filter(|c| c.second == 0);
        undivided.map(|c| c.seen_from(p)).sum()
    }
}

/// Number of clusters over this many elements.
fn clusters_of<E: SurfaceElement>(elements: usize) -> usize {
    match elements {
        0 => 0,
        n if n <= E::LEAF_ELEMENTS => 1,
        n => 1 + clusters_of::<E>(n / 2) + clusters_of::<E>(n - n / 2),
    }
}

/// Fills in the clusters over `elements`, the first of which has the number `first` of all; the first of
/// `clusters` has the number `number`.
fn divide<E: SurfaceElement>(elements: &mut [E], first: u32, clusters: &mut [Cluster], number: u32) {
    let count = elements.len();
    let half = count / 2;
    let second = if count > E::LEAF_ELEMENTS { number + 1 + clusters_of::<E>(half) as u32 } else { 0 };
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
    *own = summarise(elements);
    (own.first, own.count, own.second) = (first, count as u32, second);
    if second == 0 {
        return;
    }
    let (left, right) = below.split_at_mut((second - number - 1) as usize);
    let (lower, upper) = elements.split_at_mut(half);
    let mut left = || divide(lower, first, left, number + 1);
    let mut right = || divide(upper, first + half as u32, right, second);
    // Below that, handing over costs more than it gains.
    if count > 4096 {
        rayon::join(left, right);
    } else {
        left();
        right();
    }
}

/// Centre, reach and expansion of some elements.
fn summarise<E: SurfaceElement>(elements: &[E]) -> Cluster {
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
    reach.spread = (squared / area).sqrt();
    Cluster { center, reach, expansion: Expansion::from(&moments), ..Cluster::default() }
}

/// Centre, reach and expansion of all elements as one cluster.
#[cfg(test)]
pub(super) fn summary_of<E: SurfaceElement>(elements: &[E]) -> ([f64; 3], Reach, Expansion) {
    let Cluster { center, reach, expansion, .. } = summarise(elements);
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
