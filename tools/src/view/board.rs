//! Where a painter's rows are put together for the window, which looks at them whenever it likes.

use super::painter::{Painter, PixelSource, Rows, StopConditions};
use super::session::Shot;
use brickfield_engine::picture::Rgba;
use brickfield_engine::{Error, Progress};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

/// How often the window is told of rows that are done: more would only keep the painter from its work.
const TELL_EVERY: Duration = Duration::from_millis(40);

/// A picture of the window's size, so far.
#[derive(Clone, Debug, Default)]
pub struct Picture {
    /// Width and height in pixels.
    pub size: [u32; 2],
    /// Rows from the top.
    pub pixels: Vec<Rgba>,
    /// The number of the wish that it answers in full; 0 while it is being painted.
    pub complete: u64,
    /// Whose pixels it has when it is complete.
    pub by: PixelSource,
}

/// What the window wants, and what there is of it. The painter works on a thread of its own ([`Board::work`]).
pub struct Board {
    wish: Mutex<Option<Shot>>,
    wished: Condvar,
    /// Counts the wishes; the last one is all that matters.
    number: AtomicU64,
    picture: Mutex<Picture>,
}

/// The number of the wish after which there is none.
const OVER: u64 = u64::MAX;

impl Board {
    pub fn new() -> Board {
        let (wish, wished) = (Mutex::new(None), Condvar::new());
        Board { wish, wished, number: AtomicU64::new(0), picture: Mutex::default() }
    }

    /// Wishes for a picture, in place of any before; its number.
    pub fn ask(&self, shot: Shot) -> u64 {
        let mut wish = lock(&self.wish);
        *wish = Some(shot);
        let number = self.number.fetch_add(1, Ordering::SeqCst) + 1;
        self.wished.notify_one();
        number
    }

    /// What there is by now.
    pub fn picture(&self) -> MutexGuard<'_, Picture> {
        lock(&self.picture)
    }

    /// Lets [`Board::work`] return when the guard goes, however that comes.
    pub fn over_at_end(&self) -> BoardGuard<'_> {
        BoardGuard(self)
    }

    /// Paints what is wished for, and calls `tell` whenever there is something new to see. Returns when it is over.
    ///
    /// # Errors
    /// What the painter gives, but for being interrupted.
    pub fn work(&self, painter: &mut dyn Painter, tell: &dyn Fn()) -> Result<(), Error> {
        while let Some((number, shot)) = self.next() {
            let until = StopConditions { another: &Stop { board: self, number }, over: &End(self) };
            let mut told = Instant::now();
            let mut show = |rows: Rows<'_>| {
                let ends = rows.from as usize + rows.pixels.len() / rows.size[0].max(1) as usize;
                let is_whole = ends == rows.size[1] as usize;
                lock(&self.picture).take(&rows, shot.size);
                if is_whole || told.elapsed() >= TELL_EVERY {
                    tell();
                    told = Instant::now();
                }
            };
            match painter.paint(&shot, until, &mut show) {
                Ok(by) => {
                    let mut picture = lock(&self.picture);
                    (picture.complete, picture.by) = (number, by);
                    drop(picture);
                    tell();
                }
                Err(Error::Interrupted) => {}
                Err(error) => return Err(error),
            }
        }
        Ok(())
    }

    /// Waits for a wish.
    fn next(&self) -> Option<(u64, Shot)> {
        let mut wish = lock(&self.wish);
        loop {
            let number = self.number.load(Ordering::SeqCst);
            if number == OVER {
                return None;
            }
            if let Some(shot) = wish.take() {
                return Some((number, shot));
            }
            wish = self.wished.wait(wish).unwrap_or_else(PoisonError::into_inner);
        }
    }
}

/// Ends the work on a board as it is dropped.
pub struct BoardGuard<'a>(&'a Board);

impl Drop for BoardGuard<'_> {
    fn drop(&mut self) {
        // Under the lock, so that nobody misses it between looking and waiting.
        let _wish = lock(&self.0.wish);
        self.0.number.store(OVER, Ordering::SeqCst);
        self.0.wished.notify_all();
    }
}

/// Stops the painter when there is another wish.
struct Stop<'a> {
    board: &'a Board,
    number: u64,
}

impl Progress for Stop<'_> {
    fn cancelled(&self) -> bool {
        self.board.number.load(Ordering::Relaxed) != self.number
    }
}

/// Stops the painter when it is over.
struct End<'a>(&'a Board);

impl Progress for End<'_> {
    fn cancelled(&self) -> bool {
        self.0.number.load(Ordering::Relaxed) == OVER
    }
}

impl Picture {
    /// Takes rows over, each pixel as large as the window needs it.
    fn take(&mut self, rows: &Rows<'_>, size: [u32; 2]) {
        self.complete = 0;
        if self.size != size {
            self.size = size;
            self.pixels.clear();
            self.pixels.resize(size[0] as usize * size[1] as usize, [255; 4]);
        }
        let [width, height] = size.map(|side| side as usize);
        let [across, down] = rows.size.map(|side| side.max(1) as usize);
        for (n, row) in rows.pixels.chunks_exact(across).enumerate() {
            let y = rows.from as usize + n;
            let first = (y * height).div_ceil(down) * width;
            let end = ((y + 1) * height).div_ceil(down) * width;
            let Some(target) = self.pixels.get_mut(first..end) else { continue };
            let mut lines = target.chunks_exact_mut(width);
            let Some(line) = lines.next() else { continue };
            if across == width {
                line.copy_from_slice(row);
            } else {
                line.iter_mut().enumerate().for_each(|(x, pixel)| *pixel = row[x * across / width]);
            }
            for other in lines {
                other.copy_from_slice(line);
            }
        }
    }
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

#[cfg(test)]
mod tests {
    use super::*;
    use brickfield_engine::render::{Focus, View};
    use std::sync::mpsc;

    fn shot(size: [u32; 2]) -> Shot {
        let focus = Focus { centre: [0.0; 3], height: 1.0 };
        Shot { view: View::named("iso").unwrap(), focus, cut: None, style: 0, size }
    }

    #[test]
    fn small_pictures_fill_the_window() {
        for (size, small) in [([7, 5], [3, 2]), ([7, 5], [7, 5]), ([5, 7], [1, 1]), ([9, 4], [2, 4])] {
            let mut picture = Picture::default();
            for y in 0..small[1] {
                let row: Vec<Rgba> = (0..small[0]).map(|x| [x as u8, y as u8, 0, 255]).collect();
                picture.take(&Rows { size: small, from: y, pixels: &row }, size);
            }
            assert_eq!(picture.pixels.len() as u32, size[0] * size[1]);
            for (n, pixel) in (0..).zip(&picture.pixels) {
                let at = [n % size[0] * small[0] / size[0], n / size[0] * small[1] / size[1]];
                assert_eq!([u32::from(pixel[0]), u32::from(pixel[1])], at, "{size:?} {small:?} {n}");
            }
        }
    }

    /// Paints one pixel a step until it is stopped, or is told to be done; one shot until it is over.
    struct Patient<'a>(&'a mpsc::Sender<[u32; 2]>);

    impl Painter for Patient<'_> {
        fn paint(
            &mut self,
            shot: &Shot,
            until: StopConditions<'_>,
            show: &mut dyn FnMut(Rows<'_>),
        ) -> Result<PixelSource, Error> {
            show(Rows { size: [1, 1], from: 0, pixels: &[[shot.size[0] as u8; 4]] });
            self.0.send(shot.size).expect("the test looks on");
            // One wish of the test is the only one that may be finished.
            let is_last = shot.size[0] == 9;
            let mut is_first_step = shot.size[0] == 7;
            loop {
                if is_first_step && until.another.cancelled() {
                    assert!(!until.over.cancelled(), "it ends for another picture");
                    self.0.send([0, 0]).expect("the test looks on");
                    is_first_step = false;
                    while !until.over.cancelled() {
                        std::thread::yield_now();
                    }
                }
                if is_last {
                    return Ok(PixelSource::Processor);
                }
                until.another.check()?;
                std::thread::yield_now();
            }
        }
    }

    #[test]
    fn another_wish_stops_the_painter_and_the_end_even_its_first_step() {
        let board = Board::new();
        let (seen, looks) = mpsc::channel();
        let (told, news) = mpsc::channel();
        std::thread::scope(|scope| {
            let over = board.over_at_end();
            let work = scope
                .spawn(|| board.work(&mut Patient(&seen), &|| told.send(()).expect("the test looks on")));
            for size in [[1, 1], [2, 1], [3, 1]] {
                board.ask(shot(size));
                assert_eq!(looks.recv().unwrap(), size);
                assert_eq!(board.picture().complete, 0);
            }
            let last = board.ask(shot([9, 1]));
            assert_eq!(looks.recv().unwrap(), [9, 1]);
            while board.picture().complete != last {
                news.recv().unwrap();
            }
            assert_eq!(board.picture().pixels, [[9; 4]; 9]);
            board.ask(shot([7, 1]));
            assert_eq!(looks.recv().unwrap(), [7, 1]);
            board.ask(shot([1, 1]));
            assert_eq!(looks.recv().unwrap(), [0, 0]);
            drop(over);
            assert!(work.join().unwrap().is_ok());
        });
    }
}
