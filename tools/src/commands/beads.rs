//! `brickfield beads`: toolpaths to the triangles, or the extrusions, swept along them.

use super::start;
use crate::args::BeadsArgs;
use crate::failure::Failure;
use crate::kinds::require_toolpaths;
use crate::memory;
use crate::output::{one_line, print, print_json, require_distinct, warn};
use crate::space::{LARGE_BYTES, require_space, tell_left_behind};
use crate::toolpaths::{ToolpathReport, joints_text};
use crate::units::Size;
use brickfield_engine::bead::{Joints, StlBeads, StlSummary, Sweep};
use brickfield_engine::ingest::read_beads;
use brickfield_engine::part::PartFile;
use brickfield_engine::part::free_beside;
use brickfield_engine::toolpath::BeadView;
use brickfield_engine::toolpath::gcode::GcodeOptions;
use brickfield_engine::x3d::{ExtrusionStyle, Writer};
use brickfield_engine::{Error, Progress};
use serde::Serialize;
use std::path::{Path, PathBuf};
use std::time::Instant;

/// Runs the command. Beads pass through one by one: memory does not grow with the part.
pub fn run(args: &BeadsArgs) -> Result<(), Failure> {
    let started = Instant::now();
    let bars = start(args.work)?;
    let ending = args.output.extension().map(|ending| ending.to_string_lossy().to_ascii_lowercase());
    let is_x3d = ending.as_deref() == Some("x3d");
    if !(is_x3d || ending.as_deref() == Some("stl")) {
        let what = "beads are written as .stl or .x3d";
        return Err(Failure::Usage(format!("{}: {what}", args.output.display())));
    }
    require_toolpaths(&args.inputs)?;
    let options = args.toolpath.options(args.unit)?;
    let sweep = Sweep::new(&options.sweep)?;
    let inputs: Vec<&Path> = args.inputs.iter().map(AsRef::as_ref).collect();
    require_distinct(&[&args.output], &inputs)?;
    tell_left_behind(&args.output, args.work.quiet);
    foresee(args, &options.gcode, is_x3d, &bars)?;
    let mut sink = if is_x3d {
        Sink::X3d(X3dBeads::create(&args.output, sweep.clone(), options.sweep.bend)?)
    } else {
        Sink::Stl(StlBeads::create(&args.output, sweep.clone())?)
    };
    let mut toolpaths = Vec::new();
    for path in inputs {
        let mut bead_volume = 0.0;
        let report = read_beads(path, &options.gcode, &bars, &mut |bead| {
            bead_volume += sweep.volume(&bead);
            sink.push(bead, &bars)
        })?;
        toolpaths.push(ToolpathReport::new(path.display().to_string(), bead_volume, report));
    }
    let read = toolpaths.iter().zip(&args.inputs);
    args.toolpath.require_features(read.map(|(report, path)| (path.as_path(), report.details())))?;
    let written = sink.finish(&bars)?;
    bars.clear();
    let report = Report::new(&args.output, written, toolpaths, started.elapsed().as_secs_f64());
    report.warnings.iter().for_each(|message| warn(message));
    if args.json {
        print_json(&report)
    } else if args.work.quiet {
        Ok(())
    } else {
        print(&report.text())
    }
}

/// Bytes of triangles for each byte of G-code, at most: 28 MB of moves of 17 bytes become 2 GB with 14 sides.
const BYTES_A_BYTE: u64 = 300;
/// Bytes of Extrusions for each segment, as text: a point, and what its section takes.
const X3D_BYTES_A_SEGMENT: u64 = 60;

/// Fails if the file will be larger than what its disk has free. Only where that may be are segments counted, by a pass
/// over the input.
fn foresee(
    args: &BeadsArgs,
    options: &GcodeOptions,
    is_x3d: bool,
    progress: &dyn Progress,
) -> Result<(), Failure> {
    let sizes = args.inputs.iter().map(|path| std::fs::metadata(path).map_or(0, |file| file.len()));
    // Compressed ones unpack to some ten times as much.
    let is_packed = |path: &&PathBuf| path.extension().is_some_and(|ending| ending == "gz" || ending == "xz");
    let packed = if args.inputs.iter().any(|path| is_packed(&path)) { 10 } else { 1 };
    let most = sizes.sum::<u64>().saturating_mul(BYTES_A_BYTE * packed);
    if most < LARGE_BYTES || free_beside(&args.output).is_none_or(|free| most <= free) {
        return Ok(());
    }
    let mut bytes = 0u64;
    for path in &args.inputs {
        let (mut beads, mut segments) = (0u64, 0u64);
        read_beads(path, options, progress, &mut |bead| {
            progress.check()?;
            beads += 1;
            segments += bead.sections.len() as u64;
            Ok(())
        })?;
        // Each segment has two triangles a side, and each tube two fans as its ends.
        let facets = 2 * args.toolpath.sides as u64 * (segments + beads);
        bytes += if is_x3d { X3D_BYTES_A_SEGMENT * segments } else { 50 * facets };
    }
    require_space(&args.output, bytes, "use fewer --sides, or .x3d")
}

/// Where beads go.
enum Sink {
    Stl(StlBeads),
    X3d(X3dBeads),
}

impl Sink {
    fn push(&mut self, bead: BeadView<'_>, progress: &dyn Progress) -> Result<(), Error> {
        match self {
            Sink::Stl(stl) => stl.push(bead, progress),
            Sink::X3d(x3d) => {
                progress.check()?;
                x3d.push(bead)
            }
        }
    }

    fn finish(self, progress: &dyn Progress) -> Result<Numbers, Error> {
        match self {
            Sink::Stl(stl) => Ok(stl.finish(progress)?.into()),
            Sink::X3d(x3d) => x3d.finish(),
        }
    }
}

/// An X3D file that takes beads one by one.
struct X3dBeads {
    writer: Writer<PartFile>,
    sweep: Sweep,
    beads: u64,
    segments: u64,
    bead_volume: f64,
}

impl X3dBeads {
    fn create(path: &Path, sweep: Sweep, bend_degrees: f64) -> Result<X3dBeads, Error> {
        let style = ExtrusionStyle { bend_degrees, ..ExtrusionStyle::default() };
        let writer = Writer::new(PartFile::create(path)?, path, style)?;
        Ok(X3dBeads { writer, sweep, beads: 0, segments: 0, bead_volume: 0.0 })
    }

    /// The outline is that of the bead's first section; where sections vary, it is scaled.
    fn push(&mut self, bead: BeadView<'_>) -> Result<(), Error> {
        self.beads += 1;
        self.segments += bead.sections.len() as u64;
        self.bead_volume += self.sweep.volume(&bead);
        self.writer.bead(bead, &self.sweep.profile().outline(bead.sections[0]))
    }

    fn finish(self) -> Result<Numbers, Error> {
        let tubes = self.writer.extrusions();
        let mut part = self.writer.finish()?;
        let bytes = part.appended();
        part.finish()?;
        Ok(Numbers {
            beads: self.beads,
            segments: self.segments,
            tubes,
            facets: None,
            bytes,
            joints: None,
            bead_volume: self.bead_volume,
            swept_volume: None,
        })
    }
}

/// What was written. Volumes in mm³.
#[derive(Serialize)]
struct Numbers {
    beads: u64,
    segments: u64,
    /// Closed surfaces, or Extrusions.
    tubes: u64,
    /// Of STL.
    facets: Option<u64>,
    bytes: u64,
    /// Of STL.
    joints: Option<Joints>,
    bead_volume: f64,
    /// Of STL: what all surfaces enclose.
    swept_volume: Option<f64>,
}

impl From<StlSummary> for Numbers {
    fn from(written: StlSummary) -> Numbers {
        let StlSummary { beads, segments, tubes, facets, bytes, joints, bead_volume, swept_volume } = written;
        let (facets, joints, swept_volume) = (Some(facets), Some(joints), Some(swept_volume));
        Numbers { beads, segments, tubes, facets, bytes, joints, bead_volume, swept_volume }
    }
}

/// What is printed in the end. Volumes in mm³.
#[derive(Serialize)]
struct Report {
    output: String,
    unit: &'static str,
    #[serde(flatten)]
    written: Numbers,
    toolpaths: Vec<ToolpathReport>,
    warnings: Vec<String>,
    seconds: f64,
    /// Of STL.
    facets_per_second: Option<f64>,
    peak_memory_bytes: Option<u64>,
}

impl Report {
    fn new(output: &Path, written: Numbers, toolpaths: Vec<ToolpathReport>, seconds: f64) -> Report {
        Report {
            output: output.display().to_string(),
            unit: "mm",
            facets_per_second: written.facets.map(|facets| facets as f64 / seconds),
            written,
            warnings: toolpaths.iter().flat_map(ToolpathReport::warnings).collect(),
            toolpaths,
            seconds,
            peak_memory_bytes: memory::peak().map(|size| size.0),
        }
    }

    fn text(&self) -> String {
        let Numbers { tubes, facets, bytes, joints, swept_volume, .. } = &self.written;
        let of = match facets {
            Some(facets) => format!("{facets} facets of {tubes} tubes"),
            None => format!("{tubes} extrusions"),
        };
        let mut text = format!("{}: {of}, {}\n", one_line(&self.output), Size(*bytes));
        let mut line = |line: String| text += &format!("  {line}\n");
        self.toolpaths.iter().for_each(|toolpath| line(format!("source   {}", toolpath.text())));
        let beside = self.toolpaths.iter().filter_map(ToolpathReport::beside_text);
        beside.for_each(|text| line(format!("beside   {text}")));
        if let Some(joints) = joints {
            line(format!("joints   {}", joints_text(joints)));
        }
        if let Some(volume) = swept_volume {
            line(format!("volume   {volume:.3} mm³ enclosed by all tubes, caps and overlaps included"));
        }
        self.warnings.iter().for_each(|message| line(format!("warning  {message}")));
        let rate = self.facets_per_second.map_or_else(String::new, |rate| format!(", {rate:.0} facets/s"));
        line(format!("time     {:.2} s{rate}", self.seconds));
        if let Some(peak) = self.peak_memory_bytes {
            line(format!("memory   {} at most", Size(peak)));
        }
        text
    }
}
