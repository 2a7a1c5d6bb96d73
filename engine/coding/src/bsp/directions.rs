//! Directions as points with whole coordinates on an octahedron.

/// One in the units of vectors.
pub const ONE: i32 = 1 << 14;

/// Parts of a cell in which distances are told.
pub const SUB: i32 = 256;
/// More than any support.
const SUPPORTS: usize = 512;

/// All directions (x, y, z) of whole numbers with |x| + |y| + |z| = radius, with their unit vectors.
///
/// The set does not change when axes change places or signs, so a direction can be told relative to another without seams.
#[derive(Clone)]
pub struct Directions {
    radius: i32,
    /// Unit vectors in 1/16384, and their supports. Of those with z at least 0, then of the others: by x, then y.
    vectors: Vec<[i16; 4]>,
    /// For each support 2^32 by one more, rounded up.
    per_support: Vec<u64>,
}

impl Directions {
    /// With a radius of 1 to 127.
    pub fn new(radius: u8) -> Directions {
        let radius = i32::from(radius);
        let side = 2 * radius + 1;
        let mut vectors = Vec::with_capacity((2 * side * side) as usize);
        for sign in [1, -1] {
            for x in -radius..=radius {
                for y in -radius..=radius {
                    let z = (radius - x.abs() - y.abs()).max(0) * sign;
                    let [x, y, z] = unit([x, y, z].map(i64::from));
                    let support =
                        [x, y, z].iter().map(|c| i32::from(*c).abs()).sum::<i32>() / (2 * ONE / SUB);
                    vectors.push([x, y, z, support as i16]);
                }
            }
        }
        let per_support = (1..=SUPPORTS as u64).map(|n| (1 << 32) / n + 1).collect();
        Directions { radius, vectors, per_support }
    }

    /// The sum of magnitudes of all directions.
    pub fn radius(&self) -> i32 {
        self.radius
    }

    /// The unit vector in 1/16384.
    #[inline]
    pub fn vector(&self, normal: [i8; 3]) -> [i32; 3] {
        self.supported(normal).0
    }

    /// The unit vector in 1/16384, and its support: the farthest from a cell's middle at which its plane meets the cell, in 1/256 of it.
    #[inline]
    pub fn supported(&self, normal: [i8; 3]) -> ([i32; 3], i32) {
        let [x, y, z] = normal.map(i32::from);
        let side = 2 * self.radius + 1;
        let half = if z < 0 { side * side } else { 0 };
        let [x, y, z, support] =
            self.vectors[(half + (x + self.radius) * side + y + self.radius) as usize].map(i32::from);
        ([x, y, z], support)
    }

    /// A distance, below 2^18, in 1/16 of one more than a support; rounded towards 0.
    #[inline]
    pub fn in_support(&self, distance: i32, support: i32) -> i32 {
        // A product instead of a division: exact as long as what was rounded up, times the distance, is less than one.
        let product = u64::from(distance.unsigned_abs() * 16) * self.per_support[support as usize];
        let share = (product >> 32) as i32;
        if distance < 0 {
            -share
        } else {
            share
        }
    }

    /// A direction near a vector that is not zero.
    pub fn near(&self, vector: [i64; 3]) -> [i8; 3] {
        let sum = vector.iter().map(|c| c.abs()).sum::<i64>().max(1);
        let radius = i64::from(self.radius);
        let mut rounded = if sum < 1 << 22 {
            // Divisions of 32 bits take a fraction of the time.
            vector.map(|c| i64::from((2 * c.abs() * radius + sum) as u32 / (2 * sum) as u32))
        } else {
            vector.map(|c| (2 * c.abs() * radius + sum) / (2 * sum))
        };
        // What rounding adds or takes is made good where it matters least: at the largest.
        let largest = (0..3).max_by_key(|&axis| (vector[axis].abs(), axis)).unwrap_or(0);
        let others = rounded.iter().sum::<i64>() - rounded[largest];
        rounded[largest] = (radius - others).max(0);
        let mut out = [0i8; 3];
        for axis in 0..3 {
            out[axis] = (if vector[axis] < 0 { -rounded[axis] } else { rounded[axis] }) as i8;
        }
        out
    }
}

/// A vector in 1/16384 of its length.
fn unit(vector: [i64; 3]) -> [i16; 3] {
    // Lengths with 20 more bits.
    let square = vector.iter().map(|c| (c * c) as u64).sum::<u64>() << 40;
    let length = root(square).max(1) as i64;
    vector.map(|c| ((c.abs() * i64::from(ONE) * (1 << 20) + length / 2) / length * c.signum()) as i16)
}

/// The square root, rounded down.
fn root(square: u64) -> u64 {
    let (mut root, mut rest) = (0u64, square);
    let mut bit = 1u64 << 62;
    while bit > rest {
        bit >>= 2;
    }
    while bit != 0 {
        if rest >= root + bit {
            rest -= root + bit;
            root = (root >> 1) + bit;
        } else {
            root >>= 1;
        }
        bit >>= 2;
    }
    root
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn distances_in_supports_are_those_that_division_gives() {
        let directions = Directions::new(1);
        for support in 0..SUPPORTS as i32 {
            for distance in (-200_000..200_000).step_by(61).chain(-700..700).chain([(1 << 18) - 1]) {
                assert_eq!(directions.in_support(distance, support), distance * 16 / (support + 1));
            }
        }
    }

    #[test]
    fn directions_are_unit_vectors_and_near_what_was_asked_for() {
        for radius in [1, 2, 31, 32, 63, 127] {
            let directions = Directions::new(radius);
            let r = i32::from(radius);
            for x in -r..=r {
                for y in -(r - x.abs())..=r - x.abs() {
                    for z in [r - x.abs() - y.abs(), x.abs() + y.abs() - r] {
                        let normal = [x, y, z].map(|c| c as i8);
                        let vector = directions.vector(normal);
                        let length = f64::from(x * x + y * y + z * z).sqrt();
                        for (a, b) in vector.iter().zip([x, y, z]) {
                            assert!((f64::from(*a) / 16384.0 - f64::from(b) / length).abs() < 1e-4);
                        }
                        assert_eq!(directions.near(vector.map(i64::from)), normal);
                    }
                }
            }
        }
    }
}
