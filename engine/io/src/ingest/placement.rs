//! Where a mesh stands in a scene: an affine map, and instances of meshes that are placed by such.

use super::polygons::Polygons;

/// An affine map: a row for each coordinate, of factors of x, y, z and what is added.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Placement(pub(super) [[f64; 4]; 3]);

impl Placement {
    /// Where everything stays.
    pub(super) const IDENTITY: Placement =
        Placement([[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]]);

    /// Larger by a factor for each axis.
    pub(super) fn scale(by: [f64; 3]) -> Placement {
        let mut all = Placement::IDENTITY;
        (0..3).for_each(|a| all.0[a][a] = by[a]);
        all
    }

    /// Shifted.
    pub(super) fn shift(by: [f64; 3]) -> Placement {
        let mut all = Placement::IDENTITY;
        (0..3).for_each(|a| all.0[a][3] = by[a]);
        all
    }

    /// Turned by a unit quaternion `x, y, z, w`.
    pub(super) fn turn([x, y, z, w]: [f64; 4]) -> Placement {
        Placement([
            [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - z * w), 2.0 * (x * z + y * w), 0.0],
            [2.0 * (x * y + z * w), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - x * w), 0.0],
            [2.0 * (x * z - y * w), 2.0 * (y * z + x * w), 1.0 - 2.0 * (x * x + y * y), 0.0],
        ])
    }

    /// This map after `first`.
    pub(super) fn after(&self, first: &Placement) -> Placement {
        let entry = |row: usize, column: usize| {
            let sum = (0..3).map(|k| self.0[row][k] * first.0[k][column]).sum::<f64>();
            if column == 3 { sum + self.0[row][3] } else { sum }
        };
        Placement(std::array::from_fn(|row| std::array::from_fn(|column| entry(row, column))))
    }

    /// Where a point comes to lie.
    pub(super) fn place(&self, p: [f64; 3]) -> [f64; 3] {
        if *self == Placement::IDENTITY {
            return p;
        }
        self.0.map(|row| row[0] * p[0] + row[1] * p[1] + row[2] * p[2] + row[3])
    }

    /// Whether it turns things inside out, as a mirror does.
    pub(super) fn mirrors(&self) -> bool {
        let [a, b, c] = self.0;
        let determinant = a[0] * (b[1] * c[2] - b[2] * c[1]) - a[1] * (b[0] * c[2] - b[2] * c[0])
            + a[2] * (b[0] * c[1] - b[1] * c[0]);
        determinant < 0.0
    }
}

/// How often what a file holds may stand in its scene.
const COPIES_MAX: usize = 1000;
/// How many vertices or triangles copies may add to what the file holds.
const COPIED_MAX: usize = 100_000_000;

/// What a scene may grow to, so that a small file that places its meshes again and again does not take all memory.
#[derive(Clone, Copy, Debug)]
pub(super) struct SceneLimit(usize);

impl SceneLimit {
    /// For a file that holds so many vertices and triangles.
    pub(super) fn of(held: usize) -> SceneLimit {
        SceneLimit((COPIES_MAX * held).min(held + COPIED_MAX).min(u32::MAX as usize))
    }
}

impl Polygons {
    /// Adds a mesh at a place, the triangles of a mirrored one turned over; nothing of one without triangles. False if the
    /// scene has no room for it.
    pub(super) fn add_placed(
        &mut self,
        vertices: &[[f64; 3]],
        triangles: impl Iterator<Item = [u32; 3]>,
        at: &Placement,
        room: SceneLimit,
    ) -> bool {
        let mut triangles = triangles.peekable();
        if triangles.peek().is_none() {
            return true;
        }
        let first = self.vertices.len();
        if first + vertices.len() > room.0 {
            return false;
        }
        let first = first as u32;
        self.vertices.extend(vertices.iter().map(|&p| at.place(p)));
        let mirrors = at.mirrors();
        for [a, b, c] in triangles {
            let [a, b, c] = [a, b, c].map(|n| n + first);
            self.triangles.push(if mirrors { [a, c, b] } else { [a, b, c] });
            if self.triangles.len() > room.0 {
                return false;
            }
        }
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn maps_follow_each_other() {
        let quarter = Placement::turn([0.0, 0.0, 0.5f64.sqrt(), 0.5f64.sqrt()]);
        let both = Placement::shift([1.0, 0.0, 0.0]).after(&quarter);
        let near = |a: [f64; 3], b: [f64; 3]| (0..3).all(|n| (a[n] - b[n]).abs() < 1e-12);
        assert!(near(both.place([2.0, 0.0, 5.0]), [1.0, 2.0, 5.0]));
        assert!(near(
            quarter.after(&Placement::shift([1.0, 0.0, 0.0])).place([2.0, 0.0, 5.0]),
            [0.0, 3.0, 5.0]
        ));
        assert!(!both.mirrors() && Placement::scale([1.0, -1.0, 1.0]).after(&both).mirrors());
    }
}
