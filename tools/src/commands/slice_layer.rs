//! `brickfield slice --layer`: where a layer of the toolpath lies that a store was built from.

use super::open_inputs;
use crate::failure::Failure;
use crate::picture_args::SliceArgs;
use crate::progress::Bars;
use brickfield_engine::Error;
use brickfield_engine::ingest::Input;
use brickfield_engine::lattice::Axis;
use brickfield_engine::section::Plane;
use brickfield_engine::store::Store;
use brickfield_engine::toolpath::Toolpath;
use std::path::{Path, PathBuf};

/// The plane at half the height of a layer, numbered from 1. A store does not tell its layers, so that the toolpath is read
/// again: from where it was as the store was built, or from where the user says.
pub fn plane_of_layer(args: &SliceArgs, layer: u32, store: &Store, bars: &Bars) -> Result<Plane, Failure> {
    let sources = &store.meta().sources;
    let paths: Vec<PathBuf> = match &args.toolpath_file {
        Some(path) => vec![path.clone()],
        None => sources.iter().map(|source| PathBuf::from(&source.path)).collect(),
    };
    if let Some(gone) = paths.iter().find(|path| !path.exists()).filter(|_| args.toolpath_file.is_none()) {
        let what = format!("the store was built from {}, which is not there any more", gone.display());
        let remedy = "say where it is with --toolpath";
        return Err(Error::store(store.path(), "metadata", what, remedy).into());
    }
    let inputs = open_inputs(&paths, &[&args.output], &args.toolpath.options(args.unit)?, bars)?;
    let toolpaths = inputs.iter().map(|input| toolpath(input, store)).collect::<Result<Vec<_>, _>>()?;
    let extents = toolpaths.iter().filter_map(|path| path.extent_of_layer(layer.checked_sub(1)?));
    let extent = extents.reduce(|[a, b], [c, d]| [a.min(c), b.max(d)]);
    let Some([low, high]) = extent else {
        let count = toolpaths.iter().map(|path| path.layers()).max().unwrap_or(0);
        let path = paths.first().map_or(Path::new(""), PathBuf::as_path);
        let what = format!("layer {layer} has no bead");
        return Err(Error::input(path, "layers", what, format!("choose one from 1 to {count}")).into());
    };
    Ok(Plane { axis: Axis::Z, at: (low + high) / 2.0 })
}

/// The toolpath of an input, which must be one of the store's.
pub fn toolpath<'a>(input: &'a Input, store: &Store) -> Result<&'a Toolpath, Failure> {
    let path = input.path();
    let Some(beads) = input.beads() else {
        let what = "is no toolpath, and has no layers";
        return Err(Error::input(path, input.describe(), what, "give the section's height with --z").into());
    };
    let identity = input.identity()?;
    if !store.meta().sources.iter().any(|source| source.blake3 == identity) {
        let what =
            format!("{} was built from another file, or from another version of it", store.path().display());
        let remedy = "give the toolpath that it was built from with --toolpath";
        return Err(Error::input(path, "content", what, remedy).into());
    }
    Ok(beads.swept.toolpath())
}
