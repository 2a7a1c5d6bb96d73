//! Balls from all crossings of a surface, found by place.

use super::boxes::{Block, Boxes, Lanes, Normals, Probe, Question, block_of};
use super::inscribed::{InscribedBall, Medium};
use super::thickness::PreviousContact;
use crate::error::Result;
use crate::large_array::{ArrayRoom, LargeArray};
use crate::progress::Progress;
use crate::schedule::run_ordered;
use crate::wide::{Simd, f32x8};
use bytemuck::{Pod, Zeroable};
use std::collections::BTreeMap;
use std::path::Path;

/// By so many cells the surface of balls whose centres are apart may lie within that of all balls between them.
const SAG: f64 = 0.005;
/// Balls of pieces that threads make ahead.
const PIECES_AHEAD: usize = 4;

/// A ball as it may lie in a file.
#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C)]
struct StoredBall {
    centre: [f64; 3],
    radius: f64,
    is_flat: u64,
}

impl StoredBall {
    fn of(InscribedBall { centre, radius, is_flat }: InscribedBall) -> StoredBall {
        StoredBall { centre, radius, is_flat: u64::from(is_flat) }
    }

    fn ball(self) -> InscribedBall {
        InscribedBall { centre: self.centre, radius: self.radius, is_flat: self.is_flat != 0 }
    }
}

/// The balls of all crossings, by pieces of the surface.
pub(super) struct BallTree {
    balls: LargeArray<StoredBall>,
    /// Where those of each piece end, and the largest radius of them.
    pieces: Vec<(usize, f64)>,
    boxes: Boxes,
}

impl BallTree {
    /// Of all crossings, in so many bytes, with a mapped file in `folder` for what does not fit.
    pub fn new(medium: &Medium<'_>, memory: u64, folder: &Path, progress: &dyn Progress) -> Result<BallTree> {
        let leaves = medium.surface.leaves().len();
        progress.phase("balls", Some(leaves as u64), "bricks");
        let mut all = LargeArray::new(&ArrayRoom::new(memory, folder));
        let (mut pieces, mut blocks) = (Vec::new(), Vec::new());
        let make = |_: &mut (), leaf: usize| {
            progress.check()?;
            let mut last = PreviousContact::default();
            let mut balls = Vec::new();
            for patch in medium.surface.patches_of(leaf) {
                balls.extend(medium.touching((patch.at, patch.normal), &mut last)?);
            }
            Ok(thinned(balls))
        };
        let take = |balls: Vec<InscribedBall>| {
            progress.advance(1);
            let largest = balls.iter().fold(0.0, |most: f64, ball| most.max(ball.radius));
            blocks.push(block(&balls));
            all.extend_from_slice(&balls.into_iter().map(StoredBall::of).collect::<Vec<_>>())?;
            pieces.push((all.len(), largest));
            Ok(())
        };
        run_ordered(leaves, PIECES_AHEAD * rayon::current_num_threads(), || (), make, take)?;
        let boxes = Boxes::new(blocks.into_iter(), 1);
        Ok(BallTree { balls: all, pieces, boxes })
    }

    /// The largest radius of all.
    pub fn largest(&self) -> f64 {
        self.pieces.iter().fold(0.0, |most, (_, largest)| most.max(*largest))
    }

    /// Shows the balls of pieces that may reach into a cube about a middle, pieces with larger balls first, while `each` wants
    /// those up to a radius.
    pub fn near(
        &self,
        middle: [f64; 3],
        reach: f64,
        mut each: impl FnMut(f64, &mut dyn Iterator<Item = InscribedBall>),
    ) {
        let probe = Probe::new(middle, self.boxes.size());
        let mut near = Near { probe, within: (reach * reach) as f32, found: Vec::new() };
        self.boxes.search(&mut near);
        let mut found = near.found;
        let largest = |piece: usize| self.pieces[piece].1;
        found.sort_by(|&a, &b| largest(b).total_cmp(&largest(a)).then(a.cmp(&b)));
        for piece in found {
            let first = if piece > 0 { self.pieces[piece - 1].0 } else { 0 };
            let balls = &self.balls[first..self.pieces[piece].0];
            each(largest(piece), &mut balls.iter().map(|ball| ball.ball()));
        }
    }
}

/// Pieces near a place.
struct Near {
    probe: Probe,
    within: f32,
    found: Vec<usize>,
}

impl Question for Near {
    #[inline(always)]
    fn nearness<S: Simd>(&self, simd: S, boxes: &Lanes, _: Option<&Normals>) -> f32x8<S> {
        boxes.squared_from(simd, &self.probe, self.within)
    }

    fn counts(&self, _: f32) -> bool {
        true
    }

    fn visit(&mut self, thing: usize) -> bool {
        self.found.push(thing);
        false
    }
}

fn block(balls: &[InscribedBall]) -> Block {
    let ends =
        balls.iter().flat_map(|ball| [-1.0, 1.0].map(|sign| ball.centre.map(|c| c + sign * ball.radius)));
    block_of(ends, 1e-3)
}

/// Without balls so near to larger ones that these stand for them: centres apart by h leave what is h² / (8 r) deep.
fn thinned(balls: Vec<InscribedBall>) -> Vec<InscribedBall> {
    let mut kept: BTreeMap<(i32, [i64; 3]), InscribedBall> = BTreeMap::new();
    for ball in balls {
        let size = ball.radius.max(0.01).log2().floor();
        let pitch = (8.0 * size.exp2() * SAG / 3.0).sqrt();
        let key = (size as i32, ball.centre.map(|c| (c / pitch).floor() as i64));
        let stands = kept.entry(key).or_insert(ball);
        if ball.radius > stands.radius {
            *stands = ball;
        }
    }
    kept.into_values().rev().collect()
}
