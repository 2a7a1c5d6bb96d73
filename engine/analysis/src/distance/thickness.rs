//! Thickness of walls, and width of gaps, at points of the surface.

use super::answers::{BallAt, Foot, Place};
use super::regions::{Region, joined, marked};
use super::surface::{PatchInfo, Surface};
use crate::error::Result;
use crate::lattice::dot;
use crate::progress::Progress;

/// How far from a given point its foot on the surface is looked for, in cells.
const REACH: f64 = 4.0;
/// Within so many cells it is nearly always.
const NEAR: f64 = 0.6;
/// What is opposite of a point whose ray meets nothing is turned by this many degrees against it at least.
const BESIDE: f64 = 150.0;

/// What thickness is measured by.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Method {
    /// The largest ball on the inner side that touches the point and holds no surface.
    Sphere {
        /// Surface whose normal is turned by less than this against that at the point does not bound the ball, in degrees.
        separation: f64,
    },
    /// The way against the normal to the opposite surface.
    Ray,
}

/// What to measure.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Options {
    /// By what.
    pub method: Method,
    /// Gaps outside of the part in the place of walls.
    pub gaps: bool,
}

/// Thickness at a point, in cells.
#[derive(Clone, Copy, Debug)]
pub struct Measured {
    /// Diameter of the ball or length of the ray; infinite where nothing is opposite, as of gaps at the outside.
    pub value: f64,
    /// What is opposite.
    pub opposite: Option<Place>,
}

/// What there is opposite of nothing.
const NOTHING: Measured = Measured { value: f64::INFINITY, opposite: None };

/// A room to look in: all of the root.
pub(super) fn farthest(surface: &Surface) -> f64 {
    2.0 * surface.root().edge / surface.cell()
}

/// What bounded the ball at the point before: of points in order it often bounds the next one.
#[derive(Clone, Copy, Debug, Default)]
pub struct PreviousContact(Option<Place>);

/// At a point of the surface with its outward unit normal, in cells.
pub fn at(
    surface: &Surface,
    (place, outward): ([f64; 3], [f64; 3]),
    options: Options,
    last: &mut PreviousContact,
) -> Measured {
    let outward = surface.normal_around(place, outward);
    let toward = if options.gaps { outward } else { outward.map(|c| -c) };
    let most = farthest(surface);
    match options.method {
        Method::Ray => {
            let Some(hit) = surface.ray(place, toward, most, !options.gaps) else {
                // Near an edge a ray may pass between two patches that do not quite meet. A ball does not.
                let apart = BESIDE.to_radians().cos();
                let (radius, contact) = surface.ball(BallAt { at: place, toward, outward }, most, apart);
                return contact.map_or(NOTHING, |contact| Measured {
                    value: 2.0 * radius,
                    opposite: Some(contact.place),
                });
            };
            Measured { value: hit.distance, opposite: Some(hit.place) }
        }
        Method::Sphere { separation } => {
            let apart = separation.to_radians().cos();
            let touch = BallAt { at: place, toward, outward };
            let found = largest_ball(surface, touch, (most, apart), !options.gaps, last);
            found.map_or(NOTHING, |(radius, bound)| Measured {
                value: 2.0 * radius,
                opposite: Some(bound.place),
            })
        }
    }
}

/// The radius of the largest ball that touches a place, at most `most`, and what bounds it; `None` if nothing does. See
/// [`Surface::ball`].
pub(super) fn largest_ball(
    surface: &Surface,
    touch: BallAt,
    (most, apart): (f64, f64),
    is_inside: bool,
    last: &mut PreviousContact,
) -> Option<(f64, Foot)> {
    let mut begin = (most, None);
    if let Some(patch) = last.0 {
        begin = surface.ball_before(touch, most, apart, patch);
    }
    if begin.1.is_none() {
        // What a ray meets bounds the ball, too, so that it starts small.
        let through = surface.ray(touch.at, touch.toward, most, is_inside);
        let seed = through.filter(|hit: &Foot| dot(hit.normal, touch.outward) <= apart);
        begin = (seed.map_or(most, |hit| (0.5 * hit.distance).min(most)), seed);
    }
    let (radius, contact) = surface.ball(touch, begin.0, apart);
    let bound = contact.or(begin.1)?;
    last.0 = Some(bound.place);
    Some((radius, bound))
}

/// At a world position, which is first moved onto the surface; `None` if that is farther than four cells. In world units.
pub fn at_world(
    surface: &Surface,
    world: [f64; 3],
    options: Options,
    last: &mut PreviousContact,
) -> Option<Measured> {
    let from = surface.to_cells(world);
    let foot = surface.closest(from, NEAR).or_else(|| surface.closest(from, REACH))?;
    let measured = at(surface, (foot.at, foot.normal), options, last);
    Some(Measured { value: measured.value * surface.cell(), ..measured })
}

/// Walls thinner, or gaps narrower, than `below` world units, the largest area first: connected patches of surface, those on
/// both sides of a wall together.
///
/// # Errors
/// If there is no surface; [`crate::error::Error::Interrupted`].
pub fn thin_regions(
    surface: &Surface,
    options: Options,
    below: f64,
    progress: &dyn Progress,
) -> Result<Vec<Region>> {
    surface.require_any()?;
    let value = |last: &mut PreviousContact, patch: &PatchInfo| {
        let measured = at(surface, (patch.at, patch.normal), options, last);
        let value = measured.value * surface.cell();
        Ok((value < below).then_some((value, measured.opposite)))
    };
    let mut regions = joined(marked(surface, progress, value)?);
    // A wall is measured from both of its sides.
    regions.iter_mut().for_each(|region| region.volume *= 0.5);
    Ok(regions)
}
