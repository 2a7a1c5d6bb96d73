//! OFF meshes (Object File Format of Geomview): counts, positions, faces.
//!
//! ```text
//! [ST][C][N]OFF
//! VERTICES FACES EDGES
//! X Y Z ...                  a vertex; what follows the position is ignored
//! N V1 ... VN ...            a face by its vertices, counted from 0; colours behind them are ignored
//! ```
//! Counts may stand in the first line. `#` begins a comment.

use super::polygons::Polygons;
use super::text::{self, TextLines};
use crate::error::{Error, Result};
use crate::progress::Progress;
use std::path::Path;

const REMEDY: &str = "export or copy the file again, as text";

/// Whether a file begins as OFF does.
pub(super) fn is_off(start: &[u8]) -> bool {
    let word = start.split(|&b| text::is_space(b)).next().unwrap_or_default();
    keyword(word).is_some()
}

/// The letters before OFF, if it is a word that OFF files begin with.
fn keyword(word: &[u8]) -> Option<&[u8]> {
    let before = word.strip_suffix(b"OFF")?;
    [&b""[..], b"C", b"N", b"CN", b"ST", b"STC", b"STN", b"STCN"].contains(&before).then_some(before)
}

/// Reads all faces. What is allocated is a small multiple of the size of `bytes`.
///
/// # Errors
/// If a count, a vertex or a face is malformed, is missing, or names a vertex that is not there, naming the line.
pub(super) fn read(path: &Path, bytes: &[u8], progress: &dyn Progress) -> Result<Polygons> {
    let mut reader = Reader { path, lines: TextLines::new(text::without_mark(bytes), 0, progress) };
    let mut first = reader.line("the word OFF")?;
    let word = text::token(&mut first).unwrap_or_default();
    if keyword(word).is_none() {
        return Err(reader.error(format!("begins with {}, not with OFF", text::quote(word))));
    }
    let mut counts = first;
    if text::token(&mut first).is_some_and(|word| word.eq_ignore_ascii_case(b"BINARY")) {
        return Err(reader.error("is a binary OFF file".to_owned()));
    }
    if text::token(&mut { counts }).is_none() {
        counts = reader.line("the counts")?;
    }
    let mut count = |what: &str| {
        let word = text::token(&mut counts).unwrap_or_default();
        let number = text::integer(word).and_then(|n| u32::try_from(n).ok());
        number.ok_or_else(|| reader.error(format!("{} is no number of {what}", text::quote(word))))
    };
    let (vertices, faces) = (count("vertices")?, count("faces")?);
    let mut polygons = Polygons::default();
    for number in 0..vertices {
        let mut line = reader.line(&format!("vertex {number} of {vertices}"))?;
        let mut position = [0.0; 3];
        for coordinate in &mut position {
            let word = text::token(&mut line).unwrap_or_default();
            *coordinate = text::number(word).ok_or_else(|| {
                let what = format!("coordinate {} of vertex {number} is not a number", text::quote(word));
                reader.error(what + text::hint(word))
            })?;
        }
        polygons.vertices.push(position);
    }
    let mut corners = Vec::new();
    for number in 0..faces {
        let mut line = reader.line(&format!("face {number} of {faces}"))?;
        corners.clear();
        let word = text::token(&mut line).unwrap_or_default();
        let bad = |reader: &Reader<'_>, word: &[u8], what: &str| {
            reader.error(format!("{} is no {what} of face {number}", text::quote(word)))
        };
        let sides =
            text::integer(word).filter(|&n| n >= 0).ok_or_else(|| bad(&reader, word, "number of corners"))?;
        for _ in 0..sides {
            let word = text::token(&mut line).ok_or_else(|| bad(&reader, b"", "corner"))?;
            let corner = text::integer(word).and_then(|n| u32::try_from(n).ok()).filter(|&n| n < vertices);
            corners.push(corner.ok_or_else(|| bad(&reader, word, "vertex"))?);
        }
        polygons.add_face(&corners);
    }
    polygons.finish();
    Ok(polygons)
}

struct Reader<'a> {
    path: &'a Path,
    lines: TextLines<'a>,
}

impl<'a> Reader<'a> {
    /// The next line with something in it, without its comment.
    fn line(&mut self, wanted: &str) -> Result<&'a [u8]> {
        while let Some(line) = self.lines.next()? {
            let end = line.iter().position(|&b| b == b'#').unwrap_or(line.len());
            if text::token(&mut &line[..end]).is_some() {
                return Ok(&line[..end]);
            }
        }
        Err(self.error(format!("the file ends before {wanted}")))
    }

    fn error(&self, what: String) -> Error {
        Error::input(self.path, format!("line {}", self.lines.number()), what, REMEDY)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::progress::Silent;

    fn of(text: &str) -> Result<Polygons> {
        read(Path::new("a.off"), text.as_bytes(), &Silent)
    }

    #[test]
    fn dialects_are_one_tetrahedron() {
        let points = "0 0 0\n1 0 0\n0 1 0\n0 0 1\n";
        let faces = "3 0 2 1\n3 0 1 3\n3 1 2 3\n3 0 3 2\n";
        let expected = vec![[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]];
        for text in [
            format!("OFF\n4 4 6\n{points}{faces}"),
            format!("OFF 4 4 0 # one line\n\n# and a comment\n{points}{faces}"),
            format!("OFF\r\n4 4\r\n{points}{faces}"),
            format!(
                "COFF\n4 4 0\n{}{}",
                points.replace('\n', " 255 0 0 255\n"),
                faces.replace('\n', " 0.1 0.2 0.3\n")
            ),
        ] {
            assert!(is_off(text.as_bytes()));
            assert_eq!(of(&text).unwrap().triangles, expected, "{text}");
        }
        let square = of("OFF\n4 2 0\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n4 0 1 2 3\n2 0 1\n").unwrap();
        assert_eq!((square.triangles.len(), square.skipped), (2, 1));
        assert!(!is_off(b"OFFSET 1") && !is_off(b"solid"));
    }

    #[test]
    fn what_is_wrong_is_told_with_its_line() {
        for (text, what) in [
            ("OFF BINARY\n", "line 1: is a binary OFF file"),
            ("OFF\n4 x 0\n", "line 2: \"x\" is no number of faces"),
            ("OFF\n-4 1 0\n", "line 2: \"-4\" is no number of vertices"),
            ("OFF\n2 1 0\n0 0 0\n", "line 3: the file ends before vertex 1 of 2"),
            ("OFF\n1 1 0\n0 0\n", "line 3: coordinate \"\" of vertex 0"),
            ("OFF\n1 1 0\n0,5 0 0\n", "decimal commas"),
            ("OFF\n1 1 0\n0 0 0\n3 0 0 1\n", "line 4: \"1\" is no vertex of face 0"),
            ("OFF\n1 1 0\n0 0 0\n3 0 0\n", "line 4: \"\" is no corner of face 0"),
            ("OFF\n1 4000000000 0\n0 0 0\n", "line 3: the file ends before face 0"),
        ] {
            let said = of(text).unwrap_err().to_string();
            assert!(said.contains(what), "{said}");
        }
    }
}
