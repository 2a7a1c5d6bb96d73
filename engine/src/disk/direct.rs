//! Writing a large file past the page cache.
//!
//! A file that must be durable goes to the disk in any case. Through the page cache it is copied into fresh pages, which
//! are looked up once more to be written back: two fifths of the processor time of making a mesh. Here the disk takes it
//! from where it is gathered, block by block, while the next block is filled.

use super::DiskFile;
use super::planted::{Bug, planted};
use std::io::{Error, ErrorKind, Result};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::JoinHandle;

/// What begins and ends on a multiple of this, in the file and in memory, any disk takes.
pub(crate) const ALIGN: usize = 4096;
/// Bytes that are written at a time. Smaller ones wait for the disk more often than it waits for them.
const BLOCK_BYTES: usize = if cfg!(test) { 2 * ALIGN } else { 4 << 20 };
/// One that is filled, one that is written, and one for when either takes longer than usual.
const BLOCKS: usize = 3;

/// [`BLOCK_BYTES`] of memory in the right place.
struct Block {
    bytes: Vec<u8>,
    start: usize,
}

impl Block {
    fn new() -> Block {
        let bytes = vec![0; BLOCK_BYTES + ALIGN];
        // Where memory does not tell its place, the disk refuses the block.
        let start = bytes.as_ptr().align_offset(ALIGN).min(ALIGN);
        Block { bytes, start }
    }

    fn whole(&mut self) -> &mut [u8] {
        &mut self.bytes[self.start..][..BLOCK_BYTES]
    }
}

/// The growing end of a file. One that is dropped waits for what is being written.
pub(crate) struct DirectWriter {
    file: Arc<dyn DiskFile>,
    filling: Block,
    filled: usize,
    /// Where the block that is filled goes.
    offset: u64,
    full: Option<Sender<(Block, u64)>>,
    /// Locked by nobody: it only makes the whole one that threads may share.
    empty: Mutex<Receiver<Block>>,
    thread: Option<JoinHandle<Result<()>>>,
}

impl DirectWriter {
    /// Begins at a multiple of [`ALIGN`], up to which everything is written. `None` if the file cannot be written so.
    pub fn begin(file: &Arc<dyn DiskFile>, offset: u64) -> Option<DirectWriter> {
        let direct = file.direct()?;
        let cached = Arc::clone(file);
        let ((full, to_write), (written, empty)) = (channel::<(Block, u64)>(), channel());
        (1..BLOCKS).try_for_each(|_| written.send(Block::new())).ok()?;
        let work = move || {
            for (mut block, offset) in to_write {
                write_block([&direct, &cached], block.whole(), offset)?;
                // Nobody takes it any more when the last block is on its way.
                let _ = written.send(block);
            }
            Ok(())
        };
        let thread = std::thread::Builder::new().name("direct writes".into()).spawn(work).ok()?;
        Some(DirectWriter {
            file: Arc::clone(file),
            filling: Block::new(),
            filled: 0,
            offset,
            full: Some(full),
            empty: Mutex::new(empty),
            thread: Some(thread),
        })
    }

    /// Adds bytes. They may be written much later.
    ///
    /// # Errors
    /// That of the first block that could not be written. Nothing more can then be added.
    pub fn append(&mut self, mut bytes: &[u8]) -> Result<()> {
        while !bytes.is_empty() {
            let (now, later) = bytes.split_at(bytes.len().min(BLOCK_BYTES - self.filled));
            self.filling.whole()[self.filled..][..now.len()].copy_from_slice(now);
            self.filled += now.len();
            bytes = later;
            if self.filled == BLOCK_BYTES {
                self.turn_over()?;
            }
        }
        Ok(())
    }

    /// Gives the block that is full away, and takes one that is written.
    fn turn_over(&mut self) -> Result<()> {
        let empty = self.empty.get_mut().unwrap_or_else(PoisonError::into_inner);
        let Ok(next) = empty.recv() else { return Err(self.failure()) };
        let full = std::mem::replace(&mut self.filling, next);
        let given = self.full.as_ref().is_some_and(|to| to.send((full, self.offset)).is_ok());
        (self.offset, self.filled) = (self.offset + BLOCK_BYTES as u64, 0);
        if given { Ok(()) } else { Err(self.failure()) }
    }

    /// Writes the rest, which is no whole block, and waits for all. Nothing is durable yet.
    ///
    /// # Errors
    /// As [`DirectWriter::append`].
    pub fn finish(mut self) -> Result<()> {
        let written = self.join();
        if !planted(Bug::DirectFailureIgnored) {
            written?;
        }
        let filled = self.filled;
        self.file.write_all_at(&self.filling.whole()[..filled], self.offset)
    }

    fn failure(&mut self) -> Error {
        self.join().expect_err("the thread goes on until it fails or has nothing more to do")
    }

    /// Waits for the thread, once.
    fn join(&mut self) -> Result<()> {
        drop(self.full.take());
        let earlier = || Err(Error::other("an earlier write failed"));
        self.thread.take().map_or_else(earlier, |thread| thread.join().expect("the thread does not panic"))
    }
}

impl Drop for DirectWriter {
    fn drop(&mut self) {
        // The thread holds the file open, and with it the lock. Who did not finish has no use for the error.
        let _ = self.join();
    }
}

/// Writes a block past the page cache or, where the disk will not have it so, through it.
fn write_block([direct, cached]: [&Arc<dyn DiskFile>; 2], block: &[u8], offset: u64) -> Result<()> {
    match direct.write_all_at(block, offset) {
        Err(error) if matches!(error.kind(), ErrorKind::InvalidInput | ErrorKind::Unsupported) => {
            cached.write_all_at(block, offset)
        }
        done => done,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs::File;
    use std::os::unix::fs::FileExt;

    fn counted(length: usize) -> Vec<u8> {
        (0..length).map(|n| (n % 251) as u8).collect()
    }

    /// Appends pieces of a length, and returns what the file then holds from the beginning on.
    fn written(file: &Arc<dyn DiskFile>, bytes: &[u8], piece: usize) -> Result<Vec<u8>> {
        let mut writer = DirectWriter::begin(file, ALIGN as u64).expect("a way");
        bytes.chunks(piece).try_for_each(|piece| writer.append(piece))?;
        writer.finish()?;
        let mut all = vec![0; file.size()? as usize];
        file.read_all_at(&mut all, 0)?;
        Ok(all)
    }

    #[test]
    fn pieces_of_any_length_follow_each_other() {
        let folder = tempfile::tempdir().unwrap();
        for (number, length) in
            [0, 1, BLOCK_BYTES, 9 * BLOCK_BYTES, 9 * BLOCK_BYTES + 5].into_iter().enumerate()
        {
            for piece in [1000, BLOCK_BYTES, 3 * BLOCK_BYTES + 1] {
                let path = folder.path().join(format!("{number}-{piece}"));
                let file = File::options().read(true).write(true).create_new(true).open(path).unwrap();
                file.set_len(ALIGN as u64).unwrap();
                let bytes = counted(length);
                let all = written(&(Arc::new(file) as Arc<dyn DiskFile>), &bytes, piece).unwrap();
                assert!(all[..ALIGN].iter().all(|&b| b == 0) && all[ALIGN..] == bytes, "{length} by {piece}");
            }
        }
    }

    /// A file whose direct side answers every write with an error.
    struct Refusing(Arc<File>, ErrorKind);

    impl DiskFile for Refusing {
        fn size(&self) -> Result<u64> {
            self.0.size()
        }
        fn read_at(&self, bytes: &mut [u8], offset: u64) -> Result<usize> {
            FileExt::read_at(&*self.0, bytes, offset)
        }
        fn write_at(&self, bytes: &[u8], offset: u64) -> Result<usize> {
            FileExt::write_at(&*self.0, bytes, offset)
        }
        fn set_size(&self, bytes: u64) -> Result<()> {
            self.0.set_len(bytes)
        }
        fn sync(&self) -> Result<()> {
            Ok(())
        }
        fn direct(&self) -> Option<Arc<dyn DiskFile>> {
            struct Refuses(ErrorKind);
            impl DiskFile for Refuses {
                fn size(&self) -> Result<u64> {
                    Err(self.0.into())
                }
                fn read_at(&self, _: &mut [u8], _: u64) -> Result<usize> {
                    Err(self.0.into())
                }
                fn write_at(&self, _: &[u8], _: u64) -> Result<usize> {
                    Err(self.0.into())
                }
                fn set_size(&self, _: u64) -> Result<()> {
                    Err(self.0.into())
                }
                fn sync(&self) -> Result<()> {
                    Err(self.0.into())
                }
            }
            Some(Arc::new(Refuses(self.1)))
        }
    }

    #[test]
    fn a_disk_that_will_not_have_it_gets_it_through_the_cache() {
        let file = || Arc::new(tempfile::tempfile().unwrap());
        let bytes = counted(20 * BLOCK_BYTES + 7);
        for kind in [ErrorKind::InvalidInput, ErrorKind::Unsupported] {
            let refusing: Arc<dyn DiskFile> = Arc::new(Refusing(file(), kind));
            assert!(written(&refusing, &bytes, 1000).unwrap()[ALIGN..] == bytes);
        }
        let full: Arc<dyn DiskFile> = Arc::new(Refusing(file(), ErrorKind::StorageFull));
        assert_eq!(written(&full, &bytes, 1000).unwrap_err().kind(), ErrorKind::StorageFull);
        // Whoever goes on is told again.
        let mut writer = DirectWriter::begin(&full, 0).unwrap();
        let failed = (0..40).filter(|_| writer.append(&[0; BLOCK_BYTES]).is_err()).count();
        assert!(failed >= 40 - BLOCKS, "{failed}");
        assert!(writer.append(&[0; BLOCK_BYTES]).is_err());
    }
}
