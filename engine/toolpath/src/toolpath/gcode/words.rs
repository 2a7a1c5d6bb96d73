//! Words of a line: a letter and a number each, as RS-274 has it, with or without spaces between them.
//!
//! RS-274 has no exponents: in `X1e1` and `X10E-0.5` the E is a word of its own. Programs that print floating-point
//! numbers without care write them all the same, as in `Y1.2e-05`. What follows a number is taken for its exponent
//! only if no extruder word can be meant:
//!
//! - It is e or E, a sign, and whole digits; the number before has one digit, not 0, in front of its point. All
//!   programs print exponents so, and small ones from -4 on.
//! - And one of these: the sign is plus; the digits begin with 0; e and the word's letter differ in case. Or the words
//!   of the line are parted by spaces; the letter is E itself, or another E word stands in the line.
//!
//! Otherwise it is a word. What could be read both ways is told, see [`Exponent`]; `G1X10Y5E-2` could not.
//!
//! An equals sign may stand before a number (`X=1.5`), and behind it or without it an expression (`Z[#200 + 1]`,
//! `X=R1`); names of several characters take their value by an equals sign alone (`A3=0.5`, `CR=10`).

/// A letter and its number.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Word<'a> {
    /// In upper case; [`NAMED`] where a name stands in its place.
    pub(crate) letter: u8,
    /// `None` where the slicer left a placeholder, as in `Y{machine_depth}`, or there is an expression.
    pub(crate) value: Option<f64>,
    /// Digits behind the decimal point.
    pub(crate) decimals: u32,
    /// As it stands in the line.
    pub(crate) text: &'a [u8],
    /// A name of several characters, before an equals sign; else empty.
    pub(crate) name: &'a [u8],
    /// What must be computed to get the value; else empty.
    pub(crate) expression: &'a [u8],
    pub(crate) exponent: Exponent,
}

/// Whether a number has an exponent.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) enum Exponent {
    #[default]
    None,
    /// It has one.
    Taken,
    /// What follows could be one, and is taken for the extruder's word.
    Word,
}

/// Letter of words that have a name instead.
pub(crate) const NAMED: u8 = b'=';

/// Something that is no word.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct MalformedWord<'a> {
    pub(crate) text: &'a [u8],
    pub(crate) what: &'static str,
}

/// The words of a line, in order; comments and the checksum are no words.
#[derive(Clone)]
pub(crate) struct Words<'a> {
    line: &'a [u8],
    at: usize,
}

impl<'a> Words<'a> {
    pub(crate) fn new(line: &'a [u8]) -> Words<'a> {
        Words { line, at: 0 }
    }

    /// What is not read yet, from the next thing that is neither space nor comment in parentheses.
    pub(crate) fn rest(&mut self) -> &'a [u8] {
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
    pub(crate) fn next(&mut self) -> Option<Result<Word<'a>, MalformedWord<'a>>> {
        let rest = self.rest();
        let letter = *rest.first()?;
        if letter == b';' || letter == b'*' {
            return None;
        }
        if !letter.is_ascii_alphabetic() {
            return Some(Err(MalformedWord {
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
            None if is_keyword(identifier(rest)) => return Some(Ok(self.keyword(rest))),
            None => {
                return Some(Err(MalformedWord { text: without_number(rest, from), what: "has no number" }));
            }
        };
        let mut length = from + found.length;
        let (mut value, mut decimals, mut exponent) = (found.value, found.decimals, Exponent::None);
        if matches!(rest.get(length), Some(b'e' | b'E')) {
            let digits;
            (exponent, digits) = self.exponent(rest, from, length);
            if exponent == Exponent::Taken {
                value = match scientific(&rest[from..length + digits]) {
                    Some(value) => value,
                    None => {
                        return Some(Err(MalformedWord {
                            text: token(rest),
                            what: "has an exponent out of range",
                        }));
                    }
                };
                // Says nothing about how finely the file is rounded.
                (length, decimals) = (length + digits, 0);
            }
        }
        let is_name = matches!(rest.get(length), Some(b' ' | b'\t')) && equals_at(rest, length) && !assigned;
        if !ends_at(rest, length) || is_name || (assigned && rest.get(length) == Some(&b'*')) {
            if assigned {
                return Some(self.expression(rest, 0, from));
            }
            if named(rest).is_some() {
                return Some(self.assignment(rest));
            }
            let text = &rest[..from + token(&rest[from..]).len()];
            return Some(Err(MalformedWord { text, what: "is no letter with a number" }));
        }
        self.at += length;
        let (value, text) = (Some(value), &rest[..length]);
        let letter = letter.to_ascii_uppercase();
        Some(Ok(Word { letter, value, decimals, text, name: b"", expression: b"", exponent }))
    }

    /// A name that stands alone.
    fn keyword(&mut self, rest: &'a [u8]) -> Word<'a> {
        let name = identifier(rest);
        self.at += name.len();
        let exponent = Exponent::None;
        Word { letter: NAMED, value: None, decimals: 0, text: name, name, expression: b"", exponent }
    }

    /// A name of several characters, an equals sign, and a value.
    fn assignment(&mut self, rest: &'a [u8]) -> Result<Word<'a>, MalformedWord<'a>> {
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
            Some(found)
                if ends_at(rest, from + found.length) && rest.get(from + found.length) != Some(&b'*') =>
            {
                let length = from + found.length;
                self.at += length;
                let (value, decimals, text) = (Some(found.value), found.decimals, &rest[..length]);
                Ok(Word {
                    letter: NAMED,
                    value,
                    decimals,
                    text,
                    name,
                    expression: b"",
                    exponent: Exponent::None,
                })
            }
            _ => self.expression(rest, name.len(), from),
        }
    }

    /// The letter, or the name of so many characters, of `rest` with an expression that begins at `from`.
    fn expression(
        &mut self,
        rest: &'a [u8],
        name: usize,
        from: usize,
    ) -> Result<Word<'a>, MalformedWord<'a>> {
        let assigned = rest[..from].contains(&b'=');
        let length = from + expression_length(&rest[from..], assigned);
        let text = &rest[..length];
        if length == from {
            return Err(MalformedWord { text: &rest[..from], what: "has no number" });
        }
        self.at += length;
        let letter = if name > 0 { NAMED } else { rest[0].to_ascii_uppercase() };
        let expression = &rest[from..length];
        let (name, exponent) = (&rest[..name], Exponent::None);
        Ok(Word { letter, value: None, decimals: 0, text, name, expression, exponent })
    }

    /// Whether an exponent follows the number at `rest[from..length]`, and how many bytes it takes.
    #[cold]
    fn exponent(&self, rest: &[u8], from: usize, length: usize) -> (Exponent, usize) {
        let none = (Exponent::None, 0);
        let mantissa = &rest[from..length];
        let unsigned = mantissa.strip_prefix(b"-").or(mantissa.strip_prefix(b"+")).unwrap_or(mantissa);
        let is_normal = matches!(unsigned, [b'1'..=b'9'] | [b'1'..=b'9', b'.', ..]);
        let [mark, sign @ (b'-' | b'+'), digits @ ..] = &rest[length..] else { return none };
        let count = digits.iter().take_while(|b| b.is_ascii_digit()).count();
        if !(1..=3).contains(&count) || digits.get(count) == Some(&b'.') {
            return none;
        }
        let letter = rest[0];
        let differs = mark.is_ascii_lowercase() != letter.is_ascii_lowercase();
        // Java's have a point in front, C#'s two digits, JavaScript's a small e.
        let is_unusual = *sign == b'-'
            && count == 1
            && (matches!(digits[0], b'0'..=b'3') || (*mark == b'E' && !mantissa.contains(&b'.')));
        let exponent = if !is_normal || (is_unusual && !differs) {
            // Retractions look like this where words need no spaces.
            if differs || self.is_spaced() { Exponent::Word } else { Exponent::None }
        } else if *sign == b'+'
            || (count > 1 && digits[0] == b'0')
            || differs
            || letter.eq_ignore_ascii_case(&b'e')
            || self.is_spaced()
            || self.has_another_e(self.line.len() - rest.len() + length)
        {
            Exponent::Taken
        } else {
            Exponent::Word
        };
        (exponent, 2 + count)
    }

    /// Whether a space stands before every word of the line up to here.
    fn is_spaced(&self) -> bool {
        let read = &self.line[..=self.at];
        let inner = read.windows(2).filter(|pair| pair[1].is_ascii_alphabetic());
        self.at > 0 && inner.into_iter().all(|pair| matches!(pair[0], b' ' | b'\t'))
    }

    /// Whether the line has an E with a number elsewhere than at `here`.
    fn has_another_e(&self, here: usize) -> bool {
        let code = self.line.iter().position(|b| matches!(b, b';' | b'(' | b'*')).unwrap_or(self.line.len());
        (0..code).any(|at| {
            at != here && matches!(self.line[at], b'e' | b'E') && number(&self.line[at + 1..]).is_some()
        })
    }

    fn placeholder(&mut self, rest: &'a [u8], from: usize) -> Result<Word<'a>, MalformedWord<'a>> {
        let Some(close) = rest[from..].iter().position(|b| *b == b'}') else {
            return Err(MalformedWord { text: token(rest), what: "opens a brace and does not close it" });
        };
        let text = &rest[..=from + close];
        self.at += text.len();
        let letter = rest[0].to_ascii_uppercase();
        Ok(Word {
            letter,
            value: None,
            decimals: 0,
            text,
            name: b"",
            expression: b"",
            exponent: Exponent::None,
        })
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

/// Whether a name may stand alone among words: Siemens' travels in the machine's coordinates.
fn is_keyword(name: &[u8]) -> bool {
    name.eq_ignore_ascii_case(b"SUPA")
}

/// Whether an equals sign stands behind spaces at this place.
#[inline]
fn equals_at(rest: &[u8], length: usize) -> bool {
    rest[length..].iter().find(|b| !matches!(b, b' ' | b'\t')) == Some(&b'=')
}

/// The name of two characters or more that `text` begins with, if an equals sign follows.
pub(crate) fn named(text: &[u8]) -> Option<&[u8]> {
    let name = identifier(text);
    let behind = text[name.len()..].iter().find(|b| !matches!(b, b' ' | b'\t'));
    (name.len() > 1 && behind == Some(&b'=')).then_some(name)
}

/// The letters, digits and underscores that `text` begins with, the first of them no digit.
pub(crate) fn identifier(text: &[u8]) -> &[u8] {
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

/// What stands behind a line's number.
pub(crate) fn behind_number(start: &[u8]) -> &[u8] {
    let digits = start[1..].iter().take_while(|b| b.is_ascii_digit()).count();
    start[1 + digits..].trim_ascii_start()
}

/// Bytes up to the next space, semicolon or checksum; one at least.
pub(crate) fn token(text: &[u8]) -> &[u8] {
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
pub(crate) struct ParsedNumber {
    pub(crate) value: f64,
    /// Bytes that it takes.
    pub(crate) length: usize,
    pub(crate) decimals: u32,
}

/// Powers of ten that are exact in binary.
const TENS: [f64; 16] =
    [1e0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9, 1e10, 1e11, 1e12, 1e13, 1e14, 1e15];

/// The number that `text` begins with, rounded correctly: sign, digits, point, digits; at least one digit.
#[inline]
pub(crate) fn number(text: &[u8]) -> Option<ParsedNumber> {
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
    Some(ParsedNumber { value, length: at, decimals: decimals as u32 })
}

/// A number with an exponent; `None` if it is not finite.
fn scientific(text: &[u8]) -> Option<f64> {
    let text = text.strip_prefix(b"+").unwrap_or(text);
    fast_float2::parse::<f64, _>(text).ok().filter(|value| value.is_finite())
}

/// A piece of a file as it may stand in a message: printable, on one line, and short.
pub(crate) fn quote(text: &[u8]) -> String {
    const SHOWN: usize = 40;
    let shown = String::from_utf8_lossy(&text[..text.len().min(SHOWN)]);
    let more = if text.len() > SHOWN { "..." } else { "" };
    format!("\"{}{more}\"", shown.escape_debug())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn words(line: &str) -> Vec<(char, f64, Exponent)> {
        let mut words = Words::new(line.as_bytes());
        let mut found = Vec::new();
        while let Some(word) = words.next() {
            let word = word.unwrap();
            found.push((char::from(word.letter), word.value.unwrap(), word.exponent));
        }
        found
    }

    #[test]
    fn exponents_are_no_extruder_words() {
        for (line, value) in [
            ("G1 X20 Y1.2e-05", 1.2e-5),
            ("G1 X20 Y-1.2e-05 E0.8", -1.2e-5),
            ("G1 X20 Y1.2E-5", 1.2e-5),
            ("G1 X20 Y5e-7", 5e-7),
            ("G1 X20 Y1e-3", 1e-3),
            ("G1X20Y5.5e-2", 5.5e-2),
            ("G1X20Y1.2e-05E0.8", 1.2e-5),
            ("G1X20Y1.2e-5", 1.2e-5),
            ("G1E0.8X20Y1.2E-5", 1.2e-5),
            ("g1x20y1.2E-5", 1.2e-5),
            ("G1X20Y1.2E+01", 12.0),
            ("G1 X20 Y1.25e+2 E1", 125.0),
            ("G1 X20 Y3.0e-310", 3.0e-310),
        ] {
            let found = words(line);
            let y = found.iter().find(|word| word.0 == 'Y').unwrap();
            assert_eq!((y.1, y.2), (value, Exponent::Taken), "{line}");
        }
        let e = words("G1 X2 E5.5e-05");
        assert_eq!(e[2], ('E', 5.5e-5, Exponent::Taken));
    }

    #[test]
    fn extruder_words_are_no_exponents() {
        for (line, e) in [
            ("G1X1E5", 5.0),
            ("G1X1e5", 5.0),
            ("g1x1e5", 5.0),
            ("G1X10E-0.5", -0.5),
            ("g1x10e-0.5", -0.5),
            ("G1X10Y5E-2", -2.0),
            ("G1X10Y20E-5", -5.0),
            ("G1X10Y0.5E-5", -5.0),
            ("G1 X10E-5.0", -5.0),
            ("X20 E0.8", 0.8),
            ("G1X5E-2", -2.0),
        ] {
            let found = words(line);
            assert_eq!(found.last(), Some(&('E', e, Exponent::None)), "{line}");
            assert!(found.iter().all(|word| word.2 == Exponent::None), "{line}");
        }
    }

    #[test]
    fn what_can_be_both_is_a_word_and_told() {
        for line in
            ["G1X10Y5.5E-6", "g1x10y5.5e-6", "G1X10Y5E-15", "G1 X9 Y5E-6", "G1 X9 Y10E-5", "G1 X9 Y20.5e-3"]
        {
            let found = words(line);
            assert_eq!(found[2].2, Exponent::Word, "{line}");
            assert_eq!(found[3].0, 'E', "{line}");
        }
    }

    #[test]
    fn exponents_out_of_range_are_malformed() {
        let mut words = Words::new(b"G1 X1.0e+999");
        words.next();
        assert!(words.next().unwrap().is_err());
    }
}
