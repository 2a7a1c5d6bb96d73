//! Local thickness against formulas.

use super::tests::{MIDDLE, SignedDistance, ball, boxed, length, surface, torus, tree, turned};
use super::*;
use crate::lattice::{BRICK_CELLS, minus};
use crate::progress::Silent;
use crate::store::BrickTree;
use std::path::Path;

/// Errors of local thickness at samples in cells, sorted, without what `truth` does not tell.
fn errors(shape: SignedDistance<'_>, of: LocalOf, truth: impl Fn([f64; 3]) -> Option<f64>) -> Vec<f64> {
    let tree = tree(shape);
    let surface = surface(&tree);
    let held = (1 << 26, Path::new("."));
    let local = LocalThickness::new((&tree, &surface), of, tree.deepest_level(), held, &Silent).unwrap();
    let mut errors = Vec::new();
    for key in local.keys() {
        if !local.node(key).unwrap().leaf {
            continue;
        }
        let brick = local.brick(key).unwrap();
        for n in 0..BRICK_CELLS.pow(3) {
            let ijk = [n % BRICK_CELLS, n / BRICK_CELLS % BRICK_CELLS, n / BRICK_CELLS / BRICK_CELLS];
            let at = surface.to_world(std::array::from_fn(|a| {
                (key.position()[a] as usize * BRICK_CELLS + ijk[a]) as f64
            }));
            let value = brick.value(ijk);
            let is_in = (shape(at) < 0.0) == (of == LocalOf::Walls);
            assert!(is_in || value == 0.0, "{at:?}: {value}");
            if let Some(truth) = truth(at).filter(|_| is_in) {
                errors.push(value - truth);
            }
        }
    }
    errors.sort_by(f64::total_cmp);
    errors
}

/// Of a box with these half widths: a ball of radius r may lie anywhere in the box that is smaller by r on all sides.
fn of_box(half: [f64; 3], at: [f64; 3]) -> f64 {
    let q = turned(minus(at, MIDDLE));
    let reaches = |r: f64| (0..3).map(|a| (q[a].abs() - half[a] + r).max(0.0).powi(2)).sum::<f64>() <= r * r;
    let (mut low, mut high) = (0.0, half.iter().copied().fold(f64::INFINITY, f64::min));
    if reaches(high) {
        return 2.0 * high;
    }
    for _ in 0..50 {
        let middle = 0.5 * (low + high);
        if reaches(middle) { low = middle } else { high = middle }
    }
    2.0 * low
}

#[test]
fn balls_tori_plates_and_cubes_have_the_thickness_of_formulas() {
    let shell = |p: [f64; 3]| (length(minus(p, MIDDLE)) - 17.0).abs() - 2.5;
    let (cube, plate) = ([6.8; 3], [12.0, 10.0, 2.2]);
    type Truth<'a> = &'a dyn Fn([f64; 3]) -> Option<f64>;
    // Errors of 1 of 100, of the mean, and of the largest that is too large.
    let shapes: [(&str, SignedDistance<'_>, Truth<'_>, [f64; 3]); 6] = [
        ("ball 8", &ball(8.0), &|_| Some(16.0), [0.01, 0.007, 0.002]),
        ("torus 9 4", &torus(9.0, 4.0), &|_| Some(8.0), [0.012, 0.007, 0.006]),
        ("torus 12 2", &torus(12.0, 2.0), &|_| Some(4.0), [0.012, 0.007, 0.006]),
        ("shell", &shell, &|_| Some(5.0), [0.01, 0.007, 0.002]),
        ("plate", &boxed(plate), &|p| Some(of_box(plate, p)), [0.25, 0.01, 0.06]),
        ("cube", &boxed(cube), &|p| Some(of_box(cube, p)), [0.4, 0.05, 0.2]),
    ];
    for (name, shape, truth, [one_of_100, mean, over]) in shapes {
        let errors = errors(shape, LocalOf::Walls, truth);
        let at = |share: f64| errors[((errors.len() - 1) as f64 * share) as usize];
        let found = errors.iter().sum::<f64>() / errors.len() as f64;
        println!(
            "{name}: {} samples, {:.4} {:.4} {:.4} {:.4} {:.4}, mean {found:.5}",
            errors.len(),
            at(0.0),
            at(0.01),
            at(0.5),
            at(0.99),
            at(1.0)
        );
        assert!(at(0.01) > -one_of_100 && found.abs() <= mean && at(1.0) <= over && at(0.0) > -2.0, "{name}");
    }
}

/// Between two plates that are 5.2 apart the gap is that wide, and what is outside of both is wider than told.
#[test]
fn gaps_are_as_wide_as_plates_are_apart() {
    let across = |p: [f64; 3]| turned(minus(p, MIDDLE));
    let plates = |p: [f64; 3]| {
        let q = across(p);
        let d = [q[0].abs() - 15.0, q[1].abs() - 15.0, (q[2].abs() - 4.6).abs() - 2.0];
        let outside = length(d.map(|c| c.max(0.0)));
        outside + d[0].max(d[1]).max(d[2]).min(0.0)
    };
    let truth = |p| {
        let q = across(p);
        let is_between = q[2].abs() < 2.6 && q[0].abs() < 11.0 && q[1].abs() < 11.0;
        let is_beyond = q[2].abs() > 12.7;
        if is_between { Some(5.2) } else { is_beyond.then_some(0.0) }
    };
    let errors = errors(&plates, LocalOf::Gaps(9.0), truth);
    assert!(errors.len() > 10_000, "{}", errors.len());
    assert!(errors.iter().all(|error| error.abs() < 0.01), "{:?} {:?}", errors[0], errors.last());
}

/// What is held in a file, and in which order bricks are asked for, changes nothing; and coarser samples are samples of finer ones.
#[test]
fn memory_order_and_levels_change_no_number() {
    let shape = boxed([9.0, 4.0, 3.0]);
    let tree = tree(&shape);
    let surface = surface(&tree);
    let at = |level: u8, memory: u64| {
        let held = (memory, Path::new("."));
        LocalThickness::new((&tree, &surface), LocalOf::Walls, level, held, &Silent).unwrap()
    };
    let (first, second, coarse) = (at(1, 1 << 26), at(1, 60_000), at(0, 1 << 26));
    let keys: Vec<_> = first.keys().into_iter().filter(|key| key.level() == 1).collect();
    for &key in keys.iter().rev() {
        drop(second.brick(key).unwrap());
    }
    for key in keys {
        let fine = first.brick(key).unwrap();
        assert_eq!(fine, second.brick(key).unwrap());
        // Both walls of bricks, and the lattice of every other sample.
        let whole = coarse.brick(crate::lattice::NodeKey::ROOT).unwrap();
        for n in 0..17usize.pow(3) {
            let ijk = [n % 17, n / 17 % 17, n / 289];
            let there = std::array::from_fn(|a| key.position()[a] as usize * 16 + ijk[a]);
            let (a, b) = (fine.value(ijk.map(|c| 2 * c)), 2.0 * whole.value(there));
            assert!((a - b).abs() < 0.002, "{key:?} {ijk:?}: {a} {b}");
        }
    }
    let spread = first.spread().unwrap();
    assert_eq!(spread, second.spread().unwrap());
    assert_eq!(spread.histogram.iter().sum::<u64>(), spread.samples);
    let coarse = coarse.spread().unwrap();
    assert!(
        (coarse.mean - spread.mean).abs() <= coarse.mean_error + spread.mean_error,
        "{coarse:?} {spread:?}"
    );
    assert!((spread.max - 6.0).abs() < 0.02, "{spread:?}");
}
