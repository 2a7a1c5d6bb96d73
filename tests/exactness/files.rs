//! The STL files of the test data: every sample at depth 1, random ones at depth 4.

use crate::oracle::Oracle;
use crate::scene::{Scene, compare_brick, nodes, random_sample, value_at};
use brickfield_bench_data::Rng;
use brickfield_core::sweep::part_or_all;
use brickfield_engine::Silent;
use brickfield_engine::brick::Brick;
use brickfield_engine::ingest::Input;
use brickfield_engine::lattice::{NodeKey, RootCube};
use std::collections::HashMap;
use std::path::{Path, PathBuf};

/// Files that are no closed soup: one lacks facets, one has coordinates that are no numbers, one ends early.
const NOT_CLOSED: [&str; 3] = ["open_box_no_lid.stl", "degenerate_mix.stl", "truncated.stl"];

fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../bench-data/stl")
}

/// Through the engine's reader, in the root cube that a build would choose.
fn read(path: &Path) -> Scene {
    let input = Input::open(path, &Silent).unwrap_or_else(|e| panic!("{e}"));
    let (min, max) = input.bounds(&Silent).unwrap_or_else(|e| panic!("{e}"));
    let mut soup = Vec::new();
    input.read(0..input.facets(), &mut soup);
    Scene { soup, root: RootCube::around(min, max).expect("an extent") }
}

/// Whether every directed edge has its reverse, counted the plain way.
pub fn is_closed(oracle: &Oracle) -> bool {
    let mut surplus: HashMap<([i32; 3], [i32; 3]), i64> = HashMap::new();
    for t in &oracle.facets {
        for i in 0..3 {
            let (a, b) = (t[i], t[(i + 1) % 3]);
            *surplus.entry((a.min(b), a.max(b))).or_default() += if a < b { 1 } else { -1 };
        }
    }
    surplus.iter().all(|((a, b), s)| a == b || *s == 0)
}

fn compare_file(path: &Path) {
    let scene = read(path);
    let oracle = scene.oracle();
    assert!(is_closed(&oracle), "{}", path.display());
    let mut rng = Rng::new(0xf11e);
    let compared: usize =
        nodes(&scene.at_depth(1)).iter().map(|(key, _, brick)| compare_brick(&oracle, *key, brick)).sum();
    assert!(compared >= 64 * 64 * 64);
    let deep = scene.at_depth(4);
    let busy: Vec<NodeKey> = nodes(&deep)
        .iter()
        .filter(|(key, _, brick)| key.level() == 4 && matches!(**brick, Brick::Counts { .. }))
        .map(|(key, ..)| *key)
        .collect();
    // Random samples at depth 4, on top of as many from bricks that hold facets; and facets times samples that the solid
    // angles of one file may cost.
    let [random, angles] = part_or_all([2_000, 2_000_000], [10_000, 8_000_000]);
    let some_brick = |rng: &mut Rng| busy[rng.below(busy.len() as u32) as usize];
    for n in 0..2 * random {
        let key = if n % 2 == 0 { NodeKey::ROOT } else { some_brick(&mut rng) };
        let p = random_sample(&mut rng, key, 4);
        let w = value_at(&deep, 4, p).expect("the default refinement leaves no coarse leaf that varies");
        assert_eq!(i64::from(w), oracle.at(p), "{} at {p:?}", path.display());
        if n < 2 * angles / oracle.facets.len() && n < 4_000 && !oracle.may_lie_on_a_facet(p) {
            let sum = oracle.solid_angles(p);
            assert!((sum - f64::from(w)).abs() < 1e-6, "{} at {p:?}: {sum}, {w}", path.display());
            assert!(n >= 400 || oracle.at_without_index(p) == i64::from(w));
        }
    }
}

#[test]
fn every_closed_file_is_sampled_exactly() {
    let mut compared = Vec::new();
    for entry in std::fs::read_dir(folder()).expect("the test data") {
        let path = entry.expect("an entry").path();
        let name = path.file_name().expect("a file").to_str().expect("UTF-8").to_owned();
        // The largest file has a test of its own, beside this one.
        let wanted = name.ends_with(".stl") && name != "clover_beads.stl";
        if wanted && !NOT_CLOSED.contains(&name.as_str()) {
            compare_file(&path);
            compared.push(name);
        }
    }
    assert!(compared.len() == 11, "{compared:?}");
}

/// 111,960 facets. The index by rows makes the exact count cheap enough for all samples here, too; the solid
/// angles are summed at some 140.
#[test]
fn the_clover_of_beads_is_sampled_exactly() {
    compare_file(&folder().join("clover_beads.stl"));
}

#[test]
fn files_that_are_not_closed_are_refused() {
    let scene = read(&folder().join(NOT_CLOSED[0]));
    assert!(!is_closed(&scene.oracle()));
    let error = scene.try_build(Default::default()).err().expect("it has no lid").to_string();
    assert!(error.contains("open edges"), "{error}");
    let input = Input::open(&folder().join(NOT_CLOSED[1]), &Silent).expect("the file itself is sound");
    let error = input.bounds(&Silent).expect_err("it has a NaN").to_string();
    assert!(error.contains("facet 15"), "{error}");
    assert!(Input::open(&folder().join(NOT_CLOSED[2]), &Silent).is_err());
}
