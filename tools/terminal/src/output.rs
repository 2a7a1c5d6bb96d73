//! Results on standard output, and files that get their name only when complete.

use crate::failure::Failure;
use anyhow::{Context, anyhow};
use serde::Serialize;
use std::fs;
use std::io::{self, BufWriter, StdoutLock, Write};
use std::path::{Path, PathBuf};

/// Prints text, a line feed added.
pub fn print(text: &str) -> Result<(), Failure> {
    let mut out = io::stdout().lock();
    writeln!(out, "{}", text.trim_end()).and_then(|()| out.flush()).map_err(Failure::stdout)
}

/// Prints one JSON object, as it is made: it may be larger than memory.
pub fn print_json(value: &impl Serialize) -> Result<(), Failure> {
    let mut out = BufWriter::new(io::stdout().lock());
    match serde_json::to_writer_pretty(&mut out, value) {
        Err(error) if error.is_io() => return Err(Failure::stdout(error.into())),
        written => written.context("cannot write JSON")?,
    }
    writeln!(out).and_then(|()| out.flush()).map_err(Failure::stdout)
}

/// A line on standard error that does not end the program.
pub fn warn(message: &str) {
    eprintln!("brickfield: warning: {}", one_line(message));
}

/// A line on standard error before the work is done, which asks for nothing.
pub fn note(message: &str) {
    eprintln!("brickfield: note: {}", one_line(message));
}

/// File names may hold line breaks; messages must not.
pub fn one_line(message: &str) -> String {
    message.replace(['\n', '\r'], " ")
}

/// A file's name as it stands in a line.
pub fn in_line(path: &Path) -> String {
    one_line(&path.display().to_string())
}

/// Standard output for many lines.
pub struct Lines(BufWriter<StdoutLock<'static>>);

impl Lines {
    /// Takes standard output until it is dropped.
    pub fn to_stdout() -> Lines {
        Lines(BufWriter::with_capacity(1 << 16, io::stdout().lock()))
    }

    /// One line.
    pub fn line(&mut self, line: std::fmt::Arguments<'_>) -> Result<(), Failure> {
        self.0.write_fmt(line).and_then(|()| self.0.write_all(b"\n")).map_err(Failure::stdout)
    }

    /// Hands on what is buffered.
    pub fn flush(&mut self) -> Result<(), Failure> {
        self.0.flush().map_err(Failure::stdout)
    }
}

/// Refuses outputs that would overwrite an input, whatever the two paths look like.
pub fn require_distinct(outputs: &[&Path], inputs: &[&Path]) -> Result<(), Failure> {
    for (number, output) in outputs.iter().enumerate() {
        for other in inputs.iter().chain(&outputs[..number]) {
            let part = brickfield_engine::part::part_path(output);
            let taken = [identity(output), identity(&part)];
            if taken.iter().flatten().any(|name| Some(name) == identity(other).as_ref()) {
                let what = "this output would overwrite another file of this command";
                return Err(anyhow!("{}: {what}; choose another name", output.display()).into());
            }
        }
    }
    Ok(())
}

/// The path with links resolved, as far as it exists.
fn identity(path: &Path) -> Option<PathBuf> {
    let parent = path.parent().filter(|parent| !parent.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let unborn = || Some(fs::canonicalize(parent).ok()?.join(path.file_name()?));
    fs::canonicalize(path).ok().or_else(unborn)
}
