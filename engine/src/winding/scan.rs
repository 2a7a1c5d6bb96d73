//! Crossings of one triangle with the axis-parallel lines of a lattice.
//!
//! Every sample p counts as p + (ε, ε², ε³) (simulation of simplicity, Edelsbrunner & Mücke 1990), so a line
//! meets a triangle or does not, and a crossing lies before a sample or behind it, never on it. Three i64
//! edge functions decide the first question; the second is a quotient evaluated in f64 under an error bound
//! and settled in 128-bit integers where the bound does not decide.

use crate::lattice::{Triangle, normal};

/// A cubic block of samples `0..=last` along each axis, `1 << shift` units apart, sample 0 at the origin.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Block {
    /// log₂ of the spacing.
    pub shift: u32,
    /// Index of the last sample along an axis.
    pub last: i32,
}

/// One crossing of a lattice edge.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Crossing {
    /// Index of the line along the axis after the crossed one in cyclic order (x → y → z → x).
    pub u: i32,
    /// Index of the line along the remaining axis.
    pub v: i32,
    /// Index of the sample before the crossing; the next one lies behind it.
    pub lower: i32,
    /// Distance from that sample in 1/65536 of the spacing, rounded to nearest and at most 65535.
    pub offset: u16,
}

/// A triangle relative to sample 0 of a block, with what all three axes need.
pub(crate) struct Facet {
    vertices: [[i32; 3]; 3],
    /// Twice the area vector.
    pub normal: [i64; 3],
    /// First and last line index that the bounding box meets, per axis, clipped to the block.
    first: [i32; 3],
    last: [i32; 3],
}

impl Facet {
    /// `None` if the triangle meets no line of the block or has no area.
    #[inline]
    pub fn new(t: &Triangle, origin: [i32; 3], block: Block) -> Option<Facet> {
        let vertices = t.map(|p| std::array::from_fn(|a| p[a] - origin[a]));
        let below = (1 << block.shift) - 1;
        let mut first = [0; 3];
        let mut last = [0; 3];
        let mut met = 0;
        for a in 0..3 {
            let min = vertices[0][a].min(vertices[1][a]).min(vertices[2][a]);
            let max = vertices[0][a].max(vertices[1][a]).max(vertices[2][a]);
            first[a] = ((min + below) >> block.shift).max(0);
            last[a] = (max >> block.shift).min(block.last);
            met += i32::from(first[a] <= last[a]);
        }
        // A line along one axis needs a line index along both others.
        if met < 2 {
            return None;
        }
        let normal = normal(&vertices);
        (normal != [0; 3]).then_some(Facet { vertices, normal, first, last })
    }

    /// The change of the winding number along `axis` at a crossing: entering through a facet whose outward
    /// normal points back adds one.
    #[inline]
    pub fn jump(&self, axis: usize) -> i32 {
        -(self.normal[axis].signum() as i32)
    }

    /// Calls `hit` for every crossing with a line along axis `A` whose (u, v) indices do not exceed the
    /// limits and that lies between two samples of the block.
    #[inline(always)]
    pub fn scan<const A: usize>(&self, block: Block, limit: [i32; 2], mut hit: impl FnMut(Crossing)) {
        let (u, v) = ((A + 1) % 3, (A + 2) % 3);
        let (u0, u1) = (self.first[u], self.last[u].min(limit[0]));
        let (v0, v1) = (self.first[v], self.last[v].min(limit[1]));
        if u0 > u1 || v0 > v1 || self.normal[A] == 0 {
            return;
        }
        let edges = EdgeFunctions::new::<A>(self, block, u0, v0);
        let depth = Depth::new::<A>(self, block, u0);
        let mut row = edges.start;
        for line_v in v0..=v1 {
            let along = depth.row::<A>(self, block, line_v);
            let (from, to) = edges.span(row, u1 - u0);
            for step in from..=to {
                if let Some((lower, offset)) = depth.locate::<A>(self, block, along, (u0, step), line_v) {
                    hit(Crossing { u: u0 + step, v: line_v, lower, offset });
                }
            }
            for i in 0..3 {
                row[i] += edges.step_v[i];
            }
        }
    }
}

/// The three edge functions of a projected triangle at its first line, and their steps. A line is inside
/// when none is negative; ties are folded in by subtracting one where the perturbed value is negative.
struct EdgeFunctions {
    start: [i64; 3],
    step_u: [i64; 3],
    step_v: [i64; 3],
    /// 1 / step_u, infinite where that is zero.
    inverse_u: [f64; 3],
}

impl EdgeFunctions {
    #[inline(always)]
    fn new<const A: usize>(facet: &Facet, block: Block, u0: i32, v0: i32) -> EdgeFunctions {
        let (u, v) = ((A + 1) % 3, (A + 2) % 3);
        let sign = facet.normal[A].signum();
        let (pu, pv) = (i64::from(u0) << block.shift, i64::from(v0) << block.shift);
        let mut out = EdgeFunctions { start: [0; 3], step_u: [0; 3], step_v: [0; 3], inverse_u: [0.0; 3] };
        for i in 0..3 {
            let (a, b) = (facet.vertices[i], facet.vertices[(i + 1) % 3]);
            let along_u = -sign * i64::from(b[v] - a[v]);
            let along_v = sign * i64::from(b[u] - a[u]);
            // ε belongs to the axis that comes first in x, y, z; along y that is v, which is x.
            let (first, second) = if A == 1 { (along_v, along_u) } else { (along_u, along_v) };
            let tie = i64::from(first < 0 || (first == 0 && second < 0));
            out.start[i] = along_v * (pv - i64::from(a[v])) + along_u * (pu - i64::from(a[u])) - tie;
            out.step_u[i] = along_u << block.shift;
            out.step_v[i] = along_v << block.shift;
            out.inverse_u[i] = 1.0 / out.step_u[i] as f64;
        }
        out
    }

    /// First and last step in 0..=last at which no edge function is negative, given their values at step 0;
    /// an empty range if there is none. The quotient in f64 is off by less than one, and the exact edge
    /// function corrects it.
    #[inline(always)]
    fn span(&self, row: [i64; 3], last: i32) -> (i32, i32) {
        const EMPTY: (i32, i32) = (1, 0);
        let (mut from, mut to) = (0, i64::from(last));
        for i in 0..3 {
            let (value, step) = (row[i], self.step_u[i]);
            if step > 0 {
                if value + from * step < 0 {
                    from = ((-value as f64 * self.inverse_u[i]) as i64).min(to + 1);
                    while from <= to && value + from * step < 0 {
                        from += 1;
                    }
                }
            } else if value + to * step < 0 {
                if value < 0 {
                    return EMPTY;
                }
                to = (-value as f64 * self.inverse_u[i]) as i64 + 1;
                while value + to * step < 0 {
                    to -= 1;
                }
            }
            if from > to {
                return EMPTY;
            }
        }
        (from as i32, to as i32)
    }
}

/// Where a line crosses the triangle's plane, in 1/65536 of the spacing, as a linear function in f64.
struct Depth {
    /// At the first line, as far as the axis and u go.
    at: f64,
    slope_v: f64,
    /// Change from one line to the next along u.
    step_u: f64,
    /// Bound on the rounding error of the whole expression.
    error: f64,
    /// Depth of the last sample.
    beyond: f64,
}

impl Depth {
    #[inline(always)]
    fn new<const A: usize>(facet: &Facet, block: Block, u0: i32) -> Depth {
        let (u, v) = ((A + 1) % 3, (A + 2) % 3);
        // Powers of two, so the scaling is exact.
        let spacing = f64::from_bits((1023 + u64::from(block.shift)) << 52);
        let scale = f64::from_bits((1023 + 16 - u64::from(block.shift)) << 52);
        let scaled = scale / facet.normal[A] as f64;
        let slope_u = facet.normal[u] as f64 * scaled;
        let slope_v = facet.normal[v] as f64 * scaled;
        let along = f64::from(facet.vertices[0][A]) * scale;
        let extent = |a: usize| {
            let p = facet.vertices;
            f64::from((p[1][a] - p[0][a]).abs().max((p[2][a] - p[0][a]).abs()))
        };
        // A line that meets the triangle is no farther from vertex 0 than the extent, nor is the first such
        // line. Each term carries at most six roundings of 2^-53 of its size and the u terms count twice;
        // 2^-48 leaves a factor of two and more.
        let size = along.abs() + slope_u.abs() * extent(u) + slope_v.abs() * extent(v);
        Depth {
            at: along + slope_u * f64::from(facet.vertices[0][u] - (u0 << block.shift)),
            slope_v,
            step_u: slope_u * spacing,
            error: size * f64::from_bits((1023 - 48) << 52),
            beyond: f64::from(block.last << 16),
        }
    }

    /// The depth at the first line of the row.
    #[inline(always)]
    fn row<const A: usize>(&self, facet: &Facet, block: Block, v: i32) -> f64 {
        self.at + self.slope_v * f64::from(facet.vertices[0][(A + 2) % 3] - (v << block.shift))
    }

    /// The sample before the crossing and the offset from it; `None` outside the block. `u` is the first
    /// line and the steps from there.
    #[inline(always)]
    fn locate<const A: usize>(
        &self,
        facet: &Facet,
        block: Block,
        row: f64,
        u: (i32, i32),
        v: i32,
    ) -> Option<(i32, u16)> {
        /// Adding this rounds to an integer that stands in the low mantissa bits.
        const ROUND: f64 = (1u64 << 52) as f64 * 1.5;
        let depth = row - self.step_u * f64::from(u.1);
        if depth < -1.0 - self.error || depth > self.beyond + 1.0 + self.error {
            return None;
        }
        let shifted = depth + ROUND;
        let rounded = shifted.to_bits() as i32;
        let rest = depth - (shifted - ROUND);
        let near_sample = rounded & 0xffff == 0;
        let doubtful = rest.abs() > 0.5 - self.error || (near_sample && rest.abs() <= self.error);
        let (lower, offset) = if doubtful {
            locate_exactly(facet, block, A, u.0 + u.1, v)
        } else {
            let lower = (rounded - i32::from(near_sample && rest < 0.0)) >> 16;
            (lower, rounded - (lower << 16))
        };
        (lower >= 0 && lower < block.last).then(|| (lower, offset.min(65535) as u16))
    }
}

/// [`Depth::locate`] in 128-bit integers: the sample before the crossing, -1 or the last one where that is
/// outside the block, and the offset in 0..=65536.
#[cold]
#[inline(never)]
fn locate_exactly(facet: &Facet, block: Block, axis: usize, u: i32, v: i32) -> (i32, i32) {
    let (au, av) = ((axis + 1) % 3, (axis + 2) % 3);
    let n = facet.normal.map(i128::from);
    let a = facet.vertices[0].map(i128::from);
    let sign = n[axis].signum();
    let from_line = n[au] * (a[au] - (i128::from(u) << block.shift))
        + n[av] * (a[av] - (i128::from(v) << block.shift))
        + n[axis] * a[axis];
    // The crossing is at `numerator / (denominator · spacing)` samples from sample 0.
    let numerator = sign * from_line;
    let denominator = (sign * n[axis]) << block.shift;
    let mut lower = numerator.div_euclid(denominator);
    if numerator.rem_euclid(denominator) == 0 {
        // On a sample: it lies behind the crossing if the perturbed sample is on the side that the line
        // leaves to, that is if the first non-zero normal component has the sign of this axis's.
        let first = n.iter().find(|c| **c != 0).map_or(0, |c| c.signum());
        lower -= i128::from(first == sign);
    }
    let rest = numerator - lower * denominator;
    let offset = (rest * (65536 * 2) + denominator).div_euclid(2 * denominator);
    (lower.clamp(-1, i128::from(block.last)) as i32, offset as i32)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Everything in i128 with the perturbation as explicit small numbers: coordinates times 2^60,
    /// ε = 2^40, ε² = 2^20, ε³ = 1 are far apart for the small triangles used here.
    fn reference<const A: usize>(t: &Triangle, block: Block) -> Vec<(i32, i32, i32)> {
        const EPS: [i128; 3] = [1 << 40, 1 << 20, 1];
        let (au, av) = ((A + 1) % 3, (A + 2) % 3);
        let n = normal(t).map(i128::from);
        let mut out = Vec::new();
        let at = |i: i32, a: usize| ((i128::from(i) << block.shift) << 60) + EPS[a];
        for v in 0..=block.last {
            for u in 0..=block.last {
                let inside = (0..3).all(|i| {
                    let (a, b) = (t[i].map(i128::from), t[(i + 1) % 3].map(i128::from));
                    let e = (b[au] - a[au]) * (at(v, av) - (a[av] << 60))
                        - (b[av] - a[av]) * (at(u, au) - (a[au] << 60));
                    e * n[A].signum() > 0
                });
                if n[A] == 0 || !inside {
                    continue;
                }
                let side = |i: i32| {
                    let mut p = [0i128; 3];
                    (p[A], p[au], p[av]) = (at(i, A), at(u, au), at(v, av));
                    (0..3).map(|a| n[a] * (p[a] - (i128::from(t[0][a]) << 60))).sum::<i128>() * n[A].signum()
                };
                if let Some(lower) = (0..block.last).find(|&i| side(i) < 0 && side(i + 1) > 0) {
                    out.push((u, v, lower));
                }
            }
        }
        out
    }

    fn scanned<const A: usize>(t: &Triangle, block: Block) -> Vec<(i32, i32, i32)> {
        let mut out = Vec::new();
        if let Some(facet) = Facet::new(t, [0; 3], block) {
            facet.scan::<A>(block, [block.last; 2], |c| out.push((c.u, c.v, c.lower)));
        }
        out
    }

    /// Odd vertices, many on 45° faces through samples, some far outside.
    fn triangle() -> impl Strategy<Value = Triangle> {
        let vertex = prop::array::uniform3(-6i32..22).prop_map(|v| v.map(|c| 2 * c + 1));
        (prop::array::uniform3(vertex.clone()), vertex, 0..4usize).prop_map(|(mut t, d, flatten)| {
            if flatten < 3 {
                // Force a 45° plane: one coordinate a copy of another up to an even shift.
                for p in &mut t {
                    p[flatten] = p[(flatten + 1) % 3] + 2 * (d[0] / 8);
                }
            }
            t
        })
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(3000))]
        #[test]
        fn crossings_match_the_perturbed_reference(t in triangle(), shift in 1u32..4) {
            let block = Block { shift, last: 6 };
            prop_assert_eq!(scanned::<0>(&t, block), reference::<0>(&t, block));
            prop_assert_eq!(scanned::<1>(&t, block), reference::<1>(&t, block));
            prop_assert_eq!(scanned::<2>(&t, block), reference::<2>(&t, block));
        }

        #[test]
        fn fast_and_exact_location_agree(t in prop::array::uniform3(prop::array::uniform3(-(1i32 << 22)..1 << 22)),
                                         shift in 3u32..20) {
            let t = t.map(|v| v.map(|c| 2 * c + 1));
            let block = Block { shift, last: 32 };
            if let Some(facet) = Facet::new(&t, [0; 3], block) {
                let mut checked = Vec::new();
                facet.scan::<0>(block, [32, 32], |c| checked.push((0, c)));
                facet.scan::<1>(block, [32, 32], |c| checked.push((1, c)));
                facet.scan::<2>(block, [32, 32], |c| checked.push((2, c)));
                for (axis, c) in checked {
                    let (lower, offset) = locate_exactly(&facet, block, axis, c.u, c.v);
                    prop_assert_eq!((c.lower, i32::from(c.offset)), (lower, offset.min(65535)));
                }
            }
        }
    }

    #[test]
    fn an_edge_shared_by_two_triangles_belongs_to_one() {
        // A square through samples, split along both diagonals: each line crosses exactly once.
        let block = Block { shift: 1, last: 8 };
        for flip in [false, true] {
            let p = [[1, 1, 3], [13, 1, 3], [13, 13, 3], [1, 13, 3]];
            let (a, b) = if flip {
                ([p[0], p[1], p[3]], [p[1], p[2], p[3]])
            } else {
                ([p[0], p[1], p[2]], [p[0], p[2], p[3]])
            };
            let mut all = scanned::<2>(&a, block);
            all.extend(scanned::<2>(&b, block));
            all.sort_unstable();
            let expected: Vec<_> = (1..=6).flat_map(|u| (1..=6).map(move |v| (u, v, 1))).collect();
            assert_eq!(all, expected);
        }
    }
}
