//! Triangles with the lattice edges that their polygons are around: a mesh that is measured, not kept.
//!
//! A polygon separates the two samples at the ends of its edge, so whoever has labels of samples knows which region each
//! triangle bounds, even where two of them touch.

use super::buffer_pool::BufferPool;
use super::cut::{Cuts, FacetBytes};
use super::leaves::ContourLeaf;
use super::options::{ContourOptions, level, require_resolution};
use super::polygons::{self, FacetOptions};
use super::solve::OnSurface;
use super::stages;
use crate::error::Result;
use crate::lattice::{Axis, NodeKey};
use crate::progress::Progress;
use crate::store::BrickTree;

/// A triangle, counter-clockwise seen from outside.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EdgeFacet {
    /// Axis of the edge that its polygon is around.
    pub axis: Axis,
    /// Lower sample of the edge in the leaf, each index 0..=32.
    pub low: [usize; 3],
    /// Whether that sample is inside; the upper one is not then.
    pub low_is_inside: bool,
    /// Where the surface crosses the edge, as a fraction from its lower sample.
    pub fraction: f64,
    /// World positions of the corners.
    pub corners: [[f32; 3]; 3],
}

impl EdgeFacet {
    /// The sample of its edge that is not inside.
    pub fn outer(&self) -> [usize; 3] {
        let mut outer = self.low;
        outer[self.axis.index()] += usize::from(self.low_is_inside);
        outer
    }
}

/// Bytes of a facet as [`append`] writes it.
const FACET_BYTES: usize = 44;

fn append(cuts: &Cuts, bytes: &mut Vec<u8>) {
    cuts.for_each_tagged(|tag, corners| {
        bytes.extend(tag.to_le_bytes());
        corners.as_flattened().iter().for_each(|c| bytes.extend(c.to_le_bytes()));
    });
}

/// The facets of a leaf's bytes.
fn facets(bytes: &[u8]) -> Vec<EdgeFacet> {
    let facet = |bytes: &[u8; FACET_BYTES]| {
        let word = |n: usize| std::array::from_fn(|b| bytes[4 * n + b]);
        let tag = u32::from_le_bytes(word(0)) as usize;
        let corner = |n: usize| [0, 1, 2].map(|a| f32::from_le_bytes(word(2 + 3 * n + a)));
        EdgeFacet {
            axis: Axis::ALL[(tag >> 24 & 3).min(2)],
            low: [tag & 0xff, tag >> 8 & 0xff, tag >> 16 & 0xff],
            low_is_inside: tag >> 26 & 1 == 1,
            fraction: f64::from(u32::from_le_bytes(word(1))) / 65536.0,
            corners: [0, 1, 2].map(corner),
        }
    };
    bytes.as_chunks::<FACET_BYTES>().0.iter().map(facet).collect()
}

/// How much a surface may bend within a cell and still be taken for a smooth one.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Bend {
    /// By up to 30°.
    Slight,
    /// By up to 60°, unless its planes meet as those of a crease do.
    Strong,
}

/// Contours the boundary w = 0.5 in the leaves that `is_wanted` picks, of those with a sign change. Calls `make` with
/// the facets that each of them owns, on any thread, and `take` with what it gives, in Morton order of the leaves.
///
/// Vertices are those of the mesh with followed creases, but where the surface is smooth they stand on it, so that
/// area and volume have errors of fourth order.
///
/// # Errors
/// As [`super::contour`].
pub fn edge_facets<T: Send>(
    tree: &dyn BrickTree,
    cache_bytes: usize,
    (bend, is_wanted): (Bend, impl Fn(NodeKey) -> bool + Sync),
    progress: &dyn Progress,
    make: impl Fn(NodeKey, &[EdgeFacet]) -> Result<T> + Sync,
    mut take: impl FnMut(T) -> Result<()> + Send,
) -> Result<()> {
    let options =
        ContourOptions { cache_bytes, follow_creases: bend == Bend::Slight, ..ContourOptions::default() };
    require_resolution(tree, None)?;
    let mut field = stages::field(tree, level(options.iso)?, &options)?;
    field.on_surface = match bend {
        Bend::Slight => OnSurface::Smooth,
        Bend::Strong => OnSurface::Bent,
    };
    progress.phase("measuring surfaces", Some(field.leaves.len() as u64), "bricks");
    let making = FacetOptions {
        wanted: FacetBytes { append, normals: false },
        spare: BufferPool::default(),
        normals: false,
    };
    let of_leaf = |leaf: u32| {
        let ContourLeaf { key, changes, .. } = *field.leaves.get(leaf);
        if !changes || !is_wanted(key) {
            field.release(leaf);
            return Ok(None);
        }
        let vertices = field.vertices(leaf)?;
        let made = polygons::leaf_facets(&field, leaf, &vertices, &making)?;
        let result = make(key, &facets(&made.bytes))?;
        making.spare.keep(made.bytes);
        Ok(Some(result))
    };
    field.in_order(progress, of_leaf, |made: Option<T>| made.map_or(Ok(()), &mut take))
}
