//! What the commands do: the state of the machine, line by line.

use super::beads::Beads;
use super::comments::{self, Comment};
use super::extruder::Extruder;
use super::firmware::Firmware;
use super::parameters::{Sizes, letters};
use super::position::Position;
use super::words::{Exponent, Malformed, Word, Words, quote, token};
use super::{GcodeOptions, POSITION_MAX, commands, neutral};
use crate::error::{Error, Result};
use std::path::{Path, PathBuf};

/// Words that move the tool.
const MOVING: u32 = letters(b"XYZEABC");
/// Words that a command may carry.
const CARRIED: u32 = letters(b"XYZEABCIJKRP");

/// The machine: modes, positions, what comments announced.
pub(super) struct Machine<'s, 'k> {
    path: PathBuf,
    pub(super) beads: Beads<'s, 'k>,
    pub(super) position: Position,
    pub(super) extruder: Extruder,
    pub(super) arc_tolerance: Option<f64>,
    pub(super) line: u64,
    /// Whether E deposits; otherwise M3, M4 and M5 switch deposition.
    pub(super) by_extruder: bool,
    pub(super) absolute_centres: bool,
    pub(super) plane: usize,
    pub(super) motion: Option<u8>,
    pub(super) depositing: bool,
    pub(super) feature: Option<u16>,
    pub(super) width: Option<f64>,
    pub(super) height: Option<f64>,
    pub(super) layer: u32,
    /// A comment has begun a layer.
    layer_is_marked: bool,
    /// Nothing was deposited since.
    pub(super) layer_is_fresh: bool,
    /// The present tool has deposited nothing since it was taken.
    pub(super) nozzle_is_fresh: bool,
}

impl<'s, 'k> Machine<'s, 'k> {
    pub(super) fn new(
        path: &Path,
        options: &GcodeOptions,
        by_extruder: bool,
        extruder: Extruder,
        beads: Beads<'s, 'k>,
    ) -> Machine<'s, 'k> {
        Machine {
            path: path.to_owned(),
            beads,
            position: Position::new(),
            extruder,
            arc_tolerance: options.arc_tolerance,
            line: 0,
            by_extruder,
            absolute_centres: false,
            plane: 0,
            motion: None,
            depositing: false,
            feature: None,
            width: None,
            height: None,
            layer: 0,
            layer_is_marked: false,
            layer_is_fresh: true,
            nozzle_is_fresh: true,
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
            // Prusa's MMU asks the user which filament to load.
            [b'T', b'?', ..] => Ok(()),
            // A command of Klipper and its like is a word of several letters.
            [b'_', ..] => self.extended(start),
            [a, b, ..] if a.is_ascii_alphabetic() && (b.is_ascii_alphabetic() || *b == b'_') => {
                self.extended(start)
            }
            _ => self.command(line, words),
        }
    }

    fn extended(&mut self, start: &[u8]) -> Result<()> {
        let name = token(start);
        if name.eq_ignore_ascii_case(b"ACTIVATE_EXTRUDER") {
            return self.activate_extruder(&start[name.len()..]);
        }
        if !neutral::is_extended(name) {
            self.beads.report.unknown(name, self.line);
        }
        Ok(())
    }

    /// Klipper's tools are called extruder, extruder1, extruder2.
    fn activate_extruder(&mut self, parameters: &[u8]) -> Result<()> {
        let name = parameters.trim_ascii().split(|b| b.is_ascii_whitespace()).next().unwrap_or_default();
        const KEY: &[u8] = b"EXTRUDER=EXTRUDER";
        if name.len() >= KEY.len() && name[..KEY.len()].eq_ignore_ascii_case(KEY) {
            let number = std::str::from_utf8(&name[KEY.len()..]).unwrap_or_default();
            if let Some(tool) = if number.is_empty() { Some(0) } else { number.parse().ok() } {
                self.select_tool(tool);
                return Ok(());
            }
        }
        self.beads.report.unknown(b"ACTIVATE_EXTRUDER", self.line);
        Ok(())
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
        let mut takes_tool = false;
        while let Some(word) = words.next() {
            let word = word.map_err(|malformed| self.malformed(&malformed))?;
            if word.exponent != Exponent::None {
                self.note_exponent(&word);
            }
            match word.letter {
                b'N' if first => continue,
                b'G' | b'M' | b'T' => match self.code(&word, first, &mut words)? {
                    commands::Effect::Modal => {}
                    commands::Effect::Motion => moves = true,
                    commands::Effect::LineDone => return Ok(()),
                    commands::Effect::SetPosition => return self.set_position(words),
                },
                b'F' | b'S' => {}
                // Prusa's XL parks a tool by "P0 S1 L2 D0", and says how to take one by "T0 S1 L0 D0".
                b'P' if first => return Ok(()),
                b'L' | b'D' if takes_tool => {}
                letter if CARRIED >> (letter - b'A') & 1 == 1 => self.size(&word, &mut sizes)?,
                letter => self.beads.report.unknown(&[letter], self.line),
            }
            takes_tool |= first && word.letter == b'T';
            first = false;
        }
        self.check_sum(line, words.rest());
        if sizes.any(MOVING) || (moves && sizes.states(u32::MAX)) {
            let Some(motion) = self.motion else {
                return Err(self.fault("coordinates stand before the first G0, G1, G2 or G3"));
            };
            return self.go(motion, &sizes);
        }
        Ok(())
    }

    #[cold]
    fn note_exponent(&mut self, word: &Word<'_>) {
        let what = match word.exponent {
            Exponent::Taken => {
                let letter = char::from(word.letter);
                let value = word.value.unwrap_or_default();
                format!(
                    "{} is read as {letter}{value}: a number with an exponent, as some programs write them",
                    quote(word.text)
                )
            }
            _ => "an E right behind a number is taken for the extruder's word; it could be an exponent"
                .to_owned(),
        };
        self.beads.report.exponent(what, self.line);
    }

    fn code(&mut self, word: &Word<'_>, first: bool, words: &mut Words<'_>) -> Result<commands::Effect> {
        let Some(value) = word.value else {
            return Err(self.malformed(&Malformed { text: word.text, what: "has no number" }));
        };
        commands::code(self, word, value, first, words)
    }

    fn size(&mut self, word: &Word<'_>, sizes: &mut Sizes) -> Result<()> {
        let malformed = |what| Malformed { text: word.text, what };
        if sizes.any(letters(&[word.letter])) {
            return Err(self.malformed(&malformed("repeats a letter of its line")));
        }
        if word.value.is_some_and(|value| value.abs() > POSITION_MAX) {
            return Err(self.malformed(&malformed("is out of range: no machine is larger than 1 km")));
        }
        sizes.put(word);
        // Numbers with fewer digits than others have lost zeros at their end.
        let step = TENTHS[word.decimals.min(15) as usize] * self.position.unit;
        match word.letter {
            b'E' => self.extruder.resolution = self.extruder.resolution.min(step),
            b'X' | b'Y' | b'Z' => self.position.resolution = self.position.resolution.min(step),
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
        let all = !sizes.any(u32::MAX);
        self.position.rename(&sizes, all);
        if let Some(e) = sizes.get(b'E').or(all.then_some(0.0)) {
            self.extruder.rename(e * self.position.unit);
        }
        if sizes.states(letters(b"ABC")) {
            self.beads.report.note("G92 of a turning axis is left out", self.line);
        }
        Ok(())
    }

    /// G28: to the end stops of the axes named, or of all.
    pub(super) fn home(&mut self, named: &[u8]) -> Result<()> {
        self.position.home(named);
        self.beads.finish()
    }

    pub(super) fn select_tool(&mut self, tool: u16) {
        // Above 254 Bambu's numbers stand for no filament at all.
        if self.extruder.firmware != Firmware::Bambu || tool < 255 {
            self.nozzle_is_fresh |= tool != self.extruder.tool;
            self.extruder.select(tool);
        }
    }

    /// Firmware retraction.
    pub(super) fn retract_by_firmware(&mut self) {
        self.beads.report.retractions += 1;
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
