//! Vertices out of positions: corners with the same coordinates are one vertex.

use super::{Mesh, Tally};
use crate::error::Result;
use crate::ingest::{Facet, Facets, runs};
use crate::lattice::{Units, hash_bits};
use crate::progress::Progress;
use hashbrown::HashTable;
use hashbrown::hash_table::Entry;
use rayon::prelude::*;
use std::ops::Range;

/// Runs of triangles whose corners are collected at a time, some million triangles: of a soup without common corners
/// 84 MiB.
const WAVE_RUNS: usize = 64;

/// What a corner is told from others by.
pub trait PositionBits: Copy + Send + Sync {
    /// The coordinates; equal positions have equal bits.
    fn bits(&self) -> [u64; 3];
}

/// World positions without −0.
impl PositionBits for [f64; 3] {
    fn bits(&self) -> [u64; 3] {
        self.map(f64::to_bits)
    }
}

impl PositionBits for Units {
    fn bits(&self) -> [u64; 3] {
        self.map(|c| u64::from(c.cast_unsigned()))
    }
}

/// Positions without repetition, numbered as they come.
struct DistinctPositions<P> {
    positions: Vec<P>,
    numbers: HashTable<u32>,
}

impl<P: PositionBits> DistinctPositions<P> {
    fn new() -> DistinctPositions<P> {
        DistinctPositions { positions: Vec::new(), numbers: HashTable::new() }
    }

    /// The number of `position`.
    fn number(&mut self, position: P) -> u32 {
        let DistinctPositions { positions, numbers } = self;
        let bits = position.bits();
        let is_same = |&number: &u32| positions[number as usize].bits() == bits;
        let hash = |&number: &u32| hash_bits(positions[number as usize].bits());
        match numbers.entry(hash_bits(bits), is_same, hash) {
            Entry::Occupied(entry) => *entry.get(),
            Entry::Vacant(entry) => {
                // Fits: there are less than 2^32 corners.
                let number = positions.len() as u32;
                entry.insert(number);
                positions.push(position);
                number
            }
        }
    }
}

/// The triangles of a run by the numbers of its own distinct corners.
struct Run<P> {
    positions: Vec<P>,
    triangles: Vec<[u32; 3]>,
}

impl<P: PositionBits> Run<P> {
    fn of(source: &dyn Facets, range: Range<u64>, position: impl Fn([f64; 3]) -> P) -> Run<P> {
        let mut facets: Vec<Facet> = Vec::new();
        source.read(range, &mut facets);
        let mut distinct = DistinctPositions::new();
        let mut number = |corner: [f64; 3]| distinct.number(position(corner));
        let triangles = facets.into_iter().map(|facet| facet.map(&mut number)).collect();
        Run { positions: distinct.positions, triangles }
    }
}

/// Positions, and triangles that name their corners by number.
pub struct IndexedMesh<P> {
    /// Distinct positions.
    pub positions: Vec<P>,
    /// Three numbers of positions each.
    pub triangles: Vec<[u32; 3]>,
}

/// The triangles of `source` with vertices numbered as they first appear. Corners are the same if all three
/// coordinates are the same numbers; −0 is 0, and a NaN the same as one with the same bits.
pub(super) fn weld(source: &dyn Facets, progress: &dyn Progress) -> Result<Mesh<'static>> {
    // Adding zero makes +0 of −0 and changes nothing else.
    let position = |corner: [f64; 3]| corner.map(|c| c + 0.0);
    let IndexedMesh { mut positions, triangles } = weld_by(&[source], position, |_, _| Ok(()), progress)?;
    positions.shrink_to_fit();
    Ok(Mesh { positions: positions.into(), triangles: triangles.into(), non_finite: Tally::NONE })
}

/// The triangles of all sources, in their order, with vertices numbered as they first appear: corners with the same
/// `position` are one. There must be less than 2^32 corners. `fits` is told now and then how many vertices there are of
/// how many triangles, and may refuse more.
///
/// Corners are made distinct run by run on all threads first, which leaves a sixth of them where neighbours stand near
/// each other in the file; what is left goes through one table, in order, while the next runs are under way.
pub fn weld_by<P: PositionBits>(
    sources: &[&dyn Facets],
    position: impl Fn([f64; 3]) -> P + Sync,
    fits: impl Fn(usize, usize) -> Result<()>,
    progress: &dyn Progress,
) -> Result<IndexedMesh<P>> {
    let triangle_count: u64 = sources.iter().map(|source| source.facets()).sum();
    progress.phase("welding", Some(triangle_count), "triangles");
    let runs = runs(sources);
    let read = |runs: &[(usize, Range<u64>)]| -> Vec<Run<P>> {
        let of_run =
            |(source, range): &(usize, Range<u64>)| Run::of(sources[*source], range.clone(), &position);
        runs.par_iter().map(of_run).collect()
    };
    let mut all = DistinctPositions::new();
    let mut triangles: Vec<[u32; 3]> = Vec::with_capacity(triangle_count as usize);
    let mut waves = runs.chunks(WAVE_RUNS);
    let mut present = waves.next().map_or_else(Vec::new, read);
    while !present.is_empty() {
        progress.check()?;
        let next = waves.next().unwrap_or(&[]);
        let append = || {
            for run in present {
                let numbers: Vec<u32> = run.positions.iter().map(|&p| all.number(p)).collect();
                triangles.extend(run.triangles.iter().map(|t| t.map(|v| numbers[v as usize])));
                progress.advance(run.triangles.len() as u64);
            }
        };
        (_, present) = rayon::join(append, || read(next));
        fits(all.positions.len(), triangles.len())?;
    }
    Ok(IndexedMesh { positions: all.positions, triangles })
}
