//! Where the boundary w = 0.5 meets a plane between two layers of samples, in a brick of any level.
//!
//! Signs come from the samples and, between layers, from the crossing on the edge across the plane, so they are those
//! of the boundary that the Hermite edges describe.
//!
//! An edge in the plane is one side of a line through a face of four lattice edges: the boundary passes the face from
//! crossing to crossing as their normals say ([`BoundaryArc`]).

use super::arc::{ArcEnd, BoundaryArc};
use super::plane::Plane;
use crate::brick::{Brick, Hermite, Ranks, Samples, SignChanges};
use crate::lattice::{Axis, BRICK_CELLS};
use std::sync;

/// The boundary in one layer of a brick's cells.
pub(super) struct Layer {
    brick: sync::Arc<Brick>,
    signs: SignChanges,
    /// Ranks of the Hermite edges; `None` where there are none, as in interior nodes.
    ranks: Option<[Box<Ranks>; 3]>,
    plane: Plane,
    /// Number of the lower layer of samples, and the plane's distance from it in cells, below 1.
    layer: usize,
    part: f64,
}

/// Where the boundary crosses a lattice edge.
#[derive(Clone, Copy, Debug)]
struct Crossing {
    /// From the edge's lower end, 0..1.
    at: f64,
    normal: Option<[f64; 3]>,
}

/// Where the boundary passes an edge in the plane.
#[derive(Clone, Copy, Debug)]
pub(super) struct PlaneCrossing {
    /// From the edge's lower end, 0..1.
    pub at: f64,
    /// Normal of the boundary there, of length 1, by the plane's two sides and its axis.
    pub normal: Option<[f64; 3]>,
    /// How far it may be off, if the boundary bends one way between crossings.
    pub bound: f64,
}

impl PlaneCrossing {
    /// Somewhere on the edge.
    pub const UNKNOWN: PlaneCrossing = PlaneCrossing { at: 0.5, normal: None, bound: 0.5 };
}

impl Layer {
    /// Of the brick; the plane lies `height` samples above its first one, 0 to 32. `None` if the brick is uniform.
    pub fn new(brick: &sync::Arc<Brick>, plane: Plane, height: f64) -> Option<Layer> {
        let Brick::Counts { samples, hermite } = &**brick else { return None };
        let signs = SignChanges::of(samples);
        let complete = hermite.edges.each_ref().map(Vec::len) == signs.counts();
        let ranks = complete.then(|| Axis::ALL.map(|axis| signs.ranks(axis)));
        let layer = (height as usize).min(BRICK_CELLS - 1);
        Some(Layer { brick: brick.clone(), signs, ranks, plane, layer, part: height - layer as f64 })
    }

    fn parts(&self) -> (&Samples, &Hermite) {
        match &*self.brick {
            Brick::Counts { samples, hermite } => (samples, hermite),
            Brick::Uniform(_) => unreachable!("a uniform brick has no layer"),
        }
    }

    /// Whether the point of the plane above sample `uv` lies inside.
    pub fn is_inside(&self, uv: [usize; 2]) -> bool {
        let low = self.plane.point(uv, self.layer);
        let is_inside = self.signs.is_inside(low);
        if self.part == 0.0 {
            return is_inside;
        }
        match self.crossing(self.plane.axis, low) {
            Some(Crossing { at, .. }) if self.part >= at => !is_inside,
            _ => is_inside,
        }
    }

    /// The sample at a corner of the cells that the plane passes: `above` those in the layer beyond the plane.
    pub fn sample(&self, uv: [usize; 2], above: bool) -> i16 {
        let (samples, _) = self.parts();
        samples.whole(samples.at(self.plane.point(uv, self.layer + usize::from(above))))
    }

    /// The plane's distance from the lower layer of samples, in cells.
    pub fn part(&self) -> f64 {
        self.part
    }

    /// Where along the edge from `uv` in the direction of a side the boundary passes the plane. The ends are known to
    /// differ.
    pub fn passage(&self, uv: [usize; 2], side: usize) -> PlaneCrossing {
        let mut end = uv;
        end[side] += 1;
        let along = self.plane.sides()[side];
        let [a, b] = [uv, end].map(|uv| self.plane.point(uv, self.layer));
        let lower = self.crossing(along, a);
        if self.part == 0.0 {
            let found =
                |Crossing { at, normal }| PlaneCrossing { at, normal: self.turned(normal), bound: 0.0 };
            return lower.map_or(PlaneCrossing::UNKNOWN, found);
        }
        match self.through_face(a, b, along) {
            Some(ends) => self.on_arc(ends, side),
            None => PlaneCrossing::UNKNOWN,
        }
    }

    /// The crossings between which the boundary passes the face above an edge at the plane's height, each as its place along
    /// the edge and height.
    fn through_face(&self, a: [usize; 3], b: [usize; 3], along: Axis) -> Option<[ArcEnd; 2]> {
        let mut above = a;
        above[self.plane.axis.index()] += 1;
        let end = |at: [f64; 2], crossing: Crossing| ArcEnd { at, normal: crossing.normal };
        let lower = self.crossing(along, a).map(|crossing| end([crossing.at, 0.0], crossing));
        let upper = self.crossing(along, above).map(|crossing| end([crossing.at, 1.0], crossing));
        let first = self.crossing(self.plane.axis, a).map(|crossing| end([0.0, crossing.at], crossing));
        let last = self.crossing(self.plane.axis, b).map(|crossing| end([1.0, crossing.at], crossing));
        let ends = match (lower, upper, first, last) {
            // Two passages: the insides are kept apart, so each leads from an edge in a layer to the one across beside
            // what is inside.
            (Some(lower), Some(upper), Some(first), Some(last)) => {
                let beside = |at_start| if at_start { first } else { last };
                let starts_inside = self.signs.is_inside(a);
                match self.part < first.at[1].min(last.at[1]) {
                    true => [lower, beside(starts_inside)],
                    false => [upper, beside(!starts_inside)],
                }
            }
            _ => {
                let mut found = [lower, upper, first, last].into_iter().flatten();
                [found.next()?, found.next()?]
            }
        };
        (ends[0].at[1] != ends[1].at[1]).then_some(ends)
    }

    /// Where the boundary between two crossings of a face is at the plane's height.
    fn on_arc(&self, ends: [ArcEnd; 2], side: usize) -> PlaneCrossing {
        let (along, across) = (self.plane.sides()[side], self.plane.sides()[1 - side]);
        let axes = [along, self.plane.axis, across].map(Axis::index);
        let [from, to] =
            ends.map(|ArcEnd { at, normal }| ArcEnd { at, normal: normal.map(|n| axes.map(|a| n[a])) });
        let arc = BoundaryArc::new([0.0; 2], from, to);
        let Some((at, normal)) = arc.at_height(self.part) else { return PlaneCrossing::UNKNOWN };
        let mut in_plane = [0.0; 3];
        let normal = normal.map(|[n_along, n_axis, n_across]| {
            (in_plane[side], in_plane[1 - side], in_plane[2]) = (n_along, n_across, n_axis);
            in_plane
        });
        PlaneCrossing { at: at.clamp(0.0, 1.0), normal, bound: arc.width_bound(self.part) }
    }

    /// A normal by the plane's sides and its axis.
    fn turned(&self, normal: Option<[f64; 3]>) -> Option<[f64; 3]> {
        let [right, up] = self.plane.sides();
        normal.map(|n| [right, up, self.plane.axis].map(|axis| n[axis.index()]))
    }

    /// Where on the lattice edge from the sample the boundary crosses it, if it does.
    fn crossing(&self, axis: Axis, [i, j, k]: [usize; 3]) -> Option<Crossing> {
        if self.signs.edges(axis, j, k) >> i & 1 == 0 {
            return None;
        }
        let (samples, hermite) = self.parts();
        if let Some(ranks) = &self.ranks {
            let rank = self.signs.rank(axis, [i, j, k], &ranks[axis.index()]);
            let edge = hermite.edges[axis.index()][rank];
            return Some(Crossing { at: edge.fraction(), normal: Some(edge.normal.to_vector()) });
        }
        let mut end = [i, j, k];
        end[axis.index()] += 1;
        let [a, b] = [[i, j, k], end].map(|ijk| samples.value(ijk).clamp(0.0, 1.0));
        Some(Crossing { at: ((0.5 - a) / (b - a)).clamp(0.0, 1.0), normal: None })
    }
}
