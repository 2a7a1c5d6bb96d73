//! `brickfield-bench`: results, their comparison, their reports. No time is asserted.

// Most of it is for the tests of the program.
#[allow(dead_code, unused_imports)]
mod support;

use serde_json::{Value, json};
use std::ffi::OsStr;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use support::{Run, Scratch};

/// The harness, to be given arguments. It measures the program beside it, which `cargo test --workspace` has built.
fn harness() -> Command {
    Command::new(env!("CARGO_BIN_EXE_brickfield-bench"))
}

/// Runs the harness.
fn bench(args: &[&dyn AsRef<OsStr>]) -> Run {
    harness().args(args.iter().map(AsRef::as_ref)).stdin(Stdio::null()).output().expect("it runs").into()
}

/// Measures a small suite once, and gives the file.
fn measured(dir: &Scratch, suite: &str, rounds: &str, name: &str) -> PathBuf {
    let (cache, output) = (dir.path("cache"), dir.path(name));
    let args = [suite, "--quick", "--quiet", "--rounds", rounds];
    let told = harness().args(args).arg("--cache").arg(&cache).arg("-o").arg(&output).output();
    let told: Run = told.expect("it runs").into();
    // That the machine is busy is told as a warning.
    assert_eq!((told.status, told.stdout.as_str()), (Some(0), ""), "{}", told.stderr);
    assert!(told.stderr.lines().all(|line| line.contains("was not idle")), "{}", told.stderr);
    output
}

fn read(path: &Path) -> Value {
    serde_json::from_str(&fs::read_to_string(path).expect("it is there")).expect("it is JSON")
}

/// The file with something else in it.
fn doctored(dir: &Scratch, result: &Path, name: &str, change: impl FnOnce(&mut Value)) -> PathBuf {
    let mut value = read(result);
    change(&mut value);
    dir.file(name, value.to_string())
}

#[test]
fn a_suite_is_measured_compared_and_reported() {
    let dir = Scratch::new();
    let result = measured(&dir, "store", "3", "a.json");
    let value = read(&result);
    assert_eq!((&value["format"], &value["settings"]["suites"]), (&json!(1), &json!(["store"])));
    assert_eq!(value["inputs"][0]["triangles"], json!(50_000));
    let figures = value["figures"].as_array().expect("figures");
    assert!(figures.len() >= 8);
    for figure in figures {
        let rounds = figure["rounds"].as_array().expect("rounds");
        assert_eq!(rounds.len(), 3, "{figure}");
        let positive = |round: &Value, name: &str| round[name].as_f64().is_some_and(|value| value > 0.0);
        assert!(rounds.iter().all(|r| positive(r, "seconds") && positive(r, "floor_seconds")), "{figure}");
    }
    let verified = figures.iter().find(|figure| figure["job"] == "verify, lz4").expect("it is there");
    let built =
        figures.iter().find(|figure| figure["job"] == "build --depth 2 --compression lz4").expect("too");
    assert_eq!(verified["facts"]["records"], built["facts"]["nodes"]);
    // A build moves its input and its store at least, and to verify reads the store.
    let store_bytes = built["facts"]["file_bytes"].as_u64().expect("its size");
    assert_eq!(built["least_bytes"], json!(2_500_084 + store_bytes));
    assert_eq!(verified["least_bytes"], json!(store_bytes));
    let limits = value["limits"].as_array().expect("limits");
    assert_eq!(limits.len(), 3);
    assert!(limits.iter().all(|of| of["bytes_per_second"].as_f64() > Some(0.0)), "{limits:?}");
    // Of what was written while measuring nothing is left.
    let mut kept: Vec<_> = fs::read_dir(dir.path("cache")).unwrap().map(|e| e.unwrap().file_name()).collect();
    kept.sort();
    assert_eq!(kept, ["pile-50k.stl"]);

    let same = bench(&[&"compare", &result, &result]).ok();
    assert!(same.contains("within the noise") && !same.contains("SLOWER"), "{same}");
    let slower = doctored(&dir, &result, "slow.json", |value| {
        for round in value["figures"][0]["rounds"].as_array_mut().unwrap() {
            round["seconds"] = json!(1e3 * round["seconds"].as_f64().unwrap());
        }
    });
    let told = bench(&[&"compare", &result, &slower, &"--json"]);
    assert_eq!((told.status, told.stderr.lines().count()), (Some(1), 1), "{}", told.stderr);
    assert!(told.stderr.contains("1 slower"), "{}", told.stderr);
    let told: Value = serde_json::from_str(&told.stdout).unwrap();
    let verdicts: Vec<&Value> = told["figures"].as_array().unwrap().iter().map(|f| &f["verdict"]).collect();
    assert_eq!(verdicts.iter().filter(|verdict| **verdict != "same").count(), 1, "{verdicts:?}");
    assert_eq!(verdicts[0], "slower");
    let other =
        doctored(&dir, &result, "other.json", |value| value["figures"][0]["facts"]["leaves"] = json!(1));
    assert!(bench(&[&"compare", &result, &other]).stdout.contains("OTHER RESULT"));
    let other = doctored(&dir, &result, "input.json", |value| value["inputs"][0]["fnv1a"] = json!("0"));
    assert!(bench(&[&"compare", &result, &other]).stdout.contains("OTHER INPUT"));

    let page = dir.path("r.html");
    bench(&[&"report", &result, &result, &"-o", &page]).ok();
    let page = fs::read_to_string(page).unwrap();
    assert!(page.starts_with("<!doctype html>") && page.contains("verify, range"), "{page}");
    assert!(page.contains("GB/s from memory") && page.contains(" memory</td>"), "{page}");
    assert!(!page.contains("http://") || page.matches("http://").all(|_| page.contains("http://www.w3.org")));
}

/// Table 2: what a mesh is off from the true union does not depend on the round.
#[test]
fn unions_are_told_with_how_true_they_are() {
    let dir = Scratch::new();
    let value = read(&measured(&dir, "unions", "2", "a.json"));
    let figures = value["figures"].as_array().expect("figures");
    assert_eq!(figures.len(), 2);
    for figure in figures {
        let fact = |name: &str| figure["facts"][name].as_f64().expect("a number");
        assert!(fact("width_cells") > 5.0 && fact("triangles") > 10_000.0, "{figure}");
        assert!(fact("mesh_p999_widths") < 0.05 && fact("mesh_max_widths") < 0.1, "{figure}");
        assert!(fact("boundary_clear_p999_widths") <= fact("boundary_p999_widths"), "{figure}");
    }
}

#[test]
fn a_report_has_plots() {
    let dir = Scratch::new();
    let result = measured(&dir, "scale", "1", "a.json");
    let page = dir.path("r.html");
    bench(&[&"report", &result, &"-o", &page]).ok();
    let html = fs::read_to_string(page).unwrap();
    assert!(html.matches("<svg").count() >= 3, "{}", html.len());
    bench(&[&"report", &result, &"-o", &dir.path("r.md")]).ok();
    let text = fs::read_to_string(dir.path("r.md")).unwrap();
    for name in ["r-triangles.svg", "r-depth.svg", "r-memory.svg"] {
        assert!(text.contains(&format!("({name})")), "{name}: {text}");
        assert!(fs::read_to_string(dir.path(name)).unwrap().starts_with("<svg"), "{name}");
    }
    // With one round each nothing is known of the noise, and little is beyond it.
    let half = doctored(&dir, &result, "b.json", |value| {
        let seconds = &mut value["figures"][0]["rounds"][0]["seconds"];
        *seconds = json!(1.2 * seconds.as_f64().unwrap());
    });
    bench(&[&"compare", &result, &half]).ok();
}

#[test]
fn peers_that_fail_say_so_in_their_rows() {
    let dir = Scratch::new();
    let (cache, output) = (dir.path("cache"), dir.path("a.json"));
    let args = ["points", "mesh", "unions", "--quick", "--rounds", "1", "--peers=false"];
    let told = harness().args(args).arg("--cache").arg(&cache).arg("-o").arg(&output).output();
    let told: Run = told.expect("it runs").into();
    assert_eq!(told.status, Some(0), "{}", told.stderr);
    assert!(told.stdout.contains("failed: "), "{}", told.stdout);
    let value = read(&output);
    let figures = value["figures"].as_array().expect("figures").iter().filter(|f| f["suite"] == "peers");
    let (ours, theirs): (Vec<&Value>, Vec<&Value>) =
        figures.partition(|figure| figure["job"].as_str().is_some_and(|job| job.starts_with("this program")));
    assert!(ours.len() == 45 && theirs.len() == 46, "{} {}", ours.len(), theirs.len());
    assert!(theirs.iter().all(|f| f["failed"].is_string() && f["rounds"] == json!([])), "{theirs:?}");
    // Closed soups are exact, and open ones within what was asked for.
    for figure in ours.iter().filter(|figure| figure["facts"].get("judged").is_some()) {
        let open = figure["input"].as_str().is_some_and(|name| name.starts_with("cracked"));
        let worst = figure["facts"]["worst_error"].as_f64().expect("an error");
        assert!(worst < if open { 0.1 } else { 1e-9 }, "{figure}");
        assert_eq!(figure["facts"]["wrong_side"], 0, "{figure}");
        let bins = figure["facts"]["error_histogram"].as_array().expect("bins");
        let counted: u64 = bins.iter().filter_map(|bin| bin["samples"].as_u64()).sum();
        assert_eq!(json!(counted), figure["facts"]["judged"], "{figure}");
    }
    // A mesh is the same in memory and in a file, and no triangles of it meet unless that was allowed.
    let contours = ours.iter().filter(|figure| figure["at"].get("cells").is_some());
    let triangles: Vec<&Value> = contours.clone().map(|figure| &figure["facts"]["triangles"]).collect();
    assert!(triangles.chunks(2).all(|pair| pair[0] == pair[1] && pair[0].is_u64()), "{triangles:?}");
    let (allowed, searched): (Vec<&Value>, Vec<&Value>) = contours
        .filter(|figure| figure["facts"].get("pairs").is_some())
        .partition(|figure| figure["job"].as_str().is_some_and(|job| job.contains("--intersection-free no")));
    assert!(searched.len() == 12 && allowed.len() == 8, "{} {}", searched.len(), allowed.len());
    assert!(searched.iter().all(|figure| figure["facts"]["pairs"] == json!(0)), "{searched:?}");
    assert!(allowed.iter().any(|figure| figure["facts"]["pairs"] != json!(0)), "{allowed:?}");
    bench(&[&"compare", &output, &output]).ok();
    bench(&[&"report", &output, &"-o", &dir.path("r.md")]).ok();
    let text = fs::read_to_string(dir.path("r.md")).unwrap();
    assert!(text.contains("failed: ") && text.contains("(r-errors-cracked-50k.svg)"), "{text}");
    assert!(text.contains("| million triangles/s | pairs |"), "{text}");
    let picture = fs::read_to_string(dir.path("r-errors-cracked-50k.svg")).unwrap();
    assert!(picture.contains("this program, build and export"), "{picture}");
}

#[test]
fn peers_are_not_asked_for_what_they_cannot_do() {
    let dir = Scratch::new();
    let args: [&dyn AsRef<OsStr>; 5] =
        [&"scale", &"--quick", &"--peers=false", &"--cache", &dir.path("cache")];
    let line = bench(&args).misused();
    assert!(line.contains("--peers") && line.contains("mesh"), "{line}");
}

#[test]
fn instructions_need_valgrind_and_a_sound_baseline() {
    let dir = Scratch::new();
    let cache = dir.path("cache");
    let told = harness().args(["instructions"]).arg("--cache").arg(&cache).env("PATH", "").output();
    let line = Run::from(told.expect("it runs")).failed();
    assert!(line.contains("cannot run valgrind") && line.contains("install it"), "{line}");
    let text = dir.file("text.json", "solid");
    let new = dir.file(
        "new.json",
        r#"{"format": 2, "program": "p", "rustc": "r", "valgrind": "v", "vectors": "w", "counts": []}"#,
    );
    for (bad, why) in [(&dir.path("none.json"), "cannot be read"), (&text, "no counts"), (&new, "version 2")]
    {
        let line = bench(&[&"instructions", &"--baseline", bad, &"--cache", &cache]).failed();
        assert!(line.contains(why) && line.contains(bad.file_name().unwrap().to_str().unwrap()), "{line}");
    }
    assert!(!cache.exists());
}

#[test]
fn bad_results_are_refused() {
    let dir = Scratch::new();
    let none = dir.path("none.json");
    let text = dir.file("text.json", "solid");
    let old = dir.file("old.json", r#"{"format": 1}"#);
    let good = json!({
        "format": 1, "program": "p", "commit": null, "date": "2026-11-22", "seconds": 1.0, "input_seconds": 0.0,
        "machine": {"cpu": "c", "cores": 1, "memory_bytes": null, "kernel": "k"}, "load": [0.0, 0.0],
        "settings": {"suites": ["mesh"], "quick": true, "full": false, "rounds": 1, "threads": 1}, "inputs": [],
        "figures": [{"suite": "mesh", "input": "i", "job": "j", "rounds": [
            {"seconds": 1.0, "cpu_seconds": 1.0, "floor_seconds": 1.0, "anonymous_bytes": 1}]}],
    });
    let whole = dir.file("whole.json", good.to_string());
    bench(&[&"compare", &whole, &whole]).ok();
    let new = doctored(&dir, &whole, "new.json", |value| value["format"] = json!(2));
    let rounds = doctored(&dir, &whole, "rounds.json", |value| value["figures"][0]["rounds"] = json!([]));
    let negative = doctored(&dir, &whole, "negative.json", |value| {
        value["figures"][0]["rounds"][0]["seconds"] = json!(-1.0)
    });
    let empty = doctored(&dir, &whole, "empty.json", |value| value["figures"] = json!([]));
    for bad in [&none, &text, &old, &new, &rounds, &negative] {
        let name = bad.file_name().unwrap().to_str().unwrap();
        let line = bench(&[&"compare", &whole, bad]).failed();
        assert!(line.contains(name), "{line}");
        let line = bench(&[&"report", bad, &"-o", &dir.path("r.html")]).failed();
        assert!(line.contains(name), "{line}");
    }
    assert!(bench(&[&"compare", &whole, &empty]).failed().contains("no figure in common"));
    assert!(!dir.path("r.html").exists());
    bench(&[&"report", &whole, &"-o", &dir.path("r.pdf")]).misused();
    let page = dir.file("whole.md", good.to_string());
    bench(&[&"report", &page, &"-o", &page]).failed();
    bench(&[&"everything"]).misused();
    bench(&[&"store", &"--quick", &"--full"]).misused();
    bench(&[&"store", &"--quick", &"--report", &"r.pdf", &"--cache", &dir.path("c")]).misused();
}

#[test]
fn a_damaged_input_is_made_again() {
    let dir = Scratch::new();
    fs::create_dir(dir.path("cache")).unwrap();
    let input = dir.file("cache/pile-50k.stl", "no triangles");
    measured(&dir, "mesh", "1", "a.json");
    assert_eq!(fs::metadata(input).unwrap().len(), 2_500_084);
}

/// Options of the lines of documents that begin with the harness's name.
#[test]
fn options_in_documents_exist() {
    let top = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let mut count = 0;
    for page in ["README.md", "docs/guide/benchmark.md"] {
        let text = fs::read_to_string(top.join(page)).expect("it is there");
        for command in
            text.split(['`', '\n']).map(str::trim).filter(|line| line.starts_with("brickfield-bench "))
        {
            let words: Vec<&str> = command.split_whitespace().collect();
            let own = ["compare", "report", "instructions"].contains(&words[1]).then_some(words[1]);
            let help: Vec<&str> = own.into_iter().chain(["--help"]).collect();
            let help =
                String::from_utf8(harness().args(help).output().expect("it runs").stdout).expect("text");
            for word in &words[1..] {
                let is_suite = own.is_none() && word.chars().all(|c| c.is_ascii_lowercase());
                let is_option = word.starts_with("--");
                assert!(!is_suite || help.contains(&format!("- {word}:")), "{page}: {command}");
                let is_there = [" ", "[", "\n", "="].iter().any(|end| help.contains(&format!("{word}{end}")));
                assert!(!is_option || is_there, "{page}: {command}");
                count += u32::from(is_suite || is_option);
            }
        }
    }
    assert!(count >= 10);
}
