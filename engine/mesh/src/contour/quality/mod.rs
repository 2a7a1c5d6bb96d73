//! Triangles with better angles, for solvers: slivers are taken away by local changes.
//!
//! Dual contouring places a vertex by the surface alone, so some triangles are slivers, and some are folded onto others. Here each
//! triangle with a small angle, of its own or with one beside it, is taken away by flipping or collapsing one of its edges, or by moving one of its corners (Botsch & Kobbelt 2004).
//! The best change is made of those that
//!
//! - raise the smallest angle of the triangles that they replace, and bring down how much these fall short in all,
//! - keep the surface a closed manifold,
//! - keep it within a distance of the first mesh, at points of inner edges, and turn it by 45° at most ([`patch`]),
//! - let no triangles meet that are not joined, which exact predicates decide ([`crate::predicates`]).
//!
//! Worst triangles come first, one after the other, so the result is the same for any number of threads. What can be
//! taken away nowhere within the distance stays.

mod change;
mod loose_octree;
mod patch;
mod sink;
mod stars;

pub use sink::ImprovedSink;

use super::adaptive::{TriangleCorners, are_apart, bounds, meets, normal, wide};
use super::frame::united;
use super::shells::smallest_angle;
use super::sink::MeshArrays;
use crate::error::Result;
use crate::predicates::{has_area, meet_by_place};
use crate::progress::Progress;
use change::changes;
use patch::patch_distance;
use rayon::prelude::*;
use stars::{LocalChange, StarMesh};
use std::collections::HashSet;

/// Degrees below which an angle, of a triangle or between two of them, is too small.
const SMALL: f64 = 10.0;
/// How often all are looked at, at most.
const ROUNDS: usize = 8;
/// Triangles for which changes are looked for at once.
const TOGETHER: usize = 1024;
/// Least gain for which something is changed.
const LEAST_GAIN: f64 = 1e-3;

/// Bytes for each triangle of a mesh that is improved.
pub const IMPROVED_BYTES_A_TRIANGLE: u64 = 200;

/// Takes slivers of a closed manifold mesh without self-intersections away, where the surface need not go farther than `most`.
/// Returns the mesh and the numbers that its vertices had.
pub(super) fn improve(
    mesh: MeshArrays,
    most: f64,
    progress: &dyn Progress,
) -> Result<(MeshArrays, Vec<u32>)> {
    let mut mesh = StarMesh::new(mesh);
    let mut is_new = vec![true; mesh.positions.len()];
    for _ in 0..ROUNDS {
        let is_looked_at =
            |n: &u32| mesh.is_there(*n) && mesh.triangle(*n).iter().any(|v| is_new[*v as usize]);
        let angles = mesh.numbers().filter(is_looked_at).map(|n| (angle(&mesh, n), n));
        let mut small: Vec<(f64, u32)> = angles.filter(|(angle, _)| *angle < SMALL).collect();
        small.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        progress.phase("slivers", Some(small.len() as u64), "triangles");
        is_new.fill(false);
        let mut has_changed = false;
        for some in small.chunks(TOGETHER) {
            progress.check()?;
            has_changed |= improve_some(&mut mesh, some, most, &mut is_new);
            progress.advance(some.len() as u64);
        }
        if !has_changed {
            break;
        }
    }
    Ok(mesh.into_arrays())
}

/// Improves some triangles, one after the other, with changes that all threads have looked for before. One that is not what it
/// was, since a triangle before it has changed what it needs, is looked for again.
fn improve_some(mesh: &mut StarMesh, some: &[(f64, u32)], most: f64, is_new: &mut [bool]) -> bool {
    let is_small = |mesh: &StarMesh, n: u32| mesh.is_there(n) && angle(mesh, n) < SMALL;
    let look = |(_, n): &(f64, u32)| if is_small(mesh, *n) { best(mesh, *n, most) } else { None };
    let looked: Vec<_> = some.par_iter().map(look).collect();
    let mut changed = HashSet::new();
    for ((_, n), found) in some.iter().zip(looked) {
        if !is_small(mesh, *n) {
            continue;
        }
        let is_as_it_was = || vertices_about(mesh, *n).iter().all(|vertex| !changed.contains(vertex));
        let found = match found {
            found if changed.is_empty() => found,
            Some((change, distance)) if is_as_it_was() => {
                let is_free = is_free(mesh, &change, &new_corners(mesh, &change));
                if is_free { Some((change, distance)) } else { best(mesh, *n, most) }
            }
            None if is_as_it_was() => None,
            _ => best(mesh, *n, most),
        };
        if let Some((change, distance)) = found {
            let gone = change.old.iter().flat_map(|n| mesh.triangle(*n));
            changed.extend(gone.chain(change.new.as_flattened().iter().copied()));
            mesh.apply(&change, distance);
            change.new.as_flattened().iter().for_each(|vertex| is_new[*vertex as usize] = true);
        }
    }
    !changed.is_empty()
}

/// The corners of a triangle, those beside them, and those beside these: all that its changes look at, but for where others
/// would meet them.
fn vertices_about(mesh: &StarMesh, triangle: u32) -> Vec<u32> {
    let mut found = mesh.triangle(triangle).to_vec();
    for _ in 0..2 {
        found = found.iter().flat_map(|vertex| mesh.around(*vertex)).collect();
        found.sort_unstable();
        found.dedup();
    }
    found
}

/// The best change for a triangle, and how far it takes the surface.
fn best(mesh: &StarMesh, triangle: u32, most: f64) -> Option<(LocalChange, f64)> {
    let all = changes(mesh, triangle);
    let mut gained: Vec<(f64, &LocalChange)> = Vec::new();
    // Many changes are of the same triangles.
    for some in all.chunk_by(|a, b| a.old == b.old) {
        let before = before(mesh, &some[0]);
        gained.extend(some.iter().filter_map(|change| Some((gain(mesh, before, change)?, change))));
    }
    gained.sort_by(|a, b| b.0.total_cmp(&a.0));
    gained.into_iter().find_map(|(_, change)| {
        let (old, new) = (old_corners(mesh, change), new_corners(mesh, change));
        let distance = patch_distance(&old, &new, most - mesh.strayed(&change.old))?;
        is_free(mesh, change, &new).then(|| (change.clone(), distance))
    })
}

/// How much less triangles fall short of [`SMALL`] angles; `None` if nothing is gained or the smallest angle is no larger.
fn gain(mesh: &StarMesh, (short, least): (f64, f64), change: &LocalChange) -> Option<f64> {
    let (less_short, larger) = self::short(mesh, &change.new, &new_corners(mesh, change));
    (larger >= least && short - less_short > LEAST_GAIN).then_some(short - less_short)
}

/// The same sums as of the triangles that come, of those that go.
fn before(mesh: &StarMesh, change: &LocalChange) -> (f64, f64) {
    let old: Vec<[u32; 3]> = change.old.iter().map(|n| mesh.triangle(*n)).collect();
    short(mesh, &old, &old_corners(mesh, change))
}

/// The sum of squares by which triangles of a patch fall short of [`SMALL`] angles, and the smallest one.
fn short(mesh: &StarMesh, patch: &[[u32; 3]], corners: &[TriangleCorners]) -> (f64, f64) {
    let of_one = |n: usize| {
        let beside = |edge: [u32; 2]| {
            let within = patch.iter().position(|corners| next_after(corners, edge[1]) == Some(edge[0]));
            within.map(|n| corners[n]).or_else(|| Some(mesh.corners(mesh.across(edge[0], edge[1])?.0)))
        };
        let [a, b, c] = patch[n];
        let folds = [[a, b], [b, c], [c, a]]
            .map(|edge| beside(edge).map_or(180.0, |other| fold(&corners[n], &other)));
        folds.into_iter().fold(smallest_angle(&corners[n]), f64::min)
    };
    (0..patch.len()).map(of_one).fold((0.0, 180.0f64), |(short, least), angle| {
        (short + (SMALL - angle).max(0.0).powi(2), least.min(angle))
    })
}

/// The corner that follows one in a triangle.
fn next_after(corners: &[u32; 3], corner: u32) -> Option<u32> {
    corners.iter().position(|&other| other == corner).map(|at| corners[(at + 1) % 3])
}

/// The angle in degrees between two triangles at their common edge, on the side where it is smaller.
fn fold(a: &TriangleCorners, b: &TriangleCorners) -> f64 {
    let [a, b] = [a, b].map(|corners| {
        let [p, q, r] = corners.map(wide);
        (q - p).cross(r - p)
    });
    a.cross(b).length().atan2(-a.dot(b)).to_degrees()
}

/// The smallest angle at a triangle: its own, and those with the triangles beside it.
fn angle(mesh: &StarMesh, triangle: u32) -> f64 {
    short(mesh, &[mesh.triangle(triangle)], &[mesh.corners(triangle)]).1
}

fn old_corners(mesh: &StarMesh, change: &LocalChange) -> Vec<TriangleCorners> {
    change.old.iter().map(|n| mesh.corners(*n)).collect()
}

fn new_corners(mesh: &StarMesh, change: &LocalChange) -> Vec<TriangleCorners> {
    change.new.iter().map(|corners| change.corners(mesh, *corners)).collect()
}

/// Whether new triangles have an area, and meet nothing but what they are joined to.
fn is_free(mesh: &StarMesh, change: &LocalChange, new: &[TriangleCorners]) -> bool {
    if !new.iter().all(has_area) {
        return false;
    }
    let normals: Vec<_> = new.iter().map(normal).collect();
    let is_met = |n: usize, other: &TriangleCorners| {
        let is_joined = other.iter().any(|corner| new[n].contains(corner));
        let is_apart = || !is_joined && are_apart(&new[n], other, [normals[n], normal(other)]);
        !is_apart() && meet_by_place(&new[n], other)
    };
    let is_pair_met = |n: usize| new[n + 1..].iter().any(|other| is_met(n, other));
    if (0..new.len()).any(is_pair_met) {
        return false;
    }
    let boxes: Vec<_> = new.iter().map(bounds).collect();
    let around = boxes.iter().copied().reduce(united).unwrap_or_default();
    !mesh.places.any(&around, |other| {
        if change.old.contains(&other) {
            return false;
        }
        let corners = mesh.corners(other);
        let own = bounds(&corners);
        // Another vertex at the same place would be one with it in formats without numbers.
        let is_taken = change.moved.is_some_and(|(vertex, position)| {
            (0..3).any(|c| mesh.triangle(other)[c] != vertex && corners[c] == position)
        });
        is_taken || (0..new.len()).any(|n| meets(&boxes[n], &own) && is_met(n, &corners))
    })
}
