//! Progress on standard error: bars where that is a terminal, or JSON lines on request.

use crate::interrupt;
use crate::options::with_options;
use crate::output::{note, warn};
use crate::work::ProgressArg;
use brickfield_engine::Progress;
use indicatif::{HumanCount, ProgressBar, ProgressDrawTarget, ProgressState, ProgressStyle};
use serde::Serialize;
use std::sync::{Arc, Mutex, PoisonError, RwLock};
use std::time::{Duration, Instant};

const COUNTED: &str = "{prefix:>18} [{bar:30}] {human_pos}/{human_len} {msg} {rate} {eta} left";
const UNCOUNTED: &str = "{prefix:>18} {spinner} {human_pos} {msg} {rate} {elapsed}";
/// Redraws of a bar that does not move.
const TICK: Duration = Duration::from_millis(200);

/// The bar of the phase that runs, or the lines about it. Also how the work learns of Ctrl-C.
pub struct Bars {
    bar: RwLock<ProgressBar>,
    quiet: bool,
    /// Whether even notes are left out.
    silent: bool,
    lines: Option<Arc<Mutex<Option<Phase>>>>,
}

/// Least time between two lines about a phase, but for the last.
const LINE_EVERY: Duration = Duration::from_secs(1);

/// A phase that lines tell of.
struct Phase {
    name: String,
    unit: String,
    total: Option<u64>,
    done: u64,
    begun: Instant,
    told: Instant,
}

/// A line about a phase.
#[derive(Serialize)]
struct Line<'a> {
    phase: &'a str,
    unit: &'a str,
    done: u64,
    /// Null where nobody knows.
    total: Option<u64>,
    seconds: f64,
    /// Steps a second.
    rate: f64,
    /// Seconds left at that rate; null where nobody knows.
    left: Option<f64>,
    /// The last line about the phase.
    ended: bool,
}

impl Phase {
    fn tell_if_due(&mut self) {
        if self.told.elapsed() >= LINE_EVERY {
            self.tell(false);
        }
    }

    fn tell(&mut self, ended: bool) {
        self.told = Instant::now();
        let seconds = self.begun.elapsed().as_secs_f64();
        let rate = if seconds > 0.0 { self.done as f64 / seconds } else { 0.0 };
        let left = |total: u64| (rate > 0.0).then(|| total.saturating_sub(self.done) as f64 / rate);
        let left = self.total.and_then(left);
        let (phase, unit, done, total) = (&self.name, &self.unit, self.done, self.total);
        let line = Line { phase, unit, done, total, seconds, rate, left, ended };
        // Nobody is left to tell if this fails.
        if let Ok(text) = serde_json::to_string(&line) {
            eprintln!("{text}");
        }
    }
}

impl Bars {
    /// No bar is drawn before the first phase, nor ever if `quiet`.
    pub fn new(quiet: bool, progress: ProgressArg) -> Bars {
        let lines = matches!(progress, ProgressArg::Json).then(Arc::default);
        lines.iter().for_each(tell_on);
        Bars {
            bar: RwLock::new(ProgressBar::hidden()),
            quiet: quiet || lines.is_some(),
            silent: quiet,
            lines,
        }
    }

    /// Ends the phase that runs: removes the bar from the terminal.
    pub fn clear(&self) {
        if let Some(lines) = &self.lines
            && let Some(mut phase) = lines.lock().unwrap_or_else(PoisonError::into_inner).take()
        {
            phase.tell(true);
        }
        self.bar.read().unwrap_or_else(PoisonError::into_inner).finish_and_clear();
    }

    fn new_bar(&self, name: &str, total: Option<u64>, unit: &str) -> ProgressBar {
        // Hides itself where standard error is no terminal.
        let target = if self.quiet { ProgressDrawTarget::hidden() } else { ProgressDrawTarget::stderr() };
        let bar = ProgressBar::with_draw_target(total, target);
        if !bar.is_hidden() {
            let template = if total.is_some() { COUNTED } else { UNCOUNTED };
            if let Ok(style) = ProgressStyle::with_template(template) {
                bar.set_style(style.with_key("rate", write_rate).progress_chars("=> "));
            }
            bar.enable_steady_tick(TICK);
        }
        bar.with_prefix(name.to_owned()).with_message(unit.to_owned())
    }
}

/// Goes on to tell of a phase whose work does not advance.
fn tell_on(lines: &Arc<Mutex<Option<Phase>>>) {
    let lines = Arc::downgrade(lines);
    std::thread::spawn(move || {
        while let Some(lines) = lines.upgrade() {
            if let Some(phase) = &mut *lines.lock().unwrap_or_else(PoisonError::into_inner) {
                phase.tell_if_due();
            }
            drop(lines);
            std::thread::sleep(LINE_EVERY / 4);
        }
    });
}

/// Steps a second, without the fractions that indicatif's own key shows.
fn write_rate(state: &ProgressState, out: &mut dyn std::fmt::Write) {
    // A failed write only spoils the bar.
    let _ = write!(out, "{}/s", HumanCount(state.per_sec() as u64));
}

impl Progress for Bars {
    fn phase(&self, name: &str, total: Option<u64>, unit: &str) {
        if let Some(lines) = &self.lines {
            self.clear();
            let (name, unit, now) = (name.to_owned(), unit.to_owned(), Instant::now());
            let mut phase = Phase { name, unit, total, done: 0, begun: now, told: now };
            phase.tell(false);
            *lines.lock().unwrap_or_else(PoisonError::into_inner) = Some(phase);
            return;
        }
        let bar = self.new_bar(name, total, unit);
        let mut current = self.bar.write().unwrap_or_else(PoisonError::into_inner);
        current.finish_and_clear();
        *current = bar;
    }

    fn advance(&self, steps: u64) {
        if let Some(lines) = &self.lines {
            if let Some(phase) = &mut *lines.lock().unwrap_or_else(PoisonError::into_inner) {
                phase.done += steps;
                phase.tell_if_due();
            }
            return;
        }
        self.bar.read().unwrap_or_else(PoisonError::into_inner).inc(steps);
    }

    fn note(&self, text: &str) {
        if !self.silent {
            self.bar.read().unwrap_or_else(PoisonError::into_inner).suspend(|| note(&with_options(text)));
        }
    }

    fn warn(&self, text: &str) {
        self.bar.read().unwrap_or_else(PoisonError::into_inner).suspend(|| warn(&with_options(text)));
    }

    fn cancelled(&self) -> bool {
        interrupt::requested()
    }
}

impl Drop for Bars {
    fn drop(&mut self) {
        self.clear();
    }
}
