//! Trees of whole inputs in memory instead of in a file.

use super::choose::BeadSizes;
use super::cloud::place_cloud;
use super::cloud_inputs::surfels;
use super::memory::{
    build_any_in_memory, build_beads_in_memory, build_cloud_and_soup_in_memory, build_cloud_in_memory,
};
use super::mesh_inputs::{MeshInputs, survey_all};
use super::mixed::{MixedInput, MixedPlace, SortedInputs};
use super::options::BuildOptions;
use super::place::place;
use super::rules::{TreeOptions, require_no_tolerance};
use super::toolpaths::{bead_sources, bounds_of_sources, place_beads};
use crate::error::Result;
use crate::ingest::{CloudInput, Facets, Input, Survey};
use crate::progress::Progress;
use crate::store::MemoryTree;
use crate::toolpath::Toolpath;
use std::path::Path;

/// Trees in memory, for messages.
const IN_MEMORY: &str = "of trees in memory";

/// A tree in memory, and the box around what it was made of.
pub struct TreeInMemory {
    /// The tree: some 70 KB a brick that is not uniform.
    pub tree: MemoryTree,
    /// Least and greatest world coordinates of the inputs.
    pub bounds: ([f64; 3], [f64; 3]),
}

fn tree_options(depth: u8, options: &BuildOptions) -> TreeOptions {
    TreeOptions { depth, refine: options.refine, stddev: options.stddev, tolerance: options.tolerance }
}

/// Builds the tree of meshes and toolpaths in memory, on the threads of the current rayon pool: the bricks are those that
/// [`super::build_opened`] writes with the same options. Memory bounds, shards, identity and devices are for stores.
///
/// # Errors
/// As [`super::build_opened`]; [`Error::Setting`](crate::error::Error::Setting) where walls thinner than a cell are asked for.
pub fn build_inputs_in_memory(
    inputs: &[Input],
    options: &BuildOptions,
    progress: &dyn Progress,
) -> Result<TreeInMemory> {
    options.thin.require_none(IN_MEMORY)?;
    if options.solids.is_some() {
        return beads_in_memory(inputs, options);
    }
    let surveys = survey_all(inputs, progress)?;
    let bounds = Survey::bounds_of_all(&surveys);
    let (root, depth) = place(inputs.first().map(Input::path), bounds.0, bounds.1, options.resolution)?;
    let mut meshes = MeshInputs::given(inputs);
    meshes.turn(root, options, progress)?;
    let (how, error) = (tree_options(depth, options), options.gwn_error);
    let tree = meshes.with_soups(|soups| build_any_in_memory(soups, root, how, error))?;
    meshes.check()?;
    Ok(TreeInMemory { tree, bounds })
}

fn beads_in_memory(inputs: &[Input], options: &BuildOptions) -> Result<TreeInMemory> {
    let outline = options.solids.unwrap_or_default();
    let sources = bead_sources(inputs)?;
    let bounds = bounds_of_sources(&sources, outline)?;
    let paths: Vec<&Toolpath> = sources.iter().map(|source| source.toolpath).collect();
    let first = sources.first().map(|source| Path::new(&source.source.path));
    let (root, depth) = place_beads(first, bounds, options.resolution, BeadSizes::of(&paths).as_ref())?;
    let tree = build_beads_in_memory(&paths, (outline, options.count), root, tree_options(depth, options))?;
    Ok(TreeInMemory { tree, bounds })
}

/// Builds the tree of point clouds in memory; see [`super::build_clouds`].
///
/// # Errors
/// As [`super::build_clouds`]; [`Error::Setting`](crate::error::Error::Setting) where walls thinner than a cell are asked for.
pub fn build_clouds_in_memory(
    inputs: Vec<CloudInput>,
    estimate: bool,
    options: &BuildOptions,
    progress: &dyn Progress,
) -> Result<TreeInMemory> {
    options.thin.require_none(IN_MEMORY)?;
    require_no_tolerance(options.tolerance, super::rules::POINTS)?;
    let first = inputs.first().map(|input| input.path().to_owned());
    let surfels = surfels(inputs, estimate, progress)?;
    let (root, depth) = place_cloud(&surfels, first.as_deref(), options.resolution)?;
    let bounds = surfels.points;
    let tree = build_cloud_in_memory(surfels, root, tree_options(depth, options), options.gwn_error)?;
    Ok(TreeInMemory { tree, bounds })
}

/// Builds the tree of meshes and point clouds together in memory; see [`super::build_mixed`].
///
/// # Errors
/// As [`super::build_mixed`]; [`Error::Setting`](crate::error::Error::Setting) where walls thinner than a cell are asked for.
pub fn build_mixed_in_memory(
    inputs: Vec<MixedInput>,
    estimate: bool,
    options: &BuildOptions,
    progress: &dyn Progress,
) -> Result<TreeInMemory> {
    options.thin.require_none(IN_MEMORY)?;
    let SortedInputs { meshes, clouds, .. } = SortedInputs::of(inputs)?;
    let surveys = survey_all(&meshes, progress)?;
    let surfels = surfels(clouds, estimate, progress)?;
    let first = meshes.first().map(Input::path);
    let MixedPlace { bounds, root, depth } = MixedPlace::of(&surveys, &surfels, first, options.resolution)?;
    let mut meshes = MeshInputs::given(&meshes);
    meshes.turn(root, options, progress)?;
    let (how, error) = (tree_options(depth, options), options.gwn_error);
    let build = |soups: &[&dyn Facets]| build_cloud_and_soup_in_memory(surfels, soups, root, how, error);
    let tree = meshes.with_soups(build)?;
    meshes.check()?;
    Ok(TreeInMemory { tree, bounds })
}
