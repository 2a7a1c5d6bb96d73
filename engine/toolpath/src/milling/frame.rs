//! The coordinates of a program in those of the part: work offsets, shifts, mirrors, scales, rotations in the
//! plane of G17, and tilted planes.

use super::moves::POSITION_MAX;
use super::plane::TiltedPlane;
use crate::toolpath::gcode::tilt::sine_and_cosine;
use std::collections::BTreeMap;

/// What has been set so far, all in mm.
#[derive(Clone, Debug, Default)]
pub(super) struct WorkFrame {
    /// Work offsets that are set: 0 to 8 of G54 to G59.3, further ones from [`WorkFrame::FURTHER`] on.
    systems: BTreeMap<usize, [f64; 3]>,
    /// The one that counts.
    pub system: usize,
    /// What G92 has added.
    shift: [f64; 3],
    /// What G52 has added.
    local: [f64; 3],
    /// Where G51.1 mirrors, axis by axis. It is the first to count, then G51, then G68.
    mirrors: [Option<f64>; 3],
    scaling: Option<Scaling>,
    turned: Option<Rotation>,
    /// The plane of G68.2. Within it zero is its own, and no mirror, scale or rotation counts.
    pub plane: Option<TiltedPlane>,
}

/// Factors of G51, negative ones for mirrors.
#[derive(Clone, Copy, Debug)]
struct Scaling {
    centre: [f64; 3],
    factors: [f64; 3],
}

/// A rotation of G68.
#[derive(Clone, Copy, Debug)]
struct Rotation {
    /// In the part's coordinates.
    centre: [f64; 2],
    /// Cosine and sine of the angle, which is counter-clockwise.
    turn: [f64; 2],
}

impl Rotation {
    fn turned(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        let [cos, sin] = self.turn;
        [cos * x - sin * y, sin * x + cos * y]
    }

    /// Where a place lies that is programmed at `at`, or with the opposite turn where one lies in the program.
    fn moved(&self, at: [f64; 2]) -> [f64; 2] {
        let way = self.turned([at[0] - self.centre[0], at[1] - self.centre[1]]);
        [self.centre[0] + way[0], self.centre[1] + way[1]]
    }

    fn back(&self) -> Rotation {
        Rotation { turn: [self.turn[0], -self.turn[1]], ..*self }
    }
}

impl WorkFrame {
    /// Numbers of G54.1 P1 to P300 and of G154 P1 to P99 follow these.
    pub const FURTHER: [usize; 2] = [100, 500];

    /// Where the program's zero lies along an axis, before any rotation; in a tilted plane, within that.
    pub fn origin(&self, axis: usize) -> f64 {
        if self.plane.is_some() {
            return 0.0;
        }
        self.systems.get(&self.system).map_or(0.0, |system| system[axis])
            + self.shift[axis]
            + self.local[axis]
    }

    /// Sets a work offset, or by `None` the one that counts.
    pub fn set_system(&mut self, number: Option<usize>, axis: usize, value: f64) {
        self.systems.entry(number.unwrap_or(self.system)).or_default()[axis] = value;
    }

    /// G92: the program calls the place `at` by `value` from now on.
    pub fn name_place(&mut self, axis: usize, at: f64, value: f64) {
        self.shift[axis] += at - self.origin(axis) - value;
    }

    /// G92.1: as if G92 had not been.
    pub fn forget_places(&mut self) {
        self.shift = [0.0; 3];
    }

    /// G52: zero lies so far from that of the work offset.
    pub fn set_local(&mut self, axis: usize, value: f64) {
        self.local[axis] = value;
    }

    /// G68: what follows is turned about a place of the program, by degrees.
    pub fn turn(&mut self, centre: [f64; 2], degrees: f64) {
        let (sine, cosine) = sine_and_cosine(degrees);
        let turn = [cosine, sine];
        self.turned = Some(Rotation { centre, turn });
    }

    /// G69: nothing is turned any more.
    pub fn end_turn(&mut self) {
        self.turned = None;
    }

    /// Whether G68 counts.
    pub fn is_turned(&self) -> bool {
        self.turned.is_some()
    }

    /// G51: distances from this place grow by these factors.
    pub fn scale(&mut self, centre: [f64; 3], factors: [f64; 3]) {
        self.scaling = Some(Scaling { centre, factors });
    }

    /// G50: nothing is scaled any more.
    pub fn end_scale(&mut self) {
        self.scaling = None;
    }

    /// Whether G51 counts.
    pub fn is_scaled(&self) -> bool {
        self.scaling.is_some()
    }

    /// G51.1: an axis is mirrored at this place, or by G50.1 no longer.
    pub fn mirror(&mut self, axis: usize, at: Option<f64>) {
        self.mirrors[axis] = at;
    }

    /// Whether G51.1 counts.
    pub fn is_mirrored(&self) -> bool {
        self.mirrors != [None; 3]
    }

    /// By what ways along an axis grow, negative where they turn round.
    pub fn factor(&self, axis: usize) -> f64 {
        let scale = self.scaling.map_or(1.0, |scaling| scaling.factors[axis]);
        if self.mirrors[axis].is_some() { -scale } else { scale }
    }

    /// A coordinate after mirror and scale, before any rotation.
    pub fn scaled(&self, axis: usize, value: f64) -> f64 {
        let value = self.mirrors[axis].map_or(value, |mirror| mirror + mirror - value);
        match &self.scaling {
            Some(Scaling { centre, factors }) if factors[axis] != 1.0 => {
                centre[axis] + (value - centre[axis]) * factors[axis]
            }
            _ => value,
        }
    }

    /// The coordinate that a program has, before mirror and scale.
    fn unscaled(&self, axis: usize, value: f64) -> f64 {
        let value = match &self.scaling {
            Some(Scaling { centre, factors }) if factors[axis] != 1.0 => {
                centre[axis] + (value - centre[axis]) / factors[axis]
            }
            _ => value,
        };
        self.mirrors[axis].map_or(value, |mirror| mirror + mirror - value)
    }

    /// A place of the part before mirror, scale and rotation. Both x and y have to be known if there is one, else none is.
    pub fn programmed(&self, at: [Option<f64>; 3]) -> [Option<f64>; 3] {
        let at = self.in_plane(at, |rotation, place| rotation.back().moved(place));
        [0, 1, 2].map(|a| at[a].map(|value| self.unscaled(a, value)))
    }

    /// The same place after these, which is that in the part.
    pub fn placed(&self, at: [Option<f64>; 3]) -> [Option<f64>; 3] {
        let at = [0, 1, 2].map(|a| at[a].map(|value| self.scaled(a, value)));
        self.in_plane(at, |rotation, place| rotation.moved(place))
    }

    /// Where a place that is reached lies in the part: the tilted plane is the last to count.
    pub fn in_part(&self, at: [f64; 3]) -> [f64; 3] {
        self.plane.map_or(at, |plane| plane.moved(at))
    }

    /// Another tilted plane, or none, counts: what a place is called from now on.
    pub fn set_plane(&mut self, plane: Option<TiltedPlane>, at: [Option<f64>; 3]) -> [Option<f64>; 3] {
        let before = std::mem::replace(&mut self.plane, plane);
        if before == plane {
            return at;
        }
        let in_part = before.map_or(at, |plane| plane.moved_known(at));
        plane.map_or(in_part, |plane| plane.back_known(in_part))
    }

    /// The direction across the plane in which the program moves.
    pub fn upright(&self) -> [f64; 3] {
        self.plane.map_or([0.0, 0.0, 1.0], |plane| plane.axes[2])
    }

    fn in_plane(
        &self,
        at: [Option<f64>; 3],
        moved: impl Fn(&Rotation, [f64; 2]) -> [f64; 2],
    ) -> [Option<f64>; 3] {
        let Some(rotation) = &self.turned else { return at };
        match at {
            [Some(x), Some(y), z] => {
                let [x, y] = moved(rotation, [x, y]);
                [Some(x), Some(y), z]
            }
            [_, _, z] => [None, None, z],
        }
    }

    /// A way in the plane of G17 after the rotation.
    pub fn turned(&self, way: [f64; 2]) -> [f64; 2] {
        self.turned.map_or(way, |rotation| rotation.turned(way))
    }
}

/// Whether a coordinate is farther off than any machine reaches.
pub(super) fn is_far(value: f64) -> bool {
    value.is_nan() || value.abs() > POSITION_MAX
}
