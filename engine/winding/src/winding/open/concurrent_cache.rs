//! What is made once and asked for again, by any thread, within a bound on memory.

use std::collections::HashMap;
use std::collections::hash_map::DefaultHasher;
use std::fmt;
use std::hash::{BuildHasher, BuildHasherDefault, Hash};
use std::sync::{Arc, Mutex, MutexGuard};

/// Parts with a lock of their own: threads seldom wait for each other.
const PARTS: usize = 64;

type Hasher = BuildHasherDefault<DefaultHasher>;

/// Something whose memory is known.
pub(in crate::winding) trait MemorySize {
    /// Bytes taken, about.
    fn bytes(&self) -> usize;
}

/// Values by key. What a value is follows from its key, so forgetting one costs time and nothing else.
pub(in crate::winding) struct ConcurrentCache<K, V> {
    parts: Box<[Mutex<Part<K, V>>]>,
    part_bytes: usize,
}

struct Part<K, V> {
    values: HashMap<K, Arc<V>, Hasher>,
    bytes: usize,
}

impl<K, V> fmt::Debug for ConcurrentCache<K, V> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Kept").finish_non_exhaustive()
    }
}

impl<K: Hash + Eq, V: MemorySize> ConcurrentCache<K, V> {
    /// Keeps values of at most so many bytes together.
    pub fn new(bytes: usize) -> ConcurrentCache<K, V> {
        let part = || Mutex::new(Part { values: HashMap::default(), bytes: 0 });
        ConcurrentCache { parts: (0..PARTS).map(|_| part()).collect(), part_bytes: bytes / PARTS }
    }

    /// The value of a key, made if it is not there. Two threads that ask at the same time may both make it.
    pub fn get_or_make(&self, key: K, make: impl FnOnce() -> V) -> Arc<V> {
        if let Some(value) = self.part(&key).values.get(&key) {
            return Arc::clone(value);
        }
        let value = Arc::new(make());
        let mut part = self.part(&key);
        part.bytes += value.bytes();
        if part.bytes > self.part_bytes {
            part.values.clear();
            part.bytes = value.bytes();
        }
        part.values.insert(key, Arc::clone(&value));
        value
    }

    fn part(&self, key: &K) -> MutexGuard<'_, Part<K, V>> {
        let hash = Hasher::default().hash_one(key);
        self.parts[hash as usize % PARTS].lock().expect("no thread panicked")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    impl MemorySize for u64 {
        fn bytes(&self) -> usize {
            8
        }
    }

    #[test]
    fn values_are_made_once_until_they_are_too_many() {
        let kept = ConcurrentCache::new(PARTS * 80);
        assert_eq!(*kept.get_or_make(1, || 7u64), 7);
        assert_eq!(*kept.get_or_make(1, || 8u64), 7);
        (2..10_000u64).for_each(|key| assert_eq!(*kept.get_or_make(key, || key), key));
        let held: usize = kept.parts.iter().map(|part| part.lock().unwrap().values.len()).sum();
        assert!(held <= PARTS * 10, "{held}");
        assert_eq!(*kept.get_or_make(9_999, || 0), 9_999);
    }
}
