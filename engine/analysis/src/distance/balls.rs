//! Balls from all crossings of a surface, found by place.

use super::boxes::{Block, Boxes, Lanes, Normals, Probe, Question, block_of};
use super::inscribed::{InscribedBall, Medium};
use super::spilled::{Spill, Spilled};
use super::thickness::PreviousContact;
use crate::error::Result;
use crate::progress::Progress;
use crate::schedule::run_ordered;
use crate::wide::{Simd, f32x8};
use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;

/// By so many cells the surface of balls whose centres are apart may lie within that of all balls between them.
const SAG: f64 = 0.005;
/// Bytes of a ball in a file.
const BALL_BYTES: usize = 33;
/// Balls of pieces that threads make ahead.
const PIECES_AHEAD: usize = 4;

/// The balls of a piece of the surface.
type BallGroup = Vec<InscribedBall>;

/// The balls of all crossings, by pieces of the surface.
pub(super) struct BallTree {
    groups: Spilled<BallGroup>,
    /// The largest radius of each piece.
    largest: Vec<f64>,
    boxes: Boxes,
}

impl BallTree {
    /// Of all crossings, in so many bytes.
    pub fn new(medium: &Medium<'_>, memory: u64, folder: &Path, progress: &dyn Progress) -> Result<BallTree> {
        let leaves = medium.surface.leaves().len();
        progress.phase("balls", Some(leaves as u64), "bricks");
        let mut groups = Spilled::of_about(leaves, memory, folder);
        let (mut largest, mut blocks) = (Vec::new(), Vec::new());
        let make = |_: &mut (), leaf: usize| {
            progress.check()?;
            let mut last = PreviousContact::default();
            let mut balls = Vec::new();
            for patch in medium.surface.patches_of(leaf)? {
                balls.extend(medium.touching((patch.at, patch.normal), &mut last)?);
            }
            Ok(thinned(balls))
        };
        let take = |balls: Vec<InscribedBall>| {
            progress.advance(1);
            largest.push(balls.iter().fold(0.0, |most: f64, ball| most.max(ball.radius)));
            blocks.push(block(&balls));
            groups.push(balls)
        };
        run_ordered(leaves, PIECES_AHEAD * rayon::current_num_threads(), || (), make, take)?;
        let boxes = Boxes::new(blocks.into_iter(), 1);
        Ok(BallTree { groups, largest, boxes })
    }

    /// The largest radius of all.
    pub fn largest(&self) -> f64 {
        self.largest.iter().copied().fold(0.0, f64::max)
    }

    /// Shows the balls of pieces that may reach into a cube about a middle, pieces with larger balls first, while `each` wants
    /// those up to a radius.
    pub fn near(
        &self,
        middle: [f64; 3],
        reach: f64,
        mut each: impl FnMut(f64, &mut dyn FnMut() -> Result<Arc<BallGroup>>) -> Result<()>,
    ) -> Result<()> {
        let probe = Probe::new(middle, self.boxes.size());
        let mut near = Near { probe, within: (reach * reach) as f32, found: Vec::new() };
        self.boxes.search(&mut near)?;
        let mut found = near.found;
        found.sort_by(|&a, &b| self.largest[b].total_cmp(&self.largest[a]).then(a.cmp(&b)));
        found.into_iter().try_for_each(|piece| each(self.largest[piece], &mut || self.groups.get(piece)))
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

    fn visit(&mut self, thing: usize) -> Result<bool> {
        self.found.push(thing);
        Ok(false)
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

impl Spill for BallGroup {
    fn bytes(&self) -> Vec<u8> {
        let mut bytes = Vec::with_capacity(self.len() * BALL_BYTES);
        for InscribedBall { centre, radius, is_flat } in self {
            centre.iter().chain([radius]).for_each(|number| bytes.extend(number.to_le_bytes()));
            bytes.push(u8::from(*is_flat));
        }
        bytes
    }

    fn of_bytes(bytes: &[u8]) -> Option<BallGroup> {
        let ball = |bytes: &[u8; BALL_BYTES]| {
            let number = |n: usize| f64::from_le_bytes(std::array::from_fn(|b| bytes[8 * n + b]));
            let centre = [0, 1, 2].map(number);
            InscribedBall { centre, radius: number(3), is_flat: bytes[32] != 0 }
        };
        let (balls, rest) = bytes.as_chunks::<BALL_BYTES>();
        rest.is_empty().then(|| balls.iter().map(ball).collect())
    }

    fn heap_bytes(&self) -> usize {
        self.len() * size_of::<InscribedBall>()
    }
}
