//! Moves as a reader of programs makes them, with the tools that they use.

use super::tool::Tool;
use crate::error::{Error, Result};
use crate::toolpath::gcode::arc::{Arc, Chords};
use std::collections::BTreeMap;
use std::path::Path;

/// Largest coordinate, in mm.
pub(super) const POSITION_MAX: f64 = 1e6;
/// Most moves of a program, whatever the memory: their numbers have 32 bits.
const MOVES_MAX: u64 = 1 << 31;
/// Bytes for a move while there come more: lists of them double.
const BYTES_A_MOVE: u64 = 2 * size_of::<Move>() as u64;

/// What the caller knows of a program.
#[derive(Clone, Debug)]
pub struct ProgramOptions {
    /// Tools by their numbers, before those that comments name.
    pub tools: BTreeMap<u32, Tool>,
    /// The tool of all numbers that have none, and until a number is called.
    pub tool: Option<Tool>,
    /// Radii in mm that G41 and G42 correct for, by the number D.
    pub radii: BTreeMap<u32, f64>,
    /// How far chords may deviate from arcs, in mm.
    pub arc_tolerance: f64,
    /// Largest turn of the tool's axis in one step, as the sine of the angle.
    pub turn: f64,
    /// Bytes that moves may take while they are read.
    pub memory: u64,
}

/// A straight move of a tool that keeps its direction.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Move {
    /// Line of the program, from 1.
    pub line: u64,
    /// Whether it is a rapid one (G0), which must not cut.
    pub rapid: bool,
    /// Its tool, in [`Program::tools`].
    pub tool: u32,
    /// Where the tip begins and ends, in mm.
    pub from: [f64; 3],
    /// Where it ends.
    pub to: [f64; 3],
    /// The tool's axis, from the tip upward.
    pub axis: [f64; 3],
    /// The angle that the axis turns by within it, in radians, at most; `axis` is that of its middle.
    pub turn: f64,
}

/// A program that was read.
#[derive(Clone, Debug, Default)]
pub struct Program {
    /// In the order of the program.
    pub moves: Vec<Move>,
    /// Tools that were used, each with its number in the program; 0 until one is called.
    pub tools: Vec<(u32, Tool)>,
    /// Largest deviation of chords from arcs, in mm.
    pub chord_error: f64,
    /// Arcs that became chords.
    pub arcs: u64,
    /// Steps in which the tool turned, each with a direction of its own.
    pub turning_steps: u64,
    /// Rapid moves from or to a place that the program does not tell, as after G28; they are left out.
    pub unplaced: u64,
    /// Words that do not move the tool and are not known, each with how often it stands in the program.
    pub skipped: BTreeMap<String, u64>,
}

/// The moves of a program so far.
pub(super) struct Moves<'a> {
    path: &'a Path,
    pub options: &'a ProgramOptions,
    /// Line of the program, from 1.
    pub line: u64,
    pub program: Program,
    /// The tool in the spindle.
    pub tool: u32,
    /// Tools that the program itself names.
    pub named: BTreeMap<u32, Tool>,
}

impl<'a> Moves<'a> {
    pub fn new(path: &'a Path, options: &'a ProgramOptions) -> Moves<'a> {
        Moves { path, options, line: 0, program: Program::default(), tool: 0, named: BTreeMap::new() }
    }

    /// What is wrong with a word of the line.
    pub fn fault(&self, word: &[u8], what: &str) -> Error {
        self.refused(word, what, "correct the line, or post-process the program anew")
    }

    /// As [`Moves::fault`], with what to do.
    pub fn refused(&self, word: &[u8], what: &str, remedy: &str) -> Error {
        let word = String::from_utf8_lossy(word).into_owned();
        Error::input(self.path, format!("line {}", self.line), format!("{word:?} {what}"), remedy)
    }

    /// The program, if it moves at all.
    pub fn finished(self) -> Result<Program> {
        if self.program.moves.is_empty() && self.program.unplaced == 0 {
            let remedy = "give a milling program, with G0 to G3 or drilling cycles, or a CL file with GOTO";
            return Err(Error::input(self.path, "end", "has no moves", remedy));
        }
        Ok(self.program)
    }

    /// Adds a straight move, in steps where the tool turns: `axis` gives its direction at a part of the move, and `turn` is by
    /// how much it turns in all, in radians, at most.
    pub fn push(
        &mut self,
        (from, to): ([f64; 3], [f64; 3]),
        rapid: bool,
        turn: f64,
        axis: impl Fn(f64) -> [f64; 3],
    ) -> Result<()> {
        let tool = self.tool_in_use()?;
        // Angles are small: the sine is the angle.
        let steps = (turn / self.options.turn).ceil().clamp(1.0, 1e6) as u32;
        for step in 0..steps {
            let part = |n: u32| f64::from(n) / f64::from(steps);
            let between = |n: u32| [0, 1, 2].map(|a| from[a] + (to[a] - from[a]) * part(n));
            let middle = (part(step) + part(step + 1)) * 0.5;
            let end = if step + 1 == steps { to } else { between(step + 1) };
            if self.program.moves.len() as u64 >= MOVES_MAX.min(self.options.memory / BYTES_A_MOVE) {
                return Err(self.too_many());
            }
            let begin = if step == 0 { from } else { between(step) };
            self.program.moves.push(Move {
                line: self.line,
                rapid,
                tool,
                from: begin,
                to: end,
                axis: axis(middle),
                turn: turn / f64::from(steps),
            });
        }
        if turn > 0.0 {
            self.program.turning_steps += u64::from(steps);
        }
        Ok(())
    }

    fn too_many(&self) -> Error {
        let count = self.program.moves.len();
        let what = format!("more than {count} moves do not fit into memory");
        let remedy = "allow more with `memory`, or give the program in parts, each for the store that the one before made";
        Error::input(self.path, format!("line {}", self.line), what, remedy)
    }

    /// The chords of an arc, which the program then has deviate so far; `word` is what asks for it.
    pub fn chords(&mut self, arc: &Arc, word: &[u8]) -> Result<Chords> {
        let tolerance = self.options.arc_tolerance;
        let chords = arc.chords(tolerance).map_err(|what| self.fault(word, what))?;
        self.program.chord_error = self.program.chord_error.max(tolerance);
        Ok(chords)
    }

    /// The place of the tool in the list of those in use.
    fn tool_in_use(&mut self) -> Result<u32> {
        let number = self.tool;
        if let Some(at) = self.program.tools.iter().position(|(n, _)| *n == number) {
            return Ok(at as u32);
        }
        let found =
            self.options.tools.get(&number).or(self.named.get(&number)).or(self.options.tool.as_ref());
        let Some(tool) = found.copied() else {
            return Err(Error::input(
                self.path,
                format!("line {}", self.line),
                format!("moves with tool T{number}, of which nothing is known"),
                format!(
                    "give it, as by `tool` {number}=flat:6mm, or by a comment (T{number} D=6. CR=0. - flat end mill)"
                ),
            ));
        };
        self.program.tools.push((number, tool));
        Ok(self.program.tools.len() as u32 - 1)
    }
}
