//! The hierarchy of clusters, and the choice of clusters that keeps a bound on the error.

use super::moments::{Element, Expansion, Moments, Reach, error_bound};
use crate::lattice::Units;
use std::cmp::Ordering;
use std::collections::BinaryHeap;

/// Elements of a cluster that is not divided: an expansion costs about as much as two solid angles.
const LEAF_ELEMENTS: usize = 4;

/// A cluster of neighbouring elements.
#[derive(Clone, Copy, Debug, Default)]
struct Cluster {
    center: [f64; 3],
    reach: Reach,
    expansion: Expansion,
    /// Its elements.
    first: u32,
    count: u32,
    /// Number of its second half among the clusters; the first half is the next cluster. 0 if undivided.
    second: u32,
}

impl Cluster {
    fn seen_from(&self, p: [f64; 3]) -> f64 {
        self.expansion.at(std::array::from_fn(|a| self.center[a] - p[a]))
    }
}

/// Elements of surface in clusters, halved again and again.
#[derive(Debug)]
pub struct ClusterTree<E> {
    elements: Vec<E>,
    clusters: Vec<Cluster>,
}

/// The clusters and single elements by which all points of a box are answered.
#[derive(Clone, Debug, Default)]
pub struct Selection {
    clusters: Vec<u32>,
    elements: Vec<u32>,
}

/// A cluster that may be divided; the one with the largest bound comes first.
struct Candidate {
    bound: f64,
    cluster: u32,
}

impl Ord for Candidate {
    fn cmp(&self, other: &Self) -> Ordering {
        self.bound.total_cmp(&other.bound).then(other.cluster.cmp(&self.cluster))
    }
}

impl PartialOrd for Candidate {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl PartialEq for Candidate {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other).is_eq()
    }
}

impl Eq for Candidate {}

impl<E: Element> ClusterTree<E> {
    /// Of any elements; the order matters to nothing but which of two equal ones comes first.
    pub fn new(mut elements: Vec<E>) -> ClusterTree<E> {
        let mut clusters = vec![Cluster::default(); clusters_of(elements.len())];
        if !elements.is_empty() {
            divide(&mut elements, 0, &mut clusters, 0);
        }
        ClusterTree { elements, clusters }
    }

    /// The elements in the tree's order.
    pub fn elements(&self) -> &[E] {
        &self.elements
    }

    /// The sum over all elements one by one.
    pub fn exact_at(&self, p: Units) -> f64 {
        self.elements.iter().map(|e| e.share_at(p)).sum()
    }

    /// Chooses what answers every point of the box `low..high` with an error of at most `budget`: the cluster
    /// with the largest bound is divided until the bounds of all add up to no more. So the choice takes the
    /// fewest clusters where they matter least, and the sum of bounds holds whatever the elements are.
    pub fn select(&self, low: [f64; 3], high: [f64; 3], budget: f64) -> Selection {
        let mut selection = Selection::default();
        if self.clusters.is_empty() {
            return selection;
        }
        let candidate = |cluster: u32| {
            let Cluster { center, reach, .. } = self.clusters[cluster as usize];
            Candidate { bound: error_bound(reach, distance_to_box(center, low, high)), cluster }
        };
        let finite = |bound: f64| if bound.is_finite() { bound } else { 0.0 };
        let root = candidate(0);
        // The bounds that are finite; less than a share of 2^-30 for the rounding of the sum.
        let mut total = finite(root.bound);
        let enough = budget * (1.0 - 1e-9);
        let mut heap = BinaryHeap::from([root]);
        while let Some(worst) = heap.peek() {
            if worst.bound.is_finite() && total <= enough {
                break;
            }
            let Candidate { bound, cluster } = heap.pop().expect("just seen");
            total -= finite(bound);
            let Cluster { first, count, second, .. } = self.clusters[cluster as usize];
            if second == 0 {
                selection.elements.extend(first..first + count);
                continue;
            }
            for half in [cluster + 1, second] {
                let half = candidate(half);
                total += finite(half.bound);
                heap.push(half);
            }
        }
        selection.clusters.extend(heap.into_iter().map(|c| c.cluster));
        // A fixed order of summation, and of memory.
        selection.clusters.sort_unstable();
        selection.elements.sort_unstable();
        selection
    }

    /// The sum over all elements at a lattice position of the box for which the selection was made.
    pub fn at(&self, selection: &Selection, p: Units) -> f64 {
        let near: f64 = selection.elements.iter().map(|&e| self.elements[e as usize].share_at(p)).sum();
        let p = p.map(f64::from);
        near + selection.clusters.iter().map(|&c| self.clusters[c as usize].seen_from(p)).sum::<f64>()
    }

    /// The sum over all elements at a position 64 and more of the root's edges away, where four elements
    /// span less than a 36th of the distance, so that their expansion is off by less than 1e-9.
    pub fn far_at(&self, p: [f64; 3]) -> f64 {
        let undivided = self.clusters.iter().filter(|c| c.second == 0);
        undivided.map(|c| c.seen_from(p)).sum()
    }
}

/// Number of clusters over this many elements.
fn clusters_of(elements: usize) -> usize {
    match elements {
        0 => 0,
        1..=LEAF_ELEMENTS => 1,
        n => 1 + clusters_of(n / 2) + clusters_of(n - n / 2),
    }
}

/// Fills in the clusters over `elements`, the first of which has the number `first` of all; the first of
/// `clusters` has the number `number`.
fn divide<E: Element>(elements: &mut [E], first: u32, clusters: &mut [Cluster], number: u32) {
    let count = elements.len();
    let half = count / 2;
    let second = if count > LEAF_ELEMENTS { number + 1 + clusters_of(half) as u32 } else { 0 };
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
fn summarise<E: Element>(elements: &[E]) -> Cluster {
    let mut area = 0.0;
    let mut center = [0.0; 3];
    for e in elements {
        let (own, at) = (e.area(), e.position());
        area += own;
        (0..3).for_each(|a| center[a] += own * at[a]);
    }
    let center = center.map(|c| c / area);
    let mut reach = Reach::default();
    let mut moments = Moments::default();
    for e in elements {
        let own = e.reach(center);
        reach.farthest = reach.farthest.max(own.farthest);
        reach.cubed += own.cubed;
        e.add_to(center, &mut moments);
    }
    Cluster { center, reach, expansion: Expansion::from(&moments), ..Cluster::default() }
}

/// Centre, reach and expansion of all elements as one cluster.
#[cfg(test)]
pub(super) fn summary_of<E: Element>(elements: &[E]) -> ([f64; 3], Reach, Expansion) {
    let Cluster { center, reach, expansion, .. } = summarise(elements);
    (center, reach, expansion)
}

fn longest_axis<E: Element>(elements: &[E]) -> usize {
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

/// Distance of a point from a box.
fn distance_to_box(p: [f64; 3], low: [f64; 3], high: [f64; 3]) -> f64 {
    let outside = |a: usize| (low[a] - p[a]).max(p[a] - high[a]).max(0.0);
    let [x, y, z] = [0, 1, 2].map(outside);
    (x * x + y * y + z * z).sqrt()
}
