//! A volume in a mapped file: equal steps along x, y and z, x fastest.

use crate::error::{Error, Result};
use crate::mmap::MappedFile;
use std::path::Path;

/// Types of values, little-endian.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum SampleType {
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    F32,
    F64,
}

impl SampleType {
    /// Bytes of a value.
    pub fn bytes(self) -> usize {
        match self {
            SampleType::I8 | SampleType::U8 => 1,
            SampleType::I16 | SampleType::U16 => 2,
            SampleType::I32 | SampleType::U32 | SampleType::F32 => 4,
            SampleType::F64 => 8,
        }
    }

    /// NumPy's name.
    fn numpy(self) -> &'static str {
        match self {
            SampleType::I8 => "i1",
            SampleType::U8 => "u1",
            SampleType::I16 => "<i2",
            SampleType::U16 => "<u2",
            SampleType::I32 => "<i4",
            SampleType::U32 => "<u4",
            SampleType::F32 => "<f4",
            SampleType::F64 => "<f8",
        }
    }

    /// By NumPy's name.
    pub fn of_numpy(name: &str) -> Option<SampleType> {
        Some(match name.trim_start_matches(['<', '|', '=']) {
            "i1" => SampleType::I8,
            "u1" | "b1" => SampleType::U8,
            "i2" => SampleType::I16,
            "u2" => SampleType::U16,
            "i4" => SampleType::I32,
            "u4" => SampleType::U32,
            "f4" => SampleType::F32,
            "f8" => SampleType::F64,
            _ => return None,
        })
    }
}

/// Where the samples of a grid lie in the world.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct GridPlacement {
    /// Position of the first sample.
    pub origin: [f64; 3],
    /// Distance of two samples.
    pub spacing: f64,
    /// Unit of length, if it is known.
    pub unit: Option<String>,
    /// Whether the file says that its values are distances.
    pub holds_distances: bool,
}

/// A volume in a file.
pub struct Grid {
    file: MappedFile,
    /// Where the samples begin.
    first: usize,
    number: SampleType,
    shape: [usize; 3],
    place: GridPlacement,
    format: &'static str,
}

impl Grid {
    /// Of samples that begin at a byte of a file. `name` is the file that was given, for messages.
    pub(super) fn new(
        name: &Path,
        file: MappedFile,
        first: usize,
        (number, shape): (SampleType, [usize; 3]),
        place: GridPlacement,
        format: &'static str,
    ) -> Result<Grid> {
        let bytes = shape.iter().try_fold(number.bytes(), |bytes, &n| bytes.checked_mul(n));
        let there = file.bytes().len().saturating_sub(first);
        let [x, y, z] = shape;
        if bytes.is_none_or(|bytes| bytes > there) {
            let what = format!("has {there} bytes of samples, not {x} × {y} × {z} × {}", number.bytes());
            return Err(Error::input(name, format!("byte {first}"), what, "export or copy the file again"));
        }
        if shape.iter().any(|&n| n < 2) {
            let what = format!("has {x} × {y} × {z} samples: two along each axis are the least");
            return Err(Error::input(name, "shape", what, "give a volume, not an image"));
        }
        if !(place.spacing > 0.0 && place.spacing.is_finite() && place.origin.iter().all(|c| c.is_finite())) {
            let what = format!("its samples are {} apart", place.spacing);
            return Err(Error::input(name, "spacing", what, "give a spacing above 0"));
        }
        Ok(Grid { file, first, number, shape, place, format })
    }

    /// Samples along x, y and z.
    pub fn shape(&self) -> [usize; 3] {
        self.shape
    }

    /// World position of the first sample.
    pub fn origin(&self) -> [f64; 3] {
        self.place.origin
    }

    /// World distance of two samples.
    pub fn spacing(&self) -> f64 {
        self.place.spacing
    }

    /// Unit of length, if the file tells one.
    pub fn unit(&self) -> Option<&str> {
        self.place.unit.as_deref()
    }

    /// Whether the file says that its values are distances.
    pub fn holds_distances(&self) -> bool {
        self.place.holds_distances
    }

    /// Whether values may lie between whole numbers.
    pub(super) fn has_fractions(&self) -> bool {
        matches!(self.number, SampleType::F32 | SampleType::F64)
    }

    /// NumPy's name of the type of the values.
    pub fn type_name(&self) -> &'static str {
        self.number.numpy()
    }

    /// What the file is, as in "NumPy volume".
    pub fn format(&self) -> &'static str {
        self.format
    }

    /// The file with the samples.
    pub(super) fn file(&self) -> &MappedFile {
        &self.file
    }

    /// The value of a sample.
    pub fn value(&self, [i, j, k]: [usize; 3]) -> f64 {
        let [x, y, _] = self.shape;
        let size = self.number.bytes();
        let at = self.first + ((k * y + j) * x + i) * size;
        let bytes = &self.file.bytes()[at..at + size];
        fn array<const N: usize>(bytes: &[u8]) -> [u8; N] {
            std::array::from_fn(|n| bytes[n])
        }
        match self.number {
            SampleType::I8 => f64::from(bytes[0] as i8),
            SampleType::U8 => f64::from(bytes[0]),
            SampleType::I16 => f64::from(i16::from_le_bytes(array(bytes))),
            SampleType::U16 => f64::from(u16::from_le_bytes(array(bytes))),
            SampleType::I32 => f64::from(i32::from_le_bytes(array(bytes))),
            SampleType::U32 => f64::from(u32::from_le_bytes(array(bytes))),
            SampleType::F32 => f64::from(f32::from_le_bytes(array(bytes))),
            SampleType::F64 => f64::from_le_bytes(array(bytes)),
        }
    }
}
