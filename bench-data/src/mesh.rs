//! The indexed mesh that the generators make.

use crate::trig::sin_cos;
use crate::vector::{add, cross, dot, norm, scale, sub, unit};
use crate::{Facet64, LatticeFacet, StlFacet};

/// Indexed triangles. Pieces made by this crate are closed, oriented outward, without unused vertices.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Mesh {
    /// Positions, in whatever length unit the generator was given.
    pub vertices: Vec<[f64; 3]>,
    /// Vertex indices, counter-clockwise seen from outside.
    pub triangles: Vec<[u32; 3]>,
}

impl Mesh {
    /// All pieces one after the other, as a soup reads them; nothing is welded.
    pub fn merged(pieces: &[Mesh]) -> Mesh {
        let mut all = Mesh::default();
        for piece in pieces {
            all.append(piece);
        }
        all
    }

    /// Adds another mesh's triangles behind the own ones, sharing no vertex with them.
    pub fn append(&mut self, other: &Mesh) {
        let first = self.vertices.len() as u32;
        self.vertices.extend_from_slice(&other.vertices);
        self.triangles.extend(other.triangles.iter().map(|t| t.map(|v| v + first)));
    }

    /// Every vertex moved by `map`, which must keep orientation.
    pub fn mapped(mut self, map: impl Fn([f64; 3]) -> [f64; 3]) -> Mesh {
        for v in &mut self.vertices {
            *v = map(*v);
        }
        self
    }

    /// Moved by `offset`.
    pub fn translated(self, offset: [f64; 3]) -> Mesh {
        self.mapped(|v| add(v, offset))
    }

    /// Scaled about the origin, per axis. A mirroring scale also reverses the triangles, so that outside
    /// stays outside.
    pub fn scaled(self, factor: [f64; 3]) -> Mesh {
        let mirrors = factor[0] * factor[1] * factor[2] < 0.0;
        let mesh = self.mapped(|v| [v[0] * factor[0], v[1] * factor[1], v[2] * factor[2]]);
        if mirrors { mesh.flipped() } else { mesh }
    }

    /// Turned about the origin by a unit quaternion (w, x, y, z).
    pub fn rotated_by(self, [w, x, y, z]: [f64; 4]) -> Mesh {
        let q = [x, y, z];
        self.mapped(|v| {
            let t = scale(cross(q, v), 2.0);
            add(add(v, scale(t, w)), cross(q, t))
        })
    }

    /// Turned about `axis` (any length but 0) through the origin by `angle` radians, right-handed.
    pub fn rotated(self, axis: [f64; 3], angle: f64) -> Mesh {
        let (s, c) = sin_cos(angle * 0.5);
        let [x, y, z] = scale(unit(axis), s);
        self.rotated_by([c, x, y, z])
    }

    /// Inside out: every triangle reversed.
    pub fn flipped(mut self) -> Mesh {
        for t in &mut self.triangles {
            t.swap(1, 2);
        }
        self
    }

    /// Corners of triangle `index`.
    pub fn corners(&self, index: usize) -> Facet64 {
        self.triangles[index].map(|v| self.vertices[v as usize])
    }

    /// The triangles as separate facets in double precision.
    pub fn facets(&self) -> impl ExactSizeIterator<Item = Facet64> + '_ {
        self.triangles.iter().map(|t| t.map(|v| self.vertices[v as usize]))
    }

    /// The triangles as separate facets, rounded as an STL file stores them. Equal vertices round equally,
    /// so what is closed stays closed.
    pub fn soup(&self) -> Vec<StlFacet> {
        self.facets().map(|f| f.map(|v| v.map(|c| c as f32))).collect()
    }

    /// The triangles on the integer lattice.
    ///
    /// # Panics
    /// If a coordinate is not an `i32`: rounding here would hide a generator that left the lattice.
    pub fn lattice(&self) -> Vec<LatticeFacet> {
        let exact = |c: f64| {
            assert!(f64::from(c as i32) == c, "{c} is not on the lattice");
            c as i32
        };
        self.facets().map(|f| f.map(|v| v.map(exact))).collect()
    }

    /// Enclosed volume, negative if inside out (divergence theorem).
    pub fn signed_volume(&self) -> f64 {
        let Some(&o) = self.vertices.first() else { return 0.0 };
        // Relative to a vertex, or a small piece far from the origin drowns in rounding.
        let six: f64 = self.facets().map(|f| f.map(|v| sub(v, o))).map(|[a, b, c]| dot(a, cross(b, c))).sum();
        six / 6.0
    }

    /// Total area of the triangles.
    pub fn area(&self) -> f64 {
        self.facets().map(|[a, b, c]| 0.5 * norm(cross(sub(b, a), sub(c, a)))).sum()
    }

    /// Lower and upper corner of the bounding box; infinite and inverted if there are no vertices.
    pub fn bounds(&self) -> ([f64; 3], [f64; 3]) {
        let mut bounds = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
        for v in &self.vertices {
            for (a, &c) in v.iter().enumerate() {
                bounds.0[a] = bounds.0[a].min(c);
                bounds.1[a] = bounds.1[a].max(c);
            }
        }
        bounds
    }
}
