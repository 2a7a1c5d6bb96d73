//! Balls inside the solid, or outside of it: where their centres may go so that they grow.
//!
//! Whatever its centre, a ball whose radius is the distance of the centre from the surface holds no surface. So a place that is
//! wrong costs size and never truth.

use super::answers::{BallAt, Place};
use super::patch::Shape;
use super::sides::Sides;
use super::surface::Surface;
use super::thickness::{PreviousContact, largest_ball};
use crate::error::Result;
use crate::lattice::{dot, length, minus};

/// Surface that is turned by less than this against that at the point does not bound a first guess, as cosine: 30°.
const APART: f64 = 0.866;
/// The least change of the radius along the medial axis, by the way, that is worth following.
pub(super) const SLOPE: f64 = 0.1;
/// What a ball that has lost its point weighs against its growth.
const PENALTY: f64 = 8.0;
/// By so many cells a ball may miss its point: distances are off by that.
pub(super) const MISS: f64 = 0.003;
/// By so many cells and such a part of the radius, and more, a bent patch reaches into a ball before it bounds it.
pub(super) const INTO: f64 = 8e-4;
pub(super) const INTO_PART: f64 = 3e-4;
/// Steps of a climb in cells: the first, the longest, and the one that is too short.
const FIRST_STEP: f64 = 0.15;
const LONGEST_STEP: f64 = 1.0;
const LAST_STEP: f64 = 0.01;
/// Distances that a climb asks for at most.
const TRIALS: usize = 30;
/// A place is the highest nearby where what is seen around grows by less than this, and tells of no more than so
/// many cells, or such a part of the radius.
const FLAT: f64 = 0.05;
const ENOUGH: f64 = 0.01;
const ENOUGH_PART: f64 = 0.002;
/// Directions that are remembered.
const DIRECTIONS: usize = 6;

/// A ball without surface. Lengths are in cells.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct InscribedBall {
    pub centre: [f64; 3],
    pub radius: f64,
    /// Whether balls beside it are not larger.
    pub is_flat: bool,
}

/// What balls are sought in.
pub(super) struct Medium<'a> {
    pub surface: &'a Surface,
    pub sides: Sides<'a>,
    /// Outside of the part.
    pub gaps: bool,
    /// No ball is larger.
    pub most: f64,
}

/// The distance of a place from the surface, and the unit vector from there.
type DepthAt = (f64, [f64; 3]);

fn unit(v: [f64; 3]) -> [f64; 3] {
    let length = length(v).max(f64::MIN_POSITIVE);
    v.map(|c| c / length)
}

fn along(at: [f64; 3], toward: [f64; 3], way: f64) -> [f64; 3] {
    std::array::from_fn(|a| at[a] + way * toward[a])
}

/// What a climb has seen: the goal at a place, and how it grows there.
#[derive(Clone, Copy)]
struct Trial {
    at: [f64; 3],
    value: f64,
    slope: [f64; 3],
}

impl Trial {
    /// By how much the goal elsewhere is below what this trial tells of it, and so may still grow.
    fn doubt(&self, at: [f64; 3], value: f64) -> f64 {
        (self.value + dot(self.slope, minus(at, self.at)) - value).max(0.0)
    }
}

/// The point of the hull of slopes that is nearest to the origin (Gilbert 1966): along it all of them grow. With the mean of
/// doubts that belongs to it.
fn least_of_hull(trials: &[Trial], (at, value): ([f64; 3], f64)) -> ([f64; 3], f64) {
    let (mut least, mut doubt) = (trials[0].slope, trials[0].doubt(at, value));
    for _ in 0..40 {
        let to = trials.iter().min_by(|a, b| dot(a.slope, least).total_cmp(&dot(b.slope, least)));
        let Some(to) = to else { break };
        let way = minus(to.slope, least);
        let (gain, size) = (-dot(least, way), dot(way, way));
        if gain <= 1e-6 || size <= 0.0 {
            break;
        }
        let part = (gain / size).min(1.0);
        least = along(least, way, part);
        doubt += part * (to.doubt(at, value) - doubt);
    }
    (least, doubt)
}

impl Medium<'_> {
    /// How deep a place is, likely at most so many cells; `None` on the other side of the surface.
    fn depth(&self, at: [f64; 3], within: f64) -> Result<Option<DepthAt>> {
        let mut foot = self.surface.closest(at, within.min(self.most));
        if foot.is_none() && within < self.most {
            foot = self.surface.closest(at, self.most);
        }
        let (distance, says) = foot.map_or((self.most, self.gaps), |foot| (foot.distance, foot.inside));
        let inside = self.sides.inside(at, distance, says)?;
        let away = foot.map_or([0.0; 3], |foot| unit(minus(at, foot.at)));
        Ok((inside != self.gaps).then_some((distance.min(self.most), away)))
    }

    /// The largest ball with this centre, likely within so many cells.
    pub fn ball_at(&self, centre: [f64; 3], within: f64) -> Result<Option<InscribedBall>> {
        let depth = self.depth(centre, within)?;
        Ok(depth.map(|(radius, _)| InscribedBall { centre, radius, is_flat: radius >= self.most }))
    }

    /// The largest ball that touches a place of the surface with its outward normal. Where balls beside it do not grow as they
    /// should, it climbs, so that the largest of all is among those of all crossings.
    pub fn touching(
        &self,
        (place, outward): ([f64; 3], [f64; 3]),
        last: &mut PreviousContact,
    ) -> Result<Option<InscribedBall>> {
        let outward = self.surface.normal_around(place, outward);
        let toward = if self.gaps { outward } else { outward.map(|c| -c) };
        let touch = BallAt { at: place, toward, outward };
        let found = largest_ball(self.surface, touch, (self.most, APART), !self.gaps, last);
        let Some((radius, bound)) = found else {
            return self.ball_at(along(place, toward, self.most), self.most);
        };
        let centre = along(place, toward, radius);
        let Some(mut ball) = self.checked(centre, radius, bound.place)? else { return Ok(None) };
        let other = unit(minus(centre, bound.at));
        let up: [f64; 3] = std::array::from_fn(|a| 0.5 * (toward[a] + other[a]));
        let slope = length(up);
        if slope < SLOPE || ball.is_flat {
            ball.is_flat = true;
            return Ok(Some(ball));
        }
        let (at, enough) = (along(centre, unit(up), 1.0), ball.radius + 0.7 * slope);
        let Some(foot) = self.surface.closest(at, enough) else { return Ok(Some(ball)) };
        if self.sides.inside(at, foot.distance, foot.inside)? == self.gaps {
            return Ok(Some(ball));
        }
        let touching = |slope| Trial { at: centre, value: ball.radius, slope };
        let beside = Trial { at, value: foot.distance, slope: unit(minus(at, foot.at)) };
        self.climbed_from(ball, None, vec![touching(toward), touching(other), beside]).map(Some)
    }

    /// A ball that one patch bounds, without what of others reaches into it. Bent patches may do so by little, and those that
    /// touch a ball in a tube are many; they are not asked by how much.
    fn checked(&self, centre: [f64; 3], radius: f64, bound: Place) -> Result<Option<InscribedBall>> {
        let is_plane = self.surface.piece(bound.leaf as usize).patch(bound).shape() == Shape::Plane;
        let within = if is_plane { radius * (1.0 - 1e-6) } else { radius * (1.0 - INTO_PART) - INTO };
        if within <= 0.0 {
            return self.ball_at(centre, radius + 0.1);
        }
        let foot = self.surface.closest(centre, within);
        let (radius, says) = foot.map_or((within, !self.gaps), |foot| (foot.distance, foot.inside));
        let inside = self.sides.inside(centre, radius, says)?;
        let is_flat = radius >= self.most * (1.0 - 1e-6);
        Ok((inside != self.gaps).then_some(InscribedBall { centre, radius, is_flat }))
    }

    /// A ball moved to where it is largest, nearby, and, if a place is given, holds that place.
    ///
    /// Depth grows along the way from the foot, but has many feet on the medial axis. So directions of trials are remembered,
    /// and the next one is that along which all of them grow (bundle methods, Lemaréchal 1975).
    pub fn climbed(&self, ball: InscribedBall, place: Option<[f64; 3]>) -> Result<InscribedBall> {
        let Some((depth, away)) = self.depth(ball.centre, ball.radius + 0.01)? else { return Ok(ball) };
        self.climbed_from(ball, place, vec![Trial { at: ball.centre, value: depth, slope: away }])
    }

    /// See [`Medium::climbed`]; the first of what was seen is of the ball's centre, whose depth is its value.
    fn climbed_from(
        &self,
        ball: InscribedBall,
        place: Option<[f64; 3]>,
        seen: Vec<Trial>,
    ) -> Result<InscribedBall> {
        // What grows at a place, and the direction in which it does.
        let goal = |at: [f64; 3], (depth, away): DepthAt| -> (f64, [f64; 3]) {
            let Some(place) = place else { return (depth, away) };
            let to = minus(at, place);
            let miss = length(to) - depth;
            if miss <= 0.0 {
                return (depth, away);
            }
            let from = unit(to);
            let turned = std::array::from_fn(|a| (1.0 + PENALTY) * away[a] - PENALTY * from[a]);
            (depth - PENALTY * miss, turned)
        };
        let holds = |at: [f64; 3], depth: f64| place.is_none_or(|p| length(minus(at, p)) <= depth + MISS);
        let mut best = ball;
        let mut reach = seen[0].value;
        let weighed = |trial: Trial| {
            let (value, slope) = goal(trial.at, (trial.value, trial.slope));
            Trial { value, slope, ..trial }
        };
        let mut trials: Vec<Trial> = seen.into_iter().map(weighed).collect();
        let (mut here, mut step) = (trials[0], FIRST_STEP);
        let enough = ENOUGH.max(ENOUGH_PART * ball.radius);
        for _ in 0..TRIALS {
            let (up, doubt) = least_of_hull(&trials, (here.at, here.value));
            let growth = length(up);
            if step < LAST_STEP || growth < FLAT && doubt < enough {
                best.is_flat |= place.is_none();
                break;
            }
            if growth < FLAT {
                // What was seen too far away tells nothing of this place.
                trials.retain(|trial| trial.doubt(here.at, here.value) < enough);
                trials.push(here);
                step *= 0.5;
                continue;
            }
            let at = along(here.at, unit(up), step);
            let Some(depth) = self.depth(at, reach + step + 0.01)? else {
                step *= 0.5;
                continue;
            };
            let (value, slope) = goal(at, depth);
            let trial = Trial { at, value, slope };
            if depth.0 > best.radius && holds(at, depth.0) {
                (best.centre, best.radius) = (at, depth.0);
            }
            if trials.len() == DIRECTIONS {
                trials.remove(0);
            }
            trials.push(trial);
            if value > here.value + 0.2 * step * growth {
                (here, reach) = (trial, depth.0);
                step = (1.5 * step).min(LONGEST_STEP);
            } else if dot(slope, up) > 0.8 * growth * growth {
                step *= 0.5;
            }
        }
        Ok(best)
    }
}
