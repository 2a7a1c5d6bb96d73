//! Soups, their trees, and the comparison of a brick with the oracle.

use crate::oracle::Oracle;
use brickfield_bench_data::pile::random_pile;
use brickfield_bench_data::{Mesh, Rng, write};
use brickfield_engine::Result;
use brickfield_engine::brick::Brick;
use brickfield_engine::build::{TreeOptions, build_in_memory};
use brickfield_engine::ingest::Facet;
use brickfield_engine::lattice::{BRICK_CELLS, BRICK_POINTS, NodeKey, ROOT_BITS, RootCube};
use brickfield_engine::store::{BrickTree, MemoryTree};
use std::collections::HashMap;
use std::sync::Arc;

/// A soup in world coordinates and where it lies.
#[derive(Clone)]
pub struct Scene {
    pub soup: Vec<Facet>,
    pub root: RootCube,
}

impl Scene {
    /// With the root cube that a build would choose.
    pub fn around(soup: Vec<Facet>) -> Scene {
        let (min, max) = bounds(&soup);
        Scene { root: RootCube::around(min, max).expect("an extent"), soup }
    }

    pub fn of(pieces: &[Mesh]) -> Scene {
        Scene::around(Mesh::merged(pieces).facets().collect())
    }

    /// In a cube whose units are the world's: integer coordinates are exact.
    pub fn in_units(mesh: &Mesh) -> Scene {
        let edge = f64::from(1u32 << ROOT_BITS);
        Scene { soup: mesh.facets().collect(), root: RootCube { origin: [0.0; 3], edge } }
    }

    pub fn oracle(&self) -> Oracle {
        let snap = self.root.snapper();
        Oracle::new(self.soup.iter().map(|t| t.map(snap)).collect())
    }

    pub fn try_build(&self, options: TreeOptions) -> Result<MemoryTree> {
        build_in_memory(&[&self.soup], self.root, options)
    }

    pub fn build(&self, options: TreeOptions) -> MemoryTree {
        self.try_build(options).unwrap_or_else(|e| panic!("{e}"))
    }

    pub fn at_depth(&self, depth: u8) -> MemoryTree {
        self.build(TreeOptions { depth, ..Default::default() })
    }
}

/// A random pile as binary STL, without its last facet if it is to be open.
pub fn pile_as_stl(seed: u64, pieces: usize, is_open: bool) -> Vec<u8> {
    let mut bytes = Vec::new();
    write::stl(&mut bytes, &Mesh::merged(&random_pile(seed, pieces))).unwrap();
    if is_open {
        let facets = (bytes.len() as u32 - 84) / 50 - 1;
        bytes.truncate(84 + 50 * facets as usize);
        bytes[80..84].copy_from_slice(&facets.to_le_bytes());
    }
    bytes
}

/// The box around a soup.
pub fn bounds(soup: &[Facet]) -> ([f64; 3], [f64; 3]) {
    let all = || soup.iter().flatten();
    let min = std::array::from_fn(|a| all().fold(f64::MAX, |m, v| m.min(v[a])));
    let max = std::array::from_fn(|a| all().fold(f64::MIN, |m, v| m.max(v[a])));
    (min, max)
}

/// Lattice position of a sample.
pub fn position(key: NodeKey, ijk: [usize; 3]) -> [i32; 3] {
    std::array::from_fn(|a| key.base()[a] + ((ijk[a] as i32) << key.spacing_bits()) + 1)
}

/// Compares all 33³ samples of a brick, the apron included, and returns how many that were.
pub fn compare_brick(oracle: &Oracle, key: NodeKey, brick: &Brick) -> usize {
    for k in 0..BRICK_POINTS {
        for j in 0..BRICK_POINTS {
            let row = oracle.row(position(key, [0, j, k]));
            for i in 0..BRICK_POINTS {
                let p = position(key, [i, j, k]);
                assert_eq!(i64::from(brick.sample([i, j, k])), row(p), "{key} sample {i} {j} {k} at {p:?}");
            }
        }
    }
    BRICK_POINTS.pow(3)
}

/// The leaf at a position, and its brick.
pub fn leaf_at(tree: &MemoryTree, p: [i32; 3]) -> (NodeKey, Arc<Brick>) {
    let mut key = NodeKey::ROOT;
    while !tree.node(key).unwrap_or_else(|| panic!("{key} is missing")).leaf {
        let level = key.level() + 1;
        key = NodeKey::new(level, p.map(|c| (c >> (ROOT_BITS - u32::from(level))) as u32)).expect("inside");
    }
    (key, tree.brick(key).expect("in memory"))
}

/// The tree's answer at a position of the lattice of `depth`, its deepest. `None` in a coarser leaf that is
/// not uniform.
pub fn value_at(tree: &MemoryTree, depth: u8, p: [i32; 3]) -> Option<i16> {
    let (key, brick) = leaf_at(tree, p);
    match &*brick {
        Brick::Uniform(w) => Some(*w),
        _ if key.level() < depth => None,
        brick => {
            let base = key.base();
            let ijk = std::array::from_fn(|a| ((p[a] - base[a]) >> key.spacing_bits()) as usize);
            assert_eq!(position(key, ijk), p);
            Some(brick.sample(ijk))
        }
    }
}

/// A random sample of the lattice of `level` inside the brick `key`.
pub fn random_sample(rng: &mut Rng, key: NodeKey, level: u8) -> [i32; 3] {
    let across = (BRICK_CELLS as u32) << (level - key.level());
    let bits = brickfield_engine::lattice::spacing_bits(level);
    key.base().map(|b| b + ((rng.below(across) as i32) << bits) + 1)
}

/// All nodes in key order: key, leaf or not, brick.
pub fn nodes(tree: &MemoryTree) -> Vec<(NodeKey, bool, Arc<Brick>)> {
    let node = |key| (key, tree.node(key).expect("listed").leaf, tree.brick(key).expect("in memory"));
    tree.keys().into_iter().map(node).collect()
}

/// A sample of a brick of a tree.
pub struct RandomSample {
    pub key: NodeKey,
    pub ijk: [usize; 3],
    /// Its lattice position.
    pub at: [i32; 3],
    pub value: f64,
}

/// Random samples of random bricks, but for those on faces of the root, where all is outside, and on facets, where the field
/// jumps.
pub fn random_samples(tree: &MemoryTree, oracle: &Oracle, count: usize, seed: u64) -> Vec<RandomSample> {
    let (nodes, mut rng) = (nodes(tree), Rng::new(seed));
    let mut samples = Vec::new();
    for _ in 0..count {
        let (key, _, brick) = &nodes[rng.below(nodes.len() as u32) as usize];
        let ijk: [usize; 3] = std::array::from_fn(|_| rng.below(BRICK_POINTS as u32) as usize);
        let at = position(*key, ijk);
        if !on_root_face(at) && !oracle.may_lie_on_a_facet(at) {
            samples.push(RandomSample { key: *key, ijk, at, value: brick.value(ijk) });
        }
    }
    samples
}

/// Whether a lattice position lies on one of the root's own faces.
pub fn on_root_face(p: [i32; 3]) -> bool {
    p.iter().any(|&c| c == 1 || c == (1 << ROOT_BITS) + 1)
}

/// All samples at one position are the same, whatever brick holds them.
pub fn assert_positions_agree(tree: &MemoryTree) {
    let mut seen: HashMap<[i32; 3], f64> = HashMap::new();
    for (key, _, brick) in nodes(tree) {
        for row in 0..BRICK_POINTS * BRICK_POINTS {
            let (j, k) = (row % BRICK_POINTS, row / BRICK_POINTS);
            // All of the border, every fourth inside.
            let step = if [0, 32].contains(&j) || [0, 32].contains(&k) { 1 } else { 4 };
            for i in (0..BRICK_POINTS).step_by(step) {
                let (p, w) = (position(key, [i, j, k]), brick.value([i, j, k]));
                assert_eq!(*seen.entry(p).or_insert(w), w, "{key} {i} {j} {k}");
            }
        }
    }
}
