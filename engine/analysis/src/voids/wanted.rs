//! A tree as it would be without the surfaces that are not asked for: what contours it has less to do.

use super::components::{ALL, Components};
use super::labelling::Labelling;
use super::pores::{Pores, for_stretches, place_of};
use crate::brick::{Brick, Hermite, HermiteEdge, OctNormal, Samples, SignChanges};
use crate::error::Result;
use crate::lattice::{Axis, BRICK_POINTS, NodeKey, RootCube};
use crate::store::{BrickTree, NodeInfo};
use std::collections::HashMap;
use std::ops::Range;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

/// A tree whose only void is that of some components and pores: what else is outside counts as solid, and has no crossings.
/// Samples and crossings of those components are as they were, and so are counts in the solid. Where a pore ends in void its
/// boundary is half way between samples.
pub(super) struct WantedVoids<'a> {
    tree: &'a dyn BrickTree,
    labelling: &'a Labelling,
    pores: Option<&'a Pores>,
    /// By component, and behind these by pore.
    wanted: Vec<bool>,
    /// By leaf, whether a wanted component lies in it, or a pore may.
    is_in: Vec<bool>,
    labels: KeptLabels,
}

/// Samples of a row that follow each other in a wanted void.
struct WantedRun {
    /// The row, k·33 + j.
    row: u16,
    /// The first sample, and the one behind the last.
    from: u8,
    to: u8,
    /// The component, or behind all components the pore.
    void: u32,
}

/// The runs of samples of wanted voids in a leaf, in order.
pub(super) struct WantedRuns(Vec<WantedRun>);

impl WantedRuns {
    /// The wanted void of a sample.
    pub fn at(&self, [i, j, k]: [usize; 3]) -> Option<usize> {
        let (row, i) = ((k * BRICK_POINTS + j) as u16, i as u8);
        let run = self.0.get(self.0.partition_point(|run| (run.row, run.to) <= (row, i)))?;
        (run.row == row && run.from <= i).then_some(run.void as usize)
    }

    /// The samples as bits of each row.
    fn rows(&self) -> Vec<u64> {
        let mut rows = vec![0; BRICK_POINTS * BRICK_POINTS];
        for run in &self.0 {
            rows[usize::from(run.row)] |= (1u64 << run.to) - (1u64 << run.from);
        }
        rows
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
    /// With room for so many bytes of labels. `wanted` tells of components, and behind these of pores.
    pub fn new(
        tree: &'a dyn BrickTree,
        (labelling, pores): (&'a Labelling, Option<&'a Pores>),
        wanted: Vec<bool>,
        label_bytes: usize,
    ) -> WantedVoids<'a> {
        let is_done = labelling.order.keys().iter().map(|_| AtomicBool::new(false)).collect();
        let labels = KeptLabels { most_bytes: label_bytes, is_done, ..KeptLabels::default() };
        let pores = pores.filter(|_| wanted[labelling.components.len()..].contains(&true));
        let mut voids = WantedVoids { tree, labelling, pores, wanted, is_in: Vec::new(), labels };
        voids.is_in = (0..labelling.order.keys().len()).map(|leaf| voids.has_any(leaf)).collect();
        voids
    }

    /// Where wanted voids are in a leaf. It is asked for once.
    ///
    /// # Errors
    /// What reading the tree gives.
    pub fn labels_of(&self, leaf: usize) -> Result<WantedRuns> {
        if let Some(labels) = self.labels.take(leaf) {
            return Ok(labels);
        }
        Ok(self.runs(leaf, &self.labelling.components_of(self.tree, leaf)?))
    }

    /// Whether a part of a wanted component lies in a leaf, or a pore may.
    pub fn is_in(&self, leaf: usize) -> bool {
        self.is_in[leaf]
    }

    fn has_any(&self, leaf: usize) -> bool {
        let mut of_leaf = self.labelling.in_leaf(leaf);
        of_leaf.any(|component| component.map_or_else(|| self.has_pore(leaf), |c| self.wanted[c]))
    }

    /// Whether a pore may lie in a leaf of which a part is outside.
    fn has_pore(&self, leaf: usize) -> bool {
        let key = self.labelling.order.keys()[leaf];
        let [low, high] = [[0; 3], [BRICK_POINTS - 1; 3]].map(|corner| place_of(key, corner));
        self.pores.is_some_and(|pores| pores.any_in(low, high))
    }

    /// The wanted component of which parts lie in a leaf, if it is the only one, and no pore may.
    pub fn only_in(&self, leaf: usize) -> Option<usize> {
        if self.pores.is_some() && self.labelling.in_leaf(leaf).any(|component| component.is_none()) {
            return None;
        }
        let mut wanted = self.labelling.in_leaf(leaf).flatten().filter(|component| self.wanted[*component]);
        let first = wanted.next()?;
        wanted.all(|other| other == first).then_some(first)
    }

    /// The runs of wanted voids in a leaf.
    fn runs(&self, leaf: usize, components: &Components) -> WantedRuns {
        let key = self.labelling.order.keys()[leaf];
        let mut runs: Vec<WantedRun> = Vec::new();
        for row in 0..BRICK_POINTS * BRICK_POINTS {
            let (j, k) = (row % BRICK_POINTS, row / BRICK_POINTS);
            let mut push = |some: Range<u8>, void: Option<usize>| {
                let Some(void) = void.filter(|void| self.wanted[*void]) else { return };
                let (row, void) = (row as u16, void as u32);
                match runs.last_mut() {
                    Some(last) if (last.row, last.to, last.void) == (row, some.start, void) => {
                        last.to = some.end
                    }
                    _ => runs.push(WantedRun { row, from: some.start, to: some.end, void }),
                }
            };
            for run in components.row(j, k) {
                for_stretches((self.labelling, self.pores), (leaf, key), (*run, j, k), &mut push);
            }
        }
        runs.shrink_to_fit();
        WantedRuns(runs)
    }

    fn only_wanted(&self, key: NodeKey, brick: Arc<Brick>) -> Arc<Brick> {
        let leaf = self.labelling.order.covering(key);
        if self.labelling.order.keys()[leaf] != key || !self.is_in(leaf) {
            return Arc::new(Brick::Uniform(1));
        }
        if let Brick::Uniform(w) = &*brick
            && (*w >= 1 || self.only_in(leaf).is_some())
        {
            return brick;
        }
        let signs = brick.signs();
        let components = Components::of_signs(&signs, self.labelling.connectivity);
        let runs = self.runs(leaf, &components);
        let wanted = runs.rows();
        if self.only_in(leaf).is_none() {
            self.labels.keep(leaf, || runs);
        }
        let none = Hermite::default();
        let (mut samples, hermite) = match &*brick {
            Brick::Uniform(w) => (Samples::filled(*w), &none),
            Brick::Counts { samples, hermite } => (samples.clone(), hermite),
        };
        let mut inside = signs.clone();
        for (row, wanted) in wanted.into_iter().enumerate() {
            let (j, k) = (row % BRICK_POINTS, row / BRICK_POINTS);
            let hidden = !wanted & !signs.row(j, k) & ALL;
            fill(&mut samples, row * BRICK_POINTS, hidden);
            inside.set_row(j, k, signs.row(j, k) | hidden);
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
        if !node.leaf {
            return Some(node);
        }
        let leaf = self.labelling.order.covering(key);
        if !self.is_in(leaf) {
            return Some(NodeInfo { min: 1, max: 1, fractions: false, ..node });
        }
        // Void outside of which a pore is a part has solid beside it.
        let is_parted = node.max < 1 && self.only_in(leaf).is_none();
        Some(NodeInfo { max: if is_parted { 1 } else { node.max }, ..node })
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

/// Makes samples of a row solid, of which the bits are set.
fn fill(samples: &mut Samples, row: usize, mut bits: u64) {
    let solid = 1 << samples.1;
    while bits != 0 {
        samples.0[row + bits.trailing_zeros() as usize] = solid;
        bits &= bits - 1;
    }
}

/// The crossings of edges that change sign still, and half way along those where a pore ends in void.
fn crossings(hermite: &Hermite, signs: &SignChanges, kept: &SignChanges) -> Hermite {
    let mut out = Hermite::default();
    if hermite.edges.each_ref().map(Vec::len) != signs.counts() {
        return out;
    }
    for axis in Axis::ALL {
        let (mut edges, out) = (&hermite.edges[axis.index()][..], &mut out.edges[axis.index()]);
        for (j, k) in (0..BRICK_POINTS).flat_map(|k| (0..BRICK_POINTS).map(move |j| (j, k))) {
            let all = signs.edges(axis, j, k);
            let mut left = kept.edges(axis, j, k);
            let (own, rest) = edges.split_at(all.count_ones() as usize);
            edges = rest;
            while left != 0 {
                let at = left.trailing_zeros();
                let below = all & ((1 << at) - 1);
                out.push(match all >> at & 1 {
                    1 => own[below.count_ones() as usize],
                    _ => half_way(axis, kept.is_inside([at as usize, j, k])),
                });
                left &= left - 1;
            }
        }
    }
    out
}

/// A crossing in the middle of an edge, straight across.
fn half_way(axis: Axis, low_is_inside: bool) -> HermiteEdge {
    let mut normal = [0; 3];
    normal[axis.index()] = if low_is_inside { 1 } else { -1 };
    HermiteEdge { offset: 1 << 15, normal: OctNormal::from_integer(normal) }
}
