//! Lines, tokens and numbers of the text formats, straight from the mapped bytes.

use crate::error::Result;
use crate::progress::Progress;

/// Bytes between two reports of progress (and looks at whether the user wants to stop).
const REPORT_BYTES: usize = 1 << 20;

/// The text after the byte order mark that some editors put before UTF-8.
pub(super) fn without_mark(bytes: &[u8]) -> &[u8] {
    bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes)
}

/// The lines of a text, counted from 1. A line ends with LF, CR LF or a lone CR.
pub(super) struct TextLines<'a> {
    bytes: &'a [u8],
    at: usize,
    reported: usize,
    line: u64,
    progress: &'a dyn Progress,
}

impl<'a> TextLines<'a> {
    /// The lines of `bytes`, of which `before` precede the first one in the file. Read bytes are reported to
    /// `progress`.
    pub(super) fn new(bytes: &'a [u8], before: u64, progress: &'a dyn Progress) -> TextLines<'a> {
        TextLines { bytes, at: 0, reported: 0, line: before, progress }
    }

    /// Number of the line handed out last.
    pub(super) fn number(&self) -> u64 {
        self.line
    }

    /// The next line without its end, or `None` after the last.
    pub(super) fn next(&mut self) -> Result<Option<&'a [u8]>> {
        if self.at - self.reported >= REPORT_BYTES || self.at == self.bytes.len() {
            self.progress.advance((self.at - self.reported) as u64);
            self.reported = self.at;
            self.progress.check()?;
        }
        let rest = &self.bytes[self.at..];
        if rest.is_empty() {
            return Ok(None);
        }
        self.line += 1;
        let end = rest.iter().position(|&b| b == b'\n' || b == b'\r').unwrap_or(rest.len());
        let break_bytes = match rest[end..] {
            [b'\r', b'\n', ..] => 2,
            [] => 0,
            _ => 1,
        };
        self.at += end + break_bytes;
        Ok(Some(&rest[..end]))
    }
}

/// Splits the first token off `text`; tokens are separated by ASCII white space. Control bytes around a token, as the
/// zeros and ^Z that some programs end a text with, are no part of it; within one they stay, so that no number falls in
/// two.
#[inline]
pub(super) fn token<'a>(text: &mut &'a [u8]) -> Option<&'a [u8]> {
    loop {
        let start = text.iter().position(|b| !is_space(*b))?;
        let rest = &text[start..];
        let end = rest.iter().position(|b| is_space(*b)).unwrap_or(rest.len());
        *text = &rest[end..];
        let word = &rest[..end];
        if !(is_control(word[0]) || is_control(word[end - 1])) {
            return Some(word);
        }
        let word = without_controls(word);
        if !word.is_empty() {
            return Some(word);
        }
    }
}

/// `word` without the control bytes at its ends.
#[cold]
fn without_controls(word: &[u8]) -> &[u8] {
    let is_printable = |b: &u8| !is_control(*b);
    let start = word.iter().position(is_printable).unwrap_or(word.len());
    let end = word.iter().rposition(is_printable).map_or(start, |last| last + 1);
    &word[start..end]
}

/// A byte that no text needs.
#[inline]
pub(super) fn is_control(byte: u8) -> bool {
    byte < b' ' && !is_space(byte) || byte == 0x7f
}

/// Space, tab, vertical tab, form feed, CR or LF.
#[inline]
pub(super) fn is_space(byte: u8) -> bool {
    matches!(byte, b' ' | b'\t'..=b'\r')
}

/// A decimal number that takes up the whole token. "nan" and "inf" are numbers here: whether they are usable
/// is decided once, where the bounds are taken, and for every format alike.
#[inline]
pub(super) fn number<T: fast_float2::FastFloat>(token: &[u8]) -> Option<T> {
    fast_float2::parse(token).ok()
}

/// A decimal integer with an optional sign that takes up the whole token.
#[inline]
pub(super) fn integer(token: &[u8]) -> Option<i64> {
    let (negative, digits) = match token {
        [b'-', digits @ ..] => (true, digits),
        [b'+', digits @ ..] => (false, digits),
        digits => (false, digits),
    };
    // 18 digits cannot overflow, and no index is longer.
    if digits.is_empty() || digits.len() > 18 || !digits.iter().all(u8::is_ascii_digit) {
        return None;
    }
    let value = digits.iter().fold(0i64, |value, d| value * 10 + i64::from(d - b'0'));
    Some(if negative { -value } else { value })
}

/// What a message adds about a token that should be a number: why it is none, where that can be guessed.
pub(super) fn hint(token: &[u8]) -> &'static str {
    let is_digit = |at: usize| token.get(at).is_some_and(u8::is_ascii_digit);
    let commas: Vec<usize> = (0..token.len()).filter(|&at| token[at] == b',').collect();
    match commas[..] {
        [at] if is_digit(at + 1) && (at == 0 || is_digit(at - 1) || b"+-".contains(&token[at - 1])) => {
            " (decimal commas? write numbers with a point, as 1.5)"
        }
        [_, ..] => " (separate numbers by blanks, not by commas)",
        [] if token.iter().any(|b| is_control(*b)) => " (there is a control byte in it)",
        [] => "",
    }
}

/// A name as it may stand in a line: printable and short.
pub(super) fn plain(name: &[u8]) -> String {
    const SHOWN: usize = 64;
    String::from_utf8_lossy(&name[..name.len().min(SHOWN)]).escape_debug().to_string()
}

/// A token as it may stand in a message: printable, on one line, and short.
pub(super) fn quote(token: &[u8]) -> String {
    const SHOWN: usize = 24;
    let shown = String::from_utf8_lossy(&token[..token.len().min(SHOWN)]);
    let more = if token.len() > SHOWN { "..." } else { "" };
    format!("\"{}{more}\"", shown.escape_debug())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::progress::Silent;

    #[test]
    fn lines_of_every_ending() {
        let mut lines = TextLines::new(b"a\nb\r\n\rc\r\r\nd", 4, &Silent);
        let mut seen = Vec::new();
        while let Some(line) = lines.next().unwrap() {
            seen.push((lines.number(), line));
        }
        let expected: Vec<(u64, &[u8])> =
            vec![(5, b"a"), (6, b"b"), (7, b""), (8, b"c"), (9, b""), (10, b"d")];
        assert_eq!(seen, expected);
    }

    #[test]
    fn tokens_and_numbers() {
        let mut text: &[u8] = b" \tv  +1.5e2\x0b-3 ";
        assert_eq!(token(&mut text), Some(&b"v"[..]));
        assert_eq!(number::<f64>(token(&mut text).unwrap()), Some(150.0));
        assert_eq!(integer(token(&mut text).unwrap()), Some(-3));
        assert_eq!(token(&mut text), None);
        assert!(number::<f32>(b"nan").unwrap().is_nan());
        assert_eq!(number::<f32>(b"1e99"), Some(f32::INFINITY));
        for wrong in [&b""[..], b"1,5", b"1.5x", b"++1", b"0x10", b"-", b"1 "] {
            assert_eq!(number::<f64>(wrong), None, "{wrong:?}");
        }
        for wrong in [&b""[..], b"-", b"1.0", b"9999999999999999999", b"+-1"] {
            assert_eq!(integer(wrong), None, "{wrong:?}");
        }
        let mut text: &[u8] = b"\0\0 \x1av\x01 1\x002\x7f \0";
        assert_eq!(token(&mut text), Some(&b"v"[..]));
        assert_eq!(token(&mut text), Some(&b"1\x002"[..]));
        assert_eq!(token(&mut text), None);
        assert!(hint(b"1,5").contains("decimal commas?") && hint(b"-,5e3").contains("decimal commas?"));
        assert!(hint(b"1,2,3").contains("by blanks") && hint(b"1\x002").contains("control byte"));
        assert_eq!(hint(b"one"), "");
        assert_eq!(quote(b"a\nb\"\xff"), "\"a\\nb\\\"\u{fffd}\"");
    }
}
