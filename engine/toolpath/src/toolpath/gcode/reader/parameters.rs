//! The words of one command that carry a size.

use super::words::Word;

/// The words of one command that carry a size.
#[derive(Clone, Copy, Default)]
pub(super) struct SizeWords {
    values: [f64; 26],
    present: u32,
    /// Words whose value is a placeholder.
    open: u32,
}

impl SizeWords {
    pub(super) fn get(&self, letter: u8) -> Option<f64> {
        self.has(letter).then(|| self.values[usize::from(letter - b'A')])
    }

    fn has(&self, letter: u8) -> bool {
        self.present >> (letter - b'A') & 1 == 1
    }

    pub(super) fn is_open(&self, letter: u8) -> bool {
        self.open >> (letter - b'A') & 1 == 1
    }

    /// Whether a letter of the set is there, with a number or a placeholder.
    pub(super) fn any(&self, letters: u32) -> bool {
        (self.present | self.open) & letters != 0
    }

    /// Whether a letter of the set has a number.
    pub(super) fn states(&self, letters: u32) -> bool {
        self.present & letters != 0
    }

    /// Whether a letter of the set has a placeholder.
    pub(super) fn leaves_open(&self, letters: u32) -> bool {
        self.open & letters != 0
    }

    pub(super) fn put(&mut self, word: &Word<'_>) {
        let index = word.letter - b'A';
        match word.value {
            Some(value) => {
                self.values[usize::from(index)] = value;
                self.present |= 1 << index;
            }
            None => self.open |= 1 << index,
        }
    }
}

pub(super) const fn letters(letters: &[u8]) -> u32 {
    let mut set = 0;
    let mut i = 0;
    while i < letters.len() {
        set |= 1 << (letters[i] - b'A');
        i += 1;
    }
    set
}
