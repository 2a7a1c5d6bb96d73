//! The brick of a chain of bricks: samples, and crossings that are all one of an operand's.

use super::chain::Operation;
use crate::brick::{Brick, Hermite, HermiteEdge, Samples, SignChanges};
use crate::lattice::{Axis, BRICK_CELLS, BRICK_POINTS};

/// Samples along a row.
const P: usize = BRICK_POINTS;
/// Bits of a whole row.
const ALL: u64 = (1 << P) - 1;
/// Bits of the samples that a brick owns.
const OWN: u64 = (1 << BRICK_CELLS) - 1;

/// What hides within edges of which both ends agree.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize)]
pub struct HiddenCrossings {
    /// Edges in which a wall lies that is thinner than the edge.
    pub walls: u64,
    /// Edges in which a gap lies.
    pub gaps: u64,
}

impl HiddenCrossings {
    pub(super) fn add(&mut self, other: HiddenCrossings) {
        self.walls += other.walls;
        self.gaps += other.gaps;
    }
}

/// An operand of a brick.
pub(super) struct BrickOperand<'a> {
    pub operation: Operation,
    pub content: Content<'a>,
}

/// What an operand is within the brick.
pub(super) enum Content<'a> {
    All(bool),
    Samples { signs: SignChanges, edges: &'a [Vec<HermiteEdge>; 3] },
}

impl<'a> Content<'a> {
    pub fn of(brick: &'a Brick) -> Content<'a> {
        match brick {
            Brick::Uniform(w) => Content::All(*w >= 1),
            Brick::Counts { samples, hermite } => {
                Content::Samples { signs: SignChanges::of(samples), edges: &hermite.edges }
            }
        }
    }

    fn row(&self, j: usize, k: usize) -> u64 {
        match self {
            Content::All(inside) => ALL * u64::from(*inside),
            Content::Samples { signs, .. } => signs.row(j, k),
        }
    }

    fn edges(&self, axis: Axis, j: usize, k: usize) -> u64 {
        match self {
            Content::All(_) => 0,
            Content::Samples { signs, .. } => signs.edges(axis, j, k),
        }
    }
}

/// Both ends of an edge, and what crosses it if they differ.
#[derive(Clone, Copy)]
struct Ends {
    low: bool,
    high: bool,
    at: Option<HermiteEdge>,
}

impl Ends {
    fn complement(self) -> Ends {
        Ends { low: !self.low, high: !self.high, at: self.at }
    }

    /// What is in both. `hides` is told whether there is some between ends that are both outside.
    fn and(self, other: Ends, hides: &mut bool) -> Ends {
        let (low, high) = (self.low && other.low, self.high && other.high);
        let at = match (self.at, other.at) {
            (Some(a), Some(b)) if low == high => {
                let (enters, leaves) = if self.low { (b, a) } else { (a, b) };
                *hides |= enters.offset < leaves.offset;
                None
            }
            // Both leave: the first; both enter: the last.
            (Some(a), Some(b)) => {
                Some(if (b.offset < a.offset) == low && a.offset != b.offset { b } else { a })
            }
            (Some(a), None) => (low != high).then_some(a),
            (None, b) => b.filter(|_| low != high),
        };
        Ends { low, high, at }
    }
}

/// The brick of a chain; `counts` are the samples of the first operand where they are to be kept.
pub(super) fn combine(
    terms: &[BrickOperand<'_>],
    counts: Option<&Brick>,
    hidden: &mut HiddenCrossings,
) -> Brick {
    let mut signs = SignChanges::outside();
    for k in 0..P {
        for j in 0..P {
            let bits = terms.iter().enumerate().fold(0, |bits, (n, term)| {
                let row = term.content.row(j, k);
                if n == 0 { row } else { term.operation.of(bits, row) }
            });
            signs.set_row(j, k, bits & ALL);
        }
    }
    let edges = Axis::ALL.map(|axis| crossings(terms, &signs, axis, hidden));
    let mut samples = Samples::filled(0);
    for (row, ws) in samples.0.chunks_exact_mut(P).enumerate() {
        let bits = signs.row(row % P, row / P);
        for (i, w) in ws.iter_mut().enumerate().filter(|(i, _)| bits >> i & 1 == 1) {
            *w = counts.map_or(1, |first| first.sample([i, row % P, row / P]).max(1));
        }
    }
    Brick::from_samples(samples, Hermite { edges })
}

/// The crossings along an axis of the edges that change sign in the result.
fn crossings(
    terms: &[BrickOperand<'_>],
    signs: &SignChanges,
    axis: Axis,
    hidden: &mut HiddenCrossings,
) -> Vec<HermiteEdge> {
    let mut made = Vec::new();
    // Crossings of each operand in the rows before.
    let mut before = vec![0usize; terms.len()];
    let mut changes = vec![0u64; terms.len()];
    for row in 0..P * P {
        let (j, k) = (row % P, row / P);
        let (mut any, mut several) = (0, 0);
        for (change, term) in changes.iter_mut().zip(terms) {
            *change = term.content.edges(axis, j, k);
            several |= any & *change;
            any |= *change;
        }
        if any == 0 {
            continue;
        }
        let result = signs.edges(axis, j, k);
        // What hides in an edge of the apron is told by the brick that owns it.
        let owned = if j < BRICK_CELLS && k < BRICK_CELLS { OWN } else { 0 };
        let mut bits = result | (several & owned);
        while bits != 0 {
            let i = bits.trailing_zeros() as usize;
            bits &= bits - 1;
            let place = Place { axis, ijk: [i, j, k], before: &before, changes: &changes };
            let is_owned = owned >> i & 1 == 1;
            let at = match several >> i & 1 {
                0 => changes.iter().position(|c| c >> i & 1 == 1).and_then(|n| place.crossing(terms, n)),
                _ => place.fold(terms, is_owned.then_some(&mut *hidden)),
            };
            if result >> i & 1 == 1 {
                made.extend(at);
            }
        }
        before.iter_mut().zip(&changes).for_each(|(before, c)| *before += c.count_ones() as usize);
    }
    made
}

/// An edge of a brick, and where to find its crossings.
struct Place<'a> {
    axis: Axis,
    ijk: [usize; 3],
    before: &'a [usize],
    changes: &'a [u64],
}

impl Place<'_> {
    /// The crossing of an operand that changes here, as the result has it.
    fn crossing(&self, terms: &[BrickOperand<'_>], number: usize) -> Option<HermiteEdge> {
        let below = self.changes[number] & ((1 << self.ijk[0]) - 1);
        let term = &terms[number];
        let Content::Samples { edges, .. } = &term.content else { return None };
        let edge = *edges[self.axis.index()].get(self.before[number] + below.count_ones() as usize)?;
        let is_taken_off = number > 0 && term.operation == Operation::Minus;
        Some(if is_taken_off { HermiteEdge { normal: edge.normal.flipped(), ..edge } } else { edge })
    }

    /// The crossing of the chain.
    fn fold(
        &self,
        terms: &[BrickOperand<'_>],
        mut hidden: Option<&mut HiddenCrossings>,
    ) -> Option<HermiteEdge> {
        let [i, j, k] = self.ijk;
        let (mut j1, mut k1, mut i1) = (j, k, i);
        match self.axis {
            Axis::X => i1 += 1,
            Axis::Y => j1 += 1,
            Axis::Z => k1 += 1,
        }
        let ends = |number: usize| {
            let content = &terms[number].content;
            let at = (self.changes[number] >> i & 1 == 1).then(|| self.crossing(terms, number)).flatten();
            let bit = |i: usize, j: usize, k: usize| content.row(j, k) >> i & 1 == 1;
            Ends { low: bit(i, j, k), high: bit(i1, j1, k1), at }
        };
        let mut all = ends(0);
        for (number, term) in terms.iter().enumerate().skip(1) {
            let (operand, mut hides) = (ends(number), false);
            all = match term.operation {
                Operation::And => all.and(operand, &mut hides),
                Operation::Minus => all.and(operand.complement(), &mut hides),
                Operation::Plus => all.complement().and(operand.complement(), &mut hides).complement(),
            };
            if let (true, Some(hidden)) = (hides, hidden.as_deref_mut()) {
                let of = if term.operation == Operation::Plus { &mut hidden.gaps } else { &mut hidden.walls };
                *of += 1;
            }
        }
        all.at
    }
}
