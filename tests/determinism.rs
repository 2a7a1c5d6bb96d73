//! The same input gives the same bytes.

use crate::support::*;
use brickfield_engine::store::{BrickTree, Store};
use std::path::{Path, PathBuf};

fn build(dir: &Scratch, input: &Path, threads: &str) -> PathBuf {
    let out = dir.path(&format!("{threads}.brf"));
    run(&[&"build", &input, &"-o", &out, &"--depth", &"4", &"--threads", &threads]).ok();
    out
}

#[test]
fn threads_do_not_show() {
    let dir = Scratch::new();
    let input = stl("featuretype50_model");
    let one = std::fs::read(build(&dir, &input, "1")).unwrap();
    for threads in ["2", "3", "8"] {
        assert!(std::fs::read(build(&dir, &input, threads)).unwrap() == one, "{threads} threads");
    }
    for ending in ["stl", "ply", "obj"] {
        let mesh = |threads: &str| {
            let out = dir.path(&format!("{threads}.{ending}"));
            run(&[&"mesh", &dir.path("1.brf"), &"-o", &out, &"--threads", &threads]).ok();
            std::fs::read(out).unwrap()
        };
        assert!(mesh("1") == mesh("3"), "{ending}");
    }
}

#[test]
fn the_order_of_facets_shows_in_the_identity_only() {
    let dir = Scratch::new();
    let mut facets = facets_of(&stl("clover_model"));
    let plain = dir.file("part.stl", binary_stl(facets.len() as u32, &facets));
    let before = build(&dir, &plain, "2");
    // A permutation, and other first corners.
    let mut seed = 1u64;
    for i in (1..facets.len()).rev() {
        seed = seed.wrapping_mul(0x5851_f42d_4c95_7f2d).wrapping_add(0x1405_7b7e_f767_814f);
        facets.swap(i, (seed >> 33) as usize % (i + 1));
        facets[i].rotate_left((seed >> 20) as usize % 3);
    }
    std::fs::write(&plain, binary_stl(facets.len() as u32, &facets)).unwrap();
    let after = build(&dir, &plain, "3");
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
