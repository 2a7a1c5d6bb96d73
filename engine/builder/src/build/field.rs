//! What a tree is built from, and the view of it that sorting, jobs and subtrees share.

use super::fit::MeshTolerance;
use crate::backend::BatchLeaf;
use crate::brick::{Brick, Samples, SignChanges, ThinFeatures, ThinLines};
use crate::error::Result;
use crate::lattice::{NodeKey, Units};
use crate::store::Refine;

/// A field of winding numbers made of pieces. The pass over the input sorts the pieces into the cubes that
/// they touch; a brick follows from those that touch it, and from nothing else.
pub(super) trait PieceField: Sync {
    /// A compact record, copied to every job that needs it.
    type Piece: Copy + Send + Sync;
    /// Sums from which the corners of the bricks some levels below a node follow.
    type Corners: Clone + Send + Sync;
    /// Working memory for evaluating bricks one after the other; one per thread.
    type Evaluator: Default;
    /// The samples of one brick, and what is known of them while its pieces are at hand.
    type Evaluation<'a>: BrickEvaluation
    where
        Self: 'a;

    /// Smallest and largest coordinate along each axis.
    fn bounds(&self, piece: &Self::Piece) -> (Units, Units);
    /// Some points of the piece, which may be equal: a cube that holds one needs no further test.
    fn points(&self, piece: &Self::Piece) -> [Units; 3];
    /// Asks of closed cubes `low..low + size`, given their `low` and that the bounds of the piece touch them, whether the
    /// piece does. May err towards touching.
    fn cube_test(&self, piece: &Self::Piece, size: i32) -> impl Fn(Units) -> bool;
    /// Whether the piece has no part in the field, wherever it lies.
    fn is_void(&self, piece: &Self::Piece) -> bool;

    /// Sums of nothing, for the bricks `stride` levels below `node`.
    fn corners(&self, node: NodeKey, stride: u8) -> Self::Corners;
    /// Adds a piece.
    fn add_corners(&self, corners: &mut Self::Corners, piece: &Self::Piece);
    /// Adds another part's sums.
    fn merge_corners(&self, corners: &mut Self::Corners, other: &Self::Corners);
    /// The samples at the bricks' corners, x fastest, given the one at the node's own; empty if the field
    /// needs none.
    fn finish_corners(&self, corners: Self::Corners, corner: i64) -> Vec<i64>;

    /// The value of all samples of `key`, at whatever level, if it is known without evaluating: no piece of
    /// the list has its surface there.
    fn settled(&self, key: NodeKey, corner: i16, list: PieceList<'_, Self::Piece>) -> Option<i16>;
    /// Whether the field changes in a node that no piece touches, so that it has to be evaluated.
    fn is_restless(&self, _key: NodeKey) -> bool {
        false
    }
    /// Whether there may be such nodes.
    fn may_be_restless(&self) -> bool {
        false
    }
    /// The corners of the children of `key`, by octant, if the criterion refines it whatever its samples are: then
    /// they are a part of its children's.
    fn refined_unseen(
        &self,
        _refine: Refine,
        _key: NodeKey,
        _corner: i16,
        _list: PieceList<'_, Self::Piece>,
    ) -> Option<[i16; 8]> {
        None
    }
    /// Whether walls that matter may hide between the samples of a level, so that [`BrickEvaluation::thin`] is worth asking
    /// where it decides nothing.
    fn may_hide_walls(&self, _level: u8) -> bool {
        false
    }
    /// Evaluates the 33³ samples of `key` from the pieces that touch it and its corner: the sample (0, 0, 0), or
    /// what [`BrickEvaluation::corners`] of its parent gives in place of it.
    fn evaluate<'a>(
        &'a self,
        evaluator: &'a mut Self::Evaluator,
        key: NodeKey,
        corner: i16,
        list: PieceList<'a, Self::Piece>,
    ) -> Result<Self::Evaluation<'a>>;

    /// The brick of an evaluated node, and whether the boundary within it is near enough to the brick's mesh for the
    /// node to stay a leaf; false of fields that cannot tell.
    fn fits(
        &self,
        _evaluator: &mut Self::Evaluator,
        _tolerance: &MeshTolerance,
        _node: BatchLeaf<'_, Self::Piece>,
        brick: Brick,
    ) -> Result<(Brick, bool)> {
        Ok((brick, false))
    }

    /// Tells which nodes are evaluated next.
    fn foresee(&self, _evaluator: &mut Self::Evaluator, _nodes: &[BatchLeaf<'_, Self::Piece>]) {}

    /// Whether that is of use: a device does better with several.
    fn foresees(&self) -> bool {
        false
    }

    /// Whether leaves are evaluated in batches, ahead of their turn: then [`PieceField::next_leaf`] gives them.
    fn begin_leaves(&self, _evaluator: &mut Self::Evaluator) -> bool {
        false
    }

    /// The next one of some leaves, and what hides in it; to be called once for each.
    fn next_leaf(
        &self,
        _evaluator: &mut Self::Evaluator,
        _leaves: &[BatchLeaf<'_, Self::Piece>],
    ) -> Result<(Brick, ThinFeatures)> {
        unreachable!("no leaves were begun")
    }

    /// How many leaves are worth having together, of several jobs if one has fewer.
    fn leaves_together(&self) -> u64 {
        1
    }
}

/// Some pieces of an array, by index.
pub(super) struct PieceList<'a, P> {
    /// All of them.
    pub array: &'a [P],
    /// Those meant.
    pub indices: &'a [u32],
}

impl<P> Clone for PieceList<'_, P> {
    fn clone(&self) -> Self {
        *self
    }
}

impl<P> Copy for PieceList<'_, P> {}

/// What a brick's evaluation knows.
pub(super) trait BrickEvaluation {
    /// 33³ winding numbers.
    fn samples(&self) -> &Samples;
    /// The same, for good.
    fn into_samples(self) -> Samples;
    /// The corners of the node's children by octant.
    fn corners(&self) -> [i16; 8] {
        self.samples().child_corners()
    }
    /// Whether a lattice edge holds a wall or a gap that the samples at its ends do not show.
    fn has_hidden_crossings(&mut self) -> bool;
    /// Whether the boundary w = 0.5 crosses a lattice edge more than once.
    fn has_hidden_boundary(&mut self) -> bool;
    /// Whether two sheets of the boundary pass a face of the lattice, so that one of them may have holes in a mesh.
    fn has_ambiguous_face(&self) -> bool {
        SignChanges::of(self.samples()).has_ambiguous_face()
    }
    /// The walls and gaps of the boundary that lie between two samples, by what some lines tell; none of fields that cannot
    /// tell.
    fn thin(&mut self, _lines: ThinLines) -> Result<ThinFeatures> {
        Ok(ThinFeatures::default())
    }
    /// The leaf's brick, with its Hermite edges.
    fn into_leaf(self) -> Result<Brick>;
    /// What else is known of samples with binary places; `None` if they are whole.
    fn fractions(&self) -> Option<Fractions> {
        None
    }
}

/// What is known of samples with binary places.
#[derive(Clone, Copy, Debug)]
pub(super) struct Fractions {
    /// How many.
    pub bits: u8,
    /// Whether the field between the samples follows from them.
    pub straight: bool,
}
