//! One point's part of the field: a dipole spread over a small ball.

use super::super::open::{GROUP, Moments, Reach, SurfaceElement};
use super::surfels::Surfel;
use crate::lattice::{ROOT_BITS, RootCube, Units};
use bytemuck::{Pod, Zeroable};
use std::f64::consts::PI;

/// A surfel in lattice units.
///
/// With the area vector a at x, spread over a ball of radius ρ around x with a density that falls as 1 − (s/ρ)² from
/// the middle (Epanechnikov's kernel), it is seen from p at the distance r = |x − p| as
///
///   w = a·(x − p)/(4π) · { 1/r³ for r ≥ ρ;  (5 − 3 (r/ρ)²)/(2ρ³) for r < ρ }.
///
/// A dipole spread over a ball acts outside it as if all of it were in the middle (Newton's shell theorem), so beyond
/// ρ this is the dipole of Barill et al. 2018 itself, with the same expansions.
///
/// Within, the share of the density at less than r, (5 (r/ρ)³ − 3 (r/ρ)⁵)/2, acts as if it were in the middle, and the
/// rest not at all. w has a continuous gradient everywhere and is at most 0.099 a/ρ².
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct Dipole {
    position: [f64; 3],
    /// Outward normal with the length of the area.
    area: [f64; 3],
    /// The area over 4π.
    view: f64,
    /// Radius of the ball.
    radius: f64,
}

impl Dipole {
    /// A surfel snapped to the lattice of `root`.
    pub(super) fn new(surfel: &Surfel, root: RootCube) -> Dipole {
        let units = f64::from(1u32 << ROOT_BITS) / root.edge;
        let area = surfel.area.map(|c| c * (units * units));
        Dipole {
            position: root.snapper()(surfel.position).map(f64::from),
            area,
            view: area.iter().map(|c| c * c).sum::<f64>().sqrt() / (4.0 * PI),
            // Samples lie on odd positions and points on even ones, so no sample sees what is nearer than that.
            radius: (surfel.radius * units).max(1.0),
        }
    }

    /// Where it is: an even lattice position.
    pub(super) fn at(&self) -> Units {
        self.position.map(|c| c as i32)
    }

    /// Radius of the ball, in units.
    pub(super) fn radius(&self) -> f64 {
        self.radius
    }

    /// The way to it from a point.
    pub(super) fn way_from(&self, p: [f64; 3]) -> [f64; 3] {
        std::array::from_fn(|a| self.position[a] - p[a])
    }

    /// Its area over 4π.
    pub(super) fn view(&self) -> f64 {
        self.view
    }

    /// Its area vector over 4π.
    pub(super) fn over_four_pi(&self) -> [f64; 3] {
        self.area.map(|c| c * (0.25 / PI))
    }

    /// Position, area over 4π and radius about a centre, in units that are so many times larger.
    pub(super) fn about(&self, center: [f64; 3], scale: f64) -> ([f64; 3], [f64; 3], f64) {
        let position = std::array::from_fn(|a| (self.position[a] - center[a]) * scale);
        (position, self.area.map(|c| c * (scale * scale / (4.0 * PI))), self.radius * scale)
    }

    pub(super) fn seen_from(&self, p: [f64; 3]) -> f64 {
        let mut sums = [0.0; GROUP];
        self.add_to_group(&p.map(|c| [c; GROUP]), &mut sums);
        sums[0]
    }

    #[inline(always)]
    fn add_to_group(&self, at: &[[f64; GROUP]; 3], sums: &mut [f64; GROUP]) {
        let area = self.area.map(|c| c / (4.0 * PI));
        let ball = self.radius * self.radius;
        let (middle, falling) = (2.5 / (ball * self.radius), 1.5 / (ball * ball * self.radius));
        for l in 0..GROUP {
            let [x, y, z] = [0, 1, 2].map(|a| self.position[a] - at[a][l]);
            let squared = x * x + y * y + z * z;
            let within = middle - falling * squared;
            let beyond = 1.0 / (squared * squared.sqrt());
            let along = area[0] * x + area[1] * y + area[2] * z;
            sums[l] += along * if squared < ball { within } else { beyond };
        }
    }
}

impl SurfaceElement for Dipole {
    /// Points are taken one by one where a cluster is too near.
    const LEAF_ELEMENTS: usize = 8;

    fn position(&self) -> [f64; 3] {
        self.position
    }

    fn area(&self) -> f64 {
        self.area.iter().map(|c| c * c).sum::<f64>().sqrt()
    }

    /// Expansions hold outside the ball, and what they leave out goes by the distance of its middle.
    fn reach(&self, center: [f64; 3]) -> Reach {
        let d: [f64; 3] = std::array::from_fn(|a| self.position[a] - center[a]);
        let squared = d.iter().map(|c| c * c).sum::<f64>();
        let distance = squared.sqrt();
        let area = self.area();
        let third = area * squared * distance;
        Reach {
            farthest: distance + self.radius,
            area,
            spread: distance,
            powers: [third, third * distance, third * squared],
        }
    }

    fn add_to(&self, center: [f64; 3], moments: &mut Moments) {
        let d: [f64; 3] = std::array::from_fn(|a| self.position[a] - center[a]);
        moments.add(self.area, d, |i, j| d[i] * d[j]);
    }

    fn share_at(&self, p: Units) -> f64 {
        self.seen_from(p.map(f64::from))
    }

    #[inline(always)]
    fn add_shares<'a>(
        dipoles: impl Iterator<Item = &'a Dipole>,
        at: &[[f64; GROUP]; 3],
        _: impl Fn(usize) -> Units,
        sums: &mut [f64; GROUP],
    ) {
        dipoles.for_each(|dipole| dipole.add_to_group(at, sums));
    }
}
