//! `brickfield mesh --close`: what no ball of a diameter enters is filled, judged by formulas.

use super::detail::meshed;
use super::distance::stl_of;
use crate::support::*;
use brickfield_bench_data::judge::mesh::check_file;
use brickfield_bench_data::{Mesh, shapes};
use std::f64::consts::PI;
use std::path::Path;

/// What a ball of diameter `d` reaches of a cube that it is in.
fn reached(edge: f64, d: f64) -> f64 {
    let inner = edge - d;
    if inner < 0.0 {
        0.0
    } else {
        inner.powi(3) + 3.0 * inner * inner * d + 0.75 * PI * inner * d * d + PI * d.powi(3) / 6.0
    }
}

#[test]
fn voids_and_channels_that_no_ball_enters_are_filled() {
    let dir = Scratch::new();
    let (store, out) = (dir.store("void_ladder", 3), dir.path("a.ply"));
    // Cubes of 1 to 5 mm, a ball of 4 mm, and a cube of 3 mm with a vent of half a millimetre.
    let d = 2.2;
    let json = meshed(&store, &out, &["--close", "2.2mm"]);
    let [before, after] = [0, 1].map(|n| json["closing"]["voids"][n].clone());
    assert_eq!((before["count"].as_u64(), after["count"].as_u64()), (Some(6), Some(5)), "{json}");
    let expected: f64 = [3.0, 4.0, 5.0, 3.0].iter().map(|edge| reached(*edge, d)).sum::<f64>() + 33.438;
    let found = after["volume"].as_f64().unwrap();
    // Round edges lie up to a tenth of a cell deeper.
    assert!((found - expected).abs() < 0.03 * expected, "{found} {expected}");
    let report = check_file(&out).unwrap();
    assert!(report.is_balanced() && report.is_edge_manifold() && report.is_vertex_manifold(), "{report:?}");
    let [volume, error] = ["volume", "volume_error"].map(|name| json["closing"][name].as_f64().unwrap());
    let more = report.signed_volume - truth("void_ladder", "volume");
    assert!(error < 3.0 && (more - volume).abs() < error + 1.0, "{more} {volume} ± {error}");
    let store = dir.store("void_ladder", 2);
    let text = run(&[&"mesh", &store, &"-o", &out, &"--close", &"2.2mm", &"--detail", &"1mm"]).ok();
    assert!(text.contains("where no ball of 2.2 mm enters; enclosed voids: 6 ("), "{text}");
}

/// A block with two slots through it, of which one is as wide as the ball and half as much again.
#[test]
fn slots_narrower_than_the_ball_are_filled_and_the_outside_stays() {
    let dir = Scratch::new();
    let (width, wide, deep, long, d) = (0.9, 2.2, 3.0, 6.0, 1.5f64);
    // Bars on a plate, as one piece: their boxes overlap.
    let bar = |from: f64, to: f64| shapes::cuboid([from, 0.0, 0.0], [to, long, 2.0 + deep]);
    let plate = shapes::cuboid([0.0; 3], [9.0, long, 2.0]);
    let [second, third] = [2.0 + width, 4.0 + width + wide];
    let mesh = Mesh::merged(&[plate, bar(0.0, 2.0), bar(second, second + 2.0), bar(third, 9.0)]);
    let (store, out) = (dir.path("s.brf"), dir.path("s.stl"));
    run(&[&"build", &stl_of(&dir, "s.stl", &mesh), &"-o", &store, &"--cell", &"0.2", &"-q"]).ok();
    let json = meshed(&store, &out, &["--close", "1.5"]);
    let r = 0.5 * d;
    // The ball dips into the slot at its three mouths; and it does not reach the two corners of the other slot.
    let dip = r * r * (0.5 * width / r).asin() - 0.5 * width * (r * r - 0.25 * width * width).sqrt();
    let corners = (2.0 - 0.5 * PI) * r * r;
    let expected = width * deep * long - dip * (long + 2.0 * deep) + corners * long;
    let [volume, error] = ["volume", "volume_error"].map(|name| json["closing"][name].as_f64().unwrap());
    assert!(
        (volume - expected).abs() < 0.03 * expected && error < 0.05 * expected,
        "{volume} ± {error}, {expected}"
    );
    let solid = 9.0 * long * (2.0 + deep) - (width + wide) * deep * long;
    let found = check_file(&out).unwrap().signed_volume;
    assert!((found - solid - expected).abs() < 0.003 * solid, "{found} {solid} {expected}");
    // Flat faces, and edges that point outward, are where they were.
    let corners = facets_of(&out).into_iter().flatten();
    for a in 0..3 {
        let end = [9.0, long, 2.0 + deep][a];
        let at = |f: fn(f64, f64) -> f64, from: f64| corners.clone().map(|c| f64::from(c[a])).fold(from, f);
        assert!(at(f64::min, 9.0).abs() < 2e-3 && (at(f64::max, 0.0) - end).abs() < 2e-3);
    }
}

#[test]
fn closed_beads_are_sound_and_threads_change_no_byte() {
    let dir = Scratch::new();
    let store = dir.path("a.brf");
    run(&[&"build", &example("clover.gcode"), &"-o", &store, &"--cell", &"0.57mm", &"-q"])
        .ok_but_for("% empty");
    meshed(&store, &dir.path("b.ply"), &["--close", "1.6mm"]);
    let coarse = dir.path("c.brf");
    run(&[&"build", &example("clover.gcode"), &"-o", &coarse, &"--cell", &"1.2mm", &"-q"])
        .ok_but_for("% empty");
    let made = ["1", "2"].map(|threads| {
        let out = dir.path(&format!("{threads}.ply"));
        meshed(&coarse, &out, &["--close", "2.6mm", "--threads", threads]);
        std::fs::read(&out).unwrap()
    });
    assert!(made[0] == made[1]);
    let words = ["--close", "2.6mm", "--triangles", "3000", "--outer"];
    let json = meshed(&coarse, &dir.path("b.stl"), &words);
    assert!((2700..=3000).contains(&json["triangles"].as_u64().unwrap()), "{json}");
    assert_eq!(dir.names().len(), 6, "{:?}", dir.names());
}

#[test]
fn what_cannot_be_closed_is_refused_in_a_line() {
    let dir = Scratch::new();
    let (store, out) = (dir.store("void_ladder", 2), dir.path("a.ply"));
    let failed = |store: &Path, words: &[&str]| {
        let mut all: Vec<&dyn AsRef<std::ffi::OsStr>> = vec![&"mesh", &store, &"-o", &out];
        all.extend(words.iter().map(|word| word as &dyn AsRef<std::ffi::OsStr>));
        run(&all)
    };
    let line = failed(&store, &["--close", "0.1mm"]).failed();
    assert!(line.contains("is below two cells, 0.9") && line.contains("--close"), "{line}");
    // The part grown by a metre would have a surface of some square metres.
    let line = failed(&store, &["--close", "1m"]).failed();
    assert!(
        line.contains("closing by 1000 is more than the diagonal of the part") && line.contains("--close"),
        "{line}"
    );
    let text = failed(&store, &["--close", "2mm", "--iso", "1.5"]).misused();
    assert!(text.contains("--close is of the boundary"), "{text}");
    failed(&store, &["--close", "-2mm"]).misused();
    let open = dir.path("open.brf");
    run(&[&"build", &stl("open_box_no_lid"), &"-o", &open, &"--depth", &"1", &"-q"]).ok_but_for("open");
    let line = failed(&open, &["--close", "20"]).failed();
    assert!(line.contains("open input or a point cloud"), "{line}");
    let coarse = dir.path("coarse.brf");
    run(&[&"build", &stl("void_ladder"), &"-o", &coarse, &"--depth", &"3", &"--tolerance", &"0.02mm", &"-q"])
        .ok();
    let line = failed(&coarse, &["--close", "2mm"]).failed();
    assert!(line.contains("the store has coarser ones"), "{line}");
    assert!(!out.exists() && dir.names().len() == 3, "{:?}", dir.names());
}
