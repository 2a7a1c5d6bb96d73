//! A volume in a file: equal steps along x, y and z, x fastest.

use crate::error::{Error, Result};
use crate::mmap::MappedFile;
use crate::progress::Progress;
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
    I64,
    U64,
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
            SampleType::I64 | SampleType::U64 | SampleType::F64 => 8,
        }
    }

    /// NumPy's name.
    pub fn numpy(self) -> &'static str {
        match self {
            SampleType::I8 => "i1",
            SampleType::U8 => "u1",
            SampleType::I16 => "<i2",
            SampleType::U16 => "<u2",
            SampleType::I32 => "<i4",
            SampleType::U32 => "<u4",
            SampleType::I64 => "<i8",
            SampleType::U64 => "<u8",
            SampleType::F32 => "<f4",
            SampleType::F64 => "<f8",
        }
    }

    /// Appends values that stand in a file one behind the other.
    pub fn decode(self, bytes: &[u8], out: &mut Vec<f64>) {
        match self {
            SampleType::I8 => out.extend(bytes.iter().map(|&b| f64::from(b as i8))),
            SampleType::U8 => out.extend(bytes.iter().map(|&b| f64::from(b))),
            SampleType::I16 => numbers(bytes, out, |b| f64::from(i16::from_le_bytes(b))),
            SampleType::U16 => numbers(bytes, out, |b| f64::from(u16::from_le_bytes(b))),
            SampleType::I32 => numbers(bytes, out, |b| f64::from(i32::from_le_bytes(b))),
            SampleType::U32 => numbers(bytes, out, |b| f64::from(u32::from_le_bytes(b))),
            SampleType::I64 => numbers(bytes, out, |b| i64::from_le_bytes(b) as f64),
            SampleType::U64 => numbers(bytes, out, |b| u64::from_le_bytes(b) as f64),
            SampleType::F32 => numbers(bytes, out, |b| f64::from(f32::from_le_bytes(b))),
            SampleType::F64 => numbers(bytes, out, f64::from_le_bytes),
        }
    }

    /// Appends the bytes of a number that is written as text; false if it is none of this type.
    pub fn encode_text(self, text: &str, out: &mut Vec<u8>) -> bool {
        match self {
            SampleType::I8 => text.parse().map(|number| out.extend(i8::to_le_bytes(number))).is_ok(),
            SampleType::U8 => text.parse().map(|number| out.extend(u8::to_le_bytes(number))).is_ok(),
            SampleType::I16 => text.parse().map(|number| out.extend(i16::to_le_bytes(number))).is_ok(),
            SampleType::U16 => text.parse().map(|number| out.extend(u16::to_le_bytes(number))).is_ok(),
            SampleType::I32 => text.parse().map(|number| out.extend(i32::to_le_bytes(number))).is_ok(),
            SampleType::U32 => text.parse().map(|number| out.extend(u32::to_le_bytes(number))).is_ok(),
            SampleType::I64 => text.parse().map(|number| out.extend(i64::to_le_bytes(number))).is_ok(),
            SampleType::U64 => text.parse().map(|number| out.extend(u64::to_le_bytes(number))).is_ok(),
            SampleType::F32 => text.parse().map(|number| out.extend(f32::to_le_bytes(number))).is_ok(),
            SampleType::F64 => text.parse().map(|number| out.extend(f64::to_le_bytes(number))).is_ok(),
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
            "i8" => SampleType::I64,
            "u8" => SampleType::U64,
            "f4" => SampleType::F32,
            "f8" => SampleType::F64,
            _ => return None,
        })
    }
}

/// Appends numbers of `N` bytes each.
fn numbers<const N: usize>(bytes: &[u8], out: &mut Vec<f64>, number: impl Fn([u8; N]) -> f64) {
    out.extend(bytes.as_chunks::<N>().0.iter().map(|&chunk| number(chunk)));
}

/// A text of a file as a part of a line.
pub(super) fn plain(text: &str) -> String {
    /// Names are not longer.
    const MOST: usize = 80;
    text.escape_debug().take(MOST).collect()
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

/// A box of samples of a grid: the first along x, y and z, and those behind the last.
pub(super) type GridBox = [[usize; 3]; 2];

/// Where the values of a grid come from. `bytes` are those of its file.
pub(super) trait SampleSource: Send + Sync {
    /// Makes values readable, before the first is read; what does not fit in memory goes to a temporary file in the folder.
    fn prepare(&mut self, _bytes: &[u8], _folder: &Path, _progress: &dyn Progress) -> Result<()> {
        Ok(())
    }

    /// Puts the values of a box into an empty list, x fastest.
    fn read(&self, bytes: &[u8], samples: GridBox, out: &mut Vec<f64>) -> Result<()>;

    /// The value of all samples of a box of at most 40 along an axis, if that is one and told without reading them.
    fn uniform(&self, _samples: GridBox) -> Option<f64> {
        None
    }

    /// The value of all that lies outside of the samples, if the file tells one.
    fn outside(&self) -> Option<f64> {
        None
    }
}

/// What a file holds, as its header says.
pub(super) struct GridLayout {
    pub number: SampleType,
    pub shape: [usize; 3],
    pub place: GridPlacement,
    /// What the file is, as in "NumPy volume".
    pub format: &'static str,
}

impl GridLayout {
    /// Whether both tell the same, as far as both do.
    pub fn is_as(&self, other: &GridLayout) -> bool {
        let (one, two) = (&self.place, &other.place);
        let is_unit = one.unit.is_none() || two.unit.is_none() || one.unit == two.unit;
        let is_place = one.origin == two.origin && one.spacing == two.spacing && is_unit;
        self.number == other.number && self.shape == other.shape && is_place
    }
}

/// A volume in a file.
pub struct Grid {
    file: MappedFile,
    layout: GridLayout,
    source: Box<dyn SampleSource>,
    /// What may be chosen of the file, as text, if it holds several things.
    fields: Vec<String>,
    note: Option<&'static str>,
}

/// Samples that stand in the file one behind the other, x fastest.
struct InPlace {
    /// Where they begin.
    first: usize,
    number: SampleType,
    shape: [usize; 3],
}

impl SampleSource for InPlace {
    fn read(&self, bytes: &[u8], samples: GridBox, out: &mut Vec<f64>) -> Result<()> {
        let size = self.number.bytes();
        for_rows(self.shape, samples, |at, count| {
            let start = self.first + at * size;
            self.number.decode(&bytes[start..start + count * size], out);
            Ok(())
        })
    }
}

/// Calls with the index of the first sample and the count of each row of a box.
pub(super) fn for_rows(
    [across, up, _]: [usize; 3],
    [low, high]: GridBox,
    mut row: impl FnMut(usize, usize) -> Result<()>,
) -> Result<()> {
    for k in low[2]..high[2] {
        for j in low[1]..high[1] {
            row((k * up + j) * across + low[0], high[0] - low[0])?;
        }
    }
    Ok(())
}

impl Grid {
    /// Of samples that stand in a file from a byte on. `name` is the file that was given, for messages.
    pub(super) fn in_place(name: &Path, file: MappedFile, first: usize, layout: GridLayout) -> Result<Grid> {
        let (number, shape) = (layout.number, layout.shape);
        let there = file.bytes().len().saturating_sub(first);
        if layout.bytes().is_none_or(|bytes| bytes > there) {
            return Err(layout.wrong_size(name, first, there));
        }
        Grid::new(name, file, layout, Box::new(InPlace { first, number, shape }))
    }

    /// Of samples from anywhere.
    pub(super) fn new(
        name: &Path,
        file: MappedFile,
        layout: GridLayout,
        source: Box<dyn SampleSource>,
    ) -> Result<Grid> {
        let ([x, y, z], place) = (layout.shape, &layout.place);
        if layout.shape.iter().any(|&n| n < 2) {
            let what = format!("has {x} × {y} × {z} samples: two along each axis are the least");
            return Err(Error::input(name, "shape", what, "give a volume, not an image"));
        }
        if !(place.spacing > 0.0 && place.spacing.is_finite() && place.origin.iter().all(|c| c.is_finite())) {
            let what = format!("its samples are {} apart", place.spacing);
            return Err(Error::input(name, "spacing", what, "give a spacing above 0"));
        }
        Ok(Grid { file, layout, source, fields: Vec::new(), note: None })
    }

    /// With what may be chosen of the file, and what is to be known of the choice.
    pub(super) fn with_fields(self, fields: Vec<String>, note: Option<&'static str>) -> Grid {
        Grid { fields, note, ..self }
    }

    /// Samples along x, y and z.
    pub fn shape(&self) -> [usize; 3] {
        self.layout.shape
    }

    /// World position of the first sample.
    pub fn origin(&self) -> [f64; 3] {
        self.layout.place.origin
    }

    /// World distance of two samples.
    pub fn spacing(&self) -> f64 {
        self.layout.place.spacing
    }

    /// Unit of length, if the file tells one.
    pub fn unit(&self) -> Option<&str> {
        self.layout.place.unit.as_deref()
    }

    /// Whether the file says that its values are distances.
    pub fn holds_distances(&self) -> bool {
        self.layout.place.holds_distances
    }

    /// Whether values may lie between whole numbers.
    pub(super) fn has_fractions(&self) -> bool {
        matches!(self.layout.number, SampleType::F32 | SampleType::F64)
    }

    /// NumPy's name of the type of the values.
    pub fn type_name(&self) -> &'static str {
        self.layout.number.numpy()
    }

    /// What the file is, as in "NumPy volume".
    pub fn format(&self) -> &'static str {
        self.layout.format
    }

    /// What the file holds, as in "w: float, fog volume", the chosen one first; empty of formats with one volume a file.
    pub fn fields(&self) -> &[String] {
        &self.fields
    }

    /// What is to be known of where values lie, as that they are those of cells.
    pub fn note(&self) -> Option<&'static str> {
        self.note
    }

    /// The file with the samples.
    pub(super) fn file(&self) -> &MappedFile {
        &self.file
    }

    /// See [`SampleSource::prepare`].
    pub(super) fn prepare(&mut self, folder: &Path, progress: &dyn Progress) -> Result<()> {
        self.source.prepare(self.file.bytes(), folder, progress)
    }

    /// Puts the values of a box into a list, x fastest.
    pub(super) fn read(&self, samples: GridBox, out: &mut Vec<f64>) -> Result<()> {
        out.clear();
        self.source.read(self.file.bytes(), samples, out)
    }

    /// See [`SampleSource::uniform`].
    pub(super) fn uniform(&self, samples: GridBox) -> Option<f64> {
        self.source.uniform(samples)
    }

    /// See [`SampleSource::outside`].
    pub(super) fn outside(&self) -> Option<f64> {
        self.source.outside()
    }
}

impl GridLayout {
    /// Bytes of all samples, unless there are more than can be counted.
    pub fn bytes(&self) -> Option<usize> {
        self.shape.iter().try_fold(self.number.bytes(), |bytes, &n| bytes.checked_mul(n))
    }

    /// The error of a file with another number of bytes.
    pub fn wrong_size(&self, name: &Path, first: usize, there: usize) -> Error {
        let ([x, y, z], size) = (self.shape, self.number.bytes());
        let what = format!("has {there} bytes of samples, not {x} × {y} × {z} × {size}");
        Error::input(name, format!("byte {first}"), what, "export or copy the file again")
    }
}
