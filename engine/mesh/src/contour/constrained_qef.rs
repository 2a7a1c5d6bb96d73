//! Vertices that the closed forms of [`super::solve`] do not find, eight at a time: those of loops without a closed
//! form, and those whose least error lies outside their cell and not over the one face that they are beyond.
//!
//! One vertex in ten is such a one, spread over most groups of eight, so they wait here until eight have come together.
//! A vertex has the same bits whatever it waits with.

use super::lanes::{GROUP, LoopLanes, Matrix, Vec3, load, on_faces};
use super::qef::{PULL, TRUNCATION_SQUARED, Vector};
use super::symmetric::dot;
use crate::wide::{Select, Simd, SimdBase, SimdFloat, SimdMask, dispatch, f64x8, level, mask64x8};

/// What is known of loops, term by term: matrix (6) and right-hand side (3) about the mass point, mass point (3), the
/// minimiser anywhere (3), and the largest eigenvalue, below zero where these last two are not known.
pub(super) type LoopTerms = [LoopLanes; 16];

/// A vertex and its cell.
pub(super) type CellVertex = (u32, [usize; 3]);

/// Loops that wait.
#[derive(Clone, Default)]
struct Batch {
    terms: LoopTerms,
    names: [CellVertex; GROUP],
    used: usize,
}

/// Loops that wait: those whose minimiser is known, and the others.
#[derive(Clone, Default)]
pub(super) struct ConstrainedLoops([Batch; 2]);

impl ConstrainedLoops {
    /// Takes the loop in a lane. Returns eight that have come together and what they are called.
    pub(super) fn push(
        &mut self,
        (terms, lane): (&LoopTerms, usize),
        name: CellVertex,
        margin: f64,
    ) -> Option<([CellVertex; GROUP], [Vector; GROUP])> {
        let lane = lane % GROUP;
        let batch = &mut self.0[usize::from(terms[15][lane] < 0.0)];
        let to = batch.used % GROUP;
        for (waiting, term) in batch.terms.iter_mut().zip(terms) {
            waiting[to] = term[lane];
        }
        batch.names[to] = name;
        batch.used += 1;
        if batch.used < GROUP {
            return None;
        }
        batch.used = 0;
        Some((batch.names, minimisers(&batch.terms, cell(margin))))
    }

    /// Those that still wait.
    pub(super) fn drain(&mut self, margin: f64, mut each: impl FnMut(CellVertex, Vector)) {
        for batch in &mut self.0 {
            if batch.used > 0 {
                let points = minimisers(&batch.terms, cell(margin));
                batch
                    .names
                    .into_iter()
                    .zip(points)
                    .take(batch.used)
                    .for_each(|(name, point)| each(name, point));
                batch.used = 0;
            }
        }
    }
}

/// The box `margin..1 − margin`.
#[inline(always)]
pub(super) fn cell(margin: f64) -> [Vector; 2] {
    [[margin; 3], [1.0 - margin; 3]]
}

/// The minimiser of one loop over a box.
pub(super) fn minimiser(terms: &[f64; 16], bounds: [Vector; 2]) -> Vector {
    minimisers(&terms.map(|term| [term; GROUP]), bounds)[0]
}

/// The minimisers over a box, by lane. A call for eight of them: so they are compiled once for each width of vectors.
#[inline(never)]
pub(super) fn minimisers(terms: &LoopTerms, bounds: [Vector; 2]) -> [Vector; GROUP] {
    dispatch!(level(), simd => minimisers_with(simd, terms, bounds))
}

#[inline(always)]
fn minimisers_with<S: Simd>(simd: S, terms: &LoopTerms, bounds: [Vector; 2]) -> [Vector; GROUP] {
    let vector = |n: usize| {
        [
            f64x8::from_slice(simd, &terms[n]),
            f64x8::from_slice(simd, &terms[n + 1]),
            f64x8::from_slice(simd, &terms[n + 2]),
        ]
    };
    let [a, b, c, d, e, f, ..] = *terms;
    let matrix = load(simd, &[a, b, c, d, e, f]);
    let (rhs, mass, mut at) = (vector(6), vector(9), vector(12));
    let mut largest = f64x8::from_slice(simd, &terms[15]);
    let bounds = bounds.map(|corner| corner.map(|c| f64x8::splat(simd, c)));
    let is_unknown = largest.simd_lt(0.0);
    if is_unknown.any_true() {
        let (x, found) = by_rotations(simd, &matrix, rhs);
        for a in 0..3 {
            at[a] = is_unknown.select(mass[a] + x[a], at[a]);
        }
        largest = is_unknown.select(found, largest);
        on_faces(&matrix, rhs, mass, largest, bounds, &mut at);
    }
    let at = BoundedPlanes { matrix, rhs, mass, largest, bounds }.least(simd, at);
    let mut points = [[0.0; 3]; GROUP];
    for a in 0..3 {
        let at = at[a].as_array();
        for lane in 0..GROUP {
            points[lane][a] = at[lane];
        }
    }
    points
}

/// The pseudo-inverse times `rhs` without the eigenvalues that are small next to the largest, and that one. By
/// Jacobi's rotations; see [`super::symmetric::Symmetric::eigen`].
#[inline(always)]
fn by_rotations<S: Simd>(simd: S, matrix: &Matrix<S>, rhs: Vec3<S>) -> (Vec3<S>, f64x8<S>) {
    let (zero, one) = (f64x8::splat(simd, 0.0), f64x8::splat(simd, 1.0));
    let [xx, yy, zz, xy, yz, zx] = matrix.0;
    // Off the diagonal by the axis that is not theirs.
    let (mut values, mut off) = ([xx, yy, zz], [yz, zx, xy]);
    // By axis and number.
    let mut vectors = [[one, zero, zero], [zero, one, zero], [zero, zero, one]];
    let trace = xx + yy + zz;
    let limit = trace * trace * 1e-28;
    let mut is_turning = mask64x8::splat(simd, true);
    for _ in 0..6 {
        let rest = off[2] * off[2] + off[0] * off[0] + off[1] * off[1];
        is_turning &= !rest.simd_le(limit);
        if !is_turning.any_true() {
            break;
        }
        for (p, q) in [(0, 1), (1, 2), (0, 2)] {
            let r = 3 - p - q;
            let turns = is_turning & !off[r].simd_eq(zero);
            let theta = (values[q] - values[p]) / (off[r] * 2.0);
            let t = one.copysign(theta) / (theta.abs() + (theta * theta + 1.0).sqrt());
            let c = one / (t * t + 1.0).sqrt();
            let s = t * c;
            let (pq, rp, rq) = (off[r], off[q], off[p]);
            values[p] = turns.select(values[p] - t * pq, values[p]);
            values[q] = turns.select(values[q] + t * pq, values[q]);
            off[r] = turns.select(zero, pq);
            off[q] = turns.select(c * rp - s * rq, rp);
            off[p] = turns.select(s * rp + c * rq, rq);
            for axis in &mut vectors {
                let (vp, vq) = (axis[p], axis[q]);
                axis[p] = turns.select(c * vp - s * vq, vp);
                axis[q] = turns.select(s * vp + c * vq, vq);
            }
        }
    }
    let largest = zero.max(values[0]).max(values[1]).max(values[2]);
    let threshold = largest * TRUNCATION_SQUARED;
    let mut x = [zero; 3];
    for n in 0..3 {
        let vector = [vectors[0][n], vectors[1][n], vectors[2][n]];
        let along = dot(vector, rhs) / values[n];
        let counts = values[n].simd_gt(threshold);
        for a in 0..3 {
            x[a] = counts.select(x[a] + vector[a] * along, x[a]);
        }
    }
    (x, largest)
}

/// Planes about their mass points, and the box for the minimisers.
struct BoundedPlanes<S: Simd> {
    matrix: Matrix<S>,
    rhs: Vec3<S>,
    mass: Vec3<S>,
    /// The largest eigenvalue.
    largest: f64x8<S>,
    bounds: [Vec3<S>; 2],
}

impl<S: Simd> BoundedPlanes<S> {
    /// The minimisers over the box; `free` where that lies in it, else at the faces that it is beyond, their edges and
    /// their corners, with the remaining variables free.
    ///
    /// Others need not be tried: from a minimiser that is at none of those faces one could go towards the free one
    /// without leaving the box, and the error, being convex, would shrink.
    #[inline(always)]
    fn least(&self, simd: S, free: Vec3<S>) -> Vec3<S> {
        let [low, high] = self.bounds;
        let none = mask64x8::splat(simd, false);
        // The last is of the digit of free axes.
        let (mut beyond, mut is_within) = ([[none; 3]; 3], !none);
        for a in 0..3 {
            beyond[0][a] = free[a].simd_lt(low[a]);
            beyond[1][a] = free[a].simd_gt(high[a]);
            is_within &= free[a].simd_ge(low[a]) & free[a].simd_le(high[a]);
        }
        let mut best = free;
        for best in &mut best {
            *best = is_within.select(*best, f64x8::splat(simd, 0.5));
        }
        let mut least = f64x8::splat(simd, f64::INFINITY);
        // Per axis a digit to the base 3: at the lower bound, at the upper one, free.
        for code in 0..26 {
            let digits = [code % 3, code / 3 % 3, code / 9];
            let mut is_tried = beyond[digits[0]][0] | beyond[digits[1]][1] | beyond[digits[2]][2];
            if !is_tried.any_true() {
                continue;
            }
            let (x, point) = self.with_fixed(simd, digits);
            for a in 0..3 {
                is_tried &= !(point[a].simd_lt(low[a]) | point[a].simd_gt(high[a]));
            }
            let error = dot(x, self.matrix.times(x)) - dot(x, self.rhs) * 2.0 + dot(x, x) * PULL;
            let is_better = is_tried & error.simd_lt(least);
            least = is_better.select(error, least);
            for a in 0..3 {
                best[a] = is_better.select(point[a], best[a]);
            }
        }
        best
    }

    /// The minimisers along the axes that are free, with digits as in [`BoundedPlanes::least`], without the eigenvalues that
    /// are small next to the largest: from the mass point, and as points.
    #[inline(always)]
    fn with_fixed(&self, simd: S, digits: [usize; 3]) -> (Vec3<S>, Vec3<S>) {
        let zero = f64x8::splat(simd, 0.0);
        let threshold = self.largest * TRUNCATION_SQUARED;
        let is_fixed = digits.map(|digit| digit < 2);
        let mut x = [zero; 3];
        for a in 0..3 {
            if is_fixed[a] {
                x[a] = self.bounds[digits[a]][a] - self.mass[a];
            }
        }
        let moved = self.matrix.times(x);
        let [xx, yy, zz, xy, yz, zx] = self.matrix.0;
        let diagonal = [xx, yy, zz];
        let rhs = |a: usize| self.rhs[a] - moved[a];
        match is_fixed {
            [false, false, _] => [x[0], x[1]] = pair(zero, [xx, yy, xy], [rhs(0), rhs(1)], threshold),
            [false, true, false] => [x[0], x[2]] = pair(zero, [xx, zz, zx], [rhs(0), rhs(2)], threshold),
            [true, false, false] => [x[1], x[2]] = pair(zero, [yy, zz, yz], [rhs(1), rhs(2)], threshold),
            _ => {
                for a in 0..3 {
                    if !is_fixed[a] {
                        let counts = diagonal[a].simd_gt(threshold);
                        x[a] = counts.select(rhs(a) / diagonal[a], zero);
                    }
                }
            }
        }
        let mut point = x;
        for a in 0..3 {
            point[a] = if is_fixed[a] { self.bounds[digits[a]][a] } else { self.mass[a] + x[a] };
        }
        (x, point)
    }
}

/// Pseudo-inverses of the matrices [[a, c], [c, b]] times `rhs` without the eigenvalues up to `threshold`.
#[inline(always)]
fn pair<S: Simd>(
    zero: f64x8<S>,
    [a, b, c]: Vec3<S>,
    rhs: [f64x8<S>; 2],
    threshold: f64x8<S>,
) -> [f64x8<S>; 2] {
    let half = (a - b) * 0.5;
    let largest = (a + b) * 0.5 + (half * half + c * c).sqrt();
    let determinant = a * b - c * c;
    let is_none = largest.simd_le(threshold);
    let is_whole = determinant.simd_gt(threshold * largest);
    let whole = [(b * rhs[0] - c * rhs[1]) / determinant, (a * rhs[1] - c * rhs[0]) / determinant];
    let [mut x, mut y] = whole;
    if !(is_none | is_whole).all_true() {
        // Of the two forms of the larger one's eigenvector the longer.
        let is_first = a.simd_ge(b);
        let v = [is_first.select(largest - b, c), is_first.select(c, largest - a)];
        let along = (v[0] * rhs[0] + v[1] * rhs[1]) / (largest * (v[0] * v[0] + v[1] * v[1]));
        x = is_whole.select(x, v[0] * along);
        y = is_whole.select(y, v[1] * along);
    }
    [is_none.select(zero, x), is_none.select(zero, y)]
}

#[cfg(test)]
mod tests {
    use super::super::symmetric::Symmetric;
    use super::super::tests::one_by_one::CentredPlanes;
    use super::*;
    use crate::wide::{dispatch, level};
    use proptest::prelude::*;

    /// Matrix, right-hand side and mass point of some planes.
    type Loop = ([f64; 6], Vector, Vector);

    fn any_loop() -> impl Strategy<Value = Loop> {
        let plane = (prop::array::uniform3(0.0f64..1.0), prop::array::uniform3(-1.0f64..1.0));
        let flatten = prop::array::uniform3(prop::sample::select(vec![1.0, 1.0, 0.3, 0.05, 1e-3, 0.0]));
        (prop::collection::vec(plane, 1..8), flatten, 0.0f64..2.0).prop_map(|(planes, flatten, reach)| {
            let count = planes.len() as f64;
            let mass: Vector = std::array::from_fn(|a| planes.iter().map(|p| p.0[a]).sum::<f64>() / count);
            let (mut matrix, mut rhs) = (Symmetric::default(), [0.0; 3]);
            for (p, n) in planes {
                let n: Vector = std::array::from_fn(|a| n[a] * flatten[a]);
                matrix = matrix.plus(n);
                let d = reach * (0..3).map(|a| n[a] * (p[a] - mass[a])).sum::<f64>();
                (0..3).for_each(|a| rhs[a] += n[a] * d);
            }
            (matrix.0, rhs, mass)
        })
    }

    /// A minimiser after the faces in closed form.
    fn face_first(centred: &CentredPlanes, free: Vector, largest: f64, margin: f64) -> Vector {
        dispatch!(level(), simd => {
            let all = |c: f64| f64x8::splat(simd, c);
            let mut at = free.map(all);
            let bounds = [[all(margin); 3], [all(1.0 - margin); 3]];
            let matrix = Symmetric(centred.matrix.0.map(all));
            on_faces(&matrix, centred.rhs.map(all), centred.mass.map(all), all(largest), bounds, &mut at);
            at.map(|c| c[0])
        })
    }

    proptest! {
        #[test]
        fn eight_at_a_time_have_the_bits_of_one(
            loops in prop::collection::vec((any_loop(), any::<bool>()), GROUP),
            margin in prop::sample::select(vec![1e-4, 0.01, 0.25]),
        ) {
            let mut terms = LoopTerms::default();
            let mut expected = Vec::new();
            for (lane, ((matrix, rhs, mass), is_known)) in loops.into_iter().enumerate() {
                let centred = CentredPlanes::new(matrix, rhs, mass);
                let (free, largest) = centred.free();
                // Those that wait with a known minimiser have tried the face that it is beyond.
                let is_known = is_known && face_first(&centred, free, largest, margin) == free;
                let known = if is_known { (free, largest) } else { ([f64::NAN; 3], -1.0) };
                let values = matrix.into_iter().chain(rhs).chain(mass).chain(known.0).chain([known.1]);
                terms.iter_mut().zip(values).for_each(|(term, value)| term[lane] = value);
                expected.push((centred, free, largest, is_known));
            }
            let points = minimisers(&terms, cell(margin));
            for (point, (centred, mut free, largest, is_known)) in points.into_iter().zip(expected) {
                if !is_known {
                    free = face_first(&centred, free, largest, margin);
                }
                let is_within = free.iter().all(|c| (margin..=1.0 - margin).contains(c));
                let one = if is_within { free } else { centred.constrained(free, largest, margin) };
                prop_assert_eq!(point.map(f64::to_bits), one.map(f64::to_bits));
            }
        }
    }
}
