//! `thickness`, `offset` and `deviation`: distances from the surface of a part.

use crate::support::*;
use brickfield_bench_data::{Mesh, shapes, write};
use brickfield_engine::brick::{Brick, SignChanges};
use brickfield_engine::lattice::Axis;
use brickfield_engine::store::{BrickTree, Store};
use std::path::{Path, PathBuf};

pub(super) fn stl_of(dir: &Scratch, name: &str, mesh: &Mesh) -> PathBuf {
    let mut bytes = Vec::new();
    write::stl(&mut bytes, mesh).unwrap();
    dir.file(name, bytes)
}

/// Positions of a PLY that the program wrote, with the number of each vertex.
fn scalars(path: &Path) -> Vec<([f64; 3], f64)> {
    let bytes = std::fs::read(path).unwrap();
    let end = b"end_header\n";
    let at = bytes.windows(end.len()).position(|w| w == end).unwrap() + end.len();
    let header = std::str::from_utf8(&bytes[..at]).unwrap();
    let count = header.lines().find_map(|line| line.strip_prefix("element vertex ")).unwrap();
    let count: usize = count.parse().unwrap();
    let number = |b: &[u8]| f64::from(f32::from_le_bytes(b.try_into().unwrap()));
    let vertex = |b: &[u8]| ([number(&b[..4]), number(&b[4..8]), number(&b[8..12])], number(&b[12..16]));
    bytes[at..][..16 * count].chunks_exact(16).map(vertex).collect()
}

/// A place, and the unit normal there.
pub(super) type Crossing = ([f64; 3], [f64; 3]);

/// Where the surface of a store crosses lattice edges, in the world, with the normals there; and its finest cell.
pub(super) fn crossings(path: &Path) -> (Vec<Crossing>, f64) {
    let store = Store::open(path, 64 << 20).unwrap();
    let root = store.root();
    let mut found = Vec::new();
    for key in store.keys() {
        if !store.node(key).unwrap().leaf {
            continue;
        }
        let brick = store.brick(key).unwrap();
        let Brick::Counts { samples, hermite } = &*brick else { continue };
        let signs = SignChanges::of(samples);
        for axis in Axis::ALL {
            let mut edges = hermite.edges[axis.index()].iter();
            signs.for_edges(axis, |low| {
                let edge = edges.next().unwrap();
                let spacing = f64::from(1u32 << key.spacing_bits());
                let mut units: [f64; 3] =
                    std::array::from_fn(|a| f64::from(key.base()[a]) + low[a] as f64 * spacing + 1.0);
                units[axis.index()] += edge.fraction() * spacing;
                found.push((root.to_world(units), edge.normal.to_vector()));
            });
        }
    }
    (found, root.spacing(store.deepest_level()))
}

fn minus(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn length(v: [f64; 3]) -> f64 {
    dot(v, v).sqrt()
}

/// Signed distance from a box about the origin.
fn from_box(p: [f64; 3], half: [f64; 3]) -> f64 {
    let d: [f64; 3] = std::array::from_fn(|a| p[a].abs() - half[a]);
    length(d.map(|c| c.max(0.0))) + d[0].max(d[1]).max(d[2]).min(0.0)
}

/// A plate with walls of 0.8, 1.2 and 2 mm that stand on it, 4 mm high and 4 mm wide, as one body of closed boxes.
fn walls(dir: &Scratch) -> PathBuf {
    let plate = shapes::cuboid([0.0, 0.0, 0.0], [14.0, 6.0, 3.03]);
    let wall = |x: f64, thick: f64| shapes::cuboid([x, 1.0, 3.0], [x + thick, 5.0, 7.0]);
    stl_of(dir, "walls.stl", &Mesh::merged(&[plate, wall(1.51, 0.8), wall(5.03, 1.2), wall(9.07, 2.0)]))
}

#[test]
fn thin_walls_are_regions_of_both_their_sides() {
    let dir = Scratch::new();
    let (part, out, table) = (dir.path("w.brf"), dir.path("t.ply"), dir.path("thin.csv"));
    run(&[&"build", &walls(&dir), &"-o", &part, &"--cell", &"0.2", &"-q"]).ok();
    for method in ["sphere", "ray"] {
        let args: [&dyn AsRef<std::ffi::OsStr>; 11] = [
            &"thickness",
            &part,
            &"-o",
            &out,
            &"--method",
            &method,
            &"--below",
            &"1.5mm",
            &"--regions",
            &table,
            &"--json",
        ];
        let found = run(&args).json();
        assert_eq!(found["method"].as_str(), Some(method));
        let regions = found["regions"].as_array().unwrap();
        assert_eq!(regions.len(), 2, "{method}: {regions:?}");
        for thickness in [0.8, 1.2] {
            let near =
                |row: &&serde_json::Value| (row["mean_thickness"].as_f64().unwrap() - thickness).abs() < 0.01;
            let row = regions.iter().find(near).unwrap_or_else(|| panic!("{thickness} of {regions:?}"));
            // Two faces of 4 by 4, but for what stands in the plate.
            let area = 2.0 * 4.0 * (7.0 - 3.03);
            let number = |name: &str| row[name].as_f64().unwrap();
            assert!((number("area") / area - 1.0).abs() < 0.01, "{row}");
            assert!((number("volume") / (0.5 * area * thickness) - 1.0).abs() < 0.02, "{row}");
            assert!((number("y") - 3.0).abs() < 0.02 && number("min_thickness") > 0.99 * thickness, "{row}");
        }
        let text = std::fs::read_to_string(&table).unwrap();
        assert!(
            text.starts_with("id,area,volume,min_thickness,mean_thickness,x,y,z,layer_first,layer_last\n")
        );
        assert_eq!(text.lines().count(), 3);
    }
    let values = scalars(&out);
    let on_wall = values.iter().filter(|(p, _)| p[2] > 3.5 && p[2] < 6.5 && (p[0] - 1.51).abs() < 1e-4);
    assert!(on_wall.clone().count() > 50 && on_wall.clone().all(|(_, t)| (t - 0.8).abs() < 0.004));
}

#[test]
fn thickness_is_the_same_for_any_threads_and_memory() {
    let dir = Scratch::new();
    let part = dir.path("s.brf");
    let ball = stl_of(&dir, "s.stl", &shapes::icosphere(3, 4.0));
    run(&[&"build", &ball, &"-o", &part, &"--cell", &"0.5", &"-q"]).ok();
    let mut first = None;
    for (threads, memory) in [("1", "1GiB"), ("2", "1GiB"), ("3", "64MiB")] {
        let out = dir.path("t.ply");
        run(&[&"thickness", &part, &"-o", &out, &"-q", &"--threads", &threads, &"--memory", &memory]).ok();
        let bytes = std::fs::read(&out).unwrap();
        assert!(*first.get_or_insert_with(|| bytes.clone()) == bytes, "{threads}");
    }
    let gaps = run(&[&"thickness", &part, &"-o", &dir.path("g.ply"), &"--gaps", &"--json"]).json();
    assert_eq!(gaps["measured"].as_u64(), Some(0), "{gaps}");
    assert_eq!(gaps["without_opposite"], gaps["vertices"]);
    let coarse = run(&[
        &"thickness",
        &part,
        &"-o",
        &dir.path("c.ply"),
        &"-q",
        &"--below",
        &"0.1",
        &"--regions",
        &dir.path("c.csv"),
    ]);
    coarse.ok_but_for("is less than 2 cells");
}

/// Offsets of a ball of 5 mm in cells of 0.5 mm, to which all facets are as a ball.
#[test]
fn offsets_of_a_ball_are_balls() {
    let dir = Scratch::new();
    let (part, out, mesh) = (dir.path("s.brf"), dir.path("o.brf"), dir.path("o.stl"));
    let ball = stl_of(&dir, "s.stl", &shapes::icosphere(6, 5.0));
    run(&[&"build", &ball, &"-o", &part, &"--cell", &"0.5", &"-q"]).ok();
    for by in ["0.5mm", "2.5mm", "-0.5mm", "-2.5mm"] {
        run(&[&"offset", &part, &"--by", &by, &"-o", &out, &"-q"]).ok();
        run(&[&"verify", &out, &"-q"]).ok();
        let expected = 5.0 + by.trim_end_matches("mm").parse::<f64>().unwrap();
        let (found, cell) = crossings(&out);
        assert!(found.len() > 100 && (cell - 0.5).abs() < 1e-12);
        let mut squares = 0.0;
        for (at, normal) in &found {
            let error = (length(*at) - expected) / cell;
            assert!(error.abs() <= 0.02, "{by}: {error} at {at:?}");
            // Facets turn the normals of crossings.
            assert!(dot(*at, *normal) / length(*at) > 0.998, "{by}: {normal:?} at {at:?}");
            squares += error * error;
        }
        // Chords of the facets lie up to 0.003 cells within the ball.
        assert!((squares / found.len() as f64).sqrt() <= 0.003, "{by}: {squares}");
        let checked = run(&[&"mesh", &out, &"-o", &mesh, &"--check", &"-q"]);
        assert_eq!(checked.status, Some(0), "{}", checked.stderr);
    }
}

/// A store of a turned box in cells of 0.3, half of its edges, and what turns places back to where it has its axes.
fn turned_box(dir: &Scratch) -> (PathBuf, [f64; 3], impl Fn([f64; 3]) -> [f64; 3]) {
    let half = [4.0, 3.0, 2.5];
    let (axis, angle) = ([1.0, 2.0, 3.0], 0.7);
    let mesh = shapes::cuboid(half.map(|h| -h), half).rotated(axis, angle);
    let part = dir.path("b.brf");
    run(&[&"build", &stl_of(dir, "b.stl", &mesh), &"-o", &part, &"--cell", &"0.3", &"-q"]).ok();
    // Where the axes have gone to.
    let units = vec![[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    let axes = Mesh { vertices: units, triangles: Vec::new() }.rotated(axis, angle).vertices;
    (part, half, move |p| std::array::from_fn(|a| dot(axes[a], p)))
}

#[test]
fn a_shrunk_box_is_sharp_and_a_grown_one_round() {
    let dir = Scratch::new();
    let (part, half, back) = turned_box(&dir);
    for by in [0.9f64, 0.3, -0.3, -0.9] {
        let (out, text) = (dir.path("o.brf"), format!("{by}"));
        run(&[&"offset", &part, &"--by", &text, &"-o", &out, &"-q", &"--threads", &"2"]).ok();
        let bytes = std::fs::read(&out).unwrap();
        run(&[&"offset", &part, &"--by", &text, &"-o", &out, &"-q", &"--threads", &"1"]).ok();
        assert!(bytes == std::fs::read(&out).unwrap());
        let (found, cell) = crossings(&out);
        let (mut squares, mut far) = (0.0, 0);
        for (at, _) in &found {
            let off = match by {
                by if by < 0.0 => from_box(back(*at), half.map(|h| h + by)),
                by => from_box(back(*at), half) - by,
            };
            let error = off / cell;
            squares += error * error;
            // Outward, corners that no cell resolves are told by the patches around them.
            assert!(error.abs() <= if by < 0.0 { 0.02 } else { 0.1 }, "{by}: {error} at {at:?}");
            far += usize::from(error.abs() > 0.02);
        }
        let rms = (squares / found.len() as f64).sqrt();
        assert!(rms <= if by < 0.0 { 0.003 } else { 0.006 }, "{by}: {rms}");
        assert!(far * 50 <= found.len(), "{by}: {far} of {}", found.len());
    }
    let shell = dir.path("shell.brf");
    run(&[&"offset", &part, &"--shell", &"0.9", &"-o", &shell, &"-q"]).ok();
    let (found, cell) = crossings(&shell);
    let sides = found.iter().map(|(at, _)| {
        let p = back(*at);
        let (outer, inner) = (from_box(p, half).abs(), from_box(p, half.map(|h| h - 0.9)).abs());
        assert!(outer.min(inner) / cell <= 0.05, "{outer} {inner}");
        usize::from(inner < outer)
    });
    let inner: usize = sides.sum();
    assert!(inner > found.len() / 5 && inner < found.len() / 2);
    let nothing = run(&[&"offset", &part, &"--by", &"-3mm", &"-o", &dir.path("n.brf"), &"-q"]).failed();
    let far = run(&[&"offset", &part, &"--by", &"1000mm", &"-o", &dir.path("n.brf"), &"-q"]).failed();
    assert!(far.contains("more than the diagonal of the part") && !dir.path("n.brf").exists(), "{far}");
    assert!(nothing.contains("nothing is left of the part"), "{nothing}");
    assert!(!dir.path("n.brf").exists() && dir.names().iter().all(|name| !name.ends_with(".part")));
}

/// Of a box whose faces lie at samples, corners of patches may be turned away from what is outside.
#[test]
fn a_grown_box_whose_faces_are_at_samples_has_no_spikes() {
    let dir = Scratch::new();
    let (size, cell) = ([20.0, 13.0, 5.0], 0.2);
    let (part, out) = (dir.path("b.brf"), dir.path("o.brf"));
    let mesh = shapes::cuboid([0.0; 3], size);
    run(&[&"build", &stl_of(&dir, "b.stl", &mesh), &"-o", &part, &"--cell", &"0.2", &"-q"]).ok();
    for by in [0.2, 0.25, 0.3, 0.5] {
        run(&[&"offset", &part, &"--by", &format!("{by}"), &"-o", &out, &"-q"]).ok();
        let (found, _) = crossings(&out);
        assert!(found.len() > 10_000);
        for (at, _) in found {
            let off = from_box(std::array::from_fn(|a| at[a] - size[a] / 2.0), size.map(|c| c / 2.0)) - by;
            assert!((off / cell).abs() <= 0.02, "{by}: {} at {at:?}", off / cell);
        }
    }
}

/// The volume that a mesh encloses.
fn enclosed(stl: &Path) -> f64 {
    let bytes = std::fs::read(stl).unwrap();
    let number = |b: &[u8]| f64::from(f32::from_le_bytes(b.try_into().unwrap()));
    let corner = |b: &[u8]| [number(&b[..4]), number(&b[4..8]), number(&b[8..12])];
    let sixfold = |facet: &[u8]| {
        let [a, b, c] = [12, 24, 36].map(|at| corner(&facet[at..at + 12]));
        a[0] * (b[1] * c[2] - b[2] * c[1])
            + a[1] * (b[2] * c[0] - b[0] * c[2])
            + a[2] * (b[0] * c[1] - b[1] * c[0])
    };
    bytes[84..].chunks_exact(50).map(sixfold).sum::<f64>() / 6.0
}

#[test]
fn a_cube_grown_with_sharp_edges_is_a_cube() {
    let dir = Scratch::new();
    let (part, half, back) = turned_box(&dir);
    let (out, stl) = (dir.path("o.brf"), dir.path("o.stl"));
    for by in [0.9f64, 0.3] {
        let text = format!("{by}");
        let mut bytes = None;
        for threads in ["2", "1"] {
            run(&[&"offset", &part, &"--by", &text, &"--sharp", &"-o", &out, &"-q", &"--threads", &threads])
                .ok();
            let now = std::fs::read(&out).unwrap();
            assert!(*bytes.get_or_insert_with(|| now.clone()) == now);
        }
        let (found, cell) = crossings(&out);
        let grown = half.map(|h| h + by);
        let (mut squares, mut most, mut at_edges) = (0.0, 0.0f64, 0);
        for (at, normal) in &found {
            let own = back(*at);
            let error = from_box(own, grown) / cell;
            squares += error * error;
            most = most.max(error.abs());
            // Within a cell of an edge of the grown box.
            at_edges += usize::from((0..3).filter(|&a| grown[a] - own[a].abs() < cell).count() >= 2);
            let turned = back(*normal);
            let face = (0..3).max_by(|&a, &b| turned[a].abs().total_cmp(&turned[b].abs())).unwrap();
            assert!(turned[face].abs() > 0.999, "{turned:?}: {own:?}, off by {error}");
        }
        let rms = (squares / found.len() as f64).sqrt();
        println!("{by}: {} crossings, {at_edges} at edges, rms {rms}, most {most}", found.len());
        assert!(at_edges > 100 && most <= 0.05 && rms <= 0.003, "{by}: {most} {rms}");
        let checked = run(&[&"mesh", &out, &"-o", &stl, &"--check", &"-q"]);
        assert_eq!(checked.status, Some(0), "{}", checked.stderr);
        let volume = grown.iter().map(|h| 2.0 * h).product::<f64>();
        assert!((enclosed(&stl) / volume - 1.0).abs() < 5e-4, "{by}: {} {volume}", enclosed(&stl));
    }
    // With the least limit an edge ends where a round one does.
    run(&[&"offset", &part, &"--by", &"0.9", &"--sharp", &"--mitre-limit", &"1", &"-o", &out, &"-q"]).ok();
    let round = dir.path("r.brf");
    run(&[&"offset", &part, &"--by", &"0.9", &"-o", &round, &"-q"]).ok();
    let (limited, round) = (crossings(&out).0, crossings(&round).0);
    assert!(
        (limited.len() as f64 / round.len() as f64 - 1.0).abs() < 0.01,
        "{} {}",
        limited.len(),
        round.len()
    );
    for (args, words) in [
        (vec!["--by", "-0.3", "--sharp"], "is for lengths outward"),
        (vec!["--shell", "0.3", "--sharp"], "cannot be used with"),
        (vec!["--by", "0.3", "--mitre-limit", "2"], "--sharp"),
        (vec!["--by", "0.3", "--sharp", "--mitre-limit", "0.5"], "no number from 1 to 100"),
    ] {
        let mut all: Vec<&dyn AsRef<std::ffi::OsStr>> = vec![&"offset", &part, &"-o", &out];
        all.extend(args.iter().map(|arg| arg as &dyn AsRef<std::ffi::OsStr>));
        let text = run(&all).misused();
        assert!(text.contains(words), "{args:?}: {text}");
    }
}

/// The distance of a point from a triangle, from its plane or its sides. Shares nothing with the engine.
fn from_triangle(p: [f64; 3], [a, b, c]: [[f64; 3]; 3]) -> f64 {
    let cross = |u: [f64; 3], v: [f64; 3]| {
        [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]]
    };
    let normal = cross(minus(b, a), minus(c, a));
    let is_over = |from, to| dot(cross(normal, minus(to, from)), minus(p, from)) >= 0.0;
    if is_over(a, b) && is_over(b, c) && is_over(c, a) {
        return dot(normal, minus(p, a)).abs() / length(normal);
    }
    let side = |from: [f64; 3], to: [f64; 3]| {
        let along = minus(to, from);
        let t = (dot(minus(p, from), along) / dot(along, along)).clamp(0.0, 1.0);
        length(std::array::from_fn(|n| p[n] - from[n] - t * along[n]))
    };
    side(a, b).min(side(b, c)).min(side(c, a))
}

/// Whether a point is inside, by the solid angles of all facets (van Oosterom & Strackee 1983).
fn is_inside(p: [f64; 3], facets: &[[[f64; 3]; 3]]) -> bool {
    let angle = |t: &[[f64; 3]; 3]| {
        let [a, b, c] = t.map(|q| minus(q, p));
        let (x, y, z) = (length(a), length(b), length(c));
        let triple = a[0] * (b[1] * c[2] - b[2] * c[1]) - a[1] * (b[0] * c[2] - b[2] * c[0])
            + a[2] * (b[0] * c[1] - b[1] * c[0]);
        2.0 * triple.atan2(x * y * z + dot(a, b) * z + dot(b, c) * x + dot(c, a) * y)
    };
    facets.iter().map(angle).sum::<f64>() > 2.0 * std::f64::consts::PI
}

#[test]
fn deviations_are_those_of_all_triangles_with_the_right_sign() {
    let dir = Scratch::new();
    let (part, out) = (dir.path("s.brf"), dir.path("d.ply"));
    let ball = stl_of(&dir, "s.stl", &shapes::icosphere(4, 5.0));
    run(&[&"build", &ball, &"-o", &part, &"--cell", &"0.4", &"-q"]).ok();
    let other = Mesh::merged(&[
        shapes::icosphere(2, 5.0).scaled([1.04, 0.98, 1.0]).translated([0.1, 0.05, -0.1]),
        shapes::cuboid([1.0, 1.0, 1.0], [4.0, 4.0, 4.5]),
    ]);
    let reference = stl_of(&dir, "r.stl", &other);
    let facets: Vec<[[f64; 3]; 3]> =
        other.soup().iter().map(|facet| facet.map(|c| c.map(f64::from))).collect();
    let told = run(&[&"deviation", &part, &reference, &"-o", &out, &"--json"]).json();
    let values = scalars(&out);
    assert_eq!(told["part_to_reference"]["points"].as_u64(), Some(values.len() as u64));
    for (p, value) in values.iter().step_by(3) {
        let nearest = facets.iter().map(|t| from_triangle(*p, *t)).fold(f64::INFINITY, f64::min);
        let expected = if is_inside(*p, &facets) { -nearest } else { nearest };
        assert!((value - expected).abs() < 1e-5, "{p:?}: {value} {expected}");
    }
    let largest = values.iter().map(|(_, v)| *v).fold(0.0, f64::max);
    let max = told["part_to_reference"]["max"].as_f64().unwrap();
    assert!((largest - max).abs() < 1e-4, "{largest} {max}");
    // The same from a store, to a hundredth of a cell or two.
    let store = dir.path("r.brf");
    let alone = stl_of(&dir, "a.stl", &shapes::icosphere(2, 5.0).scaled([1.04, 0.98, 1.0]));
    run(&[&"build", &alone, &"-o", &store, &"--cell", &"0.1", &"-q"]).ok();
    let again = dir.path("e.ply");
    run(&[&"deviation", &part, &alone, &"-o", &out, &"-q"]).ok();
    run(&[&"deviation", &part, &store, &"-o", &again, &"-q"]).ok();
    let (values, others) = (scalars(&out), scalars(&again));
    let mut errors: Vec<f64> = values.iter().zip(&others).map(|(a, b)| (a.1 - b.1).abs() / 0.1).collect();
    errors.sort_by(f64::total_cmp);
    assert!(errors[errors.len() * 999 / 1000] < 0.05, "{:?}", &errors[errors.len() - 20..]);
}

/// A reference and a mesh of which a part at a time is in memory give the same bytes.
#[test]
fn deviations_are_the_same_where_not_all_fits() {
    let dir = Scratch::new();
    let part = dir.path("s.brf");
    let ball = stl_of(&dir, "s.stl", &shapes::icosphere(3, 5.0));
    run(&[&"build", &ball, &"-o", &part, &"--cell", &"1", &"-q"]).ok();
    let reference = stl_of(&dir, "r.stl", &shapes::icosphere(5, 5.0).scaled([1.04, 0.98, 1.0]));
    let mut first = None;
    for (threads, memory) in [("2", "1GiB"), ("1", "1MiB")] {
        let (out, thick) = (dir.path("d.ply"), dir.path("t.ply"));
        let args: [&dyn AsRef<std::ffi::OsStr>; 9] =
            [&"deviation", &part, &reference, &"-o", &out, &"--threads", &threads, &"--memory", &memory];
        let mut all = args.to_vec();
        all.push(&"--json");
        let told = run(&all).json();
        let walls =
            run(&[&"thickness", &part, &"-o", &thick, &"--memory", &memory, &"--method", &"ray", &"--json"])
                .json();
        let now = (std::fs::read(&out).unwrap(), std::fs::read(&thick).unwrap(), told, walls);
        assert!(*first.get_or_insert_with(|| now.clone()) == now, "{memory}");
    }
}

#[test]
fn a_shift_a_turn_and_a_bump_are_found() {
    let dir = Scratch::new();
    let half = [4.0, 3.0, 2.5];
    let plain = shapes::cuboid(half.map(|h| -h), half);
    let bumped = Mesh::merged(&[plain.clone(), shapes::cuboid([-1.0, -1.0, 2.0], [1.0, 1.0, 2.9])]);
    let (part, out, table) = (dir.path("p.brf"), dir.path("d.ply"), dir.path("r.csv"));
    run(&[&"build", &stl_of(&dir, "p.stl", &bumped), &"-o", &part, &"--cell", &"0.2", &"-q"]).ok();
    let moved = stl_of(&dir, "m.stl", &plain.clone().translated([20.0, 1.5, -0.7]));
    let refused = run(&[&"deviation", &part, &moved, &"-o", &out]).failed();
    assert!(
        refused.contains("does not overlap") && refused.contains("the reference at (16.000"),
        "{refused}"
    );
    assert!(!out.exists());
    let run_to = |reference: &Path, align: &str| {
        let args: [&dyn AsRef<std::ffi::OsStr>; 11] = [
            &"deviation",
            &part,
            &reference,
            &"-o",
            &out,
            &"--align",
            &align,
            &"--within",
            &"0.1mm",
            &"--regions",
            &table,
        ];
        let mut args = args.to_vec();
        args.push(&"--json");
        run(&args)
    };
    let found = run_to(&moved, "shift");
    assert_eq!(found.status, Some(1));
    assert!(found.stderr.contains("is above --within 0.1"), "{}", found.stderr);
    let told: serde_json::Value = serde_json::from_str(&found.stdout).unwrap();
    let shift = |told: &serde_json::Value| [0, 1, 2].map(|n| told["align"]["shift"][n].as_f64().unwrap());
    assert!(length(minus(shift(&told), [20.0, 1.5, -0.7])) < 0.002, "{}", told["align"]);
    let regions = told["regions"].as_array().unwrap();
    assert_eq!(regions.len(), 1, "{regions:?}");
    let number = |name: &str| regions[0][name].as_f64().unwrap();
    assert_eq!(regions[0]["side"].as_str(), Some("over"));
    assert!((number("max_deviation") - 0.4).abs() < 0.004 && (number("z") - 2.85).abs() < 0.1, "{regions:?}");
    // Its top, and of its sides what is higher than 0.1.
    // The border of a region is as coarse as cells.
    assert!((number("area") - (4.0 + 8.0 * 0.3)).abs() < 8.0 * 0.2, "{regions:?}");
    let (axis, angle) = ([1.0, -2.0, 0.5], 0.12);
    let turned = stl_of(&dir, "t.stl", &plain.rotated(axis, angle).translated([0.5, 0.3, 1.0]));
    let told: serde_json::Value = serde_json::from_str(&run_to(&turned, "icp").stdout).unwrap();
    let degrees = told["align"]["degrees"].as_f64().unwrap();
    assert!((degrees - angle.to_degrees()).abs() < 0.02, "{}", told["align"]);
    assert!(length(minus(shift(&told), [0.5, 0.3, 1.0])) < 0.004, "{}", told["align"]);
    assert!((told["part_to_reference"]["max"].as_f64().unwrap() - 0.4).abs() < 0.01);
    // Nearly in place, the shift is told.
    let near =
        stl_of(&dir, "n.stl", &shapes::cuboid(half.map(|h| -h), [4.0, 3.0, 2.9]).translated([1.0, 0.0, 0.0]));
    let told = run(&[&"deviation", &part, &near, &"-o", &out]);
    assert!(told.notes.contains("differ by a shift of (1.000, 0.000, 0.000) mm"), "{}", told.notes);
}

#[test]
fn what_cannot_be_compared_is_a_line() {
    let dir = Scratch::new();
    let half = [4.0, 3.0, 2.5];
    let mesh = shapes::cuboid(half.map(|h| -h), half);
    let (part, out) = (dir.path("p.brf"), dir.path("d.ply"));
    let own = stl_of(&dir, "p.stl", &mesh);
    run(&[&"build", &own, &"-o", &part, &"--depth", &"1", &"-q"]).ok();
    let mut open = mesh.clone();
    open.triangles.pop();
    let lidless = stl_of(&dir, "o.stl", &open);
    let fraction = dir.path("f.brf");
    run(&[&"build", &lidless, &"-o", &fraction, &"--depth", &"1", &"-q"]).ok();
    let nowhere = dir.path("x/d.ply");
    for (args, words) in [
        (vec!["thickness"], "open input or a point cloud"),
        (vec!["offset", "--by", "1"], "open input or a point cloud"),
        (vec!["deviation", own.to_str().unwrap()], "open input or a point cloud"),
    ] {
        let name = if args[0] == "offset" { dir.path("n.brf") } else { dir.path("n.ply") };
        let mut all: Vec<&dyn AsRef<std::ffi::OsStr>> = vec![&args[0], &fraction];
        all.extend(args[1..].iter().map(|arg| arg as &dyn AsRef<std::ffi::OsStr>));
        all.extend([&"-o" as &dyn AsRef<std::ffi::OsStr>, &name]);
        let text = run(&all).failed();
        assert!(text.contains(words), "{args:?}: {text}");
        assert!(!name.exists());
    }
    let empty = dir.file("empty.stl", "solid a\nendsolid a\n");
    let text = run(&[&"deviation", &part, &empty, &"-o", &out]).failed();
    assert!(text.contains("empty.stl: the reference has no triangle with area"), "{text}");
    // A cuboid has no gaps: that is said, and is no number.
    let gaps = dir.path("gaps.ply");
    let told = run(&[&"thickness", &part, &"-o", &gaps, &"--gaps"]).ok();
    assert!(told.contains("no gaps, as nothing is opposite"), "{told}");
    let json = run(&[&"thickness", &part, &"-o", &gaps, &"--gaps", &"--json"]).json();
    assert!(json["measured"] == 0 && json["max"].is_null() && json["mean"].is_null(), "{json}");
    for (ratio, words) in [(25.4, "25.4 times larger"), (0.001, "1000 times smaller")] {
        let other = stl_of(&dir, "u.stl", &mesh.clone().scaled([ratio; 3]));
        let text = run(&[&"deviation", &part, &other, &"-o", &out]).failed();
        assert!(text.contains(words), "{text}");
    }
    assert!(
        run(&[&"deviation", &part, &own, &"-o", &nowhere]).failed().contains("create the directory first")
    );
    run(&[&"deviation", &part, &own, &"-o", &dir.path("d.stl")]).misused();
    run(&[&"deviation", &part, &own, &"-o", &out, &"--regions", &dir.path("r.csv")]).misused();
    run(&[&"thickness", &part, &"-o", &out, &"--separation", &"181"]).misused();
    run(&[&"thickness", &part, &"-o", &out, &"--below", &"1mm"]).misused();
    run(&[&"offset", &part, &"-o", &dir.path("o.brf")]).misused();
    run(&[&"offset", &part, &"-o", &dir.path("o.brf"), &"--by", &"1", &"--shell", &"1"]).misused();
    let mut turned = mesh.clone();
    turned.triangles.iter_mut().for_each(|corners| corners.swap(1, 2));
    let turned = stl_of(&dir, "t.stl", &turned);
    run(&[&"deviation", &part, &turned, &"-o", &out, &"-q"]).ok_but_for("t.stl: the mesh is inside out");
    let told = run(&[&"deviation", &part, &lidless, &"-o", &out, &"-q"]);
    told.ok_but_for("is not closed");
    assert!(!dir.names().iter().any(|name| name.ends_with(".part")));
}

#[test]
fn regions_of_toolpaths_have_layers() {
    let dir = Scratch::new();
    let (part, out, table) = (dir.path("w.brf"), dir.path("t.ply"), dir.path("t.json"));
    let layer = |n: u32| {
        let z = 0.4 * f64::from(n);
        format!(
            ";LAYER_CHANGE\n;Z:{z:.1}\n;HEIGHT:0.4\nG1 Z{z:.1} F600\n;TYPE:Perimeter\n;WIDTH:0.8\nG1 X0 Y0\nG1 X5 Y0 E0.6\n"
        )
    };
    let text = "; filament_diameter = 1.75\n; layer_height = 0.4\nG21\nG90\nM83\n".to_owned()
        + &(1..=3).map(layer).collect::<String>();
    run(&[&"build", &dir.file("w.gcode", text), &"-o", &part, &"--identity", &"-q"]).ok();
    run(&[&"thickness", &part, &"-o", &out, &"-q", &"--below", &"1mm", &"--regions", &table]).ok();
    let told: serde_json::Value = serde_json::from_str(&std::fs::read_to_string(&table).unwrap()).unwrap();
    let row = &told["regions"][0];
    assert_eq!((row["layer_first"].as_u64(), row["layer_last"].as_u64()), (Some(1), Some(3)), "{told}");
    // Beads are round at their sides, so the wall is as thin as 0.34 between layers.
    assert!((0.5..0.8).contains(&row["mean_thickness"].as_f64().unwrap()), "{row}");
}
