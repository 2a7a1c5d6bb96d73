//! The surface of the fractions that keeps the volume.

use super::kernel::{depth, fraction_at};
use super::{FractionTree, Lattice};
use crate::contour::{ContourOptions, DiscardSink, MeshSummary, contour};
use crate::error::Result;
use crate::progress::Progress;

/// How near to the volume a surface is to be, as a share of it.
const NEAR: f64 = 1e-4;
/// The share of the first surface's error that one far off it may have at most.
const WORTH: f64 = 0.5;
/// Surfaces that are measured at most.
const TRIES: usize = 8;
/// The farthest from the surface of one half, in coarse cells: beyond a cell nothing is known.
const FARTHEST: f64 = 0.98;
/// So far in coarse cells samples without solid, and those with nothing else, do not count.
const SLIGHT: f64 = 0.4;
/// How often the interval of depths is halved to begin with: to less than a ten-thousandth of a cell.
const HALVINGS: usize = 15;

/// A surface of the fractions.
#[derive(Clone, Copy, Debug)]
pub struct LevelSurface {
    /// How far it lies inside of the one where half is solid, in coarse cells.
    pub depth: f64,
    /// The fraction of solid at it.
    pub fraction: f64,
    /// Its mesh.
    pub summary: MeshSummary,
    /// Whether its volume is the one asked for, to a ten-thousandth.
    pub is_near: bool,
}

/// What the mesh of a tree would be.
pub(super) fn measure(
    tree: &FractionTree,
    options: &ContourOptions,
    progress: &dyn Progress,
) -> Result<MeshSummary> {
    contour(tree, options, &mut DiscardSink, progress)
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
) -> Result<LevelSurface> {
    let depth = depth(fraction);
    let summary = measure(&FractionTree::new(lattice, depth), options, progress)?;
    Ok(LevelSurface { depth, fraction, summary, is_near: true })
}

/// The surface whose mesh, made with these options, holds `volume`; the nearest that is found where none does, as of infill
/// whose lines are closer than cells: all of it is solid at one fraction and void at the next. `first` is a surface whose
/// volume is about right, if one is known.
///
/// # Errors
/// As [`contour`].
pub fn keep_volume(
    lattice: &Lattice,
    volume: f64,
    first: Option<f64>,
    options: &ContourOptions,
    progress: &dyn Progress,
) -> Result<LevelSurface> {
    let mut search = Search::new();
    let mut next = first.unwrap_or_else(|| depth_of(lattice, volume));
    let (mut first, mut best): (Option<(f64, LevelSurface)>, Option<LevelSurface>) = (None, None);
    let mut last = None;
    for _ in 0..TRIES {
        let summary = measure(&FractionTree::new(lattice, next), options, progress)?;
        let off = summary.volume - volume;
        let is_near = off.abs() <= NEAR * volume;
        let found = LevelSurface { depth: next, fraction: fraction_at(next), summary, is_near };
        first.get_or_insert((off.abs(), found));
        if best.is_none_or(|best| off.abs() < (best.summary.volume - volume).abs()) {
            best = Some(found);
        }
        // Where all samples are the part's, no surface is another.
        let is_same = last == Some(summary.volume);
        last = Some(summary.volume);
        if is_near || is_same || search.is_over() {
            break;
        }
        // By how much cells and the mesh differ changes little from one surface to the next.
        let guess = depth_of(lattice, lattice.volume_within(next) - off);
        next = search.next(next, off, guess);
    }
    let ((first_off, first), best) = first.zip(best).expect("one is measured at least");
    // What is sharp does not move: then a level far off is no better.
    let is_worth = best.is_near || (best.summary.volume - volume).abs() < WORTH * first_off;
    Ok(if is_worth { best } else { first })
}

/// The surface within which cells hold about this volume.
pub(super) fn depth_of(lattice: &Lattice, volume: f64) -> f64 {
    let (mut inside, mut outside) = (-FARTHEST, FARTHEST);
    // Where all samples are the part's, nothing moves.
    if lattice.volume_within(-SLIGHT) - lattice.volume_within(SLIGHT) <= NEAR * volume {
        return 0.0;
    }
    for _ in 0..HALVINGS {
        let middle = 0.5 * (inside + outside);
        if lattice.volume_within(middle) > volume { inside = middle } else { outside = middle }
    }
    0.5 * (inside + outside)
}

/// The search for a depth, between one whose volume is too large and one whose is too small.
struct Search {
    inside: f64,
    outside: f64,
}

impl Search {
    fn new() -> Search {
        Search { inside: -FARTHEST, outside: FARTHEST }
    }

    fn is_over(&self) -> bool {
        self.outside - self.inside < 1e-6
    }

    /// The depth to try after one whose volume is `off` too large.
    fn next(&mut self, depth: f64, off: f64, guess: f64) -> f64 {
        if off > 0.0 {
            self.inside = self.inside.max(depth)
        } else {
            self.outside = self.outside.min(depth)
        }
        // A guess beyond what is known already is worth less than the middle.
        let is_within = guess > self.inside && guess < self.outside;
        if is_within { guess } else { 0.5 * (self.inside + self.outside) }
    }
}
