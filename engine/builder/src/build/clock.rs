//! How long the phases of a build take.

use std::time::{Duration, Instant};

/// Time by phase.
pub(super) struct Clock {
    last: Instant,
    pub laps: Vec<(&'static str, f64)>,
}

impl Default for Clock {
    fn default() -> Self {
        Clock { last: Instant::now(), laps: Vec::new() }
    }
}

impl Clock {
    pub fn lap(&mut self, phase: &'static str) {
        let elapsed: Duration = self.last.elapsed();
        self.last = Instant::now();
        self.laps.push((phase, elapsed.as_secs_f64()));
    }

    /// As [`Self::lap`], of a phase that not every build has.
    pub fn lap_if(&mut self, there: bool, phase: &'static str) {
        if there {
            self.lap(phase);
        }
    }
}
