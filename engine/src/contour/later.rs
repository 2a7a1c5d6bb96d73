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

use super::cut::{Cuts, FacetBytes};
use super::polygons::{Facet, LeafFacets};
use super::sink::{Encoding, Triangles, triples};
use crate::error::{Error, Result};
use crate::part::temporary::TempFile;
use std::path::Path;

/// Bits of a name that count from a place; those above say from which.
const WITHIN_BITS: u32 = 16;
/// Bytes of a place: a leaf, and the number of one of its vertices.
const PLACE_BYTES: usize = 8;
/// Bytes of the names of a triangle's corners.
const TRIPLE_BYTES: usize = 12;
/// Those, and the positions of the corners.
const WHOLE_BYTES: usize = 48;
/// Triangles that are numbered before they become bytes, which the processor's nearest cache still holds.
const AT_ONCE: usize = 256;

/// How the triangles of one leaf name vertices, its own and other leaves'.
#[derive(Default)]
pub(super) struct Names {
    /// A leaf, and the number there of the vertex that a place begins with. That is a multiple of 2^16 but for vertices
    /// on edges.
    places: Vec<(u32, u32)>,
    /// There would be more places than bits.
    is_full: bool,
}

impl Names {
    /// The name of the first vertex on an edge of the leaf itself. Those that follow count on: a leaf has fewer edges than
    /// two places hold.
    pub(super) const ON_EDGES: u32 = 1 << WITHIN_BITS;

    /// For the triangles of a leaf with so many vertices beside those on its edges.
    pub(super) fn new(leaf: u32, others: usize) -> Names {
        let others = others as u32;
        let places = vec![(leaf, 0), (leaf, others), (leaf, others + (1 << WITHIN_BITS))];
        Names { places, is_full: false }
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
                "choose a smaller --tolerance",
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
pub(super) fn first_bytes(encoding: Option<Encoding>) -> FacetBytes {
    match encoding {
        Some(Encoding { triangles: Triangles::Lone(append), .. }) => FacetBytes { append, normals: true },
        Some(Encoding { triangles: Triangles::Numbered(_), .. }) => {
            FacetBytes { append: write_triples, normals: false }
        }
        None => FacetBytes { append: write_whole, normals: false },
    }
}

/// Triangles as [`write_whole`] makes them.
pub(super) fn whole(bytes: &[u8]) -> Vec<Facet> {
    each_whole(bytes).collect()
}

/// The same, one after the other.
pub(super) fn each_whole(bytes: &[u8]) -> impl ExactSizeIterator<Item = Facet> {
    bytes.as_chunks::<WHOLE_BYTES>().0.iter().map(|bytes| {
        let (words, _) = bytes.as_chunks::<4>();
        let triple = |n: usize| [words[n], words[n + 1], words[n + 2]];
        let corner = |n: usize| triple(3 * n).map(f32::from_le_bytes);
        Facet { ids: triple(0).map(u32::from_le_bytes), corners: [corner(1), corner(2), corner(3)] }
    })
}

/// Where the triangles of all leaves wait.
pub(super) struct Later {
    /// `None` if they wait in memory.
    file: Option<TempFile>,
    encoding: Option<Encoding>,
}

/// The triangles of a leaf.
pub(super) struct Waiting {
    /// The places of their names.
    places: u32,
    /// How many there are.
    pub count: u32,
    /// Of how many leaves, the first ones, the vertices must have come.
    leaves: u32,
    kept: Kept,
}

/// Triangles, then places.
enum Kept {
    At(u64),
    Bytes(Vec<u8>),
}

impl Waiting {
    /// They take no more room than they need.
    pub(super) fn shrink(&mut self) {
        if let Kept::Bytes(bytes) = &mut self.kept {
            bytes.shrink_to_fit();
        }
    }

    /// The room that they took, when they are of no use any more.
    pub(super) fn room(&mut self) -> Vec<u8> {
        match &mut self.kept {
            Kept::Bytes(bytes) => std::mem::take(bytes),
            Kept::At(_) => Vec::new(),
        }
    }
}

/// Which vertices have come, and which triangles wait for others.
pub(super) struct Numbering {
    /// Of each leaf's first vertex, as far as it is known, the next leaf's included.
    pub first_vertex: Vec<u32>,
    pub waiting: Vec<Waiting>,
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
    pub(super) fn next(&self) -> Option<&Waiting> {
        let next = self.waiting.get(self.given)?;
        ((next.leaves as usize) < self.first_vertex.len()).then_some(next)
    }
}

/// The triangles of a leaf with the numbers of their vertices.
pub(super) enum Numbered {
    /// As the sink's encoding makes them.
    Bytes(Vec<u8>),
    Facets(Vec<Facet>),
}

impl Later {
    /// For a sink with this encoding, and a folder for files if there is one.
    pub(super) fn new(folder: Option<&Path>, encoding: Option<Encoding>) -> Later {
        Later { file: folder.map(TempFile::new), encoding }
    }

    /// Puts the triangles of a leaf away, in a file or in the room that they have.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub(super) fn keep(&self, leaf: &mut LeafFacets) -> Result<Waiting> {
        let places = leaf.names.places(1 << WITHIN_BITS)?;
        if u32::try_from(leaf.count).is_err() {
            return Err(Error::setting(
                "the triangles of one brick are more than 2^32 - 1",
                "choose a coarser level with --level",
            ));
        }
        let (places, count) = (if leaf.count > 0 { places } else { &[] }, leaf.count as u32);
        let leaves = places.iter().map(|(leaf, _)| leaf + 1).max().unwrap_or(0);
        let numbers = places.iter().flat_map(|(leaf, number)| [leaf, number]);
        leaf.bytes.extend(numbers.flat_map(|number| number.to_le_bytes()));
        let kept = match &self.file {
            Some(file) if count > 0 => Kept::At(file.append(&leaf.bytes)?),
            _ => Kept::Bytes(std::mem::take(&mut leaf.bytes)),
        };
        Ok(Waiting { places: places.len() as u32, count, leaves, kept })
    }

    /// Gives them their numbers; `first_vertex` has that of each leaf's first vertex. Bytes go into `room`, which is empty.
    ///
    /// # Errors
    /// If the file cannot be read, or holds what was not written.
    pub(super) fn numbered(
        &self,
        waiting: &Waiting,
        first_vertex: &[u32],
        room: Vec<u8>,
    ) -> Result<Numbered> {
        let each = if self.encoding.is_some() { TRIPLE_BYTES } else { WHOLE_BYTES };
        let triangles = waiting.count as usize * each;
        let mut read = Vec::new();
        let bytes = match &waiting.kept {
            Kept::Bytes(bytes) => &bytes[..],
            Kept::At(offset) => {
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
    fn with_numbers(&self, triangles: &[u8], firsts: &[u32], mut room: Vec<u8>) -> Option<Numbered> {
        let number = |name: u32| Some(firsts.get((name >> WITHIN_BITS) as usize)? + (name & 0xFFFF));
        let numbers = |[a, b, c]: [u32; 3]| Some([number(a)?, number(b)?, number(c)?]);
        let Some(Encoding { triangles: Triangles::Numbered(encode), .. }) = self.encoding else {
            let facets = whole(triangles).into_iter();
            let facet = |facet: Facet| Some(Facet { ids: numbers(facet.ids)?, ..facet });
            return Some(Numbered::Facets(facets.map(facet).collect::<Option<_>>()?));
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
        Some(Numbered::Bytes(room))
    }
}

/// The error of names without a place that never left memory.
fn damaged() -> Error {
    Error::setting("the mesh contradicts itself", "write it again; if that does not help, report this")
}

#[cfg(test)]
mod tests {
    use super::super::sink::{MeshArrays, MeshSink};
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
            let mut names = Names::new(own, others as usize);
            let mut bytes = Vec::new();
            let mut expected = Vec::new();
            let whole = corners.len() / 3 * 3;
            for &(on_edge, leaf, number) in &corners[..whole] {
                let (name, number) = if on_edge {
                    (Names::ON_EDGES + number % ON_EDGES, first[own as usize] + others + number % ON_EDGES)
                } else {
                    (names.of(leaf, number), first[leaf as usize] + number)
                };
                bytes.extend(name.to_le_bytes());
                expected.push(number);
            }
            let later = Later::new(in_file.then(|| folder.path()), sink.encoding());
            let mut leaf = LeafFacets { count: whole / 3, bytes, names, ..LeafFacets::default() };
            let waiting = later.keep(&mut leaf).unwrap();
            let Numbered::Bytes(bytes) = later.numbered(&waiting, &first, Vec::new()).unwrap() else { unreachable!() };
            prop_assert_eq!(triples(&bytes, u32::from_le_bytes).flatten().collect::<Vec<_>>(), expected);
            // A leaf that is not there.
            prop_assert!(later.numbered(&waiting, &first[..0], Vec::new()).is_err());
        }
    }
}
