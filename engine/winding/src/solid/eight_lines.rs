//! The intervals of eight parallel lines in a flat body at once, for analyses that ask millions of them.
//!
//! Every lane does what [`Body::line`] does, operation by operation, so results have the same bits. Lanes that miss the body
//! get an interval that ends where it begins.

use super::body::Body;
use super::profile::SolidProfile;
use crate::lattice::Axis;
use crate::wide::{Select, Simd, SimdBase, SimdFloat, SimdMask, dispatch, f64x8, level, mask64x8};

/// Lines at once.
pub(super) const LANES: usize = 8;

/// Eight lines along an axis: positions along the other two axes in their order, relative to the segment's first end.
pub(super) type LinePlaces = [[f64; LANES]; 2];

/// Where eight lines enter and leave a body; a line that misses it leaves where it enters.
pub(super) type LineEnds = [[f64; LANES]; 2];

/// The intervals in which eight lines along `axis` meet a body.
#[inline]
pub(super) fn eight_lines(body: &Body, axis: Axis, places: &LinePlaces) -> LineEnds {
    if body.is_flat() {
        return dispatch!(level(), simd => flat(simd, body, axis, places));
    }
    let (mut ends, [u, v]) = ([[0.0; LANES]; 2], axis.others_in_order().map(Axis::index));
    for lane in 0..LANES {
        let mut at = [0.0; 3];
        (at[u], at[v]) = (places[0][lane], places[1][lane]);
        (ends[0][lane], ends[1][lane]) = body.line(axis.index(), at).unwrap_or_default();
    }
    ends
}

#[inline(always)]
fn flat<S: Simd>(simd: S, body: &Body, axis: Axis, places: &LinePlaces) -> LineEnds {
    let first = f64x8::from_slice(simd, &places[0]);
    let second = f64x8::from_slice(simd, &places[1]);
    let (from, to) = match axis {
        Axis::X => flat_line(simd, body, [0, 1], second, first),
        Axis::Y => flat_line(simd, body, [1, 0], second, first),
        Axis::Z => upright_line(simd, body, [first, second]),
    };
    let mut ends = [[0.0; LANES]; 2];
    from.store_slice(&mut ends[0]);
    to.store_slice(&mut ends[1]);
    ends
}

/// [`Body::half_width_at`] the heights `z`, then [`Body::flat_line`] where the coordinate along the other axis is `other`.
#[inline(always)]
fn flat_line<S: Simd>(
    simd: S,
    body: &Body,
    [t, o]: [usize; 2],
    z: f64x8<S>,
    other: f64x8<S>,
) -> (f64x8<S>, f64x8<S>) {
    let SolidProfile { flat_side, flat_top, aspect, radius, .. } = *body.profile();
    let (end, [frame, ..], length) = (body.end(), body.frame(), body.length());
    let all = |c: f64| f64x8::splat(simd, c);
    let zero = all(0.0);
    let top = flat_top + radius;
    let is_within = z.simd_ge(all(-top)) & z.simd_lt(all(top));
    let above = positive(zero, z.abs() - all(flat_top));
    let round = positive(zero, all(radius * radius) - above * above) / all(aspect);
    let half_width = all(flat_side) + round.sqrt();
    let (mut low, mut high) = (all(f64::INFINITY), all(f64::NEG_INFINITY));
    for centre in [[0.0; 2], [end[t], end[o]]] {
        let off = other - all(centre[1]);
        let is_near = off.simd_ge(zero - half_width) & off.simd_lt(half_width) & is_within;
        // Most lines pass a segment between its ends.
        if is_near.any_true() {
            let half = positive(zero, half_width * half_width - off * off).sqrt();
            (low, high) = united((low, high), is_near, (all(centre[0]) - half, all(centre[0]) + half));
        }
    }
    let (along, across) = (frame[t], frame[o]);
    if across == 0.0 {
        let is_near = other.simd_ge(zero - half_width) & other.simd_lt(half_width);
        let ends = (all(end[t].min(0.0)), all(end[t].max(0.0)));
        (low, high) = united((low, high), is_near, ends);
    } else {
        let (a, b) = (
            (all(along) * other - half_width) / all(across),
            (all(along) * other + half_width) / all(across),
        );
        let is_less = a.simd_lt(b);
        let (mut from, mut to) = (is_less.select(a, b), is_less.select(b, a));
        if along != 0.0 {
            let (a, b) =
                (all(-across) * other / all(along), (all(length) - all(across) * other) / all(along));
            let is_less = a.simd_lt(b);
            let (first, last) = (is_less.select(a, b), is_less.select(b, a));
            from = first.simd_gt(from).select(first, from);
            to = last.simd_lt(to).select(last, to);
        } else {
            let place = all(across) * other;
            to = (place.simd_lt(zero) | place.simd_gt(all(length))).select(from, to);
        }
        (low, high) = united((low, high), from.simd_lt(to), (from, to));
    }
    let meets = is_within & low.simd_lt(high);
    (meets.select(low, zero), meets.select(high, zero))
}

/// The interval of a flat body along z.
#[inline(always)]
fn upright_line<S: Simd>(simd: S, body: &Body, [x, y]: [f64x8<S>; 2]) -> (f64x8<S>, f64x8<S>) {
    let SolidProfile { flat_side, flat_top, aspect, radius, .. } = *body.profile();
    let (frame, length) = (body.frame(), body.length());
    let all = |c: f64| f64x8::splat(simd, c);
    let zero = all(0.0);
    let along = all(frame[0][0]) * x + all(frame[0][1]) * y + all(frame[0][2]) * zero;
    let side = all(frame[1][0]) * x + all(frame[1][1]) * y + all(frame[1][2]) * zero;
    let is_beyond = along.simd_gt(all(length));
    let beyond = along.simd_lt(zero).select(along, is_beyond.select(along - all(length), zero));
    let d = positive(zero, (beyond * beyond + side * side).sqrt() - all(flat_side));
    let rest = all(radius * radius) - all(aspect) * d * d;
    let half = all(flat_top) + positive(zero, rest).sqrt();
    let meets = rest.simd_ge(zero) & half.simd_gt(zero);
    (meets.select(zero - half, zero), meets.select(half, zero))
}

/// An interval and, where that is asked for, another one as well.
#[inline(always)]
fn united<S: Simd>(
    (low, high): (f64x8<S>, f64x8<S>),
    is_asked: mask64x8<S>,
    (from, to): (f64x8<S>, f64x8<S>),
) -> (f64x8<S>, f64x8<S>) {
    ((is_asked & from.simd_lt(low)).select(from, low), (is_asked & to.simd_gt(high)).select(to, high))
}

/// `v`, or 0 where it is not above.
#[inline(always)]
fn positive<S: Simd>(zero: f64x8<S>, v: f64x8<S>) -> f64x8<S> {
    v.simd_gt(zero).select(v, zero)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::solid::{Outline, Segment};

    /// Lines beside, through, and along the faces of bodies in all directions have the bits of the one-line formulas.
    #[test]
    fn eight_lines_are_those_of_one() {
        let (mut state, mut hits) = (1u64, 0);
        let mut draw = |below: i32| {
            state = crate::lattice::mix(state.wrapping_add(crate::lattice::GOLDEN));
            (state % below as u64) as i32
        };
        for n in 0..600 {
            let outline = [Outline::Stadium, Outline::Ellipse][n % 2];
            let axis = if n % 7 == 0 { [0.6, 0.0, 0.8] } else { [0.0, 0.0, 1.0] };
            let (half_width, half_height) = (f64::from(1 + draw(60)), f64::from(1 + draw(60)));
            let profile = SolidProfile::new(outline, half_width, half_height, axis);
            let step = [[1, 0, 0], [0, 1, 0], [1, 1, 0], [0, 0, 0], [1, 0, 1]][n % 5];
            let b = step.map(|on| on * (draw(200) - 100));
            let body = Body::new(&Segment { a: [0; 3], b, profile: 0, pass: 0 }, &profile);
            for axis in Axis::ALL {
                let [u, v] = axis.others_in_order().map(Axis::index);
                // Whole numbers meet faces and ends exactly.
                let places: LinePlaces = [0, 1].map(|_| {
                    std::array::from_fn(|lane| f64::from(draw(280) - 140) + 0.25 * (lane % 2) as f64)
                });
                let [from, to] = eight_lines(&body, axis, &places);
                for lane in 0..LANES {
                    let mut at = [0.0; 3];
                    (at[u], at[v]) = (places[0][lane], places[1][lane]);
                    let found = (from[lane] < to[lane]).then_some((from[lane], to[lane]));
                    assert_eq!(found, body.line(axis.index(), at), "{n} {axis:?} {at:?}");
                    hits += u32::from(found.is_some());
                }
            }
        }
        assert!(hits > 1000, "{hits}");
    }
}
