//! Reads every record of a store and checks what records say of each other.

use super::identity::IdentityEntry;
use super::layout::IndexEntry;
use super::prefetch::Walk;
use super::reader::Store;
use crate::brick::{Brick, SignChanges};
use crate::error::{Error, Result};
use crate::lattice::{BRICK_CELLS, BRICK_POINTS, NodeKey};
use crate::progress::Progress;
use rayon::prelude::*;

/// Nodes that a thread takes at once: whole families and some of their neighbours, so that most of the bricks
/// it compares with are its own.
const NODES_AT_ONCE: usize = 64;

/// What [`Store::verify`] found.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct VerifyReport {
    /// Records read, uniform bricks included.
    pub records: u64,
    /// Payload bytes read.
    pub payload_bytes: u64,
    /// Records that are damaged or contradict others.
    pub damaged: u64,
    /// Places beside the records where bytes stand that should not, which no answer depends on.
    pub strays: u64,
    /// The damaged record with the lowest key, or else the first stray byte.
    pub first_damage: Option<Damage>,
}

/// A damaged record.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Damage {
    /// Its node; `None` of what is no record.
    pub key: Option<NodeKey>,
    /// Where it begins in the file; 0 for a uniform brick, which lies in the index.
    pub offset: u64,
    /// What is wrong, one phrase.
    pub what: String,
}

impl VerifyReport {
    /// An error that names the first damaged record, if there is one.
    pub fn into_result(self, store: &Store) -> Result<VerifyReport> {
        match &self.first_damage {
            None => Ok(self),
            Some(Damage { key, offset, what }) => Err(Error::store(
                store.path(),
                key.map_or(format!("byte {offset}"), |key| format!("record {key} at byte {offset}")),
                format!("{what} ({} of {} records are damaged)", self.damaged, self.records),
                "restore the file from a copy or build it again",
            )),
        }
    }

    fn and(self, other: VerifyReport) -> VerifyReport {
        let first = [self.first_damage, other.first_damage].into_iter().flatten();
        VerifyReport {
            records: self.records + other.records,
            payload_bytes: self.payload_bytes + other.payload_bytes,
            damaged: self.damaged + other.damaged,
            strays: self.strays + other.strays,
            first_damage: first.min_by_key(|damage| (damage.key.is_none(), damage.key)),
        }
    }
}

impl Store {
    /// Reads every record from the file, in parallel, and checks its checksum and content. The index must have the
    /// range of its samples, and a leaf a Hermite edge wherever its samples change sign.
    ///
    /// Samples must be those of the parent where they coincide, and aprons those of the neighbours. Nothing may stand
    /// beside the slots, nor behind the commit. Damage is reported, not returned as an error.
    ///
    /// # Errors
    /// [`Error::Interrupted`] if `progress` asks for it; [`Error::Store`] where a store elsewhere does not come.
    pub fn verify(&self, progress: &dyn Progress) -> Result<VerifyReport> {
        let entries = self.entries();
        progress.phase("verify", Some(entries.len() as u64), "records");
        let identity = self.verify_identity(progress)?;
        let walk = Walk::new(self, entries.len(), |number| Some(entries[number].key));
        // Handed out in order, so that all threads together go through the levels from one end to the other.
        let bricks = entries
            .chunks(NODES_AT_ONCE)
            .enumerate()
            .par_bridge()
            .map(|(number, chunk)| {
                progress.check()?;
                walk.at(number * NODES_AT_ONCE);
                let report = chunk.iter().map(|e| self.verify_record(e)).reduce(VerifyReport::and);
                progress.advance(chunk.len() as u64);
                Ok(report.unwrap_or_default())
            })
            .try_reduce(VerifyReport::default, |a, b| Ok(a.and(b)))?;
        let report = bricks.and(identity).and(self.verify_strays());
        // What did not come is no damage.
        self.fault()?;
        Ok(report)
    }

    /// What stands in the file beside commit and records.
    fn verify_strays(&self) -> VerifyReport {
        let strays = self.strays().unwrap_or_else(|what| vec![(0, what)]);
        let first = strays.first().cloned();
        VerifyReport {
            strays: strays.len() as u64,
            first_damage: first.map(|(offset, what)| Damage { key: None, offset, what }),
            ..VerifyReport::default()
        }
    }

    /// The lists of beads: checksums, and that they name beads of the tables; those themselves.
    fn verify_identity(&self, progress: &dyn Progress) -> Result<VerifyReport> {
        let tables = match self.bead_tables() {
            Ok(Some(tables)) => Some(tables),
            // Those of an unfinished store are still to come.
            Ok(None) => None,
            Err(error) => {
                let damage = Damage { key: Some(NodeKey::ROOT), offset: 0, what: error.to_string() };
                return Ok(VerifyReport {
                    damaged: 1,
                    first_damage: Some(damage),
                    ..VerifyReport::default()
                });
            }
        };
        let one = |entry: &IdentityEntry| {
            let damage = match &tables {
                Some(tables) => self.load_segments(entry, tables).err(),
                None => self.read_identity(entry).err().map(|error| error.to_string()),
            };
            VerifyReport {
                records: 1,
                payload_bytes: u64::from(entry.length),
                damaged: u64::from(damage.is_some()),
                strays: 0,
                first_damage: damage.map(|what| Damage { key: Some(entry.key), offset: entry.offset, what }),
            }
        };
        let chunks = self.identity_entries().par_chunks(NODES_AT_ONCE);
        chunks
            .map(|chunk| {
                progress.check()?;
                Ok(chunk.iter().map(one).reduce(VerifyReport::and).unwrap_or_default())
            })
            .try_reduce(VerifyReport::default, |a, b| Ok(a.and(b)))
    }

    fn verify_record(&self, entry: &IndexEntry) -> VerifyReport {
        let damage = self.check_record(entry).err();
        VerifyReport {
            records: 1,
            payload_bytes: u64::from(entry.length),
            damaged: u64::from(damage.is_some()),
            strays: 0,
            first_damage: damage.map(|what| Damage { key: Some(entry.key), offset: entry.offset, what }),
        }
    }

    fn check_record(&self, entry: &IndexEntry) -> std::result::Result<(), String> {
        let brick = self.load_into_cache(entry)?;
        if brick.range() != (entry.head.min, entry.head.max) {
            return Err("its samples have another range than the index says".to_owned());
        }
        if let Brick::Counts { samples, hermite } = &*brick {
            let changes = SignChanges::of(samples).counts().iter().sum::<usize>();
            if entry.leaf && hermite.len() != changes {
                return Err("it has no Hermite edges though its samples change sign".to_owned());
            }
        }
        // A brick that cannot be read is reported as itself; there is nothing to compare with then.
        let other = |key: NodeKey| self.index().get(key).and_then(|entry| self.cached(entry).ok());
        if let Some(parent) = entry.key.parent()
            && other(parent).is_some_and(|parent| !nests_in(&brick, entry.key, &parent))
        {
            return Err(format!("its samples are not those of its parent {parent}"));
        }
        for delta in upper_neighbours() {
            if let Some(key) = entry.key.neighbour(delta.map(|d| d as i32))
                && other(key).is_some_and(|neighbour| !apron_repeats(&brick, delta, &neighbour))
            {
                return Err(format!("its apron does not repeat the samples of {key}"));
            }
        }
        Ok(())
    }
}

/// The seven upper neighbours of a brick that share samples with it.
fn upper_neighbours() -> impl Iterator<Item = [usize; 3]> {
    (1..8).map(|d| [d & 1, d >> 1 & 1, d >> 2])
}

/// True if the brick's even samples are the samples of its parent's octant.
fn nests_in(brick: &Brick, key: NodeKey, parent: &Brick) -> bool {
    let half = BRICK_CELLS / 2;
    let first = key.octant().offset().map(|o| o * half);
    both_uniform_and_equal(brick, parent)
        || points([0; 3], [half; 3]).all(|ijk| {
            let at_parent = [0, 1, 2].map(|a| first[a] + ijk[a]);
            brick.value(ijk.map(|i| 2 * i)) == parent.value(at_parent)
        })
}

/// True if the brick's last samples along the axes of `delta` are the neighbour's first.
fn apron_repeats(brick: &Brick, delta: [usize; 3], neighbour: &Brick) -> bool {
    let last = delta.map(|d| if d == 1 { 0 } else { BRICK_POINTS - 1 });
    both_uniform_and_equal(brick, neighbour)
        || points([0; 3], last).all(|ijk| {
            let here = [0, 1, 2].map(|a| ijk[a] + delta[a] * BRICK_CELLS);
            brick.value(here) == neighbour.value(ijk)
        })
}

fn both_uniform_and_equal(a: &Brick, b: &Brick) -> bool {
    matches!((a, b), (Brick::Uniform(a), Brick::Uniform(b)) if a == b)
}

/// All points of the box, both corners included, x fastest.
fn points(first: [usize; 3], last: [usize; 3]) -> impl Iterator<Item = [usize; 3]> {
    let [x, y, z] = [0, 1, 2].map(|a| first[a]..=last[a]);
    z.flat_map(move |k| {
        let x = x.clone();
        y.clone().flat_map(move |j| x.clone().map(move |i| [i, j, k]))
    })
}
