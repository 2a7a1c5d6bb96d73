//! Planes of a cell's parent and of what is around that, as the cell sees them.

use super::cells::{Cell, Cells, Splat};
use super::directions::{Directions, ONE, SUB};
use super::model::{BINS, NO_BIN};

/// Signed distance of a cell's middle from the plane of a splat that is `step` cells away, in 1/256 of a cell.
#[inline]
pub fn at_cell(normal: [i32; 3], offset: i32, step: [i8; 3], cells: i32) -> i32 {
    let along = (0..3).map(|axis| normal[axis] * -i32::from(step[axis])).sum::<i32>() * cells;
    along / (ONE / SUB) - offset * (SUB / 16)
}

/// What is known of a cell that is divided, before its eight are.
pub struct NeighbourPlanes<'a> {
    directions: &'a Directions,
    /// Its splats.
    pub splats: &'a [Splat],
    /// How many they are.
    pub count: usize,
    /// Which of the six cells beside it have splats.
    pub faces: usize,
    /// Planes of these: normal with its support, and distance from the parent's middle in 1/256 of half a parent.
    beside: [(([i32; 3], i32), i32); 6],
    known: usize,
}

/// The six cells beside one.
const FACES: [[i8; 3]; 6] = [[-1, 0, 0], [1, 0, 0], [0, -1, 0], [0, 1, 0], [0, 0, -1], [0, 0, 1]];

impl<'a> NeighbourPlanes<'a> {
    /// What is around a cell of `parents`.
    pub fn new(directions: &'a Directions, parents: &'a Cells<Splat>, parent: &Cell) -> NeighbourPlanes<'a> {
        let splats = parents.of(parent);
        let mut around = NeighbourPlanes {
            directions,
            splats,
            count: splats.len(),
            faces: 0,
            beside: [(([0; 3], 0), 0); 6],
            known: 0,
        };
        let own = splats.first().map(|splat| directions.vector(splat.normal));
        for (n, step) in FACES.iter().enumerate() {
            let cell = match parents.beside(parent.at, *step) {
                Some(cell) => cell,
                None => continue,
            };
            around.faces |= 1 << n;
            if let (Some(splat), Some(own)) = (parents.of(cell).first(), own) {
                let (normal, support) = directions.supported(splat.normal);
                let cosine = (0..3).map(|axis| normal[axis] * own[axis]).sum::<i32>();
                if cosine > ONE * ONE / 2 {
                    let distance = 2 * at_cell(normal, i32::from(splat.offset), *step, 1);
                    around.beside[around.known] = ((normal, support), distance);
                    around.known += 1;
                }
            }
        }
        around
    }

    /// Signed distance of an octant's middle from a plane of the parent, whose unit vector is given, in 1/256 of the octant.
    #[inline]
    pub fn distance(&self, splat: &Splat, vector: [i32; 3], octant: usize) -> i32 {
        to_octant(vector, octant) - i32::from(splat.offset) * (SUB / 8)
    }

    /// The class of how far the parent's plane passes an octant's middle, and of how far those beside the parent do.
    #[inline]
    pub fn bins(&self, octant: usize) -> (usize, usize) {
        let own = self.splats.iter().map(|splat| {
            let (normal, support) = self.directions.supported(splat.normal);
            self.directions.in_support(self.distance(splat, normal, octant), support)
        });
        let own = own.min_by_key(|passes| passes.abs()).map_or(NO_BIN, bin);
        let beside = self.beside[..self.known].iter();
        let passes = |((n, support), at): &(([i32; 3], i32), i32)| {
            self.directions.in_support(at + to_octant(*n, octant), *support)
        };
        let sum = beside.map(passes).sum::<i32>();
        (own, if self.known == 0 { NO_BIN } else { bin(sum / self.known as i32) })
    }
}

/// How far an octant's middle is from its parent's along a normal, in 1/256 of the octant.
#[inline]
fn to_octant(normal: [i32; 3], octant: usize) -> i32 {
    let sign = |axis: usize| if octant >> axis & 1 == 1 { normal[axis] } else { -normal[axis] };
    (sign(0) + sign(1) + sign(2)) / (2 * ONE / SUB)
}

/// The class of how far a plane passes the middle of a cell, in 1/16 of the farthest at which it meets it.
#[inline]
pub fn bin(passes: i32) -> usize {
    (passes.clamp(-24, 23) + 24) as usize % BINS
}
