//! A part as few flat ellipses, larger than cells: as many as are asked for, with the least error found.
//!
//! Wu and Kobbelt (2004) cover sampled surfaces by the fewest splats within an error. Here the number is given. The surface
//! is divided among so many sites by a distance that says how wide the slab around a plane must be to hold a bent surface:
//! half the curvature times the square of the length, along each principal direction. Sites move to the middles of what is
//! theirs (Lloyd's method), in which what is far counts more and more; those with wide slabs lose samples to others. So the
//! worst error becomes small.
//!
//! | file | owns |
//! |---|---|
//! | `ellipse` | an ellipse, and which are wanted |
//! | `samples` | crossings of the leaves, by cubes |
//! | `bend` | how a surface bends around a sample |
//! | `site` | a site: its distances and its moves |
//! | `relax` | all sites, and what is whose |
//! | `fit` | the ellipse of a site, and its error |
//!
//! All is in order of samples and sites, in whole numbers or by exact operations, so threads change no bit.

mod bend;
mod ellipse;
mod fit;
mod relax;
mod samples;
mod site;
#[cfg(test)]
mod tests;

pub use ellipse::{Ellipse, EllipseOptions};

use crate::error::{Error, Result};
use crate::progress::Progress;
use crate::store::BrickTree;
use relax::SiteCover;
use samples::SurfaceSamples;

/// Covers the boundary of a tree by ellipses: each crossing lies in one of them, seen along its normal.
///
/// # Errors
/// [`Error::Setting`] if the crossings do not fit in the memory; what reading gives;
/// [`crate::error::Error::Interrupted`].
pub fn ellipses_of(
    tree: &dyn BrickTree,
    options: EllipseOptions,
    progress: &dyn Progress,
) -> Result<Vec<Ellipse>> {
    if options.number == 0 {
        return Err(Error::setting("no ellipse covers no part", "ask for a larger `number`"));
    }
    let samples = SurfaceSamples::new(tree, options.number, options.memory, progress)?;
    cover(&samples, options, progress)
}

fn cover(samples: &SurfaceSamples, options: EllipseOptions, progress: &dyn Progress) -> Result<Vec<Ellipse>> {
    if samples.list.is_empty() {
        return Ok(Vec::new());
    }
    let mut sites = SiteCover::new(samples, options, progress)?;
    sites.relax(progress)?;
    sites.ellipses(samples, progress)
}
