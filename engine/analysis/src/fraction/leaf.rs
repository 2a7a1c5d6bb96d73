//! What one leaf adds to the samples of a coarse lattice: chords of solid between exact crossings, along all three axes.

use super::kernel::{rises, tent};
use crate::analysis::share_beside;
use crate::brick::{Brick, HermiteEdge, SignChanges};
use crate::lattice::{Axis, BRICK_CELLS, BRICK_POINTS, NodeKey};

/// Sums of a box of coarse samples, x fastest.
pub(super) struct SumBox {
    /// The first sample, counted from the first one of the tree.
    pub first: [i64; 3],
    /// Samples along each axis.
    pub size: [usize; 3],
    pub sums: Vec<f64>,
}

impl SumBox {
    /// What it adds to the samples of a lattice whose cells are `factor` of these an axis.
    ///
    /// A tent is the sum of narrower ones: those of `factor`-th its width at their own spacing, each with the height that the
    /// wide one has there (the two-scale relation of linear B-splines: Chui 1992, *An Introduction to Wavelets*, ch. 4).
    pub fn coarsened(&self, factor: u32) -> SumBox {
        // The slowest axis first, which leaves the least to the others.
        self.coarser_along(2, factor).coarser_along(1, factor).coarser_along(0, factor)
    }

    fn coarser_along(&self, axis: usize, factor: u32) -> SumBox {
        let (mut first, mut size) = (self.first, self.size);
        let (wide, weight_of_all) = (i64::from(factor), 1.0 / f64::from(factor));
        first[axis] = self.first[axis].div_euclid(wide);
        // The last sample adds to the one at it or before, and to the next.
        let last = self.first[axis] + self.size[axis] as i64 - 1;
        size[axis] = (last.div_euclid(wide) - first[axis]) as usize + 2;
        let row: usize = size[..axis].iter().product();
        let mut sums = vec![0.0; size.iter().product()];
        let slabs = self.sums.chunks_exact(row * self.size[axis]);
        for (slab, into) in slabs.zip(sums.chunks_exact_mut(row * size[axis])) {
            for (n, values) in slab.chunks_exact(row).enumerate() {
                let at = self.first[axis] + n as i64;
                let place = (at.div_euclid(wide) - first[axis]) as usize;
                let upper = at.rem_euclid(wide) as f64 / f64::from(factor).powi(2);
                for (place, weight) in [(place, weight_of_all - upper), (place + 1, upper)] {
                    let to = &mut into[place * row..][..row];
                    to.iter_mut().zip(values).for_each(|(sum, value)| *sum += weight * value);
                }
            }
        }
        SumBox { first, size, sums }
    }
}

/// Weights of one line of samples at coarse samples, from the first of the block on.
type Weights = Vec<(usize, f64)>;

/// A leaf on the coarse lattice: along each axis where it begins and what weight each of its lines of samples has.
pub(super) struct Plan {
    pub first: [i64; 3],
    pub size: [usize; 3],
    /// Its first sample in coarse cells.
    pub base: [f64; 3],
    /// A cell of its own in coarse cells.
    pub step: f64,
    /// Where a sample stands for more than one of the finest spacing, the one of the apron has a share, too.
    lines: [Vec<Weights>; 3],
}

impl Plan {
    /// Of a leaf of a tree whose finest level is `finest`, `factor` of whose cells are one coarse cell.
    pub fn new(key: NodeKey, finest: u8, factor: u32) -> Plan {
        let fine = 1usize << (finest - key.level());
        let begins = key.first_sample().map(|n| n as usize * fine);
        let factor_wide = f64::from(factor);
        let first = begins.map(|b| (b / factor as usize) as i64);
        let ends = begins.map(|b| ((b + BRICK_CELLS * fine) / factor as usize) as i64);
        // An end adds to three samples.
        let size = std::array::from_fn(|a| (ends[a] - first[a]) as usize + 3);
        let lines = std::array::from_fn(|a| {
            (0..BRICK_POINTS).map(|n| weights(begins[a], n, fine, factor_wide, first[a])).collect()
        });
        let base = begins.map(|b| b as f64 / factor_wide);
        Plan { first, size, base, step: fine as f64 / factor_wide, lines }
    }

    fn block(&self) -> SumBox {
        SumBox { first: self.first, size: self.size, sums: vec![0.0; self.size.iter().product()] }
    }

    /// The sums of all lines along an axis.
    fn all_lines(&self, axis: usize) -> Vec<f64> {
        let mut sums = vec![0.0; self.size[axis]];
        self.lines[axis].iter().flatten().for_each(|&(at, weight)| sums[at] += weight);
        sums
    }
}

/// Weights of line `n` of a leaf: those of the finest samples that the leaf owns, shared between the lines beside each.
fn weights(begin: usize, n: usize, fine: usize, factor: f64, first: i64) -> Weights {
    let mut found = Weights::new();
    let mut add = |fine_sample: usize, share: f64| {
        let (at, [lower, upper]) = tent(fine_sample as f64 / factor);
        for (at, weight) in [(at, lower), (at + 1, upper)] {
            let (place, weight) = ((at - first) as usize, weight * share / factor);
            match found.iter_mut().find(|(known, _)| *known == place) {
                Some((_, sum)) => *sum += weight,
                None if weight > 0.0 => found.push((place, weight)),
                None => {}
            }
        }
    };
    let own = begin + n * fine;
    if n > 0 {
        (1..fine).for_each(|i| add(own - i, 1.0 - i as f64 / fine as f64));
    }
    if n < BRICK_CELLS {
        (0..fine).for_each(|i| add(own + i, 1.0 - i as f64 / fine as f64));
    }
    found
}

/// What a leaf adds to several lattices; `None` where it has no solid. `base` divides all factors.
pub(super) fn blocks(
    key: NodeKey,
    brick: &Brick,
    finest: u8,
    (base, factors): (u32, &[u32]),
) -> Vec<Option<SumBox>> {
    let direct = |&factor: &u32| block(key, brick, finest, factor);
    // Larger leaves have many samples of a fine lattice and few crossings.
    if base == 1 || factors.len() == 1 || key.level() < finest || matches!(brick, Brick::Uniform(_)) {
        return factors.iter().map(direct).collect();
    }
    let of_base = block(key, brick, finest, base);
    let coarse = |&factor: &u32| of_base.as_ref().map(|block| block.coarsened(factor / base));
    factors.iter().map(coarse).collect()
}

/// What a leaf adds; `None` where it has no solid.
fn block(key: NodeKey, brick: &Brick, finest: u8, factor: u32) -> Option<SumBox> {
    let plan = Plan::new(key, finest, factor);
    match brick {
        Brick::Uniform(w) if *w < 1 => None,
        Brick::Uniform(_) => Some(solid(&plan)),
        Brick::Counts { samples, hermite } => {
            let signs = SignChanges::of(samples);
            let mut block = plan.block();
            for axis in Axis::ALL {
                add_axis(&plan, axis, &signs, &hermite.edges[axis.index()], &mut block.sums);
            }
            Some(block)
        }
    }
}

/// A leaf that is solid throughout.
fn solid(plan: &Plan) -> SumBox {
    let mut block = plan.block();
    let chord: [Vec<f64>; 3] = std::array::from_fn(|a| {
        let mut line = vec![0.0; plan.size[a]];
        for (at, sign) in [(plan.base[a], 1.0), (plan.base[a] + plan.step * BRICK_CELLS as f64, -1.0)] {
            let (first, rises) = rises(at);
            (0..3).for_each(|n| line[(first - plan.first[a]) as usize + n] += sign * rises[n]);
        }
        (1..line.len()).for_each(|n| line[n] += line[n - 1]);
        line
    });
    let lines: [Vec<f64>; 3] = std::array::from_fn(|a| plan.all_lines(a));
    let [nx, ny, _] = plan.size;
    for (n, sum) in block.sums.iter_mut().enumerate() {
        let [x, y, z] = [n % nx, n / nx % ny, n / nx / ny];
        let along = [
            chord[0][x] * lines[1][y] * lines[2][z],
            lines[0][x] * chord[1][y] * lines[2][z],
            lines[0][x] * lines[1][y] * chord[2][z],
        ];
        *sum = along.iter().sum::<f64>() / 3.0;
    }
    block
}

/// Adds the chords along one axis, a third each.
fn add_axis(plan: &Plan, axis: Axis, signs: &SignChanges, edges: &[HermiteEdge], sums: &mut [f64]) {
    let a = axis.index();
    let [u, v] = axis.others_in_order().map(Axis::index);
    let strides = [1, plan.size[0], plan.size[0] * plan.size[1]];
    let mut risen = vec![0.0; sums.len()];
    let mut add = |at: f64, sign: f64, beside: [usize; 2]| {
        let (first, rises) = rises(at);
        let start = (first - plan.first[a]) as usize * strides[a];
        for &(m, p) in &plan.lines[u][beside[0]] {
            for &(n, q) in &plan.lines[v][beside[1]] {
                let (place, weight) = (start + m * strides[u] + n * strides[v], sign * p * q);
                (0..3).for_each(|r| risen[place + r * strides[a]] += weight * rises[r]);
            }
        }
    };
    let mut next = edges.iter();
    signs.for_edges(axis, |from| {
        let (edge, inside) = (next.next(), signs.is_inside(from));
        let fraction = edge.map_or(0.5, |edge| edge.fraction());
        let position = |along: f64| plan.base[a] + (from[a] as f64 + along) * plan.step;
        add(position(fraction), if inside { -1.0 } else { 1.0 }, [from[u], from[v]]);
        let share = edge.map_or(0.0, |edge| share_beside(a, edge));
        if share != 0.0 {
            let ends = if inside { [0.0, fraction] } else { [fraction, 1.0] };
            let sample = position(if inside { 0.0 } else { 1.0 });
            for (at, weight) in face_beside(ends.map(position), sample, plan.step) {
                let along = (at - plan.first[a]) as usize * strides[a];
                for &(m, p) in &plan.lines[u][from[u]] {
                    for &(n, q) in &plan.lines[v][from[v]] {
                        sums[along + m * strides[u] + n * strides[v]] += share * weight * p * q;
                    }
                }
            }
        }
    });
    // Where lines enter and leave the leaf.
    for (n, sign) in [(0, 1.0), (BRICK_CELLS, -1.0)] {
        let (first, rises) = rises(plan.base[a] + n as f64 * plan.step);
        let start = (first - plan.first[a]) as usize * strides[a];
        let face = face(plan, signs, a, n);
        for (place, weight) in face.into_iter().enumerate().filter(|(_, weight)| *weight != 0.0) {
            let (m, o) = (place % plan.size[u], place / plan.size[u]);
            let place = start + m * strides[u] + o * strides[v];
            (0..3).for_each(|r| risen[place + r * strides[a]] += sign * weight * rises[r]);
        }
    }
    // Rises become values along the axis.
    for place in 0..sums.len() {
        if !(place / strides[a]).is_multiple_of(plan.size[a]) {
            risen[place] += risen[place - strides[a]];
        }
        sums[place] += risen[place] / 3.0;
    }
}

/// What chords along a face do not see: between the last `sample` that is inside and the face there is solid, where these
/// end half a `step` beyond the sample. The coarse samples with the difference of the two.
fn face_beside([low, high]: [f64; 2], sample: f64, step: f64) -> [(i64, f64); 4] {
    let (first, [a, b]) = tent(0.5 * (low + high));
    let (seen, [c, d]) = tent(sample);
    let (length, half) = (high - low, 0.5 * step);
    [(first, a * length), (first + 1, b * length), (seen, -c * half), (seen + 1, -d * half)]
}

/// The weights of all lines along axis `a` whose sample `n` is inside, on the coarse samples across it.
fn face(plan: &Plan, signs: &SignChanges, a: usize, n: usize) -> Vec<f64> {
    let [u, v] = Axis::ALL[a].others_in_order().map(Axis::index);
    let mut sums = vec![0.0; plan.size[u] * plan.size[v]];
    // Along one axis across first, then along the other.
    let mut line = vec![0.0; plan.size[u]];
    for k in 0..BRICK_POINTS {
        line.fill(0.0);
        for j in 0..BRICK_POINTS {
            let mut ijk = [n; 3];
            (ijk[u], ijk[v]) = (j, k);
            if signs.is_inside(ijk) {
                plan.lines[u][j].iter().for_each(|&(at, weight)| line[at] += weight);
            }
        }
        for &(at, weight) in &plan.lines[v][k] {
            let row = &mut sums[at * plan.size[u]..][..plan.size[u]];
            row.iter_mut().zip(&line).for_each(|(sum, along)| *sum += along * weight);
        }
    }
    sums
}
