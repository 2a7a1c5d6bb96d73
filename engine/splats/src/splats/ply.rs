//! Splats as Gaussians in the PLY files of 3D Gaussian splatting: SuperSplat, PlayCanvas, Spark and others open them.
//!
//! Numbers are as training programs write them: scales as logarithms, opacity as log-odds, quaternions with w first.

use super::gaussian::{Gaussian, GaussianSource};
use crate::error::Result;
use crate::part::PartFile;
use std::path::Path;

/// Log-odds of [`super::gaussian::OPACITY`].
const OPACITY: f32 = 4.595_12;
/// Names of the fourteen numbers.
const NAMES: [&str; 14] = [
    "x", "y", "z", "f_dc_0", "f_dc_1", "f_dc_2", "opacity", "scale_0", "scale_1", "scale_2", "rot_0",
    "rot_1", "rot_2", "rot_3",
];

/// Writes Gaussians. Returns how many they are.
///
/// # Errors
/// What writing gives.
pub fn write_ply(source: GaussianSource<'_>, path: &Path) -> Result<u64> {
    let mut count = 0u64;
    source.each(|_| count += 1)?;
    let mut file = PartFile::create(path)?;
    let before = "ply\nformat binary_little_endian 1.0\ncomment flat splats of Brickfield\nelement vertex";
    let names: String = NAMES.iter().map(|name| format!("property float {name}\n")).collect();
    file.append(format!("{before} {count}\n{names}end_header\n").as_bytes())?;
    source.append(&mut file, |gaussian| numbers(gaussian).map(f32::to_le_bytes).concat())?;
    file.finish()?;
    Ok(count)
}

/// The numbers of a Gaussian.
fn numbers(gaussian: &Gaussian) -> [f32; 14] {
    let ([x, y, z], shade) = (gaussian.centre, gaussian.harmonic());
    let [a, b, c] = gaussian.deviations.map(|deviation| deviation.ln() as f32);
    let [w, i, j, k] = gaussian.turn;
    [x, y, z, shade, shade, shade, OPACITY, a, b, c, w, i, j, k]
}
