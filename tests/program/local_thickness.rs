//! `thickness --volume`: the diameter of the largest ball in the part at every sample.

use super::distance::stl_of;
use super::volume_files::readers::{numbers, vdb, vti};
use crate::support::*;
use brickfield_bench_data::{Mesh, shapes};
use std::path::Path;

const HALF: [f64; 3] = [4.0, 3.0, 2.5];
const TURN: ([f64; 3], f64) = ([1.0, 2.0, 3.0], 0.7);

/// A turned box in cells of half a millimetre.
fn build_box(dir: &Scratch) -> std::path::PathBuf {
    let mesh = shapes::cuboid(HALF.map(|h| -h), HALF).rotated(TURN.0, TURN.1);
    let part = dir.path("b.brf");
    run(&[&"build", &stl_of(dir, "b.stl", &mesh), &"-o", &part, &"--cell", &"0.5", &"-q"]).ok();
    part
}

/// The samples of an array with their places in the world.
fn samples(npy: &Path, told: &serde_json::Value) -> Vec<([f64; 3], f64)> {
    let bytes = std::fs::read(npy).unwrap();
    let axis = told["shape"][0].as_u64().unwrap() as usize;
    let values = numbers(&bytes[bytes.len() - 4 * axis.pow(3)..], "f4");
    let origin: [f64; 3] = std::array::from_fn(|a| told["origin"][a].as_f64().unwrap());
    let spacing = told["spacing"].as_f64().unwrap();
    let place = |n: usize| {
        let ijk = [n % axis, n / axis % axis, n / axis / axis];
        std::array::from_fn(|a| origin[a] + ijk[a] as f64 * spacing)
    };
    values.iter().enumerate().map(|(n, value)| (place(n), f64::from(*value))).collect()
}

/// Of the box: a ball of radius r may lie where it is r from all faces.
fn of_box(at: [f64; 3]) -> Option<f64> {
    let reaches = |r: f64| (0..3).map(|a| (at[a].abs() - HALF[a] + r).max(0.0).powi(2)).sum::<f64>() <= r * r;
    if (0..3).any(|a| at[a].abs() >= HALF[a]) {
        return None;
    }
    let (mut low, mut high) = (0.0, 2.5);
    if reaches(high) {
        return Some(2.0 * high);
    }
    for _ in 0..50 {
        let middle = 0.5 * (low + high);
        if reaches(middle) { low = middle } else { high = middle }
    }
    Some(2.0 * low)
}

#[test]
fn a_box_has_the_balls_of_its_formula_in_every_format() {
    let dir = Scratch::new();
    let part = build_box(&dir);
    let npy = dir.path("t.npy");
    let found = run(&[&"thickness", &part, &"--volume", &npy, &"--json"]).json();
    let beside: serde_json::Value =
        serde_json::from_slice(&std::fs::read(dir.path("t.json")).unwrap()).unwrap();
    let values = samples(&npy, &beside);
    let units = vec![[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    let axes = Mesh { vertices: units, triangles: Vec::new() }.rotated(TURN.0, TURN.1).vertices;
    let (mut errors, mut sum, mut squares) = (Vec::new(), 0.0, 0.0);
    for (at, value) in &values {
        let own: [f64; 3] = std::array::from_fn(|a| (0..3).map(|n| axes[a][n] * at[n]).sum());
        match of_box(own) {
            None => assert!(*value == 0.0 || (0..3).any(|a| (own[a].abs() - HALF[a]).abs() < 1e-4)),
            Some(truth) => errors.push((value - truth) / 0.5),
        }
        sum += value;
        squares += value * value;
    }
    errors.sort_by(f64::total_cmp);
    let count = errors.len();
    let mean = errors.iter().sum::<f64>() / count as f64;
    // A ball is never larger than the truth but for errors of distances, which grow at corners.
    assert!(errors[count / 100] > -0.4 && errors[count - 1] < 0.25 && mean.abs() < 0.05, "{mean} {errors:?}");
    let told = &found["volume"];
    let number = |name: &str| told[name].as_f64().unwrap();
    assert_eq!(told["samples"].as_u64(), Some(count as u64));
    let mean = sum / count as f64;
    assert!((number("mean") - mean).abs() < 1e-4, "{told} {mean}");
    assert!((number("standard_deviation") - (squares / count as f64 - mean * mean).sqrt()).abs() < 1e-4);
    let (volume, error) = (6.0 * 8.0 * 5.0 / 0.125, 0.03);
    assert!((count as f64 / volume - 1.0).abs() < error, "{count} {volume}");
    // The integral of the formula over the volume, by a fine midpoint rule.
    let steps = 40;
    let middle = |a: usize, n: usize| HALF[a] * ((2 * n + 1) as f64 / steps as f64 - 1.0);
    let all = (0..steps).flat_map(|i| (0..steps).flat_map(move |j| (0..steps).map(move |k| [i, j, k])));
    let truth: f64 =
        all.map(|[i, j, k]| of_box([middle(0, i), middle(1, j), middle(2, k)]).unwrap()).sum::<f64>()
            / (steps * steps * steps) as f64;
    assert!((number("mean") - truth).abs() <= number("mean_error"), "{told} {truth}");
    let bars = told["histogram"]["counts"].as_array().unwrap();
    assert_eq!(bars.iter().map(|bar| bar.as_u64().unwrap()).sum::<u64>(), count as u64);
    let (grid, image) = (dir.path("t.vdb"), dir.path("t.vti"));
    run(&[&"thickness", &part, &"--volume", &grid, &"-q"]).ok();
    run(&[&"thickness", &part, &"--volume", &image, &"-q", &"--threads", &"1"]).ok();
    let axis = beside["shape"][0].as_u64().unwrap() as usize;
    let of_vdb = &vdb(&grid, &[axis])[0];
    assert_eq!((of_vdb.0.as_str(), of_vdb.1.as_str()), ("thickness", "Tree_float_5_4_3"));
    let of_vti = vti(&image, axis, "f4");
    for (n, (_, value)) in values.iter().enumerate() {
        assert_eq!((f64::from(of_vdb.2.values[n]), f64::from(of_vti.values[n])), (*value, *value));
    }
}

#[test]
fn volumes_have_the_same_bytes_and_bad_ones_are_refused() {
    let dir = Scratch::new();
    let part = build_box(&dir);
    let mut first = None;
    for (threads, memory) in [("1", "1GiB"), ("3", "64MiB")] {
        let (out, ply) = (dir.path("t.raw"), dir.path("t.ply"));
        let args: [&dyn AsRef<std::ffi::OsStr>; 12] = [
            &"thickness",
            &part,
            &"-o",
            &ply,
            &"--volume",
            &out,
            &"-q",
            &"--threads",
            &threads,
            &"--memory",
            &memory,
            &"--json",
        ];
        let told = run(&args).json();
        assert!(told["vertices"].as_u64() > Some(100) && told["volume"]["samples"].as_u64() > Some(100));
        let bytes = (std::fs::read(&out).unwrap(), std::fs::read(&ply).unwrap());
        assert!(*first.get_or_insert_with(|| bytes.clone()) == bytes, "{threads}");
    }
    let gaps = dir.path("g.mha");
    let told =
        run(&[&"thickness", &part, &"--gaps", &"--volume", &gaps, &"--widest", &"2mm", &"--json"]).json();
    assert_eq!(told["volume"]["samples"].as_u64(), Some(0), "{told}");
    run(&[&"thickness", &part, &"--gaps", &"--volume", &gaps]).misused();
    run(&[&"thickness", &part, &"--volume", &dir.path("x.png")]).misused();
    run(&[&"thickness", &part, &"--volume", &gaps, &"--widest", &"2mm"]).misused();
    run(&[&"thickness", &part]).misused();
    let deep = run(&[&"thickness", &part, &"--volume", &dir.path("d.npy"), &"--level", &"9"]).failed();
    assert!(deep.contains("there is no level 9"), "{deep}");
    assert!(!dir.path("d.npy").exists() && !dir.names().iter().any(|name| name.ends_with(".part")));
}
