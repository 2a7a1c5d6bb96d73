//! What stands before the points of a LAS file: LAS 1.4 R15, §2.4 to 2.6 and Table 24.

use crate::error::{Error, Result};
use crate::ingest::columns::Column;
use crate::ingest::text;
use std::path::Path;

pub(super) const REMEDY: &str = "copy or export the file again";
/// Bytes of the shortest header, of LAS 1.0 to 1.2.
const LEAST_BYTES: usize = 227;
/// Bytes of a record of variable length before its data.
const RECORD_HEAD_BYTES: usize = 54;
/// Bytes that describe one number beside the standard ones.
const EXTRA_BYTES: usize = 192;
/// Bytes of a point of each format.
const LEAST_POINT_BYTES: [usize; 11] = [20, 28, 26, 34, 57, 63, 30, 36, 38, 59, 67];
/// Set in the format of points that are packed.
const PACKED_BITS: u8 = 0xc0;

/// Where a number of a point stands, and how it is written.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct ExtraField {
    pub name: String,
    /// Byte within the point.
    at: usize,
    /// Type by its number in the standard.
    kind: u8,
    scale: f64,
    offset: f64,
}

/// What is said of the points.
#[derive(Debug)]
pub(super) struct LasHeader<'a> {
    pub path: &'a Path,
    /// Where the points begin.
    pub points_at: usize,
    pub points: u64,
    pub format: u8,
    pub is_packed: bool,
    /// Bytes of a point.
    pub stride: usize,
    pub scale: [f64; 3],
    pub offset: [f64; 3],
    /// How the points are packed, as the file says it.
    pub packing: Option<&'a [u8]>,
    pub extra: Vec<ExtraField>,
}

/// `N` bytes at a place.
pub(super) fn array<const N: usize>(bytes: &[u8], at: usize) -> Option<[u8; N]> {
    bytes.get(at..at.checked_add(N)?)?.first_chunk().copied()
}

fn half(bytes: &[u8], at: usize) -> Option<usize> {
    array(bytes, at).map(|b| usize::from(u16::from_le_bytes(b)))
}

fn word(bytes: &[u8], at: usize) -> Option<usize> {
    array(bytes, at).map(|b| u32::from_le_bytes(b) as usize)
}

fn double(bytes: &[u8], at: usize) -> Option<f64> {
    array(bytes, at).map(f64::from_le_bytes)
}

fn three(bytes: &[u8], at: usize) -> Option<[f64; 3]> {
    Some([double(bytes, at)?, double(bytes, at + 8)?, double(bytes, at + 16)?])
}

impl<'a> LasHeader<'a> {
    /// That of a file.
    pub fn of(path: &'a Path, bytes: &'a [u8]) -> Result<LasHeader<'a>> {
        let header = LasHeader::parse(path, bytes).ok_or_else(|| {
            let what = format!("ends within its header: {} bytes are there", bytes.len());
            Error::input(path, "header", what, REMEDY)
        })?;
        let Some(least) = LEAST_POINT_BYTES.get(usize::from(header.format)) else {
            return Err(header.error(format!("has points of format {}, which is not known", header.format)));
        };
        if header.stride < *least {
            let (format, stride) = (header.format, header.stride);
            return Err(header.error(format!("has points of format {format} in {stride} bytes, not {least}")));
        }
        let is_bad = |c: &f64| !c.is_finite();
        if header.scale.iter().any(|c| is_bad(c) || *c == 0.0) || header.offset.iter().any(is_bad) {
            return Err(header.error("has scales or offsets of coordinates that are no numbers"));
        }
        Ok(header)
    }

    fn parse(path: &'a Path, bytes: &'a [u8]) -> Option<LasHeader<'a>> {
        bytes.get(..LEAST_BYTES)?;
        let (minor, format) = (bytes[25], bytes[104]);
        let mut points = word(bytes, 107)? as u64;
        if minor >= 4 {
            points = array(bytes, 247).map(u64::from_le_bytes)?.max(points);
        }
        let mut header = LasHeader {
            path,
            points_at: word(bytes, 96)?,
            points,
            format: format & !PACKED_BITS,
            is_packed: format & PACKED_BITS != 0,
            stride: half(bytes, 105)?,
            scale: three(bytes, 131)?,
            offset: three(bytes, 155)?,
            packing: None,
            extra: Vec::new(),
        };
        header.read_records(bytes);
        Some(header)
    }

    /// The records of variable length that tell of the points. Those that are cut off tell nothing.
    fn read_records(&mut self, bytes: &'a [u8]) {
        let (mut at, count) = (half(bytes, 94).unwrap_or(0), word(bytes, 100).unwrap_or(0));
        for _ in 0..count {
            let (Some(user), Some(number), Some(length)) =
                (bytes.get(at + 2..at + 18), half(bytes, at + 18), half(bytes, at + 20))
            else {
                return;
            };
            let Some(data) = bytes.get(at + RECORD_HEAD_BYTES..at + RECORD_HEAD_BYTES + length) else {
                return;
            };
            if user.starts_with(b"laszip encoded") && number == 22204 {
                self.packing = Some(data);
            } else if user.starts_with(b"LASF_Spec") && number == 4 {
                self.extra = extra_fields(data, usize::from(self.format));
            }
            at += RECORD_HEAD_BYTES + length;
        }
    }

    pub fn error(&self, what: impl ToString) -> Error {
        Error::input(self.path, "header", what, REMEDY)
    }

    /// The fields of normals, as CloudCompare, PDAL and others name them.
    pub fn normals(&self) -> Option<[&ExtraField; 3]> {
        let of = |axis: usize| {
            let is_it = |field: &&ExtraField| Column::of_name(field.name.as_bytes()) == Column::Normal(axis);
            self.extra.iter().find(is_it).filter(|field| field.at + size(field.kind) <= self.stride)
        };
        Some([of(0)?, of(1)?, of(2)?])
    }
}

/// Bytes of a type.
fn size(kind: u8) -> usize {
    match kind {
        1 | 2 => 1,
        3 | 4 => 2,
        5 | 6 | 9 => 4,
        7 | 8 | 10 => 8,
        11..=20 => 2 * size(kind - 10),
        21..=30 => 3 * size(kind - 20),
        _ => 0,
    }
}

/// The numbers that stand behind those of the format.
fn extra_fields(data: &[u8], format: usize) -> Vec<ExtraField> {
    let mut at = LEAST_POINT_BYTES.get(format).copied().unwrap_or(0);
    let field = |record: &[u8]| {
        let (kind, options) = (record[2], record[3]);
        let name = record[4..36].split(|&b| b == 0).next().unwrap_or_default();
        let scale = if options & 8 != 0 { double(record, 112).unwrap_or(1.0) } else { 1.0 };
        let offset = if options & 16 != 0 { double(record, 136).unwrap_or(0.0) } else { 0.0 };
        let field = ExtraField { name: text::plain(name), at, kind, scale, offset };
        // Bytes of no type count themselves.
        at += if kind == 0 { usize::from(options) } else { size(kind) };
        field
    };
    data.chunks_exact(EXTRA_BYTES).map(field).collect()
}

impl ExtraField {
    /// Its value in a point; arrays give their first number.
    pub fn value(&self, point: &[u8]) -> f64 {
        fn read<const N: usize>(point: &[u8], at: usize) -> [u8; N] {
            array(point, at).unwrap_or([0; N])
        }
        let at = self.at;
        let raw = match self.kind {
            1 => f64::from(u8::from_le_bytes(read(point, at))),
            2 => f64::from(i8::from_le_bytes(read(point, at))),
            3 => f64::from(u16::from_le_bytes(read(point, at))),
            4 => f64::from(i16::from_le_bytes(read(point, at))),
            5 => f64::from(u32::from_le_bytes(read(point, at))),
            6 => f64::from(i32::from_le_bytes(read(point, at))),
            7 => u64::from_le_bytes(read(point, at)) as f64,
            8 => i64::from_le_bytes(read(point, at)) as f64,
            9 => f64::from(f32::from_le_bytes(read(point, at))),
            10 => f64::from_le_bytes(read(point, at)),
            _ => 0.0,
        };
        raw * self.scale + self.offset
    }
}
