//! Files of plans: the triangles of a closed soup on the lattice, sorted by cube, and all that a shard has to know of the
//! whole. A shard reads its own cubes.
//!
//! ```text
//! head:       "BRFPLAN1"
//! triangles:  one cube after the other, packed as in temporary files, in extents
//! directory:  metadata of a shard · way to turn pieces · settings · numbers of cubes, corners, extents · work of each cube
//!             u64 · jumps between corners i64 · extents: cube u32, triangles u32, offset u64, bytes u32, CRC-32 u32
//! foot:       offset u64 · bytes u64 · CRC-32 u32 of the directory, u32 0, "BRFPLAN1"
//! ```
//! Integers are little-endian. The first three begin with their length, a u32. A plan is read by the version of the program that
//! has made it.

use super::bins::Binner;
use super::packing::{pack, unpack};
use super::sorted::{CellStore, SortedPieces};
use super::sorter::Collector;
use super::soup::Soup;
use super::spill::FileExtent;
use crate::error::{Error, Result};
use crate::lattice::Triangle;
use crate::mmap::{Access, MappedFile, begins_with};
use crate::part::PartFile;
use crate::part::temporary::TempFile;
use crate::progress::Progress;
use crate::schedule::run_ordered;
use crate::store::{Fields, Meta, SettingPairs, decode_settings, encode_settings};
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::Arc;

const MAGIC: [u8; 8] = *b"BRFPLAN1";
const FOOT_BYTES: usize = 32;
const ROW_BYTES: usize = 24;
/// Packed triangles are written in extents of about this size.
const EXTENT_BYTES: usize = 1 << 20;
/// Cubes with more triangles are packed one after the other, in the place of side by side.
const TRIANGLES_AT_ONCE: usize = 1 << 18;
const REMEDY: &str = "make the plan again";

/// What a plan holds beside triangles.
pub(super) struct PlanDirectory {
    /// As of the first of one shard, which tells the level of cubes, the error of samples and the sum over all pieces.
    pub meta: Meta,
    /// The way in which pieces were turned.
    pub way: String,
    /// What else decides the store beside the metadata.
    pub settings: SettingPairs,
    /// Of each cube that is shared out.
    pub work: Vec<u64>,
    /// Between the corners of the cubes that triangles are sorted by.
    pub jumps: Vec<i64>,
}

/// A plan that is open.
pub(super) struct PlanFile {
    pub directory: PlanDirectory,
    path: PathBuf,
    map: MappedFile,
    extents: Vec<FileExtent>,
}

/// Whether a file is a plan, by its first bytes.
pub fn is_plan(path: &Path) -> bool {
    begins_with(path, &MAGIC)
}

/// Writes a plan and returns its size in bytes. Memory holds the packed triangles of some cubes.
///
/// # Errors
/// If the file cannot be written, the sorted triangles cannot be read, or the user interrupts.
pub(super) fn write_plan(
    path: &Path,
    directory: &PlanDirectory,
    (sorted, cells): (&SortedPieces<Soup>, usize),
    progress: &dyn Progress,
) -> Result<u64> {
    let mut file = PartFile::create(path)?;
    file.append(&MAGIC)?;
    let mut extents = Vec::new();
    progress.phase("writing the plan", Some(cells as u64), "cubes");
    let work = |(): &mut (), cell: usize| {
        progress.check()?;
        let few = sorted.count(cell) <= TRIANGLES_AT_ONCE;
        let mut packed = Vec::new();
        if few {
            for_packed(sorted, cell, |count, bytes| {
                packed.push((count, bytes.to_vec()));
                Ok(())
            })?;
        }
        Ok((cell, few.then_some(packed)))
    };
    run_ordered(
        cells,
        2 * rayon::current_num_threads(),
        || (),
        work,
        |(cell, packed)| {
            let mut append = |count, bytes: &[u8]| {
                let (offset, length, crc) = (file.appended(), bytes.len() as u32, crc32fast::hash(bytes));
                extents.push(FileExtent { cell: cell as u32, count, offset, length, crc });
                file.append(bytes)
            };
            progress.advance(1);
            match packed {
                Some(packed) => packed.iter().try_for_each(|(count, bytes)| append(*count, bytes)),
                None => for_packed(sorted, cell, append),
            }
        },
    )?;
    let (offset, bytes) = (file.appended(), encoded(path, directory, &extents)?);
    file.append(&bytes)?;
    file.append(&offset.to_le_bytes())?;
    file.append(&(bytes.len() as u64).to_le_bytes())?;
    file.append(&crc32fast::hash(&bytes).to_le_bytes())?;
    file.append(&[0; 4])?;
    file.append(&MAGIC)?;
    let size = file.appended();
    file.finish()?;
    Ok(size)
}

/// Calls `each` with the triangles of a cube, packed in parts, and their numbers.
fn for_packed(
    sorted: &SortedPieces<Soup>,
    cell: usize,
    mut each: impl FnMut(u32, &[u8]) -> Result<()>,
) -> Result<()> {
    let (mut count, mut bytes) = (0, Vec::new());
    sorted.for_blocks(cell, &mut |triangles| {
        for some in triangles.chunks(EXTENT_BYTES / 64) {
            pack(some, &mut bytes);
            count += some.len() as u32;
            if bytes.len() >= EXTENT_BYTES {
                each(std::mem::take(&mut count), &bytes)?;
                bytes.clear();
            }
        }
        Ok(())
    })?;
    if count > 0 { each(count, &bytes) } else { Ok(()) }
}

fn encoded(path: &Path, directory: &PlanDirectory, extents: &[FileExtent]) -> Result<Vec<u8>> {
    let PlanDirectory { meta, way, settings, work, jumps } = directory;
    let meta = meta.to_shard_bytes().map_err(|what| Error::store(path, "metadata", what, REMEDY))?;
    let mut bytes = Vec::new();
    for part in [meta, way.as_bytes().to_vec(), encode_settings(settings)] {
        bytes.extend((part.len() as u32).to_le_bytes());
        bytes.extend(part);
    }
    for length in [work.len(), jumps.len(), extents.len()] {
        bytes.extend((length as u64).to_le_bytes());
    }
    work.iter().for_each(|work| bytes.extend(work.to_le_bytes()));
    jumps.iter().for_each(|jump| bytes.extend(jump.to_le_bytes()));
    for FileExtent { cell, count, offset, length, crc } in extents {
        bytes.extend(cell.to_le_bytes());
        bytes.extend(count.to_le_bytes());
        bytes.extend(offset.to_le_bytes());
        bytes.extend(length.to_le_bytes());
        bytes.extend(crc.to_le_bytes());
    }
    Ok(bytes)
}

/// A part that begins with its length.
fn part<'a>(fields: &mut Fields<'a>) -> Option<&'a [u8]> {
    let length = fields.u32()? as usize;
    fields.take(length)
}

/// So many numbers of 8 bytes each.
fn words(fields: &mut Fields<'_>, count: u64) -> Option<Vec<[u8; 8]>> {
    let bytes = fields.take(usize::try_from(count).ok()?.checked_mul(8)?)?;
    Some(bytes.as_chunks().0.to_vec())
}

impl PlanFile {
    /// Opens a plan and checks all but its triangles, which are checked when they are read.
    ///
    /// # Errors
    /// If the file cannot be read, is damaged, or is no plan.
    pub fn open(path: &Path) -> Result<PlanFile> {
        let map = MappedFile::open(path)?;
        map.advise(Access::Random);
        let damaged = |place: &str, what: &str| Error::input(path, place, what, REMEDY);
        let bytes = map.bytes();
        if !bytes.starts_with(&MAGIC) {
            return Err(damaged("head", "this is not a plan"));
        }
        let cut = || damaged("foot", "the file has been cut short, or more has been added to it");
        let foot = bytes.last_chunk::<FOOT_BYTES>().filter(|foot| foot.ends_with(&MAGIC)).ok_or_else(cut)?;
        let mut fields = Fields(foot);
        let [offset, length] = [0; 2].map(|_| fields.u64().unwrap_or(u64::MAX));
        let crc = fields.u32();
        let end = map.len() - FOOT_BYTES as u64;
        if offset.checked_add(length) != Some(end) || offset < MAGIC.len() as u64 {
            return Err(cut());
        }
        let stored = bytes[offset as usize..end as usize].to_vec();
        if Some(crc32fast::hash(&stored)) != crc {
            return Err(damaged("directory", "its checksum is wrong"));
        }
        let decoded = decoded(&stored, offset);
        let (directory, extents) = decoded.ok_or_else(|| damaged("directory", "it makes no sense"))?;
        map.check()?;
        Ok(PlanFile { directory, path: path.to_owned(), map, extents })
    }

    /// The triangles in some of the cubes, to be read when they are needed. Cubes that are divided go to `temporary`.
    pub fn triangles(self: &Arc<Self>, cells: Range<usize>, temporary: Arc<TempFile>) -> PlannedTriangles {
        PlannedTriangles { plan: Arc::clone(self), cells, temporary }
    }

    /// The error of a directory that says `what` cannot be.
    pub fn damaged(&self, what: &str) -> Error {
        Error::input(&self.path, "directory", what, REMEDY)
    }

    /// The error of a plan that another version of the program made.
    pub fn of_other_version(&self, program: &str) -> Error {
        let what = format!("it was made by {}, and this is {program}", self.directory.meta.program);
        Error::input(&self.path, "plan", what, REMEDY)
    }

    /// Whether the file is what it was when it was opened.
    ///
    /// # Errors
    /// If it is not.
    pub fn check(&self) -> Result<()> {
        self.map.check()
    }

    /// The extents of a cube.
    fn of(&self, cell: usize) -> &[FileExtent] {
        let start = self.extents.partition_point(|extent| (extent.cell as usize) < cell);
        let rest = &self.extents[start..];
        &rest[..rest.partition_point(|extent| extent.cell as usize == cell)]
    }
}

/// A directory and its extents, which lie in order before `end`; `None` if they make no sense.
fn decoded(bytes: &[u8], end: u64) -> Option<(PlanDirectory, Vec<FileExtent>)> {
    let mut fields = Fields(bytes);
    let meta = Meta::from_shard_bytes(part(&mut fields)?).ok()?;
    let way = String::from_utf8(part(&mut fields)?.to_vec()).ok()?;
    let settings = decode_settings(part(&mut fields)?)?;
    let [works, jumps, count] = [fields.u64()?, fields.u64()?, fields.u64()?];
    let work: Vec<u64> = words(&mut fields, works)?.into_iter().map(u64::from_le_bytes).collect();
    let jumps: Vec<i64> = words(&mut fields, jumps)?.into_iter().map(i64::from_le_bytes).collect();
    let rows = fields.take(usize::try_from(count).ok()?.checked_mul(ROW_BYTES)?)?;
    let extent = |row: &[u8]| {
        let mut fields = Fields(row);
        let (cell, count, offset) = (fields.u32()?, fields.u32()?, fields.u64()?);
        Some(FileExtent { cell, count, offset, length: fields.u32()?, crc: fields.u32()? })
    };
    let extents: Vec<FileExtent> = rows.chunks_exact(ROW_BYTES).map(extent).collect::<Option<_>>()?;
    let in_order = extents.windows(2).all(|pair| {
        pair[0].cell <= pair[1].cell
            && pair[0].offset.checked_add(pair[0].length.into()) == Some(pair[1].offset)
    });
    let within = extents.last().is_none_or(|last| last.offset.checked_add(last.length.into()) == Some(end));
    let behind_head = extents.first().map_or(end, |first| first.offset) == MAGIC.len() as u64;
    let is_whole = fields.0.is_empty() && in_order && within && behind_head;
    is_whole.then_some((PlanDirectory { meta, way, settings, work, jumps }, extents))
}

/// Triangles of a plan in some cubes.
pub(super) struct PlannedTriangles {
    plan: Arc<PlanFile>,
    cells: Range<usize>,
    temporary: Arc<TempFile>,
}

impl CellStore<Soup> for PlannedTriangles {
    fn count(&self, cell: usize) -> usize {
        let of_cell = if self.cells.contains(&cell) { self.plan.of(cell) } else { &[] };
        of_cell.iter().map(|extent| extent.count as usize).sum()
    }

    fn for_blocks(&self, cell: usize, block: &mut dyn FnMut(&[Triangle]) -> Result<()>) -> Result<()> {
        let damaged = || Error::input(&self.plan.path, "triangles", "their checksum is wrong", REMEDY);
        let mut triangles = Vec::new();
        for extent in self.plan.of(cell) {
            // A copy, because what has been checked must not change.
            let bytes = self.plan.map.bytes()[extent.offset as usize..][..extent.length as usize].to_vec();
            if crc32fast::hash(&bytes) != extent.crc {
                self.plan.check()?;
                return Err(damaged());
            }
            triangles.clear();
            unpack(&bytes, &mut triangles)
                .filter(|()| triangles.len() == extent.count as usize)
                .ok_or_else(damaged)?;
            block(&triangles)?;
        }
        Ok(())
    }

    fn split(&self, cell: usize, binner: &Binner, memory: u64) -> Result<SortedPieces<Soup>> {
        let mut collector = Collector::new(*binner, memory, false, Arc::clone(&self.temporary));
        self.for_blocks(cell, &mut |triangles| collector.push(triangles))?;
        Collector::finish(vec![collector])
    }

    fn heap_bytes(&self) -> u64 {
        size_of_val(self.plan.extents.as_slice()) as u64
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lattice::RootCube;
    use crate::store::{BuildCounts, Refine, Shard, ShardId, ShardNumbers};
    use proptest::prelude::*;

    fn directory() -> PlanDirectory {
        let shard = Shard {
            id: ShardId { number: 1, of: 1 },
            level: 1,
            gwn_error: 1e-3,
            found: ShardNumbers::default(),
        };
        let meta = Meta {
            program: "brickfield".to_owned(),
            sources: Vec::new(),
            unit: "mm".to_owned(),
            root: RootCube { origin: [0.0; 3], edge: 8.0 },
            bounds_min: [1.0; 3],
            bounds_max: [7.0; 3],
            depth: 1,
            refine: Refine::Hidden,
            stddev: 0.0,
            tolerance: None,
            numbers: BuildCounts::default(),
            beads: None,
            volumes: None,
            shard: Some(shard),
        };
        let settings = vec![("skipped".to_owned(), "Brim".to_owned())];
        PlanDirectory { meta, way: "None".to_owned(), settings, work: vec![3, 1, 4], jumps: vec![-1, 5] }
    }

    fn extents() -> Vec<FileExtent> {
        let at = |cell, offset, length| FileExtent { cell, count: 2, offset, length, crc: 7 };
        vec![at(0, 8, 10), at(0, 18, 4), at(5, 22, 3)]
    }

    #[test]
    fn a_directory_comes_back_unless_its_extents_leave_gaps() {
        let bytes = encoded(Path::new("x"), &directory(), &extents()).unwrap();
        let (read, rows) = decoded(&bytes, 25).unwrap();
        let written = directory();
        assert_eq!((read.meta, read.way, read.settings), (written.meta, written.way, written.settings));
        assert_eq!((read.work, read.jumps, rows.len()), (written.work, written.jumps, 3));
        assert!(decoded(&bytes, 26).is_none());
        for (at, offset) in [(0, 9), (1, 17), (2, u64::MAX)] {
            let mut extents = extents();
            extents[at].offset = offset;
            let bytes = encoded(Path::new("x"), &directory(), &extents).unwrap();
            assert!(decoded(&bytes, 25).is_none());
        }
    }

    proptest! {
        #[test]
        fn any_directory_is_read_or_refused(at in any::<prop::sample::Index>(), value in any::<u64>(), bits in 0u32..64) {
            let mut bytes = encoded(Path::new("x"), &directory(), &extents()).unwrap();
            let at = at.index(bytes.len() - 8);
            bytes[at..at + 8].copy_from_slice(&(value >> bits).to_le_bytes());
            if let Some((_, rows)) = decoded(&bytes, 25) {
                prop_assert!(rows.iter().all(|row| row.offset + u64::from(row.length) <= 25));
            }
            prop_assert!(decoded(&bytes[..at], 25).is_none());
        }
    }
}
