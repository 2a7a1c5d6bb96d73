//! A grid's tree: nodes of 32³, 16³, and leaves of 8³ voxels whose places in the file are known.

use super::cursor::Cursor;
use super::nodes::{InnerNode, NodeEntry};
use super::values::{Unpacker, ValueCoding};
use crate::error::Result;
use crate::import::grid::{GridBox, SampleSource};
use std::path::PathBuf;

/// Bits of a voxel's place in a leaf, a node of 16³ and one of 32³, per axis.
const LEAF_BITS: u32 = 3;
const LOWER_BITS: u32 = 7;
const UPPER_BITS: u32 = 12;
/// Voxels of a leaf along an axis.
const LEAF: i64 = 8;
/// Bytes of a mask of a leaf.
const LEAF_MASK: usize = 64;
/// The first sample has indices that are multiples of it, as bricks have: those of a store that was exported come back.
const STEP: i64 = 32;

/// A tree without its voxels.
pub(super) struct VdbTree {
    path: PathBuf,
    coding: ValueCoding,
    /// By place, in order: what the file has there.
    roots: Vec<([i32; 3], NodeEntry)>,
    uppers: Vec<InnerNode>,
    lowers: Vec<InnerNode>,
    /// Where leaves begin in the file.
    leaves: Vec<usize>,
    /// The first sample, and those behind the last.
    range: [[i64; 3]; 2],
}

/// The index of a node's place: x slowest.
fn place_of(voxel: [i64; 3], inner_bits: u32, outer_bits: u32) -> usize {
    let bits = outer_bits - inner_bits;
    voxel.iter().fold(0, |place, &c| place << bits | (c >> inner_bits & ((1 << bits) - 1)) as usize)
}

/// What lies between the place's first voxel and the node's.
fn offset_of(place: usize, inner_bits: u32, outer_bits: u32) -> [i64; 3] {
    let bits = outer_bits - inner_bits;
    std::array::from_fn(|a| ((place >> (bits * (2 - a as u32)) & ((1 << bits) - 1)) << inner_bits) as i64)
}

fn sum(a: [i64; 3], b: [i64; 3]) -> [i64; 3] {
    std::array::from_fn(|n| a[n] + b[n])
}

/// What was met so far of voxels that are not background.
struct Reached([[i64; 3]; 2]);

impl Reached {
    fn add(&mut self, first: [i64; 3], bits: u32) {
        let [low, high] = &mut self.0;
        for (a, c) in first.into_iter().enumerate() {
            low[a] = low[a].min(c);
            high[a] = high[a].max(c + (1 << bits));
        }
    }
}

impl VdbTree {
    /// Reads a tree at a place, of which the leaves' voxels begin at another.
    pub fn read(mut cursor: Cursor<'_>, voxels_at: usize, mut coding: ValueCoding) -> Result<VdbTree> {
        if cursor.word()? != 1 {
            return Err(cursor.damaged("has several buffers a grid"));
        }
        coding.background = coding.one(&mut cursor)?;
        let (tiles, children) = (cursor.word()?, cursor.word()?);
        let mut tree = VdbTree {
            path: cursor.path().to_owned(),
            coding,
            roots: Vec::new(),
            uppers: Vec::new(),
            lowers: Vec::new(),
            leaves: Vec::new(),
            range: [[0; 3]; 2],
        };
        let mut reached = Reached([[i64::MAX; 3], [i64::MIN; 3]]);
        for _ in 0..tiles {
            let place = root_place(&mut cursor)?;
            let value = coding.one(&mut cursor)?;
            cursor.skip(1)?;
            if value != coding.background {
                reached.add(place.map(i64::from), UPPER_BITS);
            }
            tree.roots.push((place, NodeEntry::Tile(value)));
        }
        let mut unpacker = Unpacker::default();
        for _ in 0..children {
            let place = root_place(&mut cursor)?;
            tree.roots.push((place, NodeEntry::Child(tree.uppers.len())));
            tree.read_upper(&mut cursor, place.map(i64::from), &mut unpacker, &mut reached)?;
        }
        tree.roots.sort_by_key(|(place, _)| *place);
        if tree.roots.windows(2).any(|pair| pair[0].0 == pair[1].0) {
            return Err(cursor.damaged("has two nodes in one place"));
        }
        tree.find_leaves(&mut cursor, voxels_at)?;
        let Reached([low, high]) = reached;
        if low[0] > high[0] {
            return Err(cursor.error("the grid holds nothing but its background", "choose another grid"));
        }
        // One sample of what lies outside behind the last, if there is room in the last brick.
        let end = |c: i64| if c % STEP == 0 { c } else { c + 1 };
        tree.range = [low.map(|c| c.div_euclid(STEP) * STEP), high.map(end)];
        Ok(tree)
    }

    fn read_upper(
        &mut self,
        cursor: &mut Cursor<'_>,
        first: [i64; 3],
        unpacker: &mut Unpacker,
        reached: &mut Reached,
    ) -> Result<()> {
        let mask_bytes = 1 << (3 * (UPPER_BITS - LOWER_BITS) - 3);
        let upper = InnerNode::read(cursor, mask_bytes, self.coding, self.lowers.len(), unpacker)?;
        for place in upper.reached(self.coding.background) {
            let at = sum(first, offset_of(place, LOWER_BITS, UPPER_BITS));
            if let NodeEntry::Tile(_) = upper.at(place) {
                reached.add(at, LOWER_BITS);
                continue;
            }
            let mask_bytes = 1 << (3 * (LOWER_BITS - LEAF_BITS) - 3);
            let lower = InnerNode::read(cursor, mask_bytes, self.coding, self.leaves.len(), unpacker)?;
            for place in lower.reached(self.coding.background) {
                reached.add(sum(at, offset_of(place, LEAF_BITS, LOWER_BITS)), LEAF_BITS);
            }
            for _ in lower.places() {
                cursor.skip(LEAF_MASK)?;
                self.leaves.push(0);
            }
            self.lowers.push(lower);
        }
        self.uppers.push(upper);
        Ok(())
    }

    /// Passes over all leaves once.
    fn find_leaves(&mut self, cursor: &mut Cursor<'_>, voxels_at: usize) -> Result<()> {
        cursor.go_to(voxels_at)?;
        for leaf in &mut self.leaves {
            *leaf = cursor.at();
            let mask = cursor.take(LEAF_MASK)?;
            self.coding.skip(mask, cursor)?;
        }
        Ok(())
    }

    /// Index of the first sample.
    pub fn first(&self) -> [i64; 3] {
        self.range[0]
    }

    /// Samples along each axis.
    pub fn shape(&self) -> [usize; 3] {
        std::array::from_fn(|a| (self.range[1][a] - self.range[0][a]) as usize)
    }

    /// What a node of 32³ has where a voxel lies.
    fn upper_entry(&self, voxel: [i64; 3]) -> NodeEntry {
        let place = voxel.map(|c| (c >> UPPER_BITS << UPPER_BITS) as i32);
        match self.roots.binary_search_by_key(&place, |(place, _)| *place).map(|n| self.roots[n].1) {
            Err(_) => NodeEntry::Tile(self.coding.background),
            Ok(NodeEntry::Child(n)) => self.uppers[n].at(place_of(voxel, LOWER_BITS, UPPER_BITS)),
            Ok(tile) => tile,
        }
    }

    /// The leaf of a voxel, or its value.
    fn lower_entry(&self, voxel: [i64; 3]) -> NodeEntry {
        match self.upper_entry(voxel) {
            NodeEntry::Child(n) => self.lowers[n].at(place_of(voxel, LEAF_BITS, LOWER_BITS)),
            tile => tile,
        }
    }

    fn leaf(&self, bytes: &[u8], leaf: usize, unpacker: &mut Unpacker, out: &mut Vec<f64>) -> Result<()> {
        let mut cursor = Cursor::new(&self.path, bytes, self.leaves[leaf]);
        let mask = cursor.take(LEAF_MASK)?;
        self.coding.read(mask, &mut cursor, unpacker, out)
    }
}

fn root_place(cursor: &mut Cursor<'_>) -> Result<[i32; 3]> {
    let place = cursor.coordinates()?;
    if place.iter().any(|c| c % (1 << UPPER_BITS) != 0) {
        return Err(cursor.damaged(format!("has a node at {place:?}")));
    }
    Ok(place)
}

impl SampleSource for VdbTree {
    fn read(&self, bytes: &[u8], [low, high]: GridBox, out: &mut Vec<f64>) -> Result<()> {
        let counts: [usize; 3] = std::array::from_fn(|a| high[a] - low[a]);
        out.resize(counts.iter().product(), self.coding.background);
        let [low, high] = [low, high].map(|corner| sum(self.range[0], corner.map(|c| c as i64)));
        let (mut unpacker, mut leaf) = (Unpacker::default(), Vec::new());
        let starts = |a: usize| (low[a].div_euclid(LEAF)..=(high[a] - 1).div_euclid(LEAF)).map(|c| c * LEAF);
        for z in starts(2) {
            for y in starts(1) {
                for x in starts(0) {
                    let first = [x, y, z];
                    let entry = self.lower_entry(first);
                    if let NodeEntry::Child(n) = entry {
                        self.leaf(bytes, n, &mut unpacker, &mut leaf)?;
                    }
                    let range = |a: usize| first[a].max(low[a])..(first[a] + LEAF).min(high[a]);
                    for k in range(2) {
                        for j in range(1) {
                            for i in range(0) {
                                let at = [i, j, k];
                                let [i, j, k] = std::array::from_fn(|a| (at[a] - low[a]) as usize);
                                out[(k * counts[1] + j) * counts[0] + i] = match entry {
                                    NodeEntry::Tile(value) => value,
                                    NodeEntry::Child(_) => leaf[place_of(at, 0, LEAF_BITS)],
                                };
                            }
                        }
                    }
                }
            }
        }
        Ok(())
    }

    fn outside(&self) -> Option<f64> {
        Some(self.coding.background)
    }

    /// A box of 40 along an axis meets two nodes of 16³ at most.
    fn uniform(&self, [low, high]: GridBox) -> Option<f64> {
        let corner = |n: usize| -> [i64; 3] {
            std::array::from_fn(|a| {
                self.range[0][a] + if n >> a & 1 == 0 { low[a] } else { high[a] - 1 } as i64
            })
        };
        let NodeEntry::Tile(value) = self.upper_entry(corner(0)) else { return None };
        (1..8).all(|n| self.upper_entry(corner(n)) == NodeEntry::Tile(value)).then_some(value)
    }
}
