//! What the user types behind `brickfield-bench`.

use brickfield_terminal::work::WorkArgs;
use clap::{Args, Parser, Subcommand, ValueEnum};
use std::ffi::OsString;
use std::path::PathBuf;

/// Measure brickfield on this machine, and compare and show what was measured
#[derive(Parser)]
#[command(name = "brickfield-bench", version, max_term_width = 110, args_conflicts_with_subcommands = true)]
#[command(after_help = "\
Inputs are made on demand in the cache folder and their bytes checked: 3.5 GB for `paper` and `scale`, 7.2 GB with \
--full, 0.2 GB with --quick; what is written while measuring takes up to 3, 6 and 1 GiB more. That there is room is \
checked first. Every figure is that of whole commands of brickfield, started anew for each round, and stands beside \
the read floor of its input in the same round: streaming the file with all cores and snapping every vertex in plain \
code. Limits are times divided by the least that the machine needs: the bytes of all files that are read whole and of \
those that are written, once, at the speed at which all threads add up 256 MiB; or for the sum over all triangles its \
operations, 67 for a sample and a triangle, at that of plain multiplications and additions. Memory is the largest \
RssAnon of the process, read every 2 ms. What is told is the median of the rounds, with the least and the greatest.

Examples:
  brickfield-bench -o now.json --report now.html
  brickfield-bench scale mesh --quick
  brickfield-bench compare before.json now.json
  brickfield-bench report now.json -o now.md")]
pub struct BenchArgs {
    #[command(subcommand)]
    pub command: Option<BenchCommand>,
    /// The program that is measured [default: brickfield beside this one]
    #[arg(long, value_name = "FILE", global = true)]
    pub program: Option<PathBuf>,
    #[command(flatten)]
    pub run: BenchRunArgs,
}

#[derive(Subcommand)]
pub enum BenchCommand {
    Compare(BenchCompareArgs),
    Report(BenchReportArgs),
    Instructions(BenchInstructionsArgs),
}

#[derive(Args)]
pub struct BenchRunArgs {
    /// What to measure [default: paper scale]
    #[arg(value_name = "SUITE")]
    pub suites: Vec<SuiteArg>,
    /// Small inputs, to see that all works and what is roughly to be expected
    #[arg(long)]
    pub quick: bool,
    /// All of `scale`, up to 45 million triangles and depth 7, and open input of all sizes in `paper`; takes much longer
    #[arg(long, conflicts_with = "quick")]
    pub full: bool,
    /// Folder for inputs, kept, and for what is written while measuring, removed
    /// [default: brickfield in $XDG_CACHE_HOME or ~/.cache]
    #[arg(long, value_name = "DIR")]
    pub cache: Option<PathBuf>,
    /// How often every figure is measured
    #[arg(long, value_name = "N", default_value_t = 3, value_parser = clap::value_parser!(u16).range(1..=1000))]
    pub rounds: u16,
    /// Also ask other programs such questions, by turns with this one, through the Python of the environment that
    /// bench-data/peers/setup makes: samples with `paper` and `points`, contouring with `mesh`, the union of all pieces with
    /// `unions` [default: peers/bin/python in the cache folder]
    #[arg(long, value_name = "PYTHON", num_args = 0..=1, require_equals = true)]
    pub peers: Option<Option<OsString>>,
    /// Write everything that was measured, every round of it, as JSON
    #[arg(long, short, value_name = "RESULT.json")]
    pub output: Option<PathBuf>,
    /// Also write the report, as `brickfield-bench report` does
    #[arg(long, value_name = "OUT.html|OUT.md")]
    pub report: Option<PathBuf>,
    /// Print what -o writes in place of the table
    #[arg(long)]
    pub json: bool,
    #[command(flatten)]
    pub work: WorkArgs,
}

/// The suites.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, ValueEnum)]
pub enum SuiteArg {
    /// Table 3 of Peelar et al. 2019: 32³ to 128³ samples of inputs of its sizes, dense, open and sparse, and the sum
    /// over all triangles that it measured
    Paper,
    /// Builds by the number of triangles, depth, threads and memory
    Scale,
    /// Meshes of stores: uniform and with --tolerance, STL and PLY
    Mesh,
    /// Stores as files: compression, verify, stat, repack, export
    Store,
    /// Answers at points: from stores, from closed and open soups; builds from point clouds
    Points,
    /// Table 2 of Peelar et al. 2019: the union of 10 to 10,000 beads from STL to STL, and how far it is from the true one
    Unions,
}

/// Say what differs between two results beyond the noise of their rounds
#[derive(Args)]
#[command(after_help = "\
A figure differs if the ranges of its rounds do not overlap and the medians are farther apart than the noise: three \
standard errors of the medians, estimated from the rounds' deviations, and at least 2 percent; 25 percent where one \
of the two has fewer than 3 rounds. Answers (triangles, bytes, leaves) must be equal. Status 0 if nothing differs, 1 \
otherwise.

Examples:
  brickfield-bench compare before.json now.json")]
pub struct BenchCompareArgs {
    /// The result to compare with
    #[arg(value_name = "A.json")]
    pub before: PathBuf,
    /// The result that is judged
    #[arg(value_name = "B.json")]
    pub after: PathBuf,
    /// Print the comparison as JSON
    #[arg(long)]
    pub json: bool,
}

/// Write tables and plots of results as one HTML page, or as Markdown with SVG files beside it
#[derive(Args)]
#[command(after_help = "\
Examples:
  brickfield-bench report now.json -o now.md")]
pub struct BenchReportArgs {
    /// What `brickfield-bench -o` wrote; the plots show all of them
    #[arg(required = true, value_name = "RESULT.json")]
    pub results: Vec<PathBuf>,
    /// The report; .html or .md
    #[arg(long, short, value_name = "OUT.html|OUT.md")]
    pub output: PathBuf,
}

/// Count the instructions of brickfield's kernels, which other programs on the machine do not change
#[derive(Args)]
#[command(after_help = "\
A few commands on small inputs, one thread each, under `valgrind --tool=callgrind`, which must be installed. A kernel \
is a function with all that it calls. Counts differ with the compiler and with the vectors that valgrind has, so a file \
tells both. Differences are told and are no failure: status 0.

Examples:
  brickfield-bench instructions --baseline bench-data/instructions.json
  brickfield-bench instructions -o bench-data/instructions.json")]
pub struct BenchInstructionsArgs {
    /// Tell the differences from what -o wrote
    #[arg(long, value_name = "COUNTS.json")]
    pub baseline: Option<PathBuf>,
    /// Write the counts
    #[arg(long, short, value_name = "COUNTS.json")]
    pub output: Option<PathBuf>,
    /// Folder for inputs [default: brickfield in $XDG_CACHE_HOME or ~/.cache]
    #[arg(long, value_name = "DIR")]
    pub cache: Option<PathBuf>,
    /// Print what -o writes in place of the table
    #[arg(long)]
    pub json: bool,
    /// No progress
    #[arg(long, short)]
    pub quiet: bool,
}
