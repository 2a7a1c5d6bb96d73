//! Where the coordinates of a mesh count from, and how many bits they have; numbers of triangles.

use super::unit_of;
use crate::args::{MeshArgs, OriginArg};
use crate::failure::Failure;
use crate::output::{in_line, warn};
use crate::units::Unit;
use brickfield_engine::analysis::FaceBeads;
use brickfield_engine::contour::{
    Coordinates, DOUBLE_ENDINGS, FaceAttributes, GlbFacesSink, MeshSink, NUMBER_ENDINGS, PlacedSink,
};
use brickfield_engine::lattice::RootCube;
use brickfield_engine::part::PartFile;
use brickfield_engine::store::{BrickTree, MovedTree, Store};
use serde_json::json;
use std::path::{Path, PathBuf};

/// Rounding by more than this part of a cell asks for coordinates of 64 bits.
const CELL_PART: f64 = 256.0;

/// Whether the name of a file ends in one of these, in capitals or not.
pub(super) fn ends_in(path: &Path, endings: &[&str]) -> bool {
    endings.iter().any(|known| path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case(known)))
}

/// Rounding by more than this part of a cell is refused by what makes meshes.
const LEAST_PART: f64 = 16.0;

/// By how much 32 bits round the largest coordinate; nothing where another origin would not make that less.
fn rounding(root: RootCube) -> f64 {
    let most = root.farthest();
    if most > 2.0 * root.edge { most * f64::from(f32::EPSILON) / 2.0 } else { 0.0 }
}

/// What is asked of a mesh that its place depends on.
#[derive(Clone, Copy)]
pub(super) struct PlaceWish {
    pub double: bool,
    pub origin: Option<OriginArg>,
    /// Whether only coordinates of 32 bits can be written.
    pub single: bool,
    /// Which other formats have 64 bits, as words that follow "write".
    pub double_formats: &'static str,
    /// Whether the command has --origin.
    pub has_origin: bool,
}

impl Default for PlaceWish {
    fn default() -> PlaceWish {
        let double_formats = ".ply, .obj or .vtp without normals";
        PlaceWish { double: false, origin: None, single: false, double_formats, has_origin: true }
    }
}

/// How the coordinates of a mesh are written.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum MeshPlace {
    /// The store's, with 32 bits.
    World,
    /// The store's, with 64 bits: the mesh is made about this position.
    Double([f64; 3]),
    /// From this position, with 32 bits.
    Shifted([f64; 3]),
}

impl MeshPlace {
    /// Of a mesh of a store.
    ///
    /// # Errors
    /// If 64 bits are asked for in a format that has none; if 32 bits cannot tell cells apart.
    pub fn of(wish: PlaceWish, store: &Store, output: &Path) -> Result<MeshPlace, Failure> {
        let has_double = ends_in(output, &DOUBLE_ENDINGS);
        if wish.double && !has_double {
            let what = "--double: coordinates of 64 bits are written as .ply, .obj or .vtp";
            return Err(Failure::Usage(format!("{}: {what}", in_line(output))));
        }
        let root = store.root();
        let cell = root.spacing(store.deepest_level());
        let is_needed = rounding(root) > cell / CELL_PART;
        let middle = MovedTree::middle(store);
        let chosen = match wish.origin {
            Some(OriginArg::At(origin)) => Some(origin),
            Some(OriginArg::Auto) if is_needed && (!has_double || wish.single) => {
                Some(MovedTree::round_middle(store))
            }
            _ if wish.double || is_needed && has_double && !wish.single => {
                return Ok(MeshPlace::Double(middle));
            }
            _ => None,
        };
        let root = chosen.map_or(root, |origin| MovedTree::new(store, origin).root());
        let or_origin = if wish.has_origin { ", or give --origin auto" } else { "" };
        let remedy = format!("write {}, which have 64{or_origin}", wish.double_formats);
        require_single(store, root, output, &remedy)?;
        Ok(chosen.map_or(MeshPlace::World, MeshPlace::Shifted))
    }

    /// How a sink gets coordinates.
    pub fn coordinates(self) -> Coordinates {
        match self {
            MeshPlace::Double(base) => Coordinates::DoubleFrom(base),
            MeshPlace::World | MeshPlace::Shifted(_) => Coordinates::Single,
        }
    }

    /// Where the mesh is made about, which is its origin for what makes it.
    pub fn base(self) -> Option<[f64; 3]> {
        match self {
            MeshPlace::World => None,
            MeshPlace::Double(base) | MeshPlace::Shifted(base) => Some(base),
        }
    }

    /// Bits of a coordinate in the file.
    pub fn bits(self) -> u8 {
        if self.coordinates() == Coordinates::Single { 32 } else { 64 }
    }

    /// What is to be added to the file's coordinates.
    pub fn origin(self) -> Option<[f64; 3]> {
        if let MeshPlace::Shifted(origin) = self { Some(origin) } else { None }
    }

    /// A line that tells people what is to be added to the file's coordinates; nothing where that is nothing.
    pub fn line(self, unit: &str) -> Option<String> {
        self.origin().map(|[x, y, z]| format!("{x},{y},{z} {unit}, to be added to the file's coordinates"))
    }

    /// Writes the origin beside the mesh, or warns of the one of a mesh before it.
    ///
    /// # Errors
    /// What writing gives.
    pub fn tell(self, store: &Store, mesh: &Path) -> Result<(), Failure> {
        let path = origin_path(mesh);
        let Some(origin) = self.origin() else {
            if path.exists() {
                warn(&format!(
                    "{}: is of an earlier mesh, not of this one, whose origin is 0,0,0",
                    in_line(&path)
                ));
            }
            return Ok(());
        };
        let name = mesh.file_name().map(|name| name.to_string_lossy().into_owned());
        let document = json!({ "file": name, "origin": origin, "unit": store.meta().unit });
        let mut file = PartFile::create(&path)?;
        file.append(format!("{document:#}\n").as_bytes())?;
        file.finish()?;
        Ok(())
    }
}

/// Refuses coordinates of 32 bits where they cannot tell cells apart in such a root cube, and warns before.
///
/// # Errors
/// With what to do.
pub(super) fn require_single(
    store: &Store,
    root: RootCube,
    output: &Path,
    remedy: &str,
) -> Result<(), Failure> {
    let (off, cell) = (rounding(root), root.spacing(store.deepest_level()));
    if off <= cell / CELL_PART {
        return Ok(());
    }
    let unit = unit_of(store.meta());
    let what = format!("32 bits round coordinates by up to {off:.1e} {unit}, cells are {cell:.1e} {unit}");
    if off > cell / LEAST_PART {
        return Err(anyhow::anyhow!("{}: {what}; {remedy}", in_line(output)).into());
    }
    warn(&format!("{}: {what}: {remedy}", in_line(output)));
    Ok(())
}

/// The name of the file that tells the origin of a mesh.
fn origin_path(mesh: &Path) -> PathBuf {
    let mut name = mesh.as_os_str().to_owned();
    name.push(".origin.json");
    PathBuf::from(name)
}

/// The file of a mesh with coordinates of 64 bits or with numbers, if that is what is asked for.
///
/// # Errors
/// If there is no file or the store tells no beads apart.
pub(super) fn sink<'a>(
    args: &MeshArgs,
    store: &'a Store,
    output: &Path,
    place: MeshPlace,
) -> Result<Option<Box<dyn MeshSink + 'a>>, Failure> {
    let mut faces: Option<Box<dyn FaceAttributes + 'a>> = None;
    if !args.attributes.is_empty() {
        if !ends_in(output, &NUMBER_ENDINGS) {
            let what = "--attributes: the name must end in .ply, .vtp or .glb, the formats whose triangles have numbers";
            return Err(Failure::Usage(format!("{}: {what}", in_line(output))));
        }
        let wanted = args.attributes.iter().map(|&attribute| attribute.into()).collect();
        // Beads lie in the world, wherever the file counts from.
        let of_made = place.base().map_or(Coordinates::Single, Coordinates::DoubleFrom);
        let Some(beads) = FaceBeads::new(store, of_made, wanted)? else {
            let what =
                "the store does not tell beads apart, so triangles have none; build it with --identity";
            return Err(anyhow::anyhow!("{}: {what}", in_line(store.path())).into());
        };
        faces = Some(Box::new(beads));
    }
    let coordinates = place.coordinates();
    if faces.is_none() && coordinates == Coordinates::Single {
        return Ok(None);
    }
    if output.is_dir() {
        return Ok(None);
    }
    let metres = Unit::of_symbol(&store.meta().unit).map(Unit::metres);
    Ok(Some(match faces {
        Some(faces) if ends_in(output, &["glb"]) => Box::new(GlbFacesSink::create(output, metres, faces)?),
        faces => Box::new(PlacedSink::create(output, coordinates, faces)?),
    }))
}
