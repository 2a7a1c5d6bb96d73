//! Splats as Gaussians in the PLY files of 3D Gaussian splatting: SuperSplat, PlayCanvas, Spark and others open them.
//!
//! Numbers are as training programs write them: scales as logarithms, opacity as log-odds, quaternions with w first.

use super::disc::{Disc, discs_of_levels};
use super::levels::SplatLevels;
use crate::error::Result;
use crate::part::PartFile;
use std::path::Path;

/// Zeroth spherical harmonic: what a colour is divided by.
const HARMONIC: f64 = 0.282_094_791_773_878_14;
/// A Gaussian fades where a disc ends: its standard deviation is this share of the radius.
const DEVIATION: f64 = 0.5;
/// How thick it is, as a share of the cell.
const THICKNESS: f64 = 0.05;
/// Log-odds of an opacity of 0.99.
const OPACITY: f32 = 4.595_12;
/// Names of the fourteen numbers.
const NAMES: [&str; 14] = [
    "x", "y", "z", "f_dc_0", "f_dc_1", "f_dc_2", "opacity", "scale_0", "scale_1", "scale_2", "rot_0",
    "rot_1", "rot_2", "rot_3",
];

/// Writes the finest picture, or that of `level`, as Gaussians. Returns how many they are.
///
/// # Errors
/// What writing gives.
pub fn write_ply(levels: &SplatLevels, level: Option<u8>, path: &Path) -> Result<u64> {
    let mut count = 0u64;
    discs_of_levels(levels, level, |_| count += 1)?;
    let mut file = PartFile::create(path)?;
    let before = "ply\nformat binary_little_endian 1.0\ncomment flat splats of Brickfield\nelement vertex";
    let names: String = NAMES.iter().map(|name| format!("property float {name}\n")).collect();
    file.append(format!("{before} {count}\n{names}end_header\n").as_bytes())?;
    let mut done = Ok(());
    discs_of_levels(levels, level, |disc| {
        if done.is_ok() {
            done = file.append(&gaussian(&disc).map(f32::to_le_bytes).concat());
        }
    })?;
    done?;
    file.finish()?;
    Ok(count)
}

/// The numbers of a disc.
fn gaussian(disc: &Disc) -> [f32; 14] {
    let [x, y, z] = disc.centre.map(|c| c as f32);
    // Such files know no light: what faces upward is bright.
    let shade = ((0.62 + 0.3 * disc.normal[2] + 0.08 * disc.normal[0] - 0.5) / HARMONIC) as f32;
    let flat = (disc.radius * DEVIATION).ln() as f32;
    let thin = (disc.cell * THICKNESS).ln() as f32;
    let [w, i, j, k] = turn(disc.normal);
    [x, y, z, shade, shade, shade, OPACITY, flat, flat, thin, w, i, j, k]
}

/// The quaternion that turns the z axis to a unit vector.
fn turn(to: [f64; 3]) -> [f32; 4] {
    let [x, y, z] = to;
    if z < -0.999_999 {
        return [0.0, 1.0, 0.0, 0.0];
    }
    let w = ((1.0 + z) / 2.0).sqrt();
    [w, -y / (2.0 * w), x / (2.0 * w), 0.0].map(|c| c as f32)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quaternions_turn_the_z_axis_to_the_normal() {
        for normal in
            [[0.0, 0.0, 1.0], [0.0, 0.0, -1.0], [0.6, 0.0, 0.8], [0.48, -0.64, -0.6], [0.0, 1.0, 0.0]]
        {
            let [w, x, y, z] = turn(normal).map(f64::from);
            let turned = [2.0 * (x * z + w * y), 2.0 * (y * z - w * x), 1.0 - 2.0 * (x * x + y * y)];
            for axis in 0..3 {
                assert!((turned[axis] - normal[axis]).abs() < 1e-6, "{normal:?} {turned:?}");
            }
        }
    }
}
