//! What a user would otherwise find out too late, or never.

use crate::program::signals::interrupt;
use crate::support::*;
use brickfield_core::sweep::part_or_all;
use std::ffi::OsStr;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

/// Two layers of a short wall, a skirt, and a prime tower as another slicer names it.
const WITH_SKIRT: &str = "\
G21\nG90\nM83\n;TYPE:Skirt/Brim\nG1 X-2 Y-2 Z0.2 F1200\nG1 X12 Y-2 E0.5\n\
;TYPE:External perimeter\nG0 X0 Y0\nG1 X10 Y0 E0.4\nG1 Z0.4\nG1 X0 Y0 E0.4\n\
;TYPE:Prime tower\nG0 X20 Y0\nG1 X22 Y0 E0.08\n";

/// A short wall and nothing else.
const WALL: &str = "G21\nG90\nM83\n;TYPE:Outer wall\nG1 X0 Y0 Z0.2 F1200\nG1 X10 Y0 E0.4\n";

#[test]
fn a_feature_to_skip_must_be_there() {
    let dir = Scratch::new();
    let (part, wall) = (dir.file("part.gcode", WITH_SKIRT), dir.file("wall.gcode", WALL));
    let (store, tubes) = (dir.path("o.brf"), dir.path("o.stl"));
    let points = dir.file("p.csv", "1,0,0.1\n");
    let commands: [Vec<&dyn AsRef<OsStr>>; 4] = [
        vec![&"build", &part, &"-o", &store],
        vec![&"beads", &part, &"-o", &tubes],
        vec![&"info", &part],
        vec![&"winding", &part, &"--points", &points],
    ];
    for mut command in commands {
        command.extend([&"--skip" as &dyn AsRef<OsStr>, &"Skirt"]);
        let line = run(&command).failed();
        for words in ["part.gcode", "\"Skirt\"", "\"External perimeter\", \"Prime tower\", \"Skirt/Brim\""] {
            assert!(line.contains(words), "{line}");
        }
    }
    // Of several files one must have it; of meshes none has.
    let build = ["--depth", "2", "--quiet", "--skip", "Outer wall", "-o"];
    let both = |first: &dyn AsRef<OsStr>, second: &dyn AsRef<OsStr>| {
        let mut args: Vec<&dyn AsRef<OsStr>> = vec![&"build", first, second];
        args.extend(build.iter().map(|arg| arg as &dyn AsRef<OsStr>));
        args.push(&store);
        run(&args)
    };
    assert!(both(&part, &wall).failed().contains("all that it deposits is to be skipped"));
    assert!(both(&part, &part).failed().contains("no such feature"));
    let meshes = both(&stl("overlap_boxes"), &stl("box_with_cavity")).failed();
    assert!(meshes.contains("no toolpath"), "{meshes}");
    let names = dir.names();
    assert!(!names.iter().any(|name| name.starts_with("o.")), "{names:?}");
}

#[test]
fn what_is_beside_the_part_is_told_and_left_out_on_request() {
    let dir = Scratch::new();
    let (part, store) = (dir.file("part.gcode", WITH_SKIRT), dir.path("o.brf"));
    let build = |more: &[&str]| {
        let mut args: Vec<&dyn AsRef<OsStr>> = vec![&"build", &part, &"-o", &store, &"--depth", &"3"];
        args.extend(more.iter().map(|arg| arg as &dyn AsRef<OsStr>));
        let ran = run(&args);
        assert_eq!(ran.status, Some(0), "{}", ran.stderr);
        ran.stdout
    };
    let all = build(&[]);
    let beside = all.lines().find(|line| line.trim_start().starts_with("beside")).expect(&all).to_owned();
    assert!(beside.contains("Skirt/Brim (1 beads") && beside.contains("Prime tower (1 beads"), "{beside}");
    assert!(beside.contains("--skip auto"), "{beside}");
    let auto = build(&["--skip", "auto"]);
    assert!(auto.contains("beside   Skirt/Brim (1 beads), Prime tower (1 beads) left out"), "{auto}");
    let json: serde_json::Value = serde_json::from_str(&build(&["--skip", "auto", "--json"])).unwrap();
    let features = json["toolpaths"][0]["features"].as_array().unwrap();
    let kept: Vec<&str> = features
        .iter()
        .filter(|feature| feature["beads"].as_u64() > Some(0))
        .map(|feature| feature["name"].as_str().unwrap())
        .collect();
    assert_eq!(kept, ["External perimeter"]);
    // A file without any is whole.
    run(&[&"info", &dir.file("wall.gcode", WALL), &"--skip", &"auto"]).ok_but_for("");
}

#[test]
fn a_store_is_not_given_the_name_of_another_kind() {
    let dir = Scratch::new();
    for name in
        ["x.stl", "x.PLY", "x.3mf", "x.step", "x.gcode", "x.x3d", "x.xyz", "x.npy", "x.png", "x.gcode.gz"]
    {
        // Before anything is read: the input is not there.
        let refused = run(&[&"build", &dir.path("none.stl"), &"-o", &dir.path(name)]).misused();
        assert!(refused.contains(name) && refused.contains(".brf"), "{refused}");
    }
    let mesh = run(&[&"build", &stl("overlap_boxes"), &"-o", &dir.path("x.stl")]).misused();
    assert!(mesh.contains("--mesh") && mesh.contains("brickfield mesh"), "{mesh}");
    run(&[&"cache", &"merge", &dir.path("a.brf"), &"-o", &dir.path("x.stl")]).misused();
    let store = dir.store("overlap_boxes", 1);
    run(&[&"cache", &"compact", &store, &"-o", &dir.path("x.ply")]).misused();
    assert_eq!(dir.names(), ["overlap_boxes-1.brf"]);
    // Other names are the user's business.
    run(&[&"build", &stl("overlap_boxes"), &"-o", &dir.path("x.v2"), &"--depth", &"1", &"-q"]).ok();
}

#[test]
fn an_unfinished_store_names_the_setting_that_differs() {
    let dir = Scratch::new();
    let (input, store) = (example("clover.gcode"), dir.path("o.brf"));
    suspended(&dir, &[&input, &"--cell", &"0.06mm", &"--width", &"0.5mm"]);
    let refused = |args: &[&dyn AsRef<OsStr>]| {
        let mut all: Vec<&dyn AsRef<OsStr>> = vec![&"build", &"-q", &"-o", &store];
        all.extend(args);
        run(&all).failed()
    };
    for (args, expected) in [
        (
            vec!["--cell", "0.06mm", "--width", "0.6mm"],
            "width of beads is 0.5 mm, that of this build is 0.6 mm",
        ),
        (
            vec!["--cell", "0.07mm", "--width", "0.5mm"],
            "finest cell is 0.06 mm, that of this build is 0.07 mm",
        ),
        (
            vec!["--cell", "0.06mm", "--width", "0.5mm", "--skip", "Skirt/Brim"],
            "list of features left out is [], that of this build is [\"Skirt/Brim\"]",
        ),
    ] {
        let mut all: Vec<&dyn AsRef<OsStr>> = vec![&input];
        all.extend(args.iter().map(|arg| arg as &dyn AsRef<OsStr>));
        let line = refused(&all);
        assert!(line.contains(expected) && !line.contains("BLAKE3"), "{line}");
    }
}

/// Begins a build to `o.brf` and interrupts it when something of it is safe.
fn suspended(dir: &Scratch, args: &[&dyn AsRef<OsStr>]) {
    let mut command = program();
    command.arg("build").args(args.iter().map(AsRef::as_ref)).arg("-o").arg(dir.path("o.brf"));
    command.args(["--threads", "1", "--commit-every", "0.005", "--quiet"]);
    let child = command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    let line = interrupt(child, dir, "o.brf.journal", "-INT").ended_by(2);
    assert!(line.contains("goes on from there"), "{line}");
}

#[test]
fn a_build_that_goes_on_says_from_where() {
    let dir = Scratch::new();
    let input = stl("overlap_boxes");
    suspended(&dir, &[&input, &"--depth", &"5"]);
    let ran = run(&[&"build", &input, &"-o", &dir.path("o.brf"), &"--depth", &"5"]);
    assert_eq!(ran.status, Some(0), "{}", ran.stderr);
    assert!(
        ran.notes.contains("going on from") && ran.notes.contains("% of the way through the tree"),
        "{}",
        ran.notes
    );
    let line = ran.stdout.lines().find(|line| line.contains("resumed")).expect(&ran.stdout);
    assert!(line.contains("nodes of an earlier run"), "{line}");
    suspended(&dir, &[&input, &"--depth", &"5", &"--restart"]);
    let json = run(&[&"build", &input, &"-o", &dir.path("o.brf"), &"--depth", &"5", &"--json", &"-q"]).json();
    let part = json["resumed"]["part"].as_f64().unwrap();
    assert!(json["resumed"]["nodes"].as_u64() > Some(0) && part > 0.0 && part <= 1.0, "{json}");
    let whole = run(&[&"build", &input, &"-o", &dir.path("o.brf"), &"--depth", &"2", &"--json", &"-q"]);
    let whole: serde_json::Value = serde_json::from_str(&whole.stdout).unwrap();
    assert!(whole["resumed"].is_null());
}

#[test]
fn a_shell_inside_out_is_found() {
    let dir = Scratch::new();
    let outer = cuboid([0.0; 3], [10.0; 3]);
    let inner = cuboid([2.0; 3], [4.0; 3]);
    let core = cuboid([2.5; 3], [3.5; 3]);
    let beside = cuboid([20.0, 0.0, 0.0], [22.0, 2.0, 2.0]);
    let turned = |facets: &[Facet]| facets.iter().map(|[a, b, c]| [*a, *c, *b]).collect::<Vec<Facet>>();
    let write = |name: &str, shells: &[&[Facet]]| {
        let facets = shells.concat();
        dir.file(name, binary_stl(facets.len() as u32, &facets))
    };
    let check = |path: &std::path::Path| run(&[&"mesh", &"--check", &path, &"--json"]);
    // A cavity, and a body within it, are as they should be.
    let sound = write("sound.stl", &[&outer, &turned(&inner), &core, &beside]);
    let json = check(&sound).json();
    assert_eq!((&json["sound"], &json["facing_outward"]), (&true.into(), &true.into()));
    for (name, shells, volume) in [
        ("one.stl", vec![turned(&outer)], 1000.0),
        ("beside.stl", vec![outer.clone(), turned(&inner), turned(&beside)], 8.0),
    ] {
        let shells: Vec<&[Facet]> = shells.iter().map(Vec::as_slice).collect();
        let path = write(name, &shells);
        let ran = check(&path);
        assert_eq!(ran.status, Some(1), "{name}");
        assert!(ran.stderr.contains("1 closed shell is inside out"), "{}", ran.stderr);
        let json: serde_json::Value = serde_json::from_str(&ran.stdout).unwrap();
        assert_eq!((&json["sound"], &json["closed"]), (&false.into(), &true.into()), "{name}");
        let found = json["inside_out"]["volume"].as_f64().unwrap();
        assert!((found.abs() - volume).abs() < 0.01, "{name}: {found}");
        let text = run(&[&"mesh", &"--check", &path]);
        assert!(text.stdout.contains("wrong    1 closed shell is inside out"), "{}", text.stdout);
    }
}

/// Kills a child as soon as a file is there.
fn killed_when(mut child: Child, dir: &Scratch, name: &str) {
    let started = Instant::now();
    while !dir.names().iter().any(|there| there == name) {
        assert!(child.try_wait().unwrap().is_none(), "it ended before it began to write");
        assert!(started.elapsed() < Duration::from_secs(60));
        std::thread::sleep(Duration::from_millis(1));
    }
    assert!(Command::new("kill").args(["-KILL", &child.id().to_string()]).status().unwrap().success());
    child.wait().unwrap();
}

#[test]
fn what_a_killed_mesh_leaves_is_told_and_gone_after_the_next() {
    let dir = Scratch::new();
    let store = dir.store("clover_beads", 4);
    let mesh = dir.path("o.stl");
    run(&[&"mesh", &store, &"-o", &mesh, &"-q"]).ok();
    let expected = std::fs::read(&mesh).unwrap();
    std::fs::remove_file(&mesh).unwrap();
    let mut command = program();
    command.arg("mesh").arg(&store).arg("-o").arg(&mesh).stdout(Stdio::null()).stderr(Stdio::null());
    killed_when(command.spawn().unwrap(), &dir, "o.stl.part");
    assert_eq!(dir.names(), ["clover_beads-4.brf", "o.stl.part"]);
    let ran = run(&[&"mesh", &store, &"-o", &mesh]);
    assert!(ran.notes.contains("o.stl.part") && ran.notes.contains("killed run"), "{}", ran.notes);
    ran.ok();
    assert_eq!(dir.names(), ["clover_beads-4.brf", "o.stl"]);
    assert!(std::fs::read(&mesh).unwrap() == expected);
    // That of a writer that lives is left alone.
    let file = std::fs::File::create(dir.path("o.stl.part")).unwrap();
    file.lock().unwrap();
    let ran = run(&[&"mesh", &store, &"-o", &mesh]);
    assert!(!ran.notes.contains("killed run"), "{}", ran.notes);
    assert!(ran.failed().contains("another process is writing"));
    assert!(dir.path("o.stl.part").exists());
}

#[test]
fn files_larger_than_the_disk_are_refused_before_they_are_written() {
    let dir = Scratch::new();
    // Two small boxes far apart: deep bricks are few.
    let facets = [cuboid([0.0; 3], [0.01; 3]), cuboid([100.0; 3], [100.01; 3])].concat();
    let input = dir.file("far.stl", binary_stl(facets.len() as u32, &facets));
    let store = dir.path("far.brf");
    run(&[&"build", &input, &"-o", &store, &"--depth", &"10", &"-q"]).ok();
    // 32768³ samples of 2 bytes.
    let line = run(&[&"export", &store, &"--level", &"10", &"-o", &dir.path("w.npy")]).failed();
    assert!(line.contains("w.npy: about 64") && line.contains("are free there"), "{line}");
    assert!(line.contains("lower --level"), "{line}");
    assert_eq!(dir.names(), ["far.brf", "far.stl"]);
}

#[test]
fn old_spellings_are_still_understood() {
    let dir = Scratch::new();
    let (part, store) = (example("clover.gcode"), dir.path("o.brf"));
    let same = |old: &[&str], new: &[&str]| {
        let bytes = |options: &[&str]| {
            let depth = part_or_all("1", "2");
            let mut args: Vec<&dyn AsRef<OsStr>> =
                vec![&"build", &part, &"-o", &store, &"--depth", &depth, &"-q"];
            args.extend(options.iter().map(|arg| arg as &dyn AsRef<OsStr>));
            assert_eq!(run(&args).status, Some(0), "{options:?}");
            std::fs::read(&store).unwrap()
        };
        assert!(bytes(old) == bytes(new), "{old:?}");
    };
    same(&["--beads", "mesh"], &["--beads-as", "mesh"]);
    same(&["--units", "in"], &["--unit", "in"]);
    same(&["--section", "ellipse"], &["--bead-section", "ellipse"]);
    same(&["--beads", "mesh", "--tolerance", "0.1mm"], &["--beads-as", "mesh", "--boundary-error", "0.1mm"]);
    let help = run(&[&"build", &"--help"]).ok();
    for old in ["--units", "--beads ", "--section ", "--tolerance "] {
        assert!(!help.contains(old), "{old}");
    }
}
