//! Small trees with a known field.

use super::*;
use crate::build::{TreeOptions, build_in_memory};
use crate::ingest::Facet;
use crate::lattice::{NodeKey, RootCube};
use crate::progress::Silent;
use crate::store::{BrickTree, MemoryTree, Refine};
use std::sync::Mutex;

/// The box from (1, 1, 1) to (3, 3, 3) in a root from 0 to 4, with outward faces.
fn tree(depth: u8, refine: Refine) -> MemoryTree {
    let p = |c: usize| -> [f64; 3] { std::array::from_fn(|a| if c >> a & 1 == 1 { 3.0 } else { 1.0 }) };
    let quads = [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];
    let split = |q: &[usize; 4]| [[p(q[0]), p(q[1]), p(q[2])], [p(q[0]), p(q[2]), p(q[3])]];
    let soup: Vec<Facet> = quads.iter().flat_map(split).collect();
    let root = RootCube { origin: [0.0; 3], edge: 4.0 };
    build_in_memory(&[&soup], root, TreeOptions { depth, refine, stddev: 0.0 }).unwrap()
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
    let tree = tree(1, Refine::Hidden);
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
    assert_eq!(winding_range(&tree), (0, 1));
}

#[test]
fn leaves_above_the_level_are_filled_as_documented() {
    let full = tree(2, Refine::Hidden);
    // The first child of the root becomes a leaf.
    let cut = NodeKey::new(1, [0; 3]).unwrap();
    let mut coarse = MemoryTree::new(full.root());
    for key in full.keys().into_iter().filter(|key| *key == cut || key.ancestor(1) != Some(cut)) {
        let leaf = full.node(key).unwrap().leaf || key == cut;
        coarse.insert(key, leaf, (*full.brick(key).unwrap()).clone());
    }
    let grid = Dense::new(&coarse, 2, Element::I16).unwrap();
    let (integers, floats) = (dense(&coarse, 2, Element::I16), dense(&coarse, 2, Element::F32));
    let sampled = sample_at(&coarse, &grid_points(&grid)).unwrap();
    let brick = coarse.brick(cut).unwrap();
    let mut between = 0;
    for (i, &w) in sampled.iter().enumerate() {
        let at = [i % 128, i / 128 % 128, i / 128 / 128];
        let expected =
            if at.iter().all(|&c| c < 64) { f64::from(brick.sample(at.map(|c| c / 2))) } else { w };
        assert_eq!(f64::from(i16::from_le_bytes([integers[2 * i], integers[2 * i + 1]])), expected, "{at:?}");
        assert_eq!(f64::from(f32::from_le_bytes(floats[4 * i..][..4].try_into().unwrap())), w, "{at:?}");
        between += usize::from(w.fract() != 0.0);
    }
    assert!(between > 1000);
    assert!(Dense::new(&coarse, 3, Element::I16).is_err());
}

#[test]
fn between_samples_it_is_linear_and_outside_nothing() {
    let tree = tree(1, Refine::Hidden);
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
