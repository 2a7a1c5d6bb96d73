//! Cuts of faces whose sides are divided by finer leaves.

use super::*;
use crate::contour::envelope::MinimalEdge;
use crate::contour::face_vertices::SplitFace;
use crate::contour::stages;
use crate::contour::topology::{corners_in_run, cut_runs};
use crate::lattice::{RootCube, spacing_bits};
use proptest::prelude::*;

/// A face, and the minimal edges round it with the sign of the sample where each starts, and where its corners are.
struct Ring {
    root: RootCube,
    axis: Axis,
    corner: Units,
    level: u8,
    edges: Vec<(MinimalEdge, bool)>,
    corners: [usize; 4],
}

/// Numbers one after another.
struct Random(u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 += 1;
        hash(self.0)
    }

    fn one_in(&mut self, n: u64) -> bool {
        self.next().is_multiple_of(n)
    }
}

impl Ring {
    /// Sides are halved up to five times, to the level `finest`, here and there less often; few samples have another sign
    /// than the one before.
    fn random(seed: u64, root: RootCube, level: u8, finest: u8) -> Ring {
        let mut random = Random(seed << 20);
        let axis = Axis::ALL[(random.next() % 3) as usize];
        let size = 1 << spacing_bits(level);
        let corner =
            std::array::from_fn(|_| (random.next() % (1 << (24 - spacing_bits(level)))) as i32 * size);
        let (u, v) = axis.others();
        let mut ring = Ring { root, axis, corner, level, edges: Vec::new(), corners: [0; 4] };
        let sides = [(u, v, true), (v, u, true), (u, v, false), (v, u, false)];
        for (n, (along, across, forward)) in sides.into_iter().enumerate() {
            let mut lower = corner;
            lower[across.index()] += if (along == u) != forward { size } else { 0 };
            ring.corners[n] = ring.edges.len();
            let start = ring.edges.len();
            let deepest = finest.min(level + (random.next() % 6) as u8);
            ring.side(&mut random, (along, lower, level), deepest);
            if !forward {
                ring.edges[start..].reverse();
            }
        }
        let often = [2, 3, 8][seed as usize % 3];
        let mut sign = random.one_in(2);
        for (_, starts) in &mut ring.edges {
            sign ^= random.one_in(often);
            *starts = sign;
        }
        ring
    }

    fn side(&mut self, random: &mut Random, (along, lower, level): (Axis, Units, u8), deepest: u8) {
        if level < deepest && !random.one_in(16) {
            let mut middle = lower;
            middle[along.index()] += 1 << spacing_bits(level + 1);
            self.side(random, (along, lower, level + 1), deepest);
            self.side(random, (along, middle, level + 1), deepest);
            return;
        }
        let fraction = match random.next() % 4 {
            0 => 0,
            1 => 65535,
            _ => random.next() % 65536,
        };
        let fraction = fraction as f32 / 65536.0;
        self.edges.push((MinimalEdge::of_level(self.root, along, lower, level, fraction), false));
    }

    /// Of each cut the two edges and its vertex.
    fn cuts(&self) -> Vec<([MinimalEdge; 2], [f32; 3])> {
        let face = SplitFace::of_level(self.root, self.axis, self.corner, self.level);
        let mut runs = Vec::new();
        cut_runs(&self.edges, |enter, leave| runs.push([enter, leave]));
        let cut = |run: &[usize; 2]| {
            let edges = run.map(|place| self.edges[place].0);
            let corners = corners_in_run(*run, self.corners, self.edges.len());
            (edges, face.half_way_of_several(edges.each_ref(), corners))
        };
        runs.iter().map(cut).collect()
    }
}

/// Where an interior node stands for its descendants, a leaf of the tree beside it may have kept another of several crossings
/// of an edge on their common border.
#[test]
fn plain_cells_have_the_edges_of_those_that_make_their_polygons() {
    let mut other = 0;
    for seed in 0..4 {
        let tree = tree(&noise(seed, 1, 4, 120, 0.0), &random_divide(seed, (0, 4), 100));
        let options = ContourOptions { level: Some(2), ..Default::default() };
        let field = stages::field(&tree, level(options.iso).unwrap(), &options).unwrap();
        for leaf in 0..field.leaves.len() as u32 {
            let (key, surface) = (field.leaves.get(leaf).key, field.surface(leaf).unwrap());
            let (Some(changes), lattice) = (surface.changes(), field.frame(key).lattice()) else { continue };
            for axis in Axis::ALL {
                changes.signs.for_edges(axis, |low| {
                    let at = std::array::from_fn(|a| key.base()[a] + ((low[a] as i32) << key.spacing_bits()));
                    let owner = field.leaves.owner(axis, at, |at| field.leaves.at(at)).unwrap();
                    let owning = field.leaves.get(owner).key;
                    if owning.level() != key.level() {
                        return;
                    }
                    let edge = field.minimal_edge((leaf, changes), &lattice, (axis, low)).unwrap();
                    let surface = field.surface(owner).unwrap();
                    let steps: Units = std::array::from_fn(|a| at[a] - owning.base()[a]);
                    let low_there = steps.map(|s| (s >> key.spacing_bits()) as usize);
                    let there = surface.changes().unwrap().plane(axis, low_there);
                    assert_eq!(edge.fraction, there.rounded_down());
                    other += usize::from(changes.plane(axis, low).rounded_down() != edge.fraction);
                });
            }
        }
    }
    assert!(other > 100, "{other}");
}

/// A place on a face in steps of 2⁻⁴⁰, exactly.
fn exact(axis: Axis, at: [f32; 3]) -> [i128; 2] {
    let (u, v) = axis.others();
    [u, v].map(|a| {
        let scaled = f64::from(at[a.index()]) * f64::from(1 << 20) * f64::from(1 << 20);
        assert_eq!(scaled.fract(), 0.0);
        scaled as i128
    })
}

/// Whether two segments of a plane have a point in common.
fn meet(a: [[i128; 2]; 2], b: [[i128; 2]; 2]) -> bool {
    let side = |[p, q]: [[i128; 2]; 2], r: [i128; 2]| {
        ((q[0] - p[0]) * (r[1] - p[1]) - (q[1] - p[1]) * (r[0] - p[0])).signum()
    };
    let apart = |a: [[i128; 2]; 2], b: [[i128; 2]; 2]| {
        let sides = b.map(|r| side(a, r));
        sides[0] * sides[1] > 0
    };
    let boxes_meet = (0..2).all(|n| {
        a[0][n].min(a[1][n]) <= b[0][n].max(b[1][n]) && b[0][n].min(b[1][n]) <= a[0][n].max(a[1][n])
    });
    boxes_meet && !apart(a, b) && !apart(b, a)
}

/// The lines of a cut, to where the surface passes its edges and to all but the ends of these.
fn lines(axis: Axis, edges: &[MinimalEdge; 2], vertex: [f32; 3]) -> Vec<[[i128; 2]; 2]> {
    let ends = edges.iter().flat_map(|edge| {
        [0.0, edge.fraction, 1.0].map(|fraction| MinimalEdge { fraction, ..*edge }.crossing())
    });
    ends.map(|end| [exact(axis, vertex), exact(axis, end)]).collect()
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(2000))]
    /// Faces are 8 to a million steps of 32 bits wide, their finest edges 8 at least.
    #[test]
    fn lines_of_cuts_of_a_face_meet_nowhere(seed in any::<u32>(), far in 0u32..14) {
        let far = 16.0 * f64::from(1 << far);
        let edge = 15.83;
        let root = RootCube { origin: [far - edge, 0.77 * far - 3.1, -far], edge };
        let step = f64::from((far as f32).next_up() - far as f32);
        let finest = (edge / 32.0 / step / 8.0).log2().floor() as u8;
        let level = (seed % (u32::from(finest.min(12)) + 1)) as u8;
        let ring = Ring::random(u64::from(seed), root, level, finest);
        let cuts = ring.cuts();
        let lines: Vec<_> = cuts.iter().map(|(edges, at)| lines(ring.axis, edges, *at)).collect();
        for (n, a) in lines.iter().enumerate() {
            for (m, b) in lines[..n].iter().enumerate() {
                for (a, b) in a.iter().flat_map(|a| b.iter().map(move |b| (a, b))) {
                    prop_assert!(!meet(*a, *b), "cuts {m} and {n} of {}: {cuts:?}", cuts.len());
                }
            }
        }
    }
}
