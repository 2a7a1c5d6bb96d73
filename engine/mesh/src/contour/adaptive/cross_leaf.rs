//! Merging across the borders of bricks: nodes of 64, 128, … cells, which are nodes of the tree above its leaves.
//!
//! One walk over the leaves in Morton order, before any vertex is numbered. A leaf hands its [`SurfaceDisk`]s to its parent:
//! the disks that meet its border as a plane may.
//!
//! A node whose eight children are done joins their parts where crossings on the planes between the children say so,
//! by the rules of [`super::patches`], and hands on what is a disk again.
//!
//! What is missing (it was no disk, met the border otherwise, is next to a leaf of another level, or has too many
//! normals) is as good as frozen, and so is what touches it.
//!
//! Only crossings on the border of a node are kept, so that what is in memory are those on the borders of up to seven
//! nodes a level, [`MOST_CROSSINGS`] a node at most, and what is found.
//!
//! What is found counts for all leaves that have a part of it, so they must agree whether it folds the surface
//! ([`super::foldovers`]). Further walks over these leaves collect what does, given what each leaf and the walk before
//! would merge. It is given up for what it is made of, until nothing folds or [`MOST_WALKS`] are done.

use super::super::frame::CellFrame;
use super::super::leaves::Leaves;
use super::edge::{ACROSS, Corner};
use super::leaf_candidates::LeafCandidates;
use super::merged_vertices::SharedVertex;
use super::out_of_cell::OutOfCellEdges;
use super::vertex_merge::{NONE, VertexMerge, bits};
use crate::lattice::{BRICK_CELLS, NodeKey, RootCube};
use std::collections::{BTreeSet, HashMap, HashSet};

/// A vertex that stands for vertices of several leaves.
pub(super) struct CrossLeafVertex {
    pub(super) node: NodeKey,
    /// The node is 2 to this power cells wide.
    pub(super) bits: u8,
    pub(super) position: [f32; 3],
    /// The one that stands for it if not given up, or [`NONE`].
    pub(super) up: u32,
    pub(super) is_barred: bool,
}

/// What is merged across the borders of leaves.
#[derive(Default)]
pub(in super::super) struct CrossLeafMerges {
    pub(super) all: Vec<CrossLeafVertex>,
    /// The smallest one that stands for each part of a leaf.
    pub(super) of_part: HashMap<(u32, u32), u32>,
    /// Leaf and number of those that are in the mesh.
    pub(super) places: Vec<[u32; 2]>,
    /// Normals of all, where they are wanted.
    pub(super) normals: Option<Vec<[f32; 3]>>,
    /// By leaf, those that it has as numbers in `all`, in the order of their numbers there.
    pub(super) numbered: HashMap<u32, Vec<u32>>,
    /// By leaf, those that stay in it or on its border, and where.
    pub(super) hosted: HashMap<u32, Vec<([f32; 3], u32)>>,
    /// Vertices outside the cubes of their leaves.
    pub(super) strays: OutOfCellEdges,
    /// By leaf, candidates that are given up beside those that its draft bars.
    pub(super) barred: HashMap<u32, BTreeSet<u32>>,
}

/// What stands for several vertices.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub(in super::super) enum MergeTarget {
    /// A leaf, and one of its candidates.
    Candidate(u32, u32),
    /// One of several leaves'.
    Wide(u32),
}

/// What stands for several vertices, and the level of its node.
pub(super) type Merge = (MergeTarget, u8);

/// Whether it stands for vertices of several leaves.
#[inline]
pub(super) fn is_wide(merge: Option<Merge>) -> bool {
    matches!(merge, Some((MergeTarget::Wide(_), _)))
}

impl CrossLeafMerges {
    /// The largest that stands for a part of a leaf and is not given up.
    fn of(&self, leaf: u32, part: u32) -> Option<u32> {
        let first = *self.of_part.get(&(leaf, part))?;
        self.chain(first).filter(|wide| !self.all[*wide as usize].is_barred).last()
    }

    /// One and all that stand for it.
    fn chain(&self, first: u32) -> impl Iterator<Item = u32> {
        std::iter::successors(Some(first).filter(|wide| *wide != NONE), |wide| {
            Some(self.all[*wide as usize].up).filter(|up| *up != NONE)
        })
    }

    /// The leaves with parts of those of several leaves, sorted.
    pub(in super::super) fn sharing(&self) -> Vec<u32> {
        let mut leaves: Vec<u32> = self.of_part.keys().map(|(leaf, _)| *leaf).collect();
        leaves.sort_unstable();
        leaves.dedup();
        leaves
    }

    /// The corner that stands for each part of a leaf; empty if there is none.
    pub(super) fn corners(&self, leaf: u32, draft: &LeafCandidates) -> Vec<Option<Corner>> {
        if self.all.is_empty() {
            return Vec::new();
        }
        let corner = |part| {
            let wide = self.of(leaf, part)?;
            let CrossLeafVertex { bits, position, .. } = self.all[wide as usize];
            Some(Corner { name: (ACROSS, true, wide), position, level: bits })
        };
        (0..draft.parts.len() as u32).map(corner).collect()
    }

    /// What the mesh has for one of several leaves.
    pub(super) fn shared(&self, wide: u32) -> SharedVertex {
        let [leaf, number] = self.places[wide as usize];
        SharedVertex {
            leaf,
            number,
            position: self.all[wide as usize].position,
            is_merged: true,
            is_wide: true,
        }
    }

    /// Those that a leaf has, in the order of their numbers there.
    pub(super) fn numbered(&self, leaf: u32) -> &[u32] {
        self.numbered.get(&leaf).map_or(&[], |all| all)
    }

    /// Positions of those that a leaf has.
    pub(super) fn owned(&self, leaf: u32) -> Vec<[f32; 3]> {
        self.numbered(leaf).iter().map(|number| self.all[*number as usize].position).collect()
    }

    /// Normals of those that a leaf has; none where they are not wanted.
    pub(in super::super) fn normals(&self, leaf: u32) -> Vec<[f32; 3]> {
        let Some(normals) = &self.normals else { return Vec::new() };
        self.numbered(leaf).iter().map(|number| normals[*number as usize]).collect()
    }

    /// Those that stay in a leaf or on its border, and where, so that no other vertex may be there.
    pub(super) fn hosted(&self, leaf: u32) -> &[([f32; 3], u32)] {
        self.hosted.get(&leaf).map_or(&[], |all| all)
    }

    /// The leaves that hold any of those or have them on their border, sorted.
    pub(super) fn hosting(&self) -> Vec<u32> {
        let mut found: Vec<u32> = self.hosted.keys().copied().collect();
        found.sort_unstable();
        found
    }

    /// Vertices outside the cubes of their leaves.
    pub(super) fn strays(&self) -> &OutOfCellEdges {
        &self.strays
    }

    /// Gives some up for what they are made of. Returns the leaves in which they stand for something, sorted.
    pub(super) fn bar(&mut self, taken: &[MergeTarget]) -> Vec<u32> {
        let mut changed = HashSet::new();
        let mut wide = HashSet::new();
        for taken in taken {
            match *taken {
                MergeTarget::Candidate(leaf, candidate) => {
                    self.barred.entry(leaf).or_default().insert(candidate);
                    changed.insert(leaf);
                }
                MergeTarget::Wide(number) => {
                    self.all[number as usize].is_barred = true;
                    wide.insert(number);
                }
            }
        }
        if !wide.is_empty() {
            let has_lost = |first: u32| self.chain(first).any(|number| wide.contains(&number));
            let lost = self.of_part.iter().filter(|(_, first)| has_lost(**first));
            changed.extend(lost.map(|((leaf, _), _)| *leaf));
        }
        let mut changed: Vec<u32> = changed.into_iter().collect();
        changed.sort_unstable();
        changed
    }

    /// Gives some up once all are numbered. Returns the leaves whose vertices may be others now, sorted.
    pub(in super::super) fn give_up(
        &mut self,
        (leaves, root): (&Leaves, RootCube),
        taken: &[MergeTarget],
    ) -> Vec<u32> {
        let mut changed = self.bar(taken);
        if taken.iter().any(|taken| matches!(taken, MergeTarget::Wide(_))) {
            let before = std::mem::take(&mut self.hosted);
            self.host(leaves, root);
            let after = &self.hosted;
            changed.extend(
                before.iter().filter(|(leaf, all)| after.get(leaf) != Some(all)).map(|(leaf, _)| *leaf),
            );
            changed.extend(after.keys().filter(|leaf| !before.contains_key(leaf)));
            changed.sort_unstable();
            changed.dedup();
        }
        changed
    }

    /// No more is given up.
    pub(in super::super) fn finish(&mut self) {
        self.number(true);
    }

    /// Which candidates of a leaf are given up, by number.
    pub(super) fn barred(&self, leaf: u32, draft: &LeafCandidates) -> Vec<bool> {
        let mut barred = draft.barred.clone();
        for candidate in self.barred.get(&leaf).into_iter().flatten() {
            barred[*candidate as usize] = true;
        }
        barred
    }

    /// What [`LeafCandidates::of_vertex`] is without what was given up; `None` if nothing was.
    pub(super) fn of_vertex(&self, leaf: u32, draft: &LeafCandidates, vertices: usize) -> Option<Vec<u32>> {
        let is_less = self.barred.contains_key(&leaf);
        is_less.then(|| draft.assigned(&self.barred(leaf, draft), vertices))
    }

    /// What each of the vertices of a leaf's cells becomes.
    pub(super) fn names(&self, leaf: u32, draft: &LeafCandidates, vertices: usize) -> Vec<VertexMerge> {
        let wide: Vec<Option<u32>> = match self.all.is_empty() {
            true => Vec::new(),
            false => (0..draft.parts.len() as u32).map(|part| self.of(leaf, part)).collect(),
        };
        let less = self.of_vertex(leaf, draft, vertices);
        let of_vertex = less.as_ref().unwrap_or(&draft.of_vertex);
        let name = |vertex: u32| match draft.part_of(vertex).and_then(|part| *wide.get(part)?) {
            Some(wide) => VertexMerge::Wide(wide),
            None if of_vertex[vertex as usize] == NONE => VertexMerge::Own,
            None => VertexMerge::Candidate(of_vertex[vertex as usize]),
        };
        (0..vertices as u32).map(name).collect()
    }

    /// The vertex of several leaves that has a number in a leaf, and the level of its node. Where nothing is merged any more,
    /// those that are given up have no numbers.
    pub(super) fn taken(&self, numbered: &[u32], number: u32) -> Option<(MergeTarget, u8)> {
        let wide = *numbered.get(number as usize)?;
        let CrossLeafVertex { bits, is_barred, .. } = self.all[wide as usize];
        (!is_barred).then_some((MergeTarget::Wide(wide), bits))
    }

    /// World coordinates of the node of one of several leaves, and the size of a cell there.
    pub(super) fn node(&self, root: RootCube, wide: u32) -> ([[f32; 3]; 2], f64) {
        let CrossLeafVertex { node, bits, .. } = self.all[wide as usize];
        let spacing = root.spacing(node.level()) * BRICK_CELLS as f64 / f64::from(1u32 << bits);
        (CellFrame::new(root, node).bounds(), spacing)
    }

    /// Two sheets of a wall may have theirs at the same place: moved by a step of coordinates, one is as good. Those that
    /// are made of others keep theirs.
    pub(super) fn tell_apart(&mut self) {
        let mut taken = HashSet::new();
        for wide in self.all.iter_mut().rev() {
            let mut axis = 0;
            while !taken.insert(bits(&wide.position)) {
                wide.position[axis] = wide.position[axis].next_up();
                axis = (axis + 1) % 3;
            }
        }
    }

    /// The parts of leaves, in order, with the smallest that stands for each.
    fn parts(&self) -> Vec<((u32, u32), u32)> {
        let mut parts: Vec<_> = self.of_part.iter().map(|(part, first)| (*part, *first)).collect();
        parts.sort_unstable();
        parts
    }

    /// Gives each to the first leaf in which it stands for something, where they come before other vertices in the order
    /// in which they were found: in the end those that stay, before that all, so that numbers do not change with what is
    /// given up.
    pub(super) fn number(&mut self, only_staying: bool) {
        self.places = vec![[NONE; 2]; self.all.len()];
        for ((leaf, part), first) in self.parts() {
            let staying = self.of(leaf, part);
            let all: Vec<u32> =
                self.chain(first).filter(|wide| !only_staying || staying == Some(*wide)).collect();
            for wide in all {
                let place = &mut self.places[wide as usize][0];
                *place = (*place).min(leaf);
            }
        }
        self.numbered.clear();
        for (number, place) in (0..).zip(&mut self.places) {
            if place[0] != NONE {
                let owned = self.numbered.entry(place[0]).or_default();
                place[1] = owned.len() as u32;
                owned.push(number);
            }
        }
    }

    /// Finds the leaves in which those that stay are.
    pub(super) fn host(&mut self, leaves: &Leaves, root: RootCube) {
        let staying: BTreeSet<u32> =
            self.of_part.keys().filter_map(|(leaf, part)| self.of(*leaf, *part)).collect();
        self.hosted.clear();
        for wide in staying {
            let position = self.all[wide as usize].position;
            for leaf in leaves_at((leaves, root), position) {
                self.hosted.entry(leaf).or_default().push((position, wide));
            }
        }
    }
}

/// The leaves that hold a place of the world, with those on whose border it is.
fn leaves_at((leaves, root): (&Leaves, RootCube), position: [f32; 3]) -> Vec<u32> {
    let mut found = Vec::new();
    for corner in 0..8 {
        // Twice the step of coordinates: what is as near as this may be the same.
        let near = std::array::from_fn(|a| {
            let c = if corner >> a & 1 == 1 { position[a].next_up() } else { position[a].next_down() };
            f64::from(c)
        });
        let from_first = root.from_first_sample(near);
        found.extend(NodeKey::deepest_holding(from_first).map(|key| leaves.covering(key)));
    }
    found.sort_unstable();
    found.dedup();
    found
}
