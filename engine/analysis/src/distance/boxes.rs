//! Boxes around runs of things in Morton order, as a binary tree without pointers: what is far is skipped as a whole.

use crate::error::Result;

/// Least and greatest coordinates.
pub(super) type Block = [[f32; 3]; 2];

/// Deep enough for 2^32 things.
const MOST_LEVELS: usize = 64;

/// Nothing at all.
const EMPTY: Block = [[f32::INFINITY; 3], [f32::NEG_INFINITY; 3]];

/// A tree of boxes: node n is above nodes 2n and 2n + 1, and the last level has a box for each run of things.
pub(super) struct Boxes {
    nodes: Vec<Block>,
    /// Boxes of the last level, a power of two.
    runs: usize,
    /// Things in a run.
    per_run: usize,
    things: usize,
}

impl Boxes {
    /// Around things in order, of which neighbours should be near.
    pub fn new(things: impl ExactSizeIterator<Item = Block>, per_run: usize) -> Boxes {
        let count = things.len();
        let runs = count.div_ceil(per_run).next_power_of_two();
        let mut nodes = vec![EMPTY; 2 * runs];
        for (n, block) in things.enumerate() {
            let node = &mut nodes[runs + n / per_run];
            *node = united(node, &block);
        }
        for n in (1..runs).rev() {
            nodes[n] = united(&nodes[2 * n], &nodes[2 * n + 1]);
        }
        Boxes { nodes, runs, per_run, things: count }
    }

    /// The box around all.
    pub fn whole(&self) -> Block {
        self.nodes[1]
    }

    /// Heap bytes.
    pub fn heap_bytes(&self) -> usize {
        self.nodes.len() * size_of::<Block>()
    }

    /// Shows `visit` all things that may count, those in near boxes first. `bound` tells how near a box is, or `None` where
    /// nothing in it can count any more, which what was found decides.
    pub fn search<S>(
        &self,
        state: &mut S,
        bound: impl Fn(&S, &Block) -> Option<f64>,
        mut visit: impl FnMut(&mut S, usize) -> Result<()>,
    ) -> Result<()> {
        let mut stack = [0usize; MOST_LEVELS];
        let mut depth = 1;
        stack[0] = 1;
        while depth > 0 {
            depth -= 1;
            let node = stack[depth];
            // What was found since may exclude it.
            if bound(state, &self.nodes[node]).is_none() {
                continue;
            }
            if node >= self.runs {
                let first = (node - self.runs) * self.per_run;
                for thing in first..(first + self.per_run).min(self.things) {
                    visit(state, thing)?;
                }
                continue;
            }
            let below = [2 * node, 2 * node + 1];
            match below.map(|n| bound(state, &self.nodes[n])) {
                [None, None] => {}
                [Some(_), None] => push(&mut stack, &mut depth, below[0]),
                [None, Some(_)] => push(&mut stack, &mut depth, below[1]),
                [Some(a), Some(b)] => {
                    let (near, far) = if b < a { (below[1], below[0]) } else { (below[0], below[1]) };
                    push(&mut stack, &mut depth, far);
                    push(&mut stack, &mut depth, near);
                }
            }
        }
        Ok(())
    }
}

fn push(stack: &mut [usize; MOST_LEVELS], depth: &mut usize, node: usize) {
    stack[*depth] = node;
    *depth += 1;
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

/// The square of the distance of a point from a box.
#[inline]
pub(super) fn squared_from(block: &Block, point: [f64; 3]) -> f64 {
    let apart = |a: usize| {
        let (low, high) = (f64::from(block[0][a]), f64::from(block[1][a]));
        (low - point[a]).max(point[a] - high).max(0.0)
    };
    let [x, y, z] = [apart(0), apart(1), apart(2)];
    x * x + y * y + z * z
}

/// Where a ray enters a box, if it does between two places along it. `over` are reciprocals of the direction.
#[inline]
pub(super) fn entered(block: &Block, from: [f64; 3], over: [f64; 3], [least, most]: [f64; 2]) -> Option<f64> {
    let (mut enter, mut leave) = (least, most);
    for a in 0..3 {
        let (p, q) =
            ((f64::from(block[0][a]) - from[a]) * over[a], (f64::from(block[1][a]) - from[a]) * over[a]);
        // Zero by infinity is no number, which neither `min` nor `max` takes.
        enter = enter.max(p.min(q));
        leave = leave.min(p.max(q));
    }
    (enter <= leave).then_some(enter)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lattice::mix;

    fn random(n: u64) -> f64 {
        (mix(n.wrapping_mul(0x9e37_79b9_7f4a_7c15)) >> 11) as f64 / (1u64 << 53) as f64
    }

    #[test]
    fn nothing_near_is_skipped() {
        for count in [1usize, 2, 3, 7, 100] {
            let points: Vec<[f64; 3]> =
                (0..count).map(|n| [0, 1, 2].map(|a| random(3 * n as u64 + a))).collect();
            let boxes = Boxes::new(points.iter().map(|p| block_of(std::iter::once(*p), 0.0)), 4);
            for n in 0..50 {
                let from = [0, 1, 2].map(|a| 2.0 * random(7000 + 3 * n + a) - 0.5);
                let squared = |p: &[f64; 3]| (0..3).map(|a| (p[a] - from[a]).powi(2)).sum::<f64>();
                let mut best = f64::INFINITY;
                let bound = |best: &f64, block: &Block| {
                    Some(squared_from(block, from)).filter(|squared| squared <= best)
                };
                boxes
                    .search(&mut best, bound, |best, n| {
                        *best = best.min(squared(&points[n]));
                        Ok(())
                    })
                    .unwrap();
                let expected = points.iter().map(squared).fold(f64::INFINITY, f64::min);
                assert_eq!(best, expected);
            }
        }
    }
}
