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

#[cfg(test)]
mod tests {
    use super::super::testing::{tree, write};
    use super::super::{AcceptedStores, BrickTree, Store, StoreOptions};
    use super::testing::SlowBytes;
    use crate::error::ErrorKind;
    use crate::progress::Silent;
    use std::path::Path;
    use std::sync::Arc;
    use std::sync::atomic::Ordering;

    fn elsewhere(change: impl FnOnce(&mut SlowBytes)) -> (Arc<SlowBytes>, crate::error::Result<Store>) {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("small.brf");
        write(&path);
        let mut slow = SlowBytes { bytes: std::fs::read(&path).unwrap(), ..SlowBytes::default() };
        change(&mut slow);
        let slow = Arc::new(slow);
        let options = StoreOptions {
            cache_bytes: 8 << 20,
            accept: AcceptedStores::Unfinished,
            ..StoreOptions::default()
        };
        let store = Store::open_ranges(Path::new("s3://bucket/small.brf"), slow.clone(), options);
        (slow, store)
    }

    #[test]
    fn a_store_elsewhere_answers_as_the_tree_it_was_made_from() {
        let (slow, store) = elsewhere(|_| {});
        let (store, tree) = (store.unwrap(), tree());
        assert!(store.is_elsewhere() && store.source_bytes() > 0);
        assert_eq!((store.keys(), store.file_bytes()), (tree.keys(), slow.bytes.len() as u64));
        let keys = store.keys();
        assert!(store.ahead(&keys) > 0);
        for key in keys {
            assert_eq!(*store.brick(key).unwrap(), *tree.brick(key).unwrap());
        }
        assert_eq!(store.verify(&Silent).unwrap().first_damage, None);
        assert_eq!(store.hash().unwrap(), *blake3::hash(&slow.bytes).as_bytes());
        let (requests, bytes) = store.requests().unwrap();
        assert_eq!(requests, slow.asked.lock().unwrap().len() as u64);
        assert!(bytes <= slow.bytes.len() as u64);
    }

    #[test]
    fn what_does_not_come_is_an_error_and_no_damage() {
        let (slow, store) = elsewhere(|_| {});
        let store = store.unwrap();
        slow.cuts.store(usize::MAX, Ordering::SeqCst);
        let told = store.verify(&Silent).unwrap_err();
        assert_eq!(told.kind(), ErrorKind::Store);
        assert_eq!(told.to_string(), "s3://bucket/small.brf: records: the connection was cut; try later");
        // It stays so, even if the server is well again.
        slow.cuts.store(0, Ordering::SeqCst);
        let key = store.keys().into_iter().find(|key| store.node(*key).unwrap().uniform().is_none()).unwrap();
        assert!(store.brick(key).unwrap_err().to_string().ends_with("the connection was cut; try later"));
        let (_, store) = elsewhere(|slow| slow.cuts = usize::MAX.into());
        let told = store.err().unwrap().to_string();
        assert_eq!(told, "s3://bucket/small.brf: header: the connection was cut; try later");
    }
}
