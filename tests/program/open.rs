//! Open meshes: what `info` and `winding` say of them.

use crate::support::*;

fn w_of(text: &str) -> Vec<f64> {
    text.lines().skip(1).map(|line| line.rsplit(',').next().unwrap().parse().unwrap()).collect()
}

#[test]
fn info_counts_open_edges_loops_and_flipped_patches() {
    let dir = Scratch::new();
    let say = |path: &dyn AsRef<std::ffi::OsStr>| run(&[&"info", path, &"--json"]).json();
    let closed = say(&stl("overlap_boxes"));
    assert_eq!(
        (&closed["closed"], &closed["open_edges"], &closed["facets"]),
        (&true.into(), &0.into(), &24.into())
    );
    let open = say(&stl("open_box_no_lid"));
    assert_eq!((&open["closed"], &open["open_edges"], &open["loops"]), (&false.into(), &4.into(), &1.into()));
    assert_eq!(open["flipped_patches"], 0);
    let mut facets = cuboid([0.0; 3], [1.0; 3]);
    facets[3].swap(0, 1);
    let flipped = dir.file("flipped.STL", binary_stl(12, &facets));
    let found = say(&flipped);
    assert_eq!(
        (&found["open_edges"], &found["loops"], &found["flipped_patches"]),
        (&6.into(), &2.into(), &1.into())
    );
    let text = run(&[&"info", &flipped]).ok();
    assert!(text.contains("open: 6 open edges in 2 loops, 1 flipped patches"), "{text}");
    assert!(run(&[&"info", &stl("overlap_boxes")]).ok().contains("surface  closed"));
    assert!(run(&[&"info", &stl("truncated")]).failed().contains("truncated.stl"));
}

#[test]
fn points_in_open_meshes() {
    let open = stl("open_box_no_lid");
    let args: [&dyn AsRef<std::ffi::OsStr>; 4] = [&"winding", &open, &"--points", &"-"];
    let truth = truth("open_box_no_lid", "winding_centre");
    for error in ["0.1", "1e-3", "1e-6"] {
        let out = run_with(&[&args[..], &[&"--gwn-error", &error]].concat(), "5,5,5\n").ok();
        assert!((w_of(&out)[0] - truth).abs() <= error.parse().unwrap(), "{out}");
    }
    let brute = run_with(&[&args[..], &[&"--brute"]].concat(), "5,5,5\n").ok();
    assert!((w_of(&brute)[0] - truth).abs() < 1e-6, "{brute}");
    for wrong in ["0", "1", "nan", "much"] {
        let line = run_with(&[&args[..], &[&"--gwn-error", &wrong]].concat(), "").misused();
        assert!(line.contains("1e-6 to 0.5"), "{line}");
    }
}

/// A file as it comes: beads, one facet in a hundred lost.
#[test]
fn beads_with_lost_facets_stay_within_the_bound() {
    let dir = Scratch::new();
    let all = facets_of(&stl("clover_beads"));
    let kept: Vec<Facet> = all.iter().enumerate().filter(|(i, _)| i % 101 != 7).map(|(_, t)| *t).collect();
    let path = dir.file("lost.stl", binary_stl(kept.len() as u32, &kept));
    let axis = |a: usize| {
        kept.iter().flatten().map(move |v| v[a]).fold((f32::MAX, f32::MIN), |(l, h), c| (l.min(c), h.max(c)))
    };
    let at = |a: usize, share: usize| axis(a).0 + (axis(a).1 - axis(a).0) * (share as f32 / 101.0);
    let csv: String = (0..150)
        .map(|i| format!("{},{},{}\n", at(0, i * 37 % 101), at(1, i * 61 % 101), at(2, i * 83 % 101)))
        .collect();
    let args: [&dyn AsRef<std::ffi::OsStr>; 4] = [&"winding", &path, &"--points", &"-"];
    let one = run_with(&[&args[..], &[&"--threads", &"1"]].concat(), &csv).ok();
    assert_eq!(run_with(&[&args[..], &[&"--threads", &"3"]].concat(), &csv).ok(), one);
    let brute = w_of(&run_with(&[&args[..], &[&"--brute"]].concat(), &csv).ok());
    let mut covered = 0;
    for (w, b) in w_of(&one).iter().zip(&brute) {
        assert!((w - b).abs() <= 1e-3, "{w} {b}");
        covered += usize::from(*b > 0.5);
    }
    assert!(covered > 30, "{covered}");
}

/// Points of a sphere, as a scan gives them.
#[test]
fn point_clouds_with_and_without_normals() {
    let dir = Scratch::new();
    let points: Vec<[f64; 3]> = (0..4000)
        .map(|i| {
            // Evenly spread: Fibonacci's spiral.
            let z = 1.0 - (2.0 * f64::from(i) + 1.0) / 4000.0;
            let (sin, cos) = (f64::from(i) * 2.399_963_229_728_653).sin_cos();
            [cos * (1.0 - z * z).sqrt(), sin * (1.0 - z * z).sqrt(), z]
        })
        .collect();
    let line = |p: &[f64; 3]| format!("{} {} {}", p[0], p[1], p[2]);
    let oriented: String = points.iter().map(|p| format!("{} {}\n", line(p), line(p))).collect();
    let bare: String = points.iter().map(|p| line(p) + "\n").collect();
    let (oriented, bare) = (dir.file("a.xyz", oriented), dir.file("b.xyz", bare));
    let asked = "0,0,0\n0.5,0.5,0\n0,0.9,0\n0,0,1.2\n3,4,5\n";
    let truth = [1.0, 1.0, 1.0, 0.0, 0.0];
    let runs: [&[&dyn AsRef<std::ffi::OsStr>]; 3] =
        [&[&oriented], &[&bare, &"--estimate-normals"], &[&oriented, &"--brute"]];
    for extra in runs {
        let out = run_with(
            &[&[&"winding" as &dyn AsRef<std::ffi::OsStr>, &"--points", &"-"], extra].concat(),
            asked,
        )
        .ok();
        for (w, t) in w_of(&out).iter().zip(truth) {
            assert!((w - t).abs() < 0.05, "{out}");
        }
    }
    let refused = run_with(&[&"winding", &bare, &"--points", &"-"], asked).failed();
    assert!(refused.contains("b.xyz") && refused.contains("--estimate-normals"), "{refused}");
    let mixed = run_with(&[&"winding", &oriented, &stl("overlap_boxes"), &"--points", &"-"], asked).ok();
    let boxes = run_with(&[&"winding", &stl("overlap_boxes"), &"--points", &"-"], asked).ok();
    for ((w, t), n) in w_of(&mixed).iter().zip(truth).zip(w_of(&boxes)) {
        assert!((w - t - n).abs() < 0.05, "{mixed}");
    }
    let mesh =
        run_with(&[&"winding", &stl("overlap_boxes"), &"--estimate-normals", &"--points", &"-"], asked);
    assert!(mesh.misused().contains("is none"));
}

/// Every command on the store of an open mesh.
#[test]
fn stores_of_open_meshes() {
    let dir = Scratch::new();
    let all = facets_of(&stl("spot40_model"));
    let kept: Vec<Facet> = all.iter().enumerate().filter(|(i, _)| i % 37 != 5).map(|(_, t)| *t).collect();
    let input = dir.file("lost.stl", binary_stl(kept.len() as u32, &kept));
    let build = |threads: &str| {
        let store = dir.path(&format!("{threads}.brf"));
        let args: [&dyn AsRef<std::ffi::OsStr>; 9] =
            [&"build", &input, &"-o", &store, &"--depth", &"2", &"--json", &"--threads", &threads];
        (run(&args).json(), store)
    };
    let (report, store) = build("1");
    assert!(report["open_edges"].as_u64() > Some(100) && report["loops"].as_u64() > Some(30), "{report}");
    assert!(std::fs::read(&store).unwrap() == std::fs::read(build("3").1).unwrap());
    run(&[&"verify", &store]).ok();
    run(&[&"info", &store]).ok();
    let mesh = dir.path("lost.ply");
    run(&[&"mesh", &store, &"-o", &mesh, &"--quiet"]).ok();
    let report = brickfield_bench_data::judge::mesh::check_file(&mesh).unwrap();
    assert!(report.is_closed_manifold() && report.is_oriented(), "{report}");
    let refused = run(&[&"mesh", &store, &"-o", &mesh, &"--iso", &"0.3"]);
    assert!(refused.failed().contains("0.5, 1.5"));
    // Samples of the store at its own lattice are those of the mesh.
    let json = run(&[&"info", &store, &"--json"]).json();
    let edge = json["root"]["edge"].as_f64().unwrap();
    let origin: Vec<f64> =
        json["root"]["origin"].as_array().unwrap().iter().map(|v| v.as_f64().unwrap()).collect();
    let csv: String = (0..60)
        .map(|i| {
            let at = |a: usize, n: usize| origin[a] + edge * ((n % 31 + 1) as f64 / 32.0 + 2f64.powi(-24));
            format!("{},{},{}\n", at(0, i * 7), at(1, i * 11), at(2, i * 13))
        })
        .collect();
    let sampled = w_of(&run_with(&[&"sample", &store, &"--points", &"-"], &csv).ok());
    let brute = w_of(&run_with(&[&"winding", &input, &"--brute", &"--points", &"-"], &csv).ok());
    for (w, b) in sampled.iter().zip(&brute) {
        assert!((w - b).abs() <= 1e-3, "{w} {b}");
    }
    let array = dir.path("w.npy");
    run(&[&"export", &store, &"--level", &"1", &"--dtype", &"f4", &"-o", &array, &"--quiet"]).ok();
}

/// Three boxes in the same place without their lids: above them w falls below 0.5 only beyond the root.
#[test]
fn a_surface_that_leaves_the_root_ends_there_in_a_closed_border() {
    let dir = Scratch::new();
    let open = stl("open_box_no_lid");
    let (store, mesh) = (dir.path("bowl.brf"), dir.path("bowl.ply"));
    for depth in ["1", "2"] {
        run(&[&"build", &open, &open, &open, &"-o", &store, &"--depth", &depth, &"--quiet"]).ok();
        let report = run(&[&"mesh", &store, &"-o", &mesh, &"--json"]).json();
        let judged = brickfield_bench_data::judge::mesh::check_file(&mesh).unwrap();
        assert!(judged.is_closed_manifold() && judged.is_oriented(), "{judged}");
        let root = &run(&[&"info", &store, &"--json"]).json()["root"];
        let top = root["origin"][2].as_f64().unwrap() + root["edge"].as_f64().unwrap();
        let reached = report["bounds"][1][2].as_f64().unwrap();
        let cell = root["edge"].as_f64().unwrap() / 32.0 / 2f64.powi(depth.parse().unwrap());
        assert!(reached < top && reached > top - 2.0 * cell, "{reached} of {top}");
    }
}
