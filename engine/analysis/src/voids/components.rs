//! Connected components of the samples of one brick, as runs along x.

use crate::brick::{Brick, SignChanges};
use crate::lattice::{Axis, BRICK_CELLS, BRICK_POINTS};

/// Rows of samples along x in a brick.
const ROWS: usize = BRICK_POINTS * BRICK_POINTS;

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
        let mut rows = Vec::with_capacity(ROWS + 1);
        let mut runs = Vec::new();
        for row in 0..ROWS {
            rows.push(runs.len() as u32);
            push_runs(signs.row(row % BRICK_POINTS, row / BRICK_POINTS), &mut runs);
        }
        rows.push(runs.len() as u32);
        let mut parents: Vec<u32> = (0..runs.len() as u32).collect();
        for row in 0..ROWS {
            let (j, k) = (row % BRICK_POINTS, row / BRICK_POINTS);
            // Each row with those before it that touch it; the last two only at edges and corners.
            let before = [
                (j > 0).then(|| (row - 1, false)),
                (k > 0).then(|| row - BRICK_POINTS).map(|row| (row, false)),
                (j > 0 && k > 0).then(|| row.wrapping_sub(BRICK_POINTS + 1)).map(|row| (row, true)),
                (j + 1 < BRICK_POINTS && k > 0)
                    .then(|| (row + 1).wrapping_sub(BRICK_POINTS))
                    .map(|row| (row, true)),
            ];
            for (other, only_wide) in before.into_iter().flatten() {
                let span = |row: usize| rows[row] as usize..rows[row + 1] as usize;
                join_rows(&runs, span(other), span(row), &mut parents, |run| {
                    let wide = connectivity.is_wide(is_solid(run));
                    (wide || !only_wide).then_some(u8::from(wide))
                });
            }
        }
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
fn push_runs(bits: u64, runs: &mut Vec<Run>) {
    let mut from = 0;
    while from < BRICK_POINTS {
        let rest = bits >> from;
        let solid = rest & 1 == 1;
        let count = if solid { rest.trailing_ones() } else { rest.trailing_zeros() } as usize;
        let to = (from + count).min(BRICK_POINTS);
        runs.push(Run { from: from as u8, to: to as u8, label: u16::from(solid) });
        from = to;
    }
}

/// Joins the runs of two rows that touch. `reach` says how far beyond its ends a run touches, if at all.
fn join_rows(
    runs: &[Run],
    a: std::ops::Range<usize>,
    b: std::ops::Range<usize>,
    parents: &mut [u32],
    reach: impl Fn(&Run) -> Option<u8>,
) {
    let mut p = a.start;
    for q in b {
        let run = runs[q];
        let Some(reach) = reach(&run) else { continue };
        // Those behind may touch the next run at a corner.
        while runs[p].to < run.from {
            p += 1;
        }
        for (n, other) in runs[p..a.end].iter().enumerate().take_while(|(_, other)| other.from <= run.to) {
            if is_solid(&run) == is_solid(other) && run.from < other.to + reach && other.from < run.to + reach
            {
                unite(parents, (p + n) as u32, q as u32);
            }
        }
    }
}

/// The first of the runs that hang together with one.
fn first(parents: &mut [u32], mut run: u32) -> u32 {
    while parents[run as usize] != run {
        let above = parents[parents[run as usize] as usize];
        parents[run as usize] = above;
        run = above;
    }
    run
}

fn unite(parents: &mut [u32], a: u32, b: u32) {
    let (a, b) = (first(parents, a), first(parents, b));
    parents[a.max(b) as usize] = a.min(b);
}

/// Numbers components by their first runs.
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
