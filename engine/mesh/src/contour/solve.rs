//! Vertices of eight loops at a time, in vectors of whatever width the processor has.
//!
//! Every lane does the same operations in the same order, and none is fused: a vertex has the same bits for any
//! width and whatever loops share its group. Lanes without a closed form, a few in a hundred, and minimisers outside
//! their cell that do not lie on the one face that they are beyond are left to [`super::constrained_qef`].

use super::constrained_qef::LoopTerms;
use super::edges::EdgePlace;
use super::lanes::{GROUP, LoopLanes, Matrix, Vec3, divided, inverse, load, minus, on_faces, times};
use super::planes::EdgePlane;
use super::qef::{Qef, SHARP, TRUNCATION_SQUARED, Vector, WideSums, most_least, ridge};
use super::symmetric::{Symmetric, dot};
use crate::wide::{
    Select, Simd, SimdBase, SimdFloat, SimdMask, SimdSplit, each_of, f32x8, f64x8, mask64x8, transposed,
    widened,
};

#[inline(always)]
fn put<const N: usize>(terms: &mut [LoopLanes; N], lane: usize, values: &[f64; N]) {
    for (term, &value) in terms.iter_mut().zip(values) {
        term[lane] = value;
    }
}

/// How far about a cell planes may meet: anywhere in a block of 3³ cells that holds the cell.
pub(super) const REACH: f64 = 2.5;

/// Most planes of a loop: one on each edge of the cell.
const MOST_PLANES: usize = 12;

/// Up to [`GROUP`] loops, each as its planes or as their sums; all is zero in lanes that are not in use.
#[derive(Clone, Default)]
pub(super) struct LoopGroup {
    /// By number within a loop, in the order of addition, and by loop: the points as the cells' centres see them, filled up
    /// to a vector, and the normals behind what fills theirs.
    planes: [[[f32; 8]; GROUP]; MOST_PLANES],
    /// How many planes each loop has.
    counts: [usize; GROUP],
    /// Term by term, as in [`Qef`].
    sums: Option<Box<Sums>>,
    /// Lower corners of the cells.
    corners: [LoopLanes; 3],
    /// Whether vertices of cells without a sharp crease are to stand on the surface. Of a smooth surface the planes meet as
    /// far outside of it as the mass point of their points lies inside: half way between them is the surface itself, but for
    /// terms of third order.
    on_surface: OnSurface,
}

/// Which vertices stand on the surface and not where planes meet outside of it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) enum OnSurface {
    /// None.
    #[default]
    Never,
    /// Those of cells without a crease.
    Smooth,
    /// Those, too, in which the surface turns by up to 60° while no point is on all planes, as none is of a surface that is bent
    /// and not creased.
    Bent,
}

/// tan² of half of 60°.
const BENT: f64 = 1.0 / 3.0;
/// How far outside of its cell a vertex may be that stands on the surface, along each axis, in cells.
const LOOSE: f64 = 1.0;
/// How far planes pass by the point nearest to all, in cells, where a surface is bent and not creased.
const MISSED: f64 = 3e-4;

/// Sums of planes, term by term.
#[derive(Clone, Default)]
struct Sums {
    matrix: [LoopLanes; 6],
    rhs: [LoopLanes; 3],
    points: [LoopLanes; 3],
    normals: [LoopLanes; 3],
    constant: LoopLanes,
    count: LoopLanes,
}

/// What comes out of a group.
pub(super) struct SolvedGroup<S: Simd> {
    /// The points of the box `margin..1 − margin` of the cells with the least error, nearest to the mass points where the
    /// error does not tell.
    pub at: Vec3<S>,
    /// Lower corners of the cells.
    pub corners: Vec3<S>,
    /// Bit per loop: its point is left to [`super::constrained_qef`].
    pub left: u64,
    /// What those need, and what is known of sharp ones.
    pub terms: LoopTerms,
    /// Bit per loop: all normals agree so well that two eigenvalues are truncated anyway.
    pub flat: u64,
    /// Bit per loop: its normals are as far apart as those at a crease that is followed ([`super::crease_extension`]).
    pub sharp: u64,
    /// Bit per loop: one direction is truncated.
    pub lines: u64,
    /// That direction, of length one, of sharp ones.
    pub along: [LoopLanes; 3],
    /// Bit per loop: no point within [`REACH`] cells of its cell's centre along every axis is within the miss asked for
    /// of all planes.
    pub apart: u64,
    /// The sums about the origin that the corners are counted from.
    pub sums: [WideSums<S>; GROUP],
}

impl<S: Simd> SolvedGroup<S> {
    /// The points, by loop.
    #[inline(always)]
    pub(super) fn points(&self) -> [Vector; GROUP] {
        let mut points = [[0.0; 3]; GROUP];
        for (a, at) in self.at.iter().enumerate() {
            let at = at.as_array();
            for (lane, point) in points.iter_mut().enumerate() {
                point[a] = at[lane];
            }
        }
        points
    }
}

impl LoopGroup {
    /// An empty one; `on_surface` is as in [`super::field::LevelSet`].
    pub(super) fn new(on_surface: OnSurface) -> LoopGroup {
        LoopGroup { on_surface, ..LoopGroup::default() }
    }

    /// Makes a plane the loop's in a lane with this number: that of a crossing on an edge of the cell.
    #[inline(always)]
    pub(super) fn put<S: Simd>(
        &mut self,
        simd: S,
        lane: usize,
        number: usize,
        place: &EdgePlace,
        plane: &EdgePlane,
    ) {
        let terms = &mut self.planes[number][lane % GROUP];
        // Whole vectors, so that they are read again without waiting for the cache.
        place.seen_wide(simd, plane).store_slice(&mut terms[..4]);
        plane.terms(simd).store_slice(&mut terms[4..]);
    }

    /// Says how many planes the loop in a lane has: those that were put there.
    #[inline(always)]
    pub(super) fn count(&mut self, lane: usize, planes: usize) {
        self.counts[lane % GROUP] = planes;
    }

    /// Puts the sums of a loop into a lane. At least one plane must have been added.
    pub(super) fn set(&mut self, lane: usize, qef: &Qef) {
        let sums = self.sums.get_or_insert_default();
        put(&mut sums.matrix, lane, &qef.matrix.0);
        put(&mut sums.rhs, lane, &qef.rhs);
        put(&mut sums.points, lane, &qef.point_sum);
        put(&mut sums.normals, lane, &qef.normal_sum);
        sums.constant[lane] = qef.constant;
        sums.count[lane] = qef.count;
    }

    /// Says which cell the loop in a lane is in.
    #[inline(always)]
    pub(super) fn place(&mut self, lane: usize, cell: [usize; 3]) {
        put(&mut self.corners, lane % GROUP, &cell.map(|c| f64::from(c as u32)));
    }

    /// Solves the first `used` lanes, and empties all. A call for each group: so it is compiled once for each width of
    /// vectors.
    #[inline(never)]
    pub(super) fn solve<S: Simd>(&mut self, simd: S, used: usize, margin: f64, miss: f64) -> SolvedGroup<S> {
        let solved = simd.vectorize(
            #[inline(always)]
            || solve(simd, self, used, margin, miss),
        );
        let most = self.counts.into_iter().max().unwrap_or(0);
        self.planes[..most].fill([[0.0; 8]; GROUP]);
        self.counts = [0; GROUP];
        self.sums = None;
        solved
    }
}

#[cfg(test)]
impl LoopGroup {
    /// The points of the first `used` lanes.
    pub(super) fn points(&mut self, used: usize, margin: f64) -> [Vector; GROUP] {
        crate::wide::dispatch!(crate::wide::level(), simd => {
            let solved = self.solve(simd, used, margin, 0.01);
            let left = super::constrained_qef::minimisers(&solved.terms, super::constrained_qef::cell(margin));
            let mut points = solved.points();
            for lane in (0..used).filter(|lane| solved.left >> lane & 1 == 1) {
                points[lane] = left[lane];
            }
            points
        })
    }
}

/// The sums over the planes of each loop.
struct Planes<S: Simd> {
    matrix: Matrix<S>,
    rhs: Vec3<S>,
    points: Vec3<S>,
    normals: Vec3<S>,
    constant: f64x8<S>,
    count: f64x8<S>,
}

impl<S: Simd> Planes<S> {
    #[inline(always)]
    fn of(simd: S, group: &LoopGroup) -> Planes<S> {
        let zero = f64x8::splat(simd, 0.0);
        let mut sums = Planes {
            matrix: Symmetric([zero; 6]),
            rhs: [zero; 3],
            points: [zero; 3],
            normals: [zero; 3],
            constant: zero,
            count: zero,
        };
        let (mut count, mut most) = ([0.0; GROUP], 0);
        for (count, &planes) in count.iter_mut().zip(&group.counts) {
            *count = planes as f64;
            most = most.max(planes);
        }
        sums.count = f64x8::from_slice(simd, &count);
        if let Some(set) = &group.sums {
            sums.matrix = load(simd, &set.matrix);
            sums.rhs = each_of(simd, &set.rhs);
            sums.points = each_of(simd, &set.points);
            sums.normals = each_of(simd, &set.normals);
            sums.constant = f64x8::from_slice(simd, &set.constant);
            sums.count += f64x8::from_slice(simd, &set.count);
        }
        // Planes that a loop does not have are zero, and so is what they add.
        for terms in &group.planes[..most.min(MOST_PLANES)] {
            let mut loops = [f32x8::splat(simd, 0.0); GROUP];
            for lane in 0..GROUP {
                loops[lane] = f32x8::from_slice(simd, &terms[lane]);
            }
            let [px, py, pz, _, _, nx, ny, nz] = transposed(loops);
            let p = [widened(simd, px), widened(simd, py), widened(simd, pz)];
            let n = [widened(simd, nx), widened(simd, ny), widened(simd, nz)];
            let d = dot(n, p);
            sums.matrix = sums.matrix.plus(n);
            for a in 0..3 {
                sums.rhs[a] += n[a] * d;
                sums.points[a] += p[a];
                sums.normals[a] += n[a];
            }
            sums.constant += d * d;
        }
        sums
    }
}

#[inline(always)]
fn solve<S: Simd>(simd: S, group: &LoopGroup, used: usize, margin: f64, miss: f64) -> SolvedGroup<S> {
    let planes = Planes::of(simd, group);
    let Planes { matrix, rhs: at_centre, normals, count, .. } = planes;
    let half = f64x8::splat(simd, 0.5);
    let mean = divided(planes.points, count);
    let rhs = minus(at_centre, matrix.times(mean));
    let agreed = dot(normals, normals) / count;
    let is_flat = (count - agreed).simd_le(agreed * TRUNCATION_SQUARED);
    let lanes = (1u64 << used) - 1;
    let mut flat = is_flat.to_bitmask() & lanes;
    let mut sharp = (count - agreed).simd_gt(agreed * SHARP).to_bitmask() & lanes;
    // Neighbours are alike: most groups need one of the two.
    let mut free =
        if flat != 0 { along_normal(simd, &matrix, rhs, normals) } else { TruncatedPlanes::none(simd) };
    if flat != lanes {
        let creased = truncated(simd, &matrix, rhs);
        for a in 0..3 {
            free.x[a] = is_flat.select(free.x[a], creased.x[a]);
        }
        free.largest = is_flat.select(free.largest, creased.largest);
        free.is_sound = is_flat | creased.is_sound;
        (free.along, free.is_line) = (creased.along, creased.is_line);
    }
    // Lanes whose vertex may leave its cell, so that it is on the surface.
    let mut loose = mask64x8::splat(simd, false);
    if group.on_surface != OnSurface::Never {
        let mut is_smooth = (count - agreed).simd_le(agreed * SHARP);
        if group.on_surface == OnSurface::Bent {
            let v = [mean[0] + free.x[0], mean[1] + free.x[1], mean[2] + free.x[2]];
            let missed = planes.constant - dot(at_centre, v) * 2.0 + dot(v, matrix.times(v));
            // Where no direction stands out there is no crease, either.
            let is_missed = missed.simd_gt(count * (MISSED * MISSED)) | !free.is_sound;
            is_smooth |= (count - agreed).simd_le(agreed * BENT) & is_missed;
            let lifted = along_normal(simd, &matrix, rhs, normals);
            for a in 0..3 {
                free.x[a] = is_smooth.select(lifted.x[a], free.x[a]);
            }
            free.largest = is_smooth.select(lifted.largest, free.largest);
            free.is_sound |= is_smooth;
            sharp &= !is_smooth.to_bitmask();
            // Whose planes nearly meet in a point are no corner.
            flat |= is_smooth.to_bitmask() & lanes;
            loose = is_smooth;
        }
        for x in &mut free.x {
            *x = is_smooth.select(*x * half, *x);
        }
    }
    let mass = [mean[0] + half, mean[1] + half, mean[2] + half];
    let anywhere = [mass[0] + free.x[0], mass[1] + free.x[1], mass[2] + free.x[2]];
    let mut at = anywhere;
    let bounds = [[f64x8::splat(simd, margin); 3], [f64x8::splat(simd, 1.0 - margin); 3]];
    let done = on_faces(&matrix, rhs, mass, free.largest, bounds, &mut at);
    if group.on_surface == OnSurface::Bent {
        // A crease leaves many of the cells that see it, near their faces.
        let mut is_near = mask64x8::splat(simd, true);
        for c in anywhere {
            is_near &= c.simd_ge(f64x8::splat(simd, -LOOSE)) & c.simd_le(f64x8::splat(simd, 1.0 + LOOSE));
        }
        loose |= is_near & free.is_sound;
    }
    let loosely = loose.to_bitmask();
    if loosely != 0 {
        for a in 0..3 {
            at[a] = loose.select(anywhere[a], at[a]);
        }
    }
    let left = lanes & !((done | loosely) & free.is_sound.to_bitmask());
    let mut terms = [[0.0; GROUP]; 16];
    if left | sharp != 0 {
        let largest = free.is_sound.select(free.largest, f64x8::splat(simd, -1.0));
        let [xx, yy, zz, xy, yz, zx] = matrix.0;
        let ([ra, rb, rc], [ma, mb, mc], [ax, ay, az]) = (rhs, mass, anywhere);
        let all = [xx, yy, zz, xy, yz, zx, ra, rb, rc, ma, mb, mc, ax, ay, az, largest];
        for n in 0..16 {
            all[n].store_slice(&mut terms[n]);
        }
    }
    let mut along = [[0.0; GROUP]; 3];
    if sharp != 0 {
        for (along, of) in along.iter_mut().zip(free.along) {
            of.store_slice(along);
        }
    }
    let lines = free.is_line.to_bitmask() & lanes;
    let corners = each_of(simd, &group.corners);
    let sums = about_origin(simd, &planes, corners);
    let apart = apart(&planes, miss).to_bitmask() & lanes;
    SolvedGroup { at, corners, left, terms, flat, sharp, lines, along, apart, sums }
}

/// Where planes do not meet; see [`super::qef::PlaneSums::may_share_point`].
#[inline(always)]
fn apart<S: Simd>(planes: &Planes<S>, miss: f64) -> mask64x8<S> {
    let ridge = planes.count * ridge(miss, REACH);
    let [xx, yy, zz, xy, yz, zx] = planes.matrix.0;
    let lifted = Symmetric([xx + ridge, yy + ridge, zz + ridge, xy, yz, zx]);
    let adjugate = lifted.adjugate();
    let least = planes.constant - dot(planes.rhs, adjugate.times(planes.rhs)) / lifted.determinant(&adjugate);
    least.simd_gt(planes.count * most_least(miss))
}

/// The sums about the origin of the corners, for the search for corners.
#[inline(always)]
fn about_origin<S: Simd>(simd: S, planes: &Planes<S>, corners: Vec3<S>) -> [WideSums<S>; GROUP] {
    let mut centre = corners;
    for c in &mut centre {
        *c += 0.5;
    }
    let Planes { matrix, rhs, count, .. } = planes;
    let moved = matrix.times(centre);
    let constant = planes.constant + dot(*rhs, centre) * 2.0 + dot(centre, moved);
    let [xx, yy, zz, xy, yz, zx] = matrix.0;
    let [x, y, z] = [rhs[0] + moved[0], rhs[1] + moved[1], rhs[2] + moved[2]];
    let terms = transposed([xx, yy, zz, xy, yz, zx, x, y]);
    let zero = f64x8::splat(simd, 0.0);
    let mut sums = [(zero, zero.split().0); GROUP];
    // What fills the vectors is not zero: for that compilers have an instruction, `vmovq` from a high register in its
    // form for stores, that valgrind 3.19 does not know.
    let ((z_count, z_count_high), (constant, constant_high)) =
        (z.interleave(*count), constant.interleave(constant));
    let (first, second) = z_count.interleave(constant);
    let (third, fourth) = z_count_high.interleave(constant_high);
    for (pair, more) in [first, second, third, fourth].into_iter().enumerate() {
        let (even, odd) = more.split();
        sums[2 * pair] = (terms[2 * pair], even);
        sums[2 * pair + 1] = (terms[2 * pair + 1], odd);
    }
    sums
}

/// Offsets from the mass points.
struct TruncatedPlanes<S: Simd> {
    x: Vec3<S>,
    /// The largest eigenvalue.
    largest: f64x8<S>,
    /// False where the closed form does not hold.
    is_sound: mask64x8<S>,
    /// The direction of the least eigenvalue, and where it alone is truncated.
    along: Vec3<S>,
    is_line: mask64x8<S>,
}

impl<S: Simd> TruncatedPlanes<S> {
    #[inline(always)]
    fn none(simd: S) -> TruncatedPlanes<S> {
        let (zero, none) = (f64x8::splat(simd, 0.0), mask64x8::splat(simd, false));
        TruncatedPlanes { x: [zero; 3], largest: zero, is_sound: none, along: [zero; 3], is_line: none }
    }
}

/// Where the planes are as good as one.
#[inline(always)]
fn along_normal<S: Simd>(simd: S, matrix: &Matrix<S>, rhs: Vec3<S>, normals: Vec3<S>) -> TruncatedPlanes<S> {
    // One step of the power method: the error of the direction shrinks a hundredfold.
    let v = matrix.times(normals);
    let square = dot(v, matrix.times(v));
    let scale = dot(v, rhs) / square;
    let is_sound = mask64x8::splat(simd, true);
    TruncatedPlanes {
        x: times(v, scale),
        largest: square / dot(v, v),
        is_sound,
        ..TruncatedPlanes::none(simd)
    }
}

/// Pseudo-inverse times `rhs` without the eigenvalues below [`TRUNCATION_SQUARED`] of the largest, where at most one
/// is.
///
/// The least eigenvalue's vector is the limit of the powers of the adjugate, whose eigenvalues are the products of two;
/// the other two values follow from trace and minors. Jacobi's rotations take four times as long.
#[inline(always)]
fn truncated<S: Simd>(simd: S, matrix: &Matrix<S>, rhs: Vec3<S>) -> TruncatedPlanes<S> {
    let adjugate = matrix.adjugate();
    let (trace, products) = (matrix.trace(), adjugate.trace());
    let (v, least, is_found) = least_eigenvector(matrix, &adjugate);
    let sum = trace - least;
    let product = products - least * sum;
    let zero = f64x8::splat(simd, 0.0);
    let largest = sum * 0.5 + (sum * 0.25 * sum - product).max(zero).sqrt();
    let threshold = largest * TRUNCATION_SQUARED;
    let has_three = least.simd_gt(threshold);
    let has_two = (product / largest).simd_gt(threshold);
    // With the least eigenvalue made one as large as the others, and nothing of it in `rhs`.
    let lifted = matrix.plus(times(v, trace.sqrt()));
    let adjugate_lifted = lifted.adjugate();
    let across = dot(v, rhs);
    let within = minus(rhs, times(v, across));
    let mut x = divided(adjugate_lifted.times(within), lifted.determinant(&adjugate_lifted));
    if has_three.any_true() {
        let whole = divided(adjugate.times(rhs), matrix.determinant(&adjugate));
        for a in 0..3 {
            x[a] = has_three.select(whole[a], x[a]);
        }
    }
    let is_line = is_found & has_two & !has_three;
    TruncatedPlanes { x, largest, is_sound: is_found & (has_three | has_two), along: v, is_line }
}

/// The eigenvectors, of length one, of eigenvalues well below the other two, with the values, and where there are
/// such.
#[inline(always)]
fn least_eigenvector<S: Simd>(matrix: &Matrix<S>, adjugate: &Matrix<S>) -> (Vec3<S>, f64x8<S>, mask64x8<S>) {
    let (trace, products) = (matrix.trace(), adjugate.trace());
    // Below a thousandth of the products of two, one value stands out and the other two are noise.
    let stands_out = products.simd_gt(trace * 1e-3 * trace);
    let fourth = scaled_down(adjugate, products).squared().squared();
    let [a, b, c, d, e, f] = fourth.0;
    let is_first = a.simd_ge(b) & a.simd_ge(c);
    let is_third = c.simd_gt(b);
    let longest = [
        is_first.select(a, is_third.select(f, d)),
        is_first.select(d, is_third.select(e, b)),
        is_first.select(f, is_third.select(c, e)),
    ];
    let v = fourth.times(fourth.times(longest));
    let v = divided(v, dot(v, v).sqrt());
    let image = matrix.times(v);
    let value = dot(v, image);
    let rest = minus(image, times(v, value));
    let is_sharp = dot(rest, rest).simd_le(trace * 1e-20 * trace);
    (v, value, stands_out & is_sharp)
}

#[inline(always)]
fn scaled_down<S: Simd>(matrix: &Matrix<S>, s: f64x8<S>) -> Matrix<S> {
    let ([xx, yy, zz, xy, yz, zx], s) = (matrix.0, inverse(s));
    Symmetric([xx * s, yy * s, zz * s, xy * s, yz * s, zx * s])
}

#[cfg(test)]
mod tests {
    use super::super::tests::one_by_one::{largest_of, truncated as by_rotations};
    use super::*;
    use crate::wide::{dispatch, level};
    use proptest::prelude::*;

    /// Offset and largest eigenvalue of one lane, if there is a closed form.
    fn closed_form(matrix: &Symmetric, rhs: Vector) -> Option<(Vector, f64)> {
        dispatch!(level(), simd => {
            let matrix = load(simd, &matrix.0.map(|term| [term; GROUP]));
            let of = truncated(simd, &matrix, each_of(simd, &rhs.map(|c| [c; GROUP])));
            (of.is_sound.to_bitmask() & 1 == 1).then(|| (of.x.map(|c| c[0]), of.largest[0]))
        })
    }

    proptest! {
        #[test]
        fn closed_forms_truncate_as_rotations_do(
            normals in prop::collection::vec(prop::array::uniform3(-1.0f64..1.0), 3..8),
            flatten in prop::array::uniform3(prop::sample::select(vec![1.0, 0.2, 0.02, 1e-5, 0.0])),
            rhs in prop::array::uniform3(-1.0f64..1.0),
        ) {
            let mut matrix = Symmetric::default();
            for n in &normals {
                prop_assume!(n.iter().map(|c| c * c).sum::<f64>() > 0.01);
                matrix = matrix.plus(std::array::from_fn(|a| n[a] * flatten[a]));
            }
            prop_assume!(matrix.0[0] + matrix.0[1] + matrix.0[2] > 0.1);
            let eigen = matrix.eigen();
            let largest = largest_of(&eigen);
            // Where a value is about to be truncated either answer is right.
            prop_assume!(eigen.0.iter().all(|v| (v / (TRUNCATION_SQUARED * largest) - 1.0).abs() > 1e-3));
            let Some((x, found)) = closed_form(&matrix, rhs) else { return Ok(()) };
            prop_assert!((found - largest).abs() <= 1e-9 * largest);
            let expected = by_rotations(&eigen, rhs, largest);
            let size = x.iter().map(|c| c * c).sum::<f64>().sqrt();
            let off = (0..3).map(|a| (x[a] - expected[a]).powi(2)).sum::<f64>().sqrt();
            prop_assert!(off <= 1e-4 * size + 1e-12);
        }

        #[test]
        fn vertices_do_not_depend_on_their_group(
            loops in prop::collection::vec(prop::collection::vec((prop::array::uniform3(0.0f64..1.0), prop::array::uniform3(-1.0f64..1.0)), 3..7), GROUP),
        ) {
            let qefs: Vec<Qef> = loops.iter().map(|planes| {
                let mut qef = Qef::default();
                for (p, n) in planes {
                    let length = n.iter().map(|c| c * c).sum::<f64>().sqrt().max(0.1);
                    qef.add(*p, n.map(|c| c / length));
                }
                qef
            }).collect();
            let mut group = LoopGroup::default();
            qefs.iter().enumerate().for_each(|(lane, qef)| {
                group.set(lane, qef);
                group.place(lane, [lane; 3]);
            });
            let together = group.points(GROUP, 1e-4);
            for (qef, point) in qefs.iter().zip(together) {
                prop_assert_eq!(qef.solve(1e-4), point);
            }
        }
    }
}
