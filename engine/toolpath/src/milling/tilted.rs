//! Tilted planes as the reader meets them: the lines that define one, the tool that turns to it, and the head that turns back.

use super::frame::is_far;
use super::plane::{PlaneWords, TiltedPlane};
use super::reader::{MotionMode, Reader};
use super::values::Values;
use crate::error::Result;

/// Cosines of tools that stand across a plane are so near to 1.
const UPRIGHT: f64 = 1e-9;

impl Reader<'_> {
    /// Within the lines that define a plane nothing else is read.
    pub(super) fn require_whole_plane(
        &self,
        codes: &[(i64, &[u8])],
        values: &Values,
        machine: &[(i64, &[u8])],
    ) -> Result<()> {
        let is_empty = codes.is_empty() && machine.is_empty() && values.other_than(b"").is_none();
        let is_plane = codes.iter().any(|(code, _)| matches!(code, 682 | 684));
        if self.defining.is_none() || is_empty || is_plane {
            return Ok(());
        }
        let what = "is followed by another line before its plane is told";
        Err(self.out.refused(b"G68.2", what, "give all lines of its form one after the other"))
    }

    /// G68.2: what follows is told in a tilted plane; G68.4: in one within that plane.
    pub(super) fn define_plane(&mut self, code: i64, values: &Values, text: &[u8]) -> Result<()> {
        if code == 684 && self.frame.plane.is_none() {
            return Err(self.out.fault(text, "has no tilted plane before it"));
        }
        let whole = |letter: u8, default: f64| {
            let value = values.get(letter).unwrap_or(default);
            if value.fract() == 0.0 { value as i64 } else { -1 }
        };
        let form = whole(b'P', 0.0);
        if let Some(defining) = &self.defining
            && (defining.code, defining.form) != (code, form)
        {
            return Err(self.out.fault(text, "begins another plane before the last one is told"));
        }
        let (q, allowed): (i64, &[u8]) = match form {
            0 => (0, b"PXYZIJK"),
            1 => (whole(b'Q', 123.0), b"PQXYZIJK"),
            2 => (whole(b'Q', -1.0), if values.get(b'Q') == Some(0.0) { b"PQXYZR" } else { b"PQXYZ" }),
            3 => (whole(b'Q', -1.0), if values.get(b'Q') == Some(1.0) { b"PQXYZIJK" } else { b"PQIJK" }),
            4 => {
                return Err(self.out.refused(
                    text,
                    "gives a plane by angles of projection, which is not read",
                    "give it by Euler angles, without P",
                ));
            }
            _ => return Err(self.out.fault(text, "has a P that is not read: give 1, 2, 3, or none")),
        };
        if let Some(letter) = values.other_than(allowed) {
            let what = format!("is no word of G68.2 in this form, P{form}");
            return Err(self.out.fault(&[letter], &what));
        }
        let place = self.triple(values, b"XYZ", self.unit)?;
        let vector = self.triple(values, b"IJK", 1.0)?;
        match form {
            0 => self.begin_plane(code, Some(TiltedPlane::by_euler(place, vector)), text),
            1 => {
                let digits = [q / 100, q / 10 % 10, q % 10];
                let mut sorted = digits;
                sorted.sort_unstable();
                if sorted != [1, 2, 3] {
                    return Err(self.out.fault(b"Q", "is no order of three axes, as Q123"));
                }
                let plane = TiltedPlane::by_fixed(place, vector, digits.map(|digit| digit as usize - 1));
                self.begin_plane(code, Some(plane), text)
            }
            2 => self.add_point((code, q), values, place, text),
            _ => self.add_vector((code, q), values, place, vector, text),
        }
    }

    /// Three words, each 0 where it is not given.
    fn triple(&self, values: &Values, letters: &[u8; 3], unit: f64) -> Result<[f64; 3]> {
        let of = letters.map(|letter| values.get(letter).unwrap_or(0.0) * unit);
        match of.iter().position(|value| is_far(*value)) {
            Some(a) => Err(self.out.fault(&letters[a..=a], "is out of range")),
            None => Ok(of),
        }
    }

    /// P2: the lines Q1 to Q3 have a point each; Q0 in front of them may turn the plane.
    fn add_point(
        &mut self,
        (code, q): (i64, i64),
        values: &Values,
        place: [f64; 3],
        text: &[u8],
    ) -> Result<()> {
        let mut words = match self.defining.take() {
            Some(words) => words,
            None if q == 0 => {
                if place != [0.0; 3] {
                    let what = "moves the zero of the plane by Q0, which controls read in different ways";
                    return Err(self.out.refused(text, what, "give the zero itself as the first point, Q1"));
                }
                let degrees = values.get(b'R').unwrap_or(0.0);
                self.defining = Some(PlaneWords { code, form: 2, degrees, told: Vec::new(), origin: place });
                return Ok(());
            }
            None => PlaneWords { code, form: 2, degrees: 0.0, told: Vec::new(), origin: place },
        };
        let expected = words.told.len() as i64 + 1;
        if q != expected {
            return Err(self.out.fault(b"Q", &format!("is out of order: Q{expected} should stand here")));
        }
        if !b"XYZ".iter().all(|letter| values.get(*letter).is_some()) {
            return Err(self.out.fault(text, "gives a point without X, Y and Z"));
        }
        words.told.push(place);
        match words.told[..] {
            [zero, x, y] => {
                let plane = TiltedPlane::by_points([zero, x, y], words.degrees);
                self.begin_plane(code, plane, text)
            }
            _ => {
                self.defining = Some(words);
                Ok(())
            }
        }
    }

    /// P3: Q1 has the zero and the direction of X, Q2 the direction of Z.
    fn add_vector(
        &mut self,
        (code, q): (i64, i64),
        values: &Values,
        place: [f64; 3],
        vector: [f64; 3],
        text: &[u8],
    ) -> Result<()> {
        if !values.any(b"IJK") {
            return Err(self.out.fault(text, "gives a direction without I, J and K"));
        }
        match (self.defining.take(), q) {
            (None, 1) => {
                let told = vec![vector];
                self.defining = Some(PlaneWords { code, form: 3, degrees: 0.0, told, origin: place });
                Ok(())
            }
            (Some(words), 2) => {
                self.begin_plane(code, TiltedPlane::by_vectors(words.origin, words.told[0], vector), text)
            }
            (_, _) => Err(self.out.fault(b"Q", "is out of order: Q1 and then Q2 should stand here")),
        }
    }

    /// The plane counts, from the zero of the work offset or within the plane before; `None` if it has no directions.
    fn begin_plane(&mut self, code: i64, plane: Option<TiltedPlane>, text: &[u8]) -> Result<()> {
        let Some(mut plane) = plane else {
            let what = "tells no plane: its points lie on a line, or its vectors are zero or not square to each other";
            return Err(self.out.fault(text, what));
        };
        match (code, &self.frame.plane) {
            (684, Some(outer)) => plane = plane.within(outer),
            _ => (0..3).for_each(|a| plane.origin[a] += self.frame.origin(a)),
        }
        if plane.origin.into_iter().any(is_far) {
            return Err(self.out.fault(text, "has its zero out of range"));
        }
        self.set_plane(Some(plane));
        Ok(())
    }

    /// Another plane, or none, counts from now on; the tip stays where it is.
    pub(super) fn set_plane(&mut self, plane: Option<TiltedPlane>) {
        let before = self.frame.plane;
        self.at = self.frame.set_plane(plane, self.at);
        if let Some(tip) = self.tip {
            self.frame.plane = before;
            let tip = self.frame.set_plane(plane, tip.map(Some));
            self.tip = super::reader::known(tip);
        }
    }

    /// G53.1: the machine turns the tool square to the plane. Only with G53.6 the tip stays where it is.
    pub(super) fn orient(&mut self, code: i64, values: &Values, text: &[u8]) -> Result<()> {
        if self.frame.plane.is_none() {
            return Err(self.out.fault(text, "has no tilted plane before it"));
        }
        if values.any(b"XYZABCIJKR") {
            return Err(self.out.fault(text, "turns the tool alone: no place or angle may stand beside it"));
        }
        self.oriented = Some(self.frame.upright());
        if code == 531 {
            (self.at, self.tip) = ([None; 3], None);
        }
        Ok(())
    }

    /// Whether the tool stands across the plane in which the program moves.
    pub(super) fn is_upright(&self) -> bool {
        let axis = self.oriented.unwrap_or_else(|| crate::toolpath::gcode::tilt::axis(self.degrees));
        let upright = self.frame.upright();
        (0..3).all(|a| (axis[a] - upright[a]).abs() < UPRIGHT)
    }

    /// A rapid move that turns the head by words after G53.1: where its tip goes to on the way, no program tells.
    pub(super) fn turn_back(&mut self, values: &Values, motion: MotionMode) -> Result<()> {
        if motion != MotionMode::Rapid || self.relative {
            let what = "turn the tool from an angle that G53.1 has set, which the program does not tell";
            return Err(self.out.refused(b"A B C", what, "turn it by G0 and G90 first"));
        }
        self.rest_head(values, |value| value, b"A B C")?;
        self.at = self.target(values)?;
        self.out.program.unplaced += u64::from(values.any(b"XYZ"));
        Ok(())
    }

    /// The head stands at the angles that are named. After G53.1 the other ones are those of axes that the machine has not.
    pub(super) fn rest_head(&mut self, values: &Values, angle: fn(f64) -> f64, text: &[u8]) -> Result<()> {
        let named = [b'A', b'B', b'C'].map(|letter| values.get(letter).map(angle));
        if named == [None; 3] {
            return Ok(());
        }
        if self.oriented.is_some() {
            let count = named.iter().flatten().count();
            if count < 2 && named[0] != Some(0.0) && named[1] != Some(0.0) {
                let what = "turns one axis after G53.1, and the program does not tell where the other one is";
                return Err(self.out.refused(text, what, "name both axes that turn in this line"));
            }
            self.oriented = None;
            self.degrees = [0.0; 3];
        }
        (0..3).for_each(|a| self.degrees[a] = named[a].unwrap_or(self.degrees[a]));
        (self.at, self.tip) = ([None; 3], None);
        Ok(())
    }
}
