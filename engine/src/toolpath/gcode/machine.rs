//! What the commands do: the state of the machine, line by line.

use super::arc::{Arc, Centre};
use super::beads::{Beads, Kind, Pose};
use super::comments::{self, Comment, Settings};
use super::sizes::{Piece, Resolution};
use super::words::{Malformed, Word, Words, quote, token};
use super::{GcodeOptions, POSITION_MAX, commands};
use crate::error::{Error, Result};
use std::collections::BTreeMap;
use std::f64::consts::FRAC_PI_4;
use std::path::{Path, PathBuf};

/// Deviation allowed for the chords of an arc: this part of the bead's width...
const ARC_TOLERANCE_OF_WIDTH: f64 = 0.01;
/// ... or so many mm where no comment tells the width.
const ARC_TOLERANCE_MM: f64 = 0.005;

/// An arc's ends may differ in their distance from the centre by this much, in mm, for rounding alone.
const ARC_MISMATCH_MM: f64 = 0.005;

/// The two axes of the plane of arcs and the axis along its normal: G17, G18, G19.
const PLANES: [[usize; 3]; 3] = [[0, 1, 2], [2, 0, 1], [1, 2, 0]];

/// The words of one command that carry a size.
#[derive(Clone, Copy, Default)]
pub(super) struct Sizes {
    values: [f64; 26],
    present: u32,
    /// Words whose value is a placeholder.
    open: u32,
}

impl Sizes {
    pub(super) fn get(&self, letter: u8) -> Option<f64> {
        self.has(letter).then(|| self.values[usize::from(letter - b'A')])
    }

    fn has(&self, letter: u8) -> bool {
        self.present >> (letter - b'A') & 1 == 1
    }

    fn is_open(&self, letter: u8) -> bool {
        self.open >> (letter - b'A') & 1 == 1
    }

    fn put(&mut self, word: &Word<'_>) {
        let index = word.letter - b'A';
        match word.value {
            Some(value) => {
                self.values[usize::from(index)] = value;
                self.present |= 1 << index;
            }
            None => self.open |= 1 << index,
        }
    }
}

const fn letters(letters: &[u8]) -> u32 {
    let mut set = 0;
    let mut i = 0;
    while i < letters.len() {
        set |= 1 << (letters[i] - b'A');
        i += 1;
    }
    set
}

/// Words that move the tool.
const MOVING: u32 = letters(b"XYZEABC");
/// Words that a command may carry.
const CARRIED: u32 = letters(b"XYZEABCIJKRP");
const AXES: [u8; 3] = *b"XYZ";

/// The machine: modes, positions, what comments announced.
pub(super) struct Machine<'s, 'k> {
    path: PathBuf,
    pub(super) beads: Beads<'s, 'k>,
    arc_tolerance: Option<f64>,
    pub(super) line: u64,
    /// Whether E deposits; otherwise M3, M4 and M5 switch deposition.
    by_extruder: bool,
    diameters: Vec<f64>,
    /// E counts mm³.
    pub(super) volumetric: bool,
    /// mm in a unit of length.
    pub(super) unit: f64,
    pub(super) relative: bool,
    pub(super) relative_e: Option<bool>,
    pub(super) absolute_centres: bool,
    pub(super) plane: usize,
    pub(super) motion: Option<u8>,
    /// As the program counts it, mm.
    logical: [f64; 3],
    /// From there to the machine's coordinates.
    offset: [f64; 3],
    degrees: [f64; 3],
    e: f64,
    /// Steps in which the file states positions, mm.
    resolution: f64,
    /// Steps in which the file states E.
    resolution_e: f64,
    /// Axes whose position hangs on a placeholder.
    lost: [bool; 3],
    pub(super) depositing: bool,
    tool: u16,
    /// Retracted and not primed yet, by tool, in units of E.
    retracted: BTreeMap<u16, f64>,
    feature: Option<u16>,
    width: Option<f64>,
    height: Option<f64>,
    layer: u32,
    /// A comment has begun a layer.
    layer_is_marked: bool,
    /// Nothing was deposited since.
    layer_is_fresh: bool,
}

impl<'s, 'k> Machine<'s, 'k> {
    pub(super) fn new(
        path: &Path,
        options: &GcodeOptions,
        settings: &Settings,
        by_extruder: bool,
        diameters: Vec<f64>,
        beads: Beads<'s, 'k>,
    ) -> Machine<'s, 'k> {
        Machine {
            path: path.to_owned(),
            beads,
            arc_tolerance: options.arc_tolerance,
            line: 0,
            by_extruder,
            diameters,
            volumetric: settings.volumetric,
            unit: 1.0,
            relative: false,
            relative_e: None,
            absolute_centres: false,
            plane: 0,
            motion: None,
            logical: [0.0; 3],
            offset: [0.0; 3],
            degrees: [0.0; 3],
            e: 0.0,
            resolution: 1.0,
            resolution_e: 1.0,
            lost: [false; 3],
            depositing: false,
            tool: 0,
            retracted: BTreeMap::new(),
            feature: None,
            width: None,
            height: None,
            layer: 0,
            layer_is_marked: false,
            layer_is_fresh: true,
        }
    }

    /// Carries out a line.
    ///
    /// # Errors
    /// If it is malformed, or the beads' taker fails.
    pub(super) fn execute(&mut self, line: &[u8]) -> Result<()> {
        let mut words = Words::new(line);
        let start = words.rest();
        match start {
            [] => Ok(()),
            [b';', ..] => self.comment(start),
            [b'%' | b'/' | b'$' | b'@' | b'#' | b'[' | b'{' | b':', ..] => {
                // Alone, a percent sign frames a program.
                if start != b"%" {
                    self.beads.report.unknown(token(start), self.line);
                }
                Ok(())
            }
            // A command of Klipper and its like is a word of several letters.
            [a, b, ..] if a.is_ascii_alphabetic() && (b.is_ascii_alphabetic() || *b == b'_') => {
                self.extended(token(start));
                Ok(())
            }
            _ => self.command(line, words),
        }
    }

    fn extended(&mut self, name: &[u8]) {
        if !commands::is_neutral_extended(name) {
            self.beads.report.unknown(name, self.line);
        }
    }

    fn comment(&mut self, comment: &[u8]) -> Result<()> {
        match comments::meaning(comment) {
            Comment::Feature(name) => self.feature = Some(self.beads.feature(name, self.line)?),
            Comment::Width(width) => self.width = self.checked(width, "a comment's width is no size"),
            Comment::Height(height) => self.height = self.checked(height, "a comment's height is no size"),
            Comment::Layer => {
                // What is deposited before the first mark belongs to the first layer.
                self.layer += u32::from(self.layer_is_marked && !self.layer_is_fresh);
                (self.layer_is_marked, self.layer_is_fresh) = (true, true);
            }
            Comment::Mesh(name) => {
                let name = String::from_utf8_lossy(&name[..name.len().min(200)]);
                let meshes = &mut self.beads.report.meshes;
                if meshes.len() < 1000 && name != "NONMESH" && meshes.iter().all(|known| *known != name) {
                    meshes.push(name.into_owned());
                }
            }
            Comment::Other => {}
        }
        Ok(())
    }

    fn checked(&mut self, size: Option<f64>, complaint: &str) -> Option<f64> {
        if size.is_none() {
            self.beads.report.note(complaint, self.line);
        }
        size
    }

    fn command(&mut self, line: &[u8], mut words: Words<'_>) -> Result<()> {
        let mut sizes = Sizes::default();
        let mut moves = false;
        let mut first = true;
        while let Some(word) = words.next() {
            let word = word.map_err(|malformed| self.malformed(&malformed))?;
            match word.letter {
                b'N' if first => continue,
                b'G' | b'M' | b'T' => match self.code(&word, first, &mut words)? {
                    commands::Effect::Modal => {}
                    commands::Effect::Motion => moves = true,
                    commands::Effect::LineDone => return Ok(()),
                    commands::Effect::SetPosition => return self.set_position(words),
                },
                b'F' | b'S' => {}
                letter if CARRIED >> (letter - b'A') & 1 == 1 => self.size(&word, &mut sizes)?,
                letter => self.beads.report.unknown(&[letter], self.line),
            }
            first = false;
        }
        self.check_sum(line, words.rest());
        if (sizes.present | sizes.open) & MOVING != 0 || (moves && sizes.present != 0) {
            let Some(motion) = self.motion else {
                return Err(self.fault("coordinates stand before the first G0, G1, G2 or G3"));
            };
            return self.go(motion, &sizes);
        }
        Ok(())
    }

    fn code(&mut self, word: &Word<'_>, first: bool, words: &mut Words<'_>) -> Result<commands::Effect> {
        let Some(value) = word.value else {
            return Err(self.malformed(&Malformed { text: word.text, what: "has no number" }));
        };
        commands::code(self, word, value, first, words)
    }

    fn size(&mut self, word: &Word<'_>, sizes: &mut Sizes) -> Result<()> {
        let malformed = |what| Malformed { text: word.text, what };
        if (sizes.present | sizes.open) >> (word.letter - b'A') & 1 == 1 {
            return Err(self.malformed(&malformed("repeats a letter of its line")));
        }
        if word.value.is_some_and(|value| value.abs() > POSITION_MAX) {
            return Err(self.malformed(&malformed("is out of range: no machine is larger than 1 km")));
        }
        sizes.put(word);
        // Numbers with fewer digits than others have lost zeros at their end.
        let step = TENTHS[word.decimals.min(15) as usize] * self.unit;
        match word.letter {
            b'E' => self.resolution_e = self.resolution_e.min(step),
            b'X' | b'Y' | b'Z' => self.resolution = self.resolution.min(step),
            _ => {}
        }
        Ok(())
    }

    /// G92: the tool is where it is, and is called so from now on.
    fn set_position(&mut self, mut words: Words<'_>) -> Result<()> {
        let mut sizes = Sizes::default();
        while let Some(word) = words.next() {
            let word = word.map_err(|malformed| self.malformed(&malformed))?;
            self.size(&word, &mut sizes)?;
        }
        let all = sizes.present | sizes.open == 0;
        for (axis, letter) in AXES.into_iter().enumerate() {
            if let Some(value) = sizes.get(letter).or(all.then_some(0.0)) {
                let machine = self.logical[axis] + self.offset[axis];
                self.logical[axis] = value * self.unit;
                self.offset[axis] = machine - self.logical[axis];
            }
        }
        if let Some(e) = sizes.get(b'E').or(all.then_some(0.0)) {
            self.e = e * self.unit;
        }
        if sizes.present & letters(b"ABC") != 0 {
            self.beads.report.note("G92 of a turning axis is left out", self.line);
        }
        Ok(())
    }

    /// G92.1: the program's coordinates are the machine's again.
    pub(super) fn clear_offset(&mut self) {
        for axis in 0..3 {
            self.logical[axis] += self.offset[axis];
            self.offset[axis] = 0.0;
        }
    }

    /// G28: to the end stops of the axes named, or of all.
    pub(super) fn home(&mut self, named: &[u8]) -> Result<()> {
        let named = &named[..named.iter().position(|b| matches!(b, b';' | b'*')).unwrap_or(named.len())];
        let is_named = |letter: u8| named.iter().any(|b| b.to_ascii_uppercase() == letter);
        let all = !AXES.into_iter().any(is_named);
        for (axis, letter) in AXES.into_iter().enumerate() {
            if all || is_named(letter) {
                (self.logical[axis], self.offset[axis], self.lost[axis]) = (0.0, 0.0, false);
            }
        }
        self.beads.finish()
    }

    pub(super) fn select_tool(&mut self, tool: u16) {
        self.tool = tool;
    }

    /// Firmware retraction.
    pub(super) fn retract_by_firmware(&mut self) {
        self.beads.report.retractions += 1;
    }

    fn pose(&self) -> Pose {
        let point = [0, 1, 2].map(|axis| self.logical[axis] + self.offset[axis]);
        Pose { point, degrees: self.degrees }
    }

    /// G0, G1, G2, G3.
    fn go(&mut self, motion: u8, sizes: &Sizes) -> Result<()> {
        let from = self.pose();
        let fed = self.feed(sizes);
        self.advance_axes(sizes)?;
        let to = self.pose();
        let turns = self.degrees != from.degrees;
        let is_arc = motion >= 2 && sizes.present & letters(b"IJKR") != 0;
        if motion >= 2 && !is_arc {
            return Err(self.fault("the arc has neither I, J or K nor R"));
        }
        if !is_arc && from.point == to.point {
            return self.stay(fed, turns, motion);
        }
        self.beads.report.moves += 1;
        let deposits = match self.by_extruder {
            true => fed > 0.0,
            false => self.depositing && motion != 0,
        };
        if fed < 0.0 {
            *self.retracted.entry(self.tool).or_default() -= fed;
        }
        if !deposits {
            if is_arc {
                // Refuses what is no arc; its chords do not matter.
                self.arc(motion, sizes, &from, &to)?;
            }
            return self.beads.finish();
        }
        if let Some(axis) = self.lost.iter().position(|lost| *lost) {
            let axis = char::from(AXES[axis]);
            return Err(self.fault(&format!("deposits, but a placeholder left {axis} unknown before")));
        }
        self.layer_is_fresh = false;
        let feature = match self.feature {
            Some(feature) => feature,
            None => self.beads.feature(b"", self.line)?,
        };
        self.feature = Some(feature);
        let kind = Kind { layer: self.layer, tool: self.tool, feature };
        let area = self.area();
        self.beads.resolution = Resolution { position: self.resolution, volume: self.resolution_e * area };
        let piece = Piece { fed: fed * area, width: self.width, height: self.height };
        match is_arc {
            true => self.deposit_arc(motion, sizes, kind, &from, &to, piece),
            false => self.beads.deposit(kind, &from, &to, piece, self.line),
        }
    }

    /// Moves the axes to where the words say.
    fn advance_axes(&mut self, sizes: &Sizes) -> Result<()> {
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
                self.beads.report.note("a placeholder that the slicer left is taken for no move", self.line);
            }
            if (self.logical[axis] + self.offset[axis]).abs() > 2.0 * POSITION_MAX * self.unit {
                return Err(self.fault("leads out of range: no machine is larger than 1 km"));
            }
        }
        if sizes.open & !letters(&AXES) != 0 {
            return Err(self.fault("a placeholder that the slicer left stands for a number that is needed"));
        }
        for (axis, letter) in (*b"ABC").into_iter().enumerate() {
            if let Some(value) = sizes.get(letter) {
                self.degrees[axis] = if self.relative { self.degrees[axis] + value } else { value };
            }
        }
        Ok(())
    }

    /// What E feeds, in mm or mm³, by its word.
    fn feed(&mut self, sizes: &Sizes) -> f64 {
        let Some(value) = sizes.get(b'E') else { return 0.0 };
        let value = value * self.unit;
        if self.relative_e.unwrap_or(self.relative) {
            self.e += value;
            return value;
        }
        let fed = value - self.e;
        self.e = value;
        fed
    }

    /// A command that leaves the tool tip where it is.
    fn stay(&mut self, fed: f64, turns: bool, motion: u8) -> Result<()> {
        if !self.by_extruder {
            let deposits = self.depositing && motion != 0;
            self.beads.report.zero_length += u64::from(deposits && !turns);
            if deposits && turns {
                self.beads.report.note("the tool turns in place while it deposits", self.line);
            }
            return Ok(());
        }
        let retracted = self.retracted.entry(self.tool).or_default();
        if fed < 0.0 {
            *retracted -= fed;
            self.beads.report.retractions += 1;
        } else if fed > 0.0 {
            // A millionth is what binary numbers lose of decimal ones in a long file.
            let excess = fed - *retracted;
            *retracted = (*retracted - fed).max(0.0);
            if excess > 1e-6 {
                self.beads.report.zero_length += 1;
                self.beads.report.blobs.count += 1;
                self.beads.report.blobs.volume += excess * self.area();
            }
        }
        Ok(())
    }

    /// mm³ in a unit of E.
    fn area(&self) -> f64 {
        if self.volumetric {
            return 1.0;
        }
        let last = self.diameters.last();
        let diameter = self.diameters.get(usize::from(self.tool)).or(last).copied().unwrap_or(0.0);
        FRAC_PI_4 * diameter * diameter
    }

    fn arc(&mut self, motion: u8, sizes: &Sizes, from: &Pose, to: &Pose) -> Result<super::arc::Chords> {
        let [u, v, _] = PLANES[self.plane];
        let start = [from.point[u], from.point[v]];
        let centre = match sizes.get(b'R') {
            Some(radius) => Centre::Radius(radius * self.unit),
            None => Centre::Offset([u, v].map(|axis| {
                let letter = b"IJK"[axis];
                match (sizes.get(letter), self.absolute_centres) {
                    (Some(value), true) => value * self.unit + self.offset[axis] - from.point[axis],
                    (value, _) => value.unwrap_or(0.0) * self.unit,
                }
            })),
        };
        let arc = Arc { start, end: [to.point[u], to.point[v]], centre, clockwise: motion == 2 };
        let by_width = self.width.map_or(ARC_TOLERANCE_MM, |width| width * ARC_TOLERANCE_OF_WIDTH);
        let tolerance = self.arc_tolerance.unwrap_or(by_width);
        let chords = arc.chords(tolerance).map_err(|what| self.fault(what))?;
        let report = &mut self.beads.report;
        report.arcs.count += 1;
        report.arcs.chords += u64::from(chords.count);
        report.arcs.tolerance = report.arcs.tolerance.max(tolerance);
        if chords.mismatch > ARC_MISMATCH_MM {
            report.note("the ends of an arc differ in their distance from its centre", self.line);
        }
        Ok(chords)
    }

    fn deposit_arc(
        &mut self,
        motion: u8,
        sizes: &Sizes,
        kind: Kind,
        from: &Pose,
        to: &Pose,
        piece: Piece,
    ) -> Result<()> {
        let chords = self.arc(motion, sizes, from, to)?;
        let [u, v, normal] = PLANES[self.plane];
        let parts = f64::from(chords.count);
        let piece = Piece { fed: piece.fed / parts, ..piece };
        let between = |a: f64, b: f64, step: usize| a + (b - a) * (step as f64 / parts);
        let mut last = *from;
        let mut walked = 0.0;
        for (step, place) in chords.inner_points().enumerate() {
            let mut next = *to;
            (next.point[u], next.point[v]) = (place[0], place[1]);
            next.point[normal] = between(from.point[normal], to.point[normal], step + 1);
            next.degrees = [0, 1, 2].map(|axis| between(from.degrees[axis], to.degrees[axis], step + 1));
            walked += super::beads::distance(last.point, next.point);
            self.beads.deposit(kind, &last, &next, piece, self.line)?;
            last = next;
        }
        walked += super::beads::distance(last.point, to.point);
        let rise = to.point[normal] - from.point[normal];
        self.beads.report.arcs.length_lost += (chords.length * chords.length + rise * rise).sqrt() - walked;
        self.beads.deposit(kind, &last, to, piece, self.line)
    }

    /// Compares the checksum behind the words: all bytes before its asterisk, xored.
    fn check_sum(&mut self, line: &[u8], rest: &[u8]) {
        let Some(stated) = rest.strip_prefix(b"*") else { return };
        let covered = &line[..line.len() - rest.len()];
        let sum = covered.iter().fold(0, |sum, byte| sum ^ byte);
        let stated = super::words::number(stated.trim_ascii_start());
        if stated.is_none_or(|stated| stated.value != f64::from(sum)) {
            self.beads
                .report
                .note("a checksum does not fit its line, which is carried out all the same", self.line);
        }
    }

    /// An error at this line.
    pub(super) fn fault(&self, what: &str) -> Error {
        Error::input(
            &self.path,
            format!("line {}", self.line),
            what,
            "mend the line or export the file again",
        )
    }

    /// An error at a word of this line.
    pub(super) fn malformed(&self, malformed: &Malformed<'_>) -> Error {
        self.fault(&format!("the word {} {}", quote(malformed.text), malformed.what))
    }
}

/// 10 to the power of minus its index.
const TENTHS: [f64; 16] =
    [1e0, 1e-1, 1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9, 1e-10, 1e-11, 1e-12, 1e-13, 1e-14, 1e-15];
