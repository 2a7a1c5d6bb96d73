//! Chords of solid along one axis of a leaf.
//!
//! Lines of samples that lie beside each other along the first axis across are a slice. What crossings add to the coarse
//! samples is summed up over a slice first, and shared between the coarse samples along the second axis across once for
//! each slice.

use super::kernel::{rises, tent};
use super::plan::Plan;
use crate::analysis::share_beside;
use crate::brick::{HermiteEdge, SignChanges};
use crate::lattice::{Axis, BRICK_CELLS, BRICK_POINTS};

/// Adds the chords along one axis to the sums of a leaf's block.
pub(super) fn add_chords(
    plan: &Plan,
    axis: Axis,
    signs: &SignChanges,
    edges: &[HermiteEdge],
    sums: &mut [f64],
) {
    let [u, v] = axis.others_in_order().map(Axis::index);
    let (a, width) = (axis.index(), plan.size[u]);
    let mut slice = Slice::new(plan, axis, signs, edges);
    let area = plan.size[a] * width;
    let mut risen = vec![0.0; plan.size[v] * area];
    for (n, weights) in plan.lines[v].iter().enumerate() {
        if weights.is_empty() || !slice.fill(n) {
            continue;
        }
        for &(at, weight) in weights {
            let to = &mut risen[at * area..][..area];
            to.iter_mut().zip(&slice.rises).for_each(|(sum, rise)| *sum += weight * rise);
        }
    }
    // Rises become values along the axis.
    let strides = [1, plan.size[0], plan.size[0] * plan.size[1]];
    let mut values = vec![0.0; width];
    for (n, slice) in risen.chunks_exact(area).enumerate() {
        values.fill(0.0);
        for (at, rises) in slice.chunks_exact(width).enumerate() {
            values.iter_mut().zip(rises).for_each(|(value, rise)| *value += rise);
            let to = &mut sums[n * strides[v] + at * strides[a]..];
            if strides[u] == 1 {
                to.iter_mut().zip(&values).for_each(|(sum, value)| *sum += value);
            } else {
                to.iter_mut().step_by(strides[u]).zip(&values).for_each(|(sum, value)| *sum += value);
            }
        }
    }
}

/// The lines along an axis at one sample of the second axis across.
struct Slice<'a> {
    plan: &'a Plan,
    axis: Axis,
    signs: &'a SignChanges,
    edges: &'a [HermiteEdge],
    /// By row of samples, the edges before it.
    ranks: Box<[u32]>,
    /// By coarse sample along the axis and along the first axis across, how much its value is above that of the one before
    /// along the axis. One more along the axis, behind the last.
    rises: Vec<f64>,
    is_empty: bool,
}

impl<'a> Slice<'a> {
    fn new(plan: &'a Plan, axis: Axis, signs: &'a SignChanges, edges: &'a [HermiteEdge]) -> Slice<'a> {
        let width = plan.size[axis.others_in_order()[0].index()];
        let rises = vec![0.0; (plan.size[axis.index()] + 1) * width];
        Slice { plan, axis, signs, edges, ranks: signs.ranks(axis), rises, is_empty: true }
    }

    /// Sums up what the lines at sample `n` add; false if that is nothing.
    fn fill(&mut self, n: usize) -> bool {
        if !self.is_empty {
            self.rises.fill(0.0);
            self.is_empty = true;
        }
        for m in 0..BRICK_POINTS {
            let (j, k) = if self.axis == Axis::Z { (n, m) } else { (m, n) };
            let (mut bits, row) = (self.signs.edges(self.axis, j, k), self.signs.row(j, k));
            let mut edge = self.ranks[k * BRICK_POINTS + j] as usize;
            while bits != 0 {
                let i = bits.trailing_zeros() as usize;
                let (line, from) = if self.axis == Axis::X { (m, i) } else { (i, m) };
                self.cross(line, from, (self.edges.get(edge), row >> i & 1 != 0));
                (bits, edge) = (bits & (bits - 1), edge + 1);
            }
        }
        // Where lines enter and leave the leaf.
        for (end, sign) in [(0, 1.0), (BRICK_CELLS, -1.0)] {
            let (mut bits, at) = (self.inside_at(n, end), self.position(end, 0.0));
            while bits != 0 {
                self.rise(bits.trailing_zeros() as usize, at, sign);
                bits &= bits - 1;
            }
        }
        !self.is_empty
    }

    /// Bits of the lines that are inside at a sample of theirs.
    fn inside_at(&self, n: usize, at: usize) -> u64 {
        match self.axis {
            Axis::X => (0..BRICK_POINTS).fold(0, |bits, j| bits | (self.signs.row(j, n) >> at & 1) << j),
            Axis::Y => self.signs.row(at, n),
            Axis::Z => self.signs.row(n, at),
        }
    }

    /// A place between a sample of a line and the next in coarse cells.
    #[inline]
    fn position(&self, from: usize, along: f64) -> f64 {
        self.plan.base[self.axis.index()] + (from as f64 + along) * self.plan.step
    }

    /// Adds numbers for coarse samples of a line, from one of them on.
    #[inline]
    fn add<const N: usize>(&mut self, line: usize, first: i64, numbers: [f64; N]) {
        let [u, _] = self.axis.others_in_order().map(Axis::index);
        let width = self.plan.size[u];
        let start = (first - self.plan.first[self.axis.index()]) as usize * width;
        for &(at, weight) in &self.plan.lines[u][line] {
            for (n, number) in numbers.iter().enumerate() {
                self.rises[start + n * width + at] += weight * number;
            }
        }
        self.is_empty = false;
    }

    /// Adds a chord that begins at a place, or takes away one.
    #[inline]
    fn rise(&mut self, line: usize, at: f64, sign: f64) {
        let (first, rises) = rises(at);
        self.add(line, first, rises.map(|rise| sign * rise));
    }

    /// Adds a crossing behind a sample of a line, which is inside or not.
    #[inline]
    fn cross(&mut self, line: usize, from: usize, (edge, inside): (Option<&HermiteEdge>, bool)) {
        let fraction = edge.map_or(0.5, |edge| edge.fraction());
        self.rise(line, self.position(from, fraction), if inside { -1.0 } else { 1.0 });
        let share = edge.map_or(0.0, |edge| share_beside(self.axis.index(), edge));
        if share != 0.0 {
            let ends = if inside { [0.0, fraction] } else { [fraction, 1.0] };
            let sample = self.position(from, if inside { 0.0 } else { 1.0 });
            // Shares are of all three axes.
            let scale = 3.0 * share;
            for (first, [lower, upper]) in
                face_beside(ends.map(|along| self.position(from, along)), sample, self.plan.step)
            {
                // A value is a rise, and a fall behind it.
                let rises = [lower, upper - lower, -upper];
                self.add(line, first, rises.map(|rise| scale * rise));
            }
        }
    }
}

/// What chords along a face do not see: between the last `sample` that is inside and the face there is solid, where these
/// end half a `step` beyond the sample. The first of two coarse samples and the difference at both, of either end.
#[inline]
fn face_beside([low, high]: [f64; 2], sample: f64, step: f64) -> [(i64, [f64; 2]); 2] {
    let (first, there) = tent(0.5 * (low + high));
    let (seen, here) = tent(sample);
    [(first, there.map(|c| c * (high - low))), (seen, here.map(|c| -c * 0.5 * step))]
}
