//! What the user types. The commands turn it into checked plans.

use crate::cache_args::{CacheArgs, CompressionArg};
use crate::clouds::CloudRoomArgs;
use crate::csg_args::CsgArgs;
use crate::devices::{BackendArgs, DeviceCheckArg};
use crate::distance_args::{DeviationArgs, OffsetArgs, ThicknessArgs};
use crate::kinds::{inputs_of_build, inputs_of_winding};
use crate::layer_args::{LayersArgs, OverlapArgs};
use crate::machine_args::MachineArgs;
pub use crate::mesh_args::{MeshArgs, OriginArg};
use crate::picture_args::{RenderArgs, SliceArgs};
use crate::pieces::OrientArg;
use crate::shell_args::{CompletionsArgs, ManArgs};
use crate::splat_args::SplatsArgs;
use crate::toolpaths::ToolpathArgs;
use crate::units::{GwnError, Length, ShardArg, Size, Tolerance, Unit};
use crate::view_args::WindowArgs;
use crate::void_args::VoidsArgs;
use crate::work::{ProgressArg, WorkArgs};
use brickfield_engine::brick::Count;
use brickfield_engine::contour::listed_mesh_endings;
use clap::{Args, Parser, Subcommand, ValueEnum};
use std::path::PathBuf;

/// Exact unions of huge toolpaths and meshes: build a store once, and answer from it
#[derive(Parser)]
#[command(name = "brickfield", version, max_term_width = 110)]
#[command(
    after_help = "A store may lie on a web server, as in `brickfield info https://example.org/part.brf`, where the program was built with \
--features http.

Exit status: 0 done, 1 failed (one line on standard error says why), 2 wrong usage, 130 ended by Ctrl-C.

Examples:
  brickfield build part.stl -o part.brf
  brickfield mesh part.brf -o union.stl
  brickfield slice part.brf --z 12.3mm -o section.png
  brickfield build --help"
)]
pub struct Cli {
    #[command(subcommand)]
    pub command: Command,
}

#[derive(Subcommand)]
pub enum Command {
    Build(BuildArgs),
    Beads(BeadsArgs),
    Mesh(MeshArgs),
    Info(InfoArgs),
    Sample(SampleArgs),
    Winding(WindingArgs),
    Export(ExportArgs),
    Splats(SplatsArgs),
    Voids(VoidsArgs),
    Layers(LayersArgs),
    Overlap(OverlapArgs),
    Thickness(ThicknessArgs),
    Deviation(DeviationArgs),
    Offset(OffsetArgs),
    Csg(CsgArgs),
    Machine(MachineArgs),
    Slice(SliceArgs),
    Render(RenderArgs),
    View(WindowArgs),
    Verify(VerifyArgs),
    Cache(CacheArgs),
    Completions(CompletionsArgs),
    Man(ManArgs),
}

/// Build a store from meshes and toolpaths, all of them together as one soup
#[derive(Args)]
#[command(after_help = "\
Without --depth and --cell the store gets depth 4: 512 cells along the longest side. Each level more has twice \
the cells along a side and takes about four times the time and space. 

Of toolpaths the cells are then at most 0.4 of the least bead height and width, leaving out the least 1 % of the deposited \
length. They are never in step with the layers. What a build of toolpaths will take is told before it begins.

Point clouds are PLY without faces, PCD, LAS, LAZ (also COPC), E57, or text with a point a line (.xyz, .pts, .asc). Columns of \
text have names, or are understood by their numbers. E57 is read in mm; LAS says no unit, so give --unit.

Clouds need normals, or --estimate-normals. Every point counts as a dipole with the area that its nearest neighbours leave \
it, spread over a small ball. Beside meshes their winding numbers add up.

Without --depth and --cell the cells are at most as large as the points are apart, beside meshes about half as large.

A volume keeps its own lattice, so its steps are the cells. Arrays are indexed [z, y, x], and a .json beside them tells `origin`, `spacing` and `unit`, as `export` writes it. MetaImage tells that itself.

A build that is interrupted, killed, or runs out of disk leaves PART.brf.part and PART.brf.journal. The same command \
reads the input again and goes on from there, to the same bytes; `info` and `verify` read the unfinished file.

Examples:
  brickfield build part.stl -o part.brf
  brickfield build body.stl lid.stl -o part.brf --cell 0.05mm --mesh union.stl
  brickfield build part.gcode -o part.brf --skip auto
  brickfield build scan.mha -o scan.brf --threshold 32000
  brickfield build part.stl -o part-2.brf --shard 2/4; brickfield cache merge part-?.brf -o part.brf")]
pub struct BuildArgs {
    #[arg(required = true, value_name = "INPUT", help = inputs_of_build())]
    pub inputs: Vec<PathBuf>,
    /// The store to write; with --plan the plan, PART.plan
    #[arg(long, short, value_name = "PART.brf")]
    pub output: PathBuf,
    /// What beads become: analytic solids, whose samples count passes or beads, or swept triangles. By default solids,
    /// where all inputs are toolpaths and --bead-section is stadium or ellipse
    #[arg(long, alias = "beads", value_enum)]
    pub beads_as: Option<BeadsArg>,
    /// What the values of a volume are [default: what its description says, else w]
    #[arg(long, value_enum)]
    pub volume_as: Option<VolumeArg>,
    /// Take what has this value and more for solid in a volume, as grey values of computed tomography
    #[arg(long, value_name = "VALUE", conflicts_with = "volume_as", allow_hyphen_values = true)]
    pub threshold: Option<f64>,
    /// Which grid or array of a volume with several is read, by its name (`info` lists them) [default: the first of numbers]
    #[arg(long, value_name = "NAME")]
    pub field: Option<String>,
    /// What w counts of beads as solids. The union of all does not depend on it [default: passes]
    #[arg(long, value_enum)]
    pub count: Option<CountArg>,
    /// Record in every leaf which beads and passes touch it, so that `sample --beads` can name those at a point
    #[arg(long)]
    pub identity: bool,
    /// Levels below the root: 32·2^L cells along the longest side [default: 4; of beads as solids by their least size; of point clouds by their spacing]
    #[arg(long, value_name = "L", conflicts_with = "cell",
          value_parser = clap::value_parser!(u8).range(0..=i64::from(brickfield_engine::lattice::MAX_LEVEL)))]
    pub depth: Option<u8>,
    /// Size of the finest cells instead, as in 0.05mm; a bare number is in the input's own unit
    #[arg(long, value_name = "LENGTH")]
    pub cell: Option<Length>,
    /// Lay the lattice of another store under this one, with its depth, so that the two can be compared sample by sample, as
    /// by `voids --cad`
    #[arg(long, value_name = "PART.brf", conflicts_with_all = ["depth", "cell"])]
    pub like: Option<PathBuf>,
    /// Divide bricks further, down to this depth, where a wall or a gap thinner than a cell hides between samples, and nowhere
    /// else
    ///
    /// So a thin plate in a large part comes out whole for little more than its own area. Of closed meshes and toolpaths.
    #[arg(long, value_name = "M", conflicts_with_all = ["thin", "boundary_error", "stddev", "refine"],
          value_parser = clap::value_parser!(u8).range(0..=i64::from(brickfield_engine::lattice::MAX_LEVEL)))]
    pub max_depth: Option<u8>,
    /// The same by the number of levels below all other bricks, as in 3 or +3
    #[arg(long, value_name = "K", conflicts_with_all = ["boundary_error", "stddev", "refine"],
          value_parser = clap::value_parser!(u8).range(1..=i64::from(brickfield_engine::lattice::MAX_LEVEL)))]
    pub thin: Option<u8>,
    /// Keep a brick undivided if its samples deviate no more than this from their mean
    #[arg(long, value_name = "T", default_value_t = 0.0)]
    pub stddev: f64,
    /// Keep a brick undivided if the boundary w = 0.5 in it is no farther than this from the mesh of its own cells, as
    /// in 0.05mm [default: 0, which divides every brick that a facet touches]
    ///
    /// So there are few bricks where the surface is flat. What lies inside of the boundary does not count, so overlaps
    /// may be left coarse. Walls, gaps, cavities and small bodies are found however thin, except low bumps within this
    /// of the mesh.
    ///
    /// The mesh is then within this and 0.1 cell of the boundary, both ways and at the 99.9th percentile; or it is at most that
    /// much farther than the mesh of the store without this. There is no bound on the maximum. Of closed meshes only, without
    /// --stddev and another --refine.
    #[arg(long, alias = "tolerance", value_name = "LENGTH", default_value = "0", hide_default_value = true)]
    pub boundary_error: Tolerance,
    /// Largest error of the samples where the input is open or a point cloud; 2.5e-4 to 0.5. Those of closed input are
    /// exact [default: 0.001; of point clouds 0.05]
    #[arg(long, value_name = "E")]
    pub gwn_error: Option<GwnError>,
    /// Find the normals of a point cloud from 16 neighbours each, turned outward along a spanning tree
    #[arg(long)]
    pub estimate_normals: bool,
    /// Turn pieces that are inside out, connected ones as a whole: outward by their own signed volume, but for cavities,
    /// which lie inside others
    ///
    /// With `all`, for soups without any consistency, facets are first turned so that those of a piece face one side, from
    /// edge to edge. Open pieces have no volume and are left. It takes some 80 bytes of memory a facet.
    #[arg(long, value_enum, value_name = "HOW", num_args = 0..=1, require_equals = true,
          default_missing_value = "pieces")]
    pub orient: Option<OrientArg>,
    /// Where to divide bricks
    #[arg(long, value_enum, default_value_t)]
    pub refine: RefineArg,
    #[command(flatten)]
    pub backend: BackendArgs,
    /// Which bricks of a device the processor computes as well, to compare them
    ///
    /// After a difference the device is dropped, and the build begins anew on the processor. `some` is one in 256 and the first
    /// of each kernel: a fault in 1,180 bricks or more escapes once in a hundred builds. With `all` no wrong brick is written,
    /// in a longer time than without the device.
    #[arg(long, value_enum, value_name = "WHICH", default_value_t)]
    pub device_check: DeviceCheckArg,
    /// The unit of the input's coordinates [default: mm]. Of toolpaths, for programs without G20 or G21, in the place of what
    /// their header says; their store is in mm
    #[arg(long, alias = "units", value_enum)]
    pub unit: Option<Unit>,
    /// Memory to stay within, as in 4GiB, maps of files not counted; by default half of what the machine has
    ///
    /// Meshes that do not fit go to a temporary file, and point clouds but for 24 bytes a point. Toolpaths as solids, and the
    /// triangles that close an open mesh, stay in memory, and are refused if they do not fit. So does the input of
    /// --boundary-error, --stddev and another --refine.
    ///
    /// A build whose index, 32 bytes a node, does not fit stops, and goes on with more memory from there.
    #[arg(long, value_name = "SIZE")]
    pub memory: Option<Size>,
    /// Folder of the temporary files, which have no names there and vanish with the program; the output's own by default
    #[arg(long, value_name = "DIR")]
    pub temp_dir: Option<PathBuf>,
    /// Build shard I of N of the store, I from 1, to be joined with the others by `cache merge`
    ///
    /// It is the same store, made on several machines. Each reads the whole input, or what it needs of a plan. Shards have about the
    /// same work, foreseen from the input, and some may be empty.
    #[arg(long, value_name = "I/N", conflicts_with = "mesh")]
    pub shard: Option<ShardArg>,
    /// Write a plan in the place of a store: the triangles by cube, and what all shards have in common
    ///
    /// Shards that are built from the plan, with the plan as their input, need neither the meshes nor their settings, and read
    /// their own cubes alone. Of closed meshes. The plan takes about half of the space of a binary STL.
    #[arg(long, conflicts_with_all = ["shard", "mesh", "compression"])]
    pub plan: bool,
    /// How the bricks are compressed
    ///
    /// The store has the bytes that `cache repack` with the same option makes of one with another. Shards take lz4, to be
    /// repacked when they are joined.
    #[arg(long, value_enum, default_value_t)]
    pub compression: CompressionArg,
    /// Seconds after which what there is of the store is made safe, again and again: what a crash may cost
    #[arg(long, value_name = "SECONDS", default_value_t = 10.0)]
    pub commit_every: f64,
    /// Begin anew, whatever an unfinished store of that name holds
    #[arg(long)]
    pub restart: bool,
    #[arg(long, value_name = "OUT", help = format!("Also write the boundary mesh, w = 0.5, as {}", listed_mesh_endings(" or ")))]
    pub mesh: Option<PathBuf>,
    /// Count the coordinates of --mesh from another origin, as in `mesh --origin`: `auto` or x,y,z
    #[arg(long, value_name = "ORIGIN", requires = "mesh", allow_hyphen_values = true)]
    pub origin: Option<OriginArg>,
    /// Print the summary as JSON
    #[arg(long)]
    pub json: bool,
    /// Threads to work with; all processors by default. The store does not depend on it
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub threads: Option<u16>,
    /// Show no progress and no summary (--json still prints)
    #[arg(long, short)]
    pub quiet: bool,
    /// How to show progress on standard error
    #[arg(long, value_enum, default_value_t)]
    pub progress: ProgressArg,
    #[command(flatten)]
    pub toolpath: ToolpathArgs,
}

/// Write the beads of toolpaths as closed tubes: triangles, or X3D Extrusions
#[derive(Args)]
#[command(after_help = "\
Tubes overlap where beads do, and at sharp bends, where two tubes with round ends meet: `build` takes them as they \
are. Beads pass through one by one, so memory does not grow with the part.

Example:
  brickfield beads part.gcode -o beads.stl --sides 14 --skip auto")]
pub struct BeadsArgs {
    /// Toolpaths: G-code, also compressed as .gz or .xz
    #[arg(required = true, value_name = "INPUT")]
    pub inputs: Vec<PathBuf>,
    /// The file to write, in mm: .stl (binary) or .x3d, Extrusions that take a tenth of the space
    #[arg(long, short, value_name = "OUT")]
    pub output: PathBuf,
    /// Print the summary as JSON
    #[arg(long)]
    pub json: bool,
    #[command(flatten)]
    pub work: WorkArgs,
    /// The unit of programs without G20 or G21 [default: as their header says, or mm]
    #[arg(long, alias = "units", value_enum)]
    pub unit: Option<Unit>,
    #[command(flatten)]
    pub toolpath: ToolpathArgs,
}

/// How stores are read.
#[derive(Clone, Copy, Debug, Default, ValueEnum)]
pub enum IoArg {
    /// By positioned reads: a file that is cut short, or a network that fails, is an error
    #[default]
    Pread,
    /// Through a memory map: such a file is an error too; quicker where bricks are small and all in memory
    Mmap,
}

/// How cells become triangles.
#[derive(Clone, Copy, Debug, Default, ValueEnum)]
pub enum MethodArg {
    /// Manifold dual contouring: sharp edges, no triangles that meet, bricks of any levels
    #[default]
    Dual,
    /// Marching cubes, for comparison: edges of the part are cut off within cells; bricks of one level at the surface
    Mc,
}

/// The criterion by which bricks are divided.
#[derive(Clone, Copy, Debug, Default, ValueEnum)]
pub enum RefineArg {
    /// Where samples deviate, and where facets hide between them: no wall or gap is missed
    #[default]
    Hidden,
    /// On the deviation of the samples alone
    Stddev,
    /// Only where the boundary w = 0.5 passes
    Surface,
}

/// What beads become.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum BeadsArg {
    /// Solids with exact formulas and round joints; w counts passes or beads, see --count
    Analytic,
    /// Triangles swept along the path; w counts tubes, of which a bead with sharp bends has several
    Mesh,
}

/// What samples of beads as solids count.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum CountArg {
    /// Stretches of a bead that do not come back onto themselves: lines of infill, turns of a spiral, a line that is
    /// retraced. So w ≥ 2 wherever material overlaps, but for corners
    Passes,
    /// Runs of deposition without travel, whatever their path: w ≥ 2 where different ones overlap
    Beads,
}

impl From<CountArg> for Count {
    fn from(count: CountArg) -> Count {
        match count {
            CountArg::Passes => Count::Passes,
            CountArg::Beads => Count::Beads,
        }
    }
}

/// Say what is in a store, or in any input
#[derive(Args)]
#[command(after_help = "\
Of a mesh: area, volume, how many connected pieces there are, and which are inside out; whether it is closed. If not, it \
tells how many open edges there are, into how many loops they fall, and how many patches face the wrong way.

Such a patch has a border along which facets run the same way; those of doubled sheets count.

Of a toolpath: beads, layers, features, lengths, volumes, sizes, and by which firmware's rules it was read.

Of a point cloud: what its columns hold, how far points are apart, its normals, and what `build` would make of it.

Of X3D: the Extrusions, each with its DEF name, facets, bounds, and whether it is closed. Of 3MF: the unit, the objects and \
what is built of them. Of any other file: what it is.

Examples:
  brickfield info part.brf --volume
  brickfield info part.gcode
  brickfield info --devices")]
pub struct InfoArgs {
    /// The store, mesh, toolpath, point cloud, X3D or 3MF file
    #[arg(value_name = "PART.brf|INPUT", required_unless_present = "devices")]
    pub file: Option<PathBuf>,
    /// List the Vulkan devices of this machine instead
    #[arg(long, conflicts_with_all = ["file", "volume"])]
    pub devices: bool,
    /// Also read all leaves for the volume of the union and of what overlaps. Volumes by the source, with three standard errors,
    /// are nearer than those by samples and crossings, with a bound
    #[arg(long)]
    pub volume: bool,
    /// How to read the store
    #[arg(long, value_enum, default_value_t)]
    pub io: IoArg,
    /// Print it as JSON
    #[arg(long)]
    pub json: bool,
    /// Threads to work with; all processors by default. Results do not depend on it
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub threads: Option<u16>,
    /// The unit of programs without G20 or G21 [default: as their header says, or mm]
    #[arg(long, alias = "units", value_enum)]
    pub unit: Option<Unit>,
    #[command(flatten)]
    pub toolpath: ToolpathArgs,
    #[command(flatten)]
    pub room: CloudRoomArgs,
}

/// Print w at points, from a store
#[derive(Args)]
#[command(after_help = "\
w is interpolated trilinearly between the samples of the finest brick at the point, and is 0 outside the root \
cube. Printed as the lines x,y,z,w under a header.

Examples:
  brickfield sample part.brf --points points.csv
  echo 12.5,3,0.2 | brickfield sample part.brf --points - --beads")]
pub struct SampleArgs {
    /// The store
    #[arg(value_name = "PART.brf")]
    pub store: PathBuf,
    /// Points as lines x,y,z in the store's unit; - reads standard input. A header line, empty lines and lines
    /// that begin with # are skipped
    #[arg(long, value_name = "P.csv")]
    pub points: PathBuf,
    /// Also print which beads cover each point, from a store built with --identity: how many, and of each its
    /// bead.pass:source:layer:tool:first-last:feature. Layers count from 1, sources from 0; first and last are lines of the file
    #[arg(long)]
    pub beads: bool,
    /// How to read the store
    #[arg(long, value_enum, default_value_t)]
    pub io: IoArg,
    /// Print a JSON object a line instead of CSV
    #[arg(long)]
    pub json: bool,
    #[command(flatten)]
    pub work: WorkArgs,
}

/// Print w at points, straight from meshes, toolpaths and point clouds
#[derive(Args)]
#[command(after_help = "\
For closed meshes crossings are counted, and w is an exact integer. Open ones are closed by caps, whose solid \
angles are then taken off again, with an error of at most --gwn-error. Facets and points are snapped to the \
lattice that `build` uses.

A point cloud is PLY without faces, or text with a point a line. It needs normals, or --estimate-normals. Every point counts \
as a dipole with the area that its nearest neighbours leave it, spread over a small ball. Beside meshes both are added up.

Examples:
  brickfield winding part.stl --points points.csv
  echo 12.5,3,0.2 | brickfield winding part.stl --points - --brute")]
pub struct WindingArgs {
    #[arg(required = true, value_name = "INPUT", help = inputs_of_winding())]
    pub inputs: Vec<PathBuf>,
    /// Points as lines x,y,z in the input's unit; - reads standard input. A header line, empty lines and lines
    /// that begin with # are skipped
    #[arg(long, value_name = "P.csv")]
    pub points: PathBuf,
    /// What beads become, as in `build`
    #[arg(long, alias = "beads", value_enum)]
    pub beads_as: Option<BeadsArg>,
    /// What w counts of beads as solids, as in `build` [default: passes]
    #[arg(long, value_enum)]
    pub count: Option<CountArg>,
    /// Largest error of w where the input is open or a point cloud; 1e-6 to 0.5
    #[arg(long, value_name = "E", default_value_t = GwnError(1e-3))]
    pub gwn_error: GwnError,
    /// Find the normals of a point cloud from 16 neighbours each, turned outward along a spanning tree
    #[arg(long)]
    pub estimate_normals: bool,
    /// Turn pieces that are inside out, connected ones as a whole: outward by their own signed volume, but for cavities,
    /// which lie inside others
    ///
    /// With `all`, for soups without any consistency, facets are first turned so that those of a piece face one side, from
    /// edge to edge. Open pieces have no volume and are left. It takes some 80 bytes of memory a facet.
    #[arg(long, value_enum, value_name = "HOW", num_args = 0..=1, require_equals = true,
          default_missing_value = "pieces")]
    pub orient: Option<OrientArg>,
    /// Sum the solid angles of all facets in double precision instead; slow. With --backend vulkan in single precision
    /// on the device. For beads as solids: evaluate their formulas at the points themselves, off the lattice
    #[arg(long)]
    pub brute: bool,
    #[command(flatten)]
    pub backend: BackendArgs,
    /// Print a JSON object a line instead of CSV
    #[arg(long)]
    pub json: bool,
    #[command(flatten)]
    pub work: WorkArgs,
    /// The unit of programs without G20 or G21 [default: as their header says, or mm]
    #[arg(long, alias = "units", value_enum)]
    pub unit: Option<Unit>,
    #[command(flatten)]
    pub toolpath: ToolpathArgs,
    #[command(flatten)]
    pub room: CloudRoomArgs,
}

/// Write levels as a volume that other tools open
#[derive(Args)]
#[command(after_help = "\
The ending says the format.
  .npy          NumPy, indexed [z,y,x]; W.json beside it says where it lies
  .vdb          OpenVDB, for Blender, Houdini and F3D: a fog volume, sparse
  .vtkhdf       VTKHDF, for ParaView and VTK: an overlapping AMR image, sparse, of all levels
  .zarr         OME-Zarr 0.5, for napari, neuroglancer and Dask: a folder, sparse, of all levels
  .vti          VTK image data, compressed
  .mhd, .mha    MetaImage, for 3D Slicer and ITK: with W.raw beside it, or in one file
  .tif          TIFF, a page a layer, for ImageJ and programs for computed tomography
  .raw          the samples alone; W.json beside it

A level has 32·2^L samples an axis, x fastest. W.json has `origin`, the world coordinates of the sample [0,0,0], \
`spacing`, the step along every axis, and `unit`. If the power goes while two files get their names, W.json may be missing, \
but it is never that of another array.

Bricks that end above the level fill it from their own samples: exactly where all of them are equal, otherwise \
the nearest lower sample for i2 and trilinear interpolation for f4.

Examples:
  brickfield export part.brf -o part.vdb
  brickfield export part.brf --level 3 -o w.npy
  brickfield export part.brf --as sdf -o part.vdb
  brickfield export part.brf -o part.vtkhdf --dtype f4")]
pub struct ExportArgs {
    /// The store
    #[arg(value_name = "PART.brf")]
    pub store: PathBuf,
    /// The level, 0 being the root's 32 samples an axis [default: the deepest; .vtkhdf and .zarr hold all]
    #[arg(long, value_name = "L", conflicts_with = "all_levels")]
    pub level: Option<u8>,
    /// Write all levels; in .vdb as grids `w`, `w_1` and so on, the finest first
    #[arg(long)]
    pub all_levels: bool,
    /// The volume to write: .npy, .vdb, .vtkhdf, .zarr, .vti, .mhd, .mha, .tif or .raw
    #[arg(long, short, value_name = "W.npy")]
    pub output: PathBuf,
    /// What to write
    #[arg(long = "as", value_enum, value_name = "WHAT", default_value_t)]
    pub quantity: QuantityArg,
    /// Type of the values [default: i2; f4 in .vdb, and where samples are fractions, as of open input and point clouds]
    #[arg(long, value_enum)]
    pub dtype: Option<DtypeArg>,
    /// How to read the store
    #[arg(long, value_enum, default_value_t)]
    pub io: IoArg,
    /// Print what was written as JSON
    #[arg(long)]
    pub json: bool,
    #[command(flatten)]
    pub work: WorkArgs,
}

/// What the values of a volume that is read are.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum VolumeArg {
    /// Winding numbers, or shares of solid: solid from 0.5 on
    W,
    /// Signed distances: solid below 0
    Sdf,
}

/// What the samples of a volume are.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub enum QuantityArg {
    /// Winding numbers
    #[default]
    W,
    /// Signed distances from the surface, below 0 inside, in the unit of the store: a level set. Three steps away and
    /// farther they are ±3 steps
    Sdf,
}

/// NumPy's names of the element types.
#[derive(Clone, Copy, Debug, ValueEnum)]
pub enum DtypeArg {
    /// 16-bit integers; fractions are rounded
    I2,
    /// 32-bit floats
    F4,
}

/// Read every record of a store; status 0 only if all is sound
#[derive(Args)]
#[command(after_help = "\
Examples:
  brickfield verify part.brf
  brickfield cache verify part.brf    # the same")]
pub struct VerifyArgs {
    /// The store
    #[arg(value_name = "PART.brf")]
    pub store: PathBuf,
    /// How to read the store
    #[arg(long, value_enum, default_value_t)]
    pub io: IoArg,
    /// Print the report as JSON
    #[arg(long)]
    pub json: bool,
    #[command(flatten)]
    pub work: WorkArgs,
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::CommandFactory;

    #[test]
    fn the_arguments_are_consistent() {
        Cli::command().debug_assert();
    }
}
