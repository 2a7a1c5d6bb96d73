//! Tilted planes: where their zero lies and how their axes point, from the words of G68.2.
//!
//! Euler angles turn about Z, the turned X, and the turned Z (FANUC B-63942EN, 5.44). P1 turns about the fixed axes in the order
//! that Q gives: I about X, J about Y, K about Z. P2 has three points: the first one is the zero, the second one lies on +X, the
//! third one on the side of +Y. P3 has the directions of X and Z.

use crate::toolpath::gcode::tilt::sine_and_cosine;

/// Largest cosine between the two vectors of P3, of directions that were rounded to three decimals.
const SQUARE: f64 = 2e-3;
/// Sines below this are none.
const STRAIGHT: f64 = 1e-6;

/// What the lines of a plane have told so far.
#[derive(Clone, Debug)]
pub(super) struct PlaneWords {
    /// G68.2 or G68.4, and its P.
    pub code: i64,
    pub form: i64,
    /// Turn about Z, by R, in degrees.
    pub degrees: f64,
    /// Points or vectors, in the order of Q from 1.
    pub told: Vec<[f64; 3]>,
    /// Where its zero lies, as far as a line has told it.
    pub origin: [f64; 3],
}

/// A plane within the part, or within another plane.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct TiltedPlane {
    /// Where its zero lies, in mm.
    pub origin: [f64; 3],
    /// The directions of its X, Y and Z.
    pub axes: [[f64; 3]; 3],
}

impl TiltedPlane {
    /// A plane whose axes are turned by Euler angles in degrees: about Z, X' and Z''.
    pub fn by_euler(origin: [f64; 3], [first, second, third]: [f64; 3]) -> TiltedPlane {
        // Turns about axes that have turned with the plane are those about fixed axes in reverse.
        TiltedPlane { origin, axes: turned(&[(2, third), (0, second), (2, first)]) }
    }

    /// A plane whose axes are turned about the fixed axes of this order, each by its angle in degrees.
    pub fn by_fixed(origin: [f64; 3], degrees: [f64; 3], order: [usize; 3]) -> TiltedPlane {
        TiltedPlane { origin, axes: turned(&order.map(|axis| (axis, degrees[axis]))) }
    }

    /// A plane by its zero, a point on +X, and one on the side of +Y; `None` if they lie on a line. It is turned about its Z.
    pub fn by_points([zero, x, y]: [[f64; 3]; 3], degrees: f64) -> Option<TiltedPlane> {
        let x = unit(minus(x, zero))?;
        let side = unit(minus(y, zero))?;
        let z = cross(x, side);
        if dot(z, z).sqrt() < STRAIGHT {
            return None;
        }
        Some(TiltedPlane { origin: zero, axes: about_z(by_x_and_z(x, unit(z)?), degrees) })
    }

    /// A plane by the directions of X and Z; `None` if they are not square to each other. Z counts where they are not quite.
    pub fn by_vectors(origin: [f64; 3], x: [f64; 3], z: [f64; 3]) -> Option<TiltedPlane> {
        let (x, z) = (unit(x)?, unit(z)?);
        let along = dot(x, z);
        if along.abs() > SQUARE {
            return None;
        }
        let x = if along == 0.0 { x } else { unit([0, 1, 2].map(|a| x[a] - along * z[a]))? };
        Some(TiltedPlane { origin, axes: by_x_and_z(x, z) })
    }

    /// This plane, which lies in the coordinates of another one.
    pub fn within(&self, outer: &TiltedPlane) -> TiltedPlane {
        TiltedPlane { origin: outer.moved(self.origin), axes: self.axes.map(|axis| outer.turned(axis)) }
    }

    /// A direction of the plane in the part.
    fn turned(&self, way: [f64; 3]) -> [f64; 3] {
        [0, 1, 2].map(|a| (0..3).map(|i| way[i] * self.axes[i][a]).sum())
    }

    /// Where a place of the plane lies in the part.
    pub fn moved(&self, at: [f64; 3]) -> [f64; 3] {
        let way = self.turned(at);
        [0, 1, 2].map(|a| self.origin[a] + way[a])
    }

    /// The same of a place that is known in part: what depends on an unknown coordinate is unknown.
    pub fn moved_known(&self, at: [Option<f64>; 3]) -> [Option<f64>; 3] {
        let way = combined(at, |a, i| self.axes[i][a]);
        [0, 1, 2].map(|a| Some(self.origin[a] + way[a]?))
    }

    /// Where a place of the part lies in the plane.
    pub fn back_known(&self, at: [Option<f64>; 3]) -> [Option<f64>; 3] {
        let way = [0, 1, 2].map(|a| Some(at[a]? - self.origin[a]));
        combined(way, |a, i| self.axes[a][i])
    }
}

/// Sums of known coordinates with factors, each unknown if a coordinate that counts in it is.
fn combined(of: [Option<f64>; 3], factor: impl Fn(usize, usize) -> f64) -> [Option<f64>; 3] {
    [0, 1, 2].map(|a| {
        (0..3).filter(|i| factor(a, *i) != 0.0).try_fold(0.0, |sum, i| Some(sum + of[i]? * factor(a, i)))
    })
}

/// The axes after turns about fixed axes, one after the other, in degrees.
fn turned(turns: &[(usize, f64)]) -> [[f64; 3]; 3] {
    let mut axes = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    for &(axis, degrees) in turns {
        let (sine, cosine) = sine_and_cosine(degrees);
        let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
        for of in &mut axes {
            (of[u], of[v]) = (cosine * of[u] - sine * of[v], sine * of[u] + cosine * of[v]);
        }
    }
    axes
}

fn by_x_and_z(x: [f64; 3], z: [f64; 3]) -> [[f64; 3]; 3] {
    [x, cross(z, x), z]
}

/// The axes turned about their Z.
fn about_z([x, y, z]: [[f64; 3]; 3], degrees: f64) -> [[f64; 3]; 3] {
    let (sine, cosine) = sine_and_cosine(degrees);
    let sum = |p: f64, q: f64| [0, 1, 2].map(|a| p * x[a] + q * y[a]);
    [sum(cosine, sine), sum(-sine, cosine), z]
}

fn minus(p: [f64; 3], q: [f64; 3]) -> [f64; 3] {
    [0, 1, 2].map(|a| p[a] - q[a])
}

fn dot(p: [f64; 3], q: [f64; 3]) -> f64 {
    p[0] * q[0] + p[1] * q[1] + p[2] * q[2]
}

fn cross(p: [f64; 3], q: [f64; 3]) -> [f64; 3] {
    [p[1] * q[2] - p[2] * q[1], p[2] * q[0] - p[0] * q[2], p[0] * q[1] - p[1] * q[0]]
}

/// The direction of a vector that has one.
fn unit(v: [f64; 3]) -> Option<[f64; 3]> {
    let length = dot(v, v).sqrt();
    (length > 1e-9 && length.is_finite()).then(|| v.map(|c| c / length))
}
