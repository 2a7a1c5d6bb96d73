//! Triangle soups and point clouds as what is computed of them sees them, whatever they were read from.

use crate::error::Result;
use crate::large_array::{ArrayRoom, LargeArray};
use std::ops::Range;

/// One triangle in the input's own unit: three corners, counter-clockwise seen from outside.
pub type Facet = [[f64; 3]; 3];

/// Anything that yields the triangles of a soup by number.
pub trait Facets: Sync {
    /// Number of triangles.
    fn facets(&self) -> u64;
    /// Replaces `out` by the triangles of `range`, in world coordinates.
    fn read(&self, range: Range<u64>, out: &mut Vec<Facet>);
}

impl Facets for Vec<Facet> {
    fn facets(&self) -> u64 {
        self.len() as u64
    }

    fn read(&self, range: Range<u64>, out: &mut Vec<Facet>) {
        out.clear();
        out.extend_from_slice(&self[range.start as usize..range.end as usize]);
    }
}

/// Triangles decoded at a time: as f64 and snapped they take 1.7 MB, about an L2 cache.
const RUN_FACETS: u64 = 1 << 14;

/// All triangles of several sources in runs: (number of the source, range of its triangles).
pub fn runs(sources: &[&dyn Facets]) -> Vec<(usize, Range<u64>)> {
    let of_source = |(number, source): (usize, &&dyn Facets)| {
        let facets = source.facets();
        let starts = (0..facets).step_by(RUN_FACETS as usize);
        starts.map(move |s| (number, s..facets.min(s + RUN_FACETS))).collect::<Vec<_>>()
    };
    sources.iter().enumerate().flat_map(of_source).collect()
}

/// Points of a surface, in the input's own unit.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PointCloud {
    /// Where they are.
    pub points: LargeArray<[f64; 3]>,
    /// Outward normals of any length, one for each point; empty if the file has none, or none that are sure to be normals.
    pub normals: LargeArray<[f64; 3]>,
}

impl PointCloud {
    /// One without points, and the room that each of its arrays has.
    pub fn new(room: &ArrayRoom) -> PointCloud {
        PointCloud { points: LargeArray::new(room), normals: LargeArray::new(room) }
    }

    /// Gives its arrays, and those that are made from them, another room.
    pub fn set_room(&mut self, room: &ArrayRoom) {
        self.points.set_room(room);
        self.normals.set_room(room);
    }

    /// Of points and as many normals, or none.
    pub fn of(points: Vec<[f64; 3]>, normals: Vec<[f64; 3]>) -> PointCloud {
        PointCloud { points: points.into(), normals: normals.into() }
    }

    /// Appends a point, with its normal if points have such.
    ///
    /// # Errors
    /// As [`LargeArray::push`].
    pub fn push(&mut self, point: [f64; 3], normal: Option<[f64; 3]>) -> Result<()> {
        self.points.push(point)?;
        normal.map_or(Ok(()), |normal| self.normals.push(normal))
    }

    /// Appends all of another.
    ///
    /// # Errors
    /// As [`LargeArray::push`].
    pub fn append(&mut self, other: &PointCloud) -> Result<()> {
        self.points.extend_from_slice(&other.points)?;
        self.normals.extend_from_slice(&other.normals)
    }

    /// The box around all points.
    pub fn bounds(&self) -> ([f64; 3], [f64; 3]) {
        let min = std::array::from_fn(|a| self.points.iter().fold(f64::INFINITY, |m, p| m.min(p[a])));
        let max = std::array::from_fn(|a| self.points.iter().fold(f64::NEG_INFINITY, |m, p| m.max(p[a])));
        (min, max)
    }
}
