//! Crossings of the sign-changing edges of a brick along one axis.
//!
//! The edges are known before their crossings are found, so each has its place in the order in which Hermite edges are
//! kept. A crossing goes there without a branch: it is counted, and the first one in the direction in which the facets
//! are passed is kept.
//!
//! That one decides most edges, in most bricks all. For the others all crossings are listed, but only once a brick has
//! such edges: its neighbours are alike.

use crate::brick::{HermiteEdge, OctNormal, POINTS, Samples};

/// What crossings of one facet share: the normal in the low 32 bits, above it 17 ones if the winding number falls.
#[derive(Clone, Copy, Debug)]
pub(super) struct CrossingSide(u64);

impl CrossingSide {
    /// Of a facet with this normal where the winding number changes by `jump`.
    pub fn new(jump: i32, normal: OctNormal) -> CrossingSide {
        CrossingSide(if jump < 0 { FALLS } else { 0 } | u64::from(normal.0))
    }

    fn normal(self) -> OctNormal {
        OctNormal(self.0 as u32)
    }

    fn jump(self) -> i32 {
        if self.0 >> 32 == 0 { 1 } else { -1 }
    }

    /// Puts crossings that go one way in order of their offset, or of falling offset where the winding number falls, then
    /// of their normal.
    #[inline]
    fn rank(self, offset: u16) -> u64 {
        self.0 ^ u64::from(offset) << 32
    }
}

/// What [`CrossingSide`] has above the normal if the winding number falls: what turns the order of offsets round, and a bit
/// that says so.
const FALLS: u64 = 0x1_ffff << 32;

/// The crossing with this [`CrossingSide::rank`].
#[inline]
fn edge_at(rank: u64) -> HermiteEdge {
    let turn = 0u16.wrapping_sub((rank >> 48) as u16);
    HermiteEdge { offset: (rank >> 32) as u16 ^ turn, normal: OctNormal(rank as u32) }
}

/// What is known of an edge's crossings.
#[derive(Clone, Copy, Debug)]
struct Slot {
    /// The smallest [`CrossingSide::rank`].
    first: u64,
    /// How many there are.
    count: u32,
}

/// One crossing of an edge.
#[derive(Clone, Copy, Debug)]
pub(super) struct EdgeHit {
    /// The edge's place.
    pub place: u16,
    /// Distance from the edge's lower sample in 1/65536 of the edge.
    pub offset: u16,
    pub passing: CrossingSide,
}

/// The edges with their crossings.
pub(super) struct EdgeHits {
    /// By the linear index of an edge's lower sample: its place among the edges asked for, from 1; 0 for others.
    places: Box<[u16; POINTS]>,
    /// The lower samples of the edges, in order.
    lowers: Vec<u16>,
    /// By place; the first one takes what nobody has asked for.
    slots: Vec<Slot>,
    /// All crossings, if they are listed.
    list: Vec<EdgeHit>,
    listing: bool,
}

// A place fits 16 bits.
const _: () = assert!(POINTS <= u16::MAX as usize);

impl Default for EdgeHits {
    fn default() -> EdgeHits {
        let places = vec![0; POINTS].into_boxed_slice().try_into().expect("the length is POINTS");
        EdgeHits { places, lowers: Vec::new(), slots: Vec::new(), list: Vec::new(), listing: false }
    }
}

/// What [`EdgeHits::hermite`] can do.
#[derive(Debug, PartialEq)]
pub(super) enum HermiteOutcome {
    /// The Hermite edges in the order in which they were asked for.
    All(Vec<HermiteEdge>),
    /// Begin once more, listing.
    ListNeeded,
    /// An edge has no crossings that take it from one end's winding number to the other's.
    Torn,
}

impl EdgeHits {
    /// Forgets all edges.
    pub fn clear(&mut self) {
        self.lowers.iter().for_each(|&lower| self.places[usize::from(lower)] = 0);
        self.lowers.clear();
    }

    /// Asks for the crossings of the edge that begins at sample `lower`, once.
    #[inline]
    pub fn ask(&mut self, lower: usize) {
        self.lowers.push(lower as u16);
        self.places[lower] = self.lowers.len() as u16;
    }

    /// Ends the asking: crossings may follow, all of them, and are listed or not.
    pub fn begin(&mut self, listing: bool) {
        self.slots.clear();
        self.slots.resize(self.lowers.len() + 1, Slot { first: u64::MAX, count: 0 });
        self.list.clear();
        self.listing = listing;
    }

    /// Whether the edge that begins at sample `lower` is asked for.
    #[inline]
    pub fn asks(&self, lower: usize) -> bool {
        self.places[lower] != 0
    }

    /// Adds a crossing, if it is one of an edge asked for.
    #[inline]
    pub fn add(&mut self, lower: usize, offset: u16, passing: CrossingSide) {
        let place = self.places[lower];
        let slot = &mut self.slots[usize::from(place)];
        slot.first = slot.first.min(passing.rank(offset));
        slot.count += 1;
        if self.listing {
            self.list.push(EdgeHit { place, offset, passing });
        }
    }

    /// The Hermite edges, given the samples and how far apart the ends of an edge are; and whether a list is needed
    /// for them.
    pub fn hermite(&mut self, samples: &Samples, step: usize) -> (HermiteOutcome, bool) {
        // One crossing goes from outside to the first shell, or back: nearly all edges are such.
        let mut several = 0;
        let first_of = |slot: &Slot| {
            several |= slot.count ^ 1;
            edge_at(slot.first)
        };
        let mut edges: Vec<HermiteEdge> = self.slots[1..].iter().map(first_of).collect();
        let mixed = if several == 0 { 0 } else { self.count_mixed(samples, step) };
        let decided = match mixed {
            0 => HermiteOutcome::All(edges),
            _ if !self.listing => HermiteOutcome::ListNeeded,
            _ => self
                .decide_mixed(samples, &mut edges)
                .map_or(HermiteOutcome::Torn, |()| HermiteOutcome::All(edges)),
        };
        (decided, mixed > 0)
    }

    /// How many edges are not decided by their first crossing; the slots of all others get a count of one.
    fn count_mixed(&mut self, samples: &Samples, step: usize) -> usize {
        let mut mixed = 0;
        for (&lower, slot) in self.lowers.iter().zip(&mut self.slots[1..]) {
            if slot.count == 1 {
                continue;
            }
            let [start, end] = [0, step].map(|step| i32::from(samples.0[usize::from(lower) + step]));
            // As many crossings as the winding number changes by all go one way. If the count begins at 0, it passes
            // 0.5 at the nearest of them, if it ends at 0, at the farthest; several there are one step.
            let one_way = slot.count == start.abs_diff(end);
            if one_way && (start == 0 || end == 0) {
                slot.count = 1;
            } else {
                mixed += 1;
            }
        }
        mixed
    }

    /// Decides the edges whose slots have another count than one.
    fn decide_mixed(&mut self, samples: &Samples, edges: &mut [HermiteEdge]) -> Option<()> {
        let EdgeHits { lowers, slots, list, .. } = self;
        slots[0].count = 1;
        list.retain(|passage| slots[usize::from(passage.place)].count != 1);
        list.sort_unstable_by_key(|passage| (passage.place, passage.offset));
        let mut listed = list.chunk_by(|a, b| a.place == b.place);
        let edges = edges.iter_mut().zip(lowers).zip(&slots[1..]).zip(1u16..);
        for (((edge, lower), _), place) in edges.filter(|((_, slot), _)| slot.count != 1) {
            let own = listed.next().filter(|own| own[0].place == place)?;
            *edge = first_passage(samples.0[usize::from(*lower)], own)?;
        }
        Some(())
    }
}

/// The first step at which the running count along an edge passes 0.5, from the winding number at its lower sample
/// and its crossings in the order of their offsets; `None` if it never does.
pub(super) fn first_passage(start: i16, passages: &[EdgeHit]) -> Option<HermiteEdge> {
    let mut w = i32::from(start);
    // Crossings with the same offset count as one step.
    passages.chunk_by(|a, b| a.offset == b.offset).find_map(|step| {
        let before = w;
        w += step.iter().map(|p| p.passing.jump()).sum::<i32>();
        let direction = if w > before { 1 } else { -1 };
        // Of facets that coincide here, the one with the smallest normal, whatever their order.
        let these = step.iter().map(|p| p.passing).filter(|passing| passing.jump() == direction);
        let normal = these.map(CrossingSide::normal).min();
        let passes = (before >= 1) != (w >= 1);
        passes.then_some(HermiteEdge { offset: step[0].offset, normal: normal? })
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::brick::point_index;
    use proptest::prelude::*;

    fn passage((offset, normal, up): (u16, u32, bool)) -> EdgeHit {
        EdgeHit { place: 0, offset, passing: CrossingSide::new(if up { 1 } else { -1 }, OctNormal(normal)) }
    }

    proptest! {
        /// Edges along y, each with crossings in any order and number, against the steps of each edge.
        #[test]
        fn every_edge_gets_its_first_passage(
            edges in prop::collection::vec(
                (-2i16..4, prop::collection::vec((0u16..6, 0u32..3, any::<bool>()), 1..7)), 1..40),
            others in prop::collection::vec((0u16..6, 0u32..3, any::<bool>()), 0..9),
            turn in any::<usize>(),
        ) {
            let lower = |number: usize| point_index([number % 8 + 1, 2 * (number / 8), 3]);
            let step = point_index([0, 1, 0]);
            let mut samples = Samples::filled(0);
            let (mut asked, mut expected, mut added) = (Vec::new(), Vec::new(), Vec::new());
            let mut all_simple = true;
            for (number, (start, crossings)) in edges.iter().enumerate() {
                let mut own: Vec<EdgeHit> = crossings.iter().copied().map(passage).collect();
                let end = i32::from(*start) + own.iter().map(|p| p.passing.jump()).sum::<i32>();
                samples.0[lower(number)] = *start;
                samples.0[lower(number) + step] = end as i16;
                added.extend(own.iter().map(|&p| (lower(number), p)));
                if (*start >= 1) != (end >= 1) {
                    own.sort_by_key(|p| p.offset);
                    asked.push(lower(number));
                    expected.push(first_passage(*start, &own).expect("it changes sign"));
                    all_simple &= own.iter().all(|p| p.passing.jump() == own[0].passing.jump())
                        && (*start == 0 || end == 0);
                }
            }
            added.extend(others.into_iter().map(|other| (point_index([0, 0, 3]), passage(other))));
            let turn = turn % added.len();
            added.rotate_left(turn);
            let mut passages = EdgeHits::default();
            for listing in [false, true, false] {
                passages.clear();
                asked.iter().for_each(|&lower| passages.ask(lower));
                passages.begin(listing);
                added.iter().for_each(|(lower, p)| passages.add(*lower, p.offset, p.passing));
                let all = HermiteOutcome::All(expected.clone());
                let decided = if all_simple || listing { all } else { HermiteOutcome::ListNeeded };
                prop_assert_eq!(passages.hermite(&samples, step), (decided, !all_simple));
            }
        }
    }

    #[test]
    fn an_edge_without_its_crossings_is_noticed() {
        let mut samples = Samples::filled(0);
        samples.0[1..].fill(1);
        let mut passages = EdgeHits::default();
        passages.ask(0);
        for (listing, decided) in [(false, HermiteOutcome::ListNeeded), (true, HermiteOutcome::Torn)] {
            passages.begin(listing);
            assert_eq!(passages.hermite(&samples, 1), (decided, true));
        }
        passages.begin(true);
        (0..3).for_each(|offset| passages.add(0, offset, CrossingSide::new(-1, OctNormal(0))));
        assert_eq!(passages.hermite(&samples, 1).0, HermiteOutcome::Torn);
    }
}
