//! Damaged and lying files: one line of error or a sweep, never a panic, and never memory that the file does
//! not back.

use super::*;
use crate::error::Error;

#[test]
fn damage_is_named_with_its_line() {
    for (text, wanted) in [
        ("", "line 1: the file holds no element X3D"),
        ("just words", "the file holds no element X3D"),
        ("<svg/>", "line 1: the first element is \"svg\", not X3D"),
        ("<X3D/>\n<X3D/>", "line 2: a second element"),
        ("<X3D><Scene>\n", "line 2: the file ends inside 2 open elements"),
        ("<X3D>\n<Scene>\n</X3D>", "line 3: is no well-formed XML"),
        ("<X3D>\n<Scene>\n<Shape", "line 3: is no well-formed XML"),
        ("<X3D><Scene/></X3D>", "it shows no Extrusion;"),
        ("<X3D><Scene><Shape><Box/></Shape></Scene></X3D>", "(line 1: Box is not read)"),
        ("\u{0}\u{0}", "no element X3D"),
    ] {
        let told = refusal(text);
        assert!(told.starts_with("a.x3d: ") && told.contains(wanted), "{text}: {told}");
    }
    let utf16: Vec<u8> = "<X3D/>".encode_utf16().flat_map(u16::to_le_bytes).collect();
    let marked = [&b"\xff\xfe"[..], &utf16].concat();
    let told = Sweeps::read(Path::new("a.x3d"), &marked, &Silent).unwrap_err().to_string();
    assert!(told.contains("UTF-16; save it in UTF-8"), "{told}");
    let told = Sweeps::read(Path::new("a.x3d"), b"<X3D>\xff</X3D>", &Silent).unwrap_err().to_string();
    assert!(told.contains("well-formed"), "{told}");
}

const SMALL: &str = "<Transform DEF='t' rotation='0 1 0 1'><Shape><Extrusion DEF='e' crossSection='1 0 0 1 \
    -1 0 0 .2 1 0' spine='0 0 0, 1 2 3,4 5 -6' scale='1 1 2 2 3 3' orientation='1 0 0 .5' endCap='false'/>\
    </Shape></Transform><Switch whichChoice='0'><Group USE='t'/></Switch><Shape><Extrusion USE='e'/></Shape>";

#[test]
fn every_truncation_is_refused() {
    let text = file(SMALL);
    for length in 0..text.trim_end().len() {
        refusal(&text[..length]);
    }
    assert!(opened(&text).unwrap().report().warnings().is_empty());
}

#[test]
fn every_byte_changed() {
    let text = file(SMALL).into_bytes();
    for at in 0..text.len() {
        for value in [0, 0xff, b'9', b'-', b'<', b'>', b'\'', b' ', b'&', text[at] ^ 1] {
            let mut damaged = text.clone();
            damaged[at] = value;
            if let Ok(sweeps) = Sweeps::read(Path::new("a.x3d"), &damaged, &Silent) {
                let finite = all(&sweeps).iter().flatten().flatten().all(|c| c.is_finite());
                assert!(finite, "{}", String::from_utf8_lossy(&damaged));
            }
        }
    }
}

#[test]
fn a_few_lines_that_use_each_other_are_no_bomb() {
    let mut scene = String::from("<Group DEF='g0'><Shape><Extrusion/></Shape></Group>");
    for i in 1..=40 {
        let below = i - 1;
        scene += &format!("<Switch DEF='g{i}'><Group USE='g{below}'/><Group USE='g{below}'/></Switch>");
    }
    assert_eq!(sweeps(&scene).facets(), 12);
    let told = refusal(&file(&(scene.clone() + "<Group USE='g40'/>")));
    assert!(told.contains("USE places more than 1048576 Extrusions"), "{told}");
    assert_eq!(sweeps(&(scene + "<Group USE='g10'/>")).facets(), 12 * 1025);
    // A long chain is no deep recursion.
    let mut scene = String::from("<Group DEF='g0'><Shape><Extrusion/></Shape></Group>");
    for i in 1..=20_000 {
        scene += &format!("<Group DEF='g{i}'><Group USE='g{}'/></Group>", i - 1);
    }
    assert_eq!(sweeps(&scene).report().placed, 20_001);
}

#[test]
fn deep_nesting_and_long_outlines_are_refused() {
    let told = refusal(&file(&"<Group>".repeat(100_000)));
    assert!(told.contains("nested more than 1024 levels"), "{told}");
    let outline: String = (0..70_000).map(|i| format!("{i} {} ", i % 2)).collect();
    let spine: String = (0..70_000).map(|i| format!("0 {i} 0 ")).collect();
    let told =
        refusal(&file(&format!("<Shape><Extrusion crossSection='{outline}' spine='{spine}'/></Shape>")));
    assert!(told.contains("more than 4294967295 triangles; split it"), "{told}");
}

#[test]
fn memory_is_in_proportion_to_the_text() {
    let text = file(&"<Shape><Extrusion spine='0 0 0,1 1 1,2 3 4'/></Shape>".repeat(1000));
    let held = opened(&text).unwrap().heap_bytes();
    assert!(held < 10 * text.len() as u64, "{held} bytes for {}", text.len());
}

#[test]
fn interruption_and_refusal_by_the_taker_end_the_walk() {
    struct Stop;
    impl crate::progress::Progress for Stop {
        fn cancelled(&self) -> bool {
            true
        }
    }
    let text = file(&"<Shape><Extrusion/></Shape>".repeat(100_000));
    let ended = Sweeps::read(Path::new("a.x3d"), text.as_bytes(), &Stop);
    assert!(matches!(ended, Err(Error::Interrupted)));
    let mut seen = 0;
    let ended = read(Path::new("a.x3d"), text.as_bytes(), &Silent, &mut |_| {
        seen += 1;
        if seen == 5 { Err(Error::setting("full", "stop")) } else { Ok(()) }
    });
    assert!(ended.is_err() && seen == 5);
}
