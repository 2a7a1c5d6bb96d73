//! Crossings with the lattice edges of a brick, chained edge by edge.

use crate::brick::POINTS;

/// One crossing of a lattice edge.
#[derive(Clone, Copy, Debug)]
pub(super) struct Hit {
    /// Number of the crossing before this one in the edge's chain, or [`NONE`].
    before: u32,
    /// The triangle and the jump.
    pub cause: Cause,
    /// Linear index of the edge's lower sample.
    pub lower: u16,
    /// Distance from that sample in 1/65536 of the edge.
    pub offset: u16,
}

/// No crossing.
const NONE: u32 = u32::MAX;

// A lower sample index fits 16 bits.
const _: () = assert!(POINTS <= u16::MAX as usize + 1);

/// What crossings of one triangle along one axis share: the triangle's position in the brick's list, times two,
/// plus one where the winding number falls.
#[derive(Clone, Copy, Debug)]
pub(super) struct Cause(pub u32);

impl Cause {
    pub fn new(position: usize, jump: i32) -> Cause {
        Cause((position as u32) << 1 | u32::from(jump < 0))
    }

    /// The triangle's position in the brick's list.
    pub fn position(self) -> usize {
        (self.0 >> 1) as usize
    }

    /// The change of the winding number.
    pub fn jump(self) -> i32 {
        1 - 2 * (self.0 & 1) as i32
    }
}

impl Hit {
    /// Whether it is the first of its edge's chain.
    pub fn is_first(self) -> bool {
        self.before == NONE
    }
}

/// Crossings in the order in which they were found. Those of an edge form a chain from the last to the first,
/// until it is taken: most edges have one crossing, so this is cheaper than sorting.
pub(super) struct Crossings {
    hits: Vec<Hit>,
    /// Per lower sample of an edge: the number of its last crossing. [`NONE`] everywhere between axes.
    last: Box<[u32; POINTS]>,
}

impl Default for Crossings {
    fn default() -> Crossings {
        let last = vec![NONE; POINTS].into_boxed_slice().try_into().expect("the length is POINTS");
        Crossings { hits: Vec::new(), last }
    }
}

impl Crossings {
    /// How many there are.
    pub fn len(&self) -> usize {
        self.hits.len()
    }

    /// Forgets all but the first `len`; the chains of the others must have been taken.
    pub fn truncate(&mut self, len: usize) {
        self.hits.truncate(len);
    }

    /// Adds a crossing to the chain of the edge that begins at sample `lower`.
    #[inline]
    pub fn add(&mut self, lower: usize, offset: u16, cause: Cause) {
        let before = std::mem::replace(&mut self.last[lower], self.hits.len() as u32);
        self.hits.push(Hit { before, cause, lower: lower as u16, offset });
    }

    /// The number of the last crossing of the edge that begins at sample `lower`, or [`NONE`]. Its chain ends.
    #[inline]
    pub fn take(&mut self, lower: usize) -> u32 {
        std::mem::replace(&mut self.last[lower], NONE)
    }

    /// A crossing by its number.
    #[inline]
    pub fn get(&self, number: u32) -> Hit {
        self.hits[number as usize]
    }

    /// The sum of the jumps on an edge, given the number of its last crossing.
    #[inline]
    pub fn jump(&self, last: u32) -> i32 {
        let hit = self.get(last);
        let mut jump = hit.cause.jump();
        if !hit.is_first() {
            jump += self.chain(hit.before).map(|hit| hit.cause.jump()).sum::<i32>();
        }
        jump
    }

    /// The crossings of an edge from the last one, whose number is given, to the first.
    #[inline]
    pub fn chain(&self, last: u32) -> impl Iterator<Item = Hit> {
        let mut number = last;
        std::iter::from_fn(move || {
            let hit = *self.hits.get(number as usize)?;
            number = hit.before;
            Some(hit)
        })
    }

    /// The crossings from the `from`-th one on by edge, those of an edge by offset. Their chains end.
    pub fn sorted(&mut self, from: usize) -> Vec<Hit> {
        let mut sorted = self.hits[from..].to_vec();
        sorted.iter().for_each(|hit| self.last[usize::from(hit.lower)] = NONE);
        sorted.sort_unstable_by_key(|hit| (hit.lower, hit.offset));
        sorted
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn chains_hold_what_was_added_to_their_edge() {
        let mut crossings = Crossings::default();
        let up = Cause::new(3, 1);
        let down = Cause::new(70_000, -1);
        assert_eq!((up.position(), up.jump(), down.position(), down.jump()), (3, 1, 70_000, -1));
        for (lower, offset, cause) in [(5, 9, up), (POINTS - 1, 1, down), (5, 7, down), (5, 8, down)] {
            crossings.add(lower, offset, cause);
        }
        let last = crossings.take(5);
        assert_eq!(crossings.chain(last).map(|hit| hit.offset).collect::<Vec<_>>(), [8, 7, 9]);
        assert_eq!(crossings.jump(last), -1);
        assert_eq!(crossings.take(5), NONE);
        assert_eq!(crossings.take(6), NONE);
        // What is left in chains ends when it is sorted.
        let sorted = crossings.sorted(0);
        let order: Vec<_> = sorted.iter().map(|hit| (usize::from(hit.lower), hit.offset)).collect();
        assert_eq!(order, [(5, 7), (5, 8), (5, 9), (POINTS - 1, 1)]);
        assert_eq!(crossings.take(POINTS - 1), NONE);
        crossings.truncate(1);
        assert_eq!(crossings.len(), 1);
    }
}
