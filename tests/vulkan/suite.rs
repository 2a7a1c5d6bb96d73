//! What every backend must do.

use crate::backend::{Backend, options, reference};
use brickfield_bench_data::pile::{lattice_pile, random_pile};
use brickfield_bench_data::shapes::{cuboid, icosphere};
use brickfield_bench_data::{Mesh, write};
use brickfield_engine::Silent;
use brickfield_engine::bead::SweepOptions;
use brickfield_engine::ingest::{Input, OpenOptions};
use std::path::{Path, PathBuf};

fn data(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../bench-data").join(name)
}

/// A mesh, or a toolpath as swept triangles.
pub fn open(path: &Path) -> Input {
    let mut options = OpenOptions::default();
    options.sweep = SweepOptions { sides: 8, ..options.sweep };
    Input::open_with(path, &options, &Silent).unwrap_or_else(|e| panic!("{e}"))
}

/// One of the files in `bench-data`.
pub fn open_data(name: &str) -> Input {
    open(&data(name))
}

/// Pieces as an input; its folder lives as long as it is used.
pub fn input_of(pieces: &[Mesh]) -> (tempfile::TempDir, Input) {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("pieces.stl");
    write::stl(std::fs::File::create(&path).unwrap(), &Mesh::merged(pieces)).unwrap();
    let input = open(&path);
    (directory, input)
}

/// Holds the stores at some depths against the processor's; on a device, all leaves must be its own.
fn same_stores(backend: &Backend, input: &Input, depths: &[u8]) {
    for &depth in depths {
        let (store, summary) = backend.build_with(input, depth, &options(depth));
        let report = summary.device;
        assert!(store == reference(input, depth), "{}, depth {depth}: {report:?}", input.path().display());
        assert_eq!(report.is_some(), backend.device.is_some());
        if let Some(report) = report {
            assert_eq!((report.cpu_bricks, report.failure), (0, None), "depth {depth}");
            assert!(report.bricks > 0 && report.batches > 0);
        }
    }
}

pub fn meshes_give_the_same_store(backend: &Backend) {
    same_stores(backend, &open_data("stl/clover_beads.stl"), &[2, 3, 4]);
    same_stores(backend, &open_data("stl/spot40_model.stl"), &[1, 4, 6]);
    let (_folder, sphere) = input_of(&[icosphere(3, 1.0)]);
    same_stores(backend, &sphere, &[0, 1, 4]);
}

pub fn beads_give_the_same_store(backend: &Backend) {
    for (name, depths) in [("clover.gcode", [2, 3, 4]), ("gcode/nonplanar.gcode", [2, 5, 6])] {
        same_stores(backend, &open_data(name), &depths);
    }
}

pub fn piles_on_the_lattice_give_the_same_store(backend: &Backend) {
    for seed in 0..4 {
        let (_folder, pile) = input_of(&lattice_pile(seed, 12, 1 << 17, 64));
        same_stores(backend, &pile, &[0, 2, 3]);
    }
}

pub fn any_triangles_give_the_same_store(backend: &Backend) {
    for seed in 0..4 {
        let (_folder, pile) = input_of(&random_pile(seed, 20));
        same_stores(backend, &pile, &[0, 2, 4]);
    }
    // Many shells over each other.
    let nested: Vec<Mesh> =
        (1..40).map(|i| cuboid([-0.1 * f64::from(i); 3], [0.07 * f64::from(i); 3])).collect();
    let (_folder, nested) = input_of(&nested);
    same_stores(backend, &nested, &[0, 1, 3]);
}
