//! How many rays and bricks fit in the memory of a caster, and where its parts lie in the buffers.

use super::memory::{RANGE_ALIGNMENT, Range, end_of, in_a_row};
use brickfield_shaders::{
    COUNT_WORDS, FIELD_WORDS, PAGE_HEADER_WORDS, RAY_BUFFERS, Round, Shell, Sight, TABLE_ENTRIES, TreeNode,
};

/// Buffers by number.
pub(super) const SIGHT: usize = 0;
pub(super) const SHELLS: usize = 1;
pub(super) const TABLES: usize = 2;
pub(super) const NODES: usize = 3;
pub(super) const PAGES: usize = 4;
pub(super) const POOL: usize = 5;
pub(super) const USED: usize = 6;
pub(super) const ROUND: usize = 7;
pub(super) const WANTED: usize = 8;
pub(super) const PIXELS: usize = 12;

/// Rays on their way at most.
const RAYS_MAX: u32 = 1 << 20;
/// At least: those of a tile with the most rays a pixel.
const RAYS_MIN: u32 = 1 << 12;
/// Bytes of a ray: two places in the queue, its light and its way, and a pixel here and there.
const RAY_BYTES: u64 = 8 + 16 + 8 + 2 * 8;
/// Bricks that are brought at once at most: 5 MB of those of one surface.
const STAGED_MAX: u64 = 64;
/// Least that is uploaded at once.
const UPLOAD_BYTES_MIN: u64 = 64 << 10;

/// Words of a page with so many fields.
pub(super) fn page_words(fields: u32, counts: bool) -> u32 {
    PAGE_HEADER_WORDS + if counts { COUNT_WORDS } else { 0 } + fields * FIELD_WORDS
}

/// How much of each thing there is room for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct RayCapacity {
    /// Nodes of the tree.
    pub nodes: u32,
    /// Bricks.
    pub pages: u32,
    /// Words of a brick's page.
    pub page_words: u32,
    /// Bricks that are brought at once.
    pub staged: u32,
    /// Rays on their way.
    pub rays: u32,
}

impl RayCapacity {
    /// The most that fits in `bytes`, all buffers taken together; `None` if that is no brick. No buffer is longer than
    /// `range_max`.
    pub fn within(bytes: u64, range_max: u64, nodes: usize, page_words: u32) -> Option<RayCapacity> {
        let nodes = u32::try_from(nodes).ok()?;
        let page_bytes = u64::from(page_words) * 4;
        let empty = RayCapacity { nodes, pages: 0, page_words, staged: 0, rays: 0 };
        // Ranges begin at multiples of their alignment.
        let slack = 2 * RANGE_ALIGNMENT * RAY_BUFFERS.len() as u64;
        let left = bytes.checked_sub(empty.total_bytes() + slack)?;
        let takes_a_quarter = |rays: &u32| u64::from(*rays) * RAY_BYTES <= left / 4;
        let sizes = (RAYS_MIN.ilog2()..=RAYS_MAX.ilog2()).rev().map(|bits| 1 << bits);
        let rays = sizes.into_iter().find(takes_a_quarter).unwrap_or(RAYS_MIN);
        let left = left.checked_sub(u64::from(rays) * RAY_BYTES)?;
        let staged = (left / page_bytes / 8).clamp(1, STAGED_MAX);
        let left = left.checked_sub(staged * (page_bytes + 16))?;
        // A page with its last use here and there, and no more pages than bricks.
        let pages = (left / (page_bytes + 8)).min(range_max / page_bytes).min(nodes.into());
        let room = RayCapacity { pages: pages as u32, staged: staged as u32, rays, ..empty };
        let is_seen = room.ranges().iter().all(|(_, length)| *length <= range_max);
        (pages > 0 && is_seen && room.total_bytes() <= bytes).then_some(room)
    }

    fn lengths(&self) -> [u64; RAY_BUFFERS.len()] {
        let of = |count: u32, bytes: u64| u64::from(count) * bytes;
        [
            size_of::<Sight>() as u64,
            4 * size_of::<Shell>() as u64,
            of(TABLE_ENTRIES, 16),
            of(self.nodes, size_of::<TreeNode>() as u64),
            of(self.nodes, 4),
            of(self.pages, u64::from(self.page_words) * 4),
            of(self.pages, 4),
            size_of::<Round>() as u64,
            of(self.staged, 4),
            of(self.rays, 8),
            of(self.rays, 16),
            of(self.rays, 8),
            of(self.rays, 8),
        ]
    }

    /// Offset and length of each buffer, by binding.
    pub fn ranges(&self) -> [Range; RAY_BUFFERS.len()] {
        in_a_row(self.lengths())
    }

    /// Offset and length of what is read back: the round, what is wanted, when pages were used, pixels.
    pub fn read_ranges(&self) -> [Range; 4] {
        let lengths = self.lengths();
        in_a_row([ROUND, WANTED, USED, PIXELS].map(|buffer| lengths[buffer]))
    }

    /// Offset and length of what rounds begin with: sight, round, words of the page table, pages.
    fn upload_ranges(&self) -> [Range; 4] {
        let lengths = self.lengths();
        let staged = u64::from(self.staged);
        in_a_row([lengths[SIGHT], lengths[ROUND], 2 * 4 * staged, staged * u64::from(self.page_words) * 4])
    }

    /// Where what goes to a buffer lies in the one for uploads.
    pub fn upload_offset(&self, buffer: usize) -> u64 {
        let place = [SIGHT, ROUND, PAGES, POOL].iter().position(|known| *known == buffer);
        self.upload_ranges()[place.expect("it is uploaded in rounds")].0
    }

    pub fn device_bytes(&self) -> u64 {
        end_of(&self.ranges())
    }

    pub fn upload_bytes(&self) -> u64 {
        end_of(&self.upload_ranges()).max(UPLOAD_BYTES_MIN)
    }

    pub fn read_bytes(&self) -> u64 {
        end_of(&self.read_ranges())
    }

    fn total_bytes(&self) -> u64 {
        self.device_bytes() + self.upload_bytes() + self.read_bytes()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_caster_fits_its_memory() {
        let words = [page_words(1, false), page_words(5, true)];
        let cases = [(2 << 20, 1 << 27), (3 << 20, 1 << 27), (1 << 26, 1 << 22), (1 << 40, 1 << 32)];
        for ((bytes, range_max), words) in cases.into_iter().flat_map(|case| words.map(|words| (case, words)))
        {
            let room = RayCapacity::within(bytes, range_max, 5000, words).unwrap();
            assert!(room.total_bytes() <= bytes, "{room:?}");
            assert!(
                (1..=5000).contains(&room.pages) && room.staged >= 1 && room.rays >= RAYS_MIN,
                "{room:?}"
            );
            assert!(room.ranges().iter().all(|(_, length)| (1..=range_max).contains(length)));
            assert!(room.ranges().windows(2).all(|pair| pair[0].0 + pair[0].1 <= pair[1].0));
        }
        assert_eq!(RayCapacity::within(100_000, 1 << 27, 10, words[0]), None);
        assert_eq!(RayCapacity::within(1 << 30, 1 << 27, 100_000_000, words[0]), None);
        assert_eq!(RayCapacity::within(1 << 40, 1 << 40, 5000, words[0]).unwrap().pages, 5000);
    }
}
