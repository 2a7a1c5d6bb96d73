//! The surface of a store as patches, found by place: nearest points, rays, and balls that touch it.

use super::answers::{BallAt, Foot, Place};
use super::boxes::{Block, Boxes, Lanes, Normals, Question};
use super::patch::Patch;
use super::piece::{NewPiece, Piece, base_of};
use super::pieces::SurfacePieces;
use super::questions::{Ball, NearestQuery, NormalAround, OfPiece, PatchQuestion, PiecesIn, RayQuery};
use crate::contour::{Bend, edge_facets};
use crate::error::{Error, Result};
use crate::lattice::{NodeKey, RootCube, length, minus, spacing_bits};
use crate::progress::Progress;
use crate::store::{BrickTree, MovedTree};
use crate::wide::{Simd, f32x8};
use std::path::Path;

/// How far below the surface the solid is asked whose it is, in cells.
const INNER: f64 = 0.3;

/// The surface w = 0.5 of a tree, made once: about 150 bytes a vertex of its mesh, in mapped files beside memory where they are
/// more than allowed.
pub struct Surface {
    root: RootCube,
    deepest: u8,
    keys: Vec<NodeKey>,
    pieces: SurfacePieces,
    boxes: Boxes,
    memory: u64,
}

impl Surface {
    /// Of a tree, in so many bytes of memory, with files in `folder` for what does not fit.
    ///
    /// # Errors
    /// What contouring and the files give.
    pub fn new(tree: &dyn BrickTree, memory: u64, folder: &Path, progress: &dyn Progress) -> Result<Surface> {
        let (root, deepest) = (tree.root(), tree.deepest_level());
        // Facets have coordinates of 32 bits: far from the origin they are those of a tree about its middle.
        let moved = MovedTree::new(tree, MovedTree::middle(tree));
        let placed: &dyn BrickTree = if MovedTree::is_far(tree) { &moved } else { tree };
        let is_crossed =
            |key: &NodeKey| tree.node(*key).is_some_and(|node| node.leaf && node.min < 1 && node.max >= 1);
        let crossed = tree.keys().iter().filter(|key| is_crossed(key)).count();
        let (mut keys, mut pieces) = (Vec::new(), SurfacePieces::new(crossed, deepest, (memory, folder)));
        let (mut blocks, mut normals) = (Vec::new(), Vec::new());
        let caches = (memory / 2).clamp(16 << 20, 512 << 20);
        let make = |key: NodeKey, facets: &[_]| {
            let brick = tree.brick(key)?;
            Ok(NewPiece::new(placed.root(), deepest, key, &brick, facets).map(|piece| (key, piece)))
        };
        edge_facets(
            placed,
            caches as usize,
            (Bend::Strong, |_| true),
            progress,
            make,
            |made: Option<(NodeKey, NewPiece)>| {
                let Some((key, piece)) = made else { return Ok(()) };
                keys.push(key);
                blocks.push(piece.block(base_of(key, deepest)));
                normals.push(piece.normals());
                pieces.push(&piece)
            },
        )?;
        let boxes = Boxes::new(blocks.into_iter(), 1).with_normals(normals.into_iter());
        Ok(Surface { root, deepest, keys, pieces, boxes, memory })
    }

    /// The cube that the tree divides.
    pub fn root(&self) -> RootCube {
        self.root
    }

    /// World length of a cell of the deepest level.
    pub fn cell(&self) -> f64 {
        self.root.spacing(self.deepest)
    }

    /// The bytes of memory that it was given.
    pub(super) fn memory(&self) -> u64 {
        self.memory
    }

    /// How many patches there are: one for each crossing.
    pub fn patches(&self) -> u64 {
        self.pieces.patches() as u64
    }

    /// Leaves that have patches, in Morton order.
    pub fn leaves(&self) -> &[NodeKey] {
        &self.keys
    }

    /// A world position in cells.
    pub fn to_cells(&self, world: [f64; 3]) -> [f64; 3] {
        let cell = f64::from(1u32 << spacing_bits(self.deepest));
        self.root.to_units(world).map(|u| (u - 1.0) / cell)
    }

    /// The world position of a place in cells.
    pub fn to_world(&self, cells: [f64; 3]) -> [f64; 3] {
        let cell = f64::from(1u32 << spacing_bits(self.deepest));
        self.root.to_world(cells.map(|c| c * cell + 1.0))
    }

    /// The box of all patches, in world units; `None` if there are none.
    pub fn bounds(&self) -> Option<[[f64; 3]; 2]> {
        let ends = self.boxes.whole().map(|end| self.to_world(end.map(f64::from)));
        (!self.keys.is_empty()).then_some(ends)
    }

    /// Refuses a length above the diagonal of that box: what grows by it has a surface whose area goes with its square, and which
    /// is soon that of a ball. `what` is done by the length.
    pub(super) fn require_within_diagonal(&self, what: &str, by: f64, remedy: &str) -> Result<()> {
        let Some([low, high]) = self.bounds() else { return Ok(()) };
        let diagonal = length(minus(high, low));
        if by <= diagonal {
            return Ok(());
        }
        let what = format!("{what} {by} is more than the diagonal of the part, {diagonal:.6}");
        Err(Error::setting(what, remedy))
    }

    /// The patches of a leaf.
    #[inline]
    pub(super) fn piece(&self, leaf: usize) -> Piece<'_> {
        self.pieces.of(leaf, self.keys[leaf])
    }

    /// Leaves whose patches may meet a block of cells, in Morton order.
    pub(super) fn pieces_in(&self, block: Block) -> Vec<usize> {
        let mut pieces = PiecesIn::new(block);
        self.boxes.search(&mut pieces);
        pieces.found()
    }

    /// Asks all patches, those in near boxes first.
    pub(super) fn ask<Q: PatchQuestion>(&self, mut question: Q) -> Q {
        struct OfAll<'a, Q>(&'a Surface, &'a mut Q);
        impl<Q: PatchQuestion> Question for OfAll<'_, Q> {
            #[inline(always)]
            fn nearness<S: Simd>(&self, simd: S, boxes: &Lanes, normals: Option<&Normals>) -> f32x8<S> {
                self.1.nearness(simd, boxes, normals)
            }

            #[inline(always)]
            fn counts(&self, nearness: f32) -> bool {
                self.1.counts(nearness)
            }

            fn visit(&mut self, leaf: usize) -> bool {
                let OfAll(surface, question) = self;
                let piece = surface.piece(leaf);
                question.count_from(piece.base, piece.boxes.size());
                piece.boxes.search(&mut OfPiece { piece, leaf: leaf as u32, question: *question });
                question.count_from([0.0; 3], surface.boxes.size());
                false
            }
        }
        question.count_from([0.0; 3], self.boxes.size());
        self.boxes.search(&mut OfAll(self, &mut question));
        question
    }

    /// The point of the surface that is nearest to a place, if it is within so many cells. Of a crease it is that of the side
    /// that sees the place best, so that its normal tells the sign of the distance.
    pub fn closest(&self, from: [f64; 3], within: f64) -> Option<Foot> {
        self.ask(NearestQuery::new(from, within)).best()
    }

    /// The same point, sooner found: `before` is a patch that is likely to be near, as that of a place beside.
    pub(super) fn closest_after(&self, from: [f64; 3], within: f64, before: Place) -> Option<Foot> {
        let mut query = NearestQuery::new(from, within);
        query.begin(&self.piece(before.leaf as usize), before);
        self.ask(query).best()
    }

    /// The normal of the surface around a foot, from all patches that are near: facets of the input turn it by less than the
    /// normal of one crossing. Patches beyond edges do not count.
    pub fn normal_around(&self, at: [f64; 3], normal: [f64; 3]) -> [f64; 3] {
        self.ask(NormalAround::new(at, normal)).around.normal()
    }

    /// Where a ray first passes the surface, going out of the part or into it, if within so many cells. `toward` is a unit
    /// vector. Surfaces that are passed nearly along themselves do not count.
    pub fn ray(&self, from: [f64; 3], toward: [f64; 3], most: f64, outward: bool) -> Option<Foot> {
        self.ask(RayQuery::new(from, toward, most, outward)).first
    }

    /// The radius of the largest ball that touches a place with unit normal `toward` on this side of it, holds no point of the
    /// surface, and is no larger than `most`; with the point that bounds it. Surface whose normal is turned by less than
    /// `apart`, a cosine, against the normal at the place does not count.
    pub fn ball(&self, touch: BallAt, most: f64, apart: f64) -> (f64, Option<Foot>) {
        let ball = self.ask(Ball::new(touch, most, apart));
        (ball.radius, ball.contact)
    }

    /// The largest ball as far as one patch bounds it: what bounds the ball at a place often bounds that of a place beside.
    pub(super) fn ball_before(
        &self,
        touch: BallAt,
        most: f64,
        apart: f64,
        patch: Place,
    ) -> (f64, Option<Foot>) {
        let mut ball = Ball::new(touch, most, apart);
        ball.visit(&self.piece(patch.leaf as usize), patch);
        (ball.radius, ball.contact)
    }

    /// Patches of a leaf: where each is, its normal, and its area, in cells.
    pub fn patches_of(&self, leaf: usize) -> Vec<PatchInfo> {
        let piece = self.piece(leaf);
        let info = |patch: &Patch| PatchInfo {
            at: std::array::from_fn(|a| f64::from(patch.at[a]) + piece.base[a]),
            normal: patch.normal.map(f64::from),
            area: patch.area(piece.rings),
            corners: patch
                .corners(piece.rings)
                .map(|c| std::array::from_fn(|a| ((c[a] + piece.base[a]) * 512.0).round() as i64))
                .collect(),
        };
        piece.patches.iter().map(info).collect()
    }

    /// Fails where there is no surface at all.
    pub(super) fn require_any(&self) -> Result<()> {
        if self.keys.is_empty() {
            return Err(Error::setting("the store has no surface", "build it with finer cells"));
        }
        Ok(())
    }
}

impl PatchInfo {
    /// A place in the solid beside the crossing, in cells.
    pub(super) fn inner(&self) -> [f64; 3] {
        std::array::from_fn(|a| self.at[a] - INNER * self.normal[a])
    }
}

/// A crossing with its patch.
pub struct PatchInfo {
    /// Where it is, in cells.
    pub at: [f64; 3],
    /// The unit normal, outward.
    pub normal: [f64; 3],
    /// The area of its polygon, in square cells.
    pub area: f64,
    /// Corners of its polygon in 512ths of a cell, which tell which patches touch.
    pub corners: Vec<[i64; 3]>,
}
