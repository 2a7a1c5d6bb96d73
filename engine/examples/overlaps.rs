//! The pairs of beads that overlap most. The store must tell beads apart.
//!
//!     cargo run --release -p brickfield-engine --example overlaps -- part.gcode

use brickfield_engine::analysis::overlaps;
use brickfield_engine::{Builder, Error, Result, Silent};

fn main() -> Result<()> {
    let toolpath = std::env::args().nth(1).unwrap_or_else(|| "bench-data/clover.gcode".to_owned());
    let octree = Builder::new().file(toolpath).depth(4).identity().write("overlaps.brf")?;
    let no_beads = || Error::setting("the store does not tell beads apart", "build it with identity");
    let store = octree.store().ok_or_else(no_beads)?;
    let tables = store.bead_tables()?.ok_or_else(no_beads)?;
    let mut pairs = overlaps(store, &tables, &Silent)?.pairs;
    pairs.sort_by(|a, b| b.volume.total_cmp(&a.volume));
    for pair in pairs.iter().take(10) {
        let [(a, _), (b, _)] = pair.lines;
        println!("lines {a} and {b}: {:.3} ± {:.3} {}³", pair.volume, pair.volume_error, octree.unit());
    }
    Ok(())
}
