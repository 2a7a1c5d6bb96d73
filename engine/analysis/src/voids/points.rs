//! Points of boundaries, and distances between them.

use crate::lattice::{dot, minus};

/// A crossing of a void's boundary, in lattice units from the root's corner.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Point {
    /// Where it is.
    pub at: [f32; 3],
    /// Unit normal, from the solid into the void.
    pub normal: [f32; 3],
    /// The component; [`OUTER`] of the outer surface.
    pub component: u32,
}

/// Stands for the outside in [`Point::component`].
pub(super) const OUTER: u32 = u32::MAX;

/// Points in a leaf of the tree.
const LEAF_POINTS: usize = 16;

/// A k-d tree of points (Bentley 1975), in the order of the slice that it takes: each node splits its part in the middle.
pub(super) struct PointTree {
    points: Vec<Point>,
    /// By place of a splitting point, how it splits.
    splits: Vec<Split>,
}

/// How a node of the tree is split, at the place of its middle point.
#[derive(Clone, Copy, Default)]
struct Split {
    axis: u8,
    /// The component of all its points, if they have one.
    only: Option<u32>,
}

/// What is sought: the nearest point that counts, and nearer than the best one so far.
struct Search<'a, F> {
    from: [f64; 3],
    counts: F,
    /// Points of this component do not count, so nodes of it alone are not searched.
    without: Option<u32>,
    /// The square of its distance, and the point.
    best: (f64, Option<&'a Point>),
}

impl PointTree {
    /// Of some points, at best sorted so that neighbours are near.
    pub fn new(mut points: Vec<Point>) -> PointTree {
        let mut splits = vec![Split::default(); points.len()];
        arrange(&mut points, &mut splits);
        PointTree { points, splits }
    }

    /// All points.
    pub fn points(&self) -> &[Point] {
        &self.points
    }

    /// The nearest point to `from` of those that count, if one is nearer than `within`, and how far it is.
    pub fn nearest(
        &self,
        from: [f64; 3],
        within: f64,
        counts: impl Fn(&Point) -> bool,
    ) -> Option<(f64, &Point)> {
        let search = Search { from, counts, without: None, best: (within * within, None) };
        search.run((&self.points, &self.splits))
    }

    /// The nearest point to `from` of other components than this one, likewise.
    pub fn nearest_beside(&self, from: [f64; 3], within: f64, component: u32) -> Option<(f64, &Point)> {
        let counts = |point: &Point| point.component != component;
        let search = Search { from, counts, without: Some(component), best: (within * within, None) };
        search.run((&self.points, &self.splits))
    }
}

/// The axis along which some points extend farthest.
fn longest(points: &[Point]) -> usize {
    let extent = |a: usize| {
        let each = points.iter().map(|point| point.at[a]);
        each.clone().fold(f32::NEG_INFINITY, f32::max) - each.fold(f32::INFINITY, f32::min)
    };
    let extents = [0, 1, 2].map(extent);
    (0..3).max_by(|&a, &b| extents[a].total_cmp(&extents[b])).unwrap_or(0)
}

/// Brings the median along the longest axis into the middle, and so on with both halves.
fn arrange(points: &mut [Point], splits: &mut [Split]) {
    if points.len() <= LEAF_POINTS {
        return;
    }
    let component = points[0].component;
    let only = points.iter().all(|point| point.component == component).then_some(component);
    let (axis, middle) = (longest(points), points.len() / 2);
    points.select_nth_unstable_by(middle, |a, b| {
        let places = a.at.iter().zip(&b.at).map(|(a, b)| a.total_cmp(b));
        places.fold(a.at[axis].total_cmp(&b.at[axis]), std::cmp::Ordering::then)
    });
    splits[middle] = Split { axis: axis as u8, only };
    let ((low, high), (low_splits, high_splits)) = (points.split_at_mut(middle), splits.split_at_mut(middle));
    arrange(low, low_splits);
    arrange(&mut high[1..], &mut high_splits[1..]);
}

impl<'a, F: Fn(&Point) -> bool> Search<'a, F> {
    fn run(mut self, tree: (&'a [Point], &[Split])) -> Option<(f64, &'a Point)> {
        self.node(tree, [0.0; 3]);
        self.best.1.map(|point| (self.best.0.sqrt(), point))
    }

    fn look(&mut self, point: &'a Point) {
        let away = minus(point.at.map(f64::from), self.from);
        let squared = dot(away, away);
        if squared < self.best.0 && (self.counts)(point) {
            self.best = (squared, Some(point));
        }
    }

    /// `aside` is how far the node lies from the place along each axis, by the planes that were crossed to come to it (Arya &
    /// Mount 1993).
    fn node(&mut self, (points, splits): (&'a [Point], &[Split]), aside: [f64; 3]) {
        if points.len() <= LEAF_POINTS {
            points.iter().for_each(|point| self.look(point));
            return;
        }
        let middle = points.len() / 2;
        let Split { axis, only } = splits[middle];
        if only.is_some() && only == self.without {
            return;
        }
        let axis = usize::from(axis);
        self.look(&points[middle]);
        let beyond = self.from[axis] - f64::from(points[middle].at[axis]);
        let low = (&points[..middle], &splits[..middle]);
        let high = (&points[middle + 1..], &splits[middle + 1..]);
        let (near, far) = if beyond < 0.0 { (low, high) } else { (high, low) };
        self.node(near, aside);
        let mut aside = aside;
        aside[axis] = beyond;
        if dot(aside, aside) < self.best.0 {
            self.node(far, aside);
        }
    }
}

/// The diameter of the largest ball that fits among points of one boundary, by shrinking balls (Ma, Bae & Choi 2012): a ball
/// that touches the boundary at a point shrinks until no other point is in it, and the largest of these touches at least at
/// one of the points tried. `largest` bounds the radius.
pub(super) fn inscribed(tree: &PointTree, largest: f64) -> f64 {
    const MOST_TRIED: usize = 20_000;
    const STEPS: usize = 40;
    let step = tree.points.len().div_ceil(MOST_TRIED).max(1);
    let mut best = 0.0f64;
    for point in tree.points.iter().step_by(step) {
        let (at, normal) = (point.at.map(f64::from), point.normal.map(f64::from));
        let centre = |radius: f64| [0, 1, 2].map(|a| at[a] + radius * normal[a]);
        let mut radius = largest;
        // One that cannot become the largest is soon told.
        if best > 0.0 && tree.nearest(centre(best), best * (1.0 - 1e-6), |_| true).is_some() {
            continue;
        }
        for _ in 0..STEPS {
            let Some((_, other)) = tree.nearest(centre(radius), radius * (1.0 - 1e-9), |p| p.at != point.at)
            else {
                break;
            };
            let away = minus(other.at.map(f64::from), at);
            let along = dot(away, normal);
            if along <= 0.0 || radius <= best {
                break;
            }
            radius = radius.min(0.5 * dot(away, away) / along);
        }
        best = best.max(radius);
    }
    2.0 * best
}

/// How far a point is from the piece of surface around another: from its plane where that piece is near, else from the point.
pub(super) fn distance(from: [f64; 3], to: &Point, reach: f64) -> f64 {
    let away = minus(from, to.at.map(f64::from));
    let along = dot(away, to.normal.map(f64::from));
    let beside = (dot(away, away) - along * along).max(0.0).sqrt();
    if beside <= reach { along.abs() } else { dot(away, away).sqrt() }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lattice::mix;

    fn random(n: u64) -> f64 {
        (mix(n.wrapping_mul(0x9e37_79b9_7f4a_7c15)) >> 11) as f64 / (1u64 << 53) as f64
    }

    #[test]
    fn the_nearest_point_is_that_of_a_search_of_all() {
        let point = |n: u64| Point {
            at: [0, 1, 2].map(|a| (if n < 1000 { 20.0 } else { 100.0 } * random(3 * n + a)) as f32),
            normal: [0.0; 3],
            // Parts of the tree have one component alone.
            component: if n < 1000 { 1 } else { (n % 3) as u32 },
        };
        let points: Vec<Point> = (0..2000).map(point).collect();
        let tree = PointTree::new(points.clone());
        for n in 0..200 {
            let from = [0, 1, 2].map(|a| 100.0 * random(9000 + 3 * n + a));
            let far = |p: &Point| {
                let away = minus(p.at.map(f64::from), from);
                dot(away, away).sqrt()
            };
            let expected = points.iter().filter(|p| p.component != 1).map(far).fold(f64::INFINITY, f64::min);
            let found = tree.nearest(from, f64::INFINITY, |p| p.component != 1).unwrap();
            assert!((found.0 - expected).abs() < 1e-9);
            assert!(tree.nearest(from, 0.9 * expected, |p| p.component != 1).is_none());
            assert_eq!(tree.nearest_beside(from, f64::INFINITY, 1), Some(found));
        }
    }

    #[test]
    fn the_largest_ball_in_a_box_and_in_a_ball() {
        // Points of a box of 20 by 30 by 40, and of a ball with a radius of 10.
        let mut sides = Vec::new();
        for (axis, half) in [10.0f32, 15.0, 20.0].into_iter().enumerate() {
            for sign in [-1.0f32, 1.0] {
                for (p, q) in (0..41).flat_map(|p| (0..41).map(move |q| (p, q))) {
                    let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
                    let halves = [10.0f32, 15.0, 20.0];
                    let (mut at, mut normal) = ([0.0; 3], [0.0; 3]);
                    (at[axis], normal[axis]) = (sign * half, -sign);
                    at[u] = halves[u] * (p as f32 / 20.0 - 1.0);
                    at[v] = halves[v] * (q as f32 / 20.0 - 1.0);
                    sides.push(Point { at, normal, component: 0 });
                }
            }
        }
        let diameter = inscribed(&PointTree::new(sides), 50.0);
        assert!((diameter - 20.0).abs() < 0.1, "{diameter}");
        let ball = (0..2000).map(|n| {
            let z = (2.0 * f64::from(n) + 1.0) / 2000.0 - 1.0;
            let (turn, across) = (2.399_963 * f64::from(n), (1.0 - z * z).sqrt());
            let at = [across * turn.cos(), across * turn.sin(), z];
            Point { at: at.map(|c| (10.0 * c) as f32), normal: at.map(|c| -c as f32), component: 0 }
        });
        let diameter = inscribed(&PointTree::new(ball.collect()), 50.0);
        assert!((diameter - 20.0).abs() < 0.02, "{diameter}");
    }
}
