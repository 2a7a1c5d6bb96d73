//! The nearest neighbours of points, equal distances in the order of the points' numbers, so that the answer
//! depends on nothing but the points.

use rayon::prelude::*;
use std::cmp::Ordering;
use std::collections::BinaryHeap;

/// Points of a part that is not divided.
const LEAF_POINTS: usize = 8;

/// Points in a balanced k-d tree (Bentley 1975): a part's middle point divides it, those before it are lower
/// along the part's axis.
pub(super) struct KdTree {
    points: Vec<([f64; 3], u32)>,
}

/// A point found.
#[derive(Clone, Copy, Debug)]
pub(super) struct Neighbour {
    /// Distance squared.
    pub squared: f64,
    pub number: u32,
}

impl Ord for Neighbour {
    fn cmp(&self, other: &Self) -> Ordering {
        self.squared.total_cmp(&other.squared).then(self.number.cmp(&other.number))
    }
}

impl PartialOrd for Neighbour {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl PartialEq for Neighbour {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other).is_eq()
    }
}

impl Eq for Neighbour {}

impl KdTree {
    pub fn new(points: &[[f64; 3]]) -> KdTree {
        let mut points: Vec<_> = points.iter().zip(0..).map(|(p, number)| (*p, number)).collect();
        divide(&mut points, 0);
        KdTree { points }
    }

    /// The `count` points nearest to `p`, in order.
    pub fn around(&self, p: [f64; 3], count: usize) -> Vec<Neighbour> {
        let mut found = BinaryHeap::with_capacity(count + 1);
        if count > 0 {
            search(&self.points, 0, p, count, &mut found);
        }
        found.into_sorted_vec()
    }
}

/// Points whose neighbours are looked for, of a larger cloud evenly many.
const SAMPLED_POINTS: usize = 1 << 16;

/// The median distance of points from their nearest neighbours; 0 of fewer than two. Of large clouds that of 65,536 points,
/// evenly taken from the list.
pub fn median_distance(points: &[[f64; 3]]) -> f64 {
    if points.len() < 2 {
        return 0.0;
    }
    let tree = KdTree::new(points);
    let step = points.len().div_ceil(SAMPLED_POINTS);
    let sampled: Vec<[f64; 3]> = points.iter().step_by(step).copied().collect();
    let squared = |p: &[f64; 3]| tree.around(*p, 2).last().map_or(0.0, |nearest| nearest.squared);
    let mut all: Vec<f64> = sampled.par_iter().map(squared).collect();
    let middle = all.len() / 2;
    all.select_nth_unstable_by(middle, f64::total_cmp).1.sqrt()
}

fn divide(points: &mut [([f64; 3], u32)], axis: usize) {
    if points.len() <= LEAF_POINTS {
        return;
    }
    let middle = points.len() / 2;
    let order =
        |a: &([f64; 3], u32), b: &([f64; 3], u32)| a.0[axis].total_cmp(&b.0[axis]).then(a.1.cmp(&b.1));
    points.select_nth_unstable_by(middle, order);
    let (lower, upper) = points.split_at_mut(middle);
    let next = (axis + 1) % 3;
    if lower.len() > 4096 {
        rayon::join(|| divide(lower, next), || divide(&mut upper[1..], next));
    } else {
        divide(lower, next);
        divide(&mut upper[1..], next);
    }
}

fn search(
    points: &[([f64; 3], u32)],
    axis: usize,
    p: [f64; 3],
    count: usize,
    found: &mut BinaryHeap<Neighbour>,
) {
    let mut consider = |(q, number): &([f64; 3], u32)| {
        let squared = (0..3).map(|a| (q[a] - p[a]) * (q[a] - p[a])).sum();
        let neighbour = Neighbour { squared, number: *number };
        if found.len() < count {
            found.push(neighbour);
        } else if let Some(mut farthest) = found.peek_mut()
            && neighbour < *farthest
        {
            *farthest = neighbour;
        }
    };
    if points.len() <= LEAF_POINTS {
        points.iter().for_each(consider);
        return;
    }
    let middle = points.len() / 2;
    consider(&points[middle]);
    let beyond = p[axis] - points[middle].0[axis];
    let (lower, upper) = (&points[..middle], &points[middle + 1..]);
    let (near, far) = if beyond < 0.0 { (lower, upper) } else { (upper, lower) };
    search(near, (axis + 1) % 3, p, count, found);
    // Equal distances too: the number decides between them.
    let worst = found.peek().map_or(f64::INFINITY, |n| n.squared);
    if found.len() < count || beyond * beyond <= worst {
        search(far, (axis + 1) % 3, p, count, found);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use brickfield_bench_data::Rng;

    #[test]
    fn neighbours_are_those_of_a_full_search() {
        let mut rng = Rng::new(1);
        for count in [1, 5, 9, 100, 3000] {
            // Coarse positions, so that many distances are equal and points coincide.
            let points: Vec<[f64; 3]> =
                (0..count).map(|_| std::array::from_fn(|_| f64::from(rng.below(12)))).collect();
            let tree = KdTree::new(&points);
            for k in [1, 7, 40] {
                let p = std::array::from_fn(|_| f64::from(rng.below(12)));
                let squared = |q: &[f64; 3]| (0..3).map(|a| (q[a] - p[a]) * (q[a] - p[a])).sum();
                let mut all: Vec<Neighbour> = points
                    .iter()
                    .zip(0..)
                    .map(|(q, number)| Neighbour { squared: squared(q), number })
                    .collect();
                all.sort_unstable();
                all.truncate(k);
                assert_eq!(tree.around(p, k), all);
            }
        }
    }
}
