//! Scales of G51 and mirrors of G51.1 as the reader meets them.
//!
//! Mirrors are the first to count, then scales, then rotations. FANUC's B-63944EN-2, page 211, and Haas' 96-8000, page 178, have
//! the last two in this order, with the centre of the rotation scaled and its angle not.

use super::frame::is_far;
use super::reader::Reader;
use super::values::Values;
use crate::error::Result;

/// Factors without a decimal point count thousandths. Others than these cannot be meant so.
const THOUSANDTHS: std::ops::RangeInclusive<f64> = 10.0..=99_999.0;
/// Factors that machines take.
const FACTORS: std::ops::RangeInclusive<f64> = 1e-3..=1e4;

impl Reader<'_> {
    /// G51 scales what follows about X, Y and Z, or the present place, by P or by I, J and K.
    pub(super) fn begin_scale(&mut self, values: &Values, text: &[u8]) -> Result<()> {
        if self.relative {
            return Err(self.out.fault(text, "scales with G91, which is not read"));
        }
        if let Some(letter) = values.other_than(b"XYZPIJK") {
            return Err(self.out.fault(&[letter], "is no word of G51"));
        }
        let mut factors = [1.0; 3];
        match (values.get(b'P'), values.any(b"IJK")) {
            (Some(_), false) => factors = [self.factor(values, b'P')?; 3],
            (None, true) => {
                for (a, letter) in b"IJK".iter().enumerate() {
                    if values.get(*letter).is_some() {
                        factors[a] = self.factor(values, *letter)?;
                    } else if values.get(b"XYZ"[a]).is_some() {
                        let what = "scales about a place along an axis without its factor";
                        return Err(self.out.refused(text, what, "give I with X, J with Y, and K with Z"));
                    }
                }
            }
            _ => return Err(self.out.fault(text, "needs P, or I, J and K, and not both")),
        }
        let mut centre = [0.0; 3];
        for (a, letter) in b"XYZ".iter().enumerate() {
            if factors[a] == 1.0 {
                continue;
            }
            let told = values.get(*letter).map(|value| value * self.unit + self.frame.origin(a));
            let told = told.map(|value| self.frame.scaled(a, value));
            let Some(place) = told.or(self.at[a]) else {
                return Err(self.out.fault(text, "scales about a place that the program does not tell"));
            };
            if is_far(place) {
                return Err(self.out.fault(&[*letter], "is out of range"));
            }
            centre[a] = place;
        }
        self.frame.scale(centre, factors);
        Ok(())
    }

    /// A factor; one without a decimal point counts thousandths.
    fn factor(&self, values: &Values, letter: u8) -> Result<f64> {
        let value = values.get(letter).unwrap_or(1.0);
        let word = format!("{}{value}", char::from(letter));
        let factor = match values.is_whole(letter) {
            true if THOUSANDTHS.contains(&value.abs()) => value / 1000.0,
            true => {
                let what = "is a factor without a decimal point, whose unit cannot be told";
                let remedy = "give it with a point, as P1.5, or in thousandths, as P1500";
                return Err(self.out.refused(word.as_bytes(), what, remedy));
            }
            false => value,
        };
        // P mirrors along no axis.
        if !FACTORS.contains(&factor.abs()) || (letter == b'P' && factor < 0.0) {
            return Err(self.out.fault(word.as_bytes(), "is no factor that can be followed"));
        }
        Ok(factor)
    }

    /// G51.1 mirrors axes at X, Y and Z.
    pub(super) fn mirror(&mut self, values: &Values, text: &[u8]) -> Result<()> {
        if self.relative {
            return Err(self.out.fault(text, "mirrors with G91, which is not read"));
        }
        if !values.any(b"XYZ") || values.other_than(b"XYZ").is_some() {
            return Err(self.out.fault(text, "needs X, Y or Z, where it mirrors, and no other word"));
        }
        for (a, value) in values.axes() {
            let place = value * self.unit + self.frame.origin(a);
            if is_far(place) {
                return Err(self.out.fault(&b"XYZ"[a..=a], "is out of range"));
            }
            self.frame.mirror(a, Some(place));
        }
        Ok(())
    }

    /// G50.1 ends the mirrors of the axes that are named, or all.
    pub(super) fn end_mirror(&mut self, values: &Values) {
        let is_named = |a: usize| values.get(b"XYZ"[a]).is_some() || !values.any(b"XYZ");
        (0..3).filter(|a| is_named(*a)).for_each(|a| self.frame.mirror(a, None));
    }
}
