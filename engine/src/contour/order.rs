//! Items made by all threads and used one after the other.

use crate::error::Result;
use crate::progress::Progress;
use std::collections::VecDeque;
use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};

/// Items per thread that are made ahead of the one in use: enough to even out their cost, few enough to stay small in
/// memory.
const AHEAD_PER_THREAD: usize = 16;

/// Calls `make` for 0, 1, 2, … up to `count`, on any thread, and `use_item` with what it gives in this order, one at a
/// time. No thread waits while there is something to use or to make.
///
/// # Errors
/// The first that an item gives, being made or used; [`crate::Error::Interrupted`] when `progress` says so.
pub(super) fn in_order<T: Send>(
    count: usize,
    progress: &dyn Progress,
    make: impl Fn(u32) -> Result<T> + Sync,
    use_item: impl FnMut(T) -> Result<()> + Send,
) -> Result<()> {
    let line = Line {
        count,
        ahead: AHEAD_PER_THREAD * rayon::current_num_threads(),
        progress,
        make,
        use_item: Mutex::new(use_item),
        state: Mutex::new(State { made: VecDeque::new(), begun: 0, taken: 0, in_use: false, end: None }),
        changed: Condvar::new(),
    };
    if count == 0 {
        return Ok(());
    }
    rayon::broadcast(|_| line.work());
    line.state.into_inner().unwrap_or_else(PoisonError::into_inner).end.unwrap_or(Ok(()))
}

struct Line<'a, T, M, U> {
    count: usize,
    ahead: usize,
    progress: &'a dyn Progress,
    make: M,
    use_item: Mutex<U>,
    state: Mutex<State<T>>,
    changed: Condvar,
}

struct State<T> {
    /// What is made or being made, from number `taken` on.
    made: VecDeque<Option<Result<T>>>,
    /// Number of the next to be made.
    begun: usize,
    /// Number of the next to be used.
    taken: usize,
    in_use: bool,
    /// How it ended.
    end: Option<Result<()>>,
}

impl<T, M, U> Line<'_, T, M, U>
where
    M: Fn(u32) -> Result<T>,
    U: FnMut(T) -> Result<()>,
{
    fn work(&self) {
        let _release = Release(self);
        let mut state = self.lock();
        while state.end.is_none() {
            if !state.in_use && matches!(state.made.front(), Some(Some(_))) {
                let Some(item) = state.made.pop_front().flatten() else { continue };
                state.taken += 1;
                state.in_use = true;
                drop(state);
                let used = item.and_then(|item| self.make_use_of(item));
                state = self.lock();
                state.in_use = false;
                if used.is_err() || state.taken == self.count {
                    state.end.get_or_insert(used);
                }
                self.changed.notify_all();
            } else if state.begun < self.count.min(state.taken + self.ahead) {
                let number = state.begun;
                state.begun += 1;
                state.made.push_back(None);
                drop(state);
                let item = (self.make)(number as u32);
                state = self.lock();
                let place = number - state.taken;
                state.made[place] = Some(item);
                if place == 0 {
                    self.changed.notify_all();
                }
            } else {
                state = self.changed.wait(state).unwrap_or_else(PoisonError::into_inner);
            }
        }
    }

    fn make_use_of(&self, item: T) -> Result<()> {
        self.progress.check()?;
        // One thread at a time gets here.
        let mut use_item = self.use_item.lock().unwrap_or_else(PoisonError::into_inner);
        use_item(item)?;
        self.progress.advance(1);
        Ok(())
    }
}

impl<T, M, U> Line<'_, T, M, U> {
    fn lock(&self) -> MutexGuard<'_, State<T>> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Lets the other threads go when one panics.
struct Release<'a, 'b, T, M, U>(&'a Line<'b, T, M, U>);

impl<T, M, U> Drop for Release<'_, '_, T, M, U> {
    fn drop(&mut self) {
        if std::thread::panicking() {
            self.0.lock().end.get_or_insert(Ok(()));
            self.0.changed.notify_all();
        }
    }
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
