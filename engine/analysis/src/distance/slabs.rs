//! Round slabs around what is in boxes: along the middle of its normals, surface is far thinner than its box.

use super::boxes::{Boxes, Lanes, NodeLevels, Normals, Probe, WIDE, lanes_of, widened};
use crate::wide::{Select, Simd, SimdBase, SimdFloat, f32x8};

/// Half thicknesses of what is in a box are counted in such parts of half of its diagonal.
const THICK_STEPS: f32 = 255.0;
/// What rounding may do to the squares of heights over a slab, and of ways beside it, as a part of the square of the distance.
const SLAB_ROUNDING: f32 = 4e-6;

impl Lanes {
    /// How near they are, infinite for those that a ball certainly does not reach, by the round slab around what is in each:
    /// that is far thinner than a box whose content lies askew.
    #[inline(always)]
    pub fn reached<S: Simd>(
        &self,
        simd: S,
        normals: &Normals,
        (probe, radius): (&Probe, f32),
        near: f32x8<S>,
    ) -> f32x8<S> {
        if normals.thick == [u8::MAX; WIDE] {
            return near;
        }
        let number = |number: f32| f32x8::splat(simd, number);
        let zero = number(0.0);
        let (mut square, mut half, mut along, mut length) = (zero, zero, zero, zero);
        let mut far = zero;
        for a in 0..3 {
            let (low, high) = (lanes_of(simd, &self.low[a]), lanes_of(simd, &self.high[a]));
            let away = number(probe.at[a]) - (low + high) * number(0.5);
            let size = high - low;
            let normal =
                lanes_of(simd, &widened(&normals.low[a])) + lanes_of(simd, &widened(&normals.high[a]));
            square += away * away;
            half += size * size;
            along += away * normal;
            length += normal * normal;
            far += number(probe.nearer[a]);
        }
        let half = half.sqrt() * number(0.5);
        // Of normals that cancel out nothing is told.
        let is_told = length.simd_gt(number(1.0));
        let height = along / length.max(number(1.0)).sqrt();
        let thick = half * lanes_of(simd, &thickness(&normals.thick));
        let above = (height.abs() - thick - far).max(zero);
        let beside = ((square - height * height) - square * number(SLAB_ROUNDING)).max(zero).sqrt();
        let beside = (beside - half - far).max(zero);
        let least = (above * above + beside * beside) * number(1.0 - SLAB_ROUNDING);
        (is_told & least.simd_gt(number(radius * radius))).select(number(f32::INFINITY), near)
    }
}

#[inline(always)]
fn thickness(codes: &[u8; WIDE]) -> [f32; WIDE] {
    let mut thick = [0.0; WIDE];
    for n in 0..WIDE {
        thick[n] = f32::from(codes[n]) * (1.0 / THICK_STEPS);
    }
    thick
}

impl Boxes {
    /// With slabs around things that have normals, by points of which each thing is the hull but for a margin.
    pub fn with_slabs<P: Iterator<Item = [f32; 3]>>(mut self, points: impl Fn(usize) -> (P, f32)) -> Boxes {
        let mut things_below = self.per_run;
        for nodes in NodeLevels::over(self.things.div_ceil(self.per_run)).ranges() {
            for at in nodes.clone() {
                for slot in 0..WIDE {
                    let first = ((at - nodes.start) * WIDE + slot) * things_below;
                    let last = (first + things_below).min(self.things);
                    if first < last {
                        self.normals[at].thick[slot] = self.thick(at, slot, (first..last).map(&points));
                    }
                }
            }
            things_below *= WIDE;
        }
        self
    }

    /// How thick the content of a box is along the middle of its normals.
    fn thick<P: Iterator<Item = [f32; 3]>>(
        &self,
        at: usize,
        slot: usize,
        things: impl Iterator<Item = (P, f32)>,
    ) -> u8 {
        let (lanes, normals) = (&self.nodes[at], &self.normals[at]);
        let ends = [0, 1, 2].map(|a| [lanes.low[a][slot], lanes.high[a][slot]].map(f64::from));
        let normal = [0, 1, 2].map(|a| f64::from(normals.low[a][slot]) + f64::from(normals.high[a][slot]));
        let length = normal.iter().map(|c| c * c).sum::<f64>().sqrt();
        let half = 0.5 * ends.iter().map(|[low, high]| (high - low).powi(2)).sum::<f64>().sqrt();
        let mut most = 0.0f64;
        for (points, margin) in things {
            for point in points {
                let along =
                    (0..3).map(|a| normal[a] * (f64::from(point[a]) - 0.5 * (ends[a][0] + ends[a][1])));
                most = most.max(along.sum::<f64>().abs() / length.max(1.0) + f64::from(margin));
            }
        }
        // Conversion saturates, and nothing is thicker than its box.
        (most / half.max(f64::MIN_POSITIVE) * f64::from(THICK_STEPS) + 0.01).ceil() as u8
    }
}

#[cfg(test)]
mod tests {
    use super::super::boxes::block_of;
    use super::*;
    use crate::lattice::{dot, minus, mix};
    use crate::wide::{dispatch, level};

    #[test]
    fn no_slab_hides_what_a_ball_reaches() {
        let random = |n: u64| (mix(n) >> 11) as f64 / (1u64 << 53) as f64;
        let three = |n: u64| [0, 1, 2].map(|a| random(3 * n + a) - 0.5);
        let unit = |v: [f64; 3]| v.map(|c| c / dot(v, v).sqrt());
        // Points near a plane that lies askew, with normals that waver.
        let normal = unit([0.3, -0.5, 0.8]);
        let point = |n: u64| {
            let free = three(n).map(|c| 30.0 * c);
            let off = dot(free, normal) - 0.2 * random(n + 9_000_000);
            [0, 1, 2].map(|a| (free[a] - off * normal[a]) as f32)
        };
        let points: Vec<[f32; 3]> = (0..1000).map(point).collect();
        let wide = |p: &[f32; 3]| p.map(f64::from);
        let block = |p: &[f32; 3]| block_of(std::iter::once(wide(p)), 0.0);
        let turned = |n: u64| unit([0, 1, 2].map(|a| normal[a] + 0.1 * three(n + 77_777)[a]));
        let normals = (0..points.len()).map(|n| block_of(std::iter::once(turned(n as u64)), 0.0));
        let boxes = Boxes::new(points.iter().map(block), 1)
            .with_normals(normals)
            .with_slabs(|n| (std::iter::once(points[n]), 0.0));
        let (mut hidden, mut shown) = (0, 0);
        for ball in 0..200u64 {
            let radius = [1.0, 20.0, 700.0][ball as usize % 3] * (0.5 + random(ball + 5_000_000));
            let beside = three(ball + 6_000_000).map(|c| 20.0 * c);
            let centre: [f64; 3] = std::array::from_fn(|a| beside[a] + radius * normal[a]);
            let probe = Probe::new(centre, boxes.size());
            for (node, first) in (0..points.len().div_ceil(WIDE)).map(|n| (n, n * WIDE)) {
                let mut near = [0.0; WIDE];
                let (lanes, normals) = (&boxes.nodes[node], &boxes.normals[node]);
                dispatch!(level(), simd => {
                    let zero = f32x8::splat(simd, 0.0);
                    lanes.reached(simd, normals, (&probe, radius as f32), zero).store_slice(&mut near)
                });
                for (point, near) in points[first..].iter().zip(near) {
                    let away = minus(wide(point), centre);
                    let is_reached = dot(away, away) <= radius * radius;
                    assert!(!is_reached || near == 0.0, "{centre:?} {radius} {point:?}");
                    hidden += usize::from(near > 0.0);
                    shown += usize::from(is_reached);
                }
            }
        }
        assert!(hidden > 10_000 && shown > 1000, "{hidden} {shown}");
    }
}
