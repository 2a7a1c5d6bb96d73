//! One subtree of the octree: from the pieces that touch a node to the records of the node and all below
//! it, in post-order.

use super::bins::{Binner, CellLists};
use super::corners::corner_at;
use super::decide::{NodeDecision, NodePieces};
use super::field::{BrickEvaluation, PieceField, PieceList};
use super::rules::Rules;
use super::scope::BuildPlan;
use crate::backend::BatchLeaf;
use crate::brick::{Brick, Samples};
use crate::error::Result;
use crate::lattice::{NodeKey, Octant};
use crate::progress::Progress;
use crate::store::{CoarseSamples, JoinedNode, Records, common_empty, interior, join, record_empty};
use std::borrow::Borrow;
use std::collections::VecDeque;

/// Levels that one sorting of pieces descends: 8³ cells of lists, and their corners in one small grid.
pub(super) const STRIDE: u8 = 3;

/// Leaves that are foreseen together.
const LEAVES_AHEAD: usize = 64;

/// A subtree to build.
pub(super) struct SubtreeRoot<'a, P> {
    /// Its node.
    pub key: NodeKey,
    /// The node's sample (0, 0, 0).
    pub corner: i16,
    /// All pieces that touch it.
    pub pieces: &'a [P],
}

/// What is known of the nodes some levels below another.
struct Cells {
    stride: u8,
    corners: Vec<i64>,
    lists: CellLists,
}

impl Cells {
    /// The one with this Morton number.
    fn leaf<'a, P>(&'a self, top: &SubtreeRoot<'a, P>, number: usize) -> BatchLeaf<'a, P> {
        let code = top.key.code() << (3 * u32::from(self.stride)) | number as u64;
        let key = NodeKey::from_code(code).expect("a descendant of a legal key");
        let corner = corner_at(&self.corners, self.stride, number);
        BatchLeaf { key, corner, array: top.pieces, indices: self.lists.of(number) }
    }
}

impl<'a, P> From<&BatchLeaf<'a, P>> for PieceList<'a, P> {
    fn from(leaf: &BatchLeaf<'a, P>) -> Self {
        PieceList { array: leaf.array, indices: leaf.indices }
    }
}

/// A node of which it is known what becomes of it.
type KnownNode<P> = (NodeKey, NodeDecision<P>);

/// One of whose children this is known, too.
enum DecidedNode<P> {
    /// No surface touches it.
    Empty(i16),
    Leaf(NodeKey, Brick),
    /// With its samples, if these are not joined from the children's.
    Refined(NodeKey, Option<Samples>, Vec<KnownNode<P>>),
}

/// Builds subtrees one after the other; one per thread.
pub(super) struct SubtreeBuilder<'a, F: PieceField> {
    field: &'a F,
    rules: &'a Rules,
    plan: BuildPlan<'a>,
    progress: &'a dyn Progress,
    evaluator: F::Evaluator,
    /// What the subtrees so far consist of.
    pub records: Records,
}

impl<'a, F: PieceField> SubtreeBuilder<'a, F> {
    pub fn new(field: &'a F, plan: BuildPlan<'a>, progress: &'a dyn Progress) -> Self {
        let rules = plan.rules;
        let records = Records::new(rules.compression);
        SubtreeBuilder { field, rules, plan, progress, evaluator: F::Evaluator::default(), records }
    }

    /// Builds the subtree at `key`, whose sample (0, 0, 0) is `corner`, from all pieces that touch it, of a tree that
    /// follows the pieces.
    fn build(&mut self, key: NodeKey, corner: i16, pieces: &[F::Piece]) -> Result<JoinedNode> {
        let all: Vec<u32> = (0..pieces.len() as u32).collect();
        let list = PieceList { array: pieces, indices: &all };
        if let Some(w) = self.field.settled(key, corner, list) {
            return Ok(JoinedNode::Empty(w));
        }
        if key.level() == self.rules.depth {
            if self.field.may_be_restless() {
                let leaf = BatchLeaf { key, corner, array: pieces, indices: &all };
                self.field.foresee(&mut self.evaluator, &[leaf]);
            }
            self.leaf(key, corner, list)
        } else if pieces.is_empty() {
            self.restless(key, corner)
        } else {
            self.descend_to_leaves(key, corner, pieces)
        }
    }

    /// Builds a node above the depth that no piece touches, and in which the field may change: it is divided where its
    /// samples do not tell how.
    fn restless(&mut self, key: NodeKey, corner: i16) -> Result<JoinedNode> {
        let none = PieceList { array: &[], indices: &[] };
        if let Some(w) = self.field.settled(key, corner, none) {
            return Ok(JoinedNode::Empty(w));
        }
        self.field.foresee(&mut self.evaluator, &[BatchLeaf { key, corner, array: &[], indices: &[] }]);
        if key.level() == self.rules.depth {
            return self.leaf(key, corner, none);
        }
        self.progress.check()?;
        let mut evaluation = self.field.evaluate(&mut self.evaluator, key, corner, none)?;
        if self.rules.keeps(&mut evaluation) {
            let brick = evaluation.into_leaf()?;
            self.records.push(key, true, &brick);
            return Ok(JoinedNode::Stored(CoarseSamples::of(&brick)));
        }
        drop(evaluation);
        let mut children = [const { JoinedNode::Empty(0) }; 8];
        for octant in Octant::all() {
            children[octant.index()] = self.restless(key.child(octant), corner)?;
        }
        Ok(join(key, children, &mut self.records))
    }

    /// Builds a node at the depth to which all is divided, or below it: a leaf unless something hides in it.
    fn leaf(&mut self, key: NodeKey, corner: i16, list: PieceList<'_, F::Piece>) -> Result<JoinedNode> {
        self.progress.check()?;
        let mut evaluation = self.field.evaluate(&mut self.evaluator, key, corner, list)?;
        let thin = self.rules.thin_of(self.field, key.level(), &mut evaluation)?;
        let is_divided = self.rules.divides_thin(key.level(), &thin, &evaluation);
        let divided = is_divided.then(|| evaluation.corners());
        if let Some(corners) = divided {
            drop(evaluation);
            return self.divide(key, corners, list);
        }
        let brick = evaluation.into_leaf()?;
        self.plan.add_thin(&thin);
        self.records.push(key, true, &brick);
        Ok(JoinedNode::Stored(CoarseSamples::of(&brick)))
    }

    /// Builds the children of a node in which something hides, and joins them.
    fn divide(
        &mut self,
        key: NodeKey,
        corners: [i16; 8],
        list: PieceList<'_, F::Piece>,
    ) -> Result<JoinedNode> {
        let pieces: Vec<F::Piece> = list.indices.iter().map(|&i| list.array[i as usize]).collect();
        let lists = Binner::new(key, 1).sort_indices(self.field, &pieces);
        let mut children = [const { JoinedNode::Empty(0) }; 8];
        for octant in Octant::all() {
            let (key, corner) = (key.child(octant), corners[octant.index()]);
            let list = PieceList { array: &pieces, indices: lists.of(octant.index()) };
            children[octant.index()] = match self.field.settled(key, corner, list) {
                Some(w) => JoinedNode::Empty(w),
                None => self.leaf(key, corner, list)?,
            };
        }
        Ok(join(key, children, &mut self.records))
    }

    /// Builds several subtrees of a tree that follows the pieces, those of each with its records apart.
    pub fn build_all(&mut self, tops: &[SubtreeRoot<'_, F::Piece>]) -> Result<Vec<(JoinedNode, Records)>> {
        let depth = self.rules.depth;
        let is_at_bottom = |top: &SubtreeRoot<'_, F::Piece>| depth - top.key.level() <= STRIDE;
        // What a node below the depth holds is known only when the node is.
        let is_even = self.rules.deepest == depth;
        if is_even && tops.iter().all(is_at_bottom) && self.field.begin_leaves(&mut self.evaluator) {
            return self.build_ahead(tops);
        }
        let build = |top: &SubtreeRoot<'_, F::Piece>| {
            let node = self.build(top.key, top.corner, top.pieces)?;
            Ok((node, self.records.take()))
        };
        tops.iter().map(build).collect()
    }

    /// Subtrees whose leaves are evaluated in batches, which do not end where a subtree does.
    fn build_ahead(&mut self, tops: &[SubtreeRoot<'_, F::Piece>]) -> Result<Vec<(JoinedNode, Records)>> {
        let cells: Vec<Cells> = tops.iter().map(|top| self.cells(top.key, top.corner, top.pieces)).collect();
        let SubtreeBuilder { field, progress, evaluator, records, plan, .. } = self;
        let is_settled =
            |leaf: &BatchLeaf<'_, F::Piece>| field.settled(leaf.key, leaf.corner, leaf.into()).is_some();
        let mut leaves = Vec::new();
        for (top, cells) in tops.iter().zip(&cells) {
            let all = (0..1usize << (3 * cells.stride)).map(|number| cells.leaf(top, number));
            leaves.extend(all.filter(|leaf| !is_settled(leaf)));
        }
        let mut built = Vec::with_capacity(tops.len());
        for (top, cells) in tops.iter().zip(&cells) {
            let node = descend(top.key, cells.stride, &mut |step, number| match step {
                Step::Entered(..) => Ok(None),
                Step::Joined(key, children) => Ok(Some(join(key, children, records))),
                Step::Reached(key) => {
                    let leaf = cells.leaf(top, number);
                    if let Some(w) = field.settled(key, leaf.corner, (&leaf).into()) {
                        return Ok(Some(JoinedNode::Empty(w)));
                    }
                    progress.check()?;
                    let (brick, thin) = field.next_leaf(evaluator, &leaves)?;
                    plan.add_thin(&thin);
                    records.push(key, true, &brick);
                    Ok(Some(JoinedNode::Stored(CoarseSamples::of(&brick))))
                }
            })?;
            built.push((node, records.take()));
        }
        Ok(built)
    }

    /// The cells of a node, [`STRIDE`] levels below it or at the bottom of the tree.
    fn cells(&self, key: NodeKey, corner: i16, pieces: &[F::Piece]) -> Cells {
        let stride = STRIDE.min(self.rules.depth - key.level());
        let mut sums = self.field.corners(key, stride);
        pieces.iter().for_each(|piece| self.field.add_corners(&mut sums, piece));
        let corners = self.field.finish_corners(sums, i64::from(corner));
        Cells { stride, corners, lists: Binner::new(key, stride).sort_indices(self.field, pieces) }
    }

    /// Every touched node above the depth limit is refined, so only leaves are evaluated; a node's samples
    /// are a part of its children's.
    fn descend_to_leaves(&mut self, key: NodeKey, corner: i16, pieces: &[F::Piece]) -> Result<JoinedNode> {
        let Cells { stride, corners, lists } = self.cells(key, corner, pieces);
        let mut copies = Vec::new();
        let decides = self.field.may_be_restless();
        let mut foreseen = 0;
        descend(key, stride, &mut |step, number| {
            let key = match step {
                Step::Entered(key, levels) => {
                    let below = number << (3 * levels)..(number + 1) << (3 * levels);
                    if !decides || !lists.are_empty(&below) {
                        return Ok(None);
                    }
                    return self.restless(key, corner_at(&corners, stride, below.start)).map(Some);
                }
                Step::Reached(key) => key,
                Step::Joined(key, children) => {
                    return Ok(Some(join(key, children, &mut self.records)));
                }
            };
            if key.level() == self.rules.depth && number >= foreseen {
                foreseen = number + LEAVES_AHEAD;
                self.foresee_leaves(key, number, &lists, pieces);
            }
            let corner = corner_at(&corners, stride, number);
            let list = PieceList { array: pieces, indices: lists.of(number) };
            let node = if let Some(w) = self.field.settled(key, corner, list) {
                JoinedNode::Empty(w)
            } else if key.level() == self.rules.depth {
                self.leaf(key, corner, list)?
            } else {
                copies.clear();
                copies.extend(list.indices.iter().map(|&i| pieces[i as usize]));
                self.descend_to_leaves(key, corner, &copies)?
            };
            Ok(Some(node))
        })
    }

    /// Tells the field which leaves of a sorting come next, from one with this number on.
    fn foresee_leaves(&mut self, key: NodeKey, number: usize, lists: &CellLists, pieces: &[F::Piece]) {
        if !self.field.foresees() {
            return;
        }
        let end = (number + LEAVES_AHEAD).min(lists.cells());
        let leaf = |number: usize, ahead: u64| {
            let key = NodeKey::from_code(key.code() + ahead).expect("a descendant of the same node");
            BatchLeaf { key, corner: 0, array: pieces, indices: lists.of(number) }
        };
        let leaves: Vec<_> = (number..end).zip(0..).map(|(number, ahead)| leaf(number, ahead)).collect();
        let touched: Vec<_> = leaves.into_iter().filter(|leaf| !leaf.indices.is_empty()).collect();
        self.field.foresee(&mut self.evaluator, &touched);
    }

    /// Builds several subtrees of a tree whose nodes decide for themselves, those of each with its records apart.
    pub fn build_deciding(&mut self, tops: &[&NodePieces<F::Piece>]) -> Result<Vec<(JoinedNode, Records)>> {
        self.foresee(tops.iter().copied());
        let decided = self.decide(tops.iter().copied())?;
        let mut built = Vec::with_capacity(tops.len());
        self.record_all(decided, &mut |builder, node| built.push((node, builder.records.take())))?;
        Ok(built)
    }

    /// Finds out what becomes of nodes that have been foreseen, all before what is below them is built: so up to 64 of
    /// their children are foreseen together.
    fn decide<N: Borrow<NodePieces<F::Piece>>>(
        &mut self,
        nodes: impl IntoIterator<Item = N>,
    ) -> Result<Vec<KnownNode<F::Piece>>> {
        let mut decided = Vec::new();
        for node in nodes {
            self.progress.check()?;
            let node: &NodePieces<F::Piece> = node.borrow();
            decided.push((node.key, node.decide(self.field, &mut self.evaluator, self.rules, true)?));
        }
        let children = decided.iter().filter_map(|(_, decided)| match decided {
            NodeDecision::Refined(_, children) => Some(children.iter()),
            NodeDecision::Empty(_) | NodeDecision::Leaf(..) => None,
        });
        self.foresee(children.flatten());
        Ok(decided)
    }

    /// Builds what is below some nodes, whose children have been foreseen, and records all of it, one after the other;
    /// `done` gets each.
    fn record_all(
        &mut self,
        nodes: Vec<KnownNode<F::Piece>>,
        done: &mut dyn FnMut(&mut Self, JoinedNode),
    ) -> Result<()> {
        // Where a device evaluates what is foreseen, it has the grandchildren of the next node while those of this one are
        // recorded here.
        let ahead = usize::from(self.field.foresees());
        let mut nodes = nodes.into_iter();
        let mut opened = VecDeque::with_capacity(ahead + 1);
        loop {
            while opened.len() <= ahead
                && let Some((key, decided)) = nodes.next()
            {
                opened.push_back(self.open(key, decided)?);
            }
            let Some(first) = opened.pop_front() else { return Ok(()) };
            let node = self.record(first)?;
            done(self, node);
        }
    }

    /// Finds out what becomes of a node's children.
    fn open(&mut self, key: NodeKey, decided: NodeDecision<F::Piece>) -> Result<DecidedNode<F::Piece>> {
        Ok(match decided {
            NodeDecision::Empty(w) => DecidedNode::Empty(w),
            NodeDecision::Leaf(brick, thin) => {
                if let Some(thin) = thin {
                    self.plan.add_thin(&thin);
                }
                DecidedNode::Leaf(key, brick)
            }
            NodeDecision::Refined(samples, children) => {
                DecidedNode::Refined(key, samples, self.decide(*children)?)
            }
        })
    }

    /// Builds what is below a node, and records all of it.
    fn record(&mut self, opened: DecidedNode<F::Piece>) -> Result<JoinedNode> {
        let (key, samples, children) = match opened {
            DecidedNode::Empty(w) => return Ok(JoinedNode::Empty(w)),
            DecidedNode::Leaf(key, brick) => {
                self.records.push(key, true, &brick);
                return Ok(JoinedNode::Stored(CoarseSamples::of(&brick)));
            }
            DecidedNode::Refined(key, samples, children) => (key, samples, children),
        };
        let mut nodes = Vec::with_capacity(8);
        self.record_all(children, &mut |_, node| nodes.push(node))?;
        let children: [JoinedNode; 8] = nodes.try_into().expect("a node has eight children");
        let Some(samples) = samples else {
            return Ok(join(key, children, &mut self.records));
        };
        if let Some(w) = common_empty(&children) {
            return Ok(JoinedNode::Empty(w));
        }
        record_empty(key, &children, &mut self.records);
        let brick = interior(samples);
        self.records.push(key, false, &brick);
        Ok(JoinedNode::Stored(CoarseSamples::of(&brick)))
    }

    /// Tells the field which of some nodes will be evaluated as they are decided.
    fn foresee<'p>(&mut self, nodes: impl Iterator<Item = &'p NodePieces<F::Piece>>)
    where
        F::Piece: 'p,
    {
        if !self.field.foresees() {
            return;
        }
        let nodes: Vec<_> = nodes.collect();
        let most = nodes.iter().map(|node| node.pieces.len()).max().unwrap_or(0);
        let all: Vec<u32> = (0..most as u32).collect();
        let is_evaluated = |leaf: &BatchLeaf<'_, F::Piece>| {
            let is_deepest = leaf.key.level() >= self.rules.depth;
            let refined =
                || NodePieces::refined_unseen(self.field, self.rules, leaf.key, leaf.corner, leaf.into());
            self.field.settled(leaf.key, leaf.corner, leaf.into()).is_none()
                && (is_deepest || refined().is_none())
        };
        let leaves: Vec<_> = nodes.into_iter().map(|node| node.as_leaf(&all)).filter(is_evaluated).collect();
        self.field.foresee(&mut self.evaluator, &leaves);
    }
}

/// What [`descend`] meets.
enum Step {
    /// A node above the bottom of the stride, so many levels, before what is below it; if `visit` makes a node of it, nothing
    /// below it is met. Its number is that within the top at its own level.
    Entered(NodeKey, u8),
    /// A node at the bottom of the stride.
    Reached(NodeKey),
    /// A node whose children are done.
    Joined(NodeKey, [JoinedNode; 8]),
}

/// What gets the nodes that [`descend`] meets, and makes nodes of them: of all but those that are entered it must.
type Visit<'a> = dyn FnMut(Step, usize) -> Result<Option<JoinedNode>> + 'a;

/// Walks the `stride` levels below `top` depth-first in Morton order; `visit` gets every bottom node with
/// its Morton number within `top`, then, after its children, every node above.
fn descend(top: NodeKey, stride: u8, visit: &mut Visit<'_>) -> Result<JoinedNode> {
    fn walk(key: NodeKey, levels: u8, number: usize, visit: &mut Visit<'_>) -> Result<JoinedNode> {
        let made = |node: Option<JoinedNode>| node.expect("a node is made of what is reached or joined");
        if levels == 0 {
            return visit(Step::Reached(key), number).map(made);
        }
        if let Some(node) = visit(Step::Entered(key, levels), number)? {
            return Ok(node);
        }
        let mut children = [const { JoinedNode::Empty(0) }; 8];
        for octant in Octant::all() {
            children[octant.index()] =
                walk(key.child(octant), levels - 1, number * 8 + octant.index(), visit)?;
        }
        visit(Step::Joined(key, children), number).map(made)
    }
    walk(top, stride, 0, visit)
}
