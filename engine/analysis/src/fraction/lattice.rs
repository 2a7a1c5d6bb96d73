//! A coarse lattice with the fraction of solid around each sample, brick by brick.

use super::kernel::{BEFORE, depth};
use super::leaf::{SumBox, blocks};
use super::sharp::{self, LeafPlanes, OpenSharp, Sharp, planes};
use crate::brick::{HermiteEdge, SignChanges};
use crate::error::{Error, Result};
use crate::lattice::{Axis, BRICK_CELLS, MAX_LEVEL, NodeKey, Octant, RootCube};
use crate::progress::Progress;
use crate::store::{BrickTree, Leaf, LeafOrder, visit};
use std::collections::{BTreeMap, BTreeSet};
use std::sync::atomic::{AtomicBool, Ordering};

/// Samples of a brick without an apron.
const OWN: usize = BRICK_CELLS * BRICK_CELLS * BRICK_CELLS;
/// The greatest fraction as stored: all solid.
pub(super) const FULL: u16 = u16::MAX;
/// The share of samples beside the surface at which planes agree, of a part with sharp edges.
const LEAST_AGREEING: f64 = 0.5;
/// Where planes agree at a smaller share than this of the first samples, they are not looked for any more.
const HOPELESS: f64 = 0.4;
/// After so many leaves they are asked again.
const CHECKED: usize = 256;
/// So many samples tell that.
const TELLING: u64 = 20_000;
/// Sums that are as near to none or all as this are that, and rounding.
const ROUNDING: f64 = 1e-9;

/// One brick of 32³ coarse samples.
pub(super) enum CoarseBrick {
    /// Leaves may still add to it.
    Open(Box<[f64]>),
    /// Solid throughout.
    Full,
    Mixed(Box<[u16]>),
}

/// The fractions of solid around the samples of a coarse lattice.
///
/// A fraction is the mean over a tent: it weighs what is at the sample most, and what is a coarse cell away along any axis
/// not at all. The sum of all is the solid's volume.
pub struct Lattice {
    /// How many of the finest cells an axis lie between two samples.
    factor: u32,
    /// The coarse lattice as the root of a tree.
    root: RootCube,
    /// The level of its bricks.
    pub(super) level: u8,
    /// Half of the width of its tents, in samples.
    pub(super) width: u32,
    /// Samples before the tree's first one.
    before: i64,
    /// Bricks that are not empty.
    pub(super) bricks: BTreeMap<NodeKey, CoarseBrick>,
    /// By the code of the last leaf that may add to them, bricks that are open.
    open: BTreeSet<(u64, NodeKey)>,
    /// By position, what is known of planes in bricks that are open.
    open_sharp: BTreeMap<[i64; 3], OpenSharp>,
    /// Bricks with samples that are the part's.
    sharp: BTreeMap<NodeKey, Sharp>,
    /// Sum of all fractions.
    sum: f64,
    /// By fraction as stored, [`depth`].
    depths: Box<[f32]>,
    /// At how many samples planes of the fine level agree, and at how many they do not.
    agreeing: [u64; 2],
    /// By fraction as stored, how many of the samples at which planes agree have it.
    exact_counts: Box<[u64]>,
    /// Whether planes are not looked for any more.
    is_rounded: bool,
    /// By fraction as stored, how many of the others have it.
    pub(super) counts: Box<[u64]>,
}

impl Lattice {
    /// An empty one over a tree, with room for tents that are so many samples wide.
    fn new(tree: &dyn BrickTree, finest: u8, factor: u32, width: u32) -> Result<Lattice> {
        let fine = tree.root().spacing(finest);
        let cell = fine * f64::from(factor);
        let before = BEFORE + i64::from(width) - 1;
        let samples = ((BRICK_CELLS as u64) << finest).div_ceil(u64::from(factor)) as i64 + 2 * before;
        let fits = |level: &u8| (BRICK_CELLS as i64) << level > samples;
        let level = (0..=MAX_LEVEL)
            .find(fits)
            .ok_or_else(|| Error::setting("cells are too many", "choose larger ones"))?;
        let edge = cell * BRICK_CELLS as f64 * f64::from(1u32 << level);
        // Sample 0 of both lattices stands one unit of its own root above the corner.
        let first = tree.root().to_world([1.0; 3]);
        let unit = RootCube { origin: [0.0; 3], edge }.unit();
        let origin = first.map(|c| c - before as f64 * cell - unit);
        let depths = (0..=u16::MAX).map(|f| depth(f64::from(f) / f64::from(FULL)) as f32).collect();
        let root = RootCube { origin, edge };
        let counts: Box<[u64]> = vec![0; usize::from(FULL) + 1].into();
        Ok(Lattice {
            factor,
            root,
            level,
            width: 1,
            before,
            bricks: BTreeMap::new(),
            open: BTreeSet::new(),
            open_sharp: BTreeMap::new(),
            sharp: BTreeMap::new(),
            sum: 0.0,
            agreeing: [0; 2],
            exact_counts: counts.clone(),
            // What is sharp is known of cells as wide as tents.
            is_rounded: width > 1,
            depths,
            counts,
        })
    }

    /// How many of the finest cells an axis are one coarse cell.
    pub fn factor(&self) -> u32 {
        self.factor * self.width
    }

    /// Edge of a coarse cell in the tree's unit: what is narrower is averaged away.
    pub fn cell(&self) -> f64 {
        self.spacing() * f64::from(self.width)
    }

    /// Samples in one coarse cell, along an axis.
    pub fn samples_per_cell(&self) -> u32 {
        self.width
    }

    /// Distance of two samples in the tree's unit.
    fn spacing(&self) -> f64 {
        self.root.spacing(self.level)
    }

    /// The volume of solid, by chords between exact crossings, in the cube of the tree's unit.
    pub fn volume(&self) -> f64 {
        self.sum * self.spacing().powi(3)
    }

    /// The coarse lattice as the root of a tree.
    pub(super) fn root(&self) -> RootCube {
        self.root
    }

    /// Keys of bricks whose fractions are neither all 0 nor all 1.
    pub(super) fn mixed(&self) -> impl Iterator<Item = NodeKey> {
        self.bricks.iter().filter(|(_, brick)| matches!(brick, CoarseBrick::Mixed(_))).map(|(key, _)| *key)
    }

    /// Whether the first sample of a brick is all solid.
    pub(super) fn is_full(&self, key: NodeKey) -> bool {
        matches!(self.bricks.get(&key), Some(CoarseBrick::Full))
    }

    /// The depths of a box of samples of (32 + 1 + 2)³, from the one before the first of a brick to the one behind its apron.
    pub(super) fn depths_around(&self, key: NodeKey) -> Vec<f32> {
        const N: usize = super::tree::AROUND;
        let mut depths = vec![-1.0; N * N * N];
        self.for_around(key, (1, N), |place, fractions| {
            let row = depths[place..].iter_mut().zip(fractions);
            row.for_each(|(depth, &fraction)| *depth = self.depths[usize::from(fraction)]);
        });
        depths
    }

    /// Calls with place and fractions as stored, of rows of samples in bricks that are not empty: those of a box, `size` of them
    /// an axis, that begins `before` samples before the first of a brick. The box ends in one of the bricks around.
    pub(super) fn for_around(
        &self,
        key: NodeKey,
        (before, size): (usize, usize),
        mut found: impl FnMut(usize, &[u16]),
    ) {
        for d in (0..27).map(|n| [n % 3 - 1, n / 3 % 3 - 1, n / 9 - 1]) {
            let Some(brick) = key.neighbour(d).and_then(|key| self.bricks.get(&key)) else { continue };
            let cells = BRICK_CELLS as i32;
            // Where this brick begins in the box, and which of its samples lie there.
            let start = d.map(|d| before as i32 + d * cells);
            let [xs, ys, zs] =
                start.map(|start| (-start).max(0) as usize..(size as i32 - start).min(cells) as usize);
            let at = |a: usize, n: usize| (start[a] + n as i32) as usize;
            for (k, j) in zs.flat_map(|k| ys.clone().map(move |j| (k, j))) {
                let row = match brick {
                    CoarseBrick::Mixed(fractions) => &fractions[(k * BRICK_CELLS + j) * BRICK_CELLS..],
                    _ => &[FULL; BRICK_CELLS],
                };
                found((at(2, k) * size + at(1, j)) * size + at(0, xs.start), &row[xs.clone()]);
            }
        }
    }

    /// Whether planes agree at so many samples that those are the part's, as of CAD parts. Beads have some flat faces as well;
    /// these would lie beside what moves with the level.
    fn is_sharp(&self) -> bool {
        let [agreeing, others] = self.agreeing;
        !self.is_rounded && agreeing as f64 >= LEAST_AGREEING * (agreeing + others) as f64
    }

    /// Forgets planes where they are hopeless: of beads they would take most of the time and of the memory.
    fn round_if_hopeless(&mut self) {
        // Planes that do not agree never will; of others in open bricks that is not known yet.
        let of_all = |n: usize| self.open_sharp.values().map(|open| open.agreeing()[n]).sum::<u64>();
        let [agreeing, others] = [0, 1].map(|n| self.agreeing[n] + of_all(n));
        let known = agreeing + others;
        if known >= TELLING && (agreeing as f64) < HOPELESS * known as f64 {
            self.round();
        }
    }

    fn round(&mut self) {
        self.is_rounded = true;
        self.open_sharp.clear();
        self.sharp.clear();
    }

    /// Gives samples that are the part's their sides, of a brick and its apron.
    pub(super) fn sharpen(&self, key: NodeKey, signs: &mut SignChanges) {
        for octant in Octant::all() {
            let ahead = octant.offset();
            let Some(sharp) = self.sharp_ahead(key, ahead) else { continue };
            let range = |a: usize| if ahead[a] == 1 { BRICK_CELLS..BRICK_CELLS + 1 } else { 0..BRICK_CELLS };
            for (k, j) in range(2).flat_map(|k| range(1).map(move |j| (k, j))) {
                let [exact, inside] =
                    sharp.row(j % BRICK_CELLS, k % BRICK_CELLS).map(|bits| match ahead[0] {
                        1 => u64::from(bits & 1) << BRICK_CELLS,
                        _ => u64::from(bits),
                    });
                signs.set_row(j, k, signs.row(j, k) & !exact | inside);
            }
        }
    }

    /// The part's crossing of an edge of a brick, if both ends are the part's and it has one.
    pub(super) fn crossing(&self, key: NodeKey, axis: Axis, low: [usize; 3]) -> Option<HermiteEdge> {
        let mut high = low;
        high[axis.index()] += 1;
        let at = |ijk: [usize; 3]| {
            let within = ijk.map(|c| c % BRICK_CELLS);
            self.sharp_ahead(key, ijk.map(|c| c / BRICK_CELLS)).map(|sharp| (sharp, within))
        };
        let is_exact = |(sharp, [i, j, k]): (&Sharp, [usize; 3])| sharp.is_exact((k << 5 | j) << 5 | i);
        at(high).filter(|found| is_exact(*found))?;
        let (sharp, within) = at(low).filter(|found| is_exact(*found))?;
        sharp.crossing(axis, within)
    }

    /// Of the brick that lies so many bricks ahead along each axis.
    fn sharp_ahead(&self, key: NodeKey, ahead: [usize; 3]) -> Option<&Sharp> {
        if !self.is_sharp() {
            return None;
        }
        key.neighbour(ahead.map(|c| c as i32)).and_then(|key| self.sharp.get(&key))
    }

    /// About the volume within the surface at a depth, in the cube of the tree's unit: each sample stands for a cell, or for
    /// part of one at the surface.
    pub(super) fn volume_within(&self, at: f64) -> f64 {
        let samples = f64::from(self.width);
        let sum = |counts: &[u64], at: f64| {
            let parts = self.depths.iter().zip(counts);
            parts.map(|(&depth, &count)| part(depth, at, samples) * count as f64).sum::<f64>()
        };
        let exact = sum(&self.exact_counts, if self.is_sharp() { 0.0 } else { at });
        (sum(&self.counts, at) + exact) * self.spacing().powi(3)
    }

    /// Heap bytes of all bricks.
    pub(super) fn bytes(&self) -> u64 {
        let mixed = self.mixed().count() as u64;
        let open_sharp = self.open_sharp.values().map(OpenSharp::bytes).sum::<u64>();
        let sharp = self.sharp.values().map(Sharp::bytes).sum::<u64>();
        (mixed * 2 + self.open.len() as u64 * 8) * OWN as u64 + open_sharp + sharp
    }

    /// Adds what a leaf adds.
    fn add(&mut self, block: &SumBox, finest: u8) {
        let first = block.first.map(|c| c + self.before);
        let last: [i64; 3] = std::array::from_fn(|a| first[a] + block.size[a] as i64 - 1);
        let bricks = |a: usize| first[a] >> 5..=last[a] >> 5;
        for (p, q, r) in
            bricks(2).flat_map(|r| bricks(1).flat_map(move |q| bricks(0).map(move |p| (p, q, r))))
        {
            let Some(key) = NodeKey::new(self.level, [p as u32, q as u32, r as u32]) else { continue };
            let mut part = part_of(block, first, [p, q, r].map(|c| c << 5)).peekable();
            if part.peek().is_none() {
                continue;
            }
            let done = last_leaf(key, self.before, (finest, self.factor));
            let open = &mut self.open;
            let brick = self.bricks.entry(key).or_insert_with(|| {
                open.insert((done, key));
                CoarseBrick::Open(vec![0.0; OWN].into())
            });
            if let CoarseBrick::Open(sums) = brick {
                part.for_each(|(place, sum)| sums[place] += sum);
            }
        }
    }

    /// Completes the bricks to which no leaf behind the one with this code adds.
    fn complete(&mut self, code: u64) {
        while let Some(&(done, key)) = self.open.first()
            && done <= code
        {
            self.open.remove(&(done, key));
            let Some(CoarseBrick::Open(sums)) = self.bricks.remove(&key) else { continue };
            self.sum += sums.iter().sum::<f64>();
            let fractions: Box<[u16]> = sums.iter().map(|&sum| stored(sum)).collect();
            let position = key.position().map(i64::from);
            let sharp = self.open_sharp.remove(&position).and_then(|open| {
                let agreeing = open.agreeing();
                self.agreeing = [0, 1].map(|n| self.agreeing[n] + agreeing[n]);
                open.complete()
            });
            for (place, &f) in fractions.iter().enumerate() {
                let is_exact = sharp.as_ref().is_some_and(|sharp| sharp.is_exact(place));
                let counts = if is_exact { &mut self.exact_counts } else { &mut self.counts };
                counts[usize::from(f)] += 1;
            }
            if fractions.iter().all(|&f| f == FULL) {
                self.bricks.insert(key, CoarseBrick::Full);
            } else if fractions.iter().any(|&f| f > 0) {
                self.bricks.insert(key, CoarseBrick::Mixed(fractions));
                self.sharp.extend(sharp.map(|sharp| (key, sharp)));
            }
        }
    }
}

/// About what a sample of some depth stands for, in distances of samples cubed, within the surface at another. Depths are in
/// cells of so many samples.
fn part(depth: f32, at: f64, samples: f64) -> f64 {
    ((f64::from(depth) - at) * samples + 0.5).clamp(0.0, 1.0)
}

/// A fraction as stored: none and all are kept apart from what is nearly so.
fn stored(sum: f64) -> u16 {
    if sum < ROUNDING {
        0
    } else if sum > 1.0 - ROUNDING {
        FULL
    } else {
        (sum * f64::from(FULL)).round().clamp(1.0, f64::from(FULL - 1)) as u16
    }
}

/// The sums above 0 of a block in the brick whose first sample is `base`, by place there.
fn part_of(block: &SumBox, first: [i64; 3], base: [i64; 3]) -> impl Iterator<Item = (usize, f64)> {
    let range = move |a: usize| {
        let end = (first[a] + block.size[a] as i64).min(base[a] + BRICK_CELLS as i64);
        first[a].max(base[a])..end
    };
    let rows = range(2).flat_map(move |z| range(1).map(move |y| (y, z)));
    rows.flat_map(move |(y, z)| {
        let row = ((z - first[2]) as usize * block.size[1] + (y - first[1]) as usize) * block.size[0];
        let own = ((z - base[2]) as usize * BRICK_CELLS + (y - base[1]) as usize) * BRICK_CELLS;
        range(0).map(move |x| (own + (x - base[0]) as usize, block.sums[row + (x - first[0]) as usize]))
    })
    .filter(|(_, sum)| *sum > 1e-14)
}

/// The code of the last leaf, in Morton order, that may add to a brick: the one at the upper end of what its tents reach.
fn last_leaf(key: NodeKey, before: i64, (finest, factor): (u8, u32)) -> u64 {
    let most = ((BRICK_CELLS as i64) << finest) - 1;
    let upper = key.position().map(|p| {
        let last = (i64::from(p) + 1) * BRICK_CELLS as i64 - 1 - before;
        ((last + 1) * i64::from(factor) - 1).clamp(0, most)
    });
    let bits = crate::lattice::spacing_bits(finest);
    NodeKey::deepest_at(upper.map(|c| (c << bits) as i32)).map_or(u64::MAX, |key| key.post_order().0)
}

/// The widest cells, in the finest, of a lattice from which those of all factors are summed.
fn base_of(factors: &[u32]) -> u32 {
    let divides = |base: &u32| factors.iter().all(|factor| factor.is_multiple_of(*base));
    [8, 4, 2].into_iter().find(divides).unwrap_or(1)
}

/// Lattices of the solid of `tree`, where w ≥ 0.5, whose cells are so many of the finest ones an axis. Reads every leaf that
/// is not uniform once. At most `memory` bytes are held.
///
/// # Errors
/// [`Error::Setting`] if the lattices do not fit the memory; what reading the tree gives; [`Error::Interrupted`].
pub fn fractions(
    tree: &dyn BrickTree,
    factors: &[u32],
    memory: u64,
    progress: &dyn Progress,
) -> Result<Vec<Lattice>> {
    let finest = tree.deepest_level();
    let new = |&factor: &u32| Lattice::new(tree, finest, factor, 1);
    let mut lattices = factors.iter().map(new).collect::<Result<Vec<_>>>()?;
    fill(&mut lattices, tree, memory, progress)?;
    Ok(lattices)
}

/// A lattice with cells of `factor` of the finest ones an axis and so many `samples` in each, which divide `factor`: its
/// surface is smooth over a cell, as that of a lattice with one sample each, and better sampled. Sharp edges are rounded.
///
/// # Errors
/// As [`fractions`].
pub fn fine_fractions(
    tree: &dyn BrickTree,
    (factor, samples): (u32, u32),
    memory: u64,
    progress: &dyn Progress,
) -> Result<Lattice> {
    let mut lattices = [Lattice::new(tree, tree.deepest_level(), factor / samples, samples)?];
    // Those of narrow tents and those of wide ones are held together, if they differ.
    fill(&mut lattices, tree, if samples > 1 { memory / 2 } else { memory }, progress)?;
    let [lattice] = lattices;
    Ok(if samples > 1 { lattice.widened(samples) } else { lattice })
}

/// Sums up what the leaves add.
fn fill(lattices: &mut [Lattice], tree: &dyn BrickTree, memory: u64, progress: &dyn Progress) -> Result<()> {
    let finest = tree.deepest_level();
    let order = LeafOrder::new(tree)?;
    progress.phase("fractions", Some(order.keys().len() as u64), "bricks");
    // What comes after is ignored, so it does not matter which threads have seen it.
    let rounded: Vec<AtomicBool> =
        lattices.iter().map(|lattice| AtomicBool::new(lattice.is_rounded)).collect();
    let factors: &[u32] = &lattices.iter().map(|lattice| lattice.factor).collect::<Vec<u32>>();
    let base = base_of(factors);
    let make = |leaf: &Leaf<'_>| {
        let of = |(&factor, rounded): (&u32, &AtomicBool)| {
            let is_rounded = rounded.load(Ordering::Relaxed);
            if is_rounded { None } else { Some(planes(leaf.key, leaf.brick, finest, factor)) }
        };
        let planes = factors.iter().zip(&rounded).map(|both| of(both).unwrap_or_default());
        let made = blocks(leaf.key, leaf.brick, finest, (base, factors));
        Ok(made.into_iter().zip(planes).collect::<Vec<_>>())
    };
    let last = order.keys().len().saturating_sub(1);
    visit(tree, order.keys(), progress, make, |number, blocks: Vec<(Option<SumBox>, LeafPlanes)>| {
        let code = if number == last { u64::MAX } else { order.keys()[number].post_order().0 };
        let mut is_hopeless = false;
        for (n, (lattice, (block, planes))) in lattices.iter_mut().zip(blocks).enumerate() {
            if !lattice.is_rounded {
                sharp::add(planes, &mut lattice.open_sharp);
            }
            block.iter().for_each(|block| lattice.add(block, finest));
            lattice.complete(code);
            // Planes that do not agree within cells do so even less within larger ones, which have fewer samples to tell.
            if is_hopeless && !lattice.is_rounded {
                lattice.round();
            } else if number.is_multiple_of(CHECKED) && !lattice.is_rounded {
                lattice.round_if_hopeless();
            }
            is_hopeless = lattice.is_rounded;
            rounded[n].store(lattice.is_rounded, Ordering::Relaxed);
        }
        if (number.is_multiple_of(64) || number == last)
            && lattices.iter().map(Lattice::bytes).sum::<u64>() > memory
        {
            let cell = lattices.first().map_or(0.0, Lattice::cell);
            return Err(Error::setting(
                format!("fractions of cells of {cell:.6} do not fit the memory allowed"),
                "choose larger cells (`detail`), fewer triangles, or more `memory`",
            ));
        }
        Ok(())
    })
}
