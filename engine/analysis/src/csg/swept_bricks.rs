//! Bricks of solids that were made once, for another chain of the same operands.

use crate::brick::{Brick, codec};
use crate::error::Result;
use crate::lattice::NodeKey;
use crate::part::temporary::TempFile;
use std::collections::HashMap;
use std::path::Path;
use std::sync::{Mutex, PoisonError};

/// Bricks of the last operand of chains, in a temporary file: what is taken off a part, and what is left of it, ask for the
/// same ones.
pub struct SweptBricks {
    file: TempFile,
    /// By node, and by whether all samples of it were wanted.
    places: Mutex<HashMap<(NodeKey, bool), Place>>,
}

/// Where a brick lies.
#[derive(Clone, Copy)]
struct Place {
    offset: u64,
    bytes: u32,
    head: codec::PayloadHead,
}

impl SweptBricks {
    /// None yet. The file is made in `folder` when it is first written.
    pub fn new(folder: &Path) -> SweptBricks {
        SweptBricks { file: TempFile::new(folder), places: Mutex::default() }
    }

    /// The brick of a node, or what `make` makes, which is kept.
    ///
    /// # Errors
    /// What writing or reading the temporary file gives, and `make`.
    pub(super) fn get(
        &self,
        of: (NodeKey, bool),
        scratch: &mut codec::Scratch,
        make: impl FnOnce() -> Result<Brick>,
    ) -> Result<Brick> {
        let place = self.places.lock().unwrap_or_else(PoisonError::into_inner).get(&of).copied();
        if let Some(Place { offset, bytes, head }) = place {
            let mut payload = vec![0; bytes as usize];
            if bytes > 0 {
                self.file.read(offset, &mut payload)?;
            }
            return codec::decode(head.kind, head.min, &payload, scratch).map_err(|_| self.file.damaged());
        }
        let brick = make()?;
        let codec::Payload { head, bytes } = codec::encode(&brick);
        let offset = if bytes.is_empty() { 0 } else { self.file.append(&bytes)? };
        let place = Place { offset, bytes: bytes.len() as u32, head };
        self.places.lock().unwrap_or_else(PoisonError::into_inner).insert(of, place);
        Ok(brick)
    }
}
