//! What is summed of a component: samples, chords between exact crossings with their moments, the Euler number, the box.
//!
//! All sums are integers, so the order of adding changes nothing. Positions count in [`PARTS`] of a lattice unit, which is
//! what an offset of a Hermite edge is exact to at the deepest level.

use super::components::Components;
use crate::brick::{Brick, Hermite, HermiteEdge, SignChanges};
use crate::lattice::{Axis, BRICK_CELLS, BRICK_POINTS, NodeKey, RootCube};
use crate::wide::{dispatch, level};

/// log₂ of the steps of a lattice edge in which crossings are told.
const STEP_BITS: u32 = 16;
/// log₂ of the parts of a unit in which positions count.
const PART_BITS: u32 = 13;
/// Parts of a unit.
pub(super) const PARTS: f64 = (1u32 << PART_BITS) as f64;
/// The samples of a row that a brick owns.
const OWN: u64 = (1 << BRICK_CELLS) - 1;
/// All samples of a row.
const ALL: u64 = (1 << BRICK_POINTS) - 1;
/// A lattice edge, in steps.
const EDGE: i64 = 1 << STEP_BITS;
/// Half of an edge, where a brick does not say where it is crossed.
const MIDDLE: u16 = 1 << (STEP_BITS - 1);

/// Sums over a component, for any part of it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Sums {
    /// Volume of the cells of its samples, in cubic units.
    pub samples: u128,
    /// Chords along each axis times the square of their lines' distance, in cubic units of which one side is in parts.
    pub chords: [i128; 3],
    /// Twice the first moments of all of these, by coordinate, with another side in parts.
    pub moments: [i128; 3],
    /// Samples less edges between them, plus faces, less cells.
    pub euler: i64,
    /// Crossings whose ends outside belong to it.
    pub crossings: u64,
    /// Least coordinates of its chords, in parts.
    pub low: [i64; 3],
    /// Greatest coordinates of its chords, in parts.
    pub high: [i64; 3],
}

impl Default for Sums {
    fn default() -> Sums {
        Sums {
            samples: 0,
            chords: [0; 3],
            moments: [0; 3],
            euler: 0,
            crossings: 0,
            low: [i64::MAX; 3],
            high: [i64::MIN; 3],
        }
    }
}

impl Sums {
    /// Adds those of another part.
    pub fn add(&mut self, other: &Sums) {
        self.samples += other.samples;
        self.euler += other.euler;
        self.crossings += other.crossings;
        for a in 0..3 {
            self.chords[a] += other.chords[a];
            self.moments[a] += other.moments[a];
            self.low[a] = self.low[a].min(other.low[a]);
            self.high[a] = self.high[a].max(other.high[a]);
        }
    }

    /// Volumes by the chords along each axis, in the cube of the root's unit.
    pub fn volumes(&self, root: RootCube) -> [f64; 3] {
        self.chords.map(|chords| chords as f64 / PARTS * root.unit().powi(3))
    }

    /// Volume by counting samples.
    pub fn counted(&self, root: RootCube) -> f64 {
        self.samples as f64 * root.unit().powi(3)
    }

    /// The centroid by the chords along all axes, in lattice units; `None` without any.
    pub fn centroid(&self) -> Option<[f64; 3]> {
        let total: i128 = self.chords.iter().sum();
        // Moments are twice and have two sides in parts, chords have one; the first sample stands at (1, 1, 1).
        (total > 0).then(|| self.moments.map(|moment| moment as f64 / total as f64 / (2.0 * PARTS) + 1.0))
    }
}

/// Sums of one component in a brick, in edges, samples and steps of the brick.
#[derive(Clone, Default)]
struct Local {
    samples: i64,
    /// By axis of the chords.
    lengths: [i64; 3],
    /// Twice the first moments in steps, by coordinate, of chords along all axes.
    moments: [i64; 3],
    euler: i64,
    crossings: u64,
    low: [i64; 3],
    high: [i64; 3],
}

impl Local {
    fn new() -> Local {
        Local { low: [i64::MAX; 3], high: [i64::MIN; 3], ..Local::default() }
    }

    /// A chord along x from one place to another, on the line through a sample. Of the box its ends alone count: the line is that of
    /// a sample, which sees to the rest.
    #[inline(always)]
    fn chord_along_x(&mut self, from: i64, to: i64, [j, k]: [usize; 2]) {
        let (length, line) = (to - from, [j, k].map(|at| (at as i64) << STEP_BITS));
        self.lengths[0] += length;
        self.moments[0] += to * to - from * from;
        self.moments[1] += 2 * length * line[0];
        self.moments[2] += 2 * length * line[1];
        self.low[0] = self.low[0].min(from);
        self.high[0] = self.high[0].max(to);
    }

    /// The edges along y and z from samples of a row of which the first and the last stand at these places along x, all of them
    /// as if they were not crossed.
    #[inline(always)]
    fn whole_edges(&mut self, from: i64, last: i64, [j, k]: [usize; 2]) {
        let many = last - from + 1;
        let (length, [y, z]) = (many * EDGE, [j, k].map(|at| (at as i64) << STEP_BITS));
        self.lengths[1] += length;
        self.lengths[2] += length;
        // Twice the sums of places for both axes: along the edges those of their middles count.
        self.moments[0] += 2 * length * ((from + last) << STEP_BITS);
        self.moments[1] += length * (4 * y + EDGE);
        self.moments[2] += length * (4 * z + EDGE);
        self.reach([from << STEP_BITS, y, z], [last << STEP_BITS, y, z]);
    }

    /// Adds a part of an edge along an axis, with its length and moments, or takes it away.
    #[inline(always)]
    fn part(&mut self, axis: usize, sign: i64, (length, moments): (i64, [i64; 3])) {
        self.lengths[axis] += sign * length;
        self.moments.iter_mut().zip(moments).for_each(|(own, part)| *own += sign * part);
    }

    /// Extends the box.
    #[inline(always)]
    fn reach(&mut self, low: [i64; 3], high: [i64; 3]) {
        for a in 0..3 {
            self.low[a] = self.low[a].min(low[a]);
            self.high[a] = self.high[a].max(high[a]);
        }
    }

    /// The same on the lattice that all bricks share.
    fn placed(&self, key: NodeKey) -> Sums {
        let bits = key.spacing_bits();
        let base = key.base().map(|b| i128::from(b) << PART_BITS);
        // From steps to parts.
        let shift = bits + PART_BITS - STEP_BITS;
        let area = 2 * bits;
        let lengths = self.lengths.map(|length| i128::from(length) << shift);
        let total: i128 = lengths.iter().sum();
        let moment = |b: usize| (i128::from(self.moments[b]) << (2 * shift)) + 2 * base[b] * total;
        let corner = |at: &[i64; 3]| [0, 1, 2].map(|b| base[b] as i64 + (at[b] << shift));
        let is_empty = self.low[0] > self.high[0];
        Sums {
            samples: (self.samples as u128) << (3 * bits),
            chords: lengths.map(|length| length << area),
            moments: [0, 1, 2].map(|b| moment(b) << area),
            euler: self.euler,
            crossings: self.crossings,
            low: if is_empty { [i64::MAX; 3] } else { corner(&self.low) },
            high: if is_empty { [i64::MIN; 3] } else { corner(&self.high) },
        }
    }
}

/// Sums of each component over the 32³ cells that a leaf owns.
pub(super) fn sums_of(
    key: NodeKey,
    brick: &Brick,
    components: &Components,
    signs: Option<&SignChanges>,
) -> Vec<Sums> {
    let (Some(signs), Brick::Counts { hermite, .. }) = (signs, brick) else {
        return vec![of_uniform().placed(key)];
    };
    let is_complete = hermite.edges.each_ref().map(Vec::len) == signs.counts();
    let hermite = is_complete.then_some(hermite);
    let locals = dispatch!(level(), _simd => locals_of(components, signs, hermite));
    locals.iter().map(|local| local.placed(key)).collect()
}

#[inline(always)]
fn locals_of(components: &Components, signs: &SignChanges, hermite: Option<&Hermite>) -> Vec<Local> {
    let mut locals = vec![Local::new(); components.len()];
    along_x(components, hermite, &mut locals);
    for axis in [Axis::Y, Axis::Z] {
        across(axis, signs, components, hermite, &mut locals);
    }
    for (j, k) in (0..BRICK_CELLS).flat_map(|k| (0..BRICK_CELLS).map(move |j| (j, k))) {
        own_row(signs, components, (j, k), &mut locals);
    }
    locals
}

fn of_uniform() -> Local {
    let cells = BRICK_CELLS as i64;
    let length = cells.pow(3) << STEP_BITS;
    // Of chords along an axis the middle is half way, of lines across it the last but one step begins the last cell.
    let moment = length * ((cells << STEP_BITS) + 2 * ((cells - 1) << STEP_BITS));
    Local {
        samples: cells.pow(3),
        lengths: [length; 3],
        moments: [moment; 3],
        // A box that is open at its upper faces.
        euler: 0,
        crossings: 0,
        low: [0; 3],
        high: [cells << STEP_BITS; 3],
    }
}

/// CrossingOffsets of crossings in the order of edges.
pub(super) struct CrossingOffsets<'a>(Option<&'a [HermiteEdge]>);

impl CrossingOffsets<'_> {
    fn of(hermite: Option<&Hermite>, axis: Axis) -> CrossingOffsets<'_> {
        CrossingOffsets(hermite.map(|hermite| &hermite.edges[axis.index()][..]))
    }

    /// Along an axis of a brick, where it says all of them.
    pub(super) fn along<'a>(hermite: &'a Hermite, signs: &SignChanges, axis: Axis) -> CrossingOffsets<'a> {
        let edges = &hermite.edges[axis.index()][..];
        CrossingOffsets((edges.len() == signs.counts()[axis.index()]).then_some(edges))
    }

    /// The next one in steps; half of the edge where the brick does not say it.
    #[inline(always)]
    pub(super) fn next(&mut self) -> i64 {
        let Some((edge, rest)) = self.0.and_then(|edges| edges.split_first()) else {
            return i64::from(MIDDLE);
        };
        self.0 = Some(rest);
        i64::from(edge.offset)
    }

    #[inline(always)]
    fn skip(&mut self, count: usize) {
        self.0 = self.0.map(|edges| &edges[count.min(edges.len())..]);
    }

    /// What a crossing counts for: nothing if it is not known where it is.
    fn one(&self) -> u64 {
        u64::from(self.0.is_some())
    }
}

/// Chords along x: each run from its crossing to the next.
#[inline(always)]
fn along_x(components: &Components, hermite: Option<&Hermite>, locals: &mut [Local]) {
    let mut offsets = CrossingOffsets::of(hermite, Axis::X);
    for (j, k) in (0..BRICK_POINTS).flat_map(|k| (0..BRICK_POINTS).map(move |j| (j, k))) {
        let runs = components.row(j, k);
        if j == BRICK_CELLS || k == BRICK_CELLS {
            offsets.skip(runs.len() - 1);
            continue;
        }
        let mut from = 0;
        for (n, run) in runs.iter().enumerate() {
            let mut to = (BRICK_CELLS as i64) << STEP_BITS;
            if let Some(next) = runs.get(n + 1) {
                to = (i64::from(run.to - 1) << STEP_BITS) + offsets.next();
                let is_void = !components.solid[usize::from(run.label)];
                let outer = if is_void { run.label } else { next.label };
                locals[usize::from(outer)].crossings += offsets.one();
            }
            let local = &mut locals[usize::from(run.label)];
            local.chord_along_x(from, to, [j, k]);
            if usize::from(run.from) == BRICK_CELLS {
                // No sample that the leaf owns stands in this run.
                let place = [from, (j as i64) << STEP_BITS, (k as i64) << STEP_BITS];
                local.reach(place, place);
            }
            from = to;
        }
    }
}

/// What crossed edges along y or z have other than whole ones: their upper part belongs to the sample there, not to the lower one.
#[inline(always)]
fn across(
    axis: Axis,
    signs: &SignChanges,
    components: &Components,
    hermite: Option<&Hermite>,
    locals: &mut [Local],
) {
    let (mut offsets, a) = (CrossingOffsets::of(hermite, axis), axis.index());
    for (j, k) in (0..BRICK_POINTS).flat_map(|k| (0..BRICK_POINTS).map(move |j| (j, k))) {
        let changes = signs.edges(axis, j, k);
        if j == BRICK_CELLS || k == BRICK_CELLS {
            offsets.skip(changes.count_ones() as usize);
            continue;
        }
        let upper = if axis == Axis::Y { (j + 1, k) } else { (j, k + 1) };
        let upper_is_own = upper.0.max(upper.1) < BRICK_CELLS;
        let (mut below, mut above) = (components.row(j, k), components.row(upper.0, upper.1));
        let mut line = [0, j as i64, k as i64].map(|at| at << STEP_BITS);
        let end = line[a] + EDGE;
        let mut own = changes & OWN;
        while own != 0 {
            let i = own.trailing_zeros() as u8;
            own &= own - 1;
            line[0] = i64::from(i) << STEP_BITS;
            let crossing = line[a] + offsets.next();
            let [one, other] = [&mut below, &mut above].map(|runs| {
                while runs[0].to <= i {
                    *runs = &runs[1..];
                }
                runs[0].label
            });
            let outer = if components.solid[usize::from(one)] { other } else { one };
            locals[usize::from(outer)].crossings += offsets.one();
            let length = end - crossing;
            let mut moments = line.map(|place| 2 * length * place);
            moments[a] = length * (end + crossing);
            let lower = &mut locals[usize::from(one)];
            lower.part(a, -1, (length, moments));
            lower.high[a] = lower.high[a].max(crossing);
            let upper = &mut locals[usize::from(other)];
            upper.part(a, 1, (length, moments));
            upper.low[a] = upper.low[a].min(crossing);
            if !upper_is_own {
                let mut place = line;
                place[a] = end;
                upper.reach(place, place);
            }
        }
        offsets.skip((changes & !OWN).count_ones() as usize);
    }
}

/// Samples, whole edges along y and z, and the Euler number, of a row of samples that the leaf owns.
#[inline(always)]
fn own_row(signs: &SignChanges, components: &Components, (j, k): (usize, usize), locals: &mut [Local]) {
    let rows = [(j, k), (j + 1, k), (j, k + 1), (j + 1, k + 1)].map(|(j, k)| signs.row(j, k));
    let euler = [EulerBits::of(rows.map(|row| !row & ALL)), EulerBits::of(rows)];
    let uncrossed = [rows[1], rows[2]].map(|next| !(rows[0] ^ next));
    for run in components.row(j, k) {
        let (local, bits) = (&mut locals[usize::from(run.label)], run.bits() & OWN);
        if bits == 0 {
            continue;
        }
        let (from, last) = (i64::from(run.from), i64::from(run.to).min(BRICK_CELLS as i64) - 1);
        local.samples += last - from + 1;
        local.euler += euler[usize::from(components.solid[usize::from(run.label)])].count(bits);
        local.whole_edges(from, last, [j, k]);
        for (a, (uncrossed, at)) in [(1, (uncrossed[0], j)), (2, (uncrossed[1], k))] {
            if bits & uncrossed != 0 {
                local.high[a] = local.high[a].max((at as i64 + 1) << STEP_BITS);
            }
        }
    }
}

/// The edges, faces and cells of which samples of a row are the lowest corner, as bits where all their corners are of one class.
struct EulerBits {
    /// What adds one each.
    plus: [u64; 4],
    /// What takes one away each.
    minus: [u64; 4],
}

impl EulerBits {
    /// Of a class in a row, in those beside it along y and z, and in the one across.
    #[inline(always)]
    fn of([here, y, z, yz]: [u64; 4]) -> EulerBits {
        let along = |bits: u64| bits & bits >> 1;
        let (y, z, yz) = (here & y, here & z, here & y & z & yz);
        EulerBits { plus: [here, along(y), along(z), yz], minus: [along(here), y, z, along(yz)] }
    }

    /// What some samples add to the Euler number.
    #[inline(always)]
    fn count(&self, own: u64) -> i64 {
        let ones = |all: &[u64; 4]| all.iter().map(|bits| i64::from((bits & own).count_ones())).sum::<i64>();
        ones(&self.plus) - ones(&self.minus)
    }
}

#[cfg(test)]
mod tests {
    use super::super::components::Connectivity;
    use super::*;
    use crate::brick::{OctNormal, Samples, point_index};

    /// A brick of the whole root in which a box of samples is void, amid solid, crossed at a quarter of the edges.
    fn boxed(low: [usize; 3], high: [usize; 3]) -> Brick {
        let mut samples = Samples::filled(1);
        for k in low[2]..high[2] {
            for j in low[1]..high[1] {
                (low[0]..high[0]).for_each(|i| samples.0[point_index([i, j, k])] = 0);
            }
        }
        let signs = SignChanges::of(&samples);
        let edges = Axis::ALL.map(|axis| {
            let mut edges = Vec::new();
            signs.for_edges(axis, |_| edges.push(HermiteEdge { offset: 1 << 14, normal: OctNormal(0) }));
            edges
        });
        Brick::Counts { samples, hermite: Hermite { edges } }
    }

    #[test]
    fn a_box_has_its_volume_centroid_and_euler_number() {
        let brick = boxed([3, 4, 5], [10, 9, 7]);
        let (components, signs) = Components::of(&brick, Connectivity::VoidSix);
        let sums = sums_of(NodeKey::ROOT, &brick, &components, signs.as_ref());
        let root = RootCube { origin: [0.0; 3], edge: 32.0 };
        assert_eq!(components.solid, [true, false]);
        // Seven samples and as many edges along x, of which a quarter and three quarters remain at the ends.
        let volume = 7.0 * 5.0 * 2.0;
        assert_eq!(sums[1].volumes(root), [volume; 3]);
        assert_eq!((sums[1].counted(root), sums[1].euler), (volume, 1));
        assert_eq!(sums[0].volumes(root), [32f64.powi(3) - volume; 3]);
        let bits = NodeKey::ROOT.spacing_bits();
        let place = |units: f64| (units - 1.0) / f64::from(1u32 << bits);
        let centroid = sums[1].centroid().unwrap().map(place);
        // A third of the chords runs along each axis, from 2.25 to 9.25; of the others lines stand from 3 to 9.
        let mean =
            |low: f64, count: f64| ((low - 0.75 + count / 2.0) + 2.0 * (low + (count - 1.0) / 2.0)) / 3.0;
        let expected = [mean(3.0, 7.0), mean(4.0, 5.0), mean(5.0, 2.0)];
        for a in 0..3 {
            assert!((centroid[a] - expected[a]).abs() < 1e-9, "{centroid:?} {expected:?}");
        }
        let part = |units: i64| units as f64 / PARTS / f64::from(1u32 << bits);
        assert_eq!(sums[1].low.map(part), [2.25, 3.25, 4.25]);
        assert_eq!(sums[1].high.map(part), [9.25, 8.25, 6.25]);
    }

    #[test]
    fn a_uniform_brick_is_its_samples_one_by_one() {
        let key = NodeKey::new(2, [1, 2, 3]).unwrap();
        let brick = Brick::Counts { samples: Samples::filled(0), hermite: Hermite::default() };
        let (components, signs) = Components::of(&brick, Connectivity::VoidSix);
        let one_by_one = sums_of(key, &brick, &components, signs.as_ref());
        let (components, signs) = Components::of(&Brick::Uniform(0), Connectivity::VoidSix);
        assert_eq!(sums_of(key, &Brick::Uniform(0), &components, signs.as_ref()), one_by_one);
    }
}
