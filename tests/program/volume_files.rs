//! Volumes in the files of other tools, read by readers that share nothing with the writers.

pub(super) mod readers;

use super::distance::stl_of;
use crate::support::*;
use brickfield_bench_data::{Mesh, shapes};
use brickfield_core::sweep::part_or_all;
use readers::{Samples, numbers, vdb, vti, vtkhdf, zarr};
use serde_json::Value;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// A store whose leaves end at several levels.
fn mixed_levels(dir: &Scratch) -> PathBuf {
    let mut facets = cuboid([0.0; 3], [10.0; 3]);
    facets.extend(cuboid([17.0; 3], [19.0; 3]));
    let input = dir.file("boxes.stl", binary_stl(24, &facets));
    let store = dir.path("mixed.brf");
    run(&[&"build", &input, &"-o", &store, &"--depth", &"2", &"--refine", &"stddev", &"--stddev", &"0.2"])
        .ok();
    store
}

/// An open store: a cube without its last facet.
fn open(dir: &Scratch) -> PathBuf {
    let mut facets = cuboid([0.0; 3], [10.0; 3]);
    facets.pop();
    let input = dir.file("open.stl", binary_stl(facets.len() as u32, &facets));
    let store = dir.path("open.brf");
    run(&[&"build", &input, &"-o", &store, &"--depth", &"1"]).ok();
    store
}

fn array(dir: &Scratch, store: &Path, level: usize, dtype: &str) -> Vec<f32> {
    let out = dir.path("truth.npy");
    run(&[&"export", &store, &"--level", &level.to_string(), &"--dtype", &dtype, &"-o", &out]).ok();
    let array = Array::read(&out);
    let axis = array.axis;
    (0..axis.pow(3)).map(|n| array.at([n % axis, n / axis % axis, n / axis / axis]) as f32).collect()
}

fn export(dir: &Scratch, store: &Path, name: &str, more: &[&str]) -> PathBuf {
    let out = dir.path(name);
    let mut args: Vec<&dyn AsRef<std::ffi::OsStr>> = vec![&"export", &store, &"-o", &out];
    args.extend(more.iter().map(|arg| arg as &dyn AsRef<std::ffi::OsStr>));
    run(&args).ok();
    out
}

/// All formats of a store of `deepest` levels below the root hold what the array holds.
fn all_formats_agree(dir: &Scratch, store: &Path, deepest: usize, kind: &str) {
    let axis = 32 << deepest;
    let truth = array(dir, store, deepest, kind);
    let more = ["--dtype", kind];
    let check = |samples: Samples, format: &str| {
        assert_eq!(samples.axis, axis);
        assert!(samples.values == truth, "{format} of {}", store.display());
    };
    check(vti(&export(dir, store, "w.vti", &more), axis, kind), "vti");
    check(zarr(&export(dir, store, "w.zarr", &more).join("0"), axis, kind), "zarr");
    let axes = (0..=deepest).rev().map(|level| 32 << level).collect::<Vec<_>>();
    let grids = vdb(&export(dir, store, "w.vdb", &[&more[..], &["--all-levels"]].concat()), &axes);
    for (n, (name, tree, samples)) in grids.into_iter().enumerate() {
        assert_eq!(name, if n == 0 { "w".to_owned() } else { format!("w_{n}") });
        assert_eq!(tree, if kind == "f4" { "Tree_float_5_4_3" } else { "Tree_int32_5_4_3" });
        assert!(samples.values == array(dir, store, deepest - n, kind), "grid {name} of {}", store.display());
    }
    let bytes = truth.len() * if kind == "i2" { 2 } else { 4 };
    let raw = std::fs::read(export(dir, store, "w.raw", &more)).unwrap();
    assert!(numbers(&raw, kind) == truth);
    let mha = std::fs::read(export(dir, store, "w.mha", &more)).unwrap();
    assert!(mha[mha.len() - bytes..] == raw, "mha");
    assert!(mha[..mha.len() - bytes].ends_with(b"ElementDataFile = LOCAL\n"));
    export(dir, store, "m.mhd", &more);
    assert!(std::fs::read(dir.path("m.raw")).unwrap() == raw, "mhd");
    let tif = std::fs::read(export(dir, store, "w.tif", &more)).unwrap();
    assert_eq!(&tif[..4], b"II\x2a\0");
    let pages = u32::from_le_bytes(tif[4..8].try_into().unwrap()) as usize;
    assert!(tif[pages - bytes..pages] == raw, "tif");
    blocks_agree(dir, store, deepest, kind);
}

/// The blocks of all levels hold what arrays hold, and their cells the means of their corners.
fn blocks_agree(dir: &Scratch, store: &Path, deepest: usize, kind: &str) {
    let path = export(dir, store, "w.vtkhdf", &["--dtype", kind]);
    for level in 0..=deepest {
        let (axis, truth) = (32 << level, array(dir, store, level, kind));
        let blocks = vtkhdf(&path, level, kind);
        assert!(!blocks.is_empty());
        for (corner, points, cells) in blocks {
            let mut seen = 0;
            for (n, &point) in points.iter().enumerate() {
                let within = [n % 33, n / 33 % 33, n / 33 / 33];
                let at: [usize; 3] = std::array::from_fn(|a| corner[a] + within[a]);
                // On the upper faces the array may have what is between samples of a coarser leaf.
                if within.iter().all(|&i| i < 32) {
                    assert_eq!(
                        point,
                        truth[(at[2] * axis + at[1]) * axis + at[0]],
                        "level {level} at {at:?}"
                    );
                    seen += 1;
                }
            }
            assert_eq!(seen, 32 * 32 * 32);
            for (n, &cell) in cells.iter().enumerate() {
                let first = ((n / 1024) * 33 + n / 32 % 32) * 33 + n % 32;
                let corners = [0, 1, 33, 34, 1089, 1090, 1122, 1123].map(|c| points[first + c]);
                assert_eq!(cell, corners.iter().sum::<f32>() / 8.0);
            }
        }
    }
}

#[test]
fn every_format_holds_the_samples() {
    let dir = Scratch::new();
    all_formats_agree(&dir, &dir.store("clover_beads", 2), 2, "i2");
    all_formats_agree(&dir, &dir.store("overlap_boxes", 3), 3, "f4");
}

#[test]
fn coarser_leaves_fill_every_format() {
    let dir = Scratch::new();
    let store = mixed_levels(&dir);
    // Blocks of a level are those of its nodes; where a coarser leaf ends above, there is none.
    all_formats_agree(&dir, &store, 2, "f4");
    all_formats_agree(&dir, &store, 2, "i2");
    let alone = vtkhdf(&export(&dir, &store, "l.vtkhdf", &["--level", "2", "--dtype", "f4"]), 0, "f4");
    let truth = array(&dir, &store, 2, "f4");
    let filled =
        alone.iter().map(|(_, points, _)| points.iter().filter(|w| **w != 0.0).count()).sum::<usize>();
    assert!(filled >= truth.iter().filter(|w| **w != 0.0).count());
}

#[test]
fn fractions_are_kept() {
    let dir = Scratch::new();
    let store = open(&dir);
    all_formats_agree(&dir, &store, 1, "f4");
    // Fractions are written as floats without being asked for.
    let [(_, kind, samples)] = &vdb(&export(&dir, &store, "o.vdb", &[]), &[64])[..] else {
        panic!("one grid")
    };
    assert_eq!(kind, "Tree_float_5_4_3");
    assert!(samples.values.iter().any(|w| w.fract() != 0.0));
}

/// Names and bytes of a file, or of all files in a folder.
fn contents(path: &Path) -> BTreeMap<PathBuf, Vec<u8>> {
    let mut all = BTreeMap::new();
    let mut waiting = vec![path.to_owned()];
    while let Some(next) = waiting.pop() {
        match std::fs::read_dir(&next) {
            Ok(entries) => waiting.extend(entries.map(|entry| entry.unwrap().path())),
            Err(_) => {
                all.insert(next.strip_prefix(path).unwrap().to_owned(), std::fs::read(&next).unwrap());
            }
        }
    }
    all
}

/// The distance of a point from a shape about the origin, below 0 inside.
type Distance<'a> = &'a dyn Fn([f64; 3]) -> f64;

/// Exports a mesh as distances and compares them with a formula, in three formats that agree.
fn distances_are(dir: &Scratch, mesh: &Mesh, cell: &str, truth: Distance<'_>) {
    let (input, store) = (stl_of(dir, "m.stl", mesh), dir.path("m.brf"));
    run(&[&"build", &input, &"-o", &store, &"--cell", &cell, &"-q"]).ok();
    for back in [0, 1] {
        let depth = run(&[&"info", &store, &"--json"]).json()["depth"].as_u64().unwrap();
        let level = (depth - back).to_string();
        let more = ["--as", "sdf", "--level", &level];
        let bytes = std::fs::read(export(dir, &store, "d.npy", &more)).unwrap();
        let told: Value = serde_json::from_slice(&std::fs::read(dir.path("d.json")).unwrap()).unwrap();
        let origin: [f64; 3] = std::array::from_fn(|a| told["origin"][a].as_f64().unwrap());
        let (axis, step) = (32usize << (depth - back), told["spacing"].as_f64().unwrap());
        let values = numbers(&bytes[bytes.len() - 4 * axis.pow(3)..], "f4");
        let finest = step / f64::from(1u32 << back);
        let mut near = 0;
        for (n, value) in values.iter().enumerate() {
            let ijk = [n % axis, n / axis % axis, n / axis / axis];
            let exact = truth(std::array::from_fn(|a| origin[a] + step * ijk[a] as f64));
            let expected = exact.clamp(-3.0 * step, 3.0 * step);
            assert!((f64::from(*value) - expected).abs() <= 0.05 * finest, "{value} for {exact} at {ijk:?}");
            assert!(exact.abs() < 0.05 * finest || (*value < 0.0) == (exact < 0.0), "{value} for {exact}");
            near += usize::from(exact.abs() < 2.0 * step);
        }
        assert!(near > 500, "{near}");
        let grids = vdb(&export(dir, &store, "d.vdb", &more), &[axis]);
        assert_eq!(grids[0].0, "distance");
        assert!(grids[0].2.values == values, "vdb");
        assert!(zarr(&export(dir, &store, "d.zarr", &more).join("0"), axis, "f4").values == values, "zarr");
        assert!(vti(&export(dir, &store, "d.vti", &more), axis, "f4").values == values, "vti");
    }
}

#[test]
fn distances_are_those_of_balls_tori_and_boxes() {
    let dir = Scratch::new();
    let length = |p: [f64; 3]| (p[0] * p[0] + p[1] * p[1] + p[2] * p[2]).sqrt();
    distances_are(&dir, &shapes::icosphere(6, 5.0), "0.3", &|p| length(p) - 5.0);
    let ring = |p: [f64; 3]| length([p[0].hypot(p[1]) - 6.0, p[2], 0.0]) - 2.0;
    distances_are(&dir, &shapes::torus(6.0, 2.0, 800, 300), "0.4", &ring);
    let (axis, angle, half) = ([1.0, 2.0, 3.0], 0.7, [6.0, 4.0, 5.0]);
    let turned = shapes::cuboid(half.map(|h| -h), half).rotated(axis, angle);
    let units = vec![[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    let axes = Mesh { vertices: units, triangles: Vec::new() }.rotated(axis, angle).vertices;
    distances_are(&dir, &turned, "0.4", &|p| {
        let off: [f64; 3] =
            std::array::from_fn(|a| (0..3).map(|n| axes[a][n] * p[n]).sum::<f64>().abs() - half[a]);
        length(off.map(|c| c.max(0.0))) + off.into_iter().fold(f64::NEG_INFINITY, f64::max).min(0.0)
    });
}

#[test]
fn what_has_no_distances_is_told() {
    let dir = Scratch::new();
    let (store, open) = (dir.store("overlap_boxes", 1), open(&dir));
    let sdf = |store: &Path, name: &str, more: &str| {
        run(&[&"export", &store, &"--as", &"sdf", &"-o", &dir.path(name), &more])
    };
    assert!(sdf(&store, "d.vtkhdf", "-q").misused().contains("holds no distances"));
    assert!(sdf(&store, "d.vdb", "--dtype=i2").misused().contains("no integers"));
    assert!(sdf(&store, "d.vdb", "--all-levels").misused().contains("one level"));
    let line = sdf(&open, "d.vdb", "-q").failed();
    assert!(line.contains("open input") && !dir.path("d.vdb").exists(), "{line}");
}

#[test]
fn threads_change_no_byte() {
    let dir = Scratch::new();
    let store = dir.store("clover_beads", 2);
    for ending in ["vdb", "vtkhdf", "zarr", "vti", "tif"] {
        let [one, two, three] = ["1", "2", "3"].map(|threads| {
            contents(&export(&dir, &store, &format!("{threads}.{ending}"), &["--threads", threads]))
        });
        assert!(one == two && two == three, "{ending}");
    }
    // Distances take seconds.
    let store = dir.store("clover_beads", part_or_all(1, 2));
    let [one, two] = ["1", "2"]
        .map(|threads| contents(&export(&dir, &store, "d.vdb", &["--as", "sdf", "--threads", threads])));
    assert!(one == two);
}

#[test]
fn a_folder_replaces_an_older_one_and_never_a_file() {
    let dir = Scratch::new();
    let (fine, coarse) = (dir.store("overlap_boxes", 2), dir.store("overlap_boxes", 1));
    export(&dir, &fine, "w.zarr", &[]);
    std::fs::create_dir(dir.path("w.zarr.part")).unwrap();
    let out = export(&dir, &coarse, "w.zarr", &[]);
    assert!(out.join("1/zarr.json").exists() && !out.join("2").exists());
    assert!(!dir.path("w.zarr.part").exists());
    // A slash behind the name, as shells complete it, is no part of it.
    export(&dir, &coarse, "w.zarr/", &[]);
    for (holder, mine) in [("others.zarr", "labels"), ("w.zarr", "notes.txt")] {
        std::fs::create_dir_all(dir.path(holder).join(mine)).unwrap();
        let before = dir.path(holder).join("0").exists();
        let line = run(&[&"export", &fine, &"-o", &dir.path(holder)]).failed();
        assert!(line.contains(&format!("it holds {mine}")), "{line}");
        assert_eq!(
            (dir.path(holder).join(mine).exists(), dir.path(holder).join("0").exists()),
            (true, before)
        );
    }
    std::fs::write(dir.path("plain.zarr"), "mine").unwrap();
    let line = run(&[&"export", &coarse, &"-o", &dir.path("plain.zarr")]).failed();
    assert!(line.contains("plain.zarr"), "{line}");
    assert_eq!(std::fs::read(dir.path("plain.zarr")).unwrap(), b"mine");
}

/// What lies beside an array may be of another one that had its name.
#[test]
fn descriptions_of_other_arrays_are_noticed() {
    let dir = Scratch::new();
    let (one, other) = (dir.store("overlap_boxes", 1), dir.store("clover_beads", 1));
    let refused = |name: &str, why: &str| {
        for command in [&[&"info" as &dyn AsRef<std::ffi::OsStr>][..], &[&"build", &"-o", &dir.path("o.brf")]]
        {
            let line = run(&[command, &[&dir.path(name)]].concat()).failed();
            assert!(line.contains(why), "{line}");
        }
    };
    export(&dir, &one, "d.raw", &[]);
    run(&[&"info", &dir.path("d.raw")]).ok();
    export(&dir, &other, "d.mhd", &[]);
    refused("d.raw", "tell different things");
    refused("d.mhd", "tell different things");
    std::fs::remove_file(dir.path("d.json")).unwrap();
    run(&[&"info", &dir.path("d.mhd")]).ok();
    export(&dir, &one, "g.npy", &[]);
    export(&dir, &other, "g.raw", &[]);
    refused("g.npy", "it is of g.raw");
    export(&dir, &one, "f.npy", &["--dtype", "f4"]);
    export(&dir, &one, "i.npy", &["--dtype", "i2"]);
    std::fs::copy(dir.path("i.json"), dir.path("f.json")).unwrap();
    refused("f.npy", "<f4");
    let line = run(&[&"export", &one, &"-o", &dir.path(" lead.mhd")]).failed();
    assert!(line.contains("no plain line of text"), "{line}");
}

#[test]
fn what_cannot_be_written_is_told_in_one_line() {
    let dir = Scratch::new();
    let store = dir.store("overlap_boxes", 1);
    let line = run(&[&"export", &store, &"-o", &dir.path("w.nii")]).misused();
    assert!(line.contains(".vdb") && line.contains(".zarr"), "{line}");
    let line = run(&[&"export", &store, &"-o", &dir.path("w.vti"), &"--all-levels"]).misused();
    assert!(line.contains("holds one level"), "{line}");
    for ending in ["vdb", "vtkhdf", "zarr", "vti", "mhd", "mha", "tif", "raw", "npy"] {
        let line = run(&[&"export", &store, &"-o", &dir.path(&format!("nowhere/w.{ending}"))]).failed();
        assert!(line.contains("nowhere"), "{ending}: {line}");
    }
    assert_eq!(dir.names(), ["overlap_boxes-1.brf"]);
}
