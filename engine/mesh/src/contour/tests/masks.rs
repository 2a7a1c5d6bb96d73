//! Cells with every corner mask, alone and next to each other: in one leaf, across leaves, and of two sizes.

use super::*;
use std::collections::HashMap;

/// Samples that are inside, and what turns the normals about each at random.
#[derive(Default)]
struct Given(HashMap<Units, Option<u64>>);

impl Given {
    /// Adds those of `places`, counted in `step` from `corner`, whose bit is set.
    fn add(&mut self, (corner, step): (Units, i32), places: &[Units], bits: u64, seed: Option<u64>) {
        for (_, place) in places.iter().enumerate().filter(|(n, _)| bits >> n & 1 == 1) {
            self.0.insert(std::array::from_fn(|a| corner[a] + step * place[a]), seed);
        }
    }
}

impl SampledField for Given {
    fn winding(&self, at: Units) -> i16 {
        i16::from(self.0.contains_key(&at))
    }

    fn crossing(&self, low: Units, high: Units) -> ([f64; 3], f64) {
        let (sign, seed) = match (self.0.get(&low), self.0.get(&high)) {
            (Some(seed), _) => (1.0, *seed),
            (_, seed) => (-1.0, seed.copied().flatten()),
        };
        let turned = |a: usize| match seed {
            Some(seed) => {
                let seed = low.iter().chain(&high).fold(seed, |h, &c| hash(h ^ c as u64));
                (hash(seed ^ a as u64) & 0xffff) as f64 / 32768.0 - 1.0
            }
            None => 0.0,
        };
        (std::array::from_fn(|a| sign * f64::from((high[a] - low[a]).signum()) + turned(a)), 0.5)
    }
}

/// The corners of a cell of some size, from its lowest one.
fn corners(low: Units, size: i32) -> Vec<Units> {
    (0..8).map(|n| std::array::from_fn(|a| low[a] + size * (n >> a & 1))).collect()
}

/// Those of both, each once.
fn of_both(first: Vec<Units>, second: Vec<Units>) -> Vec<Units> {
    let more: Vec<Units> = second.into_iter().filter(|place| !first.contains(place)).collect();
    [first, more].concat()
}

/// What normals a set of signs is contoured with: along the edges no ambiguous face is joined, turned at random half of them
/// are. Those of either kind take half the time.
#[derive(Clone, Copy, PartialEq)]
enum Normals {
    Both,
    Either,
}

/// Contours sets of signs, one with each of `masks`, as many at once as there are `corners` to count their `places` from.
fn contour_all(
    places: &[Units],
    (corners, step): (&[Units], i32),
    (masks, normals): (impl Iterator<Item = u64>, Normals),
    divide: &dyn Fn(NodeKey) -> bool,
) {
    let masks: Vec<u64> = masks.collect();
    for (n, masks) in masks.chunks(corners.len()).enumerate() {
        for turn in [None, Some(masks[0])] {
            if normals == Normals::Either && turn.is_some() == n.is_multiple_of(2) {
                continue;
            }
            let mut given = Given::default();
            for (mask, corner) in masks.iter().zip(corners) {
                given.add((*corner, step), places, *mask, turn.map(|turn| hash(turn ^ mask << 20)));
            }
            let (_, summary) = meetings::apart(&tree(&given, divide), &ContourOptions::default());
            assert_eq!(summary.unseparated_cells, 0);
        }
    }
}

fn all(places: &[Units]) -> std::ops::Range<u64> {
    0..1 << places.len()
}

/// Places in one leaf, far enough from each other for sets of three samples.
fn in_a_brick() -> (Vec<Units>, i32) {
    let at = |n: i32| [n % 6, n / 6 % 6, n / 36].map(|c| (5 * c + 2) << 19);
    ((0..216).map(at).collect(), 1 << 19)
}

/// Cells of leaves of level 1 on the plane between the halves of the tree across an axis.
const COARSE: i32 = 1 << 18;
const MIDDLE: i32 = 1 << 23;

/// Places on that plane, as far from each other.
fn on_the_plane(axis: Axis) -> Vec<Units> {
    let (u, v) = axis.others();
    let at = |n: i32| {
        let mut at = [MIDDLE; 3];
        at[u.index()] = (5 * (n % 12) + 2) * COARSE;
        at[v.index()] = (5 * (n / 12) + 2) * COARSE;
        at
    };
    (0..144).map(at).collect()
}

/// Places on the line in which two of these planes meet.
fn on_the_line(axis: Axis) -> Vec<Units> {
    let at = |n: i32| {
        let mut at = [MIDDLE; 3];
        at[axis.index()] = (5 * n + 2) * COARSE;
        at
    };
    (0..12).map(at).collect()
}

#[test]
fn every_corner_mask_alone_is_manifold() {
    let (places, (at, step)) = (corners([0; 3], 1), in_a_brick());
    contour_all(&places, (&at, step), (all(&places), Normals::Both), &uniform(0));
}

#[test]
fn every_pair_of_cells_at_a_face_is_manifold() {
    let (at, step) = in_a_brick();
    for axis in Axis::ALL {
        let mut beside = [0; 3];
        beside[axis.index()] = 1;
        let places = of_both(corners([0; 3], 1), corners(beside, 1));
        let normals = part_or_all(Normals::Either, Normals::Both);
        contour_all(&places, (&at, step), (all(&places), normals), &uniform(0));
    }
}

/// The cells on both diagonals around an edge along each axis.
fn cells_at_an_edge(normals: Normals) {
    let (at, step) = in_a_brick();
    for axis in Axis::ALL {
        let (u, v) = axis.others();
        for is_rising in [true, false] {
            let (mut first, mut second) = ([0; 3], [0; 3]);
            second[u.index()] = 1;
            (if is_rising { &mut second } else { &mut first })[v.index()] = 1;
            let places = of_both(corners(first, 1), corners(second, 1));
            contour_all(&places, (&at, step), (all(&places), normals), &uniform(0));
        }
    }
}

#[test]
#[ignore = "a sweep of half a minute and more: .ci/run has it"]
fn every_pair_of_cells_at_an_edge_is_manifold() {
    cells_at_an_edge(Normals::Either);
}

/// All four cells around an edge, with any signs.
#[test]
#[ignore = "minutes"]
fn every_four_cells_around_an_edge_are_manifold() {
    let (at, step) = in_a_brick();
    for axis in Axis::ALL {
        let size = Axis::ALL.map(|other| if other == axis { 2 } else { 3 });
        let places: Vec<Units> =
            (0..18).map(|n| [n % size[0], n / size[0] % size[1], n / (size[0] * size[1])]).collect();
        contour_all(&places, (&at, step), (all(&places), Normals::Both), &uniform(0));
    }
}

/// Cells of one size, on either side of a plane between leaves; these are of the same level, or those on one side are
/// divided, so that samples between those of the cells are outside.
fn cells_across_leaves(normals: Normals) {
    for axis in Axis::ALL {
        let at = on_the_plane(axis);
        let mut below = [0; 3];
        below[axis.index()] = -1;
        let places = of_both(corners(below, 1), corners([0; 3], 1));
        for finer in [None, Some(0), Some(1)] {
            let divide = |key: NodeKey| {
                let is_finer = key.level() == 1 && Some(key.position()[axis.index()]) == finer;
                key.level() == 0 || is_finer
            };
            contour_all(&places, (&at, COARSE), (all(&places), normals), &divide);
        }
    }
}

#[test]
#[ignore = "a sweep of half a minute and more: .ci/run has it"]
fn every_pair_of_cells_across_leaves_is_manifold() {
    cells_across_leaves(Normals::Either);
}

#[test]
#[ignore = "two minutes"]
fn every_pair_of_cells_is_manifold_with_both_kinds_of_normals() {
    cells_at_an_edge(Normals::Both);
    cells_across_leaves(Normals::Both);
}

/// A cell and one of half its size that shares a part of its face, on either side of it, with every `stride`th mask.
fn cells_of_two_sizes_at_a_face(stride: usize) {
    for (axis, finer) in Axis::ALL.into_iter().flat_map(|axis| [(axis, 0), (axis, 1)]) {
        let (u, v) = axis.others();
        let at = on_the_plane(axis);
        let divide =
            |key: NodeKey| key.level() == 0 || key.level() == 1 && key.position()[axis.index()] == finer;
        for quarter in 0..4 {
            let (mut large, mut small) = ([0; 3], [0; 3]);
            large[axis.index()] = if finer == 1 { -2 } else { 0 };
            small[axis.index()] = if finer == 1 { 0 } else { -1 };
            (small[u.index()], small[v.index()]) = (quarter % 2, quarter / 2);
            let places = of_both(corners(large, 2), corners(small, 1));
            contour_all(&places, (&at, COARSE / 2), (all(&places).step_by(stride), Normals::Both), &divide);
        }
    }
}

/// The same where they share a part of an edge alone. The leaves at the other two quadrants around it have the size of
/// either.
fn cells_of_two_sizes_at_an_edge(stride: usize) {
    for axis in Axis::ALL {
        let (u, v) = axis.others();
        let at = on_the_line(axis);
        for n in 0..16 {
            // The quadrant of the small cell, whether the two beside it are divided, too, and which half of the edge it has.
            let [in_u, in_v, others, half] = [n & 1, n >> 1 & 1, n >> 2 & 1, n >> 3];
            let divide = |key: NodeKey| {
                let place = key.position();
                let same = [(u, in_u), (v, in_v)].map(|(axis, side)| place[axis.index()] == side);
                let is_divided = same == [true; 2] || others == 1 && same != [false; 2];
                key.level() == 0 || key.level() == 1 && is_divided
            };
            let (mut large, mut small) = ([0; 3], [0; 3]);
            for (axis, side) in [(u, in_u), (v, in_v)] {
                large[axis.index()] = if side == 1 { -2 } else { 0 };
                small[axis.index()] = if side == 1 { 0 } else { -1 };
            }
            small[axis.index()] = half as i32;
            let places = of_both(corners(large, 2), corners(small, 1));
            contour_all(&places, (&at, COARSE / 2), (all(&places).step_by(stride), Normals::Both), &divide);
        }
    }
}

#[test]
#[ignore = "a sweep of half a minute and more: .ci/run has it"]
fn cells_of_two_sizes_are_manifold() {
    cells_of_two_sizes_at_a_face(101);
    cells_of_two_sizes_at_an_edge(1009);
}

#[test]
#[ignore = "a quarter of an hour"]
fn every_pair_of_cells_of_two_sizes_is_manifold() {
    cells_of_two_sizes_at_a_face(1);
    cells_of_two_sizes_at_an_edge(7);
}
