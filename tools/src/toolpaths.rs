//! How toolpaths are read and swept, as people type it, and what of it they must be told.

use crate::args::BeadsArg;
use crate::failure::Failure;
use crate::options::with_options;
use crate::output::one_line;
use crate::units::{Length, Unit};
use brickfield_engine::bead::{Joints, ProfileShape, Sweep, SweepOptions, read_outline};
use brickfield_engine::ingest::{Input, OpenOptions};
use brickfield_engine::solid::Outline;
use brickfield_engine::toolpath::gcode::{
    DepositionCode, ExtruderAxis, FeatureReport, FilamentSource, Firmware, FirmwareSource, GcodeOptions,
    GcodeReport, LayerAxis, SettingsReport, SizeReport, is_auxiliary,
};
use brickfield_engine::toolpath::{LayerFill, LayerFills};
use clap::Args;
use serde::Serialize;
use std::convert::Infallible;
use std::path::{Path, PathBuf};
use std::str::FromStr;

/// Part by which the material fed and the beads may differ before the user hears of it. Slicers' own files
/// agree within half a per cent; a filament diameter of 2.85 instead of 1.75 mm is off by 165 %.
const FED_TOLERANCE: f64 = 0.05;
/// Lines at most about layers that are too empty or too full.
const FILL_LINES_MAX: usize = 5;

/// What every command takes that reads toolpaths.
#[derive(Args, Clone, Debug)]
#[command(next_help_heading = "Toolpaths")]
pub struct ToolpathArgs {
    /// Cross-section of beads: stadium, ellipse, rectangle, or a file of its corners, lines `across,up` in
    /// units of the bead's width and height, from -0.5 to 0.5
    #[arg(long, alias = "section", value_name = "SHAPE|FILE", default_value = "stadium")]
    pub bead_section: SectionArg,
    /// Sides of a round cross-section: an even number from 6 to 256
    #[arg(long, value_name = "N", default_value_t = SweepOptions::default().sides)]
    pub sides: usize,
    /// Sharper bends, in degrees from 0 to 120, get a round joint instead of a mitre
    #[arg(long, value_name = "ANGLE", default_value_t = SweepOptions::default().bend)]
    pub bend: f64,
    /// Width of all beads, as in 0.6mm, instead of what the file says or E gives
    #[arg(long, value_name = "LENGTH")]
    pub width: Option<Length>,
    /// Height of all beads, instead of what the file says or its layers give
    #[arg(long, value_name = "LENGTH")]
    pub height: Option<Length>,
    /// Diameter of the filament, instead of what the file says
    #[arg(long, value_name = "LENGTH")]
    pub filament: Option<Length>,
    /// Firmware whose rules count, as in klipper, instead of what the file names: for E after G91, turns of arcs, and
    /// M200
    #[arg(long, value_name = "NAME", value_parser = firmware)]
    pub firmware: Option<Firmware>,
    /// Axis that carries layers beside Z: W, U, A ... or -W, -U ..., -Z, none [default: as the file shows]
    ///
    /// The position of W is added to Z, that of -W taken off, as of a table that goes down. -Z is for a Z that points down, none
    /// if Z alone counts.
    #[arg(long, value_name = "AXIS", allow_hyphen_values = true)]
    pub layer_axis: Option<LayerAxis>,
    /// Axis that feeds, in the place of E: A, B, C, U, V or W
    #[arg(long, value_name = "AXIS")]
    pub extruder_axis: Option<ExtruderAxis>,
    /// Code that switches deposition on, as in M101, "M64 P8" or EXTRUDER, in the place of E, of M3 and of the codes of
    /// known machines; may be repeated. A command with an argument, as in EXTRUDER(120), switches off by 0
    #[arg(long, value_name = "CODE")]
    pub deposit_on: Vec<DepositionCode>,
    /// Code that switches deposition off; may be repeated
    #[arg(long, value_name = "CODE")]
    pub deposit_off: Vec<DepositionCode>,
    /// Value of a variable that the program uses and the machine knows, as in '#200=0'; may be repeated
    #[arg(long, value_name = "NAME=NUMBER", value_parser = variable)]
    pub variable: Vec<(String, f64)>,
    /// Plate whose toolpath is read, of an archive .gcode.3mf of several
    #[arg(long, value_name = "N")]
    pub plate: Option<u32>,
    /// Leave out the beads of a feature by its name in the file, as in "Support material", or with `auto` skirt, brim, prime
    /// and wipe towers by whatever name; may be repeated. `info` of a toolpath lists its features
    #[arg(long, value_name = "FEATURE|auto")]
    pub skip: Vec<String>,
}

fn firmware(name: &str) -> Result<Firmware, String> {
    Firmware::by_name(name).ok_or_else(|| format!("it is none of {}", Firmware::names().join(", ")))
}

fn variable(text: &str) -> Result<(String, f64), String> {
    let value = |text: &str| text.trim().parse().ok().filter(|value: &f64| value.is_finite());
    let parts = text.split_once('=').and_then(|(name, number)| Some((name.trim(), value(number)?)));
    match parts {
        Some((name, value)) if !name.is_empty() => Ok((name.to_owned(), value)),
        _ => Err("give a name and a number, as in '#200=0'".to_owned()),
    }
}

/// Whether a name of `--skip` stands for all that is beside the part.
fn is_auto(name: &str) -> bool {
    name.eq_ignore_ascii_case("auto")
}

/// A cross-section by name, or the file of one.
#[derive(Clone, Debug)]
pub enum SectionArg {
    Named(ProfileShape),
    File(PathBuf),
}

impl FromStr for SectionArg {
    type Err = Infallible;

    fn from_str(text: &str) -> Result<SectionArg, Infallible> {
        Ok(match text {
            "stadium" => SectionArg::Named(ProfileShape::Stadium),
            "ellipse" => SectionArg::Named(ProfileShape::Ellipse),
            "rectangle" => SectionArg::Named(ProfileShape::Rectangle),
            path => SectionArg::File(path.into()),
        })
    }
}

impl ToolpathArgs {
    /// What the engine takes. Bare numbers are millimetres, as toolpaths are. `units` are those of programs that do not
    /// tell theirs, where the user does.
    ///
    /// # Errors
    /// If the cross-section's file cannot be read or is no simple polygon, or a number is out of range.
    pub fn options(&self, units: Option<Unit>) -> Result<OpenOptions, Failure> {
        let shape = match &self.bead_section {
            SectionArg::Named(shape) => shape.clone(),
            SectionArg::File(path) => read_outline(path)?,
        };
        let mm = |length: Option<Length>| length.map(|length| length.in_unit(Unit::Mm));
        let gcode = GcodeOptions {
            firmware: self.firmware,
            filament_diameter: mm(self.filament),
            width: mm(self.width),
            height: mm(self.height),
            skip_features: self.skipped_by_name().cloned().collect(),
            skip_auxiliary: self.skip.iter().any(|name| is_auto(name)),
            unit: units.map(Unit::millimetres),
            layer_axis: self.layer_axis,
            extruder_axis: self.extruder_axis,
            deposit_on: self.deposit_on.clone(),
            deposit_off: self.deposit_off.clone(),
            variables: self.variable.clone(),
            plate: self.plate,
            ..GcodeOptions::default()
        };
        let sweep = SweepOptions { shape, sides: self.sides, bend: self.bend };
        Sweep::new(&sweep).map_err(|error| Failure::Usage(error.to_string()))?;
        Ok(OpenOptions { gcode, sweep })
    }
}

impl ToolpathArgs {
    /// The features left out by their names.
    fn skipped_by_name(&self) -> impl Iterator<Item = &String> {
        self.skip.iter().filter(|name| !is_auto(name))
    }

    /// Checks that every feature that is to be left out is one of a file.
    ///
    /// # Errors
    /// A name that none has, with those that there are.
    pub fn require_features<'a>(
        &self,
        files: impl IntoIterator<Item = (&'a Path, &'a GcodeReport)>,
    ) -> Result<(), Failure> {
        let files: Vec<(&Path, &GcodeReport)> = files.into_iter().collect();
        let features = || files.iter().flat_map(|(_, report)| &report.features);
        let is_known = |name: &String| {
            let lower = name.to_lowercase();
            features().any(|feature| feature.name.to_lowercase() == lower)
        };
        let Some(unknown) = self.skipped_by_name().find(|name| !is_known(name)) else { return Ok(()) };
        let mut names: Vec<String> = features()
            .filter(|feature| feature.beads + feature.skipped > 0)
            .map(|feature| format!("\"{}\"", feature.name))
            .collect();
        names.sort_unstable();
        names.dedup();
        let path = files.first().map_or_else(String::new, |(path, _)| format!("{}: ", path.display()));
        let there = match names.is_empty() {
            true => "there is no toolpath among the inputs".to_owned(),
            false => format!("its features are {}", names.join(", ")),
        };
        Err(anyhow::anyhow!("{path}--skip \"{unknown}\": there is no such feature; {there}").into())
    }

    /// What decides the beads, by name: a build goes on only with what the same settings left.
    pub fn settings(&self, options: &OpenOptions) -> Vec<(String, String)> {
        let ToolpathArgs { sides, bend, width, height, filament, firmware, skip, variable, .. } = self;
        let ToolpathArgs { layer_axis, extruder_axis, deposit_on, deposit_off, .. } = self;
        let mm = |length: &Option<Length>| {
            length.map_or("that of the file".to_owned(), |length| format!("{} mm", length.in_unit(Unit::Mm)))
        };
        let of_file = || "that of the file".to_owned();
        let list = |marks: &[DepositionCode]| {
            marks.iter().map(DepositionCode::to_string).collect::<Vec<String>>().join(", ")
        };
        let named = [
            ("cross-section", format!("{:?}", options.sweep.shape)),
            ("number of sides", sides.to_string()),
            ("sharpest mitre", bend.to_string()),
            ("width of beads", mm(width)),
            ("height of beads", mm(height)),
            ("diameter of the filament", mm(filament)),
            ("firmware", firmware.map_or("that of the file", Firmware::name).to_owned()),
            ("list of features left out", format!("{skip:?}")),
            ("unit of the program", options.gcode.unit.map_or(of_file(), |unit| format!("{unit} mm"))),
            ("axis of layers", layer_axis.map_or(of_file(), |axis| axis.to_string())),
            ("axis that feeds", extruder_axis.map_or(of_file(), |axis| axis.to_string())),
            ("codes that deposit", list(deposit_on)),
            ("codes that end deposition", list(deposit_off)),
            ("variables", format!("{variable:?}")),
            ("plate", options.gcode.plate.map_or(of_file(), |plate| plate.to_string())),
        ];
        named.into_iter().map(|(name, value)| (name.to_owned(), value)).collect()
    }
}

/// The cross-section of beads as solids, or `None` where they become triangles. The text says why, where the
/// user might have expected solids.
///
/// # Errors
/// If solids were asked for and cannot be made.
pub fn solids(
    asked: Option<BeadsArg>,
    shape: &ProfileShape,
    inputs: &[Input],
) -> Result<(Option<Outline>, Option<&'static str>), Failure> {
    let toolpaths = inputs.iter().filter(|input| input.beads().is_some()).count();
    let outline = match shape {
        ProfileShape::Stadium => Ok(Outline::Stadium),
        ProfileShape::Ellipse => Ok(Outline::Ellipse),
        ProfileShape::Rectangle | ProfileShape::Outline(_) => {
            Err("only stadium and ellipse sections have solids")
        }
    };
    let possible = match outline {
        Ok(_) if toolpaths < inputs.len() => Err("there are meshes among the inputs"),
        outline => outline,
    };
    match (asked, possible) {
        (Some(BeadsArg::Mesh), _) => Ok((None, None)),
        (Some(BeadsArg::Analytic), Err(why)) => {
            Err(Failure::Usage(format!("--beads-as analytic: {why}; use --beads-as mesh")))
        }
        (_, Ok(outline)) => Ok((Some(outline), None)),
        (None, Err(why)) => Ok((None, Some(why).filter(|_| toolpaths > 0))),
    }
}

/// One toolpath, for summaries. Volumes in mm³.
#[derive(Serialize)]
pub struct ToolpathReport {
    path: String,
    /// Material that E says was fed; null if the file has no E.
    pub fed_volume: Option<f64>,
    /// Area of the section times length, over all beads.
    pub bead_volume: f64,
    /// Layers with too little or too much material for their room.
    fill: Vec<LayerFill>,
    #[serde(flatten)]
    details: GcodeReport,
}

impl ToolpathReport {
    /// Of one input; `bead_volume` as the chosen section gives it.
    pub fn new(path: String, bead_volume: f64, mut details: GcodeReport) -> ToolpathReport {
        details.notes.iter_mut().for_each(|found| found.what = with_options(&found.what));
        // Told by this struct, with the section that was asked for.
        details.bead_volume = bead_volume;
        ToolpathReport { path, fed_volume: details.fed_volume, bead_volume, fill: Vec::new(), details }
    }

    /// With what its layers have, once all beads are known.
    pub fn with_fill(mut self, fills: LayerFills) -> ToolpathReport {
        let names: Vec<String> = self.details.features.iter().map(|feature| feature.name.clone()).collect();
        self.fill = fills.finish(&names);
        self
    }

    /// All that reading found.
    pub fn details(&self) -> &GcodeReport {
        &self.details
    }

    /// Of all toolpaths among the inputs.
    pub fn of_inputs(inputs: &[Input]) -> Vec<ToolpathReport> {
        let report = |input: &Input| {
            let beads = input.beads()?;
            let path = input.path().display().to_string();
            let (toolpath, mut fills, mut sections) =
                (beads.swept.toolpath(), LayerFills::default(), Vec::new());
            (0..toolpath.len()).for_each(|bead| fills.push(&toolpath.view(bead, &mut sections)));
            let report = ToolpathReport::new(path, beads.swept.bead_volume(), beads.report.clone());
            Some(report.with_fill(fills))
        };
        inputs.iter().filter_map(report).collect()
    }

    /// What a user should know.
    pub fn warnings(&self) -> Vec<String> {
        let mut lines = self.details.warnings();
        let fed = self.fed_volume.filter(|fed| *fed > 0.0);
        if let Some(fed) = fed
            && ((self.bead_volume / fed) - 1.0).abs() > FED_TOLERANCE
        {
            let off = (self.bead_volume / fed - 1.0) * 100.0;
            lines.push(format!(
                "beads have {off:+.1} % of volume against what E feeds; check --filament{}, --width, --height \
                 and --bead-section",
                self.filament(" (now ", ")")
            ));
        }
        lines.extend(fill_texts(&self.fill));
        lines.into_iter().map(|line| format!("{}: {line}", self.path)).collect()
    }

    /// The diameters in use, between these words; nothing if there are none.
    fn filament(&self, before: &str, after: &str) -> String {
        let mut diameters: Vec<String> =
            self.details.filament_diameters.iter().map(|d| format!("{d} mm")).collect();
        diameters.dedup();
        if diameters.is_empty() { String::new() } else { format!("{before}{}{after}", diameters.join(", ")) }
    }

    /// Volume fed and volume of beads, for people.
    pub fn text(&self) -> String {
        let GcodeReport { beads, layers, segments, .. } = &self.details;
        let counts = format!("{beads} beads, {segments} segments, {layers} layers");
        let firmware = self.firmware_text();
        let fed = self.fed_text();
        let machine = one_line(&with_options(&self.details.machine.text()));
        format!(
            "{}: {counts}; {fed}, {:.3} mm³ of beads; firmware {firmware}; {machine}",
            self.path, self.bead_volume
        )
    }

    /// What is deposited beside the part, and what of it was left out; nothing if there is none.
    pub fn beside_text(&self) -> Option<String> {
        let is_beside = |feature: &&FeatureReport| is_auxiliary(&feature.name);
        let (mut kept, mut left_out) = (Vec::new(), Vec::new());
        for feature in self.details.features.iter().filter(is_beside) {
            let FeatureReport { name, beads, volume, skipped, .. } = feature;
            if *beads > 0 {
                kept.push(format!("{} ({beads} beads, {volume:.3} mm³)", one_line(name)));
            }
            if *skipped > 0 {
                left_out.push(format!("{} ({skipped} beads)", one_line(name)));
            }
        }
        let kept = match kept.is_empty() {
            true => None,
            false => Some(format!("{} counted with the part; --skip auto leaves out", kept.join(", "))),
        };
        let left_out = (!left_out.is_empty()).then(|| format!("{} left out", left_out.join(", ")));
        let told: Vec<String> = kept.into_iter().chain(left_out).collect();
        (!told.is_empty()).then(|| told.join("; "))
    }

    fn fed_text(&self) -> String {
        match self.fed_volume {
            Some(fed) => format!("{fed:.3} mm³ fed{}", self.filament(" by a filament of ", "")),
            None => "no E".to_owned(),
        }
    }

    /// The firmware whose rules counted, and who says so.
    fn firmware_text(&self) -> String {
        let named_by = self.details.firmware_named_by.as_deref().unwrap_or_default();
        let source = match self.details.firmware_source {
            FirmwareSource::Option => "by --firmware".to_owned(),
            FirmwareSource::File => format!("by \"{named_by}\""),
            FirmwareSource::Assumed => "assumed".to_owned(),
        };
        format!("{} ({source})", self.details.firmware.name())
    }

    /// All that reading found, for people.
    pub fn description(&self) -> String {
        let details = &self.details;
        let mut text = format!("{}: toolpath in G-code, {} lines\n", one_line(&self.path), details.lines);
        let mut line = |name: &str, value: String| text += &format!("  {name:<8} {value}\n");
        if let Some(slicer) = &details.slicer {
            line("slicer", one_line(slicer));
        }
        line("firmware", one_line(&self.firmware_text()));
        line("machine", one_line(&with_options(&details.machine.text())));
        let GcodeReport { beads, segments, layers, .. } = details;
        line("beads", format!("{beads}, of {segments} segments, in {layers} layers"));
        if let Some([low, high]) = details.bounds {
            line("bounds", format!("{} to {}, of the nozzle's tip", point(low), point(high)));
        }
        line("length", format!("{:.3} mm", details.length));
        let source = match details.filament_source {
            FilamentSource::Option => " (by --filament)",
            FilamentSource::Comment => " (by the file)",
            FilamentSource::Assumed => " (assumed)",
            FilamentSource::Volumetric => " (E counts volume)",
            FilamentSource::None => "",
        };
        line("volume", format!("{}{source}, {:.3} mm³ of beads", self.fed_text(), self.bead_volume));
        line("widths", sizes_text(&details.widths));
        line("heights", sizes_text(&details.heights));
        let tools: Vec<String> = details.tools.iter().map(u16::to_string).collect();
        line("tools", tools.join(", "));
        let settings = settings_text(&details.settings);
        if !settings.is_empty() {
            line("settings", settings);
        }
        if !details.meshes.is_empty() {
            line("meshes", one_line(&details.meshes.join(", ")));
        }
        for feature in details.features.iter().filter(|feature| feature.beads > 0) {
            let numbers = format!(
                "{} beads, {} segments, {:.3} mm, {:.3} mm³ fed, {:.3} mm³ of beads",
                feature.beads, feature.segments, feature.length, feature.fed, feature.volume
            );
            line("feature", format!("{}: {numbers}", one_line(&feature.name)));
        }
        text
    }
}

/// Layers with too little or too much material; those in a row that are alike are one line.
fn fill_texts(fill: &[LayerFill]) -> Vec<String> {
    let numbers = |layer: &LayerFill| (percent(layer.empty), size(layer.width), size(layer.pitch));
    let is_next = |a: &LayerFill, b: &LayerFill| b.layer == a.layer + 1 && numbers(a) == numbers(b);
    let mut lines: Vec<String> = fill.chunk_by(is_next).take(FILL_LINES_MAX).map(fill_text).collect();
    let rest = fill.chunk_by(is_next).skip(FILL_LINES_MAX).map(<[LayerFill]>::len).sum::<usize>();
    if rest > 0 {
        lines.push(format!("{rest} more layers are too empty or too full; info --json lists them"));
    }
    lines
}

fn fill_text(layers: &[LayerFill]) -> String {
    let (first, last) = (&layers[0], &layers[layers.len() - 1]);
    let named = match layers.len() {
        1 => format!("layer {} is", first.layer),
        _ => format!("layers {} to {} are", first.layer, last.layer),
    };
    let how = match percent(first.empty) {
        empty @ 0.. => format!("{empty}% empty"),
        over => format!("{}% overfull", -over),
    };
    let (width, pitch) = (size(first.width), size(first.pitch));
    format!(
        "{named} {how}: beads {width} mm wide, {pitch} mm apart, lines {}-{}",
        first.lines.0, last.lines.1
    )
}

fn percent(part: f64) -> i64 {
    (100.0 * part).round() as i64
}

/// A length to three digits.
fn size(mm: f64) -> String {
    let digits = if mm < 1.0 {
        3
    } else if mm < 10.0 {
        2
    } else {
        1
    };
    let text = format!("{mm:.digits$}");
    text.trim_end_matches('0').trim_end_matches('.').to_owned()
}

/// Smallest and largest size, and where sizes come from.
fn sizes_text(sizes: &SizeReport) -> String {
    let range = match sizes.range {
        Some((low, high)) if low == high => format!("{low:.4} mm"),
        Some((low, high)) => format!("{low:.4} to {high:.4} mm"),
        None => return "none".to_owned(),
    };
    let SizeReport { option, comment, extrusion, step, setting, .. } = sizes;
    let sources = [
        (option, "by option"),
        (comment, "by comments"),
        (extrusion, "by E"),
        (step, "by the layers' distance"),
        (setting, "by the slicer's settings"),
    ];
    let used: Vec<_> = sources.iter().filter(|(count, _)| **count > 0).collect();
    let sources: Vec<String> = match &used[..] {
        [(_, source)] => vec![source.to_string()],
        many => many.iter().map(|(count, source)| format!("{count} {source}")).collect(),
    };
    format!("{range} ({})", sources.join(", "))
}

fn settings_text(settings: &SettingsReport) -> String {
    let SettingsReport { layer_height, first_layer_height, line_width, nozzle_diameter } = settings;
    let named = [
        ("layer height", layer_height),
        ("first layer", first_layer_height),
        ("line width", line_width),
        ("nozzle", nozzle_diameter),
    ];
    let told = named.iter().filter_map(|(name, value)| Some(format!("{name} {} mm", (*value).as_ref()?)));
    told.collect::<Vec<String>>().join(", ")
}

fn point(p: [f64; 3]) -> String {
    format!("({:.6}, {:.6}, {:.6})", p[0], p[1], p[2])
}

/// How segments were joined, for people.
pub fn joints_text(joints: &Joints) -> String {
    let Joints { mitred, split_bends, split_sections, split_folds } = joints;
    format!(
        "{mitred} mitred, split: {split_bends} for their bend, {split_sections} for their sections, {split_folds} \
         that would fold"
    )
}
