//! What of a tree is to be built, and the levels at which pieces are sorted and jobs start.

use super::bins::Binner;
use super::rules::Rules;
use crate::brick::ThinFeatures;
use crate::error::Result;
use crate::lattice::NodeKey;
use crate::store::{CoarseSamples, JoinedNode, Records, ResumeState, Shard, subtree_level};
use std::sync::Mutex;

/// The level at which jobs start, and whose cubes are shared out to machines. The order of the records in a store is
/// by subtrees of that level, so it depends on nothing but the depth. Two levels below, a job has 64 leaves: 10 to 20 ms, enough to
/// feed many threads and not so much that the last job is waited for; at greater depths the count of sorting cells
/// (4,096) bounds it.
pub(super) fn job_level(rules: &Rules) -> u8 {
    subtree_level(rules.depth)
}

/// The level by which the pass over the input sorts: the jobs' where the tree follows the pieces, else
/// the root, because nodes above the jobs decide for themselves.
pub(super) fn sort_level(rules: &Rules) -> u8 {
    if rules.refines_all_touched() { job_level(rules) } else { 0 }
}

/// The cubes of that level.
pub(super) fn sort_cubes(rules: &Rules) -> Binner {
    Binner::new(NodeKey::ROOT, sort_level(rules))
}

/// What of a tree is to be built.
#[derive(Clone, Copy)]
pub(super) struct BuildPlan<'a> {
    pub rules: &'a Rules,
    /// If it is not the whole tree.
    pub shard: Option<&'a Shard>,
    /// What an earlier run has left of it.
    pub kept: Option<&'a ResumeState>,
    /// What hides between the samples of the leaves that are built.
    pub thin: &'a Mutex<ThinFeatures>,
}

impl BuildPlan<'_> {
    /// Adds what hides in a leaf.
    pub fn add_thin(&self, thin: &ThinFeatures) {
        if !thin.is_empty() {
            self.thin.lock().expect("no thread panicked").add(thin);
        }
    }

    /// The node of a subtree that an earlier run has built, if it has: its records are in the store.
    pub fn built(&self, key: NodeKey) -> Result<Option<JoinedNode>> {
        let brick = self.kept.map_or(Ok(None), |kept| kept.brick(key))?;
        Ok(brick.map(|brick| JoinedNode::Stored(CoarseSamples::of(&brick))))
    }
}

/// What gets the records of one job after the other; returns how many bytes it keeps for good, as an index.
pub(super) type RecordSink<'a> = dyn FnMut(Records) -> Result<u64> + Send + 'a;
