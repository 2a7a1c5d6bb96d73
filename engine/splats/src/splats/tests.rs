//! Splats judged by closed forms: distances to a ball, a torus and a box, and every crossing asked whether a splat covers it.

use super::*;
use crate::brick::{Brick, Hermite, HermiteEdge, OctNormal, Samples, SignChanges, point_index};
use crate::bsp::{HEADER_BYTES, SplatTree};
use crate::lattice::{Axis, BRICK_CELLS, NodeKey, Octant, RootCube};
use crate::progress::Silent;
use crate::store::{BrickTree, MemoryTree};

type Vector = [f64; 3];

/// A body: its signed distance, negative inside.
type Body = fn(Vector) -> f64;

fn length(p: Vector) -> f64 {
    p.iter().map(|c| c * c).sum::<f64>().sqrt()
}

fn ball(p: Vector) -> f64 {
    length(p) - 0.8
}

fn torus([x, y, z]: Vector) -> f64 {
    let ring = (x * x + y * y).sqrt() - 0.6;
    (ring * ring + z * z).sqrt() - 0.24
}

/// A box that is turned about z by the angle of the triangle 3, 4, 5.
fn turned_box([x, y, z]: Vector) -> f64 {
    let q = [(0.8 * x + 0.6 * y).abs() - 0.61, (0.8 * y - 0.6 * x).abs() - 0.37, z.abs() - 0.43];
    let outside = length(q.map(|c| c.max(0.0)));
    outside + q[0].max(q[1]).max(q[2]).min(0.0)
}

fn normal(body: Body, p: Vector) -> Vector {
    let step = 1e-6;
    let slope = |axis: usize| {
        let moved = |by: f64| {
            let mut q = p;
            q[axis] += by;
            body(q)
        };
        moved(step) - moved(-step)
    };
    let n = [slope(0), slope(1), slope(2)];
    n.map(|c| c / length(n))
}

const ROOT: RootCube = RootCube { origin: [-1.0; 3], edge: 2.0 };

fn world(key: NodeKey, sample: [usize; 3]) -> Vector {
    let (base, bits) = (key.base(), key.spacing_bits());
    ROOT.to_world(std::array::from_fn(|a| f64::from(base[a] + 1 + ((sample[a] as i32) << bits))))
}

fn brick(key: NodeKey, body: Body) -> Brick {
    let middle = body(world(key, [BRICK_CELLS / 2; 3]));
    if middle.abs() > ROOT.edge / f64::from(1u32 << key.level()) {
        return Brick::Uniform(i16::from(middle < 0.0));
    }
    let mut samples = Samples::filled(0);
    let side = BRICK_CELLS + 1;
    for n in 0..side.pow(3) {
        let at = [n % side, n / side % side, n / side / side];
        samples.0[point_index(at)] = i16::from(body(world(key, at)) < 0.0);
    }
    let signs = SignChanges::of(&samples);
    let mut hermite = Hermite::default();
    for axis in Axis::ALL {
        signs.for_edges(axis, |from| {
            let mut to = from;
            to[axis.index()] += 1;
            let ends = [world(key, from), world(key, to)];
            let at = |t: f64| std::array::from_fn(|a| ends[0][a] + (ends[1][a] - ends[0][a]) * t);
            let is_inside = body(ends[0]) < 0.0;
            let (mut low, mut high) = (0.0, 1.0);
            for _ in 0..40 {
                let middle = (low + high) / 2.0;
                if (body(at(middle)) < 0.0) == is_inside { low = middle } else { high = middle }
            }
            let normal = normal(body, at(low)).map(|c| (c * 1e9) as i64);
            let offset = (low * 65_536.0) as u16;
            hermite.edges[axis.index()].push(HermiteEdge { offset, normal: OctNormal::from_integer(normal) });
        });
    }
    Brick::from_samples(samples, hermite)
}

fn tree(body: Body, depth: u8) -> MemoryTree {
    fn add(tree: &mut MemoryTree, key: NodeKey, body: Body, depth: u8) {
        let is_leaf = key.level() == depth;
        tree.insert(key, is_leaf, if is_leaf { brick(key, body) } else { Brick::Uniform(0) });
        if !is_leaf {
            Octant::all().for_each(|octant| add(tree, key.child(octant), body, depth));
        }
    }
    let mut made = MemoryTree::new(ROOT);
    add(&mut made, NodeKey::ROOT, body, depth);
    made
}

/// All crossings of the leaves, in the world.
fn crossings(tree: &MemoryTree) -> Vec<Vector> {
    let mut found = Vec::new();
    for key in tree.keys().into_iter().filter(|key| tree.node(*key).unwrap().leaf) {
        let brick = tree.brick(key).unwrap();
        let Brick::Counts { samples, hermite } = &*brick else { continue };
        let signs = SignChanges::of(samples);
        for axis in Axis::ALL {
            let mut edges = hermite.edges[axis.index()].iter();
            signs.for_edges(axis, |from| {
                let mut p = world(key, from);
                let cell = ROOT.edge / f64::from(32u32 << key.level());
                p[axis.index()] += edges.next().unwrap().fraction() * cell;
                found.push(p);
            });
        }
    }
    found
}

/// Distance of a point from what is left of a disc once others have cut it; of what is cut off it is that to the edge, or more.
fn distance(disc: &Disc, p: Vector) -> f64 {
    let from: Vector = std::array::from_fn(|a| p[a] - disc.centre[a]);
    let along = (0..3).map(|a| from[a] * disc.normal[a]).sum::<f64>();
    let across = length(std::array::from_fn(|a| from[a] - disc.normal[a] * along));
    let beyond = |(n, d): &(Vector, f64)| (0..3).map(|a| n[a] * p[a]).sum::<f64>() - d;
    let cut = disc.cuts.iter().map(beyond).fold(0.0, f64::max);
    (across - disc.radius).max(0.0).max(along.abs()).max(cut)
}

/// The greatest distance of a crossing from the nearest splat; found by cells of the coarsest splats.
fn worst(discs: &[Disc], crossings: &[Vector]) -> f64 {
    let side = discs.iter().map(|disc| disc.cell).fold(0.0, f64::max) * 1.001;
    let place = |p: Vector| p.map(|c| (c / side).floor() as i32);
    let mut grid = std::collections::HashMap::<[i32; 3], Vec<&Disc>>::new();
    for disc in discs {
        let [low, high] = [-1.0, 1.0].map(|s| place(disc.cell_centre.map(|c| c + s * disc.cell * 0.501)));
        for x in low[0]..=high[0] {
            for y in low[1]..=high[1] {
                (low[2]..=high[2]).for_each(|z| grid.entry([x, y, z]).or_default().push(disc));
            }
        }
    }
    let nearest = |p: &Vector| {
        let near = grid.get(&place(*p)).into_iter().flatten();
        near.map(|disc| distance(disc, *p)).fold(f64::MAX, f64::min)
    };
    crossings.iter().map(nearest).fold(0.0, f64::max)
}

fn levels(tree: &MemoryTree, error: Option<f64>) -> SplatLevels {
    SplatLevels::new(tree, LevelsOptions { error, ..LevelsOptions::default() }, &Silent).unwrap()
}

fn written(levels: &SplatLevels) -> (Vec<u8>, BspSummary) {
    bsp_bytes(levels, "mm", [[-1.0; 3], [1.0; 3]], &Silent).unwrap()
}

fn read(bytes: &[u8]) -> SplatTree {
    read_tree(bytes, None, &Silent).unwrap().unwrap()
}

fn discs(tree: &SplatTree, level: Option<u8>) -> Vec<Disc> {
    let mut discs = Vec::new();
    discs_of_tree(tree, level, |disc| discs.push(disc));
    discs
}

#[test]
fn every_crossing_is_covered_within_the_stated_error_at_every_level() {
    for body in [ball, torus, turned_box] {
        let tree = tree(body, 2);
        let crossings = crossings(&tree);
        let (bytes, summary) = written(&levels(&tree, None));
        let file = read(&bytes);
        assert_eq!(discs(&file, None).len() as u64, summary.finest);
        for level in 0..=2 {
            let discs = discs(&file, Some(level));
            let header = file.header();
            let stated = f64::from(header.levels[usize::from(level)].error) / 4096.0 * header.cell(level);
            // An edge of splats that cut each other may lose a tenth of a cell.
            let found = worst(&discs, &crossings);
            assert!(found <= stated.max(header.cell(level) * 0.2), "{found} {stated} at level {level}");
            assert!(found > 0.0 && discs.len() > 100);
        }
    }
}

#[test]
fn splats_lie_on_the_body_and_know_its_normals() {
    for (body, off) in [(ball as Body, 0.03), (torus, 0.06)] {
        let tree = tree(body, 2);
        let (bytes, _) = written(&levels(&tree, None));
        let file = read(&bytes);
        let cell = file.header().cell(2);
        let (mut turned, mut count) = (0.0, 0.0);
        for disc in discs(&file, None) {
            assert!(body(disc.centre).abs() < (off + 0.1) * cell, "{:?}", body(disc.centre) / cell);
            let n = normal(body, disc.centre);
            turned += (0..3).map(|a| n[a] * disc.normal[a]).sum::<f64>().min(1.0).acos().to_degrees();
            count += 1.0;
        }
        assert!(turned / count < 1.5, "{} degrees", turned / count);
    }
}

#[test]
fn a_tolerance_leaves_fewer_splats_that_are_within_it() {
    let tree = tree(torus, 2);
    let crossings = crossings(&tree);
    let all = written(&levels(&tree, None)).1.finest;
    let mut before = all;
    for error in [0.002, 0.01] {
        let (bytes, summary) = written(&levels(&tree, Some(error)));
        let discs = discs(&read(&bytes), None);
        assert!(summary.finest < before, "{} of {before}", summary.finest);
        before = summary.finest;
        assert!(worst(&discs, &crossings) <= summary.error);
        // Rounding of normals and offsets comes on top.
        assert!(summary.error < error + 0.25 * ROOT.edge / 32.0);
        let mut precise = Vec::new();
        discs_of_levels(&levels(&tree, Some(error)), None, |disc| precise.push(disc)).unwrap();
        assert_eq!(precise.len(), discs.len());
        let finest = ROOT.edge / 128.0;
        assert!(worst(&precise, &crossings) <= (error * 1.001).max(finest * 0.2));
    }
}

#[test]
fn edges_of_a_box_cut_splats() {
    let tree = tree(turned_box, 2);
    let mut cut = 0;
    let cell = ROOT.edge / 128.0;
    discs_of_levels(&levels(&tree, None), None, |disc| {
        let is_kept =
            |p: Vector| disc.cuts.iter().all(|(n, d)| (0..3).map(|a| n[a] * p[a]).sum::<f64>() <= *d);
        cut += usize::from(!disc.cuts.is_empty());
        // The rim of a disc, as far as it is kept in its cell, is not outside of the box.
        let side = if disc.normal[2].abs() < 0.5 { [0.0, 0.0, 1.0] } else { [1.0, 0.0, 0.0] };
        let n = disc.normal;
        let u = [
            n[1] * side[2] - n[2] * side[1],
            n[2] * side[0] - n[0] * side[2],
            n[0] * side[1] - n[1] * side[0],
        ];
        let u = u.map(|c| c / length(u));
        let v = [n[1] * u[2] - n[2] * u[1], n[2] * u[0] - n[0] * u[2], n[0] * u[1] - n[1] * u[0]];
        for step in 0..24 {
            let angle = f64::from(step) / 24.0 * std::f64::consts::TAU;
            let p = std::array::from_fn(|a| {
                disc.centre[a] + disc.radius * (angle.cos() * u[a] + angle.sin() * v[a])
            });
            let is_near = (0..3).all(|a| (p[a] - disc.cell_centre[a]).abs() < 0.6 * cell);
            if !disc.cuts.is_empty() && is_kept(p) && is_near {
                assert!(turned_box(p) < 0.35 * cell, "{}", turned_box(p) / cell);
            }
        }
    })
    .unwrap();
    assert!(cut > 400, "{cut}");
}

#[test]
fn bytes_do_not_depend_on_the_number_of_threads() {
    let tree = tree(torus, 2);
    let made = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| written(&levels(&tree, None)).0)
    };
    let one = made(1);
    assert!(made(2) == one && made(7) == one);
}

#[test]
fn any_level_of_a_file_is_that_of_one_that_ends_there() {
    let tree = tree(torus, 2);
    let levels_to = |level| {
        SplatLevels::new(&tree, LevelsOptions { level: Some(level), ..LevelsOptions::default() }, &Silent)
            .unwrap()
    };
    let (whole, _) = written(&levels(&tree, None));
    let (coarse, _) = written(&levels_to(1));
    assert_eq!(discs(&read(&whole), Some(1)).len(), discs(&read(&coarse), None).len());
}

#[test]
fn damaged_files_are_refused() {
    let (bytes, _) = written(&levels(&tree(ball, 2), None));
    let is_read = |bytes: &[u8]| read_tree(bytes, None, &Silent).unwrap().is_ok();
    assert!(is_read(&bytes));
    for end in (0..bytes.len()).step_by(997) {
        assert!(!is_read(&bytes[..end]), "cut at {end}");
    }
    for at in (HEADER_BYTES..bytes.len()).step_by(997).chain(0..HEADER_BYTES) {
        let mut damaged = bytes.clone();
        damaged[at] ^= 1 << (at % 8);
        assert!(!is_read(&damaged), "changed at {at}");
    }
}

#[test]
fn a_directory_may_come_in_pieces() {
    let (bytes, _) = written(&levels(&tree(ball, 3), None));
    let header = crate::bsp::Header::read(&bytes).unwrap();
    let directory = &bytes[HEADER_BYTES..header.head_start()];
    let head = &bytes[header.head_start()..header.units_start()];
    let entry = crate::bsp::ENTRY_BYTES;
    assert!(header.units > 20);
    let open = |directory: &[u8]| SplatTree::open_part(header.clone(), directory, head);
    for known in [0, 1, 5, 9, header.units as usize] {
        let mut tree = open(&directory[..known * entry]).unwrap();
        // A unit can be read as soon as its entry is there.
        for unit in 0..known.min(8) {
            let [start, end] = [unit, unit + 1].map(|n| tree.start(n) as usize);
            let cells = tree.decode(unit, &bytes[start..end]).unwrap();
            tree.take(unit, &cells);
        }
        directory[known * entry..].chunks(7 * entry).for_each(|more| tree.add_entries(more).unwrap());
        assert_eq!(tree.entries(), read(&bytes).entries());
        assert!(tree.add_entries(&directory[..entry]).is_err(), "more than there are");
    }
    assert!(open(&directory[..entry + 1]).is_err(), "part of an entry");
    assert!(open(&directory[entry..2 * entry]).is_err(), "the first is missing");
    let mut damaged = directory.to_vec();
    damaged[12] ^= 1;
    assert!(open(&damaged).is_err());
    let mut tree = open(&damaged[..entry]).unwrap();
    let [start, end] = [0, 1].map(|n| tree.start(n) as usize);
    assert!(tree.decode(0, &bytes[start..end]).is_err(), "the unit's own checksum");
    assert!(tree.add_entries(&damaged[entry..]).is_err());
}

/// Files that pass for sound by their checksums, whatever is in them.
#[test]
fn forged_files_give_splats_or_a_fault() {
    let (bytes, _) = written(&levels(&tree(ball, 1), None));
    let mut refused = 0;
    for at in (HEADER_BYTES..bytes.len()).step_by(131) {
        let mut forged = bytes.clone();
        forged[at] = forged[at].wrapping_mul(7).wrapping_add(at as u8);
        let Some(forged) = fuzz::sealed(&forged) else { continue };
        fuzz::bsp(&forged);
        refused += usize::from(read_tree(&forged, None, &Silent).unwrap().is_err());
    }
    assert!(refused > 10, "{refused}");
}

/// What version 1 is.
const GOLDEN: &[u8] = include_bytes!("../../golden/v1/torus.bsp");

fn golden() -> Vec<u8> {
    written(&levels(&tree(torus, 1), Some(0.004))).0
}

#[test]
fn the_golden_file_is_read_and_written() {
    let file = read(GOLDEN);
    assert_eq!((file.header().deepest, file.header().unit), (1, *b"mm\0\0\0\0\0\0"));
    let discs = discs(&file, None);
    assert!(discs.len() > 1000 && discs.iter().all(|disc| torus(disc.centre).abs() < 0.01));
    assert!(golden() == GOLDEN, "a change of the format is a new version");
}

#[test]
#[ignore = "writes the golden file and the seed of the fuzzer"]
fn makes_golden_files() {
    let top = std::path::Path::new(env!("CARGO_MANIFEST_DIR"));
    std::fs::write(top.join("golden/v1/torus.bsp"), golden()).unwrap();
    std::fs::write(top.join("../../fuzz/seeds/bsp/torus.bsp"), golden()).unwrap();
    let small = written(&levels(&tree(turned_box, 0), None)).0;
    std::fs::write(top.join("../../fuzz/seeds/bsp/box.bsp"), small).unwrap();
}

#[test]
fn a_part_without_boundary_has_no_splats() {
    let empty = tree(|_| 1.0, 1);
    let (bytes, summary) = written(&levels(&empty, None));
    assert_eq!((summary.splats, summary.finest), (0, 0));
    assert!(discs(&read(&bytes), None).is_empty());
}

#[test]
fn splats_that_do_not_fit_in_memory_change_no_byte() {
    let tree = tree(torus, 2);
    let folder = tempfile::tempdir().unwrap();
    let bounds = [[0.0; 3], [1.0; 3]];
    let all = levels(&tree, None);
    let expected = bsp_bytes(&all, "mm", bounds, &Silent).unwrap().0;
    for most in [0, 20_000] {
        let options = LevelsOptions { memory: Some((most, folder.path())), ..LevelsOptions::default() };
        let spilled = SplatLevels::new(&tree, options, &Silent).unwrap();
        assert_eq!(spilled.len(), all.len());
        assert_eq!(bsp_bytes(&spilled, "mm", bounds, &Silent).unwrap().0, expected);
        let discs = |levels: &SplatLevels| {
            let mut discs = Vec::new();
            discs_of_levels(levels, None, |disc| discs.push(format!("{disc:?}"))).unwrap();
            discs
        };
        assert_eq!(discs(&spilled), discs(&all));
    }
    let nowhere = folder.path().join("none");
    let options = LevelsOptions { memory: Some((0, &nowhere)), ..LevelsOptions::default() };
    assert!(SplatLevels::new(&tree, options, &Silent).is_err());
}

#[test]
fn the_finest_splats_alone_are_those_that_all_levels_have() {
    let tree = tree(torus, 2);
    for level in [None, Some(1), Some(0)] {
        let discs = |finest_only| {
            let options = LevelsOptions { level, finest_only, ..LevelsOptions::default() };
            let levels = SplatLevels::new(&tree, options, &Silent).unwrap();
            let mut discs = Vec::new();
            discs_of_levels(&levels, None, |disc| discs.push(disc)).unwrap();
            discs
        };
        let alone = discs(true);
        assert!(alone.len() > 100 && alone == discs(false), "{level:?}");
    }
}

/// The figure of a torus in the survey of Kobbelt and Botsch (2004), 13: what a number of splats is off by. `--nocapture`
/// prints the report's table.
#[test]
fn torus_of_few_splats() {
    let tree = tree(torus, 2);
    let crossings = crossings(&tree);
    let diameter = 2.0 * 0.84;
    for error in [0.002, 0.003, 0.004, 0.01] {
        let mut discs = Vec::new();
        discs_of_levels(&levels(&tree, Some(error)), None, |disc| discs.push(disc)).unwrap();
        let mut off = 0.0f64;
        for disc in &discs {
            for n in 0..31 * 31 {
                let [u, v] = [n % 31, n / 31].map(|c| (f64::from(c) / 15.0 - 1.0) * disc.radius);
                let side = if disc.normal[2].abs() < 0.8 { [0.0, 0.0, 1.0] } else { [1.0, 0.0, 0.0] };
                let n = disc.normal;
                let a = [
                    n[1] * side[2] - n[2] * side[1],
                    n[2] * side[0] - n[0] * side[2],
                    n[0] * side[1] - n[1] * side[0],
                ];
                let a = a.map(|c| c / length(a));
                let b = [n[1] * a[2] - n[2] * a[1], n[2] * a[0] - n[0] * a[2], n[0] * a[1] - n[1] * a[0]];
                let p: Vector = std::array::from_fn(|c| disc.centre[c] + u * a[c] + v * b[c]);
                let beyond = |(n, d): &(Vector, f64)| (0..3).map(|a| n[a] * p[a]).sum::<f64>() > *d;
                let in_cell = (0..3).all(|c| (p[c] - disc.cell_centre[c]).abs() <= disc.cell / 2.0);
                if in_cell && !disc.cuts.iter().any(beyond) {
                    off = off.max(torus(p).abs());
                }
            }
        }
        let covered = worst(&discs, &crossings);
        let share = |length: f64| length / diameter * 100.0;
        println!(
            "{} splats: asked {:.3} %, crossings {:.3} %, splats {:.3} % of the diameter",
            discs.len(),
            share(error),
            share(covered),
            share(off)
        );
        assert!(covered <= error && off <= 1.1 * error.max(0.004), "{error}: {covered}, {off}");
    }
}

#[test]
fn a_page_gets_the_whole_picture_from_what_is_in_view() {
    use brickfield_coding::draw::{
        DrawStyle, DrawView, PageCanvas, packed_splats, seen_nodes, units_to_refine,
    };
    let (bytes, _) = written(&levels(&tree(torus, 3), None));
    let mut tree = SplatTree::open(&bytes).unwrap();
    let head = tree.pieces().clone();
    let decoded = |tree: &SplatTree, unit: usize| {
        let range = tree.start(unit) as usize..tree.start(unit + 1) as usize;
        tree.decode(unit, &bytes[range]).unwrap()
    };
    let (units, deepest) = (tree.entries().len(), u32::from(tree.header().deepest));
    let view = DrawView {
        size: [200, 200],
        origin: tree.header().origin,
        edge: tree.header().edge,
        axes: [[1.0, 0.0, 0.0], [0.0, 0.8, 0.6], [0.0, -0.6, 0.8]],
        centre: [0.0; 3],
        pixel: 0.011,
        distance: 5.0,
        highest: None,
        style: DrawStyle::Light,
        deepest,
    };
    let (mut loaded, mut canvas, mut splats) = (vec![false; units], PageCanvas::default(), Vec::new());
    let mut draw = |tree: &SplatTree, loaded: &[bool]| {
        let has_below = |key: u64, level: u32| {
            level < u32::from(tree.header().head) || tree.unit_of(key).is_some_and(|unit| loaded[unit])
        };
        packed_splats(tree, deepest, has_below, &mut splats);
        canvas.draw(&splats, &view);
        (canvas.pixels().to_vec(), seen_nodes(&splats, canvas.seen()))
    };
    // Where cells are small enough by now nothing is wanted.
    let (_, seen) = draw(&tree, &loaded);
    assert!(seen.len() > 3 && units_to_refine(&tree, &seen, |_| false, &view, 100.0).is_empty());
    loop {
        let (_, seen) = draw(&tree, &loaded);
        let found = units_to_refine(&tree, &seen, |unit| loaded[unit], &view, 0.01);
        if found.is_empty() {
            break;
        }
        for unit in found.into_iter().map(|unit| unit as usize) {
            let cells = decoded(&tree, unit);
            tree.take(unit, &cells);
            loaded[unit] = true;
        }
    }
    let (pixels, _) = draw(&tree, &loaded);
    let count = loaded.iter().filter(|is_loaded| **is_loaded).count();
    assert!(count > 5 && count < units, "{count} of {units}");
    let mut all = SplatTree::open(&bytes).unwrap();
    for unit in 0..units {
        let cells = decoded(&all, unit);
        all.take(unit, &cells);
    }
    let (whole, _) = draw(&all, &vec![true; units]);
    let others = pixels.iter().zip(&whole).filter(|(a, b)| a != b).count();
    assert!(others <= 20, "{others} pixels differ");
    // What was forgotten can be read again.
    for unit in (0..units).rev().filter(|unit| loaded[*unit]) {
        tree.forget(unit);
    }
    let left: Vec<_> = tree.pieces().iter().filter(|(_, piece)| !piece.cells.is_empty()).collect();
    assert!(left.into_iter().eq(head.iter().filter(|(_, piece)| !piece.cells.is_empty())));
    for unit in 0..units {
        let cells = decoded(&tree, unit);
        tree.take(unit, &cells);
    }
    assert!(tree.pieces().iter().eq(all.pieces().iter()));
}
