//! Is the soup closed? Every directed edge must be cancelled by its reverse.
//!
//! Every vertex is hashed to a vector of two 64-bit numbers, and the value of a directed edge is the determinant of
//! its two vectors mod 2^64: its reverse has the negated value.
//!
//! The sum over all edges is zero for closed input and streams at memory speed, since that of a triangle's edges takes
//! two multiplications and no branch. Where it is not zero, the edges themselves are matched, bucket by bucket
//! (`open/boundary.rs`).

use crate::lattice::{Triangle, Units};

/// Running sum of the values of directed edges; sums of parts add up to the sum of the whole.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct EdgeBalance(u64);

impl EdgeBalance {
    /// Adds one triangle's three directed edges.
    #[inline]
    pub fn add(&mut self, t: &Triangle) {
        // The determinants of the three edges add up to that of two differences.
        let [a, b, c] = t.map(|p| vector(vertex_hash(p)));
        let from_a = |p: [u64; 2]| [p[0].wrapping_sub(a[0]), p[1].wrapping_sub(a[1])];
        self.0 = self.0.wrapping_add(determinant(from_a(b), from_a(c)));
    }

    /// Adds another part's sum.
    pub fn merge(&mut self, other: EdgeBalance) {
        self.0 = self.0.wrapping_add(other.0);
    }

    /// True if every directed edge is cancelled; wrong with a probability of some 2^-63.
    pub fn is_closed(self) -> bool {
        self.0 == 0
    }
}

/// Calls `edge` with each directed edge of some length, a hash that it shares with its reverse, and its value.
#[inline]
pub(super) fn for_edges(t: &Triangle, mut edge: impl FnMut(Units, Units, u64, u64)) {
    let h = t.map(vertex_hash);
    for i in 0..3 {
        let j = (i + 1) % 3;
        if t[i] != t[j] {
            edge(t[i], t[j], h[i].wrapping_add(h[j]), determinant(vector(h[i]), vector(h[j])));
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

/// A hash and a second one of it. They must not follow from each other by a linear function, or determinants of
/// points on a line would vanish: hence the shift.
#[inline]
fn vector(hash: u64) -> [u64; 2] {
    [hash, (hash ^ (hash >> 29)).wrapping_mul(0x8ebc_6af0_9c88_c6e3)]
}

#[inline]
fn determinant(a: [u64; 2], b: [u64; 2]) -> u64 {
    a[0].wrapping_mul(b[1]).wrapping_sub(a[1].wrapping_mul(b[0]))
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

    #[test]
    fn an_edge_in_two_parts_is_open() {
        // The same flat surfaces, but for one edge that is whole on one side and in two parts on the other: along
        // any axis and none.
        for step in [[2, 0, 0], [0, 4, 0], [0, 0, 2], [2, 2, 2], [-6, 2, 0]] {
            for n in 1..50 {
                let at = |k: i32| [0, 1, 2].map(|a| 1000 + k * n * step[a]);
                let [a, b, c, top] = [at(0), at(1), at(2), [1000, 3000, 5000]];
                assert!(!balanced(&[[a, b, top], [b, c, top], [c, a, top]]), "{step:?} {n}");
                assert!(!balanced(&[[a, b, c]]));
                assert!(balanced(&[[a, c, top], [c, a, top]]));
            }
        }
    }

    proptest! {
        #[test]
        fn values_of_edges_add_up(soup in prop::collection::vec(any::<Triangle>(), 1..9)) {
            let (mut balance, mut sum) = (EdgeBalance::default(), 0u64);
            for t in &soup {
                balance.add(t);
                for_edges(t, |_, _, _, value| sum = sum.wrapping_add(value));
            }
            prop_assert_eq!(balance, EdgeBalance(sum));
        }

        #[test]
        fn only_whole_pieces_balance(keep in prop::collection::vec(any::<bool>(), 40)) {
            let soup: Vec<Triangle> = (0..10).flat_map(|i| tetrahedron(20 * i)).collect();
            let kept: Vec<Triangle> = soup.iter().zip(&keep).filter(|(_, k)| **k).map(|(t, _)| *t).collect();
            let whole = keep.chunks(4).all(|c| c.iter().all(|k| *k == c[0]));
            prop_assert_eq!(balanced(&kept), whole);
        }
    }
}
