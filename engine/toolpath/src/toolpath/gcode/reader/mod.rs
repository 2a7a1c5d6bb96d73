//! The reader: a file is looked through, then carried out line by line.

mod beads;
mod bgcode;
mod block;
mod commands;
mod comments;
mod coordinates;
mod distance;
mod expressions;
mod extruder;
mod file_scan;
mod klipper;
mod lines;
mod machine;
mod member;
mod motion;
mod names;
mod neutral;
mod offsets;
mod parameters;
mod plan;
mod position;
mod read;
mod regions;
mod remarks;
mod settings;
mod sizes;
mod source;
mod states;
mod survey;
#[cfg(test)]
mod tests;

pub use read::{read_gcode, read_gcode_from};

use super::{INCH, MERGE_MM, POSITION_MAX, SIZE_MAX, UNNAMED};
use super::{arc, auxiliary, deposition, firmware, layer_axis, options, report, tilt, words};
