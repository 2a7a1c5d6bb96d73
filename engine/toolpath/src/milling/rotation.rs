//! Rotations of G68 as the reader meets them: what they turn about, and what may stand within.

use super::frame::is_far;
use super::reader::Reader;
use super::values::Values;
use crate::error::Result;

impl Reader<'_> {
    /// G68 turns what follows about X and Y, or about the present place, by R degrees.
    pub(super) fn begin_rotation(&mut self, values: &Values, text: &[u8]) -> Result<()> {
        let Some(degrees) = values.get(b'R') else {
            return Err(self.out.fault(text, "has no R, the angle in degrees"));
        };
        if values.any(b"ZIJK") {
            let what = "turns about an axis in space, which is not read";
            return Err(self.out.refused(text, what, "give the tilted plane by G68.2"));
        }
        if self.normal != 2 || self.relative {
            return Err(self
                .out
                .fault(text, "turns in another plane than G17, or with G91, which is not read"));
        }
        let mut centre = [0.0; 2];
        for (a, letter) in b"XY".iter().enumerate() {
            let told = values.get(*letter).map(|value| value * self.unit + self.frame.origin(a));
            let Some(place) = told.or(self.at[a]) else {
                return Err(self.out.fault(text, "turns about a place that the program does not tell"));
            };
            if is_far(place) {
                return Err(self.out.fault(&[*letter], "is out of range"));
            }
            centre[a] = place;
        }
        self.frame.turn(centre, degrees);
        Ok(())
    }

    /// Within a rotation, or a tilted plane, what moves its zero is not read; within the lines that define a plane nothing else is.
    pub(super) fn require_right_frame(
        &self,
        codes: &[(i64, &[u8])],
        values: &Values,
        machine: &[(i64, &[u8])],
    ) -> Result<()> {
        let is_plane = |code: &i64| matches!(code, 682 | 684);
        let is_empty = codes.is_empty() && machine.is_empty() && values.0.is_empty();
        if self.defining.is_some() && !is_empty && !codes.iter().any(|(code, _)| is_plane(code)) {
            let what = "is followed by another line before its plane is told";
            return Err(self.out.refused(b"G68.2", what, "give all lines of its form one after the other"));
        }
        let find = |is_wrong: fn(i64) -> bool| codes.iter().find(|(code, _)| is_wrong(*code));
        let moves_zero = |code: i64| matches!(code, 520 | 540..=593 | 680 | 682 | 920..=922 | 100);
        if self.frame.is_turned()
            && let Some((_, text)) = find(|code| {
                matches!(code, 180 | 190 | 520..=536 | 540..=593 | 680..=684 | 920..=922 | 100)
            })
        {
            let what = "stands within a rotation, where it is not read";
            return Err(self.out.refused(text, what, "end the rotation before by G69"));
        }
        if self.frame.plane.is_some()
            && let Some((_, text)) = find(moves_zero)
        {
            let what = "stands within a tilted plane, where it is not read";
            return Err(self.out.refused(text, what, "end the plane before by G69"));
        }
        if self.cycle.on
            && let Some((_, text)) = codes.iter().find(|(code, _)| {
                matches!(code, 531 | 536 | 682..=684) || (*code == 690 && self.frame.plane.is_some())
            })
        {
            let what = "stands within a drilling cycle, where it is not read";
            return Err(self.out.refused(text, what, "end the cycle before by G80"));
        }
        Ok(())
    }
}
