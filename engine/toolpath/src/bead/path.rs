//! The path of a bead: points, the tool's axis and cross-sections.

use crate::toolpath::{BeadView, Section, Toolpath, UP};

/// The path of one bead, wherever it is kept.
pub trait BeadPath {
    /// Where the tool's tip goes; consecutive points differ.
    fn points(&self) -> &[[f64; 3]];
    /// The tool's axis at a point.
    fn axis(&self, point: usize) -> [f64; 3];
    /// The cross-section of the segment that begins at a point.
    fn section(&self, segment: usize) -> Section;
}

impl BeadPath for BeadView<'_> {
    fn points(&self) -> &[[f64; 3]] {
        self.points
    }

    fn axis(&self, point: usize) -> [f64; 3] {
        self.axes.get(point).copied().unwrap_or(UP)
    }

    fn section(&self, segment: usize) -> Section {
        self.sections[segment]
    }
}

/// A bead of a toolpath, by its number.
impl BeadPath for (&Toolpath, usize) {
    fn points(&self) -> &[[f64; 3]] {
        self.0.points(self.1)
    }

    fn axis(&self, point: usize) -> [f64; 3] {
        self.0.axis(self.1, point)
    }

    fn section(&self, segment: usize) -> Section {
        self.0.section(self.1, segment)
    }
}
