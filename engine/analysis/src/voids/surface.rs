//! Area and volume of voids from the polygons of the contour.
//!
//! Vertices stand on the surface where it is smooth, and each polygon is around a lattice edge of which the crossing is known
//! exactly. Volume and area are those of the surface that passes them all, with errors of fourth order in the cell; flat
//! faces and sharp edges are the polygons themselves.

use super::bulge::bulge;
use super::enclosing_ball::smallest_ball;
use super::labelling::Labelling;
use super::wanted::WantedVoids;
use crate::contour::{Bend, EdgeFacet, edge_facets};
use crate::error::Result;
use crate::lattice::{NodeKey, RootCube, cross, dot, minus, mix};
use crate::progress::Progress;
use crate::store::{BrickTree, MovedTree};
use crate::wide::{dispatch, level};
use std::collections::BTreeMap;

/// Directions in which the farthest vertices of a void are kept, to find the smallest ball around it.
const DIRECTIONS: usize = 49;
/// Bytes of these.
pub(super) const FARTHEST_BYTES: usize = size_of::<[[f32; 3]; DIRECTIONS]>();
/// Sums over the polygons of a void.
#[derive(Clone, Debug)]
pub struct VoidSurface {
    /// In square world units.
    pub area: f64,
    /// In cubic world units, signed: positive of a void.
    pub volume: f64,
    /// Sum of the vectors of area: zero of a closed surface.
    pub open: [f64; 3],
    /// Least and greatest coordinates of vertices.
    pub bounds: [[f64; 3]; 2],
    /// Areas of its shadows along x, y and z, each from one side.
    pub projected: [f64; 3],
    /// Moments of second order of its area about the point that it is measured from, by pairs of axes.
    second: [[f64; 3]; 3],
    /// Those of first order.
    first: [f64; 3],
    /// The farthest vertices in some directions, once it has any and until it is complete.
    farthest: Option<Box<[[f32; 3]; DIRECTIONS]>>,
    /// The diameter of the smallest ball around these, once it is complete.
    pub diameter: f64,
}

/// Directions by coordinate.
type Directions = [[f64; DIRECTIONS]; 3];

impl Default for VoidSurface {
    fn default() -> VoidSurface {
        VoidSurface {
            area: 0.0,
            volume: 0.0,
            open: [0.0; 3],
            bounds: [[f64::INFINITY; 3], [f64::NEG_INFINITY; 3]],
            projected: [0.0; 3],
            second: [[0.0; 3]; 3],
            first: [0.0; 3],
            farthest: None,
            diameter: 0.0,
        }
    }
}

impl VoidSurface {
    fn add(&mut self, other: VoidSurface, directions: &Directions) {
        for a in 0..3 {
            self.projected[a] += other.projected[a];
            self.first[a] += other.first[a];
            (0..3).for_each(|b| self.second[a][b] += other.second[a][b]);
        }
        self.area += other.area;
        self.volume += other.volume;
        for a in 0..3 {
            self.open[a] += other.open[a];
            self.bounds[0][a] = self.bounds[0][a].min(other.bounds[0][a]);
            self.bounds[1][a] = self.bounds[1][a].max(other.bounds[1][a]);
        }
        match (&mut self.farthest, other.farthest) {
            (Some(own), Some(other)) => {
                for (n, (own, at)) in own.iter_mut().zip(*other).enumerate() {
                    let far = |at: [f32; 3]| dot(at.map(f64::from), directions.map(|along| along[n]));
                    if far(at) > far(*own) {
                        *own = at;
                    }
                }
            }
            (own @ None, other) => *own = other,
            (Some(_), None) => {}
        }
    }

    /// Takes vertices into the box and among the farthest; of equally far ones the first in Morton order stays.
    fn vertices(&mut self, vertices: &[[f32; 3]], directions: &Directions) {
        dispatch!(level(), _simd => self.vertices_with(vertices, directions));
    }

    #[inline(always)]
    fn vertices_with(&mut self, vertices: &[[f32; 3]], directions: &Directions) {
        let Some(&first) = vertices.first() else { return };
        let farthest = self.farthest.get_or_insert_with(|| Box::new([first; DIRECTIONS]));
        let mut far: [f64; DIRECTIONS] =
            std::array::from_fn(|n| dot(farthest[n].map(f64::from), directions.map(|along| along[n])));
        for &at in vertices {
            let place = at.map(f64::from);
            for (a, place) in place.into_iter().enumerate() {
                self.bounds[0][a] = self.bounds[0][a].min(place);
                self.bounds[1][a] = self.bounds[1][a].max(place);
            }
            let (mut here, mut farther) = ([0.0; DIRECTIONS], 0);
            for n in 0..DIRECTIONS {
                let [x, y, z] = [directions[0][n], directions[1][n], directions[2][n]];
                here[n] = place[0] * x + place[1] * y + place[2] * z;
                farther |= u64::from(here[n] > far[n]);
            }
            if farther == 0 {
                continue;
            }
            for n in 0..DIRECTIONS {
                if here[n] > far[n] {
                    (farthest[n], far[n]) = (at, here[n]);
                }
            }
        }
    }

    /// Finds the smallest ball around it; nothing is to be added any more.
    fn complete(&mut self) {
        let points = self.farthest.take();
        let points: Vec<[f64; 3]> =
            points.iter().flat_map(|all| all.iter()).map(|at| at.map(f64::from)).collect();
        self.diameter = 2.0 * smallest_ball(&points);
    }

    /// Moves places by a vector, but for those that count from its centre.
    fn moved(mut self, by: [f64; 3]) -> VoidSurface {
        let place = |at: [f64; 3]| std::array::from_fn(|a| at[a] + by[a]);
        self.bounds = self.bounds.map(place);
        self
    }

    /// Longest over shortest extent, by the spread of the area along its principal axes.
    pub fn elongation(&self) -> Option<f64> {
        if self.area <= 0.0 {
            return None;
        }
        let mean = self.first.map(|m| m / self.area);
        let entry = |a: usize, b: usize| self.second[a][b] / self.area - mean[a] * mean[b];
        let spread = spreads(std::array::from_fn(|a| std::array::from_fn(|b| entry(a, b))));
        let least = spread.iter().copied().fold(f64::INFINITY, f64::min);
        let most = spread.iter().copied().fold(0.0, f64::max);
        (least > 1e-9 * most).then(|| (most / least).sqrt())
    }
}

/// The surfaces of the components that `centre` gives a point to measure from, in the world. Calls `each` with a component and
/// its surface as soon as that is complete; no surface is kept longer.
///
/// # Errors
/// As [`edge_facets`].
pub(super) fn surfaces(
    tree: &dyn BrickTree,
    labelling: &Labelling,
    centre: &(dyn Fn(usize) -> Option<[f64; 3]> + Sync),
    cache_bytes: usize,
    progress: &dyn Progress,
    mut each: impl FnMut(usize, VoidSurface) + Send,
) -> Result<()> {
    // Corners have coordinates of 32 bits.
    let origin = if MovedTree::is_far(tree) { MovedTree::middle(tree) } else { [0.0; 3] };
    let tree = &MovedTree::new(tree, origin);
    let directions = directions();
    let wanted = (0..labelling.components.len()).map(|component| centre(component).is_some()).collect();
    // A part of the memory is for labels of leaves that wait for their vertices.
    let label_bytes = cache_bytes / 8;
    let voids = WantedVoids::new(tree, (labelling, None), wanted, label_bytes);
    let is_wanted = |key: NodeKey| voids.is_in(labelling.order.covering(key));
    let spans = labelling.leaf_spans();
    let centre = |component: usize| centre(component).map_or([0.0; 3], |centre| minus(centre, origin));
    let make = |key: NodeKey, facets: &[EdgeFacet]| {
        let leaf = labelling.order.covering(key);
        let mut surfaces = of_leaf(key, facets, &voids, labelling, &centre, &directions)?;
        let is_whole = |component: &usize| spans[*component] == [leaf as u32; 2];
        for (_, surface) in surfaces.iter_mut().filter(|(component, _)| is_whole(component)) {
            surface.complete();
        }
        Ok((leaf as u32, surfaces))
    };
    let mut rest: BTreeMap<usize, VoidSurface> = BTreeMap::new();
    let (bytes, bend) = (cache_bytes - label_bytes, Bend::Strong);
    edge_facets(&voids, bytes, (bend, is_wanted), progress, make, |(leaf, surfaces)| {
        for (component, surface) in surfaces {
            let [first, last] = spans[component];
            if first == last {
                each(component, surface.moved(origin));
                continue;
            }
            rest.entry(component).or_default().add(surface, &directions);
            if leaf == last
                && let Some(mut surface) = rest.remove(&component)
            {
                surface.complete();
                each(component, surface.moved(origin));
            }
        }
        Ok(())
    })?;
    // The last leaves of these have nothing of their surfaces.
    for (component, mut surface) in rest {
        surface.complete();
        each(component, surface.moved(origin));
    }
    Ok(())
}

/// What a leaf has of a surface.
#[derive(Default)]
struct LeafSurface {
    surface: VoidSurface,
    /// From where the surface is measured.
    centre: [f64; 3],
    /// Of its triangles, those of one after the other.
    vertices: Vec<[f32; 3]>,
}

/// What a leaf has of surfaces, by component.
fn of_leaf(
    key: NodeKey,
    facets: &[EdgeFacet],
    voids: &WantedVoids<'_>,
    labelling: &Labelling,
    centre: &dyn Fn(usize) -> [f64; 3],
    directions: &Directions,
) -> Result<BTreeMap<usize, VoidSurface>> {
    let (root, leaf) = (voids.root(), labelling.order.covering(key));
    let only = voids.only_in(leaf);
    let labels = if only.is_none() { Some(voids.labels_of(leaf)?) } else { None };
    let mut surfaces: BTreeMap<usize, LeafSurface> = BTreeMap::new();
    for polygon in in_polygons(facets).chunk_by(|a, b| (a.axis, a.low) == (b.axis, b.low)) {
        let edge = polygon[0];
        let Some(component) = only.or_else(|| labels.as_ref()?.at(edge.outer())) else { continue };
        let new = || LeafSurface { centre: centre(component), ..LeafSurface::default() };
        let LeafSurface { surface, centre, vertices } = surfaces.entry(component).or_insert_with(new);
        add_polygon(surface, polygon, crossing(root, key, edge), *centre);
        polygon.iter().for_each(|facet| vertices.extend(facet.corners));
    }
    let surface = |(component, of_leaf): (usize, LeafSurface)| {
        let mut surface = of_leaf.surface;
        surface.vertices(&without_repeats(of_leaf.vertices), directions);
        (component, surface)
    };
    Ok(surfaces.into_iter().map(surface).collect())
}

/// Facets by the edges that their polygons are around.
fn in_polygons(facets: &[EdgeFacet]) -> Vec<&EdgeFacet> {
    let key = |(n, facet): (usize, &EdgeFacet)| {
        let [i, j, k] = facet.low.map(|c| c as u64);
        (facet.axis.index() as u64) << 56 | i << 48 | j << 40 | k << 32 | n as u64
    };
    let mut order: Vec<u64> = facets.iter().enumerate().map(key).collect();
    order.sort_unstable();
    order.iter().map(|key| &facets[*key as u32 as usize]).collect()
}

/// Vertices in their order without most of those that came before: neighbours have them in common.
fn without_repeats(mut vertices: Vec<[f32; 3]>) -> Vec<[f32; 3]> {
    const SEEN: usize = 1 << 9;
    let mut seen = [[f32::NAN; 3]; SEEN];
    vertices.retain(|at| {
        let bits = at.map(|c| u64::from(c.to_bits()));
        let place = mix(bits[0] ^ bits[1] << 21 ^ bits[2] << 42) as usize % SEEN;
        std::mem::replace(&mut seen[place], *at) != *at
    });
    vertices
}

/// Where the surface crosses the edge of a facet, in the world.
fn crossing(root: RootCube, key: NodeKey, facet: &EdgeFacet) -> [f64; 3] {
    let step = f64::from(1u32 << key.spacing_bits());
    let mut at = facet.low.map(|c| c as f64);
    at[facet.axis.index()] += facet.fraction;
    root.to_world([0, 1, 2].map(|a| f64::from(key.base()[a]) + 1.0 + at[a] * step))
}

/// Adds the triangles of one polygon, and what the surface that passes its corners and the crossing has beside them.
fn add_polygon(surface: &mut VoidSurface, polygon: &[&EdgeFacet], crossing: [f64; 3], centre: [f64; 3]) {
    let (mut area, mut vector) = (0.0, [0.0; 3]);
    for facet in polygon {
        let [a, b, c] = facet.corners.map(|corner| corner.map(f64::from));
        let doubled = cross(minus(b, a), minus(c, a));
        let own = 0.5 * dot(doubled, doubled).sqrt();
        area += own;
        let middle = [0, 1, 2].map(|n| (a[n] + b[n] + c[n]) / 3.0 - centre[n]);
        for n in 0..3 {
            // Both sides of a closed surface cast the same shadow.
            surface.projected[n] += 0.25 * doubled[n].abs();
            surface.first[n] += own * middle[n];
            (0..3).for_each(|m| surface.second[n][m] += own * middle[n] * middle[m]);
        }
        // Seen from the void the part's outside is inward.
        surface.volume -= dot(minus(a, centre), doubled) / 6.0;
        vector = [0, 1, 2].map(|n| vector[n] + 0.5 * doubled[n]);
    }
    surface.open = [0, 1, 2].map(|n| surface.open[n] + vector[n]);
    surface.area += area;
    if let Some((beyond, true_area)) = bulge(polygon, crossing, vector) {
        surface.volume -= beyond;
        surface.area += true_area - area;
    }
}

/// The eigenvalues of a symmetric matrix, by Jacobi's rotations.
fn spreads(mut m: [[f64; 3]; 3]) -> [f64; 3] {
    const SWEEPS: usize = 12;
    for (p, q) in (0..SWEEPS).flat_map(|_| [(0, 1), (0, 2), (1, 2)]) {
        if m[p][q] == 0.0 {
            continue;
        }
        let theta = (m[q][q] - m[p][p]) / (2.0 * m[p][q]);
        let t = theta.signum() / (theta.abs() + (theta * theta + 1.0).sqrt());
        let t = if theta == 0.0 { 1.0 } else { t };
        let c = 1.0 / (t * t + 1.0).sqrt();
        let s = t * c;
        for row in &mut m {
            (row[p], row[q]) = (c * row[p] - s * row[q], s * row[p] + c * row[q]);
        }
        let (one, other) = (m[p], m[q]);
        for n in 0..3 {
            (m[p][n], m[q][n]) = (c * one[n] - s * other[n], s * one[n] + c * other[n]);
        }
    }
    [m[0][0], m[1][1], m[2][2]]
}

/// Directions all round, evenly, on a spiral; and the axes, both ways.
fn directions() -> Directions {
    const ALONG_AXES: usize = 6;
    let all: [[f64; 3]; DIRECTIONS] = std::array::from_fn(|n| {
        if n < ALONG_AXES {
            let mut axis = [0.0; 3];
            axis[n / 2] = if n % 2 == 0 { 1.0 } else { -1.0 };
            return axis;
        }
        let count = (DIRECTIONS - ALONG_AXES) as f64;
        let z = 1.0 - (2.0 * (n - ALONG_AXES) as f64 + 1.0) / count;
        let turn = (n - ALONG_AXES) as f64 * std::f64::consts::PI * (3.0 - 5f64.sqrt());
        let across = (1.0 - z * z).sqrt();
        [across * turn.cos(), across * turn.sin(), z]
    });
    [0, 1, 2].map(|a| all.map(|direction| direction[a]))
}
