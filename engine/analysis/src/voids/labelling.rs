//! Connected components of a whole tree, leaf by leaf with an active border.
//!
//! Each leaf has components of its own, numbered through all leaves in Morton order; a table says with which of an earlier
//! number one hangs together. Every neighbourhood lies in one closed brick, so all that joins leaves are the samples that
//! they share: those of the faces between them, of which the finer leaf's lattice holds the coarser one's. A uniform
//! leaf joins whatever of its class touches it. Kept are the labels of faces beyond which leaves are still to come: the
//! border (Isenburg & Shewchuk 2009), and four bytes for each component of a leaf.

use super::border::{Border, Face};
use super::components::{Components, Connectivity, FaceLabels};
use super::measure::{Sums, sums_of};
use crate::error::{Error, Result};
use crate::lattice::{Axis, BRICK_CELLS, BRICK_POINTS, NodeKey};
use crate::progress::Progress;
use crate::sets::DisjointSets;
use crate::store::{BrickTree, Leaf, LeafOrder, visit};

/// The component that touches the outside of the root, through all leaves.
const OUTSIDE: u32 = 0;

/// A connected component of the tree.
#[derive(Clone, Debug)]
pub struct Component {
    /// Whether its samples are 1 and more.
    pub solid: bool,
    /// What was summed of it.
    pub sums: Sums,
    /// Whether it lies in leaves of different levels that meet where it ends or passes: their faces do not match sample by
    /// sample, so its Euler number is not known.
    pub uneven: bool,
}

/// The components of a tree.
pub struct Labelling {
    /// All leaves.
    pub order: LeafOrder,
    /// Which samples are neighbours.
    pub connectivity: Connectivity,
    /// Voids that do not touch the outside, and solid ones, by first leaf.
    pub components: Vec<Component>,
    /// The void outside.
    pub outside: Sums,
    /// By leaf, its first component's place in `of`.
    first: Vec<u32>,
    /// By component of a leaf, that of the tree; [`u32::MAX`] for the outside.
    of: Vec<u32>,
}

/// What the threads make of a leaf.
struct LeafComponents {
    solid: Vec<bool>,
    sums: Vec<Sums>,
    uniform: bool,
    /// By axis and side.
    faces: [[FaceLabels; 2]; 3],
}

impl LeafComponents {
    fn of(leaf: &Leaf<'_>, connectivity: Connectivity) -> LeafComponents {
        let (components, signs) = Components::of(leaf.brick, connectivity);
        let sums = sums_of(leaf.key, leaf.brick, &components, signs.as_ref());
        let faces = Axis::ALL.map(|axis| [false, true].map(|upper| components.face(axis, upper)));
        LeafComponents { uniform: components.len() == 1, solid: components.solid, sums, faces }
    }
}

/// A leaf beyond whose faces others are still to come.
struct PendingLeaf {
    first: u32,
    uniform: bool,
    solid: Vec<bool>,
    faces: [[FaceLabels; 2]; 3],
}

/// The components of `tree`, with their sums.
///
/// # Errors
/// What reading the tree gives; [`Error::Setting`] if it contradicts itself or has more than 2^32 − 1 components in leaves;
/// [`Error::Interrupted`].
pub fn label(tree: &dyn BrickTree, connectivity: Connectivity, progress: &dyn Progress) -> Result<Labelling> {
    let order = LeafOrder::new(tree)?;
    progress.phase("connected components", Some(order.keys().len() as u64), "bricks");
    let mut joiner = Joiner::new(&order);
    let make = |leaf: &Leaf<'_>| Ok(LeafComponents::of(leaf, connectivity));
    visit(tree, order.keys(), progress, make, |number, made| joiner.add(number, made))?;
    let (first, of, components, outside) = joiner.finish();
    Ok(Labelling { connectivity, components, outside, first, of, order })
}

impl Labelling {
    /// Bytes that it takes.
    pub(super) fn heap_bytes(&self) -> u64 {
        let leaves = self.order.keys().len() * (size_of::<NodeKey>() + size_of::<u64>());
        let components = self.components.len() * size_of::<Component>();
        (leaves + components + 4 * (self.first.len() + self.of.len())) as u64
    }

    /// The component of the tree that one of a leaf belongs to, as a place in [`Labelling::components`]; `None` for the
    /// outside.
    pub fn of(&self, leaf: usize, label: u16) -> Option<usize> {
        let component = self.of[self.first[leaf] as usize + usize::from(label)];
        (component != u32::MAX).then_some(component as usize)
    }

    /// The components of a leaf alone, as they were numbered.
    ///
    /// # Errors
    /// What reading the tree gives.
    pub(super) fn components_of(&self, tree: &dyn BrickTree, leaf: usize) -> Result<Components> {
        let brick = tree.brick_once(self.order.keys()[leaf])?;
        Ok(Components::of(&brick, self.connectivity).0)
    }

    /// Visits the leaves that `is_wanted` picks, each with its number and its components, as [`visit`]. The phase of the
    /// progress has this name.
    ///
    /// # Errors
    /// As [`visit`].
    pub(super) fn visit_some<T: Send>(
        &self,
        tree: &dyn BrickTree,
        is_wanted: impl Fn(usize) -> bool,
        (phase, progress): (&str, &dyn Progress),
        make: impl Fn(usize, &Leaf<'_>, &Components) -> Result<T> + Sync,
        mut take: impl FnMut(T) -> Result<()> + Send,
    ) -> Result<()> {
        let keys = self.order.keys();
        let wanted: Vec<usize> = (0..keys.len()).filter(|&leaf| is_wanted(leaf)).collect();
        let wanted_keys: Vec<NodeKey> = wanted.iter().map(|&leaf| keys[leaf]).collect();
        progress.phase(phase, Some(wanted.len() as u64), "bricks");
        let make = |leaf: &Leaf<'_>| {
            make(wanted[leaf.number], leaf, &Components::of(leaf.brick, self.connectivity).0)
        };
        visit(tree, &wanted_keys, progress, make, |_, made| take(made))
    }

    /// By component of the tree, the first and the last leaf that it has a part in.
    pub(super) fn leaf_spans(&self) -> Vec<[u32; 2]> {
        let mut spans = vec![[u32::MAX, 0]; self.components.len()];
        for leaf in 0..self.order.keys().len() as u32 {
            for component in self.in_leaf(leaf as usize).flatten() {
                let [first, last] = &mut spans[component];
                (*first, *last) = (leaf.min(*first), leaf);
            }
        }
        spans
    }

    /// The components of the tree that have a part in a leaf, by component of the leaf.
    pub fn in_leaf(&self, leaf: usize) -> impl Iterator<Item = Option<usize>> {
        let to = self.first.get(leaf + 1).map_or(self.of.len(), |&to| to as usize);
        let of = &self.of[self.first[leaf] as usize..to];
        of.iter().map(|&component| (component != u32::MAX).then_some(component as usize))
    }
}

struct Joiner<'a> {
    order: &'a LeafOrder,
    /// Of the outside and the components of leaves.
    sets: DisjointSets,
    first: Vec<u32>,
    /// What was summed of sets, in any order.
    sums: Vec<Component>,
    /// By component of a leaf, the place in `sums`, if it is the first one of its set.
    places: Vec<u32>,
    /// Places in `sums` that can be taken again.
    free: Vec<u32>,
    border: Border<PendingLeaf>,
}

impl<'a> Joiner<'a> {
    fn new(order: &'a LeafOrder) -> Joiner<'a> {
        let outside = Component { solid: false, sums: Sums::default(), uneven: false };
        let mut sets = DisjointSets::default();
        sets.extend(1);
        Joiner {
            order,
            sets,
            first: Vec::with_capacity(order.keys().len()),
            sums: vec![outside],
            places: vec![0],
            free: Vec::new(),
            border: Border::default(),
        }
    }

    fn add(&mut self, leaf: usize, made: LeafComponents) -> Result<()> {
        let count = made.sums.len();
        let first = u32::try_from(self.sets.len() + count).map_err(|_| too_many())? - count as u32;
        self.first.push(first);
        self.sets.extend(count);
        for (&solid, sums) in made.solid.iter().zip(made.sums) {
            let component = Component { solid, sums, uneven: false };
            self.places.push(match self.free.pop() {
                Some(place) => {
                    self.sums[place as usize] = component;
                    place
                }
                None => {
                    self.sums.push(component);
                    self.sums.len() as u32 - 1
                }
            });
        }
        let own = PendingLeaf { first, uniform: made.uniform, solid: made.solid, faces: made.faces };
        let mut border = std::mem::take(&mut self.border);
        border.add(self.order, leaf, own, |own, face, there| match there {
            None => self.join_outside(own, face),
            Some((other, there)) => self.join_leaves((leaf, own), (other, there), face),
        });
        self.border = border;
        Ok(())
    }

    fn join_outside(&mut self, own: &PendingLeaf, (axis, upper): Face) {
        for &(_, label) in &own.faces[axis.index()][usize::from(upper)] {
            if !own.solid[usize::from(label)] {
                self.unite(OUTSIDE, own.first + u32::from(label));
            }
        }
    }

    /// Joins a leaf to one that came before, which lies across its lower or upper face.
    fn join_leaves(
        &mut self,
        (leaf, own): (usize, &PendingLeaf),
        (other, there): (usize, &PendingLeaf),
        (axis, upper): Face,
    ) {
        let own_face = &own.faces[axis.index()][usize::from(upper)];
        let their_face = &there.faces[axis.index()][usize::from(!upper)];
        let keys = self.order.keys();
        let is_finer = keys[leaf].level() > keys[other].level();
        let mut pairs = Vec::new();
        if keys[leaf].level() == keys[other].level() {
            same_level(own_face, their_face, &mut pairs);
        } else if is_finer && there.uniform {
            pairs.extend(labels_of(own_face).into_iter().map(|label| (label, their_face[0].1)));
        } else if !is_finer && own.uniform {
            pairs.extend(labels_of(their_face).into_iter().map(|label| (own_face[0].1, label)));
        } else {
            mixed((leaf, own_face), (other, their_face), axis, self.order, &mut pairs);
        }
        pairs.dedup();
        let is_alike = |&(a, b): &(u16, u16)| own.solid[usize::from(a)] == there.solid[usize::from(b)];
        let (mine, theirs) = (own.first, there.first);
        let pairs: Vec<(u16, u16)> = pairs.into_iter().filter(is_alike).collect();
        if keys[leaf].level() != keys[other].level() {
            // One class all over the coarser face leaves no doubt to the components of that class.
            let coarse = if is_finer { there } else { own };
            let is_plain = |solid: bool| coarse.uniform && coarse.solid[0] == solid;
            let labels = |first: u32, face: &FaceLabels, solid: &[bool]| -> Vec<u32> {
                let uneven =
                    labels_of(face).into_iter().filter(|label| !is_plain(solid[usize::from(*label)]));
                uneven.map(|label| first + u32::from(label)).collect()
            };
            let mut uneven = labels(mine, own_face, &own.solid);
            uneven.extend(labels(theirs, their_face, &there.solid));
            for number in uneven {
                let first = self.sets.find(number) as usize;
                self.sums[self.places[first] as usize].uneven = true;
            }
        }
        for (a, b) in pairs {
            self.unite(mine + u32::from(a), theirs + u32::from(b));
        }
    }

    fn unite(&mut self, a: u32, b: u32) {
        let Some((first, second)) = self.sets.unite(a, b) else { return };
        let [kept, joined] = [first, second].map(|number| self.places[number as usize]);
        let Component { sums, uneven, .. } = self.sums[joined as usize].clone();
        let kept = &mut self.sums[kept as usize];
        kept.sums.add(&sums);
        kept.uneven |= uneven;
        self.free.push(joined);
    }

    /// First components of leaves, components of the tree by those of leaves, all of them, and the outside.
    fn finish(mut self) -> (Vec<u32>, Vec<u32>, Vec<Component>, Sums) {
        let outside = self.sums[OUTSIDE as usize].sums.clone();
        // By place, the component of the tree; what is not one is put behind all.
        let mut order = vec![u32::MAX; self.sums.len()];
        let mut of = self.places;
        let mut count = 0;
        for number in 0..of.len() as u32 {
            let root = self.sets.find(number);
            of[number as usize] = if root == OUTSIDE {
                u32::MAX
            } else if root == number {
                order[of[number as usize] as usize] = count;
                count += 1;
                count - 1
            } else {
                of[root as usize]
            };
        }
        (self.first, of, in_order(self.sums, order, count as usize), outside)
    }
}

/// The first so many things of an order, without room for all of them twice.
fn in_order<T>(mut things: Vec<T>, mut order: Vec<u32>, count: usize) -> Vec<T> {
    for place in 0..things.len() {
        while (order[place] as usize) < count && order[place] as usize != place {
            let to = order[place] as usize;
            things.swap(place, to);
            order.swap(place, to);
        }
    }
    things.truncate(count);
    things.shrink_to_fit();
    things
}

fn too_many() -> Error {
    Error::setting(
        "the bricks of the store have more than 2^32 - 1 components together",
        "choose a coarser level with `brickfield cache prune`",
    )
}

/// The labels on a face, each once.
fn labels_of(face: &FaceLabels) -> Vec<u16> {
    let mut labels: Vec<u16> = face.iter().map(|&(_, label)| label).collect();
    labels.sort_unstable();
    labels.dedup();
    labels
}

/// The labels that meet on a face between leaves of one level.
fn same_level(own: &FaceLabels, other: &FaceLabels, pairs: &mut Vec<(u16, u16)>) {
    let (mut a, mut b) = (0, 0);
    while a < own.len() && b < other.len() {
        pairs.push((own[a].1, other[b].1));
        let (ends, at) = ((own[a].0, other[b].0), own[a].0.min(other[b].0));
        a += usize::from(ends.0 == at);
        b += usize::from(ends.1 == at);
    }
}

/// The labels that meet on a face between leaves of different levels, at the samples that both have.
fn mixed(
    (leaf, own): (usize, &FaceLabels),
    (other, theirs): (usize, &FaceLabels),
    axis: Axis,
    order: &LeafOrder,
    pairs: &mut Vec<(u16, u16)>,
) {
    let keys = order.keys();
    let is_finer = keys[leaf].level() > keys[other].level();
    let ((fine, fine_face), (coarse, coarse_face)) = match is_finer {
        true => ((keys[leaf], own), (keys[other], theirs)),
        false => ((keys[other], theirs), (keys[leaf], own)),
    };
    let step = 1usize << (fine.level() - coarse.level());
    let [u, v] = axis.others_in_order().map(Axis::index);
    // The coarse sample where the fine leaf begins.
    let from = |a: usize| (fine.base()[a] - coarse.base()[a]) as usize >> coarse.spacing_bits();
    let label = |face: &FaceLabels, at: usize| {
        face[face.partition_point(|(end, _)| usize::from(*end) <= at).min(face.len() - 1)].1
    };
    for q in 0..=BRICK_CELLS / step {
        for p in 0..=BRICK_CELLS / step {
            let at_fine = q * step * BRICK_POINTS + p * step;
            let at_coarse = (from(v) + q) * BRICK_POINTS + from(u) + p;
            let (a, b) = (label(fine_face, at_fine), label(coarse_face, at_coarse));
            pairs.push(if is_finer { (a, b) } else { (b, a) });
        }
    }
}
