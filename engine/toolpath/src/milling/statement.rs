//! Lines of macros: what they ask for, and words whose numbers are computed.

use super::formula::FormulaReader;
use super::variables::{MacroVariables, VariableName};
use crate::toolpath::gcode::words::number;

/// What a line of a macro asks for.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Statement {
    /// A variable gets a value, or none.
    Set(VariableName, Option<f64>),
    /// The block with this number is the next one, or the line after this one.
    Jump(Option<u64>),
    /// A loop of this number goes on, or ends.
    Loop { number: u8, goes_on: bool },
    /// Its end, from where it begins anew.
    LoopEnd(u8),
    /// Words with numbers alone.
    Words(Vec<u8>),
}

/// A line in capital letters, without spaces, comments, its number and the mark of lines that may be skipped.
pub(super) fn cleaned(line: &[u8]) -> Vec<u8> {
    let line = line.strip_prefix(b"/").unwrap_or(line);
    let mut clean = Vec::with_capacity(line.len());
    let mut is_comment = false;
    for byte in line {
        match byte {
            b'(' => is_comment = true,
            b')' => is_comment = false,
            b';' if !is_comment => break,
            _ if is_comment || byte.is_ascii_whitespace() => {}
            _ => clean.push(byte.to_ascii_uppercase()),
        }
    }
    if clean.first() == Some(&b'N') {
        let digits = clean[1..].iter().take_while(|b| b.is_ascii_digit()).count();
        clean.drain(..if digits > 0 { digits + 1 } else { 0 });
    }
    clean
}

/// Whether a line may be one of macros: what most lines are not, by a look at them.
pub(super) fn may_be_macro(line: &[u8]) -> bool {
    let mut letters = line.iter().filter(|byte| byte.is_ascii_alphabetic()).map(u8::to_ascii_uppercase);
    let is_word = match letters.find(|letter| *letter != b'N') {
        Some(b'G' | b'D') => letters.next() == Some(b'O'),
        Some(b'E') => letters.next() == Some(b'N'),
        _ => false,
    };
    is_word || line.iter().any(|byte| matches!(byte, b'#' | b'['))
}

/// Whether a clean line is one of macros.
pub(super) fn is_macro(clean: &[u8]) -> bool {
    let begins = |word: &str| clean.starts_with(word.as_bytes());
    clean.iter().any(|byte| matches!(byte, b'#' | b'['))
        || begins("GOTO")
        || loop_mark(clean, b"DO").is_some()
        || loop_mark(clean, b"END").is_some()
}

/// The number of a loop behind its word, which is all that stands there.
pub(super) fn loop_mark(clean: &[u8], word: &[u8]) -> Option<u8> {
    match clean.strip_prefix(word)? {
        [digit @ b'1'..=b'9'] => Some(digit - b'0'),
        _ => None,
    }
}

/// The number of the loop that a clean line begins.
pub(super) fn loop_begin(clean: &[u8]) -> Option<u8> {
    if !clean.starts_with(b"WHILE") {
        return loop_mark(clean, b"DO");
    }
    let behind = clean.iter().rposition(|byte| *byte == b']')?;
    loop_mark(&clean[behind + 1..], b"DO")
}

/// What a clean line of a macro asks for.
///
/// # Errors
/// If it is not understood or cannot be computed, with the reason.
pub(super) fn statement(clean: &[u8], variables: &MacroVariables) -> Result<Statement, String> {
    let mut reader = FormulaReader::new(clean, variables);
    if let Some(number) = loop_mark(clean, b"END") {
        return Ok(Statement::LoopEnd(number));
    }
    if let Some(number) = loop_mark(clean, b"DO") {
        return Ok(Statement::Loop { number, goes_on: true });
    }
    if reader.take(b"WHILE") {
        let goes_on = reader.condition()?;
        return match loop_mark(reader.rest(), b"DO") {
            Some(number) => Ok(Statement::Loop { number, goes_on }),
            None => Err("is a loop without DO and its number".to_owned()),
        };
    }
    if reader.take(b"IF") {
        let is_met = reader.condition()?;
        return if reader.take(b"THEN") {
            // What does not count need not be computable.
            if is_met { assignment(reader) } else { Ok(Statement::Jump(None)) }
        } else if reader.rest().starts_with(b"GOTO") {
            if is_met { jump(reader) } else { Ok(Statement::Jump(None)) }
        } else {
            Err("is a condition without GOTO or THEN".to_owned())
        };
    }
    if reader.rest().starts_with(b"GOTO") {
        return jump(reader);
    }
    if reader.rest().starts_with(b"#") {
        return assignment(reader);
    }
    words(reader)
}

fn assignment(mut reader: FormulaReader<'_>) -> Result<Statement, String> {
    let name = reader.name()?;
    if !reader.take(b"=") {
        return Err("needs = behind the variable".to_owned());
    }
    let value = reader.expression()?;
    match reader.rest() {
        [] => Ok(Statement::Set(name, value)),
        _ => Err("has more behind its value than is understood: give each variable a line".to_owned()),
    }
}

fn jump(mut reader: FormulaReader<'_>) -> Result<Statement, String> {
    reader.take(b"GOTO");
    let value = match number(reader.rest()) {
        Some(found) => {
            reader.at += found.length;
            Some(found.value)
        }
        None => reader.signed()?,
    };
    match (value, reader.rest()) {
        (Some(value), []) if value.fract() == 0.0 && (1.0..1e9).contains(&value) => {
            Ok(Statement::Jump(Some(value as u64)))
        }
        _ => Err("needs the number of a block behind GOTO".to_owned()),
    }
}

/// Words with their numbers; those of empty variables are left out.
fn words(mut reader: FormulaReader<'_>) -> Result<Statement, String> {
    reader.in_word = true;
    let mut plain = Vec::with_capacity(reader.text.len());
    while let Some(letter @ b'A'..=b'Z') = reader.rest().first() {
        let behind = &reader.rest()[1..];
        if let Some(found) = number(behind) {
            plain.extend(&reader.rest()[..=found.length]);
            reader.at += 1 + found.length;
        } else if matches!(behind, [b'#' | b'[', ..] | [b'-' | b'+', b'#' | b'[', ..]) {
            reader.at += 1;
            if let Some(value) = reader.signed()? {
                let value = format!("{value}");
                let point = if value.contains('.') { "" } else { "." };
                plain.extend([&[*letter], value.as_bytes(), point.as_bytes(), b" "].concat());
            }
        } else {
            break;
        }
    }
    match reader.rest() {
        [] => Ok(Statement::Words(plain)),
        _ => Err("is not understood as words, each a letter with a number, a variable or an expression in brackets".to_owned()),
    }
}
