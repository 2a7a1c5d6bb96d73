//! The tree as independent subtree jobs below a few top levels.

use super::branches::follow_pieces;
use super::decide::{NodeDecision, NodePieces};
use super::field::PieceField;
use super::rules::Rules;
use super::scope::{BuildPlan, RecordSink, job_level};
use super::sorted::SortedPieces;
use super::subtree::SubtreeBuilder;
use crate::brick::Brick;
use crate::error::Result;
use crate::lattice::{NodeKey, Octant};
use crate::progress::Progress;
use crate::schedule::run_ordered;
use crate::store::{CoarseSamples, JoinedNode, Records, interior, joined};
use rayon::prelude::*;
use std::collections::HashMap;
use std::sync::Mutex;

/// Builds the tree of a field, the whole or a shard. `consume` gets the records of one job after the
/// other in Morton order, each in post-order, and last those of the levels above the jobs; it returns how many bytes it
/// keeps for good, as an index. Trees that follow the pieces are built within `memory` bytes. Returns the empty cubes of
/// a shard of such a tree, which has no nodes above its jobs.
pub(super) fn build_tree<F: PieceField>(
    field: &F,
    sorted: SortedPieces<F>,
    plan: BuildPlan<'_>,
    memory: u64,
    progress: &dyn Progress,
    consume: &mut RecordSink<'_>,
) -> Result<Vec<(u64, i16)>> {
    let (top, empty) = if plan.rules.refines_all_touched() {
        follow_pieces(field, sorted, plan, memory, progress, consume)?
    } else {
        (decide_from_the_top(field, sorted, plan, progress, consume)?, Vec::new())
    };
    consume(top)?;
    Ok(empty)
}

/// Levels above the jobs are evaluated breadth-first; the nodes that refine down to the job level are jobs. For a shard
/// this is done of all nodes that it has a part in, and recorded of those that it owns.
fn decide_from_the_top<F: PieceField>(
    field: &F,
    sorted: SortedPieces<F>,
    plan: BuildPlan<'_>,
    progress: &dyn Progress,
    consume: &mut RecordSink<'_>,
) -> Result<Records> {
    let BuildPlan { rules, shard, .. } = plan;
    let meets = |key: NodeKey| shard.is_none_or(|shard| shard.meets(key));
    let owns = |key: NodeKey| shard.is_none_or(|shard| shard.owns(key));
    let mut all = Vec::new();
    sorted.gather(0, &mut all)?;
    drop(sorted);
    let mut frontier = vec![NodePieces { key: NodeKey::ROOT, corner: 0, pieces: all }];
    frontier.retain(|job| meets(job.key));
    let mut settled: Vec<(NodeKey, bool, Brick)> = Vec::new();
    let mut unseen = Vec::new();
    while frontier.first().is_some_and(|job| job.key.level() < job_level(rules)) {
        // A shard, which lacks some of the children, evaluates what the whole joins; that gives the same samples.
        let decide = |evaluator: &mut F::Evaluator, node: NodePieces<F::Piece>| {
            Ok((node.key, node.decide(field, evaluator, rules, shard.is_none())?))
        };
        let decided: Vec<(NodeKey, NodeDecision<F::Piece>)> =
            frontier.into_par_iter().map_init(F::Evaluator::default, decide).collect::<Result<_>>()?;
        progress.check()?;
        frontier = Vec::new();
        for (key, decided) in decided {
            let brick = match decided {
                NodeDecision::Empty(w) => Some((true, Brick::Uniform(w))),
                NodeDecision::Leaf(brick, thin) => {
                    if let Some(thin) = thin.filter(|_| owns(key)) {
                        plan.add_thin(&thin);
                    }
                    Some((true, brick))
                }
                NodeDecision::Refined(samples, children) => {
                    frontier.extend(children.into_iter().filter(|job| meets(job.key)));
                    samples.map(|samples| (false, interior(samples)))
                }
            };
            match brick {
                Some((leaf, brick)) if owns(key) => settled.push((key, leaf, brick)),
                Some(_) => {}
                None => unseen.push(key),
            }
        }
    }
    let done = run_jobs(field, &frontier, plan, progress, consume)?;
    for (job, node) in frontier.iter().zip(&done) {
        if let JoinedNode::Empty(w) = node {
            settled.push((job.key, true, Brick::Uniform(*w)));
        }
    }
    if !unseen.is_empty() {
        let jobs = frontier.iter().map(|job| job.key).zip(done);
        join_unseen(unseen, jobs.collect(), &mut settled);
    }
    settled.sort_by_key(|(key, ..)| key.post_order());
    let mut top = Records::new(rules.compression);
    settled.iter().for_each(|(key, leaf, brick)| top.push(*key, *leaf, brick));
    Ok(top)
}

/// Joins nodes above the jobs, parents before their children, from `nodes`, the jobs', and those that are settled, to
/// which they are added.
fn join_unseen(
    unseen: Vec<NodeKey>,
    mut nodes: HashMap<NodeKey, JoinedNode>,
    settled: &mut Vec<(NodeKey, bool, Brick)>,
) {
    nodes.extend(settled.iter().map(|(key, _, brick)| (*key, JoinedNode::Stored(CoarseSamples::of(brick)))));
    // Deepest first.
    for key in unseen.into_iter().rev() {
        let child = |octant| nodes.remove(&key.child(octant)).expect("every child was settled or a job");
        let children: Vec<JoinedNode> = Octant::all().map(child).collect();
        let brick = joined(&children.try_into().expect("there are eight"));
        nodes.insert(key, JoinedNode::Stored(CoarseSamples::of(&brick)));
        settled.push((key, false, brick));
    }
}

/// Of so many jobs those that are built together where a field foresees: the children of eight nodes are a batch of a
/// device's, 64 leaves are one, too. Every thread gets some.
fn jobs_together<F: PieceField>(field: &F, rules: &Rules, jobs: usize) -> usize {
    let batch = match field.foresees() {
        false => 1,
        true if job_level(rules) >= rules.depth => 64,
        true => 8,
    };
    jobs.div_ceil(2 * rayon::current_num_threads()).clamp(1, batch)
}

/// Runs the jobs on all threads and returns their top nodes.
fn run_jobs<F: PieceField>(
    field: &F,
    jobs: &[NodePieces<F::Piece>],
    plan: BuildPlan<'_>,
    progress: &dyn Progress,
    consume: &mut RecordSink<'_>,
) -> Result<Vec<JoinedNode>> {
    let done = Mutex::new(Vec::with_capacity(jobs.len()));
    let local = || SubtreeBuilder::<F>::new(field, plan, progress);
    let groups: Vec<&[NodePieces<F::Piece>]> =
        jobs.chunks(jobs_together(field, plan.rules, jobs.len())).collect();
    let work = |builder: &mut SubtreeBuilder<F>, number: usize| {
        let kept: Vec<Option<JoinedNode>> =
            groups[number].iter().map(|job| plan.built(job.key)).collect::<Result<_>>()?;
        let left = groups[number].iter().zip(&kept).filter(|(_, kept)| kept.is_none());
        let tops: Vec<&NodePieces<F::Piece>> = left.map(|(job, _)| job).collect();
        let mut built = builder.build_deciding(&tops)?.into_iter();
        let node = |kept: Option<JoinedNode>| match kept {
            Some(node) => (node, Records::new(plan.rules.compression)),
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
