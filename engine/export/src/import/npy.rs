//! NumPy's arrays, indexed `[z, y, x]`, whose place in the world a description beside them tells.

use super::description::Description;
use super::grid::{Grid, GridLayout, SampleType, plain};
use crate::error::{Error, Result};
use crate::mmap::MappedFile;
use std::path::Path;

const MAGIC: &[u8] = b"\x93NUMPY";

/// Opens an array.
pub(super) fn open(path: &Path, file: MappedFile, _: Option<&str>) -> Result<Grid> {
    let bytes = file.bytes();
    let bad = |what: &str, remedy: &str| Error::input(path, "header", what, remedy);
    let none = || bad("is no NumPy array", "write it by numpy.save");
    if !bytes.starts_with(MAGIC) || bytes.len() < 12 {
        return Err(none());
    }
    let (start, length): (usize, usize) = match bytes[6] {
        1 => (10, usize::from(u16::from_le_bytes([bytes[8], bytes[9]]))),
        2 | 3 => (12, u32::from_le_bytes([bytes[8], bytes[9], bytes[10], bytes[11]]) as usize),
        _ => return Err(none()),
    };
    let header =
        bytes.get(start..start.saturating_add(length)).and_then(|text| std::str::from_utf8(text).ok());
    let header = header.ok_or_else(none)?;
    if field(header, "fortran_order").is_none_or(|order| !order.starts_with("False")) {
        return Err(bad("is in Fortran's order", "write numpy.ascontiguousarray(array)"));
    }
    let descr = field(header, "descr").and_then(|text| text.split(['\'', '"']).nth(1)).unwrap_or_default();
    let Some(number) = SampleType::of_numpy(descr).filter(|_| !descr.starts_with('>')) else {
        let what = format!("holds values of the type '{}', which is not read", plain(descr));
        return Err(bad(&what, "write array.astype('<f4')"));
    };
    let shape = field(header, "shape").and_then(|text| text.strip_prefix('('));
    let shape = shape.and_then(|text| text.split(')').next()).unwrap_or_default();
    let shape: Vec<usize> =
        shape.split(',').map(str::trim).filter(|n| !n.is_empty()).filter_map(|n| n.parse().ok()).collect();
    let [z, y, x] = shape[..] else {
        let what = format!("has {} axes, not 3", shape.len());
        return Err(bad(&what, "write an array indexed [z, y, x]"));
    };
    let first = start + length;
    let description = Description::beside(path)?;
    description.require_of(path, number, [x, y, z])?;
    let place = description.place(path)?;
    let layout = GridLayout { number, shape: [x, y, z], place, format: "NumPy volume" };
    Grid::in_place(path, file, first, layout)
}

/// What follows a name in the header's dictionary.
fn field<'a>(header: &'a str, name: &str) -> Option<&'a str> {
    let at = header.find(&format!("'{name}'"))? + name.len() + 2;
    Some(header[at..].trim_start_matches([':', ' ']))
}
