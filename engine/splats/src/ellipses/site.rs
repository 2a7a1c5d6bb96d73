//! A site: the middle of an ellipse to be, and how wide a slab around its plane must be to reach a sample.

use super::bend::{BendTensor, across, add_square, normal_of, principal, times};
use super::samples::SurfaceSample;
use crate::lattice::{cross, dot, length, minus, unit};

/// Normals that are farther apart than 45 degrees cost.
const ASIDE: f64 = 0.707;
/// Steps to the centre of the smallest ellipse.
const STEPS: u32 = 48;

/// The middle of an ellipse to be.
#[derive(Clone, Copy, Debug)]
pub(super) struct Site {
    pub place: [f64; 3],
    pub normal: [f64; 3],
    /// Directions of the radii, and twice the width of the slab by the square of a length along each.
    pub axes: [[f64; 3]; 2],
    pub widths: [f64; 2],
    /// What was measured, as a share of what was expected.
    pub factor: f64,
    /// What its costs are multiplied by, so that it loses samples to others.
    pub weight: f64,
    /// The measured width.
    pub width: f64,
}

impl Site {
    /// A site with a normal and a tensor.
    pub fn new(place: [f64; 3], normal: [f64; 3], tensor: &BendTensor) -> Site {
        let [u, v] = across(normal);
        let (tu, tv) = (times(tensor, u), times(tensor, v));
        let (widths, [c, s]) = principal([dot(u, tu), dot(u, tv), dot(v, tv)]);
        let along = unit(std::array::from_fn(|a| u[a] * c + v[a] * s));
        Site {
            place,
            normal,
            axes: [along, cross(normal, along)],
            widths,
            factor: 1.0,
            weight: 1.0,
            width: 0.0,
        }
    }

    /// The width of a slab around the site's plane that reaches a sample, more if that faces elsewhere.
    #[inline(always)]
    pub fn cost(&self, place: [f64; 3], normal: [f64; 3]) -> f64 {
        let from = minus(place, self.place);
        let [x, y] = self.axes.map(|axis| dot(axis, from));
        let bent = (self.widths[0] * x * x + self.widths[1] * y * y) * 0.5 * self.factor;
        let above = dot(self.normal, from).abs();
        let aside = ASIDE - dot(self.normal, normal);
        let turned = if aside > 0.0 { aside * length(from) } else { 0.0 };
        (bent.max(above) + turned) * self.weight
    }

    /// A box that holds all samples of at most a cost.
    pub fn reach(&self, cost: f64) -> [[f64; 3]; 2] {
        let cost = cost / self.weight;
        let along = self.widths.map(|width| 2.0 * cost / (width * self.factor));
        let half: [f64; 3] = std::array::from_fn(|a| {
            let square = |n: usize| self.axes[n][a] * self.axes[n][a] * along[n];
            (square(0) + square(1)).sqrt() + cost * self.normal[a].abs()
        });
        [std::array::from_fn(|a| self.place[a] - half[a]), std::array::from_fn(|a| self.place[a] + half[a])]
    }

    /// Coordinates in the plane, in which the ellipse is a circle.
    pub fn round(&self, place: [f64; 3]) -> [f64; 2] {
        let from = minus(place, self.place);
        [0, 1].map(|n| dot(self.axes[n], from) * self.widths[n].sqrt())
    }

    /// The centre of the smallest circle around points, nearly (Bădoiu and Clarkson 2003).
    pub fn centre(points: &[[f64; 2]]) -> [f64; 2] {
        let mut centre = [0.0; 2];
        for step in 1..=STEPS {
            let far = points.iter().fold(([0.0; 2], -1.0), |worst: ([f64; 2], f64), point| {
                let square = square_between(*point, centre);
                if square > worst.1 { (*point, square) } else { worst }
            });
            (0..2).for_each(|n| centre[n] += (far.0[n] - centre[n]) / f64::from(step + 1));
        }
        centre
    }

    /// The place of coordinates that [`Site::round`] gives.
    pub fn flat(&self, at: [f64; 2]) -> [f64; 3] {
        let [x, y] = [0, 1].map(|n| at[n] / self.widths[n].sqrt());
        std::array::from_fn(|a| self.place[a] + self.axes[0][a] * x + self.axes[1][a] * y)
    }
}

pub(super) fn square_between(a: [f64; 2], b: [f64; 2]) -> f64 {
    let [x, y] = [a[0] - b[0], a[1] - b[1]];
    x * x + y * y
}

/// Means of what is a site's.
#[derive(Clone, Copy)]
pub(super) struct SiteSums {
    weight: f64,
    area: f64,
    normal: [f64; 3],
    place: [f64; 3],
    tensor: BendTensor,
}

impl SiteSums {
    pub const NONE: SiteSums =
        SiteSums { weight: 0.0, area: 0.0, normal: [0.0; 3], place: [0.0; 3], tensor: [0.0; 6] };

    /// Adds a sample. Its `weight` moves the place; normal and tensor are means of the surface.
    pub fn add(&mut self, sample: &SurfaceSample, tensor: &BendTensor, weight: f64) {
        let normal = normal_of(sample);
        self.weight += weight;
        let area = f64::from(sample.area);
        self.area += area;
        self.normal.iter_mut().zip(normal).for_each(|(sum, c)| *sum += c * area);
        self.place.iter_mut().zip(sample.place).for_each(|(sum, c)| *sum += c * weight);
        (0..6).for_each(|n| self.tensor[n] += tensor[n] * area);
    }

    /// A site in the mean, with at least `floor` along each direction; none of nothing.
    pub fn site(&self, floor: f64) -> Option<Site> {
        if self.weight == 0.0 {
            return None;
        }
        let normal = unit(self.normal);
        let mut tensor = self.tensor.map(|of| of / self.area);
        across(normal).into_iter().for_each(|axis| add_square(&mut tensor, axis, floor));
        Some(Site::new(self.place.map(|c| c / self.weight), normal, &tensor))
    }
}
