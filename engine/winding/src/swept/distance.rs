//! How far a point is from a solid.

use super::solid::{ConvexSolid, SweptSolid};
use crate::lattice::{dot, minus};

/// Steps of the search along a move; each leaves two thirds.
const STEPS: usize = 64;

impl SweptSolid {
    /// The distance of a point to the solid in units; inside below 0, and at least as far from the surface as that says.
    pub fn distance(&self, at: [f64; 3]) -> f64 {
        match self.shape() {
            ConvexSolid::Box { low, high } => {
                let over = [0, 1, 2].map(|a| (low[a] - at[a]).max(at[a] - high[a]));
                of_slabs(&over)
            }
            ConvexSolid::Ball { at: centre, way, radius } => {
                let from = minus(at, *centre);
                let squared = dot(*way, *way);
                let step = if squared > 0.0 { (dot(from, *way) / squared).clamp(0.0, 1.0) } else { 0.0 };
                let off = minus(from, way.map(|c| c * step));
                dot(off, off).sqrt() - radius
            }
            ConvexSolid::Frustum { at: place, way, frame, height, radius } => {
                let from = frame.map(|row| dot(row, minus(at, *place)));
                let way = frame.map(|row| dot(row, *way));
                let at_step = |s: f64| {
                    let [x, y, z] = minus(from, way.map(|c| c * s));
                    of_profile([(x * x + y * y).sqrt(), z], *height, *radius)
                };
                least(at_step, from, way)
            }
        }
    }
}

/// The least value of a function that is convex along the move.
fn least(at_step: impl Fn(f64) -> f64, from: [f64; 3], way: [f64; 3]) -> f64 {
    let across = way[0] * way[0] + way[1] * way[1];
    if across + way[2] * way[2] == 0.0 {
        return at_step(0.0);
    }
    if way[2] == 0.0 {
        // The nearer to the axis the better.
        return at_step(((from[0] * way[0] + from[1] * way[1]) / across).clamp(0.0, 1.0));
    }
    let (mut low, mut high) = (0.0, 1.0);
    for _ in 0..STEPS {
        let third = (high - low) / 3.0;
        if at_step(low + third) < at_step(high - third) { high -= third } else { low += third }
    }
    at_step(low).min(at_step(high))
}

/// Of what lies between planes across directions at right angles: how far beyond each of them a point is.
fn of_slabs(over: &[f64]) -> f64 {
    let beyond = over.iter().map(|c| c.max(0.0) * c.max(0.0)).sum::<f64>().sqrt();
    if beyond > 0.0 { beyond } else { over.iter().copied().fold(f64::NEG_INFINITY, f64::max) }
}

/// Of a frustum that stands, at a distance from its axis and a height.
fn of_profile([r, z]: [f64; 2], height: [f64; 2], radius: [f64; 2]) -> f64 {
    let (dz, dr) = (height[1] - height[0], radius[1] - radius[0]);
    if dr == 0.0 {
        return of_slabs(&[r - radius[0], (height[0] - z).max(z - height[1])]);
    }
    let length = (dz * dz + dr * dr).sqrt();
    // How far beyond the line of the side, and where along it.
    let side = ((r - radius[0]) * dz - (z - height[0]) * dr) / length;
    let flat = (height[0] - z).max(z - height[1]);
    if side <= 0.0 && flat <= 0.0 {
        return side.max(flat);
    }
    let to_segment = |a: [f64; 2], b: [f64; 2]| {
        let (u, v) = ([b[0] - a[0], b[1] - a[1]], [r - a[0], z - a[1]]);
        let squared = u[0] * u[0] + u[1] * u[1];
        let t = if squared > 0.0 { ((u[0] * v[0] + u[1] * v[1]) / squared).clamp(0.0, 1.0) } else { 0.0 };
        ((v[0] - t * u[0]).powi(2) + (v[1] - t * u[1]).powi(2)).sqrt()
    };
    let (low, high) = ([radius[0], height[0]], [radius[1], height[1]]);
    to_segment(low, high).min(to_segment([0.0, height[0]], low)).min(to_segment([0.0, height[1]], high))
}
