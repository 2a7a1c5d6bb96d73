//! The patches of one leaf, with boxes around them.

use super::answers::Place;
use super::boxes::{Block, BoxNodes, Boxes, block_of};
use super::patch::Patch;
use super::polygons::LeafPolygons;
use crate::brick::{Brick, SignChanges};
use crate::contour::EdgeFacet;
use crate::lattice::{Axis, NodeKey, RootCube, morton, spacing_bits};

/// Patches in a box.
pub(super) const RUN: usize = 1;

/// All patches whose lattice edges a leaf owns. Places are in cells of the deepest level, counted from `base`.
#[derive(Clone, Copy)]
pub(super) struct Piece<'a> {
    /// See [`base_of`].
    pub base: [f64; 3],
    pub patches: &'a [Patch],
    /// Corners of the patches' polygons.
    pub rings: &'a [[f32; 3]],
    pub boxes: BoxNodes<'a>,
}

/// What a [`Piece`] is made of.
pub(super) struct NewPiece {
    pub patches: Vec<Patch>,
    pub rings: Vec<[f32; 3]>,
    pub boxes: Boxes,
}

/// A leaf's first sample, in cells of the deepest level from the root's.
pub(super) fn base_of(key: NodeKey, deepest: u8) -> [f64; 3] {
    let cell = f64::from(1u32 << spacing_bits(deepest));
    key.base().map(|c| f64::from(c) / cell)
}

impl Piece<'_> {
    /// A patch of this piece.
    pub fn patch(&self, place: Place) -> &Patch {
        &self.patches[place.patch as usize]
    }
}

impl NewPiece {
    /// Of the facets of a leaf; `None` if it has none.
    pub fn new(
        root: RootCube,
        deepest: u8,
        key: NodeKey,
        brick: &Brick,
        facets: &[EdgeFacet],
    ) -> Option<NewPiece> {
        let Brick::Counts { samples, hermite } = brick else { return None };
        let signs = SignChanges::of(samples);
        let ranks = Axis::ALL.map(|axis| signs.ranks(axis));
        let bits = spacing_bits(deepest);
        let cell = f64::from(1u32 << bits);
        let base = base_of(key, deepest);
        let own = f64::from(1u32 << (key.spacing_bits() - bits));
        let place = |facet: &EdgeFacet| (morton(facet.low.map(|c| c as u32)), facet.axis.index());
        let mut ordered: Vec<&EdgeFacet> = facets.iter().collect();
        ordered.sort_by_cached_key(|facet| place(facet));
        let local = |corner: [f32; 3]| -> [f64; 3] {
            let units = root.to_units(corner.map(f64::from));
            std::array::from_fn(|a| (units[a] - 1.0) / cell - base[a])
        };
        let (mut patches, mut rings) = (Vec::new(), Vec::new());
        let mut polygons = LeafPolygons::default();
        for of_edge in ordered.chunk_by(|a, b| a.low == b.low && a.axis == b.axis) {
            let EdgeFacet { axis, low, fraction, .. } = *of_edge[0];
            let rank = signs.rank(axis, low, &ranks[axis.index()]);
            let Some(edge) = hermite.edges[axis.index()].get(rank) else { continue };
            let mut at = low.map(|c| c as f64 * own);
            at[axis.index()] += fraction * own;
            polygons.add((at, edge.normal.to_vector()), of_edge);
        }
        let shared = polygons.shared();
        let (mut beside, mut crossings, mut corners) = (Vec::new(), Vec::new(), Vec::new());
        for (n, crossing) in polygons.crossings.iter().enumerate() {
            polygons.beside(n, &shared, &mut beside);
            crossings.clear();
            crossings.extend(beside.iter().map(|&m| polygons.crossings[m as usize]));
            corners.clear();
            corners.extend(polygons.corners(n).iter().map(|c| local(*c)));
            patches.push(Patch::new(*crossing, &corners, &crossings, &mut rings));
        }
        (!patches.is_empty()).then(|| NewPiece::of(patches, rings))
    }

    /// Of patches, of which neighbours should be near, with boxes around them.
    fn of(patches: Vec<Patch>, rings: Vec<[f32; 3]>) -> NewPiece {
        let block = |patch: &Patch| patch.block(&rings);
        let boxes = Boxes::new(patches.iter().map(block), RUN).with_normals(patches.iter().map(normals));
        let (mut points, mut ends) = (Vec::with_capacity(rings.len() + patches.len()), Vec::new());
        for patch in &patches {
            let (corners, margin) = patch.slab(&rings);
            points.extend(corners.map(|c| c.map(|c| c as f32)));
            points.push(patch.at);
            ends.push((points.len(), margin as f32));
        }
        let boxes = boxes.with_slabs(|n| {
            let first = if n > 0 { ends[n - 1].0 } else { 0 };
            (points[first..ends[n].0].iter().copied(), ends[n].1)
        });
        NewPiece { patches, rings, boxes }
    }

    /// Least and greatest components of all normals.
    pub fn normals(&self) -> Block {
        let ends = self.patches.iter().flat_map(normals);
        block_of(ends.map(|end| end.map(f64::from)), 0.0)
    }

    /// The box of all, which count from `base`.
    pub fn block(&self, base: [f64; 3]) -> Block {
        let ends = self.boxes.whole();
        block_of(ends.iter().map(|c| [0, 1, 2].map(|a| f64::from(c[a]) + base[a])), 0.0)
    }
}

/// Least and greatest components of the normals within a patch.
fn normals(patch: &Patch) -> Block {
    [-1.0, 1.0].map(|sign| patch.normal.map(|c| (c + sign * patch.turn()).clamp(-1.0, 1.0)))
}
