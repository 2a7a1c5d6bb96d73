//! Reading ahead of a traversal whose way is known.
//!
//! All threads of a traversal decode, so there is nobody to decode ahead of them; what they wait for is the disk. So
//! the system is told which records come next, and brings them into its memory meanwhile.
//!
//! What is told at a time is bounded; the memory is the page cache's, which takes it back from whoever does not come.

use super::BrickTree;
use super::cache::CacheStats;
use super::layout::IndexEntry;
use crate::lattice::{NodeKey, Octant};
use std::collections::{HashSet, VecDeque};
use std::sync::atomic::{AtomicU64, AtomicUsize, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};

/// Bytes of records that are told of at a time; twice that is ahead at most. A disk of a gigabyte a second takes 4 ms for
/// it, a hard disk some of its seeks.
const TOLD_BYTES: u64 = 4 << 20;
/// Records with less between them are asked for in one piece: reading so much costs less than another request.
const GAP_BYTES: u64 = 32 << 10;
/// Of what comes from elsewhere, bytes between records that are asked for with them cost their part of the connection. They
/// may be this part of the records'.
const GAPS_PART: u64 = 4;
/// Bricks that a walk names at a time, of 1 KB and more each.
const KEYS_AT_ONCE: usize = 1024;
/// Records that are remembered until they are read, for the statistics. Those of a walk that has left its way are
/// forgotten.
const REMEMBERED_MAX: usize = 4 * KEYS_AT_ONCE;

/// A walk from brick to brick of a tree, whose way is known. Threads say where they are; the tree is told what is next.
pub struct Walk<'a> {
    tree: &'a dyn BrickTree,
    steps: usize,
    key_at: Box<dyn Fn(usize) -> Option<NodeKey> + Sync + Send + 'a>,
    /// Up to which step the tree has been told.
    told: Mutex<usize>,
    /// From which step on it is to be told more.
    due: AtomicUsize,
}

impl<'a> Walk<'a> {
    /// A walk of so many steps. `key_at` says which brick a step reads, if any.
    pub fn new(
        tree: &'a dyn BrickTree,
        steps: usize,
        key_at: impl Fn(usize) -> Option<NodeKey> + Sync + Send + 'a,
    ) -> Walk<'a> {
        Walk { tree, steps, key_at: Box::new(key_at), told: Mutex::new(0), due: AtomicUsize::new(0) }
    }

    /// A step begins. Steps may be taken by several threads, roughly in order.
    pub fn at(&self, step: usize) {
        if step < self.due.load(Ordering::Relaxed) {
            return;
        }
        // Another thread is at it.
        let Ok(mut told) = self.told.try_lock() else { return };
        let from = step.max(*told);
        if from < self.steps {
            let to = self.tell(from);
            // The next part is told when what was told before is done.
            self.due.store(if *told == 0 { 0 } else { from }, Ordering::Relaxed);
            *told = to;
        } else {
            self.due.store(usize::MAX, Ordering::Relaxed);
        }
    }

    /// Tells of the steps from `from` on; returns of which first it is to be told again.
    fn tell(&self, from: usize) -> usize {
        let named = (from..self.steps).filter_map(|step| Some((step, (self.key_at)(step)?)));
        let (steps, keys): (Vec<usize>, Vec<NodeKey>) = named.take(KEYS_AT_ONCE).unzip();
        match steps.last() {
            None => self.steps,
            // At least one, or it would never end.
            Some(last) => steps.get(self.tree.ahead(&keys).max(1)).copied().unwrap_or(last + 1),
        }
    }
}

/// Which records are asked for in one piece.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Merging {
    /// Those with little between them.
    Gap,
    /// The same, the least gaps first, while all of them stay a small part of the records.
    Part,
}

impl Merging {
    /// The largest gap that is read along between `places`, which are sorted.
    fn gap(self, places: &[(u64, u64)]) -> u64 {
        if self == Merging::Gap {
            return GAP_BYTES;
        }
        let mut left = places.iter().map(|(_, bytes)| bytes).sum::<u64>() / GAPS_PART;
        let mut gaps: Vec<u64> = places.windows(2).map(|pair| pair[1].0 - pair[0].0 - pair[0].1).collect();
        gaps.sort_unstable();
        let fits = |gap: &&u64| {
            let fits = **gap <= left.min(GAP_BYTES);
            left -= if fits { **gap } else { left };
            fits
        };
        // Gaps of the same size are all read along or none.
        let read = gaps.iter().take_while(fits).count();
        let first_left = gaps.get(read).copied().unwrap_or(u64::MAX);
        gaps[..read].iter().rev().find(|gap| **gap < first_left).copied().unwrap_or(0)
    }
}

/// Tells a tree whose bricks come from elsewhere that these will be asked for next, and has them come at once.
pub fn tell_ahead(tree: &dyn BrickTree, keys: &[NodeKey]) {
    let mut rest = if tree.is_elsewhere() { keys } else { &[] };
    while !rest.is_empty() {
        rest = &rest[tree.ahead(rest).clamp(1, rest.len())..];
    }
}

/// The same of all bricks below a node that are not uniform.
pub fn tell_below(tree: &dyn BrickTree, key: NodeKey) {
    if !tree.is_elsewhere() {
        return;
    }
    let (mut keys, mut at) = (vec![key], 0);
    while let Some(key) = keys.get(at).copied() {
        let is_read = |key: &NodeKey| tree.node(*key).is_some_and(|node| node.uniform().is_none());
        keys.extend(Octant::all().map(|octant| key.child(octant)).filter(is_read));
        at += 1;
    }
    tell_ahead(tree, &keys[1..]);
}

/// What a store was told of.
#[derive(Default)]
pub(super) struct Prefetch {
    /// Records that were told of and have not been read.
    waiting: Mutex<PrefetchQueue>,
    /// How many they are, so that who reads without being told needs no lock.
    count: AtomicUsize,
    told: AtomicU64,
    used: AtomicU64,
}

#[derive(Default)]
struct PrefetchQueue {
    keys: HashSet<NodeKey>,
    /// In the order in which they were told, those that have been read among them.
    order: VecDeque<NodeKey>,
}

impl Prefetch {
    /// Passes to `fetch` where the first of the records lie, as offset and bytes. `None` stands for a brick that needs
    /// no reading. Returns how many were looked at.
    pub fn tell<'a>(
        &self,
        entries: impl Iterator<Item = Option<&'a IndexEntry>>,
        merging: Merging,
        fetch: impl Fn(u64, u64),
    ) -> usize {
        let mut waiting = self.lock();
        let (mut places, mut bytes, mut looked_at) = (Vec::new(), 0, 0);
        for entry in entries {
            if bytes >= TOLD_BYTES {
                break;
            }
            looked_at += 1;
            if let Some(entry) = entry.filter(|entry| entry.length > 0 && !waiting.keys.contains(&entry.key))
            {
                waiting.add(entry.key);
                places.push((entry.offset, u64::from(entry.length)));
                bytes += u64::from(entry.length);
            }
        }
        self.count.store(waiting.keys.len(), Ordering::Relaxed);
        drop(waiting);
        self.told.fetch_add(places.len() as u64, Ordering::Relaxed);
        places.sort_unstable();
        let gap = merging.gap(&places);
        for part in places.chunk_by(|a, b| a.0 + a.1 + gap >= b.0) {
            let [first, last] = [part[0], part[part.len() - 1]];
            fetch(first.0, last.0 + last.1 - first.0);
        }
        looked_at
    }

    /// A record is being read.
    pub fn reading(&self, key: NodeKey) {
        if self.count.load(Ordering::Relaxed) == 0 {
            return;
        }
        let mut waiting = self.lock();
        if waiting.keys.remove(&key) {
            self.used.fetch_add(1, Ordering::Relaxed);
            self.count.store(waiting.keys.len(), Ordering::Relaxed);
        }
    }

    /// Adds what was read ahead to what the cache says of itself.
    pub fn add_to(&self, stats: CacheStats) -> CacheStats {
        let [ahead, ahead_used] = [&self.told, &self.used].map(|count| count.load(Ordering::Relaxed));
        CacheStats { ahead, ahead_used, ..stats }
    }

    /// No code that may panic runs under the lock, so a poisoned one holds sound data.
    fn lock(&self) -> MutexGuard<'_, PrefetchQueue> {
        self.waiting.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl PrefetchQueue {
    fn add(&mut self, key: NodeKey) {
        while self.order.len() >= REMEMBERED_MAX
            && let Some(oldest) = self.order.pop_front()
        {
            self.keys.remove(&oldest);
        }
        self.keys.insert(key);
        self.order.push_back(key);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::brick::Brick;
    use crate::brick::codec::{PayloadHead, PayloadKind};
    use crate::error::Result;
    use crate::lattice::RootCube;
    use crate::store::MemoryTree;
    use crate::store::NodeInfo;
    use std::sync::Arc;

    fn key(n: usize) -> NodeKey {
        NodeKey::new(6, [n as u32 % 64, n as u32 / 64 % 64, n as u32 / 4096]).unwrap()
    }

    fn entry(n: usize, offset: u64, length: u32) -> IndexEntry {
        let head = PayloadHead { kind: PayloadKind::UNIFORM, min: 0, max: 0 };
        IndexEntry { key: key(n), offset, length, crc: 0, leaf: true, head }
    }

    fn fetched(ahead: &Prefetch, entries: &[Option<IndexEntry>]) -> (usize, Vec<(u64, u64)>) {
        let parts = Mutex::new(Vec::new());
        let looked_at = ahead.tell(entries.iter().map(Option::as_ref), Merging::Gap, |at, bytes| {
            parts.lock().unwrap().push((at, bytes))
        });
        (looked_at, parts.into_inner().unwrap())
    }

    #[test]
    fn near_records_are_one_part_and_what_is_read_counts() {
        let ahead = Prefetch::default();
        let far = 1 << 20;
        let entries = [
            Some(entry(3, 50_000, 1_000)),
            None,
            Some(entry(0, 12_288, 100)),
            Some(entry(1, 12_388, 5_000)),
            Some(entry(2, 0, 0)),
            Some(entry(4, far, 70)),
        ];
        assert_eq!(fetched(&ahead, &entries), (6, vec![(12_288, 38_712), (far, 70)]));
        // Told already.
        assert_eq!(fetched(&ahead, &entries), (6, vec![]));
        for n in [0, 1, 2, 9, 0] {
            ahead.reading(key(n));
        }
        let CacheStats { ahead: told, ahead_used, .. } = ahead.add_to(CacheStats::default());
        assert_eq!((told, ahead_used), (4, 2));
    }

    #[test]
    fn of_what_comes_from_elsewhere_the_least_gaps_are_read_along() {
        let gap = |places: &[(u64, u64)]| Merging::Part.gap(places);
        assert_eq!(gap(&[]), 0);
        assert_eq!(gap(&[(0, 100)]), 0);
        // A quarter of 400 bytes.
        assert_eq!(gap(&[(0, 100), (100, 100), (260, 100), (391, 100)]), 60);
        assert_eq!(gap(&[(0, 100), (150, 100), (300, 100), (450, 100)]), 0);
        assert_eq!(gap(&[(0, 100), (101, 100), (9999, 100)]), 1);
        assert_eq!(gap(&[(0, 1 << 30), ((1 << 30) + GAP_BYTES + 1, 1)]), 0);
        assert_eq!(Merging::Gap.gap(&[(0, 1)]), GAP_BYTES);
    }

    #[test]
    fn what_is_told_and_remembered_is_bounded() {
        let ahead = Prefetch::default();
        let large: Vec<_> = (0..100).map(|n| Some(entry(n, n as u64 * 500_000, 500_000))).collect();
        let (looked_at, parts) = fetched(&ahead, &large);
        assert_eq!((looked_at, parts), (9, vec![(0, 4_500_000)]));
        let small: Vec<_> = (0..20_000).map(|n| Some(entry(n, n as u64 * 100, 100))).collect();
        for part in small.chunks(1000) {
            fetched(&ahead, part);
        }
        let waiting = ahead.lock();
        assert!(waiting.keys.len() <= REMEMBERED_MAX && waiting.order.len() <= REMEMBERED_MAX);
        assert!(waiting.keys.contains(&key(19_999)) && !waiting.keys.contains(&key(0)));
    }

    /// Notes what it is told; takes note of so many at a time.
    struct Listener(Mutex<Vec<NodeKey>>, usize);

    impl BrickTree for Listener {
        fn root(&self) -> RootCube {
            RootCube { origin: [0.0; 3], edge: 1.0 }
        }
        fn node(&self, _: NodeKey) -> Option<NodeInfo> {
            None
        }
        fn keys(&self) -> Vec<NodeKey> {
            Vec::new()
        }
        fn brick(&self, _: NodeKey) -> Result<Arc<Brick>> {
            Ok(Arc::new(Brick::Uniform(0)))
        }
        fn ahead(&self, keys: &[NodeKey]) -> usize {
            let keys = &keys[..keys.len().min(self.1)];
            self.0.lock().unwrap().extend(keys);
            keys.len()
        }
    }

    #[test]
    fn every_brick_is_told_of_once_before_it_is_reached_and_not_long_before() {
        for at_once in [0, 1, 7, 100_000] {
            let tree = Listener(Mutex::default(), at_once);
            let reads = |step: usize| (!step.is_multiple_of(3)).then(|| key(step));
            let walk = Walk::new(&tree, 5000, reads);
            for step in 0..5000 {
                walk.at(step);
                let told = tree.0.lock().unwrap();
                let needed = (0..=step).filter_map(reads).count();
                let ahead =
                    if at_once == 0 { 0 } else { told.len().checked_sub(needed).expect("told too late") };
                assert!(ahead <= 2 * at_once.min(KEYS_AT_ONCE), "{ahead} at step {step}");
            }
            let told = tree.0.lock().unwrap().clone();
            if at_once > 0 {
                assert_eq!(told, (0..5000).filter_map(reads).collect::<Vec<_>>());
            }
        }
    }

    #[test]
    fn a_thread_that_runs_ahead_leaves_out_what_lies_behind_it() {
        let tree = Listener(Mutex::default(), 10);
        let walk = Walk::new(&tree, 100, |step| Some(key(step)));
        walk.at(50);
        walk.at(3);
        let told = tree.0.lock().unwrap().clone();
        assert!(told.contains(&key(50)) && !told.contains(&key(3)));
        drop(told);
        // A tree in memory has nothing to fetch.
        let tree = MemoryTree::new(RootCube { origin: [0.0; 3], edge: 1.0 });
        let walk = Walk::new(&tree, 100, |step| Some(key(step)));
        (0..100).for_each(|step| walk.at(step));
        assert_eq!(*walk.told.lock().unwrap(), 100);
    }
}
