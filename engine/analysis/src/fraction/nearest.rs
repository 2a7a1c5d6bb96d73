//! The nearest mesh with so many triangles, of parts whose surface is made of faces.
//!
//! Flat faces merge without moving, and smooth ones by a tolerance of a cell. So of such a part small cells with a tolerance
//! are nearer than large ones without. Beads are another matter: their channels do not merge.

use super::distance::distances;
use super::fitted::{DetailRequest, FLAT, Fewest, LAST_TOLERANCE, MOST_OFF, SizedMesh, fitted, optional};
use super::lattice::{Lattice, fractions};
use super::level::{LevelSurface, measure};
use super::sharp::planes;
use super::{FractionTree, finest_cell};
use crate::analysis::volume;
use crate::contour::{ContourOptions, DiscardSink, MeshArrays, contour};
use crate::error::Result;
use crate::progress::{Progress, Silent};
use crate::store::{BrickTree, LeafOrder};

/// A surface of so many triangles is contoured in a moment.
const QUICK: u64 = 300_000;
/// Cells are so large at first that their triangles are as many as these.
const FIRST: u64 = 20_000;
/// Or, if that is more, so many times those asked for.
const FIRST_SHARE: f64 = 2.0;
/// Cells that are tried next are larger or smaller by this.
const STEP: f64 = 1.5;
/// Lattices that are tried at most.
const RUNGS: usize = 12;
/// By so much of a cell the surface of the tree's own cells is not known.
const UNKNOWN: f64 = 0.1;
/// Tolerances of these.
const OWN_TOLERANCES: [f64; 3] = [FLAT, 0.01, UNKNOWN];
/// These take away no more than all but a part of so many.
const OWN_SHARE: f64 = 4.0;
/// Leaves in which planes are looked at.
const LOOKED_AT: usize = 64;
/// The share of samples beside the surface at which planes agree, of a part of faces.
const LEAST_AGREEING: f64 = 0.5;
/// Flat faces of the first cells may have so many times the triangles asked for, and those of the tree's own cells no more than these.
const FLAT_SHARE: f64 = 2.0;
/// Meshes of more triangles than this are not compared by their distances.
const COMPARED: u64 = 100_000;
/// How far around points of a mesh the part is looked for, in cells of the larger ones.
const REACH: f64 = 2.0;

/// The nearest mesh of a part of faces with at most so many triangles: that of its own cells with flat faces merged, or of the
/// smallest cells whose triangles a tolerance of a cell takes down to those; `None` of other parts, and if there is none.
pub(super) fn nearest(
    tree: &dyn BrickTree,
    request: &DetailRequest<'_>,
    fewest: &mut Fewest,
    progress: &dyn Progress,
) -> Result<Option<SizedMesh>> {
    let first = first_factor(request);
    if request.of_all == 0 || !has_faces(tree, first)? {
        return Ok(None);
    }
    let is_quick = request.of_all <= QUICK;
    if is_quick && let Some(own) = own(tree, request, fewest, progress)? {
        return Ok(Some(own));
    }
    let mut search = Search { tree, request, fewest, progress, best: None };
    if search.rung(first)? {
        search.smaller(first, is_quick)?;
    } else {
        search.larger(first)?;
        search.last(first, is_quick)?;
    }
    Ok(search.best)
}

/// How many of the finest cells an axis a cell is with which the search begins.
fn first_factor(request: &DetailRequest<'_>) -> u32 {
    let triangles = (FIRST_SHARE * request.most as f64).max(FIRST as f64);
    ((request.of_all as f64 / triangles).sqrt().round() as u32).max(1)
}

/// Whether planes agree at most samples of cells that are so many of the finest wide. Some leaves tell it, evenly along the tree.
fn has_faces(tree: &dyn BrickTree, factor: u32) -> Result<bool> {
    let order = LeafOrder::new(tree)?;
    let is_passed = |key: &&_| tree.node(**key).is_some_and(|node| node.min < 1 && node.max >= 1);
    let passed: Vec<_> = order.keys().iter().filter(is_passed).copied().collect();
    let count = passed.len().min(LOOKED_AT);
    let mut sums = [0; 2];
    for key in (0..count).map(|n| passed[n * passed.len() / count]) {
        let up = tree.deepest_level() - key.level();
        let found = planes(key, &*tree.brick_once(key)?, key.level(), (factor >> up).max(1)).agreeing();
        (0..2).for_each(|n| sums[n] += found[n]);
    }
    let [agreeing, others] = sums.map(|sum: u64| sum as f64);
    Ok(agreeing > 0.0 && agreeing >= LEAST_AGREEING * (agreeing + others))
}

/// The surface of the tree's own cells with flat faces merged, and what is as good as flat; `None` if it has too many triangles
/// or does not hold the volume.
fn own(
    tree: &dyn BrickTree,
    request: &DetailRequest<'_>,
    fewest: &mut Fewest,
    progress: &dyn Progress,
) -> Result<Option<SizedMesh>> {
    let there = request.volume.map_or_else(|| Ok(volume(tree, progress)?.union), Ok)?;
    for cells in OWN_TOLERANCES {
        let tolerance = cells * finest_cell(tree);
        let options = ContourOptions { tolerance, ..request.options.clone() };
        let summary = contour(tree, &options, &mut DiscardSink, progress)?;
        let is_held = (summary.volume - there).abs() <= MOST_OFF * there;
        if summary.triangles == 0 || !is_held {
            break;
        }
        fewest.note_written(summary.triangles);
        if summary.triangles <= request.most {
            let kept = LevelSurface { depth: 0.0, fraction: 0.5, summary, is_near: true };
            return Ok(Some(SizedMesh::of_own(kept, tolerance, tree)));
        }
        // Curved faces have too many, whatever the tolerance.
        if summary.triangles as f64 > OWN_SHARE * request.most as f64 {
            break;
        }
    }
    Ok(None)
}

/// The search among cells.
struct Search<'a> {
    tree: &'a dyn BrickTree,
    request: &'a DetailRequest<'a>,
    fewest: &'a mut Fewest,
    progress: &'a dyn Progress,
    best: Option<SizedMesh>,
}

impl Search<'_> {
    /// Tries cells of some width, and keeps the better mesh. Returns whether there is one.
    fn rung(&mut self, factor: u32) -> Result<bool> {
        let held = self.best.as_ref().and_then(|best| best.lattice.as_ref()).map_or(0, Lattice::bytes);
        let available = self.request.memory.saturating_sub(held);
        let make = |bytes| fractions(self.tree, &[factor], bytes, self.progress);
        let Some(lattice) = optional(available, make)?.and_then(|mut made| made.pop()) else {
            return Ok(false);
        };
        let limits = (LAST_TOLERANCE, &mut *self.fewest);
        let Some(next) = fitted(self.tree, lattice, self.request, limits, self.progress)? else {
            return Ok(false);
        };
        self.best = Some(match self.best.take() {
            None => next,
            Some(best) => self.better(best, next)?,
        });
        Ok(true)
    }

    /// Smaller cells, as long as flat faces alone take their triangles down to those asked for.
    fn smaller(&mut self, first: u32, own_is_known: bool) -> Result<()> {
        let mut factor = first;
        for _ in 0..RUNGS {
            if !self.best.as_ref().is_some_and(|best| best.is_flat() && best.factor() == factor) {
                return Ok(());
            }
            if factor == 1 {
                break;
            }
            if self.is_near()? {
                return Ok(());
            }
            factor = (f64::from(factor) / STEP) as u32;
            if !self.rung(factor)? {
                return Ok(());
            }
        }
        if factor == 1
            && !own_is_known
            && let Some(own) = own(self.tree, self.request, self.fewest, self.progress)?
        {
            self.best = Some(own);
        }
        Ok(())
    }

    /// Whether the best mesh is as near to the part as that is known: then smaller cells gain nothing.
    fn is_near(&self) -> Result<bool> {
        let Some(best) = self.best.as_ref().filter(|best| best.kept.summary.triangles <= COMPARED) else {
            return Ok(false);
        };
        let away = away(self.tree, self.request, (best, REACH * best.cell()), self.progress)?;
        Ok(away <= UNKNOWN * finest_cell(self.tree) && best.off(self.request) <= MOST_OFF)
    }

    /// Larger cells, until a tolerance takes their triangles down to those asked for, and the next larger ones.
    fn larger(&mut self, first: u32) -> Result<()> {
        let most = super::fitted::most_factor(self.tree) as u32;
        let mut factor = first;
        for _ in 0..RUNGS {
            let was_found = self.best.is_some();
            factor = (f64::from(factor) * STEP).ceil() as u32;
            if factor > most {
                break;
            }
            self.rung(factor)?;
            if was_found {
                break;
            }
        }
        Ok(())
    }

    /// The tree's own cells, where no others do and flat faces of the first ones have about as many triangles as asked for.
    fn last(&mut self, first: u32, own_is_known: bool) -> Result<()> {
        let is_held = |best: &SizedMesh| best.off(self.request) <= MOST_OFF;
        if own_is_known || self.best.as_ref().is_some_and(is_held) {
            return Ok(());
        }
        let make = |bytes| fractions(self.tree, &[first], bytes, self.progress);
        let made = optional(self.request.memory, make)?.and_then(|mut made| made.pop());
        let Some(lattice) = made else { return Ok(()) };
        let tolerance = FLAT * lattice.cell();
        let quick = ContourOptions { intersection_free: false, tolerance, ..self.request.options.clone() };
        let flat = measure(&FractionTree::new(&lattice, 0.0), &quick, self.progress)?.triangles;
        // Smaller cells have no fewer, but for a few at edges.
        if flat as f64 <= FLAT_SHARE * self.request.most as f64
            && let Some(own) = own(self.tree, self.request, self.fewest, self.progress)?
        {
            self.best = Some(own);
        }
        Ok(())
    }

    /// The better one of two meshes: the one that holds the volume, and the nearer one if both do.
    fn better(&self, a: SizedMesh, b: SizedMesh) -> Result<SizedMesh> {
        let (fine, coarse) = if a.factor() < b.factor() { (a, b) } else { (b, a) };
        let [fine_holds, coarse_holds] = [&fine, &coarse].map(|made| made.off(self.request) <= MOST_OFF);
        if fine_holds == coarse_holds {
            return nearer(self.tree, self.request, [fine, coarse], self.progress);
        }
        Ok(if coarse_holds { coarse } else { fine })
    }
}

/// The one of two meshes that is nearer to the part; the first if they are too large to be compared.
pub(super) fn nearer(
    tree: &dyn BrickTree,
    request: &DetailRequest<'_>,
    [first, second]: [SizedMesh; 2],
    progress: &dyn Progress,
) -> Result<SizedMesh> {
    if [&first, &second].iter().any(|made| made.kept.summary.triangles > COMPARED) {
        return Ok(first);
    }
    let reach = REACH * first.cell().max(second.cell());
    let away = |made| away(tree, request, (made, reach), progress);
    Ok(if away(&second)? < away(&first)? { second } else { first })
}

/// How far a mesh and the part are from each other, but for a thousandth of their points. Nothing farther than `reach` is looked
/// for around points of the mesh.
fn away(
    tree: &dyn BrickTree,
    request: &DetailRequest<'_>,
    (made, reach): (&SizedMesh, f64),
    progress: &dyn Progress,
) -> Result<f64> {
    let mut mesh = MeshArrays::default();
    let options = ContourOptions { tolerance: made.tolerance, ..request.options.clone() };
    contour(made.tree(tree).as_tree(), &options, &mut mesh, &Silent)?;
    let [of_mesh, of_part] = distances(tree, &mesh, (reach, reach), progress)?;
    Ok(of_mesh.of_999.max(of_part.of_999))
}
