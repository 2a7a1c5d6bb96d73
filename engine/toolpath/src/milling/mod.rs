//! Programs of milling machines: from G-code to straight moves of tools.
//!
//! Words are read as the toolpaths' reader has them. Positions are those of the tool's tip, in mm, in the coordinates of the
//! part: work offsets count as the program sets them by G10 L2, or else zero, and G43 leaves the tip where it is
//! programmed.

mod cycle;
mod reader;
#[cfg(test)]
mod tests;
mod tool;

pub use reader::{Move, Program, ProgramOptions, read};
pub use tool::{Tool, ToolKind};
