//! Maps from indices into the world.

use super::cursor::Cursor;
use crate::error::Result;

/// Scaled along the axes, then moved.
pub(super) struct GridTransform {
    pub scale: [f64; 3],
    translation: [f64; 3],
}

impl GridTransform {
    /// Position of a voxel in the world.
    pub fn world(&self, index: [i64; 3]) -> [f64; 3] {
        std::array::from_fn(|a| self.scale[a] * index[a] as f64 + self.translation[a])
    }

    /// Reads a map, and what stands there besides.
    pub fn read(cursor: &mut Cursor<'_>) -> Result<GridTransform> {
        let (remedy, name) =
            ("sample the grid anew along the axes, as by vdb_tool -resample", cursor.string()?);
        let (mut scale, mut translation) = ([1.0; 3], [0.0; 3]);
        match name {
            "UniformScaleMap" | "ScaleMap" => {
                scale = vector(cursor)?;
                cursor.skip(4 * 24)?;
            }
            "UniformScaleTranslateMap" | "ScaleTranslateMap" => {
                (translation, scale) = (vector(cursor)?, vector(cursor)?);
                cursor.skip(4 * 24)?;
            }
            "TranslationMap" => translation = vector(cursor)?,
            "AffineMap" => {
                // A row holds what an index adds to the three coordinates; the last one is the translation.
                let rows: Vec<f64> = (0..16).map(|_| cursor.double()).collect::<Result<_>>()?;
                let is_turned = (0..12).any(|n| n % 5 != 0 && rows[n] != 0.0);
                if is_turned || rows[15] != 1.0 {
                    return Err(cursor.error("the grid is turned or skewed", remedy));
                }
                (scale, translation) = ([rows[0], rows[5], rows[10]], [rows[12], rows[13], rows[14]]);
            }
            _ => return Err(cursor.error(format!("the grid has a {name:?}"), remedy)),
        }
        if scale.iter().any(|&step| step <= 0.0) {
            return Err(cursor.error("the grid is mirrored or flat", remedy));
        }
        Ok(GridTransform { scale, translation })
    }
}

fn vector(cursor: &mut Cursor<'_>) -> Result<[f64; 3]> {
    Ok([cursor.double()?, cursor.double()?, cursor.double()?])
}
