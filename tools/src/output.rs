//! Results on standard output, and files that get their name only when complete.

use crate::failure::Failure;
use anyhow::{Context, anyhow};
use serde::Serialize;
use std::ffi::OsString;
use std::fs::{self, File};
use std::io::{self, BufWriter, StdoutLock, Write};
use std::path::{Path, PathBuf};

/// Prints text, a line feed added.
pub fn print(text: &str) -> Result<(), Failure> {
    let mut out = io::stdout().lock();
    writeln!(out, "{}", text.trim_end()).and_then(|()| out.flush()).map_err(Failure::stdout)
}

/// Prints one JSON object.
pub fn print_json(value: &impl Serialize) -> Result<(), Failure> {
    print(&serde_json::to_string_pretty(value).context("cannot write JSON")?)
}

/// A line on standard error that does not end the program.
pub fn warn(message: &str) {
    eprintln!("brickfield: warning: {message}");
}

/// Standard output for many lines.
pub struct Lines(BufWriter<StdoutLock<'static>>);

impl Lines {
    /// Takes standard output.
    pub fn new() -> Lines {
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
            let same = identity(output);
            if same.is_some() && same == identity(other) {
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

/// A file named `<name>.part` until it is finished; removed if it never is.
pub struct PartFile {
    path: PathBuf,
    part: PathBuf,
    file: File,
    finished: bool,
}

impl PartFile {
    /// Creates the `.part` file.
    pub fn create(path: &Path) -> Result<PartFile, Failure> {
        if path.is_dir() {
            return Err(anyhow!("{}: this is a directory; give the file a name in it", path.display()).into());
        }
        let mut part = OsString::from(path);
        part.push(".part");
        let part = PathBuf::from(part);
        let file = File::create(&part).with_context(|| format!("{}: cannot create", path.display()))?;
        Ok(PartFile { path: path.to_owned(), part, file, finished: false })
    }

    /// The final name.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// The open file.
    pub fn file(&self) -> &File {
        &self.file
    }

    /// Gives the file its name.
    pub fn finish(mut self) -> Result<(), Failure> {
        fs::rename(&self.part, &self.path)
            .with_context(|| format!("{}: cannot rename to", self.path.display()))?;
        self.finished = true;
        Ok(())
    }
}

impl Drop for PartFile {
    fn drop(&mut self) {
        if !self.finished {
            // The error that led here is the one to report.
            let _ = fs::remove_file(&self.part);
        }
    }
}
