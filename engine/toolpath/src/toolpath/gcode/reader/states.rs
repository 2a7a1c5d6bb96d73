//! States of coordinates that programs save and restore.

use super::extruder::Modes;
use std::collections::BTreeMap;

/// Most states that are kept.
pub(super) const STATES_MAX: usize = 1 << 10;

/// What a state holds.
#[derive(Clone)]
pub(super) struct State {
    pub(super) relative: bool,
    pub(super) modes: Modes,
    pub(super) offset: [f64; 3],
    pub(super) nudge: [f64; 3],
    pub(super) machine: [f64; 3],
    pub(super) e: f64,
    pub(super) flows: BTreeMap<u16, f64>,
}

/// Saved states by their names, and the offset that SET_GCODE_OFFSET gave.
#[derive(Default)]
pub(super) struct States {
    pub(super) saved: BTreeMap<Vec<u8>, State>,
    pub(super) nudge: [f64; 3],
}
