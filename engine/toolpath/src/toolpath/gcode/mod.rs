//! G-code: a stream of commands becomes a stream of beads.
//!
//! Dialects differ. This reader takes the side of the slicers' firmwares (Marlin and its kin), and of RS-274
//! where they are silent:
//!
//! - Words need no spaces, letters have no case, numbers have no exponent (`X1e1` is X1 and E1)
//!   unless no E word can be meant (`Y1.2e-05`), and then they are told. The same letter
//!   twice in a command is an error. Lines that begin with coordinates repeat the last motion.
//! - Firmwares read G90, G91, M82 and M83, the turns of arcs and M200 each in their way: [`Firmware`] has the rules.
//!   The file's own word for its firmware counts, else E is relative while G91 holds, whatever M82 said, and after M83.
//!   There is one E position, not one a tool.
//! - What was retracted, standing or in a move, must be fed again before anything leaves the nozzle. A move that feeds
//!   it again deposits from where it is made up, by the rest. Each tool has its own retraction, unless the slicer says
//!   that all filaments share a nozzle. M600, M701 and M702 end it.
//! - G92 renames the present position, as do G10 L20, G52, and Klipper's SET_GCODE_OFFSET and states in their ways.
//!   Points are given in the machine's coordinates, with work offsets (G54 to G59.3) as the file sets them by G10 L2,
//!   or else zero. G28 goes to 0. G53 is travel to a place in the machine's coordinates, on its line alone.
//! - A move deposits if E grows on it beyond what was retracted. In files where no move has an E, codes switch deposition:
//!   M3, M4 and M5 with S, or those of [`GcodeOptions::deposit_on`] and of known machines; rapid moves (G0) never deposit.
//! - A table's axis (W) is taken off Z, another axis is added by [`GcodeOptions::layer_axis`].
//! - Comments in parentheses are read like those behind a semicolon: layers, regions, widths.
//! - A, B and C tilt the head, in degrees: the tool's axis is Rz(C)·Ry(B)·Rx(A)·z, or it is the vector `A3= B3= C3=`; X Y Z are the tool tip in
//!   the part's frame. Machines that turn the part instead (rotary tables) are out of scope: their programs must
//!   be converted to the part's frame first.
//! - Arcs lie in the plane of G17, G18 or G19, by I J K or R, also as helices.
//!
//! A bead ends where the tool travels, or where layer, tool or feature change. A change of width or height does
//! not end it.

pub(crate) mod arc;
mod auxiliary;
mod beads;
mod bgcode;
mod commands;
mod comments;
mod coordinates;
mod deposition;
mod expressions;
mod extruder;
mod file_scan;
mod firmware;
mod klipper;
mod layer_axis;
mod lines;
mod machine;
mod member;
mod motion;
mod names;
mod neutral;
mod offsets;
mod parameters;
mod plan;
mod position;
mod regions;
mod remarks;
mod report;
mod settings;
mod sizes;
mod source;
mod states;
#[cfg(test)]
mod tests;
pub(crate) mod tilt;
pub(crate) mod words;

pub use auxiliary::is_auxiliary;
pub use deposition::DepositionCode;
pub use firmware::Firmware;
pub use layer_axis::LayerAxis;
pub use plan::ExtruderAxis;
pub use report::{
    ArcReport, BlobReport, FeatureReport, FilamentSource, FirmwareSource, GcodeFinding, GcodeReport,
    MachineReport, SettingsReport, SizeReport, SkipReport, UnitSource,
};

use super::{BeadSink, BeadView};
use crate::error::{Error, Result};
use crate::progress::{Progress, Silent};
use beads::BeadAssembler;
use comments::Comment;
use extruder::Extruder;
use file_scan::ScanFindings;
use lines::{LinesEnd, StreamLines};
use machine::MachineState;
use member::ArchiveMember;
use plan::ReadPlan;
use settings::SlicerSettings;
use source::{CountedFile, FileOrMember, TextStream};
use std::io::Read;
use std::path::Path;

/// Steps that are shorter, in mm, are joined to the next one: a thousandth of what files can express.
pub const MERGE_MM: f64 = 1e-6;

/// Name of the feature of beads that no comment names.
pub const UNNAMED: &str = "unnamed";

/// Largest width or height of a bead, in mm.
const SIZE_MAX: f64 = 1e4;

/// Largest number of a coordinate.
const POSITION_MAX: f64 = 1e6;

/// Lines between two looks at whether the user wants to stop.
const CHECK_LINES: u64 = 1 << 14;

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
    /// [`UNNAMED`]. They are still counted in [`GcodeReport::skipped`].
    pub skip_features: Vec<String>,
    /// Whether features beside the part are left out as well: see [`is_auxiliary`].
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
    fn check(&self) -> Result<()> {
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
        plan::check(self)
    }
}

/// Reads the G-code file `path`: plain, compressed by gzip or xz, binary (`.bgcode`), or in an archive (`.gcode.3mf`). Hands
/// its beads to `sink` in the order of the file. The file is read twice, since slicers write their settings at its end, and up to four times where a
/// table moves; memory does not grow with it.
///
/// # Errors
/// If the file cannot be read or unpacked, is malformed (with line and word), deposits nothing, or does not say
/// how wide or high its beads are and neither do the options; and if `sink` fails or the user stops.
pub fn read_gcode(
    path: &Path,
    options: &GcodeOptions,
    progress: &dyn Progress,
    sink: &mut BeadSink<'_>,
) -> Result<GcodeReport> {
    let mut file = source::open(path)?;
    let bytes = file.metadata().map_err(Error::io(path, "read the size"))?.len();
    let is_archive = member::is_archive(&mut file).map_err(Error::io(path, "read"))?;
    let member = is_archive.then(|| ArchiveMember::find(path, file, options.plate)).transpose()?;
    let mut passes = ["finding the slicer's settings"].into_iter();
    let open = || {
        progress.phase(passes.next().unwrap_or("reading G-code"), Some(bytes), "bytes");
        let file = CountedFile { file: source::open(path)?, progress };
        Ok(match &member {
            Some(member) => {
                FileOrMember::Member(Box::new(member.open(file).map_err(Error::io(path, "read"))?))
            }
            None => FileOrMember::Whole(file),
        })
    };
    read(path, open, options, progress, sink)
}

/// Reads G-code like [`read_gcode`], from a source that can be opened several times. `name` stands for it in messages.
///
/// # Errors
/// As [`read_gcode`].
pub fn read_gcode_from<R: Read>(
    name: &Path,
    open: impl FnMut() -> Result<R>,
    options: &GcodeOptions,
    sink: &mut BeadSink<'_>,
) -> Result<GcodeReport> {
    read(name, open, options, &Silent, sink)
}

fn read<R: Read>(
    path: &Path,
    mut open: impl FnMut() -> Result<R>,
    options: &GcodeOptions,
    progress: &dyn Progress,
    sink: &mut BeadSink<'_>,
) -> Result<GcodeReport> {
    options.check()?;
    let mut survey = Survey::new(options);
    each_line(path, open()?, progress, |_, line| {
        survey.read(line);
        Ok(())
    })?;
    survey.settings.finish();
    survey.signs.complete(&mut survey.settings);
    let mut plan = ReadPlan::new(options, &survey);
    while let Some(trial) = plan.trial() {
        let mut nothing = |_: BeadView<'_>| Ok(());
        let machine = carry_out(path, open()?, (&trial, options, &survey), progress, &mut nothing)?.0;
        plan.learn(&machine.beads);
    }
    let (machine, lines) = carry_out(path, open()?, (&plan, options, &survey), progress, sink)?;
    let by_length = machine.extruder.fed_by_length;
    let mut report = machine.beads.into_report();
    report.lines = lines;
    let (diameters, filament_source) = survey.filament(options, report.firmware);
    report_filament(&mut report, diameters, filament_source, by_length);
    deposits_something(path, &report, &survey)?;
    Ok(report)
}

/// Carries out a file's lines. Returns the machine at its end, and how many lines there are.
fn carry_out<'s, 'k, R: Read>(
    path: &Path,
    source: R,
    (plan, options, survey): (&ReadPlan, &GcodeOptions, &Survey),
    progress: &dyn Progress,
    sink: &'s mut BeadSink<'k>,
) -> Result<(MachineState<'s, 'k>, u64)> {
    let options = &plan.options(options);
    let (firmware, firmware_source) = survey.firmware(options);
    let (diameters, _) = survey.filament(options, firmware);
    let feeds = plan.by_extruder || plan.has_area;
    let has_layers = survey.has_layer_marks || survey.signs.has_layers;
    let mut beads = BeadAssembler::new(path, options, &survey.settings, feeds, has_layers, sink);
    survey.describe(firmware_source, &mut beads.report);
    beads.report.firmware = firmware;
    plan.prepare(&mut beads, options, &survey.signs);
    let setup = plan.setup(options, survey);
    beads.report.machine.deposition = match setup.by_extruder {
        true => char::from(survey.extruder_letter).to_string(),
        false => setup.switch.text(),
    };
    let extruder = Extruder::new(firmware, &survey.settings, diameters);
    let mut machine = MachineState::new(path, options, setup, extruder, beads);
    let lines = each_line(path, source, progress, |number, line| {
        machine.line = number;
        machine.execute(line)
    })?;
    machine.beads.finish()?;
    Ok((machine, lines))
}

/// Hands every line to `take`, with its number; returns how many there are.
fn each_line<R: Read>(
    path: &Path,
    packed: R,
    progress: &dyn Progress,
    mut take: impl FnMut(u64, &[u8]) -> Result<()>,
) -> Result<u64> {
    let source = TextStream::new(path, packed)?;
    let action = source.action();
    let mut lines = StreamLines::new(source);
    let mut number = 0;
    loop {
        let line = match lines.next() {
            Ok(Some(line)) => line,
            Ok(None) => return Ok(number),
            Err(LinesEnd::Read(source)) => return Err(Error::io(path, action)(source)),
            Err(LinesEnd::TooLong) => {
                let place = format!("line {}", number + 1);
                let what = format!("is longer than {} bytes", lines::LINE_BYTES_MAX);
                return Err(Error::input(path, place, what, "give a G-code file with ends of lines"));
            }
        };
        number += 1;
        if number == 1 {
            source::refuse_foreign(path, line)?;
        }
        if number % CHECK_LINES == 0 {
            progress.check()?;
        }
        take(number, line)?;
    }
}

/// What must be known of a file before its first line is carried out.
#[derive(Default)]
struct Survey {
    settings: SlicerSettings,
    has_e: bool,
    has_layer_marks: bool,
    signs: ScanFindings,
    extruder_letter: u8,
}

impl Survey {
    fn new(options: &GcodeOptions) -> Survey {
        let extruder_letter = options.extruder_axis.map_or(b'E', ExtruderAxis::letter);
        Survey { extruder_letter, ..Survey::default() }
    }

    fn read(&mut self, line: &[u8]) {
        let text = line.trim_ascii_start();
        self.signs.read(text);
        match text.first() {
            Some(b';') => {
                self.settings.read(text);
                self.has_layer_marks |= !self.has_layer_marks && comments::meaning(text) == Comment::Layer;
            }
            Some(b'M') => self.settings.read_command(text),
            Some(_) if !self.has_e => self.has_e = moves_e(text, self.extruder_letter),
            _ => {}
        }
    }

    fn firmware(&self, options: &GcodeOptions) -> (Firmware, FirmwareSource) {
        let named = self.settings.firmware();
        match (options.firmware, named) {
            (Some(firmware), _) => (firmware, FirmwareSource::Option),
            (None, Some((firmware, _))) => (firmware, FirmwareSource::File),
            (None, None) => (Firmware::Unnamed, FirmwareSource::Assumed),
        }
    }

    /// Writes down what the file says of itself.
    fn describe(&self, source: FirmwareSource, report: &mut GcodeReport) {
        let SlicerSettings { layer_height, first_layer_height, line_width, nozzle_diameter, .. } =
            self.settings;
        report.firmware_source = source;
        report.firmware_named_by = self.settings.firmware().map(|(_, by)| by.to_owned());
        report.slicer = self.settings.slicer.clone();
        report.settings = SettingsReport { layer_height, first_layer_height, line_width, nozzle_diameter };
    }

    /// Diameters by tool; they do not matter where E counts volume.
    fn filament(&self, options: &GcodeOptions, firmware: Firmware) -> (Vec<f64>, FilamentSource) {
        let SlicerSettings { filament_diameters: stated, told_by_m200, .. } = &self.settings;
        match options.filament_diameter {
            _ if !self.has_e => (Vec::new(), FilamentSource::None),
            Some(diameter) => (vec![diameter], FilamentSource::Option),
            None if !stated.is_empty() => (stated.clone(), FilamentSource::Comment),
            None if !told_by_m200.is_empty() => (told_by_m200.clone(), FilamentSource::Comment),
            None => (vec![firmware.usual_filament()], FilamentSource::Assumed),
        }
    }
}

/// Says which diameters were used, if any were.
fn report_filament(report: &mut GcodeReport, diameters: Vec<f64>, source: FilamentSource, by_length: bool) {
    if source == FilamentSource::None || !by_length {
        let is_none = source == FilamentSource::None;
        report.filament_source = if is_none { source } else { FilamentSource::Volumetric };
        return;
    }
    if source == FilamentSource::Assumed {
        let diameter = diameters.first().copied().unwrap_or_default();
        let what =
            format!("the filament's diameter is assumed to be {diameter} mm: the file does not tell it");
        report.notes.insert(0, GcodeFinding { what, line: 0, count: 1 });
    }
    (report.filament_diameters, report.filament_source) = (diameters, source);
}

/// Whether a line is a move with a word of the extruder's axis.
fn moves_e(line: &[u8], extruder: u8) -> bool {
    let mut moves = true;
    let mut words = words::Words::new(line);
    while let Some(Ok(word)) = words.next() {
        match word.letter {
            b'G' => moves = word.value.is_some_and(|code| (0.0..=3.0).contains(&code)),
            b'M' | b'T' => return false,
            letter if letter == extruder && moves => return true,
            _ => {}
        }
    }
    false
}

fn deposits_something(path: &Path, report: &GcodeReport, survey: &Survey) -> Result<()> {
    let place = format!("line {}", report.lines);
    if report.beads > 0 {
        return Ok(());
    }
    if report.skipped.segments > 0 {
        let what = "ends, and all that it deposits is to be skipped";
        return Err(Error::input(path, place, what, "skip fewer features"));
    }
    let what = format!("ends, and no move deposited anything (looked for {})", report.machine.deposition);
    Err(Error::input(path, place, what, plan::remedy(&survey.signs)))
}
