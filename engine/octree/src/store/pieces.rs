//! Pieces of a file that lies elsewhere, in memory: those that were asked for ahead come several at once, and whoever
//! reads takes what is here, waits for what is on its way, and asks for the rest.
//!
//! Each byte is asked for once while it is held. What is held is bounded: pieces that were read to their end go first,
//! then the oldest.

use super::ranges::{ByteRanges, RangeFault};
use std::collections::{BTreeMap, VecDeque};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, OnceLock, PoisonError};
use std::time::Duration;

/// Most bytes of a request. Larger parts come as several, side by side.
const REQUEST_BYTES: u64 = 512 << 10;
/// How often a request is given again whose fault may pass.
const TRIES: u32 = 6;
/// How long the first wait before it is; each is twice as long as the one before.
const FIRST_WAIT: Duration = Duration::from_millis(if cfg!(test) { 1 } else { 100 });
/// Bytes of pieces that are held.
pub(super) const HELD_BYTES: u64 = 24 << 20;

/// A file that lies elsewhere.
pub(super) struct Pieces(Arc<Shared>);

struct Shared {
    ranges: Arc<dyn ByteRanges>,
    bytes_max: u64,
    state: Mutex<State>,
    /// A piece has come, or will not come.
    came: Condvar,
    /// There is something to ask for, or nobody is left who wants it.
    wanted: Condvar,
    /// The first fault that did not pass. From then on every answer is this one.
    fault: OnceLock<RangeFault>,
    requests: AtomicU64,
    fetched: AtomicU64,
}

#[derive(Default)]
struct State {
    /// By their first byte; none overlaps another.
    pieces: BTreeMap<u64, Piece>,
    /// Those that wait to be asked for, in order. Some may have been asked for meanwhile.
    queue: VecDeque<u64>,
    /// Those that have come, oldest first, and those that were read to the end. Some may be gone.
    order: VecDeque<u64>,
    spent: VecDeque<u64>,
    /// Of all pieces, come or not.
    bytes: u64,
    workers: usize,
    idle: usize,
    is_closed: bool,
}

struct Piece {
    length: u64,
    state: PieceState,
    /// Bytes that were read of it.
    read: u64,
}

#[derive(Clone)]
enum PieceState {
    /// Nobody has asked for it yet.
    Waiting,
    UnderWay,
    Here(Arc<[u8]>),
}

/// What a reader finds at a place.
enum Found {
    /// The bytes of a piece, from the place on.
    Here(Arc<[u8]>, usize),
    /// A piece that this reader is to ask for: where it begins, and its length.
    Asking(u64, u64),
    Later,
}

impl Pieces {
    /// A file, of which at most `bytes_max` are held.
    pub fn new(ranges: Arc<dyn ByteRanges>, bytes_max: u64) -> Pieces {
        Pieces(Arc::new(Shared {
            ranges,
            bytes_max,
            state: Mutex::default(),
            came: Condvar::new(),
            wanted: Condvar::new(),
            fault: OnceLock::new(),
            requests: AtomicU64::new(0),
            fetched: AtomicU64::new(0),
        }))
    }

    /// Size of the file.
    pub fn bytes(&self) -> u64 {
        self.0.ranges.bytes()
    }

    /// Why nothing more can be read, if so.
    pub fn fault(&self) -> Option<&RangeFault> {
        self.0.fault.get()
    }

    /// Requests that were given so far, and bytes that came.
    pub fn requests(&self) -> (u64, u64) {
        (self.0.requests.load(Ordering::Relaxed), self.0.fetched.load(Ordering::Relaxed))
    }

    /// Copies the bytes from `offset` on, which lie in the file, to `to`.
    ///
    /// # Errors
    /// One phrase; [`Pieces::fault`] has it with what to do.
    pub fn read(&self, offset: u64, to: &mut [u8]) -> Result<(), String> {
        let (mut at, end) = (offset, offset + to.len() as u64);
        while at < end {
            if end - at > REQUEST_BYTES {
                self.ahead(at, end - at);
            }
            if let Some(fault) = self.fault() {
                return Err(fault.what.clone());
            }
            let rest = &mut to[(at - offset) as usize..];
            let mut state = self.0.lock();
            match state.find(at, end) {
                Found::Here(bytes, from) => {
                    drop(state);
                    let count = rest.len().min(bytes.len() - from);
                    rest[..count].copy_from_slice(&bytes[from..][..count]);
                    at += count as u64;
                }
                Found::Asking(start, length) => {
                    state.make_room(self.0.bytes_max, 0);
                    drop(state);
                    self.0.fetch(start, length);
                }
                Found::Later => drop(self.0.came.wait(state).unwrap_or_else(PoisonError::into_inner)),
            }
        }
        Ok(())
    }

    /// Has a part of the file fetched that will be read before long: as much of it as there is room for.
    pub fn ahead(&self, offset: u64, bytes: u64) {
        let shared = &self.0;
        let mut state = shared.lock();
        let (mut at, end) = (offset, offset.saturating_add(bytes).min(self.bytes()));
        while at < end {
            let (is_there, until) = state.stretch(at);
            if is_there {
                at = until;
                continue;
            }
            let length = (until.min(end) - at).min(REQUEST_BYTES);
            if !state.make_room(shared.bytes_max, length) {
                break;
            }
            state.add(at, length, PieceState::Waiting);
            state.queue.push_back(at);
            at += length;
        }
        // Those that are free take one each.
        let missing = state.queue.len().saturating_sub(state.idle);
        let workers = missing.min(shared.ranges.at_once().saturating_sub(state.workers));
        for _ in 0..workers {
            let worker = Arc::clone(shared);
            // Without it the bytes come when they are read.
            let spawned = std::thread::Builder::new().name("ranges".to_owned()).spawn(move || worker.work());
            state.workers += usize::from(spawned.is_ok());
        }
        shared.wanted.notify_all();
    }
}

impl Drop for Pieces {
    fn drop(&mut self) {
        // Not waited for: a request may take its time to fail.
        self.0.lock().is_closed = true;
        self.0.wanted.notify_all();
    }
}

impl Shared {
    /// No code that may panic runs under the lock, so a poisoned one holds sound data.
    fn lock(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Asks for one waiting piece after the other.
    fn work(&self) {
        let mut state = self.lock();
        while !state.is_closed {
            match state.next_waiting() {
                Some((start, length)) => {
                    drop(state);
                    self.fetch(start, length);
                    state = self.lock();
                }
                None => {
                    state.idle += 1;
                    state = self.wanted.wait(state).unwrap_or_else(PoisonError::into_inner);
                    state.idle -= 1;
                }
            }
        }
    }

    /// Asks for a piece that is known as under way, until it is here or does not come.
    fn fetch(&self, start: u64, length: u64) {
        let came = self.try_to_read(start, length);
        let mut state = self.lock();
        match came {
            Ok(bytes) => {
                if let Some(piece) = state.pieces.get_mut(&start) {
                    piece.state = PieceState::Here(bytes);
                    state.has_come(start);
                }
            }
            Err(fault) => {
                let _ = self.fault.set(fault);
                state.remove(start);
            }
        }
        drop(state);
        self.came.notify_all();
    }

    fn try_to_read(&self, start: u64, length: u64) -> Result<Arc<[u8]>, RangeFault> {
        let mut bytes = vec![0; length as usize];
        let mut wait = FIRST_WAIT;
        for tried in 1.. {
            if let Some(fault) = self.fault.get() {
                return Err(fault.clone());
            }
            self.requests.fetch_add(1, Ordering::Relaxed);
            match self.ranges.read(start, &mut bytes) {
                Ok(()) => break,
                Err(fault) if !fault.may_pass => return Err(fault),
                Err(fault) if tried == TRIES => {
                    let what = format!("{}, {TRIES} times in a row", fault.what);
                    return Err(RangeFault { what, ..fault });
                }
                Err(_) => {
                    std::thread::sleep(wait);
                    wait *= 2;
                }
            }
        }
        self.fetched.fetch_add(length, Ordering::Relaxed);
        Ok(bytes.into())
    }
}

impl State {
    /// Whether a piece has this byte, and where it ends; otherwise where the next one begins.
    fn stretch(&self, at: u64) -> (bool, u64) {
        let before = self.pieces.range(..=at).next_back();
        match before.map(|(start, piece)| start + piece.length).filter(|end| at < *end) {
            Some(end) => (true, end),
            None => (false, self.pieces.range(at..).next().map_or(u64::MAX, |(start, _)| *start)),
        }
    }

    /// What there is for who reads from `at` to `end`.
    fn find(&mut self, at: u64, end: u64) -> Found {
        let (is_there, until) = self.stretch(at);
        if !is_there {
            let length = (until.min(end) - at).min(REQUEST_BYTES);
            self.add(at, length, PieceState::UnderWay);
            return Found::Asking(at, length);
        }
        let Some((&start, piece)) = self.pieces.range_mut(..=at).next_back() else { return Found::Later };
        match piece.state.clone() {
            PieceState::Here(bytes) => {
                piece.read += until.min(end) - at;
                if piece.read >= piece.length {
                    self.spent.push_back(start);
                }
                Found::Here(bytes, (at - start) as usize)
            }
            PieceState::Waiting => {
                piece.state = PieceState::UnderWay;
                Found::Asking(start, piece.length)
            }
            PieceState::UnderWay => Found::Later,
        }
    }

    fn next_waiting(&mut self) -> Option<(u64, u64)> {
        while let Some(start) = self.queue.pop_front() {
            if let Some(piece) = self.pieces.get_mut(&start)
                && matches!(piece.state, PieceState::Waiting)
            {
                piece.state = PieceState::UnderWay;
                return Some((start, piece.length));
            }
        }
        None
    }

    fn add(&mut self, start: u64, length: u64, state: PieceState) {
        self.bytes += length;
        self.pieces.insert(start, Piece { length, state, read: 0 });
    }

    /// Puts a piece behind all others, and forgets those that are gone where they have become many.
    fn has_come(&mut self, start: u64) {
        let State { pieces, order, .. } = self;
        if order.len() > 2 * pieces.len() + 64 {
            order.retain(|start| pieces.contains_key(start));
        }
        order.push_back(start);
    }

    fn remove(&mut self, start: u64) {
        if let Some(piece) = self.pieces.remove(&start) {
            self.bytes -= piece.length;
        }
    }

    /// Lets go of pieces that have come, until there is room for so many bytes more; false if there is not.
    fn make_room(&mut self, bytes_max: u64, more: u64) -> bool {
        while self.bytes + more > bytes_max {
            let Some(start) = self.spent.pop_front().or_else(|| self.order.pop_front()) else { return false };
            let is_here = |piece: &Piece| matches!(piece.state, PieceState::Here(_));
            if self.pieces.get(&start).is_some_and(is_here) {
                self.remove(start);
            }
        }
        true
    }
}

#[cfg(test)]
mod tests {
    use super::super::ranges::testing::SlowBytes;
    use super::*;

    fn numbered(length: usize) -> Vec<u8> {
        (0..length).map(|n| ((n * n) >> 7) as u8 ^ n as u8).collect()
    }

    fn pieces(slow: SlowBytes, bytes_max: u64) -> (Pieces, Arc<SlowBytes>) {
        let slow = Arc::new(slow);
        (Pieces::new(slow.clone(), bytes_max), slow)
    }

    fn part(pieces: &Pieces, offset: u64, length: usize) -> Result<Vec<u8>, String> {
        let mut bytes = vec![0; length];
        pieces.read(offset, &mut bytes).map(|()| bytes)
    }

    #[test]
    fn what_is_read_is_what_is_there_and_comes_once() {
        let bytes = numbered(3 << 20);
        let (pieces, slow) = pieces(SlowBytes { bytes: bytes.clone(), ..SlowBytes::default() }, 64 << 20);
        pieces.ahead(1000, 500);
        pieces.ahead(2 << 20, u64::MAX);
        for (offset, length) in [(0, 5), (900, 300), (1400, 300), (0, 3 << 20), (5, 0), ((3 << 20) - 1, 1)] {
            let found = part(&pieces, offset as u64, length).unwrap();
            assert!(found == bytes[offset..][..length], "{offset} {length}");
        }
        let asked = slow.asked.lock().unwrap();
        assert_eq!(asked.iter().map(|(_, length)| length).sum::<usize>(), 3 << 20);
        assert!(asked.iter().all(|(_, length)| *length as u64 <= REQUEST_BYTES));
        assert_eq!(pieces.requests(), (asked.len() as u64, 3 << 20));
    }

    #[test]
    fn ranges_ahead_come_side_by_side_and_those_who_want_the_same_wait_for_it() {
        let bytes = numbered(1 << 20);
        let delay = Duration::from_millis(30);
        let (pieces, slow) =
            pieces(SlowBytes { bytes: bytes.clone(), delay, ..SlowBytes::default() }, 8 << 20);
        let places: Vec<u64> = (0..12).map(|n| n * 80_000).collect();
        places.iter().for_each(|at| pieces.ahead(*at, 100));
        std::thread::scope(|scope| {
            for _ in 0..3 {
                scope.spawn(|| {
                    for at in &places {
                        assert_eq!(part(&pieces, *at, 100).unwrap(), bytes[*at as usize..][..100]);
                    }
                });
            }
        });
        assert_eq!(slow.asked.lock().unwrap().len(), 12);
        let most = slow.most.load(Ordering::SeqCst);
        // Readers ask for what waits, too.
        assert!((2..=4 + 3).contains(&most), "{most} at once");
    }

    #[test]
    fn what_is_held_is_bounded() {
        let bytes = numbered(4 << 20);
        let (pieces, slow) = pieces(SlowBytes { bytes: bytes.clone(), ..SlowBytes::default() }, 1 << 20);
        // More than there is room for.
        pieces.ahead(0, 4 << 20);
        for round in 0..2 {
            for at in (0..4 << 20).step_by(100_000) {
                let length = 100_000.min((4 << 20) - at);
                assert!(part(&pieces, at as u64, length).unwrap() == bytes[at..][..length], "{round} {at}");
                assert!(pieces.0.lock().bytes <= (1 << 20) + REQUEST_BYTES);
            }
        }
        // The second time they came again.
        assert!(slow.asked.lock().unwrap().iter().map(|(_, length)| length).sum::<usize>() > 7 << 20);
    }

    #[test]
    fn what_passes_is_tried_again_and_what_does_not_is_the_end() {
        let bytes = numbered(1000);
        let cut = |cuts: usize, cuts_pass: bool| {
            let cuts = cuts.into();
            pieces(SlowBytes { bytes: bytes.clone(), cuts, cuts_pass, ..SlowBytes::default() }, 1 << 20)
        };
        let (twice, slow) = cut(2, true);
        assert_eq!(part(&twice, 10, 100).unwrap(), bytes[10..110]);
        assert_eq!(slow.asked.lock().unwrap().len(), 3);
        let (never, slow) = cut(usize::MAX, false);
        assert_eq!(part(&never, 10, 100).unwrap_err(), "the connection was cut");
        assert_eq!(part(&never, 500, 1).unwrap_err(), "the connection was cut");
        assert_eq!(never.fault().unwrap().remedy, "try later");
        assert_eq!(slow.asked.lock().unwrap().len(), 1);
        // Whoever waits for what is on its way learns of it, too.
        let (never, _) = cut(usize::MAX, false);
        never.ahead(0, 1000);
        assert!(part(&never, 0, 1000).is_err());
    }

    #[test]
    fn a_fault_that_would_pass_but_does_not_says_how_often_it_was_met() {
        let slow = SlowBytes {
            bytes: numbered(10),
            cuts: usize::MAX.into(),
            cuts_pass: true,
            ..SlowBytes::default()
        };
        let (pieces, slow) = pieces(slow, 1 << 20);
        assert_eq!(part(&pieces, 0, 10).unwrap_err(), "the connection was cut, 6 times in a row");
        assert_eq!(slow.asked.lock().unwrap().len(), 6);
    }
}
