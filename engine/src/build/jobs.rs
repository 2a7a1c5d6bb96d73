//! The tree as independent subtree jobs below a few top levels.

use super::bins::Binner;
use super::branches::follow_pieces;
use super::cut::Cut;
use super::field::{Evaluated, Field, Pieces};
use super::ordered::run_ordered;
use super::records::Recorder;
use super::rules::Rules;
use super::sorted::SortedPieces;
use super::subtree::{Node, SubtreeBuilder, interior};
use crate::brick::{Brick, Samples};
use crate::error::Result;
use crate::lattice::{BRICK_CELLS, NodeKey, Octant};
use crate::progress::Progress;
use rayon::prelude::*;
use std::sync::Mutex;

/// The level at which jobs start, and whose cubes are shared out to machines. The order of the records in a store depends on it, so it depends on
/// nothing but the depth. Two levels below, a job has 64 leaves: 10 to 20 ms, enough to feed many threads
/// and not so much that the last job is waited for; at greater depths the count of sorting cells (4,096)
/// bounds it.
pub(super) fn job_level(rules: &Rules) -> u8 {
    match rules.depth {
        depth @ 0..=3 => depth,
        4 | 5 => 3,
        _ => 4,
    }
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

/// One subtree to build, with the pieces that touch it.
struct Job<P> {
    key: NodeKey,
    corner: i16,
    pieces: Vec<P>,
}

/// Builds the tree of a field, the whole or the share that `cut` names. `consume` gets the records of one job after the other in Morton
/// order, each in post-order, and last those of the levels above the jobs; it returns how many bytes it keeps for
/// good, as an index. Trees that follow the pieces are built within `memory` bytes. Returns the empty cubes of a share
/// of such a tree, which has no nodes above its jobs.
pub(super) fn build_tree<F: Field, R: Recorder>(
    field: &F,
    sorted: SortedPieces<F>,
    (rules, cut): (&Rules, Option<&Cut>),
    memory: u64,
    progress: &dyn Progress,
    consume: impl FnMut(R) -> Result<u64> + Send,
) -> Result<Vec<(u64, i16)>> {
    let mut consume = consume;
    let (top, empty) = if rules.refines_all_touched() {
        follow_pieces(field, sorted, (rules, cut), memory, progress, &mut consume)?
    } else {
        (decide_from_the_top(field, sorted, (rules, cut), progress, &mut consume)?, Vec::new())
    };
    consume(top)?;
    Ok(empty)
}

/// Levels above the jobs are evaluated breadth-first; the nodes that refine down to the job level are jobs. For a share
/// this is done of all nodes that it has a part in, and recorded of those that it owns.
fn decide_from_the_top<F: Field, R: Recorder>(
    field: &F,
    sorted: SortedPieces<F>,
    (rules, cut): (&Rules, Option<&Cut>),
    progress: &dyn Progress,
    consume: &mut (impl FnMut(R) -> Result<u64> + Send),
) -> Result<R> {
    let meets = |key: NodeKey| cut.is_none_or(|cut| cut.meets(key));
    let owns = |key: NodeKey| cut.is_none_or(|cut| cut.owns(key));
    let mut all = Vec::new();
    sorted.gather(0, &mut all)?;
    drop(sorted);
    let mut frontier = vec![Job { key: NodeKey::ROOT, corner: 0, pieces: all }];
    frontier.retain(|job| meets(job.key));
    let mut settled: Vec<(NodeKey, bool, Brick)> = Vec::new();
    while frontier.first().is_some_and(|job| job.key.level() < job_level(rules)) {
        let decided: Vec<Decision<F::Piece>> =
            frontier.into_par_iter().map(|job| decide(field, job, rules)).collect::<Result<_>>()?;
        progress.check()?;
        frontier = Vec::new();
        for decision in decided {
            settled.extend(decision.settled.filter(|(key, ..)| owns(*key)));
            frontier.extend(decision.refined.into_iter().filter(|job| meets(job.key)));
        }
    }
    let done = run_jobs(field, &frontier, rules, progress, consume)?;
    for (job, node) in frontier.iter().zip(done) {
        if let Node::Empty(w) = node {
            settled.push((job.key, true, Brick::Uniform(w)));
        }
    }
    settled.sort_by_key(|(key, ..)| key.post_order());
    let mut top = R::default();
    settled.iter().for_each(|(key, leaf, brick)| top.push(*key, *leaf, brick));
    Ok(top)
}

struct Decision<P> {
    settled: Option<(NodeKey, bool, Brick)>,
    refined: Vec<Job<P>>,
}

fn decide<F: Field>(field: &F, job: Job<F::Piece>, rules: &Rules) -> Result<Decision<F::Piece>> {
    let Job { key, corner, pieces } = job;
    let all: Vec<u32> = (0..pieces.len() as u32).collect();
    let list = Pieces { array: &pieces, indices: &all };
    if let Some(w) = field.settled(key, corner, list) {
        return Ok(Decision { settled: Some((key, true, Brick::Uniform(w))), refined: Vec::new() });
    }
    let mut evaluator = F::Evaluator::default();
    let mut evaluation = field.evaluate(&mut evaluator, key, corner, list)?;
    if rules.keeps(&mut evaluation) {
        return Ok(Decision { settled: Some((key, true, evaluation.into_leaf()?)), refined: Vec::new() });
    }
    let samples = evaluation.into_samples();
    let refined = children(field, key, &samples, &pieces);
    Ok(Decision { settled: Some((key, false, interior(samples))), refined })
}

/// The eight children of a refined node with their corners and pieces.
fn children<F: Field>(field: &F, key: NodeKey, samples: &Samples, pieces: &[F::Piece]) -> Vec<Job<F::Piece>> {
    let lists = Binner::new(key, 1).sort_indices(field, pieces);
    let child = |octant: Octant| {
        let own = lists.of(octant.index()).iter().map(|&i| pieces[i as usize]).collect();
        let corner = samples.at(octant.offset().map(|o| o * BRICK_CELLS / 2));
        Job { key: key.child(octant), corner, pieces: own }
    };
    Octant::all().map(child).collect()
}

/// Runs the jobs on all threads and returns their top nodes.
fn run_jobs<F: Field, R: Recorder>(
    field: &F,
    jobs: &[Job<F::Piece>],
    rules: &Rules,
    progress: &dyn Progress,
    consume: &mut (impl FnMut(R) -> Result<u64> + Send),
) -> Result<Vec<Node>> {
    let done = Mutex::new(Vec::with_capacity(jobs.len()));
    let local = || SubtreeBuilder::<F, R>::new(field, rules, progress);
    let work = |builder: &mut SubtreeBuilder<F, R>, number: usize| {
        let Job { key, corner, pieces } = &jobs[number];
        let node = builder.build(*key, *corner, pieces)?;
        Ok((std::mem::take(&mut builder.records), node))
    };
    progress.phase("building", Some(jobs.len() as u64), "subtrees");
    let window = 2 * rayon::current_num_threads();
    run_ordered(jobs.len(), window, local, work, |(records, node)| {
        done.lock().expect("no thread panicked").push(node);
        progress.advance(1);
        consume(records).map(drop)
    })?;
    Ok(done.into_inner().expect("no thread panicked"))
}
