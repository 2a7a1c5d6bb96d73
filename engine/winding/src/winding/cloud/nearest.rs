//! The nearest neighbours of points, equal distances in the order of the points' places, so that the answer
//! depends on nothing but the points.

use crate::error::Result;
use crate::large_array::LargeArray;
use bytemuck::Pod;
use rayon::prelude::*;
use std::cmp::Ordering;
use std::ops::Range;

/// Points of a part that is not divided.
const LEAF_POINTS: usize = 8;

/// What has a place.
pub trait Located: Pod + Send + Sync {
    /// Where it is.
    fn place(&self) -> [f64; 3];
}

impl Located for [f64; 3] {
    fn place(&self) -> [f64; 3] {
        *self
    }
}

/// Points in a balanced k-d tree (Bentley 1975): a part's middle point divides it, those before it are lower
/// along the part's axis.
///
/// Points that are near each other have near numbers, so that few pages of large arrays are in use.
#[derive(Debug)]
pub struct KdTree<P> {
    points: LargeArray<P>,
}

/// A point found.
#[derive(Clone, Copy, Debug)]
pub struct Neighbour {
    /// Distance squared.
    pub squared: f64,
    /// Where it is.
    pub place: [f64; 3],
    /// Its number in the tree.
    pub number: u32,
}

/// The same while others are looked for: the less there is to move, the better.
#[derive(Clone, Copy)]
struct FoundPoint {
    squared: f64,
    number: u32,
}

/// A search for the nearest points.
struct NearestSearch<'a, P> {
    points: &'a [P],
    /// Around here.
    place: [f64; 3],
    count: usize,
    /// In order.
    found: Vec<FoundPoint>,
}

/// The order of places: by x, then y, then z.
pub fn by_place(p: [f64; 3], q: [f64; 3]) -> Ordering {
    along_axes(p, q, 0)
}

/// The order along an axis, then along the two that follow it.
fn along_axes(p: [f64; 3], q: [f64; 3], axis: usize) -> Ordering {
    let along = |n: usize| p[(axis + n) % 3].total_cmp(&q[(axis + n) % 3]);
    along(0).then_with(|| along(1)).then_with(|| along(2))
}

impl<P: Located> KdTree<P> {
    /// Puts points into the order of a tree.
    pub fn new(mut points: LargeArray<P>) -> KdTree<P> {
        divide(&mut points, 0);
        KdTree { points }
    }

    /// The points, by number.
    pub fn points(&self) -> &LargeArray<P> {
        &self.points
    }

    /// The same, without the tree.
    pub fn into_points(self) -> LargeArray<P> {
        self.points
    }

    /// The `count` points nearest to `p`, in order.
    pub fn around(&self, p: [f64; 3], count: usize) -> Vec<Neighbour> {
        let points = &self.points[..];
        let mut search = NearestSearch { points, place: p, count, found: Vec::with_capacity(count + 1) };
        if count > 0 {
            search.among(0..points.len(), 0);
        }
        let place = |number: u32| points[number as usize].place();
        let neighbour = |FoundPoint { squared, number }| Neighbour { squared, place: place(number), number };
        search.found.into_iter().map(neighbour).collect()
    }
}

/// Points whose neighbours are looked for, of a larger cloud evenly many.
const SAMPLED_POINTS: usize = 1 << 16;

/// The median distance of points from their nearest neighbours; 0 of fewer than two. Of large clouds that of 65,536 points,
/// evenly taken from the list.
///
/// # Errors
/// If a temporary file for as many points cannot be made.
pub fn median_distance(points: &LargeArray<[f64; 3]>) -> Result<f64> {
    if points.len() < 2 {
        return Ok(0.0);
    }
    let tree = KdTree::new(LargeArray::of_each(points.len(), points.room(), |n| Some(points[n]))?);
    let step = points.len().div_ceil(SAMPLED_POINTS);
    let sampled: Vec<[f64; 3]> = points.iter().step_by(step).copied().collect();
    let squared = |p: &[f64; 3]| tree.around(*p, 2).last().map_or(0.0, |nearest| nearest.squared);
    let mut all: Vec<f64> = sampled.par_iter().map(squared).collect();
    let middle = all.len() / 2;
    Ok(all.select_nth_unstable_by(middle, f64::total_cmp).1.sqrt())
}

fn divide<P: Located>(points: &mut [P], axis: usize) {
    if points.len() <= LEAF_POINTS {
        return;
    }
    let middle = points.len() / 2;
    points.select_nth_unstable_by(middle, |a, b| along_axes(a.place(), b.place(), axis));
    let (lower, upper) = points.split_at_mut(middle);
    let next = (axis + 1) % 3;
    if lower.len() > 4096 {
        rayon::join(|| divide(lower, next), || divide(&mut upper[1..], next));
    } else {
        divide(lower, next);
        divide(&mut upper[1..], next);
    }
}

impl<P: Located> NearestSearch<'_, P> {
    /// Looks among some points, which the one in their middle divides along an axis.
    fn among(&mut self, some: Range<usize>, axis: usize) {
        if some.len() <= LEAF_POINTS {
            some.for_each(|number| self.consider(number));
            return;
        }
        let middle = some.start + some.len() / 2;
        self.consider(middle);
        let beyond = self.place[axis] - self.points[middle].place()[axis];
        let (lower, upper) = (some.start..middle, middle + 1..some.end);
        let (near, far) = if beyond < 0.0 { (lower, upper) } else { (upper, lower) };
        self.among(near, (axis + 1) % 3);
        // Equal distances too: the place decides between them. Of points at the place itself any are as good.
        let worst = self.found.last().map_or(f64::INFINITY, |found| found.squared);
        if self.found.len() < self.count || beyond * beyond <= worst && worst > 0.0 {
            self.among(far, (axis + 1) % 3);
        }
    }

    /// Takes a point among those found if it is nearer than the last of as many as are wanted. Few are, so that a heap would take
    /// longer.
    #[inline]
    fn consider(&mut self, number: usize) {
        let (at, p) = (self.points[number].place(), self.place);
        let squared = (0..3).map(|a| (at[a] - p[a]) * (at[a] - p[a])).sum();
        let point = FoundPoint { squared, number: number as u32 };
        if self.found.len() == self.count {
            if !self.found.last().is_some_and(|farthest| self.is_nearer(&point, farthest)) {
                return;
            }
            self.found.pop();
        }
        let farther = self.found.iter().rev().take_while(|other| self.is_nearer(&point, other)).count();
        self.found.insert(self.found.len() - farther, point);
    }

    /// Equal distances in the order of places.
    #[inline]
    fn is_nearer(&self, one: &FoundPoint, other: &FoundPoint) -> bool {
        let place = |found: &FoundPoint| self.points[found.number as usize].place();
        let of_place = || by_place(place(one), place(other)).then(one.number.cmp(&other.number));
        one.squared < other.squared || one.squared == other.squared && of_place().is_lt()
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
            let tree = KdTree::new(points.clone().into());
            for k in [1, 7, 40] {
                let p = std::array::from_fn(|_| f64::from(rng.below(12)));
                let squared = |q: &[f64; 3]| (0..3).map(|a| (q[a] - p[a]) * (q[a] - p[a])).sum::<f64>();
                let mut all: Vec<[f64; 3]> = points.clone();
                all.sort_unstable_by(|a, b| squared(a).total_cmp(&squared(b)).then(by_place(*a, *b)));
                all.truncate(k);
                let found = tree.around(p, k);
                assert!(found.iter().all(|n| n.place == tree.points()[n.number as usize]));
                assert_eq!(found.iter().map(|n| n.place).collect::<Vec<_>>(), all);
            }
        }
    }
}
