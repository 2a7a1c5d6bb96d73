//! Tasks done on all threads within a bound of memory, their results consumed one by one in order.
//!
//! A task may turn out to be several: it is *opened*, and what it was opened into takes its place in the order. So
//! neither the number of tasks nor which of them are opened is known beforehand, and none of it shows in what is
//! consumed.

mod ordered;

pub use ordered::{fold_in_order, run_ordered};

use crate::error::{Error, Result};
use std::collections::{BTreeMap, BTreeSet};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};

/// Where a task stands; what a task is opened into stands behind it and before the next.
pub type TaskOrder = (u64, u8);

/// Memory that counts towards the bound until it is dropped.
pub struct MemoryReservation {
    bytes: u64,
    total: Arc<AtomicU64>,
}

impl MemoryReservation {
    /// Changes how much it is.
    pub fn resize(&mut self, bytes: u64) {
        self.total.fetch_add(bytes, Ordering::Relaxed);
        self.total.fetch_sub(self.bytes, Ordering::Relaxed);
        self.bytes = bytes;
    }
}

impl Drop for MemoryReservation {
    fn drop(&mut self) {
        self.total.fetch_sub(self.bytes, Ordering::Relaxed);
    }
}

/// What became of a task.
pub enum TaskOutcome<T, E> {
    /// It is done. The result, and what is held for it.
    Done(E, MemoryReservation),
    /// It was opened into tasks, each with its place; `E` is what the consumer is to know before theirs.
    Opened(E, Vec<(TaskOrder, T)>),
}

/// Bounds of a run.
#[derive(Clone, Copy)]
pub struct RunLimits {
    /// Bytes that tasks and results may take together.
    pub memory: u64,
    /// Bytes of that which only the task to be consumed next may take, so that it can go on whatever the others hold.
    pub reserve: u64,
    /// Tasks in work and results that wait.
    pub window: usize,
}

/// Tasks and results by number, for a scheduler that knows their numbers alone: it is compiled once, however many kinds of
/// tasks there are.
struct Slots<T>(Mutex<(Vec<Option<T>>, Vec<usize>)>);

impl<T> Slots<T> {
    fn new() -> Slots<T> {
        Slots(Mutex::default())
    }

    fn lock(&self) -> MutexGuard<'_, (Vec<Option<T>>, Vec<usize>)> {
        self.0.lock().expect("no thread panicked")
    }

    /// Keeps an item, and returns its number.
    fn put(&self, item: T) -> usize {
        let (items, free) = &mut *self.lock();
        let number = free.pop().unwrap_or_else(|| {
            items.push(None);
            items.len() - 1
        });
        items[number] = Some(item);
        number
    }

    /// Gives an item back, whose number is free then.
    fn take(&self, number: usize) -> T {
        let (items, free) = &mut *self.lock();
        free.push(number);
        items[number].take().expect("an item that was put there")
    }

    /// What `look` says of an item.
    fn look(&self, number: usize, look: impl Fn(&T) -> u64) -> u64 {
        self.lock().0[number].as_ref().map_or(0, look)
    }
}

/// Runs `work` on `tasks`, and on those into which they are opened, on the threads of the current pool, and passes what
/// comes out to `consume` in the order of places. `need` bounds the memory that a task takes while it runs; `consume`
/// returns how much it keeps for good, if that has changed. A task begins when there is memory for it; if
/// nothing else runs and nothing is being consumed, in any case.
/// The first error ends everything.
pub fn run_tasks<L, T: Send, E: Send>(
    tasks: Vec<(TaskOrder, T)>,
    bounds: RunLimits,
    local: impl Fn() -> L + Sync,
    need: impl Fn(&T) -> u64 + Sync,
    work: impl Fn(&mut L, T, MemoryReservation) -> Result<TaskOutcome<T, E>> + Sync,
    mut consume: impl FnMut(E) -> Result<Option<u64>> + Send,
) -> Result<()> {
    let (waiting, results) = (Slots::new(), Slots::new());
    let keep = |tasks: Vec<(TaskOrder, T)>| {
        tasks.into_iter().map(|(place, task)| (place, waiting.put(task))).collect::<Vec<_>>()
    };
    let mut consume_number = |number| consume(results.take(number));
    let run = TaskRun::new(keep(tasks), bounds, &mut consume_number);
    on_each_thread(&|_| {
        let guard = PanicGuard(&run);
        let mut local = local();
        while let Some((place, number, held)) = run.claim(&|number| waiting.look(number, &need)) {
            match work(&mut local, waiting.take(number), held) {
                Ok(TaskOutcome::Done(result, held)) => {
                    run.hand_in(place, results.put(result), Some(held), Vec::new());
                }
                Ok(TaskOutcome::Opened(opening, tasks)) => {
                    run.hand_in(place, results.put(opening), None, keep(tasks));
                }
                Err(error) => run.fail(error),
            }
        }
        drop(guard);
    });
    run.end()
}

/// Calls `body` with its number on each thread of the current pool. Compiled once for all of them.
fn on_each_thread(body: &(dyn Fn(usize) + Sync)) {
    rayon::broadcast(|thread| body(thread.index()));
}

/// Where the tasks of a run stand, by their numbers.
struct RunState {
    waiting: BTreeMap<TaskOrder, usize>,
    running: BTreeSet<TaskOrder>,
    ready: BTreeMap<TaskOrder, (usize, Option<MemoryReservation>)>,
    consuming: bool,
    /// Threads that wait for a task.
    idle: usize,
    /// Bytes that the consumer keeps.
    kept: u64,
    failure: Option<Error>,
}

/// A run of tasks that are known by their numbers.
struct TaskRun<'a> {
    state: Mutex<RunState>,
    moved: Condvar,
    held: Arc<AtomicU64>,
    bounds: RunLimits,
    consume: Mutex<&'a mut Consumer<'a>>,
}

/// Takes the number of a result, and returns what the consumer keeps, if that has changed.
type Consumer<'a> = dyn FnMut(usize) -> Result<Option<u64>> + Send + 'a;

/// Lets the other threads end if this one panics, so that the panic is passed on and nobody waits for ever.
struct PanicGuard<'r, 'a>(&'r TaskRun<'a>);

impl Drop for PanicGuard<'_, '_> {
    fn drop(&mut self) {
        if std::thread::panicking() {
            let mut state = self.0.state.lock().unwrap_or_else(PoisonError::into_inner);
            state.failure.get_or_insert(Error::Interrupted);
            self.0.moved.notify_all();
        }
    }
}

impl<'a> TaskRun<'a> {
    fn new(tasks: Vec<(TaskOrder, usize)>, bounds: RunLimits, consume: &'a mut Consumer<'a>) -> TaskRun<'a> {
        let state = RunState {
            waiting: tasks.into_iter().collect(),
            running: BTreeSet::new(),
            ready: BTreeMap::new(),
            consuming: false,
            idle: 0,
            kept: 0,
            failure: None,
        };
        let (state, moved) = (Mutex::new(state), Condvar::new());
        TaskRun { state, moved, held: Arc::default(), bounds, consume: Mutex::new(consume) }
    }

    /// The first error, if there was one.
    fn end(self) -> Result<()> {
        let state = self.state.into_inner().expect("no thread panicked");
        state.failure.map_or(Ok(()), Err)
    }

    fn lock(&self) -> MutexGuard<'_, RunState> {
        self.state.lock().expect("no thread panicked")
    }

    /// Lets threads that wait for a task look again. To wake nobody is a system call, too.
    fn wake(&self, state: &RunState) {
        if state.idle > 0 {
            self.moved.notify_all();
        }
    }

    /// The next task and the memory for it; `None` when there is none left or something failed.
    fn claim(&self, need: &dyn Fn(usize) -> u64) -> Option<(TaskOrder, usize, MemoryReservation)> {
        let mut state = self.lock();
        loop {
            if state.failure.is_some() || (state.waiting.is_empty() && state.running.is_empty()) {
                return None;
            }
            let bytes = state.waiting.first_key_value().map(|(_, task)| need(*task));
            if let Some(bytes) = bytes
                && self.admits(&state, bytes)
                && let Some((place, task)) = state.waiting.pop_first()
            {
                state.running.insert(place);
                self.held.fetch_add(bytes, Ordering::Relaxed);
                return Some((place, task, MemoryReservation { bytes, total: Arc::clone(&self.held) }));
            }
            state.idle += 1;
            state = self.moved.wait(state).expect("no thread panicked");
            state.idle -= 1;
        }
    }

    /// Whether the first waiting task may begin.
    fn admits(&self, state: &RunState, bytes: u64) -> bool {
        // While a result is consumed its memory will be free before long, and who consumes it tells.
        if state.running.is_empty() && !state.consuming {
            return true;
        }
        let taken = self.held.load(Ordering::Relaxed).saturating_add(state.kept).saturating_add(bytes);
        if state.waiting.keys().next() < state.running.first() {
            return taken <= self.bounds.memory;
        }
        taken.saturating_add(self.bounds.reserve) <= self.bounds.memory
            && state.running.len() + state.ready.len() < self.bounds.window
    }

    /// Takes what became of a task, and the tasks into which it was opened; consumes what is next, and what follows it, if
    /// nobody else is at it.
    fn hand_in(
        &self,
        place: TaskOrder,
        result: usize,
        held: Option<MemoryReservation>,
        opened: Vec<(TaskOrder, usize)>,
    ) {
        let mut state = self.lock();
        state.running.remove(&place);
        state.ready.insert(place, (result, held));
        state.waiting.extend(opened);
        self.wake(&state);
        // After a failure nothing more is consumed, also of tasks that were running then.
        if state.consuming || state.failure.is_some() {
            return;
        }
        state.consuming = true;
        while let Some((result, held)) = state.next_result() {
            drop(state);
            let outcome = (self.consume.lock().expect("no thread panicked"))(result);
            drop(held);
            state = self.lock();
            self.wake(&state);
            match outcome {
                Ok(kept) => state.kept = kept.unwrap_or(state.kept),
                Err(error) => drop(state.failure.get_or_insert(error)),
            }
            if state.failure.is_some() {
                break;
            }
        }
        state.consuming = false;
    }

    fn fail(&self, error: Error) {
        let mut state = self.lock();
        state.failure.get_or_insert(error);
        self.wake(&state);
    }
}

impl RunState {
    /// The first result, if nothing that is still to come stands before it.
    fn next_result(&mut self) -> Option<(usize, Option<MemoryReservation>)> {
        let place = *self.ready.first_key_value()?.0;
        let pending = self.running.first().into_iter().chain(self.waiting.keys().next());
        if pending.min().is_some_and(|first| *first < place) {
            return None;
        }
        self.ready.remove(&place)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::atomic::AtomicUsize;

    fn pool(threads: usize) -> rayon::ThreadPool {
        rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap()
    }

    /// A task is a range of numbers; ranges above a size are opened.
    type Range = std::ops::Range<u64>;

    fn split(range: &Range, size: u64) -> Vec<(TaskOrder, Range)> {
        let level = (64 - (range.end - range.start).leading_zeros()) as u8;
        let part = |from| ((from, 64 - level + 1), from..range.end.min(from + size));
        (range.start..range.end).step_by(size as usize).map(part).collect()
    }

    #[test]
    fn results_come_in_order_within_the_bounds() {
        for threads in [1, 2, 3, 8] {
            for memory in [1, 40, 1000] {
                let mut seen = Vec::new();
                let now = AtomicU64::new(0);
                let bounds = RunLimits { memory, reserve: memory / 4, window: 5 };
                let work = |_: &mut (), range: Range, mut held: MemoryReservation| {
                    let size = range.end - range.start;
                    std::thread::sleep(std::time::Duration::from_micros((range.start * 7919) % 200));
                    if size > 3 {
                        let parts = split(&range, size.div_ceil(4));
                        return Ok(TaskOutcome::Opened(range.start..range.start, parts));
                    }
                    let taken = now.fetch_add(size, Ordering::Relaxed) + size;
                    assert!(taken <= memory.max(3), "{taken} of {memory}");
                    held.resize(size);
                    Ok(TaskOutcome::Done(range, held))
                };
                let consume = |range: Range| {
                    now.fetch_sub(range.end - range.start, Ordering::Relaxed);
                    seen.extend(range);
                    Ok(None)
                };
                let need = |range: &Range| (range.end - range.start).min(3);
                let tasks = split(&(0..300), 70);
                pool(threads).install(|| run_tasks(tasks, bounds, || (), need, work, consume)).unwrap();
                assert_eq!(seen, (0..300).collect::<Vec<_>>(), "{threads} threads, {memory}");
            }
        }
    }

    const WIDE: RunLimits = RunLimits { memory: u64::MAX, reserve: 0, window: 4 };

    fn numbers(count: u64) -> Vec<(TaskOrder, u64)> {
        (0..count).map(|n| ((n, 0), n)).collect()
    }

    #[test]
    fn no_more_than_the_window_is_held() {
        let held = AtomicUsize::new(0);
        let work = |_: &mut (), n: u64, of: MemoryReservation| {
            // One more is being consumed.
            assert!(held.fetch_add(1, Ordering::SeqCst) < 5);
            std::thread::sleep(std::time::Duration::from_micros((n * 7919) % 300));
            Ok(TaskOutcome::Done(n, of))
        };
        let consume = |_| {
            held.fetch_sub(1, Ordering::SeqCst);
            Ok(None)
        };
        pool(8).install(|| run_tasks(numbers(200), WIDE, || (), |_| 1, work, consume)).unwrap();
    }

    #[test]
    fn a_slow_consumer_is_waited_for() {
        let held = AtomicUsize::new(0);
        let work = |_: &mut (), n: u64, of: MemoryReservation| {
            assert!(held.fetch_add(1, Ordering::SeqCst) < 5);
            Ok(TaskOutcome::Done(n, of))
        };
        let consume = |_| {
            std::thread::sleep(std::time::Duration::from_millis(2));
            held.fetch_sub(1, Ordering::SeqCst);
            Ok(None)
        };
        pool(2).install(|| run_tasks(numbers(50), WIDE, || (), |_| 1, work, consume)).unwrap();
    }

    #[test]
    #[should_panic(expected = "number 9")]
    fn a_panic_is_passed_on_and_nobody_waits() {
        let work = |_: &mut (), n: u64, held: MemoryReservation| {
            if n == 9 { panic!("number {n}") } else { Ok(TaskOutcome::Done(n, held)) }
        };
        let _ = pool(3).install(|| run_tasks(numbers(1000), WIDE, || (), |_| 1, work, |_| Ok(None)));
    }

    /// A task that ends only after the consumer has failed has its result dropped.
    #[test]
    fn nothing_is_consumed_after_a_failure() {
        let has_failed = AtomicUsize::new(0);
        let work = |_: &mut (), n: u64, held: MemoryReservation| {
            while n == 6 && has_failed.load(Ordering::SeqCst) == 0 {
                std::thread::yield_now();
            }
            if n == 6 {
                // Until the failure has been noted.
                std::thread::sleep(std::time::Duration::from_millis(20));
            }
            Ok(TaskOutcome::Done(n, held))
        };
        let mut seen = Vec::new();
        let consume = |n| {
            seen.push(n);
            if n < 5 {
                return Ok(None);
            }
            has_failed.store(1, Ordering::SeqCst);
            Err(Error::Interrupted)
        };
        assert!(pool(2).install(|| run_tasks(numbers(100), WIDE, || (), |_| 1, work, consume)).is_err());
        assert_eq!(seen, [0, 1, 2, 3, 4, 5]);
    }

    #[test]
    fn an_error_from_either_side_ends_the_run() {
        let bad_work = |_: &mut (), n: u64, held: MemoryReservation| {
            if n == 17 { Err(Error::Interrupted) } else { Ok(TaskOutcome::Done(n, held)) }
        };
        let run = || run_tasks(numbers(100), WIDE, || (), |_| 1, bad_work, |_| Ok(None));
        assert!(pool(3).install(run).is_err());
        let work = |_: &mut (), n: u64, held: MemoryReservation| Ok(TaskOutcome::Done(n, held));
        let bad_consume = |n| if n == 5 { Err(Error::Interrupted) } else { Ok(None) };
        let run = || run_tasks(numbers(100), WIDE, || (), |_| 1, work, bad_consume);
        assert!(pool(3).install(run).is_err());
    }
}
