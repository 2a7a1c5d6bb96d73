//! What the caller knows better than the file.

use super::SIZE_MAX;
use super::deposition::DepositionCode;
use super::firmware::Firmware;
use super::layer_axis::LayerAxis;
use crate::error::{Error, Result};
use std::fmt;
use std::str::FromStr;

/// What the caller knows better than the file. Lengths in mm.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct GcodeOptions {
    /// Firmware whose rules count; overrides what the file names.
    pub firmware: Option<Firmware>,
    /// Filament diameter of all tools; overrides the file's settings.
    pub filament_diameter: Option<f64>,
    /// Width of all beads; overrides comments and E.
    pub width: Option<f64>,
    /// Height of all beads; overrides comments and the distances of layers.
    pub height: Option<f64>,
    /// Features whose beads are left out, by the names in the file, in any case: "Skirt/Brim", "Custom",
    /// [`super::UNNAMED`]. They are still counted in [`super::GcodeReport::skipped`].
    pub skip_features: Vec<String>,
    /// Whether features beside the part are left out as well: see [`super::is_auxiliary`].
    pub skip_auxiliary: bool,
    /// How far chords may deviate from arcs; by default a hundredth of the bead's width.
    pub arc_tolerance: Option<f64>,
    /// mm in the file's unit of length, until G20 or G21 says otherwise; by default what the header tells, or 1.
    pub unit: Option<f64>,
    /// The axis that carries layers beside Z; by default what the file shows.
    pub layer_axis: Option<LayerAxis>,
    /// The axis that feeds, in the place of E.
    pub extruder_axis: Option<ExtruderAxis>,
    /// Codes that switch deposition on and off, in the place of E and of those that the reader knows.
    pub deposit_on: Vec<DepositionCode>,
    /// See [`GcodeOptions::deposit_on`]. Commands that take an argument switch off by 0 without.
    pub deposit_off: Vec<DepositionCode>,
    /// Variables of the machine that the file uses and does not set, by their names: `#200`, `R1`.
    pub variables: Vec<(String, f64)>,
    /// The plate whose toolpath is read, of an archive of several.
    pub plate: Option<u32>,
}

impl GcodeOptions {
    pub(super) fn check(&self) -> Result<()> {
        for (name, value, low) in [
            ("filament diameter", self.filament_diameter, 1e-3),
            ("width", self.width, 1e-3),
            ("height", self.height, 1e-3),
            ("arc tolerance", self.arc_tolerance, 1e-6),
        ] {
            if value.is_some_and(|value| !(low..=SIZE_MAX).contains(&value)) {
                let what = format!("the {name} is not between {low} and {SIZE_MAX} mm");
                return Err(Error::setting(what, "give it in mm"));
            }
        }
        check(self)
    }
}

/// The letter of an axis that feeds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ExtruderAxis(u8);

impl ExtruderAxis {
    pub(super) fn letter(self) -> u8 {
        self.0
    }
}

impl FromStr for ExtruderAxis {
    type Err = Error;

    fn from_str(text: &str) -> Result<ExtruderAxis> {
        match text.trim().to_ascii_uppercase().as_bytes() {
            [letter @ (b'A'..=b'C' | b'E' | b'U'..=b'W')] => Ok(ExtruderAxis(*letter)),
            _ => {
                let what = format!("\"{}\" is no axis that can feed", text.escape_debug());
                Err(Error::setting(what, "give A, B, C, E, U, V or W"))
            }
        }
    }
}

impl fmt::Display for ExtruderAxis {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", char::from(self.0))
    }
}

/// Refuses options that contradict each other.
fn check(options: &GcodeOptions) -> Result<()> {
    let feeds = options.extruder_axis.map(ExtruderAxis::letter);
    let lifts = options.layer_axis.and_then(LayerAxis::letter);
    if feeds.is_some() && feeds == lifts {
        return Err(Error::setting("one axis cannot feed and carry layers", "give two axes, or one of them"));
    }
    let (on, off) = (&options.deposit_on, &options.deposit_off);
    if on.is_empty() && !off.is_empty() {
        return Err(Error::setting("codes switch off, and none switches on", "give `deposit_on`, too"));
    }
    if off.is_empty() && !on.iter().all(DepositionCode::takes_argument) {
        return Err(Error::setting("codes switch on, and none switches off", "give `deposit_off`, too"));
    }
    if options.unit.is_some_and(|unit| !(1e-6..=1e4).contains(&unit)) {
        return Err(Error::setting("the unit is not between 1e-6 and 1e4 mm", "give mm or inches"));
    }
    match options.variables.iter().find(|(name, value)| name.is_empty() || !value.is_finite()) {
        Some((name, _)) => {
            Err(Error::setting(format!("the variable {name:?} has no value"), "give NAME=NUMBER"))
        }
        None => Ok(()),
    }
}
