//! Lines of macros as a program meets them: variables, jumps, loops, and calls that pass values.

use super::formula::FormulaReader;
use super::program::{Call, Flow};
use super::reader::After;
use super::statement::{Statement, cleaned, statement};
use super::variables::LocalVariables;
use crate::error::Result;
use crate::toolpath::gcode::words::Words;
use std::collections::BTreeMap;

/// What to do about lines that cannot be followed.
const REMEDY: &str = "correct the line, or post-process without macros";
/// Letters of a call and the variables that they set.
const ARGUMENTS: [(u8, u32); 21] = [
    (b'A', 1),
    (b'B', 2),
    (b'C', 3),
    (b'I', 4),
    (b'J', 5),
    (b'K', 6),
    (b'D', 7),
    (b'E', 8),
    (b'F', 9),
    (b'H', 11),
    (b'M', 13),
    (b'Q', 17),
    (b'R', 18),
    (b'S', 19),
    (b'T', 20),
    (b'U', 21),
    (b'V', 22),
    (b'W', 23),
    (b'X', 24),
    (b'Y', 25),
    (b'Z', 26),
];
/// Those whose numbers mean the same without a decimal point.
const WHOLE: &[u8] = b"DHMST";
/// Variables that a call of LinuxCNC sets, to 0 where it passes no value.
const PASSED: u32 = 30;

impl Flow<'_, '_> {
    /// Carries a line of a macro out: the line to go on with, or `None` at the program's end.
    pub(super) fn macro_line(&mut self, at: usize, line: &[u8], clean: &[u8]) -> Result<Option<usize>> {
        let asked = statement(clean, &self.variables);
        match asked.map_err(|what| self.wrong_line(clean, &what))? {
            Statement::Set(name, value) => {
                let set = self.variables.set(name, value);
                set.map_err(|what| self.wrong_line(clean, &what))?;
                Ok(Some(at + 1))
            }
            Statement::Jump(None) => Ok(Some(at + 1)),
            Statement::Jump(Some(number)) => self.jump(at, number, clean).map(Some),
            Statement::Loop { number, goes_on } => match self.jumps.end_of(at) {
                Some(_) if goes_on => Ok(Some(at + 1)),
                Some(end) => Ok(Some(end + 1)),
                None => {
                    let what = format!("begins a loop without END{number} of its own");
                    Err(self.wrong_line(clean, &what))
                }
            },
            Statement::LoopEnd(number) => match self.jumps.begin_of(at) {
                Some(begin) => {
                    self.repeats = true;
                    Ok(Some(begin))
                }
                None => {
                    let what = format!("ends a loop that no DO{number} begins");
                    Err(self.wrong_line(clean, &what))
                }
            },
            Statement::Words(plain) => {
                self.reader.read_comments(line);
                match self.macro_call(at, &plain)? {
                    Some(next) => Ok(Some(next)),
                    None => {
                        let after = self.reader.read_words(&plain)?;
                        self.go_on(at, after)
                    }
                }
            }
        }
    }

    /// GOTO: a block of this program, as far as it reaches between two O numbers.
    fn jump(&mut self, at: usize, number: u64, clean: &[u8]) -> Result<usize> {
        let from = self.blocks.programs.range(..=at).next_back().map_or(0, |(begin, _)| *begin);
        let to = self.blocks.programs.range(at + 1..).next().map_or(self.lines.len(), |(begin, _)| *begin);
        let found = match self.jumps.blocks(number, from, to) {
            [found] => *found,
            [] => {
                return Err(self.wrong_line(clean, &format!("goes to N{number}, which this program has not")));
            }
            _ => {
                return Err(
                    self.wrong_line(clean, &format!("goes to N{number}, which this program has twice"))
                );
            }
        };
        if self.jumps.enters_loop(at, found) {
            return Err(self.wrong_line(clean, &format!("goes to N{number}, into a loop from outside")));
        }
        self.repeats |= found <= at;
        Ok(found)
    }

    /// The error of a line that cannot be followed.
    fn wrong_line(&self, clean: &[u8], what: &str) -> crate::error::Error {
        self.reader.out.refused(shown(clean), what, REMEDY)
    }

    /// G65: the line to go on with, or `None` if the words call nothing.
    pub(super) fn macro_call(&mut self, at: usize, line: &[u8]) -> Result<Option<usize>> {
        if !line.windows(2).any(|text| text == b"65") {
            return Ok(None);
        }
        let (mut arguments, mut name, mut is_call) = (BTreeMap::new(), None, false);
        let mut words = Words::new(line.strip_prefix(b"/").unwrap_or(line));
        let wrong = |word: &[u8], what: &str| self.reader.out.refused(word, what, REMEDY);
        while let Some(word) = words.next() {
            let word = match word {
                Ok(word) => word,
                Err(malformed) if is_call => return Err(wrong(malformed.text, malformed.what)),
                Err(_) => return Ok(None),
            };
            let Some(value) = word.value else {
                return if is_call {
                    Err(wrong(word.text, "is no word that G65 can pass"))
                } else {
                    Ok(None)
                };
            };
            if word.letter == b'G' && value == 65.0 {
                is_call = true;
                continue;
            }
            if !is_call && word.letter != b'N' {
                return Ok(None);
            }
            match word.letter {
                b'N' => {}
                b'P' if value >= 0.0 && value.fract() == 0.0 => name = Some(format!("{value}")),
                b'L' if value == 1.0 => {}
                b'L' => return Err(wrong(word.text, "repeats a call that passes values, which is not read")),
                letter => {
                    let Some((_, number)) = ARGUMENTS.iter().find(|(known, _)| *known == letter) else {
                        return Err(wrong(word.text, "is no word that G65 can pass"));
                    };
                    if !word.text.contains(&b'.') && value != 0.0 && !WHOLE.contains(&letter) {
                        let what =
                            "passes a number without a decimal point, which controls take in their own unit";
                        return Err(wrong(word.text, what));
                    }
                    // Else I, J and K set further variables.
                    let later = arguments.range(number..).any(|(other, _)| (4..=6).contains(other));
                    if arguments.insert(*number, value).is_some() || ((4..=6).contains(number) && later) {
                        return Err(wrong(word.text, "stands twice, or I, J and K out of order"));
                    }
                }
            }
        }
        if !is_call {
            return Ok(None);
        }
        let Some(name) = name else {
            return Err(wrong(b"G65", "calls nothing: it needs P with a whole number"));
        };
        let locals = LocalVariables::of(arguments);
        self.call(at, name, 1, b"G65", Some(locals)).map(Some)
    }

    /// The values in brackets that a call of LinuxCNC passes.
    pub(super) fn passed(&self, rest: &[u8], word: &[u8]) -> Result<LocalVariables> {
        let clean = cleaned(rest);
        let mut reader = FormulaReader::new(&clean, &self.variables);
        let mut numbers: BTreeMap<u32, f64> = (1..=PASSED).map(|number| (number, 0.0)).collect();
        let mut count = 0;
        while !reader.rest().is_empty() {
            count += 1;
            let is_value = reader.rest().first() == Some(&b'[') && count <= PASSED;
            let value = if is_value {
                reader.signed()
            } else {
                Err("passes what is no value in brackets".to_owned())
            };
            let value = value.map_err(|what| self.reader.out.refused(word, &what, REMEDY))?;
            numbers.insert(count, value.unwrap_or(0.0));
        }
        Ok(LocalVariables::of(numbers))
    }

    /// Takes a call's variables away with it.
    pub(super) fn end_locals(&mut self, call: &Call) {
        if call.has_locals {
            self.variables.end();
        }
    }

    /// Carries out what an ordinary line asks for next.
    pub(super) fn go_on(&mut self, at: usize, after: After) -> Result<Option<usize>> {
        match after {
            After::Next => Ok(Some(at + 1)),
            After::End => Ok(None),
            After::Return => match self.calls.is_empty() {
                false => Ok(Some(self.end())),
                // A main program that begins anew for the next part.
                true => self.main_end(at).map(|()| None),
            },
            After::Call { number, repeats } => {
                let (name, times) = self.blocks.number(number);
                Ok(Some(self.call(at, name, repeats.unwrap_or(times), b"M98", None)?))
            }
            After::CallBlock { number, repeats } => {
                Ok(Some(self.call_block(at, number, repeats.unwrap_or(1))?))
            }
        }
    }
}

/// As much of a line as a message has room for.
fn shown(clean: &[u8]) -> &[u8] {
    &clean[..clean.len().min(60)]
}
