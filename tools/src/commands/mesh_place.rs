//! Coordinates of 64 bits and numbers of triangles for `brickfield mesh`.

use crate::args::MeshArgs;
use crate::failure::Failure;
use crate::output::{in_line, warn};
use brickfield_engine::analysis::FaceBeads;
use brickfield_engine::contour::{Coordinates, DOUBLE_ENDINGS, FaceAttributes, MeshSink, PlacedSink};
use brickfield_engine::store::{BrickTree, Store};
use std::path::Path;

/// Rounding by more than this part of a cell asks for coordinates of 64 bits.
const CELL_PART: f64 = 256.0;

fn ends_in(path: &Path, endings: &[&str]) -> bool {
    endings.iter().any(|known| path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case(known)))
}

/// Rounding by more than this part of a cell is refused by what makes meshes.
const LEAST_PART: f64 = 16.0;

/// By how much 32 bits round the largest coordinate; nothing where another origin would not make that less.
fn rounding(store: &Store) -> f64 {
    let root = store.root();
    let most = root.origin.iter().map(|c| c.abs().max((c + root.edge).abs())).fold(0.0, f64::max);
    if most > 2.0 * root.edge { most * f64::from(f32::EPSILON) / 2.0 } else { 0.0 }
}

/// Whether the mesh is made about the middle of the part, and its coordinates have 64 bits.
///
/// # Errors
/// If that is asked for in a format that has none.
pub(super) fn is_moved(
    args: &MeshArgs,
    store: &Store,
    output: &Path,
    is_coarse: bool,
) -> Result<bool, Failure> {
    let has_double = ends_in(output, &DOUBLE_ENDINGS);
    if args.double && !has_double {
        let what = "--double: coordinates of 64 bits are written as .ply or .obj";
        return Err(Failure::Usage(format!("{}: {what}", in_line(output))));
    }
    let cell = store.root().spacing(store.deepest_level());
    let is_needed = rounding(store) > cell / CELL_PART;
    if !is_needed || args.double || has_double && !args.normals && !is_coarse {
        return Ok(args.double || is_needed);
    }
    let (off, unit) = (rounding(store), super::unit_of(store.meta()));
    let what = format!("32 bits round coordinates by up to {off:.1e} {unit}, cells are {cell:.1e} {unit}");
    let remedy = "write .ply or .obj without normals, which have 64";
    if off > cell / LEAST_PART {
        return Err(anyhow::anyhow!("{}: {what}; {remedy}", in_line(output)).into());
    }
    warn(&format!("{}: {what}: {remedy}", in_line(output)));
    Ok(false)
}

/// The file of a mesh with coordinates of 64 bits or with numbers, if that is what is asked for.
///
/// # Errors
/// If there is no file or the store tells no beads apart.
pub(super) fn sink<'a>(
    args: &MeshArgs,
    store: &'a Store,
    output: &Path,
    coordinates: Coordinates,
) -> Result<Option<Box<dyn MeshSink + 'a>>, Failure> {
    let mut faces: Option<Box<dyn FaceAttributes + 'a>> = None;
    if !args.attributes.is_empty() {
        if !ends_in(output, &["ply"]) {
            let what = "--attributes: the name must end in .ply, the one format whose triangles have numbers";
            return Err(Failure::Usage(format!("{}: {what}", in_line(output))));
        }
        let wanted = args.attributes.iter().map(|&attribute| attribute.into()).collect();
        let Some(beads) = FaceBeads::new(store, coordinates, wanted)? else {
            let what =
                "the store does not tell beads apart, so triangles have none; build it with --identity";
            return Err(anyhow::anyhow!("{}: {what}", in_line(store.path())).into());
        };
        faces = Some(Box::new(beads));
    }
    if faces.is_none() && coordinates == Coordinates::Single {
        return Ok(None);
    }
    if output.is_dir() {
        return Ok(None);
    }
    Ok(Some(Box::new(PlacedSink::create(output, coordinates, faces)?)))
}
