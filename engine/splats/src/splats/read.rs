//! Files of splats, read.

use crate::bsp::{Fault, Header, SplatTree};
use crate::error::{Error, Result};
use crate::progress::Progress;
use rayon::prelude::*;
use std::path::Path;

/// Largest file that is read.
const BYTES_MAX: u64 = 4 << 30;

/// Reads a whole file of splats, to `level` or to the deepest.
///
/// # Errors
/// [`Error::Store`] if it is none or damaged; what reading gives.
pub fn read_bsp(path: &Path, level: Option<u8>, progress: &dyn Progress) -> Result<SplatTree> {
    let size = std::fs::metadata(path).map_err(Error::io(path, "read"))?.len();
    if size > BYTES_MAX {
        let what = format!("it has {size} bytes, and files of splats are read up to {BYTES_MAX}");
        return Err(Error::store(path, "file", what, "write it with a larger `error`"));
    }
    let bytes = std::fs::read(path).map_err(Error::io(path, "read"))?;
    let refused =
        |Fault(what)| Error::store(path, "file of splats", what, "write it again with `brickfield splats`");
    read_tree(&bytes, level, progress)?.map_err(refused)
}

/// The same of bytes in memory; the inner result says what is wrong with them.
///
/// # Errors
/// [`Error::Interrupted`].
pub fn read_tree(
    bytes: &[u8],
    level: Option<u8>,
    progress: &dyn Progress,
) -> Result<std::result::Result<SplatTree, Fault>> {
    let mut tree = match SplatTree::open(bytes) {
        Ok(tree) => tree,
        Err(fault) => return Ok(Err(fault)),
    };
    let Header { deepest, head, .. } = *tree.header();
    if tree.start(tree.entries().len()) != bytes.len() as u64 {
        return Ok(Err(Fault("its size is not what its directory says")));
    }
    progress.phase("reading splats", Some(tree.entries().len() as u64), "units");
    let last = level.unwrap_or(deepest).min(deepest);
    let mut from = 0;
    for parents in head..last {
        // All units of a level are independent.
        let to = tree.entries().partition_point(|entry| entry.key < 2u64 << (3 * parents));
        for some in (from..to).collect::<Vec<_>>().chunks(16 * rayon::current_num_threads()) {
            progress.check()?;
            let decode = |&unit: &usize| {
                let [start, end] = [unit, unit + 1].map(|n| tree.start(n) as usize);
                tree.decode(unit, &bytes[start..end])
            };
            let decoded: Vec<_> = some.par_iter().map(decode).collect();
            for (unit, cells) in some.iter().zip(decoded) {
                match cells {
                    Ok(cells) => tree.take(*unit, &cells),
                    Err(fault) => return Ok(Err(fault)),
                }
            }
            progress.advance(some.len() as u64);
        }
        from = to;
    }
    Ok(Ok(tree))
}
