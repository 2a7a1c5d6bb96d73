//! Shards of random piles, each built with other threads and another bound of memory, joined, against one build.

use crate::scene::pile_as_stl;
use brickfield_core::sweep::part_or_all;
use brickfield_engine::Silent;
use brickfield_engine::build::{BuildOptions, Resolution, Resources, ThinDepth, build, merge};
use brickfield_engine::store::{Refine, ShardId, Store};
use proptest::prelude::*;
use std::path::{Path, PathBuf};

fn build_on(threads: usize, input: &Path, output: &Path, options: &BuildOptions) {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
    pool.install(|| build(&[input.to_owned()], output, options, &Silent)).unwrap_or_else(|e| panic!("{e}"));
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(part_or_all(8, 24)))]

    #[test]
    fn joined_shards_are_one_build(
        seed in any::<u64>(),
        pieces in 1usize..12,
        is_open in prop::bool::weighted(0.2),
        depth in 0u8..5,
        refine in prop_oneof![2 => Just(Refine::Hidden), 1 => Just(Refine::Surface), 1 => Just(Refine::Stddev)],
        deeper in prop_oneof![2 => Just(0u8), 1 => 1u8..4],
        of in prop_oneof![4 => 1u32..9, 1 => 9u32..70],
        little in any::<bool>(),
    ) {
        let dir = tempfile::tempdir().unwrap();
        let (input, whole, joined) = (dir.path().join("in.stl"), dir.path().join("whole"), dir.path().join("joined"));
        std::fs::write(&input, pile_as_stl(seed, pieces, is_open)).unwrap();
        // Thin walls need closed input, and no other criterion.
        let thin = match refine {
            Refine::Hidden if !is_open && deeper > 0 => ThinDepth::Deeper(deeper),
            _ => ThinDepth::None,
        };
        let options = BuildOptions {
            // Open bricks take ten times as long.
            resolution: Resolution::Depth(if is_open { depth.min(2) } else { depth }),
            refine,
            thin,
            gwn_error: 1e-2,
            ..BuildOptions::default()
        };
        build_on(2, &input, &whole, &options);
        let mut shards: Vec<PathBuf> = Vec::new();
        let mut next = 0;
        for number in 1..=of {
            let path = dir.path().join(format!("shard {number}"));
            // So little that every leaf is a job of its own.
            let memory = match (little, is_open) {
                (true, false) => 1 << 16,
                // What the caps' far field takes, and little more.
                (true, true) => 84 << 20,
                _ => Resources::default().memory,
            };
            let resources = Resources { memory, ..Resources::default() };
            let options = BuildOptions { shard: ShardId::new(number, of), resources, ..options.clone() };
            build_on(number as usize % 3 + 1, &input, &path, &options);
            let shard = Store::open_any(&path, 0).unwrap().meta().shard.clone().unwrap();
            prop_assert_eq!(shard.cells().start, next);
            next = shard.cells().end;
            shards.insert(seed as usize % (shards.len() + 1), path);
        }
        let summary = merge(&shards, &joined, &Silent).unwrap_or_else(|e| panic!("{e}"));
        prop_assert_eq!(summary.shards, of);
        prop_assert!(std::fs::read(&joined).unwrap() == std::fs::read(&whole).unwrap());
        // Shards stay, nothing else is left.
        prop_assert_eq!(std::fs::read_dir(dir.path()).unwrap().count(), 3 + of as usize);
    }
}
