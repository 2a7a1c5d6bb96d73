//! Streams beads to a binary STL: the toolpath may be of any length, its triangles are never held together.

use super::sweep::Sweep;
use super::swept::SweptToolpath;
use super::tube::Joints;
use crate::error::{Error, Result};
use crate::part::PartFile;
use crate::progress::Progress;
use crate::toolpath::{BeadView, Toolpath};
use glam::DVec3;
use rayon::prelude::*;
use std::ops::Range;
use std::path::Path;

/// Bytes of text before the count.
const TITLE_BYTES: usize = 80;
/// Bytes of a facet: normal, three corners, two bytes without meaning.
const FACET_BYTES: usize = 50;
const TITLE: &[u8] = b"binary STL of beads in mm, written by Brickfield";
/// Points gathered before they are swept: a quarter of a million triangles, so that threads have enough to
/// share, in half a megabyte.
const POINTS_AT_ONCE: usize = 1 << 13;
/// Triangles that a thread sweeps at once: 400 KiB of records, within an L2 cache.
const FACETS_AT_ONCE: u64 = 1 << 13;
/// Pieces swept before they are written.
const PIECES_AT_ONCE: usize = 32;
/// A bead's width and height must have at least this many steps of 32-bit coordinates where it lies; fewer
/// would dent it by more than a per cent.
const STEPS_MIN: f64 = 100.0;

/// An STL file that takes beads one by one.
pub struct StlBeads {
    sweep: Sweep,
    part: PartFile,
    batch: Toolpath,
    batch_points: usize,
    /// What volumes are measured from: the first point of all.
    origin: Option<[f64; 3]>,
    /// The pieces that are swept at once, each with its signed volume.
    pieces: Vec<(Vec<u8>, f64)>,
    written: StlSummary,
}

/// What was written.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize)]
pub struct StlSummary {
    /// Beads taken.
    pub beads: u64,
    /// Their segments.
    pub segments: u64,
    /// Closed surfaces.
    pub tubes: u64,
    /// Triangles.
    pub facets: u64,
    /// Size of the file.
    pub bytes: u64,
    /// How segments were joined.
    pub joints: Joints,
    /// Volume of the beads as slicers reckon it, without caps.
    pub bead_volume: f64,
    /// Sum of the volumes that the closed surfaces enclose: caps count, and what overlaps counts repeatedly.
    pub swept_volume: f64,
}

impl StlBeads {
    /// Begins the file; it gets its name when it is finished.
    ///
    /// # Errors
    /// If it cannot be created, or another process is writing it.
    pub fn create(path: &Path, sweep: Sweep) -> Result<StlBeads> {
        StlBeads::new(PartFile::create(path)?, sweep)
    }

    /// As [`StlBeads::create`].
    pub(super) fn new(mut part: PartFile, sweep: Sweep) -> Result<StlBeads> {
        let mut header = [b' '; TITLE_BYTES + 4];
        header[..TITLE.len()].copy_from_slice(TITLE);
        header[TITLE_BYTES..].fill(0);
        part.append(&header)?;
        let written = StlSummary { bytes: header.len() as u64, ..StlSummary::default() };
        Ok(StlBeads {
            sweep,
            part,
            batch: Toolpath::default(),
            batch_points: 0,
            origin: None,
            pieces: vec![Default::default(); PIECES_AT_ONCE],
            written,
        })
    }

    /// Takes a bead.
    ///
    /// # Errors
    /// If the file would have more than 2^32 − 1 triangles or the bead lies so far from the origin that 32-bit
    /// coordinates cannot show it; if writing fails or the user interrupts.
    pub fn push(&mut self, bead: BeadView<'_>, progress: &dyn Progress) -> Result<()> {
        self.require_resolution(&bead)?;
        self.written.beads += 1;
        self.written.segments += bead.sections.len() as u64;
        self.written.bead_volume += self.sweep.volume(&bead);
        self.origin = self.origin.or(bead.points.first().copied());
        self.batch_points += bead.points.len();
        self.batch.push(bead);
        if self.batch_points < POINTS_AT_ONCE { Ok(()) } else { self.flush(progress) }
    }

    fn require_resolution(&self, bead: &BeadView<'_>) -> Result<()> {
        let farthest = bead.points.as_flattened().iter().fold(0.0f64, |m, c| m.max(c.abs()));
        let sizes = bead.sections.iter().map(|s| s.width.min(s.height));
        let least = sizes.fold(f64::INFINITY, f64::min);
        if farthest * f64::from(f32::EPSILON) * STEPS_MIN <= least {
            return Ok(());
        }
        let line = bead.attributes.lines.0;
        Err(Error::setting(
            format!(
                "the bead of line {line} is {least} mm thin and {farthest} mm from the origin: the 32 bits of an \
                 STL coordinate cannot show it"
            ),
            "move the part nearer to the origin",
        ))
    }

    /// Sweeps and writes what has been gathered.
    fn flush(&mut self, progress: &dyn Progress) -> Result<()> {
        let swept = SweptToolpath::new(std::mem::take(&mut self.batch), self.sweep.clone());
        self.batch_points = 0;
        let facets = self.written.facets + swept.facets();
        if facets > u64::from(u32::MAX) {
            return Err(Error::setting(
                format!("{}: an STL file cannot hold more than 2^32 - 1 facets", self.part.path().display()),
                "choose fewer `sides`, write .x3d, or write parts of the toolpath to several files",
            ));
        }
        let origin = DVec3::from(self.origin.unwrap_or_default());
        let starts: Vec<u64> = (0..swept.facets()).step_by(FACETS_AT_ONCE as usize).collect();
        for group in starts.chunks(PIECES_AT_ONCE) {
            progress.check()?;
            group.par_iter().zip(&mut self.pieces).for_each(|(&start, (records, volume))| {
                *volume = encode(&swept, start..start + FACETS_AT_ONCE, origin, records);
            });
            for (records, volume) in &self.pieces[..group.len()] {
                self.part.append(records)?;
                self.written.bytes += records.len() as u64;
                self.written.swept_volume += volume;
            }
        }
        self.written.facets = facets;
        self.written.tubes += swept.tubes();
        self.written.joints += swept.joints();
        Ok(())
    }

    /// Writes the rest and the count, and gives the file its name.
    ///
    /// # Errors
    /// If writing fails or the user interrupts.
    pub fn finish(mut self, progress: &dyn Progress) -> Result<StlSummary> {
        self.flush(progress)?;
        self.part.overwrite(TITLE_BYTES as u64, &(self.written.facets as u32).to_le_bytes())?;
        self.part.finish()?;
        Ok(self.written)
    }
}

/// Replaces `out` by the records of the triangles of `range`, and returns their part of the volume: the sum
/// over the cones from them to `origin`.
fn encode(swept: &SweptToolpath, range: Range<u64>, origin: DVec3, out: &mut Vec<u8>) -> f64 {
    out.clear();
    out.reserve(FACET_BYTES * FACETS_AT_ONCE as usize);
    let mut six_volumes = 0.0;
    swept.for_facets(range, |[a, b, c]| {
        let normal = (b - a).cross(c - a);
        six_volumes += (a - origin).dot(normal);
        let length = normal.length();
        let normal = if length > 0.0 { normal / length } else { DVec3::ZERO };
        let mut record = [0; FACET_BYTES];
        for (vector, bytes) in [normal, a, b, c].iter().zip(record.as_chunks_mut::<12>().0) {
            for (value, bytes) in vector.to_array().iter().zip(bytes.as_chunks_mut::<4>().0) {
                *bytes = (*value as f32).to_le_bytes();
            }
        }
        out.extend_from_slice(&record);
    });
    six_volumes / 6.0
}
