//! Where the bytes of a store are.

use crate::brick::{Brick, Samples, SignChanges};
use crate::error::Result;
use crate::lattice::BRICK_CELLS;
use crate::progress::Progress;
use crate::store::{Compression, IndexEntry, Scratch, Store, Walk, encode_with, parts};
use rayon::prelude::*;
use serde::Serialize;
use std::collections::BTreeMap;

/// Records that a thread takes at once.
const RECORDS_AT_ONCE: usize = 64;
/// Bytes of a segment in a list of beads as plain numbers: bead, section and six coordinates of 32 bits each.
const SEGMENT_BYTES: u64 = 32;

/// Bytes of a store by kind of record.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Statistics {
    /// One entry a level, the root's first.
    pub levels: Vec<LevelStatistics>,
    /// The sums of all levels.
    pub total: RecordNumbers,
    /// Lists of beads.
    pub lists: PartBytes,
    /// The file as a whole.
    pub file: FileBytes,
}

/// Numbers of one level.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct LevelStatistics {
    /// 0 for the root.
    pub level: u8,
    /// World distance of two samples, in the store's unit.
    pub spacing: f64,
    /// The level's numbers.
    #[serde(flatten)]
    pub numbers: RecordNumbers,
}

/// Numbers of a set of records.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct RecordNumbers {
    /// All of them.
    pub records: u64,
    /// Leaves among them.
    pub leaves: u64,
    /// Those of each kind, by the name of the kind.
    pub kinds: BTreeMap<String, KindNumbers>,
    /// Samples of those with a payload.
    pub samples: PartBytes,
    /// Hermite edges.
    pub hermite: PartBytes,
    /// Payload bytes of leaves.
    pub leaf_bytes: u64,
    /// Hermite edges of leaves.
    pub edges: u64,
    /// Cells of leaves whose corners do not all lie on the same side of w = 0.5.
    pub crossing_cells: u64,
    /// Samples that leaves own and that are a corner of such a cell of the same leaf.
    pub active_voxels: u64,
    /// `leaf_bytes` / `crossing_cells`; none without such cells.
    pub bytes_per_crossing_cell: Option<f64>,
    /// `leaf_bytes` / `active_voxels`.
    pub bytes_per_active_voxel: Option<f64>,
}

/// Records of one kind.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct KindNumbers {
    /// How many.
    pub records: u64,
    /// Their payload bytes.
    pub bytes: u64,
}

/// A part of records, as stored and as it is without compression.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct PartBytes {
    /// Records that have the part.
    pub records: u64,
    /// Bytes as stored.
    pub stored: u64,
    /// Bytes before compression: of lists of beads, segments as plain numbers.
    pub plain: u64,
}

/// Bytes of a file. All of them but what stands behind the commit.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct FileBytes {
    /// Size of the file.
    pub bytes: u64,
    /// Payloads of bricks.
    pub payloads: u64,
    /// Lists of beads.
    pub lists: u64,
    /// Tables of beads and the index of lists.
    pub tables: u64,
    /// Index of bricks.
    pub index: u64,
    /// Header pages, metadata, and bytes that nothing refers to; `cache compact` drops the latter.
    pub rest: u64,
    /// `bytes` over the crossing cells of all leaves.
    pub per_crossing_cell: Option<f64>,
    /// `bytes` over the active voxels of all leaves.
    pub per_active_voxel: Option<f64>,
}

/// Reads every record of a store, a shard or an unfinished store.
///
/// # Errors
/// Records that are damaged; [`crate::error::Error::Interrupted`].
pub fn statistics(store: &Store, progress: &dyn Progress) -> Result<Statistics> {
    let entries = store.entries();
    progress.phase("reading", Some(entries.len() as u64), "records");
    let per_level = entries.chunk_by(|a, b| a.key.level() == b.key.level());
    let mut levels = Vec::new();
    for entries in per_level {
        let level = entries[0].key.level();
        let numbers = numbers_of(store, entries, progress)?.with_ratios();
        levels.push(LevelStatistics { level, spacing: store.meta().root.spacing(level), numbers });
    }
    let all = levels.iter().map(|level| level.numbers.clone());
    let total = all.reduce(RecordNumbers::and).unwrap_or_default().with_ratios();
    let lists = lists(store, progress)?;
    let file = file_bytes(store, &total, lists.stored);
    Ok(Statistics { levels, total, lists, file })
}

fn file_bytes(store: &Store, total: &RecordNumbers, lists: u64) -> FileBytes {
    let bytes = store.file_bytes();
    let payloads = total.kinds.values().map(|kind| kind.bytes).sum();
    let place = store.meta().beads.as_ref().and_then(|beads| beads.identity).unwrap_or_default();
    let tables = place.tables_bytes + place.index_bytes();
    let index = match store.is_unfinished() {
        true => 0,
        false => (store.entries().len() * IndexEntry::BYTES) as u64,
    };
    FileBytes {
        bytes,
        payloads,
        lists,
        tables,
        index,
        rest: bytes.saturating_sub(payloads + lists + tables + index),
        per_crossing_cell: ratio(bytes, total.crossing_cells),
        per_active_voxel: ratio(bytes, total.active_voxels),
    }
}

fn ratio(bytes: u64, count: u64) -> Option<f64> {
    (count > 0).then(|| bytes as f64 / count as f64)
}

fn numbers_of(store: &Store, entries: &[IndexEntry], progress: &dyn Progress) -> Result<RecordNumbers> {
    let walk = Walk::new(store, entries.len(), |number| Some(entries[number].key));
    let of_chunk = |(number, chunk): (usize, &[IndexEntry])| {
        walk.at(number * RECORDS_AT_ONCE);
        let mut numbers = RecordNumbers::default();
        let mut desk = (Scratch::new(), Vec::new(), Vec::new());
        for entry in chunk {
            progress.check()?;
            numbers.add(store, entry, &mut desk)?;
        }
        progress.advance(chunk.len() as u64);
        Ok(numbers)
    };
    // Handed out in order, so that all threads together go through the level from one end to the other.
    let chunks = entries.chunks(RECORDS_AT_ONCE).enumerate().par_bridge().map(of_chunk);
    chunks.try_reduce(RecordNumbers::default, |a, b| Ok(a.and(b)))
}

impl PartBytes {
    fn add(&mut self, [stored, plain]: [usize; 2]) {
        self.records += u64::from(plain > 0);
        self.stored += stored as u64;
        self.plain += plain as u64;
    }

    fn and(self, other: PartBytes) -> PartBytes {
        PartBytes {
            records: self.records + other.records,
            stored: self.stored + other.stored,
            plain: self.plain + other.plain,
        }
    }
}

impl RecordNumbers {
    fn add(
        &mut self,
        store: &Store,
        entry: &IndexEntry,
        (scratch, stored, plain): &mut (Scratch, Vec<u8>, Vec<u8>),
    ) -> Result<()> {
        self.records += 1;
        self.leaves += u64::from(entry.leaf);
        let kind = self.kinds.entry(entry.head.kind.to_string()).or_default();
        kind.records += 1;
        kind.bytes += u64::from(entry.length);
        store.read_payload(entry, stored)?;
        let brick = store.decode(entry, stored, scratch)?;
        let Brick::Counts { samples, hermite } = &brick else { return Ok(()) };
        plain.clear();
        let head = encode_with(&brick, Compression::None, scratch, plain);
        // Both have just been decoded or encoded, so they have their parts.
        let lengths = |kind, bytes| parts(kind, bytes).unwrap_or_default().map(<[u8]>::len);
        let (stored, plain) = (lengths(entry.head.kind, stored), lengths(head.kind, plain));
        self.samples.add([stored[0], plain[0]]);
        self.hermite.add([stored[1], plain[1]]);
        if entry.leaf {
            self.leaf_bytes += u64::from(entry.length);
            self.edges += hermite.len() as u64;
            let (cells, voxels) = crossing_cells(samples);
            self.crossing_cells += cells;
            self.active_voxels += voxels;
        }
        Ok(())
    }

    fn and(mut self, other: RecordNumbers) -> RecordNumbers {
        for (name, kind) in other.kinds {
            let own = self.kinds.entry(name).or_default();
            own.records += kind.records;
            own.bytes += kind.bytes;
        }
        RecordNumbers {
            records: self.records + other.records,
            leaves: self.leaves + other.leaves,
            samples: self.samples.and(other.samples),
            hermite: self.hermite.and(other.hermite),
            leaf_bytes: self.leaf_bytes + other.leaf_bytes,
            edges: self.edges + other.edges,
            crossing_cells: self.crossing_cells + other.crossing_cells,
            active_voxels: self.active_voxels + other.active_voxels,
            ..self
        }
    }

    fn with_ratios(mut self) -> RecordNumbers {
        self.bytes_per_crossing_cell = ratio(self.leaf_bytes, self.crossing_cells);
        self.bytes_per_active_voxel = ratio(self.leaf_bytes, self.active_voxels);
        self
    }
}

/// How many of a brick's cells have corners on both sides of w = 0.5, and how many of its own samples are corners of them.
fn crossing_cells(samples: &Samples) -> (u64, u64) {
    const OWNED: u64 = (1 << BRICK_CELLS) - 1;
    let signs = SignChanges::of(samples);
    let (mut cells, mut voxels) = (0, 0);
    let mut layer_before = [0u64; BRICK_CELLS];
    for k in 0..BRICK_CELLS {
        let layer: [u64; BRICK_CELLS] = std::array::from_fn(|j| {
            let rows = [(j, k), (j + 1, k), (j, k + 1), (j + 1, k + 1)].map(|(j, k)| signs.row(j, k));
            let (any, all) = rows.iter().fold((0, u64::MAX), |(any, all), row| (any | row, all & row));
            ((any | any >> 1) & !(all & all >> 1)) & OWNED
        });
        for j in 0..BRICK_CELLS {
            cells += u64::from(layer[j].count_ones());
            let below = if j > 0 { layer[j - 1] | layer_before[j - 1] } else { 0 };
            let around = layer[j] | layer_before[j] | below;
            voxels += u64::from(((around | around << 1) & OWNED).count_ones());
        }
        layer_before = layer;
    }
    (cells, voxels)
}

/// The lists of beads.
fn lists(store: &Store, progress: &dyn Progress) -> Result<PartBytes> {
    let Some(tables) = store.bead_tables()? else {
        let stored = store.identity_entries().iter().map(|list| u64::from(list.length)).sum();
        // Those of an unfinished store, whose tables are still to come.
        return Ok(PartBytes { records: store.identity_entries().len() as u64, stored, plain: 0 });
    };
    let mut bytes = PartBytes::default();
    for list in store.identity_entries() {
        progress.check()?;
        bytes.records += 1;
        bytes.stored += u64::from(list.length);
        bytes.plain += store.segments(list.key, &tables)?.len() as u64 * SEGMENT_BYTES;
    }
    Ok(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::brick::point_index;

    #[test]
    fn cells_and_voxels_are_counted_as_they_lie() {
        let inside: [[usize; 3]; 4] = [[0, 0, 0], [32, 32, 32], [5, 6, 7], [31, 4, 0]];
        let mut samples = Samples::filled(0);
        inside.iter().for_each(|&ijk| samples.0[point_index(ijk)] = 2);
        let is_inside = |ijk: [usize; 3]| inside.contains(&ijk);
        let all = || (0..32usize.pow(3)).map(|n| [n % 32, n / 32 % 32, n / 1024]);
        let corners = |cell: [usize; 3]| (0..8).map(move |c| [0, 1, 2].map(|a| cell[a] + (c >> a & 1)));
        let crosses = |cell: [usize; 3]| corners(cell).any(is_inside) && !corners(cell).all(is_inside);
        let cells: Vec<[usize; 3]> = all().filter(|&cell| crosses(cell)).collect();
        let voxels = all().filter(|&v| cells.iter().any(|&cell| corners(cell).any(|c| c == v))).count();
        assert_eq!(crossing_cells(&samples), (cells.len() as u64, voxels as u64));
        assert_eq!(crossing_cells(&Samples::filled(1)), (0, 0));
    }
}
