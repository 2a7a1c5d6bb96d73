//! Is the soup closed? Every directed edge must be cancelled by its reverse.
//!
//! Σ over directed edges of ±hash(edge) mod 2^64, the sign by direction, is zero for closed input and
//! streams at memory speed. Where it is not zero, the edges themselves are matched, bucket by bucket
//! (`open/boundary.rs`).

use crate::lattice::{Triangle, Units};

/// Running sum of signed edge hashes; sums of parts add up to the sum of the whole.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct EdgeBalance(u64);

impl EdgeBalance {
    /// Adds one triangle's three directed edges.
    #[inline]
    pub fn add(&mut self, t: &Triangle) {
        let h = t.map(vertex_hash);
        for i in 0..3 {
            self.0 = self.0.wrapping_add(edge_hash(h[i], h[(i + 1) % 3]));
        }
    }

    /// Adds another part's sum.
    pub fn merge(&mut self, other: EdgeBalance) {
        self.0 = self.0.wrapping_add(other.0);
    }

    /// True if every directed edge is cancelled; wrong with probability 2^-64.
    pub fn is_closed(self) -> bool {
        self.0 == 0
    }
}

/// Calls `edge` with each directed edge of some length, a hash that it shares with its reverse, and its signed hash.
#[inline]
pub(super) fn for_edges(t: &Triangle, mut edge: impl FnMut(Units, Units, u64, u64)) {
    let h = t.map(vertex_hash);
    for i in 0..3 {
        let j = (i + 1) % 3;
        if t[i] != t[j] {
            edge(t[i], t[j], h[i].wrapping_add(h[j]), edge_hash(h[i], h[j]));
        }
    }
}

/// Multiplies to 128 bits and folds (as wyhash does): every input bit reaches every output bit.
#[inline]
fn fold(a: u64, b: u64) -> u64 {
    let wide = u128::from(a) * u128::from(b);
    (wide as u64) ^ (wide >> 64) as u64
}

#[inline]
fn vertex_hash(p: Units) -> u64 {
    let low = p[0] as u32 as u64 | (p[1] as u32 as u64) << 32;
    fold(low ^ 0xa076_1d64_78bd_642f, (p[2] as u32 as u64) ^ 0xe703_7ed1_a0b4_28db)
}

/// Antisymmetric: the reverse edge has the negated hash, and an edge without length has 0.
#[inline]
fn edge_hash(a: u64, b: u64) -> u64 {
    let (low, high) = if a < b { (a, b) } else { (b, a) };
    let h = fold(low ^ 0x8ebc_6af0_9c88_c6e3, high ^ 0x5899_65cc_7537_4cc3);
    if a < b {
        h
    } else if a > b {
        h.wrapping_neg()
    } else {
        0
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn tetrahedron(at: i32) -> Vec<Triangle> {
        let p = [[0, 0, 0], [8, 0, 0], [0, 8, 0], [0, 0, 8]].map(|v: Units| v.map(|c| c + at));
        [[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]].map(|t| t.map(|i: usize| p[i])).to_vec()
    }

    fn balanced(soup: &[Triangle]) -> bool {
        let mut balance = EdgeBalance::default();
        soup.iter().for_each(|t| balance.add(t));
        balance.is_closed()
    }

    #[test]
    fn closed_flipped_and_degenerate_facets() {
        let mut soup = tetrahedron(0);
        soup.extend(tetrahedron(2));
        soup.push([[2, 2, 2], [2, 2, 2], [6, 6, 6]]);
        assert!(balanced(&soup));
        soup[1].swap(0, 1);
        assert!(!balanced(&soup));
    }

    proptest! {
        #[test]
        fn only_whole_pieces_balance(keep in prop::collection::vec(any::<bool>(), 40)) {
            let soup: Vec<Triangle> = (0..10).flat_map(|i| tetrahedron(20 * i)).collect();
            let kept: Vec<Triangle> = soup.iter().zip(&keep).filter(|(_, k)| **k).map(|(t, _)| *t).collect();
            let whole = keep.chunks(4).all(|c| c.iter().all(|k| *k == c[0]));
            prop_assert_eq!(balanced(&kept), whole);
        }
    }
}
