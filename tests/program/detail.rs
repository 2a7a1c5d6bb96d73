//! `brickfield mesh --detail`, `--triangles`, `--max-size` and the choice of shells, judged by code that shares none with the
//! engine.

use super::distance::stl_of;
use crate::support::*;
use brickfield_bench_data::judge::mesh::{MeshFindings, check_file};
use brickfield_bench_data::{Mesh, shapes};
use brickfield_core::sweep::part_or_all;
use serde_json::Value;
use std::path::Path;

/// Closed, oriented, manifold, and of the volume expected.
#[track_caller]
fn judged(path: &Path, volume: f64, tolerance: f64) -> MeshFindings {
    let report = check_file(path).unwrap();
    assert!(report.is_balanced() && report.is_edge_manifold() && report.is_vertex_manifold(), "{report:?}");
    let deviation = report.signed_volume / volume - 1.0;
    assert!(deviation.abs() < tolerance, "{}: {} is not {volume}", path.display(), report.signed_volume);
    report
}

/// The mesh of a store with these words, as JSON of the run.
#[track_caller]
pub fn meshed(store: &Path, out: &Path, words: &[&str]) -> Value {
    let mut all: Vec<&dyn AsRef<std::ffi::OsStr>> = vec![&"mesh", &store, &"-o", &out, &"--json", &"--check"];
    all.extend(words.iter().map(|word| word as &dyn AsRef<std::ffi::OsStr>));
    let json = run(&all).json();
    assert_eq!(json["check"]["sound"], true, "{json}");
    json
}

#[test]
fn voids_stay_with_a_detail_below_their_size_and_go_with_one_above() {
    let dir = Scratch::new();
    let store = dir.store("void_ladder", 3);
    let expected = truth("void_ladder", "volume");
    let out = dir.path("a.ply");
    // Cubes of 1, 2, 3, 4 and 5 mm and a ball of 4 mm are enclosed. One more is vented by a channel as narrow as the detail.
    for (detail, voids) in [("0.5mm", 6..8), ("8mm", 0..1)] {
        let json = meshed(&store, &out, &["--detail", detail]);
        judged(&out, expected, 0.005);
        assert_eq!(json["detail"]["voids"]["count"], 6);
        let found = json["shells"]["voids"]["count"].as_u64().unwrap();
        assert!(voids.contains(&found), "{detail}: {found}");
        assert!((json["volume"].as_f64().unwrap() / expected - 1.0).abs() < 2e-4, "{json}");
    }
    let text = run(&[&"mesh", &store, &"-o", &out, &"--detail", &"3mm"]).ok();
    assert!(text.contains("6 enclosed in the store") && text.contains("smaller than cells"), "{text}");
    assert!(text.contains("99.9% within"), "{text}");
}

#[test]
fn what_a_part_encloses_and_what_is_small_is_left_out_and_said() {
    let dir = Scratch::new();
    let (store, out) = (dir.store("void_ladder", 3), dir.path("a.stl"));
    let expected = truth("void_ladder", "volume");
    let all = meshed(&store, &out, &["--tolerance", "0.001mm"]);
    assert!(all.get("shells").is_none());
    let outer = meshed(&store, &out, &["--tolerance", "0.001mm", "--outer"]);
    let filled = expected + truth("void_ladder", "closed_total");
    judged(&out, filled, 1e-3);
    assert_eq!(outer["shells"]["dropped_voids"]["count"], 6);
    assert!((outer["volume"].as_f64().unwrap() / filled - 1.0).abs() < 1e-3);
    assert!(outer["triangles"].as_u64() < all["triangles"].as_u64());
    assert_eq!(facets_of(&out).len() as u64, outer["triangles"].as_u64().unwrap());
    // The cube of 1 mm and that of 2 mm are small.
    let some = meshed(&store, &dir.path("a.ply"), &["--min-shell-volume", "10"]);
    judged(&dir.path("a.ply"), expected + 9.0, 1e-3);
    assert_eq!(some["shells"]["dropped_voids"]["count"], 2);
    // With coarse cells, and with a file that shares vertices.
    meshed(&store, &dir.path("b.ply"), &["--detail", "1mm", "--outer"]);
    judged(&dir.path("b.ply"), filled, 0.005);
    // Two bodies apart, one hollow with another body in it.
    let pieces = [
        cuboid([0.0; 3], [10.0; 3]),
        inside_out(cuboid([2.0; 3], [8.0; 3])),
        cuboid([4.0; 3], [6.0; 3]),
        cuboid([12.0, 0.0, 0.0], [16.0, 8.0, 8.0]),
    ]
    .concat();
    let input = dir.file("pieces.stl", binary_stl(pieces.len() as u32, &pieces));
    let store = dir.path("pieces.brf");
    run(&[&"build", &input, &"-o", &store, &"--depth", &part_or_all("1", "2"), &"-q"]).ok();
    let volume = |words: &[&str]| {
        let json = meshed(&store, &out, words);
        judged(&out, json["volume"].as_f64().unwrap(), 1e-6).signed_volume
    };
    let [hollow, inner, beside] = [1000.0 - 216.0, 8.0, 64.0 * 4.0];
    for (words, expected) in [
        (&["--keep-largest"][..], hollow),
        (&["--outer"], 1000.0 + beside),
        (&["--outer", "--keep-largest"], 1000.0),
        (&["--min-shell-volume", "10"], hollow + beside),
        (&["--min-shell-volume", "0"], hollow + inner + beside),
    ] {
        let found = volume(words);
        assert!((found / expected - 1.0).abs() < 2e-3, "{words:?}: {found} {expected}");
    }
}

/// By the law of cosines.
fn smallest_angle(facet: Facet) -> f64 {
    let length = |a: usize, b: usize| {
        (0..3).map(|n| (f64::from(facet[a][n]) - f64::from(facet[b][n])).powi(2)).sum::<f64>().sqrt()
    };
    let [a, b, c] = [length(1, 2), length(2, 0), length(0, 1)];
    let angle = |a: f64, b: f64, c: f64| {
        ((b * b + c * c - a * a) / (2.0 * b * c)).clamp(-1.0, 1.0).acos().to_degrees()
    };
    angle(a, b, c).min(angle(b, c, a)).min(angle(c, a, b))
}

fn inside_out(facets: Vec<Facet>) -> Vec<Facet> {
    facets.into_iter().map(|[a, b, c]| [a, c, b]).collect()
}

#[test]
fn triangles_are_as_many_as_asked_for_and_files_as_large() {
    let dir = Scratch::new();
    let store = dir.store("clover_beads", part_or_all(2, 3));
    let out = dir.path("a.ply");
    let json = meshed(&store, &out, &["--triangles", "3000"]);
    let triangles = json["triangles"].as_u64().unwrap();
    assert!((2700..=3000).contains(&triangles), "{triangles}");
    judged(&out, json["expected"]["volume"].as_f64().unwrap(), 0.001);
    // Slivers that are taken away make room for others.
    let json = meshed(&store, &out, &["--triangles", "3000", "--quality"]);
    let triangles = json["triangles"].as_u64().unwrap();
    assert!((2700..=3000).contains(&triangles), "{triangles}");
    // Between two whole numbers of cells: several samples in each.
    let whole = meshed(&store, &out, &["--detail", part_or_all("1.8mm", "0.9mm")]);
    let factor = whole["detail"]["factor"].as_u64().unwrap();
    assert!(factor > 1, "{whole}");
    let asked = whole["triangles"].as_u64().unwrap() * 3 / 2;
    let json = meshed(&store, &out, &["--triangles", &asked.to_string()]);
    let triangles = json["triangles"].as_u64().unwrap();
    assert!((asked / 10 * 9..=asked).contains(&triangles), "{asked}: {json}");
    judged(&out, json["expected"]["volume"].as_f64().unwrap(), 0.001);
    let out = dir.path("a.stl");
    meshed(&store, &out, &["--max-size", "200kB"]);
    let bytes = std::fs::metadata(&out).unwrap().len();
    assert!((180_000..=200_000).contains(&bytes), "{bytes}");
    // Formats that are packed, and what makes vertices larger.
    for (name, more) in [("b.3mf", &[][..]), ("b.ply", &["--double"][..]), ("b.obj", &["--normals"][..])] {
        let out = dir.path(name);
        meshed(&store, &out, &[&["--max-size", "60kB"], more].concat());
        let bytes = std::fs::metadata(&out).unwrap().len();
        assert!((25_000..=60_000).contains(&bytes), "{name}: {bytes}");
    }
}

#[test]
fn flat_faces_are_merged_exactly_whatever_number_is_asked_for() {
    let dir = Scratch::new();
    let pieces = cuboid([0.0; 3], [10.0, 6.0, 3.0]);
    let input = dir.file("box.stl", binary_stl(pieces.len() as u32, &pieces));
    let (store, out) = (dir.path("box.brf"), dir.path("a.stl"));
    run(&[&"build", &input, &"-o", &store, &"--depth", &"2", &"-q"]).ok();
    for asked in part_or_all(&["12", "24", "300"][..], &["12", "13", "24", "50", "300", "1000"]) {
        let text = run(&[&"mesh", &store, &"-o", &out, &"--triangles", &asked]);
        let text = text.ok_but_for("flat faces are merged, and more triangles would be no nearer");
        assert!(text.contains(": 12 triangles, 8 vertices"), "{asked}: {text}");
        judged(&out, 180.0, 1e-5);
    }
    // No reason is told that is not true, and no error contradicts itself.
    run(&[&"mesh", &store, &"-o", &out, &"--max-size", &"3kB"])
        .ok_but_for("nine tenths of 39, for which --max-size 2.9 KiB has room: flat faces are merged");
    let line = run(&[&"mesh", &store, &"-o", &out, &"--triangles", &"11"]).failed();
    assert!(line.contains("with at most 11 triangles was found; ask for more: the fewest"), "{line}");
}

/// Two boxes and a hollow ball: flat faces and round ones.
#[test]
fn faces_that_merge_leave_triangles_to_those_that_do_not() {
    let dir = Scratch::new();
    let ball = |radius| shapes::icosphere(3, radius).translated([2.0, 8.0, 5.0]);
    let mut void = ball(1.0);
    void.triangles.iter_mut().for_each(|corners| corners.swap(0, 1));
    let low = shapes::cuboid([0.0; 3], [8.0, 4.0, 2.0]);
    let pieces = [low, shapes::cuboid([6.0, 1.0, 1.0], [12.0, 3.0, 6.0]), ball(2.0), void];
    let (store, out) = (dir.path("b.brf"), dir.path("b.stl"));
    let input = stl_of(&dir, "a.stl", &Mesh::merged(&pieces));
    run(&[&"build", &input, &"-o", &store, &"--depth", &"2", &"-q"]).ok();
    let made = ["1", "2"].map(|threads| {
        let json = meshed(&store, &out, &["--triangles", "380", "--threads", threads]);
        let triangles = json["triangles"].as_u64().unwrap();
        assert!((342..=380).contains(&triangles), "{triangles}");
        judged(&out, json["expected"]["volume"].as_f64().unwrap(), 1e-3);
        for distances in json["detail"]["distances"].as_array().unwrap() {
            assert!(distances["of_999"].as_f64().unwrap() < 0.15, "{json}");
        }
        // Small as it is, the void is there.
        assert!(json["shells"]["voids"]["volume"].as_f64().unwrap() > 3.4, "{json}");
        std::fs::read(&out).unwrap()
    });
    assert!(made[0] == made[1]);
}

#[test]
fn threads_change_no_byte_and_beads_keep_their_volume() {
    let dir = Scratch::new();
    let store = dir.path("a.brf");
    run(&[&"build", &example("clover.gcode"), &"-o", &store, &"--cell", &"0.57mm", &"-q"])
        .ok_but_for("% empty");
    let made = ["1", "2"].map(|threads| {
        let out = dir.path(&format!("{threads}.ply"));
        let json = meshed(&store, &out, &["--detail", "3mm", "--tolerance", "0.05mm", "--threads", threads]);
        judged(&out, json["expected"]["volume"].as_f64().unwrap(), 0.001);
        std::fs::read(&out).unwrap()
    });
    assert!(made[0] == made[1]);
    slivers_are_taken_away(&dir, &store);
    // A fraction that is given moves the surface.
    let volume =
        |iso| meshed(&store, &dir.path("b.ply"), &["--detail", "3mm", "--iso", iso])["volume"].as_f64();
    assert!(volume("0.3") > volume("0.7"));
}

fn slivers_are_taken_away(dir: &Scratch, store: &Path) {
    let made = ["1", "2"].map(|threads| {
        let out = dir.path(&format!("{threads}.ply"));
        let wish = ["--detail", "3mm", "--tolerance", "0.05mm", "--quality", "--threads", threads];
        let json = meshed(store, &out, &wish);
        judged(&out, json["expected"]["volume"].as_f64().unwrap(), 0.002);
        std::fs::read(&out).unwrap()
    });
    assert!(made[0] == made[1]);
    let json = meshed(store, &dir.path("b.stl"), &["--detail", "3mm", "--tolerance", "0.05mm", "--quality"]);
    let quality = |key: &str| json["quality"][key].as_f64().unwrap();
    let angles: Vec<f64> = facets_of(&dir.path("b.stl")).into_iter().map(smallest_angle).collect();
    assert!((angles.iter().copied().fold(180.0, f64::min) - quality("smallest_angle")).abs() < 1e-3);
    assert_eq!(angles.len() as u64, json["triangles"].as_u64().unwrap());
    let [before, after] = ["below_5_degrees_before", "below_5_degrees"].map(quality);
    assert!(before > 20.0 && after * 10.0 < before, "{before} {after}");
    assert!(quality("smallest_angle") >= quality("smallest_angle_before"));
}

/// A turned box in cells of a fifteenth of it: its edges are near the mesh. Rounded, they would be a third of a cell away.
#[test]
fn edges_of_a_turned_box_are_sharp() {
    let dir = Scratch::new();
    let (half, axis, angle) = ([6.0, 5.0, 4.0], [1.0, 2.0, 3.0], 0.7);
    let turned = |mesh: Mesh| mesh.rotated(axis, angle);
    let input = stl_of(&dir, "b.stl", &turned(shapes::cuboid(half.map(|h| -h), half)));
    let units = vec![[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    let axes = turned(Mesh { vertices: units, triangles: Vec::new() }).vertices;
    let (store, out) = (dir.path("b.brf"), dir.path("b.ply"));
    run(&[&"build", &input, &"-o", &store, &"--cell", &"0.2", &"-q"]).ok();
    let out_stl = dir.path("b.stl.stl");
    for (words, most) in [(&["--detail", "0.8"][..], 0.05), (&["--detail", "0.8", "--follow-creases"], 0.015)]
    {
        let json = meshed(&store, &out, words);
        judged(&out, 8.0 * half.iter().product::<f64>(), 0.001);
        assert!(json["detail"]["cell"].as_f64().unwrap() > 0.79);
        let mut all: Vec<&dyn AsRef<std::ffi::OsStr>> = vec![&"mesh", &store, &"-o", &out_stl, &"-q"];
        all.extend(words.iter().map(|word| word as &dyn AsRef<std::ffi::OsStr>));
        run(&all).ok();
        let back = |p: [f32; 3]| -> [f64; 3] {
            axes.iter()
                .map(|axis| (0..3).map(|a| axis[a] * f64::from(p[a])).sum())
                .collect::<Vec<f64>>()
                .try_into()
                .unwrap()
        };
        let facets: Vec<[[f64; 3]; 3]> = facets_of(&out_stl).into_iter().map(|f| f.map(back)).collect();
        // From the middle part of an edge along z to the mesh.
        let (mut sum, mut count) = (0.0, 0);
        for n in -30..=30 {
            let point = [half[0], half[1], f64::from(n) / 30.0 * (half[2] - 1.0)];
            let nearest = facets.iter().map(|facet| from_facet(point, *facet)).fold(f64::INFINITY, f64::min);
            (sum, count) = (sum + nearest, count + 1);
        }
        let mean = sum / f64::from(count);
        assert!(mean < most * 0.8, "{words:?}: {mean}");
    }
}

/// The distance of a point from a triangle, by steps over it.
fn from_facet(p: [f64; 3], [a, b, c]: [[f64; 3]; 3]) -> f64 {
    let apart = |q: [f64; 3]| (0..3).map(|n| (q[n] - p[n]).powi(2)).sum::<f64>().sqrt();
    if [a, b, c].into_iter().map(apart).fold(f64::INFINITY, f64::min) > 3.0 {
        return f64::INFINITY;
    }
    let mut least = f64::INFINITY;
    for i in 0..=20 {
        for j in 0..=20 - i {
            let (u, v) = (f64::from(i) / 20.0, f64::from(j) / 20.0);
            least = least.min(apart([0, 1, 2].map(|n| a[n] + u * (b[n] - a[n]) + v * (c[n] - a[n]))));
        }
    }
    least
}

#[test]
fn leaves_of_several_levels_keep_the_volume() {
    let dir = Scratch::new();
    let (store, out) = (dir.path("a.brf"), dir.path("a.ply"));
    // Flat faces are left in coarse bricks.
    run(&[&"build", &stl("void_ladder"), &"-o", &store, &"--depth", &"3", &"--tolerance", &"0.02mm", &"-q"])
        .ok();
    meshed(&store, &out, &["--detail", "1mm"]);
    judged(&out, truth("void_ladder", "volume"), 0.001);
}

#[test]
fn what_cannot_be_is_refused_in_a_line() {
    let dir = Scratch::new();
    let (store, out) = (dir.store("void_ladder", 3), dir.path("a.ply"));
    let failed = |words: &[&str]| {
        let mut all: Vec<&dyn AsRef<std::ffi::OsStr>> = vec![&"mesh", &store, &"-o", &out];
        all.extend(words.iter().map(|word| word as &dyn AsRef<std::ffi::OsStr>));
        run(&all)
    };
    let line = failed(&["--detail", "0.01mm"]).failed();
    assert!(line.contains("smaller than the store's cells of 0.24"), "{line}");
    let line = failed(&["--detail", "500mm"]).failed();
    assert!(line.contains("nothing is left in cells of"), "{line}");
    let line = failed(&["--triangles", "4"]).failed();
    assert!(line.contains("ask for more: the fewest that were found are "), "{line}");
    let line = failed(&["--min-shell-volume", "1e9"]).failed();
    assert!(line.contains("none of 7 shells is left"), "{line}");
    for (words, part) in [
        (&["--triangles", "3"][..], "4 at least"),
        (&["--max-size", "100"], "no mesh is so small"),
        (&["--detail", "1mm", "--iso", "1.5"], "fraction of solid"),
        (&["--detail", "1mm", "--triangles", "100"], "cannot be used with"),
        (&["--detail", "1mm", "--level", "1"], "cannot be used with"),
        (&["--min-shell-volume=-1"], "0 or more"),
    ] {
        let text = failed(words).misused();
        assert!(text.contains(part), "{words:?}: {text}");
    }
    assert!(!out.exists() && dir.names().len() == 1, "{:?}", dir.names());
}
