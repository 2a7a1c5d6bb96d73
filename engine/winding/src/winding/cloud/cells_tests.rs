//! Samples of bricks against the sum over all dipoles.

use super::super::open::{Shares, least_bits};
use super::cells::CloudCells;
use super::near::NearPoints;
use super::*;
use crate::brick::{Brick, POINTS, SignChanges};
use crate::lattice::{Axis, BRICK_POINTS, NodeKey, ROOT_BITS, Units};
use crate::progress::Silent;
use crate::soup::PointCloud;
use brickfield_bench_data::Rng;
use brickfield_bench_data::inputs::torus_points;
use brickfield_core::sweep::part_or_all;
use std::collections::HashMap;
use std::time::Instant;

/// Points scattered over a torus with radii of 10 and 4, and its normals.
fn torus(count: usize, seed: u64) -> PointCloud {
    let (points, normals) = torus_points(seed).take(count).unzip();
    PointCloud::of(points, normals)
}

fn field_of(cloud: &PointCloud) -> CloudField {
    let surfels = Surfels::of(cloud.clone(), &Silent).unwrap();
    let (min, max) = surfels.bounds();
    CloudField::new(&surfels, RootCube::around(min, max).unwrap()).unwrap()
}

fn position(key: NodeKey, index: usize) -> Units {
    let ijk =
        [index % BRICK_POINTS, index / BRICK_POINTS % BRICK_POINTS, index / BRICK_POINTS / BRICK_POINTS];
    std::array::from_fn(|a| key.base()[a] + ((ijk[a] as i32) << key.spacing_bits()) + 1)
}

fn keys(level: u8) -> impl Iterator<Item = NodeKey> {
    (0..1u64 << (3 * level)).map(move |n| NodeKey::from_code(1 << (3 * level) | n).unwrap())
}

/// Each cluster is a half of one other, which ends where the next half begins, and all that are asked for by many cells come first.
#[test]
fn clusters_are_halves_and_large_ones_come_first() {
    for count in [2, 8, 9, 60, 64, 65, 129, 1000, 4321] {
        let tree = field_of(&torus(count, 7)).tree;
        let clusters = tree.clusters();
        let sizes: Vec<usize> = clusters.iter().map(|cluster| cluster.elements().len()).collect();
        let large = sizes.iter().take_while(|&&size| size > 64).count();
        assert!(sizes[large..].iter().all(|&size| size <= 64), "{count}");
        assert_eq!(clusters[0].elements(), 0..tree.elements().len() as u32);
        let mut is_half = vec![0; clusters.len()];
        for cluster in clusters {
            let Some(halves) = cluster.halves() else { continue };
            halves.iter().for_each(|&half| is_half[half as usize] += 1);
            let [first, second] = halves.map(|half| clusters[half as usize].elements());
            assert_eq!((first.start, second.end), (cluster.elements().start, cluster.elements().end));
            assert_eq!(first.end, second.start);
        }
        assert!(is_half[0] == 0 && is_half[1..].iter().all(|&times| times == 1), "{count}");
    }
}

struct Filled {
    near: NearPoints,
    values: Box<[f64; POINTS]>,
}

impl Filled {
    fn new() -> Filled {
        Filled { near: NearPoints::default(), values: Box::new([0.0; POINTS]) }
    }

    fn of(&mut self, cells: &CloudCells, field: &CloudField, key: NodeKey) -> &[f64; POINTS] {
        self.values.fill(f64::NAN);
        cells.fill(&field.tree, key, &mut self.near, &mut self.values);
        &self.values
    }
}

/// Dense and sparse samples, coarse and fine bricks, clouds of one and of several densities, and few points.
#[test]
fn samples_are_within_the_bound_of_the_whole_sum() {
    let mut uneven = torus(3000, 2);
    let dense = torus(3000, 3);
    let shrunk = dense.points.iter().map(|p| p.map(|c| 0.1 * c + 3.0));
    shrunk.zip(&dense.normals).for_each(|(p, n)| uneven.push(p, Some(*n)).unwrap());
    uneven.push([30.0, 20.0, 10.0], Some([0.0, 0.6, 0.8])).unwrap();
    let mut rng = Rng::new(7);
    for (cloud, depth) in [(torus(3000, 1), 2), (torus(3000, 1), 0), (uneven, 3), (torus(60, 4), 3)] {
        let field = field_of(&cloud);
        for error in [0.2, 0.05, 0.005] {
            let cells = CloudCells::new(&field.tree, error, depth).unwrap();
            let mut filled = Filled::new();
            let mut worst = 0.0f64;
            for level in 0..=depth {
                let some = 1 + rng.below(1 << (3 * level));
                for key in keys(level).step_by(some as usize).take(4) {
                    let values = filled.of(&cells, &field, key);
                    for _ in 0..part_or_all(40, 150) {
                        let index = rng.below(POINTS as u32) as usize;
                        let exact = field.tree.exact_at(position(key, index));
                        worst = worst.max((values[index] - exact).abs());
                    }
                }
            }
            println!("{} points, depth {depth}, asked for {error}: {worst:.1e}", cloud.points.len());
            assert!(worst <= error, "{worst} {error}");
        }
    }
}

/// A sample has one value, whatever brick holds it, in whatever order bricks are asked for.
#[test]
fn bricks_agree_on_samples_to_the_last_bit() {
    let field = field_of(&torus(4000, 5));
    let error = 0.02;
    let cells = CloudCells::new(&field.tree, error, 2).unwrap();
    let mut known = HashMap::new();
    let mut filled = Filled::new();
    for level in [2, 0, 1] {
        for key in keys(level) {
            let fresh = CloudCells::new(&field.tree, error, 2).unwrap();
            let cells = if level == 1 { &fresh } else { &cells };
            let values = filled.of(cells, &field, key);
            // Every third, so that the aprons of most bricks are met.
            for index in (0..POINTS).filter(|index| index % 3 == 0 || index % BRICK_POINTS == 32) {
                let value = values[index].to_bits();
                assert!(*known.entry(position(key, index)).or_insert(value) == value);
            }
        }
    }
}

/// Between samples that are as far apart as points, and farther, crossings are where the whole sum passes 0.5, with its
/// gradient. Bricks that share an edge agree.
#[test]
fn crossings_are_those_of_the_whole_sum() {
    for (count, depth, error, most) in [(3000, 1, 0.05, 0.01), (3000, 2, 0.002, 0.01), (20_000, 1, 0.2, 0.05)]
    {
        let surfels = Surfels::of(torus(count, 6), &Silent).unwrap();
        let (min, max) = surfels.bounds();
        let root = RootCube::around(min, max).unwrap();
        let field = CloudField::new(&surfels, root).unwrap();
        let bricks = CloudBricks::new(surfels, root, error, depth).unwrap();
        let sum = |p: Units| field.tree.exact_at(p);
        let (mut known, mut all, mut worst, mut tilted) = (HashMap::new(), 0, 0.0f64, 0.0f64);
        let mut scratch = CloudEvaluator::default();
        for key in keys(depth) {
            let leaf = bricks.evaluate(&mut scratch, key, std::iter::empty()).unwrap().into_leaf();
            let Brick::Counts { samples, hermite } = &leaf else { continue };
            let signs = SignChanges::of(samples);
            assert_eq!(signs.counts(), [0, 1, 2].map(|axis| hermite.edges[axis].len()));
            for axis in Axis::ALL {
                signs.for_crossings(axis, hermite, |low, edge| {
                    let from = position(key, (low[2] * BRICK_POINTS + low[1]) * BRICK_POINTS + low[0]);
                    assert_eq!(*known.entry((axis.index(), from)).or_insert(edge), edge);
                    all += 1;
                    if all % part_or_all(307, 101) != 0 {
                        return;
                    }
                    let mut at = from;
                    at[axis.index()] += (edge.fraction() * f64::from(1u32 << key.spacing_bits())) as i32;
                    worst = worst.max((sum(at) - 0.5).abs());
                    let step = 1 << (key.spacing_bits() - 6);
                    let slope = [0, 1, 2].map(|a| {
                        let beside =
                            |by: i32| sum(std::array::from_fn(|b| at[b] + if a == b { by } else { 0 }));
                        beside(-step) - beside(step)
                    });
                    let length = slope.iter().map(|c| c * c).sum::<f64>().sqrt();
                    let along = (0..3).map(|a| slope[a] * edge.normal.to_vector()[a]).sum::<f64>();
                    tilted = tilted.max(1.0 - along / length);
                });
            }
        }
        println!("{count} points, depth {depth}, {error}: {worst:.1e} and {tilted:.1e} of {all}");
        assert!(all > 2000 && worst < most && tilted < 0.01, "{worst} {tilted} of {all}");
    }
}

/// Time a brick: run with `cargo test --release -p brickfield-winding --lib time_of_bricks -- --ignored --nocapture`.
#[test]
#[ignore = "figures"]
fn time_of_bricks() {
    let (count, depth) = (100_000, 4);
    let start = Instant::now();
    let surfels = Surfels::of(torus(count, 5), &Silent).unwrap();
    println!("areas: {:.2} s", start.elapsed().as_secs_f64());
    let (min, max) = surfels.bounds();
    let root = RootCube::around(min, max).unwrap();
    let start = Instant::now();
    let field = CloudField::new(&surfels, root).unwrap();
    println!("clusters: {:.2} s", start.elapsed().as_secs_f64());
    let size = 1 << (ROOT_BITS - u32::from(depth));
    let is_touched = |key: &NodeKey| {
        let low = key.base().map(f64::from);
        field
            .tree
            .elements()
            .iter()
            .any(|d| (0..3).all(|a| (0.0..f64::from(size)).contains(&(f64::from(d.at()[a]) - low[a]))))
    };
    let touched: Vec<NodeKey> = keys(depth).step_by(29).filter(is_touched).collect();
    for error in [0.05, 0.2, 0.01] {
        let cells = CloudCells::new(&field.tree, error, depth).unwrap();
        let mut filled = Filled::new();
        let start = Instant::now();
        touched.iter().for_each(|key| assert!(filled.of(&cells, &field, *key)[0].is_finite()));
        let ms = start.elapsed().as_secs_f64() * 1e3 / touched.len() as f64;
        println!("error {error}: {ms:.2} ms for each of {} bricks", touched.len());
        let mut shares = Shares::default();
        let start = Instant::now();
        let some = &touched[..touched.len().min(10)];
        some.iter().for_each(|key| shares.find(&field.tree, (error, 10, least_bits(depth)), *key));
        let ms = start.elapsed().as_secs_f64() * 1e3 / some.len() as f64;
        println!("  by the cells of open soups: {ms:.2} ms");
    }
}
