//! The tree as independent subtree jobs below a few top levels.

use super::bins::Binner;
use super::field::{Evaluated, Field, Pieces};
use super::ordered::run_ordered;
use super::records::Recorder;
use super::rules::Rules;
use super::sorted::SortedPieces;
use super::subtree::{Node, Step, SubtreeBuilder, corner_at, descend, interior, join};
use crate::brick::{Brick, Samples};
use crate::error::Result;
use crate::lattice::{BRICK_CELLS, NodeKey, Octant};
use crate::progress::Progress;
use rayon::prelude::*;
use std::sync::Mutex;

/// The level at which jobs start. The order of the records in a store depends on it, so it depends on
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

/// One subtree to build.
struct Job<P> {
    key: NodeKey,
    corner: i16,
    pieces: JobPieces<P>,
}

enum JobPieces<P> {
    /// A cell of the sorted input.
    Cell(usize),
    Own(Vec<P>),
}

/// Builds the whole tree of a field. `consume` gets the records of one job after the other in Morton
/// order, each in post-order, and last those of the levels above the jobs.
pub(super) fn build_tree<F: Field, R: Recorder>(
    field: &F,
    sorted: SortedPieces<F>,
    rules: &Rules,
    progress: &dyn Progress,
    consume: impl FnMut(R) -> Result<()> + Send,
) -> Result<()> {
    let mut consume = consume;
    let top = if rules.refines_all_touched() {
        follow_pieces(field, &sorted, rules, progress, &mut consume)?
    } else {
        decide_from_the_top(field, sorted, rules, progress, &mut consume)?
    };
    consume(top)
}

/// Jobs are the touched cells of the sorted input; the nodes above are joined from them.
fn follow_pieces<F: Field, R: Recorder>(
    field: &F,
    sorted: &SortedPieces<F>,
    rules: &Rules,
    progress: &dyn Progress,
    consume: &mut (impl FnMut(R) -> Result<()> + Send),
) -> Result<R> {
    let level = sort_level(rules);
    let corners = sorted.corners.clone().map_or(Vec::new(), |sums| field.finish_corners(sums, 0));
    let mut jobs = Vec::new();
    let mut touched = vec![usize::MAX; 1 << (3 * u32::from(level))];
    for (number, job) in touched.iter_mut().enumerate() {
        if sorted.count(number) > 0 {
            *job = jobs.len();
            let key = NodeKey::from_code(1 << (3 * u32::from(level)) | number as u64).expect("a legal key");
            let corner = corner_at(&corners, level, number);
            jobs.push(Job { key, corner, pieces: JobPieces::Cell(number) });
        }
    }
    let mut done = run_jobs(field, &jobs, Some(sorted), rules, progress, consume)?;
    let mut top = R::default();
    let root = descend(NodeKey::ROOT, level, &mut |step, number| match step {
        Step::Reached(_) => match done.get_mut(touched[number]) {
            Some(node) => Ok(std::mem::replace(node, Node::Empty(0))),
            None => Ok(Node::Empty(corner_at(&corners, level, number))),
        },
        Step::Joined(key, children) => Ok(join(key, children, &mut top)),
    })?;
    if let Node::Empty(w) = root {
        top.push(NodeKey::ROOT, true, &Brick::Uniform(w));
    }
    Ok(top)
}

/// Levels above the jobs are evaluated breadth-first; the nodes that refine down to the job level are jobs.
fn decide_from_the_top<F: Field, R: Recorder>(
    field: &F,
    sorted: SortedPieces<F>,
    rules: &Rules,
    progress: &dyn Progress,
    consume: &mut (impl FnMut(R) -> Result<()> + Send),
) -> Result<R> {
    let mut all = Vec::new();
    sorted.gather(0, &mut all);
    drop(sorted);
    let mut frontier = vec![Job { key: NodeKey::ROOT, corner: 0, pieces: JobPieces::Own(all) }];
    let mut settled: Vec<(NodeKey, bool, Brick)> = Vec::new();
    while frontier.first().is_some_and(|job| job.key.level() < job_level(rules)) {
        let decided: Vec<Decision<F::Piece>> =
            frontier.into_par_iter().map(|job| decide(field, job, rules)).collect::<Result<_>>()?;
        progress.check()?;
        frontier = Vec::new();
        for decision in decided {
            settled.extend(decision.settled);
            frontier.extend(decision.refined);
        }
    }
    let done = run_jobs(field, &frontier, None, rules, progress, consume)?;
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
    let Job { key, corner, pieces: JobPieces::Own(pieces) } = job else {
        unreachable!("top-level nodes own their pieces")
    };
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
        Job { key: key.child(octant), corner, pieces: JobPieces::Own(own) }
    };
    Octant::all().map(child).collect()
}

/// Runs the jobs on all threads and returns their top nodes.
fn run_jobs<F: Field, R: Recorder>(
    field: &F,
    jobs: &[Job<F::Piece>],
    sorted: Option<&SortedPieces<F>>,
    rules: &Rules,
    progress: &dyn Progress,
    consume: &mut (impl FnMut(R) -> Result<()> + Send),
) -> Result<Vec<Node>> {
    let done = Mutex::new(Vec::with_capacity(jobs.len()));
    let local = || (SubtreeBuilder::<F, R>::new(field, rules, progress), Vec::new());
    let work = |(builder, gathered): &mut (SubtreeBuilder<F, R>, Vec<F::Piece>), number: usize| {
        let job = &jobs[number];
        let pieces = match &job.pieces {
            JobPieces::Own(own) => own.as_slice(),
            JobPieces::Cell(cell) => {
                sorted.expect("cells come with what they are cells of").gather(*cell, gathered);
                gathered.as_slice()
            }
        };
        let node = builder.build(job.key, job.corner, pieces)?;
        Ok((std::mem::take(&mut builder.records), node))
    };
    progress.phase("building", Some(jobs.len() as u64), "subtrees");
    let window = 2 * rayon::current_num_threads();
    run_ordered(jobs.len(), window, local, work, |(records, node)| {
        done.lock().expect("no thread panicked").push(node);
        progress.advance(1);
        consume(records)
    })?;
    Ok(done.into_inner().expect("no thread panicked"))
}
