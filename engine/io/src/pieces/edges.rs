//! The edges of a mesh with the facets at each, vertex by vertex, on all threads and in a fixed order.

use crate::check::{CornerTable, IndexedMesh};
use crate::error::Result;
use crate::lattice::Units;
use crate::progress::Progress;
use rayon::prelude::*;

/// Vertices looked at by one task.
const CHUNK: usize = 1 << 13;
/// Tasks whose edges are kept until they are handed on.
const TASKS_AT_ONCE: usize = 32;

/// One facet at an edge: its number, and whether it runs along the edge from the vertex with the lower number.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct FacetSide(u32);

impl FacetSide {
    fn new(facet: u32, upward: bool) -> FacetSide {
        FacetSide(facet << 1 | u32::from(upward))
    }

    pub fn facet(self) -> u32 {
        self.0 >> 1
    }

    pub fn upward(self) -> bool {
        self.0 & 1 == 1
    }
}

/// Edges of some vertices.
#[derive(Default)]
pub(super) struct Edges {
    /// Facets at edges of one facet.
    pub lone: Vec<FacetSide>,
    /// Those at edges of two.
    pub pairs: Vec<[FacetSide; 2]>,
    /// Those at edges of more, edge by edge, in the order of their numbers.
    pub crowded: Vec<FacetSide>,
    /// How many of `crowded` there are up to the end of each edge.
    pub ends: Vec<u32>,
}

impl Edges {
    /// Those from `vertex` to vertices with higher numbers. `spokes` is room to work in.
    fn add(
        &mut self,
        triangles: &[[u32; 3]],
        corners: &[u32],
        vertex: u32,
        spokes: &mut Vec<(u32, FacetSide)>,
    ) {
        spokes.clear();
        for &corner in corners {
            let (facet, i) = (corner / 3, corner as usize % 3);
            let triangle = &triangles[facet as usize];
            let (next, last) = (triangle[(i + 1) % 3], triangle[(i + 2) % 3]);
            if next > vertex {
                spokes.push((next, FacetSide::new(facet, true)));
            }
            if last > vertex {
                spokes.push((last, FacetSide::new(facet, false)));
            }
        }
        spokes.sort_unstable();
        for edge in spokes.chunk_by(|a, b| a.0 == b.0) {
            match *edge {
                [(_, side)] => self.lone.push(side),
                [(_, a), (_, b)] => self.pairs.push([a, b]),
                _ => {
                    self.crowded.extend(edge.iter().map(|(_, side)| side));
                    self.ends.push(self.crowded.len() as u32);
                }
            }
        }
    }
}

/// Hands all edges to `take`, those of some vertices at a time. What it is given does not depend on the number of
/// threads.
///
/// # Errors
/// If the user interrupts.
pub(super) fn for_edges(
    mesh: &IndexedMesh<Units>,
    progress: &dyn Progress,
    mut take: impl FnMut(Edges),
) -> Result<()> {
    let vertices = mesh.positions.len();
    progress.phase("edges", Some(vertices as u64), "vertices");
    let corners = CornerTable::of(vertices, &mesh.triangles);
    let of_chunk = |chunk: usize| {
        let (mut edges, mut spokes) = (Edges::default(), Vec::new());
        for vertex in chunk * CHUNK..vertices.min((chunk + 1) * CHUNK) {
            edges.add(&mesh.triangles, corners.at(vertex), vertex as u32, &mut spokes);
        }
        edges
    };
    let chunks: Vec<usize> = (0..vertices.div_ceil(CHUNK)).collect();
    for wave in chunks.chunks(TASKS_AT_ONCE) {
        progress.check()?;
        let found: Vec<Edges> = wave.par_iter().map(|&chunk| of_chunk(chunk)).collect();
        found.into_iter().for_each(&mut take);
        progress.advance((wave.len() * CHUNK) as u64);
    }
    Ok(())
}
