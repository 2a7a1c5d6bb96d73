//! Files of splats, written: the head in one piece, then level by level, units on all threads.

use super::levels::SplatLevels;
use crate::bsp::{
    Cells, CodedUnit, Directions, Entry, HEADER_BYTES, Header, LEVELS_MAX, Level, Model, NodeCells, Setting,
    Splat, SplatInput, crc32, root, unit,
};
use crate::error::Result;
use crate::lattice::{BRICK_CELLS, NodeKey, Octant};
use crate::part::PartFile;
use crate::progress::Progress;
use crate::range::Encoder;
use crate::schedule::run_ordered;
use std::collections::BTreeMap;
use std::path::Path;

/// Radius of the directions of normals: 3,846 of them, within 3 degrees of any.
const RADIUS: u8 = 31;
/// Deepest level of the head.
const HEAD_LEVEL: u8 = 1;
/// Units a thread that are coded ahead of the one that is taken.
const UNITS_AHEAD: usize = 4;

/// What was written.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct BspSummary {
    /// Bytes of the file.
    pub bytes: u64,
    /// Splats of all levels, and of the finest cells alone.
    pub splats: u64,
    /// Splats of cells that are not divided: the finest picture.
    pub finest: u64,
    /// Greatest distance of a crossing from the splat that stands for it in the finest picture, in the store's unit.
    pub error: f64,
}

/// Writes a file of splats. It gets its name when it is complete.
///
/// `unit` is the unit of length, as in `mm`, and `bounds` are the least and greatest coordinates of the part.
///
/// # Errors
/// What writing gives; [`crate::error::Error::Interrupted`].
pub fn write_bsp(
    levels: &SplatLevels,
    unit: &str,
    bounds: [[f64; 3]; 2],
    path: &Path,
    progress: &dyn Progress,
) -> Result<BspSummary> {
    let mut file = PartFile::create(path)?;
    let (bytes, summary) = bsp_bytes(levels, unit, bounds, progress)?;
    file.append(&bytes)?;
    file.finish()?;
    Ok(summary)
}

/// The bytes of a file of splats.
///
/// # Errors
/// [`crate::error::Error::Interrupted`].
pub fn bsp_bytes(
    levels: &SplatLevels,
    unit: &str,
    bounds: [[f64; 3]; 2],
    progress: &dyn Progress,
) -> Result<(Vec<u8>, BspSummary)> {
    progress.phase("coding splats", Some(levels.len() as u64), "nodes");
    let coding = UnitCoding { levels, directions: Directions::new(RADIUS) };
    let mut taken = TakenUnits {
        deepest: levels.deepest(),
        pieces: BTreeMap::new(),
        header: header(levels, unit, bounds),
        finest: (0, 0.0),
    };
    let (head, model) = coding.head(&mut taken)?;
    let (mut entries, mut units) = (Vec::new(), Vec::new());
    for level in taken.header.head..levels.deepest() {
        coding.level(level, &model, &mut taken, progress, &mut |entry, bytes| {
            entries.push(entry);
            units.extend(bytes);
        })?;
    }
    let TakenUnits { mut header, finest, .. } = taken;
    let directory: Vec<u8> = entries.iter().flat_map(Entry::to_bytes).collect();
    header.units = entries.len() as u32;
    header.head_bytes = head.len() as u32;
    header.head_crc = crc32(0, &head);
    header.directory_crc = crc32(0, &directory);
    let mut bytes = header.to_bytes().to_vec();
    bytes.reserve(directory.len() + head.len() + units.len());
    bytes.extend(directory);
    bytes.extend(head);
    bytes.extend(units);
    let summary = BspSummary {
        bytes: bytes.len() as u64,
        splats: header.levels.iter().map(|level| level.splats).sum(),
        finest: finest.0,
        error: finest.1,
    };
    debug_assert!(bytes.len() >= HEADER_BYTES);
    Ok((bytes, summary))
}

fn header(levels: &SplatLevels, unit: &str, bounds: [[f64; 3]; 2]) -> Header {
    let mut name = [0; 8];
    let text = unit.bytes().filter(u8::is_ascii_alphabetic);
    name.iter_mut().zip(text).for_each(|(to, from)| *to = from);
    Header {
        // Cells lie between samples, which are a unit off.
        origin: levels.root().to_world([1.0; 3]),
        edge: levels.root().edge,
        bounds,
        unit: name,
        deepest: levels.deepest(),
        radius: RADIUS,
        head: HEAD_LEVEL.min(levels.deepest()),
        units: 0,
        head_bytes: 0,
        head_crc: 0,
        directory_crc: 0,
        levels: [Level::default(); LEVELS_MAX],
    }
}

/// What units are coded from.
struct UnitCoding<'a> {
    levels: &'a SplatLevels,
    directions: Directions,
}

/// What is known of the units that were coded.
struct TakenUnits {
    deepest: u8,
    /// Of the level that is divided next, as readers will have them.
    pieces: BTreeMap<NodeKey, NodeCells<Splat>>,
    header: Header,
    /// Splats of cells that are not divided, and the greatest error of these, in the store's unit.
    finest: (u64, f64),
}

impl UnitCoding<'_> {
    /// The root's cells and the units of the head's levels.
    fn head(&self, taken: &mut TakenUnits) -> Result<(Vec<u8>, Model)> {
        let (mut bytes, mut model) = (Vec::new(), Model::new());
        let mut coder = Encoder::new(&mut bytes);
        let wanted = self.levels.node(NodeKey::ROOT)?.unwrap_or_default().found_by_place();
        let may_divide = self.levels.deepest() > 0;
        let coded = root(&mut coder, &mut model, &self.directions, may_divide, Some(&wanted));
        let CodedUnit { cells, error } = coded.expect("an encoder refuses nothing");
        taken.take(0, error, [(NodeKey::ROOT, cells.piece)]);
        for level in 0..taken.header.head {
            let pieces = std::mem::take(&mut taken.pieces);
            for (key, piece) in pieces.iter().filter(|(_, piece)| piece.is_divided()) {
                let coded = self.unit(*key, piece, &mut coder, &mut model)?;
                taken.take(level + 1, coded.error, children(*key, &coded));
            }
        }
        coder.finish();
        Ok((bytes, model.elsewhere()))
    }

    /// The units that divide the nodes of a level.
    fn level(
        &self,
        level: u8,
        model: &Model,
        taken: &mut TakenUnits,
        progress: &dyn Progress,
        out: &mut (dyn FnMut(Entry, Vec<u8>) + Send),
    ) -> Result<()> {
        let pieces = std::mem::take(&mut taken.pieces);
        let divided: Vec<_> = pieces.iter().filter(|(_, piece)| piece.is_divided()).collect();
        let work = |(): &mut (), number: usize| {
            progress.check()?;
            let (key, piece) = divided[number];
            let (mut bytes, mut model) = (Vec::new(), model.clone());
            let mut coder = Encoder::new(&mut bytes);
            let coded = self.unit(*key, piece, &mut coder, &mut model)?;
            coder.finish();
            progress.advance(8);
            Ok((*key, bytes, coded))
        };
        let take = |(key, bytes, coded): (NodeKey, Vec<u8>, CodedUnit)| {
            let crc = Entry::crc_of(key.code(), &bytes);
            let splats = coded.cells.piece.splats.len() as u32;
            out(Entry { key: key.code(), bytes: bytes.len() as u32, crc, splats, error: coded.error }, bytes);
            taken.take(level + 1, coded.error, children(key, &coded));
            Ok(())
        };
        run_ordered(divided.len(), UNITS_AHEAD * rayon::current_num_threads(), || (), work, take)
    }

    fn unit(
        &self,
        key: NodeKey,
        piece: &NodeCells<Splat>,
        coder: &mut Encoder<'_>,
        model: &mut Model,
    ) -> Result<CodedUnit> {
        let may_divide = key.level() + 1 < self.levels.deepest();
        let setting = Setting { directions: &self.directions, may_divide, has_parents: true };
        let wanted = self.wanted(key)?;
        let coded = unit(coder, model, &setting, &piece.found_by_place(), Some(&wanted));
        Ok(coded.expect("an encoder refuses nothing"))
    }

    /// The cells of a node's children in one cube.
    fn wanted(&self, key: NodeKey) -> Result<Cells<SplatInput>> {
        let mut cells = Cells::new(2 * BRICK_CELLS);
        for octant in Octant::all() {
            let Some(piece) = self.levels.node(key.child(octant))? else { continue };
            let low = octant.offset().map(|c| (c * BRICK_CELLS) as u8);
            for cell in &piece.cells {
                let at = std::array::from_fn(|a| cell.at[a] + low[a]);
                cells.push(at, piece.of(cell), cell.clips, cell.divided);
            }
        }
        Ok(cells)
    }
}

impl TakenUnits {
    /// Counts the nodes of a unit, and keeps those that are divided. `error` is the unit's.
    fn take(&mut self, level: u8, error: u32, pieces: impl IntoIterator<Item = (NodeKey, NodeCells<Splat>)>) {
        let cell = self.header.cell(level);
        let of_level = &mut self.header.levels[usize::from(level)];
        of_level.error = of_level.error.max(error);
        for (key, piece) in pieces {
            of_level.splats += piece.splats.len() as u64;
            let undivided = piece.cells.iter().filter(|cell| !cell.divided);
            let finest = undivided.map(|cell| u64::from(cell.count)).sum::<u64>();
            if finest > 0 {
                self.finest.0 += finest;
                self.finest.1 = self.finest.1.max(f64::from(error) / 4096.0 * cell);
            }
            if level < self.deepest && piece.is_divided() {
                self.pieces.insert(key, piece);
            }
        }
    }
}

/// The children of a node, of its unit.
fn children(key: NodeKey, coded: &CodedUnit) -> Vec<(NodeKey, NodeCells<Splat>)> {
    Octant::all().map(|octant| key.child(octant)).zip(coded.cells.octants()).collect()
}
