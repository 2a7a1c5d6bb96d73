//! What is no G-code, or none that can be carried out.

use super::*;
use std::io::Read;

fn refusal(text: impl AsRef<[u8]>) -> String {
    parse(text, &GcodeOptions::default()).unwrap_err().to_string()
}

#[test]
fn malformed_lines_are_named_with_line_and_word() {
    let file = std::fs::read_to_string(data("gcode/malformed.gcode")).unwrap();
    let lines: Vec<&str> = file.lines().collect();
    let good = lines[..4].join("\n");
    assert_eq!(parse(&good, &GcodeOptions::default()).unwrap().0.segments, 1);
    for (bad, words) in [
        (lines[4], "the word \"E+.1\" repeats a letter"),
        (lines[6], "the word \"X nan\" has no number"),
        (lines[7], "the word \"X\" has no number"),
        (lines[8], "the word \"XY5\" has no number"),
        (lines[9], "the word \"X99999999999\" is out of range"),
        ("G1 X1.2.3 E1", "the word \"X1.2.3\" is no letter with a number"),
        ("G1 X1,5 E1", "the word \"X1,5\" is no letter with a number"),
        ("G1 X-- E1", "the word \"X--\" has no number"),
        ("G1 X Y5 E1", "the word \"X\" has no number"),
        ("G1 X5 E{rate}", "placeholder"),
        ("G1 X{x}\nG1 Y7 E1", "left X unknown"),
        ("G2 X1 Y1 E1", "neither I, J or K nor R"),
        ("G2 X9 R1 E1", "too short"),
        ("G2 X9 I0 J0 E1", "centre"),
        ("G5 X1 I1 J1 P0 Q1 E1", "spline"),
        ("G1 Z1\nG1 X0.000002 E999999", "wider"),
        ("\x01\x02", "no word"),
        ("5 X1", "no word"),
    ] {
        let text = refusal(format!("{good}\n{bad}\n"));
        let line = if bad.contains('\n') { 6 } else { 5 };
        assert!(text.starts_with(&format!("text: line {line}: ")) && text.contains(words), "{bad}: {text}");
    }
    // The remaining line is well formed.
    assert_eq!(parse(format!("{good}\n{}\n", lines[5]), &GcodeOptions::default()).unwrap().0.segments, 2);
}

#[test]
fn files_that_deposit_nothing() {
    assert!(refusal("").contains("byte 0: is empty"));
    let text = load("gcode/only_comments.gcode", &GcodeOptions::default()).unwrap_err().to_string();
    assert!(text.contains("only_comments.gcode: line 1: ends, and no move deposited anything"), "{text}");
    let text = parse("M83\nG1 Z1\nG1 X1 E1", &skipping(&["Unnamed"])).unwrap_err().to_string();
    assert!(text.contains("skip fewer features"), "{text}");
    assert!(refusal("X5 E1").contains("before the first G0"));
}

#[test]
fn other_files() {
    for (start, what) in
        [("GCDE\x01", "cut off or damaged"), ("PK\x03\x04", ".gcode file in it"), ("BZh9", "gzip or xz")]
    {
        let text = refusal(start);
        assert!(text.contains(what), "{text}");
    }
    let text = load("gcode", &GcodeOptions::default()).unwrap_err().to_string();
    assert!(text.contains("is a directory"), "{text}");
    let text = load("gcode/none", &GcodeOptions::default()).unwrap_err().to_string();
    assert!(text.contains("cannot open"), "{text}");
}

#[test]
fn cut_and_damaged_archives() {
    for name in ["gcode/thinwall_ladder_prusaslicer.gcode.gz", "gcode/spot40_slic3r_nometa.gcode.xz"] {
        let whole = std::fs::read(data(name)).unwrap();
        let options = GcodeOptions::default();
        let lines = parse(&whole, &options).unwrap().0.lines;
        for end in [12, 100, whole.len() / 2, whole.len() - 5, whole.len() - 1] {
            let text = refusal(&whole[..end]);
            assert!(text.starts_with("text: ") && text.contains("cannot unpack"), "{name} {end}: {text}");
        }
        let mut damaged = whole.clone();
        damaged[whole.len() / 2] ^= 0x10;
        assert!(parse(&damaged, &options).is_err());
        // Archives may be joined.
        let twice = [&whole[..], &whole[..]].concat();
        assert_eq!(parse(&twice, &options).unwrap().0.lines, 2 * lines);
    }
}

#[test]
fn unpacking_takes_bounded_memory() {
    // Zeros without end would fill the memory, were they one line.
    let zeros = std::io::repeat(0).take(8 << 20);
    let mut packed = Vec::new();
    flate2::read::GzEncoder::new(zeros, flate2::Compression::default()).read_to_end(&mut packed).unwrap();
    assert!(packed.len() < 64 << 10);
    let text = refusal(&packed);
    assert!(text.contains("line 1: is longer than"), "{text}");
}

#[test]
fn settings_out_of_range() {
    let options = GcodeOptions { width: Some(f64::NAN), ..GcodeOptions::default() };
    let text = parse("G1 X1 E1", &options).unwrap_err().to_string();
    assert!(text.contains("the width is not between"), "{text}");
}

#[test]
fn sinks_can_fail() {
    let mut calls = 0;
    let text = std::fs::read(data("clover.gcode")).unwrap();
    let result = read_gcode_from(Path::new("text"), || Ok(&text[..]), &GcodeOptions::default(), &mut |_| {
        calls += 1;
        if calls == 3 { Err(Error::Interrupted) } else { Ok(()) }
    });
    assert!(matches!(result, Err(Error::Interrupted)) && calls == 3);
}
