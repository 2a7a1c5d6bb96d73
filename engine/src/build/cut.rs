//! Cutting a tree into shares for several machines: runs of cubes along the Morton curve with about as much work each.
//!
//! Runs, because then joining shares is little more than appending one to the other.

use crate::lattice::NodeKey;
use crate::store::{ShareId, cells_of};
use std::ops::Range;

/// The share to build.
#[derive(Clone, Debug)]
pub(super) struct Cut {
    /// Level of the cubes that are shared out.
    pub level: u8,
    /// Those of this share.
    pub cells: Range<u64>,
}

impl Cut {
    /// Share `id` of cubes with this much work each.
    pub fn new(id: ShareId, level: u8, work: &[u64]) -> Cut {
        let starts = starts(work, id.of);
        let start = |number: u32| starts.get(number as usize).map_or(work.len() as u64, |&cell| cell as u64);
        Cut { level, cells: start(id.number - 1)..start(id.number) }
    }

    /// Whether a node has a cube of the share, or lies in one.
    pub fn meets(&self, key: NodeKey) -> bool {
        let cells = cells_of(key, self.level);
        !self.cells.is_empty() && cells.start < self.cells.end && self.cells.start < cells.end
    }

    /// Whether the node's first cube is the share's.
    pub fn owns(&self, key: NodeKey) -> bool {
        self.cells.contains(&cells_of(key, self.level).start)
    }
}

/// Where each share begins, if there are at most `shares`, such that the largest has as little work as possible; fewer
/// if that many have the cubes to themselves. A share is filled up to the largest's work before the next begins.
fn starts(work: &[u64], shares: u32) -> Vec<usize> {
    let total: u64 = work.iter().sum();
    // The bound on a share is sought by bisection: `enough` suffices, nothing below `least` does.
    let largest = work.iter().copied().max().unwrap_or(0);
    let mut least = largest.max(total.div_ceil(u64::from(shares)));
    let mut enough = total;
    while least < enough {
        let middle = least + (enough - least) / 2;
        match fill(work, middle).len() <= shares as usize {
            true => enough = middle,
            false => least = middle + 1,
        }
    }
    fill(work, enough)
}

/// Where shares of at most `bound` begin, each as long as can be.
fn fill(work: &[u64], bound: u64) -> Vec<usize> {
    let (mut starts, mut sum) = (vec![0], 0u64);
    for (cell, &more) in work.iter().enumerate() {
        sum += more;
        if sum > bound {
            starts.push(cell);
            sum = more;
        }
    }
    starts
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn cuts(work: &[u64], of: u32) -> Vec<Cut> {
        (1..=of).map(|number| Cut::new(ShareId { number, of }, 2, work)).collect()
    }

    /// The least that the largest of `shares` runs can have, by trying all.
    fn best(work: &[u64], shares: usize) -> u64 {
        if shares == 1 || work.len() <= 1 {
            return work.iter().sum();
        }
        let with_first = |first: usize| {
            let (mine, rest) = work.split_at(first);
            mine.iter().sum::<u64>().max(best(rest, shares - 1))
        };
        (0..=work.len()).map(with_first).min().unwrap_or(0)
    }

    #[test]
    fn one_heavy_cube_stands_alone_and_shares_may_be_empty() {
        let cells = |work: &[u64], of| cuts(work, of).into_iter().map(|cut| cut.cells).collect::<Vec<_>>();
        assert_eq!(cells(&[1, 1, 90, 1, 1], 3), [0..2, 2..3, 3..5]);
        assert_eq!(cells(&[0, 5, 0, 0], 3), [0..4, 4..4, 4..4]);
        assert_eq!(cells(&[0, 0], 2), [0..2, 2..2]);
    }

    #[test]
    fn a_node_is_owned_by_the_share_of_its_first_cube() {
        let cuts = cuts(&[1; 64], 3);
        let owners = |key: NodeKey| cuts.iter().filter(|cut| cut.owns(key)).count();
        let key = |level, position| NodeKey::new(level, position).unwrap();
        for node in [NodeKey::ROOT, key(1, [1, 0, 1]), key(2, [3, 1, 2]), key(5, [17, 3, 30])] {
            assert_eq!(owners(node), 1, "{node}");
        }
        assert!(cuts.iter().all(|cut| cut.meets(NodeKey::ROOT)));
        assert!(cuts[0].owns(NodeKey::ROOT) && !cuts[1].owns(NodeKey::ROOT));
        assert_eq!(cuts.iter().filter(|cut| cut.meets(key(5, [17, 3, 30]))).count(), 1);
    }

    proptest! {
        #[test]
        fn every_cube_is_in_one_share(work in prop::collection::vec(0u64..1000, 1..600), of in 1u32..200) {
            let cuts = cuts(&work, of);
            let mut next = 0;
            for cut in &cuts {
                prop_assert_eq!(cut.cells.start, next);
                next = cut.cells.end;
                prop_assert!(cut.cells.start <= cut.cells.end);
            }
            prop_assert_eq!(next, work.len() as u64);
            let of_share = |cut: &Cut| work[cut.cells.start as usize..cut.cells.end as usize].iter().sum::<u64>();
            let largest = cuts.iter().map(of_share).max().unwrap_or(0);
            let total: u64 = work.iter().sum();
            prop_assert!(largest <= total.div_ceil(u64::from(of)) + work.iter().max().unwrap());
        }

        #[test]
        fn no_other_cut_has_a_smaller_largest_share(work in prop::collection::vec(0u64..50, 1..8), of in 1u32..5) {
            let of_share = |cut: &Cut| work[cut.cells.start as usize..cut.cells.end as usize].iter().sum::<u64>();
            let largest = cuts(&work, of).iter().map(of_share).max().unwrap_or(0);
            prop_assert_eq!(largest, best(&work, of as usize));
        }
    }
}
