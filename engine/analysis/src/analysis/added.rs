//! By how much more one tree covers than another that it was made of.

use super::faces::{Faces, STEPS};
use super::volume::{at_edges, lone_of_row, spread, sums_of};
use crate::brick::{Brick, HermiteEdge, SignChanges};
use crate::error::Result;
use crate::lattice::{Axis, BRICK_CELLS, MAX_LEVEL, NodeKey};
use crate::progress::Progress;
use crate::store::{BrickTree, Leaf, visit};

/// What two trees do not share, in cells of the deepest level there can be.
#[derive(Clone, Copy, Default)]
struct Apart {
    /// Crossings of one of them alone.
    faces: Faces,
    /// Walls and gaps of a single sample of one of them alone, by axis.
    lone: [u128; 3],
}

impl Apart {
    fn and(self, other: Apart) -> Apart {
        Apart { faces: self.faces.and(other.faces), lone: [0, 1, 2].map(|a| self.lone[a] + other.lone[a]) }
    }

    /// Of two bricks of a leaf.
    fn of(bricks: [&Brick; 2], scale: u128) -> Apart {
        let signs = bricks.map(Brick::signs);
        let mut apart = Apart::default();
        for axis in Axis::ALL {
            let [before, after] = [0, 1].map(|n| crossings(bricks[n], &signs[n], axis));
            for (here, there, signs) in [(&before, &after, &signs[0]), (&after, &before, &signs[1])] {
                let is_shared = |(from, edge): &Crossing| {
                    there.binary_search_by_key(from, |c| c.0).is_ok_and(|n| there[n].1 == *edge)
                };
                for ([z, y, x], edge) in here.iter().filter(|crossing| !is_shared(crossing)) {
                    apart.faces.add(axis.index(), edge, signs.is_inside([*x, *y, *z]));
                }
            }
        }
        for (j, k) in (0..BRICK_CELLS * BRICK_CELLS).map(|n| (n % BRICK_CELLS, n / BRICK_CELLS)) {
            let [before, after] = [0, 1].map(|n| lone_of_row(&signs[n], j, k));
            (0..3).for_each(|a| apart.lone[a] += u128::from((before[a] ^ after[a]).count_ones()));
        }
        Apart { faces: apart.faces.scaled(scale), lone: apart.lone.map(|l| l * scale) }
    }
}

/// The lower sample of an edge, z first, and the crossing there.
type Crossing = ([usize; 3], HermiteEdge);

/// The crossings along an axis that a brick owns, in order.
fn crossings(brick: &Brick, signs: &SignChanges, axis: Axis) -> Vec<Crossing> {
    let Brick::Counts { hermite, .. } = brick else { return Vec::new() };
    let mut found = Vec::new();
    signs.for_crossings(axis, hermite, |[x, y, z], edge| {
        if [x, y, z].iter().all(|&c| c < BRICK_CELLS) {
            found.push(([z, y, x], edge));
        }
    });
    found
}

/// By how much more `after` covers than `before`, a tree on the same lattice, with a bound on the error. The bound is as that of
/// [`super::volume`], but what both trees share counts for none.
///
/// # Errors
/// As [`super::volume`].
pub fn volume_added(
    before: &dyn BrickTree,
    after: &dyn BrickTree,
    progress: &dyn Progress,
) -> Result<(f64, f64)> {
    let is_leaf = |tree: &dyn BrickTree, key: NodeKey| tree.node(key).is_some_and(|node| node.leaf);
    let leaves = |tree: &dyn BrickTree| -> Vec<NodeKey> {
        tree.keys().into_iter().filter(|&key| is_leaf(tree, key)).collect()
    };
    let (all_before, all_after) = (leaves(before), leaves(after));
    // Of leaves that only one of them has, all counts; where the other has them divided, that counts there.
    let alone: Vec<NodeKey> = all_before.iter().copied().filter(|&key| !is_leaf(after, key)).collect();
    let shared = compare(after, &all_after, before, progress)?;
    let apart = shared.and(compare(before, &alone, after, progress)?);
    let [was, is] = [sums_of(before, &all_before, progress)?, sums_of(after, &all_after, progress)?];
    let cell = after.root().spacing(MAX_LEVEL).powi(3);
    let in_steps = |steps: i128| steps as f64 / STEPS as f64 * cell;
    let more = |is: u128, was: u128| is.cast_signed() - was.cast_signed();
    let by_axis = [0, 1, 2]
        .map(|a| in_steps(more(is.chords[a], was.chords[a]) + is.faces.beside[a] - was.faces.beside[a]));
    let Faces { nearly, scatter, size, crossings, .. } = apart.faces;
    let nearly: f64 = nearly.into_iter().map(|sum| in_steps(sum).abs()).sum();
    let edges = at_edges(is.inside as f64 * cell, size.map(|sum| in_steps(sum.cast_signed())));
    let lone = apart.lone.into_iter().max().unwrap_or_default() as f64 * cell;
    let scatter = (scatter as f64).sqrt() * cell;
    let error = spread(by_axis) + edges + nearly + scatter + lone + in_steps(crossings.cast_signed());
    Ok((by_axis.iter().sum::<f64>() / 3.0, error))
}

/// What leaves of a tree have apart from those of another, if that has them.
fn compare(
    tree: &dyn BrickTree,
    leaves: &[NodeKey],
    other: &dyn BrickTree,
    progress: &dyn Progress,
) -> Result<Apart> {
    progress.phase("what differs", Some(leaves.len() as u64), "bricks");
    let make = |leaf: &Leaf<'_>| {
        let scale = 1 << (3 * (MAX_LEVEL - leaf.key.level()));
        if other.node(leaf.key).is_none_or(|node| !node.leaf) {
            return Ok(Apart::of([&Brick::Uniform(0), leaf.brick], scale));
        }
        let there = other.brick_once(leaf.key)?;
        Ok(if *there == *leaf.brick { Apart::default() } else { Apart::of([&there, leaf.brick], scale) })
    };
    let mut apart = Apart::default();
    visit(tree, leaves, progress, make, |_, of_leaf| {
        apart = apart.and(of_leaf);
        Ok(())
    })?;
    Ok(apart)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::brick::{Hermite, OctNormal, Samples};
    use crate::lattice::RootCube;
    use crate::store::MemoryTree;

    /// A tree of one brick whose samples below a height are inside, but for those of a column, `hole`, from 5 up.
    fn tree(height: usize, hole: Option<[usize; 2]>) -> MemoryTree {
        let edge = 1.0;
        let root = RootCube { origin: [0.0; 3], edge };
        let is_inside = |[x, y, z]: [usize; 3]| z < height && (z < 5 || hole != Some([x, y]));
        let mut samples = Samples::filled(0);
        let at = |n: usize| [n % 33, n / 33 % 33, n / 33 / 33];
        samples.0.iter_mut().enumerate().for_each(|(n, s)| *s = i16::from(is_inside(at(n))));
        let signs = SignChanges::of(&samples);
        let mut hermite = Hermite::default();
        for axis in Axis::ALL {
            signs.for_edges(axis, |low| {
                let mut normal = [0; 3];
                normal[axis.index()] = if is_inside(low) { 1 } else { -1 };
                let edge = HermiteEdge { offset: 1 << 15, normal: OctNormal::from_integer(normal) };
                hermite.edges[axis.index()].push(edge);
            });
        }
        let mut tree = MemoryTree::new(root);
        tree.insert(NodeKey::ROOT, true, Brick::from_samples(samples, hermite));
        tree
    }

    #[test]
    fn what_is_filled_is_told_and_what_is_shared_is_no_error() {
        let progress = crate::progress::Silent;
        let cell = tree(9, None).root().spacing(0).powi(3);
        let (same, no_error) = volume_added(&tree(9, None), &tree(9, None), &progress).unwrap();
        assert_eq!((same, no_error), (0.0, 0.0));
        // A hole of one column and four samples, and half a cell to each side.
        let (volume, error) = volume_added(&tree(9, Some([7, 8])), &tree(9, None), &progress).unwrap();
        assert!((volume / cell - 4.0).abs() < 0.1 && error > 0.0 && error < 12.0 * cell, "{volume} {error}");
        // A layer more.
        let (volume, error) = volume_added(&tree(9, None), &tree(10, None), &progress).unwrap();
        assert!((volume / cell - 1024.0).abs() < 1e-6 && error < 2.0 * 1024.0 * cell, "{volume} {error}");
        let (volume, _) = volume_added(&tree(10, None), &tree(9, None), &progress).unwrap();
        assert!((volume / cell + 1024.0).abs() < 1e-6);
    }
}
