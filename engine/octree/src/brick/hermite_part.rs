//! The Hermite part of a payload before LZ4: how a brick's edges are laid out as bytes.
//!
//! Offsets come as two byte planes. A brick has few distinct normals, one a facet at most, where its edges lie on
//! facets: then each edge has an index of one byte into a table of them, the *palette*.
//!
//! Of the pile of one million facets (`cargo bench --bench kernel`) that halves what LZ4 has to read, and takes a
//! ninth off the store. Bricks with more normals, as curved solids have them, keep whole words.

use super::{Hermite, HermiteEdge, OctNormal};
use crate::wide::{Simd, dispatch, level};

/// A Hermite edge with a normal of its own: two bytes of offset, four of normal.
pub(super) const EDGE_BYTES: usize = 6;
/// A Hermite edge with an index into the palette.
const INDEXED_BYTES: usize = 3;
/// A normal in the palette.
const NORMAL_BYTES: usize = 4;
/// Most normals that a byte tells apart.
const PALETTE_MAX: usize = 256;
/// Slots of the table in which normals are found, four times as many, so that most are found at once.
const SLOTS: usize = 4 * PALETTE_MAX;

/// The distinct normals of a brick in the order in which its edges have them.
pub(super) struct Palette {
    normals: Vec<u32>,
    /// By hash: a normal, and above it its index from 1; 0 for none.
    slots: Box<[u64; SLOTS]>,
}

impl Default for Palette {
    fn default() -> Palette {
        Palette { normals: Vec::with_capacity(PALETTE_MAX), slots: Box::new([0; SLOTS]) }
    }
}

impl Palette {
    /// Takes the normals of the edges and gives each edge's index; false if there are too many.
    fn index(&mut self, hermite: &Hermite, indices: &mut [u8]) -> bool {
        self.normals.clear();
        self.slots.fill(0);
        let mut rest = indices;
        hermite.edges.iter().all(|edges| {
            let (own, behind) = std::mem::take(&mut rest).split_at_mut(edges.len());
            rest = behind;
            own.iter_mut().zip(edges).all(|(index, edge)| {
                let found = self.index_of(edge.normal.0);
                *index = found as u8;
                found < PALETTE_MAX
            })
        })
    }

    /// The index of a normal; [`PALETTE_MAX`] if it is one too many.
    #[inline(always)]
    fn index_of(&mut self, normal: u32) -> usize {
        let mut slot = slot_of(normal);
        loop {
            let taken = self.slots[slot];
            if taken as u32 == normal && taken != 0 {
                return (taken >> 32) as usize - 1;
            }
            if taken == 0 {
                return self.insert(slot, normal);
            }
            slot = (slot + 1) % SLOTS;
        }
    }

    #[cold]
    fn insert(&mut self, slot: usize, normal: u32) -> usize {
        let index = self.normals.len();
        if index < PALETTE_MAX {
            self.normals.push(normal);
            self.slots[slot] = (index as u64 + 1) << 32 | u64::from(normal);
        }
        index
    }
}

/// Where a normal is looked for: multiplied by 2^32 divided by the golden ratio, the high bits are spread best.
#[inline(always)]
fn slot_of(normal: u32) -> usize {
    (normal.wrapping_mul(0x9e37_79b9) >> (u32::BITS - SLOTS.trailing_zeros())) as usize
}

/// Lays the edges of the three axes out in `plain`: the offsets' low bytes, their high bytes, then the normals' indices
/// and the palette, or the normals as whole words, since neighbouring edges often lie on one facet. True if there is
/// a palette: where that is shorter and its indices fit a byte.
pub(super) fn to_plain(hermite: &Hermite, palette: &mut Palette, plain: &mut Vec<u8>) -> bool {
    let edges = hermite.len();
    plain.clear();
    plain.resize(edges * EDGE_BYTES, 0);
    dispatch!(level(), simd => fill_offsets(simd, hermite, plain));
    let normals = &mut plain[2 * edges..];
    let indexed = palette.index(hermite, &mut normals[..edges])
        && palette.normals.len() * NORMAL_BYTES + edges < edges * NORMAL_BYTES;
    if indexed {
        plain.truncate(edges * INDEXED_BYTES);
        plain.extend(palette.normals.iter().flat_map(|normal| normal.to_le_bytes()));
    } else {
        let words = normals.as_chunks_mut::<NORMAL_BYTES>().0;
        for (word, edge) in words.iter_mut().zip(hermite.edges.iter().flatten()) {
            *word = edge.normal.0.to_le_bytes();
        }
    }
    indexed
}

#[inline(always)]
fn fill_offsets<S: Simd>(_: S, hermite: &Hermite, plain: &mut [u8]) {
    let (mut low, mut high) = plain[..2 * hermite.len()].split_at_mut(hermite.len());
    for edges in &hermite.edges {
        let own;
        (own, low) = low.split_at_mut(edges.len());
        for (byte, edge) in own.iter_mut().zip(edges) {
            *byte = edge.offset as u8;
        }
        let own;
        (own, high) = high.split_at_mut(edges.len());
        for (byte, edge) in own.iter_mut().zip(edges) {
            *byte = (edge.offset >> 8) as u8;
        }
    }
}

/// Inverse of [`to_plain`], for so many edges along each axis; `None` if `part` is not of these.
pub(super) fn from_plain(part: &[u8], indexed: bool, counts: [usize; 3]) -> Option<Hermite> {
    let total = counts.iter().sum::<usize>();
    let (offsets, normals) = part.split_at_checked(2 * total)?;
    if total == 0 {
        return None;
    }
    if !indexed {
        let words = normals.as_chunks::<NORMAL_BYTES>().0;
        let fits = normals.len() == total * NORMAL_BYTES;
        return fits.then(|| join(offsets, counts, words, |word| u32::from_le_bytes(*word)));
    }
    let (indices, palette) = normals.split_at_checked(total)?;
    let (words, rest) = palette.as_chunks::<NORMAL_BYTES>();
    let largest = indices.iter().copied().max()?;
    if !rest.is_empty() || words.len() > PALETTE_MAX || usize::from(largest) >= words.len() {
        return None;
    }
    let mut table = [0; PALETTE_MAX];
    for (normal, word) in table.iter_mut().zip(words) {
        *normal = u32::from_le_bytes(*word);
    }
    Some(join(offsets, counts, indices, |index| table[usize::from(*index)]))
}

/// Edges from the two planes of their offsets, and what tells the normal of each.
#[inline(always)]
fn join<T>(offsets: &[u8], counts: [usize; 3], told: &[T], normal: impl Fn(&T) -> u32) -> Hermite {
    let (low, high) = offsets.split_at(offsets.len() / 2);
    let mut from = 0;
    let edges = counts.map(|count| {
        let range = from..from + count;
        from = range.end;
        // Slices of one length, so that no edge is asked whether it is there.
        let offsets = low[range.clone()].iter().zip(&high[range.clone()]);
        let edge = |((low, high), told): ((&u8, &u8), &T)| HermiteEdge {
            offset: u16::from_le_bytes([*low, *high]),
            normal: OctNormal(normal(told)),
        };
        offsets.zip(&told[range]).map(edge).collect()
    });
    Hermite { edges }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn with_normals(normals: &[u32], counts: [usize; 3]) -> Hermite {
        let mut all = normals
            .iter()
            .zip(0u16..)
            .map(|(&normal, i)| HermiteEdge { offset: i.wrapping_mul(40_503), normal: OctNormal(normal) });
        Hermite { edges: counts.map(|count| all.by_ref().take(count).collect()) }
    }

    /// The bytes, whether they have a palette, and the edges that come back.
    fn through_plain(hermite: &Hermite, palette: &mut Palette) -> (Vec<u8>, bool) {
        let mut plain = Vec::new();
        let indexed = to_plain(hermite, palette, &mut plain);
        let counts = hermite.edges.each_ref().map(Vec::len);
        assert_eq!(from_plain(&plain, indexed, counts).as_ref(), Some(hermite));
        (plain, indexed)
    }

    #[test]
    fn as_many_normals_as_a_byte_tells_apart_are_a_palette() {
        let mut palette = Palette::default();
        for (distinct, indexed) in [(1, true), (255, true), (256, true), (257, false)] {
            // Normals that begin at the same slot, the zero word, which is also what an empty slot looks like, among them.
            let alike = (0..u32::MAX).filter(|&n| slot_of(n) == 0).take(distinct);
            let normals: Vec<u32> = alike.cycle().take(1000).collect();
            let (plain, is_indexed) = through_plain(&with_normals(&normals, [500, 0, 500]), &mut palette);
            assert_eq!(is_indexed, indexed);
            assert_eq!(plain.len(), if indexed { 3000 + 4 * distinct } else { 6000 });
        }
    }

    #[test]
    fn the_palette_is_in_the_order_of_use() {
        let (plain, indexed) =
            through_plain(&with_normals(&[7, 7, 7, 0, 7, 0, 9, 7], [3, 4, 1]), &mut Palette::default());
        assert!(indexed);
        assert_eq!(plain[16..24], [0, 0, 0, 1, 0, 1, 2, 0]);
        assert_eq!(plain[24..], [7, 0, 0, 0, 0, 0, 0, 0, 9, 0, 0, 0]);
    }

    #[test]
    fn a_palette_that_is_no_shorter_is_not_used() {
        let mut palette = Palette::default();
        assert!(!through_plain(&with_normals(&[1, 2, 3, 3], [1, 2, 1]), &mut palette).1);
        assert!(through_plain(&with_normals(&[1, 2, 3, 3, 3], [1, 3, 1]), &mut palette).1);
    }

    #[test]
    fn parts_of_another_size_or_with_foreign_indices_are_refused() {
        let hermite = with_normals(&[5; 12], [4, 4, 4]);
        let (plain, indexed) = through_plain(&hermite, &mut Palette::default());
        assert!(indexed && from_plain(&plain, true, [4, 4, 3]).is_none());
        assert!((0..plain.len()).all(|end| from_plain(&plain[..end], true, [4, 4, 4]).is_none()));
        let mut foreign = plain.clone();
        foreign[24 + 5] = 1;
        assert!(from_plain(&foreign, true, [4, 4, 4]).is_none());
        foreign.extend([0; 4]);
        assert!(from_plain(&foreign, true, [4, 4, 4]).is_some());
        foreign.extend([0; 4 * 255]);
        assert!(from_plain(&foreign, true, [4, 4, 4]).is_none());
        assert!(from_plain(&[], true, [0; 3]).is_none() && from_plain(&[], false, [0; 3]).is_none());
    }

    proptest! {
        #[test]
        fn any_edges_come_back(normals in prop::collection::vec(0u32..400, 1..900), at in any::<[prop::sample::Index; 2]>()) {
            let mut cuts = at.map(|at| at.index(normals.len()));
            cuts.sort_unstable();
            let counts = [cuts[0], cuts[1] - cuts[0], normals.len() - cuts[1]];
            through_plain(&with_normals(&normals, counts), &mut Palette::default());
        }
    }
}
