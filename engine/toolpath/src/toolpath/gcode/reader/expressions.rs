//! Variables of programs and what is computed from them: `#200`, `#<name>`, `R1`, names, with + - * / and
//! brackets.

use super::words::{identifier, number, quote};
use std::collections::BTreeMap;

/// Brackets within brackets.
const DEPTH_MAX: u32 = 32;

/// Most variables of a program.
const VARIABLES_MAX: usize = 1 << 16;

/// Variables that have a value, by their names in upper case.
#[derive(Default)]
pub(super) struct Variables {
    values: BTreeMap<Vec<u8>, f64>,
}

impl Variables {
    /// Variables that the caller knows.
    pub(super) fn new(known: &[(String, f64)]) -> Variables {
        let values = known.iter().map(|(name, value)| (key(name.as_bytes()), *value)).collect();
        Variables { values }
    }

    /// Gives a variable a value, or takes it away.
    pub(super) fn set(&mut self, name: &[u8], value: Option<f64>) {
        match value {
            Some(value) if self.values.len() < VARIABLES_MAX => drop(self.values.insert(key(name), value)),
            _ => drop(self.values.remove(&key(name))),
        }
    }

    /// The value of an expression.
    ///
    /// # Errors
    /// If a variable has no value, or the expression is none that is understood; with the reason.
    pub(super) fn evaluate(&self, text: &[u8]) -> Result<f64, String> {
        let mut parser = Parser { variables: self, text, at: 0, depth: 0 };
        let value = parser.sum()?;
        parser.skip_spaces();
        if parser.at < text.len() {
            return Err(format!("the expression {} is not understood", quote(text)));
        }
        match value.is_finite() {
            true => Ok(value),
            false => Err(format!("the expression {} has no value", quote(text))),
        }
    }
}

/// A variable's name in upper case, without spaces, so that `#<Z>` and `#<z>` are one, as are `#07` and `#7`.
fn key(name: &[u8]) -> Vec<u8> {
    let name: Vec<u8> =
        name.iter().filter(|b| !b.is_ascii_whitespace()).map(u8::to_ascii_uppercase).collect();
    let sign = name.iter().take_while(|b| matches!(b, b'#' | b'R')).count().min(1);
    let digits = &name[sign..];
    if sign == 1 && digits.len() > 1 && digits.iter().all(u8::is_ascii_digit) {
        let zeros = digits[..digits.len() - 1].iter().take_while(|b| **b == b'0').count();
        return [&name[..1], &digits[zeros..]].concat();
    }
    name
}

struct Parser<'a> {
    variables: &'a Variables,
    text: &'a [u8],
    at: usize,
    depth: u32,
}

impl Parser<'_> {
    fn skip_spaces(&mut self) {
        while matches!(self.text.get(self.at), Some(b' ' | b'\t')) {
            self.at += 1;
        }
    }

    fn peek(&mut self) -> Option<u8> {
        self.skip_spaces();
        self.text.get(self.at).copied()
    }

    fn sum(&mut self) -> Result<f64, String> {
        let mut value = self.product()?;
        while let Some(sign @ (b'+' | b'-')) = self.peek() {
            self.at += 1;
            let next = self.product()?;
            value = if sign == b'+' { value + next } else { value - next };
        }
        Ok(value)
    }

    fn product(&mut self) -> Result<f64, String> {
        let mut value = self.factor()?;
        while let Some(sign @ (b'*' | b'/')) = self.peek() {
            self.at += 1;
            let next = self.factor()?;
            value = if sign == b'*' { value * next } else { value / next };
        }
        Ok(value)
    }

    fn factor(&mut self) -> Result<f64, String> {
        let not_understood = || format!("the expression {} is not understood", quote(self.text));
        if self.depth == DEPTH_MAX {
            return Err(not_understood());
        }
        match self.text.get(self.at..).unwrap_or_default().trim_ascii_start().first() {
            Some(b'-' | b'+') => {
                let sign = self.peek();
                self.at += 1;
                self.depth += 1;
                let value = self.factor()?;
                self.depth -= 1;
                Ok(if sign == Some(b'-') { -value } else { value })
            }
            Some(b'(' | b'[') => self.bracket(),
            Some(b'#') => self.numbered(),
            Some(first) if first.is_ascii_digit() || *first == b'.' => {
                self.skip_spaces();
                let found = number(&self.text[self.at..]).ok_or_else(not_understood)?;
                self.at += found.length;
                Ok(found.value)
            }
            Some(_) => self.named(),
            None => Err(not_understood()),
        }
    }

    fn bracket(&mut self) -> Result<f64, String> {
        let close = if self.peek() == Some(b'(') { b')' } else { b']' };
        self.at += 1;
        self.depth += 1;
        let value = self.sum()?;
        self.depth -= 1;
        if self.peek() != Some(close) {
            return Err(format!("the expression {} lacks a closing bracket", quote(self.text)));
        }
        self.at += 1;
        Ok(value)
    }

    /// `#12` or `#<name>`.
    fn numbered(&mut self) -> Result<f64, String> {
        self.skip_spaces();
        let rest = &self.text[self.at..];
        let length = match rest.get(1) {
            Some(b'<') => rest.iter().position(|b| *b == b'>').map_or(rest.len(), |end| end + 1),
            _ => 1 + rest[1..].iter().take_while(|b| b.is_ascii_digit()).count(),
        };
        self.at += length;
        self.value_of(&rest[..length])
    }

    /// A variable by its name, or a coordinate that is said to be absolute: `AC(12)`.
    fn named(&mut self) -> Result<f64, String> {
        self.skip_spaces();
        let rest = &self.text[self.at..];
        let name = identifier(rest);
        if name.is_empty() {
            return Err(format!("the expression {} is not understood", quote(self.text)));
        }
        self.at += name.len();
        if self.peek() == Some(b'(') {
            return match name.eq_ignore_ascii_case(b"AC") {
                true => self.bracket(),
                false => Err(format!("the function {} is not read: export plain numbers", quote(name))),
            };
        }
        self.value_of(name)
    }

    fn value_of(&self, name: &[u8]) -> Result<f64, String> {
        self.variables.values.get(&key(name)).copied().ok_or_else(|| {
            let shown = quote(name);
            let plain = shown.trim_matches('"');
            format!("the variable {plain} has no value in the file: give it, as in `variable` '{plain}=0'")
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn expressions_have_the_value_of_arithmetic() {
        let mut variables = Variables::new(&[("#200".to_owned(), 2.0), ("r1".to_owned(), 10.0)]);
        variables.set(b"#<Table>", Some(-3.0));
        variables.set(b"START", Some(0.5));
        for (text, expected) in [
            ("1.5", 1.5),
            ("[#200 + 0.25]", 2.25),
            ("#0200*-R1", -20.0),
            ("R01/4-#<table>", 5.5),
            ("AC(start)+(1+2)*3", 9.5),
            ("--2", 2.0),
            ("8/2/2", 2.0),
        ] {
            assert_eq!(variables.evaluate(text.as_bytes()), Ok(expected), "{text}");
        }
        for text in ["", "#201", "R2", "1+", "[1", "IC(5)", "1/0", "SIN[30]", "1 2", "#", "$P"] {
            assert!(variables.evaluate(text.as_bytes()).is_err(), "{text}");
        }
        assert!(variables.evaluate(&b"[".repeat(10_000)).is_err());
        assert!(variables.evaluate(b"#201").unwrap_err().contains("`variable` '#201=0'"));
        variables.set(b"#200", None);
        assert!(variables.evaluate(b"#200").is_err());
    }
}
