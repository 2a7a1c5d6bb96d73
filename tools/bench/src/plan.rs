//! What suites consist of: jobs, each a few commands of this program, and the figures that they give.

use crate::child::{self, ProcessRun};
use crate::inputs::Cache;
use crate::result::{Figure, InputFact, Limits};
use anyhow::Context;
use brickfield_bench_data::inputs::{Recipe, Spec};
use brickfield_engine::Progress;
use brickfield_terminal::failure::Failure;
use serde_json::{Map, Value};
use std::ffi::OsString;
use std::fs::{self, File};
use std::io::{BufWriter, ErrorKind};
use std::path::{Path, PathBuf};
use std::time::Instant;

/// A command of this program as it is typed; its files lie in the suite's folder.
pub type CommandLine = Vec<OsString>;

/// Words of a command.
#[macro_export]
macro_rules! line {
    ($($word:expr),* $(,)?) => { vec![$(::std::ffi::OsString::from($word)),*] };
}

/// Where jobs write; emptied before each.
pub const OUT: &str = "out";

/// One thing that is measured.
pub struct Job {
    /// What is read; its floor stands beside the figures.
    pub input: &'static Spec,
    /// Run one after the other, their times added up.
    pub lines: Vec<CommandLine>,
    /// The same for less of the work: then figures are extrapolated.
    pub fewer: Option<Vec<CommandLine>>,
    /// Files that have to be read whole; none if nobody knows how much of them.
    pub reads: Option<Vec<PathBuf>>,
    /// What is known of the result beforehand.
    pub known: Map<String, Value>,
    /// What comes of it, and how many times the difference between `lines` and `fewer` each is.
    pub figures: Vec<(Figure, f64)>,
}

/// What the suites have to work with.
pub struct Bench<'a> {
    pub cache: &'a Cache,
    /// Folder of this suite.
    pub folder: PathBuf,
    pub threads: usize,
    pub quick: bool,
    pub full: bool,
    pub progress: &'a dyn Progress,
    /// Of all inputs that were asked for so far.
    pub inputs: Vec<InputFact>,
    /// What making and checking them took.
    pub input_seconds: f64,
    /// Of each round.
    pub limits: Vec<Limits>,
}

impl Bench<'_> {
    /// The file of an input, which is made if need be.
    pub fn input(&mut self, spec: &'static Spec) -> Result<PathBuf, Failure> {
        if self.known(spec).is_none() {
            let begun = Instant::now();
            let fact = self.cache.ensure(spec, self.progress)?;
            self.inputs.push(fact);
            self.input_seconds += begun.elapsed().as_secs_f64();
        }
        Ok(self.cache.path(spec))
    }

    fn known(&self, spec: &Spec) -> Option<&InputFact> {
        self.inputs.iter().find(|fact| fact.name == spec.name)
    }

    /// Triangles of an input that was made.
    pub fn triangles(&self, spec: &Spec) -> u64 {
        self.known(spec).and_then(|fact| fact.triangles).unwrap_or(0)
    }

    /// A file of random points beside the suite's other files.
    pub fn points(&self, count: u64) -> Result<OsString, Failure> {
        let name = format!("points-{count}.csv");
        let spec = Spec { name: "", recipe: Recipe::Points(count), hash: 0 };
        let written = File::create(self.folder.join(&name))
            .and_then(|file| spec.write(None, BufWriter::with_capacity(1 << 20, file)));
        written.with_context(|| format!("{name}: cannot be written"))?;
        Ok(name.into())
    }

    /// Empties the folder of outputs: to replace a file would take the time that freeing its pages takes.
    pub fn empty_out(&self) -> Result<(), Failure> {
        let out = self.folder.join(OUT);
        let emptied = fs::remove_dir_all(&out).or_else(|error| match error.kind() {
            ErrorKind::NotFound => Ok(()),
            _ => Err(error),
        });
        let told = || format!("{}: cannot be emptied", out.display());
        Ok(emptied.and_then(|()| fs::create_dir(&out)).with_context(told)?)
    }

    /// Bytes of these files and of all that a job has left.
    pub fn bytes_moved(&self, reads: &[PathBuf]) -> std::io::Result<u64> {
        let mut bytes = 0;
        for file in reads {
            bytes += fs::metadata(self.folder.join(file))?.len();
        }
        for entry in fs::read_dir(self.folder.join(OUT))? {
            bytes += entry?.metadata()?.len();
        }
        Ok(bytes)
    }

    /// Runs a command that prepares something, and gives what it told as JSON.
    pub fn prepare(&self, line: CommandLine) -> Result<Value, Failure> {
        self.progress.phase("preparing", None, "");
        let ran = child::run_measured(&line, &self.folder)?;
        Ok(serde_json::from_slice(&ran.printed).unwrap_or(Value::Null))
    }

    /// `build` with the threads of this run.
    pub fn build(&self, input: &Path, output: &str, more: &[&str]) -> CommandLine {
        let mut line = line!["build", input, "-o", output];
        line.extend(more.iter().map(OsString::from));
        if !more.contains(&"--threads") {
            line.extend(self.threads());
        }
        line.extend(line!["--quiet", "--json"]);
        line
    }

    /// `--threads N` of this run.
    pub fn threads(&self) -> CommandLine {
        line!["--threads", self.threads.to_string()]
    }
}

impl Job {
    /// A job with one figure.
    pub fn new(
        suite: &str,
        input: &'static Spec,
        name: &str,
        at: &[(&str, f64)],
        lines: Vec<CommandLine>,
    ) -> Job {
        let figure = figure(suite, input, name, at);
        Job { input, lines, fewer: None, reads: None, known: Map::new(), figures: vec![(figure, 1.0)] }
    }

    /// With the files that it has to read whole; what it leaves is known when it has run.
    pub fn reading(mut self, files: &[impl AsRef<Path>]) -> Job {
        self.reads = Some(files.iter().map(|file| file.as_ref().to_owned()).collect());
        self
    }

    /// For the plot of what `name` varies.
    pub fn in_series(mut self, name: &str) -> Job {
        self.figures.iter_mut().for_each(|(figure, _)| figure.series = Some(name.to_owned()));
        self
    }
}

/// A figure without rounds.
pub fn figure(suite: &str, input: &Spec, job: &str, at: &[(&str, f64)]) -> Figure {
    Figure {
        suite: suite.to_owned(),
        input: input.name.to_owned(),
        job: job.to_owned(),
        series: None,
        at: at.iter().map(|&(name, value)| (name.to_owned(), Value::from(value))).collect(),
        extrapolated: false,
        least_bytes: None,
        least_operations: None,
        failed: None,
        rounds: Vec::new(),
        facts: Map::new(),
    }
}

/// Numbers that commands tell of their results and that no clock or machine decides.
const FACTS: [&str; 10] = [
    "depth",
    "nodes",
    "leaves",
    "file_bytes",
    "open_edges",
    "vertices",
    "triangles",
    "records",
    "payload_bytes",
    "damaged",
];

/// What a command told of its result.
pub fn facts_of(ran: &ProcessRun) -> Map<String, Value> {
    let told: Value = serde_json::from_slice(&ran.printed).unwrap_or(Value::Null);
    let known = |&name: &&str| Some((name.to_owned(), told.get(name)?.clone()));
    FACTS.iter().filter_map(known).collect()
}
