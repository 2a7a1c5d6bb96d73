//! Voids as closed meshes, those that open through a throat with a lid there.
//!
//! All voids are contoured at once. Where two of them touch across an edge of cells, on a face two of whose corners are inside,
//! the contour may join their surfaces, so that neither is closed: each ends at edges that the other has, too. Such voids are
//! contoured again, in groups of which no two had an edge in common.
//!
//! Pieces of leaves wait in a file without a name until the void that they belong to is written, so memory is that of the
//! contour and of the vertices on faces beyond which pieces are still to come.

use super::find::Voids;
use super::mesh_piece::{
    CornerBits, MeshPiece, PieceJoiner, PieceMaker, PiecePlace, append, undirected, words,
};
use super::void::Void;
use super::wanted::WantedVoids;
use crate::contour::{Bend, EdgeFacet, edge_facets};
use crate::error::{Error, Result};
use crate::lattice::NodeKey;
use crate::part::temporary::TempFile;
use crate::progress::Progress;
use crate::store::{MovedTree, Store};
use std::collections::{BTreeMap, BTreeSet, HashMap};
use std::path::Path;

/// Bytes for bricks, at least.
const LEAST_BYTES: u64 = 32 << 20;
/// Triangles that are handed over at once.
const AT_ONCE: usize = 1 << 15;

/// Takes the meshes of voids, largest void first. Triangles are counter-clockwise seen from outside of the void.
pub trait VoidMeshSink {
    /// Whether the triangles of each void come behind its vertices. Else all vertices come first.
    fn is_void_by_void(&self) -> bool;

    /// The next vertices of a void. The first one of all has number 0.
    ///
    /// # Errors
    /// What taking them gives.
    fn vertices(&mut self, void: &Void, positions: &[[f32; 3]]) -> Result<()>;

    /// The next triangles of a void, by the numbers of their corners.
    ///
    /// # Errors
    /// What taking them gives.
    fn triangles(&mut self, void: &Void, corners: &[[u32; 3]]) -> Result<()>;
}

/// How meshes of voids are made.
#[derive(Clone, Copy, Debug)]
pub struct VoidMeshOptions<'a> {
    /// Bytes for bricks and vertices.
    pub memory: u64,
    /// Where a temporary file may lie.
    pub folder: &'a Path,
    /// What positions count from.
    pub origin: [f64; 3],
}

/// Writes the boundaries of all voids as closed meshes, with followed creases.
///
/// # Errors
/// What reading the store gives, and the sink; [`Error::Setting`] if there are more than 2^32 − 1 vertices;
/// [`Error::Interrupted`].
pub fn write_meshes(
    store: &Store,
    found: &Voids,
    options: &VoidMeshOptions<'_>,
    sink: &mut dyn VoidMeshSink,
    progress: &dyn Progress,
) -> Result<()> {
    let mut pieces = VoidPieces::new(options.folder);
    let tree = MovedTree::new(store, options.origin);
    let all = found.voids.iter().map(|void| void.component).collect();
    let touching = pieces.contour(&tree, found, &all, options.memory, progress)?;
    for group in groups(&touching) {
        if !pieces.contour(&tree, found, &group, options.memory, progress)?.is_empty() {
            let what = "the boundary of a void is not closed";
            return Err(Error::setting(what, "report this, with the store"));
        }
    }
    pieces.write(found, sink, progress)
}

/// By void the others whose open edges it shares.
type Touching = BTreeMap<usize, BTreeSet<usize>>;

/// Groups of voids of which no two touch.
fn groups(touching: &Touching) -> Vec<BTreeSet<usize>> {
    let mut group_of: BTreeMap<usize, usize> = BTreeMap::new();
    let mut groups: Vec<BTreeSet<usize>> = Vec::new();
    for (void, others) in touching {
        let taken: BTreeSet<usize> = others.iter().filter_map(|other| group_of.get(other).copied()).collect();
        let free = (0..groups.len()).find(|group| !taken.contains(group)).unwrap_or(groups.len());
        if free == groups.len() {
            groups.push(BTreeSet::new());
        }
        groups[free].insert(*void);
        group_of.insert(*void, free);
    }
    groups
}

/// Edges that are open so far, by the void: how often more they were passed one way than the other.
#[derive(Default)]
struct OpenEdges(HashMap<([CornerBits; 2], usize), i32>);

impl OpenEdges {
    fn add(&mut self, void: usize, edges: &[([CornerBits; 2], i32)]) {
        for (edge, sign) in edges {
            let sum = self.0.remove(&(*edge, void)).unwrap_or(0) + sign;
            if sum != 0 {
                self.0.insert((*edge, void), sum);
            }
        }
    }

    /// What is left when all pieces have come.
    fn touching(self) -> Touching {
        let mut left: Vec<([CornerBits; 2], usize)> = self.0.into_keys().collect();
        left.sort_unstable();
        let mut touching = Touching::new();
        for edge in left.chunk_by(|a, b| a.0 == b.0) {
            for (_, void) in edge {
                let others = edge.iter().map(|(_, other)| *other).filter(|other| other != void);
                touching.entry(*void).or_default().extend(others);
            }
        }
        touching
    }
}

/// The pieces of all voids, in a file.
struct VoidPieces {
    file: TempFile,
    /// By void, in Morton order of their leaves.
    of: BTreeMap<usize, Vec<PiecePlace>>,
}

/// A piece of a void that lies in the file, and its open edges.
type WrittenPiece = (usize, PiecePlace, Vec<([CornerBits; 2], i32)>);

impl VoidPieces {
    fn new(folder: &Path) -> VoidPieces {
        VoidPieces { file: TempFile::new(folder), of: BTreeMap::new() }
    }

    /// Contours some voids, whose pieces take the place of any before. Returns those that are not closed.
    fn contour(
        &mut self,
        tree: &MovedTree<'_>,
        found: &Voids,
        some: &BTreeSet<usize>,
        memory: u64,
        progress: &dyn Progress,
    ) -> Result<Touching> {
        some.iter().for_each(|void| drop(self.of.remove(void)));
        let (labelling, pores) = (&found.labelling, found.pores.as_ref());
        let count = labelling.components.len() + pores.map_or(0, |pores| pores.pores.len());
        let wanted = (0..count).map(|void| some.contains(&void)).collect();
        let bytes = usize::try_from((memory / 2).max(LEAST_BYTES)).unwrap_or(usize::MAX);
        // A part of the memory is for labels of leaves that wait for their vertices.
        let label_bytes = bytes / 8;
        let voids = WantedVoids::new(tree, (labelling, pores), wanted, label_bytes);
        let is_wanted = |key: NodeKey| voids.is_in(labelling.order.covering(key));
        let file = &self.file;
        let make = |key: NodeKey, facets: &[EdgeFacet]| {
            let pieces = of_leaf(&voids, labelling.order.covering(key), facets)?;
            let write = |(void, piece): (usize, MeshPiece)| -> Result<WrittenPiece> {
                let open = piece.open.iter().map(|edge| undirected(&piece, *edge)).collect();
                Ok((void, piece.write(file)?, open))
            };
            pieces.into_iter().map(write).collect::<Result<Vec<WrittenPiece>>>()
        };
        let mut edges = OpenEdges::default();
        let (bend, bytes) = (Bend::Slight, bytes - label_bytes);
        edge_facets(&voids, bytes, (bend, is_wanted), progress, make, |pieces: Vec<WrittenPiece>| {
            for (void, place, open) in pieces {
                edges.add(void, &open);
                self.of.entry(void).or_default().push(place);
            }
            Ok(())
        })?;
        Ok(edges.touching())
    }

    /// Joins the pieces of each void and hands them over.
    fn write(&self, found: &Voids, sink: &mut dyn VoidMeshSink, progress: &dyn Progress) -> Result<()> {
        progress.phase("meshes of voids", Some(found.voids.len() as u64), "voids");
        let mut joiner = PieceJoiner::default();
        let mut later = Vec::new();
        for void in &found.voids {
            progress.check()?;
            let mut waiting = Vec::new();
            for place in self.of.get(&void.component).into_iter().flatten() {
                let piece = MeshPiece::read(&self.file, *place)?;
                let (numbers, fresh) = joiner.numbers(&piece)?;
                sink.vertices(void, &fresh)?;
                let corners = piece.triangles.iter().flatten().map(|corner| numbers[*corner as usize]);
                let mut bytes = Vec::new();
                append(&mut bytes, corners);
                waiting.push((self.file.append(&bytes)?, bytes.len()));
            }
            progress.advance(1);
            match sink.is_void_by_void() {
                true => self.hand_over(void, &waiting, sink)?,
                false => later.push((void, waiting)),
            }
        }
        later.iter().try_for_each(|(void, waiting)| {
            progress.check()?;
            self.hand_over(void, waiting, sink)
        })
    }

    /// Hands over the triangles that wait in the file, by offset and bytes.
    fn hand_over(&self, void: &Void, waiting: &[(u64, usize)], sink: &mut dyn VoidMeshSink) -> Result<()> {
        for (offset, count) in waiting {
            let mut bytes = vec![0; *count];
            self.file.read(*offset, &mut bytes)?;
            let corners: Vec<[u32; 3]> = words(&bytes).collect();
            corners.chunks(AT_ONCE).try_for_each(|corners| sink.triangles(void, corners))?;
        }
        Ok(())
    }
}

/// What a leaf has of the boundaries of wanted voids.
fn of_leaf(voids: &WantedVoids<'_>, leaf: usize, facets: &[EdgeFacet]) -> Result<BTreeMap<usize, MeshPiece>> {
    let only = voids.only_in(leaf);
    let labels = if only.is_none() { Some(voids.labels_of(leaf)?) } else { None };
    let mut makers: BTreeMap<usize, PieceMaker> = BTreeMap::new();
    for facet in facets {
        let Some(void) = only.or_else(|| labels.as_ref()?.at(facet.outer())) else { continue };
        let [a, b, c] = facet.corners;
        // The contour's triangles face out of the solid.
        makers.entry(void).or_default().add([a, c, b]);
    }
    let pieces = makers.into_iter().map(|(void, maker)| (void, maker.finish()));
    Ok(pieces.filter(|(_, piece)| !piece.triangles.is_empty()).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn voids_that_touch_are_in_different_groups() {
        let mut touching = Touching::new();
        for (a, b) in [(0, 1), (1, 2), (2, 0), (2, 3), (7, 8), (9, 9)] {
            touching.entry(a).or_default().extend((a != b).then_some(b));
            touching.entry(b).or_default().extend((a != b).then_some(a));
        }
        let groups = groups(&touching);
        assert_eq!(groups.len(), 3);
        assert_eq!(groups.iter().map(BTreeSet::len).sum::<usize>(), touching.len());
        for group in &groups {
            assert!(group.iter().all(|void| touching[void].is_disjoint(group)));
        }
    }

    #[test]
    fn edges_that_two_voids_have_are_left() {
        let at = |n: u32| [n, 0, 0];
        let mut edges = OpenEdges::default();
        edges.add(4, &[([at(0), at(1)], 1), ([at(1), at(2)], 1)]);
        edges.add(4, &[([at(1), at(2)], -1)]);
        edges.add(6, &[([at(0), at(1)], -1)]);
        let expected: Touching = [(4, [6].into()), (6, [4].into())].into();
        assert_eq!(edges.touching(), expected);
    }
}
