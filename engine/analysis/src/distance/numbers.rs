//! A number for each of many points.

use crate::error::Result;
use crate::large_array::{ArrayRoom, LargeArray};
use crate::progress::Progress;
use crate::schedule::run_ordered;
use std::path::Path;

/// Points that a thread takes at once.
const AT_ONCE: usize = 1024;

/// The numbers of many points, in their order. Those that are not finite count as none.
pub struct PointNumbers {
    all: LargeArray<f32>,
    finite: u64,
}

impl PointNumbers {
    /// None yet, in so many bytes of memory, with a mapped file in `folder` for what does not fit.
    pub(super) fn new(memory: u64, folder: &Path) -> PointNumbers {
        PointNumbers { all: LargeArray::new(&ArrayRoom::new(memory, folder)), finite: 0 }
    }

    pub(super) fn extend(&mut self, numbers: &[f32]) -> Result<()> {
        self.finite += numbers.iter().filter(|number| number.is_finite()).count() as u64;
        self.all.extend_from_slice(numbers)
    }

    /// How many points there are, and how many of them have a number.
    pub fn counts(&self) -> (usize, usize) {
        (self.all.len(), self.finite as usize)
    }

    /// The numbers of all points in order; some may not be finite.
    pub fn all(&self) -> &[f32] {
        &self.all
    }

    /// All finite numbers in order.
    pub fn iter(&self) -> impl Iterator<Item = f64> {
        self.all.iter().filter(|number| number.is_finite()).map(|&number| f64::from(number))
    }

    /// What `of` makes of the numbers, at some places among all, from the least at 0: by counts of first halves, then of second.
    pub fn at_ranks(&self, ranks: &[usize], of: impl Fn(f64) -> f64) -> Vec<f64> {
        const HALF: usize = 1 << 16;
        let mut firsts = vec![0u64; HALF];
        self.iter().for_each(|number| firsts[(in_order(of(number) as f32) >> 16) as usize] += 1);
        let place = |counts: &[u64], mut rank: u64| {
            let found = counts.iter().position(|&count| {
                let is_here = rank < count;
                rank -= if is_here { 0 } else { count };
                is_here
            });
            (found.unwrap_or(counts.len() - 1), rank)
        };
        let places: Vec<(usize, u64)> = ranks.iter().map(|&rank| place(&firsts, rank as u64)).collect();
        let mut wanted: Vec<usize> = places.iter().map(|place| place.0).collect();
        wanted.sort_unstable();
        wanted.dedup();
        let mut seconds = vec![vec![0u64; HALF]; wanted.len()];
        for key in self.iter().map(|number| in_order(of(number) as f32)) {
            if let Ok(n) = wanted.binary_search(&((key >> 16) as usize)) {
                seconds[n][(key & 0xffff) as usize] += 1;
            }
        }
        let number = |&(first, rank): &(usize, u64)| {
            let second = wanted.binary_search(&first).map_or(0, |n| place(&seconds[n], rank).0);
            f64::from(of_order((first as u32) << 16 | second as u32))
        };
        places.iter().map(number).collect()
    }
}

/// Bits that are ordered as numbers are.
fn in_order(number: f32) -> u32 {
    let bits = number.to_bits();
    if bits >> 31 == 1 { !bits } else { bits | 1 << 31 }
}

fn of_order(key: u32) -> f32 {
    f32::from_bits(if key >> 31 == 1 { key & !(1 << 31) } else { !key })
}

/// Asks for a number at all points, on all threads, in order; `take` is shown those of each part with its points. `number` may
/// keep something from one point to the next of a part. Advances `progress`, whose phase is the caller's, by one
/// a point.
///
/// # Errors
/// What `number` and `take` give; [`crate::error::Error::Interrupted`].
pub(super) fn numbers<P: Copy + Sync, L: Default>(
    points: &[P],
    progress: &dyn Progress,
    number: impl Fn(&mut L, P) -> Result<f32> + Sync,
    mut take: impl FnMut(&[P], &[f32]) -> Result<()> + Send,
) -> Result<()> {
    let chunks: Vec<&[P]> = points.chunks(AT_ONCE).collect();
    let make = |_: &mut (), n: usize| {
        progress.check()?;
        // Begun anew in each part, so that numbers do not depend on threads.
        let mut last = L::default();
        chunks[n].iter().map(|p| number(&mut last, *p)).collect::<Result<Vec<f32>>>()
    };
    let mut taken = 0;
    run_ordered(
        chunks.len(),
        8 * rayon::current_num_threads(),
        || (),
        make,
        |made: Vec<f32>| {
            take(&points[taken..][..made.len()], &made)?;
            taken += made.len();
            progress.advance(made.len() as u64);
            Ok(())
        },
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranks_are_those_of_sorted_numbers() {
        let folder = tempfile::tempdir().unwrap();
        for memory in [1 << 24, 100_000] {
            let mut numbers = PointNumbers::new(memory, folder.path());
            let mut all: Vec<f32> = (0..150_000u64)
                .map(|n| {
                    let bits = crate::lattice::mix(n.wrapping_mul(crate::lattice::GOLDEN)) as u32;
                    if n % 7 == 0 { f32::NAN } else { (bits as f32 / 4e9 - 0.5).powi(3) }
                })
                .collect();
            numbers.extend(&all).unwrap();
            all.retain(|number| number.is_finite());
            assert_eq!(numbers.counts(), (150_000, all.len()));
            assert!(numbers.iter().eq(all.iter().map(|&n| f64::from(n))));
            all.sort_by(f32::total_cmp);
            let ranks = [0, 1, 17, all.len() / 2, all.len() - 2, all.len() - 1];
            let told = numbers.at_ranks(&ranks, |value| value);
            assert_eq!(told, ranks.map(|rank| f64::from(all[rank])));
            all.sort_by(|a, b| a.abs().total_cmp(&b.abs()));
            let told = numbers.at_ranks(&ranks, f64::abs);
            assert_eq!(told, ranks.map(|rank| f64::from(all[rank].abs())));
        }
        assert!(
            [-1.5, -0.0, 0.0, 1e-30, 7.0]
                .iter()
                .all(|&n: &f32| of_order(in_order(n)).to_bits() == n.to_bits())
        );
    }
}
