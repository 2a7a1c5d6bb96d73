//! Changes of a mesh at one triangle: edges flipped and collapsed, vertices moved (Botsch & Kobbelt 2004, *A Remeshing
//! Approach to Multiresolution Modeling*).

use super::super::adaptive::wide;
use super::stars::{LocalChange, StarMesh};
use glam::DVec3;

/// Parts of the way to where a vertex could go.
const STEPS: [f64; 3] = [1.0, 0.5, 0.25];

/// All changes that are tried for a triangle.
pub(super) fn changes(mesh: &StarMesh, triangle: u32) -> Vec<LocalChange> {
    let [a, b, c] = mesh.triangle(triangle);
    let mut found = Vec::new();
    for (a, b, c) in [(a, b, c), (b, c, a), (c, a, b)] {
        flips(mesh, triangle, [a, b, c], &mut found);
        collapses(mesh, [a, b], &mut found);
        moves(mesh, a, &mut found);
    }
    found
}

/// The edge opposite to the first corner is turned to it; or that corner becomes a point of the edge, where that is a crease.
fn flips(mesh: &StarMesh, triangle: u32, [a, b, c]: [u32; 3], found: &mut Vec<LocalChange>) {
    let Some((other, d)) = mesh.across(b, c) else { return };
    let is_joined = mesh.star(a).iter().any(|&n| mesh.triangle(n).contains(&d));
    if a == d || is_joined || mesh.star(b).len() <= 3 || mesh.star(c).len() <= 3 {
        return;
    }
    let two = [[a, b, d], [a, d, c]];
    found.push(LocalChange { old: vec![triangle, other], new: two.to_vec(), moved: None });
    let [at, from, to] = [a, b, c].map(|vertex| wide(mesh.positions[vertex as usize]));
    let along = to - from;
    let part = (at - from).dot(along) / along.length_squared();
    if part > 0.0 && part < 1.0 {
        let mut old = mesh.star(a).to_vec();
        let rest = old.iter().filter(|&&n| n != triangle).map(|&n| mesh.triangle(n));
        let new = rest.chain(two).collect();
        old.push(other);
        found.push(LocalChange { old, new, moved: Some((a, single(from + along * part))) });
    }
}

/// An edge becomes one of its ends, or a point between them.
fn collapses(mesh: &StarMesh, [a, b]: [u32; 2], found: &mut Vec<LocalChange>) {
    if !may_collapse(mesh, [a, b]) {
        return;
    }
    let [from, to] = [a, b].map(|vertex| wide(mesh.positions[vertex as usize]));
    for [gone, kept] in [[a, b], [b, a]] {
        let old = mesh.star(gone).to_vec();
        let new = renamed(mesh, &old, [gone, kept]).collect();
        found.push(LocalChange { old, new, moved: None });
    }
    let mut old = mesh.star(a).to_vec();
    old.extend(mesh.star(b).iter().filter(|n| !mesh.star(a).contains(n)));
    let new = renamed(mesh, &old, [a, b]).collect();
    found.push(LocalChange { old, new, moved: Some((b, single((from + to) / 2.0))) });
}

/// What is left of triangles if a vertex becomes another one.
fn renamed<'a>(
    mesh: &'a StarMesh,
    triangles: &'a [u32],
    [gone, kept]: [u32; 2],
) -> impl Iterator<Item = [u32; 3]> + 'a {
    let all = triangles.iter().map(|&n| mesh.triangle(n));
    let left = all.filter(move |corners| !(corners.contains(&gone) && corners.contains(&kept)));
    left.map(move |corners| corners.map(|corner| if corner == gone { kept } else { corner }))
}

/// Whether a closed surface stays a manifold without an edge: its ends have no neighbours in common but those across from
/// it (Dey et al. 1999, *Topology preserving edge contraction*), and neither of these is left with two triangles.
fn may_collapse(mesh: &StarMesh, [a, b]: [u32; 2]) -> bool {
    let others = mesh.around(b);
    let common: Vec<u32> =
        mesh.around(a).into_iter().filter(|vertex| others.binary_search(vertex).is_ok()).collect();
    common.len() == 2 && common.iter().all(|&vertex| mesh.star(vertex).len() > 3)
}

/// A vertex goes towards the middle of those around it, along the surface where that is flat, and as it is.
fn moves(mesh: &StarMesh, vertex: u32, found: &mut Vec<LocalChange>) {
    let around = mesh.around(vertex);
    let place = |vertex: u32| wide(mesh.positions[vertex as usize]);
    let at = place(vertex);
    let middle = around.iter().map(|&vertex| place(vertex)).sum::<DVec3>() / around.len() as f64;
    let normals = mesh.star(vertex).iter().map(|&n| {
        let [a, b, c] = mesh.corners(n).map(wide);
        (b - a).cross(c - a)
    });
    let away = middle - at;
    let upright = normals.sum::<DVec3>().try_normalize().map_or(away, |up| away - up * away.dot(up));
    let old = mesh.star(vertex).to_vec();
    let new: Vec<[u32; 3]> = old.iter().map(|&n| mesh.triangle(n)).collect();
    for way in [upright, away] {
        for step in STEPS {
            let moved = Some((vertex, single(at + way * step)));
            found.push(LocalChange { old: old.clone(), new: new.clone(), moved });
        }
    }
}

fn single(place: DVec3) -> [f32; 3] {
    place.to_array().map(|c| c as f32)
}
