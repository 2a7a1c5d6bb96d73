//! Tables of beads for picks, of a store that tells beads apart.

use crate::brick::Count;
use crate::bsp::HEADER_BYTES;
use crate::error::{Error, Result};
use crate::lattice::{NodeKey, Units};
use crate::picks::{
    AXIS_ONE, CodedPickBlock, PickBead, PickHeader, PickOutline, PickSegment, SEGMENTS_MAX, Steps,
    pick_table_bytes,
};
use crate::progress::Progress;
use crate::store::{BeadSegment, BeadTables, BrickTree, IdentityEntry, SectionRow, Store};
use rayon::prelude::*;
use std::path::Path;

/// Lists that are read between two looks at whether the user wants to go on.
const LISTS_AT_ONCE: usize = 1 << 12;
/// Memory that a segment takes while a table is made: twice while they are sorted.
const SEGMENT_MEMORY: u64 = 2 * size_of::<BeadSegment>() as u64;
/// A bead's width and height have at least so many steps across, and so many up: heights of layers are to be told exactly.
const STEPS: [f64; 2] = [64.0, 1024.0];
/// Lines beyond are none of a file.
const LINE_MAX: u64 = 1 << 60;

/// The beads of a store, coded for picks.
pub struct PickBeads {
    header: PickHeader,
    features: Vec<String>,
    sources: Vec<String>,
    blocks: Vec<CodedPickBlock>,
    segments: u64,
}

impl PickBeads {
    /// The memory that a table takes while it is made, of a store of beads as solids; `None` of others.
    pub fn memory(store: &Store) -> Option<u64> {
        Some(store.meta().beads.as_ref()?.segments.saturating_mul(SEGMENT_MEMORY))
    }

    /// Those of a store; `None` if it does not tell beads apart. The bytes do not depend on the number of threads.
    ///
    /// # Errors
    /// [`Error::Store`] if the store is damaged or has a section that this program does not know; [`Error::Interrupted`].
    pub fn new(store: &Store, progress: &dyn Progress) -> Result<Option<PickBeads>> {
        let Some(tables) = store.bead_tables()? else { return Ok(None) };
        let segments = segments(store, &tables, progress)?;
        PickBeads::of(store, tables, segments, progress).map(Some)
    }

    /// Beads and segments that belong to a store, wherever they were read from: the same bytes in whatever order they come.
    ///
    /// # Errors
    /// As [`PickBeads::new`].
    pub fn of(
        store: &Store,
        tables: BeadTables,
        mut segments: Vec<BeadSegment>,
        progress: &dyn Progress,
    ) -> Result<PickBeads> {
        let header = header(store, &tables)?;
        segments.par_sort_unstable_by_key(|s| (s.pass, s.line, s.a, s.b, s.section));
        segments.dedup();
        let segments = in_order(segments);
        progress.check()?;
        let coded = |some: &[BeadSegment]| {
            let made: Vec<PickSegment> = some.iter().map(|s| quantised(s, &tables, store, &header)).collect();
            header.code(&made)
        };
        let blocks = segments.par_chunks(SEGMENTS_MAX).map(coded).collect();
        let name = |path: &String| {
            let name = Path::new(path).file_name().map(|name| name.to_string_lossy().into_owned());
            name.unwrap_or_default()
        };
        let sources = store.meta().sources.iter().map(|source| name(&source.path)).collect();
        let segments = segments.len() as u64;
        Ok(PickBeads { header, features: tables.features, sources, blocks, segments })
    }

    /// How many segments of beads there are.
    pub fn segments(&self) -> u64 {
        self.segments
    }

    /// The bytes of the table that goes with a file of splats.
    ///
    /// # Panics
    /// If that has no header.
    pub fn bytes(&self, splats: &[u8]) -> Vec<u8> {
        let crc = splats[HEADER_BYTES - 4..HEADER_BYTES].try_into().expect("four bytes");
        let header = PickHeader { part: u32::from_le_bytes(crc), ..self.header };
        pick_table_bytes(header, &self.features, &self.sources, &self.blocks)
    }
}

/// What the table says of itself; what it says of its blocks is filled in later.
fn header(store: &Store, tables: &BeadTables) -> Result<PickHeader> {
    let name = store.meta().beads.as_ref().map(|beads| &*beads.section);
    let outline = match name {
        Some("stadium") => PickOutline::Stadium,
        Some("ellipse") => PickOutline::Ellipse,
        _ => {
            let what = "its beads have a section that this program does not know";
            return Err(Error::store(store.path(), "metadata", what, "use the program that wrote it"));
        }
    };
    let sizes = |s: &SectionRow| [2.0 * s.half_width, 2.0 * s.half_height];
    let sizes = tables.sections.iter().flat_map(sizes).filter(|size| *size > 0.0);
    let least = sizes.fold(f64::INFINITY, f64::min).min(f64::from(1u32 << 24));
    let [across, up] =
        STEPS.map(|steps| store.root().unit() * f64::from(1u32 << (least / steps).max(1.0).log2() as u32));
    let origin = store.root().to_world([0.0; 3]);
    let by_segment = tables.count() == Count::Passes;
    Ok(PickHeader::new(origin, Steps { across, up }, outline, by_segment))
}

/// All segments, in no order; some may come twice.
fn segments(store: &Store, tables: &BeadTables, progress: &dyn Progress) -> Result<Vec<BeadSegment>> {
    let lists = store.identity_entries();
    progress.phase("coding beads", Some(lists.len() as u64), "lists");
    let deepest = lists.last().map_or(0, |list| list.key.level());
    let mut all = Vec::new();
    for some in lists.chunks(LISTS_AT_ONCE) {
        progress.check()?;
        let of_list = |list: &IdentityEntry| -> Result<Vec<BeadSegment>> {
            let mut segments = store.segments(list.key, tables)?;
            segments.retain(|segment| is_of(list.key, segment.a, lists, deepest));
            Ok(segments)
        };
        let found: Vec<Vec<BeadSegment>> = some.par_iter().map(of_list).collect::<Result<_>>()?;
        found.into_iter().for_each(|found| all.extend(found));
        progress.advance(some.len() as u64);
    }
    Ok(all)
}

/// Whether a segment that begins there is taken from this list: from that of the leaf where it begins, so that it is sorted once, or
/// from all if that leaf has none.
fn is_of(leaf: NodeKey, begin: Units, lists: &[IdentityEntry], deepest: u8) -> bool {
    let Some(at) = NodeKey::deepest_at(begin) else { return true };
    let is_listed = |key: NodeKey| lists.binary_search_by_key(&key, |list| list.key).is_ok();
    at.ancestor(leaf.level()) == Some(leaf)
        || !(0..=deepest).filter_map(|level| at.ancestor(level)).any(is_listed)
}

/// Sorted segments in the order in which beads are laid, as far as their ends tell it: that takes fewest bytes.
fn in_order(sorted: Vec<BeadSegment>) -> Vec<BeadSegment> {
    let mut all = Vec::with_capacity(sorted.len());
    for group in sorted.chunk_by(|one, next| (one.pass, one.line) == (next.pass, next.line)) {
        match group {
            [one] => all.push(*one),
            _ => chain(group, &mut all),
        }
    }
    all
}

/// Appends segments, which are sorted by their begin, so that each follows one that ends where it begins, if there is one.
fn chain(group: &[BeadSegment], all: &mut Vec<BeadSegment>) {
    let mut ends: Vec<Units> = group.iter().map(|segment| segment.b).collect();
    ends.sort_unstable();
    let is_first = |n: &usize| ends.binary_search(&group[*n].a).is_err();
    // First those that no other leads to, then what is left of rings.
    let starts: Vec<usize> = (0..group.len()).filter(is_first).chain(0..group.len()).collect();
    let mut is_taken = vec![false; group.len()];
    // Where those that begin at one place go on.
    let mut passed = vec![0; group.len()];
    let mut next_at = |place: Units, is_taken: &[bool]| {
        let first = group.partition_point(|segment| segment.a < place);
        let skip = passed.get_mut(first)?;
        while is_taken.get(first + *skip) == Some(&true) && group[first + *skip].a == place {
            *skip += 1;
        }
        group.get(first + *skip).filter(|segment| segment.a == place).map(|_| first + *skip)
    };
    let mut at = all.last().and_then(|last| next_at(last.b, &is_taken));
    let mut starts = starts.into_iter();
    loop {
        while let Some(n) = at {
            is_taken[n] = true;
            all.push(group[n]);
            at = next_at(group[n].b, &is_taken);
        }
        at = starts.find(|n| !is_taken[*n]);
        if at.is_none() {
            return;
        }
    }
}

/// A segment in steps.
fn quantised(segment: &BeadSegment, tables: &BeadTables, store: &Store, header: &PickHeader) -> PickSegment {
    let unit = store.root().unit();
    let steps = [header.steps.across / unit, header.steps.across / unit, header.steps.up / unit];
    let place = |p: Units| std::array::from_fn(|a| (f64::from(p[a]) / steps[a]).round() as i32);
    let section = tables.sections[segment.section as usize];
    let size = |half: f64, step: f64| (2.0 * half / step).round().clamp(1.0, f64::from(1u32 << 25)) as u32;
    let number = tables.bead_of(segment.pass).0;
    let row = tables.beads[number as usize];
    let by_segment = header.by_segment;
    let lines = if by_segment { (0, 0) } else { (row.lines.0.min(LINE_MAX), row.lines.1.min(LINE_MAX)) };
    PickSegment {
        a: place(segment.a),
        b: place(segment.b),
        width: size(section.half_width, steps[0]),
        height: size(section.half_height, steps[2]),
        axis: section.axis.map(|c| (c * f64::from(AXIS_ONE)).round() as i16),
        bead: PickBead {
            number,
            layer: row.layer,
            feature: u32::from(row.feature),
            source: row.source,
            lines,
        },
        line: if by_segment { segment.line.min(LINE_MAX) } else { 0 },
    }
}
