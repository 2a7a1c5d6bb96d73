//! What cannot be read or written: status 1, one line that names the file, nothing left behind.

use crate::support::*;
use std::ffi::OsStr;
use std::path::Path;

/// Builds from `input` and expects the one line to name it and to contain `why`.
#[track_caller]
fn refused(dir: &Scratch, input: &Path, why: &str) {
    let before = dir.names();
    let (out, mesh) = (dir.path("out.brf"), dir.path("out.ply"));
    let line = run(&[&"build", &input, &"-o", &out, &"--mesh", &mesh, &"--depth", &"2"]).failed();
    let name = input.file_name().and_then(OsStr::to_str).unwrap();
    assert!(line.contains(name) && line.contains(why), "{line}");
    assert_eq!(dir.names(), before);
    // The other reader of meshes is no more lenient.
    let points = dir.file("points.csv", "0,0,0\n");
    let line = run(&[&"winding", &input, &"--points", &points]);
    if line.status != Some(0) {
        let line = line.failed();
        assert!(line.contains(name), "{line}");
    }
    std::fs::remove_file(points).unwrap();
}

#[test]
fn files_that_are_no_meshes() {
    let dir = Scratch::new();
    refused(&dir, &dir.path("missing.stl"), "No such file");
    refused(&dir, &dir.file("empty.stl", ""), "is empty");
    refused(&dir, &dir.file("notes.txt", "Dear diary,\n"), "neither STL nor OBJ nor PLY nor X3D nor G-code");
    refused(&dir, &dir.file("noise.stl", [0xa5; 100]), "line 1");
    std::fs::create_dir(dir.path("folder")).unwrap();
    refused(&dir, &dir.path("folder"), "directory");
    refused(&dir, Path::new("/dev/zero"), "not a regular file");
}

#[test]
fn damaged_meshes() {
    let dir = Scratch::new();
    refused(&dir, &stl("truncated"), "5240 facets");
    let facets = cuboid([0.0; 3], [1.0; 3]);
    refused(&dir, &dir.file("liar.stl", binary_stl(u32::MAX, &facets)), "4294967295 facets");
    refused(&dir, &dir.file("none.stl", binary_stl(0, &[])), "no facets");
    refused(&dir, &dir.file("none.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\n"), "no facets");
    refused(&dir, &dir.file("index.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 9\n"), "line 4");
    let ply = "ply\nformat ascii 1.0\nelement vertex 4000000000\nproperty float x\nproperty float y\n\
               property float z\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n";
    refused(&dir, &dir.file("liar.ply", ply), "4000000000");
}

#[test]
fn coordinates_that_are_no_numbers() {
    let dir = Scratch::new();
    refused(&dir, &stl("degenerate_mix"), "facet 15");
    for (name, value) in [("nan.stl", f32::NAN), ("inf.stl", f32::NEG_INFINITY)] {
        let mut facets = cuboid([0.0; 3], [1.0; 3]);
        facets[7][1][2] = value;
        refused(&dir, &dir.file(name, binary_stl(12, &facets)), "facet 8");
    }
}

#[test]
fn soups_without_area() {
    let dir = Scratch::new();
    let point = [[1.0, 2.0, 3.0]; 3];
    refused(&dir, &dir.file("point.stl", binary_stl(2, &[point; 2])), "fits no lattice");
    let needle = [[0.0; 3], [1.0, 2.0, 3.0], [1.0, 2.0, 3.0]];
    refused(&dir, &dir.file("needles.stl", binary_stl(2, &[needle; 2])), "has an area");
    let line = [[0.0; 3], [1.0, 1.0, 1.0], [2.0, 2.0, 2.0]];
    refused(&dir, &dir.file("line.stl", binary_stl(1, &[line])), "has an area");
}

#[test]
fn outputs_that_cannot_be() {
    let dir = Scratch::new();
    let input = dir.file("box.stl", binary_stl(12, &cuboid([0.0; 3], [1.0; 3])));
    let store = dir.path("box.brf");
    run(&[&"build", &input, &"-o", &store, &"--depth", &"1"]).ok();
    let before = (dir.names(), std::fs::read(&input).unwrap(), std::fs::read(&store).unwrap());
    let (new, nowhere, folder) = (dir.path("new.brf"), dir.path("nowhere/x"), dir.path("folder.ply"));
    std::fs::create_dir(&folder).unwrap();
    for out in [&nowhere, &folder, Path::new("/proc/x"), &input, &dir.path("./box.stl")] as [&Path; 5] {
        let name = out.to_str().unwrap();
        let built = run(&[&"build", &input, &"-o", &out, &"--depth", &"1"]);
        // Names of other kinds of files are refused as what was typed.
        let line = if out.extension().is_some() { built.misused() } else { built.failed() };
        assert!(line.contains(name), "{name}: {line}");
        let mesh = if out.extension().is_none() { out.with_extension("ply") } else { out.to_owned() };
        let line = run(&[&"build", &input, &"-o", &new, &"--depth", &"1", &"--mesh", &mesh]).failed();
        assert!(line.contains(mesh.to_str().unwrap()), "{name}: {line}");
    }
    std::fs::remove_dir(&folder).unwrap();
    let same = dir.path("same.ply");
    let line = run(&[&"build", &input, &"-o", &same, &"--mesh", &same]).misused();
    assert!(line.contains("this writes a brick store, not .ply"), "{line}");
    let link = dir.path("link.ply");
    std::os::unix::fs::symlink(&store, &link).unwrap();
    let line = run(&[&"mesh", &store, &"-o", &link]).failed();
    assert!(line.contains("link.ply"), "{line}");
    std::fs::remove_file(link).unwrap();
    for out in [dir.path("nowhere/w.npy"), "/proc/w.npy".into()] {
        let line = run(&[&"export", &store, &"--level", &"0", &"-o", &out]).failed();
        assert!(line.contains(out.to_str().unwrap()), "{line}");
    }
    assert_eq!((dir.names(), std::fs::read(&input).unwrap(), std::fs::read(&store).unwrap()), before);
}

#[test]
fn a_full_disk_is_an_error_and_leaves_nothing() {
    let dir = Scratch::new();
    let input = stl("clover_model");
    // A limit on the size of files does what a full disk does, and needs no rights.
    let limited = |command: &str| -> Run {
        let script = format!("ulimit -f 64; exec \"$0\" {command}");
        let mut shell = std::process::Command::new("sh");
        shell.args(["-c", &script, env!("CARGO_BIN_EXE_brickfield")]);
        shell.env("IN", &input).env("DIR", dir.path("")).output().unwrap().into()
    };
    let line = limited("build \"$IN\" -o \"$DIR/x.brf\" --depth 4").failed();
    assert!(line.contains("x.brf") && line.contains("cannot write"), "{line}");
    let store = dir.store("overlap_boxes", 2);
    for (out, command) in [("x.stl", "mesh"), ("x.npy", "export --level 2")] {
        let (command, more) = command.split_once(' ').unwrap_or((command, ""));
        let line = limited(&format!("{command} '{}' {more} -o \"$DIR/{out}\"", store.display())).failed();
        assert!(line.contains(out) && line.contains("cannot write"), "{line}");
    }
    assert_eq!(dir.names(), ["overlap_boxes-2.brf"]);
}

#[test]
fn an_input_with_the_name_of_an_unfinished_output_is_safe() {
    let dir = Scratch::new();
    let soup = binary_stl(12, &cuboid([0.0; 3], [1.0; 3]));
    for (input, mesh) in [("c.brf.part", None), ("m.stl.part", Some("m.stl"))] {
        let input = dir.file(input, &soup);
        let mut arguments: Vec<std::path::PathBuf> =
            vec!["build".into(), input.clone(), "-o".into(), dir.path("c.brf")];
        if let Some(mesh) = mesh {
            arguments.extend(["--mesh".into(), dir.path(mesh)]);
        }
        let arguments: Vec<&dyn AsRef<OsStr>> = arguments.iter().map(|a| a as _).collect();
        let line = run(&arguments).failed();
        assert!(line.contains("would overwrite"), "{line}");
        assert!(std::fs::read(&input).unwrap() == soup);
    }
}

#[test]
fn meshes_beyond_32_bit_coordinates_are_refused() {
    let dir = Scratch::new();
    let mut text = String::from("solid far\n");
    for [a, b, c] in cuboid([0.0; 3], [1.0; 3]) {
        let at = |p: [f32; 3]| format!("vertex {} {} {}\n", 1e7 + f64::from(p[0]), p[1], p[2]);
        text += &format!("facet normal 0 0 0\nouter loop\n{}{}{}endloop\nendfacet\n", at(a), at(b), at(c));
    }
    let input = dir.file("far.stl", text + "endsolid far\n");
    // Other formats have 64.
    let (store, mesh) = (dir.path("far.brf"), dir.path("far.glb"));
    run(&[&"build", &input, &"-o", &store, &"--depth", &"2"]).ok();
    let line = run(&[&"mesh", &store, &"-o", &mesh]).failed();
    assert!(line.contains("32 bits"), "{line}");
    assert!(!mesh.exists());
}

/// Waits until a process has mapped a file.
#[cfg(target_os = "linux")]
fn wait_for_map(process: u32, path: &std::path::Path) {
    let name = path.file_name().unwrap().to_str().unwrap();
    let has_map = || std::fs::read_to_string(format!("/proc/{process}/maps")).is_ok_and(|m| m.contains(name));
    // Inputs are looked at once before they are opened.
    let mut seen = 0;
    while seen < 30 {
        seen = if has_map() { seen + 1 } else { 0 };
        std::thread::sleep(std::time::Duration::from_millis(10));
    }
}

/// Starts a command that waits for points when it has opened `path`; cuts that short; gives it the points.
#[cfg(target_os = "linux")]
fn cut_meanwhile(args: &[&dyn AsRef<std::ffi::OsStr>], path: &std::path::Path) -> Run {
    use std::io::Write;
    use std::process::Stdio;
    let mut command = program();
    command.args(args.iter().map(AsRef::as_ref));
    command.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped());
    let mut child = command.spawn().expect("it runs");
    wait_for_map(child.id(), path);
    std::fs::File::options().write(true).open(path).unwrap().set_len(20_000).unwrap();
    // It may have ended by now.
    let point = |n: i32| format!("{},{},{}\n", 70 + n % 10 * 6, 70 + n / 10 % 10 * 6, n / 100 * 2);
    let points: String = (0..1000).map(point).collect();
    let _ = child.stdin.take().unwrap().write_all(points.as_bytes());
    child.wait_with_output().unwrap().into()
}

#[cfg(target_os = "linux")]
#[test]
fn files_that_are_cut_short_meanwhile_are_errors_of_one_line() {
    let dir = Scratch::new();
    let input = dir.file("input.stl", std::fs::read(stl("clover_beads")).unwrap());
    let line = cut_meanwhile(&[&"winding", &input, &"--points", &"-"], &input).failed();
    // The latter on a machine so busy that it had not been opened yet.
    let told = ["leave the file alone", "header claims"].iter().any(|what| line.contains(what));
    assert!(line.contains("input.stl: ") && told, "{line}");
    let store = dir.store("clover_beads", 3);
    let ran = cut_meanwhile(&[&"sample", &store, &"--io", &"mmap", &"--points", &"-"], &store);
    // The header of the answer has been printed.
    let line = Run { stdout: String::new(), ..ran }.failed();
    assert!(line.contains("clover_beads-3.brf: record ") && line.contains("cut short"), "{line}");
}

#[test]
fn names_with_line_breaks_stay_in_their_line() {
    let dir = Scratch::new();
    let input = dir.file("a\nb.stl", std::fs::read(stl("overlap_boxes")).unwrap());
    let store = dir.path("c\nd.brf");
    run(&[&"build", &input, &"-o", &store, &"--depth", &"1", &"--quiet"]).ok();
    let text = run(&[&"info", &store]).ok();
    assert!(text.lines().next().unwrap().contains("c d.brf: brick store"), "{text}");
    assert!(text.contains("a b.stl: STL binary"), "{text}");
    let array = dir.path("e\nf.npy");
    assert_eq!(run(&[&"export", &store, &"--level", &"0", &"-o", &array]).ok().lines().count(), 1);
    for command in ["verify", "mesh"] {
        let out = dir.path("g\nh.stl");
        let mut args: Vec<&dyn AsRef<std::ffi::OsStr>> = vec![&command, &store];
        if command == "mesh" {
            args.extend([&"-o" as &dyn AsRef<std::ffi::OsStr>, &out]);
        }
        // A mesh has a line about its source, too.
        let lines = if command == "mesh" { 2 } else { 1 };
        assert_eq!(run(&args).ok().lines().count(), lines, "{command}");
    }
}

/// Where the program has no client of servers.
#[cfg(not(feature = "http"))]
#[test]
fn an_address_is_refused_in_a_line() {
    for command in ["info", "verify"] {
        let line = run(&[&command, &"https://example.org/part.brf"]).failed();
        assert!(line.contains("built without the feature that reads from servers"), "{line}");
        assert!(line.contains("`--features http`, or copy the store here first"), "{line}");
    }
}
