//! The pass over the input: snap every vertex, sum the edge balance, sort the triangles by job.

use super::bins::{Binner, SortedRun};
use super::facet_filter::{FacetFilter, Spacing};
use super::field::PieceField;
use super::resources::SpillResources;
use super::sorted::SortedPieces;
use super::sorter::Collector;
use super::soup::Soup;
use super::spill::PackedRun;
use crate::error::Result;
use crate::ingest::{Facet, Facets, runs};
use crate::lattice::{RootCube, Triangle};
use crate::progress::Progress;
use crate::schedule::fold_in_order;
use crate::winding::EdgeBalance;
use rayon::prelude::*;
use std::ops::Range;

/// The snapped soup.
pub(super) struct SnappedSoup {
    pub sorted: SortedPieces<Soup>,
    pub balance: EdgeBalance,
    /// Triangles that have no area on the lattice.
    pub degenerate: u64,
}

/// Triangles sorted at a time: a run has a table of the cubes, of up to 16 KB, and these take 590.
const SORTED_FACETS: usize = 1 << 14;

/// What one thread has made of its part of the input.
struct Part {
    sieve: Option<FacetFilter>,
    /// Triangles that wait for being sorted.
    kept: Vec<Triangle>,
    collector: Collector,
    balance: EdgeBalance,
    degenerate: u64,
}

/// Snaps and sorts all sources as one soup for jobs in the cubes of `binner`. What does not fit in the room goes to its
/// temporary file. Triangles that show in no sample of a tree down to `depth` may be left out, if one is given.
///
/// # Errors
/// If the disk has too little room for that file, or the user interrupts.
pub(super) fn snap(
    sources: &[&dyn Facets],
    root: RootCube,
    (binner, depth): (Binner, Option<u8>),
    room: &SpillResources,
    progress: &dyn Progress,
) -> Result<SnappedSoup> {
    let runs = runs(sources);
    let plan = Plan::new(sources, &runs, root, (binner, depth), room)?;
    let memory = room.sorted_bytes() / rayon::current_num_threads() as u64;
    let part = || {
        let collector = Collector::new(binner, memory, plan.plain, room.file());
        let sieve = depth.filter(|_| plan.sieve).and_then(FacetFilter::new);
        let kept = Vec::with_capacity(SORTED_FACETS);
        (
            Part { sieve, kept, collector, balance: EdgeBalance::default(), degenerate: 0 },
            Vec::new(),
            Vec::new(),
        )
    };
    let parts = fold_in_order(&runs, part, |(part, world, snapped), (source, range)| {
        progress.check()?;
        read(sources[*source], range.clone(), root, world, snapped);
        progress.advance(snapped.len() as u64);
        part.add(snapped)
    })?;
    let mut parts: Vec<Part> = parts.into_iter().map(|(part, ..)| part).collect();
    parts.iter_mut().try_for_each(Part::sort)?;
    let mut balance = EdgeBalance::default();
    parts.iter().for_each(|part| balance.merge(part.balance));
    let degenerate = parts.iter().map(|part| part.degenerate).sum();
    let sorted = Collector::finish(parts.into_iter().map(|part| part.collector).collect())?;
    Ok(SnappedSoup { sorted, balance, degenerate })
}

impl Part {
    fn add(&mut self, triangles: &[Triangle]) -> Result<()> {
        let (mut balance, mut degenerate) = (self.balance, 0);
        for t in triangles {
            balance.add(t);
            if Soup::CPU.is_void(t) {
                degenerate += 1;
            } else if self.sieve.as_mut().is_none_or(|sieve| sieve.keeps(t)) {
                self.kept.push(*t);
            }
        }
        self.balance = balance;
        self.degenerate += degenerate;
        if self.kept.len() < SORTED_FACETS { Ok(()) } else { self.sort() }
    }

    fn sort(&mut self) -> Result<()> {
        self.collector.push(&self.kept)?;
        self.kept.clear();
        Ok(())
    }
}

/// Reads and snaps some triangles.
pub(super) fn read(
    source: &dyn Facets,
    range: Range<u64>,
    root: RootCube,
    world: &mut Vec<Facet>,
    snapped: &mut Vec<Triangle>,
) {
    source.read(range, world);
    let snapper = root.snapper();
    snapped.clear();
    snapped.extend(world.iter().map(|t| t.map(snapper)));
}

/// Runs of which a part is sorted to foresee the size of all.
const SAMPLED_RUNS: usize = 64;
/// Triangles of such a part.
const SAMPLED_TRIANGLES: u64 = 1 << 10;

/// What a sample of the triangles tells of all.
#[derive(Clone, Copy, Debug, Default)]
struct Sample {
    triangles: u64,
    /// Triangles between lines of the deepest lattice.
    hidden: u64,
    /// Bytes of the others, sorted.
    plain: u64,
    /// The same, packed; 0 if that was not asked for.
    packed: u64,
}

impl Sample {
    fn of(
        source: &dyn Facets,
        range: &Range<u64>,
        (root, binner, lattice): (RootCube, &Binner, Option<Spacing>),
        pack: bool,
    ) -> Sample {
        let range = range.start..range.end.min(range.start + SAMPLED_TRIANGLES);
        let (mut world, mut snapped) = (Vec::new(), Vec::new());
        read(source, range, root, &mut world, &mut snapped);
        let triangles = snapped.len() as u64;
        snapped.retain(|t| lattice.is_none_or(|lattice| lattice.hides(t).is_none()));
        let run = SortedRun::new(&Soup::CPU, binner, &snapped);
        Sample {
            triangles,
            hidden: triangles - snapped.len() as u64,
            plain: run.pieces() * size_of::<Triangle>() as u64,
            packed: if pack { PackedRun::new(&run).heap_bytes() } else { 0 },
        }
    }

    fn and(self, other: Sample) -> Sample {
        Sample {
            triangles: self.triangles + other.triangles,
            hidden: self.hidden + other.hidden,
            plain: self.plain + other.plain,
            packed: self.packed + other.packed,
        }
    }
}

/// How triangles are kept.
struct Plan {
    /// As they are, because that fits in memory.
    plain: bool,
    /// Without those that no line meets.
    sieve: bool,
}

impl Plan {
    /// Foresees it. If triangles do not fit in memory, even packed, the disk must have room for them, and for a quarter
    /// more, because the estimate rests on a sample.
    fn new(
        sources: &[&dyn Facets],
        runs: &[(usize, Range<u64>)],
        root: RootCube,
        (binner, depth): (Binner, Option<u8>),
        room: &SpillResources,
    ) -> Result<Plan> {
        let lattice = depth.and_then(Spacing::new);
        let sample = |pack| {
            let parts = runs.par_iter().step_by(runs.len().div_ceil(SAMPLED_RUNS).max(1));
            let of_run = |(source, range): &(usize, _)| {
                Sample::of(sources[*source], range, (root, &binner, lattice), pack)
            };
            parts.map(of_run).reduce(Sample::default, Sample::and)
        };
        let seen = sample(false);
        let all: u64 = sources.iter().map(|source| source.facets()).sum();
        let of_all =
            |bytes: u64| (u128::from(bytes) * u128::from(all) / u128::from(seen.triangles.max(1))) as u64;
        // Every thread keeps one hidden triangle a brick.
        let told = lattice.map_or(0, |lattice| (lattice.bricks() * rayon::current_num_threads()) as u64);
        let told = told.min(of_all(seen.hidden)) * size_of::<Triangle>() as u64;
        // Every run has a table of the cubes.
        let plain = of_all(seen.plain) + told + runs.len() as u64 * (binner.cells() as u64 + 1) * 4;
        let plan = Plan {
            plain: plain <= room.sorted_bytes() / 10 * 9,
            // Where little is left out it only costs: 2 % of the time for a pile of a million facets at depth 5.
            sieve: seen.hidden * 8 > seen.triangles,
        };
        if !plan.plain {
            let packed = of_all(sample(true).packed) + told;
            if packed > room.sorted_bytes() / 4 * 3 {
                room.file().require_room(packed.saturating_add(packed / 4))?;
            }
        }
        Ok(plan)
    }
}
