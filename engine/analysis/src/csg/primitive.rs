//! Operands without a file: half-spaces, boxes, cylinders and balls.

use crate::error::{Error, Result};
use crate::lattice::{Axis, RootCube};
use crate::swept::{ConvexSolid, SweptSolid};

/// A body that is told by a few numbers, in the unit of the store.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Primitive {
    /// All on one side of a plane across an axis.
    HalfSpace {
        /// The axis.
        axis: Axis,
        /// Whether it is the side of greater coordinates.
        above: bool,
        /// Where the plane is.
        at: f64,
    },
    /// A box along the axes.
    Box {
        /// Least coordinates.
        min: [f64; 3],
        /// Greatest ones.
        max: [f64; 3],
    },
    /// A round bar along an axis.
    Cylinder {
        /// The axis.
        axis: Axis,
        /// Its coordinates along the other two axes in their order.
        centre: [f64; 2],
        /// Its radius.
        radius: f64,
        /// Where it begins and ends; without, it leaves the root.
        span: Option<(f64, f64)>,
    },
    /// A ball.
    Sphere {
        /// Its centre.
        centre: [f64; 3],
        /// Its radius.
        radius: f64,
    },
}

/// Units from the root's faces beyond which no part lies and no sample of a part's is inside.
const MARGIN: f64 = 2.0;

impl Primitive {
    /// Whether it has no end, so that it cannot be added to a part.
    pub fn is_endless(&self) -> bool {
        matches!(self, Primitive::HalfSpace { .. } | Primitive::Cylinder { span: None, .. })
    }

    /// Least and greatest coordinates; infinite where it has no end.
    pub fn bounds(&self) -> [[f64; 3]; 2] {
        let mut bounds = [[f64::NEG_INFINITY; 3], [f64::INFINITY; 3]];
        match *self {
            Primitive::HalfSpace { axis, above, at } => bounds[usize::from(!above)][axis.index()] = at,
            Primitive::Box { min, max } => bounds = [min, max],
            Primitive::Cylinder { axis, centre, radius, span } => {
                for (other, centre) in axis.others_in_order().into_iter().zip(centre) {
                    bounds[0][other.index()] = centre - radius;
                    bounds[1][other.index()] = centre + radius;
                }
                if let Some((from, to)) = span {
                    (bounds[0][axis.index()], bounds[1][axis.index()]) = (from, to);
                }
            }
            Primitive::Sphere { centre, radius } => {
                bounds = [centre.map(|c| c - radius), centre.map(|c| c + radius)];
            }
        }
        bounds
    }

    /// The solid in a root cube. Flat faces stand at even units, as vertices of meshes do; so a box is sample by sample, and
    /// crossing by crossing, what a build of its facets gives.
    ///
    /// # Errors
    /// [`Error::Setting`] if it is empty or no number.
    pub fn solid(&self, root: RootCube) -> Result<SweptSolid> {
        let end = f64::from(1u32 << crate::lattice::ROOT_BITS) - MARGIN;
        let scale = 1.0 / root.unit();
        let [low, high] = self.bounds();
        let is_number = |v: f64| !v.is_nan();
        if !low.iter().chain(&high).copied().all(is_number) || (0..3).any(|a| low[a] >= high[a]) {
            return Err(Error::setting(
                "the body holds nothing",
                "give least coordinates first, and a radius above 0",
            ));
        }
        let snap = |world: f64, axis: usize| {
            let units = (world - root.origin[axis]) * scale;
            if units <= MARGIN {
                MARGIN
            } else if units >= end {
                end
            } else {
                2.0 * (units * 0.5 + 0.5).floor()
            }
        };
        let faces = |bounds: [f64; 3]| [0, 1, 2].map(|a| snap(bounds[a], a));
        Ok(SweptSolid::new(match *self {
            Primitive::HalfSpace { .. } | Primitive::Box { .. } => {
                ConvexSolid::Box { low: faces(low), high: faces(high) }
            }
            Primitive::Cylinder { axis, centre, radius, .. } => {
                let a = axis.index();
                let [u, v] = axis.others_in_order().map(Axis::index);
                let mut at = [0.0; 3];
                at[u] = (centre[0] - root.origin[u]) * scale;
                at[v] = (centre[1] - root.origin[v]) * scale;
                let mut frame = [[0.0; 3]; 3];
                (frame[0][u], frame[1][v], frame[2][a]) = (1.0, 1.0, 1.0);
                let height = [snap(low[a], a), snap(high[a], a)];
                ConvexSolid::Frustum { at, way: [0.0; 3], frame, height, radius: [radius * scale; 2] }
            }
            Primitive::Sphere { centre, radius } => {
                let at = [0, 1, 2].map(|a| (centre[a] - root.origin[a]) * scale);
                ConvexSolid::Ball { at, way: [0.0; 3], radius: radius * scale }
            }
        }))
    }
}
