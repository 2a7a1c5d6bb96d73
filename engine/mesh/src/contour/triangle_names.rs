//! How the triangles of a leaf name vertices before these are numbered, and triangles as bytes that wait.

use super::cut::{Cuts, FacetBytes, MeshTriangle};
use super::sink::{MeshEncoding, TriangleBytes};
use crate::error::{Error, Result};

/// Bits of a name that count from a place; those above say from which.
pub(super) const WITHIN_BITS: u32 = 16;
/// Bytes of the names of a triangle's corners.
pub(super) const TRIPLE_BYTES: usize = 12;
/// Those, and the positions of the corners.
pub(super) const WHOLE_BYTES: usize = 48;
/// How the triangles of one leaf name vertices, its own and other leaves'.
#[derive(Default)]
pub(super) struct TriangleNames {
    /// A leaf, and the number there of the vertex that a place begins with. That is a multiple of 2^16 but for vertices
    /// on edges.
    places: Vec<(u32, u32)>,
    /// There would be more places than bits.
    is_full: bool,
}

impl TriangleNames {
    /// The name of the first vertex on an edge of the leaf itself. Those that follow count on: a leaf has fewer edges than
    /// two places hold.
    pub(super) const ON_EDGES: u32 = 1 << WITHIN_BITS;

    /// For the triangles of a leaf with so many vertices beside those on its edges.
    pub(super) fn new(leaf: u32, others: usize) -> TriangleNames {
        let others = others as u32;
        let places = vec![(leaf, 0), (leaf, others), (leaf, others + (1 << WITHIN_BITS))];
        TriangleNames { places, is_full: false }
    }

    /// The name of the vertex with a number in a leaf.
    #[inline]
    pub(super) fn of(&mut self, leaf: u32, number: u32) -> u32 {
        let within = number & ((1 << WITHIN_BITS) - 1);
        let place = (leaf, number - within);
        let known = self.places.iter().position(|known| *known == place);
        let at = known.unwrap_or_else(|| {
            self.is_full |= self.places.len() >> WITHIN_BITS != 0;
            self.places.push(place);
            self.places.len() - 1
        });
        (at as u32) << WITHIN_BITS | within
    }

    /// The place of a name, and what it counts from there.
    pub(super) fn split(name: u32) -> [usize; 2] {
        [name >> WITHIN_BITS, name & ((1 << WITHIN_BITS) - 1)].map(|n| n as usize)
    }

    /// The leaf of each place, and the number there of the vertex that it begins with.
    ///
    /// # Errors
    /// If there are more than `most`, or than names tell apart.
    pub(super) fn places(&self, most: usize) -> Result<&[(u32, u32)]> {
        if self.is_full || self.places.len() > most {
            return Err(Error::setting(
                format!("the triangles of one brick have vertices in more than {most} others"),
                "choose a smaller `tolerance`",
            ));
        }
        Ok(&self.places)
    }
}

/// Appends the names of the corners of triangles.
fn write_triples(cuts: &Cuts, bytes: &mut Vec<u8>) {
    bytes.reserve(Cuts::MOST_FACETS * TRIPLE_BYTES);
    cuts.for_each(|ids, _, _| bytes.extend_from_slice(ids.map(u32::to_le_bytes).as_flattened()));
}

/// Appends these and the corners' positions.
fn write_whole(cuts: &Cuts, bytes: &mut Vec<u8>) {
    cuts.for_each(|ids, corners, _| {
        bytes.extend_from_slice(ids.map(u32::to_le_bytes).as_flattened());
        let corners = corners.map(|[x, y, z, _]| [x, y, z].map(|c| c.to_le_bytes()));
        bytes.extend_from_slice(corners.as_flattened().as_flattened());
    });
}

/// What is made of the triangles of a leaf for a sink with this encoding.
pub(super) fn first_bytes(encoding: Option<MeshEncoding>) -> FacetBytes {
    match encoding {
        Some(MeshEncoding { triangles: TriangleBytes::Lone(append), .. }) => {
            FacetBytes { append, normals: true }
        }
        Some(MeshEncoding { triangles: TriangleBytes::Numbered(_), .. }) => {
            FacetBytes { append: write_triples, normals: false }
        }
        None => FacetBytes { append: write_whole, normals: false },
    }
}

/// Triangles as [`write_whole`] makes them.
pub(super) fn whole(bytes: &[u8]) -> Vec<MeshTriangle> {
    each_whole(bytes).collect()
}

/// The same, one after the other.
pub(super) fn each_whole(bytes: &[u8]) -> impl ExactSizeIterator<Item = MeshTriangle> {
    bytes.as_chunks::<WHOLE_BYTES>().0.iter().map(|bytes| {
        let (words, _) = bytes.as_chunks::<4>();
        let triple = |n: usize| [words[n], words[n + 1], words[n + 2]];
        let corner = |n: usize| triple(3 * n).map(f32::from_le_bytes);
        MeshTriangle { ids: triple(0).map(u32::from_le_bytes), corners: [corner(1), corner(2), corner(3)] }
    })
}
