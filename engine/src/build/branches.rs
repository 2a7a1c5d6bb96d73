//! Trees that follow the pieces: the touched cubes of the sorted input are jobs, and one that is too large for its
//! share of memory, or too deep for its records to wait, becomes a branch of smaller ones.

use super::assemble::{Assembler, Opening};
use super::bins::Binner;
use super::field::Field;
use super::jobs::{Plan, sort_level};
use super::records::Recorder;
use super::sorted::SortedPieces;
use super::subtree::{Node, STRIDE, SubtreeBuilder, corner_at};
use crate::error::Result;
use crate::lattice::{MAX_LEVEL, NodeKey};
use crate::progress::Progress;
use crate::schedule::{Bounds, Held, Outcome, Place, run_tasks};
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
struct Branch<F: Field> {
    key: NodeKey,
    stride: u8,
    sorted: SortedPieces<F>,
    corners: Arc<Vec<i64>>,
    /// Counts as long as a job needs the branch; nothing for the root's, which is taken off beforehand.
    _held: Option<Held>,
}

/// A touched cube of a branch.
struct Job<F: Field> {
    branch: Arc<Branch<F>>,
    cell: usize,
    pieces: u64,
}

/// What the jobs yield, in the order of the records.
enum Yield<R> {
    Built { cell: usize, node: Node, records: R },
    Opened(Opening),
}

impl<F: Field> Job<F> {
    fn key(&self) -> NodeKey {
        let code = self.branch.key.code() << (3 * u32::from(self.branch.stride)) | self.cell as u64;
        NodeKey::from_code(code).expect("a descendant of a legal key")
    }

    /// Where the job's records stand: by its first descendant, nodes before those below them.
    fn place(&self) -> Place {
        let key = self.key();
        (key.code() << (3 * u32::from(MAX_LEVEL - key.level())), key.level())
    }

    fn corner(&self) -> i16 {
        corner_at(&self.branch.corners, self.branch.stride, self.cell)
    }
}

impl<F: Field> Branch<F> {
    /// Of sorted pieces, given the sample at the node's corner.
    fn new(field: &F, binner: Binner, corner: i64, sorted: SortedPieces<F>, held: Option<Held>) -> Branch<F> {
        let corners = sorted.corners.clone().map_or(Vec::new(), |sums| field.finish_corners(sums, corner));
        Branch {
            key: binner.node(),
            stride: binner.stride(),
            sorted,
            corners: Arc::new(corners),
            _held: held,
        }
    }

    /// The jobs of its touched cubes, and what their consumer has to know. `cell` as in [`Opening`].
    fn open(self, cell: usize) -> (Opening, Vec<(Place, Job<F>)>) {
        let branch = Arc::new(self);
        let mut jobs = Vec::new();
        for cell in 0..1usize << (3 * u32::from(branch.stride)) {
            let pieces = branch.sorted.count(cell) as u64;
            if pieces > 0 {
                let job = Job { branch: Arc::clone(&branch), cell, pieces };
                jobs.push((job.place(), job));
            }
        }
        let (key, stride, corners) = (branch.key, branch.stride, Arc::clone(&branch.corners));
        (Opening { key, stride, corners, coming: jobs.len(), cell }, jobs)
    }
}

/// What jobs may take.
#[derive(Clone, Copy)]
struct Shares {
    depth: u8,
    /// Of one job.
    job: u64,
}

impl Shares {
    /// What a job takes if it is built as a whole.
    fn whole<F: Field>(&self, level: u8, pieces: u64) -> u64 {
        let leaves = 1u64.checked_shl(3 * u32::from(self.depth - level)).unwrap_or(u64::MAX);
        let records = leaves.min(pieces.saturating_mul(8)).saturating_mul(LEAF_BYTES);
        let crossings = if level == self.depth { CROSSING_BYTES } else { 0 };
        pieces.saturating_mul(size_of::<F::Piece>() as u64 + LIST_BYTES + crossings).saturating_add(records)
    }

    /// Levels that a branch at the job's node descends; `None` if the job is built as a whole.
    fn branches<F: Field>(&self, level: u8, pieces: u64) -> Option<u8> {
        let below = self.depth - level;
        if below > DEPTH_AT_ONCE {
            return Some(STRIDE.min(below - DEPTH_OF_JOBS));
        }
        (below > 0 && self.whole::<F>(level, pieces) > self.job).then_some(below.min(STRIDE))
    }

    /// Memory that a job's pieces take, sorted again.
    fn sorted<F: Field>(&self, pieces: u64) -> u64 {
        pieces.saturating_mul(2 * size_of::<F::Piece>() as u64)
    }

    fn need<F: Field>(&self, job: &Job<F>) -> u64 {
        let level = job.key().level();
        match self.branches::<F>(level, job.pieces) {
            None => self.whole::<F>(level, job.pieces),
            Some(_) => self.sorted::<F>(job.pieces).min(self.job),
        }
    }
}

/// Builds the tree below the sorted pieces' cubes, or a share of these; returns the records of the nodes above them,
/// and, of a share, its empty cubes instead.
pub(super) fn follow_pieces<F: Field, R: Recorder>(
    field: &F,
    sorted: SortedPieces<F>,
    plan: Plan<'_>,
    memory: u64,
    progress: &dyn Progress,
    consume: &mut (impl FnMut(R) -> Result<u64> + Send),
) -> Result<(R, Vec<(u64, i16)>)> {
    let Plan { rules, share, .. } = plan;
    let threads = rayon::current_num_threads() as u64;
    let memory = memory.saturating_sub(sorted.heap_bytes());
    // Of every two jobs a thread one runs and one waits for its turn; one more can always begin.
    let shares = Shares { depth: rules.depth, job: memory / (2 * threads + 1) };
    let bounds = Bounds { memory, reserve: shares.job, window: 2 * threads as usize };
    let root = Branch::new(field, Binner::new(NodeKey::ROOT, sort_level(rules)), 0, sorted, None);
    let (opening, jobs) = root.open(0);
    progress.phase("building", Some(jobs.len() as u64), "subtrees");
    let mut assembler = share.map_or_else(Assembler::new, |share| Assembler::of_cells(share.cells()));
    let mut joined = R::default();
    assembler.open(opening, &mut joined);
    let work =
        |(builder, pieces): &mut (SubtreeBuilder<F, R>, Vec<F::Piece>), job: Job<F>, mut held: Held| {
            progress.check()?;
            if let Some(node) = plan.built(job.key())? {
                held.resize(0);
                return Ok(Outcome::Done(Yield::Built { cell: job.cell, node, records: R::default() }, held));
            }
            match shares.branches::<F>(job.key().level(), job.pieces) {
                Some(stride) => branch(field, &job, stride, shares, held),
                None => {
                    job.branch.sorted.gather(job.cell, pieces)?;
                    let node = builder.build(job.key(), job.corner(), pieces)?;
                    let records = std::mem::take(&mut builder.records);
                    held.resize(records.heap_bytes());
                    Ok(Outcome::Done(Yield::Built { cell: job.cell, node, records }, held))
                }
            }
        };
    let local = || (SubtreeBuilder::<F, R>::new(field, rules, progress), Vec::new());
    run_tasks(
        jobs,
        bounds,
        local,
        |job| shares.need(job),
        work,
        |yielded| {
            let mut kept = None;
            let completed = match yielded {
                Yield::Opened(opening) => assembler.open(opening, &mut joined),
                Yield::Built { cell, node, records } => {
                    assembler.reach(cell, &mut joined);
                    flush(&mut joined, consume, &mut kept)?;
                    kept = Some(consume(records)?);
                    assembler.add(node, &mut joined)
                }
            };
            flush(&mut joined, consume, &mut kept)?;
            progress.advance(completed);
            Ok(kept.map(|kept| kept + assembler.top.heap_bytes()))
        },
    )?;
    Ok(assembler.finish())
}

/// Hands on the records of joined nodes.
fn flush<R: Recorder>(
    joined: &mut R,
    consume: &mut impl FnMut(R) -> Result<u64>,
    kept: &mut Option<u64>,
) -> Result<()> {
    if !joined.is_empty() {
        *kept = Some(consume(std::mem::take(joined))?);
    }
    Ok(())
}

/// Sorts a job's pieces again, by smaller cubes: in memory if they fit there, else on disk.
fn branch<F: Field, R>(
    field: &F,
    job: &Job<F>,
    stride: u8,
    shares: Shares,
    mut held: Held,
) -> Result<Outcome<Job<F>, Yield<R>>> {
    let binner = Binner::new(job.key(), stride);
    let from = &job.branch.sorted;
    let sorted = match &from.elsewhere {
        Some(store) if shares.sorted::<F>(job.pieces) > shares.job => {
            store.split(job.cell, &binner, shares.job / 2)?
        }
        _ => {
            let mut sorted = SortedPieces::default();
            from.for_blocks(job.cell, &mut |pieces| {
                sorted.push(field, &binner, pieces);
                Ok(())
            })?;
            sorted
        }
    };
    held.resize(sorted.heap_bytes());
    let branch = Branch::new(field, binner, i64::from(job.corner()), sorted, Some(held));
    let (opening, jobs) = branch.open(job.cell);
    Ok(Outcome::Opened(Yield::Opened(opening), jobs))
}
