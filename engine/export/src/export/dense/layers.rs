//! Samples of a level as zlib streams, in the order of the file.

use crate::error::Result;
use crate::export::Volume;
use crate::export::zlib::Zlib;
use crate::lattice::BRICK_CELLS;
use crate::progress::Progress;
use std::sync::Mutex;

/// Calls `take` with the streams of 32 rows each, rows along x, in the order of y and then z. Memory is the streams of 32
/// layers.
///
/// # Errors
/// What reading the tree and `take` give.
pub(super) fn compressed(
    volume: &Volume<'_>,
    progress: &dyn Progress,
    take: &mut dyn FnMut(&[u8]) -> Result<()>,
) -> Result<()> {
    let (dense, bricks) = (volume.dense()?, (volume.axis() / BRICK_CELLS) as u32);
    progress.phase("exporting", Some(u64::from(bricks) * u64::from(bricks)), "strips");
    for z in 0..bricks {
        let layers = Mutex::new(vec![vec![Vec::new(); bricks as usize]; BRICK_CELLS]);
        dense.slab(z, progress, &|[y, _], layer, rows| {
            let stream = ZLIB.with_borrow_mut(|zlib| zlib.pack(rows).to_vec());
            layers.lock().unwrap_or_else(std::sync::PoisonError::into_inner)[layer][y as usize] = stream;
            Ok(())
        })?;
        let layers = layers.into_inner().unwrap_or_else(std::sync::PoisonError::into_inner);
        layers.iter().flatten().try_for_each(|stream| take(stream))?;
    }
    Ok(())
}

thread_local! {
    static ZLIB: std::cell::RefCell<Zlib> = std::cell::RefCell::new(Zlib::new());
}
