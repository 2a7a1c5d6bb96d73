//! Faces that run along an axis: chords along it do not see where they lie, and crossings across it do.

use crate::brick::HermiteEdge;

/// Steps of an edge in which chords are measured.
pub(super) const STEPS: u128 = 1 << 16;

/// Up to which part along an axis of its unit normal a face counts as one that runs along it.
const ALONG: f64 = 0.02;
/// Up to which it may be off as such a face is: places of its crossings repeat slowly, and need not cancel.
const NEARLY_ALONG: f64 = 0.2;

/// What chords of a union miss where a face runs along them, in [`STEPS`] of a cell.
///
/// A chord stands for a whole cell around its lattice line, so such a face counts as if it lay half way between two
/// lines. A crossing of it by an edge across says where it lies; the squares of the normal's parts share out what several
/// edges tell of one place.
#[derive(Clone, Copy, Default)]
pub(super) struct Faces {
    /// To be added to chords along each axis.
    pub beside: [i128; 3],
    /// What faces that nearly run along an axis would add, by the axis of their crossings.
    pub nearly: [i128; 3],
    /// Squares of the cells with crossings of all faces but those that are put right.
    pub scatter: u128,
    /// Magnitudes of what crossings along each axis add.
    pub size: [u128; 3],
    /// Crossings of all faces, each known to a step.
    pub crossings: u128,
}

impl Faces {
    pub fn and(self, other: Faces) -> Faces {
        Faces {
            beside: [0, 1, 2].map(|a| self.beside[a] + other.beside[a]),
            nearly: [0, 1, 2].map(|a| self.nearly[a] + other.nearly[a]),
            scatter: self.scatter + other.scatter,
            size: [0, 1, 2].map(|a| self.size[a] + other.size[a]),
            crossings: self.crossings + other.crossings,
        }
    }

    pub fn scaled(self, by: u128) -> Faces {
        Faces {
            beside: self.beside.map(|sum| sum * by.cast_signed()),
            nearly: self.nearly.map(|sum| sum * by.cast_signed()),
            scatter: self.scatter * by * by,
            size: self.size.map(|sum| sum * by),
            crossings: self.crossings * by,
        }
    }

    /// Adds the crossing of an edge along `axis`, from a sample that is inside or not.
    pub fn add(&mut self, axis: usize, edge: &HermiteEdge, inside: bool) {
        self.crossings += 1;
        let Face { normal, part, least } = Face::of(axis, edge, inside);
        let part = (part * STEPS as f64).round() as i64;
        if least >= ALONG {
            self.scatter += 1;
            self.nearly[axis] += if least < NEARLY_ALONG { i128::from(part) } else { 0 };
            return;
        }
        self.size[axis] += u128::from(part.unsigned_abs());
        for other in across(axis) {
            self.beside[other] += if normal[other].abs() < ALONG { i128::from(part) } else { 0 };
        }
    }
}

/// The axes across an edge.
fn across(axis: usize) -> [usize; 2] {
    [(axis + 1) % 3, (axis + 2) % 3]
}

/// A face at the crossing of an edge.
struct Face {
    normal: [f64; 3],
    /// What lies between it and the middle of the edge, in cells: what the samples do not say of the solid. Less where the face
    /// lies across other axes as well, whose crossings tell the rest.
    part: f64,
    /// The least part of the normal along an axis across the edge.
    least: f64,
}

impl Face {
    /// At an edge along `axis` from a sample that is inside or not.
    fn of(axis: usize, edge: &HermiteEdge, inside: bool) -> Face {
        let normal = edge.normal.to_vector();
        let beyond = (edge.fraction() - 0.5) * if inside { 1.0 } else { -1.0 };
        let [one, other] = across(axis).map(|across| normal[across].abs());
        let least = one.min(other);
        Face { normal, part: normal[axis] * normal[axis] * beyond, least }
    }
}

/// The share of all chords, those along each axis being a third, that do not see where the face at the crossing of an edge
/// along `axis` lies, and that this edge tells: 0 to 2/3.
pub(crate) fn share_beside(axis: usize, edge: &HermiteEdge) -> f64 {
    let direction = edge.normal.to_direction().map(f64::from);
    let squares = direction.map(|c| c * c);
    let least = ALONG * ALONG * squares.iter().sum::<f64>();
    // Squares ask no root.
    let unseeing = across(axis).into_iter().filter(|&other| squares[other] < least).count();
    match unseeing {
        0 => 0.0,
        _ => unseeing as f64 / 3.0 * squares[axis] / squares.iter().sum::<f64>(),
    }
}
