//! Motion: what a line's words move, and what it deposits on its way.

use super::arc::{Arc, Centre, Chords};
use super::beads::{Kind, Pose, distance};
use super::layer_axis::LayerAxis;
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

/// A machine whose Z points down.
const DOWN: LayerAxis = LayerAxis::new(b'Z', true);

/// The two axes of the plane of arcs and the axis along its normal: G17, G18, G19.
const PLANES: [[usize; 3]; 3] = [[0, 1, 2], [2, 0, 1], [1, 2, 0]];

impl Machine<'_, '_> {
    /// G0, G1, G2, G3.
    pub(super) fn go(&mut self, motion: u8, sizes: &Sizes) -> Result<()> {
        let from = self.position.pose();
        let fed = self.extruder.feed(sizes, self.position.unit, self.position.relative);
        self.advance_axes(sizes)?;
        let to = self.position.pose();
        let turns = (to.degrees, to.vector) != (from.degrees, from.vector);
        let is_arc = motion >= 2 && sizes.states(letters(b"IJKR"));
        if motion >= 2 && !is_arc {
            return Err(self.fault("the arc has neither I, J or K nor R"));
        }
        if !is_arc && from.point == to.point {
            return self.stay(fed, turns, motion);
        }
        self.beads.report.moves += 1;
        let deposits = match self.by_extruder {
            true => fed > 0.0 && self.flow() > 0.0,
            false => self.switch.deposits() && motion != 0,
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
        self.note_deposit();
        let feature = match self.feature {
            Some(feature) => feature,
            None => self.beads.feature(b"", self.line)?,
        };
        self.feature = Some(feature);
        let kind = Kind { layer: self.layer, tool: self.extruder.tool, feature };
        let area = self.extruder.area() * self.flow();
        self.beads.resolution =
            Resolution { position: self.position.resolution, volume: self.extruder.resolution * area };
        let fed = match self.switch.area {
            Some(area) if !self.by_extruder => {
                // An area is what the file says, however its coordinates are rounded.
                self.beads.resolution = Resolution::default();
                area * distance(from.point, to.point)
            }
            _ => fed * area,
        };
        let piece = Piece { fed, width: self.region_width.or(self.width), height: self.height };
        match is_arc {
            true => self.deposit_arc(motion, sizes, kind, &from, &to, piece),
            false => self.beads.deposit(kind, &from, &to, piece, self.line),
        }
    }

    /// G53: goes to places in the machine's coordinates, without a bead.
    pub(super) fn go_in_machine(&mut self, sizes: &Sizes) -> Result<()> {
        let unit = self.position.unit;
        let fed = self.extruder.feed(sizes, unit, self.position.relative);
        if fed < 0.0 {
            self.extruder.retract(-fed);
        }
        let to = AXES.map(|letter| sizes.get(letter).map(|value| value * unit));
        self.position.move_machine(to).map_err(|what| self.fault(what))?;
        self.beads.report.moves += 1;
        self.beads.finish()
    }

    /// Tells what must be known of the place of a deposit.
    fn note_deposit(&mut self) {
        if self.position.offsets.deposit() {
            let what = "material is laid under several work offsets (G54 to G59) that the file does not tell: it lies \
                        as if all were zero; set them by G10 L2 P1 X Y Z and so on at its beginning";
            self.beads.report.note(what, self.line);
        }
        if let Some(axis) = self.position.unsure_axis() {
            let what = format!(
                "a bead begins where G53 left {axis}, in the machine's coordinates, but the work offset is not in the \
                 file: it is taken for zero"
            );
            self.beads.report.note(&what, self.line);
        }
        let table = self.position.table();
        let (low, high) = self.beads.tables.unwrap_or((table, table));
        self.beads.tables = Some((low.min(table), high.max(table)));
        self.beads.report.machine.unit_mm.get_or_insert(self.position.unit);
    }

    /// The factor of what the present tool is fed.
    fn flow(&self) -> f64 {
        self.flows.get(&self.extruder.tool).copied().unwrap_or(1.0)
    }

    fn advance_axes(&mut self, sizes: &Sizes) -> Result<()> {
        if self.plane != 0 && sizes.states(letters(b"IJKR")) && self.position.layer_axis() == DOWN {
            return Err(self.fault("is an arc out of the plane of X and Y on a machine whose Z points down"));
        }
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
            let deposits = self.switch.deposits() && motion != 0;
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
                self.beads.report.blobs.volume += excess * self.extruder.area() * self.flow();
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
                        value * self.position.unit + self.position.pose_offset(axis) - from.point[axis]
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
        let rise = to.point[normal] - from.point[normal];
        let length = (chords.length * chords.length + rise * rise).sqrt();
        let fed = match self.switch.area {
            Some(area) if !self.by_extruder => area * length,
            _ => piece.fed,
        };
        let piece = Piece { fed: fed / parts, ..piece };
        let between = |a: f64, b: f64, step: usize| a + (b - a) * (step as f64 / parts);
        let mut last = *from;
        let mut walked = 0.0;
        for (step, place) in chords.inner_points().enumerate() {
            let mut next = *to;
            (next.point[u], next.point[v]) = (place[0], place[1]);
            next.point[normal] = between(from.point[normal], to.point[normal], step + 1);
            next.degrees = [0, 1, 2].map(|axis| between(from.degrees[axis], to.degrees[axis], step + 1));
            if to.vector.is_some() {
                let (a, b) = (from.axis(), to.axis());
                next.vector = unit([0, 1, 2].map(|axis| between(a[axis], b[axis], step + 1)));
            }
            walked += distance(last.point, next.point);
            self.beads.deposit(kind, &last, &next, piece, self.line)?;
            last = next;
        }
        walked += distance(last.point, to.point);
        self.beads.report.arcs.length_lost += length - walked;
        self.beads.deposit(kind, &last, to, piece, self.line)
    }
}

/// A vector of the length 1 in the direction of this one, if it has one.
fn unit(vector: [f64; 3]) -> Option<[f64; 3]> {
    let length = vector.iter().map(|x| x * x).sum::<f64>().sqrt();
    (length > 1e-9).then(|| vector.map(|x| x / length))
}
