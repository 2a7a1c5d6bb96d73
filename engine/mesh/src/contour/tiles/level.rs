//! The mesh of a level in memory, and which of its triangles are whose.

use super::super::cut::MeshTriangle;
use super::super::sink::MeshSink;
use super::tile::{TileMesh, tile_bytes};
use super::tileset::TileGrid;
use crate::error::Result;
use crate::lattice::NodeKey;
use crate::store::BrickTree;
use std::collections::HashMap;

/// Cosine of 30 degrees: a vertex's normal that is farther from that of a triangle is not the triangle's.
const SMOOTH: f32 = 0.866_025_4;

/// A triangle: the node that its middle lies in, and its vertices.
type NodeFacet = (u64, [u32; 3]);

/// A mesh with a normal for each vertex.
pub(super) struct LevelMesh<'a> {
    grid: &'a TileGrid,
    level: u8,
    positions: Vec<[f32; 3]>,
    normals: Vec<[f32; 3]>,
    facets: Vec<NodeFacet>,
}

impl LevelMesh<'_> {
    pub fn new(grid: &TileGrid, level: u8) -> LevelMesh<'_> {
        LevelMesh { grid, level, positions: Vec::new(), normals: Vec::new(), facets: Vec::new() }
    }

    /// The nodes of the level that have triangles, in order, with these. What lies in a leaf above the level is in no node.
    pub fn nodes(&self, tree: &dyn BrickTree) -> Vec<(NodeKey, &[NodeFacet])> {
        let groups = self.facets.chunk_by(|a, b| a.0 == b.0);
        let keyed = groups.filter_map(|group| Some((NodeKey::from_code(group[0].0)?, group)));
        keyed.filter(|(key, _)| tree.node(*key).is_some()).collect()
    }

    /// The file of some of its triangles.
    pub fn tile(&self, facets: &[NodeFacet], metres: f64) -> Vec<u8> {
        let mut mesh = TileMesh::default();
        // A vertex at an edge of the part has several normals.
        let mut numbers: HashMap<(u32, [u32; 3]), u32> = HashMap::new();
        for (_, ids) in facets {
            let own = facet_normal(ids.map(|id| self.positions[id as usize]));
            for id in ids {
                let smooth = self.normals[*id as usize];
                let along: f32 = (0..3).map(|a| smooth[a] * own[a]).sum();
                let normal = if along >= SMOOTH { smooth } else { own };
                let next = mesh.positions.len() as u32;
                let number = *numbers.entry((*id, normal.map(f32::to_bits))).or_insert_with(|| {
                    mesh.positions.push(self.positions[*id as usize].map(|c| (f64::from(c) * metres) as f32));
                    mesh.normals.push(normal);
                    next
                });
                mesh.indices.push(number);
            }
        }
        tile_bytes(&mesh)
    }
}

/// The unit normal of a triangle; up if it has no area.
fn facet_normal([a, b, c]: [[f32; 3]; 3]) -> [f32; 3] {
    let [u, v]: [[f64; 3]; 2] =
        [b, c].map(|end| std::array::from_fn(|n| f64::from(end[n]) - f64::from(a[n])));
    let normal = crate::lattice::cross(u, v);
    let length = crate::lattice::dot(normal, normal).sqrt();
    if length > 0.0 { normal.map(|c| (c / length) as f32) } else { [0.0, 0.0, 1.0] }
}

impl MeshSink for LevelMesh<'_> {
    fn wants_normals(&self) -> bool {
        true
    }

    fn vertices_with_normals(&mut self, positions: &[[f32; 3]], normals: &[[f32; 3]]) -> Result<()> {
        self.positions.extend(positions);
        self.normals.extend(normals);
        Ok(())
    }

    fn triangles(&mut self, facets: &[MeshTriangle]) -> Result<()> {
        let code = |facet: &MeshTriangle| self.grid.node_at(self.level, facet.corners).code();
        self.facets.extend(facets.iter().map(|facet| (code(facet), facet.ids)));
        Ok(())
    }

    fn finish(&mut self) -> Result<()> {
        // Those of a node stay in the order in which they came.
        self.facets.sort_by_key(|(code, _)| *code);
        Ok(())
    }
}
