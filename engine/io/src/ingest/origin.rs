//! Where an input's bytes are: in a file, or in the caller's memory.

use crate::error::Result;
use crate::mmap::MappedFile;
use rayon::prelude::*;

/// Bytes of a file that are hashed at a time.
pub(super) const CHUNK_BYTES: usize = 4 << 20;

/// What an input was made of.
#[derive(Debug)]
pub(super) enum Origin {
    /// A mapped file.
    File(MappedFile),
    /// Arrays that the caller handed over.
    Memory {
        /// Their size.
        bytes: u64,
        /// As [`super::Input::identity`] gives it, of the arrays one after the other, little-endian.
        identity: [u8; 32],
    },
}

impl Origin {
    /// Arrays of numbers as one input: `parts` hands over their bytes, little-endian, in order.
    pub fn memory(parts: impl FnOnce(&mut dyn FnMut(&[u8]))) -> Origin {
        let (mut hasher, mut bytes) = (blake3::Hasher::new(), 0);
        parts(&mut |part| {
            hasher.update(part);
            bytes += part.len() as u64;
        });
        Origin::Memory { bytes, identity: *hasher.finalize().as_bytes() }
    }

    /// Size in bytes.
    pub fn len(&self) -> u64 {
        match self {
            Origin::File(file) => file.len(),
            Origin::Memory { bytes, .. } => *bytes,
        }
    }

    /// The bytes of the file; none of arrays, which were taken over.
    pub fn bytes(&self) -> &[u8] {
        match self {
            Origin::File(file) => file.bytes(),
            Origin::Memory { .. } => &[],
        }
    }

    /// See [`super::Input::check`].
    pub fn check(&self) -> Result<()> {
        match self {
            Origin::File(file) => file.check(),
            Origin::Memory { .. } => Ok(()),
        }
    }

    /// See [`super::Input::identity`].
    pub fn identity(&self) -> Result<[u8; 32]> {
        match self {
            Origin::File(file) => identity_of(file),
            Origin::Memory { identity, .. } => Ok(*identity),
        }
    }
}

/// See [`super::Input::identity`].
fn identity_of(file: &MappedFile) -> Result<[u8; 32]> {
    // Handed out in order, so that all threads together read the file from front to back.
    let chunks = file.bytes().chunks(CHUNK_BYTES).enumerate().par_bridge();
    let hash = |(number, chunk): (usize, &[u8])| (number, *blake3::hash(chunk).as_bytes());
    let identity = hash_of_chunks(chunks.map(hash).collect());
    file.check()?;
    Ok(identity)
}

/// The hash of the chunks' hashes in the order of their numbers.
pub(super) fn hash_of_chunks(mut hashes: Vec<(usize, [u8; 32])>) -> [u8; 32] {
    hashes.sort_unstable_by_key(|(number, _)| *number);
    let hashes: Vec<[u8; 32]> = hashes.into_iter().map(|(_, hash)| hash).collect();
    *blake3::hash(hashes.as_flattened()).as_bytes()
}
