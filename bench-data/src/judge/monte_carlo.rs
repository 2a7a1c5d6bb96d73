//! Volumes by random points: of the union, of all passes together, and of what they overlap.
//!
//! Points are drawn from the segments themselves, each as often as its volume asks, so none falls into the empty part of a
//! box. A point in k segments is drawn k times as often as one in a single segment, so it counts 1/k (Karp & Luby 1983).
//! Where nothing overlaps the union has no error at all. Points come in pairs, each from its own equal share of all
//! volume, and the difference of the two tells the standard error without bias.

use super::bead::BeadSolid;
use super::gcode::GcodeBeads;
use super::passes::pass_starts;
use super::tree::Bvh;
use crate::vector::V3;
use crate::{Rng, StlFacet};
use rayon::prelude::*;

/// Most cells of the grid that finds the points near a segment.
const CELLS_MOST: f64 = 2e7;

/// A value with its standard error.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SampleMean {
    /// mm³.
    pub value: f64,
    /// One standard error of it, mm³.
    pub error: f64,
}

/// What random points say.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct VolumeEstimates {
    /// Volume of {w ≥ 1}.
    pub union: SampleMean,
    /// The integral of w.
    pub winding: SampleMean,
    /// The integral of w − 1 where w ≥ 1.
    pub overlap: SampleMean,
}

/// What w counts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CountBy {
    /// Stretches that do not come back onto themselves.
    Passes,
    /// Runs without travel.
    Beads,
}

/// The segments of a toolpath with what they belong to.
pub struct BeadSegments {
    solids: Vec<BeadSolid>,
    /// The pass, or bead, of each.
    owners: Vec<u32>,
    /// Of the segments whose pass follows another one of its bead: the first of each.
    joints: Vec<bool>,
}

impl BeadSegments {
    /// All segments of a toolpath.
    pub fn new(path: &GcodeBeads, count: CountBy) -> BeadSegments {
        let passes: Vec<Vec<usize>> = match count {
            CountBy::Passes => path.beads.par_iter().map(pass_starts).collect(),
            CountBy::Beads => vec![vec![0]; path.beads.len()],
        };
        let mut beads = BeadSegments { solids: Vec::new(), owners: Vec::new(), joints: Vec::new() };
        let mut owner = 0;
        for (bead, starts) in path.beads.iter().zip(passes) {
            for (n, section) in bead.sections.iter().enumerate() {
                let begins = starts.binary_search(&n).is_ok();
                owner += u32::from(begins);
                beads.solids.push(BeadSolid::new(bead.points[n], bead.points[n + 1], *section));
                beads.owners.push(owner);
                beads.joints.push(begins && n > 0);
            }
        }
        beads
    }

    /// How many passes there are, or beads.
    pub fn owners(&self) -> u32 {
        self.owners.last().copied().unwrap_or(0)
    }

    /// Number of segments.
    pub fn segments(&self) -> usize {
        self.solids.len()
    }

    /// Volumes by so many pairs of points.
    pub fn volumes(&self, pairs: u32, seed: u64) -> VolumeEstimates {
        let mut ends: Vec<f64> = Vec::with_capacity(self.solids.len());
        for solid in &self.solids {
            ends.push(ends.last().unwrap_or(&0.0) + solid.volume());
        }
        let Some(&all) = ends.last() else { return VolumeEstimates::default() };
        let share = all / f64::from(pairs);
        let points: Vec<(V3, u32)> = (0..2 * pairs)
            .into_par_iter()
            .map(|n| {
                let mut rng = Rng::nth(seed, u64::from(n));
                let place = share * (f64::from(n / 2) + rng.range(0.0, 1.0));
                let segment = ends.partition_point(|&end| end <= place).min(self.solids.len() - 1);
                let solid = &self.solids[segment];
                let part = (1.0 - (ends[segment] - place) / solid.volume()).clamp(0.0, 1.0);
                (solid.point(part, &mut rng), segment as u32)
            })
            .collect();
        let seen = self.seen(&points);
        let of = |f: &(dyn Fn(&PointCover) -> f64 + Sync)| {
            estimate(all, seen.par_chunks(2).map(|pair| [f(&pair[0]), f(&pair[1])]).collect())
        };
        VolumeEstimates {
            union: of(&|seen| 1.0 / seen.segments),
            winding: of(&|seen| seen.winding / seen.segments),
            overlap: of(&|seen| (seen.winding - 1.0) / seen.segments),
        }
    }

    /// What covers each point, of which each comes with a segment that does.
    fn seen(&self, points: &[(V3, u32)]) -> Vec<PointCover> {
        let grid = Grid::new(points);
        let mut hits: Vec<(u32, u32)> = (0..self.solids.len() as u32)
            .into_par_iter()
            .flat_map_iter(|segment| {
                let solid = &self.solids[segment as usize];
                let near = solid.boxes(grid.edge).flat_map(|bounds| grid.within(bounds));
                near.filter(|&point| solid.covers(points[point as usize].0))
                    .map(|point| (point, segment))
                    .collect::<Vec<_>>()
            })
            .collect();
        hits.extend(points.iter().enumerate().map(|(point, &(_, segment))| (point as u32, segment)));
        hits.par_sort_unstable();
        hits.dedup();
        let of_points: Vec<&[(u32, u32)]> = hits.chunk_by(|a, b| a.0 == b.0).collect();
        of_points.into_par_iter().map(|hits| self.seen_at(points[hits[0].0 as usize].0, hits)).collect()
    }

    fn seen_at(&self, p: V3, hits: &[(u32, u32)]) -> PointCover {
        // Segments are in order, so those of a pass follow each other.
        let mut passes: Vec<u32> = hits.iter().map(|&(_, segment)| self.owners[segment as usize]).collect();
        passes.dedup();
        // Where a pass begins at another's end both have the same round end, which counts once.
        let shared = |&&(_, segment): &&(u32, u32)| {
            let (n, owner) = (segment as usize, self.owners[segment as usize]);
            self.joints[n] && passes.contains(&(owner - 1)) && self.solids[n].first_end().covers(p)
        };
        let shared = hits.iter().filter(shared).count();
        PointCover { segments: hits.len() as f64, winding: (passes.len() - shared) as f64 }
    }
}

/// What covers a point.
struct PointCover {
    segments: f64,
    winding: f64,
}

/// Volumes of a closed soup by so many pairs of points, each of them in its own box of a grid around the soup.
pub fn soup_volumes(facets: Vec<StlFacet>, pairs: u32, seed: u64) -> VolumeEstimates {
    let tree = Bvh::new(facets);
    let Some(root) = tree.root() else { return VolumeEstimates::default() };
    let [low, high] = tree.bounds(root).map(|corner| corner.map(f64::from));
    let size = [0, 1, 2].map(|k| high[k] - low[k]);
    let all: f64 = size.iter().product();
    let edge = (all / f64::from(pairs)).cbrt();
    let counts = size.map(|s| (s / edge).round().max(1.0) as u64);
    let windings: Vec<[i64; 2]> = (0..counts.iter().product())
        .into_par_iter()
        .map(|n| {
            let mut rng = Rng::nth(seed, n);
            let place = [n % counts[0], n / counts[0] % counts[1], n / (counts[0] * counts[1])];
            let mut point = || {
                [0, 1, 2]
                    .map(|k| low[k] + size[k] * (place[k] as f64 + rng.range(0.0, 1.0)) / counts[k] as f64)
            };
            tree.windings([point(), point()])
        })
        .collect();
    let of =
        |f: fn(i64) -> i64| estimate(all, windings.iter().map(|pair| pair.map(|w| f(w) as f64)).collect());
    VolumeEstimates { union: of(|w| i64::from(w > 0)), winding: of(|w| w), overlap: of(|w| (w - 1).max(0)) }
}

/// The integral over a volume from pairs of values, each pair from an equal share of it.
fn estimate(volume: f64, pairs: Vec<[f64; 2]>) -> SampleMean {
    let count = pairs.len() as f64;
    let sum: f64 = pairs.iter().map(|[a, b]| 0.5 * (a + b)).sum();
    let square: f64 = pairs.iter().map(|[a, b]| 0.25 * (a - b) * (a - b)).sum();
    SampleMean { value: volume * sum / count, error: volume * square.sqrt() / count }
}

/// Points by the cell of a grid that they lie in.
struct Grid {
    low: V3,
    edge: f64,
    counts: [usize; 3],
    /// Where the points of each cell begin in `order`, and the end.
    starts: Vec<u32>,
    order: Vec<u32>,
}

impl Grid {
    fn new(points: &[(V3, u32)]) -> Grid {
        let bound = |best: fn(f64, f64) -> f64, from| {
            points.iter().fold([from; 3], |b, (p, _)| [0, 1, 2].map(|k| best(b[k], p[k])))
        };
        let (low, high) = (bound(f64::min, f64::INFINITY), bound(f64::max, f64::NEG_INFINITY));
        let size = [0, 1, 2].map(|k| (high[k] - low[k]).max(1e-9));
        // About a point a cell where all of the box is filled.
        let cells = CELLS_MOST.min(points.len() as f64 + 1.0);
        let edge = (size.iter().product::<f64>() / cells)
            .cbrt()
            .max(size.iter().fold(0.0, |a, b| b.max(a)) / 4096.0);
        let counts = size.map(|s| (s / edge) as usize + 1);
        let mut grid = Grid { low, edge, counts, starts: Vec::new(), order: Vec::new() };
        let cells: Vec<usize> = points.iter().map(|(p, _)| grid.index(grid.cell(*p))).collect();
        grid.starts = vec![0; counts.iter().product::<usize>() + 1];
        cells.iter().for_each(|&cell| grid.starts[cell + 1] += 1);
        (1..grid.starts.len()).for_each(|n| grid.starts[n] += grid.starts[n - 1]);
        let mut next = grid.starts.clone();
        grid.order = vec![0; points.len()];
        for (point, &cell) in cells.iter().enumerate() {
            grid.order[next[cell] as usize] = point as u32;
            next[cell] += 1;
        }
        grid
    }

    fn cell(&self, p: V3) -> [usize; 3] {
        [0, 1, 2].map(|k| (((p[k] - self.low[k]) / self.edge).max(0.0) as usize).min(self.counts[k] - 1))
    }

    fn index(&self, [x, y, z]: [usize; 3]) -> usize {
        (z * self.counts[1] + y) * self.counts[0] + x
    }

    /// The points of all cells that a box meets: a row of cells is one stretch of `order`.
    fn within(&self, [low, high]: [V3; 2]) -> impl Iterator<Item = u32> + '_ {
        let ([x0, y0, z0], [x1, y1, z1]) = (self.cell(low), self.cell(high));
        let rows = (z0..=z1).flat_map(move |z| (y0..=y1).map(move |y| (y, z)));
        rows.flat_map(move |(y, z)| {
            let (from, to) = (self.index([x0, y, z]), self.index([x1, y, z]) + 1);
            self.order[self.starts[from] as usize..self.starts[to] as usize].iter().copied()
        })
    }
}

#[cfg(test)]
mod tests {
    use super::super::bead::BeadSize;
    use super::super::gcode::{Bead, ReadOptions, read};
    use super::*;
    use crate::Mesh;
    use crate::passes::pass_files;
    use crate::shapes::cuboid;
    use std::f64::consts::PI;

    fn volumes(paths: &[&[V3]], section: BeadSize, pairs: u32) -> VolumeEstimates {
        let bead = |points: &&[V3]| Bead {
            points: points.to_vec(),
            sections: vec![section; points.len() - 1],
            feature: 0,
        };
        let path = GcodeBeads { beads: paths.iter().map(bead).collect(), ..GcodeBeads::default() };
        BeadSegments::new(&path, CountBy::Passes).volumes(pairs, 7)
    }

    /// Within four standard errors, which are at most this part of it.
    fn assert_is(found: SampleMean, truth: f64, error_most: f64) {
        assert!(found.error <= error_most * truth, "{found:?}");
        assert!((found.value - truth).abs() <= 4.0 * found.error + 1e-9 * truth, "{found:?}, not {truth}");
    }

    #[test]
    fn a_straight_bead_has_no_error() {
        let section = BeadSize { width: 0.5, height: 0.2 };
        let found = volumes(&[&[[0.0, 0.0, 0.2], [10.0, 3.0, 0.2]]], section, 1000);
        assert_is(found.union, section.area() * 109f64.sqrt() + section.ends(), 1e-12);
        assert_eq!((found.winding, found.overlap.value), (found.union, 0.0));
    }

    #[test]
    fn crossing_cylinders_share_sixteen_thirds_of_their_radius_cubed() {
        let section = BeadSize { width: 2.0, height: 2.0 };
        let lines: [&[V3]; 2] = [&[[-9.0, 0.0, 2.0], [9.0, 0.0, 2.0]], &[[0.0, -9.0, 2.0], [0.0, 9.0, 2.0]]];
        let found = volumes(&lines, section, 200_000);
        let line = 18.0 * PI + 4.0 / 3.0 * PI;
        assert_is(found.overlap, 16.0 / 3.0, 0.01);
        assert_is(found.union, 2.0 * line - 16.0 / 3.0, 1e-3);
        assert_is(found.winding, 2.0 * line, 1e-3);
    }

    #[test]
    fn files_have_the_volumes_of_their_closed_forms() {
        for made in pass_files() {
            let path = read(made.gcode.as_bytes(), &ReadOptions::default()).unwrap();
            let found = BeadSegments::new(&path, CountBy::Passes).volumes(100_000, 3);
            eprintln!("{}: {found:?} of {} and {}", made.name, made.union, made.overlap);
            // Closed forms leave out how turns of a vase and circles meet steps: a thousandth of the overlap.
            let near = |found: SampleMean, truth: f64, part: f64| {
                (found.value - truth).abs() <= 4.0 * found.error + part * truth
            };
            assert!(near(found.union, made.union, 2e-4), "{}: {:?}", made.name, found.union);
            assert!(near(found.overlap, made.overlap, 2e-3), "{}: {:?}", made.name, found.overlap);
            assert!(found.union.error < 2e-3 * made.union);
            let beads = BeadSegments::new(&path, CountBy::Beads).volumes(20_000, 3);
            assert!(beads.overlap.value == 0.0 && near(beads.union, made.union, 2e-4), "{}", made.name);
        }
    }

    #[test]
    fn soups_have_their_volumes() {
        let boxes = [cuboid([0.0; 3], [10.0; 3]), cuboid([6.0, 0.0, 0.0], [16.0, 10.0, 10.0])];
        let found = soup_volumes(Mesh::merged(&boxes).soup(), 50_000, 1);
        assert_is(found.union, 1600.0, 1e-3);
        assert_is(found.overlap, 400.0, 3e-3);
        assert_is(found.winding, 2000.0, 3e-3);
        assert_eq!(soup_volumes(Vec::new(), 10, 1), VolumeEstimates::default());
    }
}
