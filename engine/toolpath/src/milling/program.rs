//! A program line by line: where subprograms lead, and where it ends.
//!
//! Three forms are followed. A file may hold several programs, each behind its O number: M98 P… L… calls one, and M99 returns.
//! M97 P… L… calls what begins at the block with this number, N…, and M99 returns from there, too. And LinuxCNC has `o100 sub`,
//! `o100 endsub`, `o100 return` and `o100 call`; `word_blocks` has its loops and conditions, and `macros` those of FANUC.

use super::apt;
use super::loops::Jumps;
use super::moves::{Moves, Program, ProgramOptions};
use super::reader::Reader;
use super::statement::{cleaned, is_macro, may_be_macro};
use super::variables::{LocalVariables, MacroVariables};
use crate::error::{Error, Result};
use crate::toolpath::gcode::words::Words;
use std::collections::{BTreeMap, BTreeSet};
use std::io::Read;
use std::path::Path;

/// Subprograms within each other.
const DEPTH_MAX: usize = 32;
/// Lines of subprograms, and after a jump back, that are carried out, each time counted. Tests wait for fewer.
const LINES_MAX: u64 = if cfg!(test) { 1 << 16 } else { 1 << 23 };
/// Most moves of a program that repeats lines.
const REPEATED_MOVES_MAX: usize = 1 << 24;

/// Reads a program: G-code, or a CL file of APT by its name or its words.
///
/// # Errors
/// [`Error::Io`] if it cannot be read; [`Error::Input`] with the line and the word that cannot be followed.
pub fn read(path: &Path, options: &ProgramOptions) -> Result<Program> {
    let bytes = bytes_of(path, options.memory)?;
    let lines = lines_of(&bytes);
    let out = Moves::new(path, options);
    if apt::is_apt(path, &lines) {
        return apt::read(out, &lines);
    }
    let blocks = ProgramBlocks::of(&lines);
    let jumps = Jumps::of(&lines, blocks.programs.keys().copied());
    let mut flow = Flow {
        reader: Reader::new(out),
        blocks,
        lines: &lines,
        calls: Vec::new(),
        jumps,
        variables: MacroVariables::new(),
        repeats: false,
    };
    flow.run()?;
    flow.reader.finished()
}

/// The bytes of a file, which are in memory with the list of their lines.
fn bytes_of(path: &Path, memory: u64) -> Result<Vec<u8>> {
    let failed = |error| Error::io(path, "read")(error);
    let file = std::fs::File::open(path).map_err(failed)?;
    let mut bytes = Vec::new();
    file.take(memory.saturating_add(1)).read_to_end(&mut bytes).map_err(failed)?;
    if bytes.len() as u64 > memory {
        let what = format!("is larger than {} MiB", memory >> 20);
        let remedy =
            "allow more `memory`, or give the program in parts, each for the store that the one before made";
        return Err(Error::input(path, "end", what, remedy));
    }
    Ok(bytes)
}

/// The lines of a file, without the mark of Unicode in front and spaces around each. Where none ends by a line feed, carriage
/// returns end them.
fn lines_of(bytes: &[u8]) -> Vec<&[u8]> {
    let bytes = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
    let end = if bytes.contains(&b'\n') { b'\n' } else { b'\r' };
    bytes.split(|byte| *byte == end).map(<[u8]>::trim_ascii).collect()
}

/// A word O at the begin of a line.
pub(super) struct WordBlock<'l> {
    /// Its number without zeros in front, or its name in angle brackets, in small letters.
    pub name: String,
    /// What follows, in small letters, without comments; empty behind the number of a program.
    pub keyword: String,
    /// What follows that.
    pub rest: &'l [u8],
}

impl<'l> WordBlock<'l> {
    pub fn of(line: &'l [u8]) -> Option<WordBlock<'l>> {
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
        Some(WordBlock { name, keyword: String::from_utf8_lossy(keyword).to_lowercase(), rest })
    }
}

impl WordBlock<'_> {
    /// As messages show it.
    pub fn word(&self) -> String {
        format!("O{} {}", self.name, self.keyword)
    }
}

/// Where programs and subprograms begin.
pub(super) struct ProgramBlocks {
    /// By name the lines, from 0, of O numbers and of `sub`.
    begins: BTreeMap<String, Vec<usize>>,
    /// O numbers alone.
    pub programs: BTreeMap<usize, String>,
    /// By name the lines of loops and conditions of LinuxCNC, each with its word.
    pub worded: BTreeMap<String, Vec<(usize, String)>>,
    /// What M98 calls.
    called: BTreeSet<String>,
    /// By the numbers that M97 calls the lines that have them.
    numbered: BTreeMap<u64, Vec<usize>>,
}

impl ProgramBlocks {
    fn of(lines: &[&[u8]]) -> ProgramBlocks {
        let mut blocks = ProgramBlocks {
            begins: BTreeMap::new(),
            programs: BTreeMap::new(),
            worded: BTreeMap::new(),
            called: BTreeSet::new(),
            numbered: BTreeMap::new(),
        };
        for (at, line) in lines.iter().enumerate() {
            if let Some(block) = WordBlock::of(line) {
                if block.keyword.is_empty() {
                    blocks.programs.insert(at, block.name.clone());
                }
                if !matches!(block.keyword.as_str(), "" | "sub" | "call") {
                    let worded = blocks.worded.entry(block.name.clone()).or_default();
                    worded.push((at, block.keyword.clone()));
                }
                if matches!(block.keyword.as_str(), "" | "sub") {
                    blocks.begins.entry(block.name).or_default().push(at);
                }
            }
        }
        for line in lines {
            match called(line) {
                Some((98, number)) => {
                    blocks.called.insert(blocks.number(number).0);
                }
                Some((_, number)) => {
                    blocks.numbered.entry(number).or_default();
                }
                None => {}
            }
        }
        for (at, line) in lines.iter().enumerate() {
            if let Some(lines) = block_number(line).and_then(|number| blocks.numbered.get_mut(&number)) {
                lines.push(at);
            }
        }
        blocks
    }

    /// The name that a P stands for, and how often: with more than four digits the first ones tell that.
    pub fn number(&self, p: u64) -> (String, u64) {
        let whole = p.to_string();
        if p <= 9999 || self.begins.contains_key(&whole) {
            (whole, 1)
        } else {
            ((p % 10_000).to_string(), p / 10_000)
        }
    }
}

/// M97, M98 or G65 in a line, with its P.
fn called(line: &[u8]) -> Option<(u64, u64)> {
    let (mut call, mut number) = (None, None);
    let mut words = Words::new(line);
    while let Some(Ok(word)) = words.next() {
        match (word.letter, word.value) {
            (b'M', Some(code)) if code == 97.0 || code == 98.0 => call = Some(code as u64),
            // A macro call is one of a subprogram.
            (b'G', Some(65.0)) => call = Some(98),
            (b'P', Some(p)) if p >= 0.0 => number = Some(p as u64),
            _ => {}
        }
    }
    Some((call?, number?))
}

/// The number of a block, which stands in front.
fn block_number(line: &[u8]) -> Option<u64> {
    let line = line.strip_prefix(b"/").unwrap_or(line);
    match Words::new(line).next() {
        Some(Ok(word)) if word.letter == b'N' => word.value.filter(|n| *n >= 0.0).map(|n| n as u64),
        _ => None,
    }
}

/// A call that is being carried out.
pub(super) struct Call {
    /// With the letter in front: O for subprograms, N for blocks.
    name: String,
    /// Line of its begin, and the one to go on with after it.
    begin: usize,
    back: usize,
    /// How often it is still to be carried out, this time included.
    left: u64,
    /// Whether it has variables of its own.
    pub has_locals: bool,
}

pub(super) struct Flow<'a, 'l> {
    pub reader: Reader<'a>,
    pub blocks: ProgramBlocks,
    pub lines: &'l [&'l [u8]],
    pub calls: Vec<Call>,
    pub jumps: Jumps,
    pub variables: MacroVariables,
    /// Whether a line has led back to one before it.
    pub repeats: bool,
}

impl Flow<'_, '_> {
    fn run(&mut self) -> Result<()> {
        let mut at = 0;
        let mut count = 0;
        while at < self.lines.len() {
            count += u64::from(self.repeats || !self.calls.is_empty());
            self.reader.out.line = at as u64 + 1;
            let is_long = count > 0 && self.reader.out.program.moves.len() > REPEATED_MOVES_MAX;
            if count > LINES_MAX || is_long {
                if !self.repeats {
                    return Err(self.reader.out.fault(b"M98", "repeats more lines than can be followed"));
                }
                let shown = &self.lines[at][..self.lines[at].len().min(60)];
                let what = "stands in what repeats more lines, or moves, than can be followed";
                return Err(self.reader.out.fault(shown, what));
            }
            let line = self.lines[at];
            let next = match WordBlock::of(line) {
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
            Some(call) => Err(self
                .reader
                .out
                .fault(call.name.as_bytes(), "is a subprogram without an end: M99, or endsub, is missing")),
            None => Ok(()),
        }
    }

    /// A line that is no block's begin or end: the line to go on with, or `None` at the program's end.
    fn line(&mut self, at: usize, line: &[u8]) -> Result<Option<usize>> {
        if may_be_macro(line) {
            let clean = cleaned(line);
            if is_macro(&clean) {
                return self.macro_line(at, line, &clean);
            }
        }
        if let Some(next) = self.macro_call(at, line)? {
            self.reader.read_comments(line);
            return Ok(Some(next));
        }
        let after = self.reader.read_line(line)?;
        self.go_on(at, after)
    }

    /// M99 outside of subprograms ends the program if what follows are the subprograms.
    pub(super) fn main_end(&self, at: usize) -> Result<()> {
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
    fn enter(&self, at: usize, block: &WordBlock<'_>) -> Result<()> {
        let word = format!("O{}", block.name);
        match self.calls.last() {
            Some(call) if call.begin == at => Ok(()),
            Some(call) => {
                let what = format!("begins before M99 has ended the subprogram {}", call.name);
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
    fn block(&mut self, at: usize, block: &WordBlock<'_>) -> Result<usize> {
        let word = block.word();
        let out = &self.reader.out;
        match block.keyword.as_str() {
            "sub" if self.calls.last().is_some_and(|call| call.begin == at) => Ok(at + 1),
            "sub" => {
                let ends = |line: &&[u8]| {
                    WordBlock::of(line)
                        .is_some_and(|other| other.keyword == "endsub" && other.name == block.name)
                };
                let end = self.lines[at..].iter().position(ends);
                let length = end.ok_or_else(|| out.fault(word.as_bytes(), "has no endsub"))?;
                Ok(at + length + 1)
            }
            "endsub" | "return" => match self.calls.last() {
                Some(call) if call.name == format!("O{}", block.name) => Ok(self.end()),
                _ => Err(out.fault(word.as_bytes(), "ends a subprogram that has not begun")),
            },
            "call" => {
                let locals = self.passed(block.rest, word.as_bytes())?;
                self.call(at, block.name.clone(), 1, word.as_bytes(), Some(locals))
            }
            _ => self.word_block(at, block),
        }
    }

    /// A subprogram by its name, with variables of its own or those of what calls it.
    pub(super) fn call(
        &mut self,
        at: usize,
        name: String,
        times: u64,
        word: &[u8],
        locals: Option<LocalVariables>,
    ) -> Result<usize> {
        let out = &self.reader.out;
        let begin = match self.blocks.begins.get(&name).map(Vec::as_slice) {
            Some([begin]) => *begin,
            Some(_) => return Err(out.fault(word, &format!("calls O{name}, which the file has twice"))),
            None => {
                let what = format!("calls O{name}, which the file has not");
                return Err(out.refused(word, &what, "put it into the file, behind the program's end"));
            }
        };
        let is_running = |call: &Call| call.name.strip_prefix('O') == Some(name.as_str());
        let is_main =
            self.blocks.programs.keys().next() == Some(&begin) && begin <= at && self.calls.is_empty();
        if self.calls.iter().any(is_running)
            || (is_main && !self.blocks.programs.range(begin + 1..=at).any(|_| true))
        {
            return Err(out.fault(word, &format!("calls O{name} within itself, which has no end")));
        }
        let has_locals = locals.is_some();
        let call = Call { name: format!("O{name}"), begin, back: at + 1, left: times, has_locals };
        let begin = self.begin_call(at, call, word)?;
        if let Some(locals) = locals {
            self.variables.begin(locals);
        }
        Ok(begin)
    }

    /// M97: what begins at a block with this number.
    pub(super) fn call_block(&mut self, at: usize, number: u64, times: u64) -> Result<usize> {
        let out = &self.reader.out;
        let name = format!("N{number}");
        let begin = match self.blocks.numbered.get(&number).map_or(&[][..], Vec::as_slice) {
            [begin] => *begin,
            [] => return Err(out.fault(b"M97", &format!("calls {name}, which the file has not"))),
            _ => return Err(out.fault(b"M97", &format!("calls {name}, which the file has twice"))),
        };
        if begin == at || self.calls.iter().any(|call| call.name == name) {
            return Err(out.fault(b"M97", &format!("calls {name} within itself, which has no end")));
        }
        self.begin_call(at, Call { name, begin, back: at + 1, left: times, has_locals: false }, b"M97")
    }

    fn begin_call(&mut self, at: usize, call: Call, word: &[u8]) -> Result<usize> {
        if self.calls.len() == DEPTH_MAX {
            let what = "calls more subprograms within each other than can be followed";
            return Err(self.reader.out.fault(word, what));
        }
        if call.left == 0 {
            return Ok(at + 1);
        }
        let begin = call.begin;
        self.calls.push(call);
        Ok(begin)
    }

    /// The end of the innermost call: the line to go on with.
    pub(super) fn end(&mut self) -> usize {
        let Some(call) = self.calls.last_mut() else { return self.lines.len() };
        call.left -= 1;
        if call.left > 0 {
            return call.begin;
        }
        let back = call.back;
        if let Some(call) = self.calls.pop() {
            self.end_locals(&call);
        }
        back
    }
}
