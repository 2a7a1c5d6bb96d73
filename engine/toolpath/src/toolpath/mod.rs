//! Toolpaths: what a machine deposits, as a list of beads.
//!
//! A reader hands over one [`BeadView`] after the other, so that a part of any size streams; a [`Toolpath`]
//! keeps them where several passes are needed. It is compact: a 28 MB G-code takes about 40 MB of it, while
//! the triangles swept along it take 2 GB.
//!
//! Lengths are millimetres, volumes cubic millimetres, whatever the file's unit.

mod fill;
pub mod gcode;
mod layers;
mod passes;

pub use fill::{LayerFill, LayerFills};
pub use passes::Passes;

use crate::error::Result;
use std::f64::consts::FRAC_PI_4;
use std::ops::Range;

/// Outer size of a bead's cross-section: along the layer and across it. The shape between them (stadium,
/// ellipse, rectangle, ...) is chosen where beads become solids.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Section {
    /// Extent perpendicular to the path, in the layer.
    pub width: f64,
    /// Extent along the tool's axis: the layer height.
    pub height: f64,
}

impl Section {
    /// Area of a stadium of these outer sizes: a rectangle between two half circles, which stand at the sides
    /// of a wide bead, and at top and bottom of one that is higher than wide.
    #[inline]
    pub fn stadium_area(&self) -> f64 {
        let (long, short) = (self.width.max(self.height), self.width.min(self.height));
        short * (long - short) + FRAC_PI_4 * short * short
    }
}

/// What is known of a bead besides its shape.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Attributes {
    /// Layer, from 0, in the order of the file.
    pub layer: u32,
    /// Tool (extruder) number.
    pub tool: u16,
    /// What the slicer calls it, as an index into the names that the reader gathers ("External perimeter").
    pub feature: u16,
    /// First and last line of the source that deposit it, from 1.
    pub lines: (u64, u64),
    /// Material fed while it was deposited, from the E axis; `None` where the file has no E.
    pub fed: Option<f64>,
}

/// One bead: a run of deposition without travel, within one layer.
#[derive(Clone, Copy, Debug)]
pub struct BeadView<'a> {
    /// Where the tool tip goes: the middle of the bead's upper side. Two or more; consecutive ones differ.
    pub points: &'a [[f64; 3]],
    /// The tool's axis at each point, a unit vector pointing away from the part; empty where it is +z
    /// everywhere.
    pub axes: &'a [[f64; 3]],
    /// Cross-section of each segment: one fewer than points.
    pub sections: &'a [Section],
    /// The line of the source that deposits each segment, from 1; empty where only the bead's are known.
    pub lines: &'a [u64],
    /// Layer, tool, source lines.
    pub attributes: Attributes,
}

/// Takes beads in the order of the file.
pub type BeadSink<'a> = dyn FnMut(BeadView<'_>) -> Result<()> + 'a;

/// A toolpath in memory.
#[derive(Clone, Debug, Default)]
pub struct Toolpath {
    points: Vec<[f64; 3]>,
    /// As long as `points`, or empty where every axis so far is +z.
    axes: Vec<[f64; 3]>,
    /// The section of the segment that begins at each point, as an index into `sections`; what stands at a
    /// bead's last point has no meaning.
    section_of: Vec<u32>,
    sections: Vec<Section>,
    /// Lines from the bead's first to that of the segment that begins at each point, or empty where no bead so far knows
    /// them.
    line_of: Vec<u32>,
    beads: Vec<(Range<usize>, Attributes)>,
}

impl Toolpath {
    /// Appends a copy of a bead.
    pub fn push(&mut self, bead: BeadView<'_>) {
        let start = self.points.len();
        if !bead.axes.is_empty() && self.axes.is_empty() {
            self.axes.resize(start, UP);
        }
        self.points.extend_from_slice(bead.points);
        if bead.axes.is_empty() {
            if !self.axes.is_empty() {
                self.axes.resize(self.points.len(), UP);
            }
        } else {
            self.axes.extend_from_slice(bead.axes);
        }
        for section in bead.sections {
            // Sections come in long runs, so only the last one is compared.
            if self.sections.last() != Some(section) {
                self.sections.push(*section);
            }
            self.section_of.push(self.sections.len() as u32 - 1);
        }
        self.section_of.resize(self.points.len(), 0);
        if !bead.lines.is_empty() {
            self.line_of.resize(start, 0);
            let first = bead.attributes.lines.0;
            let after = |line: &u64| u32::try_from(line.saturating_sub(first)).unwrap_or(u32::MAX);
            self.line_of.extend(bead.lines.iter().map(after));
        }
        if !self.line_of.is_empty() {
            self.line_of.resize(self.points.len(), 0);
        }
        self.beads.push((start..self.points.len(), bead.attributes));
    }

    /// Number of beads.
    #[inline]
    pub fn len(&self) -> usize {
        self.beads.len()
    }

    /// Whether there is no bead.
    #[inline]
    pub fn is_empty(&self) -> bool {
        self.beads.is_empty()
    }

    /// What is known of a bead.
    #[inline]
    pub fn attributes(&self, bead: usize) -> &Attributes {
        &self.beads[bead].1
    }

    /// The bead's points, as in [`BeadView::points`].
    #[inline]
    pub fn points(&self, bead: usize) -> &[[f64; 3]] {
        &self.points[self.beads[bead].0.clone()]
    }

    /// A bead as it was pushed, but for the lines of its segments.
    pub fn view<'a>(&'a self, bead: usize, sections: &'a mut Vec<Section>) -> BeadView<'a> {
        let (range, attributes) = &self.beads[bead];
        sections.clear();
        sections.extend((1..range.len()).map(|segment| self.section(bead, segment - 1)));
        let axes = self.axes.get(range.clone()).unwrap_or_default();
        BeadView { points: &self.points[range.clone()], axes, sections, lines: &[], attributes: *attributes }
    }

    /// The tool's axis at a bead's point.
    #[inline]
    pub fn axis(&self, bead: usize, point: usize) -> [f64; 3] {
        self.axes.get(self.beads[bead].0.start + point).copied().unwrap_or(UP)
    }

    /// Cross-section of a bead's segment.
    #[inline]
    pub fn section(&self, bead: usize, segment: usize) -> Section {
        self.sections[self.section_of[self.beads[bead].0.start + segment] as usize]
    }

    /// The line of the source that deposits a bead's segment, from 1; the bead's first where no more is known.
    #[inline]
    pub fn line(&self, bead: usize, segment: usize) -> u64 {
        let (points, attributes) = &self.beads[bead];
        let after = self.line_of.get(points.start + segment).copied().unwrap_or(0);
        attributes.lines.0.saturating_add(u64::from(after))
    }

    /// Memory taken.
    #[inline]
    pub fn heap_bytes(&self) -> u64 {
        let bytes = size_of_val(self.points.as_slice())
            + size_of_val(self.axes.as_slice())
            + size_of_val(self.section_of.as_slice())
            + size_of_val(self.sections.as_slice())
            + size_of_val(self.line_of.as_slice())
            + size_of_val(self.beads.as_slice());
        bytes as u64
    }
}

/// The axis of a tool that does not tilt.
pub const UP: [f64; 3] = [0.0, 0.0, 1.0];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn axes_and_sections_are_kept_by_bead() {
        let attributes = Attributes { layer: 0, tool: 0, feature: 0, lines: (1, 2), fed: None };
        let wide = Section { width: 0.8, height: 0.2 };
        let slim = Section { width: 0.5, height: 0.2 };
        let points = [[0.0; 3], [1.0, 0.0, 0.0], [2.0, 0.0, 0.0]];
        let tilted = [[0.0, 0.6, 0.8]; 3];
        let mut path = Toolpath::default();
        let (lines, axes) = (&[][..], &[][..]);
        path.push(BeadView { points: &points[..2], axes, sections: &[wide], lines, attributes });
        path.push(BeadView {
            points: &points,
            axes: &tilted,
            sections: &[wide, slim],
            lines: &[1, 7],
            attributes,
        });
        path.push(BeadView { points: &points, axes, sections: &[slim, slim], lines, attributes });
        assert_eq!(path.len(), 3);
        assert_eq!(path.points(1), points);
        assert_eq!([0, 1, 2].map(|bead| path.axis(bead, 1)), [UP, tilted[1], UP]);
        assert_eq!([path.section(0, 0), path.section(1, 0), path.section(1, 1)], [wide, wide, slim]);
        assert_eq!(path.section(2, 1), slim);
        assert_eq!([path.line(0, 0), path.line(1, 0), path.line(1, 1), path.line(2, 1)], [1, 1, 7, 1]);
    }
}
