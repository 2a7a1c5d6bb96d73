//! Where triangles at merged vertices meet others, and which vertices are given up for that.
//!
//! Triangles of polygons none of whose corners is merged are those of the mesh without a tolerance, which keep apart
//! ([`super::super::envelope`]). All others, also those without a merged corner of their own, are compared with what
//! is near them ([`super::triangle_grid`]).
//!
//! Of a pair that meets elsewhere than in common corners the vertices of the largest nodes are given up for what they
//! are made of, and what has changed is compared again, until no pair is left.
//!
//! There is an end, because each time something is given up, and if all were, the mesh would be the one without a
//! tolerance. Which pairs there are follows from the mesh alone, so no thread and no memory decides anything.
//!
//! A leaf looks at what is in its cube. A triangle lies between the leaves around the edge that it is for, since
//! vertices are off the borders of their nodes by more than a step of coordinates.
//!
//! So two that meet in a leaf belong to it or to leaves that touch it. Only those at vertices of several leaves may
//! lie elsewhere: they are kept in memory, and each leaf is told which of them pass through it.
//!
//! The triangles of a leaf beside it that reach into its cube are about edges on the cube's border, or a cell away where a
//! vertex has strayed into the next cell ([`super::out_of_cell`]), so no others are made for it.
//!
//! What changes when a vertex is given up are the polygons with a corner in its node. Their edges lie in the node or on its
//! border, so they belong to leaves that meet it. What may meet them is about edges no farther away than the nodes there are
//! wide: two cells, or in a larger node.

use super::super::field::LevelSet;
use super::super::frame::CellFrame;
use super::super::order::in_order;
use super::bounds::{Bounds, TriangleCorners, bounds, meets, wide};
use super::cross_leaf::{CrossLeafMerges, Merge, MergeTarget};
use super::edge_box::{EdgeBox, common};
use super::edge_filter::{EdgeFilter, EdgesNear, gathered};
use super::leaf_triangles::LeafTriangles;
use super::reaching_edges::edges_beside;
use super::triangle_grid::TriangleGrid;
use crate::error::Result;
use crate::lattice::{BRICK_CELLS, NodeKey, Octant};
use crate::progress::Progress;
use std::collections::{BTreeMap, HashMap, HashSet};

/// Nodes of this level and above reach farther than a look for triangles near others does anyway.
const LARGE: u8 = 2;
/// What that is, in cells.
const LOOK: i32 = 2;

/// A triangle at a vertex of several leaves.
struct WideTriangle {
    corners: TriangleCorners,
    merges: [Option<Merge>; 3],
    is_fresh: bool,
    /// The leaves through which it passes.
    leaves: Vec<u32>,
}

/// Looks for triangles that meet until there are none.
pub(in super::super) struct MeetingSearch {
    /// As in [`super::super::ContourOptions::intersection_free`]. Without it vertices of several leaves are looked for that
    /// are where another one is, for they would be one in a file that numbers none.
    intersection_free: bool,
    /// Leaves to be looked at.
    asked: Vec<u32>,
    /// Leaves whose triangles at vertices of several leaves are not known.
    unknown: Vec<u32>,
    /// By leaf, the known ones.
    wide: BTreeMap<u32, Vec<WideTriangle>>,
    /// By leaf, which of them pass through it, as a leaf and a number there.
    passing: HashMap<u32, Vec<(u32, u32)>>,
    /// By leaf, boxes with all vertices that are others than when leaves were last asked; `None` for all.
    fresh: Option<HashMap<u32, Vec<Bounds>>>,
    /// By leaf, the level of the largest node that a vertex of the leaf alone stands for, when it was first asked.
    largest: Vec<u8>,
    /// Leaves in which a vertex has made room for another one, so that all may change when one is given up.
    moved: HashSet<u32>,
}

/// What was seen in a leaf.
struct LeafIntersections {
    leaf: u32,
    /// What is to be given up.
    taken: Vec<MergeTarget>,
    /// As [`super::MergedVertices::has_moved`].
    has_moved: bool,
    /// As in [`MeetingSearch::largest`].
    largest: u8,
}

impl MeetingSearch {
    /// All leaves are to be looked at, or those that hold vertices of several.
    pub(in super::super) fn new(
        field: &LevelSet,
        across: &CrossLeafMerges,
        intersection_free: bool,
    ) -> MeetingSearch {
        let (asked, unknown) = match intersection_free {
            true => ((0..field.leaves.len() as u32).collect(), with_those_around(field, &across.sharing())),
            false => (across.hosting(), Vec::new()),
        };
        MeetingSearch {
            intersection_free,
            asked,
            unknown,
            wide: BTreeMap::new(),
            passing: HashMap::new(),
            fresh: None,
            largest: vec![0; field.leaves.len()],
            moved: HashSet::new(),
        }
    }

    /// What is to be given up for the triangles that meet.
    pub(in super::super) fn next(
        &mut self,
        field: &LevelSet,
        progress: &dyn Progress,
    ) -> Result<Vec<MergeTarget>> {
        let Some(across) = field.across() else { return Ok(Vec::new()) };
        self.find_wide(field, across, progress)?;
        let mut found: Vec<MergeTarget> = Vec::new();
        progress.phase("meetings", Some(self.asked.len() as u64), "bricks");
        let this = &*self;
        let make = |n: u32| this.of_leaf(field, across, this.asked[n as usize]);
        let (mut moved, mut largest) = (Vec::new(), Vec::new());
        in_order(self.asked.len(), progress, make, |seen: LeafIntersections| {
            found.extend(seen.taken);
            moved.extend(seen.has_moved.then_some(seen.leaf));
            largest.push((seen.leaf, seen.largest));
            Ok(())
        })?;
        self.moved.extend(moved);
        if self.fresh.is_none() {
            largest.into_iter().for_each(|(leaf, level)| self.largest[leaf as usize] = level);
        }
        found.sort_unstable();
        found.dedup();
        Ok(found)
    }

    /// After some were given up: the vertices of the leaves `changed` are others now. What is not at a vertex in a node
    /// that was given up is as it was before.
    pub(in super::super) fn ask_again(
        &mut self,
        field: &LevelSet,
        taken: &[MergeTarget],
        changed: &[u32],
    ) -> Result<()> {
        let mut fresh: HashMap<u32, Vec<Bounds>> = HashMap::new();
        for taken in taken {
            // A vertex may stray into the next cell.
            let own = match *taken {
                MergeTarget::Candidate(leaf, candidate) => {
                    let node = field.draft(leaf)?.candidates[candidate as usize].node;
                    let frame = field.frame(field.leaves.get(leaf).key);
                    around(&frame, node.corner().map(|c| c as f64), node.size(), 1.0)
                }
                MergeTarget::Wide(wide) => {
                    let Some(([low, high], cell)) =
                        field.across().map(|across| across.node(field.root, wide))
                    else {
                        continue;
                    };
                    [low.map(|c| (f64::from(c) - cell) as f32), high.map(|c| (f64::from(c) + cell) as f32)]
                }
            };
            add_fresh(field, &mut fresh, own);
        }
        let mut forgotten: HashSet<u32> = fresh.keys().chain(changed).copied().collect();
        forgotten.iter().for_each(|leaf| field.forget(*leaf));
        for &leaf in changed {
            if field.vertices(leaf)?.what_is_merged().is_some_and(|merged| merged.has_moved) {
                self.moved.insert(leaf);
            }
            if self.moved.contains(&leaf) {
                add_fresh(field, &mut fresh, cube(field, leaf));
            }
        }
        self.asked = fresh.keys().copied().collect();
        self.asked.sort_unstable();
        self.asked.iter().filter(|leaf| forgotten.insert(**leaf)).for_each(|leaf| field.forget(*leaf));
        if self.intersection_free {
            let sharing = field.across().map_or(Vec::new(), CrossLeafMerges::sharing);
            let sharing = with_those_around(field, &sharing);
            self.unknown =
                self.asked.iter().copied().filter(|leaf| sharing.binary_search(leaf).is_ok()).collect();
            self.asked.iter().for_each(|leaf| drop(self.wide.remove(leaf)));
        }
        self.fresh = Some(fresh);
        Ok(())
    }

    /// Edges of a leaf whose polygons are others than they were: all if nothing was asked before.
    fn fresh_edges(&self, field: &LevelSet, leaf: u32) -> Option<Vec<EdgeBox>> {
        let boxes = self.fresh.as_ref()?.get(&leaf).into_iter().flatten();
        let edges = EdgesNear::of(field, leaf);
        Some(boxes.filter_map(|own| edges.within(own, 0)).collect())
    }

    /// Finds the triangles at vertices of several leaves that are not known, and asks the leaves they pass through.
    fn find_wide(
        &mut self,
        field: &LevelSet,
        across: &CrossLeafMerges,
        progress: &dyn Progress,
    ) -> Result<()> {
        if self.unknown.is_empty() && self.passing.is_empty() {
            return Ok(());
        }
        self.wide.values_mut().flatten().for_each(|triangle| triangle.is_fresh = false);
        let unknown = std::mem::take(&mut self.unknown);
        progress.phase("flat parts", Some(unknown.len() as u64), "bricks");
        let this = &*self;
        let make = |n: u32| {
            let leaf = unknown[n as usize];
            let mut found = Vec::new();
            let mut find = |wanted: EdgeFilter, is_fresh: bool| -> Result<()> {
                let made = LeafTriangles::of(field, leaf, across, &EdgeFilter { only_wide: true, ..wanted })?;
                found.extend(made.wide().map(|(corners, merges)| {
                    let leaves = leaves_passed(field, &corners);
                    WideTriangle { corners, merges, is_fresh, leaves }
                }));
                Ok(())
            };
            match this.fresh_edges(field, leaf) {
                None => find(EdgeFilter::default(), true)?,
                Some(fresh) => {
                    find(EdgeFilter { within: Some(&fresh), ..EdgeFilter::default() }, true)?;
                    find(EdgeFilter { except: &fresh, ..EdgeFilter::default() }, false)?;
                }
            }
            Ok((leaf, found))
        };
        let (mut asked, mut found) = (Vec::new(), Vec::new());
        in_order(unknown.len(), progress, make, |(leaf, wide): (u32, Vec<WideTriangle>)| {
            let fresh = wide.iter().filter(|triangle| triangle.is_fresh);
            asked.extend(fresh.flat_map(|triangle| triangle.leaves.iter().copied()));
            found.push((leaf, wide));
            Ok(())
        })?;
        self.wide.extend(found);
        self.asked.append(&mut asked);
        self.asked.sort_unstable();
        self.asked.dedup();
        self.passing.clear();
        for (leaf, wide) in &self.wide {
            for (n, triangle) in (0..).zip(wide) {
                triangle.leaves.iter().for_each(|met| self.passing.entry(*met).or_default().push((*leaf, n)));
            }
        }
        Ok(())
    }

    /// What is to be given up for triangles that meet in the cube of a leaf, or for being where a vertex of the leaf is that
    /// stays as it was.
    fn of_leaf(&self, field: &LevelSet, across: &CrossLeafMerges, leaf: u32) -> Result<LeafIntersections> {
        let mut seen = LeafIntersections { leaf, taken: Vec::new(), has_moved: false, largest: 0 };
        if let Some(merged) = field.vertices(leaf)?.what_is_merged() {
            seen.has_moved = merged.has_moved;
            seen.taken.extend(merged.crowding.iter().map(|wide| MergeTarget::Wide(*wide)));
            seen.largest = merged.candidates.iter().map(|(_, node)| node.level).max().unwrap_or(0);
        }
        if !self.intersection_free {
            return Ok(seen);
        }
        let near = with_those_around(field, &[leaf]);
        let cube = cube(field, leaf);
        let passing = self.passing.get(&leaf).into_iter().flatten();
        let passing: Vec<&WideTriangle> = passing.map(|(leaf, n)| &self.wide[leaf][*n as usize]).collect();
        let room = match &self.fresh {
            None => Some(whole_room(field, across, leaf, (&near, cube))?),
            Some(_) => self.fresh_room(field, across, leaf, (&near, cube), &passing)?,
        };
        if let Some(mut room) = room {
            for triangle in passing {
                let own = bounds(&triangle.corners);
                if room.wants(&own) {
                    let number = |n: usize| room.number(triangle.corners[n], triangle.merges[n]);
                    let corners = [0, 1, 2].map(number);
                    room.add(corners, &own, None, triangle.is_fresh);
                }
            }
            seen.taken.extend(room.meetings());
        }
        Ok(seen)
    }

    /// The fresh triangles in the cube of a leaf, `near` which these are, and what may meet them, but for the triangles at
    /// vertices of several leaves. `None` if there are no fresh ones.
    fn fresh_room(
        &self,
        field: &LevelSet,
        across: &CrossLeafMerges,
        leaf: u32,
        (near, cube): (&[u32], Bounds),
        passing: &[&WideTriangle],
    ) -> Result<Option<TriangleGrid>> {
        let mut fresh: HashMap<u32, (Vec<EdgeBox>, LeafTriangles)> = HashMap::new();
        for &other in near {
            let mut boxes = self.fresh_edges(field, other).unwrap_or_default();
            if other != leaf {
                let beside = EdgesNear::of(field, other).within(&cube, 1);
                boxes = boxes.iter().filter_map(|own| common(own, beside.as_ref()?)).collect();
            }
            if !boxes.is_empty() {
                let wanted = EdgeFilter { within: Some(&boxes), ..EdgeFilter::default() };
                let made = LeafTriangles::of(field, other, across, &wanted)?;
                fresh.insert(other, (boxes, made));
            }
        }
        let wide = passing.iter().filter(|triangle| triangle.is_fresh).map(|wide| bounds(&wide.corners));
        let all = wide.chain(fresh.values().flat_map(|(_, made)| made.boxes()));
        let reach = gathered(all.filter_map(|own| clipped(&own, &cube)));
        if reach.is_empty() {
            return Ok(None);
        }
        let mut room = TriangleGrid::new(cube, reach.clone());
        let large = self.large_nodes(field, near, &reach)?;
        for &other in near {
            let except = fresh.get(&other).map_or(&[][..], |(boxes, _)| boxes);
            let within = edges_reaching(field, other, &reach, &large);
            if !within.is_empty() {
                let wanted = EdgeFilter { within: Some(&within), except, ..EdgeFilter::default() };
                LeafTriangles::of(field, other, across, &wanted)?.add_to(&mut room, false);
            }
        }
        fresh.values().for_each(|(_, made)| made.add_to(&mut room, true));
        Ok(Some(room))
    }

    /// Boxes around the large nodes of single leaves whose triangles may come as far as one of some boxes: no farther from
    /// the node than it is wide.
    fn large_nodes(&self, field: &LevelSet, near: &[u32], reach: &[Bounds]) -> Result<Vec<Bounds>> {
        let mut found = Vec::new();
        for &leaf in near.iter().filter(|leaf| self.largest[**leaf as usize] >= LARGE) {
            let frame = field.frame(field.leaves.get(leaf).key);
            let reaches = |low: [f64; 3], size: f64, far: f64| {
                let reached = around(&frame, low, size, far);
                let is_met = reach.iter().any(|one| meets(one, &reached));
                is_met.then(|| around(&frame, low, size, 0.0))
            };
            let far = f64::from(1u32 << self.largest[leaf as usize]) + 1.0;
            if reaches([0.0; 3], BRICK_CELLS as f64, far).is_none() {
                continue;
            }
            let vertices = field.vertices(leaf)?;
            let nodes = vertices.what_is_merged().into_iter().flat_map(|merged| &merged.candidates);
            let large = nodes.filter(|(_, node)| node.level >= LARGE);
            found.extend(large.filter_map(|(_, node)| {
                reaches(node.corner().map(|c| c as f64), node.size(), node.size() + 1.0)
            }));
        }
        Ok(found)
    }
}

/// All triangles in the cube of a leaf, `near` which these are, but for those at vertices of several leaves.
fn whole_room(
    field: &LevelSet,
    across: &CrossLeafMerges,
    leaf: u32,
    (near, cube): (&[u32], Bounds),
) -> Result<TriangleGrid> {
    let mut room = TriangleGrid::new(cube, vec![cube]);
    for &other in near {
        let wanted = match other == leaf {
            true => Some((None, None)),
            false => edges_beside(field, across, (leaf, &cube), other)
                .map(|(near, touching)| (Some(near), touching)),
        };
        if let Some((within, touching)) = wanted {
            let wanted = EdgeFilter { within: within.as_deref(), touching, ..EdgeFilter::default() };
            LeafTriangles::of(field, other, across, &wanted)?.add_to(&mut room, true);
        }
    }
    Ok(room)
}

/// Tells the leaves that a box meets of it.
fn add_fresh(field: &LevelSet, fresh: &mut HashMap<u32, Vec<Bounds>>, own: Bounds) {
    for leaf in leaves_met(field, |cube| meets(&own, cube)) {
        fresh.entry(leaf).or_default().push(own);
    }
}

/// Edges of a leaf about which are all its triangles that may meet one of some boxes, but for those at vertices of several
/// leaves; `large` as [`MeetingSearch::large_nodes`] finds them.
fn edges_reaching(field: &LevelSet, leaf: u32, reach: &[Bounds], large: &[Bounds]) -> Vec<EdgeBox> {
    let edges = EdgesNear::of(field, leaf);
    let beside = reach.iter().filter_map(|own| edges.within(own, LOOK));
    beside.chain(large.iter().filter_map(|own| edges.within(own, 0))).collect()
}

/// What of a box is within another.
fn clipped(own: &Bounds, cube: &Bounds) -> Option<Bounds> {
    let inside = |n: usize| std::array::from_fn(|a| own[n][a].clamp(cube[0][a], cube[1][a]));
    meets(own, cube).then(|| [inside(0), inside(1)])
}

/// The box in the world of a node of a leaf with this frame, `far` cells larger on each side; `low` is its lower corner.
fn around(frame: &CellFrame, low: [f64; 3], size: f64, far: f64) -> Bounds {
    [-far, size + far].map(|off| frame.world([0; 3], low.map(|c| c + off)))
}

/// The cube of a leaf, whose upper corner is the lower one of the leaf beyond it to the last bit.
fn cube(field: &LevelSet, leaf: u32) -> Bounds {
    field.frame(field.leaves.get(leaf).key).bounds()
}

/// Leaves and all that touch them, if only in a point; sorted.
fn with_those_around(field: &LevelSet, leaves: &[u32]) -> Vec<u32> {
    let mut found = Vec::new();
    for &leaf in leaves {
        let key = field.leaves.get(leaf).key;
        for n in (0..27).filter(|n| *n != 13) {
            field.leaves.touching(key, [n % 3, n / 3 % 3, n / 9].map(|c| c - 1), &mut found);
        }
        found.push(leaf);
    }
    found.sort_unstable();
    found.dedup();
    found
}

/// The leaves whose cubes a triangle may pass through.
fn leaves_passed(field: &LevelSet, corners: &TriangleCorners) -> Vec<u32> {
    let own = bounds(corners);
    let [a, b, c] = corners.map(wide);
    let normal = (b - a).cross(c - a);
    leaves_met(field, |cube| {
        let [low, high] = cube.map(wide);
        let reach = normal.abs().dot(high - low) * 0.5001;
        meets(&own, cube) && normal.dot((low + high) / 2.0 - a).abs() <= reach
    })
}

/// The leaves that something meets, which meets the cubes of all nodes above.
fn leaves_met(field: &LevelSet, is_met: impl Fn(&Bounds) -> bool) -> Vec<u32> {
    let mut found = Vec::new();
    let mut nodes = vec![NodeKey::ROOT];
    while let Some(node) = nodes.pop() {
        if !is_met(&field.frame(node).bounds()) {
            continue;
        }
        let leaf = field.leaves.covering(node);
        match field.leaves.get(leaf).key.level() <= node.level() {
            true => found.push(leaf),
            false => nodes.extend(Octant::all().map(|octant| node.child(octant))),
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::contour::stages;
    use crate::contour::surface::IsoLevel;
    use crate::contour::tests::fields::{ImplicitField, SampledField, random_divide, tree};
    use crate::contour::tests::{noise, uniform};
    use crate::contour::{ContourOptions, LevelSet};
    use crate::progress::Silent;
    use crate::store::MemoryTree;
    use brickfield_core::sweep::part_or_all;

    /// Boxes of the triangles that meet a box, but for those at vertices of several leaves, sorted by their bits.
    fn boxes(field: &LevelSet, leaf: u32, wanted: &EdgeFilter, cube: &Bounds) -> Vec<[u32; 6]> {
        let made = LeafTriangles::of(field, leaf, field.across().unwrap(), wanted).unwrap();
        let bits = |own: Bounds| {
            let mut bits = [0; 6];
            bits.iter_mut().zip(own.as_flattened()).for_each(|(bits, c)| *bits = c.to_bits());
            bits
        };
        let mut found: Vec<[u32; 6]> = made.boxes().filter(|own| meets(own, cube)).map(bits).collect();
        found.sort_unstable();
        found
    }

    /// Compares what is found about the edges that are asked with what a leaf has; returns how many triangles reach into
    /// the cubes of other leaves, and into small boxes from outside.
    fn misses_nothing(tree: &MemoryTree, tolerance: f64, follow_creases: bool) -> [usize; 2] {
        let options = ContourOptions { tolerance, follow_creases, ..ContourOptions::default() };
        let mut field = stages::field(tree, IsoLevel { threshold: 1, iso: 0.5 }, &options).unwrap();
        stages::merge_across(&mut field, false, &Silent).unwrap();
        let mut search = MeetingSearch::new(&field, field.across().unwrap(), true);
        assert_eq!(search.next(&field, &Silent).unwrap(), []);
        let (mut beside, mut small) = (0, 0);
        for leaf in 0..field.leaves.len() as u32 {
            let (near, cube) = (with_those_around(&field, &[leaf]), cube(&field, leaf));
            let [low, high] = cube;
            // A cell or so wide.
            let at =
                |n: u32, a: usize| low[a] + (high[a] - low[a]) * ((leaf * 7 + n * 11) % 31) as f32 / 32.0;
            let reach = [0, 1, 2].map(|n| -> Bounds {
                let first = std::array::from_fn(|a| at(n + a as u32, a));
                [first, std::array::from_fn(|a| first[a] + (high[a] - low[a]) / 32.0)]
            });
            let large = search.large_nodes(&field, &near, &reach).unwrap();
            for &other in &near {
                let all = EdgeFilter::default();
                if other != leaf {
                    let across = field.across().unwrap();
                    let (near, touching) =
                        edges_beside(&field, across, (leaf, &cube), other).unwrap_or_default();
                    let found =
                        boxes(&field, other, &EdgeFilter { within: Some(&near), touching, ..all }, &cube);
                    assert_eq!(found, boxes(&field, other, &all, &cube));
                    beside += found.len();
                }
                let within = edges_reaching(&field, other, &reach, &large);
                for one in &reach {
                    let found = boxes(&field, other, &EdgeFilter { within: Some(&within), ..all }, one);
                    assert_eq!(found, boxes(&field, other, &all, one));
                    small += found.len();
                }
            }
        }
        [beside, small]
    }

    #[test]
    fn triangles_are_found_by_their_edges() {
        let ball = |radius: f64| {
            ImplicitField(move |p: [f64; 3]| p.iter().map(|c| c * c).sum::<f64>().sqrt() - radius)
        };
        let mut all = [0; 2];
        let mut look = |shape: &dyn SampledField, divide: &dyn Fn(NodeKey) -> bool, tolerance: f64| {
            let tree = tree(shape, divide);
            for follow_creases in [false, true] {
                let found = misses_nothing(&tree, tolerance, follow_creases);
                all.iter_mut().zip(found).for_each(|(all, found)| *all += found);
            }
        };
        look(&ball(5.5), &uniform(1), 0.2);
        for seed in part_or_all(1..2, 0..3) {
            look(&noise(seed, 1, 4, 40 + 60 * seed, 4.0), &random_divide(seed, (1, 3), 90), 0.3);
        }
        assert!(all[0] > part_or_all(4000, 10_000) && all[1] > part_or_all(40, 100), "{all:?}");
    }
}
