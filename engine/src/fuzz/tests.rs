//! The seeds as they are, and changed at random in ways that can be repeated.

use super::TARGETS;
use brickfield_core::disk::sim::SimRng;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

fn seeds(name: &str) -> BTreeMap<PathBuf, Vec<u8>> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../fuzz/seeds").join(name);
    let files = std::fs::read_dir(&folder).unwrap_or_else(|error| panic!("{}: {error}", folder.display()));
    let paths = files.map(|file| file.expect("it is listed").path());
    paths.map(|path| (path.clone(), std::fs::read(&path).expect("it is there"))).collect()
}

/// Changes some bytes, cuts, repeats, or takes over a part of another file.
fn change(bytes: &mut Vec<u8>, other: &[u8], rng: &mut SimRng) {
    for _ in 0..=rng.below(4) {
        let at = rng.below(bytes.len().max(1));
        let end = (at + 1 + rng.below(32)).min(bytes.len());
        match rng.below(8) {
            _ if bytes.is_empty() => bytes.extend_from_slice(other),
            0 => bytes[at] ^= 1 << rng.below(8),
            1 => bytes[at] = rng.below(256) as u8,
            2 => bytes[at..end].fill([0, 0xff, b'9', b' '][rng.below(4)]),
            3 => drop(bytes.drain(at..end)),
            4 => bytes.truncate(at),
            5 => bytes.extend_from_within(at..end),
            6 => drop(bytes.splice(at..at, bytes[at..end].to_vec())),
            _ if other.is_empty() => {}
            _ => {
                let from = rng.below(other.len());
                let part = &other[from..(from + 1 + rng.below(256)).min(other.len())];
                drop(bytes.splice(at..end, part.iter().copied()));
            }
        }
    }
}

/// Feeds each reader `turns` changed seeds.
fn feed_changed(turns: usize) {
    for (name, target) in TARGETS {
        let seeds: Vec<Vec<u8>> = seeds(name).into_values().collect();
        let mut rng = SimRng(name.len() as u64);
        for _ in 0..turns {
            let mut bytes = seeds[rng.below(seeds.len())].clone();
            change(&mut bytes, &seeds[rng.below(seeds.len())], &mut rng);
            target(&bytes);
        }
    }
}

#[test]
fn seeds_are_read() {
    let mut total = 0;
    for (name, target) in TARGETS {
        let seeds = seeds(name);
        assert!(!seeds.is_empty(), "{name} has no seeds");
        for (path, bytes) in seeds {
            println!("{}", path.display());
            target(&bytes);
            total += bytes.len();
        }
    }
    assert!(total < 500 << 10, "{total} bytes");
}

#[test]
fn changed_seeds_are_read_or_refused() {
    feed_changed(300);
}

/// `cargo test --release -p brickfield-engine --lib many_changed_seeds -- --ignored`
#[test]
#[ignore = "minutes"]
fn many_changed_seeds_are_read_or_refused() {
    feed_changed(50_000);
}
