//! Polygons of more than three corners as triangles that do not lie over one another.
//!
//! A polygon is seen along the axis that its normal (Newell's) is nearest to, where its corners keep two of their own
//! coordinates, unrounded; signs are those of exact arithmetic (Shewchuk 1997, by the crate `robust`).
//!
//! If the fan from the first corner has positive triangles only and turns by less than a full turn, it covers the
//! polygon once and stays as it is. Otherwise ears are cut off (Meisters 1975): triangles of three corners in a row
//! that hold no other corner.
//!
//! A simple polygon always has one of positive area, also with corners in the middle of its sides.

use robust::{Coord, orient2d};

/// Tests of a corner against an ear, for each corner of a polygon: bounds the time for polygons that cross themselves or
/// have very many reflex corners. What is left of such a polygon then becomes a fan.
const TESTS_PER_CORNER: usize = 1024;

/// Divides polygons; keeps its room from one to the next.
#[derive(Debug, Default)]
pub(super) struct Triangulator {
    /// Corners as they are seen.
    seen: Vec<[f64; 2]>,
    /// The corners that are left, each with the next and the one before.
    next: Vec<u32>,
    before: Vec<u32>,
    /// Corners that are not convex, by their first coordinate.
    reflex: Vec<u32>,
}

impl Triangulator {
    /// Replaces `fan`, the fan of the polygon `corners` from its first corner, by as many triangles that cover the polygon,
    /// unless it does so already. The result depends on nothing but the corners' order and positions.
    pub(super) fn mend(&mut self, vertices: &[[f64; 3]], corners: &[u32], fan: &mut [[u32; 3]]) {
        if !self.look(vertices, corners) || self.is_fan() {
            return;
        }
        let mut triangles = fan.iter_mut();
        self.cut_ears(|ear| {
            if let Some(triangle) = triangles.next() {
                *triangle = ear.map(|i| corners[i as usize]);
            }
        });
    }

    /// Turns the polygon so that it is seen counter-clockwise; false if it has no normal.
    fn look(&mut self, vertices: &[[f64; 3]], corners: &[u32]) -> bool {
        let at = |i: usize| vertices[corners[i % corners.len()] as usize];
        let origin = at(0);
        let mut normal = [0.0; 3];
        for i in 0..corners.len() {
            let [p, q] = [at(i), at(i + 1)].map(|p| [0, 1, 2].map(|a| p[a] - origin[a]));
            for (a, sum) in normal.iter_mut().enumerate() {
                let (b, c) = ((a + 1) % 3, (a + 2) % 3);
                *sum += p[b] * q[c] - p[c] * q[b];
            }
        }
        let axis = (0..3).fold(0, |best, a| if normal[a].abs() > normal[best].abs() { a } else { best });
        if normal[axis] == 0.0 || !normal.iter().all(|c| c.is_finite()) {
            return false;
        }
        let [u, v] = match normal[axis] > 0.0 {
            true => [(axis + 1) % 3, (axis + 2) % 3],
            false => [(axis + 2) % 3, (axis + 1) % 3],
        };
        self.seen.clear();
        self.seen.extend((0..corners.len()).map(|i| [at(i)[u], at(i)[v]]));
        true
    }

    /// Twice the signed area of three corners: its sign is exact.
    fn turn(&self, a: u32, b: u32, c: u32) -> f64 {
        let at = |i: u32| Coord { x: self.seen[i as usize][0], y: self.seen[i as usize][1] };
        orient2d(at(a), at(b), at(c))
    }

    /// True if the fan from the first corner covers the polygon once.
    fn is_fan(&self) -> bool {
        let count = self.seen.len() as u32;
        // Whether the fan has turned by half a turn, seen from the first corner: a second time it may not come round.
        let mut halves = 0;
        let mut was_left = true;
        for i in 1..count - 1 {
            if self.turn(0, i, i + 1).partial_cmp(&0.0) != Some(std::cmp::Ordering::Greater) {
                return false;
            }
            let is_left = self.turn(0, 1, i + 1) > 0.0;
            halves += u32::from(is_left != was_left);
            was_left = is_left;
        }
        halves < 2
    }

    /// Hands over the triangles of the polygon, two fewer than it has corners.
    fn cut_ears(&mut self, mut ear: impl FnMut([u32; 3])) {
        let count = self.seen.len() as u32;
        self.next.clear();
        self.next.extend((1..count).chain([0]));
        self.before.clear();
        self.before.extend([count - 1].into_iter().chain(0..count - 1));
        self.list_reflex();
        let mut tests = TESTS_PER_CORNER.saturating_mul(count as usize);
        // First none but ears of positive area; then, of what crosses itself, also those without.
        let mut strict = true;
        let (mut left, mut at, mut tried) = (count, 1, 0);
        while left > 3 {
            let (before, next) = (self.before[at as usize], self.next[at as usize]);
            if self.is_ear([before, at, next], strict, &mut tests) {
                ear([before, at, next]);
                self.next[before as usize] = next;
                self.before[next as usize] = before;
                left -= 1;
                tried = 0;
                // Every other corner: triangles stay thicker than those of a fan.
                at = self.next[next as usize];
                continue;
            }
            tried += 1;
            at = next;
            if tried < left && tests > 0 {
                continue;
            }
            if !strict || tests == 0 {
                break;
            }
            (strict, tried) = (false, 0);
        }
        let first = self.before[at as usize];
        while left > 2 {
            let next = self.next[at as usize];
            ear([first, at, next]);
            at = next;
            left -= 1;
        }
    }

    /// Lists corners that are not convex: an ear that holds any corner holds one of these. Cutting ears off makes none.
    fn list_reflex(&mut self) {
        let mut reflex = std::mem::take(&mut self.reflex);
        reflex.clear();
        let is_convex = |i: &u32| self.turn(self.before[*i as usize], *i, self.next[*i as usize]) > 0.0;
        reflex.extend((0..self.seen.len() as u32).filter(|i| !is_convex(i)));
        reflex.sort_unstable_by(|&a, &b| {
            self.seen[a as usize][0].total_cmp(&self.seen[b as usize][0]).then(a.cmp(&b))
        });
        self.reflex = reflex;
    }

    /// True if the triangle at a corner has a positive area, or any where not `strict`, and holds no other corner.
    fn is_ear(&self, [a, b, c]: [u32; 3], strict: bool, tests: &mut usize) -> bool {
        *tests = tests.saturating_sub(1);
        let area = self.turn(a, b, c);
        if !(area > 0.0 || !strict && area == 0.0) {
            return false;
        }
        let corners = [a, b, c].map(|i| self.seen[i as usize]);
        let [low, high] = [f64::min, f64::max]
            .map(|pick| [0, 1].map(|axis| corners.iter().map(|p| p[axis]).reduce(pick).unwrap_or_default()));
        let first = self.reflex.partition_point(|&i| self.seen[i as usize][0] < low[0]);
        for &i in &self.reflex[first..] {
            let p = self.seen[i as usize];
            if p[0] > high[0] {
                break;
            }
            *tests = tests.saturating_sub(1);
            if *tests == 0 {
                return false;
            }
            // Corners that are cut off, and those at the same place, as where a bridge leads to a hole, are not in the way.
            let is_left = self.next[self.before[i as usize] as usize] == i;
            if !is_left || p[1] < low[1] || p[1] > high[1] || corners.contains(&p) {
                continue;
            }
            if [(a, b), (b, c), (c, a)].iter().all(|&(from, to)| self.turn(from, to, i) >= 0.0) {
                return false;
            }
        }
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use brickfield_bench_data::Rng;

    fn area(t: [[f64; 2]; 3]) -> f64 {
        let [a, b, c] = t.map(|[x, y]| Coord { x, y });
        0.5 * orient2d(a, b, c)
    }

    /// The triangles of a polygon in a plane across each axis, both ways round: the same ones, as far as that goes.
    fn divided(polygon: &[[f64; 2]]) -> Vec<[u32; 3]> {
        let count = polygon.len() as u32;
        let mut all = Vec::new();
        for axis in 0..3 {
            let vertices: Vec<[f64; 3]> = polygon
                .iter()
                .map(|p| {
                    let mut q = [7.0; 3];
                    (q[(axis + 1) % 3], q[(axis + 2) % 3]) = (p[0], p[1]);
                    q
                })
                .collect();
            let corners: Vec<u32> = (0..count).collect();
            let mut fan: Vec<[u32; 3]> = (1..count - 1).map(|i| [0, i, i + 1]).collect();
            Triangulator::default().mend(&vertices, &corners, &mut fan);
            all.push(fan);
        }
        assert!(all[0] == all[1] && all[1] == all[2]);
        all.swap_remove(0)
    }

    #[track_caller]
    fn covers(polygon: &[[f64; 2]]) {
        let whole: f64 = polygon.windows(2).map(|w| w[0][0] * w[1][1] - w[0][1] * w[1][0]).sum::<f64>();
        let (last, first) = (polygon[polygon.len() - 1], polygon[0]);
        let whole = 0.5 * (whole + last[0] * first[1] - last[1] * first[0]);
        for backwards in [false, true] {
            let mut polygon = polygon.to_vec();
            if backwards {
                polygon.reverse();
            }
            let turned = if backwards { -1.0 } else { 1.0 };
            let triangles = divided(&polygon);
            let areas: Vec<f64> = triangles
                .iter()
                .map(|t| turned * whole.signum() * area(t.map(|i| polygon[i as usize])))
                .collect();
            assert!(areas.iter().all(|a| *a > 0.0), "{polygon:?}: {triangles:?} {areas:?}");
            let sum: f64 = areas.iter().sum();
            assert!((sum / whole.abs() - 1.0).abs() < 1e-9, "{polygon:?}: {sum} for {whole}");
        }
    }

    #[test]
    fn concave_polygons_are_covered_once() {
        // An L from each of its corners; an arrow; a comb; corners in the middle of sides; a hole with a bridge to it.
        let l = [[0.0, 0.0], [2.0, 0.0], [2.0, 1.0], [1.0, 1.0], [1.0, 2.0], [0.0, 2.0]];
        for from in 0..6 {
            let mut l = l;
            l.rotate_left(from);
            covers(&l);
        }
        covers(&[[0.0, 0.0], [3.0, 1.0], [0.0, 2.0], [1.0, 1.0]]);
        let mut comb = vec![[0.0, -1.0], [20.0, -1.0]];
        comb.extend((0..21).rev().map(|i| [f64::from(i), [0.0, 5.0][i as usize % 2]]));
        covers(&comb);
        covers(&[[0.0, 0.0], [1.0, 0.0], [2.0, 0.0], [2.0, 2.0], [1.0, 2.0], [0.0, 2.0], [0.0, 1.0]]);
        covers(&[
            [0.0, 0.0],
            [4.0, 0.0],
            [4.0, 4.0],
            [0.0, 4.0],
            [0.0, 0.0],
            [1.0, 1.0],
            [1.0, 3.0],
            [3.0, 3.0],
            [3.0, 1.0],
            [1.0, 1.0],
        ]);
        let spiral = |i: u32, far: f64| {
            let turn = f64::from(i) * 0.2;
            [(turn + far) * turn.cos(), (turn + far) * turn.sin()]
        };
        let mut coil: Vec<[f64; 2]> = (0..100).map(|i| spiral(i, 3.0)).collect();
        coil.extend((0..100).rev().map(|i| spiral(i, 2.0)));
        covers(&coil);
    }

    #[test]
    fn random_stars_are_covered_once() {
        let mut rng = Rng::new(3);
        for count in [4, 5, 6, 7, 12, 60] {
            for _ in 0..50 {
                let corner = |i: u32, far: f64| {
                    let turn = f64::from(i) / f64::from(count) * std::f64::consts::TAU;
                    [far * turn.cos(), far * turn.sin()]
                };
                covers(&(0..count).map(|i| corner(i, rng.range(0.1, 3.0))).collect::<Vec<_>>());
            }
        }
    }

    #[test]
    fn convex_polygons_stay_fans() {
        for count in 4..40u32 {
            let turn = |i: u32| f64::from(i) / f64::from(count) * std::f64::consts::TAU;
            let polygon: Vec<[f64; 2]> = (0..count).map(|i| [turn(i).cos(), turn(i).sin()]).collect();
            assert_eq!(divided(&polygon), (1..count - 1).map(|i| [0, i, i + 1]).collect::<Vec<_>>());
        }
    }

    #[test]
    fn polygons_that_cross_themselves_end() {
        let mut rng = Rng::new(5);
        for count in [4, 5, 9, 300, 3000] {
            let polygon: Vec<[f64; 2]> =
                (0..count).map(|_| [rng.range(0.0, 1.0), rng.range(0.0, 1.0)]).collect();
            assert_eq!(divided(&polygon).len(), count - 2);
        }
    }
}
