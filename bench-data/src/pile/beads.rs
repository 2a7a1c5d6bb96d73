//! The benchmark's input: a dense pile of deposited beads.
//!
//! A box is filled layer by layer with closed stadium-shaped beads, each a gently curved polyline of 16
//! segments with a random heading, 500 facets a bead. Facet count and box fix everything else: the sum of the bead
//! volumes is 1.2 times the box volume, height is half the width, and length is 25 widths, about what a
//! deposition process leaves. In 100 × 100 × 12 mm that gives
//!
//! | facets | beads | width × height, mm | length, mm | layers |
//! |---|---|---|---|---|
//! | 1 M | 2,000 | 1.87 × 0.93 | 46.6 | 12 |
//! | 5 M | 10,000 | 1.09 × 0.55 | 27.3 | 21 |
//! | 45 M | 90,000 | 0.52 × 0.26 | 13.1 | 45 |
//!
//! Headings are random rather than parallel, so beads cross: of 4,000 random points in the 1 M pile 42 % lie in
//! no bead, 26 % in one, 16 % in two, the deepest in ten; voids of every size remain between the beads.

use crate::shapes::{BeadEnd, ConvexSection, sweep};
use crate::trig::sin_cos;
use crate::vector::add;
use crate::{Mesh, Rng};
use std::f64::consts::TAU;

/// Straight segments of each bead's polyline.
pub const SEGMENTS_PER_BEAD: u32 = 16;
/// 2·12·16 on the sides, 4·12·2 on the rounded ends, 2·10 to close them.
pub const FACETS_PER_BEAD: u32 = 500;

const SIDES: u32 = 12;
const CAP: BeadEnd = BeadEnd::Fused(2);
/// Sum of the bead volumes over the volume of the box.
const FILL: f64 = 1.2;
/// Bead height over width.
const FLATNESS: f64 = 0.5;
/// Length of the centre line over the width.
const SLENDERNESS: f64 = 25.0;
/// Longest centre line over the shorter horizontal side of the box; only tiny piles reach it.
const LONGEST: f64 = 0.6;

/// A pile of beads, made one at a time: an iterator of closed meshes in deposition order (bottom layer
/// first). Beads are independent of each other: [`BeadPile::bead`] makes any one of them.
#[derive(Clone, Debug)]
pub struct BeadPile {
    seed: u64,
    size: [f64; 3],
    beads: u64,
    next: u64,
    width: f64,
    length: f64,
    section: ConvexSection,
}

/// The pile of about `triangles` facets (a multiple of 500, at least 500) in the box 0..`size`, millimetres.
///
/// # Panics
/// If a side of the box is not positive.
pub fn bead_pile(seed: u64, triangles: u64, size: [f64; 3]) -> BeadPile {
    assert!(size.iter().all(|&s| s > 0.0 && s.is_finite()), "the box is empty: {size:?}");
    let per_bead = u64::from(FACETS_PER_BEAD);
    let beads = ((triangles + per_bead / 2) / per_bead).max(1);
    let volume = FILL * size[0] * size[1] * size[2] / beads as f64;
    let (width, length) = dimensions(volume, size);
    let section = ConvexSection::stadium(SIDES, width, FLATNESS * width);
    BeadPile { seed, size, beads, next: 0, width, length, section }
}

/// Width and centre line length of a bead of `volume`.
fn dimensions(volume: f64, size: [f64; 3]) -> (f64, f64) {
    // A straight bead of width 1 measures both parts of the volume, polygonal section and rounded ends
    // included: side·length + ends. Bends do not change it, mitred joints keep section times centre line.
    let bead = |length| {
        let path = [[0.0; 3], [length, 0.0, 0.0]];
        sweep(&path, &ConvexSection::stadium(SIDES, 1.0, FLATNESS), [0.0, 0.0, 1.0], CAP).signed_volume()
    };
    let side = bead(2.0) - bead(1.0);
    let ends = bead(1.0) - side;
    // A cube root by bisection rather than libm's, for the same bits everywhere.
    let cube = volume / (side * SLENDERNESS + ends);
    let width = bisect(cube.max(1.0), |w| w * w * w - cube);
    let longest = LONGEST * size[0].min(size[1]);
    if SLENDERNESS * width <= longest {
        return (width.min(size[2]), SLENDERNESS * width);
    }
    let thick = bisect(longest, |w| (side * longest + ends * w) * w * w - volume);
    // A few beads cannot fill a flat box: their width stops at its height and the pile stays sparse.
    (thick.min(size[2]), longest)
}

/// The zero of a growing function in 0..`high`.
fn bisect(high: f64, f: impl Fn(f64) -> f64) -> f64 {
    let (mut low, mut high) = (0.0, high);
    for _ in 0..200 {
        let middle = 0.5 * (low + high);
        if f(middle) < 0.0 { low = middle } else { high = middle }
    }
    low
}

impl BeadPile {
    /// Beads in the whole pile.
    pub fn beads(&self) -> u64 {
        self.beads
    }

    /// Facets in the whole pile.
    pub fn triangles(&self) -> u64 {
        self.beads * u64::from(FACETS_PER_BEAD)
    }

    /// Bead width, millimetres.
    pub fn width(&self) -> f64 {
        self.width
    }

    /// Bead height, which is also the layer height, millimetres.
    pub fn height(&self) -> f64 {
        FLATNESS * self.width
    }

    /// Length of a bead's centre line without its rounded ends, millimetres.
    pub fn length(&self) -> f64 {
        self.length
    }

    /// Layers that the beads are spread over.
    pub fn layers(&self) -> u64 {
        ((self.size[2] / self.height()) as u64).max(1)
    }

    /// Bead `index` < [`BeadPile::beads`]: 500 facets, closed, inside the box.
    pub fn bead(&self, index: u64) -> Mesh {
        let mut rng = Rng::nth(self.seed, index);
        let path = self.path(index, &mut rng);
        let mesh = sweep(&path, &self.section, [0.0, 0.0, 1.0], CAP);
        debug_assert_eq!(mesh.triangles.len() as u32, FACETS_PER_BEAD);
        mesh
    }

    /// The centre line: constant curvature plus a wobble, a small tilt, moved to a random place where the
    /// whole bead fits into the box.
    fn path(&self, index: u64, rng: &mut Rng) -> Vec<[f64; 3]> {
        let step = self.length / f64::from(SEGMENTS_PER_BEAD);
        let bend = rng.range(-1.2, 1.2) / f64::from(SEGMENTS_PER_BEAD);
        // Most beads stay in their layer, one in 32 climbs through up to three of them.
        let climb = if rng.one_in(32) { 3.0 } else { 0.3 } * self.height();
        let climb = climb.min(self.size[2] - 2.0 * self.reach()[2]).max(0.0);
        let rise = rng.range(-climb, climb) / f64::from(SEGMENTS_PER_BEAD);
        let mut heading = rng.range(0.0, TAU);
        let mut path = vec![[0.0; 3]];
        let mut at = [0.0; 3];
        for _ in 0..SEGMENTS_PER_BEAD {
            let (s, c) = sin_cos(heading);
            at = add(at, [step * c, step * s, rise]);
            path.push(at);
            heading += bend + rng.range(-0.06, 0.06);
        }
        let to = self.place(&path, index, rng);
        path.into_iter().map(|p| add(p, to)).collect()
    }

    /// Farthest that a bead's surface lies from its centre line along each axis, with a little to spare for
    /// mitres and tilt.
    fn reach(&self) -> [f64; 3] {
        [0.56 * self.width, 0.56 * self.width, 0.56 * self.height()]
    }

    /// Where the path's origin goes.
    fn place(&self, path: &[[f64; 3]], index: u64, rng: &mut Rng) -> [f64; 3] {
        let layers = self.layers();
        let layer = u128::from(index) * u128::from(layers) / u128::from(self.beads);
        let z = (layer as f64 + 0.5) * self.size[2] / layers as f64;
        let reach = self.reach();
        std::array::from_fn(|a| {
            let (low, high) = path.iter().fold((0.0f64, 0.0f64), |(l, h), p| (l.min(p[a]), h.max(p[a])));
            let (first, last) = (reach[a] - low, self.size[a] - reach[a] - high);
            let wanted = if a == 2 { z - 0.5 * (low + high) } else { rng.range(first, last) };
            // A bead too large for the box is centred in it.
            if first > last { 0.5 * (first + last) } else { wanted.clamp(first, last) }
        })
    }
}

impl Iterator for BeadPile {
    type Item = Mesh;

    fn next(&mut self) -> Option<Mesh> {
        let index = self.next;
        (index < self.beads).then(|| {
            self.next += 1;
            self.bead(index)
        })
    }

    fn size_hint(&self) -> (usize, Option<usize>) {
        let left = (self.beads - self.next) as usize;
        (left, Some(left))
    }
}

impl ExactSizeIterator for BeadPile {}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::vector::sub;

    #[test]
    fn the_pile_has_the_volume_it_promises_and_stays_in_its_box() {
        for triangles in [10_000, 200_000, 1_000_000] {
            let size = [100.0, 100.0, 12.0];
            let pile = bead_pile(7, triangles, size);
            assert_eq!(pile.triangles(), triangles);
            let mut volume = 0.0;
            for i in (0..pile.beads()).step_by(1 + triangles as usize / 100_000) {
                let bead = pile.bead(i);
                let (low, high) = bead.bounds();
                assert!((0..3).all(|a| low[a] >= 0.0 && high[a] <= size[a]), "{i}: {low:?} {high:?}");
                assert_eq!(bead.triangles.len() as u32, FACETS_PER_BEAD);
                volume += bead.signed_volume() * (1 + triangles / 100_000) as f64;
            }
            if triangles >= 200_000 {
                assert!((volume / (FILL * 120_000.0) - 1.0).abs() < 0.02, "{volume}");
            }
        }
    }

    #[test]
    fn any_bead_can_be_made_alone() {
        let pile = bead_pile(1, 5_000, [100.0, 100.0, 12.0]);
        let streamed: Vec<Mesh> = pile.clone().collect();
        assert_eq!(streamed.len(), 10);
        assert_eq!(streamed[7], pile.bead(7));
        assert_ne!(streamed[7], bead_pile(2, 5_000, [100.0, 100.0, 12.0]).bead(7));
        let middle = sub(streamed[9].bounds().0, streamed[0].bounds().0);
        assert!(middle[2] > 0.0, "later beads lie higher");
    }
}
