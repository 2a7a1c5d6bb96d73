//! Motion: what a line's words move, and what it deposits on its way.

use super::arc::{Arc, Centre, Chords};
use super::beads::{BeadKey, Pose};
use super::distance::distance;
use super::extruder::FeedAmount;
use super::firmware::{Firmware, TurnsRule};
use super::layer_axis::LayerAxis;
use super::machine::MachineState;
use super::parameters::{SizeWords, letters};
use super::position::AXES;
use super::sizes::{BeadMove, NumberResolution};
use crate::error::Result;

/// Deviation allowed for the chords of an arc: this part of the bead's width...
const ARC_TOLERANCE_OF_WIDTH: f64 = 0.01;
/// ... or so many mm where no comment tells the width.
const ARC_TOLERANCE_MM: f64 = 0.005;

/// An arc's ends may differ in their distance from the centre by this much, in mm, for rounding alone.
const ARC_MISMATCH_MM: f64 = 0.005;

/// Most turns of an arc: 10 m of 10 mm a turn.
const TURNS_MAX: f64 = 1000.0;

/// A machine whose Z points down.
const DOWN: LayerAxis = LayerAxis::new(b'Z', true);

/// The two axes of the plane of arcs and the axis along its normal: G17, G18, G19.
const PLANES: [[usize; 3]; 3] = [[0, 1, 2], [2, 0, 1], [1, 2, 0]];

impl MachineState<'_, '_> {
    /// G0, G1, G2, G3.
    pub(super) fn go(&mut self, motion: u8, sizes: &SizeWords) -> Result<()> {
        let from = self.position.pose();
        let fed = self.extruder.feed(sizes, self.position.unit);
        if self.extruder.is_disputed() && sizes.states(letters(b"E")) {
            self.note_dispute();
        }
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
        let (fed, flow) = (self.extruder.in_move(fed), self.flow());
        if fed.begin > 0.0 {
            self.make_up(&fed)?;
        }
        let deposits = match self.by_extruder {
            true => fed.net > 0.0 && flow > 0.0,
            false => self.switch.deposits() && motion != 0,
        };
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
        (self.layer_is_fresh, self.nozzle_is_fresh) = (false, false);
        self.note_deposit();
        let feature = match self.feature {
            Some(feature) => feature,
            None => self.beads.feature(b"", self.line)?,
        };
        self.feature = Some(feature);
        let kind = BeadKey { layer: self.layer, tool: self.extruder.tool, feature };
        let area = self.extruder.area() * flow;
        self.extruder.fed_by_length |= self.by_extruder && !self.extruder.is_volumetric();
        self.beads.resolution =
            NumberResolution { position: self.position.resolution, volume: self.extruder.resolution * area };
        let net = match self.switch.area {
            Some(area) if !self.by_extruder => {
                // An area is what the file says, however its coordinates are rounded.
                self.beads.resolution = NumberResolution::default();
                area * distance(from.point, to.point)
            }
            _ => fed.net * flow,
        };
        let piece = BeadMove { fed: net, width: self.region_width.or(self.width), height: self.height };
        match is_arc {
            true => self.deposit_arc(motion, sizes, kind, (&from, &to, fed.begin), piece),
            false if fed.begin > 0.0 => {
                let begin = from.towards(&to, fed.begin);
                self.beads.deposit(kind, &begin, &to, piece, self.line)
            }
            false => self.beads.deposit(kind, &from, &to, piece, self.line),
        }
    }

    /// The move begins without a deposit: what was retracted must be fed first.
    #[cold]
    fn make_up(&mut self, fed: &FeedAmount) -> Result<()> {
        if fed.is_odd {
            self.beads.report.made_up.count += 1;
            self.beads.report.made_up.volume += (fed.moved - fed.net) * self.flow();
        }
        self.beads.finish()
    }

    #[cold]
    fn note_dispute(&mut self) {
        let taken = match self.extruder.is_relative() {
            true => "relatively, as Klipper and Marlin 1 do; Marlin 2 would count absolutely",
            false => "absolutely, as Marlin 2 does; Klipper and Marlin 1 would count relatively",
        };
        let what = format!("E is counted {taken} after this G90, G91, M82 and M83: `firmware` tells which");
        self.beads.report.note(&what, self.line);
    }

    /// G53: goes to places in the machine's coordinates, without a bead.
    pub(super) fn go_in_machine(&mut self, sizes: &SizeWords) -> Result<()> {
        let unit = self.position.unit;
        let fed = self.extruder.feed(sizes, unit);
        self.extruder.in_move(fed);
        let to = AXES.map(|letter| sizes.get(letter).map(|value| value * unit));
        self.position.move_machine(to).map_err(|what| self.fault(what))?;
        self.position.move_table(sizes);
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

    fn advance_axes(&mut self, sizes: &SizeWords) -> Result<()> {
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
        let excess = self.extruder.in_place(fed);
        self.beads.report.retractions += u64::from(fed < 0.0);
        if excess > 0.0 {
            self.beads.report.zero_length += 1;
            self.beads.report.blobs.count += 1;
            let excess = excess * self.flow();
            self.beads.report.blobs.volume += excess;
            if self.nozzle_is_fresh {
                self.beads.report.purges.count += 1;
                self.beads.report.purges.volume += excess;
            }
        }
        Ok(())
    }

    fn arc(&mut self, motion: u8, sizes: &SizeWords, from: &Pose, to: &Pose) -> Result<Chords> {
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
        let end = [to.point[u], to.point[v]];
        let turns = self.turns(sizes, start == end)?;
        let arc = Arc { start, end, centre, clockwise: motion == 2, turns };
        let by_width = self.width.map_or(ARC_TOLERANCE_MM, |width| width * ARC_TOLERANCE_OF_WIDTH);
        let tolerance = self.arc_tolerance.unwrap_or(by_width);
        let chords = arc.chords(tolerance).map_err(|what| self.fault(what))?;
        let report = &mut self.beads.report;
        report.arcs.count += 1;
        report.arcs.chords += chords.count();
        report.arcs.tolerance = report.arcs.tolerance.max(tolerance);
        if chords.mismatch > ARC_MISMATCH_MM {
            report.note("the ends of an arc differ in their distance from its centre", self.line);
        }
        Ok(chords)
    }

    /// Full turns that stand before an arc, by its word P.
    fn turns(&mut self, sizes: &SizeWords, is_circle: bool) -> Result<u32> {
        let Some(turns) = sizes.get(b'P') else { return Ok(0) };
        let rule = self.extruder.firmware.turns_rule();
        if rule == TurnsRule::Ignored {
            // Slicers lift the nozzle in such circles without a deposit.
            if sizes.states(letters(b"E")) {
                let name = self.extruder.firmware.name();
                let what = format!("P (turns) of an arc is left out: {name} does not know it");
                self.beads.report.note(&what, self.line);
            }
            return Ok(0);
        }
        let unnamed = self.extruder.firmware == Firmware::Unnamed;
        let least = if rule == TurnsRule::Total && !unnamed { 1.0 } else { 0.0 };
        if turns.fract() != 0.0 || turns < least || turns > TURNS_MAX {
            let what =
                format!("P (turns) of the arc is {turns}, no whole number from {least} to {TURNS_MAX}");
            return Err(self.fault(&what));
        }
        let turns = turns as u32;
        if rule == TurnsRule::Additional {
            return Ok(turns);
        }
        let before = turns.saturating_sub(1);
        if unnamed && turns > 0 && sizes.states(letters(b"E")) {
            let whole = before + u32::from(is_circle);
            let arc = if is_circle { "full turns" } else { "full turns and the arc" };
            let what = format!(
                "P{turns} of an arc is read as {whole} {arc}, as RS-274 has it; Marlin adds one: `firmware` tells which"
            );
            self.beads.report.note(&what, self.line);
        }
        Ok(before)
    }

    fn deposit_arc(
        &mut self,
        motion: u8,
        sizes: &SizeWords,
        kind: BeadKey,
        (from, to, begin): (&Pose, &Pose, f64),
        piece: BeadMove,
    ) -> Result<()> {
        let chords = self.arc(motion, sizes, from, to)?;
        let [u, v, normal] = PLANES[self.plane];
        let rise = to.point[normal] - from.point[normal];
        let length = (chords.length * chords.length + rise * rise).sqrt();
        let fed = match self.switch.area {
            Some(area) if !self.by_extruder => area * length,
            _ => piece.fed,
        };
        let piece = BeadMove { fed, ..piece };
        let between = |a: f64, b: f64, part: f64| a + (b - a) * part;
        let mut last = (*from, 0.0);
        let mut walked = 0.0;
        for (place, part) in chords.inner_points() {
            let mut next = *to;
            (next.point[u], next.point[v]) = (place[0], place[1]);
            next.point[normal] = between(from.point[normal], to.point[normal], part);
            let turned = from.towards(to, part);
            (next.degrees, next.vector) = (turned.degrees, turned.vector);
            walked += distance(last.0.point, next.point);
            self.deposit_chord(kind, last, (next, part), begin, piece)?;
            last = (next, part);
        }
        walked += distance(last.0.point, to.point);
        self.beads.report.arcs.length_lost += length - walked;
        self.deposit_chord(kind, last, (*to, 1.0), begin, piece)
    }

    /// A chord between two parts of an arc that deposits from the part `begin` on.
    fn deposit_chord(
        &mut self,
        kind: BeadKey,
        (from, from_part): (Pose, f64),
        (to, to_part): (Pose, f64),
        begin: f64,
        piece: BeadMove,
    ) -> Result<()> {
        if to_part <= begin {
            return Ok(());
        }
        let (mut start, mut part) = (from, to_part - from_part);
        if from_part < begin {
            start = from.towards(&to, (begin - from_part) / part);
            part = to_part - begin;
        }
        let fed = if begin > 0.0 { piece.fed * (part / (1.0 - begin)) } else { piece.fed * part };
        self.beads.deposit(kind, &start, &to, BeadMove { fed, ..piece }, self.line)
    }
}
