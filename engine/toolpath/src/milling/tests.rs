//! Programs with moves that are known.

use super::*;
use crate::error::Result;
use std::collections::BTreeMap;

pub(super) fn read_text(text: &str) -> Result<Program> {
    read_named("p.nc", text.as_bytes())
}

pub(super) fn read_named(name: &str, bytes: &[u8]) -> Result<Program> {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join(name);
    std::fs::write(&path, bytes).unwrap();
    let tool = Some("flat:6mm".parse().unwrap());
    read(
        &path,
        &ProgramOptions {
            tools: BTreeMap::new(),
            tool,
            radii: BTreeMap::from([(7, 2.0)]),
            arc_tolerance: 0.01,
            turn: 0.02,
            memory: 1 << 20,
        },
    )
}

/// The end of a move, with R if it is a rapid one.
pub(super) fn told(m: &Move) -> String {
    format!("{}{:?}", if m.rapid { "R" } else { "" }, m.to.map(|c| (c * 1e3).round() / 1e3))
}

/// Holds a file that cannot be followed against words by which that is told, in one line.
pub(super) fn is_refused(name: &str, text: &str, words: &[&str]) {
    let error = read_named(name, text.as_bytes()).unwrap_err().to_string();
    assert!(words.iter().all(|word| error.contains(word)), "{text}: {error}");
    assert_eq!(error.lines().count(), 1, "{text}: {error}");
}

/// Ends of moves.
pub(super) fn ends(text: &str) -> Vec<String> {
    let program = read_text(text).unwrap_or_else(|error| panic!("{error}"));
    program.moves.iter().map(told).collect()
}

#[test]
fn straight_moves_follow_units_offsets_and_modes() {
    assert_eq!(
        ends(
            "%\nO100 (part)\nN10 G21 G90 G17 G40 G49 G80\nG0 X0 Y0 Z5\nG1 Z-1 F100\nX10\nG91 Y5\nG90 G20 G0 Z1\nM30\nG1 X99\n"
        ),
        ["[0.0, 0.0, -1.0]", "[10.0, 0.0, -1.0]", "[10.0, 5.0, -1.0]", "R[10.0, 5.0, 25.4]"]
    );
    assert_eq!(
        ends("G10 L2 P2 X100 Y10 Z1\nG55 G0 X0 Y0 Z0\nX1\nG54 X1\nG59.3 X2\nG92 X7\nG1 X8\n"),
        ["R[101.0, 10.0, 1.0]", "R[1.0, 10.0, 1.0]", "R[2.0, 10.0, 1.0]", "[3.0, 10.0, 1.0]"]
    );
    // Home is nowhere: what leads there and back is left out.
    assert_eq!(ends("G0 X0 Y0 Z5\nG28 G91 Z0\nG90 G0 X5\nZ3\nG1 Z0\n"), ["[5.0, 0.0, 0.0]"]);
}

#[test]
fn arcs_lie_in_their_planes_and_rise() {
    let program = read_text("G0 X10 Y0 Z0\nG3 X-10 Y0 I-10 Z2\n").unwrap();
    for m in &program.moves {
        assert!((m.to[0].hypot(m.to[1]) - 10.0).abs() < 1e-9 && m.to[1] >= -1e-9, "{m:?}");
    }
    let middle = &program.moves[program.moves.len() / 2 - 1];
    assert!((middle.to[1] - 10.0).abs() < 1e-9 && (middle.to[2] - 1.0).abs() < 1e-9, "{middle:?}");
    // G18: counter-clockwise from z to x, seen against y.
    let program = read_text("G18 G0 X0 Y0 Z10\nG3 X10 Z0 R10\n").unwrap();
    assert!(program.moves.iter().all(|m| (m.to[0].hypot(m.to[2]) - 10.0).abs() < 1e-9 && m.to[0] >= 0.0));
    let program = read_text("G19 G0 X0 Y10 Z0\nG3 Y0 Z10 J-10\n").unwrap();
    assert!(program.moves.iter().all(|m| (m.to[1].hypot(m.to[2]) - 10.0).abs() < 1e-9 && m.to[2] >= -1e-9));
}

#[test]
fn cycles_drill_hole_by_hole() {
    assert_eq!(
        ends("G0 X0 Y0 Z10\nG99 G81 X5 Y5 Z-3 R1 F50\nX8\nG80\nG1 X9\n"),
        [
            "R[5.0, 5.0, 10.0]",
            "R[5.0, 5.0, 1.0]",
            "[5.0, 5.0, -3.0]",
            "R[5.0, 5.0, 1.0]",
            "R[8.0, 5.0, 1.0]",
            "R[8.0, 5.0, 1.0]",
            "[8.0, 5.0, -3.0]",
            "R[8.0, 5.0, 1.0]",
            "[9.0, 5.0, 1.0]"
        ]
        .into_iter()
        .filter(|_| true)
        .collect::<Vec<_>>()
    );
    // Taps and boring bars sweep what drills do.
    let drilled = ends("G0 X0 Y0 Z10\nG99 G81 X5 Y5 Z-3 R1 F50\nX8\n");
    for code in ["G73", "G74", "G82", "G83", "G84", "G85", "G86", "G88", "G89"] {
        assert_eq!(
            ends(&format!("G0 X0 Y0 Z10\nG99 {code} X5 Y5 Z-3 R1 P0.5 Q1 F50\nX8\n")),
            drilled,
            "{code}"
        );
    }
    // Relative, back to the start, twice.
    assert_eq!(
        ends("G0 X0 Y0 Z10\nG91 G98 G83 X1 Z-4 R-8 Q1 L2\n"),
        [
            "R[1.0, 0.0, 10.0]",
            "R[1.0, 0.0, 2.0]",
            "[1.0, 0.0, -2.0]",
            "R[1.0, 0.0, 10.0]",
            "R[2.0, 0.0, 10.0]",
            "R[2.0, 0.0, 2.0]",
            "[2.0, 0.0, -2.0]",
            "R[2.0, 0.0, 10.0]"
        ]
    );
}

#[test]
fn tools_come_from_options_and_comments() {
    let program =
        read_text("(T3 D=8. CR=1. - ZMIN=-5. - bullnose end mill)\nT3 M6\nG0 X0 Y0 Z0\nX1\nT4 M6\nX2\n")
            .unwrap();
    let tools: Vec<String> = program.tools.iter().map(|(n, tool)| format!("T{n} {tool}")).collect();
    assert_eq!(tools, ["T3 bull:8mm,1mm", "T4 flat:6mm"]);
    for (text, tool) in [
        ("T1 D=6. CR=3. - ZMIN=-2 - ball end mill", "ball:6mm"),
        ("T12 D=5. CR=0. TAPER=118deg - drill", "drill:5mm,118deg"),
        ("T2 D=10. CR=0. - face mill", "flat:10mm"),
    ] {
        assert_eq!(Tool::of_comment(text, 1.0).unwrap().1.to_string(), tool);
    }
    for wrong in ["ball", "ball:", "ball:-1", "saw:3", "bull:6,4", "drill:6,190", "chamfer:6,90,7"] {
        assert!(wrong.parse::<Tool>().is_err(), "{wrong}");
    }
    assert_eq!(
        "chamfer:0.5in,60deg,1mm,length=3cm".parse::<Tool>().unwrap().to_string(),
        "chamfer:12.7mm,60deg,1mm,length=30mm"
    );
}

#[test]
fn tools_named_in_front_of_the_unit_are_in_that_unit() {
    let program = |text: &str| {
        let text = format!("{text}T1 M6\nG0 X0 Y0 Z0\nX1\n");
        read_text(&text).unwrap().tools[0].1.to_string()
    };
    let named = "(T1 D=0.25 CR=0. - flat end mill)\n";
    assert_eq!(program(&format!("%\nO1 (PART)\n{named}G90 G17\nG20\n")), "flat:6.35mm");
    assert_eq!(program(&format!("{named}G21\n")), "flat:0.25mm");
    assert_eq!(program(named), "flat:0.25mm");
    // Behind it they are in the unit that counts there, whatever stands later.
    assert_eq!(program(&format!("G20\n{named}G21\n")), "flat:6.35mm");
    assert_eq!(program(&format!("G20 {named}")), "flat:6.35mm");
}

#[test]
fn lines_end_by_what_editors_write() {
    let text = "G21\nG0 X0 Y0 Z5\nG1 Z-1\nX10\n";
    for other in [
        text.replace('\n', "\r\n"),
        text.replace('\n', "\r"),
        format!("\u{feff}{text}"),
        text.replace('\n', "\r\r\n"),
    ] {
        assert_eq!(ends(&other), ends(text), "{other:?}");
    }
}

#[test]
fn exponents_and_filament_are_no_words_of_mills() {
    assert_eq!(ends("G0 X0 Y0 Z0\nX1.5e+01\nX1.2E-05 Y0\n"), ["R[15.0, 0.0, 0.0]", "R[0.0, 0.0, 0.0]"]);
    for line in ["X1.5E01", "X1e999", "X30 E0.4"] {
        let error = read_text(&format!("G0 X0 Y0 Z0\nG1 {line}\n")).unwrap_err().to_string();
        assert!(error.contains("line 2") && error.contains("no word of milling programs"), "{error}");
    }
}

#[test]
fn heads_turn_in_steps() {
    let program = read_text("G0 X0 Y0 Z0 B90\nX10\nG1 X0 B0\n").unwrap();
    assert!(program.moves[0].axis.iter().zip([1.0, 0.0, 0.0]).all(|(a, b)| (a - b).abs() < 1e-12));
    assert_eq!(program.moves.len(), 1 + 79);
    assert_eq!(program.turning_steps, 79);
}

#[test]
fn heads_turn_evenly_along_arcs() {
    // Around a cone: the tool leans toward the centre all the way, and each step turns it by a part of the whole.
    let program = read_text("G0 X10 Y0 Z0 B-30\nG3 X10 Y0 I-10 C360\nG1 X10 Y0 Z1\n").unwrap();
    let last = program.moves.len() - 1;
    assert!((program.moves[last].axis[0] + 0.5).abs() < 1e-12);
    let around = &program.moves[..last];
    let turned: f64 = around.iter().map(|m| m.turn).sum();
    assert!((turned - 2.0 * std::f64::consts::PI).abs() < 1e-9, "{turned}");
    for m in around {
        let middle = [0, 1].map(|a| (m.from[a] + m.to[a]) / 2.0);
        let radius = middle[0].hypot(middle[1]);
        let leans = [0, 1].map(|a| m.axis[a] + 0.5 * middle[a] / radius);
        assert!(leans.iter().all(|off| off.abs() < 1e-6), "{m:?}");
    }
}

#[test]
fn what_cannot_be_followed_names_line_and_word() {
    for (text, words) in [
        ("G0 X0 Y0 Z0\nG1 X\n", ["line 2", "\"X\" has no number"]),
        ("G0 X0 Y0 Z0\n\nG1 Xa5\n", ["line 3", "Xa5"]),
        ("G0 X0 Y0 Z0\nG41 X3 D3\n", ["line 2", "\"G41\" corrects for the radius D3"]),
        ("G0 X0 Y0 Z0\nG77 X3\n", ["line 2", "\"G77\" is not read"]),
        ("G1 X0 Y0 Z0\n", ["line 1", "\"G1\" cuts from a place"]),
        ("X3\n", ["line 1", "stand before any"]),
        ("G0 X0 Y0 Z0\nG2 X5 R1\n", ["line 2", "too short"]),
        ("G0 X0 Y0 Z0\nG1 X1 X2\n", ["line 2", "twice"]),
        ("G0 X0 Y0 Z0\nG81 X1 Z-3\n", ["line 2", "has no R"]),
        ("G0 X0 Y0 Z0\nG1 X#500\n", ["line 2", "X#500"]),
        ("(nothing)\n", ["end", "has no moves"]),
    ] {
        is_refused("p.nc", text, &words);
    }
}

#[test]
fn further_offsets_and_smoothing_are_read() {
    assert_eq!(
        ends(
            "G05.1 Q1 R5\nG05 P10000\nG08 P1\nG187 P2\nG0 X0 Y0 Z0\nG54.1 P3 X5\nG10 L2 P0 X100\nX5\nG154 P3 X6\nG54.1 P3 X7\nG52 X1\nX7\n"
        ),
        [
            "R[5.0, 0.0, 0.0]",
            "R[105.0, 0.0, 0.0]",
            "R[6.0, 0.0, 0.0]",
            "R[107.0, 0.0, 0.0]",
            "R[108.0, 0.0, 0.0]"
        ]
    );
    is_refused("p.nc", "G0 X0 Y0 Z0\nG54.1 X5\n", &["line 2", "needs P"]);
    is_refused("p.nc", "G0 X0 Y0 Z0\nG154 P100 X5\n", &["line 2", "from 1 to 99"]);
    is_refused("p.nc", "G0 X0 Y0 Z0\nG5.1 X5 Y5 I1 J2\n", &["line 2", "is not read"]);
    is_refused("p.nc", "G0 X0 Y0 Z0\nG68.2 I5\nG54.1 P1\n", &["line 3", "G69"]);
}

#[test]
fn local_zeros_add_to_all_offsets() {
    assert_eq!(
        ends("G10 L2 P2 X100\nG0 X0 Y0 Z0\nG52 X5 Y1\nG1 X1 Y0\nG55\nX1\nG52 X0\nX1\nG52 Y0\nG54 X2 Y0\n"),
        ["[6.0, 1.0, 0.0]", "[106.0, 1.0, 0.0]", "[101.0, 1.0, 0.0]", "[2.0, 0.0, 0.0]"]
    );
    // G92 names the place that the zero so moved has, and G52 moves that.
    assert_eq!(
        ends("G0 X0 Y0 Z0\nG52 X5\nG92 X0\nG1 X1\nG52 X7\nX1\nG92.1\nX1\n"),
        ["[1.0, 0.0, 0.0]", "[3.0, 0.0, 0.0]", "[8.0, 0.0, 0.0]"]
    );
}

#[test]
fn rotations_turn_places_increments_centres_and_holes() {
    assert_eq!(
        ends("G0 X1 Y1 Z0\nG68 X1 Y1 R90\nG1 X3\nG91 Y1\nG90 Z-1\nG69\nX5\n"),
        ["[1.0, 3.0, 0.0]", "[0.0, 3.0, 0.0]", "[0.0, 3.0, -1.0]", "[5.0, 3.0, -1.0]"]
    );
    // Every move of a part, turned about a point of a moved zero, is the turned move.
    let part = "G1 X4 Y0\nG3 X0 Y4 I-4 J0\nG2 X4 Y0 R-4\nG91 G1 X1 Y2\nG90 G90.1 G3 X-3 Y2 I1 J2\nG90.1\nG0 Z3\nG99 G81 X1 Y1 Z-2 R1\nX7\nG80\n";
    let read =
        |turn: &str| read_text(&format!("G52 X2 Y-1\nG0 X4 Y0 Z0\n{turn}{part}G69\nG0 X0 Y0\n")).unwrap();
    let (plain, turned) = (read(""), read("G68 X1 Y2 R30.5\nG0 X4 Y0\n"));
    let (sin, cos) = 30.5f64.to_radians().sin_cos();
    let expected = |[x, y, z]: [f64; 3]| {
        let [x, y] = [x - 3.0, y - 1.0];
        [3.0 + cos * x - sin * y, 1.0 + sin * x + cos * y, z]
    };
    assert_eq!(plain.moves.len() + 1, turned.moves.len());
    let pairs = plain.moves.iter().zip(&turned.moves[1..]);
    for (plain, turned) in pairs.take(plain.moves.len() - 1) {
        let wrong = (0..3).map(|a| (expected(plain.to)[a] - turned.to[a]).abs()).fold(0.0, f64::max);
        assert!(wrong < 1e-9 && plain.rapid == turned.rapid, "{plain:?} {turned:?}");
    }
    assert_eq!(plain.moves.last().unwrap().to, turned.moves.last().unwrap().to);
}

#[test]
fn rotations_that_cannot_be_followed_are_told() {
    for (text, words) in [
        ("G0 X0 Y0 Z0\nG68 X1 Y1\n", ["line 2", "has no R"]),
        ("G0 X0 Y0 Z0\nG91\nG68 X1 Y1 R5\n", ["line 3", "with G91"]),
        ("G18\nG68 X1 Y1 R5\n", ["line 2", "another plane"]),
        ("G68 R5\n", ["line 1", "does not tell"]),
        ("G0 X0 Y0 Z0\nG68 R5\nG55\n", ["line 3", "G69"]),
        ("G0 X0 Y0 Z0\nG68 R5\nG68 R6\n", ["line 3", "G69"]),
        ("G0 X0 Y0 Z0\nG68 R5\nG18\n", ["line 3", "G69"]),
        ("G0 Z0\nG68 X0 Y0 R5\nG1 X5\n", ["line 3", "does not tell"]),
    ] {
        is_refused("p.nc", text, &words);
    }
}

#[test]
fn fine_boring_goes_where_drilling_does() {
    let holes = "X5 Y5 Z-3 R1 F50\nX8\nG80\n";
    let drilled = ends(&format!("G0 X0 Y0 Z10\nG98 G81 {holes}"));
    assert_eq!(ends(&format!("G0 X0 Y0 Z10\nG98 G76 Q0.1 {holes}")), drilled);
    let twice = |code: &str| ends(&format!("G0 X0 Y0 Z10\n{code} X5 Y5 Z-3 R1 K2\n"));
    assert_eq!(twice("G76 Q0.1"), twice("G81"));
    is_refused("p.nc", "G0 X0 Y0 Z10\nG76 P1 Z-9 I-1 J0.2 K1 Q30\n", &["cuts a thread"]);
}
