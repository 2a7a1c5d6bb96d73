//! Plates thinner than a cell, which are divided to a greater depth than all else.
//!
//! The judge knows the plate as a box: whether a lattice edge passes through both of its large faces follows from the
//! plate's own coordinates, without facets.

use crate::refine::assert_complete;
use crate::scene::{Scene, assert_positions_agree, leaf_at, nodes, position};
use brickfield_bench_data::{Rng, shapes};
use brickfield_core::sweep::part_or_all;
use brickfield_engine::brick::{Brick, Count};
use brickfield_engine::build::{TreeOptions, build_beads_in_memory};
use brickfield_engine::lattice::{BRICK_CELLS, BRICK_POINTS, NodeKey, RootCube};
use brickfield_engine::solid::{Outline, bounds_of_beads};
use brickfield_engine::store::{BrickTree, MemoryTree, Refine};
use brickfield_engine::toolpath::{Attributes, BeadView, Section, Toolpath};

type V = [f64; 3];

/// A plate of 40 × 40, turned, and a block beside it.
struct Plate {
    /// Unit vectors along two edges and across.
    frame: [V; 3],
    thickness: f64,
}

const HALF: f64 = 20.0;

fn dot(a: V, b: V) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

impl Plate {
    fn new(axis: V, angle: f64, thickness: f64) -> (Plate, Scene) {
        let turned = |low: V, high: V| shapes::cuboid(low, high).rotated(axis, angle);
        let half = thickness / 2.0;
        let mesh = turned([-HALF, -HALF, -half], [HALF, HALF, half]);
        let block = shapes::cuboid([-3.0; 3], [3.0; 3]).translated([0.0, 0.0, 40.0]);
        let end = |e: V| rotate(axis, angle, e);
        let frame = [end([1.0, 0.0, 0.0]), end([0.0, 1.0, 0.0]), end([0.0, 0.0, 1.0])];
        (Plate { frame, thickness }, Scene::of(&[mesh, block]))
    }

    /// In the plate's own coordinates.
    fn local(&self, p: V) -> V {
        self.frame.map(|row| dot(row, p))
    }

    /// Whether both large faces lie between two points, clear of rounding and of the rim.
    fn is_passed(&self, [a, b]: [V; 2]) -> bool {
        let (a, b) = (self.local(a), self.local(b));
        let half = self.thickness / 2.0;
        let clear = 1e-4;
        if a[2].abs().min(b[2].abs()) < half + clear || a[2] * b[2] > 0.0 {
            return false;
        }
        [half, -half].into_iter().all(|face| {
            let t = (face - a[2]) / (b[2] - a[2]);
            (0..2).all(|c| (a[c] + t * (b[c] - a[c])).abs() < HALF - clear)
        })
    }
}

/// Rodrigues' formula.
fn rotate(axis: V, angle: f64, v: V) -> V {
    let length = dot(axis, axis).sqrt();
    let k = axis.map(|c| c / length);
    let (s, c) = angle.sin_cos();
    let cross = [k[1] * v[2] - k[2] * v[1], k[2] * v[0] - k[0] * v[2], k[0] * v[1] - k[1] * v[0]];
    let along = dot(k, v) * (1.0 - c);
    std::array::from_fn(|a| v[a] * c + cross[a] * s + k[a] * along)
}

/// Whether an edge of the brick along the axis nearest to the plate's normal passes through both large faces.
fn hides(plate: &Plate, root: &RootCube, key: NodeKey) -> bool {
    let normal = plate.frame[2].map(f64::abs);
    let axis = (0..3).max_by(|&a, &b| normal[a].total_cmp(&normal[b])).unwrap();
    let unit = root.edge / f64::from(1u32 << 24);
    let world = |ijk| {
        let p = position(key, ijk);
        std::array::from_fn::<f64, 3, _>(|a| root.origin[a] + f64::from(p[a]) * unit)
    };
    let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
    let mut at = [0; 3];
    (0..BRICK_CELLS * BRICK_POINTS.pow(2)).any(|n| {
        (at[axis], at[u], at[v]) =
            (n % BRICK_CELLS, n / BRICK_CELLS % BRICK_POINTS, n / BRICK_CELLS / BRICK_POINTS);
        let mut next = at;
        next[axis] += 1;
        plate.is_passed([world(at), world(next)])
    })
}

/// The level of the deepest nodes.
fn deepest_of(tree: &MemoryTree) -> u8 {
    tree.keys().into_iter().map(|key| key.level()).max().unwrap()
}

/// Whether two samples across a diagonal of a lattice face are inside, and the other two are not.
fn is_ambiguous(brick: &Brick) -> bool {
    let inside = |ijk: [usize; 3]| brick.sample(ijk) >= 1;
    (0..3 * BRICK_POINTS.pow(3)).any(|n| {
        let (axis, n) = (n % 3, n / 3);
        let p = [n % BRICK_POINTS, n / BRICK_POINTS % BRICK_POINTS, n / BRICK_POINTS.pow(2)];
        let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
        if p[u] == BRICK_CELLS || p[v] == BRICK_CELLS {
            return false;
        }
        let at = |du: usize, dv: usize| {
            let mut q = p;
            (q[u], q[v]) = (q[u] + du, q[v] + dv);
            inside(q)
        };
        at(0, 0) == at(1, 1) && at(1, 0) == at(0, 1) && at(0, 0) != at(1, 0)
    })
}

fn same(a: &MemoryTree, b: &MemoryTree, key: NodeKey) -> bool {
    match (&*a.brick(key).unwrap(), &*b.brick(key).unwrap()) {
        (Brick::Counts { samples: p, .. }, Brick::Counts { samples: q, .. }) => p == q,
        (p, q) => p == q,
    }
}

#[test]
fn plates_are_divided_until_samples_show_them() {
    let (base, deepest) = (1, 4);
    let all = [([1.0, 0.0, 0.0], 0.2, 0.3), ([0.3, 1.0, 0.1], 0.7, 0.17), ([1.0, -1.0, 0.4], 1.9, 0.4)];
    for &(axis, angle, thickness) in part_or_all(&all[1..2], &all) {
        let (plate, scene) = Plate::new(axis, angle, thickness);
        let thin = TreeOptions { depth: deepest, refine: Refine::Thin { base }, ..Default::default() };
        let tree = scene.build(thin);
        assert_complete(&tree, deepest_of(&tree));
        assert_positions_agree(&tree);
        let full: Vec<MemoryTree> = (0..=deepest).map(|depth| scene.at_depth(depth)).collect();
        let mut divided = 0;
        for (key, leaf, brick) in nodes(&tree) {
            let level = key.level();
            if leaf && level >= base && *brick != Brick::Uniform(0) {
                // A leaf is that of the tree that ends on its level.
                assert!(*brick == *full[usize::from(level)].brick(key).unwrap(), "{key}");
            }
            if !leaf {
                assert!(same(&tree, &full[usize::from(deepest)], key), "{key}");
            }
            if level >= base && level < deepest {
                let hidden = hides(&plate, &scene.root, key)
                    || is_ambiguous(&full[usize::from(level)].brick(key).unwrap());
                // Gaps there are none, and no sheet of another body is near.
                assert!(!(leaf && hidden), "{key} hides the plate and is not divided");
                assert!(leaf || hidden, "{key} is divided for nothing");
                divided += usize::from(!leaf);
            }
        }
        let leaves = |tree: &MemoryTree| nodes(tree).iter().filter(|(_, leaf, _)| *leaf).count();
        assert!(divided > 10 && leaves(&tree) < leaves(&full[usize::from(deepest)]), "{divided}");
    }
}

#[test]
fn nothing_more_is_divided_where_nothing_hides() {
    let mut rng = Rng::new(5);
    for _ in 0..4 {
        // Edges and corners of boxes, and round bodies that lines graze, are no thin walls.
        let pieces = [
            shapes::cuboid([-9.0, -5.0, -4.0], [9.0, 5.0, 4.0]).rotated_by(rng.quaternion()),
            shapes::octahedron(8.0).rotated_by(rng.quaternion()).translated([30.0, 0.0, 0.0]),
        ];
        let scene = Scene::of(&pieces);
        let base = 2;
        let thin = scene.build(TreeOptions { depth: 4, refine: Refine::Thin { base }, ..Default::default() });
        let full: Vec<MemoryTree> = (0..=4).map(|depth| scene.at_depth(depth)).collect();
        // Only at tips, which are narrower than a cell, do samples meet at corners.
        let divided = |(key, leaf, _): &&(NodeKey, bool, _)| !leaf && key.level() >= base;
        let all = nodes(&thin);
        let divided: Vec<NodeKey> = all.iter().filter(divided).map(|(key, ..)| *key).collect();
        // A brick or two of each of the fourteen corners on both levels.
        assert!(divided.len() <= 2 * 2 * 14, "{divided:?}");
        for key in divided {
            let brick = full[usize::from(key.level())].brick(key).unwrap();
            assert!(is_ambiguous(&brick), "{key} is divided for nothing");
        }
    }
}

/// A bead much wider than high is a plate of its own.
#[test]
fn flat_beads_are_divided_like_plates() {
    let mut path = Toolpath::default();
    let attributes = Attributes { layer: 0, tool: 0, feature: 0, lines: (1, 2), fed: None };
    // The other one, thick enough for all cells, has the flat one lie beside the middle of the root, where samples are.
    for (z, width, height) in [(10.0, 20.0, 0.15), (17.3, 3.0, 3.0)] {
        let sections = [Section { width, height }];
        let points = [[0.0, 0.0, z], [40.0, 9.0, z]];
        path.push(BeadView { points: &points, axes: &[], sections: &sections, lines: &[], attributes });
    }
    let (min, max) = bounds_of_beads(&path, Outline::Stadium).unwrap();
    let root = RootCube::around(min, max).unwrap();
    let build =
        |options| build_beads_in_memory(&[&path], (Outline::Stadium, Count::Beads), root, options).unwrap();
    let (base, deepest) = (1, 5);
    let tree = build(TreeOptions { depth: deepest, refine: Refine::Thin { base }, ..Default::default() });
    assert_complete(&tree, deepest_of(&tree));
    assert_positions_agree(&tree);
    let full: Vec<MemoryTree> =
        (0..=deepest).map(|depth| build(TreeOptions { depth, ..Default::default() })).collect();
    let mut deep = 0;
    for (key, leaf, brick) in nodes(&tree) {
        if leaf && key.level() > base && *brick != Brick::Uniform(0) {
            assert!(*brick == *full[usize::from(key.level())].brick(key).unwrap(), "{key}");
            deep += 1;
        }
    }
    assert!(deep > 8, "{deep}");
    // No cell of the level to which all is divided is left between its flat faces.
    let (mut rng, snap) = (Rng::new(3), root.snapper());
    for _ in 0..200 {
        let along = rng.range(0.0, 1.0);
        let middle = [40.0 * along, 9.0 * along + rng.range(-8.0, 8.0), 10.0 - 0.075];
        assert!(leaf_at(&tree, snap(middle)).0.level() > base, "{middle:?}");
    }
}
