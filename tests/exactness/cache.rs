//! Stores of random piles written anew, cut down and compared.

use crate::scene::pile_as_stl;
use brickfield_bench_data::shapes::icosphere;
use brickfield_bench_data::write;
use brickfield_core::sweep::part_or_all;
use brickfield_engine::analysis::sample_at;
use brickfield_engine::brick::{Brick, SignChanges};
use brickfield_engine::build::{BuildOptions, Resolution, build};
use brickfield_engine::cache::{
    Comparison, PruneOptions, PruneRegion, RecordOrder, compact, compare, corners, meets_box, prune, reorder,
    repack,
};
use brickfield_engine::contour::{ContourOptions, contour, create_sink};
use brickfield_engine::lattice::NodeKey;
use brickfield_engine::store::{BrickTree, Compression, Refine, Store, StoreWriter};
use brickfield_engine::{Result, Silent};
use proptest::prelude::*;
use std::path::Path;

/// What samples of open piles may be off by.
const ERROR: f64 = 1e-2;

/// A folder with the store of a random pile.
struct Scene {
    dir: tempfile::TempDir,
    options: BuildOptions,
}

impl Scene {
    fn new(seed: u64, pieces: usize, is_open: bool, depth: u8, refine: Refine) -> Scene {
        let dir = tempfile::tempdir().unwrap();
        std::fs::write(dir.path().join("in.stl"), pile_as_stl(seed, pieces, is_open)).unwrap();
        let resolution = Resolution::Depth(depth);
        let options = BuildOptions { resolution, refine, gwn_error: ERROR, ..BuildOptions::default() };
        let scene = Scene { dir, options };
        scene.build("whole", depth);
        scene
    }

    fn build(&self, name: &str, depth: u8) -> Store {
        let options = BuildOptions { resolution: Resolution::Depth(depth), ..self.options.clone() };
        let input = self.dir.path().join("in.stl");
        build(&[input], &self.path(name), &options, &Silent).unwrap_or_else(|e| panic!("{e}"));
        self.open(name)
    }

    fn path(&self, name: &str) -> std::path::PathBuf {
        self.dir.path().join(name)
    }

    fn open(&self, name: &str) -> Store {
        Store::open(&self.path(name), 64 << 20).unwrap_or_else(|e| panic!("{e}"))
    }

    fn bytes(&self, name: &str) -> Vec<u8> {
        std::fs::read(self.path(name)).unwrap()
    }

    /// The store cut down to a level, and how a build of that depth differs from it.
    fn pruned_and_built(&self, level: u8) -> (Store, Comparison) {
        let pruned = self.prune(&PruneOptions { level: Some(level), ..PruneOptions::default() });
        let found = difference(&pruned, &self.build("coarse", level));
        (pruned, found)
    }

    /// The store of this name cut down, which must be sound.
    fn prune(&self, options: &PruneOptions) -> Store {
        let whole = self.open("whole");
        let summary = prune(&whole, &self.path("pruned"), options, &Silent).unwrap_or_else(|e| panic!("{e}"));
        let pruned = self.open("pruned");
        assert_eq!(pruned.verify(&Silent).unwrap().first_damage, None);
        assert_eq!((summary.nodes, summary.nodes_before), (nodes(&pruned), nodes(&whole)));
        pruned
    }
}

fn nodes(store: &Store) -> u64 {
    store.entries().len() as u64
}

fn mesh(store: &Store, level: Option<u8>, path: &Path) -> Vec<u8> {
    let mut sink = create_sink(path, None).unwrap();
    let options = ContourOptions { level, ..ContourOptions::default() };
    contour(store, &options, &mut *sink, &Silent).unwrap_or_else(|e| panic!("{e}"));
    std::fs::read(path).unwrap()
}

fn difference(a: &Store, b: &Store) -> Comparison {
    compare(a, b, &Silent).unwrap()
}

/// Appends the records in another order.
fn shuffled(store: &Store, path: &Path) -> Result<()> {
    let mut writer = StoreWriter::create(path, store.meta())?;
    let mut payload = Vec::new();
    for entry in store.entries() {
        store.read_payload(entry, &mut payload)?;
        writer.append(entry.key, entry.leaf, entry.head, &payload)?;
    }
    writer.finish(store.meta().clone()).map(drop)
}

/// Points all over the root, some of them close to samples.
fn points(store: &Store, seed: u64) -> Vec<[f64; 3]> {
    let root = store.meta().root;
    let mut state = seed;
    let mut fraction = || {
        state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        (state >> 33) as f64 / f64::from(1u32 << 31)
    };
    (0..2000).map(|_| [0, 1, 2].map(|a| root.origin[a] + fraction() * root.edge)).collect()
}

/// By which expansion a sample of an open mesh is found depends on the depth of the build, so it may differ by both errors.
#[test]
fn samples_of_an_open_pile_may_depend_on_the_depth() {
    let scene = Scene::new(7837148390391899, 4, true, 2, Refine::Hidden);
    let (_, found) = scene.pruned_and_built(0);
    assert!(found.bricks.samples > 0 && found.bricks.max_difference <= 2.0 * ERROR, "{found:?}");
}

fn refinements() -> impl Strategy<Value = Refine> {
    prop_oneof![2 => Just(Refine::Hidden), 1 => Just(Refine::Surface), 1 => Just(Refine::Stddev)]
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(part_or_all(4, 10)))]

    #[test]
    fn stores_are_written_anew_without_loss(
        seed in any::<u64>(), pieces in 1usize..10, is_open in prop::bool::weighted(0.2), depth in 0u8..5,
        refine in refinements(),
    ) {
        let scene = Scene::new(seed, pieces, is_open, if is_open { depth.min(2) } else { depth }, refine);
        let (whole, built) = (scene.open("whole"), scene.bytes("whole"));
        compact(&whole, &scene.path("compact"), &Silent).unwrap();
        prop_assert!(scene.bytes("compact") == built);
        shuffled(&whole, &scene.path("shuffled")).unwrap();
        compact(&scene.open("shuffled"), &scene.path("shuffled"), &Silent).unwrap();
        prop_assert!(scene.bytes("shuffled") == built);
        reorder(&whole, &scene.path("levels"), RecordOrder::Level, None, &Silent).unwrap();
        let levels = scene.open("levels");
        prop_assert!(difference(&whole, &levels).is_equal(true));
        prop_assert_eq!(levels.verify(&Silent).unwrap().first_damage, None);
        compact(&levels, &scene.path("compact"), &Silent).unwrap();
        prop_assert!(scene.bytes("compact") == built);
        repack(&whole, &scene.path("plain"), Compression::None, &Silent).unwrap();
        let plain = scene.open("plain");
        prop_assert!(difference(&whole, &plain).is_equal(true));
        prop_assert_eq!(plain.verify(&Silent).unwrap().first_damage, None);
        prop_assert!(plain.file_bytes() >= whole.file_bytes());
        repack(&plain, &scene.path("packed"), Compression::Lz4, &Silent).unwrap();
        prop_assert!(scene.bytes("packed") == built);
        repack(&plain, &scene.path("coded"), Compression::Range, &Silent).unwrap();
        let coded = scene.open("coded");
        prop_assert!(difference(&whole, &coded).is_equal(true));
        prop_assert_eq!(coded.verify(&Silent).unwrap().first_damage, None);
        prop_assert!(mesh(&coded, None, &scene.path("coded.ply")) == mesh(&whole, None, &scene.path("whole.ply")));
        repack(&coded, &scene.path("packed"), Compression::Lz4, &Silent).unwrap();
        prop_assert!(scene.bytes("packed") == built);
    }

    #[test]
    fn a_level_is_what_a_build_of_that_depth_has(
        seed in any::<u64>(), pieces in 1usize..10, is_open in prop::bool::weighted(0.2), depth in 1u8..5,
        level in 0u8..4,
    ) {
        let depth = if is_open { depth.min(2) } else { depth };
        let level = level.min(depth);
        let scene = Scene::new(seed, pieces, is_open, depth, Refine::Hidden);
        let (pruned, found) = scene.pruned_and_built(level);
        prop_assert_eq!(&found.metadata, &Vec::new());
        prop_assert!(found.bricks.max_difference <= 2.0 * ERROR);
        if !is_open {
            prop_assert_eq!((found.bricks.samples, found.bricks.signs), (0, 0));
            prop_assert_eq!((found.only_first, found.only_second, found.leaf_in_one), (0, 0, 0));
            let is_equal = scene.bytes("pruned") == scene.bytes("coarse");
            prop_assert_eq!(is_equal, found.bricks.hermite_edges == 0);
        }
        let whole = scene.open("whole");
        let of_whole = mesh(&whole, Some(level), &scene.path("whole.ply"));
        prop_assert!(mesh(&pruned, None, &scene.path("pruned.ply")) == of_whole);
    }

    #[test]
    fn an_error_holds_everywhere(
        seed in any::<u64>(), pieces in 1usize..10, is_open in prop::bool::weighted(0.3), depth in 0u8..4,
        error in prop_oneof![Just(0.0), Just(0.02), Just(0.6), Just(1.3)], refine in refinements(),
    ) {
        let scene = Scene::new(seed, pieces, is_open, if is_open { depth.min(2) } else { depth }, refine);
        let whole = scene.open("whole");
        let pruned = scene.prune(&PruneOptions { error: Some(error), ..PruneOptions::default() });
        let mut points = points(&whole, seed);
        // All samples of some leaves, too.
        for entry in whole.entries().iter().filter(|entry| entry.leaf).step_by(7) {
            let [low, high] = corners(entry.key, &whole.meta().root);
            points.extend((0..99).map(|n| [n % 5, n / 5 % 5, n / 25]).map(|at: [usize; 3]| {
                std::array::from_fn(|a| low[a] + (high[a] - low[a]) * at[a] as f64 / 32.0)
            }));
        }
        let values = sample_at(&whole, &points).unwrap().into_iter().zip(sample_at(&pruned, &points).unwrap());
        for (point, (w, v)) in points.iter().zip(values) {
            prop_assert!((w - v).abs() <= error + 1e-9, "{point:?}: {w} and {v}");
        }
        // What became a leaf could not have become one nearer to the root.
        prop_assert!(nodes(&pruned) <= nodes(&whole));
        if error == 0.0 && refine == Refine::Hidden && !is_open {
            let lost = difference(&whole, &pruned);
            prop_assert_eq!((lost.bricks.samples, lost.only_second), (0, 0));
        }
    }

    #[test]
    fn a_box_stays_as_it_is(
        seed in any::<u64>(), pieces in 1usize..10, depth in 0u8..5, outside_level in 0u8..4,
        from in prop::array::uniform3(-0.2f64..1.0), size in prop::array::uniform3(0.0f64..0.7),
        refine in refinements(),
    ) {
        let scene = Scene::new(seed, pieces, false, depth, refine);
        let whole = scene.open("whole");
        let root = whole.meta().root;
        let min = [0, 1, 2].map(|a| root.origin[a] + root.edge * from[a]);
        let max = [0, 1, 2].map(|a| min[a] + root.edge * size[a]);
        let region = Some(PruneRegion { min, max, outside_level });
        prop_assume!(meets_box(NodeKey::ROOT, &root, [min, max]));
        let pruned = scene.prune(&PruneOptions { region, ..PruneOptions::default() });
        for entry in whole.entries() {
            let is_kept = pruned.entry(entry.key);
            let inside = meets_box(entry.key, &root, [min, max]);
            if inside {
                let kept = is_kept.expect("it meets the box");
                prop_assert_eq!((kept.leaf, kept.head, kept.crc), (entry.leaf, entry.head, entry.crc));
            }
            let above = entry.key.parent().filter(|up| up.level() >= outside_level);
            let is_covered = above.is_some_and(|up| {
                (outside_level..=up.level()).any(|l| !meets_box(up.ancestor(l).unwrap(), &root, [min, max]))
            });
            prop_assert_eq!(is_kept.is_some(), !is_covered, "{}", entry.key);
            if let Some(kept) = is_kept {
                prop_assert_eq!(kept.leaf, entry.leaf || (!inside && entry.key.level() >= outside_level));
            }
        }
        prop_assert!(pruned.meta().program.contains("pruned"));
    }
}

/// Where a finer edge is crossed once, both ways of making a coarse tree agree but for the rounding of places.
#[test]
fn a_convex_part_is_cut_as_it_is_built() {
    let dir = tempfile::tempdir().unwrap();
    let input = dir.path().join("in.stl");
    let mut bytes = Vec::new();
    write::stl(&mut bytes, &icosphere(3, 10.0)).unwrap();
    std::fs::write(&input, bytes).unwrap();
    let store = |name: &str, depth| {
        let path = dir.path().join(name);
        let options = BuildOptions { resolution: Resolution::Depth(depth), ..BuildOptions::default() };
        build(std::slice::from_ref(&input), &path, &options, &Silent).unwrap();
        path
    };
    let whole = Store::open(&store("whole", 4), 0).unwrap();
    for level in 0..4 {
        let pruned = dir.path().join("pruned");
        let options = PruneOptions { level: Some(level), ..PruneOptions::default() };
        prune(&whole, &pruned, &options, &Silent).unwrap();
        let built = store("built", level);
        let found = difference(&Store::open(&pruned, 0).unwrap(), &Store::open(&built, 0).unwrap());
        assert_eq!((found.only_first, found.only_second, found.leaf_in_one), (0, 0, 0));
        let edges = found.bricks;
        assert_eq!((edges.samples, edges.turned_edges, &found.metadata), (0, 0, &Vec::new()));
        assert!(edges.max_move <= 1.0 / 65536.0, "{found:?}");
    }
}

#[test]
fn differences_are_named() {
    let scene = Scene::new(7, 5, false, 2, Refine::Hidden);
    let whole = scene.open("whole");
    let victim = whole.entries().iter().rfind(|entry| entry.head.kind.has_hermite()).expect("a surface").key;
    let mut writer = StoreWriter::create(&scene.path("other"), whole.meta()).unwrap();
    for entry in whole.entries() {
        let mut brick = (*whole.brick(entry.key).unwrap()).clone();
        if let (Brick::Counts { samples, hermite }, true) = (&mut brick, entry.key == victim) {
            let outside = samples.0.iter().position(|&w| w < 1).expect("a sample outside");
            samples.0[outside] -= 3;
            hermite.edges.iter_mut().flatten().next().expect("an edge").offset ^= 1 << 15;
            assert_eq!(SignChanges::of(samples).counts(), hermite.edges.each_ref().map(Vec::len));
        }
        writer.append_brick(entry.key, entry.leaf, &brick).unwrap();
    }
    writer.finish(whole.meta().clone()).unwrap();
    let found = difference(&whole, &scene.open("other"));
    assert!(!found.is_equal(false) && found.metadata.is_empty());
    let bricks = found.bricks;
    assert_eq!((bricks.bricks, bricks.samples, bricks.max_difference, bricks.signs), (1, 1, 3.0, 0));
    assert_eq!((bricks.hermite_bricks, bricks.hermite_edges, bricks.max_move), (1, 1, 0.5));
    assert_eq!(found.first.len(), 1);
    assert_eq!(found.first[0].node, victim.to_string());
    let pruned = scene.prune(&PruneOptions { level: Some(1), ..PruneOptions::default() });
    let found = difference(&whole, &pruned);
    assert_eq!(found.only_first, nodes(&whole) - nodes(&pruned));
    assert_eq!(found.only_second, 0);
    assert!(found.leaf_in_one > 0 && found.metadata.iter().any(|fact| fact.name == "depth"));
    let elsewhere = Scene::new(8, 5, false, 1, Refine::Hidden);
    assert!(!difference(&whole, &elsewhere.open("whole")).is_equal(false));
}

/// Records that are sound each by itself, with checksums that fit, but not together. Where the contradiction is cut off with
/// what is left out, what is left is sound.
#[test]
fn a_tree_that_contradicts_itself_is_refused_or_cut_into_a_sound_one() {
    let scene = Scene::new(7, 5, false, 2, Refine::Hidden);
    let whole = scene.open("whole");
    let leaves: Vec<NodeKey> =
        whole.entries().iter().filter(|entry| entry.head.kind.has_hermite()).map(|entry| entry.key).collect();
    assert!(leaves.len() >= 8);
    let mut refusals = 0;
    for victim in leaves.iter().step_by(leaves.len() / 8) {
        let mut writer = StoreWriter::create(&scene.path("other"), whole.meta()).unwrap();
        for entry in whole.entries() {
            let brick = whole.brick(entry.key).unwrap();
            let inside_out = Brick::Uniform(i16::from(brick.sample([0; 3]) < 1));
            let brick = if entry.key == *victim { &inside_out } else { &*brick };
            writer.append_brick(entry.key, entry.leaf, brick).unwrap();
        }
        writer.finish(whole.meta().clone()).unwrap();
        let other = scene.open("other");
        assert!(other.verify(&Silent).unwrap().damaged > 0);
        let options = PruneOptions { level: Some(0), ..PruneOptions::default() };
        match prune(&other, &scene.path("pruned"), &options, &Silent) {
            Ok(_) => {
                assert_eq!(scene.open("pruned").verify(&Silent).unwrap().first_damage, None);
                std::fs::remove_file(scene.path("pruned")).unwrap();
            }
            Err(refused) => {
                assert!(refused.to_string().contains("contradicts the nodes around it"), "{refused}");
                refusals += 1;
            }
        }
        assert!(!scene.path("pruned").exists());
    }
    assert!(refusals > 0);
}
