//! Piles for property tests: small, and as nasty as closed pieces can be.

use crate::shapes::{
    BeadEnd, ConvexSection, Polygon, cuboid, extrude, icosphere, octahedron, slant, spiked_cube, spiral_tube,
    sweep, tetrahedron, torus,
};
use crate::{Mesh, Rng};

/// `pieces` closed meshes in general position, in about −3..3 on each axis: turned and scaled at random, some
/// inside out, some copies of an earlier one, some a smaller copy nested in it.
pub fn random_pile(seed: u64, pieces: usize) -> Vec<Mesh> {
    let mut rng = Rng::new(seed);
    let mut pile: Vec<Mesh> = Vec::with_capacity(pieces);
    for _ in 0..pieces {
        let piece = if !pile.is_empty() && rng.one_in(4) {
            again(&pile, &mut rng)
        } else {
            let size = rng.range(0.3, 1.2);
            let place = std::array::from_fn(|_| rng.range(-1.8, 1.8));
            smooth(&mut rng).scaled([size; 3]).rotated_by(rng.quaternion()).translated(place)
        };
        pile.push(if rng.one_in(5) { piece.flipped() } else { piece });
    }
    pile
}

/// An earlier piece once more, or half as large about the middle of its bounds.
fn again(pile: &[Mesh], rng: &mut Rng) -> Mesh {
    let piece = pile[rng.below(pile.len() as u32) as usize].clone();
    if rng.one_in(2) {
        return piece;
    }
    let (low, high) = piece.bounds();
    piece.mapped(|v| std::array::from_fn(|a| 0.5 * v[a] + 0.25 * (low[a] + high[a])))
}

/// A piece of about unit size.
fn smooth(rng: &mut Rng) -> Mesh {
    match rng.below(9) {
        0 => cuboid([-1.0, -0.7, -0.4], [1.0, 0.7, 0.4]),
        1 => icosphere(rng.below(3), 1.0),
        2 => tetrahedron([[1.0, 1.0, 1.0], [-1.0, -1.0, 1.0], [-1.0, 1.0, -1.0], [1.0, -1.0, -1.0]]),
        3 => torus(0.8, 0.3, 12, 7),
        4 => extrude(&Polygon::regular(3 + rng.below(12), 0.8), -0.6, 0.6),
        5 => extrude(&Polygon::star(5, 0.35, 1.0), -0.2, 0.2),
        6 => spiral_tube(2, 12, 0.6, 0.3, 0.4).translated([0.0, 0.0, -0.3]),
        7 => spiked_cube(0.5, 0.8),
        _ => bent_bead(rng),
    }
}

fn bent_bead(rng: &mut Rng) -> Mesh {
    let mut at = [-1.0, 0.0, 0.0];
    let mut path = vec![at];
    for _ in 0..5 {
        at = [at[0] + 0.4, at[1] + rng.range(-0.3, 0.3), at[2] + rng.range(-0.3, 0.3)];
        path.push(at);
    }
    sweep(&path, &ConvexSection::stadium(8, 0.4, 0.2), [0.0, 0.0, 1.0], BeadEnd::Fused(2))
}

/// `pieces` closed meshes whose vertices are multiples of `step` in 0..=`cells`·`step`, for `cells` ≥ 8: boxes,
/// notched prisms, and pieces with faces at 45° along every diagonal, in all 48 orientations of the cube,
/// many of them sharing planes, faces and edges; some are inside out or doubled.
///
/// With an even `step` the vertices are even, as the engine snaps them, and 45° faces run through its odd
/// samples.
pub fn lattice_pile(seed: u64, pieces: usize, step: i32, cells: u32) -> Vec<Mesh> {
    assert!(step > 0 && cells >= 8, "no room for a piece: step {step}, {cells} cells");
    let mut rng = Rng::new(seed);
    let mut pile: Vec<Mesh> = Vec::with_capacity(pieces);
    while pile.len() < pieces {
        if !pile.is_empty() && rng.one_in(8) {
            let copy = pile[rng.below(pile.len() as u32) as usize].clone();
            pile.push(if rng.one_in(2) { copy.flipped() } else { copy });
            continue;
        }
        let piece = turned(blocky(cells, &mut rng), &mut rng);
        let (low, high) = piece.bounds();
        let span = (0..3).map(|a| high[a] - low[a]).fold(0.0, f64::max);
        if span > f64::from(cells) {
            continue;
        }
        let place: [f64; 3] =
            std::array::from_fn(|a| f64::from(rng.below(cells - (high[a] - low[a]) as u32 + 1)) - low[a]);
        let piece = piece.translated(place).scaled([f64::from(step); 3]);
        pile.push(if rng.one_in(6) { piece.flipped() } else { piece });
    }
    pile
}

/// A piece with integer vertices.
fn blocky(cells: u32, rng: &mut Rng) -> Mesh {
    let mut size = |most: u32| f64::from(1 + rng.below(most.max(1)));
    let (a, b, c) = (size(cells / 2), size(cells / 2), size(cells / 2));
    let (small, arm) = (size(cells / 8), size(3));
    match rng.below(10) {
        0 | 1 => cuboid([0.0; 3], [a, b, c]),
        2 => extrude(&Polygon::ell(a + arm, arm), 0.0, b),
        3 => extrude(&Polygon::slotted(2.0 * arm + a, arm), 0.0, b),
        4 => extrude(&Polygon::gear(small), 0.0, b),
        5 => extrude(&Polygon::diamond(a), 0.0, b),
        6 => slant([a, b, c]),
        7 => spiked_cube(small, if rng.one_in(3) { 2.0 * small } else { small }),
        8 => octahedron(a),
        _ => tetrahedron([[0.0; 3], [a, 0.0, 0.0], [0.0, a, 0.0], [0.0, 0.0, a]]),
    }
}

/// One of the 48 symmetries of the cube.
fn turned(mesh: Mesh, rng: &mut Rng) -> Mesh {
    let order = [[0, 1, 2], [1, 2, 0], [2, 0, 1], [0, 2, 1], [2, 1, 0], [1, 0, 2]];
    let which = rng.below(6) as usize;
    let sign: [f64; 3] = std::array::from_fn(|_| if rng.one_in(2) { -1.0 } else { 1.0 });
    let swapped = mesh.mapped(|v| order[which].map(|a: usize| v[a]));
    // The last three orders are odd permutations, hence mirrors.
    let outward = if which >= 3 { swapped.flipped() } else { swapped };
    outward.scaled(sign)
}
