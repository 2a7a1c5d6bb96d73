//! Boxes around things in Morton order, eight to a node, as a tree without pointers: what is far is skipped as a whole.
//!
//! Eight boxes are compared at once, in 32 bits. What is computed so is a bound: rounding makes boxes nearer, never farther.

use crate::wide::{Select, Simd, SimdBase, SimdMask, dispatch, f32x8, level};
use bytemuck::{Pod, Zeroable};
use std::ops::Range;

/// Least and greatest coordinates.
pub(super) type Block = [[f32; 3]; 2];

/// Boxes of a node.
pub(super) const WIDE: usize = 8;
/// Deep enough for 2^33 things.
const MOST_LEVELS: usize = 11;
/// Where boxes of nothing are.
const FAR: f32 = 1e30;
/// What rounding may add to the square of a distance, or to a way along a ray, as a part of it.
const ROUNDING: f32 = 2e-6;
/// What rounding may add to the difference of two coordinates, as a part of them.
const DIFFERENCE: f32 = 2.5e-7;
/// Components of unit normals are counted in such parts.
const NORMAL_STEPS: f32 = 127.0;
/// So many things are sifted rather than visited one by one.
const SIFTED: usize = 2;

/// Nothing at all.
const EMPTY: Block = [[f32::INFINITY; 3], [f32::NEG_INFINITY; 3]];

/// Least and greatest coordinates of eight boxes.
#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C)]
pub(super) struct Lanes {
    pub(super) low: [[f32; WIDE]; 3],
    pub(super) high: [[f32; WIDE]; 3],
}

/// Least and greatest components of the unit normals in eight boxes, rounded outward, and how thick each one's content is along
/// the middle of them: half of that from the middle of the box, in parts of half of its diagonal.
#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C)]
pub(super) struct Normals {
    pub(super) low: [[i8; WIDE]; 3],
    pub(super) high: [[i8; WIDE]; 3],
    pub(super) thick: [u8; WIDE],
}

/// A place that boxes are compared with.
#[derive(Clone, Copy, Default)]
pub(super) struct Probe {
    pub(super) at: [f32; 3],
    /// How much nearer boxes may be.
    pub(super) nearer: [f32; 3],
}

/// A tree of boxes, as it is made.
pub(super) struct Boxes {
    pub(super) nodes: Vec<Lanes>,
    /// As many as nodes, or none.
    pub(super) normals: Vec<Normals>,
    /// Things in a run.
    pub(super) per_run: usize,
    pub(super) things: usize,
    whole: Block,
}

/// A tree of boxes, wherever its nodes lie.
#[derive(Clone, Copy)]
pub(super) struct BoxNodes<'a> {
    nodes: &'a [Lanes],
    normals: &'a [Normals],
    per_run: usize,
    things: usize,
    whole: Block,
}

/// The levels of a tree of boxes, from the one whose nodes have runs of things below them.
pub(super) struct NodeLevels {
    /// Where the nodes of each begin, and where those of the last end.
    begins: [usize; MOST_LEVELS + 1],
    count: usize,
}

/// A node that waits to be looked at, and how near it is.
#[derive(Clone, Copy, Default)]
struct WaitingNode {
    near: f32,
    /// The node, or the run, below a slot of a node at `level`.
    node: u32,
    level: u32,
}

/// What a search asks of boxes and of things.
pub(super) trait Question {
    /// How near eight boxes are: infinite where nothing in them counts.
    fn nearness<S: Simd>(&self, simd: S, boxes: &Lanes, normals: Option<&Normals>) -> f32x8<S>;

    /// Whether what is so near still counts, which what was found decides.
    fn counts(&self, nearness: f32) -> bool;

    /// Bits of those of eight things from `first` on that may count. Asked again after each that changed what is known.
    #[inline(always)]
    fn sift<S: Simd>(&self, _simd: S, _first: usize) -> u64 {
        u64::MAX
    }

    /// Looks at a thing; tells whether it changed what is known.
    fn visit(&mut self, thing: usize) -> bool;
}

impl Probe {
    /// A place, for boxes whose coordinates are at most `size` large.
    pub fn new(at: [f64; 3], size: f32) -> Probe {
        let at = at.map(|c| c as f32);
        Probe { at, nearer: at.map(|c| (c.abs() + size) * DIFFERENCE) }
    }
}

impl Lanes {
    const NONE: Lanes = Lanes { low: [[FAR; WIDE]; 3], high: [[FAR; WIDE]; 3] };

    /// Bounds of the squares of distances from a place; infinite from `limit` on.
    #[inline(always)]
    pub fn squared_from<S: Simd>(&self, simd: S, probe: &Probe, limit: f32) -> f32x8<S> {
        let zero = f32x8::splat(simd, 0.0);
        let mut squares = zero;
        for a in 0..3 {
            let at = f32x8::splat(simd, probe.at[a]);
            let beside = (lanes_of(simd, &self.low[a]) - at).max(at - lanes_of(simd, &self.high[a]));
            let apart = (beside - f32x8::splat(simd, probe.nearer[a])).max(zero);
            squares += apart * apart;
        }
        let least = squares * f32x8::splat(simd, 1.0 - ROUNDING);
        least.simd_lt(f32x8::splat(simd, limit)).select(least, f32x8::splat(simd, f32::INFINITY))
    }

    /// Zero for those that meet a block, infinite for others.
    #[inline(always)]
    pub fn meeting<S: Simd>(&self, simd: S, [low, high]: &Block) -> f32x8<S> {
        let meets = |a: usize| {
            let below = lanes_of(simd, &self.low[a]).simd_le(f32x8::splat(simd, high[a]));
            below & lanes_of(simd, &self.high[a]).simd_ge(f32x8::splat(simd, low[a]))
        };
        let [zero, far] = [0.0, f32::INFINITY].map(|number| f32x8::splat(simd, number));
        (meets(0) & meets(1) & meets(2)).select(zero, far)
    }

    /// Bounds of where a ray enters, infinite where it does not before `limit`. `over` are reciprocals of the direction.
    #[inline(always)]
    pub fn entered<S: Simd>(&self, simd: S, probe: &Probe, over: [f32; 3], limit: f32) -> f32x8<S> {
        let (mut enter, mut leave) = (f32x8::splat(simd, 0.0), f32x8::splat(simd, limit));
        for a in 0..3 {
            let (at, nearer) = (f32x8::splat(simd, probe.at[a]), f32x8::splat(simd, probe.nearer[a]));
            let over = f32x8::splat(simd, over[a]);
            let p = (lanes_of(simd, &self.low[a]) - nearer - at) * over;
            let q = (lanes_of(simd, &self.high[a]) + nearer - at) * over;
            enter = enter.max(p.min(q));
            leave = leave.min(p.max(q));
        }
        let least = enter * f32x8::splat(simd, 1.0 - ROUNDING);
        let is_met = least.simd_le(leave * f32x8::splat(simd, 1.0 + ROUNDING));
        is_met.select(least, f32x8::splat(simd, f32::INFINITY))
    }
}

#[inline(always)]
pub(super) fn lanes_of<S: Simd>(simd: S, numbers: &[f32; WIDE]) -> f32x8<S> {
    f32x8::from_slice(simd, numbers)
}

/// Reciprocals of a direction, finite where it has no component.
pub(super) fn reciprocals(toward: [f64; 3]) -> [f32; 3] {
    toward.map(|c| 1.0 / if c.abs() < 1e-20 { 1e-20f64.copysign(c) } else { c } as f32)
}

impl Normals {
    const NONE: Normals =
        Normals { low: [[i8::MAX; WIDE]; 3], high: [[i8::MIN; WIDE]; 3], thick: [u8::MAX; WIDE] };

    /// Bounds of the cosines between the normals and a unit vector, from below.
    #[inline(always)]
    pub fn least_cosines<S: Simd>(&self, simd: S, with: [f32; 3]) -> f32x8<S> {
        let mut sums = f32x8::splat(simd, 0.0);
        for a in 0..3 {
            let with = f32x8::splat(simd, with[a]);
            let low = lanes_of(simd, &widened(&self.low[a])) * with;
            sums += low.min(lanes_of(simd, &widened(&self.high[a])) * with);
        }
        sums * f32x8::splat(simd, 1.0 / NORMAL_STEPS) - f32x8::splat(simd, ROUNDING)
    }
}

#[inline(always)]
pub(super) fn widened(numbers: &[i8; WIDE]) -> [f32; WIDE] {
    let mut wide = [0.0; WIDE];
    for n in 0..WIDE {
        wide[n] = f32::from(numbers[n]);
    }
    wide
}

impl Boxes {
    /// Around things in order, of which neighbours should be near.
    pub fn new(things: impl ExactSizeIterator<Item = Block>, per_run: usize) -> Boxes {
        let count = things.len();
        let mut runs = vec![EMPTY; count.div_ceil(per_run)];
        for (n, block) in things.enumerate() {
            runs[n / per_run] = united(&runs[n / per_run], &block);
        }
        let levels = NodeLevels::over(runs.len());
        let mut nodes = Vec::with_capacity(levels.nodes());
        for _ in levels.ranges() {
            nodes.extend(runs.chunks(WIDE).map(lanes));
            runs = runs.chunks(WIDE).map(|blocks| blocks.iter().fold(EMPTY, |a, b| united(&a, b))).collect();
        }
        debug_assert!(nodes.len() == levels.nodes());
        let whole = runs.first().copied().unwrap_or(EMPTY);
        Boxes { nodes, normals: Vec::new(), per_run, things: count, whole }
    }

    /// With least and greatest components of the unit normals of each thing.
    pub fn with_normals(mut self, things: impl ExactSizeIterator<Item = Block>) -> Boxes {
        let mut runs = vec![EMPTY; self.things.div_ceil(self.per_run)];
        for (n, block) in things.enumerate() {
            runs[n / self.per_run] = united(&runs[n / self.per_run], &block);
        }
        self.normals.reserve_exact(self.nodes.len());
        for _ in NodeLevels::over(runs.len()).ranges() {
            self.normals.extend(runs.chunks(WIDE).map(normals));
            runs = runs.chunks(WIDE).map(|blocks| blocks.iter().fold(EMPTY, |a, b| united(&a, b))).collect();
        }
        self
    }

    /// The box around all.
    pub fn whole(&self) -> Block {
        self.whole
    }

    /// As slices.
    pub fn view(&self) -> BoxNodes<'_> {
        BoxNodes::new((&self.nodes, &self.normals), (self.things, self.per_run), self.whole)
    }

    /// See [`BoxNodes::size`].
    pub fn size(&self) -> f32 {
        self.view().size()
    }

    /// See [`BoxNodes::search`].
    pub fn search(&self, question: &mut impl Question) {
        self.view().search(question);
    }
}

impl NodeLevels {
    /// Over so many runs.
    pub fn over(mut runs: usize) -> NodeLevels {
        let mut levels = NodeLevels { begins: [0; MOST_LEVELS + 1], count: 0 };
        while levels.count == 0 || runs > 1 {
            runs = runs.div_ceil(WIDE);
            levels.begins[levels.count + 1] = levels.begins[levels.count] + runs;
            levels.count += 1;
        }
        levels
    }

    /// The nodes of each.
    pub fn ranges(&self) -> impl Iterator<Item = Range<usize>> {
        self.begins[..=self.count].windows(2).map(|ends| ends[0]..ends[1])
    }

    /// How many nodes all of them have.
    pub fn nodes(&self) -> usize {
        self.begins[self.count]
    }
}

impl<'a> BoxNodes<'a> {
    /// The nodes of [`Boxes`] around so many things in runs, and the box around all.
    pub fn new(
        (nodes, normals): (&'a [Lanes], &'a [Normals]),
        (things, per_run): (usize, usize),
        whole: Block,
    ) -> BoxNodes<'a> {
        BoxNodes { nodes, normals, per_run, things, whole }
    }

    /// The box around all.
    pub fn whole(&self) -> Block {
        self.whole
    }

    /// The largest coordinate.
    pub fn size(&self) -> f32 {
        let ends = self.whole.as_flattened();
        ends.iter().fold(0.0, |most, c| if c.abs() < FAR { most.max(c.abs()) } else { most })
    }

    /// Shows a question all things that may count, those in near boxes first.
    pub fn search(&self, question: &mut impl Question) {
        if self.things > 0 {
            dispatch!(level(), simd => self.look(simd, question));
        }
    }

    /// The search, inlined into what is compiled for the widest vectors.
    #[inline(always)]
    fn look<S: Simd>(&self, simd: S, question: &mut impl Question) {
        let mut waiting = [WaitingNode::default(); WIDE * MOST_LEVELS];
        let levels = NodeLevels::over(self.things.div_ceil(self.per_run));
        let (mut level, mut node, mut count) = (levels.count - 1, 0, 0);
        loop {
            let at = levels.begins[level] + node;
            let near = question.nearness(simd, &self.nodes[at], self.normals.get(at));
            let below = count;
            count += nearest_last(simd, near, node, level, &mut waiting[below..]);
            if level == 0 {
                self.visit_runs(simd, question, node, &waiting[below..count]);
                count = below;
            }
            // What was found since may exclude some.
            while count > 0 && !question.counts(waiting[count - 1].near) {
                count -= 1;
            }
            if count == 0 {
                return;
            }
            count -= 1;
            let next = waiting[count];
            (level, node) = (next.level as usize - 1, next.node as usize);
        }
    }

    /// Shows the things in the runs of a node, of which the nearest stands last.
    #[inline(always)]
    fn visit_runs<S: Simd>(&self, simd: S, question: &mut impl Question, node: usize, runs: &[WaitingNode]) {
        let is_sifted = self.per_run == 1 && runs.len() >= SIFTED;
        let mut may_count = if is_sifted { question.sift(simd, node * WIDE) } else { u64::MAX };
        for run in runs.iter().rev() {
            if !question.counts(run.near) {
                break;
            }
            let run = run.node as usize;
            if may_count >> (run % WIDE) & 1 == 0 {
                continue;
            }
            let first = run * self.per_run;
            for thing in first..(first + self.per_run).min(self.things) {
                let is_changed = question.visit(thing);
                if is_sifted && is_changed {
                    may_count = question.sift(simd, node * WIDE);
                }
            }
        }
    }
}

/// Writes which slots of a node are nearer than infinite, the nearest last, and tells how many. Of those as near the first is
/// last.
#[inline(always)]
fn nearest_last<S: Simd>(
    simd: S,
    near: f32x8<S>,
    node: usize,
    level: usize,
    waiting: &mut [WaitingNode],
) -> usize {
    let mut left = near.simd_lt(f32x8::splat(simd, f32::INFINITY)).to_bitmask();
    let mut nearness = [0.0; WIDE];
    near.store_slice(&mut nearness);
    let mut count = 0;
    while left != 0 {
        let slot = left.trailing_zeros() as usize % WIDE;
        left &= left - 1;
        let near = nearness[slot];
        let mut place = count;
        while place > 0 && waiting[place - 1].near <= near {
            waiting[place] = waiting[place - 1];
            place -= 1;
        }
        waiting[place] = WaitingNode { near, node: (node * WIDE + slot) as u32, level: level as u32 };
        count += 1;
    }
    count
}

fn lanes(blocks: &[Block]) -> Lanes {
    let mut lanes = Lanes::NONE;
    for (n, [low, high]) in blocks.iter().enumerate() {
        for a in 0..3 {
            (lanes.low[a][n], lanes.high[a][n]) = (low[a], high[a]);
        }
    }
    lanes
}

fn normals(blocks: &[Block]) -> Normals {
    let mut normals = Normals::NONE;
    for (n, [low, high]) in blocks.iter().enumerate() {
        for a in 0..3 {
            // Conversion saturates.
            normals.low[a][n] = (low[a] * NORMAL_STEPS).floor() as i8;
            normals.high[a][n] = (high[a] * NORMAL_STEPS).ceil() as i8;
        }
    }
    normals
}

fn united(a: &Block, b: &Block) -> Block {
    [std::array::from_fn(|n| a[0][n].min(b[0][n])), std::array::from_fn(|n| a[1][n].max(b[1][n]))]
}

/// The box around points in 64 bits, rounded outward.
pub(super) fn block_of(points: impl Iterator<Item = [f64; 3]>, wider: f64) -> Block {
    let mut low = [f64::INFINITY; 3];
    let mut high = [f64::NEG_INFINITY; 3];
    for point in points {
        for a in 0..3 {
            low[a] = low[a].min(point[a]);
            high[a] = high[a].max(point[a]);
        }
    }
    [low.map(|c| ((c - wider) as f32).next_down()), high.map(|c| ((c + wider) as f32).next_up())]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lattice::{dot, minus, mix};

    fn random(n: u64) -> f64 {
        (mix(n.wrapping_mul(0x9e37_79b9_7f4a_7c15)) >> 11) as f64 / (1u64 << 53) as f64
    }

    /// The nearest of points whose normals are turned far enough.
    struct NearestPoint<'a> {
        points: &'a [[f64; 3]],
        normals: &'a [[f64; 3]],
        from: [f64; 3],
        probe: Probe,
        best: f64,
        visits: usize,
    }

    const TURNED: f64 = 0.2;

    impl Question for NearestPoint<'_> {
        #[inline(always)]
        fn nearness<S: Simd>(&self, simd: S, boxes: &Lanes, normals: Option<&Normals>) -> f32x8<S> {
            let near = boxes.squared_from(simd, &self.probe, (self.best as f32).next_up());
            let cosines = normals.unwrap().least_cosines(simd, [0.0, 0.6, 0.8]);
            let is_turned = cosines.simd_gt(f32x8::splat(simd, TURNED as f32));
            is_turned.select(f32x8::splat(simd, f32::INFINITY), near)
        }

        fn counts(&self, nearness: f32) -> bool {
            f64::from(nearness) <= self.best
        }

        fn visit(&mut self, thing: usize) -> bool {
            self.visits += 1;
            if dot(self.normals[thing], [0.0, 0.6, 0.8]) <= TURNED {
                let away = minus(self.points[thing], self.from);
                self.best = self.best.min(dot(away, away));
            }
            false
        }
    }

    #[test]
    fn nothing_near_is_skipped() {
        assert_eq!([0, 1, 8, 9, 64, 65].map(|runs| NodeLevels::over(runs).nodes()), [0, 1, 1, 3, 9, 12]);
        for (count, far) in [(1usize, 0.0), (2, 0.0), (3, 0.0), (7, 0.0), (100, 0.0), (1000, 3000.0)] {
            let some = |n: usize, k: u64| [0, 1, 2].map(|a| random(3 * n as u64 + a + k));
            let points: Vec<[f64; 3]> = (0..count).map(|n| some(n, 0).map(|c| c + far)).collect();
            let unit = |v: [f64; 3]| v.map(|c| c / dot(v, v).sqrt());
            let normals: Vec<[f64; 3]> = (0..count).map(|n| unit(some(n, 99_991).map(|c| c - 0.5))).collect();
            let blocks = |points: &[[f64; 3]]| -> Vec<Block> {
                points.iter().map(|p| block_of(std::iter::once(*p), 0.0)).collect()
            };
            let boxes = Boxes::new(blocks(&points).into_iter(), 1).with_normals(blocks(&normals).into_iter());
            let mut visits = 0;
            for n in 0..50 {
                let from = [0, 1, 2].map(|a| 2.0 * random(7000 + 3 * n + a) - 0.5 + far);
                let expected =
                    points.iter().zip(&normals).filter(|(_, n)| dot(**n, [0.0, 0.6, 0.8]) <= TURNED);
                let squared = |p: &[f64; 3]| (0..3).map(|a| (p[a] - from[a]).powi(2)).sum::<f64>();
                let expected = expected.map(|(p, _)| squared(p)).fold(f64::INFINITY, f64::min);
                let probe = Probe::new(from, boxes.size());
                let mut question = NearestPoint {
                    points: &points,
                    normals: &normals,
                    from,
                    probe,
                    best: f64::INFINITY,
                    visits: 0,
                };
                boxes.search(&mut question);
                assert!((question.best - expected).abs() <= 1e-12 * expected || question.best == expected);
                visits += question.visits;
            }
            assert!(count < 1000 || visits < 50 * count / 10, "{visits}");
        }
    }

    #[test]
    fn rays_enter_what_they_pass() {
        let blocks: Vec<Block> = (0..500u64)
            .map(|n| {
                let low = [0, 1, 2].map(|a| (100.0 * random(7 * n + a)) as f32);
                [low, [0usize, 1, 2].map(|a| low[a] + (4.0 * random(7 * n + 3 + a as u64)) as f32)]
            })
            .collect();
        for n in 0..200u64 {
            let from = [0, 1, 2].map(|a| 100.0 * random(90_001 + 6 * n + a));
            let mut toward = [0, 1, 2].map(|a| random(90_004 + 6 * n + a) - 0.5);
            if n % 5 == 0 {
                toward[n as usize % 3] = 0.0;
            }
            let length = dot(toward, toward).sqrt();
            let toward = toward.map(|c| c / length);
            for (m, block) in blocks.iter().enumerate() {
                let (mut enter, mut leave) = (0.0f64, 60.0f64);
                for a in 0..3 {
                    let [p, q] = [0, 1].map(|e: usize| (f64::from(block[e][a]) - from[a]) / toward[a]);
                    (enter, leave) = (enter.max(p.min(q)), leave.min(p.max(q)));
                }
                let probe = Probe::new(from, 104.0);
                let mut found = [0.0; WIDE];
                let boxes = lanes(&blocks[m..=m]);
                dispatch!(level(), simd => {
                    boxes.entered(simd, &probe, reciprocals(toward), 60.0).store_slice(&mut found)
                });
                if enter <= leave {
                    assert!(
                        f64::from(found[0]) <= enter && found[0] >= enter as f32 - 1e-3,
                        "{enter} {found:?}"
                    );
                } else {
                    assert!(enter - leave < 1e-2 || found[0] == f32::INFINITY);
                }
                assert!(found[1..].iter().all(|f| *f == f32::INFINITY));
            }
        }
    }
}
