//! Trees that are made from the top: a node is one value, or divided, down to bricks of the deepest level.

use super::{CoarseSamples, Compression, JoinedNode, Records, StoreWriter, joined, subtree_level};
use crate::brick::Brick;
use crate::error::Result;
use crate::lattice::{NodeKey, Octant};
use crate::progress::Progress;
use crate::schedule::{MemoryReservation, RunLimits, TaskOutcome, run_tasks};
use std::collections::BTreeMap;
use std::sync::atomic::{AtomicU64, Ordering};

/// A field that tells where it is one value, and its bricks where it is not.
pub trait Divided: Sync {
    /// The level of the bricks.
    fn depth(&self) -> u8;

    /// What all samples of a node are, if that is one value for sure.
    ///
    /// # Errors
    /// What reading the field gives.
    fn decided(&self, key: NodeKey) -> Result<Option<i16>>;

    /// The brick of a node of the deepest level that is not decided.
    ///
    /// # Errors
    /// What reading the field gives.
    fn brick(&self, key: NodeKey) -> Result<Brick>;
}

/// Writes all nodes of a field, subtree by subtree on all threads, and returns its root. The root is never a leaf, unless it is
/// the deepest level. Subtrees that are made, or wait for those before them, take no more than so many bytes of memory, and one
/// at least. `phase` is what progress is called.
///
/// # Errors
/// What the field and the writer give; [`crate::error::Error::Interrupted`].
pub fn write_divided(
    field: &dyn Divided,
    writer: &mut StoreWriter,
    memory: u64,
    (phase, progress): (&'static str, &dyn Progress),
) -> Result<CoarseSamples> {
    let level = subtree_level(field.depth());
    let (mut jobs, mut above) = (Vec::new(), Vec::new());
    divide(field, NodeKey::ROOT, level, &mut jobs, &mut above)?;
    progress.phase(phase, Some(jobs.len() as u64), "subtrees");
    let mut tops: BTreeMap<NodeKey, CoarseSamples> = BTreeMap::new();
    let bounds = RunLimits { memory, reserve: 0, window: 4 * rayon::current_num_threads() };
    // What a subtree will take is not known before: as much as the largest so far.
    let largest = AtomicU64::new(0);
    let work = |(): &mut (), key: NodeKey, mut held: MemoryReservation| {
        let mut records = Records::new(Some(Compression::Lz4));
        let top = subtree(field, key, &mut records, progress)?;
        held.resize(records.heap_bytes());
        largest.fetch_max(records.heap_bytes(), Ordering::Relaxed);
        Ok(TaskOutcome::Done((key, top, records), held))
    };
    let tasks = jobs.into_iter().enumerate().map(|(n, key)| ((n as u64, 0), key)).collect();
    let need = |_: &NodeKey| largest.load(Ordering::Relaxed);
    run_tasks(
        tasks,
        bounds,
        || (),
        need,
        work,
        |(key, top, made): (NodeKey, CoarseSamples, Records)| {
            progress.advance(1);
            made.write(writer)?;
            tops.insert(key, top);
            Ok(None)
        },
    )?;
    // Children stand before their parents.
    above.sort_unstable_by_key(|(key, _): &(NodeKey, Option<i16>)| key.post_order());
    for (key, value) in above {
        let brick = match value {
            Some(value) => Brick::Uniform(value),
            None => {
                let mut children = [const { JoinedNode::Empty(0) }; 8];
                for octant in Octant::all() {
                    let child = tops.remove(&key.child(octant));
                    children[octant.index()] =
                        JoinedNode::Stored(child.expect("children stand before their parents"));
                }
                joined(&children)
            }
        };
        writer.append_brick(key, value.is_some(), &brick)?;
        tops.insert(key, CoarseSamples::of(&brick));
    }
    Ok(tops.remove(&NodeKey::ROOT).unwrap_or(CoarseSamples::Uniform(0)))
}

/// Finds nodes of a level that have to be made, and all above with what is decided of them.
fn divide(
    field: &dyn Divided,
    key: NodeKey,
    level: u8,
    jobs: &mut Vec<NodeKey>,
    above: &mut Vec<(NodeKey, Option<i16>)>,
) -> Result<()> {
    if key.level() == level {
        jobs.push(key);
        return Ok(());
    }
    let value = if key == NodeKey::ROOT { None } else { field.decided(key)? };
    above.push((key, value));
    if value.is_none() {
        Octant::all().try_for_each(|octant| divide(field, key.child(octant), level, jobs, above))?;
    }
    Ok(())
}

fn subtree(
    field: &dyn Divided,
    key: NodeKey,
    records: &mut Records,
    progress: &dyn Progress,
) -> Result<CoarseSamples> {
    progress.check()?;
    let (leaf, brick) = match field.decided(key)? {
        Some(value) => (true, Brick::Uniform(value)),
        None if key.level() == field.depth() => (true, field.brick(key)?),
        None => {
            let mut children = [const { JoinedNode::Empty(0) }; 8];
            for octant in Octant::all() {
                children[octant.index()] =
                    JoinedNode::Stored(subtree(field, key.child(octant), records, progress)?);
            }
            (false, joined(&children))
        }
    };
    records.push(key, leaf, &brick);
    Ok(CoarseSamples::of(&brick))
}
