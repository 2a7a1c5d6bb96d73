//! Small trees in memory, without a store.

use super::field::PieceField;
use super::jobs::build_tree;
use super::mixed::{self, MIXED};
use super::open::OpenSoup;
use super::resources::SpillResources;
use super::rules::{OPEN, POINTS, Rules, SOLIDS, TreeOptions, require_no_tolerance};
use super::scope::{BuildPlan, sort_cubes};
use super::snap::snap;
use super::solids::sort_segments;
use super::sorted::SortedPieces;
use super::soup::Soup;
use crate::brick::Count;
use crate::error::{Error, Result};
use crate::ingest::Facets;
use crate::lattice::RootCube;
use crate::progress::Silent;
use crate::solid::{Outline, Solids};
use crate::store::{MemoryTree, Records};
use crate::toolpath::Toolpath;
use crate::winding::{CloudBricks, MixedField, OpenPart, Surfels};
use std::sync::Mutex;

/// Builds the tree of a closed soup in memory: 70 KB per brick that is not uniform.
///
/// # Errors
/// [`Error::Setting`] if the soup is not closed or overlaps itself more than 32,767-fold.
pub fn build_in_memory(sources: &[&dyn Facets], root: RootCube, options: TreeOptions) -> Result<MemoryTree> {
    build_with(sources, root, &Rules::new(options, root)?)
}

/// Builds the tree of any soup in memory, with samples that are off by at most `error`.
///
/// # Errors
/// [`Error::Setting`] if 16 bits are not enough for the winding numbers with that error.
pub fn build_open_in_memory(
    sources: &[&dyn Facets],
    root: RootCube,
    options: TreeOptions,
    error: f64,
) -> Result<MemoryTree> {
    build_any_in_memory(sources, root, options, error)
}

/// Builds the tree of a point cloud in memory, with samples that are off by at most `error`.
///
/// # Errors
/// As [`build_open_in_memory`].
pub fn build_cloud_in_memory(
    surfels: Surfels,
    root: RootCube,
    options: TreeOptions,
    error: f64,
) -> Result<MemoryTree> {
    require_no_tolerance(options.tolerance, POINTS)?;
    let rules = Rules { evaluate_interior: true, ..Rules::new(options, root)? };
    let field = CloudBricks::new(surfels, root, error, rules.depth)?;
    tree_of(&field, SortedPieces::of_all(&field, &field.numbers()), &rules, root)
}

/// Builds the tree of a point cloud and any soup together in memory, with samples that are off by at most `error`.
///
/// # Errors
/// As [`build_open_in_memory`].
pub fn build_cloud_and_soup_in_memory(
    surfels: Surfels,
    sources: &[&dyn Facets],
    root: RootCube,
    options: TreeOptions,
    error: f64,
) -> Result<MemoryTree> {
    require_no_tolerance(options.tolerance, MIXED)?;
    let rules = Rules { evaluate_interior: true, ..Rules::new(options, root)? };
    let cubes = (sort_cubes(&rules), rules.sieved());
    let soup = snap(sources, root, cubes, &SpillResources::unbounded(), &Silent)?;
    let open = match soup.balance.is_closed() {
        true => None,
        false => Some(OpenPart::of(sources, root, &Silent)?),
    };
    let mut triangles = Vec::new();
    soup.sorted.gather(0, &mut triangles)?;
    let field = MixedField::new(surfels, open, root, error, rules.depth)?;
    let balls: Vec<_> = field.cloud().pieces().collect();
    tree_of(&field, mixed::gather(&field, &triangles, &balls), &rules, root)
}

/// Builds the tree of the beads of toolpaths, as analytic solids, in memory.
///
/// # Errors
/// [`Error::Setting`] if more than 32,767 passes or beads overlap.
pub fn build_beads_in_memory(
    paths: &[&Toolpath],
    (outline, count): (Outline, Count),
    root: RootCube,
    options: TreeOptions,
) -> Result<MemoryTree> {
    require_no_tolerance(options.tolerance, SOLIDS)?;
    let rules = Rules::new(options, root)?;
    let (solids, segments) = Solids::new(paths, root, outline, count)?;
    let sorted = sort_segments(&solids, &segments, sort_cubes(&rules), &Silent)?;
    tree_of(&solids, sorted, &rules, root)
}

/// Builds the tree of any soup in memory: exact if it is closed, else with samples that are off by at most `error`.
///
/// # Errors
/// As [`build_in_memory`] or [`build_open_in_memory`].
pub(super) fn build_any_in_memory(
    sources: &[&dyn Facets],
    root: RootCube,
    options: TreeOptions,
    error: f64,
) -> Result<MemoryTree> {
    let rules = Rules::new(options, root)?;
    let cubes = sort_cubes(&rules);
    let soup = snap(sources, root, (cubes, rules.sieved()), &SpillResources::unbounded(), &Silent)?;
    if soup.balance.is_closed() {
        return tree_of(&Soup::CPU, soup.sorted, &rules, root);
    }
    require_no_tolerance(options.tolerance, OPEN)?;
    let rules = Rules { evaluate_interior: !rules.refines_all_touched(), ..rules };
    let mut sorted = soup.sorted;
    let open = OpenSoup::close(sources, root, (error, rules.depth), (u64::MAX, None), &Silent)?;
    sorted.push(&Soup::CPU, &cubes, open.caps());
    tree_of(&Soup { device: None, open: Some(open) }, sorted, &rules, root)
}

pub(super) fn build_with(sources: &[&dyn Facets], root: RootCube, rules: &Rules) -> Result<MemoryTree> {
    let soup =
        snap(sources, root, (sort_cubes(rules), rules.sieved()), &SpillResources::unbounded(), &Silent)?;
    if !soup.balance.is_closed() {
        return Err(Error::setting("the soup has open edges", "close it"));
    }
    tree_of(&Soup::CPU, soup.sorted, rules, root)
}

fn tree_of<F: PieceField>(
    field: &F,
    sorted: SortedPieces<F>,
    rules: &Rules,
    root: RootCube,
) -> Result<MemoryTree> {
    let mut tree = MemoryTree::new(root);
    let rules = &Rules { compression: None, ..*rules };
    build_tree(
        field,
        sorted,
        BuildPlan { rules, shard: None, kept: None, thin: &Mutex::default() },
        u64::MAX,
        &Silent,
        &mut |records: Records| {
            records.insert(&mut tree);
            Ok(0)
        },
    )?;
    Ok(tree)
}
