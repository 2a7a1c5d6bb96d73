//! The tree against the brute-force oracle.

use super::memory::build_with;
use super::rules::Rules;
use super::*;
use crate::brick::Brick;
use crate::lattice::{NodeKey, RootCube};
use crate::store::{BrickTree, MemoryTree, Refine};
use crate::winding::solid_angle;

type World = [[f64; 3]; 3];

/// A box with outward faces.
fn cuboid(low: [f64; 3], high: [f64; 3]) -> Vec<World> {
    let p = |c: usize| std::array::from_fn(|a| if c >> a & 1 == 1 { high[a] } else { low[a] });
    let quads = [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];
    quads.iter().flat_map(|q| [[p(q[0]), p(q[1]), p(q[2])], [p(q[0]), p(q[2]), p(q[3])]]).collect()
}

fn turned(soup: &[World], angle: f64) -> Vec<World> {
    let (s, c) = angle.sin_cos();
    let turn = |[x, y, z]: [f64; 3]| {
        let (x, y) = (c * x - s * y, s * x + c * y);
        [x, c * y - s * z, s * y + c * z]
    };
    soup.iter().map(|t| t.map(turn)).collect()
}

fn scene() -> Vec<World> {
    let mut soup = turned(&cuboid([-1.0, -2.0, -3.0], [1.0, 2.0, 3.0]), 0.4);
    soup.extend(turned(&cuboid([-0.5, -2.5, -1.0], [0.5, 2.5, 1.0]), 1.1));
    let reversed = turned(&cuboid([-0.4, -0.4, -0.4], [0.4, 0.3, 0.2]), 2.0);
    soup.extend(reversed.iter().map(|t| [t[0], t[2], t[1]]));
    soup.extend(cuboid([3.0, 3.0, 3.0], [3.02, 3.02, 3.02]));
    soup
}

fn root_of(soup: &[World]) -> RootCube {
    let all = || soup.iter().flatten();
    let min = std::array::from_fn(|a| all().fold(f64::MAX, |m, v| m.min(v[a])));
    let max = std::array::from_fn(|a| all().fold(f64::MIN, |m, v| m.max(v[a])));
    RootCube::around(min, max).unwrap()
}

fn build(soup: &[World], options: TreeOptions, evaluate_interior: bool) -> MemoryTree {
    let root = root_of(soup);
    let rules = Rules { evaluate_interior, ..Rules::new(options, root).unwrap() };
    build_with(&[&soup.to_vec()], root, &rules).unwrap()
}

fn nodes(tree: &MemoryTree) -> Vec<(NodeKey, bool, Brick)> {
    let node = |key| (key, tree.node(key).unwrap().leaf, Brick::clone(&tree.brick(key).unwrap()));
    tree.keys().into_iter().map(node).collect()
}

#[test]
fn samples_equal_the_solid_angle_sum() {
    let soup = scene();
    let root = root_of(&soup);
    let snap = root.snapper();
    let snapped: Vec<World> = soup.iter().map(|t| t.map(|v| snap(v).map(f64::from))).collect();
    let tree = build(&soup, TreeOptions { depth: 3, ..Default::default() }, false);
    let mut checked = 0;
    for (key, _, brick) in nodes(&tree) {
        for n in (0..crate::brick::POINTS).step_by(if key.level() == 0 { 1 } else { 53 }) {
            let ijk = [n % 33, n / 33 % 33, n / 1089];
            let p: [f64; 3] = std::array::from_fn(|a| {
                f64::from(key.base()[a] + ((ijk[a] as i32) << key.spacing_bits()) + 1)
            });
            let from_p = |v: [f64; 3]| std::array::from_fn(|a| v[a] - p[a]);
            let angle = |t: &World| solid_angle(from_p(t[0]), from_p(t[1]), from_p(t[2]));
            let exact = snapped.iter().map(angle).sum::<f64>() / (4.0 * std::f64::consts::PI);
            assert!((exact - f64::from(brick.sample(ijk))).abs() < 1e-6, "{key} {ijk:?}: {exact} {brick:?}");
            checked += 1;
        }
    }
    assert!(checked > 100_000, "{checked}");
}

#[test]
fn following_triangles_and_deciding_per_node_give_one_tree() {
    let soup = scene();
    for depth in [0, 1, 3, 5] {
        let options = TreeOptions { depth, ..Default::default() };
        let (followed, decided) = (nodes(&build(&soup, options, false)), nodes(&build(&soup, options, true)));
        assert_eq!(followed.len(), decided.len());
        for (a, b) in followed.iter().zip(&decided) {
            assert!(a == b, "depth {depth}: {a:?} against {b:?}");
        }
    }
}

#[test]
fn plain_and_surface_refinement_stop_earlier() {
    let soup = scene();
    let count = |refine, stddev| {
        build(&soup, TreeOptions { depth: 4, refine, stddev, ..Default::default() }, false).keys().len()
    };
    let hidden = count(Refine::Hidden, 0.0);
    assert!(count(Refine::Stddev, 0.0) <= hidden);
    assert!(count(Refine::Surface, 0.0) < hidden);
    assert!(count(Refine::Hidden, 0.3) < hidden);
    assert!(count(Refine::Stddev, 0.3) <= count(Refine::Hidden, 0.3));
}

#[test]
fn thread_count_and_triangle_order_change_nothing() {
    let mut soup = scene();
    let options = TreeOptions { depth: 4, ..Default::default() };
    let expected = nodes(&build(&soup, options, false));
    for threads in [1, 2, 3, 8] {
        soup.rotate_left(7);
        soup.swap(1, 20);
        soup[3].rotate_left(1);
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        assert!(pool.install(|| nodes(&build(&soup, options, false))) == expected, "{threads} threads");
    }
}
