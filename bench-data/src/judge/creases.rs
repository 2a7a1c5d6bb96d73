//! Creases of the boundary of a union: where two faces meet at an angle.
//!
//! They are parts of facets' own edges, and of the lines in which facets of different pieces meet. A point of such a line
//! is one of a crease if of the four wedges between the two planes one is inside, or three are, or two across.

use crate::judge::boundary::Union;
use crate::judge::tree::{bounds_of, corners, normal};
use crate::vector::{V3, add, cross, dot, norm, scale, sub, unit};
use crate::{Rng, StlFacet};
use rayon::prelude::*;

/// A line in which two facets meet.
struct Meeting {
    ends: [V3; 2],
    normals: [V3; 2],
}

impl Union {
    /// Points on the creases of the boundary, spread evenly over all edges and lines in which facets meet at more than
    /// `degrees`: of `candidates` on all of these, those that are on creases.
    pub fn creases(&self, candidates: u64, degrees: f64, seed: u64) -> Vec<[f64; 3]> {
        // The planes' angle counts, whichever way they face.
        let least_sine = degrees.to_radians().sin();
        let neighbours = self.neighbours();
        let facets = self.tree().facets().len();
        let of = |n: usize| self.meetings(n, &neighbours[3 * n..3 * n + 3], least_sine);
        let length = |m: &Meeting| norm(sub(m.ends[1], m.ends[0]));
        let lengths: Vec<f64> =
            (0..facets).into_par_iter().map(|n| of(n).iter().map(length).sum::<f64>()).collect();
        let step = lengths.iter().sum::<f64>() / candidates as f64;
        let on = |n: usize| {
            let mut rng = Rng::nth(seed, n as u64);
            let mut points = Vec::new();
            for meeting in of(n) {
                let share = length(&meeting) / step;
                let count = (share + rng.range(0.0, 1.0)) as u64;
                for _ in 0..count {
                    let [a, b] = meeting.ends;
                    let p = add(a, scale(sub(b, a), rng.range(0.0, 1.0)));
                    if self.is_creased(p, &meeting.normals) {
                        points.push(p);
                    }
                }
            }
            points
        };
        (0..facets).into_par_iter().flat_map_iter(on).collect()
    }

    /// For each edge of each facet the facet on its other side; itself if there is none.
    fn neighbours(&self) -> Vec<u32> {
        let facets = self.tree().facets();
        let half_edge = |n: usize| {
            let facet = facets[n / 3].map(|v| v.map(|c| (c + 0.0).to_bits()));
            let (from, to) = (facet[n % 3], facet[(n + 1) % 3]);
            if from < to { (from, to, false, n as u32) } else { (to, from, true, n as u32) }
        };
        let mut half_edges: Vec<_> = (0..3 * facets.len()).map(half_edge).collect();
        half_edges.par_sort_unstable();
        let mut neighbours: Vec<u32> = (0..3 * facets.len() as u32).map(|n| n / 3).collect();
        for uses in half_edges.chunk_by(|a, b| (a.0, a.1) == (b.0, b.1)) {
            // As many run the one way as the other.
            let (forward, backward) = uses.split_at(uses.partition_point(|half_edge| !half_edge.2));
            for (one, other) in forward.iter().zip(backward) {
                neighbours[one.3 as usize] = other.3 / 3;
                neighbours[other.3 as usize] = one.3 / 3;
            }
        }
        neighbours
    }

    /// The lines in which a facet meets others with higher numbers.
    fn meetings(&self, n: usize, neighbours: &[u32], least_sine: f64) -> Vec<Meeting> {
        let facets = self.tree().facets();
        let facet = corners(&facets[n]);
        let own = unit(normal(&facet));
        let mut meetings = Vec::new();
        let mut meets = |m: usize, ends: Option<[V3; 2]>| {
            let normals = [own, unit(normal(&corners(&facets[m])))];
            let bent = norm(cross(normals[0], normals[1])) > least_sine;
            meetings.extend(ends.filter(|_| bent).map(|ends| Meeting { ends, normals }));
        };
        for (edge, &m) in neighbours.iter().enumerate() {
            let ends = [facet[edge], facet[(edge + 1) % 3]];
            meets(m as usize, (m as usize > n).then_some(ends));
        }
        self.tree().meeting(&bounds_of(&facets[n..=n]), |m| {
            if m > n && !shares_an_edge(&facets[n], &facets[m]) {
                meets(m, line_of(&facet, &corners(&facets[m]), self.nudge()));
            }
        });
        meetings
    }

    /// Whether the wedges between two planes at `p` are not all on one side, and not as they are at one of the planes.
    fn is_creased(&self, p: V3, [a, b]: &[V3; 2]) -> bool {
        let cosine = dot(*a, *b);
        // As high above the one plane as above the other.
        let height = self.nudge() / (1.0 - cosine * cosine);
        let wedges = [(1.0, 1.0), (1.0, -1.0), (-1.0, -1.0), (-1.0, 1.0)].map(|(s, t)| {
            let (along_a, along_b) = ((s - t * cosine) * height, (t - s * cosine) * height);
            add(p, add(scale(*a, along_a), scale(*b, along_b)))
        });
        let inside = self.are_inside(wedges);
        match inside.iter().filter(|inside| **inside).count() {
            1 | 3 => true,
            2 => inside[0] == inside[2],
            _ => false,
        }
    }
}

fn shares_an_edge(a: &StlFacet, b: &StlFacet) -> bool {
    a.iter().filter(|corner| b.contains(corner)).count() >= 2
}

/// The line in which two triangles meet that are not in one plane; corners within `nudge` of the other plane are in it.
fn line_of(a: &[V3; 3], b: &[V3; 3], nudge: f64) -> Option<[V3; 2]> {
    let along = cross(unit(normal(a)), unit(normal(b)));
    let span = |cut: &[V3; 3], by: &[V3; 3]| {
        let plane = unit(normal(by));
        let heights = cut.map(|v| dot(plane, sub(v, by[0]))).map(|h| if h.abs() < nudge { 0.0 } else { h });
        let mut on = Vec::with_capacity(4);
        for k in 0..3 {
            let next = (k + 1) % 3;
            if heights[k] == 0.0 {
                on.push(cut[k]);
            }
            if heights[k] * heights[next] < 0.0 {
                let share = heights[k] / (heights[k] - heights[next]);
                on.push(add(cut[k], scale(sub(cut[next], cut[k]), share)));
            }
        }
        let place = |p: &V3| dot(along, *p);
        on.sort_by(|p, q| place(p).total_cmp(&place(q)));
        // All three: the triangles lie in one plane, and have their creases from others.
        (on.len() == 2).then(|| [on[0], on[1]])
    };
    let ([a, b], [c, d]) = (span(a, b)?, span(b, a)?);
    let place = |p: &V3| dot(along, *p);
    let from = if place(&a) > place(&c) { a } else { c };
    let to = if place(&b) < place(&d) { b } else { d };
    (place(&from) < place(&to)).then_some([from, to])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Mesh;
    use crate::shapes::{cuboid, icosphere};

    fn of(pieces: &[Mesh]) -> Union {
        Union::new(Mesh::merged(pieces).soup())
    }

    /// How many coordinates of a point are one of those given.
    fn planes(p: &V3, planes: [&[f64]; 3]) -> usize {
        (0..3).filter(|&k| planes[k].iter().any(|c| (c - p[k]).abs() < 1e-9)).count()
    }

    #[test]
    fn a_box_has_twelve_edges_and_no_diagonals() {
        let points = of(&[cuboid([0.0; 3], [10.0; 3])]).creases(10_000, 20.0, 1);
        let along = |k: usize| points.iter().filter(|p| p[k] > 1e-9 && p[k] < 10.0 - 1e-9).count();
        assert!((9_000..11_000).contains(&points.len()), "{}", points.len());
        assert!(points.iter().all(|p| planes(p, [&[0.0, 10.0]; 3]) == 2));
        assert!((0..3).all(|k| along(k) > 2_800), "{:?}", [0, 1, 2].map(along));
    }

    /// Two boxes that cross: the edges outside of each other and the twelve lines in which sides meet.
    #[test]
    fn faces_of_different_pieces_meet_in_creases() {
        let (x, y) =
            (cuboid([-9.0, -1.0, -1.0], [9.0, 1.0, 1.0]), cuboid([-2.0, -9.0, -2.0], [2.0, 9.0, 2.0]));
        let union = of(&[x, y]);
        let points = union.creases(200_000, 20.0, 1);
        let bar = |p: &&V3| p[0].abs() > 2.0 + 1e-9;
        let meeting = |p: &&V3| (p[0].abs() - 2.0).abs() < 1e-9 && p[1].abs() < 1.5 && p[2].abs() < 1.5;
        // Four edges of 7 on either side and four of 2 at each end; four lines of 2 on either side.
        let (bar, meeting) = (points.iter().filter(bar).count(), points.iter().filter(meeting).count());
        assert!((meeting as f64 / bar as f64 - 16.0 / 72.0).abs() < 0.01, "{meeting} {bar}");
        let inside = |p: &V3| p[0].abs() < 1.9 && p[1].abs() < 1.9 && p[2].abs() < 1.9;
        assert!(!points.iter().any(inside));
    }

    /// A box on a larger one, with its lower side in the upper side of that: a step, though no facet passes another.
    #[test]
    fn pieces_that_stand_on_each_other_meet_in_a_crease() {
        let union = of(&[cuboid([0.0; 3], [10.0, 10.0, 2.0]), cuboid([3.0, 3.0, 2.0], [7.0, 7.0, 5.0])]);
        let points = union.creases(20_000, 20.0, 1);
        let foot =
            points.iter().filter(|p| p[2] == 2.0 && p[0] > 1.0 && p[0] < 9.0 && p[1] > 1.0 && p[1] < 9.0);
        let foot: Vec<_> = foot.collect();
        assert!(foot.len() > 500 && foot.iter().all(|p| planes(p, [&[3.0, 7.0], &[3.0, 7.0], &[]]) == 1));
    }

    /// Nothing where two boxes continue each other, and nothing on what is nearly smooth.
    #[test]
    fn flat_places_have_no_creases() {
        let union = of(&[cuboid([0.0; 3], [5.0, 4.0, 4.0]), cuboid([5.0, 0.0, 0.0], [9.0, 4.0, 4.0])]);
        let points = union.creases(20_000, 20.0, 1);
        assert!(
            !points.is_empty()
                && points.iter().all(|p| planes(p, [&[0.0, 9.0], &[0.0, 4.0], &[0.0, 4.0]]) >= 2)
        );
        assert_eq!(of(&[icosphere(4, 5.0)]).creases(10_000, 20.0, 1).len(), 0);
    }
}
