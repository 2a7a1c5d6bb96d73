//! Work done on all threads, its results consumed one by one in order.

use crate::error::{Error, Result};
use std::collections::BTreeMap;
use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};

struct State<T> {
    next_claimed: usize,
    next_consumed: usize,
    consuming: bool,
    ready: BTreeMap<usize, T>,
    failure: Option<Error>,
}

/// Runs `work(0..count)` on the threads of the current pool and passes the results to `consume` in order
/// of their number. A thread waits rather than run more than `window` numbers ahead of the one to be
/// consumed next, so that at most that many results are held. The first error ends everything.
pub(super) fn run_ordered<L, T: Send>(
    count: usize,
    window: usize,
    local: impl Fn() -> L + Sync,
    work: impl Fn(&mut L, usize) -> Result<T> + Sync,
    consume: impl FnMut(T) -> Result<()> + Send,
) -> Result<()> {
    let state = Mutex::new(State {
        next_claimed: 0,
        next_consumed: 0,
        consuming: false,
        ready: BTreeMap::new(),
        failure: None,
    });
    let moved = Condvar::new();
    let consume = Mutex::new(consume);
    rayon::broadcast(|_| {
        let guard = PanicGuard(&state, &moved);
        let mut local = local();
        while let Some(number) = claim(&state, &moved, count, window) {
            match work(&mut local, number) {
                Ok(result) => drain(&state, &moved, &consume, number, result),
                Err(error) => fail(&state, &moved, error),
            }
        }
        drop(guard);
    });
    state.into_inner().expect("no thread panicked").failure.map_or(Ok(()), Err)
}

fn lock<'a, T>(state: &'a Mutex<State<T>>) -> MutexGuard<'a, State<T>> {
    state.lock().expect("no thread panicked")
}

/// Lets the other threads end if this one panics, so that the panic is passed on and nobody waits for ever.
struct PanicGuard<'a, T>(&'a Mutex<State<T>>, &'a Condvar);

impl<T> Drop for PanicGuard<'_, T> {
    fn drop(&mut self) {
        if std::thread::panicking() {
            self.0.lock().unwrap_or_else(PoisonError::into_inner).failure.get_or_insert(Error::Interrupted);
            self.1.notify_all();
        }
    }
}

/// The next number to work on; `None` when there is none left or something failed.
fn claim<T>(state: &Mutex<State<T>>, moved: &Condvar, count: usize, window: usize) -> Option<usize> {
    let mut held = lock(state);
    loop {
        if held.failure.is_some() || held.next_claimed == count {
            return None;
        }
        if held.next_claimed < held.next_consumed + window {
            held.next_claimed += 1;
            return Some(held.next_claimed - 1);
        }
        held = moved.wait(held).expect("no thread panicked");
    }
}

/// Hands in a result; consumes it and those after it if it is the next and nobody else is at it.
fn drain<T>(
    state: &Mutex<State<T>>,
    moved: &Condvar,
    consume: &Mutex<impl FnMut(T) -> Result<()>>,
    number: usize,
    result: T,
) {
    let mut held = lock(state);
    held.ready.insert(number, result);
    if held.consuming {
        return;
    }
    held.consuming = true;
    loop {
        let next = held.next_consumed;
        let Some(result) = held.ready.remove(&next) else { break };
        drop(held);
        let outcome = (consume.lock().expect("no thread panicked"))(result);
        held = lock(state);
        held.next_consumed += 1;
        moved.notify_all();
        if let Err(error) = outcome {
            held.failure.get_or_insert(error);
        }
        if held.failure.is_some() {
            break;
        }
    }
    held.consuming = false;
}

fn fail<T>(state: &Mutex<State<T>>, moved: &Condvar, error: Error) {
    lock(state).failure.get_or_insert(error);
    moved.notify_all();
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn results_come_in_order_and_the_window_holds() {
        for threads in [1, 2, 3, 8] {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            let mut seen = Vec::new();
            let held = std::sync::atomic::AtomicUsize::new(0);
            let work = |_: &mut (), n: usize| {
                let now = held.fetch_add(1, std::sync::atomic::Ordering::SeqCst);
                assert!(now < 4);
                std::thread::sleep(std::time::Duration::from_micros((n as u64 * 7919) % 300));
                Ok(n)
            };
            let consume = |n| {
                held.fetch_sub(1, std::sync::atomic::Ordering::SeqCst);
                seen.push(n);
                Ok(())
            };
            pool.install(|| run_ordered(200, 4, || (), work, consume)).unwrap();
            assert_eq!(seen, (0..200).collect::<Vec<_>>());
        }
    }

    #[test]
    #[should_panic(expected = "number 9")]
    fn a_panic_is_passed_on_and_nobody_waits() {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(3).build().unwrap();
        let work = |_: &mut (), n: usize| if n == 9 { panic!("number {n}") } else { Ok(n) };
        let _ = pool.install(|| run_ordered(1000, 4, || (), work, |_| Ok(())));
    }

    #[test]
    fn an_error_from_either_side_ends_the_run() {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(3).build().unwrap();
        let bad = || Err::<usize, _>(Error::Interrupted);
        let from_work = |_: &mut (), n| if n == 17 { bad() } else { Ok(n) };
        assert!(pool.install(|| run_ordered(100, 4, || (), from_work, |_| Ok(()))).is_err());
        let from_consume = |n| if n == 5 { bad().map(drop) } else { Ok(()) };
        assert!(
            pool.install(|| run_ordered(100, 4, || (), |_: &mut (), n: usize| Ok(n), from_consume)).is_err()
        );
    }
}
