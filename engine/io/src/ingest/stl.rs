//! Binary STL, read in place.
//!
//! ```text
//! byte 0    80 bytes of header, free text
//!      80    u32 n, the number of facets
//!      84    n records of 50 bytes: normal 3×f32, corners 3×3×f32, attribute u16   (all little-endian)
//! ```
//! Normals and attributes are ignored: the order of the corners says which side is outside.

use super::bounds::FacetBounds;
use crate::error::{Error, Result};
use std::path::Path;

/// Bytes before the first facet.
const HEADER_BYTES: usize = 84;
/// Bytes of a facet.
const RECORD_BYTES: usize = 50;
/// One facet as it lies in the file.
type Record = [u8; RECORD_BYTES];

/// Number of facets that the header claims, if there is one.
fn claimed(bytes: &[u8]) -> Option<usize> {
    let count = bytes.get(80..HEADER_BYTES)?.first_chunk::<4>()?;
    Some(u32::from_le_bytes(*count) as usize)
}

/// What follows the facets that the header claims; `None` if they are not all there.
fn trailer(bytes: &[u8]) -> Option<&[u8]> {
    bytes.get(HEADER_BYTES + claimed(bytes)? * RECORD_BYTES..)
}

/// True if the size alone shows a binary STL, whatever the header says: the header often begins with "solid",
/// as text files do. A text cannot get here by chance below 7 GB, since four printable bytes in the place of
/// the count claim that much. A trailer that [`facets`] lets pass is let pass here too, if there are facets.
pub(super) fn has_exact_size(bytes: &[u8]) -> bool {
    trailer(bytes).is_some_and(|rest| rest.is_empty() || claimed(bytes) != Some(0) && is_padding(rest))
}

/// Exporters append line ends, checksums and sector padding. Anything shorter than a facet, and zeros of any
/// length, can hide no facet; anything else means that the count is wrong, so that geometry would be lost.
fn is_padding(rest: &[u8]) -> bool {
    rest.len() < RECORD_BYTES || rest.iter().all(|&b| b == 0)
}

/// Checks the size of the file against the count in its header; returns the count. Allocates nothing.
///
/// # Errors
/// If the file ends early, or goes on with what may be more facets.
pub(super) fn facets(path: &Path, bytes: &[u8]) -> Result<u64> {
    let present = bytes.len();
    let Some(count) = claimed(bytes) else {
        return Err(Error::input(
            path,
            format!("byte {present}"),
            "ends inside the header of a binary STL (84 bytes)",
            "export or copy the file again",
        ));
    };
    let expected = HEADER_BYTES + count * RECORD_BYTES;
    let whole = (present - HEADER_BYTES) / RECORD_BYTES;
    match trailer(bytes) {
        None => Err(Error::input(
            path,
            format!("byte {present}"),
            format!(
                "header claims {count} facets ({expected} bytes), but the file ends after {whole} whole facets \
                 ({present} bytes)"
            ),
            "export or copy the file again",
        )),
        Some(rest) if !is_padding(rest) => Err(Error::input(
            path,
            format!("byte {expected}"),
            format!(
                "header claims {count} facets ({expected} bytes), but {} bytes follow, room for {} more facets",
                rest.len(),
                whole - count
            ),
            "export the file again, or write the right count at byte 80",
        )),
        Some(_) => Ok(count as u64),
    }
}

/// The records of the facets `from..to`, which [`facets`] has found to be there.
pub(super) fn records(bytes: &[u8], from: usize, to: usize) -> &[Record] {
    bytes[HEADER_BYTES + from * RECORD_BYTES..HEADER_BYTES + to * RECORD_BYTES].as_chunks().0
}

/// How many facets a file has room for that begin before a byte.
pub(super) fn facets_before(byte: usize) -> usize {
    byte.saturating_sub(HEADER_BYTES).div_ceil(RECORD_BYTES)
}

/// The corners of a facet.
#[inline]
pub(super) fn corners(record: &Record) -> [[f64; 3]; 3] {
    let all = floats(record);
    std::array::from_fn(|corner| std::array::from_fn(|axis| f64::from(all[3 + 3 * corner + axis])))
}

/// The twelve floats of a facet: normal, then corners.
#[inline]
fn floats(record: &Record) -> [f32; 12] {
    std::array::from_fn(|i| {
        f32::from_le_bytes([record[4 * i], record[4 * i + 1], record[4 * i + 2], record[4 * i + 3]])
    })
}

/// Extent of `records`; facets are numbered from 0 within them.
///
/// Keeps a minimum and a maximum per float of the record, normal included, so that the loop is the same for
/// all twelve and becomes three 4-wide operations of each kind; the normal's results are dropped. A float is
/// NaN or infinite iff its exponent bits are all ones, which a carry into the sign bit shows.
pub(super) fn extent(records: &[Record]) -> FacetBounds {
    const EXPONENT_UNIT: u32 = 1 << 23;
    let mut low = [f32::INFINITY; 12];
    let mut high = [f32::NEG_INFINITY; 12];
    let mut carries = [0u32; 12];
    for record in records {
        let values = floats(record);
        for i in 0..12 {
            low[i] = if values[i] < low[i] { values[i] } else { low[i] };
            high[i] = if values[i] > high[i] { values[i] } else { high[i] };
            carries[i] |= (values[i].to_bits() & !(1 << 31)) + EXPONENT_UNIT;
        }
    }
    let bad = carries[3..].iter().any(|carry| carry >> 31 == 1);
    if bad && let Some(first) = records.iter().position(|record| !is_finite(record)) {
        return FacetBounds::bad(first as u64);
    }
    let mut extent = FacetBounds::EMPTY;
    for corner in 1..4 {
        extent.include(std::array::from_fn(|axis| f64::from(low[3 * corner + axis])));
        extent.include(std::array::from_fn(|axis| f64::from(high[3 * corner + axis])));
    }
    extent
}

/// True if all corners of the facet are finite.
fn is_finite(record: &Record) -> bool {
    floats(record)[3..].iter().all(|value| value.is_finite())
}
