//! Which nodes of a store become leaves, and what a leaf that was none has for Hermite edges.

use super::boundary::broken;
use super::place::meets_box;
use super::rewrite::{RecordOrder, Rewrite, RewriteSummary};
use crate::brick::Brick;
use crate::error::{Error, Result};
use crate::lattice::{BRICK_POINTS, NodeKey, Octant};
use crate::progress::Progress;
use crate::store::{BrickTree, Refine, Store};
use rayon::prelude::*;
use std::path::Path;

/// Samples along an axis of a brick.
const P: usize = BRICK_POINTS;

/// What of a store is kept. A node becomes a leaf as soon as one of these asks for it, the nodes nearest to the root first.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PruneOptions {
    /// No node deeper than this.
    pub level: Option<u8>,
    /// Coarse outside of a box.
    pub region: Option<PruneRegion>,
    /// A node replaces all below it if no winding number interpolated between its samples is off by more than this
    /// from the one interpolated between theirs.
    pub error: Option<f64>,
}

/// A box outside of which a store is coarse.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PruneRegion {
    /// Least coordinates, in the store's unit.
    pub min: [f64; 3],
    /// Greatest coordinates.
    pub max: [f64; 3],
    /// A node whose cells all lie outside the box is divided down to this level at most; 0 leaves the coarsest octree
    /// that has the box as it was.
    pub outside_level: u8,
}

/// Writes `store` to `output` without the nodes that the options leave out. Samples keep their values, and every leaf
/// has a Hermite edge for each sign change; see [`crate::brick::Hermite::from_children`].
///
/// A store that is cut at a level has the depth of that level in its metadata, as if built so; of other cuts the
/// metadata tell in the name of the program.
///
/// # Errors
/// As [`super::compact`]; [`Error::Setting`] for bounds that are none; [`Error::Store`] for a shard of a store, and for a
/// box that lies elsewhere.
pub fn prune(
    store: &Store,
    output: &Path,
    options: &PruneOptions,
    progress: &dyn Progress,
) -> Result<RewriteSummary> {
    if let Some(shard) = &store.meta().shard {
        let what = format!("this is shard {} of a store, which is no complete tree", shard.id);
        return Err(Error::store(
            store.path(),
            "header",
            what,
            "join all shards with `brickfield cache merge` first",
        ));
    }
    options.check()?;
    if options
        .region
        .is_some_and(|PruneRegion { min, max, .. }| !meets_box(NodeKey::ROOT, &store.root(), [min, max]))
    {
        let what = "the box does not meet the store's root cube";
        return Err(Error::store(
            store.path(),
            "root",
            what,
            "give one near its bounds, which `brickfield info` tells",
        ));
    }
    let cut = options.cut(store, progress)?;
    let mut meta = store.meta().clone();
    meta.depth = meta.depth.min(options.level.unwrap_or(meta.depth));
    if matches!(meta.refine, Refine::Thin { base } if base >= meta.depth) {
        meta.refine = Refine::Hidden;
    }
    let told: Vec<String> = [
        options.region.map(|PruneRegion { min, max, outside_level }| {
            format!("level {outside_level} outside of {min:?} to {max:?}")
        }),
        options.error.map(|error| format!("an error of {error}")),
    ]
    .into_iter()
    .flatten()
    .collect();
    if !told.is_empty() {
        meta.program += &format!(", pruned to {}", told.join(" and "));
    }
    let order = RecordOrder::Build;
    Rewrite { store, meta, cut, compression: None, order }.run(output, progress)
}

impl PruneOptions {
    fn check(&self) -> Result<()> {
        if let Some(PruneRegion { min, max, .. }) = self.region
            && !(0..3).all(|a| min[a].is_finite() && max[a].is_finite() && min[a] <= max[a])
        {
            return Err(Error::setting(
                format!("{min:?} to {max:?} is no box"),
                "give its least coordinates, then its greatest",
            ));
        }
        match self.error {
            Some(error) if !(error >= 0.0 && error.is_finite()) => {
                Err(Error::setting(format!("{error} is no bound on errors"), "give a number of 0 or more"))
            }
            _ => Ok(()),
        }
    }

    /// The interior nodes that become leaves, in key order: level by level, from the root on.
    fn cut(&self, tree: &Store, progress: &dyn Progress) -> Result<Vec<NodeKey>> {
        progress.phase("choosing nodes", None, "nodes");
        let root = tree.root();
        let is_left_out = |key: NodeKey, region: PruneRegion| {
            key.level() >= region.outside_level && !meets_box(key, &root, [region.min, region.max])
        };
        let is_asked = |key: NodeKey| {
            self.level.is_some_and(|level| key.level() >= level)
                || self.region.is_some_and(|region| is_left_out(key, region))
        };
        let is_interior = |key: &NodeKey| tree.node(*key).is_some_and(|node| !node.leaf);
        let mut cut = Vec::new();
        let mut nodes: Vec<NodeKey> = [NodeKey::ROOT].into_iter().filter(is_interior).collect();
        while !nodes.is_empty() {
            let decide = |&key: &NodeKey| {
                progress.check()?;
                progress.advance(1);
                let asked = is_asked(key);
                Ok(asked || self.error.map_or(Ok(false), |error| replaces_all(tree, key, error))?)
            };
            let becomes_leaf: Vec<bool> = nodes.par_iter().map(decide).collect::<Result<_>>()?;
            let (leaves, divided): (Vec<_>, Vec<_>) =
                nodes.iter().zip(becomes_leaf).partition(|(_, leaf)| *leaf);
            cut.extend(leaves.into_iter().map(|(key, _)| *key));
            let children = |(key, _): (&NodeKey, bool)| {
                Octant::all().map(|octant| key.child(octant)).collect::<Vec<_>>()
            };
            nodes = divided.into_iter().flat_map(children).filter(is_interior).collect();
        }
        Ok(cut)
    }
}

/// Whether an interior node's samples give, interpolated, all samples below it up to `error`. Then they give everything
/// between those, too: within a finer cell both are trilinear, and their difference is largest at a corner.
fn replaces_all(tree: &Store, key: NodeKey, error: f64) -> Result<bool> {
    let Some(info) = tree.node(key) else { return Err(broken(tree, key)) };
    // The range in the index is of rounded samples.
    let slack = error + if info.fractions { 1.0 } else { 0.0 };
    let mut brick = None;
    let mut below: Vec<NodeKey> = Octant::all().map(|octant| key.child(octant)).collect();
    while let Some(node) = below.pop() {
        let finer = tree.node(node).ok_or_else(|| broken(tree, node))?;
        let exceeds = |a: i16, b: i16| f64::from(a) - f64::from(b) > slack;
        if exceeds(finer.max, info.max) || exceeds(info.min, finer.min) {
            return Ok(false);
        }
        let coarse = match &brick {
            Some(coarse) => coarse,
            None => brick.insert(tree.brick(key)?),
        };
        if !interpolates(coarse, key, &*tree.brick(node)?, node, error) {
            return Ok(false);
        }
        if !finer.leaf {
            below.extend(Octant::all().map(|octant| node.child(octant)));
        }
    }
    Ok(true)
}

/// Whether samples of `coarse` give, interpolated, those of `fine` below it up to `error`. Up to twelve levels apart no
/// operation rounds.
fn interpolates(coarse: &Brick, above: NodeKey, fine: &Brick, below: NodeKey, error: f64) -> bool {
    if let (Brick::Uniform(a), Brick::Uniform(b)) = (coarse, fine) {
        return f64::from(a.abs_diff(*b)) <= error;
    }
    let down = below.level() - above.level();
    let step = 1.0 / f64::from(1u32 << down);
    let first = [0, 1, 2].map(|a| below.first_sample()[a] - (above.first_sample()[a] << down));
    // Along an axis: the coarse sample below, and how far behind it.
    let place = |axis: usize, i: usize| {
        let at = f64::from(first[axis] + i as u32) * step;
        let low = (at as usize).min(P - 2);
        (low, at - low as f64)
    };
    let places: [Vec<(usize, f64)>; 3] = [0, 1, 2].map(|axis| (0..P).map(|i| place(axis, i)).collect());
    let mix = |a: f64, b: f64, t: f64| a + (b - a) * t;
    let from = places[0][0].0;
    let to = places[0][P - 1].0 + 1;
    let mut row = [0.0; P];
    for (k, &(z, tz)) in places[2].iter().enumerate() {
        for (j, &(y, ty)) in places[1].iter().enumerate() {
            for (x, value) in row.iter_mut().enumerate().take(to + 1).skip(from) {
                let along_y = |z: usize| mix(coarse.value([x, y, z]), coarse.value([x, y + 1, z]), ty);
                *value = mix(along_y(z), along_y(z + 1), tz);
            }
            let differs = |i: usize| {
                let (x, tx) = places[0][i];
                (mix(row[x], row[x + 1], tx) - fine.value([i, j, k])).abs() > error
            };
            if (0..P).any(differs) {
                return false;
            }
        }
    }
    true
}
