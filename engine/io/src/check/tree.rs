//! A tree of boxes around triangles, for finding those that may meet.
//!
//! Triangles are divided at the median of their middles along the longest side, again and again, into leaves of eight.
//! So a far outlier costs nothing, and the tree's shape follows from their number alone: nothing but boxes is kept, in
//! pre-order, 6 bytes a triangle.

use super::CHUNK;
use rayon::prelude::*;

/// Triangles in a leaf: with two boxes of 24 bytes for each leaf, boxes take 6 bytes a triangle.
const LEAF: usize = 8;

/// Fewer triangles than this are divided by one thread.
const PARALLEL: usize = 1 << 13;

/// A box with f32 corners around one with f64 corners.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OuterBox {
    min: [f32; 3],
    max: [f32; 3],
}

impl OuterBox {
    const EMPTY: OuterBox = OuterBox { min: [f32::INFINITY; 3], max: [f32::NEG_INFINITY; 3] };

    /// Around points; coordinates are rounded outward.
    pub fn around(points: &[[f64; 3]]) -> OuterBox {
        let mut block = OuterBox::EMPTY;
        for point in points {
            for (a, &c) in point.iter().enumerate() {
                let near = c as f32;
                let low = if f64::from(near) > c { near.next_down() } else { near };
                let high = if f64::from(near) < c { near.next_up() } else { near };
                block.min[a] = block.min[a].min(low);
                block.max[a] = block.max[a].max(high);
            }
        }
        block
    }

    fn union(self, other: OuterBox) -> OuterBox {
        OuterBox {
            min: std::array::from_fn(|a| self.min[a].min(other.min[a])),
            max: std::array::from_fn(|a| self.max[a].max(other.max[a])),
        }
    }

    fn meets(&self, other: &OuterBox) -> bool {
        (0..3).all(|a| self.min[a] <= other.max[a] && other.min[a] <= self.max[a])
    }
}

/// A triangle before it has its place.
#[derive(Clone, Copy)]
struct Item {
    /// Twice the middle of its box; infinite only far out, where any order will do.
    middle: [f32; 3],
    face: u32,
}

/// The tree.
pub struct BoxTree {
    blocks: Vec<OuterBox>,
    /// Faces, leaf by leaf.
    faces: Vec<u32>,
}

impl BoxTree {
    /// Of these faces, in any order. `corners` gives the three points of a face, or any three with the same box around
    /// them.
    pub fn new(faces: Vec<u32>, corners: &(impl Fn(u32) -> [[f64; 3]; 3] + Sync)) -> BoxTree {
        let item = |face: u32| {
            let block = OuterBox::around(&corners(face));
            Item { middle: std::array::from_fn(|a| block.min[a] + block.max[a]), face }
        };
        let mut items: Vec<Item> = faces.into_par_iter().with_min_len(CHUNK).map(item).collect();
        let leaves = items.len().div_ceil(LEAF);
        let mut blocks = vec![OuterBox::EMPTY; (2 * leaves).saturating_sub(1)];
        if leaves > 0 {
            divide(corners, &mut items, &mut blocks);
        }
        BoxTree { blocks, faces: items.iter().map(|item| item.face).collect() }
    }

    /// Number of leaves.
    pub(super) fn leaves(&self) -> usize {
        self.faces.len().div_ceil(LEAF)
    }

    /// The faces in a leaf.
    pub(super) fn faces(&self, leaf: usize) -> &[u32] {
        &self.faces[leaf * LEAF..self.faces.len().min((leaf + 1) * LEAF)]
    }

    /// Calls `visit` with every leaf after `leaf` whose box meets that of `block`.
    pub(super) fn later_leaves(&self, leaf: usize, block: &OuterBox, visit: impl FnMut(usize)) {
        self.leaves_from(leaf + 1, block, visit);
    }

    /// Calls `visit` with every face of every leaf whose box meets that of `block`.
    pub fn for_near(&self, block: &OuterBox, mut visit: impl FnMut(u32)) {
        self.leaves_from(0, block, |leaf| self.faces(leaf).iter().for_each(|&face| visit(face)));
    }

    fn leaves_from(&self, begin: usize, block: &OuterBox, mut visit: impl FnMut(usize)) {
        // (Node, first leaf, leaves) of what is to be looked at.
        let mut stack = vec![(0, 0, self.leaves())];
        while let Some((node, first, leaves)) = stack.pop() {
            if first + leaves <= begin || !self.blocks[node].meets(block) {
                continue;
            }
            if leaves == 1 {
                visit(first);
                continue;
            }
            let left = leaves / 2;
            stack.push((node + 2 * left, first + left, leaves - left));
            stack.push((node + 1, first, left));
        }
    }

    /// The box around a leaf.
    pub(super) fn block(&self, corners: &impl Fn(u32) -> [[f64; 3]; 3], leaf: usize) -> OuterBox {
        around(corners, self.faces(leaf).iter().copied())
    }
}

fn around(corners: &impl Fn(u32) -> [[f64; 3]; 3], faces: impl Iterator<Item = u32>) -> OuterBox {
    faces.fold(OuterBox::EMPTY, |block, face| block.union(OuterBox::around(&corners(face))))
}

/// Sorts `items` into leaves and fills in the boxes of the node over them and of all below. The left half gets half of the
/// leaves, all full. Ties are broken by number, so which triangles are in a leaf is certain.
fn divide(corners: &(impl Fn(u32) -> [[f64; 3]; 3] + Sync), items: &mut [Item], blocks: &mut [OuterBox]) {
    let leaves = items.len().div_ceil(LEAF);
    if leaves == 1 {
        items.sort_unstable_by_key(|item| item.face);
        blocks[0] = around(corners, items.iter().map(|item| item.face));
        return;
    }
    let left = leaves / 2;
    let axis = longest(items);
    items.select_nth_unstable_by(left * LEAF, |a, b| {
        a.middle[axis].total_cmp(&b.middle[axis]).then(a.face.cmp(&b.face))
    });
    let is_large = items.len() >= PARALLEL;
    let (low, high) = items.split_at_mut(left * LEAF);
    let (own, below) = blocks.split_at_mut(1);
    let (low_blocks, high_blocks) = below.split_at_mut(2 * left - 1);
    if is_large {
        rayon::join(|| divide(corners, low, low_blocks), || divide(corners, high, high_blocks));
    } else {
        divide(corners, low, low_blocks);
        divide(corners, high, high_blocks);
    }
    own[0] = low_blocks[0].union(high_blocks[0]);
}

/// The axis along which the middles are spread most.
fn longest(items: &[Item]) -> usize {
    let mut spread = OuterBox::EMPTY;
    for item in items {
        spread = spread.union(OuterBox { min: item.middle, max: item.middle });
    }
    let side = |a: &usize| spread.max[*a] - spread.min[*a];
    [0, 1, 2].into_iter().max_by(|a, b| side(a).total_cmp(&side(b))).unwrap_or(0)
}
