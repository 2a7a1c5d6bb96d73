//! VTKHDF: an overlapping AMR image, a block a brick.
//!
//! Level n of the image is level n of the tree. A block has 32³ cells and, with its apron, 33³ points; the points are the
//! samples. The values of cells are the means of their eight points, exactly. A block is a chunk of its level's arrays,
//! compressed by itself, and bricks of zeros are left out: readers put zeros in their place.

mod hdf5;
mod streams;
mod tree;

use super::blocks;
use super::{Format, LevelSupport, Volume};
use crate::analysis::{BrickBlock, Element};
use crate::error::Result;
use crate::lattice::{BRICK_CELLS, NodeKey};
use crate::part::PartFile;
use crate::progress::Progress;
use crate::schedule::run_ordered;
use crate::store::Walk;
use hdf5::{Attribute, DataLayout, Datatype, Object};
use std::path::Path;
use streams::{CELLS, POINTS, StreamMaker, Streams};
use tree::Chunk;

/// The format.
pub(super) struct VtkHdf;

/// Version of the format, the first that knows this kind of data; newer ones are refused by readers before them.
const VERSION: [i64; 2] = [1, 0];
/// Bricks that a thread makes at once.
const BRICKS_AT_ONCE: usize = 8;
/// Bytes of a block of beads, compressed, points and cells.
const BLOCK_BYTES: u128 = 8192;

impl Format for VtkHdf {
    fn ending(&self) -> &'static str {
        "vtkhdf"
    }

    fn name(&self) -> &'static str {
        "VTKHDF, an AMR image"
    }

    fn levels(&self) -> LevelSupport {
        LevelSupport::Nested
    }

    /// Readers put zeros where bricks are left out.
    fn takes_distances(&self) -> bool {
        false
    }

    fn bytes_about(&self, volume: &Volume<'_>) -> u128 {
        blocks::mixed(volume) * BLOCK_BYTES + volume.tree.keys().len() as u128 * 24 + (1 << 16)
    }

    fn write(&self, volume: &Volume<'_>, path: &Path, progress: &dyn Progress) -> Result<()> {
        let mut file = PartFile::create(path)?;
        file.append(&[0; hdf5::SUPERBLOCK_BYTES])?;
        let mut levels = volume.levels.clone();
        levels.sort_unstable();
        let mut root = Object::group();
        root.attributes = vec![
            Attribute::new("Version", Datatype::I64, Some(2), VERSION.map(i64::to_le_bytes).concat()),
            Attribute::text("Type", "OverlappingAMR"),
            Attribute::new("Origin", Datatype::F64, Some(3), volume.origin().map(f64::to_le_bytes).concat()),
            Attribute::text("GridDescription", "XYZ"),
        ];
        progress.phase("exporting", None, "bricks");
        for (number, &level) in levels.iter().enumerate() {
            let group = Level::new(volume, level, levels.len() == 1)?.write(&mut file, progress)?;
            root.links.push((format!("Level{number}"), group));
        }
        let root = root.append(&mut file)?;
        let mut top = Object::group();
        top.links.push(("VTKHDF".to_owned(), root));
        let top = top.append(&mut file)?;
        file.overwrite(0, &hdf5::superblock(file.appended(), top))?;
        file.finish()
    }
}

/// A block and the node that its samples come from.
#[derive(Clone, Copy)]
struct Place {
    position: [u32; 3],
    key: NodeKey,
}

/// One level of the image.
struct Level<'a> {
    volume: &'a Volume<'a>,
    level: u8,
    places: Vec<Place>,
}

impl<'a> Level<'a> {
    /// The blocks of a level's nodes. Alone, a level also has the parts of coarser leaves that are not 0.
    fn new(volume: &'a Volume<'a>, level: u8, alone: bool) -> Result<Level<'a>> {
        let of_level = |key: &NodeKey| key.level() == level;
        let own = volume.tree.keys().into_iter().filter(of_level);
        let mut places = own.map(|key| Place { position: key.position(), key }).collect::<Vec<_>>();
        if alone {
            let is_leaf = |key: &NodeKey| {
                key.level() < level
                    && volume.tree.node(*key).is_some_and(|node| node.leaf && node.uniform() != Some(0))
            };
            for key in volume.tree.keys().into_iter().filter(is_leaf) {
                let (axis, up) = (1u32 << (level - key.level()), level - key.level());
                let first = key.position().map(|p| p << up);
                places.extend((0..axis.pow(3)).map(|n| {
                    let offset = [n % axis, n / axis % axis, n / axis / axis];
                    Place { position: std::array::from_fn(|a| first[a] + offset[a]), key }
                }));
            }
        }
        Ok(Level { volume, level, places })
    }

    fn point_kind(&self) -> Datatype {
        match self.volume.element {
            Element::I16 => Datatype::I16,
            Element::F32 => Datatype::F32,
        }
    }

    /// Writes the level's arrays and returns where its group lies.
    fn write(&self, file: &mut PartFile, progress: &dyn Progress) -> Result<u64> {
        let mut chunks = [Vec::new(), Vec::new()];
        let parts = self.places.len().div_ceil(BRICKS_AT_ONCE);
        let part = |number: usize| {
            let end = ((number + 1) * BRICKS_AT_ONCE).min(self.places.len());
            number * BRICKS_AT_ONCE..end
        };
        let tree = self.volume.tree;
        let walk = Walk::new(tree, self.places.len(), |step| {
            let key = self.places[step].key;
            tree.node(key).filter(|node| node.uniform().is_none()).map(|_| key)
        });
        let work = |maker: &mut StreamMaker, number: usize| {
            progress.check()?;
            walk.at(part(number).start);
            part(number).map(|n| Ok((n, self.block(maker, self.places[n])?))).collect::<Result<Vec<_>>>()
        };
        let take = |made: Vec<(usize, Option<Streams>)>| {
            progress.advance(made.len() as u64);
            for (number, streams) in made {
                for (chunks, stream) in chunks.iter_mut().zip(streams.into_iter().flatten()) {
                    chunks.push(Chunk {
                        number: number as u64,
                        at: file.appended(),
                        bytes: stream.len() as u32,
                    });
                    file.append(&stream)?;
                }
            }
            Ok(())
        };
        run_ordered(parts, 4 * rayon::current_num_threads(), StreamMaker::new, work, take)?;
        self.group(&chunks, file)
    }

    /// The streams of points and cells of a block; none of a block of zeros.
    fn block(&self, maker: &mut StreamMaker, place: Place) -> Result<Option<Streams>> {
        let node = self.volume.tree.node(place.key);
        let kind = self.point_kind();
        match node.and_then(|node| node.uniform()) {
            Some(0) => Ok(None),
            Some(value) => Ok(Some(maker.uniform(value, kind))),
            None => {
                let of = |block: &BrickBlock<'_>| maker.block(block, kind);
                blocks::with_block(self.volume.tree, place.key, self.level, place.position, of).map(Some)
            }
        }
    }

    fn group(&self, chunks: &[Vec<Chunk>; 2], file: &mut PartFile) -> Result<u64> {
        let count = self.places.len() as u64;
        let step = self.volume.spacing(self.level).to_le_bytes().repeat(3);
        let mut group = Object::group();
        group.attributes.push(Attribute::new("Spacing", Datatype::F64, Some(3), step));
        let arrays = [("PointData", POINTS, self.point_kind()), ("CellData", CELLS, Datatype::F32)];
        for ((name, block, kind), chunks) in arrays.into_iter().zip(chunks) {
            let index = tree::write(chunks, block as u64, file)?;
            let array = Object::array(
                kind,
                vec![count * block as u64],
                DataLayout::Chunked { index, chunk: block as u32 },
            );
            let array = array.append(file)?;
            let mut data = Object::group();
            data.links.push((self.volume.name.to_owned(), array));
            group.links.push((name.to_owned(), data.append(file)?));
        }
        let boxes = self.places.iter().flat_map(|place| {
            let first = place.position.map(|p| p * BRICK_CELLS as u32);
            first.into_iter().flat_map(|f| [f, f + BRICK_CELLS as u32 - 1])
        });
        let bytes = boxes.flat_map(u32::to_le_bytes).collect::<Vec<u8>>();
        let (at, length) = (file.appended(), bytes.len() as u64);
        file.append(&bytes)?;
        let boxes = Object::array(Datatype::I32, vec![count, 6], DataLayout::Whole { at, bytes: length });
        group.links.push(("AMRBox".to_owned(), boxes.append(file)?));
        group.append(file)
    }
}
