//! The surface of the fractions that keeps the volume.

use super::kernel::{depth, fraction_at};
use super::{FractionTree, Lattice};
use crate::contour::{ContourOptions, Cuts, Encoding, MeshSink, MeshSummary, Triangles, VertexBytes, contour};
use crate::error::Result;
use crate::progress::Progress;

/// How near to the volume a surface is to be, as a share of it.
const NEAR: f64 = 5e-5;
/// Surfaces that are measured at most.
const TRIES: usize = 10;
/// The farthest from the surface of one half, in coarse cells: beyond a cell nothing is known.
const FARTHEST: f64 = 0.98;

/// A surface of the fractions.
#[derive(Clone, Copy, Debug)]
pub struct Kept {
    /// How far it lies inside of the one where half is solid, in coarse cells.
    pub depth: f64,
    /// The fraction of solid at it.
    pub fraction: f64,
    /// Its mesh.
    pub summary: MeshSummary,
    /// Whether its volume is the one asked for, to a ten-thousandth.
    pub is_near: bool,
}

/// Takes a mesh and keeps nothing of it.
struct Measured;

impl MeshSink for Measured {
    fn encoding(&self) -> Option<Encoding> {
        let none = |_: &Cuts, _: &mut Vec<u8>| {};
        Some(Encoding { vertices: VertexBytes::Positions(|_, _| {}), triangles: Triangles::Lone(none) })
    }

    fn finish(&mut self) -> Result<()> {
        Ok(())
    }
}

/// What the mesh of a tree would be.
pub(super) fn measure(tree: &FractionTree, options: &ContourOptions, progress: &dyn Progress) -> Result<MeshSummary> {
    contour(tree, options, &mut Measured, progress)
}

/// The surface at which a fraction is solid, between 0 and 1.
///
/// # Errors
/// As [`contour`].
pub fn surface(
    lattice: &Lattice,
    fraction: f64,
    options: &ContourOptions,
    progress: &dyn Progress,
) -> Result<Kept> {
    let depth = depth(fraction);
    let summary = measure(&FractionTree::new(lattice, depth), options, progress)?;
    Ok(Kept { depth, fraction, summary, is_near: true })
}

/// The surface whose mesh, made with these options, holds `volume`; the nearest that is found where none does, as of infill
/// whose lines are closer than cells: all of it is solid at one fraction and void at the next. `first` is where the search
/// begins, 0 if nothing is known.
///
/// # Errors
/// As [`contour`].
pub fn keep_volume(
    lattice: &Lattice,
    volume: f64,
    first: f64,
    options: &ContourOptions,
    progress: &dyn Progress,
) -> Result<Kept> {
    let mut search = Search { inside: -FARTHEST, outside: FARTHEST, measured: Vec::new() };
    let mut next = first;
    let mut best: Option<Kept> = None;
    for _ in 0..TRIES {
        let summary = measure(&FractionTree::new(lattice, next), options, progress)?;
        let off = summary.volume - volume;
        let is_near = off.abs() <= NEAR * volume;
        if best.is_none_or(|best| off.abs() < (best.summary.volume - volume).abs()) {
            best = Some(Kept { depth: next, fraction: fraction_at(next), summary, is_near });
        }
        if is_near || search.outside - search.inside < 1e-6 {
            break;
        }
        next = search.next(next, off, summary.area * lattice.cell());
    }
    Ok(best.expect("one is measured at least"))
}

/// The search for a depth, between one whose volume is too large and one whose is too small.
struct Search {
    inside: f64,
    outside: f64,
    /// Depths and by how much their volumes are too large.
    measured: Vec<(f64, f64)>,
}

impl Search {
    /// The depth to try after one, whose volume is `off` too large and shrinks by `slope` a cell.
    fn next(&mut self, depth: f64, off: f64, slope: f64) -> f64 {
        if off > 0.0 { self.inside = self.inside.max(depth) } else { self.outside = self.outside.min(depth) }
        let slope = match self.measured.last() {
            Some(&(before, then)) if before != depth && then != off => (then - off) / (depth - before),
            _ => slope,
        };
        self.measured.push((depth, off));
        let middle = 0.5 * (self.inside + self.outside);
        let next = depth + off / slope;
        // Every third step halves what is left, whatever slopes say.
        let is_within = next > self.inside && next < self.outside;
        if is_within && !self.measured.len().is_multiple_of(4) { next } else { middle }
    }
}
