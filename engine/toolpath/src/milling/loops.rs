//! Where loops and blocks of macros stand: what GOTO and WHILE lead to.

use super::statement::{cleaned, loop_begin, loop_mark, may_be_macro};
use std::collections::{BTreeMap, BTreeSet};

/// A loop, from the line that begins it to its END.
#[derive(Clone, Copy, Debug)]
struct MacroLoop {
    end: usize,
    /// Begin of the loop around it.
    outer: Option<usize>,
}

/// Loops, by the lines of their begins, and blocks with numbers.
#[derive(Debug, Default)]
pub(super) struct Jumps {
    loops: BTreeMap<usize, MacroLoop>,
    begins: BTreeMap<usize, usize>,
    /// Lines of blocks, by their numbers; only if a line has GOTO.
    blocks: BTreeMap<u64, Vec<usize>>,
}

impl Jumps {
    /// Finds them; no loop reaches over a line at which a program begins.
    pub fn of(lines: &[&[u8]], programs: impl Iterator<Item = usize>) -> Jumps {
        let mut jumps = Jumps::default();
        let programs: BTreeSet<usize> = programs.collect();
        let mut open: Vec<(u8, usize)> = Vec::new();
        let mut has_goto = false;
        for (at, line) in lines.iter().enumerate() {
            if programs.contains(&at) {
                open.clear();
            }
            if !may_be_macro(line) {
                continue;
            }
            let clean = cleaned(line);
            has_goto |= clean.windows(4).any(|text| text == b"GOTO");
            if let Some(number) = loop_begin(&clean) {
                // One within another one of the same number has no end of its own.
                if open.iter().all(|(other, _)| *other != number) {
                    open.push((number, at));
                }
            } else if let Some(number) = loop_mark(&clean, b"END")
                && let Some((_, begin)) = open.pop_if(|(open, _)| *open == number)
            {
                let outer = open.last().map(|(_, begin)| *begin);
                jumps.loops.insert(begin, MacroLoop { end: at, outer });
                jumps.begins.insert(at, begin);
            }
        }
        if has_goto {
            for (at, line) in lines.iter().enumerate() {
                if let Some(number) = block_number(line) {
                    jumps.blocks.entry(number).or_default().push(at);
                }
            }
        }
        jumps
    }

    /// The line of a loop's END.
    pub fn end_of(&self, begin: usize) -> Option<usize> {
        self.loops.get(&begin).map(|found| found.end)
    }

    /// The line where the loop begins that ends here.
    pub fn begin_of(&self, end: usize) -> Option<usize> {
        self.begins.get(&end).copied()
    }

    /// Lines of this program, from one to before another one, with this number.
    pub fn blocks(&self, number: u64, from: usize, to: usize) -> &[usize] {
        let lines = self.blocks.get(&number).map_or(&[][..], Vec::as_slice);
        let begin = lines.partition_point(|at| *at < from);
        let end = lines.partition_point(|at| *at < to);
        &lines[begin..end]
    }

    /// Whether a jump leads into a loop from outside.
    pub fn enters_loop(&self, from: usize, to: usize) -> bool {
        let mut at = self.loops.range(..to).next_back().map(|(begin, _)| *begin);
        while let Some(begin) = at {
            let Some(found) = self.loops.get(&begin) else { return false };
            if found.end >= to && !(begin..=found.end).contains(&from) {
                return true;
            }
            at = found.outer;
        }
        false
    }
}

/// The number of a block, with whatever behind it.
fn block_number(line: &[u8]) -> Option<u64> {
    let line = line.strip_prefix(b"/").unwrap_or(line).trim_ascii_start();
    let digits = line.strip_prefix(b"N").or_else(|| line.strip_prefix(b"n"))?.trim_ascii_start();
    let length = digits.iter().take_while(|byte| byte.is_ascii_digit()).count();
    std::str::from_utf8(&digits[..length]).ok()?.parse().ok()
}
