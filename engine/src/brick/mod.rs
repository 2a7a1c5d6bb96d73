//! What one brick holds: samples of the winding number and, on leaves, Hermite edges.

pub mod codec;
mod hermite;
mod samples;

pub(crate) use hermite::inside_from;
pub use hermite::{Hermite, HermiteEdge, OctNormal, SignChanges};
pub use samples::{POINTS, Samples, point_index};

/// The content of one node of the tree.
#[derive(Clone, Debug, PartialEq)]
pub enum Brick {
    /// Every sample, apron included, has this value.
    Uniform(i16),
    /// Samples that differ.
    Counts {
        /// 33³ samples: 32³ owned ones and the apron.
        samples: Samples,
        /// One entry per sign-changing lattice edge, on leaves; empty on interior nodes.
        hermite: Hermite,
    },
}

impl Brick {
    /// The sample at lattice index `(i, j, k)`, each in 0..=32.
    #[inline]
    pub fn sample(&self, ijk: [usize; 3]) -> i16 {
        match self {
            Brick::Uniform(w) => *w,
            Brick::Counts { samples, .. } => samples.at(ijk),
        }
    }

    /// Smallest and largest sample, apron included.
    pub fn range(&self) -> (i16, i16) {
        match self {
            Brick::Uniform(w) => (*w, *w),
            Brick::Counts { samples, .. } => samples.range(),
        }
    }

    /// Heap bytes, for caches with a byte budget.
    pub fn heap_bytes(&self) -> usize {
        match self {
            Brick::Uniform(_) => 0,
            Brick::Counts { hermite, .. } => POINTS * size_of::<i16>() + hermite.heap_bytes(),
        }
    }
}
