//! Cutting a tree into shards for several machines: runs of cubes along the Morton curve with about as much work each.
//!
//! Runs, because then joining shards is little more than appending one to the other.

use crate::store::ShardId;
use std::ops::Range;

/// The cubes of shard `id`, by their numbers, if each cube is this much work. The first shard has some `other` work beside.
pub(super) fn cut(id: ShardId, work: &[u64], other: u64) -> Range<u64> {
    let starts = starts(work, id.of, other);
    let start = |number: u32| starts.get(number as usize).map_or(work.len() as u64, |&cell| cell as u64);
    start(id.number - 1)..start(id.number)
}

/// Where each shard begins, if there are at most `shards`, such that the largest has as little work as possible; fewer
/// if that many have the cubes to themselves. A shard is filled up to the largest's work before the next begins.
fn starts(work: &[u64], shards: u32, other: u64) -> Vec<usize> {
    let total: u64 = other + work.iter().sum::<u64>();
    // The bound on a shard is sought by bisection: `enough` suffices, nothing below `least` does.
    let largest = work.iter().copied().max().unwrap_or(0).max(other);
    let mut least = largest.max(total.div_ceil(u64::from(shards)));
    let mut enough = total;
    while least < enough {
        let middle = least + (enough - least) / 2;
        match fill(work, middle, other).len() <= shards as usize {
            true => enough = middle,
            false => least = middle + 1,
        }
    }
    fill(work, enough, other)
}

/// Where shards of at most `bound` begin, each as long as can be.
fn fill(work: &[u64], bound: u64, other: u64) -> Vec<usize> {
    let (mut starts, mut sum) = (vec![0], other);
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
    use crate::lattice::NodeKey;
    use crate::store::{Shard, ShardNumbers};
    use proptest::prelude::*;

    fn cuts(work: &[u64], of: u32) -> Vec<Range<u64>> {
        (1..=of).map(|number| cut(ShardId { number, of }, work, 0)).collect()
    }

    /// The least that the largest of `shards` runs can have, by trying all.
    fn best(work: &[u64], shards: usize) -> u64 {
        if shards == 1 || work.len() <= 1 {
            return work.iter().sum();
        }
        let with_first = |first: usize| {
            let (mine, rest) = work.split_at(first);
            mine.iter().sum::<u64>().max(best(rest, shards - 1))
        };
        (0..=work.len()).map(with_first).min().unwrap_or(0)
    }

    #[test]
    fn one_heavy_cube_stands_alone_and_shards_may_be_empty() {
        assert_eq!(cuts(&[1, 1, 90, 1, 1], 3), [0..2, 2..3, 3..5]);
        assert_eq!(cuts(&[0, 5, 0, 0], 3), [0..4, 4..4, 4..4]);
        assert_eq!(cuts(&[0, 0], 2), [0..2, 2..2]);
    }

    #[test]
    fn the_first_shard_has_less_of_the_cubes_if_it_has_other_work() {
        let of = |number, other| cut(ShardId { number, of: 3 }, &[1; 9], other);
        assert_eq!([of(1, 3), of(2, 3), of(3, 3)], [0..1, 1..5, 5..9]);
        assert_eq!([of(1, 100), of(2, 100), of(3, 100)], [0..0, 0..9, 9..9]);
    }

    #[test]
    fn a_node_is_owned_by_the_shard_of_its_first_cube() {
        let shard = |number| {
            let id = ShardId { number, of: 3 };
            let cells = cut(id, &[1; 64], 0);
            let found = ShardNumbers { cells: (cells.start, cells.end), ..Default::default() };
            Shard { id, level: 2, gwn_error: 1e-3, found }
        };
        let shards = [1, 2, 3].map(shard);
        let owners = |key: NodeKey| shards.iter().filter(|shard| shard.owns(key)).count();
        let key = |level, position| NodeKey::new(level, position).unwrap();
        for node in [NodeKey::ROOT, key(1, [1, 0, 1]), key(2, [3, 1, 2]), key(5, [17, 3, 30])] {
            assert_eq!(owners(node), 1, "{node}");
        }
        assert!(shards.iter().all(|shard| shard.meets(NodeKey::ROOT)));
        assert!(shards[0].owns(NodeKey::ROOT) && !shards[1].owns(NodeKey::ROOT));
        assert_eq!(shards.iter().filter(|shard| shard.meets(key(5, [17, 3, 30]))).count(), 1);
    }

    proptest! {
        #[test]
        fn every_cube_is_in_one_shard(work in prop::collection::vec(0u64..1000, 1..600), of in 1u32..200) {
            let cuts = cuts(&work, of);
            let mut next = 0;
            for cut in &cuts {
                prop_assert_eq!(cut.start, next);
                next = cut.end;
                prop_assert!(cut.start <= cut.end);
            }
            prop_assert_eq!(next, work.len() as u64);
            let of_shard = |cut: &Range<u64>| work[cut.start as usize..cut.end as usize].iter().sum::<u64>();
            let largest = cuts.iter().map(of_shard).max().unwrap_or(0);
            let total: u64 = work.iter().sum();
            prop_assert!(largest <= total.div_ceil(u64::from(of)) + work.iter().max().unwrap());
        }

        #[test]
        fn no_other_cut_has_a_smaller_largest_shard(work in prop::collection::vec(0u64..50, 1..8), of in 1u32..5) {
            let of_shard = |cut: &Range<u64>| work[cut.start as usize..cut.end as usize].iter().sum::<u64>();
            let largest = cuts(&work, of).iter().map(of_shard).max().unwrap_or(0);
            prop_assert_eq!(largest, best(&work, of as usize));
        }
    }
}
