//! Bounds that keep two triangles apart, or all around a vertex, with less than exact arithmetic.
//!
//! Most triangles that are compared lie beside each other in a nearly flat surface. Triangles around a vertex meet
//! only where they are joined if along some direction all of them are seen from the same side and go around the vertex
//! once: each is a graph over its own sector.
//!
//! Two others have no point in common if a plane separates them; where it is enough to look, it is that of one of them
//! or one upright on its edges. Both are decided in 64 bits with a margin above what rounding may change; what is not
//! decided is for [`crate::predicates`].

use glam::DVec3;

/// Least sine of an angle of a triangle that has a normal: that of slimmer ones says little after rounding.
const LEAST_SINE: f64 = 1e-4;
/// Least cosine of the angle between normals and a direction that they face: products of coordinates of 24 bits, rounded to
/// 53, over [`LEAST_SINE`] are off by 1e-11 of their bound at most.
const LEAST_COSINE: f64 = 1e-6;
/// How far from the line that divides them the vertices around another one are, over their distance.
const LEAST_OFF: f64 = 1e-9;
/// Least gap between two triangles, as a share of the coordinates' differences that it comes from.
const LEAST_GAP: f64 = 1e-12;
/// Directions that are tried for one vertex.
const DIRECTIONS: usize = 12;

pub(in crate::contour) type TriangleCorners = [[f32; 3]; 3];

/// A corner in 64 bits.
#[inline]
pub(in crate::contour) fn wide([x, y, z]: [f32; 3]) -> DVec3 {
    DVec3::new(f64::from(x), f64::from(y), f64::from(z))
}

#[inline]
fn all_wide([a, b, c]: &TriangleCorners) -> [DVec3; 3] {
    [wide(*a), wide(*b), wide(*c)]
}

/// The normal of a triangle, of length one; zero for one that is too slim.
pub(in crate::contour) fn normal(corners: &TriangleCorners) -> DVec3 {
    let [a, b, c] = all_wide(corners);
    let (u, v) = (b - a, c - a);
    let normal = u.cross(v);
    let least = u.length_squared() * v.length_squared() * (LEAST_SINE * LEAST_SINE);
    let squared = normal.length_squared();
    if squared > least { normal / squared.sqrt() } else { DVec3::ZERO }
}

/// A triangle at a vertex: its normal, and the way from the vertex to the corners that follow it.
pub(super) type Sector = (DVec3, [DVec3; 2]);

/// Whether the triangles around a vertex surely go around it once, seen along some direction.
pub(super) fn is_fan(sectors: &[Sector]) -> bool {
    let Some(direction) = facing(sectors) else { return false };
    // Along no axis, so that vertices do not lie on it.
    let across = direction.cross(DVec3::new(0.537_714, 0.291_833, 0.791_027));
    let mut turns = 0;
    for (_, link) in sectors {
        let off = [link[0].dot(across), link[1].dot(across)];
        let is_clear = |n: usize| off[n].powi(2) > LEAST_OFF * LEAST_OFF * link[n].length_squared();
        if !is_clear(0) || !is_clear(1) {
            return false;
        }
        turns += usize::from(off[0] < 0.0 && off[1] > 0.0);
    }
    turns == 1
}

/// A direction that all normals face, of length one: their sum, pulled towards those that do not face it (the perceptron's
/// way).
fn facing(sectors: &[Sector]) -> Option<DVec3> {
    let mut sum: DVec3 = sectors.iter().map(|(normal, _)| *normal).sum();
    if sectors.iter().any(|(normal, _)| *normal == DVec3::ZERO) {
        return None;
    }
    for _ in 0..DIRECTIONS {
        let direction = sum.try_normalize()?;
        let cosines = sectors.iter().map(|(normal, _)| (normal, normal.dot(direction)));
        let mut turned_away = cosines.filter(|(_, cosine)| *cosine < LEAST_COSINE).peekable();
        if turned_away.peek().is_none() {
            return Some(direction);
        }
        // To the other side, and a little beyond.
        let pull: DVec3 = turned_away.map(|(normal, cosine)| *normal * (0.1 - 1.5 * cosine)).sum();
        sum = direction + pull;
    }
    None
}

/// Whether a plane surely separates two triangles with these normals.
pub(in crate::contour) fn are_apart(a: &TriangleCorners, b: &TriangleCorners, normals: [DVec3; 2]) -> bool {
    let ([p, q, r], [s, t, u]) = (all_wide(a), all_wide(b));
    let (own, other) = ([DVec3::ZERO, q - p, r - p], [s - p, t - p, u - p]);
    let reach = own[1].abs().max(own[2].abs()).max(other[0].abs()).max(other[1].abs()).max(other[2].abs());
    let reach = reach.max_element();
    let separates = |axis: DVec3| {
        let [low, high] = span(&own, axis);
        let [other_low, other_high] = span(&other, axis);
        let gap = (other_low - high).max(low - other_high);
        gap > LEAST_GAP * reach * axis.abs().element_sum()
    };
    let by_edge = |t: &[DVec3; 3], normal: DVec3| {
        separates((t[1] - t[0]).cross(normal))
            || separates((t[2] - t[1]).cross(normal))
            || separates((t[0] - t[2]).cross(normal))
    };
    by_edge(&own, normals[0]) || by_edge(&other, normals[1]) || separates(normals[0]) || separates(normals[1])
}

#[inline]
fn span([a, b, c]: &[DVec3; 3], axis: DVec3) -> [f64; 2] {
    let (a, b, c) = (a.dot(axis), b.dot(axis), c.dot(axis));
    [a.min(b).min(c), a.max(b).max(c)]
}

/// Least and greatest coordinates.
pub(in crate::contour) type Bounds = [[f32; 3]; 2];

/// Of a triangle.
#[inline]
pub(in crate::contour) fn bounds([a, b, c]: &TriangleCorners) -> Bounds {
    let low = |n: usize| a[n].min(b[n]).min(c[n]);
    let high = |n: usize| a[n].max(b[n]).max(c[n]);
    [[low(0), low(1), low(2)], [high(0), high(1), high(2)]]
}

/// Whether two boxes have a point in common.
#[inline]
pub(in crate::contour) fn meets([low, high]: &Bounds, other: &Bounds) -> bool {
    let along = |n: usize| low[n] <= other[1][n] && other[0][n] <= high[n];
    along(0) && along(1) && along(2)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::predicates::meet_by_place;
    use proptest::prelude::*;

    fn fan(tip: [f32; 3], link: &[[f32; 3]]) -> (Vec<TriangleCorners>, Vec<Sector>) {
        let triangle = |n: usize| [tip, link[n], link[(n + 1) % link.len()]];
        let all: Vec<TriangleCorners> = (0..link.len()).map(triangle).collect();
        let sector = |corners: &TriangleCorners| {
            let [a, b, c] = corners.map(wide);
            (normal(corners), [b - a, c - a])
        };
        let sectors = all.iter().map(sector).collect();
        (all, sectors)
    }

    #[test]
    fn corners_of_a_cube_are_fans() {
        let link = [[1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        assert!(is_fan(&fan([0.0; 3], &link).1));
        // Twice around, and folded back onto itself.
        let flat: Vec<[f32; 3]> =
            [[2.0, 0.0], [-1.0, 2.0], [-1.0, -2.0]].map(|[x, y]| [x, y, 0.0]).into_iter().collect();
        assert!(is_fan(&fan([0.0; 3], &flat).1));
        assert!(!is_fan(&fan([0.0; 3], &[flat.clone(), flat.clone()].concat()).1));
        let folded = [flat[0], flat[1], [3.0, 1.0, 0.0], flat[2]];
        assert!(!is_fan(&fan([0.0; 3], &folded).1));
        // Two that lie on each other, upright where the direction of the others sees them from neither side.
        let upright = [[1.0, 0.0, 0.0], [4.0, 0.0, 2.0], [0.0, -1.0, 0.0], [4.0, 0.0, 1.0]];
        assert!(!is_fan(&fan([0.0; 3], &upright).1));
    }

    proptest! {
        #[test]
        fn what_is_apart_does_not_meet(places in prop::array::uniform6(prop::array::uniform3(-6i16..6))) {
            let [a, b, c, d, e, f] = places.map(|place| place.map(f32::from));
            let (s, t) = ([a, b, c], [d, e, f]);
            prop_assert!(!are_apart(&s, &t, [normal(&s), normal(&t)]) || !meet_by_place(&s, &t));
            // One beside it in its plane.
            let beside = s.map(|corner| std::array::from_fn(|n| corner[n] + 2.0 * (b[n] - a[n]) + c[n] - a[n]));
            let has_normal = normal(&s) != DVec3::ZERO;
            prop_assert_eq!(has_normal, are_apart(&s, &beside, [normal(&s), normal(&beside)]));
        }

        #[test]
        fn fans_do_not_meet(
            link in prop::collection::vec((0u8..16, 1i16..9, -3i16..4), 3..8),
            is_sorted in any::<bool>(),
        ) {
            let mut link = link;
            if is_sorted {
                link.sort();
            }
            let at = |&(n, far, z): &(u8, i16, i16)| {
                let angle = f64::from(n) / 16.0 * std::f64::consts::TAU;
                [angle.cos() * f64::from(far), angle.sin() * f64::from(far), f64::from(z)].map(|c| c as f32)
            };
            let (all, sectors) = fan([0.0; 3], &link.iter().map(at).collect::<Vec<_>>());
            if is_fan(&sectors) {
                for (n, first) in all.iter().enumerate() {
                    prop_assert!(all[n + 1..].iter().all(|second| !meet_by_place(first, second)));
                }
            }
        }
    }
}
