//! Contours of G41 and G42 as the reader meets them: where they begin and end, and what may stand within.

use super::compensation::{Compensation, ContourMove};
use super::reader::{Reader, known};
use super::values::Values;
use crate::error::Result;

impl Reader<'_> {
    /// Within a contour only moves and what does not touch coordinates may stand.
    pub(super) fn require_outside_contour(
        &self,
        codes: &[(i64, &[u8])],
        machine: &[(i64, &[u8])],
    ) -> Result<()> {
        let Some(_) = &self.contour else { return Ok(()) };
        let is_read = |code: i64| matches!(code, 0 | 10 | 20 | 30 | 40 | 170 | 400..=421 | 610 | 611 | 640 | 900..=911 | 930 | 940 | 950);
        let codes = codes.iter().find(|(code, _)| !is_read(*code));
        let wrong = codes.or(machine.iter().find(|(code, _)| *code == 6));
        match wrong {
            Some((_, text)) => {
                let what = "stands within a correction for the radius of the tool, where it is not read";
                Err(self.out.refused(text, what, "end the correction before by G40"))
            }
            None => Ok(()),
        }
    }

    /// G41 and G42, with D, or G41.1 and G42.1, whose D is the diameter.
    pub(super) fn begin_contour(&mut self, code: i64, values: &Values, text: &[u8]) -> Result<()> {
        let radius = match (code, values.get(b'D')) {
            (411 | 421, Some(diameter)) => diameter * self.unit * 0.5,
            (411 | 421, None) => return Err(self.out.fault(text, "has no D, the tool's diameter")),
            _ => {
                let number = self.register.unwrap_or(self.out.tool);
                let told = self.out.options.radii.get(&number).or(self.radii.get(&number)).copied();
                let Some(radius) = told.or((number == 0 && self.register.is_some()).then_some(0.0)) else {
                    let what = format!("corrects for the radius D{number}, which the program does not tell");
                    let remedy = format!(
                        "give what the machine's table holds by `radius` {number}=5mm; 0mm if the path is the centre's already"
                    );
                    return Err(self.out.refused(text, &what, &remedy));
                };
                radius
            }
        };
        // A mirror changes the side.
        let is_mirrored = self.frame.factor(0) * self.frame.factor(1) < 0.0;
        let aside = if matches!(code, 410 | 411) != is_mirrored { radius } else { -radius };
        if self.normal != 2 || !self.is_upright() {
            return Err(self.out.fault(text, "corrects outside of the plane of G17, which is not read"));
        }
        match &self.contour {
            Some(contour) if contour.aside != aside => Err(self.out.refused(
                text,
                "changes side or radius within a contour",
                "end the correction before by G40",
            )),
            Some(_) => Ok(()),
            None => {
                self.contour = Some(Compensation::new(aside));
                Ok(())
            }
        }
    }

    /// A move of a contour; `arc` is its centre from the begin, whether it is clockwise, and full turns before.
    pub(super) fn along_contour(
        &mut self,
        to: [Option<f64>; 3],
        degrees: [f64; 3],
        rapid: bool,
        arc: Option<([f64; 2], bool, u32)>,
    ) -> Result<()> {
        let (Some(from), Some(end)) = (known(self.at), known(to)) else {
            return Err(self
                .out
                .fault(b"G41", "corrects a move from or to a place that the program does not tell"));
        };
        if degrees != self.degrees {
            return Err(self
                .out
                .fault(b"A B C", "turn the tool within a correction for its radius, which is not read"));
        }
        if let Some(contour) = &mut self.contour {
            contour.add(ContourMove { line: self.out.line, rapid, from, to: end, arc }, &self.out)?;
        }
        self.at = to;
        Ok(())
    }

    /// Carries the moves of a contour out.
    pub(super) fn end_contour(&mut self) -> Result<()> {
        let Some(contour) = self.contour.take() else { return Ok(()) };
        let line = self.out.line;
        let Some(mut from) = self.tip.take().or(contour.begin()) else { return Ok(()) };
        for (line, rapid, to) in contour.path(&mut self.out)? {
            if to != from {
                self.out.line = line;
                self.push(from, to, self.degrees, rapid)?;
                from = to;
            }
        }
        self.out.line = line;
        self.tip = Some(from);
        Ok(())
    }
}
