//! The union of all beads of a toolpath as a closed mesh.
//!
//!     cargo run --release -p brickfield-engine --example union -- part.gcode part.stl

use brickfield_engine::{Builder, Result};

fn main() -> Result<()> {
    let mut arguments = std::env::args().skip(1);
    let toolpath = arguments.next().unwrap_or_else(|| "bench-data/clover.gcode".to_owned());
    let mesh = arguments.next().unwrap_or_else(|| "clover.stl".to_owned());
    let octree = Builder::new().file(toolpath).in_memory()?;
    let summary = octree.write_mesh(&mesh)?;
    println!("{mesh}: {} triangles around {:.0} {}³", summary.triangles, summary.volume, octree.unit());
    Ok(())
}
