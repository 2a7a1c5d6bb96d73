//! Where the tool is: units, offsets, and how the axes' words move it.

use super::POSITION_MAX;
use super::beads::Pose;
use super::parameters::Sizes;

/// Letters of the straight axes.
pub(super) const AXES: [u8; 3] = *b"XYZ";
/// Letters of the turning axes.
const TURNING: [u8; 3] = *b"ABC";

/// The position, and the modes that say what the axes' words mean.
pub(super) struct Position {
    /// mm in a unit of length.
    pub(super) unit: f64,
    /// Words of the axes count from where the tool is (G91).
    pub(super) relative: bool,
    /// As the program counts it, mm.
    pub(super) logical: [f64; 3],
    /// From there to the machine's coordinates.
    pub(super) offset: [f64; 3],
    degrees: [f64; 3],
    /// Axes whose position hangs on a placeholder.
    lost: [bool; 3],
    /// Steps in which the file states positions, mm.
    pub(super) resolution: f64,
}

impl Position {
    pub(super) fn new() -> Position {
        Position {
            unit: 1.0,
            relative: false,
            logical: [0.0; 3],
            offset: [0.0; 3],
            degrees: [0.0; 3],
            lost: [false; 3],
            resolution: 1.0,
        }
    }

    /// In the machine's coordinates.
    pub(super) fn pose(&self) -> Pose {
        let point = [0, 1, 2].map(|axis| self.logical[axis] + self.offset[axis]);
        Pose { point, degrees: self.degrees }
    }

    /// The letter of an axis whose position is unknown.
    pub(super) fn lost_axis(&self) -> Option<char> {
        self.lost.iter().position(|lost| *lost).map(|axis| char::from(AXES[axis]))
    }

    /// Moves the axes to where the words say. Returns whether a placeholder left one where it was.
    ///
    /// # Errors
    /// If the position is out of range, with the reason.
    pub(super) fn advance(&mut self, sizes: &Sizes) -> Result<bool, &'static str> {
        let mut left_open = false;
        for (axis, letter) in AXES.into_iter().enumerate() {
            if let Some(value) = sizes.get(letter) {
                let value = value * self.unit;
                if self.relative {
                    self.logical[axis] += value;
                } else {
                    self.logical[axis] = value;
                    self.lost[axis] = false;
                }
            } else if sizes.is_open(letter) {
                self.lost[axis] = true;
                left_open = true;
            }
            if (self.logical[axis] + self.offset[axis]).abs() > 2.0 * POSITION_MAX * self.unit {
                return Err("leads out of range: no machine is larger than 1 km");
            }
        }
        for (axis, letter) in TURNING.into_iter().enumerate() {
            if let Some(value) = sizes.get(letter) {
                self.degrees[axis] = if self.relative { self.degrees[axis] + value } else { value };
            }
        }
        Ok(left_open)
    }

    /// G92: the tool is where it is, and is called so from now on; without a word, 0 on `all` axes.
    pub(super) fn rename(&mut self, sizes: &Sizes, all: bool) {
        for (axis, letter) in AXES.into_iter().enumerate() {
            if let Some(value) = sizes.get(letter).or(all.then_some(0.0)) {
                let machine = self.logical[axis] + self.offset[axis];
                self.logical[axis] = value * self.unit;
                self.offset[axis] = machine - self.logical[axis];
            }
        }
    }

    /// G92.1: the program's coordinates are the machine's again.
    pub(super) fn clear_offset(&mut self) {
        for axis in 0..3 {
            self.logical[axis] += self.offset[axis];
            self.offset[axis] = 0.0;
        }
    }

    /// G28: to the end stops of the axes named, or of all.
    pub(super) fn home(&mut self, named: &[u8]) {
        let named = &named[..named.iter().position(|b| matches!(b, b';' | b'*')).unwrap_or(named.len())];
        let is_named = |letter: u8| named.iter().any(|b| b.to_ascii_uppercase() == letter);
        let all = !AXES.into_iter().any(is_named);
        for (axis, letter) in AXES.into_iter().enumerate() {
            if all || is_named(letter) {
                (self.logical[axis], self.offset[axis], self.lost[axis]) = (0.0, 0.0, false);
            }
        }
    }
}
