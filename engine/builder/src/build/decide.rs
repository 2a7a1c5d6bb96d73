//! What becomes of a node of a tree whose nodes decide for themselves.

use super::bins::Binner;
use super::corners::corner_at;
use super::field::{BrickEvaluation, PieceField, PieceList};
use super::rules::Rules;
use crate::backend::BatchLeaf;
use crate::brick::{Brick, Samples, ThinFeatures};
use crate::contour::has_one_sheet;
use crate::error::Result;
use crate::lattice::{NodeKey, Octant};

/// A node with more pieces is refined without a look where a tolerance decides: one facet in a thousand of its cells'
/// would have to be a wrong one.
const PIECES_MAX: usize = 1 << 15;

/// A node that is to be decided.
pub(super) struct NodePieces<P> {
    pub key: NodeKey,
    /// As [`PieceField::evaluate`] takes it.
    pub corner: i16,
    /// All that touch it.
    pub pieces: Vec<P>,
}

/// One that is, and nothing below it built yet.
pub(super) enum NodeDecision<P> {
    /// No surface touches it.
    Empty(i16),
    /// With what hides in it, if anything.
    Leaf(Brick, Option<Box<ThinFeatures>>),
    /// Its samples, or `None` if these are joined from its children's, and the children.
    Refined(Option<Samples>, Box<[NodePieces<P>; 8]>),
}

impl<P: Copy> NodePieces<P> {
    /// A node is refined if its samples or crossings ask for it. Where its pieces do so already, it is not evaluated if it
    /// `may_join`, for its samples are a part of its children's.
    pub fn decide<F: PieceField<Piece = P>>(
        &self,
        field: &F,
        evaluator: &mut F::Evaluator,
        rules: &Rules,
        may_join: bool,
    ) -> Result<NodeDecision<P>> {
        let NodePieces { key, corner, pieces } = self;
        let all: Vec<u32> = (0..pieces.len() as u32).collect();
        let list = PieceList { array: pieces, indices: &all };
        if let Some(w) = field.settled(*key, *corner, list) {
            return Ok(NodeDecision::Empty(w));
        }
        let is_deepest = key.level() >= rules.depth;
        if may_join
            && !is_deepest
            && let Some(corners) = Self::refined_unseen(field, rules, *key, *corner, list)
        {
            return Ok(NodeDecision::Refined(None, self.children(field, corners)));
        }
        let mut evaluation = field.evaluate(evaluator, *key, *corner, list)?;
        if is_deepest || rules.keeps(&mut evaluation) {
            let thin = rules.thin_of(field, key.level(), &mut evaluation)?;
            if !is_deepest || !rules.divides_thin(key.level(), &thin, &evaluation) {
                let thin = (!thin.is_empty()).then(|| Box::new(thin));
                return Ok(NodeDecision::Leaf(evaluation.into_leaf()?, thin));
            }
        }
        let corners = evaluation.corners();
        // Where facets are many, most nodes show by their signs alone that they are too coarse.
        let samples = match &rules.tolerance {
            Some(tolerance) if has_one_sheet(evaluation.samples()) => {
                let brick = evaluation.into_leaf()?;
                let (brick, fits) = field.fits(evaluator, tolerance, self.as_leaf(&all), brick)?;
                if fits {
                    return Ok(NodeDecision::Leaf(brick, None));
                }
                brick.into_samples()
            }
            _ => evaluation.into_samples(),
        };
        Ok(NodeDecision::Refined(Some(samples), self.children(field, corners)))
    }

    /// The corners of the children, by octant, of a node that is refined whatever its samples are.
    pub fn refined_unseen<F: PieceField<Piece = P>>(
        field: &F,
        rules: &Rules,
        key: NodeKey,
        corner: i16,
        list: PieceList<'_, P>,
    ) -> Option<[i16; 8]> {
        if rules.tolerance.is_none() || list.indices.len() <= PIECES_MAX {
            return field.refined_unseen(rules.refine, key, corner, list);
        }
        let mut sums = field.corners(key, 1);
        list.indices.iter().for_each(|&i| field.add_corners(&mut sums, &list.array[i as usize]));
        let corners = field.finish_corners(sums, i64::from(corner));
        Some(std::array::from_fn(|octant| corner_at(&corners, 1, octant)))
    }

    /// The children by octant, with these corners and the pieces that touch them.
    fn children<F: PieceField<Piece = P>>(&self, field: &F, corners: [i16; 8]) -> Box<[NodePieces<P>; 8]> {
        let lists = Binner::new(self.key, 1).sort_indices(field, &self.pieces);
        let child = |octant: Octant| NodePieces {
            key: self.key.child(octant),
            corner: corners[octant.index()],
            pieces: lists.of(octant.index()).iter().map(|&i| self.pieces[i as usize]).collect(),
        };
        let children: Box<[_]> = Octant::all().map(child).collect();
        children.try_into().unwrap_or_else(|_| unreachable!("there are eight octants"))
    }

    /// As a brick to evaluate; `all` counts from 0 at least as far as it has pieces.
    pub fn as_leaf<'a>(&'a self, all: &'a [u32]) -> BatchLeaf<'a, P> {
        let indices = &all[..self.pieces.len()];
        BatchLeaf { key: self.key, corner: self.corner, array: &self.pieces, indices }
    }
}
