//! `machine`: what tools take off against closed forms, voids that a cut opens, and what is refused.

use crate::support::*;
use brickfield_bench_data::{shapes, write};
use std::f64::consts::PI;
use std::path::{Path, PathBuf};

/// A block of 20 × 20 × 20 mm, as a store with cells of this size.
fn block(dir: &Scratch, cell: &str) -> PathBuf {
    let mut bytes = Vec::new();
    write::stl(&mut bytes, &shapes::cuboid([0.0; 3], [20.0; 3])).unwrap();
    let (mesh, store) = (dir.file("block.stl", bytes), dir.path("block.brf"));
    run(&[&"build", &mesh, &"-o", &store, &"--cell", &cell, &"-q"]).ok();
    store
}

fn machine(part: &Path, program: &Path, tools: &[&str], output: &Path, more: &[&str]) -> Run {
    let mut args: Vec<&dyn AsRef<std::ffi::OsStr>> = vec![&"machine", &part, &program, &"-o", &output];
    for tool in tools {
        args.push(&"--tool");
        args.push(tool);
    }
    args.extend(more.iter().map(|arg| arg as &dyn AsRef<std::ffi::OsStr>));
    run(&args)
}

#[test]
fn removed_volumes_are_those_of_closed_forms() {
    let dir = Scratch::new();
    let part = block(&dir, "0.1");
    let whole = run(&[&"info", &part, &"--volume", &"--json"]).json();
    let whole = whole["volumes"]["union"].as_f64().unwrap();
    let cone = 4.0 / 59f64.to_radians().tan();
    let segment = 9.0 * (1.0f64 / 3.0).acos() - 8f64.sqrt();
    let cases = [
        ("slot", "flat:6", "G0 X-10 Y10.03 Z25\nG0 Z16\nG1 X30\n", 480.0),
        ("scaled slot", "flat:6", "G0 X-10 Y10.03 Z25\nG51 X0 Z20 P2.\nG0 Z18\nG1 X15\n", 480.0),
        ("mirrored slot", "flat:6", "G0 X30 Y10.03 Z25\nG51.1 X10 Z20\nG0 X-10 Z24\nG1 X30\n", 480.0),
        ("turned slot", "flat:5mm", "G0 X-10 Y-10 Z16\nG1 X30 Y30\n", {
            // Between two lines at 45°, of which the corners of the block cut triangles.
            let half = 2.5 * 2f64.sqrt();
            4.0 * (400.0 - (20.0 - half).powi(2))
        }),
        ("drilled hole", "drill:8", "G0 X9.7 Y10.1 Z30\nG81 Z8 R21\nG80\n", {
            PI * 16.0 * (12.0 - cone + cone / 3.0)
        }),
        ("ball face", "ball:6", "G0 X-10 Y10.1 Z18\nG1 X30\n", 20.0 * segment),
        ("bull face", "bull:8,2", "G0 X-10 Y10.1 Z15\nG1 X30\n", 20.0 * (40.0 - 8.0 * (1.0 - PI / 4.0))),
        ("chamfer", "chamfer:10,90", "G0 X-10 Y0 Z18\nG1 X30\n", 40.0),
        (
            "helix",
            "flat:6",
            "G0 X14 Y10 Z20\nG3 X14 Y10 I-4 Z17.5\nG3 X14 Y10 I-4 Z15\nG3 X14 Y10 I-4\n",
            PI * 48.0 * 5.0,
        ),
        // From the side, by a head that lies down.
        ("side", "flat:6", "G0 X-5 Y10.1 Z9.8 B-90\nG1 X7\n", PI * 9.0 * 7.0),
        // The same from the other side, in a tilted plane, and an edge that is cut off at 45°.
        (
            "tilted hole",
            "flat:6",
            "G68.2 X20 Y10.1 Z9.8 I90 J90 K0\nG53.1\nG0 X0 Y0 Z5\nG81 Z-7 R1\nG80\nG69\n",
            PI * 9.0 * 7.0,
        ),
        (
            "tilted face",
            "flat:20",
            "G68.2 P1 X17.03 Y0 Z20 J45\nG53.1\nG0 X2 Y-20 Z9\nZ0\nG1 Y40\n",
            20.0 * 0.5 * 2.97 * 2.97,
        ),
    ];
    for (name, tool, program, expected) in cases {
        let (program, out) = (dir.file("p.nc", program), dir.path("cut.brf"));
        let found = machine(&part, &program, &[tool], &out, &["--json"]).json();
        let (volume, error) =
            (found["removed_volume"].as_f64().unwrap(), found["removed_volume_error"].as_f64().unwrap());
        assert!((volume - expected).abs() <= error, "{name}: {volume} ± {error}, {expected}");
        assert!((volume / expected - 1.0).abs() <= 5e-4, "{name}: {volume}, {expected}");
        assert!((found["tools"][0]["volume"].as_f64().unwrap() - volume).abs() < 1e-9);
        let moves: f64 =
            found["by_move"].as_array().unwrap().iter().map(|m| m["volume"].as_f64().unwrap()).sum();
        assert!((moves / volume - 1.0).abs() < 1e-9, "{name}: {moves}");
        assert!(found["rapid_through_part"].as_array().unwrap().is_empty(), "{name}: {found}");
        // What is left and what is taken are the whole.
        let left = run(&[&"info", &out, &"--volume", &"--json"]).json();
        let left = left["volumes"]["union"].as_f64().unwrap();
        assert!((left + volume - whole).abs() < 2.0 * error, "{name}: {left} + {volume}, {whole}");
        run(&[&"verify", &out]).ok();
    }
    let mesh = dir.path("cut.stl");
    run(&[&"mesh", &dir.path("cut.brf"), &"-o", &mesh, &"--check", &"-q"]).ok();
}

#[test]
fn cl_files_subprograms_and_corrected_contours_cut_what_they_say() {
    let dir = Scratch::new();
    let (part, out) = (block(&dir, "0.2"), dir.path("cut.brf"));
    let cases = [
        (
            "slot.cls",
            "TLDATA/MILL,6.0,0.0,50.0,0.0,0.0\nLOAD/TOOL,2\nODDITY/3\nFROM/-10,10.03,25\nRAPID\nGOTO/-10,10.03,16\nGOTO/30,10.03,$\n16\nFINI\n",
            480.0,
        ),
        ("side.apt", "UNITS/INCHES\nCUTTER/0.25\nFROM/-0.2,0.4,0.4,-1,0,0\nGOTO/0.3,0.4,0.4\n", {
            PI * (0.125f64 * 25.4).powi(2) * 0.3 * 25.4
        }),
        (
            "steps.nc",
            "T1 M6\nG0 X-10 Y10.03 Z18\nM98 P1 L2\nM30\nO1\nG91 G1 Z-2\nX40\nG0 X-40\nG90\nM99\n",
            720.0,
        ),
        // Two steps by a loop that calls a macro.
        (
            "macro.nc",
            "T1 M6\nG0 X-10 Y10.03 Z20\n#1=18.\nWHILE [#1 GE 16] DO1\nG65 P9 Z#1\n#1=#1-2\nEND1\nM30\nO9\nG1 Z#26\nX30\nG0 X-10\nM99\n",
            480.0,
        ),
        // A boss of 12 mm is left; the tool reaches all around it.
        ("boss.nc", "T1 M6\nG0 X1 Y-20 Z15\nG41 D4 G1 X4 Y4\nY16\nX16\nY4\nX4\nG40 G0 Y-20\n", 256.0 * 5.0),
    ];
    for (name, program, expected) in cases {
        let program = dir.file(name, program);
        let tools: &[&str] = if name.ends_with(".nc") { &["1=flat:6mm"] } else { &[] };
        let found = machine(&part, &program, tools, &out, &["--json", "--radius", "4=3mm"]).json();
        let (volume, error) =
            (found["removed_volume"].as_f64().unwrap(), found["removed_volume_error"].as_f64().unwrap());
        assert!((volume - expected).abs() <= error, "{name}: {volume} ± {error}, {expected}");
        assert!((volume / expected - 1.0).abs() <= 2e-3, "{name}: {volume}, {expected}");
        let skipped = found["skipped_words"].as_object().unwrap();
        assert_eq!(skipped.get("ODDITY").and_then(|n| n.as_u64()), (name == "slot.cls").then_some(1));
    }
    let program = dir.file("turn.nc", "T1 M6\nG0 X10 Y10 Z30\nG1 Z18\nB8\nB0\nG0 Z30\n");
    let found = machine(&part, &program, &["1=ball:4mm,length=20mm"], &out, &["--json"]).json();
    // Eight steps of a degree, each a half of one off at most, at 20.1 mm from the tip.
    let expected = 20f64.hypot(2.0) * 0.5f64.to_radians();
    let turn_error = found["turn_error"].as_f64().unwrap();
    assert!((turn_error / expected - 1.0).abs() < 0.01, "{turn_error} {expected}");
    let told = machine(&part, &program, &["1=ball:4mm,length=20mm"], &out, &[]).ok();
    assert!(told.contains("steps of a turning tool within 0.17"), "{}", told);
    let refused = dir.file("refused.nc", "T1 M6\nG0 X1 Y-20 Z15\nG41 D5 G1 X4 Y4\n");
    let line = machine(&part, &refused, &["1=flat:6mm"], &out, &[]).failed();
    assert!(line.contains("refused.nc: line 3: ") && line.contains("--radius 5=5mm"), "{line}");
    machine(&part, &refused, &["1=flat:6mm"], &out, &["--radius", "x"]).misused();
}

#[test]
fn rapid_moves_through_the_part_are_told() {
    let dir = Scratch::new();
    let (part, out) = (block(&dir, "0.5"), dir.path("cut.brf"));
    let program =
        dir.file("p.nc", "G0 X-10 Y10 Z30\nX10\nG0 Z14\nG1 X30\nG0 Z40\nT2 M6\nG0 X5 Y5\nG1 Z10\nG0 Z40\n");
    let run = machine(&part, &program, &["flat:4", "2=ball:3"], &out, &["--json"]);
    assert!(run.stderr.contains("p.nc: line 3: a rapid move goes 6."), "{}", run.stderr);
    assert_eq!(run.stderr.lines().count(), 1, "{}", run.stderr);
    let found: serde_json::Value = serde_json::from_str(&run.stdout).unwrap();
    assert_eq!(found["rapid_through_part"][0]["line"].as_u64(), Some(3));
    let volumes: Vec<f64> = (0..2).map(|n| found["tools"][n]["volume"].as_f64().unwrap()).collect();
    // The round end of the slot stands in the middle.
    let slot = 6.0 * (4.0 * 10.0 + PI * 2.0);
    let hole = PI * 1.5 * 1.5 * 8.5 + 2.0 / 3.0 * PI * 1.5f64.powi(3);
    assert!((volumes[0] / slot - 1.0).abs() < 1e-2 && (volumes[1] / hole - 1.0).abs() < 2e-2, "{volumes:?}");
}

/// Balls that do not touch each other, on a grid, at random within their places.
fn balls(count: usize) -> Vec<([f64; 3], f64)> {
    let mut state = 1u64;
    let mut random = || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 33) as f64 / (1u64 << 31) as f64
    };
    let ball = |n: usize| {
        let radius = 0.8 + 0.6 * random();
        let place = [n % 5, n / 5 % 5, n / 25].map(|c| 4.0 * c as f64 + 2.0);
        let room = 1.6 - radius;
        (place.map(|c| c + room * (2.0 * random() - 1.0)), radius)
    };
    (0..count).map(ball).collect()
}

#[test]
fn voids_under_a_face_cut_are_classed_and_their_ligaments_told() {
    let dir = Scratch::new();
    let part = block(&dir, "0.2");
    let balls = balls(100);
    let holed = dir.path("holed.brf");
    let texts: Vec<String> = balls.iter().map(|([x, y, z], r)| format!("sphere {x},{y},{z},r{r}")).collect();
    let mut args: Vec<&dyn AsRef<std::ffi::OsStr>> = vec![&"csg", &part, &"-o", &holed, &"-q"];
    for text in &texts {
        args.push(&"--minus");
        args.push(text);
    }
    run(&args).ok();
    for height in [9.137, 6.02] {
        let program = dir.file("p.nc", format!("G0 X-40 Y10 Z30\nG0 Z{height}\nG1 X60 F500\nG0 Z30\n"));
        let (out, table) = (dir.path("cut.brf"), dir.path("opened.csv"));
        let voids = table.to_str().unwrap();
        machine(&holed, &program, &["flat:60"], &out, &["-q", "--voids", voids]).ok();
        let text = std::fs::read_to_string(&table).unwrap();
        let mut lines = text.lines();
        assert_eq!(lines.next(), Some("id,volume,state,ligament,move_first,x,y,z,line_first"));
        let mut counts = [0; 3];
        for line in lines {
            let cells: Vec<&str> = line.split(',').collect();
            let number = |n: usize| cells[n].parse::<f64>().unwrap_or_else(|_| panic!("{line}"));
            let at = [number(5), number(6), number(7)];
            let apart = |c: &[f64; 3]| (0..3).map(|a| (c[a] - at[a]).powi(2)).sum::<f64>();
            let (centre, radius) =
                balls.iter().min_by(|a, b| apart(&a.0).total_cmp(&apart(&b.0))).expect("there are some");
            assert!(apart(centre).sqrt() < 0.02, "{line}");
            let (top, bottom) = (centre[2] + radius, centre[2] - radius);
            let (state, place) = match () {
                () if top < height => ("untouched", 0),
                () if bottom > height => ("consumed", 2),
                () => ("opened", 1),
            };
            assert_eq!(cells[2], state, "{line}: {bottom} to {top}, {height}");
            counts[place] += 1;
            if state == "untouched" {
                assert!((number(3) - (height - top)).abs() < 0.02 * 0.2, "{line}: {}", height - top);
                assert_eq!((cells[4], cells[8]), ("", ""));
            } else {
                assert_eq!((cells[3], cells[4], cells[8]), ("", "2", "3"), "{line}");
            }
        }
        assert!(counts.iter().sum::<usize>() == 100 && counts.iter().all(|n| *n > 5), "{counts:?}");
    }
}

#[test]
fn bytes_do_not_depend_on_threads() {
    let dir = Scratch::new();
    let part = block(&dir, "0.4");
    let program = dir.file("p.nc", "G0 X-5 Y10 Z17\nG1 X10\nG2 X15 Y5 I5 J0\nG1 X25 Y-3 Z12\n");
    let (out, table) = (dir.path("cut.brf"), dir.path("v.json"));
    let voids = table.to_str().unwrap();
    let bytes = |threads: &str| {
        let run = machine(
            &part,
            &program,
            &["bull:6,1"],
            &out,
            &["--json", "--threads", threads, "--voids", voids],
        );
        let mut found = run.json();
        found["seconds"] = 0.into();
        found["phases"] = 0.into();
        (std::fs::read(&out).unwrap(), found.to_string())
    };
    let one = bytes("1");
    assert!(bytes("2") == one && bytes("3") == one);
}

#[test]
fn a_path_off_the_part_leaves_it_as_it_is() {
    let dir = Scratch::new();
    let (part, out) = (block(&dir, "0.5"), dir.path("cut.brf"));
    let program = dir.file("p.nc", "G0 X100 Y100 Z30\nG1 X120\n");
    let run = machine(&part, &program, &["flat:6"], &out, &[]);
    assert!(run.stderr.contains("never meet the part") && run.stderr.lines().count() == 1, "{}", run.stderr);
    let [one, other] = [&part, &out].map(|store| {
        let npy = dir.path("w.npy");
        crate::support::run(&[&"export", store, &"--level", &"1", &"-o", &npy, &"-q"]).ok();
        std::fs::read(npy).unwrap()
    });
    assert!(one == other);
}

#[test]
fn bad_programs_and_tools_are_refused_and_nothing_is_written() {
    let dir = Scratch::new();
    let (part, out) = (block(&dir, "0.5"), dir.path("cut.brf"));
    let good = dir.file("good.nc", "G0 X0 Y0 Z30\nG1 X5\n");
    machine(&part, &good, &["saw:6"], &out, &[]).misused();
    machine(&part, &good, &["flat:0"], &out, &[]).misused();
    let twice = machine(&part, &good, &["1=flat:6", "2=flat:3", "1=ball:6"], &out, &[]).misused();
    assert!(twice.contains("--tool 1=: is given twice"), "{twice}");
    let printed = dir.file("printed.nc", "G0 X0 Y0 Z30\nG1 X5 E0.2\n");
    let refused = machine(&part, &printed, &["flat:6"], &out, &[]).failed();
    assert!(refused.contains("printed.nc: line 2: ") && refused.contains("E0.2"), "{refused}");
    let unknown = machine(&part, &good, &[], &out, &[]).failed();
    assert!(
        unknown.contains("good.nc: line 2: moves with tool T0") && unknown.contains("--tool 0="),
        "{unknown}"
    );
    let bad = dir.file("bad.nc", "G0 X0 Y0 Z30\nG1 X5 Yoops\n");
    let refused = machine(&part, &bad, &["flat:6"], &out, &[]).failed();
    assert!(refused.contains("bad.nc: line 2: ") && refused.contains("Yoops"), "{refused}");
    let table = dir.file("tools.toml", "[tools]\n1 = \"saw:3\"\n");
    let refused = machine(&part, &good, &[], &out, &["--tools", table.to_str().unwrap()]).failed();
    assert!(refused.contains("tools.toml: tool 1"), "{refused}");
    let refused = machine(&part, &part, &["flat:6"], &out, &[]).failed();
    assert!(refused.contains("block.brf"), "{refused}");
    assert!(dir.names().iter().all(|name| !name.starts_with("cut")), "{:?}", dir.names());
}
