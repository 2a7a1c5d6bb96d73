//! Deviation of a part from a reference: signed distances both ways, and where they are too large.

use super::cloud::MeasuredPart;
use super::numbers::{PointNumbers, numbers};
use super::regions::{Region, joined, marked};
use super::sides::Sides;
use super::surface::{PatchInfo, Surface};
use super::triangles::{PreviousPlace, Triangles};
use crate::error::Result;
use crate::progress::Progress;
use std::path::Path;

pub use super::answers::ReferencePoint;
pub use super::motion::Motion;

/// By so many cells the nearest point of a place may be farther than that of the place before tells: more than both are off by.
const SLACK: f64 = 0.1;

/// Shares of points, in percent, that lie below the numbers told of a spread.
pub const PERCENTILES: [f64; 5] = [0.1, 1.0, 50.0, 99.0, 99.9];

/// The same of distances to either side.
pub const ABSOLUTE_PERCENTILES: [f64; 4] = [50.0, 95.0, 99.0, 99.9];

/// What a part is compared with.
#[derive(Clone, Copy)]
pub enum Reference<'a> {
    /// A mesh.
    Mesh(&'a Triangles),
    /// The surface of a store, and its samples.
    Store(&'a Surface, &'a Sides<'a>),
    /// Points that were measured, as by a scanner, on some of the surface.
    Cloud(MeasuredPart<'a>),
}

/// How signed distances are spread.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize)]
pub struct Spread {
    /// How many points.
    pub points: usize,
    /// Their mean.
    pub mean: f64,
    /// The root of the mean of their squares.
    pub rms: f64,
    /// The least.
    pub min: f64,
    /// What [`PERCENTILES`] of all are at most.
    pub percentiles: [f64; 5],
    /// Within which distance to either side [`ABSOLUTE_PERCENTILES`] of all lie.
    pub absolute: [f64; 4],
    /// The greatest.
    pub max: f64,
}

impl Reference<'_> {
    /// The box around it.
    pub fn bounds(&self) -> [[f64; 3]; 2] {
        match self {
            Reference::Mesh(triangles) => triangles.bounds(),
            Reference::Store(surface, _) => surface.bounds().unwrap_or_default(),
            Reference::Cloud(measured) => measured.cloud.bounds(),
        }
    }

    /// The nearest point, with the signed distance.
    ///
    /// # Errors
    /// What reading the store gives.
    pub fn opposite(&self, from: [f64; 3]) -> Result<ReferencePoint> {
        self.opposite_next(from, &mut PreviousPlace::default())
    }

    /// As [`Reference::opposite`], of places of which most are near the one before: many times faster.
    ///
    /// # Errors
    /// As [`Reference::opposite`].
    pub fn opposite_next(&self, from: [f64; 3], last: &mut PreviousPlace) -> Result<ReferencePoint> {
        match self {
            Reference::Mesh(triangles) => {
                let (signed, nearest) = triangles.signed(from, last);
                Ok(ReferencePoint { at: nearest.at, normal: nearest.normal, signed })
            }
            Reference::Store(surface, sides) => of_surface(surface, sides, from, last),
            Reference::Cloud(measured) => Ok(measured.opposite(from)),
        }
    }

    /// The nearest point without the sign, which takes less time of a mesh.
    ///
    /// # Errors
    /// As [`Reference::opposite`].
    pub fn nearest(&self, from: [f64; 3]) -> Result<ReferencePoint> {
        match self {
            Reference::Mesh(triangles) => {
                let nearest = triangles.nearest(from);
                Ok(ReferencePoint { at: nearest.at, normal: nearest.normal, signed: nearest.distance })
            }
            Reference::Store(surface, sides) => {
                of_surface(surface, sides, from, &mut PreviousPlace::default())
            }
            Reference::Cloud(measured) => Ok(measured.opposite(from)),
        }
    }

    /// Points of it, at most about so many: of a mesh vertices and points spread by area, of a store crossings, and those of a cloud.
    pub fn samples(&self, most: usize) -> Vec<[f64; 3]> {
        match self {
            Reference::Mesh(triangles) => triangles.samples(most),
            Reference::Cloud(measured) => measured.cloud.samples(most),
            Reference::Store(surface, _) => {
                let step = (surface.patches() as usize).div_ceil(most).max(1);
                let mut points = Vec::new();
                for leaf in 0..surface.leaves().len() {
                    let patches = surface.patches_of(leaf);
                    points.extend(patches.iter().step_by(step).map(|patch| surface.to_world(patch.at)));
                }
                points
            }
        }
    }
}

/// The signed distance of a world position from the surface of a store, with the nearest point. What was found at the place
/// before, which should be near, makes the search short.
///
/// # Errors
/// What reading the surface gives.
pub fn of_surface(
    surface: &Surface,
    sides: &Sides<'_>,
    from: [f64; 3],
    last: &mut PreviousPlace,
) -> Result<ReferencePoint> {
    surface.require_any()?;
    let at = surface.to_cells(from);
    let mut foot = surface.closest(at, last.reach(at) + SLACK);
    if foot.is_none() {
        foot = surface.closest(at, f64::INFINITY);
    }
    let Some(foot) = foot else {
        return Ok(ReferencePoint { at: from, normal: [0.0; 3], signed: f64::INFINITY });
    };
    last.keep(at, foot.distance);
    let distance = foot.distance * surface.cell();
    let signed = if sides.inside(at, foot.distance, foot.inside)? { -distance } else { distance };
    Ok(ReferencePoint { at: surface.to_world(foot.at), normal: foot.normal, signed })
}

/// Asks for a number at all points, on all threads, in order. `number` may keep something from one point to the next. `take` is
/// shown points with their numbers, in order. Numbers take so many bytes of memory, with a file in `folder` for what does not fit.
///
/// # Errors
/// What `number` and `take` give; [`crate::error::Error::Interrupted`].
pub fn at_points<L: Default>(
    points: &[[f64; 3]],
    (memory, folder): (u64, &Path),
    progress: &dyn Progress,
    number: impl Fn(&mut L, [f64; 3]) -> Result<f64> + Sync,
    mut take: impl FnMut(&[[f64; 3]], &[f32]) -> Result<()> + Send,
) -> Result<PointNumbers> {
    progress.phase("distances", Some(points.len() as u64), "points");
    let mut found = PointNumbers::new(memory, folder);
    let number = |last: &mut L, p| Ok(number(last, p)? as f32);
    numbers(points, progress, number, |points, numbers| {
        take(points, numbers)?;
        found.extend(numbers)
    })?;
    Ok(found)
}

impl Spread {
    /// Of some signed distances.
    pub fn of(values: &PointNumbers) -> Spread {
        let (_, points) = values.counts();
        if points == 0 {
            return Spread::default();
        }
        let (mut sum, mut squares) = (0.0, 0.0);
        for value in values.iter() {
            sum += value;
            squares += value * value;
        }
        let place = |share: f64| ((points as f64 * share / 100.0).ceil() as usize).clamp(1, points) - 1;
        let ranks: Vec<usize> = PERCENTILES.into_iter().map(place).chain([0, points - 1]).collect();
        let told = values.at_ranks(&ranks, |value| value);
        let absolute = values.at_ranks(&ABSOLUTE_PERCENTILES.map(place), f64::abs);
        let (percentiles, ends) = told.split_at(PERCENTILES.len());
        Spread {
            points,
            mean: sum / points as f64,
            rms: (squares / points as f64).sqrt(),
            min: ends[0],
            percentiles: std::array::from_fn(|n| percentiles[n]),
            absolute: std::array::from_fn(|n| absolute[n]),
            max: ends[1],
        }
    }

    /// The largest distance to either side.
    pub fn largest(&self) -> f64 {
        self.max.max(-self.min)
    }
}

/// Connected surface of the part that is farther than `within` from the reference, first what lies outside of it, then what
/// lies inside, each with the largest area first. `motion` takes the part to the reference.
///
/// # Errors
/// What reading the surfaces gives.
pub fn regions_beyond(
    part: &Surface,
    reference: Reference<'_>,
    (motion, within): (Motion, f64),
    progress: &dyn Progress,
) -> Result<[Vec<Region>; 2]> {
    let value = |last: &mut PreviousPlace, patch: &PatchInfo| {
        let value = reference.opposite_next(motion.apply(part.to_world(patch.at)), last)?.signed;
        Ok((value.abs() > within).then_some((value, None)))
    };
    let mut sides = [Vec::new(), Vec::new()];
    for marked in marked(part, progress, value)? {
        sides[usize::from(marked.value < 0.0)].push(marked);
    }
    Ok(sides.map(joined))
}
