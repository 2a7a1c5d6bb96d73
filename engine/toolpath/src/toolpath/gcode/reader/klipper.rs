//! Klipper's commands that change what coordinates mean: SAVE_GCODE_STATE, RESTORE_GCODE_STATE and
//! SET_GCODE_OFFSET.

use super::machine::MachineState;
use super::states::{STATES_MAX, State};
use super::words::number;
use crate::error::Result;

impl MachineState<'_, '_> {
    /// Carries out a command of Klipper's. Returns whether it is one of those.
    pub(super) fn klipper(&mut self, name: &[u8], behind: &[u8]) -> Result<bool> {
        let is = |known: &[u8]| name.eq_ignore_ascii_case(known);
        if is(b"SAVE_GCODE_STATE") {
            self.save_state(parameter(behind, b"NAME").unwrap_or(b"default"));
        } else if is(b"RESTORE_GCODE_STATE") {
            let moves = parameter(behind, b"MOVE").and_then(number).is_some_and(|found| found.value != 0.0);
            self.restore_state(parameter(behind, b"NAME").unwrap_or(b"default"), moves)?;
        } else if is(b"SET_GCODE_OFFSET") {
            self.nudge(behind)?;
        } else {
            return Ok(false);
        }
        Ok(true)
    }

    fn save_state(&mut self, name: &[u8]) {
        if self.states.saved.len() == STATES_MAX {
            self.beads.report.note("too many states are saved: this one is left out", self.line);
            return;
        }
        let state = State {
            relative: self.position.relative,
            modes: self.extruder.modes(),
            offset: self.position.offset,
            nudge: self.states.nudge,
            machine: self.position.machine(),
            e: self.extruder.position(),
            flows: self.flows.clone(),
        };
        self.states.saved.insert(name.to_owned(), state);
    }

    fn restore_state(&mut self, name: &[u8], moves: bool) -> Result<()> {
        let Some(state) = self.states.saved.get(name).cloned() else {
            self.beads.report.note("a state is restored that was not saved: nothing is done", self.line);
            return Ok(());
        };
        self.position.relative = state.relative;
        self.extruder.set_modes(state.modes);
        self.extruder.rename(state.e);
        self.flows = state.flows;
        self.states.nudge = state.nudge;
        self.position.shift([0, 1, 2].map(|axis| state.offset[axis] - self.position.offset[axis]));
        if moves {
            self.travel_to(state.machine)?;
        }
        Ok(())
    }

    fn nudge(&mut self, behind: &[u8]) -> Result<()> {
        let value = |key: &[u8]| parameter(behind, key).and_then(number).map(|found| found.value);
        let mut by = [0.0; 3];
        for (axis, letter) in (*b"XYZ").into_iter().enumerate() {
            let now = self.states.nudge[axis];
            let adjust = [&[letter][..], b"_ADJUST"].concat();
            let to = value(&[letter]).or_else(|| value(&adjust).map(|by| now + by)).unwrap_or(now);
            by[axis] = to - now;
            self.states.nudge[axis] = to;
        }
        self.position.shift(by);
        if value(b"MOVE").is_some_and(|moves| moves != 0.0) {
            let machine = self.position.machine();
            self.travel_to([0, 1, 2].map(|axis| machine[axis] + by[axis]))?;
        }
        Ok(())
    }

    /// A travel to a place in the machine's coordinates.
    fn travel_to(&mut self, machine: [f64; 3]) -> Result<()> {
        self.position.move_machine(machine.map(Some)).map_err(|what| self.fault(what))?;
        self.beads.report.moves += 1;
        self.beads.finish()
    }
}

/// The value of a parameter, `KEY=VALUE`.
fn parameter<'a>(text: &'a [u8], key: &[u8]) -> Option<&'a [u8]> {
    let end = text.iter().position(|b| matches!(b, b';' | b'#' | b'*')).unwrap_or(text.len());
    text[..end].split(u8::is_ascii_whitespace).find_map(|part| {
        let split = part.iter().position(|b| *b == b'=')?;
        part[..split].eq_ignore_ascii_case(key).then(|| part[split + 1..].trim_ascii())
    })
}
