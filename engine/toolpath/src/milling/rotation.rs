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
        if self.frame.factor(0) < 0.0 || self.frame.factor(1) < 0.0 {
            let what = "turns what is mirrored, where controls take the angle in different ways";
            return Err(self.out.refused(text, what, "end the mirror before by G50 or G50.1"));
        }
        if self.normal != 2 || self.relative {
            return Err(self
                .out
                .fault(text, "turns in another plane than G17, or with G91, which is not read"));
        }
        let mut centre = [0.0; 2];
        for (a, letter) in b"XY".iter().enumerate() {
            let told = values.get(*letter);
            let told = told.map(|value| self.frame.scaled(a, value * self.unit + self.frame.origin(a)));
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

    /// Within mirrors, scales, rotations and tilted planes what moves their zero is not read.
    pub(super) fn require_right_frame(&self, codes: &[(i64, &[u8])]) -> Result<()> {
        let frame = &self.frame;
        let (is_scaled, is_mirrored) = (frame.is_scaled(), frame.is_mirrored());
        // What stands within ends first: mirror, scale, rotation, in this order from outside.
        let moves_zero = |code: i64| match code {
            100 | 520 | 540..=593 | 920..=922 | 1540 => true,
            500 => is_scaled && frame.is_turned(),
            501 => is_mirrored && (is_scaled || frame.is_turned()),
            _ => false,
        };
        let in_space = |code: i64| matches!(code, 682..=684);
        type Rule<'a> = (bool, &'a dyn Fn(i64) -> bool, &'a str, &'a str);
        let rules: [Rule<'_>; 5] = [
            (
                frame.is_turned(),
                &|code| {
                    in_space(code)
                        || moves_zero(code)
                        || matches!(code, 180 | 190 | 510 | 511 | 530..=536 | 680)
                },
                "stands within a rotation, where it is not read",
                "end the rotation before by G69",
            ),
            (
                is_scaled,
                &|code| in_space(code) || moves_zero(code) || matches!(code, 510 | 511 | 530),
                "stands within a scale, where it is not read",
                "end the scale before by G50",
            ),
            (
                is_mirrored,
                &|code| in_space(code) || moves_zero(code) || code == 530,
                "stands within a mirror, where it is not read",
                "end the mirror before by G50.1",
            ),
            (
                frame.plane.is_some(),
                &|code| moves_zero(code) || matches!(code, 510 | 511 | 680 | 682),
                "stands within a tilted plane, where it is not read",
                "end the plane before by G69",
            ),
            (
                self.cycle.on,
                &|code| {
                    in_space(code)
                        || matches!(code, 510 | 511 | 531 | 536)
                        || (code == 690 && frame.plane.is_some())
                },
                "stands within a drilling cycle, where it is not read",
                "end the cycle before by G80",
            ),
        ];
        for (counts, is_wrong, what, remedy) in rules {
            if let Some((_, text)) = codes.iter().find(|(code, _)| counts && is_wrong(*code)) {
                return Err(self.out.refused(text, what, remedy));
            }
        }
        Ok(())
    }
}
