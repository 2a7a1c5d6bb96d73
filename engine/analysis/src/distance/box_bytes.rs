//! Trees of boxes as bytes of a temporary file: read again they need not be made again.

use super::boxes::{Block, Boxes, Lanes, Normals, WIDE, levels_over};

/// Bytes of a node's boxes, of its normals, and of the box around all.
const LANES_BYTES: usize = 6 * WIDE * 4;
const NORMALS_BYTES: usize = 7 * WIDE;
const WHOLE_BYTES: usize = 24;

impl Boxes {
    /// Appends the tree: the box around all, boxes, then normals.
    pub fn append_to(&self, bytes: &mut Vec<u8>) {
        self.whole().as_flattened().iter().for_each(|c| bytes.extend(c.to_le_bytes()));
        for Lanes { low, high } in &self.nodes {
            for row in low.iter().chain(high) {
                row.iter().for_each(|c| bytes.extend(c.to_le_bytes()));
            }
        }
        for Normals { low, high, thick } in &self.normals {
            low.iter().chain(high).for_each(|row| bytes.extend(row.map(|c| c as u8)));
            bytes.extend(thick);
        }
    }

    /// The tree with normals around so many things that [`Boxes::append_to`] gave; `None` if the bytes are not as many.
    pub fn of_bytes(things: usize, per_run: usize, bytes: &[u8]) -> Option<Boxes> {
        let (levels, nodes) = levels_over(things.div_ceil(per_run));
        let (whole, rest) = bytes.split_at_checked(WHOLE_BYTES)?;
        let (lanes, normals) = rest.split_at_checked(nodes * LANES_BYTES)?;
        if normals.len() != nodes * NORMALS_BYTES {
            return None;
        }
        let whole: Block = [0, 3].map(|n| [0, 1, 2].map(|a| number(whole, n + a)));
        let nodes = lanes.chunks_exact(LANES_BYTES).map(|bytes| {
            let row = |n: usize| std::array::from_fn(|slot| number(bytes, n * WIDE + slot));
            Lanes { low: [0, 1, 2].map(row), high: [3, 4, 5].map(row) }
        });
        let normals = normals.chunks_exact(NORMALS_BYTES).map(|bytes| {
            let row = |n: usize| std::array::from_fn(|slot| bytes[n * WIDE + slot] as i8);
            let thick = std::array::from_fn(|slot| bytes[6 * WIDE + slot]);
            Normals { low: [0, 1, 2].map(row), high: [3, 4, 5].map(row), thick }
        });
        let (nodes, normals) = (nodes.collect(), normals.collect());
        Some(Boxes { nodes, normals, levels, per_run, things, whole })
    }
}

/// The n-th number of some bytes.
pub(super) fn number(bytes: &[u8], n: usize) -> f32 {
    f32::from_le_bytes([bytes[4 * n], bytes[4 * n + 1], bytes[4 * n + 2], bytes[4 * n + 3]])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn boxes_come_back_from_their_bytes() {
        for count in [1usize, 7, 8, 9, 64, 65, 600] {
            let at = |n: usize, scale: f32| [0, 1, 2].map(|a| scale * ((n * 7 + a * 5) % 11) as f32);
            let block = |scale: f32| move |n: usize| [at(n, scale), at(n, scale).map(|c| c + scale)];
            let boxes = Boxes::new((0..count).map(block(0.5)), 1)
                .with_normals((0..count).map(block(0.05)))
                .with_slabs(|n| (block(0.5)(n).into_iter(), 0.1));
            let mut bytes = Vec::new();
            boxes.append_to(&mut bytes);
            let again = Boxes::of_bytes(count, 1, &bytes).unwrap();
            let mut bytes_again = Vec::new();
            again.append_to(&mut bytes_again);
            assert_eq!((bytes_again, again.levels, again.things), (bytes.clone(), boxes.levels, count));
            assert!(Boxes::of_bytes(count, 1, &bytes[1..]).is_none());
            assert!(Boxes::of_bytes(count + 8, 1, &bytes).is_none());
        }
    }
}
