//! Cells annexed by others, and vertices that follow creases.

use super::meetings::apart;
use super::*;
use crate::contour::face_vertices::{face_key, plain_edge_key};
use crate::contour::frame::SampleCoordinates;
use crate::contour::local_index::{Direction, neighbour};
use crate::contour::stages;
use crate::contour::vertices::LeafVertices;
use crate::lattice::BRICK_CELLS;
use proptest::prelude::*;
use std::collections::HashMap;

type Place = [i32; 3];

fn following() -> ContourOptions {
    ContourOptions { follow_creases: true, ..ContourOptions::default() }
}

/// A cell with a sign change: its leaf, where it is in it, what it has annexed, and its vertex if it has but one.
struct Cell {
    leaf: u32,
    at: [usize; 3],
    annexed: Option<Direction>,
    vertex: Option<[f32; 3]>,
}

/// All leaves of a tree of one level, and their active cells counted from the root's first one.
struct Cells {
    leaves: Vec<(NodeKey, LeafVertices)>,
    cells: HashMap<Place, Cell>,
    /// World coordinates of planes of samples by axis.
    planes: [HashMap<i32, f32>; 3],
}

impl Cells {
    fn of(tree: &MemoryTree) -> Cells {
        let options = following();
        let field = stages::field(tree, level(options.iso).unwrap(), &options).unwrap();
        let mut all = Cells { leaves: Vec::new(), cells: HashMap::new(), planes: Default::default() };
        for leaf in 0..field.leaves.len() as u32 {
            let key = field.leaves.get(leaf).key;
            let first = key.first_sample().map(|c| c as i32);
            let lattice: SampleCoordinates = field.frame(key).lattice();
            for (a, planes) in all.planes.iter_mut().enumerate() {
                planes.extend(lattice[a].iter().enumerate().map(|(n, at)| (first[a] + n as i32, *at)));
            }
            let vertices = field.vertices(leaf).unwrap();
            let cells = &vertices.cells;
            for n in 0..BRICK_CELLS.pow(3) {
                let at = [n % BRICK_CELLS, n / BRICK_CELLS % BRICK_CELLS, n / BRICK_CELLS / BRICK_CELLS];
                let Some((kind, first_vertex)) = cells.plain(at) else { continue };
                let is_lone = kind.loops().count == 1;
                let vertex = is_lone.then(|| cells.positions[first_vertex]);
                let place = std::array::from_fn(|a| first[a] + at[a] as i32);
                all.cells.insert(place, Cell { leaf, at, annexed: cells.annexed(at), vertex });
            }
            all.leaves.push((key, vertices));
        }
        all
    }

    /// Lower and upper corner of a cell in the world, and of what it has annexed.
    fn region(&self, place: Place) -> [[f32; 3]; 2] {
        let mut corners = [place, place.map(|c| c + 1)];
        if let Some(direction) = self.cells[&place].annexed {
            let other = neighbour(place, direction);
            for a in 0..3 {
                corners[0][a] = corners[0][a].min(other[a]);
                corners[1][a] = corners[1][a].max(other[a] + 1);
            }
        }
        corners.map(|corner| std::array::from_fn(|a| self.planes[a][&corner[a]]))
    }

    /// Holds that regions are boxes without common inner points, with their vertices within, and that mesh edges pass
    /// through what they share, or through vertices on the faces between cells; but for vertices that lie beyond edges
    /// or corners of their cells, at corners. Returns how many cells are annexed, and how many across borders of leaves.
    fn hold(&self) -> [usize; 2] {
        let mut annexed = HashMap::new();
        for (&place, cell) in &self.cells {
            let Some(direction) = cell.annexed else { continue };
            let other = neighbour(place, direction);
            assert!(!self.cells.contains_key(&other), "{other:?} has a sign change");
            assert!(annexed.insert(other, place).is_none(), "{other:?} is annexed twice");
        }
        let mut strays = 0;
        for (&place, cell) in &self.cells {
            let Some(vertex) = cell.vertex else { continue };
            let [low, high] = self.region(place);
            if (0..3).all(|a| low[a] < vertex[a] && vertex[a] < high[a]) {
                Axis::ALL.into_iter().for_each(|axis| self.hold_face(place, axis));
            } else {
                assert!(cell.annexed.is_none(), "{place:?} {vertex:?}");
                strays += 1;
            }
        }
        // A small solid has few cells for each of its corners.
        assert!(strays <= 4 || strays * 200 <= self.cells.len(), "{strays} of {}", self.cells.len());
        let bricks = |place: &Place| place.map(|c| c.div_euclid(BRICK_CELLS as i32));
        let across = annexed.iter().filter(|(other, place)| bricks(other) != bricks(place)).count();
        [annexed.len(), across]
    }

    /// The same of the mesh edges across the lower face of a cell.
    fn hold_face(&self, place: Place, axis: Axis) {
        let (cell, a) = (&self.cells[&place], axis.index());
        let below = neighbour(place, 2 * a as u8);
        let (Some(upper), Some(Cell { vertex: Some(lower), .. })) = (cell.vertex, self.cells.get(&below))
        else {
            return;
        };
        let (key, vertices) = &self.leaves[cell.leaf as usize];
        let (kind, _) = vertices.cells.plain(cell.at).unwrap();
        let [own, other] = [self.region(place), self.region(below)];
        let low: [f32; 3] = std::array::from_fn(|n| own[0][n].max(other[0][n]));
        let high: [f32; 3] = std::array::from_fn(|n| own[1][n].min(other[1][n]));
        let plane = f64::from(self.planes[a][&place[a]]);
        for (enter, _) in kind.loops().face_cuts(axis, 0) {
            let edge = plain_edge_key(enter, axis, *key);
            let at: [f64; 3] = match vertices.number_on_face(face_key(axis, cell.at), edge) {
                Some(number) => {
                    let on_face = vertices.vertex(number).position;
                    for n in (0..3).filter(|&n| n != a) {
                        let [first, last] = [place[n], place[n] + 1].map(|c| self.planes[n][&c]);
                        assert!(first < on_face[n] && on_face[n] < last, "{place:?} {axis:?}: {on_face:?}");
                    }
                    on_face.map(f64::from)
                }
                None => {
                    let [from, to] = [*lower, upper].map(|vertex| vertex.map(f64::from));
                    let share = (plane - from[a]) / (to[a] - from[a]);
                    assert!(0.0 < share && share < 1.0, "{place:?} {axis:?}: {lower:?} {upper:?}");
                    std::array::from_fn(|n| from[n] + share * (to[n] - from[n]))
                }
            };
            for n in (0..3).filter(|&n| n != a) {
                let is_within = f64::from(low[n]) < at[n] && at[n] < f64::from(high[n]);
                assert!(is_within, "{place:?} {axis:?}: {at:?} of {low:?} {high:?}");
            }
        }
    }
}

/// What lies within some planes, each through a point, and a ball.
fn cut_ball(planes: Vec<([f64; 3], [f64; 3])>) -> impl SampledField {
    ImplicitField(move |p: [f64; 3]| {
        let beyond = |(q, n): &([f64; 3], [f64; 3])| {
            let length = n.iter().map(|c| c * c).sum::<f64>().sqrt().max(1e-3);
            (0..3).map(|a| n[a] * (p[a] - q[a])).sum::<f64>() / length
        };
        let ball = p.iter().map(|c| c * c).sum::<f64>().sqrt() - 5.3;
        planes.iter().map(beyond).fold(ball, f64::max)
    })
}

#[test]
fn regions_of_sharp_solids_are_disjoint_boxes_that_hold_their_vertices() {
    let mut found = [0, 0];
    for seed in 0..8u64 {
        let number = |n: u64| (hash(seed << 8 | n) & 0xffff) as f64 / 32768.0 - 1.0;
        let plane = |n: u64| {
            let point = [0, 1, 2].map(|a| 1.5 * number(8 * n + a));
            (point, [3, 4, 5].map(|a| number(8 * n + a)))
        };
        let solid = |first: u64| cut_ball((first..first + 2 + seed % 3).map(plane).collect());
        let tree = tree(&Overlap(solid(0), solid(5)), &uniform((1 + seed % 2) as u8));
        let more = Cells::of(&tree).hold();
        (0..2).for_each(|n| found[n] += more[n]);
        apart(&tree, &following());
    }
    assert!(found[0] > 400 && found[1] > 8, "{found:?}");
}

#[test]
fn regions_of_noise_are_disjoint_boxes_that_hold_their_vertices() {
    for seed in 0..4 {
        Cells::of(&tree(&noise(seed, 1, 5, 40 + 30 * seed, 3.9), &uniform(1))).hold();
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(part_or_all(6, 24)))]

    /// Wedges of any angle anywhere: nothing meets, whatever is annexed and merged, and on trees of several levels all is
    /// closed.
    #[test]
    fn wedges_meet_nowhere(
        planes in prop::collection::vec(
            (prop::array::uniform3(-1.0f64..1.0), prop::array::uniform3(-1.0f64..1.0)), 2..6),
        seed in 0u64..1 << 32,
    ) {
        let solid = cut_ball(planes);
        let tree_of_one = tree(&solid, &uniform(1));
        if mesh(&tree_of_one, &following()).0.facets.is_empty() {
            return Ok(());
        }
        Cells::of(&tree_of_one).hold();
        apart(&tree_of_one, &following());
        let merging = ContourOptions { tolerance: 0.2 * root().spacing(1), ..following() };
        apart(&tree_of_one, &merging);
        let tree_of_several = tree(&solid, &random_divide(seed, (0, 3), 128));
        for options in [following(), merging] {
            mesh(&tree_of_several, &options).0.check();
        }
    }
}
