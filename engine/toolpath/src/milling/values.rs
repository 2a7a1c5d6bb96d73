//! The words of a line that are not codes.

use std::collections::BTreeMap;

/// The words of a line that are not codes.
#[derive(Default)]
pub(super) struct Values(pub BTreeMap<u8, f64>);

impl Values {
    pub fn get(&self, letter: u8) -> Option<f64> {
        self.0.get(&letter).copied()
    }

    pub fn any(&self, letters: &[u8]) -> bool {
        letters.iter().any(|letter| self.0.contains_key(letter))
    }

    /// The axes that are named, with their values.
    pub fn axes(&self) -> impl Iterator<Item = (usize, f64)> {
        b"XYZ".iter().enumerate().filter_map(|(a, letter)| Some((a, self.get(*letter)?)))
    }
}
