//! Is a mesh the border of a solid? Closed, oriented, edge- and vertex-manifold, free of self-intersections: what holds
//! and what does not, with counts, places, volume, area and genus, of any mesh that [`crate::ingest`] reads.
//!
//! Every yes and no is exact. Vertices are the same if their coordinates are the same numbers (STL, or where welding
//! is asked for) or their index is; signs of determinants are those of exact arithmetic (Shewchuk 1997, by the crate
//! `robust`), without tolerance. The report does not depend on the number of threads.
//!
//! # What counts as a self-intersection
//!
//! Triangles are closed sets, and two of them are a pair to report if they meet elsewhere than they must. With no
//! vertex in common, that is if they meet at all; with one, if they meet elsewhere than there. With two, it is if they
//! are folded onto each other; with three, always.
//!
//! Of such a pair it is said whether it is a [`Meeting::Crossing`], a [`Meeting::Overlapping`] or a
//! [`Meeting::Touching`]. A triangle without area is folded onto itself: it is counted as flat and left out of the
//! search.

mod report;
mod search;
mod shells;
mod tally;
mod topology;
mod tree;
mod weld;

#[cfg(test)]
mod tests;

use crate::error::{Error, Result};
use crate::ingest::{Facets, Input};
use crate::progress::Progress;
use rayon::prelude::*;
use std::borrow::Cow;
use tally::Tally;

pub use crate::predicates::Meeting;
pub use report::{CheckReport, Defect, Intersections, MeetingPair, ShellReport};
pub use topology::CornerTable;
pub use tree::{BoxTree, OuterBox};
pub use weld::{IndexedMesh, weld_by};

/// Corners are numbered in 32 bits.
pub const TRIANGLES_MAX: u64 = (u32::MAX / 3) as u64;

/// Products of three differences of coordinates of this size, and the errors of their roundings, stay within what an f64
/// holds exactly in several parts: 6·(2·10^100)³ < 2^1024, and a last place of 10^−90 to the third is above 2^−1074.
/// All f32 are within.
const COORDINATES: std::ops::RangeInclusive<f64> = 1e-90..=1e100;

/// Vertices of triangles that are left out, as their corners are not finite.
const LEFT_OUT: u32 = u32::MAX;

/// Triangles looked at by one task.
const CHUNK: usize = 1 << 14;

/// An indexed mesh.
struct Mesh<'a> {
    positions: Cow<'a, [[f64; 3]]>,
    /// As many as the file has; see [`Mesh::is_whole`].
    triangles: Cow<'a, [[u32; 3]]>,
    /// Triangles with a corner that is not finite; their vertices are [`LEFT_OUT`].
    non_finite: Tally,
}

impl Mesh<'_> {
    /// Whether a triangle has three different vertices. Others bound nothing, and only the count of them counts.
    fn is_whole(&self, triangle: usize) -> bool {
        is_whole(&self.triangles[triangle])
    }

    /// The corners of a whole triangle.
    fn corners(&self, triangle: usize) -> [[f64; 3]; 3] {
        self.triangles[triangle].map(|v| self.positions[v as usize])
    }

    /// Leaves out what is not finite, and refuses what is out of range by the first vertex that is.
    fn take_stock(&mut self) -> std::result::Result<(), [f64; 3]> {
        let is_finite = |p: &[f64; 3]| p.iter().all(|c| c.is_finite());
        let in_range = |p: &[f64; 3]| p.iter().all(|c| *c == 0.0 || COORDINATES.contains(&c.abs()));
        let fails = |p: &&[f64; 3]| is_finite(p) && !in_range(p);
        if let Some(out_of_range) = self.positions.par_iter().find_first(fails) {
            return Err(*out_of_range);
        }
        if self.positions.par_iter().all(is_finite) {
            return Ok(());
        }
        let positions = &self.positions;
        for (number, triangle) in self.triangles.to_mut().iter_mut().enumerate() {
            if !triangle.iter().all(|&v| is_finite(&positions[v as usize])) {
                *triangle = [LEFT_OUT; 3];
                self.non_finite.add(number as u32);
            }
        }
        Ok(())
    }
}

/// Whether a triangle has three different vertices.
pub fn is_whole([a, b, c]: &[u32; 3]) -> bool {
    a != b && b != c && c != a
}

/// Checks the mesh in `input`. Vertices of STL are the same if their coordinates are; those of indexed formats
/// (OBJ, PLY) are what the file says, unless `weld` asks for the same there.
///
/// Takes some 60 bytes a triangle of memory beside what the input holds.
///
/// # Errors
/// If there are more than 1,431,655,765 triangles, if a finite coordinate other than 0 is beyond 10^100 or within
/// 10^−90, if the file has changed since it was opened, or if the user interrupts.
pub fn check(input: &Input, weld: bool, progress: &dyn Progress) -> Result<CheckReport> {
    let triangles = Facets::facets(input);
    if triangles > TRIANGLES_MAX {
        let what = format!("has {triangles} triangles, more than {TRIANGLES_MAX}");
        return Err(Error::input(input.path(), input.describe(), what, "check parts of it separately"));
    }
    let mut mesh = match input.indexed() {
        Some((positions, triangles)) if !weld => {
            Mesh { positions: positions.into(), triangles: triangles.into(), non_finite: Tally::NONE }
        }
        _ => weld::weld(input, progress)?,
    };
    input.check()?;
    mesh.take_stock().map_err(|[x, y, z]| {
        let what =
            format!("a vertex ({x}, {y}, {z}) has a coordinate that is not 0 and not within 1e-90 to 1e100");
        Error::input(input.path(), input.describe(), what, "scale the mesh")
    })?;
    examine(&mesh, progress)
}

/// The report on a mesh that holds what [`Mesh::take_stock`] sees to.
fn examine(mesh: &Mesh, progress: &dyn Progress) -> Result<CheckReport> {
    let topology = topology::study(mesh, progress)?;
    let measured = shells::measure(mesh, topology.patches, topology.euler, progress)?;
    let searched = search::search(mesh, progress)?;
    let at_vertex = |tally: Tally| tally.defect(|vertex| mesh.positions[vertex]);
    let at_face = |tally: Tally| tally.defect(|face| mesh.corners(face)[0]);
    let triangles = mesh.triangles.len() as u64;
    let whole = triangles - topology.collapsed.count - mesh.non_finite.count;
    let edges = topology.edges;
    let mut report = CheckReport {
        triangles,
        vertices: topology.vertices,
        unused_vertices: mesh.positions.len() as u64 - topology.vertices,
        edges,
        euler_characteristic: topology.vertices as i64 - edges as i64 + whole as i64,
        genus: None,
        open_edges: at_vertex(topology.open),
        misoriented_edges: at_vertex(topology.misoriented),
        crowded_edges: at_vertex(topology.crowded),
        split_vertices: at_vertex(topology.split),
        non_finite_triangles: mesh.non_finite.defect(|_| [f64::NAN; 3]),
        collapsed_triangles: topology
            .collapsed
            .defect(|face| mesh.positions[mesh.triangles[face][0] as usize]),
        flat_triangles: at_face(searched.flat),
        duplicate_triangles: at_vertex(topology.duplicates),
        intersections: searched.intersections,
        area: measured.area,
        volume: measured.volume,
        bounds: measured.bounds,
        components: measured.shells.len() as u64,
        inward_components: measured.shells.iter().filter(|shell| shell.volume < 0.0).count() as u64,
        shells: measured.shells,
    };
    if report.is_closed() && report.is_oriented() && report.is_manifold() {
        // Where every vertex has one fan, a shell's own characteristic is 2 − 2g.
        report.genus = Some(report.shells.iter().map(|shell| (2 - shell.euler_characteristic) / 2).sum());
    }
    Ok(report)
}
