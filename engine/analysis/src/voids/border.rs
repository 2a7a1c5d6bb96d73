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
