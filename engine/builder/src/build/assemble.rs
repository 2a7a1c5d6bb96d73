//! Joins the subtrees of a tree, which come one after the other along the Morton curve, to the nodes above them.

use super::corners::corner_at;
use crate::brick::Brick;
use crate::lattice::NodeKey;
use crate::store::{Compression, JoinedNode, Records, join};
use std::ops::Range;
use std::sync::Arc;

/// A node whose descendants `stride` levels below come one by one.
pub(super) struct Opening {
    /// The node.
    pub key: NodeKey,
    /// Levels down to those that come.
    pub stride: u8,
    /// The samples at their corners; see [`corner_at`].
    pub corners: Arc<Vec<i64>>,
    /// How many of them come; the others are empty.
    pub coming: usize,
    /// Which of those of the opening around it the node is.
    pub cell: usize,
}

/// An opening with what has come.
struct PendingNode {
    opening: Opening,
    /// The first descendant that is not accounted for.
    next: usize,
    /// Siblings that wait for the rest of them, by level below the node; the last ones have come, those above are joined.
    siblings: Vec<Vec<JoinedNode>>,
    /// Of the first opening, if its descendants are not joined.
    apart: Option<UnjoinedNodes>,
}

/// Joins what comes. Nodes above the jobs are recorded apart, because they stand at the end of a store.
pub(super) struct Assembler {
    open: Vec<PendingNode>,
    /// The joined nodes of the first opening, which is the root's.
    pub top: Records,
    /// The root.
    root: Option<JoinedNode>,
    /// If only some of the first opening's descendants are wanted, and the nodes above them are not.
    apart: Option<UnjoinedNodes>,
}

/// Descendants of the root that are not joined.
struct UnjoinedNodes {
    /// Their numbers.
    cells: Range<u64>,
    /// Those that are empty, with the value of their samples.
    empty: Vec<(u64, i16)>,
}

impl Assembler {
    /// For a store with this compression. If `cells` says which of the root's descendants are wanted, these are left as
    /// they are: no node above them is made.
    pub fn new(cells: Option<Range<u64>>, compression: Option<Compression>) -> Assembler {
        let apart = cells.map(|cells| UnjoinedNodes { cells, empty: Vec::new() });
        Assembler { open: Vec::new(), top: Records::new(compression), root: None, apart }
    }

    /// The descendant number `cell` of the last opening comes next, whose records stand behind what is joined now.
    pub fn reach(&mut self, cell: usize, records: &mut Records) {
        let to = if self.open.len() == 1 { &mut self.top } else { records };
        if let Some(open) = self.open.last_mut() {
            open.skip_to(cell, to);
        }
    }

    /// From here on the descendants of `opening` come. Returns how many of the first opening's have been completed.
    pub fn open(&mut self, opening: Opening, records: &mut Records) -> u64 {
        self.reach(opening.cell, records);
        let empty = opening.coming == 0;
        let siblings = (0..=opening.stride).map(|_| Vec::new()).collect();
        self.open.push(PendingNode { opening, next: 0, siblings, apart: self.apart.take() });
        if empty { self.close(records) } else { 0 }
    }

    /// The descendant that was reached has come. Nodes that it completes below the first opening go to
    /// `records`. Returns how many of the first opening's have been completed.
    pub fn add(&mut self, node: JoinedNode, records: &mut Records) -> u64 {
        let first = self.open.len() == 1;
        let to = if first { &mut self.top } else { &mut *records };
        let open = self.open.last_mut().expect("it was opened");
        open.push(node, to);
        open.opening.coming -= 1;
        u64::from(first) + if open.opening.coming == 0 { self.close(records) } else { 0 }
    }

    /// Nothing more comes to the last opening: its node is complete.
    fn close(&mut self, records: &mut Records) -> u64 {
        let mut open = self.open.pop().expect("it was opened");
        let to = if self.open.is_empty() { &mut self.top } else { &mut *records };
        open.skip_to(1 << (3 * u32::from(open.opening.stride)), to);
        if open.apart.is_some() {
            self.apart = open.apart;
            return 0;
        }
        let node = open.siblings[0].pop().expect("all descendants have come");
        if self.open.is_empty() {
            self.root = Some(node);
            return 0;
        }
        self.add(node, records)
    }

    /// The records of the nodes above the jobs; and, if these are only some, which of them are empty.
    pub fn finish(mut self) -> (Records, Vec<(u64, i16)>) {
        if let Some(JoinedNode::Empty(w)) = self.root {
            self.top.push(NodeKey::ROOT, true, &Brick::Uniform(w));
        }
        (self.top, self.apart.map_or(Vec::new(), |apart| apart.empty))
    }
}

impl UnjoinedNodes {
    fn take(&mut self, cell: u64, node: &JoinedNode) {
        if let JoinedNode::Empty(w) = node
            && self.cells.contains(&cell)
        {
            self.empty.push((cell, *w));
        }
    }
}

impl PendingNode {
    /// The descendants before `cell` that have not come are empty.
    fn skip_to(&mut self, cell: usize, records: &mut Records) {
        for number in self.next..cell {
            let corner = corner_at(&self.opening.corners, self.opening.stride, number);
            self.push(JoinedNode::Empty(corner), records);
        }
    }

    /// Adds the next descendant, and joins eight siblings as often as they are complete.
    fn push(&mut self, node: JoinedNode, records: &mut Records) {
        let mut level = self.opening.stride;
        let mut number = self.next as u64;
        self.next += 1;
        if let Some(apart) = &mut self.apart {
            return apart.take(number, &node);
        }
        let mut node = node;
        while level > 0 {
            let siblings = &mut self.siblings[usize::from(level)];
            siblings.push(node);
            let Ok(children) =
                <[JoinedNode; 8]>::try_from(std::mem::take(siblings)).map_err(|few| *siblings = few)
            else {
                return;
            };
            level -= 1;
            number /= 8;
            let code = self.opening.key.code() << (3 * u32::from(level)) | number;
            let key = NodeKey::from_code(code).expect("an ancestor of a legal key");
            node = join(key, children, records);
        }
        self.siblings[0].push(node);
    }
}
