//! G-code: a stream of commands becomes a stream of beads.
//!
//! Dialects differ. This reader takes the side of the slicers' firmwares (Marlin and its kin), and of RS-274
//! where they are silent:
//!
//! - Words need no spaces, letters have no case, numbers have no exponent (`X1e1` is X1 and E1). The same letter
//!   twice in a command is an error. Lines that begin with coordinates repeat the last motion.
//! - G90 and G91 switch E too until the first M82 or M83; from then on only these do. There is one E position,
//!   not one a tool.
//! - G92 renames the present position; points are given in the machine's coordinates. G28 goes to 0. G53 to G59
//!   change nothing, and are reported.
//! - A move deposits if E grows on it. In files where no move has an E, M3 or M4 switch deposition on and M5 off,
//!   and rapid moves (G0) never deposit.
//! - A, B and C tilt the head, in degrees: the tool's axis is Rz(C)·Ry(B)·Rx(A)·z, and X Y Z are the tool tip in
//!   the part's frame. Machines that turn the part instead (rotary tables) are out of scope: their programs must
//!   be converted to the part's frame first.
//! - Arcs lie in the plane of G17, G18 or G19, by I J K or R, also as helices.
//!
//! A bead ends where the tool travels, or where layer, tool or feature change. A change of width or height does
//! not end it.

mod arc;
mod beads;
mod commands;
mod comments;
mod extruder;
mod lines;
mod machine;
mod motion;
mod parameters;
mod position;
mod report;
mod sizes;
mod source;
#[cfg(test)]
mod tests;
mod tilt;
mod words;

pub use report::{
    ArcReport, BlobReport, FeatureReport, FilamentSource, Finding, GcodeReport, SizeReport, SkipReport,
};

use super::BeadSink;
use crate::error::{Error, Result};
use crate::progress::{Progress, Silent};
use beads::Beads;
use comments::{Comment, Settings};
use lines::{Lines, Stop};
use machine::Machine;
use source::{CountedFile, Source};
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

/// Filament diameter where nothing tells it, in mm: what most printers take.
const FILAMENT_MM: f64 = 1.75;

/// Lines between two looks at whether the user wants to stop.
const CHECK_LINES: u64 = 1 << 14;

/// What the caller knows better than the file. Lengths in mm.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct GcodeOptions {
    /// Filament diameter of all tools; overrides the file's settings.
    pub filament_diameter: Option<f64>,
    /// Width of all beads; overrides comments and E.
    pub width: Option<f64>,
    /// Height of all beads; overrides comments and the distances of layers.
    pub height: Option<f64>,
    /// Features whose beads are left out, by the names in the file, in any case: "Skirt/Brim", "Custom",
    /// [`UNNAMED`]. They are still counted in [`GcodeReport::skipped`].
    pub skip_features: Vec<String>,
    /// How far chords may deviate from arcs; by default a hundredth of the bead's width.
    pub arc_tolerance: Option<f64>,
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
        Ok(())
    }
}

/// Reads the G-code file `path`, plain or compressed by gzip or xz, and hands its beads to `sink` in the order
/// of the file. The file is read twice, since slicers write their settings at its end; memory does not grow with
/// it.
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
    let bytes = source::open(path)?.metadata().map_err(Error::io(path, "read the size"))?.len();
    let mut passes = ["finding the slicer's settings", "reading G-code"].into_iter();
    let open = || {
        progress.phase(passes.next().unwrap_or_default(), Some(bytes), "bytes");
        Ok(CountedFile { file: source::open(path)?, progress })
    };
    read(path, open, options, progress, sink)
}

/// Reads G-code like [`read_gcode`], from a source that can be opened twice. `name` stands for it in messages.
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
    let mut survey = Survey::default();
    each_line(path, open()?, progress, |_, line| {
        survey.read(line);
        Ok(())
    })?;
    let (diameters, filament_source) = survey.filament(options);
    let mut beads = Beads::new(path, options, &survey.settings, survey.has_e, survey.has_layer_marks, sink);
    beads.report.filament_diameters = diameters.clone();
    beads.report.filament_source = filament_source;
    if filament_source == FilamentSource::Assumed {
        beads.report.note("the filament's diameter is assumed to be 1.75 mm: the file does not tell it", 0);
    }
    let mut machine = Machine::new(path, options, &survey.settings, survey.has_e, diameters, beads);
    let lines = each_line(path, open()?, progress, |number, line| {
        machine.line = number;
        machine.execute(line)
    })?;
    machine.beads.finish()?;
    let mut report = machine.beads.into_report();
    report.lines = lines;
    deposits_something(path, &report)?;
    Ok(report)
}

/// Hands every line to `take`, with its number; returns how many there are.
fn each_line<R: Read>(
    path: &Path,
    packed: R,
    progress: &dyn Progress,
    mut take: impl FnMut(u64, &[u8]) -> Result<()>,
) -> Result<u64> {
    let source = Source::new(path, packed)?;
    let action = source.action();
    let mut lines = Lines::new(source);
    let mut number = 0;
    loop {
        let line = match lines.next() {
            Ok(Some(line)) => line,
            Ok(None) => return Ok(number),
            Err(Stop::Read(source)) => return Err(Error::io(path, action)(source)),
            Err(Stop::TooLong) => {
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
    settings: Settings,
    has_e: bool,
    has_layer_marks: bool,
}

impl Survey {
    fn read(&mut self, line: &[u8]) {
        let text = line.trim_ascii_start();
        match text.first() {
            Some(b';') => {
                self.settings.read(text);
                self.has_layer_marks |= !self.has_layer_marks && comments::meaning(text) == Comment::Layer;
            }
            Some(_) if !self.has_e => self.has_e = moves_e(text),
            _ => {}
        }
    }

    fn filament(&self, options: &GcodeOptions) -> (Vec<f64>, FilamentSource) {
        let stated = &self.settings.filament_diameters;
        match options.filament_diameter {
            _ if !self.has_e => (Vec::new(), FilamentSource::None),
            Some(diameter) => (vec![diameter], FilamentSource::Option),
            None if self.settings.volumetric => (Vec::new(), FilamentSource::Volumetric),
            None if !stated.is_empty() => (stated.clone(), FilamentSource::Comment),
            None => (vec![FILAMENT_MM], FilamentSource::Assumed),
        }
    }
}

/// Whether a line is a move with an E word.
fn moves_e(line: &[u8]) -> bool {
    let mut moves = true;
    let mut words = words::Words::new(line);
    while let Some(Ok(word)) = words.next() {
        match word.letter {
            b'G' => moves = word.value.is_some_and(|code| (0.0..=3.0).contains(&code)),
            b'M' | b'T' => return false,
            b'E' if moves => return true,
            _ => {}
        }
    }
    false
}

fn deposits_something(path: &Path, report: &GcodeReport) -> Result<()> {
    let place = format!("line {}", report.lines);
    if report.beads > 0 {
        return Ok(());
    }
    if report.skipped.segments > 0 {
        let what = "ends, and all that it deposits is to be skipped";
        return Err(Error::input(path, place, what, "skip fewer features"));
    }
    let what = "ends, and no move deposited anything";
    Err(Error::input(path, place, what, "give G-code whose moves have E words, or M3 and M5 around them"))
}
