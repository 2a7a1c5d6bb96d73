//! Wavefront OBJ: `v` and `f` statements; everything else in the file says nothing about the surface.
//!
//! ```text
//! v X Y Z [W] [R G B]           a vertex; what follows the position is ignored
//! f A B C ...                   a face of any number of corners, each V, V/VT, V//VN or V/VT/VN;
//!                               V counts vertices from 1, or backwards from −1, the latest
//! ```
//! A backslash at the end of a line joins it with the next. A face may name a vertex that comes later.

use super::polygons::Polygons;
use super::text::{self, TextLines};
use crate::error::{Error, Result};
use crate::progress::{Progress, Silent};
use std::path::Path;

/// Statements that are passed over (and anything else that begins with a letter, for the sake of exporters
/// with dialects); these are listed because they also tell an OBJ from another text, see [`is_plausible`].
const OTHER_KEYWORDS: [&[u8]; 10] = [b"vt", b"vn", b"vp", b"o", b"g", b"s", b"usemtl", b"mtllib", b"l", b"p"];

/// True if `start`, the beginning of a file, looks like an OBJ: nothing but known statements, and a vertex.
pub(super) fn is_plausible(start: &[u8]) -> bool {
    // The last line may be cut off, so it does not count.
    let Some(end) = start.iter().rposition(|&b| b == b'\n' || b == b'\r') else { return false };
    let mut lines = TextLines::new(&start[..end], 0, &Silent);
    let (mut vertices, mut continues) = (0, false);
    while let Ok(Some(line)) = lines.next() {
        let mut rest = line;
        match text::token(&mut rest) {
            _ if continues => {}
            None | Some([b'#', ..] | b"f") => {}
            Some(b"v") => vertices += 1,
            Some(word) if OTHER_KEYWORDS.contains(&word) => {}
            Some(_) => return false,
        }
        continues = is_continued(line);
    }
    vertices > 0
}

/// Reads all faces. What is allocated is a small multiple of the size of `bytes`.
///
/// # Errors
/// If a vertex or a face is malformed or names a vertex that is not there, naming the line.
pub(super) fn read(path: &Path, bytes: &[u8], progress: &dyn Progress) -> Result<Polygons> {
    let mut reader =
        Reader { path, line: 0, polygons: Polygons::default(), corners: Vec::new(), ahead: Vec::new() };
    let mut lines = TextLines::new(text::without_mark(bytes), 0, progress);
    let mut joined = Vec::new();
    while let Some(line) = lines.next()? {
        reader.line = lines.number();
        if is_continued(line) {
            join(line, &mut lines, &mut joined)?;
            reader.statement(&joined)?;
        } else {
            reader.statement(line)?;
        }
    }
    reader.finish()
}

/// True if the next line belongs to this one. A comment is never continued: it may well end with a backslash (a
/// path), and no face may be lost.
fn is_continued(line: &[u8]) -> bool {
    line.last() == Some(&b'\\') && !line.trim_ascii_start().starts_with(b"#")
}

/// Collects in `joined` the line `first`, which is continued, and those that continue it.
fn join<'a>(first: &'a [u8], lines: &mut TextLines<'a>, joined: &mut Vec<u8>) -> Result<()> {
    joined.clear();
    let mut line = first;
    while let Some(part) = line.strip_suffix(b"\\") {
        joined.extend_from_slice(part);
        joined.push(b' ');
        match lines.next()? {
            Some(next) => line = next,
            None => return Ok(()),
        }
    }
    joined.extend_from_slice(line);
    Ok(())
}

struct Reader<'a> {
    path: &'a Path,
    /// Number of the current statement's first line.
    line: u64,
    polygons: Polygons,
    /// Corners of the current face.
    corners: Vec<u32>,
    /// Vertices named before they were there, by their number from 1, and the line. Only those that are higher
    /// than all before: the first one that is still missing at the end is among them.
    ahead: Vec<(u32, u64)>,
}

impl Reader<'_> {
    fn statement(&mut self, mut line: &[u8]) -> Result<()> {
        match text::token(&mut line) {
            Some(b"v") => self.vertex(line),
            Some(b"f" | b"fo") => self.face(line),
            None | Some([b'#', ..]) => Ok(()),
            Some([first, ..]) if first.is_ascii_alphabetic() => Ok(()),
            Some(word) => Err(self.error(format!("{} is not a statement of an OBJ file", text::quote(word)))),
        }
    }

    fn vertex(&mut self, mut line: &[u8]) -> Result<()> {
        let mut position = [0.0; 3];
        for coordinate in &mut position {
            let word = text::token(&mut line)
                .ok_or_else(|| self.error("vertex with fewer than three coordinates".into()))?;
            *coordinate = text::number(word).ok_or_else(|| {
                let what = format!("coordinate {} is not a number", text::quote(word));
                self.error(what + text::hint(word))
            })?;
        }
        if self.polygons.vertices.len() >= u32::MAX as usize {
            return Err(self.error("more than 4,294,967,295 vertices".into()));
        }
        self.polygons.vertices.push(position);
        Ok(())
    }

    fn face(&mut self, mut line: &[u8]) -> Result<()> {
        self.corners.clear();
        while let Some(word) = text::token(&mut line) {
            if word[0] == b'#' {
                break;
            }
            let corner = self.corner(word)?;
            self.corners.push(corner);
        }
        self.polygons.add_face(&self.corners);
        Ok(())
    }

    /// Index from 0 of the vertex that `word`, a face's corner, names.
    #[inline]
    fn corner(&mut self, word: &[u8]) -> Result<u32> {
        let digits = word.split(|&b| b == b'/').next().unwrap_or(word);
        let number = text::integer(digits)
            .ok_or_else(|| self.error(format!("corner {} is not a vertex number", text::quote(word))))?;
        let present = self.polygons.vertices.len() as i64;
        let from_1 = if number < 0 { present + 1 + number } else { number };
        if from_1 < 1 || from_1 > i64::from(u32::MAX) {
            return Err(self.missing(number, present));
        }
        let from_1 = from_1 as u32;
        if i64::from(from_1) > present && self.ahead.last().is_none_or(|&(highest, _)| from_1 > highest) {
            self.ahead.push((from_1, self.line));
        }
        Ok(from_1 - 1)
    }

    fn finish(mut self) -> Result<Polygons> {
        let present = self.polygons.vertices.len();
        if let Some(&(number, line)) = self.ahead.iter().find(|(number, _)| *number as usize > present) {
            self.line = line;
            return Err(self.missing(i64::from(number), present as i64));
        }
        self.polygons.finish();
        Ok(self.polygons)
    }

    fn missing(&self, number: i64, present: i64) -> Error {
        self.error(format!("face names vertex {number}, but there are {present} vertices"))
    }

    fn error(&self, what: String) -> Error {
        let place = format!("line {}", self.line);
        Error::input(self.path, place, what, "repair the line or export the file again")
    }
}
