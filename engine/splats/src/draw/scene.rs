//! Splats as they wait to be drawn: 20 bytes each, by node, eight at a time.

use crate::bsp::{Cell, Clip, PAIRS, SplatTree};
use crate::error::Result;
use crate::splats::{CellPlanes, SplatLevels, planes_of_levels, planes_of_tree};

/// Splats that are taken together.
pub(super) const LANES: usize = 8;

/// The splats of a picture, of one level or of the finest cells, in the order of the octree.
#[derive(Clone, Debug, Default)]
pub struct SplatScene {
    pub(super) nodes: Vec<SceneNode>,
    len: u64,
}

/// The splats of a node. All lists have a multiple of [`LANES`] entries; those behind the last splat are zero.
#[derive(Clone, Debug)]
pub(super) struct SceneNode {
    /// Least corner in the world.
    pub corner: [f64; 3],
    /// Side of a cell.
    pub cell: f64,
    pub len: usize,
    /// Unit normals, by axis.
    pub normals: [Vec<f32>; 3],
    /// Distances of planes from the middles of their cells, in cells.
    pub offsets: Vec<f32>,
    /// Places of cells: five bits each of x, y, z.
    pub places: Vec<u16>,
    /// How the splats at the places -2, -1, 1 and 2 from here cut this one: two bits each.
    pub cuts: Vec<u8>,
}

impl SplatScene {
    /// The finest picture: splats of cells that are not divided, or of `level`.
    ///
    /// # Errors
    /// If a temporary file cannot be read.
    pub fn of_levels(levels: &SplatLevels, level: Option<u8>) -> Result<SplatScene> {
        let make =
            |corner, cell, cells: &mut dyn Iterator<Item = CellPlanes>| SceneNode::new(corner, cell, cells);
        planes_of_levels(levels, level, make).map(SplatScene::new)
    }

    /// The same of a file.
    pub fn of_tree(tree: &SplatTree, level: Option<u8>) -> SplatScene {
        let make =
            |corner, cell, cells: &mut dyn Iterator<Item = CellPlanes>| SceneNode::new(corner, cell, cells);
        SplatScene::new(planes_of_tree(tree, level, make))
    }

    pub(super) fn new(mut nodes: Vec<SceneNode>) -> SplatScene {
        nodes.retain(|node| node.len > 0);
        let len = nodes.iter().map(|node| node.len as u64).sum();
        SplatScene { nodes, len }
    }

    /// How many splats there are.
    pub fn len(&self) -> u64 {
        self.len
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.len == 0
    }
}

impl SceneNode {
    pub fn new(corner: [f64; 3], cell: f64, cells: &mut dyn Iterator<Item = CellPlanes>) -> SceneNode {
        let (normals, offsets, places, cuts) =
            ([const { Vec::new() }; 3], Vec::new(), Vec::new(), Vec::new());
        let mut node = SceneNode { corner, cell, len: 0, normals, offsets, places, cuts };
        cells.for_each(|CellPlanes { cell, planes }| node.add(&cell, &planes));
        node.len = node.offsets.len();
        let padded = node.len.next_multiple_of(LANES);
        node.normals.iter_mut().for_each(|along| along.resize(padded, 0.0));
        node.offsets.resize(padded, 0.0);
        node.places.resize(padded, 0);
        node.cuts.resize(padded, 0);
        node
    }

    fn add(&mut self, cell: &Cell, planes: &[([f64; 3], f64)]) {
        let [x, y, z] = cell.at.map(u16::from);
        for (n, (normal, offset)) in planes.iter().take(usize::from(cell.count)).enumerate() {
            (0..3).for_each(|a| self.normals[a].push(normal[a] as f32));
            self.offsets.push(*offset as f32);
            self.places.push(x | y << 5 | z << 10);
            let mut cuts = 0;
            for (pair, [a, b]) in PAIRS.into_iter().enumerate().filter(|(_, pair)| pair.contains(&n)) {
                let other = if a == n { b } else { a };
                cuts |= (cell.clip(pair) as u8) << (2 * neighbour(other as isize - n as isize));
            }
            self.cuts.push(cuts);
        }
    }
}

/// Which of the bits in [`SceneNode::cuts`] tell of the splat at a distance.
fn neighbour(by: isize) -> usize {
    match by {
        -2 => 0,
        -1 => 1,
        1 => 2,
        _ => 3,
    }
}

impl SceneNode {
    /// The other splats that cut one: where they are, and the sign of their planes.
    #[inline(always)]
    pub fn cuts_of(&self, splat: usize) -> impl Iterator<Item = (usize, f32)> {
        let cuts = self.cuts[splat];
        [-2isize, -1, 1, 2].into_iter().enumerate().filter_map(move |(n, by)| {
            let clip = cuts >> (2 * n) & 3;
            let sign = if clip == Clip::Convex as u8 { 1.0 } else { -1.0 };
            (clip != Clip::None as u8).then(|| (splat.wrapping_add_signed(by), sign))
        })
    }
}
