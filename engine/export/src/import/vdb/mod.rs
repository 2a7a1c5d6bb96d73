//! OpenVDB grids of file versions 222 to 225, with any of its compressions: level sets, fog volumes, integers.
//!
//! A file's tree (see `export/vdb`) is kept without its voxels, which are some times as many bytes; a leaf is unpacked where
//! its voxels are asked for. What lies outside of all nodes is the background.

mod blosc;
mod cursor;
mod half;
mod nodes;
mod transform;
mod tree;
mod values;

use super::description::equal;
use super::grid::{Grid, GridLayout, GridPlacement, SampleType, plain};
use crate::error::{Error, Result};
use crate::mmap::MappedFile;
use cursor::Cursor;
use std::path::Path;
use transform::GridTransform;
use tree::VdbTree;
use values::{ValueCoding, VdbNumber};

const MAGIC: u64 = 0x5644_4220;
/// Versions with the same layout for grids of numbers.
const VERSIONS: std::ops::RangeInclusive<u32> = 222..=225;
/// What stands between a grid's name and its number where several have the same.
const NAME_END: char = '\x1e';
/// What to do with a file of another program.
const AGAIN: &str = "write it by OpenVDB 3 or newer again";

/// A grid as the file's table of contents tells it.
struct GridEntry<'a> {
    name: &'a str,
    kind: &'a str,
    /// Where the grid and its voxels begin.
    places: [usize; 2],
    head: GridHead<'a>,
}

/// What stands before a grid's tree.
struct GridHead<'a> {
    compression: u32,
    class: &'a str,
    unit: Option<&'a str>,
    /// Where the tree's map into the world begins.
    transform_at: usize,
}

impl GridEntry<'_> {
    /// The type of its values, and whether they are kept as halves.
    fn number(&self) -> Option<VdbNumber> {
        VdbNumber::of_tree(self.kind)
    }

    fn told(&self) -> String {
        let kind =
            self.kind.trim_start_matches("Tree_").replace("_5_4_3", "").replace("_HalfFloat", " as half");
        let class = if self.head.class.is_empty() { "no class" } else { self.head.class };
        let name = if self.name.is_empty() { "no name" } else { self.name };
        format!("{}: {}, {}", plain(name), plain(&kind), plain(class))
    }
}

/// Opens a grid: that of the name, or the first one that is read.
pub(super) fn open(path: &Path, file: MappedFile, field: Option<&str>) -> Result<Grid> {
    let entries = entries(path, file.bytes())?;
    let chosen = chosen(path, &entries, field)?;
    let entry = &entries[chosen];
    let number = entry.number().ok_or_else(|| {
        let what = format!("grid {} is of the type {}", plain(entry.name), plain(entry.kind));
        Error::input(path, "grids", what, "give a grid of floats or integers")
    })?;
    let mut cursor = Cursor::new(path, file.bytes(), entry.head.transform_at);
    let transform = GridTransform::read(&mut cursor)?;
    let coding = ValueCoding { number, compression: entry.head.compression, background: 0.0 };
    let tree = VdbTree::read(cursor, entry.places[1], coding)?;
    let place = GridPlacement {
        spacing: equal(path, transform.scale)?,
        origin: transform.world(tree.first()),
        unit: entry.head.unit.map(str::to_owned),
        holds_distances: entry.head.class == "level set",
    };
    let mut fields: Vec<_> = entries.iter().map(GridEntry::told).collect();
    fields.swap(0, chosen);
    let number = match number {
        VdbNumber { kind: SampleType::F64, .. } => SampleType::F64,
        VdbNumber { kind, .. } => kind,
    };
    let layout = GridLayout { number, shape: tree.shape(), place, format: "OpenVDB grid" };
    Ok(Grid::new(path, file, layout, Box::new(tree))?.with_fields(fields, None))
}

fn chosen(path: &Path, entries: &[GridEntry<'_>], field: Option<&str>) -> Result<usize> {
    let will_do = |entry: &GridEntry<'_>| field.map_or(entry.number().is_some(), |name| name == entry.name);
    entries.iter().position(will_do).ok_or_else(|| {
        let all: Vec<_> = entries.iter().map(GridEntry::told).collect();
        let what = match field {
            _ if all.is_empty() => "holds no grid".to_owned(),
            Some(name) => format!("holds no grid {name:?}, but {}", all.join("; ")),
            None => format!("holds no grid of numbers, but {}", all.join("; ")),
        };
        Error::input(path, "grids", what, "name one of its grids, or write one of floats")
    })
}

/// The file's table of contents.
fn entries<'a>(path: &'a Path, bytes: &'a [u8]) -> Result<Vec<GridEntry<'a>>> {
    let mut cursor = Cursor::new(path, bytes, 0);
    if bytes.len() < 8 || cursor.long()? != MAGIC {
        return Err(cursor.error("is no OpenVDB file", AGAIN));
    }
    let version = cursor.word()?;
    if !VERSIONS.contains(&version) {
        let what = format!("is of version {version}, not {} to {}", VERSIONS.start(), VERSIONS.end());
        return Err(cursor.error(what, AGAIN));
    }
    cursor.skip(8)?;
    if cursor.byte()? == 0 {
        return Err(cursor.error("does not tell where its grids begin", "write it to a file, not a stream"));
    }
    cursor.skip(36)?;
    cursor.metadata(|_, _| {})?;
    let count = cursor.word()?;
    let mut entries = Vec::new();
    for _ in 0..count {
        let (name, kind) = (cursor.string()?, cursor.string()?);
        let parent = cursor.string()?;
        let places = [cursor.place()?, cursor.place()?];
        let end = cursor.place()?;
        if !parent.is_empty() {
            let what = format!("grid {name:?} is another name of {parent:?}");
            return Err(cursor.error(what, "write it without instances of grids"));
        }
        let mut inner = Cursor::new(path, bytes, places[0]);
        let head = GridHead::read(&mut inner)?;
        let name = name.split(NAME_END).next().unwrap_or_default();
        entries.push(GridEntry { name, kind, places, head });
        cursor.go_to(end)?;
    }
    Ok(entries)
}

impl<'a> GridHead<'a> {
    fn read(cursor: &mut Cursor<'a>) -> Result<GridHead<'a>> {
        let compression = cursor.word()?;
        let (mut class, mut unit) = ("", None);
        cursor.metadata(|name, value| match name {
            "class" => class = value,
            "unit" => unit = Some(value).filter(|unit| !unit.is_empty()),
            _ => {}
        })?;
        Ok(GridHead { compression, class, unit, transform_at: cursor.at() })
    }
}
