//! Memory, disk, and progress for programs.

use crate::support::*;
use serde_json::Value;

#[test]
fn a_bound_on_memory_changes_nothing_but_is_refused_if_nothing_can_be_done_in_it() {
    let dir = Scratch::new();
    let (free, bound) = (dir.path("free.brf"), dir.path("bound.brf"));
    run(&[&"build", &stl("clover_beads"), &"-o", &free, &"--depth", &"3"]).ok();
    let args: [&dyn AsRef<std::ffi::OsStr>; 8] =
        [&"build", &stl("clover_beads"), &"-o", &bound, &"--depth", &"3", &"--threads", &"2"];
    run(&[&args[..], &[&"--memory", &"90MiB", &"--temp-dir", &dir.path("")]].concat()).ok();
    assert!(std::fs::read(&free).unwrap() == std::fs::read(&bound).unwrap());
    let refused = run(&[&args[..], &[&"--memory", &"20MiB"]].concat()).failed();
    assert!(refused.contains("111960 facets need at least") && refused.contains("--memory"), "{refused}");
    let refused = run(&[&args[..], &[&"--temp-dir", &dir.path("none")]].concat()).failed();
    assert!(refused.contains("not a folder"), "{refused}");
    assert_eq!(dir.names(), ["bound.brf", "free.brf"]);
}

#[test]
fn an_open_mesh_that_does_not_fit_is_refused() {
    let dir = Scratch::new();
    let mut facets = Vec::new();
    for n in 0..20_000 {
        facets.extend(cuboid([n as f32; 3], [n as f32 + 2.0; 3]));
    }
    facets.pop();
    let input = dir.file("open.stl", binary_stl(facets.len() as u32, &facets));
    let args: [&dyn AsRef<std::ffi::OsStr>; 8] =
        [&"build", &input, &"-o", &dir.path("o.brf"), &"--threads", &"1", &"--memory", &"75MiB"];
    let refused = run(&args).failed();
    assert!(refused.contains("the surface is open") && refused.contains("239999 facets"), "{refused}");
    assert_eq!(dir.names(), ["open.stl"]);
}

#[test]
fn progress_comes_as_json_lines_on_request() {
    let dir = Scratch::new();
    let args: [&dyn AsRef<std::ffi::OsStr>; 8] =
        [&"build", &stl("clover_beads"), &"-o", &dir.path("o.brf"), &"--depth", &"4", &"--progress", &"json"];
    let done = program().args(args.iter().map(AsRef::as_ref)).output().unwrap();
    assert!(done.status.success());
    let lines: Vec<Value> = String::from_utf8(done.stderr)
        .unwrap()
        .lines()
        .map(|line| serde_json::from_str(line).unwrap())
        .collect();
    for phase in ["measuring", "snapping", "building", "finishing"] {
        let of_phase: Vec<&Value> = lines.iter().filter(|line| line["phase"] == phase).collect();
        let (first, last) = (of_phase.first().unwrap(), of_phase.last().unwrap());
        assert!(first["done"] == 0 && last["ended"] == true && last["seconds"].is_f64(), "{phase}");
    }
    let snapped = lines.iter().rfind(|line| line["phase"] == "snapping").unwrap();
    assert_eq!(
        (&snapped["done"], &snapped["total"], &snapped["left"]),
        (&111_960.into(), &111_960.into(), &0.0.into())
    );
}
