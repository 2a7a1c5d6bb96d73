//! Lines of numbers, whatever separates them: blanks, tabs, commas or semicolons, with decimal points or, as programs
//! write them in many countries, decimal commas.

use super::text;
use memchr::{memchr, memchr2};

/// Longest number with a decimal comma.
const NUMBER_BYTES: usize = 64;

/// How the lines of a text separate their numbers, as far as the lines so far have shown it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Separators {
    /// Whether commas are decimal points; `None` as long as there was neither a comma nor a point.
    decimal_comma: Option<bool>,
}

impl Separators {
    /// Replaces `fields` by the fields of `line`. One that is empty, between two commas or semicolons, is kept.
    ///
    /// # Errors
    /// What is wrong with the line: separators of two kinds, or decimal commas among decimal points.
    pub fn split<'a>(&mut self, line: &'a [u8], fields: &mut Vec<&'a [u8]>) -> Result<(), String> {
        fields.clear();
        match memchr2(b',', b';', line) {
            None => fields.extend(words(line)),
            Some(_) if memchr(b';', line).is_some() => {
                pieces(line, b';', fields);
                if memchr(b',', line).is_some() {
                    return self.decide(true);
                }
            }
            Some(_) => return self.split_at_commas(line, fields),
        }
        // Whole numbers show nothing.
        if self.decimal_comma != Some(false) && memchr(b'.', line).is_some() {
            return self.decide(false);
        }
        Ok(())
    }

    fn split_at_commas<'a>(&mut self, line: &'a [u8], fields: &mut Vec<&'a [u8]>) -> Result<(), String> {
        pieces(line, b',', fields);
        let has_blanks = |field: &&[u8]| field.iter().any(|b| text::is_space(*b));
        let is_mixed = fields.iter().any(has_blanks);
        // "1,5, 2,5, 3,5": a comma between digits, and commas with blanks beside them.
        let is_doubled = words(line).count() >= 3 && words(line).map(trimmed).any(|w| w.contains(&b','));
        if (is_mixed || is_doubled && self.decimal_comma != Some(false)) && memchr(b'.', line).is_none() {
            let bare: Vec<&[u8]> =
                words(line).map(|word| if is_mixed { word } else { trimmed(word) }).collect();
            if bare.iter().all(|word| is_number_with_comma(word)) {
                *fields = bare;
                return self.decide(true);
            }
        }
        // "1 2 3, 0 0 1", and "1.5,2.5,3, 0 0 1", where a comma after a point can be neither.
        let is_separator = |word: &[u8]| {
            let comma = word.iter().rposition(|b| *b == b',');
            comma.is_none_or(|comma| memchr(b'.', &word[..comma]).is_some())
        };
        if is_mixed && words(line).map(trimmed).all(|word| !word.is_empty() && is_separator(word)) {
            fields.clear();
            fields.extend(words(line).flat_map(|word| trimmed(word).split(|b| *b == b',')));
            return self.decide(false);
        }
        match is_mixed {
            true => Err("commas and blanks both separate numbers (decimal commas?)".to_owned()),
            false => self.decide(false),
        }
    }

    fn decide(&mut self, comma: bool) -> Result<(), String> {
        match self.decimal_comma.replace(comma) {
            Some(before) if before != comma => Err(
                "decimal commas? this line and those before it have commas and points in different places"
                    .to_owned(),
            ),
            _ => Ok(()),
        }
    }

    /// Whether commas are decimal points.
    pub fn has_decimal_commas(&self) -> bool {
        self.decimal_comma == Some(true)
    }

    /// The number that takes up all of `field`.
    #[inline]
    pub fn number(&self, field: &[u8]) -> Option<f64> {
        if !self.has_decimal_commas() {
            return text::number(field);
        }
        let mut copy = [0; NUMBER_BYTES];
        let copy = copy.get_mut(..field.len())?;
        copy.copy_from_slice(field);
        if let Some(comma) = memchr(b',', copy) {
            copy[comma] = b'.';
        }
        text::number(copy)
    }
}

/// What stands between blanks.
fn words(line: &[u8]) -> impl Iterator<Item = &[u8]> {
    let mut rest = line;
    std::iter::from_fn(move || text::token(&mut rest))
}

/// What stands between separators; nothing after a last one is no field.
fn pieces<'a>(line: &'a [u8], separator: u8, fields: &mut Vec<&'a [u8]>) {
    fields.extend(line.split(|b| *b == separator).map(<[u8]>::trim_ascii));
    if fields.last().is_some_and(|last| last.is_empty()) {
        fields.pop();
    }
}

/// A word without the commas at its ends.
fn trimmed(word: &[u8]) -> &[u8] {
    let word = word.strip_prefix(b",").unwrap_or(word);
    word.strip_suffix(b",").unwrap_or(word)
}

/// True of "1,5", "-,5", "2" and "1,5e-3": at most one comma, and a digit after it.
fn is_number_with_comma(word: &[u8]) -> bool {
    let mut parts = word.split(|b| *b == b',');
    let (Some(whole), fraction, None) = (parts.next(), parts.next(), parts.next()) else { return false };
    let digits = whole.strip_prefix(b"-").or_else(|| whole.strip_prefix(b"+")).unwrap_or(whole);
    match fraction {
        None => text::number::<f64>(word).is_some(),
        Some(fraction) => {
            digits.iter().all(u8::is_ascii_digit) && fraction.first().is_some_and(u8::is_ascii_digit)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(lines: &[&str]) -> Result<Vec<Vec<Option<f64>>>, String> {
        let (mut separators, mut fields) = (Separators::default(), Vec::new());
        let mut all = Vec::new();
        for line in lines {
            separators.split(line.as_bytes(), &mut fields)?;
            all.push(fields.iter().map(|field| separators.number(field)).collect());
        }
        Ok(all)
    }

    #[test]
    fn separators_are_told_apart() {
        let some = |numbers: &[f64]| numbers.iter().map(|n| Some(*n)).collect::<Vec<_>>();
        for (line, expected) in [
            ("1 2\t 3", &[1.0, 2.0, 3.0][..]),
            ("1,2,3", &[1.0, 2.0, 3.0]),
            ("1, 2, 3,", &[1.0, 2.0, 3.0]),
            ("1.5,2, 3", &[1.5, 2.0, 3.0]),
            ("1.5,2.5,3, 0 0 1", &[1.5, 2.5, 3.0, 0.0, 0.0, 1.0]),
            ("1 2, 3", &[1.0, 2.0, 3.0]),
            ("1.5 2.5, 3", &[1.5, 2.5, 3.0]),
            ("1 ; 2;3;", &[1.0, 2.0, 3.0]),
            ("1.5;2.5;3", &[1.5, 2.5, 3.0]),
            ("1,5;-2,5e1;3", &[1.5, -25.0, 3.0]),
            ("1,5 0,0 -2,5", &[1.5, 0.0, -2.5]),
            ("1,5\t2\t,5", &[1.5, 2.0, 0.5]),
            ("1,5, 2,5, 3", &[1.5, 2.5, 3.0]),
            ("0,0 0,0 0,0", &[0.0, 0.0, 0.0]),
        ] {
            assert_eq!(read(&[line]).unwrap(), [some(expected)], "{line}");
        }
        assert_eq!(read(&["1,,3"]).unwrap(), [[Some(1.0), None, Some(3.0)]]);
        assert_eq!(read(&["0 0 0", "1,5 0 0"]).unwrap()[1], some(&[1.5, 0.0, 0.0]));
    }

    #[test]
    fn what_could_be_two_things_is_refused() {
        for lines in [
            &["1,234.5 2.0 3.0"][..],
            &["1,2,3 4,5,6"],
            &["1.5 2.5 3.5", "1,5 2,5 3,5"],
            &["1,5 2,5 3,5", "1.5 2.5 3.5"],
            &["1,5;2,5;3,5", "1.5;2.5;3.5"],
            &["1,2,3", "1,5 2,5 3,5"],
        ] {
            let said = read(lines).unwrap_err();
            assert!(said.contains("decimal commas?"), "{lines:?}: {said}");
        }
    }
}
