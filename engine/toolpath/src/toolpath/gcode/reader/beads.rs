//! Gathers deposited steps into beads and hands them over.

use super::auxiliary::is_auxiliary;
use super::distance::distance;
use super::options::GcodeOptions;
use super::report::{FeatureReport, GcodeReport};
use super::settings::SlicerSettings;
use super::sizes::{BeadMove, Layering, NumberResolution};
use super::{MERGE_MM, UNNAMED, tilt};
use crate::error::{Error, Result};
use crate::toolpath::{Attributes, BeadSink, BeadView, Section, UP};
use std::collections::{BTreeSet, HashMap};
use std::path::{Path, PathBuf};

/// Longest bead, in segments: about 30 MB. A vase is one bead from bottom to top, and memory must not grow with
/// the file.
const SEGMENTS_MAX: usize = 1 << 18;

/// Most names of features. Slicers have about 20.
const FEATURES_MAX: usize = 1 << 12;

/// Where the tool is and how it is turned.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Pose {
    /// Of the tip, in mm.
    pub(super) point: [f64; 3],
    /// Words A, B, C.
    pub(super) degrees: [f64; 3],
    /// The axis itself, a unit vector, where the file states it instead (`A3= B3= C3=`).
    pub(super) vector: Option<[f64; 3]>,
}

impl Pose {
    /// The tool's axis.
    pub(super) fn axis(&self) -> [f64; 3] {
        match self.vector {
            Some(vector) => vector,
            None if self.degrees == [0.0; 3] => UP,
            None => tilt::axis(self.degrees),
        }
    }
}

impl Pose {
    /// The pose after a part of a straight way to another one.
    pub(super) fn towards(&self, to: &Pose, part: f64) -> Pose {
        let between = |a: [f64; 3], b: [f64; 3]| [0, 1, 2].map(|axis| a[axis] + (b[axis] - a[axis]) * part);
        let vector = to.vector.and_then(|vector| unit(between(self.axis(), vector)));
        Pose { point: between(self.point, to.point), degrees: between(self.degrees, to.degrees), vector }
    }
}

/// What makes two steps parts of one bead.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct BeadKey {
    /// By the slicer's comments; 0 if there are none.
    pub(super) layer: u32,
    pub(super) tool: u16,
    pub(super) feature: u16,
}

/// The bead that grows, and what all beads share.
pub(super) struct BeadAssembler<'s, 'k> {
    path: PathBuf,
    sink: &'s mut BeadSink<'k>,
    pub(super) report: GcodeReport,
    skip: Vec<String>,
    skip_auxiliary: bool,
    indices: HashMap<Vec<u8>, u16>,
    skipped: Vec<bool>,
    tools: BTreeSet<u16>,
    /// Whether E feeds.
    feeds: bool,
    pub(super) layering: Layering,
    /// Lowest and highest position of the table while material was laid.
    pub(super) tables: Option<(f64, f64)>,
    pub(super) resolution: NumberResolution,
    kind: BeadKey,
    points: Vec<[f64; 3]>,
    /// As long as `points`.
    axes: Vec<[f64; 3]>,
    pieces: Vec<BeadMove>,
    /// The line of each piece.
    piece_lines: Vec<u64>,
    sections: Vec<Section>,
    /// Fed on steps that were too short to make a piece, mm³.
    carried: f64,
    lines: (u64, u64),
}

impl<'s, 'k> BeadAssembler<'s, 'k> {
    pub(super) fn new(
        path: &Path,
        options: &GcodeOptions,
        settings: &SlicerSettings,
        feeds: bool,
        has_layer_marks: bool,
        sink: &'s mut BeadSink<'k>,
    ) -> BeadAssembler<'s, 'k> {
        BeadAssembler {
            path: path.to_owned(),
            sink,
            report: GcodeReport::default(),
            skip: options.skip_features.iter().map(|name| name.to_lowercase()).collect(),
            skip_auxiliary: options.skip_auxiliary,
            indices: HashMap::new(),
            skipped: Vec::new(),
            tools: BTreeSet::new(),
            feeds,
            layering: Layering::new(options, settings, has_layer_marks),
            tables: None,
            resolution: NumberResolution::default(),
            kind: BeadKey::default(),
            points: Vec::new(),
            axes: Vec::new(),
            pieces: Vec::new(),
            piece_lines: Vec::new(),
            sections: Vec::new(),
            carried: 0.0,
            lines: (0, 0),
        }
    }

    /// The index of a feature's name.
    ///
    /// # Errors
    /// If there are too many names.
    pub(super) fn feature(&mut self, name: &[u8], line: u64) -> Result<u16> {
        let name = if name.is_empty() { UNNAMED.as_bytes() } else { &name[..name.len().min(200)] };
        if let Some(index) = self.indices.get(name) {
            return Ok(*index);
        }
        if self.indices.len() == FEATURES_MAX {
            let what = format!("more than {FEATURES_MAX} different features are named");
            return Err(Error::input(&self.path, format!("line {line}"), what, "is it a G-code file?"));
        }
        let index = self.indices.len() as u16;
        self.indices.insert(name.to_owned(), index);
        let name = String::from_utf8_lossy(name).into_owned();
        let is_beside = self.skip_auxiliary && is_auxiliary(&name);
        self.skipped.push(is_beside || self.skip.contains(&name.to_lowercase()));
        self.report.features.push(FeatureReport { name, ..FeatureReport::default() });
        Ok(index)
    }

    /// Adds a straight step of the tool from one pose to another, which deposits a piece of the given kind.
    pub(super) fn deposit(
        &mut self,
        kind: BeadKey,
        from: &Pose,
        to: &Pose,
        piece: BeadMove,
        line: u64,
    ) -> Result<()> {
        let too_long = self.pieces.len() >= SEGMENTS_MAX;
        if !self.points.is_empty() && (too_long || kind != self.kind) {
            if too_long {
                self.report.note("a bead is handed over in pieces because of its length", line);
            }
            self.finish()?;
        }
        if self.points.is_empty() {
            self.kind = kind;
            self.lines = (line, line);
            self.push(from);
        }
        self.lines.1 = line;
        let length = distance(self.points[self.points.len() - 1], to.point);
        if length < MERGE_MM {
            self.carried += piece.fed;
            self.report.merged += 1;
            return Ok(());
        }
        self.push(to);
        self.pieces.push(BeadMove { fed: piece.fed + self.carried, ..piece });
        self.piece_lines.push(line);
        self.carried = 0.0;
        Ok(())
    }

    fn push(&mut self, pose: &Pose) {
        self.points.push(pose.point);
        self.axes.push(pose.axis());
    }

    /// Ends the bead: the tool travels, or the file ends.
    #[inline]
    pub(super) fn finish(&mut self) -> Result<()> {
        if self.points.is_empty() { Ok(()) } else { self.hand_over() }
    }

    fn hand_over(&mut self) -> Result<()> {
        match self.pieces.last_mut() {
            Some(last) => last.fed += self.carried,
            None => {
                self.report.blobs.count += 1;
                self.report.blobs.volume += self.carried;
            }
        }
        self.carried = 0.0;
        let result = match self.pieces.is_empty() {
            true => Ok(()),
            false if self.skipped[usize::from(self.kind.feature)] => {
                self.skip();
                Ok(())
            }
            false => self.emit(),
        };
        self.points.clear();
        self.axes.clear();
        self.pieces.clear();
        self.piece_lines.clear();
        result
    }

    fn skip(&mut self) {
        let skipped = &mut self.report.skipped;
        self.report.features[usize::from(self.kind.feature)].skipped += 1;
        skipped.beads += 1;
        skipped.segments += self.pieces.len() as u64;
        skipped.length += self.points.windows(2).map(|p| distance(p[0], p[1])).sum::<f64>();
        skipped.fed += self.pieces.iter().map(|piece| piece.fed).sum::<f64>();
    }

    fn emit(&mut self) -> Result<()> {
        let tilted = self.axes.iter().any(|axis| *axis != UP);
        let found = self.layering.sections(
            (&self.points, tilted),
            &self.pieces,
            self.resolution,
            &mut self.sections,
            &mut self.report,
        );
        let layer = match found {
            Ok(layer) => layer.unwrap_or(self.kind.layer),
            Err((what, remedy)) => {
                return Err(Error::input(&self.path, format!("line {}", self.lines.0), what, remedy));
            }
        };
        let fed = self.count(layer);
        let attributes = Attributes {
            layer,
            tool: self.kind.tool,
            feature: self.kind.feature,
            lines: self.lines,
            fed: self.feeds.then_some(fed),
        };
        let axes = if tilted { &self.axes[..] } else { &[] };
        let (points, sections, lines) = (&self.points, &self.sections, &self.piece_lines);
        (self.sink)(BeadView { points, axes, sections, lines, attributes })
    }

    /// Adds the bead to the report; returns what was fed for it.
    fn count(&mut self, layer: u32) -> f64 {
        let (mut length, mut volume, mut fed) = (0.0, 0.0, 0.0);
        for (i, (section, piece)) in self.sections.iter().zip(&self.pieces).enumerate() {
            let step = distance(self.points[i], self.points[i + 1]);
            length += step;
            volume += step * section.stadium_area();
            fed += piece.fed;
        }
        let report = &mut self.report;
        report.include(&self.points);
        let feature = &mut report.features[usize::from(self.kind.feature)];
        let segments = self.pieces.len() as u64;
        feature.beads += 1;
        feature.segments += segments;
        feature.length += length;
        feature.volume += volume;
        feature.fed += fed;
        report.beads += 1;
        report.segments += segments;
        report.length += length;
        report.bead_volume += volume;
        report.layers = report.layers.max(layer + 1);
        if self.feeds {
            *report.fed_volume.get_or_insert(0.0) += fed;
        }
        self.tools.insert(self.kind.tool);
        fed
    }

    /// The report, once the last bead is handed over.
    pub(super) fn into_report(self) -> GcodeReport {
        GcodeReport { tools: self.tools.into_iter().collect(), ..self.report }
    }
}

/// A vector of the length 1 in the direction of this one, if it has one.
fn unit(vector: [f64; 3]) -> Option<[f64; 3]> {
    let length = distance([0.0; 3], vector);
    (length > 1e-9).then(|| vector.map(|x| x / length))
}
