//! A chain as a store: subtrees on all threads, written along the Morton curve.

use super::combine::HiddenCrossings;
use super::operand::{Operand, OperandInNode};
use super::walk::{Chain, NodeAction, WalkScratch};
use crate::brick::Brick;
use crate::error::{Error, Result};
use crate::lattice::{MAX_LEVEL, NodeKey, Octant};
use crate::progress::Progress;
use crate::schedule::{MemoryReservation, RunLimits, TaskOrder, TaskOutcome, run_tasks};
use crate::store::{
    CoarseSamples, Compression, JoinedNode, Meta, Records, ResumeState, SettingPairs, Stats, Store,
    StoreWriter, join,
};
use std::path::Path;
use std::time::Duration;

/// Most nodes of all stores together below the node of a task.
const TASK_NODES: usize = 1024;
/// Levels of solids that a task has below it at most.
const TASK_LEVELS: u8 = 3;
/// Encoded bytes a node, twice what those of a part of 50 million facets take.
const NODE_BYTES: u64 = 48 << 10;
/// Bricks in work of a task, by operand.
const WORK_BYTES: u64 = 1 << 20;

/// How a result is written.
pub struct Writing {
    /// Memory for tasks and records.
    pub memory: u64,
    /// Time between two commits.
    pub pace: Duration,
    /// Give up what an earlier run has left.
    pub restart: bool,
    /// What decides the store beside its metadata, by name.
    pub settings: SettingPairs,
}

/// What was written.
#[derive(Clone, Debug, PartialEq, Eq, serde::Serialize)]
pub struct CsgSummary {
    /// Nodes of the tree.
    pub nodes: u64,
    /// Leaves among them.
    pub leaves: u64,
    /// Size of the file.
    pub file_bytes: u64,
    /// Walls and gaps that lie within one edge between two samples, so that no sample shows them; where an earlier run was
    /// gone on with, those found since.
    pub hidden: HiddenCrossings,
    /// Nodes of an earlier run that was gone on with.
    pub resumed: u64,
}

/// A subtree to make.
struct Task {
    key: NodeKey,
    /// What is known of the operands within it.
    within: Vec<OperandInNode>,
    /// What it is, if that is known without bricks.
    known: Option<i16>,
    bytes: u64,
}

/// Joins subtrees that come along the Morton curve to the nodes above them.
struct Joiner {
    /// By level, the siblings that wait for the rest of them.
    pending: Vec<Vec<JoinedNode>>,
    /// Records of nodes above the level at which subtrees begin; they stand at the end of a store.
    top: Records,
    level: u8,
}

impl Joiner {
    fn push(&mut self, key: NodeKey, node: JoinedNode, mut records: Records) -> Records {
        if key.level() < self.level {
            let own = records.take();
            self.top.append(own);
        }
        let (mut key, mut node) = (key, node);
        loop {
            let siblings = &mut self.pending[usize::from(key.level())];
            siblings.push(node);
            let (Some(parent), 8) = (key.parent(), siblings.len()) else { return records };
            let children = std::mem::take(siblings);
            let children: [JoinedNode; 8] = children.try_into().expect("there are eight");
            let to = if parent.level() < self.level { &mut self.top } else { &mut records };
            node = join(parent, children, to);
            key = parent;
        }
    }

    /// The records that stand at the end.
    fn finish(mut self) -> Records {
        if let Some(JoinedNode::Empty(w)) = self.pending[0].first() {
            self.top.push(NodeKey::ROOT, true, &Brick::Uniform(*w));
        }
        self.top
    }
}

impl Chain<'_> {
    /// Writes the result to `output`. `meta` says where it comes from and how it was made.
    ///
    /// # Errors
    /// What reading the operands gives; [`Error::Setting`] where boundaries of leaves of different levels meet; an output that
    /// cannot be written, under whose name nothing is left then; [`Error::Interrupted`].
    pub fn write(
        &self,
        output: &Path,
        meta: Meta,
        writing: Writing,
        progress: &dyn Progress,
    ) -> Result<CsgSummary> {
        let Writing { memory, pace, restart, settings } = writing;
        let tasks = self.tasks(meta.subtree_level())?;
        let mut writer = StoreWriter::resume(output, &meta, settings, restart, pace)?;
        let kept = writer.kept();
        let resumed = kept.as_ref().map_or(0, |kept| kept.nodes());
        let made = self.make(tasks, kept.as_deref(), (memory, meta.subtree_level()), &mut writer, progress);
        let hidden = match made {
            Ok(hidden) => hidden,
            Err(error @ (Error::Interrupted | Error::Io { .. })) => return Err(kept_by(&mut writer, error)),
            Err(error) => {
                writer.give_up();
                return Err(error);
            }
        };
        progress.phase("finishing", None, "bytes");
        let Stats { nodes, leaves, file_bytes, .. } = writer.finish(meta)?;
        Ok(CsgSummary { nodes, leaves, file_bytes, hidden, resumed })
    }

    fn make(
        &self,
        tasks: Vec<Task>,
        kept: Option<&ResumeState>,
        (memory, level): (u64, u8),
        writer: &mut StoreWriter,
        progress: &dyn Progress,
    ) -> Result<HiddenCrossings> {
        progress.phase("combining", Some(tasks.len() as u64), "subtrees");
        let pending = (0..=MAX_LEVEL).map(|_| Vec::new()).collect();
        let records = || Records::new(Some(Compression::Lz4));
        let mut joiner = Joiner { pending, top: records(), level };
        let mut hidden = HiddenCrossings::default();
        let work = |desk: &mut WalkScratch, task: Task, mut held: MemoryReservation| {
            progress.check()?;
            let kept = kept.map_or(Ok(None), |kept| kept.brick(task.key))?;
            let (node, records) = match (task.known, kept) {
                (Some(w), _) => (JoinedNode::Empty(w), records()),
                (None, Some(brick)) => (JoinedNode::Stored(CoarseSamples::of(&brick)), records()),
                (None, None) => {
                    let mut records = records();
                    (self.walk(task.key, &task.within, desk, &mut records)?, records)
                }
            };
            held.resize(records.heap_bytes());
            Ok(TaskOutcome::Done((task.key, node, records, std::mem::take(&mut desk.hidden)), held))
        };
        let consume = |(key, node, records, found): (NodeKey, JoinedNode, Records, HiddenCrossings)| {
            hidden.add(found);
            let records = joiner.push(key, node, records);
            let bytes = records.write(writer)?;
            writer.commit_if_due()?;
            progress.advance(1);
            Ok(Some(bytes))
        };
        run(tasks, memory, work, consume)?;
        joiner.finish().write(writer)?;
        Ok(hidden)
    }

    /// Subtrees along the Morton curve that cover the root; those that are not known begin at `level` or below.
    fn tasks(&self, level: u8) -> Result<Vec<Task>> {
        let mut tasks = Vec::new();
        self.add_tasks(NodeKey::ROOT, &self.beginning(), level, &mut tasks)?;
        Ok(tasks)
    }

    fn add_tasks(
        &self,
        key: NodeKey,
        above: &[OperandInNode],
        level: u8,
        tasks: &mut Vec<Task>,
    ) -> Result<()> {
        let (within, step) = self.look(key, above)?;
        let known = match step {
            NodeAction::All { w, certain: true } => Some(w),
            _ => None,
        };
        let nodes = self.nodes_below(key, &within);
        let is_small = key.level() >= level && nodes <= TASK_NODES;
        if matches!(step, NodeAction::Divide(_)) && !is_small {
            for octant in Octant::all() {
                self.add_tasks(key.child(octant), &within, level, tasks)?;
            }
            return Ok(());
        }
        let bytes = if known.is_some() { 0 } else { nodes as u64 * NODE_BYTES / 8 + WORK_BYTES };
        tasks.push(Task { key, within: if known.is_some() { Vec::new() } else { within }, known, bytes });
        Ok(())
    }

    /// Nodes that are looked at below one, about.
    fn nodes_below(&self, key: NodeKey, within: &[OperandInNode]) -> usize {
        let levels = self.depth.saturating_sub(key.level());
        let of = |((_, operand), within): (&(_, Operand<'_>), &OperandInNode)| match (operand, within) {
            (Operand::Store(store), OperandInNode::Divided) => descendants(store, key),
            (Operand::Solids(_), OperandInNode::Solids(_)) if levels > TASK_LEVELS => TASK_NODES + 1,
            (Operand::Solids(_), OperandInNode::Solids(_)) => 1 << (3 * levels),
            _ => 1,
        };
        self.operands.iter().zip(within).map(of).max().unwrap_or(0)
    }
}

/// Nodes of a store below one.
fn descendants(store: &Store, key: NodeKey) -> usize {
    let before = |code: u64| store.entries().partition_point(|entry| entry.key.code() < code);
    let of_level = |level: u8| {
        let down = 3 * u32::from(level - key.level());
        before((key.code() + 1) << down) - before(key.code() << down)
    };
    (key.level() + 1..=store.meta().depth).map(of_level).sum()
}

fn run<T: Send>(
    tasks: Vec<Task>,
    memory: u64,
    work: impl Fn(&mut WalkScratch, Task, MemoryReservation) -> Result<TaskOutcome<Task, T>> + Sync,
    consume: impl FnMut(T) -> Result<Option<u64>> + Send,
) -> Result<()> {
    let bounds = RunLimits { memory, reserve: memory / 8, window: 8 * rayon::current_num_threads() };
    let place = |(n, task): (usize, Task)| -> (TaskOrder, Task) { ((n as u64, 0), task) };
    let tasks = tasks.into_iter().enumerate().map(place).collect();
    run_tasks(tasks, bounds, WalkScratch::default, |task: &Task| task.bytes, work, consume)
}

/// What there is so far is kept.
fn kept_by(writer: &mut StoreWriter, error: Error) -> Error {
    let committed = writer.commit();
    match (error, writer.unfinished()) {
        (Error::Interrupted, Some((part, nodes))) if committed.is_ok() => Error::Suspended { part, nodes },
        (error, _) => error,
    }
}
