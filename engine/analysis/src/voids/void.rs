//! One void: its sizes, and what is known of it.

use super::class::Class;
use super::trace::Trace;
use std::f64::consts::PI;

/// A region of w = 0 that the part encloses. Lengths are in the store's unit; what is not known is `None`.
#[derive(Clone, Debug)]
pub struct Void {
    /// By volume, from 1.
    pub id: usize,
    /// What it is taken for, where something tells.
    pub class: Option<Class>,
    /// Whether it opens to the outside.
    pub seal: Seal,
    /// The diameter of the largest ball that can leave it, mostly one or two cells of the grid too narrow; 0 of a void that is sealed,
    /// NaN of one that opens through what no sample shows.
    pub throat: f64,
    /// The component, or behind all components the pore.
    pub(super) component: usize,
    /// The share of its samples at which the CAD part is solid.
    pub cad_share: Option<f64>,
    /// Volume within the contour's polygons; where these do not close, the mean over the chords along three axes.
    pub volume: f64,
    /// The spread of chords, twice their mean's distance from the number of samples, as `analysis::volume` has it, and what
    /// surface and chords differ by; half a cell for each cell along the side, and up to three of a void of few cells, at least.
    pub volume_error: f64,
    /// Area of the surface around it; 0 of a void that opens through a throat, which has none.
    pub surface: f64,
    /// Diameter of the largest ball in it; `None` where cells are too coarse to tell.
    pub inner_diameter: Option<f64>,
    /// Diameter of the smallest ball around it.
    pub diameter: f64,
    /// By chords along all axes.
    pub centroid: [f64; 3],
    /// Least and greatest coordinates.
    pub bounds: [[f64; 3]; 2],
    /// Samples less edges, plus faces, less cells; of 6-connected voids whose leaves match sample by sample.
    pub euler: Option<i64>,
    /// Least distance to another void.
    pub gap: Option<f64>,
    /// Least distance to the outer surface.
    pub edge_distance: Option<f64>,
    /// The beads around it, where the store tells them apart.
    pub trace: Option<Box<Trace>>,
    /// Longest over shortest side of the box along the principal axes of its surface.
    pub elongation: Option<f64>,
    /// Areas of the shadows along x, y and z, of which parts that lie behind others count as well.
    pub projected: Option<[f64; 3]>,
}

impl Void {
    /// Diameter of the ball of its volume.
    pub fn equivalent_diameter(&self) -> f64 {
        (6.0 * self.volume / PI).cbrt()
    }

    /// Bound on the error of that.
    pub fn equivalent_diameter_error(&self) -> f64 {
        // Of the cube root; a volume that may be nothing has no diameter either.
        let low = (6.0 * (self.volume - self.volume_error).max(0.0) / PI).cbrt();
        self.equivalent_diameter() - low
    }

    /// Area of the ball of its volume over its own (Wadell 1932); `None` without a surface, and where volume and surface are
    /// so uncertain that the ball would have the larger one, as of voids of a cell or two.
    pub fn sphericity(&self) -> Option<f64> {
        let ball = PI.cbrt() * (6.0 * self.volume).powf(2.0 / 3.0);
        // Rounding: nothing is as round as a ball.
        (self.surface > 0.0 && ball <= self.surface * 1.005).then(|| (ball / self.surface).min(1.0))
    }

    /// Its volume over that of the smallest ball around it.
    pub fn compactness(&self) -> Option<f64> {
        (self.diameter > 0.0).then(|| self.volume / (PI / 6.0 * self.diameter.powi(3)))
    }
}

/// Whether a void opens to the outside.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Seal {
    /// It does not, whatever lies between samples.
    Certain,
    /// It does not as far as samples tell.
    ToCell,
    /// It does: through a throat, or through what no sample shows.
    Open,
}
