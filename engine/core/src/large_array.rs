//! Arrays that go on in a temporary file where they outgrow memory.

use crate::error::Result;
use crate::mmap::TemporaryMap;
use bytemuck::Pod;
use rayon::prelude::*;
use std::cmp::Ordering;
use std::fmt;
use std::ops::{Deref, DerefMut, Range};
use std::path::{Path, PathBuf};

/// Items that are made in parallel before they are appended.
const RUN_ITEMS: usize = 1 << 16;
/// Least and most by which a file grows, in bytes: what is not used of it takes room on the disk.
const GROWTH_BYTES: u64 = 64 << 20;
const MOST_GROWTH_BYTES: u64 = 1 << 30;

/// How much of an array may be in memory, and where it goes then.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ArrayRoom {
    bytes: u64,
    folder: PathBuf,
}

impl ArrayRoom {
    /// Arrays of more than `bytes` bytes lie in temporary files in `folder`.
    pub fn new(bytes: u64, folder: &Path) -> ArrayRoom {
        ArrayRoom { bytes, folder: folder.to_owned() }
    }

    /// All arrays stay in memory.
    pub fn unbounded() -> ArrayRoom {
        ArrayRoom { bytes: u64::MAX, folder: PathBuf::new() }
    }
}

/// An array in memory or, if it is larger than there is room for, in a map of a temporary file, of which the system keeps in
/// memory what is used.
pub struct LargeArray<T> {
    content: Content<T>,
    room: ArrayRoom,
}

enum Content<T> {
    Memory(Vec<T>),
    /// Items that are there; the file may be longer.
    File(TemporaryMap, usize),
}

impl<T: Pod + Send + Sync> LargeArray<T> {
    /// An empty one.
    pub fn new(room: &ArrayRoom) -> LargeArray<T> {
        LargeArray { content: Content::Memory(Vec::new()), room: room.clone() }
    }

    /// One of `count` zeros.
    ///
    /// # Errors
    /// If it has to be in a file that cannot be made.
    pub fn zeroed(count: usize, room: &ArrayRoom) -> Result<LargeArray<T>> {
        let mut array = LargeArray::new(room);
        array.reserve(count)?;
        match &mut array.content {
            Content::Memory(items) => items.resize(count, T::zeroed()),
            Content::File(_, length) => *length = count,
        }
        Ok(array)
    }

    /// The items of `count` numbers, of those that have one, in their order. They are made by all threads.
    ///
    /// # Errors
    /// As [`LargeArray::push`].
    pub fn of_each(
        count: usize,
        room: &ArrayRoom,
        item: impl Fn(usize) -> Option<T> + Sync,
    ) -> Result<LargeArray<T>> {
        let mut array = LargeArray::new(room);
        // As much as a file needs, which would grow beyond it piece by piece.
        array.reserve(count)?;
        for from in (0..count).step_by(RUN_ITEMS) {
            let numbers = from..count.min(from + RUN_ITEMS);
            let run: Vec<T> = numbers.into_par_iter().filter_map(&item).collect();
            array.extend_from_slice(&run)?;
        }
        Ok(array)
    }

    /// The room that it was made with.
    pub fn room(&self) -> &ArrayRoom {
        &self.room
    }

    /// Gives it another room; where it is too large for that, it goes to a file as it grows.
    pub fn set_room(&mut self, room: &ArrayRoom) {
        self.room = room.clone();
    }

    /// Appends an item.
    ///
    /// # Errors
    /// If the file in which there is more room cannot be made or grow.
    #[inline]
    pub fn push(&mut self, item: T) -> Result<()> {
        match &mut self.content {
            Content::Memory(items) if items.len() < items.capacity() => {
                items.push(item);
                Ok(())
            }
            _ => self.extend_from_slice(&[item]),
        }
    }

    /// Appends some items.
    ///
    /// # Errors
    /// As [`LargeArray::push`].
    pub fn extend_from_slice(&mut self, items: &[T]) -> Result<()> {
        self.reserve(items.len())?;
        match &mut self.content {
            Content::Memory(all) => all.extend_from_slice(items),
            Content::File(map, length) => {
                let all: &mut [T] = bytemuck::cast_slice_mut(whole_mut::<T>(map));
                all[*length..*length + items.len()].copy_from_slice(items);
                *length += items.len();
            }
        }
        Ok(())
    }

    /// Keeps the first items.
    pub fn truncate(&mut self, count: usize) {
        match &mut self.content {
            Content::Memory(items) => items.truncate(count),
            Content::File(_, length) => *length = count.min(*length),
        }
    }

    /// Keeps one of items that follow each other and are alike, the first.
    pub fn dedup_by(&mut self, is_alike: impl Fn(&T, &T) -> bool) {
        let items: &mut [T] = self;
        let mut kept = items.len().min(1);
        for at in 1..items.len() {
            if !is_alike(&items[kept - 1], &items[at]) {
                items[kept] = items[at];
                kept += 1;
            }
        }
        self.truncate(kept);
    }

    /// Puts items in order, of which no two that differ are equal. Those in a file are sorted in runs that fit in memory, which are
    /// merged then: so a file is read twice and written twice from front to back, however large it is.
    ///
    /// # Errors
    /// If the file for the merged ones cannot be made.
    pub fn sort_by(&mut self, compare: impl Fn(&T, &T) -> Ordering + Sync) -> Result<()> {
        let run = match &self.content {
            Content::Memory(items) => items.len().max(1),
            Content::File(..) => {
                usize::try_from(self.room.bytes / size_of::<T>() as u64).unwrap_or(usize::MAX).max(RUN_ITEMS)
            }
        };
        self.chunks_mut(run).for_each(|some| some.par_sort_unstable_by(&compare));
        if self.len() > run {
            *self = self.merged(run, &compare)?;
        }
        Ok(())
    }

    /// Runs of so many items, each in order, as one.
    fn merged(&self, run: usize, compare: &impl Fn(&T, &T) -> Ordering) -> Result<LargeArray<T>> {
        let (items, count): (&[T], _) = (self, self.len());
        let mut merged = LargeArray::new(&self.room);
        merged.reserve(count)?;
        let is_before =
            |a: &Range<usize>, b: &Range<usize>| compare(&items[a.start], &items[b.start]).is_lt();
        let mut runs: Vec<Range<usize>> =
            (0..count).step_by(run).map(|from| from..count.min(from.saturating_add(run))).collect();
        // What is in order is a heap.
        runs.sort_by(|a, b| compare(&items[a.start], &items[b.start]));
        let mut ready = Vec::with_capacity(RUN_ITEMS);
        while let Some(least) = runs.first_mut() {
            ready.push(items[least.start]);
            least.start += 1;
            if least.start == least.end {
                runs.swap_remove(0);
            }
            sink_first(&mut runs, is_before);
            if ready.len() == RUN_ITEMS || runs.is_empty() {
                merged.extend_from_slice(&ready)?;
                ready.clear();
            }
        }
        Ok(merged)
    }

    /// Whether it lies in a file.
    pub fn is_in_file(&self) -> bool {
        matches!(self.content, Content::File(..))
    }

    /// Memory taken, without what is in a file.
    pub fn heap_bytes(&self) -> u64 {
        match &self.content {
            Content::Memory(items) => (items.capacity() * size_of::<T>()) as u64,
            Content::File(..) => 0,
        }
    }

    /// Makes room for some items more.
    fn reserve(&mut self, more: usize) -> Result<()> {
        let size = size_of::<T>() as u64;
        let count = self.len() + more;
        let need = count as u64 * size;
        match &mut self.content {
            Content::Memory(items) => {
                if need <= self.room.bytes {
                    // Twice as much, so that it seldom moves, but no more than there is room for.
                    let most = usize::try_from(self.room.bytes / size).unwrap_or(usize::MAX);
                    if count > items.capacity() {
                        items.reserve_exact(count.max(most.min(2 * items.len())) - items.len());
                    }
                    return Ok(());
                }
                let mut map = TemporaryMap::new(&self.room.folder)?;
                map.grow(need.max(GROWTH_BYTES))?;
                let length = items.len();
                let all: &mut [T] = bytemuck::cast_slice_mut(whole_mut::<T>(&mut map));
                all[..length].copy_from_slice(items);
                self.content = Content::File(map, length);
                Ok(())
            }
            Content::File(map, _) => {
                let now = map.bytes().len() as u64;
                if need > now {
                    map.grow(need.max(now + (now / 4).clamp(GROWTH_BYTES, MOST_GROWTH_BYTES)))
                } else {
                    Ok(())
                }
            }
        }
    }
}

/// Makes a heap of what is one but for its first.
fn sink_first<H>(heap: &mut [H], is_before: impl Fn(&H, &H) -> bool) {
    let mut at = 0;
    loop {
        let below = 2 * at + 1..heap.len().min(2 * at + 3);
        let Some(least) = below.reduce(|a, b| if is_before(&heap[b], &heap[a]) { b } else { a }) else {
            return;
        };
        if !is_before(&heap[least], &heap[at]) {
            return;
        }
        heap.swap(at, least);
        at = least;
    }
}

/// The bytes of a map that are whole items.
fn whole<T>(map: &TemporaryMap) -> &[u8] {
    let bytes = map.bytes();
    &bytes[..bytes.len() - bytes.len() % size_of::<T>()]
}

fn whole_mut<T>(map: &mut TemporaryMap) -> &mut [u8] {
    let bytes = map.bytes_mut();
    let length = bytes.len() - bytes.len() % size_of::<T>();
    &mut bytes[..length]
}

impl<T: Pod> Deref for LargeArray<T> {
    type Target = [T];

    #[inline]
    fn deref(&self) -> &[T] {
        match &self.content {
            Content::Memory(items) => items,
            Content::File(map, length) => &bytemuck::cast_slice(whole::<T>(map))[..*length],
        }
    }
}

impl<T: Pod> DerefMut for LargeArray<T> {
    #[inline]
    fn deref_mut(&mut self) -> &mut [T] {
        match &mut self.content {
            Content::Memory(items) => items,
            Content::File(map, length) => &mut bytemuck::cast_slice_mut(whole_mut::<T>(map))[..*length],
        }
    }
}

impl<T> From<Vec<T>> for LargeArray<T> {
    /// An array in memory, which it never leaves.
    fn from(items: Vec<T>) -> LargeArray<T> {
        LargeArray { content: Content::Memory(items), room: ArrayRoom::unbounded() }
    }
}

impl<T: Pod> Clone for LargeArray<T> {
    /// A copy in memory, wherever the array is.
    fn clone(&self) -> LargeArray<T> {
        LargeArray::from(self.to_vec())
    }
}

impl<T> Default for LargeArray<T> {
    fn default() -> LargeArray<T> {
        LargeArray::from(Vec::new())
    }
}

impl<T: Pod + PartialEq> PartialEq for LargeArray<T> {
    fn eq(&self, other: &LargeArray<T>) -> bool {
        self[..] == other[..]
    }
}

impl<'a, T: Pod> IntoIterator for &'a LargeArray<T> {
    type Item = &'a T;
    type IntoIter = std::slice::Iter<'a, T>;

    fn into_iter(self) -> std::slice::Iter<'a, T> {
        self.iter()
    }
}

impl<T> fmt::Debug for LargeArray<T> {
    /// How many items there are, and where.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match &self.content {
            Content::Memory(items) => write!(f, "{} items in memory", items.len()),
            Content::File(_, length) => write!(f, "{length} items in a file"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_array_is_the_same_in_memory_and_in_a_file() {
        let dir = tempfile::tempdir().unwrap();
        let item = |n: usize| (!n.is_multiple_of(3)).then_some([n as u32, 7, n as u32 / 2]);
        let expected: Vec<[u32; 3]> = (0..200_000).filter_map(item).collect();
        for bytes in [0, 100, 4000, u64::MAX] {
            let room = ArrayRoom::new(bytes, dir.path());
            let mut pushed = LargeArray::new(&room);
            expected.iter().for_each(|item| pushed.push(*item).unwrap());
            let made = LargeArray::of_each(200_000, &room, item).unwrap();
            assert!(pushed[..] == expected && made == pushed);
            assert_eq!(pushed.heap_bytes() > 0, bytes == u64::MAX);
            pushed.truncate(1000);
            pushed.extend_from_slice(&expected[..5]).unwrap();
            assert!(pushed[..1000] == expected[..1000] && pushed[1000..] == expected[..5]);
            let zeros = LargeArray::<u64>::zeroed(1001, &room).unwrap();
            assert!(zeros.len() == 1001 && zeros.iter().all(|&n| n == 0));
        }
        assert_eq!(std::fs::read_dir(dir.path()).unwrap().count(), 0);
    }

    #[test]
    fn arrays_are_sorted_alike_in_memory_and_in_files() {
        let dir = tempfile::tempdir().unwrap();
        // Each number twice, and in no order.
        for count in [0usize, 1, RUN_ITEMS, 5 * RUN_ITEMS + 7] {
            let number = |n: usize| (n as u64 / 2).wrapping_mul(0x9e37_79b9_7f4a_7c15);
            let mut expected: Vec<u64> = (0..count).map(number).collect();
            expected.sort_unstable();
            for bytes in [0, 3 * 8 * RUN_ITEMS as u64, u64::MAX] {
                let room = ArrayRoom::new(bytes, dir.path());
                let mut array = LargeArray::of_each(count, &room, |n| Some(number(n))).unwrap();
                array.sort_by(u64::cmp).unwrap();
                assert!(array[..] == expected);
            }
        }
    }

    #[test]
    fn an_empty_array_has_no_file() {
        let room = ArrayRoom::new(0, Path::new("no such folder"));
        let mut array = LargeArray::<f64>::new(&room);
        assert!(array.is_empty());
        array.dedup_by(|a, b| a == b);
        assert!(array.push(1.0).unwrap_err().to_string().contains("no such folder"));
    }

    #[test]
    fn neighbours_that_are_alike_are_one() {
        let mut array = LargeArray::from(vec![1u32, 1, 2, 3, 3, 3, 1]);
        array.dedup_by(|a, b| a == b);
        assert_eq!(array[..], [1, 2, 3, 1]);
    }
}
