//! What labellings of a tree share while leaves come one by one: the border, and sets of what hangs together.

use crate::lattice::Axis;
use crate::store::LeafOrder;
use std::collections::{BTreeMap, HashMap};

/// A face of a leaf: its axis, and whether it is the upper one.
pub(super) type Face = (Axis, bool);

/// Leaves beyond whose faces others are still to come, with what is kept of each.
pub(super) struct Border<T> {
    waiting: HashMap<usize, T>,
    /// By leaf, those for which it is the last neighbour to come.
    leaving: BTreeMap<usize, Vec<usize>>,
    touching: Vec<usize>,
}

impl<T> Default for Border<T> {
    fn default() -> Border<T> {
        Border { waiting: HashMap::new(), leaving: BTreeMap::new(), touching: Vec::new() }
    }
}

impl<T> Border<T> {
    /// Takes the next leaf in Morton order. Calls `join` with each of its faces and a leaf across that has come before, or
    /// `None` where the root ends. The leaf stays while others across its faces are still to come.
    pub fn add(
        &mut self,
        order: &LeafOrder,
        leaf: usize,
        own: T,
        mut join: impl FnMut(&T, Face, Option<(usize, &T)>),
    ) {
        let mut last = leaf;
        for (axis, upper) in Axis::ALL.into_iter().flat_map(|axis| [(axis, false), (axis, true)]) {
            self.touching.clear();
            order.touching(leaf, axis, upper, &mut self.touching);
            if self.touching.is_empty() {
                join(&own, (axis, upper), None);
            }
            for &other in &self.touching {
                if other > leaf {
                    last = last.max(other);
                } else if let Some(there) = self.waiting.get(&other) {
                    // One that is missing has no neighbour to come, so it is none of this leaf.
                    join(&own, (axis, upper), Some((other, there)));
                }
            }
        }
        if last > leaf {
            self.leaving.entry(last).or_default().push(leaf);
            self.waiting.insert(leaf, own);
        }
        for done in self.leaving.remove(&leaf).into_iter().flatten() {
            self.waiting.remove(&done);
        }
    }
}

/// Disjoint sets of numbers, each known by its least one.
#[derive(Default)]
pub(super) struct Sets(Vec<u32>);

impl Sets {
    /// How many numbers there are.
    pub fn len(&self) -> usize {
        self.0.len()
    }

    /// Adds the next numbers, each a set of its own.
    pub fn extend(&mut self, count: usize) {
        let first = self.0.len() as u32;
        self.0.extend(first..first + count as u32);
    }

    /// The least number of the set that a number is in.
    pub fn find(&mut self, mut number: u32) -> u32 {
        while self.0[number as usize] != number {
            let above = self.0[self.0[number as usize] as usize];
            self.0[number as usize] = above;
            number = above;
        }
        number
    }

    /// Makes one set of two. Gives the least numbers of both, that of the whole first, if they were two.
    pub fn unite(&mut self, a: u32, b: u32) -> Option<(u32, u32)> {
        let (a, b) = (self.find(a), self.find(b));
        let (first, second) = (a.min(b), a.max(b));
        self.0[second as usize] = first;
        (first != second).then_some((first, second))
    }
}
