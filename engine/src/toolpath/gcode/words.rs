//! Words of a line: a letter and a number each, as RS-274 has it, with or without spaces between them.
//!
//! There are no exponents: in `X1e1` the `e1` is a word of its own. An equals sign may stand before the number
//! (`X=1.5`), and behind it or without it an expression (`Z[#200 + 1]`, `X=R1`); names of several characters take
//! their value by an equals sign alone (`A3=0.5`, `CR=10`).

/// A letter and its number.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Word<'a> {
    /// In upper case; [`NAMED`] where a name stands in its place.
    pub(super) letter: u8,
    /// `None` where the slicer left a placeholder, as in `Y{machine_depth}`, or there is an expression.
    pub(super) value: Option<f64>,
    /// Digits behind the decimal point.
    pub(super) decimals: u32,
    /// As it stands in the line.
    pub(super) text: &'a [u8],
    /// A name of several characters, before an equals sign; else empty.
    pub(super) name: &'a [u8],
    /// What must be computed to get the value; else empty.
    pub(super) expression: &'a [u8],
}

/// Letter of words that have a name instead.
pub(super) const NAMED: u8 = b'=';

/// Something that is no word.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Malformed<'a> {
    pub(super) text: &'a [u8],
    pub(super) what: &'static str,
}

/// The words of a line, in order; comments and the checksum are no words.
#[derive(Clone)]
pub(super) struct Words<'a> {
    line: &'a [u8],
    at: usize,
}

impl<'a> Words<'a> {
    pub(super) fn new(line: &'a [u8]) -> Words<'a> {
        Words { line, at: 0 }
    }

    /// What is not read yet, from the next thing that is neither space nor comment in parentheses.
    pub(super) fn rest(&mut self) -> &'a [u8] {
        while let Some(&byte) = self.line.get(self.at) {
            match byte {
                b' ' | b'\t' => self.at += 1,
                b'(' => {
                    let rest = &self.line[self.at..];
                    self.at += rest.iter().position(|b| *b == b')').map_or(rest.len(), |close| close + 1);
                }
                _ => break,
            }
        }
        &self.line[self.at..]
    }

    /// The next word, or `None` where a comment, the checksum or the end of the line follows.
    #[inline]
    pub(super) fn next(&mut self) -> Option<Result<Word<'a>, Malformed<'a>>> {
        let rest = self.rest();
        let letter = *rest.first()?;
        if letter == b';' || letter == b'*' {
            return None;
        }
        if !letter.is_ascii_alphabetic() {
            return Some(Err(Malformed {
                text: token(rest),
                what: "is no word: a letter should stand here",
            }));
        }
        // A space between the letter and its number is rare but allowed.
        let mut from = 1;
        while matches!(rest.get(from), Some(b' ' | b'\t')) {
            from += 1;
        }
        let assigned = rest.get(from) == Some(&b'=');
        if assigned {
            from += 1;
            while matches!(rest.get(from), Some(b' ' | b'\t')) {
                from += 1;
            }
        }
        let found = match number(&rest[from..]) {
            Some(found) => found,
            None if rest.get(from) == Some(&b'{') => return Some(self.placeholder(rest, from)),
            None if assigned || matches!(rest.get(from), Some(b'#' | b'[')) => {
                return Some(self.expression(rest, 0, from));
            }
            None if named(rest).is_some() => return Some(self.assignment(rest)),
            None => return Some(Err(Malformed { text: without_number(rest, from), what: "has no number" })),
        };
        let length = from + found.length;
        if !ends_at(rest, length) {
            if assigned {
                return Some(self.expression(rest, 0, from));
            }
            if named(rest).is_some() {
                return Some(self.assignment(rest));
            }
            let text = &rest[..from + token(&rest[from..]).len()];
            return Some(Err(Malformed { text, what: "is no letter with a number" }));
        }
        self.at += length;
        let (value, decimals, text) = (Some(found.value), found.decimals, &rest[..length]);
        Some(Ok(Word {
            letter: letter.to_ascii_uppercase(),
            value,
            decimals,
            text,
            name: b"",
            expression: b"",
        }))
    }

    /// A name of several characters, an equals sign, and a value.
    fn assignment(&mut self, rest: &'a [u8]) -> Result<Word<'a>, Malformed<'a>> {
        let name = named(rest).unwrap_or_default();
        let mut from = name.len();
        while rest[from] != b'=' {
            from += 1;
        }
        from += 1;
        while matches!(rest.get(from), Some(b' ' | b'\t')) {
            from += 1;
        }
        match number(&rest[from..]) {
            Some(found) if ends_at(rest, from + found.length) => {
                let length = from + found.length;
                self.at += length;
                let (value, decimals, text) = (Some(found.value), found.decimals, &rest[..length]);
                Ok(Word { letter: NAMED, value, decimals, text, name, expression: b"" })
            }
            _ => self.expression(rest, name.len(), from),
        }
    }

    /// The letter, or the name of so many characters, of `rest` with an expression that begins at `from`.
    fn expression(&mut self, rest: &'a [u8], name: usize, from: usize) -> Result<Word<'a>, Malformed<'a>> {
        let assigned = rest[..from].contains(&b'=');
        let length = from + expression_length(&rest[from..], assigned);
        let text = &rest[..length];
        if length == from {
            return Err(Malformed { text: &rest[..from], what: "has no number" });
        }
        self.at += length;
        let letter = if name > 0 { NAMED } else { rest[0].to_ascii_uppercase() };
        let expression = &rest[from..length];
        Ok(Word { letter, value: None, decimals: 0, text, name: &rest[..name], expression })
    }

    fn placeholder(&mut self, rest: &'a [u8], from: usize) -> Result<Word<'a>, Malformed<'a>> {
        let Some(close) = rest[from..].iter().position(|b| *b == b'}') else {
            return Err(Malformed { text: token(rest), what: "opens a brace and does not close it" });
        };
        let text = &rest[..=from + close];
        self.at += text.len();
        let letter = rest[0].to_ascii_uppercase();
        Ok(Word { letter, value: None, decimals: 0, text, name: b"", expression: b"" })
    }
}

/// Whether a number may end at this place.
#[inline]
fn ends_at(rest: &[u8], length: usize) -> bool {
    match rest.get(length) {
        None => true,
        Some(b) => b.is_ascii_alphabetic() || matches!(b, b' ' | b'\t' | b';' | b'(' | b'*'),
    }
}

/// The name of two characters or more that `text` begins with, if an equals sign follows.
pub(super) fn named(text: &[u8]) -> Option<&[u8]> {
    let name = identifier(text);
    let behind = text[name.len()..].iter().find(|b| !matches!(b, b' ' | b'\t'));
    (name.len() > 1 && behind == Some(&b'=')).then_some(name)
}

/// The letters, digits and underscores that `text` begins with, the first of them no digit.
pub(super) fn identifier(text: &[u8]) -> &[u8] {
    let fits = |b: &u8| b.is_ascii_alphanumeric() || *b == b'_';
    match text.first() {
        Some(first) if fits(first) && !first.is_ascii_digit() => {
            &text[..text.iter().position(|b| !fits(b)).unwrap_or(text.len())]
        }
        _ => b"",
    }
}

/// How long the expression is that `text` begins with. One that is `assigned` goes on to a space outside of
/// brackets; others are a variable (`#12`, `#<name>`) or stand in brackets.
fn expression_length(text: &[u8], assigned: bool) -> usize {
    let mut depth = 0u32;
    for (at, byte) in text.iter().enumerate() {
        match byte {
            b'[' | b'(' | b'<' => depth += 1,
            b']' | b')' | b'>' => {
                depth = depth.saturating_sub(1);
                if depth == 0 && !assigned {
                    return at + 1;
                }
            }
            b';' => return at,
            b' ' | b'\t' if depth == 0 => return at,
            b'#' | b'0'..=b'9' => {}
            _ if depth == 0 && !assigned => return at,
            _ => {}
        }
    }
    text.len()
}

/// Bytes up to the next space, semicolon or checksum; one at least.
pub(super) fn token(text: &[u8]) -> &[u8] {
    let ends = |b: &u8| matches!(b, b' ' | b'\t' | b';' | b'*');
    let end = text.iter().skip(1).position(ends).map_or(text.len(), |end| end + 1);
    &text[..end]
}

/// The letter, and what stands in the place of its number unless that is the next word.
fn without_number(rest: &[u8], from: usize) -> &[u8] {
    let starts_word = |text: &[u8]| text[0].is_ascii_alphabetic() && number(&text[1..]).is_some();
    match rest.get(from) {
        None | Some(b';' | b'*' | b'(') => &rest[..1],
        Some(_) if from > 1 && starts_word(&rest[from..]) => &rest[..1],
        Some(_) => &rest[..from + token(&rest[from..]).len()],
    }
}

/// A number at the front of a text.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Number {
    pub(super) value: f64,
    /// Bytes that it takes.
    pub(super) length: usize,
    pub(super) decimals: u32,
}

/// Powers of ten that are exact in binary.
const TENS: [f64; 16] =
    [1e0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9, 1e10, 1e11, 1e12, 1e13, 1e14, 1e15];

/// The number that `text` begins with, rounded correctly: sign, digits, point, digits; at least one digit.
#[inline]
pub(super) fn number(text: &[u8]) -> Option<Number> {
    let signed = usize::from(matches!(text.first(), Some(b'-' | b'+')));
    let mut at = signed;
    let mut mantissa: u64 = 0;
    let mut point = None;
    while let Some(&byte) = text.get(at) {
        let digit = byte.wrapping_sub(b'0');
        if digit <= 9 {
            mantissa = mantissa.wrapping_mul(10).wrapping_add(u64::from(digit));
        } else if byte == b'.' && point.is_none() {
            point = Some(at);
        } else {
            break;
        }
        at += 1;
    }
    let digits = at - signed - usize::from(point.is_some());
    if digits == 0 {
        return None;
    }
    let decimals = point.map_or(0, |point| at - point - 1);
    // Up to 15 digits both operands are exact, so that one division rounds correctly.
    let value = if digits < TENS.len() {
        let size = mantissa as f64 / TENS[decimals];
        if text[0] == b'-' { -size } else { size }
    } else {
        fast_float2::parse(&text[usize::from(text[0] == b'+')..at]).ok()?
    };
    Some(Number { value, length: at, decimals: decimals as u32 })
}

/// A piece of a file as it may stand in a message: printable, on one line, and short.
pub(super) fn quote(text: &[u8]) -> String {
    const SHOWN: usize = 40;
    let shown = String::from_utf8_lossy(&text[..text.len().min(SHOWN)]);
    let more = if text.len() > SHOWN { "..." } else { "" };
    format!("\"{}{more}\"", shown.escape_debug())
}
