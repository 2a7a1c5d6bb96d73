//! OpenVDB: a sparse grid a level, of file version 224.
//!
//! A grid is a tree of nodes of 32³, 16³ and 8³, the last of voxels (Museth 2013, "VDB: High-Resolution Sparse Volumes with
//! Dynamic Topology"). The background is 0 and exactly the voxels with another value are active. Of level sets it is the half
//! width of the band, and exactly the voxels within the band are active; others inside have its opposite. A brick is 64 leaves, and
//! where it is uniform 64 tiles. Voxel `[x, y, z]` is the sample of that index.
//!
//! A file has the topology of a grid before its voxels. Both come from one walk over the bricks: voxels wait in a temporary
//! file beside the output, so memory is that of the nodes of 16³ that threads are at, some megabytes each.

mod node;
mod pack;

use super::blocks;
use super::{Format, LevelSupport, Quantity, Volume};
use crate::analysis::{Element, covering};
use crate::error::Result;
use crate::lattice::{BRICK_CELLS, NodeKey};
use crate::part::temporary::TempFile;
use crate::part::{PartFile, directory_of};
use crate::progress::Progress;
use crate::schedule::run_ordered;
use crate::store::{BrickTree, Walk};
use node::{NodeBuilder, NodeBytes};
use pack::{Inactive, Mask, ValueStreams, put_string, put_values, word};
use std::path::Path;

const MAGIC: u64 = 0x5644_4220;
const FILE_VERSION: u32 = 224;
/// Version of the library whose format it is.
const LIBRARY_VERSION: [u32; 2] = [10, 0];
/// The identity of a file; a fixed one, since equal volumes are to be equal files.
const IDENTITY: &[u8; 36] = b"b41c1d00-0000-4000-8000-627269636b66";
/// zlib, and active values alone.
const COMPRESSION: u32 = 1 | 2;
/// Bits of a node of 16³'s place in a node of 32³, per axis.
const SLOT_BITS: u32 = 5;
/// LevelSupport of bricks in a node of 16³, which spans 4³ bricks.
pub(super) const NODE_LEVELS: u8 = 2;
/// Nodes of 16³ a thread that are made ahead of the one that is written.
const NODES_AHEAD: usize = 3;
/// Bytes of a brick of beads, compressed.
const BRICK_BYTES: u128 = 4096;
/// Bytes of voxels that are copied at a time.
const COPIED_BYTES: usize = 1 << 20;

/// The format.
pub(super) struct Vdb;

impl Format for Vdb {
    fn ending(&self) -> &'static str {
        "vdb"
    }

    fn name(&self) -> &'static str {
        "OpenVDB grids"
    }

    fn levels(&self) -> LevelSupport {
        LevelSupport::Several
    }

    /// Many readers know floats only.
    fn element(&self) -> Element {
        Element::F32
    }

    fn bytes_about(&self, volume: &Volume<'_>) -> u128 {
        // Voxels are written twice, once into the temporary file.
        2 * blocks::mixed(volume) * BRICK_BYTES + (1 << 16)
    }

    fn write(&self, volume: &Volume<'_>, path: &Path, progress: &dyn Progress) -> Result<()> {
        let mut file = PartFile::create(path)?;
        let mut head = Vec::new();
        head.extend(MAGIC.to_le_bytes());
        [FILE_VERSION, LIBRARY_VERSION[0], LIBRARY_VERSION[1]]
            .iter()
            .for_each(|&number| word(&mut head, number));
        // Grids have offsets, so that readers find one without reading those before it.
        head.push(1);
        head.extend(IDENTITY);
        put_metadata(&mut head, &[("creator", "Brickfield")]);
        word(&mut head, volume.levels.len() as u32);
        file.append(&head)?;
        for (number, &level) in volume.levels.iter().enumerate() {
            let name = if number == 0 { volume.name.to_owned() } else { format!("{}_{number}", volume.name) };
            Grid { volume, level }.write(&name, &mut file, progress)?;
        }
        file.finish()
    }
}

fn put_metadata(out: &mut Vec<u8>, entries: &[(&str, &str)]) {
    word(out, entries.len() as u32);
    for (name, value) in entries {
        put_string(out, name);
        put_string(out, "string");
        put_string(out, value);
    }
}

/// One level as a grid.
#[derive(Clone, Copy)]
struct Grid<'a> {
    volume: &'a Volume<'a>,
    level: u8,
}

/// What a node of 32³ has at a place.
enum Slot {
    Empty,
    /// Inside of a level set, beyond its band.
    Inner,
    Tile(u32),
    Child,
}

impl Grid<'_> {
    fn tree(&self) -> &dyn BrickTree {
        self.volume.tree
    }

    fn write(&self, name: &str, file: &mut PartFile, progress: &dyn Progress) -> Result<()> {
        let mut head = Vec::new();
        put_string(&mut head, name);
        let tree = if self.volume.element == Element::F32 { "Tree_float_5_4_3" } else { "Tree_int32_5_4_3" };
        put_string(&mut head, tree);
        put_string(&mut head, "");
        file.append(&head)?;
        let offsets = file.appended();
        file.append(&[0; 24])?;
        let grid_at = file.appended();
        file.append(&self.head(name))?;
        let temporary = TempFile::new(directory_of(file.path()));
        self.topology(file, &temporary, progress)?;
        let voxels_at = file.appended();
        copy(&temporary, file)?;
        let places = [grid_at, voxels_at, file.appended()].map(u64::to_le_bytes).concat();
        file.overwrite(offsets, &places)
    }

    /// What stands before the tree: metadata and the place in the world.
    fn head(&self, name: &str) -> Vec<u8> {
        let mut head = Vec::new();
        word(&mut head, COMPRESSION);
        let class = match self.volume.quantity {
            Quantity::Winding | Quantity::Thickness => "fog volume",
            Quantity::Distance => "level set",
            Quantity::Labels => "unknown",
        };
        let mut entries = vec![("class", class), ("name", name)];
        entries.extend(self.volume.unit.map(|unit| ("unit", unit)));
        put_metadata(&mut head, &entries);
        put_string(&mut head, "UniformScaleTranslateMap");
        let spacing = self.volume.spacing(self.level);
        let inverse = spacing.recip();
        let scales = [spacing, spacing, inverse, inverse * inverse, inverse / 2.0];
        for vector in [self.volume.origin()].into_iter().chain(scales.map(|scale| [scale; 3])) {
            head.extend(vector.map(f64::to_le_bytes).as_flattened());
        }
        head
    }

    /// Writes the tree without its voxels, which go to the temporary file.
    fn topology(&self, file: &mut PartFile, voxels: &TempFile, progress: &dyn Progress) -> Result<()> {
        let slots_bits = u32::from(self.level.saturating_sub(NODE_LEVELS));
        let roots = 1u32 << slots_bits.saturating_sub(SLOT_BITS);
        let axis = (1u32 << slots_bits).min(1 << SLOT_BITS);
        let mut head = Vec::new();
        // One buffer, and the background.
        word(&mut head, 1);
        word(&mut head, self.bits(self.volume.background()));
        let places = (0..roots.pow(3)).map(|n| [n / roots / roots, n / roots % roots, n % roots]);
        let occupied = |place: &[u32; 3]| -> Result<bool> {
            for slot in slots(*place, axis) {
                if !matches!(self.slot(slot)?, Slot::Empty) {
                    return Ok(true);
                }
            }
            Ok(false)
        };
        let mut nodes = Vec::new();
        for place in places {
            if occupied(&place)? {
                nodes.push(place);
            }
        }
        word(&mut head, 0);
        word(&mut head, nodes.len() as u32);
        file.append(&head)?;
        progress.phase("exporting", None, "nodes");
        nodes.into_iter().try_for_each(|place| self.node_32(place, axis, file, voxels, progress))
    }

    fn node_32(
        &self,
        place: [u32; 3],
        axis: u32,
        file: &mut PartFile,
        voxels: &TempFile,
        progress: &dyn Progress,
    ) -> Result<()> {
        let (mut children, mut tiles) = (Mask::<4096>::new(), Mask::<4096>::new());
        let mut inactive = Inactive::<4096>::new();
        let (mut values, mut made) = (Vec::new(), Vec::new());
        for slot in slots(place, axis) {
            let [x, y, z] = slot.map(|s| s as usize & 31);
            let index = x << 10 | y << 5 | z;
            match self.slot(slot)? {
                Slot::Empty => inactive.outer.set(index),
                Slot::Inner => inactive.inner.set(index),
                Slot::Tile(value) => {
                    tiles.set(index);
                    values.push(value);
                }
                Slot::Child => {
                    children.set(index);
                    made.push(slot);
                }
            }
        }
        let mut head = Vec::new();
        place.iter().for_each(|p| word(&mut head, p << (SLOT_BITS + 7)));
        head.extend(children.bytes());
        head.extend(tiles.bytes());
        put_values(&mut head, &values, &inactive, &mut ValueStreams::new());
        file.append(&head)?;
        self.children(&made, file, voxels, progress)
    }

    /// Makes the nodes of 16³ on all threads and writes them in order.
    fn children(
        &self,
        slots: &[[u32; 3]],
        file: &mut PartFile,
        voxels: &TempFile,
        progress: &dyn Progress,
    ) -> Result<()> {
        let tree = self.tree();
        let walk = Walk::new(tree, slots.len() * 64, |step| {
            let place = self.places(slots[step / 64]).nth(step % 64)?;
            let (key, node) = covering(tree, self.level, place).ok()?;
            node.uniform().is_none().then_some(key)
        });
        let scale = self.volume.scale(self.level);
        let inner =
            (self.volume.quantity == Quantity::Distance).then(|| self.bits(-self.volume.background()));
        let outer = self.bits(self.volume.background());
        let work = |maker: &mut NodeBuilder, number: usize| {
            progress.check()?;
            walk.at(number * 64);
            for place in self.places(slots[number]) {
                let (key, node) = covering(tree, self.level, place)?;
                match node.uniform() {
                    Some(value) if value == self.volume.background() => {}
                    Some(value) => maker.add_uniform(place, self.bits(value)),
                    None => {
                        blocks::with_block(tree, key, self.level, place, |block| match self.volume.element {
                            // No negative zero.
                            Element::F32 => maker.add(place, |at, row| {
                                let mut floats = [0.0; BRICK_CELLS];
                                block.floats(at, &mut floats);
                                *row = floats.map(|value| (value * scale + 0.0).to_bits());
                            }),
                            Element::I16 => maker.add(place, |at, row| {
                                let mut whole = [0; BRICK_CELLS];
                                block.integers(at, &mut whole);
                                *row = whole.map(|value| i32::from(value) as u32);
                            }),
                        })?
                    }
                }
            }
            Ok(maker.finish())
        };
        let take = |made: NodeBytes| {
            progress.advance(1);
            file.append(&made.topology)?;
            voxels.append(&made.voxels).map(|_| ())
        };
        let ahead = NODES_AHEAD * rayon::current_num_threads();
        run_ordered(slots.len(), ahead, || NodeBuilder::new(outer, inner), work, take)
    }

    /// The places of the bricks of a node of 16³.
    fn places(&self, slot: [u32; 3]) -> impl Iterator<Item = [u32; 3]> + use<> {
        let axis = 1u32 << self.level.min(NODE_LEVELS);
        let first = slot.map(|s| s * axis);
        (0..axis.pow(3)).map(move |n| {
            let offset = [n / axis / axis, n / axis % axis, n % axis];
            std::array::from_fn(|a| first[a] + offset[a])
        })
    }

    fn slot(&self, slot: [u32; 3]) -> Result<Slot> {
        let above = self.level.saturating_sub(NODE_LEVELS);
        let (key, node) = covering(self.tree(), above, slot)?;
        Ok(match node.uniform() {
            Some(value) if node.leaf && value == self.volume.background() => Slot::Empty,
            Some(_)
                if node.leaf && self.volume.quantity == Quantity::Distance && self.level >= NODE_LEVELS =>
            {
                Slot::Inner
            }
            // A node of 16³ that is not filled by its bricks is no tile.
            Some(value) if node.leaf && self.level >= NODE_LEVELS => Slot::Tile(self.bits(value)),
            _ if self.occupied(key) => Slot::Child,
            _ => Slot::Empty,
        })
    }

    /// Whether a node has, at the level, samples other than the background, as far as the index tells.
    fn occupied(&self, key: NodeKey) -> bool {
        match self.tree().node(key) {
            Some(node) if node.leaf || key.level() >= self.level => {
                node.uniform() != Some(self.volume.background())
            }
            Some(_) => crate::lattice::Octant::all().any(|octant| self.occupied(key.child(octant))),
            None => false,
        }
    }

    fn bits(&self, value: i16) -> u32 {
        match self.volume.element {
            Element::F32 => (f32::from(value) * self.volume.scale(self.level)).to_bits(),
            Element::I16 => i32::from(value) as u32,
        }
    }
}

/// The places of the nodes of 16³ in a node of 32³, in the order of their index.
fn slots(place: [u32; 3], axis: u32) -> impl Iterator<Item = [u32; 3]> {
    (0..axis.pow(3)).map(move |n| {
        let offset = [n / axis / axis, n / axis % axis, n % axis];
        std::array::from_fn(|a| (place[a] << SLOT_BITS) + offset[a])
    })
}

fn copy(from: &TempFile, to: &mut PartFile) -> Result<()> {
    let mut bytes = vec![0; COPIED_BYTES];
    let mut at = 0;
    while at < from.bytes() {
        let part = (from.bytes() - at).min(COPIED_BYTES as u64) as usize;
        from.read(at, &mut bytes[..part])?;
        to.append(&bytes[..part])?;
        at += part as u64;
    }
    Ok(())
}
