//! Point clouds to stores, and every command on those.

use crate::support::*;
use brickfield_bench_data::{Rng, judge::mesh};
use brickfield_core::sweep::part_or_all;
use std::ffi::OsStr;
use std::path::{Path, PathBuf};
use std::process::Stdio;

type Points = Vec<[f32; 6]>;

/// Points scattered evenly over facets, with their normals.
fn scattered(facets: &[Facet], count: usize, seed: u64) -> Points {
    let normal = |t: &Facet| -> [f64; 3] {
        let e = |i: usize, a: usize| f64::from(t[i][a] - t[0][a]);
        [(1, 2), (2, 0), (0, 1)].map(|(a, b)| e(1, a) * e(2, b) - e(1, b) * e(2, a))
    };
    let mut sums = vec![0.0];
    for t in facets {
        sums.push(sums[sums.len() - 1] + normal(t).iter().map(|c| c * c).sum::<f64>().sqrt());
    }
    let mut rng = Rng::new(seed);
    let mut point = || {
        let at = rng.range(0.0, sums[facets.len()]);
        let t = &facets[sums.partition_point(|s| *s <= at).clamp(1, facets.len()) - 1];
        let (mut u, mut v) = (rng.range(0.0, 1.0) as f32, rng.range(0.0, 1.0) as f32);
        if u + v > 1.0 {
            (u, v) = (1.0 - u, 1.0 - v);
        }
        let p: [f32; 3] =
            std::array::from_fn(|a| t[0][a] + u * (t[1][a] - t[0][a]) + v * (t[2][a] - t[0][a]));
        let n = normal(t);
        [p[0], p[1], p[2], n[0] as f32, n[1] as f32, n[2] as f32]
    };
    (0..count).map(|_| point()).collect()
}

fn ply(points: &Points, with_normals: bool) -> Vec<u8> {
    let names = &["x", "y", "z", "nx", "ny", "nz"][..if with_normals { 6 } else { 3 }];
    let properties: String = names.iter().map(|name| format!("property float {name}\n")).collect();
    let count = points.len();
    let header =
        format!("ply\nformat binary_little_endian 1.0\nelement vertex {count}\n{properties}end_header\n");
    let values = points.iter().flat_map(|p| &p[..names.len()]).flat_map(|c| c.to_le_bytes());
    header.into_bytes().into_iter().chain(values).collect()
}

fn spot() -> Vec<Facet> {
    facets_of(&stl("spot40_model"))
}

fn torus() -> Vec<Facet> {
    let mesh = brickfield_bench_data::shapes::torus(10.0, 4.0, 64, 48);
    mesh.facets().map(|t| t.map(|v| v.map(|c| c as f32))).collect()
}

/// Builds a store and its mesh; the summary and where they are.
fn build(dir: &Scratch, inputs: &[&Path], extra: &[&str]) -> (serde_json::Value, PathBuf, PathBuf) {
    let (store, mesh) = (dir.path("cloud.brf"), dir.path("cloud.ply"));
    let mut args: Vec<&dyn AsRef<OsStr>> = vec![&"build", &"-o", &store, &"--mesh", &mesh, &"--json"];
    args.extend(inputs.iter().map(|input| input as &dyn AsRef<OsStr>));
    args.extend(extra.iter().map(|word| word as &dyn AsRef<OsStr>));
    (run(&args).json(), store, mesh)
}

/// Random positions in and around a box, farther from all points than two spacings.
fn positions(points: &Points, low: [f64; 3], high: [f64; 3], spacing: f64) -> Vec<[f64; 3]> {
    let mut rng = Rng::new(11);
    let far = |p: &[f64; 3]| {
        points.iter().all(|q| {
            let squared = (0..3).map(|a| (f64::from(q[a]) - p[a]).powi(2)).sum::<f64>();
            squared > 4.0 * spacing * spacing
        })
    };
    let one = || std::array::from_fn(|a| rng.range(low[a], high[a]));
    std::iter::repeat_with(one).filter(far).take(2000).collect()
}

fn csv(points: &[[f64; 3]]) -> String {
    points.iter().map(|p| format!("{},{},{}\n", p[0], p[1], p[2])).collect()
}

fn w_of(text: &str) -> Vec<f64> {
    text.lines().skip(1).map(|line| line.rsplit(',').next().unwrap().parse().unwrap()).collect()
}

/// From the cloud to the mesh: closed, manifold, of the model's volume, and the store tells inside from outside.
#[test]
fn clouds_of_models_become_closed_meshes() {
    // A part with normals and one without, or each.
    let all = [(spot(), 6_000, true), (torus(), 2_500, true), (torus(), 2_500, false)];
    for (facets, count, with_normals) in all.into_iter().step_by(part_or_all(2, 1)) {
        let dir = Scratch::new();
        let points = scattered(&facets, count, 1);
        let input = dir.file("scan.ply", ply(&points, with_normals));
        let (report, store, mesh) =
            build(&dir, &[&input], if with_normals { &[] } else { &["--estimate-normals"] });
        let (spacing, cell) = (report["spacing"].as_f64().unwrap(), report["cell"].as_f64().unwrap());
        assert_eq!((report["points"].as_u64(), report["facets"].as_u64()), (Some(count as u64), Some(0)));
        assert!(cell > 0.5 * spacing && cell <= spacing, "{cell} {spacing}");
        run(&[&"verify", &store]).ok();
        let judged = mesh::check_file(&mesh).unwrap();
        assert!(judged.is_closed_manifold() && judged.is_oriented(), "{judged}");
        let truth = mesh::check_soup(&facets);
        let off = judged.signed_volume / truth.signed_volume - 1.0;
        assert!(off.abs() < 0.02, "{off}");
        let said = run(&[&"info", &store, &"--volume", &"--json"]).json();
        let union = said["volumes"]["union"].as_f64().unwrap();
        assert!((union / truth.signed_volume - 1.0).abs() < 0.02, "{union}");
        let asked = csv(&positions(&points, truth.min, truth.max, spacing));
        let model = dir.file("model.stl", binary_stl(facets.len() as u32, &facets));
        let sides = w_of(&run_with(&[&"winding", &model, &"--points", &"-"], &asked).ok());
        let found = w_of(&run_with(&[&"sample", &store, &"--points", &"-"], &asked).ok());
        let wrong = sides.iter().zip(&found).filter(|(t, w)| (**t > 0.5) != (**w > 0.5)).count();
        assert!(sides.iter().filter(|t| **t > 0.5).count() > 200 && wrong <= 2, "{wrong} of {}", sides.len());
        // The same from the points, but for the interpolation between samples.
        let straight: [&[&dyn AsRef<OsStr>]; 2] = [&[], &[&"--estimate-normals"]];
        let args: [&dyn AsRef<OsStr>; 4] = [&"winding", &input, &"--points", &"-"];
        let told = w_of(&run_with(&[&args[..], straight[usize::from(!with_normals)]].concat(), &asked).ok());
        for (a, b) in told.iter().zip(&found) {
            assert!((a - b).abs() < 0.05, "{a} {b}");
        }
    }
}

#[test]
fn every_command_answers_and_bytes_do_not_depend_on_threads() {
    let dir = Scratch::new();
    let all = scattered(&torus(), 800, 2);
    let (a, b) = (dir.file("a.ply", ply(&all[..500].to_vec(), true)), dir.path("b.xyz"));
    // Columns without names are normals only where their lengths are 1.
    let line = |p: &[f32; 6]| {
        let length = (p[3] * p[3] + p[4] * p[4] + p[5] * p[5]).sqrt();
        let [x, y, z, n @ ..] = *p;
        [[x, y, z], n.map(|c| c / length)]
            .as_flattened()
            .iter()
            .map(f32::to_string)
            .collect::<Vec<_>>()
            .join(" ")
            + "\n"
    };
    std::fs::write(&b, all[500..].iter().map(line).collect::<String>()).unwrap();
    let (_, store, mesh) = build(&dir, &[&a, &b], &["--threads", "1"]);
    let first = (std::fs::read(&store).unwrap(), std::fs::read(&mesh).unwrap());
    for threads in part_or_all(&["3"][..], &["2", "3", "8"]) {
        build(&dir, &[&a, &b], &["--threads", threads]);
        assert!((std::fs::read(&store).unwrap(), std::fs::read(&mesh).unwrap()) == first, "{threads}");
    }
    let text = run(&[&"info", &store]).ok();
    assert!(
        text.contains("a.ply: PLY points, 500 points") && text.contains("b.xyz: XYZ points, 300"),
        "{text}"
    );
    assert!(text.contains("  points   800 (0 without area)"), "{text}");
    for extra in [["--level", "0"], ["--iso", "0.5"]] {
        run(&[&"mesh", &store, &"-o", &mesh, &extra[0], &extra[1], &"--quiet"]).ok();
        let judged = mesh::check_file(&mesh).unwrap();
        assert!(judged.is_closed_manifold() && judged.components == 1, "{judged}");
    }
    // Nothing is covered twice.
    run(&[&"mesh", &store, &"-o", &mesh, &"--iso", &"1.5", &"--quiet"]).ok();
    assert_eq!(mesh::check_file(&mesh).unwrap().triangles, 0);
    let array = dir.path("w.npy");
    run(&[&"export", &store, &"--level", &"0", &"--dtype", &"f4", &"-o", &array, &"--quiet"]).ok();
    let shown = run(&[&"build", &a, &"-o", &store]).ok();
    assert!(shown.contains("  points   500 (0 without area), ") && shown.contains(" mm apart\n"), "{shown}");
    // By depth and by cell, and with the field facing inward.
    for extra in [&["--depth", "0"][..], &["--cell", "0.8mm"], &["--depth", "1", "--gwn-error", "0.1"]] {
        build(&dir, &[&a, &b], extra);
        assert!(mesh::check_file(&mesh).unwrap().is_closed_manifold(), "{extra:?}");
    }
    let inward: Points = all.iter().map(|p| [p[0], p[1], p[2], -p[3], -p[4], -p[5]]).collect();
    let inward = dir.file("in.ply", ply(&inward, true));
    let warned = run(&[&"build", &inward, &"-o", &store, &"--quiet"]);
    assert!(warned.status == Some(0) && warned.stderr.contains("nothing lies inside"), "{}", warned.stderr);
}

/// Points that memory has no room for lie in files without names, also where nothing is built of them.
#[test]
fn points_beyond_memory_give_the_same_answers() {
    let dir = Scratch::new();
    let cloud = dir.file("torus.ply", ply(&scattered(&torus(), 20_000, 8), true));
    let (info, winding) = (["info", "--json"], ["winding", "--points", "-"]);
    let told = |args: &[&str], memory: &str, folder: &Path| {
        let mut all: Vec<&dyn AsRef<OsStr>> = vec![&args[0], &cloud];
        all.extend(args[1..].iter().map(|word| word as &dyn AsRef<OsStr>));
        run_with(
            &[&all[..], &[&"--memory", &memory, &"--temp-dir", &folder]].concat(),
            "10,0,0\n13,0,0\n0,0,0\n",
        )
    };
    let none = dir.path("none");
    for args in [&info[..], &winding] {
        let free = told(args, "1GiB", &none).ok();
        assert_eq!(told(args, "1MiB", &dir.path("")).ok(), free);
        let refused = told(args, "1MiB", &none).failed();
        assert!(refused.contains("temporary file") && refused.contains("none"), "{refused}");
    }
    let w = w_of(&told(&winding, "1MiB", &dir.path("")).ok());
    assert!((w[0] - 1.0).abs() < 0.01 && (w[1] - 1.0).abs() < 0.05 && w[2].abs() < 0.01, "{w:?}");
    assert_eq!(dir.names(), ["torus.ply"]);
}

#[test]
fn clouds_that_cannot_be_built_are_refused_in_one_line() {
    let dir = Scratch::new();
    let points = scattered(&torus(), 300, 3);
    let (oriented, bare) = (dir.file("o.ply", ply(&points, true)), dir.file("b.ply", ply(&points, false)));
    let out = dir.path("x.brf");
    let refuse = |extra: &[&dyn AsRef<OsStr>]| {
        run(&[&[&"build" as &dyn AsRef<OsStr>, &"-o", &out, &"--quiet"], extra].concat())
    };
    let model = stl("overlap_boxes");
    let one = dir.file("one.xyz", "1 2 3 0 0 1\n");
    let same = dir.file("same.xyz", "1 2 3 0 0 1\n1 2 3 0 0 1\n");
    let zero = dir.file("zero.xyz", "x y z nx ny nz\n1 2 3 0 0 0\n2 2 3 0 0 0\n2 5 3 0 0 0\n");
    let nan = dir.file("nan.xyz", "1 2 3 0 0 1\n2 2 3 nan 0 1\n");
    let cases: [(&[&dyn AsRef<OsStr>], &str); 9] = [
        (&[&bare], "b.ply: points: have no normals (no properties nx, ny and nz); add --estimate-normals"),
        (&[&oriented, &bare], "b.ply: points: has no normals, and the clouds before it have some"),
        (
            &[&model, &bare],
            "b.ply: points: have no normals (no properties nx, ny and nz); add --estimate-normals",
        ),
        (
            &[&model, &oriented, &"--max-depth", &"6"],
            "not of point clouds beside them; leave --max-depth and --thin out",
        ),
        (&[&one], "one.xyz: points: none of the 1 points has an area"),
        (&[&same, &"--estimate-normals"], "same.xyz: points: none of the 2 points has an area"),
        (&[&zero], "zero.xyz: points: none of the 3 points has an area"),
        (&[&nan], "nan.xyz: point 2: has a coordinate that is not finite"),
        (&[&oriented, &"--memory", &"64MiB"], "300 points need at least"),
    ];
    for (extra, what) in cases {
        let line = refuse(extra).failed();
        assert!(line.contains(what), "{line}");
    }
    for (extra, what) in [
        (&[&oriented as &dyn AsRef<OsStr>, &"--identity"][..], "--identity"),
        (&[&oriented, &"--beads", &"analytic"], "points are no beads"),
        (&[&model, &"--estimate-normals"], "is for point clouds"),
        (
            &[&model, &oriented, &"--boundary-error", &"0.1mm"],
            "points have no facets to measure by; leave it out",
        ),
        (&[&model, &oriented, &"--beads", &"analytic"], "points are no beads"),
    ] {
        let text = refuse(extra).misused();
        assert!(text.contains(what), "{text}");
    }
    assert_eq!(dir.names(), ["b.ply", "nan.xyz", "o.ply", "one.xyz", "same.xyz", "zero.xyz"]);
}

/// A dome as a scan gives it, without its floor, over a box into which it reaches.
fn dome_and_box(dir: &Scratch) -> (PathBuf, PathBuf) {
    let count = 1500;
    let line = |i: usize| {
        let z = (i as f64 + 0.5) / count as f64;
        let (sin, cos) = (i as f64 * 2.399963).sin_cos();
        let r = (1.0 - z * z).sqrt();
        format!("{} {} {} {} {} {z}\n", 6.0 * r * cos, 6.0 * r * sin, 6.0 * z, r * cos, r * sin)
    };
    let lines: String = (0..count).map(line).collect();
    let solid = brickfield_bench_data::shapes::cuboid([-10.0, -10.0, -8.0], [10.0, 10.0, 2.0]);
    let facets: Vec<Facet> = solid.facets().map(|t| t.map(|v| v.map(|c| c as f32))).collect();
    (dir.file("dome.xyz", lines), dir.file("box.stl", binary_stl(facets.len() as u32, &facets)))
}

/// The winding numbers of a scan and of a mesh add up: one closed surface around both, the same for any threads.
#[test]
fn a_scan_and_a_mesh_become_one_surface() {
    let dir = Scratch::new();
    let (dome, solid) = dome_and_box(&dir);
    let (report, store, mesh) = build(&dir, &[&dome, &solid], &["--depth", "2", "--threads", "1"]);
    assert_eq!((report["points"].as_u64(), report["facets"].as_u64()), (Some(1500), Some(12)));
    run(&[&"verify", &store]).ok();
    let judged = mesh::check_file(&mesh).unwrap();
    assert!(judged.is_closed_manifold() && judged.is_oriented() && judged.components == 1, "{judged}");
    // The box, and the dome above it.
    let truth = 20.0 * 20.0 * 10.0 + std::f64::consts::PI * 16.0 * (18.0 - 4.0) / 3.0;
    assert!((judged.signed_volume / truth - 1.0).abs() < 0.01, "{} {truth}", judged.signed_volume);
    run(&[&"mesh", &store, &"-o", &mesh, &"--check", &"--quiet"]).ok();
    let first = std::fs::read(&store).unwrap();
    for extra in [&["2"][..], &["3", "--memory", "200MiB"]] {
        build(&dir, &[&dome, &solid], &[&["--depth", "2", "--threads"][..], extra].concat());
        assert!(std::fs::read(&store).unwrap() == first, "{extra:?}");
    }
    // The other order changes the sources' order alone.
    let text = run(&[&"info", &store]).ok();
    assert!(text.contains("dome.xyz: XYZ points, 1500 points") && text.contains("12 facets"), "{text}");
    assert!(text.contains("  pieces   1512 (0 without area)"), "{text}");
    build(&dir, &[&solid, &dome], &["--depth", "2"]);
    let turned = run(&[&"info", &store]).ok();
    assert!(turned.find("box.stl:").unwrap() < turned.find("dome.xyz:").unwrap(), "{turned}");
    // What the store holds is what points are told.
    let asked = csv(&[[0.0, 0.0, 4.5], [0.0, 0.0, 0.0], [8.0, 0.0, 1.0], [8.0, 8.0, 5.0], [3.0, -3.0, 3.0]]);
    let straight = |extra: &[&dyn AsRef<OsStr>]| {
        let args: [&dyn AsRef<OsStr>; 5] = [&"winding", &solid, &dome, &"--points", &"-"];
        w_of(&run_with(&[&args[..], extra].concat(), &asked).ok())
    };
    let (told, brute) = (straight(&[]), straight(&[&"--brute"]));
    let stored = w_of(&run_with(&[&"sample", &store, &"--points", &"-"], &asked).ok());
    for ((a, b), c) in told.iter().zip(&brute).zip(&stored) {
        assert!((a - b).abs() <= 1e-3 && (b - c).abs() < 0.07, "{told:?} {brute:?} {stored:?}");
    }
    assert!(brute[1] > 1.3 && brute[0] > 0.6 && brute[3] < 0.2, "{brute:?}");
}

/// Several clouds beside an open mesh and a toolpath, which is swept.
#[test]
fn a_scan_closes_an_open_mesh_and_beads_are_swept_beside_it() {
    let dir = Scratch::new();
    let (dome, solid) = dome_and_box(&dir);
    let facets: Vec<Facet> = facets_of(&solid).into_iter().skip(2).collect();
    let open = dir.file("open.stl", binary_stl(facets.len() as u32, &facets));
    let (report, store, mesh) = build(&dir, &[&open, &dome], &["--depth", "1"]);
    assert!(report["open_edges"].as_u64().unwrap() > 0, "{report}");
    assert!(mesh::check_file(&mesh).unwrap().is_closed_manifold());
    run(&[&"verify", &store]).ok();
    let beads = dir.file("b.gcode", "M83\n;WIDTH:2\n;HEIGHT:2\nG1 X-12 Y12 Z2 F600\nG1 X12 E1\n");
    let out = dir.path("b.brf");
    let told = run(&[&"build", &dome, &beads, &"-o", &out, &"--depth", &"1", &"-q"]);
    assert!(told.status == Some(0), "{}", told.stderr);
    assert!(told.stderr.contains("swept to triangles: there are point clouds"), "{}", told.stderr);
}

#[test]
fn an_interrupted_build_of_a_cloud_leaves_nothing() {
    let dir = Scratch::new();
    let input = dir.file("scan.ply", ply(&scattered(&torus(), 20_000, 4), true));
    let mut command = program();
    command.arg("build").arg(&input).arg("-o").arg(dir.path("o.brf")).args(["--depth", "6"]);
    let child = command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    let line = super::signals::interrupt(child, &dir, "o.brf.part", "-INT").ended_by(2);
    assert!(line.contains("interrupted"), "{line}");
    assert_eq!(dir.names(), ["scan.ply"]);
}

#[test]
fn clouds_of_the_point_cloud_library_are_built() {
    let dir = Scratch::new();
    let count = 1500;
    let point = |n: i32| {
        let z = 1.0 - 2.0 * (f64::from(n) + 0.5) / f64::from(count);
        let (r, angle) = ((1.0 - z * z).sqrt(), f64::from(n) * 2.399_963);
        [r * angle.cos(), r * angle.sin(), z]
    };
    let head = |data: &str| {
        format!(
            "VERSION 0.7\nFIELDS x y z normal_x normal_y normal_z\nSIZE 8 8 8 8 8 8\nTYPE F F F F F F\nCOUNT 1 1 1 1 1 1\n\
             WIDTH {count}\nHEIGHT 1\nPOINTS {count}\nDATA {data}\n"
        )
    };
    let rows: String = (0..count)
        .map(|n| {
            let [x, y, z] = point(n);
            format!("{x} {y} {z} {x} {y} {z}\n")
        })
        .collect();
    let bytes = (0..count).flat_map(|n| [point(n), point(n)].concat()).flat_map(f64::to_le_bytes);
    let text = dir.file("text.pcd", head("ascii") + &rows);
    let binary = dir.file("b.pcd", head("binary").into_bytes().into_iter().chain(bytes).collect::<Vec<u8>>());
    assert!(run(&[&"info", &text]).ok().contains("PCD points, 1500 points"));
    let volume = |input: &std::path::Path| {
        let store = dir.path("p.brf");
        run(&[&"build", &input, &"-o", &store, &"--depth", &"1", &"-q"]).ok();
        run(&[&"mesh", &store, &"-o", &dir.path("m.stl"), &"--json"]).json()["volume"].as_f64().unwrap()
    };
    let (one, other) = (volume(&text), volume(&binary));
    assert!(one == other && (one - 4.19).abs() < 0.15, "{one} {other}");
}

/// A small file of a program for scans.
fn scan(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../fuzz/seeds").join(name)
}

/// The skin of a cylinder, of which the files hold points: with normals, `scale` units a length.
fn skin(count: usize, scale: f64, digits: f64) -> String {
    let line = |i: usize| {
        let (sin, cos) = (i as f64 * 2.399963).sin_cos();
        let p = [10.0 + 3.0 * cos, 20.0 + 3.0 * sin, 0.5 + 4.0 * (i as f64 + 0.5) / count as f64];
        let [x, y, z] = p.map(|c| (c * digits).round() / digits * scale);
        format!("{x} {y} {z} {cos} {sin} 0\n")
    };
    (0..count).map(line).collect()
}

/// Winding numbers of a cloud at some places.
fn asked(input: &Path, places: &str, extra: &[&str]) -> Vec<f64> {
    let mut args: Vec<&dyn AsRef<OsStr>> = vec![&"winding", &input, &"--points", &"-"];
    args.extend(extra.iter().map(|word| word as &dyn AsRef<OsStr>));
    w_of(&run_with(&args, places).ok_but_for(LEFT_OUT))
}

/// What is told of points without a place.
const LEFT_OUT: &str = "3 points are marked as invalid, and are left out";

fn places(scale: f64) -> String {
    let at = |n: i32| {
        let n = f64::from(n);
        let (x, y, z) = (7.0 + n * 0.37 % 6.0, 17.0 + n * 0.71 % 6.0, 1.0 + n * 0.13 % 3.0);
        format!("{},{},{}\n", x * scale, y * scale, z * scale)
    };
    (0..40).map(at).collect()
}

#[test]
fn clouds_of_surveyors_are_built() {
    let dir = Scratch::new();
    let text = dir.file("skin.xyz", skin(200, 1.0, 1000.0));
    let packed = scan("las/points6n.laz");
    let told = run(&[&"info", &packed]).ok();
    assert!(told.contains("LAS points, 200 points") && told.contains("normals given"), "{told}");
    for (a, b) in asked(&text, &places(1.0), &[]).iter().zip(asked(&packed, &places(1.0), &[])) {
        assert!((a - b).abs() < 1e-5, "{a} {b}");
    }
    // COPC, without normals.
    let octree = scan("las/points6.copc.laz");
    let store = dir.path("s.brf");
    let refused = run(&[&"build", &octree, &"-o", &store]).failed();
    assert!(refused.contains("no normals") && refused.contains("--estimate-normals"), "{refused}");
    let report = run(&[
        &"build",
        &octree,
        &"-o",
        &store,
        &"--estimate-normals",
        &"--depth",
        &"1",
        &"--unit",
        &"m",
        &"--json",
    ]);
    assert_eq!(report.json()["points"], 150);
    let cut = dir.file("cut.laz", &std::fs::read(&packed).unwrap()[..2000]);
    let refused = run(&[&"build", &cut, &"-o", &store]).failed();
    assert!(refused.contains("cut.laz") && refused.contains("export the file again"), "{refused}");
}

#[test]
fn clouds_of_scanners_are_built() {
    let dir = Scratch::new();
    let posed = scan("e57/posed.e57");
    let told = run(&[&"info", &posed]).ok_but_for(LEFT_OUT);
    assert!(told.contains("E57 points, 117 points"), "{told}");
    // The same points in mm as text, in the order of the scans.
    let lines: Vec<String> = skin(120, 1000.0, 1e15).lines().map(str::to_owned).collect();
    let of_scan = |scan: usize| lines.iter().skip(scan).step_by(3).enumerate().filter(|(n, _)| *n != 3);
    let text: String = (0..3).flat_map(of_scan).map(|(_, line)| format!("{line}\n")).collect();
    let text = dir.file("skin.xyz", text);
    let estimated = ["--estimate-normals"];
    let found = asked(&posed, &places(1000.0), &estimated);
    for (a, b) in asked(&text, &places(1000.0), &estimated).iter().zip(&found) {
        // Of neighbours as far away as others the rounding to 32 bits in the file decides.
        assert!((a - b).abs() < 0.05, "{a} {b}");
    }
    let store = dir.path("s.brf");
    let build = |extra: &[&str]| {
        let mut args: Vec<&dyn AsRef<OsStr>> =
            vec![&"build", &posed, &"-o", &store, &"--json", &"--estimate-normals"];
        args.extend(extra.iter().map(|word| word as &dyn AsRef<OsStr>));
        let text = run(&args).ok_but_for(LEFT_OUT);
        serde_json::from_str::<serde_json::Value>(&text).unwrap()["cell"].as_f64().unwrap()
    };
    // Sizes are in the unit that is asked for, and the store is in mm.
    assert_eq!(build(&["--cell", "0.5", "--unit", "m"]), 500.0);
    let mixed = run(&[&"build", &posed, &text, &"-o", &store, &"--unit", &"m"]).stderr;
    assert!(mixed.contains("E57 is read in mm"), "{mixed}");
}
