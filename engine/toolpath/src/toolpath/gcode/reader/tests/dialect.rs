//! Constructs of the language, one by one: the dialect test with its oracle, and what it does not have.

use super::*;
use crate::toolpath::{Section, UP};

/// The dialect test's blocks, in order, with the lengths of its oracle (`dialect_torture.json`), derived by hand.
/// B, K and L make no bead.
const BLOCKS: [(char, f64); 16] = [
    ('A', 10.0),
    ('B', 0.0),
    ('C', 10.0),
    ('D', 7.853981633974483),
    ('E', 18.84955592153876),
    ('F', 7.853981633974483),
    ('G', 6.286367600161276),
    ('H', 20.0),
    ('I', 10.0),
    ('J', 10.0),
    ('K', 0.0),
    ('L', 0.0),
    ('M', 0.001),
    ('N', 9.998999999999999),
    ('O', 10.0),
    ('P', 10.00000032),
];

fn close(a: f64, b: f64) -> bool {
    (a - b).abs() < 1e-9
}

#[test]
fn every_block_of_the_dialect_test_has_its_length() {
    let text = std::fs::read_to_string(data("gcode/dialect_torture.gcode")).unwrap();
    let starts = BLOCKS.map(|(name, _)| text.find(&format!("; --- {name} ")).unwrap());
    let mut before = 0.0;
    for (i, (name, length)) in BLOCKS.into_iter().enumerate() {
        let end = starts.get(i + 1).copied().unwrap_or(text.len());
        let (report, _) = parse(&text[..end], &GcodeOptions::default()).unwrap();
        let so_far = report.length + report.arcs.length_lost;
        assert!(close(so_far - before, length), "{name}: {} instead of {length}", so_far - before);
        before = so_far;
    }
    assert!(close(before, 130.84388710964902));
}

#[test]
fn the_dialect_test_as_a_whole() {
    let options = GcodeOptions { arc_tolerance: Some(1e-6), ..GcodeOptions::default() };
    let (report, path) = load("gcode/dialect_torture.gcode", &options).unwrap();
    assert!((report.bead_volume - 12.561275171686997).abs() < 1e-6, "{}", report.bead_volume);
    assert_eq!((report.tools, report.beads, report.arcs.count), (vec![0, 1], 4, 4));
    let tools: Vec<u16> = (0..4).map(|bead| path.attributes(bead).tool).collect();
    assert_eq!(tools, [0, 0, 1, 0]);

    // The first bead runs from A to J: retraction, G92 and the change of width do not end it.
    let first = path.points(0);
    let last = first.len() - 1;
    assert_eq!([first[last - 1], first[last]], [[6.0, 20.0, 0.4], [6.0, 10.0, 0.4]]);
    let slim = Section { width: 0.5, height: 0.2 };
    assert_eq!(
        [path.section(0, last - 2), path.section(0, last - 1)],
        [slim, Section { width: 0.8, ..slim }]
    );
    // The second one steps by half a micrometre and turns back over itself.
    assert_eq!(path.points(1).len(), 5);
    assert_eq!([path.points(1)[3], path.points(1)[4]], [[5.0, 10.0, 0.4], [0.0, 10.0, 0.4]]);

    // E and G10 retract; blob L is E without motion. `*71` does not fit its line, whose bytes xor to 78.
    assert_eq!((report.retractions, report.blobs.count), (2, 1));
    assert_eq!(report.unknown, []);
    let warnings = report.notes.iter().map(|f| f.line).collect::<Vec<_>>();
    // After M83, G91 and G90 Marlin 2 counts E absolutely, others relatively.
    assert_eq!(warnings, [0, 22, 31], "{:?}", report.notes);
}

#[test]
fn chords_keep_to_a_hundredth_of_the_width() {
    let (report, path) = load("gcode/dialect_torture.gcode", &GcodeOptions::default()).unwrap();
    assert_eq!(report.arcs.tolerance, 0.005);
    assert!(report.arcs.length_lost > 0.0 && report.arcs.length_lost < 0.02, "{:?}", report.arcs);
    // Block E is a full circle about (12, 15).
    let on_circle = path.points(0).windows(2).filter(|p| {
        let centre = [12.0, 15.0];
        let radius = |q: [f64; 2]| ((q[0] - centre[0]).powi(2) + (q[1] - centre[1]).powi(2)).sqrt();
        let middle = [(p[0][0] + p[1][0]) / 2.0, (p[0][1] + p[1][1]) / 2.0];
        close(radius([p[0][0], p[0][1]]), 3.0) && 3.0 - radius(middle) <= 0.005 && 3.0 - radius(middle) > 0.0
    });
    assert!(on_circle.count() >= 32);
}

#[test]
fn heads_tilt() {
    let needs = load("gcode/five_axis_ded.gcode", &GcodeOptions::default()).unwrap_err().to_string();
    assert!(needs.contains("line 6") && needs.contains("`height`"), "{needs}");
    let options = GcodeOptions { width: Some(3.0), height: Some(1.0), ..GcodeOptions::default() };
    let (report, path) = load("gcode/five_axis_ded.gcode", &options).unwrap();
    assert_eq!((report.beads, report.segments, report.fed_volume), (1, 4, None));
    assert_eq!(path.attributes(0).fed, None);
    for point in 0..5 {
        let tilt = (10.0 * point as f64).to_radians();
        let axis = path.axis(0, point);
        for (found, expected) in axis.into_iter().zip([tilt.sin(), 0.0, tilt.cos()]) {
            assert!((found - expected).abs() < 1e-14, "{axis:?}");
        }
    }
}

#[test]
fn deposition_without_e_is_switched() {
    let needs = load("gcode/large_format.gcode", &GcodeOptions::default()).unwrap_err().to_string();
    assert!(needs.contains("line 6") && needs.contains("`width`"), "{needs}");
    let options = GcodeOptions { width: Some(20.0), ..GcodeOptions::default() };
    let (report, path) = load("gcode/large_format.gcode", &options).unwrap();
    assert_eq!((report.beads, report.segments, report.layers), (2, 6, 2));
    assert_eq!(path.points(0)[1], [40.0 * 25.4, 0.0, 0.2 * 25.4]);
    assert_eq!([0, 1].map(|bead| path.section(bead, 0)), [Section { width: 20.0, height: 5.08 }; 2]);
    assert!((report.length - 25.4 * (40.0 + 20.0 + 40.0 + 19.7 + 39.4 + 19.4)).abs() < 1e-9);
}

#[test]
fn walls_rise_within_a_bead() {
    let (report, path) = load("gcode/nonplanar.gcode", &GcodeOptions::default()).unwrap();
    assert_eq!((report.beads, report.segments, report.layers), (1, 800, 1));
    assert_eq!(path.points(0)[1], [0.5, 0.075, 0.201]);
    assert_eq!(path.axis(0, 400), UP);
}

#[test]
fn marks_and_line_ends_do_not_matter() {
    let (report, path) = load("gcode/bom_crlf.gcode", &GcodeOptions::default()).unwrap();
    assert_eq!((report.lines, report.segments), (8, 2));
    assert_eq!(path.points(0), [[0.0, 0.0, 0.3], [5.0, 0.0, 0.3], [5.0, 5.0, 0.3]]);
    assert_eq!(path.attributes(0).lines, (7, 8));
}

#[test]
fn heights_come_from_layers_and_never_from_hops() {
    let text = "M83\nG1 Z.3\nG1 X9 E1\nG1 Z1.5\nG1 X0 Y1\nG1 Z.3\nG1 X9 E1\nG1 Z.5\nG1 X0 E1\n\
                G1 Z.3\nG1 X30\nG1 X39 E1\nG1 Z.5\nG1 X30 E1\n";
    let (report, path) = parse(text, &GcodeOptions::default()).unwrap();
    let found: Vec<_> =
        (0..5).map(|bead| (path.section(bead, 0).height, path.attributes(bead).layer)).collect();
    // The last two belong to a second object, printed from the bed up again.
    assert_eq!(found, [(0.3, 0), (0.3, 0), (0.2, 1), (0.3, 2), (0.2, 3)]);
    assert_eq!(report.heights.step, 5);
}

#[test]
fn options_override_the_file() {
    let options = GcodeOptions {
        filament_diameter: Some(2.0),
        width: Some(2.0),
        height: Some(0.5),
        ..GcodeOptions::default()
    };
    let (report, path) = load("clover.gcode", &options).unwrap();
    assert_eq!(path.section(20, 5), Section { width: 2.0, height: 0.5 });
    assert_eq!((report.widths.option, report.heights.option), (report.segments, report.segments));
    let all = load("clover.gcode", &GcodeOptions::default()).unwrap().0.fed_volume.unwrap();
    assert!((report.fed_volume.unwrap() - all / 25.0).abs() < 1e-6);
}

#[test]
fn e_counts_volume_where_the_file_says_so() {
    for text in ["; use_volumetric_e = 1\nM83\nG1 Z1\nG1 X10 E20\n", "M200 D1.75\nM83\nG1 Z1\nG1 X10 E20\n"] {
        let (report, path) = parse(text, &GcodeOptions::default()).unwrap();
        assert_eq!(report.fed_volume, Some(20.0));
        assert!((path.section(0, 0).stadium_area() - 2.0).abs() < 1e-12);
    }
}

#[test]
fn modes_of_position_and_arcs() {
    let same = [
        "M83\nG90\nG1 X1 Y2 Z3\nG1 X4 Y6 E1\nG3 X4 Y10 I0 J2 E1\n",
        "g91m83g1x1y2z3\nx3y4e1\ng3y4j2e1",
        "G21 G90.1\nM83\nG1 X1 Y2 Z3\nG1 X4 Y6 E1\nG3 X4 Y10 I4 J8 E1\n",
        "M83\nG92 X11 Y22 Z33\nG1 X12 Y24 Z36\nG1 X15 Y28 E1\nG3 X15 Y32 R2 E1\n",
        "M82\nG28 X\nG1 X1 Y2 Z3\nG92 E7\nG1 X4 Y6 E8\nG3 X4 Y10 J2 E9 ; G1 X0\n",
        "G20\nM83\nG17\nG1 (inches) X0.03937007874015748 Y.07874015748031496 Z+0.11811023622047244\nG21\nG1 X4 Y6 E1\nN5 G03 X4 Y10 J2 E1",
    ];
    let expected = parse(same[0], &GcodeOptions::default()).unwrap().1;
    assert!(expected.points(0).len() > 20 && expected.len() == 1);
    for text in &same[1..] {
        let found = parse(text, &GcodeOptions::default()).unwrap().1;
        assert_eq!(found.points(0).len(), expected.points(0).len(), "{text}");
        for (a, b) in found.points(0).iter().zip(expected.points(0)) {
            assert!(a.iter().zip(b).all(|(a, b)| close(*a, *b)), "{text}: {a:?} instead of {b:?}");
        }
    }
}

#[test]
fn arcs_lie_in_any_plane() {
    for (plane, arc, middle) in [
        ("G17", "G2 X2 Y0 I1", [1.0, 1.0, 0.0]),
        ("G18", "G3 X2 Z0 I1", [1.0, 0.0, 1.0]),
        ("G19", "G2 Y2 Z0 J1", [0.0, 1.0, 1.0]),
    ] {
        let text = format!("M83\n;HEIGHT:1\n{plane}\n{arc} E1\n");
        let path = parse(text, &GcodeOptions::default()).unwrap().1;
        let points = path.points(0);
        let found = points[points.len() / 2];
        assert!(found.iter().zip(middle).all(|(a, b)| close(*a, b)), "{plane}: {found:?}");
    }
}
