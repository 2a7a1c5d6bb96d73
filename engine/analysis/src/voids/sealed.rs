//! Whether a void is sealed for certain, or only as far as samples tell.
//!
//! Samples connect void that they see; a wall may have a hole that none of them meets. So void is connected once more,
//! through every cell that is not solid for certain. A cell is, if one convex segment of a bead covers its eight corners, or
//! two of them do so on both sides of a plane across an axis; and every cell of a leaf that the build left undivided above
//! the depth limit, because nothing touches it. A void that hangs together with the outside neither way is sealed for certain. Where the two differ, the
//! leaves in dispute are divided, and their solids asked again for smaller cells.

use super::border::{Border, Face, Sets};
use super::components::{Components, Connectivity};
use super::labelling::Labelling;
use super::trace::Tracer;
use crate::brick::{Brick, SignChanges};
use crate::error::Result;
use crate::lattice::{Axis, BRICK_CELLS, BRICK_POINTS, MAX_LEVEL, NodeKey, Octant};
use crate::progress::Progress;
use crate::solid::{Segment, Solids, for_lines, for_samples};
use crate::store::{LeafOrder, Refine, Store, visit};
use std::collections::BTreeSet;

/// Levels below the leaves to which disputes are followed.
const DEEPER: u8 = 1;
/// Bricks that are asked again in one round; more stay in dispute.
const BRICKS_MOST: usize = 8_000;
/// Rows of samples of a brick.
const ROWS: usize = BRICK_POINTS * BRICK_POINTS;
/// Stands for a cell that is solid for certain.
const NONE: u16 = u16::MAX;

/// Cells of a node that may be void, as groups that hang together within it.
#[derive(Clone, Debug, Default)]
struct Cells {
    /// How many groups there are.
    groups: usize,
    /// By axis and side: the groups of the cells on a face, or the only one of a node that is one group as a whole.
    faces: [[Vec<u16>; 2]; 3],
    /// Components of the store's leaf that have samples here, and the groups of these.
    components: BTreeSet<(u16, u16)>,
    /// Groups that have more cells than those around samples of void.
    hides: bool,
}

impl Cells {
    /// All cells of a node are one group, to which the components belong that are void.
    fn whole(components: impl Iterator<Item = u16>, hides: bool) -> Cells {
        let face = || [vec![0], vec![0]];
        Cells {
            groups: 1,
            faces: [face(), face(), face()],
            components: components.map(|c| (c, 0)).collect(),
            hides,
        }
    }

    /// The group of a cell on a face.
    fn at(&self, axis: Axis, upper: bool, [p, q]: [usize; 2]) -> u16 {
        let face = &self.faces[axis.index()][usize::from(upper)];
        match face.len() {
            0 => NONE,
            1 => face[0],
            _ => face[q * BRICK_CELLS + p],
        }
    }
}

/// What decides which cells are solid for certain.
struct Judge<'a> {
    store: &'a Store,
    labelling: &'a Labelling,
    tracer: Option<&'a Tracer<'a>>,
    /// Leaves of lower levels are uniform because nothing touches them.
    limit: u8,
}

impl Judge<'_> {
    /// The cells of a node, which is a leaf of the store or below one.
    fn cells(&self, key: NodeKey, leaf: usize, brick: &Brick) -> Result<Cells> {
        let leaf_key = self.labelling.order.keys()[leaf];
        if let Brick::Uniform(w) = brick
            && leaf_key.level() < self.limit
        {
            return Ok(if *w >= 1 { Cells::default() } else { Cells::whole([0].into_iter(), false) });
        }
        let components = Components::of(brick, self.labelling.connectivity).0;
        let voids = || (0..components.len() as u16).filter(|&c| !components.solid[usize::from(c)]);
        let Some(tracer) = self.tracer else { return Ok(Cells::whole(voids(), true)) };
        let segments = tracer.listed(leaf_key)?;
        let solid = solid_cells(tracer.solids(), key, &segments);
        Ok(grouped(&solid, |at| {
            // The leaf's own sample here, if there is one.
            let up = key.level() - leaf_key.level();
            let bits = key.spacing_bits();
            let place = [0, 1, 2].map(|a| ((key.base()[a] - leaf_key.base()[a]) >> bits) as usize + at[a]);
            let is_sample = place.iter().all(|c| c & ((1 << up) - 1) == 0);
            let label = is_sample.then(|| components.at(place.map(|c| c >> up)))?;
            (!components.solid[usize::from(label)]).then_some(label)
        }))
    }
}

/// The cells that are solid for certain, as bits by row k·33 + j; those with an index of 32 are none and count as solid.
fn solid_cells(solids: &Solids, key: NodeKey, segments: &[Segment]) -> Vec<u64> {
    let mut solid = vec![0u64; ROWS];
    let mut samples = vec![0u64; ROWS];
    let mut rows = vec![0u64; ROWS];
    for segment in segments {
        let mut touched = Vec::new();
        for_samples(solids, key, segment, |[j, k], bits| {
            rows[k * BRICK_POINTS + j] = bits;
            touched.push((j, k));
        });
        for &(j, k) in &touched {
            samples[k * BRICK_POINTS + j] |= rows[k * BRICK_POINTS + j];
            if j < BRICK_CELLS && k < BRICK_CELLS {
                let row = k * BRICK_POINTS + j;
                let all = rows[row] & rows[row + 1] & rows[row + BRICK_POINTS] & rows[row + BRICK_POINTS + 1];
                solid[row] |= all & all >> 1;
            }
        }
        touched.iter().for_each(|(j, k)| rows[k * BRICK_POINTS + j] = 0);
    }
    for axis in [Axis::Z, Axis::X, Axis::Y] {
        by_two(solids, key, segments, axis, &samples, &mut solid);
    }
    solid
}

/// Adds cells that two segments cover on both sides of a plane across an axis.
fn by_two(
    solids: &Solids,
    key: NodeKey,
    segments: &[Segment],
    axis: Axis,
    samples: &[u64],
    solid: &mut [u64],
) {
    // By line, the segments there and where these begin and end, in units from the root's corner.
    let mut lines: Vec<(u32, u32, f64, f64)> = Vec::new();
    for (number, segment) in segments.iter().enumerate() {
        for_lines(
            solids,
            key,
            segment,
            axis,
            |_, _| [0.0; 2],
            |line, (from, to)| {
                lines.push((line as u32, number as u32, from, to));
            },
        );
    }
    lines.sort_unstable_by_key(|&(line, number, ..)| (line, number));
    let mut starts = vec![0usize; ROWS + 1];
    lines.iter().for_each(|(line, ..)| starts[*line as usize + 1] += 1);
    (1..starts.len()).for_each(|n| starts[n] += starts[n - 1]);
    let on = |line: usize| &lines[starts[line]..starts[line + 1]];
    let step = f64::from(1u32 << key.spacing_bits());
    let (a, base) = (axis.index(), f64::from(key.base()[axis.index()]) + 1.0);
    let [u, v] = axis.others_in_order().map(Axis::index);
    for k in 0..BRICK_CELLS {
        for j in 0..BRICK_CELLS {
            let row = k * BRICK_POINTS + j;
            let all = samples[row]
                & samples[row + 1]
                & samples[row + BRICK_POINTS]
                & samples[row + BRICK_POINTS + 1];
            let mut open = all & all >> 1 & !solid[row] & ((1 << BRICK_CELLS) - 1);
            while open != 0 {
                let i = open.trailing_zeros() as usize;
                open &= open - 1;
                let at = [i, j, k];
                let line = |p: usize, q: usize| (at[v] + q) * BRICK_POINTS + at[u] + p;
                let four = [(0, 0), (1, 0), (0, 1), (1, 1)].map(|(p, q)| on(line(p, q)));
                let low = base + at[a] as f64 * step;
                if is_covered(four, low, low + step) {
                    solid[row] |= 1 << i;
                }
            }
        }
    }
}

/// Whether one segment holds the lower ends of four lines and another one the upper ones, and they meet at some plane.
fn is_covered(four: [&[(u32, u32, f64, f64)]; 4], low: f64, high: f64) -> bool {
    let of = |line: &[(u32, u32, f64, f64)], number: u32| {
        let at = line.binary_search_by_key(&number, |entry| entry.1).ok()?;
        Some((line[at].2, line[at].3))
    };
    let mut below = f64::NEG_INFINITY;
    for &(_, number, ..) in four[0] {
        let ends = four.map(|line| of(line, number).filter(|(from, to)| *from <= low && *to > low));
        if ends.iter().all(Option::is_some) {
            below = below.max(ends.iter().flatten().map(|(_, to)| *to).fold(f64::INFINITY, f64::min));
        }
    }
    if below == f64::NEG_INFINITY {
        return false;
    }
    four[0].iter().any(|&(_, number, ..)| {
        let ends = four.map(|line| of(line, number).filter(|(from, to)| *from <= high && *to > high));
        ends.iter().all(Option::is_some)
            && ends.iter().flatten().map(|(from, _)| *from).fold(f64::NEG_INFINITY, f64::max) <= below
    })
}

/// Groups of the cells that are not solid. `sample` tells of which component the sample at a cell's lower corner is, if it is
/// void.
fn grouped(solid: &[u64], sample: impl Fn([usize; 3]) -> Option<u16>) -> Cells {
    let signs = SignChanges::from_fn(|n| {
        let at = [n % BRICK_POINTS, n / BRICK_POINTS % BRICK_POINTS, n / BRICK_POINTS / BRICK_POINTS];
        at.contains(&BRICK_CELLS) || solid[at[2] * BRICK_POINTS + at[1]] >> at[0] & 1 == 1
    });
    let components = Components::of_signs(&signs, Connectivity::VoidSix);
    let mut cells = Cells { groups: components.len(), ..Cells::default() };
    let group = |at: [usize; 3]| {
        let label = components.at(at);
        if components.solid[usize::from(label)] { NONE } else { label }
    };
    let mut seen = vec![false; components.len()];
    for n in 0..BRICK_CELLS.pow(3) {
        let at = [n % BRICK_CELLS, n / BRICK_CELLS % BRICK_CELLS, n / BRICK_CELLS / BRICK_CELLS];
        let own = group(at);
        if own == NONE {
            continue;
        }
        match sample(at) {
            Some(component) => drop(cells.components.insert((component, own))),
            None => cells.hides = true,
        }
        seen[usize::from(own)] = true;
    }
    for axis in Axis::ALL {
        for upper in [false, true] {
            let at = |p: usize, q: usize| match (axis, if upper { BRICK_CELLS - 1 } else { 0 }) {
                (Axis::X, w) => [w, p, q],
                (Axis::Y, w) => [p, w, q],
                (Axis::Z, w) => [p, q, w],
            };
            let places = (0..BRICK_CELLS * BRICK_CELLS).map(|n| (n % BRICK_CELLS, n / BRICK_CELLS));
            let face: Vec<u16> = places.map(|(p, q)| group(at(p, q))).collect();
            // Most faces are solid as a whole.
            if face.iter().any(|&group| group != NONE) {
                cells.faces[axis.index()][usize::from(upper)] = face;
            }
        }
    }
    cells
}

/// The outside among the sets; component n is n + 1.
const OUTSIDE: u32 = 0;

/// The voids that are sealed for certain, of those that `is_void` picks.
///
/// # Errors
/// What reading the store gives; [`crate::error::Error::Interrupted`].
pub(super) fn sealed(
    store: &Store,
    labelling: &Labelling,
    is_void: &(dyn Fn(usize) -> bool + Sync),
    tracer: Option<&Tracer<'_>>,
    progress: &dyn Progress,
) -> Result<BTreeSet<usize>> {
    let meta = store.meta();
    let limit = match meta.refine {
        _ if meta.stddev > 0.0 || meta.tolerance.is_some_and(|t| t > 0.0) => 0,
        Refine::Stddev => 0,
        Refine::Thin { base } => base,
        Refine::Hidden | Refine::Surface => meta.depth,
    };
    let judge = Judge { store, labelling, tracer, limit };
    let voids: Vec<usize> =
        (0..labelling.components.len()).filter(|&c| is_void(c) && !labelling.components[c].solid).collect();
    let mut keys: Vec<NodeKey> = labelling.order.keys().to_vec();
    for round in 0..=DEEPER {
        let order = LeafOrder::of(std::mem::take(&mut keys))?;
        let (mut sets, disputed) = connect(&judge, &order, progress)?;
        let outside = sets.find(OUTSIDE);
        let certain: BTreeSet<usize> =
            voids.iter().copied().filter(|&c| sets.find(c as u32 + 1) != outside).collect();
        let can_go_on = tracer.is_some() && round < DEEPER && disputed.len() * 8 <= BRICKS_MOST;
        let is_deepest = disputed.iter().any(|key| key.level() == MAX_LEVEL);
        if certain.len() == voids.len() || !can_go_on || is_deepest || disputed.is_empty() {
            return Ok(certain);
        }
        keys = order.keys().iter().copied().filter(|key| !disputed.contains(key)).collect();
        keys.extend(disputed.iter().flat_map(|key| Octant::all().map(|octant| key.child(octant))));
    }
    Ok(BTreeSet::new())
}

/// Connects what is not solid for certain. Also gives the nodes through which the outside may reach farther than samples
/// tell.
fn connect(
    judge: &Judge<'_>,
    order: &LeafOrder,
    progress: &dyn Progress,
) -> Result<(Sets, BTreeSet<NodeKey>)> {
    let labelling = judge.labelling;
    let count = labelling.components.len() + 1;
    // The outside, the components of the tree, and the groups of all nodes.
    let mut sets = Sets::default();
    sets.extend(count);
    let leaf_of = |key: NodeKey| labelling.order.covering(key);
    let leaves: Vec<NodeKey> = order.keys().iter().map(|key| labelling.order.keys()[leaf_of(*key)]).collect();
    progress.phase("seals of voids", Some(leaves.len() as u64), "bricks");
    let mut border = Border::default();
    // Nodes that hide something, with their groups.
    let mut hiding: Vec<(usize, u32, usize)> = Vec::new();
    let make = |leaf: &crate::store::Leaf<'_>| {
        let key = order.keys()[leaf.number];
        judge.cells(key, leaf_of(key), leaf.brick)
    };
    visit(judge.store, &leaves, progress, make, |number, cells| {
        let first = sets.len() as u32;
        sets.extend(cells.groups);
        for &(label, group) in &cells.components {
            let component = labelling.of(leaf_of(order.keys()[number]), label);
            sets.unite(component.map_or(OUTSIDE, |c| c as u32 + 1), first + u32::from(group));
        }
        if cells.hides {
            hiding.push((number, first, cells.groups));
        }
        border.add(order, number, (first, cells), |own, face, there| {
            if let Some((other, theirs)) = there {
                let keys = [order.keys()[number], order.keys()[other]];
                join(own, theirs, keys, face, &mut sets);
            }
        });
        Ok(())
    })?;
    let outside = sets.find(OUTSIDE);
    let mut disputed = BTreeSet::new();
    for (number, first, groups) in hiding {
        if (first..first + groups as u32).any(|group| sets.find(group) == outside) {
            disputed.insert(order.keys()[number]);
        }
    }
    Ok((sets, disputed))
}

/// Joins the groups of two nodes that touch: of the first one's face along an axis, and the other's.
fn join(
    (first, own): &(u32, Cells),
    (other_first, theirs): &(u32, Cells),
    [key, other]: [NodeKey; 2],
    (axis, upper): Face,
    sets: &mut Sets,
) {
    if own.faces[axis.index()][usize::from(upper)].is_empty()
        || theirs.faces[axis.index()][usize::from(!upper)].is_empty()
    {
        return;
    }
    // Cells of the finer of the two.
    let bits = key.spacing_bits().min(other.spacing_bits());
    let [u, v] = axis.others_in_order().map(Axis::index);
    let fine = if key.spacing_bits() == bits { key } else { other };
    let place = |of: NodeKey, n: [usize; 2]| {
        let at = |side: usize, c: usize| {
            let offset = i64::from(fine.base()[side]) - i64::from(of.base()[side]) + ((c as i64) << bits);
            (offset >> of.spacing_bits()) as usize
        };
        [at(u, n[0]), at(v, n[1])]
    };
    for n in 0..BRICK_CELLS * BRICK_CELLS {
        let n = [n % BRICK_CELLS, n / BRICK_CELLS];
        let one = own.at(axis, upper, place(key, n));
        let two = theirs.at(axis, !upper, place(other, n));
        if one != NONE && two != NONE {
            sets.unite(first + u32::from(one), other_first + u32::from(two));
        }
    }
}
