//! Wrong usage: status 2 and a way out; help for all.

use crate::support::*;
use std::ffi::OsStr;

const COMMANDS: [&str; 16] = [
    "build",
    "beads",
    "mesh",
    "info",
    "sample",
    "winding",
    "export",
    "csg",
    "machine",
    "slice",
    "render",
    "view",
    "verify",
    "cache",
    "completions",
    "man",
];

#[test]
fn what_makes_no_sense_is_refused() {
    let dir = Scratch::new();
    let input = stl("overlap_boxes");
    let out = dir.path("o.brf");
    let build = |more: &[&str]| {
        let mut args: Vec<&dyn AsRef<OsStr>> = vec![&"build", &input, &"-o", &out];
        args.extend(more.iter().map(|arg| arg as &dyn AsRef<OsStr>));
        run(&args).misused()
    };
    let cuda = build(&["--backend", "cuda"]);
    assert!(cuda.contains("auto") && cuda.contains("cpu"), "{cuda}");
    for more in [
        &["--depth", "17"] as &[&str],
        &["--depth", "-1"],
        &["--depth", "2", "--cell", "1mm"],
        &["--cell", "0mm"],
        &["--cell", "1parsec"],
        &["--stddev", "-1"],
        &["--stddev", "nan"],
        &["--refine", "everything"],
        &["--threads", "0"],
        &["--memory", "lots"],
        &["--memory", "0"],
        &["--units", "furlong"],
        &["--mesh", "part.step"],
        &["--tolerance", "-1mm"],
        &["--tolerance", "1mm", "--stddev", "0.1"],
        &["--tolerance", "1mm", "--refine", "surface"],
    ] {
        let text = build(more);
        assert!(!text.is_empty(), "{more:?}");
    }
    run(&[]).misused();
    run(&[&"bake"]).misused();
    run(&[&"build"]).misused();
    run(&[&"build", &input]).misused();
    let store = dir.store("overlap_boxes", 1);
    run(&[&"mesh", &store, &"-o", &dir.path("x.step")]).misused();
    run(&[&"mesh", &store, &"-o", &dir.path("x.stl"), &"--iso", &"0"]).misused();
    run(&[&"mesh", &store, &"-o", &dir.path("x.stl"), &"--iso", &"nan"]).misused();
    run(&[&"export", &store, &"--level", &"1", &"-o", &dir.path("x.nii")]).misused();
    run(&[&"man", &"bake"]).misused();
    run(&[&"man", &"build", &"merge"]).misused();
    run(&[&"completions", &"cmd.exe"]).misused();
    assert_eq!(dir.names(), ["overlap_boxes-1.brf"]);
}

#[test]
fn everything_has_help() {
    let all = run(&[&"--help"]).ok();
    for command in COMMANDS {
        assert!(all.contains(&format!("  {command}")), "{command}");
        assert!(run(&[&command, &"--help"]).ok().contains("Usage: brickfield"), "{command}");
    }
    assert!(run(&[&"--version"]).ok().starts_with("brickfield "));
    assert!(run(&[&"build", &"--help"]).ok().contains("512 cells"));
}
