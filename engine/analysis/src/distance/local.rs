//! Local thickness as a tree: at each sample the diameter of the largest ball inside that holds it (Hildebrand & Rüegsegger 1997).
//!
//! Balls of all crossings are painted brick by brick, and the largest wins, so that order tells nothing. Samples next to the
//! surface, between what balls of crossings reach, ask for the ball of their own foot. Where balls grow along the medial axis,
//! the one that was painted climbs as far as it holds the sample.

use super::balls::BallTree;
use super::inscribed::{INTO, INTO_PART, InscribedBall, MISS, Medium};
use super::level_nodes::LevelNodes;
use super::sides::{DeepBrick, Sides};
use super::surface::Surface;
use super::tally::{LocalSpread, LocalTally};
use super::thickness::{PreviousContact, farthest};
use crate::brick::{Brick, POINTS, Samples, point_position};
use crate::error::Result;
use crate::lattice::{BRICK_CELLS, BRICK_POINTS, NodeKey, RootCube, length, minus};
use crate::progress::Progress;
use crate::store::{BrickTree, NodeInfo};
use std::path::Path;
use std::sync::{Arc, Mutex, PoisonError};

/// Samples so near to the surface, in cells, ask for the ball of their foot.
const NEAR: f64 = 0.35;
/// A ball that holds a sample by more cells than this cannot grow by much before it loses it.
const DEEP: f64 = 3.0;
/// Samples along the edge of a block, whose least is known.
const BLOCK: usize = 4;
const BLOCKS: usize = BRICK_POINTS.div_ceil(BLOCK);
/// The most binary places of diameters.
const MOST_PLACES: u8 = 12;

/// What local thickness is told of.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum LocalOf {
    /// The solid.
    Walls,
    /// What is outside, as far as balls are not wider than this in world units: what is wider has the number 0.
    Gaps(f64),
}

/// Local thickness at the samples of one level; 0 in what is not measured. The unit is the level's spacing. Bricks are made when
/// they are asked for.
pub struct LocalThickness<'a> {
    tree: &'a dyn BrickTree,
    medium: Medium<'a>,
    balls: BallTree,
    level: u8,
    /// Cells of the deepest level between two samples.
    step: f64,
    places: u8,
    nodes: LevelNodes,
    tally: Mutex<LocalTally>,
}

impl<'a> LocalThickness<'a> {
    /// Of a tree and its surface, at a level, with balls in so many bytes of memory and a file in `folder` for what does not fit.
    ///
    /// # Errors
    /// [`crate::error::Error::Setting`] if there is no surface or no such level; what reading gives;
    /// [`crate::error::Error::Interrupted`].
    pub fn new(
        (tree, surface): (&'a dyn BrickTree, &'a Surface),
        of: LocalOf,
        level: u8,
        (memory, folder): (u64, &Path),
        progress: &dyn Progress,
    ) -> Result<LocalThickness<'a>> {
        surface.require_any()?;
        let nodes = LevelNodes::new(tree, level)?;
        let (gaps, most) = match of {
            LocalOf::Walls => (false, farthest(surface)),
            LocalOf::Gaps(widest) => (true, 0.5 * widest / surface.cell()),
        };
        let medium = Medium { surface, sides: Sides::new(tree)?, gaps, most };
        let balls = BallTree::new(&medium, memory, folder, progress)?;
        let step = f64::from(1u32 << (tree.deepest_level() - level));
        // Climbing makes balls larger, but not by much.
        let widest = (2.0 * (1.05 * balls.largest() + 2.0)).min(2.0 * most) / step;
        let places = (0..=MOST_PLACES).rev().find(|&p| widest * f64::from(1u32 << p) < f64::from(i16::MAX));
        let places = places.unwrap_or(0);
        let tally = Mutex::new(LocalTally::default());
        let mut made = LocalThickness { tree, medium, balls, level, step, places, nodes, tally };
        made.nodes = made.nodes.divided(progress, &|key| Ok((0, i16::from(!made.is_empty(key)))))?;
        Ok(made)
    }

    /// Whether nothing of a node is measured, as its leaf tells.
    fn is_empty(&self, key: NodeKey) -> bool {
        let mut at = Some(key);
        while let Some(key) = at {
            match self.tree.node(key) {
                Some(node) => {
                    let is_outer = |w| (w >= 1) == self.medium.gaps;
                    return node.leaf && node.uniform().is_some_and(is_outer);
                }
                None => at = key.parent(),
            }
        }
        true
    }

    /// How thicknesses are spread, after all bricks were asked for.
    ///
    /// # Errors
    /// What making bricks gives that nobody asked for.
    pub fn spread(&self) -> Result<LocalSpread> {
        for (key, node) in self.nodes.each() {
            let is_known = || self.tally.lock().unwrap_or_else(PoisonError::into_inner).knows(key);
            if node.leaf && node.uniform().is_none() && !is_known() {
                self.brick(key)?;
            }
        }
        let unit = self.step * self.medium.surface.cell() / f64::from(1u32 << self.places);
        Ok(self.tally.lock().unwrap_or_else(PoisonError::into_inner).spread(unit, self.medium.surface.cell()))
    }

    /// Which samples of a brick are measured.
    fn measured(&self, first: [f64; 3]) -> Result<Vec<bool>> {
        let medium = &self.medium;
        let place = |n: usize| -> [f64; 3] {
            let ijk = point_position(n);
            std::array::from_fn(|a| first[a] + ijk[a] as f64 * self.step)
        };
        if self.step == 1.0 {
            match medium.sides.part(first.map(|c| c as i64))? {
                DeepBrick::All(inside) => return Ok(vec![inside != medium.gaps; POINTS]),
                DeepBrick::Samples(brick) => {
                    let signs = brick.signs();
                    let is_inside = |n: usize| signs.is_inside(point_position(n));
                    return Ok((0..POINTS).map(|n| is_inside(n) != medium.gaps).collect());
                }
                DeepBrick::Unknown => {}
            }
        }
        let inside = |n: usize| {
            let at = place(n);
            let inside = match medium.sides.sample(at.map(|c| c as i64))? {
                Some(inside) => inside,
                None => medium.surface.closest(at, f64::INFINITY).is_some_and(|foot| foot.inside),
            };
            Ok(inside != medium.gaps)
        };
        (0..POINTS).map(inside).collect()
    }

    /// The radius at a sample, given the ball that was painted there.
    fn radius(&self, at: [f64; 3], painted: Option<InscribedBall>) -> Result<f64> {
        let medium = &self.medium;
        let mut best = painted;
        if let Some(foot) = medium.surface.closest(at, NEAR) {
            let mut take = |ball: Option<InscribedBall>| {
                if let Some(ball) =
                    ball.filter(|ball| length(minus(ball.centre, at)) <= ball.radius + slack(ball.radius))
                    && best.is_none_or(|best| ball.radius > best.radius)
                {
                    best = Some(ball);
                }
            };
            take(medium.touching((foot.at, foot.normal), &mut PreviousContact::default())?);
            take(Some(InscribedBall { centre: at, radius: foot.distance, is_flat: false }));
        }
        let Some(ball) = best.map_or_else(|| medium.ball_at(at, f64::INFINITY), |ball| Ok(Some(ball)))?
        else {
            return Ok(0.0);
        };
        let spare = ball.radius - length(minus(ball.centre, at));
        if ball.is_flat || spare > DEEP {
            return Ok(ball.radius);
        }
        Ok(medium.climbed(ball, Some(at))?.radius)
    }

    fn samples(&self, key: NodeKey) -> Result<Samples> {
        let first = key.position().map(|p| f64::from(p) * BRICK_CELLS as f64 * self.step);
        let canvas = BallCanvas::painted(self, first)?;
        let one = f64::from(1u32 << self.places) / self.step;
        let most = self.medium.most;
        let mut samples = Samples::fractions(self.places);
        for n in (0..POINTS).filter(|&n| canvas.radius[n] < f32::INFINITY) {
            let ball = canvas.which[n].checked_sub(1).map(|which| canvas.balls[which as usize]);
            let radius = self.radius(canvas.place(n), ball)?;
            if self.medium.gaps && radius >= most - MISS {
                continue;
            }
            // What is measured is not 0.
            samples.0[n] = (2.0 * radius * one).round().clamp(1.0, f64::from(i16::MAX)) as i16;
        }
        let mut tally = self.tally.lock().unwrap_or_else(PoisonError::into_inner);
        tally.add(key, &samples);
        Ok(samples)
    }
}

/// What a ball may lack at the foot that it touches.
fn slack(radius: f64) -> f64 {
    MISS + INTO + INTO_PART * radius
}

/// The largest ball so far at each sample of a brick.
struct BallCanvas {
    first: [f64; 3],
    step: f64,
    /// Its radius; infinite where nothing is measured.
    radius: Vec<f32>,
    /// Its number among those seen, counted from 1.
    which: Vec<u32>,
    balls: Vec<InscribedBall>,
    /// The least radius of each block, and of all.
    least: Vec<f32>,
    least_of_all: f32,
}

impl BallCanvas {
    fn painted(local: &LocalThickness<'_>, first: [f64; 3]) -> Result<BallCanvas> {
        let measured = local.measured(first)?;
        let start = |&is: &bool| if is { 0.0 } else { f32::INFINITY };
        let mut canvas = BallCanvas {
            first,
            step: local.step,
            radius: measured.iter().map(start).collect(),
            which: vec![0; POINTS],
            balls: Vec::new(),
            least: vec![0.0; BLOCKS.pow(3)],
            least_of_all: 0.0,
        };
        if !measured.contains(&true) {
            return Ok(canvas);
        }
        let half = 0.5 * BRICK_CELLS as f64 * local.step;
        let middle = first.map(|c| c + half);
        local.balls.near(middle, half * 3f64.sqrt() + MISS, |largest, balls| {
            if largest > f64::from(canvas.least_of_all) {
                balls.for_each(|ball| canvas.paint(&ball));
            }
        });
        Ok(canvas)
    }

    fn place(&self, n: usize) -> [f64; 3] {
        let ijk = point_position(n);
        std::array::from_fn(|a| self.first[a] + ijk[a] as f64 * self.step)
    }

    fn paint(&mut self, ball: &InscribedBall) {
        let radius = ball.radius as f32;
        if radius <= self.least_of_all {
            return;
        }
        // In steps from the first sample.
        let centre: [f64; 3] = std::array::from_fn(|a| (ball.centre[a] - self.first[a]) / self.step);
        let reach = (ball.radius + MISS) / self.step;
        let last = (BRICK_POINTS - 1) as f64;
        if (0..3).any(|a| centre[a] + reach < 0.0 || centre[a] - reach > last) {
            return;
        }
        let low = centre.map(|c| (c - reach).clamp(0.0, last).ceil() as usize / BLOCK);
        let high = centre.map(|c| (c + reach).clamp(0.0, last) as usize / BLOCK);
        let (mut seen, mut changed) = (0, false);
        for z in low[2]..=high[2] {
            for y in low[1]..=high[1] {
                for x in low[0]..=high[0] {
                    if self.least[x + BLOCKS * (y + BLOCKS * z)] < radius {
                        changed |=
                            self.paint_block([x, y, z], (centre, reach * reach, radius), (ball, &mut seen));
                    }
                }
            }
        }
        if changed {
            self.least_of_all = self.least.iter().copied().fold(f32::INFINITY, f32::min);
        }
    }

    /// Whether the least of the block has changed.
    fn paint_block(
        &mut self,
        block: [usize; 3],
        (centre, square, radius): ([f64; 3], f64, f32),
        (ball, seen): (&InscribedBall, &mut u32),
    ) -> bool {
        let ends = |a: usize| block[a] * BLOCK..((block[a] + 1) * BLOCK).min(BRICK_POINTS);
        // The nearest place of the block.
        let beside = |a: usize| {
            let (low, high) = (ends(a).start as f64, (ends(a).end - 1) as f64);
            (low - centre[a]).max(centre[a] - high).max(0.0)
        };
        if (0..3).map(|a| beside(a) * beside(a)).sum::<f64>() > square {
            return false;
        }
        let mut least = f32::INFINITY;
        for k in ends(2) {
            for j in ends(1) {
                let away = (j as f64 - centre[1]).powi(2) + (k as f64 - centre[2]).powi(2);
                let row = BRICK_POINTS * (j + BRICK_POINTS * k);
                for i in ends(0) {
                    let held = &mut self.radius[row + i];
                    if *held < radius && away + (i as f64 - centre[0]).powi(2) <= square {
                        *held = radius;
                        if *seen == 0 {
                            self.balls.push(*ball);
                            *seen = self.balls.len() as u32;
                        }
                        self.which[row + i] = *seen;
                    }
                    least = least.min(*held);
                }
            }
        }
        let known = &mut self.least[block[0] + BLOCKS * (block[1] + BLOCKS * block[2])];
        std::mem::replace(known, least) != least
    }
}

impl BrickTree for LocalThickness<'_> {
    fn root(&self) -> RootCube {
        self.medium.surface.root()
    }

    fn node(&self, key: NodeKey) -> Option<NodeInfo> {
        self.nodes.node(key)
    }

    fn keys(&self) -> Vec<NodeKey> {
        self.nodes.keys()
    }

    fn deepest_level(&self) -> u8 {
        self.level
    }

    fn brick(&self, key: NodeKey) -> Result<Arc<Brick>> {
        self.nodes.brick(key, self.places, || self.samples(key))
    }
}
