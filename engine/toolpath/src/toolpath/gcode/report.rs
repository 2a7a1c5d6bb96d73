//! What reading a G-code file found, assumed and left out.

use super::firmware::Firmware;
use serde::Serialize;

/// Most different things that a report lists; what comes after them is only counted.
const LISTED_MAX: usize = 1000;

/// Most unknown commands that a warning names.
const SHOWN_MAX: usize = 8;

/// Findings of a whole file. Lengths in mm, volumes in mm³.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct GcodeReport {
    /// Lines of the file.
    pub lines: u64,
    /// Commands that move the tool from one place to another, depositing or not.
    pub moves: u64,
    /// Beads handed over.
    pub beads: u64,
    /// Straight pieces of all beads; an arc counts with each of its chords.
    pub segments: u64,
    /// Layers: by the slicer's comments if there are any, else by the heights at which beads lie.
    pub layers: u32,
    /// Numbers of the tools that deposit, ascending.
    pub tools: Vec<u16>,
    /// Kinds of deposition by the slicer's names; [`super::super::Attributes::feature`] is an index into them.
    pub features: Vec<FeatureReport>,
    /// Firmware whose rules were followed.
    pub firmware: Firmware,
    /// Where the firmware comes from.
    pub firmware_source: FirmwareSource,
    /// The words of the file that name the firmware.
    pub firmware_named_by: Option<String>,
    /// Slicer and version, as the file has them.
    pub slicer: Option<String>,
    /// What the slicer's settings say of the whole file.
    pub settings: SettingsReport,
    /// Smallest and largest coordinates of the tool tip where it deposits.
    pub bounds: Option<[[f64; 3]; 2]>,
    /// Names of the meshes that the file says it prints.
    pub meshes: Vec<String>,
    /// Length of all segments.
    pub length: f64,
    /// Material fed while beads were deposited; `None` if the file has no E. Primes and blobs are not in it.
    pub fed_volume: Option<f64>,
    /// Area times length over all segments, with a stadium as the cross-section: overlaps count twice, ends
    /// and joints not at all.
    pub bead_volume: f64,
    /// Filament diameter of each tool, in mm; empty if E counts volume or the file has no E.
    pub filament_diameters: Vec<f64>,
    /// Where the filament diameter comes from.
    pub filament_source: FilamentSource,
    /// Where the widths come from.
    pub widths: SizeReport,
    /// Where the heights come from.
    pub heights: SizeReport,
    /// Arcs and what became of them.
    pub arcs: ArcReport,
    /// E without motion beyond what was retracted before: material in one place, which makes no bead.
    pub blobs: BlobReport,
    /// Those of the blobs that come before the first bead or after a change of tool: slicers purge the nozzle so.
    pub purges: BlobReport,
    /// E that made up for what was retracted before, in moves that deposit too or that do not make up for all of it.
    pub made_up: BlobReport,
    /// Retractions, by E or by the firmware.
    pub retractions: u64,
    /// Deposition commands that end where they begin.
    pub zero_length: u64,
    /// Steps shorter than [`super::MERGE_MM`] that were joined to the next one.
    pub merged: u64,
    /// What was left out because its feature was to be.
    pub skipped: SkipReport,
    /// What the file was taken for.
    pub machine: MachineReport,
    /// Commands and words that the reader does not know, each once.
    pub unknown: Vec<GcodeFinding>,
    /// Assumptions, approximations and oddities, each kind once.
    pub notes: Vec<GcodeFinding>,
}

/// What a file was taken for.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct MachineReport {
    /// The machine or its control, as the header names it or codes tell.
    pub dialect: Option<String>,
    /// What deposits: an axis, as in "E", or codes, as in "M3, M4 to M5".
    pub deposition: String,
    /// How the height of the tool over the part comes about: "Z", "Z - W".
    pub height: String,
    /// mm in the unit of the first deposit.
    pub unit_mm: Option<f64>,
    /// Who told the unit.
    pub unit_source: UnitSource,
    /// Tool length offsets (G43) are selected; they are taken for zero.
    pub tool_lengths: bool,
}

/// Who tells the unit of a file.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum UnitSource {
    /// Nobody: mm.
    #[default]
    Assumed,
    /// G20, G21 or their like.
    Code,
    /// The header's sizes, or its machine.
    Header,
    /// The caller.
    Option,
}

impl MachineReport {
    /// What was taken for granted, for people.
    pub fn text(&self) -> String {
        let unit = match self.unit_mm {
            Some(1.0) => "mm".to_owned(),
            Some(super::INCH) => "inches".to_owned(),
            Some(mm) => format!("units of {mm} mm"),
            None => "no unit".to_owned(),
        };
        let source = match self.unit_source {
            UnitSource::Assumed => " assumed",
            UnitSource::Code => "",
            UnitSource::Header => " by the header",
            UnitSource::Option => " by `unit`",
        };
        let dialect = self.dialect.as_ref().map(|name| format!("{name}; ")).unwrap_or_default();
        let lengths = if self.tool_lengths { "; tool length offsets taken for zero" } else { "" };
        let MachineReport { deposition, height, .. } = self;
        format!("{dialect}deposition by {deposition}, height {height}, {unit}{source}{lengths}")
    }
}

/// One kind of deposition.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct FeatureReport {
    /// The slicer's name, or [`super::UNNAMED`].
    pub name: String,
    /// Beads.
    pub beads: u64,
    /// Segments.
    pub segments: u64,
    /// Length of the segments.
    pub length: f64,
    /// Material fed; 0 if the file has no E.
    pub fed: f64,
    /// Area times length, as in [`GcodeReport::bead_volume`].
    pub volume: f64,
    /// Beads left out on request; none of the numbers above counts them.
    pub skipped: u64,
}

/// Where the firmware comes from.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum FirmwareSource {
    /// The caller's option.
    Option,
    /// Named in the file.
    File,
    /// Not named.
    #[default]
    Assumed,
}

/// What the slicer's settings say of a whole file, in mm.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct SettingsReport {
    /// Usual layer height.
    pub layer_height: Option<f64>,
    /// Height of the first layer.
    pub first_layer_height: Option<f64>,
    /// Usual width of beads.
    pub line_width: Option<f64>,
    /// Diameter of the first nozzle.
    pub nozzle_diameter: Option<f64>,
}

/// Where the filament diameter comes from.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum FilamentSource {
    /// Not needed: nothing is fed by E.
    #[default]
    None,
    /// The caller's option.
    Option,
    /// The slicer's settings in the file.
    Comment,
    /// What most printers take, for want of anything better.
    Assumed,
    /// Not needed: E counts mm³.
    Volumetric,
}

/// How many segments got their size from where, and what sizes there are.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct SizeReport {
    /// From the caller's option.
    pub option: u64,
    /// From a comment before the segment.
    pub comment: u64,
    /// Widths: from the material fed.
    pub extrusion: u64,
    /// Heights: from the next lower beads, or the bed.
    pub step: u64,
    /// Heights of beads that do not lie flat, and widths of beads that no E feeds: the slicer's setting. Heights also
    /// from the flat bead before.
    pub setting: u64,
    /// Smallest and largest, in mm.
    pub range: Option<(f64, f64)>,
}

/// Arcs and what became of them.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct ArcReport {
    /// Arcs, depositing or not.
    pub count: u64,
    /// Chords that they became.
    pub chords: u64,
    /// Largest deviation that was allowed, in mm.
    pub tolerance: f64,
    /// By how much the chords of depositing arcs are shorter than the arcs.
    pub length_lost: f64,
}

/// Material in one place.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct BlobReport {
    /// How often.
    pub count: u64,
    /// How much.
    pub volume: f64,
}

/// What was left out.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct SkipReport {
    /// Beads.
    pub beads: u64,
    /// Segments.
    pub segments: u64,
    /// Their length.
    pub length: f64,
    /// Material fed.
    pub fed: f64,
}

/// Something found at one line or more.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct GcodeFinding {
    /// What.
    pub what: String,
    /// The first line.
    pub line: u64,
    /// On how many occasions.
    pub count: u64,
}

impl GcodeReport {
    /// What a user should know, one line each.
    pub fn warnings(&self) -> Vec<String> {
        let places = |found: &GcodeFinding| match (found.line, found.count) {
            (0, _) => String::new(),
            (line, 1) => format!(" (line {line})"),
            (line, count) => format!(" (line {line} and {} more)", count - 1),
        };
        let notes = self.notes.iter().map(|f| format!("{}{}", f.what, places(f)));
        let mut lines: Vec<String> = notes.collect();
        if !self.unknown.is_empty() {
            let unknown: Vec<String> =
                self.unknown.iter().take(SHOWN_MAX).map(|f| format!("{}{}", f.what, places(f))).collect();
            let more = match self.unknown.len().saturating_sub(SHOWN_MAX) {
                0 => String::new(),
                more => format!(", and {more} others"),
            };
            lines.push(format!("left out, since not known: {}{more}", unknown.join(", ")));
        }
        if self.arcs.length_lost > 0.0 {
            let ArcReport { count, chords, tolerance, length_lost } = &self.arcs;
            lines.push(format!(
                "{count} arcs became {chords} chords within {tolerance:.4} mm; beads are {length_lost:.3} mm shorter"
            ));
        }
        let count = self.blobs.count - self.purges.count;
        if count > 0 {
            let volume = self.blobs.volume - self.purges.volume;
            lines.push(format!("{count} blobs (E without motion), {volume:.3} mm³, make no bead"));
        }
        if self.made_up.count > 0 {
            let BlobReport { count, volume } = &self.made_up;
            lines.push(format!(
                "{volume:.3} mm³ of what is fed in {count} moves make up for what was retracted before, and deposit nothing"
            ));
        }
        if self.skipped.segments > 0 {
            let SkipReport { beads, fed, .. } = &self.skipped;
            lines.push(format!("{beads} beads, {fed:.3} mm³ fed, are left out with their features"));
        }
        lines
    }

    /// Widens the bounds.
    pub(super) fn include(&mut self, points: &[[f64; 3]]) {
        for point in points {
            let [low, high] = self.bounds.get_or_insert([*point; 2]);
            for axis in 0..3 {
                low[axis] = low[axis].min(point[axis]);
                high[axis] = high[axis].max(point[axis]);
            }
        }
    }

    /// Counts an assumption, an approximation or an oddity; line 0 stands for the whole file.
    pub(super) fn note(&mut self, what: &str, line: u64) {
        count(&mut self.notes, what, line);
    }

    /// Counts a number with an exponent, or one that could have one: each is told by the first of its kind.
    pub(super) fn exponent(&mut self, what: String, line: u64) {
        let same =
            |found: &&mut GcodeFinding| found.what.contains("exponent") && found.what.starts_with(&what[..1]);
        match self.notes.iter_mut().find(same) {
            Some(found) => found.count += 1,
            None => self.note(&what, line),
        }
    }

    /// Counts an unknown command or word.
    pub(super) fn unknown(&mut self, what: &[u8], line: u64) {
        count(&mut self.unknown, &super::words::quote(what), line);
    }
}

fn count(list: &mut Vec<GcodeFinding>, what: &str, line: u64) {
    let listed = list.len();
    match list.iter_mut().find(|found| found.what == what) {
        Some(found) => found.count += 1,
        None if listed < LISTED_MAX => list.push(GcodeFinding { what: what.to_owned(), line, count: 1 }),
        None if listed == LISTED_MAX => list.push(GcodeFinding { what: "more".to_owned(), line, count: 1 }),
        None => list[LISTED_MAX].count += 1,
    }
}

impl SizeReport {
    /// Widens the range.
    pub(super) fn include(&mut self, size: f64) {
        let (low, high) = self.range.unwrap_or((size, size));
        self.range = Some((low.min(size), high.max(size)));
    }
}
