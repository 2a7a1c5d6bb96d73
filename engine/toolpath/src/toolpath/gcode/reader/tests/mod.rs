//! Tests of the G-code reader as a whole.

use super::super::*;
use super::{read_gcode, read_gcode_from, sizes};
use crate::error::{Error, Result};
use crate::progress::Silent;
use crate::toolpath::Toolpath;
use std::path::{Path, PathBuf};

mod dialect;
mod files;
mod firmwares;
mod large_format;
mod large_laws;
mod laws;
mod offsets;
mod refusals;
mod slicers;

/// A file of the repository's data.
fn data(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../bench-data").join(name)
}

/// All beads of a file.
fn load(name: &str, options: &GcodeOptions) -> Result<(GcodeReport, Toolpath)> {
    let mut path = Toolpath::default();
    let report = read_gcode(&data(name), options, &Silent, &mut |bead| {
        path.push(bead);
        Ok(())
    })?;
    Ok((report, path))
}

/// All beads of a text.
fn parse(text: impl AsRef<[u8]>, options: &GcodeOptions) -> Result<(GcodeReport, Toolpath)> {
    let mut path = Toolpath::default();
    let text = text.as_ref();
    let report = read_gcode_from(Path::new("text"), || Ok(text), options, &mut |bead| {
        path.push(bead);
        Ok(())
    })?;
    Ok((report, path))
}

fn skipping(features: &[&str]) -> GcodeOptions {
    GcodeOptions {
        skip_features: features.iter().map(|f| f.to_string()).collect(),
        ..GcodeOptions::default()
    }
}
