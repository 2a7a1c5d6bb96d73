//! What the user types for wall thickness, offsets and deviations.

use crate::args::{IoArg, OriginArg};
use crate::units::{Length, Position, Size};
use crate::work::WorkArgs;
use brickfield_engine::distance::Align;
use clap::{Args, ValueEnum};
use std::path::PathBuf;

/// Measure how thick walls are, or how wide gaps, at every vertex of the mesh
#[derive(Args)]
#[command(after_help = "\
By sphere, thickness is the diameter of the largest ball inside the part that touches the point and holds no surface. Surface \
whose normal is turned by less than --separation against that at the point does not count.

So a wall has its thickness up to its edges, and edges do not count as thin. With --separation 0 every edge is as thin as it is \
sharp.

By ray, it is the way against the normal to the opposite surface. Where a ray meets nothing for a crack, a ball is taken.

Vertices are moved onto the surface first. On an edge they count as points of one of its sides. What has nothing opposite, as \
gaps at the outside, is NaN. Thickness of four cells and more is right to a hundredth of a cell and 0.5 %, but at corners that \
no cell resolves.

Regions are connected surface, measured at every crossing of the lattice, both sides of a wall together: `area` is that of all \
sides, `volume` half of the integral of thickness over it. The largest comes first.

With --volume every sample inside gets its local thickness: the diameter of the largest ball in the part that holds the sample (Hildebrand & Rüegsegger 1997). --method and --separation change nothing of it. Samples outside are 0. With --gaps it is told of what is outside, up to --widest. The summary tells mean and standard deviation over the volume.

With --points the same is told of points beside the surface, each moved to the nearest place of it. A point farther than four cells \
from it has no number, as what has nothing opposite.

The part must be closed: open meshes and point clouds are refused. Values are in the store's unit.

Examples:
  brickfield thickness part.brf -o thickness.ply
  brickfield thickness part.brf --points places.csv
  brickfield thickness part.brf --volume thickness.vdb
  brickfield thickness part.brf -o thickness.ply --below 0.8mm --regions thin.csv")]
pub struct ThicknessArgs {
    /// The store
    #[arg(value_name = "PART.brf")]
    pub store: PathBuf,
    /// The mesh to write, whose vertices have the property thickness; its name ends in .ply, .vtp or .glb
    #[arg(long, short, value_name = "T.ply", required_unless_present_any = ["volume", "points"])]
    pub output: Option<PathBuf>,
    /// Measure at these points instead, and print x,y,z,thickness; lines x,y,z in the store's unit, - reads standard input
    #[arg(long, value_name = "P.csv", conflicts_with_all = ["output", "volume", "regions"])]
    pub points: Option<PathBuf>,
    /// Also write local thickness as a volume: .npy, .vdb, .vtkhdf, .zarr, .vti, .mhd, .mha, .tif or .raw
    #[arg(long, value_name = "T.vdb")]
    pub volume: Option<PathBuf>,
    /// The level of the volume, the deepest by default
    #[arg(long, value_name = "L", requires = "volume")]
    pub level: Option<u8>,
    /// With --gaps and --volume: what is wider than this counts as free space, and has the number 0
    #[arg(long, value_name = "LEN", requires_all = ["gaps", "volume"])]
    pub widest: Option<Length>,
    /// What thickness is
    #[arg(long = "method", value_enum, default_value_t)]
    pub measure: MeasureArg,
    /// Surface whose normal is turned by less than this many degrees does not bound balls; 0 to 180
    #[arg(long, value_name = "ANGLE", default_value_t = 100.0, value_parser = angle)]
    pub separation: f64,
    /// Measure gaps outside of the part instead of walls
    #[arg(long)]
    pub gaps: bool,
    /// List what is thinner than this, as in 0.8mm, in the table of --regions
    #[arg(long, value_name = "LEN", requires = "regions")]
    pub below: Option<Length>,
    /// The table of regions thinner than --below; its name ends in .csv or .json
    #[arg(long, value_name = "R.csv|.json", requires_all = ["below", "output"])]
    pub regions: Option<PathBuf>,
    /// Count coordinates of the mesh from another origin, as in `mesh --origin`: `auto` or x,y,z
    #[arg(long, value_name = "ORIGIN", requires = "output", allow_hyphen_values = true)]
    pub origin: Option<OriginArg>,
    #[command(flatten)]
    pub surface: SurfaceArgs,
    /// Print counts, percentiles, a histogram and the regions as JSON; points as JSON lines
    #[arg(long)]
    pub json: bool,
    #[command(flatten)]
    pub work: WorkArgs,
}

/// How the surface of a store is made.
#[derive(Args)]
pub struct SurfaceArgs {
    /// Memory for the surface and for bricks, as in 512MiB; what of the surface does not fit goes to a temporary file
    #[arg(long, value_name = "SIZE", default_value = "1GiB")]
    pub memory: Size,
    /// Folder of that file, which has no name there; the output's own by default
    #[arg(long, value_name = "DIR")]
    pub temp_dir: Option<PathBuf>,
    /// How to read the store
    #[arg(long, value_enum, default_value_t)]
    pub io: IoArg,
}

/// What thickness is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub enum MeasureArg {
    /// Diameter of the largest ball inside that touches the point
    #[default]
    Sphere,
    /// Way against the normal to the opposite surface
    Ray,
}

/// A number from 0 to 180.
pub fn angle(text: &str) -> Result<f64, String> {
    let number = text.parse::<f64>().ok().filter(|number| (0.0..=180.0).contains(number));
    number.ok_or_else(|| "is no number from 0 to 180".to_owned())
}

/// A number from 1 to 100.
pub fn limit(text: &str) -> Result<f64, String> {
    let number = text.parse::<f64>().ok().filter(|number| (1.0..=100.0).contains(number));
    number.ok_or_else(|| "is no number from 1 to 100".to_owned())
}

/// Grow or shrink a part by a length, or hollow it: a new store
#[derive(Args)]
#[command(after_help = "\
The new store has the lattice of the old one, in a larger root where it would not fit, and exact crossings of its own. Growing \
makes edges round, shrinking keeps them sharp. Meshes of it are closed and free of self-intersections like all.

With --sharp edges that turn by 20 degrees and more are mitred: the faces beside them are extended up to where they meet, as far as --mitre-limit allows. So a grown cube is a cube. An edge of 29 degrees and more is whole with a limit of 4.

With --shell the part is hollowed: what is left is what lies within the length of its surface.

Where a surface is smooth, the new one is off by less than 0.02 cells. What the old lattice does not resolve, the new one does \
not, either. The part must be closed: open meshes and point clouds are refused.

Examples:
  brickfield offset part.brf --by 0.4mm -o larger.brf
  brickfield offset part.brf --by 0.4mm --sharp -o larger.brf
  brickfield offset part.brf --by -0.4mm -o smaller.brf
  brickfield offset part.brf --shell 2mm -o hollow.brf")]
pub struct OffsetArgs {
    /// The store
    #[arg(value_name = "PART.brf")]
    pub store: PathBuf,
    /// How far outward; below 0 inward, as in -0.4mm
    #[arg(long, value_name = "LEN", allow_hyphen_values = true, required_unless_present = "shell")]
    pub by: Option<Position>,
    /// Keep what lies within this of the surface instead
    #[arg(long, value_name = "LEN", conflicts_with = "by")]
    pub shell: Option<Length>,
    /// Keep convex edges sharp: faces are extended up to where they meet
    #[arg(long, conflicts_with = "shell")]
    pub sharp: bool,
    /// With --sharp: how far from the edge extended faces reach at most, in multiples of the length; beyond they are round
    #[arg(long, value_name = "N", default_value_t = 4.0, value_parser = limit, requires = "sharp")]
    pub mitre_limit: f64,
    /// The store to write
    #[arg(long, short, value_name = "OUT.brf")]
    pub output: PathBuf,
    #[command(flatten)]
    pub surface: SurfaceArgs,
    /// Print counts as JSON
    #[arg(long)]
    pub json: bool,
    #[command(flatten)]
    pub work: WorkArgs,
}

/// Compare a part with a mesh, another store, or measured points: signed distances both ways
#[derive(Args)]
#[command(after_help = "\
The mesh that is written has at each vertex its distance from the reference, above 0 outside of it.

Distances from a mesh are those from its triangles, with signs by its winding number where it is closed; of an open one the \
nearest triangle tells the side. Distances from a store are those from its surface, right to about 0.01 cells where it is smooth.

Back, points of the reference are compared with the part: corners of its triangles and points spread by area, the crossings \
of a store, or the points of a cloud.

Points may show some of the part, in any order and without normals. The surface around a place is the quadratic form through the 18 \
nearest of them. Vertices where no points were measured have no number (NaN) and count for nothing.

With --within the command fails, with status 1, if any distance either way is larger. --regions lists the connected surface of \
the part that is farther: `over` lies outside of the reference, `under` inside. `volume` is the integral of the distance over the area.

--layers and --features sum up the surface by the bead below it, of several the one deposited last: area, and mean, root of the mean \
square, least and greatest distance, weighted by area. Surface below which no bead is found comes last, without a name.

A part and its CAD model rarely lie at one place. --align shift moves the part for the comparison: middles of boxes first, then \
nearest points. --align icp turns it, too, from there, by up to some 20 degrees.

Where the part differs much it does not count. The mesh stays where the part is.

Examples:
  brickfield deviation part.brf cad.stl -o deviation.ply
  brickfield deviation part.brf scan.xyz -o deviation.ply --align icp
  brickfield deviation part.brf cad.stl -o deviation.ply --align shift --within 0.2mm --regions beyond.csv")]
pub struct DeviationArgs {
    /// The store
    #[arg(value_name = "PART.brf")]
    pub store: PathBuf,
    /// What it should be, or is: a mesh, as .stl, .obj or .ply, a store, or points, as .ply, .pcd, .las, .e57 or .xyz
    #[arg(value_name = "REFERENCE")]
    pub reference: PathBuf,
    /// The mesh to write, whose vertices have the property deviation; its name ends in .ply, .vtp or .glb
    #[arg(long, short, value_name = "D.ply")]
    pub output: PathBuf,
    /// Fail, with status 1, if a distance either way is larger, as in 0.2mm
    #[arg(long = "within", id = "tolerated", value_name = "LEN")]
    pub within: Option<Length>,
    /// The table of regions farther than --within; its name ends in .csv or .json
    #[arg(long, value_name = "R.csv|.json", requires = "tolerated")]
    pub regions: Option<PathBuf>,
    /// The table of deviations by layer, of a part built with --identity; its name ends in .csv or .json
    #[arg(long, value_name = "L.csv|.json")]
    pub layers: Option<PathBuf>,
    /// The same by feature, such as external perimeter
    #[arg(long, value_name = "F.csv|.json")]
    pub features: Option<PathBuf>,
    /// The points of the reference that are compared with the part, each with its deviation; its name ends in .ply. Of a cloud these
    /// are all of its points
    #[arg(long, value_name = "POINTS.ply")]
    pub reference_points: Option<PathBuf>,
    /// How the part is laid over the reference
    #[arg(long, value_enum, default_value_t)]
    pub align: AlignArg,
    /// Count coordinates of the mesh from another origin, as in `mesh --origin`: `auto` or x,y,z
    #[arg(long, value_name = "ORIGIN", allow_hyphen_values = true)]
    pub origin: Option<OriginArg>,
    /// Memory for surfaces, bricks and a reference mesh, as in 512MiB; what does not fit goes to a temporary file
    #[arg(long, value_name = "SIZE", default_value = "1GiB")]
    pub memory: Size,
    /// Folder of that file, which has no name there; the output's own by default
    #[arg(long, value_name = "DIR")]
    pub temp_dir: Option<PathBuf>,
    /// How to read stores
    #[arg(long, value_enum, default_value_t)]
    pub io: IoArg,
    /// Print percentiles both ways, the alignment and the regions as JSON
    #[arg(long)]
    pub json: bool,
    #[command(flatten)]
    pub work: WorkArgs,
}

/// How a part is laid over a reference.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub enum AlignArg {
    /// As it lies
    #[default]
    None,
    /// By a shift
    Shift,
    /// By a rotation and a shift, from nearest points
    Icp,
}

impl From<AlignArg> for Align {
    fn from(align: AlignArg) -> Align {
        match align {
            AlignArg::None => Align::No,
            AlignArg::Shift => Align::Shift,
            AlignArg::Icp => Align::Rigid,
        }
    }
}
