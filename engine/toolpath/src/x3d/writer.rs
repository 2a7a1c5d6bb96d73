//! Toolpaths as Extrusion nodes, with rounded ends fused into the sweep (Peelar et al. 2019, §5.2).
//!
//! A reader that follows the specification takes the chord for the direction of a sweep, turns its cross-section with
//! every bend of the spine, also with one of a micrometre, and thins it by cos(θ/2) at a bend of θ.
//!
//! So every spine point gets the `orientation` that leads from the specification's plane to the bead's own, in the
//! plane that bisects the bend, and the `scale` that keeps the full section up to it. The planes are taken from the
//! coordinates as written, the way our reader and any other sees them.
//!
//! The cross-section is drawn in a unit square, X pointing to the right of the path and Z up; `scale` holds
//! width and height. A bead is split where it bends sharply, where its section changes by more than a tenth,
//! where the section would roll, and where a mitre would fold over. Both parts get round ends that overlap.

use super::scp;
use crate::error::{Error, Result};
use crate::toolpath::{BeadView, Section, UP};
use glam::{DMat3, DQuat, DVec3};
use std::io::Write;
use std::path::{Path, PathBuf};

/// Steps of a written number to one: a nanometre, if lengths are millimetres.
const STEPS: f64 = 1e6;
/// Largest coordinate: its steps fit 53 bits.
const COORDINATE_MAX: f64 = 1e9;
/// The last scale of an end, which must be above zero.
const SCALE_MIN: f64 = 0.05;
/// Sections that differ by more than this part of the larger one are not joined.
const SECTION_CHANGE_MAX: f64 = 0.1;
/// Cosine of the most that the section may roll about the path from one segment to the next.
const ROLL_COS_MIN: f64 = 0.9;
/// Sine of the angle to the tool's axis below which that does not say where sideways is.
const UPRIGHT_SIN: f64 = 1e-2;

/// How beads become Extrusions.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ExtrusionStyle {
    /// Bends sharper than this split the bead. In degrees, up to 150.
    pub bend_degrees: f64,
    /// Extra spine points at each end; 0 leaves it flat.
    pub cap_rings: u32,
}

impl Default for ExtrusionStyle {
    /// Two rings leave out a quarter of the rounded end's volume, a thousandth of a usual bead's.
    fn default() -> ExtrusionStyle {
        ExtrusionStyle { bend_degrees: 45.0, cap_rings: 2 }
    }
}

/// Writes beads one after the other as an X3D file in millimetres.
#[derive(Debug)]
pub struct Writer<W: Write> {
    out: W,
    path: PathBuf,
    bend_cos: f64,
    /// Of each extra ring from the bead outwards: its distance in half widths, and its scale.
    cap: Vec<(f64, f64)>,
    text: String,
    extrusions: u64,
}

/// A segment, and which way is left of it at a right angle to the tool's axis.
#[derive(Clone, Copy, Debug)]
struct Segment {
    along: DVec3,
    across: DVec3,
    length: f64,
    section: Section,
}

/// A cross-section to be written.
#[derive(Clone, Copy, Debug)]
struct Ring {
    middle: DVec3,
    along: DVec3,
    across: DVec3,
    /// Width and height.
    size: [f64; 2],
}

impl<W: Write> Writer<W> {
    /// Begins a file. `path` is what errors name.
    ///
    /// # Errors
    /// If `out` cannot be written, or the style's angle is not from 0 to 150 degrees.
    pub fn new(out: W, path: &Path, style: ExtrusionStyle) -> Result<Writer<W>> {
        if !(0.0..=150.0).contains(&style.bend_degrees) {
            let what = format!("bends cannot be split beyond {} degrees", style.bend_degrees);
            return Err(Error::setting(what, "give an angle from 0 to 150"));
        }
        let rings = style.cap_rings.min(64);
        let angle = |j| f64::from(j) * std::f64::consts::FRAC_PI_2 / f64::from(rings);
        let cap = (1..=rings).map(|j| libm::sincos(angle(j))).map(|(sin, cos)| (sin, cos.max(SCALE_MIN)));
        let text = "<?xml version='1.0' encoding='UTF-8'?>\n<X3D profile='Immersive' version='3.3'>\n<head>\
                    <unit category='length' name='millimetre' conversionFactor='0.001'/></head>\n<Scene>\n";
        let mut writer = Writer {
            out,
            path: path.to_owned(),
            bend_cos: libm::cos(style.bend_degrees.to_radians()),
            cap: cap.collect(),
            text: text.to_owned(),
            extrusions: 0,
        };
        writer.flush_text()?;
        Ok(writer)
    }

    /// Number of Extrusions written so far.
    pub fn extrusions(&self) -> u64 {
        self.extrusions
    }

    /// Writes a bead whose cross-section is the polygon `outline`: corners in the section's unit square, from
    /// −½ to ½ across (to the left of the path) and up, counter-clockwise seen against the path.
    ///
    /// # Errors
    /// If a coordinate is not finite or beyond 10⁹, or `out` cannot be written.
    pub fn bead(&mut self, bead: BeadView<'_>, outline: &[[f64; 2]]) -> Result<()> {
        let is_usable = |c: &f64| c.abs() <= COORDINATE_MAX;
        if !bead.points.as_flattened().iter().all(is_usable) {
            let (first, last) = bead.attributes.lines;
            let what = format!("the bead of lines {first} to {last} has a coordinate beyond 1e9");
            return Err(Error::setting(what, "mend the toolpath"));
        }
        let segments: Vec<Segment> = (0..bead.sections.len()).map(|i| segment(&bead, i)).collect();
        let mut first = 0;
        for last in 0..segments.len() {
            let ends = segments.get(last + 1).is_none_or(|next| !self.joins(&segments[last], next));
            if ends {
                let rings = self.rings(&bead, &segments[first..=last], first);
                self.extrusion(&rings, outline);
                first = last + 1;
            }
        }
        self.flush_text()
    }

    /// Ends the file and gives back the writer that it went to, flushed.
    ///
    /// # Errors
    /// If it cannot be written.
    pub fn finish(mut self) -> Result<W> {
        self.text.push_str("</Scene></X3D>\n");
        self.flush_text()?;
        self.out.flush().map_err(Error::io(&self.path, "write"))?;
        Ok(self.out)
    }

    fn flush_text(&mut self) -> Result<()> {
        self.out.write_all(self.text.as_bytes()).map_err(Error::io(&self.path, "write"))?;
        self.text.clear();
        Ok(())
    }

    /// Whether `b` goes on where `a` ends, in one Extrusion.
    fn joins(&self, a: &Segment, b: &Segment) -> bool {
        let differ = |p: f64, q: f64| (p - q).abs() > SECTION_CHANGE_MAX * p.max(q);
        let cos = a.along.dot(b.along);
        if differ(a.section.width, b.section.width)
            || differ(a.section.height, b.section.height)
            || cos < self.bend_cos
        {
            return false;
        }
        // Across, carried over the bend by the least rotation.
        let carried = a.across - (a.along + b.along) * (a.across.dot(b.along) / (1.0 + cos));
        let ring = mitre(a, b, DVec3::ZERO);
        let bend = b.along - a.along;
        let half_cos = (a.along + b.along).length() / 2.0;
        // How far a corner lies before or behind the point. Each end of a segment may take half of it.
        let reach = (a.section.width * ring.across.dot(bend).abs()
            + a.section.height * ring.along.cross(ring.across).dot(bend).abs())
            / (4.0 * half_cos);
        carried.dot(b.across) >= ROLL_COS_MIN && reach < a.length.min(b.length) / 2.0
    }

    /// The rings of consecutive segments, of which the first begins at point `start`.
    fn rings(&self, bead: &BeadView<'_>, segments: &[Segment], start: usize) -> Vec<Ring> {
        let (head, tail) = (segments[0], segments[segments.len() - 1]);
        let middle_at = |i: usize, s: &Segment| middle(bead, start + i, s.section.height);
        let flat = |i, s: &Segment| Ring {
            middle: middle_at(i, s),
            along: s.along,
            across: s.across,
            size: [s.section.width, s.section.height],
        };
        let pushed = |ring: Ring, direction: f64, (distance, scale): (f64, f64)| Ring {
            middle: ring.middle + ring.along * (direction * distance * ring.size[0] / 2.0),
            size: ring.size.map(|s| s * scale),
            ..ring
        };
        let (begin, end) = (flat(0, &head), flat(segments.len(), &tail));
        let mut rings: Vec<Ring> = self.cap.iter().rev().map(|step| pushed(begin, -1.0, *step)).collect();
        rings.push(begin);
        for (i, pair) in segments.windows(2).enumerate() {
            let both = [&pair[0], &pair[1]].map(|s| middle_at(i + 1, s));
            rings.push(mitre(&pair[0], &pair[1], (both[0] + both[1]) / 2.0));
        }
        rings.push(end);
        rings.extend(self.cap.iter().map(|step| pushed(end, 1.0, *step)));
        rings
    }

    /// One node; nothing if all its points are one when rounded.
    fn extrusion(&mut self, rings: &[Ring], outline: &[[f64; 2]]) {
        let mut kept: Vec<Ring> = Vec::with_capacity(rings.len());
        for ring in rings {
            let ring = Ring { middle: ring.middle.map(rounded), ..*ring };
            if kept.last().is_none_or(|last| last.middle.distance(ring.middle) > scp::COINCIDENT) {
                kept.push(ring);
            }
        }
        let spine: Vec<DVec3> = kept.iter().map(|ring| ring.middle).collect();
        let mut turns: Vec<[f64; 4]> = Vec::with_capacity(kept.len());
        let planes = scp::planes(&spine, |i, frame| turns.push(turn(frame, &kept[i])));
        if planes.is_none() {
            return;
        }
        self.extrusions += 1;
        let convex = if is_convex(outline) { "" } else { " convex='false'" };
        self.text.push_str(&format!("<Shape><Extrusion{convex} crossSection='"));
        let closed = outline.iter().chain(outline.first());
        self.values(closed.map(|[across, up]| [-across, *up]));
        self.text.push_str("' spine='");
        self.values(spine.iter().map(DVec3::to_array));
        self.text.push_str("' scale='");
        self.values(kept.iter().map(|ring| ring.size.map(|s| s.max(1.0 / STEPS))));
        if turns.iter().any(|turn| turn[3] != 0.0) {
            self.text.push_str("' orientation='");
            self.values(turns.into_iter());
        }
        self.text.push_str("'/></Shape>\n");
    }

    /// Values with commas between them.
    fn values<const N: usize>(&mut self, values: impl Iterator<Item = [f64; N]>) {
        for (i, value) in values.enumerate() {
            if i > 0 {
                self.text.push(',');
            }
            for (j, number) in value.into_iter().enumerate() {
                if j > 0 {
                    self.text.push(' ');
                }
                // Adding zero turns −0 into +0.
                self.text.push_str(&format!("{}", rounded(number) + 0.0));
            }
        }
    }
}

/// To whole steps. The quotient is the number nearest to the decimal fraction, which is what a reader gets.
fn rounded(value: f64) -> f64 {
    (value * STEPS).round() / STEPS
}

/// The tool's axis at a point.
fn axis(bead: &BeadView<'_>, point: usize) -> DVec3 {
    bead.axes.get(point).copied().unwrap_or(UP).into()
}

/// Where the middle of the bead is when the tool's tip is at `point`: the tip runs along its upper side.
fn middle(bead: &BeadView<'_>, point: usize, height: f64) -> DVec3 {
    DVec3::from(bead.points[point]) - axis(bead, point) * (height / 2.0)
}

/// The segment from point `number` to the next.
fn segment(bead: &BeadView<'_>, number: usize) -> Segment {
    let section = bead.sections[number];
    let mut step = middle(bead, number + 1, section.height) - middle(bead, number, section.height);
    if step.length_squared() == 0.0 {
        // The tool turns about the middle of the bead; its tip moves.
        step = DVec3::from(bead.points[number + 1]) - DVec3::from(bead.points[number]);
    }
    let length = step.length();
    let along = if length > 0.0 { step / length } else { DVec3::X };
    let axis = (axis(bead, number) + axis(bead, number + 1)).normalize_or(DVec3::Z);
    let sideways = axis.cross(along);
    // Straight up or down, any direction is sideways.
    let sideways = if sideways.length() > UPRIGHT_SIN { sideways } else { least_axis(along).cross(along) };
    let across = sideways / sideways.length();
    Segment { along, across, length, section }
}

/// The axis of the world that a direction has least of.
fn least_axis(direction: DVec3) -> DVec3 {
    let DVec3 { x, y, z } = direction.abs();
    if y <= x && y <= z {
        DVec3::Y
    } else if x <= z {
        DVec3::X
    } else {
        DVec3::Z
    }
}

/// The section between two segments, in the plane that bisects them, stretched so that either keeps its full
/// section up to there. Exact where the path bends sideways or upwards; between, scale can only follow the
/// section's own axes.
fn mitre(a: &Segment, b: &Segment, middle: DVec3) -> Ring {
    let sum = a.along + b.along;
    let along = sum / sum.length();
    let across = a.across + b.across;
    let across = across - along * across.dot(along);
    let across = across / across.length();
    let up = along.cross(across);
    let bend = b.along - a.along;
    let cos = sum.length() / 2.0;
    // 1 + (1/c − 1) n² along an axis that has the part n of the bend's direction; |bend| = 2 sin(θ/2).
    let stretch = |unit: DVec3| 1.0 + unit.dot(bend) * unit.dot(bend) / (4.0 * cos * (1.0 + cos));
    let mean = |p: f64, q: f64| if p == q { p } else { (p + q) / 2.0 };
    let width = mean(a.section.width, b.section.width) * stretch(across);
    let height = mean(a.section.height, b.section.height) * stretch(up);
    Ring { middle, along, across, size: [width, height] }
}

/// The rotation from the specification's plane to that of the ring: X to the right, Y along, Z up.
fn turn(frame: &DMat3, ring: &Ring) -> [f64; 4] {
    let right = -ring.across;
    let wanted = DMat3::from_cols(right, ring.along, right.cross(ring.along));
    let q = DQuat::from_mat3(&(frame.transpose() * wanted));
    let q = if q.w < 0.0 { -q } else { q };
    let axis = q.xyz();
    let angle = rounded(2.0 * libm::atan2(axis.length(), q.w));
    if angle == 0.0 {
        return [0.0, 0.0, 1.0, 0.0];
    }
    let axis = axis / axis.length();
    [axis.x, axis.y, axis.z, angle]
}

/// Whether no corner of a counter-clockwise polygon turns to the right.
fn is_convex(outline: &[[f64; 2]]) -> bool {
    let count = outline.len();
    (0..count).all(|i| {
        let [a, b, c] = [i, i + 1, i + 2].map(|j| outline[j % count]);
        (b[0] - a[0]) * (c[1] - b[1]) - (c[0] - b[0]) * (b[1] - a[1]) >= 0.0
    })
}
