//! Sums over pairs of passes.

use crate::lattice::{Axis, mix};
use std::collections::HashMap;
use std::hash::{BuildHasherDefault, Hasher};

/// Sums over what two passes have in common.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct PairSums {
    /// In cubic units.
    pub samples: u128,
    /// By axis, in square units times parts, of all lines.
    pub chords: [i128; 3],
    /// Twice the first moments of all of these, with another side in parts.
    pub moments: [i128; 3],
    /// First and last line of each one's segments.
    pub lines: [(u64, u64); 2],
}

impl Default for PairSums {
    fn default() -> PairSums {
        PairSums { samples: 0, chords: [0; 3], moments: [0; 3], lines: [(u64::MAX, 0); 2] }
    }
}

impl PairSums {
    pub fn add(&mut self, other: &PairSums) {
        self.samples += other.samples;
        for a in 0..3 {
            self.chords[a] += other.chords[a];
            self.moments[a] += other.moments[a];
        }
        for (own, other) in self.lines.iter_mut().zip(other.lines) {
            *own = (own.0.min(other.0), own.1.max(other.1));
        }
    }
}

/// Sums over what two passes have in common in one leaf, where all cells have one size.
#[derive(Debug)]
pub(super) struct LeafPair {
    /// How many.
    pub samples: u64,
    /// By axis, in parts.
    chords: [i64; 3],
    /// Twice the first moments, in parts squared.
    moments: [i128; 3],
    lines: [(u64, u64); 2],
}

impl LeafPair {
    /// Adds a chord from and to these places along an axis; `doubled` is twice its middle.
    #[inline]
    pub fn add_chord(&mut self, axis: Axis, length: i64, doubled: [i64; 3]) {
        self.chords[axis.index()] += length;
        for (moment, doubled) in self.moments.iter_mut().zip(doubled) {
            *moment += i128::from(length) * i128::from(doubled);
        }
    }

    /// Adds a line of the source that one of the two has there.
    #[inline]
    pub fn add_line(&mut self, side: usize, line: u64) {
        let lines = &mut self.lines[side];
        *lines = (lines.0.min(line), lines.1.max(line));
    }
}

/// The pairs of passes that a leaf has. Passes have their places in its list as numbers.
#[derive(Debug)]
pub(super) struct LeafPairs {
    numbers: Vec<u32>,
    places: HashMap<u64, u32, BuildHasherDefault<PairHasher>>,
    sums: Vec<([u32; 2], LeafPair)>,
}

impl LeafPairs {
    /// No pair of passes with these numbers.
    pub fn new(numbers: Vec<u32>) -> LeafPairs {
        LeafPairs { numbers, places: HashMap::default(), sums: Vec::new() }
    }

    /// The sums of two passes, the first one of which stands before the other.
    #[inline]
    pub fn of(&mut self, one: u32, other: u32) -> &mut LeafPair {
        let place = *self.places.entry(u64::from(one) << 32 | u64::from(other)).or_insert_with(|| {
            let numbers = [one, other].map(|pass| self.numbers[pass as usize]);
            let lines = [(u64::MAX, 0); 2];
            self.sums.push((numbers, LeafPair { samples: 0, chords: [0; 3], moments: [0; 3], lines }));
            self.sums.len() as u32 - 1
        });
        &mut self.sums[place as usize].1
    }

    /// The sums, of cells with sides of so many bits.
    pub fn sums(self, bits: u32) -> Vec<([u32; 2], PairSums)> {
        let whole = |pair: LeafPair| PairSums {
            samples: u128::from(pair.samples) << (3 * bits),
            chords: pair.chords.map(|parts| i128::from(parts) << (2 * bits)),
            moments: pair.moments.map(|moment| moment << (2 * bits)),
            lines: pair.lines,
        };
        self.sums.into_iter().map(|(numbers, pair)| (numbers, whole(pair))).collect()
    }
}

/// Hashes a pair of small numbers: asked for every chord, of pairs that no stranger chooses.
#[derive(Default)]
struct PairHasher(u64);

impl Hasher for PairHasher {
    fn finish(&self) -> u64 {
        self.0
    }

    fn write(&mut self, bytes: &[u8]) {
        bytes.iter().for_each(|&byte| self.write_u64(self.0 << 8 ^ u64::from(byte)));
    }

    #[inline]
    fn write_u64(&mut self, pair: u64) {
        self.0 = mix(pair);
    }
}
