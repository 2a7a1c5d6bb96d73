//! Disjoint sets, for what hangs together (Tarjan & van Leeuwen 1984, paths halved).

/// Disjoint sets of numbers, each known by its least one.
#[derive(Clone, Debug, Default)]
pub struct DisjointSets(Vec<u32>);

impl DisjointSets {
    /// How many numbers there are.
    pub fn len(&self) -> usize {
        self.0.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// Adds the next numbers, each a set of its own.
    pub fn extend(&mut self, count: usize) {
        let first = self.0.len() as u32;
        self.0.extend(first..first + count as u32);
    }

    /// The least number of the set that a number is in.
    pub fn find(&mut self, mut number: u32) -> u32 {
        while self.0[number as usize] != number {
            let above = self.0[self.0[number as usize] as usize];
            self.0[number as usize] = above;
            number = above;
        }
        number
    }

    /// Makes one set of two. Gives the least numbers of both, that of the whole first, if they were two.
    pub fn unite(&mut self, a: u32, b: u32) -> Option<(u32, u32)> {
        let (a, b) = (self.find(a), self.find(b));
        let (first, second) = (a.min(b), a.max(b));
        self.0[second as usize] = first;
        (first != second).then_some((first, second))
    }
}
