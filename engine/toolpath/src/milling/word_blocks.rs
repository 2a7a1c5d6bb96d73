//! Loops and conditions of LinuxCNC: `o100 while`, `do`, `if` and what belongs to them, found by their name.

use super::formula::FormulaReader;
use super::program::{Flow, WordBlock};
use super::statement::cleaned;
use crate::error::{Error, Result};

/// What to do about blocks that cannot be followed.
const REMEDY: &str = "correct the line, or post-process without macros";

/// Most lines of one name, all of which are looked through.
const LINES_OF_NAME_MAX: usize = 1024;

impl Flow<'_, '_> {
    /// A loop or a condition: the line to go on with.
    pub(super) fn word_block(&mut self, at: usize, block: &WordBlock<'_>) -> Result<usize> {
        let name = block.name.as_str();
        if self.blocks.worded.get(name).is_some_and(|blocks| blocks.len() > LINES_OF_NAME_MAX) {
            let what = "has a name that stands in more lines than can be followed";
            return Err(self.reader.out.refused(
                block.word().as_bytes(),
                what,
                "give each block its own name",
            ));
        }
        let next = match block.keyword.as_str() {
            "while" => return self.while_block(at, block),
            "endwhile" => self.before(name, at, &["while"]),
            "do" => self.behind(name, at, &["while"]).map(|_| at + 1),
            "if" if self.condition(block)? => Some(at + 1),
            "if" => return self.next_branch(at, block),
            // The branch before is done.
            "elseif" | "else" => {
                let is_branch = self.before(name, at, &["if"]).is_some();
                self.behind(name, at, &["endif"]).filter(|_| is_branch).map(|end| end + 1)
            }
            "endif" => self.before(name, at, &["if"]).map(|_| at + 1),
            "break" | "continue" => self.loop_around(at, block),
            _ => {
                let what = "is a loop or a condition that is not read";
                return Err(self.reader.out.refused(block.word().as_bytes(), what, REMEDY));
            }
        };
        let next = next.ok_or_else(|| self.lacks_partner(block))?;
        self.repeats |= next <= at;
        Ok(next)
    }

    /// A loop's begin, or the end of one that begins by `do`.
    fn while_block(&mut self, at: usize, block: &WordBlock<'_>) -> Result<usize> {
        let goes_on = self.condition(block)?;
        let opener = self.before(&block.name, at, &["do", "while", "endwhile"]);
        let begin = opener.filter(|opener| self.keyword(*opener) == Some("do"));
        let next = match (begin, goes_on) {
            (_, true) => Some(begin.unwrap_or(at) + 1),
            (Some(_), false) => Some(at + 1),
            (None, false) => self.behind(&block.name, at, &["endwhile"]).map(|end| end + 1),
        };
        self.repeats |= begin.is_some() && goes_on;
        next.ok_or_else(|| self.lacks_partner(block))
    }

    /// The first branch behind one whose condition is not met.
    fn next_branch(&mut self, mut at: usize, block: &WordBlock<'_>) -> Result<usize> {
        loop {
            let next = self.behind(&block.name, at, &["elseif", "else", "endif"]);
            at = next.ok_or_else(|| self.lacks_partner(block))?;
            let Some(branch) = WordBlock::of(self.lines[at]).filter(|branch| branch.keyword == "elseif")
            else {
                return Ok(at + 1);
            };
            self.reader.out.line = at as u64 + 1;
            if self.condition(&branch)? {
                return Ok(at + 1);
            }
        }
    }

    /// Where `break` and `continue` lead in the loop of their name.
    fn loop_around(&self, at: usize, block: &WordBlock<'_>) -> Option<usize> {
        let begin = self.before(&block.name, at, &["do", "while"])?;
        let is_do = self.keyword(begin) == Some("do");
        let end = self.behind(&block.name, at, &[if is_do { "while" } else { "endwhile" }])?;
        Some(match (block.keyword.as_str(), is_do) {
            ("break", _) => end + 1,
            (_, true) => end,
            (_, false) => begin,
        })
    }

    fn condition(&self, block: &WordBlock<'_>) -> Result<bool> {
        let clean = cleaned(block.rest);
        let mut reader = FormulaReader::new(&clean, &self.variables);
        let found = reader.condition().and_then(|found| match reader.rest() {
            [] => Ok(found),
            _ => Err("has more behind its condition than is understood".to_owned()),
        });
        found.map_err(|what| self.reader.out.refused(block.word().as_bytes(), &what, REMEDY))
    }

    /// The nearest line behind this one with a block of the name that has one of these words.
    fn behind(&self, name: &str, at: usize, words: &[&str]) -> Option<usize> {
        let blocks = self.blocks.worded.get(name)?;
        let from = blocks.partition_point(|(line, _)| *line <= at);
        blocks[from..].iter().find(|(_, word)| words.contains(&word.as_str())).map(|(line, _)| *line)
    }

    /// The nearest one before it.
    fn before(&self, name: &str, at: usize, words: &[&str]) -> Option<usize> {
        let blocks = self.blocks.worded.get(name)?;
        let to = blocks.partition_point(|(line, _)| *line < at);
        blocks[..to].iter().rfind(|(_, word)| words.contains(&word.as_str())).map(|(line, _)| *line)
    }

    fn keyword(&self, at: usize) -> Option<&'static str> {
        let block = WordBlock::of(self.lines[at])?;
        ["do", "while"].into_iter().find(|word| *word == block.keyword)
    }

    fn lacks_partner(&self, block: &WordBlock<'_>) -> Error {
        let what = "has no other line that belongs to it, as endwhile, while or endif";
        self.reader.out.refused(block.word().as_bytes(), what, REMEDY)
    }
}
