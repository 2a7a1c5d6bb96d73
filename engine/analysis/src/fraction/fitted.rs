//! A mesh of a lattice with as many triangles as asked for, by a tolerance.

use super::lattice::Lattice;
use super::level::{LevelSurface, keep_volume, measure};
use super::{FractionTree, factor_of, finest_cell};
use crate::contour::ContourOptions;
use crate::error::{Error, Result};
use crate::progress::Progress;
use crate::store::BrickTree;
use std::cmp::Reverse;

/// The share of the triangles asked for that a mesh has at least.
pub(super) const LEAST_SHARE: f64 = 0.9;
/// The share that is aimed at.
pub(super) const AIM: f64 = 0.96;
/// The largest where coarser lattices have no surface, as of infill whose lines are closer than cells.
pub(super) const LAST_TOLERANCE: f64 = 1.0;
/// By how much of its volume a mesh may be off while another may be nearer.
pub(super) const MOST_OFF: f64 = 1e-3;
/// Tolerances that are tried at most.
const TRIES: usize = 9;
/// The same for meshes that could be written.
const TRIES_WRITTEN: usize = 6;
/// A tolerance of so many cells merges what is flat and moves nothing by more than crossings are rounded.
pub(super) const FLAT: f64 = 1e-3;
/// Fractions that would only make the number right may take so many bytes.
const OPTIONAL_BYTES: u64 = 256 << 20;

/// By how much it may be off and yet be better than one with too few triangles.
pub(super) const TOLERABLE_OFF: f64 = 1e-2;

/// A mesh of about the size asked for, not written yet.
pub struct SizedMesh {
    /// The fractions that it is a surface of; `None` if it is the surface of the tree's own cells.
    pub lattice: Option<Lattice>,
    /// The surface.
    pub kept: LevelSurface,
    /// How far it may move for the sake of fewer triangles.
    pub tolerance: f64,
    /// Edge of the tree's finest cells.
    finest: f64,
}

/// What a mesh is contoured from.
pub enum SizedTree<'a> {
    /// The tree's own cells.
    Own(&'a dyn BrickTree),
    /// Fractions of it.
    Fractions(FractionTree<'a>),
}

impl SizedTree<'_> {
    /// As a tree that can be contoured.
    pub fn as_tree(&self) -> &dyn BrickTree {
        match self {
            SizedTree::Own(tree) => *tree,
            SizedTree::Fractions(tree) => tree,
        }
    }
}

impl SizedMesh {
    /// A surface of the fractions of a tree.
    pub fn of_fractions(
        lattice: Lattice,
        kept: LevelSurface,
        tolerance: f64,
        tree: &dyn BrickTree,
    ) -> SizedMesh {
        SizedMesh { lattice: Some(lattice), kept, tolerance, finest: finest_cell(tree) }
    }

    /// The surface of a tree's own cells.
    pub(super) fn of_own(kept: LevelSurface, tolerance: f64, tree: &dyn BrickTree) -> SizedMesh {
        SizedMesh { lattice: None, kept, tolerance, finest: finest_cell(tree) }
    }

    /// What is to be contoured. The tree is the one of which it was made.
    pub fn tree<'a>(&'a self, whole: &'a dyn BrickTree) -> SizedTree<'a> {
        match &self.lattice {
            Some(lattice) => SizedTree::Fractions(FractionTree::new(lattice, self.kept.depth)),
            None => SizedTree::Own(whole),
        }
    }

    /// Edge of its cells.
    pub fn cell(&self) -> f64 {
        self.lattice.as_ref().map_or(self.finest, Lattice::cell)
    }

    /// How many of the finest cells an axis are one of its cells.
    pub fn factor(&self) -> u32 {
        self.lattice.as_ref().map_or(1, Lattice::factor)
    }

    /// Samples in one of its cells, along an axis.
    pub fn samples_per_cell(&self) -> u32 {
        self.lattice.as_ref().map_or(1, Lattice::samples_per_cell)
    }

    pub(super) fn bytes(&self) -> u64 {
        self.lattice.as_ref().map_or(0, Lattice::bytes)
    }

    /// Whether only what is flat was merged: more triangles would be no nearer to the part in these cells.
    pub fn is_flat(&self) -> bool {
        self.tolerance > 0.0 && self.tolerance <= FLAT * self.cell()
    }

    /// Whether it is the surface of the tree's own cells: nothing is nearer to that.
    pub fn is_own(&self) -> bool {
        self.lattice.is_none()
    }

    /// By which share of the volume it is off.
    pub(super) fn off(&self, request: &DetailRequest<'_>) -> f64 {
        let volume = request.volume.or(self.lattice.as_ref().map(Lattice::volume));
        volume.map_or(0.0, |volume| (self.kept.summary.volume / volume - 1.0).abs())
    }

    /// How near it is to what is asked for.
    pub(super) fn fit(&self, request: &DetailRequest<'_>) -> Fit {
        let triangles = self.kept.summary.triangles;
        let is_enough = triangles as f64 >= LEAST_SHARE * request.most as f64;
        let parts = |share: f64| (share * 1e9) as u64;
        let off = parts(self.off(request));
        match is_enough {
            true if off <= parts(MOST_OFF) => Fit::Both(triangles),
            true if off <= parts(TOLERABLE_OFF) => Fit::Number(Reverse(off)),
            _ if off <= parts(MOST_OFF) => Fit::Volume(triangles),
            _ => Fit::Neither(Reverse(off)),
        }
    }
}

/// What of a request a mesh holds, the least first.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Fit {
    /// Neither; by how many parts in 10⁹ of the volume it is off.
    Neither(Reverse<u64>),
    /// Not the number of triangles, which it has.
    Volume(u64),
    /// The number, and nearly the volume.
    Number(Reverse<u64>),
    Both(u64),
}

/// The fewest triangles that were seen.
pub(super) struct Fewest {
    /// Of a mesh that could be written.
    pub written: u64,
    /// The same, or of one whose triangles may meet.
    triangles: u64,
    /// The factor of the lattice that these are of.
    pub factor: u32,
}

impl Fewest {
    /// None yet.
    pub fn none() -> Fewest {
        Fewest { written: u64::MAX, triangles: u64::MAX, factor: 0 }
    }

    /// What could be written, without the lattice.
    pub fn written_alone(self) -> Fewest {
        Fewest { written: self.written, ..Fewest::none() }
    }

    /// No triangles are no surface.
    fn note(&mut self, triangles: u64, lattice: &Lattice) {
        if triangles > 0 && triangles < self.triangles {
            (self.triangles, self.factor) = (triangles, lattice.factor());
        }
    }

    /// Of a mesh that could be written.
    pub fn note_written(&mut self, triangles: u64) {
        if triangles > 0 {
            self.written = self.written.min(triangles);
        }
    }
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

/// What `make` makes within so many bytes; `None` if that takes more than what is not needed may take. Whether it does must not
/// depend on the memory, so less than that is refused.
pub(super) fn optional<T>(available: u64, make: impl FnOnce(u64) -> Result<T>) -> Result<Option<T>> {
    match make(available.min(OPTIONAL_BYTES)) {
        Err(Error::Setting { .. }) if available >= OPTIONAL_BYTES => Ok(None),
        made => made.map(Some),
    }
}

/// The factor with which the root has four coarse cells an axis.
pub(super) fn most_factor(tree: &dyn BrickTree) -> f64 {
    factor_of(tree, tree.root().edge / 4.0).map_or(1.0, f64::from)
}

/// A surface of a lattice with as many triangles as asked for; `None` if no tolerance makes so few. The tree is the one of
/// which the lattice was made.
pub(super) fn fitted(
    tree: &dyn BrickTree,
    lattice: Lattice,
    request: &DetailRequest<'_>,
    (most_tolerance, fewest): (f64, &mut Fewest),
    progress: &dyn Progress,
) -> Result<Option<SizedMesh>> {
    let volume = request.volume.unwrap_or(lattice.volume());
    let options = ContourOptions { tolerance: 0.0, ..request.options.clone() };
    let kept = keep_volume(&lattice, volume, None, &options, progress)?;
    let all = kept.summary.triangles;
    fewest.note(all, &lattice);
    fewest.note_written(all);
    if all == 0 {
        return Ok(None);
    }
    if all <= request.most {
        return Ok(Some(SizedMesh::of_fractions(lattice, kept, 0.0, tree)));
    }
    let search = Tolerances::new(lattice.cell(), most_tolerance);
    let Some(tolerance) = foreseen_tolerance((&lattice, kept.depth), request, search, fewest, progress)?
    else {
        return Ok(None);
    };
    let best = written((&lattice, kept.depth, volume), request, tolerance, fewest, progress)?;
    Ok(best.map(|(kept, tolerance)| SizedMesh::of_fractions(lattice, kept, tolerance, tree)))
}

/// A tolerance with about as many triangles as asked for; `None` if none makes so few.
fn foreseen_tolerance(
    (lattice, depth): (&Lattice, f64),
    request: &DetailRequest<'_>,
    mut search: Tolerances,
    fewest: &mut Fewest,
    progress: &dyn Progress,
) -> Result<Option<f64>> {
    let mut tolerance = search.first();
    for _ in 0..TRIES {
        let tree = FractionTree::new(lattice, depth);
        // Few merges are taken back because triangles meet.
        let quick = ContourOptions { intersection_free: false, tolerance, ..request.options.clone() };
        let triangles = measure(&tree, &quick, progress)?.triangles;
        fewest.note(triangles, lattice);
        let share = triangles as f64 / request.most as f64;
        let is_flat = share <= AIM && tolerance <= search.flat;
        if is_flat || (LEAST_SHARE + 0.005..=AIM + 0.02).contains(&share) {
            break;
        }
        match search.next(tolerance, share) {
            Some(next) => tolerance = next,
            None => return Ok(None),
        }
    }
    Ok(Some(tolerance))
}

/// The mesh that is written, and its tolerance, from one that was foreseen; `None` if it has more triangles than asked for.
fn written(
    (lattice, depth, volume): (&Lattice, f64, f64),
    request: &DetailRequest<'_>,
    foreseen: f64,
    fewest: &mut Fewest,
    progress: &dyn Progress,
) -> Result<Option<(LevelSurface, f64)>> {
    let mut options = ContourOptions { tolerance: foreseen, ..request.options.clone() };
    // The volume is kept by the mesh that is written, which has a few more triangles.
    let mut best: Option<(LevelSurface, f64)> = None;
    let (mut low, mut high) = (None, None);
    for _ in 0..TRIES_WRITTEN {
        let tolerance = options.tolerance;
        let kept = keep_volume(lattice, volume, Some(depth), &options, progress)?;
        let triangles = kept.summary.triangles;
        fewest.note_written(triangles);
        if triangles > request.most {
            low = Some(tolerance);
        } else {
            high = Some(tolerance);
            if best.as_ref().is_none_or(|(best, _)| triangles > best.summary.triangles) {
                best = Some((kept, tolerance));
            }
            let is_enough = triangles as f64 >= LEAST_SHARE * request.most as f64;
            if is_enough || tolerance <= FLAT * lattice.cell() {
                break;
            }
        }
        options.tolerance = match (low, high) {
            (Some(low), Some(high)) => (low * high).sqrt(),
            (Some(low), None) => 1.1 * low,
            (None, _) => (tolerance / 1.1).max(FLAT * lattice.cell()),
        };
    }
    Ok(best)
}

/// The search for a tolerance.
struct Tolerances {
    /// One with too many triangles.
    low: f64,
    /// One with too few.
    high: Option<f64>,
    /// The least that is tried: it merges what is flat.
    flat: f64,
    /// The largest that may be tried.
    largest: f64,
}

impl Tolerances {
    /// In cells of some edge, up to so many of them.
    fn new(cell: f64, largest: f64) -> Tolerances {
        Tolerances { low: 0.0, high: None, flat: FLAT * cell, largest: largest * cell }
    }

    /// The one to try first.
    fn first(&self) -> f64 {
        20.0 * self.flat
    }

    /// The tolerance to try after one that made so many times the triangles asked for; `None` if none is large enough.
    fn next(&mut self, tolerance: f64, share: f64) -> Option<f64> {
        if share > AIM {
            self.low = self.low.max(tolerance);
        } else {
            self.high = Some(self.high.map_or(tolerance, |high| high.min(tolerance)));
        }
        match self.high {
            // Flat faces may take away as many at any tolerance.
            Some(_) if self.low == 0.0 => Some(self.flat),
            Some(high) => Some((self.low.max(high * 0.02) * high).sqrt().max(0.5 * self.low)),
            None if tolerance >= self.largest => None,
            None => Some((tolerance * (1.5 * share / AIM).clamp(1.3, 4.0)).min(self.largest)),
        }
    }
}
