//! `brickfield cache`: stores as files. For `merge` see `shards.rs`.

use crate::support::*;
use serde_json::Value;
use std::ffi::OsStr;
use std::fs;
use std::path::{Path, PathBuf};

/// Builds a store that the build may warn about.
#[track_caller]
fn built(dir: &Scratch, name: &str, args: &[&dyn AsRef<OsStr>]) -> PathBuf {
    let path = dir.path(name);
    let ran = run(&[&[&"build" as &dyn AsRef<OsStr>, &"-o", &path, &"--quiet"], args].concat());
    assert_eq!(ran.status, Some(0), "{}", ran.stderr);
    path
}

/// A real toolpath whose beads are told apart.
#[track_caller]
fn clover(dir: &Scratch, depth: u8) -> PathBuf {
    let (input, depth) = (example("clover.gcode"), depth.to_string());
    built(
        dir,
        &format!("clover-{depth}.brf"),
        &[&input, &"--skip", &"Skirt/Brim", &"--identity", &"--depth", &depth],
    )
}

fn rows(text: &str) -> Vec<Value> {
    text.lines().map(|line| serde_json::from_str(line).expect("JSON")).collect()
}

#[test]
fn ls_lists_the_tree_and_parts_of_it() {
    let dir = Scratch::new();
    let store = dir.store("overlap_boxes", 3);
    let info = run(&[&"info", &store, &"--json"]).json();
    let all = rows(&run(&[&"cache", &"ls", &store, &"--json"]).ok());
    assert_eq!(all.len() as u64, info["store"]["total"]["nodes"].as_u64().unwrap());
    assert!(all.windows(2).all(|pair| pair[0]["key"].as_u64() < pair[1]["key"].as_u64()));
    let leaves = rows(&run(&[&"cache", &"ls", &store, &"--json", &"--leaves", &"--level", &"3"]).ok());
    let expected: Vec<&Value> = all.iter().filter(|row| row["level"] == 3 && row["leaf"] == true).collect();
    assert!(!expected.is_empty() && leaves.iter().eq(expected));
    let corner = rows(&run(&[&"cache", &"ls", &store, &"--json", &"--box", &"-9,-9,-9,0.5,0.5,0.5"]).ok());
    assert!(!corner.is_empty() && corner.len() < all.len() / 2);
    let meets = |row: &Value| (0..3).all(|a| row["corners"][0][a].as_f64().unwrap() <= 0.5);
    assert!(corner.iter().all(meets) && all.iter().filter(|row| meets(row)).count() == corner.len());
    let text = run(&[&"cache", &"ls", &store]).ok();
    assert_eq!(text.lines().count(), all.len() + 4);
    assert!(text.contains("level 3: ") && text.contains("L0(0,0,0)") && text.contains("interior"), "{text}");
    run(&[&"cache", &"ls", &store, &"--box", &"1,2,3"]).misused();
}

#[test]
fn stat_accounts_for_every_byte() {
    let dir = Scratch::new();
    let open = built(&dir, "open.brf", &[&stl("open_box_no_lid"), &"--depth", &"2", &"--gwn-error", &"0.01"]);
    for store in [dir.store("overlap_boxes", 2), clover(&dir, 2), open] {
        let stat = run(&[&"cache", &"stat", &store, &"--json"]).json();
        let number =
            |at: &str| stat.pointer(at).and_then(Value::as_u64).unwrap_or_else(|| panic!("{at}: {stat}"));
        let parts =
            ["payloads", "lists", "tables", "index", "rest"].map(|part| number(&format!("/file/{part}")));
        assert_eq!(parts.iter().sum::<u64>(), fs::metadata(&store).unwrap().len());
        let kinds = stat["total"]["kinds"].as_object().unwrap();
        let of_kinds: u64 = kinds.values().map(|kind| kind["bytes"].as_u64().unwrap()).sum();
        assert_eq!(number("/file/payloads"), of_kinds);
        // Where there are Hermite parts, four bytes say how long the other part is.
        let payload = number("/total/samples/stored") + number("/total/hermite/stored");
        assert_eq!(number("/file/payloads"), payload + 4 * number("/total/hermite/records"));
        assert!(number("/total/samples/plain") > number("/total/samples/stored"));
        assert!(number("/total/crossing_cells") > 500 && number("/total/edges") > 500);
        let text = run(&[&"cache", &"stat", &store]).ok();
        assert!(text.contains("bytes a crossing cell") && text.contains("samples parts"), "{text}");
    }
}

#[test]
fn get_gives_what_a_node_holds() {
    let dir = Scratch::new();
    let store = dir.store("overlap_boxes", 2);
    let (npy, csv) = (dir.path("brick.npy"), dir.path("edges.csv"));
    let by_point = run(&[
        &"cache",
        &"get",
        &store,
        &"--point",
        &"0,5,5",
        &"--samples",
        &npy,
        &"--hermite",
        &csv,
        &"--json",
    ]);
    let node = by_point.json();
    let edges: Vec<String> = fs::read_to_string(&csv).unwrap().lines().skip(1).map(str::to_owned).collect();
    let counts: u64 = node["hermite_edges"].as_array().unwrap().iter().map(|n| n.as_u64().unwrap()).sum();
    assert_eq!((node["leaf"].as_bool(), edges.len() as u64), (Some(true), counts));
    // Crossings along x lie on the face x = 0, whose normal points to −x.
    let of_x: Vec<Vec<f64>> = edges
        .iter()
        .filter_map(|line| line.strip_prefix("x,"))
        .map(|line| line.split(',').map(|number| number.parse().unwrap()).collect())
        .collect();
    assert!(of_x.len() > 100);
    assert!(of_x.iter().all(|row| row[4].abs() < 1e-4 && row[7..] == [-1.0, 0.0, 0.0]));
    let array = Array::read(&npy);
    assert_eq!((array.descr.as_str(), array.axis), ("<i2", 33));
    let text =
        run(&[&"cache", &"get", &store, &"--node", &node["node"].as_str().unwrap(), &"--samples", &"-"]).ok();
    for line in text.lines().skip(1).step_by(97) {
        let numbers: Vec<f64> = line.split(',').map(|number| number.parse().unwrap()).collect();
        assert_eq!(array.at([0, 1, 2].map(|a| numbers[a] as usize)), numbers[3]);
    }
    assert_eq!(text.lines().count(), 1 + 33 * 33 * 33);
    let raw = dir.path("brick.raw");
    let key = node["key"].to_string();
    assert!(run(&[&"cache", &"get", &store, &"--node", &key, &"--samples", &raw]).ok().contains("a leaf"));
    assert!(fs::read(&npy).unwrap().ends_with(&fs::read(&raw).unwrap()));
    let root = run(&[&"cache", &"get", &store, &"--point", &"0,5,5", &"--level", &"0", &"--json"]).json();
    assert_eq!((&root["node"], &root["leaf"]), (&"L0(0,0,0)".into(), &false.into()));
    let far = run(&[&"cache", &"get", &store, &"--point", &"1e9,0,0"]).failed();
    assert!(far.contains("no node there"), "{far}");
    assert!(run(&[&"cache", &"get", &store, &"--node", &"9:0,0,0"]).failed().contains("L9(0,0,0)"));
    run(&[&"cache", &"get", &store]).misused();
    run(&[&"cache", &"get", &store, &"--node", &"1", &"--samples", &"x.txt"]).misused();
    run(&[&"cache", &"get", &store, &"--node", &"1", &"--samples", &"-", &"--hermite", &"-"]).misused();
}

#[test]
fn a_toolpath_is_cut_down_and_its_beads_are_told_apart_as_before() {
    let dir = Scratch::new();
    let store = clover(&dir, 3);
    let whole = fs::read(&store).unwrap();
    run(&[&"cache", &"compact", &store, &"--in-place", &"--quiet"]).ok();
    assert!(fs::read(&store).unwrap() == whole);
    let pruned = dir.path("pruned.brf");
    let json = run(&[&"cache", &"prune", &store, &"-o", &pruned, &"--level", &"1", &"--json"]).json();
    assert_eq!(
        (&json["nodes"], json["file_bytes"].as_u64()),
        (&9.into(), Some(fs::metadata(&pruned).unwrap().len()))
    );
    assert!(run(&[&"cache", &"verify", &pruned]).ok().contains("sound"));
    let info = run(&[&"info", &pruned, &"--json"]).json();
    let bounds: Vec<f64> = info["bounds"]
        .as_array()
        .unwrap()
        .iter()
        .flat_map(|c| c.as_array().unwrap())
        .map(|c| c.as_f64().unwrap())
        .collect();
    let mut points = String::new();
    for n in 0..500usize {
        let part = |a: usize| (n * [37, 61, 89][a] % 499) as f64 / 499.0;
        let at = [0, 1, 2].map(|a| bounds[a] + (bounds[a + 3] - bounds[a]) * part(a));
        points += &format!("{},{},{}\n", at[0], at[1], at[2]);
    }
    let points = dir.file("p.csv", points);
    let beads = |store: &Path| -> Vec<Value> {
        let told = rows(&run(&[&"sample", &store, &"--points", &points, &"--beads", &"--json"]).ok());
        told.into_iter().map(|row| row["beads"].clone()).collect()
    };
    let before = beads(&store);
    assert!(before.iter().filter(|beads| **beads != Value::Array(Vec::new())).count() > 50);
    assert_eq!(before, beads(&pruned));
    let meshes = [(&store, "a.stl", "1"), (&pruned, "b.stl", "1")].map(|(store, name, level)| {
        run(&[&"mesh", store, &"-o", &dir.path(name), &"--level", &level, &"--quiet"]).ok();
        fs::read(dir.path(name)).unwrap()
    });
    assert!(meshes[0] == meshes[1]);
}

#[test]
fn a_store_is_cut_to_a_box_and_to_an_error() {
    let dir = Scratch::new();
    let store = dir.store("clover_beads", 4);
    let boxed = dir.path("boxed.brf");
    let args: [&dyn AsRef<OsStr>; 6] = [&"cache", &"prune", &store, &"-o", &boxed, &"--box"];
    let [low, high] = ["bounds"].map(|name| run(&[&"info", &store, &"--json"]).json()[name].clone())[0]
        .as_array()
        .map(|corners| [corners[0].clone(), corners[1].clone()])
        .unwrap();
    let middle = |a: usize| (low[a].as_f64().unwrap() + high[a].as_f64().unwrap()) / 2.0;
    let region = format!("{0},{1},{2},{0},{1},{2}", middle(0), middle(1), middle(2));
    let text = run(&[&args[..], &[&region]].concat()).ok();
    assert!(text.contains("boxed.brf") && text.contains("from "), "{text}");
    run(&[&"verify", &boxed, &"--quiet"]).ok();
    let leaf = |store: &Path| {
        let point = format!("{},{},{}", middle(0), middle(1), middle(2));
        run(&[&"cache", &"get", &store, &"--point", &point, &"--json"]).json()
    };
    let (before, after) = (leaf(&store), leaf(&boxed));
    assert_eq!(["node", "crc", "bytes"].map(|f| &before[f]), ["node", "crc", "bytes"].map(|f| &after[f]));
    assert!(run(&[&"info", &boxed]).ok().contains("pruned to level 0 outside of"));
    assert!(fs::metadata(&boxed).unwrap().len() * 5 < fs::metadata(&store).unwrap().len());
    // Fractions, from 0 to about 1.
    let scan =
        built(&dir, "open.brf", &[&stl("open_box_no_lid"), &"--depth", &"3", &"--gwn-error", &"0.002"]);
    let before = fs::metadata(&scan).unwrap().len();
    run(&[&"cache", &"prune", &scan, &"--in-place", &"--error", &"1", &"--quiet"]).ok();
    run(&[&"verify", &scan, &"--quiet"]).ok();
    assert!(fs::metadata(&scan).unwrap().len() < before);
    assert!(run(&[&"mesh", &scan, &"-o", &dir.path("open.stl")]).ok().contains("triangles"));
}

#[test]
fn the_range_coder_changes_no_answer() {
    let dir = Scratch::new();
    let pack = |from: &Path, to: &Path, name: &str| {
        run(&[&"cache", &"repack", &from, &"-o", &to, &"--compression", &name, &"--quiet"]).ok();
    };
    let inputs =
        [(example("clover.gcode"), "2"), (stl("featuretype50_model"), "2"), (stl("open_box_no_lid"), "1")];
    for (input, depth) in inputs {
        let store = built(&dir, "store.brf", &[&input, &"--depth", &depth]);
        let (coded, back) = (dir.path("coded.brf"), dir.path("back.brf"));
        pack(&store, &coded, "range");
        run(&[&"verify", &coded, &"--quiet"]).ok();
        let bytes = |path: &Path| fs::read(path).unwrap();
        assert!(bytes(&coded).len() * 4 < bytes(&store).len() * 3);
        pack(&coded, &back, "lz4");
        assert!(bytes(&back) == bytes(&store));
        assert!(run(&[&"cache", &"diff", &store, &coded]).ok().contains("are equal"));
        let points = dir.path("points.csv");
        fs::write(&points, "0,0,0\n1,2,3\n10,10,1\n-3.5,0.25,0.5\n0.1,0.2,0.3\n").unwrap();
        let answers = |store: &Path| {
            let (mesh, array) = (dir.path("mesh.ply"), dir.path("array.npy"));
            run(&[&"mesh", &store, &"-o", &mesh, &"--quiet"]).ok();
            run(&[&"export", &store, &"--level", &"1", &"-o", &array, &"--quiet"]).ok();
            let coarse = dir.path("coarse.brf");
            run(&[&"cache", &"prune", &store, &"-o", &coarse, &"--level", &"1", &"--quiet"]).ok();
            let samples = run(&[&"sample", &store, &"--points", &points]).ok();
            (bytes(&mesh), bytes(&array), samples, coarse)
        };
        let (of_store, of_coded) = (answers(&store), answers(&coded));
        assert!((of_store.0, of_store.1, of_store.2) == (of_coded.0, of_coded.1, of_coded.2));
        // What is cut down stays in the coding that it had.
        let kinds = run(&[&"cache", &"stat", &of_coded.3, &"--json"]).json();
        let kinds = kinds["total"]["kinds"].as_object().unwrap().clone();
        assert!(kinds.keys().all(|kind| kind == "uniform" || kind.ends_with("+range")), "{kinds:?}");
    }
}

#[test]
fn levels_stand_one_after_the_other_where_that_is_asked_for() {
    let dir = Scratch::new();
    let input = example("clover.gcode");
    let store =
        built(&dir, "store.brf", &[&input, &"--depth", &"3", &"--identity", &"--compression", &"range"]);
    let [levels, back] = ["levels.brf", "back.brf"].map(|name| dir.path(name));
    run(&[&"cache", &"repack", &store, &"-o", &levels, &"--order", &"level", &"--quiet"]).ok();
    run(&[&"verify", &levels, &"--quiet"]).ok();
    assert!(run(&[&"cache", &"diff", &store, &levels]).ok().contains("are equal"));
    // The index is in the order of levels, and so are the payloads now.
    let places = |store: &Path| -> Vec<u64> {
        let listed = run(&[&"cache", &"ls", &store, &"--json"]).ok();
        let nodes = listed.lines().map(|line| serde_json::from_str::<serde_json::Value>(line).unwrap());
        nodes.filter(|node| node["bytes"] != 0).map(|node| node["offset"].as_u64().unwrap()).collect()
    };
    assert!(places(&levels).is_sorted() && !places(&store).is_sorted());
    // Payloads stay as they were, and `compact` puts them back.
    assert_eq!(fs::metadata(&levels).unwrap().len(), fs::metadata(&store).unwrap().len());
    run(&[&"cache", &"compact", &levels, &"-o", &back, &"--quiet"]).ok();
    assert!(fs::read(&back).unwrap() == fs::read(&store).unwrap());
}

#[test]
fn a_build_compresses_as_repack_does() {
    let dir = Scratch::new();
    let cases: [(&str, PathBuf, &[&str]); 4] = [
        ("closed", stl("featuretype50_model"), &["--depth", "3"]),
        ("open", stl("open_box_no_lid"), &["--depth", "1"]),
        ("beads", example("clover.gcode"), &["--depth", "2", "--identity"]),
        ("decided", stl("overlap_boxes"), &["--depth", "3", "--refine", "surface"]),
    ];
    for (name, input, settings) in cases {
        let store = |name: &str, how: &[&str]| {
            let mut args: Vec<&dyn AsRef<OsStr>> = vec![&input];
            args.extend(settings.iter().chain(how).map(|arg| arg as &dyn AsRef<OsStr>));
            built(&dir, name, &args)
        };
        let plain = store("plain.brf", &[]);
        for way in ["none", "range", "lz4"] {
            let direct = store("direct.brf", &["--compression", way]);
            let packed = dir.path("packed.brf");
            run(&[&"cache", &"repack", &plain, &"-o", &packed, &"--compression", &way, &"--quiet"]).ok();
            assert!(fs::read(&packed).unwrap() == fs::read(&direct).unwrap(), "{name}, {way}");
            let same = fs::read(&packed).unwrap() == fs::read(&plain).unwrap();
            assert_eq!(same, way == "lz4", "{name}, {way}");
        }
    }
    let shard: [&dyn AsRef<OsStr>; 6] =
        [&"build", &"x.stl", &"-o", &"x.brf", &"--shard=1/2", &"--compression=range"];
    assert!(run(&shard).misused().contains("`cache repack` when they are joined"));
}

#[test]
fn a_cut_store_has_the_lists_of_one_that_was_built_so() {
    let dir = Scratch::new();
    let (fine, coarse, cut) = (clover(&dir, 3), clover(&dir, 2), dir.path("cut.brf"));
    run(&[&"cache", &"prune", &fine, &"-o", &cut, &"--level", &"2", &"--quiet"]).ok();
    let ran = run(&[&"cache", &"diff", &coarse, &cut, &"--json"]);
    let json: Value = serde_json::from_str(&ran.stdout).expect("JSON");
    assert_eq!((&json["lists"], &json["samples"], &json["only_first"]), (&0.into(), &0.into(), &0.into()));
}

#[test]
fn diff_tells_by_its_status() {
    let dir = Scratch::new();
    let (store, plain) = (dir.store("overlap_boxes", 2), dir.path("plain.brf"));
    run(&[&"cache", &"repack", &store, &"-o", &plain, &"--compression", &"none", &"--quiet"]).ok();
    assert!(fs::metadata(&plain).unwrap().len() > 2 * fs::metadata(&store).unwrap().len());
    assert!(run(&[&"cache", &"diff", &store, &plain]).ok().contains("are equal"));
    assert_eq!(run(&[&"cache", &"diff", &store, &plain, &"--json"]).json()["equal"], true);
    let other = dir.store("overlap_boxes", 1);
    let ran = run(&[&"cache", &"diff", &store, &other]);
    assert_eq!((ran.status, ran.stderr.lines().count()), (Some(1), 1));
    assert!(ran.stderr.contains("differ") && ran.stdout.contains("depth: 2 and 1"), "{}", ran.stdout);
    let ran = run(&[&"cache", &"diff", &store, &other, &"--json", &"--ignore-metadata"]);
    assert_eq!(ran.status, Some(1));
    let json: Value = serde_json::from_str(&ran.stdout).unwrap();
    assert_eq!((&json["common"], &json["only_first"], &json["samples"]), (&9.into(), &64.into(), &0.into()));
    assert_eq!(json["first"][0]["node"], "L1(0,0,0)");
    let missing = run(&[&"cache", &"diff", &store, &dir.path("missing.brf")]).failed();
    assert!(missing.contains("missing.brf"), "{missing}");
}

#[test]
fn shards_are_written_anew_but_not_cut() {
    let dir = Scratch::new();
    let shard = built(&dir, "shard.brf", &[&stl("clover_beads"), &"--depth", &"3", &"--shard", &"2/3"]);
    let (copy, bytes) = (dir.path("copy.brf"), fs::read(&shard).unwrap());
    run(&[&"cache", &"compact", &shard, &"-o", &copy, &"--quiet"]).ok();
    assert!(fs::read(&copy).unwrap() == bytes);
    run(&[&"cache", &"diff", &shard, &copy]).ok();
    assert!(!run(&[&"cache", &"ls", &shard]).ok().is_empty());
    let told = run(&[&"cache", &"prune", &shard, &"-o", &dir.path("x.brf"), &"--level", &"1"]).failed();
    assert!(told.contains("shard 2 of 3") && told.contains("cache merge"), "{told}");
    assert_eq!(dir.names(), ["copy.brf", "shard.brf"]);
}

#[test]
fn a_link_stays_one_when_what_it_names_is_replaced() {
    let dir = Scratch::new();
    let (store, link) = (dir.store("overlap_boxes", 2), dir.path("link.brf"));
    std::os::unix::fs::symlink(&store, &link).unwrap();
    run(&[&"cache", &"prune", &link, &"--in-place", &"--level", &"1", &"--quiet"]).ok();
    assert!(
        fs::symlink_metadata(&link).unwrap().is_symlink()
            && !fs::symlink_metadata(&store).unwrap().is_symlink()
    );
    let info = run(&[&"info", &store, &"--json"]).json();
    assert_eq!((&info["depth"], &info["store"]["total"]["nodes"]), (&1.into(), &9.into()));
    let meshed = run(&[&"mesh", &link, &"-o", &dir.path("x.stl"), &"--json"]).json();
    let cache = &meshed["brick_cache"];
    assert!(cache["misses"].as_u64() > Some(0) && cache["hits"].is_u64());
    // Whatever a traversal names ahead is read.
    assert!(cache["ahead"].as_u64() > Some(0) && cache["ahead"] == cache["ahead_used"], "{cache}");
}

#[test]
fn nothing_is_lost_when_writing_fails() {
    let dir = Scratch::new();
    let store = dir.store("clover_beads", 3);
    let whole = fs::read(&store).unwrap();
    for command in ["compact", "repack --compression none", "prune --level 2"] {
        for target in [format!("-o '{}'", dir.path("out.brf").display()), "--in-place".to_owned()] {
            let script = format!("ulimit -f 64; exec \"$0\" cache {command} \"$1\" {target}");
            let mut limited = std::process::Command::new("sh");
            limited.args(["-c", &script, env!("CARGO_BIN_EXE_brickfield")]).arg(&store);
            let line = Run::from(limited.output().unwrap()).failed();
            assert!(line.contains("cannot write"), "{line}");
            assert!(fs::read(&store).unwrap() == whole);
            assert_eq!(dir.names(), ["clover_beads-3.brf"]);
        }
    }
}

#[test]
fn damage_and_misuse_are_refused() {
    let dir = Scratch::new();
    let store = dir.store("overlap_boxes", 2);
    let sound = fs::read(&store).unwrap();
    let entry = rows(&run(&[&"cache", &"ls", &store, &"--json"]).ok())
        .into_iter()
        .rfind(|row| row["kind"].as_str().unwrap().contains("hermite"))
        .unwrap();
    let mut bytes = sound.clone();
    bytes[entry["offset"].as_u64().unwrap() as usize + 9] ^= 4;
    let damaged = dir.file("damaged.brf", &bytes);
    let out = dir.path("out.brf");
    for ran in [
        run(&[&"cache", &"compact", &damaged, &"--in-place"]),
        run(&[&"cache", &"repack", &damaged, &"-o", &out]),
        run(&[&"cache", &"prune", &damaged, &"-o", &out, &"--level", &"1"]),
        run(&[&"cache", &"stat", &damaged]),
        run(&[&"cache", &"diff", &store, &damaged]),
        run(&[&"cache", &"get", &damaged, &"--node", &entry["node"].as_str().unwrap()]),
        run(&[&"cache", &"verify", &damaged]),
    ] {
        let line = ran.failed();
        assert!(line.contains("damaged.brf") && line.contains(entry["node"].as_str().unwrap()), "{line}");
    }
    assert!(fs::read(&damaged).unwrap() == bytes);
    let itself = run(&[&"cache", &"compact", &store, &"-o", &store]).failed();
    assert!(itself.contains("would overwrite"), "{itself}");
    run(&[&"cache", &"compact", &store]).misused();
    run(&[&"cache", &"compact", &store, &"-o", &out, &"--in-place"]).misused();
    run(&[&"cache", &"prune", &store, &"-o", &out]).misused();
    run(&[&"cache", &"prune", &store, &"-o", &out, &"--outside-level", &"1"]).misused();
    for error in ["-1", "nan"] {
        let told = run(&[&"cache", &"prune", &store, &"-o", &out, &format!("--error={error}")]).failed();
        assert!(told.contains("bound on errors"), "{told}");
    }
    let far = run(&[&"cache", &"prune", &store, &"-o", &out, &"--box", &"-9,-9,-9,-8,-8,-8"]).failed();
    assert!(far.contains("root cube") && far.contains("brickfield info"), "{far}");
    assert!(fs::read(&store).unwrap() == sound && !out.exists());
    for command in ["ls", "stat", "get", "verify", "compact", "prune", "repack", "merge", "diff"] {
        assert!(run(&[&"cache", &command, &"--help"]).ok().contains("--json"), "{command}");
        assert!(run(&[&"man", &"cache", &command]).ok().contains(command));
    }
    assert!(run(&[&"completions", &"bash"]).ok().contains("outside-level"));
}
