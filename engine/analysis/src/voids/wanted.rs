//! A tree as it would be without the surfaces that are not asked for: what contours it has less to do.

use super::components::{Components, Run};
use super::labelling::Labelling;
use crate::brick::{Brick, Hermite, Samples, SignChanges};
use crate::error::Result;
use crate::lattice::{Axis, BRICK_POINTS, NodeKey, RootCube};
use crate::store::{BrickTree, NodeInfo};
use std::collections::HashMap;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

/// A tree whose only void is that of some components: what else is outside counts as solid, and has no crossings. Samples and
/// crossings of those components are as they were, and so are counts in the solid.
pub(super) struct WantedVoids<'a> {
    tree: &'a dyn BrickTree,
    labelling: &'a Labelling,
    /// By component.
    wanted: Vec<bool>,
    labels: KeptLabels,
}

/// Of the runs of samples of wanted voids in a leaf the rows, k·33 + j, and the labels.
pub(super) struct WantedRuns(Vec<(u16, Run)>);

impl WantedRuns {
    fn of(components: &Components, kept: &[bool]) -> WantedRuns {
        let mut runs = Vec::new();
        for row in 0..BRICK_POINTS * BRICK_POINTS {
            let own = components.row(row % BRICK_POINTS, row / BRICK_POINTS).iter();
            runs.extend(own.filter(|run| kept[usize::from(run.label)]).map(|run| (row as u16, *run)));
        }
        runs.shrink_to_fit();
        WantedRuns(runs)
    }

    /// The component of a sample, if it is one of a wanted void.
    pub fn at(&self, [i, j, k]: [usize; 3]) -> Option<u16> {
        let (row, i) = ((k * BRICK_POINTS + j) as u16, i as u8);
        let (at, run) = self.0.get(self.0.partition_point(|(at, run)| (*at, run.to) <= (row, i)))?;
        (*at == row && run.from <= i).then_some(run.label)
    }
}

/// Labels of leaves that were read for their surface and are asked for again with their facets, as far as there is room.
#[derive(Default)]
struct KeptLabels {
    most_bytes: usize,
    kept: Mutex<(HashMap<usize, WantedRuns>, usize)>,
    /// By leaf, whether it has been asked for.
    is_done: Vec<AtomicBool>,
}

impl KeptLabels {
    fn keep(&self, leaf: usize, labels: impl FnOnce() -> WantedRuns) {
        if self.is_done[leaf].load(Ordering::Relaxed) {
            return;
        }
        let labels = labels();
        let (kept, bytes) = &mut *self.kept.lock().unwrap_or_else(PoisonError::into_inner);
        let size = size_of_val(&labels.0[..]) + size_of::<(usize, WantedRuns)>();
        if *bytes + size <= self.most_bytes && kept.insert(leaf, labels).is_none() {
            *bytes += size;
        }
    }

    fn take(&self, leaf: usize) -> Option<WantedRuns> {
        self.is_done[leaf].store(true, Ordering::Relaxed);
        let (kept, bytes) = &mut *self.kept.lock().unwrap_or_else(PoisonError::into_inner);
        let labels = kept.remove(&leaf)?;
        *bytes -= size_of_val(&labels.0[..]) + size_of::<(usize, WantedRuns)>();
        Some(labels)
    }
}

impl<'a> WantedVoids<'a> {
    /// With room for so many bytes of labels.
    pub fn new(
        tree: &'a dyn BrickTree,
        labelling: &'a Labelling,
        wanted: Vec<bool>,
        label_bytes: usize,
    ) -> WantedVoids<'a> {
        let is_done = labelling.order.keys().iter().map(|_| AtomicBool::new(false)).collect();
        let labels = KeptLabels { most_bytes: label_bytes, is_done, ..KeptLabels::default() };
        WantedVoids { tree, labelling, wanted, labels }
    }

    /// Where wanted voids are in a leaf. It is asked for once.
    ///
    /// # Errors
    /// What reading the tree gives.
    pub fn labels_of(&self, leaf: usize) -> Result<WantedRuns> {
        if let Some(labels) = self.labels.take(leaf) {
            return Ok(labels);
        }
        Ok(WantedRuns::of(&self.labelling.components_of(self.tree, leaf)?, &self.kept(leaf)))
    }

    /// Whether a part of a wanted component lies in a leaf.
    pub fn is_in(&self, leaf: usize) -> bool {
        self.labelling.in_leaf(leaf).flatten().any(|component| self.wanted[component])
    }

    /// The wanted component of which parts lie in a leaf, if it is the only one.
    pub fn only_in(&self, leaf: usize) -> Option<usize> {
        let mut wanted = self.labelling.in_leaf(leaf).flatten().filter(|component| self.wanted[*component]);
        let first = wanted.next()?;
        wanted.all(|other| other == first).then_some(first)
    }

    /// Whether each of the leaf's components belongs to a wanted one.
    fn kept(&self, leaf: usize) -> Vec<bool> {
        self.labelling.in_leaf(leaf).map(|component| component.is_some_and(|c| self.wanted[c])).collect()
    }

    fn only_wanted(&self, key: NodeKey, brick: Arc<Brick>) -> Arc<Brick> {
        let leaf = self.labelling.order.covering(key);
        let kept = self.kept(leaf);
        if self.labelling.order.keys()[leaf] != key || !kept.contains(&true) {
            return Arc::new(Brick::Uniform(1));
        }
        let Brick::Counts { samples, hermite } = &*brick else { return brick };
        let signs = SignChanges::of(samples);
        let components = Components::of_signs(&signs, self.labelling.connectivity);
        if self.only_in(leaf).is_none() {
            self.labels.keep(leaf, || WantedRuns::of(&components, &kept));
        }
        let (mut samples, mut inside) = (samples.clone(), signs.clone());
        for k in 0..BRICK_POINTS {
            for j in 0..BRICK_POINTS {
                let hidden = components.row(j, k).iter().filter(|run| {
                    let label = usize::from(run.label);
                    !components.solid[label] && !kept[label]
                });
                for run in hidden {
                    fill(&mut samples, (k * BRICK_POINTS + j) * BRICK_POINTS, (run.from, run.to));
                    inside.set_row(j, k, inside.row(j, k) | run.bits());
                }
            }
        }
        let hermite = crossings(hermite, &signs, &inside);
        Arc::new(Brick::from_samples(samples, hermite))
    }
}

impl BrickTree for WantedVoids<'_> {
    fn root(&self) -> RootCube {
        self.tree.root()
    }

    fn node(&self, key: NodeKey) -> Option<NodeInfo> {
        let node = self.tree.node(key)?;
        if node.leaf && !self.is_in(self.labelling.order.covering(key)) {
            return Some(NodeInfo { min: 1, max: 1, fractions: false, ..node });
        }
        Some(node)
    }

    fn keys(&self) -> Vec<NodeKey> {
        self.tree.keys()
    }

    fn deepest_level(&self) -> u8 {
        self.tree.deepest_level()
    }

    fn brick(&self, key: NodeKey) -> Result<Arc<Brick>> {
        Ok(self.only_wanted(key, self.tree.brick(key)?))
    }

    fn brick_once(&self, key: NodeKey) -> Result<Arc<Brick>> {
        Ok(self.only_wanted(key, self.tree.brick_once(key)?))
    }

    fn ahead(&self, keys: &[NodeKey]) -> usize {
        self.tree.ahead(keys)
    }

    fn is_elsewhere(&self) -> bool {
        self.tree.is_elsewhere()
    }
}

/// Makes a run of a row solid.
fn fill(samples: &mut Samples, row: usize, (from, to): (u8, u8)) {
    let solid = 1 << samples.1;
    samples.0[row + usize::from(from)..row + usize::from(to)].fill(solid);
}

/// The crossings of edges that still change sign. Void that is kept has only solid and its own component beside it, so no
/// edge is new.
fn crossings(hermite: &Hermite, signs: &SignChanges, kept: &SignChanges) -> Hermite {
    let mut out = Hermite::default();
    if hermite.edges.each_ref().map(Vec::len) != signs.counts() {
        return out;
    }
    for axis in Axis::ALL {
        let (mut edges, out) = (&hermite.edges[axis.index()][..], &mut out.edges[axis.index()]);
        for (j, k) in (0..BRICK_POINTS).flat_map(|k| (0..BRICK_POINTS).map(move |j| (j, k))) {
            let all = signs.edges(axis, j, k);
            let mut left = kept.edges(axis, j, k) & all;
            let (own, rest) = edges.split_at(all.count_ones() as usize);
            edges = rest;
            while left != 0 {
                let below = all & ((1 << left.trailing_zeros()) - 1);
                out.push(own[below.count_ones() as usize]);
                left &= left - 1;
            }
        }
    }
    out
}
