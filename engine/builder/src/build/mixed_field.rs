//! The field of meshes and point clouds as sorting, jobs and subtrees see it: facets and balls are its pieces.

use super::corners::corner_at;
use super::field::{BrickEvaluation, Fractions, PieceField, PieceList};
use super::soup::{OpenEvaluation, Soup};
use crate::brick::{Brick, Samples};
use crate::error::Result;
use crate::lattice::{CubeTest, NodeKey, Triangle, Units};
use crate::store::Refine;
use crate::winding::{
    CloudPiece, CornerGrid, Evaluator, MixedEvaluator, MixedField, OpenField, TriangleList,
};

/// What touches cubes.
#[derive(Clone, Copy)]
pub(super) enum MixedPiece {
    /// A facet of a mesh, or a cap that closes one.
    Facet(Triangle),
    /// A point of a cloud.
    Ball(CloudPiece),
}

/// Evaluates bricks; one per thread.
#[derive(Default)]
pub(super) struct MixedBrickEvaluator {
    counts: Evaluator,
    sums: MixedEvaluator,
    /// The facets and caps of the brick, and their numbers.
    triangles: Vec<Triangle>,
    numbers: Vec<u32>,
}

/// What is known of a brick.
pub(super) struct MixedEvaluation<'a> {
    of_facets: OpenEvaluation<'a>,
    /// Whether a ball touches it that is too small for its samples to show.
    has_details: bool,
}

impl MixedPiece {
    fn facet(&self) -> Option<&Triangle> {
        match self {
            MixedPiece::Facet(t) => Some(t),
            MixedPiece::Ball(_) => None,
        }
    }

    fn ball(&self) -> Option<&CloudPiece> {
        match self {
            MixedPiece::Facet(_) => None,
            MixedPiece::Ball(ball) => Some(ball),
        }
    }
}

/// The pieces of a list.
fn pieces_of(list: PieceList<'_, MixedPiece>) -> impl Iterator<Item = &MixedPiece> {
    list.indices.iter().map(|&i| &list.array[i as usize])
}

impl PieceField for MixedField {
    type Piece = MixedPiece;
    type Corners = CornerGrid;
    type Evaluator = MixedBrickEvaluator;
    type Evaluation<'a> = MixedEvaluation<'a>;

    fn bounds(&self, piece: &MixedPiece) -> (Units, Units) {
        match piece {
            MixedPiece::Facet(t) => Soup::CPU.bounds(t),
            MixedPiece::Ball(ball) => ball.bounds(),
        }
    }

    fn points(&self, piece: &MixedPiece) -> [Units; 3] {
        match piece {
            MixedPiece::Facet(t) => Soup::CPU.points(t),
            MixedPiece::Ball(ball) => [ball.position; 3],
        }
    }

    fn cube_test(&self, piece: &MixedPiece, size: i32) -> impl Fn(Units) -> bool {
        let of_facet = piece.facet().map(|t| CubeTest::new(t, size));
        let ball = piece.ball().copied();
        move |low| {
            of_facet.as_ref().is_some_and(|test| test.touches(low))
                || ball.is_some_and(|ball| ball.touches_cube(low, size))
        }
    }

    fn is_void(&self, piece: &MixedPiece) -> bool {
        piece.facet().is_some_and(|t| Soup::CPU.is_void(t))
    }

    fn corners(&self, node: NodeKey, stride: u8) -> CornerGrid {
        CornerGrid::new(node, stride)
    }

    fn add_corners(&self, corners: &mut CornerGrid, piece: &MixedPiece) {
        piece.facet().into_iter().for_each(|t| corners.add(t));
    }

    fn merge_corners(&self, corners: &mut CornerGrid, other: &CornerGrid) {
        corners.merge(other);
    }

    fn finish_corners(&self, corners: CornerGrid, corner: i64) -> Vec<i64> {
        corners.finish(corner)
    }

    /// The clouds' part changes everywhere.
    fn settled(&self, _: NodeKey, _: i16, _: PieceList<'_, MixedPiece>) -> Option<i16> {
        None
    }

    /// A node that a facet touches, or a ball too small for its samples, has hidden crossings.
    fn refined_unseen(
        &self,
        refine: Refine,
        key: NodeKey,
        corner: i16,
        list: PieceList<'_, MixedPiece>,
    ) -> Option<[i16; 8]> {
        let hides = |piece: &MixedPiece| match piece {
            MixedPiece::Facet(t) => !self.is_cap(t),
            MixedPiece::Ball(ball) => !ball.is_seen_by(key),
        };
        if refine != Refine::Hidden || !pieces_of(list).any(hides) {
            return None;
        }
        let mut grid = CornerGrid::new(key, 1);
        pieces_of(list).for_each(|piece| self.add_corners(&mut grid, piece));
        let counts = grid.finish(i64::from(OpenField::corner_count(key, corner)));
        Some(std::array::from_fn(|octant| corner_at(&counts, 1, octant)))
    }

    fn evaluate<'a>(
        &'a self,
        evaluator: &'a mut MixedBrickEvaluator,
        key: NodeKey,
        corner: i16,
        list: PieceList<'a, MixedPiece>,
    ) -> Result<MixedEvaluation<'a>> {
        let MixedBrickEvaluator { counts, sums, triangles, numbers } = evaluator;
        triangles.clear();
        triangles.extend(pieces_of(list).filter_map(MixedPiece::facet));
        numbers.extend(numbers.len() as u32..triangles.len() as u32);
        let (triangles, numbers): (&'a Vec<Triangle>, &'a Vec<u32>) = (triangles, numbers);
        let facets = TriangleList { array: triangles, indices: &numbers[..triangles.len()] };
        let counts = counts.evaluate(key, OpenField::corner_count(key, corner), facets)?;
        let samples = self.samples(sums, key, &counts.samples)?;
        let balls = || pieces_of(list).filter_map(MixedPiece::ball);
        let is_tame = balls().next().is_none() && self.is_tame(&counts.samples, &samples, facets);
        let brick = match is_tame {
            true => self.tame_brick(key, samples),
            false => self.brick(key, &counts.samples, samples, facets),
        };
        let is_touched = triangles.iter().any(|t| !self.is_cap(t));
        let of_facets = OpenEvaluation { brick, counts: is_tame.then_some(counts), is_touched };
        Ok(MixedEvaluation { of_facets, has_details: balls().any(|ball| !ball.is_seen_by(key)) })
    }
}

impl BrickEvaluation for MixedEvaluation<'_> {
    fn samples(&self) -> &Samples {
        self.of_facets.samples()
    }

    fn into_samples(self) -> Samples {
        self.of_facets.into_samples()
    }

    fn corners(&self) -> [i16; 8] {
        self.of_facets.corners()
    }

    fn fractions(&self) -> Option<Fractions> {
        self.of_facets.fractions()
    }

    fn has_hidden_crossings(&mut self) -> bool {
        self.has_details || self.of_facets.has_hidden_crossings()
    }

    fn has_hidden_boundary(&mut self) -> bool {
        self.has_details || self.of_facets.has_hidden_boundary()
    }

    fn into_leaf(self) -> Result<Brick> {
        self.of_facets.into_leaf()
    }
}
