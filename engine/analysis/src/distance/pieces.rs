//! The patches of all leaves, in memory or in mapped files.

use super::boxes::{Block, BoxNodes, Lanes, NodeLevels, Normals};
use super::patch::Patch;
use super::piece::{NewPiece, Piece, RUN, base_of};
use crate::error::Result;
use crate::large_array::{ArrayRoom, LargeArray};
use crate::lattice::NodeKey;
use crate::part::temporary::require_room;
use std::path::{Path, PathBuf};

/// Of what memory there is, the share of patches, of their corners, of boxes, and of the normals in these, in hundredths: as they
/// take it.
const SHARES: [u64; 4] = [36, 38, 20, 6];

/// SurfacePieces of a surface by leaf. What does not fit into memory lies in mapped files, of which searches touch only what they need.
pub(super) struct SurfacePieces {
    deepest: u8,
    patches: LargeArray<Patch>,
    rings: LargeArray<[f32; 3]>,
    nodes: LargeArray<Lanes>,
    normals: LargeArray<Normals>,
    leaves: Vec<PieceEnd>,
    /// How many there will be at most.
    expected: usize,
    folder: PathBuf,
    is_checked: bool,
}

/// Where what a leaf has ends.
#[derive(Clone, Copy, Default)]
struct PieceEnd {
    patches: usize,
    rings: usize,
    nodes: usize,
    /// The box around its patches.
    whole: Block,
}

impl SurfacePieces {
    /// None yet, at most so many, in so many bytes of memory, with files in `folder` for what does not fit. The surface's finest
    /// leaves have level `deepest`.
    pub fn new(expected: usize, deepest: u8, (memory, folder): (u64, &Path)) -> SurfacePieces {
        let [patches, rings, nodes, normals] =
            SHARES.map(|share| ArrayRoom::new(memory / 100 * share, folder));
        SurfacePieces {
            deepest,
            patches: LargeArray::new(&patches),
            rings: LargeArray::new(&rings),
            nodes: LargeArray::new(&nodes),
            normals: LargeArray::new(&normals),
            leaves: Vec::new(),
            expected,
            folder: folder.to_owned(),
            is_checked: false,
        }
    }

    /// Adds that of the next leaf.
    ///
    /// # Errors
    /// If files cannot be made or grow; as soon as there is one, if the disk has no room for all leaves, which are taken to be as
    /// large as those before.
    pub fn push(&mut self, piece: &NewPiece) -> Result<()> {
        self.patches.extend_from_slice(&piece.patches)?;
        self.rings.extend_from_slice(&piece.rings)?;
        self.nodes.extend_from_slice(&piece.boxes.nodes)?;
        self.normals.extend_from_slice(&piece.boxes.normals)?;
        self.leaves.push(PieceEnd {
            patches: self.patches.len(),
            rings: self.rings.len(),
            nodes: self.nodes.len(),
            whole: piece.boxes.whole(),
        });
        if !self.is_checked && self.patches.is_in_file() {
            self.is_checked = true;
            let still = self.expected.saturating_sub(self.leaves.len()) as f64 / self.leaves.len() as f64;
            require_room(&self.folder, (self.bytes() as f64 * still) as u64)?;
        }
        Ok(())
    }

    /// Bytes of all.
    fn bytes(&self) -> usize {
        size_of_val(&*self.patches)
            + size_of_val(&*self.rings)
            + size_of_val(&*self.nodes)
            + size_of_val(&*self.normals)
    }

    /// How many patches there are.
    pub fn patches(&self) -> usize {
        self.patches.len()
    }

    /// The patches of a leaf, whose key is given.
    pub fn of(&self, leaf: usize, key: NodeKey) -> Piece<'_> {
        let begin = if leaf > 0 { self.leaves[leaf - 1] } else { PieceEnd::default() };
        let end = self.leaves[leaf];
        let count = end.patches - begin.patches;
        let nodes = (&self.nodes[begin.nodes..end.nodes], &self.normals[begin.nodes..end.nodes]);
        debug_assert_eq!(nodes.0.len(), NodeLevels::over(count.div_ceil(RUN)).nodes());
        Piece {
            base: base_of(key, self.deepest),
            patches: &self.patches[begin.patches..end.patches],
            rings: &self.rings[begin.rings..end.rings],
            boxes: BoxNodes::new(nodes, (count, RUN), end.whole),
        }
    }
}
