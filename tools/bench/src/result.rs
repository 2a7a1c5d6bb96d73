//! What was measured, as it stands in a file.

use crate::child::ProcessRun;
use crate::machine::Machine;
use anyhow::{Context, anyhow};
use brickfield_terminal::failure::Failure;
use brickfield_terminal::output::in_line;
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};
use std::fs;
use std::path::Path;

/// The version of the file's layout.
const FORMAT: u32 = 1;
/// Results have kilobytes; what is larger than this is none.
const BYTES_MAX: u64 = 256 << 20;

/// All of one run of `bench`.
#[derive(Serialize, Deserialize)]
pub struct Results {
    pub format: u32,
    pub program: String,
    /// Of the checkout that the program was built from, if that is still there, and whether files of it were changed.
    pub commit: Option<String>,
    /// UTC, as 2026-11-22.
    pub date: String,
    pub machine: Machine,
    pub settings: Settings,
    /// Seconds of the whole run, inputs included.
    pub seconds: f64,
    /// Of these the making and checking of inputs.
    pub input_seconds: f64,
    /// The system's load average over a minute, before and after: above the number of threads others were at work.
    pub load: [f64; 2],
    /// What the machine does at best, measured in every round of every suite.
    #[serde(default)]
    pub limits: Vec<Limits>,
    pub inputs: Vec<InputFact>,
    pub figures: Vec<Figure>,
}

/// What was asked for.
#[derive(Serialize, Deserialize)]
pub struct Settings {
    pub suites: Vec<String>,
    pub quick: bool,
    pub full: bool,
    pub rounds: u16,
    pub threads: usize,
}

/// What all threads do at best.
#[derive(Clone, Copy, Serialize, Deserialize)]
pub struct Limits {
    /// That are read from memory.
    pub bytes_per_second: f64,
    /// Additions and multiplications in double precision, of plain code.
    pub operations_per_second: f64,
}

/// A file that was read.
#[derive(Clone, Serialize, Deserialize)]
pub struct InputFact {
    pub name: String,
    pub bytes: u64,
    /// Of meshes.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub triangles: Option<u64>,
    /// FNV-1a of the bytes, in hexadecimal.
    pub fnv1a: String,
}

/// One job on one input.
#[derive(Clone, Serialize, Deserialize)]
pub struct Figure {
    pub suite: String,
    /// Name of the input's file.
    pub input: String,
    /// What was done, different from all others of the suite and input.
    pub job: String,
    /// The plot that it belongs to: what is varied there.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub series: Option<String>,
    /// What jobs vary: numbers by name, such as depth or threads.
    #[serde(default)]
    pub at: Map<String, Value>,
    /// Not measured as a whole: samples in proportion to what was measured of a few.
    #[serde(default)]
    pub extrapolated: bool,
    /// Bytes of the files that have to be read whole and of those that are left: each moves through memory once at least.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub least_bytes: Option<u64>,
    /// Operations on numbers, where they can be counted.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub least_operations: Option<f64>,
    /// Why there is nothing to tell: of other programs only.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub failed: Option<String>,
    /// None if it failed.
    pub rounds: Vec<Round>,
    /// What the job told of its result; equal in all rounds.
    #[serde(default)]
    pub facts: Map<String, Value>,
}

/// One round of a figure.
#[derive(Clone, Copy, Serialize, Deserialize)]
pub struct Round {
    pub seconds: f64,
    /// User and system time.
    pub cpu_seconds: f64,
    /// The read floor of the input just before.
    pub floor_seconds: f64,
    /// The most anonymous memory of the process; 0 if it ended too soon to be seen, or is this one.
    pub anonymous_bytes: u64,
}

impl Round {
    /// With another process, which ran after the others.
    pub fn add(&mut self, ran: &ProcessRun) {
        self.seconds += ran.seconds;
        self.cpu_seconds += ran.cpu_seconds;
        self.anonymous_bytes = self.anonymous_bytes.max(ran.anonymous_bytes);
    }
}

impl Results {
    /// With the layout of this version.
    pub fn format() -> u32 {
        FORMAT
    }

    /// Reads a file.
    ///
    /// # Errors
    /// If it cannot be read, is no result, or holds numbers that no run gives.
    pub fn read(path: &Path) -> Result<Results, Failure> {
        let name = in_line(path);
        let bytes = fs::metadata(path).with_context(|| format!("{name}: cannot be read"))?.len();
        let refuse = |what: &str| anyhow!("{name}: {what}; give what `brickfield-bench -o` wrote");
        if bytes > BYTES_MAX {
            return Err(refuse("this is too large for a result").into());
        }
        let text = fs::read(path).with_context(|| format!("{name}: cannot be read"))?;
        let results: Results = serde_json::from_slice(&text)
            .map_err(|error| refuse(&format!("this is no result of a benchmark: {error}")))?;
        if results.format != FORMAT {
            let what =
                format!("its layout is of version {}, and this program reads {FORMAT}", results.format);
            return Err(refuse(&what).into());
        }
        let positive = |value: f64| value.is_finite() && value > 0.0;
        let sound = |l: &Limits| positive(l.bytes_per_second) && positive(l.operations_per_second);
        if !results.limits.iter().all(sound) {
            return Err(refuse("it has limits of the machine that are not above 0").into());
        }
        if let Some(figure) = results.figures.iter().find(|figure| !figure.is_sound()) {
            return Err(
                refuse(&format!("\"{}\" has no rounds, or times that are not above 0", figure.id())).into()
            );
        }
        Ok(results)
    }

    /// How many times as long a figure took as the machine's limit for it, and which limit: the longer one.
    pub fn in_limits(&self, figure: &Figure) -> Option<(f64, &'static str)> {
        if self.limits.is_empty() || figure.rounds.is_empty() {
            return None;
        }
        let median = |of: fn(&Limits) -> f64| RoundSpread::of(self.limits.iter().map(of)).median;
        let memory = figure.least_bytes.map(|bytes| bytes as f64 / median(|limits| limits.bytes_per_second));
        let numbers =
            figure.least_operations.map(|count| count / median(|limits| limits.operations_per_second));
        let limits = [memory.zip(Some("memory")), numbers.zip(Some("arithmetic"))];
        let (limit, name) = limits.into_iter().flatten().max_by(|a, b| a.0.total_cmp(&b.0))?;
        (limit > 0.0).then(|| (figure.seconds().median / limit, name))
    }

    /// The input of a figure.
    pub fn input(&self, figure: &Figure) -> Option<&InputFact> {
        self.inputs.iter().find(|input| input.name == figure.input)
    }
}

impl Figure {
    /// What tells it from all others of a result.
    pub fn id(&self) -> String {
        format!("{}: {}: {}", self.suite, self.input, self.job)
    }

    fn is_sound(&self) -> bool {
        let positive = |seconds: f64| seconds.is_finite() && seconds > 0.0;
        let sound = |r: &Round| positive(r.seconds) && positive(r.floor_seconds) && r.cpu_seconds >= 0.0;
        self.rounds.is_empty() == self.failed.is_some() && self.rounds.iter().all(sound)
    }

    /// Seconds over the rounds.
    pub fn seconds(&self) -> RoundSpread {
        RoundSpread::of(self.rounds.iter().map(|round| round.seconds))
    }

    /// Times in read floors over the rounds.
    pub fn floors(&self) -> RoundSpread {
        RoundSpread::of(self.rounds.iter().map(|round| round.seconds / round.floor_seconds))
    }

    /// Processor time over the rounds.
    pub fn cpu_seconds(&self) -> RoundSpread {
        RoundSpread::of(self.rounds.iter().map(|round| round.cpu_seconds))
    }

    /// The most anonymous memory of any round.
    pub fn anonymous_bytes(&self) -> u64 {
        self.rounds.iter().map(|round| round.anonymous_bytes).max().unwrap_or(0)
    }

    /// A number that jobs vary.
    pub fn at(&self, name: &str) -> Option<f64> {
        self.at.get(name).and_then(Value::as_f64)
    }
}

/// Median and range of the rounds, and how far they lie from the median.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct RoundSpread {
    pub median: f64,
    pub min: f64,
    pub max: f64,
    /// Median of the absolute deviations from the median.
    pub deviation: f64,
    pub rounds: usize,
}

impl RoundSpread {
    /// Of at least one value.
    pub fn of(values: impl Iterator<Item = f64>) -> RoundSpread {
        let mut values: Vec<f64> = values.collect();
        let (median, min, max) = (median(&mut values), values[0], values[values.len() - 1]);
        let mut off: Vec<f64> = values.iter().map(|value| (value - median).abs()).collect();
        RoundSpread { median, min, max, deviation: self::median(&mut off), rounds: values.len() }
    }

    /// In another unit.
    pub fn scaled(self, by: f64) -> RoundSpread {
        let RoundSpread { median, min, max, deviation, rounds } = self;
        RoundSpread { median: median * by, min: min * by, max: max * by, deviation: deviation * by, rounds }
    }
}

/// The median of at least one value, which are sorted.
fn median(values: &mut [f64]) -> f64 {
    values.sort_by(f64::total_cmp);
    let middle = values.len() / 2;
    if values.len() % 2 == 1 { values[middle] } else { 0.5 * (values[middle - 1] + values[middle]) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn medians_and_deviations() {
        let spread = RoundSpread::of([5.0, 1.0, 2.0].into_iter());
        assert_eq!((spread.median, spread.min, spread.max, spread.deviation), (2.0, 1.0, 5.0, 1.0));
        let spread = RoundSpread::of([4.0, 1.0, 2.0, 10.0].into_iter());
        assert_eq!((spread.median, spread.deviation), (3.0, 1.5));
        assert_eq!(RoundSpread::of([7.0].into_iter()).deviation, 0.0);
    }
}
