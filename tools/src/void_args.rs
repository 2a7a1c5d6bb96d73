//! What the user types for voids.

use crate::args::IoArg;
use crate::units::{Length, Size};
use crate::work::WorkArgs;
use clap::{Args, ValueEnum};
use std::path::PathBuf;

/// List the voids of a part: regions of w = 0 that it encloses, one row each
#[derive(Args)]
#[command(after_help = "\
The largest void comes first. Void that touches the outside of the root is no void. Volumes and surfaces are those of the \
mesh's polygons, with errors from chords between exact crossings; centroids are those of the chords.

Values are in the store's unit, and empty where they are not known, as of voids of a cell or two. Lengths are told to a \
hundredth of a cell.

Lines and features are of the beads around a void, by their share of its surface. Neighbours of a line that may be missing \
come first. They need a store that was built with --identity.

A void is sealed for certain if it stays closed when void is connected through every cell that may be void. Beads tell \
(stores with --identity), or the meshes that the store was built from (--source). Without either, every leaf at the depth \
limit connects.

Where cells decide they are halved and asked again. What opens through them is no more sealed (no), and its throat is empty.

Else it is sealed as far as samples tell (to_cell): a leak thinner than a cell may be hidden. With --closing, voids are \
listed that open (no) through a throat: the diameter of the largest ball that can leave, mostly one or two cells too narrow.

The class of a void is pocket, infill or flaw. With --cad a void of which most lies outside the CAD part is a pocket. \
Of others the features of the beads around tell.

Sparse infill makes it infill. Outer walls around a void that is wider \
than the beads and spans four layers or more make it a pocket. What is left is a flaw.

Example:
  brickfield voids part.brf -o voids.csv")]
pub struct VoidsArgs {
    /// The store
    #[arg(value_name = "PART.brf")]
    pub store: PathBuf,
    /// The table to write; its name ends in .csv or .json
    #[arg(long, short, value_name = "VOIDS.csv|.json")]
    pub output: PathBuf,
    /// Through how many neighbours void hangs together: 6, across faces, or 26; solid through the other number
    #[arg(long, value_enum, value_name = "N", default_value_t)]
    pub connectivity: VoidConnectivityArg,
    /// Leave out smaller voids, in the cube of the store's unit; totals count them
    #[arg(long, value_name = "VOLUME", default_value_t = 0.0, value_parser = not_negative)]
    pub min_volume: f64,
    /// Fail, with status 1, if voids have a larger share than this of the volume of solid and voids, 0 to 1
    #[arg(long, value_name = "SHARE", value_parser = share)]
    pub max_porosity: Option<f64>,
    /// Fail, with status 1, if the ball of the largest void's volume is wider
    #[arg(long, value_name = "LENGTH")]
    pub max_equivalent_diameter: Option<Length>,
    /// Require the lines of the toolpath around each void: fail if the store does not tell beads apart
    #[arg(long)]
    pub lines: bool,
    /// The store of the CAD part on the same lattice, to tell voids that it has from those that it has not: build it with
    /// --like PART.brf
    #[arg(long, value_name = "CAD.brf")]
    pub cad: Option<PathBuf>,
    /// A mesh that the store was built from, as it was then: tells seals apart that hide between samples. Give it again for each
    /// of several
    #[arg(long, value_name = "MESH")]
    pub source: Vec<PathBuf>,
    /// List voids, too, that open to the outside only through throats narrower than this, as in 0.8mm
    #[arg(long, value_name = "LEN")]
    pub closing: Option<Length>,
    /// Also write the voids as closed meshes, largest first: .ply and .vtp, whose faces have the number void, .obj, a group each,
    /// or .3mf, an object each in the colour of its class
    #[arg(long = "mesh", value_name = "OUT.ply|.obj|.vtp|.3mf")]
    pub mesh: Option<PathBuf>,
    /// Also write the number of the void at each sample of the deepest level, 0 at all others. An .npy is an array (z, y, x) of
    /// 32-bit integers, with a description beside it. The other formats of `export`, such as .vdb, have 16 bits
    #[arg(long, value_name = "OUT.npy|.vdb")]
    pub labels: Option<PathBuf>,
    /// Memory for bricks, boundaries and the grid of --closing, as in 512MiB. With less the grid is coarser, and some distances stay
    /// empty
    #[arg(long, value_name = "SIZE", default_value = "1GiB")]
    pub memory: Size,
    /// Folder of a temporary file for pieces of --mesh; that of the mesh by default
    #[arg(long, value_name = "DIR")]
    pub temp_dir: Option<PathBuf>,
    /// How to read the store
    #[arg(long, value_enum, default_value_t)]
    pub io: IoArg,
    /// Print totals and rows as JSON
    #[arg(long)]
    pub json: bool,
    #[command(flatten)]
    pub work: WorkArgs,
}

/// Neighbours through which void hangs together.
#[derive(Clone, Copy, Debug, Default, ValueEnum)]
pub enum VoidConnectivityArg {
    /// Across faces; solid across faces, edges and corners
    #[default]
    #[value(name = "6")]
    Six,
    /// Across faces, edges and corners; solid across faces
    #[value(name = "26")]
    TwentySix,
}

/// A finite number that is not negative.
pub fn not_negative(text: &str) -> Result<f64, String> {
    let number = text.parse::<f64>().ok().filter(|number| number.is_finite() && *number >= 0.0);
    number.ok_or_else(|| "is no number, or less than 0".to_owned())
}

/// A number from 0 to 1.
fn share(text: &str) -> Result<f64, String> {
    not_negative(text).ok().filter(|share| *share <= 1.0).ok_or_else(|| "is no number from 0 to 1".to_owned())
}
