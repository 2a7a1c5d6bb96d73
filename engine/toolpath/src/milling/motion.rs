//! Motion as the reader meets it: straight moves, arcs, and the holes of cycles.

use super::frame::is_far;
use super::reader::{MotionMode, Reader, known};
use super::values::Values;
use crate::error::Result;
use crate::toolpath::gcode::arc::{Arc, Centre};
use crate::toolpath::gcode::tilt;

/// Most holes of a cycle that is repeated.
const REPEATS_MAX: f64 = 10_000.0;

impl Reader<'_> {
    pub(super) fn travel(&mut self, values: &Values) -> Result<()> {
        let Some(motion) = self.motion else {
            return Err(self.out.fault(b"X Y Z", "stand before any of G0 to G3 or a drilling cycle"));
        };
        if self.oriented.is_some() && values.any(b"ABC") && self.contour.is_none() {
            return self.turn_back(values, motion);
        }
        let degrees = self.turned(values);
        match motion {
            MotionMode::Cycle if self.contour.is_some() => {
                Err(self.out.fault(b"G81", "drills within a correction for the radius of the tool"))
            }
            MotionMode::Cycle => self.drill(values),
            MotionMode::Arc { clockwise } => self.arc(values, clockwise),
            MotionMode::Rapid | MotionMode::Straight => {
                let to = self.target(values)?;
                if self.contour.is_some() {
                    return self.along_contour(to, degrees, motion == MotionMode::Rapid, None);
                }
                self.go(to, degrees, motion == MotionMode::Rapid)
            }
        }
    }

    /// The angles of the head after a line.
    fn turned(&self, values: &Values) -> [f64; 3] {
        let mut degrees = self.degrees;
        for (a, letter) in b"ABC".iter().enumerate() {
            if let Some(value) = values.get(*letter) {
                degrees[a] = if self.relative { degrees[a] + value } else { value };
            }
        }
        degrees
    }

    /// Goes straight to a place, as far as both ends are known.
    fn go(&mut self, to: [Option<f64>; 3], degrees: [f64; 3], rapid: bool) -> Result<()> {
        let from = self.tip.take().or(known(self.at));
        match (from, known(to)) {
            (Some(from), Some(to)) => self.push(from, to, degrees, rapid)?,
            _ if rapid => self.out.program.unplaced += 1,
            _ => {
                let what = "cuts from a place that the program does not tell: it must be reached by G0 with X, Y and Z first";
                return Err(self.out.fault(b"G1", what));
            }
        }
        (self.at, self.degrees) = (to, degrees);
        Ok(())
    }

    /// Adds a straight move; the angles of the head change evenly along it.
    pub(super) fn push(
        &mut self,
        from: [f64; 3],
        to: [f64; 3],
        degrees: [f64; 3],
        rapid: bool,
    ) -> Result<()> {
        let (from, to) = (self.frame.in_part(from), self.frame.in_part(to));
        if to.into_iter().any(is_far) {
            return Err(self.out.fault(b"X Y Z", "leads out of range"));
        }
        if let Some(axis) = self.oriented {
            return self.out.push((from, to), rapid, 0.0, |_| axis);
        }
        let begin = self.degrees;
        // Turns about several axes at once add up at most.
        let turn: f64 = (0..3).map(|a| (degrees[a] - begin[a]).abs()).sum();
        let axis = |part: f64| tilt::axis([0, 1, 2].map(|a| begin[a] + (degrees[a] - begin[a]) * part));
        self.out.push((from, to), rapid, turn.to_radians(), axis)
    }

    fn arc(&mut self, values: &Values, clockwise: bool) -> Result<()> {
        let to = self.target(values)?;
        let programmed = known(self.frame.programmed(self.at));
        let (Some(from), Some(programmed), Some(end)) = (known(self.at), programmed, known(to)) else {
            return Err(self.out.fault(b"G2", "begins at a place that the program does not tell"));
        };
        // The plane's axes, so that counter-clockwise is seen against its normal.
        let (u, v) = match self.normal {
            2 => (0, 1),
            1 => (2, 0),
            _ => (1, 2),
        };
        let factors = [self.frame.factor(u), self.frame.factor(v)];
        if factors[0].abs() != factors[1].abs() {
            let what = "is an arc under a scale that is not the same along both axes, which is not read";
            return Err(self.out.refused(b"G2", what, "give the same factors to both, or straight moves"));
        }
        // One mirror turns the way round.
        let clockwise = clockwise != (factors[0] * factors[1] < 0.0);
        let centre = match values.get(b'R') {
            Some(radius) => Centre::Radius(radius * self.unit * factors[0].abs()),
            None => {
                let offset = |a: usize| {
                    let value = values.get(b"IJK"[a]).map(|value| value * self.unit);
                    match (value, self.absolute_centres) {
                        (Some(value), true) => value + self.frame.origin(a) - programmed[a],
                        (Some(value), false) => value,
                        (None, _) => 0.0,
                    }
                };
                Centre::Offset(self.frame.turned([offset(u) * factors[0], offset(v) * factors[1]]))
            }
        };
        // P counts turns; the last one is the arc itself.
        let turns = values.get(b'P').map_or(0, |turns| (turns.clamp(1.0, 1e4) - 1.0) as u32);
        let arc = Arc { start: [from[u], from[v]], end: [end[u], end[v]], centre, clockwise, turns };
        let chords = self.out.chords(&arc, b"G2")?;
        let limit = 0.05_f64.max(0.001 * chords.length);
        if chords.mismatch > limit {
            return Err(self
                .out
                .fault(b"I J K", "are no centre of this arc: its ends are at different distances"));
        }
        let (mut last, begin, degrees) = (from, self.degrees, self.turned(values));
        if self.contour.is_some() {
            let centre = arc.centre_offset().map_err(|what| self.out.fault(b"G2", what))?;
            return self.along_contour(to, degrees, false, Some((centre, clockwise, turns)));
        }
        if self.tip.take().is_some_and(|tip| tip != from) {
            let what = "follows G40, after which a straight move must lead from beside the contour";
            return Err(self.out.fault(b"G2", what));
        }
        for (point, part) in chords.inner_points() {
            let mut place = [0.0; 3];
            (place[u], place[v]) = (point[0], point[1]);
            place[self.normal] = from[self.normal] + (end[self.normal] - from[self.normal]) * part;
            let turned = [0, 1, 2].map(|a| begin[a] + (degrees[a] - begin[a]) * part);
            self.push(last, place, turned, false)?;
            (last, self.degrees) = (place, turned);
        }
        self.push(last, end, degrees, false)?;
        self.out.program.arcs += 1;
        (self.at, self.degrees) = (to, degrees);
        Ok(())
    }

    /// The holes of a line within a cycle.
    fn drill(&mut self, values: &Values) -> Result<()> {
        if self.normal != 2 {
            return Err(self.out.fault(b"G81", "drills in another plane than G17, which is not read"));
        }
        if self.frame.factor(2) != 1.0 {
            let what = "drills under a scale or a mirror along Z, which controls carry out in different ways";
            return Err(self.out.refused(b"G81", what, "end it before by G50 or G50.1"));
        }
        let z = self.frame.origin(2);
        let Some(begin) = self.at[2] else {
            return Err(self.out.fault(b"G81", "drills from a height that the program does not tell"));
        };
        let height = |value: f64, from: f64| if self.relative { from + value } else { value + z };
        if let Some(retract) = values.get(b'R') {
            self.cycle.retract = Some(height(retract * self.unit, begin));
        }
        let Some(retract) = self.cycle.retract else {
            return Err(self.out.fault(b"G81", "has no R, the height from which it feeds"));
        };
        if let Some(depth) = values.get(b'Z') {
            self.cycle.depth = Some(height(depth * self.unit, retract));
        }
        let Some(depth) = self.cycle.depth else {
            return Err(self.out.fault(b"G81", "has no Z, the depth of the hole"));
        };
        let repeats = values.get(b'L').or(values.get(b'K')).unwrap_or(1.0);
        if !(0.0..=REPEATS_MAX).contains(&repeats) {
            return Err(self.out.fault(b"L", "repeats a hole too often"));
        }
        let degrees = self.turned(values);
        for _ in 0..repeats as u32 {
            let plane = values.only(b"XY");
            let over = self.target(&plane)?;
            self.go(over, degrees, true)?;
            let [x, y, _] = self.at;
            self.go([x, y, Some(retract)], degrees, true)?;
            self.go([x, y, Some(depth)], degrees, false)?;
            // Out of its own hole.
            let back = if self.cycle.back_to_start { begin.max(retract) } else { retract };
            self.go([x, y, Some(back)], degrees, true)?;
        }
        Ok(())
    }
}
