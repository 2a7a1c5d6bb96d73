//! The detail at which a mesh has so many triangles.

use super::lattice::{Lattice, fractions};
use super::level::{LevelSurface, depth_of, keep_volume, measure};
use super::{FractionTree, factor_of};
use crate::contour::ContourOptions;
use crate::error::{Error, Result};
use crate::progress::Progress;
use crate::store::BrickTree;

/// The share of the triangles asked for that a mesh has at least.
const LEAST_SHARE: f64 = 0.9;
/// Edges that change sign tell triangles to a few per cent: this share of them is no less than [`LEAST_SHARE`].
const SURE_SHARE: f64 = 0.95;
/// The share that is aimed at.
const AIM: f64 = 0.96;
/// Each detail that is tried is larger than the one before by this.
const STEP: f64 = 1.1;
/// Factors are multiples of no more than this part of the smallest.
const FINEST_STEP: u32 = 4;
/// How far down details are tried in one reading of the leaves, and how far up in the first.
const REACH: f64 = 2.2;
/// The largest tolerance in coarse cells: beyond it a coarser lattice is nearer to the part for as many triangles.
const MOST_TOLERANCE: f64 = 0.3;
/// By how much of its volume a mesh may be off while another may be nearer.
const MOST_OFF: f64 = 1e-3;
/// Tolerances that are tried at most.
const TRIES: usize = 9;

/// A mesh of about the size asked for, not written yet.
pub struct SizedMesh {
    /// The fractions that it is a surface of.
    pub lattice: Lattice,
    /// The surface.
    pub kept: LevelSurface,
    /// How far it may move for the sake of fewer triangles.
    pub tolerance: f64,
}

/// What is asked for.
#[derive(Clone, Copy)]
pub struct DetailRequest<'a> {
    /// The most triangles.
    pub most: u64,
    /// About how many there are in a mesh of all cells.
    pub of_all: u64,
    /// The volume to keep; that of the leaves if `None`.
    pub volume: Option<f64>,
    /// How to contour, but for the tolerance.
    pub options: &'a ContourOptions,
    /// Bytes for fractions.
    pub memory: u64,
}

/// A mesh of at most so many triangles and no less than nine tenths of them, if there are so many at all: the coarsest
/// lattice that has more of them, and a tolerance that takes away the rest.
///
/// # Errors
/// [`Error::Setting`] if no mesh has so few; as [`fractions`] and [`crate::contour::contour`].
pub fn of_triangles(
    tree: &dyn BrickTree,
    request: DetailRequest<'_>,
    progress: &dyn Progress,
) -> Result<SizedMesh> {
    let (mut lattice, mut larger) = first_lattice(tree, &request, progress)?;
    let mut least = u64::MAX;
    // The one whose volume is nearest, of those that do not keep it.
    let mut nearest: Option<(f64, SizedMesh)> = None;
    loop {
        let volume = request.volume.unwrap_or(lattice.volume());
        if let Some(found) = fitted(lattice, &request, &mut least, progress)? {
            let off = (found.kept.summary.volume / volume - 1.0).abs();
            if off <= MOST_OFF {
                return Ok(found);
            }
            if nearest.as_ref().is_none_or(|(best, _)| off < *best) {
                nearest = Some((off, found));
            }
        }
        // The tolerance does not reach, or takes too much: a coarser lattice.
        lattice = match (larger.pop(), nearest.take()) {
            (Some(lattice), kept) => {
                nearest = kept;
                lattice
            }
            (None, Some((_, found))) => return Ok(found),
            (None, None) => return Err(too_few(request.most, least)),
        };
    }
}

fn too_few(most: u64, least: u64) -> Error {
    if least == u64::MAX {
        return Error::setting("no cells leave anything of the part", "build it with finer cells");
    }
    Error::setting(
        format!("no mesh of this part with {most} triangles is known"),
        format!("ask for {least} at least, which is the fewest that was found"),
    )
}

/// The coarsest lattice of which there are as many triangles as asked for, and coarser ones, the coarsest first.
fn first_lattice(
    tree: &dyn BrickTree,
    request: &DetailRequest<'_>,
    progress: &dyn Progress,
) -> Result<(Lattice, Vec<Lattice>)> {
    // No surface has more triangles than its square would: what is averaged away only makes it smaller.
    let likely = (request.of_all as f64 / request.most as f64).sqrt().max(1.0);
    let most = most_factor(tree);
    let (mut from, mut to) = (likely.min(most) / REACH, (likely * REACH).min(most));
    let mut coarser: Vec<Lattice> = Vec::new();
    let mut is_known_above = false;
    loop {
        let factors = factors(from, to);
        let mut lattices = fractions(tree, &factors, request.memory, progress)?;
        let has_enough = |lattice: &Lattice| {
            let depth = depth_of(lattice, request.volume.unwrap_or(lattice.volume()));
            FractionTree::new(lattice, depth).triangles() as f64 >= SURE_SHARE * request.most as f64
        };
        // From the coarsest on.
        let found = (0..lattices.len()).rev().find(|&n| has_enough(&lattices[n]));
        match found {
            Some(n) if n + 1 == lattices.len() && !is_known_above && to < most => {
                // The coarsest of them may be too fine.
                (from, to) = (to, (to * REACH).min(most));
                is_known_above = to >= most;
            }
            Some(n) => {
                let mut rest = lattices.split_off(n + 1);
                rest.reverse();
                coarser.append(&mut rest);
                return Ok((lattices.pop().expect("one was found"), coarser));
            }
            None if factors[0] == 1 => {
                lattices.reverse();
                let finest = lattices.pop().expect("there is one");
                coarser.append(&mut lattices);
                return Ok((finest, coarser));
            }
            None => {
                is_known_above = true;
                to = f64::from(factors[0]) / STEP;
                from = to / REACH;
                lattices.reverse();
                lattices.truncate(4);
                coarser.append(&mut lattices);
            }
        }
    }
}

/// Factors from one to another, the smallest first. They are multiples of a power of two, so that the leaves are summed once
/// for all.
fn factors(from: f64, to: f64) -> Vec<u32> {
    let mut factors: Vec<u32> = Vec::new();
    let mut factor = from;
    let unit = [8u32, 4, 2].into_iter().find(|&unit| from >= f64::from(FINEST_STEP * unit)).unwrap_or(1);
    while factor < to * 1.0001 {
        factors.push(((factor / f64::from(unit)).round() as u32).max(1) * unit);
        factor *= STEP;
    }
    factors.dedup();
    factors
}

/// The factor with which the root has four coarse cells an axis.
fn most_factor(tree: &dyn BrickTree) -> f64 {
    factor_of(tree, tree.root().edge / 4.0).map_or(1.0, f64::from)
}

/// A surface of a lattice with as many triangles as asked for; `None` if no tolerance makes so few.
fn fitted(
    lattice: Lattice,
    request: &DetailRequest<'_>,
    least: &mut u64,
    progress: &dyn Progress,
) -> Result<Option<SizedMesh>> {
    let volume = request.volume.unwrap_or(lattice.volume());
    let mut options = ContourOptions { tolerance: 0.0, ..request.options.clone() };
    let kept = keep_volume(&lattice, volume, None, &options, progress)?;
    let most = request.most as f64;
    let mut note = |triangles: u64| *least = (*least).min(if triangles > 0 { triangles } else { u64::MAX });
    note(kept.summary.triangles);
    if kept.summary.triangles == 0 {
        return Ok(None);
    }
    if kept.summary.triangles as f64 <= most {
        return Ok(Some(SizedMesh { lattice, kept, tolerance: 0.0 }));
    }
    let mut search = Tolerances { low: 0.0, high: None, cell: lattice.cell() };
    options.tolerance = 0.02 * lattice.cell();
    for _ in 0..TRIES {
        let tree = FractionTree::new(&lattice, kept.depth);
        // Few merges are taken back because triangles meet.
        let quick = ContourOptions { intersection_free: false, ..options.clone() };
        let triangles = measure(&tree, &quick, progress)?.triangles;
        note(triangles);
        let share = triangles as f64 / most;
        if (LEAST_SHARE + 0.005..=AIM + 0.02).contains(&share) {
            break;
        }
        match search.next(options.tolerance, share) {
            Some(next) => options.tolerance = next,
            None => return Ok(None),
        }
    }
    // The volume is kept by the mesh that is written.
    for _ in 0..4 {
        let kept = keep_volume(&lattice, volume, Some(kept.depth), &options, progress)?;
        if kept.summary.triangles as f64 <= most {
            return Ok(Some(SizedMesh { lattice, kept, tolerance: options.tolerance }));
        }
        options.tolerance *= 1.1;
    }
    Ok(None)
}

/// The search for a tolerance.
struct Tolerances {
    /// One with too many triangles.
    low: f64,
    /// One with too few.
    high: Option<f64>,
    cell: f64,
}

impl Tolerances {
    /// The tolerance to try after one that made so many times the triangles asked for; `None` if none is large enough.
    fn next(&mut self, tolerance: f64, share: f64) -> Option<f64> {
        if share > AIM {
            self.low = self.low.max(tolerance);
        } else {
            self.high = Some(self.high.map_or(tolerance, |high| high.min(tolerance)));
        }
        match self.high {
            Some(high) => Some((self.low.max(high * 0.02) * high).sqrt().max(0.5 * self.low)),
            None if tolerance >= MOST_TOLERANCE * self.cell => None,
            None => Some((tolerance * (1.5 * share / AIM).clamp(1.3, 4.0)).min(MOST_TOLERANCE * self.cell)),
        }
    }
}
