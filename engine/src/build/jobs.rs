//! The tree as independent subtree jobs below a few top levels.

use super::bins::Binner;
use super::ordered::run_ordered;
use super::records::Recorder;
use super::rules::Rules;
use super::snap::SnappedSoup;
use super::subtree::{Node, Step, SubtreeBuilder, corner_at, descend, interior, join};
use crate::brick::{Brick, Samples};
use crate::error::Result;
use crate::lattice::{BRICK_CELLS, NodeKey, Octant, Triangle};
use crate::progress::Progress;
use crate::winding::{Evaluator, Triangles};
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

/// The level by which the pass over the input sorts: the jobs' where the tree follows the triangles, else
/// the root, because nodes above the jobs decide for themselves.
pub(super) fn sort_level(rules: &Rules) -> u8 {
    if rules.refines_all_touched() { job_level(rules) } else { 0 }
}

/// One subtree to build.
struct Job {
    key: NodeKey,
    corner: i16,
    triangles: JobTriangles,
}

enum JobTriangles {
    /// A cell of the sorted soup.
    Cell(usize),
    Own(Vec<Triangle>),
}

/// Builds the whole tree of a closed soup. `consume` gets the records of one job after the other in Morton
/// order, each in post-order, and last those of the levels above the jobs.
pub(super) fn build_tree<R: Recorder>(
    soup: SnappedSoup,
    rules: &Rules,
    progress: &dyn Progress,
    consume: impl FnMut(R) -> Result<()> + Send,
) -> Result<()> {
    let mut consume = consume;
    let top = if rules.refines_all_touched() {
        follow_triangles(&soup, rules, progress, &mut consume)?
    } else {
        decide_from_the_top(soup, rules, progress, &mut consume)?
    };
    consume(top)
}

/// Jobs are the touched cells of the sorted soup; the nodes above are joined from them.
fn follow_triangles<R: Recorder>(
    soup: &SnappedSoup,
    rules: &Rules,
    progress: &dyn Progress,
    consume: &mut (impl FnMut(R) -> Result<()> + Send),
) -> Result<R> {
    let level = sort_level(rules);
    let corners = soup.corners.clone().map_or(Vec::new(), |grid| grid.finish(0));
    let mut jobs = Vec::new();
    let mut touched = vec![usize::MAX; 1 << (3 * u32::from(level))];
    for (number, job) in touched.iter_mut().enumerate() {
        if soup.count(number) > 0 {
            *job = jobs.len();
            let key = NodeKey::from_code(1 << (3 * u32::from(level)) | number as u64).expect("a legal key");
            let corner = corner_at(&corners, level, number);
            jobs.push(Job { key, corner, triangles: JobTriangles::Cell(number) });
        }
    }
    let mut done = run_jobs(&jobs, Some(soup), rules, progress, consume)?;
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
fn decide_from_the_top<R: Recorder>(
    soup: SnappedSoup,
    rules: &Rules,
    progress: &dyn Progress,
    consume: &mut (impl FnMut(R) -> Result<()> + Send),
) -> Result<R> {
    let mut all = Vec::new();
    soup.gather(0, &mut all);
    drop(soup);
    let mut frontier = vec![Job { key: NodeKey::ROOT, corner: 0, triangles: JobTriangles::Own(all) }];
    let mut settled: Vec<(NodeKey, bool, Brick)> = Vec::new();
    while frontier.first().is_some_and(|job| job.key.level() < job_level(rules)) {
        let decided: Vec<Decision> =
            frontier.into_par_iter().map(|job| decide(job, rules)).collect::<Result<_>>()?;
        progress.check()?;
        frontier = Vec::new();
        for decision in decided {
            settled.extend(decision.settled);
            frontier.extend(decision.refined);
        }
    }
    let done = run_jobs(&frontier, None, rules, progress, consume)?;
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

struct Decision {
    settled: Option<(NodeKey, bool, Brick)>,
    refined: Vec<Job>,
}

fn decide(job: Job, rules: &Rules) -> Result<Decision> {
    let Job { key, corner, triangles: JobTriangles::Own(triangles) } = job else {
        unreachable!("top-level nodes own their triangles")
    };
    if triangles.is_empty() {
        return Ok(Decision { settled: Some((key, true, Brick::Uniform(corner))), refined: Vec::new() });
    }
    let all: Vec<u32> = (0..triangles.len() as u32).collect();
    let mut evaluator = Evaluator::default();
    let list = Triangles { array: &triangles, indices: &all };
    let mut evaluation = evaluator.evaluate(key, corner, list)?;
    if rules.keeps(&mut evaluation) {
        return Ok(Decision { settled: Some((key, true, evaluation.into_leaf()?)), refined: Vec::new() });
    }
    let samples = evaluation.samples;
    let refined = children(key, &samples, &triangles);
    Ok(Decision { settled: Some((key, false, interior(samples))), refined })
}

/// The eight children of a refined node with their corners and triangles.
fn children(key: NodeKey, samples: &Samples, triangles: &[Triangle]) -> Vec<Job> {
    let lists = Binner::new(key, 1).sort_indices(triangles);
    let child = |octant: Octant| {
        let own = lists.of(octant.index()).iter().map(|&i| triangles[i as usize]).collect();
        let corner = samples.at(octant.offset().map(|o| o * BRICK_CELLS / 2));
        Job { key: key.child(octant), corner, triangles: JobTriangles::Own(own) }
    };
    Octant::all().map(child).collect()
}

/// Runs the jobs on all threads and returns their top nodes.
fn run_jobs<R: Recorder>(
    jobs: &[Job],
    soup: Option<&SnappedSoup>,
    rules: &Rules,
    progress: &dyn Progress,
    consume: &mut (impl FnMut(R) -> Result<()> + Send),
) -> Result<Vec<Node>> {
    let done = Mutex::new(Vec::with_capacity(jobs.len()));
    let local = || (SubtreeBuilder::<R>::new(rules, progress), Vec::new());
    let work = |(builder, gathered): &mut (SubtreeBuilder<R>, Vec<Triangle>), number: usize| {
        let job = &jobs[number];
        let triangles = match &job.triangles {
            JobTriangles::Own(own) => own.as_slice(),
            JobTriangles::Cell(cell) => {
                soup.expect("cells come with a soup").gather(*cell, gathered);
                gathered.as_slice()
            }
        };
        let node = builder.build(job.key, job.corner, triangles)?;
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
