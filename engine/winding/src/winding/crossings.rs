//! Crossings with the lattice edges of a brick along one axis.

use crate::brick::POINTS;

/// One crossing of a lattice edge.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Hit {
    /// Linear index of the edge's lower sample.
    pub lower: u16,
    /// Distance from that sample in 1/65536 of the edge.
    pub offset: u16,
    /// The change of the winding number.
    pub jump: i32,
    /// The number of the facet.
    pub facet: u32,
}

/// The place of a crossing, as in [`Hit`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct CrossingPlace {
    pub lower: u16,
    pub offset: u16,
}

// A lower sample index fits 16 bits.
const _: () = assert!(POINTS <= u16::MAX as usize + 1);

/// Crossings facet by facet, in the order in which they were found.
#[derive(Default)]
pub(super) struct Crossings {
    places: Vec<CrossingPlace>,
    /// Per facet, how many there are up to its last one.
    ends: Vec<u32>,
}

impl Crossings {
    /// Forgets all.
    pub fn clear(&mut self) {
        self.places.clear();
        self.ends.clear();
    }

    /// Adds a crossing of the current facet with the edge that begins at sample `lower`.
    #[inline]
    pub fn add(&mut self, lower: usize, offset: u16) {
        self.places.push(CrossingPlace { lower: lower as u16, offset });
    }

    /// Goes on to the next facet.
    #[inline]
    pub fn end_facet(&mut self) {
        self.ends.push(self.places.len() as u32);
    }

    /// The numbers of the facets that have crossings, each with those.
    #[inline]
    pub fn by_facet(&self) -> impl Iterator<Item = (usize, &[CrossingPlace])> {
        let mut start = 0;
        let own = move |&end: &u32| &self.places[std::mem::replace(&mut start, end as usize)..end as usize];
        self.ends.iter().map(own).enumerate().filter(|(_, own)| !own.is_empty())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn facets_get_their_own_crossings() {
        let place = |lower, offset| CrossingPlace { lower, offset };
        let mut crossings = Crossings::default();
        for _ in 0..2 {
            crossings.clear();
            for facet in [&[place(5, 9), place(35_000, 1)][..], &[], &[place(5, 7)], &[]] {
                facet.iter().for_each(|own| crossings.add(own.lower.into(), own.offset));
                crossings.end_facet();
            }
            let found: Vec<_> = crossings.by_facet().collect();
            assert_eq!(found, [(0, &[place(5, 9), place(35_000, 1)][..]), (2, &[place(5, 7)])]);
        }
    }
}
