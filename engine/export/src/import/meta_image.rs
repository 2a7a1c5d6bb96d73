//! MetaImage: a text of `Name = value` lines, with the samples behind it or in another file.

use super::description::{equal, raw_layout, require_same};
use super::grid::{Grid, GridLayout, GridPlacement, SampleType, plain};
use super::packed::{Packed, Packing};
use crate::error::{Error, Result};
use crate::mmap::MappedFile;
use std::collections::HashMap;
use std::path::Path;

/// The text ends within so many bytes.
const MOST_BYTES: usize = 1 << 16;

/// The lines of the text by name, and where it ends.
struct Header<'a> {
    path: &'a Path,
    lines: HashMap<String, String>,
    end: usize,
}

impl<'a> Header<'a> {
    fn of(path: &'a Path, bytes: &[u8]) -> Result<Header<'a>> {
        let (mut lines, mut at) = (HashMap::new(), 0);
        let text = &bytes[..bytes.len().min(MOST_BYTES)];
        while let Some(length) = text[at..].iter().position(|&b| b == b'\n') {
            let Ok(line) = std::str::from_utf8(&text[at..at + length]) else { break };
            at += length + 1;
            let Some((name, value)) = line.split_once('=') else { break };
            lines.insert(name.trim().to_ascii_lowercase(), value.trim().to_owned());
            if name.trim() == "ElementDataFile" {
                return Ok(Header { path, lines, end: at });
            }
        }
        let what = "has no line \"ElementDataFile = …\"";
        Err(Error::input(path, format!("byte {at}"), what, "write it as MetaImage again, as by ITK"))
    }

    fn text(&self, name: &str) -> Option<&str> {
        self.lines.get(&name.to_ascii_lowercase()).map(String::as_str)
    }

    fn error(&self, name: &str, remedy: &str) -> Error {
        let what = self.text(name).map_or("is missing".to_owned(), |value| format!("is {}", plain(value)));
        Error::input(self.path, name, what, remedy)
    }

    fn is_true(&self, name: &str) -> bool {
        self.text(name).is_some_and(|value| value.eq_ignore_ascii_case("true"))
    }

    fn three(&self, name: &str) -> Option<[f64; 3]> {
        let numbers: Vec<f64> = self
            .text(name)?
            .split_whitespace()
            .map(str::parse)
            .collect::<std::result::Result<_, _>>()
            .ok()?;
        numbers.try_into().ok()
    }
}

/// Opens an image.
pub(super) fn open(path: &Path, file: MappedFile, _: Option<&str>) -> Result<Grid> {
    let header = Header::of(path, file.bytes())?;
    let layout = layout(&header)?;
    let name = header.text("ElementDataFile").unwrap_or_default().to_owned();
    let is_packed = header.is_true("CompressedData");
    if name == "LOCAL" {
        let end = header.end;
        return samples(path, file, end, layout, is_packed);
    }
    if name.starts_with("LIST") || name.contains('%') {
        return Err(header.error("ElementDataFile", "write all samples into one file"));
    }
    let data = path.parent().unwrap_or(Path::new("")).join(name);
    if data == path.with_extension("raw") {
        require_same(&data, &layout, raw_layout(&data).ok())?;
    }
    samples(&data, MappedFile::open(&data)?, 0, layout, is_packed)
}

/// What a MetaImage beside samples tells of them; `None` if there is none that can be read, or it is of others.
pub(super) fn layout_beside(samples: &Path) -> Option<GridLayout> {
    let path = samples.with_extension("mhd");
    let file = path.exists().then(|| MappedFile::open(&path).ok())??;
    let header = Header::of(&path, file.bytes()).ok()?;
    let name = Path::new(header.text("ElementDataFile")?);
    (samples.file_name() == Some(name.as_os_str())).then(|| layout(&header).ok())?
}

/// What is told of an image's samples.
fn layout(header: &Header<'_>) -> Result<GridLayout> {
    if header.is_true("BinaryDataByteOrderMSB") || header.is_true("ElementByteOrderMSB") {
        return Err(header.error("BinaryDataByteOrderMSB", "write it in little-endian order"));
    }
    if header.text("ElementNumberOfChannels").is_some_and(|channels| channels != "1") {
        return Err(header.error("ElementNumberOfChannels", "write one value a sample"));
    }
    let turned = header.text("TransformMatrix").is_some_and(|matrix| {
        let numbers = matrix.split_whitespace().map(|n| n.parse::<f64>().unwrap_or(f64::NAN));
        !numbers.eq([1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0])
    });
    if turned {
        return Err(header.error("TransformMatrix", "sample it anew along the axes"));
    }
    let number = match header.text("ElementType") {
        Some("MET_CHAR") => SampleType::I8,
        Some("MET_UCHAR") => SampleType::U8,
        Some("MET_SHORT") => SampleType::I16,
        Some("MET_USHORT") => SampleType::U16,
        Some("MET_INT") => SampleType::I32,
        Some("MET_UINT") => SampleType::U32,
        Some("MET_FLOAT") => SampleType::F32,
        Some("MET_DOUBLE") => SampleType::F64,
        _ => return Err(header.error("ElementType", "write it as MET_SHORT or MET_FLOAT")),
    };
    let counts = header.three("DimSize").filter(|n| n.iter().all(|n| *n >= 1.0 && n.fract() == 0.0));
    let shape = counts.ok_or_else(|| header.error("DimSize", "give a volume of three axes"))?;
    let steps = header.three("ElementSpacing").or_else(|| header.three("ElementSize")).unwrap_or([1.0; 3]);
    let origin =
        ["Offset", "Position", "Origin"].iter().find_map(|name| header.three(name)).unwrap_or([0.0; 3]);
    let place =
        GridPlacement { origin, spacing: equal(header.path, steps)?, unit: None, holds_distances: false };
    let shape = shape.map(|n| n as usize);
    Ok(GridLayout { number, shape, place, format: "MetaImage volume" })
}

/// Of the samples in a file from a byte on.
fn samples(path: &Path, file: MappedFile, first: usize, layout: GridLayout, is_packed: bool) -> Result<Grid> {
    if !is_packed {
        return Grid::in_place(path, file, first, layout);
    }
    let end = file.bytes().len();
    let packed = Packed::new(path, &layout, Packing::Stream(first..end))?;
    Grid::new(path, file, layout, Box::new(packed))
}
