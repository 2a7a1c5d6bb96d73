//! What every backend must do.

use crate::backend::{Backend, options, reference, reference_with};
use brickfield_bench_data::pile::{lattice_pile, random_pile};
use brickfield_bench_data::shapes::{cuboid, icosphere};
use brickfield_bench_data::{Mesh, write};
use brickfield_engine::bead::SweepOptions;
use brickfield_engine::build::{BuildOptions, ThinDepth};
use brickfield_engine::ingest::{Facet, Input, OpenOptions};
use brickfield_engine::store::Refine;
use brickfield_engine::{Error, Progress, Silent};
use std::hash::{DefaultHasher, Hash, Hasher};
use std::io::Write;
use std::path::{Path, PathBuf};
use std::sync::Mutex;

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

/// A mesh as an input, always with the same path: a store has that, and stores of one input are held against each other.
fn kept(content: &[u8]) -> Input {
    let mut hasher = DefaultHasher::new();
    content.hash(&mut hasher);
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR"));
    let path = folder.join(format!("{:016x}.stl", hasher.finish()));
    if !path.exists() {
        let mut file = tempfile::NamedTempFile::new_in(folder).unwrap();
        file.write_all(content).unwrap();
        // Another test may have been faster.
        assert!(file.persist_noclobber(&path).is_ok() || path.exists());
    }
    open(&path)
}

/// Pieces as an input.
pub fn input_of(pieces: &[Mesh]) -> Input {
    let mut content = Vec::new();
    write::stl(&mut content, &Mesh::merged(pieces)).unwrap();
    kept(&content)
}

/// Holds the stores at some depths against the processor's; on a device, all leaves must be its own.
fn same_stores(backend: &Backend, input: &Input, depths: &[u8]) {
    let count = depths.len() - usize::from(!backend.does_all);
    for &depth in &depths[..count] {
        let (store, summary) = backend.build_with(input, depth, &options(depth));
        let report = summary.device;
        assert!(store == *reference(input, depth), "{}, depth {depth}: {report:?}", input.path().display());
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
    let sphere = input_of(&[icosphere(3, 1.0)]);
    same_stores(backend, &sphere, &[0, 1, 4]);
}

/// The facets of a mesh without one in `nth`, as an input.
pub fn less(name: &str, nth: usize) -> Input {
    let whole = open_data(name);
    let mut facets = Vec::new();
    whole.read(0..whole.facets(), &mut facets);
    let left: Vec<Facet> =
        facets.into_iter().enumerate().filter(|(i, _)| i % nth != nth / 2).map(|(_, t)| t).collect();
    let mut out = write::StlWriter::new(Vec::new(), left.len() as u64).unwrap();
    left.iter().for_each(|t| out.facet(&t.map(|v| v.map(|c| c as f32))).unwrap());
    kept(&out.finish().unwrap())
}

/// What a device does of an open soup.
fn same_open_stores(backend: &Backend, input: &Input, depths: &[u8], error: f64) {
    let count = depths.len() - usize::from(!backend.does_all);
    for &depth in &depths[..count] {
        let options = BuildOptions { gwn_error: error, ..options(depth) };
        let here = reference_with(input, depth, &options);
        let (store, summary) = backend.build_with(input, depth, &options);
        let report = summary.device;
        assert!(store == *here, "{}, depth {depth}: {report:?}", input.path().display());
        assert_eq!(report.is_some(), backend.device.is_some());
        if let Some(report) = report {
            assert!(report.bricks > report.cpu_bricks && report.failure.is_none(), "{report:?}");
            // Some are too close to a rounding step, and few, where steps are not finer than they must be.
            let few = if error < 1e-3 { 0.2 } else { 0.05 };
            let share = report.settled as f64 / report.samples as f64;
            assert!(share > 0.0 && share < few, "depth {depth}, error {error}: {share}");
        }
    }
}

/// Files with a hole, with many, and beads with holes at overlaps; single facets, at the smallest error and a large one.
pub fn open_soups_give_the_same_store(backend: &Backend) {
    same_open_stores(backend, &open_data("stl/open_box_no_lid.stl"), &[0, 1, 2], 1e-3);
    same_open_stores(backend, &less("stl/spot40_model.stl", 7), &[0, 1, 2], 1e-3);
    same_open_stores(backend, &less("stl/clover_beads.stl", 101), &[1, 2], 1e-3);
    let pile = less("stl/thinwall_ladder.stl", 2);
    same_open_stores(backend, &pile, &[0, 1], 2.5e-4);
    same_open_stores(backend, &pile, &[0, 2], 0.02);
}

/// Options of trees whose nodes decide for themselves.
pub fn deciding(depth: u8) -> [BuildOptions; 5] {
    let [a, b, c, d] =
        [(Refine::Stddev, 0.0), (Refine::Stddev, 0.1), (Refine::Surface, 0.0), (Refine::Hidden, 0.2)]
            .map(|(refine, stddev)| BuildOptions { refine, stddev, ..options(depth) });
    [a, b, c, d, BuildOptions { tolerance: 0.02, ..options(depth) }]
}

/// Beads that hide walls and gaps from coarse samples, flat parts, triangles on the lattice, anything.
pub fn trees_that_decide_give_the_same_store(backend: &Backend) {
    let on_lattice = input_of(&lattice_pile(2, 12, 1 << 17, 64));
    let pile = input_of(&random_pile(5, 20));
    // On the processor alone a level less is as good, unless all is asked for.
    let less = u8::from(backend.device.is_none() && !backend.does_all);
    for (input, depth) in [
        (open_data("stl/clover_beads.stl"), 4 - less),
        (open_data("stl/spot40_model.stl"), 4 - less),
        (open_data("stl/thinwall_ladder.stl"), 5 - less),
        (on_lattice, 3),
        (pile, 4),
    ] {
        // Every second way in any case, the tolerance among them.
        for options in deciding(depth).into_iter().step_by(if backend.does_all { 1 } else { 2 }) {
            let expected = reference_with(&input, depth, &options);
            let (store, summary) = backend.build_with(&input, depth, &options);
            let report = summary.device;
            assert!(store == *expected, "{}, {options:?}: {report:?}", input.path().display());
            assert_eq!(report.is_some(), backend.device.is_some());
            if let Some(report) = report {
                // Levels above the jobs are the processor's, and a tolerance may leave all but these undivided.
                let is_devices = options.tolerance > 0.0 || report.bricks > 2 * report.cpu_bricks;
                assert!(
                    is_devices && report.failure.is_none(),
                    "{}, {options:?}: {report:?}",
                    input.path().display()
                );
            }
        }
    }
}

/// Walls, gaps and rods that hide between samples, divided further than all else: across the axes, and askew.
pub fn thin_walls_that_are_divided_give_the_same_store(backend: &Backend) {
    let here = Backend::new(None, 1);
    let plate = cuboid([-1.0, -1.0, -0.004], [1.0, 1.0, 0.004]);
    let askew = cuboid([-0.8, -0.7, -0.006], [0.8, 0.7, 0.006]).rotated_by([0.9, 0.3, 0.2, 0.25]);
    let rod = cuboid([-1.0, 0.5, 0.5], [1.0, 0.506, 0.506]);
    let plates = input_of(&[plate, askew, rod]);
    for (input, depth, thin) in [
        (plates, 1, ThinDepth::Level(4)),
        (open_data("stl/thinwall_ladder.stl"), 3, ThinDepth::Deeper(2)),
        (open_data("stl/clover_beads.stl"), 2, ThinDepth::Level(4)),
    ] {
        let options = BuildOptions { thin, ..options(depth) };
        let (expected, alone) = here.build_with(&input, depth, &options);
        assert!(alone.depth > alone.base_depth && alone.leaves < 8u64.pow(u32::from(alone.depth)));
        let (store, summary) = backend.build_with(&input, depth, &options);
        assert!(store == expected, "{}, {thin:?}: {:?}", input.path().display(), summary.device);
        assert_eq!((summary.thin, summary.leaves), (alone.thin, alone.leaves));
        if let Some(report) = summary.device {
            // What a brick below the common depth holds is known only when its parent is: the processor does them all.
            assert!(report.bricks == 0 && report.cpu_bricks > 0, "{report:?}");
            assert!(report.failure.is_none() && report.wrong.is_none(), "{report:?}");
        }
    }
}

/// Stops a build when a few of its jobs are done; how many are, once they have begun.
pub struct Stop {
    done: Mutex<Option<u64>>,
    after: u64,
}

impl Stop {
    /// After so many steps.
    pub fn after(after: u64) -> Stop {
        Stop { done: Mutex::default(), after }
    }
}

impl Progress for Stop {
    fn phase(&self, name: &str, _: Option<u64>, _: &str) {
        if name == "building" {
            *self.done.lock().unwrap() = Some(0);
        }
    }

    fn advance(&self, steps: u64) {
        self.done.lock().unwrap().iter_mut().for_each(|done| *done += steps);
    }

    fn cancelled(&self) -> bool {
        self.done.lock().unwrap().is_some_and(|done| done >= self.after)
    }
}

/// A build that was stopped, on a device or not, goes on on either one.
pub fn interrupted_builds_go_on_to_the_same_store(backend: &Backend) {
    let here = Backend::new(None, 2);
    let inputs = [(open_data("clover.gcode"), 4), (open_data("stl/open_box_no_lid.stl"), 3)];
    for (n, (input, depth)) in inputs.into_iter().enumerate() {
        let expected = reference(&input, depth);
        // Each way for one of the two in any case.
        let ways = [(backend, backend), (&here, backend), (backend, &here)];
        let (skipped, step) = if backend.does_all { (0, 1) } else { (n, 2) };
        for (first, second) in ways.into_iter().skip(skipped).step_by(step) {
            let directory = tempfile::tempdir().unwrap();
            let out = directory.path().join("part.brf");
            let mut options = options(depth);
            options.keeping.pace = std::time::Duration::ZERO;
            let stopped = first.build_at(&input, &out, &options, &Stop::after(3)).unwrap_err();
            let Error::Suspended { nodes, .. } = stopped else { panic!("{stopped}") };
            assert!(nodes > 0 && !out.exists());
            second.build_at(&input, &out, &options, &Silent).unwrap_or_else(|e| panic!("{e}"));
            assert!(std::fs::read(&out).unwrap() == *expected, "{}", input.path().display());
        }
    }
}

pub fn beads_give_the_same_store(backend: &Backend) {
    for (name, depths) in [("clover.gcode", [2, 3, 4]), ("gcode/nonplanar.gcode", [2, 5, 6])] {
        same_stores(backend, &open_data(name), &depths);
    }
}

pub fn piles_on_the_lattice_give_the_same_store(backend: &Backend) {
    for seed in 0..4 {
        let pile = input_of(&lattice_pile(seed, 12, 1 << 17, 64));
        same_stores(backend, &pile, &[0, 2, 3]);
    }
}

pub fn any_triangles_give_the_same_store(backend: &Backend) {
    for seed in 0..4 {
        let pile = input_of(&random_pile(seed, 20));
        same_stores(backend, &pile, &[0, 2, 4]);
    }
    // Many shells over each other.
    let nested: Vec<Mesh> =
        (1..40).map(|i| cuboid([-0.1 * f64::from(i); 3], [0.07 * f64::from(i); 3])).collect();
    let nested = input_of(&nested);
    same_stores(backend, &nested, &[0, 1, 3]);
}
