//! How far two patches of triangles with one border are from each other.

use super::super::adaptive::{TriangleCorners, normal, wide};
use glam::DVec3;

/// Points between the ends of an edge that are looked at.
const POINTS: usize = 7;
/// Least cosine of the angle by which a patch may turn: 45°.
const LEAST_TURN: f64 = 0.7;

/// The distance of two patches at points of their inner edges, vertices and middles; `None` if it is above `most`, or where the
/// new patch turns away from the old one. Patches with one border are farthest apart at vertices or where inner edges
/// pass each other.
pub(super) fn patch_distance(old: &[TriangleCorners], new: &[TriangleCorners], most: f64) -> Option<f64> {
    let [old, new] = [old, new].map(|patch| patch.iter().map(PatchTriangle::of).collect::<Vec<_>>());
    let mut largest = 0.0f64;
    for (from, to) in [(&new, &old), (&old, &new)] {
        for point in points(from) {
            let found =
                to.iter().map(|triangle| triangle.squared(point)).fold(f64::INFINITY, f64::min).sqrt();
            if found > most {
                return None;
            }
            largest = largest.max(found);
        }
    }
    let is_turned = |triangle: &&PatchTriangle| {
        let middle = triangle.corners.iter().sum::<DVec3>() / 3.0;
        let beside = old.iter().filter(|other| other.squared(middle) <= most * most);
        !beside.into_iter().any(|other| other.normal.dot(triangle.normal) >= LEAST_TURN)
    };
    new.iter().find(is_turned).is_none().then_some(largest)
}

/// Points of a patch: middles of triangles, corners and points of edges that two triangles share.
fn points(patch: &[PatchTriangle]) -> impl Iterator<Item = DVec3> + '_ {
    let middles = patch.iter().map(|triangle| triangle.corners.iter().sum::<DVec3>() / 3.0);
    let edges = patch.iter().flat_map(PatchTriangle::edges);
    let inner = edges.enumerate().filter(|(n, [a, b])| {
        // Each edge once, from the first of its triangles.
        patch.iter().flat_map(PatchTriangle::edges).skip(n + 1).any(|[c, d]| [d, c] == [*a, *b])
    });
    let along = |[a, b]: [DVec3; 2]| (0..POINTS + 2).map(move |n| a.lerp(b, n as f64 / (POINTS + 1) as f64));
    middles.chain(inner.flat_map(move |(_, edge)| along(edge)))
}

struct PatchTriangle {
    corners: [DVec3; 3],
    /// Zero of one too slim.
    normal: DVec3,
}

impl PatchTriangle {
    fn of(corners: &TriangleCorners) -> PatchTriangle {
        PatchTriangle { corners: corners.map(wide), normal: normal(corners) }
    }

    fn edges(&self) -> [[DVec3; 2]; 3] {
        let [a, b, c] = self.corners;
        [[a, b], [b, c], [c, a]]
    }

    /// The square of a point's distance.
    fn squared(&self, point: DVec3) -> f64 {
        let [a, b, c] = self.corners;
        let is_within = |a: DVec3, b: DVec3| (b - a).cross(point - a).dot(self.normal) >= 0.0;
        if self.normal != DVec3::ZERO && is_within(a, b) && is_within(b, c) && is_within(c, a) {
            return (point - a).dot(self.normal).powi(2);
        }
        self.edges().map(|edge| to_edge(point, edge)).into_iter().fold(f64::INFINITY, f64::min)
    }
}

/// The square of the distance between a point and an edge.
fn to_edge(point: DVec3, [a, b]: [DVec3; 2]) -> f64 {
    let along = b - a;
    let squared = along.length_squared();
    let part = if squared > 0.0 { ((point - a).dot(along) / squared).clamp(0.0, 1.0) } else { 0.0 };
    point.distance_squared(a + along * part)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_flip_across_a_roof_is_as_far_as_the_roof_is_high() {
        let [a, b, c, d] = [[0.0, 0.0, 0.0], [4.0, 0.0, 0.0], [4.0, 4.0, 0.0], [0.0, 4.0, 0.0]];
        let raised = |h: f32| [a, b, [4.0, 4.0, h], d];
        for height in [0.0, 0.1, 0.5] {
            let [a, b, c, d] = raised(height);
            let (old, new) = ([[a, b, c], [a, c, d]], [[a, b, d], [b, c, d]]);
            let found = patch_distance(&old, &new, 1.0).unwrap();
            // The diagonals are half the height apart upright; nearest points are a little nearer.
            assert!((found - f64::from(height) / 2.0).abs() <= 0.02 * f64::from(height), "{height}: {found}");
            assert_eq!(patch_distance(&old, &new, 0.45 * f64::from(height)).is_some(), height == 0.0);
        }
        // Turned over.
        assert_eq!(patch_distance(&[[a, b, c]], &[[a, c, b]], 1.0), None);
    }
}
