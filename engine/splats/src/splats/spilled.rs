//! Nodes of splats in a temporary file.

use crate::bsp::{Cell, NodeCells, SplatInput};
use crate::error::Result;
use crate::lattice::NodeKey;
use crate::part::temporary::TempFile;
use std::collections::BTreeMap;
use std::path::Path;

/// Bytes of a cell: its place, how many splats it has, how these cut each other, whether it is divided.
const CELL_BYTES: usize = 6;
/// Bytes of a splat.
const SPLAT_BYTES: usize = 16;

/// Nodes that do not fit in memory.
pub(super) struct SpilledNodes {
    /// Bytes that nodes in memory may take.
    most: u64,
    file: TempFile,
    /// Where each lies, how many cells it has and how many splats.
    places: BTreeMap<NodeKey, (u64, u32, u32)>,
}

impl SpilledNodes {
    /// None yet. The file is made in `folder` when it is needed.
    pub fn new(most: u64, folder: &Path) -> SpilledNodes {
        SpilledNodes { most, file: TempFile::new(folder), places: BTreeMap::new() }
    }

    /// Whether nodes come here where so many bytes are in memory. Once one did, all later ones do.
    pub fn takes(&self, bytes: u64) -> bool {
        bytes >= self.most || !self.places.is_empty()
    }

    /// How many there are.
    pub fn len(&self) -> usize {
        self.places.len()
    }

    /// Writes a node.
    ///
    /// # Errors
    /// If the file cannot be made or written.
    pub fn add(&mut self, key: NodeKey, node: &NodeCells<SplatInput>) -> Result<()> {
        let mut bytes = Vec::with_capacity(node.cells.len() * CELL_BYTES + node.splats.len() * SPLAT_BYTES);
        for cell in &node.cells {
            bytes.extend(cell.at);
            bytes.extend([cell.count, cell.clips, u8::from(cell.divided)]);
        }
        for splat in &node.splats {
            let places = splat.normal.iter().chain(&splat.mean);
            places.for_each(|c| bytes.extend(c.to_le_bytes()));
            bytes.extend(splat.error.to_le_bytes());
        }
        let at = self.file.append(&bytes)?;
        self.places.insert(key, (at, node.cells.len() as u32, node.splats.len() as u32));
        Ok(())
    }

    /// Reads a node back.
    ///
    /// # Errors
    /// If the file cannot be read.
    pub fn get(&self, key: NodeKey) -> Result<Option<NodeCells<SplatInput>>> {
        let Some(&(at, cells, splats)) = self.places.get(&key) else { return Ok(None) };
        let cell_bytes = cells as usize * CELL_BYTES;
        let mut bytes = vec![0; cell_bytes + splats as usize * SPLAT_BYTES];
        self.file.read(at, &mut bytes)?;
        let (cells, splats) = bytes.split_at(cell_bytes);
        let mut first = 0;
        let cell = |&[x, y, z, count, clips, divided]: &[u8; CELL_BYTES]| {
            let cell = Cell { at: [x, y, z], first, count, clips, divided: divided != 0 };
            first += u32::from(count);
            cell
        };
        let splat = |bytes: &[u8; SPLAT_BYTES]| {
            let place = |n: usize| i16::from_le_bytes([bytes[2 * n], bytes[2 * n + 1]]);
            let error = u32::from_le_bytes([bytes[12], bytes[13], bytes[14], bytes[15]]);
            SplatInput { normal: [0, 1, 2].map(place), mean: [3, 4, 5].map(place), error }
        };
        Ok(Some(NodeCells {
            cells: cells.as_chunks().0.iter().map(cell).collect(),
            splats: splats.as_chunks().0.iter().map(splat).collect(),
        }))
    }

    /// Calls `each` with all, along the Morton curve.
    ///
    /// # Errors
    /// As [`SpilledNodes::get`], and what `each` gives.
    pub fn each(&self, mut each: impl FnMut(NodeKey, &NodeCells<SplatInput>) -> Result<()>) -> Result<()> {
        for key in self.places.keys() {
            if let Some(node) = self.get(*key)? {
                each(*key, &node)?;
            }
        }
        Ok(())
    }
}
