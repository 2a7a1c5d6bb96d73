//! What is summed of a component: samples, chords between exact crossings with their moments, the Euler number, the box.
//!
//! All sums are integers, so the order of adding changes nothing. Positions count in [`PARTS`] of a lattice unit, which is
//! what an offset of a Hermite edge is exact to at the deepest level.

use super::components::{Components, Run};
use crate::brick::{Brick, Hermite, HermiteEdge, SignChanges};
use crate::lattice::{Axis, BRICK_CELLS, BRICK_POINTS, NodeKey, RootCube};

/// log₂ of the steps of a lattice edge in which crossings are told.
const STEP_BITS: u32 = 16;
/// log₂ of the parts of a unit in which positions count.
const PART_BITS: u32 = 13;
/// Parts of a unit.
pub(super) const PARTS: f64 = (1u32 << PART_BITS) as f64;
/// The samples of a row that a brick owns.
const OWN: u64 = (1 << BRICK_CELLS) - 1;
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
    low: [i64; 3],
    high: [i64; 3],
}

impl Local {
    fn new() -> Local {
        Local { low: [i64::MAX; 3], high: [i64::MIN; 3], ..Local::default() }
    }

    /// A chord along `axis` from one place to another, on the line through a sample.
    fn chord(&mut self, axis: Axis, from: i64, to: i64, at: [usize; 3]) {
        let (a, length) = (axis.index(), to - from);
        self.lengths[a] += length;
        for (b, at) in at.into_iter().enumerate() {
            let (low, high) = if a == b {
                self.moments[b] += to * to - from * from;
                (from, to)
            } else {
                let place = (at as i64) << STEP_BITS;
                self.moments[b] += 2 * length * place;
                (place, place)
            };
            self.low[b] = self.low[b].min(low);
            self.high[b] = self.high[b].max(high);
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
    let mut locals = vec![Local::new(); components.len()];
    let is_complete = hermite.edges.each_ref().map(Vec::len) == signs.counts();
    let hermite = is_complete.then_some(hermite);
    along_x(components, hermite, &mut locals);
    across(Axis::Y, signs, components, hermite, &mut locals);
    across(Axis::Z, signs, components, hermite, &mut locals);
    for k in 0..BRICK_CELLS {
        for j in 0..BRICK_CELLS {
            for run in components.row(j, k) {
                let local = &mut locals[usize::from(run.label)];
                local.samples += i64::from((run.bits() & OWN).count_ones());
                local.euler += euler(signs, *run, j, k, components.solid[usize::from(run.label)]);
            }
        }
    }
    locals.iter().map(|local| local.placed(key)).collect()
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
        low: [0; 3],
        high: [cells << STEP_BITS; 3],
    }
}

/// Chords along x: each run from its crossing to the next.
fn along_x(components: &Components, hermite: Option<&Hermite>, locals: &mut [Local]) {
    let mut edges = hermite.map(|hermite| hermite.edges[0].iter());
    for k in 0..BRICK_POINTS {
        for j in 0..BRICK_POINTS {
            let runs = components.row(j, k);
            let mut from = 0;
            for (n, run) in runs.iter().enumerate() {
                let to = match runs.get(n + 1) {
                    Some(_) => (i64::from(run.to - 1) << STEP_BITS) + offset(&mut edges),
                    None => (BRICK_CELLS as i64) << STEP_BITS,
                };
                if j < BRICK_CELLS && k < BRICK_CELLS {
                    locals[usize::from(run.label)].chord(Axis::X, from, to, [0, j, k]);
                }
                from = to;
            }
        }
    }
}

fn offset(edges: &mut Option<std::slice::Iter<'_, HermiteEdge>>) -> i64 {
    let edge = edges.as_mut().and_then(Iterator::next);
    i64::from(edge.map_or(MIDDLE, |edge| edge.offset))
}

/// Chords along y or z, edge by edge: those without a crossing many at a time.
fn across(
    axis: Axis,
    signs: &SignChanges,
    components: &Components,
    hermite: Option<&Hermite>,
    locals: &mut [Local],
) {
    let mut edges = hermite.map(|hermite| hermite.edges[axis.index()].iter());
    let edge = 1i64 << STEP_BITS;
    for k in 0..BRICK_POINTS {
        for j in 0..BRICK_POINTS {
            let upper = if axis == Axis::Y { (j + 1, k) } else { (j, k + 1) };
            if upper.0 >= BRICK_POINTS || upper.1 >= BRICK_POINTS {
                continue;
            }
            let mut changes = signs.row(j, k) ^ signs.row(upper.0, upper.1);
            let is_own = j < BRICK_CELLS && k < BRICK_CELLS;
            let low = if axis == Axis::Y { j } else { k } as i64 * edge;
            if is_own {
                for run in components.row(j, k) {
                    whole_edges(
                        axis,
                        run.bits() & OWN & !changes,
                        low,
                        [j, k],
                        &mut locals[usize::from(run.label)],
                    );
                }
            }
            while changes != 0 {
                let i = changes.trailing_zeros() as usize;
                changes &= changes - 1;
                let crossing = low + offset(&mut edges);
                if is_own && i < BRICK_CELLS {
                    let [below, above] = [[i, j, k], [i, upper.0, upper.1]].map(|at| components.at(at));
                    locals[usize::from(below)].chord(axis, low, crossing, [i, j, k]);
                    locals[usize::from(above)].chord(axis, crossing, low + edge, [i, j, k]);
                }
            }
        }
    }
}

/// Edges along y or z without a crossing, from the samples of a row whose bits are set.
fn whole_edges(axis: Axis, mut bits: u64, low: i64, [j, k]: [usize; 2], local: &mut Local) {
    let edge = 1i64 << STEP_BITS;
    while bits != 0 {
        let from = bits.trailing_zeros() as usize;
        let count = (bits >> from).trailing_ones() as usize;
        bits &= bits + (1 << from);
        let (last, many) = (from + count - 1, count as i64);
        local.lengths[axis.index()] += many * edge;
        let a = axis.index();
        // Twice the sum of the places along x, that of the middles, and of the places along the third axis.
        local.moments[0] += edge * (((from + last) as i64 * many) << STEP_BITS);
        local.moments[a] += many * edge * (2 * low + edge);
        let (b, place) = if axis == Axis::Y { (2, k) } else { (1, j) };
        local.moments[b] += 2 * many * edge * ((place as i64) << STEP_BITS);
        for (c, from, to) in [
            (0, (from as i64) << STEP_BITS, (last as i64) << STEP_BITS),
            (a, low, low + edge),
            (b, (place as i64) << STEP_BITS, (place as i64) << STEP_BITS),
        ] {
            local.low[c] = local.low[c].min(from);
            local.high[c] = local.high[c].max(to);
        }
    }
}

/// What a run of samples of one class adds to the Euler number: of its samples, and of the edges, faces and cells of
/// which these are the lowest corner, those whose corners are all of the class.
fn euler(signs: &SignChanges, run: Run, j: usize, k: usize, solid: bool) -> i64 {
    let row = |j: usize, k: usize| {
        if solid { signs.row(j, k) } else { !signs.row(j, k) & ((1 << BRICK_POINTS) - 1) }
    };
    let (here, y, z, yz) = (row(j, k), row(j + 1, k), row(j, k + 1), row(j + 1, k + 1));
    let own = run.bits() & OWN;
    let along = |bits: u64| bits & bits >> 1;
    let count = |bits: u64| i64::from((bits & own).count_ones());
    count(here) - count(along(here)) - count(here & y) - count(here & z)
        + count(along(here & y))
        + count(along(here & z))
        + count(here & y & z & yz)
        - count(along(here & y & z & yz))
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
