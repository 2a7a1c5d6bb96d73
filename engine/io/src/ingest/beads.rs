//! Toolpaths as inputs: beads are read once and kept, their triangles are made when they are asked for.

use super::detect::{self, ReaderKind};
use crate::bead::{Sweep, SweepOptions, SweptToolpath};
use crate::error::{Error, Result};
use crate::mmap::MappedFile;
use crate::progress::Progress;
use crate::toolpath::gcode::{GcodeOptions, GcodeReport, read_gcode};
use crate::toolpath::{BeadSink, Toolpath};
use std::path::Path;

/// How inputs are to be understood that are more than triangles.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct OpenOptions {
    /// What the user knows better than the G-code.
    pub gcode: GcodeOptions,
    /// How beads become solids.
    pub sweep: SweepOptions,
}

/// The toolpath of an input, and what reading it found.
#[derive(Debug)]
pub struct InputBeads {
    /// The beads and their sweep.
    pub swept: SweptToolpath,
    /// What reading them found.
    pub report: GcodeReport,
}

/// Reads all beads of a file that is known to be G-code.
pub(super) fn read(path: &Path, options: &OpenOptions, progress: &dyn Progress) -> Result<InputBeads> {
    // Before the long work.
    let sweep = Sweep::new(&options.sweep)?;
    let mut toolpath = Toolpath::default();
    let report = read_gcode(path, &options.gcode, progress, &mut |bead| {
        toolpath.push(bead);
        Ok(())
    })?;
    Ok(InputBeads { swept: SweptToolpath::new(toolpath, sweep), report })
}

/// Hands the beads of a toolpath's file to `sink` in order, keeping none.
///
/// # Errors
/// If the file is no toolpath or a damaged one, or is changed meanwhile; if `sink` fails or the user interrupts.
pub fn read_beads(
    path: &Path,
    options: &GcodeOptions,
    progress: &dyn Progress,
    sink: &mut BeadSink<'_>,
) -> Result<GcodeReport> {
    let file = MappedFile::open(path)?;
    let family = detect::family(path, file.bytes());
    file.check()?;
    if family? != ReaderKind::Gcode {
        let what = "is a mesh, not a toolpath";
        return Err(Error::input(path, "byte 0", what, "give a G-code file"));
    }
    let report = read_gcode(path, options, progress, sink)?;
    // A file that ends early looks like one that ends.
    file.check()?;
    Ok(report)
}
