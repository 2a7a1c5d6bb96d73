//! Which nodes are kept: every criterion, recomputed.

use crate::oracle::Oracle;
use crate::piles::{Place, Step, on_lattice};
use crate::scene::{Scene, compare_brick, nodes, position};
use brickfield_bench_data::pile::random_pile;
use brickfield_bench_data::shapes;
use brickfield_core::sweep::part_or_all;
use brickfield_engine::brick::Brick;
use brickfield_engine::build::TreeOptions;
use brickfield_engine::lattice::{BRICK_CELLS, BRICK_POINTS, MAX_LEVEL, NodeKey, Octant};
use brickfield_engine::store::{BrickTree, MemoryTree, Refine};

/// Standard deviation of a function of the owned samples, in two passes of floating point.
fn deviation(brick: &Brick, value: impl Fn(i16) -> f64) -> f64 {
    let mut values = Vec::with_capacity(BRICK_CELLS.pow(3));
    for k in 0..BRICK_CELLS {
        for j in 0..BRICK_CELLS {
            values.extend((0..BRICK_CELLS).map(|i| value(brick.sample([i, j, k]))));
        }
    }
    let count = values.len() as f64;
    let mean = values.iter().sum::<f64>() / count;
    (values.iter().map(|v| (v - mean) * (v - mean)).sum::<f64>() / count).sqrt()
}

/// Every node is a leaf or has all eight children; no node is without its parent.
pub fn assert_complete(tree: &MemoryTree, depth: u8) {
    let mut deepest = 0;
    assert!(tree.node(NodeKey::ROOT).is_some());
    for key in tree.keys() {
        let node = tree.node(key).expect("listed");
        deepest = deepest.max(key.level());
        if let Some(parent) = key.parent() {
            assert!(!tree.node(parent).expect("a parent").leaf, "{key} is below a leaf");
        }
        let has_child = |o| key.level() < MAX_LEVEL && tree.node(key.child(o)).is_some();
        let children = Octant::all().filter(|&o| has_child(o)).count();
        assert_eq!(children, if node.leaf { 0 } else { 8 }, "{key}");
        let (min, max) = tree.brick(key).expect("in memory").range();
        assert_eq!((node.min, node.max), (min, max));
    }
    assert!(deepest <= depth);
}

/// Whether an edge among the 33³ samples satisfies the predicate on the count at its start and the jumps along
/// it, in order; jumps at one rounded offset come as one sum and the number of crossings.
fn any_edge(
    oracle: &Oracle,
    key: NodeKey,
    brick: &Brick,
    predicate: impl Fn(i64, &[(i64, usize)]) -> bool,
) -> bool {
    for axis in 0..3 {
        let until: [usize; 3] = std::array::from_fn(|a| BRICK_POINTS - usize::from(a == axis));
        for k in 0..until[2] {
            for j in 0..until[1] {
                for i in 0..until[0] {
                    let lower = position(key, [i, j, k]);
                    let mut crossings = oracle.crossings(lower, axis, 1 << key.spacing_bits());
                    crossings.sort_by_key(|c| c.offset);
                    let steps: Vec<(i64, usize)> = crossings
                        .chunk_by(|a, b| a.offset == b.offset)
                        .map(|step| (step.iter().map(|c| c.jump).sum(), step.len()))
                        .collect();
                    if !steps.is_empty() && predicate(brick.sample([i, j, k]).into(), &steps) {
                        return true;
                    }
                }
            }
        }
    }
    false
}

fn crossings_hide(_: i64, steps: &[(i64, usize)]) -> bool {
    let sum: i64 = steps.iter().map(|s| s.0).sum();
    (sum.unsigned_abs() as usize) < steps.iter().map(|s| s.1).sum()
}

fn boundary_hides(start: i64, steps: &[(i64, usize)]) -> bool {
    let mut w = start;
    let passes = steps.iter().filter(|(jump, _)| {
        let before = w;
        w += jump;
        (before >= 1) != (w >= 1)
    });
    passes.count() > 1
}

/// Whether any facet's box meets the brick's cube; if none does, no edge is crossed.
fn may_be_touched(oracle: &Oracle, key: NodeKey) -> bool {
    let (low, high) = (position(key, [0; 3]), position(key, [BRICK_CELLS; 3]));
    oracle
        .facets
        .iter()
        .any(|t| (0..3).all(|a| t.iter().any(|v| v[a] <= high[a]) && t.iter().any(|v| v[a] >= low[a])))
}

/// The criterion as the options describe it.
fn may_keep(oracle: &Oracle, key: NodeKey, brick: &Brick, options: TreeOptions) -> bool {
    let varies_little = |value: fn(i16) -> f64| deviation(brick, value) <= options.stddev + 1e-12;
    match options.refine {
        Refine::Stddev => varies_little(f64::from),
        Refine::Hidden | Refine::Thin { .. } => {
            let uniform = deviation(brick, f64::from) == 0.0;
            if uniform {
                return !may_be_touched(oracle, key) || !any_edge(oracle, key, brick, |_, _| true);
            }
            varies_little(f64::from) && !any_edge(oracle, key, brick, crossings_hide)
        }
        Refine::Surface => {
            varies_little(|w| f64::from(u8::from(w >= 1))) && !any_edge(oracle, key, brick, boundary_hides)
        }
    }
}

fn compare_decisions(scene: &Scene, options: TreeOptions) -> [usize; 2] {
    let oracle = scene.oracle();
    let tree = scene.build(options);
    assert_complete(&tree, options.depth);
    let mut decided = [0; 2];
    for (key, leaf, brick) in nodes(&tree) {
        compare_brick(&oracle, key, &brick);
        if key.level() == options.depth {
            continue;
        }
        if leaf {
            assert!(may_keep(&oracle, key, &brick, options), "{key} should be refined: {options:?}");
        } else if options.refine != Refine::Hidden || deviation(&brick, f64::from) > 0.0 {
            // The default also refines a uniform node for a facet that comes near and crosses no edge.
            assert!(!may_keep(&oracle, key, &brick, options), "{key} should be kept: {options:?}");
        }
        decided[usize::from(leaf && matches!(*brick, Brick::Counts { .. }))] += 1;
    }
    decided
}

fn all_modes(scene: &Scene, depth: u8) -> [usize; 2] {
    let mut all = [0; 2];
    for refine in [Refine::Hidden, Refine::Stddev, Refine::Surface] {
        for &stddev in part_or_all(&[0.0, 0.3, 100.0][..], &[0.0, 0.1, 0.3, 0.6, 100.0]) {
            let decided =
                compare_decisions(scene, TreeOptions { depth, refine, stddev, ..Default::default() });
            all = [all[0] + decided[0], all[1] + decided[1]];
        }
    }
    all
}

#[test]
fn piles_are_refined_where_the_criterion_says() {
    let [refined, kept] = all_modes(&Scene::of(&random_pile(2, 3)), 2);
    assert!(refined > 30 && kept > part_or_all(1, 3), "{refined} {kept}");
}

#[test]
fn lattice_piles_are_refined_where_the_criterion_says() {
    let place = Place { level: 2, step: Step::Half, shift: [false, false, true], corner: 2 };
    let [refined, kept] = all_modes(&on_lattice(9, 4, place), 2);
    assert!(refined > 20 && kept > 5, "{refined} {kept}");
}

/// Walls and gaps thinner than a cell, which the samples alone do not show.
#[test]
fn thin_walls_are_refined_only_where_asked() {
    let slab = |low: f64, high: f64| shapes::cuboid([-1.0, -1.0, low], [1.0, 1.0, high]);
    let pieces = [slab(-1.0, -0.013), slab(-0.011, 0.4), slab(0.6, 0.6013), slab(0.9, 1.0)];
    let scene = Scene::of(&pieces.map(|p| p.rotated([1.0, 1.0, 0.2], 0.05)));
    let [refined, kept] = all_modes(&scene, 2);
    assert!(refined > 20 && kept > part_or_all(0, 1), "{refined} {kept}");
}
