//! Splats in five words each.

use crate::bsp::{Cell, Clip, NodeCells, Splat, SplatTree, PAIRS};

/// A splat: x and y of its cell; z, level, and which cuts are of edges that go in; normal and offset; those of up to two splats
/// that cut it, or 0.
pub type PackedSplat = [u32; 5];

/// The splats of a level, or of the finest cells that are there where these are coarser.
///
/// `has_below` tells whether the cells of the next level were read for a node, by its key and level.
pub fn packed_splats(
    tree: &SplatTree,
    level: u32,
    has_below: impl Fn(u64, u32) -> bool,
    output: &mut Vec<PackedSplat>,
) {
    output.clear();
    for (&key, piece) in tree.pieces() {
        let of_level = (63 - key.leading_zeros()) / 3;
        if of_level > level {
            break;
        }
        let is_last = of_level == level || !has_below(key, of_level);
        for cell in piece.cells.iter().filter(|cell| is_last || !cell.divided) {
            put(output, key, of_level, piece, cell);
        }
    }
}

fn put(output: &mut Vec<PackedSplat>, key: u64, level: u32, piece: &NodeCells<Splat>, cell: &Cell) {
    let mut at = cell.at.map(u32::from);
    for bit in 0..level {
        for (axis, place) in at.iter_mut().enumerate() {
            *place += ((key >> (3 * bit) >> axis & 1) as u32) << (5 + bit);
        }
    }
    let splats = piece.of(cell);
    for n in 0..splats.len() {
        let (mut cuts, mut count, mut inward) = ([0; 2], 0, 0);
        for (pair, ends) in PAIRS.iter().enumerate().filter(|(_, ends)| ends[1] < splats.len()) {
            let other = match ends {
                [a, b] if *a == n => *b,
                [a, b] if *b == n => *a,
                _ => continue,
            };
            let clip = cell.clip(pair);
            if clip != Clip::None && count < 2 {
                cuts[count] = packed(&splats[other]);
                inward |= u32::from(clip == Clip::Concave) << count;
                count += 1;
            }
        }
        output.push([
            at[0] & 0xffff | at[1] << 16,
            at[2] & 0xffff | level << 16 | inward << 24,
            packed(&splats[n]),
            cuts[0],
            cuts[1],
        ]);
    }
}

fn packed(splat: &Splat) -> u32 {
    let [x, y, z] = splat.normal.map(|c| u32::from(c as u8));
    x | y << 8 | z << 16 | u32::from(splat.offset as u8) << 24
}
