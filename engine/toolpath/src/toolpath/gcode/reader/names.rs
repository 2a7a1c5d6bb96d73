//! Words and lines with names: commands of several letters, values that the file assigns, expressions.

use super::deposition;
use super::machine::MachineState;
use super::neutral;
use super::parameters::SizeWords;
use super::words::{self, NAMED, Word, Words, token};
use crate::error::Result;

impl MachineState<'_, '_> {
    /// A line that begins with a name: a command of Klipper or of another machine, or a variable's.
    pub(super) fn extended(&mut self, start: &[u8]) -> Result<()> {
        let name = words::identifier(start);
        let behind = &start[name.len()..];
        if name.eq_ignore_ascii_case(b"WHEN") {
            // Siemens: an action in parallel to motion, as in `WHEN TRUE DO EXTR_END=2.0`.
            let action = start.rsplit(u8::is_ascii_whitespace).find_map(words::named);
            if action.is_some_and(|action| self.switch.named(action, None)) {
                return Ok(());
            }
        }
        let is_assigned = words::named(start).is_some();
        let argument = match is_assigned {
            true => self.value_behind(behind),
            false => deposition::argument(behind),
        };
        if self.switch.named(name, argument) {
            self.set_area(name, argument);
            // The line may go on with a move.
            let rest = behind_argument(behind, is_assigned);
            if rest.first().is_some_and(u8::is_ascii_alphabetic) {
                return self.command(rest, Words::new(rest));
            }
        } else if is_assigned {
            return self.assign(start);
        } else if name.eq_ignore_ascii_case(b"ACTIVATE_EXTRUDER") {
            return self.activate_extruder(behind);
        } else if !self.klipper(name, behind)? && !neutral::is_extended(token(start)) {
            self.beads.report.unknown(token(start), self.line);
        }
        Ok(())
    }

    /// The value of `= expression`, up to a space.
    fn value_behind(&self, behind: &[u8]) -> Option<f64> {
        let text = behind.trim_ascii_start().strip_prefix(b"=")?.trim_ascii_start();
        let end = text.iter().position(|b| matches!(b, b' ' | b'\t' | b';')).unwrap_or(text.len());
        self.variables.evaluate(&text[..end]).ok()
    }

    /// A bead's area, in the file's unit squared, gives its width.
    fn set_area(&mut self, name: &[u8], argument: Option<f64>) {
        if name.eq_ignore_ascii_case(b"BEAD_AREA") {
            let area = argument.map(|area| area * self.position.unit * self.position.unit);
            self.switch.area = area.filter(|area| *area > 0.0 && area.is_finite());
        }
    }

    /// A line that gives variables their values.
    pub(super) fn assign(&mut self, line: &[u8]) -> Result<()> {
        let Some(split) = line.iter().position(|b| *b == b'=') else {
            self.beads.report.unknown(token(line), self.line);
            return Ok(());
        };
        let name = line[..split].trim_ascii();
        if let [b'#', second, ..] = name
            && !(second.is_ascii_digit() || *second == b'<')
        {
            self.beads.report.unknown(token(line), self.line);
            return Ok(());
        }
        let value = &line[split + 1..];
        // A bracket may belong to the expression; a comment in parentheses follows a space.
        let comment = value.windows(2).position(|pair| pair == b" (");
        let end = value.iter().position(|b| *b == b';').or(comment).unwrap_or(value.len());
        let value = self.variables.evaluate(value[..end].trim_ascii()).ok();
        self.variables.set(name, value);
        Ok(())
    }

    /// The word with its expression's value, and with E as the letter of the extruder's axis.
    #[inline]
    pub(super) fn understood<'w>(&mut self, word: Word<'w>) -> Result<Word<'w>> {
        if word.expression.is_empty() && self.extruder_letter == b'E' {
            return Ok(word);
        }
        self.compute(word)
    }

    #[cold]
    fn compute<'w>(&mut self, mut word: Word<'w>) -> Result<Word<'w>> {
        if !word.expression.is_empty() {
            match self.variables.evaluate(word.expression) {
                Ok(value) => word.value = Some(value),
                // A variable may stay without a value as long as nothing hangs on it.
                Err(_) if word.letter == NAMED && !states_place(word.name) => {}
                Err(what) => return Err(self.fault(&what)),
            }
        }
        if self.extruder_letter != b'E' {
            if word.letter == self.extruder_letter {
                word.letter = b'E';
            } else if word.letter == b'E' {
                // Known by its sign that it moves nothing.
                word.letter = b'F';
                self.beads.report.note("E is left out: another axis feeds, by `extruder_axis`", self.line);
            }
        }
        Ok(word)
    }

    /// A word that has a name for a letter.
    pub(super) fn named_word(&mut self, word: &Word<'_>, sizes: &mut SizeWords) -> Result<()> {
        let name = word.name.to_ascii_uppercase();
        match &name[..] {
            b"A3" | b"B3" | b"C3" => self.vector[usize::from(name[0] - b'A')] = word.value,
            b"SUPA" => self.in_machine = true,
            // Siemens' radius of an arc.
            b"CR" => self.size(&Word { letter: b'R', ..*word }, sizes)?,
            _ if self.switch.named(&name, word.value) => self.set_area(&name, word.value),
            [b'R', digits @ ..] if digits.iter().all(u8::is_ascii_digit) => {
                self.variables.set(&name, word.value)
            }
            _ => self.beads.report.unknown(&name, self.line),
        }
        Ok(())
    }

    /// The tool's axis of the length 1, where the line states one; what it leaves out is 0.
    pub(super) fn unit_vector(&self, stated: [Option<f64>; 3]) -> Result<Option<[f64; 3]>> {
        if stated == [None; 3] {
            return Ok(None);
        }
        let vector = stated.map(Option::unwrap_or_default);
        let length = vector.iter().map(|x| x * x).sum::<f64>().sqrt();
        if !(1e-6..1e6).contains(&length) {
            return Err(self.fault("A3, B3 and C3 are no direction"));
        }
        Ok(Some(vector.map(|x| x / length)))
    }
}

/// Whether a name stands for a place or a direction.
fn states_place(name: &[u8]) -> bool {
    [&b"A3"[..], b"B3", b"C3", b"CR"].iter().any(|known| name.eq_ignore_ascii_case(known))
}

/// What follows the argument of a command, `(5)` or `= 5`.
fn behind_argument(behind: &[u8], is_assigned: bool) -> &[u8] {
    let text = behind.trim_ascii_start();
    let end = match text.first() {
        Some(b'(') => text.iter().position(|b| *b == b')').map_or(text.len(), |close| close + 1),
        _ if is_assigned => {
            let value = text.get(1..).unwrap_or_default();
            let spaces = value.len() - value.trim_ascii_start().len();
            let length = value.trim_ascii_start().iter().position(|b| matches!(b, b' ' | b'\t' | b';'));
            length.map_or(text.len(), |length| 1 + spaces + length)
        }
        _ => 0,
    };
    text[end..].trim_ascii_start()
}
