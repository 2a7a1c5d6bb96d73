//! What tells the machine that a file is for: found before its first line is carried out.

use super::INCH;
use super::deposition::{FAMILIES, MachineFamily};
use super::layer_axis::LayerAxis;
use super::regions::{self, CommentMeaning};
use super::settings::SlicerSettings;
use super::words::{Words, identifier, number};

/// Machines whose programs ORNL Slicer writes in inches, by what its header calls them.
const IN_INCHES: [&str; 8] =
    ["BEAM", "CINCINNATI", "CINCINNATI-BERTHA", "HAAS-INCH", "MELD", "ORNL", "SIEMENS", "SKYBAAM"];

/// Letters of axes that may feed or carry layers.
pub(super) const OTHER_AXES: [u8; 6] = *b"ABCUVW";

/// How the positions of an axis follow each other.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct AxisStatistics {
    last: Option<f64>,
    pub(super) rises: u64,
    pub(super) falls: u64,
    /// Farthest from 0.
    farthest: f64,
}

/// What was found.
#[derive(Default)]
pub(super) struct ScanFindings {
    /// The machine, as the header names it.
    pub(super) machine: Option<String>,
    /// The header gives sizes in inches, or in mm.
    in_inches: Option<bool>,
    /// Usual width of a bead by the header, mm.
    pub(super) width: Option<f64>,
    /// Usual height of a bead by the header, mm.
    pub(super) height: Option<f64>,
    /// Filament's diameter by the header, mm.
    filament: Option<f64>,
    /// Height of the bed by the header, mm.
    pub(super) bed: Option<f64>,
    /// Comments tell regions.
    pub(super) has_regions: bool,
    /// Comments in the manner of large machines tell layers.
    pub(super) has_layers: bool,
    /// Codes, by their places in [`CODES`].
    codes: u32,
    /// Of [`OTHER_AXES`].
    pub(super) courses: [AxisStatistics; 6],
}

/// Codes that switch deposition, one a bit.
const CODES: [&[u8]; 21] = [
    b"EXTRUDER",
    b"BEAD_AREA",
    b"EXTR_END",
    b"G441",
    b"G442",
    b"M64 P8",
    b"M64 P9",
    b"M64 P0",
    b"M65 P0",
    b"M34",
    b"M24",
    b"M35",
    b"M25",
    b"M100",
    b"M101",
    b"M103",
    b"M3",
    b"M4",
    b"M5",
    b"M52",
    b"M53",
];

impl ScanFindings {
    /// Takes in a line without spaces at its front.
    pub(super) fn read(&mut self, text: &[u8]) {
        if memchr::memchr2(b'(', b';', text).is_some() {
            for (comment, in_parentheses) in regions::comments(text) {
                self.comment(comment, in_parentheses);
            }
        }
        match text.first() {
            None | Some(b';' | b'(') => {}
            Some(b'N' | b'n' | b'M' | b'm' | b'E' | b'e' | b'B' | b'b' | b'W' | b'w') => self.code(text),
            _ => {}
        }
        if text.iter().any(|b| matches!(b | 0x20, b'u'..=b'w' | b'a'..=b'c')) || may_switch(text) {
            self.words(text);
        }
    }

    fn comment(&mut self, comment: &[u8], in_parentheses: bool) {
        match regions::meaning(comment, in_parentheses) {
            Some(CommentMeaning::Layer) => self.has_layers = true,
            Some(CommentMeaning::Deposit(..)) => self.has_regions = true,
            Some(CommentMeaning::Travel) => {}
            None => self.header(comment.trim_ascii()),
        }
    }

    /// A line of ORNL Slicer's header.
    fn header(&mut self, text: &[u8]) {
        let after = |key: &[u8]| text.strip_prefix(key).map(<[u8]>::trim_ascii);
        if let Some(name) = after(b"G-Code Syntax:") {
            let name = String::from_utf8_lossy(&name[..name.len().min(100)]).into_owned();
            self.machine = Some(name).filter(|name| !name.is_empty());
        } else if let Some((height, inches)) = after(b"Layer Height:").and_then(length) {
            self.height = size(height);
            self.in_inches = Some(inches);
        } else if let Some((width, _)) = after(b"Default Extrusion Width:").and_then(length) {
            self.width = size(width);
        } else if let Some((diameter, _)) = after(b"Filament Diameter:").and_then(length) {
            self.filament = size(diameter);
        } else if let Some((bed, _)) = after(b"Printer Base Offset:").and_then(length) {
            self.bed = (bed.abs() <= super::SIZE_MAX).then_some(bed);
        }
    }

    /// A line that may begin with a command's name, behind its number.
    fn code(&mut self, text: &[u8]) {
        let mut rest = text;
        if matches!(text[0], b'N' | b'n')
            && let Some(found) = number(&text[1..])
        {
            rest = text[1 + found.length..].trim_ascii_start();
        }
        let name = identifier(rest);
        if name.eq_ignore_ascii_case(b"WHEN") {
            self.see(b"EXTR_END");
        } else if name.len() > 1 && !name[1].is_ascii_digit() {
            self.see(&name.to_ascii_uppercase());
        } else {
            self.words(rest);
        }
    }

    /// Looks at the words of a line: codes that switch, and where the further axes go.
    fn words(&mut self, text: &[u8]) {
        let mut words = Words::new(text);
        let mut switch = None;
        // A line that begins with a coordinate goes on with the motion before.
        let mut moves = text.first().is_some_and(|first| !matches!(first | 0x20, b'g' | b'm' | b't'));
        while let Some(Ok(word)) = words.next() {
            let Some(value) = word.value else { continue };
            match word.letter {
                b'G' => {
                    // G90 and others may stand on a line that moves.
                    moves |= (0.0..=3.0).contains(&value);
                    moves &= !matches!(value as i64, 4 | 10 | 28 | 29 | 30 | 92);
                    if matches!(value as i64, 441 | 442) {
                        self.see(format!("G{value}").as_bytes());
                    }
                }
                b'M' => {
                    switch = matches!(value, 64.0 | 65.0).then_some(value);
                    if matches!(value as i64, 3..=5 | 24 | 25 | 34 | 35 | 52 | 53 | 100..=103) {
                        self.see(format!("M{value}").as_bytes());
                    }
                }
                b'P' => {
                    if let Some(code) = switch {
                        self.see(format!("M{code} P{value}").as_bytes());
                    }
                }
                letter if moves => {
                    if let Some(axis) = OTHER_AXES.iter().position(|other| *other == letter) {
                        self.courses[axis].go(value);
                    }
                }
                _ => {}
            }
        }
    }

    fn see(&mut self, code: &[u8]) {
        if let Some(bit) = CODES.iter().position(|known| *known == code) {
            self.codes |= 1 << bit;
        }
    }

    fn has(&self, code: &str) -> bool {
        CODES.iter().position(|known| *known == code.as_bytes()).is_some_and(|bit| self.codes >> bit & 1 == 1)
    }

    /// What switches deposition, where nothing feeds it; and what else might.
    pub(super) fn family(&self) -> (Option<MachineFamily>, Option<MachineFamily>) {
        let is_seen = |family: &MachineFamily| {
            let (on, off) = family.codes();
            let switches_on = on.iter().any(|code| self.has(code));
            match family {
                MachineFamily::Siemens | MachineFamily::Ingersoll | MachineFamily::Spindle => switches_on,
                // With a spindle that stops they are something else's.
                MachineFamily::Gun => switches_on && self.has("M53") && !self.has("M5"),
                // M24 alone stands in files of printers.
                _ => switches_on && off.iter().any(|code| *code != "M5" && self.has(code)),
            }
        };
        let mut seen = FAMILIES.into_iter().filter(is_seen);
        (seen.next(), seen.next())
    }

    /// mm in the file's unit, where the header tells it.
    pub(super) fn unit(&self) -> Option<f64> {
        let by_name = self.machine.as_ref().map(|name| IN_INCHES.contains(&&*name.to_ascii_uppercase()));
        self.in_inches.or(by_name).map(|inches| if inches { INCH } else { 1.0 })
    }

    /// The axis that carries layers, where the file tells it. Whether W does is seen when it is carried out.
    pub(super) fn layer_axis(&self) -> Option<LayerAxis> {
        if self.machine.as_ref().is_some_and(|name| name.eq_ignore_ascii_case("MVP")) {
            return Some(LayerAxis::new(b'Z', true));
        }
        let course = self.courses[5];
        (course.rises + course.falls > 0).then_some(LayerAxis::new(b'W', true))
    }

    /// Axes that only rise, move by move: an extruder's may be called so.
    pub(super) fn rising_axes(&self) -> Vec<char> {
        let axes = OTHER_AXES.into_iter().zip(self.courses);
        axes.filter(|(_, course)| course.rises > 1 && course.falls * 20 < course.rises)
            .map(|(letter, _)| char::from(letter))
            .collect()
    }

    /// Turning axes that go farther than heads turn, with how far.
    pub(super) fn wide_turns(&self) -> impl Iterator<Item = (u8, f64)> {
        // A head may turn about the vertical again and again.
        let limits = [720.0, 720.0, 3600.0];
        let axes = OTHER_AXES.into_iter().zip(self.courses).zip(limits);
        axes.filter(|((_, course), limit)| course.farthest > *limit)
            .map(|((axis, course), _)| (axis, course.farthest))
    }

    /// Gives the settings what the header tells and nothing else does.
    pub(super) fn complete(&self, settings: &mut SlicerSettings) {
        settings.layer_height = settings.layer_height.or(self.height);
        settings.line_width = settings.line_width.or(self.width);
        if settings.filament_diameters.is_empty() {
            settings.filament_diameters.extend(self.filament);
        }
    }
}

impl AxisStatistics {
    fn go(&mut self, to: f64) {
        // Axes begin at 0.
        let last = self.last.replace(to).unwrap_or(0.0);
        self.rises += u64::from(to > last);
        self.falls += u64::from(to < last);
        self.farthest = self.farthest.max(to.abs());
    }
}

/// Whether a line that begins with a G code may have a code of [`CODES`].
fn may_switch(text: &[u8]) -> bool {
    matches!(text.first(), Some(b'G' | b'g'))
        && (text[1..].starts_with(b"44") || memchr::memchr2(b'M', b'm', text).is_some())
}

/// A length with its unit, in mm, and whether it is in inches: `0.2in`, `5.08mm`.
fn length(text: &[u8]) -> Option<(f64, bool)> {
    let found = number(text)?;
    match text[found.length..].trim_ascii() {
        b"in" => Some((found.value * INCH, true)),
        b"mm" => Some((found.value, false)),
        _ => None,
    }
}

fn size(length: f64) -> Option<f64> {
    (length > 0.0 && length <= super::SIZE_MAX).then_some(length)
}
