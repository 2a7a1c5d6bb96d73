//! Memory, disk, and progress for programs.

use crate::support::*;
use brickfield_core::sweep::part_or_all;
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

/// Anonymous memory stays within 1.05 times what is allowed, where a build that may take more does.
#[test]
#[cfg(target_os = "linux")]
fn a_build_stays_within_its_memory() {
    let dir = Scratch::new();
    let (input, out) = (dir.pile("pile.stl", 3_000_000), dir.path("o.brf"));
    let peak = |memory: u64| {
        let allowed = format!("{memory}MiB");
        let args: [&dyn AsRef<std::ffi::OsStr>; 11] = [
            &"build",
            &input,
            &"-o",
            &out,
            &"--depth",
            &"3",
            &"--threads",
            &"2",
            &"--memory",
            &allowed,
            &"-q",
        ];
        peak_anonymous_mib(&args)
    };
    let allowed = part_or_all(100, 84);
    let (within, unbound, most) = (peak(allowed), peak(1024), allowed * 105 / 100);
    assert!(within <= most && unbound > most, "{within} of {allowed} MiB, {unbound} of 1024 MiB");
}

/// The temporary file of a mesh is in the folder that is named for it, of whichever command.
#[test]
#[cfg(target_os = "linux")]
fn a_mesh_waits_in_the_folder_for_temporary_files() {
    let dir = Scratch::new();
    let (store, mesh, none) = (dir.path("o.brf"), dir.path("o.ply"), dir.path("none"));
    run(&[&"build", &stl("overlap_boxes"), &"-o", &store, &"--depth", &"3", &"-q"]).ok();
    let args: [&dyn AsRef<std::ffi::OsStr>; 5] = [&"mesh", &store, &"-o", &mesh, &"--temp-dir"];
    let refused = run(&[&args[..], &[&none]].concat()).failed();
    assert!(refused.contains("not a folder") && refused.contains("--temp-dir"), "{refused}");
    assert_eq!(dir.names(), ["o.brf"]);
    // A folder in which no file can be made, whoever asks.
    let refused = run(&[&args[..], &[&"/proc"]].concat()).failed();
    assert!(refused.contains("temporary file in") && refused.contains("/proc"), "{refused}");
    run(&[&args[..], &[&std::env::temp_dir()]].concat()).ok();
    assert_eq!(dir.names(), ["o.brf", "o.ply"]);
}

#[test]
fn the_caps_of_an_open_mesh_must_fit() {
    let dir = Scratch::new();
    let mut facets = Vec::new();
    for n in 0..20_000 {
        facets.extend(cuboid([n as f32; 3], [n as f32 + 2.0; 3]));
    }
    facets.pop();
    let input = dir.file("open.stl", binary_stl(facets.len() as u32, &facets));
    let build = |store: &std::path::Path, memory: &str| {
        run(&[&"build", &input, &"-o", &store, &"--threads", &"1", &"--memory", &memory])
    };
    let refused = build(&dir.path("o.brf"), "75MiB").failed();
    assert!(
        refused.contains("the surface is open") && refused.contains("triangles that close it"),
        "{refused}"
    );
    assert_eq!(dir.names(), ["open.stl"]);
    let (small, large) = (dir.path("small.brf"), dir.path("large.brf"));
    build(&small, "160MiB").ok();
    build(&large, "1GiB").ok();
    assert!(std::fs::read(small).unwrap() == std::fs::read(large).unwrap());
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
