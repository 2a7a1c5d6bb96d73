//! Whether a void is sealed for certain, opens for certain, or neither as far as is known.
//!
//! Samples connect void that they see; a wall may have a hole that none of them meets, and two samples of void a wall between
//! them. So void is connected once more, through every cell that is not solid for certain. A void that hangs together with
//! the outside not even so is sealed for certain. One that does so through cells that are void for certain opens.
//!
//! At first each leaf is one cell that may be either, but where the build left it undivided above the depth limit, because
//! nothing touches it. Then the source is asked (`matter`), only where it decides something: on the paths from the outside to
//! voids that lead through the fewest groups of cells that may be either. The nodes there are divided, and those below them,
//! until a path is open or shut, or the bound on such nodes is reached.

use super::around::Tracer;
use super::cells::{NONE, VoidCells};
use super::components::Components;
use super::labelling::Labelling;
use super::matter::{Corners, Matter, corners, gather};
use crate::brick::{Brick, point_position};
use crate::error::Result;
use crate::lattice::{Axis, BRICK_CELLS, BRICK_POINTS, MAX_LEVEL, NodeKey, Octant};
use crate::progress::Progress;
use crate::soup::Facets;
use crate::store::{BrickTree, LeafOrder, Refine, Store};
use rayon::prelude::*;
use std::collections::{BTreeMap, BTreeSet, HashMap, VecDeque};
use std::sync::Arc;

/// Levels below the leaves to which the source is followed.
const DEEPER: u8 = 11;
/// Nodes that meshes are asked for in all.
const NODES_OF_MESHES: usize = 12_000;
/// Nodes that beads are asked for beside all leaves: they take longer, and where prints are in dispute they are so everywhere.
const NODES_OF_BEADS: usize = 150;
/// Farther than any path.
const FAR: u32 = u32::MAX;
/// The outside among the vertices; component n is n + 1.
const OUTSIDE: u32 = 0;

/// What can be asked of what lies between samples.
#[derive(Clone, Copy)]
pub(super) enum SubcellField<'a> {
    /// Nothing.
    Samples,
    /// The segments of beads that the store keeps.
    Beads(&'a Tracer<'a>),
    /// The closed meshes that the store was built from.
    Meshes(&'a [&'a dyn Facets]),
}

/// What was found of voids, by component; those in neither list are sealed as far as samples tell.
#[derive(Debug, Default)]
pub(super) struct SealFindings {
    pub certain: BTreeSet<usize>,
    pub open: BTreeSet<usize>,
    /// The source has other samples than the store, so it was not believed.
    pub source_differs: bool,
}

/// A leaf, or a node below one.
struct Node {
    /// The leaf that it belongs to.
    leaf: usize,
    cells: VoidCells,
    /// What touches it, and w at the corners of its children, once it has been asked for.
    asked: Option<(Matter, Corners)>,
}

/// The voids that are sealed for certain and those that open for certain, of those that `is_void` picks.
///
/// # Errors
/// What reading the store gives; [`crate::error::Error::Interrupted`].
pub(super) fn sealed(
    store: &Store,
    labelling: &Labelling,
    is_void: &(dyn Fn(usize) -> bool + Sync),
    source: SubcellField<'_>,
    progress: &dyn Progress,
) -> Result<SealFindings> {
    let mut found = SealFindings::default();
    let count = labelling.components.len();
    let mut left: Vec<usize> = (0..count).filter(|&c| is_void(c) && !labelling.components[c].solid).collect();
    let mut judge = SealRules::new(store, labelling, source);
    let mut nodes = judge.leaves();
    let mut faces = Faces::new();
    let mut budget = judge.budget(&nodes);
    progress.phase("seals of voids", None, "bricks");
    while !left.is_empty() {
        progress.check()?;
        let graph = Graph::of(&nodes, labelling, &mut faces)?;
        let from_outside = graph.distances(&[OUTSIDE]).0;
        left.retain(|&void| match from_outside[void + 1] {
            FAR => !found.certain.insert(void),
            0 => !found.open.insert(void),
            _ => true,
        });
        let keys = judge.worth_asking(&graph, &nodes, &left, &from_outside);
        if keys.is_empty() || keys.len() > budget {
            break;
        }
        let Some(asked) = judge.ask(&mut nodes, &keys, progress)? else {
            return Ok(SealFindings { source_differs: true, ..SealFindings::default() });
        };
        budget = budget.saturating_sub(asked);
        progress.advance(asked as u64);
    }
    Ok(found)
}

/// What decides which cells are solid for certain.
struct SealRules<'a> {
    store: &'a Store,
    labelling: &'a Labelling,
    source: SubcellField<'a>,
    /// Leaves of lower levels are uniform because nothing touches them.
    limit: u8,
}

impl<'a> SealRules<'a> {
    fn new(store: &'a Store, labelling: &'a Labelling, source: SubcellField<'a>) -> SealRules<'a> {
        let meta = store.meta();
        let limit = match meta.refine {
            _ if meta.stddev > 0.0 || meta.tolerance.is_some_and(|t| t > 0.0) => 0,
            Refine::Stddev => 0,
            Refine::Thin { base } => base,
            Refine::Hidden | Refine::Surface => meta.depth,
        };
        SealRules { store, labelling, source, limit }
    }

    /// All leaves, of which nothing was asked.
    fn leaves(&self) -> BTreeMap<NodeKey, Node> {
        let node = |(leaf, &key): (usize, &NodeKey)| {
            let uniform =
                self.store.node(key).filter(|node| node.min == node.max && key.level() < self.limit);
            let voids = || {
                let all = self.labelling.in_leaf(leaf).enumerate();
                all.filter(|(_, c)| c.is_none_or(|c| !self.labelling.components[c].solid))
                    .map(|(n, _)| n as u16)
            };
            let cells = match uniform {
                Some(node) if node.min >= 1 => VoidCells::default(),
                Some(_) => VoidCells::whole(voids(), false),
                None => VoidCells::whole(voids(), true),
            };
            (key, Node { leaf, cells, asked: None })
        };
        self.labelling.order.keys().iter().enumerate().map(node).collect()
    }

    /// How many nodes may be asked for.
    fn budget(&self, nodes: &BTreeMap<NodeKey, Node>) -> usize {
        match self.source {
            SubcellField::Samples => 0,
            SubcellField::Meshes(_) => NODES_OF_MESHES,
            // All leaves, and a few nodes below them.
            SubcellField::Beads(_) => {
                NODES_OF_BEADS + nodes.values().filter(|node| node.cells.either == [true]).count()
            }
        }
    }

    /// The nodes on the shortest paths from the outside to voids that can be asked for, or divided.
    fn worth_asking(
        &self,
        graph: &Graph,
        nodes: &BTreeMap<NodeKey, Node>,
        left: &[usize],
        from_outside: &[u32],
    ) -> Vec<NodeKey> {
        if matches!(self.source, SubcellField::Samples) || left.is_empty() {
            return Vec::new();
        }
        let voids: Vec<u32> = left.iter().map(|&void| void as u32 + 1).collect();
        let (from_voids, nearest) = graph.distances(&voids);
        let is_on_path = |group: usize| {
            let (one, other) = (from_outside[group], from_voids[group]);
            // Both ends count the group itself.
            one != FAR && other != FAR && one + other - 1 == from_outside[nearest[group] as usize]
        };
        let mut keys = Vec::new();
        for (number, key) in graph.order.keys().iter().enumerate() {
            let node = &nodes[key];
            let deepest = (self.labelling.order.keys()[node.leaf].level() + DEEPER).min(MAX_LEVEL);
            let can_be_asked = node.asked.is_none() || key.level() < deepest;
            let first = graph.first[number] as usize;
            let groups = node.cells.either.iter().enumerate();
            if can_be_asked && groups.filter(|(_, either)| **either).any(|(n, _)| is_on_path(first + n)) {
                keys.push(*key);
            }
        }
        keys
    }

    /// Asks the source for leaves, and for the children of nodes that it has been asked for. Gives how many of these something
    /// touches, or `None` if the source has other samples than the store.
    fn ask(
        &mut self,
        nodes: &mut BTreeMap<NodeKey, Node>,
        keys: &[NodeKey],
        progress: &dyn Progress,
    ) -> Result<Option<usize>> {
        let (leaves, divided): (Vec<NodeKey>, Vec<NodeKey>) =
            keys.iter().copied().partition(|key| nodes[key].asked.is_none());
        let bricks: BTreeSet<usize> = keys.iter().map(|key| nodes[key].leaf).collect();
        let read = |leaf: usize| {
            let brick = self.store.brick_once(self.labelling.order.keys()[leaf])?;
            let components = Components::of(&brick, self.labelling.connectivity).0;
            Ok((leaf, (brick, components)))
        };
        let bricks: HashMap<usize, (Arc<Brick>, Components)> =
            bricks.into_par_iter().map(read).collect::<Result<_>>()?;
        let mut tasks: Vec<(NodeKey, usize, i16, Matter)> = Vec::new();
        for (key, matter) in leaves.iter().zip(self.matter(&leaves, progress)?) {
            let leaf = nodes[key].leaf;
            tasks.push((*key, leaf, bricks[&leaf].0.sample([0; 3]), matter));
        }
        for key in divided {
            let Some(Node { leaf, asked: Some((matter, corners)), .. }) = nodes.remove(&key) else {
                continue;
            };
            for octant in Octant::all() {
                let child = key.child(octant);
                let [x, y, z] = octant.offset();
                tasks.push((child, leaf, corners[x][y][z], matter.of_child(child, self.solids())));
            }
        }
        let made: Vec<(NodeKey, Option<Node>)> = tasks
            .into_par_iter()
            .map(|(key, leaf, corner, matter)| {
                progress.check()?;
                let (brick, components) = &bricks[&leaf];
                Ok((key, self.node(key, (leaf, brick, components), corner, matter)?))
            })
            .collect::<Result<_>>()?;
        let asked = made.iter().flat_map(|(_, node)| node).flat_map(|node| &node.asked);
        let asked = asked.filter(|(matter, _)| !matter.is_empty()).count();
        for (key, node) in made {
            let Some(node) = node else { return Ok(None) };
            nodes.insert(key, node);
        }
        Ok(Some(asked))
    }

    fn solids(&self) -> Option<&crate::solid::Solids> {
        match self.source {
            SubcellField::Beads(tracer) => Some(tracer.solids()),
            _ => None,
        }
    }

    /// What touches some leaves.
    fn matter(&self, leaves: &[NodeKey], progress: &dyn Progress) -> Result<Vec<Matter>> {
        match self.source {
            SubcellField::Samples => Ok(Vec::new()),
            SubcellField::Beads(tracer) => {
                leaves.par_iter().map(|leaf| Ok(Matter::Segments(tracer.listed(*leaf)?))).collect()
            }
            SubcellField::Meshes(sources) => {
                let lists = gather(sources, self.store.root(), leaves, progress)?;
                Ok(lists.into_iter().map(Matter::Triangles).collect())
            }
        }
    }

    /// A node with its cells as the source has them; `None` if the source has other samples than the leaf itself.
    fn node(
        &self,
        key: NodeKey,
        (leaf, brick, components): (usize, &Brick, &Components),
        corner: i16,
        matter: Matter,
    ) -> Result<Option<Node>> {
        let leaf_key = self.labelling.order.keys()[leaf];
        if key != leaf_key && matter.is_empty() {
            return Ok(Some(self.empty(key, (leaf, leaf_key, components), corner, matter)));
        }
        let (known, own) = matter.evaluate(key, corner, self.solids())?;
        if let (Some(own), true) = (&own, key == leaf_key) {
            let points = 0..BRICK_POINTS.pow(3);
            if points.into_iter().any(|n| own.sample(point_position(n)) != brick.sample(point_position(n))) {
                return Ok(None);
            }
        }
        let cells = VoidCells::grouped(&known, void_at(key, leaf_key, components));
        let corners = own.as_ref().map_or_else(Corners::default, corners);
        Ok(Some(Node { leaf, cells, asked: Some((matter, corners)) }))
    }

    /// A node that nothing touches.
    fn empty(
        &self,
        key: NodeKey,
        (leaf, leaf_key, components): (usize, NodeKey, &Components),
        corner: i16,
        matter: Matter,
    ) -> Node {
        let is_solid = corner >= 1 && matches!(matter, Matter::Triangles(_));
        let cells = if is_solid {
            VoidCells::default()
        } else {
            let sample = void_at(key, leaf_key, components);
            let cells = 0..BRICK_CELLS.pow(3);
            let at = |n: usize| [n % BRICK_CELLS, n / BRICK_CELLS % BRICK_CELLS, n / BRICK_CELLS.pow(2)];
            let labels: BTreeSet<u16> = cells.filter_map(|n| sample(at(n))).collect();
            VoidCells::whole(labels.into_iter(), false)
        };
        Node { leaf, cells, asked: Some((matter, [[[corner; 3]; 3]; 3])) }
    }
}

/// Tells of which component of the leaf a cell's lower corner is a sample, if it is one of void.
fn void_at<'a>(
    key: NodeKey,
    leaf: NodeKey,
    components: &'a Components,
) -> impl Fn([usize; 3]) -> Option<u16> + 'a {
    let (up, bits) = (key.level() - leaf.level(), key.spacing_bits());
    let offset = [0, 1, 2].map(|a| ((key.base()[a] - leaf.base()[a]) >> bits) as usize);
    move |at| {
        let place = [0, 1, 2].map(|a| offset[a] + at[a]);
        let is_sample = place.iter().all(|c| c & ((1 << up) - 1) == 0);
        let label = is_sample.then(|| components.at(place.map(|c| c >> up)))?;
        (!components.solid[usize::from(label)]).then_some(label)
    }
}

/// Two nodes that touch across the upper face of the first, each with whether it has been asked for, and the axis.
type FaceName = ([(NodeKey, bool); 2], Axis);
/// The groups that touch there, which stay while others are divided.
type Faces = HashMap<FaceName, Vec<(u16, u16)>>;

/// What hangs together with what: the outside, the components of the tree, and the groups of all nodes.
struct Graph {
    order: LeafOrder,
    /// By node, the vertex of its first group.
    first: Vec<u32>,
    /// By vertex, where its neighbours begin.
    begin: Vec<u32>,
    neighbours: Vec<u32>,
    /// By vertex, whether it may be solid as well.
    either: Vec<bool>,
}

impl Graph {
    fn of(nodes: &BTreeMap<NodeKey, Node>, labelling: &Labelling, faces: &mut Faces) -> Result<Graph> {
        let order = LeafOrder::of(nodes.keys().copied().collect())?;
        let mut either = vec![false; labelling.components.len() + 1];
        let mut first = Vec::with_capacity(nodes.len());
        for key in order.keys() {
            first.push(either.len() as u32);
            either.extend(&nodes[key].cells.either);
        }
        let of_node = |number: usize| {
            let key = order.keys()[number];
            let (node, own) = (&nodes[&key], first[number]);
            let mut edges: Vec<(u32, u32)> = Vec::new();
            for &(label, group) in &node.cells.components {
                let component = labelling.of(node.leaf, label).map_or(OUTSIDE, |c| c as u32 + 1);
                edges.push((component, own + u32::from(group)));
            }
            edges.extend(node.cells.beside.iter().map(|&(a, b)| (own + u32::from(a), own + u32::from(b))));
            let (mut touching, mut new) = (Vec::new(), Vec::new());
            for axis in Axis::ALL {
                touching.clear();
                order.touching(number, axis, true, &mut touching);
                for &other in &touching {
                    let there = order.keys()[other];
                    let next = &nodes[&there];
                    let name = ([(key, node.asked.is_some()), (there, next.asked.is_some())], axis);
                    let mut put = |pairs: &[(u16, u16)]| {
                        let edge = |&(a, b): &(u16, u16)| (own + u32::from(a), first[other] + u32::from(b));
                        edges.extend(pairs.iter().map(edge));
                    };
                    if let Some(pairs) = faces.get(&name) {
                        put(pairs);
                    } else {
                        let pairs = joined((&node.cells, key), (&next.cells, there), axis);
                        put(&pairs);
                        new.push((name, pairs));
                    }
                }
            }
            (edges, new)
        };
        let (edges, new): (Vec<_>, Vec<_>) = (0..order.keys().len()).into_par_iter().map(of_node).unzip();
        let edges: Vec<(u32, u32)> = edges.concat();
        faces.extend(new.into_iter().flatten());
        let mut begin = vec![0u32; either.len() + 1];
        edges.iter().flat_map(|&(a, b)| [a, b]).for_each(|vertex| begin[vertex as usize + 1] += 1);
        (1..begin.len()).for_each(|n| begin[n] += begin[n - 1]);
        let mut next = begin.clone();
        let mut neighbours = vec![0; 2 * edges.len()];
        for (a, b) in edges.into_iter().flat_map(|(a, b)| [(a, b), (b, a)]) {
            neighbours[next[a as usize] as usize] = b;
            next[a as usize] += 1;
        }
        Ok(Graph { order, first, begin, neighbours, either })
    }

    /// By vertex, through how many groups that may be solid the way from one of some vertices leads at least, and which one of
    /// these is nearest; [`FAR`] where there is no way.
    fn distances(&self, from: &[u32]) -> (Vec<u32>, Vec<u32>) {
        let mut distance = vec![FAR; self.either.len()];
        let mut nearest = vec![FAR; self.either.len()];
        let mut waiting: VecDeque<u32> = from.iter().copied().collect();
        for &vertex in from {
            (distance[vertex as usize], nearest[vertex as usize]) = (0, vertex);
        }
        while let Some(vertex) = waiting.pop_front() {
            let here = vertex as usize;
            for &next in &self.neighbours[self.begin[here] as usize..self.begin[here + 1] as usize] {
                let step = u32::from(self.either[next as usize]);
                let far = distance[here] + step;
                if far < distance[next as usize] {
                    (distance[next as usize], nearest[next as usize]) = (far, nearest[here]);
                    if step == 0 { waiting.push_front(next) } else { waiting.push_back(next) }
                }
            }
        }
        (distance, nearest)
    }
}

/// The pairs of groups that touch across the upper face of one node along an axis.
fn joined(
    (own, key): (&VoidCells, NodeKey),
    (theirs, other): (&VoidCells, NodeKey),
    axis: Axis,
) -> Vec<(u16, u16)> {
    let (one, two) = (own.face(axis, true), theirs.face(axis, false));
    if one.is_empty() || two.is_empty() {
        return Vec::new();
    }
    if let ([one], [two]) = (one, two) {
        return vec![(*one, *two)];
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
    let mut pairs = Vec::new();
    for n in 0..BRICK_CELLS * BRICK_CELLS {
        let n = [n % BRICK_CELLS, n / BRICK_CELLS];
        let pair = (own.at(axis, true, place(key, n)), theirs.at(axis, false, place(other, n)));
        if pair.0 != NONE && pair.1 != NONE && pairs.last() != Some(&pair) {
            pairs.push(pair);
        }
    }
    pairs.sort_unstable();
    pairs.dedup();
    pairs
}
