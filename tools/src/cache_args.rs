//! What the user types behind `brickfield cache`.

use crate::args::{IoArg, VerifyArgs};
use crate::units::{BoxArg, NodeArg, PointArg};
use crate::work::{ProgressArg, WorkArgs};
use brickfield_engine::cache::RecordOrder;
use brickfield_engine::store::Compression;
use clap::{ArgGroup, Args, Subcommand, ValueEnum};
use std::path::PathBuf;

/// Work on stores as files: list, inspect, cut down, compare, join
#[derive(Args)]
#[command(after_help = "\
Examples:
  brickfield cache stat part.brf
  brickfield cache merge part-*.brf -o part.brf")]
pub struct CacheArgs {
    #[command(subcommand)]
    pub command: CacheCommand,
}

#[derive(Subcommand)]
pub enum CacheCommand {
    Ls(LsArgs),
    Stat(StatArgs),
    Get(GetArgs),
    Verify(VerifyArgs),
    Compact(CompactArgs),
    Prune(PruneArgs),
    Repack(RepackArgs),
    Merge(MergeArgs),
    Diff(DiffArgs),
}

/// List the nodes of a store, level by level
#[derive(Args)]
#[command(after_help = "\
A line a node: its name, leaf or interior, the layout of its payload, least and greatest sample, offset and bytes in \
the file. Reads the index alone.

Examples:
  brickfield cache ls part.brf --level 2
  brickfield cache ls part.brf --leaves --box 0,0,0,10,10,2.5")]
pub struct LsArgs {
    /// The store, also a shard of one or an unfinished one
    #[arg(value_name = "PART.brf")]
    pub store: PathBuf,
    /// Nodes of this level only
    #[arg(long, value_name = "L")]
    pub level: Option<u8>,
    /// Nodes that meet this box only: least x, y, z, then greatest, in the store's unit
    #[arg(long = "box", value_name = "X0,Y0,Z0,X1,Y1,Z1", allow_hyphen_values = true)]
    pub region: Option<BoxArg>,
    /// Leaves only
    #[arg(long)]
    pub leaves: bool,
    /// How to read the store
    #[arg(long, value_enum, default_value_t)]
    pub io: IoArg,
    /// Print a JSON object a line
    #[arg(long)]
    pub json: bool,
}

/// Say where the bytes of a store are: by level, kind of record, part of record
#[derive(Args)]
#[command(after_help = "\
Reads every record. A crossing cell is a cell of a leaf with corners inside (w ≥ 0.5) and outside; an active voxel is a \
sample that a leaf owns and that is a corner of such a cell. `plain` are the bytes of a part before compression.

Examples:
  brickfield cache stat part.brf")]
pub struct StatArgs {
    /// The store, also a shard of one or an unfinished one
    #[arg(value_name = "PART.brf")]
    pub store: PathBuf,
    /// How to read the store
    #[arg(long, value_enum, default_value_t)]
    pub io: IoArg,
    /// Print it as JSON
    #[arg(long)]
    pub json: bool,
    #[command(flatten)]
    pub work: WorkArgs,
}

/// Print what one node of a store holds
#[derive(Args)]
#[command(after_help = "\
Samples are the 33 along each axis that the brick holds, the last ones repeating its neighbours' first:

  .npy   indexed [z,y,x]; 16-bit integers, or 64-bit floats where samples have binary places
  .raw   16-bit integers as stored, little-endian, x fastest
  .csv   the lines i,j,k,w

Hermite edges are lines axis,i,j,k,offset,x,y,z,nx,ny,nz: the \
lower sample, the place of the crossing on the edge (0 to 1) and in the world, and the outward normal.

Examples:
  brickfield cache get part.brf --node 2:1,0,3
  brickfield cache get part.brf --point 12.5,3,0.2 --samples brick.npy --hermite -")]
pub struct GetArgs {
    /// The store, also a shard of one or an unfinished one
    #[arg(value_name = "PART.brf")]
    pub store: PathBuf,
    /// The node: level:x,y,z in bricks of that level, as in 2:1,0,3 or L2(1,0,3), or its key, a number
    #[arg(long, value_name = "NODE", required_unless_present = "point", conflicts_with = "point")]
    pub node: Option<NodeArg>,
    /// The leaf whose cells hold this point, x,y,z in the store's unit
    #[arg(long, value_name = "X,Y,Z", allow_hyphen_values = true)]
    pub point: Option<PointArg>,
    /// With --point: no node deeper than this
    #[arg(long, value_name = "L", requires = "point")]
    pub level: Option<u8>,
    /// Write the samples: .npy, .raw or .csv, or - for CSV on standard output instead of the description
    #[arg(long, value_name = "OUT")]
    pub samples: Option<PathBuf>,
    /// Write the Hermite edges as CSV, - for standard output instead of the description
    #[arg(long, value_name = "OUT.csv")]
    pub hermite: Option<PathBuf>,
    /// How to read the store
    #[arg(long, value_enum, default_value_t)]
    pub io: IoArg,
    /// Print the description as JSON
    #[arg(long)]
    pub json: bool,
}

/// Where a store that is written anew goes.
#[derive(Args)]
pub struct OutputArgs {
    /// The store to read
    #[arg(value_name = "PART.brf")]
    pub store: PathBuf,
    /// The store to write
    #[arg(long, short, value_name = "OUT.brf", required_unless_present = "in_place")]
    pub output: Option<PathBuf>,
    /// Replace the store by what is written, once that is complete and safe on the disk
    #[arg(long, conflicts_with = "output")]
    pub in_place: bool,
    /// How to read the store
    #[arg(long, value_enum, default_value_t)]
    pub io: IoArg,
    /// Print the summary as JSON
    #[arg(long)]
    pub json: bool,
    #[command(flatten)]
    pub work: WorkArgs,
}

/// Write a store without gaps, its records in the order of a build
#[derive(Args)]
#[command(after_help = "\
A store that `build` or `cache merge` has written comes out with the same bytes. Every record is checked before it is \
copied.

Example:
  brickfield cache compact part.brf --in-place")]
pub struct CompactArgs {
    #[command(flatten)]
    pub output: OutputArgs,
}

/// Cut a store down: to a level, to a box, to an error
#[derive(Args)]
#[command(group = ArgGroup::new("less").required(true).multiple(true))]
#[command(after_help = "\
What is left is a store as any other; samples keep their values. A node becomes a leaf as soon as one of the options asks for \
it. Its Hermite edges are those crossings of the finer ones that lie on its own lattice.

`mesh` of a store cut at level L gives the bytes of `mesh --level L` of the whole. A build of depth L has the same samples, and of \
closed meshes the same tree; its crossings stand up to 1/65536 of an edge aside.

With --error E, w interpolated anywhere (`sample`) is off by at most E from what the whole store gives. It is for smooth \
fields, as those of point clouds.

At a facet w jumps by 1, which no interpolation follows to less than 0.5. So below that nothing through which a facet passes \
is cut. Of a mesh built with the default --refine that is nothing at all: whatever is divided there has a facet.

Examples:
  brickfield cache prune part.brf -o preview.brf --level 3
  brickfield cache prune part.brf -o corner.brf --box 0,0,0,10,10,2.5 --outside-level 2
  brickfield cache prune scan.brf --in-place --error 0.01")]
pub struct PruneArgs {
    #[command(flatten)]
    pub output: OutputArgs,
    /// Keep no node deeper than this
    #[arg(long, value_name = "L", group = "less")]
    pub level: Option<u8>,
    /// Keep what meets this box as it is, and the rest coarse: least x, y, z, then greatest, in the store's unit
    #[arg(
        long = "box",
        id = "region",
        value_name = "X0,Y0,Z0,X1,Y1,Z1",
        allow_hyphen_values = true,
        group = "less"
    )]
    pub region: Option<BoxArg>,
    /// Keep nodes outside of the box down to this level; 0 leaves the coarsest octree around the box
    #[arg(long, value_name = "L", default_value_t = 0, requires = "region")]
    pub outside_level: u8,
    /// Leave out nodes whose samples a coarser one gives by interpolation, up to this difference of w
    #[arg(long, value_name = "E", group = "less")]
    pub error: Option<f64>,
}

/// How payloads are compressed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub enum CompressionArg {
    /// LZ4, quick to write and to read
    #[default]
    Lz4,
    /// Not at all, for file systems that compress by themselves
    None,
    /// A range coder: a quarter to a half of the bytes of lz4, a millisecond or so to write or read a brick
    Range,
}

impl From<CompressionArg> for Compression {
    fn from(compression: CompressionArg) -> Compression {
        match compression {
            CompressionArg::Lz4 => Compression::Lz4,
            CompressionArg::None => Compression::None,
            CompressionArg::Range => Compression::Range,
        }
    }
}

/// How payloads stand in the file.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub enum OrderArg {
    /// As a build writes them, neighbours near each other
    #[default]
    Build,
    /// Coarse levels first, for stores on web servers: a coarse picture takes a few requests
    Level,
}

impl From<OrderArg> for RecordOrder {
    fn from(order: OrderArg) -> RecordOrder {
        match order {
            OrderArg::Build => RecordOrder::Build,
            OrderArg::Level => RecordOrder::Level,
        }
    }
}

/// Write a store with its payloads compressed in another way, or in another order
#[derive(Args)]
#[command(after_help = "\
Bricks are the same in each, and so is every answer, to the last byte; `cache diff` finds the stores equal. A store of \
this version gets the bytes that `build` with the same --compression gives. range is for stores that are kept or sent: \
programs of before it refuse to read them, and `mesh` takes about twice the time.

--order alone leaves payloads as they are compressed; `compact` brings back the order of a build.

Examples:
  brickfield cache repack part.brf -o archived.brf --compression range
  brickfield cache repack part.brf -o plain.brf --compression none
  brickfield cache repack part.brf -o served.brf --order level")]
pub struct RepackArgs {
    #[command(flatten)]
    pub output: OutputArgs,
    /// How payloads are compressed; lz4 unless --order is given
    #[arg(long, value_enum)]
    pub compression: Option<CompressionArg>,
    /// In which order payloads stand in the file; that of a build by default
    #[arg(long, value_enum)]
    pub order: Option<OrderArg>,
}

/// Join the shards that several runs of `build --shard` have made
#[derive(Args)]
#[command(after_help = "\
The store has the same bytes as one that was built without --shard, whatever the order of the shards, the machines they were \
built on, and the threads and memory these had.

All shards must be given at once. They must be of the same input, named alike, built with the same settings by the same \
version. Every record is checked before it is copied. The shards stay.

Example:
  brickfield cache merge part-*.brf -o part.brf")]
pub struct MergeArgs {
    /// All shards, in any order
    #[arg(required = true, value_name = "SHARE.brf")]
    pub shards: Vec<PathBuf>,
    /// The store to write
    #[arg(long, short, value_name = "PART.brf")]
    pub output: PathBuf,
    /// Print the summary as JSON
    #[arg(long)]
    pub json: bool,
    /// Show no progress and no summary (--json still prints)
    #[arg(long, short)]
    pub quiet: bool,
    /// How to show progress on standard error
    #[arg(long, value_enum, default_value_t)]
    pub progress: ProgressArg,
}

/// Compare two stores: their metadata, trees, samples, Hermite edges and lists of beads
#[derive(Args)]
#[command(after_help = "\
How records are compressed and where they lie makes no difference. Samples of two nodes are compared where both stores have \
the node; Hermite edges where it is a leaf of both and the same samples are inside.

Exit status: 0 equal, 1 they \
differ (what differs on standard output, one line on standard error) or one of them cannot be read (standard error alone), \
2 wrong usage.

Example:
  brickfield cache diff part.brf other.brf --ignore-metadata")]
pub struct DiffArgs {
    /// A store, also a shard of one or an unfinished one
    #[arg(value_name = "A.brf")]
    pub first: PathBuf,
    /// Another
    #[arg(value_name = "B.brf")]
    pub second: PathBuf,
    /// Let metadata differ: inputs, settings, program
    #[arg(long)]
    pub ignore_metadata: bool,
    /// How to read the stores
    #[arg(long, value_enum, default_value_t)]
    pub io: IoArg,
    /// Print it as JSON
    #[arg(long)]
    pub json: bool,
    #[command(flatten)]
    pub work: WorkArgs,
}
