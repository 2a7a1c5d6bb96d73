//! Items made by all threads and used one after the other.

use crate::error::Result;
use crate::progress::Progress;
use crate::schedule::run_ordered;

/// Items per thread that are made ahead of the one in use: enough to even out their cost, few enough to stay small in
/// memory.
const AHEAD_PER_THREAD: usize = 16;

/// Calls `make` for 0, 1, 2, … up to `count`, on any thread, and `use_item` with what it gives in this order, one at a
/// time.
///
/// # Errors
/// The first that an item gives, being made or used; [`crate::error::Error::Interrupted`] when `progress` says so.
pub(super) fn in_order<T: Send>(
    count: usize,
    progress: &dyn Progress,
    make: impl Fn(u32) -> Result<T> + Sync,
    mut use_item: impl FnMut(T) -> Result<()> + Send,
) -> Result<()> {
    let ahead = AHEAD_PER_THREAD * rayon::current_num_threads();
    // An error waits for its turn like any item, so that it is always the same one that is told.
    run_ordered(
        count,
        ahead,
        || (),
        |(), number| Ok(make(number as u32)),
        |item| {
            progress.check()?;
            use_item(item?)?;
            progress.advance(1);
            Ok(())
        },
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::error::Error;
    use crate::progress::Silent;

    fn with_threads<R: Send>(threads: usize, work: impl FnOnce() -> R + Send) -> R {
        rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap().install(work)
    }

    #[test]
    fn items_are_used_in_order_and_the_first_error_ends_it() {
        for threads in [1, 2, 5] {
            for count in [0, 1, 100, 1000] {
                let mut used = Vec::new();
                let keep = |n| {
                    used.push(n);
                    Ok(())
                };
                with_threads(threads, || in_order(count, &Silent, |n| Ok(n * 2), keep)).unwrap();
                assert_eq!(used, (0..count as u32).map(|n| n * 2).collect::<Vec<_>>());
            }
            let mut used = 0;
            let make = |n: u32| if n % 64 == 63 { Err(Error::setting(n.to_string(), "none")) } else { Ok(n) };
            let count = |_| {
                used += 1;
                Ok(())
            };
            let error = with_threads(threads, || in_order(1000, &Silent, make, count)).unwrap_err();
            assert!(error.to_string().contains("63"), "{error}");
            assert_eq!(used, 63);
            let refuse = |n| if n == 5 { Err(Error::setting("five", "none")) } else { Ok(()) };
            assert!(with_threads(threads, || in_order(1000, &Silent, Ok, refuse)).is_err());
        }
    }

    #[test]
    fn a_panic_ends_it() {
        let make = |n: u32| if n == 7 { panic!("seven") } else { Ok(n) };
        let run = || with_threads(3, || in_order(1000, &Silent, make, |_| Ok(())));
        assert!(std::panic::catch_unwind(run).is_err());
    }
}
