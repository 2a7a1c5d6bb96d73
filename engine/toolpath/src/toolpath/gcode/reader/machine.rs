//! What the commands do: the state of the machine, line by line.

use super::POSITION_MAX;
use super::beads::BeadAssembler;
use super::deposition::DepositionSwitch;
use super::expressions::Variables;
use super::extruder::Extruder;
use super::firmware::Firmware;
use super::layer_axis::LayerAxis;
use super::options::{ExtruderAxis, GcodeOptions};
use super::parameters::{SizeWords, letters};
use super::position::MachinePosition;
use super::report::UnitSource;
use super::states::States;
use super::words::{Exponent, MalformedWord, Word, Words, behind_number, quote, token};
use crate::error::{Error, Result};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// Most tools with a factor of their own.
const FLOWS_MAX: usize = 1 << 10;

/// What is known of a machine before its program begins.
pub(super) struct Setup {
    /// Whether E deposits; otherwise the switch does.
    pub(super) by_extruder: bool,
    pub(super) switch: DepositionSwitch,
    /// mm in a unit of length, until G20 or G21.
    pub(super) unit: f64,
    pub(super) layer_axis: LayerAxis,
    /// Comments of moves tell regions.
    pub(super) has_regions: bool,
}

/// The machine: modes, positions, what comments announced.
pub(super) struct MachineState<'s, 'k> {
    path: PathBuf,
    pub(super) beads: BeadAssembler<'s, 'k>,
    pub(super) position: MachinePosition,
    pub(super) extruder: Extruder,
    pub(super) arc_tolerance: Option<f64>,
    pub(super) line: u64,
    /// Whether E deposits; otherwise the switch does.
    pub(super) by_extruder: bool,
    pub(super) switch: DepositionSwitch,
    /// Letter of the extruder's axis, E by default.
    pub(super) extruder_letter: u8,
    /// Factors of what is fed (M221), by tool.
    pub(super) flows: BTreeMap<u16, f64>,
    pub(super) states: States,
    pub(super) variables: Variables,
    /// Comments of moves tell regions.
    has_regions: bool,
    /// Whether axes that are left out are told.
    pub(super) tells_axes: bool,
    /// G53 stands on this line.
    pub(super) in_machine: bool,
    /// The axis that this line states.
    pub(super) vector: [Option<f64>; 3],
    pub(super) absolute_centres: bool,
    pub(super) plane: usize,
    pub(super) motion: Option<u8>,
    pub(super) feature: Option<u16>,
    pub(super) width: Option<f64>,
    /// Of the region that a comment tells.
    pub(super) region_width: Option<f64>,
    pub(super) height: Option<f64>,
    pub(super) layer: u32,
    /// A comment has begun a layer.
    pub(super) layer_is_marked: bool,
    /// Nothing was deposited since.
    pub(super) layer_is_fresh: bool,
    /// The present tool has deposited nothing since it was taken.
    pub(super) nozzle_is_fresh: bool,
}

impl<'s, 'k> MachineState<'s, 'k> {
    pub(super) fn new(
        path: &Path,
        options: &GcodeOptions,
        setup: Setup,
        extruder: Extruder,
        beads: BeadAssembler<'s, 'k>,
    ) -> MachineState<'s, 'k> {
        let Setup { by_extruder, switch, unit, layer_axis, has_regions } = setup;
        MachineState {
            path: path.to_owned(),
            beads,
            position: MachinePosition::new(unit, layer_axis),
            extruder,
            arc_tolerance: options.arc_tolerance,
            line: 0,
            by_extruder,
            switch,
            extruder_letter: options.extruder_axis.map_or(b'E', ExtruderAxis::letter),
            flows: BTreeMap::new(),
            states: States::default(),
            variables: Variables::new(&options.variables),
            has_regions,
            tells_axes: options.layer_axis != Some(LayerAxis::NONE),
            in_machine: false,
            vector: [None; 3],
            absolute_centres: false,
            plane: 0,
            motion: None,
            feature: None,
            width: None,
            region_width: None,
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
        let mut start = words.rest();
        if let [b'N' | b'n', b'0'..=b'9', ..] = start {
            start = behind_number(start);
        }
        match start {
            [b';', ..] => return self.comment(start),
            [b'%' | b'/' | b'$' | b'@' | b'[' | b'{' | b':', ..] => {
                // Alone, a percent sign frames a program.
                if start != b"%" {
                    self.beads.report.unknown(token(start), self.line);
                }
                return Ok(());
            }
            // Prusa's MMU asks the user which filament to load.
            [b'T', b'?', ..] => return Ok(()),
            [b'#', ..] => return self.assign(start),
            // A command of Klipper and its like is a word of several letters.
            [b'_', ..] => return self.extended(start),
            [a, b, ..] if a.is_ascii_alphabetic() && (b.is_ascii_alphabetic() || *b == b'_') => {
                return self.extended(start);
            }
            [] if !line.contains(&b'(') => return Ok(()),
            _ => {}
        }
        let travels = match self.has_regions || start.is_empty() {
            true => self.comments_of(line, start.is_empty())?,
            false => None,
        };
        if !start.is_empty() {
            self.command(line, words)?;
        }
        // A travel's comment counts for its own line alone.
        if let Some(before) = travels {
            (self.feature, self.region_width) = before;
        }
        Ok(())
    }

    /// Klipper's tools are called extruder, extruder1, extruder2.
    pub(super) fn activate_extruder(&mut self, parameters: &[u8]) -> Result<()> {
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

    #[cold]
    pub(super) fn note_exponent(&mut self, word: &Word<'_>) {
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

    pub(super) fn size(&mut self, word: &Word<'_>, sizes: &mut SizeWords) -> Result<()> {
        let malformed = |what| MalformedWord { text: word.text, what };
        if !word.letter.is_ascii_uppercase() {
            self.beads.report.unknown(word.text, self.line);
            return Ok(());
        }
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
    pub(super) fn set_position(&mut self, mut words: Words<'_>) -> Result<()> {
        let sizes = self.all_sizes(&mut words)?;
        let all = !sizes.any(u32::MAX);
        self.position.rename(&sizes, all);
        if let Some(e) = sizes.get(b'E').or(all.then_some(0.0)) {
            self.extruder.rename(e * self.position.unit);
        }
        let table = self.position.layer_axis().letter().map_or(0, |letter| letters(&[letter]));
        if sizes.states(letters(b"ABC") & !table) {
            self.beads.report.note("G92 of a turning axis is left out", self.line);
        }
        Ok(())
    }

    /// The words of the rest of the line.
    pub(super) fn all_sizes(&mut self, words: &mut Words<'_>) -> Result<SizeWords> {
        let mut sizes = SizeWords::default();
        while let Some(word) = words.next() {
            let word = word.map_err(|malformed| self.malformed(&malformed))?;
            let word = self.understood(word)?;
            self.size(&word, &mut sizes)?;
        }
        Ok(sizes)
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

    /// G20, G21 and their like.
    pub(super) fn set_unit(&mut self, unit: f64) {
        if self.beads.report.machine.unit_source == UnitSource::Option && self.position.unit != unit {
            let what =
                "the program says its unit by a code (G20, G21), which counts from there on: not `unit`";
            self.beads.report.note(what, self.line);
        }
        self.position.unit = unit;
        if self.beads.report.machine.unit_mm.is_none() {
            self.beads.report.machine.unit_source = UnitSource::Code;
        }
    }

    /// G43: the table of tools is the machine's.
    pub(super) fn use_tool_length(&mut self) {
        self.beads.report.machine.tool_lengths = true;
        // Machines begin with G0.
        self.motion.get_or_insert(0);
    }

    /// M221: scales what is fed, of one tool or the present one.
    pub(super) fn set_flow(&mut self, words: &mut Words<'_>) {
        let (mut percent, mut tool) = (None, None);
        while let Some(Ok(word)) = words.next() {
            match word.letter {
                b'S' => percent = word.value.filter(|value| (0.0..=1e4).contains(value)),
                b'T' | b'D' => tool = word.value.filter(|value| (0.0..65536.0).contains(value)),
                _ => {}
            }
        }
        if let Some(percent) = percent
            && self.flows.len() < FLOWS_MAX
        {
            let tool = tool.map_or(self.extruder.tool, |tool| tool as u16);
            self.flows.insert(tool, percent / 100.0);
        }
    }

    /// Firmware retraction.
    pub(super) fn retract_by_firmware(&mut self) {
        self.beads.report.retractions += 1;
    }

    /// Compares the checksum behind the words: all bytes before its asterisk, xored.
    pub(super) fn check_sum(&mut self, line: &[u8], rest: &[u8]) {
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
    pub(super) fn malformed(&self, malformed: &MalformedWord<'_>) -> Error {
        self.fault(&format!("the word {} {}", quote(malformed.text), malformed.what))
    }
}

/// 10 to the power of minus its index.
const TENTHS: [f64; 16] =
    [1e0, 1e-1, 1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9, 1e-10, 1e-11, 1e-12, 1e-13, 1e-14, 1e-15];
