//! The sum of the solid angles of all triangles at points, on a device.

use super::vulkan::Vulkan;
use crate::error::{Error, Result};
use crate::gpu::{AngleSums, DeviceFailure};
use crate::ingest::{Facets, runs};
use crate::lattice::{ROOT_BITS, RootCube};
use crate::progress::Progress;

/// The winding number at each point as the sum of the solid angles of every triangle, as [`crate::winding::brute_at`],
/// but in single precision. It is off by some 1e-6 for each triangle that is seen large, and more where a point lies
/// on a triangle. Time is triangles times points.
///
/// # Errors
/// If the user interrupts, or the device fails.
pub fn brute_at(
    vulkan: &Vulkan,
    sources: &[&dyn Facets],
    root: RootCube,
    points: &[[f64; 3]],
    progress: &dyn Progress,
) -> Result<Vec<f64>> {
    let failed = |failure: DeviceFailure| {
        let what = format!("{}: {failure}", vulkan.gpu().info().name);
        Error::setting(what, "use `backend` cpu")
    };
    let edge = f64::from(1u32 << ROOT_BITS);
    // Far points see nothing; nearer ones have coordinates that squares and cubes of do not overflow.
    let points: Vec<[f32; 3]> =
        points.iter().map(|p| root.to_units(*p).map(|c| c.clamp(-1e3 * edge, 1e3 * edge) as f32)).collect();
    let mut sums = AngleSums::new(vulkan.gpu()).map_err(failed)?;
    let mut angles = vec![0; points.len()];
    let snapper = root.snapper();
    let (mut world, mut facets) = (Vec::new(), Vec::new());
    for (source, range) in runs(sources) {
        progress.check()?;
        sources[source].read(range, &mut world);
        // Units fit the 24 bits of an f32.
        facets.clear();
        facets.extend(world.iter().map(|t| t.map(|v| snapper(v).map(|c| c as f32))));
        for part in facets.chunks(AngleSums::FACETS_MAX) {
            sums.add(part, &points, &mut angles).map_err(failed)?;
        }
        progress.advance(world.len() as u64);
    }
    Ok(AngleSums::windings(&angles))
}
