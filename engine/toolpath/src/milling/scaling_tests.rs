//! Scales and mirrors, against places that are computed by hand and against the part itself.

use super::tests::{ends, is_refused, read_text};

#[test]
fn places_and_increments_grow_from_the_centre() {
    let start = "G0 X0 Y0 Z0\n";
    assert_eq!(
        ends(&format!("{start}G51 X10 Y0 Z0 P2.\nG1 X20 Y5 Z-1\nG91 X1 Z-1\nG90 G50\nX7\n")),
        ["[30.0, 10.0, -2.0]", "[32.0, 10.0, -4.0]", "[7.0, 10.0, -4.0]"]
    );
    // Thousandths, about the present place, within a work offset.
    assert_eq!(ends("G10 L2 P1 X100\nG0 X4 Y2 Z0\nG51 P500\nG1 X8 Y4\n"), ["[106.0, 3.0, 0.0]"]);
    // Factors of their own; what is not named keeps its place.
    assert_eq!(
        ends(&format!("{start}G51 X1 Y1 I3. J0.5\nG1 X2\nY5\nZ2\n")),
        ["[4.0, 0.0, 0.0]", "[4.0, 3.0, 0.0]", "[4.0, 3.0, 2.0]"]
    );
    assert_eq!(ends(&format!("{start}G51 X10 I-1000\nG1 X12 Y3\n")), ["[8.0, 3.0, 0.0]"]);
    assert_eq!(
        ends(&format!("{start}G51.1 X10 Y1\nG1 X12 Y3\nG50.1 Y0\nY4\nG50.1\nX12\n")),
        ["[8.0, -1.0, 0.0]", "[8.0, 4.0, 0.0]", "[12.0, 4.0, 0.0]"]
    );
}

#[test]
fn mirrors_count_first_then_scales_then_rotations() {
    let start = "G0 X0 Y0 Z0\n";
    assert_eq!(
        ends(&format!("{start}G51.1 X10\nG51 X20 Y0 P2.\nG1 X12 Y3\nG50\nG50.1\nX1\n")),
        ["[16.0, 6.0, 0.0]", "[1.0, 6.0, 0.0]"]
    );
    // The centre of the rotation, 5 0, is scaled, and its angle is not.
    assert_eq!(
        ends(&format!("{start}G51 X0 Y0 P2.\nG68 X5 Y0 R90\nG1 X6 Y1\nG69\nX1\nG50\nX1\n")),
        ["[8.0, 2.0, 0.0]", "[2.0, 2.0, 0.0]", "[1.0, 2.0, 0.0]"]
    );
}

#[test]
fn a_part_is_the_mirrored_or_scaled_one() {
    let part = "G1 X4 Y0\nG3 X0 Y4 I-4 J0\nG2 X4 Y0 R-4\nG91 G1 X1 Y2\nG90 G90.1 G3 X-1 Y2 I2 J2 Z-1\nG91.1 G3 I2\nG90 G99 G81 X1 Y1 Z-2 R1\nX7\nG80\nG41 D7 G1 X0 Y0\nY10\nX10\nG2 X20 Y0 J-10\nG40 G0 Y-5\n";
    let read = |frame: &str| read_text(&format!("G0 X4 Y0 Z0\n{frame}G0 X4 Y0\n{part}")).unwrap().moves;
    let plain = read("");
    type Image = fn([f64; 3]) -> [f64; 3];
    let frames: [(&str, Image); 4] = [
        ("G51.1 X3\n", |[x, y, z]| [6.0 - x, y, z]),
        ("G51.1 X3 Y-2\n", |[x, y, z]| [6.0 - x, -4.0 - y, z]),
        ("G51 X0 Y1 I1. J-1.\n", |[x, y, z]| [x, 2.0 - y, z]),
        ("G51.1 X3\nG51 Y1 J-1000\n", |[x, y, z]| [6.0 - x, 2.0 - y, z]),
    ];
    for (frame, image) in frames {
        let found = read(frame);
        assert_eq!(found.len(), plain.len(), "{frame}");
        for (plain, found) in plain.iter().zip(&found).skip(1) {
            let expected = image(plain.to);
            let wrong = (0..3).map(|a| (expected[a] - found.to[a]).abs()).fold(0.0, f64::max);
            assert!(wrong < 1e-9 && plain.rapid == found.rapid, "{frame}: {plain:?} {found:?}");
        }
    }
    // Arcs of twice the size, in G18 too, with as many chords as their own tolerance asks.
    for text in ["G3 X-10 Y0 I-10\n", "G3 X-10 Y0 R10\n", "G18 G2 X-10 Z0 I-10\n", "G18 G2 X-10 Z0 R10\n"] {
        let moves =
            read_text(&format!("G0 X10 Y0 Z0\nG51 X0 Y0 Z0 P2.\nG0 X10 Y0 Z0\n{text}")).unwrap().moves;
        let reach = |m: &super::Move| (m.to[0].powi(2) + m.to[1].powi(2) + m.to[2].powi(2)).sqrt();
        assert!(moves.len() > 8 && moves.iter().all(|m| (reach(m) - 20.0).abs() < 1e-9), "{text}");
    }
}

#[test]
fn scales_that_cannot_be_followed_are_told() {
    for (text, words) in [
        ("G51 X0 Y0 P2", ["line 2", "\"P2\" is a factor without a decimal point"]),
        ("G51 X0 Y0 P200000", ["line 2", "whose unit cannot be told"]),
        ("G51 X0 Y0 P0.", ["line 2", "no factor"]),
        ("G51 X0 Y0 P-1.", ["line 2", "no factor"]),
        ("G51 X0 Y0", ["line 2", "needs P"]),
        ("G51 X0 P2. I2.", ["line 2", "not both"]),
        ("G51 X0 Y0 I2.", ["line 2", "without its factor"]),
        ("G51 X0 P2. R4", ["line 2", "\"R\" is no word"]),
        ("G28 X0\nG51 P2.", ["line 3", "does not tell"]),
        ("G91 G51 X0 P2.", ["line 2", "G91"]),
        ("G51 X0 Y0 I2. J1.\nG2 X4 I2", ["line 3", "not the same along both axes"]),
        ("G52 X5 G92 X1", ["line 2", "twice"]),
        ("G52 X5 G68 R30", ["line 2", "\"G68\" stands beside"]),
        ("G51 P2.\nG51 P3.", ["line 3", "G50"]),
        ("G51 P2.\nG52 X3", ["line 3", "G50"]),
        ("G51 P2.\nG51.1 X3", ["line 3", "G50"]),
        ("G51 P2.\nG68.2 I3", ["line 3", "G50"]),
        ("G51 P2.\nG68 X0 Y0 R3\nG50", ["line 4", "G69"]),
        ("G51 P2.\nG81 Z-3 R1", ["line 3", "along Z"]),
        ("G51 X900000 P3.\nG1 X0", ["line 3", "leads out of range"]),
        ("G51 X3000000 P3.", ["line 2", "out of range"]),
        ("G51.1", ["line 2", "needs X, Y or Z"]),
        ("G51.1 X0 P1", ["line 2", "no other word"]),
        ("G51.1 X0\nG55", ["line 3", "G50.1"]),
        ("G51.1 X0\nG68 X0 Y0 R5", ["line 3", "mirrored"]),
        ("G51.1 X0\nG51 P2.\nG50.1", ["line 4", "G50"]),
        ("G68.2 I3\nG51.1 X0", ["line 3", "G69"]),
        ("G68 X0 Y0 R5\nG51 P2.", ["line 3", "G69"]),
    ] {
        is_refused("p.nc", &format!("G0 X0 Y0 Z0\n{text}\n"), &words);
    }
}
