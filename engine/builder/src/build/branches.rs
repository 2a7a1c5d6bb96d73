//! Trees that follow the pieces: the touched cubes of the sorted input are jobs, and one that is too large for its
//! share of memory, or too deep for its records to wait, becomes a branch of smaller ones.

use super::assemble::{Assembler, Opening};
use super::bins::Binner;
use super::corners::corner_at;
use super::field::PieceField;
use super::scope::{BuildPlan, RecordSink, sort_level};
use super::sorted::SortedPieces;
use super::subtree::{STRIDE, SubtreeBuilder, SubtreeRoot};
use crate::error::Result;
use crate::lattice::{MAX_LEVEL, NodeKey};
use crate::progress::Progress;
use crate::schedule::{MemoryReservation, RunLimits, TaskOrder, TaskOutcome, run_tasks};
use crate::store::{JoinedNode, Records};
use std::ops::Range;
use std::sync::Arc;

/// What a piece takes of a job: itself and its places in the lists of cubes, which it touches 1.5 of in the mean, with
/// room for them to grow.
const LIST_BYTES: u64 = 40;
/// What a piece adds to the crossings of a leaf that is a job of its own; for larger jobs a leaf's are nothing.
const CROSSING_BYTES: u64 = 64;
/// Encoded records a leaf: twice what those of a part of 50 million facets take, since the buffer doubles.
const LEAF_BYTES: u64 = 48 << 10;
/// Levels of a subtree that is built as a whole: 512 leaves, 10 MB of records in the mean.
const DEPTH_AT_ONCE: u8 = 3;
/// Levels left to the jobs of a branch that is made because it is deep: 64 leaves as at the usual depths.
const DEPTH_OF_JOBS: u8 = 2;

/// A node whose pieces are sorted by the cubes some levels below it.
struct Branch<F: PieceField> {
    key: NodeKey,
    stride: u8,
    sorted: SortedPieces<F>,
    corners: Arc<Vec<i64>>,
    /// Counts as long as a job needs the branch; nothing for the root's, which is taken off beforehand.
    _held: Option<MemoryReservation>,
}

/// A touched cube of a branch.
#[derive(Clone, Copy)]
struct Cube {
    cell: usize,
    pieces: u64,
}

/// Touched cubes of a branch that follow each other: one, or several that are small and built together.
struct Job<F: PieceField> {
    branch: Arc<Branch<F>>,
    cubes: Vec<Cube>,
}

/// A subtree that is built.
struct BuiltSubtree {
    cell: usize,
    node: JoinedNode,
    records: Records,
}

/// What the jobs yield, in the order of the records.
enum JobResult {
    Built(Vec<BuiltSubtree>),
    Opened(Opening),
}

impl<F: PieceField> Job<F> {
    /// Where the job's records stand: by its first descendant, nodes before those below them.
    fn place(&self) -> TaskOrder {
        let key = self.branch.key_of(self.cubes[0]);
        (key.code() << (3 * u32::from(MAX_LEVEL - key.level())), key.level())
    }
}

impl<F: PieceField> Branch<F> {
    /// Of sorted pieces, given the sample at the node's corner.
    fn new(
        field: &F,
        binner: Binner,
        corner: i64,
        sorted: SortedPieces<F>,
        held: Option<MemoryReservation>,
    ) -> Branch<F> {
        let corners = sorted.corners.clone().map_or(Vec::new(), |sums| field.finish_corners(sums, corner));
        Branch {
            key: binner.node(),
            stride: binner.stride(),
            sorted,
            corners: Arc::new(corners),
            _held: held,
        }
    }

    fn key_of(&self, cube: Cube) -> NodeKey {
        let code = self.key.code() << (3 * u32::from(self.stride)) | cube.cell as u64;
        NodeKey::from_code(code).expect("a descendant of a legal key")
    }

    fn corner_of(&self, cube: Cube) -> i16 {
        corner_at(&self.corners, self.stride, cube.cell)
    }

    /// The jobs of its cubes that pieces touch, or that are restless and among `cells`, and what their consumer has to know.
    /// `cell` as in [`Opening`].
    fn open(
        self,
        field: &F,
        cell: usize,
        cells: &Range<u64>,
        shares: Shares,
    ) -> (Opening, Vec<(TaskOrder, Job<F>)>) {
        let branch = Arc::new(self);
        let cube = |cell| Cube { cell, pieces: branch.sorted.count(cell) as u64 };
        let comes = |cube: &Cube| {
            cube.pieces > 0
                || field.may_be_restless()
                    && cells.contains(&(cube.cell as u64))
                    && field.is_restless(branch.key_of(*cube))
        };
        let cubes: Vec<Cube> =
            (0..1usize << (3 * u32::from(branch.stride))).map(cube).filter(comes).collect();
        let level = branch.key.level() + branch.stride;
        let coming = cubes.len();
        let job = |cubes| {
            let job = Job { branch: Arc::clone(&branch), cubes };
            (job.place(), job)
        };
        let jobs = shares.groups::<F>(level, cubes).into_iter().map(job).collect();
        let (key, stride, corners) = (branch.key, branch.stride, Arc::clone(&branch.corners));
        (Opening { key, stride, corners, coming, cell }, jobs)
    }
}

/// What jobs may take.
#[derive(Clone, Copy)]
struct Shares {
    depth: u8,
    /// Of one job.
    job: u64,
    /// Leaves that are worth having together: see [`PieceField::leaves_together`].
    together: u64,
    /// Cubes are built as a whole however many pieces they have, unless they are deep: of fields whose untouched nodes
    /// decide, which those that a branch reaches cannot.
    whole: bool,
}

impl Shares {
    /// Leaves that pieces may have in a cube.
    fn leaves(&self, level: u8, pieces: u64) -> u64 {
        let leaves = 1u64.checked_shl(3 * u32::from(self.depth - level)).unwrap_or(u64::MAX);
        // What no piece touches has few.
        leaves.min(pieces.max(1).saturating_mul(8))
    }

    /// What a cube takes if it is built as a whole.
    fn whole_bytes<F: PieceField>(&self, level: u8, pieces: u64) -> u64 {
        let records = self.leaves(level, pieces).saturating_mul(LEAF_BYTES);
        let crossings = if level == self.depth { CROSSING_BYTES } else { 0 };
        pieces.saturating_mul(size_of::<F::Piece>() as u64 + LIST_BYTES + crossings).saturating_add(records)
    }

    /// Cubes that follow each other, as jobs: together while these have few leaves and take no more than one may.
    fn groups<F: PieceField>(&self, level: u8, cubes: Vec<Cube>) -> Vec<Vec<Cube>> {
        let mut groups: Vec<Vec<Cube>> = Vec::new();
        let (mut leaves, mut bytes) = (0u64, 0u64);
        for cube in cubes {
            let own = (self.leaves(level, cube.pieces), self.whole_bytes::<F>(level, cube.pieces));
            leaves = leaves.saturating_add(own.0);
            bytes = bytes.saturating_add(own.1);
            let is_whole = self.branches::<F>(level, cube.pieces).is_none();
            match groups.last_mut() {
                Some(group) if is_whole && leaves <= self.together && bytes <= self.job => group.push(cube),
                _ => {
                    groups.push(vec![cube]);
                    // Nothing joins a cube that is opened.
                    (leaves, bytes) = if is_whole { own } else { (u64::MAX, u64::MAX) };
                }
            }
        }
        groups
    }

    /// Levels that a branch at a cube descends; `None` if the cube is built as a whole.
    fn branches<F: PieceField>(&self, level: u8, pieces: u64) -> Option<u8> {
        let below = self.depth - level;
        if pieces > 0 && below > DEPTH_AT_ONCE {
            return Some(STRIDE.min(below - DEPTH_OF_JOBS));
        }
        (below > 0 && !self.whole && pieces > 0 && self.whole_bytes::<F>(level, pieces) > self.job)
            .then_some(below.min(STRIDE))
    }

    /// Memory that a cube's pieces take, sorted again.
    fn sorted<F: PieceField>(&self, pieces: u64) -> u64 {
        pieces.saturating_mul(2 * size_of::<F::Piece>() as u64)
    }

    fn need<F: PieceField>(&self, job: &Job<F>) -> u64 {
        let level = job.branch.key.level() + job.branch.stride;
        let of_cube = |cube: &Cube| match self.branches::<F>(level, cube.pieces) {
            None => self.whole_bytes::<F>(level, cube.pieces),
            Some(_) => self.sorted::<F>(cube.pieces).min(self.job),
        };
        job.cubes.iter().map(of_cube).fold(0, u64::saturating_add)
    }
}

/// Builds the tree below the sorted pieces' cubes, or a shard of these; returns the records of the nodes above them,
/// and, of a shard, its empty cubes instead.
pub(super) fn follow_pieces<F: PieceField>(
    field: &F,
    sorted: SortedPieces<F>,
    plan: BuildPlan<'_>,
    memory: u64,
    progress: &dyn Progress,
    consume: &mut RecordSink<'_>,
) -> Result<(Records, Vec<(u64, i16)>)> {
    let BuildPlan { rules, shard, .. } = plan;
    let threads = rayon::current_num_threads() as u64;
    let memory = memory.saturating_sub(sorted.heap_bytes());
    // Of every two jobs a thread one runs and one waits for its turn; one more can always begin.
    let shares = Shares {
        depth: rules.depth,
        job: memory / (2 * threads + 1),
        together: field.leaves_together(),
        whole: field.may_be_restless(),
    };
    let bounds = RunLimits { memory, reserve: shares.job, window: 2 * threads as usize };
    let root = Branch::new(field, Binner::new(NodeKey::ROOT, sort_level(rules)), 0, sorted, None);
    let cells = shard.map_or(0..u64::MAX, |shard| shard.cells());
    let (opening, jobs) = root.open(field, 0, &cells, shares);
    progress.phase("building", Some(opening.coming as u64), "subtrees");
    let mut assembler = Assembler::new(shard.map(|shard| shard.cells()), rules.compression);
    let mut joined = Records::new(rules.compression);
    assembler.open(opening, &mut joined);
    let work = |(builder, pieces): &mut (SubtreeBuilder<F>, Vec<Vec<F::Piece>>),
                job: Job<F>,
                mut held: MemoryReservation| {
        progress.check()?;
        let first = job.cubes[0];
        let key = job.branch.key_of(first);
        if let Some(stride) = shares.branches::<F>(key.level(), first.pieces)
            && plan.built(key)?.is_none()
        {
            return branch(field, &job, first, stride, shares, held);
        }
        let built = build(builder, pieces, &job, plan)?;
        held.resize(built.iter().map(|built| built.records.heap_bytes()).sum());
        Ok(TaskOutcome::Done(JobResult::Built(built), held))
    };
    let local = || (SubtreeBuilder::<F>::new(field, plan, progress), Vec::new());
    run_tasks(
        jobs,
        bounds,
        local,
        |job| shares.need(job),
        work,
        |yielded| {
            let mut kept = None;
            let mut completed = 0;
            match yielded {
                JobResult::Opened(opening) => completed = assembler.open(opening, &mut joined),
                JobResult::Built(built) => {
                    for BuiltSubtree { cell, node, records } in built {
                        assembler.reach(cell, &mut joined);
                        flush(&mut joined, consume, &mut kept)?;
                        kept = Some(consume(records)?);
                        completed += assembler.add(node, &mut joined);
                    }
                }
            }
            flush(&mut joined, consume, &mut kept)?;
            progress.advance(completed);
            Ok(kept.map(|kept| kept + assembler.top.heap_bytes()))
        },
    )?;
    Ok(assembler.finish())
}

/// Builds the subtrees of a job that is not opened, but those that an earlier run has built.
fn build<F: PieceField>(
    builder: &mut SubtreeBuilder<F>,
    pieces: &mut Vec<Vec<F::Piece>>,
    job: &Job<F>,
    plan: BuildPlan<'_>,
) -> Result<Vec<BuiltSubtree>> {
    let branch = &*job.branch;
    pieces.resize_with(pieces.len().max(job.cubes.len()), Vec::new);
    let mut tops = Vec::with_capacity(job.cubes.len());
    let mut done = Vec::with_capacity(job.cubes.len());
    for (cube, pieces) in job.cubes.iter().zip(pieces) {
        let node = plan.built(branch.key_of(*cube))?;
        if node.is_none() {
            branch.sorted.gather(cube.cell, pieces)?;
            tops.push(SubtreeRoot { key: branch.key_of(*cube), corner: branch.corner_of(*cube), pieces });
        }
        done.push(node);
    }
    let mut built = builder.build_all(&tops)?.into_iter();
    let mut next = |(cube, node): (&Cube, Option<JoinedNode>)| {
        let (node, records) = match node {
            Some(node) => (node, Records::new(plan.rules.compression)),
            None => built.next().expect("each was built"),
        };
        BuiltSubtree { cell: cube.cell, node, records }
    };
    Ok(job.cubes.iter().zip(done).map(&mut next).collect())
}

/// Hands on the records of joined nodes.
fn flush(joined: &mut Records, consume: &mut RecordSink<'_>, kept: &mut Option<u64>) -> Result<()> {
    if !joined.is_empty() {
        *kept = Some(consume(joined.take())?);
    }
    Ok(())
}

/// Sorts a cube's pieces again, by smaller cubes: in memory if they fit there, else on disk.
fn branch<F: PieceField>(
    field: &F,
    job: &Job<F>,
    cube: Cube,
    stride: u8,
    shares: Shares,
    mut held: MemoryReservation,
) -> Result<TaskOutcome<Job<F>, JobResult>> {
    let binner = Binner::new(job.branch.key_of(cube), stride);
    let from = &job.branch.sorted;
    let sorted = match &from.elsewhere {
        Some(store) if shares.sorted::<F>(cube.pieces) > shares.job => {
            let mut sorted = store.split(cube.cell, &binner, shares.job / 2)?;
            from.push_own_of(cube.cell, field, &binner, &mut sorted);
            sorted
        }
        _ => {
            let mut sorted = SortedPieces::default();
            from.for_blocks(cube.cell, &mut |pieces| {
                sorted.push(field, &binner, pieces);
                Ok(())
            })?;
            sorted
        }
    };
    held.resize(sorted.heap_bytes());
    let branch = Branch::new(field, binner, i64::from(job.branch.corner_of(cube)), sorted, Some(held));
    let (opening, jobs) = branch.open(field, cube.cell, &(0..u64::MAX), shares);
    Ok(TaskOutcome::Opened(JobResult::Opened(opening), jobs))
}

#[cfg(test)]
mod tests {
    use super::super::soup::Soup;
    use super::*;
    use crate::lattice::Triangle;

    /// The cells of the groups of cubes with so many pieces.
    fn groups(shares: &Shares, level: u8, pieces: &[u64]) -> Vec<Vec<usize>> {
        let cubes = pieces.iter().enumerate().map(|(cell, &pieces)| Cube { cell, pieces }).collect();
        let groups = shares.groups::<Soup>(level, cubes);
        groups.iter().map(|group| group.iter().map(|cube| cube.cell).collect()).collect()
    }

    #[test]
    fn cubes_join_while_they_are_small() {
        // A cube one level above the leaves has as many leaves as pieces can make, eight at most.
        let mut shares = Shares { depth: 4, job: u64::MAX, together: 20, whole: false };
        assert_eq!(groups(&shares, 3, &[9, 9, 9, 9, 9]), [vec![0, 1], vec![2, 3], vec![4]]);
        assert!(groups(&shares, 3, &[]).is_empty());
        shares.together = 1;
        assert_eq!(groups(&shares, 3, &[9, 9, 9]), [[0], [1], [2]]);
        // Three of these take more than a job may, two do not.
        shares = Shares { job: 5 * shares.whole_bytes::<Soup>(3, 1000) / 2, together: 1000, ..shares };
        assert_eq!(groups(&shares, 3, &[1000, 1000, 1, 1, 1000]), [vec![0, 1], vec![2, 3], vec![4]]);
        // Nothing joins one that is opened, and it joins nothing.
        let large = shares.job / size_of::<Triangle>() as u64;
        assert_eq!(groups(&shares, 3, &[1, large, 1, 1]), [vec![0], vec![1], vec![2, 3]]);
        // Deep cubes are all opened.
        assert_eq!(groups(&shares, 0, &[1, 1]), [[0], [1]]);
    }
}
