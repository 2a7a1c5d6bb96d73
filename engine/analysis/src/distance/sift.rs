//! Which of eight patches a ball may reach, told at once.
//!
//! The bounds are those of [`Patch::is_beyond`] and [`Patch::bent_is_beyond`], in the same order of operations, so that what
//! is found does not depend on which of both is asked.

use super::boxes::WIDE;
use super::patch::{Patch, Shape};
use crate::wide::{Select, Simd, SimdBase, SimdFloat, SimdMask, f32x8, f64x8, mask64x8, narrowed, widened};

/// A ball, from the base of a piece.
pub(super) struct PieceBall {
    pub centre: [f64; 3],
    /// The outward normal where it touches.
    pub outward: [f64; 3],
    /// Patches whose normals are turned by less than this cosine against that do not count.
    pub apart: f64,
    /// Squares of the distances from the centre below which bent and other patches shrink it.
    pub within: [f64; 2],
}

/// Numbers of eight patches.
struct EightPatches<S: Simd> {
    at: [f64x8<S>; 3],
    normal: [f64x8<S>; 3],
    bend: [f64x8<S>; 3],
    radius: f64x8<S>,
}

#[inline(always)]
fn dot<S: Simd>(a: &[f64x8<S>; 3], b: &[f64x8<S>; 3]) -> f64x8<S> {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

impl<S: Simd> EightPatches<S> {
    #[inline(always)]
    fn of(simd: S, patches: &[Patch]) -> EightPatches<S> {
        let mut rows = [[0f32; WIDE]; 10];
        let last = patches.len() - 1;
        for n in 0..WIDE {
            let patch = &patches[n.min(last)];
            for a in 0..3 {
                rows[a][n] = patch.at[a];
                rows[3 + a][n] = patch.normal[a];
                rows[6 + a][n] = patch.bend[a];
            }
            rows[9][n] = patch.radius;
        }
        let wide = |n: usize| widened(simd, f32x8::from_slice(simd, &rows[n]));
        EightPatches {
            at: [wide(0), wide(1), wide(2)],
            normal: [wide(3), wide(4), wide(5)],
            bend: [wide(6), wide(7), wide(8)],
            radius: wide(9),
        }
    }
}

/// Of at most eight patches the bits of those that a ball may reach.
#[inline(always)]
pub(super) fn within_reach<S: Simd>(simd: S, patches: &[Patch], ball: &PieceBall) -> u64 {
    let number = |number: f64| f64x8::splat(simd, number);
    let (zero, one, two, half_one) = (number(0.0), number(1.0), number(2.0), number(0.5));
    let EightPatches { at, normal, bend: [xx, xy, yy], radius } = EightPatches::of(simd, patches);
    let outward = [number(ball.outward[0]), number(ball.outward[1]), number(ball.outward[2])];
    let size = (xx * xx + two * xy * xy + yy * yy).sqrt();
    let turn = widened(simd, narrowed(simd, size) * narrowed(simd, radius));
    let is_turned = (dot(&normal, &outward) - turn).simd_gt(number(ball.apart));

    let (mut bent, mut rough) = (0, 0);
    for (n, patch) in patches.iter().enumerate() {
        bent |= u64::from(patch.shape() == Shape::Bent) << n;
        rough |= u64::from(patch.shape() == Shape::Rough) << n;
    }
    let is_bent = mask64x8::from_bitmask(simd, bent);
    let within = is_bent.select(number(ball.within[0]), number(ball.within[1]));
    let centre = [number(ball.centre[0]), number(ball.centre[1]), number(ball.centre[2])];
    let away = [centre[0] - at[0], centre[1] - at[1], centre[2] - at[2]];
    let (square, height) = (dot(&away, &away), dot(&away, &normal));
    let reach = square.sqrt() - radius;
    let is_outside = reach.simd_gt(zero) & (reach * reach).simd_gt(within);

    let (mean, half) = (half_one * (xx + yy), half_one * (xx - yy));
    let turn = (half * half + xy * xy).sqrt();
    let beside = (square - height * height).max(zero).sqrt();
    let bend = one - (height * mean + height.abs() * turn);
    let is_beyond = (square + least(simd, bend, beside, radius)).simd_gt(within);

    let [u, v] = frame(simd, &normal);
    let (x, y, z) = (dot(&away, &u), dot(&away, &v), height);
    let turn = turn.max(number(f64::MIN_POSITIVE));
    let flat = x * x + y * y;
    let along = half_one * (flat + ((x * x - y * y) * half + two * x * y * xy) / turn);
    let along = along.max(zero).min(flat);
    let across = flat - along;
    let first = least(simd, one - z * (mean + turn), along.sqrt(), radius);
    let second = least(simd, one - z * (mean - turn), across.sqrt(), radius);
    let bent_is_beyond = (flat + z * z + first + second).simd_gt(within);

    let far = is_outside.to_bitmask()
        | is_beyond.to_bitmask() & !rough
        | bent_is_beyond.to_bitmask() & bent
        | is_turned.to_bitmask();
    !far & ((1 << patches.len().min(WIDE)) - 1)
}

/// By how much the square of a distance is less beside a crossing, at least, where a direction bends so much towards the place.
#[inline(always)]
fn least<S: Simd>(simd: S, bend: f64x8<S>, beside: f64x8<S>, radius: f64x8<S>) -> f64x8<S> {
    let zero = f64x8::splat(simd, 0.0);
    let is_near = bend.simd_gt(zero) & beside.simd_le(bend * radius);
    let square = beside * beside;
    is_near.select(zero - square / bend, (bend * radius - (beside + beside)) * radius)
}

/// See [`crate::lattice::frame`].
#[inline(always)]
fn frame<S: Simd>(simd: S, [x, y, z]: &[f64x8<S>; 3]) -> [[f64x8<S>; 3]; 2] {
    let (zero, one) = (f64x8::splat(simd, 0.0), f64x8::splat(simd, 1.0));
    let sign = one.copysign(*z);
    let a = (zero - one) / (sign + *z);
    let b = *x * *y * a;
    [[one + sign * *x * *x * a, sign * b, zero - sign * *x], [b, sign + *y * *y * a, zero - *y]]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lattice::{dot, minus, mix};
    use crate::wide::{dispatch, level};

    #[test]
    fn eight_at_once_are_told_as_one_by_one() {
        let random = |n: u64| (mix(n) >> 11) as f64 / (1u64 << 53) as f64 - 0.5;
        let three = |n: u64| [0, 1, 2].map(|a| random(3 * n + a));
        let unit = |v: [f64; 3]| v.map(|c| c / dot(v, v).sqrt());
        let (mut reached, mut shapes) = (0, [0; 3]);
        for round in 0..300u64 {
            let mut ring = Vec::new();
            let count = 1 + round as usize % WIDE;
            let one = |n: usize| {
                let name = 100 * round + n as u64;
                let (at, normal) = (three(name).map(|c| 6.0 * c), unit(three(name + 1_000_000)));
                let [u, v] = crate::lattice::frame(normal);
                let bend = [0.0, 0.2, 8.0][n % 3] * random(name + 2_000_000);
                let corner = |[x, y]: [f64; 2]| {
                    let z = bend * (x * x - 0.4 * y * y);
                    std::array::from_fn(|a| at[a] + x * u[a] + y * v[a] + z * normal[a])
                };
                let corners = [[0.6, 0.5], [-0.4, 0.6], [-0.5, -0.6], [0.7, -0.4]].map(corner);
                Patch::new((at, normal), &corners, &[], &mut ring)
            };
            let patches: Vec<Patch> = (0..count).map(one).collect();
            let radius = 4.0 * (random(round + 3_000_000) + 0.5);
            let ball = PieceBall {
                centre: three(round + 4_000_000).map(|c| 6.0 * c),
                outward: unit(three(round + 5_000_000)),
                apart: 0.3,
                within: [0.9 * radius * radius, radius * radius],
            };
            let found = dispatch!(level(), simd => within_reach(simd, &patches, &ball));
            for (n, patch) in patches.iter().enumerate() {
                let normal = patch.normal.map(f64::from);
                let [u, v] = crate::lattice::frame(normal);
                let away = minus(ball.centre, patch.at.map(f64::from));
                let is_bent = patch.shape() == Shape::Bent;
                let within = ball.within[usize::from(!is_bent)];
                let [x, y, z] = [dot(away, u), dot(away, v), dot(away, normal)];
                let is_out = dot(normal, ball.outward) - f64::from(patch.turn()) > ball.apart
                    || patch.is_beyond(dot(away, away), z, within)
                    || is_bent && patch.bent_is_beyond([x, y], z, within);
                assert_eq!(found >> n & 1 == 0, is_out, "{patch:?}");
                reached += usize::from(!is_out);
                shapes[patch.shape() as usize] += 1;
            }
            assert_eq!(found >> count, 0);
        }
        assert!(reached > 100 && shapes.iter().all(|shape| *shape > 50), "{reached} {shapes:?}");
    }
}
