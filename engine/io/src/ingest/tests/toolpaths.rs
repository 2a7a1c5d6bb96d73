//! Toolpaths among the inputs.

use super::*;
use crate::ingest::{OpenOptions, read_beads};
use crate::toolpath::gcode::GcodeOptions;

/// Two layers of one bead each, which say what they are only by their commands.
const TEXT: &[u8] = b"; two beads\n\nM83\ng1 X0 Y0 Z.5 F600\nG1 X10 E1\nG0 X0 Z1\nG1 X10 E1\n";

fn gzip(bytes: &[u8]) -> Vec<u8> {
    use std::io::Write;
    let mut encoder = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::fast());
    encoder.write_all(bytes).unwrap();
    encoder.finish().unwrap()
}

#[test]
fn are_known_by_their_content_and_packed_ones_by_their_name() {
    let folder = Folder::new();
    let expected = all(&folder.open("a.gcode", TEXT).unwrap());
    assert!(!expected.is_empty());
    let packed = gzip(TEXT);
    let late = [&[b';'; 20_000][..], b"\n", TEXT].concat();
    for (name, bytes) in [
        ("a", TEXT),
        ("a.txt", TEXT),
        ("a.NC", TEXT),
        ("a.g", &late),
        ("a.gcode.gz", &packed),
        ("A.GCO.GZ", &packed),
    ] {
        let input = folder.open(name, bytes).unwrap();
        assert_eq!(input.describe(), "G-code");
        assert!(all(&input) == expected, "{name}");
        let (min, max) = input.bounds(&Silent).unwrap();
        assert!(min[2].abs() < 1e-12 && max[2] == 1.0, "{min:?} {max:?}");
        let beads = input.beads().unwrap();
        assert_eq!((beads.report.beads, beads.swept.toolpath().len()), (2, 2));
        assert_eq!(beads.swept.facets(), input.facets());
        assert!(input.heap_bytes() > 0);
    }
    for (name, bytes, why) in [
        ("a.gz", &packed[..], "compressed with gzip"),
        ("a.stl.gz", &packed, "compressed with gzip"),
        ("a.gcode.xz", &packed, "compressed with gzip"),
        ("a.txt", b"G1 X0\nhello\n", "is neither"),
        ("a.txt", b"; a comment\n", "is neither"),
        ("a.gcode", b"PK\x03\x04\0\0", "ZIP"),
    ] {
        let said = folder.refusal(name, bytes);
        assert!(said.contains(why), "{name}: {said}");
    }
}

#[test]
fn options_reach_the_reader_and_the_sweep() {
    let folder = Folder::new();
    let path = folder.0.path().join("a.gcode");
    std::fs::write(&path, TEXT).unwrap();
    let mut options = OpenOptions::default();
    options.gcode.width = Some(3.0);
    options.sweep.sides = 6;
    let input = Input::open_with(&path, &options, &Silent).unwrap();
    let swept = &input.beads().unwrap().swept;
    assert_eq!((swept.toolpath().section(0, 0).width, swept.sweep().profile().sides()), (3.0, 6));
    options.sweep.sides = 7;
    assert!(Input::open_with(&path, &options, &Silent).unwrap_err().to_string().contains("7 sides"));
    let mut seen = 0;
    let mut count = |_: crate::toolpath::BeadView<'_>| {
        seen += 1;
        Ok(())
    };
    read_beads(&path, &GcodeOptions::default(), &Silent, &mut count).unwrap();
    assert_eq!(seen, 2);
    std::fs::write(&path, small().stl()).unwrap();
    let said = read_beads(&path, &GcodeOptions::default(), &Silent, &mut |_| Ok(())).unwrap_err().to_string();
    assert!(said.contains("is a mesh"), "{said}");
}
