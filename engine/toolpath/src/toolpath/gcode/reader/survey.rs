//! A first look at a file: what must be known before its first line is carried out.

use super::comments::{self, Comment};
use super::file_scan::ScanFindings;
use super::firmware::Firmware;
use super::options::{ExtruderAxis, GcodeOptions};
use super::report::{FilamentSource, FirmwareSource, GcodeReport, SettingsReport};
use super::settings::SlicerSettings;
use super::words;

/// What must be known of a file before its first line is carried out.
#[derive(Default)]
pub(super) struct FileSurvey {
    pub(super) settings: SlicerSettings,
    pub(super) has_e: bool,
    pub(super) has_layer_marks: bool,
    pub(super) signs: ScanFindings,
    pub(super) extruder_letter: u8,
}

impl FileSurvey {
    pub(super) fn new(options: &GcodeOptions) -> FileSurvey {
        let extruder_letter = options.extruder_axis.map_or(b'E', ExtruderAxis::letter);
        FileSurvey { extruder_letter, ..FileSurvey::default() }
    }

    pub(super) fn read(&mut self, line: &[u8]) {
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

    pub(super) fn firmware(&self, options: &GcodeOptions) -> (Firmware, FirmwareSource) {
        let named = self.settings.firmware();
        match (options.firmware, named) {
            (Some(firmware), _) => (firmware, FirmwareSource::Option),
            (None, Some((firmware, _))) => (firmware, FirmwareSource::File),
            (None, None) => (Firmware::Unnamed, FirmwareSource::Assumed),
        }
    }

    /// Writes down what the file says of itself.
    pub(super) fn describe(&self, source: FirmwareSource, report: &mut GcodeReport) {
        let SlicerSettings { layer_height, first_layer_height, line_width, nozzle_diameter, .. } =
            self.settings;
        report.firmware_source = source;
        report.firmware_named_by = self.settings.firmware().map(|(_, by)| by.to_owned());
        report.slicer = self.settings.slicer.clone();
        report.settings = SettingsReport { layer_height, first_layer_height, line_width, nozzle_diameter };
    }

    /// Diameters by tool; they do not matter where E counts volume.
    pub(super) fn filament(&self, options: &GcodeOptions, firmware: Firmware) -> (Vec<f64>, FilamentSource) {
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
