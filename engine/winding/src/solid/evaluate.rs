//! Samples of one brick from the segments that touch it.
//!
//! A row of samples is a word of bits. The rows of a pass's segments are united, then added to bit-sliced
//! counters: plane p holds bit p of w for every sample. So w counts passes, and a pass's own joints and corners
//! count once. Where beads are counted, a pass is a bead as a whole.

use super::brick_lattice::{BrickLattice, RowSpan, SegmentList};
use super::hermite::{BrickSegments, HermiteScratch};
use super::hidden;
use super::segment::Segment;
use super::segments::Solids;
use crate::brick::{Brick, Hermite, Samples, SignChanges, ThinFeatures, ThinLines};
use crate::error::{Error, Result};
use crate::lattice::{Axis, BRICK_POINTS, NodeKey};

/// Samples along a row.
const P: usize = BRICK_POINTS;
/// Rows of a brick.
const ROWS: usize = P * P;
/// Planes of the counters: w ≤ 32,767.
const PLANES_MAX: usize = 15;

/// Working memory for evaluating bricks one after the other; one per thread.
#[derive(Default)]
pub struct SolidEvaluator {
    /// Positions in the brick's list, pass by pass.
    order: Vec<u32>,
    spans: Vec<RowSpan>,
    /// Samples of the pass at hand, by row; all zero between passes.
    pass: Vec<u64>,
    /// What the next pass, by its number, has in common with the one at hand at their joint: rows, and samples as bits.
    next_joint: (u32, Vec<(u16, u64)>),
    /// The same of the pass at hand and the one before.
    joint: (u32, Vec<(u16, u64)>),
    /// Rows that the pass at hand meets.
    touched: Vec<u16>,
    /// Counters: plane by plane, each a word a row.
    planes: Vec<[u64; ROWS]>,
    boundary: HermiteScratch,
}

/// The samples of one brick, and its spans until the evaluator is used again.
pub struct SolidEvaluation<'a> {
    /// For each of the 33³ samples, how many passes cover it.
    pub samples: Samples,
    signs: SignChanges,
    lattice: BrickLattice,
    solids: &'a Solids,
    list: SegmentList<'a>,
    evaluator: &'a mut SolidEvaluator,
}

impl SolidEvaluator {
    /// Evaluates the 33³ samples of `key` from all segments that touch the closed cube from sample 0 to
    /// sample 32; others are ignored.
    ///
    /// # Errors
    /// [`Error::Setting`] if more than 32,767 passes cover a sample.
    pub fn evaluate<'a>(
        &'a mut self,
        solids: &'a Solids,
        key: NodeKey,
        list: SegmentList<'a>,
    ) -> Result<SolidEvaluation<'a>> {
        let lattice = BrickLattice::of(key);
        self.spans.clear();
        self.planes.clear();
        self.pass.resize(ROWS, 0);
        self.order.clear();
        self.order.extend(0..list.indices.len() as u32);
        self.order.sort_by_key(|&position| list.get(position).pass);
        let order = std::mem::take(&mut self.order);
        let mut fits = true;
        for pass in order.chunk_by(|&p, &q| list.get(p).pass == list.get(q).pass) {
            for &position in pass {
                self.fill(solids, lattice, list.get(position), position);
            }
            let number = pass.first().map_or(0, |&position| list.get(position).pass);
            // Of all that the pass covers: what its own joint takes off it may belong to the next one's, too.
            if let Some(joint) = number.checked_add(1).and_then(|next| solids.joint(next)) {
                self.keep_joint(solids, lattice, joint);
            }
            self.take_joint(number);
            fits &= self.count();
        }
        self.order = order;
        if !fits {
            return Err(Error::setting(
                format!("more than {} passes of beads overlap in brick {key}", i16::MAX),
                "remove repeated layers from the toolpath",
            ));
        }
        let mut samples = Samples::filled(0);
        let mut signs = SignChanges::outside();
        self.expand(&mut samples, &mut signs);
        Ok(SolidEvaluation { samples, signs, lattice, solids, list, evaluator: self })
    }

    /// Adds the rows of a segment to those of its pass.
    fn fill(&mut self, solids: &Solids, lattice: BrickLattice, segment: &Segment, position: u32) {
        for_rows(solids, lattice, segment, |row, interval| {
            self.add_span(lattice, segment, position, row, interval);
        });
    }

    /// Keeps what the pass at hand has in common with the round end where the next one begins.
    fn keep_joint(&mut self, solids: &Solids, lattice: BrickLattice, joint: &Segment) {
        self.next_joint.0 = joint.pass;
        for_rows(solids, lattice, joint, |row, interval| {
            if let Some((first, end)) = samples_of(lattice, joint, interval) {
                let mask = (1u64 << end) - (1 << first);
                self.next_joint.1.push((row as u16, mask & self.pass[row]));
            }
        });
    }

    /// Takes off the pass at hand what it has in common with the one before at their joint; what was kept for the next pass
    /// takes that place.
    fn take_joint(&mut self, pass: u32) {
        let of_pass = self.joint.0 == pass;
        for (row, mask) in self.joint.1.drain(..).filter(|_| of_pass) {
            self.pass[usize::from(row)] &= !mask;
        }
        std::mem::swap(&mut self.joint, &mut self.next_joint);
    }

    /// The rule that decides every sample: inside from the first end of its row's interval, itself included,
    /// to the last, itself excluded.
    #[inline]
    fn add_span(
        &mut self,
        lattice: BrickLattice,
        segment: &Segment,
        position: u32,
        row: usize,
        interval: (f64, f64),
    ) {
        if let Some((first, end)) = samples_of(lattice, segment, interval) {
            let span = RowSpan { position, row: row as u16, first, end, interval };
            if self.pass[row] == 0 {
                self.touched.push(row as u16);
            }
            self.pass[row] |= span.mask();
            self.spans.push(span);
        }
    }

    /// Adds the pass at hand to the counters and forgets it; false if a counter overflows.
    fn count(&mut self) -> bool {
        let mut fits = true;
        for row in self.touched.drain(..).map(usize::from) {
            let mut carry = std::mem::take(&mut self.pass[row]);
            for plane in 0.. {
                if carry == 0 {
                    break;
                }
                if plane == self.planes.len() {
                    if plane == PLANES_MAX {
                        fits = false;
                        break;
                    }
                    self.planes.push([0; ROWS]);
                }
                let word = &mut self.planes[plane][row];
                (*word, carry) = (*word ^ carry, *word & carry);
            }
        }
        fits
    }

    /// The counters as numbers, stepping from change to change.
    fn expand(&self, samples: &mut Samples, signs: &mut SignChanges) {
        for row in 0..ROWS {
            let inside = self.planes.iter().fold(0, |bits, plane| bits | plane[row]);
            if inside == 0 {
                continue;
            }
            signs.set_row(row % P, row / P, inside);
            // Bit i is set where sample i differs from the one before; that before the first is 0.
            let mut changes = self.planes.iter().fold(0, |bits, plane| bits | (plane[row] ^ plane[row] << 1));
            changes &= (1 << P) - 1;
            while changes != 0 {
                let i = changes.trailing_zeros() as usize;
                changes &= changes - 1;
                let bit = |(p, plane): (usize, &[u64; ROWS])| (plane[row] >> i & 1) << p;
                let w = self.planes.iter().enumerate().map(bit).sum::<u64>() as i16;
                samples.0[row * P + i..(row + 1) * P].fill(w);
            }
        }
    }
}

/// Calls `each` with the rows, k·33 + j, that meet a segment's solid, and the interval of each, relative to the segment's
/// first end.
#[inline]
fn for_rows(
    solids: &Solids,
    lattice: BrickLattice,
    segment: &Segment,
    mut each: impl FnMut(usize, (f64, f64)),
) {
    let body = solids.body(segment);
    let bounds = solids.bounds(segment);
    let js = lattice.within(1, bounds);
    for k in lattice.within(2, bounds) {
        let z = lattice.offset(segment.a, 2, k);
        let half_width = match body.is_flat().then(|| body.half_width_at(z)) {
            Some(None) => continue,
            Some(half_width) => half_width,
            None => None,
        };
        for j in js.clone() {
            let y = lattice.offset(segment.a, 1, j);
            let interval = match half_width {
                Some(half_width) => body.flat_line([0, 1], half_width, y),
                None => body.line(0, [0.0, y, z]),
            };
            if let Some(interval) = interval {
                each(k * P + j, interval);
            }
        }
    }
}

/// Calls `each` with the rows (j, k) of a brick's samples that a segment's solid covers, and these samples as bits.
#[inline]
pub fn for_samples(solids: &Solids, key: NodeKey, segment: &Segment, mut each: impl FnMut([usize; 2], u64)) {
    let lattice = BrickLattice::of(key);
    for_rows(solids, lattice, segment, |row, interval| {
        if let Some((first, end)) = samples_of(lattice, segment, interval) {
            each([row % P, row / P], (1 << end) - (1 << first));
        }
    });
}

/// The first sample of a row in an interval relative to the segment's first end, and the first one beyond.
#[inline]
fn samples_of(lattice: BrickLattice, segment: &Segment, interval: (f64, f64)) -> Option<(u8, u8)> {
    let first = lattice.first_from(segment, 0, interval.0) as u8;
    let end = lattice.first_from(segment, 0, interval.1) as u8;
    (first < end).then_some((first, end))
}

impl SolidEvaluation<'_> {
    /// Whether a pass or a gap between passes lies between two samples of a lattice edge.
    #[inline]
    pub fn has_hidden_crossings(&mut self) -> bool {
        Axis::ALL.iter().any(|axis| hidden::crossings(self.solids, self.lattice, self.list, axis.index()))
    }

    /// Whether the boundary of the union crosses a lattice edge more than once.
    #[inline]
    pub fn has_hidden_boundary(&mut self) -> bool {
        Axis::ALL.iter().any(|axis| hidden::boundary(self.solids, self.lattice, self.list, axis.index()))
    }

    /// The walls and gaps of the union that lie between two samples: on all lines those of the apron too, else on the edges
    /// that the brick owns.
    #[inline]
    pub fn thin(&self, lines: ThinLines) -> ThinFeatures {
        let mut thin = ThinFeatures::default();
        for axis in Axis::ALL {
            hidden::add_thin(self.solids, self.lattice, self.list, axis, lines, &mut thin);
        }
        thin.of_all(lines)
    }

    /// Turns the samples into a leaf's brick with its Hermite edges.
    #[inline]
    pub fn into_leaf(self) -> Brick {
        let SolidEvaluation { samples, signs, lattice, solids, list, evaluator } = self;
        let first = samples.0[0];
        if samples.0.iter().all(|&w| w == first) {
            return Brick::Uniform(first);
        }
        let SolidEvaluator { spans, boundary, .. } = evaluator;
        let edges = boundary.edges(BrickSegments { lattice, solids, list }, &signs, spans);
        Brick::Counts { samples, hermite: Hermite { edges } }
    }
}
