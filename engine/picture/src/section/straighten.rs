//! Straight runs of closed polylines merged within a tolerance (Douglas & Peucker 1973), free of crossings as they were.
//!
//! A run of points becomes one chord if each of them is within the tolerance of it. Then the chord is within the
//! tolerance of the run, too, since what runs from one end of it to the other is near each of its points.
//!
//! Chords that touch others are taken back, point by point, until none does, at the latest when all points are there
//! again.

use super::join::Contour;
use std::collections::{HashMap, HashSet};

type Point = [f64; 2];

/// Merges the straight runs of loops: no point of what they were is farther than `tolerance`, in world units, from what they
/// become, nor the other way round. Loops that do not cross or touch, themselves or each other, still do not; each keeps
/// three points at least. Area and length stay those of the boundary before.
pub fn straighten(contour: &mut Contour, tolerance: f64) {
    if tolerance.is_nan() || tolerance <= 0.0 {
        return;
    }
    let mut chains: Vec<Chain<'_>> = contour.loops.iter().map(|line| Chain::new(line, tolerance)).collect();
    loop {
        let meeting = meeting(&chains);
        if !take_back(&mut chains, &meeting) {
            break;
        }
    }
    contour.loops = chains.iter().map(Chain::points).collect();
}

/// A loop and which of its points are kept.
struct Chain<'a> {
    line: &'a [Point],
    /// In rising order.
    kept: Vec<usize>,
}

/// A chord: its chain, and the number of its first point among those kept.
type Chord = (usize, usize);

impl Chain<'_> {
    fn new(line: &[Point], tolerance: f64) -> Chain<'_> {
        let far = (0..line.len())
            .max_by(|a, b| distance(line[0], line[*a]).total_cmp(&distance(line[0], line[*b])));
        let far = far.unwrap_or(0);
        let mut kept = vec![0, far];
        let mut open = vec![(0, far), (far, line.len())];
        while let Some((from, to)) = open.pop() {
            if let Some((at, off)) = farthest(line, from, to)
                && off > tolerance
            {
                kept.push(at);
                open.extend([(from, at), (at, to)]);
            }
        }
        kept.sort_unstable();
        kept.dedup();
        let mut chain = Chain { line, kept };
        // Of a loop that is thinner than the tolerance something must be left.
        for number in (0..chain.kept.len()).rev().filter(|_| line.len() > 2) {
            if chain.kept.len() < 3 {
                chain.split(number);
            }
        }
        chain
    }

    fn points(&self) -> Vec<Point> {
        self.kept.iter().map(|&n| self.line[n]).collect()
    }

    fn chord(&self, number: usize) -> [Point; 2] {
        let next = (number + 1) % self.kept.len();
        [self.line[self.kept[number]], self.line[self.kept[next]]]
    }

    /// Keeps the farthest point between the ends of a chord, too; whether there is one.
    fn split(&mut self, number: usize) -> bool {
        let to = self.kept.get(number + 1).copied().unwrap_or(self.line.len());
        let Some((at, _)) = farthest(self.line, self.kept[number], to) else { return false };
        self.kept.insert(number + 1, at);
        true
    }
}

/// The point between two of a line, by number, that is farthest from their chord, and its distance. The number behind the
/// last one is the first point.
fn farthest(line: &[Point], from: usize, to: usize) -> Option<(usize, f64)> {
    let chord = [line[from], line[to % line.len()]];
    let between = (from + 1..to).map(|n| (n, from_chord(chord, line[n])));
    between.max_by(|a, b| a.1.total_cmp(&b.1).then(b.0.cmp(&a.0)))
}

fn distance(a: Point, b: Point) -> f64 {
    ((a[0] - b[0]).powi(2) + (a[1] - b[1]).powi(2)).sqrt()
}

fn from_chord([a, b]: [Point; 2], p: Point) -> f64 {
    let run = [b[0] - a[0], b[1] - a[1]];
    let square = run[0] * run[0] + run[1] * run[1];
    let along = ((p[0] - a[0]) * run[0] + (p[1] - a[1]) * run[1]) / square;
    let along = if along.is_nan() { 0.0 } else { along.clamp(0.0, 1.0) };
    distance([a[0] + along * run[0], a[1] + along * run[1]], p)
}

/// Splits the chords that meet others, where points were left out of them; whether any could be.
fn take_back(chains: &mut [Chain<'_>], meeting: &HashSet<Chord>) -> bool {
    let mut order: Vec<Chord> = meeting.iter().copied().collect();
    // The last of a chain first, so that numbers stay.
    order.sort_unstable_by(|a, b| b.cmp(a));
    let split = order.into_iter().map(|(chain, number)| chains[chain].split(number));
    split.fold(false, |any, is_split| any | is_split)
}

/// Chords that touch or cross one another elsewhere than in a point that follows both.
fn meeting(chains: &[Chain<'_>]) -> HashSet<Chord> {
    let all = || chains.iter().enumerate().flat_map(|(n, chain)| (0..chain.kept.len()).map(move |i| (n, i)));
    let count = all().count().max(1);
    let length: f64 = all().map(|(n, i)| chains[n].chord(i)).map(|[a, b]| distance(a, b)).sum();
    let pitch = length / count as f64;
    let mut grid: HashMap<[i64; 2], Vec<Chord>> = HashMap::new();
    let mut meeting = HashSet::new();
    for (chain, number) in all() {
        let chord = chains[chain].chord(number);
        for place in places(chord, pitch) {
            let there = grid.entry(place).or_default();
            for &(other, at) in there.iter().filter(|other| **other != (chain, number)) {
                let count = chains[chain].kept.len();
                let follows = |a: usize, b: usize| chain == other && (a + 1) % count == b;
                let meets = match (follows(number, at), follows(at, number)) {
                    (true, _) => fold(chord, chains[other].chord(at)),
                    (_, true) => fold(chains[other].chord(at), chord),
                    _ => meet(chord, chains[other].chord(at)),
                };
                if meets {
                    meeting.extend([(chain, number), (other, at)]);
                }
            }
            there.push((chain, number));
        }
    }
    meeting
}

/// Places of a grid that a chord may touch, each once.
fn places([a, b]: [Point; 2], pitch: f64) -> Vec<[i64; 2]> {
    let steps = (distance(a, b) / pitch).ceil().max(1.0) as usize;
    let place = |c: f64| (c / pitch).floor() as i64;
    let mut found = Vec::new();
    for n in 0..steps {
        let [from, to] = [n, n + 1].map(|n| {
            let t = n as f64 / steps as f64;
            [a[0] + (b[0] - a[0]) * t, a[1] + (b[1] - a[1]) * t]
        });
        let reach = [0, 1]
            .map(|c| (place(from[c].min(to[c]) - 1e-6 * pitch), place(from[c].max(to[c]) + 1e-6 * pitch)));
        for v in reach[1].0..=reach[1].1 {
            found.extend((reach[0].0..=reach[0].1).map(|u| [u, v]));
        }
    }
    found.sort_unstable();
    found.dedup();
    found
}

/// Twice the area of a triangle; 0 if rounding may have decided its sign.
fn turn(a: Point, b: Point, c: Point) -> f64 {
    let (left, right) = ((b[0] - a[0]) * (c[1] - a[1]), (b[1] - a[1]) * (c[0] - a[0]));
    // Coordinates, differences and products are each off by half a unit in the last place.
    let size = [a, b, c].iter().flatten().fold(0.0f64, |m, c| m.max(c.abs()));
    let span = distance(a, b).max(distance(a, c));
    let error = 8.0 * f64::EPSILON * (left.abs() + right.abs() + size * span);
    if (left - right).abs() <= error { 0.0 } else { left - right }
}

/// Whether two chords without a common end may touch.
fn meet([a, b]: [Point; 2], [c, d]: [Point; 2]) -> bool {
    let apart = |n: usize| a[n].max(b[n]) < c[n].min(d[n]) || c[n].max(d[n]) < a[n].min(b[n]);
    if apart(0) || apart(1) {
        return false;
    }
    turn(a, b, c) * turn(a, b, d) <= 0.0 && turn(c, d, a) * turn(c, d, b) <= 0.0
}

/// Whether two chords that follow each other lie on one another.
fn fold([a, b]: [Point; 2], [_, d]: [Point; 2]) -> bool {
    let ahead = (b[0] - a[0]) * (d[0] - b[0]) + (b[1] - a[1]) * (d[1] - b[1]);
    ahead <= 0.0 && turn(a, b, d) == 0.0
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A wavy ring about the origin.
    fn ring(radius: f64, waves: f64, points: usize, is_hole: bool) -> Vec<Point> {
        let mut line: Vec<Point> = (0..points)
            .map(|n| {
                let (sin, cos) = (std::f64::consts::TAU * n as f64 / points as f64).sin_cos();
                let off = radius + 0.02 * (waves * n as f64).sin();
                [off * cos, off * sin]
            })
            .collect();
        if is_hole {
            line.reverse();
        }
        line
    }

    /// Walls much thinner than the tolerance: chords of the two sides would cross, and are taken back.
    #[test]
    fn what_does_not_cross_still_does_not() {
        let mut crossing = 0;
        for (gap, waves) in [(0.05, 0.1), (0.05, 1.3), (0.3, 2.1)] {
            let loops = vec![ring(10.0, waves, 900, false), ring(10.0 - gap, waves, 800, true)];
            let tolerance = 0.5;
            let all: Vec<Chain<'_>> = loops.iter().map(|line| Chain::new(line, 0.0)).collect();
            assert!(meeting(&all).is_empty(), "they cross before");
            let alone: Vec<Chain<'_>> = loops.iter().map(|line| Chain::new(line, tolerance)).collect();
            crossing += usize::from(!meeting(&alone).is_empty());
            let mut contour = Contour { loops: loops.clone(), ..Contour::default() };
            straighten(&mut contour, tolerance);
            let now: Vec<Chain<'_>> = contour.loops.iter().map(|line| Chain::new(line, 0.0)).collect();
            assert!(meeting(&now).is_empty(), "{gap}");
            for (before, after) in loops.iter().zip(&contour.loops) {
                assert!(
                    after.len() >= 3 && after.len() * 2 < before.len(),
                    "{} of {}",
                    after.len(),
                    before.len()
                );
                for point in before {
                    let chords = (0..after.len()).map(|n| [after[n], after[(n + 1) % after.len()]]);
                    let off = chords.map(|chord| from_chord(chord, *point)).fold(f64::MAX, f64::min);
                    assert!(off <= tolerance);
                }
            }
        }
        assert!(crossing > 0, "nothing would cross");
    }

    /// Loops smaller than the tolerance keep three points, and straight sides none between their ends.
    #[test]
    fn small_loops_stay_and_straight_sides_need_no_points() {
        let mut side: Vec<Point> = (0..40).map(|n| [f64::from(n) * 0.1, 0.0]).collect();
        side.extend([[4.0, 0.0], [4.0, 2.0], [2.0, 2.0], [0.0, 2.0]]);
        let small = ring(0.01, 0.0, 12, false).into_iter().map(|[x, y]| [x + 20.0, y]).collect();
        let mut contour = Contour { loops: vec![side, small], ..Contour::default() };
        straighten(&mut contour, 1e-6);
        assert_eq!(contour.loops[0], [[0.0, 0.0], [4.0, 0.0], [4.0, 2.0], [0.0, 2.0]]);
        assert_eq!(contour.loops[1].len(), 12);
        straighten(&mut contour, 100.0);
        assert!(contour.loops.iter().all(|line| line.len() == 3), "{:?}", contour.loops);
    }

    #[test]
    fn chords_that_touch_are_found() {
        let [a, b, c, d] = [[0.0, 0.0], [4.0, 0.0], [2.0, 0.0], [2.0, 3.0]];
        assert!(meet([a, b], [c, d]) && meet([a, b], [[2.0, -1.0], d]) && meet([a, b], [c, [3.0, 0.0]]));
        assert!(!meet([a, b], [[2.0, 0.1], d]) && !meet([a, b], [[5.0, 0.0], [6.0, 0.0]]));
        assert!(fold([a, b], [b, c]) && !fold([a, b], [b, d]) && !fold([a, c], [c, b]));
    }
}
