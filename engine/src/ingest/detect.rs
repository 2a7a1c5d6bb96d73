//! Which format a file is in: by its content if that is conclusive, else by its ending.

use super::{obj, ply, stl, text};
use crate::error::{Error, Result};
use std::path::Path;

/// Bytes at the front that are looked at to tell text from binary.
const START_BYTES: usize = 1 << 14;

/// What reader a file is for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Family {
    BinaryStl,
    AsciiStl,
    Obj,
    Ply,
    Gcode,
    X3d,
}

/// Endings that G-code has; each may be followed by one of [`PACKED`].
const GCODE: [&str; 6] = ["gcode", "gco", "gc", "g", "nc", "ngc"];
/// Endings of compressed files, and how those begin.
const PACKED: [(&str, &[u8]); 2] = [("gz", b"\x1f\x8b"), ("xz", b"\xfd7zXZ\0")];
/// Lines of a text without a telling ending that must all look like G-code.
const GCODE_LINES: usize = 1000;

/// Beginnings of other files that a user may well try, and what they are.
const FOREIGN: [(&[u8], &str); 11] = [
    (b"PK\x03\x04", "a ZIP archive (3MF is one)"),
    (b"glTF", "a binary glTF file"),
    (b"\x1f\x8b", "compressed with gzip"),
    (b"\xfd7zXZ\0", "compressed with xz"),
    (b"\x28\xb5\x2f\xfd", "compressed with zstd"),
    (b"OFF", "an OFF file"),
    (b"ISO-10303-21", "a STEP file"),
    (b"<?xml", "an XML file"),
    (b"#X3D", "an X3D file in the ClassicVRML encoding (save it in the XML encoding, .x3d)"),
    (b"#VRML", "a VRML file (save it as X3D in the XML encoding, .x3d)"),
    (b"\xe0\0\0\x01", "an X3D file in the binary encoding (save it in the XML encoding, .x3d)"),
];

/// Decides by `bytes`, the content of the file `path`.
///
/// # Errors
/// If the file is empty, or of no known format.
pub(super) fn family(path: &Path, bytes: &[u8]) -> Result<Family> {
    if bytes.is_empty() {
        return Err(Error::input(path, "byte 0", "is empty", "export or copy the file again"));
    }
    let start = &bytes[..bytes.len().min(START_BYTES)];
    let start_text = text::without_mark(start);
    let is_text = !start.iter().any(|b| *b < b' ' && !text::is_space(*b));
    if ply::is_ply(bytes) {
        return Ok(Family::Ply);
    }
    if stl::has_exact_size(bytes) {
        return Ok(Family::BinaryStl);
    }
    if is_text && begins_as_stl(start_text) {
        return Ok(Family::AsciiStl);
    }
    if is_x3d(start_text) {
        return Ok(Family::X3d);
    }
    if is_text && obj::is_plausible(start_text) {
        return Ok(Family::Obj);
    }
    if is_gcode(path, start_text, is_text) {
        return Ok(Family::Gcode);
    }
    let remedy = "give a mesh as STL, OBJ or PLY, a toolpath as G-code, or beads as X3D";
    let ending = path.extension().unwrap_or_default().to_ascii_lowercase();
    if ending == "x3d" && start_text.trim_ascii_start().starts_with(b"<") {
        return Ok(Family::X3d);
    }
    if let Some((_, what)) = FOREIGN.iter().find(|(magic, _)| start_text.starts_with(magic)) {
        return Err(Error::input(path, "byte 0", format!("is {what}, which cannot be read"), remedy));
    }
    match ending.to_str() {
        // The reader says what is wrong with it.
        Some("stl") if is_text => Ok(Family::AsciiStl),
        Some("stl") => Ok(Family::BinaryStl),
        Some("obj") if is_text => Ok(Family::Obj),
        Some("obj") => Err(Error::input(path, "byte 0", "is not text, as an OBJ mesh is", remedy)),
        Some("x3d") => Ok(Family::X3d),
        Some("ply") => Err(Error::input(path, "byte 0", "does not begin with the line \"ply\"", remedy)),
        _ => Err(Error::input(path, "byte 0", "is neither STL nor OBJ nor PLY nor X3D nor G-code", remedy)),
    }
}

/// True if the name says that the file is G-code, compressed or not, or if there is no better word than its
/// content.
fn is_gcode(path: &Path, start: &[u8], is_text: bool) -> bool {
    let ending = |path: &Path| path.extension().unwrap_or_default().to_ascii_lowercase();
    if let Some((packing, _)) = PACKED.iter().find(|(_, magic)| start.starts_with(magic)) {
        return ending(path) == *packing
            && path.file_stem().is_some_and(|inner| GCODE.iter().any(|e| ending(Path::new(inner)) == *e));
    }
    let is_foreign = FOREIGN.iter().any(|(magic, _)| start.starts_with(magic));
    // The reader says what is wrong with it.
    !is_foreign && (GCODE.iter().any(|e| ending(path) == *e) || is_text && begins_as_gcode(start))
}

/// True if there is nothing but comments and commands, and at least one of those.
fn begins_as_gcode(start: &[u8]) -> bool {
    // The last line may be cut off.
    let Some(end) = start.iter().rposition(|&b| b == b'\n' || b == b'\r') else { return false };
    let mut commands = 0;
    for line in start[..end].split(|&b| b == b'\n' || b == b'\r').take(GCODE_LINES) {
        match line.trim_ascii() {
            [] | [b';' | b'(' | b'%', ..] => {}
            [letter, digit, ..]
                if b"GMTN".contains(&letter.to_ascii_uppercase()) && digit.is_ascii_digit() =>
            {
                commands += 1;
            }
            _ => return false,
        }
    }
    commands > 0
}

/// True if the text begins as XML and its first elements are those of X3D.
fn is_x3d(start: &[u8]) -> bool {
    start.trim_ascii_start().starts_with(b"<") && start.windows(4).any(|word| word == b"<X3D")
}

/// True if the text begins with "solid" and goes on with a facet or the end of the solid.
fn begins_as_stl(start: &[u8]) -> bool {
    let mut rest = start;
    if !text::token(&mut rest).is_some_and(|word| word.eq_ignore_ascii_case(b"solid")) {
        return false;
    }
    std::iter::from_fn(|| text::token(&mut rest))
        .any(|word| [&b"facet"[..], b"endsolid"].iter().any(|keyword| word.eq_ignore_ascii_case(keyword)))
}
