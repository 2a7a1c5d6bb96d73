//! A toolpath as numbered triangles, none of which is kept.

use super::sweep::Sweep;
use super::tube::{Joints, Tube, for_tubes};
use crate::toolpath::Toolpath;
use glam::DVec3;
use std::ops::Range;

/// One tube in the list of all of them.
#[derive(Clone, Copy, Debug)]
struct Entry {
    bead: u32,
    /// First point, within the bead. It ends where the next tube of the bead begins, or with the bead.
    first_point: u32,
    /// Triangles of all tubes before it.
    first_facet: u64,
}

/// A toolpath and its sweep: a soup of closed tubes, by number. Takes 16 bytes a tube beside the toolpath.
#[derive(Clone, Debug)]
pub struct SweptToolpath {
    toolpath: Toolpath,
    sweep: Sweep,
    tubes: Vec<Entry>,
    facets: u64,
    joints: Joints,
}

impl SweptToolpath {
    /// Splits all beads into tubes and counts their triangles; makes none.
    pub fn new(toolpath: Toolpath, sweep: Sweep) -> SweptToolpath {
        let (mut tubes, mut facets, mut joints) = (Vec::new(), 0, Joints::default());
        for bead in 0..toolpath.len() {
            for_tubes(&sweep, &(&toolpath, bead), &mut joints, |points| {
                tubes.push(Entry {
                    bead: bead as u32,
                    first_point: points.start as u32,
                    first_facet: facets,
                });
                facets += sweep.facets(points.len());
            });
        }
        SweptToolpath { toolpath, sweep, tubes, facets, joints }
    }

    /// The toolpath.
    pub fn toolpath(&self) -> &Toolpath {
        &self.toolpath
    }

    /// How it is swept.
    pub fn sweep(&self) -> &Sweep {
        &self.sweep
    }

    /// How the segments of all beads were joined.
    pub fn joints(&self) -> Joints {
        self.joints
    }

    /// Closed surfaces.
    pub fn tubes(&self) -> u64 {
        self.tubes.len() as u64
    }

    /// Triangles.
    pub fn facets(&self) -> u64 {
        self.facets
    }

    /// Memory taken, the toolpath's included.
    pub fn heap_bytes(&self) -> u64 {
        self.toolpath.heap_bytes() + size_of_val(self.tubes.as_slice()) as u64
    }

    /// Volume of all beads as slicers reckon it (see [`Sweep::volume`]), in the order of the file.
    pub fn bead_volume(&self) -> f64 {
        (0..self.toolpath.len()).map(|bead| self.sweep.volume(&(&self.toolpath, bead))).sum()
    }

    /// Calls `each` with the triangles of `range` in order, counter-clockwise seen from outside; what lies
    /// beyond [`Self::facets`] is left out. Takes time by the length of the range, wherever it begins.
    pub fn for_facets(&self, range: Range<u64>, mut each: impl FnMut([DVec3; 3])) {
        let end = range.end.min(self.facets);
        if range.start >= end {
            return;
        }
        let first = self.tubes.partition_point(|tube| tube.first_facet <= range.start) - 1;
        for (number, tube) in self.tubes.iter().enumerate().skip(first) {
            if tube.first_facet >= end {
                break;
            }
            let course = (&self.toolpath, tube.bead as usize);
            let part = range.start.saturating_sub(tube.first_facet)..end - tube.first_facet;
            Tube::new(&self.sweep, &course, self.points_of(number)).for_facets(part, &mut each);
        }
    }

    /// The points of a tube within its bead.
    fn points_of(&self, number: usize) -> Range<usize> {
        let tube = self.tubes[number];
        let end = match self.tubes.get(number + 1) {
            Some(next) if next.bead == tube.bead => next.first_point as usize + 1,
            _ => self.toolpath.points(tube.bead as usize).len(),
        };
        tube.first_point as usize..end
    }

    /// Replaces the content of `out` by the triangles of `range`, as [`Self::for_facets`] tells them.
    pub fn read(&self, range: Range<u64>, out: &mut Vec<[[f64; 3]; 3]>) {
        out.clear();
        self.for_facets(range, |corners| out.push(corners.map(|corner| corner.to_array())));
    }
}
