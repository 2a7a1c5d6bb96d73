//! Volumes of passes and of their union, against closed forms.

use brickfield_bench_data::Rng;
use brickfield_bench_data::passes::pass_files;
use brickfield_core::sweep::part_or_all;
use brickfield_engine::Silent;
use brickfield_engine::brick::Count;
use brickfield_engine::build::{bead_sources, bounds_of_sources};
use brickfield_engine::ingest::{Input, OpenOptions};
use brickfield_engine::lattice::RootCube;
use brickfield_engine::solid::{Outline, Solids, beads_at};
use std::path::{Path, PathBuf};

type V = [f64; 3];

fn file(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../tests/data/passes").join(name)
}

fn open(name: &str) -> Input {
    Input::open_with(&file(name), &OpenOptions::default(), &Silent).unwrap()
}

/// Points at random, one in each of so many equal boxes along each axis, and the volume that each stands for.
fn points((low, high): (V, V), counts: [usize; 3]) -> (Vec<V>, f64) {
    let mut rng = Rng::new(11);
    let step = [0, 1, 2].map(|a| (high[a] - low[a]) / counts[a] as f64);
    let all = (0..counts.iter().product::<usize>()).map(|n| {
        let place = [n % counts[0], n / counts[0] % counts[1], n / (counts[0] * counts[1])];
        [0, 1, 2].map(|a| low[a] + step[a] * (place[a] as f64 + rng.range(0.0, 1.0)))
    });
    (all.collect(), step.iter().product())
}

#[test]
fn files_are_those_of_the_generator() {
    for made in pass_files() {
        let found = std::fs::read_to_string(file(made.name)).unwrap();
        assert!(found == made.gcode, "{}: make-input passes -o tests/data/passes", made.name);
    }
}

#[test]
fn overlap_is_that_of_closed_forms() {
    // In any case a line laid again, rings beside rings, and a sharp corner.
    for made in pass_files().into_iter().step_by(part_or_all(4, 1)) {
        let input = open(made.name);
        let sources = bead_sources(std::slice::from_ref(&input)).unwrap();
        let (low, high) = bounds_of_sources(&sources, Outline::Stadium).unwrap();
        let root = RootCube::around(low, high).unwrap();
        let counts = [0, 1, 2].map(|a| ((high[a] - low[a]) / [0.08, 0.03, 0.02][a]).ceil() as usize);
        let (points, volume) = points((low, high), counts);
        let w = |count| {
            let (solids, segments) =
                Solids::new(&[sources[0].toolpath], root, Outline::Stadium, count).unwrap();
            assert!(count == Count::Beads || u64::from(segments[segments.len() - 1].pass) + 1 == made.passes);
            beads_at(&solids, &segments, root, &points, &Silent).unwrap()
        };
        let (of_passes, of_beads) = (w(Count::Passes), w(Count::Beads));
        assert!(of_passes.iter().zip(&of_beads).all(|(passes, beads)| *beads == (*passes).min(1)));
        let union = volume * of_beads.iter().sum::<i64>() as f64;
        let overlap = volume * of_passes.iter().sum::<i64>() as f64 - union;
        let name = made.name;
        eprintln!(
            "{name}: union {union:.4} of {:.4}, overlap {overlap:.4} of {:.4}",
            made.union, made.overlap
        );
        assert!((union / made.union - 1.0).abs() < 0.003, "{name}: {union}, not {}", made.union);
        assert!(
            (overlap - made.overlap).abs() <= 0.01 * made.overlap,
            "{name}: {overlap}, not {}",
            made.overlap
        );
    }
}
