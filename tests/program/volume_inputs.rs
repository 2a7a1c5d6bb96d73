//! `build` of volumes: arrays and images that other tools wrote.

use super::distance::{crossings, stl_of};
use crate::support::*;
use brickfield_bench_data::{Mesh, shapes};
use std::path::{Path, PathBuf};

/// Writes an array of floats, x fastest, with its description.
fn array(
    dir: &Scratch,
    name: &str,
    axis: usize,
    description: &str,
    value: impl Fn([f64; 3]) -> f32,
) -> PathBuf {
    let text = format!("{{'descr': '<f4', 'fortran_order': False, 'shape': ({axis}, {axis}, {axis}), }}");
    let mut bytes = b"\x93NUMPY\x01\0".to_vec();
    let padded = format!("{text:<117}\n");
    bytes.extend((padded.len() as u16).to_le_bytes());
    bytes.extend(padded.bytes());
    for n in 0..axis.pow(3) {
        let place = [n % axis, n / axis % axis, n / axis / axis].map(|c| c as f64);
        bytes.extend(value(place).to_le_bytes());
    }
    dir.file(&Path::new(name).with_extension("json").display().to_string(), description);
    dir.file(name, bytes)
}

const HERE: &str = "{\"origin\": [-5.0, 1.0, 2.5], \"spacing\": 0.25, \"unit\": \"mm\"}";

fn length(p: [f64; 3]) -> f64 {
    (p[0] * p[0] + p[1] * p[1] + p[2] * p[2]).sqrt()
}

/// A position in the world of a place in the array.
fn world(place: [f64; 3]) -> [f64; 3] {
    std::array::from_fn(|a| [-5.0, 1.0, 2.5][a] + 0.25 * place[a])
}

#[test]
fn samples_come_back_from_arrays_images_and_raw_files() {
    let dir = Scratch::new();
    for name in ["overlap_boxes", "box_with_cavity"] {
        let store = dir.store(name, 1);
        let truth = dir.path("truth.npy");
        run(&[&"export", &store, &"-o", &truth]).ok();
        for ending in ["npy", "mha", "mhd", "raw", "vti", "vdb"] {
            let (volume, back) = (dir.path(&format!("v.{ending}")), dir.path("back.brf"));
            run(&[&"export", &store, &"-o", &volume]).ok();
            run(&[&"build", &volume, &"-o", &back, &"-q"]).ok();
            run(&[&"verify", &back, &"-q"]).ok();
            let again = dir.path("again.npy");
            run(&[&"export", &back, &"-o", &again]).ok();
            assert!(std::fs::read(&truth).unwrap() == std::fs::read(&again).unwrap(), "{name} by {ending}");
            let mesh = dir.path("m.stl");
            let checked = run(&[&"mesh", &back, &"-o", &mesh, &"--check", &"-q"]);
            assert_eq!(checked.status, Some(0), "{}", checked.stderr);
        }
    }
}

#[test]
fn distances_keep_planes_and_edges() {
    let dir = Scratch::new();
    let (axis, angle, half) = ([1.0, 2.0, 3.0], 0.7, [6.0, 4.0, 5.0]);
    let turned = shapes::cuboid(half.map(|h| -h), half).rotated(axis, angle);
    let units = vec![[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    let axes = Mesh { vertices: units, triangles: Vec::new() }.rotated(axis, angle).vertices;
    let (part, volume, back) = (dir.path("p.brf"), dir.path("d.npy"), dir.path("b.brf"));
    run(&[&"build", &stl_of(&dir, "p.stl", &turned), &"-o", &part, &"--cell", &"0.3", &"-q"]).ok();
    run(&[&"export", &part, &"--as", &"sdf", &"-o", &volume]).ok();
    run(&[&"build", &volume, &"-o", &back, &"-q", &"--threads", &"2"]).ok();
    let bytes = std::fs::read(&back).unwrap();
    run(&[&"build", &volume, &"-o", &back, &"-q", &"--threads", &"1"]).ok();
    assert!(bytes == std::fs::read(&back).unwrap());
    let (found, cell) = crossings(&back);
    assert!((cell - 0.3).abs() < 1e-12);
    let (mut far, mut turned) = (0, 0);
    for (at, normal) in &found {
        let off: [f64; 3] =
            std::array::from_fn(|a| (0..3).map(|n| axes[a][n] * at[n]).sum::<f64>().abs() - half[a]);
        let error =
            length(off.map(|c| c.max(0.0))) + off.into_iter().fold(f64::NEG_INFINITY, f64::max).min(0.0);
        // Beyond edges distances bend.
        assert!(error.abs() / cell < 0.3, "{error} at {at:?}");
        far += usize::from(error.abs() / cell > 0.002);
        let along =
            (0..3).map(|a| (0..3).map(|n| axes[a][n] * normal[n]).sum::<f64>().abs()).fold(0.0, f64::max);
        turned += usize::from(along < 0.999);
    }
    assert!(
        found.len() > 5000 && far * 20 < found.len() && turned * 6 < found.len(),
        "{far} {turned} of {}",
        found.len()
    );
}

#[test]
fn grey_values_are_cut_at_a_threshold_and_closed_at_the_border() {
    let dir = Scratch::new();
    // A ball of 10 steps about [24, 24, 4], of which a part lies below the first layer.
    let grey = |p: [f64; 3]| 1000.0 - 50.0 * (length([p[0] - 24.0, p[1] - 24.0, p[2] - 4.0]) - 10.0) as f32;
    let volume = array(&dir, "ct.npy", 48, HERE, grey);
    let part = dir.path("ct.brf");
    let warned = run(&[&"build", &volume, &"-o", &part, &"--threshold", &"1000"]);
    assert!(warned.status == Some(0) && warned.stderr.contains("border of the volume"), "{}", warned.stderr);
    assert!(warned.stdout.contains("48 × 48 × 48 samples"), "{}", warned.stdout);
    let centre = world([24.0, 24.0, 4.0]);
    for (at, normal) in crossings(&part).0 {
        let away: [f64; 3] = std::array::from_fn(|a| at[a] - centre[a]);
        if at[2] < 2.5 {
            assert!((at[2] - 2.375).abs() < 1e-4, "{at:?}");
            continue;
        }
        assert!((length(away) - 2.5).abs() < 0.02 * 0.25, "{at:?}");
        let cosine = (0..3).map(|a| away[a] * normal[a]).sum::<f64>() / length(away);
        assert!(at[2] < 2.8 || cosine > 0.998, "{cosine} at {at:?}");
    }
    let checked = run(&[&"mesh", &part, &"-o", &dir.path("m.stl"), &"--check", &"-q"]);
    assert_eq!(checked.status, Some(0), "{}", checked.stderr);
}

#[test]
fn what_cannot_be_read_is_told_in_one_line() {
    let dir = Scratch::new();
    let out = dir.path("o.brf");
    let build = |volume: &Path, more: &[&str]| {
        let mut args: Vec<&dyn AsRef<std::ffi::OsStr>> = vec![&"build", &volume, &"-o", &out, &"-q"];
        args.extend(more.iter().map(|arg| arg as &dyn AsRef<std::ffi::OsStr>));
        run(&args)
    };
    let ball = |p: [f64; 3]| (length(p.map(|c| c - 4.0)) < 3.0) as u8 as f32;
    let good = array(&dir, "g.npy", 9, HERE, ball);
    let info = run(&[&"info", &good]).ok();
    assert!(
        info.contains("9 × 9 × 9 of type <f4") && info.contains("(-5.000000, 1.000000, 2.500000)"),
        "{info}"
    );
    build(&good, &[]).ok();
    std::fs::remove_file(&out).unwrap();
    assert!(build(&good, &["--depth", "3"]).misused().contains("lattice is that of the volume"));
    assert!(build(&good, &["--orient"]).misused().contains("--orient"));
    let stl = stl("overlap_boxes");
    assert!(run(&[&"build", &good, &stl, &"-o", &out]).misused().contains("built alone"));
    assert!(run(&[&"build", &stl, &"-o", &out, &"--threshold", &"1"]).misused().contains("--threshold"));
    let told = |volume: &Path, what: &str| {
        let line = build(volume, &[]).failed();
        assert!(line.contains(what) && line.trim_end().lines().count() == 1, "{line}");
    };
    told(
        &array(&dir, "n.npy", 9, HERE, |p| if p == [1.0, 2.0, 3.0] { f32::NAN } else { 1.0 }),
        "sample [3, 2, 1]",
    );
    told(&array(&dir, "e.npy", 9, HERE, |_| 0.25), "its values are 0.25 to 0.25");
    let far = array(&dir, "d.npy", 9, HERE, |p| length(p.map(|c| c - 4.0)) as f32 - 3.0);
    told(&far, "which are no winding numbers; say that they are distances by --volume-as");
    build(&far, &["--volume-as", "sdf"]).ok();
    std::fs::remove_file(&out).unwrap();
    let described = HERE.replace("\"unit\"", "\"quantity\": \"distance\", \"unit\"");
    let far = array(&dir, "q.npy", 9, &described, |p| length(p.map(|c| c - 4.0)) as f32 - 3.0);
    assert!(run(&[&"info", &far]).ok().contains("solid is what lies below 0"));
    build(&far, &[]).ok();
    std::fs::remove_file(&out).unwrap();
    let steps = HERE.replace("0.25", "[0.25, 0.25, 0.5]");
    told(&array(&dir, "s.npy", 9, &steps, ball), "0.25, 0.25 and 0.5 apart");
    told(&array(&dir, "o.npy", 9, "{\"spacing\": 1}", ball), "\"origin\"");
    told(&array(&dir, "j.npy", 9, "spacing = 1", ball), "is no JSON");
    let bytes = std::fs::read(&good).unwrap();
    let changed = |name: &str, from: &str, to: &str| {
        let text = bytes[..128].iter().map(|&b| b as char).collect::<String>().replace(from, to);
        let header: Vec<u8> = text.chars().map(|c| c as u8).collect();
        dir.file(&format!("{name}.json"), HERE);
        dir.file(&format!("{name}.npy"), [&header[..], &bytes[128..]].concat())
    };
    told(&changed("f", "False", "True "), "Fortran");
    told(&changed("b", "<f4", ">f4"), "'>f4'");
    told(&changed("c", "<f4", "<c8"), "'<c8'");
    told(&changed("x", "(9, 9, 9)", "(9, 81)  "), "has 2 axes");
    told(&changed("l", "(9, 9, 9)", "(9, 9, 10"), "bytes of samples");
    dir.file("t.json", HERE);
    told(&dir.file("t.npy", &bytes[..bytes.len() - 8]), "bytes of samples");
    told(&dir.file("lonely.npy", &bytes), "lonely.json is not there");
    told(&dir.file("m.mha", "ObjectType = Image\nNDims = 3\n"), "ElementDataFile");
    let head = "DimSize = 9 9 9\nElementType = MET_FLOAT\nCompressedData = True\nElementDataFile = LOCAL\n";
    told(&dir.file("z.mha", head.to_owned() + "packed"), "cannot be unpacked");
    told(&dir.file("w.mha", head.replace("True", "False")), "bytes of samples");
    told(&dir.file("v.vdb", "a volume"), "is no OpenVDB file");
    told(&dir.file("i.vti", "<VTKFile type=\"UnstructuredGrid\"/>"), "is no image data");
    let grids = of_others("grids.vdb");
    assert!(build(&grids, &["--field", "vectors"]).failed().contains("Tree_vec3s_5_4_3"));
    assert!(build(&good, &["--field", "w"]).failed().contains("holds one volume"));
    assert!(run(&[&"build", &stl, &"-o", &out, &"--field", &"w"]).misused().contains("--field"));
    assert!(!out.exists() && !dir.path("o.brf.part").exists());
}

/// A volume that another program wrote.
fn of_others(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../tests/data/volumes").join(name)
}

#[test]
fn level_sets_and_fog_of_openvdb_are_built() {
    let dir = Scratch::new();
    let (grids, part) = (of_others("grids.vdb"), dir.path("p.brf"));
    let told = run(&[&"info", &grids]).ok();
    assert!(told.contains("ball: float, level set") && told.contains("vectors: vec3s"), "{told}");
    let built = run(&[&"build", &grids, &"-o", &part]).ok();
    assert!(built.contains("ball: float, level set"), "{built}");
    run(&[&"verify", &part, &"-q"]).ok();
    let (found, cell) = crossings(&part);
    assert!(cell == 0.5 && found.len() > 200);
    for (at, normal) in found {
        let away = [at[0] - 1.0, at[1] - 2.0, at[2] - 3.0];
        // A line between samples of a ball's distances.
        assert!((length(away) - 2.0).abs() < 0.02, "{at:?}");
        assert!((0..3).map(|a| away[a] * normal[a]).sum::<f64>() / length(away) > 0.995);
    }
    // A box of 18 × 9 × 26 voxels of half a unit that begins at [3, 4, 5], half way to what lies outside.
    let built = run(&[&"build", &grids, &"-o", &part, &"--field", &"fog"]);
    assert!(built.status == Some(0) && built.stderr.is_empty(), "{}", built.stderr);
    for (at, _) in crossings(&part).0 {
        let steps: [f64; 3] = std::array::from_fn(|a| (at[a] - [1.0, 2.0, 3.0][a]) / 0.5);
        let off = |a: usize| {
            let [low, high] = [[2.5, 3.5, 4.5][a], [20.5, 12.5, 30.5][a]];
            (steps[a] - low).abs().min((steps[a] - high).abs())
        };
        assert!((0..3).any(|a| off(a) < 1e-4), "{steps:?}");
    }
}

#[test]
fn distances_come_back_from_level_sets() {
    let dir = Scratch::new();
    let store = dir.store("box_with_cavity", 1);
    let (back, again) = (dir.path("back.brf"), dir.path("again.brf"));
    let distances = |ending: &str, to: &PathBuf| {
        let volume = dir.path(&format!("d.{ending}"));
        run(&[&"export", &store, &"--as", &"sdf", &"-o", &volume]).ok();
        let how: &[&str] = if ending == "vti" { &["--volume-as", "sdf"] } else { &[] };
        let mut args: Vec<&dyn AsRef<std::ffi::OsStr>> = vec![&"build", &volume, &"-o", to, &"-q"];
        args.extend(how.iter().map(|arg| arg as &dyn AsRef<std::ffi::OsStr>));
        run(&args).ok();
        let mut found = crossings(to).0;
        found.sort_by(|a, b| a.partial_cmp(b).expect("numbers"));
        found
    };
    let truth = distances("npy", &back);
    assert!(truth.len() > 500);
    assert!(truth == distances("vdb", &again));
    assert!(truth == distances("vti", &again));
}

#[test]
fn packed_images_are_unpacked_within_a_folder_and_leave_nothing() {
    let dir = Scratch::new();
    for name in ["packed.mha", "packed.mhd", "inline_zlib.vti", "cells.vti", "ascii.vti"] {
        let part = dir.path("p.brf");
        let built = run(&[
            &"build",
            &of_others(name),
            &"-o",
            &part,
            &"--threshold",
            &"3",
            &"--temp-dir",
            &dir.path(""),
        ]);
        assert_eq!(built.status, Some(0), "{}", built.stderr);
        assert!(built.stdout.contains("7 × 5 × 4 samples of"), "{}", built.stdout);
        assert_eq!(built.stdout.contains("those of cells"), name == "cells.vti", "{}", built.stdout);
        run(&[&"verify", &part, &"-q"]).ok();
        assert_eq!(std::fs::read_dir(dir.path("")).unwrap().count(), 1);
        std::fs::remove_file(part).unwrap();
    }
}
