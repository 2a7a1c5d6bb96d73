//! What the user types for `brickfield mesh`.

use crate::args::{IoArg, MethodArg};
use crate::kinds::mesh_formats;
use crate::units::{Length, Size, Tolerance};
use crate::work::WorkArgs;
use brickfield_engine::analysis::BeadAttribute;
use brickfield_engine::contour::listed_mesh_endings;
use clap::builder::{PossibleValuesParser, TypedValueParser};
use clap::{ArgAction, Args, ValueEnum};
use std::path::PathBuf;
use std::str::FromStr;

/// Write a mesh of the surface where the winding number passes a value, or check a mesh
#[derive(Args)]
#[command(after_help = "\
The mesh is closed, manifold and oriented: manifold dual contouring of w = ISO.

--check says of a mesh how many edges and vertices are not those of a closed, oriented manifold. It counts pairs of \
triangles that meet elsewhere than in common edges and vertices. It tells volume, area, shells and genus. All of it is exact, \
without tolerance.

Status 0 if nothing is wrong, 1 otherwise. --check takes about 60 bytes of memory a triangle beside what OBJ and PLY files \
hold.

Examples:
  brickfield mesh part.brf -o part.stl
  brickfield mesh part.brf -o part.stl --check
  brickfield mesh part.brf -o light.stl --triangles 100000
  brickfield mesh part.brf -o tight.stl --close 0.5mm --detail 1mm
  brickfield mesh part.brf -o tiles/tileset.json
  brickfield mesh --check part.stl")]
pub struct MeshArgs {
    #[arg(value_name = "PART.brf|MESH", help = format!("The store; with --check and without -o the mesh to check: {}", mesh_formats()))]
    pub file: PathBuf,
    #[arg(long, short, value_name = "OUT", required_unless_present = "check",
        help = format!("The mesh to write; its ending decides the format: {}; or FOLDER/tileset.json, 3D Tiles of all levels",
            listed_mesh_endings(", ")))]
    pub output: Option<PathBuf>,
    /// Check the mesh that was written, or without -o the one that is given
    #[arg(long)]
    pub check: bool,
    /// Check an OBJ or PLY as if vertices with the same coordinates were one, as is always done with STL
    #[arg(long, requires = "check")]
    pub weld: bool,
    /// Winding number at the surface: 0.5 is the boundary, 1.5 that of where two bodies overlap. In stores of
    /// open input one of 0.5, 1.5, 2.5 and so on [default: 0.5]
    ///
    /// With --detail, --triangles or --max-size it is the fraction of solid at the surface, between 0 and 1, and by default
    /// the one that keeps the volume.
    #[arg(long, value_name = "W", requires = "output", allow_negative_numbers = true)]
    pub iso: Option<f64>,
    /// Draw what is larger than this, as in 0.5mm, and average what is smaller, so that the volume is kept
    ///
    /// The surface lies where a fraction of the space around it is solid, in cells of about LEN. Channels between beads, and
    /// voids and walls thinner than a cell, are averaged away.
    #[arg(long, value_name = "LEN", requires = "output", conflicts_with_all = ["level", "method", "triangles", "max_size"])]
    pub detail: Option<Length>,
    /// Choose the detail so that there are at most so many triangles, and at least nine tenths of them
    #[arg(long, value_name = "N", requires = "output", conflicts_with_all = ["level", "method", "tolerance", "iso"])]
    pub triangles: Option<u64>,
    /// Choose the detail so that the file is at most so large, as in 200MB
    #[arg(long, value_name = "SIZE", requires = "output", conflicts_with_all = ["level", "method", "tolerance", "iso"])]
    pub max_size: Option<Size>,
    /// Deepest level to use; a coarser mesh
    #[arg(long, value_name = "L", requires = "output")]
    pub level: Option<u8>,
    /// How far the surface may move for the sake of fewer triangles, as in 0.05mm; 0 keeps them all
    #[arg(long, value_name = "LEN", default_value = "0", requires = "output")]
    pub tolerance: Tolerance,
    /// Whether to remove triangles of a mesh with a tolerance that meet elsewhere than where they are joined
    ///
    /// It takes one and a half to two and a half times the time. With `no`, one triangle in some hundreds or thousands meets
    /// another. Without a tolerance none meet in any case.
    #[arg(long, action = ArgAction::Set, value_name = "yes|no", default_value = "yes", requires = "output")]
    #[arg(value_parser = PossibleValuesParser::new(["yes", "no"]).map(|answer| answer == "yes"))]
    #[arg(hide_possible_values = true)]
    pub intersection_free: bool,
    /// Fill voids, channels and necks that no ball of this diameter enters, as in 0.5mm, before the mesh is made
    ///
    /// What a ball of this size touches from outside, or from within a larger void, stays as it is. Concave edges become
    /// round. LEN is two of the store's cells at least, and no more than the diagonal of the part. A closed store of about the size of this one stands beside the mesh
    /// meanwhile.
    #[arg(long, value_name = "LEN", requires = "output")]
    pub close: Option<Length>,
    /// Leave out what the part encloses: the boundaries of voids, and pieces that lie in them
    ///
    /// The surface is made first, so the volume that is kept is the one with voids.
    #[arg(long, requires = "output")]
    pub outer: bool,
    /// Leave out all solid pieces but the one of the largest volume, with what these enclose
    #[arg(long, requires = "output")]
    pub keep_largest: bool,
    /// Leave out shells, of voids and of pieces, that enclose less, in the cube of the store's unit
    #[arg(long, value_name = "VOLUME", requires = "output")]
    pub min_shell_volume: Option<f64>,
    /// Take slivers away, which solvers dislike, and tell the smallest angle and how many triangles have one below 5°
    ///
    /// Edges are flipped or collapsed and vertices moved where triangles have an angle below 10°, as far as the surface stays
    /// within a tenth of a cell and half the tolerance. The mesh stays closed, manifold and free of self-intersections. It lies in
    /// memory for that, with 200 bytes a triangle.
    #[arg(long, requires = "output")]
    pub quality: bool,
    /// How cells become triangles
    #[arg(long, value_enum, default_value_t, requires = "output")]
    pub method: MethodArg,
    /// Follow sharp edges through cells that have no vertex of their own: they come out twice to three times nearer to the
    /// part
    ///
    /// It takes a tenth to a third more time, of beads a third to three quarters, and with a tolerance up to twice as long.
    #[arg(long, requires = "output", conflicts_with = "method")]
    pub follow_creases: bool,
    /// Give every vertex its normal, where the format has them: the mean of those of the surface at the lattice edges around it
    ///
    /// At a sharp edge of the part it is one between both sides. Viewers shade smoothly by normals; they show a .glb without
    /// them flat, facet by facet.
    #[arg(long, requires = "output")]
    pub normals: bool,
    /// Count coordinates from another origin, which is told beside the mesh: `auto` or x,y,z
    ///
    /// For formats of 32 bits and parts far from the origin. `auto` takes a round position near the part where 32 bits would
    /// round by more than a 256th of a cell, and where the format has no 64. The origin is printed and written to OUT.origin.json; what is
    /// added to it are the store's coordinates.
    #[arg(
        long,
        value_name = "ORIGIN",
        requires = "output",
        allow_hyphen_values = true,
        conflicts_with = "double"
    )]
    pub origin: Option<OriginArg>,
    /// Write coordinates with 64 bits, in .ply, .obj and .vtp; so they are by themselves where 32 bits would round them by more than a
    /// 256th of a cell
    #[arg(long, requires = "output", conflicts_with = "normals")]
    pub double: bool,
    /// Give every triangle of a .ply, .vtp or .glb numbers of the bead that it lies on, as in bead,layer,feature
    ///
    /// Beads are numbered from 0 as in `overlap`, layers from 1, and features as in the list in the file's comments; -1 is none.
    /// The store must tell beads apart (`build --identity`).
    #[arg(long, value_enum, value_delimiter = ',', value_name = "NAMES", requires = "output",
        conflicts_with_all = ["normals", "detail", "triangles", "max_size"])]
    pub attributes: Vec<AttributeArg>,
    /// Memory to stay within, as in 512MiB, maps of files not counted
    ///
    /// 160 MiB with two threads, 40 MiB more for each further one, and 50 bytes a node are used in any case. The mesh itself
    /// passes through.
    #[arg(long, value_name = "SIZE", default_value = "1GiB")]
    pub memory: Size,
    /// Folder of the temporary file in which triangles wait for the numbers of their vertices; the output's own by default
    ///
    /// It takes 12 bytes a triangle, has no name there, and vanishes with the program.
    #[arg(long, value_name = "DIR", requires = "output")]
    pub temp_dir: Option<PathBuf>,
    /// How to read the store
    #[arg(long, value_enum, default_value_t)]
    pub io: IoArg,
    /// Print the summary as JSON
    #[arg(long)]
    pub json: bool,
    #[command(flatten)]
    pub work: WorkArgs,
}

/// From where coordinates of a mesh count.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum OriginArg {
    /// From near the part, where that is needed.
    Auto,
    /// From here.
    At([f64; 3]),
}

impl FromStr for OriginArg {
    type Err = String;

    fn from_str(text: &str) -> Result<OriginArg, String> {
        if text == "auto" {
            return Ok(OriginArg::Auto);
        }
        let wrong = || format!("\"{text}\" is neither auto nor three numbers x,y,z");
        let numbers: Vec<f64> = text
            .split(',')
            .map(|c| c.trim().parse().ok().filter(|c: &f64| c.is_finite()))
            .collect::<Option<_>>()
            .ok_or_else(wrong)?;
        numbers.first_chunk().filter(|_| numbers.len() == 3).map(|at| OriginArg::At(*at)).ok_or_else(wrong)
    }
}

/// What is told of the bead that a triangle lies on.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum AttributeArg {
    /// Number of the bead.
    Bead,
    /// Its layer.
    Layer,
    /// Its feature, as a number.
    Feature,
}

impl From<AttributeArg> for BeadAttribute {
    fn from(attribute: AttributeArg) -> BeadAttribute {
        match attribute {
            AttributeArg::Bead => BeadAttribute::Bead,
            AttributeArg::Layer => BeadAttribute::Layer,
            AttributeArg::Feature => BeadAttribute::Feature,
        }
    }
}
