//! The 33³ samples of a brick.

use crate::lattice::{BRICK_CELLS, BRICK_POINTS, Octant};
use crate::wide::{Simd, dispatch, level};

/// Samples in a brick with its apron: 33³.
pub const POINTS: usize = BRICK_POINTS * BRICK_POINTS * BRICK_POINTS;

/// Linear index of the sample `(i, j, k)`: x fastest, z slowest.
#[inline]
pub const fn point_index(ijk: [usize; 3]) -> usize {
    (ijk[2] * BRICK_POINTS + ijk[1]) * BRICK_POINTS + ijk[0]
}

/// The sample `(i, j, k)` with this linear index.
#[inline]
pub const fn point_position(index: usize) -> [usize; 3] {
    [index % BRICK_POINTS, index / BRICK_POINTS % BRICK_POINTS, index / (BRICK_POINTS * BRICK_POINTS)]
}

/// Winding numbers at the 32³ samples of a brick and its apron, the layers with an index of 32, which repeat
/// the first samples of the upper neighbours. x fastest, z slowest. The second field is the number of binary
/// places: 0 for closed input, whose samples are whole; of open input a stored s means s·2^-places.
#[derive(Clone, PartialEq, Eq)]
pub struct Samples(pub Box<[i16; POINTS]>, pub u8);

impl Samples {
    /// All samples equal to `w`.
    #[inline]
    pub fn filled(w: i16) -> Samples {
        Samples(vec![w; POINTS].into_boxed_slice().try_into().expect("the length is POINTS"), 0)
    }

    /// All samples 0, with binary places.
    #[inline]
    pub fn fractions(bits: u8) -> Samples {
        Samples::zeroed(None, bits)
    }

    /// As [`Samples::fractions`], in the memory of samples that nobody needs any more.
    #[inline]
    pub fn zeroed(spare: Option<Samples>, bits: u8) -> Samples {
        let Some(Samples(mut samples, _)) = spare else { return Samples(Samples::filled(0).0, bits) };
        samples.fill(0);
        Samples(samples, bits)
    }

    /// The nearest whole winding number of a stored sample, halves upward: at least 1 exactly where w ≥ 0.5.
    #[inline]
    pub fn whole(&self, stored: i16) -> i16 {
        ((i32::from(stored) + (1 << self.1 >> 1)) >> self.1) as i16
    }

    /// The same samples without binary places, if all are whole.
    #[inline]
    pub fn without_idle_places(mut self) -> Samples {
        let places = (1i16 << self.1) - 1;
        if self.1 > 0 && self.0.iter().fold(0, |any, w| any | w) & places == 0 {
            self.0.iter_mut().for_each(|w| *w >>= self.1);
            self.1 = 0;
        }
        self
    }

    /// The winding number at `(i, j, k)`, each in 0..=32.
    #[inline]
    pub fn value(&self, ijk: [usize; 3]) -> f64 {
        f64::from(self.at(ijk)) / f64::from(1u32 << self.1)
    }

    /// The sample at `(i, j, k)`, each in 0..=32, as stored.
    #[inline]
    pub fn at(&self, ijk: [usize; 3]) -> i16 {
        self.0[point_index(ijk)]
    }

    /// The samples at the corners of the node's children, by octant, as stored.
    #[inline]
    pub fn child_corners(&self) -> [i16; 8] {
        let mut corners = [0; 8];
        for octant in Octant::all() {
            corners[octant.index()] = self.at(octant.offset().map(|o| o * BRICK_CELLS / 2));
        }
        corners
    }

    /// Smallest and largest sample as stored, apron included.
    #[inline]
    pub fn range(&self) -> (i16, i16) {
        dispatch!(level(), simd => self.range_with(simd))
    }

    /// The plain loop, as compiled for the widest vectors.
    #[inline(always)]
    fn range_with<S: Simd>(&self, _: S) -> (i16, i16) {
        self.0.iter().fold((i16::MAX, i16::MIN), |(lo, hi), &w| (lo.min(w), hi.max(w)))
    }

    /// Calls `row` with each of the 32² rows of owned samples.
    #[inline]
    pub fn for_owned_rows(&self, mut row: impl FnMut(&[i16])) {
        for k in 0..BRICK_CELLS {
            for j in 0..BRICK_CELLS {
                row(&self.0[point_index([0, j, k])..][..BRICK_CELLS]);
            }
        }
    }

    /// Σw and Σw² over the 32³ owned samples; the sums are exact.
    #[inline]
    pub fn moments(&self) -> (i64, u64) {
        let (mut sum, mut squares) = (0i64, 0u64);
        self.for_owned_rows(|row| {
            sum += i64::from(row.iter().map(|&w| i32::from(w)).sum::<i32>());
            squares += row.iter().map(|&w| (i64::from(w) * i64::from(w)) as u64).sum::<u64>();
        });
        (sum, squares)
    }

    /// By how much the samples at the ends of the brick's lattice edges, those of the apron included, differ, added up over
    /// all edges.
    #[inline]
    pub fn variation(&self) -> u64 {
        const LAYER: usize = BRICK_POINTS * BRICK_POINTS;
        // Of 33 x 33 x 32 differences of 16 bits at most, so 32 bits suffice.
        let between = |lower: &[i16], upper: &[i16]| -> u32 {
            lower.iter().zip(upper).map(|(a, b)| u32::from(a.abs_diff(*b))).sum()
        };
        let along_x: u32 = self.0.chunks_exact(BRICK_POINTS).map(|row| between(row, &row[1..])).sum();
        let along_y: u32 =
            self.0.chunks_exact(LAYER).map(|layer| between(layer, &layer[BRICK_POINTS..])).sum();
        let along_z = between(&self.0[..], &self.0[LAYER..]);
        u64::from(along_x) + u64::from(along_y) + u64::from(along_z)
    }
}

/// Whole samples that are made from the first to the last.
pub struct SamplesInOrder(Vec<i16>);

impl SamplesInOrder {
    /// None yet; they will lie in the memory of samples that nobody needs any more.
    #[inline]
    pub fn new(spare: Option<Samples>) -> SamplesInOrder {
        let Some(Samples(samples, _)) = spare else { return SamplesInOrder(Vec::with_capacity(POINTS)) };
        let mut samples = (samples as Box<[i16]>).into_vec();
        samples.clear();
        SamplesInOrder(samples)
    }

    /// Sets the samples from linear index `at`, before which all are set, to the end of its row, and beyond: always a
    /// row's length, which is a few wide stores, where the exact length would be a call. What lies beyond is set again
    /// later, or cut off.
    #[inline]
    pub fn fill_from(&mut self, at: usize, w: i16) {
        self.0.truncate(at);
        if at + BRICK_POINTS <= POINTS {
            self.0.extend_from_slice(&[w; BRICK_POINTS]);
        } else {
            self.0.resize(POINTS, w);
        }
    }

    /// The samples, of which all must be set.
    #[inline]
    pub fn finish(self) -> Samples {
        Samples(self.0.into_boxed_slice().try_into().expect("all samples are set"), 0)
    }
}

impl std::fmt::Debug for Samples {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let (lo, hi) = self.range();
        write!(f, "Samples({lo}..={hi})")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn positions_are_those_of_indices() {
        assert!((0..POINTS).all(|index| point_index(point_position(index)) == index));
        assert_eq!(point_position(POINTS - 1), [32; 3]);
    }

    #[test]
    fn moments_leave_the_apron_out() {
        let mut samples = Samples::filled(0);
        samples.0[point_index([32, 0, 0])] = 100;
        samples.0[point_index([31, 31, 31])] = -3;
        assert_eq!(samples.moments(), (-3, 9));
        assert_eq!(samples.range(), (-3, 100));
    }

    #[test]
    fn variation_is_of_all_edges_along_three_axes() {
        let mut samples = Samples::filled(2);
        assert_eq!(samples.variation(), 0);
        // A corner of the apron ends three edges, a sample amid the brick six; between them there is none.
        samples.0[point_index([32, 32, 32])] = 3;
        assert_eq!(samples.variation(), 3);
        samples.0[point_index([5, 7, 31])] = -4;
        assert_eq!(samples.variation(), 3 + 6 * 6);
        // The farthest apart that they can be, everywhere.
        let ends = |number: usize| if number.is_multiple_of(2) { i16::MIN } else { i16::MAX };
        (0..POINTS).for_each(|number| samples.0[number] = ends(number));
        assert_eq!(samples.variation(), 3 * 33 * 33 * 32 * 65535);
    }
}
