//! OME-Zarr 0.5: a folder with an array a level, of Zarr version 3.
//!
//! An array is cut into shards of some bricks an axis, one file each; a chunk within is a brick. Chunks of zeros and shards of
//! such are left out. All levels begin at the same place, since sample 2i of a level is sample i of the next coarser one.

use super::blocks;
use super::{Format, LevelSupport, Volume};
use crate::analysis::{BrickBlock, Element, covering};
use crate::error::{Error, Result};
use crate::lattice::BRICK_CELLS;
use crate::part::PartFile;
use crate::part::folder::PartFolder;
use crate::progress::Progress;
use flate2::Compression;
use flate2::write::GzEncoder;
use rayon::prelude::*;
use std::ffi::OsStr;
use std::io::Write;
use std::path::Path;

/// The format.
pub(super) struct Zarr;

/// What describes a group, and an array.
const DESCRIPTION: &str = "zarr.json";
/// Bricks of a shard along an axis.
const SHARD_BRICKS: u32 = 8;
/// Bytes of a brick of beads, compressed.
const BRICK_BYTES: u128 = 4096;
/// As for other formats.
const GZIP_LEVEL: u32 = 4;
/// What stands for a chunk that is left out.
const ABSENT: u64 = u64::MAX;

impl Format for Zarr {
    fn ending(&self) -> &'static str {
        "zarr"
    }

    fn name(&self) -> &'static str {
        "OME-Zarr, a folder"
    }

    fn levels(&self) -> LevelSupport {
        LevelSupport::Nested
    }

    fn bytes_about(&self, volume: &Volume<'_>) -> u128 {
        blocks::mixed(volume) * BRICK_BYTES + (1 << 20)
    }

    fn require_writable(&self, path: &Path) -> Result<()> {
        PartFolder::create(path, is_own).map(drop)
    }

    fn write(&self, volume: &Volume<'_>, path: &Path, progress: &dyn Progress) -> Result<()> {
        let mut folder = PartFolder::create(path, is_own)?;
        progress.phase("exporting", None, "shards");
        for (number, &level) in volume.levels.iter().enumerate() {
            Array { volume, level }.write(&folder.path().join(number.to_string()), progress)?;
        }
        put(&folder.path().join(DESCRIPTION), group(volume).as_bytes())?;
        folder.finish()
    }
}

/// Whether a group of ours may have an entry of this name: the numbers of levels, and what describes them.
fn is_own(name: &OsStr) -> bool {
    name == DESCRIPTION || name.to_str().is_some_and(|name| name.parse::<u8>().is_ok())
}

/// The group's description.
fn group(volume: &Volume<'_>) -> String {
    let [x, y, z] = volume.origin();
    // What OME-Zarr knows of the units that a store may have.
    let unit = match volume.unit {
        Some("um") => ",\"unit\":\"micrometer\"",
        Some("mm") => ",\"unit\":\"millimeter\"",
        Some("cm") => ",\"unit\":\"centimeter\"",
        Some("m") => ",\"unit\":\"meter\"",
        Some("in") => ",\"unit\":\"inch\"",
        Some("ft") => ",\"unit\":\"foot\"",
        _ => "",
    };
    let axes = ["z", "y", "x"].map(|name| format!("{{\"name\":\"{name}\",\"type\":\"space\"{unit}}}"));
    let datasets = volume.levels.iter().enumerate().map(|(number, &level)| {
        let step = volume.spacing(level);
        format!(
            "{{\"path\":\"{number}\",\"coordinateTransformations\":[{{\"type\":\"scale\",\"scale\":[{step},{step},{step}]}},\
             {{\"type\":\"translation\",\"translation\":[{z},{y},{x}]}}]}}"
        )
    });
    format!(
        "{{\"zarr_format\":3,\"node_type\":\"group\",\"attributes\":{{\"ome\":{{\"version\":\"0.5\",\"multiscales\":[\
         {{\"name\":\"{}\",\"axes\":[{}],\"datasets\":[{}]}}]}}}}}}\n",
        volume.name,
        axes.join(","),
        datasets.collect::<Vec<_>>().join(",")
    )
}

/// One level as an array.
struct Array<'a> {
    volume: &'a Volume<'a>,
    level: u8,
}

impl Array<'_> {
    /// Bricks of a shard along an axis.
    fn shard_bricks(&self) -> u32 {
        SHARD_BRICKS.min(1 << self.level)
    }

    fn write(&self, folder: &Path, progress: &dyn Progress) -> Result<()> {
        let shards = (1u32 << self.level) / self.shard_bricks();
        std::fs::create_dir(folder).map_err(Error::io(folder, "create"))?;
        put(&folder.join(DESCRIPTION), self.description().as_bytes())?;
        let places = (0..shards.pow(3)).map(|n| [n % shards, n / shards % shards, n / shards / shards]);
        places.par_bridge().try_for_each(|place| {
            progress.check()?;
            self.shard(place, folder)?;
            progress.advance(1);
            Ok(())
        })
    }

    fn description(&self) -> String {
        let (axis, shard) = (BRICK_CELLS << self.level, BRICK_CELLS * self.shard_bricks() as usize);
        let kind = match self.volume.element {
            Element::I16 => "int16",
            Element::F32 => "float32",
        };
        let chunk = BRICK_CELLS;
        let fill = f32::from(self.volume.background()) * self.volume.scale(self.level);
        format!(
            "{{\"zarr_format\":3,\"node_type\":\"array\",\"shape\":[{axis},{axis},{axis}],\"data_type\":\"{kind}\",\
             \"chunk_grid\":{{\"name\":\"regular\",\"configuration\":{{\"chunk_shape\":[{shard},{shard},{shard}]}}}},\
             \"chunk_key_encoding\":{{\"name\":\"default\",\"configuration\":{{\"separator\":\"/\"}}}},\
             \"fill_value\":{fill},\"dimension_names\":[\"z\",\"y\",\"x\"],\"attributes\":{{}},\
             \"codecs\":[{{\"name\":\"sharding_indexed\",\"configuration\":{{\"chunk_shape\":[{chunk},{chunk},{chunk}],\
             \"codecs\":[{{\"name\":\"bytes\",\"configuration\":{{\"endian\":\"little\"}}}},\
             {{\"name\":\"gzip\",\"configuration\":{{\"level\":{GZIP_LEVEL}}}}}],\
             \"index_codecs\":[{{\"name\":\"bytes\",\"configuration\":{{\"endian\":\"little\"}}}},{{\"name\":\"crc32c\"}}],\
             \"index_location\":\"end\"}}}}]}}\n"
        )
    }

    /// Writes a shard, unless all of it is empty.
    fn shard(&self, place: [u32; 3], folder: &Path) -> Result<()> {
        let (axis, mut index) = (self.shard_bricks(), Vec::new());
        let mut file: Option<PartFile> = None;
        for n in 0..axis.pow(3) {
            let within = [n % axis, n / axis % axis, n / axis / axis];
            let brick = std::array::from_fn(|a| place[a] * axis + within[a]);
            let Some(chunk) = self.chunk(brick)? else {
                index.extend([ABSENT; 2]);
                continue;
            };
            if file.is_none() {
                let [x, y, z] = place;
                let row = folder.join(format!("c/{z}/{y}"));
                std::fs::create_dir_all(&row).map_err(Error::io(&row, "create"))?;
                file = Some(PartFile::create(&row.join(x.to_string()))?);
            }
            if let Some(file) = &mut file {
                index.extend([file.appended(), chunk.len() as u64]);
                file.append(&chunk)?;
            }
        }
        let Some(mut file) = file else { return Ok(()) };
        let index = index.iter().flat_map(|number| number.to_le_bytes()).collect::<Vec<u8>>();
        file.append(&index)?;
        file.append(&crc32c(&index).to_le_bytes())?;
        file.finish()
    }

    /// The stream of a brick; none of an empty one.
    fn chunk(&self, place: [u32; 3]) -> Result<Option<Vec<u8>>> {
        let (key, node) = covering(self.volume.tree, self.level, place)?;
        let (mut bytes, scale) = (Vec::new(), self.volume.scale(self.level));
        match (node.uniform(), self.volume.element) {
            (Some(value), _) if value == self.volume.background() => return Ok(None),
            (Some(value), Element::I16) => bytes = value.to_le_bytes().repeat(BRICK_CELLS.pow(3)),
            (Some(value), Element::F32) => {
                bytes = (f32::from(value) * scale).to_le_bytes().repeat(BRICK_CELLS.pow(3));
            }
            (None, element) => blocks::with_block(self.volume.tree, key, self.level, place, |block| {
                samples(block, (element, scale), &mut bytes);
            })?,
        }
        if self.volume.background() == 0 && bytes.iter().all(|&byte| byte == 0) {
            return Ok(None);
        }
        let mut encoder = GzEncoder::new(Vec::new(), Compression::new(GZIP_LEVEL));
        let packed = encoder.write_all(&bytes).and_then(|()| encoder.finish());
        packed.map(Some).map_err(Error::io(Path::new("memory"), "compress in"))
    }
}

/// The bytes of a brick's samples, x fastest.
fn samples(block: &BrickBlock<'_>, (element, scale): (Element, f32), out: &mut Vec<u8>) {
    for n in 0..BRICK_CELLS * BRICK_CELLS {
        let at = [n % BRICK_CELLS, n / BRICK_CELLS];
        match element {
            Element::I16 => {
                let mut row = [0; BRICK_CELLS];
                block.integers(at, &mut row);
                out.extend_from_slice(row.map(i16::to_le_bytes).as_flattened());
            }
            Element::F32 => {
                let mut row = [0.0; BRICK_CELLS];
                block.floats(at, &mut row);
                out.extend_from_slice(row.map(|value| (value * scale + 0.0).to_le_bytes()).as_flattened());
            }
        }
    }
}

fn put(path: &Path, bytes: &[u8]) -> Result<()> {
    let mut file = PartFile::create(path)?;
    file.append(bytes)?;
    file.finish()
}

/// Castagnoli's checksum.
fn crc32c(bytes: &[u8]) -> u32 {
    let step = |crc: u32, _| if crc & 1 == 1 { crc >> 1 ^ 0x82f6_3b78 } else { crc >> 1 };
    !bytes.iter().fold(!0, |crc, &byte| (0..8).fold(crc ^ u32::from(byte), step))
}

#[cfg(test)]
mod tests {
    use super::crc32c;

    #[test]
    fn the_checksum_is_that_of_its_standard() {
        assert_eq!(crc32c(b"123456789"), 0xe306_9283);
    }
}
