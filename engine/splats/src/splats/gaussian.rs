//! A splat as a flat Gaussian, for viewers that know no other kind.
//!
//! They know no light either, so its colour is shaded: what faces upward is bright.

use super::disc::{Disc, discs_of_levels};
use super::levels::SplatLevels;
use crate::ellipses::Ellipse;
use crate::error::Result;
use crate::part::PartFile;

/// Zeroth spherical harmonic: what a colour is divided by.
const HARMONIC: f64 = 0.282_094_791_773_878_14;
/// A Gaussian fades where a disc ends: its standard deviation is this share of the radius.
const DEVIATION: f64 = 0.5;
/// How thick it is, as a share of the cell, or of an ellipse's smaller radius.
const THICKNESS: f64 = 0.05;
/// How much it hides in its middle.
pub(super) const OPACITY: f64 = 0.99;

/// A Gaussian.
pub(super) struct Gaussian {
    pub centre: [f32; 3],
    /// Grey as screens show it, 0 to 1.
    pub grey: f64,
    /// Standard deviations: along both radii, then across the plane.
    pub deviations: [f64; 3],
    /// The quaternion that turns x and y to the radii and z to the normal, w first.
    pub turn: [f32; 4],
}

impl Gaussian {
    pub fn of(disc: &Disc) -> Gaussian {
        let flat = disc.radius * DEVIATION;
        Gaussian {
            centre: disc.centre.map(|c| c as f32),
            grey: grey(disc.normal),
            deviations: [flat, flat, disc.cell * THICKNESS],
            turn: turn(disc.normal),
        }
    }

    /// The same of an ellipse.
    pub fn of_ellipse(ellipse: &Ellipse) -> Gaussian {
        let [a, b] = ellipse.radii;
        Gaussian {
            centre: ellipse.centre.map(|c| c as f32),
            grey: grey(ellipse.normal),
            deviations: [a * DEVIATION, b * DEVIATION, a.min(b) * THICKNESS],
            turn: turn_of_axes([ellipse.axes[0], ellipse.axes[1], ellipse.normal]),
        }
    }

    /// Its grey as the factor of the zeroth spherical harmonic.
    pub fn harmonic(&self) -> f32 {
        ((self.grey - 0.5) / HARMONIC) as f32
    }
}

/// What is written as Gaussians.
#[derive(Clone, Copy)]
pub enum GaussianSource<'a> {
    /// The finest picture of splats of cells, or that of a level.
    Cells(&'a SplatLevels, Option<u8>),
    /// Ellipses that are larger than cells.
    Ellipses(&'a [Ellipse]),
}

impl GaussianSource<'_> {
    /// Calls `each` with each Gaussian.
    pub(super) fn each(self, mut each: impl FnMut(&Gaussian)) -> Result<()> {
        match self {
            GaussianSource::Cells(levels, level) => {
                discs_of_levels(levels, level, |disc| each(&Gaussian::of(&disc)))
            }
            GaussianSource::Ellipses(ellipses) => {
                ellipses.iter().for_each(|ellipse| each(&Gaussian::of_ellipse(ellipse)));
                Ok(())
            }
        }
    }

    /// Appends what `bytes` makes of each.
    pub(super) fn append(self, file: &mut PartFile, bytes: impl Fn(&Gaussian) -> Vec<u8>) -> Result<()> {
        let mut done = Ok(());
        self.each(|gaussian| {
            if done.is_ok() {
                done = file.append(&bytes(gaussian));
            }
        })?;
        done
    }
}

/// As screens show it.
fn grey(normal: [f64; 3]) -> f64 {
    0.62 + 0.3 * normal[2] + 0.08 * normal[0]
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

/// The quaternion that turns x, y and z to three unit vectors, which turn as these do (Shepperd 1978).
fn turn_of_axes([x, y, z]: [[f64; 3]; 3]) -> [f32; 4] {
    let parts = [
        [1.0 + x[0] + y[1] + z[2], y[2] - z[1], z[0] - x[2], x[1] - y[0]],
        [y[2] - z[1], 1.0 + x[0] - y[1] - z[2], y[0] + x[1], z[0] + x[2]],
        [z[0] - x[2], y[0] + x[1], 1.0 - x[0] + y[1] - z[2], z[1] + y[2]],
        [x[1] - y[0], z[0] + x[2], z[1] + y[2], 1.0 - x[0] - y[1] + z[2]],
    ];
    // All four are parallel; the longest is the most exact.
    let longest = (1..4).fold(0, |best, n| if parts[n][n] > parts[best][best] { n } else { best });
    let length = parts[longest].iter().map(|c| c * c).sum::<f64>().sqrt();
    parts[longest].map(|c| (c / length) as f32)
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

    #[test]
    fn quaternions_turn_axes_to_those_of_an_ellipse() {
        let turned = [[0.36, 0.48, -0.8], [-0.8, 0.6, 0.0], [0.48, 0.64, 0.6]];
        let half_turn = [[1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, -1.0]];
        for axes in [turned, half_turn, [[-1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, -1.0]]] {
            let [w, x, y, z] = turn_of_axes(axes).map(f64::from);
            let matrix = [
                [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y + w * z), 2.0 * (x * z - w * y)],
                [2.0 * (x * y - w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z + w * x)],
                [2.0 * (x * z + w * y), 2.0 * (y * z - w * x), 1.0 - 2.0 * (x * x + y * y)],
            ];
            for (found, wanted) in matrix.iter().flatten().zip(axes.iter().flatten()) {
                assert!((found - wanted).abs() < 1e-6, "{matrix:?} {axes:?}");
            }
        }
    }
}
