//! Work handed out to all threads in order.

use super::{RunLimits, TaskOutcome, on_each_thread, run_tasks};
use crate::error::Result;
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};

/// Runs `work(0..count)` on the threads of the current pool and passes the results to `consume` in order
/// of their number. A thread waits rather than run more than `window` numbers ahead of the one to be
/// consumed next, so that at most that many results are held. The first error ends everything.
pub fn run_ordered<L, T: Send>(
    count: usize,
    window: usize,
    local: impl Fn() -> L + Sync,
    work: impl Fn(&mut L, usize) -> Result<T> + Sync,
    mut consume: impl FnMut(T) -> Result<()> + Send,
) -> Result<()> {
    let tasks = (0..count).map(|number| ((number as u64, 0), number)).collect();
    // The result that is being consumed counts too.
    let bounds = RunLimits { memory: u64::MAX, reserve: 0, window: window.saturating_sub(1) };
    let work = |local: &mut L, number, held| Ok(TaskOutcome::Done(work(local, number)?, held));
    run_tasks(tasks, bounds, local, |_| 0, work, |result| consume(result).map(|()| None))
}

/// Adds items to parts, one for each thread of the current pool. Items are claimed in order, so that all threads
/// together read an input from front to back. The first error ends everything.
pub fn fold_in_order<T: Sync, P: Send>(
    items: &[T],
    part: impl Fn() -> P + Sync,
    add: impl Fn(&mut P, &T) -> Result<()> + Sync,
) -> Result<Vec<P>> {
    let next = AtomicUsize::new(0);
    let parts: Vec<Mutex<Option<Result<P>>>> =
        (0..rayon::current_num_threads()).map(|_| Mutex::new(None)).collect();
    on_each_thread(&|thread| {
        let fold = || {
            let mut part = part();
            while let Some(item) = items.get(next.fetch_add(1, Ordering::Relaxed)) {
                add(&mut part, item).inspect_err(|_| next.store(items.len(), Ordering::Relaxed))?;
            }
            Ok(part)
        };
        *parts[thread].lock().expect("a part of this thread alone") = Some(fold());
    });
    let parts = parts.into_iter().filter_map(|part| part.into_inner().expect("no thread panicked"));
    parts.collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::error::Error;

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
