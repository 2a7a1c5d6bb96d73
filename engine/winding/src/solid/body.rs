//! One segment of a bead as a solid: its frame, its formula, and the interval in which a line meets it.
//!
//! Only + − × ÷ and square roots, in one order, without fused operations: IEEE 754 fixes every result, so all
//! machines and all threads compute the same bits.

use super::profile::SolidProfile;
use super::segment::Segment;
use crate::lattice::{cross, dot, length};

/// A segment with its frame. Positions are relative to its first end, in lattice units.
#[derive(Clone, Copy, Debug)]
pub struct Body {
    profile: SolidProfile,
    /// The other end.
    end: [f64; 3],
    length: f64,
    /// Unit vectors along the segment, to its side, and upward; rows of a rotation.
    frame: [[f64; 3]; 3],
    /// Lower and upper end along each axis of space.
    extent: ([f64; 3], [f64; 3]),
    /// The segment lies in a layer, and the tool stands upright: `frame` is a rotation about z.
    is_flat: bool,
}

/// The squared sine of the angle between path and tool axis below which the axis does not tell which way is
/// up: a millionth of a radian.
const PARALLEL: f64 = 1e-12;
/// Steps of Newton's method. Towards a simple root each doubles the digits, at a line that just touches each
/// halves the error: 64 exhaust an f64 either way.
const STEPS: usize = 64;

impl Body {
    /// The solid of a segment with its profile.
    #[inline]
    pub fn new(segment: &Segment, profile: &SolidProfile) -> Body {
        let end = [0, 1, 2].map(|a| f64::from(segment.b[a] - segment.a[a]));
        let is_upright = profile.axis[0] == 0.0 && profile.axis[1] == 0.0;
        let is_flat = is_upright && segment.a[2] == segment.b[2];
        let (frame, length) = frame(end, profile.axis, is_flat);
        Body { profile: *profile, end, length, frame, extent: Default::default(), is_flat }.with_extent()
    }

    /// The same solid turned about z through its first end, by the angle that has this cosine and sine.
    #[inline]
    pub fn turned(&self, [cosine, sine]: [f64; 2]) -> Body {
        let turn = |v: [f64; 3]| [cosine * v[0] - sine * v[1], sine * v[0] + cosine * v[1], v[2]];
        Body { end: turn(self.end), frame: self.frame.map(turn), ..*self }.with_extent()
    }

    fn with_extent(self) -> Body {
        let Body { profile, end, frame, is_flat, .. } = self;
        let reach = match is_flat {
            true => [profile.half_width, profile.half_width, profile.half_height],
            false => frame[2].map(|cosine| profile.reach(cosine)),
        };
        let low = [0, 1, 2].map(|a| if end[a] < 0.0 { end[a] - reach[a] } else { -reach[a] });
        let high = [0, 1, 2].map(|a| if end[a] > 0.0 { end[a] + reach[a] } else { reach[a] });
        Body { extent: (low, high), ..self }
    }

    /// The cross-section.
    #[inline]
    pub(super) fn profile(&self) -> &SolidProfile {
        &self.profile
    }

    /// Unit vectors along the segment, to its side, and upward.
    #[inline]
    pub(super) fn frame(&self) -> [[f64; 3]; 3] {
        self.frame
    }

    /// The segment's length, in units.
    #[inline]
    pub(super) fn length(&self) -> f64 {
        self.length
    }

    /// The other end.
    #[inline]
    pub fn end(&self) -> [f64; 3] {
        self.end
    }

    /// The interval in which the line through `at` along `axis` meets the solid, as coordinates along that
    /// axis; the coordinate of `at` itself does not matter. `None` if the line misses the solid or only
    /// touches it.
    #[inline]
    pub fn line(&self, axis: usize, at: [f64; 3]) -> Option<(f64, f64)> {
        if !self.is_flat {
            return self.tilted_line(axis, at);
        }
        match axis {
            0 => self.flat_line([0, 1], self.half_width_at(at[2])?, at[1]),
            1 => self.flat_line([1, 0], self.half_width_at(at[2])?, at[0]),
            _ => self.upright_line(at),
        }
    }

    /// No point of the solid is farther than this from the segment.
    #[inline]
    pub fn reach(&self) -> f64 {
        let SolidProfile { half_width, half_height, .. } = self.profile;
        if self.is_flat { half_width } else { half_width + half_height }
    }

    /// What of an interval of the line through `at` along `axis` lies between the planes in which the segment ends; empty
    /// ones end before they begin.
    #[inline]
    pub fn between_ends(&self, axis: usize, mut at: [f64; 3], (from, to): (f64, f64)) -> (f64, f64) {
        at[axis] = 0.0;
        let (slope, along) = (self.frame[0][axis], dot(self.frame[0], at));
        if slope == 0.0 {
            return if self.beyond(along) == 0.0 { (from, to) } else { (to, from) };
        }
        let (first, last) = (-along / slope, (self.length - along) / slope);
        (from.max(first.min(last)), to.min(first.max(last)))
    }

    /// Half the width of a flat body at this height above its centre line. The height of its lower face
    /// belongs to it and that of its upper face does not.
    #[inline]
    pub fn half_width_at(&self, z: f64) -> Option<f64> {
        let SolidProfile { flat_side, flat_top, aspect, radius, .. } = self.profile;
        let top = flat_top + radius;
        if z < -top || z >= top {
            return None;
        }
        let above = z.abs() - flat_top;
        let above = if above > 0.0 { above } else { 0.0 };
        Some(flat_side + (positive(radius * radius - above * above) / aspect).sqrt())
    }

    /// Whether the body is flat, so that [`Body::half_width_at`] and [`Body::flat_line`] describe it.
    #[inline]
    pub fn is_flat(&self) -> bool {
        self.is_flat
    }

    /// The interval along axis `t` of a plane in which a flat body is a capsule of this half width, on the
    /// line where the coordinate along the plane's other axis `o` is `other`. Each part, two discs and the
    /// rectangle between them, is closed towards smaller and open towards larger `other`.
    #[inline]
    pub fn flat_line(&self, [t, o]: [usize; 2], half_width: f64, other: f64) -> Option<(f64, f64)> {
        let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
        let mut unite = |from: f64, to: f64| {
            low = if from < low { from } else { low };
            high = if to > high { to } else { high };
        };
        for centre in [[0.0; 2], [self.end[t], self.end[o]]] {
            let off = other - centre[1];
            if -half_width <= off && off < half_width {
                let half = positive(half_width * half_width - off * off).sqrt();
                unite(centre[0] - half, centre[0] + half);
            }
        }
        let (along, across) = (self.frame[0][t], self.frame[0][o]);
        // The rectangle: 0 ≤ along·t + across·other ≤ length and |across·t − along·other| ≤ half width.
        if across == 0.0 {
            if -half_width <= other && other < half_width {
                unite(self.end[t].min(0.0), self.end[t].max(0.0));
            }
        } else {
            let (a, b) = ((along * other - half_width) / across, (along * other + half_width) / across);
            let (mut from, mut to) = if a < b { (a, b) } else { (b, a) };
            if along != 0.0 {
                let (a, b) = (-across * other / along, (self.length - across * other) / along);
                let (first, last) = if a < b { (a, b) } else { (b, a) };
                from = if first > from { first } else { from };
                to = if last < to { last } else { to };
            } else if across * other < 0.0 || across * other > self.length {
                to = from;
            }
            if from < to {
                unite(from, to);
            }
        }
        (low < high).then_some((low, high))
    }

    /// The interval of a flat body along z.
    fn upright_line(&self, at: [f64; 3]) -> Option<(f64, f64)> {
        let SolidProfile { flat_side, flat_top, aspect, radius, .. } = self.profile;
        let [along, side, _] = self.local(at);
        let beyond = self.beyond(along);
        let d = (beyond * beyond + side * side).sqrt() - flat_side;
        let d = if d > 0.0 { d } else { 0.0 };
        let rest = radius * radius - aspect * d * d;
        let half = flat_top + positive(rest).sqrt();
        (rest >= 0.0 && half > 0.0).then_some((-half, half))
    }

    /// The interval of any body: Newton's method from both sides. The formula is convex along the line, so
    /// the iteration approaches the boundary from outside and never passes it but by rounding.
    fn tilted_line(&self, axis: usize, at: [f64; 3]) -> Option<(f64, f64)> {
        let (from, to) = self.extent(axis);
        let low = self.approach(axis, at, from - 1.0, 1.0)?;
        let high = self.approach(axis, at, to + 1.0, -1.0)?;
        (low < high).then_some((low, high))
    }

    /// The first point inside from `start`, which lies outside, in the direction `sign` along `axis`.
    fn approach(&self, axis: usize, mut at: [f64; 3], start: f64, sign: f64) -> Option<f64> {
        at[axis] = start;
        let direction = self.frame.map(|row| row[axis]);
        for _ in 0..STEPS {
            let (value, gradient) = self.formula(at);
            if value <= 0.0 {
                break;
            }
            let slope = sign * dot(gradient, direction);
            if slope >= 0.0 {
                return None;
            }
            let next = at[axis] - sign * (value / slope);
            if (next - at[axis]) * sign <= 0.0 {
                break;
            }
            at[axis] = next;
        }
        Some(at[axis])
    }

    /// Lower and upper end along an axis of space.
    #[inline]
    pub fn extent(&self, axis: usize) -> (f64, f64) {
        (self.extent.0[axis], self.extent.1[axis])
    }

    /// The left side of [`SolidProfile`]'s inequality minus the right one, and its gradient in the frame.
    fn formula(&self, at: [f64; 3]) -> (f64, [f64; 3]) {
        let SolidProfile { flat_side, flat_top, aspect, radius, .. } = self.profile;
        let [along, side, up] = self.local(at);
        let beyond = self.beyond(along);
        let mut value = -radius * radius;
        let mut gradient = [0.0; 3];
        let d = (beyond * beyond + side * side).sqrt();
        if d > flat_side {
            let excess = d - flat_side;
            value += aspect * excess * excess;
            let pull = 2.0 * aspect * excess / d;
            gradient[0] = pull * beyond;
            gradient[1] = pull * side;
        }
        let excess = up.abs() - flat_top;
        if excess > 0.0 {
            value += excess * excess;
            gradient[2] = if up < 0.0 { -2.0 * excess } else { 2.0 * excess };
        }
        (value, gradient)
    }

    /// The formula in units²: negative inside.
    #[inline]
    pub fn value(&self, at: [f64; 3]) -> f64 {
        self.formula(at).0
    }

    /// The direction of the formula's steepest ascent, in space; zero deep inside.
    #[inline]
    pub fn gradient(&self, at: [f64; 3]) -> [f64; 3] {
        let (_, g) = self.formula(at);
        [0, 1, 2].map(|a| g[0] * self.frame[0][a] + g[1] * self.frame[1][a] + g[2] * self.frame[2][a])
    }

    /// Whether the whole cube lies inside, with a margin far above rounding.
    #[inline]
    pub fn covers_cube(&self, low: [f64; 3], size: f64) -> bool {
        let margin = self.profile.radius * self.profile.radius * 1e-6;
        (0..3).all(|a| {
            let (from, to) = self.extent(a);
            from <= low[a] && low[a] + size <= to
        }) && (0..8usize).all(|corner| {
            // The solid is convex, so its corners speak for the cube.
            let at = [0, 1, 2].map(|a| if corner >> a & 1 == 1 { low[a] + size } else { low[a] });
            self.value(at) <= -margin
        })
    }

    /// Whether one of the frame's directions separates the cube from the solid, by more than rounding.
    #[inline]
    pub fn misses_cube(&self, low: [f64; 3], size: f64) -> bool {
        let half = 0.5 * size;
        let centre = self.local(low.map(|c| c + half));
        (0..3).any(|row| {
            let direction = self.frame[row];
            let cube = half * (direction[0].abs() + direction[1].abs() + direction[2].abs());
            let solid = self.profile.reach(if row == 2 { 1.0 } else { 0.0 });
            let to = if row == 0 { self.length } else { 0.0 };
            centre[row] + cube < -solid - 1.0 || centre[row] - cube > to + solid + 1.0
        })
    }

    /// Coordinates in the frame.
    #[inline]
    fn local(&self, at: [f64; 3]) -> [f64; 3] {
        let dot = |row: [f64; 3]| row[0] * at[0] + row[1] * at[1] + row[2] * at[2];
        [dot(self.frame[0]), dot(self.frame[1]), dot(self.frame[2])]
    }

    /// How far a position along the segment lies beyond one of its ends.
    #[inline]
    fn beyond(&self, along: f64) -> f64 {
        if along < 0.0 {
            along
        } else if along > self.length {
            along - self.length
        } else {
            0.0
        }
    }
}

/// Unit vectors along `end`, to the side and upward, and the length of `end`. Up is as near to `axis` as the
/// segment's direction allows; where the two are parallel, the coordinate axis farthest from the segment
/// stands in for it.
pub(super) fn frame(end: [f64; 3], axis: [f64; 3], is_flat: bool) -> ([[f64; 3]; 3], f64) {
    let size = length(end);
    let along = match size > 0.0 {
        true => end.map(|c| c / size),
        false => across(axis),
    };
    if is_flat {
        return ([along, [-along[1], along[0], 0.0], [0.0, 0.0, 1.0]], size);
    }
    let mut side = cross(axis, along);
    if dot(side, side) < PARALLEL {
        side = cross(across(along), along);
    }
    let width = length(side);
    let side = side.map(|c| c / width);
    ([along, side, cross(along, side)], size)
}

/// A unit vector perpendicular to a unit vector, of which the coordinate axis farthest from it is not far.
fn across(v: [f64; 3]) -> [f64; 3] {
    let mut least = 0;
    for a in 1..3 {
        if v[a].abs() < v[least].abs() {
            least = a;
        }
    }
    let mut unit = [0.0; 3];
    unit[least] = 1.0;
    let w = [0, 1, 2].map(|a| unit[a] - v[least] * v[a]);
    let size = length(w);
    w.map(|c| c / size)
}

/// `v`, or 0 where rounding made it negative.
#[inline]
fn positive(v: f64) -> f64 {
    if v > 0.0 { v } else { 0.0 }
}
