//! How much space is covered, and how much of it more than once, from a store alone.

use super::faces::{Faces, STEPS};
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

impl Volumes {
    /// With bounds that are no smaller than what the source, integrated without samples, shows these to be off by.
    pub fn not_nearer_than(self, source: &Volumes) -> Volumes {
        let bound = |here: f64, error: f64, there: f64, its: f64| error.max((here - there).abs() + its);
        Volumes {
            union_error: bound(self.union, self.union_error, source.union, source.union_error),
            overlap_error: bound(self.overlap, self.overlap_error, source.overlap, source.overlap_error),
            negative_error: bound(self.negative, self.negative_error, source.negative, source.negative_error),
            ..self
        }
    }
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

/// ChordSums in cells of the deepest level there can be, exact for any tree.
#[derive(Clone, Copy, Default)]
pub(super) struct ChordSums {
    /// Chords of the union along each axis, in [`STEPS`].
    pub chords: [u128; 3],
    /// Samples of the union.
    pub inside: u128,
    /// What faces add that chords along an axis do not see, as they run along these; see [`Faces`].
    pub faces: Faces,
    /// Samples unlike both neighbours along an axis, by axis.
    lone: [u128; 3],
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

impl ChordSums {
    fn and(self, other: ChordSums) -> ChordSums {
        ChordSums {
            chords: [0, 1, 2].map(|a| self.chords[a] + other.chords[a]),
            inside: self.inside + other.inside,
            faces: self.faces.and(other.faces),
            lone: [0, 1, 2].map(|a| self.lone[a] + other.lone[a]),
            overlap: self.overlap.and(other.overlap),
            negative: self.negative.and(other.negative),
        }
    }

    /// Of `count` samples that are all `w`.
    fn of_equal(w: i16, count: u128) -> ChordSums {
        let of = |w: i32| Count { sum: u128::from(w.max(0).unsigned_abs()) * count, ..Count::default() };
        let w = i32::from(w);
        let inside = u128::from(w >= 1) * count;
        ChordSums {
            chords: [inside * STEPS; 3],
            inside,
            overlap: of(w - 1),
            negative: of(-w),
            ..ChordSums::default()
        }
    }

    /// Of a leaf's own 32³ cells.
    fn of_brick(brick: &Brick) -> ChordSums {
        let (samples, hermite) = match brick {
            Brick::Uniform(w) => return ChordSums::of_equal(*w, (BRICK_CELLS as u128).pow(3)),
            Brick::Counts { samples, hermite } => (samples, hermite),
        };
        let signs = SignChanges::of(samples);
        let mut faces = Faces::default();
        let chords = Axis::ALL.map(|axis| chords(&signs, &hermite.edges[axis.index()], axis, &mut faces));
        let own = |row: usize| signs.row(row % BRICK_CELLS, row / BRICK_CELLS) & OWN;
        let inside = (0..BRICK_CELLS * BRICK_CELLS).map(|row| u128::from(own(row).count_ones())).sum();
        let (min, max) = samples.range();
        let count = |there: bool, part| if there { Count::of(samples, part) } else { Count::default() };
        let overlap = count(samples.whole(max) > 1, |w| w - 1);
        let negative = count(samples.whole(min) < 0, |w| -w);
        ChordSums { chords, inside, faces, lone: lone(&signs), overlap, negative }
    }

    fn scaled(self, by: u128) -> ChordSums {
        ChordSums {
            chords: self.chords.map(|c| c * by),
            inside: self.inside * by,
            faces: self.faces.scaled(by),
            lone: self.lone.map(|l| l * by),
            overlap: self.overlap.scaled(by),
            negative: self.negative.scaled(by),
        }
    }
}

/// What lies inside of the edges along `axis` that a brick owns, in [`STEPS`]. Their crossings are added to `faces`.
fn chords(signs: &SignChanges, edges: &[HermiteEdge], axis: Axis, faces: &mut Faces) -> u128 {
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
        let edge = edges.next();
        if from.iter().all(|&c| c < BRICK_CELLS) {
            let (inside, offset) = (signs.is_inside(from), edge.map_or(0, |edge| u64::from(edge.offset)));
            parts += if inside { offset } else { STEPS as u64 - offset };
            if let Some(edge) = edge {
                faces.add(axis.index(), edge, inside);
            }
        }
    });
    u128::from(whole) * STEPS + u128::from(parts)
}

/// Samples of a brick that lie on the other side of the surface than both neighbours along an axis: walls and gaps of less
/// than two cells. The first sample of a row has a neighbour in another brick and is left out.
fn lone(signs: &SignChanges) -> [u128; 3] {
    let mut found = [0; 3];
    for row in 0..BRICK_CELLS * BRICK_CELLS {
        let lone = lone_of_row(signs, row % BRICK_CELLS, row / BRICK_CELLS);
        (0..3).for_each(|a| found[a] += u128::from(lone[a].count_ones()));
    }
    found
}

/// Those of a row, by axis: bit `i` is set where sample i is one.
pub(super) fn lone_of_row(signs: &SignChanges, j: usize, k: usize) -> [u64; 3] {
    let unlike = |before: u64, here: u64, after: u64| (here ^ before) & (here ^ after) & OWN;
    let row = signs.row(j, k);
    let beside = |is_first: bool, before: &dyn Fn() -> u64, after: u64| {
        if is_first { 0 } else { unlike(before(), row, after) }
    };
    [
        // The first sample stands in for the one before it.
        unlike(row << 1 | row & 1, row, row >> 1),
        beside(j == 0, &|| signs.row(j - 1, k), signs.row(j + 1, k)),
        beside(k == 0, &|| signs.row(j, k - 1), signs.row(j, k + 1)),
    ]
}

/// [`Volumes::negative`] and the bound on its error, of a tree whose samples are whole numbers; `None` if some are not, as where the input
/// is open. Reads only leaves in which w is negative somewhere.
///
/// # Errors
/// As [`volume`].
pub fn negative_volume(tree: &dyn BrickTree, progress: &dyn Progress) -> Result<Option<(f64, f64)>> {
    let nodes: Vec<(NodeKey, NodeInfo)> =
        tree.keys().into_iter().filter_map(|key| Some((key, tree.node(key)?))).collect();
    if nodes.iter().any(|(_, node)| node.fractions) {
        return Ok(None);
    }
    let leaves: Vec<NodeKey> =
        nodes.into_iter().filter(|(_, node)| node.leaf && node.min < 0).map(|(key, _)| key).collect();
    let volumes = volumes_of(tree, &leaves, progress)?;
    Ok(Some((volumes.negative, volumes.negative_error)))
}

/// The volumes of the tree's field. Reads every leaf that is not uniform, in parallel; sums are integers, so
/// threads change nothing.
///
/// The union is measured by chords between the exact crossings of lattice lines, along each axis, with what faces along
/// them add (see `Faces`); it is their mean. The bound adds up
///
/// - the difference of the largest and the smallest;
/// - what is left at the edges between two faces along the axes, at most the product of what they add;
/// - what faces that nearly run along an axis would add, as the places of their crossings repeat slowly;
/// - the root of the number of all other crossings, in cells, as if each were off by one and the signs were random;
/// - a cell for each wall or gap of a single sample, along the axis with most of them: lines beside may hold twice as much
///   of it, or nothing;
/// - for each crossing a step of 1/65536 of a cell, to which it is known.
///
/// Of overlap only samples tell: each edge between two of them may hold the change anywhere, which is the bound, over
/// all three axes. Neither bound knows what lies between samples altogether: [`Volumes::not_nearer_than`] does, where
/// the source has been integrated.
///
/// # Errors
/// What reading the tree gives; [`crate::error::Error::Interrupted`].
pub fn volume(tree: &dyn BrickTree, progress: &dyn Progress) -> Result<Volumes> {
    let is_leaf = |key: &NodeKey| tree.node(*key).is_some_and(|node| node.leaf);
    let leaves: Vec<NodeKey> = tree.keys().into_iter().filter(is_leaf).collect();
    volumes_of(tree, &leaves, progress)
}

/// Those of some leaves.
fn volumes_of(tree: &dyn BrickTree, leaves: &[NodeKey], progress: &dyn Progress) -> Result<Volumes> {
    let sums = sums_of(tree, leaves, progress)?;
    let cell = tree.root().spacing(MAX_LEVEL).powi(3);
    let in_steps = |steps: f64| steps / STEPS as f64 * cell;
    let Faces { beside, nearly, scatter, size, crossings } = sums.faces;
    let chords = [0, 1, 2].map(|a| in_steps(sums.chords[a] as f64 + beside[a] as f64));
    let bound = |count: Count| count.changes.iter().sum::<u128>() as f64 * 0.5 * cell;
    let union = chords.iter().sum::<f64>() / 3.0;
    let at_edges = at_edges(sums.inside as f64 * cell, size.map(|sum| in_steps(sum as f64)));
    let nearly = nearly.iter().map(|sum| in_steps(sum.unsigned_abs() as f64)).sum::<f64>();
    let scatter = (scatter as f64).sqrt() * cell;
    let lone = sums.lone.into_iter().max().unwrap_or_default() as f64 * cell;
    Ok(Volumes {
        union,
        union_error: spread(chords) + at_edges + nearly + scatter + lone + in_steps(crossings as f64),
        overlap: sums.overlap.sum as f64 * cell,
        overlap_error: bound(sums.overlap),
        negative: sums.negative.sum as f64 * cell,
        negative_error: bound(sums.negative),
    })
}

/// The sums of some leaves.
pub(super) fn sums_of(
    tree: &dyn BrickTree,
    leaves: &[NodeKey],
    progress: &dyn Progress,
) -> Result<ChordSums> {
    progress.phase("volumes", Some(leaves.len() as u64), "bricks");
    let mut sums = ChordSums::default();
    let of_leaf = |leaf: &Leaf<'_>| {
        Ok(ChordSums::of_brick(leaf.brick).scaled(1 << (3 * (MAX_LEVEL - leaf.key.level()))))
    };
    visit(tree, leaves, progress, of_leaf, |_, of_leaf| {
        sums = sums.and(of_leaf);
        Ok(())
    })?;
    Ok(sums)
}

/// The difference of the largest and the smallest of what three axes say.
pub(crate) fn spread(by_axis: [f64; 3]) -> f64 {
    let [low, high] = [f64::min, f64::max].map(|f| by_axis.into_iter().reduce(f).unwrap_or_default());
    high - low
}

/// What is left at edges and corners, where faces across two or three axes meet that add so much each to a number of
/// samples, `count`: each adds to what the others add, and no more than if all met all others, as in a box.
pub(super) fn at_edges(count: f64, [x, y, z]: [f64; 3]) -> f64 {
    if count <= 0.0 {
        return 0.0;
    }
    ((x * y + y * z + z * x) / count + x * y * z / (count * count)) * 1.01
}
