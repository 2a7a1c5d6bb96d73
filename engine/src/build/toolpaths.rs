//! The main job straight from toolpaths: beads as analytic solids in, store out.

use super::jobs::sort_level;
use super::pipeline::{BuildOptions, Clock, Summary, Task, place};
use super::solids::sort_segments;
use crate::error::{Error, Result};
use crate::progress::Progress;
use crate::solid::{Outline, Solids, bounds_of_beads};
use crate::store::{Source, check_target};
use crate::toolpath::Toolpath;
use std::path::Path;

/// A toolpath and the file that it was read from.
#[derive(Clone, Debug)]
pub struct BeadSource<'a> {
    /// The beads.
    pub toolpath: &'a Toolpath,
    /// The file, as the store will name it.
    pub source: Source,
}

/// Builds `output` from the beads of all toolpaths together, on the threads of the current rayon pool. A
/// sample counts the beads that cover it.
///
/// The file's bytes depend on the toolpaths, their sources and the options; not on the threads.
///
/// # Errors
/// Toolpaths without beads or with positions that are not finite, settings that do not fit them, an output
/// that cannot be written. Nothing is left under the final name unless the build succeeds.
pub fn build_beads(
    sources: &[BeadSource<'_>],
    outline: Outline,
    output: &Path,
    options: &BuildOptions,
    progress: &dyn Progress,
) -> Result<Summary> {
    let mut clock = Clock::default();
    check_target(output)?;
    progress.phase("measuring", None, "beads");
    let (min, max) = bounds(sources, outline)?;
    let first = sources.first().map(|source| Path::new(&source.source.path));
    let (root, depth) = place(first, min, max, options.resolution)?;
    clock.lap("measure");
    let described = sources.iter().map(|source| source.source.clone()).collect();
    let mut task = Task::begin(described, (min, max), root, depth, output, options)?;
    let paths: Vec<&Toolpath> = sources.iter().map(|source| source.toolpath).collect();
    let (solids, segments) = Solids::new(&paths, root, outline)?;
    progress.phase("sorting", Some(segments.len() as u64), "segments");
    let sorted = sort_segments(&solids, &segments, sort_level(&task.rules), progress)?;
    task.meta.numbers.facets = segments.len() as u64;
    drop(segments);
    clock.lap("sort");
    task.finish(&solids, sorted, clock, progress)
}

/// The box around all beads.
fn bounds(sources: &[BeadSource<'_>], outline: Outline) -> Result<([f64; 3], [f64; 3])> {
    let mut all = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
    for BeadSource { toolpath, source } in sources {
        let path = Path::new(&source.path);
        let (min, max) = bounds_of_beads(toolpath, outline).map_err(|bead| {
            Error::input(
                path,
                format!("line {}", toolpath.attributes(bead).lines.0),
                "a bead has a position or a section that is not finite",
                "correct the line",
            )
        })?;
        if !(min[0] <= max[0]) {
            let remedy = "give a toolpath that deposits something";
            return Err(Error::input(path, &source.format, "has no beads", remedy));
        }
        for a in 0..3 {
            all.0[a] = all.0[a].min(min[a]);
            all.1[a] = all.1[a].max(max[a]);
        }
    }
    Ok(all)
}
