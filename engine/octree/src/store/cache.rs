//! Decoded bricks, or what was made of them, in memory under a byte budget.

use crate::lattice::NodeKey;
use std::collections::HashMap;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// Most parts with a lock of their own.
const SHARDS_MAX: u64 = 16;
/// Least budget of a part: some forty surface bricks of 90 KB, so that rounding to whole bricks wastes little.
const SHARD_BYTES_MIN: u64 = 4 << 20;
/// Memory of an entry beside the brick's heap: the brick, its counters, its places in map and ring.
const OVERHEAD_BYTES: u64 = 256;

/// Keeps bricks by the clock rule: a brick used since the hand last passed gets a second turn.
pub struct BrickCache<T> {
    shards: Vec<Mutex<Shard<T>>>,
    shard_bytes_max: u64,
    hits: AtomicU64,
    misses: AtomicU64,
}

/// What a cache has done and holds.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct CacheStats {
    /// Bricks found.
    pub hits: u64,
    /// Bricks that had to be read.
    pub misses: u64,
    /// Bricks held now.
    pub bricks: u64,
    /// Memory they take.
    pub bytes: u64,
    /// Records that the system was asked for ahead of a traversal.
    pub ahead: u64,
    /// Those of them that were then read.
    pub ahead_used: u64,
}

struct Shard<T> {
    places: HashMap<NodeKey, usize>,
    ring: Vec<Slot<T>>,
    hand: usize,
    bytes: u64,
}

impl<T> Default for Shard<T> {
    fn default() -> Shard<T> {
        Shard { places: HashMap::new(), ring: Vec::new(), hand: 0, bytes: 0 }
    }
}

struct Slot<T> {
    key: NodeKey,
    brick: Arc<T>,
    bytes: u64,
    used: bool,
}

impl<T> BrickCache<T> {
    /// An empty cache that will hold at most `bytes_max`.
    pub fn new(bytes_max: u64) -> BrickCache<T> {
        let count = (bytes_max / SHARD_BYTES_MIN).clamp(1, SHARDS_MAX);
        BrickCache {
            shards: (0..count).map(|_| Mutex::default()).collect(),
            shard_bytes_max: bytes_max / count,
            hits: AtomicU64::new(0),
            misses: AtomicU64::new(0),
        }
    }

    /// The brick, if it is held; counts a hit or a miss.
    pub fn get(&self, key: NodeKey) -> Option<Arc<T>> {
        let found = self.shard(key).get(key);
        let counter = if found.is_some() { &self.hits } else { &self.misses };
        counter.fetch_add(1, Ordering::Relaxed);
        found
    }

    /// Whether the brick is held; counts nothing, and does not make it stay.
    pub fn holds(&self, key: NodeKey) -> bool {
        self.shard(key).places.contains_key(&key)
    }

    /// Lets the brick stay as if it had been asked for; counts nothing.
    pub fn renew(&self, key: NodeKey) {
        self.shard(key).get(key);
    }

    /// Holds the brick, which takes `heap_bytes`, and lets go of others for it, which are returned.
    pub fn insert(&self, key: NodeKey, brick: &Arc<T>, heap_bytes: usize) -> Vec<Arc<T>> {
        let bytes = heap_bytes as u64 + OVERHEAD_BYTES;
        if bytes > self.shard_bytes_max {
            return Vec::new();
        }
        let mut shard = self.shard(key);
        if shard.places.contains_key(&key) {
            return Vec::new();
        }
        let evicted = shard.make_room(self.shard_bytes_max - bytes);
        shard.insert(Slot { key, brick: Arc::clone(brick), bytes, used: false });
        evicted
    }

    /// Lets go of all bricks.
    pub fn clear(&self) {
        for shard in &self.shards {
            let all = std::mem::take(&mut *lock(shard));
            drop(all);
        }
    }

    /// How often it had what was asked for, and how often it had to read.
    pub fn stats(&self) -> CacheStats {
        let mut stats = CacheStats {
            hits: self.hits.load(Ordering::Relaxed),
            misses: self.misses.load(Ordering::Relaxed),
            ..CacheStats::default()
        };
        for shard in &self.shards {
            let shard = lock(shard);
            stats.bricks += shard.ring.len() as u64;
            stats.bytes += shard.bytes;
        }
        stats
    }

    fn shard(&self, key: NodeKey) -> MutexGuard<'_, Shard<T>> {
        // Fibonacci hashing: neighbours, which threads want at once, fall into different shards.
        let hash = key.code().wrapping_mul(0x9e37_79b9_7f4a_7c15) >> 32;
        lock(&self.shards[hash as usize % self.shards.len()])
    }
}

/// No code that may panic runs under the lock, so a poisoned one holds sound data.
fn lock<T>(shard: &Mutex<Shard<T>>) -> MutexGuard<'_, Shard<T>> {
    shard.lock().unwrap_or_else(PoisonError::into_inner)
}

impl<T> Shard<T> {
    fn get(&mut self, key: NodeKey) -> Option<Arc<T>> {
        let slot = &mut self.ring[*self.places.get(&key)?];
        slot.used = true;
        Some(Arc::clone(&slot.brick))
    }

    fn insert(&mut self, slot: Slot<T>) {
        self.bytes += slot.bytes;
        self.places.insert(slot.key, self.ring.len());
        self.ring.push(slot);
    }

    /// Turns the hand until no more than `bytes_max` are held.
    fn make_room(&mut self, bytes_max: u64) -> Vec<Arc<T>> {
        let mut evicted = Vec::new();
        while self.bytes > bytes_max {
            if self.hand >= self.ring.len() {
                self.hand = 0;
            }
            if std::mem::take(&mut self.ring[self.hand].used) {
                self.hand += 1;
                continue;
            }
            let slot = self.ring.swap_remove(self.hand);
            self.places.remove(&slot.key);
            if let Some(moved) = self.ring.get(self.hand) {
                self.places.insert(moved.key, self.hand);
            }
            self.bytes -= slot.bytes;
            evicted.push(slot.brick);
        }
        evicted
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::brick::{Brick, Hermite, Samples};

    fn brick(w: i16) -> Arc<Brick> {
        Arc::new(Brick::Counts { samples: Samples::filled(w), hermite: Hermite::default() })
    }

    fn key(x: u32) -> NodeKey {
        NodeKey::new(10, [x, 0, 0]).unwrap()
    }

    #[test]
    fn the_budget_holds_and_the_used_stay() {
        let one = brick(0).heap_bytes() as u64 + OVERHEAD_BYTES;
        let cache = BrickCache::new(10 * one);
        let bytes = brick(0).heap_bytes();
        cache.insert(key(0), &brick(0), bytes);
        for x in 1..=1000 {
            assert_eq!(cache.get(key(x)), None);
            cache.insert(key(x), &brick(x as i16), bytes);
            cache.insert(key(x), &brick(-1), bytes);
            assert_eq!(cache.get(key(0)).expect("used all the time").sample([0; 3]), 0);
            assert!(cache.stats().bytes <= 10 * one);
        }
        assert_eq!(cache.get(key(1000)).expect("the newest").sample([0; 3]), 1000);
        let CacheStats { hits, misses, bricks, bytes, .. } = cache.stats();
        assert_eq!((hits, misses, bricks, bytes), (1001, 1000, 10, 10 * one));
    }

    #[test]
    fn a_brick_beyond_the_budget_is_not_held() {
        let cache = BrickCache::new(1000);
        cache.insert(key(0), &brick(0), brick(0).heap_bytes());
        assert_eq!(cache.stats(), CacheStats::default());
        let large = BrickCache::new(1 << 30);
        assert_eq!(large.shards.len() as u64, SHARDS_MAX);
        for x in 0..500 {
            large.insert(key(x), &brick(0), brick(0).heap_bytes());
        }
        assert_eq!(large.stats().bricks, 500);
    }
}
