//! The crease in which the planes of a cell with one loop meet at a sharp angle, and the box that the cell's vertex may
//! be in.

use super::constrained_qef::minimiser;
use super::local_index::{Direction, neighbour};
use super::qef::{TRUNCATION_SQUARED, Vector};
use super::solve::SolvedGroup;
use super::symmetric::{Symmetric, dot};
use crate::wide::Simd;

/// Where the largest eigenvalue stands among the terms of a loop.
const LARGEST: usize = 15;

/// Least length, in cells, of a crease in a cell for which it is annexed.
const LEAST: f64 = 1.0 / 64.0;

/// The box of a cell, as the cell sees it, and of its neighbour if it has annexed one, `margin` within.
pub(super) fn region(annexed: Option<Direction>, margin: f64) -> [Vector; 2] {
    let mut bounds = [[margin; 3], [1.0 - margin; 3]];
    if let Some(direction) = annexed {
        let (axis, side) = (usize::from(direction / 2), usize::from(direction % 2));
        bounds[side][axis] += if side == 1 { 1.0 } else { -1.0 };
    }
    bounds
}

pub(super) fn holds([low, high]: &[Vector; 2], at: &Vector) -> bool {
    (0..3).all(|a| (low[a]..=high[a]).contains(&at[a]))
}

/// Whether a face of a cell with this corner mask has corners on both sides.
pub(super) fn is_crossed(mask: u8, face: Direction) -> bool {
    let upper = [0b1010_1010, 0b1100_1100, 0b1111_0000][usize::from(face / 2)];
    let corners: u8 = if face % 2 == 1 { upper } else { !upper };
    mask & corners != 0 && mask & corners != corners
}

/// Where the planes of a cell with one loop meet at a sharp angle, as the cell sees it.
#[derive(Clone, Copy)]
pub(super) struct Crease {
    /// Matrix, right-hand side and so on, as in [`super::constrained_qef::LoopTerms`]; the largest eigenvalue is known.
    terms: [f64; 16],
    /// The minimiser anywhere.
    pub free: Vector,
    /// Along the crease, if the planes meet in one and not in a corner.
    along: Option<Vector>,
}

impl Crease {
    /// That of the loop in a lane; `None` where its planes are as good as one or do not meet at a sharp angle.
    #[inline(always)]
    pub(super) fn of<S: Simd>(solved: &SolvedGroup<S>, lane: usize) -> Option<Crease> {
        if solved.sharp >> lane & 1 == 0 {
            return None;
        }
        let mut terms = [0.0; 16];
        for (term, lanes) in terms.iter_mut().zip(&solved.terms) {
            *term = lanes[lane];
        }
        if terms[LARGEST] < 0.0 {
            return Crease::by_rotations(terms);
        }
        let [x, y, z] = &solved.along;
        let along = (solved.lines >> lane & 1 == 1).then(|| [x[lane], y[lane], z[lane]]);
        Some(Crease { terms, free: [terms[12], terms[13], terms[14]], along })
    }

    /// The same where there is no closed form.
    #[cold]
    fn by_rotations(mut terms: [f64; 16]) -> Option<Crease> {
        let [xx, yy, zz, xy, yz, zx, ra, rb, rc, ma, mb, mc, ..] = terms;
        let (values, vectors) = Symmetric([xx, yy, zz, xy, yz, zx]).eigen();
        let largest = values.into_iter().fold(0.0, f64::max);
        let (mut free, mut flat, mut flats) = ([ma, mb, mc], None, 0);
        for (value, vector) in values.into_iter().zip(vectors) {
            if value > largest * TRUNCATION_SQUARED {
                let along = dot(vector, [ra, rb, rc]) / value;
                (0..3).for_each(|a| free[a] += vector[a] * along);
            } else {
                flat = Some(vector);
                flats += 1;
            }
        }
        terms[12..LARGEST].copy_from_slice(&free);
        terms[LARGEST] = largest;
        (flats < 2).then_some(Crease { terms, free, along: flat })
    }

    /// From where to where the crease lies in a box, along it from the minimiser, if it does.
    pub(super) fn within(&self, [low, high]: &[Vector; 2]) -> Option<[f64; 2]> {
        let along = self.along?;
        let (mut enter, mut leave) = (f64::NEG_INFINITY, f64::INFINITY);
        for a in 0..3 {
            let [low, high] = [low[a] - self.free[a], high[a] - self.free[a]];
            if along[a].abs() < 1e-9 {
                if low > 0.0 || high < 0.0 {
                    return None;
                }
                continue;
            }
            let (s, t) = (low / along[a], high / along[a]);
            (enter, leave) = (enter.max(s.min(t)), leave.min(s.max(t)));
        }
        (enter < leave).then_some([enter, leave])
    }

    /// The point of the crease so far from the minimiser.
    pub(super) fn at(&self, distance: f64) -> Vector {
        let along = self.along.unwrap_or_default();
        std::array::from_fn(|a| self.free[a] + distance * along[a])
    }

    /// The face of a box through which the crease leaves it at its end `at`, upwards along the crease or downwards.
    pub(super) fn exit(&self, [low, high]: &[Vector; 2], at: &Vector, is_up: bool) -> Direction {
        let along = self.along.unwrap_or_default();
        let faces = (0..3u8).map(|axis| {
            let a = usize::from(axis);
            let is_high = (along[a] > 0.0) == is_up;
            let off = if is_high { high[a] - at[a] } else { at[a] - low[a] };
            (off / along[a].abs(), 2 * axis + u8::from(is_high))
        });
        let nearest = faces.reduce(|best, face| if face.0 < best.0 { face } else { best });
        nearest.map_or(0, |(_, face)| face)
    }

    /// Whether it stays where mesh edges lead: within faces of the cell that have corners on both sides.
    pub(super) fn is_led(&self, mask: u8) -> bool {
        let cell = region(None, 0.0);
        if self.along.is_none() {
            return holds(&cell, &self.free);
        }
        let ends = self.within(&cell);
        holds(&cell, &self.free)
            && ends.is_some_and(|ends| {
                [false, true]
                    .into_iter()
                    .zip(ends)
                    .all(|(is_up, end)| is_crossed(mask, self.exit(&cell, &self.at(end), is_up)))
            })
    }

    /// How much of it is in the neighbour in a direction; below one only where it passes both by, which then counts as less.
    pub(super) fn worth(&self, direction: Direction) -> f64 {
        let low = neighbour([0; 3], direction).map(f64::from);
        let length = self.within(&[low, low.map(|c| c + 1.0)]).map_or(0.0, |[enter, leave]| leave - enter);
        if length > LEAST {
            return 1.0 + length;
        }
        let at = self.free[usize::from(direction / 2)];
        (if direction % 2 == 1 { at - 1.0 } else { -at }).min(1.0)
    }

    /// Squared distance from the middle of the neighbour in a direction to the minimiser.
    pub(super) fn distance(&self, direction: Direction) -> f64 {
        let middle = neighbour([0; 3], direction).map(|c| f64::from(c) + 0.5);
        let off: Vector = std::array::from_fn(|a| self.free[a] - middle[a]);
        dot(off, off)
    }

    /// The minimiser over the cell and what it has annexed: on the crease, if any of that lies there.
    pub(super) fn minimiser(&self, annexed: Option<Direction>, margin: f64) -> Vector {
        let bounds = region(annexed, margin);
        if holds(&bounds, &self.free) {
            return self.free;
        }
        match self.within(&bounds) {
            Some([enter, leave]) => self.at(if enter > 0.0 { enter } else { leave }),
            None => minimiser(&self.terms, bounds),
        }
    }
}
