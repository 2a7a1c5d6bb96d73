//! Rotations of G68 as the reader meets them: what they turn about, and what may stand within.

use super::frame::is_far;
use super::reader::{Reader, Values};
use crate::error::Result;

impl Reader<'_> {
    /// G68 turns what follows about X and Y, or about the present place, by R degrees.
    pub(super) fn begin_rotation(&mut self, values: &Values, text: &[u8]) -> Result<()> {
        let Some(degrees) = values.get(b'R') else {
            return Err(self.out.fault(text, "has no R, the angle in degrees"));
        };
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

    /// Within a rotation other planes, and what moves its zero, are not read.
    pub(super) fn require_outside_rotation(&self, codes: &[(i64, &[u8])]) -> Result<()> {
        let is_wrong = |code: i64| matches!(code, 180 | 190 | 520..=530 | 540..=593 | 680 | 920..=922 | 100);
        match codes.iter().find(|(code, _)| self.frame.is_turned() && is_wrong(*code)) {
            Some((_, text)) => {
                let what = "stands within a rotation, where it is not read";
                Err(self.out.refused(text, what, "end the rotation before by G69"))
            }
            None => Ok(()),
        }
    }
}
