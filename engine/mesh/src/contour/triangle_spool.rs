//! Triangles that wait until all vertices are numbered.
//!
//! A file with numbered vertices holds all of them before its first triangle, and the number of a leaf's first vertex
//! is known when those of all leaves before it are counted.
//!
//! So a leaf's triangles name their corners by leaf at first, wait in a file without a name, 12 bytes each, and are
//! numbered as they are read back.
//!
//! Contouring every leaf a second time instead, as before, took 1.3 times the processor's time while all cells fitted
//! in memory (47 million triangles) and 2.8 times where they did not (210 million). A sink that takes triangles
//! between vertices gets those of a leaf as soon as it has all that they name.

use super::cut::MeshTriangle;
use super::polygons::LeafFacets;
use super::sink::{MeshEncoding, TriangleBytes, triples};
use super::triangle_names::{TRIPLE_BYTES, WHOLE_BYTES, WITHIN_BITS, whole};
use crate::error::{Error, Result};
use crate::part::temporary::TempFile;
use std::path::Path;

/// Bytes of a place: a leaf, and the number of one of its vertices.
const PLACE_BYTES: usize = 8;
/// Triangles that are numbered before they become bytes, which the processor's nearest cache still holds.
const AT_ONCE: usize = 256;

/// Where the triangles of all leaves wait.
pub(super) struct TriangleSpool {
    /// `None` if they wait in memory.
    file: Option<TempFile>,
    encoding: Option<MeshEncoding>,
}

/// The triangles of a leaf.
pub(super) struct SpooledTriangles {
    /// The places of their names.
    places: u32,
    /// How many there are.
    pub count: u32,
    /// Of how many leaves, the first ones, the vertices must have come.
    leaves: u32,
    kept: SpoolPlace,
}

/// Triangles, then places.
enum SpoolPlace {
    At(u64),
    Bytes(Vec<u8>),
}

impl SpooledTriangles {
    /// They take no more room than they need.
    pub(super) fn shrink(&mut self) {
        if let SpoolPlace::Bytes(bytes) = &mut self.kept {
            bytes.shrink_to_fit();
        }
    }

    /// The room that they took, when they are of no use any more.
    pub(super) fn room(&mut self) -> Vec<u8> {
        match &mut self.kept {
            SpoolPlace::Bytes(bytes) => std::mem::take(bytes),
            SpoolPlace::At(_) => Vec::new(),
        }
    }
}

/// Which vertices have come, and which triangles wait for others.
pub(super) struct Numbering {
    /// Of each leaf's first vertex, as far as it is known, the next leaf's included.
    pub first_vertex: Vec<u32>,
    pub waiting: Vec<SpooledTriangles>,
    /// How many leaves' triangles do not wait any more.
    pub given: usize,
}

impl Numbering {
    /// Of so many leaves.
    pub(super) fn new(leaves: usize) -> Numbering {
        let mut first_vertex = Vec::with_capacity(leaves + 1);
        first_vertex.push(0);
        Numbering { first_vertex, waiting: Vec::with_capacity(leaves), given: 0 }
    }

    /// The next leaf's triangles, if all vertices that they name have come.
    pub(super) fn next(&self) -> Option<&SpooledTriangles> {
        let next = self.waiting.get(self.given)?;
        ((next.leaves as usize) < self.first_vertex.len()).then_some(next)
    }
}

/// The triangles of a leaf with the numbers of their vertices.
pub(super) enum NumberedTriangles {
    /// As the sink's encoding makes them.
    Bytes(Vec<u8>),
    Facets(Vec<MeshTriangle>),
}

impl TriangleSpool {
    /// For a sink with this encoding, and a folder for files if there is one.
    pub(super) fn new(folder: Option<&Path>, encoding: Option<MeshEncoding>) -> TriangleSpool {
        TriangleSpool { file: folder.map(TempFile::new), encoding }
    }

    /// Puts the triangles of a leaf away, in a file or in the room that they have.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub(super) fn keep(&self, leaf: &mut LeafFacets) -> Result<SpooledTriangles> {
        let places = leaf.names.places(1 << WITHIN_BITS)?;
        if u32::try_from(leaf.count).is_err() {
            return Err(Error::setting(
                "the triangles of one brick are more than 2^32 - 1",
                "choose a coarser level with `level`",
            ));
        }
        let (places, count) = (if leaf.count > 0 { places } else { &[] }, leaf.count as u32);
        let leaves = places.iter().map(|(leaf, _)| leaf + 1).max().unwrap_or(0);
        let numbers = places.iter().flat_map(|(leaf, number)| [leaf, number]);
        leaf.bytes.extend(numbers.flat_map(|number| number.to_le_bytes()));
        let kept = match &self.file {
            Some(file) if count > 0 => SpoolPlace::At(file.append(&leaf.bytes)?),
            _ => SpoolPlace::Bytes(std::mem::take(&mut leaf.bytes)),
        };
        Ok(SpooledTriangles { places: places.len() as u32, count, leaves, kept })
    }

    /// Gives them their numbers; `first_vertex` has that of each leaf's first vertex. Bytes go into `room`, which is empty.
    ///
    /// # Errors
    /// If the file cannot be read, or holds what was not written.
    pub(super) fn numbered(
        &self,
        waiting: &SpooledTriangles,
        first_vertex: &[u32],
        room: Vec<u8>,
    ) -> Result<NumberedTriangles> {
        let each = if self.encoding.is_some() { TRIPLE_BYTES } else { WHOLE_BYTES };
        let triangles = waiting.count as usize * each;
        let mut read = Vec::new();
        let bytes = match &waiting.kept {
            SpoolPlace::Bytes(bytes) => &bytes[..],
            SpoolPlace::At(offset) => {
                read.resize(triangles + waiting.places as usize * PLACE_BYTES, 0);
                self.file.as_ref().map_or(Ok(()), |file| file.read(*offset, &mut read))?;
                &read
            }
        };
        let (triangles, places) = bytes.split_at(triangles);
        let places = places.as_chunks::<4>().0.as_chunks::<2>().0.iter();
        let first = |[leaf, number]: [u32; 2]| Some(first_vertex.get(leaf as usize)? + number);
        let firsts: Option<Vec<u32>> = places.map(|place| first(place.map(u32::from_le_bytes))).collect();
        let numbered = firsts.and_then(|firsts| self.with_numbers(triangles, &firsts, room));
        numbered.ok_or_else(|| self.file.as_ref().map_or_else(damaged, TempFile::damaged))
    }

    /// `None` if a name has no place.
    fn with_numbers(&self, triangles: &[u8], firsts: &[u32], mut room: Vec<u8>) -> Option<NumberedTriangles> {
        let number = |name: u32| Some(firsts.get((name >> WITHIN_BITS) as usize)? + (name & 0xFFFF));
        let numbers = |[a, b, c]: [u32; 3]| Some([number(a)?, number(b)?, number(c)?]);
        let Some(MeshEncoding { triangles: TriangleBytes::Numbered(encode), .. }) = self.encoding else {
            let facets = whole(triangles).into_iter();
            let facet = |facet: MeshTriangle| Some(MeshTriangle { ids: numbers(facet.ids)?, ..facet });
            return Some(NumberedTriangles::Facets(facets.map(facet).collect::<Option<_>>()?));
        };
        let mut ids = [[0; 3]; AT_ONCE];
        for some in triangles.chunks(AT_ONCE * TRIPLE_BYTES) {
            let mut count = 0;
            for (ids, names) in ids.iter_mut().zip(triples(some, u32::from_le_bytes)) {
                *ids = numbers(names)?;
                count += 1;
            }
            encode(&ids[..count], &mut room);
        }
        Some(NumberedTriangles::Bytes(room))
    }
}

/// The error of names without a place that never left memory.
fn damaged() -> Error {
    Error::setting("the mesh contradicts itself", "write it again; if that does not help, report this")
}

#[cfg(test)]
mod tests {
    use super::super::sink::{MeshArrays, MeshSink};
    use super::super::triangle_names::TriangleNames;
    use super::*;
    use proptest::prelude::*;

    /// Vertices of each leaf, more than a place holds, and how many of them are on edges.
    const VERTICES: u32 = 300_000;
    const ON_EDGES: u32 = 104_544;

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(64))]
        #[test]
        fn names_become_numbers(
            own in 0u32..9,
            corners in prop::collection::vec((any::<bool>(), 0u32..9, 0..VERTICES), 3..90),
            in_file in any::<bool>(),
        ) {
            let folder = tempfile::tempdir().unwrap();
            let sink = MeshArrays::default();
            let first: Vec<u32> = (0..10).map(|leaf| 7 + leaf * VERTICES).collect();
            let others = VERTICES - ON_EDGES;
            let mut names = TriangleNames::new(own, others as usize);
            let mut bytes = Vec::new();
            let mut expected = Vec::new();
            let whole = corners.len() / 3 * 3;
            for &(on_edge, leaf, number) in &corners[..whole] {
                let (name, number) = if on_edge {
                    (TriangleNames::ON_EDGES + number % ON_EDGES, first[own as usize] + others + number % ON_EDGES)
                } else {
                    (names.of(leaf, number), first[leaf as usize] + number)
                };
                bytes.extend(name.to_le_bytes());
                expected.push(number);
            }
            let later = TriangleSpool::new(in_file.then(|| folder.path()), sink.encoding());
            let mut leaf = LeafFacets { count: whole / 3, bytes, names, ..LeafFacets::default() };
            let waiting = later.keep(&mut leaf).unwrap();
            let NumberedTriangles::Bytes(bytes) = later.numbered(&waiting, &first, Vec::new()).unwrap() else { unreachable!() };
            prop_assert_eq!(triples(&bytes, u32::from_le_bytes).flatten().collect::<Vec<_>>(), expected);
            // A leaf that is not there.
            prop_assert!(later.numbered(&waiting, &first[..0], Vec::new()).is_err());
        }
    }
}
