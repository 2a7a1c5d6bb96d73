//! A part laid over a reference: by a shift, or by a rigid motion, from nearest points and tangent planes (Chen & Medioni 1992).

use super::deviation::{Motion, Reference};
use crate::error::Result;
use crate::lattice::{cross, dot, minus, solved_positive};

/// Points that are compared.
pub const ALIGNED_POINTS: usize = 4000;
/// Steps at most, and what of the size of the part the last one moves.
const STEPS: usize = 60;
const STILL: f64 = 1e-9;
/// A pair weighs half that is as far apart as the scale (Cauchy's weights), which begins at the root of the mean square and
/// shrinks by this much a step, down to a part of the size: so where the part differs, it ends up to weigh nothing.
const SHRINKS: f64 = 0.7;
const LEAST_SCALE: f64 = 1e-4;

/// How a part is laid over a reference.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Align {
    /// Not at all.
    No,
    /// By a shift, from the middles of the boxes on.
    Shift,
    /// By a rotation and a shift, from there on.
    Rigid,
}

/// The motion that takes points of a part to the reference, and the root of the mean square of the distances that are left,
/// but for where the part differs.
///
/// # Errors
/// What reading the reference gives.
pub fn align(
    points: &[[f64; 3]],
    bounds: [[f64; 3]; 2],
    reference: Reference<'_>,
    how: Align,
) -> Result<(Motion, f64)> {
    if let Reference::Cloud(measured) = reference {
        // Points seldom show all of a part, but the part all that was measured.
        let points = measured.cloud.samples(ALIGNED_POINTS);
        let part = Reference::Store(measured.part, measured.sides);
        let (back, left) = align(&points, measured.cloud.bounds(), part, how)?;
        return Ok((back.inverse(), left));
    }
    let mut motion = Motion::NONE;
    let step = points.len().div_ceil(ALIGNED_POINTS).max(1);
    let some: Vec<[f64; 3]> = points.iter().step_by(step).copied().collect();
    let to = reference.bounds();
    let size = (0..3).map(|a| bounds[1][a] - bounds[0][a]).fold(0.0, f64::max);
    if how != Align::No {
        motion.shift = std::array::from_fn(|a| 0.5 * (to[0][a] + to[1][a] - bounds[0][a] - bounds[1][a]));
    }
    let (mut left, mut scale) = (0.0, f64::INFINITY);
    for _ in 0..STEPS {
        let mut pairs = Vec::with_capacity(some.len());
        for p in &some {
            let at = motion.apply(*p);
            let opposite = reference.nearest(at)?;
            pairs.push((
                at,
                opposite.normal,
                dot(minus(at, opposite.at), opposite.normal),
                opposite.signed.abs(),
            ));
        }
        let mut apart: Vec<f64> = pairs.iter().map(|pair| pair.3).collect();
        apart.sort_by(f64::total_cmp);
        let median = apart.get(apart.len() / 2).copied().unwrap_or(0.0);
        let all = mean_square(pairs.iter().map(|pair| pair.3)).sqrt();
        scale = (SHRINKS * scale).min(all).max(2.0 * median).max(LEAST_SCALE * size);
        left = mean_square(apart.iter().copied().filter(|apart| *apart <= 2.0 * scale)).sqrt();
        if how == Align::No {
            left = all;
            break;
        }
        let Some(moved) = step_of((&pairs, scale), &mut motion, how, bounds, size) else { break };
        let is_small = scale <= (2.0 * median).max(LEAST_SCALE * size);
        if moved <= STILL * size && is_small {
            break;
        }
    }
    Ok((motion, left))
}

fn mean_square(lengths: impl Iterator<Item = f64>) -> f64 {
    let (count, sum) = lengths.fold((0usize, 0.0), |(count, sum), length| (count + 1, sum + length * length));
    sum / count.max(1) as f64
}

/// A point, the normal of its opposite, how far it is along that, and how far at all.
type Pair = ([f64; 3], [f64; 3], f64, f64);

/// Moves by the least squares of distances from tangent planes; how far, at the box.
fn step_of(
    (pairs, scale): (&[Pair], f64),
    motion: &mut Motion,
    how: Align,
    bounds: [[f64; 3]; 2],
    size: f64,
) -> Option<f64> {
    // About the middle, in sizes of the part, so that turns and shifts are alike.
    let middle = motion.apply(std::array::from_fn(|a| 0.5 * (bounds[0][a] + bounds[1][a])));
    let unknowns = if how == Align::Rigid { 6 } else { 3 };
    let (mut matrix, mut rhs) = ([[0.0; 6]; 6], [0.0; 6]);
    for (at, normal, off, apart) in pairs {
        let weight = 1.0 / (1.0 + (apart / scale).powi(2));
        let arm = minus(*at, middle).map(|c| c / size);
        let turn = cross(arm, *normal);
        let row = [normal[0], normal[1], normal[2], turn[0], turn[1], turn[2]];
        for n in 0..unknowns {
            (0..unknowns).for_each(|m| matrix[n][m] += weight * row[n] * row[m]);
            rhs[n] -= weight * row[n] * off;
        }
    }
    // What the shape leaves open, as the turn of a ball, stays as it is.
    let trace: f64 = (0..unknowns).map(|n| matrix[n][n]).sum();
    (0..unknowns).for_each(|n| matrix[n][n] += 1e-9 * trace);
    let x = solved_positive(matrix, rhs, unknowns)?;
    let shift = [x[0], x[1], x[2]];
    let turn = [x[3], x[4], x[5]].map(|c| c / size);
    let angle = dot(turn, turn).sqrt();
    let rotation = rotation_about(turn, angle);
    let turned = |v: [f64; 3]| -> [f64; 3] { std::array::from_fn(|a| dot(rotation[a], v)) };
    let about = minus(motion.shift, middle);
    let (spun, columns) = (turned(about), motion.rotation);
    motion.shift = std::array::from_fn(|a| spun[a] + middle[a] + shift[a]);
    motion.rotation = std::array::from_fn(|a| {
        std::array::from_fn(|b| (0..3).map(|n| rotation[a][n] * columns[n][b]).sum())
    });
    Some(dot(shift, shift).sqrt() + angle * size)
}

/// A rotation by its vector (Rodrigues).
fn rotation_about(turn: [f64; 3], angle: f64) -> [[f64; 3]; 3] {
    if angle < 1e-15 {
        return Motion::NONE.rotation;
    }
    let axis = turn.map(|c| c / angle);
    let (sin, cos) = angle.sin_cos();
    let [x, y, z] = axis;
    let skew = [[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]];
    std::array::from_fn(|a| {
        std::array::from_fn(|b| {
            let one = if a == b { cos } else { 0.0 };
            one + sin * skew[a][b] + (1.0 - cos) * axis[a] * axis[b]
        })
    })
}
