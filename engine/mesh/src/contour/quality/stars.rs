//! A triangle mesh with the triangles at each vertex, which changes.

use super::super::adaptive::{TriangleCorners, bounds};
use super::super::frame::united;
use super::super::sink::MeshArrays;
use super::loose_octree::LooseOctree;

/// The place of a triangle that is gone.
const GONE: [u32; 3] = [u32::MAX; 3];

/// A closed manifold mesh of triangles.
pub(super) struct StarMesh {
    pub(super) positions: Vec<[f32; 3]>,
    /// Corners, counter-clockwise seen from outside.
    triangles: Vec<[u32; 3]>,
    /// By vertex, the triangles at it.
    stars: Vec<Vec<u32>>,
    /// By triangle, how far the surface there is from the first mesh at most.
    strayed: Vec<f32>,
    /// Triangles by place.
    pub(super) places: LooseOctree,
}

impl StarMesh {
    pub(super) fn new(mesh: MeshArrays) -> StarMesh {
        let MeshArrays { positions, triangles } = mesh;
        let mut stars = vec![Vec::new(); positions.len()];
        for (n, corners) in (0..).zip(&triangles) {
            corners.iter().for_each(|&corner| stars[corner as usize].push(n));
        }
        let all = positions.iter().map(|p| [*p; 2]).reduce(united).unwrap_or_default();
        let strayed = vec![0.0; triangles.len()];
        let mut made = StarMesh { positions, triangles, stars, strayed, places: LooseOctree::new(&all) };
        for n in 0..made.triangles.len() as u32 {
            made.places.add(n, &bounds(&made.corners(n)));
        }
        made
    }

    /// Numbers of all triangles that were ever there.
    pub(super) fn numbers(&self) -> std::ops::Range<u32> {
        0..self.triangles.len() as u32
    }

    pub(super) fn is_there(&self, triangle: u32) -> bool {
        self.triangles[triangle as usize] != GONE
    }

    pub(super) fn triangle(&self, triangle: u32) -> [u32; 3] {
        self.triangles[triangle as usize]
    }

    pub(super) fn corners(&self, triangle: u32) -> TriangleCorners {
        self.triangle(triangle).map(|corner| self.positions[corner as usize])
    }

    /// The triangles at a vertex.
    pub(super) fn star(&self, vertex: u32) -> &[u32] {
        &self.stars[vertex as usize]
    }

    /// How far the surface is from the first mesh at some triangles, at most.
    pub(super) fn strayed(&self, triangles: &[u32]) -> f64 {
        triangles.iter().map(|n| f64::from(self.strayed[*n as usize])).fold(0.0, f64::max)
    }

    /// The triangle on the other side of the edge from `b` to `c`, and its third corner.
    pub(super) fn across(&self, b: u32, c: u32) -> Option<(u32, u32)> {
        self.star(b).iter().find_map(|&n| {
            let corners = self.triangle(n);
            let at = corners.iter().position(|&corner| corner == c)?;
            (corners[(at + 1) % 3] == b).then(|| (n, corners[(at + 2) % 3]))
        })
    }

    /// The vertices next to one, sorted.
    pub(super) fn around(&self, vertex: u32) -> Vec<u32> {
        let corners = self.star(vertex).iter().flat_map(|&n| self.triangle(n));
        let mut found: Vec<u32> = corners.filter(|&corner| corner != vertex).collect();
        found.sort_unstable();
        found.dedup();
        found
    }

    /// Makes a change. The surface there is farther from the first mesh by `distance` at most.
    pub(super) fn apply(&mut self, change: &LocalChange, distance: f64) {
        let strayed = (self.strayed(&change.old) + distance) as f32;
        for &n in &change.old {
            self.places.remove(n, &bounds(&self.corners(n)));
            for corner in self.triangle(n) {
                self.stars[corner as usize].retain(|&other| other != n);
            }
            self.triangles[n as usize] = GONE;
        }
        if let Some((vertex, position)) = change.moved {
            self.positions[vertex as usize] = position;
        }
        for (&n, corners) in change.old.iter().zip(&change.new) {
            self.triangles[n as usize] = *corners;
            self.strayed[n as usize] = strayed;
            corners.iter().for_each(|&corner| self.stars[corner as usize].push(n));
            self.places.add(n, &bounds(&self.corners(n)));
        }
    }

    /// The mesh, and for each of its vertices the number that it had.
    pub(super) fn into_arrays(self) -> (MeshArrays, Vec<u32>) {
        let StarMesh { positions, triangles, stars, .. } = self;
        let kept: Vec<u32> =
            (0..).zip(&stars).filter(|(_, star)| !star.is_empty()).map(|(vertex, _)| vertex).collect();
        let mut numbers = vec![0; positions.len()];
        (0..).zip(&kept).for_each(|(number, &vertex)| numbers[vertex as usize] = number);
        let positions = kept.iter().map(|&vertex| positions[vertex as usize]).collect();
        let there = triangles.into_iter().filter(|corners| *corners != GONE);
        let triangles = there.map(|corners| corners.map(|corner| numbers[corner as usize])).collect();
        (MeshArrays { positions, triangles }, kept)
    }
}

/// Some triangles in place of others with the same border.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct LocalChange {
    /// Numbers of the triangles that go.
    pub(super) old: Vec<u32>,
    /// Corners of those that come, no more than go.
    pub(super) new: Vec<[u32; 3]>,
    /// A vertex and where it goes.
    pub(super) moved: Option<(u32, [f32; 3])>,
}

impl LocalChange {
    /// Where the corners of a new triangle lie.
    pub(super) fn corners(&self, mesh: &StarMesh, triangle: [u32; 3]) -> TriangleCorners {
        triangle.map(|corner| match self.moved {
            Some((vertex, position)) if vertex == corner => position,
            _ => mesh.positions[corner as usize],
        })
    }
}
