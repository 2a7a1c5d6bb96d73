//! The tree of a chain, node by node from the top.

use super::chain::{OperandState, Operation, decide};
use super::combine::{BrickOperand, Content, HiddenCrossings, combine};
use super::operand::{Operand, OperandInNode};
use super::swept_bricks::SweptBricks;
use crate::brick::{Brick, SignChanges, codec};
use crate::error::{Error, Result};
use crate::lattice::{NodeKey, Octant};
use crate::store::{CoarseSamples, IndexEntry, JoinedNode, Records, Scratch, Store, join};
use crate::swept::{SweptEvaluator, WantedSamples};

/// A chain of operands on one lattice.
pub struct Chain<'a> {
    /// Each with the operation by which it joins those before; that of the first does not count.
    pub operands: Vec<(Operation, Operand<'a>)>,
    /// Whether samples of the first operand keep their counts where they remain.
    pub keep_counts: bool,
    /// The level of leaves where no store has a boundary.
    pub depth: u8,
    /// Bricks of the last operand, if those are solids that another chain of the same operands takes as well.
    pub made: Option<&'a SweptBricks>,
}

/// What a thread works with.
#[derive(Default)]
pub(super) struct WalkScratch {
    evaluator: SweptEvaluator,
    payload: Vec<u8>,
    scratch: Scratch,
    codec: codec::Scratch,
    pub hidden: HiddenCrossings,
}

/// What is to be done with a node.
pub(super) enum NodeAction {
    /// It is all of one value.
    All { w: i16, certain: bool },
    /// Its children are to be looked at.
    Divide(BoundaryOwner),
    /// It is a leaf.
    Leaf(BoundaryOwner),
}

/// Whether the boundary within a node may be that of one operand alone, and no sample is another's.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum BoundaryOwner {
    MayBeOnes,
    Several,
}

impl Chain<'_> {
    /// What is known of all operands before the root is looked at.
    pub(super) fn beginning(&self) -> Vec<OperandInNode> {
        self.operands.iter().map(|(_, operand)| operand.beginning()).collect()
    }

    /// Looks at a node: what all operands are within it, and what is to be done.
    pub(super) fn look(
        &self,
        key: NodeKey,
        above: &[OperandInNode],
    ) -> Result<(Vec<OperandInNode>, NodeAction)> {
        let look = |(n, (operand, above)): (usize, (&(Operation, Operand<'_>), &OperandInNode))| {
            operand.1.look(key, above, self.keep_counts && n == 0)
        };
        let mut within: Vec<OperandInNode> =
            self.operands.iter().zip(above).enumerate().map(look).collect::<Result<_>>()?;
        let operations: Vec<Operation> = self.operands.iter().map(|(operation, _)| *operation).collect();
        let known: Vec<OperandState> = within.iter().map(OperandInNode::known).collect();
        let mut decision = decide(&operations, &known);
        let counts_differ = self.keep_counts && known[0] == OperandState::Mixed;
        if let OperandState::All { inside, certain } = decision.known
            && !(inside && counts_differ)
        {
            let w = match &within[0] {
                OperandInNode::All { w, .. } if self.keep_counts => (*w).max(1),
                _ => 1,
            };
            return Ok((within, NodeAction::All { w: if inside { w } else { 0 }, certain }));
        }
        if counts_differ && !decision.mixed.contains(&0) {
            decision.mixed.insert(0, 0);
        }
        for (n, within) in within.iter_mut().enumerate() {
            if known[n] == OperandState::Mixed && !decision.mixed.contains(&n) {
                *within = OperandInNode::Ignored;
            }
        }
        let is_leaf = |within: &OperandInNode| matches!(within, OperandInNode::Leaf);
        let is_divided = |within: &OperandInNode| matches!(within, OperandInNode::Divided);
        let leaf = within.iter().position(is_leaf);
        let divided = within.iter().position(is_divided);
        let whose = match decision.known {
            OperandState::Mixed => BoundaryOwner::MayBeOnes,
            OperandState::All { .. } => BoundaryOwner::Several,
        };
        let step = match (leaf, divided) {
            (Some(leaf), Some(divided)) => return Err(self.uneven(key, leaf, divided)),
            (None, Some(_)) => NodeAction::Divide(whose),
            (None, None) if key.level() < self.depth => NodeAction::Divide(whose),
            _ => NodeAction::Leaf(whose),
        };
        Ok((within, step))
    }

    /// The error of leaves of different levels whose boundaries meet.
    fn uneven(&self, key: NodeKey, leaf: usize, divided: usize) -> Error {
        let name = |n: usize| match &self.operands[n].1 {
            Operand::Store(store) => store.path().display().to_string(),
            Operand::Solids(_) => "solids".to_owned(),
        };
        let (coarse, fine) = (name(leaf), name(divided));
        Error::setting(
            format!("{coarse}: its leaf {key} has the boundary of the part, and {fine} is finer there"),
            format!(
                "build both to one depth, without `max_depth`, `boundary_error` and `stddev`: \
                 `brickfield build INPUT -o {coarse} --like {fine}`"
            ),
        )
    }

    /// Makes a node and all below it. `above` is what is known of its parent, or of itself.
    pub(super) fn walk(
        &self,
        key: NodeKey,
        above: &[OperandInNode],
        desk: &mut WalkScratch,
        records: &mut Records,
    ) -> Result<JoinedNode> {
        let (within, step) = self.look(key, above)?;
        match step {
            NodeAction::All { w, certain: true } => return Ok(JoinedNode::Empty(w)),
            NodeAction::All { w, certain: false } => {
                records.push(key, true, &Brick::Uniform(w));
                return Ok(JoinedNode::Stored(CoarseSamples::Uniform(w)));
            }
            NodeAction::Divide(_) | NodeAction::Leaf(_) => {}
        }
        if let NodeAction::Divide(BoundaryOwner::MayBeOnes) | NodeAction::Leaf(BoundaryOwner::MayBeOnes) =
            step
            && let Some(store) = self.only(&within)
            && let Some(entry) = store.entry(key)
            && self.is_as_it_is(store, entry)
        {
            let brick = copy(store, entry, desk, records)?;
            return Ok(JoinedNode::Stored(CoarseSamples::of(&brick)));
        }
        if matches!(step, NodeAction::Divide(_)) {
            let mut children = [const { JoinedNode::Empty(0) }; 8];
            for octant in Octant::all() {
                children[octant.index()] = self.walk(key.child(octant), &within, desk, records)?;
            }
            return Ok(join(key, children, records));
        }
        let brick = self.leaf(key, &within, desk)?;
        records.push(key, true, &brick);
        Ok(JoinedNode::Stored(CoarseSamples::of(&brick)))
    }

    /// The brick of a leaf.
    fn leaf(&self, key: NodeKey, within: &[OperandInNode], desk: &mut WalkScratch) -> Result<Brick> {
        let mut wanted = WantedSamples::all();
        let mut bricks: Vec<Brick> = Vec::with_capacity(self.operands.len());
        for ((_, operand), within) in self.operands.iter().zip(within) {
            let mut make = || operand.brick(key, within, (&mut desk.evaluator, &wanted));
            let is_last = bricks.len() + 1 == self.operands.len();
            let brick = match self.made.filter(|_| is_last && matches!(within, OperandInNode::Solids(_))) {
                Some(made) => made.get((key, wanted.is_all()), &mut desk.codec, make)?,
                None => make()?,
            };
            if let (true, Brick::Counts { samples, .. }) =
                (bricks.is_empty() && self.only_takes_off(), &brick)
            {
                wanted = WantedSamples::around(&SignChanges::of(samples));
            }
            bricks.push(brick);
        }
        let mut terms = Vec::with_capacity(bricks.len());
        for ((operation, _), brick) in self.operands.iter().zip(&bricks) {
            terms.push(BrickOperand { operation: *operation, content: Content::of(brick) });
        }
        Ok(combine(&terms, self.keep_counts.then_some(&bricks[0]), &mut desk.hidden))
    }

    /// Whether nothing of the result lies outside of the first operand.
    fn only_takes_off(&self) -> bool {
        self.operands.iter().skip(1).all(|(operation, _)| *operation != Operation::Plus)
    }

    /// The store whose nodes are the result's here, but for clamping.
    fn only(&self, within: &[OperandInNode]) -> Option<&Store> {
        let mut found = None;
        for (n, ((operation, operand), within)) in self.operands.iter().zip(within).enumerate() {
            match (within, operand) {
                (OperandInNode::All { .. } | OperandInNode::Ignored, _) => continue,
                (OperandInNode::Leaf | OperandInNode::Divided, Operand::Store(store))
                    if found.is_none()
                        && (n == 0 || *operation != Operation::Minus)
                        && (n == 0 || !self.keep_counts) =>
                {
                    found = Some(*store);
                }
                _ => return None,
            }
        }
        found
    }

    /// Whether all samples of a node and below it are such as the result may have.
    fn is_as_it_is(&self, store: &Store, entry: &IndexEntry) -> bool {
        let most = if self.keep_counts { i16::MAX } else { 1 };
        let fits = entry.head.min >= 0 && entry.head.max <= most;
        let below = |octant| store.entry(entry.key.child(octant)).is_some_and(|e| self.is_as_it_is(store, e));
        fits && (entry.leaf || Octant::all().all(below))
    }
}

/// Copies a node and all below it, children first; returns its brick.
fn copy(store: &Store, entry: &IndexEntry, desk: &mut WalkScratch, records: &mut Records) -> Result<Brick> {
    copy_below(store, entry, desk, records)?;
    store.read_payload(entry, &mut desk.payload)?;
    match entry.head.kind.is_uniform() {
        true => Ok(Brick::Uniform(entry.head.min)),
        false => store.decode(entry, &desk.payload, &mut desk.scratch),
    }
}

fn copy_below(
    store: &Store,
    entry: &IndexEntry,
    desk: &mut WalkScratch,
    records: &mut Records,
) -> Result<()> {
    if !entry.leaf {
        for octant in Octant::all() {
            if let Some(child) = store.entry(entry.key.child(octant)) {
                copy_below(store, child, desk, records)?;
            }
        }
    }
    store.read_payload(entry, &mut desk.payload)?;
    records.push_encoded(entry.key, entry.leaf, entry.head, &desk.payload);
    Ok(())
}
