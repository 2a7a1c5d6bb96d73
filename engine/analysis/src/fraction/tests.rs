//! Fractions against formulas.

use super::*;
use crate::brick::{Brick, Hermite, HermiteEdge, OctNormal, POINTS, Samples, SignChanges, point_position};
use crate::contour::ContourOptions;
use crate::lattice::{Axis, NodeKey, Octant, RootCube};
use crate::progress::Silent;
use crate::store::MemoryTree;

const CENTRE: [f64; 3] = [2.03, 1.96, 2.11];

/// By how much a point lies within a box or a ball of half-width 1.2 about the middle.
fn depth_in(shape: u8, point: [f64; 3]) -> f64 {
    let apart: [f64; 3] = std::array::from_fn(|a| point[a] - CENTRE[a]);
    match shape {
        0 => 1.2 - apart.iter().map(|c| c * c).sum::<f64>().sqrt(),
        _ => apart.iter().map(|c| 1.2 - c.abs()).fold(f64::INFINITY, f64::min),
    }
}

/// A tree of full depth in a root from 0 to 4.
fn tree(shape: u8, depth: u8) -> MemoryTree {
    let mut tree = MemoryTree::new(RootCube { origin: [0.0; 3], edge: 4.0 });
    let mut level = vec![NodeKey::ROOT];
    for _ in 0..=depth {
        for &key in &level {
            let brick = brick(shape, tree.root(), key);
            tree.insert(key, key.level() == depth, brick);
        }
        level = level.iter().flat_map(|key| Octant::all().map(|octant| key.child(octant))).collect();
    }
    tree
}

fn brick(shape: u8, root: RootCube, key: NodeKey) -> Brick {
    let point = |ijk: [usize; 3]| {
        root.to_world(std::array::from_fn(|a| {
            f64::from(key.base()[a] + ((ijk[a] as i32) << key.spacing_bits()) + 1)
        }))
    };
    let mut samples = Samples::filled(0);
    for n in 0..POINTS {
        let ijk = point_position(n);
        samples.0[n] = i16::from(depth_in(shape, point(ijk)) > 0.0);
    }
    if samples.range().0 == samples.range().1 {
        return Brick::Uniform(samples.range().0);
    }
    let signs = SignChanges::of(&samples);
    let mut hermite = Hermite::default();
    for axis in Axis::ALL {
        signs.for_edges(axis, |low| {
            let mut high = low;
            high[axis.index()] += 1;
            let (from, to) = (point(low), point(high));
            let at = |t: f64| depth_in(shape, std::array::from_fn(|a| from[a] + t * (to[a] - from[a]))) > 0.0;
            let (mut below, mut above) = (0.0, 1.0);
            for _ in 0..30 {
                let middle = 0.5 * (below + above);
                if at(middle) == at(0.0) { below = middle } else { above = middle }
            }
            let apart = std::array::from_fn(|a| (from[a] + below * (to[a] - from[a]) - CENTRE[a]) * 65536.0);
            let out = if at(0.0) { 1 } else { -1 };
            let normal = match shape {
                0 => apart.map(|c: f64| c as i64),
                _ => std::array::from_fn(|a| if a == axis.index() { out } else { 0 }),
            };
            let normal = OctNormal::from_integer(normal);
            let edge = HermiteEdge { offset: (below * 65536.0) as u16, normal };
            hermite.edges[axis.index()].push(edge);
        });
    }
    Brick::Counts { samples, hermite }
}

#[test]
fn fractions_add_up_to_the_volume_for_any_cells() {
    for (shape, expected) in [(0, 4.0 / 3.0 * std::f64::consts::PI * 1.2f64.powi(3)), (1, 2.4f64.powi(3))] {
        let tree = tree(shape, 2);
        let chords = crate::analysis::volume(&tree, &Silent).unwrap().union;
        for lattice in fractions(&tree, &[1, 2, 3, 5, 8, 13], u64::MAX, &Silent).unwrap() {
            let volume = lattice.volume();
            // Where faces meet, a sample may get more than it can hold.
            assert!((volume / chords - 1.0).abs() < 1e-5, "{} {volume} {chords}", lattice.factor());
            assert!((volume / expected - 1.0).abs() < 0.01, "{volume} {expected}");
        }
    }
}

#[test]
fn surfaces_keep_the_volume_and_faces_of_a_box_stay_where_they_are() {
    let tree = tree(1, 2);
    let options = ContourOptions::default();
    for lattice in fractions(&tree, &[2, 5, 9], u64::MAX, &Silent).unwrap() {
        let kept = keep_volume(&lattice, lattice.volume(), None, &options, &Silent).unwrap();
        assert!(kept.is_near && (kept.summary.volume / lattice.volume() - 1.0).abs() < 2e-4);
        // Edges and corners are sharp, so nothing moves.
        assert_eq!(kept.depth, 0.0, "{kept:?}");
        let half = surface(&lattice, 0.5, &options, &Silent).unwrap().summary;
        let [low, high] = half.bounds.unwrap();
        for a in 0..3 {
            let within = 1e-4 * lattice.cell();
            assert!((f64::from(low[a]) - CENTRE[a] + 1.2).abs() < within, "{low:?}");
            assert!((f64::from(high[a]) - CENTRE[a] - 1.2).abs() < within, "{high:?}");
        }
    }
}

#[test]
fn details_are_whole_numbers_of_cells() {
    let tree = tree(0, 1);
    let fine = 4.0 / 64.0;
    assert_eq!(factor_of(&tree, 0.99 * fine), None);
    assert_eq!(
        [1.0, 1.5, 2.0, 7.999_999_999_999].map(|n| factor_of(&tree, n * fine)),
        [1, 1, 2, 8].map(Some)
    );
    assert_eq!(finest_cell(&tree), fine);
}

#[test]
fn memory_that_does_not_suffice_is_said() {
    let error = fractions(&tree(0, 2), &[1], 1000, &Silent).map(|_| ()).unwrap_err().to_string();
    assert!(error.contains("do not fit the memory"), "{error}");
}

/// Sums by place, without what is nothing but rounding.
fn by_place(block: &leaf::SumBox) -> std::collections::BTreeMap<[i64; 3], f64> {
    let [nx, ny, _] = block.size;
    let place = |n: usize| [n % nx, n / nx % ny, n / nx / ny];
    let sums = block.sums.iter().enumerate().filter(|(_, sum)| sum.abs() > 1e-13);
    sums.map(|(n, sum)| (std::array::from_fn(|a| block.first[a] + place(n)[a] as i64), *sum)).collect()
}

#[test]
fn wide_tents_are_sums_of_narrow_ones() {
    let tree = tree(0, 2);
    let factors = [12, 20, 4, 36];
    let mut seen = 0;
    for key in tree.keys().into_iter().filter(|key| key.level() == 2) {
        let brick = tree.brick(key).unwrap();
        let together = leaf::blocks(key, &brick, 2, (4, &factors));
        for (&factor, block) in factors.iter().zip(together) {
            let alone = leaf::blocks(key, &brick, 2, (1, &[factor])).pop().flatten();
            let [together, alone] =
                [block, alone].map(|block| block.as_ref().map(by_place).unwrap_or_default());
            assert!(together.keys().eq(alone.keys()), "{key} {factor}");
            assert!(
                together.values().zip(alone.values()).all(|(a, b)| (a - b).abs() < 1e-12),
                "{key} {factor}"
            );
            seen += usize::from(!together.is_empty());
        }
    }
    assert!(seen > 100);
}

#[test]
fn samples_in_a_cell_add_up_to_the_mean_over_it() {
    // Wide tents of a fine lattice have the values of the coarse one where both have a sample: to what storing rounds.
    let tree = tree(0, 2);
    for (factor, samples) in [(2, 2), (8, 2), (10, 5)] {
        let coarse = fractions(&tree, &[factor], u64::MAX, &Silent).unwrap().pop().unwrap();
        let fine = fine_fractions(&tree, (factor, samples), u64::MAX, &Silent).unwrap();
        assert_eq!((fine.factor(), fine.samples_per_cell()), (factor, samples));
        assert!((fine.cell() / coarse.cell() - 1.0).abs() < 1e-12);
        assert!((fine.volume() / coarse.volume() - 1.0).abs() < 1e-5);
        let sides = [&coarse, &fine].map(|lattice| {
            let summary = surface(lattice, 0.5, &ContourOptions::default(), &Silent).unwrap().summary;
            (summary.volume, summary.triangles as f64)
        });
        let [(of_coarse, few), (of_fine, many)] = sides;
        // A ball of 1.2: a surface with more samples has more triangles by their square, and curves more truly.
        let square = f64::from(samples * samples);
        assert!((many / few / square - 1.0).abs() < 0.15, "{factor} {samples}: {few} {many}");
        assert!((of_fine / of_coarse - 1.0).abs() < 0.02, "{factor} {samples}: {of_coarse} {of_fine}");
        let kept = keep_volume(&fine, fine.volume(), None, &ContourOptions::default(), &Silent).unwrap();
        assert!(kept.is_near, "{factor} {samples}: {kept:?}");
    }
    let refused = fine_fractions(&tree, (4, 2), 1000, &Silent).map(|_| ()).unwrap_err();
    assert!(refused.to_string().contains("do not fit the memory"), "{refused}");
}

#[test]
fn every_number_of_triangles_is_met_or_more_would_be_no_nearer() {
    let options = ContourOptions::default();
    for (shape, numbers) in [(0, &[200, 1500, 6000][..]), (1, &[60_000])] {
        let tree = tree(shape, 2);
        for &most in numbers {
            let request =
                DetailRequest { most, of_all: 60_000, volume: None, options: &options, memory: u64::MAX };
            let made = of_triangles(&tree, request, &Silent).unwrap();
            let triangles = made.kept.summary.triangles;
            assert!(triangles <= most, "{shape} {most}: {triangles}");
            let is_enough = triangles * 10 >= most * 9;
            // A box needs twelve.
            assert!(is_enough || shape == 1 && made.is_flat(), "{shape} {most}: {triangles}");
            assert!(shape == 0 || made.factor() == 1, "{most}: {}", made.factor());
        }
    }
}

#[test]
fn a_box_is_exact_whatever_number_is_asked_for() {
    let (tree, options) = (tree(1, 2), ContourOptions::default());
    // As of a small store, and as of one that is not contoured before it is known to be worth it.
    for (of_all, most) in
        [60_000, 400_000].into_iter().flat_map(|all| [12, 13, 24, 50, 300].map(|n| (all, n)))
    {
        let request = DetailRequest { most, of_all, volume: None, options: &options, memory: u64::MAX };
        let made = of_triangles(&tree, request, &Silent).unwrap();
        let summary = made.kept.summary;
        assert!(summary.triangles <= most, "{of_all} {most}: {summary:?}");
        assert!((summary.volume / 2.4f64.powi(3) - 1.0).abs() < 1e-4, "{of_all} {most}: {summary:?}");
        // Of the large one a lattice with few triangles may do.
        assert!(of_all > 60_000 || made.is_own() && made.is_flat(), "{of_all} {most}: {}", made.tolerance);
    }
    let request =
        DetailRequest { most: 11, of_all: 60_000, volume: None, options: &options, memory: u64::MAX };
    let error = of_triangles(&tree, request, &Silent).map(|_| ()).unwrap_err().to_string();
    assert!(error.contains("the fewest that were found are 12"), "{error}");
}
