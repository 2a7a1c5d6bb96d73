//! What positions are called: G54 to G59.3, G10 L2 and L20, G52, and G92 with its kin.
//!
//! The tool stays where it is when an offset changes; only its name changes.

use super::machine::MachineState;
use super::offsets::{EXTENDED, OffsetCode, Offsets, SYSTEM_MAX};
use super::parameters::{SizeWords, letters};
use super::position::{AXES, MachinePosition};
use super::words::Words;
use crate::error::Result;

impl MachineState<'_, '_> {
    /// Carries out a command that sets offsets.
    pub(super) fn set_offsets(&mut self, code: OffsetCode, mut words: Words<'_>) -> Result<()> {
        let mut sizes = SizeWords::default();
        let mut kind = None;
        while let Some(word) = words.next() {
            let word = word.map_err(|malformed| self.malformed(&malformed))?;
            let word = self.understood(word)?;
            match word.letter {
                b'L' => kind = word.value,
                // Temperatures and other things that G10 sets elsewhere.
                b'S' | b'D' | b'H' | b'F' | b'Q' => {}
                _ => self.size(&word, &mut sizes)?,
            }
        }
        match code {
            OffsetCode::G52 => self.position.set_local(&sizes),
            OffsetCode::G54Extended => {
                let system = self.system(&sizes, f64::from(EXTENDED), SYSTEM_MAX)?;
                self.position.select_system(system);
            }
            OffsetCode::G10 => self.set_by_g10(kind, &sizes)?,
        }
        Ok(())
    }

    fn set_by_g10(&mut self, kind: Option<f64>, sizes: &SizeWords) -> Result<()> {
        match kind.map(|kind| kind as i64) {
            None if sizes.states(letters(b"P")) => {
                // RepRapFirmware: a tool's temperatures, or its offset.
                if sizes.states(letters(b"XYZ")) {
                    self.beads.report.note("offsets of tools, set by G10 P, are left out", self.line);
                }
            }
            None => self.retract_by_firmware(),
            Some(kind @ (2 | 20)) => {
                if sizes.get(b'R').is_some_and(|angle| angle != 0.0) {
                    return Err(self.fault("turns the coordinates by G10 R, which is not read"));
                }
                let system = self.system(sizes, 0.0, EXTENDED)?;
                match kind {
                    2 => self.position.set_system(system, sizes),
                    _ => self.position.name_in_system(system, sizes),
                }
            }
            Some(_) => self.beads.report.note("offsets of tools, set by G10, are taken for zero", self.line),
        }
        Ok(())
    }

    /// The number of a work offset by the word P, from `low` on.
    fn system(&self, sizes: &SizeWords, low: f64, high: u16) -> Result<u16> {
        let number = sizes.get(b'P').unwrap_or(0.0) + low;
        match number.fract() == 0.0 && (low..=f64::from(high)).contains(&number) {
            true => Ok(number as u16),
            false => Err(self.fault("names a work offset that no machine has")),
        }
    }
}

impl MachinePosition {
    /// G54 to G59.3: selects a work offset.
    pub(super) fn select_system(&mut self, system: u16) {
        self.change(|offsets| (offsets.active, offsets.selected) = (system, true));
    }

    /// G10 L2: the origin of a work offset, 0 being the active one.
    pub(super) fn set_system(&mut self, system: u16, sizes: &SizeWords) {
        let unit = self.unit;
        self.change(|offsets| {
            let system = if system == 0 { offsets.active } else { system };
            let origin = offsets.systems.entry(system).or_default();
            for (axis, letter) in AXES.into_iter().enumerate() {
                if let Some(value) = sizes.get(letter) {
                    origin[axis] = value * unit;
                }
            }
        });
    }

    /// G10 L20: the origin of a work offset by what the tool's position is called in it.
    pub(super) fn name_in_system(&mut self, system: u16, sizes: &SizeWords) {
        let (unit, work) = (self.unit, self.offsets.work());
        // What is left of the offset is G92's, which stays.
        let machine = [0, 1, 2].map(|axis| self.logical[axis] + work[axis]);
        self.change(|offsets| {
            let local = offsets.local;
            let system = if system == 0 { offsets.active } else { system };
            let origin = offsets.systems.entry(system).or_default();
            for (axis, letter) in AXES.into_iter().enumerate() {
                if let Some(value) = sizes.get(letter) {
                    origin[axis] = machine[axis] - local[axis] - value * unit;
                }
            }
        });
    }

    /// G52: the origin within the work offset.
    pub(super) fn set_local(&mut self, sizes: &SizeWords) {
        let unit = self.unit;
        self.change(|offsets| {
            for (axis, letter) in AXES.into_iter().enumerate() {
                if let Some(value) = sizes.get(letter) {
                    offsets.local[axis] = value * unit;
                }
            }
        });
    }

    /// G92.1, and G92.2 if it `keeps` them: positions are called as the work offset has it.
    pub(super) fn clear_offset(&mut self, keeps: bool) {
        let work = self.offsets.work();
        self.offsets.suspended = match keeps {
            true => [0, 1, 2].map(|axis| self.offset[axis] - work[axis]),
            false => [0.0; 3],
        };
        for (axis, origin) in work.into_iter().enumerate() {
            self.logical[axis] += self.offset[axis] - origin;
            self.offset[axis] = origin;
        }
    }

    /// G92.3: what G92.2 put aside holds again.
    pub(super) fn restore_offset(&mut self) {
        self.shift(self.offsets.suspended);
        self.offsets.suspended = [0.0; 3];
    }

    /// Moves the origin of the program's coordinates, and not the tool.
    pub(super) fn shift(&mut self, by: [f64; 3]) {
        for (axis, by) in by.into_iter().enumerate() {
            if by != 0.0 {
                self.offset[axis] += by;
                self.logical[axis] -= by;
            }
        }
    }

    fn change(&mut self, change: impl FnOnce(&mut Offsets)) {
        let before = self.offsets.work();
        change(&mut self.offsets);
        let after = self.offsets.work();
        self.shift([0, 1, 2].map(|axis| after[axis] - before[axis]));
    }
}
