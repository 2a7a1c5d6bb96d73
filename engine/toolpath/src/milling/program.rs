//! A program line by line: where subprograms lead, and where it ends.
//!
//! Two forms are followed. A file may hold several programs, each behind its O number: M98 P… L… calls one, and M99 returns.
//! And LinuxCNC has `o100 sub`, `o100 endsub`, `o100 return` and `o100 call`. Neither takes variables: loops and conditions
//! are refused.

use super::apt;
use super::moves::{Moves, Program, ProgramOptions};
use super::reader::{After, Reader};
use crate::error::{Error, Result};
use crate::toolpath::gcode::words::Words;
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

/// Subprograms within each other.
const DEPTH_MAX: usize = 32;
/// Lines of subprograms that are carried out, each time counted.
const LINES_MAX: u64 = 1 << 23;
/// What to do about what only the machine's control can compute.
const WITHOUT_MACROS: &str = "post-process without macros and variables";

/// Reads a program: G-code, or a CL file of APT by its name or its words.
///
/// # Errors
/// [`Error::Io`] if it cannot be read; [`Error::Input`] with the line and the word that cannot be followed.
pub fn read(path: &Path, options: &ProgramOptions) -> Result<Program> {
    let bytes = std::fs::read(path).map_err(Error::io(path, "read"))?;
    let lines = lines_of(&bytes);
    let out = Moves::new(path, options);
    if apt::is_apt(path, &lines) {
        return apt::read(out, &lines);
    }
    let mut flow =
        Flow { reader: Reader::new(out), blocks: Blocks::of(&lines), lines: &lines, calls: Vec::new() };
    flow.run()?;
    flow.reader.finished()
}

/// The lines of a file, without the mark of Unicode in front and spaces around each. Where none ends by a line feed, carriage
/// returns end them.
fn lines_of(bytes: &[u8]) -> Vec<&[u8]> {
    let bytes = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
    let end = if bytes.contains(&b'\n') { b'\n' } else { b'\r' };
    bytes.split(|byte| *byte == end).map(<[u8]>::trim_ascii).collect()
}

/// A word O at the begin of a line.
struct Block<'l> {
    /// Its number without zeros in front, or its name in angle brackets, in small letters.
    name: String,
    /// What follows, in small letters, without comments; empty behind the number of a program.
    keyword: String,
    /// What follows that.
    rest: &'l [u8],
}

impl<'l> Block<'l> {
    fn of(line: &'l [u8]) -> Option<Block<'l>> {
        let after = line.strip_prefix(b"/").unwrap_or(line);
        let after = after.strip_prefix(b"O").or_else(|| after.strip_prefix(b"o"))?.trim_ascii_start();
        let length = match after.first()? {
            b'<' => after.iter().position(|byte| *byte == b'>')? + 1,
            b'0'..=b'9' => after.iter().take_while(|byte| byte.is_ascii_digit()).count(),
            _ => return None,
        };
        let (name, rest) = after.split_at(length);
        let name = String::from_utf8_lossy(name).to_lowercase();
        let name = match name.trim_start_matches('0') {
            "" => "0".to_owned(),
            name => name.to_owned(),
        };
        let rest = rest.trim_ascii_start();
        let letters = rest.iter().take_while(|byte| byte.is_ascii_alphabetic()).count();
        // One letter alone is a word of the line, as the G of O100 G21.
        let (keyword, rest) = rest.split_at(if letters > 1 { letters } else { 0 });
        Some(Block { name, keyword: String::from_utf8_lossy(keyword).to_lowercase(), rest })
    }
}

/// Where programs and subprograms begin.
struct Blocks {
    /// By name the lines, from 0, of O numbers and of `sub`.
    begins: BTreeMap<String, Vec<usize>>,
    /// O numbers alone.
    programs: BTreeMap<usize, String>,
    /// What M98 calls.
    called: BTreeSet<String>,
}

impl Blocks {
    fn of(lines: &[&[u8]]) -> Blocks {
        let mut blocks =
            Blocks { begins: BTreeMap::new(), programs: BTreeMap::new(), called: BTreeSet::new() };
        for (at, line) in lines.iter().enumerate() {
            if let Some(block) = Block::of(line) {
                if block.keyword.is_empty() {
                    blocks.programs.insert(at, block.name.clone());
                }
                if matches!(block.keyword.as_str(), "" | "sub") {
                    blocks.begins.entry(block.name).or_default().push(at);
                }
            }
        }
        for line in lines {
            if let Some(number) = called(line) {
                blocks.called.insert(blocks.number(number).0);
            }
        }
        blocks
    }

    /// The name that a P stands for, and how often: with more than four digits the first ones tell that.
    fn number(&self, p: u64) -> (String, u64) {
        let whole = p.to_string();
        if p <= 9999 || self.begins.contains_key(&whole) {
            (whole, 1)
        } else {
            ((p % 10_000).to_string(), p / 10_000)
        }
    }
}

/// The P of M98 in a line.
fn called(line: &[u8]) -> Option<u64> {
    let (mut is_call, mut number) = (false, None);
    let mut words = Words::new(line);
    while let Some(Ok(word)) = words.next() {
        match (word.letter, word.value) {
            (b'M', Some(code)) => is_call = is_call || code == 98.0,
            (b'P', Some(p)) if p >= 0.0 => number = Some(p as u64),
            _ => {}
        }
    }
    number.filter(|_| is_call)
}

/// A call that is being carried out.
struct Call {
    name: String,
    /// Line of its begin, and the one to go on with after it.
    begin: usize,
    back: usize,
    /// How often it is still to be carried out, this time included.
    left: u64,
}

struct Flow<'a, 'l> {
    reader: Reader<'a>,
    blocks: Blocks,
    lines: &'l [&'l [u8]],
    calls: Vec<Call>,
}

impl Flow<'_, '_> {
    fn run(&mut self) -> Result<()> {
        let mut at = 0;
        let mut count = 0;
        while at < self.lines.len() {
            count += u64::from(!self.calls.is_empty());
            self.reader.out.line = at as u64 + 1;
            if count > LINES_MAX {
                return Err(self.reader.out.fault(b"M98", "repeats more lines than can be followed"));
            }
            let line = self.lines[at];
            let next = match Block::of(line) {
                Some(block) if !block.keyword.is_empty() => Some(self.block(at, &block)?),
                block => {
                    if let Some(block) = block {
                        self.enter(at, &block)?;
                    }
                    self.line(at, line)?
                }
            };
            let Some(next) = next else { return Ok(()) };
            at = next;
        }
        match self.calls.last() {
            Some(call) => Err(self.reader.out.fault(
                format!("O{}", call.name).as_bytes(),
                "is a subprogram without an end: M99, or endsub, is missing",
            )),
            None => Ok(()),
        }
    }

    /// A line that is no block's begin or end: the line to go on with, or `None` at the program's end.
    fn line(&mut self, at: usize, line: &[u8]) -> Result<Option<usize>> {
        match self.reader.read_line(line)? {
            After::Next => Ok(Some(at + 1)),
            After::End => Ok(None),
            After::Return => match self.calls.is_empty() {
                false => Ok(Some(self.end())),
                // A main program that begins anew for the next part.
                true => self.main_end(at).map(|()| None),
            },
            After::Call { number, repeats } => {
                let (name, times) = self.blocks.number(number);
                Ok(Some(self.call(at, name, repeats.unwrap_or(times), b"M98")?))
            }
        }
    }

    /// M99 outside of subprograms ends the program if what follows are the subprograms.
    fn main_end(&self, at: usize) -> Result<()> {
        match self.blocks.programs.range(at..).find(|(_, name)| !self.blocks.called.contains(*name)) {
            Some((_, name)) => Err(self.reader.out.refused(
                b"M99",
                &format!("ends what is called by nothing, and O{name} follows"),
                "put the main program first, and its subprograms behind it",
            )),
            None => Ok(()),
        }
    }

    /// An O number at which the program arrives line by line.
    fn enter(&self, at: usize, block: &Block<'_>) -> Result<()> {
        let word = format!("O{}", block.name);
        match self.calls.last() {
            Some(call) if call.begin == at => Ok(()),
            Some(call) => {
                let what = format!("begins before M99 has ended the subprogram O{}", call.name);
                Err(self.reader.out.fault(word.as_bytes(), &what))
            }
            None if at > 0 && self.blocks.called.contains(&block.name) => Err(self.reader.out.refused(
                word.as_bytes(),
                "is a subprogram, and the program before it has no end",
                "put the main program first, and end it by M30",
            )),
            None => Ok(()),
        }
    }

    /// A block of LinuxCNC: the line to go on with.
    fn block(&mut self, at: usize, block: &Block<'_>) -> Result<usize> {
        let word = format!("O{} {}", block.name, block.keyword);
        let out = &self.reader.out;
        match block.keyword.as_str() {
            "sub" if self.calls.last().is_some_and(|call| call.begin == at) => Ok(at + 1),
            "sub" => {
                let ends = |line: &&[u8]| {
                    Block::of(line).is_some_and(|other| other.keyword == "endsub" && other.name == block.name)
                };
                let end = self.lines[at..].iter().position(ends);
                let length = end.ok_or_else(|| out.fault(word.as_bytes(), "has no endsub"))?;
                Ok(at + length + 1)
            }
            "endsub" | "return" => match self.calls.last() {
                Some(call) if call.name == block.name => Ok(self.end()),
                _ => Err(out.fault(word.as_bytes(), "ends a subprogram that has not begun")),
            },
            "call" => {
                if Words::new(block.rest).rest().first().is_some_and(|byte| *byte != b';') {
                    return Err(out.refused(
                        word.as_bytes(),
                        "passes values, which are not read",
                        WITHOUT_MACROS,
                    ));
                }
                self.call(at, block.name.clone(), 1, word.as_bytes())
            }
            _ => Err(out.refused(
                word.as_bytes(),
                "is a loop or a condition, which is not read",
                WITHOUT_MACROS,
            )),
        }
    }

    fn call(&mut self, at: usize, name: String, times: u64, word: &[u8]) -> Result<usize> {
        let out = &self.reader.out;
        let begin = match self.blocks.begins.get(&name).map(Vec::as_slice) {
            Some([begin]) => *begin,
            Some(_) => return Err(out.fault(word, &format!("calls O{name}, which the file has twice"))),
            None => {
                let what = format!("calls O{name}, which the file has not");
                return Err(out.refused(word, &what, "put it into the file, behind the program's end"));
            }
        };
        let is_running = |call: &Call| call.name == name;
        let is_main =
            self.blocks.programs.keys().next() == Some(&begin) && begin <= at && self.calls.is_empty();
        if self.calls.iter().any(is_running)
            || (is_main && !self.blocks.programs.range(begin + 1..=at).any(|_| true))
        {
            return Err(out.fault(word, &format!("calls O{name} within itself, which has no end")));
        }
        if self.calls.len() == DEPTH_MAX {
            return Err(out.fault(word, "calls more subprograms within each other than can be followed"));
        }
        if times == 0 {
            return Ok(at + 1);
        }
        self.calls.push(Call { name, begin, back: at + 1, left: times });
        Ok(begin)
    }

    /// The end of the innermost call: the line to go on with.
    fn end(&mut self) -> usize {
        let Some(call) = self.calls.last_mut() else { return self.lines.len() };
        call.left -= 1;
        if call.left > 0 {
            return call.begin;
        }
        let back = call.back;
        self.calls.pop();
        back
    }
}
