//! A cache under a byte budget that makes again what it had to drop.

use crate::error::Result;
use std::collections::{BTreeMap, HashMap, HashSet};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};

/// Values by leaf number, the least recently used ones dropped first.
pub(super) struct LeafCache<V> {
    budget_bytes: usize,
    state: Mutex<State<V>>,
    /// Something in `making` is made.
    made: Condvar,
}

struct State<V> {
    entries: HashMap<u32, Entry<V>>,
    /// Leaf numbers by the time of their last use.
    order: BTreeMap<u64, u32>,
    now: u64,
    used_bytes: usize,
    /// Leaves whose values some thread is making.
    making: HashSet<u32>,
    /// Threads that wait for one of these.
    waiting: usize,
}

struct Entry<V> {
    value: Arc<V>,
    bytes: usize,
    used_at: u64,
}

impl<V> LeafCache<V> {
    pub(super) fn new(budget_bytes: usize) -> LeafCache<V> {
        let state = State {
            entries: HashMap::new(),
            order: BTreeMap::new(),
            now: 0,
            used_bytes: 0,
            making: HashSet::new(),
            waiting: 0,
        };
        LeafCache { budget_bytes, state: Mutex::new(state), made: Condvar::new() }
    }

    /// The value of `leaf`, made now if it is not there. Threads that ask for what another one makes wait for it, so
    /// `make` must not ask this cache.
    pub(super) fn get_or_make(&self, leaf: u32, make: impl FnOnce() -> Result<(V, usize)>) -> Result<Arc<V>> {
        let mut state = self.lock();
        loop {
            if let Some(value) = state.get(leaf) {
                return Ok(value);
            }
            if state.making.insert(leaf) {
                break;
            }
            state.waiting += 1;
            state = self.made.wait(state).unwrap_or_else(PoisonError::into_inner);
            state.waiting -= 1;
        }
        drop(state);
        let making = RetryGuard { cache: self, leaf };
        let (value, bytes) = make()?;
        let value = Arc::new(value);
        self.lock().insert(leaf, Arc::clone(&value), bytes, self.budget_bytes);
        drop(making);
        Ok(value)
    }

    /// Drops the value of `leaf`.
    pub(super) fn remove(&self, leaf: u32) {
        let value = self.lock().remove(leaf);
        drop(value);
    }

    fn lock(&self) -> MutexGuard<'_, State<V>> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Lets the next thread try, however the making ends.
struct RetryGuard<'a, V> {
    cache: &'a LeafCache<V>,
    leaf: u32,
}

impl<V> Drop for RetryGuard<'_, V> {
    fn drop(&mut self) {
        let mut state = self.cache.lock();
        state.making.remove(&self.leaf);
        // To wake nobody is a system call, too.
        if state.waiting > 0 {
            self.cache.made.notify_all();
        }
    }
}

impl<V> State<V> {
    fn get(&mut self, leaf: u32) -> Option<Arc<V>> {
        self.now += 1;
        let entry = self.entries.get_mut(&leaf)?;
        self.order.remove(&entry.used_at);
        entry.used_at = self.now;
        self.order.insert(self.now, leaf);
        Some(Arc::clone(&entry.value))
    }

    fn remove(&mut self, leaf: u32) -> Option<Arc<V>> {
        let entry = self.entries.remove(&leaf)?;
        self.order.remove(&entry.used_at);
        self.used_bytes -= entry.bytes;
        Some(entry.value)
    }

    fn insert(&mut self, leaf: u32, value: Arc<V>, bytes: usize, budget_bytes: usize) {
        if bytes > budget_bytes || self.entries.contains_key(&leaf) {
            return;
        }
        self.now += 1;
        self.used_bytes += bytes;
        self.entries.insert(leaf, Entry { value, bytes, used_at: self.now });
        self.order.insert(self.now, leaf);
        while self.used_bytes > budget_bytes {
            let Some((_, oldest)) = self.order.pop_first() else { break };
            if let Some(entry) = self.entries.remove(&oldest) {
                self.used_bytes -= entry.bytes;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_least_recently_used_value_goes_first() {
        let cache = LeafCache::new(2);
        let made = std::cell::Cell::new(0);
        let get = |leaf: u32| {
            let make = || {
                made.set(made.get() + 1);
                Ok((leaf * 10, 1))
            };
            assert_eq!(*cache.get_or_make(leaf, make).unwrap(), leaf * 10);
        };
        [1, 2, 1, 3].into_iter().for_each(get);
        assert_eq!(made.get(), 3);
        get(1);
        assert_eq!(made.get(), 3);
        get(2);
        assert_eq!(made.get(), 4);
    }
}
