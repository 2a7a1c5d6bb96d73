//! Pieces that are inside out: told by `build`, `info` and `mesh`, and turned by --orient.

use crate::support::*;
use std::ffi::OsStr;
use std::path::{Path, PathBuf};

fn report(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../tests/data/orient").join(name)
}

fn reversed(facets: Vec<Facet>) -> Vec<Facet> {
    facets.into_iter().map(|[a, b, c]| [a, c, b]).collect()
}

fn stl_of(soups: &[Vec<Facet>]) -> Vec<u8> {
    let all = soups.concat();
    binary_stl(all.len() as u32, &all)
}

/// What a build gave, and the volume of the union in its store.
fn built(dir: &Scratch, input: &Path, more: &[&str]) -> (Run, f64) {
    let out = dir.path("o.brf");
    let mut args: Vec<&dyn AsRef<OsStr>> = vec![&"build", &input, &"-o", &out, &"--depth", &"2"];
    args.extend(more.iter().map(|arg| arg as &dyn AsRef<OsStr>));
    let ran = run(&args);
    assert_eq!(ran.status, Some(0), "{}", ran.stderr);
    let info = run(&[&"info", &out, &"--volume", &"--json"]);
    let json: serde_json::Value = serde_json::from_str(&info.stdout).unwrap();
    // `info` says what is negative, too.
    let told = json["negative_volume"].as_f64().is_some();
    // Of open input w may be below zero for other reasons.
    assert!(json["winding_min"].as_i64() < Some(0) || !told);
    assert_eq!(info.stderr.contains("w is negative in"), told, "{}", info.stderr);
    (ran, json["volumes"]["union"].as_f64().unwrap())
}

fn close(volume: f64, expected: f64) {
    assert!((volume / expected - 1.0).abs() < 0.06, "{volume} for {expected}");
}

#[test]
fn one_of_two_boxes_is_told_and_turned() {
    let dir = Scratch::new();
    let file = report("one_inside_out.stl");
    let (ran, volume) = built(&dir, &file, &[]);
    assert_eq!(ran.stderr.lines().count(), 1, "{}", ran.stderr);
    assert!(ran.stderr.contains("1 piece is inside out, 1000.0"), "{}", ran.stderr);
    assert!(
        ran.stderr.contains("one_inside_out.stl is its first); build --orient turns it"),
        "{}",
        ran.stderr
    );
    assert!(ran.stdout.contains("1 piece is inside out"), "{}", ran.stdout);
    close(volume, 500.0);
    let mesh = run(&[&"mesh", &dir.path("o.brf"), &"-o", &dir.path("o.stl"), &"--level", &"1"]);
    assert_eq!(mesh.status, Some(0));
    let (_, told) = mesh.stderr.split_once("o.brf: w is negative in ").expect("a warning");
    close(told.split(' ').next().expect("a word").parse().expect("a number"), 500.0);
    assert_eq!(mesh.stderr.lines().count(), 1);
    for more in [&["--orient"][..], &["--orient", "pieces"], &["--orient=all"], &["--orient", "all"]] {
        let (ran, volume) = built(&dir, &file, more);
        assert_eq!(ran.stderr, "");
        assert!(ran.stdout.contains("pieces   2, 1 inside out; 12 facets turned"), "{}", ran.stdout);
        close(volume, 1500.0);
    }
    let info = run(&[&"info", &file]);
    assert!(info.stdout.contains("pieces   2, 1 inside out"), "{}", info.stdout);
    assert!(info.stderr.contains("1 piece is inside out") && info.stderr.lines().count() == 1);
    let json: serde_json::Value = serde_json::from_str(&run(&[&"info", &file, &"--json"]).stdout).unwrap();
    let found = &json["pieces"]["inside_out"];
    assert_eq!(
        (&json["pieces"]["pieces"], &found["pieces"], &found["source"]),
        (&2.into(), &1.into(), &0.into())
    );
}

#[test]
fn a_thousand_boxes_with_one_reversed_take_one_line() {
    let dir = Scratch::new();
    let at = |i: usize| [i % 10, i / 10 % 10, i / 100].map(|c| 10.0 * c as f32);
    let cube = |i: usize| cuboid(at(i), at(i).map(|c| c + 8.0));
    let mut boxes: Vec<Vec<Facet>> = (0..1000).map(cube).collect();
    boxes[437] = reversed(cube(437));
    let file = dir.file("many.stl", stl_of(&boxes));
    let (ran, _) = built(&dir, &file, &[]);
    assert_eq!(ran.stderr.lines().count(), 1, "{}", ran.stderr);
    assert!(ran.stderr.contains("1 piece is inside out, 512.0") && ran.stderr.contains("facet 5245 of "));
    assert!(ran.stderr.contains("many.stl") && ran.stderr.contains("--orient"), "{}", ran.stderr);
    let (ran, volume) = built(&dir, &file, &["--orient"]);
    assert_eq!(ran.stderr, "");
    close(volume, 512_000.0);
    // Several: still one line, with their number.
    boxes[3] = reversed(cube(3));
    boxes[998] = reversed(cube(998));
    let (ran, _) = built(&dir, &dir.file("many.stl", stl_of(&boxes)), &[]);
    assert_eq!(ran.stderr.lines().count(), 1, "{}", ran.stderr);
    assert!(ran.stderr.contains("3 pieces are inside out, 1536.0") && ran.stderr.contains("facet 37 of "));
}

#[test]
fn boxes_inside_out_as_a_whole_and_cavities() {
    let dir = Scratch::new();
    let (ran, volume) = built(&dir, &stl("inverted_box"), &["--orient"]);
    assert_eq!(ran.stderr, "");
    close(volume, 1000.0);
    let (ran, hollow) = built(&dir, &stl("box_with_cavity"), &[]);
    assert_eq!(ran.stderr, "");
    for how in ["--orient", "--orient=all"] {
        let (ran, volume) = built(&dir, &stl("box_with_cavity"), &[how]);
        assert_eq!((ran.stderr.as_str(), volume), ("", hollow));
        assert!(ran.stdout.contains("pieces   2, 1 cavity; 0 facets turned"), "{}", ran.stdout);
    }
    // Inside out as a whole the cavity is kept, too.
    let turned = dir.file("turned.stl", stl_of(&[reversed(facets_of(&stl("box_with_cavity")))]));
    let (ran, volume) = built(&dir, &turned, &["--orient"]);
    assert_eq!((ran.stderr.as_str(), volume), ("", hollow));
    let (ran, _) = built(&dir, &turned, &[]);
    assert!(ran.stderr.contains("nothing lies inside") && ran.stderr.contains("1 piece is inside out"));
    assert_eq!(ran.stderr.lines().count(), 1);
}

#[test]
fn facets_of_no_consistency() {
    let dir = Scratch::new();
    let mut soup =
        [cuboid([0.0; 3], [10.0; 3]), cuboid([5.0; 3], [15.0; 3]), cuboid([20.0; 3], [24.0; 3])].concat();
    for number in [0, 1, 7, 13, 22, 23, 30, 35] {
        soup[number].swap(0, 1);
    }
    let file = dir.file("soup.stl", binary_stl(36, &soup));
    let (ran, volume) = built(&dir, &file, &["--orient", "all"]);
    assert_eq!(ran.stderr, "");
    close(volume, 1000.0 + 1000.0 - 125.0 + 64.0);
    let (ran, _) = built(&dir, &file, &["--orient"]);
    assert_eq!(ran.stderr.lines().count(), 1);
    assert!(
        ran.stderr.contains("3 pieces have facets that face both sides")
            && ran.stderr.contains("--orient all")
    );
    let points = dir.file("p.csv", "2,2,2\n7,7,7\n22,22,22\n18,18,18\n");
    let text = run(&[&"winding", &file, &"--points", &points, &"--orient", &"all"]).ok();
    let values: Vec<&str> = text.lines().skip(1).map(|line| line.rsplit(',').next().unwrap()).collect();
    assert_eq!(values, ["1", "2", "1", "0"], "{text}");
    // A box without its lid has no volume.
    let open =
        run(&[&"build", &stl("open_box_no_lid"), &"-o", &dir.path("p.brf"), &"--depth", &"1", &"--orient"]);
    assert_eq!(open.status, Some(0));
    assert!(open.stderr.contains("1 piece has holes"), "{}", open.stderr);
}

#[test]
fn sweeps_are_solids_whichever_way_they_face() {
    let dir = Scratch::new();
    let (ran, volume) = built(&dir, &report("mixed_orientation.x3d"), &[]);
    assert_eq!(ran.stderr, "");
    close(volume, 34.0);
    assert!(ran.stdout.contains("1 Extrusion was inside out, and is turned"), "{}", ran.stdout);
    let scene = |body: &str| format!("<X3D><Scene>{body}</Scene></X3D>");
    let turned = "1 1 -1 1 -1 -1 1 -1 1 1";
    for (body, expected, count) in [
        (
            format!("<Shape><Extrusion crossSection='{turned}' ccw='false' spine='0 0 0 0 5 0'/></Shape>"),
            20.0,
            0,
        ),
        ("<Shape><Extrusion ccw='false' spine='0 0 0 0 5 0'/></Shape>".to_owned(), 20.0, 1),
        (
            format!(
                "<Transform scale='-1 1 1'><Shape><Extrusion DEF='e' crossSection='{turned}' spine='0 0 0 0 5 0'/>\
                 </Shape></Transform><Transform translation='9 0 0'><Shape><Extrusion USE='e'/></Shape></Transform>"
            ),
            40.0,
            1,
        ),
        (
            format!(
                "<Shape><Extrusion solid='false' beginCap='false' endCap='false' crossSection='{turned}' \
                 spine='0 0 0, 9 0 0, 9 9 0, 0 9 0, 0 0 0'/></Shape>"
            ),
            4.0 * 36.0 * f64::sqrt(0.5),
            1,
        ),
    ] {
        let file = dir.file("a.x3d", scene(&body));
        let json = run(&[&"build", &file, &"-o", &dir.path("o.brf"), &"--depth", &"3", &"--json"]).json();
        assert_eq!((&json["turned_sweeps"], &json["winding_min"]), (&count.into(), &0.into()), "{body}");
        let (ran, volume) = built(&dir, &file, &[]);
        assert_eq!(ran.stderr, "");
        close(volume, expected);
    }
}

#[test]
fn good_files_need_no_words() {
    let dir = Scratch::new();
    for name in [
        "clover_model",
        "duplicate_box",
        "overlap_boxes",
        "touching_layers",
        "void_ladder",
        "thinwall_ladder",
    ] {
        let info = run(&[&"info", &stl(name)]);
        assert_eq!(info.stderr, "", "{name}");
        assert!(!info.stdout.contains("inside out"), "{name}: {}", info.stdout);
        let (ran, volume) = built(&dir, &stl(name), &[]);
        assert_eq!(ran.stderr, "", "{name}");
        let (ran, again) = built(&dir, &stl(name), &["--orient"]);
        assert_eq!((ran.stderr.as_str(), again), ("", volume), "{name}");
    }
    let beads = run(&[&"build", &example("clover.gcode"), &"-o", &dir.path("o.brf"), &"--orient"]).misused();
    assert!(beads.contains("--orient: beads as solids have no facets"), "{beads}");
}

#[test]
fn the_store_depends_on_neither_threads_nor_memory() {
    let dir = Scratch::new();
    let pile = dir.pile("pile.stl", 6000);
    let mut facets = facets_of(&pile);
    // Half of the facets belong to beads that are reversed now.
    let half = facets.len() / 2;
    facets[..half].iter_mut().for_each(|facet| facet.swap(1, 2));
    let file = dir.file("turned.stl", binary_stl(facets.len() as u32, &facets));
    let bytes = |more: &[&str]| {
        let out = dir.path("o.brf");
        let mut args: Vec<&dyn AsRef<OsStr>> =
            vec![&"build", &file, &"-o", &out, &"--depth", &"2", &"--orient", &"--quiet"];
        args.extend(more.iter().map(|arg| arg as &dyn AsRef<OsStr>));
        run(&args).ok();
        std::fs::read(&out).unwrap()
    };
    let one = bytes(&["--threads", "1"]);
    assert_eq!(bytes(&["--threads", "2"]), one);
    assert_eq!(bytes(&["--threads", "3", "--memory", "120MiB"]), one);
    let line = run(&[&"build", &file, &"-o", &dir.path("p.brf"), &"--orient", &"--memory", &"1KiB"]).failed();
    assert!(line.contains("--memory"), "{line}");
}

#[test]
fn a_build_that_turns_goes_on_with_no_other() {
    let dir = Scratch::new();
    let out = dir.path("o.brf");
    let file = report("one_inside_out.stl");
    let shard = |number: &str, more: &[&str]| {
        let path = dir.path(&format!("{}.brf", number.replace('/', "of")));
        let mut args: Vec<&dyn AsRef<OsStr>> =
            vec![&"build", &file, &"-o", &path, &"--depth", &"3", &"--shard", &number];
        args.extend(more.iter().map(|arg| arg as &dyn AsRef<OsStr>));
        run(&args).ok();
        path
    };
    let whole = dir.path("whole.brf");
    run(&[&"build", &file, &"-o", &whole, &"--depth", &"3", &"--orient"]).ok();
    let [one, two] = [shard("1/2", &["--orient"]), shard("2/2", &["--orient"])];
    run(&[&"cache", &"merge", &one, &two, &"-o", &out]).ok();
    assert_eq!(std::fs::read(&out).unwrap(), std::fs::read(&whole).unwrap());
    let two = shard("2/2", &[]);
    let refused = run(&[&"cache", &"merge", &one, &two, &"-o", &dir.path("p.brf")]);
    assert_eq!(refused.status, Some(1), "{}", refused.stdout);
}
