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
//! skipped without a look: the order of the corners says which side is outside, and exporters write all sorts
//! of "-nan(ind)" for the normal of a sliver.

use super::text::{self, Lines};
use crate::error::{Error, Result};
use crate::progress::Progress;
use std::path::Path;

/// The corners of one facet: a text may hold more digits than 32 bits do.
pub(super) type Facet = [[f64; 3]; 3];

/// Reads all facets. What is allocated is less than twice the size of `bytes`.
///
/// # Errors
/// If the text does not follow the grammar above, naming the line.
pub(super) fn read(path: &Path, bytes: &[u8], progress: &dyn Progress) -> Result<Vec<Facet>> {
    let mut words = Words { path, lines: Lines::new(text::without_mark(bytes), 0, progress), rest: &[] };
    let mut facets = Vec::new();
    words.expect("solid")?;
    loop {
        words.rest = &[];
        while words.expect_either("facet", "endsolid")? {
            facets.push(facet(&mut words)?);
        }
        words.rest = &[];
        match words.next()? {
            None => break,
            Some(word) if is(word, "solid") => {}
            Some(word) => return Err(words.unexpected("\"solid\" or the end of the file", Some(word))),
        }
    }
    facets.shrink_to_fit();
    Ok(facets)
}

/// What follows the word "facet".
fn facet(words: &mut Words) -> Result<Facet> {
    words.expect("normal")?;
    for _ in 0..3 {
        words.next()?;
    }
    words.expect("outer")?;
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

/// True if `word` is the keyword, in any case.
#[inline]
fn is(word: &[u8], keyword: &str) -> bool {
    word.eq_ignore_ascii_case(keyword.as_bytes())
}

/// The words of the file, across lines.
struct Words<'a> {
    path: &'a Path,
    lines: Lines<'a>,
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

    /// True if the next word is `this`, false if it is `that`.
    fn expect_either(&mut self, this: &'static str, that: &'static str) -> Result<bool> {
        match self.next()? {
            Some(word) if is(word, this) => Ok(true),
            Some(word) if is(word, that) => Ok(false),
            word => Err(self.unexpected(&format!("\"{this}\" or \"{that}\""), word)),
        }
    }

    fn number(&mut self) -> Result<f64> {
        let word = self.next()?;
        word.and_then(text::number).ok_or_else(|| self.unexpected("a number", word))
    }

    fn unexpected(&self, expected: &str, found: Option<&[u8]>) -> Error {
        let found = found.map_or("the end of the file".into(), text::quote);
        Error::input(
            self.path,
            format!("line {}", self.lines.number()),
            format!("expected {expected} of an ASCII STL, found {found}"),
            "repair the line or export the file again",
        )
    }
}
