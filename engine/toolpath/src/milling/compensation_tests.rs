//! Contours that are corrected for the tool's radius; D7 is 2 mm in the tests.

use super::tests::{ends, is_refused, read_text};

/// The least distance of a place from segments.
fn away(at: [f64; 3], segments: &[[[f64; 2]; 2]]) -> f64 {
    let one = |[a, b]: &[[f64; 2]; 2]| {
        let (p, q) = ([b[0] - a[0], b[1] - a[1]], [at[0] - a[0], at[1] - a[1]]);
        let t = ((p[0] * q[0] + p[1] * q[1]) / (p[0] * p[0] + p[1] * p[1])).clamp(0.0, 1.0);
        (q[0] - p[0] * t).hypot(q[1] - p[1] * t)
    };
    segments.iter().map(one).fold(f64::INFINITY, f64::min)
}

#[test]
fn a_square_is_cut_outside_and_inside() {
    // Clockwise with the tool on the left is outside.
    let square = "G1 X0 Y10\nX10\nY0\nX0\nG40 X-5 Y-5\n";
    let outside = ends(&format!("G0 X-9 Y0 Z0\nG41 D7 G1 X0 Y0\n{square}"));
    assert_eq!(outside[..2], ["[-2.0, 0.0, 0.0]", "[-2.0, 10.0, 0.0]"]);
    assert_eq!(outside[outside.len() - 2..], ["[0.0, -2.0, 0.0]", "[-5.0, -5.0, 0.0]"]);
    let program = read_text(&format!("G0 X-9 Y0 Z0\nG41 D7 G1 X0 Y0\n{square}")).unwrap();
    let sides = [[0.0, 0.0], [0.0, 10.0], [10.0, 10.0], [10.0, 0.0], [0.0, 0.0]];
    let sides: Vec<[[f64; 2]; 2]> = sides.windows(2).map(|pair| [pair[0], pair[1]]).collect();
    for m in &program.moves[1..program.moves.len() - 1] {
        // Always a radius away from it: at ends exactly, between them within the chords.
        assert!((away(m.to, &sides) - 2.0).abs() < 1e-9, "{m:?}");
        let middle = [0, 1, 2].map(|a| (m.from[a] + m.to[a]) * 0.5);
        assert!((away(middle, &sides) - 2.0).abs() < 0.0101, "{m:?}");
    }
    let inside = ends(&format!("G0 X5 Y5 Z0\nG42 D7 G1 X0 Y0\n{square}"));
    assert_eq!(
        inside,
        [
            "[2.0, 0.0, 0.0]",
            "[2.0, 8.0, 0.0]",
            "[8.0, 8.0, 0.0]",
            "[8.0, 2.0, 0.0]",
            "[0.0, 2.0, 0.0]",
            "[-5.0, -5.0, 0.0]"
        ]
    );
    // The same by the diameter, by a table that the program sets, and not at all.
    let by = |words: &str| ends(&format!("G0 X5 Y5 Z0\n{words} G1 X0 Y0\n{square}"));
    assert_eq!(by("G42.1 D4"), inside);
    assert_eq!(by("G10 L12 P9 R2\nG42 D9"), inside);
    assert_eq!(by("G42 D0"), by("G40"));
}

#[test]
fn arcs_move_with_their_radius_and_meet_lines() {
    // A circle of 10 mm from inside and from outside, led to along its radius.
    for (words, radius) in [("G41 D7", 8.0), ("G42 D7", 12.0)] {
        let program =
            read_text(&format!("G0 X20 Y0 Z0\n{words} G1 X10 Y0\nG3 X10 Y0 I-10\nG40 G1 X20\n")).unwrap();
        let arc = &program.moves[1..program.moves.len() - 1];
        assert!(arc.len() > 20 && arc.iter().all(|m| (m.to[0].hypot(m.to[1]) - radius).abs() < 1e-9));
    }
    // A line into an arc that it does not touch evenly: both end where they meet.
    let program =
        read_text("G0 X-20 Y9 Z0\nG41 D7 G1 X-20 Y0\nX0\nG3 X20 Y20 I0 J20\nG1 X0\nG40 Y50\n").unwrap();
    let meets = |m: &&super::Move| {
        (m.to[1] - 18.0).abs() < 1e-9 && (m.to[0].hypot(m.to[1] - 20.0) - 18.0).abs() < 0.02
    };
    assert_eq!(program.moves.iter().filter(meets).count(), 1, "{:?}", program.moves);
    // Down and up beside the contour.
    let steps = ends("G0 X0 Y9 Z5\nG41 D7 G1 X0 Y0\nZ-1\nX10\nZ5\nG40 G0 Y9\n");
    assert_eq!(
        steps,
        ["[0.0, 2.0, 5.0]", "[0.0, 2.0, -1.0]", "[10.0, 2.0, -1.0]", "[10.0, 2.0, 5.0]", "R[10.0, 9.0, 5.0]"]
    );
}

#[test]
fn corrections_that_cannot_be_followed_are_told() {
    for (text, words) in [
        ("G0 X0 Y0 Z0\nG41 D3 G1 X5\n", ["line 2", "`radius` 3=5mm"]),
        ("G0 X0 Y0 Z0\nG41 D7\nG2 X5 Y5 I5\n", ["line 3", "begins with an arc"]),
        ("G0 X0 Y0 Z0\nG41 D7 G1 X5\nG42 X9\n", ["line 3", "changes side"]),
        ("G0 X0 Y0 Z0\nG41 D7 G1 X5\nG81 Z-1 R1\n", ["line 3", "\"G81\" stands within"]),
        ("G0 X0 Y0 Z0\nG41 D7 G1 X5\nT2 M6\n", ["line 3", "\"M6\" stands within"]),
        ("G0 X0 Y0 Z0\nG41 D7 G1 X5\nG55 X9\n", ["line 3", "\"G55\" stands within"]),
        ("G0 X0 Y0 Z0\nG18 G41 D7 G1 X5\n", ["line 2", "outside of the plane"]),
        ("G0 X0 Y0 Z0\nG41 D7 G1 X5\nX9 B5\n", ["line 3", "turn the tool"]),
        ("G0 X0 Y-9 Z0\nG41 D7 G1 Y0\nG3 X2 Y0 I1\nG40 Y9\n", ["line 3", "does not fit"]),
        ("G0 X0 Y9 Z0\nG41 D7 G1 Y0\nX9\nY1\nX0\nG40 Y9\n", ["line 4", "does not fit"]),
        ("G0 X0 Y9 Z0\nG41 D7 G1 Y0\nX9\nG40\nG2 X10 Y1 I1 J0\n", ["line 5", "follows G40"]),
    ] {
        is_refused("p.nc", text, &words);
    }
}
