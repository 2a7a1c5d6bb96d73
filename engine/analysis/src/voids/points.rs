//! Points of boundaries, and distances between them.

use crate::lattice::{ROOT_BITS, dot, minus, morton};

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

/// Points by component, and those of one in the order in which they came.
pub(super) struct ByComponent {
    points: Vec<Point>,
    /// By component, the first of its points; the number of all at the end.
    first: Vec<u32>,
}

impl ByComponent {
    /// Of points that belong to components.
    pub fn of(points: &[Point]) -> ByComponent {
        let components = points.iter().map(|point| point.component as usize + 1).max().unwrap_or(0);
        let mut next = vec![0u32; components + 1];
        points.iter().for_each(|point| next[point.component as usize + 1] += 1);
        (1..next.len()).for_each(|n| next[n] += next[n - 1]);
        let first = next.clone();
        let mut sorted = points.to_vec();
        for point in points {
            let place = &mut next[point.component as usize];
            sorted[*place as usize] = *point;
            *place += 1;
        }
        ByComponent { points: sorted, first }
    }

    /// Those of one component.
    pub fn points(&self, component: u32) -> &[Point] {
        let ends = self.first.get(component as usize..component as usize + 2);
        ends.map_or(&[], |ends| &self.points[ends[0] as usize..ends[1] as usize])
    }
}

/// Points in a leaf of the tree.
const LEAF_POINTS: usize = 16;
/// Bits of a coordinate that its place on the Morton curve has.
const CODE_BITS: u32 = 21;

/// A tree of points: each node splits its part of the list in two, and has the box around it. Where points lie on faces
/// far away, boxes tell how far better than splitting planes. Along the Morton curve halves are nearly as compact as those of a sort along the
/// longest side, which took longer than all searches.
pub(super) struct PointTree {
    points: Vec<Point>,
    /// A node, those of its lower half, those of its upper half.
    nodes: Vec<PointNode>,
}

/// A node of the tree.
#[derive(Clone, Copy, Default)]
struct PointNode {
    low: [f32; 3],
    high: [f32; 3],
    /// The component of all its points, if they have one.
    only: Option<u32>,
    /// How many nodes its lower half has, and how many points; 0 of a leaf.
    lower: u32,
    middle: u32,
}

impl PointNode {
    fn of(points: &[Point]) -> PointNode {
        let (mut low, mut high) = ([f32::INFINITY; 3], [f32::NEG_INFINITY; 3]);
        for point in points {
            for a in 0..3 {
                (low[a], high[a]) = (low[a].min(point.at[a]), high[a].max(point.at[a]));
            }
        }
        let component = points.first().map(|point| point.component);
        let is_one = points.iter().all(|point| Some(point.component) == component);
        PointNode { low, high, only: component.filter(|_| is_one), lower: 0, middle: 0 }
    }

    /// The square of the distance of a place from the box.
    #[inline]
    fn squared(&self, from: [f64; 3]) -> f64 {
        let away = [0, 1, 2].map(|a| {
            let (low, high) = (f64::from(self.low[a]), f64::from(self.high[a]));
            (low - from[a]).max(from[a] - high).max(0.0)
        });
        dot(away, away)
    }

    /// Both together.
    fn and(&self, other: &PointNode) -> PointNode {
        PointNode {
            low: [0, 1, 2].map(|a| self.low[a].min(other.low[a])),
            high: [0, 1, 2].map(|a| self.high[a].max(other.high[a])),
            only: self.only.filter(|_| self.only == other.only),
            lower: 0,
            middle: 0,
        }
    }
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
    /// Of some points, at best in Morton order: any other makes searches slow.
    pub fn new(points: Vec<Point>) -> PointTree {
        let mut nodes = Vec::new();
        add_nodes(&points, &mut nodes);
        PointTree { points, nodes }
    }

    /// The nearest point to `from` of those that count, if one is nearer than `within`, and how far it is.
    pub fn nearest(
        &self,
        from: [f64; 3],
        within: f64,
        counts: impl Fn(&Point) -> bool,
    ) -> Option<(f64, &Point)> {
        let search = Search { from, counts, without: None, best: (within * within, None) };
        search.run((&self.points, &self.nodes))
    }

    /// Some point that is nearer than `within`.
    fn any(&self, from: [f64; 3], within: f64) -> Option<&Point> {
        any_nearer((&self.points, &self.nodes), from, within * within)
    }

    /// The nearest point to `from` of other components than this one, likewise.
    pub fn nearest_beside(&self, from: [f64; 3], within: f64, component: u32) -> Option<(f64, &Point)> {
        let counts = |point: &Point| point.component != component;
        let search = Search { from, counts, without: Some(component), best: (within * within, None) };
        search.run((&self.points, &self.nodes))
    }
}

/// Adds the nodes of a part of a list in Morton order, which is split where the widest cubes of the curve end.
fn add_nodes(points: &[Point], nodes: &mut Vec<PointNode>) {
    if points.len() <= LEAF_POINTS {
        nodes.push(PointNode::of(points));
        return;
    }
    let own = nodes.len();
    nodes.push(PointNode::default());
    let middle = split_of(points);
    let (low, high) = points.split_at(middle);
    add_nodes(low, nodes);
    let second = nodes.len();
    add_nodes(high, nodes);
    nodes[own] = PointNode {
        lower: (second - own - 1) as u32,
        middle: middle as u32,
        ..nodes[own + 1].and(&nodes[second])
    };
}

/// The first point with another leading bit of its code than the first of all; half of them where all have one code, or in another
/// order.
fn split_of(points: &[Point]) -> usize {
    let code =
        |point: &Point| morton(point.at.map(|c| ((c - 1.0).max(0.0) as u32) >> (ROOT_BITS - CODE_BITS)));
    let [first, last] = [0, points.len() - 1].map(|n| code(&points[n]));
    let bit = (first ^ last).checked_ilog2();
    let split = bit.map(|bit| points.partition_point(|point| code(point) >> bit == first >> bit));
    split.filter(|split| (1..points.len()).contains(split)).unwrap_or(points.len() / 2)
}

/// Brings points that lie in a cube into Morton order, so that neighbours in the list are neighbours in space: of parts of such a
/// list a [`PointTree`] is made without another sort.
pub(super) fn sort_along_curve(points: &mut Vec<Point>, low: [f64; 3], edge: f64) {
    /// Places along an edge, of which a code has 33 bits and a list no more than 2^31 points.
    const PLACES: f64 = 2048.0;
    let code = |(n, point): (usize, &Point)| {
        let place =
            |a: usize| ((f64::from(point.at[a]) - low[a]) / edge * PLACES).clamp(0.0, PLACES - 1.0) as u32;
        morton([place(0), place(1), place(2)]) << 31 | n as u64
    };
    let mut order: Vec<u64> = points.iter().enumerate().map(code).collect();
    order.sort_unstable();
    *points = order.iter().map(|code| points[(code & ((1 << 31) - 1)) as usize]).collect();
}

/// The points and the nodes of a part of the tree.
type Part<'a> = (&'a [Point], &'a [PointNode]);

/// Both halves of a part; `None` of a leaf.
fn halves<'a>((points, nodes): Part<'a>) -> Option<[Part<'a>; 2]> {
    let PointNode { lower, middle, .. } = nodes[0];
    let (lower, middle) = (lower as usize, middle as usize);
    let low = (&points[..middle], &nodes[1..1 + lower]);
    (lower > 0).then(|| [low, (&points[middle..], &nodes[1 + lower..])])
}

/// One of the points that are nearer than the root of `squared`: the first that is found ends the search.
fn any_nearer<'a>(part: Part<'a>, from: [f64; 3], squared: f64) -> Option<&'a Point> {
    if part.1[0].squared(from) >= squared {
        return None;
    }
    match halves(part) {
        None => part.0.iter().find(|point| is_nearer(point.at, from, squared)),
        Some([low, high]) => {
            let (near, far) =
                if high.1[0].squared(from) < low.1[0].squared(from) { (high, low) } else { (low, high) };
            any_nearer(near, from, squared).or_else(|| any_nearer(far, from, squared))
        }
    }
}

/// Whether a place is nearer than the root of `squared`.
#[inline]
fn is_nearer(at: [f32; 3], from: [f64; 3], squared: f64) -> bool {
    let away = minus(at.map(f64::from), from);
    dot(away, away) < squared
}

impl<'a, F: Fn(&Point) -> bool> Search<'a, F> {
    fn run(mut self, part: Part<'a>) -> Option<(f64, &'a Point)> {
        self.part(part, part.1[0].squared(self.from));
        self.best.1.map(|point| (self.best.0.sqrt(), point))
    }

    fn look(&mut self, point: &'a Point) {
        let away = minus(point.at.map(f64::from), self.from);
        let squared = dot(away, away);
        if squared < self.best.0 && (self.counts)(point) {
            self.best = (squared, Some(point));
        }
    }

    /// Looks through a part whose box is the root of `squared` away.
    fn part(&mut self, part: Part<'a>, squared: f64) {
        let only = part.1[0].only;
        if squared >= self.best.0 || only.is_some() && only == self.without {
            return;
        }
        let Some([low, high]) = halves(part) else {
            part.0.iter().for_each(|point| self.look(point));
            return;
        };
        let [near, far] = [low, high].map(|half| half.1[0].squared(self.from));
        if far < near {
            self.part(high, far);
            self.part(low, near);
        } else {
            self.part(low, near);
            self.part(high, far);
        }
    }
}

/// The diameter of the largest ball that fits among points of one boundary, by shrinking balls (Ma, Bae & Choi 2012): a ball
/// that touches the boundary at a point shrinks until no other point is in it, and the largest of these touches at least at
/// one of the points. `largest` bounds the radius; balls that are wider by less than `step` are not looked for.
pub(super) fn inscribed(tree: &PointTree, largest: f64, step: f64) -> f64 {
    const STEPS: usize = 40;
    /// Of so many points one is asked first.
    const FIRST_POINTS: usize = 61;
    let mut best = 0.0f64;
    // What lay in the ball of one point lies most often in those of the next.
    let mut seen = RecentPoints::default();
    // A ball that is nearly the largest, from points all over the boundary, leaves few to be shrunk in the order of the list.
    for point in tree.points.iter().step_by(FIRST_POINTS).chain(&tree.points) {
        let (at, normal) = (point.at.map(f64::from), point.normal.map(f64::from));
        let centre = |radius: f64| [0, 1, 2].map(|a| at[a] + radius * normal[a]);
        let mut radius = largest;
        // One that cannot become the largest is soon told: in a round void nearly any point lies in a ball that is larger.
        let larger = best + 0.5 * step;
        if best > 0.0 && seen.is_any(tree, centre(larger), larger * (1.0 - 1e-6)) {
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

/// Points that were found to be near others.
#[derive(Default)]
struct RecentPoints {
    points: [Option<[f32; 3]>; 4],
    next: usize,
}

impl RecentPoints {
    /// Whether some point is nearer than `within`; these are asked first.
    fn is_any(&mut self, tree: &PointTree, from: [f64; 3], within: f64) -> bool {
        if self.points.iter().flatten().any(|at| is_nearer(*at, from, within * within)) {
            return true;
        }
        let found = tree.any(from, within);
        if let Some(point) = found {
            self.points[self.next] = Some(point.at);
            self.next = (self.next + 1) % self.points.len();
        }
        found.is_some()
    }
}

/// The least distance of the pieces of surface around points of one component from those of others, if there are any. Parts
/// of the tree that are too far away are left out as a whole.
pub(super) fn gap(own: &PointTree, others: &PointTree, component: u32, reach: f64) -> Option<f64> {
    let mut search = GapSearch { others, component, reach, best: f64::INFINITY };
    search.part((&own.points, &own.nodes));
    search.best.is_finite().then_some(search.best)
}

struct GapSearch<'a> {
    others: &'a PointTree,
    component: u32,
    reach: f64,
    best: f64,
}

impl GapSearch<'_> {
    fn part(&mut self, part: Part<'_>) {
        let Some(parts) = halves(part) else {
            part.0.iter().for_each(|point| self.point(point));
            return;
        };
        let mut parts = parts.map(|part| (self.least(part), part));
        if parts[1].0 < parts[0].0 {
            parts.reverse();
        }
        // What is nearer may make the other one too far.
        for (least, part) in parts {
            if least < self.within() {
                self.part(part);
            }
        }
    }

    /// Points as far away as this do not count any more.
    fn within(&self) -> f64 {
        /// More than rounding.
        const WIDER: f64 = 1.0 + 1e-6;
        (self.best + self.reach) * WIDER
    }

    /// No point of a part is nearer to others than this; infinite if none of them counts any more.
    fn least(&self, part: Part<'_>) -> f64 {
        let PointNode { low, high, .. } = part.1[0];
        let [low, high] = [low, high].map(|corner| corner.map(f64::from));
        let middle = [0, 1, 2].map(|a| 0.5 * (low[a] + high[a]));
        let half = minus(high, middle);
        let radius = dot(half, half).sqrt();
        let found = self.others.nearest_beside(middle, self.within() + radius, self.component);
        found.map_or(f64::INFINITY, |(distance, _)| distance - radius)
    }

    fn point(&mut self, point: &Point) {
        let at = point.at.map(f64::from);
        if let Some((_, other)) = self.others.nearest_beside(at, self.best + self.reach, self.component) {
            self.best = self.best.min(distance(at, other, self.reach));
        }
    }
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
    fn gaps_are_those_of_a_search_from_all_points() {
        let normal = |n: u64| {
            let at = [0, 1, 2].map(|a| random(7000 + 3 * n + a) - 0.5);
            at.map(|c| (c / dot(at, at).sqrt()) as f32)
        };
        let point = |n: u64| {
            let component = (n % 5) as u32;
            let at = [0, 1, 2].map(|a| (f64::from(component) * 15.0 + 40.0 * random(3 * n + a)) as f32);
            Point { at, normal: normal(n), component }
        };
        let points: Vec<Point> = (0..4000).map(point).collect();
        let (by_component, others) = (ByComponent::of(&points), PointTree::new(points.clone()));
        let reach = 0.75;
        for component in 0..5 {
            let own = by_component.points(component);
            assert!(own.len() == 800 && own.iter().all(|point| point.component == component));
            let to_next = |point: &Point| {
                let at = point.at.map(f64::from);
                let (_, other) = others.nearest_beside(at, f64::INFINITY, component).unwrap();
                distance(at, other, reach)
            };
            let expected = own.iter().map(to_next).fold(f64::INFINITY, f64::min);
            assert_eq!(gap(&PointTree::new(own.to_vec()), &others, component, reach), Some(expected));
        }
        let alone = PointTree::new(by_component.points(0).to_vec());
        assert_eq!(gap(&alone, &alone, 0, reach), None);
        assert!(by_component.points(5).is_empty());
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
        let diameter = inscribed(&PointTree::new(sides), 50.0, 0.01);
        assert!((diameter - 20.0).abs() < 0.1, "{diameter}");
        let ball = (0..2000).map(|n| {
            let z = (2.0 * f64::from(n) + 1.0) / 2000.0 - 1.0;
            let (turn, across) = (2.399_963 * f64::from(n), (1.0 - z * z).sqrt());
            let at = [across * turn.cos(), across * turn.sin(), z];
            Point { at: at.map(|c| (10.0 * c) as f32), normal: at.map(|c| -c as f32), component: 0 }
        });
        let diameter = inscribed(&PointTree::new(ball.collect()), 50.0, 0.01);
        assert!((diameter - 20.0).abs() < 0.02, "{diameter}");
    }
}
