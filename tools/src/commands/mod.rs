//! One file a command: what was typed becomes a checked plan, the plan is run.

mod balance;
pub mod beads;
pub mod build;
mod build_plan;
mod build_report;
mod build_volume;
pub mod cache;
pub mod csg;
pub mod deviation;
mod deviation_tables;
pub mod export;
mod finding_colours;
mod findings;
pub mod info;
mod info_cloud;
mod info_devices;
mod info_mesh;
mod info_three_mf;
mod info_toolpath;
mod info_volume;
mod info_x3d;
pub mod layers;
pub mod machine;
pub mod mesh;
mod mesh_check;
mod mesh_close;
mod mesh_detail;
mod mesh_place;
mod mesh_quality;
mod mesh_shells;
mod mesh_tiles;
pub mod offset;
mod operands;
pub mod overlap;
mod reference;
pub mod render;
mod render_splats;
pub mod sample;
pub mod shell;
pub mod slice;
mod slice_layer;
mod splat_picks;
pub mod splats;
pub mod thickness;
mod thickness_volume;
pub mod verify;
#[cfg(feature = "view")]
pub mod view;
mod void_labels;
mod void_mesh;
mod void_outputs;
pub mod voids;
pub mod winding;

use crate::args::IoArg;
use crate::elsewhere::{self, is_address, not_fetched};
use crate::failure::Failure;
use crate::kinds::not_a_store;
use crate::measured::measured;
use crate::output::{require_distinct, warn};
use crate::work::start;
use anyhow::Context;
use brickfield_engine::analysis::Volumes;
use brickfield_engine::ingest::{Input, OpenOptions};
use brickfield_engine::store::{AcceptedStores, BrickTree, Io, Meta, Store, StoreOptions};
use brickfield_engine::toolpath::gcode::GcodeReport;
use brickfield_engine::{Error, Progress};
use std::path::{Path, PathBuf};

/// Decoded bricks that commands keep whose user cannot choose.
const CACHE_BYTES: u64 = 512 << 20;

/// Opens all inputs, having checked that none of them would be overwritten.
fn open_inputs(
    inputs: &[PathBuf],
    outputs: &[&Path],
    options: &OpenOptions,
    progress: &dyn Progress,
) -> Result<Vec<Input>, Failure> {
    let paths: Vec<&Path> = inputs.iter().map(PathBuf::as_path).collect();
    require_distinct(outputs, &paths)?;
    if let Some(path) = paths.iter().find(|path| is_address(path)) {
        return Err(not_fetched(path).into());
    }
    let opened: Vec<Input> =
        inputs.iter().map(|path| Input::open_with(path, options, progress)).collect::<Result<_, Error>>()?;
    for input in &opened {
        let told = |message: String| warn(&format!("{}: {message}", input.path().display()));
        input.warnings().into_iter().for_each(told);
    }
    Ok(opened)
}

/// What was read of the toolpaths among inputs.
fn features_of(inputs: &[Input]) -> impl Iterator<Item = (&Path, &GcodeReport)> {
    inputs.iter().filter_map(|input| Some((input.path(), &input.beads()?.report)))
}

/// Whether samples of a store are fractions, as of open input and point clouds.
fn has_fractions(store: &Store) -> bool {
    store.keys().into_iter().filter_map(|key| store.node(key)).any(|node| node.fractions)
}

/// Refuses a store whose samples are fractions, of which `cannot` be told.
fn require_whole_samples(store: &Store, cannot: &str) -> Result<(), Failure> {
    if !has_fractions(store) {
        return Ok(());
    }
    let what = "it was made from open input or a point cloud, whose samples are not exact";
    let name = crate::output::in_line(store.path());
    Err(anyhow::anyhow!("{name}: {what}, so {cannot}; close the input, or build it from the toolpath").into())
}

/// Opens a store, here or elsewhere; of any other file says what it is and which command wants it.
fn open_store(path: &Path, cache_bytes: u64, io: IoArg, accept: AcceptedStores) -> Result<Store, Error> {
    let io = match io {
        IoArg::Pread => Io::Pread,
        IoArg::Mmap => Io::Mmap,
    };
    let options = StoreOptions { cache_bytes, io, accept };
    if is_address(path) {
        return elsewhere::open(path, options);
    }
    Store::open_with(path, options).map_err(|error| not_a_store(path, error, None))
}

/// Makes the folder, unless it is there.
fn make_folder(path: &Path) -> Result<(), Failure> {
    if path.is_dir() {
        return Ok(());
    }
    let made = std::fs::create_dir(path);
    Ok(made.with_context(|| format!("{}: cannot make the folder", path.display()))?)
}

/// An error in a setting, with the store that it does not fit.
fn of_store(store: &Store, place: &str, error: Error) -> Error {
    match error {
        Error::Setting { what, remedy } => Error::store(store.path(), place, what, remedy),
        error => error,
    }
}

/// An error of what was asked for that names no file, as one of this file.
fn of_file(path: &Path, error: Error) -> anyhow::Error {
    match error {
        Error::Setting { what, remedy } => {
            anyhow::anyhow!("{}: {what}; {remedy}", crate::output::in_line(path))
        }
        error => error.into(),
    }
}

/// The store's unit for messages, or the word for an unknown one.
fn unit_of(meta: &Meta) -> &str {
    if meta.unit.is_empty() { "units" } else { &meta.unit }
}

/// The error of a length with a unit, asked of a store without.
fn no_unit() -> Failure {
    Failure::Usage("the store has no unit of length; give lengths as numbers alone".to_owned())
}

/// Checks a level against the store's deepest.
fn require_level(store: &Store, level: u8) -> Result<(), Failure> {
    let deepest = store.deepest_level();
    if level <= deepest {
        return Ok(());
    }
    let path = store.path().display();
    Err(anyhow::anyhow!("{path}: there is no level {level}; choose one from 0 to {deepest}").into())
}

/// Volumes of a field, for people.
fn volumes_text(volumes: &Volumes, unit: &str) -> String {
    let Volumes { union, overlap, negative, .. } = *volumes;
    let union = measured(union, volumes.union_error);
    let overlap = measured(overlap, volumes.overlap_error);
    let mut text = format!("{union} {unit}³ of union, {overlap} {unit}³ of overlap");
    if negative > 0.0 {
        text += &format!(", {} {unit}³ inside out", measured(negative, volumes.negative_error));
    }
    text
}
