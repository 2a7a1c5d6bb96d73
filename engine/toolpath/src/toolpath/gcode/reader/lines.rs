//! Lines of a stream, through one buffer of bounded size.

use memchr::memchr2;
use std::io::{self, Read};

/// Longest line, in bytes. Slicers write whole scripts and thumbnails into a line of their settings; a megabyte
/// without an end of line is no G-code.
pub(super) const LINE_BYTES_MAX: usize = 1 << 20;

/// Bytes that are read at once; the buffer grows where a line needs it.
const READ_BYTES: usize = 1 << 16;

/// Why there is no next line.
#[derive(Debug)]
pub(super) enum LinesEnd {
    /// The stream could not be read.
    Read(io::Error),
    /// The line is longer than [`LINE_BYTES_MAX`].
    TooLong,
}

/// The lines of a stream, without a byte order mark. A line ends with LF, CR LF or a lone CR.
pub(super) struct StreamLines<R> {
    source: R,
    /// What is read but not handed out is `buffer[start..end]`.
    buffer: Vec<u8>,
    start: usize,
    end: usize,
    /// The last line ended with CR: an LF that follows belongs to it.
    after_cr: bool,
    exhausted: bool,
    started: bool,
}

impl<R: Read> StreamLines<R> {
    pub(super) fn new(source: R) -> StreamLines<R> {
        let buffer = vec![0; READ_BYTES];
        StreamLines { source, buffer, start: 0, end: 0, after_cr: false, exhausted: false, started: false }
    }

    /// The next line without its end, or `None` after the last.
    pub(super) fn next(&mut self) -> Result<Option<&[u8]>, LinesEnd> {
        if !self.started {
            self.started = true;
            self.skip_mark()?;
        }
        let mut searched = 0;
        loop {
            if self.after_cr && self.start < self.end {
                self.after_cr = false;
                self.start += usize::from(self.buffer[self.start] == b'\n');
            }
            let rest = &self.buffer[self.start..self.end];
            if let Some(found) = memchr2(b'\n', b'\r', &rest[searched..]) {
                let line = self.start..self.start + searched + found;
                self.after_cr = self.buffer[line.end] == b'\r';
                self.start = line.end + 1;
                return Ok(Some(&self.buffer[line]));
            }
            if self.exhausted {
                let line = self.start..self.end;
                self.start = self.end;
                return Ok((!line.is_empty()).then(|| &self.buffer[line]));
            }
            searched = rest.len();
            if searched > LINE_BYTES_MAX {
                return Err(LinesEnd::TooLong);
            }
            self.fill()?;
        }
    }

    /// Reads more behind what is there.
    fn fill(&mut self) -> Result<(), LinesEnd> {
        if self.start > 0 {
            self.buffer.copy_within(self.start..self.end, 0);
            (self.start, self.end) = (0, self.end - self.start);
        }
        if self.end == self.buffer.len() {
            self.buffer.resize((2 * self.end).min(LINE_BYTES_MAX + 1), 0);
        }
        loop {
            match self.source.read(&mut self.buffer[self.end..]) {
                Ok(0) => self.exhausted = true,
                Ok(bytes) => self.end += bytes,
                Err(e) if e.kind() == io::ErrorKind::Interrupted => continue,
                Err(e) => return Err(LinesEnd::Read(e)),
            }
            return Ok(());
        }
    }

    /// Passes over the mark that some editors put before UTF-8.
    fn skip_mark(&mut self) -> Result<(), LinesEnd> {
        const MARK: &[u8] = b"\xef\xbb\xbf";
        while self.end < MARK.len() && !self.exhausted {
            self.fill()?;
        }
        if self.buffer[..self.end].starts_with(MARK) {
            self.start = MARK.len();
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Reads in pieces of so many bytes.
    struct Pieces<'a>(&'a [u8], usize);
    impl Read for Pieces<'_> {
        fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
            let bytes = self.1.min(self.0.len()).min(buffer.len());
            buffer[..bytes].copy_from_slice(&self.0[..bytes]);
            self.0 = &self.0[bytes..];
            Ok(bytes)
        }
    }

    #[test]
    fn lines_of_every_ending_in_pieces_of_every_size() {
        for size in 1..16 {
            let mut lines = StreamLines::new(Pieces(b"\xef\xbb\xbfa\nb\r\n\rc\r\r\nd", size));
            let mut seen = Vec::new();
            while let Some(line) = lines.next().unwrap() {
                seen.push(line.to_vec());
            }
            let expected: [&[u8]; 6] = [b"a", b"b", b"", b"c", b"", b"d"];
            assert_eq!(seen, expected, "{size}");
        }
    }

    #[test]
    fn a_line_without_end_is_refused() {
        let mut long = vec![b'x'; LINE_BYTES_MAX];
        long.push(b'\n');
        assert_eq!(StreamLines::new(&long[..]).next().unwrap().map(<[u8]>::len), Some(LINE_BYTES_MAX));
        long.insert(0, b'x');
        assert!(matches!(StreamLines::new(&long[..]).next(), Err(LinesEnd::TooLong)));
        assert!(matches!(StreamLines::new(io::repeat(b'x')).next(), Err(LinesEnd::TooLong)));
    }
}
