//! Reading: a file is looked through, then carried out line by line.

use super::beads::BeadAssembler;
use super::extruder::Extruder;
use super::lines::{self, LinesEnd, StreamLines};
use super::machine::MachineState;
use super::member::{self, ArchiveMember};
use super::options::GcodeOptions;
use super::plan::{self, ReadPlan};
use super::report::{FilamentSource, GcodeFinding, GcodeReport};
use super::source::{self, CountedFile, FileOrMember, TextStream};
use super::survey::FileSurvey;
use crate::error::{Error, Result};
use crate::progress::{Progress, Silent};
use crate::toolpath::{BeadSink, BeadView};
use std::io::Read;
use std::path::Path;

/// Lines between two looks at whether the user wants to stop.
const CHECK_LINES: u64 = 1 << 14;

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
    let mut survey = FileSurvey::new(options);
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
    (plan, options, survey): (&ReadPlan, &GcodeOptions, &FileSurvey),
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

fn deposits_something(path: &Path, report: &GcodeReport, survey: &FileSurvey) -> Result<()> {
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
