//! Volumes with their errors, as the program prints them.

use crate::support::*;
use brickfield_core::sweep::part_or_all;
use serde_json::Value;

fn number(json: &Value, at: &str) -> f64 {
    json.pointer(at).and_then(Value::as_f64).unwrap_or_else(|| panic!("{at}: {json}"))
}

#[test]
fn volumes_are_those_of_closed_forms_whatever_the_cells_are() {
    let dir = Scratch::new();
    let store = dir.path("a.brf");
    for (name, union, overlap) in [
        ("raster.gcode", 28.16671, 1.50784),
        ("retraced.gcode", 2.46882, 4.88503),
        ("vase.gcode", 33.23983, 7.66416),
    ] {
        let build = |more: &[&str]| {
            let mut args: Vec<&dyn AsRef<std::ffi::OsStr>> = vec![&"build"];
            let input = of_passes(name);
            args.extend([&input as &dyn AsRef<std::ffi::OsStr>, &"-o", &store, &"--restart", &"--json"]);
            args.extend(more.iter().map(|arg| arg as &dyn AsRef<std::ffi::OsStr>));
            let json: Value = serde_json::from_str(&run(&args).stdout).unwrap();
            json
        };
        let json = build(&["--depth", "1"]);
        for (part, truth) in [("union", union), ("overlap", overlap)] {
            let value = number(&json, &format!("/volumes/{part}"));
            let error = number(&json, &format!("/volumes/{part}_error"));
            assert!(
                (value - truth).abs() <= error && error < 0.003 * union,
                "{name} {part}: {value} ± {error}"
            );
        }
        let (fed, sections) = (number(&json, "/balance/fed"), number(&json, "/balance/sections"));
        assert!((fed / sections - 1.0).abs() < 1e-3, "{name}: {fed} fed, {sections}");
        let sum = number(&json, "/volumes/union")
            + number(&json, "/volumes/overlap")
            + number(&json, "/balance/within_corners")
            - number(&json, "/balance/round_ends");
        assert!((sum / fed - 1.0).abs() < 1e-3, "{name}: {sum} of {fed}");
        // The layer height and others, one thread and two, a small budget.
        let all = [["--cell", "0.33mm"], ["--threads", "1"], ["--cell", "0.2mm"], ["--memory", "256MiB"]];
        for more in all.into_iter().take(part_or_all(2, 4)) {
            assert_eq!(build(&more[..])["volumes"], json["volumes"], "{more:?}");
        }
        let said = run(&[&"info", &store, &"--json"]).json();
        assert_eq!(said["source_volumes"]["union"], json["volumes"]["union"]);
        assert_eq!(said["source_volumes"]["balance"], json["balance"]);
        assert!(said["volumes"].is_null());
    }
}

#[test]
fn stores_and_meshes_are_measured_beside_their_source() {
    let dir = Scratch::new();
    let (store, mesh) = (dir.path("a.brf"), dir.path("a.stl"));
    let input = example("stl/overlap_boxes.stl");
    let text = run(&[&"build", &input, &"-o", &store, &"--depth", &"2", &"--mesh", &mesh]).ok();
    assert!(text.contains("mm³ of union, ") && text.contains("the source holds 1600.0"), "{text}");
    let info = run(&[&"info", &store, &"--volume", &"--json"]).json();
    for (part, truth) in [("union", 1600.0), ("overlap", 400.0)] {
        for whose in ["source_volumes", "volumes"] {
            let value = number(&info, &format!("/{whose}/{part}"));
            let error = number(&info, &format!("/{whose}/{part}_error"));
            assert!((value - truth).abs() <= error.max(1e-3), "{whose} {part}: {value} ± {error}");
        }
    }
    let text = run(&[&"info", &store, &"--volume"]).ok();
    assert!(text.contains("by the source") && text.contains("by the samples and crossings"), "{text}");
    // Of open input nothing is known of the source.
    let open = example("stl/open_box_no_lid.stl");
    let json = run(&[&"build", &open, &"-o", &store, &"--depth", &"1", &"--restart", &"--json"]);
    let json: Value = serde_json::from_str(&json.stdout).unwrap();
    assert!(json["volumes"].is_null() && json["balance"].is_null());
}
