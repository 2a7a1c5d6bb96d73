//! A number for each of many points.

use crate::error::Result;
use crate::progress::Progress;
use crate::schedule::run_ordered;

/// Points that a thread takes at once.
const AT_ONCE: usize = 1024;

/// Asks for a number at all points, on all threads, in order; `take` is shown those of each part with its points. `number` may
/// keep something from one point to the next of a part. Advances `progress`, whose phase is the caller's, by one a point.
///
/// # Errors
/// What `number` and `take` give; [`crate::error::Error::Interrupted`].
pub(super) fn numbers<P: Copy + Sync, L: Default>(
    points: &[P],
    progress: &dyn Progress,
    number: impl Fn(&mut L, P) -> Result<f32> + Sync,
    mut take: impl FnMut(&[P], &[f32]) -> Result<()> + Send,
) -> Result<Vec<f32>> {
    let chunks: Vec<&[P]> = points.chunks(AT_ONCE).collect();
    let make = |_: &mut (), n: usize| {
        progress.check()?;
        // Begun anew in each part, so that numbers do not depend on threads.
        let mut last = L::default();
        chunks[n].iter().map(|p| number(&mut last, *p)).collect::<Result<Vec<f32>>>()
    };
    let mut numbers: Vec<f32> = Vec::with_capacity(points.len());
    run_ordered(
        chunks.len(),
        8 * rayon::current_num_threads(),
        || (),
        make,
        |made: Vec<f32>| {
            take(&points[numbers.len()..][..made.len()], &made)?;
            progress.advance(made.len() as u64);
            numbers.extend(made);
            Ok(())
        },
    )?;
    Ok(numbers)
}
