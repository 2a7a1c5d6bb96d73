//! A bounding volume hierarchy over the facets of a closed soup: winding numbers at points, and boxes by distance.
//!
//! Facets are put in the order of the leaves; the tree is the halves of that order, so it holds boxes and nothing else:
//! 42 to 48 bytes a facet, facets included.

use crate::StlFacet;
use crate::vector::{V3, cross, dot, sub};

/// Facets of a leaf. Smaller ones take more memory and hardly less time.
const LEAF: usize = 8;

/// Lower and upper corner.
pub(crate) type BoxCorners = [[f32; 3]; 2];

/// The hierarchy.
pub(crate) struct Bvh {
    facets: Vec<StlFacet>,
    boxes: Vec<BoxCorners>,
}

/// A part of the order of facets.
#[derive(Clone, Copy)]
pub(crate) struct BvhNode {
    index: usize,
    low: usize,
    high: usize,
}

/// A facet's corners in double precision.
#[inline]
pub(crate) fn corners(facet: &StlFacet) -> [V3; 3] {
    let corner = |v: &[f32; 3]| [f64::from(v[0]), f64::from(v[1]), f64::from(v[2])];
    [corner(&facet[0]), corner(&facet[1]), corner(&facet[2])]
}

/// A facet's normal, twice its area long.
pub(crate) fn normal([a, b, c]: &[V3; 3]) -> V3 {
    cross(sub(*b, *a), sub(*c, *a))
}

impl Bvh {
    /// The tree of a soup. Facets without area are left out: no point is on one side of them.
    pub fn new(mut facets: Vec<StlFacet>) -> Bvh {
        facets.retain(|facet| normal(&corners(facet)) != [0.0; 3]);
        order(&mut facets);
        let mut tree = Bvh { facets, boxes: Vec::new() };
        if let Some(root) = tree.root() {
            let leaves = tree.facets.len().div_ceil(LEAF).next_power_of_two();
            tree.boxes = vec![[[f32::INFINITY; 3], [f32::NEG_INFINITY; 3]]; 2 * leaves - 1];
            tree.bound(root);
        }
        tree
    }

    /// The facets in the tree's order.
    pub fn facets(&self) -> &[StlFacet] {
        &self.facets
    }

    /// All facets, if there are any.
    pub fn root(&self) -> Option<BvhNode> {
        (!self.facets.is_empty()).then_some(BvhNode { index: 0, low: 0, high: self.facets.len() })
    }

    /// The box around a node.
    pub fn bounds(&self, node: BvhNode) -> &BoxCorners {
        &self.boxes[node.index]
    }

    /// The halves of a node, or the numbers of a leaf's facets.
    pub fn open(&self, node: BvhNode) -> Result<[BvhNode; 2], std::ops::Range<usize>> {
        let BvhNode { index, low, high } = node;
        if high - low <= LEAF {
            return Err(low..high);
        }
        let middle = low.midpoint(high);
        Ok([
            BvhNode { index: 2 * index + 1, low, high: middle },
            BvhNode { index: 2 * index + 2, low: middle, high },
        ])
    }

    fn bound(&mut self, node: BvhNode) -> BoxCorners {
        let bounds = match self.open(node) {
            Ok(halves) => {
                let [a, b] = halves.map(|half| self.bound(half));
                [std::array::from_fn(|k| a[0][k].min(b[0][k])), std::array::from_fn(|k| a[1][k].max(b[1][k]))]
            }
            Err(leaf) => bounds_of(&self.facets[leaf]),
        };
        self.boxes[node.index] = bounds;
        bounds
    }

    /// The winding numbers of a closed soup at points close to each other, on none of its facets.
    ///
    /// Counts the facets that the ray along +z leaves by, less those it enters by. On which side of an edge the ray
    /// passes is computed from the edge's lower end, so the facets on both sides of it agree and no ray slips through.
    pub fn windings<const N: usize>(&self, points: [V3; N]) -> [i64; N] {
        // A path down the tree, and beside it a half of each node.
        let mut open = [BvhNode { index: 0, low: 0, high: 0 }; 64];
        let (mut count, mut w) = (0, [0; N]);
        if let Some(root) = self.root() {
            (open[0], count) = (root, 1);
        }
        while count > 0 {
            count -= 1;
            let node = open[count];
            let [low, high] = &self.boxes[node.index];
            let beside = |p: &V3, k: usize| p[k] < f64::from(low[k]) || p[k] > f64::from(high[k]);
            if points.iter().all(|p| beside(p, 0) || beside(p, 1) || p[2] > f64::from(high[2])) {
                continue;
            }
            match self.open(node) {
                Ok(halves) => {
                    open[count..count + 2].copy_from_slice(&halves);
                    count += 2;
                }
                Err(leaf) => {
                    for facet in &self.facets[leaf] {
                        for (w, p) in w.iter_mut().zip(points) {
                            *w += crossing(facet, p);
                        }
                    }
                }
            }
        }
        w
    }

    /// Calls `visit` with the number of each facet whose box meets the one given.
    pub fn meeting(&self, bounds: &BoxCorners, mut visit: impl FnMut(usize)) {
        let apart =
            |other: &BoxCorners| (0..3).any(|k| bounds[1][k] < other[0][k] || bounds[0][k] > other[1][k]);
        let mut open = Vec::with_capacity(48);
        open.extend(self.root());
        while let Some(node) = open.pop() {
            if apart(&self.boxes[node.index]) {
                continue;
            }
            match self.open(node) {
                Ok(halves) => open.extend(halves),
                Err(leaf) => leaf.filter(|&n| !apart(&bounds_of(&self.facets[n..=n]))).for_each(&mut visit),
            }
        }
    }
}

/// The box around some facets.
pub(crate) fn bounds_of(facets: &[StlFacet]) -> BoxCorners {
    let mut bounds = [[f32::INFINITY; 3], [f32::NEG_INFINITY; 3]];
    for corner in facets.iter().flatten() {
        for k in 0..3 {
            bounds[0][k] = bounds[0][k].min(corner[k]);
            bounds[1][k] = bounds[1][k].max(corner[k]);
        }
    }
    bounds
}

/// Halves by the median along the axis on which middles are spread widest, and again.
fn order(facets: &mut [StlFacet]) {
    if facets.len() <= LEAF {
        return;
    }
    let middle = |facet: &StlFacet, k: usize| facet[0][k] + facet[1][k] + facet[2][k];
    let spread = |k: usize| {
        let bounds = |(low, high): (f32, f32), m: f32| (low.min(m), high.max(m));
        let of = facets.iter().map(|facet| middle(facet, k));
        let (low, high) = of.fold((f32::INFINITY, f32::NEG_INFINITY), bounds);
        high - low
    };
    let spreads: [f32; 3] = std::array::from_fn(spread);
    let axis = (1..3).fold(0, |widest, k| if spreads[k] > spreads[widest] { k } else { widest });
    let half = facets.len() / 2;
    facets.select_nth_unstable_by(half, |a, b| middle(a, axis).total_cmp(&middle(b, axis)));
    let (low, high) = facets.split_at_mut(half);
    if half < 4096 {
        order(low);
        order(high);
    } else {
        rayon::join(|| order(low), || order(high));
    }
}

/// +1 if the ray from `p` along +z leaves by the facet, −1 if it enters, 0 if it does not meet it.
#[inline]
fn crossing(facet: &StlFacet, p: V3) -> i64 {
    let [a, b, c] = facet;
    // Most facets of a leaf are beside the ray.
    for k in 0..2 {
        if f64::from(a[k].min(b[k]).min(c[k])) > p[k] || f64::from(a[k].max(b[k]).max(c[k])) < p[k] {
            return 0;
        }
    }
    let side = left_of(a, b, p);
    if left_of(b, c, p) != side || left_of(c, a, p) != side {
        return 0;
    }
    // The facet's plane is above the point if the latter is below it as its normal goes.
    let facet = corners(facet);
    let above = (dot(normal(&facet), sub(p, facet[0])) < 0.0) == side;
    match (above, side) {
        (false, _) => 0,
        (true, true) => 1,
        (true, false) => -1,
    }
}

/// Whether, seen from above, `p` is left of the line from a to b; never the same for the line from b to a.
#[inline]
fn left_of(a: &[f32; 3], b: &[f32; 3], p: V3) -> bool {
    let turn = |a: &[f32; 3], b: &[f32; 3]| {
        let [ax, ay, bx, by] = [f64::from(a[0]), f64::from(a[1]), f64::from(b[0]), f64::from(b[1])];
        (bx - ax) * (p[1] - ay) - (by - ay) * (p[0] - ax) >= 0.0
    };
    if a[0] < b[0] || (a[0] == b[0] && a[1] < b[1]) { turn(a, b) } else { !turn(b, a) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::judge::winding::solid_angle_sum;
    use crate::pile::random_pile;
    use crate::{Mesh, Rng};

    #[test]
    fn winding_numbers_are_those_of_the_solid_angles() {
        for seed in 0..12 {
            let pile = Mesh::merged(&random_pile(300 + seed, 1 + 3 * seed as usize));
            let soup = pile.soup();
            let exact: Vec<_> = soup.iter().map(corners).collect();
            let (tree, (low, high)) = (Bvh::new(soup), pile.bounds());
            let mut rng = Rng::new(seed);
            for _ in 0..300 {
                let p = std::array::from_fn(|k| rng.range(low[k] - 1.0, high[k] + 1.0));
                let sum = solid_angle_sum(&exact, p);
                assert!(
                    (sum - tree.windings([p])[0] as f64).abs() < 1e-6,
                    "{seed} {p:?}: {sum}, {}",
                    tree.windings([p])[0]
                );
            }
        }
        assert_eq!(Bvh::new(Vec::new()).windings([[0.0; 3]]), [0]);
    }

    #[test]
    fn every_facet_that_meets_a_box_is_told_once() {
        let soup = Mesh::merged(&random_pile(7, 20)).soup();
        let tree = Bvh::new(soup);
        let asked = [[-3.0, -2.0, -1.0], [2.0, 4.0, 3.0]];
        let mut told = Vec::new();
        tree.meeting(&asked, |n| told.push(n));
        told.sort_unstable();
        let meets = |facet: &StlFacet| {
            let own = bounds_of(std::slice::from_ref(facet));
            (0..3).all(|k| asked[1][k] >= own[0][k] && asked[0][k] <= own[1][k])
        };
        let expected: Vec<usize> = (0..tree.facets().len()).filter(|&n| meets(&tree.facets()[n])).collect();
        assert!(!expected.is_empty());
        assert_eq!(told, expected);
    }
}
