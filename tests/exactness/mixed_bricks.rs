//! Trees of meshes and point clouds together against the sum of both sums, each written again from its formula.

use crate::cloud_bricks::{crossings_along_x, sum_at, torus};
use crate::open::without;
use crate::oracle::Oracle;
use crate::scene::{RandomSample, assert_positions_agree, bounds, nodes, random_samples};
use brickfield_bench_data::Mesh;
use brickfield_bench_data::pile::random_pile;
use brickfield_bench_data::shapes::cuboid;
use brickfield_engine::Silent;
use brickfield_engine::build::{TreeOptions, build_cloud_and_soup_in_memory};
use brickfield_engine::ingest::{Facet, PointCloud};
use brickfield_engine::lattice::RootCube;
use brickfield_engine::store::{MemoryTree, Refine};
use brickfield_engine::winding::Surfels;
use proptest::prelude::*;

struct MixedScene {
    surfels: Surfels,
    soup: Vec<Facet>,
    root: RootCube,
}

impl MixedScene {
    fn of(cloud: &PointCloud, soup: Vec<Facet>) -> MixedScene {
        let surfels = Surfels::of(cloud.clone(), &Silent).unwrap();
        let (a, b) = (surfels.bounds(), bounds(&soup));
        let min = std::array::from_fn(|i| f64::min(a.0[i], b.0[i]));
        let max = std::array::from_fn(|i| f64::max(a.1[i], b.1[i]));
        MixedScene { surfels, soup, root: RootCube::around(min, max).unwrap() }
    }

    fn tree(&self, options: TreeOptions, error: f64) -> MemoryTree {
        build_cloud_and_soup_in_memory(self.surfels.clone(), &[&self.soup], self.root, options, error)
            .unwrap()
    }

    fn oracle(&self) -> Oracle {
        let snap = self.root.snapper();
        Oracle::new(self.soup.iter().map(|t| t.map(snap)).collect())
    }

    /// Compares random samples of random bricks; the worst error, and how many were compared.
    fn compare(&self, tree: &MemoryTree, samples: usize, seed: u64) -> (f64, usize) {
        let oracle = self.oracle();
        let (mut worst, mut compared) = (0.0f64, 0);
        for RandomSample { at, value, .. } in random_samples(tree, &oracle, samples, seed) {
            let truth = oracle.solid_angles(at) + sum_at(&self.surfels, self.root, at);
            worst = worst.max((value - truth).abs());
            compared += 1;
        }
        (worst, compared)
    }
}

/// A torus among boxes, which cross it; of which some facets are missing.
fn torus_among_boxes(seed: u64, points: usize, lost: f64) -> MixedScene {
    let soup: Vec<Facet> = Mesh::merged(&random_pile(seed, 4)).facets().collect();
    let (low, high) = bounds(&soup);
    let scale = (0..3).map(|a| high[a] - low[a]).fold(0.0, f64::max) / 20.0;
    let mut cloud = torus(points, seed);
    for p in cloud.points.iter_mut() {
        *p = std::array::from_fn(|a| 0.5 * (low[a] + high[a]) + scale * p[a]);
    }
    MixedScene::of(&cloud, without(soup, lost, seed))
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(4))]

    /// The field is the sum of both fields, whether the mesh is closed or open, and the error is that of the sum.
    #[test]
    fn samples_are_the_sum_of_both_sums(
        seed in 0u64..1000,
        points in 100usize..500,
        lost in prop::sample::select(vec![0.0, 0.1, 0.5]),
        error in prop::sample::select(vec![0.05, 0.02, 2e-3]),
        depth in 0u8..2,
    ) {
        let scene = torus_among_boxes(seed, points, lost);
        let tree = scene.tree(TreeOptions { depth, ..Default::default() }, error);
        let (worst, compared) = scene.compare(&tree, 250, seed);
        prop_assert!(compared > 100 && worst <= error, "{worst} of {error} in {compared}");
        assert_positions_agree(&tree);
    }
}

/// Neither the order of facets nor that of points changes a bit; another criterion keeps the bound.
#[test]
fn orders_change_nothing_and_another_criterion_keeps_the_bound() {
    let scene = torus_among_boxes(7, 300, 0.1);
    let options = TreeOptions { depth: 1, ..Default::default() };
    let tree = scene.tree(options, 0.02);
    let mut reversed =
        MixedScene { surfels: scene.surfels.clone(), soup: scene.soup.clone(), root: scene.root };
    reversed.soup.reverse();
    reversed.surfels.all.reverse();
    let other = reversed.tree(options, 0.02);
    let bricks = |tree: &MemoryTree| -> Vec<_> {
        nodes(tree).into_iter().map(|(key, leaf, brick)| (key, leaf, format!("{brick:?}"))).collect()
    };
    assert!(bricks(&tree) == bricks(&other));
    let tree = scene.tree(TreeOptions { refine: Refine::Surface, ..options }, 0.02);
    let (worst, compared) = scene.compare(&tree, 200, 3);
    assert!(compared > 80 && worst <= 0.02, "{worst} in {compared}");
}

/// Hermite edges lie on the facets of the box, and on the torus where there is none.
#[test]
fn hermite_edges_lie_on_both_surfaces() {
    let soup: Vec<Facet> = cuboid([20.0, -3.0, -3.0], [27.0, 3.0, 3.0]).facets().collect();
    let scene = MixedScene::of(&torus(2000, 9), soup);
    let tree = scene.tree(TreeOptions { depth: 1, ..Default::default() }, 0.02);
    let (mut on_box, mut on_torus) = (0, 0);
    for ([x, y, z], normal) in crossings_along_x(&tree, scene.root) {
        if x > 17.0 {
            let (at, way) = if x < 23.5 { (20.0, -1.0) } else { (27.0, 1.0) };
            assert!((x - at).abs() < 1e-4 && normal[0] * way > 0.9999, "{x} {normal:?}");
            on_box += 1;
        } else {
            assert!(((x.hypot(y) - 10.0).hypot(z) - 4.0).abs() < 0.4, "{x} {y} {z}");
            on_torus += 1;
        }
    }
    assert!(on_box > 100 && on_torus > 300, "{on_box} {on_torus}");
}
