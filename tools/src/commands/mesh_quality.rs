//! How well the triangles of a mesh serve a solver.

use super::mesh::MeshReport;
use super::mesh_shells::ShellChoice;
use crate::failure::Failure;
use crate::memory;
use crate::progress::Bars;
use brickfield_engine::contour::{Angles, ContourOptions, DiscardSink, ImprovedSink, MeshSink};
use brickfield_engine::store::{BrickTree, Store};
use serde::Serialize;
use std::path::Path;

/// How far the surface may go for the sake of better angles, in cells.
const MOST_CELLS: f64 = 0.1;
/// The same, as a part of the tolerance.
const MOST_TOLERANCE: f64 = 0.5;

/// Angles of the triangles of a mesh.
#[derive(Clone, Copy, Serialize)]
pub struct Quality {
    smallest_angle: f64,
    below_5_degrees: u64,
    /// Before slivers were taken away.
    smallest_angle_before: f64,
    below_5_degrees_before: u64,
    /// How far the surface may have gone for it.
    most_distance: f64,
}

impl Quality {
    /// For people.
    pub fn text(&self, unit: &str) -> String {
        let Quality { smallest_angle, below_5_degrees, below_5_degrees_before, most_distance, .. } = self;
        format!(
            "\n  quality  angles of {smallest_angle:.3}° at least; {below_5_degrees} triangles have one below 5°, \
             {below_5_degrees_before} before slivers were taken away within {most_distance:.6} {unit}"
        )
    }
}

/// Writes the shells that are kept without slivers, as [`super::mesh::write_kept`] writes them as they are.
///
/// # Errors
/// As that; a mesh that does not fit the memory.
pub fn write_improved(
    chosen: &ShellChoice,
    (store, tree): (&Store, &dyn BrickTree),
    options: &ContourOptions,
    (output, sink): (&Path, &mut dyn MeshSink),
    bars: &Bars,
) -> Result<MeshReport, Failure> {
    let level = options.level.unwrap_or(u8::MAX).min(tree.deepest_level());
    let most_distance = MOST_CELLS * tree.root().spacing(level) + MOST_TOLERANCE * options.tolerance;
    // The mesh is improved when contouring is done; until then it takes less than a quarter.
    let memory = memory::after_contouring(options.cache_bytes as u64);
    let options = ContourOptions { cache_bytes: options.cache_bytes / 4 * 3, ..options.clone() };
    let mut better = ImprovedSink::new(sink, most_distance, memory, bars);
    let (mut report, before) =
        super::mesh::write_kept(chosen, (store, tree), &options, (output, &mut better), bars)?;
    let Angles { smallest, below_5 } = better.counted().angles;
    report.count(&better.counted(), better.volume());
    report.quality = Some(Quality {
        smallest_angle: smallest,
        below_5_degrees: below_5,
        smallest_angle_before: before.smallest,
        below_5_degrees_before: before.below_5,
        most_distance,
    });
    Ok(report)
}

/// How many triangles the shells that are kept have without slivers.
///
/// # Errors
/// As [`write_improved`].
pub fn improved_triangles(
    chosen: &ShellChoice,
    trees: (&Store, &dyn BrickTree),
    options: &ContourOptions,
    output: &Path,
    bars: &Bars,
) -> Result<u64, Failure> {
    Ok(write_improved(chosen, trees, options, (output, &mut DiscardSink), bars)?.triangles)
}
