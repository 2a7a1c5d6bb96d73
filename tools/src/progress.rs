//! Progress bars on standard error, where that is a terminal.

use crate::interrupt;
use brickfield_engine::Progress;
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use std::sync::{PoisonError, RwLock};
use std::time::Duration;

const COUNTED: &str = "{prefix:>18} [{bar:30}] {human_pos}/{human_len} {msg} {per_sec} {eta} left";
const UNCOUNTED: &str = "{prefix:>18} {spinner} {human_pos} {msg} {per_sec} {elapsed}";
/// Redraws of a bar that does not move.
const TICK: Duration = Duration::from_millis(200);

/// The bar of the phase that runs. Also how the work learns of Ctrl-C.
pub struct Bars {
    bar: RwLock<ProgressBar>,
    quiet: bool,
}

impl Bars {
    /// No bar is drawn before the first phase, nor ever if `quiet`.
    pub fn new(quiet: bool) -> Bars {
        Bars { bar: RwLock::new(ProgressBar::hidden()), quiet }
    }

    /// Removes the bar from the terminal.
    pub fn clear(&self) {
        self.bar.read().unwrap_or_else(PoisonError::into_inner).finish_and_clear();
    }

    fn new_bar(&self, name: &str, total: Option<u64>, unit: &str) -> ProgressBar {
        // Hides itself where standard error is no terminal.
        let target = if self.quiet { ProgressDrawTarget::hidden() } else { ProgressDrawTarget::stderr() };
        let bar = ProgressBar::with_draw_target(total, target);
        if !bar.is_hidden() {
            let template = if total.is_some() { COUNTED } else { UNCOUNTED };
            if let Ok(style) = ProgressStyle::with_template(template) {
                bar.set_style(style.progress_chars("=> "));
            }
            bar.enable_steady_tick(TICK);
        }
        bar.with_prefix(name.to_owned()).with_message(unit.to_owned())
    }
}

impl Progress for Bars {
    fn phase(&self, name: &str, total: Option<u64>, unit: &str) {
        let bar = self.new_bar(name, total, unit);
        let mut current = self.bar.write().unwrap_or_else(PoisonError::into_inner);
        current.finish_and_clear();
        *current = bar;
    }

    fn advance(&self, steps: u64) {
        self.bar.read().unwrap_or_else(PoisonError::into_inner).inc(steps);
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
