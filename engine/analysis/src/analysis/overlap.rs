//! Overlaps of beads, pair by pair, from a store that tells them apart.
//!
//! The record of a leaf lists the segments that touch it, so their solids give again the samples and the chords of every
//! pass there, by the rule that the store was built by. Samples of pairs add up to Σ w(w − 1)/2 exactly, which is checked
//! against the store's own samples; chords along lines beside them are nearer to the volume.

use super::overlap_leaf::of_leaf;
use super::overlap_lines::{LINES, PART_BITS};
use super::overlap_pairs::PairSums;
use super::solids_of;
use super::volume::spread;
use crate::error::Result;
use crate::lattice::{MAX_LEVEL, NodeKey, RootCube};
use crate::progress::Progress;
use crate::store::{BeadTables, BrickTree, Leaf, LeafOrder, Store, visit};
use std::collections::BTreeMap;

/// Parts of a unit.
const PARTS: f64 = (1u32 << PART_BITS) as f64;
/// Pairs without a sample of their own that have less than this share of a cell are what touching faces round to.
const TOUCHING: f64 = 1e-3;

/// Two passes, or beads where the store counts those, that overlap.
#[derive(Clone, Debug, PartialEq)]
pub struct PairOverlap {
    /// Their numbers in the store's tables, the lower one first: see [`crate::store::BeadTables::bead_of`].
    pub numbers: [u32; 2],
    /// Mean over chords along the three axes, in the cube of the store's unit.
    pub volume: f64,
    /// The spread of these, and half the root of the number of cells.
    pub volume_error: f64,
    /// By the chords along each axis.
    pub by_axis: [f64; 3],
    /// Volume of the cells of the samples that both cover.
    pub sampled: f64,
    /// Centroid of the chords, in the world.
    pub centroid: [f64; 3],
    /// First and last line of the segments of each that the other meets; 0 where the store counts beads.
    pub lines: [(u64, u64); 2],
}

/// All pairs that overlap, and the sums that they must add up to.
#[derive(Clone, Debug)]
pub struct Overlaps {
    /// By numbers.
    pub pairs: Vec<PairOverlap>,
    /// Samples of all pairs, in cells of the deepest level there can be.
    pub pair_samples: u128,
    /// Σ w(w − 1)/2 over the store's samples, likewise.
    pub field_samples: u128,
    /// Samples at which the passes there are not as many as w says, likewise.
    pub unexplained: u128,
}

impl Overlaps {
    /// Samples as a volume, in the cube of the tree's unit.
    pub fn volume_of(root: RootCube, samples: u128) -> f64 {
        samples as f64 * root.spacing(MAX_LEVEL).powi(3)
    }
}

/// The overlaps of a store's passes, or of its beads where it counts those; `tables` are the store's own.
///
/// # Errors
/// [`crate::error::Error::Store`] if the store is damaged; [`crate::error::Error::Interrupted`].
pub fn overlaps(store: &Store, tables: &BeadTables, progress: &dyn Progress) -> Result<Overlaps> {
    let solids = solids_of(store, tables)?;
    let order = LeafOrder::new(store)?;
    // Two beads may have a sliver in common that holds no sample.
    let overlaps = |key: &NodeKey| store.node(*key).is_some_and(|n| n.max >= 2 || n.min != n.max);
    let keys: Vec<NodeKey> = order.keys().iter().copied().filter(overlaps).collect();
    progress.phase("overlaps", Some(keys.len() as u64), "bricks");
    let mut pairs: BTreeMap<[u32; 2], PairSums> = BTreeMap::new();
    let (mut field_samples, mut unexplained) = (0u128, 0u128);
    let make = |leaf: &Leaf<'_>| {
        let segments = store.segments(leaf.key, tables)?;
        let follows = |pass: u32| tables.bead_of(pass).1.is_some_and(|number| number > 0);
        Ok(of_leaf(leaf, &solids, &segments, &follows))
    };
    visit(store, &keys, progress, make, |number, found| {
        let cells = 3 * u32::from(MAX_LEVEL - keys[number].level());
        field_samples += found.field_samples << cells;
        unexplained += found.unexplained << cells;
        for (numbers, sums) in found.pairs {
            pairs.entry(numbers).or_default().add(&sums);
        }
        Ok(())
    })?;
    let pair_samples =
        pairs.values().map(|sums| sums.samples).sum::<u128>() >> (3 * (19 - u32::from(MAX_LEVEL)));
    let root = store.root();
    let cell = root.spacing(store.meta().depth).powi(3);
    let is_real = |pair: &PairOverlap| pair.sampled > 0.0 || pair.volume > TOUCHING * cell;
    let pairs =
        pairs.into_iter().map(|(numbers, sums)| pair(numbers, &sums, root, cell)).filter(is_real).collect();
    Ok(Overlaps { pairs, pair_samples, field_samples, unexplained })
}

fn pair(numbers: [u32; 2], sums: &PairSums, root: RootCube, cell: f64) -> PairOverlap {
    let unit = root.unit().powi(3);
    let chords = sums.chords.map(|chords| chords as f64 / PARTS / LINES as f64 * unit);
    let volume = chords.iter().sum::<f64>() / 3.0;
    let sampled = sums.samples as f64 * unit;
    let total: i128 = sums.chords.iter().sum();
    let centroid = sums.moments.map(|m| m as f64 / (total.max(1)) as f64 / (2.0 * PARTS) + 1.0);
    PairOverlap {
        numbers,
        volume,
        // Of lines that are drawn, the spread of three means, and what so many cells may be off by.
        volume_error: spread(chords) + 0.5 * (volume * cell).sqrt(),
        by_axis: chords,
        sampled,
        centroid: root.to_world(centroid),
        lines: sums.lines,
    }
}

/// Pairs added up.
#[derive(Clone, Copy, Debug, Default)]
pub struct OverlapSum {
    /// How many pairs.
    pub pairs: usize,
    /// Their volumes, in the cube of the store's unit.
    pub volume: f64,
    /// Those of the samples.
    pub sampled: f64,
    /// Volumes times centroids.
    pub moment: [f64; 3],
    by_axis: [f64; 3],
    squares: f64,
}

impl OverlapSum {
    /// Adds a pair.
    pub fn add(&mut self, pair: &PairOverlap) {
        self.pairs += 1;
        self.volume += pair.volume;
        self.sampled += pair.sampled;
        self.squares += pair.volume_error * pair.volume_error;
        for a in 0..3 {
            self.moment[a] += pair.volume * pair.centroid[a];
            self.by_axis[a] += pair.by_axis[a];
        }
    }

    /// Bound on the error of the volume. Lines are drawn for each cell anew, so errors of pairs add up as their squares do;
    /// what they share would show as a spread of the sums along the axes.
    pub fn error(&self) -> f64 {
        self.squares.sqrt().max(spread(self.by_axis))
    }
}
