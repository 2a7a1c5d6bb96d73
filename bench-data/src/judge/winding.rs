//! Winding numbers by brute force: every triangle, every time.

use crate::vector::{cross, dot, norm, sub};
use crate::{Facet64, LatticeFacet};
use std::f64::consts::PI;

/// log₂ of the nudge's steps: the sample moves by 2⁻⁵, 2⁻¹⁰, 2⁻¹⁵ units along x, y, z.
const NUDGE_BITS: [u32; 3] = [5, 10, 15];
/// Nudged positions are whole multiples of 2⁻¹⁵ units.
const SCALE_BITS: u32 = 15;

/// The generalized winding number at `p`: the sum of the triangles' signed solid angles over 4π.
///
/// Per triangle tan(Ω/2) = det(a, b, c) / (|a||b||c| + (a·b)|c| + (b·c)|a| + (c·a)|b|), with a, b, c the corners
/// seen from p (Van Oosterom & Strackee 1983, eq. 8). Positive where p is inside a piece with outward
/// orientation. For `p` on a triangle the value is one of the two sides or anything between.
pub fn solid_angle_sum(triangles: &[Facet64], p: [f64; 3]) -> f64 {
    let half: f64 = triangles
        .iter()
        .map(|t| {
            let [a, b, c] = t.map(|v| sub(v, p));
            let [la, lb, lc] = [a, b, c].map(norm);
            dot(a, cross(b, c)).atan2(la * lb * lc + dot(a, b) * lc + dot(b, c) * la + dot(c, a) * lb)
        })
        .sum();
    half / (2.0 * PI)
}

/// The winding number at the lattice point `p` moved by (2⁻⁵, 2⁻¹⁰, 2⁻¹⁵) units, with exact determinants.
///
/// This is how a sample exactly on a face is decided by thinking of it as p + (ε, ε², ε³): for a face through
/// p whose normal's components differ by less than a factor 32 both say the same. The nudge is
/// finite, so it also carries p over a face that does not contain it but passes within the nudge; for
/// pieces whose integer normals, made primitive, have entries below 32 there is none. Where that is not
/// known use [`crossing_number`]. Coordinates up to 2²⁵ in magnitude.
pub fn nudged(triangles: &[LatticeFacet], p: [i32; 3]) -> f64 {
    let at: [i128; 3] =
        std::array::from_fn(|a| (i128::from(p[a]) << SCALE_BITS) + (1 << (SCALE_BITS - NUDGE_BITS[a])));
    let half: f64 = triangles
        .iter()
        .map(|t| {
            let [a, b, c] = t.map(|v| std::array::from_fn(|k| (i128::from(v[k]) << SCALE_BITS) - at[k]));
            let [la, lb, lc] = [a, b, c].map(|v| (dot_exact(v, v) as f64).sqrt());
            let [ab, bc, ca] = [dot_exact(a, b), dot_exact(b, c), dot_exact(c, a)].map(|d| d as f64);
            (det_exact(a, b, c) as f64).atan2(la * lb * lc + ab * lc + bc * la + ca * lb)
        })
        .sum();
    half / (2.0 * PI)
}

/// The winding number of a *closed* soup at p + (ε, ε², ε³) for ε → 0, exactly, whatever the slopes.
///
/// Counts the triangles that the ray from there along +x leaves by, less those it enters by. All signs are
/// exact, a zero is replaced by that of the first derivative that is not (simulation of
/// simplicity, Edelsbrunner & Mücke 1990). Shares nothing with the solid angles, so that each oracle
/// checks the other. Coordinates up to 2³⁰ in magnitude.
pub fn crossing_number(triangles: &[LatticeFacet], p: [i32; 3]) -> i64 {
    triangles
        .iter()
        .map(|t| {
            let [a, b, c] = t.map(|v| std::array::from_fn(|k| i128::from(v[k]) - i128::from(p[k])));
            let side = edge_side(a, b);
            let inside = side != 0 && side == edge_side(b, c) && side == edge_side(c, a);
            // With a zero determinant p lies in the triangle's plane and moving to x + ε leaves it behind.
            let ahead = det_exact(a, b, c).signum() == i128::from(side);
            if inside && ahead { side } else { 0 }
        })
        .sum()
}

/// On which side of the directed line a → b, looking along −x on the yz plane, the point (ε², ε³) lies:
/// +1 left, −1 right, 0 only if the edge is a point there.
fn edge_side(a: [i128; 3], b: [i128; 3]) -> i64 {
    let at_zero = a[1] * b[2] - a[2] * b[1];
    let [by_y, by_z] = [a[2] - b[2], b[1] - a[1]];
    [at_zero, by_y, by_z].into_iter().map(i128::signum).find(|&s| s != 0).unwrap_or(0) as i64
}

fn dot_exact(a: [i128; 3], b: [i128; 3]) -> i128 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn det_exact(a: [i128; 3], b: [i128; 3], c: [i128; 3]) -> i128 {
    a[0] * (b[1] * c[2] - b[2] * c[1])
        + a[1] * (b[2] * c[0] - b[0] * c[2])
        + a[2] * (b[0] * c[1] - b[1] * c[0])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Mesh;
    use crate::pile::lattice_pile;
    use crate::shapes::{Polygon, cuboid, extrude, spiked_cube};
    use proptest::prelude::*;

    fn at(mesh: &Mesh, p: [f64; 3]) -> f64 {
        solid_angle_sum(&mesh.facets().collect::<Vec<_>>(), p)
    }

    fn both(mesh: &Mesh, p: [i32; 3]) -> i64 {
        let soup = mesh.lattice();
        let (sum, count) = (nudged(&soup, p), crossing_number(&soup, p));
        assert!((sum - count as f64).abs() < 1e-6, "{p:?}: {sum} against {count}");
        count
    }

    #[test]
    fn known_values() {
        let cube = cuboid([0.0; 3], [10.0; 3]);
        assert!((at(&cube, [5.0, 4.0, 3.0]) - 1.0).abs() < 1e-12);
        assert!(at(&cube, [15.0, 4.0, 3.0]).abs() < 1e-12);
        assert!((at(&cube.clone().flipped(), [5.0; 3]) + 1.0).abs() < 1e-12);
        let cavity = Mesh::merged(&[cube.clone(), cuboid([3.0; 3], [7.0; 3]).flipped()]);
        assert!(at(&cavity, [5.0; 3]).abs() < 1e-12);
        assert!((at(&cavity, [1.0; 3]) - 1.0).abs() < 1e-12);
        let nested = Mesh::merged(&[cube.clone(), cuboid([3.0; 3], [7.0; 3])]);
        assert!((at(&nested, [5.0; 3]) - 2.0).abs() < 1e-12);
        let doubled = Mesh::merged(&[cube.clone(), cube.clone()]);
        assert!((at(&doubled, [9.0, 1.0, 2.0]) - 2.0).abs() < 1e-12);
        // The lid is the last pair of triangles: a sixth of the sphere seen from the centre.
        let open = Mesh { triangles: cube.triangles[..10].to_vec(), ..cube };
        assert!((at(&open, [5.0; 3]) - 5.0 / 6.0).abs() < 1e-12);
    }

    #[test]
    fn points_on_a_box_belong_to_it_on_the_lower_sides() {
        let cube = cuboid([0.0; 3], [4.0; 3]);
        for (p, w) in [
            ([0, 2, 2], 1),
            ([4, 2, 2], 0),
            ([2, 0, 2], 1),
            ([2, 4, 2], 0),
            ([2, 2, 0], 1),
            ([2, 2, 4], 0),
            ([0, 0, 0], 1),
            ([4, 4, 4], 0),
            ([0, 0, 4], 0),
            ([0, 0, 2], 1),
            ([4, 0, 0], 0),
        ] {
            assert_eq!(both(&cube, p), w, "{p:?}");
        }
    }

    #[test]
    fn points_on_slopes_go_by_x_before_y_before_z() {
        let dodecahedron = spiked_cube(4.0, 4.0);
        // On the faces ±x ± y = 8 and ±y ± z = 8: ε moves in when the first non-zero component points out
        // negatively.
        for (p, w) in [
            ([5, 3, 1], 0),
            ([5, -3, 1], 0),
            ([-5, 3, 1], 1),
            ([-5, -3, -1], 1),
            ([1, 5, 3], 0),
            ([1, 5, -3], 0),
            ([1, -5, 3], 1),
            ([1, -5, -3], 1),
            ([3, 1, 5], 0),
            ([-3, 1, 5], 1),
        ] {
            assert_eq!(both(&dodecahedron, p), w, "{p:?}");
        }
    }

    #[test]
    fn a_steep_face_near_the_sample_needs_the_exact_count() {
        // The side from (2, -999) to (1, 1) passes 0.01 units right of (1, -9, ·): within the nudge, yet not at p.
        let wedge = extrude(&Polygon(vec![[-999.0, -500.0], [2.0, -999.0], [1.0, 1.0]]), -900.0, 900.0);
        let (soup, p) = (wedge.lattice(), [1, -9, 0]);
        assert!((at(&wedge, p.map(f64::from)) - 1.0).abs() < 1e-9);
        assert_eq!(crossing_number(&soup, p), 1);
        assert!(nudged(&soup, p).abs() < 1e-6, "the nudge steps over the face");
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(64))]
        #[test]
        fn closed_soups_have_whole_numbers(seed: u64, pieces in 1usize..12, step in 1i32..4, probe: u64) {
            let cells = 16;
            let soup = Mesh::merged(&lattice_pile(seed, pieces, step, cells)).lattice();
            let mut rng = crate::Rng::new(probe);
            for _ in 0..40 {
                let p = std::array::from_fn(|_| rng.below(cells * step as u32 + 3) as i32 - 1);
                let sum = nudged(&soup, p);
                prop_assert!((sum - sum.round()).abs() < 1e-6, "{:?}: {}", p, sum);
                prop_assert_eq!(sum.round() as i64, crossing_number(&soup, p), "{:?}", p);
            }
        }

        #[test]
        fn far_from_the_origin_nothing_is_lost(seed: u64, probe: u64) {
            // The corner of the engine's root cube farthest from zero.
            let far = f64::from((1 << 24) - 64);
            let soup = Mesh::merged(&lattice_pile(seed, 6, 2, 16)).translated([far; 3]).lattice();
            let mut rng = crate::Rng::new(probe);
            for _ in 0..20 {
                let p = std::array::from_fn(|_| far as i32 + 1 + 2 * rng.below(16) as i32);
                let sum = nudged(&soup, p);
                prop_assert!((sum - crossing_number(&soup, p) as f64).abs() < 1e-6, "{:?}: {}", p, sum);
            }
        }
    }
}
