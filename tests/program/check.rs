//! `brickfield mesh --check`.

use crate::support::*;

#[test]
fn sound_files_are_reported_as_such() {
    for (name, shells, inward, genus) in [
        ("ascii_two_solids", 2, 0, 0),
        ("box_with_cavity", 2, 1, 0),
        ("clover_model", 1, 0, 0),
        ("featuretype50_model", 1, 0, 9),
        ("spot40_model", 1, 0, 0),
        ("thinwall_ladder", 1, 0, 0),
        ("void_ladder", 7, 6, 0),
    ] {
        let json = run(&[&"mesh", &"--check", &stl(name), &"--json"]).json();
        assert_eq!(json["sound"], true, "{name}: {json}");
        assert_eq!(json["components"], shells, "{name}");
        assert_eq!(json["inward_components"], inward, "{name}");
        assert_eq!(json["genus"], genus, "{name}");
        assert_eq!(json["intersections"]["pairs"], 0, "{name}");
    }
    let json = run(&[&"mesh", &"--check", &stl("void_ladder"), &"--json"]).json();
    let volume = json["volume"].as_f64().unwrap();
    assert!((volume / truth("void_ladder", "volume") - 1.0).abs() < 1e-6, "{volume}");
    let text = run(&[&"mesh", &stl("clover_model"), &"--check"]).ok();
    assert!(text.contains("free of self-intersections") && !text.contains("wrong"), "{text}");
}

#[test]
fn what_is_wrong_decides_the_status() {
    for (name, field, count) in [
        ("open_box_no_lid", "open_edges", 4),
        ("duplicate_box", "duplicate_triangles", 12),
        ("touching_layers", "crowded_edges", 4),
        ("degenerate_mix", "non_finite_triangles", 2),
    ] {
        let failed = run(&[&"mesh", &"--check", &stl(name), &"--json"]);
        assert_eq!(failed.status, Some(1), "{name}");
        let json: serde_json::Value = serde_json::from_str(&failed.stdout).unwrap();
        assert_eq!(json["sound"], false, "{name}");
        assert_eq!(json[field]["count"], count, "{name}: {json}");
        // One line, which says what and where.
        let line = run(&[&"mesh", &"--check", &stl(name), &"--quiet"]).failed();
        assert!(line.contains(name) && line.contains(&format!("{count} ")), "{line}");
    }
    let failed = run(&[&"mesh", &"--check", &stl("overlap_boxes")]);
    assert_eq!(failed.status, Some(1));
    assert!(failed.stdout.contains("closed, oriented, edge-manifold, vertex-manifold, not free"));
    assert!(failed.stdout.contains("pairs of triangles that overlap, one at ("), "{}", failed.stdout);
}

#[test]
fn what_was_written_can_be_checked_at_once() {
    let dir = Scratch::new();
    let store = dir.store("overlap_boxes", 2);
    let mesh = dir.path("union.stl");
    let both = run(&[&"mesh", &store, &"-o", &mesh, &"--check", &"--json"]);
    assert!(mesh.exists());
    let alone = run(&[&"mesh", &"--check", &mesh, &"--json"]);
    assert_eq!(both.status, alone.status);
    let read = |text: &str| {
        let mut json: serde_json::Value = serde_json::from_str(text).unwrap();
        json.as_object_mut().unwrap().remove("seconds");
        json
    };
    let mut check = read(&both.stdout)["check"].clone();
    check.as_object_mut().unwrap().remove("seconds");
    assert_eq!(check, read(&alone.stdout));
    for flag in ["closed", "oriented", "edge_manifold", "vertex_manifold"] {
        assert_eq!(check[flag], true, "{flag}");
    }
    let volume = check["volume"].as_f64().unwrap();
    assert!((volume / truth("overlap_boxes", "union_volume") - 1.0).abs() < 0.05, "{volume}");
    // A field that has no such surface is not wrong.
    let empty = dir.path("empty.stl");
    run(&[&"mesh", &store, &"-o", &empty, &"--iso", &"2.5", &"--check"]).ok();
    assert!(run(&[&"mesh", &"--check", &empty, &"-q"]).failed().contains("no triangles"));
}

#[test]
fn what_makes_no_sense_is_refused() {
    let dir = Scratch::new();
    let store = dir.store("overlap_boxes", 1);
    assert!(run(&[&"mesh", &store]).misused().contains("--output"));
    // Before anything is written.
    let unread = dir.path("union.vtp");
    assert!(run(&[&"mesh", &store, &"-o", &unread, &"--check"]).misused().contains("--check reads STL"));
    assert!(!unread.exists());
    assert!(run(&[&"mesh", &"--check", &store]).misused().contains("-o"));
    let mesh = stl("overlap_boxes");
    run(&[&"mesh", &"--check", &mesh, &"--level", &"1"]).misused();
    run(&[&"mesh", &"--check", &mesh, &"--iso", &"1.5"]).misused();
    run(&[&"mesh", &store, &"-o", &dir.path("x.stl"), &"--weld"]).misused();
    let truncated = run(&[&"mesh", &"--check", &stl("truncated")]).failed();
    assert!(truncated.contains("export or copy the file again"), "{truncated}");
}

#[test]
fn meshes_are_free_of_intersections_where_several_beads_pass_one_cell() {
    let dir = Scratch::new();
    let store = dir.store("clover_beads", 1);
    for ending in ["stl", "ply"] {
        let mesh = dir.path(&format!("union.{ending}"));
        let free = run(&[&"mesh", &store, &"-o", &mesh, &"--check", &"--json"]).json();
        assert_eq!(
            (&free["check"]["sound"], &free["check"]["intersections"]["pairs"]),
            (&true.into(), &0.into())
        );
    }
}
