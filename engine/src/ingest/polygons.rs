//! The common form of the indexed formats: shared vertices and triangles that point at them.

/// Vertices and the triangles between them; every index is checked by the reader that fills it.
#[derive(Debug, Default)]
pub(super) struct Polygons {
    /// Positions in the file's unit.
    pub(super) vertices: Vec<[f64; 3]>,
    /// Indices into `vertices`, counter-clockwise seen from outside.
    pub(super) triangles: Vec<[u32; 3]>,
    /// Faces with fewer than three corners, which bound nothing.
    pub(super) skipped: u64,
}

impl Polygons {
    /// Adds a face as the fan from its first corner.
    ///
    /// The fan walks every boundary edge of the polygon once in its direction and every diagonal once each
    /// way, so directed edges stay balanced with the neighbours' and a closed mesh stays closed. The winding
    /// number of a planar face depends on its boundary loop alone, hence also a concave face comes out right
    /// even though some of its fan's triangles lie turned over outside of it. For a face that is not planar
    /// the file does not say which surface is meant; this one is as good as another, and the same every time.
    #[inline]
    pub(super) fn add_face(&mut self, corners: &[u32]) {
        if let [first, rest @ ..] = corners
            && rest.len() >= 2
        {
            self.triangles.extend(rest.windows(2).map(|pair| [*first, pair[0], pair[1]]));
        } else {
            self.skipped += 1;
        }
    }

    /// Gives back the room that growth left over.
    pub(super) fn shrink(&mut self) {
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
    fn fan_keeps_the_boundary() {
        for n in 3..20u32 {
            let mut polygons = Polygons::default();
            polygons.add_face(&(0..n).collect::<Vec<_>>());
            assert_eq!(polygons.triangles.len() as u32, n - 2);
            let mut loop_edges: Vec<_> = (0..n).map(|i| (i, (i + 1) % n)).collect();
            loop_edges.sort();
            assert_eq!(boundary(&polygons.triangles), loop_edges);
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
