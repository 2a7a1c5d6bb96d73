//! Triangles over the polygon of a cross-section, for the caps of a sweep.
//!
//! Whatever the polygon is, convex or not, with collinear or repeated corners or crossing itself, the
//! triangles' directed edges cancel but for the polygon's own: that is what closes a sweep. For a simple
//! polygon they do not overlap either.

use earcut::Earcut;
use std::collections::BTreeMap;

/// Polygons with more corners get a fan, for cutting ears may take a time that grows with the square. A fan
/// closes the sweep as well: its overlaps cancel, up to the rounding of the corners.
const EARS_MAX: usize = 2048;

/// Triangles over the polygon as indices into it, with the polygon's own direction; none for fewer than three
/// corners.
pub(super) fn triangles(polygon: &[[f64; 2]]) -> Vec<[u32; 3]> {
    let count = polygon.len() as u32;
    let fan = || (2..count).map(|j| [0, j - 1, j]).collect();
    let area = |t: &[u32; 3]| signed_area(t.map(|v| polygon[v as usize]));
    let fan_areas = || (2..count).map(|j| area(&[0, j - 1, j]));
    if fan_areas().all(|a| a >= 0.0) || fan_areas().all(|a| a <= 0.0) || polygon.len() > EARS_MAX {
        return fan();
    }
    let mut corners: Vec<u32> = Vec::new();
    Earcut::new().earcut(polygon.iter().copied(), &[], &mut corners);
    let mut cut: Vec<[u32; 3]> = corners.chunks_exact(3).map(|t| [t[0], t[1], t[2]]).collect();
    if cut.iter().map(area).sum::<f64>() * fan_areas().sum::<f64>() < 0.0 {
        cut.iter_mut().for_each(|t| t.swap(1, 2));
    }
    fill_rest(count, &mut cut);
    cut
}

/// Twice the area, positive if counter-clockwise.
fn signed_area([a, b, c]: [[f64; 2]; 3]) -> f64 {
    (b[0] - a[0]) * (c[1] - a[1]) - (c[0] - a[0]) * (b[1] - a[1])
}

/// Adds what the ears left open. Cutting ears drops collinear and repeated corners and gives up on
/// polygons that cross themselves; the edges that then do not cancel form closed paths, and each gets a fan.
fn fill_rest(count: u32, triangles: &mut Vec<[u32; 3]>) {
    let mut open: BTreeMap<(u32, u32), i64> = BTreeMap::new();
    let mut add = |from: u32, to: u32, times: i64| {
        if from != to {
            let (edge, times) = if from < to { ((from, to), times) } else { ((to, from), -times) };
            *open.entry(edge).or_default() += times;
        }
    };
    (0..count).for_each(|j| add(j, (j + 1) % count, 1));
    for &[a, b, c] in triangles.iter() {
        [(a, b), (b, c), (c, a)].into_iter().for_each(|(from, to)| add(from, to, -1));
    }
    let mut next: BTreeMap<u32, Vec<u32>> = BTreeMap::new();
    for ((a, b), times) in open.into_iter().filter(|(_, times)| *times != 0) {
        let (from, to) = if times > 0 { (a, b) } else { (b, a) };
        next.entry(from).or_default().extend((0..times.abs()).map(|_| to));
    }
    // As many edges leave a corner as arrive, so every walk ends where it began.
    while let Some((&start, _)) = next.first_key_value() {
        let mut at = start;
        while let Some(to) = take(&mut next, at) {
            if at != start && to != start {
                triangles.push([start, at, to]);
            }
            at = to;
            if at == start {
                break;
            }
        }
    }
}

/// Takes an edge that leaves `from`, and returns its end.
fn take(next: &mut BTreeMap<u32, Vec<u32>>, from: u32) -> Option<u32> {
    let ends = next.get_mut(&from)?;
    let to = ends.pop();
    if ends.is_empty() {
        next.remove(&from);
    }
    to
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Edges that do not cancel, but for the polygon's.
    fn open_edges(count: u32, triangles: &[[u32; 3]]) -> usize {
        let mut edges: BTreeMap<(u32, u32), i64> = BTreeMap::new();
        let mut add = |from: u32, to: u32, times: i64| {
            *edges.entry((from.min(to), from.max(to))).or_default() += if from < to { times } else { -times };
        };
        (0..count).filter(|_| count > 2).for_each(|j| add(j, (j + 1) % count, 1));
        for [a, b, c] in triangles {
            add(*a, *b, -1);
            add(*b, *c, -1);
            add(*c, *a, -1);
        }
        edges.iter().filter(|((from, to), times)| from != to && **times != 0).count()
    }

    fn area(polygon: &[[f64; 2]], triangles: &[[u32; 3]]) -> (f64, f64) {
        let areas = triangles.iter().map(|t| signed_area(t.map(|v| polygon[v as usize])) / 2.0);
        areas.fold((0.0, 0.0), |(net, gross), a| (net + a, gross + a.abs()))
    }

    #[test]
    fn simple_polygons_are_covered_once_in_either_direction() {
        let ell: &[[f64; 2]] = &[[0.0, 0.0], [2.0, 0.0], [2.0, 1.0], [1.0, 1.0], [1.0, 2.0], [0.0, 2.0]];
        // Collinear corners on its sides, and one twice.
        let notched: &[[f64; 2]] = &[
            [0.0, 0.0],
            [1.0, 0.0],
            [2.0, 0.0],
            [4.0, 0.0],
            [4.0, 4.0],
            [4.0, 4.0],
            [2.0, 1.0],
            [0.0, 4.0],
            [0.0, 2.0],
        ];
        let square: &[[f64; 2]] = &[[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]];
        for (polygon, expected) in [(ell, 3.0), (notched, 10.0), (square, 1.0)] {
            for (polygon, sign) in [(polygon.to_vec(), 1.0), (polygon.iter().rev().copied().collect(), -1.0)]
            {
                let triangles = triangles(&polygon);
                assert_eq!(open_edges(polygon.len() as u32, &triangles), 0, "{triangles:?}");
                let (net, gross) = area(&polygon, &triangles);
                assert_eq!((net, gross), (sign * expected, expected), "{triangles:?}");
            }
        }
    }

    #[test]
    fn fewer_than_three_corners_have_no_cap() {
        assert!(triangles(&[]).is_empty() && triangles(&[[0.0; 2]]).is_empty());
        assert!(triangles(&[[0.0; 2], [1.0; 2]]).is_empty());
    }

    proptest! {
        #[test]
        fn edges_cancel_for_any_polygon(
            corners in prop::collection::vec(prop::array::uniform2(-4i8..=4), 3..40),
        ) {
            let polygon: Vec<[f64; 2]> = corners.iter().map(|c| c.map(f64::from)).collect();
            let cut = triangles(&polygon);
            prop_assert_eq!(open_edges(polygon.len() as u32, &cut), 0);
            let fan: Vec<[u32; 3]> = (2..polygon.len() as u32).map(|j| [0, j - 1, j]).collect();
            prop_assert_eq!(area(&polygon, &cut).0, area(&polygon, &fan).0);
        }
    }
}
