//! Where passes of a bead begin, by the rule of `docs/passes.md`.
//!
//! Two places of a bead have the ways s < t along it. They are a return if they are nearer than 0.99 widths, t − s is more
//! than two widths and more than four times their distance. Each of these is a convex function of (s, t) below a limit, so
//! whether two segments have such places is the question for the least of the greatest of them: two nested searches.

use super::bead::BeadSize;
use super::gcode::Bead;
use crate::vector::{V3, dot, norm, scale, sub};
use std::collections::HashMap;

/// Widths within which two places of the path are beside each other.
const NEAR: f64 = 0.99;
/// Widths along the path that part a place from an earlier one, and those of a pass's beginning.
const APART: f64 = 2.0;
/// The way between two places by their distance, from which on the path has turned back.
const TURNED: f64 = 4.0;
/// The cosine between directions that are opposite.
const OPPOSITE: f64 = -0.875;
/// Heights within which two places are in one layer.
const LAYER: f64 = 1.02;
/// Widths by which a pass may begin before the place where the path is found to come back.
const BEFORE: f64 = 3.0;
/// Steps of each search; each leaves 0.618 of what is searched.
const STEPS: u32 = 40;

/// The segments with which passes begin, the bead's first among them, in order.
pub fn pass_starts(bead: &Bead) -> Vec<usize> {
    let path = Path::new(bead);
    let (mut starts, mut near) = (vec![0], SegmentSquares::new(path.cell));
    let (mut kept, mut number) = (0, 1);
    while number < bead.sections.len() {
        let first = starts[starts.len() - 1];
        while kept < number {
            near.keep(kept, path.points[kept], path.points[kept + 1]);
            kept += 1;
        }
        if let Some(start) = path.start(first, number, &near) {
            starts.push(start);
            near = SegmentSquares::new(path.cell);
            kept = start;
        }
        number += 1;
    }
    starts
}

struct Path<'a> {
    points: &'a [V3],
    sections: &'a [BeadSize],
    /// The way along the bead to each point.
    way: Vec<f64>,
    /// The greatest width: nothing that is farther away in the plane is near.
    cell: f64,
}

/// Two places, by their ways.
struct Return {
    earlier: f64,
    here: f64,
    opposite: bool,
    width: f64,
}

impl<'a> Path<'a> {
    fn new(bead: &'a Bead) -> Path<'a> {
        let mut way = vec![0.0];
        for pair in bead.points.windows(2) {
            way.push(way[way.len() - 1] + norm(sub(pair[1], pair[0])));
        }
        let cell = bead.sections.iter().map(|s| s.width).fold(1e-6, f64::max);
        Path { points: &bead.points, sections: &bead.sections, way, cell }
    }

    /// The segment with which a new pass begins if this one comes back to the pass that began with `first`.
    fn start(&self, first: usize, number: usize, near: &SegmentSquares) -> Option<usize> {
        let mut candidates = near.beside(self.points[number], self.points[number + 1]);
        candidates.sort_unstable();
        candidates.dedup();
        let found = candidates.into_iter().find_map(|earlier| self.returns(first, earlier, number))?;
        // On the way back along itself the path turns midway; a loop goes on beside the beginning of its pass.
        let place = if found.opposite {
            0.5 * (found.earlier + found.here)
        } else {
            found.here - (found.earlier - self.way[first])
        };
        if place < self.way[number] - BEFORE * found.width {
            return Some(number);
        }
        (first + 1..number).find(|&n| self.way[n] >= place - 1e-6 * found.width).or(Some(number))
    }

    /// Places where a segment comes back to an earlier one.
    fn returns(&self, first: usize, earlier: usize, number: usize) -> Option<Return> {
        let width = 0.5 * (self.sections[earlier].width + self.sections[number].width);
        let height = 0.5 * (self.sections[earlier].height + self.sections[number].height);
        let [(s0, s1), (t0, t1)] = [earlier, number].map(|n| (self.way[n], self.way[n + 1]));
        let [u, v] = [earlier, number].map(|n| {
            let step = sub(self.points[n + 1], self.points[n]);
            scale(step, 1.0 / (self.way[n + 1] - self.way[n]).max(1e-300))
        });
        let opposite = dot(u, v) < OPPOSITE;
        let s0 = if opposite { s0 } else { s0.max(self.way[first] + APART * width) };
        // Their middles' distance less half of both is a bound that most pairs do not pass.
        let middle = |n: usize, k: usize| 0.5 * (self.points[n][k] + self.points[n + 1][k]);
        let [x, y] = [0, 1].map(|k| middle(number, k) - middle(earlier, k));
        let apart = x.hypot(y) - 0.5 * (t1 - t0) - 0.5 * (s1 - self.way[earlier]);
        if s0 > s1 || t1 - s0 <= (APART * width).max(TURNED * apart) || apart >= NEAR * width {
            return None;
        }
        let between = |s: f64, t: f64| {
            let from = sub(self.points[number], self.points[earlier]);
            [0, 1, 2].map(|k| from[k] + v[k] * (t - t0) - u[k] * (s - self.way[earlier]))
        };
        // Below zero where all conditions hold.
        let excess = |s: f64, t: f64| {
            let d = between(s, t)[0].hypot(between(s, t)[1]);
            (d - NEAR * width).max(APART * width - (t - s)).max(TURNED * d - (t - s))
        };
        let best_t = |s: f64| least(t0.max(s), t1, |t| excess(s, t));
        let s = least(s0, s1.min(t1), |s| excess(s, best_t(s)));
        let t = best_t(s);
        if excess(s, t) >= 0.0 || between(s, t)[2].abs() > LAYER * height {
            return None;
        }
        let flat = [v[0], v[1], 0.0];
        let beside = t - dot(between(s, t), flat) / dot(flat, flat).max(1e-300);
        Some(Return { earlier: s, here: beside, opposite, width })
    }
}

/// Where a convex function is least between two numbers: golden sections.
fn least(mut low: f64, mut high: f64, f: impl Fn(f64) -> f64) -> f64 {
    const PART: f64 = 0.618_033_988_749_894_9;
    let (mut a, mut b) = (high - PART * (high - low), low + PART * (high - low));
    let (mut fa, mut fb) = (f(a), f(b));
    for _ in 0..STEPS {
        if fa < fb {
            (high, b, fb) = (b, a, fa);
            a = high - PART * (high - low);
            fa = f(a);
        } else {
            (low, a, fa) = (a, b, fb);
            b = low + PART * (high - low);
            fb = f(b);
        }
    }
    if fa < fb { a } else { b }
}

/// Earlier segments by the squares of the plane that they pass.
struct SegmentSquares {
    cell: f64,
    squares: HashMap<(i64, i64), Vec<usize>>,
}

impl SegmentSquares {
    fn new(cell: f64) -> SegmentSquares {
        SegmentSquares { cell, squares: HashMap::new() }
    }

    fn keep(&mut self, number: usize, a: V3, b: V3) {
        for square in squares(a, b, self.cell, 0) {
            self.squares.entry(square).or_default().push(number);
        }
    }

    fn beside(&self, a: V3, b: V3) -> Vec<usize> {
        squares(a, b, self.cell, 1).iter().filter_map(|at| self.squares.get(at)).flatten().copied().collect()
    }
}

/// Squares within so many of those that a segment passes.
fn squares(a: V3, b: V3, cell: f64, around: i64) -> Vec<(i64, i64)> {
    let parts = ((b[0] - a[0]).hypot(b[1] - a[1]) / cell).ceil().max(1.0);
    let mut out = Vec::new();
    let at = |n: f64, k: usize| ((a[k] + (b[k] - a[k]) * n / parts) / cell).floor() as i64;
    for n in 0..parts as u64 {
        let [from, to] = [n as f64, n as f64 + 1.0].map(|n| [at(n, 0), at(n, 1)]);
        for x in from[0].min(to[0]) - around..=from[0].max(to[0]) + around {
            for y in from[1].min(to[1]) - around..=from[1].max(to[1]) + around {
                out.push((x, y));
            }
        }
    }
    out.sort_unstable();
    out.dedup();
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::judge::gcode::{ReadOptions, read};
    use crate::passes::pass_files;

    fn starts(points: &[[f64; 2]]) -> Vec<usize> {
        let points: Vec<V3> = points.iter().map(|&[x, y]| [x, y, 0.2]).collect();
        let sections = vec![BeadSize { width: 0.5, height: 0.2 }; points.len() - 1];
        pass_starts(&Bead { points, sections, feature: 0 })
    }

    #[test]
    fn lines_that_come_back_are_passes() {
        assert_eq!(starts(&[[0.0, 0.0], [20.0, 0.0], [0.0, 0.0], [20.0, 0.0]]), [0, 1, 2]);
        let raster = |pitch: f64| {
            let line = |n: u32| {
                let y = f64::from(n) * pitch;
                if n.is_multiple_of(2) { [[0.0, y], [20.0, y]] } else { [[20.0, y], [0.0, y]] }
            };
            starts(&(0..5).flat_map(line).collect::<Vec<_>>())
        };
        assert_eq!(raster(0.4), [0, 2, 4, 6, 8]);
        assert_eq!(raster(0.5), [0], "beads that only touch");
        assert_eq!(starts(&[[10.0, 0.0], [0.0, 0.0], [8.66, 5.0]]), [0], "a corner of 30 degrees");
        assert_eq!(starts(&[[10.0, 0.0], [0.0, 0.0], [9.66, 2.59]]), [0, 1], "one of 15 degrees");
    }

    #[test]
    fn a_loop_that_closes_is_one_pass() {
        assert_eq!(starts(&[[0.0, 0.0], [9.0, 0.0], [9.0, 9.0], [0.0, 9.0], [0.0, 0.0]]), [0]);
        // Its second turn is another one.
        let again = [[0.0, 0.0], [9.0, 0.0], [9.0, 9.0], [0.0, 9.0], [0.0, 0.0], [9.0, 0.0], [9.0, 9.0]];
        assert_eq!(starts(&again), [0, 4]);
    }

    #[test]
    fn files_have_the_passes_that_their_forms_ask_for() {
        for made in pass_files() {
            let path = read(made.gcode.as_bytes(), &ReadOptions::default()).unwrap();
            let passes: usize = path.beads.iter().map(|bead| pass_starts(bead).len()).sum();
            assert_eq!(passes as u64, made.passes, "{}", made.name);
        }
    }
}
