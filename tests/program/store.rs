//! `brickfield info` and `brickfield verify`.

use crate::support::*;

#[test]
fn info_tells_source_place_and_levels() {
    let dir = Scratch::new();
    let store = dir.store("overlap_boxes", 2);
    let json = run(&[&"info", &store, &"--json"]).json();
    assert_eq!(json["bounds"], serde_json::json!([[0.0, 0.0, 0.0], [16.0, 10.0, 10.0]]));
    assert_eq!((&json["units"], &json["depth"], &json["facets"]), (&"mm".into(), &2.into(), &24.into()));
    assert_eq!(json["sources"][0]["facets"], 24);
    assert!(json["sources"][0]["path"].as_str().unwrap().ends_with("overlap_boxes.stl"));
    let levels = json["store"]["levels"].as_array().unwrap();
    assert_eq!(levels.len(), 3);
    assert_eq!(levels[1]["nodes"], 8);
    assert_eq!(json["store"]["file_bytes"], std::fs::metadata(&store).unwrap().len());
    assert!(json["store"]["dense_ratio"].as_f64().unwrap() > 10.0);
    let text = run(&[&"info", &store]).ok();
    for expected in ["overlap_boxes.stl", "units    mm", "level", "hermite", "times smaller"] {
        assert!(text.contains(expected), "{text}");
    }
}

#[test]
fn verify_finds_every_damaged_byte_it_should() {
    let dir = Scratch::new();
    let store = dir.store("overlap_boxes", 2);
    assert!(run(&[&"verify", &store]).ok().contains("sound, 73 records"));
    let json = run(&[&"verify", &store, &"--json"]).json();
    assert_eq!((&json["sound"], &json["records"]), (&true.into(), &73.into()));
    let sound = std::fs::read(&store).unwrap();
    let entries = {
        use brickfield_engine::store::Store;
        let open = Store::open(&store, 0).unwrap();
        open.entries()
            .iter()
            .filter(|e| e.length > 0)
            .map(|e| (e.key.to_string(), e.offset))
            .collect::<Vec<_>>()
    };
    for (key, offset) in entries.iter().step_by(11) {
        let mut bytes = sound.clone();
        bytes[*offset as usize + 3] ^= 0x40;
        let damaged = dir.file("damaged.brf", bytes);
        let line = run(&[&"verify", &damaged]).failed();
        assert!(line.contains("damaged.brf") && line.contains(key), "{key}: {line}");
        let ran = run(&[&"verify", &damaged, &"--json"]);
        assert_eq!(ran.status, Some(1));
        let json: serde_json::Value = serde_json::from_str(&ran.stdout).unwrap();
        assert_eq!((&json["sound"], &json["first_damage"]["record"]), (&false.into(), &key.as_str().into()));
    }
}

#[test]
fn what_is_no_store_is_refused_by_all() {
    let dir = Scratch::new();
    let store = std::fs::read(dir.store("overlap_boxes", 1)).unwrap();
    let bad = [
        dir.path("missing.brf"),
        dir.file("empty.brf", ""),
        dir.file("cut.brf", &store[..store.len() - 100]),
        dir.file("mesh.brf", std::fs::read(stl("overlap_boxes")).unwrap()),
    ];
    let points = dir.file("p.csv", "1,2,3\n");
    let before = dir.names();
    for path in &bad {
        let name = path.to_str().unwrap();
        // Any input is told by its content, whatever its name.
        let told = run(&[&"info", path]);
        if name.ends_with("mesh.brf") {
            assert!(told.ok().contains("STL binary, 24 facets"));
        } else {
            assert!(told.failed().contains(name));
        }
        for line in [
            run(&[&"verify", path]),
            run(&[&"mesh", path, &"-o", &dir.path("x.ply")]),
            run(&[&"sample", path, &"--points", &points]),
            run(&[&"export", path, &"--level", &"0", &"-o", &dir.path("x.npy")]),
        ] {
            let line = line.failed();
            assert!(line.contains(name), "{line}");
        }
    }
    assert_eq!(dir.names(), before);
}
