//! Which format a file is in: by its content if that is conclusive, else by its ending.

use super::cloud_formats::CloudFormat;
use super::formats::{FileStart, MeshFormat, TellTale, readable};
use super::{cloud_text, foreign, stl, text, three_mf};
use crate::error::{Error, Result};
use crate::mmap::MappedFile;
use std::path::Path;

/// Bytes at the front that are looked at to tell text from binary.
const START_BYTES: usize = 1 << 14;

/// What reader a file is for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum ReaderKind {
    BinaryStl,
    AsciiStl,
    /// The reader of a format of the table.
    Polygons(&'static MeshFormat),
    ThreeMf,
    Gcode,
    X3d,
}

/// Endings that G-code has; each may be followed by one of [`PACKED`].
const GCODE: [&str; 6] = ["gcode", "gco", "gc", "g", "nc", "ngc"];
/// Endings of compressed files, and how those begin.
const PACKED: [(&str, &[u8]); 2] = [("gz", b"\x1f\x8b"), ("xz", b"\xfd7zXZ\0")];
/// Endings of points as text; the reader says what is wrong with it.
const CLOUDS: [&str; 5] = ["xyz", "xyzn", "xyzrgb", "pts", "asc"];
/// Lines of a text without a telling ending that must all look like G-code.
const GCODE_LINES: usize = 1000;

/// Of this many bytes one may be a control byte in a text that was damaged a little.
const BYTES_A_CONTROL: usize = 16;

/// What a file is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum InputKind {
    /// A mesh: its format, as in "STL".
    Mesh(&'static str),
    /// Points without faces: "PLY", "PCD", "LAS", "E57" or "XYZ".
    Cloud(&'static str),
    /// G-code.
    Toolpath,
    /// X3D, in its XML encoding.
    X3d,
    /// A 3MF file.
    ThreeMf,
    /// Nothing that can be read: what it is, as in "a PNG picture", if that is known.
    Foreign(Option<&'static str>),
    /// Nothing.
    Empty,
}

impl InputKind {
    /// What the file `path` is, by its content and then by its name; whether it is sound is for its reader to say.
    ///
    /// # Errors
    /// If the file cannot be read.
    pub fn of(path: &Path) -> Result<InputKind> {
        let file = MappedFile::open(path)?;
        let kind = what_is(path, file.bytes());
        file.check()?;
        Ok(kind)
    }
}

/// See [`InputKind::of`].
pub(super) fn what_is(path: &Path, bytes: &[u8]) -> InputKind {
    if bytes.is_empty() {
        return InputKind::Empty;
    }
    if let Some(format) = CloudFormat::of(path, bytes) {
        return InputKind::Cloud(format.name);
    }
    match family(path, bytes) {
        Ok(ReaderKind::BinaryStl | ReaderKind::AsciiStl) => InputKind::Mesh("STL"),
        Ok(ReaderKind::Polygons(format)) => InputKind::Mesh(format.name),
        Ok(ReaderKind::ThreeMf) => InputKind::ThreeMf,
        Ok(ReaderKind::Gcode) => InputKind::Toolpath,
        Ok(ReaderKind::X3d) => InputKind::X3d,
        Err(_) => match foreign::by_content(path, bytes) {
            Some(what) => InputKind::Foreign(Some(what)),
            None if has_cloud_ending(path) || is_cloud(path, bytes) => InputKind::Cloud("XYZ"),
            None => InputKind::Foreign(foreign::by_ending(path).or_else(|| denied(path))),
        },
    }
}

/// What a file is that is no mesh of its name's ending, as in "no OFF file, in spite of its name".
fn denied(path: &Path) -> Option<&'static str> {
    let denial = MeshFormat::of_name(path)?.denial?;
    denial.strip_prefix("is ").filter(|denial| denial.starts_with("no "))
}

/// True of a text of points that is nothing else.
pub(super) fn is_cloud(path: &Path, bytes: &[u8]) -> bool {
    let start = &bytes[..bytes.len().min(START_BYTES)];
    is_mostly_text(start) && family(path, bytes).is_err() && cloud_text::is_plausible(start)
}

fn has_cloud_ending(path: &Path) -> bool {
    CLOUDS.iter().any(|known| path.extension().is_some_and(|e| e.eq_ignore_ascii_case(known)))
}

/// True of what is known and cannot be read.
fn is_foreign(path: &Path, bytes: &[u8]) -> bool {
    !bytes.is_empty() && foreign::by_content(path, bytes).is_some()
}

fn is_mostly_text(start: &[u8]) -> bool {
    start.iter().filter(|b| text::is_control(**b)).count() * BYTES_A_CONTROL <= start.len()
}

/// Decides by `bytes`, the content of the file `path`.
///
/// # Errors
/// If the file is empty, or of no known format.
pub(super) fn family(path: &Path, bytes: &[u8]) -> Result<ReaderKind> {
    if bytes.is_empty() {
        return Err(Error::input(path, "byte 0", "is empty", "export or copy the file again"));
    }
    let start = &bytes[..bytes.len().min(START_BYTES)];
    let start_text = text::without_mark(start);
    let is_text = !start.iter().any(|b| text::is_control(*b));
    // A few zeros at the end, or one damaged byte, make no other format of a text.
    let is_mostly_text = is_mostly_text(start);
    if stl::has_exact_size(bytes) {
        return Ok(ReaderKind::BinaryStl);
    }
    if start.starts_with(b"GCDE") {
        return Ok(ReaderKind::Gcode);
    }
    let file = FileStart { path, bytes, text: is_mostly_text.then_some(start_text) };
    if let Some(format) = MeshFormat::of(&file, true) {
        return Ok(ReaderKind::Polygons(format));
    }
    let foreign = foreign::by_content(path, bytes);
    match foreign {
        Some(three_mf::WHAT) if three_mf::holds_toolpath(path, bytes) => return Ok(ReaderKind::Gcode),
        Some(three_mf::WHAT) => return Ok(ReaderKind::ThreeMf),
        _ => {}
    }
    if is_mostly_text && begins_as_stl(start_text) {
        return Ok(ReaderKind::AsciiStl);
    }
    if is_x3d(start_text) {
        return Ok(ReaderKind::X3d);
    }
    if let Some(format) = MeshFormat::of(&file, false) {
        return Ok(ReaderKind::Polygons(format));
    }
    if is_gcode(path, start_text, is_text) {
        return Ok(ReaderKind::Gcode);
    }
    let ending = path.extension().unwrap_or_default().to_ascii_lowercase();
    if ending == "x3d" && start_text.trim_ascii_start().starts_with(b"<") {
        return Ok(ReaderKind::X3d);
    }
    if let Some(what) = foreign {
        return Err(Error::input(
            path,
            "byte 0",
            format!("is {what}, which cannot be read"),
            remedy_for(what),
        ));
    }
    // The reader says what is wrong with it. Where the count of a binary file would stand there is text.
    let begins_as_text = bytes.iter().take(84).all(|b| b.is_ascii() && !text::is_control(*b));
    let format = MeshFormat::of_name(path);
    match ending.to_str() {
        Some("stl") if is_text || begins_as_text => return Ok(ReaderKind::AsciiStl),
        Some("stl") => return Ok(ReaderKind::BinaryStl),
        Some("x3d") => return Ok(ReaderKind::X3d),
        _ => {}
    }
    if let Some(format) =
        format.filter(|format| matches!(format.tell, TellTale::Perhaps(_)) && is_mostly_text)
    {
        return Ok(ReaderKind::Polygons(format));
    }
    Err(match (format.and_then(|format| format.denial), foreign::by_ending(path)) {
        (Some(denial), _) => Error::input(path, "byte 0", denial, readable()),
        (None, Some(what)) => Error::input(path, "byte 0", format!("is {what}"), remedy_for(what)),
        (None, None) => {
            let what = "is neither STL nor OBJ nor PLY nor X3D nor G-code";
            Error::input(path, "byte 0", what, readable())
        }
    })
}

/// What the user can do with a file that cannot be read.
fn remedy_for(what: &str) -> String {
    if what.contains("CAD model") {
        "export the part as a mesh: STL, OBJ or PLY".to_owned()
    } else if what.starts_with("compressed") {
        "unpack it first (G-code is read as .gz and .xz, named .gcode.gz or .gcode.xz)".to_owned()
    } else {
        readable()
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
    let is_foreign = is_foreign(path, start);
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
