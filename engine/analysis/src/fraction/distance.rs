//! How far a mesh and the surface of a store are from each other, at some points of both.

use crate::brick::{Brick, SignChanges};
use crate::contour::MeshArrays;
use crate::distance::Triangles;
use crate::error::Result;
use crate::lattice::{Axis, NodeKey, RootCube, dot, minus};
use crate::progress::{Progress, Silent};
use crate::soup::{Facet, Facets};
use crate::store::{BrickTree, Leaf, LeafOrder, visit};
use std::collections::BTreeMap;
use std::ops::Range;
use std::path::Path;

/// Points of either surface.
const POINTS: usize = 5_000;
/// Leaves from which points of the store's surface are taken.
const LEAVES: usize = 256;
/// Leaves around the points of the mesh that are read at most.
const LEAVES_AROUND: usize = 4096;
/// A prime beyond [`POINTS`], which scatters numbers below that.
const SCATTER: usize = 7919;

/// Distances of points of one surface from the other.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize)]
pub struct Distances {
    /// How many points.
    pub points: usize,
    /// The mean distance.
    pub mean: f64,
    /// What 999 of 1000 are within.
    pub of_999: f64,
    /// The largest.
    pub largest: f64,
    /// The share of points that are farther than a length asked about.
    pub beyond: f64,
}

impl Distances {
    fn of(mut distances: Vec<f64>, far: f64) -> Distances {
        distances.sort_by(f64::total_cmp);
        let points = distances.len();
        if points == 0 {
            return Distances::default();
        }
        let place = (points * 999).div_ceil(1000) - 1;
        let mean = distances.iter().sum::<f64>() / points as f64;
        let beyond = distances.iter().filter(|&&distance| distance > far).count() as f64 / points as f64;
        Distances { points, mean, of_999: distances[place], largest: distances[points - 1], beyond }
    }
}

/// Distances of points on a mesh from the surface of a tree, and of points on that surface from the mesh. The surface is
/// known by its crossings with lattice edges, so distances from it are right to half a cell. Nothing farther than `reach` is
/// looked for around points of the mesh: such distances are `reach`. Points farther than `far` are counted.
///
/// # Errors
/// What reading the tree gives; [`crate::error::Error::Interrupted`].
pub fn distances(
    tree: &dyn BrickTree,
    mesh: &MeshArrays,
    (far, reach): (f64, f64),
    progress: &dyn Progress,
) -> Result<[Distances; 2]> {
    let order = LeafOrder::new(tree)?;
    let from_mesh = from_mesh(tree, &order, mesh, reach, progress)?;
    let to_mesh = to_mesh(tree, &order, mesh, progress)?;
    Ok([Distances::of(from_mesh, far), Distances::of(to_mesh, far)])
}

/// Calls `each` with the place and the normal of every crossing of a leaf.
fn for_crossings(root: RootCube, leaf: &Leaf<'_>, mut each: impl FnMut([f64; 3], [f64; 3])) {
    let Brick::Counts { samples, hermite } = leaf.brick else { return };
    let signs = SignChanges::of(samples);
    let (base, bits) = (leaf.key.base(), leaf.key.spacing_bits());
    for axis in Axis::ALL {
        signs.for_crossings(axis, hermite, |from, edge| {
            let mut units: [f64; 3] =
                std::array::from_fn(|a| f64::from(base[a] + ((from[a] as i32) << bits)) + 1.0);
            units[axis.index()] += edge.fraction() * f64::from(1u32 << bits);
            each(root.to_world(units), edge.normal.to_vector());
        });
    }
}

/// The triangles of a mesh.
struct MeshFacets<'a>(&'a MeshArrays);

impl Facets for MeshFacets<'_> {
    fn facets(&self) -> u64 {
        self.0.triangles.len() as u64
    }

    fn read(&self, range: Range<u64>, out: &mut Vec<Facet>) {
        let MeshFacets(MeshArrays { positions, triangles }) = self;
        let corners = |ids: &[u32; 3]| ids.map(|id| positions[id as usize].map(f64::from));
        out.clear();
        out.extend(triangles[range.start as usize..range.end as usize].iter().map(corners));
    }
}

/// Of points of the store's surface from the mesh.
fn to_mesh(
    tree: &dyn BrickTree,
    order: &LeafOrder,
    mesh: &MeshArrays,
    progress: &dyn Progress,
) -> Result<Vec<f64>> {
    let passed = |key: &&NodeKey| tree.node(**key).is_some_and(|node| node.min < 1 && node.max >= 1);
    let all: Vec<NodeKey> = order.keys().iter().filter(passed).copied().collect();
    let count = all.len().min(LEAVES);
    let keys: Vec<NodeKey> = (0..count).map(|n| all[n * all.len() / count]).collect();
    // The mesh is in memory, and so are these.
    let triangles = Triangles::new(&[&MeshFacets(mesh)], (u64::MAX, Path::new(".")), &Silent)?;
    progress.phase("distances", Some(keys.len() as u64), "bricks");
    let mut distances = Vec::new();
    let each = POINTS.div_ceil(count.max(1));
    let make = |leaf: &Leaf<'_>| {
        let mut points = Vec::new();
        for_crossings(tree.root(), leaf, |at, _| points.push(at));
        let taken = points.len().min(each);
        let distance = |n: usize| triangles.nearest(points[n * points.len() / taken]).distance;
        Ok((0..taken).map(distance).collect::<Vec<f64>>())
    };
    visit(tree, &keys, progress, make, |_, found: Vec<f64>| {
        distances.extend(found);
        Ok(())
    })?;
    Ok(distances)
}

/// Of points of the mesh from the store's surface.
fn from_mesh(
    tree: &dyn BrickTree,
    order: &LeafOrder,
    mesh: &MeshArrays,
    reach: f64,
    progress: &dyn Progress,
) -> Result<Vec<f64>> {
    let count = mesh.triangles.len().min(POINTS);
    let corner = |id: u32| mesh.positions[id as usize].map(f64::from);
    // Middles of triangles; corners are where vertices were placed, which is not fair.
    let points: Vec<[f64; 3]> = (0..count)
        .map(|n| mesh.triangles[n * mesh.triangles.len() / count].map(corner))
        .map(|[p, q, r]| std::array::from_fn(|a| (p[a] + q[a] + r[a]) / 3.0))
        .collect();
    let mut by_leaf: BTreeMap<usize, Vec<u32>> = BTreeMap::new();
    let mut is_whole = vec![false; points.len()];
    // Points all over the mesh count, as long as their leaves are few enough to be read.
    for n in (0..points.len()).map(|k| k * SCATTER % points.len()) {
        let leaves = leaves_around(tree, order, points[n], reach);
        let more = leaves.iter().filter(|leaf| !by_leaf.contains_key(leaf)).count();
        is_whole[n] = by_leaf.is_empty() || by_leaf.len() + more <= LEAVES_AROUND;
        if is_whole[n] {
            leaves.into_iter().for_each(|leaf| by_leaf.entry(leaf).or_default().push(n as u32));
        }
    }
    let read: Vec<usize> = by_leaf.keys().copied().collect();
    let keys: Vec<NodeKey> = read.iter().map(|&leaf| order.keys()[leaf]).collect();
    progress.phase("distances", Some(keys.len() as u64), "bricks");
    let disc = 0.87 * tree.root().spacing(tree.deepest_level());
    let mut nearest = vec![reach; points.len()];
    let make = |leaf: &Leaf<'_>| {
        let asked = &by_leaf[&read[leaf.number]];
        let mut found: Vec<Found> =
            asked.iter().map(|&n| Found::new(points[n as usize], reach, disc)).collect();
        for_crossings(tree.root(), leaf, |at, normal| {
            found.iter_mut().for_each(|found| found.see(at, normal))
        });
        Ok(found.into_iter().map(|found| found.distance).collect())
    };
    visit(tree, &keys, progress, make, |number, found: Vec<f64>| {
        for (found, &n) in found.into_iter().zip(&by_leaf[&read[number]]) {
            nearest[n as usize] = nearest[n as usize].min(found);
        }
        Ok(())
    })?;
    Ok(nearest
        .into_iter()
        .zip(is_whole)
        .filter(|(_, is_whole)| *is_whole)
        .map(|(distance, _)| distance)
        .collect())
}

/// How far a point is from discs of some radius about crossings.
struct Found {
    point: [f64; 3],
    radius: f64,
    distance: f64,
    /// Square of the distance from which on discs are no nearer.
    far: f64,
}

impl Found {
    fn new(point: [f64; 3], reach: f64, radius: f64) -> Found {
        Found { point, radius, distance: reach, far: (reach + radius).powi(2) }
    }

    /// Looks at the disc about a crossing.
    #[inline]
    fn see(&mut self, at: [f64; 3], normal: [f64; 3]) {
        let apart = minus(self.point, at);
        let square = dot(apart, apart);
        if square >= self.far {
            return;
        }
        let along = dot(apart, normal);
        let beside = ((square - along * along).max(0.0).sqrt() - self.radius).max(0.0);
        let distance = (along * along + beside * beside).sqrt();
        if distance < self.distance {
            *self = Found::new(self.point, distance, self.radius);
        }
    }
}

/// The leaves that the surface passes and that come as near to a point as `reach`.
fn leaves_around(tree: &dyn BrickTree, order: &LeafOrder, point: [f64; 3], reach: f64) -> Vec<usize> {
    let root = tree.root();
    let at = root.from_first_sample(point);
    let reach = reach / root.unit();
    let [low, high] = [-reach, reach].map(|by| at.map(|c| c + by));
    let mut found = Vec::new();
    let mut open = vec![NodeKey::ROOT];
    while let Some(key) = open.pop() {
        let base = key.base().map(f64::from);
        let edge = f64::from(32u32 << key.spacing_bits());
        if (0..3).any(|a| high[a] < base[a] || low[a] > base[a] + edge) {
            continue;
        }
        let leaf = order.covering(key);
        if order.keys()[leaf].level() > key.level() {
            open.extend(crate::lattice::Octant::all().map(|octant| key.child(octant)));
        } else if tree.node(order.keys()[leaf]).is_some_and(|node| node.min < 1 && node.max >= 1) {
            found.push(leaf);
        }
    }
    found
}
