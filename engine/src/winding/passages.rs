//! Crossings of the sign-changing edges of a brick along one axis.
//!
//! The edges are known before their crossings are found, so each has its place in the order in which Hermite edges are
//! kept: a crossing goes where it is needed, into an array that stays in the first cache, and no list of all crossings
//! is made.

use super::crossings::{Cause, NONE};
use crate::brick::POINTS;

/// One crossing of a sign-changing edge.
#[derive(Clone, Copy, Debug)]
pub(super) struct Passage {
    /// Number of another crossing of the same edge, or [`NONE`].
    next: u32,
    /// The triangle and the jump.
    pub cause: Cause,
    /// Distance from the edge's lower sample in 1/65536 of the edge.
    pub offset: u16,
}

impl Passage {
    /// What stands for an edge before its first crossing: no list has room for this number.
    const MISSING: Passage = Passage { next: NONE - 1, cause: Cause(0), offset: 0 };

    /// Whether the edge has no other crossing.
    pub fn is_only(self) -> bool {
        self.next == NONE
    }
}

/// The edges with their crossings.
pub(super) struct Passages {
    /// By the linear index of an edge's lower sample: its place among the edges asked for. Of no meaning for others.
    places: Box<[u16; POINTS]>,
    /// The lower samples of the edges, in order.
    lowers: Vec<u16>,
    /// A crossing of each edge.
    firsts: Vec<Passage>,
    /// The others.
    others: Vec<Passage>,
}

impl Default for Passages {
    fn default() -> Passages {
        let places = vec![0; POINTS].into_boxed_slice().try_into().expect("the length is POINTS");
        Passages { places, lowers: Vec::new(), firsts: Vec::new(), others: Vec::new() }
    }
}

impl Passages {
    /// Forgets all edges.
    pub fn clear(&mut self) {
        self.lowers.clear();
        self.firsts.clear();
        self.others.clear();
    }

    /// Asks for the crossings of the edge that begins at sample `lower`.
    #[inline]
    pub fn ask(&mut self, lower: usize) {
        self.places[lower] = self.lowers.len() as u16;
        self.lowers.push(lower as u16);
    }

    /// Ends the asking: crossings may follow.
    pub fn begin(&mut self) {
        self.firsts.resize(self.lowers.len(), Passage::MISSING);
    }

    /// Adds a crossing of an edge asked for.
    #[inline]
    pub fn add(&mut self, lower: usize, offset: u16, cause: Cause) {
        let first = &mut self.firsts[usize::from(self.places[lower])];
        let mut next = NONE;
        if first.next != Passage::MISSING.next {
            next = self.others.len() as u32;
            self.others.push(*first);
        }
        *first = Passage { next, cause, offset };
    }

    /// The edges in the order in which they were asked for, as their lower samples and a crossing each; `None` in
    /// place of that where an edge has none.
    #[inline]
    pub fn edges(&self) -> impl ExactSizeIterator<Item = (usize, Option<Passage>)> {
        let found = |first: &Passage| (first.next != Passage::MISSING.next).then_some(*first);
        self.lowers.iter().zip(&self.firsts).map(move |(&lower, first)| (usize::from(lower), found(first)))
    }

    /// The other crossing of an edge that has two, given the one that [`Passages::edges`] gives.
    #[inline]
    pub fn second_of_two(&self, first: Passage) -> Option<Passage> {
        self.others.get(first.next as usize).copied().filter(|second| second.is_only())
    }

    /// All crossings of an edge from the one that [`Passages::edges`] gives.
    pub fn chain(&self, first: Passage) -> impl Iterator<Item = Passage> {
        std::iter::successors(Some(first), |passage| self.others.get(passage.next as usize).copied())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn crossings_are_found_at_their_edges() {
        let mut passages = Passages::default();
        for round in 0..2 {
            passages.clear();
            [7, POINTS - 1, 3].into_iter().for_each(|lower| passages.ask(lower));
            passages.begin();
            let cause = Cause::new(round, 1);
            let found = [(3, 10), (7, 20), (3, 5), (3, 5)];
            found.into_iter().for_each(|(lower, offset)| passages.add(lower, offset, cause));
            let edges: Vec<_> = passages.edges().collect();
            assert_eq!(edges.iter().map(|edge| edge.0).collect::<Vec<_>>(), [7, POINTS - 1, 3]);
            let offsets = |edge: usize| -> Vec<u16> {
                edges[edge].1.map_or(Vec::new(), |first| passages.chain(first).map(|p| p.offset).collect())
            };
            assert_eq!([offsets(0), offsets(1), offsets(2)], [vec![20], vec![], vec![5, 5, 10]]);
            assert!(edges[0].1.is_some_and(Passage::is_only));
            assert!(!edges[2].1.is_some_and(Passage::is_only));
            assert!(edges[2].1.is_some_and(|first| passages.second_of_two(first).is_none()));
            passages.add(7, 30, cause);
            let first = passages.edges().next().and_then(|edge| edge.1).expect("two were added");
            let second = passages.second_of_two(first).expect("one was added before");
            assert_eq!((first.offset, second.offset), (30, 20));
        }
    }
}
