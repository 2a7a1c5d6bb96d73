//! A hash grid of a pass's segments.
//!
//! Segments are put into all cells within reach of them, in pieces no longer than a cell, so that one who asks looks into
//! the cells that it passes itself. Cells are so large that pieces are no more than nine a segment in the mean.

/// Widths of a bead that a cell has at least: fewer make more cells a segment, more make more segments a cell.
const CELL_REACHES: f64 = 8.0;
/// End of a cell's list.
const NONE: u32 = u32::MAX;

/// Segments by cell. Memory is kept from pass to pass.
#[derive(Default)]
pub(super) struct SegmentGrid {
    cell: f64,
    reach: [f64; 3],
    /// As many as a power of two.
    slots: Vec<Slot>,
    used: usize,
    /// Slots of other rounds are free.
    round: u32,
    /// Segments, and the next entry of the cell.
    entries: Vec<(u32, u32)>,
}

#[derive(Clone, Copy, Default)]
struct Slot {
    cell: [i32; 3],
    round: u32,
    head: u32,
}

impl SegmentGrid {
    /// An empty grid for segments that see each other within `reach` along each axis, as many as given, and of this
    /// length in all.
    pub fn reset(&mut self, reach: [f64; 3], length: f64, segments: usize) {
        let largest = reach[0].max(reach[1]).max(reach[2]);
        self.cell = (CELL_REACHES * largest).max(length / (8.0 * segments as f64 + 64.0));
        self.reach = reach;
        self.clear();
    }

    /// Forgets all segments.
    pub fn clear(&mut self) {
        self.entries.clear();
        self.used = 0;
        match self.round.checked_add(1) {
            Some(round) => self.round = round,
            None => {
                self.slots.fill(Slot::default());
                self.round = 1;
            }
        }
    }

    /// Adds a segment.
    pub fn insert(&mut self, segment: u32, a: [f64; 3], b: [f64; 3]) {
        let reach = self.reach;
        for piece in pieces(a, b, self.cell) {
            let (low, high) = self.cells(piece, reach);
            each_cell(low, high, |cell| {
                let at = self.slot(cell);
                let head = self.slots[at].head;
                // The pieces of a segment come one after the other.
                if head == NONE || self.entries[head as usize].0 != segment {
                    self.slots[at].head = self.entries.len() as u32;
                    self.entries.push((segment, head));
                }
                None::<()>
            });
        }
    }

    /// The first result that `test` has for a segment within reach of the line from `a` to `b`.
    pub fn find<T>(&self, a: [f64; 3], b: [f64; 3], mut test: impl FnMut(u32) -> Option<T>) -> Option<T> {
        pieces(a, b, self.cell).find_map(|piece| {
            let (low, high) = self.cells(piece, [0.0; 3]);
            each_cell(low, high, |cell| {
                let mut next = self.head(cell);
                while next != NONE {
                    let (segment, after) = self.entries[next as usize];
                    let result = test(segment);
                    if result.is_some() {
                        return result;
                    }
                    next = after;
                }
                None
            })
        })
    }

    /// The first and the last cell within reach of a piece.
    fn cells(&self, (a, b): ([f64; 3], [f64; 3]), reach: [f64; 3]) -> ([i32; 3], [i32; 3]) {
        let cell = |c: f64| floor(c / self.cell);
        (
            [0, 1, 2].map(|i| cell(a[i].min(b[i]) - reach[i])),
            [0, 1, 2].map(|i| cell(a[i].max(b[i]) + reach[i])),
        )
    }

    fn first_slot(&self, cell: [i32; 3]) -> usize {
        let [x, y, z] = cell.map(|c| u64::from(c as u32));
        let hash = (x.wrapping_mul(0x9E37_79B9_7F4A_7C15) ^ y)
            .wrapping_mul(0xC2B2_AE3D_27D4_EB4F)
            .wrapping_add(z)
            .wrapping_mul(0x9E37_79B9_7F4A_7C15);
        (hash >> 32) as usize & (self.slots.len() - 1)
    }

    /// The list of a cell.
    fn head(&self, cell: [i32; 3]) -> u32 {
        if self.slots.is_empty() {
            return NONE;
        }
        let mut at = self.first_slot(cell);
        loop {
            let slot = &self.slots[at];
            if slot.round != self.round {
                return NONE;
            }
            if slot.cell == cell {
                return slot.head;
            }
            at = (at + 1) & (self.slots.len() - 1);
        }
    }

    /// The slot of a cell, which is made if it is not there.
    fn slot(&mut self, cell: [i32; 3]) -> usize {
        if 2 * (self.used + 1) > self.slots.len() {
            self.grow();
        }
        let mut at = self.first_slot(cell);
        loop {
            if self.slots[at].round != self.round {
                self.slots[at] = Slot { cell, round: self.round, head: NONE };
                self.used += 1;
                return at;
            }
            if self.slots[at].cell == cell {
                return at;
            }
            at = (at + 1) & (self.slots.len() - 1);
        }
    }

    fn grow(&mut self) {
        let size = (2 * self.slots.len()).max(64);
        let old = std::mem::replace(&mut self.slots, vec![Slot::default(); size]);
        self.used = 0;
        let round = self.round;
        for slot in old.iter().filter(|slot| slot.round == round) {
            let at = self.slot(slot.cell);
            self.slots[at].head = slot.head;
        }
    }
}

/// The largest whole number that is not above.
#[inline]
fn floor(value: f64) -> i32 {
    let truncated = value as i32;
    truncated.saturating_sub(i32::from(f64::from(truncated) > value))
}

/// A line in equal pieces no longer than `size`.
fn pieces(a: [f64; 3], b: [f64; 3], size: f64) -> impl Iterator<Item = ([f64; 3], [f64; 3])> {
    let longest = (b[0] - a[0]).abs().max((b[1] - a[1]).abs()).max((b[2] - a[2]).abs());
    let count = (longest / size).ceil().max(1.0) as u32;
    let at = move |number: u32| match number {
        0 => a,
        n if n == count => b,
        n => [0, 1, 2].map(|i| a[i] + (b[i] - a[i]) * (f64::from(n) / f64::from(count))),
    };
    (0..count).map(move |n| (at(n), at(n + 1)))
}

/// Calls `each` with cells until it has a result.
fn each_cell<T>(low: [i32; 3], high: [i32; 3], mut each: impl FnMut([i32; 3]) -> Option<T>) -> Option<T> {
    for z in low[2]..=high[2] {
        for y in low[1]..=high[1] {
            for x in low[0]..=high[0] {
                let result = each([x, y, z]);
                if result.is_some() {
                    return result;
                }
            }
        }
    }
    None
}
