//! ASCII STL.
//!
//! ```text
//! solid NAME TO THE END OF THE LINE
//!   facet normal NX NY NZ
//!     outer loop
//!       vertex X Y Z          three times
//!     endloop
//!   endfacet
//! endsolid NAME TO THE END OF THE LINE
//! ```
//! Keywords in any case, any white space between words, any number of solids one after the other. Normals are
//! skipped without a look, or may be missing: the order of the corners says which side is outside, and exporters write
//! all sorts of "-nan(ind)" for the normal of a sliver. Also let pass: lines that begin with `#`, `;` or `//`, control
//! bytes between words, and a last solid without its "endsolid", of which the user is told.

use super::text::{self, TextLines};
use crate::error::{Error, Result};
use crate::progress::Progress;
use crate::soup::Facet;
use std::path::Path;

/// What was read of a file.
#[derive(Debug, Default)]
pub(super) struct TextFacets {
    pub(super) all: Vec<Facet>,
    /// The line after which the file ends within a solid, between two facets.
    pub(super) open_end: Option<u64>,
}

/// Reads all facets. What is allocated is less than twice the size of `bytes`.
///
/// # Errors
/// If the text does not follow the grammar above, naming the line.
pub(super) fn read(path: &Path, bytes: &[u8], progress: &dyn Progress) -> Result<TextFacets> {
    let lines = TextLines::new(text::without_mark(bytes), 0, progress);
    let mut words = Words { path, lines, rest: &[] };
    let mut facets = TextFacets::default();
    words.expect("solid")?;
    loop {
        words.rest = &[];
        let before = facets.all.len();
        loop {
            match words.next()? {
                Some(word) if is(word, "facet") => facets.all.push(facet(&mut words)?),
                Some(word) if is(word, "endsolid") => break,
                None if facets.all.len() > before => {
                    facets.open_end = Some(words.lines.number());
                    break;
                }
                word => return Err(words.unexpected("\"facet\" or \"endsolid\"", word)),
            }
        }
        words.rest = &[];
        match words.next()? {
            None => break,
            Some(word) if is(word, "solid") => {}
            Some(word) => return Err(words.unexpected("\"solid\" or the end of the file", Some(word))),
        }
    }
    facets.all.shrink_to_fit();
    Ok(facets)
}

/// What follows the word "facet".
fn facet(words: &mut Words) -> Result<Facet> {
    let mut word = words.next()?;
    if word.is_some_and(|word| is(word, "normal")) {
        // Three numbers, or fewer.
        word = words.next()?;
        for _ in 0..3 {
            match word {
                Some(component) if !is(component, "outer") => word = words.next()?,
                _ => break,
            }
        }
    } else if !word.is_some_and(|word| is(word, "outer")) {
        return Err(words.unexpected("\"normal\"", word));
    }
    if !word.is_some_and(|word| is(word, "outer")) {
        return Err(words.unexpected("\"outer\"", word));
    }
    words.expect("loop")?;
    let mut corners = Facet::default();
    for corner in &mut corners {
        words.expect("vertex")?;
        for coordinate in corner {
            *coordinate = words.number()?;
        }
    }
    words.expect("endloop")?;
    words.expect("endfacet")?;
    Ok(corners)
}

/// True if the line says nothing about the surface.
#[inline]
fn is_comment(line: &[u8]) -> bool {
    let start = line.iter().position(|b| !text::is_space(*b)).unwrap_or(line.len());
    matches!(line[start..], [b'#' | b';', ..] | [b'/', b'/', ..])
}

/// True if `word` is the keyword, in any case.
#[inline]
fn is(word: &[u8], keyword: &str) -> bool {
    word.eq_ignore_ascii_case(keyword.as_bytes())
}

/// The words of the file, across lines.
struct Words<'a> {
    path: &'a Path,
    lines: TextLines<'a>,
    /// What is left of the current line.
    rest: &'a [u8],
}

impl<'a> Words<'a> {
    #[inline]
    fn next(&mut self) -> Result<Option<&'a [u8]>> {
        loop {
            if let Some(word) = text::token(&mut self.rest) {
                return Ok(Some(word));
            }
            match self.lines.next()? {
                Some(line) if is_comment(line) => {}
                Some(line) => self.rest = line,
                None => return Ok(None),
            }
        }
    }

    fn expect(&mut self, keyword: &'static str) -> Result<()> {
        match self.next()? {
            Some(word) if is(word, keyword) => Ok(()),
            word => Err(self.unexpected(&format!("\"{keyword}\""), word)),
        }
    }

    fn number(&mut self) -> Result<f64> {
        let word = self.next()?;
        word.and_then(text::number).ok_or_else(|| self.unexpected("a number", word))
    }

    fn unexpected(&self, expected: &str, found: Option<&[u8]>) -> Error {
        let quoted = |word: &[u8]| text::quote(word) + text::hint(word);
        let found = found.map_or("the end of the file".into(), quoted);
        Error::input(
            self.path,
            format!("line {}", self.lines.number()),
            format!("expected {expected} of an ASCII STL, found {found}"),
            "repair the line or export the file again",
        )
    }
}
