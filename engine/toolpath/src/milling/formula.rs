//! Expressions of macros: `#1`, `[#1+2.]`, functions of angles in degrees, comparisons.
//!
//! Where controls differ, what they would compute apart from each other is refused: signs of MOD and FIX, angles below zero, and
//! comparisons of numbers that rounding alone tells apart. An empty variable counts as 0, and only EQ and NE tell it from that.

use super::variables::{MacroVariables, VariableName};
use crate::toolpath::gcode::tilt::sine_and_cosine;
use crate::toolpath::gcode::words::number;

/// Brackets within brackets.
const DEPTH_MAX: u32 = 32;
/// Numbers that differ by less than this share are one but for rounding.
const ROUNDING: f64 = 1e-9;

/// A value, and whether a comparison made it.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Computed {
    value: Option<f64>,
    is_answer: bool,
}

impl Computed {
    fn number(self) -> f64 {
        self.value.unwrap_or(0.0)
    }
}

/// Reads expressions off a text in capital letters, without spaces and comments.
pub(super) struct FormulaReader<'t> {
    pub text: &'t [u8],
    pub at: usize,
    variables: &'t MacroVariables,
    depth: u32,
    /// Whether what is computed is the number of a word.
    pub in_word: bool,
}

impl<'t> FormulaReader<'t> {
    pub fn new(text: &'t [u8], variables: &'t MacroVariables) -> FormulaReader<'t> {
        FormulaReader { text, at: 0, variables, depth: 0, in_word: false }
    }

    pub fn rest(&self) -> &'t [u8] {
        &self.text[self.at..]
    }

    /// Passes over a word if it stands here.
    pub fn take(&mut self, word: &[u8]) -> bool {
        let is_here = self.rest().starts_with(word);
        self.at += if is_here { word.len() } else { 0 };
        is_here
    }

    /// An expression up to where none can go on; `None` if it is an empty variable.
    ///
    /// # Errors
    /// If it cannot be computed, with the reason.
    pub fn expression(&mut self) -> Result<Option<f64>, String> {
        Ok(self.joined()?.value)
    }

    /// A condition in brackets.
    ///
    /// # Errors
    /// If it is none, with the reason.
    pub fn condition(&mut self) -> Result<bool, String> {
        let found = self.factor()?;
        match found.is_answer {
            true => Ok(found.number() != 0.0),
            false => Err("has a condition that compares nothing".to_owned()),
        }
    }

    /// A variable or an expression in brackets, with a sign in front.
    ///
    /// # Errors
    /// If it is none, with the reason.
    pub fn signed(&mut self) -> Result<Option<f64>, String> {
        let sign = if self.take(b"-") { Some(-1.0) } else { self.take(b"+").then_some(1.0) };
        match (sign, self.factor()?.value) {
            (None, value) => Ok(value),
            (Some(sign), Some(value)) => Ok(Some(sign * value)),
            (Some(_), None) => Err("gives an empty variable a sign".to_owned()),
        }
    }

    /// The name of a variable, behind its mark.
    ///
    /// # Errors
    /// If it is none, with the reason.
    pub fn name(&mut self) -> Result<VariableName, String> {
        if !self.take(b"#") {
            return Err("needs a variable, as #101".to_owned());
        }
        if self.take(b"<") {
            let end = self.rest().iter().position(|b| *b == b'>').ok_or("has a name without an end")?;
            let name = self.rest()[..end].to_vec();
            self.at += end + 1;
            return Ok(VariableName::Named(name));
        }
        let found = match self.rest().first() {
            Some(b'0'..=b'9') => {
                let length = self.rest().iter().take_while(|b| b.is_ascii_digit()).count();
                let digits = String::from_utf8_lossy(&self.rest()[..length]).into_owned();
                self.at += length;
                return digits.parse().map(VariableName::Number).map_err(|_| not_understood());
            }
            Some(b'#' | b'[') => self.factor()?.value,
            _ => return Err("needs a variable, as #101".to_owned()),
        };
        match found {
            Some(value) if value.fract() == 0.0 && (0.0..1e9).contains(&value) => {
                Ok(VariableName::Number(value as u32))
            }
            _ => Err("takes a variable by what is no whole number".to_owned()),
        }
    }

    /// Answers that AND, OR and XOR join.
    fn joined(&mut self) -> Result<Computed, String> {
        let mut found = self.compared()?;
        let mut before = None;
        while let Some(word) = ["AND", "OR", "XOR"].into_iter().find(|word| self.take(word.as_bytes())) {
            if before.replace(word).is_some_and(|before| before != word) {
                return Err(format!("mixes {word} with another one, where controls differ: set brackets"));
            }
            let next = self.compared()?;
            if !(found.is_answer && next.is_answer) {
                return Err(format!(
                    "joins numbers by {word}, where controls differ: compare them in brackets"
                ));
            }
            let (one, other) = (found.number() != 0.0, next.number() != 0.0);
            found = answer(match word {
                "AND" => one && other,
                "OR" => one || other,
                _ => one != other,
            });
        }
        Ok(found)
    }

    fn compared(&mut self) -> Result<Computed, String> {
        let one = self.sum()?;
        let words = ["EQ", "NE", "GT", "GE", "LT", "LE"];
        let Some(word) = words.into_iter().find(|word| self.take(word.as_bytes())) else { return Ok(one) };
        let other = self.sum()?;
        if matches!(word, "EQ" | "NE") && (one.value.is_none() || other.value.is_none()) {
            return Ok(answer((one.value == other.value) == (word == "EQ")));
        }
        let (p, q) = (one.number(), other.number());
        let compare = |p: f64, q: f64| match word {
            "EQ" => p == q,
            "NE" => p != q,
            "GT" => p > q,
            "GE" => p >= q,
            "LT" => p < q,
            _ => p <= q,
        };
        let is_near = (p - q).abs() <= ROUNDING * p.abs().max(q.abs()).max(1.0);
        if is_near && compare(p, q) != compare(q, q) {
            return Err(format!("compares by {word} {p} and {q}, which rounding alone tells apart"));
        }
        Ok(answer(compare(p, q)))
    }

    fn sum(&mut self) -> Result<Computed, String> {
        let mut found = self.product()?;
        while let Some(sign @ (b'+' | b'-')) = self.rest().first() {
            self.at += 1;
            let next = self.product()?.number();
            found = computed(if *sign == b'+' { found.number() + next } else { found.number() - next })?;
        }
        Ok(found)
    }

    fn product(&mut self) -> Result<Computed, String> {
        let mut found = self.power()?;
        loop {
            if self.take(b"*") {
                found = computed(found.number() * self.power()?.number())?;
            } else if self.take(b"/") {
                let by = self.power()?.number();
                if by == 0.0 {
                    return Err("divides by zero".to_owned());
                }
                found = computed(found.number() / by)?;
            } else if self.take(b"MOD") {
                found = computed(remainder(found.number(), self.power()?.number())?)?;
            } else {
                return Ok(found);
            }
        }
    }

    fn power(&mut self) -> Result<Computed, String> {
        let found = self.factor()?;
        match self.take(b"**") {
            true => computed(libm::pow(found.number(), self.factor()?.number())),
            false => Ok(found),
        }
    }

    fn factor(&mut self) -> Result<Computed, String> {
        if self.depth == DEPTH_MAX {
            return Err("has more brackets within each other than can be followed".to_owned());
        }
        self.depth += 1;
        let found = self.factor_within()?;
        self.depth -= 1;
        Ok(found)
    }

    fn factor_within(&mut self) -> Result<Computed, String> {
        match self.rest().first() {
            Some(b'#') => {
                let name = self.name()?;
                Ok(Computed { value: self.variables.get(&name)?, is_answer: false })
            }
            Some(b'[') => {
                self.at += 1;
                let found = self.joined()?;
                if !self.take(b"]") {
                    return Err(
                        "lacks a closing bracket, or has what is not understood in brackets".to_owned()
                    );
                }
                Ok(found)
            }
            Some(sign @ (b'-' | b'+')) => {
                self.at += 1;
                let found = self.factor()?.number();
                computed(if *sign == b'-' { -found } else { found })
            }
            Some(b'0'..=b'9' | b'.') => {
                let found = number(self.rest()).ok_or_else(not_understood)?;
                self.at += found.length;
                computed(found.value)
            }
            Some(b'A'..=b'Z') => self.function(),
            _ => Err(not_understood()),
        }
    }

    fn function(&mut self) -> Result<Computed, String> {
        let length = self.rest().iter().take_while(|b| b.is_ascii_alphabetic()).count();
        let name = String::from_utf8_lossy(&self.rest()[..length]).into_owned();
        self.at += length;
        if self.rest().first() != Some(&b'[') {
            return Err(not_understood());
        }
        let of = self.factor()?.number();
        computed(match name.as_str() {
            "ATAN" if self.take(b"/") => {
                let across = self.factor()?.number();
                if (of, across) == (0.0, 0.0) {
                    return Err("takes ATAN of no direction".to_owned());
                }
                angle(libm::atan2(of, across))?
            }
            "ATAN" => angle(libm::atan(of))?,
            "ASIN" | "ACOS" if of.abs() > 1.0 => return Err(format!("takes {name} of {of}")),
            "ASIN" => angle(libm::asin(of))?,
            "ACOS" => angle(libm::acos(of))?,
            "SIN" => sine_and_cosine(of).0,
            "COS" => sine_and_cosine(of).1,
            "TAN" => match sine_and_cosine(of) {
                (_, 0.0) => return Err(format!("takes TAN of {of}")),
                (sine, cosine) => sine / cosine,
            },
            "SQRT" | "SQR" if of < 0.0 => return Err(format!("takes the root of {of}")),
            "SQRT" | "SQR" => of.sqrt(),
            "ABS" => of.abs(),
            "LN" if of <= 0.0 => return Err(format!("takes LN of {of}")),
            "LN" => libm::log(of),
            "EXP" => libm::exp(of),
            // FANUC rounds there to the smallest step of the machine, LinuxCNC to whole numbers.
            "ROUND" | "RND" if self.in_word => {
                return Err("rounds within a word, where controls differ: set a variable before".to_owned());
            }
            "ROUND" | "RND" => whole(of, of.abs() + 0.5, f64::round)?,
            "FIX" | "FUP" if of < 0.0 => {
                return Err(format!(
                    "takes {name} of a negative number, which controls round in different ways"
                ));
            }
            "FIX" => whole(of, of, f64::floor)?,
            "FUP" => whole(of, of, f64::ceil)?,
            _ => return Err(format!("has the function {name}, which is not read")),
        })
    }
}

fn answer(is_true: bool) -> Computed {
    Computed { value: Some(f64::from(u8::from(is_true))), is_answer: true }
}

fn computed(value: f64) -> Result<Computed, String> {
    match value.is_finite() {
        true => Ok(Computed { value: Some(value), is_answer: false }),
        false => Err("has no value that is finite".to_owned()),
    }
}

fn not_understood() -> String {
    "is an expression that is not understood".to_owned()
}

/// An angle in degrees, of which no control would tell another one.
fn angle(radians: f64) -> Result<f64, String> {
    let degrees = radians.to_degrees();
    match degrees < 0.0 {
        true => Err(format!("has the angle {degrees}, which some controls tell as {}", degrees + 360.0)),
        false => Ok(degrees),
    }
}

/// A number rounded to a whole one, unless rounding alone decides: `step` is whole where the result jumps.
fn whole(value: f64, step: f64, to: fn(f64) -> f64) -> Result<f64, String> {
    let off = (step - step.round()).abs();
    match off != 0.0 && off <= ROUNDING * step.abs().max(1.0) {
        true => Err(format!("rounds {value}, where rounding before decides")),
        false => Ok(to(value)),
    }
}

/// What is left of a division.
fn remainder(of: f64, by: f64) -> Result<f64, String> {
    if by == 0.0 {
        return Err("divides by zero".to_owned());
    }
    if of < 0.0 || by < 0.0 {
        return Err("takes MOD of a negative number, which controls carry out in different ways".to_owned());
    }
    let left = of % by;
    let is_near = left != 0.0 && left.min(by - left) <= ROUNDING * by;
    if is_near {
        return Err(format!("takes {of} MOD {by}, where rounding before decides"));
    }
    Ok(left)
}
