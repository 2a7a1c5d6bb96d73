//! Codes that say where the program's coordinates lie, and places of the machine, which say nothing of the part.

use super::frame::WorkFrame;
use super::reader::Reader;
use super::values::Values;
use crate::error::Result;

impl Reader<'_> {
    /// Carries out a code of this kind: whether it takes the words of the line, or `None` if it is another one.
    pub(super) fn set_coordinates(
        &mut self,
        code: i64,
        values: &Values,
        text: &[u8],
    ) -> Result<Option<bool>> {
        match code {
            540..=590 if code % 10 == 0 => self.frame.system = (code / 10 - 54) as usize,
            591..=593 => self.frame.system = (code - 591 + 6) as usize,
            541 | 1540 => self.use_further_system(code, values, text)?,
            921 | 922 => self.frame.forget_places(),
            500 => self.frame.end_scale(),
            690 => {
                self.frame.end_turn();
                self.set_plane(None);
            }
            _ => return self.set_by_words(code, values, text).map(|takes| takes.then_some(true)),
        }
        Ok(Some(false))
    }

    /// As [`Reader::set_coordinates`], of codes to which the words belong; false if it is another one.
    fn set_by_words(&mut self, code: i64, values: &Values, text: &[u8]) -> Result<bool> {
        match code {
            100 => self.set_system(values, text)?,
            920 => self.set_shift(values),
            520 => self.set_local(values),
            680 => self.begin_rotation(values, text)?,
            510 => self.begin_scale(values, text)?,
            511 => self.mirror(values, text)?,
            501 => self.end_mirror(values),
            682 | 684 => self.define_plane(code, values, text)?,
            683 => {
                let what = "takes a plane from the axis of the tool, which is not read";
                let remedy = "give the plane by G68.2 with angles, points or vectors";
                return Err(self.out.refused(text, what, remedy));
            }
            531 | 536 => self.orient(code, values, text)?,
            // The way home leads over the place that is named; where home is, no program tells.
            280 | 300 => self.go_home(code, values, text)?,
            _ => return Ok(false),
        }
        Ok(true)
    }

    /// G54.1 P… and G154 P… choose a further work offset.
    fn use_further_system(&mut self, code: i64, values: &Values, text: &[u8]) -> Result<()> {
        let [first, second] = WorkFrame::FURTHER;
        let (base, most) = if code == 541 { (first, 300.0) } else { (second, 99.0) };
        let number = values.get(b'P').filter(|p| (1.0..=most).contains(p) && p.fract() == 0.0);
        let Some(number) = number else {
            return Err(self.out.fault(text, &format!("needs P with a whole number from 1 to {most}")));
        };
        self.frame.system = base + number as usize;
        Ok(())
    }

    /// G10 L2 P… sets a work offset.
    fn set_system(&mut self, values: &Values, text: &[u8]) -> Result<()> {
        let number = values.get(b'P').map(|p| p as usize);
        match (values.get(b'L').map(|l| l as i64), number) {
            (Some(2), Some(number @ 0..=9)) => {
                for (a, value) in values.axes() {
                    self.frame.set_system(number.checked_sub(1), a, value * self.unit);
                }
                Ok(())
            }
            (Some(1 | 12), Some(number)) => {
                if let Some(radius) = values.get(b'R') {
                    self.radii.insert(number as u32, radius * self.unit);
                }
                Ok(())
            }
            (Some(1 | 10 | 11), _) => Ok(()),
            _ => Err(self.out.fault(text, "sets what is not read; use L2 with P1 to P9")),
        }
    }

    /// G92 names the present place.
    fn set_shift(&mut self, values: &Values) {
        for (a, value) in values.axes() {
            if let Some(at) = self.at[a] {
                self.frame.name_place(a, at, value * self.unit);
            }
        }
    }

    /// G52 moves the zero of all work offsets.
    fn set_local(&mut self, values: &Values) {
        values.axes().for_each(|(a, value)| self.frame.set_local(a, value * self.unit));
    }

    /// Home, along the axes that are named, or all: where that is, no program tells. Of axes that turn the head it is 0.
    fn go_home(&mut self, code: i64, values: &Values, text: &[u8]) -> Result<()> {
        if code == 300 && values.any(b"ABC") {
            return Err(self.out.fault(text, "turns the head to an angle that no program tells"));
        }
        self.tip = None;
        if values.any(b"XYZ") {
            self.forget(values)
        } else {
            self.at = [None; 3]
        }
        self.rest_head(values, |_| 0.0, text)
    }

    /// A move in the machine's coordinates, which say nothing of the part.
    pub(super) fn forget(&mut self, values: &Values) {
        self.tip = None;
        let plane = self.frame.plane;
        self.set_plane(None);
        values.axes().for_each(|(a, _)| self.at[a] = None);
        self.set_plane(plane);
    }
}
