//! Width and height of what is deposited.

use super::SIZE_MAX;
use super::distance::distance;
use super::options::GcodeOptions;
use super::report::{GcodeReport, SizeReport};
use super::settings::SlicerSettings;
use crate::toolpath::Section;
use std::collections::VecDeque;
use std::f64::consts::FRAC_PI_4;

/// Beads whose heights differ by less lie in one plane, in mm. Printers resolve some micrometres.
const PLANE_MM: f64 = 1e-3;

/// Most planes that are remembered: 6 m of 0.1 mm layers.
const PLANES_MAX: usize = 1 << 16;

/// By how much feed rates (mm³ a mm) may differ from their mean in a stretch of equal width, besides what the
/// rounding of the file's numbers explains.
const RATE_TOLERANCE: f64 = 0.03;

/// One straight piece of a bead, as it stands in the file.
#[derive(Clone, Copy, Debug)]
pub(super) struct BeadMove {
    /// Material fed, mm³.
    pub(super) fed: f64,
    /// From a comment, mm.
    pub(super) width: Option<f64>,
    /// From a comment, mm.
    pub(super) height: Option<f64>,
}

/// How finely the file's numbers are rounded.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct NumberResolution {
    /// Of coordinates, in mm.
    pub(super) position: f64,
    /// Of E, in mm³.
    pub(super) volume: f64,
}

/// What is wrong, and what to do.
type SizeProblem = (String, &'static str);

/// Finds sections, and layers where no comment tells them.
pub(super) struct Layering {
    width: Option<f64>,
    height: Option<f64>,
    setting: Option<f64>,
    /// The usual width, for beads whose material nothing tells.
    usual_width: Option<f64>,
    has_marks: bool,
    /// Heights of the planes below, ascending.
    planes: VecDeque<f64>,
    plane: Option<f64>,
    layer: u32,
    /// Height of the flat bead before.
    last: Option<f64>,
    /// Height of the bed.
    pub(super) bed: f64,
    pub(super) rise: Rise,
}

/// How planes follow each other.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Rise {
    first: Option<f64>,
    /// The first plane above the first one.
    second: Option<f64>,
    /// Steps up and down.
    pub(super) ups: u64,
    pub(super) downs: u64,
}

impl Rise {
    fn enter(&mut self, plane: f64, before: Option<f64>) {
        let first = *self.first.get_or_insert(plane);
        if plane > first + PLANE_MM {
            self.second.get_or_insert(plane);
        }
        if let Some(before) = before {
            self.ups += u64::from(plane > before);
            self.downs += u64::from(plane < before);
        }
    }

    /// Where the bed is, if the first layer is as high as given, or else as the second one.
    pub(super) fn bed(&self, height: Option<f64>) -> Option<f64> {
        let first = self.first?;
        let height = height.or(self.second.map(|second| second - first))?;
        Some(first - height)
    }
}

impl Layering {
    pub(super) fn new(options: &GcodeOptions, settings: &SlicerSettings, has_marks: bool) -> Layering {
        Layering {
            width: options.width,
            height: options.height,
            setting: settings.layer_height,
            usual_width: settings.line_width,
            has_marks,
            planes: VecDeque::new(),
            plane: None,
            layer: 0,
            last: None,
            bed: 0.0,
            rise: Rise::default(),
        }
    }

    /// Fills in the sections of a bead's pieces. Returns its layer where no comment tells it.
    pub(super) fn sections(
        &mut self,
        (points, tilted): (&[[f64; 3]], bool),
        pieces: &[BeadMove],
        resolution: NumberResolution,
        sections: &mut Vec<Section>,
        report: &mut GcodeReport,
    ) -> Result<Option<u32>, SizeProblem> {
        let z = points[0][2];
        let flat = !tilted && points.iter().all(|p| p[2] == z);
        let step = if flat { self.enter_plane(z) } else { None };
        sections.clear();
        for piece in pieces {
            let height = self.height(piece, step, &mut report.heights)?;
            report.heights.include(height);
            sections.push(Section { width: 0.0, height });
        }
        if flat {
            self.last = sections.last().map(|section| section.height);
        }
        self.fill_widths(points, pieces, resolution, sections, report)?;
        Ok((!self.has_marks).then_some(self.layer))
    }

    /// Puts a plane onto those below it; returns how far below the next one is, or the bed.
    fn enter_plane(&mut self, z: f64) -> Option<f64> {
        if self.plane.is_none_or(|plane| (plane - z).abs() > PLANE_MM) {
            self.rise.enter(z, self.plane);
            self.layer += u32::from(self.plane.is_some());
            self.plane = Some(z);
            // Objects printed one after the other begin at the bed again.
            while self.planes.back().is_some_and(|below| *below > z - PLANE_MM) {
                self.planes.pop_back();
            }
            if self.planes.len() == PLANES_MAX {
                self.planes.pop_front();
            }
            self.planes.push_back(z);
        }
        let below = self.planes.len().checked_sub(2).map_or(self.bed, |below| self.planes[below]);
        // Differences of decimal numbers, without the binary dust: equal layers get equal heights.
        let step = ((z - below) * 1e6).round() / 1e6;
        (step > PLANE_MM && step <= SIZE_MAX).then_some(step)
    }

    fn height(
        &self,
        piece: &BeadMove,
        step: Option<f64>,
        heights: &mut SizeReport,
    ) -> Result<f64, SizeProblem> {
        let (height, source) = if let Some(height) = self.height {
            (height, &mut heights.option)
        } else if let Some(height) = piece.height {
            (height, &mut heights.comment)
        } else if let Some(height) = step {
            (height, &mut heights.step)
        } else if let Some(height) = self.setting.or(self.last) {
            (height, &mut heights.setting)
        } else {
            let what = "nothing says how high the bead is: no comment, no layer below".to_owned();
            return Err((what, "give its height in mm with `height`"));
        };
        *source += 1;
        Ok(height)
    }

    fn fill_widths(
        &self,
        points: &[[f64; 3]],
        pieces: &[BeadMove],
        resolution: NumberResolution,
        sections: &mut [Section],
        report: &mut GcodeReport,
    ) -> Result<(), SizeProblem> {
        let mut from = 0;
        while from < pieces.len() {
            let to = if let Some(width) = self.width {
                report.widths.option += 1;
                sections[from].width = width;
                from + 1
            } else if let Some(width) = pieces[from].width {
                report.widths.comment += 1;
                sections[from].width = width;
                from + 1
            } else {
                let (to, rate) = stretch(points, pieces, sections, resolution, from);
                let width = width_of(rate, sections[from].height);
                if let (Some(width), true) = (self.usual_width, rate <= 0.0) {
                    report.widths.setting += (to - from) as u64;
                    report.widths.include(width);
                    sections[from..to].iter_mut().for_each(|section| section.width = width);
                    from = to;
                    continue;
                }
                if rate <= 0.0 {
                    let what = "nothing says how wide the bead is: no comment, no E".to_owned();
                    return Err((what, "give its width in mm with `width`"));
                }
                if width > SIZE_MAX {
                    let what = format!("E feeds {rate:.0} mm³ on each mm, a bead wider than {SIZE_MAX} mm");
                    return Err((what, "check the E words and the filament's diameter"));
                }
                report.widths.extrusion += (to - from) as u64;
                sections[from..to].iter_mut().for_each(|section| section.width = width);
                to
            };
            report.widths.include(sections[from].width);
            from = to;
        }
        Ok(())
    }
}

/// The longest stretch from a piece on that has one height and, but for rounding, one feed rate; with its mean
/// rate in mm³ a mm. Numbers in the file are rounded, so that the rates of short pieces scatter: one width for
/// a whole stretch keeps its volume exactly.
fn stretch(
    points: &[[f64; 3]],
    pieces: &[BeadMove],
    sections: &[Section],
    resolution: NumberResolution,
    from: usize,
) -> (usize, f64) {
    let (mut fed, mut length) = (0.0f64, 0.0f64);
    let mut to = from;
    while to < pieces.len() && pieces[to].width.is_none() && sections[to].height == sections[from].height {
        let step = distance(points[to], points[to + 1]);
        if to > from {
            let (mean, rate): (f64, f64) = (fed / length, pieces[to].fed / step);
            let noise =
                (resolution.volume + mean.max(rate) * resolution.position) * (1.0 / step + 1.0 / length);
            if (rate - mean).abs() > RATE_TOLERANCE * mean + noise {
                break;
            }
        }
        fed += pieces[to].fed;
        length += step;
        to += 1;
    }
    (to, fed / length)
}

/// Width of the stadium of a given area and height; of an upright one where the area is below the circle's.
pub(super) fn width_of(area: f64, height: f64) -> f64 {
    const CORNERS: f64 = 1.0 - FRAC_PI_4;
    if area >= FRAC_PI_4 * height * height {
        return area / height + height * CORNERS;
    }
    // A = w·h − (1 − π/4)·w², as area() has it, solved without cancellation.
    let root = (height * height - 4.0 * CORNERS * area).sqrt();
    2.0 * area / (height + root)
}
