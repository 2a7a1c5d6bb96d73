//! The same input gives the same bytes.

use crate::support::*;
use brickfield_core::sweep::part_or_all;
use brickfield_engine::store::{BrickTree, Store};
use std::ffi::OsStr;
use std::path::{Path, PathBuf};

/// Each with every second rule, or with all.
const MODELS: [&str; 2] = ["featuretype50_model", "clover_model"];

/// Rules of refinement.
const RULES: [&[&str]; 5] = [
    &[],
    &["--stddev", "0.1"],
    &["--refine", "surface", "--stddev", "0.1"],
    &["--refine", "stddev", "--stddev", "0.2"],
    &["--tolerance", "0.02mm"],
];

fn build(dir: &Scratch, input: &Path, rule: &[&str], threads: &str) -> PathBuf {
    let out = dir.path(&format!("{threads}.brf"));
    let mut args: Vec<&dyn AsRef<OsStr>> = vec![&"build", &input, &"-o", &out, &"--depth", &"3"];
    args.extend(rule.iter().map(|arg| arg as &dyn AsRef<OsStr>));
    args.extend([&"--threads" as &dyn AsRef<OsStr>, &threads, &"--quiet"]);
    run(&args).ok();
    out
}

/// All that the program makes of a store: meshes, an array, samples.
fn answers(dir: &Scratch, store: &Path, threads: &str) -> Vec<Vec<u8>> {
    let out = |args: &[&dyn AsRef<OsStr>], name: &str| {
        let out = dir.path(name);
        let mut all = args.to_vec();
        all.extend([&store as &dyn AsRef<OsStr>, &"-o", &out, &"--threads", &threads, &"--quiet"]);
        run(&all).ok();
        std::fs::read(out).unwrap()
    };
    let points: String = (0..400).map(|n| format!("{},{},{}\n", n % 40 - 20, n / 20 - 10, n % 7)).collect();
    let points = dir.file("points.csv", points);
    vec![
        out(&[&"mesh"], "mesh.stl"),
        out(&[&"mesh", &"--memory", &"64MB"], "mesh.ply"),
        out(&[&"mesh", &"--level", &"1"], "mesh.obj"),
        out(&[&"export", &"--level", &"1"], "w.npy"),
        run(&[&"sample", &store, &"--points", &points, &"--threads", &threads]).ok().into(),
    ]
}

#[test]
fn threads_do_not_show() {
    for (n, name) in MODELS.into_iter().enumerate() {
        for rule in RULES.into_iter().skip(part_or_all(n, 0)).step_by(part_or_all(2, 1)) {
            let dir = Scratch::new();
            let store = build(&dir, &stl(name), rule, "1");
            let (bytes, one) = (std::fs::read(&store).unwrap(), answers(&dir, &store, "1"));
            for threads in part_or_all(&["3"][..], &["2", "3", "8"]) {
                let other = build(&dir, &stl(name), rule, threads);
                assert!(std::fs::read(&other).unwrap() == bytes, "{name}, {rule:?}, {threads} threads");
                assert!(answers(&dir, &other, threads) == one, "{name}, {rule:?}, {threads} threads");
            }
        }
    }
}

#[test]
fn the_order_of_facets_shows_in_the_identity_only() {
    for (n, name) in MODELS.into_iter().enumerate() {
        for rule in RULES.into_iter().skip(part_or_all(n, 0)).step_by(part_or_all(2, 1)) {
            shuffled(name, rule);
        }
    }
}

fn shuffled(name: &str, rule: &[&str]) {
    let dir = Scratch::new();
    let mut facets = facets_of(&stl(name));
    let part = dir.file("part.stl", binary_stl(facets.len() as u32, &facets));
    let before = build(&dir, &part, rule, "2");
    // A permutation, and other first corners.
    let mut seed = 1u64;
    for i in (1..facets.len()).rev() {
        seed = seed.wrapping_mul(0x5851_f42d_4c95_7f2d).wrapping_add(0x1405_7b7e_f767_814f);
        facets.swap(i, (seed >> 33) as usize % (i + 1));
        facets[i].rotate_left((seed >> 20) as usize % 3);
    }
    std::fs::write(&part, binary_stl(facets.len() as u32, &facets)).unwrap();
    let after = build(&dir, &part, rule, "3");
    assert!(answers(&dir, &before, "2") == answers(&dir, &after, "3"), "{name}, {rule:?}");
    let [before, after] = [before, after].map(|path| Store::open(&path, 1 << 26).unwrap());
    assert_eq!(before.keys(), after.keys());
    for key in before.keys() {
        assert_eq!(before.node(key), after.node(key));
        assert!(before.brick(key).unwrap() == after.brick(key).unwrap(), "{key}");
    }
    let (mut a, mut b) = (before.meta().clone(), after.meta().clone());
    assert_ne!(a.sources[0].blake3, b.sources[0].blake3);
    a.sources[0].blake3 = [0; 32];
    b.sources[0].blake3 = [0; 32];
    assert_eq!(a, b);
}
