//! Motion: what a line's words move, and what it deposits on its way.

use super::arc::{Arc, Centre, Chords};
use super::beads::{Kind, Pose, distance};
use super::machine::Machine;
use super::parameters::{Sizes, letters};
use super::position::AXES;
use super::sizes::{Piece, Resolution};
use crate::error::Result;

/// Deviation allowed for the chords of an arc: this part of the bead's width...
const ARC_TOLERANCE_OF_WIDTH: f64 = 0.01;
/// ... or so many mm where no comment tells the width.
const ARC_TOLERANCE_MM: f64 = 0.005;

/// An arc's ends may differ in their distance from the centre by this much, in mm, for rounding alone.
const ARC_MISMATCH_MM: f64 = 0.005;

/// The two axes of the plane of arcs and the axis along its normal: G17, G18, G19.
const PLANES: [[usize; 3]; 3] = [[0, 1, 2], [2, 0, 1], [1, 2, 0]];

impl Machine<'_, '_> {
    /// G0, G1, G2, G3.
    pub(super) fn go(&mut self, motion: u8, sizes: &Sizes) -> Result<()> {
        let from = self.position.pose();
        let fed = self.extruder.feed(sizes, self.position.unit, self.position.relative);
        self.advance_axes(sizes)?;
        let to = self.position.pose();
        let turns = to.degrees != from.degrees;
        let is_arc = motion >= 2 && sizes.states(letters(b"IJKR"));
        if motion >= 2 && !is_arc {
            return Err(self.fault("the arc has neither I, J or K nor R"));
        }
        if !is_arc && from.point == to.point {
            return self.stay(fed, turns, motion);
        }
        self.beads.report.moves += 1;
        let deposits = match self.by_extruder {
            true => fed > 0.0,
            false => self.depositing && motion != 0,
        };
        if fed < 0.0 {
            self.extruder.retract(-fed);
        }
        if !deposits {
            if is_arc {
                // Refuses what is no arc; its chords do not matter.
                self.arc(motion, sizes, &from, &to)?;
            }
            return self.beads.finish();
        }
        if let Some(axis) = self.position.lost_axis() {
            return Err(self.fault(&format!("deposits, but a placeholder left {axis} unknown before")));
        }
        self.layer_is_fresh = false;
        let feature = match self.feature {
            Some(feature) => feature,
            None => self.beads.feature(b"", self.line)?,
        };
        self.feature = Some(feature);
        let kind = Kind { layer: self.layer, tool: self.extruder.tool, feature };
        let area = self.extruder.area();
        self.beads.resolution =
            Resolution { position: self.position.resolution, volume: self.extruder.resolution * area };
        let piece = Piece { fed: fed * area, width: self.width, height: self.height };
        match is_arc {
            true => self.deposit_arc(motion, sizes, kind, &from, &to, piece),
            false => self.beads.deposit(kind, &from, &to, piece, self.line),
        }
    }

    fn advance_axes(&mut self, sizes: &Sizes) -> Result<()> {
        if sizes.leaves_open(!letters(&AXES)) {
            return Err(self.fault("a placeholder that the slicer left stands for a number that is needed"));
        }
        if self.position.advance(sizes).map_err(|what| self.fault(what))? {
            self.beads.report.note("a placeholder that the slicer left is taken for no move", self.line);
        }
        Ok(())
    }

    /// A command that leaves the tool tip where it is.
    fn stay(&mut self, fed: f64, turns: bool, motion: u8) -> Result<()> {
        if !self.by_extruder {
            let deposits = self.depositing && motion != 0;
            self.beads.report.zero_length += u64::from(deposits && !turns);
            if deposits && turns {
                self.beads.report.note("the tool turns in place while it deposits", self.line);
            }
            return Ok(());
        }
        if fed < 0.0 {
            self.extruder.retract(-fed);
            self.beads.report.retractions += 1;
        } else if fed > 0.0 {
            let excess = self.extruder.prime(fed);
            if excess > 0.0 {
                self.beads.report.zero_length += 1;
                self.beads.report.blobs.count += 1;
                self.beads.report.blobs.volume += excess * self.extruder.area();
            }
        }
        Ok(())
    }

    fn arc(&mut self, motion: u8, sizes: &Sizes, from: &Pose, to: &Pose) -> Result<Chords> {
        let [u, v, _] = PLANES[self.plane];
        let start = [from.point[u], from.point[v]];
        let centre = match sizes.get(b'R') {
            Some(radius) => Centre::Radius(radius * self.position.unit),
            None => Centre::Offset([u, v].map(|axis| {
                let letter = b"IJK"[axis];
                match (sizes.get(letter), self.absolute_centres) {
                    (Some(value), true) => {
                        value * self.position.unit + self.position.offset[axis] - from.point[axis]
                    }
                    (value, _) => value.unwrap_or(0.0) * self.position.unit,
                }
            })),
        };
        let arc = Arc { start, end: [to.point[u], to.point[v]], centre, clockwise: motion == 2 };
        let by_width = self.width.map_or(ARC_TOLERANCE_MM, |width| width * ARC_TOLERANCE_OF_WIDTH);
        let tolerance = self.arc_tolerance.unwrap_or(by_width);
        let chords = arc.chords(tolerance).map_err(|what| self.fault(what))?;
        let report = &mut self.beads.report;
        report.arcs.count += 1;
        report.arcs.chords += u64::from(chords.count);
        report.arcs.tolerance = report.arcs.tolerance.max(tolerance);
        if chords.mismatch > ARC_MISMATCH_MM {
            report.note("the ends of an arc differ in their distance from its centre", self.line);
        }
        Ok(chords)
    }

    fn deposit_arc(
        &mut self,
        motion: u8,
        sizes: &Sizes,
        kind: Kind,
        from: &Pose,
        to: &Pose,
        piece: Piece,
    ) -> Result<()> {
        let chords = self.arc(motion, sizes, from, to)?;
        let [u, v, normal] = PLANES[self.plane];
        let parts = f64::from(chords.count);
        let piece = Piece { fed: piece.fed / parts, ..piece };
        let between = |a: f64, b: f64, step: usize| a + (b - a) * (step as f64 / parts);
        let mut last = *from;
        let mut walked = 0.0;
        for (step, place) in chords.inner_points().enumerate() {
            let mut next = *to;
            (next.point[u], next.point[v]) = (place[0], place[1]);
            next.point[normal] = between(from.point[normal], to.point[normal], step + 1);
            next.degrees = [0, 1, 2].map(|axis| between(from.degrees[axis], to.degrees[axis], step + 1));
            walked += distance(last.point, next.point);
            self.beads.deposit(kind, &last, &next, piece, self.line)?;
            last = next;
        }
        walked += distance(last.point, to.point);
        let rise = to.point[normal] - from.point[normal];
        self.beads.report.arcs.length_lost += (chords.length * chords.length + rise * rise).sqrt() - walked;
        self.beads.deposit(kind, &last, to, piece, self.line)
    }
}
