//! The detail at which a mesh has so many triangles.

use super::FractionTree;
use super::fitted::{
    DetailRequest, Fewest, Fit, LAST_TOLERANCE, MOST_OFF, SizedMesh, TOLERABLE_OFF, fitted, most_factor,
    optional,
};
use super::lattice::{Lattice, fine_fractions, fractions};
use super::level::depth_of;
use super::nearest::{nearer, nearest};
use crate::error::{Error, Result};
use crate::progress::Progress;
use crate::store::BrickTree;

/// Edges that change sign tell triangles to a few per cent: this share of them is no less than [`LEAST_SHARE`].
const SURE_SHARE: f64 = 0.95;
/// Each detail that is tried is larger than the one before by this.
const STEP: f64 = 1.1;
/// Factors are multiples of no more than this part of the smallest.
const FINEST_STEP: u32 = 4;
/// How far down details are tried in one reading of the leaves, and how far up in the first.
const REACH: f64 = 2.2;
/// The largest tolerance in coarse cells: beyond it a coarser lattice is nearer to the part for as many triangles.
const MOST_TOLERANCE: f64 = 0.3;
/// Finer lattices that are tried at most where a tolerance of nothing takes too much.
const FINER: usize = 6;

/// A mesh of at most so many triangles and no less than nine tenths of them, where there are so many. Of a part of faces it is
/// the nearest to that. Of others it is that of the coarsest lattice that has more of them, and a tolerance that takes away the
/// rest.
///
/// # Errors
/// [`Error::Setting`] if no mesh has so few; as [`fractions`] and [`crate::contour::contour`].
pub fn of_triangles(
    tree: &dyn BrickTree,
    request: DetailRequest<'_>,
    progress: &dyn Progress,
) -> Result<SizedMesh> {
    let mut fewest = Fewest::none();
    let near = nearest(tree, &request, &mut fewest, progress)?;
    // What it tried need not be tried once more.
    fewest = fewest.written_alone();
    match near {
        Some(near) if near.off(&request) <= MOST_OFF => Ok(near),
        Some(near) => {
            let memory = request.memory.saturating_sub(near.bytes());
            let request = DetailRequest { memory, ..request };
            let found = of_coarsest(tree, &request, &mut fewest, progress)?;
            let Some(found) = found else { return Ok(near) };
            if [&near, &found].iter().all(|made| made.off(&request) <= TOLERABLE_OFF) {
                return nearer(tree, &request, [near, found], progress);
            }
            Ok(if found.fit(&request) > near.fit(&request) { found } else { near })
        }
        None => {
            let found = of_coarsest(tree, &request, &mut fewest, progress)?;
            found.ok_or_else(|| too_few(request.most, &fewest))
        }
    }
}

/// The mesh of the coarsest lattice, and of others if that does not meet what is asked for.
///
/// Between two whole numbers of cells triangles may be too many and too few. Then numbers between them follow that were left
/// out, and the cells of the coarser one are sampled more finely. Where flat faces alone take away too much, finer lattices follow.
fn of_coarsest(
    tree: &dyn BrickTree,
    request: &DetailRequest<'_>,
    fewest: &mut Fewest,
    progress: &dyn Progress,
) -> Result<Option<SizedMesh>> {
    let Some(mut found) = coarsest(tree, request, fewest, progress)? else { return Ok(None) };
    let is_done = |found: &SizedMesh| matches!(found.fit(request), Fit::Both(_));
    if is_done(&found) || found.factor() == 1 {
        return Ok(Some(found));
    }
    if found.is_flat() {
        found = finer(tree, found, request, progress)?;
    }
    for cells in between(found.factor()).into_iter().chain(well_sampled(found.factor())) {
        if is_done(&found) || found.is_flat() {
            break;
        }
        found = in_other_cells(tree, found, cells, request, progress)?;
    }
    Ok(Some(found))
}

/// The coarsest lattice that has enough triangles, and a tolerance that takes away the rest; coarser ones, if that does not
/// reach or takes too much of the volume.
fn coarsest(
    tree: &dyn BrickTree,
    request: &DetailRequest<'_>,
    fewest: &mut Fewest,
    progress: &dyn Progress,
) -> Result<Option<SizedMesh>> {
    let (mut lattice, mut larger) = first_lattice(tree, request, progress)?;
    let mut best: Option<SizedMesh> = None;
    loop {
        let factor = f64::from(lattice.factor());
        if let Some(found) = fitted(tree, lattice, request, (MOST_TOLERANCE, fewest), progress)? {
            let fit = found.fit(request);
            if best.as_ref().is_none_or(|best| fit > best.fit(request)) {
                best = Some(found);
            }
            // Coarser ones have fewer triangles.
            if matches!(fit, Fit::Both(_) | Fit::Volume(_)) {
                larger.clear();
            }
        }
        // The tolerance does not reach, or takes too much: a coarser lattice.
        if larger.is_empty() && best.is_none() && factor * STEP <= most_factor(tree) {
            let factors = factors(factor * STEP, (factor * REACH).min(most_factor(tree)));
            larger = fractions(tree, &factors, request.memory, progress)?;
            larger.reverse();
        }
        lattice = match larger.pop() {
            Some(lattice) => lattice,
            None => break,
        };
    }
    if best.is_none() && fewest.factor > 0 {
        let lattice = fractions(tree, &[fewest.factor], request.memory, progress)?.pop();
        let lattice = lattice.expect("one factor gives one lattice");
        best = fitted(tree, lattice, request, (LAST_TOLERANCE, fewest), progress)?;
    }
    Ok(best)
}

/// The mesh of the finest lattice whose triangles a tolerance brings down to those asked for, or `found` if there is none finer.
fn finer(
    tree: &dyn BrickTree,
    mut found: SizedMesh,
    request: &DetailRequest<'_>,
    progress: &dyn Progress,
) -> Result<SizedMesh> {
    for _ in 0..FINER {
        let factor = found.factor() * 2 / 3;
        if factor == 0 || !found.is_flat() {
            break;
        }
        let available = request.memory.saturating_sub(found.bytes());
        let lattice = optional(available, |bytes| fractions(tree, &[factor], bytes, progress))?;
        let Some(lattice) = lattice.and_then(|mut lattices| lattices.pop()) else { break };
        match fitted(tree, lattice, request, (MOST_TOLERANCE, &mut Fewest::none()), progress)? {
            // Where the volume is kept as well, smaller cells are nearer.
            Some(next) if next.off(request) <= found.off(request).max(MOST_OFF) => found = next,
            _ => break,
        }
    }
    Ok(found)
}

/// Factors below one that were left out on the way to the next smaller one that was tried, with one sample in a cell.
fn between(factor: u32) -> Vec<(u32, u32)> {
    let tried = (f64::from(factor) / STEP) as u32;
    (tried + 1..factor).rev().map(|factor| (factor, 1)).collect()
}

/// Factors of cells with several samples, and how many, that have more triangles than cells of `factor` with one.
fn well_sampled(factor: u32) -> Vec<(u32, u32)> {
    match factor {
        3 => vec![(4, 2), (3, 3)],
        _ => vec![(factor.next_multiple_of(2), 2)],
    }
}

/// The mesh of other cells, with several samples in each or one, or `found` if that is better.
fn in_other_cells(
    tree: &dyn BrickTree,
    found: SizedMesh,
    cells: (u32, u32),
    request: &DetailRequest<'_>,
    progress: &dyn Progress,
) -> Result<SizedMesh> {
    let available = request.memory.saturating_sub(found.bytes());
    let Some(lattice) = optional(available, |bytes| fine_fractions(tree, cells, bytes, progress))? else {
        return Ok(found);
    };
    let next = fitted(tree, lattice, request, (MOST_TOLERANCE, &mut Fewest::none()), progress)?;
    Ok(next.filter(|next| next.fit(request) > found.fit(request)).unwrap_or(found))
}

fn too_few(most: u64, fewest: &Fewest) -> Error {
    if fewest.written == u64::MAX {
        return Error::setting("no cells leave anything of the part", "build it with finer cells");
    }
    Error::setting(
        format!("no mesh of this part with at most {most} triangles was found"),
        format!("ask for more: the fewest that were found are {}", fewest.written),
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
        let held = coarser.iter().map(Lattice::bytes).sum();
        let mut lattices = fractions(tree, &factors, request.memory.saturating_sub(held), progress)?;
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
                // The next ones; those beyond are made when they are needed.
                lattices.truncate(4);
                lattices.reverse();
                coarser = lattices;
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
