//! The tree as independent subtree jobs below a few top levels.

use super::bins::Binner;
use super::branches::follow_pieces;
use super::field::{Evaluated, Field, Pieces};
use super::records::Recorder;
use super::rules::Rules;
use super::sorted::SortedPieces;
use super::subtree::{Half, Node, SubtreeBuilder, Top, interior, joined};
use crate::brick::Brick;
use crate::error::Result;
use crate::lattice::{NodeKey, Octant};
use crate::progress::Progress;
use crate::schedule::run_ordered;
use crate::store::{Kept, Share, subtree_level};
use rayon::prelude::*;
use std::collections::HashMap;
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

/// One subtree to build, with the pieces that touch it.
struct Job<P> {
    key: NodeKey,
    corner: i16,
    pieces: Vec<P>,
}

impl<P> Job<P> {
    fn top(&self) -> Top<'_, P> {
        Top { key: self.key, corner: self.corner, pieces: &self.pieces }
    }
}

/// What of a tree is to be built.
#[derive(Clone, Copy)]
pub(super) struct Plan<'a> {
    pub rules: &'a Rules,
    /// If it is not the whole tree.
    pub share: Option<&'a Share>,
    /// What an earlier run has left of it.
    pub kept: Option<&'a Kept>,
}

impl Plan<'_> {
    /// The node of a subtree that an earlier run has built, if it has: its records are in the store.
    pub fn built(&self, key: NodeKey) -> Result<Option<Node>> {
        let brick = self.kept.map_or(Ok(None), |kept| kept.brick(key))?;
        Ok(brick.map(|brick| Node::Stored(Half::of(&brick))))
    }
}

/// Builds the tree of a field, the whole or a share. `consume` gets the records of one job after the
/// other in Morton order, each in post-order, and last those of the levels above the jobs; it returns how many bytes it
/// keeps for good, as an index. Trees that follow the pieces are built within `memory` bytes. Returns the empty cubes of
/// a share of such a tree, which has no nodes above its jobs.
pub(super) fn build_tree<F: Field, R: Recorder>(
    field: &F,
    sorted: SortedPieces<F>,
    plan: Plan<'_>,
    memory: u64,
    progress: &dyn Progress,
    consume: impl FnMut(R) -> Result<u64> + Send,
) -> Result<Vec<(u64, i16)>> {
    let mut consume = consume;
    let (top, empty) = if plan.rules.refines_all_touched() {
        follow_pieces(field, sorted, plan, memory, progress, &mut consume)?
    } else {
        (decide_from_the_top(field, sorted, plan, progress, &mut consume)?, Vec::new())
    };
    consume(top)?;
    Ok(empty)
}

/// Levels above the jobs are evaluated breadth-first; the nodes that refine down to the job level are jobs. For a share
/// this is done of all nodes that it has a part in, and recorded of those that it owns.
fn decide_from_the_top<F: Field, R: Recorder>(
    field: &F,
    sorted: SortedPieces<F>,
    plan: Plan<'_>,
    progress: &dyn Progress,
    consume: &mut (impl FnMut(R) -> Result<u64> + Send),
) -> Result<R> {
    let Plan { rules, share, .. } = plan;
    let meets = |key: NodeKey| share.is_none_or(|share| share.meets(key));
    let owns = |key: NodeKey| share.is_none_or(|share| share.owns(key));
    let mut all = Vec::new();
    sorted.gather(0, &mut all)?;
    drop(sorted);
    let mut frontier = vec![Job { key: NodeKey::ROOT, corner: 0, pieces: all }];
    frontier.retain(|job| meets(job.key));
    let mut settled: Vec<(NodeKey, bool, Brick)> = Vec::new();
    let mut unseen = Vec::new();
    while frontier.first().is_some_and(|job| job.key.level() < job_level(rules)) {
        let decided: Vec<Decision<F::Piece>> = frontier
            .into_par_iter()
            .map(|job| decide(field, job, rules, share.is_none()))
            .collect::<Result<_>>()?;
        progress.check()?;
        frontier = Vec::new();
        for Decision { key, brick, refined } in decided {
            match brick {
                Some(brick) if owns(key) => settled.push((key, refined.is_empty(), brick)),
                Some(_) => {}
                None => unseen.push(key),
            }
            frontier.extend(refined.into_iter().filter(|job| meets(job.key)));
        }
    }
    let done = run_jobs(field, &frontier, plan, progress, consume)?;
    for (job, node) in frontier.iter().zip(&done) {
        if let Node::Empty(w) = node {
            settled.push((job.key, true, Brick::Uniform(*w)));
        }
    }
    if !unseen.is_empty() {
        let jobs = frontier.iter().map(|job| job.key).zip(done);
        join_unseen(field, unseen, jobs.collect(), &mut settled);
    }
    settled.sort_by_key(|(key, ..)| key.post_order());
    let mut top = R::new(rules.compression);
    settled.iter().for_each(|(key, leaf, brick)| top.push(*key, *leaf, brick));
    Ok(top)
}

/// Joins nodes above the jobs, parents before their children, from `nodes`, the jobs', and those that are settled, to
/// which they are added.
fn join_unseen<F: Field>(
    field: &F,
    unseen: Vec<NodeKey>,
    mut nodes: HashMap<NodeKey, Node>,
    settled: &mut Vec<(NodeKey, bool, Brick)>,
) {
    nodes.extend(settled.iter().map(|(key, _, brick)| (*key, Node::Stored(Half::of(brick)))));
    // Deepest first.
    for key in unseen.into_iter().rev() {
        let child = |octant| nodes.remove(&key.child(octant)).expect("every child was settled or a job");
        let children: Vec<Node> = Octant::all().map(child).collect();
        let brick = joined(&children.try_into().expect("there are eight"), field.binary_places());
        nodes.insert(key, Node::Stored(Half::of(&brick)));
        settled.push((key, false, brick));
    }
}

/// What a node above the jobs turned out to be.
struct Decision<P> {
    key: NodeKey,
    /// `None` if it follows from its children.
    brick: Option<Brick>,
    /// Its children; none of a leaf.
    refined: Vec<Job<P>>,
}

/// A node that is refined whatever its samples are is joined from its children where the tree is built as a whole; a
/// share, which lacks some of them, evaluates it, which gives the same samples.
fn decide<F: Field>(
    field: &F,
    job: Job<F::Piece>,
    rules: &Rules,
    is_whole: bool,
) -> Result<Decision<F::Piece>> {
    let Job { key, corner, pieces } = job;
    let all: Vec<u32> = (0..pieces.len() as u32).collect();
    let list = Pieces { array: &pieces, indices: &all };
    let leaf = |brick| Ok(Decision { key, brick: Some(brick), refined: Vec::new() });
    if let Some(w) = field.settled(key, corner, list) {
        return leaf(Brick::Uniform(w));
    }
    if is_whole && let Some(corners) = field.refined_unseen(rules.refine, key, corner, list) {
        return Ok(Decision { key, brick: None, refined: children(field, key, corners, &pieces) });
    }
    let mut evaluator = F::Evaluator::default();
    let mut evaluation = field.evaluate(&mut evaluator, key, corner, list)?;
    if rules.keeps(&mut evaluation) {
        return leaf(evaluation.into_leaf()?);
    }
    let refined = children(field, key, evaluation.corners(), &pieces);
    Ok(Decision { key, brick: Some(interior(evaluation.into_samples())), refined })
}

/// The eight children of a refined node with their corners and pieces.
fn children<F: Field>(field: &F, key: NodeKey, corners: [i16; 8], pieces: &[F::Piece]) -> Vec<Job<F::Piece>> {
    let lists = Binner::new(key, 1).sort_indices(field, pieces);
    let child = |octant: Octant| {
        let own = lists.of(octant.index()).iter().map(|&i| pieces[i as usize]).collect();
        Job { key: key.child(octant), corner: corners[octant.index()], pieces: own }
    };
    Octant::all().collect::<Vec<_>>().into_par_iter().map(child).collect()
}

/// Of so many jobs those that are built together where a field foresees: the children of eight nodes are a batch of a
/// device's, 64 leaves are one, too. Every thread gets some.
fn jobs_together<F: Field>(field: &F, rules: &Rules, jobs: usize) -> usize {
    let batch = match field.foresees() {
        false => 1,
        true if job_level(rules) == rules.depth => 64,
        true => 8,
    };
    jobs.div_ceil(2 * rayon::current_num_threads()).clamp(1, batch)
}

/// Runs the jobs on all threads and returns their top nodes.
fn run_jobs<F: Field, R: Recorder>(
    field: &F,
    jobs: &[Job<F::Piece>],
    plan: Plan<'_>,
    progress: &dyn Progress,
    consume: &mut (impl FnMut(R) -> Result<u64> + Send),
) -> Result<Vec<Node>> {
    let done = Mutex::new(Vec::with_capacity(jobs.len()));
    let local = || SubtreeBuilder::<F, R>::new(field, plan.rules, progress);
    let groups: Vec<&[Job<F::Piece>]> = jobs.chunks(jobs_together(field, plan.rules, jobs.len())).collect();
    let work = |builder: &mut SubtreeBuilder<F, R>, number: usize| {
        let kept: Vec<Option<Node>> =
            groups[number].iter().map(|job| plan.built(job.key)).collect::<Result<_>>()?;
        let left = groups[number].iter().zip(&kept).filter(|(_, kept)| kept.is_none());
        let tops: Vec<Top<'_, F::Piece>> = left.map(|(job, _)| job.top()).collect();
        let mut built = builder.build_deciding(&tops)?.into_iter();
        let node = |kept: Option<Node>| match kept {
            Some(node) => (node, R::new(plan.rules.compression)),
            None => built.next().expect("every node that was not kept is built"),
        };
        Ok(kept.into_iter().map(node).collect::<Vec<_>>())
    };
    progress.phase("building", Some(jobs.len() as u64), "subtrees");
    let window = 2 * rayon::current_num_threads();
    run_ordered(groups.len(), window, local, work, |group| {
        for (node, records) in group {
            done.lock().expect("no thread panicked").push(node);
            progress.advance(1);
            consume(records)?;
        }
        Ok(())
    })?;
    Ok(done.into_inner().expect("no thread panicked"))
}
