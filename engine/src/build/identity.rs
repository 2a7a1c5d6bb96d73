//! Which beads each leaf counts: a pass over the finished tree.
//!
//! It follows the segments down the tree once more, beside the build, because most builds do without it and
//! because it costs a few per cent of one.

use super::bins::Binner;
use super::field::Field;
use super::ordered::run_ordered;
use crate::error::Result;
use crate::lattice::{NodeKey, Octant};
use crate::progress::Progress;
use crate::solid::{Segment, Solids};
use crate::store::{BeadSegment, StoreWriter, encode_segments};
use rayon::prelude::*;

/// Level at which nodes become jobs: at most 4,096 of them.
const JOB_LEVEL: u8 = 4;

/// A node with the segments that touch it, in the order of the toolpath.
struct Touched {
    key: NodeKey,
    segments: Vec<Segment>,
}

/// Appends to the store, for each of its leaves, the list of the segments that touch it.
pub(super) fn write_identity(
    solids: &Solids,
    segments: Vec<Segment>,
    writer: &mut StoreWriter,
    progress: &dyn Progress,
) -> Result<()> {
    let leaves = writer.leaves();
    let is_leaf = |key: NodeKey| leaves.binary_search(&key).is_ok();
    let solid = segments.into_iter().filter(|segment| !solids.is_void(segment)).collect();
    let mut jobs = vec![Touched { key: NodeKey::ROOT, segments: solid }];
    for _ in 0..JOB_LEVEL {
        let divide = |node: Touched| if is_leaf(node.key) { vec![node] } else { children(solids, &node) };
        jobs = jobs.into_par_iter().flat_map_iter(divide).collect();
        progress.check()?;
    }
    progress.phase("telling beads apart", Some(jobs.len() as u64), "subtrees");
    let work = |(): &mut (), number: usize| {
        progress.check()?;
        let mut lists = Lists::default();
        lists.add(solids, &jobs[number], &is_leaf);
        Ok(lists)
    };
    run_ordered(
        jobs.len(),
        2 * rayon::current_num_threads(),
        || (),
        work,
        |lists: Lists| {
            progress.advance(1);
            let mut from = 0;
            for (key, end) in lists.ends {
                writer.append_identity(key, &lists.bytes[from..end])?;
                from = end;
            }
            Ok(())
        },
    )
}

/// The children that segments touch.
fn children(solids: &Solids, node: &Touched) -> Vec<Touched> {
    let lists = Binner::new(node.key, 1).sort_indices(solids, &node.segments);
    let child = |octant: Octant| Touched {
        key: node.key.child(octant),
        segments: lists.of(octant.index()).iter().map(|&i| node.segments[i as usize]).collect(),
    };
    Octant::all().map(child).filter(|child| !child.segments.is_empty()).collect()
}

/// Encoded lists of some leaves.
#[derive(Default)]
struct Lists {
    ends: Vec<(NodeKey, usize)>,
    bytes: Vec<u8>,
}

impl Lists {
    fn add(&mut self, solids: &Solids, node: &Touched, is_leaf: &impl Fn(NodeKey) -> bool) {
        if !is_leaf(node.key) {
            children(solids, node).iter().for_each(|child| self.add(solids, child, is_leaf));
            return;
        }
        let stored = |s: &Segment| BeadSegment { a: s.a, b: s.b, section: s.profile, bead: s.bead };
        let segments: Vec<BeadSegment> = node.segments.iter().map(stored).collect();
        encode_segments(&segments, &mut self.bytes);
        self.ends.push((node.key, self.bytes.len()));
    }
}
