//! Nodes that wait to be joined to those above them.

use super::records::Records;
use crate::brick::{Brick, Samples, point_index};
use crate::lattice::{BRICK_CELLS, BRICK_POINTS, NodeKey, Octant};

/// What a node turned out to be, for its parent.
#[derive(Clone, Debug)]
pub enum JoinedNode {
    /// No surface touches it; not in the records, because the parent may be as empty.
    Empty(i16),
    /// In the records.
    Stored(CoarseSamples),
}

/// Samples of a half brick along an axis, its apron included.
const HALF_POINTS: usize = BRICK_CELLS / 2 + 1;

/// What a parent takes of a child: every second sample. A tenth of a brick, because thousands of jobs' top
/// nodes wait for their parents at the same time.
#[derive(Clone, Debug)]
pub enum CoarseSamples {
    /// All samples equal.
    Uniform(i16),
    /// x fastest, z slowest, and their binary places.
    Counts(Box<[i16; HALF_POINTS * HALF_POINTS * HALF_POINTS]>, u8),
}

impl CoarseSamples {
    /// Every second sample of a brick.
    pub fn of(brick: &Brick) -> CoarseSamples {
        let samples = match brick {
            Brick::Uniform(w) => return CoarseSamples::Uniform(*w),
            Brick::Counts { samples, .. } => samples,
        };
        let mut half = Vec::with_capacity(HALF_POINTS.pow(3));
        for k in 0..HALF_POINTS {
            for j in 0..HALF_POINTS {
                let row: &[i16; BRICK_POINTS] =
                    samples.0[point_index([0, 2 * j, 2 * k])..].first_chunk().expect("a whole row");
                half.extend_from_slice(&std::array::from_fn::<i16, HALF_POINTS, _>(|i| row[2 * i]));
            }
        }
        CoarseSamples::Counts(half.into_boxed_slice().try_into().expect("all rows were taken"), samples.1)
    }

    fn bits(&self) -> u8 {
        match self {
            CoarseSamples::Uniform(_) => 0,
            CoarseSamples::Counts(_, bits) => *bits,
        }
    }
}

/// Makes a node from its children: empty if they all are, else their common interior node, recording the
/// empty children as uniform leaves.
pub fn join(key: NodeKey, children: [JoinedNode; 8], records: &mut Records) -> JoinedNode {
    if let Some(w) = common_empty(&children) {
        return JoinedNode::Empty(w);
    }
    record_empty(key, &children, records);
    let brick = joined(&children);
    records.push(key, false, &brick);
    JoinedNode::Stored(CoarseSamples::of(&brick))
}

/// Records the empty ones of a node's children as uniform leaves.
pub fn record_empty(key: NodeKey, children: &[JoinedNode; 8], records: &mut Records) {
    for (octant, child) in Octant::all().zip(children) {
        if let JoinedNode::Empty(w) = child {
            records.push(key.child(octant), true, &Brick::Uniform(*w));
        }
    }
}

/// The interior node of eight children. Its samples have as many binary places as theirs.
pub fn joined(children: &[JoinedNode; 8]) -> Brick {
    let bits_of = |child: &JoinedNode| match child {
        JoinedNode::Stored(half) => half.bits(),
        JoinedNode::Empty(_) => 0,
    };
    let bits = children.iter().map(bits_of).max().unwrap_or(0);
    let mut samples = Samples::fractions(bits);
    for (octant, child) in Octant::all().zip(children) {
        match child {
            JoinedNode::Stored(half) => place_half(&mut samples, octant, half),
            JoinedNode::Empty(w) => place_half(&mut samples, octant, &CoarseSamples::Uniform(*w)),
        }
    }
    interior(samples)
}

/// The value of eight children that are all empty and equal.
pub fn common_empty(children: &[JoinedNode; 8]) -> Option<i16> {
    let JoinedNode::Empty(w) = children[0] else { return None };
    children.iter().all(|c| matches!(c, JoinedNode::Empty(v) if *v == w)).then_some(w)
}

/// The brick of an interior node. Samples that are all whole have no binary places: so it does not matter whether they
/// were found for the node, or are its children's, of which some may have places.
pub fn interior(samples: Samples) -> Brick {
    Brick::from_samples(samples.without_idle_places(), Default::default())
}

/// Copies a child's half samples, apron included, to where the parent has them.
fn place_half(parent: &mut Samples, octant: Octant, child: &CoarseSamples) {
    let [x, y, z] = octant.offset().map(|o| o * BRICK_CELLS / 2);
    let bits = parent.1;
    for k in 0..HALF_POINTS {
        for j in 0..HALF_POINTS {
            let to = &mut parent.0[point_index([x, y + j, z + k])..][..HALF_POINTS];
            match child {
                // A winding number that leaves no 16 bits beside its binary places was refused.
                CoarseSamples::Uniform(w) => to.fill(*w << bits),
                CoarseSamples::Counts(half, own) => {
                    let from = &half[(k * HALF_POINTS + j) * HALF_POINTS..][..HALF_POINTS];
                    to.iter_mut().zip(from).for_each(|(to, from)| *to = from << (bits - own));
                }
            }
        }
    }
}
