//! Trees of point clouds against the sum over all points, written again from its formula.

use crate::scene::{assert_positions_agree, nodes, on_root_face, position};
use brickfield_bench_data::Rng;
use brickfield_bench_data::inputs::torus_points;
use brickfield_engine::Silent;
use brickfield_engine::brick::{Brick, SignChanges};
use brickfield_engine::build::{BuildOptions, Resolution, TreeOptions, build_cloud_in_memory, build_clouds};
use brickfield_engine::ingest::{CloudInput, PointCloud};
use brickfield_engine::large_array::ArrayRoom;
use brickfield_engine::lattice::{Axis, BRICK_POINTS, ROOT_BITS, RootCube};
use brickfield_engine::store::{MemoryTree, Refine};
use brickfield_engine::winding::{CloudField, Surfel, Surfels};
use std::f64::consts::PI;

/// Points scattered over a torus with radii of 10 and 4, and its normals.
pub fn torus(count: usize, seed: u64) -> PointCloud {
    let (points, normals) = torus_points(seed).take(count).unzip();
    PointCloud::of(points, normals)
}

struct Scene {
    surfels: Surfels,
    root: RootCube,
}

impl Scene {
    fn of(cloud: &PointCloud) -> Scene {
        let surfels = Surfels::of(cloud.clone(), &Silent).unwrap();
        let (min, max) = surfels.bounds();
        Scene { root: RootCube::around(min, max).unwrap(), surfels }
    }

    fn tree(&self, options: TreeOptions, error: f64) -> MemoryTree {
        build_cloud_in_memory(self.surfels.clone(), self.root, options, error).unwrap()
    }

    fn w(&self, p: [i32; 3]) -> f64 {
        sum_at(&self.surfels, self.root, p)
    }
}

/// The sum over all points at a lattice position.
pub fn sum_at(surfels: &Surfels, root: RootCube, p: [i32; 3]) -> f64 {
    let units = f64::from(1u32 << ROOT_BITS) / root.edge;
    let snap = root.snapper();
    let share = |s: &Surfel| {
        let at = snap(s.position);
        let r: [f64; 3] = std::array::from_fn(|a| f64::from(at[a] - p[a]));
        let distance = r.iter().map(|c| c * c).sum::<f64>().sqrt();
        let radius = s.radius * units;
        let q = distance / radius;
        // The share of the ball's density that is nearer to its middle.
        let inner = if q < 1.0 { 2.5 * q.powi(3) - 1.5 * q.powi(5) } else { 1.0 };
        let along: f64 = (0..3).map(|a| s.area[a] * units * units * r[a]).sum();
        inner * along / (4.0 * PI * distance.powi(3))
    };
    surfels.all.iter().map(share).sum()
}

/// The largest error of random samples of random bricks.
fn worst(scene: &Scene, tree: &MemoryTree, samples: usize, seed: u64) -> f64 {
    let mut rng = Rng::new(seed);
    let nodes = nodes(tree);
    let mut worst = 0.0f64;
    for _ in 0..samples {
        let (key, _, brick) = &nodes[rng.below(nodes.len() as u32) as usize];
        let ijk: [usize; 3] = std::array::from_fn(|_| rng.below(BRICK_POINTS as u32) as usize);
        let p = position(*key, ijk);
        if !on_root_face(p) {
            worst = worst.max((brick.value(ijk) - scene.w(p)).abs());
        }
    }
    worst
}

#[test]
fn samples_are_within_the_bound() {
    let mut two = torus(700, 1);
    // A second one through it, facing inward, one point far off, and one twice.
    let other = torus(300, 2);
    for (p, n) in other.points.iter().zip(&other.normals) {
        two.push([p[0] + 9.0, p[2], p[1]], Some([-n[0], -n[2], -n[1]])).unwrap();
    }
    two.push([30.0, 20.0, 10.0], Some([0.0, 0.6, 0.8])).unwrap();
    two.push(two.points[0], Some(two.normals[0])).unwrap();
    for (cloud, depth, error) in [(torus(2000, 3), 1, 1e-3), (two, 2, 0.02), (torus(200, 4), 0, 3e-4)] {
        let scene = Scene::of(&cloud);
        let tree = scene.tree(TreeOptions { depth, ..Default::default() }, error);
        let found = worst(&scene, &tree, 1500, 5);
        println!("asked for {error}, worst of 1500: {found:.1e}");
        assert!(found <= error, "{found} {error}");
        assert_positions_agree(&tree);
    }
}

/// What `winding` answers is what the store holds.
#[test]
fn stores_hold_what_points_are_told() {
    let scene = Scene::of(&torus(1000, 6));
    let tree = scene.tree(TreeOptions { depth: 1, ..Default::default() }, 0.01);
    let field = CloudField::new(&scene.surfels, scene.root).unwrap();
    let (mut points, mut stored) = (Vec::new(), Vec::new());
    for (key, _, brick) in nodes(&tree) {
        for at in 1..11 {
            let ijk = [3 * at, (7 * at) % 32, (11 * at) % 32];
            let p = position(key, ijk);
            if !on_root_face(p) {
                points.push(scene.root.to_world(p.map(f64::from)));
                stored.push(brick.value(ijk));
            }
        }
    }
    let told = field.winding_at(scene.root, &points, 1e-5, &Silent).unwrap();
    assert!(stored.len() > 60);
    for (a, b) in stored.iter().zip(told) {
        assert!((a - b).abs() <= 0.01 + 1e-5, "{a} {b}");
    }
}

/// Stores do not tell whether points were in memory or in files.
#[test]
fn points_in_files_give_the_same_store() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("scan.xyz");
    let cloud = torus(1000, 8);
    let line = |(p, n): (&[f64; 3], &[f64; 3])| {
        let words: Vec<String> = p.iter().chain(n).map(f64::to_string).collect();
        words.join(" ") + "\n"
    };
    let text: String = cloud.points.iter().zip(&cloud.normals).map(line).collect();
    std::fs::write(&path, text).unwrap();
    for estimate in [false, true] {
        let built = |bytes: u64| {
            let room = ArrayRoom::new(bytes, dir.path());
            let input = CloudInput::open_within(&path, &room, &Silent).unwrap();
            let output = dir.path().join("scan.brf");
            let mut options =
                BuildOptions { gwn_error: 0.05, resolution: Resolution::Depth(1), ..BuildOptions::default() };
            // Less than all arrays need.
            options.resources.memory = bytes.saturating_add(100_000);
            build_clouds(vec![input], estimate, &output, &options, &Silent).unwrap();
            std::fs::read(output).unwrap()
        };
        let whole = built(u64::MAX);
        assert!(built(0) == whole && built(40_000) == whole);
    }
    assert_eq!(std::fs::read_dir(dir.path()).unwrap().count(), 2);
}

/// Bricks are divided where samples may miss a point, and where they bend by more than the error; not where points are
/// many cells apart.
#[test]
fn bricks_are_divided_down_to_what_samples_show() {
    let grid = (0..81).map(|i| [f64::from(i % 9), f64::from(i / 9), 0.0]).collect();
    let scene = Scene::of(&PointCloud::of(grid, vec![[0.0, 0.0, 1.0]; 81]));
    assert_eq!(scene.surfels.spacing, 1.0);
    let coarse = scene.tree(TreeOptions { depth: 3, ..Default::default() }, 0.5);
    assert_eq!(nodes(&coarse).len(), 1, "balls are wider than four cells of the root");
    let fine = scene.tree(TreeOptions { depth: 1, ..Default::default() }, 1e-3);
    assert_eq!(nodes(&fine).len(), 9);
    let scene = Scene::of(&torus(4000, 8));
    for refine in [Refine::Hidden, Refine::Surface] {
        let tree = scene.tree(TreeOptions { depth: 1, refine, stddev: 0.0, ..Default::default() }, 0.5);
        assert_eq!(
            nodes(&tree).len(),
            9,
            "{refine:?}: cells of the root are twice as large as points are apart"
        );
    }
}

/// The crossings of edges along x of all leaves, in the world, with their normals. Each sign change has one, along all axes.
pub fn crossings_along_x(tree: &MemoryTree, root: RootCube) -> Vec<([f64; 3], [f64; 3])> {
    let mut crossings = Vec::new();
    for (key, leaf, brick) in nodes(tree) {
        let (true, Brick::Counts { samples, hermite }) = (leaf, &*brick) else { continue };
        let signs = SignChanges::of(samples);
        assert_eq!(signs.counts(), [0, 1, 2].map(|a| hermite.edges[a].len()));
        let mut edges = hermite.edges[0].iter();
        for row in 0..BRICK_POINTS * BRICK_POINTS {
            let (j, k) = (row % BRICK_POINTS, row / BRICK_POINTS);
            let mut bits = signs.edges(Axis::X, j, k);
            while bits != 0 {
                let i = bits.trailing_zeros() as usize;
                bits &= bits - 1;
                let edge = edges.next().unwrap();
                let p = position(key, [i, j, k]).map(f64::from);
                let spacing = f64::from(1u32 << key.spacing_bits());
                let at = root.to_world([p[0] + edge.fraction() * spacing, p[1], p[2]]);
                crossings.push((at, edge.normal.to_vector()));
            }
        }
    }
    crossings
}

/// Hermite edges lie where the field passes 0.5, with its gradient.
#[test]
fn hermite_edges_lie_on_the_surface() {
    let scene = Scene::of(&torus(3000, 9));
    let tree = scene.tree(TreeOptions { depth: 1, ..Default::default() }, 0.02);
    let (mut all, mut off, mut tilted) = (0, 0, 0);
    for ([x, y, z], normal) in crossings_along_x(&tree, scene.root) {
        let ring = x.hypot(y);
        all += 1;
        off += u32::from(((ring - 10.0).hypot(z) - 4.0).abs() > 0.1);
        let way = [(ring - 10.0) * x / ring, (ring - 10.0) * y / ring, z].map(|c| c / 4.0);
        tilted += u32::from((0..3).map(|a| way[a] * normal[a]).sum::<f64>() < 0.9);
    }
    // Points are 0.7 apart.
    assert!(all > 1500 && off * 50 < all && tilted * 20 < all, "{off} off and {tilted} tilted of {all}");
}
