//! The tree as a whole: what is between its nodes, below its leaves and behind its threads.

use crate::oracle::Oracle;
use crate::piles::{Place, Step, on_lattice};
use crate::scene::{Scene, leaf_at, nodes, position, random_sample};
use brickfield_bench_data::pile::random_pile;
use brickfield_bench_data::{Mesh, Rng, shapes};
use brickfield_core::sweep::part_or_all;
use brickfield_engine::brick::Brick;
use brickfield_engine::build::TreeOptions;
use brickfield_engine::lattice::{BRICK_POINTS, NodeKey};
use brickfield_engine::store::{BrickTree, MemoryTree, Refine};

/// All samples of all nodes by position: equal positions, equal values. Returns how often one was repeated.
fn repeated_samples(tree: &MemoryTree) -> usize {
    let mut all: Vec<(u128, i16)> = Vec::new();
    for (key, _, brick) in nodes(tree) {
        for k in 0..BRICK_POINTS {
            for j in 0..BRICK_POINTS {
                for i in 0..BRICK_POINTS {
                    let p = position(key, [i, j, k]);
                    let packed = p.iter().fold(0, |code, &c| code << 32 | c as u128);
                    all.push((packed, brick.sample([i, j, k])));
                }
            }
        }
    }
    all.sort_unstable();
    let same = |pair: &&[(u128, i16)]| pair[0].0 == pair[1].0;
    let repeated = all.windows(2).filter(same);
    repeated.map(|pair| assert_eq!(pair[0].1, pair[1].1, "at {:x}", pair[0].0)).count()
}

#[test]
fn nodes_that_share_a_position_agree_across_levels() {
    let scene = Scene::of(&random_pile(5, 4));
    for refine in [Refine::Hidden, Refine::Stddev, Refine::Surface] {
        for &stddev in part_or_all(&[0.3][..], &[0.0, 0.3]) {
            assert!(
                repeated_samples(&scene.build(TreeOptions {
                    depth: 2,
                    refine,
                    stddev,
                    ..Default::default()
                })) > 50_000
            );
        }
    }
    let place = Place { level: 16, step: Step::One, shift: [true, false, false], corner: 3 };
    assert!(repeated_samples(&on_lattice(11, 6, place).at_depth(16)) > 100_000);
    let place = Place { level: 3, ..place };
    assert!(repeated_samples(&on_lattice(12, 3, place).at_depth(3)) > 100_000);
}

/// Pieces down to a thousandth of a coarse cell, and what `around` adds to them.
fn specks(around: &[Mesh]) -> (Scene, Vec<[f64; 3]>) {
    let mut pieces = around.to_vec();
    let mut rng = Rng::new(77);
    let mut places = Vec::new();
    for n in 0..40 {
        let at: [f64; 3] = std::array::from_fn(|_| rng.range(-60.0, 60.0));
        let size = 10f64.powi(-(n % 4)) * 0.1;
        let speck = shapes::octahedron(size).rotated_by(rng.quaternion()).translated(at);
        pieces.push(if n % 3 == 0 { speck.flipped() } else { speck });
        places.push(at);
    }
    (Scene::of(&pieces), places)
}

#[test]
fn nothing_is_missed_below_coarse_leaves() {
    // In, on and beside a large box.
    let large = shapes::cuboid([-50.0; 3], [50.0, 20.0, 30.0]).rotated([3.0, 1.0, 2.0], 0.7);
    let (scene, places) = specks(&[large]);
    let oracle = scene.oracle();
    for depth in [4, 5] {
        let tree = scene.at_depth(depth);
        let snap = scene.root.snapper();
        for at in &places {
            assert_eq!(leaf_at(&tree, snap(*at)).0.level(), depth, "a speck at {at:?} was passed over");
        }
        let mut rng = Rng::new(u64::from(depth));
        let coarse: Vec<_> = nodes(&tree).into_iter().filter(|n| n.1 && n.0.level() < depth).collect();
        assert!(coarse.len() > 20);
        for (key, _, brick) in coarse {
            let Brick::Uniform(w) = *brick else { panic!("{key} is a coarse leaf that varies") };
            for _ in 0..40 {
                // At the deepest lattice there is, whatever the tree's depth.
                let p = random_sample(&mut rng, key, 16);
                assert_eq!(oracle.at(p), i64::from(w), "{key} at {p:?}");
            }
        }
    }
}

/// Around each speck that is wide enough, samples at a depth that resolves it.
#[test]
fn specks_are_sampled_exactly() {
    let (scene, places) = specks(&[]);
    let oracle = scene.oracle();
    let tree = scene.at_depth(9);
    let snap = scene.root.snapper();
    let mut inside = 0;
    for at in &places {
        let (key, brick) = leaf_at(&tree, snap(*at));
        crate::scene::compare_brick(&oracle, key, &brick);
        inside += usize::from(brick.range().0 != brick.range().1);
    }
    assert!(inside >= 8, "{inside}");
}

fn equal(a: &MemoryTree, b: &MemoryTree) -> bool {
    let (a, b) = (nodes(a), nodes(b));
    a.len() == b.len() && a.iter().zip(&b).all(|(a, b)| a == b)
}

fn on_threads(threads: usize, scene: &Scene, options: TreeOptions) -> MemoryTree {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
    pool.install(|| scene.build(options))
}

/// Facets in another order and their corners turned.
fn shuffled(scene: &Scene, seed: u64) -> Scene {
    let mut rng = Rng::new(seed);
    let mut scene = scene.clone();
    for n in (1..scene.soup.len()).rev() {
        scene.soup.swap(n, rng.below(n as u32 + 1) as usize);
    }
    scene.soup.iter_mut().for_each(|t| t.rotate_left(rng.below(3) as usize));
    scene
}

#[test]
fn threads_and_the_order_of_the_facets_change_nothing() {
    let place = Place { level: 5, step: Step::One, shift: [false, true, false], corner: 1 };
    // More facets than are read at a time, so that there are several partial sums to join.
    let beads: Vec<Mesh> = brickfield_bench_data::pile::bead_pile(3, 40_000, [30.0, 30.0, 6.0]).collect();
    let scenes = [Scene::of(&random_pile(21, 9)), on_lattice(4, 10, place), Scene::of(&beads)];
    for (number, scene) in scenes.iter().enumerate() {
        for refine in [Refine::Hidden, Refine::Stddev, Refine::Surface] {
            let options = TreeOptions { depth: 3, refine, stddev: 0.0, ..Default::default() };
            let expected = on_threads(1, scene, options);
            for &threads in part_or_all(&[3][..], &[2, 3, 8]) {
                let same = on_threads(threads, &shuffled(scene, threads as u64), options);
                assert!(equal(&expected, &same), "scene {number}, {refine:?}, {threads} threads");
            }
        }
    }
}

/// Sources count as one soup, wherever it is cut.
#[test]
fn cutting_the_soup_into_sources_changes_nothing() {
    let scene = Scene::of(&random_pile(8, 6));
    let options = TreeOptions { depth: 3, ..Default::default() };
    let (first, second) = scene.soup.split_at(scene.soup.len() / 3);
    let (first, second) = (first.to_vec(), second.to_vec());
    let cut = brickfield_engine::build::build_in_memory(&[&first, &second], scene.root, options);
    assert!(equal(&scene.build(options), &cut.expect("closed as a whole")));
}

/// The oracle's index leaves nothing out.
#[test]
fn the_index_of_the_oracle_changes_nothing() {
    let scene = Scene::of(&random_pile(30, 12));
    let oracle: Oracle = scene.oracle();
    let mut rng = Rng::new(1);
    for _ in 0..2_000 {
        let p = random_sample(&mut rng, NodeKey::ROOT, 4);
        assert_eq!(oracle.at(p), oracle.at_without_index(p), "{p:?}");
    }
    let tree = scene.at_depth(0);
    assert_eq!(tree.keys(), [NodeKey::ROOT]);
}
