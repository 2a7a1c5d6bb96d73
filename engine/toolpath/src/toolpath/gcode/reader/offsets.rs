//! Work offsets: what G54 to G59.3, G10 L2 and L20, and G52 keep.

use std::collections::BTreeMap;

/// Highest number of a work offset: G54.1 P300 beside G54 to G59.3.
pub(super) const SYSTEM_MAX: u16 = EXTENDED + 300;

/// The number of G54.1 P0, behind those of G54 to G59.3.
pub(super) const EXTENDED: u16 = 9;

/// The work offsets of a machine, as far as the file tells them.
pub(super) struct Offsets {
    /// By number, in mm; G54 is 1.
    pub(super) systems: BTreeMap<u16, [f64; 3]>,
    pub(super) active: u16,
    /// G52.
    pub(super) local: [f64; 3],
    /// What G92.2 put aside.
    pub(super) suspended: [f64; 3],
    /// G54 or another was selected by the file.
    pub(super) selected: bool,
    /// Those without a value in the file in which something was deposited.
    guessed: Vec<u16>,
    /// The first other one in which something was deposited.
    known: Option<u16>,
}

impl Offsets {
    pub(super) fn new() -> Offsets {
        Offsets {
            systems: BTreeMap::new(),
            active: 1,
            local: [0.0; 3],
            suspended: [0.0; 3],
            selected: false,
            guessed: Vec::new(),
            known: None,
        }
    }

    /// The origin of the program's coordinates, but for G92.
    pub(super) fn work(&self) -> [f64; 3] {
        let system = self.systems.get(&self.active).copied().unwrap_or_default();
        [0, 1, 2].map(|axis| system[axis] + self.local[axis])
    }

    /// Whether the file selects an offset without telling it.
    pub(super) fn is_guessed(&self) -> bool {
        self.selected && !self.systems.contains_key(&self.active)
    }

    /// Notes a deposit under the active offset. Returns whether offsets are mixed that the file does not tell.
    pub(super) fn deposit(&mut self) -> bool {
        if !self.selected {
            return false;
        }
        if self.systems.contains_key(&self.active) {
            self.known.get_or_insert(self.active);
        } else if self.guessed.len() < 2 && !self.guessed.contains(&self.active) {
            self.guessed.push(self.active);
        }
        !self.guessed.is_empty() && (self.guessed.len() > 1 || self.known.is_some())
    }
}

/// Commands that set offsets.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum OffsetCode {
    /// G10.
    G10,
    /// G52.
    G52,
    /// G54.1, with P.
    G54Extended,
}
