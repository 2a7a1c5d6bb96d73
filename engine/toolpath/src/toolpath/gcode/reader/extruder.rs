//! Extruders: what E feeds, by tool, and what was retracted and not made up for yet.
//!
//! Filament that was retracted, standing or in a move, must be fed again before anything leaves the nozzle, whatever
//! the firmware: a move that feeds again deposits only from where the retracted length is made up. Each tool has its
//! own retraction, unless the file says that all filaments share one nozzle.

use super::firmware::{ExtruderRule, Firmware};
use super::parameters::SizeWords;
use super::settings::SlicerSettings;
use std::collections::BTreeMap;
use std::f64::consts::FRAC_PI_4;

/// Fed without motion, beyond what was retracted: more is a blob. In units of E; a millionth is what binary
/// numbers lose of decimal ones in a long file.
const DUST: f64 = 1e-6;

/// A retraction of so many of the file's steps is what rounding left...
const ROUNDING_STEPS: f64 = 10.0;
/// ... if it is not more than this, in units of E.
const ROUNDING_MAX: f64 = 0.02;

/// Most tools whose retraction is kept apart. Printers have up to 36.
const TOOLS_MAX: usize = 1 << 10;

/// The E axis and its modes.
pub(super) struct Extruder {
    pub(super) firmware: Firmware,
    diameters: Vec<f64>,
    /// Whether E counts mm³, of all tools but those in `volumetric_by_tool`.
    volumetric: bool,
    volumetric_by_tool: BTreeMap<u16, bool>,
    /// mm³ in a unit of E of the present tool.
    area: f64,
    /// The last of G90 (absolute) and G91 (relative).
    axes_relative: bool,
    /// The last of M82 (absolute) and M83 (relative).
    own_relative: Option<bool>,
    /// The last of all four.
    last_relative: bool,
    /// What the firmware's rule makes of them.
    relative: bool,
    /// The firmware is not known for sure, and some would count E in the other way.
    disputed: bool,
    e: f64,
    pub(super) tool: u16,
    /// All tools feed one nozzle.
    shares_nozzle: bool,
    /// Retracted and not made up for yet of the present tool, mm³.
    owed: f64,
    /// The same of the tools that are put away.
    put_away: BTreeMap<u16, f64>,
    /// Steps in which the file states E.
    pub(super) resolution: f64,
    /// A diameter was needed: E counted a length where material was deposited.
    pub(super) fed_by_length: bool,
}

/// How E counts, as commands have it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Modes {
    axes: bool,
    own: Option<bool>,
    last: bool,
}

/// What a move feeds.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct FeedAmount {
    /// What E moves, mm³; negative if it retracts.
    pub(super) moved: f64,
    /// What leaves the nozzle, mm³.
    pub(super) net: f64,
    /// Part of the move after which material leaves.
    pub(super) begin: f64,
    /// What was retracted is not made up for by a move of its own: a user may wonder where the bead begins.
    pub(super) is_odd: bool,
}

impl Extruder {
    pub(super) fn new(firmware: Firmware, settings: &SlicerSettings, diameters: Vec<f64>) -> Extruder {
        let mut extruder = Extruder {
            firmware,
            diameters,
            volumetric: settings.is_volumetric(firmware),
            volumetric_by_tool: BTreeMap::new(),
            area: 1.0,
            axes_relative: false,
            own_relative: None,
            last_relative: false,
            relative: false,
            disputed: false,
            e: 0.0,
            tool: 0,
            shares_nozzle: settings.shares_nozzle,
            owed: 0.0,
            put_away: BTreeMap::new(),
            resolution: 1.0,
            fed_by_length: false,
        };
        extruder.renew_area();
        extruder
    }

    /// G90 and G91.
    pub(super) fn set_axes_relative(&mut self, relative: bool) {
        (self.axes_relative, self.last_relative) = (relative, relative);
        self.renew_mode();
    }

    /// M82 and M83.
    pub(super) fn set_relative(&mut self, relative: bool) {
        (self.own_relative, self.last_relative) = (Some(relative), relative);
        self.renew_mode();
    }

    fn renew_mode(&mut self) {
        let own = self.own_relative.unwrap_or(false);
        let while_relative = self.axes_relative || own;
        self.relative = match self.firmware.extruder_rule() {
            ExtruderRule::WhileRelative => while_relative,
            ExtruderRule::LastCommand => self.last_relative,
            ExtruderRule::Own => own,
        };
        // Marlin 1 and Klipper on one side, Marlin 2 on the other: a file that says Marlin may mean either.
        let may_be_either = matches!(self.firmware, Firmware::Unnamed | Firmware::Marlin | Firmware::Marlin2);
        self.disputed = may_be_either && while_relative != self.last_relative;
    }

    /// Whether E counts relative here by some of the firmwares that may be meant, and absolute by others.
    #[inline]
    pub(super) fn is_disputed(&self) -> bool {
        self.disputed
    }

    /// Whether E counts from where it is.
    pub(super) fn is_relative(&self) -> bool {
        self.relative
    }

    /// What the E word of a command feeds.
    #[inline]
    pub(super) fn feed(&mut self, sizes: &SizeWords, unit: f64) -> f64 {
        let Some(value) = sizes.get(b'E') else { return 0.0 };
        let value = value * unit;
        if self.relative {
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

    /// How E counts.
    pub(super) fn modes(&self) -> Modes {
        Modes { axes: self.axes_relative, own: self.own_relative, last: self.last_relative }
    }

    /// Lets E count as it did.
    pub(super) fn set_modes(&mut self, modes: Modes) {
        (self.axes_relative, self.own_relative, self.last_relative) = (modes.axes, modes.own, modes.last);
        self.renew_mode();
    }

    /// What a move that feeds so much deposits; what it retracts is owed.
    #[inline]
    pub(super) fn in_move(&mut self, fed: f64) -> FeedAmount {
        let moved = fed * self.area;
        if fed <= 0.0 {
            self.owed -= moved;
            return FeedAmount { moved, ..FeedAmount::default() };
        }
        if self.owed == 0.0 {
            return FeedAmount { moved, net: moved, ..FeedAmount::default() };
        }
        self.make_up(moved)
    }

    #[cold]
    fn make_up(&mut self, moved: f64) -> FeedAmount {
        let rounding = (ROUNDING_STEPS * self.resolution).min(ROUNDING_MAX) * self.area;
        if self.owed <= rounding {
            self.owed = 0.0;
            return FeedAmount { moved, net: moved, ..FeedAmount::default() };
        }
        if moved <= self.owed + DUST * self.area {
            self.owed = (self.owed - moved).max(0.0);
            return FeedAmount { moved, net: 0.0, begin: 1.0, is_odd: self.owed > rounding };
        }
        let begin = self.owed / moved;
        let net = moved - self.owed;
        self.owed = 0.0;
        FeedAmount { moved, net, begin, is_odd: true }
    }

    /// What leaves the nozzle where filament is fed in one place, mm³; what is retracted there is owed.
    pub(super) fn in_place(&mut self, fed: f64) -> f64 {
        let moved = fed * self.area;
        let excess = moved - self.owed;
        self.owed = (-excess).max(0.0);
        if fed > 0.0 && excess > DUST * self.area { excess } else { 0.0 }
    }

    /// The firmware has changed or loaded the filament by itself: nothing is retracted.
    pub(super) fn is_loaded(&mut self) {
        self.owed = 0.0;
    }

    /// Takes another tool.
    pub(super) fn select(&mut self, tool: u16) {
        if tool == self.tool {
            return;
        }
        if !self.shares_nozzle {
            if self.put_away.len() < TOOLS_MAX || self.put_away.contains_key(&self.tool) {
                self.put_away.insert(self.tool, self.owed);
            }
            self.owed = self.put_away.get(&tool).copied().unwrap_or(0.0);
        }
        self.tool = tool;
        self.renew_area();
    }

    /// Whether E of the present tool counts mm³.
    pub(super) fn is_volumetric(&self) -> bool {
        self.volumetric_by_tool.get(&self.tool).copied().unwrap_or(self.volumetric)
    }

    /// M200: E counts mm³, or not, of one tool or of all.
    pub(super) fn set_volumetric(&mut self, volumetric: bool, tool: Option<u16>) {
        match tool {
            Some(tool) if self.volumetric_by_tool.len() < TOOLS_MAX => {
                self.volumetric_by_tool.insert(tool, volumetric);
            }
            Some(_) => {}
            None => {
                self.volumetric = volumetric;
                self.volumetric_by_tool.clear();
            }
        }
        self.renew_area();
    }

    fn renew_area(&mut self) {
        let last = self.diameters.last();
        let diameter = self.diameters.get(usize::from(self.tool)).or(last).copied().unwrap_or(0.0);
        self.area = if self.is_volumetric() { 1.0 } else { FRAC_PI_4 * diameter * diameter };
    }

    /// mm³ in a unit of E.
    #[inline]
    pub(super) fn area(&self) -> f64 {
        self.area
    }
}
