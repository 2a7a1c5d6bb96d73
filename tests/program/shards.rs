//! `brickfield build --shard` and `brickfield cache merge`.

use crate::support::*;
use brickfield_core::sweep::part_or_all;
use std::ffi::OsStr;
use std::fs;
use std::path::{Path, PathBuf};

fn example(name: &str) -> String {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../bench-data").join(name);
    path.to_str().expect("text").to_owned()
}

fn build(input: &[&str], args: &[&str], output: &Path) -> Run {
    let mut command = program();
    command.arg("build").args(input).args(args).arg("-o").arg(output).arg("--quiet");
    command.output().expect("it runs").into()
}

/// All `of` shards, each with another number of threads.
#[track_caller]
fn shards(dir: &Scratch, input: &[&str], args: &[&str], of: usize) -> Vec<PathBuf> {
    let shard = |number: usize| {
        let path = dir.path(&format!("shard-{number}-of-{of}.brf"));
        let shard = format!("{number}/{of}");
        let threads = (number % 3 + 1).to_string();
        let args = [args, &["--shard", &shard, "--threads", &threads]].concat();
        let run = build(input, &args, &path);
        assert_eq!(run.status, Some(0), "{}", run.stderr);
        path
    };
    (1..=of).map(shard).collect()
}

fn merge(shards: &[PathBuf], output: &Path) -> Run {
    let mut args: Vec<&dyn AsRef<OsStr>> = vec![&"cache", &"merge", &"-o", &output, &"--quiet"];
    args.extend(shards.iter().map(|path| path as &dyn AsRef<OsStr>));
    run(&args)
}

/// Another order.
fn shuffled(shards: &[PathBuf]) -> Vec<PathBuf> {
    let step = (1..).map(|n| n * 7 + 3).find(|step| shards.len() == 1 || gcd(*step, shards.len()) == 1);
    (0..shards.len()).map(|n| shards[(n * step.unwrap_or(1) + 1) % shards.len()].clone()).collect()
}

fn gcd(a: usize, b: usize) -> usize {
    if b == 0 { a } else { gcd(b, a % b) }
}

#[track_caller]
fn joined_is_whole(input: &[&str], args: &[&str], numbers: &[usize]) {
    let dir = Scratch::new();
    let whole = dir.path("whole.brf");
    assert_eq!(build(input, args, &whole).status, Some(0), "{input:?} {args:?}");
    let whole = fs::read(whole).unwrap();
    // Every second number in any case, the largest first.
    for &of in numbers.iter().rev().step_by(part_or_all(2, 1)) {
        let shards = shards(&dir, input, args, of);
        for order in [shards.clone(), shuffled(&shards)] {
            let joined = dir.path("joined.brf");
            merge(&order, &joined).ok();
            assert!(fs::read(joined).unwrap() == whole, "{input:?} {args:?}, {of} shards");
        }
        shards.iter().for_each(|shard| fs::remove_file(shard).unwrap());
    }
    assert_eq!(dir.names(), ["joined.brf", "whole.brf"]);
}

#[test]
fn closed_meshes_are_joined_to_the_bytes_of_one_build() {
    joined_is_whole(&[&example("stl/clover_beads.stl")], &["--depth", "3"], &[1, 2, 3, 7]);
    let two = [&*example("stl/overlap_boxes.stl"), &example("stl/box_with_cavity.stl")];
    joined_is_whole(&two, &["--cell", "0.1"], &[2, 5]);
}

#[test]
fn a_hundred_shards_of_anything_are_joined() {
    joined_is_whole(&[&example("stl/clover_model.stl")], &["--depth", part_or_all("2", "3")], &[100]);
    joined_is_whole(&[&example("stl/overlap_boxes.stl")], &["--depth", "0"], &[1, 100, 2]);
}

#[test]
fn trees_whose_nodes_decide_are_joined_to_the_bytes_of_one_build() {
    let beads = example("stl/clover_beads.stl");
    joined_is_whole(&[&beads], &["--depth", "3", "--refine", "surface"], &[2, 7]);
    let model = example("stl/clover_model.stl");
    joined_is_whole(&[&model], &["--depth", "4", "--refine", "stddev", "--stddev", "0.2"], &[7]);
    joined_is_whole(&[&model], &["--depth", "3", "--stddev", "0.3"], &[1, 3]);
    joined_is_whole(&[&model], &["--depth", "4", "--tolerance", "0.01mm"], &[3, 7]);
    joined_is_whole(&[&example("stl/spot40_model.stl")], &["--depth", "4", "--tolerance", "0.05mm"], &[1, 5]);
}

#[test]
fn toolpaths_are_joined_to_the_bytes_of_one_build() {
    let part = example("clover.gcode");
    joined_is_whole(&[&part], &["--depth", part_or_all("3", "4"), "--identity"], &[3]);
    joined_is_whole(&[&part], &["--depth", "3"], &[2, 7]);
    joined_is_whole(&[&part], &["--depth", "3", "--identity", "--refine", "surface"], &[2, 5]);
    joined_is_whole(&[&part], &["--depth", "3", "--beads", "mesh"], &[3]);
}

/// Beads that fill cubes of several shards: what a leaf is shows only when these are joined.
#[test]
fn beads_larger_than_cubes_are_joined_to_the_bytes_of_one_build() {
    let dir = Scratch::new();
    let lines = "G21\nM83\nG90\n;WIDTH:60\n;HEIGHT:60\nG1 Z60 F600\nG1 X0 Y0\nG1 X40 Y0 E1\nG1 X40 Y25 E1\nG1 X80 Y90 E1\n\
                 G0 X90 Y0\nG1 X0 Y80 E1\n";
    let part = dir.file("fat.gcode", lines);
    let part = part.to_str().unwrap();
    let sized = ["--identity", "--width", "60", "--height", "60", "--depth"];
    joined_is_whole(&[part], &[&sized[..], &["4"]].concat(), &[3, 8]);
    joined_is_whole(&[part], &[&sized[..], &["2"]].concat(), &[3, 7]);
}

#[test]
fn open_meshes_and_extrusions_are_joined_to_the_bytes_of_one_build() {
    let open = example("stl/open_box_no_lid.stl");
    let depth = part_or_all("2", "3");
    joined_is_whole(&[&open], &["--depth", depth], &[2, 7]);
    joined_is_whole(&[&open], &["--depth", depth, "--gwn-error", "0.01", "--refine", "surface"], &[3]);
    joined_is_whole(&[&example("x3d/clover_beads.x3d")], &["--depth", "3"], &[1, 4]);
}

#[test]
fn clouds_are_joined_to_the_bytes_of_one_build() {
    let points: String = (0..600)
        .map(|n| {
            let (z, angle) = (f64::from(n) / 300.0 - 1.0, 2.4 * f64::from(n));
            let across = (1.0 - z * z).sqrt();
            let (x, y) = (across * angle.cos(), across * angle.sin());
            format!("{} {} {} {x} {y} {z}\n", 8.0 * x, 5.0 * y, 3.0 * z)
        })
        .collect();
    let dir = Scratch::new();
    let cloud = dir.file("cloud.xyz", points);
    joined_is_whole(&[cloud.to_str().unwrap()], &["--depth", "2"], &[1, 3]);
    joined_is_whole(
        &[cloud.to_str().unwrap(), &example("stl/overlap_boxes.stl")],
        &["--depth", "2", "--gwn-error", "0.3"],
        &[3],
    );
}

/// The plan of an input.
#[track_caller]
fn plan(dir: &Scratch, input: &[&str], args: &[&str]) -> PathBuf {
    let path = dir.path("part.plan");
    let run = build(input, &[args, &["--plan"]].concat(), &path);
    assert_eq!(run.status, Some(0), "{}", run.stderr);
    path
}

#[track_caller]
fn planned_is_whole(input: &[&str], args: &[&str], numbers: &[usize]) {
    let dir = Scratch::new();
    let whole = dir.path("whole.brf");
    assert_eq!(build(input, args, &whole).status, Some(0), "{input:?} {args:?}");
    let plan = plan(&dir, input, args);
    for &of in numbers {
        let shards = shards(&dir, &[plan.to_str().unwrap()], &[], of);
        let joined = dir.path("joined.brf");
        merge(&shuffled(&shards), &joined).ok();
        assert!(fs::read(joined).unwrap() == fs::read(&whole).unwrap(), "{input:?} {args:?}, {of} shards");
        shards.iter().for_each(|shard| fs::remove_file(shard).unwrap());
    }
    assert_eq!(dir.names(), ["joined.brf", "part.plan", "whole.brf"]);
}

#[test]
fn shards_of_a_plan_are_joined_to_the_bytes_of_one_build() {
    let beads = example("stl/clover_beads.stl");
    planned_is_whole(&[&beads], &["--depth", "3"], &[1, 7]);
    planned_is_whole(&[&beads], &["--depth", "4", "--memory", "90MiB"], &[3]);
    let two = [&*example("stl/overlap_boxes.stl"), &example("stl/box_with_cavity.stl")];
    planned_is_whole(&two, &["--cell", "0.1", "--unit", "in"], &[2]);
    planned_is_whole(&[&example("stl/clover_model.stl")], &["--depth", "3", "--thin", "2", "--orient"], &[4]);
    planned_is_whole(&[&example("x3d/clover_beads.x3d")], &["--depth", "2"], &[100]);
    planned_is_whole(&[&example("stl/overlap_boxes.stl")], &["--depth", "0"], &[2]);
    planned_is_whole(&[&example("clover.gcode")], &["--depth", "3", "--beads-as", "mesh"], &[3]);
}

#[test]
fn a_plan_needs_its_input_no_more() {
    let dir = Scratch::new();
    let input = dir.file("part.stl", fs::read(example("stl/clover_model.stl")).unwrap());
    let input_path = input.to_str().unwrap();
    let whole = dir.path("whole.brf");
    assert_eq!(build(&[input_path], &["--depth", "3"], &whole).status, Some(0));
    let told =
        run(&[&"build", &input, &"-o", &dir.path("part.plan"), &"--depth", &"3", &"--plan", &"--json"])
            .json();
    assert_eq!((&told["depth"], &told["degenerate_facets"]), (&3.into(), &0.into()));
    assert_eq!(told["file_bytes"], fs::metadata(dir.path("part.plan")).unwrap().len());
    fs::remove_file(input).unwrap();
    let shards = shards(&dir, &[dir.path("part.plan").to_str().unwrap()], &[], 3);
    merge(&shards, &dir.path("joined.brf")).ok();
    assert!(fs::read(dir.path("joined.brf")).unwrap() == fs::read(whole).unwrap());
}

#[test]
fn the_first_shard_measures_the_volumes_for_all() {
    let dir = Scratch::new();
    let shards = shards(&dir, &[&example("stl/clover_model.stl")], &["--depth", "3"], 3);
    let has_volumes = |path: &PathBuf| !run(&[&"info", path, &"--json"]).json()["source_volumes"].is_null();
    assert_eq!(shards.iter().map(has_volumes).collect::<Vec<_>>(), [true, false, false]);
}

#[test]
fn plans_that_cannot_be_made_or_read_are_refused() {
    let dir = Scratch::new();
    let out = dir.path("x.plan");
    let refused = |input: &str, args: &[&str], expected: &str| {
        let run = build(&[&example(input)], &[args, &["--plan", "--depth", "3"]].concat(), &out);
        assert!(run.status != Some(0) && run.stderr.contains(expected), "{}", run.stderr);
    };
    refused("stl/open_box_no_lid.stl", &[], "the surface is open");
    refused("stl/clover_model.stl", &["--boundary-error", "0.1mm"], "nodes decide");
    refused("clover.gcode", &[], "--beads-as mesh");
    let boxes = example("stl/overlap_boxes.stl");
    let told = build(&[&boxes], &["--plan"], &dir.path("x.brf")).stderr;
    assert!(told.contains("PART.plan"), "{told}");
    assert!(dir.names().is_empty(), "{:?}", dir.names());
    let plan = plan(&dir, &[&boxes], &["--depth", "3"]);
    let plan_path = plan.to_str().unwrap();
    let shard = dir.path("shard.brf");
    let sound = fs::read(&plan).unwrap();
    for (args, expected) in [
        (&[][..], "--shard 1/8"),
        (&["--shard", "1/2", "--depth", "3"], "--depth: the plan has settled it"),
        (&["--shard", "1/2", "--unit", "in"], "--unit: the plan has settled it"),
    ] {
        let told = build(&[plan_path], args, &shard).stderr;
        assert!(told.contains(expected), "{told}");
    }
    for other in [run(&[&"info", &plan]), run(&[&"mesh", &plan, &"-o", &dir.path("x.stl")])] {
        let line = other.failed();
        assert!(line.contains("is a plan") && line.contains("--shard 1/8"), "{line}");
    }
    let told = build(&[plan_path, &boxes], &["--shard", "1/2"], &shard).stderr;
    assert!(told.contains("a plan is built alone"), "{told}");
    // Triangles, the directory, the foot; cut short, and longer.
    let damage = |at: usize| {
        let mut bytes = sound.clone();
        bytes[at] ^= 4;
        bytes
    };
    let length = sound.len();
    let short = [&sound[..length - 1], &sound[..length / 2], &sound[..9]].map(<[u8]>::to_vec);
    let long = [&sound[..], b"x"].concat();
    let all = [10, length - 1000, length - 40, length - 30, length - 14, length - 2].map(damage);
    for bytes in all.into_iter().chain(short).chain([long]) {
        fs::write(&plan, bytes).unwrap();
        let told = build(&[plan_path], &["--shard", "1/1"], &shard).failed();
        assert!(told.contains("part.plan") && told.contains("make the plan again"), "{told}");
        assert!(!shard.exists());
    }
}

#[test]
fn a_bound_on_memory_does_not_show_in_a_shard() {
    let dir = Scratch::new();
    let beads = example("stl/clover_beads.stl");
    let [free, bound] =
        [&["--depth", "4", "--shard", "2/3"][..], &["--depth", "4", "--shard", "2/3", "--memory", "90MiB"]]
            .map(|args| {
                let path = dir.path("shard.brf");
                assert_eq!(build(&[&beads], args, &path).status, Some(0));
                fs::read(path).unwrap()
            });
    assert!(free == bound);
}

#[test]
fn shards_that_do_not_belong_together_are_refused() {
    let dir = Scratch::new();
    let (boxes, cavity) = (example("stl/overlap_boxes.stl"), example("stl/box_with_cavity.stl"));
    let three = shards(&dir, &[&boxes], &["--depth", "3"], 3);
    let other = dir.path("other.brf");
    let refused = |input: &str, args: &[&str], expected: &str| {
        assert_eq!(build(&[input], &[args, &["--shard", "2/3"]].concat(), &other).status, Some(0));
        let line =
            merge(&[three[0].clone(), other.clone(), three[2].clone()], &dir.path("joined.brf")).failed();
        assert!(
            line.contains(expected) && line.contains("other.brf") && line.contains("shard-1-of-3"),
            "{line}"
        );
    };
    refused(&cavity, &["--depth", "3"], "BLAKE3 hash of input 1");
    refused(&boxes, &["--depth", "4"], "depth is 4");
    refused(&boxes, &["--depth", "3", "--refine", "surface"], "criterion is surface");
    refused(&boxes, &["--depth", "3", "--gwn-error", "0.01"], "error of samples is 0.01");
    refused(&boxes, &["--depth", "3", "--units", "in"], "unit is in");
    let copy = dir.file("copy.stl", fs::read(&boxes).unwrap());
    refused(copy.to_str().unwrap(), &["--depth", "3"], "path of input 1");
    assert_eq!(build(&[&boxes], &["--depth", "3", "--shard", "2/4"], &other).status, Some(0));
    let line = merge(&[three[0].clone(), other.clone()], &dir.path("joined.brf")).failed();
    assert!(line.contains("number of shards is 4"), "{line}");
    assert!(!dir.names().iter().any(|name| name.starts_with("joined")), "{:?}", dir.names());
}

/// Settings of toolpaths leave no trace in the metadata but what they do.
#[test]
fn shards_of_other_beads_are_refused() {
    let dir = Scratch::new();
    let part = example("clover.gcode");
    let two = shards(&dir, &[&part], &["--depth", "3"], 2);
    // A little less wide: the box, the number of segments and all else are the same but for the sections.
    for args in [&["--filament", "1.74"][..], &["--skip", "External perimeter"]] {
        let other = dir.path("other.brf");
        let run = build(&[&part], &[args, &["--depth", "3", "--shard", "2/2"]].concat(), &other);
        assert_eq!(run.status, Some(0), "{}", run.stderr);
        let same = fs::read(&other).unwrap() == fs::read(&two[1]).unwrap();
        let joined = merge(&[two[0].clone(), other], &dir.path("joined.brf"));
        assert_eq!(joined.status, Some(i32::from(!same)), "{args:?}: {}", joined.stderr);
    }
}

#[test]
fn shards_that_are_missing_repeated_damaged_or_none_are_refused() {
    let dir = Scratch::new();
    let boxes = example("stl/overlap_boxes.stl");
    let all = shards(&dir, &[&boxes], &["--depth", "3"], 7);
    let joined = dir.path("joined.brf");
    let some = |numbers: &[usize]| numbers.iter().map(|n| all[n - 1].clone()).collect::<Vec<_>>();
    let line = merge(&some(&[4, 1, 6]), &joined).failed();
    assert!(line.contains("of 7 shards 2, 3, 5 and 7 are missing"), "{line}");
    let line = merge(&some(&[1, 2, 3, 4, 5, 6]), &joined).failed();
    assert!(line.contains("of 7 shards 7 is missing"), "{line}");
    let again = dir.file("again.brf", fs::read(&all[2]).unwrap());
    let line = merge(&[all.clone(), vec![again]].concat(), &joined).failed();
    assert!(line.contains("again.brf") && line.contains("shard-3-of-7.brf is the same shard"), "{line}");
    let whole = dir.store("overlap_boxes", 3);
    let line = merge(&[all.clone(), vec![whole.clone()]].concat(), &joined).failed();
    assert!(line.contains("overlap_boxes-3.brf") && line.contains("whole store, not a shard"), "{line}");
    let line = merge(&[all.clone(), vec![dir.path("none.brf")]].concat(), &joined).failed();
    assert!(line.contains("none.brf"), "{line}");
    // An output that is one of the shards.
    let line = merge(&all, &all[3]).failed();
    assert!(line.contains("would overwrite"), "{line}");
    let victim = all.iter().max_by_key(|path| fs::metadata(path).unwrap().len()).unwrap();
    let sound = fs::read(victim).unwrap();
    // A record, the header, the commit, the metadata, another record.
    for at in [12_288 + 5, 20, 8192 + 9, sound.len() - 3, 12_288 + 4000] {
        let mut bytes = sound.clone();
        bytes[at] ^= 0x10;
        fs::write(victim, bytes).unwrap();
        for line in [merge(&all, &joined).failed(), run(&[&"verify", victim]).failed()] {
            assert!(line.contains(victim.to_str().unwrap()), "{at}: {line}");
        }
    }
    fs::write(victim, sound).unwrap();
    assert!(!dir.names().iter().any(|name| name.starts_with("joined")), "{:?}", dir.names());
    merge(&all, &joined).ok();
    assert!(fs::read(joined).unwrap() == fs::read(whole).unwrap());
}

#[test]
fn other_commands_say_what_a_shard_is() {
    let dir = Scratch::new();
    let shard = shards(&dir, &[&example("stl/clover_model.stl")], &["--depth", "3"], 3).remove(1);
    let points = dir.file("p.csv", "1,2,3\n");
    for run in [
        run(&[&"mesh", &shard, &"-o", &dir.path("x.stl")]),
        run(&[&"sample", &shard, &"--points", &points]),
        run(&[&"export", &shard, &"--level", &"1", &"-o", &dir.path("x.npy")]),
        run(&[&"info", &shard, &"--volume"]),
    ] {
        let line = run.failed();
        assert!(line.contains("shard 2 of 3") && line.contains("cache merge"), "{line}");
    }
    assert!(run(&[&"info", &shard]).ok().contains("shard    2 of 3"));
    assert!(run(&[&"verify", &shard]).ok().contains("sound, shard 2 of 3"));
    assert_eq!(
        run(&[&"verify", &shard, &"--json"]).json()["shard"],
        serde_json::json!({ "number": 2, "of": 3 })
    );
    assert!(!dir.names().iter().any(|name| name.starts_with('x')));
}

#[test]
fn shards_have_like_work_and_all_cubes_once() {
    let dir = Scratch::new();
    let (beads, path) = (example("stl/clover_beads.stl"), dir.path("shard.brf"));
    let (mut next, mut leaves, mut work) = (0, 0, 0.0);
    for number in 1..=4 {
        let id = format!("{number}/4");
        let built =
            run(&[&"build", &beads, &"-o", &path, &"--depth", &"4", &"--shard", &id, &"--json"]).json();
        let shard = &built["shard"];
        assert_eq!((&shard["number"], &shard["of"], &shard["level"]), (&number.into(), &4.into(), &3.into()));
        let its = shard["work"].as_f64().unwrap();
        assert!((0.2..0.3).contains(&its), "{shard}");
        work += its;
        leaves += built["leaves"].as_u64().unwrap();
        let info = run(&[&"info", &path, &"--json"]).json();
        let cubes = &info["shard"]["cubes"];
        assert_eq!(cubes[0], next);
        next = cubes[1].as_u64().unwrap();
        assert_eq!(next - cubes[0].as_u64().unwrap(), shard["cubes"]);
        if part_or_all(number == 3, true) {
            let text = run(&[&"build", &beads, &"-o", &path, &"--depth", &"4", &"--shard", &id]).ok();
            assert!(text.contains(&format!("shard    {number} of 4: ")), "{text}");
        }
    }
    assert_eq!(next, 512);
    assert!((work - 1.0).abs() < 1e-9);
    let whole = run(&[&"info", &dir.store("clover_beads", 4), &"--json"]).json();
    assert!(whole["shard"].is_null());
    // Uniform leaves above the cubes are not in any shard.
    assert!(leaves > 0 && leaves <= whole["store"]["total"]["leaves"].as_u64().unwrap());
}

#[test]
fn an_empty_shard_is_a_shard() {
    let dir = Scratch::new();
    let shard = dir.path("shard.brf");
    let boxes = example("stl/overlap_boxes.stl");
    let built =
        run(&[&"build", &boxes, &"-o", &shard, &"--depth", &"0", &"--shard", &"9/9", &"--json"]).json();
    assert_eq!((&built["nodes"], &built["shard"]["cubes"]), (&0.into(), &0.into()));
    assert!(built["winding_min"].is_null());
    assert!(run(&[&"info", &shard]).ok().contains("shard    9 of 9"));
    assert!(run(&[&"verify", &shard]).ok().contains("0 records"));
}

#[test]
fn what_makes_no_sense_is_wrong_usage() {
    let dir = Scratch::new();
    let (boxes, out) = (example("stl/overlap_boxes.stl"), dir.path("x.brf"));
    for shard in ["0/3", "4/3", "1", "1/0", "a/b", "1/2/3", "-1/2", "1/70000"] {
        let told = run(&[&"build", &boxes, &"-o", &out, &format!("--shard={shard}")]).misused();
        assert!(told.contains("--shard"), "{told}");
    }
    run(&[&"build", &boxes, &"-o", &out, &"--shard", &"1/2", &"--mesh", &dir.path("x.stl")]).misused();
    run(&[&"cache"]).misused();
    run(&[&"cache", &"merge", &"-o", &out]).misused();
    assert!(dir.names().is_empty());
}

#[test]
fn joining_tells_what_it_made() {
    let dir = Scratch::new();
    let two = shards(&dir, &[&example("stl/overlap_boxes.stl")], &["--depth", "2"], 2);
    let joined = dir.path("joined.brf");
    let json = run(&[&"cache", &"merge", &two[1], &two[0], &"-o", &joined, &"--json"]).json();
    let info = run(&[&"info", &joined, &"--json"]).json();
    assert_eq!((&json["shards"], &json["nodes"]), (&2.into(), &info["store"]["total"]["nodes"]));
    assert_eq!(json["file_bytes"], fs::metadata(&joined).unwrap().len());
    let text = run(&[&"cache", &"merge", &two[0], &two[1], &"-o", &joined]).ok();
    assert!(text.contains("joined from 2 shards"), "{text}");
}
