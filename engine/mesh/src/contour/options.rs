//! What to contour, and how; what is refused; and what comes of it.

use super::surface::IsoLevel;
use crate::error::{Error, Result};
use crate::store::BrickTree;
use std::path::PathBuf;

/// What to contour, and how.
#[derive(Clone, Debug)]
pub struct ContourOptions {
    /// The winding number at the surface, above 0; inside means w ≥ `iso`. Up to 1 the surface is the
    /// boundary that the Hermite data describe. Above 1 the crossings are placed where the samples at the
    /// two ends of an edge interpolate to `iso`, and normals are central differences of the samples.
    pub iso: f64,
    /// Deepest level to use; interior nodes there stand for their descendants. `None` for all.
    pub level: Option<u8>,
    /// Bytes for decoded bricks and cells that several leaves ask for. Less costs time, not correctness.
    pub cache_bytes: usize,
    /// How far, in world units, the surface may be moved for the sake of fewer triangles; 0 to keep every vertex.
    pub tolerance: f64,
    /// Whether triangles at merged vertices that meet others elsewhere than in common corners are looked for, and their
    /// vertices given up, which takes one and a half to two and a half times the time. Without a tolerance none meet
    /// in any case.
    pub intersection_free: bool,
    /// How cells become triangles.
    pub method: ContourMethod,
    /// Whether sharp edges are followed through cells that have no vertex of their own: they are nearer to the mesh by half
    /// or more, for a tenth to a third more time, of beads for a third to three quarters, with a tolerance for up to twice the
    /// time. Of meshes by dual contouring.
    pub follow_creases: bool,
    /// Folder in which triangles wait for the numbers of their vertices, if the sink writes a file; the file's own by default.
    pub temp_dir: Option<PathBuf>,
}

/// How cells become triangles.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum ContourMethod {
    /// Manifold dual contouring: sharp edges, leaves of any levels.
    #[default]
    Dual,
    /// Marching cubes (Lorensen & Cline 1987), for comparison: vertices on lattice edges, leaves of one level.
    MarchingCubes,
}

impl Default for ContourOptions {
    fn default() -> ContourOptions {
        ContourOptions {
            iso: 0.5,
            level: None,
            cache_bytes: 512 << 20,
            tolerance: 0.0,
            intersection_free: true,
            method: ContourMethod::Dual,
            follow_creases: false,
            temp_dir: None,
        }
    }
}

/// What came out.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct MeshSummary {
    /// Vertices handed to the sink.
    pub vertices: u64,
    /// Triangles handed to the sink.
    pub triangles: u64,
    /// Area in square world units.
    pub area: f64,
    /// Enclosed volume in cubic world units.
    pub volume: f64,
    /// Least and greatest coordinates in world units; `None` for an empty mesh.
    pub bounds: Option<[[f32; 3]; 2]>,
    /// Faces on which two cuts of the same two components were kept apart by extra vertices.
    pub split_faces: u64,
    /// Vertices on faces of cells with several sheets, where mesh edges would leave the part of the cell that is theirs.
    pub face_vertices: u64,
    /// Vertices on lattice edges, about which polygons are fans that would meet others if they were cut along a diagonal.
    pub edge_vertices: u64,
    /// Cells whose boundary has edges of finer leaves.
    pub mixed_cells: u64,
    /// Those of them whose sheets may meet: none of the places tried for their vertices keeps them apart.
    pub unseparated_cells: u64,
}

/// Vertices are 32-bit world coordinates: refuses trees whose cells those cannot tell apart.
pub(super) fn require_resolution(tree: &dyn BrickTree, level: Option<u8>) -> Result<()> {
    let root = tree.root();
    let deepest = tree.deepest_level();
    let cell = root.spacing(level.unwrap_or(deepest).min(deepest));
    let farthest = root.origin.iter().fold(0.0f64, |m, c| m.max(c.abs()).max((c + root.edge).abs()));
    let step = (farthest * f64::from(f32::EPSILON)).max(f64::from(f32::MIN_POSITIVE));
    if step * 8.0 > cell || farthest > f64::from(f32::MAX) {
        return Err(Error::setting(
            format!(
                "cells of {cell:e} at a distance of {farthest:e} from the origin are too fine for a mesh file"
            ),
            "coordinates have 32 bits here; move the part nearer to the origin or scale it",
        ));
    }
    Ok(())
}

pub(super) fn require_tolerance(options: &ContourOptions) -> Result<()> {
    let ContourOptions { tolerance, method, .. } = *options;
    if !(tolerance >= 0.0 && tolerance.is_finite()) {
        let what = format!("no surface can be within {tolerance}");
        return Err(Error::setting(what, "choose a length, or 0"));
    }
    if tolerance > 0.0 && method == ContourMethod::MarchingCubes {
        let what = "marching cubes keeps all its triangles";
        return Err(Error::setting(what, "leave the tolerance out, or the method"));
    }
    Ok(())
}

/// Samples with binary places are told apart by their nearest whole numbers.
pub(super) fn require_half(tree: &dyn BrickTree, iso: f64) -> Result<()> {
    let has_fractions = || tree.keys().into_iter().any(|key| tree.node(key).is_some_and(|n| n.fractions));
    if iso.fract() != 0.5 && has_fractions() {
        return Err(Error::setting(
            format!("no surface at {iso} in the store of an open input"),
            "choose 0.5, 1.5, 2.5 and so on",
        ));
    }
    Ok(())
}

pub(super) fn level(iso: f64) -> Result<IsoLevel> {
    if !(iso > 0.0 && iso <= f64::from(i16::MAX)) {
        return Err(Error::setting(
            format!("no surface at the winding number {iso}"),
            "choose one above 0, such as 0.5 for the boundary",
        ));
    }
    Ok(IsoLevel { threshold: iso.ceil() as i32, iso })
}
