//! Where the tool is: units, offsets, and how the axes' words move it.

use super::POSITION_MAX;
use super::beads::Pose;
use super::layer_axis::LayerAxis;
use super::offsets::Offsets;
use super::parameters::{SizeWords, letters};

/// Letters of the straight axes.
pub(super) const AXES: [u8; 3] = *b"XYZ";
/// Letters of the turning axes.
const TURNING: [u8; 3] = *b"ABC";

const OUT_OF_RANGE: &str = "leads out of range: no machine is larger than 1 km";

/// The position, and the modes that say what the axes' words mean.
pub(super) struct MachinePosition {
    /// mm in a unit of length.
    pub(super) unit: f64,
    /// Words of the axes count from where the tool is (G91).
    pub(super) relative: bool,
    /// As the program counts it, mm.
    pub(super) logical: [f64; 3],
    /// From there to the machine's coordinates.
    pub(super) offset: [f64; 3],
    pub(super) offsets: Offsets,
    /// The axis that carries layers beside Z, and where it is: as the program counts it, and from there to the
    /// machine's coordinates.
    layer_axis: LayerAxis,
    table: (f64, f64),
    degrees: [f64; 3],
    vector: Option<[f64; 3]>,
    /// The tool's axis at the end of the next move.
    next_vector: Option<[f64; 3]>,
    /// Axes whose position in the program's coordinates hangs on a work offset that is not known.
    unsure: [bool; 3],
    /// Axes whose position hangs on a placeholder.
    lost: [bool; 3],
    /// Steps in which the file states positions, mm.
    pub(super) resolution: f64,
}

impl MachinePosition {
    pub(super) fn new(unit: f64, layer_axis: LayerAxis) -> MachinePosition {
        MachinePosition {
            unit,
            relative: false,
            logical: [0.0; 3],
            offset: [0.0; 3],
            offsets: Offsets::new(),
            layer_axis,
            table: (0.0, 0.0),
            degrees: [0.0; 3],
            vector: None,
            next_vector: None,
            unsure: [false; 3],
            lost: [false; 3],
            resolution: 1.0,
        }
    }

    /// Letters of the words that move an axis.
    pub(super) fn letters(&self) -> u32 {
        letters(b"XYZ") | letters(&TURNING) | self.layer_axis.letter().map_or(0, |letter| letters(&[letter]))
    }

    /// The axis that carries layers.
    pub(super) fn layer_axis(&self) -> LayerAxis {
        self.layer_axis
    }

    /// Position of the axis that carries layers beside Z.
    pub(super) fn table(&self) -> f64 {
        self.table.0 + self.table.1
    }

    /// In the machine's coordinates.
    pub(super) fn machine(&self) -> [f64; 3] {
        [0, 1, 2].map(|axis| self.logical[axis] + self.offset[axis])
    }

    /// In the machine's coordinates, over the part.
    pub(super) fn pose(&self) -> Pose {
        let mut point = self.machine();
        match self.layer_axis.letter() {
            None => {}
            Some(b'Z') => point[2] *= self.layer_axis.factor(),
            Some(_) => point[2] += self.layer_axis.factor() * self.table(),
        }
        Pose { point, degrees: self.degrees, vector: self.vector }
    }

    /// What brings a coordinate of an axis to where [`MachinePosition::pose`] has it.
    pub(super) fn pose_offset(&self, axis: usize) -> f64 {
        match self.layer_axis.letter() {
            Some(letter) if axis == 2 && letter != b'Z' => {
                self.offset[2] + self.layer_axis.factor() * self.table()
            }
            _ => self.offset[axis],
        }
    }

    /// The letter of an axis that G53 moved, and no coordinate since, under an offset that is not known.
    pub(super) fn unsure_axis(&self) -> Option<char> {
        self.unsure.iter().position(|unsure| *unsure).map(|axis| char::from(AXES[axis]))
    }

    /// G53: moves the axes to places in the machine's coordinates.
    ///
    /// # Errors
    /// If the position is out of range, with the reason.
    pub(super) fn move_machine(&mut self, to: [Option<f64>; 3]) -> Result<(), &'static str> {
        for (axis, to) in to.into_iter().enumerate() {
            let Some(to) = to else { continue };
            if to.abs() > 2.0 * POSITION_MAX * self.unit {
                return Err(OUT_OF_RANGE);
            }
            self.logical[axis] = to - self.offset[axis];
            self.unsure[axis] = self.offsets.is_guessed();
            self.lost[axis] = false;
        }
        Ok(())
    }

    /// G53: moves the table to a place in the machine's coordinates.
    pub(super) fn move_table(&mut self, sizes: &SizeWords) {
        let letter = self.layer_axis.letter().filter(|letter| *letter != b'Z');
        if let Some(value) = letter.and_then(|letter| sizes.get(letter)) {
            self.table.0 = value * self.unit - self.table.1;
        }
    }

    /// States the tool's axis at the end of the next move.
    pub(super) fn set_vector(&mut self, vector: [f64; 3]) {
        self.next_vector = Some(vector);
    }

    /// The letter of an axis whose position is unknown.
    pub(super) fn lost_axis(&self) -> Option<char> {
        self.lost.iter().position(|lost| *lost).map(|axis| char::from(AXES[axis]))
    }

    /// Moves the axes to where the words say. Returns whether a placeholder left one where it was.
    ///
    /// # Errors
    /// If the position is out of range, with the reason.
    pub(super) fn advance(&mut self, sizes: &SizeWords) -> Result<bool, &'static str> {
        let mut left_open = false;
        for (axis, letter) in AXES.into_iter().enumerate() {
            if let Some(value) = sizes.get(letter) {
                let value = value * self.unit;
                if self.relative {
                    self.logical[axis] += value;
                } else {
                    self.logical[axis] = value;
                    (self.lost[axis], self.unsure[axis]) = (false, false);
                }
            } else if sizes.is_open(letter) {
                self.lost[axis] = true;
                left_open = true;
            }
            if (self.logical[axis] + self.offset[axis]).abs() > 2.0 * POSITION_MAX * self.unit {
                return Err(OUT_OF_RANGE);
            }
        }
        self.advance_table(sizes)?;
        for (axis, letter) in TURNING.into_iter().enumerate() {
            if let Some(value) = sizes.get(letter).filter(|_| self.layer_axis.letter() != Some(letter)) {
                self.vector = None;
                self.degrees[axis] = if self.relative { self.degrees[axis] + value } else { value };
            }
        }
        self.vector = self.next_vector.take().or(self.vector);
        Ok(left_open)
    }

    fn advance_table(&mut self, sizes: &SizeWords) -> Result<(), &'static str> {
        let letter = self.layer_axis.letter().filter(|letter| *letter != b'Z');
        if let Some(value) = letter.and_then(|letter| sizes.get(letter)) {
            let value = value * self.unit;
            self.table.0 = if self.relative { self.table.0 + value } else { value };
            if self.table().abs() > 2.0 * POSITION_MAX * self.unit {
                return Err(OUT_OF_RANGE);
            }
        }
        Ok(())
    }

    /// G92: the tool is where it is, and is called so from now on; without a word, 0 on `all` axes.
    pub(super) fn rename(&mut self, sizes: &SizeWords, all: bool) {
        for (axis, letter) in AXES.into_iter().enumerate() {
            if let Some(value) = sizes.get(letter).or(all.then_some(0.0)) {
                let machine = self.logical[axis] + self.offset[axis];
                self.logical[axis] = value * self.unit;
                self.offset[axis] = machine - self.logical[axis];
            }
        }
        let letter = self.layer_axis.letter().filter(|letter| *letter != b'Z');
        if let Some(value) = letter.and_then(|letter| sizes.get(letter)) {
            let machine = self.table();
            self.table.0 = value * self.unit;
            self.table.1 = machine - self.table.0;
        }
    }

    /// G28: to the end stops of the axes named, or of all.
    pub(super) fn home(&mut self, named: &[u8]) {
        let named = &named[..named.iter().position(|b| matches!(b, b';' | b'*')).unwrap_or(named.len())];
        let is_named = |letter: u8| named.iter().any(|b| b.to_ascii_uppercase() == letter);
        let table = self.layer_axis.letter().filter(|letter| *letter != b'Z');
        let names_table = table.is_some_and(is_named);
        let all = !AXES.into_iter().any(is_named) && !names_table;
        if table.is_some() && (all || names_table) {
            self.table = (0.0, 0.0);
        }
        let work = self.offsets.work();
        for (axis, letter) in AXES.into_iter().enumerate() {
            if all || is_named(letter) {
                (self.logical[axis], self.offset[axis], self.lost[axis]) = (-work[axis], work[axis], false);
            }
        }
    }
}
