//! Beads as solids on real toolpaths, against distances to the beads as the file has them.
//!
//! The oracle computes in millimetres and knows no lattice. The engine snaps ends and faces to within one unit
//! of the lattice, so samples within four units of a surface count as undecided; where a short segment climbs,
//! its direction, and with it the section, turns by a unit over its length, which widens the band.

use brickfield_bench_data::Rng;
use brickfield_bench_data::judge::mesh::check;
use brickfield_core::sweep::part_or_all;
use brickfield_engine::Silent;
use brickfield_engine::analysis::{CoveringPass, beads_at_points, sample_at, volume};
use brickfield_engine::bead::{Sweep, SweepOptions, SweptToolpath};
use brickfield_engine::brick::{Brick, Count};
use brickfield_engine::build::{
    BuildOptions, Resolution, TreeOptions, bead_sources, bounds_of_sources, build_beads_in_memory,
    build_in_memory, build_opened,
};
use brickfield_engine::contour::{ContourOptions, MeshArrays, contour};
use brickfield_engine::ingest::{Input, OpenOptions};
use brickfield_engine::lattice::{NodeKey, RootCube};
use brickfield_engine::solid::{Outline, Solids, beads_at, bounds_of_beads, brute_beads_at};
use brickfield_engine::store::{BrickTree, MemoryTree, Refine, Store};
use brickfield_engine::toolpath::{Attributes, BeadView, Section, Toolpath};
use std::path::{Path, PathBuf};

type V = [f64; 3];

fn file(name: &str) -> PathBuf {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../bench-data");
    if name == "clover.gcode" { folder.join(name) } else { folder.join("gcode").join(name) }
}

fn open(name: &str) -> Input {
    let mut options = OpenOptions::default();
    // Two files say nothing of their beads' sizes.
    let (width, height) = match name {
        "five_axis_ded.gcode" => (Some(4.0), Some(1.5)),
        "large_format.gcode" => (Some(15.0), Some(5.0)),
        _ => (None, None),
    };
    (options.gcode.width, options.gcode.height) = (width, height);
    Input::open_with(&file(name), &options, &Silent).unwrap_or_else(|e| panic!("{e}"))
}

fn toolpath(input: &Input) -> &Toolpath {
    input.beads().expect("a toolpath").swept.toolpath()
}

fn root_of(path: &Toolpath) -> RootCube {
    let (min, max) = bounds_of_beads(path, Outline::Stadium).expect("finite");
    RootCube::around(min, max).expect("an extent")
}

fn dot(a: V, b: V) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn plus(a: V, t: f64, b: V) -> V {
    [a[0] + t * b[0], a[1] + t * b[1], a[2] + t * b[2]]
}

fn unit(a: V) -> V {
    a.map(|c| c / dot(a, a).sqrt())
}

/// Distance from the surface of a segment's stadium, negative inside, and how far it may be off by snapping.
fn distance(path: &Toolpath, bead: usize, segment: usize, p: V, lattice_unit: f64) -> (f64, f64) {
    let Section { width, height } = path.section(bead, segment);
    let [a, b] =
        [segment, segment + 1].map(|i| plus(path.points(bead)[i], -0.5 * height, path.axis(bead, i)));
    let middle = plus(path.axis(bead, segment), 1.0, path.axis(bead, segment + 1));
    let direction = plus(b, -1.0, a);
    let length = dot(direction, direction).sqrt();
    let u = unit(direction);
    let mut up = plus(unit(middle), -dot(unit(middle), u), u);
    let is_vertical = dot(up, up) < 1e-10;
    if is_vertical {
        // Any round extent will do: nothing is decided between the two.
        let off = plus(plus(p, -1.0, a), -dot(plus(p, -1.0, a), u).clamp(0.0, length), u);
        let d = dot(off, off).sqrt();
        return (d - 0.5 * width.min(height), (width - height).abs() + 0.5 * width);
    }
    up = unit(up);
    let from_a = plus(p, -1.0, a);
    let rise = dot(from_a, up);
    let flat = plus(from_a, -rise, up);
    let off = plus(flat, -dot(flat, u).clamp(0.0, length), u);
    let (r, n) = (0.5 * width.min(height), rise.abs());
    let x = (dot(off, off).sqrt() - (0.5 * width - r)).max(0.0);
    let y = (n - (0.5 * height - r)).max(0.0);
    let tilt = if u[2].abs() < 1e-12 && up[2] > 1.0 - 1e-12 { 0.0 } else { (width + height) / length };
    ((x * x + y * y).sqrt() - r, 4.0 * lattice_unit * (1.0 + tilt))
}

/// How many beads cover the point; `None` where that is undecided.
fn oracle(path: &Toolpath, p: V, lattice_unit: f64) -> Option<i64> {
    let mut count = 0;
    for bead in 0..path.len() {
        let mut undecided = false;
        let mut inside = false;
        for segment in 0..path.points(bead).len() - 1 {
            let [a, b] = [segment, segment + 1].map(|i| path.points(bead)[i]);
            let reach = 2.0 * (path.section(bead, segment).width + path.section(bead, segment).height);
            if (0..3).any(|i| p[i] < a[i].min(b[i]) - reach || p[i] > a[i].max(b[i]) + reach) {
                continue;
            }
            let (distance, error) = distance(path, bead, segment, p, lattice_unit);
            inside |= distance < -error;
            undecided |= distance.abs() <= error;
        }
        if undecided && !inside {
            return None;
        }
        count += i64::from(inside);
    }
    Some(count)
}

fn nodes(tree: &dyn BrickTree) -> Vec<NodeKey> {
    tree.keys()
}

/// World position of a brick's sample.
fn position(root: RootCube, key: NodeKey, ijk: [usize; 3]) -> V {
    let base = key.base();
    root.to_world([0, 1, 2].map(|a| f64::from(base[a] + ((ijk[a] as i32) << key.spacing_bits()) + 1)))
}

/// Compares samples of random bricks with the oracle; returns how many were undecided.
fn compare(path: &Toolpath, tree: &MemoryTree, samples: usize, seed: u64) -> usize {
    let root = tree.root();
    let lattice_unit = root.edge / f64::from(1u32 << 24);
    let keys: Vec<NodeKey> =
        nodes(tree).into_iter().filter(|k| tree.node(*k).is_some_and(|n| n.max > 0)).collect();
    let mut rng = Rng::new(seed);
    let mut undecided = 0;
    for _ in 0..samples {
        let key = keys[rng.below(keys.len() as u32) as usize];
        let ijk = [0; 3].map(|_| rng.below(33) as usize);
        let p = position(root, key, ijk);
        match oracle(path, p, lattice_unit) {
            Some(w) => {
                let sample = tree.brick(key).unwrap_or_else(|e| panic!("{e}")).sample(ijk);
                assert_eq!(i64::from(sample), w, "{key} {ijk:?} at {p:?}");
            }
            None => undecided += 1,
        }
    }
    undecided
}

#[test]
fn samples_are_the_beads_around_them() {
    for (name, depth, samples) in [
        ("clover.gcode", 3, 3000),
        ("five_axis_ded.gcode", 4, 10_000),
        ("nonplanar.gcode", 4, 10_000),
        ("dialect_torture.gcode", 4, 10_000),
        ("large_format.gcode", 4, 10_000),
        ("spot40_relE_prusaslicer.gcode.xz", 3, 1000),
        ("void_ladder_prusaslicer.gcode.gz", 4, 1000),
        ("clover_cura.gcode.xz", 3, 300),
    ] {
        let input = open(name);
        let path = toolpath(&input);
        let options = TreeOptions { depth, ..Default::default() };
        let tree = build_beads_in_memory(&[path], (Outline::Stadium, Count::Beads), root_of(path), options)
            .unwrap_or_else(|e| panic!("{name}: {e}"));
        let samples = samples / part_or_all(4, 1);
        let undecided = compare(path, &tree, samples, 1);
        assert!(undecided <= samples / 50, "{name}: {undecided} undecided of {samples}");
    }
}

#[test]
fn every_sample_of_coarse_trees_is_the_beads_around_it() {
    for (name, depth) in [
        ("dialect_torture.gcode", 1),
        ("five_axis_ded.gcode", 1),
        ("large_format.gcode", 1),
        ("nonplanar.gcode", 0),
    ] {
        let input = open(name);
        let path = toolpath(&input);
        let root = root_of(path);
        let lattice_unit = root.edge / f64::from(1u32 << 24);
        let options = TreeOptions { depth, ..Default::default() };
        let tree = build_beads_in_memory(&[path], (Outline::Stadium, Count::Beads), root, options)
            .unwrap_or_else(|e| panic!("{name}: {e}"));
        let (mut all, mut undecided) = (0, 0);
        for key in nodes(&tree) {
            let brick = tree.brick(key).unwrap_or_else(|e| panic!("{e}"));
            for ijk in (0..33 * 33 * 33).map(|i| [i % 33, i / 33 % 33, i / (33 * 33)]) {
                all += 1;
                let p = position(root, key, ijk);
                match oracle(path, p, lattice_unit) {
                    Some(w) => assert_eq!(i64::from(brick.sample(ijk)), w, "{name} {key} {ijk:?} at {p:?}"),
                    None => undecided += 1,
                }
            }
        }
        assert!(undecided <= all / 100, "{name}: {undecided} undecided of {all}");
    }
}

#[test]
fn points_count_as_samples_do_and_as_formulas_say() {
    let input = open("clover.gcode");
    let path = toolpath(&input);
    let root = root_of(path);
    let options = TreeOptions { depth: 2, ..Default::default() };
    let tree = build_beads_in_memory(&[path], (Outline::Stadium, Count::Beads), root, options).unwrap();
    let mut rng = Rng::new(5);
    let keys = nodes(&tree);
    let points: Vec<V> = (0..3000)
        .map(|_| {
            position(
                root,
                keys[rng.below(keys.len() as u32) as usize],
                [0; 3].map(|_| rng.below(33) as usize),
            )
        })
        .collect();
    let (solids, segments) = Solids::new(&[path], root, Outline::Stadium, Count::Beads).unwrap();
    let counts = beads_at(&solids, &segments, root, &points, &Silent).unwrap();
    let sampled = sample_at(&tree, &points).unwrap();
    for ((point, count), sample) in points.iter().zip(&counts).zip(sampled) {
        // The root's own last samples belong to no brick's cells.
        if root.to_units(*point).iter().all(|u| *u < f64::from((1u32 << 24) - 2)) {
            assert_eq!(*count as f64, sample, "{point:?}");
        }
    }
    let brute = brute_beads_at(&solids, &segments, root, &points, &Silent).unwrap();
    assert_eq!(counts, brute);
}

fn options(depth: u8) -> BuildOptions {
    BuildOptions {
        resolution: Resolution::Depth(depth),
        solids: Some(Outline::Stadium),
        identity: true,
        ..BuildOptions::default()
    }
}

#[test]
fn stores_are_sound_tell_beads_apart_and_do_not_depend_on_threads() {
    let directory = tempfile::tempdir().unwrap();
    let out = directory.path().join("part.brf");
    let inputs = [open("nonplanar.gcode"), open("five_axis_ded.gcode")];
    let mut expected: Option<Vec<u8>> = None;
    for &threads in part_or_all(&[1, 3][..], &[1, 2, 3, 8]) {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| build_opened(&inputs, &out, &options(3), &Silent)).unwrap();
        let bytes = std::fs::read(&out).unwrap();
        assert!(*expected.get_or_insert_with(|| bytes.clone()) == bytes, "{threads} threads");
    }
    let store = Store::open(&out, 64 << 20).unwrap();
    store.verify(&Silent).unwrap().into_result(&store).unwrap();
    let tables = store.bead_tables().unwrap().expect("asked for");
    let (first, second) = (toolpath(&inputs[0]), toolpath(&inputs[1]));
    assert_eq!(tables.beads.len(), first.len() + second.len());
    assert_eq!(tables.beads[first.len()].source, 1);
    assert_eq!(tables.beads[0].lines, first.attributes(0).lines);
    let leaves: Vec<NodeKey> = store
        .keys()
        .into_iter()
        .filter(|key| store.node(*key).is_some_and(|n| n.leaf && n.max > 0))
        .collect();
    let mut rng = Rng::new(3);
    let points: Vec<V> = (0..5000)
        .map(|_| {
            let key = leaves[rng.below(leaves.len() as u32) as usize];
            position(store.root(), key, [0; 3].map(|_| rng.below(32) as usize))
        })
        .collect();
    let beads = beads_at_points(&store, &tables, &points).unwrap();
    let samples = sample_at(&store, &points).unwrap();
    let (mut covered, mut told_lines) = (0, 0);
    for ((point, beads), w) in points.iter().zip(&beads).zip(samples) {
        // Where a pass follows another of its bead both are named, and may count once.
        let follows = |pair: &[CoveringPass]| {
            pair[0].number + 1 == pair[1].number
                && tables.bead_of(pair[0].number).0 == tables.bead_of(pair[1].number).0
        };
        let joints = beads.windows(2).filter(|pair| follows(pair)).count();
        let more = beads.len() as f64 - w;
        assert!((0.0..=joints as f64).contains(&more), "{point:?}: {more}");
        assert!(beads.is_sorted_by(|a, b| a.number < b.number));
        for found in beads {
            let (bead, pass) = tables.bead_of(found.number);
            let (from, to) = tables.beads[bead as usize].lines;
            assert!(pass.is_some() && from <= found.lines.0 && found.lines.1 <= to, "{found:?}");
            told_lines += usize::from(found.lines != (from, to));
        }
        covered += beads.len();
    }
    assert!(covered > 100 && told_lines > covered / 2, "{covered} {told_lines}");
}

/// Signs, Hermite edges and the mesh are those of the union, which does not know what is counted.
#[test]
fn the_union_does_not_depend_on_what_is_counted() {
    let mut overlaps = 0;
    for (name, depth) in
        [("clover.gcode", 3), ("dialect_torture.gcode", 3), ("nonplanar.gcode", 3), ("large_format.gcode", 3)]
    {
        let input = open(name);
        let path = toolpath(&input);
        let root = root_of(path);
        for refine in [Refine::Hidden, Refine::Surface] {
            let options = TreeOptions { depth, refine, ..Default::default() };
            let tree =
                |count| build_beads_in_memory(&[path], (Outline::Stadium, count), root, options).unwrap();
            let (passes, beads) = (tree(Count::Passes), tree(Count::Beads));
            for key in nodes(&passes) {
                let (Brick::Counts { samples, hermite }, Ok(other)) =
                    (&*passes.brick(key).unwrap(), beads.brick(key))
                else {
                    continue;
                };
                for (number, w) in samples.0.iter().enumerate() {
                    let ijk = [number % 33, number / 33 % 33, number / (33 * 33)];
                    let of_beads = other.sample(ijk);
                    assert!(*w >= of_beads && (*w > 0) == (of_beads > 0), "{name} {key} {ijk:?}");
                    overlaps += usize::from(*w > of_beads);
                }
                match &*other {
                    Brick::Counts { hermite: other, .. } => assert_eq!(hermite, other, "{name} {key}"),
                    Brick::Uniform(_) => assert!(hermite.edges.iter().all(Vec::is_empty), "{name} {key}"),
                }
            }
            let mesh = |tree: &MemoryTree| {
                let mut kept = MeshArrays::default();
                contour(tree, &ContourOptions::default(), &mut kept, &Silent).unwrap();
                let bits = |p: &[f32; 3]| p.map(f32::to_bits);
                (kept.positions.iter().map(bits).collect::<Vec<_>>(), kept.triangles)
            };
            assert!(mesh(&passes) == mesh(&beads), "{name}");
        }
    }
    assert!(overlaps > 1000, "{overlaps}");
}

#[test]
fn damage_to_the_identity_is_found() {
    let directory = tempfile::tempdir().unwrap();
    let out = directory.path().join("part.brf");
    build_opened(&[open("five_axis_ded.gcode")], &out, &options(2), &Silent).unwrap();
    let sound = std::fs::read(&out).unwrap();
    let store = Store::open(&out, 0).unwrap();
    let place = store.meta().beads.as_ref().and_then(|beads| beads.identity).expect("asked for");
    let list = store.identity_entries()[0];
    drop(store);
    for at in [place.tables_offset, list.offset, place.index_offset] {
        let mut bytes = sound.clone();
        bytes[at as usize] ^= 1;
        std::fs::write(&out, &bytes).unwrap();
        let found = match Store::open(&out, 0) {
            Ok(store) => store.verify(&Silent).unwrap().into_result(&store).is_err(),
            Err(_) => true,
        };
        assert!(found, "byte {at}");
    }
}

/// Straight beads, each by itself, in all directions of a layer.
fn spokes() -> Toolpath {
    let mut path = Toolpath::default();
    let section = Section { width: 1.7, height: 0.9 };
    for (number, direction) in [[5.0, 1.0], [2.0, 4.0], [-3.0, 3.7], [4.3, -2.9]].into_iter().enumerate() {
        let z = 1.0 + 1.3 * number as f64;
        let points = [[0.3, 0.1, z], [direction[0], direction[1], z]];
        let attributes = Attributes { layer: number as u32, tool: 0, feature: 0, lines: (1, 2), fed: None };
        path.push(BeadView { points: &points, axes: &[], sections: &[section], lines: &[], attributes });
    }
    path
}

#[test]
fn swept_meshes_approach_the_solids_as_their_sides_grow() {
    let path = spokes();
    let root = root_of(&path);
    let options = TreeOptions { depth: 2, ..Default::default() };
    let solid = build_beads_in_memory(&[&path], (Outline::Stadium, Count::Beads), root, options).unwrap();
    // The caps at the ends have rings of their own, whose number does not grow with the sides.
    let is_between_ends = |p: V| {
        (0..path.len())
            .all(|bead| path.points(bead).iter().all(|end| (p[0] - end[0]).hypot(p[1] - end[1]) > 1.0))
    };
    let differing = |sides: usize| {
        let sweep = Sweep::new(&SweepOptions { sides, ..SweepOptions::default() }).unwrap();
        let swept = SweptToolpath::new(path.clone(), sweep);
        let mut soup = Vec::new();
        swept.read(0..swept.facets(), &mut soup);
        let mesh = build_in_memory(&[&soup], root, options).unwrap();
        let brick = |tree: &MemoryTree, key| tree.brick(key).unwrap();
        let keys: Vec<NodeKey> = solid.keys().into_iter().filter(|k| mesh.node(*k).is_some()).collect();
        let of_key = |key: &NodeKey| {
            let (a, b) = (brick(&solid, *key), brick(&mesh, *key));
            let differs = |n: &usize| {
                let ijk = [n % 33, n / 33 % 33, n / 1089];
                a.sample(ijk) != b.sample(ijk) && is_between_ends(position(root, *key, ijk))
            };
            (0..33usize.pow(3)).filter(differs).count()
        };
        keys.iter().map(of_key).sum::<usize>()
    };
    let results = [8, 16, 32, 64].map(differing);
    assert!(results.is_sorted_by(|a, b| a > b), "{results:?}");
    assert!(results[3] * 8 < results[0], "{results:?}");
}

#[test]
fn meshes_of_beads_are_closed_and_have_the_volume_of_the_union() {
    for name in ["five_axis_ded.gcode", "nonplanar.gcode", "clover.gcode"] {
        let input = open(name);
        let path = toolpath(&input);
        let sources = bead_sources(std::slice::from_ref(&input)).unwrap();
        let (min, max) = bounds_of_sources(&sources, Outline::Stadium).unwrap();
        let root = RootCube::around(min, max).unwrap();
        for (refine, depth) in [(Refine::Hidden, 3), (Refine::Surface, 3)] {
            let options = TreeOptions { depth, refine, ..Default::default() };
            let tree =
                build_beads_in_memory(&[path], (Outline::Stadium, Count::Beads), root, options).unwrap();
            let mut kept = MeshArrays::default();
            contour(&tree, &ContourOptions::default(), &mut kept, &Silent).unwrap();
            let positions: Vec<V> = kept.positions.iter().map(|p| p.map(f64::from)).collect();
            let report = check(&positions, &kept.triangles);
            assert!(report.is_closed_manifold() && report.is_oriented(), "{name}: {report}");
            let union = volume(&tree, &Silent).unwrap().union;
            assert!((report.signed_volume / union - 1.0).abs() < 0.06, "{name}: {union} {report}");
        }
    }
}
