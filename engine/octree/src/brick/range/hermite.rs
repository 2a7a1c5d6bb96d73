//! Hermite edges, foretold from those around them: normals are copied from neighbours or near them, and the plane through a
//! neighbour, under its normal or between two, says where the next edge is crossed.
//!
//! On a flat facet that leaves what rounding the neighbour's place and normal to 16 bits has left, two bits an edge.
//! On round ones the mean of both normals is the direction across the chord, exactly so of a circle.

use crate::brick::{Hermite, HermiteEdge, OctNormal, SignChanges};
use crate::lattice::{Axis, BRICK_POINTS};
use brickfield_coding::range::{Bit, Coder, NumberModel, bit_length};

/// Samples along an axis of a brick.
const P: usize = BRICK_POINTS;
/// Units in an edge, of which offsets count.
const UNITS: i64 = 1 << 16;
/// Most neighbours that are asked.
const NEAR_MAX: usize = 8;
/// Most of their normals that are tried one by one.
const TRIES_MAX: usize = 3;
/// Most neighbours of which a mean is taken.
const MEAN_MAX: usize = 3;
/// Normals that are remembered.
const KNOWN_MAX: usize = 256;

/// Where a neighbour lies: its axis, and its lower sample less that of the edge.
type Place = (usize, [i8; 3]);

/// By axis, the places of edges that come earlier and may have a neighbour's crossing: first those that share a face with
/// the edge, then some that are close.
const PLACES: [&[Place]; 3] = [
    &[
        (0, [0, -1, 0]),
        (0, [0, 0, -1]),
        (1, [0, -1, 0]),
        (1, [1, -1, 0]),
        (2, [0, 0, -1]),
        (2, [1, 0, -1]),
        (0, [0, -1, -1]),
        (0, [0, 1, -1]),
        (1, [0, 0, -1]),
        (1, [1, 0, -1]),
        (0, [-1, 0, 0]),
    ],
    &[
        (1, [-1, 0, 0]),
        (1, [0, 0, -1]),
        (0, [-1, 0, 0]),
        (0, [0, 0, 0]),
        (2, [0, 0, -1]),
        (2, [0, 1, -1]),
        (1, [-1, 0, -1]),
        (1, [1, 0, -1]),
        (0, [0, 0, -1]),
        (0, [0, 1, -1]),
        (1, [0, -1, 0]),
    ],
    &[
        (2, [-1, 0, 0]),
        (2, [0, -1, 0]),
        (0, [-1, 0, 0]),
        (0, [0, 0, 0]),
        (1, [0, -1, 0]),
        (1, [0, 0, 0]),
        (2, [-1, -1, 0]),
        (2, [1, -1, 0]),
        (2, [0, 0, -1]),
        (0, [0, -1, 0]),
    ],
];

/// An edge that was coded.
#[derive(Clone, Copy, Debug, Default)]
struct Coded {
    offset: u16,
    normal: u32,
    /// The normal as a vector of length 2^16.
    vector: [i32; 3],
}

/// The edges of two layers by axis, layer modulo 2, row and sample. Whether one is there, the sign changes tell.
///
/// Flat: filling nested arrays of this size took a sixth of the time in which the whole library was compiled.
pub struct Layers(Box<[Coded]>);

impl Default for Layers {
    fn default() -> Layers {
        Layers(vec![Coded::default(); 3 * 2 * P * P].into())
    }
}

impl Layers {
    /// The position of an edge.
    fn position(axis: usize, [i, j, k]: [usize; 3]) -> usize {
        ((axis * 2 + k % 2) * P + j) * P + i
    }
}

/// A neighbour as an edge sees it.
#[derive(Clone, Copy, Default)]
struct NeighbourEdge {
    normal: u32,
    vector: [i64; 3],
    /// Its crossing from the edge's lower sample, in [`UNITS`].
    at: [i64; 3],
    /// Whether its plane crosses the edge.
    meets: bool,
}

/// The neighbours of an edge, those whose planes cross it first.
struct NeighbourEdges {
    all: [NeighbourEdge; NEAR_MAX],
    count: usize,
}

/// What is learnt within a brick.
struct Model {
    /// Whether an edge has a neighbour's normal, by how many neighbours have it, how many have another, whether that one's
    /// plane crosses the edge, whether the last two edges had the first normal tried, and how many were tried.
    same: Box<[Bit; 512]>,
    /// Whether the two edges before had the normal that was tried first.
    firsts: usize,
    /// Whether another normal is a remembered one.
    is_known: Bit,
    /// Which: 0 for the one used last.
    rank: NumberModel,
    /// Remembered normals, the one used last at the end.
    known: Vec<u32>,
    /// New normals, first and second coordinate from what is foretold: by how far the one before was off.
    first: [NumberModel; 8],
    second: [NumberModel; 8],
    error: u16,
    /// Offsets under a neighbour's normal, by how steep the edge is to the plane.
    along: [NumberModel; 5],
    /// Under a new normal, by how far the one before was off; under a remembered one.
    anew: [NumberModel; 8],
    anew_error: u16,
    again: NumberModel,
}

/// How an edge came to its normal.
enum Normal {
    /// It is that of this neighbour.
    Same(NeighbourEdge),
    Known,
    New,
}

/// Codes the edges of a brick, sample by sample in the order of the linear index, at each the edges along x, y, z. There
/// must be one for each sign change.
pub fn edges<C: Coder>(coder: &mut C, signs: &SignChanges, layers: &mut Layers, hermite: &mut Hermite) {
    let mut model = Model::new();
    let mut rest = hermite.edges.each_mut().map(|edges| edges.iter_mut());
    for (k, j) in (0..P).flat_map(|k| (0..P).map(move |j| (k, j))) {
        let masks = Axis::ALL.map(|axis| signs.edges(axis, j, k));
        let mut any = masks[0] | masks[1] | masks[2];
        while any != 0 {
            let i = any.trailing_zeros() as usize;
            any &= any - 1;
            for axis in (0..3).filter(|&axis| masks[axis] >> i & 1 != 0) {
                let edge = rest[axis].next().expect("an edge for each sign change");
                let near = NeighbourEdges::of(layers, signs, axis, [i, j, k]);
                let coded = model.edge(coder, axis, &near, *edge);
                *edge = HermiteEdge { offset: coded.offset, normal: OctNormal(coded.normal) };
                layers.0[Layers::position(axis, [i, j, k])] = coded;
            }
        }
    }
}

impl NeighbourEdges {
    /// The first neighbours of the edge along `axis` from a sample that have been coded.
    #[inline]
    fn of(layers: &Layers, signs: &SignChanges, axis: usize, from: [usize; 3]) -> NeighbourEdges {
        let mut near = NeighbourEdges { all: [NeighbourEdge::default(); NEAR_MAX], count: 0 };
        let mut beside = [NeighbourEdge::default(); NEAR_MAX];
        let mut beside_count = 0;
        for &(along, step) in PLACES[axis] {
            let [i, j, k] = [0, 1, 2].map(|a| from[a].wrapping_add_signed(isize::from(step[a])));
            if i >= P || j >= P || k >= P || signs.edges(Axis::ALL[along], j, k) >> i & 1 == 0 {
                continue;
            }
            let coded = &layers.0[Layers::position(along, [i, j, k])];
            let mut at = step.map(|v| i64::from(v) * UNITS);
            at[along] += i64::from(coded.offset);
            let mut neighbour =
                NeighbourEdge { normal: coded.normal, vector: coded.vector.map(i64::from), at, meets: false };
            let (height, slope) = plane(neighbour.vector, at, axis);
            neighbour.meets = height >= 0 && height < slope * UNITS;
            let (list, count) = match neighbour.meets {
                true => (&mut near.all, &mut near.count),
                false => (&mut beside, &mut beside_count),
            };
            list[*count] = neighbour;
            *count += 1;
            if near.count + beside_count == NEAR_MAX {
                break;
            }
        }
        near.all[near.count..near.count + beside_count].copy_from_slice(&beside[..beside_count]);
        near.count += beside_count;
        near
    }

    fn all(&self) -> &[NeighbourEdge] {
        &self.all[..self.count]
    }
}

/// Height of the edge's lower sample below a plane, and how much of it a unit of the edge takes, which is not negative.
#[inline]
fn plane(normal: [i64; 3], at: [i64; 3], axis: usize) -> (i64, i64) {
    let height = normal[0] * at[0] + normal[1] * at[1] + normal[2] * at[2];
    if normal[axis] < 0 { (-height, -normal[axis]) } else { (height, normal[axis]) }
}

/// Where a plane crosses the edge, as near to it as an offset can say; its middle if they are parallel.
#[inline]
fn crossing(normal: [i64; 3], at: [i64; 3], axis: usize) -> i64 {
    let (height, slope) = plane(normal, at, axis);
    if slope == 0 {
        return UNITS / 2;
    }
    (2 * height + slope).div_euclid(2 * slope).clamp(0, UNITS - 1)
}

impl Model {
    fn new() -> Model {
        Model {
            same: Box::new([Bit::NEW; 512]),
            firsts: 0,
            is_known: Bit::NEW,
            rank: NumberModel::NEW,
            known: Vec::with_capacity(KNOWN_MAX),
            first: [const { NumberModel::NEW }; 8],
            second: [const { NumberModel::NEW }; 8],
            error: 0,
            along: [const { NumberModel::NEW }; 5],
            anew: [const { NumberModel::NEW }; 8],
            anew_error: 0,
            again: NumberModel::NEW,
        }
    }

    #[inline]
    fn edge<C: Coder>(
        &mut self,
        coder: &mut C,
        axis: usize,
        near: &NeighbourEdges,
        edge: HermiteEdge,
    ) -> Coded {
        let (how, normal) = self.normal(coder, near.all(), edge.normal.0);
        let vector = match how {
            Normal::Same(neighbour) => neighbour.vector,
            _ => vector_of(normal),
        };
        let foretold = match (&how, near.all().first()) {
            (Normal::Same(neighbour), _) => on_plane(neighbour, near.all(), axis),
            (_, Some(first)) => {
                let between = [0, 1, 2].map(|a| first.vector[a] + vector[a]);
                crossing(between, first.at, axis)
            }
            _ => UNITS / 2,
        };
        let number = match how {
            Normal::Same(_) => &mut self.along[steepness(vector, axis)],
            Normal::Known => &mut self.again,
            Normal::New => &mut self.anew[set_of(self.anew_error)],
        };
        let off = number.signed(coder, edge.offset.wrapping_sub(foretold as u16) as i16);
        if matches!(how, Normal::New) {
            self.anew_error = off.unsigned_abs();
        }
        let offset = (foretold as u16).wrapping_add(off as u16);
        Coded { offset, normal, vector: vector.map(|c| c as i32) }
    }

    /// Codes how an edge comes to its normal, and which that is.
    #[inline]
    fn normal<C: Coder>(&mut self, coder: &mut C, near: &[NeighbourEdge], normal: u32) -> (Normal, u32) {
        let mut tried = [0; TRIES_MAX];
        let mut tries = 0;
        for neighbour in near {
            if tried[..tries].contains(&neighbour.normal) {
                continue;
            }
            if tries == TRIES_MAX {
                break;
            }
            let agree = near.iter().filter(|other| other.normal == neighbour.normal).count();
            let context = (agree - 1).min(3)
                | (near.len() - agree).min(3) << 2
                | usize::from(neighbour.meets) << 4
                | (self.firsts & 3) << 5
                | tries << 7;
            let is_same = coder.bit(&mut self.same[context], normal == neighbour.normal);
            tried[tries] = neighbour.normal;
            tries += 1;
            if is_same {
                self.firsts = self.firsts << 1 | usize::from(tries == 1);
                return (Normal::Same(*neighbour), neighbour.normal);
            }
        }
        self.firsts <<= 1;
        let place = if C::ENCODES { self.known.iter().rposition(|&known| known == normal) } else { None };
        if coder.bit(&mut self.is_known, place.is_some()) {
            return (Normal::Known, self.remembered(coder, place));
        }
        let normal = self.new_normal(coder, near, normal);
        if self.known.len() == KNOWN_MAX {
            self.known.remove(0);
        }
        self.known.push(normal);
        (Normal::New, normal)
    }

    /// Codes which of the remembered normals an edge has, and puts it at their end.
    fn remembered<C: Coder>(&mut self, coder: &mut C, place: Option<usize>) -> u32 {
        let rank = place.map_or(0, |place| self.known.len() - 1 - place);
        let rank = self.rank.unsigned(coder, rank as u32) as usize;
        if rank >= self.known.len() {
            coder.refuse();
            return 0;
        }
        let normal = self.known.remove(self.known.len() - 1 - rank);
        self.known.push(normal);
        normal
    }

    /// Codes a normal by how far its coordinates are from those between the nearest.
    fn new_normal<C: Coder>(&mut self, coder: &mut C, near: &[NeighbourEdge], normal: u32) -> u32 {
        let mut sum = [0; 3];
        for neighbour in near.iter().take(MEAN_MAX) {
            sum = [0, 1, 2].map(|a| sum[a] + neighbour.vector[a]);
        }
        let foretold = OctNormal::from_integer(sum).0;
        let coordinates = |normal: u32| [normal as u16, (normal >> 16) as u16];
        let ([u, v], [to_u, to_v]) = (coordinates(foretold), coordinates(normal));
        let off_u = self.first[set_of(self.error)].signed(coder, to_u.wrapping_sub(u) as i16);
        let off_v = self.second[set_of(off_u.unsigned_abs())].signed(coder, to_v.wrapping_sub(v) as i16);
        self.error = off_u.unsigned_abs().max(off_v.unsigned_abs());
        u32::from(u.wrapping_add(off_u as u16)) | u32::from(v.wrapping_add(off_v as u16)) << 16
    }
}

/// Where the planes of the first neighbours with a neighbour's normal cross the edge, on the mean of those that do.
#[inline]
fn on_plane(neighbour: &NeighbourEdge, near: &[NeighbourEdge], axis: usize) -> i64 {
    let (mut sum, mut count) = (0, 0);
    let alike = near.iter().filter(|other| other.meets && other.normal == neighbour.normal);
    for other in alike.take(MEAN_MAX) {
        sum += crossing(other.vector, other.at, axis);
        count += 1;
    }
    match count {
        0 => crossing(neighbour.vector, neighbour.at, axis),
        _ => (sum + count / 2) / count,
    }
}

/// How much more of a normal another axis has than the edge's: 1 up to twice as much, 4 from eight times on.
#[inline]
fn steepness(vector: [i64; 3], axis: usize) -> usize {
    let largest = vector.iter().fold(0, |largest, c| largest.max(c.unsigned_abs()));
    let own = vector[axis].unsigned_abs().max(1);
    (bit_length((largest / own) as u32) as usize).min(4)
}

/// The set of probabilities for numbers about as large as `error`.
#[inline]
fn set_of(error: u16) -> usize {
    (bit_length(u32::from(error)) as usize / 2).min(7)
}

/// A normal as a vector whose length is 2^16, but for rounding.
fn vector_of(normal: u32) -> [i64; 3] {
    let u = i64::from(normal as u16 as i16);
    let v = i64::from((normal >> 16) as u16 as i16);
    let z = 32_767 - u.abs() - v.abs();
    let fold = (-z).max(0);
    let x = if u < 0 { u + fold } else { u - fold };
    let y = if v < 0 { v + fold } else { v - fold };
    let length = ((x * x + y * y + z * z) as u64).isqrt().max(1) as i64;
    [x, y, z].map(|c| c * UNITS / length)
}
