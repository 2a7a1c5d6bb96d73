//! Where triangles at merged vertices meet others, and which vertices are given up for that.
//!
//! Triangles of polygons none of whose corners is merged are those of the mesh without a tolerance, which keep apart
//! ([`super::super::envelope`]). All others, also those without a merged corner of their own, are compared with what is
//! near them ([`super::room`]). Of a pair that meets elsewhere than in common corners the vertices of the largest nodes are
//! given up for what they are made of, and what has changed is compared again, until no pair is left. There is an end,
//! because each time something is given up, and if all were, the mesh would be the one without a tolerance. Which pairs
//! there are follows from the mesh alone, so no thread and no memory decides anything.
//!
//! A leaf looks at what is in its cube. A triangle lies between the leaves around the edge that it is for, since vertices
//! are off the borders of their nodes by more than a step of coordinates, so two that meet in a leaf belong to it or to
//! leaves that touch it. Only those at vertices of several leaves may lie elsewhere: they are kept in memory, and each
//! leaf is told which of them pass through it.
//!
//! What changes when a vertex is given up are the polygons with a corner in its node. Their edges lie in the node or on its
//! border, so they belong to leaves that meet it.

use super::super::field::Field;
use super::super::order::in_order;
use super::super::united;
use super::NONE;
use super::across::{Across, Taken};
use super::bounds::{Bounds, Corners, bounds, meets, wide};
use super::made::{Fresh, Kind, Made, Merge};
use super::room::Room;
use crate::error::Result;
use crate::lattice::{BRICK_CELLS, NodeKey, Octant};
use crate::progress::Progress;
use std::collections::{BTreeMap, HashMap, HashSet};
use std::sync::Arc;

/// A triangle at a vertex of several leaves.
struct WideTriangle {
    corners: Corners,
    merges: [Option<Merge>; 3],
    is_fresh: bool,
    /// The leaves through which it passes.
    leaves: Vec<u32>,
}

/// Looks for triangles that meet until there are none.
pub(in super::super) struct MeetingSearch {
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
    /// Leaves in which a vertex has made room for another one, so that all may change when one is given up.
    moved: HashSet<u32>,
}

impl MeetingSearch {
    /// All leaves are to be looked at.
    pub(in super::super) fn new(field: &Field, across: &Across) -> MeetingSearch {
        let asked = (0..field.leaves.len() as u32).collect();
        let unknown = with_those_around(field, &across.sharing());
        let (wide, passing) = (BTreeMap::new(), HashMap::new());
        MeetingSearch { asked, unknown, wide, passing, fresh: None, moved: HashSet::new() }
    }

    /// What is to be given up for the triangles that meet.
    pub(in super::super) fn next(&mut self, field: &Field, progress: &dyn Progress) -> Result<Vec<Taken>> {
        self.find_wide(field, progress)?;
        let mut found: Vec<Taken> = Vec::new();
        progress.phase("meetings", Some(self.asked.len() as u64), "bricks");
        let this = &*self;
        let make = |n: u32| this.of_leaf(field, this.asked[n as usize]);
        let mut moved = Vec::new();
        in_order(self.asked.len(), progress, make, |(taken, has_moved): (Vec<Taken>, Option<u32>)| {
            found.extend(taken);
            moved.extend(has_moved);
            Ok(())
        })?;
        self.moved.extend(moved);
        found.sort_unstable();
        found.dedup();
        Ok(found)
    }

    /// After some were given up: the vertices of the leaves `changed` are others now. What is not at a vertex in a node
    /// that was given up is as it was before.
    pub(in super::super) fn ask_again(
        &mut self,
        field: &Field,
        taken: &[Taken],
        changed: &[u32],
    ) -> Result<()> {
        field.forget(changed);
        let mut fresh: HashMap<u32, Vec<Bounds>> = HashMap::new();
        let mut add = |own: Bounds| {
            for leaf in leaves_met(field, |cube| meets(&own, cube)) {
                fresh.entry(leaf).or_default().push(own);
            }
        };
        for taken in taken {
            add(match *taken {
                Taken::Candidate(leaf, candidate) => {
                    let node = field.draft(leaf)?.candidates[candidate as usize].node;
                    let (low, size) = (node.corner.map(|c| c as f64), node.size());
                    let frame = field.frame(field.leaves.get(leaf).key);
                    // A vertex may stray into the next cell.
                    [-1.0, size + 1.0].map(|off| frame.world([0; 3], low.map(|c| c + off)))
                }
                Taken::Wide(wide) => {
                    let Some(([low, high], cell)) = field.across().map(|across| across.node(field, wide))
                    else {
                        continue;
                    };
                    [low.map(|c| (f64::from(c) - cell) as f32), high.map(|c| (f64::from(c) + cell) as f32)]
                }
            });
        }
        for &leaf in changed {
            if field.vertices(leaf)?.what_is_merged().is_some_and(|merged| merged.has_moved) {
                self.moved.insert(leaf);
            }
            if self.moved.contains(&leaf) {
                add(field.frame(field.leaves.get(leaf).key).bounds());
            }
        }
        self.asked = fresh.keys().copied().collect();
        self.asked.sort_unstable();
        field.forget(&self.asked);
        let sharing = field.across().map_or(Vec::new(), Across::sharing);
        let sharing = with_those_around(field, &sharing);
        self.unknown =
            self.asked.iter().copied().filter(|leaf| sharing.binary_search(leaf).is_ok()).collect();
        self.asked.iter().for_each(|leaf| drop(self.wide.remove(leaf)));
        self.fresh = Some(fresh);
        Ok(())
    }

    /// What is fresh of a leaf.
    fn fresh(&self, leaf: u32) -> Fresh<'_> {
        match &self.fresh {
            None => Fresh::All,
            Some(fresh) => fresh.get(&leaf).map_or(Fresh::None, |boxes| Fresh::In(boxes)),
        }
    }

    /// Finds the triangles at vertices of several leaves that are not known, and asks the leaves they pass through.
    fn find_wide(&mut self, field: &Field, progress: &dyn Progress) -> Result<()> {
        if self.unknown.is_empty() && self.passing.is_empty() {
            return Ok(());
        }
        self.wide.values_mut().flatten().for_each(|triangle| triangle.is_fresh = false);
        let unknown = std::mem::take(&mut self.unknown);
        progress.phase("flat parts", Some(unknown.len() as u64), "bricks");
        let this = &*self;
        let make = |n: u32| {
            let leaf = unknown[n as usize];
            let made = field.made(leaf, this.fresh(leaf))?;
            let triangle = |triangle: usize| {
                let corners = made.corners(triangle);
                let merges = made.triangles[triangle].map(|corner| made.merges[corner as usize]);
                let is_fresh = made.is_fresh(triangle, this.fresh(leaf));
                WideTriangle { corners, merges, is_fresh, leaves: leaves_passed(field, &corners) }
            };
            Ok((leaf, made.of_kind(Kind::Wide).map(triangle).collect()))
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
    /// stays as it was; and the leaf if a vertex of it has made room for another one.
    fn of_leaf(&self, field: &Field, leaf: u32) -> Result<(Vec<Taken>, Option<u32>)> {
        let near = with_those_around(field, &[leaf]);
        let made: Vec<(u32, Arc<Made>)> = near
            .iter()
            .map(|other| Ok((*other, field.made(*other, self.fresh(*other))?)))
            .collect::<Result<_>>()?;
        let own = made.iter().find(|(other, _)| *other == leaf).map(|(_, made)| made);
        let has_moved = own.filter(|own| own.has_moved).map(|_| leaf);
        let mut taken: Vec<Taken> =
            own.iter().flat_map(|own| &own.crowding).map(|wide| Taken::Wide(*wide)).collect();
        let passing = self.passing.get(&leaf).into_iter().flatten();
        let passing: Vec<&WideTriangle> = passing.map(|(leaf, n)| &self.wide[leaf][*n as usize]).collect();
        let cube = cube(field, leaf);
        let reach = match &self.fresh {
            None => Some(cube),
            Some(_) => self.reach(&made, &passing, &cube),
        };
        let Some(reach) = reach else { return Ok((taken, has_moved)) };
        let mut room = Room::new(cube, reach);
        for triangle in passing {
            if !room.wants(&bounds(&triangle.corners)) {
                continue;
            }
            let number = |n: usize| room.number(triangle.corners[n], triangle.merges[n]);
            let corners = [0, 1, 2].map(number);
            room.add(corners, None, triangle.is_fresh);
        }
        for (other, made) in &made {
            let (fresh, mut numbers) = (self.fresh(*other), vec![NONE; made.places.len()]);
            for n in kinds(*other == leaf).iter().flat_map(|kind| made.of_kind(*kind)) {
                if !room.wants(&bounds(&made.corners(n))) {
                    continue;
                }
                let mut corners = made.triangles[n];
                for corner in &mut corners {
                    let number = &mut numbers[*corner as usize];
                    if *number == NONE {
                        *number = room.number(made.places[*corner as usize], made.merges[*corner as usize]);
                    }
                    *corner = *number;
                }
                room.add(corners, made.lone(n), made.is_fresh(n, fresh));
            }
        }
        taken.extend(room.meetings());
        Ok((taken, has_moved))
    }

    /// A box around all fresh triangles that may meet a cube.
    fn reach(&self, made: &[(u32, Arc<Made>)], passing: &[&WideTriangle], cube: &Bounds) -> Option<Bounds> {
        let wide =
            passing.iter().filter(|triangle| triangle.is_fresh).map(|triangle| bounds(&triangle.corners));
        let of_leaf = |(other, made): &(u32, Arc<Made>)| {
            let fresh = self.fresh(*other);
            let all = match fresh {
                Fresh::None => 0..0,
                _ => 0..made.triangles.len(),
            };
            let own = all.filter(|n| made.is_fresh(*n, fresh)).map(|n| bounds(&made.corners(n)));
            own.filter(|own| meets(own, cube)).reduce(united)
        };
        wide.chain(made.iter().filter_map(of_leaf)).reduce(united)
    }
}

/// What is added to a cube of its own leaf's triangles, and of those around it.
fn kinds(is_own: bool) -> &'static [Kind] {
    match is_own {
        true => &[Kind::MergedOuter, Kind::Merged, Kind::PlainOuter, Kind::Plain],
        false => &[Kind::MergedOuter, Kind::PlainOuter],
    }
}

/// The cube of a leaf, whose upper corner is the lower one of the leaf beyond it to the last bit.
fn cube(field: &Field, leaf: u32) -> Bounds {
    let key = field.leaves.get(leaf).key;
    let width = f64::from(BRICK_CELLS as u32) * f64::from(1u32 << key.spacing_bits());
    // As [`super::super::field::Frame`] places a leaf.
    [0.0, width].map(|off| {
        let units = key.base().map(|c| f64::from(c) + off + 1.0);
        field.root.to_world(units).map(|c| c as f32)
    })
}

/// Leaves and all that touch them, if only in a point; sorted.
fn with_those_around(field: &Field, leaves: &[u32]) -> Vec<u32> {
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
fn leaves_passed(field: &Field, corners: &Corners) -> Vec<u32> {
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
fn leaves_met(field: &Field, is_met: impl Fn(&Bounds) -> bool) -> Vec<u32> {
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
