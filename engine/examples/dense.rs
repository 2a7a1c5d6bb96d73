//! A level of a store as an array, and its histogram of winding numbers.
//!
//!     cargo run --release -p brickfield-engine --example dense -- part.brf 2

use brickfield_engine::{Octree, Result};
use std::collections::BTreeMap;

fn main() -> Result<()> {
    let mut arguments = std::env::args().skip(1);
    let octree = Octree::open(arguments.next().unwrap_or_else(|| "clover.brf".to_owned()))?;
    let level = arguments.next().and_then(|level| level.parse().ok()).unwrap_or(1);
    let mut counts = BTreeMap::<i64, u64>::new();
    for w in octree.samples(level)? {
        *counts.entry(w.round() as i64).or_default() += 1;
    }
    for (w, count) in counts {
        println!("w = {w}: {count} samples");
    }
    Ok(())
}
