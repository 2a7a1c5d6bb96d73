//! An independent judge of meshes: closed, oriented, edge- and vertex-manifold.

use crate::contour::{MeshSink, MeshTriangle};
use crate::error::Result;
use std::collections::HashMap;

/// A mesh kept in memory.
#[derive(Default, PartialEq, Debug)]
pub struct TestMesh {
    pub positions: Vec<[f32; 3]>,
    pub facets: Vec<MeshTriangle>,
    pub is_finished: bool,
}

impl MeshSink for TestMesh {
    fn vertices_with_normals(&mut self, positions: &[[f32; 3]], _: &[[f32; 3]]) -> Result<()> {
        assert!(self.facets.is_empty() && !self.is_finished);
        self.positions.extend_from_slice(positions);
        Ok(())
    }

    fn triangles(&mut self, facets: &[MeshTriangle]) -> Result<()> {
        self.facets.extend_from_slice(facets);
        Ok(())
    }

    fn finish(&mut self) -> Result<()> {
        self.is_finished = true;
        Ok(())
    }
}

impl TestMesh {
    pub fn triangles(&self) -> Vec<[u32; 3]> {
        self.facets.iter().map(|f| f.ids).collect()
    }

    /// Corners identified by position, as a reader of STL does.
    pub fn welded(&self) -> Vec<[u32; 3]> {
        let mut ids = HashMap::new();
        let mut id = |p: [f32; 3]| {
            let next = ids.len() as u32;
            *ids.entry(p.map(|c| (c + 0.0).to_bits())).or_insert(next)
        };
        self.facets.iter().map(|f| f.corners.map(&mut id)).collect()
    }

    /// Checks the mesh by index, and that every vertex is used and every corner is its vertex.
    pub fn check(&self) {
        assert!(self.is_finished);
        for f in &self.facets {
            for (id, corner) in f.ids.iter().zip(f.corners) {
                assert_eq!(self.positions[*id as usize], corner);
            }
        }
        let used = check(&self.triangles()).unwrap();
        assert_eq!(used, self.positions.len(), "vertices without triangles");
    }
}

/// Half-edges (from, to, third corner) in order, and where those of each vertex begin.
struct HalfEdges {
    all: Vec<[u32; 3]>,
    begins: Vec<usize>,
}

impl HalfEdges {
    fn of(triangles: &[[u32; 3]]) -> HalfEdges {
        let mut all: Vec<[u32; 3]> =
            triangles.iter().flat_map(|&[a, b, c]| [[a, b, c], [b, c, a], [c, a, b]]).collect();
        all.sort_unstable();
        let vertices = all.last().map_or(0, |half| half[0] + 1);
        let begins = (0..=vertices).map(|vertex| all.partition_point(|half| half[0] < vertex)).collect();
        HalfEdges { all, begins }
    }

    /// Those from a vertex, by where they lead.
    fn from(&self, vertex: u32) -> &[[u32; 3]] {
        let vertex = vertex as usize;
        if vertex + 1 < self.begins.len() {
            &self.all[self.begins[vertex]..self.begins[vertex + 1]]
        } else {
            &[]
        }
    }

    /// The third corner of the triangle at a half-edge.
    fn third(&self, from: u32, to: u32) -> Option<u32> {
        self.from(from).iter().find(|half| half[1] == to).map(|half| half[2])
    }
}

/// Checks half-edges and vertex fans; returns the number of vertices used.
pub fn check(triangles: &[[u32; 3]]) -> std::result::Result<usize, String> {
    if let Some(flat) = triangles.iter().find(|[a, b, c]| a == b || b == c || c == a) {
        return Err(format!("degenerate triangle {flat:?}"));
    }
    let halves = HalfEdges::of(triangles);
    if let Some(pair) = halves.all.windows(2).find(|pair| pair[0][..2] == pair[1][..2]) {
        let [from, to, _] = pair[0];
        return Err(format!("half-edge {from} -> {to} twice"));
    }
    if let Some([from, to, _]) = halves.all.iter().find(|half| halves.third(half[1], half[0]).is_none()) {
        return Err(format!("half-edge {from} -> {to} has no partner"));
    }
    let fans = halves.all.chunk_by(|p, q| p[0] == q[0]);
    for fan in fans.clone() {
        let [centre, start, _] = fan[0];
        let (mut at, mut steps) = (start, 0);
        loop {
            // The triangle centre → at → third is followed by the one that holds centre → third.
            at = halves.third(centre, at).expect("it has a partner");
            steps += 1;
            if at == start || steps > fan.len() {
                break;
            }
        }
        if steps != fan.len() {
            return Err(format!("vertex {centre} has more than one fan"));
        }
    }
    Ok(fans.count())
}

#[test]
fn the_judge_can_say_no() {
    let tetrahedron = [[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]];
    assert_eq!(check(&tetrahedron), Ok(4));
    assert!(check(&tetrahedron[..3]).is_err());
    assert!(check(&[[0, 1, 1]]).is_err());
    let mut flipped = tetrahedron;
    flipped[0] = [0, 1, 2];
    assert!(check(&flipped).is_err());
    // Two tetrahedra that share vertex 3.
    let pinched: Vec<_> = tetrahedron
        .into_iter()
        .chain(tetrahedron.map(|t| t.map(|v| if v == 3 { 3 } else { v + 10 })))
        .collect();
    assert!(check(&pinched).unwrap_err().contains("fan"));
}
