//! What is made once and asked for again, by any thread, within a bound on memory.

use std::collections::HashMap;
use std::collections::hash_map::DefaultHasher;
use std::fmt;
use std::hash::{BuildHasher, BuildHasherDefault, Hash};
use std::mem;
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
    /// Most bytes of a generation of a part.
    half_bytes: usize,
}

/// Values of two generations: when the younger one has filled its half of the room, it becomes the older one, and what nobody
/// asked for since is forgotten.
struct Part<K, V> {
    young: HashMap<K, Arc<V>, Hasher>,
    old: HashMap<K, Arc<V>, Hasher>,
    /// Of the younger ones.
    bytes: usize,
}

impl<K, V> fmt::Debug for ConcurrentCache<K, V> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Kept").finish_non_exhaustive()
    }
}

impl<K: Hash + Eq + Copy, V: MemorySize> ConcurrentCache<K, V> {
    /// Keeps values of at most so many bytes together.
    pub fn new(bytes: usize) -> ConcurrentCache<K, V> {
        let part = || Mutex::new(Part { young: HashMap::default(), old: HashMap::default(), bytes: 0 });
        ConcurrentCache { parts: (0..PARTS).map(|_| part()).collect(), half_bytes: bytes / PARTS / 2 }
    }

    /// The value of a key, made if it is not there. Two threads that ask at the same time may both make it.
    pub fn get_or_make(&self, key: K, make: impl FnOnce() -> V) -> Arc<V> {
        let known = self.part(&key).get(key, self.half_bytes);
        known.unwrap_or_else(|| {
            let value = Arc::new(make());
            self.part(&key).insert(key, Arc::clone(&value), self.half_bytes);
            value
        })
    }

    fn part(&self, key: &K) -> MutexGuard<'_, Part<K, V>> {
        let hash = Hasher::default().hash_one(key);
        self.parts[hash as usize % PARTS].lock().expect("no thread panicked")
    }
}

impl<K: Hash + Eq + Copy, V: MemorySize> Part<K, V> {
    fn get(&mut self, key: K, most: usize) -> Option<Arc<V>> {
        if let Some(value) = self.young.get(&key) {
            return Some(Arc::clone(value));
        }
        let value = self.old.remove(&key)?;
        self.insert(key, Arc::clone(&value), most);
        Some(value)
    }

    fn insert(&mut self, key: K, value: Arc<V>, most: usize) {
        self.bytes += value.bytes();
        if self.bytes > most {
            self.bytes = value.bytes();
            self.old = mem::take(&mut self.young);
        }
        self.young.insert(key, value);
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
        let count =
            |part: &Mutex<Part<_, _>>| part.lock().map(|part| part.young.len() + part.old.len()).unwrap();
        let held: usize = kept.parts.iter().map(count).sum();
        assert!(held <= PARTS * 10, "{held}");
        assert_eq!(*kept.get_or_make(9_999, || 0), 9_999);
    }

    #[test]
    fn what_is_asked_for_again_and_again_is_kept() {
        let kept = ConcurrentCache::new(PARTS * 80);
        kept.get_or_make(1, || 7u64);
        for key in 2..10_000u64 {
            kept.get_or_make(key, || key);
            assert_eq!(*kept.get_or_make(1, || 8), 7, "{key}");
        }
    }
}
