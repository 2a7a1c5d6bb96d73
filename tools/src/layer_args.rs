//! What the user types for layers and overlaps.

use crate::args::IoArg;
use crate::toolpaths::ToolpathArgs;
use crate::units::{Length, Unit};
use crate::void_args::not_negative;
use crate::work::WorkArgs;
use clap::{Args, ValueEnum};
use std::path::PathBuf;

/// List the layers of a part: area, volumes, porosity and material fed, one row each
#[derive(Args)]
#[command(after_help = "\
Layers are those of the toolpath that the store was built from, or steps of --pitch. Area and perimeter are those of the \
section at half the layer's height.

Volumes are sums of chords along z between exact crossings, cut where the layer \
begins and ends, so they do not depend on how layers stand to the cells.

The overlap, and the union again \
(source_volume), are integrals over the source, where the store has them by layer; else the overlap is counted in \
samples. Porosity is the share of enclosed voids in solid and voids.

The material fed comes from the toolpath, which is read again from where it was; without it the column is empty. Fed \
minus union stands beside porosity: what is fed beyond the union must go somewhere, and fills what the model leaves void.

Example:
  brickfield layers part.brf -o layers.csv")]
pub struct LayersArgs {
    /// The store
    #[arg(value_name = "PART.brf")]
    pub store: PathBuf,
    /// The table to write; its name ends in .csv or .json. Without it the table is printed
    #[arg(long, short, value_name = "LAYERS.csv|.json")]
    pub output: Option<PathBuf>,
    /// Steps of this height instead of layers, as in 0.5mm, from the part's lower end
    #[arg(long, value_name = "LEN")]
    pub pitch: Option<Length>,
    /// Where the toolpath is now
    #[arg(long = "toolpath", value_name = "FILE", conflicts_with = "pitch")]
    pub toolpath_file: Option<PathBuf>,
    /// How to read the store
    #[arg(long, value_enum, default_value_t)]
    pub io: IoArg,
    /// Print totals and rows as JSON
    #[arg(long)]
    pub json: bool,
    /// The unit of a toolpath whose program does not tell it, as in `build`
    #[arg(long, value_enum)]
    pub units: Option<Unit>,
    #[command(flatten)]
    pub toolpath: ToolpathArgs,
    #[command(flatten)]
    pub work: WorkArgs,
}

/// List the pairs of beads that overlap: volume, place and lines, one row each
#[derive(Args)]
#[command(after_help = "\
Beads are compared as the store counts them: pass by pass, or bead by bead with --count beads of `build`. Samples of \
all pairs add up to the sum of w(w - 1)/2 over the store's samples, exactly; where three beads lie, three pairs count.

Volumes are means over chords along x, y and z, which are nearer than samples; the JSON has both sums. The store must \
have been built from toolpaths with --identity. Values are in the store's unit.

Example:
  brickfield overlap part.brf -o overlap.csv")]
pub struct OverlapArgs {
    /// The store
    #[arg(value_name = "PART.brf")]
    pub store: PathBuf,
    /// The table to write; its name ends in .csv or .json. Without it the table is printed
    #[arg(long, short, value_name = "OVERLAP.csv|.json")]
    pub output: Option<PathBuf>,
    /// What a row is: a pair of beads, or all pairs of two features or of two layers
    #[arg(long, value_enum, value_name = "WHAT", default_value_t)]
    pub by: OverlapByArg,
    /// Leave out rows of less volume, in the cube of the store's unit; totals count them
    #[arg(long, value_name = "VOLUME", default_value_t = 0.0, value_parser = not_negative)]
    pub min_volume: f64,
    /// How to read the store
    #[arg(long, value_enum, default_value_t)]
    pub io: IoArg,
    /// Print totals and rows as JSON
    #[arg(long)]
    pub json: bool,
    #[command(flatten)]
    pub work: WorkArgs,
}

/// What a row of overlaps is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub enum OverlapByArg {
    /// Two beads, or passes
    #[default]
    Pair,
    /// Two features
    Feature,
    /// Two layers
    Layer,
}
