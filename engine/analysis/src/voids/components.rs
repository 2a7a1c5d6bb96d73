//! Connected components of the samples of one brick, as runs along x.

use crate::brick::{Brick, SignChanges, along_row};
use crate::lattice::{Axis, BRICK_CELLS, BRICK_POINTS};
use crate::wide::{dispatch, level};

/// Rows of samples along x in a brick.
const ROWS: usize = BRICK_POINTS * BRICK_POINTS;
/// All samples of a row.
pub(super) const ALL: u64 = (1 << BRICK_POINTS) - 1;

/// Which samples are neighbours. Only these two pairs give complements the same boundary (Ohser, Nagel & Schladitz 2003).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Connectivity {
    /// Void across faces (6), solid across faces, edges and corners (26).
    #[default]
    VoidSix,
    /// Void across faces, edges and corners (26), solid across faces (6).
    VoidTwentySix,
}

impl Connectivity {
    /// Whether samples of a class are neighbours across edges and corners, too.
    fn is_wide(self, solid: bool) -> bool {
        solid == (self == Connectivity::VoidSix)
    }
}

/// Samples of a row that follow each other and are of one class.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Run {
    /// The first one.
    pub from: u8,
    /// The one behind the last.
    pub to: u8,
    /// The component in the brick.
    pub label: u16,
}

impl Run {
    /// The samples as bits of a row.
    pub fn bits(self) -> u64 {
        (1u64 << self.to) - (1u64 << self.from)
    }
}

/// The components of a brick's 33³ samples, numbered by their first sample in the order of rows.
#[derive(Clone, Debug)]
pub(super) struct Components {
    /// For each row k·33 + j its first run, and the number of all.
    rows: Box<[u32]>,
    runs: Vec<Run>,
    /// By component: whether it is solid.
    pub solid: Vec<bool>,
}

/// Labels along a face, of which many that follow each other are alike: each with the place behind its last.
pub(super) type FaceLabels = Vec<(u16, u16)>;

impl Components {
    /// Of a brick; a uniform one has a single component.
    pub fn of(brick: &Brick, connectivity: Connectivity) -> (Components, Option<SignChanges>) {
        match brick {
            Brick::Uniform(w) => (Components::uniform(*w >= 1), None),
            Brick::Counts { samples, .. } => {
                let signs = SignChanges::of(samples);
                (Components::of_signs(&signs, connectivity), Some(signs))
            }
        }
    }

    fn uniform(solid: bool) -> Components {
        let runs = vec![Run { from: 0, to: BRICK_POINTS as u8, label: 0 }; ROWS];
        Components { rows: (0..=ROWS as u32).collect(), runs, solid: vec![solid] }
    }

    /// From the bits that tell inside from outside.
    pub fn of_signs(signs: &SignChanges, connectivity: Connectivity) -> Components {
        dispatch!(level(), _simd => Components::of_rows(signs, connectivity))
    }

    #[inline(always)]
    fn of_rows(signs: &SignChanges, connectivity: Connectivity) -> Components {
        let bits: Vec<u64> = (0..ROWS).map(|row| signs.row(row % BRICK_POINTS, row / BRICK_POINTS)).collect();
        let count = bits.iter().map(|bits| along_row(*bits).count_ones() as usize + 1).sum();
        let mut rows = Vec::with_capacity(ROWS + 1);
        let mut runs = Vec::with_capacity(count);
        for &bits in &bits {
            rows.push(runs.len() as u32);
            push_runs(bits, &mut runs);
        }
        rows.push(runs.len() as u32);
        let parents = (0..runs.len() as u32).collect();
        let solid_is_wide = connectivity.is_wide(true);
        let mut joiner = RowJoiner { bits: &bits, first: &rows, solid_is_wide, parents };
        for row in 0..ROWS {
            let (j, k) = (row % BRICK_POINTS, row / BRICK_POINTS);
            if j > 0 {
                joiner.beside(row, row - 1, None);
            }
            if k > 0 {
                joiner.beside(row, row - BRICK_POINTS, (j > 0).then_some(1));
                if j > 0 {
                    joiner.across(row, row - BRICK_POINTS - 1, [row - 1, row - BRICK_POINTS]);
                }
                if j + 1 < BRICK_POINTS {
                    joiner.across(row, row - BRICK_POINTS + 1, [row + 1, row - BRICK_POINTS]);
                }
            }
        }
        let mut parents = joiner.parents;
        number(rows.into_boxed_slice(), runs, &mut parents)
    }

    /// Bytes that they take.
    pub fn heap_bytes(&self) -> usize {
        size_of_val(&*self.rows) + size_of_val(&*self.runs) + self.solid.len()
    }

    /// How many there are.
    pub fn len(&self) -> usize {
        self.solid.len()
    }

    /// The runs of the row (j, k).
    pub fn row(&self, j: usize, k: usize) -> &[Run] {
        let row = k * BRICK_POINTS + j;
        &self.runs[self.rows[row] as usize..self.rows[row + 1] as usize]
    }

    /// The component of a sample.
    pub fn at(&self, [i, j, k]: [usize; 3]) -> u16 {
        let runs = self.row(j, k);
        runs[runs.partition_point(|run| usize::from(run.to) <= i).min(runs.len() - 1)].label
    }

    /// The component of a sample, by the bits that they are of.
    #[inline]
    pub fn at_signs(&self, signs: &SignChanges, [i, j, k]: [usize; 3]) -> u16 {
        let before = along_row(signs.row(j, k)) & ((1 << i) - 1);
        let first = self.rows[k * BRICK_POINTS + j];
        self.runs[(first + before.count_ones()) as usize].label
    }

    /// The components along the lower or the upper face across an axis. Places count along the first of the other two
    /// axes, x before y before z, and then along the second.
    pub fn face(&self, axis: Axis, upper: bool) -> FaceLabels {
        let mut face = FaceLabels::new();
        let at = if upper { BRICK_CELLS } else { 0 };
        let mut push = |label: u16, count: usize| {
            let end = face.last().map_or(0, |last| last.0) + count as u16;
            match face.last_mut() {
                Some(last) if last.1 == label => last.0 = end,
                _ => face.push((end, label)),
            }
        };
        for second in 0..BRICK_POINTS {
            match axis {
                Axis::X => (0..BRICK_POINTS).for_each(|j| {
                    let row = self.row(j, second);
                    push(row[if upper { row.len() - 1 } else { 0 }].label, 1);
                }),
                Axis::Y => self.row(at, second).iter().for_each(|run| push(run.label, run.len())),
                Axis::Z => self.row(second, at).iter().for_each(|run| push(run.label, run.len())),
            }
        }
        face
    }
}

impl Run {
    fn len(self) -> usize {
        usize::from(self.to - self.from)
    }
}

/// The class of a run while runs are joined: it stands in place of the label.
fn is_solid(run: &Run) -> bool {
    run.label != 0
}

/// The runs of a row of inside bits, with their class in the place of a label.
#[inline(always)]
fn push_runs(bits: u64, runs: &mut Vec<Run>) {
    let (mut changes, mut from) = (along_row(bits), 0);
    loop {
        let to = if changes == 0 { BRICK_POINTS as u8 } else { changes.trailing_zeros() as u8 + 1 };
        runs.push(Run { from, to, label: (bits >> from & 1) as u16 });
        if changes == 0 {
            return;
        }
        changes &= changes - 1;
        from = to;
    }
}

/// Rows of inside bits whose runs are joined, many samples at once.
struct RowJoiner<'a> {
    bits: &'a [u64],
    /// By row, its first run.
    first: &'a [u32],
    /// Whether solid touches across edges and corners, and not void.
    solid_is_wide: bool,
    /// By run, an earlier one that it hangs together with, or itself.
    parents: Vec<u32>,
}

impl RowJoiner<'_> {
    /// The samples of a row that touch others of their class across edges and corners.
    #[inline(always)]
    fn wide(&self, row: usize) -> u64 {
        if self.solid_is_wide { self.bits[row] } else { !self.bits[row] & ALL }
    }

    /// The run of a sample.
    #[inline(always)]
    fn run(&self, row: usize, i: u32) -> u32 {
        let before = along_row(self.bits[row]) & ((1 << i) - 1);
        self.first[row] + before.count_ones()
    }

    /// Joins at each of some samples of a row that of another row so many steps beside.
    #[inline(always)]
    fn unite(&mut self, (row, other): (usize, usize), mut at: u64, step: i32) {
        while at != 0 {
            let i = at.trailing_zeros();
            let (own, theirs) = (self.run(row, i), self.run(other, i.wrapping_add_signed(step)));
            unite(&mut self.parents, own, theirs);
            at &= at - 1;
        }
    }

    /// Joins two rows across their common face. Those `back` before either have been joined to them and to each other, so where
    /// all four samples are alike nothing is left to do.
    #[inline(always)]
    fn beside(&mut self, row: usize, other: usize, back: Option<usize>) {
        let (own, theirs) = (self.bits[row], self.bits[other]);
        let alike = !(own ^ theirs) & ALL;
        // Once for each stretch of one class.
        let mut starts = alike & (!(alike << 1) | along_row(own) << 1);
        if let Some(back) = back {
            starts &= own ^ self.bits[row - back] | theirs ^ self.bits[other - back];
        }
        self.unite((row, other), starts, 0);
        self.askew((row, other), 0);
    }

    /// Joins two rows that have but an edge in common. What one of the two rows between them joins is left out.
    #[inline(always)]
    fn across(&mut self, row: usize, other: usize, between: [usize; 2]) {
        let between = self.wide(between[0]) | self.wide(between[1]);
        self.unite((row, other), self.wide(row) & self.wide(other) & !between, 0);
        self.askew((row, other), between);
    }

    /// Joins samples that lie askew, unless one straight beside either joins them, or one of the samples `between` the rows.
    #[inline(always)]
    fn askew(&mut self, (row, other): (usize, usize), between: u64) {
        let (own, theirs) = (self.wide(row), self.wide(other));
        let (own, theirs) = (own & !theirs & !between, theirs & !own & !between);
        self.unite((row, other), own & theirs >> 1, 1);
        self.unite((row, other), own & theirs << 1, -1);
    }
}

/// The first of the runs that hang together with one.
#[inline(always)]
fn first(parents: &mut [u32], mut run: u32) -> u32 {
    while parents[run as usize] != run {
        let above = parents[parents[run as usize] as usize];
        parents[run as usize] = above;
        run = above;
    }
    run
}

#[inline(always)]
fn unite(parents: &mut [u32], a: u32, b: u32) {
    let (a, b) = (first(parents, a), first(parents, b));
    parents[a.max(b) as usize] = a.min(b);
}

/// Numbers components by their first runs.
#[inline(always)]
fn number(rows: Box<[u32]>, mut runs: Vec<Run>, parents: &mut [u32]) -> Components {
    let mut solid = Vec::new();
    // A component's first run comes before its others, so its number is known by then.
    for run in 0..runs.len() {
        let root = first(parents, run as u32) as usize;
        runs[run].label = if root == run {
            solid.push(is_solid(&runs[run]));
            solid.len() as u16 - 1
        } else {
            runs[root].label
        };
    }
    Components { rows, runs, solid }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use crate::brick::POINTS;
    use crate::brick::point_position;
    use proptest::prelude::*;

    /// The component of each of n³ samples by flooding, numbered by the first sample.
    pub fn flooded(inside: &[bool], n: usize, connectivity: Connectivity) -> Vec<u32> {
        let mut labels = vec![u32::MAX; inside.len()];
        let mut next = 0;
        let mut stack = Vec::new();
        for start in 0..inside.len() {
            if labels[start] != u32::MAX {
                continue;
            }
            labels[start] = next;
            stack.push(start);
            while let Some(at) = stack.pop() {
                let place = [at % n, at / n % n, at / n / n];
                for step in 0..27 {
                    let step = [step % 3, step / 3 % 3, step / 9].map(|c| c as isize - 1);
                    let wide = step.iter().map(|c| c.abs()).sum::<isize>() > 1;
                    let to = [0, 1, 2].map(|a| place[a].wrapping_add_signed(step[a]));
                    if to.iter().any(|&c| c >= n) || wide && !connectivity.is_wide(inside[at]) {
                        continue;
                    }
                    let to = (to[2] * n + to[1]) * n + to[0];
                    if labels[to] == u32::MAX && inside[to] == inside[at] {
                        labels[to] = next;
                        stack.push(to);
                    }
                }
            }
            next += 1;
        }
        labels
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(24))]
        #[test]
        fn components_are_those_of_a_flood(seed in any::<u64>(), share in 1u64..16, blocks in 0u32..4) {
            let solid_at = |n: usize| {
                let at = point_position(n);
                let [x, y, z] = at.map(|c| (c >> blocks) as u64);
                crate::lattice::mix(seed ^ (x | y << 8 | z << 16)) % 16 < share
            };
            let inside: Vec<bool> = (0..POINTS).map(solid_at).collect();
            let signs = SignChanges::from_fn(|n| inside[n]);
            for connectivity in [Connectivity::VoidSix, Connectivity::VoidTwentySix] {
                let found = Components::of_signs(&signs, connectivity);
                let expected = flooded(&inside, BRICK_POINTS, connectivity);
                for (n, expected) in expected.iter().enumerate() {
                    let at = point_position(n);
                    prop_assert_eq!(u32::from(found.at(at)), *expected);
                }
                prop_assert_eq!(found.len() as u32, expected.iter().max().unwrap() + 1);
                for axis in Axis::ALL {
                    for upper in [false, true] {
                        let face = found.face(axis, upper);
                        prop_assert_eq!(face.last().unwrap().0 as usize, BRICK_POINTS * BRICK_POINTS);
                        for place in 0..BRICK_POINTS * BRICK_POINTS {
                            let (a, b) = (place % BRICK_POINTS, place / BRICK_POINTS);
                            let w = if upper { BRICK_CELLS } else { 0 };
                            let at = match axis { Axis::X => [w, a, b], Axis::Y => [a, w, b], Axis::Z => [a, b, w] };
                            let label = face[face.partition_point(|(end, _)| usize::from(*end) <= place)].1;
                            prop_assert_eq!(label, found.at(at));
                        }
                    }
                }
            }
        }
    }
}
