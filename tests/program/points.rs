//! `brickfield sample` and `brickfield winding`: points in, values out.

use crate::support::*;

#[test]
fn csv_and_json_lines() {
    let dir = Scratch::new();
    let store = dir.store("overlap_boxes", 1);
    let input = "\u{feff}# two inside, one far away\r\n\r\nx, y ,z\r\n5,5,5\r\n 8 , 5e0,+5\r\n-1e9,0,0";
    let expected = "x,y,z,w\n5.0,5.0,5.0,1\n8.0,5.0,5.0,2\n-1000000000.0,0.0,0.0,0\n";
    assert_eq!(run_with(&[&"sample", &store, &"--points", &"-"], input).ok(), expected);
    assert_eq!(run_with(&[&"winding", &stl("overlap_boxes"), &"--points", &"-"], input).ok(), expected);
    // What was printed is a legal input.
    let file = dir.file("p.csv", expected);
    assert_eq!(run(&[&"sample", &store, &"--points", &file]).ok(), expected);
    let json = run(&[&"sample", &store, &"--points", &file, &"--json"]).ok();
    let rows: Vec<serde_json::Value> = json.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    assert_eq!(rows.len(), 3);
    assert_eq!((&rows[1]["x"], &rows[1]["w"]), (&8.0.into(), &2.into()));
    assert_eq!(run_with(&[&"sample", &store, &"--points", &"-"], "").ok(), "x,y,z,w\n");
}

#[test]
fn malformed_points_name_file_and_line() {
    let dir = Scratch::new();
    let store = dir.store("overlap_boxes", 1);
    let long = format!("1,2,3\n{}", "1".repeat(10_000));
    for (content, line, what) in [
        ("1,2,3\n1,2\n", 2, "3 values"),
        ("1,2,3,4\n", 1, "3 values"),
        ("x,y,z\n1,2,3\n\n1;2;3\n", 4, "3 values"),
        ("1,2,three\n", 1, "\"three\""),
        ("1,2,nan\n", 1, "\"nan\""),
        ("x,y,z\nx,y,z\n", 2, "\"x\""),
        ("x,y,z,w\n1,2,3\n", 2, "4 values"),
        (long.as_str(), 2, "too long"),
    ] {
        let file = dir.file("p.csv", content);
        for source in [&"sample" as &dyn AsRef<std::ffi::OsStr>, &"winding"] {
            let input = if source.as_ref() == "sample" { store.clone() } else { stl("overlap_boxes") };
            let ran = run(&[source, &input, &"--points", &file]);
            assert_eq!(ran.status, Some(1), "{content:?}");
            let text = ran.stderr;
            assert!(text.contains(&format!("p.csv: line {line}: ")) && text.contains(what), "{text}");
            assert_eq!(text.lines().count(), 1);
        }
    }
    let line = run(&[&"winding", &stl("overlap_boxes"), &"--points", &dir.path("none.csv")]).failed();
    assert!(line.contains("none.csv"), "{line}");
}

#[test]
fn crossings_and_solid_angles_agree() {
    let csv: String = (0..200)
        .map(|i| {
            format!("{},{},{}\n", (i * 37 % 100) as f64 * 0.7 - 2.0, (i * 61 % 100) as f64 * 0.3, i % 23)
        })
        .collect();
    let args: [&dyn AsRef<std::ffi::OsStr>; 4] = [&"winding", &stl("void_ladder"), &"--points", &"-"];
    let values = |text: String| -> Vec<f64> {
        text.lines().skip(1).map(|line| line.rsplit(',').next().unwrap().parse().unwrap()).collect()
    };
    let exact = values(run_with(&args, &csv).ok());
    let brute = values(run_with(&[&args[..], &[&"--brute"]].concat(), &csv).ok());
    let (mut inside, mut compared) = (0, 0);
    for (a, b) in exact.iter().zip(brute) {
        // On a face the sum is half-way; the crossings take a side.
        if (b - b.round()).abs() < 1e-3 {
            assert_eq!(*a, b.round());
            compared += 1;
            inside += usize::from(*a == 1.0);
        }
    }
    assert!(inside > 20 && compared > 150, "{inside} {compared}");
}
