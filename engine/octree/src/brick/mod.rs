//! What one brick holds: samples of the winding number and, on leaves, Hermite edges.

mod coarsen;
pub mod codec;
mod count;
mod fractions;
mod hermite;
mod hermite_part;
mod range;
mod samples;
mod thin;

pub use count::Count;
pub use hermite::along_row;
pub use hermite::inside_from;
pub use hermite::{Hermite, HermiteEdge, OctNormal, Ranks, SignChanges};
pub use samples::SamplesInOrder;
pub use samples::{POINTS, Samples, point_index, point_position};
pub use thin::ThinPair;
pub use thin::{THIN_LEVELS, ThinFeatures, ThinLines, ThinSheets};

/// The content of one node of the tree.
#[derive(Clone, Debug, PartialEq)]
pub enum Brick {
    /// Every sample, apron included, has this value.
    Uniform(i16),
    /// Samples that differ, or have binary places.
    Counts {
        /// 33³ samples: 32³ owned ones and the apron.
        samples: Samples,
        /// One entry per sign-changing lattice edge, on leaves; empty on interior nodes.
        hermite: Hermite,
    },
}

impl Brick {
    /// A brick of these samples: uniform if all are the same whole number.
    #[inline]
    pub fn from_samples(samples: Samples, hermite: Hermite) -> Brick {
        let (min, max) = samples.range();
        let whole = samples.whole(min);
        if min == max && i32::from(whole) << samples.1 == i32::from(min) {
            return Brick::Uniform(whole);
        }
        Brick::Counts { samples, hermite }
    }

    /// Which of its samples are inside.
    pub fn signs(&self) -> SignChanges {
        match self {
            Brick::Uniform(w) => SignChanges::from_fn(|_| *w >= 1),
            Brick::Counts { samples, .. } => SignChanges::of(samples),
        }
    }

    /// Its samples alone.
    #[inline]
    pub fn into_samples(self) -> Samples {
        match self {
            Brick::Uniform(w) => Samples::filled(w),
            Brick::Counts { samples, .. } => samples,
        }
    }

    /// The whole winding number nearest to the sample at lattice index `(i, j, k)`, each in 0..=32; of closed
    /// input the sample itself.
    #[inline]
    pub fn sample(&self, ijk: [usize; 3]) -> i16 {
        match self {
            Brick::Uniform(w) => *w,
            Brick::Counts { samples, .. } => samples.whole(samples.at(ijk)),
        }
    }

    /// The sample at lattice index `(i, j, k)`, each in 0..=32.
    #[inline]
    pub fn value(&self, ijk: [usize; 3]) -> f64 {
        match self {
            Brick::Uniform(w) => f64::from(*w),
            Brick::Counts { samples, .. } => samples.value(ijk),
        }
    }

    /// Smallest and largest of [`Brick::sample`], apron included.
    #[inline]
    pub fn range(&self) -> (i16, i16) {
        match self {
            Brick::Uniform(w) => (*w, *w),
            Brick::Counts { samples, .. } => {
                let (min, max) = samples.range();
                (samples.whole(min), samples.whole(max))
            }
        }
    }

    /// Whether samples have binary places.
    #[inline]
    pub fn has_fractions(&self) -> bool {
        matches!(self, Brick::Counts { samples, .. } if samples.1 > 0)
    }

    /// Heap bytes, for caches with a byte budget.
    #[inline]
    pub fn heap_bytes(&self) -> usize {
        match self {
            Brick::Uniform(_) => 0,
            Brick::Counts { hermite, .. } => POINTS * size_of::<i16>() + hermite.heap_bytes(),
        }
    }
}
