//! Bytes of a store that lie elsewhere: on a web server, or with whoever keeps files by name.

/// A file that is read by ranges of bytes, each of which takes a while to come: what [`Store::open_ranges`] opens. The
/// program's own implementation asks web servers.
///
/// [`Store::open_ranges`]: super::Store::open_ranges
pub trait ByteRanges: Send + Sync {
    /// Size of the whole file in bytes.
    fn bytes(&self) -> u64;

    /// Fills `to` with the bytes from `offset` on, all of which lie in the file. Any number of threads call it at once.
    ///
    /// It must notice where the file is no longer the one whose size [`ByteRanges::bytes`] tells: an answer has all its bytes
    /// from one file.
    ///
    /// # Errors
    /// What is wrong. What may pass is tried again some times.
    fn read(&self, offset: u64, to: &mut [u8]) -> Result<(), RangeFault>;

    /// Ranges that are asked for at once at most.
    fn at_once(&self) -> usize {
        16
    }
}

/// Why a range of bytes has not come.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RangeFault {
    /// What is wrong, in one phrase.
    pub what: String,
    /// What the user can do, in one phrase.
    pub remedy: String,
    /// Whether it may pass, as a connection that was cut.
    pub may_pass: bool,
}

/// A connection as slow as it needs to be for tests: bytes in memory, and what was asked of them.
#[cfg(test)]
pub(super) mod testing {
    use super::*;
    use std::sync::Mutex;
    use std::sync::atomic::{AtomicUsize, Ordering};
    use std::time::Duration;

    #[derive(Default)]
    pub struct SlowBytes {
        pub bytes: Vec<u8>,
        pub delay: Duration,
        /// Offsets and lengths of what was asked.
        pub asked: Mutex<Vec<(u64, usize)>>,
        /// So many answers are cut off from now on.
        pub cuts: AtomicUsize,
        /// Whether cuts pass.
        pub cuts_pass: bool,
        /// Most that were under way at once, and how many are.
        pub most: AtomicUsize,
        pub now: AtomicUsize,
    }

    impl ByteRanges for SlowBytes {
        fn bytes(&self) -> u64 {
            self.bytes.len() as u64
        }

        fn read(&self, offset: u64, to: &mut [u8]) -> Result<(), RangeFault> {
            self.asked.lock().unwrap().push((offset, to.len()));
            self.most.fetch_max(self.now.fetch_add(1, Ordering::SeqCst) + 1, Ordering::SeqCst);
            std::thread::sleep(self.delay);
            self.now.fetch_sub(1, Ordering::SeqCst);
            let cut = self.cuts.fetch_update(Ordering::SeqCst, Ordering::SeqCst, |left| left.checked_sub(1));
            if cut.is_ok() {
                let (what, remedy) = ("the connection was cut".to_owned(), "try later".to_owned());
                return Err(RangeFault { what, remedy, may_pass: self.cuts_pass });
            }
            to.copy_from_slice(&self.bytes[offset as usize..][..to.len()]);
            Ok(())
        }

        fn at_once(&self) -> usize {
            4
        }
    }
}
