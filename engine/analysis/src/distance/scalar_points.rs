//! Points as a PLY file, each with a number.

use crate::error::Result;
use crate::part::PartFile;

/// The file: positions of 64 bits, since scans may lie far from the origin, and a number of 32 bits for each.
pub struct ScalarPoints {
    file: PartFile,
}

impl ScalarPoints {
    /// A file for so many points, which get this property.
    ///
    /// # Errors
    /// If it cannot be written.
    pub fn new(mut file: PartFile, property: &str, points: usize) -> Result<ScalarPoints> {
        let head = format!(
            "ply\nformat binary_little_endian 1.0\ncomment written by Brickfield\nelement vertex {points}\n\
             property double x\nproperty double y\nproperty double z\nproperty float {property}\nend_header\n"
        );
        file.append(head.as_bytes())?;
        Ok(ScalarPoints { file })
    }

    /// Adds points with their numbers.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn append(&mut self, points: &[[f64; 3]], numbers: &[f32]) -> Result<()> {
        let mut bytes = Vec::with_capacity(28 * points.len());
        for (point, number) in points.iter().zip(numbers) {
            bytes.extend_from_slice(point.map(f64::to_le_bytes).as_flattened());
            bytes.extend_from_slice(&number.to_le_bytes());
        }
        self.file.append(&bytes)
    }

    /// Gives the file its name. It has all of its points.
    ///
    /// # Errors
    /// What writing gives.
    pub fn complete(&mut self) -> Result<()> {
        self.file.finish().map(|_| ())
    }
}
