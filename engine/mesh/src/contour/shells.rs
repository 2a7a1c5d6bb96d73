//! The shells of a mesh, its connected surfaces: their volumes, which lie in which, and a mesh of some of them.

use super::cut::MeshTriangle;
use super::sink::MeshSink;
use crate::error::{Error, Result};
use crate::lattice::{cross, dot, minus};
use crate::sets::DisjointSets;
use std::collections::BTreeSet;
use std::path::Path;

/// Bytes for each vertex while shells are told apart.
pub const SHELL_BYTES_A_VERTEX: u64 = 28;

/// One connected surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Shell {
    /// What it encloses, in the cube of the mesh's unit: below 0 if it faces inward, as the boundary of a void does.
    pub volume: f64,
    /// Its triangles.
    pub triangles: u64,
    /// Least and greatest coordinates.
    pub bounds: [[f32; 3]; 2],
    /// A point on it.
    pub point: [f64; 3],
}

/// Takes a mesh and tells its shells; 28 bytes a vertex.
#[derive(Default)]
pub struct ShellSink {
    positions: Vec<[f32; 3]>,
    /// Vertices that hang together, by the first of them.
    sets: DisjointSets,
    /// By vertex, the volumes of triangles that begin at it, and their number.
    volumes: Vec<f64>,
    counts: Vec<u32>,
    /// By vertex, the number of its shell.
    of: Vec<u32>,
    shells: Vec<Shell>,
    /// The most bytes that may be held.
    memory: u64,
}

impl ShellSink {
    /// One that holds at most so many bytes.
    pub fn new(memory: u64) -> ShellSink {
        ShellSink { memory, ..ShellSink::default() }
    }

    /// All shells by their first vertices, and for each vertex the number of its own.
    pub fn into_shells(self) -> (Vec<Shell>, Vec<u32>) {
        (self.shells, self.of)
    }
}

impl MeshSink for ShellSink {
    fn takes_triangles_between(&self) -> bool {
        true
    }

    fn vertices_with_normals(&mut self, positions: &[[f32; 3]], _: &[[f32; 3]]) -> Result<()> {
        self.positions.extend_from_slice(positions);
        self.sets.extend(positions.len());
        self.volumes.resize(self.positions.len(), 0.0);
        self.counts.resize(self.positions.len(), 0);
        if self.positions.len() as u64 * SHELL_BYTES_A_VERTEX > self.memory {
            return Err(Error::setting(
                "the shells of so many triangles do not fit the memory allowed",
                "allow more `memory`, or choose a larger `detail`",
            ));
        }
        Ok(())
    }

    fn triangles(&mut self, facets: &[MeshTriangle]) -> Result<()> {
        let Some(&origin) = self.positions.first() else { return Ok(()) };
        for MeshTriangle { ids: [a, b, c], corners } in facets {
            self.sets.unite(*a, *b);
            self.sets.unite(*a, *c);
            self.volumes[*a as usize] += volume(corners, origin);
            self.counts[*a as usize] += 1;
        }
        Ok(())
    }

    fn finish(&mut self) -> Result<()> {
        self.of = Vec::with_capacity(self.positions.len());
        for vertex in 0..self.positions.len() as u32 {
            let position = self.positions[vertex as usize];
            let first = self.sets.find(vertex);
            let shell = if first == vertex {
                let point = position.map(f64::from);
                self.shells.push(Shell { volume: 0.0, triangles: 0, bounds: [position; 2], point });
                self.shells.len() as u32 - 1
            } else {
                self.of[first as usize]
            };
            self.of.push(shell);
            let shell = &mut self.shells[shell as usize];
            shell.volume += self.volumes[vertex as usize];
            shell.triangles += u64::from(self.counts[vertex as usize]);
            shell.bounds = super::frame::united(shell.bounds, [position; 2]);
        }
        Ok(())
    }
}

/// The volume of the tetrahedron of a triangle and a point.
pub(super) fn volume(corners: &[[f32; 3]; 3], origin: [f32; 3]) -> f64 {
    let [a, b, c] = corners.map(|p| minus(p.map(f64::from), origin.map(f64::from)));
    dot(a, cross(b, c)) / 6.0
}

/// The area of a triangle.
fn area(corners: &[[f32; 3]; 3]) -> f64 {
    let [a, b, c] = corners.map(|p| p.map(f64::from));
    let normal = cross(minus(b, a), minus(c, a));
    0.5 * dot(normal, normal).sqrt()
}

/// Takes a mesh and tells which of its shells lie within which that face outward: a ray along +x from a point on the first
/// meets the second an odd number of times.
pub struct NestingSink<'a> {
    of: &'a [u32],
    shells: &'a [Shell],
    /// Shells that may lie within others, by the z of their points.
    asked: Vec<u32>,
    /// By asked shell, those that it is met within so far.
    within: Vec<BTreeSet<u32>>,
}

impl<'a> NestingSink<'a> {
    /// For the shells of a mesh that [`ShellSink`] has told apart.
    pub fn new(shells: &'a [Shell], of: &'a [u32]) -> NestingSink<'a> {
        let is_in = |inner: &Shell, outer: &Shell| {
            (0..3).all(|a| outer.bounds[0][a] < inner.bounds[0][a] && inner.bounds[1][a] < outer.bounds[1][a])
        };
        let outward: Vec<&Shell> = shells.iter().filter(|shell| shell.volume > 0.0).collect();
        let is_asked = |n: &u32| outward.iter().any(|outer| is_in(&shells[*n as usize], outer));
        let mut asked: Vec<u32> = (0..shells.len() as u32).filter(is_asked).collect();
        let z = |n: u32| shells[n as usize].point[2];
        asked.sort_by(|&a, &b| z(a).total_cmp(&z(b)));
        let within = vec![BTreeSet::new(); asked.len()];
        NestingSink { of, shells, asked, within }
    }

    /// Whether no shell can lie within another, so that the mesh need not be made for it.
    pub fn is_idle(&self) -> bool {
        self.asked.is_empty()
    }

    /// By shell, those around it that face outward.
    pub fn within(&self) -> Vec<Vec<u32>> {
        let mut all = vec![Vec::new(); self.shells.len()];
        for (shell, within) in self.asked.iter().zip(&self.within) {
            all[*shell as usize] = within.iter().copied().collect();
        }
        all
    }
}

impl MeshSink for NestingSink<'_> {
    fn takes_triangles_between(&self) -> bool {
        true
    }

    fn vertices_with_normals(&mut self, _: &[[f32; 3]], _: &[[f32; 3]]) -> Result<()> {
        Ok(())
    }

    fn triangles(&mut self, facets: &[MeshTriangle]) -> Result<()> {
        for MeshTriangle { ids, corners } in facets {
            let shell = self.of[ids[0] as usize];
            if self.shells[shell as usize].volume <= 0.0 {
                continue;
            }
            let [low, high] = [f32::min, f32::max]
                .map(|f| f64::from(corners.map(|c| c[2]).into_iter().reduce(f).unwrap_or(0.0)));
            let first = self.asked.partition_point(|&n| self.shells[n as usize].point[2] < low);
            for place in first..self.asked.len() {
                let asked = self.asked[place];
                let point = self.shells[asked as usize].point;
                if point[2] > high {
                    break;
                }
                if asked != shell && is_met(corners, point) && !self.within[place].remove(&shell) {
                    self.within[place].insert(shell);
                }
            }
        }
        Ok(())
    }

    fn finish(&mut self) -> Result<()> {
        Ok(())
    }
}

/// Whether a ray along +x from a point meets a triangle. Points on an edge of the shadow belong to one of its triangles: each
/// edge is asked from its lower end, which counts where its upper one does not.
fn is_met(corners: &[[f32; 3]; 3], point: [f64; 3]) -> bool {
    let at = corners.map(|c| c.map(f64::from));
    let mut is_in = false;
    for n in 0..3 {
        let (mut p, mut q) = (at[n], at[(n + 1) % 3]);
        if p[2] > q[2] {
            (p, q) = (q, p);
        }
        if p[2] <= point[2] && point[2] < q[2] {
            let along = (point[2] - p[2]) * (q[1] - p[1]) - (point[1] - p[1]) * (q[2] - p[2]);
            is_in ^= along > 0.0;
        }
    }
    if !is_in {
        return false;
    }
    // On which side of the plane the point lies, the plane facing +x.
    let normal = cross(minus(at[1], at[0]), minus(at[2], at[0]));
    dot(normal, minus(point, at[0])) * normal[0].signum() < 0.0
}

/// Hands the shells that are kept to another sink, with vertices numbered anew.
pub struct ShellFilter<'a> {
    inner: &'a mut dyn MeshSink,
    /// By shell, whether it is kept.
    kept: &'a [bool],
    /// By vertex, its shell.
    of: &'a [u32],
    /// By vertex so far, its new number.
    numbers: Vec<u32>,
    counted: KeptCounts,
}

/// What of a mesh was kept.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct KeptCounts {
    /// Vertices of the shells that are kept.
    pub vertices: u64,
    /// Their triangles.
    pub triangles: u64,
    /// Their area in the square of the mesh's unit.
    pub area: f64,
    /// Least and greatest coordinates; `None` if nothing is kept.
    pub bounds: Option<[[f32; 3]; 2]>,
    /// The angles of triangles.
    pub angles: Angles,
}

impl KeptCounts {
    /// Counts a vertex.
    pub(super) fn add_vertex(&mut self, position: &[f32; 3]) {
        self.vertices += 1;
        let before = self.bounds.unwrap_or([*position; 2]);
        self.bounds = Some(super::frame::united(before, [*position; 2]));
    }

    /// Counts triangles.
    pub(super) fn add(&mut self, facets: &[MeshTriangle]) {
        self.triangles += facets.len() as u64;
        facets.iter().for_each(|facet| self.angles.add(&facet.corners));
        self.area += facets.iter().map(|facet| area(&facet.corners)).sum::<f64>();
    }
}

/// Angles of the triangles of a mesh.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Angles {
    /// The smallest, in degrees; 180 of no triangles.
    pub smallest: f64,
    /// Triangles with an angle below 5°.
    pub below_5: u64,
}

impl Default for Angles {
    fn default() -> Angles {
        Angles { smallest: 180.0, below_5: 0 }
    }
}

impl Angles {
    fn add(&mut self, corners: &[[f32; 3]; 3]) {
        let smallest = smallest_angle(corners);
        self.smallest = self.smallest.min(smallest);
        self.below_5 += u64::from(smallest < 5.0);
    }
}

/// The smallest angle of a triangle in degrees.
pub(super) fn smallest_angle(corners: &[[f32; 3]; 3]) -> f64 {
    let at = corners.map(|p| p.map(f64::from));
    let angle = |n: usize| {
        let (u, v) = (minus(at[(n + 1) % 3], at[n]), minus(at[(n + 2) % 3], at[n]));
        let normal = cross(u, v);
        dot(normal, normal).sqrt().atan2(dot(u, v)).to_degrees()
    };
    (0..3).map(angle).fold(180.0, f64::min)
}

impl<'a> ShellFilter<'a> {
    /// What was kept so far.
    pub fn counted(&self) -> KeptCounts {
        self.counted
    }

    /// Keeps the shells `kept` of those that [`ShellSink`] has told apart of the same mesh.
    pub fn new(inner: &'a mut dyn MeshSink, kept: &'a [bool], of: &'a [u32]) -> ShellFilter<'a> {
        ShellFilter { inner, kept, of, numbers: Vec::new(), counted: KeptCounts::default() }
    }

    fn is_kept(&self, vertex: usize) -> bool {
        self.kept[self.of[vertex] as usize]
    }
}

impl MeshSink for ShellFilter<'_> {
    fn wants_normals(&self) -> bool {
        self.inner.wants_normals()
    }

    fn takes_triangles_between(&self) -> bool {
        self.inner.takes_triangles_between()
    }

    fn folder(&self) -> Option<&Path> {
        self.inner.folder()
    }

    fn vertices_with_normals(&mut self, positions: &[[f32; 3]], normals: &[[f32; 3]]) -> Result<()> {
        let (mut kept, mut their) = (Vec::new(), Vec::new());
        for (n, position) in positions.iter().enumerate() {
            let is_kept = self.is_kept(self.numbers.len());
            self.numbers.push(self.counted.vertices as u32);
            if is_kept {
                self.counted.add_vertex(position);
                kept.push(*position);
                their.extend(normals.get(n));
            }
        }
        if !self.inner.shares_vertices() {
            return Ok(());
        }
        self.inner.vertices_with_normals(&kept, &their)
    }

    fn triangles(&mut self, facets: &[MeshTriangle]) -> Result<()> {
        let kept = facets.iter().filter(|facet| self.is_kept(facet.ids[0] as usize));
        let facets: Vec<MeshTriangle> = kept
            .map(|facet| MeshTriangle { ids: facet.ids.map(|id| self.numbers[id as usize]), ..*facet })
            .collect();
        self.counted.add(&facets);
        self.inner.triangles(&facets)
    }

    fn finish(&mut self) -> Result<()> {
        self.inner.finish()
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::fields::{ImplicitField, tree};
    use super::*;
    use crate::contour::{ContourOptions, MeshArrays, contour};
    use crate::progress::Silent;

    /// A ball with a void in which a smaller ball floats, and a ball beside it.
    fn field(p: [f64; 3]) -> f64 {
        let length = |c: [f64; 3]| c.iter().map(|c| c * c).sum::<f64>().sqrt();
        let [x, y, z] = p;
        let hollow = (length([x + 2.0, y, z]) - 4.0).max(2.5 - length([x + 2.0, y, z]));
        let floating = length([x + 2.0, y, z]) - 1.2;
        let beside = length([x - 4.5, y - 3.0, z]) - 1.5;
        hollow.min(floating).min(beside)
    }

    #[test]
    fn angles_are_those_of_known_triangles() {
        let mut angles = Angles::default();
        angles.add(&[[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]);
        assert!((angles.smallest - 45.0).abs() < 1e-9 && angles.below_5 == 0);
        angles.add(&[[0.0; 3], [1.0, 0.0, 0.0], [1.0, 0.01, 0.0]]);
        assert!((angles.smallest - 0.01f64.atan().to_degrees()).abs() < 1e-5 && angles.below_5 == 1);
    }

    #[test]
    fn shells_are_told_apart_measured_and_dropped() {
        let tree = tree(&ImplicitField(field), &|key| key.level() < 2);
        let options = ContourOptions::default();
        let mut sink = ShellSink::new(u64::MAX);
        contour(&tree, &options, &mut sink, &Silent).unwrap();
        let (shells, of) = sink.into_shells();
        let mut volumes: Vec<f64> = shells.iter().map(|shell| shell.volume).collect();
        volumes.sort_by(f64::total_cmp);
        let ball = |r: f64| 4.0 / 3.0 * std::f64::consts::PI * r.powi(3);
        for (volume, expected) in volumes.iter().zip([-ball(2.5), ball(1.2), ball(1.5), ball(4.0)]) {
            assert!((volume / expected - 1.0).abs() < 0.01, "{volumes:?}");
        }
        assert_eq!(volumes.len(), 4);
        let mut nesting = NestingSink::new(&shells, &of);
        assert!(!nesting.is_idle());
        contour(&tree, &options, &mut nesting, &Silent).unwrap();
        let within = nesting.within();
        let radius = |n: usize| (shells[n].volume.abs() * 0.75 / std::f64::consts::PI).cbrt();
        for (n, within) in within.iter().enumerate() {
            let is_inner = [1.2, 2.5].iter().any(|r| (radius(n) - r).abs() < 0.02);
            assert_eq!(within.len(), usize::from(is_inner), "{within:?}");
            assert!(within.iter().all(|&outer| (radius(outer as usize) - 4.0).abs() < 0.02));
        }
        // What is left of it without the void and what floats in it.
        let kept: Vec<bool> = (0..shells.len()).map(|n| within[n].is_empty()).collect();
        let mut all = MeshArrays::default();
        contour(&tree, &options, &mut all, &Silent).unwrap();
        let mut some = MeshArrays::default();
        contour(&tree, &options, &mut ShellFilter::new(&mut some, &kept, &of), &Silent).unwrap();
        let expected: u64 =
            shells.iter().zip(&kept).filter(|(_, kept)| **kept).map(|(shell, _)| shell.triangles).sum();
        assert_eq!(some.triangles.len() as u64, expected);
        assert!(some.triangles.as_flattened().iter().all(|&id| (id as usize) < some.positions.len()));
        assert!(some.positions.len() < all.positions.len());
        // Every corner stands where it stood.
        let corners = |mesh: &MeshArrays, n: usize| mesh.triangles[n].map(|id| mesh.positions[id as usize]);
        let there: std::collections::HashSet<_> =
            (0..all.triangles.len()).map(|n| corners(&all, n).map(|c| c.map(f32::to_bits))).collect();
        assert!(
            (0..some.triangles.len())
                .all(|n| there.contains(&corners(&some, n).map(|c| c.map(f32::to_bits))))
        );
    }
}
