//! Vertices out of positions: corners with the same coordinates are one vertex.

use super::{Mesh, Tally};
use crate::error::Result;
use crate::ingest::{Facet, Facets, runs};
use crate::progress::Progress;
use hashbrown::HashTable;
use hashbrown::hash_table::Entry;
use rayon::prelude::*;
use std::ops::Range;

/// Runs of triangles whose corners are collected at a time, some million triangles: of a soup without common corners
/// 84 MiB.
const WAVE_RUNS: usize = 64;

/// Positions without repetition, numbered as they come.
#[derive(Default)]
struct Distinct {
    positions: Vec<[f64; 3]>,
    numbers: HashTable<u32>,
}

impl Distinct {
    /// The number of `position`, in which no coordinate is −0.
    fn number(&mut self, position: [f64; 3]) -> u32 {
        let Distinct { positions, numbers } = self;
        let is_same = |&number: &u32| bits(&positions[number as usize]) == bits(&position);
        match numbers.entry(hash(&position), is_same, |&number| hash(&positions[number as usize])) {
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

fn bits(position: &[f64; 3]) -> [u64; 3] {
    position.map(f64::to_bits)
}

fn hash(position: &[f64; 3]) -> u64 {
    hash_bits(bits(position))
}

/// A hash of three coordinates by their bits. Each is multiplied into all bits before the next is added: the low half of
/// an f64 that was an f32 is zero. Multiplier: 2^64 divided by the golden ratio.
pub(crate) fn hash_bits(bits: [u64; 3]) -> u64 {
    bits.into_iter().fold(0, |hash: u64, bits| {
        let mixed = u128::from(hash ^ bits ^ 0x5851_f42d_4c95_7f2d) * 0x9e37_79b9_7f4a_7c15;
        (mixed >> 64) as u64 ^ mixed as u64
    })
}

/// The triangles of a run by the numbers of its own distinct corners.
struct Run {
    positions: Vec<[f64; 3]>,
    triangles: Vec<[u32; 3]>,
}

impl Run {
    fn of(source: &dyn Facets, range: Range<u64>) -> Run {
        let mut facets: Vec<Facet> = Vec::new();
        source.read(range, &mut facets);
        let mut distinct = Distinct::default();
        // Adding zero makes +0 of −0 and changes nothing else.
        let number = |corner: [f64; 3]| distinct.number(corner.map(|c| c + 0.0));
        let mut number = number;
        let triangles = facets.into_iter().map(|facet| facet.map(&mut number)).collect();
        Run { positions: distinct.positions, triangles }
    }
}

/// The triangles of `source` with vertices numbered as they first appear. Corners are the same if all three
/// coordinates are the same numbers; −0 is 0, and a NaN the same as one with the same bits.
///
/// Corners are made distinct run by run on all threads first, which leaves a sixth of them where neighbours stand near
/// each other in the file; what is left goes through one table, in order, while the next runs are under way.
pub(super) fn weld(source: &dyn Facets, progress: &dyn Progress) -> Result<Mesh<'static>> {
    let triangle_count = source.facets();
    progress.phase("welding", Some(triangle_count), "triangles");
    let ranges: Vec<Range<u64>> = runs(&[source]).into_iter().map(|(_, range)| range).collect();
    let read = |ranges: &[Range<u64>]| -> Vec<Run> {
        ranges.par_iter().map(|range| Run::of(source, range.clone())).collect()
    };
    let mut all = Distinct::default();
    let mut triangles: Vec<[u32; 3]> = Vec::with_capacity(triangle_count as usize);
    let mut waves = ranges.chunks(WAVE_RUNS);
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
    }
    let mut positions = all.positions;
    positions.shrink_to_fit();
    Ok(Mesh { positions: positions.into(), triangles: triangles.into(), non_finite: Tally::NONE })
}
