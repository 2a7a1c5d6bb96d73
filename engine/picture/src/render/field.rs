//! What rays look for in a brick: a number at each sample, trilinear in between, and which cells are worth a look.

use crate::brick::{Brick, Hermite, POINTS, Samples, SignChanges, point_index};
use crate::lattice::{Axis, BRICK_CELLS, BRICK_POINTS};
use brickfield_shaders::VALUE_WORDS;

/// Numbers at the 33³ samples of a brick, above 0 inside.
pub(super) struct RayField {
    /// In [`STEPS`] to one.
    values: Box<[i16; POINTS]>,
    /// Bit i of row k·32 + j is set where the cell (i, j, k) is worth a look.
    active: Box<[u32; BRICK_CELLS * BRICK_CELLS]>,
}

/// Steps of a field: distances in cells to 1/4096.
const STEPS: f32 = 4096.0;
/// Farther than this from the boundary distances do not count: the corners of a cell that it passes are not farther apart.
const FARTHEST: f32 = 1.7;
/// Least distance that counts as one: a sample's sign is what the brick says.
const NEAREST: f32 = 1.0 / 256.0;
/// Least cosine of a Hermite normal and its edge that is believed; beyond that the surface is finer than the cells.
const COSINE_MIN: f32 = 0.05;

impl RayField {
    /// Signed distances, in cells, from the boundary w = 0.5 in the samples around it; `None` if all samples lie on one side.
    ///
    /// Each Hermite edge says how far its two ends are from its tangent plane, and a sample takes the mean of what its
    /// edges say, near crossings counting more. Samples farther off, of which cells that the boundary passes have
    /// some, go on from those beside them along their gradients.
    ///
    /// So where the boundary is flat the field is its distance, and where it is round the error is of the second
    /// order. Without Hermite edges, as in interior nodes, see [`RayField::level`].
    pub fn boundary(brick: &Brick, scratch: &mut FieldScratch) -> Option<RayField> {
        let Brick::Counts { samples, hermite } = brick else { return None };
        let signs = SignChanges::of(samples);
        let counts = signs.counts();
        if counts == [0; 3] {
            return None;
        }
        if hermite.edges.each_ref().map(Vec::len) != counts {
            return RayField::level(brick, 0.5);
        }
        scratch.clear();
        scratch.take_edges(&signs, hermite);
        let active = active(|j, k| signs.row(j, k), |j, k| signs.row(j, k));
        scratch.spread(&signs, &active);
        Some(RayField { values: scratch.values(&signs), active })
    }

    /// Where w passes `iso`, from the samples alone: w − `iso`, cut off at half of one, smoothed over the samples around,
    /// but of its own sign; `None` if all samples lie on one side.
    pub fn level(brick: &Brick, iso: f64) -> Option<RayField> {
        let Brick::Counts { samples, .. } = brick else { return None };
        let mut rough = vec![0f32; POINTS];
        for (rough, &w) in rough.iter_mut().zip(samples.0.iter()) {
            let w = f64::from(w) / f64::from(1u32 << samples.1);
            *rough = (w - iso).clamp(-0.5, 0.5) as f32;
        }
        let is_inside = |w: f32| w >= 0.0;
        let inside = rows(|at| is_inside(rough[at]));
        let active = active(|j, k| inside[k * BRICK_POINTS + j], |j, k| inside[k * BRICK_POINTS + j]);
        if active.iter().all(|row| *row == 0) {
            return None;
        }
        let smooth = smoothed(&rough);
        let value = |at: usize| {
            let least = 0.05;
            let value = if is_inside(rough[at]) { smooth[at].max(least) } else { smooth[at].min(-least) };
            (value * STEPS) as i16
        };
        Some(RayField { values: boxed(value), active })
    }

    /// w itself, cut off and scaled so that `range` becomes 0 to 1, for what is seen where it lies between the two numbers
    /// of `seen`; `None` if it does so nowhere.
    pub fn between(samples: &Samples, range: [f64; 2], seen: [f64; 2]) -> Option<RayField> {
        let w = |at: usize| f64::from(samples.0[at]) / f64::from(1u32 << samples.1);
        let [any, full] = [rows(|at| w(at) > seen[0]), rows(|at| w(at) >= seen[1])];
        let at = |rows: &[u64], j: usize, k: usize| rows[k * BRICK_POINTS + j];
        let active = active(|j, k| at(&any, j, k), |j, k| at(&full, j, k));
        if active.iter().all(|row| *row == 0) {
            return None;
        }
        let scaled = |w: f64| ((w - range[0]) / (range[1] - range[0])).clamp(0.0, 1.0);
        Some(RayField { values: boxed(|at| (scaled(w(at)) as f32 * STEPS) as i16), active })
    }

    /// Bytes that a field takes.
    pub fn heap_bytes() -> usize {
        POINTS * size_of::<i16>() + BRICK_CELLS * BRICK_CELLS * size_of::<u32>()
    }

    /// Its words in a page: numbers two by two, then a word a row of cells.
    pub fn write(&self, words: &mut [u32]) {
        let (values, active) = words.split_at_mut(VALUE_WORDS as usize);
        bytemuck::cast_slice_mut(values)[..POINTS].copy_from_slice(&*self.values);
        active[..self.active.len()].copy_from_slice(&*self.active);
    }

    /// Whether the cell is worth a look.
    #[inline]
    pub fn is_active(&self, [i, j, k]: [usize; 3]) -> bool {
        self.active[k * BRICK_CELLS + j] >> i & 1 == 1
    }

    /// Adds the blocks that hold such cells.
    pub fn add_blocks(&self, blocks: &mut Blocks) {
        for (n, row) in self.active.iter().enumerate().filter(|(_, row)| **row != 0) {
            let (j, k) = (n % BRICK_CELLS / BLOCK_CELLS, n / BRICK_CELLS / BLOCK_CELLS);
            for i in 0..BRICK_CELLS / BLOCK_CELLS {
                blocks.0[k] |= u64::from(row >> (i * BLOCK_CELLS) & 0xf != 0) << (8 * j + i);
            }
        }
    }

    /// The field in a cell.
    #[inline]
    pub fn cell(&self, [i, j, k]: [usize; 3]) -> FieldCell {
        let corner = |c: usize| {
            f64::from(self.values[point_index([i + (c & 1), j + (c >> 1 & 1), k + (c >> 2)])])
                / f64::from(STEPS)
        };
        FieldCell([corner(0), corner(1), corner(2), corner(3), corner(4), corner(5), corner(6), corner(7)])
    }
}

/// Cells along the side of a block.
pub(super) const BLOCK_CELLS: usize = 4;

/// Blocks of cells of which one is worth a look: of the block (i, j, k) bit 8 j + i of the k-th number.
#[derive(Default)]
pub(super) struct Blocks([u64; BRICK_CELLS / BLOCK_CELLS]);

impl Blocks {
    /// Two words a layer.
    pub fn words(&self) -> impl Iterator<Item = u32> {
        self.0.into_iter().flat_map(|layer| [layer as u32, (layer >> 32) as u32])
    }

    #[inline]
    pub fn is_active(&self, [i, j, k]: [usize; 3]) -> bool {
        self.0[k] >> (8 * j + i) & 1 == 1
    }
}

/// The field in a cell: its values at the corners, by octant.
#[derive(Clone, Copy)]
pub(super) struct FieldCell([f64; 8]);

impl FieldCell {
    /// At a place in the cell, 0..1 an axis.
    #[inline]
    pub fn value(&self, [x, y, z]: [f64; 3]) -> f64 {
        let c = &self.0;
        let mix = |a: f64, b: f64, t: f64| a + (b - a) * t;
        let low = mix(mix(c[0], c[1], x), mix(c[2], c[3], x), y);
        let high = mix(mix(c[4], c[5], x), mix(c[6], c[7], x), y);
        mix(low, high, z)
    }

    /// Its gradient there, by cell.
    pub fn gradient(&self, at: [f64; 3]) -> [f64; 3] {
        std::array::from_fn(|a| {
            let [mut low, mut high] = [at, at];
            (low[a], high[a]) = (0.0, 1.0);
            self.value(high) - self.value(low)
        })
    }
}

fn boxed(value: impl Fn(usize) -> i16) -> Box<[i16; POINTS]> {
    let values: Vec<i16> = (0..POINTS).map(value).collect();
    values.into_boxed_slice().try_into().expect("the length is POINTS")
}

/// Bit rows along x of what a predicate on the linear index says.
fn rows(is_set: impl Fn(usize) -> bool) -> Vec<u64> {
    let row =
        |n: usize| (0..BRICK_POINTS).fold(0, |row, i| row | u64::from(is_set(n * BRICK_POINTS + i)) << i);
    (0..BRICK_POINTS * BRICK_POINTS).map(row).collect()
}

/// Cells of which a corner is set in the first rows, but not all corners are in the second.
fn active(
    any: impl Fn(usize, usize) -> u64,
    all: impl Fn(usize, usize) -> u64,
) -> Box<[u32; BRICK_CELLS * BRICK_CELLS]> {
    let mut active = vec![0; BRICK_CELLS * BRICK_CELLS];
    for (n, row) in active.iter_mut().enumerate() {
        let (j, k) = (n % BRICK_CELLS, n / BRICK_CELLS);
        let around = [[j, k], [j + 1, k], [j, k + 1], [j + 1, k + 1]];
        let any = around.iter().fold(0, |bits, [j, k]| bits | any(*j, *k));
        let all = around.iter().fold(!0, |bits, [j, k]| bits & all(*j, *k));
        *row = ((any | any >> 1) & !(all & all >> 1)) as u32;
    }
    active.into_boxed_slice().try_into().expect("the length is that of the rows")
}

/// The corners of active cells outside, and those inside, as bit rows along x.
fn corners_by_side(signs: &SignChanges, active: &[u32; BRICK_CELLS * BRICK_CELLS]) -> [Vec<u64>; 2] {
    let mut corners = vec![0u64; BRICK_POINTS * BRICK_POINTS];
    for (n, row) in active.iter().enumerate().filter(|(_, row)| **row != 0) {
        let low = n / BRICK_CELLS * BRICK_POINTS + n % BRICK_CELLS;
        let bits = u64::from(*row) | u64::from(*row) << 1;
        [0, 1, BRICK_POINTS, BRICK_POINTS + 1].into_iter().for_each(|beside| corners[low + beside] |= bits);
    }
    let inside: Vec<u64> = corners
        .iter()
        .enumerate()
        .map(|(row, bits)| bits & signs.row(row % BRICK_POINTS, row / BRICK_POINTS))
        .collect();
    let outside = corners.iter().zip(&inside).map(|(all, inside)| all & !inside).collect();
    [outside, inside]
}

/// The mean over the samples around, those at the border repeated, weighted 1, 2, 1 along each axis.
fn smoothed(rough: &[f32]) -> Vec<f32> {
    let mut from = rough.to_vec();
    for axis in 0..3 {
        let step = BRICK_POINTS.pow(axis);
        let mut to = vec![0.0; POINTS];
        let line = BRICK_POINTS * step;
        for (from, to) in from.chunks_exact(line).zip(to.chunks_exact_mut(line)) {
            for (place, to) in to.chunks_exact_mut(step).enumerate() {
                let beside = [place.saturating_sub(1), place, (place + 1).min(BRICK_POINTS - 1)];
                let [a, b, c] = beside.map(|place| &from[place * step..][..step]);
                for (n, to) in to.iter_mut().enumerate() {
                    *to = (a[n] + 2.0 * b[n] + c[n]) / 4.0;
                }
            }
        }
        from = to;
    }
    from
}

/// Room in which fields are made.
pub(super) struct FieldScratch {
    /// By sample: sums of weighted distances and gradients, and of the weights; after a division the means.
    sums: Vec<[f32; 5]>,
    /// Samples that have any, in the order in which they came.
    touched: Vec<u32>,
}

impl Default for FieldScratch {
    fn default() -> FieldScratch {
        FieldScratch { sums: vec![[0.0; 5]; POINTS], touched: Vec::new() }
    }
}

impl FieldScratch {
    fn clear(&mut self) {
        for at in self.touched.drain(..) {
            self.sums[at as usize] = [0.0; 5];
        }
    }

    fn add(&mut self, at: usize, distance: f32, gradient: [f32; 3], weight: f32) {
        let sums = &mut self.sums[at];
        if sums[4] == 0.0 {
            self.touched.push(at as u32);
        }
        let [x, y, z] = gradient;
        for (sum, part) in sums.iter_mut().zip([distance, x, y, z, 1.0]) {
            *sum += part * weight;
        }
    }

    /// Means of what was added to the samples from the `from`-th touched on; gradients of length 1.
    fn divide(&mut self, from: usize) {
        for &at in &self.touched[from..] {
            let sums = &mut self.sums[at as usize];
            let length = (sums[1] * sums[1] + sums[2] * sums[2] + sums[3] * sums[3]).sqrt().max(1e-6);
            *sums = [sums[0] / sums[4], sums[1] / length, sums[2] / length, sums[3] / length, 1.0];
        }
    }

    /// What Hermite edges say of their ends.
    fn take_edges(&mut self, signs: &SignChanges, hermite: &Hermite) {
        for axis in Axis::ALL {
            let (a, step) = (axis.index(), BRICK_POINTS.pow(axis.index() as u32));
            signs.for_crossings(axis, hermite, |ijk, edge| {
                let (at, along) = (edge.fraction() as f32, edge.normal.to_vector());
                let starts_inside = signs.is_inside(ijk);
                // The field grows inward, normals look outward.
                let gradient = along.map(|c| -c as f32);
                let cosine = if starts_inside { -gradient[a] } else { gradient[a] }.max(COSINE_MIN);
                let sign = if starts_inside { 1.0 } else { -1.0 };
                let low = point_index(ijk);
                self.add(low, sign * at * cosine, gradient, 1.0 / (at + 0.1));
                self.add(low + step, -sign * (1.0 - at) * cosine, gradient, 1.0 / (1.1 - at));
            });
        }
        self.divide(0);
    }

    /// Goes on from the samples that have distances to those beside them on the same side, twice, as far as they are
    /// corners of cells that are worth a look. Every such corner is reached along the sides of its cell.
    fn spread(&mut self, signs: &SignChanges, active: &[u32; BRICK_CELLS * BRICK_CELLS]) {
        let mut open = corners_by_side(signs, active);
        let mut from = 0;
        self.close(&mut open, 0);
        for _ in 0..2 {
            let known = self.touched.len();
            for n in from..known {
                let at = self.touched[n] as usize;
                let [distance, gx, gy, gz, _] = self.sums[at];
                let (row, i) = (at / BRICK_POINTS, at % BRICK_POINTS);
                let (j, k) = (row % BRICK_POINTS, row / BRICK_POINTS);
                let open = &open[usize::from(signs.is_inside([i, j, k]))];
                let mut reach = |is_open: bool, index: usize, rise: f32| {
                    if is_open {
                        self.add(index, distance + rise, [gx, gy, gz], 1.0);
                    }
                };
                let is_open = |row: usize| open[row] >> i & 1 == 1;
                reach(open[row] << 1 >> i & 1 == 1, at.wrapping_sub(1), -gx);
                reach(open[row] >> 1 >> i & 1 == 1, at + 1, gx);
                let (y, z) = (BRICK_POINTS, BRICK_POINTS * BRICK_POINTS);
                reach(j > 0 && is_open(row - 1), at.wrapping_sub(y), -gy);
                reach(j + 1 < BRICK_POINTS && is_open(row + 1), at + y, gy);
                reach(k > 0 && is_open(row - BRICK_POINTS), at.wrapping_sub(z), -gz);
                reach(k + 1 < BRICK_POINTS && is_open(row + BRICK_POINTS), at + z, gz);
            }
            self.divide(known);
            self.close(&mut open, known);
            from = known;
        }
    }

    /// Takes the samples from the `from`-th touched on off the rows.
    fn close(&self, open: &mut [Vec<u64>; 2], from: usize) {
        for &at in &self.touched[from..] {
            let (row, i) = (at as usize / BRICK_POINTS, at as usize % BRICK_POINTS);
            open.iter_mut().for_each(|rows| rows[row] &= !(1 << i));
        }
    }

    fn values(&self, signs: &SignChanges) -> Box<[i16; POINTS]> {
        let [outside, inside] = [-FARTHEST, FARTHEST].map(|distance| (distance * STEPS) as i16);
        let mut values = boxed(|_| outside);
        for (row, values) in values.chunks_exact_mut(BRICK_POINTS).enumerate() {
            let bits = signs.row(row % BRICK_POINTS, row / BRICK_POINTS);
            // A loop without branches, which becomes vectors, where it is needed at all.
            if bits != 0 {
                for (i, value) in values.iter_mut().enumerate() {
                    *value = if bits >> i & 1 == 1 { inside } else { outside };
                }
            }
        }
        for &at in &self.touched {
            let at = at as usize;
            let distance = self.sums[at][0];
            let distance = match values[at] >= 0 {
                true => distance.clamp(NEAREST, FARTHEST),
                false => distance.clamp(-FARTHEST, -NEAREST),
            };
            values[at] = (distance * STEPS) as i16;
        }
        values
    }
}
