//! A sink that improves the mesh before it hands it on.

use super::super::cut::MeshTriangle;
use super::super::shells::{KeptCounts, volume};
use super::super::sink::{MeshArrays, MeshSink};
use super::{IMPROVED_BYTES_A_TRIANGLE, improve};
use crate::error::{Error, Result};
use crate::progress::Progress;
use std::path::Path;

/// Vertices and triangles that are handed on at a time.
const CHUNK: usize = 1 << 16;

/// Keeps a mesh, takes its slivers away and hands it on, all of it in memory: [`IMPROVED_BYTES_A_TRIANGLE`].
pub struct ImprovedSink<'a> {
    inner: &'a mut dyn MeshSink,
    /// How far the surface may go.
    most: f64,
    memory: u64,
    progress: &'a dyn Progress,
    mesh: MeshArrays,
    /// By vertex, if they are wanted.
    normals: Vec<[f32; 3]>,
    counted: KeptCounts,
    volume: f64,
}

impl<'a> ImprovedSink<'a> {
    /// One for a mesh whose surface may go as far as `most`, in no more than so many bytes.
    pub fn new(
        inner: &'a mut dyn MeshSink,
        most: f64,
        memory: u64,
        progress: &'a dyn Progress,
    ) -> ImprovedSink<'a> {
        let (mesh, normals, counted) = Default::default();
        ImprovedSink { inner, most, memory, progress, mesh, normals, counted, volume: 0.0 }
    }

    /// What the mesh is now; before it is finished, nothing.
    pub fn counted(&self) -> KeptCounts {
        self.counted
    }

    /// What it encloses now, in the cube of its unit.
    pub fn volume(&self) -> f64 {
        self.volume
    }
}

impl MeshSink for ImprovedSink<'_> {
    fn shares_vertices(&self) -> bool {
        true
    }

    fn wants_normals(&self) -> bool {
        self.inner.wants_normals()
    }

    fn takes_triangles_between(&self) -> bool {
        true
    }

    fn folder(&self) -> Option<&Path> {
        self.inner.folder()
    }

    fn vertices_with_normals(&mut self, positions: &[[f32; 3]], normals: &[[f32; 3]]) -> Result<()> {
        self.mesh.positions.extend_from_slice(positions);
        self.normals.extend_from_slice(normals);
        Ok(())
    }

    fn triangles(&mut self, facets: &[MeshTriangle]) -> Result<()> {
        self.mesh.triangles.extend(facets.iter().map(|facet| facet.ids));
        let bytes = self.mesh.triangles.len() as u64 * IMPROVED_BYTES_A_TRIANGLE;
        if bytes > self.memory {
            let what = format!("better angles need {bytes} bytes and more for this mesh");
            return Err(Error::setting(what, "allow more `memory`, or choose a larger `detail`"));
        }
        Ok(())
    }

    fn finish(&mut self) -> Result<()> {
        let (mesh, numbers) = improve(std::mem::take(&mut self.mesh), self.most, self.progress)?;
        let normals: Vec<[f32; 3]> = match self.normals.is_empty() {
            true => Vec::new(),
            false => numbers.iter().map(|&vertex| self.normals[vertex as usize]).collect(),
        };
        mesh.positions.iter().for_each(|position| self.counted.add_vertex(position));
        if self.inner.shares_vertices() {
            for (n, positions) in mesh.positions.chunks(CHUNK).enumerate() {
                let normals = normals.get(n * CHUNK..n * CHUNK + positions.len()).unwrap_or_default();
                self.inner.vertices_with_normals(positions, normals)?;
            }
        }
        for ids in mesh.triangles.chunks(CHUNK) {
            let facets: Vec<MeshTriangle> = ids.iter().map(|ids| facet(&mesh, ids)).collect();
            self.counted.add(&facets);
            self.volume += facets.iter().map(|facet| volume(&facet.corners, mesh.positions[0])).sum::<f64>();
            self.inner.triangles(&facets)?;
        }
        self.inner.finish()
    }
}

fn facet(mesh: &MeshArrays, ids: &[u32; 3]) -> MeshTriangle {
    MeshTriangle { ids: *ids, corners: ids.map(|id| mesh.positions[id as usize]) }
}
