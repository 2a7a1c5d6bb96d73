//! Vectors of three doubles: sums in the order of the axes, none fused, so that their bits are the same everywhere.

/// Three components, or coordinates.
pub type Vector = [f64; 3];

/// The inner product.
#[inline]
pub fn dot(a: Vector, b: Vector) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// The cross product.
#[inline]
pub fn cross(a: Vector, b: Vector) -> Vector {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

/// The difference.
#[inline]
pub fn minus(a: Vector, b: Vector) -> Vector {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

/// The length.
#[inline]
pub fn length(a: Vector) -> f64 {
    dot(a, a).sqrt()
}

/// A vector of length 1 in the same direction; one of length 0 points upward.
#[inline]
pub fn unit(a: Vector) -> Vector {
    let length = length(a);
    if length > 0.0 { a.map(|c| c / length) } else { [0.0, 0.0, 1.0] }
}

/// Two unit vectors that make a right-handed frame with a third (Duff et al. 2017, "Building an Orthonormal Basis,
/// Revisited").
#[inline]
pub fn frame([x, y, z]: Vector) -> [Vector; 2] {
    let sign = 1f64.copysign(z);
    let a = -1.0 / (sign + z);
    let b = x * y * a;
    [[1.0 + sign * x * x * a, sign * b, -sign * x], [b, sign + y * y * a, -y]]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_are_right_handed() {
        for n in [[0.0, 0.0, 1.0], [0.0, 0.0, -1.0], [0.6, -0.64, 0.48], [-0.6, 0.64, -0.48]] {
            let [u, v] = frame(n);
            let w = cross(u, v);
            assert!((0..3).all(|a| (w[a] - n[a]).abs() < 1e-12));
        }
    }
}
