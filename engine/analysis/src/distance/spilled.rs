//! Groups of equal things, in memory if all of them fit, and else in a file that is read through a cache.

use crate::error::Result;
use crate::lattice::{MAX_LEVEL, NodeKey};
use crate::part::temporary::TempFile;
use crate::store::BrickCache;
use std::path::Path;
use std::sync::Arc;

/// A group of things that can lie in a file.
pub(super) trait Spill: Sized {
    /// For the file.
    fn bytes(&self) -> Vec<u8>;
    /// What [`Spill::bytes`] gave; `None` of anything else.
    fn of_bytes(bytes: &[u8]) -> Option<Self>;
    /// Bytes of memory.
    fn heap_bytes(&self) -> usize;
}

enum HeldGroup<T> {
    Here(Arc<T>),
    There { offset: u64, bytes: usize },
}

/// Groups by number.
pub(super) struct Spilled<T> {
    held: Vec<HeldGroup<T>>,
    file: TempFile,
    cache: BrickCache<T>,
    /// Bytes of all while they are in memory.
    here: Option<u64>,
    memory: u64,
    /// How many there will be at most, if that is known.
    expected: Option<usize>,
}

impl<T: Spill> Spilled<T> {
    /// None yet, in so many bytes of memory, with a file in `folder` for what does not fit.
    pub fn new(memory: u64, folder: &Path) -> Spilled<T> {
        let cache = BrickCache::new(memory);
        Spilled {
            held: Vec::new(),
            file: TempFile::new(folder),
            cache,
            here: Some(0),
            memory,
            expected: None,
        }
    }

    /// The same, to hold so many: fails as soon as they do not fit into memory if the disk has no room for all of them, which are
    /// taken to be as large as those before.
    pub fn of_about(count: usize, memory: u64, folder: &Path) -> Spilled<T> {
        Spilled { expected: Some(count), ..Spilled::new(memory, folder) }
    }

    pub fn len(&self) -> usize {
        self.held.len()
    }

    /// Adds a group. As soon as they are more than fit, all go to the file: those that came first are not asked for more often
    /// than others, and would take the cache's room.
    pub fn push(&mut self, group: T) -> Result<()> {
        let was_here = self.here.is_some();
        let bytes = group.heap_bytes() as u64;
        self.here = self.here.map(|here| here + bytes).filter(|all| *all <= self.memory);
        if self.here.is_some() {
            self.held.push(HeldGroup::Here(Arc::new(group)));
            return Ok(());
        }
        if was_here {
            for held in &mut self.held {
                if let HeldGroup::Here(group) = held {
                    *held = append(&mut self.file, &**group)?;
                }
            }
            self.require_room()?;
        }
        self.held.push(append(&mut self.file, &group)?);
        Ok(())
    }

    /// Fails if the disk has no room for those that are still to come.
    fn require_room(&self) -> Result<()> {
        let (held, Some(expected)) = (self.held.len(), self.expected) else { return Ok(()) };
        let still = expected.saturating_sub(held) as f64 / held.max(1) as f64;
        self.file.require_room((self.file.bytes() as f64 * still) as u64)
    }

    /// A group, to keep for a while.
    pub fn get(&self, number: usize) -> Result<Arc<T>> {
        match &self.held[number] {
            HeldGroup::Here(group) => Ok(group.clone()),
            HeldGroup::There { offset, bytes } => self.read(number, *offset, *bytes),
        }
    }

    /// Calls `each` with a group. Of one in memory nothing is counted, which threads would wait for.
    pub fn with<R>(&self, number: usize, each: impl FnOnce(&T) -> Result<R>) -> Result<R> {
        match &self.held[number] {
            HeldGroup::Here(group) => each(group),
            HeldGroup::There { offset, bytes } => each(&*self.read(number, *offset, *bytes)?),
        }
    }

    fn read(&self, number: usize, offset: u64, bytes: usize) -> Result<Arc<T>> {
        let name = name(number);
        if let Some(group) = name.and_then(|name| self.cache.get(name)) {
            return Ok(group);
        }
        let mut read = vec![0; bytes];
        self.file.read(offset, &mut read)?;
        let group = Arc::new(T::of_bytes(&read).ok_or_else(|| self.file.damaged())?);
        if let Some(name) = name {
            drop(self.cache.insert(name, &group, group.heap_bytes()));
        }
        Ok(group)
    }
}

/// Writes a group behind those before.
fn append<T: Spill>(file: &mut TempFile, group: &T) -> Result<HeldGroup<T>> {
    let bytes = group.bytes();
    Ok(HeldGroup::There { offset: file.append(&bytes)?, bytes: bytes.len() })
}

/// A name of a group for the cache, which goes by places.
fn name(number: usize) -> Option<NodeKey> {
    let number = number as u64;
    NodeKey::new(MAX_LEVEL, [0, 16, 32].map(|bits| (number >> bits & 0xffff) as u32))
}

#[cfg(test)]
mod tests {
    use super::*;

    impl Spill for u64 {
        fn bytes(&self) -> Vec<u8> {
            self.to_le_bytes().to_vec()
        }

        fn of_bytes(bytes: &[u8]) -> Option<u64> {
            Some(u64::from_le_bytes(bytes.try_into().ok()?))
        }

        fn heap_bytes(&self) -> usize {
            100
        }
    }

    #[test]
    fn too_many_for_the_disk_are_refused_when_the_first_go_to_it() {
        let folder = tempfile::tempdir().unwrap();
        let mut few: Spilled<u64> = Spilled::of_about(100, 1000, folder.path());
        (0..100).for_each(|n| few.push(n).unwrap());
        let mut many: Spilled<u64> = Spilled::of_about(usize::MAX, 1000, folder.path());
        (0..10).for_each(|n| many.push(n).unwrap());
        let refused = many.push(10).unwrap_err().to_string();
        assert!(refused.contains("are free; make room"), "{refused}");
    }

    #[test]
    fn groups_come_back_from_memory_cache_and_file() {
        for memory in [0, 3000, 20_000, 1 << 20] {
            let folder = tempfile::tempdir().unwrap();
            let mut spilled = Spilled::new(memory, folder.path());
            (0..200_000u64).step_by(1000).for_each(|n| spilled.push(n).unwrap());
            for n in (0..spilled.len()).chain((0..spilled.len()).rev()) {
                assert_eq!(*spilled.get(n).unwrap(), 1000 * n as u64);
            }
        }
        let names: Vec<_> = [0, 1, 65_535, 65_536, 1 << 31].map(|n| name(n).unwrap()).into();
        assert!((1..5).all(|n| !names[..n].contains(&names[n])));
    }
}
