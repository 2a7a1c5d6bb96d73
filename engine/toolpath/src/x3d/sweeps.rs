//! Extrusions as triangles by number.
//!
//! Kept are the rings, not the triangles: where the cross-section's origin, X and Z axes come to lie at each spine
//! point, with scale and orientation in them. A corner of a triangle is then `origin + x·X + z·Z` of one ring, the
//! same bits in every triangle that has it, so a sweep with caps is closed exactly.
//!
//! An Extrusion that is shown several times is kept once.
//!
//! Beyond the specification's text:
//! - The first and last point of a cross-section up to [`scp::COINCIDENT`] apart are one, and so are those of
//!   a spine.
//! - Caps close the outline also where the cross-section is open; the sweep between its ends stays open.
//! - A transform that mirrors turns the triangles over, so that what is solid stays solid.
//! - A sweep that is closed, by its caps or by the ends of its spine, is a solid. It is turned over if it is inside out,
//!   by its own signed volume, whatever the order of its cross-section and `ccw` say: these decide which faces are
//!   drawn, and with `solid="false"` not even that.

use super::affine::rotation;
use super::cap;
use super::extrusion::{Extrusion, X3dItem};
use super::reader;
use super::report::X3dReport;
use super::scp;
use crate::error::{Error, Result};
use crate::progress::Progress;
use glam::{DAffine3, DMat3, DVec3};
use std::collections::HashMap;
use std::ops::Range;
use std::path::Path;

/// Most triangles of a file: a long outline along a long spine takes little text for very many.
const FACETS_MAX: u64 = u32::MAX as u64;

/// Triangles that are measured at a time.
const MEASURED: usize = 1 << 12;
/// Part of the sum of its tetrahedra that a volume must be, or else it is one by rounding only.
const NO_VOLUME: f64 = 1e-12;

/// The cross-section's place at one spine point.
#[derive(Clone, Copy, Debug)]
struct SpineFrame {
    origin: DVec3,
    x: DVec3,
    z: DVec3,
}

impl SpineFrame {
    /// Where a point of the cross-section comes to lie.
    fn at(&self, [x, z]: [f64; 2]) -> DVec3 {
        self.origin + self.x * x + self.z * z
    }
}

/// An outline and the triangles over it, as ranges of [`Sweeps::outlines`] and [`Sweeps::caps`].
#[derive(Clone, Debug)]
struct Section {
    points: Range<usize>,
    caps: Range<usize>,
}

/// One Extrusion.
#[derive(Clone, Debug)]
struct Tube {
    rings: Range<usize>,
    section: u32,
    begin_cap: bool,
    end_cap: bool,
    flipped: bool,
    def: Option<Box<str>>,
    line: u64,
}

/// One Extrusion where it shows.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PlacedExtrusion<'a> {
    /// Its DEF name.
    pub def: Option<&'a str>,
    /// Line of the file, from 1.
    pub line: u64,
    /// Its triangles, numbered within the file.
    pub facets: Range<u64>,
}

/// One Extrusion's place in the scene.
#[derive(Clone, Copy, Debug)]
struct SceneInstance {
    /// Number of its first triangle.
    first: u64,
    tube: u32,
    matrix: u32,
}

/// All sweeps of a file.
#[derive(Debug, Default)]
pub struct Sweeps {
    outlines: Vec<[f64; 2]>,
    caps: Vec<[u32; 3]>,
    sections: Vec<Section>,
    rings: Vec<SpineFrame>,
    /// One for each Extrusion, also for those of which nothing shows.
    tubes: Vec<Tube>,
    matrices: Vec<DAffine3>,
    /// In the file's order, only those with triangles.
    placed: Vec<SceneInstance>,
    facets: u64,
    report: X3dReport,
}

impl Sweeps {
    /// Reads `bytes`, the content of the X3D file `path`. Memory is a few times that of the text: 72 bytes for
    /// each spine point, whose text is some 20.
    ///
    /// # Errors
    /// As [`reader::read`]; also if nothing of the file shows, or it shows more than 4,294,967,295 triangles.
    pub fn read(path: &Path, bytes: &[u8], progress: &dyn Progress) -> Result<Sweeps> {
        let mut sweeps = Sweeps::default();
        let mut known = HashMap::new();
        let mut report = reader::read(path, bytes, progress, &mut |piece| {
            match piece {
                X3dItem::Extrusion(extrusion) => sweeps.add(extrusion, &mut known),
                X3dItem::Place { extrusion, to_scene } => sweeps.place(extrusion as usize, to_scene),
            }
            if sweeps.facets <= FACETS_MAX && sweeps.tubes.len() < u32::MAX as usize {
                return Ok(());
            }
            let what = format!("its sweeps have more than {FACETS_MAX} triangles");
            Err(Error::input(path, "file", what, "split it into several files"))
        })?;
        report.empty = sweeps.report.empty;
        report.empty_line = sweeps.report.empty_line;
        (report.turned, report.turned_line) = (sweeps.report.turned, sweeps.report.turned_line);
        sweeps.report = report;
        if sweeps.facets == 0 {
            return Err(sweeps.nothing(path));
        }
        sweeps.rings.shrink_to_fit();
        Ok(sweeps)
    }

    /// The error for a file that shows nothing.
    fn nothing(&self, path: &Path) -> Error {
        let mut warnings = self.report.warnings();
        let what = match warnings.len() {
            0 => "it shows no Extrusion".to_owned(),
            1 => format!("it shows no Extrusion that can be swept ({})", warnings.remove(0)),
            n => format!(
                "it shows no Extrusion that can be swept ({}, and {} more)",
                warnings.remove(0),
                n - 1
            ),
        };
        Error::input(path, "file", what, "export beads as Extrusion nodes, or the part as STL, OBJ or PLY")
    }

    /// Keeps one Extrusion.
    fn add(&mut self, extrusion: &Extrusion, known: &mut HashMap<Vec<u64>, u32>) {
        let start = self.rings.len();
        let spine: Vec<DVec3> = extrusion.spine.iter().map(|p| DVec3::from(*p)).collect();
        self.rings.reserve(spine.len());
        let one_or_own = |count: usize, i: usize| if count == 1 { 0 } else { i };
        let turns = &extrusion.orientation;
        let one_turn = (turns.len() == 1).then(|| rotation(turns[0]));
        let rings = &mut self.rings;
        let closed = scp::planes(&spine, |i, frame| {
            let turn = one_turn.unwrap_or_else(|| rotation(turns[i]));
            let axes: DMat3 = *frame * turn;
            let [x, z] = extrusion.scale[one_or_own(extrusion.scale.len(), i)];
            rings.push(SpineFrame { origin: spine[i], x: axes.x_axis * x, z: axes.z_axis * z });
        });
        if closed == Some(true) {
            let origin = self.rings[start].origin;
            let is_at_end = |ring: &&mut SpineFrame| ring.origin.distance(origin) <= scp::COINCIDENT;
            self.rings[start..].iter_mut().rev().take_while(is_at_end).for_each(|r| r.origin = origin);
        }
        let section = self.section(&extrusion.cross_section, known);
        let tube = Tube {
            rings: start..self.rings.len(),
            section,
            begin_cap: extrusion.begin_cap,
            end_cap: extrusion.end_cap,
            flipped: !extrusion.ccw,
            def: extrusion.def.as_deref().map(Box::from),
            line: extrusion.line,
        };
        if self.facets_of(&tube) == 0 {
            self.report.is_empty(extrusion.line);
        }
        let is_inside_out = self.is_inside_out(&tube);
        if is_inside_out {
            self.report.turn(extrusion.line);
        }
        self.tubes.push(Tube { flipped: tube.flipped != is_inside_out, ..tube });
    }

    /// Whether a sweep is a solid that faces inward.
    fn is_inside_out(&self, tube: &Tube) -> bool {
        if !self.is_closed(tube) {
            return false;
        }
        let origin = self.rings[tube.rings.start].origin;
        let (mut triangles, mut six_volumes, mut size) = (Vec::new(), 0.0, 0.0);
        let facets = self.facets_of(tube);
        for from in (0..facets).step_by(MEASURED) {
            triangles.clear();
            let range = from..facets.min(from + MEASURED as u64);
            self.append_tube(tube, DAffine3::IDENTITY, range, &mut triangles);
            for triangle in &triangles {
                let [a, b, c] = triangle.map(|corner| DVec3::from(corner) - origin);
                let term = a.dot(b.cross(c));
                six_volumes += term;
                size += f64::abs(term);
            }
        }
        six_volumes < -size * NO_VOLUME
    }

    /// Whether nothing of a sweep's surface is missing.
    fn is_closed(&self, tube: &Tube) -> bool {
        let outline = &self.outlines[self.sections[tube.section as usize].points.clone()];
        let rings = &self.rings[tube.rings.clone()];
        let ([first, .., last], true) = (rings, outline.first() == outline.last()) else { return false };
        let meet = || outline.iter().all(|&point| first.at(point) == last.at(point));
        match (tube.begin_cap, tube.end_cap) {
            (true, true) => true,
            (false, false) => meet(),
            _ => false,
        }
    }

    /// Keeps an outline and its cap once.
    fn section(&mut self, outline: &[[f64; 2]], known: &mut HashMap<Vec<u64>, u32>) -> u32 {
        let bits: Vec<u64> = outline.as_flattened().iter().map(|c| c.to_bits()).collect();
        let next = self.sections.len() as u32;
        let section = *known.entry(bits).or_insert(next);
        if section == next {
            let (points, caps) = (self.outlines.len(), self.caps.len());
            self.outlines.extend_from_slice(outline);
            let own = &mut self.outlines[points..];
            let mut corners = own.len();
            if let [first, .., last] = own
                && DVec3::new(first[0] - last[0], 0.0, first[1] - last[1]).length() <= scp::COINCIDENT
            {
                *last = *first;
                corners -= 1;
            }
            self.caps.extend(cap::triangles(&self.outlines[points..points + corners]));
            self.sections.push(Section { points: points..self.outlines.len(), caps: caps..self.caps.len() });
        }
        section
    }

    /// Shows one Extrusion.
    fn place(&mut self, extrusion: usize, to_scene: DAffine3) {
        let facets = self.facets_of(&self.tubes[extrusion]);
        if facets == 0 {
            return;
        }
        if self.matrices.last() != Some(&to_scene) {
            self.matrices.push(to_scene);
        }
        let matrix = self.matrices.len() as u32 - 1;
        self.placed.push(SceneInstance { first: self.facets, tube: extrusion as u32, matrix });
        self.facets = self.facets.saturating_add(facets);
    }

    /// Triangles of the sweep without its caps, and of one cap.
    fn parts_of(&self, tube: &Tube) -> (u64, u64) {
        let section = &self.sections[tube.section as usize];
        let segments = tube.rings.len().saturating_sub(1) as u64;
        let sides = section.points.len().saturating_sub(1) as u64;
        let caps = if segments == 0 { 0 } else { section.caps.len() as u64 };
        (segments.saturating_mul(sides).saturating_mul(2), caps)
    }

    fn facets_of(&self, tube: &Tube) -> u64 {
        let (sides, cap) = self.parts_of(tube);
        sides.saturating_add(cap * (u64::from(tube.begin_cap) + u64::from(tube.end_cap)))
    }

    /// Number of triangles. The quadrilaterals between two rings are split alike everywhere, also where
    /// rings coincide, so some have no area; they cancel.
    pub fn facets(&self) -> u64 {
        self.facets
    }

    /// The Extrusions that show, in the order of the file; one that shows several times is there as often.
    pub fn shapes(&self) -> impl Iterator<Item = PlacedExtrusion<'_>> {
        self.placed.iter().enumerate().map(|(number, placed)| {
            let end = self.placed.get(number + 1).map_or(self.facets, |next| next.first);
            let Tube { def, line, .. } = &self.tubes[placed.tube as usize];
            PlacedExtrusion { def: def.as_deref(), line: *line, facets: placed.first..end }
        })
    }

    /// What was read and what was left out.
    pub fn report(&self) -> &X3dReport {
        &self.report
    }

    /// Memory taken.
    pub fn heap_bytes(&self) -> u64 {
        let bytes = self.outlines.capacity() * size_of::<[f64; 2]>()
            + self.caps.capacity() * size_of::<[u32; 3]>()
            + self.sections.capacity() * size_of::<Section>()
            + self.rings.capacity() * size_of::<SpineFrame>()
            + self.tubes.capacity() * size_of::<Tube>()
            + self.tubes.iter().filter_map(|tube| tube.def.as_ref()).map(|def| def.len()).sum::<usize>()
            + self.matrices.capacity() * size_of::<DAffine3>()
            + self.placed.capacity() * size_of::<SceneInstance>();
        bytes as u64
    }

    /// Appends the triangles of `range`, numbered from 0, to `out`; what lies beyond [`Self::facets`] is left
    /// out. They are the same however the ranges are cut.
    pub fn append(&self, range: Range<u64>, out: &mut Vec<[[f64; 3]; 3]>) {
        let end = range.end.min(self.facets);
        let mut at = range.start.min(end);
        let mut number = self.placed.partition_point(|p| p.first <= at).saturating_sub(1);
        while at < end {
            let placed = self.placed[number];
            number += 1;
            let after = self.placed.get(number).map_or(self.facets, |next| next.first).min(end);
            self.append_placed(&placed, at - placed.first..after - placed.first, out);
            at = after;
        }
    }

    /// Triangles of one sweep in its place, numbered within it.
    fn append_placed(&self, placed: &SceneInstance, range: Range<u64>, out: &mut Vec<[[f64; 3]; 3]>) {
        let matrix = self.matrices[placed.matrix as usize];
        self.append_tube(&self.tubes[placed.tube as usize], matrix, range, out);
    }

    /// Triangles of one sweep where `matrix` puts it, numbered within it: segment by segment, then the caps.
    fn append_tube(&self, tube: &Tube, matrix: DAffine3, range: Range<u64>, out: &mut Vec<[[f64; 3]; 3]>) {
        let section = &self.sections[tube.section as usize];
        let rings = &self.rings[tube.rings.clone()];
        let outline = &self.outlines[section.points.clone()];
        let moves = matrix != DAffine3::IDENTITY;
        let corner = |ring: &SpineFrame, point: [f64; 2]| -> [f64; 3] {
            let local = ring.at(point);
            if moves { matrix.transform_point3(local).into() } else { local.into() }
        };
        let flipped = tube.flipped != (matrix.matrix3.determinant() < 0.0);
        let mut push = |[a, b, c]: [[f64; 3]; 3]| out.push(if flipped { [a, c, b] } else { [a, b, c] });

        let (sides_total, cap_total) = self.parts_of(tube);
        let per_segment = (outline.len() as u64 - 1) * 2;
        let mut at = range.start;
        while at < range.end.min(sides_total) {
            let (segment, offset) = ((at / per_segment) as usize, at % per_segment);
            let last = (offset + (range.end.min(sides_total) - at)).min(per_segment);
            let (from, to) = (&rings[segment], &rings[segment + 1]);
            let first_side = (offset / 2) as usize;
            let (mut a, mut d) = (corner(from, outline[first_side]), corner(to, outline[first_side]));
            for side in first_side..last.div_ceil(2) as usize {
                let (b, c) = (corner(from, outline[side + 1]), corner(to, outline[side + 1]));
                if offset <= side as u64 * 2 {
                    push([a, b, c]);
                }
                if side as u64 * 2 + 1 < last {
                    push([a, c, d]);
                }
                (a, d) = (b, c);
            }
            at += last - offset;
        }
        let ends = [(tube.begin_cap, rings.first(), true), (tube.end_cap, rings.last(), false)];
        let mut first = sides_total;
        for (_, ring, begins) in ends.into_iter().filter(|end| end.0) {
            let cut = |at: u64| at.clamp(first, first + cap_total) - first;
            let wanted = cut(range.start) as usize..cut(range.end) as usize;
            for &triangle in &self.caps[section.caps.clone()][wanted] {
                let Some(ring) = ring else { continue };
                let [a, b, c] = triangle.map(|v| corner(ring, outline[v as usize]));
                push(if begins { [a, c, b] } else { [a, b, c] });
            }
            first += cap_total;
        }
    }
}
