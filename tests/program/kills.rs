//! Builds that are killed, run out of disk, or are read while they run.

use crate::support::*;
use brickfield_core::sweep::part_or_all;
use serde_json::Value;
use std::ffi::OsStr;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::time::{Duration, Instant};

/// Kinds of builds: input, and settings.
fn kinds() -> Vec<(PathBuf, Vec<&'static str>)> {
    let gcode = Path::new(env!("CARGO_MANIFEST_DIR")).join("../bench-data/clover.gcode");
    vec![
        (stl("clover_beads"), vec!["--depth", "3"]),
        (stl("featuretype50_model"), vec!["--depth", "3", "--refine", "surface"]),
        (stl("spot40_model"), vec!["--depth", "3", "--tolerance", "0.05mm"]),
        (stl("open_box_no_lid"), vec!["--depth", "2"]),
        (gcode.clone(), vec!["--depth", "2", "--identity"]),
        (gcode, vec!["--depth", "2", "--shard", "2/3"]),
        // In so little memory jobs are opened.
        (stl("clover_beads"), vec!["--depth", "4", "--memory", "76MiB", "--threads", "1"]),
    ]
}

fn build(input: &Path, settings: &[&str], output: &Path) -> Command {
    let mut command = program();
    command.arg("build").arg(input).arg("-o").arg(output).args(settings).args([
        "--quiet",
        "--commit-every",
        "0.005",
    ]);
    command.stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::piped());
    command
}

fn complete(input: &Path, settings: &[&str], output: &Path) {
    let ran = Run::from(build(input, settings, output).output().unwrap());
    ran.ok_but_for("% empty");
}

/// Nodes that were committed to the unfinished store, all of them sound; `None` if none were.
fn nodes_of(part: &Path) -> Option<u64> {
    let ran = run(&[&"info", &part, &"--json"]);
    if ran.status != Some(0) {
        // A run that is killed early has made the file, or written to it, and no more.
        let early = ["neither holds a commit", "not a brick store", "is empty"];
        assert!(early.iter().any(|words| ran.stderr.contains(words)), "{}", ran.stderr);
        return None;
    }
    let json: Value = serde_json::from_str(&ran.stdout).unwrap();
    assert!(run(&[&"verify", &part]).ok().contains("sound"));
    if !part.with_extension("journal").exists() {
        // Complete, and killed just before it got its name, and before the first commit was due.
        return None;
    }
    json["store"]["total"]["nodes"].as_u64()
}

/// What killing has come to.
#[derive(Debug, Default)]
struct Kills {
    kills: u64,
    /// Those that found something committed, and the next run went on from there.
    resumed: u64,
    stores: u64,
}

/// Kills builds until as many kills as asked for have hit one, at times spread over what one takes, and goes on with
/// each until it is finished.
fn kill(kills: u64, seed: u64) -> Kills {
    let dir = Scratch::new();
    let mut rng = seed;
    let mut random = move || {
        rng = rng.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (rng >> 33) as f64 / f64::from(1u32 << 31)
    };
    let mut done = Kills::default();
    let kinds = kinds();
    let whole: Vec<(Vec<u8>, Duration)> = kinds
        .iter()
        .map(|(input, settings)| {
            let path = dir.path("whole.brf");
            let begun = Instant::now();
            complete(input, settings, &path);
            (std::fs::read(&path).unwrap(), begun.elapsed())
        })
        .collect();
    std::fs::remove_file(dir.path("whole.brf")).unwrap();
    while done.kills < kills {
        let which = done.stores as usize % kinds.len();
        let ((input, settings), (bytes, takes)) = (&kinds[which], &whole[which]);
        let (output, part) = (dir.path("k.brf"), dir.path("k.brf.part"));
        let mut nodes = 0;
        // A few kills a store, then to its end.
        for _ in 0..4 {
            let mut child = build(input, settings, &output).spawn().unwrap();
            std::thread::sleep(takes.mul_f64(random()));
            child.kill().unwrap();
            let ended = child.wait().unwrap();
            if ended.success() {
                break;
            }
            assert_eq!(ended.code(), None, "it failed by itself");
            done.kills += 1;
            if output.exists() {
                // Between the rename and the removal of the journal.
                assert!(std::fs::read(&output).unwrap() == *bytes);
                break;
            }
            let left = if part.exists() { nodes_of(&part).unwrap_or(0) } else { 0 };
            assert!(left >= nodes, "{left} nodes are left of {nodes}");
            done.resumed += u64::from(left > 0);
            nodes = left;
        }
        complete(input, settings, &output);
        assert!(std::fs::read(&output).unwrap() == *bytes, "{settings:?}: other bytes");
        assert_eq!(dir.names(), ["k.brf"]);
        std::fs::remove_file(&output).unwrap();
        done.stores += 1;
        println!("{done:?}");
    }
    done
}

#[test]
fn killed_builds_go_on_to_the_same_bytes() {
    let done = kill(8, 5);
    assert!(done.kills >= 8 && done.stores > 0, "{done:?}");
}

/// `TMPDIR=/dev/shm cargo test -p brickfield --test program a_thousand_kills -- --ignored --nocapture`
#[test]
#[ignore = "minutes"]
fn a_thousand_kills() {
    let done = kill(1000, 1);
    println!("{done:?}");
    assert!(done.kills >= 1000 && done.resumed > 300);
}

#[test]
fn a_build_is_resumed_only_by_its_like() {
    let dir = Scratch::new();
    let output = dir.path("o.brf");
    let settings = ["--depth", "6", "--threads", "1"];
    interrupted(&stl("clover_beads"), &settings, &output);
    assert_eq!(dir.names(), ["o.brf.journal", "o.brf.part"]);
    for (other, named) in [
        (vec!["--depth", "3"], "its depth is 6, that of this build is 3"),
        (vec!["--depth", "6", "--stddev", "0.1"], "its standard deviation is 0, that of this build is 0.1"),
        (vec!["--depth", "6", "--tolerance", "0.1mm"], "its tolerance is none, that of this build is 0.1"),
        (vec!["--depth", "6", "--shard", "1/2"], "its number of shards is 1, that of this build is 2"),
        (
            vec!["--depth", "6", "--gwn-error", "0.01"],
            "its error of samples is 0.001, that of this build is 0.01",
        ),
        (
            vec!["--depth", "6", "--compression", "range"],
            "its compression is lz4, that of this build is range",
        ),
        (vec!["--depth", "6", "--sides", "8"], "number of sides"),
    ] {
        let line = Run::from(build(&stl("clover_beads"), &other, &output).output().unwrap()).failed();
        assert!(line.contains("o.brf.part: unfinished store") && line.contains(named), "{line}");
        assert!(line.contains("--restart"), "{line}");
    }
    let shard = ["--depth", "6", "--shard", "1/2", "--compression", "range"];
    Run::from(build(&stl("clover_beads"), &shard, &output).output().unwrap()).misused();
    let line = Run::from(build(&stl("clover_model"), &settings, &output).output().unwrap()).failed();
    assert!(line.contains("its input 1 was") && line.contains("clover_model.stl"), "{line}");
    assert!(line.matches(" bytes").count() == 2 && !line.contains("BLAKE3"), "{line}");
    assert_eq!(dir.names(), ["o.brf.journal", "o.brf.part"]);
    // Readers say what it is.
    let part = dir.path("o.brf.part");
    let json = run(&[&"info", &part, &"--json"]).json();
    assert_eq!(json["unfinished"], true);
    assert!(run(&[&"info", &part]).ok().contains("unfinished"));
    assert!(run(&[&"verify", &part]).ok().contains("unfinished"));
    for line in [
        run(&[&"mesh", &part, &"-o", &dir.path("x.stl")]),
        run(&[&"export", &part, &"--level", &"0", &"-o", &dir.path("x.npy")]),
        run(&[&"sample", &part, &"--beads", &"--points", &dir.path("x.csv")]),
        run(&[&"cache", &"merge", &part, &"-o", &dir.path("y.brf")]),
    ] {
        let line = line.failed();
        assert!(line.contains("unfinished store"), "{line}");
    }
    sample_part(&dir, &part);
    // And who wants to begin anew says so.
    complete(&stl("overlap_boxes"), &["--depth", "1", "--restart"], &output);
    assert_eq!(dir.names(), ["o.brf"]);
}

/// Asks for samples in a small part of a tree, far and wide: each is there, or said to be missing.
fn sample_part(dir: &Scratch, part: &Path) {
    let json = run(&[&"info", &part, &"--json"]).json();
    let bound = |which: usize, a: usize| json["bounds"][which][a].as_f64().expect("a bound");
    let point = |t: f64| [0, 1, 2].map(|a| bound(0, a) + t * (bound(1, a) - bound(0, a)));
    let mut missing = 0;
    for t in [0.0, 0.25, 0.5, 0.75, 1.0] {
        let [x, y, z] = point(t);
        let ran = run_with(&[&"sample", &part, &"--points", &"-"], &format!("{x},{y},{z}\n1e9,0,0\n"));
        match ran.status {
            Some(0) => assert!(ran.ok().ends_with("1000000000.0,0.0,0.0,0\n")),
            _ => {
                let line = ran.stderr;
                assert!(line.contains("o.brf.part") && line.contains("no leaf yet at the point"), "{line}");
                missing += 1;
            }
        }
    }
    assert!(missing > 0, "it is finished");
    let outside = dir.file("outside.csv", "1e9,0,0\n");
    assert!(run(&[&"sample", &part, &"--points", &outside]).ok().ends_with("1000000000.0,0.0,0.0,0\n"));
    std::fs::remove_file(outside).unwrap();
}

/// Interrupts a build that has committed something.
fn interrupted(input: &Path, settings: &[&str], output: &Path) {
    let child = build(input, settings, output).spawn().unwrap();
    let mut journal = output.as_os_str().to_owned();
    journal.push(".journal");
    let started = Instant::now();
    while !Path::new(&journal).exists() {
        assert!(started.elapsed() < Duration::from_secs(60));
        std::thread::sleep(Duration::from_millis(2));
    }
    let line = stop(child, "-TERM").ended_by(15);
    assert!(line.contains("goes on from there"), "{line}");
}

fn stop(child: Child, signal: &str) -> Run {
    assert!(Command::new("kill").args([signal, &child.id().to_string()]).status().unwrap().success());
    child.wait_with_output().unwrap().into()
}

#[test]
fn other_threads_and_memory_go_on_too() {
    let dir = Scratch::new();
    let (input, whole, output) = (stl("clover_beads"), dir.path("whole.brf"), dir.path("o.brf"));
    complete(&input, &["--depth", "5"], &whole);
    interrupted(&input, &["--depth", "5", "--threads", "2"], &output);
    complete(&input, &["--depth", "5", "--threads", "1", "--memory", "76MiB"], &output);
    assert!(std::fs::read(&whole).unwrap() == std::fs::read(&output).unwrap());
}

/// Runs the program where no file may grow beyond some KiB, which is as a disk that fills up.
fn limited(kib: u64, args: &[&dyn AsRef<OsStr>]) -> Run {
    let mut command = Command::new("bash");
    command.args(["-c", "ulimit -f \"$0\"; exec \"$@\"", &kib.to_string(), env!("CARGO_BIN_EXE_brickfield")]);
    command.args(args.iter().map(AsRef::as_ref)).stdin(Stdio::null()).output().unwrap().into()
}

#[test]
fn a_full_disk_is_an_error_and_what_was_committed_stays() {
    let (dir, depth) = (Scratch::new(), part_or_all("3", "4"));
    let (input, whole, output) = (stl("clover_beads"), dir.path("whole.brf"), dir.path("o.brf"));
    complete(&input, &["--depth", depth], &whole);
    let kib = std::fs::metadata(&whole).unwrap().len() / 1024;
    let mut nodes = 0;
    let args: [&dyn AsRef<OsStr>; 8] =
        [&"build", &input, &"-o", &output, &"--depth", &depth, &"--commit-every", &"0"];
    let limits = [1, 13, kib / 8, kib / 4, kib / 2, kib - kib / 8, kib - 1];
    for limit in limits.into_iter().step_by(part_or_all(2, 1)) {
        let line = limited(limit, &args).failed();
        assert!(line.contains("o.brf") && line.contains("File too large"), "{limit} KiB: {line}");
        assert!(!output.exists());
        let left =
            if dir.path("o.brf.part").exists() { nodes_of(&dir.path("o.brf.part")).unwrap_or(0) } else { 0 };
        assert!(left >= nodes, "{limit} KiB: {left} nodes are left of {nodes}");
        nodes = left;
    }
    assert!(nodes > 0);
    complete(&input, &["--depth", depth], &output);
    assert!(std::fs::read(&whole).unwrap() == std::fs::read(&output).unwrap());
    assert_eq!(dir.names(), ["o.brf", "whole.brf"]);
    // Meshes, arrays and beads leave nothing.
    let gcode = Path::new(env!("CARGO_MANIFEST_DIR")).join("../bench-data/clover.gcode");
    for name in ["x.stl", "x.ply", "x.obj"] {
        full(&dir, name, &[&"mesh", &whole, &"--level", &"2", &"-o", &dir.path(name)]);
    }
    full(&dir, "x.npy", &[&"export", &whole, &"--level", &"2", &"-o", &dir.path("x.npy")]);
    full(&dir, "b.stl", &[&"beads", &gcode, &"-o", &dir.path("b.stl")]);
    full(&dir, "b.x3d", &[&"beads", &gcode, &"-o", &dir.path("b.x3d")]);
}

#[test]
fn a_full_disk_ends_analyses_and_leaves_nothing() {
    let dir = Scratch::new();
    let (store, other) = (dir.store("clover_beads", 1), stl(part_or_all("clover_model", "clover_beads")));
    let moves = dir.file("moves.nc", "G21 G90\nG0 X60 Y100 Z24\nG1 X140 F500\nM30\n");
    let commands: [(&str, &[&dyn AsRef<OsStr>]); 10] = [
        ("walls.ply", &[&"thickness", &store]),
        ("apart.ply", &[&"deviation", &store, &other, &"--align", &"shift"]),
        ("grown.brf", &[&"offset", &store, &"--by", &"0.5mm"]),
        ("cut.brf", &[&"csg", &store, &"--minus", &"sphere 100,100,12,r20"]),
        ("milled.brf", &[&"machine", &store, &moves, &"--tool", &"ball:6mm"]),
        ("coarse.ply", &[&"mesh", &store, &"--detail", &"5mm"]),
        ("v.vdb", &[&"export", &store]),
        ("v.vtkhdf", &[&"export", &store]),
        ("s.bsp", &[&"splats", &store]),
        ("picture.png", &[&"render", &store, &"--size", &"600x600"]),
    ];
    for (name, args) in commands {
        let path = dir.path(name);
        let args: Vec<&dyn AsRef<OsStr>> = args.iter().copied().chain([&"-o" as _, &path as _]).collect();
        full(&dir, name, &args);
    }
}

#[test]
fn results_that_do_not_fit_are_an_error() {
    let dir = Scratch::new();
    let store = dir.store("overlap_boxes", 1);
    let points = dir.file("p.csv", "1,2,3\n".repeat(20_000));
    let script = "ulimit -f 20; exec \"$@\" > \"$0\"";
    let mut command = Command::new("bash");
    command.args(["-c", script]).arg(dir.path("w.csv")).arg(env!("CARGO_BIN_EXE_brickfield"));
    command.arg("sample").arg(store).arg("--points").arg(points).stdin(Stdio::null());
    let line = Run::from(command.output().unwrap()).failed();
    assert!(line.contains("cannot write to standard output") && line.contains("File too large"), "{line}");
}

/// Runs a command as its disk fills up, at several sizes.
fn full(dir: &Scratch, name: &str, args: &[&dyn AsRef<OsStr>]) {
    let before = dir.names();
    assert_eq!(run(args).status, Some(0), "{name}");
    let kib = std::fs::metadata(dir.path(name)).unwrap().len() / 1024;
    dir.names().iter().filter(|name| !before.contains(name)).for_each(|name| {
        std::fs::remove_file(dir.path(name)).unwrap();
    });
    let limits = [0, kib * 2 / 3, kib / 3, kib.saturating_sub(1)];
    for limit in limits.into_iter().take(part_or_all(2, 4)) {
        let line = limited(limit, args).failed();
        // The file, or its folder where a file without a name has grown too large.
        let path = dir.path(name);
        let folder = format!("{}: cannot write a temporary file in", path.parent().unwrap().display());
        let said = line.contains(&*path.to_string_lossy()) || line.contains(&folder);
        assert!(said && line.contains("File too large"), "{name}: {line}");
        assert_eq!(dir.names(), before, "{name} at {limit} of {kib} KiB");
    }
}

/// Builds one store again and again while others read it, and the unfinished one.
fn read_while_building(readers: usize, time: Duration) -> (u64, u64, u64) {
    let dir = Scratch::new();
    let (output, part) = (dir.path("o.brf"), dir.path("o.brf.part"));
    let settings = ["--depth", "4", "--threads", "1"];
    complete(&stl("clover_beads"), &settings, &output);
    let bytes = std::fs::read(&output).unwrap();
    let (end, whole, unfinished) = (AtomicBool::new(false), AtomicU64::new(0), AtomicU64::new(0));
    let mut builds = 0;
    std::thread::scope(|scope| {
        for number in 0..readers {
            let (end, whole, unfinished, output, part) = (&end, &whole, &unfinished, &output, &part);
            scope.spawn(move || {
                while !end.load(Ordering::Relaxed) {
                    let io = if number % 2 == 0 { "pread" } else { "mmap" };
                    // The name always stands for a whole store.
                    assert!(
                        run(&[&"verify", output, &"--threads", &"1", &"--io", &io]).ok().contains("sound, ")
                    );
                    whole.fetch_add(1, Ordering::Relaxed);
                    let ran = run(&[&"verify", part, &"--threads", &"1", &"--io", &io]);
                    match ran.status {
                        Some(0) => drop(unfinished.fetch_add(1, Ordering::Relaxed)),
                        // It has its name now, or has just been begun.
                        _ => assert!(
                            ["No such file", "neither holds a commit", "not a brick store"]
                                .iter()
                                .any(|reason| ran.stderr.contains(reason)),
                            "{}",
                            ran.stderr
                        ),
                    }
                }
            });
        }
        let begun = Instant::now();
        while begun.elapsed() < time {
            complete(&stl("clover_beads"), &settings, &output);
            assert!(std::fs::read(&output).unwrap() == bytes);
            builds += 1;
        }
        end.store(true, Ordering::Relaxed);
    });
    (builds, whole.into_inner(), unfinished.into_inner())
}

#[test]
fn readers_see_whole_states() {
    let (builds, whole, _) = read_while_building(4, Duration::from_secs(part_or_all(1, 2)));
    assert!(builds > 0 && whole > 0);
}

/// `cargo test -p brickfield --test program eight_readers -- --ignored --nocapture`
#[test]
#[ignore = "five minutes"]
fn eight_readers_for_five_minutes() {
    let (builds, whole, unfinished) = read_while_building(8, Duration::from_secs(300));
    println!("{builds} builds; {whole} readings of whole stores, {unfinished} of unfinished ones");
    assert!(builds > 10 && whole > 100 && unfinished > 10);
}

/// In a user namespace with a file system of its own that fills up:
/// `cargo test -p brickfield --test program a_disk_that_fills -- --ignored --nocapture`
#[test]
#[ignore = "needs user namespaces"]
fn a_disk_that_fills_up() {
    let dir = Scratch::new();
    let (whole, mount) = (dir.path("whole.brf"), dir.path("mount"));
    complete(&stl("clover_beads"), &["--depth", "4"], &whole);
    std::fs::create_dir(&mount).unwrap();
    // At each size the build fails, what it has committed is sound, and with room it ends in the same bytes.
    let script = r#"set -e
        program=$1; input=$2; whole=$3; mount=$4
        size=$(stat -c %s "$whole"); failures=0
        mount -t tmpfs -o size=64k tmpfs "$mount"
        for eighth in 0 1 2 3 4 5 6 7; do
            mount -o remount,size=$((65536 + size * eighth / 8)) "$mount"
            if "$program" build "$input" -o "$mount/o.brf" --depth 4 --quiet --commit-every 0 2> "$mount.error"; then exit 3; fi
            grep -q "No space left" "$mount.error"
            failures=$((failures + 1))
            if [ -s "$mount/o.brf.journal" ]; then "$program" verify "$mount/o.brf.part" --quiet; fi
            "$program" mesh "$whole" --level 2 -o "$mount/x.stl" 2> "$mount.error" && exit 4
            grep -q "No space left" "$mount.error"
            test ! -e "$mount/x.stl" -a ! -e "$mount/x.stl.part"
        done
        mount -o remount,size=$((size * 4)) "$mount"
        "$program" build "$input" -o "$mount/o.brf" --depth 4 --quiet
        cmp "$mount/o.brf" "$whole"
        echo "$failures failures"
    "#;
    let mut command = Command::new("unshare");
    command.args(["-Urm", "bash", "-c", script, "-", env!("CARGO_BIN_EXE_brickfield")]);
    let ran = Run::from(command.arg(stl("clover_beads")).arg(&whole).arg(&mount).output().unwrap());
    println!("{}{}", ran.stdout, ran.stderr);
    assert_eq!((ran.status, ran.stdout.trim()), (Some(0), "8 failures"));
}
