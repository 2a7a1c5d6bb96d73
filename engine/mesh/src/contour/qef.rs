//! The quadratic error function of a cell: where its vertex goes.
//!
//! Ju, Losasso, Schaefer & Warren 2002, *Dual Contouring of Hermite Data*, with the truncation about the mass
//! point of Lindstrom 2000. A minimiser outside the cell is replaced by the minimiser over the cell, found on
//! its faces, edges and corners, because clamping would take a vertex off a crease that only clips the cell.

use super::symmetric::{Symmetric, dot};
pub(super) use crate::lattice::Vector;
use crate::wide::{Simd, SimdBase, f64x4, f64x8};

/// Singular values below this share of the largest count as zero, so that a vertex moves along no direction
/// in which the surface is flat. 0.1 takes creases sharper than 11° for creases.
const TRUNCATION: f64 = 0.1;
/// The same for eigenvalues of NᵀN, which are squared singular values.
pub(super) const TRUNCATION_SQUARED: f64 = TRUNCATION * TRUNCATION;

/// How far, in cells, a plane may pass by a corner: a hundred times what the rounding of offsets and
/// normals makes of planes that meet in one point, and far less than a curved face bends within a cell.
pub(super) const MISS: f64 = 0.01;

/// tan² of half the angle between the normals of two faces, 30°, from which on their crease is followed: the flatter it is
/// the less of it is lost.
pub(super) const SHARP: f64 = 0.071_796_769_724_490_83;
/// Weight of the squared distance from the mass point when two boundary candidates have the same error.
pub(super) const PULL: f64 = 1e-6;

/// Eigenvalues and eigenvectors.
pub(super) type Eigen = ([f64; 3], [Vector; 3]);

impl Symmetric {
    /// Eigenvalues and eigenvectors by cyclic Jacobi rotations.
    pub(super) fn eigen(&self) -> Eigen {
        let [xx, yy, zz, xy, yz, zx] = self.0;
        let mut a = [[xx, xy, zx], [xy, yy, yz], [zx, yz, zz]];
        let mut vectors = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        // Convergence is quadratic: a normal matrix of unit vectors is diagonal to f64 after four sweeps.
        for _ in 0..6 {
            let off = a[0][1] * a[0][1] + a[1][2] * a[1][2] + a[0][2] * a[0][2];
            if off <= 1e-28 * (xx + yy + zz).powi(2) {
                break;
            }
            for (p, q) in [(0, 1), (1, 2), (0, 2)] {
                if a[p][q] != 0.0 {
                    rotate(&mut a, &mut vectors, p, q);
                }
            }
        }
        ([a[0][0], a[1][1], a[2][2]], vectors)
    }
}

/// One Jacobi rotation that makes `a[p][q]` zero; `vectors` holds the eigenvectors as rows.
fn rotate(a: &mut [[f64; 3]; 3], vectors: &mut [Vector; 3], p: usize, q: usize) {
    let theta = (a[q][q] - a[p][p]) / (2.0 * a[p][q]);
    let t = theta.signum() / (theta.abs() + (theta * theta + 1.0).sqrt());
    let c = 1.0 / (t * t + 1.0).sqrt();
    let s = t * c;
    let r = 3 - p - q;
    let (apq, arp, arq) = (a[p][q], a[r][p], a[r][q]);
    a[p][p] -= t * apq;
    a[q][q] += t * apq;
    (a[p][q], a[q][p]) = (0.0, 0.0);
    (a[r][p], a[p][r]) = (c * arp - s * arq, c * arp - s * arq);
    (a[r][q], a[q][r]) = (s * arp + c * arq, s * arp + c * arq);
    let (vp, vq) = (vectors[p], vectors[q]);
    vectors[p] = std::array::from_fn(|axis| c * vp[axis] - s * vq[axis]);
    vectors[q] = std::array::from_fn(|axis| s * vp[axis] + c * vq[axis]);
}

/// The sum of squared distances from planes, gathered about the cell's centre.
#[derive(Clone, Default)]
pub(super) struct Qef {
    pub matrix: Symmetric,
    pub rhs: Vector,
    pub point_sum: Vector,
    pub normal_sum: Vector,
    pub constant: f64,
    pub count: f64,
}

/// The sums of matrix (6), right-hand side (3), constant and count about another origin, as they add up over the
/// cells of a block; the last of the twelve fills the vectors. A crossing that several cells share may count several
/// times.
#[derive(Clone, Copy, Default)]
pub(super) struct PlaneSums(pub [f64; 12]);

/// The same in vectors.
pub(super) type WideSums<S> = (f64x8<S>, f64x4<S>);

impl PlaneSums {
    #[inline(always)]
    pub(super) fn load<S: Simd>(&self, simd: S) -> WideSums<S> {
        (f64x8::from_slice(simd, &self.0[..8]), f64x4::from_slice(simd, &self.0[8..]))
    }

    #[inline(always)]
    pub(super) fn of<S: Simd>(wide: WideSums<S>) -> PlaneSums {
        let mut sums = PlaneSums::default();
        sums.store(wide);
        sums
    }

    #[inline(always)]
    pub(super) fn store<S: Simd>(&mut self, (first, rest): WideSums<S>) {
        first.store_slice(&mut self.0[..8]);
        rest.store_slice(&mut self.0[8..]);
    }

    /// Adds the plane through the point `p` with the unit normal `n`.
    #[inline(always)]
    pub(super) fn add(&mut self, p: Vector, n: Vector) {
        let d = dot(n, p);
        let products = [n[0] * n[0], n[1] * n[1], n[2] * n[2], n[0] * n[1], n[1] * n[2], n[2] * n[0]];
        let [xx, yy, zz, xy, yz, zx] = products;
        self.add_all(&PlaneSums([xx, yy, zz, xy, yz, zx, n[0] * d, n[1] * d, n[2] * d, d * d, 1.0, 0.0]));
    }

    #[inline(always)]
    pub(super) fn add_all(&mut self, other: &PlaneSums) {
        for (sum, more) in self.0.iter_mut().zip(&other.0) {
            *sum += more;
        }
    }

    /// False if there is no point within `reach` of `centre` along every axis that all planes pass within `miss`
    /// while the least singular value of some of their normals, each taken once, exceeds `spread`.
    ///
    /// With λ the least eigenvalue of NᵀN: the other planes only add to it, so λ > spread², and the quotient
    /// det/(sum of the principal minors) = 1/Σ(1/λᵢ) lies between λ/3 and λ. The sum of squares is least at x;
    /// at the point p it is count·miss² at most, so |x − p|² ≤ count·miss²/λ.
    #[inline(always)]
    pub(super) fn may_meet(&self, centre: Vector, reach: f64, miss: f64, spread: f64) -> bool {
        let (matrix, rhs, constant, count) = self.split();
        let minors = matrix.adjugate();
        let determinant = matrix.determinant(&minors);
        let least = determinant / minors.trace();
        // It is not a number where all normals are alike.
        if least.is_nan() || least <= 0.33 * spread * spread {
            return false;
        }
        let x = minors.times(rhs).map(|c| c / determinant);
        let most = 1.01 * count * miss * miss;
        if constant - dot(rhs, x) > most {
            return false;
        }
        let slack = reach + (most / least).sqrt();
        (0..3).all(|a| (x[a] - centre[a]).abs() <= slack)
    }

    /// False if no point within `reach` of `centre` along every axis is within `miss` of all planes, whatever others
    /// there are.
    ///
    /// At such a point p the sum of squares plus ridge·|p − centre|² is [`most_least`] a plane at most, so its least
    /// value is no greater. The ridge makes it a matter of one inverse where planes meet in a line.
    #[inline(always)]
    pub(super) fn may_share_point(&self, centre: Vector, reach: f64, miss: f64) -> bool {
        let (mut matrix, rhs, constant, count) = self.split();
        let moved = matrix.times(centre);
        let constant = constant - 2.0 * dot(rhs, centre) + dot(centre, moved);
        let rhs = std::array::from_fn(|a| rhs[a] - moved[a]);
        for diagonal in &mut matrix.0[..3] {
            *diagonal += count * ridge(miss, reach);
        }
        let minors = matrix.adjugate();
        let least = constant - dot(rhs, minors.times(rhs)) / matrix.determinant(&minors);
        least.is_nan() || least <= count * most_least(miss)
    }

    #[inline(always)]
    fn split(&self) -> (Symmetric, Vector, f64, f64) {
        let [xx, yy, zz, xy, yz, zx, x, y, z, constant, count, _] = self.0;
        (Symmetric([xx, yy, zz, xy, yz, zx]), [x, y, z], constant, count)
    }
}

/// Weight, a plane, of the squared distance from the centre in [`PlaneSums::may_share_point`]: at the corners of the
/// box half of what the planes may miss adds up to.
#[inline(always)]
pub(super) fn ridge(miss: f64, reach: f64) -> f64 {
    0.5 * miss * miss / (3.0 * reach * reach)
}

/// The most that sum of squares and ridge come to, a plane, at a point of the box that all planes pass within `miss`,
/// and a tenth for rounding: where normals are not all alike, it is below a hundredth.
#[inline(always)]
pub(super) fn most_least(miss: f64) -> f64 {
    1.1 * 1.5 * miss * miss
}

impl Qef {
    /// Adds the plane through the point `p`, in cell coordinates 0..1 an axis, with the unit normal `n`.
    #[inline(always)]
    pub(super) fn add(&mut self, p: Vector, n: Vector) {
        let p = p.map(|c| c - 0.5);
        let d = dot(n, p);
        self.matrix = self.matrix.plus(n);
        for a in 0..3 {
            self.rhs[a] += n[a] * d;
            self.point_sum[a] += p[a];
            self.normal_sum[a] += n[a];
        }
        self.constant += d * d;
        self.count += 1.0;
    }

    /// The point with the least error anywhere, if every singular value of the normals exceeds `least`.
    pub(super) fn meeting_point(&self, least: f64) -> Option<Vector> {
        let (values, vectors) = self.matrix.eigen();
        if values.into_iter().any(|value| value <= least * least) {
            return None;
        }
        let along: Vector = std::array::from_fn(|n| dot(vectors[n], self.rhs) / values[n]);
        Some(std::array::from_fn(|a| 0.5 + (0..3).map(|n| along[n] * vectors[n][a]).sum::<f64>()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn gather(planes: &[(Vector, Vector)]) -> Qef {
        let mut qef = Qef::default();
        planes.iter().for_each(|&(p, n)| qef.add(p, n));
        qef
    }

    fn unit(v: Vector) -> Vector {
        let length = dot(v, v).sqrt();
        v.map(|c| c / length)
    }

    fn distance(a: Vector, b: Vector) -> f64 {
        (0..3).map(|n| (a[n] - b[n]).powi(2)).sum::<f64>().sqrt()
    }

    proptest! {
        #[test]
        fn eigenvectors_rebuild_the_matrix(m in prop::array::uniform6(-1.0f64..1.0)) {
            let matrix = Symmetric(m);
            let (values, vectors) = matrix.eigen();
            for x in [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.3, -0.4, 0.5]] {
                let rebuilt: Vector = std::array::from_fn(|a| {
                    (0..3).map(|n| values[n] * dot(vectors[n], x) * vectors[n][a]).sum()
                });
                prop_assert!(distance(rebuilt, matrix.times(x)) < 1e-12);
            }
        }

        #[test]
        fn planes_that_pass_a_point_may_share_it(
            centre in prop::array::uniform3(0.0f64..32.0),
            offset in prop::array::uniform3(-1.0f64..1.0),
            planes in prop::collection::vec((prop::array::uniform3(-1.0f64..1.0), prop::array::uniform3(-2.0f64..2.0), -1.0f64..1.0), 1..40),
            flatten in prop::sample::select(vec![1.0, 0.1, 0.0]),
        ) {
            let (reach, miss) = (1.5, 0.01);
            let point: Vector = std::array::from_fn(|a| centre[a] + reach * offset[a]);
            let mut sums = PlaneSums::default();
            for (n, along, off) in &planes {
                let n = [n[0], n[1], n[2] * flatten];
                prop_assume!(dot(n, n) > 0.01);
                let n = unit(n);
                let slide = dot(*along, n);
                sums.add(std::array::from_fn(|a| point[a] + along[a] - slide * n[a] + miss * off * n[a]), n);
            }
            // Normals that are all but alike are no crease: rounding decides there.
            let (values, _) = sums.split().0.eigen();
            let largest = values.into_iter().fold(0.0, f64::max);
            prop_assume!(values.into_iter().filter(|&v| v > TRUNCATION_SQUARED * largest).count() > 1);
            prop_assert!(sums.may_share_point(centre, reach, miss));
        }

        #[test]
        fn no_sampled_point_of_the_box_beats_the_solution(
            planes in prop::collection::vec((prop::array::uniform3(0.0f64..1.0), prop::array::uniform3(-1.0f64..1.0)), 3..8),
            tries in prop::collection::vec(prop::array::uniform3(0.004f64..0.996), 64),
        ) {
            prop_assume!(planes.iter().all(|(_, n)| dot(*n, *n) > 0.01));
            let planes: Vec<_> = planes.into_iter().map(|(p, n)| (p, unit(n))).collect();
            let qef = gather(&planes);
            let (values, _) = qef.matrix.eigen();
            // Where nothing is truncated the solution is the box-constrained least-squares one.
            prop_assume!(values.into_iter().fold(f64::INFINITY, f64::min) > 0.1 * values.into_iter().fold(0.0, f64::max));
            let error = |x: Vector| planes.iter().map(|(p, n)| dot(*n, std::array::from_fn(|a| x[a] - p[a])).powi(2)).sum::<f64>();
            let x = qef.solve(1.0 / 256.0);
            for t in tries {
                prop_assert!(error(x) <= error(t) + 1e-5, "{x:?} {t:?}");
            }
        }
    }

    #[test]
    fn three_faces_of_a_prism_share_no_point() {
        let mut sums = PlaneSums::default();
        for (x, n) in [(10.0, [1.0, 0.0, 0.0]), (10.5, unit([1.0, 0.5, 0.0])), (10.0, [0.0, 1.0, 0.0])] {
            sums.add([x, 10.0, 10.0], n);
            sums.add([x, 10.0, 11.0], n);
        }
        assert!(!sums.may_share_point([10.0; 3], 1.5, 0.01));
        assert!(!sums.may_meet([10.0; 3], 1.5, 0.01, 0.3));
    }

    #[test]
    fn flat_cells_keep_the_mass_point_and_corners_are_found() {
        let n = unit([1.0, 2.0, 3.0]);
        let plane = |x: f64, y: f64| ([x, y, 0.9 - (x + 2.0 * y) / 3.0], n);
        let planes = [plane(0.0, 0.0), plane(1.0, 0.0), plane(0.0, 1.0), plane(1.0, 0.5)];
        let mass = std::array::from_fn(|a| planes.iter().map(|p| p.0[a]).sum::<f64>() / 4.0);
        assert!(distance(gather(&planes).solve(1.0 / 256.0), mass) < 1e-12);
        let corner = [0.3, 0.6, 0.7];
        let planes = [[1.0, 0.0, 0.1], [0.0, 1.0, 0.2], [-0.2, 0.1, 1.0]].map(|n| {
            let n = unit(n);
            let t = unit([n[1] - n[2], n[2] - n[0], n[0] - n[1]]);
            (std::array::from_fn(|a| corner[a] + 0.2 * t[a]), n)
        });
        assert!(distance(gather(&planes).solve(1.0 / 256.0), corner) < 1e-9);
    }

    #[test]
    fn a_crease_that_only_clips_the_cell_keeps_its_vertex() {
        // Creased along z through (-0.1, 0.5) tilted so that it enters the cell at z > 0.6.
        let (a, b) = (unit([-0.6, 1.0, 0.3]), unit([-0.6, -1.0, 0.3]));
        let crease = |z: f64| [0.5 * (z - 0.6), 0.5, z];
        let planes = [(crease(0.9), a), (crease(0.2), a), (crease(0.8), b), (crease(0.1), b)];
        let x = gather(&planes).solve(1.0 / 256.0);
        for (p, n) in planes {
            assert!(dot(n, std::array::from_fn(|k| x[k] - p[k])).abs() < 0.01, "{x:?}");
        }
    }
}
