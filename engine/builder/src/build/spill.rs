//! Triangles sorted by cube as packed records, in memory and in the temporary file.

use super::bins::SortedRun;
use super::packing::{pack, unpack};
use crate::error::Result;
use crate::lattice::Triangle;
use crate::part::temporary::TempFile;
use std::sync::Arc;

/// Bytes gathered into one write.
const WRITE_BYTES: usize = 4 << 20;
/// An extent in the file is not extended beyond this, so that a cube of any size is read in small parts: 32,000
/// triangles at the least, some 150,000 of strips.
const EXTENT_BYTES: usize = 1 << 20;

/// Some triangles of one cube, packed.
#[derive(Clone, Copy, Debug)]
pub(super) struct FileExtent {
    pub cell: u32,
    /// Triangles.
    pub count: u32,
    pub offset: u64,
    pub length: u32,
    /// CRC-32: what a disk returns is checked before it is taken for triangles.
    pub crc: u32,
}

impl FileExtent {
    fn of<'a>(&self, bytes: &'a [u8]) -> &'a [u8] {
        &bytes[self.offset as usize..][..self.length as usize]
    }
}

/// A run of triangles, packed cube by cube in one piece of memory.
pub(super) struct PackedRun {
    extents: Vec<FileExtent>,
    bytes: Vec<u8>,
}

impl PackedRun {
    /// Packs a sorted run.
    pub fn new(run: &SortedRun<Triangle>) -> PackedRun {
        let (mut extents, mut bytes) = (Vec::new(), Vec::new());
        for (cell, triangles) in run.cells() {
            // Within memory there is no need for a checksum.
            let (offset, count) = (bytes.len() as u64, triangles.len() as u32);
            pack(triangles, &mut bytes);
            let length = (bytes.len() as u64 - offset) as u32;
            extents.push(FileExtent { cell: cell as u32, count, offset, length, crc: 0 });
        }
        // They stay, and there are thousands of them.
        extents.shrink_to_fit();
        bytes.shrink_to_fit();
        PackedRun { extents, bytes }
    }

    /// Memory taken.
    pub fn heap_bytes(&self) -> u64 {
        (size_of_val(self.extents.as_slice()) + self.bytes.len()) as u64
    }
}

/// Writes runs to the file, cube by cube, and appends where they lie now to `extents`.
///
/// # Errors
/// If the file cannot be written.
pub(super) fn spill(runs: &[PackedRun], file: &TempFile, extents: &mut Vec<FileExtent>) -> Result<()> {
    let parts = |(number, run): (usize, &PackedRun)| {
        let of_run = run.extents.iter().enumerate();
        of_run.map(move |(n, extent)| (extent.cell, number as u32, n as u32)).collect::<Vec<_>>()
    };
    let mut order: Vec<(u32, u32, u32)> = runs.iter().enumerate().flat_map(parts).collect();
    order.sort_unstable();
    let mut buffer: Vec<u8> = Vec::with_capacity(WRITE_BYTES + EXTENT_BYTES);
    let mut first = extents.len();
    for (at, &(cell, run, n)) in order.iter().enumerate() {
        let run = &runs[run as usize];
        let part = &run.extents[n as usize];
        match extents[first..].last_mut() {
            Some(last) if last.cell == cell && (last.length + part.length) as usize <= EXTENT_BYTES => {
                last.count += part.count;
                last.length += part.length;
            }
            _ => extents.push(FileExtent { offset: buffer.len() as u64, ..*part }),
        }
        buffer.extend_from_slice(part.of(&run.bytes));
        if buffer.len() >= WRITE_BYTES || at + 1 == order.len() {
            let written = &mut extents[first..];
            written.iter_mut().for_each(|extent| extent.crc = crc32fast::hash(extent.of(&buffer)));
            let base = file.append(&buffer)?;
            written.iter_mut().for_each(|extent| extent.offset += base);
            first = extents.len();
            buffer.clear();
        }
    }
    Ok(())
}

/// All packed triangles of an input, found by cube.
pub(super) struct PackedCells {
    runs: Vec<PackedRun>,
    file: Arc<TempFile>,
    /// By cube, each with the number of the run that holds it, or [`IN_FILE`].
    extents: Vec<(FileExtent, u32)>,
    /// Where the extents of each cube begin, and the number of all at the end.
    starts: Vec<u32>,
}

const IN_FILE: u32 = u32::MAX;

impl PackedCells {
    /// Of `cells` cubes, from runs in memory and from extents in the file.
    pub fn new(
        cells: usize,
        runs: Vec<PackedRun>,
        spilled: Vec<FileExtent>,
        file: Arc<TempFile>,
    ) -> PackedCells {
        let mut extents: Vec<(FileExtent, u32)> =
            spilled.into_iter().map(|extent| (extent, IN_FILE)).collect();
        for (number, run) in runs.iter().enumerate() {
            extents.extend(run.extents.iter().map(|&extent| (extent, number as u32)));
        }
        extents.sort_unstable_by_key(|(extent, home)| (extent.cell, *home, extent.offset));
        extents.shrink_to_fit();
        let start = |cell| extents.partition_point(|(extent, _)| (extent.cell as usize) < cell) as u32;
        let starts = (0..=cells).map(start).collect();
        PackedCells { runs, file, extents, starts }
    }

    /// Memory taken.
    pub fn heap_bytes(&self) -> u64 {
        let runs: u64 = self.runs.iter().map(PackedRun::heap_bytes).sum();
        runs + size_of_val(self.extents.as_slice()) as u64 + size_of_val(self.starts.as_slice()) as u64
    }

    /// The file that parts of the cubes are in.
    pub fn file(&self) -> &Arc<TempFile> {
        &self.file
    }

    fn extents_of(&self, cell: usize) -> &[(FileExtent, u32)] {
        &self.extents[self.starts[cell] as usize..self.starts[cell + 1] as usize]
    }

    /// How many triangles touch one cube.
    pub fn count(&self, cell: usize) -> usize {
        self.extents_of(cell).iter().map(|(extent, _)| extent.count as usize).sum()
    }

    /// Calls `block` with all triangles of a cube in parts.
    ///
    /// # Errors
    /// If the file cannot be read or returns other bytes than were written; what `block` gives.
    pub fn for_blocks(&self, cell: usize, mut block: impl FnMut(&[Triangle]) -> Result<()>) -> Result<()> {
        let (mut read, mut triangles) = (Vec::new(), Vec::new());
        for (extent, home) in self.extents_of(cell) {
            let bytes = if *home == IN_FILE {
                read.resize(extent.length as usize, 0);
                self.file.read(extent.offset, &mut read)?;
                if crc32fast::hash(&read) != extent.crc {
                    return Err(self.file.damaged());
                }
                read.as_slice()
            } else {
                extent.of(&self.runs[*home as usize].bytes)
            };
            triangles.clear();
            unpack(bytes, &mut triangles).ok_or_else(|| self.file.damaged())?;
            block(&triangles)?;
        }
        Ok(())
    }
}
