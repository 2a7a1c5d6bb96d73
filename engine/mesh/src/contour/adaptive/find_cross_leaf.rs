//! Joining what leaves hand on, node by node of the tree above them, and giving up what would fold the surface.

use super::super::field::LevelSet;
use super::super::leaves::{ContourLeaf, LeafNeighbour};
use super::super::normal_sum::direction;
use super::super::order::in_order;
use super::super::solve::LoopGroup;
use super::cross_leaf::{CrossLeafMerges, CrossLeafVertex, MergeTarget};
use super::find_foldovers;
use super::fit;
use super::out_of_cell::straying;
use super::parts::{BorderCrossing, PartSource, SurfaceDisk};
use super::patches::{DiskSets, JoinSets};
use super::vertex_merge::NONE;
use crate::error::Result;
use crate::lattice::{BRICK_BITS, BRICK_CELLS, NodeKey};
use crate::progress::Progress;
use std::collections::{BTreeMap, HashSet};

/// A node with more crossings on its border hands nothing on: 2^15 of them take 512 KiB.
const MOST_CROSSINGS: usize = 1 << 15;

/// Walks in search of folds. Each gives up what is largest there, so that one a level of the tree is enough where a
/// fold stays in its place.
const MOST_WALKS: usize = 2 * crate::lattice::MAX_LEVEL as usize;

/// What is merged across the borders of all leaves; `tolerance` is in world units.
pub(in super::super) fn find_across(
    field: &LevelSet,
    tolerance: f64,
    normals: bool,
    progress: &dyn Progress,
) -> Result<CrossLeafMerges> {
    progress.phase("flat parts", Some(field.leaves.len() as u64), "bricks");
    let found = CrossLeafMerges { normals: normals.then(Vec::new), ..CrossLeafMerges::default() };
    let mut finder = PartJoiner { field, tolerance, found, group: LoopGroup::default(), open: Vec::new() };
    let make = |leaf| {
        let ContourLeaf { key, changes, .. } = *field.leaves.get(leaf);
        if !changes {
            return Ok((leaf, Vec::new(), Vec::new()));
        }
        let parts = field.draft(leaf)?.parts.clone();
        Ok((leaf, parts, straying(&*field.cells(leaf)?, &field.frame(key).bounds())))
    };
    field.in_order(progress, make, |(leaf, parts, straying): (u32, Vec<SurfaceDisk>, Vec<[u8; 3]>)| {
        finder.add(leaf, parts);
        finder.found.strays.add(&field.leaves, leaf, &straying);
        Ok(())
    })?;
    let mut found = finder.found;
    give_up_folds(&mut found, field, progress)?;
    found.tell_apart();
    found.number(false);
    found.host(&field.leaves, field.root);
    Ok(found)
}

/// Gives up what folds the surface. The first walk is over all leaves, the others are over those with parts of what
/// several have.
fn give_up_folds(across: &mut CrossLeafMerges, field: &LevelSet, progress: &dyn Progress) -> Result<()> {
    let several = across.sharing();
    let mut asked: Vec<u32> = (0..field.leaves.len() as u32).collect();
    asked.retain(|leaf| field.leaves.get(*leaf).changes);
    for _ in 0..MOST_WALKS {
        if asked.is_empty() {
            break;
        }
        let mut folded = Vec::new();
        progress.phase("folds", Some(asked.len() as u64), "bricks");
        let this = &*across;
        // From the last one on: what has been made of these is still there if not all of it finds room.
        let make = |n: u32| find_foldovers::found(field, asked[asked.len() - 1 - n as usize], this);
        in_order(asked.len(), progress, make, |taken: Vec<MergeTarget>| {
            folded.extend(taken);
            Ok(())
        })?;
        let changed: HashSet<u32> = across.bar(&folded).into_iter().collect();
        // Where neither a leaf nor one around it has lost any, it would say the same again.
        let has_changed = |leaf: &u32| {
            let around = field.leaves.around(*leaf);
            around.iter().any(|side| matches!(side, LeafNeighbour::Same(other) if changed.contains(other)))
        };
        asked = several.iter().copied().filter(has_changed).collect();
    }
    Ok(())
}

/// Joins the parts of nodes as their leaves come.
struct PartJoiner<'a> {
    field: &'a LevelSet<'a>,
    tolerance: f64,
    found: CrossLeafMerges,
    group: LoopGroup,
    /// Nodes whose parents are not done, with their parts if they have any.
    open: Vec<(NodeKey, Vec<SurfaceDisk>)>,
}

impl PartJoiner<'_> {
    /// Adds a leaf, which comes after all before it in Morton order.
    fn add(&mut self, leaf: u32, mut parts: Vec<SurfaceDisk>) {
        for (n, part) in parts.iter_mut().enumerate() {
            part.pieces = vec![PartSource::OfLeaf(leaf, n as u32)];
        }
        let mut key = self.field.leaves.get(leaf).key;
        loop {
            if !parts.is_empty() {
                self.open.push((key, parts));
            }
            let Some(parent) = key.parent().filter(|_| key.octant().index() == 7) else { return };
            let is_below =
                |(child, _): &(NodeKey, Vec<SurfaceDisk>)| child.ancestor(parent.level()) == Some(parent);
            let first = self.open.iter().rposition(|node| !is_below(node)).map_or(0, |n| n + 1);
            let children = self.open.split_off(first);
            parts = self.join(parent, children);
            key = parent;
        }
    }

    /// The parts of a node from those of its children.
    fn join(&mut self, node: NodeKey, children: Vec<(NodeKey, Vec<SurfaceDisk>)>) -> Vec<SurfaceDisk> {
        let mut parts = Vec::new();
        for (child, own) in children {
            parts.extend(own.into_iter().map(|part| {
                let sums = part.sums.within_parent(child.octant());
                SurfaceDisk { sums, ..part }
            }));
        }
        let mut sets = sets_of(node, &parts);
        let mut joined: BTreeMap<usize, (SurfaceDisk, usize, bool)> = BTreeMap::new();
        for (n, part) in (0..).zip(parts) {
            let root = sets.root(n);
            if !sets.is_disk(root) {
                continue;
            }
            match joined.get_mut(&root) {
                Some((whole, count, is_simple)) => {
                    *is_simple = *is_simple && whole.take(part);
                    *count += 1;
                }
                None => {
                    joined.insert(root, (part, 1, true));
                }
            }
        }
        let mut kept = Vec::new();
        for (mut part, count, is_simple) in joined.into_values() {
            if !is_simple || !part.meets_border(width_bits(node, part.level)) {
                continue;
            }
            if count == 1 || self.merge(node, &mut part) {
                kept.push(part);
            }
        }
        let crossings: usize = kept.iter().map(|part| part.crossings.len()).sum();
        if crossings > MOST_CROSSINGS { Vec::new() } else { kept }
    }

    /// Makes one vertex of a part of a node. False if none fits.
    fn merge(&mut self, node: NodeKey, part: &mut SurfaceDisk) -> bool {
        let bits_wide = width_bits(node, part.level);
        let size = f64::from(1u32 << bits_wide);
        let frame = self.field.frame(node);
        let share = size / BRICK_CELLS as f64;
        let tolerance = self.tolerance / self.field.root.spacing(part.level);
        let sums = std::slice::from_ref(&part.sums);
        let best = fit::best_points(&mut self.group, sums, (size, frame.margin * share), tolerance);
        let Some(at) = best[0] else { return false };
        let first = node.first_sample();
        let point = std::array::from_fn(|a| f64::from(first[a]) * share + at[a] * size);
        if !fit::fits_planes(point, part.sums.normal_sum, &part.planes, tolerance) {
            return false;
        }
        let position = frame.world([0; 3], at.map(|c| c * BRICK_CELLS as f64));
        let number = self.found.all.len() as u32;
        self.found.all.push(CrossLeafVertex {
            node,
            bits: bits_wide as u8,
            position,
            up: NONE,
            is_barred: false,
        });
        if let Some(normals) = &mut self.found.normals {
            // All face one direction, so their sum is none that vanishes.
            normals.push(direction(part.sums.normal_sum));
        }
        for piece in std::mem::replace(&mut part.pieces, vec![PartSource::Merged(number)]) {
            match piece {
                PartSource::OfLeaf(leaf, part) => {
                    self.found.of_part.insert((leaf, part), number);
                }
                PartSource::Merged(other) => self.found.all[other as usize].up = number,
            }
        }
        true
    }
}

/// How many cells of leaves of `level` a node is wide, as a power of 2.
fn width_bits(node: NodeKey, level: u8) -> u32 {
    BRICK_BITS + u32::from(level - node.level())
}

/// Which parts of a node's children hang together: joined where they meet on the planes between the children.
fn sets_of(node: NodeKey, parts: &[SurfaceDisk]) -> DiskSets {
    let mut crossings: Vec<(BorderCrossing, u32)> = Vec::new();
    for (n, part) in (0..).zip(parts) {
        let middle = width_bits(node, part.level) - 1;
        let inner = part.crossings.iter().filter(|crossing| crossing.planes().contains(&middle));
        crossings.extend(inner.map(|crossing| (*crossing, n)));
    }
    crossings.sort_unstable();
    let mut sets = DiskSets::of(parts.len());
    for edge in crossings.chunk_by(|(a, _), (b, _)| a.is_at_the_edge_of(b)) {
        let (crossing, _) = edge[0];
        let mut around = [None; 4];
        edge.iter().for_each(|(crossing, part)| around[usize::from(crossing.quadrant)] = Some(*part));
        sets.join_around(around, crossing.planes(), width_bits(node, crossing.level) - 1, |_| {});
    }
    sets
}
