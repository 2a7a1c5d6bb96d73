//! The volume of what is taken off, by the mesh of it.
//!
//! Chords of a bore are alike in every layer, so their errors do not cancel. A mesh knows where its facets lie: of a bore of
//! 100 cells it is 30 times as near. What both differ by tells how far either may be off.

use crate::analysis::volume;
use crate::contour::{ContourOptions, DiscardSink, contour};
use crate::csg::{Chain, Writing};
use crate::error::Result;
use crate::part::temporary::BesideFile;
use crate::progress::Progress;
use crate::store::{Meta, Store};
use std::path::Path;
use std::time::Duration;

/// What a mesh may be off by, in cells over its area: a curved surface of a radius of eight cells.
const MESH_CELLS: f64 = 0.005;

/// A volume with what it may be off by.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct BoundedVolume {
    /// In the cube of the store's unit.
    pub value: f64,
    /// Bound on its error.
    pub error: f64,
}

/// The volume of a chain's result, which is written to a file beside `output` for the time of the call.
///
/// # Errors
/// As [`Chain::write`].
pub fn measured_volume(
    chain: &Chain<'_>,
    meta: Meta,
    output: &Path,
    memory: u64,
    progress: &dyn Progress,
) -> Result<BoundedVolume> {
    let root = meta.root;
    let file = BesideFile::new(output, ".removed");
    let cell = root.spacing(meta.depth);
    let settings = vec![("made by".to_owned(), "measuring".to_owned())];
    let writing = Writing { memory, pace: Duration::MAX, restart: true, settings };
    chain.write(file.path(), meta, writing, progress)?;
    let store = Store::open(file.path(), memory / 4)?;
    let chords = volume(&store, progress)?;
    if chords.union <= 0.0 {
        return Ok(BoundedVolume::default());
    }
    let bytes = usize::try_from(memory / 4).unwrap_or(usize::MAX);
    let options = ContourOptions {
        cache_bytes: bytes,
        intersection_free: false,
        follow_creases: true,
        ..ContourOptions::default()
    };
    let mesh = contour(&store, &options, &mut DiscardSink, progress)?;
    let error = (mesh.volume - chords.union).abs() + MESH_CELLS * cell * mesh.area;
    Ok(BoundedVolume { value: mesh.volume, error })
}
