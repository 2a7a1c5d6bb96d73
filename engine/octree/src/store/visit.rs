//! The visitor: one walk over the leaves of a tree, on which analyses are built.
//!
//! Leaves come in Morton order. Threads decode them and make something of each; what was made is taken one by one in
//! that order, so that whoever takes it needs no lock and gives the same result for any number of threads.
//!
//! Uniform leaves are known from the index and not read. At most [`LEAVES_AHEAD`] leaves a thread are made ahead of
//! the one that is taken, and no brick outlives what is made of it, so memory is that of the things made.

use super::{BrickTree, Walk};
use crate::brick::Brick;
use crate::error::{Error, Result};
use crate::lattice::{Axis, MAX_LEVEL, NodeKey, Octant};
use crate::progress::Progress;
use crate::schedule::run_ordered;
use std::ops::Range;

/// Leaves that a thread takes at once: few enough to even out their cost.
const LEAVES_AT_ONCE: usize = 8;
/// Leaves a thread that are made ahead of the one that is taken.
pub const LEAVES_AHEAD: usize = 8 * LEAVES_AT_ONCE;

/// Families of eight leaves a thread that are made ahead of the one that is taken.
const SIBLINGS_AHEAD: usize = 4;

/// One leaf, as the visitor shows it.
#[derive(Clone, Copy, Debug)]
pub struct Leaf<'a> {
    /// Its place in the list that is visited.
    pub number: usize,
    /// Its key.
    pub key: NodeKey,
    /// Samples with apron and Hermite edges, or the one value of a uniform leaf.
    pub brick: &'a Brick,
}

/// All leaves of a tree in Morton order, found by place.
#[derive(Clone, Debug)]
pub struct LeafOrder {
    keys: Vec<NodeKey>,
    /// The code of each leaf's last descendant at the deepest level; ascending.
    last: Vec<u64>,
}

impl LeafOrder {
    /// The leaves of a tree.
    ///
    /// # Errors
    /// [`Error::Setting`] if they do not cover the root without gap and overlap.
    pub fn new(tree: &dyn BrickTree) -> Result<LeafOrder> {
        let is_leaf = |key: &NodeKey| tree.node(*key).is_some_and(|node| node.leaf);
        LeafOrder::of(tree.keys().into_iter().filter(is_leaf).collect())
    }

    /// Nodes in the place of leaves.
    ///
    /// # Errors
    /// [`Error::Setting`] if they do not cover the root without gap and overlap.
    pub fn of(mut keys: Vec<NodeKey>) -> Result<LeafOrder> {
        keys.sort_unstable_by_key(|key| key.post_order());
        let last = keys.iter().map(|key| key.post_order().0).collect();
        let order = LeafOrder { keys, last };
        order.check_cover()?;
        Ok(order)
    }

    fn check_cover(&self) -> Result<()> {
        let mut next = first_descendant(NodeKey::ROOT);
        for (key, &last) in self.keys.iter().zip(&self.last) {
            if first_descendant(*key) != next {
                return Err(broken(*key));
            }
            next = last + 1;
        }
        if next == NodeKey::ROOT.post_order().0 + 1 { Ok(()) } else { Err(broken(NodeKey::ROOT)) }
    }

    /// The leaves, in Morton order.
    pub fn keys(&self) -> &[NodeKey] {
        &self.keys
    }

    /// The leaf that covers a node, or the first of the leaves below the node.
    pub fn covering(&self, key: NodeKey) -> usize {
        let code = first_descendant(key);
        self.last.partition_point(|&last| last < code)
    }

    /// Adds the leaves across the lower or the upper face of a leaf, along an axis, whatever their levels, in Morton order;
    /// none where the root ends.
    pub fn touching(&self, leaf: usize, axis: Axis, upper: bool, found: &mut Vec<usize>) {
        if let Some(neighbour) = self.keys[leaf].neighbour(direction(axis, upper)) {
            self.descend(neighbour, axis, upper, found);
        }
    }

    fn descend(&self, node: NodeKey, axis: Axis, upper: bool, found: &mut Vec<usize>) {
        let leaf = self.covering(node);
        if self.keys[leaf].level() <= node.level() {
            found.push(leaf);
            return;
        }
        // A neighbour above touches with its lower children.
        let touches = |octant: &Octant| (octant.offset()[axis.index()] == 0) == upper;
        for octant in Octant::all().filter(touches) {
            self.descend(node.child(octant), axis, upper, found);
        }
    }
}

fn direction(axis: Axis, upper: bool) -> [i32; 3] {
    let mut direction = [0; 3];
    direction[axis.index()] = if upper { 1 } else { -1 };
    direction
}

/// Code of a node's first descendant at the deepest level.
fn first_descendant(key: NodeKey) -> u64 {
    key.code() << (3 * u32::from(MAX_LEVEL - key.level()))
}

fn broken(key: NodeKey) -> Error {
    Error::setting(
        format!("the tree contradicts itself at brick {key}"),
        "check the store with `brickfield verify` and build it again",
    )
}

/// Visits nodes of a tree in the order of `keys`: calls `make` for each on any thread, and `take` with what it gives, in
/// order, one at a time. Advances `progress`, whose phase is the caller's, by one a node.
///
/// # Errors
/// The first that reading, `make` or `take` give; [`Error::Interrupted`] when `progress` says so.
pub fn visit<T: Send>(
    tree: &dyn BrickTree,
    keys: &[NodeKey],
    progress: &dyn Progress,
    make: impl Fn(&Leaf<'_>) -> Result<T> + Sync,
    mut take: impl FnMut(usize, T) -> Result<()> + Send,
) -> Result<()> {
    let parts: Vec<Range<usize>> = (0..keys.len())
        .step_by(LEAVES_AT_ONCE)
        .map(|first| first..(first + LEAVES_AT_ONCE).min(keys.len()))
        .collect();
    let window = LEAVES_AHEAD / LEAVES_AT_ONCE;
    let join = |_: &[NodeKey], made| Ok(made);
    visit_parts(tree, keys, (&parts, window), progress, (make, join), |first, made: Vec<T>| {
        made.into_iter().enumerate().try_for_each(|(n, made)| take(first + n, made))
    })
}

/// Visits all leaves as [`visit`] does, but hands what `make` gives of eight leaves with one parent to `join` at once, on any
/// thread, and of every other leaf alone. `take` gets the number of the first of them, and what `join` gives.
///
/// # Errors
/// As [`visit`], and what `join` gives.
pub fn visit_siblings<T, U: Send>(
    tree: &dyn BrickTree,
    order: &LeafOrder,
    progress: &dyn Progress,
    make: impl Fn(&Leaf<'_>) -> Result<T> + Sync,
    join: impl Fn(&[NodeKey], Vec<T>) -> Result<U> + Sync,
    take: impl FnMut(usize, U) -> Result<()> + Send,
) -> Result<()> {
    let (keys, mut parts, mut at) = (order.keys(), Vec::new(), 0);
    while at < keys.len() {
        let is_whole = keys.get(at + 7).is_some_and(|last| {
            // Leaves between the first and the last child of a node are children of it.
            last.level() == keys[at].level() && last.parent() == keys[at].parent() && last.level() > 0
        });
        let count = if is_whole { 8 } else { 1 };
        parts.push(at..at + count);
        at += count;
    }
    visit_parts(tree, keys, (&parts, SIBLINGS_AHEAD), progress, (make, join), take)
}

/// Visits leaves part by part, with so many parts a thread ahead of the one that is taken.
fn visit_parts<T, U: Send>(
    tree: &dyn BrickTree,
    keys: &[NodeKey],
    (parts, window): (&[Range<usize>], usize),
    progress: &dyn Progress,
    (make, join): (impl Fn(&Leaf<'_>) -> Result<T> + Sync, impl Fn(&[NodeKey], Vec<T>) -> Result<U> + Sync),
    mut take: impl FnMut(usize, U) -> Result<()> + Send,
) -> Result<()> {
    let uniform = |number: usize| tree.node(keys[number]).and_then(|node| node.uniform());
    let walk = Walk::new(tree, keys.len(), |number| uniform(number).is_none().then(|| keys[number]));
    let one = |number: usize| {
        let key = keys[number];
        match uniform(number) {
            Some(w) => make(&Leaf { number, key, brick: &Brick::Uniform(w) }),
            None => make(&Leaf { number, key, brick: &*tree.brick_once(key)? }),
        }
    };
    let work = |(): &mut (), part: usize| {
        progress.check()?;
        let numbers = parts[part].clone();
        walk.at(numbers.start);
        let made = numbers.clone().map(one).collect::<Result<Vec<T>>>()?;
        Ok((part, join(&keys[numbers], made)?))
    };
    let take = |(part, made): (usize, U)| {
        progress.advance(parts[part].len() as u64);
        take(parts[part].start, made)
    };
    run_ordered(parts.len(), window * rayon::current_num_threads(), || (), work, take)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lattice::RootCube;
    use crate::progress::Silent;
    use crate::store::MemoryTree;

    /// A tree whose lowest corner is divided once more than the rest; the value of each leaf is its place in Morton order.
    fn uneven() -> MemoryTree {
        let mut tree = MemoryTree::new(RootCube { origin: [0.0; 3], edge: 1.0 });
        tree.insert(NodeKey::ROOT, false, Brick::Uniform(99));
        let mut next = 0;
        for octant in Octant::all() {
            let child = NodeKey::ROOT.child(octant);
            if octant.index() == 0 {
                tree.insert(child, false, Brick::Uniform(99));
                for octant in Octant::all() {
                    tree.insert(child.child(octant), true, Brick::Uniform(next));
                    next += 1;
                }
            } else {
                tree.insert(child, true, Brick::Uniform(next));
                next += 1;
            }
        }
        tree
    }

    #[test]
    fn leaves_come_in_morton_order_for_any_number_of_threads() {
        let tree = uneven();
        let order = LeafOrder::new(&tree).unwrap();
        for threads in [1, 2, 3, 8] {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            let mut seen = Vec::new();
            let make = |leaf: &Leaf<'_>| Ok((leaf.number, leaf.brick.sample([0; 3])));
            let take = |number, made| {
                seen.push((number, made));
                Ok(())
            };
            pool.install(|| visit(&tree, order.keys(), &Silent, make, take)).unwrap();
            assert_eq!(seen, (0..15).map(|n| (n, (n, n as i16))).collect::<Vec<_>>());
        }
    }

    #[test]
    fn families_come_at_once_and_other_leaves_alone() {
        let tree = uneven();
        let order = LeafOrder::new(&tree).unwrap();
        let mut seen = Vec::new();
        let join = |keys: &[NodeKey], made: Vec<i16>| Ok((keys.len(), made));
        let take = |first, joined| {
            seen.push((first, joined));
            Ok(())
        };
        visit_siblings(&tree, &order, &Silent, |leaf| Ok(leaf.brick.sample([0; 3])), join, take).unwrap();
        let mut expected = vec![(0, (8, (0..8).collect()))];
        expected.extend((8..15).map(|n| (n as usize, (1, vec![n]))));
        assert_eq!(seen, expected);
    }

    #[test]
    fn leaves_know_what_lies_across_their_faces() {
        let order = LeafOrder::new(&uneven()).unwrap();
        let touching = |leaf: usize, upper: bool| {
            let mut found = Vec::new();
            order.touching(leaf, Axis::X, upper, &mut found);
            found
        };
        assert_eq!(touching(0, false), [0usize; 0]);
        assert_eq!(touching(0, true), [1]);
        // The last small leaf in x, and the large one beside all of these.
        assert_eq!(touching(1, true), [8]);
        assert_eq!(touching(8, false), [1, 3, 5, 7]);
        assert_eq!(touching(8, true), [0usize; 0]);
    }

    #[test]
    fn a_tree_with_a_gap_is_refused() {
        let mut tree = MemoryTree::new(RootCube { origin: [0.0; 3], edge: 1.0 });
        tree.insert(NodeKey::ROOT.child(Octant::all().next().unwrap()), true, Brick::Uniform(0));
        let error = LeafOrder::new(&tree).unwrap_err().to_string();
        assert!(error.contains("contradicts itself"), "{error}");
    }

    #[test]
    fn the_first_error_ends_the_visit() {
        let tree = uneven();
        let order = LeafOrder::new(&tree).unwrap();
        let make = |leaf: &Leaf<'_>| {
            if leaf.number == 9 { Err(Error::setting("nine", "none")) } else { Ok(()) }
        };
        let error = visit(&tree, order.keys(), &Silent, make, |_, ()| Ok(())).unwrap_err();
        assert!(error.to_string().contains("nine"));
    }
}
