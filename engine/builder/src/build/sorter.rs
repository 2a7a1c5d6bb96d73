//! Sorting the triangles of a soup within a bound of memory: plain while they fit, then packed, then on disk.

use super::bins::{Binner, SortedRun};
use super::sorted::{CellStore, SortedPieces};
use super::soup::Soup;
use super::spill::{FileExtent, PackedCells, PackedRun, spill};
use crate::error::Result;
use crate::lattice::Triangle;
use crate::part::temporary::TempFile;
use std::sync::Arc;

/// Pairs of a triangle and a cube sorted at a time: 3 MB. Triangles of a size beyond the cubes' touch many.
const PAIRS: usize = 1 << 16;

/// Sorts triangles by the cube that they touch; one per thread.
pub(super) struct Collector {
    binner: Binner,
    file: Arc<TempFile>,
    /// Bytes that may be held.
    memory: u64,
    held: u64,
    /// Triangles are kept as they are, not packed.
    plain: bool,
    sorted: SortedPieces<Soup>,
    packed: Vec<PackedRun>,
    spilled: Vec<FileExtent>,
}

impl Collector {
    /// For the cubes of `binner`. `plain` says that all triangles are expected to fit as they are.
    pub fn new(binner: Binner, memory: u64, plain: bool, file: Arc<TempFile>) -> Collector {
        let (packed, spilled) = (Vec::new(), Vec::new());
        Collector { binner, file, memory, held: 0, plain, sorted: SortedPieces::default(), packed, spilled }
    }

    /// Adds triangles.
    ///
    /// # Errors
    /// If the temporary file cannot be written.
    pub fn push(&mut self, mut triangles: &[Triangle]) -> Result<()> {
        self.sorted.add_corners(&Soup::CPU, &self.binner, triangles);
        while !triangles.is_empty() {
            let (run, taken) = SortedRun::of_some(&Soup::CPU, &self.binner, triangles, PAIRS);
            self.keep(run)?;
            triangles = &triangles[taken..];
        }
        Ok(())
    }

    fn keep(&mut self, run: SortedRun<Triangle>) -> Result<()> {
        if self.plain {
            self.held += run.heap_bytes();
            self.sorted.push_sorted(run);
            if self.held > self.memory {
                self.plain = false;
                self.held = 0;
                for run in self.sorted.take_runs() {
                    self.keep(run)?;
                }
            }
            return Ok(());
        }
        let run = PackedRun::new(&run);
        self.held += run.heap_bytes();
        self.packed.push(run);
        if self.held > self.memory { self.spill() } else { Ok(()) }
    }

    fn spill(&mut self) -> Result<()> {
        spill(&self.packed, &self.file, &mut self.spilled)?;
        self.packed.clear();
        self.held = 0;
        Ok(())
    }

    /// The triangles of several collectors as one. What does not fit in memory as a whole is in the file as a whole.
    ///
    /// # Errors
    /// As [`Self::push`].
    pub fn finish(mut collectors: Vec<Collector>) -> Result<SortedPieces<Soup>> {
        if collectors.iter().any(|c| !c.spilled.is_empty()) {
            collectors.iter_mut().try_for_each(Collector::spill)?;
        }
        let mut all = SortedPieces::default();
        let (mut packed, mut spilled) = (Vec::new(), Vec::new());
        let mut place = None;
        for mut collector in collectors {
            packed.append(&mut collector.packed);
            spilled.append(&mut collector.spilled);
            place = Some((collector.binner, collector.file));
            all.merge(&Soup::CPU, collector.sorted);
        }
        if let Some((binner, file)) = place
            && !(packed.is_empty() && spilled.is_empty())
        {
            all.elsewhere = Some(Box::new(PackedCells::new(binner.cells(), packed, spilled, file)));
        }
        Ok(all)
    }
}

impl CellStore<Soup> for PackedCells {
    fn count(&self, cell: usize) -> usize {
        PackedCells::count(self, cell)
    }

    fn for_blocks(&self, cell: usize, block: &mut dyn FnMut(&[Triangle]) -> Result<()>) -> Result<()> {
        PackedCells::for_blocks(self, cell, block)
    }

    fn split(&self, cell: usize, binner: &Binner, memory: u64) -> Result<SortedPieces<Soup>> {
        let mut collector = Collector::new(*binner, memory, false, Arc::clone(self.file()));
        PackedCells::for_blocks(self, cell, |triangles| collector.push(triangles))?;
        Collector::finish(vec![collector])
    }

    fn heap_bytes(&self) -> u64 {
        PackedCells::heap_bytes(self)
    }
}
