//! Node keys: where a brick stands in the octree.

use super::{BRICK_CELLS, MAX_LEVEL, ROOT_BITS, Units, spacing_bits};
use serde::{Deserialize, Serialize};
use std::fmt;

/// One of the eight children of a node: bit 0 is the upper half in x, bit 1 in y, bit 2 in z.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Octant(u8);

impl Octant {
    /// All eight, in Morton order.
    #[inline]
    pub fn all() -> impl Iterator<Item = Octant> {
        (0..8).map(Octant)
    }

    /// 0..8.
    #[inline]
    pub const fn index(self) -> usize {
        self.0 as usize
    }

    /// 0 or 1 along each axis.
    #[inline]
    pub const fn offset(self) -> [usize; 3] {
        [(self.0 & 1) as usize, (self.0 >> 1 & 1) as usize, (self.0 >> 2) as usize]
    }
}

/// A node of the octree as a locational code: a one bit followed by three bits a level (z, y, x from high
/// to low). Keys order by level first and along the Morton curve within a level.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(transparent)]
pub struct NodeKey(u64);

impl NodeKey {
    /// The root node, level 0.
    pub const ROOT: NodeKey = NodeKey(1);

    /// The node of `level` at brick coordinates `position`, each below 2^level; `None` outside the tree.
    #[inline]
    pub fn new(level: u8, position: [u32; 3]) -> Option<NodeKey> {
        if level > MAX_LEVEL || position.iter().any(|&p| p >> level != 0) {
            return None;
        }
        Some(NodeKey(1 << (3 * level as u32) | morton(position)))
    }

    /// Reads a code as stored in a file; `None` unless it is a node no deeper than [`MAX_LEVEL`].
    #[inline]
    pub fn from_code(code: u64) -> Option<NodeKey> {
        if code == 0 {
            return None;
        }
        let top = 63 - code.leading_zeros();
        (top.is_multiple_of(3) && top <= 3 * MAX_LEVEL as u32).then_some(NodeKey(code))
    }

    /// The code as stored in a file.
    #[inline]
    pub const fn code(self) -> u64 {
        self.0
    }

    /// 0 for the root.
    #[inline]
    pub const fn level(self) -> u8 {
        ((63 - self.0.leading_zeros()) / 3) as u8
    }

    /// Brick coordinates within the level.
    #[inline]
    pub fn position(self) -> [u32; 3] {
        let morton = self.0 ^ (1 << (3 * self.level() as u32));
        [compact(morton), compact(morton >> 1), compact(morton >> 2)]
    }

    /// `None` for the root.
    #[inline]
    pub fn parent(self) -> Option<NodeKey> {
        (self != NodeKey::ROOT).then_some(NodeKey(self.0 >> 3))
    }

    /// The ancestor at `level`, the node itself at its own level; `None` below it.
    #[inline]
    pub fn ancestor(self, level: u8) -> Option<NodeKey> {
        (level <= self.level()).then(|| NodeKey(self.0 >> (3 * (self.level() - level) as u32)))
    }

    /// Which child of its parent the node is.
    #[inline]
    pub const fn octant(self) -> Octant {
        Octant((self.0 & 7) as u8)
    }

    /// A child; only for nodes above [`MAX_LEVEL`].
    #[inline]
    pub fn child(self, octant: Octant) -> NodeKey {
        debug_assert!(self.level() < MAX_LEVEL);
        NodeKey(self.0 << 3 | octant.0 as u64)
    }

    /// The node of the same level `delta` bricks away; `None` outside the root.
    #[inline]
    pub fn neighbour(self, delta: [i32; 3]) -> Option<NodeKey> {
        let level = self.level();
        let mut position = self.position();
        for (p, d) in position.iter_mut().zip(delta) {
            *p = p.checked_add_signed(d)?;
        }
        NodeKey::new(level, position)
    }

    /// The node of [`MAX_LEVEL`] whose cells hold the lattice position `at`, counted from the root's first sample; `None`
    /// outside the root. [`NodeKey::ancestor`] gives those of other levels.
    #[inline]
    pub fn deepest_at(at: Units) -> Option<NodeKey> {
        let is_inside = at.iter().all(|&c| c >= 0 && c >> ROOT_BITS == 0);
        let position = at.map(|c| c as u32 >> (ROOT_BITS - u32::from(MAX_LEVEL)));
        if is_inside { NodeKey::new(MAX_LEVEL, position) } else { None }
    }

    /// As [`NodeKey::deepest_at`], for a position between lattice positions.
    #[inline]
    pub fn deepest_holding(from_first: [f64; 3]) -> Option<NodeKey> {
        let edge = f64::from(1u32 << ROOT_BITS);
        let is_inside = from_first.iter().all(|u| (0.0..edge).contains(u));
        if is_inside { NodeKey::deepest_at(from_first.map(|u| u as i32)) } else { None }
    }

    /// Lower corner in units; sample `i` along an axis is at `base + i·spacing + 1`.
    #[inline]
    pub fn base(self) -> Units {
        let shift = ROOT_BITS - self.level() as u32;
        self.position().map(|p| (p << shift) as i32)
    }

    /// log₂ of the sample spacing in units.
    #[inline]
    pub const fn spacing_bits(self) -> u32 {
        spacing_bits(self.level())
    }

    /// Index of the brick's first sample on its level's lattice, per axis.
    #[inline]
    pub fn first_sample(self) -> [u32; 3] {
        self.position().map(|p| p * BRICK_CELLS as u32)
    }

    /// The order of a depth-first walk that visits children before their parent.
    #[inline]
    pub fn post_order(self) -> (u64, std::cmp::Reverse<u8>) {
        let down = 3 * (MAX_LEVEL - self.level()) as u32;
        let last = (self.0 << down) | ((1u64 << down) - 1);
        (last, std::cmp::Reverse(self.level()))
    }
}

impl fmt::Debug for NodeKey {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [x, y, z] = self.position();
        write!(f, "L{}({x},{y},{z})", self.level())
    }
}

impl fmt::Display for NodeKey {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Debug::fmt(self, f)
    }
}

/// The Morton number of a position, of which each coordinate has 21 bits at most.
#[inline]
pub fn morton(position: [u32; 3]) -> u64 {
    let [x, y, z] = position.map(spread);
    x | y << 1 | z << 2
}

/// Spreads the low 21 bits of `v` so that two zero bits follow each: an axis's share of a Morton number.
#[inline]
fn spread(v: u32) -> u64 {
    let mut x = v as u64 & 0x1f_ffff;
    x = (x | x << 32) & 0x1f_0000_0000_ffff;
    x = (x | x << 16) & 0x1f_0000_ff00_00ff;
    x = (x | x << 8) & 0x100f_00f0_0f00_f00f;
    x = (x | x << 4) & 0x10c3_0c30_c30c_30c3;
    (x | x << 2) & 0x1249_2492_4924_9249
}

/// Inverse of [`spread`].
fn compact(v: u64) -> u32 {
    let mut x = v & 0x1249_2492_4924_9249;
    x = (x | x >> 2) & 0x10c3_0c30_c30c_30c3;
    x = (x | x >> 4) & 0x100f_00f0_0f00_f00f;
    x = (x | x >> 8) & 0x1f_0000_ff00_00ff;
    x = (x | x >> 16) & 0x1f_0000_0000_ffff;
    (x | x >> 32) as u32 & 0x1f_ffff
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn keys_round_trip(level in 0u8..=MAX_LEVEL, seed in any::<[u32; 3]>()) {
            let position = seed.map(|s| s & ((1u32 << level) - 1));
            let key = NodeKey::new(level, position).unwrap();
            prop_assert_eq!(key.level(), level);
            prop_assert_eq!(key.position(), position);
            prop_assert_eq!(NodeKey::from_code(key.code()), Some(key));
            if let Some(parent) = key.parent() {
                prop_assert_eq!(parent.child(key.octant()), key);
                prop_assert!(parent < key);
                prop_assert!(parent.post_order() > key.post_order());
            }
            for d in [[1, 0, 0], [0, -1, 0], [1, 1, -1]] {
                if let Some(n) = key.neighbour(d) {
                    prop_assert_eq!(n.neighbour(d.map(|v: i32| -v)), Some(key));
                }
            }
        }
    }

    #[test]
    fn hostile_codes_are_refused() {
        for code in [0, 2, 3, 4, 7, 1 << 51, u64::MAX] {
            assert_eq!(NodeKey::from_code(code), None, "{code}");
        }
        assert_eq!(NodeKey::new(1, [2, 0, 0]), None);
        assert_eq!(NodeKey::ROOT.neighbour([1, 0, 0]), None);
    }

    #[test]
    fn child_samples_nest_in_the_parent_lattice() {
        let parent = NodeKey::new(3, [5, 1, 7]).unwrap();
        for octant in Octant::all() {
            let child = parent.child(octant);
            for axis in 0..3 {
                let i = 6;
                let at_child = child.base()[axis] + ((2 * i) << child.spacing_bits()) + 1;
                let parent_index = 16 * octant.offset()[axis] as i32 + i;
                let at_parent = parent.base()[axis] + (parent_index << parent.spacing_bits()) + 1;
                assert_eq!(at_child, at_parent);
            }
        }
    }
}
