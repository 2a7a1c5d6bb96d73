//! What the user types for splats.

use crate::args::IoArg;
use crate::units::{Length, Size};
use crate::work::WorkArgs;
use clap::{Args, ValueEnum};
use std::path::PathBuf;

/// Write the part as splats: small clipped planes, of which any beginning of the file is a picture
#[derive(Args)]
#[command(after_help = "\
The ending says the format.
  .bsp          all levels, coarse ones first, in a few bits a splat; `render --splats` draws it
  .html         a page with the same data in it: any browser turns and cuts the part, and asks for nothing else
  FOLDER/       a page for large parts: index.html and part.bsp, which it reads by ranges from any server of files
  .ply          the finest picture as flat Gaussians, for SuperSplat, PlayCanvas, Spark and others
  .glb          the same in glTF (KHR_gaussian_splatting), for CesiumJS and others; points where that is not known; up to 4 GiB

Each cell that the boundary passes has one to three splats: planes through the crossings of each face, which cut each other \
at edges. With --error, cells are not divided where their splats are near enough to all crossings in them.

With --number, a .ply or .glb has so many ellipses that are larger than cells, with the least distance found. Nothing cuts them, \
so at sharp edges they reach beyond the part: they are for smooth ones.

A click on a page tells a position, and of toolpaths the bead, its layer, feature and line of the program. Beads come from a \
store built with --identity, else from the toolpath, if that is where it was, unchanged; see --picks.

Examples:
  brickfield splats part.brf -o part.bsp
  brickfield splats part.brf -o part.html
  brickfield splats part.brf -o viewer/
  brickfield splats part.brf -o part.ply --error 0.05mm
  brickfield splats part.brf -o coarse.ply --level 2
  brickfield splats part.brf -o few.ply --number 1000")]
pub struct SplatsArgs {
    /// The store
    #[arg(value_name = "PART.brf")]
    pub store: PathBuf,
    /// The file to write; its ending decides the kind: .bsp, .html, .ply or .glb; or a folder, with / at its end
    #[arg(long, short, value_name = "OUT")]
    pub output: PathBuf,
    /// How far splats may be from the crossings that they stand for, as in 0.05mm [default: as near as cells of the finest
    /// level get]
    #[arg(long, value_name = "LEN")]
    pub error: Option<Length>,
    /// Deepest level to use
    #[arg(long, value_name = "L")]
    pub level: Option<u8>,
    /// Cover the part by at most so many ellipses, in a .ply or .glb
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..), conflicts_with_all = ["error", "level"])]
    pub number: Option<u32>,
    /// Circles in place of ellipses
    #[arg(long, requires = "number")]
    pub circles: bool,
    /// What a click on a page tells beside the position [default: auto]
    #[arg(long, value_enum, value_name = "WHAT", conflicts_with = "number")]
    pub picks: Option<PicksArg>,
    /// Memory for splats, as in 512MiB, to which 20 bytes a splat come while a .bsp or .html is coded; splats of the deepest
    /// level that do not fit go to a temporary file
    #[arg(long, value_name = "SIZE", default_value = "1GiB")]
    pub memory: Size,
    /// Folder of that file, which has no name there; the output's own by default
    #[arg(long, value_name = "DIR")]
    pub temp_dir: Option<PathBuf>,
    /// How to read the store
    #[arg(long, value_enum, default_value_t)]
    pub io: IoArg,
    /// Print what was written as JSON
    #[arg(long)]
    pub json: bool,
    #[command(flatten)]
    pub work: WorkArgs,
}

/// What picks in pages tell.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub enum PicksArg {
    /// Bead, layer, line and feature, where they can be had; in a page that is one file up to 1 MiB of them, or half of all else
    #[default]
    Auto,
    /// Bead, layer, line and feature, however many bytes they take; fails if they cannot be had
    Beads,
    /// Positions alone
    Positions,
}
