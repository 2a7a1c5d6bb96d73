//! Splats to the pixels that they may touch: eight at a time, sorted by tile.

use super::frame::{DrawFrame, TILE_BITS, TileBits};
use super::scene::{LANES, SceneNode};
use crate::page_draw::{CELL_REACH, HALF_DIAGONAL, TOGETHER};
use crate::wide::{Simd, SimdBase, SimdFloat, SimdMask, dispatch, f32x8, level};

/// Boxes of pixels are so much larger than splats, in pixels, for rounding.
const BOX_SLACK: f32 = 1e-3;

/// A splat in the picture, in coordinates around the middle of what is seen.
#[derive(Clone, Copy, Debug)]
pub(super) struct PlacedSplat {
    pub centre: [f32; 3],
    pub normal: [f32; 3],
    /// From the middle of the cell to the centre, along the normal.
    pub offset: f32,
    /// Number of the first plane that cuts it, times 4, and how many do.
    pub cuts: u32,
    /// Pixels that it may touch: first and last column and row.
    pub columns: [u16; 2],
    pub rows: [u16; 2],
}

/// Splats of some nodes with cells of one size.
pub(super) struct PlacedSplats {
    /// How far a splat reaches from the middle of its cell along each axis.
    pub reach: f32,
    /// One divided by the square of the radius.
    pub per_square: f32,
    /// How far behind the nearest splat others belong to it, along a ray.
    pub together: f32,
    pub splats: Vec<PlacedSplat>,
    /// Planes n, d: of a splat around x remains where n · (p - x) ≤ d.
    pub cuts: Vec<([f32; 3], f32)>,
    tiles: TileLists,
}

/// Numbers of splats by tile, in order.
#[derive(Default)]
struct TileLists {
    /// The first tile, and how many there are, along each axis.
    first: [u32; 2],
    count: [u32; 2],
    starts: Vec<u32>,
    numbers: Vec<u32>,
}

impl PlacedSplats {
    /// Places the splats of nodes with cells of one size, for tiles of a size.
    pub fn new(frame: &DrawFrame, nodes: &[SceneNode], bits: TileBits) -> PlacedSplats {
        let cell = nodes.first().map_or(1.0, |node| node.cell);
        let radius = HALF_DIAGONAL * cell;
        let reach = (CELL_REACH * cell) as f32;
        let mut placed = PlacedSplats {
            reach,
            per_square: (1.0 / (radius * radius)) as f32,
            together: reach * TOGETHER * frame.per_unit,
            // Half of them face away.
            splats: Vec::with_capacity(nodes.iter().map(|node| node.len).sum::<usize>() / 2),
            cuts: Vec::new(),
            tiles: TileLists::default(),
        };
        for node in nodes {
            dispatch!(level(), simd => placed.add(simd, frame, node));
        }
        placed.tiles = match bits {
            // Known to the compiler it takes a twentieth less of a picture's time.
            TILE_BITS => TileLists::new(&placed.splats, TILE_BITS),
            others => TileLists::new(&placed.splats, others),
        };
        placed
    }

    /// Numbers of the splats that may touch a tile.
    #[inline]
    pub fn in_tile(&self, tile: [u32; 2]) -> &[u32] {
        self.tiles.of(tile)
    }

    /// Whether splats may touch a row of tiles.
    pub fn is_in_row(&self, row: u32) -> bool {
        row.wrapping_sub(self.tiles.first[1]) < self.tiles.count[1]
    }

    /// Places the splats of a node that are seen.
    #[inline(always)]
    fn add<S: Simd>(&mut self, simd: S, frame: &DrawFrame, node: &SceneNode) {
        let corner: [f32; 3] = frame.around(node.corner);
        for first in (0..node.len).step_by(LANES) {
            let all = if node.len - first < LANES { (1 << (node.len - first)) - 1 } else { 0xff };
            let normal = SplatLanes::normals(simd, node, first);
            // Most that is not seen faces away, and eight do together.
            if !frame.open && frame.parallel && SplatLanes::facing(simd, frame, normal) & all == 0 {
                continue;
            }
            let lanes = SplatLanes::new(simd, node, normal, corner, first);
            let mut bits = lanes.shown(simd, frame, node.cell as f32) & all;
            if bits == 0 {
                continue;
            }
            let (seen, boxes) = lanes.boxes(simd, frame, self.reach, node.cell as f32);
            bits &= seen;
            if bits == 0 {
                continue;
            }
            let centre = lanes.centre.map(|along| along.to_array());
            while bits != 0 {
                let lane = bits.trailing_zeros() as usize;
                bits &= bits - 1;
                self.push(
                    node,
                    first + lane,
                    [0, 1, 2].map(|a| centre[a][lane]),
                    boxes.map(|end| end[lane] as u16),
                );
            }
        }
    }

    #[inline(always)]
    fn push(
        &mut self,
        node: &SceneNode,
        splat: usize,
        centre: [f32; 3],
        [left, right, top, bottom]: [u16; 4],
    ) {
        let cell = node.cell as f32;
        let normal = [node.normals[0][splat], node.normals[1][splat], node.normals[2][splat]];
        let offset = node.offsets[splat] * cell;
        let from = self.cuts.len() as u32;
        if node.cuts[splat] != 0 {
            for (other, sign) in node.cuts_of(splat) {
                let m = [node.normals[0][other], node.normals[1][other], node.normals[2][other]];
                let cosine = m[0] * normal[0] + m[1] * normal[1] + m[2] * normal[2];
                let behind = node.offsets[other] * cell - cosine * offset;
                self.cuts.push((m.map(|c| c * sign), behind * sign));
            }
        }
        let cuts = from << 2 | (self.cuts.len() as u32 - from);
        self.splats.push(PlacedSplat {
            centre,
            normal,
            offset,
            cuts,
            columns: [left, right],
            rows: [top, bottom],
        });
    }
}

/// Eight splats of a node.
struct SplatLanes<S: Simd> {
    normal: [f32x8<S>; 3],
    /// Middles of cells.
    middle: [f32x8<S>; 3],
    centre: [f32x8<S>; 3],
}

#[inline(always)]
fn dot<S: Simd>(simd: S, a: [f32; 3], b: [f32x8<S>; 3]) -> f32x8<S> {
    b[0] * f32x8::splat(simd, a[0]) + b[1] * f32x8::splat(simd, a[1]) + b[2] * f32x8::splat(simd, a[2])
}

impl<S: Simd> SplatLanes<S> {
    #[inline(always)]
    fn normals(simd: S, node: &SceneNode, first: usize) -> [f32x8<S>; 3] {
        let lanes = first..first + LANES;
        [
            f32x8::from_slice(simd, &node.normals[0][lanes.clone()]),
            f32x8::from_slice(simd, &node.normals[1][lanes.clone()]),
            f32x8::from_slice(simd, &node.normals[2][lanes]),
        ]
    }

    /// Of parallel rays: a bit for each that faces the eye.
    #[inline(always)]
    fn facing(simd: S, frame: &DrawFrame, normal: [f32x8<S>; 3]) -> u64 {
        dot(simd, frame.corner, normal).simd_le(f32x8::splat(simd, 0.0)).to_bitmask()
    }

    #[inline(always)]
    fn new(
        simd: S,
        node: &SceneNode,
        normal: [f32x8<S>; 3],
        corner: [f32; 3],
        first: usize,
    ) -> SplatLanes<S> {
        let cell = node.cell as f32;
        let mut at = [[0.0f32; LANES]; 3];
        let places = &node.places[first..first + LANES];
        for lane in 0..LANES {
            at[0][lane] = f32::from(places[lane] & 31);
            at[1][lane] = f32::from(places[lane] >> 5 & 31);
            at[2][lane] = f32::from(places[lane] >> 10);
        }
        let offset = f32x8::from_slice(simd, &node.offsets[first..first + LANES]) * f32x8::splat(simd, cell);
        let half = f32x8::splat(simd, 0.5);
        let (mut middle, mut centre) = (normal, normal);
        for a in 0..3 {
            middle[a] = (f32x8::from_slice(simd, &at[a]) + half) * f32x8::splat(simd, cell)
                + f32x8::splat(simd, corner[a]);
            centre[a] = middle[a] + normal[a] * offset;
        }
        SplatLanes { normal, middle, centre }
    }

    /// A bit for each that may be seen from its front; behind cuts, for each whose cell is not cut off.
    #[inline(always)]
    fn shown(&self, simd: S, frame: &DrawFrame, cell: f32) -> u64 {
        if frame.open {
            let reach = f32x8::splat(simd, CELL_REACH as f32 * cell);
            let mut bits = 0xff;
            for a in 0..3 {
                let low = (self.middle[a] + reach).simd_ge(f32x8::splat(simd, frame.corners[0][a]));
                let high = (self.middle[a] - reach).simd_le(f32x8::splat(simd, frame.corners[1][a]));
                bits &= (low & high).to_bitmask();
            }
            return bits;
        }
        if frame.parallel {
            return SplatLanes::facing(simd, frame, self.normal);
        }
        // With perspective the far edge of a disc may face the eye while its centre does not.
        let mut along = f32x8::splat(simd, 0.0);
        for a in 0..3 {
            along += (self.centre[a] - f32x8::splat(simd, frame.origin[a])) * self.normal[a];
        }
        along.simd_le(f32x8::splat(simd, HALF_DIAGONAL as f32 * cell)).to_bitmask()
    }

    /// Left, right, upper and lower ends of the pixels that splats may touch; and a bit for each that touches some.
    #[inline(always)]
    fn boxes(&self, simd: S, frame: &DrawFrame, reach: f32, cell: f32) -> (u64, [[f32; LANES]; 4]) {
        let radius = HALF_DIAGONAL as f32 * cell;
        let (zero, one) = (f32x8::splat(simd, 0.0), f32x8::splat(simd, 1.0));
        let mut from = self.centre;
        for (along, origin) in from.iter_mut().zip(frame.origin) {
            *along -= f32x8::splat(simd, origin);
        }
        let mut bits = 0xff;
        let mut scale = f32x8::splat(simd, frame.per_pixel);
        let mut nearer = one;
        if !frame.parallel {
            let depth = dot(simd, frame.axes[2], from);
            // The sphere around the disc must be before the eye.
            bits &= depth.simd_gt(f32x8::splat(simd, radius * 1.01)).to_bitmask();
            scale = f32x8::splat(simd, frame.per_pixel * frame.distance) / depth;
            nearer = depth / (depth - f32x8::splat(simd, radius));
        }
        let mut ends = [[0.0; LANES]; 4];
        for n in 0..2 {
            let axis = frame.axes[n];
            let at = dot(simd, axis, from) * scale + f32x8::splat(simd, frame.shift[n] - 0.5);
            let slack = f32x8::splat(simd, BOX_SLACK);
            let (low, high) = if frame.parallel {
                // Along an axis of the picture a disc reaches as far as its plane lets it, and not beyond its cell.
                let cosine = dot(simd, axis, self.normal);
                let share = (one - cosine * cosine).max(zero).sqrt();
                let extent = share * scale * f32x8::splat(simd, radius) + slack;
                let mut to_middle = self.middle;
                for (along, centre) in to_middle.iter_mut().zip(self.centre) {
                    *along -= centre;
                }
                let middle = at + dot(simd, axis, to_middle) * scale;
                let of_cell = reach * (axis[0].abs() + axis[1].abs() + axis[2].abs());
                let of_cell = scale * f32x8::splat(simd, of_cell) + slack;
                ((at - extent).max(middle - of_cell), (at + extent).min(middle + of_cell))
            } else {
                // Nearer parts look larger.
                let extent = scale * nearer * f32x8::splat(simd, radius) + slack;
                (at - extent, at + extent)
            };
            let last = f32x8::splat(simd, (frame.size[n] - 1) as f32);
            let (low, high) = (low.ceil().max(zero), high.floor().min(last));
            bits &= low.simd_le(high).to_bitmask();
            ends[2 * n] = low.to_array();
            ends[2 * n + 1] = high.to_array();
        }
        (bits, ends)
    }
}

/// First and last columns and rows of tiles that a splat may touch.
#[inline(always)]
fn tiles_of(splat: &PlacedSplat, bits: TileBits) -> [u32; 4] {
    let [left, right] = splat.columns.map(|column| u32::from(column) >> bits[0]);
    let [top, bottom] = splat.rows.map(|row| u32::from(row) >> bits[1]);
    [left, right, top, bottom]
}

impl TileLists {
    #[inline(always)]
    fn new(splats: &[PlacedSplat], bits: TileBits) -> TileLists {
        let (mut first, mut last) = ([u32::MAX; 2], [0; 2]);
        for splat in splats {
            let [left, right, top, bottom] = tiles_of(splat, bits);
            first = [first[0].min(left), first[1].min(top)];
            last = [last[0].max(right), last[1].max(bottom)];
        }
        if splats.is_empty() {
            return TileLists::default();
        }
        let count = [last[0] - first[0] + 1, last[1] - first[1] + 1];
        let mut starts = vec![0u32; (count[0] * count[1]) as usize + 2];
        let tiles = |splat: &PlacedSplat, each: &mut dyn FnMut(usize)| {
            let [left, right, top, bottom] = tiles_of(splat, bits);
            for row in top..bottom + 1 {
                let row = (row - first[1]) * count[0];
                (left..right + 1).for_each(|column| each((row + column - first[0]) as usize));
            }
        };
        // Most splats are in one tile.
        let only = |splat: &PlacedSplat| {
            let [left, right, top, bottom] = tiles_of(splat, bits);
            (left == right && top == bottom).then(|| ((top - first[1]) * count[0] + left - first[0]) as usize)
        };
        for splat in splats {
            match only(splat) {
                Some(tile) => starts[tile + 2] += 1,
                None => tiles(splat, &mut |tile| starts[tile + 2] += 1),
            }
        }
        for n in 2..starts.len() {
            starts[n] += starts[n - 1];
        }
        let mut numbers = vec![0; starts[starts.len() - 1] as usize];
        for (n, splat) in splats.iter().enumerate() {
            let mut add = |tile: usize| {
                numbers[starts[tile + 1] as usize] = n as u32;
                starts[tile + 1] += 1;
            };
            match only(splat) {
                Some(tile) => add(tile),
                None => tiles(splat, &mut add),
            }
        }
        TileLists { first, count, starts, numbers }
    }

    fn of(&self, tile: [u32; 2]) -> &[u32] {
        let at = [0, 1].map(|n| tile[n].wrapping_sub(self.first[n]));
        if at[0] >= self.count[0] || at[1] >= self.count[1] {
            return &[];
        }
        let n = (at[1] * self.count[0] + at[0]) as usize;
        &self.numbers[self.starts[n] as usize..self.starts[n + 1] as usize]
    }
}
