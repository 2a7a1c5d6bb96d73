//! Power cuts: what is on the disk may be any part of what was not made durable.

use super::{NAME, build, expected, job, name, nodes_left};
use crate::disk::sim::{Crash, Op, SimDisk, SimRng, image};
use crate::store::reader::Store;
use crate::store::source::ByteSource;
use crate::store::{BrickTree, testing::brick_at};
use brickfield_core::sweep::part_or_all;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

type Files = BTreeMap<PathBuf, Vec<u8>>;

const CRASHES: [Crash; 4] = [Crash::Dropped, Crash::Kept, Crash::Reordered, Crash::Torn];

/// Cuts the power at every call of a build, `repeats` times in each way, and again while what is left is gone on with.
/// Returns how many images were looked at.
///
/// # Panics
/// If one has lost or changed something that was committed, or does not end in the same bytes.
pub fn cut_everywhere(repeats: usize, seed: u64) -> usize {
    let mut rng = SimRng(seed);
    let disk = SimDisk::default();
    build(&disk).expect("nothing fails");
    let log = disk.log();
    let mut images = 0;
    for cut in 0..=log.len() {
        for crash in CRASHES {
            let repeats = if matches!(crash, Crash::Dropped | Crash::Kept) { 1 } else { repeats };
            for repeat in 0..repeats {
                let files = image(&Files::new(), &log[..cut], crash, &mut rng);
                let recovery = check(&files, &log[..cut], repeat < 4);
                images += 1;
                // The power goes again, anywhere.
                let again = rng.below(recovery.len() + 1);
                let second = CRASHES[rng.below(CRASHES.len())];
                let twice = image(&files, &recovery[..again], second, &mut rng);
                let told = [&log[..cut], &recovery[..again]].concat();
                check(&twice, &told, false);
                images += 1;
            }
        }
    }
    images
}

/// Checks an image and goes on from it; returns what that did.
fn check(files: &Files, told: &[Op], read: bool) -> Vec<Op> {
    let committed = told.iter().filter_map(|op| match op {
        Op::Committed(nodes) => Some(*nodes),
        _ => None,
    });
    let committed = committed.max().unwrap_or(0);
    let finished = told.iter().any(|op| matches!(op, Op::Finished));
    match files.get(Path::new(NAME)) {
        Some(bytes) => assert!(bytes == expected(), "the name stands for something else"),
        None => {
            assert!(!finished, "a finished store is gone");
            let left = nodes_left(files);
            assert!(left >= committed, "{left} nodes are left of {committed} that were committed");
        }
    }
    if read {
        read_part(files, committed > 0);
    }
    let disk = SimDisk::holding(files);
    build(&disk).expect("nothing fails");
    let after = disk.files();
    assert!(after[Path::new(NAME)] == expected(), "other bytes");
    assert_eq!(after.len(), 1, "something is left behind");
    disk.log()
}

/// Whoever reads the unfinished file sees a state of it as a whole, or none.
fn read_part(files: &Files, has_commits: bool) {
    let Some(part) = files.get(&name(".part")) else { return };
    let journal = |path: &Path| files.get(path).cloned();
    let store = match Store::of_source(&name(".part"), ByteSource::Memory(part.clone()), 0, &journal) {
        Ok(store) => store,
        Err(error) if has_commits => panic!("{error}"),
        Err(_) => return,
    };
    for key in store.keys() {
        let leaf = store.node(key).expect("its own key").leaf;
        assert!(*store.brick(key).expect("a sound record") == brick_at(key, leaf), "another brick at {key}");
    }
    assert!(store.is_unfinished() || store.entries().len() == job().records.len());
}

#[test]
fn no_power_cut_loses_or_changes_what_was_committed() {
    // Cuts during recovery are counted in.
    let images = cut_everywhere(part_or_all(12, 46), 7);
    println!("{images} images");
    assert!(images >= part_or_all(2_500, 10_000), "{images} images");
}
