//! Pieces of closed meshes: what a leaf has of the boundary of a void, and how pieces are joined.

use crate::error::{Error, Result};
use crate::lattice::hash_bits;
use crate::part::temporary::TempFile;
use std::collections::HashMap;

/// Bytes of a vertex and of a triangle.
const THREE_WORDS: usize = 12;
/// Bytes of an open edge.
const TWO_WORDS: usize = 8;

/// Triangles with corners in common.
#[derive(Debug, Default, PartialEq)]
pub(super) struct MeshPiece {
    /// World positions, each once.
    pub vertices: Vec<[f32; 3]>,
    /// Numbers of the corners.
    pub triangles: Vec<[u32; 3]>,
    /// Edges of triangles, in their direction, of which the piece does not have the reverse.
    pub open: Vec<[u32; 2]>,
}

/// A vertex' position by its bits.
pub(super) type CornerBits = [u32; 3];

pub(super) fn bits(position: [f32; 3]) -> CornerBits {
    position.map(f32::to_bits)
}

/// Triangles of a piece while it is made.
#[derive(Default)]
pub(super) struct PieceMaker {
    piece: MeshPiece,
    numbers: HashMap<CornerBits, u32>,
}

impl PieceMaker {
    /// Adds a triangle, unless two of its corners are one.
    pub fn add(&mut self, corners: [[f32; 3]; 3]) {
        let [a, b, c] = corners.map(|corner| self.number(corner));
        if a != b && b != c && c != a {
            self.piece.triangles.push([a, b, c]);
        }
    }

    fn number(&mut self, position: [f32; 3]) -> u32 {
        let next = self.piece.vertices.len() as u32;
        let number = *self.numbers.entry(bits(position)).or_insert(next);
        if number == next {
            self.piece.vertices.push(position);
        }
        number
    }

    pub fn finish(self) -> MeshPiece {
        let mut piece = self.piece;
        let directed = |[a, b]: [u32; 2]| (a.min(b), a.max(b), if a < b { 1 } else { -1 });
        let sides = |[a, b, c]: [u32; 3]| [[a, b], [b, c], [c, a]];
        let mut edges: Vec<_> = piece.triangles.iter().copied().flat_map(sides).map(directed).collect();
        edges.sort_unstable();
        for edge in edges.chunk_by(|a, b| (a.0, a.1) == (b.0, b.1)) {
            let (a, b, _) = edge[0];
            let sum: i32 = edge.iter().map(|(.., sign)| sign).sum();
            let open = if sum > 0 { [a, b] } else { [b, a] };
            piece.open.extend((0..sum.abs()).map(|_| open));
        }
        piece
    }
}

/// Where a piece lies in a file.
#[derive(Clone, Copy, Debug)]
pub(super) struct PiecePlace {
    offset: u64,
    vertices: u32,
    triangles: u32,
    open: u32,
}

impl MeshPiece {
    /// Appends it to a file.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn write(&self, file: &TempFile) -> Result<PiecePlace> {
        let vertices = self.vertices.iter().map(|position| bits(*position));
        let mut bytes = Vec::new();
        append(&mut bytes, vertices.chain(self.triangles.iter().copied()).flatten());
        append(&mut bytes, self.open.iter().copied().flatten());
        let [vertices, triangles, open] =
            [self.vertices.len(), self.triangles.len(), self.open.len()].map(|count| count as u32);
        Ok(PiecePlace { offset: file.append(&bytes)?, vertices, triangles, open })
    }

    /// Reads it.
    ///
    /// # Errors
    /// If the file cannot be read, or holds what was not written.
    pub fn read(file: &TempFile, place: PiecePlace) -> Result<MeshPiece> {
        let [vertices, triangles, open] =
            [place.vertices, place.triangles, place.open].map(|count| count as usize);
        let mut bytes = vec![0; (vertices + triangles) * THREE_WORDS + open * TWO_WORDS];
        file.read(place.offset, &mut bytes)?;
        let (whole, rest) = bytes.split_at((vertices + triangles) * THREE_WORDS);
        let (first, second) = whole.split_at(vertices * THREE_WORDS);
        let piece = MeshPiece {
            vertices: words::<3>(first).map(|bits| bits.map(f32::from_bits)).collect(),
            triangles: words(second).collect(),
            open: words(rest).collect(),
        };
        let mut numbers = piece.triangles.iter().flatten().chain(piece.open.iter().flatten());
        match numbers.all(|number| *number < place.vertices) {
            true => Ok(piece),
            false => Err(file.damaged()),
        }
    }
}

/// Appends words, little-endian.
pub(super) fn append(bytes: &mut Vec<u8>, words: impl Iterator<Item = u32>) {
    words.for_each(|word| bytes.extend(word.to_le_bytes()));
}

/// Words in groups of so many.
pub(super) fn words<const N: usize>(bytes: &[u8]) -> impl Iterator<Item = [u32; N]> {
    let word = |bytes: &[u8], n: usize| u32::from_le_bytes(std::array::from_fn(|b| bytes[4 * n + b]));
    bytes.chunks_exact(4 * N).map(move |bytes| std::array::from_fn(|n| word(bytes, n)))
}

/// An edge by the positions of its ends, the lower one first, and how often more it was passed this way than back.
pub(super) fn undirected(piece: &MeshPiece, [a, b]: [u32; 2]) -> ([CornerBits; 2], i32) {
    let [a, b] = [a, b].map(|n| bits(piece.vertices[n as usize]));
    if a < b { ([a, b], 1) } else { ([b, a], -1) }
}

/// Numbers for the vertices of pieces that are joined one after the other. It holds those alone of which edges are open.
#[derive(Default)]
pub(super) struct PieceJoiner {
    /// By position the number, and the sum of its open edges: zero once each has met its reverse.
    held: HashMap<CornerBits, (u32, u64)>,
    next: u32,
}

impl PieceJoiner {
    /// The numbers of a piece's vertices; those that are new follow each other from the number of all before, in their order.
    ///
    /// # Errors
    /// If there are too many.
    pub fn numbers(&mut self, piece: &MeshPiece) -> Result<(Vec<u32>, Vec<[f32; 3]>)> {
        let mut sums: HashMap<u32, u64> = HashMap::new();
        for edge in &piece.open {
            let (ends, sign) = undirected(piece, *edge);
            let [low, high] = ends.map(|end| hash_bits(end.map(u64::from)));
            let hash = hash_bits([low, high, 0]);
            let signed = if sign > 0 { hash } else { hash.wrapping_neg() };
            for end in edge {
                let sum = sums.entry(*end).or_default();
                *sum = sum.wrapping_add(signed);
            }
        }
        let mut fresh = Vec::new();
        let mut numbers = Vec::with_capacity(piece.vertices.len());
        for (n, position) in piece.vertices.iter().enumerate() {
            let sum = sums.get(&(n as u32)).copied();
            let known = sum.and_then(|_| self.held.get(&bits(*position)).copied());
            let (number, before) = match known {
                Some(known) => known,
                None => {
                    fresh.push(*position);
                    (self.take()?, 0)
                }
            };
            numbers.push(number);
            let Some(sum) = sum else { continue };
            match before.wrapping_add(sum) {
                0 => drop(self.held.remove(&bits(*position))),
                sum => drop(self.held.insert(bits(*position), (number, sum))),
            }
        }
        Ok((numbers, fresh))
    }

    fn take(&mut self) -> Result<u32> {
        let number = self.next;
        self.next = number.checked_add(1).ok_or_else(|| {
            let what = "the voids have more than 2^32 - 1 vertices together";
            Error::setting(what, "leave small ones out with `min_volume`, or take a coarser level")
        })?;
        Ok(number)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// The triangles of a torus of so many quads around and along.
    fn torus(around: usize, along: usize) -> Vec<[[f32; 3]; 3]> {
        let at = |i: usize, j: usize| {
            let turn = |n: usize, of: usize| (n % of) as f32 / of as f32 * std::f32::consts::TAU;
            let (u, v) = (turn(i, around), turn(j, along));
            [(3.0 + v.cos()) * u.cos(), (3.0 + v.cos()) * u.sin(), v.sin()]
        };
        let quads = (0..around).flat_map(|i| (0..along).map(move |j| (i, j)));
        quads
            .flat_map(|(i, j)| {
                let [a, b, c, d] = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
                [[a, b, c], [a, c, d]]
            })
            .collect()
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(48))]
        #[test]
        fn pieces_of_a_closed_mesh_become_that_mesh(
            around in 3usize..9, along in 3usize..9, pieces in 1usize..12, seed in any::<u64>(),
        ) {
            let folder = tempfile::tempdir().unwrap();
            let file = TempFile::new(folder.path());
            let mut makers: Vec<PieceMaker> = (0..pieces).map(|_| PieceMaker::default()).collect();
            let triangles = torus(around, along);
            for (n, corners) in triangles.iter().enumerate() {
                makers[crate::lattice::mix(seed ^ n as u64) as usize % pieces].add(*corners);
            }
            let (mut joiner, mut vertices, mut found) = (PieceJoiner::default(), Vec::new(), Vec::new());
            for maker in makers {
                let piece = maker.finish();
                let place = piece.write(&file).unwrap();
                let again = MeshPiece::read(&file, place).unwrap();
                prop_assert_eq!(&again, &piece);
                let (numbers, fresh) = joiner.numbers(&piece).unwrap();
                vertices.extend(fresh);
                found.extend(piece.triangles.iter().map(|t| t.map(|n| vertices[numbers[n as usize] as usize])));
            }
            // Each vertex once, nothing kept, and the triangles as they were.
            prop_assert_eq!(vertices.len(), around * along);
            prop_assert!(joiner.held.is_empty());
            let sorted = |mut all: Vec<[[f32; 3]; 3]>| {
                all.sort_unstable_by_key(|t| t.map(bits));
                all
            };
            prop_assert_eq!(sorted(found), sorted(triangles));
        }
    }

    #[test]
    fn triangles_without_area_are_left_out_and_open_edges_told() {
        let mut maker = PieceMaker::default();
        let [a, b, c] = [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
        maker.add([a, b, a]);
        maker.add([a, b, c]);
        let piece = maker.finish();
        assert_eq!((piece.triangles.len(), piece.vertices.len()), (1, 3));
        assert_eq!(piece.open, [[0, 1], [2, 0], [1, 2]]);
        let folder = tempfile::tempdir().unwrap();
        let file = TempFile::new(folder.path());
        let place = PiecePlace { vertices: 1, ..piece.write(&file).unwrap() };
        assert!(MeshPiece::read(&file, place).is_err());
    }
}
