//! Extruders: what E feeds, by tool, and what was retracted and not primed yet.

use super::comments::Settings;
use super::parameters::Sizes;
use std::collections::BTreeMap;
use std::f64::consts::FRAC_PI_4;

/// Fed without motion, beyond what was retracted: more is a blob. In units of E; a millionth is what binary
/// numbers lose of decimal ones in a long file.
const DUST: f64 = 1e-6;

/// The E axis and its modes.
pub(super) struct Extruder {
    diameters: Vec<f64>,
    /// E counts mm³.
    pub(super) volumetric: bool,
    /// As M82 and M83 have it; before them, E follows the other axes.
    pub(super) relative: Option<bool>,
    e: f64,
    pub(super) tool: u16,
    /// Retracted and not primed yet, by tool, in units of E.
    retracted: BTreeMap<u16, f64>,
    /// Steps in which the file states E.
    pub(super) resolution: f64,
}

impl Extruder {
    pub(super) fn new(settings: &Settings, diameters: Vec<f64>) -> Extruder {
        Extruder {
            diameters,
            volumetric: settings.volumetric,
            relative: None,
            e: 0.0,
            tool: 0,
            retracted: BTreeMap::new(),
            resolution: 1.0,
        }
    }

    /// What E feeds, in mm or mm³, by its word. `relative_axes` is the other axes' mode.
    pub(super) fn feed(&mut self, sizes: &Sizes, unit: f64, relative_axes: bool) -> f64 {
        let Some(value) = sizes.get(b'E') else { return 0.0 };
        let value = value * unit;
        if self.relative.unwrap_or(relative_axes) {
            self.e += value;
            return value;
        }
        let fed = value - self.e;
        self.e = value;
        fed
    }

    /// G92: E is called so from now on.
    pub(super) fn rename(&mut self, e: f64) {
        self.e = e;
    }

    /// Where E is, as the program counts it.
    pub(super) fn position(&self) -> f64 {
        self.e
    }

    /// Takes back filament of the present tool.
    pub(super) fn retract(&mut self, length: f64) {
        *self.retracted.entry(self.tool).or_default() += length;
    }

    /// Feeds filament of the present tool in one place. Returns what leaves the nozzle, or 0.
    pub(super) fn prime(&mut self, length: f64) -> f64 {
        let retracted = self.retracted.entry(self.tool).or_default();
        let excess = length - *retracted;
        *retracted = (*retracted - length).max(0.0);
        if excess > DUST { excess } else { 0.0 }
    }

    /// mm³ in a unit of E.
    pub(super) fn area(&self) -> f64 {
        if self.volumetric {
            return 1.0;
        }
        let last = self.diameters.last();
        let diameter = self.diameters.get(usize::from(self.tool)).or(last).copied().unwrap_or(0.0);
        FRAC_PI_4 * diameter * diameter
    }
}
