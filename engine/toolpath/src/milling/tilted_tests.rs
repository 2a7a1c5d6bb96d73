//! Tilted planes, against places that are computed by hand.

use super::tests::{ends, is_refused, read_text};

/// A plane with X along the part's Y, Y along its Z and Z along its X, from 10, 20, 30.
const SIDE: &str = "G68.2 X10 Y20 Z30 I90 J90 K0\nG53.1\n";

/// Directions of X and Z of a plane, by two moves within it.
fn axes(plane: &str) -> [[f64; 3]; 2] {
    let program =
        read_text(&format!("{plane}\nG53.1\nG0 X0 Y0 Z0\nX1\nX0 Z1\n")).unwrap_or_else(|e| panic!("{e}"));
    let [x, z] = [0, 1].map(|n| [0, 1, 2].map(|a| program.moves[n].to[a] - program.moves[0].from[a]));
    // The tool stands along Z.
    assert!((0..3).all(|a| (program.moves[0].axis[a] - z[a]).abs() < 1e-12), "{plane}");
    [x, z]
}

fn are_near(plane: &str, expected: [[f64; 3]; 2]) {
    let found = axes(plane);
    let wrong = (0..6).map(|n| (found[n / 3][n % 3] - expected[n / 3][n % 3]).abs()).fold(0.0, f64::max);
    assert!(wrong < 1e-12, "{plane}: {found:?} {expected:?}");
}

#[test]
fn euler_angles_turn_about_axes_that_have_turned() {
    assert_eq!(ends(&format!("{SIDE}G0 X0 Y0 Z0\nG1 X1 Y2 Z3\n")), ["[13.0, 21.0, 32.0]"]);
    assert_eq!(
        ends("G68.2 X10 Y20 Z30 I90 J90 K90\nG53.1\nG0 X0 Y0 Z0\nG1 X1 Y2 Z3\n"),
        ["[13.0, 18.0, 31.0]"]
    );
    let [(si, ci), (sj, cj), (sk, ck)] = [30f64, 40.0, 50.0].map(|angle| angle.to_radians().sin_cos());
    are_near(
        "G68.2 P0 I30 J40 K50",
        [[ci * ck - si * cj * sk, si * ck + ci * cj * sk, sj * sk], [si * sj, -ci * sj, cj]],
    );
}

#[test]
fn fixed_axes_points_and_vectors_tell_planes() {
    let [(si, ci), (sj, cj), (sk, ck)] = [30f64, 20.0, 10.0].map(|angle| angle.to_radians().sin_cos());
    // About X, then Y.
    are_near("G68.2 P1 I30 J20", [[cj, 0.0, -sj], [ci * sj, -si, ci * cj]]);
    // About Z, then Y, then X, whichever word stands first.
    are_near(
        "G68.2 P1 Q321 K10 J20 I30",
        [[cj * ck, ci * sk + si * sj * ck, si * sk - ci * sj * ck], [sj, -si * cj, ci * cj]],
    );
    let points = "G68.2 P2 Q1 X10 Y20 Z30\nG68.2 P2 Q2 X10 Y25 Z30\n(side)\nG68.2 P2 Q3 X10 Y7 Z31\n";
    assert_eq!(ends(&format!("{points}G53.1\nG0 X0 Y0 Z0\nG1 X1 Y2 Z3\n")), ["[13.0, 21.0, 32.0]"]);
    // Turned about its Z by a right angle.
    assert_eq!(
        ends(&format!("G68.2 P2 Q0 X0 Y0 Z0 R90\n{points}G53.1\nG0 X0 Y0 Z0\nG1 X1 Y2 Z3\n")),
        ["[13.0, 18.0, 31.0]"]
    );
    let vectors = "G68.2 P3 Q1 X10 Y20 Z30 I0 J2 K0\nG68.2 P3 Q2 I5 J0 K0\n";
    assert_eq!(ends(&format!("{vectors}G53.1\nG0 X0 Y0 Z0\nG1 X1 Y2 Z3\n")), ["[13.0, 21.0, 32.0]"]);
    // Not quite square: Z counts.
    let rounded = axes("G68.2 P3 Q1 X0 Y0 Z0 I0.001 J1 K0\nG68.2 P3 Q2 I1 J0 K0");
    assert_eq!(rounded, [[0.0, 1.0, 0.0], [1.0, 0.0, 0.0]]);
}

#[test]
fn planes_lie_in_work_offsets_and_in_planes() {
    let moved = "G10 L2 P2 X100 Y0 Z5\nG55\nG52 Y7\n";
    assert_eq!(
        ends(&format!("{moved}{SIDE}G0 X0 Y0 Z0\nG1 X1 Y2 Z3\nG69\nG0 X0 Y0 Z0\nG1 X1\n")),
        ["[113.0, 28.0, 37.0]", "R[100.0, 7.0, 5.0]", "[101.0, 7.0, 5.0]"]
    );
    // In inches, and with G91, which does not count for the plane.
    assert_eq!(
        ends("G20 G91\nG68.2 X1 I90 J90\nG53.1\nG90 G0 X0 Y0 Z0\nG91 G1 Z1\nX1\n"),
        ["[50.8, 0.0, 0.0]", "[50.8, 25.4, 0.0]"]
    );
    // A step of 3 along the plane's own Y, and back to its old X by a turn.
    assert_eq!(
        ends(&format!("{SIDE}G68.4 X0 Y3 Z0 I0 J-90 K0\nG53.1\nG0 X0 Y0 Z0\nG1 X1 Y2 Z3\nG69\nX0\n")),
        ["[8.0, 21.0, 36.0]", "[0.0, 21.0, 36.0]"]
    );
}

#[test]
fn arcs_holes_and_contours_lie_in_the_plane() {
    let part = "G1 X4 Y0\nG3 X0 Y4 I-4 J0\nG18 G2 X4 Z4 R4\nG19 G3 Y0 Z0 J-4\nG17 G99 G81 X1 Y1 Z-2 R1\nX7\nG80\nG41 D7 G1 X0 Y0\nY10\nX10\nG40 G0 Y-5\n";
    let plain = read_text(&format!("G0 X4 Y0 Z0\n{part}")).unwrap();
    let tilted = read_text(&format!("{SIDE}G0 X4 Y0 Z0\n{part}")).unwrap();
    assert_eq!(plain.moves.len(), tilted.moves.len());
    for (plain, tilted) in plain.moves.iter().zip(&tilted.moves) {
        let [x, y, z] = plain.to;
        let wrong = [z + 10.0, x + 20.0, y + 30.0].into_iter().zip(tilted.to).map(|(p, q)| (p - q).abs());
        assert!(wrong.fold(0.0, f64::max) < 1e-9 && plain.rapid == tilted.rapid, "{plain:?} {tilted:?}");
        assert_eq!((plain.axis, tilted.axis), ([0.0, 0.0, 1.0], [1.0, 0.0, 0.0]));
    }
}

#[test]
fn the_tool_turns_by_its_own_lines() {
    let axes = |text: &str| -> Vec<[f64; 3]> {
        read_text(text).unwrap_or_else(|e| panic!("{e}")).moves.iter().map(|m| m.axis).collect()
    };
    let plane = "G68.2 X10 Y20 Z30 I90 J90 K0\n";
    // Without G53.1 it stands as before, and the tip stays where it is.
    assert_eq!(ends(&format!("G0 X0 Y0 Z0\n{plane}G1 X1 Y2 Z3\n")), ["[13.0, 21.0, 32.0]"]);
    assert_eq!(axes(&format!("G0 X0 Y0 Z0\n{plane}G1 X1 Y2 Z3\n")), [[0.0, 0.0, 1.0]]);
    // G53.6 keeps the tip, G53.1 does not.
    let kept = read_text(&format!("G0 X1 Y2 Z3\n{plane}G53.6\nG1 X0\n")).unwrap().moves;
    assert_eq!(
        (kept[0].from, kept[0].to, kept[0].axis),
        ([1.0, 2.0, 3.0], [1.0, 20.0, 3.0], [1.0, 0.0, 0.0])
    );
    is_refused("p.nc", &format!("G0 X0 Y0 Z0\n{plane}G53.1\nG1 X1\n"), &["line 4", "cuts from a place"]);
    // It keeps its axis after G69 until words turn it back, on the way from no place that is known.
    let back = format!("{SIDE}G0 X0 Y0 Z0\nZ1\nG69\nX50\nG0 B0 C0\nX0 Y0 Z9\nG1 Z8\n");
    let program = read_text(&back).unwrap();
    let axes_of: Vec<[f64; 3]> = program.moves.iter().map(|m| m.axis).collect();
    assert_eq!(axes_of, [[1.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]);
    assert_eq!(program.unplaced, 2);
    for home in ["G91 G28 B0 C0\nG90", "G53 G0 A0 C0"] {
        let back = format!("{SIDE}G0 X0 Y0 Z0\nZ1\nG69\n{home}\nG0 X0 Y0 Z9\nG1 Z8\n");
        assert_eq!(axes(&back), [[1.0, 0.0, 0.0], [0.0, 0.0, 1.0]], "{home}");
    }
    // Home along the machine's Z leaves the plane's places untold.
    let home = "G28 G91 Z0\nG90\n";
    is_refused(
        "p.nc",
        &format!("{plane}G0 X0 Y0 Z0\n{home}G0 X1\nG1 Z0\n"),
        &["line 6", "cuts from a place that the program does not tell"],
    );
    assert_eq!(
        ends(&format!("{SIDE}G0 X0 Y0 Z0\n{home}G0 X5\nY6\nZ3\nG1 Z0\n")),
        ["R[13.0, 25.0, 36.0]", "[10.0, 25.0, 36.0]"]
    );
}

#[test]
fn planes_that_cannot_be_followed_are_told() {
    let at = |text: &str| format!("G0 X0 Y0 Z0\n{text}\n");
    for (text, words) in [
        ("G68.2 P4 I1 J2 K3", ["line 2", "angles of projection"]),
        ("G68.2 P5", ["line 2", "has a P"]),
        ("G68.2 I1 R5", ["line 2", "\"R\" is no word of G68.2"]),
        ("G68.2 I1 A5", ["line 2", "\"A\" is no word of G68.2"]),
        ("G68.2 P1 Q113 I5", ["line 2", "no order of three axes"]),
        ("G68.2 P2 Q0 X1 Y0 Z0", ["line 2", "different ways"]),
        ("G68.2 P2 Q1 X1 Y0", ["line 2", "without X, Y and Z"]),
        ("G68.2 P2 Q2 X1 Y0 Z0", ["line 2", "Q1 should stand here"]),
        ("G68.2 P2 Q1 X1 Y0 Z0\nG68.2 P3 Q1 I1", ["line 3", "another plane"]),
        ("G68.2 P2 Q1 X1 Y0 Z0\nG0 X1", ["line 3", "another line"]),
        ("G68.2 P2 Q1 X0 Y0 Z0\nG68.2 P2 Q2 X1 Y1 Z1\nG68.2 P2 Q3 X2 Y2 Z2", ["line 4", "on a line"]),
        ("G68.2 P3 Q1 I1\nG68.2 P3 Q2 I0.1 K1", ["line 3", "not square"]),
        ("G68.2 P3 Q2 K1", ["line 2", "out of order"]),
        ("G68.2 X2000000", ["line 2", "out of range"]),
        ("G68.3 X0 Y0 Z0", ["line 2", "from the axis of the tool"]),
        ("G68.4 I5", ["line 2", "no tilted plane"]),
        ("G53.1", ["line 2", "no tilted plane"]),
        ("G68.2 I5\nG53.1 X3", ["line 3", "beside it"]),
        ("G68.2 I5\nG68.2 I6", ["line 3", "G69"]),
        ("G68.2 I5\nG55", ["line 3", "G69"]),
        ("G68.2 I5\nG52 X1", ["line 3", "G69"]),
        ("G68.2 I5\nG68 X0 Y0 R5", ["line 3", "G69"]),
        ("G68 X0 Y0 R5\nG68.2 I5", ["line 3", "G69"]),
        ("G68 X0 Y0 Z0 I0 J1 K0 R5", ["line 2", "axis in space"]),
        ("G81 Z-1 R1\nG68.2 I5", ["line 3", "G80"]),
        ("G68.2 J5\nG53.1\nG0 C5", ["line 4", "name both axes"]),
        ("G68.2 J5\nG53.1\nG1 B0", ["line 4", "by G0"]),
        ("G41 D7 X9\nG68.2 I5", ["line 3", "G40"]),
        ("G30 B0", ["line 2", "no program tells"]),
        ("G68.2 X900000 I5\nG0 X900000", ["line 3", "out of range"]),
        ("G254", ["line 2", "is not read"]),
        ("CYCLE800(1)", ["line 2", "CYCLE800"]),
    ] {
        is_refused("p.nc", &at(text), &words);
    }
}
