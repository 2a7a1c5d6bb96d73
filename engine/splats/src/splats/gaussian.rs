//! A splat as a flat Gaussian, for viewers that know no other kind.
//!
//! They know no light either, so its colour is shaded: what faces upward is bright.

use super::disc::{Disc, discs_of_levels};
use super::levels::SplatLevels;
use crate::error::Result;
use crate::part::PartFile;

/// Zeroth spherical harmonic: what a colour is divided by.
const HARMONIC: f64 = 0.282_094_791_773_878_14;
/// A Gaussian fades where a disc ends: its standard deviation is this share of the radius.
const DEVIATION: f64 = 0.5;
/// How thick it is, as a share of the cell.
const THICKNESS: f64 = 0.05;
/// How much it hides in its middle.
pub(super) const OPACITY: f64 = 0.99;

/// A Gaussian.
pub(super) struct Gaussian {
    pub centre: [f32; 3],
    /// Grey as screens show it, 0 to 1.
    pub grey: f64,
    /// Standard deviations: twice along the plane, then across it.
    pub deviations: [f64; 3],
    /// The quaternion that turns the z axis to the normal, w first.
    pub turn: [f32; 4],
}

impl Gaussian {
    pub fn of(disc: &Disc) -> Gaussian {
        let flat = disc.radius * DEVIATION;
        Gaussian {
            centre: disc.centre.map(|c| c as f32),
            grey: 0.62 + 0.3 * disc.normal[2] + 0.08 * disc.normal[0],
            deviations: [flat, flat, disc.cell * THICKNESS],
            turn: turn(disc.normal),
        }
    }

    /// Its grey as the factor of the zeroth spherical harmonic.
    pub fn harmonic(&self) -> f32 {
        ((self.grey - 0.5) / HARMONIC) as f32
    }
}

/// Appends what `bytes` makes of each disc of the finest picture, or of that of `level`.
pub(super) fn append_discs(
    file: &mut PartFile,
    (levels, level): (&SplatLevels, Option<u8>),
    bytes: impl Fn(&Disc) -> Vec<u8>,
) -> Result<()> {
    let mut done = Ok(());
    discs_of_levels(levels, level, |disc| {
        if done.is_ok() {
            done = file.append(&bytes(&disc));
        }
    })?;
    done
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
