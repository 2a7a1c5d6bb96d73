//! Small trees with a known field.

use super::*;
use crate::brick::{
    Brick, Hermite, HermiteEdge, OctNormal, POINTS, Samples, SignChanges, point_index, point_position,
};
use crate::lattice::{Axis, BRICK_POINTS, NodeKey, Octant, RootCube};
use crate::part::PartFile;
use crate::part::outputs::{NAME, cut_everywhere, fail_everywhere};
use crate::progress::Silent;
use crate::store::{BrickTree, MemoryTree};
use std::path::Path;
use std::sync::Mutex;

/// The box from (1, 1, 1) to (3, 3, 3) in a root from 0 to 4, in a tree of full depth.
fn tree(depth: u8) -> MemoryTree {
    let mut tree = MemoryTree::new(RootCube { origin: [0.0; 3], edge: 4.0 });
    let mut level = vec![NodeKey::ROOT];
    for _ in 0..=depth {
        for &key in &level {
            let brick = brick(tree.root(), key);
            tree.insert(key, key.level() == depth, brick);
        }
        level = level.iter().flat_map(|key| Octant::all().map(|octant| key.child(octant))).collect();
    }
    tree
}

fn brick(root: RootCube, key: NodeKey) -> Brick {
    let mut samples = Samples::filled(0);
    for n in 0..POINTS {
        let ijk = point_position(n);
        let unit = |a: usize| f64::from(key.base()[a] + ((ijk[a] as i32) << key.spacing_bits()) + 1);
        let point = root.to_world([0, 1, 2].map(unit));
        samples.0[n] = i16::from(point.iter().all(|c| (1.0..3.0).contains(c)));
    }
    match samples.range() {
        (low, high) if low == high => Brick::Uniform(low),
        _ => Brick::Counts { samples, hermite: Hermite::default() },
    }
}

fn dense(tree: &MemoryTree, level: u8, element: Element) -> Vec<u8> {
    let grid = Dense::new(tree, level, element).unwrap();
    let bytes = Mutex::new(vec![0xffu8; grid.bytes() as usize]);
    grid.write(&Silent, &|offset, part| {
        bytes.lock().unwrap()[offset as usize..][..part.len()].copy_from_slice(part);
        Ok(())
    })
    .unwrap();
    bytes.into_inner().unwrap()
}

/// Every grid point of the level, x fastest.
fn grid_points(grid: &Dense<'_>) -> Vec<[f64; 3]> {
    let (n, origin, step) = (grid.axis(), grid.origin(), grid.spacing());
    let at = |i: usize| [i % n, i / n % n, i / n / n];
    (0..n * n * n).map(|i| std::array::from_fn(|a| origin[a] + at(i)[a] as f64 * step)).collect()
}

#[test]
fn samples_and_grid_agree_and_are_the_box() {
    let tree = tree(1);
    let (bytes, floats) = (dense(&tree, 1, Element::I16), dense(&tree, 1, Element::F32));
    let points = grid_points(&Dense::new(&tree, 1, Element::I16).unwrap());
    let sampled = sample_at(&tree, &points).unwrap();
    let mut inside = 0;
    for (i, point) in points.iter().enumerate() {
        let w = i16::from_le_bytes([bytes[2 * i], bytes[2 * i + 1]]);
        let expected = i16::from(point.iter().all(|c| (1.0..3.0).contains(c)));
        assert_eq!(w, expected, "{point:?}");
        assert_eq!(sampled[i], f64::from(expected), "{point:?}");
        assert_eq!(f32::from_le_bytes(floats[4 * i..][..4].try_into().unwrap()), f32::from(expected));
        inside += usize::from(expected == 1);
    }
    assert_eq!(inside, 32 * 32 * 32);
    assert_eq!(winding_range(&tree), Some((0, 1)));
}

#[test]
fn leaves_above_the_level_are_filled_as_documented() {
    let full = tree(2);
    // The first child of the root becomes a leaf.
    let cut = NodeKey::new(1, [0; 3]).unwrap();
    let mut coarse = MemoryTree::new(full.root());
    for key in full.keys().into_iter().filter(|key| *key == cut || key.ancestor(1) != Some(cut)) {
        let leaf = full.node(key).unwrap().leaf || key == cut;
        coarse.insert(key, leaf, (*full.brick(key).unwrap()).clone());
    }
    let grid = Dense::new(&coarse, 2, Element::I16).unwrap();
    let (integers, floats) = (dense(&coarse, 2, Element::I16), dense(&coarse, 2, Element::F32));
    // Every 13th: a tree in memory looks for the range of a brick at each step down.
    let points: Vec<_> = grid_points(&grid).into_iter().enumerate().step_by(13).collect();
    let sampled = sample_at(&coarse, &points.iter().map(|(_, point)| *point).collect::<Vec<_>>()).unwrap();
    let brick = coarse.brick(cut).unwrap();
    let mut between = 0;
    for ((i, _), w) in points.into_iter().zip(sampled) {
        let at = [i % 128, i / 128 % 128, i / 128 / 128];
        let expected =
            if at.iter().all(|&c| c < 64) { f64::from(brick.sample(at.map(|c| c / 2))) } else { w };
        assert_eq!(f64::from(i16::from_le_bytes([integers[2 * i], integers[2 * i + 1]])), expected, "{at:?}");
        assert_eq!(f64::from(f32::from_le_bytes(floats[4 * i..][..4].try_into().unwrap())), w, "{at:?}");
        between += usize::from(w.fract() != 0.0);
    }
    assert!(between > 100);
    assert!(Dense::new(&coarse, 3, Element::I16).is_err());
}

#[test]
fn between_samples_it_is_linear_and_outside_nothing() {
    let tree = tree(1);
    let step = tree.root().spacing(1);
    let grid = Dense::new(&tree, 1, Element::I16).unwrap();
    // The last sample below x = 1 is 0, the next one is 1.
    let first = ((1.0 - grid.origin()[0]) / step).ceil();
    let x = grid.origin()[0] + (first - 0.75) * step;
    let points = [[x, 2.0, 2.0], [-1.0, 2.0, 2.0], [2.0, 2.0, 1e300], [f64::NAN; 3]];
    let w = sample_at(&tree, &points).unwrap();
    assert!((w[0] - 0.25).abs() < 1e-6, "{w:?}");
    assert_eq!(w[1..], [0.0; 3]);
}

#[test]
fn volumes_are_chords_by_level() {
    for depth in 0..2 {
        let volumes = volume(&tree(depth), &Silent).unwrap();
        assert!((volumes.union - 8.0).abs() <= 8e-5 && volumes.union_error <= 8e-5, "{volumes:?}");
        assert_eq!((volumes.overlap, volumes.negative), (0.0, 0.0));
    }
    // One child is covered three times, one is inside out, and the leaves are of different levels.
    let mut tree = MemoryTree::new(RootCube { origin: [0.0; 3], edge: 4.0 });
    tree.insert(NodeKey::ROOT, false, Brick::Uniform(9));
    for (number, octant) in Octant::all().enumerate() {
        let child = NodeKey::ROOT.child(octant);
        let w = [3, -2, 0, 1][number.min(3)];
        if number < 2 {
            tree.insert(child, false, Brick::Uniform(9));
            Octant::all().for_each(|o| tree.insert(child.child(o), true, Brick::Uniform(w)));
        } else {
            tree.insert(child, true, Brick::Uniform(w));
        }
    }
    let volumes = volume(&tree, &Silent).unwrap();
    assert_eq!(
        volumes,
        Volumes { union: 6.0 * 8.0, overlap: 2.0 * 8.0, negative: 2.0 * 8.0, ..Volumes::default() }
    );
    // One sample of 3 amid none: chords of a quarter and a half of an edge at its sides. Overlap may begin anywhere on the
    // two edges along each axis.
    let mut mixed = Samples::filled(0);
    mixed.0[point_index([5, 6, 7])] = 3;
    mixed.0[point_index([9, 9, 9])] = -2;
    let normal = OctNormal::from_integer([1, 1, 1]);
    let edge = |fraction: f64| HermiteEdge { offset: (fraction * 65536.0) as u16, normal };
    let edges = [[0.75, 0.5], [0.5, 0.5], [0.5, 0.5]].map(|at: [f64; 2]| at.map(edge).to_vec());
    let mut tree = MemoryTree::new(RootCube { origin: [0.0; 3], edge: 32.0 });
    tree.insert(NodeKey::ROOT, true, Brick::Counts { samples: mixed, hermite: Hermite { edges } });
    let volumes = volume(&tree, &Silent).unwrap();
    assert!((volumes.union - (0.75 + 1.0 + 1.0) / 3.0).abs() < 1e-9);
    // The spread, six crossings that may be anywhere, a wall of one sample, and six steps.
    let bound = 0.25 + 6f64.sqrt() + 1.0 + 6.0 / 65536.0;
    assert!((volumes.union_error - bound).abs() < 1e-9, "{volumes:?}");
    assert_eq!((volumes.overlap, volumes.overlap_error), (2.0, 6.0));
    assert_eq!((volumes.negative, volumes.negative_error), (2.0, 6.0));
}

/// A tree of one brick that is inside where every axis is, with edges of 1.
fn tree_of(is_inside: impl Fn([f64; 3]) -> bool, crossing: impl Fn(f64) -> f64) -> MemoryTree {
    let inside = |p: [usize; 3]| is_inside(p.map(|c| c as f64));
    let mut samples = Samples::filled(0);
    for p in (0..BRICK_POINTS.pow(3)).map(point_position) {
        samples.0[point_index(p)] = i16::from(inside(p));
    }
    let signs = SignChanges::of(&samples);
    let edges = Axis::ALL.map(|axis| {
        let mut edges = Vec::new();
        signs.for_edges(axis, |from| {
            let at = from[axis.index()] as f64;
            let offset = ((crossing(at) - at) * 65536.0) as u16;
            let out = if signs.is_inside(from) { 1 } else { -1 };
            let normal = OctNormal::from_integer([0, 1, 2].map(|a| if a == axis.index() { out } else { 0 }));
            edges.push(HermiteEdge { offset, normal });
        });
        edges
    });
    let mut tree = MemoryTree::new(RootCube { origin: [0.0; 3], edge: 32.0 });
    tree.insert(NodeKey::ROOT, true, Brick::Counts { samples, hermite: Hermite { edges } });
    tree
}

#[test]
fn volumes_of_boxes_are_within_their_bounds() {
    for low in [2.01, 2.3, 2.5, 2.77, 2.99] {
        for size in [2.2, 3.0, 3.4, 4.9, 7.5, 20.1] {
            let high = low + size;
            // A face across an axis has all its crossings at one place.
            let crossing = |at: f64| if at < low { low } else { high };
            let tree = tree_of(|p| p.iter().all(|&c| c >= low && c < high), crossing);
            let (volumes, truth) = (volume(&tree, &Silent).unwrap(), size * size * size);
            assert!((volumes.union - truth).abs() <= volumes.union_error + 1e-3, "{low} {size}: {volumes:?}");
            // What is left are edges and corners: a quarter of a cell around each of twelve edges, and some more.
            assert!(size < 4.0 || volumes.union_error < 4.0 * size + 8.0, "{low} {size}: {volumes:?}");
        }
    }
}

#[test]
fn walls_of_one_sample_are_not_believed() {
    // Walls of 0.6 to 1.4 at every second sample, all met by one: 0.6 to 1.4 of what the samples say.
    let tree = tree_of(|p| p.iter().all(|&c| (2.0..30.0).contains(&c)) && p[0] % 2.0 == 0.0, |at| at + 0.5);
    let volumes = volume(&tree, &Silent).unwrap();
    let walls = 14.0 * 28.0 * 28.0;
    assert!((volumes.union - walls).abs() < 0.1 * walls, "{volumes:?}");
    assert!(volumes.union_error > 0.9 * walls, "{volumes:?}");
    // The source, where it is known, knows better still.
    let source = Volumes { union: 4.0 * walls, union_error: 5.0, ..Volumes::default() };
    let bounded = volumes.not_nearer_than(&source);
    assert_eq!(bounded.union_error, 4.0 * walls - volumes.union + 5.0);
    assert_eq!(bounded.not_nearer_than(&Volumes { union: volumes.union, ..source }), bounded);
}

#[test]
fn of_a_part_of_a_tree_the_leaves_that_are_there_answer() {
    let whole = tree(1);
    let mut part = MemoryTree::new(whole.root());
    let low = NodeKey::new(1, [0, 0, 0]).unwrap();
    part.insert(low, true, (*whole.brick(low).unwrap()).clone());
    // In its last cell the brick needs samples of its apron only.
    let there = [[0.9, 1.5, 1.99], [1.2, 0.1, 0.4], [1.999, 1.999, 1.999], [-1.0, 0.0, 0.0]];
    assert_eq!(sample_at(&part, &there).unwrap(), sample_at(&whole, &there).unwrap());
    let error = sample_at(&part, &[[1.0; 3], [2.5, 1.0, 1.0]]).unwrap_err().to_string();
    assert!(error.contains("no leaf yet at the point 2.5, 1, 1") && error.contains("goes on"), "{error}");
}

#[test]
fn every_call_of_an_array_may_fail_and_the_power_go() {
    let tree = tree(0);
    let grid = Dense::new(&tree, 0, Element::I16).unwrap();
    let write = |disk| {
        let mut part = PartFile::create_on(disk, Path::new(NAME))?;
        part.write_at(b"a header", 0)?;
        grid.write(&Silent, &|offset, bytes| part.write_at(bytes, 8 + offset))?;
        part.finish()
    };
    assert!(fail_everywhere(&write) >= 100);
    assert!(cut_everywhere(&write, 10) > 500);
}
