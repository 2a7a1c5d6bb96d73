//! Bytes of a file one after the other.

use crate::error::{Error, Result};
use std::path::Path;

/// A place in a file.
#[derive(Clone)]
pub(super) struct Cursor<'a> {
    path: &'a Path,
    bytes: &'a [u8],
    at: usize,
}

impl<'a> Cursor<'a> {
    /// At a byte; if there is none, reading fails.
    pub fn new<'b: 'a>(path: &'b Path, bytes: &'a [u8], at: usize) -> Cursor<'a> {
        Cursor { path, bytes, at }
    }

    pub fn path(&self) -> &'a Path {
        self.path
    }

    /// Where it stands.
    pub fn at(&self) -> usize {
        self.at
    }

    pub fn error(&self, what: impl ToString, remedy: &str) -> Error {
        Error::input(self.path, format!("byte {}", self.at), what, remedy)
    }

    /// The error of what cannot be as it is.
    pub fn damaged(&self, what: impl ToString) -> Error {
        self.error(what, "export or copy the file again")
    }

    pub fn go_to(&mut self, at: usize) -> Result<()> {
        self.at = at;
        if at > self.bytes.len() { Err(self.damaged("lies beyond the end of the file")) } else { Ok(()) }
    }

    pub fn take(&mut self, count: usize) -> Result<&'a [u8]> {
        let taken = self.at.checked_add(count).and_then(|end| self.bytes.get(self.at..end));
        let taken = taken.ok_or_else(|| self.damaged(format!("{count} bytes are not there")))?;
        self.at += count;
        Ok(taken)
    }

    pub fn skip(&mut self, count: usize) -> Result<()> {
        self.take(count).map(|_| ())
    }

    fn array<const N: usize>(&mut self) -> Result<[u8; N]> {
        let taken = self.take(N)?;
        Ok(std::array::from_fn(|n| taken[n]))
    }

    pub fn byte(&mut self) -> Result<u8> {
        Ok(self.array::<1>()?[0])
    }

    pub fn word(&mut self) -> Result<u32> {
        Ok(u32::from_le_bytes(self.array()?))
    }

    pub fn long(&mut self) -> Result<u64> {
        Ok(u64::from_le_bytes(self.array()?))
    }

    pub fn double(&mut self) -> Result<f64> {
        Ok(f64::from_le_bytes(self.array()?))
    }

    /// Three coordinates.
    pub fn coordinates(&mut self) -> Result<[i32; 3]> {
        let mut next = || Ok(i32::from_le_bytes(self.array()?));
        Ok([next()?, next()?, next()?])
    }

    /// Where in the file something is.
    pub fn place(&mut self) -> Result<usize> {
        let place = self.long()?;
        let place = usize::try_from(place).ok().filter(|&place| place <= self.bytes.len());
        place.ok_or_else(|| self.damaged("names a byte beyond the end of the file"))
    }

    pub fn string(&mut self) -> Result<&'a str> {
        let length = self.word()? as usize;
        let text = self.take(length)?;
        std::str::from_utf8(text).map_err(|_| self.damaged("is no text"))
    }

    /// Names and values that are text.
    pub fn metadata(&mut self, mut entry: impl FnMut(&str, &'a str)) -> Result<()> {
        for _ in 0..self.word()? {
            let (name, kind) = (self.string()?, self.string()?);
            let length = self.word()? as usize;
            let value = self.take(length)?;
            if let ("string", Ok(text)) = (kind, std::str::from_utf8(value)) {
                entry(name, text);
            }
        }
        Ok(())
    }
}
