//! The kernel against formulas, in trees whose samples and crossings are those of a formula.

use super::thickness::{Method, Options, PreviousContact, at};
use super::*;
use crate::brick::{Brick, Hermite, HermiteEdge, OctNormal, POINTS, Samples, SignChanges, point_position};
use crate::lattice::{Axis, NodeKey, Octant, RootCube, dot, minus};
use crate::progress::Silent;
use crate::store::{BrickTree, MemoryTree};

/// Signed distance from a shape, below 0 inside.
pub(super) type SignedDistance<'a> = &'a (dyn Fn([f64; 3]) -> f64 + Sync);

/// Cells along the root's edge: 64, so that lengths of shapes are in cells.
pub(super) const EDGE: f64 = 64.0;

/// A tree of two levels of 32 cells in a root of 64 cells.
pub(super) fn tree(shape: SignedDistance<'_>) -> MemoryTree {
    let mut tree = MemoryTree::new(RootCube { origin: [0.0; 3], edge: EDGE });
    tree.insert(NodeKey::ROOT, false, brick(shape, tree.root(), NodeKey::ROOT));
    for octant in Octant::all() {
        let key = NodeKey::ROOT.child(octant);
        let brick = brick(shape, tree.root(), key);
        tree.insert(key, true, brick);
    }
    tree
}

/// The same with one leaf divided once more: the other seven are coarser than the deepest level.
pub(super) fn uneven_tree(shape: SignedDistance<'_>) -> MemoryTree {
    let mut uneven = tree(shape);
    let root = uneven.root();
    let divided = NodeKey::ROOT.child(Octant::all().next().unwrap());
    uneven.insert(divided, false, brick(shape, root, divided));
    for octant in Octant::all() {
        let key = divided.child(octant);
        uneven.insert(key, true, brick(shape, root, key));
    }
    uneven
}

fn brick(shape: SignedDistance<'_>, root: RootCube, key: NodeKey) -> Brick {
    let point = |ijk: [usize; 3]| {
        root.to_world(std::array::from_fn(|a| {
            f64::from(key.base()[a] + ((ijk[a] as i32) << key.spacing_bits()) + 1)
        }))
    };
    let mut samples = Samples::filled(0);
    for n in 0..POINTS {
        let ijk = point_position(n);
        samples.0[n] = i16::from(shape(point(ijk)) < 0.0);
    }
    if samples.range().0 == samples.range().1 {
        return Brick::Uniform(samples.range().0);
    }
    let signs = SignChanges::of(&samples);
    let mut hermite = Hermite::default();
    for axis in Axis::ALL {
        signs.for_edges(axis, |low| {
            let mut high = low;
            high[axis.index()] += 1;
            let (from, to) = (point(low), point(high));
            let at = |t: f64| -> [f64; 3] { std::array::from_fn(|a| from[a] + t * (to[a] - from[a])) };
            let is_inside = shape(from) < 0.0;
            let (mut below, mut above) = (0.0, 1.0);
            for _ in 0..40 {
                let middle = 0.5 * (below + above);
                if (shape(at(middle)) < 0.0) == is_inside { below = middle } else { above = middle }
            }
            let x = at(0.5 * (below + above));
            let gradient: [f64; 3] = std::array::from_fn(|a| {
                let step = |s: f64| {
                    let mut y = x;
                    y[a] += s * 1e-4;
                    shape(y)
                };
                step(1.0) - step(-1.0)
            });
            let normal = OctNormal::from_integer(gradient.map(|c| (c * 1e12) as i64));
            let offset = (below * 65536.0).round().min(65535.0) as u16;
            hermite.edges[axis.index()].push(HermiteEdge { offset, normal });
        });
    }
    Brick::Counts { samples, hermite }
}

pub(super) fn surface(tree: &MemoryTree) -> Surface {
    Surface::new(tree, 1 << 28, std::path::Path::new("."), &Silent).unwrap()
}

pub(super) fn length(v: [f64; 3]) -> f64 {
    dot(v, v).sqrt()
}

pub(super) const MIDDLE: [f64; 3] = [32.17, 31.62, 32.41];

pub(super) fn ball(radius: f64) -> impl Fn([f64; 3]) -> f64 + Sync {
    move |p| length(minus(p, MIDDLE)) - radius
}

pub(super) fn torus(large: f64, small: f64) -> impl Fn([f64; 3]) -> f64 + Sync {
    move |p| {
        let [x, y, z] = turned(minus(p, MIDDLE));
        (x.hypot(y) - large).hypot(z) - small
    }
}

/// Turned by a rotation about (1, 2, 2) / 3 by some 37°, so that nothing is in step with the lattice.
pub(super) fn turned(p: [f64; 3]) -> [f64; 3] {
    let (axis, sin, cos) = ([1.0 / 3.0, 2.0 / 3.0, 2.0 / 3.0], 0.6, 0.8);
    let across = crate::lattice::cross(axis, p);
    let along = dot(axis, p);
    std::array::from_fn(|a| cos * p[a] + sin * across[a] + (1.0 - cos) * along * axis[a])
}

/// A box with these half-widths, turned.
pub(super) fn boxed(half: [f64; 3]) -> impl Fn([f64; 3]) -> f64 + Sync {
    move |p| {
        let q = turned(minus(p, MIDDLE));
        let d: [f64; 3] = std::array::from_fn(|a| q[a].abs() - half[a]);
        let outside = length(d.map(|c| c.max(0.0)));
        outside + d[0].max(d[1]).max(d[2]).min(0.0)
    }
}

/// Points in the root, always the same.
pub(super) fn points(count: u64) -> impl Iterator<Item = [f64; 3]> {
    (0..count).map(|n| {
        [0, 1, 2].map(|a| {
            let bits = crate::lattice::mix((3 * n + a).wrapping_mul(0x9e37_79b9_7f4a_7c15));
            4.0 + 56.0 * (bits >> 11) as f64 / (1u64 << 53) as f64
        })
    })
}

/// Errors of signed distances at points: the mean square's root and the largest.
fn errors(shape: SignedDistance<'_>) -> (f64, f64) {
    let tree = tree(shape);
    let surface = surface(&tree);
    let (mut squares, mut largest, mut count) = (0.0, 0.0f64, 0.0);
    for point in points(3000) {
        let expected = shape(point);
        let foot = surface.closest(surface.to_cells(point), 100.0).unwrap();
        let distance = if foot.inside { -foot.distance } else { foot.distance };
        let error = (distance - expected).abs();
        assert!(expected.abs() < 0.03 || foot.inside == (expected < 0.0), "{point:?}: {distance} {expected}");
        squares += error * error;
        count += 1.0;
        largest = largest.max(error);
    }
    ((squares / count).sqrt(), largest)
}

#[test]
fn distances_from_balls_tori_and_boxes() {
    for (name, shape, most) in [
        ("ball 3", &ball(3.0) as SignedDistance<'_>, [0.003, 0.02]),
        ("ball 8", &ball(8.0), [0.001, 0.005]),
        ("ball 20", &ball(20.0), [0.001, 0.003]),
        ("torus 14 3", &torus(14.0, 3.0), [0.003, 0.02]),
        ("torus 14 6", &torus(14.0, 6.0), [0.001, 0.01]),
        ("box", &boxed([9.0, 12.0, 7.0]), [0.003, 0.02]),
    ] {
        let (rms, largest) = errors(shape);
        println!("{name}: rms {rms:.6}, largest {largest:.6}");
        assert!(rms <= most[0] && largest <= most[1], "{name}: {rms} {largest}");
    }
}

/// Beside edges and corners several patches are equally near.
#[test]
fn the_nearest_point_is_the_same_whatever_is_known_before() {
    let tree = tree(&boxed([9.0, 12.0, 7.0]));
    let surface = surface(&tree);
    let mut beside_edges = 0;
    for point in points(500) {
        let at = surface.to_cells(point);
        let foot = surface.closest(at, f64::INFINITY).unwrap();
        let way: [f64; 3] = std::array::from_fn(|a| (at[a] - foot.at[a]) / foot.distance);
        beside_edges += usize::from(dot(way, foot.normal).abs() < 0.99);
        for within in [1.0 + 1e-12, 1.0 + 1e-6, 1.01, 2.0] {
            let again = surface.closest(at, within * foot.distance).unwrap();
            assert_eq!(
                (again.place, again.at, again.inside),
                (foot.place, foot.at, foot.inside),
                "{point:?}"
            );
        }
    }
    assert!(beside_edges > 50, "{beside_edges}");
}

/// Thickness at all crossings: the largest error, and what 99 of 100 are within, relative; with the largest in cells.
fn thickness(shape: SignedDistance<'_>, options: Options, truth: impl Fn([f64; 3]) -> f64) -> (f64, f64) {
    let tree = tree(shape);
    let surface = surface(&tree);
    let (mut relative, mut excess) = (Vec::new(), 0.0f64);
    let mut last = PreviousContact::default();
    for leaf in 0..surface.leaves().len() {
        for patch in surface.patches_of(leaf) {
            let measured = at(&surface, (patch.at, patch.normal), options, &mut last);
            let expected = truth(surface.to_world(patch.at));
            let error = (measured.value - expected).abs();
            relative.push(error / expected);
            excess = excess.max(error - 0.005 * expected);
        }
    }
    relative.sort_by(f64::total_cmp);
    (relative[relative.len() * 99 / 100], excess)
}

const SPHERE: Options = Options { method: Method::Sphere { separation: 100.0 }, gaps: false };
const RAY: Options = Options { method: Method::Ray, gaps: false };

#[test]
fn walls_of_tori_shells_and_boxes() {
    let shell = |p: [f64; 3]| (length(minus(p, MIDDLE)) - 17.0).abs() - 2.5;
    let slab = boxed([16.0, 14.0, 2.2]);
    for (name, shape, truth) in [
        ("torus 12 2", &torus(12.0, 2.0) as SignedDistance<'_>, 4.0),
        ("torus 14 5", &torus(14.0, 5.0), 10.0),
        ("shell", &shell, 5.0),
    ] {
        for options in [SPHERE, RAY] {
            let (most, excess) = thickness(shape, options, |_| truth);
            println!("{name} {options:?}: 99 % {most:.6}, beyond {excess:.6}");
            // A thousandth of four cells is a 250th of a cell.
            let limit = if options == RAY { 0.001_f64.max(0.005 / truth) } else { 0.005 };
            assert!(most <= limit && excess <= 0.02, "{name} {options:?}: {most} {excess}");
        }
    }
    // Of a box by the face that the crossing is on.
    let of_face = |p: [f64; 3]| {
        let q = turned(minus(p, MIDDLE));
        let halves = [16.0, 14.0, 2.2];
        let off = |a: usize| (q[a].abs() - halves[a]).abs();
        2.0 * halves[(0..3).min_by(|&a, &b| off(a).total_cmp(&off(b))).unwrap()]
    };
    for options in [SPHERE, RAY] {
        let (most, excess) = thickness(&slab, options, of_face);
        println!("slab {options:?}: 99 % {most:.6}, beyond {excess:.6}");
        assert!(most <= 0.001 && excess <= 0.02, "{options:?}: {most} {excess}");
    }
}

/// The diameter of the largest ball in an ellipsoid of revolution about z, with half axes a, a and c > a, that touches a place
/// of its surface: its centre lies on the axis, or it osculates.
fn inscribed(place: [f64; 3], normal: [f64; 3]) -> f64 {
    let rho = place[0].hypot(place[1]);
    let flat = normal[0].hypot(normal[1]);
    2.0 * rho / flat
}

#[test]
fn balls_in_an_ellipsoid_whose_centres_lie_on_its_axis() {
    let half = [7.0, 7.0, 20.0];
    let middle = MIDDLE;
    // Not a distance, but its sign and its gradient are those of one.
    let shape = move |p: [f64; 3]| {
        let q = turned(minus(p, middle));
        7.0 * ((0..3).map(|a| (q[a] / half[a]).powi(2)).sum::<f64>().sqrt() - 1.0)
    };
    let truth = |p: [f64; 3]| {
        let q = turned(minus(p, middle));
        let n: [f64; 3] = std::array::from_fn(|a| q[a] / (half[a] * half[a]));
        let size = length(n);
        // Near the poles balls osculate; the test leaves them out below.
        inscribed(q, n.map(|c| c / size))
    };
    let tree = tree(&shape);
    let surface = surface(&tree);
    let options = Options { method: Method::Sphere { separation: 0.0 }, gaps: false };
    let (mut relative, mut excess) = (Vec::new(), 0.0f64);
    let mut last = PreviousContact::default();
    for leaf in 0..surface.leaves().len() {
        for patch in surface.patches_of(leaf) {
            let place = surface.to_world(patch.at);
            let z = turned(minus(place, middle))[2];
            // The evolute ends on the axis at c - a²/c.
            if z.abs() > 15.0 {
                continue;
            }
            let measured = at(&surface, (patch.at, patch.normal), options, &mut last);
            let error = (measured.value - truth(place)).abs();
            relative.push(error / truth(place));
            excess = excess.max(error - 0.005 * truth(place));
        }
    }
    relative.sort_by(f64::total_cmp);
    let most = relative[relative.len() * 99 / 100];
    println!("ellipsoid: 99 % {most:.6}, beyond {excess:.6}");
    assert!(most <= 0.005 && excess <= 0.021, "{most} {excess}");
}
