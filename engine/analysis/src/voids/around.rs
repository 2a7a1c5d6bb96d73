//! The beads around a void: every crossing of its boundary is where a lattice line enters or leaves a segment.
//!
//! The store's record of beads lists the segments that touch each leaf, and a segment's solid tells where a line meets it, by
//! the rule that the crossing was made by. So the segment whose interval ends at the crossing is the one, and nothing needs
//! to be kept of it beside the crossing itself.

use super::crossing::VoidCrossing;
use crate::analysis::{leaf_at, solids_of};
use crate::error::Result;
use crate::lattice::{NodeKey, Units};
use crate::solid::{Body, Segment, Solids};
use crate::store::{BeadSegment, BeadTables, Store};
use std::collections::BTreeMap;

/// Steps of a square unit in which shares of surfaces are added up.
const SHARE_STEPS: f64 = 256.0;

/// Reads the segments of leaves.
pub struct Tracer<'a> {
    pub(super) store: &'a Store,
    tables: BeadTables,
    solids: Solids,
}

impl<'a> Tracer<'a> {
    /// Of a store; `None` if it does not tell beads apart.
    ///
    /// # Errors
    /// [`Error::Store`] if its tables are damaged.
    pub fn new(store: &'a Store) -> Result<Option<Tracer<'a>>> {
        let Some(tables) = store.bead_tables()? else { return Ok(None) };
        let solids = solids_of(store, &tables)?;
        Ok(Some(Tracer { store, tables, solids }))
    }

    /// The leaf at a place, in lattice units; `None` outside of the root.
    pub(super) fn leaf_at(&self, at: [f64; 3]) -> Option<NodeKey> {
        leaf_at(self.store, at.map(|c| c - 1.0))
    }

    /// The tables of beads.
    pub fn tables(&self) -> &BeadTables {
        &self.tables
    }

    /// The segments that touch a leaf.
    pub(super) fn segments(&self, key: NodeKey) -> Result<Segments> {
        let stored = self.store.segments(key, &self.tables)?;
        let of = |s: &BeadSegment| {
            let segment = Segment { a: s.a, b: s.b, profile: s.section, pass: s.pass };
            Listed { segment: *s, body: self.solids.body(&segment), bounds: self.solids.bounds(&segment) }
        };
        Ok(Segments(stored.iter().map(of).collect()))
    }

    /// The solids of all segments.
    pub(super) fn solids(&self) -> &Solids {
        &self.solids
    }

    /// The segments that touch a leaf, to be asked through [`Tracer::solids`].
    pub(super) fn listed(&self, key: NodeKey) -> Result<Vec<Segment>> {
        let of = |s: &BeadSegment| Segment { a: s.a, b: s.b, profile: s.section, pass: s.pass };
        Ok(self.store.segments(key, &self.tables)?.iter().map(of).collect())
    }

    /// Width of a segment's section, in lattice units.
    pub(super) fn width(&self, segment: &BeadSegment) -> f64 {
        2.0 * self.tables.sections[segment.section as usize].half_width
    }
}

struct Listed {
    segment: BeadSegment,
    body: Body,
    bounds: (Units, Units),
}

/// The segments that touch a leaf, with their solids.
pub(super) struct Segments(Vec<Listed>);

impl Segments {
    /// The segment whose solid a line enters or leaves at a crossing, nearest to it within what its place is rounded to.
    fn at(&self, key: NodeKey, crossing: &VoidCrossing) -> Option<&BeadSegment> {
        let axis = crossing.axis.index();
        let slack = 2.0 + f64::from(1u32 << key.spacing_bits()) / 32768.0;
        let mut best: Option<(f64, &BeadSegment)> = None;
        for Listed { segment, body, bounds } in &self.0 {
            let outside = |a: usize| {
                crossing.at[a] < f64::from(bounds.0[a]) - slack
                    || crossing.at[a] > f64::from(bounds.1[a]) + slack
            };
            if outside(0) || outside(1) || outside(2) {
                continue;
            }
            let at = [0, 1, 2].map(|a| crossing.at[a] - f64::from(segment.a[a]));
            let Some((from, to)) = body.line(axis, at) else { continue };
            let end = if crossing.low_is_inside { to } else { from };
            let away = (end - at[axis]).abs();
            if away <= slack && best.is_none_or(|(least, _)| away < least) {
                best = Some((away, segment));
            }
        }
        best.map(|(_, segment)| segment)
    }

    /// Whether a place, in lattice units, lies within one of the solids.
    pub fn cover(&self, at: [f64; 3]) -> bool {
        self.0.iter().any(|Listed { segment, body, bounds }| {
            let is_near = (0..3).all(|a| (f64::from(bounds.0[a])..=f64::from(bounds.1[a])).contains(&at[a]));
            let from_begin = [0, 1, 2].map(|a| at[a] - f64::from(segment.a[a]));
            let holds = |(low, high): (f64, f64)| (low..=high).contains(&from_begin[0]);
            is_near && body.line(0, from_begin).is_some_and(holds)
        })
    }
}

/// The segments around a void, with what of its surface is theirs.
#[derive(Clone, Debug, Default)]
pub(super) struct SurroundingSegments {
    /// By pass and line: shares in [`SHARE_STEPS`], and the first of the segments.
    pub segments: BTreeMap<(u32, u64), (u128, BeadSegment)>,
    /// What belongs to no segment.
    pub unknown: u128,
}

impl SurroundingSegments {
    pub fn add(&mut self, segments: &Segments, key: NodeKey, crossing: &VoidCrossing) {
        let share = (crossing.share * SHARE_STEPS).round() as u128;
        match segments.at(key, crossing) {
            Some(segment) => self.put((segment.pass, segment.line), share, *segment),
            None => self.unknown += share,
        }
    }

    fn put(&mut self, name: (u32, u64), share: u128, segment: BeadSegment) {
        let entry = self.segments.entry(name).or_insert((0, segment));
        entry.0 += share;
        // Whichever leaf comes first, the same segment stands for the line.
        if (segment.a, segment.b) < (entry.1.a, entry.1.b) {
            entry.1 = segment;
        }
    }

    /// The first segment of each line.
    pub fn segments(&self) -> impl Iterator<Item = &BeadSegment> {
        self.segments.values().map(|(_, segment)| segment)
    }

    pub fn join(&mut self, other: SurroundingSegments) {
        self.unknown += other.unknown;
        for (name, (share, segment)) in other.segments {
            self.put(name, share, segment);
        }
    }
}
