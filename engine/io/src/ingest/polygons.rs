//! The common form of the indexed formats: shared vertices and triangles that point at them.

use super::triangulate::Triangulator;

/// Vertices and the triangles between them; every index is checked by the reader that fills it.
#[derive(Debug, Default)]
pub(super) struct Polygons {
    /// Positions in the file's unit.
    pub(super) vertices: Vec<[f64; 3]>,
    /// Indices into `vertices`, counter-clockwise seen from outside.
    pub(super) triangles: Vec<[u32; 3]>,
    /// Faces with fewer than three corners, which bound nothing.
    pub(super) skipped: u64,
    /// What the user should know: one line each.
    pub(super) warnings: Vec<String>,
    /// Fans of faces whose corners were not all read yet: number of the first triangle, and how many.
    later: Vec<(usize, usize)>,
    triangulator: Triangulator,
}

impl Polygons {
    /// Adds a face: as the fan from its first corner where that covers it, as every convex face, and otherwise by
    /// cutting off ears (see [`Triangulator`]).
    ///
    /// All ways to divide a face walk every boundary edge of it once in its direction and every diagonal once each way,
    /// so directed edges stay balanced with the neighbours' and a closed mesh stays closed. For a face that is not
    /// planar the file does not say which surface is meant; this one is as good as another, and the same every time.
    #[inline]
    pub(super) fn add_face(&mut self, corners: &[u32]) {
        let [first, rest @ ..] = corners else {
            self.skipped += 1;
            return;
        };
        if rest.len() < 2 {
            self.skipped += 1;
            return;
        }
        let start = self.triangles.len();
        self.triangles.extend(rest.windows(2).map(|pair| [*first, pair[0], pair[1]]));
        if rest.len() > 2 {
            self.divide(start, rest.len() - 1, corners);
        }
    }

    /// Divides the face whose fan begins at triangle `start`, or notes it down for later.
    fn divide(&mut self, start: usize, count: usize, corners: &[u32]) {
        let present = self.vertices.len();
        if corners.iter().all(|&corner| (corner as usize) < present) {
            let fan = &mut self.triangles[start..start + count];
            self.triangulator.mend(&self.vertices, corners, fan);
        } else {
            self.later.push((start, count));
        }
    }

    /// Divides the faces that came before their vertices, and gives back the room that growth left over.
    pub(super) fn finish(&mut self) {
        let mut corners = Vec::new();
        for (start, count) in std::mem::take(&mut self.later) {
            let fan = &mut self.triangles[start..start + count];
            corners.clear();
            corners.extend([fan[0][0], fan[0][1]]);
            corners.extend(fan.iter().map(|triangle| triangle[2]));
            self.triangulator.mend(&self.vertices, &corners, fan);
        }
        self.triangulator = Triangulator::default();
        self.vertices.shrink_to_fit();
        self.triangles.shrink_to_fit();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeMap;

    /// Directed edges minus reversed ones: what is left is the boundary.
    fn boundary(triangles: &[[u32; 3]]) -> Vec<(u32, u32)> {
        let mut count = BTreeMap::<(u32, u32), i32>::new();
        for t in triangles {
            for i in 0..3 {
                let (a, b) = (t[i], t[(i + 1) % 3]);
                *count.entry((a, b)).or_default() += 1;
                *count.entry((b, a)).or_default() -= 1;
            }
        }
        count.into_iter().filter(|(_, n)| *n > 0).map(|(edge, _)| edge).collect()
    }

    #[test]
    fn every_division_keeps_the_boundary() {
        for n in 3..20u32 {
            let mut before = Polygons::default();
            // A star, with every second corner near its middle; vertices come before the face, and after it.
            let corner = |i: u32| {
                let (turn, far) =
                    (f64::from(i) / f64::from(n) * std::f64::consts::TAU, [3.0, 0.4][i as usize % 2]);
                [1.0, far * turn.cos(), far * turn.sin()]
            };
            let corners: Vec<u32> = (0..n).collect();
            before.vertices.extend(corners.iter().map(|&i| corner(i)));
            before.add_face(&corners);
            before.finish();
            let mut after = Polygons::default();
            after.add_face(&corners);
            after.vertices.extend(corners.iter().map(|&i| corner(i)));
            after.finish();
            assert_eq!(before.triangles, after.triangles);
            assert_eq!(before.triangles.len() as u32, n - 2);
            let mut loop_edges: Vec<_> = (0..n).map(|i| (i, (i + 1) % n)).collect();
            loop_edges.sort();
            assert_eq!(boundary(&before.triangles), loop_edges);
        }
    }

    #[test]
    fn counts_faces_that_bound_nothing() {
        let mut polygons = Polygons::default();
        for corners in [&[][..], &[0], &[0, 1]] {
            polygons.add_face(corners);
        }
        assert_eq!((polygons.triangles.len(), polygons.skipped), (0, 3));
    }
}
