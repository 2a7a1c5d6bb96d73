//! Builds within little memory: the same bytes as with much, whatever was packed, written to disk, or split.

use brickfield_core::sweep::part_or_all;
use brickfield_engine::Silent;
use brickfield_engine::bead::SweepOptions;
use brickfield_engine::build::{BuildOptions, BuildSummary, Resolution, Resources, build_opened};
use brickfield_engine::ingest::{Input, OpenOptions};
use std::path::{Path, PathBuf};

fn data(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../bench-data").join(name)
}

/// A toolpath as swept triangles, or a mesh.
fn open(name: &str) -> Input {
    let mut options = OpenOptions::default();
    options.sweep = SweepOptions { sides: 8, ..options.sweep };
    Input::open_with(&data(name), &options, &Silent).unwrap_or_else(|e| panic!("{e}"))
}

/// Builds on some threads within some bytes and returns the store's.
fn build(input: &Input, depth: u8, threads: usize, memory: u64) -> (Vec<u8>, BuildSummary) {
    let directory = tempfile::tempdir().unwrap();
    let out = directory.path().join("part.brf");
    let options = BuildOptions {
        resolution: Resolution::Depth(depth),
        resources: Resources { memory, ..Resources::default() },
        ..BuildOptions::default()
    };
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
    let summary =
        pool.install(|| build_opened(std::slice::from_ref(input), &out, &options, &Silent)).unwrap();
    let bytes = std::fs::read(&out).unwrap();
    assert_eq!(std::fs::read_dir(directory.path()).unwrap().count(), 1);
    (bytes, summary)
}

#[test]
fn an_index_that_outgrows_its_memory_ends_a_build_that_goes_on_with_more() {
    let input = open("stl/clover_beads.stl");
    let expected = build(&input, 4, 2, u64::MAX).0;
    let directory = tempfile::tempdir().unwrap();
    let out = directory.path().join("part.brf");
    let within = |index: u64| {
        let options = BuildOptions {
            resolution: Resolution::Depth(4),
            resources: Resources { index, ..Resources::default() },
            ..BuildOptions::default()
        };
        build_opened(std::slice::from_ref(&input), &out, &options, &Silent)
    };
    let error = within(20 << 10).unwrap_err().to_string();
    assert!(error.contains("nodes has outgrown the 20 KiB") && error.contains("`memory`"), "{error}");
    assert!(!out.exists());
    // Further, then to the end.
    let nodes = |error: &str| -> u64 {
        let words: Vec<&str> = error.split(' ').collect();
        words[words.iter().position(|word| *word == "nodes").unwrap() - 1].parse().unwrap()
    };
    let again = within(60 << 10).unwrap_err().to_string();
    assert!(0 < nodes(&error) && nodes(&error) < nodes(&again), "{error}, {again}");
    within(u64::MAX).unwrap();
    assert!(std::fs::read(&out).unwrap() == expected);
    assert_eq!(std::fs::read_dir(directory.path()).unwrap().count(), 1);
}

#[test]
fn stores_do_not_depend_on_memory() {
    let part = [("clover.gcode", 3), ("stl/clover_beads.stl", 3), ("gcode/nonplanar.gcode", 4)];
    let beads = ("stl/clover_beads.stl", 4);
    let all = [("clover.gcode", 3), ("clover.gcode", 5), beads, ("gcode/nonplanar.gcode", 6)];
    for &(name, depth) in part_or_all(&part[..], &all) {
        let input = open(name);
        let (expected, plain) = build(&input, depth, 2, u64::MAX);
        assert_eq!(plain.temporary_bytes, 0);
        // With the least, everything is on disk, and every leaf a job of its own.
        let bounds = [(1, 8 << 20), (2, 2 << 20), (3, 1 << 20), (2, 1 << 16)];
        for &(threads, memory) in part_or_all(&bounds[2..], &bounds) {
            let (bytes, summary) = build(&input, depth, threads, memory);
            assert!(bytes == expected, "{name}, depth {depth}, {threads} threads, {memory} bytes");
            assert!(summary.temporary_bytes > 0 || memory > 1 << 16, "{name}, depth {depth}");
        }
    }
}
