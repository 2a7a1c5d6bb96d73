//! Hermite edges of a field that is smooth between jumps.

use crate::brick::{HermiteEdge, OctNormal, POINTS, Samples, SignChanges};
use crate::lattice::{Axis, BRICK_POINTS};

/// Samples along a row.
const P: usize = BRICK_POINTS;

/// A crossing of a lattice edge with a facet, in the order in which they are passed.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct SurfaceJump {
    pub lower: u16,
    pub offset: u16,
    pub normal: OctNormal,
    pub jump: i32,
}

/// The field without its jumps: what is left of the difference of two neighbouring samples when the facets
/// between them are taken off.
pub(super) struct SmoothField<'a> {
    samples: &'a Samples,
    /// Sum of the jumps on each lattice edge, by axis and lower sample.
    jumps: [Vec<i32>; 3],
}

impl<'a> SmoothField<'a> {
    pub fn new(samples: &'a Samples, crossings: &[Vec<SurfaceJump>; 3]) -> SmoothField<'a> {
        let jumps = [0, 1, 2].map(|axis| {
            let mut jumps = vec![0; POINTS];
            crossings[axis].iter().for_each(|c: &SurfaceJump| jumps[usize::from(c.lower)] += c.jump);
            jumps
        });
        SmoothField { samples, jumps }
    }

    /// Change along the lattice edge from sample `lower`, in quanta, without the jumps.
    fn step(&self, axis: Axis, lower: usize) -> i32 {
        let upper = lower + stride(axis);
        let change = i32::from(self.samples.0[upper]) - i32::from(self.samples.0[lower]);
        change - (self.jumps[axis.index()][lower] << self.samples.1)
    }

    /// Twice the slope at a sample, one-sided at the border of the brick.
    fn slope(&self, axis: Axis, index: usize) -> i64 {
        let at = index / stride(axis) % P;
        let before = (at > 0).then(|| self.step(axis, index - stride(axis)));
        let behind = (at + 1 < P).then(|| self.step(axis, index));
        match (before, behind) {
            (Some(a), Some(b)) => i64::from(a) + i64::from(b),
            (a, b) => 2 * i64::from(a.or(b).unwrap_or(0)),
        }
    }

    /// One Hermite edge for each sign-changing edge along `axis`.
    pub fn edges(&self, axis: Axis, signs: &SignChanges, crossings: &[SurfaceJump]) -> Vec<HermiteEdge> {
        let mut edges = Vec::new();
        let mut next = 0;
        for row in 0..P * P {
            let mut bits = signs.edges(axis, row % P, row / P);
            while bits != 0 {
                let lower = row * P + bits.trailing_zeros() as usize;
                bits &= bits - 1;
                while crossings.get(next).is_some_and(|c| usize::from(c.lower) < lower) {
                    next += 1;
                }
                let count = crossings[next..].iter().take_while(|c| usize::from(c.lower) == lower).count();
                edges.push(self.settle(axis, lower, &crossings[next..next + count]));
                next += count;
            }
        }
        edges
    }

    /// The first point of a lattice edge where the field passes 0.5: a facet where it jumps across, or the root
    /// of the part between. Without a facet on the edge that part is taken for the cubic with the samples' slopes, else to
    /// be linear.
    fn settle(&self, axis: Axis, lower: usize, crossings: &[SurfaceJump]) -> HermiteEdge {
        let bits = self.samples.1;
        let half = f64::from(1u32 << bits) * 0.5;
        let start = f64::from(self.samples.0[lower]);
        if crossings.is_empty() {
            let end = f64::from(self.samples.0[lower + stride(axis)]);
            let slopes = [lower, lower + stride(axis)].map(|index| 0.5 * self.slope(axis, index) as f64);
            return self.root(axis, lower, cubic_root([start - half, end - half], slopes));
        }
        let inside = start >= half;
        let step = f64::from(self.step(axis, lower));
        let mut jumped = 0.0;
        for group in crossings.chunk_by(|a, b| a.offset == b.offset) {
            let at = f64::from(group[0].offset) / 65536.0;
            let before = start + step * at + jumped;
            if (before >= half) != inside {
                return self.root(axis, lower, (half - start - jumped) / step);
            }
            jumped += f64::from(group.iter().map(|c| c.jump).sum::<i32>()) * 2.0 * half;
            let after = start + step * at + jumped;
            if (after >= half) != inside {
                let direction = if inside { -1 } else { 1 };
                let facet = group.iter().find(|c| c.jump == direction).unwrap_or(&group[0]);
                return HermiteEdge { offset: group[0].offset, normal: facet.normal };
            }
        }
        self.root(axis, lower, (half - start - jumped) / step)
    }

    /// A passage between facets, with the normal −∇w.
    fn root(&self, axis: Axis, lower: usize, fraction: f64) -> HermiteEdge {
        let upper = lower + stride(axis);
        let offset = (fraction.clamp(0.0, 1.0) * 65536.0).min(65535.0) as u16;
        let mut normal = Axis::ALL.map(|a| -(self.slope(a, lower) + self.slope(a, upper)));
        if normal == [0; 3] {
            let falls = self.samples.0[lower] > self.samples.0[upper];
            normal[axis.index()] = if falls { 1 } else { -1 };
        }
        HermiteEdge { offset, normal: OctNormal::from_integer(normal) }
    }
}

/// Where in 0..1 the cubic with these values at both ends, of which one is negative, and these slopes is 0.
fn cubic_root([start, end]: [f64; 2], [from, to]: [f64; 2]) -> f64 {
    // As a Bernstein polynomial, which de Casteljau's rule halves: its sign at the middle tells in which half it passes 0.
    let mut c = [start, start + from / 3.0, end - to / 3.0, end];
    let (mut low, mut size) = (0.0, 1.0);
    for _ in 0..24 {
        let middle = |a: f64, b: f64| 0.5 * (a + b);
        let [ab, bc, cd] = [middle(c[0], c[1]), middle(c[1], c[2]), middle(c[2], c[3])];
        let (abc, bcd) = (middle(ab, bc), middle(bc, cd));
        let all = middle(abc, bcd);
        size *= 0.5;
        if (all < 0.0) == (c[0] < 0.0) {
            low += size;
            c = [all, bcd, cd, c[3]];
        } else {
            c = [c[0], ab, abc, all];
        }
    }
    low
}

fn stride(axis: Axis) -> usize {
    match axis {
        Axis::X => 1,
        Axis::Y => P,
        Axis::Z => P * P,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn roots_of_cubics() {
        // x³ − 0.3 from both sides, and a line.
        assert!((cubic_root([-0.3, 0.7], [0.0, 3.0]) - 0.3f64.cbrt()).abs() < 1e-6);
        assert!((cubic_root([0.3, -0.7], [0.0, -3.0]) - 0.3f64.cbrt()).abs() < 1e-6);
        assert!((cubic_root([-1.0, 3.0], [4.0, 4.0]) - 0.25).abs() < 1e-6);
        // A value of 0 counts as positive.
        assert!(cubic_root([0.0, -1.0], [-1.0, -1.0]) < 1e-6);
    }
}
