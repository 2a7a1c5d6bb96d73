//! Programs of milling machines: from G-code to straight moves of tools.
//!
//! Words are read as the toolpaths' reader has them. Positions are those of the tool's tip, in mm, in the coordinates of the
//! part: work offsets count as the program sets them by G10 L2, or else zero, and G43 leaves the tip where it is
//! programmed.

mod apt;
#[cfg(test)]
mod apt_tests;
mod compensation;
#[cfg(test)]
mod compensation_tests;
mod contour;
mod coordinates;
mod cycle;
mod formula;
mod frame;
mod loops;
mod macros;
#[cfg(test)]
mod macros_tests;
mod motion;
mod moves;
mod plane;
mod program;
#[cfg(test)]
mod program_tests;
mod reader;
mod rotation;
mod scaling;
#[cfg(test)]
mod scaling_tests;
mod statement;
#[cfg(test)]
mod tests;
mod tilted;
#[cfg(test)]
mod tilted_tests;
mod tool;
mod values;
mod variables;
mod word_blocks;

pub use moves::{Move, Program, ProgramOptions};
pub use program::read;
pub use tool::{Tool, ToolKind};
