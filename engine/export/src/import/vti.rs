//! VTK image data: XML with arrays as text, as base64, or behind the elements.

use super::description::equal;
use super::grid::{Grid, GridLayout, GridPlacement, SampleType, plain};
use super::packed::{Packed, Packing};
use super::tags::{Tag, tags};
use crate::error::{Error, Result};
use crate::mmap::MappedFile;
use std::ops::Range;
use std::path::Path;

/// What is said of values that belong to cells.
const OF_CELLS: &str = "its values are those of cells, taken for samples at their middles";

/// An array of the file.
struct DataArray<'a> {
    tag: Tag<'a>,
    /// Of cells, not of points.
    is_cells: bool,
    /// Whether the element that it stands in names it.
    is_scalars: bool,
    /// What stands between its tags.
    content: Range<usize>,
}

impl DataArray<'_> {
    fn name(&self) -> &str {
        self.tag.value("Name").unwrap_or("")
    }

    fn number(&self) -> Option<SampleType> {
        Some(match self.tag.value("type")? {
            "Int8" => SampleType::I8,
            "UInt8" => SampleType::U8,
            "Int16" => SampleType::I16,
            "UInt16" => SampleType::U16,
            "Int32" => SampleType::I32,
            "UInt32" => SampleType::U32,
            "Int64" => SampleType::I64,
            "UInt64" => SampleType::U64,
            "Float32" => SampleType::F32,
            "Float64" => SampleType::F64,
            _ => return None,
        })
    }

    fn has_one_component(&self) -> bool {
        self.tag.value("NumberOfComponents").is_none_or(|count| count == "1")
    }

    fn told(&self) -> String {
        let kind = self.tag.value("type").unwrap_or("no type");
        format!(
            "{}: {}, of {}",
            plain(self.name()),
            plain(kind),
            if self.is_cells { "cells" } else { "points" }
        )
    }
}

/// The elements of a file.
#[derive(Default)]
struct Elements<'a> {
    file: Option<Tag<'a>>,
    image: Option<Tag<'a>>,
    pieces: Vec<Tag<'a>>,
    arrays: Vec<DataArray<'a>>,
    appended: Option<Tag<'a>>,
}

impl<'a> Elements<'a> {
    fn of(path: &Path, bytes: &'a [u8]) -> Result<Elements<'a>> {
        let mut found = Elements::default();
        let mut section: Option<(bool, &str)> = None;
        for tag in tags(bytes) {
            let tag = tag.map_err(|at| bad(path, format!("byte {at}"), "is no tag of XML"))?;
            match tag.name {
                "VTKFile" => found.file = Some(tag),
                "ImageData" => found.image = Some(tag),
                "Piece" => found.pieces.push(tag),
                "PointData" | "CellData" => {
                    section = Some((tag.name == "CellData", tag.value("Scalars").unwrap_or("")));
                }
                "/PointData" | "/CellData" => section = None,
                "DataArray" => {
                    let Some((is_cells, scalars)) = section else { continue };
                    let length = bytes[tag.end..].iter().position(|&b| b == b'<').unwrap_or(0);
                    let (content, is_scalars) =
                        (tag.end..tag.end + length, tag.value("Name") == Some(scalars));
                    found.arrays.push(DataArray { tag, is_cells, is_scalars, content });
                }
                "AppendedData" => {
                    found.appended = Some(tag);
                    break;
                }
                _ => {}
            }
        }
        Ok(found)
    }

    /// The array that is asked for, or the first one that will do: of points, named by its element.
    fn chosen(&self, path: &Path, field: Option<&str>) -> Result<usize> {
        let will_do = |n: &usize| {
            let array = &self.arrays[*n];
            field.map_or(array.has_one_component() && array.number().is_some(), |name| name == array.name())
        };
        let best = |n: &usize| (self.arrays[*n].is_cells, !self.arrays[*n].is_scalars);
        (0..self.arrays.len()).filter(will_do).min_by_key(best).ok_or_else(|| {
            let all: Vec<_> = self.arrays.iter().map(DataArray::told).collect();
            let what = match (field, all.is_empty()) {
                (_, true) => "holds no array of points or cells".to_owned(),
                (Some(name), _) => format!("holds no array {name:?}, but {}", all.join("; ")),
                (None, _) => format!("holds no array with one value a sample, but {}", all.join("; ")),
            };
            Error::input(path, "DataArray", what, "name one of its arrays, or write one")
        })
    }
}

fn bad(path: &Path, place: impl ToString, what: impl ToString) -> Error {
    Error::input(path, place, what, "write it as VTK image data again, as by vtkXMLImageDataWriter")
}

/// As many numbers as are wanted.
fn numbers<const N: usize>(text: &str) -> Option<[f64; N]> {
    let all: Vec<f64> = text.split_whitespace().map(|word| word.parse().ok()).collect::<Option<_>>()?;
    all.try_into().ok()
}

/// Opens an image.
pub(super) fn open(path: &Path, file: MappedFile, field: Option<&str>) -> Result<Grid> {
    let elements = Elements::of(path, file.bytes())?;
    let (Some(head), Some(image)) = (&elements.file, &elements.image) else {
        return Err(bad(path, "VTKFile", "is no image data of VTK's XML"));
    };
    if head.value("byte_order").is_some_and(|order| order != "LittleEndian") {
        return Err(bad(path, "byte_order", "is not LittleEndian"));
    }
    let is_zlib = match head.value("compressor") {
        None | Some("") => false,
        Some("vtkZLibDataCompressor") => true,
        Some(other) => {
            let remedy = "write it with zlib, or without compression";
            return Err(Error::input(path, "compressor", format!("is {}", plain(other)), remedy));
        }
    };
    let header_bytes = if head.value("header_type") == Some("UInt64") { 8 } else { 4 };
    let chosen = elements.chosen(path, field)?;
    let array = &elements.arrays[chosen];
    let layout = layout(path, image, &elements.pieces, array)?;
    let note = array.is_cells.then_some(OF_CELLS);
    let mut fields: Vec<_> = elements.arrays.iter().map(DataArray::told).collect();
    fields.swap(0, chosen);
    fields[1..].sort();
    let format = array.tag.value("format").unwrap_or("ascii");
    let packing = match format {
        "ascii" => Packing::Text(array.content.clone()),
        "binary" => Packing::Vtk { range: array.content.clone(), is_base64: true, is_zlib, header_bytes },
        _ => appended(path, file.bytes(), &elements, array, is_zlib, header_bytes)?,
    };
    let grid = match &packing {
        Packing::Vtk { range, is_base64: false, is_zlib: false, header_bytes } => {
            let first = range.start + header_bytes;
            let head = file.bytes().get(range.start..first).unwrap_or_default();
            let told = head.iter().rev().fold(0, |told, &byte| told << 8 | u64::from(byte));
            if layout.bytes() != usize::try_from(told).ok() {
                return Err(layout.wrong_size(path, first, told as usize));
            }
            Grid::in_place(path, file, first, layout)
        }
        _ => {
            let packed = Packed::new(path, &layout, packing)?;
            Grid::new(path, file, layout, Box::new(packed))
        }
    };
    Ok(grid?.with_fields(fields, note))
}

/// Where an array stands behind the elements.
fn appended(
    path: &Path,
    bytes: &[u8],
    elements: &Elements<'_>,
    array: &DataArray<'_>,
    is_zlib: bool,
    header_bytes: usize,
) -> Result<Packing> {
    let Some(tag) = &elements.appended else {
        return Err(bad(path, "AppendedData", "is missing"));
    };
    let is_base64 = tag.value("encoding") != Some("raw");
    let mark = bytes[tag.end..].iter().position(|b| !b.is_ascii_whitespace());
    let start = mark.filter(|&mark| bytes[tag.end + mark] == b'_').map(|mark| tag.end + mark + 1);
    let offset = array.tag.value("offset").and_then(|text| text.parse::<usize>().ok());
    let first = start.zip(offset).and_then(|(start, offset)| start.checked_add(offset));
    let Some(first) = first.filter(|&first| first <= bytes.len()) else {
        return Err(bad(path, "AppendedData", format!("has no byte for the array {:?}", array.name())));
    };
    let length = match is_base64 {
        true => bytes[first..].iter().position(|&b| b == b'<').unwrap_or(bytes.len() - first),
        false => bytes.len() - first,
    };
    Ok(Packing::Vtk { range: first..first + length, is_base64, is_zlib, header_bytes })
}

fn layout(path: &Path, image: &Tag<'_>, pieces: &[Tag<'_>], array: &DataArray<'_>) -> Result<GridLayout> {
    let number = array.number().filter(|_| array.has_one_component()).ok_or_else(|| {
        let remedy = "write one number a sample, as Float32";
        Error::input(path, "DataArray", format!("is {}", array.told()), remedy)
    })?;
    let three = |name: &str, default: f64| match image.value(name) {
        None => Ok([default; 3]),
        Some(text) => numbers::<3>(text).ok_or_else(|| bad(path, name, format!("is {text:?}"))),
    };
    if image.value("Direction").is_some_and(|text| {
        numbers::<9>(text).is_none_or(|matrix| matrix != [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0])
    }) {
        let remedy = "sample it anew along the axes";
        return Err(Error::input(path, "Direction", "is not that of the axes", remedy));
    }
    let whole = image.value("WholeExtent").unwrap_or_default();
    let [piece] = pieces else {
        return Err(bad(path, "Piece", format!("stands there {} times, not once", pieces.len())));
    };
    let extent = numbers::<6>(piece.value("Extent").unwrap_or(whole));
    let is_index = |e: &[f64; 6]| e.iter().all(|c| c.fract() == 0.0 && c.abs() < 1e9);
    let is_growing = |e: &[f64; 6]| (0..3).all(|a| e[2 * a] <= e[2 * a + 1]);
    let Some(extent) = extent.filter(|e| is_index(e) && is_growing(e)) else {
        return Err(bad(path, "Extent", format!("is {:?}", piece.value("Extent").unwrap_or(whole))));
    };
    let (origin, steps) = (three("Origin", 0.0)?, three("Spacing", 1.0)?);
    let (points, shift) = if array.is_cells { (0, 0.5) } else { (1, 0.0) };
    let shape = std::array::from_fn(|a| (extent[2 * a + 1] - extent[2 * a]) as usize + points);
    let place = GridPlacement {
        origin: std::array::from_fn(|a| origin[a] + (extent[2 * a] + shift) * steps[a]),
        spacing: equal(path, steps)?,
        unit: None,
        holds_distances: false,
    };
    Ok(GridLayout { number, shape, place, format: "VTK image data" })
}
