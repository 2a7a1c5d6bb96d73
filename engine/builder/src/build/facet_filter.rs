//! Leaving out the triangles that no sample shows.
//!
//! What lies between the lines of the deepest lattice crosses none of them, nor any of the coarser lattices', which
//! are among them: it changes no sample, no Hermite edge and no corner. It only tells that the tree is to be refined
//! where it lies, and one triangle can tell that for all others in the same deepest brick.
//!
//! Of 45 million triangles, sides of beads as long as a cell of 128³ and an eighth as wide, one in six is left.

use crate::lattice::{BRICK_BITS, Triangle, Units, bounds, spacing_bits};

/// The deepest level that is sieved for: its bricks are 2 MB of bits. Soups of which much lies between the lines of a
/// finer lattice would have thousands of millions of triangles.
const LEVEL_MAX: u8 = 8;
/// Lines along one axis that are looked at one by one. A triangle with more of them in its bounding box mostly meets
/// one.
const LINES_MAX: i32 = 4;

/// Decides which triangles of a soup are kept; one per thread.
pub(super) struct FacetFilter {
    lattice: Spacing,
    /// The deepest bricks in which a triangle was kept for all that lie between lines there, as bits.
    told: Vec<u64>,
}

impl FacetFilter {
    /// For trees whose deepest bricks are of `level`; `None` where it is too deep.
    pub fn new(level: u8) -> Option<FacetFilter> {
        let lattice = Spacing::new(level)?;
        Some(FacetFilter { lattice, told: vec![0; lattice.bricks().div_ceil(64)] })
    }

    /// Whether the tree needs a triangle that has an area, given those that were kept before.
    #[inline]
    pub fn keeps(&mut self, t: &Triangle) -> bool {
        let Some(brick) = self.lattice.hides(t) else { return true };
        let (word, bit) = (&mut self.told[brick / 64], 1 << (brick % 64));
        let first = *word & bit == 0;
        *word |= bit;
        first
    }
}

/// The lines of the deepest lattice.
#[derive(Clone, Copy)]
pub(super) struct Spacing {
    /// log₂ of the spacing.
    shift: u32,
    /// log₂ of the number of bricks along the root's edge.
    level: u32,
}

impl Spacing {
    /// Of the bricks of `level`; `None` where that is too deep for a sieve.
    pub fn new(level: u8) -> Option<Spacing> {
        (level <= LEVEL_MAX).then(|| Spacing { shift: spacing_bits(level), level: level.into() })
    }

    /// Number of bricks.
    pub fn bricks(&self) -> usize {
        1 << (3 * self.level)
    }

    /// The brick in which a triangle lies between lines; `None` if it meets a line, or may do so, or leaves the brick.
    #[inline]
    pub fn hides(&self, t: &Triangle) -> Option<usize> {
        let (min, max) = bounds(t);
        // Samples are odd and vertices even, so no vertex is on a line.
        let cell = |c: i32| (c - 1) >> self.shift;
        let (from, to) = (min.map(cell), max.map(cell));
        // A line along one axis lies between cells along both others.
        let [x, y, z] = [0, 1, 2].map(|a| from[a] != to[a]);
        if (x & y | y & z | z & x) && self.meets_line(t, from, to) {
            return None;
        }
        let brick = from.map(|c| (c >> BRICK_BITS) as usize);
        let leaves = (0..3).any(|a| (from[a] ^ to[a]) >> BRICK_BITS != 0 || brick[a] >> self.level != 0);
        (!leaves).then_some((brick[2] << self.level | brick[1]) << self.level | brick[0])
    }

    /// Whether one of the lines between the cells `from` and `to` meets the triangle, or there are many.
    fn meets_line(&self, t: &Triangle, from: Units, to: Units) -> bool {
        let line = |cell: i32| (cell << self.shift) + 1;
        (0..3).any(|axis| {
            let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
            let lines = |a: usize| (from[a] + 1..=to[a]).map(line);
            (to[u] - from[u]).saturating_mul(to[v] - from[v]) > LINES_MAX
                || lines(v).any(|at_v| lines(u).any(|at_u| surrounds(t, (u, at_u), (v, at_v))))
        })
    }
}

/// Whether the projection of a triangle along an axis holds a point, its border included.
#[inline]
fn surrounds(t: &Triangle, (u, at_u): (usize, i32), (v, at_v): (usize, i32)) -> bool {
    let relative = t.map(|p| [i64::from(p[u] - at_u), i64::from(p[v] - at_v)]);
    let side = |a: [i64; 2], b: [i64; 2]| a[0] * b[1] - a[1] * b[0];
    let sides = [0, 1, 2].map(|i| side(relative[i], relative[(i + 1) % 3]));
    sides.iter().all(|s| *s >= 0) || sides.iter().all(|s| *s <= 0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::build::bins::Binner;
    use crate::build::soup::Soup;
    use crate::lattice::{NodeKey, has_area};
    use proptest::prelude::*;

    const LEVEL: u8 = 3;

    /// Triangles of about a cell's size, anywhere in the root.
    fn soup() -> impl Strategy<Value = Vec<Triangle>> {
        let size = 1i32 << spacing_bits(LEVEL);
        let small = prop::array::uniform3(prop::array::uniform3(-size / 2..size / 2));
        // Few places, so that bricks hold several.
        let place = prop::array::uniform3(1..9).prop_map(move |p| p.map(|c: i32| c * (1 << 20) + (1 << 19)));
        let shift = prop::array::uniform3(-size..size);
        let triangle = (small, place, shift, 1i32..4);
        let triangle = triangle.prop_map(|(t, p, s, scale)| {
            t.map(|v: Units| [0, 1, 2].map(|a| (p[a] + s[a] + scale * v[a]).clamp(2, (1 << 24) - 2) & !1))
        });
        prop::collection::vec(triangle.prop_filter("area", has_area), 1..300)
    }

    /// All lines that meet a triangle, found without the sieve's arithmetic: by the sign of the area in 128 bits at every
    /// line of the bounding box.
    fn meets(t: &Triangle) -> bool {
        let h = 1i128 << spacing_bits(LEVEL);
        (0..3).any(|axis| {
            let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
            let range = |a: usize| {
                let all = t.map(|p| i128::from(p[a]));
                let (low, high) = (all.iter().min().unwrap(), all.iter().max().unwrap());
                (low.div_euclid(h)..=high.div_euclid(h)).map(move |k| k * h + 1)
            };
            let area = |a: [i128; 2], b: [i128; 2], c: [i128; 2]| {
                (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
            };
            let at = |p: Units| [i128::from(p[u]), i128::from(p[v])];
            let [a, b, c] = t.map(at);
            let whole = area(a, b, c).abs();
            whole > 0
                && range(u).any(|x| {
                    range(v).any(|y| {
                        let p = [x, y];
                        area(p, b, c).abs() + area(a, p, c).abs() + area(a, b, p).abs() == whole
                    })
                })
        })
    }

    /// The deepest bricks that some triangles touch.
    fn touched<'a>(soup: impl Iterator<Item = &'a Triangle>) -> Vec<usize> {
        let binner = Binner::new(NodeKey::ROOT, LEVEL);
        let mut all = Vec::new();
        soup.for_each(|t| binner.for_touched(&Soup::CPU, t, |brick| all.push(brick)));
        all.sort_unstable();
        all.dedup();
        all
    }

    proptest! {
        #[test]
        fn what_is_left_out_meets_no_line_and_is_told_of(soup in soup()) {
            let mut sieve = FacetFilter::new(LEVEL).unwrap();
            let (kept, left): (Vec<&Triangle>, Vec<_>) = soup.iter().partition(|t| sieve.keeps(t));
            prop_assert!(left.into_iter().all(|t| !meets(t)));
            prop_assert_eq!(touched(kept.into_iter()), touched(soup.iter()));
        }
    }

    #[test]
    fn most_of_a_fine_soup_is_left_out() {
        let size = 1 << spacing_bits(LEVEL);
        let at = |n: i32| [0, 1, 2].map(|a| 2 + (1 << 20) + (n * (13 + 6 * a)) % (31 * size) / 2 * 2);
        let facet = |n| {
            [[0, 0, 0], [size / 4, 0, 0], [0, size / 4, size / 4]].map(|v: Units| {
                let place = at(n);
                [0, 1, 2].map(|a| (v[a] + place[a]) & !1)
            })
        };
        let mut sieve = FacetFilter::new(LEVEL).unwrap();
        let kept = (0..10_000).filter(|&n| sieve.keeps(&facet(n * 7919 % 100_003))).count();
        assert!((100..5_000).contains(&kept), "{kept}");
        assert!(FacetFilter::new(LEVEL_MAX + 1).is_none());
    }
}
