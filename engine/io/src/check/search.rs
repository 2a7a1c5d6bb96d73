//! All pairs of triangles that meet elsewhere than they must.

use super::Mesh;
use super::report::{Intersections, MeetingPair};
use super::tally::Tally;
use super::tree::BoxTree;
use crate::error::Result;
use crate::predicates::{Meeting, ProperTriangle, meeting};
use crate::progress::Progress;
use rayon::prelude::*;

/// Pairs that are named.
const NAMED: usize = 10;

/// Leaves of the tree to a task.
const TASK_LEAVES: usize = 256;

/// What was found.
pub(super) struct SearchResult {
    /// Whole triangles without area, which were left out.
    pub(super) flat: Tally,
    pub(super) intersections: Intersections,
}

/// Looks at all pairs whose boxes meet.
///
/// # Errors
/// If the user interrupts.
pub(super) fn search(mesh: &Mesh, progress: &dyn Progress) -> Result<SearchResult> {
    let numbers = || (0..mesh.triangles.len() as u32).into_par_iter().with_min_len(super::CHUNK);
    progress.phase("sorting", None, "triangles");
    let is_flat = |face: &u32| mesh.is_whole(*face as usize) && triangle_of(mesh, *face).is_none();
    let flat: Vec<u32> = numbers().filter(is_flat).collect();
    let is_kept = |face: &u32| mesh.is_whole(*face as usize) && flat.binary_search(face).is_err();
    let tree = BoxTree::new(numbers().filter(is_kept).collect(), &|face| mesh.corners(face as usize));
    progress.check()?;
    let leaves = tree.leaves();
    progress.phase("intersections", Some(mesh.triangles.len() as u64), "triangles");
    let of_task = |task: usize| {
        let range = task * TASK_LEAVES..leaves.min((task + 1) * TASK_LEAVES);
        let mut found = Intersections::default();
        for leaf in range {
            progress.check()?;
            of_leaf(mesh, &tree, leaf, &mut found);
            progress.advance(tree.faces(leaf).len() as u64);
        }
        Ok(found)
    };
    let tasks = (0..leaves.div_ceil(TASK_LEAVES)).into_par_iter();
    let intersections = tasks.map(of_task).try_reduce(Intersections::default, |a, b| Ok(merged(a, b)))?;
    Ok(SearchResult { flat: Tally::of(&flat), intersections })
}

/// The triangle of a whole face, unless its corners are on a line.
fn triangle_of(mesh: &Mesh, face: u32) -> Option<ProperTriangle> {
    ProperTriangle::of_face(face, mesh.triangles[face as usize], mesh.corners(face as usize))
}

/// A triangle and the box around it.
struct Boxed {
    triangle: ProperTriangle,
    bounds: [[f64; 3]; 2],
}

/// Pairs within a leaf, and with those of later leaves.
fn of_leaf(mesh: &Mesh, tree: &BoxTree, leaf: usize, found: &mut Intersections) {
    let boxed = |&face: &u32| {
        let triangle = triangle_of(mesh, face)?;
        let bounds = bounds_of(&triangle.corners);
        Some(Boxed { triangle, bounds })
    };
    let own: Vec<Boxed> = tree.faces(leaf).iter().filter_map(boxed).collect();
    for (number, a) in own.iter().enumerate() {
        own[number + 1..].iter().for_each(|b| of_pair(a, b, found));
    }
    let low = |a: usize| own.iter().fold(f64::INFINITY, |m, b| m.min(b.bounds[0][a]));
    let high = |a: usize| own.iter().fold(f64::NEG_INFINITY, |m, b| m.max(b.bounds[1][a]));
    let around = [std::array::from_fn(low), std::array::from_fn(high)];
    let block = tree.block(&|face| mesh.corners(face as usize), leaf);
    tree.later_leaves(leaf, &block, |other| {
        for &face in tree.faces(other) {
            if !meets(&bounds_of(&mesh.corners(face as usize)), &around) {
                continue;
            }
            let Some(b) = boxed(&face) else { continue };
            own.iter().for_each(|a| of_pair(a, &b, found));
        }
    });
}

/// The lower and upper corner of the box around a triangle.
fn bounds_of([p, q, r]: &[[f64; 3]; 3]) -> [[f64; 3]; 2] {
    let over = |pick: fn(f64, f64) -> f64| std::array::from_fn(|a| pick(pick(p[a], q[a]), r[a]));
    [over(f64::min), over(f64::max)]
}

fn meets(a: &[[f64; 3]; 2], b: &[[f64; 3]; 2]) -> bool {
    (0..3).all(|n| a[0][n] <= b[1][n] && b[0][n] <= a[1][n])
}

fn of_pair(a: &Boxed, b: &Boxed, found: &mut Intersections) {
    if !meets(&a.bounds, &b.bounds) {
        return;
    }
    let Some(meeting) = meeting(&a.triangle, &b.triangle) else { return };
    found.pairs += 1;
    *match meeting {
        Meeting::Crossing => &mut found.crossing,
        Meeting::Overlapping => &mut found.overlapping,
        Meeting::Touching => &mut found.touching,
    } += 1;
    let (f, g) = (a.triangle.face, b.triangle.face);
    let faces = [f.min(g), f.max(g)];
    if found.first.len() == NAMED && found.first.last().is_some_and(|last| last.faces < faces) {
        return;
    }
    let near = std::array::from_fn(|n| {
        let (low, high) = (a.bounds[0][n].max(b.bounds[0][n]), a.bounds[1][n].min(b.bounds[1][n]));
        low + (high - low) / 2.0
    });
    let place = found.first.partition_point(|pair| pair.faces < faces);
    found.first.insert(place, MeetingPair { faces, near, meeting });
    found.first.truncate(NAMED);
}

fn merged(a: Intersections, b: Intersections) -> Intersections {
    let mut first: Vec<MeetingPair> = a.first.into_iter().chain(b.first).collect();
    first.sort_unstable_by_key(|pair| pair.faces);
    first.truncate(NAMED);
    Intersections {
        pairs: a.pairs + b.pairs,
        crossing: a.crossing + b.crossing,
        overlapping: a.overlapping + b.overlapping,
        touching: a.touching + b.touching,
        first,
    }
}
