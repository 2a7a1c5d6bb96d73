//! How much space is covered, and how much of it more than once, from a store alone.

use crate::brick::{Brick, HermiteEdge, Samples, SignChanges};
use crate::error::Result;
use crate::lattice::{Axis, BRICK_CELLS, BRICK_POINTS, MAX_LEVEL, NodeKey};
use crate::progress::Progress;
use crate::store::{BrickTree, Leaf, NodeInfo, SourceVolumes, visit};

/// Volumes of a field in the cube of the tree's unit, each with a bound on its error.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize)]
pub struct Volumes {
    /// Where w ≥ 1: the volume of the union.
    pub union: f64,
    /// Bound on its error.
    pub union_error: f64,
    /// ∫ (w − 1) where w ≥ 1: what the pieces have beyond their union, so that both add up to the volume of
    /// all pieces. Where three pieces lie, it counts twice.
    pub overlap: f64,
    /// Bound on its error.
    pub overlap_error: f64,
    /// −∫ w where w < 0: of pieces that are inside out.
    pub negative: f64,
    /// Bound on its error.
    pub negative_error: f64,
}

impl From<&SourceVolumes> for Volumes {
    /// Those of the source, with three standard errors.
    fn from(source: &SourceVolumes) -> Volumes {
        let SourceVolumes { union, overlap, negative, .. } = source;
        Volumes {
            union: union.value,
            union_error: union.bound(),
            overlap: overlap.value,
            overlap_error: overlap.bound(),
            negative: negative.value,
            negative_error: negative.bound(),
        }
    }
}

/// The samples of a row that a brick owns.
const OWN: u64 = (1 << BRICK_CELLS) - 1;

/// Steps of an edge in which chords are measured.
const STEPS: u128 = 1 << 16;

/// Sums in cells of the deepest level there can be, exact for any tree.
#[derive(Clone, Copy, Default)]
struct Sums {
    /// Chords of the union along each axis, in [`STEPS`].
    chords: [u128; 3],
    /// Samples of the union.
    inside: u128,
    overlap: Count,
    negative: Count,
}

/// A quantity of which samples alone tell.
#[derive(Clone, Copy, Default)]
struct Count {
    sum: u128,
    /// Differences between neighbours along each axis: between two samples the quantity is one or the other.
    changes: [u128; 3],
}

impl Count {
    fn and(self, other: Count) -> Count {
        Count { sum: self.sum + other.sum, changes: [0, 1, 2].map(|a| self.changes[a] + other.changes[a]) }
    }

    fn scaled(self, by: u128) -> Count {
        Count { sum: self.sum * by, changes: self.changes.map(|c| c * by) }
    }

    /// Of a brick's own samples, where `part` is what counts of a sample.
    fn of(samples: &Samples, part: fn(i32) -> i32) -> Count {
        let at = |index: usize| part(i32::from(samples.whole(samples.0[index]))).max(0);
        let mut count = Count::default();
        for k in 0..BRICK_CELLS {
            for j in 0..BRICK_CELLS {
                // A row's sums fit 32 bits: 32 samples of 16 each.
                let (mut sum, mut changes) = (0u32, [0u32; 3]);
                for i in 0..BRICK_CELLS {
                    let index = (k * BRICK_POINTS + j) * BRICK_POINTS + i;
                    let here = at(index);
                    sum += here.unsigned_abs();
                    for (axis, step) in [1, BRICK_POINTS, BRICK_POINTS * BRICK_POINTS].into_iter().enumerate()
                    {
                        changes[axis] += here.abs_diff(at(index + step));
                    }
                }
                count = count.and(Count { sum: sum.into(), changes: changes.map(u128::from) });
            }
        }
        count
    }
}

impl Sums {
    fn and(self, other: Sums) -> Sums {
        Sums {
            chords: [0, 1, 2].map(|a| self.chords[a] + other.chords[a]),
            inside: self.inside + other.inside,
            overlap: self.overlap.and(other.overlap),
            negative: self.negative.and(other.negative),
        }
    }

    /// Of `count` samples that are all `w`.
    fn of_equal(w: i16, count: u128) -> Sums {
        let of = |w: i32| Count { sum: u128::from(w.max(0).unsigned_abs()) * count, ..Count::default() };
        let w = i32::from(w);
        let inside = u128::from(w >= 1) * count;
        Sums { chords: [inside * STEPS; 3], inside, overlap: of(w - 1), negative: of(-w) }
    }

    /// Of a leaf's own 32³ cells.
    fn of_brick(brick: &Brick) -> Sums {
        let (samples, hermite) = match brick {
            Brick::Uniform(w) => return Sums::of_equal(*w, (BRICK_CELLS as u128).pow(3)),
            Brick::Counts { samples, hermite } => (samples, hermite),
        };
        let signs = SignChanges::of(samples);
        let chords = Axis::ALL.map(|axis| chords(&signs, &hermite.edges[axis.index()], axis));
        let own = |row: usize| signs.row(row % BRICK_CELLS, row / BRICK_CELLS) & OWN;
        let inside = (0..BRICK_CELLS * BRICK_CELLS).map(|row| u128::from(own(row).count_ones())).sum();
        let (min, max) = samples.range();
        let count = |there: bool, part| if there { Count::of(samples, part) } else { Count::default() };
        let overlap = count(samples.whole(max) > 1, |w| w - 1);
        Sums { chords, inside, overlap, negative: count(samples.whole(min) < 0, |w| -w) }
    }

    fn scaled(self, by: u128) -> Sums {
        Sums {
            chords: self.chords.map(|c| c * by),
            inside: self.inside * by,
            overlap: self.overlap.scaled(by),
            negative: self.negative.scaled(by),
        }
    }
}

/// What lies inside of the edges along `axis` that a brick owns, in [`STEPS`].
fn chords(signs: &SignChanges, edges: &[HermiteEdge], axis: Axis) -> u128 {
    let mut whole = 0u64;
    for k in 0..BRICK_CELLS {
        for j in 0..BRICK_CELLS {
            let row = signs.row(j, k);
            let next = match axis {
                Axis::X => row >> 1,
                Axis::Y => signs.row(j + 1, k),
                Axis::Z => signs.row(j, k + 1),
            };
            whole += u64::from((row & next & OWN).count_ones());
        }
    }
    let (mut parts, mut edges) = (0u64, edges.iter());
    signs.for_edges(axis, |from| {
        let offset = edges.next().map_or(0, |edge| u64::from(edge.offset));
        if from.iter().all(|&c| c < BRICK_CELLS) {
            parts += if signs.is_inside(from) { offset } else { STEPS as u64 - offset };
        }
    });
    u128::from(whole) * STEPS + u128::from(parts)
}

/// The part of [`Volumes::negative`] of a tree whose samples are whole numbers; `None` if some are not, as where the input
/// is open. Reads only leaves in which w is negative somewhere.
///
/// # Errors
/// As [`volume`].
pub fn negative_volume(tree: &dyn BrickTree, progress: &dyn Progress) -> Result<Option<f64>> {
    let nodes: Vec<(NodeKey, NodeInfo)> =
        tree.keys().into_iter().filter_map(|key| Some((key, tree.node(key)?))).collect();
    if nodes.iter().any(|(_, node)| node.fractions) {
        return Ok(None);
    }
    let leaves: Vec<NodeKey> =
        nodes.into_iter().filter(|(_, node)| node.leaf && node.min < 0).map(|(key, _)| key).collect();
    Ok(Some(volumes_of(tree, &leaves, progress)?.negative))
}

/// The volumes of the tree's field. Reads every leaf that is not uniform, in parallel; sums are integers, so
/// threads change nothing.
///
/// The union is measured by chords between the exact crossings of lattice lines, along each axis; it is their mean, and
/// the bound is the difference of the largest and the smallest, and twice that from the number of samples: a face across an
/// axis puts chords along the two others off alike. Of overlap only samples tell: each edge between two of them may
/// hold the change anywhere, which is the bound, over all three axes. Neither bound knows what is thinner than
/// a cell.
///
/// # Errors
/// What reading the tree gives; [`crate::Error::Interrupted`].
pub fn volume(tree: &dyn BrickTree, progress: &dyn Progress) -> Result<Volumes> {
    let is_leaf = |key: &NodeKey| tree.node(*key).is_some_and(|node| node.leaf);
    let leaves: Vec<NodeKey> = tree.keys().into_iter().filter(is_leaf).collect();
    volumes_of(tree, &leaves, progress)
}

/// Those of some leaves.
fn volumes_of(tree: &dyn BrickTree, leaves: &[NodeKey], progress: &dyn Progress) -> Result<Volumes> {
    progress.phase("volumes", Some(leaves.len() as u64), "bricks");
    let mut sums = Sums::default();
    let of_leaf =
        |leaf: &Leaf<'_>| Ok(Sums::of_brick(leaf.brick).scaled(1 << (3 * (MAX_LEVEL - leaf.key.level()))));
    visit(tree, leaves, progress, of_leaf, |_, of_leaf| {
        sums = sums.and(of_leaf);
        Ok(())
    })?;
    let cell = tree.root().spacing(MAX_LEVEL).powi(3);
    let chords = sums.chords.map(|chords| chords as f64 / STEPS as f64 * cell);
    let [low, high] = [f64::min, f64::max].map(|f| chords.into_iter().reduce(f).unwrap_or_default());
    let bound = |count: Count| count.changes.iter().sum::<u128>() as f64 * 0.5 * cell;
    let union = chords.iter().sum::<f64>() / 3.0;
    // Chords along two of the axes are off by what a face across the third one is, samples by all three.
    let of_faces = 2.0 * (sums.inside as f64 * cell - union).abs();
    Ok(Volumes {
        union,
        union_error: high - low + of_faces,
        overlap: sums.overlap.sum as f64 * cell,
        overlap_error: bound(sums.overlap),
        negative: sums.negative.sum as f64 * cell,
        negative_error: bound(sums.negative),
    })
}
