//! The patches of one leaf, with boxes around them.

use super::answers::Place;
use super::box_bytes::number;
use super::boxes::{Block, Boxes, block_of};
use super::patch::{Patch, Shape};
use super::polygons::LeafPolygons;
use super::spilled::Spill;
use crate::brick::{Brick, SignChanges};
use crate::contour::EdgeFacet;
use crate::lattice::{Axis, NodeKey, RootCube, morton};

/// Patches in a box.
const RUN: usize = 1;
/// Bytes of a patch, of a corner, and of the base in a file.
const PATCH_BYTES: usize = 47;
const CORNER_BYTES: usize = 12;
const BASE_BYTES: usize = 24;

/// All patches whose lattice edges a leaf owns. Places are in cells of the deepest level, counted from `base`.
pub(super) struct Piece {
    /// The leaf's first sample, in cells from the root's.
    pub base: [f64; 3],
    pub patches: Vec<Patch>,
    pub rings: Vec<[f32; 3]>,
    pub boxes: Boxes,
}

impl Piece {
    /// Of the facets of a leaf; `None` if it has none.
    pub fn new(
        root: RootCube,
        deepest: u8,
        key: NodeKey,
        brick: &Brick,
        facets: &[EdgeFacet],
    ) -> Option<Piece> {
        let Brick::Counts { samples, hermite } = brick else { return None };
        let signs = SignChanges::of(samples);
        let ranks = Axis::ALL.map(|axis| signs.ranks(axis));
        let bits = crate::lattice::spacing_bits(deepest);
        let cell = f64::from(1u32 << bits);
        let base = key.base().map(|c| f64::from(c) / cell);
        let own = f64::from(1u32 << (key.spacing_bits() - bits));
        let place = |facet: &EdgeFacet| (morton(facet.low.map(|c| c as u32)), facet.axis.index());
        let mut ordered: Vec<&EdgeFacet> = facets.iter().collect();
        ordered.sort_by_cached_key(|facet| place(facet));
        let local = |corner: [f32; 3]| -> [f64; 3] {
            let units = root.to_units(corner.map(f64::from));
            std::array::from_fn(|a| (units[a] - 1.0) / cell - base[a])
        };
        let mut piece = Piece {
            base,
            patches: Vec::new(),
            rings: Vec::new(),
            boxes: Boxes::new(std::iter::empty(), RUN),
        };
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
            piece.patches.push(Patch::new(*crossing, &corners, &crossings, &mut piece.rings));
        }
        piece.patches.shrink_to_fit();
        piece.rings.shrink_to_fit();
        (!piece.patches.is_empty()).then(|| piece.boxed())
    }

    fn boxed(mut self) -> Piece {
        let block = |patch: &Patch| patch.block(&self.rings);
        let normals = self.patches.iter().map(normals);
        let boxes = Boxes::new(self.patches.iter().map(block), RUN).with_normals(normals);
        let (mut points, mut ends) = (Vec::with_capacity(self.rings.len() + self.patches.len()), Vec::new());
        for patch in &self.patches {
            let (corners, margin) = patch.slab(&self.rings);
            points.extend(corners.map(|c| c.map(|c| c as f32)));
            points.push(patch.at);
            ends.push((points.len(), margin as f32));
        }
        self.boxes = boxes.with_slabs(|n| {
            let first = if n > 0 { ends[n - 1].0 } else { 0 };
            (points[first..ends[n].0].iter().copied(), ends[n].1)
        });
        self
    }

    /// A patch of this piece.
    pub fn patch(&self, place: Place) -> &Patch {
        &self.patches[place.patch as usize]
    }

    /// Least and greatest components of all normals.
    pub fn normals(&self) -> Block {
        let ends = self.patches.iter().flat_map(normals);
        block_of(ends.map(|end| end.map(f64::from)), 0.0)
    }

    /// The box of all, in cells from the root's first sample.
    pub fn block(&self) -> Block {
        let ends = self.boxes.whole();
        block_of(ends.iter().map(|c| [0, 1, 2].map(|a| f64::from(c[a]) + self.base[a])), 0.0)
    }
}

impl Spill for Piece {
    fn heap_bytes(&self) -> usize {
        self.patches.capacity() * size_of::<Patch>()
            + self.rings.capacity() * CORNER_BYTES
            + self.boxes.heap_bytes()
    }

    fn bytes(&self) -> Vec<u8> {
        let mut bytes = Vec::with_capacity(
            BASE_BYTES
                + 8
                + self.patches.len() * PATCH_BYTES
                + self.rings.len() * CORNER_BYTES
                + self.boxes.heap_bytes(),
        );
        self.base.iter().for_each(|c| bytes.extend(c.to_le_bytes()));
        bytes.extend((self.patches.len() as u32).to_le_bytes());
        for patch in &self.patches {
            let Patch { at, normal, bend, radius, first, count, shape } = patch;
            for number in at.iter().chain(normal).chain(bend).chain([radius]) {
                bytes.extend(number.to_le_bytes());
            }
            bytes.extend(first.to_le_bytes());
            bytes.extend(count.to_le_bytes());
            bytes.push(*shape as u8);
        }
        bytes.extend((self.rings.len() as u32).to_le_bytes());
        self.rings.iter().flatten().for_each(|number| bytes.extend(number.to_le_bytes()));
        self.boxes.append_to(&mut bytes);
        bytes
    }

    fn of_bytes(bytes: &[u8]) -> Option<Piece> {
        let (base, rest) = bytes.split_first_chunk::<BASE_BYTES>()?;
        let base = std::array::from_fn(|a| f64::from_le_bytes(std::array::from_fn(|b| base[8 * a + b])));
        let (count, rest) = rest.split_first_chunk::<4>()?;
        let count = u32::from_le_bytes(*count) as usize;
        let (stored, rest) = rest.split_at_checked(count.checked_mul(PATCH_BYTES)?)?;
        let (corners, rest) = rest.split_first_chunk::<4>()?;
        let corners = u32::from_le_bytes(*corners) as usize;
        let (rings, boxes) = rest.split_at_checked(corners.checked_mul(CORNER_BYTES)?)?;
        let three = |bytes: &[u8], n: usize| [0, 1, 2].map(|a| number(bytes, 3 * n + a));
        let patch = |bytes: &[u8]| {
            Some(Patch {
                at: three(bytes, 0),
                normal: three(bytes, 1),
                bend: three(bytes, 2),
                radius: number(bytes, 9),
                first: u32::from_le_bytes(bytes[40..44].try_into().ok()?),
                count: u16::from_le_bytes([bytes[44], bytes[45]]),
                shape: match bytes[46] {
                    0 => Shape::Plane,
                    1 => Shape::Bent,
                    2 => Shape::Rough,
                    _ => return None,
                },
            })
        };
        let mut patches = Vec::with_capacity(count);
        for bytes in stored.chunks_exact(PATCH_BYTES) {
            patches.push(patch(bytes)?);
        }
        let rings: Vec<[f32; 3]> = rings.chunks_exact(CORNER_BYTES).map(|bytes| three(bytes, 0)).collect();
        let end = rings.len();
        let is_within = |p: &Patch| p.first as usize + usize::from(p.count) <= end;
        if !patches.iter().all(is_within) {
            return None;
        }
        Some(Piece { base, patches, rings, boxes: Boxes::of_bytes(count, RUN, boxes)? })
    }
}

/// Least and greatest components of the normals within a patch.
fn normals(patch: &Patch) -> Block {
    [-1.0, 1.0].map(|sign| patch.normal.map(|c| (c + sign * patch.turn()).clamp(-1.0, 1.0)))
}
