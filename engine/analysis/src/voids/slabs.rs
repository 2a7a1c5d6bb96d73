//! Solid, void and overlap between planes across z: the layers of a part, or steps of one height.
//!
//! Lines along z meet the boundary in exact crossings, and a slab cuts their chords where it begins and ends. So volumes do
//! not depend on how layers stand to the cells, which those of lines along x and y do. Of overlap only samples tell.

use super::components::{Components, Run};
use super::labelling::Labelling;
use super::measure::{CrossingOffsets, PARTS};
use crate::brick::{Brick, Samples, SignChanges};
use crate::error::Result;
use crate::lattice::{Axis, BRICK_CELLS, BRICK_POINTS, NodeKey, RootCube};
use crate::progress::Progress;
use crate::store::{BrickTree, Leaf, visit};

/// Steps of an edge in which crossings are told.
const STEP_BITS: u32 = 16;
/// The samples of a row that a brick owns.
const OWN: u64 = (1 << BRICK_CELLS) - 1;

/// Volumes between two planes, in the cube of the tree's unit.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Slab {
    /// Where w ≥ 1.
    pub solid: f64,
    /// Of enclosed voids.
    pub void: f64,
    /// ∫ (w − 1) where w ≥ 1, by samples.
    pub overlap: f64,
    /// By how much the solid is more by lines along z than by those along x, and along y, in the same planes of samples.
    pub apart: [f64; 2],
    /// What lines may miss of the solid by chance, in volume: the root of how many crossings its outlines have, times a line's
    /// area and the height.
    pub by_chance: f64,
}

/// What a line passes.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Class {
    Solid,
    Void,
    Outside,
}

/// Sums in square units times parts of a unit.
#[derive(Clone, Copy, Default)]
struct Sums {
    solid: i128,
    void: i128,
    overlap: i128,
    /// In units times the square of parts.
    apart: [i128; 2],
    /// Crossings of outlines, each times the square of a line's area and the height, in parts.
    crossings: i128,
}

/// Planes, in parts of a unit from the root's first sample, and what lies between them and its neighbour above.
struct Slabs<'a> {
    edges: &'a [i64],
    first: usize,
    sums: Vec<Sums>,
}

impl Slabs<'_> {
    /// The slabs that a range of heights meets.
    fn within(edges: &[i64], low: i64, high: i64) -> Slabs<'_> {
        let first = edges.partition_point(|&edge| edge <= low).saturating_sub(1);
        let last = edges.partition_point(|&edge| edge < high).min(edges.len().saturating_sub(1));
        Slabs { edges, first, sums: vec![Sums::default(); last.saturating_sub(first)] }
    }

    /// Calls `add` with each slab that a range of heights meets and the length of their common part.
    fn each(&mut self, from: i64, to: i64, mut add: impl FnMut(&mut Sums, i128)) {
        for (n, sums) in self.sums.iter_mut().enumerate() {
            let length = to.min(self.edges[self.first + n + 1]) - from.max(self.edges[self.first + n]);
            if length > 0 {
                add(sums, i128::from(length));
            }
        }
    }

    /// Adds so many lines that pass a class from one height to another, each for an area.
    fn add(&mut self, class: Class, (from, to): (i64, i64), area: i128) {
        match class {
            Class::Solid => self.each(from, to, |sums, length| sums.solid += length * area),
            Class::Void => self.each(from, to, |sums, length| sums.void += length * area),
            Class::Outside => {}
        }
    }
}

/// The volumes between planes at these heights, in the world and ascending: one fewer than planes.
///
/// # Errors
/// What reading the tree gives; [`crate::error::Error::Interrupted`].
pub fn slabs(
    tree: &dyn BrickTree,
    labelling: &Labelling,
    heights: &[f64],
    progress: &dyn Progress,
) -> Result<Vec<Slab>> {
    let root = tree.root();
    let edges: Vec<i64> = heights.iter().map(|z| in_parts(root, *z)).collect();
    let mut sums = vec![Sums::default(); heights.len().saturating_sub(1)];
    progress.phase("layers", Some(labelling.order.keys().len() as u64), "bricks");
    let make = |leaf: &Leaf<'_>| Ok(of_leaf(leaf, labelling, &edges));
    visit(tree, labelling.order.keys(), progress, make, |_, (first, of_leaf): (usize, Vec<Sums>)| {
        for (all, part) in sums[first..].iter_mut().zip(of_leaf) {
            all.solid += part.solid;
            all.void += part.void;
            all.overlap += part.overlap;
            all.crossings += part.crossings;
            all.apart.iter_mut().zip(part.apart).for_each(|(all, part)| *all += part);
        }
        Ok(())
    })?;
    let volume = |sum: i128| sum as f64 / PARTS * root.unit().powi(3);
    let slab = |(s, ends): (Sums, &[f64])| Slab {
        solid: volume(s.solid),
        void: volume(s.void),
        overlap: volume(s.overlap),
        apart: s.apart.map(|apart| volume(apart) / PARTS),
        by_chance: (s.crossings as f64 / PARTS * root.unit().powi(5) * (ends[1] - ends[0])).sqrt(),
    };
    Ok(sums.into_iter().zip(heights.windows(2)).map(slab).collect())
}

/// A height in parts of a unit from the root's first sample.
fn in_parts(root: RootCube, z: f64) -> i64 {
    (((z - root.origin[2]) / root.unit() - 1.0) * PARTS).round() as i64
}

/// The first slab that a leaf meets, and the sums of this one and those above.
fn of_leaf(leaf: &Leaf<'_>, labelling: &Labelling, edges: &[i64]) -> (usize, Vec<Sums>) {
    let bits = leaf.key.spacing_bits();
    let step = (1i64 << bits) * PARTS as i64;
    let low = i64::from(leaf.key.base()[2]) * PARTS as i64;
    // A sample stands for half a cell below it as well.
    let mut slabs = Slabs::within(edges, low - step / 2, low + step * BRICK_CELLS as i64);
    if slabs.sums.is_empty() {
        return (slabs.first, Vec::new());
    }
    let (components, signs) = Components::of(leaf.brick, labelling.connectivity);
    let class = |label: u16| match (components.solid[usize::from(label)], labelling.of(leaf.number, label)) {
        (true, _) => Class::Solid,
        (false, Some(_)) => Class::Void,
        (false, None) => Class::Outside,
    };
    let classes: Vec<Class> = (0..components.len() as u16).map(class).collect();
    let area = 1i128 << (2 * bits);
    let lines = (BRICK_CELLS * BRICK_CELLS) as i128;
    match (leaf.brick, signs) {
        (Brick::Counts { samples, .. }, Some(signs)) => {
            chords(leaf, (&components, &signs), &classes, &mut slabs);
            across(leaf, &signs, &mut slabs);
            overlaps(samples, (low, step), area, &mut slabs);
        }
        (brick, _) => {
            let ends = (low, low + step * BRICK_CELLS as i64);
            slabs.add(classes[0], ends, lines * area);
            let more = i128::from(brick.sample([0; 3]) - 1).max(0);
            let ends = (ends.0 - step / 2, ends.1 - step / 2);
            slabs.each(ends.0, ends.1, |sums, length| sums.overlap += length * lines * area * more);
        }
    }
    (slabs.first, slabs.sums)
}

/// Adds the chords along z of a brick that is not uniform.
fn chords(
    leaf: &Leaf<'_>,
    (components, signs): (&Components, &SignChanges),
    classes: &[Class],
    slabs: &mut Slabs<'_>,
) {
    let NodeAt { low, shift, area } = NodeAt::of(leaf.key);
    let Brick::Counts { hermite, .. } = leaf.brick else { return };
    let mut offsets = CrossingOffsets::along(hermite, signs, Axis::Z);
    let class = |run: &Run| classes[usize::from(run.label)];
    for k in 0..BRICK_CELLS {
        let ends = [k, k + 1].map(|k| low + (((k as i64) << STEP_BITS) << shift));
        let mut whole = [0i128; 2];
        for j in 0..BRICK_POINTS {
            let changes = signs.row(j, k) ^ signs.row(j, k + 1);
            if j < BRICK_CELLS {
                for run in components.row(j, k) {
                    let count = i128::from((run.bits() & OWN & !changes).count_ones());
                    match class(run) {
                        Class::Solid => whole[0] += count,
                        Class::Void => whole[1] += count,
                        Class::Outside => {}
                    }
                }
            }
            let mut rest = changes;
            while rest != 0 {
                let i = rest.trailing_zeros() as usize;
                rest &= rest - 1;
                let offset = offsets.next();
                if i < BRICK_CELLS && j < BRICK_CELLS {
                    let crossing = ends[0] + (offset << shift);
                    let [below, above] = [k, k + 1].map(|k| classes[usize::from(components.at([i, j, k]))]);
                    slabs.add(below, (ends[0], crossing), area);
                    slabs.add(above, (crossing, ends[1]), area);
                }
            }
        }
        slabs.add(Class::Solid, (ends[0], ends[1]), whole[0] * area);
        slabs.add(Class::Void, (ends[0], ends[1]), whole[1] * area);
    }
}

/// Adds what planes of samples have in common with the solid by counting samples, which are the lines along z, beyond what they
/// have by chords along x, and along y. Where a plane's outline crosses an edge, what is left of the edge beyond the crossing
/// tells.
fn across(leaf: &Leaf<'_>, signs: &SignChanges, slabs: &mut Slabs<'_>) {
    let NodeAt { low, shift, .. } = NodeAt::of(leaf.key);
    let Brick::Counts { hermite, .. } = leaf.brick else { return };
    let step = (1i64 << leaf.key.spacing_bits()) * PARTS as i64;
    let (mut apart, mut crossings) = ([[0i64; BRICK_CELLS]; 2], [0i128; BRICK_CELLS]);
    for (axis, planes) in [Axis::X, Axis::Y].into_iter().zip(&mut apart) {
        let mut offsets = CrossingOffsets::along(hermite, signs, axis);
        signs.for_edges(axis, |[i, j, k]| {
            let offset = offsets.next();
            if i.max(j).max(k) < BRICK_CELLS {
                let beyond = (1 << STEP_BITS) - offset;
                crossings[k] += 1;
                planes[k] += if signs.row(j, k) >> i & 1 != 0 { beyond } else { -beyond };
            }
        });
    }
    let width = 1i128 << leaf.key.spacing_bits();
    for k in 0..BRICK_CELLS {
        let from = low + k as i64 * step - step / 2;
        let planes = apart.map(|planes| i128::from(planes[k] << shift) * width);
        if crossings[k] > 0 {
            slabs.each(from, from + step, |sums, length| {
                sums.crossings += crossings[k] * width.pow(4) * length;
                sums.apart.iter_mut().zip(planes).for_each(|(sum, plane)| *sum += plane * length);
            });
        }
    }
}

/// Where a leaf's lines along z begin, in parts; how far steps of an edge are shifted to be parts; a line's area.
struct NodeAt {
    low: i64,
    shift: u32,
    area: i128,
}

impl NodeAt {
    fn of(key: NodeKey) -> NodeAt {
        let bits = key.spacing_bits();
        let low = i64::from(key.base()[2]) * PARTS as i64;
        NodeAt { low, shift: bits + (PARTS as u32).ilog2() - STEP_BITS, area: 1 << (2 * bits) }
    }
}

/// Adds what samples have beyond 1, each for its cell around it.
fn overlaps(samples: &Samples, (low, step): (i64, i64), area: i128, slabs: &mut Slabs<'_>) {
    for k in 0..BRICK_CELLS {
        let mut more = 0i128;
        for j in 0..BRICK_CELLS {
            let first = (k * BRICK_POINTS + j) * BRICK_POINTS;
            let row = &samples.0[first..first + BRICK_CELLS];
            more += i128::from(row.iter().map(|&w| (i32::from(w) - 1).max(0)).sum::<i32>());
        }
        if more > 0 {
            let from = low + k as i64 * step - step / 2;
            slabs.each(from, from + step, |sums, length| sums.overlap += length * more * area);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::{Connectivity, label};
    use super::*;
    use crate::brick::point_position;
    use crate::brick::{Hermite, HermiteEdge, OctNormal, point_index};
    use crate::progress::Silent;
    use crate::store::MemoryTree;

    /// The root as one brick: solid from sample 4 to 27 on every axis, w = 2 from 20 to 27 in z, with a void of 8 × 8 × 10
    /// samples; all crossings a quarter above the lower sample.
    fn tree() -> MemoryTree {
        let mut samples = Samples::filled(0);
        for n in 0..BRICK_POINTS.pow(3) {
            let at = point_position(n);
            let is_void = (10..18).contains(&at[0]) && (10..18).contains(&at[1]) && (8..18).contains(&at[2]);
            if at.iter().all(|c| (4..28).contains(c)) && !is_void {
                samples.0[point_index(at)] = if at[2] >= 20 { 2 } else { 1 };
            }
        }
        let signs = SignChanges::of(&samples);
        let edges = Axis::ALL.map(|axis| {
            let mut edges = Vec::new();
            signs.for_edges(axis, |_| edges.push(HermiteEdge { offset: 1 << 14, normal: OctNormal(0) }));
            edges
        });
        let mut tree =
            MemoryTree::new(RootCube { origin: [0.0, 0.0, -1.0 / f64::from(1 << 19)], edge: 32.0 });
        tree.insert(NodeKey::ROOT, true, Brick::Counts { samples, hermite: Hermite { edges } });
        tree
    }

    #[test]
    fn slabs_cut_chords_where_they_begin_and_end() {
        let tree = tree();
        let labelling = label(&tree, Connectivity::VoidSix, &Silent).unwrap();
        // Sample k stands at height k. The solid reaches from 3.25 to 27.25, the void from 7.25 to 17.25.
        let heights = [0.0, 7.5, 10.3, 20.0, 40.0];
        let found = slabs(&tree, &labelling, &heights, &Silent).unwrap();
        let void = [0.25, 2.8, 17.25 - 10.3, 0.0].map(|length| 64.0 * length);
        let solid = [4.25, 2.8, 9.7, 7.25].map(|length| 576.0 * length);
        for (n, slab) in found.iter().enumerate() {
            assert!((slab.void - void[n]).abs() < 1e-3, "{n}: {slab:?}");
            assert!((slab.solid + slab.void - solid[n]).abs() < 1e-2, "{n}: {slab:?}");
        }
        // Of solid and void 24 samples along x are as long as their chords, and so along y.
        assert!(found.iter().all(|slab| slab.apart.iter().all(|apart| apart.abs() < 1e-2)), "{found:?}");
        // The lowest samples with w = 2 stand for half a cell below 20.
        assert!((found[2].overlap - 288.0).abs() < 1e-3 && (found[3].overlap - 7.5 * 576.0).abs() < 1e-2);
    }

    #[test]
    fn lines_along_x_and_y_tell_where_those_along_z_miss_a_face() {
        // Solid from sample 4 to 19 along x, which ends at 19.25 and begins at 3.75.
        let mut samples = Samples::filled(0);
        for n in 0..BRICK_POINTS.pow(3) {
            let at = point_position(n);
            if (4..20).contains(&at[0]) && (4..28).contains(&at[1]) && (4..28).contains(&at[2]) {
                samples.0[point_index(at)] = 1;
            }
        }
        let signs = SignChanges::of(&samples);
        let edges = Axis::ALL.map(|axis| {
            let mut edges = Vec::new();
            signs.for_edges(axis, |at| {
                let is_end = axis == Axis::X && at[0] < 4;
                let offset = if is_end { 3 << 14 } else { 1 << 14 };
                edges.push(HermiteEdge { offset, normal: OctNormal(0) });
            });
            edges
        });
        let mut tree =
            MemoryTree::new(RootCube { origin: [0.0, 0.0, -1.0 / f64::from(1 << 19)], edge: 32.0 });
        tree.insert(NodeKey::ROOT, true, Brick::Counts { samples, hermite: Hermite { edges } });
        let labelling = label(&tree, Connectivity::VoidSix, &Silent).unwrap();
        let found = slabs(&tree, &labelling, &[10.0, 12.0, 13.5], &Silent).unwrap();
        // 16 samples for a length of 15.5, in 24 lines.
        for (slab, height) in found.iter().zip([2.0, 1.5]) {
            let [x, y] = slab.apart;
            assert!((x - 0.5 * 24.0 * height).abs() < 1e-3 && y.abs() < 1e-3, "{slab:?}");
        }
    }
}
