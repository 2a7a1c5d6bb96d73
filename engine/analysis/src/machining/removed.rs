//! Which move takes off what: along the rows of the part, the first move that reaches a place takes it.

use crate::brick::{Brick, SignChanges};
use crate::error::Result;
use crate::lattice::{Axis, BRICK_CELLS, NodeKey, Octant, RootCube};
use crate::progress::Progress;
use crate::schedule::run_ordered;
use crate::store::{BrickTree, Store};
use crate::swept::cube_of;
use std::collections::BTreeMap;

use super::cut::Cut;

/// What a move takes off.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct MoveShare {
    /// Volume along rows of samples, in the cube of the store's unit: to about half a cell at each face.
    pub volume: f64,
    /// Least and greatest height along z of what it takes off, in the store's unit, to a cell.
    pub height: [f64; 2],
}

/// What all moves take off.
#[derive(Clone, Debug, Default)]
pub struct RemovedVolume {
    /// By move; of those that take off nothing there is none.
    pub by_move: BTreeMap<u32, MoveShare>,
}

impl RemovedVolume {
    fn add(&mut self, number: u32, volume: f64, [low, high]: [f64; 2]) {
        let none = MoveShare { volume: 0.0, height: [f64::INFINITY, f64::NEG_INFINITY] };
        let share = self.by_move.entry(number).or_insert(none);
        share.volume += volume;
        share.height = [share.height[0].min(low), share.height[1].max(high)];
    }

    fn join(&mut self, other: &RemovedVolume) {
        other.by_move.iter().for_each(|(number, part)| self.add(*number, part.volume, part.height));
    }

    /// The same with volumes that add up to what was measured of all.
    #[must_use]
    pub fn scaled_to(mut self, total: f64) -> RemovedVolume {
        let sum: f64 = self.by_move.values().map(|share| share.volume).sum();
        if sum > 0.0 {
            self.by_move.values_mut().for_each(|share| share.volume *= total / sum);
        }
        self
    }
}

/// Nodes of the part that are looked at together.
const TASK_LEVELS: u8 = 2;

/// Finds out which move takes off what.
///
/// # Errors
/// What reading the store gives; [`crate::error::Error::Interrupted`].
pub fn removed(store: &Store, cut: &Cut, progress: &dyn Progress) -> Result<RemovedVolume> {
    let mut found = RemovedVolume::default();
    let search = Search { store, cut, depth: store.meta().depth, root: store.root() };
    let mut tasks = Vec::new();
    let all: Vec<u32> = (0..cut.solids.len() as u32).collect();
    search.tasks(NodeKey::ROOT, &all, None, &mut tasks);
    progress.phase("attributing", Some(tasks.len() as u64), "subtrees");
    let work = |(): &mut (), number: usize| {
        progress.check()?;
        let Task { key, list, part } = &tasks[number];
        let mut removed = RemovedVolume::default();
        search.node(*key, list, *part, &mut removed)?;
        Ok(removed)
    };
    run_ordered(
        tasks.len(),
        4 * rayon::current_num_threads(),
        || (),
        work,
        |part: RemovedVolume| {
            found.join(&part);
            progress.advance(1);
            Ok(())
        },
    )?;
    Ok(found)
}

struct Task {
    key: NodeKey,
    list: Vec<u32>,
    /// Whether the part is solid in all of it.
    part: Option<bool>,
}

struct Search<'a> {
    store: &'a Store,
    cut: &'a Cut,
    depth: u8,
    root: RootCube,
}

impl Search<'_> {
    /// The solids that touch a node, in order, up to the first that covers it.
    fn near(&self, key: NodeKey, list: &[u32]) -> Vec<u32> {
        let mut near = Vec::new();
        for &number in list {
            let solid = &self.cut.solids[number as usize];
            if solid.misses(key) {
                continue;
            }
            near.push(number);
            if solid.covers(key) {
                break;
            }
        }
        near
    }

    /// What the part is within a node: solid, empty, or `None` if that is not known.
    fn part(&self, key: NodeKey, above: Option<bool>) -> Option<bool> {
        if above.is_some() {
            return above;
        }
        let node = self.store.node(key)?;
        if !node.leaf || (node.min < 1 && node.max >= 1) { None } else { Some(node.max >= 1) }
    }

    fn tasks(&self, key: NodeKey, list: &[u32], above: Option<bool>, tasks: &mut Vec<Task>) {
        let part = self.part(key, above);
        let list = if part == Some(false) { Vec::new() } else { self.near(key, list) };
        if list.is_empty() {
            return;
        }
        if key.level() + TASK_LEVELS >= self.depth || key.level() >= 6 {
            tasks.push(Task { key, list, part });
            return;
        }
        for octant in Octant::all() {
            self.tasks(key.child(octant), &list, part, tasks);
        }
    }

    fn node(
        &self,
        key: NodeKey,
        list: &[u32],
        above: Option<bool>,
        removed: &mut RemovedVolume,
    ) -> Result<()> {
        let part = self.part(key, above);
        let list = if part == Some(false) { Vec::new() } else { self.near(key, list) };
        let Some(&first) = list.first() else { return Ok(()) };
        if part == Some(true) && list.len() == 1 && self.cut.solids[first as usize].covers(key) {
            let (low, size) = cube_of(key);
            // All of it at once.
            let edge = size * self.root.unit();
            let bottom = self.root.origin[2] + low[2] * self.root.unit();
            removed.add(self.cut.moves[first as usize], edge.powi(3), [bottom, bottom + edge]);
            return Ok(());
        }
        let is_leaf = self.store.node(key).is_none_or(|node| node.leaf);
        if is_leaf && (part.is_none() || key.level() >= self.depth) {
            let brick = match part {
                Some(_) => Brick::Uniform(1),
                None => Brick::clone(&*self.store.brick_once(key)?),
            };
            self.rows(key, &brick, &list, removed);
            return Ok(());
        }
        for octant in Octant::all() {
            self.node(key.child(octant), &list, part, removed)?;
        }
        Ok(())
    }

    /// The rows of a brick's own samples, each for a square of cells.
    fn rows(&self, key: NodeKey, brick: &Brick, list: &[u32], removed: &mut RemovedVolume) {
        let step = f64::from(1u32 << key.spacing_bits());
        let origin = key.base().map(|base| f64::from(base + 1));
        let unit = self.root.unit();
        let area = (step * unit) * (step * unit);
        let mut left = rows_of(brick, origin[0], step);
        let rows = |axis: usize, [low, high]: [[f64; 3]; 2]| {
            // One more on either side than the box reaches: lines outside of it are told by themselves.
            let row = |c: f64| ((c - origin[axis]) / step).clamp(-1.0, BRICK_CELLS as f64);
            row(low[axis]).floor().max(0.0) as usize..(row(high[axis]).ceil() as usize + 1).min(BRICK_CELLS)
        };
        for &number in list {
            let solid = &self.cut.solids[number as usize];
            let bounds = solid.bounds();
            let (js, lines) = (rows(1, bounds), solid.lines(0));
            for (k, j) in rows(2, bounds).flat_map(|k| js.clone().map(move |j| (k, j))) {
                let left = &mut left[k * BRICK_CELLS + j];
                if left.is_empty() {
                    continue;
                }
                let at = [0.0, origin[1] + j as f64 * step, origin[2] + k as f64 * step];
                let Some(interval) = lines.meet(at) else { continue };
                let taken = take(left, (interval.low.at, interval.high.at));
                if taken > 0.0 {
                    let height = self.root.origin[2] + at[2] * unit;
                    removed.add(self.cut.moves[number as usize], taken * unit * area, [height; 2]);
                }
            }
        }
    }
}

/// The intervals of each own row of a brick that lie in the part, from the row's first sample to the next brick's.
fn rows_of(brick: &Brick, from: f64, step: f64) -> Vec<Vec<(f64, f64)>> {
    let all = (from, from + step * BRICK_CELLS as f64);
    let (samples, hermite) = match brick {
        Brick::Uniform(w) => {
            return vec![if *w >= 1 { vec![all] } else { Vec::new() }; BRICK_CELLS * BRICK_CELLS];
        }
        Brick::Counts { samples, hermite } => (samples, hermite),
    };
    let signs = SignChanges::of(samples);
    let mut rows = vec![Vec::new(); BRICK_CELLS * BRICK_CELLS];
    let mut begins = vec![None; BRICK_CELLS * BRICK_CELLS];
    for (row, begin) in begins.iter_mut().enumerate() {
        if signs.is_inside([0, row % BRICK_CELLS, row / BRICK_CELLS]) {
            *begin = Some(all.0);
        }
    }
    signs.for_crossings(Axis::X, hermite, |[i, j, k], edge| {
        if j >= BRICK_CELLS || k >= BRICK_CELLS {
            return;
        }
        let (row, at) = (k * BRICK_CELLS + j, from + (i as f64 + edge.fraction()) * step);
        match begins[row].take() {
            Some(begin) => rows[row].push((begin, at)),
            None => begins[row] = Some(at),
        }
    });
    for (row, begin) in begins.into_iter().enumerate() {
        rows[row].extend(begin.map(|begin| (begin, all.1)));
    }
    rows
}

/// Takes an interval off a list of them; returns how much it took.
fn take(left: &mut Vec<(f64, f64)>, (from, to): (f64, f64)) -> f64 {
    // Most of what moves reach was taken before.
    if !left.iter().any(|&(low, high)| low.max(from) < high.min(to)) {
        return 0.0;
    }
    let mut taken = 0.0;
    let mut rest = Vec::with_capacity(left.len() + 1);
    for &(low, high) in left.iter() {
        let (cut_low, cut_high) = (low.max(from), high.min(to));
        if cut_low >= cut_high {
            rest.push((low, high));
            continue;
        }
        taken += cut_high - cut_low;
        if low < cut_low {
            rest.push((low, cut_low));
        }
        if cut_high < high {
            rest.push((cut_high, high));
        }
    }
    *left = rest;
    taken
}
