//! Walls and gaps between the samples of a brick of a closed soup.
//!
//! A lattice edge can hide one only if facets of both directions cross it. So the facets that may face the axis are
//! scanned first; all others only where that finds an edge of both, and all is to be known.

use super::crossings::Hit;
use super::evaluate::{Evaluation, Evaluator};
use super::scan::ScanFacet;
use crate::brick::{POINTS, Samples, ThinFeatures, ThinLines, ThinPair, point_index, point_position};
use crate::lattice::{Axis, BRICK_CELLS, CubeTest, NodeKey, bounds};

/// Words of a set of lattice edges along one axis, a bit for each sample that an edge may begin at.
pub(super) const WORDS: usize = POINTS.div_ceil(64);

/// Edges along one axis that facets cross in both directions.
struct DoubleCrossings {
    rising: [u64; WORDS],
    falling: [u64; WORDS],
}

impl DoubleCrossings {
    fn by(hits: &[Hit]) -> DoubleCrossings {
        let mut crossed = DoubleCrossings { rising: [0; WORDS], falling: [0; WORDS] };
        for hit in hits {
            let set = if hit.jump > 0 { &mut crossed.rising } else { &mut crossed.falling };
            set[usize::from(hit.lower) / 64] |= 1 << (hit.lower % 64);
        }
        crossed
    }

    fn is_any(&self) -> bool {
        self.rising.iter().zip(&self.falling).any(|(rising, falling)| rising & falling != 0)
    }

    fn holds(&self, lower: u16) -> bool {
        let word = usize::from(lower) / 64;
        (self.rising[word] & self.falling[word]) >> (lower % 64) & 1 != 0
    }
}

impl Evaluation<'_> {
    /// The walls and gaps of the boundary w = 0.5 that lie between two samples of the brick: on all lines those of the apron
    /// too, which cells of the brick touch; else on the edges that it owns.
    pub fn thin(&self, lines: ThinLines) -> ThinFeatures {
        let mut thin = ThinFeatures::default();
        for axis in Axis::ALL {
            self.evaluator.add_thin(axis, self.key, lines, &self.samples, &mut thin);
        }
        let mut thin = thin.of_all(lines);
        thin.unseen = u64::from(thin.is_empty() && self.hides_solid());
        thin.bridged = u64::from(lines == ThinLines::All && thin.is_empty() && self.bridges_sheet());
        thin
    }

    /// Whether no sample of the brick is inside, and yet there is a piece of solid in it: lines enter and leave it between
    /// two samples, or none meets it at all.
    fn hides_solid(&self) -> bool {
        if self.samples.0[0] >= 1 || !self.is_uniform() {
            return false;
        }
        let is_met = |axis: Axis| !self.evaluator.all_hits(axis, self.key).is_empty();
        match Axis::ALL.into_iter().any(is_met) {
            true => self.has_hidden_boundary(),
            false => self.is_entered(),
        }
    }

    /// Whether a triangle lies a cell or more within the brick: the edge of a solid beside it may reach as far into it
    /// before a line meets that.
    fn is_entered(&self) -> bool {
        let cell = 1 << self.key.spacing_bits();
        let low = self.key.base().map(|base| base + 1 + cell);
        let size = (BRICK_CELLS as i32 - 2) * cell;
        (0..self.list.indices.len()).any(|position| {
            let triangle = self.list.get(position);
            let (min, max) = bounds(triangle);
            (0..3).all(|a| min[a] <= low[a] + size && low[a] <= max[a])
                && CubeTest::new(triangle, size).touches(low)
        })
    }
}

impl Evaluator {
    fn add_thin(
        &self,
        axis: Axis,
        key: NodeKey,
        lines: ThinLines,
        samples: &Samples,
        thin: &mut ThinFeatures,
    ) {
        let mut hits = Vec::new();
        self.add_hits(axis, key, lines, may_face, &mut hits);
        let crossed = DoubleCrossings::by(&hits);
        if !crossed.is_any() {
            return;
        }
        let all = lines == ThinLines::All;
        let is_wanted = |hit: &Hit| crossed.holds(hit.lower) && (all || is_owned(axis, hit.lower));
        hits.retain(is_wanted);
        // Few other facets cross such edges. Where it is enough to tell how much hides, edges of theirs are passed over.
        if all {
            let mut others = Vec::new();
            self.add_hits(axis, key, lines, |facet, axis| !may_face(facet, axis), &mut others);
            hits.extend(others.into_iter().filter(is_wanted));
        }
        hits.sort_unstable_by_key(|hit| (hit.lower, hit.offset));
        for edge in hits.chunk_by(|p, q| p.lower == q.lower) {
            self.add_thin_edge(axis, key, samples, edge, thin);
        }
    }

    /// All crossings along an axis of the edges that facets cross in both directions.
    pub(super) fn hits_of_double_edges(&self, axis: Axis, key: NodeKey) -> Vec<Hit> {
        let mut hits = Vec::new();
        self.add_hits(axis, key, ThinLines::All, |_, _| true, &mut hits);
        let crossed = DoubleCrossings::by(&hits);
        hits.retain(|hit| crossed.holds(hit.lower));
        hits
    }

    /// Adds what hides on one edge, whose crossings are in order; nothing if some are missing.
    fn add_thin_edge(
        &self,
        axis: Axis,
        key: NodeKey,
        samples: &Samples,
        edge: &[Hit],
        thin: &mut ThinFeatures,
    ) {
        let lower = usize::from(edge[0].lower);
        let next = lower + point_index(Axis::ALL.map(|other| usize::from(other == axis)));
        let mut w = i32::from(samples.0[lower]);
        if w + edge.iter().map(|hit| hit.jump).sum::<i32>() != i32::from(samples.0[next]) {
            return;
        }
        // The last passage: its offset, its normal, and whether it led inside.
        let mut last: Option<(u16, [f64; 3], bool)> = None;
        for place in edge.chunk_by(|p, q| p.offset == q.offset) {
            let before = w >= 1;
            w += place.iter().map(|hit| hit.jump).sum::<i32>();
            let inside = w >= 1;
            if before == inside {
                continue;
            }
            let normal = self.normal_of_passage(place, inside);
            if let Some((offset, other, is_wall)) = last {
                let chord = u32::from(place[0].offset - offset);
                let spacing_bits = key.spacing_bits();
                thin.add_pair(&ThinPair { axis, normals: [other, normal], chord, spacing_bits, is_wall });
            }
            last = Some((place[0].offset, normal, inside));
        }
    }

    /// The normal of a passage: of several facets that pass at one place the smallest, so that their order does not
    /// matter.
    fn normal_of_passage(&self, place: &[Hit], inside: bool) -> [f64; 3] {
        let passing = place.iter().filter(|hit| (hit.jump > 0) == inside);
        let normal = passing.map(|hit| self.facet(hit.facet).normal).min();
        normal.unwrap_or_default().map(|c| c as f64)
    }
}

/// Whether a facet can be one of two that face each other along an axis. That axis has the largest component of their
/// common normal, from which each of their own is 15° away at most: then its component is at least half of the largest.
fn may_face(facet: &ScanFacet, axis: Axis) -> bool {
    let most = facet.normal.iter().map(|c| c.unsigned_abs()).max().unwrap_or(0);
    2 * facet.normal[axis.index()].unsigned_abs() >= most
}

/// Whether the edge along `axis` that begins at a sample is the brick's, not its neighbour's.
fn is_owned(axis: Axis, lower: u16) -> bool {
    let lower = usize::from(lower);
    let ijk = point_position(lower);
    Axis::ALL.into_iter().all(|other| other == axis || ijk[other.index()] < BRICK_CELLS)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lattice::{RootCube, Triangle};
    use crate::winding::TriangleList;
    use brickfield_bench_data::pile::random_pile;
    use brickfield_bench_data::{Mesh, Rng, shapes};

    /// Every edge looked at with all its crossings, and nothing left out beforehand.
    fn thin_of_all(evaluation: &Evaluation<'_>) -> ThinFeatures {
        let mut thin = ThinFeatures::default();
        for axis in Axis::ALL {
            let mut hits = Vec::new();
            evaluation.evaluator.add_hits(axis, evaluation.key, ThinLines::All, |_, _| true, &mut hits);
            hits.sort_by_key(|hit| (hit.lower, hit.offset));
            for edge in hits.chunk_by(|p, q| p.lower == q.lower) {
                evaluation.evaluator.add_thin_edge(
                    axis,
                    evaluation.key,
                    &evaluation.samples,
                    edge,
                    &mut thin,
                );
            }
        }
        thin
    }

    #[test]
    fn nothing_is_left_out_by_looking_at_few_facets() {
        let (mut found, mut all) = ([0; 2], [0.0; 2]);
        for seed in 0..12 {
            let mut rng = Rng::new(seed);
            let mut pieces = random_pile(seed, 4);
            let (low, high) = Mesh::merged(&pieces).bounds();
            let size = (0..3).map(|a| high[a] - low[a]).fold(0.0, f64::max);
            for _ in 0..12 {
                let half = [0.2 * size, 0.3 * size, size * 10f64.powf(rng.range(-4.0, -2.0))];
                let plate = shapes::cuboid(half.map(|c| -c), half).rotated_by(rng.quaternion());
                pieces.push(if rng.below(3) == 0 { plate.flipped() } else { plate });
            }
            let soup: Vec<_> = Mesh::merged(&pieces).facets().collect();
            let ends = |pick: fn(f64, f64) -> f64, from: f64| {
                let along = |a: usize| soup.iter().flatten().fold(from, |m, v| pick(m, v[a]));
                [along(0), along(1), along(2)]
            };
            let root = RootCube::around(ends(f64::min, f64::MAX), ends(f64::max, f64::MIN)).unwrap();
            let array: Vec<Triangle> = soup.iter().map(|t| t.map(root.snapper())).collect();
            let indices: Vec<u32> = (0..array.len() as u32).collect();
            let mut evaluator = Evaluator::default();
            let list = TriangleList { array: &array, indices: &indices };
            let evaluation = evaluator.evaluate(NodeKey::ROOT, 0, list).unwrap();
            let thin = evaluation.thin(ThinLines::All);
            let expected = thin_of_all(&evaluation);
            assert_eq!((thin.walls, thin.gaps), (expected.walls, expected.gaps), "{seed}");
            // One line in sixteen tells about as much.
            let some = evaluation.thin(ThinLines::Sixteenth);
            all = [all[0] + thin.walls.area(1.0), all[1] + some.walls.area(1.0)];
            found = [found[0] + thin.walls.edges, found[1] + thin.gaps.edges];
        }
        assert!((all[1] / all[0] - 1.0).abs() < 0.1, "{all:?}");
        assert!(found.iter().all(|edges| *edges > 100), "{found:?}");
    }
}
