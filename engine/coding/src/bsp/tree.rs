//! A file of splats as it is read: the head first, then any unit whose parents are there.

use super::cells::{Cells, NodeCells, Splat, SplatInput};
use super::directions::Directions;
use super::header::{crc32, Entry, Fault, Header, ENTRY_BYTES};
use super::model::Model;
use super::unit::{unit, CodedUnit, Setting};
use crate::range::{Coder, Decoder};
use std::collections::BTreeMap;

/// The root's key.
const ROOT: u64 = 1;

/// Codes the root's cells.
pub fn root<C: Coder>(
    coder: &mut C,
    model: &mut Model,
    directions: &Directions,
    may_divide: bool,
    wanted: Option<&Cells<SplatInput>>,
) -> Option<CodedUnit> {
    let mut above = Cells::new(16);
    for n in 0..16u32 * 16 * 16 {
        above.push([n % 16, n / 16 % 16, n / 256].map(|c| c as u8), &[], 0, true);
    }
    unit(coder, model, &Setting { directions, may_divide, has_parents: false }, &above, wanted)
}

/// What was read of a file.
pub struct SplatTree {
    header: Header,
    entries: Vec<Entry>,
    /// Where each unit begins.
    starts: Vec<u64>,
    directions: Directions,
    model: Model,
    pieces: BTreeMap<u64, NodeCells<Splat>>,
    /// Checksum of the entries so far.
    directory_crc: u32,
}

impl SplatTree {
    /// Reads header, directory and head from the beginning of a file.
    ///
    /// # Errors
    /// What is wrong with them. All that is read is checked against the bytes that are there.
    pub fn open(bytes: &[u8]) -> Result<SplatTree, Fault> {
        let header = Header::read(bytes)?;
        if bytes.len() < header.units_start() {
            return Err(Fault("it ends within its head"));
        }
        let directory = &bytes[super::HEADER_BYTES..header.head_start()];
        let head = &bytes[header.head_start()..header.units_start()];
        SplatTree::open_part(header, directory, head)
    }

    /// The same where only a beginning of the directory is there yet, in whole entries; [`SplatTree::add_entries`] takes more.
    ///
    /// # Errors
    /// What is wrong with what is there. The directory's checksum is checked when all of it is; units have their own.
    pub fn open_part(header: Header, directory: &[u8], head: &[u8]) -> Result<SplatTree, Fault> {
        if head.len() != header.head_bytes as usize || crc32(0, head) != header.head_crc {
            return Err(Fault("its head is damaged"));
        }
        let starts = vec![header.units_start() as u64];
        let directions = Directions::new(header.radius);
        let (entries, model, pieces) = (Vec::new(), Model::new(), BTreeMap::new());
        let mut tree = SplatTree { header, entries, starts, directions, model, pieces, directory_crc: 0 };
        tree.read_head(head).ok_or(Fault("its head says what cannot be"))?;
        tree.add_entries(directory)?;
        Ok(tree)
    }

    /// Takes in the next entries of the directory.
    ///
    /// # Errors
    /// What is wrong with them.
    pub fn add_entries(&mut self, directory: &[u8]) -> Result<(), Fault> {
        let units = self.header.units as usize;
        let more = directory.len() / ENTRY_BYTES;
        if directory.len() % ENTRY_BYTES != 0 || more > units - self.entries.len() {
            return Err(Fault("its directory says what cannot be"));
        }
        self.directory_crc = crc32(self.directory_crc, directory);
        for entry in directory.chunks_exact(ENTRY_BYTES).map(Entry::read) {
            self.starts.push(self.starts[self.starts.len() - 1] + u64::from(entry.bytes));
            self.entries.push(entry);
        }
        if self.entries.len() == units && self.directory_crc != self.header.directory_crc {
            return Err(Fault("its directory is damaged"));
        }
        self.check_directory()
    }

    fn read_head(&mut self, head: &[u8]) -> Option<()> {
        let (mut coder, mut model) = (Decoder::new(head), Model::new());
        let may_divide = self.header.deepest > 0;
        let cells = root(&mut coder, &mut model, &self.directions, may_divide, None)?.cells;
        self.pieces.insert(ROOT, cells.piece);
        for level in 0..self.header.head {
            let keys = self.divided(level);
            for key in keys {
                let setting = self.setting(level);
                let parents = self.pieces[&key].found_by_place();
                let cells = unit(&mut coder, &mut model, &setting, &parents, None)?.cells;
                self.insert(key, &cells);
            }
        }
        self.model = model.elsewhere();
        if coder.finish() {
            Some(())
        } else {
            None
        }
    }

    /// Entries go up, and those of the head's last level are just its divided nodes, as far as they are there.
    fn check_directory(&self) -> Result<(), Fault> {
        let fault = Err(Fault("its directory says what cannot be"));
        let Header { head, deepest, units, .. } = self.header;
        let is_sorted = self.entries.windows(2).all(|pair| pair[0].key < pair[1].key);
        let level = |entry: &Entry| level_of(entry.key);
        let is_deep = |level: Option<u8>| level.map_or(false, |l| l >= head && l < deepest);
        let first = self.entries.iter().filter(|entry| level(entry) == Some(head));
        let first = first.map(|entry| entry.key).collect::<Vec<_>>();
        let divided = self.divided(head);
        // Where no more entries of that level can come.
        let is_whole = self.entries.len() == units as usize || first.len() < self.entries.len();
        let is_first = head == deepest || first == divided || (!is_whole && divided.starts_with(&first));
        if is_sorted && is_first && self.entries.iter().all(|entry| is_deep(level(entry))) {
            Ok(())
        } else {
            fault
        }
    }

    fn setting(&self, level: u8) -> Setting<'_> {
        let may_divide = level + 1 < self.header.deepest;
        Setting { directions: &self.directions, may_divide, has_parents: true }
    }

    /// Nodes of a level that have divided cells.
    fn divided(&self, level: u8) -> Vec<u64> {
        let range = self.pieces.range(1u64 << (3 * level)..2u64 << (3 * level));
        range.filter(|(_, piece)| piece.is_divided()).map(|(&key, _)| key).collect()
    }

    fn insert(&mut self, key: u64, cells: &Cells<Splat>) {
        for (octant, piece) in cells.octants().into_iter().enumerate() {
            if !piece.cells.is_empty() {
                self.pieces.insert(key * 8 + octant as u64, piece);
            }
        }
    }

    /// What the file says of itself.
    pub fn header(&self) -> &Header {
        &self.header
    }

    /// Its units, by level, along the Morton curve within a level.
    pub fn entries(&self) -> &[Entry] {
        &self.entries
    }

    /// Where a unit begins in the file; the one behind the last where the file ends.
    pub fn start(&self, unit: usize) -> u64 {
        self.starts[unit]
    }

    /// The directions of its normals.
    pub fn directions(&self) -> &Directions {
        &self.directions
    }

    /// The nodes that were read, with their cells.
    pub fn pieces(&self) -> &BTreeMap<u64, NodeCells<Splat>> {
        &self.pieces
    }

    /// Decodes a unit: the cubes of cells of up to eight nodes.
    ///
    /// # Errors
    /// What is wrong with the bytes; nothing is wrong with the tree then.
    pub fn decode(&self, unit_number: usize, bytes: &[u8]) -> Result<Cells<Splat>, Fault> {
        let entry = self.entries[unit_number];
        if bytes.len() != entry.bytes as usize || Entry::crc_of(entry.key, bytes) != entry.crc {
            return Err(Fault("a unit is damaged"));
        }
        let mut coder = Decoder::new(bytes);
        let coded = self.decode_with(unit_number, &mut coder)?;
        if coder.finish() && coded.piece.splats.len() == entry.splats as usize {
            Ok(coded)
        } else {
            Err(Fault("a unit says what cannot be"))
        }
    }

    /// The same from any coder, as from one that counts.
    ///
    /// # Errors
    /// What is wrong with what it gives.
    pub fn decode_with<C: Coder>(&self, unit_number: usize, coder: &mut C) -> Result<Cells<Splat>, Fault> {
        let entry = self.entries[unit_number];
        let parents = self.pieces.get(&entry.key).filter(|piece| piece.is_divided());
        let parents = parents.ok_or(Fault("a unit has no cells to divide"))?.found_by_place();
        let level = level_of(entry.key).unwrap_or(0);
        let mut model = self.model.clone();
        let coded = unit(coder, &mut model, &self.setting(level), &parents, None);
        coded.map(|coded| coded.cells).ok_or(Fault("a unit says what cannot be"))
    }

    /// The number of a node's unit, if the directory has it so far.
    pub fn unit_of(&self, key: u64) -> Option<usize> {
        self.entries.binary_search_by_key(&key, |entry| entry.key).ok()
    }

    /// Leaves out again what a unit gave, as if it had not been taken in. What came from units below it must be left out before.
    pub fn forget(&mut self, unit_number: usize) {
        let key = self.entries[unit_number].key;
        for octant in 0..8 {
            // An empty piece, since removing takes more code than a page should load.
            if let Some(piece) = self.pieces.get_mut(&(key * 8 + octant)) {
                *piece = NodeCells::new();
            }
        }
    }

    /// Takes in what was decoded.
    pub fn take(&mut self, unit_number: usize, cells: &Cells<Splat>) {
        self.insert(self.entries[unit_number].key, cells);
    }
}

/// The level of a node; none if it is no node's key.
pub(super) fn level_of(key: u64) -> Option<u8> {
    let top = 63u32.checked_sub(key.leading_zeros())?;
    if top % 3 == 0 {
        Some((top / 3) as u8)
    } else {
        None
    }
}
