//! Triangles sorted along a curve through space, where they are too many for memory.

use crate::error::Result;
use crate::lattice::{cross, dot, minus, morton};
use crate::part::temporary::TempFile;
use crate::progress::Progress;
use crate::soup::{Facets, runs};
use std::ops::Range;
use std::path::Path;

/// Bytes of a triangle, and while a part of them is sorted.
pub(super) const TRIANGLE_BYTES: usize = 36;
const SORTED_BYTES: u64 = 100;
/// Cubes along the edge of the mesh's box, by binary places, whose triangles are counted.
const CUBE_BITS: u32 = 6;
const CUBE_SHIFT: u32 = 63 - 3 * CUBE_BITS;
/// The least and the most triangles of a part that wait to be written.
const LEAST_WAITING: usize = 64;
const MOST_WAITING: usize = 1 << 16;

/// Corners of a triangle.
pub(super) type FacetCorners = [[f32; 3]; 3];

/// The cube around all corners, along whose curve triangles are sorted.
#[derive(Clone, Copy)]
pub(super) struct Extent {
    low: [f32; 3],
    size: f32,
}

impl Extent {
    pub fn new(low: [f32; 3], size: f32) -> Extent {
        Extent { low, size }
    }

    /// The place of a triangle along the curve, of 63 bits.
    pub fn place(&self, facet: &FacetCorners) -> u64 {
        morton(std::array::from_fn(|a| {
            let middle = (facet[0][a] + facet[1][a] + facet[2][a]) / 3.0;
            (((middle - self.low[a]) / self.size).clamp(0.0, 1.0) * 2_097_151.0) as u32
        }))
    }

    /// The cube that it is in.
    pub fn cube(&self, facet: &FacetCorners) -> u64 {
        self.place(facet) >> CUBE_SHIFT
    }
}

/// Shows all triangles with area, or those that have none, too.
pub(super) fn read_all(
    sources: &[&dyn Facets],
    progress: &dyn Progress,
    mut each: impl FnMut(FacetCorners, bool) -> Result<()>,
) -> Result<()> {
    let mut read = Vec::new();
    for (source, range) in runs(sources) {
        progress.check()?;
        sources[source].read(range, &mut read);
        progress.advance(read.len() as u64);
        for facet in &read {
            let facet = facet.map(|c| c.map(|c| c as f32));
            each(facet, area_normal(&facet).is_some())?;
        }
    }
    Ok(())
}

/// Runs of cubes along the curve, each with as many triangles as may be sorted at once.
pub(super) fn parts(
    sources: &[&dyn Facets],
    extent: Extent,
    count: usize,
    memory: u64,
    progress: &dyn Progress,
) -> Result<Vec<Range<u64>>> {
    let cubes = 1u64 << (3 * CUBE_BITS);
    let most = (memory / 2 / SORTED_BYTES).max(1);
    if count as u64 <= most {
        return Ok(std::iter::once(0..cubes).collect());
    }
    progress.phase("counting the reference", None, "facets");
    let mut counts = vec![0u32; cubes as usize];
    read_all(sources, progress, |facet, has_area| {
        if has_area {
            counts[extent.cube(&facet) as usize] += 1;
        }
        Ok(())
    })?;
    let (mut parts, mut first, mut held) = (Vec::new(), 0, 0u64);
    for (cube, &count) in counts.iter().enumerate() {
        if held > 0 && held + u64::from(count) > most {
            parts.push(first..cube as u64);
            (first, held) = (cube as u64, 0);
        }
        held += u64::from(count);
    }
    parts.push(first..cubes);
    Ok(parts)
}

/// Triangles by the part that they belong to, in the order of the input: in memory, or in a file if there are several parts.
pub(super) struct PartSorter<'a> {
    parts: &'a [Range<u64>],
    waiting: Vec<Vec<FacetCorners>>,
    /// Where those of each part lie, and how many.
    written: Vec<Vec<(u64, usize)>>,
    /// So many of a part wait at most.
    most: usize,
    file: TempFile,
}

impl PartSorter<'_> {
    pub fn new<'a>(parts: &'a [Range<u64>], most: usize, folder: &Path) -> PartSorter<'a> {
        let most = if parts.len() == 1 {
            usize::MAX
        } else {
            (most / parts.len()).clamp(LEAST_WAITING, MOST_WAITING)
        };
        let (waiting, written) = (vec![Vec::new(); parts.len()], vec![Vec::new(); parts.len()]);
        PartSorter { parts, waiting, written, most, file: TempFile::new(folder) }
    }

    pub fn add(&mut self, cube: u64, facet: FacetCorners) -> Result<()> {
        let part = self.parts.partition_point(|part| part.end <= cube);
        let waiting = &mut self.waiting[part];
        waiting.push(facet);
        if waiting.len() == self.most {
            let offset = self.file.append(bytemuck::cast_slice(waiting))?;
            self.written[part].push((offset, waiting.len()));
            waiting.clear();
        }
        Ok(())
    }

    pub fn part(&mut self, part: usize) -> Result<Vec<FacetCorners>> {
        let mut corners = Vec::new();
        for &(offset, count) in &self.written[part] {
            let from = corners.len();
            corners.resize(from + count, FacetCorners::default());
            self.file.read(offset, bytemuck::cast_slice_mut(&mut corners[from..]))?;
        }
        corners.append(&mut self.waiting[part]);
        Ok(corners)
    }
}

/// The unit normal of a triangle with area.
pub(super) fn area_normal(facet: &FacetCorners) -> Option<[f64; 3]> {
    let [a, b, c] = facet.map(|c| c.map(f64::from));
    let normal = cross(minus(b, a), minus(c, a));
    let length = dot(normal, normal).sqrt();
    (length > 0.0 && length.is_finite()).then(|| normal.map(|c| c / length))
}
