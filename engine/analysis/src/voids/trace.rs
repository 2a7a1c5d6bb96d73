//! What is told of the beads around a void: lines, layers, features, and lines that may be missing.

use super::around::{SurroundingSegments, Tracer};
use super::gaps::gaps;
use crate::brick::Count;
use crate::error::Result;
use crate::store::BrickTree;
use std::collections::BTreeMap;

/// A line of a toolpath beside a void.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TracedLine {
    /// Its file, from 0.
    pub source: u32,
    /// First and last line of the file; the same where the store counts passes.
    pub lines: (u64, u64),
    /// Its layer, from 1.
    pub layer: u32,
    /// What of the void's surface it bounds, 0..1.
    pub share: f64,
}

/// What bounds a void.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Trace {
    /// First and last layer, from 1.
    pub layers: (u32, u32),
    /// Neighbours of a missing line first, and the others by their share of the surface.
    pub lines: Vec<TracedLine>,
    /// What the slicer calls the beads, by share of the surface.
    pub features: Vec<(String, f64)>,
    /// Beads around.
    pub beads: usize,
    /// Lines that face each other across the void, farther apart than they are wide: what may be missing lies between. The
    /// largest gap comes first.
    pub missing: Vec<(u64, u64)>,
    /// The share of the surface that belongs to no bead of the record.
    pub unknown: f64,
    /// The largest width of a bead around, in the store's unit.
    pub width: f64,
}

impl Trace {
    /// Of what is around a void; `is_sparse` as `has_sparse_infill` has it.
    ///
    /// # Errors
    /// What reading the store gives.
    pub(super) fn of(
        around: &SurroundingSegments,
        tracer: &Tracer<'_>,
        is_sparse: bool,
    ) -> Result<Option<Trace>> {
        let total: u128 = around.segments.values().map(|(share, _)| share).sum::<u128>() + around.unknown;
        if around.segments.is_empty() || total == 0 {
            return Ok(None);
        }
        let tables = tracer.tables();
        let mut lines: BTreeMap<(u32, (u64, u64)), (u32, u128)> = BTreeMap::new();
        let mut features: BTreeMap<u16, u128> = BTreeMap::new();
        let mut beads = Vec::new();
        let mut trace = Trace { layers: (u32::MAX, 0), ..Trace::default() };
        for (share, segment) in around.segments.values() {
            let bead = tables.bead_of(segment.pass).0;
            let row = tables.beads[bead as usize];
            let of = if tables.count() == Count::Passes { (segment.line, segment.line) } else { row.lines };
            lines.entry((row.source, of)).or_insert((row.layer + 1, 0)).1 += share;
            *features.entry(row.feature).or_default() += share;
            beads.push(bead);
            trace.layers = (trace.layers.0.min(row.layer + 1), trace.layers.1.max(row.layer + 1));
        }
        beads.dedup();
        trace.beads = beads.len();
        let part = |share: u128| share as f64 / total as f64;
        trace.unknown = part(around.unknown);
        let widths = around.segments.values().map(|(_, segment)| tracer.width(segment));
        trace.width = widths.fold(0.0, f64::max) * tracer.store.root().unit();
        let mut features: Vec<(u16, u128)> = features.into_iter().collect();
        features.sort_by_key(|&(feature, share)| (std::cmp::Reverse(share), feature));
        trace.features = features
            .into_iter()
            .map(|(f, share)| (tables.features[usize::from(f)].clone(), part(share)))
            .collect();
        trace.missing = gaps(around, tracer, is_sparse)?;
        let mut first_gap: BTreeMap<u64, usize> = BTreeMap::new();
        for (n, pair) in trace.missing.iter().enumerate() {
            for line in [pair.0, pair.1] {
                first_gap.entry(line).or_insert(n);
            }
        }
        let beside = |lines: (u64, u64)| {
            first_gap.range(lines.0..=lines.1).map(|(_, n)| *n).min().unwrap_or(usize::MAX)
        };
        let mut lines: Vec<_> = lines.into_iter().collect();
        lines.sort_by_key(|&((source, lines), (_, share))| {
            (beside(lines), std::cmp::Reverse(share), source, lines)
        });
        let line =
            |((source, lines), (layer, share))| TracedLine { source, lines, layer, share: part(share) };
        trace.lines = lines.into_iter().map(line).collect();
        Ok(Some(trace))
    }
}
