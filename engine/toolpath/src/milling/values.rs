//! The words of a line that are not codes.

use std::collections::BTreeMap;

/// Numbers by their letters.
#[derive(Default)]
pub(super) struct Values {
    words: BTreeMap<u8, f64>,
    /// Letters whose numbers have no decimal point, a bit each.
    whole: u32,
}

impl Values {
    /// Adds a word; false if the line has one of this letter already.
    pub fn add(&mut self, letter: u8, value: f64, text: &[u8]) -> bool {
        if !text.contains(&b'.') {
            self.whole |= 1 << (letter & 31);
        }
        self.words.insert(letter, value).is_none()
    }

    pub fn get(&self, letter: u8) -> Option<f64> {
        self.words.get(&letter).copied()
    }

    /// Whether the number of a letter has no decimal point.
    pub fn is_whole(&self, letter: u8) -> bool {
        self.whole & (1 << (letter & 31)) != 0
    }

    pub fn any(&self, letters: &[u8]) -> bool {
        letters.iter().any(|letter| self.words.contains_key(letter))
    }

    /// A letter that is none of these.
    pub fn other_than(&self, letters: &[u8]) -> Option<u8> {
        self.words.keys().copied().find(|letter| !letters.contains(letter))
    }

    /// The axes that are named, with their values.
    pub fn axes(&self) -> impl Iterator<Item = (usize, f64)> {
        b"XYZ".iter().enumerate().filter_map(|(a, letter)| Some((a, self.get(*letter)?)))
    }

    /// These words alone.
    pub fn only(&self, letters: &[u8]) -> Values {
        let words = self.words.iter().filter(|(letter, _)| letters.contains(letter));
        Values { words: words.map(|(letter, value)| (*letter, *value)).collect(), whole: self.whole }
    }
}
