//! What a block does: the words of one line, carried out together.

use super::commands::{CodeEffect, code};
use super::machine::MachineState;
use super::parameters::{SizeWords, letters};
use super::words::{Exponent, MalformedWord, NAMED, Word, Words};
use crate::error::Result;

/// Words that a command may carry, beside those of the axes.
const CARRIED: u32 = letters(b"EIJKRP");

impl MachineState<'_, '_> {
    pub(super) fn command(&mut self, line: &[u8], mut words: Words<'_>) -> Result<()> {
        let mut sizes = SizeWords::default();
        let mut moves = false;
        let mut first = true;
        let carried = CARRIED | self.position.letters();
        let mut takes_tool = false;
        while let Some(word) = words.next() {
            let word = word.map_err(|malformed| self.malformed(&malformed))?;
            if word.exponent != Exponent::None {
                self.note_exponent(&word);
            }
            let word = self.understood(word)?;
            match word.letter {
                b'N' if first => continue,
                b'G' | b'M' | b'T' => match self.code(&word, first, &mut words)? {
                    CodeEffect::Modal => {}
                    CodeEffect::Motion => moves = true,
                    CodeEffect::LineDone => return Ok(()),
                    CodeEffect::SetPosition => return self.set_position(words),
                    CodeEffect::SetOffsets(code) => return self.set_offsets(code, words),
                },
                b'F' => {}
                b'S' => self.switch.set_speed(word.value),
                // Prusa's XL parks a tool by "P0 S1 L2 D0", and says how to take one by "T0 S1 L0 D0".
                b'P' if first => return Ok(()),
                b'L' if takes_tool => {}
                NAMED => self.named_word(&word, &mut sizes)?,
                letter if carried >> (letter - b'A') & 1 == 1 => {
                    self.size(&word, &mut sizes)?;
                }
                letter => self.other_letter(letter),
            }
            takes_tool |= first && word.letter == b'T';
            first = false;
        }
        self.check_sum(line, words.rest());
        let states_vector = std::mem::take(&mut self.vector);
        if let Some(vector) = self.unit_vector(states_vector)? {
            self.position.set_vector(vector);
            moves = true;
        }
        let in_machine = std::mem::take(&mut self.in_machine);
        let moving = self.position.letters() | letters(b"E");
        if sizes.any(moving) || (moves && sizes.states(u32::MAX)) || states_vector != [None; 3] {
            if in_machine {
                return self.go_in_machine(&sizes);
            }
            let Some(motion) = self.motion else {
                return Err(self.fault("coordinates stand before the first G0, G1, G2 or G3"));
            };
            return self.go(motion, &sizes);
        }
        Ok(())
    }

    /// A letter that moves nothing that is known.
    fn other_letter(&mut self, letter: u8) {
        match letter {
            // Offsets of tools, and a program's number.
            b'D' | b'H' | b'O' => {}
            b'U' | b'V' | b'W' if self.tells_axes => {
                let axis = char::from(letter);
                let what = format!(
                    "{axis} moves and is left out: if it carries layers, say `layer_axis` {axis} (its position is \
                     added to Z) or -{axis} (a table that goes down); if it feeds, `extruder_axis` {axis}; if \
                     neither, `layer_axis` none"
                );
                self.beads.report.note(&what, self.line);
            }
            b'U' | b'V' | b'W' => {}
            letter => self.beads.report.unknown(&[letter], self.line),
        }
    }

    fn code(&mut self, word: &Word<'_>, first: bool, words: &mut Words<'_>) -> Result<CodeEffect> {
        let Some(value) = word.value else {
            return Err(self.malformed(&MalformedWord { text: word.text, what: "has no number" }));
        };
        code(self, word, value, first, words)
    }
}
