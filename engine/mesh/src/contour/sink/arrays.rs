//! A mesh in memory.

use super::ply::vertex_bytes;
use super::{Cuts, MeshChunk, MeshEncoding, MeshSink, TriangleBytes, VertexBytes};
use crate::error::Result;

/// A mesh as arrays, for whoever goes on with it: 12 bytes a vertex and 12 a triangle, all of them in memory.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct MeshArrays {
    /// World positions.
    pub positions: Vec<[f32; 3]>,
    /// Places among `positions` of the corners of each triangle, counter-clockwise seen from outside.
    pub triangles: Vec<[u32; 3]>,
}

/// The vertices of a mesh alone, all of them in memory.
#[derive(Clone, Debug, Default)]
pub struct PositionsSink {
    /// World positions.
    pub positions: Vec<[f32; 3]>,
}

/// Takes a mesh and keeps nothing of it, for what is measured on the way.
pub struct DiscardSink;

/// Numbers of the corners, little-endian.
pub fn write_triangles(triangles: &[[u32; 3]], bytes: &mut Vec<u8>) {
    let end = bytes.len();
    bytes.resize(end + size_of_val(triangles), 0);
    for (record, ids) in bytes[end..].as_chunks_mut::<12>().0.iter_mut().zip(triangles) {
        record.copy_from_slice(ids.map(u32::to_le_bytes).as_flattened());
    }
}

/// What little-endian numbers, three each, say.
pub(in crate::contour) fn triples<T>(
    bytes: &[u8],
    number: impl Fn([u8; 4]) -> T,
) -> impl Iterator<Item = [T; 3]> {
    bytes.as_chunks::<12>().0.iter().map(move |bytes| {
        let [a, b, c, d, e, f, g, h, i, j, k, l] = *bytes;
        [[a, b, c, d], [e, f, g, h], [i, j, k, l]].map(&number)
    })
}

impl MeshSink for MeshArrays {
    fn encoding(&self) -> Option<MeshEncoding> {
        let vertices = vertex_bytes(false);
        Some(MeshEncoding { vertices, triangles: TriangleBytes::Numbered(write_triangles) })
    }

    fn takes_triangles_between(&self) -> bool {
        true
    }

    fn encoded(&mut self, part: MeshChunk<'_>) -> Result<()> {
        match part {
            MeshChunk::Vertices(_, bytes) => self.positions.extend(triples(bytes, f32::from_le_bytes)),
            MeshChunk::Triangles(_, bytes) => self.triangles.extend(triples(bytes, u32::from_le_bytes)),
        }
        Ok(())
    }

    fn finish(&mut self) -> Result<()> {
        Ok(())
    }
}

impl MeshSink for PositionsSink {
    fn vertices_with_normals(&mut self, positions: &[[f32; 3]], _: &[[f32; 3]]) -> Result<()> {
        self.positions.extend_from_slice(positions);
        Ok(())
    }

    fn finish(&mut self) -> Result<()> {
        Ok(())
    }
}

impl MeshSink for DiscardSink {
    fn encoding(&self) -> Option<MeshEncoding> {
        let none = |_: &Cuts, _: &mut Vec<u8>| {};
        Some(MeshEncoding {
            vertices: VertexBytes::Positions(|_, _| {}),
            triangles: TriangleBytes::Lone(none),
        })
    }

    fn finish(&mut self) -> Result<()> {
        Ok(())
    }
}
