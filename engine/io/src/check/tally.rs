//! Counting what is wrong, and remembering where it was first seen.

use super::report::Defect;

/// How many, and the lowest number of a face or vertex among them. Merging is commutative, so that the order in which
/// threads come changes nothing.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Tally {
    pub(super) count: u64,
    first: u32,
}

impl Tally {
    pub(super) const NONE: Tally = Tally { count: 0, first: u32::MAX };

    /// All of these faces or vertices, in ascending order.
    pub(super) fn of(numbers: &[u32]) -> Tally {
        Tally { count: numbers.len() as u64, first: numbers.first().copied().unwrap_or(Tally::NONE.first) }
    }

    /// One more, at the face or vertex `number`.
    pub(super) fn add(&mut self, number: u32) {
        self.count += 1;
        self.first = self.first.min(number);
    }

    /// One more if `wrong`.
    pub(super) fn add_if(&mut self, wrong: bool, number: u32) {
        if wrong {
            self.add(number);
        }
    }

    /// Those of both.
    pub(super) fn merged(self, other: Tally) -> Tally {
        Tally { count: self.count + other.count, first: self.first.min(other.first) }
    }

    /// With the position of the first.
    pub(super) fn defect(self, position: impl Fn(usize) -> [f64; 3]) -> Defect {
        let at = (self.count > 0).then(|| position(self.first as usize)).filter(|p| p[0].is_finite());
        Defect { count: self.count, at }
    }
}
